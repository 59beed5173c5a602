# SPDX-License-Identifier: Apache-2.0
"""Results as the XML of JUnit, which Jenkins, GitLab and others show."""
from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

from fledge.errors import printable

FAILURE, ERROR, SKIPPED = "failure", "error", "skipped"


class Case(NamedTuple):
    """A test case. kind: FAILURE, ERROR, SKIPPED, or "" where it passed; text: why, or what it put out"""
    name: str
    kind: str = ""
    text: str = ""


class Suite(NamedTuple):
    """Test cases that ran together. name: also the class of its cases; wall: [s] that they took"""
    name: str
    wall: float
    cases: Sequence[Case]


def document(title: str, suites: Iterable[Suite]) -> str:
    """The text of a file. Each case took the same share of its suite's time."""
    top = ElementTree.Element("testsuites", name=_legal(title))
    for suite in suites:
        of_suite = ElementTree.SubElement(top, "testsuite", name=_legal(suite.name), time=f"{suite.wall:.3f}",
                                          tests=str(len(suite.cases)))
        for kind, plural in ((FAILURE, "failures"), (ERROR, "errors"), (SKIPPED, "skipped")):
            of_suite.set(plural, str(sum(case.kind == kind for case in suite.cases)))
        for case in suite.cases:
            text = _legal(case.text)
            of_case = ElementTree.SubElement(of_suite, "testcase", classname=_legal(suite.name), name=_legal(case.name),
                                             time=f"{suite.wall / len(suite.cases):.6f}")
            if case.kind:       # Jenkins shows the message, GitLab the text
                ElementTree.SubElement(of_case, case.kind, message=text.partition("\n")[0]).text = text
            else:
                ElementTree.SubElement(of_case, "system-out").text = text
    ElementTree.indent(top)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(top, encoding="unicode") + "\n"


def _legal(text: str) -> str:
    """Without what XML cannot hold."""
    return re.sub("[\ufffe\uffff]", "\ufffd", printable(text))
