# SPDX-License-Identifier: Apache-2.0
"""What browsers get of a spacecraft that flies, against what the simulation recorded of itself."""

import asyncio
import json
from contextlib import contextmanager
from queue import Queue
from threading import Thread
from types import SimpleNamespace

import numpy as np
import pytest

import fledge
from fledge import SetupError, objects
from fledge.ground.server import scene
from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.ground.server.web import serve
from fledge.records.series import part
from fledge.scene import of as scene_of, page
from fledge.scene.browser import Browser
from fledge.scene.testing.node import in_node, needs_node, opens
from fledge.scene.tracks import Turning
from tests.waiting import PATIENCE


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Samples as often as the test takes them."""
    monkeypatch.setattr(scene, "PERIOD", 0.0)


def text_of(data):
    return json.loads(data[4:4 + int.from_bytes(data[:4], "little")])


class Telemetry:
    """A monitor that has some parameters by their names, as those of a database of a mission are called."""

    def __init__(self, values):
        self.values = values    # name -> (t [ns], value)

    def slots(self):
        return [{"name": name, "slot": i} for i, name in enumerate(self.values)]

    def newest(self, slot):
        value = list(self.values.values())[slot]
        return None if value is None else (value[0], 0, value[1], value[1], 0, 0, 1)


# --- live as recorded ------------------------------------------------------------------------------

SHOWN = ("CraftState", "WheelSpeeds", "ThrusterOutput", "RodCommand", "NavAttitude", "NavOrbit", "AttError",
         "AttReference", "RadioLink")


class Flown:
    """A mission that is flown once, with what browsers get of it by the server, and with a record.

    modes: at which time [s] the ground commands which one; begin: the first one
    data: the scene as it was after ten steps; messages: what came since; recorded: the scene of the record
    """

    def __init__(self, folder, mission, seconds, every, modes=(), begin=None):
        (folder / "room.toml").write_text(f'folder = "kept"\n[[craft]]\nname = "craft"\nmission = "{mission}"\n')
        room = Room(read(folder / "room.toml"))
        craft = room.crafts["craft"]
        sim = craft.simulation
        if begin:
            sim.flight.start_in(begin)
        log = sim.record(*[getattr(instance, field.name) for process in sim.processes for instance in process
                           for field in objects.struct(instance).fields
                           if field.group == "out" and field.type == "struct" and not field.shape
                           and field.struct.name in SHOWN], every=every)
        craft._open()
        self.messages, number, commands = [], 0, dict(modes)
        for k in range(1, int(seconds / every) + 1):
            t = k * every
            if t in commands:
                craft.commanding.release("server", "mode", {}, craft.connection.craft.packets("mode", commands[t]))
            while sim.time_ns < t * 1e9:
                if arrived := craft.connection.receive(round(t * 1e9)):
                    craft.take(craft.clock.timed(arrived, craft.connection.link.t))
            craft.commanding.uplink.poll()
            craft.feed.sample()
            number, news = craft.feed.since(number)
            self.messages += news
            if k == 10:
                self.data, self.begun, self.messages = craft.feed.pack(), craft.feed.scene(), []
                number, _ = craft.feed.since(0)
        room.close()
        self.recorded = scene_of(log)
        self.times = [every * round(t / every) for t in np.linspace(seconds / 10, seconds, 10)]


@needs_node
def test_the_live_view_has_the_numbers_and_ages_of_the_recorded_one(tmp_path):
    """Of a CubeSat whose laws for the Sun, the ground below and the tumble are of different modes: what the active mode
    writes, and its age where none does."""
    with np.errstate(divide="raise", invalid="raise"):
        flown = Flown(tmp_path, "cubesat", 80, 0.5, [(10, "brake"), (60, "sun")], "sun")
        (tmp_path / "live").write_bytes(flown.data)
        (tmp_path / "recorded").write_bytes(page.pack(flown.recorded))
    (tmp_path / "messages").write_text(json.dumps(flown.messages, allow_nan=False))
    live, recorded = in_node(f"""
        import {{readFileSync}} from "node:fs";
        import {{age, append, attitude, growing, known, level, unpack}} from "SOURCES/data.js";
        const read = (name) => unpack(new Uint8Array(readFileSync(`{tmp_path}/${{name}}`)).buffer);
        const live = read("live"), tracks = growing(live);
        for (const {{tracks: more}} of JSON.parse(readFileSync("{tmp_path}/messages")))
            for (const [id, [times, numbers]] of Object.entries(more)) append(tracks.get(Number(id)), times, numbers);
        console.log(JSON.stringify([live, read("recorded")].map(({{crafts: [craft]}}) => {json.dumps(flown.times)}.map(
            (t) => ({{
                error: [level(craft.signals["attitude error"], t), age(craft.signals["attitude error"], t)],
                rate: [0, 1, 2].map((k) => level(craft.signals.rate, t, k)),
                wheel: level(craft.parts.find((part) => part.kind === "wheel").level, t),
                poses: craft.poses.filter(({{turning}}) => known(turning, t)).map(({{name, turning}}) =>
                    [name, age(turning, t), turning.q.data.slice(4 * turning.last, 4 * turning.last + 4)])
            }})))));
    """)
    for there, here in zip(live, recorded):
        assert there["error"][1] == here["error"][1]
        for name in ("error", "rate", "wheel"):
            np.testing.assert_allclose(here[name], there[name], rtol=2e-4, atol=1e-8)
        assert [pose[:2] for pose in there["poses"]] == [pose[:2] for pose in here["poses"]]
    ages = [flown["error"][1] for flown in live]
    assert ages[0] == 0 and ages[-1] == 0 and any(age > 20 for age in ages), ages


@needs_node
def test_the_tracks_in_the_browser_are_the_flight(tmp_path):
    """What the viewer has from the scene and from all that came later is what was recorded, at each sample."""
    sim = fledge.load("earth_imager")
    w = sim.world
    log = sim.record(w.craft.state, w.wheels.speeds, w.radio.down, every=2)
    feed = scene.Feed("imager", sim)
    messages, number = [], 0
    for k in range(60):
        sim.run(2)
        feed.sample()
        if k == 20:
            (tmp_path / "scene").write_bytes(feed.pack())
            assert feed.since(0)[0] == 21, "with what the scene has already, which is left out"
        if k > 15:
            number, news = feed.since(number)
            messages += news
    (tmp_path / "messages").write_text(json.dumps(messages, allow_nan=False))
    tracks = in_node(f"""
        import {{readFileSync}} from "node:fs";
        import {{append, growing, level, position, unpack}} from "SOURCES/data.js";
        const data = unpack(new Uint8Array(readFileSync("{tmp_path}/scene")).buffer), tracks = growing(data);
        for (const {{tracks: more}} of JSON.parse(readFileSync("{tmp_path}/messages")))
            for (const [id, [times, numbers]] of Object.entries(more)) append(tracks.get(Number(id)), times, numbers);
        const [craft] = data.crafts, wheel = craft.parts.find((one) => one.kind === "wheel");
        const turning = Array.from({{length: craft.turning.time.n}},
            (_, k) => [craft.turning.time.data[k], ...craft.turning.q.data.slice(4 * k, 4 * k + 4)]);
        const times = Array.from({{length: 60}}, (_, k) => 2 * k + 2);
        console.log(JSON.stringify({{turning, place: times.map((t) => position(craft.motion, t)),
            speed: times.map((t) => level(wheel.level, t)), sun: times.map((t) => position(data.sun, t)),
            lock: times.map((t) => level(data.stations[0].links[0].down, t, 1)), end: data.end}}));
    """)
    t = log.time
    some = np.isin(t, np.arange(2, 121, 2))
    r, sigma = log["craft.state.r_BN_N"][some], log["craft.state.sigma_BN"]
    assert np.abs(np.array(tracks["place"]) - r).max() < page.POSITION
    turning = np.array(tracks["turning"])
    assert turning[-1, 0] == 120 and len(turning) > 41 and set(turning[:, 0]) <= set(t)
    exact = Turning.of_mrp(t, sigma).q[np.searchsorted(t, turning[:, 0])]
    assert np.abs(np.abs((turning[:, 1:] * exact).sum(axis=1)) - 1).max() < 1e-6
    # Of the samples that came one by one, each is there; those of the scene are within a share of their range.
    speed = log["wheels.speeds.Omega"][some, 0]
    np.testing.assert_allclose(tracks["speed"][21:], speed[21:], rtol=1e-6)
    np.testing.assert_allclose(tracks["speed"], speed, atol=2e-3 * np.ptp(speed))
    np.testing.assert_allclose(tracks["lock"], log["radio.down.eb_n0_dB"][some], atol=0.2)
    sun = [sim.world.craft.sky.state(fledge.world.SUN, time).r_PN_N for time in (2, 60, 120)]
    np.testing.assert_allclose(np.array(tracks["sun"])[[0, 29, 59]], sun, atol=1)


def test_the_ghost_is_what_telemetry_says_at_its_time():
    sim = fledge.load("star_slew")
    names = [f"flight.filter.attitude.sigma_BN[{i}]" for i in range(3)]
    monitor = Telemetry(dict.fromkeys(names))
    feed = scene.Feed("slew", sim, monitor)
    estimates = {}
    for k in range(10):
        sim.run(1)
        if k % 3 == 2:      # a packet comes, of a moment ago
            estimate = np.array(sim.flight.filter.attitude.sigma_BN)
            estimates[k + 0.5] = estimate
            monitor.values = {name: (int((k + 0.5) * 1e9), x) for name, x in zip(names, estimate)}
        feed.sample()
    [craft] = text_of(feed.pack())["crafts"]
    assert [pose["name"] for pose in craft["poses"] if pose["kind"] == "estimate"] == ["flight.filter.attitude"]
    ghost = next(pose for pose in feed.scene().craft().poses if pose.kind == "estimate").turning
    assert sorted(set(ghost.time)) == list(estimates)
    for t, q in zip(ghost.time, ghost.q):
        assert abs(q @ Turning.of_mrp(np.zeros(1), estimates[t][None]).q[0]) == pytest.approx(1, abs=1e-12)
    assert not any("ghost" in note for note in feed.scene().notes)


def test_without_navigation_on_board_the_ghost_is_that_of_the_world_as_in_a_record():
    sim = fledge.load("earth_imager")
    log = sim.record(sim.world.craft.state, sim.world.nav.attitude, every=1)
    sim.run(1)
    feed = scene.Feed("imager", sim, Telemetry({}))
    feed.sample()
    for found in feed.scene(), scene_of(log):
        assert [pose.name for pose in found.craft().poses if pose.kind == "estimate"] == ["world.nav.attitude"]


def test_messages_by_names_are_those_in_memory():
    """Nested structs and arrays of them, as co-simulations name what is in them."""
    sim = fledge.load("star_slew")
    sim.run(1)
    seen = 0
    for process in sim.processes:
        for instance in process:
            for field in objects.struct(instance).fields:
                if field.group == "out" and field.type == "struct" and not field.shape:
                    port, message = scene.Port("x", field.struct), objects.memory(getattr(instance, field.name))
                    row = np.frombuffer(message, port.dtype)
                    exact = {name: part(row, name) for name in port.fields}
                    flat = {name: value[0].ravel().tolist() for name, value in exact.items()
                            if value.dtype.kind in "fiu" and all(not shape for _, shape in port.parts[name][:-1])}
                    packed = np.frombuffer(port.packed(flat), port.dtype)
                    for name in flat:
                        np.testing.assert_array_equal(part(packed, name), exact[name])
                        seen += 1
    assert seen > 50


def test_after_a_reset_the_browser_asks_again():
    sim = fledge.load("earth_imager")
    feed = scene.Feed("imager", sim)
    sim.run(10)
    feed.sample()
    feed.pack()
    number, _ = feed.since(0)
    sim.reset()
    sim.run(1)
    feed.sample()
    number, news = feed.since(number)
    assert [message.get("again") for message in news] == [True, None] and news[1]["end"] == pytest.approx(1)
    assert text_of(feed.pack())["begin"] == pytest.approx(1)
    feed.sample()       # the simulation stands still: nothing is new
    assert feed.since(number) == (number, [])


def test_the_samples_that_are_kept_have_a_bound(monkeypatch):
    monkeypatch.setattr(scene, "MOST", 64)
    sim = fledge.load("earth_imager")
    feed = scene.Feed("imager", sim)
    for _ in range(500):
        sim.run(0.5)
        feed.sample()
        assert len(feed._samples) <= 64
    time = feed.scene().craft().motion.time
    assert time[0] == pytest.approx(0.5) and time[-1] == pytest.approx(250)
    old = np.diff(time[time < 200])
    assert old.max() < 3 * 250 / 32
    number, news = feed.since(0)
    assert len(news) == 0, "no browser has looked yet"
    feed.pack()
    assert len(feed.since(0)[1]) == scene.RECENT


@pytest.mark.parametrize("feed, why", [
    (lambda sim: scene.Feed("x", None), "needs the spacecraft's mission"),
    (lambda sim: scene.Feed("x", sim), "has not run yet"),
    (lambda sim: scene.Feed("x", sim, flown=False), "the link is not up"),
    (lambda sim: scene.Feed("x", sim, flown=False, link=object), "this mission's flight has none"),
    (lambda sim: scene.Feed("x", sim, flown=False, link=lambda: SimpleNamespace(topics={}, watch=lambda *_: None)),
     r"does not show /world/craft/state to observers; give it watch = \['/world/craft/state'\]"),
])
def test_a_missing_truth_is_named(feed, why):
    found = feed(fledge.load("earth_imager"))
    found.sample()
    with pytest.raises(SetupError, match=why):
        found.pack()


def test_the_messages_of_a_co_simulation_are_the_truth():
    """Those that an observer sees, by the topics that it has."""
    other = fledge.load("earth_imager")
    other.run(5)
    state = other.world.craft.state
    watched = {}
    link = SimpleNamespace(topics={"/world/craft/state": None, "/flight/telemetry": None},
                           watch=lambda topics, hear: watched.update(topics=list(topics), hear=hear))
    feed = scene.Feed("imager", fledge.load("earth_imager"), flown=False, link=lambda: link)
    feed.sample()
    assert watched["topics"] == ["/world/craft/state"]
    with pytest.raises(SetupError, match="nothing has come of /world/craft/state yet"):
        feed.pack()

    class Seen(dict):
        topic, t = "/world/craft/state", 5 * 10**9

    watched["hear"](Seen({"head.t": 5 * 10**9, "head.quality": 3, "head.sequence": 1, "unknown": 7}
                         | {name: getattr(state, name).tolist() for name in ("r_BN_N", "v_BN_N", "sigma_BN")}))
    feed.sample()
    craft = feed.scene().craft()
    assert craft.motion.time.tolist() == [5] and craft.motion.r[0].tolist() == state.r_BN_N.tolist()
    text = text_of(feed.pack())
    assert any(planet["name"] == "EARTH" for planet in text["planets"])
    assert not text["crafts"][0]["poses"]
    assert any("no attitude of world by navigation (NavAttitude): there is no ghost" in note for note in text["notes"])


# --- in a browser, from the server -------------------------------------------------------------------

@contextmanager
def served(folder, text):
    """The address of a server's page, and its room."""
    (folder / "ground.toml").write_text(text)
    room, ready, loop = Room(read(folder / "ground.toml")), Queue(), asyncio.new_event_loop()
    over = asyncio.Event()
    thread = Thread(target=loop.run_until_complete, args=(serve(room, ready.put, over),))
    thread.start()
    try:
        yield ready.get(), room
    finally:
        loop.call_soon_threadsafe(over.set)
        thread.join()
        room.close()
        loop.close()


