# SPDX-License-Identifier: Apache-2.0
"""The two circles of tests: those that `./fledge test` runs each time, and the long ones, which run with --all; how
long they take, and what the last passes of CI have run.

    /usr/bin/python3 -m tests.circles                       the table, with the seconds of the last `./fledge test`
    /usr/bin/python3 -m tests.circles --slowest N           its N slowest cases
    /usr/bin/python3 -m tests.circles --others FOLDER...    how long the tests of the other folders take; keeps the
                                                            seconds of these, or of all
    /usr/bin/python3 -m tests.circles --pass COMMIT I WHAT  add a pass to .ci/passed: the commit up to which it checked
                                                            all, the tenth I of the long tests (or "all"), what else
    /usr/bin/python3 -m tests.circles --last                the commit of the last pass, its tenth, and how many passes
                                                            ago one was on other systems
    /usr/bin/python3 -m tests.circles --missed [I]          which long tests none of those passes has run, nor one now
                                                            of the tenth I

A long test has no seconds unless that run had it. Several tests run at once: their seconds add up to more than the
time of the run.
"""

import argparse
import contextlib
import io
import json
import os
import re
import sys
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest

from tests.tree import ROOT

BUILD = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release")
REPORT = BUILD / "tests/pytest/pytest.xml"
KEPT = BUILD / "seconds.json"           # of each room's tests: of their last run
PASSED = ROOT / ".ci/passed"
PASSES = 10         # .ci/passed keeps so many; each long test shall run in one of them

HEAD = """\
# The last passes of .ci/run, the newest first: the commit up to which all is checked, which tenth of the long tests ran
# (or "all"), and what else did. The next change commits this file. Below, of the newest pass: the seconds of the quick
# tests of each room, in C and C++ and in Python.
"""


class Case(NamedTuple):
    folder: str
    name: str               # as in a report: dotted file, ::, case
    why: str | None         # it is long
    share: int | None = None    # the tenth of the passes that runs it; None: a long test that is in no share


def tenth_of(item: pytest.Item, shares: int = PASSES) -> int | None:
    """The share of the long tests to which one belongs; None: to none, and it runs with all."""
    if not all(mark.kwargs.get("share", True) for mark in item.iter_markers("long")):
        return None
    return zlib.crc32(item.nodeid.encode()) % shares


def share_of(text: str) -> tuple[int, int]:
    """I, modulo N, and N of the share "I/N"."""
    if not re.fullmatch("[0-9]+/[1-9][0-9]*", text):
        raise argparse.ArgumentTypeError(f"takes I/N, such as 0/5; found '{text}'")
    share, shares = map(int, text.split("/"))
    return share % shares, shares


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
    return Case(path.parent.as_posix(), f"{'.'.join(words)}::{item.name}", mark.args[0] if mark else None,
                tenth_of(item))


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
        sys.exit(f"fledge: pytest collects no tests:\n{printed.getvalue()[-3000:]}")
    return collector.cases


class Seconds(NamedTuple):
    whole: float
    setup: float        # of it, before the test itself: with the fixtures that it is first to use
    long: bool = False
    skipped: bool = False


def seconds(report: Path) -> dict[str, Seconds]:
    """Case -> its time in a report in JUnit's format."""
    try:
        root = ElementTree.parse(report).getroot()
    except (OSError, ElementTree.ParseError):       # none was written, or not to its end
        return {}
    times = {}
    for case in root.iter("testcase"):
        known = {prop.get("name"): prop.get("value", "") for prop in case.iter("property")}
        name = re.sub(r"@\w+$", "", case.get("name", ""))      # the group, which pytest-xdist adds
        times[f"{case.get('classname')}::{name}"] = Seconds(
            float(case.get("time", 0)), float(known.get("setup", 0)), "long" in known, case.find("skipped") is not None)
    return times


# --- rooms -----------------------------------------------------------------------------------------

def room_of(name: str) -> str:
    """The folder of the house of a dotted name, or of a path: flight, or python/fledge/mission."""
    parts = re.split("[./]", name)
    inside = parts[:2] == ["python", "fledge"] and (ROOT / "/".join(parts[:3])).is_dir()
    return "/".join(parts[:3 if inside else 2]) if parts[0] == "python" else parts[0]


def by_room(folder: Path) -> dict[str, list[float]]:
    """Room -> the seconds of its quick tests in C and C++, and in Python, in the reports of a run."""
    rooms: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
    for name, time in seconds(folder / "ctest/ctest.xml").items():
        rooms[room_of(name.partition("::")[2])][0] += time.whole
    for name, time in seconds(folder / "pytest/pytest.xml").items():
        rooms[room_of(name.partition("::")[0])][1] += time.whole * (not time.long)
    return rooms


def kept() -> dict[str, list[float]]:
    """The seconds of each room: of its last run here, or of the newest pass of CI."""
    lines = PASSED.read_text(encoding="utf-8").splitlines() if PASSED.exists() else []
    rooms = {line.split()[0]: [float(word) for word in line.split()[1:]] for line in lines
             if re.fullmatch(r"\S+ [0-9]+ [0-9]+", line)}
    try:
        here = json.loads(KEPT.read_text(encoding="utf-8"))
    except (OSError, ValueError):       # there is none, or it was not written to its end
        here = {}
    return {room: times for room, times in {**rooms, **here}.items()
            if (ROOT / room).is_dir() and not (ROOT / room).is_symlink()}


def keep(rooms: dict[str, list[float]]) -> None:
    """Remember the seconds of these rooms."""
    KEPT.write_text(json.dumps({**kept(), **rooms}), encoding="utf-8")


def is_below(room: str, folders: list[str]) -> bool:
    return any(f"{room}/".startswith(f"{folder}/") for folder in folders)


