# SPDX-License-Identifier: Apache-2.0
"""`fledge verify` on a small mission: verdicts against numpy on the record, repeated flights, the four files."""

import csv
import gc
import io
import json
import re
import shutil
import textwrap
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import unquote

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.archive import Archive
from fledge.errors import Failure, SetupError
from fledge.disk import ROOT
from fledge.junit_test import read
from fledge.report.report_test import Page
from fledge.requirements import Requirements
from fledge.verify import coverage, evidence, figure, tables
from fledge.verify.evidence import Row
from fledge.verify.flight import Flown, Shown, _files
from tests.needs import flies_on

SCENARIOS = '''
    from fledge.units import minute, s

    def settle(sim):
        """The body turns to its reference."""
        sim.record(sim.flight.tracking.error, every=1 * s)
        sim.run(8 * minute)

    def brief(sim):
        sim.run(30 * s)
        sim.run(30 * s)

    def idle(sim):
        """It shows nothing."""
        sim.run(1 * s)
'''
REQUIREMENTS = '''
    from fledge.requirements import always, eventually, settles
    from fledge.units import deg, minute, s

    def pointing(r):
        """Pointing <&>."""
        r.every = 1 * s
        error = r.signal("flight.tracking.error.sigma_BR").norm()
        r.require("PNT-1", "The body settles.", settles(error < 0.05, within=6 * minute), shown_by="settle",
                  rationale="For \\"images\\", of course.", parent="SYS-1")
        r.require("PNT-2", "It is never off by <b>much</b> & more.", always(error < 0.1), shown_by=["settle", "brief"],
                  parent="SYS-1")
        r.require("PNT-3", "It settles after the end.", eventually(error < 1e-9, 0, 20 * minute), shown_by="brief",
                  parent="PNT-1")
        r.require("RAT-1", "It turns slowly.",
                  always(r.signal("flight.tracking.error.omega_BR_B").norm() < 3 * deg / s), shown_by=["brief"])

    def structure(r):
        """Structure."""
        r.require("STR-1", "The tank holds.", method="analysis", evidence="docs/tank.md", parent="SYS-2")
'''


def write(folder, requirements=REQUIREMENTS, scenarios=SCENARIOS):
    for name, text in (("requirements", requirements), ("scenarios", scenarios)):
        (folder / "missions/spinner" / f"{name}.py").write_text(textwrap.dedent(text))


