# SPDX-License-Identifier: Apache-2.0
"""Runs as files of others, and files of others beside runs."""

import re

import numpy as np
import pytest

from fledge import Orbit, SetupError, Simulation, archive, cli, files, motion, world
from fledge.attitude import quaternion_product
from fledge.files import ndm, spk
from fledge.files.testing.examples import OMM
from fledge.units import deg, km, rad, s
from fledge.world import file_motion
from tests.needs import needs

pytestmark = needs("casacore-data-jpl-de405")
EPOCH = "2026-03-20T10:00:00"
OPM = """CCSDS_OPM_VERS = 3.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEAM
OBJECT_NAME = CRAFT
OBJECT_ID = 2026-001A
CENTER_NAME = EARTH
REF_FRAME = {frame}
TIME_SYSTEM = {scale}
EPOCH = {epoch}
X = 7000 [km]
Y = 100 [km]
Z = -200 [km]
X_DOT = 0.1 [km/s]
Y_DOT = 7.0 [km/s]
Z_DOT = 3.0 [km/s]
"""


def sky(epoch=EPOCH, center=world.EARTH):
    return world.Sky(epoch, center=center)


def flight(path, orbit=None, duration=3000 * s, every=10 * s, with_sky=True):
    sim = Simulation("flight")
    w = sim.world
    w.craft = world.Spacecraft(I_B=[1, 2, 3], gravity=[world.EARTH], omega_BN_B=[0.01, 0.002, -0.003] * rad / s,
                               orbit=orbit or Orbit(world.EARTH, a=7000 * km, e=0.01, i=50 * deg))
    if with_sky:
        w.craft.sky = sky()
    w.task("dynamics", every=1 * s, run=[w.craft])
    sim.record(w.craft.state, every=every)
    sim.archive(path)
    sim.run(duration)
    sim.close_archive()
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return flight(tmp_path_factory.mktemp("motion") / "run.mcap")


@pytest.mark.parametrize("form", ["kvn", "xml"])
@pytest.mark.parametrize("frame", ["ICRF", "TEME", "TOD", "IAU_EARTH"])
def test_a_run_written_is_read_as_it_was(run, tmp_path, frame, form):
    flown = motion.of_run(archive.Archive(run))
    for kind in ("oem", "aem"):
        path = motion.write(flown, kind, tmp_path / f"x.{kind}", frame, form == "xml")
        table = motion.differences(flown, motion.of_file(path, flown.sky))
        assert len(table["t"]) == 301
        assert max(np.abs(values).max() for name, values in table.items() if name != "t") < 2e-6


def test_a_run_written_for_spice_is_read_as_it_was(run, tmp_path, capsys):
    flown = motion.of_run(archive.Archive(run))
    assert cli.main(["convert", str(run), "--spk", "-42", "--out", str(tmp_path / "x.bsp")]) == 0
    found = motion.of_file(tmp_path / "x.bsp", flown.sky)
    table = motion.differences(flown, found)
    assert len(table["t"]) == 301
    # The kernel counts seconds in doubles, to 0.1 us.
    assert table["distance"].max() < 2e-3 and table["velocity"].max() < 2e-6
    for center in (world.EARTH, world.MOON):            # as a body of a sky
        with_craft = world.Sky(EPOCH, center=center, kernels=["DE405", str(tmp_path / "x.bsp")])
        craft, earth = (np.asarray(with_craft.state(body, 1000.0).r_PN_N) for body in (-42, 399))
        assert np.linalg.norm(craft - earth - flown.r_N[100]) < 2e-3
    assert cli.main(["convert", str(run), "--spk", "42"]) == 2
    written = (tmp_path / "x.bsp").read_bytes()
    for frame, status in (("GCRF", 0), ("J2000", 0), ("TEME", 2)):
        out = tmp_path / f"{frame}.bsp"
        assert cli.main(["convert", str(run), "--spk", "-42", "--frame", frame, "--out", str(out)]) == status
        assert (out.read_bytes() == written) if out.exists() else status
    assert "found TEME: leave it out, or write an OEM" in capsys.readouterr().err
    spk.write(tmp_path / "moon.bsp", target="MOON", center="EARTH", times=flown.epochs, r=flown.r_N, v=flown.v_N)
    with pytest.raises(SetupError, match="moon.bsp: expected the orbit of a single spacecraft.*found none"):
        motion.of_file(tmp_path / "moon.bsp", flown.sky)


