# SPDX-License-Identifier: Apache-2.0
"""Inputs fed by hand: by constants, arrays and records."""

import textwrap

import numpy as np
import pandas
import pytest

import fledge
from fledge import SetupError, export, flight as fsw, world
from fledge.archive import Archive
from fledge.errors import Failure
from fledge.mission.wiring import Wiring
from fledge.plot.wiring import dot
from fledge.targets.job import Job
from fledge.targets.micropython.export import compose
from fledge.units import N, deg, m, minute, ms, rad, s


def tracker():
    """TrackingError of a fixed reference, whose attitude nothing gives."""
    sim = fledge.Simulation("tracker")
    f = sim.flight
    f.target = fsw.InertialPointing()
    f.tracking = fsw.TrackingError()
    f.connect(f.target.reference >> f.tracking.reference)
    f.task("gnc", every=500 * ms, run=[f.target, f.tracking])
    return sim, f.tracking


def body():
    """A free body with wheels whose command is an optional input."""
    sim = fledge.Simulation("body")
    w = sim.world
    w.wheels = world.ReactionWheels(axes_B=[[1, 0, 0]], J=0.1, u_max=0.2 * N * m)
    w.craft = world.Spacecraft(I_B=[10, 20, 30], parts=[w.wheels])
    w.task("dynamics", every=100 * ms, run=[w.craft])
    return sim, w


# --- what arrives ----------------------------------------------------------------------------------

def test_a_constant_is_as_fresh_as_a_wire_and_needs_none():
    sim, tracking = tracker()
    with pytest.raises(SetupError, match="flight.tracking.attitude is not wired"):
        sim.run(1 * s)
    sim.feed(tracking.attitude, sigma_BN=[0, 0, 0.1], omega_BN_B=[0, 0, 1] * deg / s)
    log = sim.record(tracking.attitude, tracking.error)
    sim.run(20 * s)     # longer than ten updates, after which TrackingError drops old data
    assert (log["attitude.head.t"] == log.time_of("attitude") * 1e9).all()
    assert (np.diff(log["attitude.head.sequence"]) == 1).all()
    assert set(log.frame("error")["error.quality"]) == {"good"}
    assert log.last("error.sigma_BR") == pytest.approx([0, 0, 0.1])
    assert log.last("attitude.omega_BN_B")[2] == np.deg2rad(1)


def test_samples_are_held_with_the_time_and_quality_that_they_had():
    sim, tracking = tracker()
    sigma = np.array([[0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0]])
    sim.feed(tracking.attitude, time=[1, 2, 4.2] * s, sigma_BN=sigma, quality="DEGRADED", stale_after=1 * s)
    log = sim.record(tracking.attitude)
    sim.run(6 * s)
    frame = log.frame("attitude")
    assert frame["attitude.quality"].tolist() == (["none"] * 2 + ["degraded"] * 5 + ["stale"] * 2 + ["degraded"] * 2
                                                  + ["stale"] * 2)
    assert frame["attitude.valid_at"].tolist() == [0, 0, 1, 1, 2, 2, 2, 2, 2, 4.2, 4.2, 4.2, 4.2]
    assert frame["attitude.sigma_BN[0]"].fillna(-1).tolist() == [-1, -1, .1, .1, .2, .2, .2, .2, .2, .3, .3, .3, .3]
    assert ("stale", "flight.tracking.attitude") in [(finding.kind, finding.path) for finding in sim.health]


def test_numbers_change_linearly_where_the_feed_is_linear():
    sim, w = body()
    sim.feed(w.wheels.command, time=[1, 2], u=[[0], [0.1]] * N * m, linear=["u"])
    log = sim.record(w.wheels.command)
    sim.run(3 * s)
    t = log.time
    expected = np.where(t < 1, np.nan, np.clip(0.1 * (t - 1), 0, 0.1))
    assert log["u[0]"] == pytest.approx(expected, nan_ok=True)
    assert log["head.t"] / 1e9 == pytest.approx(np.where(t < 1, 0, np.minimum(t, 2)))


