# SPDX-License-Identifier: Apache-2.0
"""The decisions of flight code, as clang counts them in a build of its own (cmake/FledgeObserved.cmake): which
conditions have been true and false, and of which a pair of evaluations shows that they decide: both differ in this
condition alone, as far as it was evaluated, and in the result (modified condition/decision coverage, MC/DC).

    build/release/python_mcdc/_core*.so     counts what runs; write() puts the counts of a process into a file
    report = read(counts, objects, {root: "flight/"})
    report["flight/guidance/keep_out.c"].open   # the conditions that nothing has shown to decide
    {"line": 57, "column": 9, "text": "x > 0", "missing": "never false", "reason": ""}

A condition that cannot decide has a comment behind it, or before its statement, as `/* undecided: reason */`.
"""
from __future__ import annotations

import ctypes
import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fledge.disk import ROOT
from fledge.errors import Failure
from fledge.verify.coverage import FOLDERS

KIND = "mcdc"
COUNTS = "decisions.profraw"        # begins the names of the counts of a flight
VERSIONS = ("19", "18")             # of LLVM, as in cmake/by_clang.sh
UNDECIDED = re.compile(r"/\* undecided: (.*?)\*/", re.S)
BLANK = re.compile(r"/\*.*?\*/|//[^\n]*", re.S)

OF_SEVERAL = 6                      # the kind of a branch that is a condition of a decision that has several
Place = tuple[int, int, int, int]       # first line and column, last line and column behind it


@dataclass
class Condition:
    """missing: what has not been seen, "" if it decides; reason: why it cannot be seen, as the source says"""
    line: int
    column: int
    text: str
    missing: str = ""
    reason: str = ""


@dataclass
class File:
    """The decisions of a source."""
    conditions: list[Condition] = field(default_factory=list)

    @property
    def decided(self) -> int:
        return sum(not condition.missing for condition in self.conditions)

    @property
    def reasoned(self) -> list[Condition]:
        """Those that have not decided, with a reason."""
        return [condition for condition in self.conditions if condition.missing and condition.reason]

    @property
    def open(self) -> list[Condition]:
        """Those that have not decided, without one."""
        return [condition for condition in self.conditions if condition.missing and not condition.reason]

    @property
    def stale(self) -> list[Condition]:
        """Those that have decided all the same: where a comment is about none that has not."""
        return [condition for condition in self.conditions if condition.reason and not condition.missing]


def total(files: Mapping[str, File]) -> File:
    return File([condition for file in files.values() for condition in file.conditions])


def closed(files: Mapping[str, File], folders: Iterable[str] = ("",)) -> bool:
    """Whether each condition of these folders has decided, or has a reason why it cannot. Raises Failure where one has
    none."""
    good = True
    for folder in folders:
        inside = [file for name, file in files.items() if f"{name}/".startswith(folder and folder.rstrip("/") + "/")]
        if not inside:
            raise Failure(f"test: --strict: no condition is in {folder}; take one of --table")
        good &= not any(file.open or file.stale for file in inside)
    return good


def facts(files: Mapping[str, File]) -> dict[str, Any]:
    """As JSON: name -> {"conditions", "decided", "undecided": [{"line", "column", "text", "missing", "reason"}]}."""
    return {name: {"conditions": len(file.conditions), "decided": file.decided,
                   "undecided": [vars(condition) for condition in file.conditions if condition.missing]}
            for name, file in sorted(files.items())}


def lines(files: Mapping[str, File], each: bool = True) -> list[str]:
    """For a terminal: the sum, and that of each source with conditions that have not decided; each: name them."""
    def sums(file: File) -> str:
        return ", ".join([f"{file.decided} of {len(file.conditions)} conditions have decided",
                          *[f"{len(file.reasoned)} cannot, with reason"] * bool(file.reasoned),
                          *[f"{len(file.open)} left"] * bool(file.open)])

    rows = [f"decisions: {sums(total(files))}"]
    for name, file in sorted(files.items()):
        if file.open or file.stale:
            rows.append(f"  {name}: {sums(file)}")
            rows += [f"    line {condition.line}: {condition.text}: {condition.missing}"
                     for condition in file.open if each]
            rows += [f"    line {condition.line}: {condition.text}: decides, and has a reason why not"
                     for condition in file.stale if each]
    return rows


