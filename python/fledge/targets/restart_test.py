# SPDX-License-Identifier: Apache-2.0
"""A reset of the computer in the middle of a burn: tables of the start, what was executed, and what was gained come
back, on the desktop and on every target."""
import pytest

import fledge
from fledge.commands import Reason, decoded, read_script
from fledge.targets.services_test import fly_everywhere, written

FLIGHT = '''
from fledge import flight as fsw
from fledge.units import m, minute, ms, rad, s


def build(f):
    f.boot   = fsw.BootCount()
    f.share  = fsw.NvmShare()
    f.memory = fsw.BurnMemory(slot=2)
    f.stored = fsw.StoredCommands(slot=3, late=30 * s)
    f.files  = fsw.Files(entity=2, ground=1, rate=4000 / s, kept=1, boot=1)
    f.log    = fsw.EventLog(least=1)
    f.gains  = fsw.InertialPointing()
    f.sum    = fsw.DeltaVAccumulation()
    f.plan   = fsw.BurnPlan(n=1, start=[4e8] * s, dv_N=[[1, 0, 0]] * m / s)
    f.burn   = fsw.BurnExecution(engines_used=1, longest=2 * minute, wait=1 * s, hold=2 * s)
    f.connect(
        f.boot.request   >> f.share.ask_a,
        f.share.reply_a  >> f.boot.reply,
        f.memory.request >> f.share.ask_b,
        f.share.reply_b  >> f.memory.reply,
        f.stored.request >> f.share.ask_c,
        f.share.reply_c  >> f.stored.reply,
        f.memory.kept    >> [f.plan.kept, f.burn.kept],
        f.plan.command   >> f.burn.command,
        f.burn.state     >> [f.plan.state, f.memory.state],
        f.sum.sum        >> f.burn.sum,
    )
    f.task("computer", every=100 * ms, run=[f.share, f.boot, f.memory, f.stored, f.files, f.log])
    f.mode("rest", [])
    f.mode("delta_v", [f.task("delta_v", every=200 * ms, run=[f.plan, f.sum, f.burn])])
    f.task("rest", every=1 * s, run=[f.gains])
    f.reset_by(f.boot.computer, down=3 * s)
    kept, files = f.watch(f.memory.kept), f.watch(f.files.state)
    f.event("resume", when=(kept.phase == "CUT") & (files.booted == 1), modes=[f.rest], enter=f.delta_v)
'''

WORLD = '''
from fledge import Orbit, world
from fledge.units import A, N, V, kg, km, m, ms, ohm, rad, s


def build(w, f):
    w.engine = world.Thrusters(r_TB_B=[[0, 0, -1]] * m, axes_B=[[0, 0, 1]], F=200 * N, isp=230 * s,
                               r_KB_B=[[0, 0, 0]] * m, propellant=[50] * kg, radius=[0.3] * m)
    w.craft  = world.Spacecraft(mass=250 * kg, I_B=[100, 100, 100] * kg * m**2, parts=[w.engine],
                                gravity=[world.MARS], orbit=Orbit(world.MARS, a=7471.618 * km, e=0.1))
    w.nav    = world.Navigation()
    w.acc    = world.Accelerometer()
    w.power  = world.PowerUnit(n=1, volts=30 * V, load=[10] * ohm, count_current=1e-3 * A, count_volts=1e-3 * V,
                               reset_at=[40, 0, 0, 0] * s)
    w.memory = world.Interconnect(slots=4)
    w.store  = world.Recorder(pages=40)
    w.connect(
        w.craft.state    >> [w.nav.truth, w.acc.truth],
        w.nav.attitude   >> f.sum.attitude,
        w.acc.force      >> f.sum.force,
        f.burn.engines   >> w.engine.times,
        w.power.computer >> f.boot.computer,
        w.memory.reply   >> f.share.reply,
        f.share.request  >> w.memory.request,
        w.store.reply    >> f.files.recorded,
        f.files.request  >> w.store.request,
    )
    w.task("dynamics", every=100 * ms, run=[w.power, w.memory, w.store, w.craft, w.nav, w.acc])
'''

