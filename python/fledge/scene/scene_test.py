# SPDX-License-Identifier: Apache-2.0
"""Scenes against records and closed forms, and the page that shows them in a browser."""

import base64
import json
import re
import shutil
import zlib

import numpy as np
import pytest

import fledge
from fledge import SetupError, cli, scene, world
from fledge.attitude import mrp_to_dcm
from fledge.scene import bundle, film, page, tracks
from fledge.scene.browser import Browser
from fledge.scene.testing.node import in_node, needs_node, opens
from fledge.units import deg, kg, km, m, minute, rad, s
from tests.needs import module
from tests.waiting import PATIENCE

EARTH = world.EARTH


# --- tracks ----------------------------------------------------------------------------------------

def circle(t, radius=7e6):
    rate = np.sqrt(EARTH.mu / radius**3)
    a = rate * t
    r = radius * np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    return tracks.Motion(t, r, rate * np.stack([-r[:, 1], r[:, 0], 0 * a], axis=1))


def test_a_track_without_values_has_no_samples():
    none = np.zeros(0)
    for track in (tracks.Motion(none, np.zeros((0, 3)), np.zeros((0, 3))), tracks.Turning(none, np.zeros((0, 4))),
                  tracks.Signal(none, np.zeros((0, 2)))):
        assert len(track.thinned().time) == 0


def test_a_circle_needs_few_samples_and_stays_within_the_bound():
    exact = circle(np.arange(0, 6000, 0.5))
    thin = exact.thinned()
    assert len(thin.time) < len(exact.time) / 20
    off = np.linalg.norm(thin.at(exact.time) - exact.r, axis=1).max()
    # Of cubics between points h apart the error is a h^4 w^2 / 384: the largest power of 2 of samples within 1 cm.
    h, rate = np.diff(thin.time).max(), np.sqrt(EARTH.mu / 7e6**3)
    bound = 7e6 * (h * rate)**4 / 384
    assert 0.8 * bound < off <= tracks.POSITION < 16 * bound * 1.3


def test_a_steady_turn_needs_only_samples_less_than_half_a_turn_apart():
    t = np.arange(0, 100, 0.1)
    phi = 0.3 * t
    turning = tracks.Turning(t, np.stack([0 * t, 0 * t, np.sin(phi / 2), np.cos(phi / 2)], axis=1))
    thin = turning.thinned()
    assert len(thin.time) <= 33     # 30 rad: between two samples less than half a turn
    assert np.abs(thin.at(t) - turning.q * np.sign((thin.at(t) * turning.q).sum(axis=1))[:, None]).max() < 1e-9


def test_a_quaternion_turns_as_its_mrp():
    sigma = np.array([[0.1, -0.4, 0.3]])
    x, y, z, w = tracks.Turning.of_mrp(np.zeros(1), sigma).q[0]
    v = np.array([x, y, z])
    seen = np.array([e + 2 * np.cross(v, np.cross(v, e) + w * e) for e in np.eye(3)])      # of B's axes, in N
    np.testing.assert_allclose(seen, mrp_to_dcm(sigma[0]), atol=1e-15)
    dcm = tracks.Turning.of_dcm(np.zeros(1), mrp_to_dcm(sigma)).q[0]
    np.testing.assert_allclose(dcm * np.sign(dcm[3]), [x, y, z, w], atol=1e-15)


def test_a_signal_that_is_shown_as_a_number_is_exact_where_it_is_small_and_keeps_its_ages():
    t = np.arange(0, 600.0)
    decay = tracks.Signal(t, 94 * np.exp(-t / 60)[:, None], read=True)
    decay.written = np.where((t > 200) & (t < 400), 200.0, np.nan)
    thin = decay.thinned()
    assert np.abs(thin.at(t) / decay.values - 1).max() < 2e-4
    assert thin.age(t).tolist() == decay.age(t).tolist() == np.where((t > 200) & (t < 400), t - 200, 0).tolist()


def test_of_outputs_with_the_same_meaning_the_end_of_each_chain_is_preferred_in_the_order_of_flight():
    """As the CubeSat's: references between which flight chooses, that a module keeps out of the Sun and another slews
    to; two orbits, the second of which propagates the first."""
    facts = scene.Facts("", "", {}, {}, {
        "f.keep.target": "f.down.reference (newest), f.up.reference (newest)", "f.slew.target": "f.keep.way",
        "f.error.reference": "f.slew.reference", "f.ahead.base": "f.gps.orbit",
        "f.passes.orbit": "f.gps.orbit (best), f.ahead.orbit (best), f.elements.orbit (best)"}, None)
    assert facts.preferred(["f.down.reference", "f.up.reference", "f.keep.way", "f.slew.reference",
                            "f.hill.reference"]) == ["f.slew.reference", "f.hill.reference"]
    assert facts.preferred(["f.down.reference", "f.up.reference"]) == ["f.down.reference", "f.up.reference"]
    assert facts.preferred(["f.elements.orbit", "f.ahead.orbit", "f.gps.orbit"]) == [
        "f.gps.orbit", "f.ahead.orbit", "f.elements.orbit"]


