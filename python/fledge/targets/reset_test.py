# SPDX-License-Identifier: Apache-2.0
"""Resets of a flight computer: when it is down, what it forgets, and that a target does as the desktop does."""

import numpy as np
import pytest

import fledge
from fledge import SetupError, cli, flight as fsw, objects, world
from fledge.archive import Archive
from fledge.units import A, V, ms, ohm, s
from tests.needs import flies_on

FLIGHT = '''
from fledge import flight as fsw
from fledge.units import rad, s


def build(f):
    f.rest  = fsw.InertialPointing()
    f.spin  = fsw.EulerRotation(rates=[0, 0, 1e-3] * rad / s)
    f.count = fsw.BootCount()
    f.loads = fsw.PowerManager(on=1)
    f.connect(f.rest.reference >> f.spin.base)
    fast = f.task("fast", every=0.5 * s, run=[f.rest, f.loads])
    slow = f.task("slow", every=1.2 * s, offset=0.3 * s, run=[f.spin])
    f.task("always", every=2 * s, offset=1 * s, run=[f.count])
    f.mode("begin", [fast])
    f.mode("turn", [fast, slow])
    f.event("turns", when=f.watch(f.rest.reference).head.sequence >= 8, enter=f.turn,
            set=[(f.watch(f.spin).rates, [0, 0, 2e-3])], once=True)
    f.reset_by(f.count.computer, down=DOWN * s)
'''

WORLD = '''
from fledge import world
from fledge.units import A, V, ms, ohm, s


def build(w, f):
    w.power  = world.PowerUnit(n=1, volts=30 * V, load=10 * ohm, count_current=1e-3 * A, count_volts=1e-3 * V,
                               reset_at=AT * s)
    w.memory = world.Interconnect(slots=1)
    w.connect(w.power.telemetry >> f.loads.power, f.loads.command >> w.power.command,
              w.power.computer >> f.count.computer, w.memory.reply >> f.count.reply,
              f.count.request >> w.memory.request)
    w.task("dynamics", every=100 * ms, run=[w.power, w.memory])
'''
RATES = {"rest.reference": (500, 0), "spin.reference": (1200, 300), "count.boot": (2000, 1000)}     # [ms]


def mission(folder, at, down):
    folder.mkdir()
    (folder / "flight.py").write_text(FLIGHT.replace("DOWN", repr(down)))
    (folder / "world.py").write_text(WORLD.replace("AT", repr([*at, 0, 0, 0][:4])))
    return folder


def expected(at, down, end):
    """Output -> {time [ms]: its sequence}, by a plain walk over the instants of flight, without the kernel's rules."""
    def on_grid(t, name):
        period, offset = RATES[name]
        return t >= offset and (t - offset) % period == 0

    outputs = {name: {} for name in RATES}
    ran, seen, until, since = dict.fromkeys(RATES, 0), 0, None, None
    for t in range(end + 1):
        due = [name for name in RATES if on_grid(t, name)]
        if not due:
            continue
        count = sum(x * 1000 <= t for x in at)
        if until is None and count != seen:
            until = t + down * 1000
        if until is not None and t < until:
            continue
        if until is not None:
            until, seen, since = None, count, None
            ran = dict.fromkeys(RATES, 0)
        for name in due:
            if name != "spin.reference" or since is not None and t > since:
                ran[name] += 1
                outputs[name][t] = ran[name]
        if ran["rest.reference"] == 8 and since is None and "rest.reference" in due:
            since = t      # the event asks for the mode, which begins at the next instant
    return outputs


CASES = [([10.05], 3.0), ([10.05, 30.0], 0.0), ([0.2, 7.3, 8.0], 2.35),
         ([12.0], 40.0), ([6.01, 14.02, 22.03, 30.04], 1.0)]


@pytest.mark.parametrize("at, down", CASES)
def test_the_computer_is_down_for_its_time_and_then_begins_anew(at, down, tmp_path):
    sim = fledge.load(str(mission(tmp_path / "resets", at, down)))
    f = sim.flight
    log = sim.record(f.rest.reference, f.spin.reference, f.count.boot, every=100 * ms)
    sim.run(40 * s)
    for name, rows in expected(at, down, 40_000).items():
        t = log[f"{name}.head.t"] // 1_000_000
        sequence = log[f"{name}.head.sequence"]
        at_once = np.round(log.time * 1000).astype(int) == t
        assert dict(zip(t[at_once & (sequence > 0)].tolist(),
                    sequence[at_once & (sequence > 0)].tolist())) == rows, name


@pytest.mark.long("builds and flies on targets")
@pytest.mark.parametrize("target", [pytest.param(name, marks=flies_on(name)) for name in (
    "linux", "micropython", "leon3-micropython", "leon3-rtems")])
