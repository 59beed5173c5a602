# SPDX-License-Identifier: Apache-2.0
"""Simulations: running, stopping, copying, recording; modes and events."""

import gc
import os
import signal
import subprocess
import sys
import time
import weakref

import numpy as np
import pytest

import fledge
from fledge import SetupError, flight as fsw, objects, world
from fledge.objects.testing import decoded, kinds
from fledge.units import N, m, minute, ms, rad, s
from tests.needs import needs


def spinner(rate=0.1, seed=0):
    """A body that turns about its third axis, with navigation, and a module that looks at it."""
    sim = fledge.Simulation("spinner", seed)
    f, w = sim.flight, sim.world
    f.target = fsw.HillPointing()
    f.tracking = fsw.TrackingError()
    w.craft = world.Spacecraft(I_B=[1, 2, 3], omega_BN_B=[0, 0, rate] * rad / s, gravity=[world.MARS],
                               orbit=fledge.Orbit(world.MARS, altitude=4e5))
    w.nav = world.Navigation(rate_noise=[1e-3] * 3)
    w.connect(w.craft.state >> w.nav.truth, w.nav.attitude >> f.tracking.attitude, w.nav.orbit >> f.target.orbit)
    f.connect(f.target.reference >> f.tracking.reference)
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
    f.task("gnc", every=1 * s, run=[f.target, f.tracking])
    return sim


def state(sim):
    return sim.snapshot()


# --- running ---------------------------------------------------------------------------------------

def test_time_goes_on_where_it_stood():
    sim = spinner()
    assert sim.time == 0
    sim.run(1 * s)
    assert sim.time == 1.0
    sim.run(0.5)
    sim.step()
    assert sim.time == 1.6
    sim.step(4)
    sim.run(until=3 * s)
    assert sim.time == 3.0
    with pytest.raises(SetupError, match="run: 1 s lies before the present, 3 s"):
        sim.run(until=1 * s)
    whole = spinner()
    whole.run(3 * s)
    assert state(whole) == state(sim)


@pytest.mark.parametrize("part, count", [(0.33, 60), (0.05, 100), (1.7, 10), (2.5, 4)])
def test_runs_add_up_whatever_the_periods(part, count):
    parts, whole = spinner(), spinner()
    for i in range(count):
        parts.run(part * s)
        assert parts.time == pytest.approx(part * (i + 1), rel=1e-15)
    whole.run(until=parts.time * s)
    assert parts.time_ns == whole.time_ns == round(part * count * 1e9)
    assert state(parts) == state(whole)


def test_the_time_is_the_end_of_the_run_and_the_state_that_of_the_last_instant():
    sim = spinner()
    sim.run(0.25 * s)
    assert (sim.time, sim.state_time) == (0.25, 0.2) and sim.world.craft.state.head.t == 200_000_000
    sim.run(0.05 * s)
    assert (sim.time, sim.state_time) == (0.3, 0.3)
    sim.step()
    assert (sim.time, sim.state_time) == (0.4, 0.4)


def test_a_slow_task_runs_at_its_times_though_every_run_is_shorter():
    sim = fledge.Simulation()
    sim.flight.vehicle = fsw.VehicleConfig(I_B=[1, 1, 1])
    sim.flight.beacon = fsw.InertialPointing()
    sim.flight.task("slow", every=60 * s, run=[sim.flight.beacon])
    for _ in range(10):
        sim.run(50 * s)
    assert sim.time == 500 and sim.flight.beacon.reference.head.sequence == 9 and sim.state_time == 480


def test_what_has_no_effect_is_refused():
    sim = spinner()
    f, w = sim.flight, sim.world
    sim.run(1 * s)
    with pytest.raises(SetupError, match="flight.tracking.error.omega_BR_B is in an output of flight.tracking"):
        f.tracking.error.omega_BR_B = [1, 2, 3]
    with pytest.raises(SetupError, match="world.craft.state is in an output of world.craft"):
        w.craft.state = w.craft.state
    with pytest.raises(SetupError, match="flight.tracking.error.head.t is in an output"):
        f.tracking.error.head.t = 5
    with pytest.raises(ValueError, match="read-only"):
        f.tracking.error.omega_BR_B[0] = 1.0
    before = w.craft.omega_BN_B.copy()
    w.craft.omega_BN_B = [1, 2, 3]
    with pytest.raises(SetupError, match="world.craft.omega_BN_B is an initial value, and the run has come to 1 s"):
        sim.run(1 * s)
    w.craft.omega_BN_B[:] = before
    sim.run(1 * s)
    assert sim.time == 2
    w.craft.omega_BN_B = [0, 0, 0.2]
    sim.reset()
    sim.run(1 * s)