def table(files: Mapping[str, File]) -> list[str]:
    """The sums of folders, in Markdown."""
    folders: dict[str, dict[str, File]] = {}
    for name, file in sorted(files.items()):
        parts = name.split("/")
        folders.setdefault("/".join(parts[:2 if parts[0] == "flight" else 1][:len(parts) - 1]), {})[name] = file
    sums = {f"`{folder}`": total(inside) for folder, inside in folders.items()} | {"all": total(files)}
    return ["| folder | conditions | have decided | with a reason | left |", "|---|---:|---:|---:|---:|",
            *[f"| {name} | {len(file.conditions):,} | {file.decided:,} | {len(file.reasoned)} | {len(file.open)} |"
              for name, file in sums.items()]]


# --- counts ----------------------------------------------------------------------------------------

def objects() -> list[Path]:
    """What this process has loaded that counts: the extension and the project's libraries."""
    from fledge.objects import project

    return [path for path in project.files() if hasattr(ctypes.CDLL(str(path)), "fledge_observed_write")]


def write(folder: Path) -> None:
    """Write the counts of this process into a folder: a file of each of objects()."""
    for i, path in enumerate(objects()):
        file = folder / f"{COUNTS}{i}"
        file.unlink(missing_ok=True)
        if ctypes.CDLL(str(path)).fledge_observed_write(os.fsencode(file)):
            raise Failure(f"{file}: the counts of decisions cannot be written", 1)


def read(counts: Sequence[Path], of: Sequence[Path], roots: Iterable[Path], whole: bool = False) -> dict[str, File]:
    """Name -> decisions, of the flight code below these roots. counts: files of write(), or of programs; of: the
    objects and programs that wrote them; whole: sources, too, of which nothing ran. Raises Failure without LLVM."""
    profdata, cov = tool("llvm-profdata"), tool("llvm-cov")
    with TemporaryDirectory() as folder:
        joined = Path(folder, "joined")
        _run([profdata, "merge", "-o", joined, *counts])
        objects_ = [word for path in of[1:] for word in ("-object", str(path))]
        text = _run([cov, "export", "-instr-profile", joined, of[0], *objects_])
    return decisions(json.loads(text)["data"][0]["functions"], [root.resolve() for root in roots], whole)


def has_clang() -> bool:
    """Whether there is a compiler that counts what flight code does."""
    return any(shutil.which(f"clang-{version}") for version in VERSIONS)


def tool(name: str) -> str:
    for version in VERSIONS:
        if found := shutil.which(f"{name}-{version}"):
            return found
    raise Failure(f"decisions are counted by clang, and there is no {name}-{VERSIONS[0]}: apt-get install "
                  f"llvm-{VERSIONS[0]} clang-{VERSIONS[0]} libclang-rt-{VERSIONS[0]}-dev", 1)


def _run(words: Sequence[str | Path]) -> str:
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise Failure(f"{Path(words[0]).name} failed: {done.stderr.strip()}", 1)
    return done.stdout


# --- what they say ---------------------------------------------------------------------------------