def test_a_fed_torque_turns_the_wheel():
    sim, w = body()
    sim.feed(w.wheels.command, time=[0, 1, 3], u=[[0.1], [-0.05], [0]])
    sim.run(5 * s)
    # A command is in force from the instant at which it is read, so that the first step ends without one.
    assert w.wheels.speeds.Omega[0] + w.craft.state.omega_BN_B[0] == pytest.approx((0.1 * 0.9 - 0.05 * 2 + 0.1 * 0.1)
                                                                                   / 0.1, abs=0.11)
    momentum = 0.1 * (w.wheels.speeds.Omega[0] + w.craft.state.omega_BN_B[0]) + 10 * w.craft.state.omega_BN_B[0]
    assert momentum == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("kind", ["log", "archive", "frame"])
def test_a_record_flies_again(kind, tmp_path):
    def mission():
        sim = fledge.load("nadir_spin")
        return sim, sim.record(sim.world.nav.attitude, sim.flight.tracking.attitude, sim.flight.tracking.reference,
                               sim.flight.tracking.error, every=500 * ms)

    first, log = mission()
    first.archive(tmp_path / "run.mcap")
    first.run(2 * minute)
    first.close_archive()
    sim = fledge.Simulation("again")
    f = sim.flight
    f.tracking = fsw.TrackingError(sigma_BcB=first.flight.tracking.sigma_BcB)
    f.task("gnc", every=500 * ms, run=[f.tracking])
    if kind == "frame":
        frame = log.frame("tracking.attitude", "tracking.reference")
        sim.feed(f.tracking.attitude, frame, topic="tracking.attitude")
        sim.feed(f.tracking.reference, log.frame("reference"))
    else:
        with Archive(tmp_path / "run.mcap") as archive:
            record = log if kind == "log" else archive
            sim.feed(f.tracking.attitude, record)       # of several, that of the same path
            sim.feed(f.tracking.reference, record, topic="tracking.reference")
    again = sim.record(f.tracking.error)
    sim.run(2 * minute)
    assert (again["error.sigma_BR"] == log["error.sigma_BR"]).all()
    assert (again["error.head.t"] == log["error.head.t"]).all()


def test_a_table_of_a_spacecraft(tmp_path):
    (tmp_path / "telemetry.csv").write_text("t,sigma_BN[0],sigma_BN[1],sigma_BN[2],quality\n"
                                            "0.5,0.1,0,0,good\n1.5,0.2,0,0,degraded\n1.5,0.3,0,0,good\n")
    sim, tracking = tracker()
    sim.feed(tracking.attitude, pandas.read_csv(tmp_path / "telemetry.csv", index_col="t"))
    log = sim.record(tracking.attitude)
    sim.run(2 * s)
    assert log.raw["attitude.sigma_BN"][:, 0].tolist() == [0, 0.1, 0.1, 0.3, 0.3]   # the last of two at one time
    assert log.frame("attitude")["attitude.quality"].tolist() == ["none", *["good"] * 4]
    hole = pandas.DataFrame({f"sigma_BN[{i}]": [0, float("nan") if i else 0] for i in range(3)}, index=[0, 1])
    with pytest.raises(SetupError, match="attitude at 1 s.sigma_BN must be finite"):
        sim.feed(tracking.attitude, hole)
    table = pandas.read_csv(tmp_path / "telemetry.csv", index_col="t")
    for wrong, complaint in (
            (table.set_index(pandas.to_datetime(table.index, unit="s")), r"must be seconds; .*total_seconds\(\)"),
            (table.assign(**{"sigma_BN[1]": "much"}),
             r"column sigma_BN\[1\]: could not convert string to float: 'much'"),
            (table.assign(quality="fine"), "column quality: expected none, .*, good; found 'fine'")):
        with pytest.raises(SetupError, match=complaint):
            sim.feed(tracking.attitude, wrong)
    with pytest.raises(SetupError, match=r"NavAttitude has no t; .*; times are the frame's index, as by read_csv\("):
        sim.feed(tracking.attitude, pandas.read_csv(tmp_path / "telemetry.csv"))


# --- runs ------------------------------------------------------------------------------------------

def test_snapshots_clones_and_resets_are_fed_alike():
    sim, tracking = tracker()
    sim.feed(tracking.attitude, time=np.arange(20), sigma_BN=np.linspace(
        0, 0.2, 60).reshape(20, 3), linear=["sigma_BN"])
    sim.run(5 * s)
    middle, other = sim.snapshot(), sim.clone()
    sim.run(20 * s)
    end = sim.snapshot()
    other.run(20 * s)
    assert other.snapshot() == end
    sim.restore(middle)
    sim.run(20 * s)
    assert sim.snapshot() == end
    sim.reset()
    sim.run(25 * s)
    assert sim.snapshot() == end