in_browser = opens("console.js", "viewer.js")
VIEWER = "document.querySelector('.fledge-view')?.viewer"


@pytest.mark.long("three missions, each in two pages of a browser")
@in_browser
@pytest.mark.parametrize("mission, seconds, every, modes, begin", [
    ("cubesat", 900, 2, [(300, "nadir"), (600, "sun"), (700, "brake")], "brake"), ("nadir_spin", 600, 2, [], None),
    ("mars_orbiter", 600, 2, [], None)])
def test_the_live_page_reads_as_the_recorded_one(tmp_path, mission, seconds, every, modes, begin):
    """The same words and colours among the numbers, and the same ghosts, at ten instants."""
    flown = Flown(tmp_path, mission, seconds, every, modes, begin)
    readings = []
    with Browser(900, 600, wait=PATIENCE) as browser:
        for name, shown in ("live", flown.begun), ("recorded", flown.recorded):
            browser.open(page.write(shown, tmp_path / f"{name}.html"), "#map=0&show=reference")
            if name == "live":
                browser.evaluate("""(() => {
                    const {root, data, constructor} = fledgeView;
                    fledgeView.destroy();
                    window.fledgeView = new constructor(root, data, {live: true});
                })()""")
                browser.evaluate(f"{json.dumps(flown.messages)}.forEach((one) => fledgeView.extend(one))")
            rows = []
            for t in flown.times:
                browser.evaluate(f"fledgeView.seek({t})")
                browser.wait_for("!fledgeView.dirty")
                rows.append([browser.evaluate(expression) for expression in (
                    "[...document.querySelectorAll('.readout dt')].map((one) => [one.textContent, "
                    "one.nextSibling.textContent, getComputedStyle(one.nextSibling).color])",
                    "fledgeView.stage.crafts.map((one) => one.ghosts.filter(({ghost}) => ghost.visible).map("
                    "({pose, ghost}) => [pose.name, ghost.children.at(-1).material.color.getHexString(), "
                    "...ghost.quaternion.toArray().map((x) => x.toFixed(5))]))")])
            readings.append(rows)
        assert browser.problems == []
    for t, live, recorded in zip(flown.times, *readings):
        assert live == recorded, t