def test_the_health_of_a_run_names_what_was_missing():
    sim = spinner()
    sim.run(1 * s)
    assert sim.health == []
    late = fledge.Simulation("late")
    f = late.flight
    f.target = fsw.InertialPointing()
    f.spin, f.turn = fsw.EulerRotation(rates=[0, 0, 1] * rad / s), fsw.EulerRotation(angles=[0, 0, 1])
    f.connect(f.target.reference >> f.spin.base, f.spin.reference >> f.turn.base)
    f.task("gnc", every=1 * s, run=[f.spin, f.turn, f.target])
    late.run(3 * s)
    order, missing = late.health
    assert order.kind == "late" and order.path == "flight.spin.base" and order.first is None
    assert missing.text.startswith("flight.spin.reference was ") and missing.updates == 1 and missing.first == 0


def test_the_first_step_is_the_instant_zero():
    sim = spinner()
    sim.step()
    assert sim.time == 0 and sim.flight.tracking.error.head.sequence == 1
    sim.step()
    assert sim.time == 0.1


def test_reset_starts_anew_with_the_parameters_of_now():
    sim = spinner()
    sim.run(2 * s)
    first = state(sim)
    sim.reset()
    assert sim.time == 0
    sim.run(2 * s)
    assert state(sim) == first
    sim.world.craft.omega_BN_B = [0, 0, 0.2]
    sim.reset()
    sim.run(2 * s)
    assert sim.world.craft.state.omega_BN_B[2] == pytest.approx(0.2)


def test_a_gain_changed_between_runs_counts():
    sim = spinner()
    sim.run(1 * s)
    sim.flight.tracking.sigma_BcB = [0, 0, 0.5]
    before = sim.flight.tracking.error.sigma_BR.copy()
    sim.run(1 * s)
    assert np.linalg.norm(sim.flight.tracking.error.sigma_BR - before) > 0.1
    sim.flight.tracking.sigma_BcB[0] = np.nan  # a view passes no check: the next run makes it
    with pytest.raises(SetupError, match="flight.tracking.sigma_BcB must be finite"):
        sim.run(1 * s)


def test_the_seed_decides_the_noise():
    rates = []
    for seed in (1, 1, 2):
        sim = spinner(seed=seed)
        sim.run(1 * s)
        rates.append(sim.world.nav.attitude.omega_BN_B.copy())
    assert (rates[0] == rates[1]).all() and (rates[0] != rates[2]).any()


# --- copies ----------------------------------------------------------------------------------------

def test_a_damaged_snapshot_is_refused_and_changes_nothing():
    sim = spinner(seed=3)
    sim.run(5 * s)
    good = sim.snapshot()
    sim.run(2 * s)
    now, rng = sim.snapshot(), np.random.default_rng(23)
    for _ in range(400):
        bad, n = bytearray(good), int(rng.integers(len(good)))
        match rng.integers(4):
            case 0: bad[n] ^= 1 << int(rng.integers(8))
            case 1: bad[n:n + 8] = rng.bytes(8)
            case 2: del bad[n:]
            case _: bad[n:n] = bytes(8 * int(rng.integers(1, 9)))
        if bad != good:
            with pytest.raises(SetupError, match=rf"this snapshot \({len(bad)} bytes\) is truncated or damaged"):
                sim.restore(bytes(bad))
            assert sim.snapshot() == now
    sim.restore(good)
    assert sim.snapshot() == good
    other = fledge.load("nadir_spin")
    with pytest.raises(SetupError, match="is of a simulation with other modules, tasks or events"):
        other.restore(good)


def test_snapshot_and_restore():
    sim = spinner()
    sim.run(1 * s)
    saved = state(sim)
    sim.run(1 * s)
    later = state(sim)
    sim.restore(saved)
    assert sim.time == 1.0 and state(sim) == saved
    sim.run(1 * s)
    assert state(sim) == later
    with pytest.raises(SetupError, match="snapshot"):
        sim.restore(saved[:-8])