def mission(folder):
    (folder / "missions/spinner").mkdir(parents=True)
    for name in ("flight", "world"):
        shutil.copy(ROOT / "missions/nadir_spin" / f"{name}.py", folder / "missions/spinner")
    write(folder)
    return folder


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(mission(tmp_path))
    return tmp_path


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The folder of a report on all."""
    folder = mission(tmp_path_factory.mktemp("verified"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert cli.main(["verify", "spinner"]) == 1
    return folder / "verification/spinner"


def test_a_simulation_that_ends_meanwhile_does_not_harm_a_hash(here):
    before = gc.get_threshold()
    try:
        for later in range(0, 3000, 100):       # the collection begins at another place each time
            gc.disable()
            ring = [fledge.load("spinner")]
            ring.append(ring)
            pairs = [(n, n) for n in range(3000)]   # use up CPython's free tuples: each new one counts
            del ring
            gc.set_threshold(gc.get_count()[0] + later)
            gc.enable()
            _files(here / "missions/spinner")
            del pairs
    finally:
        gc.set_threshold(*before)
        gc.enable()


def results(folder):
    found = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    return {requirement["id"]: requirement for requirement in found["requirements"]}, found


def verify(capsys, *arguments, code=1):
    """What the command prints on either stream."""
    capsys.readouterr()
    assert cli.main(["verify", "spinner", *arguments]) == code
    printed = capsys.readouterr()
    return printed.out + printed.err


def of(printed, word):
    """The flights that the command reports so."""
    return set(re.findall(rf"^  {word} +(\w+ on [\w-]+):", printed, re.M))


# --- verdicts --------------------------------------------------------------------------------------

def test_verdicts_and_margins_are_those_of_the_records(report):
    found, whole = results(report)
    assert {id: row["verdict"] for id, row in found.items()} == {
        "PNT-1": "holds", "PNT-2": "violated", "PNT-3": "unknown", "RAT-1": "holds", "STR-1": "by analysis"}
    settle, brief = (Archive(report / f"flights/{name}/desktop/run.mcap") for name in ("settle", "brief"))
    error, time = np.linalg.norm(settle["error.sigma_BR"], axis=1), settle.series("error.sigma_BR").time
    assert found["PNT-1"]["margin"] == pytest.approx(0.05 - error[time >= 360].max(), rel=1e-12)
    assert found["PNT-2"]["margin"] == pytest.approx(0.1 - error.max(), rel=1e-12) and found["PNT-2"]["at"] == 0
    rates = np.linalg.norm(brief["error.omega_BR_B"], axis=1)
    assert found["RAT-1"]["margin"] == pytest.approx(np.radians(3) - rates.max(), rel=1e-12)
    assert brief.series("error.omega_BR_B").time[-1] == 60, "the signals of a requirement are recorded in all runs"
    assert found["RAT-1"]["unit"] == "rad/s" and found["STR-1"]["margin"] is None
    assert {(flight["scenario"], flight["error"]) for flight in whole["flights"]} == {("settle", ""), ("brief", "")}


def test_the_records_judged_again_give_the_same(report):
    required = Requirements(fledge.load(report.parents[1] / "missions/spinner"))
    for flight in results(report)[1]["flights"]:
        ids = [shown["id"] for shown in flight["shown"]]
        again = required.judge(Archive(report / flight["record"]), ids, flight["time"])
        assert [(outcome.verdict, outcome.margin, outcome.at) for outcome in again] == [
            (shown["verdict"], shown["margin"], shown["at"]) for shown in flight["shown"]]


def test_a_scenario_keeps_the_rate_at_which_it_records(report):
    assert np.diff(Archive(report / "flights/settle/desktop/run.mcap").series("error.sigma_BR").time).min() == 1


@pytest.mark.long("verifies a mission with mistakes")
def test_a_flight_that_fails_shows_what_was_decided_before_and_no_other_flight_suffers(here, capsys):
    write(here, scenarios=SCENARIOS.replace("sim.run(8 * minute)", "sim.run(8 * minute)\n        assert 0, 'a check'")
          .replace("sim.run(1 * s)", "import os; os._exit(7)"), requirements=REQUIREMENTS.replace(
              'shown_by=["brief"]', 'shown_by=["brief", "idle"]'))
    text = verify(capsys)
    assert "settle on desktop: failed: missions/spinner/scenarios.py, line 8: a check" in text
    assert "idle on desktop: failed: the process that flew it ended with code 7" in text
    found, _ = results(here / "verification/spinner")
    assert (found["PNT-1"]["verdict"], found["PNT-2"]["verdict"], found["RAT-1"]["verdict"]) == (
        "unknown", "violated", "unknown")
    assert of(verify(capsys), "flown") == {"settle on desktop", "idle on desktop"}, "those that failed fly again"


def test_the_verdict_of_a_requirement_is_the_worst_and_its_flight_that_of_the_least_margin():
    flown = [Flown(name, "desktop", 0, "") for name in "abcd"]
    row = Row("R", "", sentence="x", shown=[(flown[0], Shown("R", "holds", 2.0)), (flown[1], Shown("R", "holds", 1.0))])
    assert row.verdict == "holds" and row.decided[0] is flown[1]
    row.shown.append((flown[2], Shown("R", "unknown")))
    assert row.verdict == "unknown" and row.decided[0] is flown[2]
    row.shown.append((flown[3], Shown("R", "violated", -1.0)))
    assert row.verdict == "violated" and row.decided[0] is flown[3]
    row.shown, row.missing = row.shown[:1], flown[:1]
    assert row.verdict == "unknown"
    parent = Row("P", "", children=[row, Row("A", "", method="analysis")])
    assert parent.verdict == "unknown"
    parent.children = parent.children[1:]
    assert parent.verdict == "by analysis"
    assert Row("N", "").verdict == "not shown"


def test_parents_that_go_round_are_refused():
    rows = [Row("A", "", parent="B"), Row("B", "", parent="C", place="x.py, line 3"), Row("C", "", parent="B")]
    with pytest.raises(SetupError, match="x.py, line 3: the parents of B go round: B has the parent C has the parent B"
                       ):
        evidence.adopt(rows)


# --- repeated flights -------------------------------------------------------------------------------

@pytest.mark.long("verifies six times")
def test_a_flight_is_flown_again_if_anything_that_it_depends_on_has_changed(here, capsys):
    both = {"settle on desktop", "brief on desktop"}
    assert of(verify(capsys), "flown") == both
    again = verify(capsys)
    assert of(again, "before") == both and not of(again, "flown")
    assert of(verify(capsys, "--again"), "flown") == both
    shutil.rmtree(here / "verification/spinner/flights/brief")      # as if the command had been ended before
    text = verify(capsys)
    assert of(text, "before") == {"settle on desktop"} and of(text, "flown") == {"brief on desktop"}
    (here / "verification/spinner/flights/settle/desktop/run.mcap").unlink()
    (here / "verification/spinner/flights/brief/desktop/flight.json").write_text("{")
    (here / "verification/spinner/results.json").write_text("[")
    assert of(verify(capsys), "flown") == both
    assert of(verify(capsys, "--seed", "3"), "flown") == both
    (here / "missions/spinner/flight.py").open("a").write("# \n")
    assert of(verify(capsys, "--seed", "3"), "flown") == both
    (here / "missions/spinner/README.md").write_text("text")
    assert of(verify(capsys, "--seed", "3"), "before") == both


@pytest.mark.long("verifies several times")
def test_a_part_of_the_requirements_or_scenarios(here, capsys):
    text = verify(capsys, "--only", "PNT-1", code=0)
    assert of(text, "flown") == {"settle on desktop", "brief on desktop"}, "PNT-3 is a child of PNT-1"
    assert set(results(here / "verification/spinner")[0]) == {"PNT-1", "PNT-3"}
    assert "PNT-3" in verify(capsys, "--only", "PNT-1", "--strict")
    text = verify(capsys, "--scenario", "settle")
    assert of(text, "before") == {"settle on desktop"} and not of(text, "flown")
    assert results(here / "verification/spinner")[0]["RAT-1"]["verdict"] == "not shown"


@pytest.mark.long("verifies several times")
def test_the_report_names_what_differs_from_the_one_before(here, capsys):
    verify(capsys)
    write(here, REQUIREMENTS.replace("error < 0.05", "error < 0.04").replace("error < 0.1", "error < 3")
          .replace('"RAT-1", "It turns', '"RAT-2", "It turns').replace("The tank holds", "Both tanks hold"))
    verify(capsys, code=0)
    page = Page((here / "verification/spinner/report.html").read_text(encoding="utf-8"))
    for words in ("PNT-2 was violated, is holds", "PNT-1 its margin fell from", "RAT-2 is new: holds", "RAT-1 is gone",
                  "STR-1 its text was “The tank holds.”", "PNT-1 its formula was"):
        assert page.says(words), words


# --- targets ---------------------------------------------------------------------------------------

@pytest.mark.long("builds and flies on a target")
def test_a_target_shows_the_same_with_the_same_bits(here, capsys):
    text = verify(capsys, "--on", "desktop,linux", "--scenario", "brief")
    assert of(text, "flown") == {"brief on desktop", "brief on linux"}
    desktop, linux = results(here / "verification/spinner")[1]["flights"]
    assert (desktop["same"], linux["same"]) == (None, True) and linux["time"] == 60
    assert linux["shown"] == desktop["shown"] and len(linux["shown"]) == 3
    page = (here / "verification/spinner/report.html").read_text(encoding="utf-8")
    assert "brief on desktop, linux: " in page and "./fledge fly spinner brief --on linux" in page


@pytest.mark.long("builds for the board and counts branches")
@flies_on("leon3")
def test_the_coverage_on_the_board(here, capsys):
    write(here, scenarios=SCENARIOS.replace("30 * s", "2 * s"))
    verify(capsys, "--on", "leon3", "--scenario", "brief", "--coverage")
    folder = here / "verification/spinner"
    shares = results(folder)[1]["coverage"]
    assert set(shares) == {"PNT-2", "PNT-3", "RAT-1"} and 0 < shares["RAT-1"]["lines"] < shares["RAT-1"]["of_lines"]
    assert 0 < shares["RAT-1"]["branches"] < shares["RAT-1"]["of_branches"]
    info = coverage.read(folder / "coverage.info", [ROOT], folder)
    source = info["flight/control/mrp_feedback.c"]["lines"]
    lines = (ROOT / "flight/control/mrp_feedback.c").read_text().splitlines()
    ran = [lines[int(line) - 1] for line, count in source.items() if count]
    assert any("K" in line for line in ran) and not [name for name in info if not name.startswith(coverage.FOLDERS)]
    assert "flight/control/mrp_feedback.c" in (folder / "report.html").read_text(encoding="utf-8")


# --- files -----------------------------------------------------------------------------------------

def test_the_page_stands_alone_and_each_of_its_links_leads_somewhere(report):
    page = Page((report / "report.html").read_text(encoding="utf-8"))
    assert not {"script", "link", "iframe", "img"} & set(page.tags)
    assert not re.search(r"https?:", page.source)
    svg_ids = re.findall(r'\bid="([^"]+)"', page.source)
    assert len(svg_ids) == len(set(svg_ids))
    files = 0
    for link in page.links:
        if link.startswith("#"):
            assert link[1:] in svg_ids, link
        else:
            files += 1
            assert (report / unquote(link)).is_file(), link
    assert files >= 5 and str(report) not in page.source
    for words in ("1 of 5 violated", "It is never off by <b>much</b> & more.", "Pointing <&>", "parent SYS-1",
                  "children PNT-3", '"images", of course', "within 6 min norm(flight.tracking.error.sigma_BR) < 0.05",
                  "◇[0,360]□(norm(flight.tracking.error.sigma_BR) < 0.05)", "Scenarios that show no requirement: idle",
                  "Parents that no requirement defines: SYS-1, SYS-2", "./fledge run spinner settle",
                  "by analysis", "docs/tank.md", "seed 0"):
        assert page.says(words), words
    assert page.tags.count("figure") == 5       # each flight of each requirement


def test_junit_has_a_case_for_each_requirement_of_each_flight(report):
    top = read((report / "junit.xml").read_text(encoding="utf-8"))
    suites = {suite.get("name"): suite for suite in top}
    assert set(suites) == {"spinner.desktop.settle", "spinner.desktop.brief", "spinner.without_flight"}
    brief = suites["spinner.desktop.brief"]
    assert [brief.get(name) for name in ("tests", "failures", "errors", "skipped")] == ["3", "1", "1", "0"]
    cases = {case.get("name"): case for case in brief}
    assert "norm(flight.tracking.error.sigma_BR) < 0.1 at t = 0 s" in cases["PNT-2"].find("failure").get("message")
    assert cases["PNT-3"].find("error") is not None and cases["RAT-1"].find("system-out").text.startswith("margin ")
    skipped = suites["spinner.without_flight"].find("testcase[@name='STR-1']/skipped")
    assert skipped.get("message") == "docs/tank.md"


@pytest.mark.long("verifies three times more")
def test_the_table_that_is_written_is_read_without_a_difference(report, monkeypatch, capsys):
    monkeypatch.chdir(report.parents[1])
    shutil.copy(report / "requirements.csv", "given.csv")
    rows = list(csv.DictReader(io.StringIO(Path("given.csv").read_text(encoding="utf-8"))))
    assert rows[0]["rationale"] == 'For "images", of course.' and rows[1]["verdict"] == "violated"
    text = verify(capsys, "--requirements", "given.csv", "--out", "again")
    assert "differs" not in text
    rows[0]["text"], rows[1]["id"], rows[2]["parent"] = "Another text,\nof two lines", "SYS-1", "PNT-1 "
    rows[1]["parent"] = ""
    with open("given.csv", "w", encoding="utf-8") as file:
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        table.writerows(rows)
    text = verify(capsys, "--requirements", "given.csv", "--out", "again")
    assert text.count("  differs") == 3
    assert "differs  PNT-1 its text is “Another text,\nof two lines” in the CSV, “The body settles.” in" in text
    assert "differs  SYS-1 is in the CSV alone" in text and "differs  PNT-2 is in requirements.py alone" in text
    found, _ = results(Path("again"))
    assert found["SYS-1"]["verdict"] == "violated", "that of its children"


@pytest.mark.parametrize("text, words", [
    ("", "line 1: it has no column 'id'"), ("id;text\nA;b\n", "line 1: it has no column 'id'"),
    ("id,txt\n", "no column 'text'; did you mean 'txt'?"), ("id,text\n", "it has no requirements"),
    ("id,text\nA,b\n,c\n", "line 3: it has no id"), ("id,text\nA,b,c\n", "line 2: 3 cells below 2 heads"),
    ("id,text\nA,b\n\nA,c\n", "line 4: two requirements are called A; the first is in line 2"),
    ("id,text,method\nA,b,guess\n", "line 2: the method of A must be"), ("id,text\nA,\"b\n", "line 2"),
    (b"id,text\nA,\xff\n", "no text in UTF-8")])
def test_a_bad_table_is_refused_by_file_and_line(tmp_path, text, words):
    path = tmp_path / "given.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(Failure) as error:
        tables.read(path)
    assert str(error.value).startswith(str(path)) and words in str(error.value)


@pytest.mark.parametrize("arguments, words", [
    (["--only", "PNT-9"], "there is no requirement 'PNT-9'; did you mean 'PNT-"),
    (["--scenario", "setle"], "has no scenario 'setle'; did you mean 'settle'?"),
    (["--on", "vax"], "there is no target 'vax'"), (["--on", ","], "names no target"),
    (["--jobs", "0"], "--jobs must be >= 1"), (["--coverage"], "--coverage counts on leon3"),
    (["--requirements", "none.csv"], "none.csv: No such file")])
def test_a_wrong_command_line_is_refused_before_the_first_flight(here, capsys, arguments, words):
    assert words in verify(capsys, *arguments, code=2)
    assert not (here / "verification").exists()


@pytest.mark.parametrize("requirements, words", [
    ("", "has no requirements"), (REQUIREMENTS.replace("error < 0.05", "error < 1 * s"), "requirements.py, line 9"),
    (REQUIREMENTS.replace("sigma_BR", "sigma_XY"), "requirements.py, line 8"),
    (REQUIREMENTS.replace("PNT-2", "PNT-1"), "two requirements have the id PNT-1"),
    (REQUIREMENTS.replace('shown_by="brief"', 'shown_by="brevi"'), "has no scenario 'brevi'; did you mean 'brief'?")],
    ids=["none", "unit", "signal", "id", "scenario"])
def test_wrong_requirements_are_refused_before_the_first_flight(here, capsys, requirements, words):
    write(here, requirements)
    assert words in verify(capsys, code=2)
    assert not (here / "verification").exists()


def test_parents_that_go_round_in_a_mission_are_named(here, capsys):
    write(here, REQUIREMENTS.replace('parent="SYS-1")', 'parent="PNT-3")', 1))
    assert "requirements.py, line 9: the parents of PNT-1 go round" in verify(capsys, code=2)


# --- figures and coverage --------------------------------------------------------------------------

def test_a_thinned_line_keeps_its_ends_and_extremes():
    random = np.random.default_rng(1)
    for n in (5, 3000, 50_000):
        time, values = np.arange(n) * 0.5, random.normal(size=n).cumsum()
        values[n // 3] = np.nan
        t, v = figure.thinned(time, values)
        assert len(t) <= 4 * figure.POINTS and (np.diff(t) > 0).all()
        assert (t[0], t[-1]) == (time[0], time[-1])
        assert (np.nanmin(v), np.nanmax(v)) == (np.nanmin(values), np.nanmax(values))


def test_a_figure_has_the_limit_and_ids_of_its_own():
    signal = SimpleNamespace(text="norm(<x>)", event=None, field=None)
    comparison = SimpleNamespace(signal=signal, relation="<", limit=np.radians(2.0), unit="rad", measured=True,
                                 text="norm(<x>) < 2 deg")
    drawn = figure.draw(np.arange(10.0), np.radians(np.linspace(0.0, 1.5, 10)), comparison, 9.0, "holds")
    assert "&lt; 2 deg</text>" in drawn and "[deg]" in drawn and "norm(&lt;x&gt;)" in drawn
    assert drawn == figure.draw(np.arange(10.0), np.radians(np.linspace(0.0, 1.5, 10)), comparison, 9.0, "holds")
    marked = figure.with_ids(drawn, "a-")
    ids = re.findall(r'\bid="([^"]+)"', marked)
    assert ids and all(id_.startswith("a-") for id_ in ids)
    assert set(re.findall(r"url\(#([^)]+)\)", marked)) <= set(ids)
    assert figure.draw(np.zeros(0), np.zeros(0), comparison, None, "unknown") == ""


def test_a_figure_of_an_event_has_its_times_and_no_limit():
    signal = SimpleNamespace(text="flight.roll", event=("flight", "roll"), field=None)
    comparison = SimpleNamespace(signal=signal, relation="==", limit=1.0, unit="", measured=False,
                                 text="flight.roll fires")
    fired = np.array([0.0, 0, 1, 0, 0, 1, 0])
    drawn = figure.draw(np.arange(7.0), fired, comparison, None, "holds")
    lines = re.search(r'<g id="LineCollection_1">(.*?)</g>', drawn, re.DOTALL)[1]
    assert lines.count("<path") == 2 and "flight.roll" in drawn and "== 1" not in drawn


def test_coverage_is_joined_over_flights(tmp_path):
    (tmp_path / "flight").mkdir()
    (tmp_path / "flight/a.c").touch()
    head = f"TN:\nSF:{tmp_path}/flight/a.c\nFN:1,f\n"
    (tmp_path / "1.info").write_text(head + "BRDA:2,0,0,-\nBRDA:2,0,1,-\nDA:1,4\nDA:2,0\nDA:3,0\nDA:7,0\n"
                                     "end_of_record\nTN:\nSF:/elsewhere/b.c\nDA:1,1\nend_of_record\n")
    (tmp_path / "2.info").write_text(head + "BRDA:2,0,0,3\nBRDA:2,0,1,0\nDA:1,1\nDA:2,3\nDA:3,0\nDA:7,0\n"
                                     "end_of_record\n")
    first, second = (coverage.read(tmp_path / f"{i}.info", [tmp_path], tmp_path / "c") for i in (1, 2))
    assert list(first) == ["flight/a.c"] and coverage.share(first) == (1, 4, 0, 2)
    both = coverage.joined([first, second])
    assert both["flight/a.c"]["lines"] == {"1": 5, "2": 3, "3": 0, "7": 0} and coverage.share(both) == (2, 4, 1, 2)
    assert coverage.never(both["flight/a.c"]) == "3–7" and coverage.never(first["flight/a.c"]) == "2–7"
    assert first["flight/a.c"]["lines"]["2"] == 0, "those of a flight stay"
    (tmp_path / "3.info").write_text(coverage.lcov(both, tmp_path))
    assert coverage.read(tmp_path / "3.info", [tmp_path], tmp_path / "c") == both