def test_steps_stay_steps_and_noise_keeps_its_extremes():
    t = np.arange(0, 1000.0)
    step = tracks.Signal(t, (t > 333)[:, None] * 2.0).thinned()
    assert len(step.time) < 30 and (step.at(t)[:, 0] == (t > 333) * 2.0).all()
    noise = np.random.default_rng(1).normal(size=(100_000, 1))
    thin = tracks.Signal(np.arange(100_000.0), noise).thinned()
    assert len(thin.time) <= tracks.POINTS + 2
    assert thin.values.max() == noise.max() and thin.values.min() == noise.min()
    assert len(tracks.Signal(t[:3], np.full((3, 1), np.nan)).thinned().time) == 0


# --- from a record ---------------------------------------------------------------------------------

def craft_of(sim, **parameters):
    """A small spacecraft in the simulation's world, without flight."""
    w = sim.world
    w.wheels = world.ReactionWheels(axes_B=[[0, 0, 1]], J=0.1 * kg * m**2, Omega=[50] * rad / s)
    w.rcs = world.Thrusters(r_TB_B=[[0, 0, -0.5]] * m, axes_B=[[0, 0, 1]], F=2)
    edges = np.array([1.0, 1.5, 2.0])
    inertia = 120 / 12 * np.diag((edges**2).sum() - edges**2)
    w.craft = world.Spacecraft(mass=120 * kg, I_B=inertia * kg * m**2, parts=[w.wheels, w.rcs], gravity=[EARTH],
                               orbit=fledge.Orbit(EARTH, altitude=500 * km, i=50 * deg),
                               omega_BN_B=[0.01, 0.02, -0.005] * rad / s, **parameters)
    w.nav = world.Navigation(attitude_bias=[1e-3, 0, 0] * rad)
    w.tracker = world.StarTracker(boresight_B=[0, 2, 0], sun_exclusion=0.5 * rad, s_N=[0, 0, 1])
    w.connect(w.craft.state >> [w.nav.truth, w.tracker.truth])
    w.task("dynamics", every=0.1 * s, run=[w.craft, w.nav, w.tracker])
    return w


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """The file of a run of 20 minutes in a low orbit, with a truth and an estimate."""
    sim = fledge.Simulation("test_craft")
    w = craft_of(sim)
    sim.record(w.craft.state, w.wheels.speeds, w.rcs.output, w.nav.attitude, every=1 * s)
    path = tmp_path_factory.mktemp("scene") / "run.mcap"
    sim.archive(path, mission="test_craft")
    sim.run(20 * minute)
    sim.close_archive()
    return path


def test_the_parts_are_those_of_the_parameters(record):
    found = scene.of(record)
    craft = found.craft("world")
    parts = {part.name: part for part in craft.parts}
    # A uniform box with this mass and inertia has these edges; the thruster stands at half of its last one.
    np.testing.assert_allclose(np.array(parts["hub"].size) * 2, [1.0, 1.5, 2.0])
    assert parts["wheels 1"].axis_B == [0, 0, 1] and parts["wheels 1"].full == pytest.approx(50, rel=1e-4)
    assert parts["rcs 1"].at_B == [0, 0, -0.5] and parts["rcs 1"].full == 2
    assert parts["tracker"].axis_B == [0, 1, 0] and not parts["tracker"].keep_out
    assert parts["tracker, Sun"].half_angle == 0.5 and parts["tracker, Sun"].keep_out == "Sun"
    assert [planet.name for planet in found.planets] == ["EARTH"] and found.planets[0].radius == pytest.approx(
        EARTH.radius, rel=1e-5)
    assert found.sun_N.tolist() == [0, 0, 1] and found.sun is None
    assert [(pose.kind, pose.name) for pose in craft.poses] == [("estimate", "world.nav.attitude")]
    # The estimate is off by its bias, at each time.
    for t in (0.0, 600.0, 1200.0):
        here = np.array([t])
        assert 2 * np.arccos(np.abs((craft.turning.at(here) * craft.poses[0].turning.at(here)).sum())) == pytest.approx(
            1e-3, rel=1e-3)