@pytest.mark.parametrize("frame", ["ICRF", "J2000", "TEME", "TOD"])
def test_a_run_written_for_stk_is_read_as_it_was(run, tmp_path, frame):
    flown = motion.of_run(archive.Archive(run))
    for kind in ("e", "a"):
        path = motion.write(flown, kind, tmp_path / "x", frame)
        assert path == tmp_path / f"x.{kind}"
        table = motion.differences(flown, motion.of_file(path, flown.sky))
        assert len(table["t"]) == 301 and ("attitude" in table) == (kind == "a")
        assert max(np.abs(values).max() for name, values in table.items() if name != "t") < 2e-6
    with pytest.raises(SetupError, match="expected a body and axes of STK, .*; found EARTH and IAU_EARTH"):
        motion.write(flown, "e", tmp_path / "y", "IAU_EARTH")
    text = (tmp_path / "x.e").read_text().replace("CoordinateSystem", "CoordinateSystem MeanOfDate #")
    with pytest.raises(SetupError, match="the text, line 2: expected a reference frame of ICRF.*; found MeanOfDate"):
        motion.of_file(text, flown.sky)


@pytest.mark.parametrize("frame", ["ICRF", "TEME", "ITRF"])
def test_an_attitude_written_for_stk_has_rates(run, tmp_path, frame):
    segment = files.read(motion.write(motion.of_run(archive.Archive(run)), "a", tmp_path / "x", frame)).segment
    beta = segment.beta_BA
    differences = (8 * (beta[3:-1] - beta[1:-3]) - (beta[4:] - beta[:-4])) / 120       # of the fourth order in 10 s
    np.testing.assert_allclose(segment.rates(beta)[2:-2], differences, atol=1e-8)
    assert "AttitudeTimeQuatAngVels" in (tmp_path / "x.a").read_text()


def test_between_its_lines_a_file_is_where_the_run_was(run, tmp_path):
    fine = motion.of_run(archive.Archive(run))
    coarse = motion.of_run(archive.Archive(flight(tmp_path / "coarse.mcap", every=60 * s)))
    motion.write(coarse, "oem", tmp_path / "x.oem")
    table = motion.differences(fine, motion.of_file(tmp_path / "x.oem", fine.sky))
    assert len(table["t"]) == 301 and table["distance"].max() < 1e-3 and table["velocity"].max() < 1e-3


def test_differences_are_along_the_axes_of_the_orbit(tmp_path, run):
    # A file whose craft is 100 m further out, then 1 s behind on the same orbit, then turned by 0.5 deg.
    flown = motion.of_run(archive.Archive(run))
    further = 1 + 100 / np.linalg.norm(flown.r_N, axis=1)[:, None]
    out = file_motion.Motion(**{**vars(flown), "r_N": flown.r_N * further})
    motion.write(out, "oem", tmp_path / "out.oem")
    table = motion.differences(flown, motion.of_file(tmp_path / "out.oem", flown.sky))
    np.testing.assert_allclose(table["radial"], -100, atol=1e-5)
    assert np.abs(table["along"]).max() < 1e-5 and np.abs(table["cross"]).max() < 1e-5
    late = file_motion.Motion(**{**vars(flown), "times": flown.times + 10**9})
    motion.write(late, "oem", tmp_path / "late.oem")
    table = motion.differences(flown, motion.of_file(tmp_path / "late.oem", flown.sky))
    speed = np.linalg.norm(flown.v_N, axis=1)[1:-1]
    np.testing.assert_allclose(table["distance"][:len(speed)], speed, rtol=2e-3)
    assert table["along"].min() > 7000 and np.abs(table["cross"]).max() < 1e-3
    turn = np.tile([np.cos(np.pi / 720), *(np.sin(np.pi / 720) * np.array([2, -1, 2]) / 3)], (len(flown.times), 1))
    turned = file_motion.Motion(**{**vars(flown), "beta_BN": quaternion_product(turn, flown.beta_BN)})
    motion.write(turned, "aem", tmp_path / "turned.aem")
    table = motion.differences(flown, motion.of_file(tmp_path / "turned.aem", flown.sky))
    np.testing.assert_allclose(table["attitude"], 0.5, atol=1e-9)


