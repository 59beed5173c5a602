# SPDX-License-Identifier: Apache-2.0
"""The report of a run: one complete, well-formed page without other files, in which all text is escaped."""

import re
import textwrap
from html.parser import HTMLParser

import pytest
from jinja2 import UndefinedError

import fledge
from fledge import cli
from fledge.report.numbers import number, unit, value
from fledge.report.run import templates
from fledge.scene import bundle
from tests.needs import needs

FLIGHT = '''
    """What flies: <b>nothing</b> & "more".

    A second paragraph.
    """
    from fledge import flight as fsw
    from fledge.units import deg, s

    def build(f):
        f.guidance = fsw.HillPointing()
        f.spin = fsw.EulerRotation(rates=[0, 0, 90 * deg / s])
        f.tracking = fsw.TrackingError()
        f.connect(f.guidance.reference >> f.spin.base, f.spin.reference >> f.tracking.reference)
        slow = f.task("slow", every=2, run=[f.guidance, f.spin])
        fast = f.task("fast", every=1, run=[f.tracking])
        f.mode("cold", [fast])
        f.mode("warm", [slow, fast])
        f.event("late", when=f.watch(f.tracking.error).omega_RN_B.max_abs() < 1, hold=3 * s, enter="warm")
'''
WORLD = '''
    from fledge import Orbit, world

    class Shout:
        __name__ = "<script>alert(1)</script>"

        def __call__(self):
            pass

    def build(w, f):
        w.wheels = world.ReactionWheels(axes_B=[[1, 0, 0], [0, 1, 0]], J=0.1)
        w.craft = world.Spacecraft(I_B=[[3, 1, 0], [1, 4, 0], [0, 0, 5]], parts=[w.wheels], gravity=[world.EARTH],
                                   orbit=Orbit(world.EARTH, altitude=500e3))
        w.nav = world.Navigation(rate_bias=[1e-12, 0, 0])
        w.connect(w.craft.state >> w.nav.truth, w.nav.orbit >> f.guidance.orbit, w.nav.attitude >> f.tracking.attitude)
        w.task("dynamics", every=1, run=[w.craft, w.nav])
        w.at(4, Shout())
'''
SCENARIOS = '''
    def good(sim):
        """A title with <i>markup</i> & an ampersand.

        What it is about.
        """
        log = sim.record(sim.flight.tracking.error, sim.world.craft.state, every=2)
        sim.run(100)
        log.plot("error.sigma_BR", name="<x> & y")
        sim.world.wheels.J = 0.25

    def failing(sim):
        """It does not hold."""
        sim.archives_motion = False
        sim.record(sim.flight.tracking.error)
        sim.run(1)
        assert sim.time > 5, "too <early>"

    def stopped(sim):
        """Ctrl-C."""
        sim.archives_motion = False
        sim.run(3)
        raise KeyboardInterrupt

    def broken(sim):
        """It cannot go on."""
        sim.run(1)
        open(__file__ + ".missing")
'''
VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """A page: raises on what is not well-formed, and collects what a test looks at."""

    def __init__(self, source):
        super().__init__()
        self.source, self.open, self.tags, self.ids, self.links, self.words = source, [], [], [], [], []
        self.feed(source)
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, name, attributes):
        self.tags.append(name)
        for key, given in attributes:
            if key == "id" and "svg" not in self.open:
                self.ids.append(given)
            if key in ("href", "src", "xlink:href", "data", "action", "poster", "srcset"):
                self.links.append(given)
        if name not in VOID:
            self.open.append(name)

    def handle_startendtag(self, name, attributes):
        self.handle_starttag(name, attributes)
        assert name in VOID or self.open.pop() == name

    def handle_endtag(self, name):
        assert self.open and self.open[-1] == name, f"</{name}> closes {self.open[-1:]}, line {self.getpos()[0]}"
        self.open.pop()

    def handle_data(self, data):
        if "style" not in self.open:
            self.words.append(data)

    def says(self, words):
        """Whether the words are on the page, whatever the spaces and tags between them."""
        return re.sub(r"\s", "", words) in re.sub(r"\s", "", "".join(self.words))