def test_a_log_has_the_samples_of_the_last_flight():
    sim = fledge.load("nadir_spin")
    log = sim.record(sim.world.craft.state, every=1 * s)
    sim.run(1 * s)
    saved = sim.snapshot()
    sim.run(1 * s)
    first = log["omega_BN_B"]
    sim.restore(saved)
    sim.world.craft.I_B = 2 * sim.world.craft.I_B
    sim.run(1 * s)
    again = log["omega_BN_B"]
    assert len(first) == len(again) == 3 and (first[:2] == again[:2]).all() and (first[2] != again[2]).any()


def test_a_clone_shares_nothing():
    sim = spinner()
    sim.run(1 * s)
    other = sim.clone()
    assert other.time == 1.0 and state(other) == state(sim)
    assert other.world.craft is not sim.world.craft
    assert not np.shares_memory(other.world.craft.I_B, sim.world.craft.I_B)
    assert [b.name for b in other.world.craft.gravity] == ["MARS"]
    sim.run(1 * s)
    assert other.time == 1.0
    other.run(1 * s)
    assert state(other) == state(sim)  # the noise goes on alike, too
    alive = sim.flight.tracking
    del sim
    gc.collect()
    other.run(1 * s)
    assert alive.error.head.sequence == 3  # objects outlive their simulation


def test_a_simulation_is_let_go():
    def looped():  # a callable that refers to its own simulation must not keep it for ever
        sim = spinner()
        sim.world.at(1 * s, do=lambda: sim.flight)
        sim.world.event("never", when=lambda: sim.time < 0, do=print)
        sim.run(2 * s)
        return sim

    sim = looped()
    alive, module = weakref.ref(sim), weakref.ref(sim.world.craft)
    del sim
    gc.collect()
    assert alive() is None and module() is None


# --- records ---------------------------------------------------------------------------------------

def test_records_by_name():
    sim = spinner()
    log = sim.record(sim.flight.tracking, sim.world.craft.state, every=1 * s)
    sim.run(10 * s)
    np.testing.assert_array_equal(log.time, np.arange(11.0))
    assert log["error.sigma_BR"].shape == (11, 3) and log["sigma_BR"].dtype == float
    np.testing.assert_array_equal(log["craft.state.omega_BN_B[2]"], log["omega_BN_B"][:, 2])
    np.testing.assert_array_equal(log["tracking.error.head.t"], np.arange(11) * 10**9)
    assert log["error"]["head"]["sequence"][-1] == 11
    np.testing.assert_array_equal(log.last("omega_BN_B"), sim.world.craft.state.omega_BN_B)
    assert log.last("omega_BN_B").norm() == pytest.approx(0.1)
    assert isinstance(log.last("omega_BN_B[2]"), float)


def test_an_orbit_that_is_set_after_a_reset_is_read_back_before_the_run():
    sim = fledge.load("nadir_spin")
    craft, other = sim.world.craft, fledge.Orbit(fledge.world.MARS, a=6e6 * m)
    sim.run(1 * s)
    sim.reset()
    craft.orbit = other
    assert craft.orbit.a == pytest.approx(6e6, rel=1e-5)
    sim.run(1 * s)
    assert craft.orbit.a == pytest.approx(6e6, rel=1e-5)


def test_names_that_are_not_there_or_not_unique():
    sim = spinner()
    log = sim.record(sim.flight.target.reference, sim.flight.tracking.reference)
    with pytest.raises(SetupError, match="nothing was recorded of 'target.reference.sigma_RN' yet"):
        log.last("target.reference.sigma_RN")
    sim.run(1 * s)
    with pytest.raises(SetupError, match="'sigma_RN' is ambiguous: it may be flight.target.reference.sigma_RN, "
                                         "flight.tracking.reference.sigma_RN; write more of the name"):
        log["sigma_RN"]
    with pytest.raises(SetupError, match="no 'target.reference.sigma_RM'; did you mean target.reference.sigma_RN"):
        log["target.reference.sigma_RM"]
    with pytest.raises(SetupError, match=r"sigma_RN has the shape \(3,\)"):
        log["target.reference.sigma_RN[3]"]