def test_the_commands_convert_and_compare(run, tmp_path, capsys):
    for form in ("oem", "aem"):
        path = tmp_path / f"craft.{form}"
        assert cli.main(["convert", str(run), f"--{form}", "--out", str(path)]) == 0
        assert capsys.readouterr().out == f"{path}\n"
        assert cli.main(["compare", str(run), str(path), "--tolerance", "1e-6", "--csv", str(tmp_path / "d.csv")]) == 0
        shown = capsys.readouterr().out
        assert "301 instants, 2026-03-20T10:00:00Z to" in shown and ("radial" in shown) == (form == "oem")
        assert np.loadtxt(tmp_path / "d.csv", delimiter=",", skiprows=1).shape == (301, 6 if form == "oem" else 2)
    assert cli.main(["convert", str(run), "--stk", "--out", str(tmp_path / "x.e")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'x.e'}\n{tmp_path / 'x.a'}\n"
    assert cli.main(["compare", str(run), str(tmp_path / "x.e"), "--tolerance", "1e-6"]) == 0
    other = flight(tmp_path / "other.mcap", Orbit(world.EARTH, a=7000.1 * km, e=0.01, i=50 * deg))
    assert cli.main(["compare", str(other), str(tmp_path / "craft.oem"), "--tolerance", "1"]) == 1
    assert cli.main(["compare", str(other), str(tmp_path / "craft.oem")]) == 0
    capsys.readouterr()
    bare = flight(tmp_path / "bare.mcap", with_sky=False)
    assert cli.main(["convert", str(bare), "--oem"]) == 2
    assert "world.craft has no sky, so that its times have no date; give" in capsys.readouterr().err
    assert cli.main(["convert", str(bare), "--oem", "--epoch", EPOCH, "--center", "EARTH"]) == 0
    assert cli.main(["compare", str(run), str(bare.with_suffix(".oem")), "--tolerance", "1e-6"]) == 0
    assert cli.main(["convert", str(bare), "--oem", "--epoch", EPOCH]) == 2
    assert cli.main(["compare", str(run), str(tmp_path / "craft.oem"), "--craft", "chief"]) == 2
    assert "expected the name of one spacecraft of world.craft; found chief" in capsys.readouterr().err


@pytest.mark.parametrize("frame, scale, epoch", [("GCRF", "UTC", EPOCH), ("TEME", "TAI", "2026-03-20T10:00:37"),
                                                 ("GCRF", "GPS", "2026-03-20T10:00:18"), ("TOD", "UTC", EPOCH)])
def test_an_orbit_begins_where_an_opm_says(frame, scale, epoch):
    orbit = Orbit.from_file(sky(), OPM.format(frame=frame, scale=scale, epoch=epoch))
    r, v = np.array([7e6, 1e5, -2e5]), np.array([100.0, 7000, 3000])
    axes = {"GCRF": np.eye(3), "TEME": sky().teme_of_date(), "TOD": sky().true_of_date()}[frame]
    np.testing.assert_allclose(orbit.r_BN_N, axes.T @ r, atol=1e-5)
    np.testing.assert_allclose(orbit.v_BN_N, axes.T @ v, atol=2e-4)
    about_mars = Orbit.from_file(sky(center=world.MARS), OPM.format(frame="ICRF", scale="UTC", epoch=EPOCH))
    np.testing.assert_allclose(about_mars.r_BN_N, r, atol=1e-3)      # about the Earth, wherever N has its origin


def test_orbits_of_other_times_and_files_without_are_refused(tmp_path, run):
    text = OPM.format(frame="GCRF", scale="UTC", epoch="2026-03-20T10:00:01")
    with pytest.raises(SetupError, match="its orbit is of 2026-03-20T10:00:01Z to .*, and the time 0 s of the run is "):
        Orbit.from_file(sky(), text)
    assert Orbit.from_file(sky(), text, 1 * s).r_BN_N[0] == pytest.approx(7e6)
    flown = motion.of_run(archive.Archive(run))
    motion.write(flown, "aem", tmp_path / "x.aem")
    with pytest.raises(SetupError, match="x.aem: has no orbit"):
        Orbit.from_file(sky(), tmp_path / "x.aem")
    motion.write(flown, "oem", tmp_path / "x.oem")
    np.testing.assert_allclose(Orbit.from_file(sky(), tmp_path / "x.oem", 1005 * s).r_BN_N, np.mean(flown.r_N[100:102],
                               axis=0), atol=150)
    text = (tmp_path / "x.oem").read_text()
    for line, found in (("REF_FRAME            = XYZ", "line 6: expected a reference frame of ICRF"),
                        ("CENTER_NAME          = VULCAN", "CENTER_NAME: expected SUN, MERCURY"),
                        ("TIME_SYSTEM          = MET", "TIME_SYSTEM: expected UTC, TAI")):
        key = line.split()[0]
        changed = "\n".join(line if row.startswith(key) else row for row in text.splitlines())
        (tmp_path / "y.oem").write_text(changed)
        with pytest.raises(SetupError, match=f"y.oem.*{found}"):
            motion.of_file(tmp_path / "y.oem", sky())
    later = motion.of_run(archive.Archive(run), sky=sky("2026-04-01"))
    with pytest.raises(SetupError, match="no instant is common: the run is from 2026-04-01T00:00:00Z to"):
        motion.differences(later, motion.of_file(tmp_path / "x.oem", later.sky))
    with pytest.raises(SetupError, match="expected an OEM, AEM, OPM, OMM or two-line elements; found APM|CDM"):
        motion.of_file(APM, sky())


APM = """CCSDS_APM_VERS = 1.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEAM
OBJECT_NAME = CRAFT
OBJECT_ID = 2026-001A
TIME_SYSTEM = UTC
EPOCH = 2026-03-20T10:00:00
Q_FRAME_A = ICRF
Q_FRAME_B = SC_BODY_1
Q_DIR = A2B
Q1 = 0
Q2 = 0
Q3 = 0
QC = 1
"""


def test_a_run_beside_two_line_elements(tmp_path):
    elements = """1 25544U 98067A   26079.40000000  .00000000  00000-0  00000-0 0  9998
2 25544  51.6400  80.0000 0002000  30.0000 330.0000 15.49000000    06"""
    flown = motion.of_run(archive.Archive(flight(tmp_path / "run.mcap", Orbit.from_file(sky(), elements), 600 * s)))
    table = motion.differences(flown, motion.of_file(elements, flown.sky))
    assert table["distance"][0] < 1e-3 and 10 < table["distance"][-1] < 3000   # J2, which the run lacks
    omm = OMM
    for key, value in (("EPOCH", "2026-03-20T09:36:00"), ("MEAN_MOTION", 15.49), ("ECCENTRICITY", 0.0002),
                       ("INCLINATION", 51.64), ("RA_OF_ASC_NODE", 80), ("ARG_OF_PERICENTER", 30),
                       ("MEAN_ANOMALY", 330), ("BSTAR", 0)):
        omm = re.sub(f"(?m)^{key} = .*", f"{key} = {value}", omm)
    for text in (omm, ndm.text_of(files.read(omm), "xml")):
        again = motion.differences(flown, motion.of_file(text, flown.sky))
        np.testing.assert_allclose(again["distance"], table["distance"], atol=1e-3)
    with pytest.raises(SetupError, match="the text, line 7: REF_FRAME: expected TEME; found GCRF"):
        motion.of_file(omm.replace("TEME", "GCRF"), flown.sky)
    assert files.read(elements).number == 25544
