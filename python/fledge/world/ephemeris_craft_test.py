# SPDX-License-Identifier: Apache-2.0
"""Spacecraft that follow files: against the run that wrote them, closed forms and numerical derivatives."""

from functools import partial

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebfit

from fledge import Orbit, SetupError, Simulation, archive, files, motion, world
from fledge.attitude import mrp_to_quaternion, quaternion_product, quaternion_to_dcm
from fledge.files import daf, ndm, spk
from fledge.files.ephemeris import AemSegment, OemSegment
from fledge.motion_test import EPOCH, flight
from fledge.units import s
from fledge.world import file_motion
from tests.needs import needs

pytestmark = needs("casacore-data-jpl-de405")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A run, and its orbit and attitude in files with a line each minute and each second."""
    folder = tmp_path_factory.mktemp("followed")
    run = motion.of_run(archive.Archive(flight(folder / "fine.mcap", every=1 * s)))
    coarse = motion.of_run(archive.Archive(flight(folder / "run.mcap", every=60 * s)))
    motion.write(coarse, "oem", folder / "x.oem", "TEME")
    motion.write(run, "aem", folder / "x.aem")
    return run, folder


def followed(folder, duration=3000 * s, every=1 * s, epoch=EPOCH, **changes):
    sim = Simulation("followed")
    w = sim.world
    of_folder = {"orbit": folder / "x.oem", "attitude": folder / "x.aem"} if folder else {}
    given = {**of_folder, "sky": world.Sky(epoch, center=world.EARTH), **changes}
    w.craft = world.EphemerisCraft(**{name: value for name, value in given.items() if value is not None})
    w.nav = world.Navigation()
    w.connect(w.craft.state >> w.nav.truth)
    w.task("world", every=every, run=[w.craft, w.nav])
    log = sim.record(w.craft.state)
    sim.run(duration)
    return sim, log


def test_it_goes_where_the_run_went(written):
    run, folder = written
    sim, log = followed(folder)
    np.testing.assert_allclose(log["craft.state.r_BN_N"], run.r_N, atol=1e-3)
    np.testing.assert_allclose(log["craft.state.v_BN_N"], run.v_N, atol=1e-4)
    turn = quaternion_product(mrp_to_quaternion(log["craft.state.sigma_BN"]), run.beta_BN * [1, -1, -1, -1])
    assert np.linalg.norm(turn[:, 1:], axis=1).max() < 1e-9
    # Between the lines of the attitude the rate is its mean over a second.
    np.testing.assert_allclose(log["craft.state.omega_BN_B"][:-1], (run.omega_BN_B[1:] + run.omega_BN_B[:-1]) / 2,
                               atol=1e-6)
    # In a field of a point mass its acceleration is gravity.
    r, a = np.array(log["craft.state.r_BN_N"]), np.array(log["craft.state.a_BN_N"])
    gravity = -world.EARTH.mu * r / np.linalg.norm(r, axis=1)[:, None]**3
    assert np.abs(a - gravity)[60:-60].max() < 1e-5
    assert int(sim.world.nav.attitude.head.quality) == 3
    clone = sim.clone()
    assert clone.snapshot() == sim.snapshot() and clone.world.craft.orbit == str(folder / "x.oem")


def test_it_follows_a_kernel_of_spice(written, tmp_path):
    run, folder = written
    coarse = motion.of_run(archive.Archive(folder / "run.mcap"))
    motion.write_spk(coarse, tmp_path / "x.bsp", -42)
    _, log = followed(tmp_path, orbit=tmp_path / "x.bsp", attitude=folder / "x.aem")
    np.testing.assert_allclose(log["craft.state.r_BN_N"], run.r_N, atol=2e-3)
    np.testing.assert_allclose(log["craft.state.v_BN_N"], run.v_N, atol=1e-4)


def test_it_follows_files_of_stk(written, tmp_path):
    run, folder = written
    for form, source in (("e", "oem"), ("a", "aem")):
        files.write(files.read(folder / f"x.{source}"), tmp_path / f"x.{form}", "stk")
    _, log = followed(tmp_path, orbit=tmp_path / "x.e", attitude=tmp_path / "x.a")
    np.testing.assert_allclose(log["craft.state.r_BN_N"], run.r_N, atol=1e-3)
    turn = quaternion_product(mrp_to_quaternion(log["craft.state.sigma_BN"]), run.beta_BN * [1, -1, -1, -1])
    assert np.linalg.norm(turn[:, 1:], axis=1).max() < 1e-9
    alone = "\n".join(line if line[:1].isalpha() else " ".join(line.split()[:4]) for line in
                      (tmp_path / "x.e").read_text().replace("PosVel", "Pos").replace("Hermite", "Lagrange").replace(
                          "SamplesM1 3", "SamplesM1 7").split("\n"))
    (tmp_path / "alone.e").write_text(alone)
    _, log = followed(tmp_path, orbit=tmp_path / "alone.e", attitude=tmp_path / "x.a")
    np.testing.assert_allclose(log["craft.state.r_BN_N"], run.r_N, atol=0.1)
    np.testing.assert_allclose(log["craft.state.v_BN_N"], run.v_N, atol=0.01)
    np.testing.assert_allclose(Orbit.from_file(run.sky, tmp_path / "alone.e").v_BN_N, run.v_N[0], atol=0.01)


def test_attitudes_with_rates_are_met_with_them(written, tmp_path):
    # B turns about its third axis by an angle that grows with the square of time.
    times, growth = np.arange(0, 101, 2.0), 1e-4
    angle, rate = 0.5 * growth * times**2, growth * times
    rows = "\n".join(f"2026-03-20T10:{int(t) // 60:02}:{int(t) % 60:02} 0 0 {np.sin(x / 2)} {np.cos(x / 2)} 0 0 "
                     f"{w / 2 * np.cos(x / 2)} {-w / 2 * np.sin(x / 2)}" for t, x, w in zip(times, angle, rate))
    (tmp_path / "x.aem").write_text(f"""CCSDS_AEM_VERS = 1.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEAM
