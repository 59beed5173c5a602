# SPDX-License-Identifier: Apache-2.0
"""JUnit's XML has the structure that a CI reads."""
import re
from xml.etree import ElementTree

import pytest

from fledge import cli
from fledge.junit import ERROR, FAILURE, SKIPPED, Case, Suite, document
from fledge.montecarlo import Campaign, report

KINDS = {FAILURE: "failures", ERROR: "errors", SKIPPED: "skipped"}


def read(text):
    """The root of a document, whose structure is that of https://github.com/jenkinsci/xunit-plugin (junit-10.xsd)."""
    top = ElementTree.fromstring(text)
    assert top.tag == "testsuites" and {suite.tag for suite in top} <= {"testsuite"}
    for suite in top:
        assert set(suite.attrib) == {"name", "time", "tests", *KINDS.values()} and suite.get("name")
        assert float(suite.get("time")) >= 0 and int(suite.get("tests")) == len(suite)
        for kind, plural in KINDS.items():
            assert int(suite.get(plural)) == len(suite.findall(f"testcase/{kind}"))
        for case in suite:
            assert case.tag == "testcase" and set(case.attrib) == {"name", "classname", "time"} and case.get("name")
            assert case.get("classname") == suite.get("name") and float(case.get("time")) >= 0
            result, = case
            assert result.tag in (*KINDS, "system-out")
            assert set(result.attrib) == ({"message"} if result.tag in KINDS else set())
    return top


def test_any_text_is_legal():
    """All characters of Unicode, but halves of pairs, which a text of UTF-8 cannot have."""
    every = "".join(chr(point) for point in range(0x110000) if not 0xd800 <= point < 0xe000)
    odd = "\0\x1b\x7f\ufffe\uffff <&>\"'"
    suite, = read(document(odd, [Suite(odd, 3.0, [Case(odd, FAILURE, f"first\n{every}"), Case("b", "", odd),
                                                  Case("c", SKIPPED, odd)])]))
    assert suite[0][0].get("message") == "first" and suite[0][0].text.startswith("first\n")
    assert [case.get("time") for case in suite] == ["1.000000"] * 3
    assert len(read(document("none", []))) == 0


def heavy(d):
    d.duration, d.every = 2, 1
    d["world.craft.mass"] = d.normal(0.3, 1)
    error = d.retain("flight.tracking.error.sigma_BR")
    d.check(error.norm() < 0.5, message="it points")


def test_runs_and_requirements_of_a_campaign_are_cases():
    result = Campaign("nadir_spin", heavy).fly(8, seed=1, progress=lambda *_: None)
    runs, required = read(report.junit(result, report.summary(result, "fly {}".format), 4.0, "fly {}".format))
    assert [case.get("name") for case in runs] == [f"run {i}" for i in range(8)]
    for i, case in enumerate(runs):
        if i in result.failures:
            assert case[0].tag == (FAILURE if result.complete[i] else ERROR)
            assert case[0].text == f"{result.failures[i]}\nfly {i}" and case[0].get("message") in result.failures[i]
        else:
            assert case[0].tag == "system-out"
    assert {case[0].tag for case in runs} >= {ERROR} and runs.get("time") == "4.000"
    assert re.fullmatch(r"it points: held in \d of \d runs", required[0][0].text)
    few = report.junit(result, {**report.summary(result, str), "requirements": []}, 1.0, str)
    assert len(read(few)) == 1


@pytest.mark.long("draws the figures of a campaign")
def test_the_command_writes_them(tmp_path, capsys):
    file = tmp_path / "ci" / "runs.xml"
    words = ["montecarlo", "nadir_spin", "--junit", str(file)]
    assert cli.main([*words, "--runs", "2", "--out", str(tmp_path / "out")]) == 0
    assert str(file) in capsys.readouterr().out
    assert len(read(file.read_text(encoding="utf-8"))[0]) == 2
    assert cli.main([*words, "--only", "2"]) == 2
    assert "--junit is for --runs" in capsys.readouterr().err