PLAY = '''
from pathlib import Path
from tempfile import TemporaryDirectory

from fledge import flight as fsw
from fledge import ground
from fledge.commands import Packets
from fledge.mission.commands import fill_store
from fledge.units import m, s


def insertion(sim):
    """The ground sends its tables, and the computer is reset at 40 s, in the middle of a burn of 20 m/s."""
    c, f = sim.flight.commands, sim.flight
    with TemporaryDirectory() as folder, ground.connect(sim) as craft:
        p = Packets(craft.dictionary)
        sequence = [(20, p.write("flight.gains", sigma_RN=[0.1, 0, 0])[0]), (25, p.mode("delta_v")),
                    (39.4, p.write("flight.gains", sigma_RN=[0.2, 0, 0])[0]),
                    (42, p.write("flight.gains", sigma_RN=[0.3, 0, 0])[0]), (80, p.mode("rest"))]
        stored = fill_store(fsw.StoredCommands(slot=3, late=30 * s),
                            [p.store(0, 0, round(t * 1e9), one) for t, one in sequence])
        plan = fsw.BurnPlan(n=1, start=[26] * s, dv_N=[[0, 0, 20]] * m / s)
        craft.command("telemetry").completed()
        wrong = bytearray(c.table(f.plan))
        wrong[40] ^= 1
        tables = {"flight.plan": c.table(f.plan, plan),
                  "flight.stored": c.table(f.stored, stored), "": bytes(wrong)}
        craft.wait(lambda t: t.flight.files.state.booted, within=10 * s)
        for name, table in tables.items():
            path = Path(folder) / "table"
            path.write_bytes(table)
            to = "boot/" + (name.partition(".")[2] or "wrong")
            craft.put(path, to=to, within=15 * s)
            if name:
                craft.command("load_table", name, to).completed()
        craft.listen((90 - sim.time) * s)
'''


@pytest.fixture
def mission(tmp_path):
    return written(tmp_path / "restart", FLIGHT, PLAY, WORLD)


@pytest.mark.long("builds and flies on all targets")
def test_a_burn_goes_on_after_a_reset_on_every_target(mission, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    on = fly_everywhere(mission, "insertion", out, capsys)
    sim = fledge.load(mission)
    f, commands, desktop = sim.flight, sim.flight.commands, []
    take = commands.take_packets

    def taken():
        flown = take()
        desktop.extend(timed.packet for timed in flown)
        return flown

    monkeypatch.setattr(commands, "take_packets", taken)
    sim.scenarios["insertion"]()
    for name in on:
        assert [timed.packet for timed in read_script((out / f"{name}.telemetry.txt").read_text())] == desktop, name

    # Each command of the sequence once, the one that came due while the computer was down late.
    done = [(report.t / 1e9, report.reason) for report in commands.reports if report.stored_on == 0 and report.executed]
    assert [t for t, _ in done] == [20.3, 25.3, 39.7, 45.6, 80.3] and {why for _, why in done} == {Reason.OK}
    assert f.gains.sigma_RN[0] == 0.3, "as built it would be 0"

    # The whole change of velocity, and what the engine gave while it was not counted.
    gained = sim.world.engine.output.impulse[0] / 299
    assert f.memory.kept.phase.name == "COMPLETE" and abs(f.memory.kept.gained - 20) < 0.2
    assert 0 < gained - 20 < 1, gained
    assert f.outages == [(40 * 10**9, 43 * 10**9)] and f.files.state.tables == 2
    events = [telemetry.content for telemetry in (decoded(commands.dictionary, packet) for packet in desktop)
              if telemetry.path == "events"]
    events_ = [(event.output.split(".")[1], event.name) for event in events]
    assert events_.count(("files", "REFUSED")) == 1 and events_.count(("files", "LOADED")) == 2
    assert [name for module, name in events_ if module == "memory"] == [
        "BEGUN", "CUT", "RESUMED", "ENDED"]
    assert ("stored", "OVER") in events_