def test_other_messages_may_come_between_two_runs():
    sim, tracking = tracker()
    sim.feed(tracking.attitude, sigma_BN=[0.1, 0, 0])
    sim.run(1 * s)
    clone = sim.clone()
    sim.feed(tracking.attitude, sigma_BN=[0.2, 0, 0])
    sim.run(1 * s)
    clone.run(1 * s)
    assert (tracking.attitude.sigma_BN[0], clone.flight.tracking.attitude.sigma_BN[0]) == (0.2, 0.1)


def test_a_field_may_have_the_name_of_an_option():
    sim = fledge.Simulation("clock")
    f = sim.flight
    f.ephemeris = fsw.ElementEphemeris(epoch=0, a=7e6, mu=world.EARTH.mu)
    f.task("gnc", every=1, run=[f.ephemeris])
    sim.feed(f.ephemeris.time, {"time": [10 * s, 20 * s]}, time=[0, 1])
    sim.run(1 * s)
    assert f.ephemeris.time.time == 20 * 10**9


def test_a_mission_may_feed_where_it_is_composed():
    sim, tracking = tracker()
    sim.flight.feed(tracking.attitude, sigma_BN=[0, 0, 0.1])
    assert sim.feeds == [("flight.tracking.attitude", "by hand, constant", 0)]
    assert sim.flight.declared_at("flight.tracking.attitude")
    sim.run(1 * s)
    assert tracking.error.sigma_BR[2] == pytest.approx(0.1)


def test_what_feeds_is_shown_recorded_and_exported(tmp_path):
    sim, tracking = tracker()
    sim.feed(tracking.attitude, time=[0, 60], sigma_BN=[[0, 0, 0], [0, 0, 0.1]])
    words = "by hand, 2 samples from 0 to 60 s"
    assert f"attitude   << {words}\n" in Wiring(sim).outline()
    assert f"<< {words}" in repr(tracking)
    assert f'"{words}" -> "flight.tracking"' in dot(Wiring(sim))
    mission = export.read(sim)
    assert f"{words} >> flight.tracking.attitude" in export.emit_c(mission)["tracker.h"]
    with pytest.raises(export.ExportError, match=f"flight.tracking.attitude is fed {words}, which the script cannot"):
        compose(sim, mission)
    sim.record(tracking.error)
    sim.archive(tmp_path / "run.mcap")
    sim.run(1 * s)
    sim.close_archive()
    with Archive(tmp_path / "run.mcap") as archive:
        assert archive.metadata["feeds"] == {"flight.tracking.attitude": words}


# --- bad input -------------------------------------------------------------------------------------

@pytest.mark.parametrize("fields, text", [
    ({}, "give a record, or some of the fields: sigma_BN, omega_BN_B"),
    ({"sigma": [0, 0, 0]}, "NavAttitude has no 'sigma'"),
    ({"sigma_BN": [0, 0]}, r"sigma_BN: expected \(3,\); found the shape \(2,\)"),
    ({"sigma_BN": [0, 0, 1] * m}, "expected a number without unit"),
    ({"omega_BN_B": [0, 0, 1] * deg}, "expected a quantity in rad/s"),
    ({"sigma_BN": [0, 0, float("nan")]}, "sigma_BN must be finite"),
    ({"sigma_BN": [0, 0, 0], "quality": "FINE"}, "quality: expected one of NONE, STALE"),
    ({"sigma_BN": [0, 0, 0], "linear": True}, "linear is for samples over time"),
    ({"sigma_BN": [0, 0, 0], "stale_after": -1}, "stale_after must be >= 0"),
    ({"time": [0, 1], "sigma_BN": [[0, 0, 0]] * 3},
     r"expected \(3,\), or \(2, 3\) for 2 times; found the shape \(3, 3\)"),
    ({"time": [0, 1], "sigma_BN": [[0, 0, 0], [0, 0]]}, "whose rows have one length"),
    ({"time": [1, 0], "sigma_BN": [0, 0, 0]}, "times of messages must rise; found 1 s, then 0 s"),
    ({"time": [0, 1] * m, "sigma_BN": [0, 0, 0]}, "time: expected a quantity in s"),
    ({"time": [0, float("inf")], "sigma_BN": [0, 0, 0]}, "expected times of less than"),
    ({"time": [0], "sigma_BN": [0, 0, 0], "linear": ["sigma"]}, "linear: expected fields of plain numbers"),
])
def test_bad_fields(fields, text):
    sim, tracking = tracker()
    with pytest.raises(SetupError, match=f"feed flight.tracking.attitude.*{text}"):
        sim.feed(tracking.attitude, **fields)