def unpacked(html):
    """(text, arrays) of the data of a page, in the format of page.py."""
    data = base64.b64decode(re.search(r'id="fledge-data">([^<]+)<', html)[1])
    plain = zlib.decompress(data, -15)
    length = int.from_bytes(plain[:4], "little")
    text, start = json.loads(plain[4:4 + length]), -(-(4 + length) // 8) * 8

    def array(of):
        size = of["n"] * of["k"] * int(of["as"][1])
        return np.frombuffer(plain[start + of["at"]:start + of["at"] + size], f"<{of['as']}").reshape(of["n"], of["k"])

    return text, array


def cubic(a, b, va, vb, h, x):
    """The point at the share x of the way, by the control points of the same cubic."""
    points = [a, a + va * h / 3, b - vb * h / 3, b]
    while len(points) > 1:
        points = [(1 - x) * p + x * q for p, q in zip(points, points[1:])]
    return points[0]


@pytest.fixture
def viewer(monkeypatch, tmp_path):
    """A viewer that shows nothing, for tests of the page around it."""
    monkeypatch.setattr(bundle, "folder", lambda: tmp_path)
    (tmp_path / "view.js").write_text("// </script>")
    (tmp_path / "view.css").write_text("")
    return tmp_path


def test_the_data_in_the_page_are_those_of_the_record_within_the_bounds(record, viewer):
    path = scene.view(record, viewer / "view.html")
    html = path.read_text()
    assert html.count("</script>") == 2, "no text in the script ends it"
    text, array = unpacked(html)
    craft = text["crafts"][0]
    with fledge.Archive(record) as archive:
        t, r, sigma = archive.time("craft.state"), archive["craft.state.r_BN_N"], archive["craft.state.sigma_BN"]
        speed, t_speed = archive["speeds.Omega[0]"], archive.time("speeds")
    time, place, v = (array(craft["motion"][name]) for name in ("time", "r", "v"))
    assert len(time) < len(t) / 4 and set(time[:, 0]) <= set(t)
    for at in range(0, len(t), 7):
        i = min(np.searchsorted(time[:, 0], t[at], side="right"), len(time) - 1)
        h = time[i, 0] - time[i - 1, 0]
        shown = cubic(place[i - 1], place[i], v[i - 1], v[i], h, (t[at] - time[i - 1, 0]) / h)
        assert np.linalg.norm(shown - r[at]) <= text["bounds"]["position"]
    q, times = array(craft["turning"]["q"]).astype(float), array(craft["turning"]["time"])[:, 0]
    exact = tracks.Turning.of_mrp(t, sigma)
    assert np.abs(np.abs((q * exact.q[np.searchsorted(t, times)]).sum(axis=1)) - 1).max() < 1e-6
    shown = tracks.Turning(times, q).at(t)
    off = np.linalg.norm(shown * np.sign((shown * exact.q).sum(axis=1))[:, None] - exact.q, axis=1)
    assert 2 * off.max() <= text["bounds"]["attitude"] + 1e-6       # in single precision
    [plot] = [plot for plot in text["plots"] if plot["name"] == "world.wheels.speeds.Omega"]
    assert plot["unit"] == "rad/s" and plot["labels"] == ["[0]"]
    level = np.interp(t_speed, array(plot["signal"]["time"])[:, 0], array(plot["signal"]["values"])[:, 0])
    assert np.abs(level - speed).max() <= text["bounds"]["share"] * np.ptp(speed) + 1e-6 * np.abs(speed).max()


def test_a_log_in_memory_has_the_scene_of_its_file(record):
    sim = fledge.Simulation("test_craft")
    w = craft_of(sim)
    log = sim.record(w.craft.state, w.wheels.speeds, w.rcs.output, w.nav.attitude, every=1 * s)
    sim.run(20 * minute)
    for source in (log, sim):
        assert page.pack(scene.of(source)) == page.pack(scene.of(record))


def test_a_drive_turns_the_panels_that_have_an_axis():
    sim = fledge.Simulation("test_arrays")
    w = craft_of(sim)
    w.drive = world.ArrayDrive(n=2, step=0.01 * rad, rate=10 / s, count=0.01 * rad)
    w.light = world.Sunlight(sun=world.SUN.at([1.5e11, 0, 0] * m))
    w.array = world.SolarArray(normals_B=[[0, 0, 1]] * 2, axes_B=[[0, 0, 0], [0, -1, 0]], areas=[1, 4] * m**2,
                               efficiency=0.3)
    w.connect(w.craft.state >> [w.light.truth, w.array.truth], w.light.light >> w.array.light,
              w.drive.angles >> w.array.angles)
    w.task("arrays", every=1 * s, run=[w.drive, w.light, w.array])
    log = sim.record(w.craft.state, w.drive.angles, every=1 * s)
    sim.run(10 * s)
    parts = {part.name: part for part in scene.of(log).craft("world").parts}
    assert parts["array"].hinge_B is None and parts["array"].size == [1, 1]
    turned = parts["array 2"]
    assert turned.hinge_axis_B == [0, -1, 0] and turned.hinge_B == turned.at_B and abs(turned.at_B[1]) > 1
    assert turned.level.values.shape == (len(turned.level.time), 1)


def test_a_sky_gives_the_place_of_the_sun_and_the_turning_of_the_earth():
    sim = fledge.load("earth_imager")
    w = sim.world
    log = sim.record(w.craft.state, every=10 * s)
    sim.run(20 * minute)
    found = scene.of(log)
    sky = w.craft.sky
    assert found.epoch == "2026-03-20T10:00:00"
    t = 777.0
    exact = np.array(sky.state(world.SUN, t).r_PN_N)
    assert np.linalg.norm(found.sun.at(np.array([t]))[0] - exact) < 1      # [m] of 150 million km
    earth = next(planet for planet in found.planets if planet.name == "EARTH")
    x, y, z, scalar = earth.turning.at(np.array([t]))[0]
    v, pole = np.array([x, y, z]), np.array([0, 0, 1.0])
    turned = pole + 2 * np.cross(v, np.cross(v, pole) + scalar * pole)
    assert np.abs(turned - sky.orientation(EARTH, t).dcm_PN[2]).max() < 1e-8
    assert {part.name for part in found.craft().parts if part.kind == "cone"} == {
        "camera", "star tracker", "star tracker, Sun"}, "of the mission's view.py"


def test_each_flight_computer_belongs_to_the_spacecraft_that_it_commands():
    sim = fledge.load("formation")
    ports = [sim.process(name).craft.state for name in ("chief_world", "deputy_world")]
    log = sim.record(*ports, sim.process("deputy").scan.reference, sim.process("chief").base.reference, every=1 * s)
    sim.run(20 * s)
    found = scene.of(log)
    assert [[pose.name for pose in craft.poses] for craft in found.crafts] == [
        ["chief.base.reference"], ["deputy.scan.reference"]]
    with pytest.raises(SetupError, match="which spacecraft; there are chief_world, deputy_world"):
        found.craft()


def test_the_error_of_a_record_without_an_attitude_names_the_ports_to_record(tmp_path, viewer):
    sim = fledge.Simulation("test_craft")
    w = craft_of(sim)
    sim.record(w.wheels.speeds, every=1 * s)
    sim.archive(tmp_path / "run.mcap")
    sim.run(2 * s)
    sim.close_archive()
    with pytest.raises(SetupError, match=r"run\.mcap: no attitude is recorded.*; record world\.craft\.state"):
        scene.view(tmp_path / "run.mcap")
    assert not (tmp_path / "view.html").exists()


def test_navigation_replaces_a_truth_that_was_not_recorded():
    sim = fledge.Simulation("test_craft")
    w = craft_of(sim)
    log = sim.record(w.nav.attitude, every=1 * s)
    sim.run(5 * s)
    found = scene.of(log)
    assert found.craft().motion.r.tolist() == [[0, 0, 0]] and "Record its NavOrbit" in found.notes[0]
    log = sim.record(w.nav.attitude, w.nav.orbit, every=1 * s)
    sim.run(5 * s)
    assert np.linalg.norm(scene.of(log).craft().motion.r[-1]) == pytest.approx(EARTH.radius + 500e3, rel=1e-3)


@pytest.mark.parametrize("line, why", [
    ("craft.cone('camera', [0, 0, 0], half_angle=0.1)", "cone camera: boresight_B: expected a direction"),
    ("craft.cone('camera', [1, 0, 0], half_angle=2.0)", r"half_angle must be in \(0, pi/2\) rad; found 2 rad"),
    ("craft.box([1, 1, -1])", "box: size: expected lengths > 0 m"),
    ("craft.panel([0, 1, 0], [1], [1, 0, 0])", "panel: size: expected 2 numbers in m"),
    ("craft.mesh('craft.glb')", r"craft\.glb: No such file"),
    ("craft.mesh('view.py')", r"expected a \.glb or \.obj file"),
    ("view.craft('deputy')", "there is no spacecraft 'deputy'; there are world"),
])
def test_errors_in_a_missions_view_have_their_line(tmp_path, line, why):
    mission = tmp_path / "missions" / "seen"
    mission.mkdir(parents=True)
    (mission / "flight.py").write_text("def build(f):\n    pass\n")
    (mission / "view.py").write_text(f"def build(view):\n    craft = view.craft()\n    {line}\n")
    sim = fledge.load(mission)
    craft_of(sim)
    log = sim.record(sim.world.craft.state, every=1 * s)
    sim.run(2 * s)
    with pytest.raises(fledge.MissionError, match=rf"view\.py, line 3: .*{why}"):
        scene.of(log)


def test_without_node_or_a_folder_for_it_the_error_has_the_reason(record, monkeypatch, tmp_path):
    monkeypatch.setattr(bundle, "folder", lambda: tmp_path)
    with pytest.raises(SetupError, match="need Node when Fledge is built: ./fledge setup --view"):
        scene.view(record, tmp_path / "view.html")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(SetupError, match="need Node"):
        bundle.build()
    (tmp_path / "file").touch()
    monkeypatch.setattr(bundle, "folder", lambda: tmp_path / "file/view")      # where none can be made
    monkeypatch.setattr(shutil, "which", lambda name: name)
    with pytest.raises(SetupError, match="the 3-D view must be built, and this user may not write into .*/file/view;"):
        bundle.build()


# --- tracks that grow, and places on the ground, in the viewer's own code ---------------------------

@needs_node
def test_the_axis_of_a_constant_has_it_in_the_middle_and_marks_of_time_are_round():
    axes, steps = in_node("""
        import {TIME_STEPS, aroundConstant} from "SOURCES/axis.js";
        console.log(JSON.stringify([[[0, 0], [5, 5], [-2e-9, -2e-9], [0, 1], [null, null]].map(
            ([low, high]) => aroundConstant(low, high)), TIME_STEPS]));
    """)
    assert axes == [[-1, 1], [4.5, 5.5], [pytest.approx(-2.2e-9), pytest.approx(-1.8e-9)], None, None]
    assert steps == sorted(set(steps)) and steps[0] == 1e-3 and steps[-1] > 1e10
    assert all(60 % step == 0 for step in steps if 1 <= step < 60)
    assert all(3600 % step == 0 and step % 60 == 0 for step in steps if 60 <= step < 3600)
    assert all(86400 % step == 0 for step in steps if 3600 <= step < 86400)


@needs_node
def test_a_track_grows_within_a_bound_and_stays_where_it_was():
    """A day of a circle at 4 Hz: its first minute and its last are still on the circle."""
    found = in_node("""
        import {append, known, level, position} from "SOURCES/data.js";
        const empty = (k, kind = Float64Array) => ({data: new kind(0), n: 0, k});
        const motion = {time: empty(1), r: empty(3), v: empty(3)};
        const signal = {time: empty(1), values: empty(1, Float32Array)};
        const rate = 1e-3, size = 7e6, exact = (t) => [size * Math.cos(rate * t), size * Math.sin(rate * t), 0];
        const grown = [], far = [];
        const away = (t) => Math.hypot(...position(motion, t).map((x, k) => x - exact(t)[k]));
        for (let hour = 0; hour < 24; hour++) {
            for (let i = 0; i < 14400; i++) {
                const t = 3600 * hour + i / 4, [x, y] = exact(t);
                append(motion, [t, t], [x, y, 0, -rate * y, rate * x, 0, 0, 0, 0, 0, 0, 0]);    // the second: too late
                append(signal, [t], [i < 7200 ? null : t]);
            }
            gc();
            grown.push([motion.time.n, motion.time.data.length, motion.r.data.length, process.memoryUsage().heapUsed +
                        process.memoryUsage().arrayBuffers]);
            far.push(away(30.1), away(1800.1 * hour), away(3600 * hour + 3599.7));
        }
        const gaps = [];
        for (let i = 1; i < motion.time.n; i++) gaps.push(motion.time.data[i] - motion.time.data[i - 1]);
        console.log(JSON.stringify({grown, far: Math.max(...far), widest: Math.max(...gaps), last: gaps.at(-1),
            level: [level(signal, 86000.1), known(signal, 85000), known(signal, 82900)],
            held: position(motion, 1e6)[0] - exact(86399.75)[0]}));
    """)
    assert max(rows for rows, *_ in found["grown"]) <= 8192 and {tuple(row[1:3]) for row in found["grown"][1:]} == {
        (8192, 3 * 8192)}
    heap = [row[3] for row in found["grown"][2:]]
    assert max(heap) - min(heap) < 2e6
    # Of cubics between points h apart the error is a h^4 w^2 / 384; a gap may be three times the even spacing, 21 s.
    assert found["widest"] < 64 and found["last"] == 0.25
    assert found["far"] < 7e6 * (64 * 1e-3)**4 / 384
    assert found["level"] == [pytest.approx(86000.1, abs=0.01), True, False] and found["held"] == 0


# --- in a browser ----------------------------------------------------------------------------------

needs_browser = opens()


@pytest.fixture(scope="module")
def browser():
    with Browser(480, 360, wait=PATIENCE) as opened:
        yield opened


def labels(browser):
    """Name -> (x, y) [px] of the names in the picture."""
    return {name: (float(x), float(y)) for name, x, y in browser.evaluate(
        "[...document.querySelectorAll('.label:not([hidden])')].map(({dataset, style}) => "
        "[dataset.name, ...style.transform.match(/-?[\\d.]+/g)])")}


def projected(place, eye, up, width, height, fov=40 * np.pi / 180):
    """Where a place is on the screen [px] of a camera that looks at the origin."""
    back = eye / np.linalg.norm(eye)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    above, d = np.cross(back, right), place - eye
    scale = height / 2 / np.tan(fov / 2) / -(d @ back)
    return width / 2 + scale * (d @ right), height / 2 - scale * (d @ above)


@pytest.fixture(scope="module")
def passing(tmp_path_factory):
    """The Earth imager over its station, in a run of 30 minutes, the simulation, its log, and their page."""
    sim = fledge.load("earth_imager")
    w = sim.world
    log = sim.record(w.craft.state, w.station.contact, w.radio.down, every=1 * s)
    sim.run(30 * minute)
    shown = scene.of(log)
    return shown, sim, log, page.write(shown, tmp_path_factory.mktemp("passing") / "view.html")


@needs_browser
def test_the_page_shows_the_spacecraft_where_it_was(browser, passing):
    shown, _, log, path = passing
    azimuth, elevation, distance = 0.4, 0.6, 3e7
    browser.open(path, f"#map=1&camera=orbit&around={azimuth},{elevation},{distance}&t=300")
    width, height = browser.evaluate("[document.querySelector('.picture').clientWidth, "
                                     "document.querySelector('.picture').clientHeight]")
    away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    r = log["craft.state.r_BN_N"][300]
    place = labels(browser)["earth_imager"]
    assert np.allclose(place, projected(r, distance * away, [0, 0, 1], width, height), atol=0.1)
    altitude = browser.evaluate("document.querySelector('.readout dd').textContent")
    assert float(altitude.split()[0]) == pytest.approx((np.linalg.norm(r) - EARTH.radius) / 1e3, abs=0.01)

    # In the frame of the body its axes stay where they are, whatever the time.
    extent = browser.evaluate("fledgeView.data.crafts[0].extent")
    browser.evaluate(f"""(() => {{
        fledgeView.choose("body");
        Object.assign(fledgeView.stage.view, {{azimuth: {azimuth}, elevation: {elevation}, distance: {9 * extent}}});
    }})()""")
    eye = 9 * extent * away
    for t in (0, 901):
        browser.evaluate(f"fledgeView.seek({t})")
        browser.wait_for("!fledgeView.dirty")
        names = labels(browser)
        for k, name in enumerate(("b1", "b2", "b3")):
            assert np.allclose(names[name], projected(2 * extent * np.eye(3)[k], eye, [0, 0, 1], width, height),
                               atol=0.1)
    # The direction to the Sun turns with the body.
    sun = shown.sun.at(np.array([901.0]))[0] - log["craft.state.r_BN_N"][901]
    sun = 2.5 * extent * mrp_to_dcm(log["craft.state.sigma_BN"][901]) @ sun / np.linalg.norm(sun)
    assert np.allclose(names["Sun"], projected(sun, eye, [0, 0, 1], width, height), atol=0.2)
    assert browser.problems == []


@pytest.mark.long("a page in a browser")
@needs_browser
@pytest.mark.parametrize("theme", ["dark", "light"])
def test_names_stand_out_from_their_edge_whatever_is_behind_them(browser, record, tmp_path, theme):
    browser.open(scene.view(record, tmp_path / "view.html"), f"#theme={theme}&t=300")
    colours = browser.evaluate("""(() => {
        const brush = document.createElement("canvas").getContext("2d", {willReadFrequently: true});
        const channels = (colour) => {
            brush.fillStyle = colour;
            brush.fillRect(0, 0, 1, 1);
            return [...brush.getImageData(0, 0, 1, 1).data].slice(0, 3);
        };
        return [...document.querySelectorAll(".label")].map((label) => {
            const {color, textShadow} = getComputedStyle(label);
            return [label.dataset.name, channels(color), channels(/^(rgb|color)[^)]*\\)/.exec(textShadow)[0])];
        });
    })()""")

    def luminance(channels):        # of WCAG 2
        c = np.array(channels) / 255
        return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055)**2.4) @ [0.2126, 0.7152, 0.0722]

    assert {"b1", "b2", "b3", "Sun"} <= {name for name, *_ in colours}
    for name, *both in colours:
        dark, bright = sorted(map(luminance, both))
        assert (bright + 0.05) / (dark + 0.05) > 4.5, name