META_START
OBJECT_NAME = CRAFT
OBJECT_ID = 2026-001A
REF_FRAME_A = ICRF
REF_FRAME_B = SC_BODY_1
ATTITUDE_DIR = A2B
TIME_SYSTEM = UTC
START_TIME = 2026-03-20T10:00:00
STOP_TIME = 2026-03-20T10:01:40
ATTITUDE_TYPE = QUATERNION/DERIVATIVE
QUATERNION_TYPE = LAST
META_STOP
DATA_START
{rows}
DATA_STOP
""")
    _, log = followed(written[1], 90 * s, attitude=tmp_path / "x.aem")
    t = np.arange(91.0)
    np.testing.assert_allclose(log["craft.state.sigma_BN"][:, 2], np.tan(growth * t**2 / 8), atol=1e-8)
    np.testing.assert_allclose(log["craft.state.omega_BN_B"][:, 2], growth * t, atol=1e-7)
    np.testing.assert_allclose(log["craft.state.domega_BN_B"][:, 2], growth, atol=1e-6)


def test_what_the_files_lack_is_refused_before_the_run(written):
    _, folder = written
    for words, arguments in (
            ("world.craft: .*x.oem says nothing after 2026-03-20T10:.*, but the run is from 2026-03-20T10:00:00Z to", {
                "duration": 4000 * s}),
            ("x.oem says nothing before 2026-03-20T10:00:00Z, but the run is from 2026-03-20T09:59:00Z", {
                "epoch": "2026-03-20T09:59:00"}),
            ("EphemerisCraft.orbit: expected an OEM, or another file of an orbit over time; found .*x.aem", {
                "orbit": folder / "x.aem"}),
            ("EphemerisCraft.orbit: expected the path of a file; found 5", {"orbit": 5}),
            ("nowhere.oem: ", {"orbit": folder / "nowhere.oem"})):
        with pytest.raises(SetupError, match=words):
            followed(folder, **arguments)
    for words, arguments in (("orbit is missing: the file that it follows", {"sky": world.Sky(EPOCH, world.EARTH)}),
                             ("sky is missing: it says what the dates and", {"orbit": folder / "x.oem"})):
        with pytest.raises(SetupError, match=f"world.craft.{words}"):
            sim = Simulation("bare")
            sim.world.craft = world.EphemerisCraft(**arguments)
            sim.world.task("world", every=1 * s, run=[sim.world.craft])
            sim.run(1 * s)


def circle(t, radius=7e6, v_z=0.0):
    """r [m], v [m/s] (n, 3) of a circle about the Earth at times [s] (n,); v_z: of a straight line across."""
    n, t = np.sqrt(world.EARTH.mu / radius**3), np.asarray(t, float)
    r = np.stack([radius * np.cos(n * t), radius * np.sin(n * t), v_z * t], axis=1)
    return r, np.stack([-n * r[:, 1], n * r[:, 0], v_z + 0 * t], axis=1)


def kernel(path, *segments):
    """A kernel of spacecraft -42 of (first, last [s], curve, times of states [s], number of the type)."""
    found = []
    for first, last, curve, times, kind in segments:
        r, v = curve(times)
        spk.write(path, target=-42, center="EARTH", times=(times * 1e9).astype(np.int64), r=r, v=v, type=kind, degree=7)
        segment, = daf.read(path, spk.KIND).segments
        found.append(daf.Segment(first, last, segment.integers, "S", segment.words))
    daf.write(path, daf.Daf(spk.KIND, found))
    return path


LINES = np.arange(0, 6001, 60.0)
LOW, HIGH = circle, partial(circle, radius=8e6)
BURN = partial(circle, v_z=10.0)


@pytest.mark.parametrize("kind", [13, 9])
@pytest.mark.parametrize("begin, end, segments, expected", [
    # States lie beyond the ends; segments come in any order; a maneuver is at a border; the last of the file counts.
    (630, 5370, [(630, 5370, LOW, LINES)], [(630, LOW)]),
    (0, 6000, [(3000, 6000, HIGH, LINES), (0, 3000, LOW, LINES)], [(0, LOW), (3010, HIGH)]),
    (0, 6000, [(0, 3000, LOW, LINES[:51]), (3000, 6000, BURN, LINES[50:])], [(0, LOW), (3000, BURN)]),
    (0, 6000, [(0, 6000, LOW, LINES), (1200, 3600, HIGH, LINES[10:70])], [(0, LOW), (1200, HIGH), (3610, LOW)]),
    (1200, 3600, [(1200, 3600, HIGH, LINES), (0, 6000, LOW, LINES)], [(1200, LOW)]),
])
def test_all_take_the_states_of_a_kernel_from_the_same_segment(tmp_path, kind, begin, end, segments, expected):
    path = kernel(tmp_path / "x.bsp", *[(*segment, kind) for segment in segments])
    epoch = f"2000-01-01T{12 + begin // 3600:02}:{begin % 3600 // 60:02}:{begin % 60:02} TDB"
    sky = world.Sky(epoch, world.EARTH)
    sim = Simulation("followed")
    sim.world.craft = world.EphemerisCraft(orbit=path, sky=sky)
    sim.world.task("world", every=10 * s, run=[sim.world.craft])
    log = sim.record(sim.world.craft.state)
    sim.run((end - begin) * s)
    t = np.arange(begin, end + 1, 10)
    truth = np.zeros((2, len(t), 3))
    for since, curve in expected:
        truth[:, t >= since] = curve(t[t >= since])
    found, times = motion.of_file(path, sky), np.arange(len(t)) * 10 * 10**9
    with_it = world.Sky(epoch, world.EARTH, ["DE405", str(path)])
    states = [with_it.state(-42, int(x) - begin) for x in t]
    at = found.at(times)
    for r, v in ((log["craft.state.r_BN_N"], log["craft.state.v_BN_N"]), (at.r_N, at.v_N),
                 ([x.r_PN_N for x in states], [x.v_PN_N for x in states])):
        np.testing.assert_allclose(r, truth[0], atol=2e-3)
        np.testing.assert_allclose(v, truth[1], atol=1e-4)
    for segment, (first, last, curve, lines) in zip(spk.read(path), segments):      # each by itself
        inside = np.arange(first, last + 1, 10) * 10**9
        np.testing.assert_allclose(segment.at(inside)[0], curve(inside / 1e9)[0], atol=2e-3)
        assert np.array_equal(segment.times, (lines * 1e9).astype(np.int64))
        with pytest.raises(SetupError, match="x.bsp: segment ., S: body -42 is given from .*: choose the segment"):
            segment.at([int((last + 1) * 1e9)])


def test_kernels_of_other_types_are_followed(tmp_path, monkeypatch):
    mu, nodes = world.EARTH.mu / 1e9, np.cos(np.pi * (np.arange(13) + 0.5) / 13)
    conic = np.array([7000, 0, 0, 0, np.sqrt(mu / 7000), 0, 0, mu, 1])
    records = [[mid, 600.0, *chebfit(nodes, circle(mid + 600 * nodes)[0] / 1e3, 12).T.ravel()]
               for mid in (600.0, 1800.0, 3000.0)]
    r, v = circle(LINES)
    chord = np.hstack([np.hstack([r, v])[:80].ravel() / 1e3, LINES[:80], 1, 80])  # of type 9, degree 1
    even = np.hstack([np.hstack([r, v]).ravel() / 1e3, 0, 60, 3, len(LINES)])   # of type 12, degree 7
    for kind, words, within in ((2, [*np.ravel(records), 0, 1200, 41, 3], 3e-3), (5, conic, 3e-3), (12, even, 3e-3),
                                (9, chord, 8.2 * 30**2 / 2)):
        daf.write(tmp_path / "x.bsp", daf.Daf(spk.KIND, [daf.Segment(0, 3600, (-42, 399, 1, kind), "S",
                                                                     np.asarray(words, float))]))
        sky = world.Sky("2000-01-01T12:00:00 TDB", world.EARTH)
        sim = Simulation("followed")
        sim.world.craft = world.EphemerisCraft(orbit=tmp_path / "x.bsp", sky=sky)
        sim.world.task("world", every=7 * s, run=[sim.world.craft])
        log = sim.record(sim.world.craft.state)
        sim.run(3598 * s)
        times = np.arange(515) * 7 * 10**9
        positions = np.array(log["craft.state.r_BN_N"])
        assert np.linalg.norm(positions - circle(times / 1e9)[0], axis=1).max() < within
        assert np.linalg.norm(positions - motion.of_file(tmp_path / "x.bsp", sky).at(times).r_N, axis=1).max() < 3e-3
    monkeypatch.setattr(file_motion, "MOST", 100)
    daf.write(tmp_path / "y.bsp", daf.Daf(spk.KIND, [daf.Segment(-1e9, 1e9, (-42, 399, 1, 5), "S", conic)]))
    with pytest.raises(SetupError, match="y.bsp: 100 instants between its lines are too few.*a span not much longer"):
        world.EphemerisCraft(orbit=tmp_path / "y.bsp", sky=sky)


def message(path, kind, *segments):
    files.write(ndm.create(kind, list(segments), originator="TEAM", created="2026-01-01T00:00:00"), path)
    return path


def arc(curve, first, last, **meta):
    """An OEM's segment of seconds of TDB from the epoch on."""
    t = np.arange(first, last + 1, 60)
    meta = {"OBJECT_NAME": "CRAFT", "OBJECT_ID": "2026-001A", "CENTER_NAME": "EARTH", "REF_FRAME": "ICRF",
            "TIME_SYSTEM": "TDB", "INTERPOLATION": "HERMITE", "INTERPOLATION_DEGREE": 7, **meta}
    return OemSegment.of(meta, t * 10**9, *curve(t))


