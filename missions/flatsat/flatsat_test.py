# SPDX-License-Identifier: Apache-2.0
"""The mission as numbers: what the units do, what a reset takes away and what it leaves, and that all of it is the same
through the registers of four boards, on every target."""

import struct
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import cli, export
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.attitude import mrp_to_dcm
from fledge.targets import TARGETS
from fledge.units import minute, s
from tests.needs import flies_on

BOARDS = Path(__file__).with_name("boards")
DOWN = 63.5     # [s] the first instant of flight after the reset at 60.3 s, seen at 60.5 s, and 3 s


@pytest.mark.parametrize("scenario", ["manoeuvre", "commanded", "silent", "kept"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("flatsat")
    sim.plots = False
    sim.scenarios[scenario]()


@pytest.fixture(scope="module")
def flown():
    sim = fledge.load("flatsat")
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, w.wheels.speeds, w.driver.torques, w.clock.reading, w.power.telemetry,
                     w.css.currents, w.adc_a.counts, w.adc_b.counts, f.tracking.error, f.motor.command, f.drive.drive,
                     f.speeds.speeds, f.time.time, f.boot.boot, every=0.5 * s)
    sim.run(7 * minute)
    return sim, log


def test_motors_give_the_torques_that_flight_wants(flown):
    # A torque is off by half a count of the converter, and by the back-EMF of a speed that the tachometer has rounded
    # to one mark in a window and that has changed since; flight sees it a window late.
    sim, log = flown
    up = (log.time > 1) & ((log.time < 60) | (log.time > DOWN + 1))
    wanted, given = log["motor.command.u"][up][:-1, :4], log["driver.torques.u"][up][1:, :4]
    count = 10 / 2**15 / 2 * 0.05 / 2
    change = np.abs(np.diff(log["wheels.speeds.Omega"][up][:, :4], axis=0)).max()
    mark = 2 * np.pi / (1024 * 0.5)
    assert np.abs(wanted - given).max() < count + 0.05 / 2 * 0.05 * (mark + 2 * change)
    assert np.abs(wanted).max() > 0.05


def test_tachometers_read_the_mean_speed_of_a_window(flown):
    sim, log = flown
    up = (log.time < 60) | (log.time > DOWN + 1)
    true, read = log["wheels.speeds.Omega"][:, :4], log["speeds.speeds.Omega"][:, :4]
    mean = (true[1:] + true[:-1]) / 2
    mark = 2 * np.pi / (1024 * 0.5)
    # The mark, and the 0.1 s of an update by which the tachometer is late.
    assert np.abs(read[1:] - mean)[up[1:]].max() < mark + 0.2 * np.abs(np.diff(true, axis=0)).max()


def test_the_world_goes_on_while_the_computer_is_down(flown):
    sim, log = flown
    assert [(a / 1e9, b / 1e9) for a, b in sim.flight.outages] == [(60.5, DOWN)]
    down = (log.time >= 60) & (log.time < DOWN)
    drive, omega = log["drive.drive.counts"][down], log["craft.state.omega_BN_B"][down]
    assert down.sum() == 7 and (drive == drive[0]).all() and np.abs(drive[0]).max() > 1000, "the last command stands"
    assert np.abs(np.diff(omega, axis=0)).min(axis=0).max() > 0, "and acts"
    assert np.ptp(log["clock.reading.master.coarse"][down]) == 3, "the master clock never stops"
    assert log["time.time.head.sequence"][log.time == DOWN] == 1, "flight begins anew"


def test_the_clock_is_caught_up_after_the_reset(flown):
    sim, log = flown
    master = sim.world.clock.epoch / 1e9 + log.time
    slave = log["clock.reading.time.coarse"] + log["clock.reading.time.fine"] * 1e-9
    assert (slave[(log.time >= 60.5) & (log.time <= DOWN)] < 5).all(), "its hardware has started at 0"
    assert np.abs(slave - master)[(log.time > 2) & (log.time < 60)].max() < 1e-6 + 50e-6
    assert np.abs(slave - master)[log.time >= 64].max() < 1e-6 + 50e-6
    assert log["boot.boot.boots"][log.time == 60] == 1 and log["boot.boot.boots"][-1] == 2


def test_each_converter_reads_its_pyramid_until_the_fault(flown):
    sim, log = flown
    a, b, currents = log["adc_a.counts.counts"], log["adc_b.counts.counts"], log["css.currents.current"]
    read = np.hstack([2e-6 * a[:, :4], -1e-5 + 2.5e-6 * b[:, :4].astype(float)])
    sound = log.time < 6 * 60
    assert np.abs(read - currents)[sound].max() < 1.25e-6 + 5e-6     # half a count, and noise
    assert currents[:, :4].max() > 1e-3 and currents[:, 4:].max() > 1e-3
    assert (a[~sound][:, 3] == 4095).all() and not a[:, 4:].any() and not b[:, 4:].any()


def test_a_snapshot_within_the_outage_goes_on_as_the_run_did():
    sim = fledge.load("flatsat")
    sim.run(62 * s)
    saved, twin = sim.snapshot(), sim.clone()
    sim.run(10 * s)
    end = sim.snapshot()
    twin.run(10 * s)
    assert twin.snapshot() == end
    sim.restore(saved)
    sim.run(10 * s)
    assert sim.snapshot() == end
    fresh = fledge.load("flatsat")
    fresh.run(72 * s)
    assert fresh.snapshot() == end


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of all flights, so that each program is built once."""
    return tmp_path_factory.mktemp("flatsat")


def everywhere():
    return ",".join(name for name in ("linux", "sparc64", "cfs", "leon3", "leon3-cfs", "cortex-m7")
                    if not TARGETS[name].missing())


def test_every_lane_of_the_four_boards_carries_something_at_its_own_addresses():
    mission = export.read(fledge.load("flatsat"))
    boards = export.board.read(mission, export.board.texts_of([BOARDS]))
    assert [board.name for board in boards] == ["io_board_a", "io_board_b", "single_board_computer",
                                                "solid_state_recorder"]
    assert all(lane.carries or all(field.carries for field in lane.fields) and lane.fields
               for board in boards for lane in board.lanes)
    assert len({board.level for board in boards} - {0}) == 4
    documents = export.emit_board(mission, [BOARDS])
    for board in boards:
        text = documents[f"{board.name}.md"]
        for lane in board.lanes:
            assert f"| {lane.address:#06x} | {lane.name} |" in text
            assert all(f"| {field.name} |" in text and field.doc in text for field in lane.fields)


@pytest.mark.long("builds and flies on the LEON3")
@flies_on("leon3")
def test_on_the_leon3_the_boards_lie_at_their_bases_and_their_interrupts_come(folder):
    from fledge import emulator

    computer = emulator.load("flatsat", registers=[BOARDS], folder=folder / "computer")
    boards = export.board.read(export.read(fledge.load("flatsat")), export.board.texts_of([BOARDS]))
    computer.sim.run(10 * s)
    for board in boards:
        counters = struct.unpack(f">{2 * len(board.lines)}I",
                                 computer.peek(board.base + board.interrupts, 8 * len(board.lines)))
        raised = dict(zip(board.lines, counters[::2]))
        assert counters[1::2] == counters[::2], "handled as often as raised"
        assert raised.pop("tick", 22) == 22 and raised.pop("command", 0) == 0
        of_lines = [lane.interrupt for lane in board.lanes for _ in range(lane.count)]
        assert raised == {line: 21 * of_lines.count(line) for line in raised}
    io_board_a = boards[0]
    drive = next(lane for lane in io_board_a.lanes if lane.name == "wheel_drive")
    found = struct.unpack(">4I", computer.peek(io_board_a.base + drive.address, 16))
    counts = [int(count) & 0xFFFF for count in computer.flight.drive.drive.counts[:4]]
    assert [word & 0xFFFF for word in found] == counts and any(counts)


@pytest.mark.long("builds and flies on all targets")
def test_a_reset_gives_the_same_bits_on_every_target_through_words_and_packets(folder, capsys):
    """With files that the recorder keeps over it, and the ground's packets."""
    on = everywhere()
    assert cli.main(["fly", "flatsat", "kept", "--on", on, "--board", str(BOARDS), "--out", str(folder)]) == 0, \
        capsys.readouterr()
    desktop = Archive(folder / "desktop.mcap")
    outputs = [topic for topic in desktop.topics if topic.startswith("/flight/")]
    for name in on.split(","):
        target = Archive(folder / f"{name}.mcap")
        assert compare(desktop, target, outputs, times=lambda t: (t < 60.5e9) | (t >= DOWN * 1e9)) == []
        assert len(target.time("/flight/boot/boot")) == 241 - 6
        assert target["/flight/boot/boot"]["boots"][-1] == 2
        assert target["/flight/files/state"]["dropped"][-1] == 1 and target["/flight/files/state"]["delivered"][-1] == 2
        log = (folder / f"{name}.log").read_text()
        figures = dict(line.split()[1:] for line in log.splitlines() if len(line.split()) == 3)
        assert {figures.get(key, "0") for key in ("refused", "corrupt", "saturated", "skipped", "outside_refused",
                                                  "outside_corrupt", "outside_saturated", "lost", "missed")} == {"0"}
        assert figures.get("resets", "1") == "1", "the processor itself was reset"
        # Those of four boards at each tick since the reset, but the first one, before which the program starts.
        assert figures.get("board_interrupts", "452") == str(4 * (241 - 127 - 1)), name


@pytest.mark.long("builds and flies on a target")
def test_a_target_judged_by_its_own_outputs_recovers_from_its_watchdog(folder, capsys):
    assert cli.main(["fly", "flatsat", "silent", "--on", "linux", "--board", str(BOARDS), "--out", str(folder)]) == 0
    assert "passed   desktop, linux" in capsys.readouterr().out


@pytest.mark.long("a co-simulation")
def test_flight_as_a_program_of_its_own_is_reset_too(folder, capsys):
    assert cli.main(["fly", "flatsat", "--for", "70s", "--on", "flight=desktop", "--out", str(folder)]) == 0
    rows = capsys.readouterr().out.splitlines()[2:4]
    assert rows[0].split()[1:3] == rows[1].split()[1:3] == ["135", rows[0].split()[2]]


@pytest.mark.parametrize("kind, faulty, suspects", [("HIGH", 2, 0), ("BABBLE", 2, 0), ("LOW", 0, 3)])
def test_a_converter_that_fails_while_the_computer_is_down(kind, faulty, suspects):
    """It is named after the start, and the Sun kept; if it is dark then, geometry does not tell which one fails."""
    sim = fledge.load("flatsat")
    sim.world.adc_a.faults, sim.world.adc_b.faults = [], [{"kind": kind, "begin": 61 * s}]
    f = sim.flight
    sim.run(2 * minute)
    assert f.sun.status.faulty == faulty and f.sun.status.suspects == suspects
    sun = mrp_to_dcm(sim.world.craft.state.sigma_BN) @ np.array(sim.world.css.s_N)
    assert np.linalg.norm(f.sun.heading.s_B - sun) < 0.02
    assert f.sun.heading.head.quality.name == ("GOOD" if faulty else "DEGRADED")
