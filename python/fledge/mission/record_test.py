# SPDX-License-Identifier: Apache-2.0
"""What is recorded, and when: in some modes alone, the mode itself, at the largest rate."""

import numpy as np
import pytest

import fledge
from fledge import SetupError, flight as fsw
from fledge.units import Quantity, ms, s


@pytest.fixture
def sim():
    return made()


def made():
    sim = fledge.load("nadir_spin")
    f = sim.flight
    f.other = fsw.InertialPointing()
    f.task("always", every=500 * ms, run=[f.other])
    for mode, tasks in (("on", [f.gnc]), ("off", []), ("idle", [])):
        f.mode(mode, tasks)
    return sim


def fly(sim):
    """10 s in each of the modes on, off, idle, on."""
    for mode in ("on", "off", "idle", "on"):
        sim.flight.enter(mode)
        sim.run(10 * s)


def test_modes_leave_out_the_samples_of_others_and_change_no_bit_of_the_rest(sim, tmp_path):
    f, craft, other = sim.flight, sim.world.craft, made()
    whole = other.record(other.flight, other.world.craft.state, every=300 * ms)
    log = sim.record(craft.state, every=300 * ms, modes=[f.off, "idle"])
    twice = [sim.record(f.tracking.error, every=every, modes=mode)
             for every, mode in ((300 * ms, "off"), (1 * s, f.on))]
    sim.archive(tmp_path / "run.mcap")
    fly(sim), fly(other)
    sim.close_archive()
    there = np.isin(whole["mode.name"], ["off", "idle"])
    assert 60 < there.sum() < 70 and len(whole.time) == 134
    assert (log.time == whole.time[there]).all()
    assert (log["state.omega_BN_B"] == whole["state.omega_BN_B"][there]).all()
    archive = fledge.Archive(tmp_path / "run.mcap")
    assert (archive.time("craft.state") == log.time).all()
    # a port recorded twice has the modes of both
    assert [log.time.tolist() for log in twice] == [whole.time[whole["mode.name"] != "idle"].tolist()] * 2
    sim.reset()
    assert not len(log)
    fly(sim)
    assert (log.time == whole.time[there]).all()


def test_the_mode_of_each_sample_is_a_record_beside_the_messages(sim, tmp_path):
    log = sim.record(sim.flight, sim.flight.tracking.error, every=5 * s)
    sim.archive(tmp_path / "run.mcap")
    fly(sim)
    sim.close_archive()
    # A mode that is entered between two runs begins at the next instant of flight, 0.5 s later
    assert log["flight.mode.name"].tolist() == ["on"] * 3 + ["off"] * 2 + ["idle"] * 2 + ["on"] * 2
    assert log["mode.index"].tolist() == [0] * 3 + [1] * 2 + [2] * 2 + [0] * 2
    frame = log.frame()
    assert frame.loc[25, "mode.name"] == "idle" and frame.loc[25, "mode.valid_at"] == 20.5
    # The file has each begin of a mode, and not these samples too
    assert fledge.Archive(tmp_path / "run.mcap").time("flight.mode").tolist() == [0, 10.5, 20.5, 30.5]
    for record in (log, fledge.Archive(tmp_path / "run.mcap")):
        with pytest.raises(SetupError, match="^'mode.name' is a text, and plots show numbers: plot mode.index, "):
            record.series("mode.name")
        assert record.series("mode.index").words == {0: "on", 1: "off", 2: "idle"}


def test_the_largest_rate_is_each_instant(sim):
    log = sim.record(sim.world.craft.state, every=1e-9 * s)
    sim.run(1 * s)
    assert len(log) == 11       # of the world, each 100 ms
    with pytest.raises(SetupError, match="^record: every: 1e-10 s is less than a nanosecond, the unit of time; 0 "
                                         "records each instant, which is the largest rate$"):
        sim.record(sim.world.craft.state, every=1e-10 * s)
    for nothing in (0, 0.0, 0 * s, Quantity(0, s.dims)):
        sim.record(sim.world.craft.state, every=nothing)


@pytest.mark.parametrize("modes, text", [
    ("of", "flight has no mode 'of'; did you mean 'off'. it has on, off, idle"),
    ([], r"expected a mode, or several; found \[\]"),
    (3, "expected modes, or their names; found a int")])
def test_a_wrong_mode_is_named(sim, modes, text):
    with pytest.raises(SetupError, match=f"^record: modes: {text}$"):
        sim.record(sim.world.craft.state, modes=modes)


def test_a_process_without_modes_has_no_mode_to_record(sim):
    with pytest.raises(SetupError, match="^record: the process world has no modes; name its modules$"):
        sim.record(sim.world)
    twin = sim.clone()
    with pytest.raises(SetupError, match=r"expected modes of one process of this simulation; found \[<mode off>\]"):
        twin.record(twin.world.craft.state, modes=sim.flight.off)