def others(folders: list[str], rooms: dict[str, list[float]]) -> str:
    """How long the tests of the rooms take that are in none of the folders."""
    left = sorted(((sum(times), room) for room, times in rooms.items()
                   if not is_below(room, folders)), reverse=True)
    if not left:
        return "fledge: how long the tests of the other folders take is not known here yet: ./fledge test\n"
    minutes = sum(time for time, _ in left) / (os.cpu_count() or 1) / 60
    return (f"fledge: the other folders, {minutes:.0f} min here: " +
            ", ".join(f"{room} {time:.0f} s" for time, room in left if time >= 0.5) + " of one processor\n")


# --- passes of CI ----------------------------------------------------------------------------------

def passes(file: Path | None = None) -> list[list[str]]:
    """[commit, share, turns] of each pass in .ci/passed, the newest first."""
    file = file or PASSED
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return [line.split(" ", 2) for line in lines if re.match("([0-9a-f]{40}|none) ", line)]


def last() -> str:
    """For .ci/run: the commit of the last pass, its tenth, and how many passes came after the last on other systems;
    "none", -1 and 9 where there is none."""
    found = passes()
    tenths = [share for _, share, *_ in found if share.isdigit()]
    systems = [i for i, words in enumerate(found) if "systems" in " ".join(words[2:])]
    return f"{found[0][0] if found else 'none'} {tenths[0] if tenths else -1} {systems[0] if systems else 9}"


def add_pass(commit: str, share: str, what: str) -> None:
    """Write a pass before those that were kept, and the seconds of its run."""
    lines = [" ".join(words) for words in [[commit, share, what], *passes()][:PASSES]]
    times = [f"{room} {a:.0f} {b:.0f}" for room, (a, b) in sorted((by_room(BUILD / "tests") or kept()).items())]
    PASSED.write_text(HEAD + "\n".join([*lines, "", *times]) + "\n", encoding="utf-8")


def missed(cases: list[Case], shares: list[str]) -> str:
    """Which long tests are in none of these shares, by the names that they have now."""
    left = [case for case in cases if case.why is not None and "all" not in shares and str(case.share) not in shares]
    tenths = Counter(case.share for case in left if case.share is not None)
    never = [case.name for case in left if case.share is None]
    parts = [f"the {count} of the tenth {share}" for share, count in sorted(tenths.items())]
    parts += [f"those that are in no share, for which CI has no time: {', '.join(never)}"] if never else []
    if not parts:
        return f"fledge: each long test has run in one of the last {len(shares)} passes\n"
    return f"fledge: long tests that none of the last {len(shares)} passes ran: {'; '.join(parts)}\n"


# --- tables ----------------------------------------------------------------------------------------

def table(cases: list[Case], times: dict[str, Seconds]) -> str:
    """Folder, quick cases, their seconds and those of them for set-ups, long cases and their seconds."""
    folders: dict[str, tuple[list[Case], list[Case]]] = defaultdict(lambda: ([], []))
    for case in cases:
        folders[case.folder][case.why is not None].append(case)
    lines = [f"{'folder':36} {'quick':>6} {'s':>7} {'set-ups':>7} {'long':>6} {'s':>7}"]
    none, total = Seconds(0.0, 0.0), [0, 0.0, 0.0, 0, 0.0]
    for folder, (quick, long) in sorted(folders.items()):
        row = [len(quick), sum(times.get(case.name, none).whole for case in quick),
               sum(times.get(case.name, none).setup for case in quick),
               len(long), sum(times.get(case.name, none).whole for case in long)]
        total = [a + b for a, b in zip(total, row)]
        lines.append("{:36} {:6} {:7.1f} {:7.1f} {:6} {:7.1f}".format(folder, *row))
    return "\n".join([*lines, "{:36} {:6} {:7.1f} {:7.1f} {:6} {:7.1f}".format("all", *total)]) + "\n"


def slowest(times: dict[str, Seconds], count: int) -> str:
    """The cases that take longest, with the seconds of their set-ups."""
    longest = sorted(times.items(), key=lambda item: -item[1].whole)[:count]
    rows = [f"{time.whole:8.1f} {time.setup:8.1f}  {name}" for name, time in longest]
    return "\n".join([f"{'s':>8} {'set-up':>8}  case", *rows]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(prog="circles", description=__doc__.splitlines()[0])
    parser.add_argument("--slowest", type=int, metavar="N")
    parser.add_argument("--others", nargs="*", metavar="FOLDER")
    parser.add_argument("--pass", nargs=3, dest="passed", metavar=("COMMIT", "I", "WHAT"))
    parser.add_argument("--last", action="store_true")
    parser.add_argument("--missed", nargs="?", const="", metavar="I")
    options = parser.parse_args()
    if options.others is not None:
        keep({room: times for room, times in by_room(BUILD / "tests").items()
              if not options.others or is_below(room, options.others)})
        print(others(options.others, kept()) if options.others else "", end="")
    elif options.last:
        print(last())
    elif options.passed:
        add_pass(*options.passed)
    elif options.missed is not None:
        shares = [options.missed] * bool(options.missed) + [share for _, share, *_ in passes()]
        print(missed(cases(), shares[:PASSES]), end="")
        if skipped := [name for name, time in seconds(REPORT).items() if time.long and time.skipped]:
            print(f"fledge: long tests that the last run has skipped: {', '.join(skipped)}")
    elif options.slowest:
        print(slowest(seconds(REPORT), options.slowest), end="")
    else:
        print(table(cases(), seconds(REPORT)), end="")
        parts = BUILD / "tests/parts.json"
        if parts.exists():
            print("of the last run: " + ", ".join(f"{part} {time:.0f} s" for part, time in json.loads(
                parts.read_text(encoding="utf-8")).items()))


if __name__ == "__main__":
    main()