@pytest.fixture
def here(tmp_path, monkeypatch):
    folder = tmp_path / "missions" / "looker"
    folder.mkdir(parents=True)
    for name, content in (("flight", FLIGHT), ("world", WORLD), ("scenarios", SCENARIOS)):
        (folder / f"{name}.py").write_text(textwrap.dedent(content))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(bundle, "folder", lambda: tmp_path / "view")
    return tmp_path


def fly(here, *arguments, scenario="good", code=0):
    assert cli.main(["run", "looker", *([scenario] if scenario else []), "--report", *arguments]) == code
    return Page((here / "runs" / "looker" / (scenario or "free") / "report.html").read_text(encoding="utf-8"))


def test_one_page_that_needs_nothing_else(here):
    page = fly(here)
    assert page.source.startswith("<!doctype html>\n<html lang=\"en\">")
    assert not {"script", "link", "iframe", "object", "embed", "base"} & set(page.tags)
    assert not re.search(r"https?:|//[a-z]|@import|url\(", re.sub(r"base64,[\w+/=]+", "", page.source))
    for link in page.links:
        assert link.startswith("data:image/png;base64,") or (link[:1] == "#" and link[1:] in page.ids), link[:80]
    assert len(page.ids) == len(set(page.ids))
    assert str(here) not in page.source and "/missions" not in page.source


def test_the_flight_is_in_the_page_where_there_is_a_viewer(here):
    assert fly(here).says("The 3-D view and interactive plots need Node when Fledge is built")
    (here / "view").mkdir()
    (here / "view/view.js").write_text("show('</script>')")
    (here / "view/view.css").write_text("p { color: red; }")
    page = fly(here)
    assert page.tags.count("script") == 2 and {"fledge-view", "fledge-data"} <= set(page.ids)
    assert not page.says("need Node") and page.says("show('<\\/script>')")
    page = fly(here, scenario="failing", code=1)
    assert page.says("no 3-D view: no attitude is recorded, so there is nothing to show; record world.craft.state.")
    assert "fledge-data" in page.ids, "the plots are there all the same"


def test_it_says_all_of_the_run(here):
    page = fly(here, "--seed", "7")
    for part in ("looker, good", "flown", "A title with <i>markup</i> & an ampersand.", "What it is about.",
                 '<b>nothing</b> & "more".', "A second paragraph.", "seed 7", "times real time", "run.mcap, ",
                 # tasks, modes and events
                 "flight fast 1 s tracking", "world dynamics 1 s craft, nav 101", "cold fast t = 0 s began in it",
                 "warm slow, fast t = 4 s ended in it", "max_abs(flight.tracking.error.omega_RN_B) < 1", "enter warm",
                 "t >= 4 s", "call <script>alert(1)</script>()",
                 # parameters: an angle in degrees too, one that changed, defaults, what Python adds
                 "rates [0, 0, 1.570796] = [0, 0, 90] deg/s rad/s their constant rates",
                 "J [0.1, 0.1] at the end [0.25, 0.25] kg m2 inertia about the axis", "attitude_noise 0 rad",
                 "gravity EARTH, mu = 3.986", "parts world.wheels", "Orbit about EARTH: a = 6878.1363 km",
                 # assumptions, final values, versions
                 "world.nav.attitude_noise was left at 0 rad", "51 samples, every 2 s; the last was written at 100 s",
                 "quality good", f"Fledge {fledge.__version__}", "./fledge run looker good --seed 7"):
        assert page.says(part), part
    assert page.source.count("<figure>") == 1 and 'alt="figure &lt;x&gt; &amp; y"' in page.source


def test_defaults_differ_in_colour_from_given_values(here):
    rows = {name: bool(grey) for grey, name in
            re.findall(r'<tr( class="default")?><td><code>(\w+)</code>', fly(here).source)}
    assert {name for name in ("rates", "I_B", "rate_bias", "angles", "attitude_noise", "friction") if rows[name]} == {
        "angles", "attitude_noise", "friction"}


def test_a_failed_check(here):
    page = fly(here, scenario="failing", code=1)
    assert 'class="verdict failed"' in page.source
    assert page.says('missions/looker/scenarios.py, line 17: too <early> assert sim.time > 5, "too <early>"')
    assert page.says("2 samples, at every instant")


def test_an_interrupted_run(here):
    page = fly(here, scenario="stopped", code=130)
    assert 'class="verdict interrupted"' in page.source and page.says("Nothing was recorded.")
    assert page.says("The scenario plotted nothing.") and page.says("flown 3 s")