@pytest.mark.long("a page in a browser")
@needs_browser
def test_the_page_plays_saves_and_draws_its_plots(browser, record, tmp_path):
    mesh = tmp_path / "craft.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    shown = scene.of(record)
    shown.craft().mesh(mesh)
    shown.craft().panel([0, 1, 0] * m, [1, 0.5] * m, [1, 0, 0])
    path = page.write(shown, tmp_path / "view.html")
    browser.open(path, "#plots=1&theme=light&show=inside,hill,inertial,reference&camera=hill")
    assert browser.evaluate("document.querySelectorAll('.charts canvas').length") == 3
    browser.evaluate("fledgeView.download = (blob, ending) => { (window.saved ??= {})[ending] = blob.size; }")
    browser.evaluate("fledgeView.savePicture()")
    assert browser.wait_for("window.saved?.png") > 1000
    browser.evaluate("fledgeView.film()")
    browser.wait_for("fledgeView.t > 1 && fledgeView.parts.length")
    browser.evaluate("fledgeView.film()")
    assert browser.wait_for("window.saved.webm") > 1000
    for camera in ("follow", "body", "orbit", "sun", "boresight"):
        browser.evaluate(f"fledgeView.choose('{camera}')")
        browser.wait_for("!fledgeView.dirty || fledgeView.playing")
        assert browser.evaluate("fledgeView.stage.preset") == camera
    assert browser.problems == []


