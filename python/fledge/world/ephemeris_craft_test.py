# SPDX-License-Identifier: Apache-2.0
"""Spacecraft that follow files: against the run that wrote them, closed forms and numerical derivatives."""

from pathlib import Path

import numpy as np
import pytest

from fledge import Orbit, SetupError, Simulation, archive, files, motion, world
from fledge.attitude import mrp_to_quaternion, quaternion_product
from fledge.motion_test import EPOCH, flight
from fledge.units import s

pytestmark = pytest.mark.skipif(not Path("/usr/share/casacore/data/ephemerides/DE405").exists(),
                                reason="not here: the package casacore-data-jpl-de405")


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
    w.craft = world.EphemerisCraft(**{"orbit": folder / "x.oem", "attitude": folder / "x.aem",
                                      "sky": world.Sky(epoch, center=world.EARTH), **changes})
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
    rows = "\n".join(f"2026-03-20T10:{int(t) // 60:02}:{int(t) % 60:02} 0 0 {np.sin(x / 2)!r} {np.cos(x / 2)!r} 0 0 "
                     f"{w / 2 * np.cos(x / 2)!r} {-w / 2 * np.sin(x / 2)!r}" for t, x, w in zip(times, angle, rate))
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