def test_an_error_says_nothing_of_this_machine(here):
    page = fly(here, scenario="broken", code=1)
    assert 'class="verdict failed"' in page.source and page.says("looker/scenarios.py.missing")
    assert str(here) not in page.source


def test_without_plots_and_without_a_scenario(here):
    assert fly(here, "--no-plots").says("The plots were left out of this run.")
    page = fly(here, "--for", "20s", scenario=None)
    assert 'class="verdict flown"' in page.source and page.says("./fledge run looker --for 20s")


def test_without_graphviz_there_is_an_outline(here, monkeypatch):
    monkeypatch.setenv("PATH", str(here))
    page = fly(here)
    assert page.says("apt-get install graphviz") and page.says("<< guidance.reference") and "svg" not in page.tags


@needs("graphviz")
def test_the_wiring_has_a_counterpart_of_each_colour(here):
    page = fly(here)
    picture = page.source[page.source.index("<svg"):page.source.index("</svg>")]
    colours = set(re.findall(r'(?:fill|stroke)="(#\w+)"', picture))
    assert len(colours) > 6
    for colour in colours:
        assert f'.wiring [fill="{colour}"]' in page.source, colour
    assert '"#flight.spin"' in picture and "flight.spin" in page.ids


def test_the_record_is_the_same_with_a_report(here):
    record = here / "runs" / "looker" / "good" / "run.mcap"
    fly(here)
    first = record.read_bytes()
    assert cli.main(["run", "looker", "good"]) == 0
    assert record.read_bytes() == first


# --- HTML ------------------------------------------------------------------------------------------

def test_text_is_escaped_once():
    def shown(source, **given):
        return templates().from_string(source).render(**given)

    assert shown('<p class="{{ a }}">{{ b }}{{ c }}</p>', a='x"y', b="a < b & '", c=None) == \
        '<p class="x&#34;y">a &lt; b &amp; &#39;</p>'
    assert shown("{{ a }}", a="a\x00\x1b\ud800b\n") == "a\ufffd\ufffd\ufffdb\n"
    assert shown("{{ a|unit }}", a="<i> m^-2") == "&lt;i&gt; m<sup>\N{MINUS SIGN}2</sup>" and unit("-") == ""
    assert shown("{{ a|value }}", a=["<b>", "c"]) == '<span class="vector">[&lt;b&gt;, c]</span>'
    with pytest.raises(UndefinedError, match="'b' is undefined"):
        shown("{{ b }}")


@pytest.mark.parametrize(
    "given, shown",
    [
        (0.1591549, "0.1591549"), (7471618.0, "7471618"), (-0.5, "−0.5"), (-0.0, "0"), (3, "3"), (-3, "−3"),
        (1.5e-9, "1.5×10<sup>−9</sup>"), (-2e20, "−2×10<sup>20</sup>"), (float("nan"), "not a number"),
        (float("-inf"), "−∞"), (True, "yes"),
    ],
)
def test_numbers(given, shown):
    assert number(given) == shown


def plain(html):
    return re.sub(r"<[^>]*>", "", html)


def test_arrays():
    assert plain(value([0.1, 0.2, -0.3])) == "[0.1, 0.2, −0.3]"
    assert plain(value([0, 0, 0])) == "0" and plain(value([])) == "none" and plain(value("")) == "none"
    assert plain(value([2.0] * 4)) == "2, each of 4" and plain(value([2.0] * 3)) == "[2, 2, 2]"
    assert plain(value([1, 2, 0, 0, 0])) == "[1, 2, 0 …]" and plain(value([1, 2, 0])) == "[1, 2, 0]"
    assert plain(value(list(range(1, 101)))).endswith("16, … 100 in all]")
    assert plain(value([[7, 0], [0, 7]])) == "7 × identity" and plain(value([[7, 0], [0, 8]])) == "diagonal [7, 8]"
    assert plain(value([[0, 0], [0, 0]])) == "0" and plain(value([1 / 3], digits=3)) == "[0.333]"
    matrix = value([[1, 2], [3, 4]])
    assert matrix.count("<tr>") == 2 and matrix.count("<td>") == 4
    assert plain(value([[i, 1] for i in range(20)])).endswith("and 8 more rows")