@pytest.mark.long("a browser on a mission")
@in_browser
def test_several_spacecraft_in_one_picture_and_the_ghost_of_telemetry_beside_the_truth(tmp_path):
    def paused(name):
        """The simulation of a spacecraft that stands, as the picture does."""
        browser.go("about:blank")
        browser.go(f"{address}#/view?craft={name}")
        browser.wait_for(f"{VIEWER}?.root.dataset.opened")
        begun = browser.evaluate(f"{VIEWER}.data.end")
        browser.wait_for(f"{VIEWER}.data.end > {begun} + 10")
        craft = room.crafts[name]
        craft.call(lambda: craft.run.command("pause")).result(30)
        browser.wait_for(f"!{VIEWER}.dirty && Math.abs({VIEWER}.data.end - {craft.simulation.state_time}) < 1e-6 && "
                         f"{VIEWER}.t === {VIEWER}.data.end")
        return craft.simulation

    craft = "[[craft]]\nname = {0!r}\nmission = {1!r}\nspeed = 20\n".format
    with served(tmp_path, 'port = 0\nfolder = "runs"\n' + craft("slew", "star_slew") + craft("two", "formation")
                + 'process = "chief"\n') as (address, room), Browser(900, 600, wait=PATIENCE) as browser:
        sim = paused("two")
        places = browser.evaluate(f"{VIEWER}.stage.crafts.map((one) => one.place)")
        exact = [sim.process(name).craft.state.r_BN_N for name in ("chief_world", "deputy_world")]
        assert np.abs(np.array(places) - exact).max() < 1 and np.linalg.norm(exact[0] - exact[1]) > 1
        assert browser.evaluate(f"{VIEWER}.stage.crafts.flatMap((one) => one.ghosts.map(({{pose}}) => pose.name))") == [
            "chief_world.nav.attitude", "chief.base.reference", "deputy_world.nav.attitude"], \
            "the telemetry of the others does not come by this link; what the world says does"

        sim = paused("slew")
        [ghost] = browser.evaluate(
            f"{VIEWER}.stage.crafts[0].ghosts.filter(({{pose}}) => pose.kind === 'estimate').map("
            "({ghost}) => ({shown: ghost.visible, q: ghost.quaternion.toArray()}))")
        estimated, true = (Turning.of_mrp(np.zeros(1), np.array([sigma])).q[0] for sigma in (
            sim.flight.filter.attitude.sigma_BN, sim.world.craft.state.sigma_BN))
        assert ghost["shown"] and abs(estimated @ ghost["q"]) == pytest.approx(1, abs=1e-9)
        off = 2 * np.arccos(min(abs(true @ ghost["q"]), 1))
        assert 0 < off < 1e-2, "beside the truth, not on it"
        assert [problem for problem in browser.problems if "viewer.js" in problem] == []


