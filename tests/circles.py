# SPDX-License-Identifier: Apache-2.0
"""The two circles of tests: those that `./fledge test` runs each time, and the long ones, which run with --all.

    /usr/bin/python3 -m tests.circles [REPORT]      the table, with the seconds of a report of pytest

The report is that of the last `./fledge test` by default. A long test has no seconds unless that ran it.
"""

import contextlib
import io
import os
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest

from tests.tree import ROOT

REPORT = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release") / "tests/pytest.xml"


class Case(NamedTuple):
    folder: str
    name: str               # as in a report: dotted file, ::, case
    why: str | None         # it is long


def long_after(count: int, values: Iterable, why: str) -> list:
    """Values for `parametrize`, of which the first `count` run each time and the others are long. A tuple is the values
    of several arguments."""
    sets = [value if hasattr(value, "marks") else pytest.param(*(value if isinstance(value, tuple) else (value,)))
            for value in values]
    return [*sets[:count], *(case._replace(marks=[*case.marks, pytest.mark.long(why)]) for case in sets[count:])]


def case(item: pytest.Item) -> Case:
    path = item.path.relative_to(ROOT)
    mark = item.get_closest_marker("long")
    words = [*path.with_suffix("").parts, *item.nodeid.split("::")[1:-1]]
    return Case(path.parent.as_posix(), f"{'.'.join(words)}::{item.name}", mark.args[0] if mark else None)


class Collector:
    cases: list[Case] = []

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        self.cases = [case(item) for item in items]


def cases() -> list[Case]:
    """All that pytest collects, long ones too."""
    collector = Collector()
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        code = pytest.main(["--collect-only", "-q", "-p", "no:cacheprovider", "--rootdir", str(ROOT), "-c",
                            str(ROOT / "pytest.ini")], plugins=[collector])
    if code:
        sys.exit(f"fledge: pytest collects no tests:\n{printed.getvalue()}")
    return collector.cases


def seconds(report: Path) -> dict[str, float]:
    """Case -> its time in a report in JUnit's format."""
    if not report.exists():
        return {}
    return {f"{case.get('classname')}::{case.get('name')}": float(case.get("time", 0))
            for case in ElementTree.parse(report).getroot().iter("testcase")}


def table(cases: list[Case], times: dict[str, float]) -> str:
    """Folder, quick cases and their seconds, long cases and their seconds, and why these are long."""
    folders: dict[str, tuple[list[Case], list[Case]]] = defaultdict(lambda: ([], []))
    for case in cases:
        folders[case.folder][case.why is not None].append(case)
    lines = [f"{'folder':36} {'quick':>6} {'s':>7} {'long':>6} {'s':>7}"]
    total = [0, 0.0, 0, 0.0]
    for folder, groups in sorted(folders.items()):
        row = [x for group in groups for x in (len(group), sum(times.get(case.name, 0.0) for case in group))]
        total = [a + b for a, b in zip(total, row)]
        lines.append("{:36} {:6} {:7.1f} {:6} {:7.1f}".format(folder, *row))
    return "\n".join([*lines, "{:36} {:6} {:7.1f} {:6} {:7.1f}".format("all", *total)]) + "\n"


if __name__ == "__main__":
    print(table(cases(), seconds(Path(sys.argv[1]) if sys.argv[1:] else REPORT)), end="")