def test_records_of_different_rates():
    sim = spinner()
    slow = sim.record(sim.flight.tracking.error, every=2 * s)
    fast = sim.record(sim.world.craft.state)
    sim.run(4 * s)
    assert len(slow.time) == 3 and len(fast.time) == 41
    first = slow["sigma_BR"]
    sim.run(4 * s)
    assert len(first) == 3 and len(slow["sigma_BR"]) == 5  # an array that was read stays; a new read has all samples
    sim.reset()
    assert len(slow.time) == 0


def test_a_frame_has_names_and_units():
    sim = spinner()
    log = sim.record(sim.flight.tracking.error, sim.world.nav.attitude, every=1 * s)
    sim.run(3 * s)
    frame = log.frame()
    assert list(frame.columns[:4]) == ["error.sigma_BR[0]", "error.sigma_BR[1]", "error.sigma_BR[2]",
                                       "error.omega_BR_B[0]"]
    assert frame.attrs["units"]["error.omega_BR_B[0]"] == "rad/s"
    assert list(frame.index) == [0, 1, 2, 3] and frame.index.name == "time [s]"
    assert list(log.frame("error.sigma_BR").columns) == [f"error.sigma_BR[{i}]" for i in range(3)]


def test_a_log_and_its_archive_agree(tmp_path):
    sim = spinner()
    log = sim.record(sim.flight.tracking.error, every=1 * s)
    sim.archive(tmp_path / "run.mcap", note="a test")
    sim.run(5 * s)
    assert sim.close_archive() == str(tmp_path / "run.mcap")
    archive = fledge.Archive(tmp_path / "run.mcap")
    np.testing.assert_array_equal(archive["error.sigma_BR"], log["error.sigma_BR"])
    np.testing.assert_array_equal(archive.frame().to_numpy(), log.frame().to_numpy())
    assert list(archive.frame().columns) == list(log.frame().columns)
    assert archive.metadata["run"]["note"] == "a test" and archive.metadata["run"]["seed"] == "0"


def test_every_kind_of_field_is_recorded_by_name(tmp_path):
    import h5py
    import pandas as pd

    sim = fledge.Simulation()
    f = sim.flight
    f.noise = kinds()[1]["Noise"](seed=5, x=1)
    f.task("all", every=1 * s, run=[f.noise])
    log = sim.record(f.noise.kinds, every=1 * s)
    sim.archive(tmp_path / "run.mcap")
    expected = []
    for t in range(20):
        sim.run(until=t * s)
        expected.append(decoded(objects.struct(f.noise.kinds), objects.memory(f.noise.kinds)))
    sim.close_archive()
    archive = fledge.Archive(tmp_path / "run.mcap")
    for key, read in {
            "i64": lambda k: k["i64"], "u64": lambda k: k["u64"], "serials[1]": lambda k: k["serials"][1],
            "phases": lambda k: k["phases"], "part.phase": lambda k: k["part"]["phase"],
            "grid[1][2]": lambda k: k["grid"][1][2], "grid[1, 2]": lambda k: k["grid"][1][2],
            "parts[1].phase": lambda k: k["parts"][1]["phase"],
            "kinds.parts.phase": lambda k: [p["phase"] for p in k["parts"]],
            "parts[2].pairs[1].count": lambda k: k["parts"][2]["pairs"][1]["count"],
            "parts.pairs[0].count": lambda k: [p["pairs"][0]["count"] for p in k["parts"]],
            "parts[1].steps": lambda k: k["parts"][1]["steps"],
            "parts.steps[2]": lambda k: [p["steps"][2] for p in k["parts"]]}.items():
        for source in (log, archive):
            assert source[key].tolist() == list(map(read, expected)), key
        assert log.series(key).name == archive.series(key).name
    assert log.series("parts[1].phase").name == "parts[1].phase" and log.series("kinds.i64").name == "i64"
    assert log["parts"]["share"].shape == archive["parts"]["share"].shape == (20, 3)
    assert log.series("parts[1].phase").words == {-7: "not safe", 0: "safe", 3: "science", 100: "drain"}
    recorded, archived = log.frame(), archive.frame()
    assert [c for c in recorded if "label" not in c] == [c for c in archived if "label" not in c]
    assert list(log.frame("parts.share")) == [f"kinds.parts[{i}].share" for i in range(3)]
    table = pd.read_csv(archive.to_csv(tmp_path / "csv")[0], float_precision="round_trip")
    assert table["parts[2].pairs[1].count [-]"].tolist() == [k["parts"][2]["pairs"][1]["count"] for k in expected]
    with h5py.File(archive.to_hdf5(tmp_path / "run.h5")) as file:
        assert (file["flight/noise/kinds/parts.pairs.count"][:] == log["parts.pairs.count"]).all()
    assert len(log.plot("kinds.phase", "parts[1].phase", "phases", "i64", "parts.pairs.count").axes) == 5


