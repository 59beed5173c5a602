# SPDX-License-Identifier: Apache-2.0
"""The fault protection in a mission: pairs of star trackers and gyros, the loads behind them, safe mode, and what stays
over a reset of the computer, on the desktop and on targets."""
import pytest

import fledge
from fledge.commands import Code, Reason, decoded, read_script
from fledge.errors import SetupError
from fledge.targets.job import Job
from fledge.targets.services_test import fly_everywhere, written
from fledge.units import s

FLIGHT = '''
from fledge import flight as fsw
from fledge.units import arcsec, deg, hour, ms, rad, s

UNITS = [("stars a", "PRIMARY", 0, 0b0001), ("stars b", "REDUNDANT", 0, 0b0010),
         ("gyro a", "PRIMARY", 1, 0b0100), ("gyro b", "REDUNDANT", 1, 0b1000)]


def build(f):
    f.protection = fsw.FaultProtection(slot=3)
    for unit, (name, start, kind, loads) in zip(f.protection.units, UNITS):
        unit.name, unit.start, unit.kind, unit.loads = name, f"UNIT_{start}", kind, loads
    f.stored = fsw.StoredCommands()
    f.log    = fsw.EventLog(least=1)
    f.stars  = fsw.StarSelect(places=[0, 1])
    f.gyro   = fsw.GyroSelect(places=[2, 3])
    f.filter = fsw.AttitudeMekf(rate_noise=(0.2 * deg)**2 / hour, bias_walk=(1 * deg / hour)**2 / hour,
                                bias_std=20 * deg / hour, star_std=20 * arcsec, gate=5, persistence=5, hold=1 * s,
                                coast=60 * s)
    f.power  = fsw.PowerManager(on=0)
    f.rest   = fsw.InertialPointing()
    f.count  = fsw.BootCount()
    f.share  = fsw.NvmShare()
    f.connect(
        f.protection.table   >> [f.stars.units, f.gyro.units, f.power.units],
        f.stars.attitude     >> f.filter.stars,
        f.gyro.rate          >> f.filter.gyro,
        f.protection.request >> f.share.ask_a,
        f.share.reply_a      >> f.protection.reply,
        f.count.request      >> f.share.ask_b,
        f.share.reply_b      >> f.count.reply,
    )
    f.task("sense",    every=200 * ms, run=[f.stars, f.gyro, f.filter])
    f.task("services", every=1 * s, run=[f.protection, f.power, f.stored, f.log])
    f.mode("point", [f.task("point", every=1 * s, run=[f.rest])])
    f.mode("safe", [])
    f.task("memory",   every=500 * ms, run=[f.count, f.share])
    f.reset_by(f.count.computer, down=3 * s)
'''

WORLD = '''
from fledge import Orbit, world
from fledge.units import A, V, deg, hour, kg, km, m, ms, ohm, rad, s


def build(w, f):
    w.craft = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, gravity=[world.MARS],
                               orbit=Orbit(world.MARS, a=7471.618 * km, e=0.4, f=270 * deg),
                               sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.001, -0.01, 0.02] * rad / s)
    look = dict(boresight_B=[1, 0, 0], noise_across=1e-10, sun_exclusion=0, planet_exclusion=0, rate_max=1 * rad / s)
    turn = dict(noise=[1e-12] * 3, limit=1 * rad / s)
    w.stars_a = world.StarTracker(**look, faults=[dict(kind="DROPOUT", begin=20 * s)])
    w.stars_b = world.StarTracker(**look, faults=[dict(kind="DROPOUT", begin=90 * s)])
    w.gyro_a = world.Gyro(**turn, faults=[dict(kind="HIGH", channels=1, begin=50 * s)])
    w.gyro_b = world.Gyro(**turn)
    w.power  = world.PowerUnit(n=4, volts=30 * V, load=[10, 10, 20, 20] * ohm, count_current=1e-3 * A,
                               count_volts=1e-3 * V, reset_at=[70, 0, 0, 0] * s)
    w.memory = world.Interconnect(slots=4)
    w.connect(
        w.craft.state           >> [w.stars_a.truth, w.stars_b.truth, w.gyro_a.truth, w.gyro_b.truth],
        w.stars_a.attitude      >> f.stars.a,
        w.stars_b.attitude      >> f.stars.b,
        w.gyro_a.rate           >> f.gyro.a,
        w.gyro_b.rate           >> f.gyro.b,
        w.power.telemetry       >> f.power.power,
        f.power.command         >> w.power.command,
        w.power.computer        >> f.count.computer,
        w.memory.reply          >> f.share.reply,
        f.share.request         >> w.memory.request,
    )
    w.task("dynamics", every=100 * ms, run=[w.craft, w.gyro_a, w.gyro_b, w.power, w.memory])
    w.task("stars", every=500 * ms, run=[w.stars_a, w.stars_b])
'''

PLAY = '''
from fledge.units import s


def rules(sim):
    p = sim.flight.commands.packets
    hold = 3 * 10**9
    sim.flight.commands.preset(
        *(p.rule(i, f"flight.stars.choice.age[{i}]", high=2, hold=hold, unit=i, becomes="faulted") for i in (0, 1)),
        *(p.rule(i, "flight.gyro.rate.omega_BN_B", measure="max_abs", high=0.5, count=3, unit=i, becomes="faulted")
          for i in (2, 3)),
        p.rule(31, "flight.protection.table.lost", equals=0, mode="safe", starts=4, limit=1))


def fails(sim):
    """Each pair's first unit fails, the computer is reset, then the other star tracker fails, too."""
    c, p = sim.flight.commands, sim.flight.commands.packets
    rules(sim)
    c.telemetry()
    sim.run(10 * s)
    c.unit(0, "redundant")              # a swap, and back
    sim.run(2 * s)
    c.unit(0, "primary")
    c.unit(1, "redundant")
    sim.run(70 * s)
    c.telemetry()
    c.sequence(4, [(2 * s, p.unit(2, "off")), (3 * s, p.unit(3, "off")), (4 * s, p.unit(3, "off", even=True))])
    sim.run(30 * s)
    c.clear_fault()
    sim.run(10 * s)
'''


