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
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
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

JOINED = re.compile(r"[\s()!\\]*(&&|\|\|)[\s()!\\]*")

EXPANSION = 1                       # the kind of a region where a macro is used
OF_SEVERAL = 6                      # the kind of a branch that is a condition of a decision that has several
Place = tuple[int, int, int, int]       # first line and column, last line and column behind it
Places = tuple[Place, ...]          # of a condition: in its source, then in the macro used there, and so on


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
    """Of the functions of `llvm-cov export`. A condition in a macro counts wherever the macro is used. An inline
    function counts once, over all sources that have it: what one of them shows is shown. Of a header, only functions
    that ran count, of a source that ran all of them."""
    found: dict[tuple[Path, Places, int], _Seen] = {}
    ran: set[Path] = set()
    sources = _Sources()
    for function in functions:
        if function["count"]:
            ran.add(Path(function["filenames"][0]))
        alike: Counter[tuple[Path, Places]] = Counter()     # clang places what a macro's argument holds at its name
        for leaf in _leaves(function, sources):
            alike[leaf.source, leaf.places] += 1
            seen = found.setdefault((leaf.source, leaf.places, alike[leaf.source, leaf.places]), _Seen(leaf))
            seen.true += leaf.true
            seen.false += leaf.false
            seen.pair = seen.pair or leaf.pair
            seen.used |= function["count"] > 0
    files: dict[str, File] = {}
    texts: dict[str, list[str]] = {}
    for (source, places, _), seen in sorted(found.items(), key=lambda item: item[0]):
        name = _name(source, roots)
        if not name or not whole and not (seen.used if name.endswith(".h") else source in ran):
            continue
        texts[name] = lines_ = sources[source]
        line, column, *_ = places[0]
        text = _text(lines_, places[0])
        if len(places) > 1:
            text = f"{_text(sources[seen.leaf.text_in], places[-1])} in {text}"
        elif re.search(r"\bswitch \($", lines_[line - 1][:column - 1]):
            text = f"default of {text}"     # a switch that has none: its value is no case
        files.setdefault(name, File()).conditions.append(
            Condition(line, column, text, _missing(text, seen.true, seen.false, seen.pair)))
    for name, file in files.items():
        for reason, lines_of in _reasons(texts[name]):
            covered = [condition for condition in file.conditions if condition.line in lines_of]
            # A comment is about those of its statement that do not decide; about all, if all decide.
            for condition in [condition for condition in covered if condition.missing] or covered:
                condition.reason = reason
    return files


@dataclass(eq=False)
class _Leaf:
    """A condition of one function."""
    true: int
    false: int
    several: bool                   # one of several, of whose pairs clang keeps a record
    at: dict[int, Places]           # number of the file where it stands, or a macro that holds it -> places from there
    source: Path                    # the last of these files: that of the function
    text_in: Path                   # the first: where the condition itself is written
    pair: bool | None = True        # None: nothing has counted pairs

    @property
    def stands_in(self) -> int:
        return next(iter(self.at))

    @property
    def places(self) -> Places:
        return next(reversed(self.at.values()))


@dataclass
class _Seen:
    """A condition of all functions that have it."""
    leaf: _Leaf
    true: int = 0
    false: int = 0
    pair: bool | None = None
    used: bool = False              # whether a function ran


class _Sources(dict[Path, list[str]]):
    """The lines of sources; none of those that cannot be read."""

    def __missing__(self, path: Path) -> list[str]:
        try:
            self[path] = path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            self[path] = []
        return self[path]


def _leaves(function: Mapping[str, Any], sources: _Sources) -> list[_Leaf]:
    """The conditions of a function, each with whether a pair shows that it decides."""
    files = [Path(file) for file in function["filenames"]]
    uses = {inner: (file, (a, b, c, d)) for a, b, c, d, _, file, inner, kind in function["regions"]
            if kind == EXPANSION}
    leaves = []
    for a, b, c, d, true, false, stands_in, _, kind in function["branches"]:
        file = stands_in
        at: dict[int, Places] = {file: ((a, b, c, d),)}
        while file in uses:
            places = at[file]
            file, place = uses[file]
            at[file] = (place, *places)
        leaves.append(_Leaf(true, false, kind == OF_SEVERAL, at, files[file], files[stands_in]))
    # A record does not name its file. It belongs where its place holds as many conditions without a record as it has;
    # constants are no branches. Short records come first, because a condition may have a decision within. A decision in
    # a macro may be longer than the use of the macro, so the search goes on until no record fits. Records of one macro
    # come in the order of its uses.
    left = [leaf for leaf in leaves if leaf.several]
    records = sorted(function["mcdc_records"], key=lambda m: (m[2] - m[0], m[3] - m[1]))
    while fit := _fit(records, left):
        record, inner = fit
        shown = record[-1]
        constants = len(shown) - len(inner)     # nothing shows that they decide, and which ones they are is not known
        first = min(inner, key=lambda leaf: leaf.places)
        # A record begins with the condition that is evaluated first; the others stand in the order of the branches.
        for i, leaf in enumerate([first, *(leaf for leaf in inner if leaf is not first)]):
            leaf.pair = shown.count(False) == constants if constants else shown[i]
            left.remove(leaf)
        records.remove(record)
    for leaf in [*left, *_unrecorded(leaves, files, sources)]:
        leaf.pair = None
    return leaves


