# SPDX-License-Identifier: Apache-2.0
"""The mission as numbers: what the units do, what a reset takes away and what it leaves, and that all of it is the same
through the registers of a board, on every target."""

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.targets import TARGETS, build
from fledge.units import minute, s

BOARD = build.ROOT / "missions/flatsat/board.toml"
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
                     w.adc_a.counts, w.adc_b.counts, f.tracking.error, f.motor.command, f.drive.drive, f.speeds.speeds,
                     f.time.time, f.boot.boot, every=0.5 * s)
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


def test_converters_differ_by_their_counts_alone_until_the_fault(flown):
    sim, log = flown
    a = 2e-6 * log["adc_a.counts.counts"]
    b = -1e-5 + 2.5e-6 * log["adc_b.counts.counts"].astype(float)
    sound = log.time < 6 * 60
    assert np.abs(a - b)[sound].max() < 1e-6 + 1.25e-6 + 10e-6     # half a count each, and noise
    assert (log["adc_a.counts.counts"][~sound][:, 7] == 4095).all()


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
    names = ["linux", "cfs", *(name for name in ("leon3",) if name in TARGETS)]
    return ",".join(name for name in names if not TARGETS[name].missing())


def test_a_reset_gives_the_same_bits_on_every_target_through_words_and_packets(folder, capsys):
    """With files that the recorder keeps over it, and the ground's packets."""
    on = everywhere()
    assert cli.main(["fly", "flatsat", "kept", "--on", on, "--board", str(BOARD), "--out", str(folder)]) == 0, \
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


def test_a_target_judged_by_its_own_outputs_recovers_from_its_watchdog(folder, capsys):
    assert cli.main(["fly", "flatsat", "silent", "--on", "linux", "--board", str(BOARD), "--out", str(folder)]) == 0
    assert "passed   desktop, linux" in capsys.readouterr().out


def test_flight_as_a_program_of_its_own_is_reset_too(folder, capsys):
    assert cli.main(["fly", "flatsat", "--for", "70s", "--on", "flight=desktop", "--out", str(folder)]) == 0
    rows = capsys.readouterr().out.splitlines()[2:4]
    assert rows[0].split()[1:3] == rows[1].split()[1:3] == ["135", rows[0].split()[2]]