@pytest.mark.long("pictures of a browser")
@needs_browser
def test_from_afar_it_is_enlarged_if_the_user_chooses_so(browser, record, tmp_path):
    path = page.write(scene.of(record), tmp_path / "view.html")
    browser.open(path, "#camera=orbit&around=0.6,0.75,3e7&t=300")
    assert "b1" not in labels(browser)
    browser.evaluate("fledgeView.toggle('enlarged', true)")
    for distance in (3e7, 1e8):
        browser.evaluate(f"fledgeView.stage.view.distance = {distance}; fledgeView.dirty = true")
        browser.wait_for("!fledgeView.dirty")
        shown = labels(browser)
        apart = [np.hypot(*np.subtract(shown[name], shown["test_craft"])) for name in ("b1", "b2", "b3")]
        assert 30 < max(apart) < 110, apart     # [px], at any distance
    browser.open(path, "#camera=body&show=enlarged")
    assert browser.evaluate("fledgeView.stage.crafts[0].body.scale.x") == 1, "near enough"
    assert browser.problems == []


@pytest.mark.long("films in a browser")
@needs_browser
def test_a_film_shows_the_given_span(record, tmp_path, capsys):
    image = module("PIL.Image")
    path, look = tmp_path / "film.webp", "camera=orbit&show=enlarged"
    arguments = ["view", str(record), "--film", str(path), "--look", look]
    assert cli.main([*arguments, "--from", "1min", "--to", "10min", "--frames", "4"]) == 0
    with image.open(path) as shown:
        assert (shown.n_frames, shown.size) == (4, (film.WIDTH, film.HEIGHT))
        frames = []
        for k in range(4):
            shown.seek(k)
            frames.append(np.asarray(shown.convert("RGB"), float))
    assert all(np.abs(a - b).max() > 100 for a, b in zip(frames, frames[1:])), "nothing moves"
    assert all(np.abs(a - b).mean() < 20 for a, b in zip(frames, frames[1:])), "the camera stays"
    assert [file.name for file in tmp_path.iterdir()] == ["film.webp"]
    for wrong in (["--from", "10min", "--to", "1min"], ["--to", "9h"], ["--frames", "1"]):
        assert cli.main([*arguments, *wrong]) == 2
        assert "a film has two frames or more" in capsys.readouterr().err
    path = tmp_path / "picture.png"
    arguments = ["view", str(record), "--picture", str(path), "--look", look]
    assert cli.main([*arguments, "--at", "1min"]) == 0
    with image.open(path) as shown:
        assert shown.size == (480, 270) and np.asarray(shown.convert("L"), float).std() > 5, "something is there"
    assert cli.main([*arguments, "--at", "9h"]) == 2
    assert "a picture is of a time from" in capsys.readouterr().err