@pytest.mark.long("a browser on a mission")
@in_browser
def test_the_page_of_the_console_follows_the_flight_looks_back_and_returns(tmp_path):
    with served(tmp_path, 'port = 0\nfolder = "runs"\n[[craft]]\nname = "imager"\nmission = "earth_imager"\n'
                'scenario = "contact"\nspeed = 20\n') as (address, room), Browser(900, 600, wait=PATIENCE) as browser:
        browser.go(f"{address}#/view?craft=imager")
        viewer = VIEWER
        browser.wait_for(f"{viewer}?.root.dataset.opened")
        begun = browser.evaluate(f"{viewer}.data.end")
        browser.wait_for(f"{viewer}.data.end > {begun} + 20 && {viewer}.t > {begun}")
        assert browser.evaluate("controlRoom.time.isLive")

        # Back in time, by the console's own bar: the picture is that time's, and stays.
        back = begun / 2 + 5
        browser.evaluate(f"controlRoom.time.seek({round(back * 1e9)}n)")
        browser.wait_for(f"{viewer}.t < {begun} && !{viewer}.dirty")
        t = browser.evaluate(f"{viewer}.t")
        assert t == pytest.approx(back, abs=1e-6)
        end = browser.evaluate(f"{viewer}.data.end")
        browser.wait_for(f"{viewer}.data.end > {end}")
        assert browser.evaluate(f"{viewer}.t") == t
        browser.evaluate(f"{viewer}.choose('orbit')")
        browser.wait_for("location.hash.includes('orbit') && location.hash.includes('t=')")

        # The link brings somebody else to the same time and camera.
        link = browser.evaluate("location.href")
        browser.go("about:blank")
        browser.go(link)
        browser.wait_for(f"{viewer}?.root.dataset.opened")
        assert browser.evaluate(f"[{viewer}.t, {viewer}.stage.preset, {viewer}.following]") == [
            pytest.approx(t, abs=1e-6), "orbit", False]

        browser.evaluate("controlRoom.time.now()")
        browser.wait_for(f"{viewer}.following && {viewer}.t > {end}")
        # Paused, the picture comes to rest where the simulation stands.
        room.crafts["imager"].call(lambda: room.crafts["imager"].run.command("pause")).result(30)
        browser.wait_for(f"!{viewer}.dirty && {viewer}.t === {viewer}.data.end && Math.abs({viewer}.t - "
                         f"{room.crafts['imager'].simulation.state_time}) < 1e-6")
        exact = room.crafts["imager"].simulation.world.craft.state.r_BN_N
        assert np.linalg.norm(np.array(browser.evaluate(f"{viewer}.stage.crafts[0].place")) - exact) < 1
        assert [problem for problem in browser.problems if "viewer.js" in problem] == []