@pytest.mark.parametrize("segments, expected", [
    ([(LOW, 0, 1800), (BURN, 1800, 3600)], [(0, LOW), (1800, BURN)]),
    ([(BURN, 1800, 3600), (LOW, 0, 1800)], [(0, LOW), (1801, BURN)]),
    ([(LOW, 0, 3600), (HIGH, 1200, 2400)], [(0, LOW), (1200, HIGH), (2401, LOW)])])
def test_at_instants_that_segments_share_all_take_the_last(tmp_path, segments, expected):
    path = message(tmp_path / "x.oem", "OEM", *[arc(*segment) for segment in segments])
    sim, log = followed(None, 3600 * s, epoch="2000-01-01T12:00:00 TDB", orbit=path, attitude=None)
    t = np.arange(3601)
    truth = np.zeros((2, len(t), 3))
    for since, curve in expected:
        truth[:, t >= since] = curve(t[t >= since])
    at = motion.of_file(path, sim.world.craft.sky).at(t * 10**9)
    for r, v in ((log["craft.state.r_BN_N"], log["craft.state.v_BN_N"]), (at.r_N, at.v_N)):
        np.testing.assert_allclose(r, truth[0], atol=1e-3)
        np.testing.assert_allclose(v, truth[1], atol=1e-4)
    begun = [Orbit.from_file(sim.world.craft.sky, path, since * s).v_BN_N for since, _ in expected]
    np.testing.assert_allclose(begun, [truth[1, since] for since, _ in expected], atol=1e-4)