def test_a_target_is_reset_as_the_desktop_is(target, tmp_path, capsys):
    at, down = CASES[2]
    folder, out = mission(tmp_path / "resets", at, down), tmp_path / "out"
    assert cli.main(["fly", str(folder), "--for", "40s", "--on", target, "--out", str(out)]) == 0, \
        capsys.readouterr()
    record = Archive(out / f"{target}.mcap")
    for name, rows in expected(at, down, 40_000).items():
        times, sequence = (record[f"{name}.head.{field}"] for field in ("t", "sequence"))
        assert dict(zip((times // 1_000_000)[sequence > 0].tolist(), sequence[sequence > 0].tolist())) == rows, name


def test_parameters_are_those_of_the_beginning_and_commands_that_wait_are_lost(tmp_path):
    sim = fledge.load(str(mission(tmp_path / "resets", [10.0], 3.0)))
    f = sim.flight
    f.spin.rates = [0, 0, 5e-3]        # before the run: as it was built
    sim.run(8 * s)
    assert f.active_mode == "turn" and f.spin.rates[2] == 2e-3, "the event has set it"
    f.loads.clear_after = 5 * s
    sim.run(4 * s)
    assert f.active_mode == "turn" and f.loads.clear_after == 5_000_000_000, "while it is down nothing changes"
    sim.run(2 * s)
    assert f.active_mode == "begin" and f.spin.rates[2] == 5e-3 and f.loads.clear_after == 0
    assert f.events["turns"].armed, "events are as at the start"
    sim.reset()
    assert f.outages == []
    sim.run(10 * s)
    assert f.outages == [(10_000_000_000, 13_000_000_000)]


def test_what_cannot_reset_a_computer_is_refused():
    sim = fledge.Simulation("refused")
    f, w = sim.flight, sim.world
    f.count = fsw.BootCount()
    f.loads = fsw.PowerManager()
    w.power = world.PowerUnit(n=1, volts=30 * V, load=10 * ohm, count_current=1e-3 * A, count_volts=1e-3 * V)
    for port in (f.loads.power, f.count.boot, w.power.computer):
        with pytest.raises(SetupError, match="flight.reset_by: expected an input of a module of this process, a Comp"):
            f.reset_by(port)
    with pytest.raises(SetupError, match=r"flight.reset_by: down must be >= 0, found -1 s"):
        f.reset_by(f.count.computer, down=-1 * s)
    assert f.reset is None
    for down in (0, 1):
        f.reset_by(f.count.computer, down=down * s)
        assert f.reset == ("flight.count.computer", down * 1_000_000_000)


BOARD = flies_on("leon3")


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return tmp_path_factory.mktemp("board")


@pytest.fixture
def on_board(built):
    from fledge import emulator

    return emulator.load("flatsat", folder=built)


@pytest.mark.long("builds a board")
@BOARD
def test_a_board_in_python_is_reset_as_the_desktop_is(on_board):
    desktop = fledge.load("flatsat")
    for sim in (on_board.sim, desktop):
        sim.run(62 * s)
    saved = on_board.snapshot()
    for _ in range(2):      # the second time from within the outage
        for sim in (on_board.sim, desktop):
            sim.run(until=70 * s)
        for name in ("tracking.error", "boot.boot", "time.time", "drive.drive"):
            ours, theirs = (objects.memory(getattr(getattr(sim.flight, name.split(".")[0]), name.split(".")[1]))
                            for sim in (on_board.sim, desktop))
            assert ours == theirs, name
        assert on_board.flight.boot.boot.boots == 2 and on_board.core.resets == 1
        assert on_board.core.watchdog_resets == 0 and on_board.missed == 0
        on_board.restore(saved)


@pytest.mark.long("builds a board")
@BOARD
@pytest.mark.parametrize("watchdog", ["of the power unit", "of the board"])
def test_flight_that_hangs_is_brought_back_by_a_watchdog(on_board, watchdog):
    """The program runs into a loop without an end, while the world goes on."""
    sim, own = on_board.sim, watchdog == "of the board"
    if own:
        sim.world.power.watchdog = 0 * s
    sim.run(80 * s)
    on_board.poke("mrp_feedback_update", bytes.fromhex("10800000"))     # a branch to itself
    sim.run(5 * s)
    assert on_board.missed == 10
    drive, rate = objects.memory(sim.flight.drive.drive), sim.world.craft.state.omega_BN_B.tolist()
    sim.run(1 * s)
    assert objects.memory(sim.flight.drive.drive) == drive and sim.world.craft.state.omega_BN_B.tolist() != rate
    sim.run(24 * s)
    # 10 s after the last call of bare_idle, in the tick at 80 s; or 6 s after the heartbeat of that tick came.
    missed = on_board.missed
    assert (on_board.core.resets, on_board.core.watchdog_resets) == (2, 1 if own else 0)
    assert missed == (19 if own else 12)
    sim.run(5 * 60 * s)
    assert on_board.missed == missed, "since then it answers each tick"
    boot = sim.flight.boot.boot
    assert boot.boots == 3 == sim.world.memory.memory[3][0] and boot.own == own
    time = sim.world.clock.epoch + sim.time_ns
    assert abs(sim.flight.time.time.time - time) < 50_000 and sim.flight.time.time.synchronized == 1
    assert np.linalg.norm(sim.flight.tracking.error.sigma_BR) < 1e-3
