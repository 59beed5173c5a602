# SPDX-License-Identifier: Apache-2.0
"""What the wiring shows: every instance and every wire once, in an order that a reader can follow."""

import re
from collections import Counter
from xml.etree import ElementTree

import pytest

import fledge
from fledge import SetupError, Simulation, cli, flight as fsw, objects, world
from fledge.objects.testing import kinds
from fledge.units import s
from fledge.mission.wiring import Wiring
from fledge.plot.wiring import dot, render, save
from tests.needs import needs

graphviz = needs("graphviz")


@pytest.fixture
def sim():
    """Two tasks, modes, events, a late wire, one that goes stale, and one against the order of its task."""
    sim = Simulation("flagship")
    f, w = sim.flight, sim.world
    f.vehicle = fsw.VehicleConfig(I_B=1)
    f.guidance, f.extra = fsw.HillPointing(), fsw.HillPointing()
    f.spin, f.turn = fsw.EulerRotation(), fsw.EulerRotation()
    f.tracking, f.control = fsw.TrackingError(), fsw.MrpFeedback(K=1, P=1)
    w.wheels = world.ReactionWheels(axes_B=[[1, 0, 0]], J=1)
    w.craft = world.Spacecraft(I_B=1, parts=[w.wheels], gravity=[world.MARS, world.SUN])
    w.nav = world.Navigation()
    f.connect(f.guidance.reference >> f.spin.base,
              f.turn.reference >> f.tracking.reference,
              (f.spin.reference >> f.turn.base).stale_after(2 * s),
              f.tracking.error >> f.control.error,
              f.vehicle.vehicle >> f.control.vehicle)
    w.connect(w.craft.state >> w.nav.truth,
              (w.nav.orbit >> [f.guidance.orbit, f.extra.orbit]).latency(1),
              w.nav.attitude >> f.tracking.attitude)
    slow = f.task("guidance", every=2 * s, run=[f.guidance, f.extra, f.spin])
    f.task("control", every=0.5 * s, run=[f.control, f.turn, f.tracking])
    w.task("dynamics", every=0.1 * s, run=[w.craft, w.nav])
    f.mode("science", [slow])
    f.event("settled", when=f.watch(f.tracking.error).sigma_BR.norm() < 1e-3, hold=60 * s, once=True, enter="science")
    w.at(5 * s, print)
    return sim


def wires(sim):
    return [f"{source} >> {target}" for source, target, *_ in sim.wires]


def shown_edges(text):
    return Counter(re.findall(r'edgetooltip="([^"]*)"', text))


def shown_nodes(text):
    return Counter(re.findall(r'^ *"([a-z0-9_]+\.\w+)" \[', text, re.MULTILINE))


@pytest.mark.parametrize("name", sorted(fledge.missions()))
def test_every_instance_and_every_wire_of_a_mission_is_drawn_once(name):
    sim = fledge.load(name)
    text = dot(Wiring(sim))
    assert shown_edges(text) == Counter(wires(sim))
    assert shown_nodes(text) == Counter(objects.path(instance) for process in sim.processes for instance in process)


def test_the_outline_has_every_instance_and_every_wire_once(sim):
    text = Wiring(sim).outline()
    for instance in (*sim.flight, *sim.world):
        line = rf"^    {objects.name(instance)} +{objects.struct(instance).name}\b"
        assert len(re.findall(line, text, re.MULTILINE)) == 1
    assert text.count("<<") == len(wires(sim))


def test_the_outline_says_what_is_special(sim):
    text = Wiring(sim).outline()
    for part in ("  guidance, every 2 s\n    guidance  HillPointing\n",
                 "orbit   << world.nav.orbit, one exchange late\n",
                 "base     << spin.reference, stale after 2 s\n", "command  -- not wired, optional\n",
                 "  in no task\n    vehicle   VehicleConfig\n", "craft   Spacecraft; gravity: MARS, SUN\n",
                 "wheels  ReactionWheels; part of craft\n", "  mode science: guidance\n",
                 "  event settled: norm(flight.tracking.error.sigma_BR) < 0.001 for 60 s, once: enter science\n",
                 "  event t >= 5 s, once: call print()\n", "  integrator: the classical method of Runge and Kutta"):
        assert part in text + "\n", part