def test_bad_ports():
    sim, tracking = tracker()
    for port, field, text in (
            (tracking.error, "sigma_BR", "tracking.error is no input of this simulation"),
            (tracking.reference, "sigma_RN", "cannot be fed by hand: flight.target.reference already writes it"),
            (tracking, "K", "expected an input")):
        with pytest.raises(SetupError, match=text):
            sim.feed(port, **{field: [0, 0, 0]})
    sim.feed(tracking.attitude, sigma_BN=[0, 0, 0])
    with pytest.raises(SetupError, match="flight.tracking.attitude is fed by hand"):
        sim.world.nav = world.Navigation()
        sim.flight.connect(sim.world.nav.attitude >> tracking.attitude)
    sim, w = body()
    sim.run(1 * s)
    with pytest.raises(SetupError, match="has run until 1 s; reset it"):
        sim.feed(w.wheels.command, u=[0.1])


def test_bad_records(tmp_path):
    sim, tracking = tracker()
    sim.feed(tracking.attitude, sigma_BN=[0, 0, 0])
    log = sim.record(sim.flight.target.reference, tracking.attitude)
    empty, _ = tracker()
    with pytest.raises(SetupError, match="the record has no samples of it"):
        empty.feed(empty.flight.tracking.attitude, log)
    sim.run(1 * s)
    other, w = body()
    for port, record, options, text in (
            (w.wheels.command, log, {}, "the record has no WheelCommand; it has flight.target.reference"),
            (w.wheels.command, log, {"topic": "attitude"},
             "takes WheelCommand, and flight.tracking.attitude is NavAtt"),
            (w.wheels.command, [1, 2], {}, "expected a Log, an Archive or a pandas DataFrame"),
            (w.wheels.command, log, {"u": [1]}, "not both"),
            (w.wheels.command, log.frame("attitude"), {}, "WheelCommand has no attitude.sigma_BN")):
        with pytest.raises(SetupError, match=text):
            other.feed(port, record, **options)
    frame = log.frame("attitude").drop(columns="attitude.sigma_BN[1]")
    with pytest.raises(SetupError, match="some elements of sigma_BN only"):
        sim.feed(tracking.attitude, frame)


# --- missions --------------------------------------------------------------------------------------

MISSION = {
    "flight.py": """
        "Attitudes that a file gives."
        import numpy as np
        from fledge import flight as fsw

        def build(f):
            f.target = fsw.InertialPointing()
            f.tracking = fsw.TrackingError()
            f.connect(f.target.reference >> f.tracking.reference)
            f.feed(f.tracking.attitude, time=[0, 1, 2], sigma_BN=np.eye(3) / 10)
            f.task("gnc", every=0.5, run=[f.target, f.tracking])
        """,
    "dispersions.py": """
        from fledge.units import s

        def reference(d):
            d.duration = 3 * s
            d["flight.target.sigma_RN[2]"] = d.uniform(-0.1, 0.1)
            d.retain("flight.tracking.error.sigma_BR")
        """,
}


def test_campaigns_are_fed_and_targets_refuse(tmp_path):
    folder = tmp_path / "fed"
    folder.mkdir()
    for name, text in MISSION.items():
        (folder / name).write_text(textwrap.dedent(text))
    campaign = fledge.montecarlo.Campaign(folder)
    first, second = (next(iter(campaign.fly(4, seed=1, threads=n).retained.values())) for n in (1, 2))
    assert np.array_equal(first, second, equal_nan=True) and len(np.unique(first)) > 4
    with pytest.raises(Failure, match="flight.tracking.attitude is fed by hand, 3 samples from 0 to 2 s, and no "
                                      "program does that for a target"):
        Job(str(folder), free=True, duration=1.0, folder=tmp_path / "fly")