def test_no_orbit_begins_between_segments(tmp_path):
    path = message(tmp_path / "x.oem", "OEM", arc(LOW, 0, 600), arc(LOW, 1200, 1800))
    sky = world.Sky("2000-01-01T12:00:00 TDB", world.EARTH)
    with pytest.raises(SetupError, match="x.oem: says nothing of the time 900 s of the run, .*: it lies betw"):
        Orbit.from_file(sky, path, 900 * s)
    with pytest.raises(SetupError, match="x.oem says nothing after 2000-01-01T12:08:55"):
        followed(None, 1800 * s, epoch="2000-01-01T12:00:00 TDB", orbit=path, attitude=None)


@pytest.mark.parametrize("method", ["LINEAR", "LAGRANGE", "HERMITE"])
def test_a_place_on_the_ground_stays_there_between_lines(tmp_path, method):
    # What does not move in the file's frame turns with it, however far its lines are apart.
    t, r = np.arange(0, 12 * 3600 + 1, 3600), np.array([42164172.0, 0, 0])
    path = message(tmp_path / "x.oem", "OEM", OemSegment.of({
        "OBJECT_NAME": "GEO", "OBJECT_ID": "2026-001A", "CENTER_NAME": "EARTH", "REF_FRAME": "ITRF2014",
        "TIME_SYSTEM": "TDB", "INTERPOLATION": method, "INTERPOLATION_DEGREE": 1 if method == "LINEAR" else 3},
        t * 10**9, np.tile(r, (13, 1)), np.zeros((13, 3))))
    sim, log = followed(None, 43200 * s, 97 * s, "2000-01-01T12:00:00 TDB", orbit=path, attitude=None)
    turned = [sim.world.craft.sky.orientation("EARTH", float(x)) for x in np.arange(0, 43201, 97)]
    truth = np.array([a.dcm_PN.T @ r for a in turned])
    np.testing.assert_allclose(log["craft.state.r_BN_N"], truth, atol=2e-3)
    np.testing.assert_allclose(log["craft.state.v_BN_N"],
                               [a.dcm_PN.T @ np.cross(a.omega_PN_P, r) for a in turned], atol=1e-4)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_body_at_rest_in_a_frame_that_turns_turns_with_it(tmp_path, reverse):
    names = ["ITRF2014", "SC_BODY_1"][::-1 if reverse else 1]
    path = message(tmp_path / "x.aem", "AEM", AemSegment.of({
        "OBJECT_NAME": "X", "OBJECT_ID": "2026-001A", "REF_FRAME_A": names[0], "REF_FRAME_B": names[1],
        "ATTITUDE_DIR": "A2B", "TIME_SYSTEM": "TDB", "QUATERNION_TYPE": "LAST"},
        np.arange(3) * 13 * 3600 * 10**9, np.tile([0.8, 0, 0.6, 0], (3, 1))))
    sim, log = followed(None, 26 * 3600 * s, 997 * s, "2000-01-01T12:00:00 TDB", orbit=None, attitude=path)
    sky = sim.world.craft.sky
    t = np.arange(0, 26 * 3600, 997)
    turned = [sky.orientation("EARTH", float(x)) for x in t]
    dcm_BF = quaternion_to_dcm([0.8, 0, -0.6 if reverse else 0.6, 0])
    at = motion.of_file(path, sky).at(t * 10**9)
    for beta in (mrp_to_quaternion(log["craft.state.sigma_BN"]), at.beta_BN):
        np.testing.assert_allclose(quaternion_to_dcm(beta), [dcm_BF @ a.dcm_PN for a in turned], atol=1e-8)
    np.testing.assert_allclose(log["craft.state.omega_BN_B"], [dcm_BF @ a.omega_PN_P for a in turned], atol=1e-9)


