# SPDX-License-Identifier: Apache-2.0
"""What notebooks show: well-formed, escaped, with units and meanings, and without colours of its own."""
import sys
from html.parser import HTMLParser
from types import SimpleNamespace

import pytest

import fledge
from fledge.display import Live, table
from fledge.montecarlo import Campaign
from fledge.progress import Progress
from fledge.units import s

VOID = {"br"}


class Page(HTMLParser):
    """The cells of a table, as texts; fails where tags do not fit."""

    def __init__(self, html):
        super().__init__()
        self.open, self.cells, self.styles = [], [], []
        assert "\n" not in html, "Markdown would take the rest for text"
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")
        self.styles += [value for name, value in attributes if name == "style"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        if {"td", "th"} & set(self.open):
            self.cells[-1] += text


@pytest.fixture(scope="module")
def sim():
    sim = fledge.load("nadir_spin")
    sim.log = sim.record(sim.flight.tracking.error, sim.world.craft.state, every=1 * s)
    sim.run(10 * s)
    return sim


def test_texts_are_escaped_and_lines_stay_lines():
    html = table("<script>", [("a & b", [("x", "1 < 2\n2 > 1")]), ("empty", [])], ("", "value"), ["\"note\""])
    page = Page(html)
    assert page.cells == ["", "value", "a & b", "x", "1 < 22 > 1"]
    assert "<script>" not in html and "&lt;script&gt;" in html and "1 &lt; 2<br>2 &gt; 1" in html


def test_no_colour_is_set_that_a_dark_page_would_hide(sim):
    for style in Page(sim.flight.control._repr_html_()).styles:
        assert "color:" not in style.replace("background-color", "").replace("border-color", "")
        assert "#" not in style and "background: none" in style or "background" not in style


def test_a_module_a_model_and_a_message_show_unit_and_meaning(sim):
    cells = Page(sim.flight.control._repr_html_()).cells
    at = cells.index("K")
    assert cells[at:at + 4] == ["K", "2.531", "N m", "gain on the MRP error"]
    assert "<< flight.tracking.error" in cells and "memory" not in cells[:at]
    assert "gravity" in Page(sim.world.craft._repr_html_()).cells
    cells = Page(sim.flight.tracking.error._repr_html_()).cells
    assert "omega_BR_B" in cells and "rad/s" in cells


def test_a_simulation_shows_its_instances_tasks_and_health(sim):
    cells = Page(sim._repr_html_()).cells
    at = cells.index("control")
    assert cells[at + 1] == "MrpFeedback" and "process world" in cells
    assert cells[cells.index("gnc") + 1:][:2] == ["task, every 0.5 s", "guidance, spin, tracking, control, motor"]
    assert Page(sim.flight._repr_html_()).cells[0] == "process flight"


def test_records_show_their_fields_and_complete_their_names(sim, tmp_path):
    log = sim.log
    assert "flight.tracking.error, 11 samples" in Page(log._repr_html_()).cells
    keys = log._ipython_key_completions_()
    assert {"error", "error.sigma_BR", "state", "flight.tracking.error.sigma_BR"} <= set(keys)
    assert not [key for key in keys if "head" in key]
    for key in keys:
        assert len(log[key]) == 11, "each name that is offered is one"
    other = fledge.load("nadir_spin")
    other.record(other.flight.tracking.error, every=1 * s)
    other.archive(tmp_path / "run.mcap", mission="nadir_spin", scenario="<b>")
    other.run(3 * s)
    with fledge.Archive(other.close_archive()) as archive:
        html = archive._repr_html_()
        cells = Page(html).cells
        assert cells[cells.index("sigma_BR") + 1] == "3" and "nadir_spin, &lt;b&gt;" in html
        assert all(len(archive[key]) == 4 for key in archive._ipython_key_completions_())


def test_a_campaign_and_its_result_show_what_they_are():
    campaign = Campaign("nadir_spin")
    cells = Page(campaign._repr_html_()).cells
    assert cells[cells.index("world.craft.sigma_BN") + 1] == "attitude()"
    result = campaign.fly(5, seed=1)
    html = result._repr_html_()
    Page(html)
    assert "5 runs of nadir_spin" in html and "5 of 5" in html and "the attitude did not settle" in html
    assert "world.wheels.J[0]" in result.draws._ipython_key_completions_()


def test_a_batch_shows_its_actions_and_failures(sim):
    batch = sim.batch(2, ["flight.control.K"], ["flight.tracking.error.sigma_BR"], every=1 * s)
    batch.reset()
    batch.step([[1.0], [-1.0]])
    html = batch._repr_html_()
    assert "N m" in Page(html).cells and "clone 1: flight.control.K must be &gt; 0 N m" in html


class Notebook:
    """What IPython has in a notebook, as far as Live uses it."""

    def __init__(self, monkeypatch):
        self.shown = []
        monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=1)))
        monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=self.display))

    def display(self, data, raw, display_id):
        assert raw and display_id
        self.update(data, raw)
        return self

    def update(self, data, raw):
        self.shown.append(data)


def test_progress_of_a_run_is_one_line_of_a_notebook(monkeypatch, capsys):
    notebook = Notebook(monkeypatch)
    with Progress("<run>", 0, 100_000_000_000) as progress:
        progress._begun -= 10
        progress.reaches(25_000_000_000)
        progress.reaches(50_000_000_000)
    assert [data["text/plain"][:10] for data in notebook.shown] == ["<run>  25%", "<run>  50%", ""]
    assert 'value="0.5000"' in notebook.shown[1]["text/html"] and "&lt;run&gt;" in notebook.shown[1]["text/html"]
    assert capsys.readouterr().err == ""


def test_a_campaign_shows_its_progress_in_a_notebook(monkeypatch):
    notebook = Notebook(monkeypatch)
    Campaign("nadir_spin").fly(5)
    assert notebook.shown[-2]["text/plain"].endswith("5 of 5") and notebook.shown[-1]["text/plain"] == ""


def test_a_terminal_is_no_notebook(monkeypatch):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not Live().there
    monkeypatch.delitem(sys.modules, "IPython")
    assert not Live().there