@pytest.mark.parametrize("key, text", [
    ("parts[3].share", "'parts[3].share' is out of range: flight.noise.kinds.parts.share has the shape (3,)"),
    ("parts[1].share[0]", "'parts[1].share[0]' is out of range: flight.noise.kinds.parts.share has the shape (3,)"),
    ("noise[1].kinds.i64", "'noise[1].kinds.i64' is out of range: flight.noise.kinds.i64 has the shape ()"),
    ("parts[1].shape", "there is no 'parts[1].shape'; did you mean parts.share? "
     "flight.noise.kinds.parts has phase, share, pairs.count, pairs.x, steps"),
])
def test_a_wrong_place_in_an_array_of_structs_is_reported(key, text):
    sim = fledge.Simulation()
    sim.flight.noise = kinds()[1]["Noise"]()
    with pytest.raises(SetupError) as error:
        sim.record(sim.flight.noise.kinds)[key]
    assert str(error.value) == f"the log: {text}"


def test_a_reset_begins_a_new_archive(tmp_path):
    sim = spinner()
    sim.record(sim.flight.tracking.error, every=1 * s)
    sim.archive(tmp_path / "run.mcap")
    for _ in range(3):
        sim.run(2 * s)
        sim.reset()
    sim.run(1 * s)
    sim.close_archive()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run-2.mcap", "run-3.mcap", "run-4.mcap", "run.mcap"]
    assert fledge.Archive(tmp_path / "run-4.mcap")["error"].shape == (2,)


# --- modes and events ------------------------------------------------------------------------------

def modal():
    sim = spinner()
    f = sim.flight
    f.extra = fsw.EulerRotation()
    f.connect(f.target.reference >> f.extra.base)
    more = f.task("more", every=1 * s, run=[f.extra])
    f.mode("safe", [])
    f.mode("science", [more])
    return sim


def test_a_flight_event_enters_a_mode():
    sim = modal()
    f = sim.flight
    event = f.event("turned", when=f.watch(f.tracking.attitude).sigma_BN[2] > 0.05, hold=1 * s, enter=f.science)
    assert sim.mode == "safe" and f.turned is event and event.armed
    sim.run(1 * s)
    assert f.extra.reference.head.sequence == 0 and event.fired_at is None
    sim.run(9 * s)
    # The angle is 0.1 t, so sigma is tan(0.1 t / 4): above 0.05 from 2.0 s on, seen by flight at 2 s or 3 s.
    assert sim.mode == "science" and event.fired_at in (3.0, 4.0)
    assert f.extra.reference.head.sequence == 10 - int(event.fired_at)
    f.enter(f.safe)
    sim.run(1 * s)
    assert sim.mode == "safe"
    f.science.enter()
    sim.run(1 * s)
    assert sim.mode == "science"


def test_world_events_call_python():
    sim = spinner()
    seen = []
    sim.world.at(1.55 * s, do=lambda: seen.append(sim.time))
    sim.world.event("fast", when=lambda: sim.world.craft.state.omega_BN_B[2] > 0.2, do=lambda: seen.append("fast"))
    sim.run(3 * s)
    assert seen == [1.6]
    sim.world.craft.omega_BN_B = [0, 0, 0.3]
    sim.reset()
    sim.run(3 * s)
    assert seen == [1.6, "fast", 1.6]


def test_what_an_event_changes_of_a_model_acts_at_once():
    sim = fledge.load("nadir_spin")
    wheels = sim.world.wheels
    sim.world.at(10 * s, lambda: setattr(wheels, "friction", [0, 1, 0, 0]))    # [N m], more than the motor can give
    sim.run(1 * minute)
    speeds = np.abs(wheels.speeds.Omega[:4])
    assert speeds[1] < 1e-6 < speeds[0]