@pytest.fixture
def mission(tmp_path):
    return written(tmp_path / "pairs", FLIGHT, PLAY, WORLD)


@pytest.mark.long("builds and flies on all targets")
def test_a_pair_takes_over_and_safe_mode_follows_the_last_one_on_every_target(mission, tmp_path, capsys):
    out = tmp_path / "out"
    on = fly_everywhere(mission, "fails", out, capsys)
    sim = fledge.load(mission)
    commands = sim.flight.commands
    assert commands.take_packets() == []
    sim.scenarios["fails"]()
    desktop = [command.packet for command in commands.take_packets()]
    for name in on:
        assert [timed.packet for timed in read_script((out / f"{name}.telemetry.txt").read_text())] == desktop, name
    assert Job(str(mission), "fails", folder=out).parts[0].reports(on[0]) == commands.reports
    values = {}
    for packet in desktop:
        telemetry = decoded(commands.dictionary, packet)
        values.setdefault(telemetry.path, []).append(telemetry.content)
    check_tables(values["flight.protection.table"])
    events = [event for event in values["events"] if event.output == "flight.protection.event"]
    assert [(event.name, event.severity) for event in events] == [
        ("SET", "info"), ("SET", "info"), ("FIRED", "medium"), ("FIRED", "medium"), ("RESTORED", "info"),
        ("LOST", "high"), ("FIRED", "medium"), ("SET", "info"), ("SET", "info"), ("SET", "info"), ("FIRED", "medium"),
        ("LOST", "high")]
    assert "FIRED rule 0, value 5.1, unit 0, successor 1" in str(values["events"][2])
    own = [(report.rule, report.stored_on, report.code, report.reason)
           for report in commands.reports if report.own and report.executed]
    assert own == [(31, None, Code.MODE, Reason.OK), (31, None, Code.CONTROL, Reason.OK),
                   (None, 4, Code.UNIT, Reason.OK), (None, 4, Code.UNIT, Reason.LAST), (None, 4, Code.UNIT, Reason.OK)]
    assert sim.mode == "safe"


def check_tables(tables):
    """What each unit is from when on: in use, ready, faulted, off."""
    changes = []
    for table in tables:
        states = "".join(name.removeprefix("UNIT_")[0] for name in table["state"][:4])
        if not changes or states != changes[-1][1]:
            changes.append((table["head"]["t"] / 1e9, states))
    assert changes == [
        (0, "PRPR"), (10.2, "RPPR"), (12.2, "PRPR"),        # by the ground
        (24.8, "FPPR"), (50.5, "FPFP"),                     # silent for 2 s, and then for 3 s; at its limit
        (94.8, "FFFP"), (97, "FFOP"), (99, "FFOO"),         # safe mode, and its sequence
        (112.2, "PROO"), (115.2, "FPOO"), (118.2, "FFOO")]  # cleared, but silent still


def test_a_reset_of_the_computer_keeps_faults_and_switches_no_load(mission):
    """Units a are faulted; flight is down from 70 to 73 s, and knows nothing before the memory has answered."""
    sim = fledge.load(mission)
    f = sim.flight
    sim.scenarios["rules"]()
    seen = []
    for _ in range(85):
        sim.run(1 * s)
        seen.append((sim.world.power.telemetry.cards[0].on, f.stars.choice.taken, f.gyro.choice.taken))
    assert seen[15] == (0b0101, 1, 1) and seen[30] == (0b0110, 2, 1) and seen[60] == (0b1010, 2, 2)
    assert seen[72:] == [(0b1010, 0, 0)] * 3 + [(0b1010, 2, 2)] * 10
    assert f.protection.table.faulted == 0b0101 and f.protection.table.kept == 1
    assert f.count.boot.boots == 2 and f.count.boot.kept == 1       # by the same memory
    assert f.filter.attitude.head.quality == 3 and f.outages == [(70 * 10**9, 73 * 10**9)]


def test_what_is_no_rule_is_refused(mission):
    sim = fledge.load(mission)
    packets = sim.flight.commands.packets
    with pytest.raises(SetupError, match="flight.protection has the rules 0 to 31; found 32"):
        packets.rule(32, "flight.protection.table.lost", equals=0)
    with pytest.raises(SetupError, match="a rule by which a unit becomes off has a unit"):
        packets.rule(0, "flight.protection.table.lost", equals=0, becomes="off")
    with pytest.raises(SetupError, match="a unit has no state 'broken'"):
        packets.unit(0, "broken")
    with pytest.raises(SetupError, match="preset: give packets that write parameters, before the first run"):
        sim.flight.commands.preset(packets.noop())
    sim.run(1 * s)
    with pytest.raises(SetupError, match="before the first run"):
        sim.flight.commands.preset(packets.rule(0, on=False))
    assert [report.reason for report in sim.flight.commands.unit(40, "off")] == [Reason.PLACE]