@pytest.mark.parametrize("frame", ["ICRF", "TEME", "ITRF2014"])
@pytest.mark.parametrize("method, degree", [("LINEAR", 1), ("LAGRANGE", 5), ("HERMITE", 3), ("HERMITE", 7)])
def test_a_spin_is_followed_as_its_file_says(tmp_path, frame, method, degree):
    t = np.arange(0, 301, 10)
    angle, rate = 0.1 * t + 0.2 * np.sin(0.01 * t), 0.1 + 0.002 * np.cos(0.01 * t)
    axis = np.array([0.6, 0, 0.8])
    path = message(tmp_path / "x.aem", "AEM", AemSegment.of({
        "OBJECT_NAME": "X", "OBJECT_ID": "2026-001A", "REF_FRAME_A": frame, "REF_FRAME_B": "SC_BODY_1",
        "TIME_SYSTEM": "TDB", "INTERPOLATION_METHOD": method, "INTERPOLATION_DEGREE": degree}, t * 10**9,
        np.hstack([np.cos(angle / 2)[:, None], np.sin(angle / 2)[:, None] * axis]), rate[:, None] * axis))
    sim, log = followed(None, 300 * s, epoch="2000-01-01T12:00:00 TDB", orbit=None, attitude=path)
    at = motion.of_file(path, sim.world.craft.sky).at(np.arange(301) * 10**9)
    turn = quaternion_product(mrp_to_quaternion(log["craft.state.sigma_BN"]), at.beta_BN * [1, -1, -1, -1])
    assert np.linalg.norm(turn[:, 1:], axis=1).max() < 3e-9
    # The rate is that of the attitude: against differences of the fourth order.
    beta = at.beta_BN * np.cumprod(np.append(1, np.sign(np.sum(at.beta_BN[1:] * at.beta_BN[:-1], axis=1))))[:, None]
    steps = (8 * (beta[3:-1] - beta[1:-3]) - (beta[4:] - beta[:-4])) / 12
    omega = 2 * quaternion_product(steps, beta[2:-2] * [1, -1, -1, -1])[:, 1:]
    smooth = np.abs(np.arange(2, 299) % 10 - 5) < 3
    np.testing.assert_allclose(np.array(log["craft.state.omega_BN_B"])[2:-2][smooth], omega[smooth], atol=2e-6)