def test_what_is_read_at_a_later_instant(sim):
    back = {f"{link.source} >> {link.target}" for link in Wiring(sim).links if link.back}
    assert back == {"world.nav.orbit >> flight.guidance.orbit", "world.nav.orbit >> flight.extra.orbit",
                    "flight.tracking.error >> flight.control.error"}  # control runs before tracking


def test_the_stack_is_the_longest_chain(sim):
    stack = [n.name for n in Wiring(sim).nodes.values() if n.in_stack and n.task == "guidance"]
    assert stack == ["guidance", "spin"]  # no node reads `extra`
    sim = fledge.load("nadir_spin")
    assert [n.name for n in Wiring(sim).nodes.values() if n.in_stack and n.process == "flight"] == [
        "guidance", "spin", "tracking", "control", "motor"]


def test_without_the_world_its_wires_end_at_names(sim):
    wiring = Wiring(sim, flight_only=True)
    text = dot(wiring)
    assert set(wiring.open_ends) == {"world.nav.orbit", "world.nav.attitude"}
    assert shown_nodes(text) == Counter(f"flight.{objects.name(instance)}" for instance in sim.flight)
    assert shown_edges(text) == Counter(w for w in wires(sim) if not w.startswith("world.craft"))
    assert "ReactionWheels" not in wiring.outline() and "<< world.nav.attitude" in wiring.outline()


def test_a_parameter_may_be_called_parts_and_an_event_says_all_that_it_does(sim):
    f = sim.flight
    f.noise = kinds()[1]["Noise"](parts=[{"share": 1}, {}, {}])
    f.task("noise", every=1 * s, run=[f.noise])
    k = f.watch(f.noise.kinds)
    f.event("odd", when=(k.phase == "SAFE") & ~((k.parts[1].pairs[0].count > 2**53 + 1) | (k.x < k.y)), hold=2 * s,
            count=3, modes=[f.science], until=k.phase != "SAFE", armed=False, arm="settled", disarm=["settled"],
            enter=f.science, set=[(f.watch(f.noise).step, 7), (f.watch(f.noise).phases, ["SAFE", "DRAIN", 3])])
    says = ("  event odd: (flight.noise.kinds.phase == SAFE) & ~((flight.noise.kinds.parts[1].pairs[0].count > "
            "9007199254740993) | (flight.noise.kinds.x < flight.noise.kinds.y)) for 2 s 3 times in a row in science, "
            "again after flight.noise.kinds.phase != SAFE, disarmed at first: enter science, arm settled, "
            "disarm settled, set flight.noise.step = 7, set flight.noise.phases = ['SAFE', 'DRAIN', 3]\n")
    assert says in Wiring(sim).outline()


def test_the_same_text_each_time(sim):
    assert dot(Wiring(sim)) == dot(Wiring(sim.clone()))
    assert dot(Wiring(fledge.load("nadir_spin"))) == dot(Wiring(fledge.load("nadir_spin")))


@graphviz
def test_graphviz_reads_it_and_the_stack_goes_straight_down():
    plain = render(dot(Wiring(fledge.load("nadir_spin"))), "plain").decode()
    at = {name: (float(x), float(y)) for name, x, y in re.findall(r"^node (\S+) (\S+) (\S+)", plain, re.MULTILINE)}
    stack = [at[f'"flight.{name}"'] for name in ("guidance", "spin", "tracking", "control", "motor")]
    assert [y for _, y in stack] == sorted((y for _, y in stack), reverse=True)
    assert max(x for x, _ in stack) - min(x for x, _ in stack) < 0.02
    assert max(x for x, _ in stack) < min(x for name, (x, _) in at.items() if name.startswith('"world.'))