def test_the_events_of_a_clone_live_on():
    seen = []
    sim = modal()
    sim.world.at(2 * s, do=lambda: seen.append("at"))
    other = sim.clone()
    del sim
    gc.collect()
    other.run(3 * s)
    other.flight.enter(other.flight.science)
    other.run(1 * s)
    assert seen == ["at"] and other.mode == "science"


def test_an_exception_in_an_event_ends_the_run_with_its_traceback():
    sim = spinner()

    def broken():
        raise KeyError("nothing there")

    sim.world.at(1 * s, do=broken)
    with pytest.raises(KeyError, match="nothing there") as error:
        sim.run(10 * s)
    assert error.traceback[-1].name == "broken" and sim.time == 1.0
    with pytest.raises(fledge.RunError, match="reset it, or restore a snapshot"):
        sim.run(1 * s)
    sim.world.at_1000000000_ns.armed = False
    sim.reset()
    assert sim.time == 0


def test_wires_with_latency_and_age():
    sim = spinner()
    f, w = sim.flight, sim.world
    f.late = fsw.TrackingError()
    f.connect((f.target.reference >> f.late.reference).latency(1),
              (w.nav.attitude >> f.late.attitude).stale_after(50 * ms))
    w.task("never", every=1000 * s, offset=1000 * s, run=[spare(w)])
    f.task("late", every=1 * s, offset=0.5 * s, run=[f.late])
    sim.run(2.6 * s)
    # Exchanged at whole seconds: at 2.5 s the reference is that of 2 s.
    assert f.late.reference.head.t == 2_000_000_000
    assert f.late.attitude.head.quality.name == "GOOD"


def spare(w):
    w.spare = world.Spacecraft(I_B=1)
    return w.spare


# --- pace, progress, Ctrl-C ------------------------------------------------------------------------

def test_pace():
    sim = spinner()
    sim.run(0.1)
    took = []
    while not took or min(took) > 1.5:      # 0.2 s, or more on a busy machine
        begun = time.perf_counter()
        sim.run(2 * s, pace=10)
        took.append(time.perf_counter() - begun)
    assert min(took) > 0.15
    assert sim.pace_report["instants"] == 20 and sim.pace_report["worst"] >= 0
    with pytest.raises(SetupError, match="pace must be >= 0, found -1"):
        sim.run(1 * s, pace=-1)


def test_progress_is_for_long_runs_on_a_terminal_only(capfd):
    spinner().run(5 * s)
    assert capfd.readouterr().err == ""
    spinner().run(10 * s, pace=10, progress=True)
    shown = capfd.readouterr().err
    assert "spinner [###" in shown and "of 10 s" in shown and shown.endswith("\r")


INTERRUPTED = """
import sys, time
sys.path[:0] = {path!r}
from fledge.mission.simulation_test import spinner
sim = spinner()
sim.world.at(1, lambda: print("ready", flush=True))
try:
    sim.run(1e6, pace={pace})
except KeyboardInterrupt:
    print("stopped", flush=True)
t = sim.time
assert 0 < t < 1e6, t
whole = spinner()
whole.world.at(1, lambda: None)
whole.run(t)
assert whole.snapshot() == sim.snapshot()
sim.run(1)
assert abs(sim.time - t - 1) < 0.11
print("went on")
"""