def ground_below(sim, t, r):
    """Geodetic latitude and longitude by ERFA, on WGS 84, for the Earth as the simulation's sky turns it; and the
    longitude with the Earth turned by ERFA itself."""
    erfa = module("erfa")
    lon, lat, _ = erfa.gc2gd(1, sim.world.craft.sky.orientation(EARTH, t * s).dcm_PN @ r)
    days = 2461119.5 + 10 / 24 + t / 86400      # 2026-03-20T10:00:00, as UTC, UT1 and TT: 69 s are 2e-8 rad to the pole
    turned = erfa.c2t06a(days, 0, days, 0, 0, 0) @ r
    return lat, lon, np.arctan2(turned[1], turned[0])


def path_of(log):
    return tracks.Motion(log.time, log["craft.state.r_BN_N"], log["craft.state.v_BN_N"])


def apart(a, b):
    """[rad] between two longitudes."""
    return abs((a - b + np.pi) % (2 * np.pi) - np.pi)


@pytest.mark.long("loads another library")
@needs_browser
def test_the_ground_track_is_that_of_another_library(browser, passing):
    _, sim, log, path = passing
    browser.open(path, "#map=1&t=900")
    assert browser.evaluate("fledgeView.mapCanvas.dataset.planet") == "EARTH"
    path = path_of(log)
    points = browser.evaluate("fledgeView.map.track(fledgeView.data.crafts[0], fledgeView.data.planets"
                              ".find(({name}) => name === 'EARTH'), 900)")
    inside = [point for point in points if point["t"] <= 1800]
    assert len(inside) > 50 and inside[0]["t"] < 40
    for point in inside:
        lat, lon, coarse = ground_below(sim, point["t"], path.at(np.array([point["t"]]))[0])
        assert point["latitude"] == pytest.approx(lat, abs=3e-5)
        assert apart(point["longitude"], lon) * np.cos(lat) < 3e-5
        assert apart(point["longitude"], coarse) < np.deg2rad(0.3)
    # Beyond the record the track follows a Kepler orbit, and the Earth turns on.
    sim.run(20 * minute)
    for point in [point for point in points if 1800 < point["t"] < 3000]:
        lat, lon, _ = ground_below(sim, point["t"], path_of(log).at(np.array([point["t"]]))[0])
        assert point["latitude"] == pytest.approx(lat, abs=0.01)
        assert apart(point["longitude"], lon) * np.cos(lat) < 0.01
    words = browser.evaluate("fledgeView.mapWords.textContent").split()
    lat, lon, _ = ground_below(sim, 900, path.at(np.array([900.0]))[0])
    assert float(words[0].rstrip("\u00b0")) == pytest.approx(abs(np.rad2deg(lat)), abs=0.006)
    assert words[1] == ("N," if lat > 0 else "S,") and words[3] == ("E," if lon > 0 else "W,")
    painted = browser.evaluate("new Set(fledgeView.mapCanvas.getContext('2d').getImageData(0, 0, 150, 70).data).size")
    assert painted > 30, "coasts, night and tracks"
    assert browser.problems == []


