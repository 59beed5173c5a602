# SPDX-License-Identifier: Apache-2.0
"""`fledge verify --evidence` on a small mission: what was run, what was not, hashes against the files, clauses."""

import hashlib
import json

import pytest

from fledge import cli, prove, rules
from fledge.errors import Failure
from fledge.prove import eva
from fledge.report.report_test import Page
from fledge.verify import book
from fledge.verify.verify_test import mission

ALARM = prove.Finding("flight/control/mrp_feedback.c", 12, "update", "overflow", "x + 1 <= 9", "alarm")
TIMES = {"longest": [{"task": "gnc", "mode": "", "period": 0.5, "time": 0.01, "cycles": 800, "bound": 1000}]}


def result(name, *alarms):
    return prove.Result(name, f"flight/control/{name}.h", "any bits", "0" * 64, 1.5, 3, 40, 41, alarms,
                        (prove.Bound("flight/control/x.c", 7, "update", 4, "proved"),))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of a book, whose proofs are given and whose rules are those of flight/control."""
    folder = mission(tmp_path_factory.mktemp("book"))
    check = rules.check
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(eva, "version", lambda: "25.0")
        patch.setattr(prove, "prove", lambda names, *_: [
            result(name, *[ALARM] * (name == "MrpFeedback")) for name in names])
        patch.setattr(rules, "check", lambda tree, **more: check(tree, ["flight/control"], **more))
        assert cli.main(["verify", "spinner", "--evidence", "evidence"]) == 1, "PNT-2 is violated"
    return folder / "evidence"


def facts(folder):
    return json.loads((folder / book.FACTS).read_text())


def test_each_file_of_the_book_has_its_hash(written):
    files = facts(written)["files"]
    assert {"evidence.html", "proof.json", "rules.json", "report.html", "results.json", "requirements.csv",
            "flights/settle/desktop/run.mcap"} <= set(files)
    assert all(hashlib.sha256((written / name).read_bytes()).hexdigest() == digest for name, digest in files.items())
    there = {path.relative_to(written).as_posix() for path in written.rglob("*") if path.is_file()}
    assert there - set(files) <= {book.FACTS, ".lock"}


def test_what_was_not_run_stands_with_its_command(written):
    parts = {part["name"]: part for part in facts(written)["parts"]}
    assert {name: part["state"] for name, part in parts.items()} == {
        "requirements": "left", "traces": "left", "decisions": "not run", "target": "not run", "proof": "left",
        "rules": "shown", "bounds": "not run", "tests": "not run", "hashes": "shown"}
    assert parts["decisions"]["what"] == "./fledge verify spinner --evidence DIR --coverage mcdc"
    assert "alarms: 1 left" in parts["proof"]["what"] and parts["proof"]["tool"] == "Frama-C 25.0"
    text = (written / book.PAGE).read_text()
    assert "flight/control/mrp_feedback.c:12" in text and "./fledge test --all" in text


def test_a_clause_is_as_good_as_the_worst_evidence_for_it(written):
    states = {clause["number"]: clause["state"] for clause in facts(written)["clauses"]}
    assert states["SWE-061"] == "shown" and states["SWE-135"] == "left" and states["5.8.3.5"] == "not run"
    assert states["SWE-220"] == "not answered"
    assert {name for clause in book.CLAUSES for name in clause.parts} <= {
        part["name"] for part in facts(written)["parts"]}
    assert all(clause.parts or clause.note for clause in book.CLAUSES)


def test_the_page_needs_no_other_site_and_its_links_lead_to_what_is_there(written):
    page = Page((written / book.PAGE).read_text())
    for link in page.links:
        assert link[1:] in page.ids if link.startswith("#") else (written / link).is_file(), link


def test_the_proof_is_of_the_modules_that_the_mission_uses(written):
    names = {of["name"] for of in json.loads((written / "proof.json").read_text())}
    assert "MrpFeedback" in names and "OrbitFilter" not in names


def test_a_missing_tool_is_evidence_that_was_not_run(monkeypatch):
    monkeypatch.setattr(rules, "which", lambda _: None)
    part, check, rows = book.of_rules()
    assert (part.state, check, rows) == (book.NOT_RUN, None, []) and "apt-get install cppcheck" in part.what


def test_times_are_those_of_the_profile(tmp_path):
    path = tmp_path / book.TIMES
    path.parent.mkdir()
    path.write_text(json.dumps(TIMES))
    assert book.of_times(tmp_path, "m")[0].state == book.SHOWN
    path.write_text(json.dumps({"longest": [{**TIMES["longest"][0], "time": 0.6}]}))
    assert "beyond the period: gnc" in book.of_times(tmp_path, "m")[0].what
    path.write_text('{"tasks": []}')
    with pytest.raises(Failure, match=r"timing.json: this is no timing.json of fledge profile --longest"):
        book.of_times(tmp_path, "m")


def test_one_folder_is_named_once(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(mission(tmp_path))
    assert cli.main(["verify", "spinner", "--out", "a", "--evidence", "b"]) == 2
    assert "--out and --evidence both name the folder of the report" in capsys.readouterr().err