def _fit(records: Sequence[Sequence[Any]], left: Sequence[_Leaf]) -> tuple[Sequence[Any], list[_Leaf]] | None:
    """A record with the conditions that it is about. Those of a source are looked for before those of its macros, for
    a macro that is a decision elsewhere may be a part of one here."""
    depths: dict[int, set[int]] = {}
    for leaf in left:
        for depth, file in enumerate(reversed(leaf.at)):
            depths.setdefault(depth, set()).add(file)
    most = max((len(record[-1]) for record in records), default=0)
    for depth, constants in product(sorted(depths), range(most)):
        for record in records:
            inside = ([leaf for leaf in left if file in leaf.at and _within(leaf.at[file][0], record[:4])]
                      for file in sorted(depths[depth]))
            fits = [inner for inner in inside if inner and len(inner) + constants == len(record[-1])]
            if fits:
                return record, min(fits, key=lambda inner: max(leaf.stands_in for leaf in inner))
    return None


def _unrecorded(leaves: Sequence[_Leaf], files: Sequence[Path], sources: _Sources) -> set[_Leaf]:
    """Conditions that && or || joins and that clang takes for single ones: it warns of such a decision, and counts no
    pairs."""
    found: set[_Leaf] = set()
    single = [leaf for leaf in leaves if not leaf.several]
    for file in {file for leaf in single for file in leaf.at}:
        of = [(leaf.at[file][0], leaf) for leaf in single if file in leaf.at]
        places = sorted({place for place, _ in of})
        text = sources[files[file]]
        for place in places:
            end = _end(text, place)
            second = next((other for other in places if other[:2] >= end), None)
            if second and JOINED.fullmatch(BLANK.sub("", _between(text, end, second[:2]))):
                found.update(leaf for other, leaf in of if _within(other, place) or _within(other, second))
    return found


def _within(place: Place, outer: Sequence[int]) -> bool:
    return tuple(outer[:2]) <= place[:2] and place[2:] <= tuple(outer[2:])


def _missing(text: str, true: int, false: int, pair: bool | None) -> str:
    if re.match(r"case\b|default\b", text):
        return "" if true else "never taken"
    if not true and not false:
        return "never evaluated"
    if not true or not false:
        return "never true" if false else "never false"
    if pair is None:
        return "clang counts no pairs here: a condition of this decision has a decision within; give that a name"
    return "" if pair else "true and false, and no two evaluations differ in it alone"


def _end(lines: Sequence[str], place: Place) -> tuple[int, int]:
    """Line and column behind it, with the arguments of a macro, of which clang names the beginning alone."""
    _, _, line, column = place
    rest = "\n".join([lines[line - 1][column - 1:], *lines[line:line + 20]]) if line <= len(lines) else ""
    end = re.match(r"\w*", rest).end()      # type: ignore[union-attr]
    if rest.startswith("(", end):
        depth = 0
        for at, letter in enumerate(rest[end:], end):
            depth += (letter == "(") - (letter == ")")
            if not depth:
                end = at + 1
                break
    passed = rest[:end].split("\n")
    return line + len(passed) - 1, len(passed[-1]) + (column if len(passed) == 1 else 1)


def _between(lines: Sequence[str], first: tuple[int, int], last: tuple[int, int]) -> str:
    part = list(lines[first[0] - 1:last[0]])
    if part:
        part[-1] = part[-1][:last[1] - 1]
        part[0] = part[0][first[1] - 1:]
    return "\n".join(part)


def _text(lines: Sequence[str], place: Place) -> str:
    return " ".join(BLANK.sub(" ", _between(lines, place[:2], _end(lines, place))).split())


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