def decisions(functions: Sequence[Mapping[str, Any]], roots: Sequence[Path], whole: bool) -> dict[str, File]:
    """Of the functions of `llvm-cov export`. An inline function counts once, over all sources that have it: what one
    of them shows is shown. Of a header, only functions that ran count, of a source that ran all of them."""
    ways: dict[tuple[str, Place], list[int]] = {}       # how often each condition was true and false
    pairs: dict[tuple[str, Place], bool] = {}           # whether each condition of several has a pair
    ran: set[str] = set()
    used: dict[tuple[str, Place], bool] = {}            # whether the function of a condition ran
    for function in functions:
        names = [_name(Path(file), roots) for file in function["filenames"]]
        if function["count"]:
            ran.add(names[0])
        branches: dict[int, set[Place]] = {}     # that are conditions of several
        for a, b, c, d, true, false, file, _, kind in function["branches"]:
            place = (a, b, c, d)
            if kind == OF_SEVERAL:
                branches.setdefault(file, set()).add(place)
            seen = ways.setdefault((names[file], place), [0, 0])
            seen[0] += true
            seen[1] += false
            used[names[file], place] = used.get((names[file], place), False) or function["count"] > 0
        # Innermost first, for a condition may have a decision within. In which file a record lies, it does not say.
        for a, b, c, d, _, _, shown, *_ in sorted(function["mcdc_records"], key=lambda m: (m[2] - m[0], m[3] - m[1])):
            for file, places in branches.items():
                inner = sorted(place for place in places if (a, b) <= place[:2] and place[2:] <= (c, d))
                if len(inner) == len(shown):
                    places.difference_update(inner)
                    for place, pair in zip(inner, shown):
                        pairs[names[file], place] = pairs.get((names[file], place), False) or pair
                    break
    files: dict[str, File] = {}
    texts: dict[str, list[str]] = {}
    for (name, place), (true, false) in sorted(ways.items()):
        if not name or not whole and not (used[name, place] if name.endswith(".h") else name in ran):
            continue
        if name not in texts:
            path = next(path for root in roots if (path := root / name).exists())
            texts[name] = path.read_text(encoding="utf-8").splitlines()
        text = _text(texts[name], place)
        if re.search(r"\bswitch \($", texts[name][place[0] - 1][:place[1] - 1]):
            text = f"default of {text}"     # a switch that has none: its value is no case
        files.setdefault(name, File()).conditions.append(Condition(
            place[0], place[1], text, _missing(text, true, false, pairs.get((name, place), True))))
    for name, file in files.items():
        for reason, lines_ in _reasons(texts[name]):
            covered = [condition for condition in file.conditions if condition.line in lines_]
            # A comment is about those of its statement that do not decide; about all, if all decide.
            for condition in [condition for condition in covered if condition.missing] or covered:
                condition.reason = reason
    return files


def _missing(text: str, true: int, false: int, pair: bool) -> str:
    if re.match(r"case\b|default\b", text):
        return "" if true else "never taken"
    if not true and not false:
        return "never evaluated"
    if not true or not false:
        return "never true" if false else "never false"
    return "" if pair else "true and false, and no two evaluations differ in it alone"


def _text(lines: Sequence[str], place: Place) -> str:
    a, b, c, d = place
    part = list(lines[a - 1:c])
    rest, part[-1] = part[-1][d - 1:], part[-1][:d - 1]
    part[0] = part[0][b - 1:]
    if word := re.match(r"\w*", rest):      # a macro, of which clang names the beginning alone
        part[-1], rest = part[-1] + word[0], rest[word.end():]
    if rest.startswith("("):
        depth = 0
        for at, letter in enumerate(rest):
            depth += (letter == "(") - (letter == ")")
            if not depth:
                part[-1] += rest[:at + 1]
                break
    return " ".join(BLANK.sub(" ", "\n".join(part)).split())


def _reasons(lines: Sequence[str]) -> list[tuple[str, range]]:
    """(reason, lines that it is about) of each such comment: where it stands behind something, and the statement after
    a comment that stands alone."""
    text = "\n".join(lines)
    reasons = []
    for match in UNDECIDED.finditer(text):
        first, last = (text.count("\n", 0, at) + 1 for at in match.span())
        if lines[first - 1].startswith("/*", len(lines[first - 1]) - len(lines[first - 1].lstrip())):
            last = next((line for line in range(last + 1, len(lines)) if lines[line - 1].rstrip()[-1:] in (";", "{")),
                        last + 1)
        reasons.append((" ".join(match[1].split()), range(first, last + 1)))
    return reasons


def _name(source: Path, roots: Sequence[Path]) -> str:
    """The name of a source of flight; "" of others: tests and what they share."""
    for root in roots:
        if source.is_relative_to(root):
            name = source.relative_to(root).as_posix()
            flies = name.startswith(FOLDERS) or root != ROOT
            return name if flies and source.suffix in (".c", ".h") and "/testing/" not in name else ""
    return ""