@graphviz
def test_names_that_would_break_the_picture_are_shown_as_they_are(sim):
    name = 'a"b\\n<c>&\x01{}|'
    sim.name = name
    sim.flight.odd = fsw.InertialPointing()
    sim.flight.task(name, every=1, run=[sim.flight.odd])
    sim.world.event("odd", when=lambda: False, do=type("</svg>", (), {"__call__": lambda self: None})())
    source = dot(Wiring(sim))
    assert f'digraph "{name}"'.replace('a"b\\n', 'a\\"b\\\\n').replace("\x01", "\ufffd") in source
    picture = render(source, "svg").decode()
    assert 'a&quot;b\\n&lt;c&gt;&amp;\ufffd{}|' in picture
    assert picture.count("</svg>") == 1 and "call &lt;/svg&gt;()" in picture


@graphviz
@pytest.mark.parametrize("name", ["nadir_spin", "earth_imager"])     # graphviz cannot draw the second side by side
def test_no_wire_runs_over_words(name):
    wiring = Wiring(fledge.load(name))
    *below, words = ElementTree.fromstring(render(dot(wiring, links=True), "svg"))[0]
    assert words.get("class") == "words" and words.get("stroke") and not words.findall(".//{*}path")
    texts = Counter(text.text for text in words.iter("{http://www.w3.org/2000/svg}text"))
    assert Counter(text for link in wiring.links for text in (link.ports, link.message)) <= texts
    kinds = [group.get("class") for group in below if group.get("class")]
    assert kinds == sorted(kinds, key=["cluster", "edge", "node"].index)
    for group in below:
        assert group.get("class") == "node" or not group.findall(".//{*}text")
        assert group.get("class") != "node" or group.findall(".//{*}text")
    assert {"flight", "world"} <= texts.keys()


@graphviz
@pytest.mark.parametrize("kind, start",
                         [("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF"), ("dot", b"digraph")])
def test_pictures_are_files_that_do_not_change(sim, tmp_path, kind, start):
    first = save(Wiring(sim), tmp_path / "deep" / f"a.{kind}").read_bytes()
    assert first.startswith(start)
    if kind == "pdf" and b"/CreationDate" not in first:
        pytest.skip("cairo compresses the date, from version 1.18 on")
    assert save(Wiring(sim), tmp_path / f"b.{kind.upper()}").read_bytes() == first
    assert re.findall(rb"CreationDate \(D:(\d{4})", first) == ([b"1970"] if kind == "pdf" else [])


def test_other_endings_are_refused(sim, tmp_path):
    with pytest.raises(SetupError, match=r"a.jpg: the name of a picture ends in .svg, .png, .pdf or .dot"):
        save(Wiring(sim), tmp_path / "a.jpg")
    assert not list(tmp_path.iterdir())


def test_without_graphviz_the_package_is_named(sim, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SetupError, match="needs graphviz, which is not installed: apt-get install graphviz"):
        save(Wiring(sim), tmp_path / "a.svg")
    save(Wiring(sim), tmp_path / "a.dot")
    assert cli.main(["show", "nadir_spin", "--out", str(tmp_path / "b.svg")]) == 2
    assert "apt-get install graphviz" in capsys.readouterr().err
    assert cli.main(["show", "nadir_spin", "--text"]) == 0


@graphviz
def test_a_drawing_that_fails_says_why():
    with pytest.raises(SetupError, match="graphviz cannot draw the wiring: .*syntax error"):
        render("digraph {", "svg")


@graphviz
def test_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["show", "nadir_spin"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("flight\n  gnc, every 0.5 s\n    guidance  HillPointing\n")
    assert out.endswith("\ndrawn in runs/nadir_spin/wiring.svg\n")
    assert (tmp_path / "runs" / "nadir_spin" / "wiring.svg").exists()
    assert cli.main(["show", "nadir_spin", "--flight-only", "--out", "f.dot"]) == 0
    assert capsys.readouterr().out == "f.dot\n" and "world.nav.orbit" in (tmp_path / "f.dot").read_text()
    assert cli.main(["show", "nothing"]) == 2
    assert "there is no mission 'nothing'" in capsys.readouterr().err