@needs_browser
def test_passes_and_radio_are_those_of_the_record(browser, passing):
    _, _, log, path = passing
    if browser.evaluate("location.pathname") == str(path):      # a page takes seconds to draw its first picture
        browser.evaluate("fledgeView.choose('orbit')")
    else:
        browser.open(path, "#map=1&camera=orbit")
    visible = log.time[log["contact.visible"] == 1]
    [[seen]] = browser.evaluate("fledgeView.passes.map(({passes}) => passes)")
    assert seen["rise"] == pytest.approx(visible[0], abs=1.1) and seen["set"] == pytest.approx(visible[-1], abs=1.1)
    assert seen["peak"] == pytest.approx(log["contact.elevation"].max(), abs=1e-3)
    for t in (600, int(visible[0]) + 60, int(visible[-1]) - 30, 1790):
        browser.evaluate(f"fledgeView.seek({t})")
        browser.wait_for("!fledgeView.dirty")
        rows = browser.evaluate("Object.fromEntries([...document.querySelectorAll('.readout dt')].map((term) => "
                                "[term.textContent, term.nextSibling.textContent]))")
        line = browser.evaluate("fledgeView.stage.stations.map(({locked, seen}) => [locked.visible, seen.visible])[0]")
        if log["contact.visible"][t]:
            elevation, far = rows["station"].split("\u00b0, ")
            assert float(elevation) == pytest.approx(np.rad2deg(log["contact.elevation"][t]), abs=0.06)
            assert float(far.split()[0]) == pytest.approx(log["contact.range"][t] / 1e3, abs=0.6)
        else:
            assert rows["station"] == "not in view"
        locked = bool(log["down.lock"][t])
        assert rows["radio"].startswith("down locked, " if locked else "down not locked")
        assert line == [locked, bool(log["contact.visible"][t]) and not locked]
        assert labels(browser).keys() >= {"station"} or not locked
    assert browser.problems == []