@pytest.mark.parametrize("pace", [0, 5])
def test_ctrl_c_stops_after_an_instant_and_the_run_goes_on(pace):
    process = subprocess.Popen([sys.executable, "-c", INTERRUPTED.format(path=sys.path, pace=pace)],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    os.kill(process.pid, signal.SIGINT)
    assert process.stdout.readline() == "stopped\n", process.stderr.read()
    out, error = process.stdout.read(), process.stderr.read()
    assert (process.wait(), out, error) == (0, "went on\n", "")


INTERRUPTED_EVENT = """
import os, signal, sys
sys.path[:0] = {path!r}
from fledge.mission.simulation_test import spinner
sim, done = spinner(), []
def press():
    os.kill(os.getpid(), signal.SIGINT)
    done.append(sim.time)               # is reached: the event is not cut in two
sim.world.at(3, press)
try:
    sim.run(1e6)
except KeyboardInterrupt:
    pass
assert done == [3], done
sim.run(1)
"""


def test_ctrl_c_does_not_end_an_event_half_way():
    done = subprocess.run([sys.executable, "-c", INTERRUPTED_EVENT.format(path=sys.path)], capture_output=True,
                          text=True)
    assert (done.returncode, done.stderr) == (0, "")


# --- the shell -------------------------------------------------------------------------------------

def test_repr_shows_what_is_there():
    text = repr(spinner())
    assert text.startswith("spinner, not yet run, seed 0\nprocess world\n  craft  Spacecraft\n")
    assert "task gnc, every 1 s: target, tracking" in text


def test_completion():
    sim = spinner()
    assert {"target", "tracking", "connect", "task"} <= set(dir(sim.flight))
    assert {"run", "step", "clone"} <= set(dir(sim))
    for module in (fsw, world):  # what they import is none of a user's business
        assert not {"lookup", "fspath", "weakref", "strip"} & set(dir(module))


@needs("ipython3")
def test_in_ipython(tmp_path):
    script = ("from fledge.mission.simulation_test import spinner\nsim = spinner()\nsim.run(1)\nsim.flight.tracking\n"
              "sim.flight.tracking?\nsim.flight.tracking.sigma_BcB\n")
    (tmp_path / "try.ipy").write_text("import sys\nsys.path[:0] = %r\n" % sys.path + script)
    out = subprocess.run(["/usr/bin/python3", "-m", "IPython", "--no-banner", "--colors=NoColor", "--no-confirm-exit"],
                         input=(tmp_path / "try.ipy").read_text(), capture_output=True, text=True,
                         env={**os.environ, "IPYTHONDIR": str(tmp_path), "TERM": "dumb"}).stdout
    assert "flight.tracking (TrackingError)" in out and "<< world.nav.attitude" in out
    assert "attitude of the control frame" in out and "array([0., 0., 0.])" in out


def test_units_of_a_changed_gain():
    sim = spinner()
    sim.flight.feedback = fsw.MrpFeedback(K=1 * N * m, P=1)
    sim.flight.feedback.K = 3 * N * m
    assert sim.flight.feedback.K == 3 and (2 * minute).to(s) == 120


def test_a_simulation_of_several_spacecraft():
    sim = fledge.Simulation("fleet", empty=True)
    assert sim.processes == () and sim.flights == ()
    with pytest.raises(fledge.SetupError, match="fleet has no process 'flight'; it has none"):
        sim.flight
    w, a = sim.add_world("w"), sim.add_flight("a")
    assert sim.flight is a and sim.world is w and sim.process("a") is a
    b = sim.add_flight("b")
    assert sim.processes == (w, a, b) and sim.flights == (a, b)
    with pytest.raises(fledge.SetupError, match=r"several of the kind flight; take one by process\(\): a, b"):
        sim.flight
    with pytest.raises(fledge.SetupError, match="process a is already there"):
        sim.add_world("a")
    with pytest.raises(fledge.SetupError, match="process 'b c': its name must be an identifier"):
        sim.add_flight("b c")
    with pytest.raises(fledge.SetupError, match="fleet has no process 'c'; it has w, a, b"):
        sim.process("c")


def test_what_an_event_sets_reaches_a_process_that_runs_later_at_the_same_instant():
    """As where each process is a program of its own: there the event has happened before the other steps."""
    sim = fledge.Simulation("events", empty=True)
    early, first, later = (sim.add_flight(name) for name in ("early", "first", "later"))
    first.still = fsw.InertialPointing()
    for f in (early, first, later):
        f.turn = fsw.EulerRotation(rates=[0.1 * (f is first), 0, 0])
        f.connect(first.still.reference >> f.turn.base)
        f.task("turn", every=1, run=[f.turn])
    first.event("now", when=first.watch(first.turn.euler).angles[0] > 0.45, once=True,
                set=[(first.watch(first.still).sigma_RN, [0.5, 0, 0])])
    seen = {f.name: sim.record(f.turn.reference, every=1) for f in (early, later)}
    sim.run(8)
    assert first.now.fired_at == 5
    for name, at in (("early", 6), ("later", 5)):
        log = seen[name]
        assert log.time[(log["reference.sigma_RN"][:, 0] > 0.4).argmax()] == at, name