@pytest.mark.long("a page that follows a flight")
@needs_browser
def test_it_goes_on_while_the_user_goes_back_in_time_and_returns(browser, tmp_path):
    from fledge.ground.server.scene import Feed

    sim = fledge.load("earth_imager")
    feed, number = Feed("imager", sim), 0

    def fly(samples):
        """The messages to browsers of some samples."""
        nonlocal number
        messages = []
        for _ in range(samples):
            sim.run(2 * s)
            feed._next = 0
            feed.sample()
            number, news = feed.since(number)
            messages += news
        return json.dumps(messages)

    fly(5)
    feed.pack()
    browser.open(page.write(feed.scene(), tmp_path / "view.html"))
    browser.evaluate("""(() => {
        const {root, data, constructor} = fledgeView;
        window.times = [];
        fledgeView.destroy();
        history.replaceState(null, "", "#");
        window.fledgeView = new constructor(root, data, {live: true, moved: (t) => times.push(t)});
    })()""")
    assert browser.evaluate("[fledgeView.following, fledgeView.data.end]") == [True, 10]
    browser.evaluate(f"{fly(20)}.forEach((message) => fledgeView.extend(message))")
    assert browser.evaluate("fledgeView.data.end") == 50
    assert browser.wait_for("fledgeView.t > 49.9 && fledgeView.t <= 50")
    assert "Live" in browser.evaluate("fledgeView.nowButton.textContent")
    assert "t=" not in browser.evaluate("location.hash")

    # Back in time the picture stays while samples arrive; the link holds time and camera.
    browser.evaluate("fledgeView.slider.value = 0.5; fledgeView.slider.oninput(); fledgeView.choose('orbit')")
    t = browser.evaluate("fledgeView.t")
    assert t == pytest.approx(26, abs=0.1) and browser.evaluate("times") == [None, t]
    browser.evaluate(f"{fly(20)}.forEach((message) => fledgeView.extend(message))")
    assert browser.evaluate("[fledgeView.t, fledgeView.data.end, fledgeView.following]") == [t, 90, False]
    browser.wait_for("location.hash.includes('camera=orbit') && location.hash.includes('t=' + fledgeView.t)")
    browser.wait_for("!fledgeView.dirty")
    here = browser.evaluate("fledgeView.stage.crafts[0].place")
    browser.evaluate("fledgeView.savePicture = fledgeView.savePicture.bind(fledgeView)")
    browser.evaluate("fledgeView.download = (blob, ending) => { (window.saved ??= {})[ending] = blob; }")
    browser.evaluate("fledgeView.savePicture()")
    assert browser.wait_for("window.saved?.png?.type") == "image/png"
    assert browser.evaluate("createImageBitmap(saved.png).then(({width}) => width)") == 960
    browser.evaluate("fledgeView.nowButton.click()")
    browser.wait_for("fledgeView.t === 90 && !fledgeView.dirty")
    now = browser.evaluate("fledgeView.stage.crafts[0].place")
    assert np.linalg.norm(np.array(now) - np.array(here)) == pytest.approx(64 * 7.56e3, rel=0.01)
    assert np.linalg.norm(np.array(now) - sim.world.craft.state.r_BN_N) < 1
    browser.evaluate("fledgeView.film()")
    browser.evaluate("(async () => { for (const message of " + fly(10) + """) {
        fledgeView.extend(message);
        await new Promise((next) => setTimeout(next, 80));
    } })()""")
    browser.wait_for("fledgeView.parts.length > 0")
    browser.evaluate("fledgeView.film()")
    assert browser.wait_for("window.saved.webm?.size") > 1000

    # An hour at 4 Hz: the tracks keep within their bound, and so does the memory.
    browser.evaluate("""(() => {
        const last = """ + fly(1).strip("[]") + """, tracks = Object.entries(last.tracks);
        for (let k = 1; k <= 14400; k++) {
            const end = last.end + k / 4;
            fledgeView.extend({end, tracks: Object.fromEntries(tracks.map(([id, [, row]]) => [id, [[end], row]]))});
        }
    })()""")
    sizes = browser.evaluate("[...fledgeView.tracks.values()].map(({time}) => [time.n, time.data.length])")
    assert max(n for n, _ in sizes) <= 8192 and max(room for _, room in sizes) <= 8192
    assert browser.evaluate("fledgeView.data.end") == pytest.approx(sim.time + 3600)
    browser.evaluate("fledgeView.destroy()")
    assert browser.evaluate("fledgeView.root.childElementCount") == 0
    assert browser.problems == []
