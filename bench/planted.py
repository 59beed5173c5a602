# SPDX-License-Identifier: Apache-2.0
"""Faults planted in flight's C, and who sees them: the proof, the decisions, the tests, the flights.

    ./fledge bench planted                          # 20 faults
    ./fledge bench planted --faults 8 --seed 2 flight/control

A seed draws as many faults of each kind from modules that stay proved (studies/prove/prove_test.py), so that each
alarm is one of the fault; where these have too few of a kind, the rest is from others, and new alarms count:

    index       the bound of a loop, or a subscript, is off by one
    division    the comparison of a divisor with a number is constant, so that the division always happens
    nan         a test whether a number is finite always passes
    condition   a condition is constant, or a copy of the one beside it

A fault that the compiler refuses, with the warnings of the build, and one that leaves the object the same are drawn
anew. Who sees it:

    prove       an alarm, or a loop without a bound, in the proof of the module
    decisions   a line with more conditions than before that do not decide, in the tests of the module's folder
    tests       these tests fail; they are those in C++ beside the module
    flights     `fledge verify` of the first missions that use the module: a requirement is violated, or a flight fails

What was seen is kept in build/planted.json (--json), and a bench that starts anew continues there.
"""
from __future__ import annotations

import argparse
import functools
import hashlib
import json
import os
import random
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fledge import prove
from fledge.columns import columns
from fledge.errors import Failure
from fledge.prove.prove_test import PROVED
from fledge.prove.sources import Tree
from fledge.verify import decisions

from bench.mutants import ROOT, Mutant, is_inside
from bench.mutation import Change, Token, tokens_of
from bench.relinked import Program, Unusable, extension, run

NEEDS = ["unit", "decisions", "prove"]
MISSIONS = ["sun_safe", "nadir_spin", "mars_orbiter", "cubesat"]    # that have requirements, the quickest first
FLOWN = 2               # missions at most, of those that use a module
KINDS = ("index", "division", "nan", "condition")
MEANS = ("prove", "decisions", "tests", "flights")


# --- faults in a text ------------------------------------------------------------------------------

@dataclass(frozen=True)
class Condition:
    """Tokens first..last. inner: those that run where it holds, of one that decides alone; joined: the operator that
    joins it with others, "" if it decides alone; beside: the text of the one that it is joined with."""
    first: int
    last: int
    joined: str
    beside: str = ""
    inner: range = range(0)


def faults(text: str) -> Iterator[tuple[str, Change]]:
    """(kind, change) of all faults that can be planted in a source in C."""
    tokens = tokens_of(text)
    found = list(_conditions(text, tokens))
    for i, token in enumerate(tokens):
        if token.text == "for":
            yield from (("index", Change(tokens[k].start, tokens[k].stop, "<="))
                        for k in range(i, _closing(tokens, i + 1)) if tokens[k].text == "<")
        if token.text == "[" and tokens[i + 2].text == "]" and re.match("[a-z]", index := tokens[i + 1].text):
            yield "index", Change(tokens[i + 1].start, tokens[i + 1].stop, f"{index} + 1")
        if token.text.endswith("finite") and tokens[i + 1].text == "(" and tokens[i - 1].kind != "word":
            yield "nan", Change(token.start, tokens[_closing(tokens, i + 1)].stop, "1")
    for condition in found:
        span = tokens[condition.first].start, tokens[condition.last].stop
        yield from (("condition", Change(*span, other)) for other in ("0", "1", condition.beside) if other)
    for i, token in enumerate(tokens):
        if token.text in ("/", "/=", "%"):
            divisor = _name(tokens, i + 1)
            begin = max((k for k in range(i) if text[:tokens[k].start].endswith("\n") and tokens[k].text == "}"),
                        default=0)      # of the function
            for condition in found:
                words = [t.text for t in tokens[condition.first:condition.last + 1] if t.text not in ("!", "(", ")")]
                if divisor and begin < condition.first < i and words[:-2] == divisor and words[-1][0].isdigit():
                    always = condition.joined == "&&" if condition.joined else i in condition.inner
                    yield "division", Change(tokens[condition.first].start, tokens[condition.last].stop,
                                             "1" if always else "0")


def _conditions(text: str, tokens: list[Token]) -> Iterator[Condition]:
    ends = ("&&", "||", ")", "]", "}", ";", ",", "?", ":")
    begins = ("&&", "||", "(", "[", "{", ";", ",", "?", ":", "=", "return")

    def span(first: int, last: int) -> str:
        return text[tokens[first].start:tokens[last].stop]

    def left(i: int) -> int:
        """The first token of what ends before the token i."""
        depth = 0
        for k in range(i - 1, -1, -1):
            if not depth and tokens[k].text in begins:
                return k + 1
            depth += (tokens[k].text in ")]}") - (tokens[k].text in "([{")
        return 0

    def right(i: int) -> int:
        """The last token of what begins behind the token i."""
        depth = 0
        for k in range(i + 1, len(tokens)):
            if not depth and tokens[k].text in ends:
                return k - 1
            depth += (tokens[k].text in "([{") - (tokens[k].text in ")]}")
        return len(tokens) - 1

    for i, token in enumerate(tokens):
        if token.text in ("&&", "||"):
            (a, b), (c, d) = (left(i), i - 1), (i + 1, right(i))
            if tokens[a - 1].text not in ("&&", "||"):
                yield Condition(a, b, token.text, span(c, d))
            yield Condition(c, d, token.text, span(a, b))
        elif token.text == "?":
            if tokens[left(i) - 1].text not in ("&&", "||"):
                yield Condition(left(i), i - 1, "", inner=range(i, right(i) + 1))
        elif token.text == "if" and right(i + 1) == (end := _closing(tokens, i + 1)) - 1:
            braced = tokens[end + 1].text == "{"
            stop = _closing(tokens, end + 1) if braced else next(k for k in range(end, len(tokens))
                                                                 if tokens[k].text == ";")
            yield Condition(i + 2, end - 1, "", inner=range(end, stop + 1))


def _closing(tokens: list[Token], i: int) -> int:
    """The index of the bracket that closes the one at i."""
    depth = 0
    for k in range(i, len(tokens)):
        depth += (tokens[k].text in "([{") - (tokens[k].text in ")]}")
        if not depth:
            return k
    return len(tokens) - 1


def _name(tokens: list[Token], i: int) -> list[str]:
    """The words of a variable that begins at i, as m->par.J[k]; none if it is something else."""
    start = i
    if tokens[i].kind != "word":
        return []
    while tokens[i + 1].text in (".", "->", "["):
        i = _closing(tokens, i + 1) if tokens[i + 1].text == "[" else i + 2
    return [] if tokens[i + 1].text == "(" else [t.text for t in tokens[start:i + 1]]


def candidates(kind: str, sources: dict[str, str], seed: int) -> list[Mutant]:
    """One fault of each place, in an order that the seed determines."""
    order = [Mutant(file, change, text) for file, text in sorted(sources.items())
             for change in sorted({change for k, change in faults(text) if k == kind})]
    random.Random(f"{kind} {seed}").shuffle(order)
    return list({(m.file, m.change.start): m for m in reversed(order)}.values())[::-1]


# --- who sees a fault ------------------------------------------------------------------------------

class Bench:
    """What sees faults, and what it sees without one."""

    def __init__(self, folders: Sequence[str] = ("flight",)) -> None:
        self.units: dict[str, list[str]] = {}       # source -> modules
        for unit in prove.units(Tree.of(None)):
            file = unit.file.removesuffix(".h") + ".c"
            if unit.module and (ROOT / file).is_file() and any(is_inside(file, folder) for folder in folders):
                self.units.setdefault(file, []).append(unit.name)
        self.sources = {file: (ROOT / file).read_text(encoding="utf-8") for file in self.units}
        self.program = functools.cache(Program)
        self.extension = extension()
        self.proved = functools.cache(self._proved)
        self.undecided = functools.cache(self._undecided)
        self.holds = functools.cache(lambda mission: not self._flown(mission, None))

    def seen(self, mutant: Mutant) -> dict[str, str]:
        """Of each of MEANS what it sees, "" for nothing, "-" if no mission uses it; none, if it is refused."""
        with tempfile.TemporaryDirectory(prefix="fledge-planted-") as name:
            folder, file, text = Path(name), mutant.file, mutant.changed()
            try:
                library = self.extension.make(file, text, folder)
            except Unusable:
                return {}
            return {"prove": self._alarmed(file, folder), **self._tested(file, text, folder),
                    "flights": self._flights(file, library)}

    # -- the proof

    def _proved(self, file: str) -> tuple[bool, Counter]:
        """Whether the modules of a source are proved, and their alarms."""
        results = prove.prove(self.units[file], jobs=1)
        return all(result.proved for result in results), sum(map(_alarms, results), Counter())

    def _alarmed(self, file: str, folder: Path) -> str:
        header = file.removesuffix(".c") + ".h"
        (folder / header).write_bytes((ROOT / header).read_bytes())
        try:
            results = prove.prove(self.units[file], project=folder, jobs=1)
        except Failure as failure:
            return str(failure)
        new = sum(map(_alarms, results), Counter()) - self.proved(file)[1]
        loops = [f"line {loop.line}: a loop without a bound" for result in results for loop in result.endless]
        return "; ".join([*dict.fromkeys(f"line {line}: {kind}" for line, kind in new), *loops][:2])

    # -- tests and decisions

    def _tested(self, file: str, text: str, folder: Path) -> dict[str, str]:
        name = f"flight_{Path(file).parent.name}_test"
        plain = self.program(f"flight/{name}").make(file, text, folder)
        done = run([str(plain), "--gtest_brief=1"], folder, check=False)
        failed = re.findall(r"^\[  FAILED  \] ([\w./]+)", done.stdout, re.M)
        return {"decisions": self._left(file, text, folder),
                "tests": (failed[0] if failed else f"exit code {done.returncode}") if done.returncode else ""}

    def _left(self, file: str, text: str, folder: Path) -> str:
        below = folder / "mcdc"
        below.mkdir()
        try:
            counting = self.program(f"tests_mcdc/flight_{Path(file).parent.name}_test").make(file, text, below)
        except Unusable:
            return ""
        if (after := _undecided(counting, file, below, [below])) is None:
            return ""       # no counts: the tests have crashed
        lines = self.undecided(file)
        new = [(line, shown) for line, shown in after if sum(at == line for at, _ in after) >
               sum(at == line for at, _ in lines)]
        return "; ".join(f"line {line}: {shown}" for line, shown in new[:2])

    def _undecided(self, file: str) -> list[tuple[int, str]]:
        with tempfile.TemporaryDirectory() as folder:
            program = self.program(f"tests_mcdc/flight_{Path(file).parent.name}_test").path
            return _undecided(program, file, Path(folder), [ROOT]) or []

    # -- flights

    def _flights(self, file: str, library: Path) -> str:
        using = [m for m in MISSIONS if any(re.search(rf"\bfsw\.{name}\(", path.read_text(encoding="utf-8"))
                                            for path in (ROOT / "missions" / m).glob("*.py")
                                            for name in self.units[file])]
        if not using:
            return "-"
        return next((found for mission in using[:FLOWN] if self.holds(mission)
                     and (found := self._flown(mission, library))), "")

    @staticmethod
    def _flown(mission: str, library: Path | None) -> str:
        """What is wrong in the flights of a mission, with an extension or that of the build."""
        with tempfile.TemporaryDirectory() as out:
            paths = [*([str(library.parent)] if library else []), str(ROOT), *filter(None, sys.path)]
            done = run([sys.executable, "-P", "-m", "fledge.cli", "verify", mission, "--again", "--out", out], ROOT,
                       check=False, PYTHONPATH=os.pathsep.join(paths))
        wrong = re.findall(r"^  (\S+) +(?:violated|failed)\b", done.stdout, re.M)
        return f"{mission}: {wrong[0] if wrong else 'a flight fails'}" if done.returncode else ""


def _alarms(result: prove.Result) -> Counter:
    return Counter((a.line, a.kind + " (beyond declared inputs)" * (a.state == "beyond")) for a in result.alarms)


def _undecided(program: Path, file: str, folder: Path, roots: list[Path]) -> list[tuple[int, str]] | None:
    """(line, condition and what is missing) of those of a source that do not decide in the tests of a program."""
    counts = folder / "counts.profraw"
    run([str(program), "--gtest_brief=1"], folder, check=False, LLVM_PROFILE_FILE=str(counts))
    if not counts.is_file() or not counts.stat().st_size:
        return None
    found = decisions.read([counts], [program], roots, whole=True).get(file)
    return [(c.line, f"{c.text}: {c.missing}") for c in found.open] if found else None


# --- the study -------------------------------------------------------------------------------------

def study(bench: Bench, count: int, seed: int, kept: Path) -> Iterator[dict[str, Any]]:
    """`count` faults of each kind, and who sees them, as rows."""
    known: dict[str, dict[str, str]] = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else {}
    for kind in KINDS:
        drawn = candidates(kind, bench.sources, seed)
        order = (mutant for proved in (True, False) for mutant in drawn
                 if (set(bench.units[mutant.file]) <= set(PROVED)) == proved)
        taken = 0
        while taken < count and (mutant := next(order, None)):
            key = hashlib.sha256("\0".join([mutant.file, mutant.text, mutant.changed()]).encode()).hexdigest()
            if key not in known:
                known[key] = bench.seen(mutant)
                kept.parent.mkdir(parents=True, exist_ok=True)
                kept.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
            if known[key]:
                before, after = mutant.lines()
                yield {"kind": kind, "file": mutant.file, "line": mutant.line(), "before": before, "after": after,
                       "proved": bench.proved(mutant.file)[0], **known[key]}
                taken += 1


def lines_of(row: dict[str, Any]) -> list[str]:
    place = f"{row['kind']}  {row['file']}:{row['line']}" + ", of a module with alarms" * (not row["proved"])
    return [place, f"    {row['before']}", f"    {row['after']}",
            *(f"        {means:11}{row[means] or 'does not see it'}" for means in MEANS)]


def table(rows: list[dict[str, Any]]) -> list[str]:
    """How many faults of each kind each means sees, none sees, and one alone sees."""
    def sees(row: dict[str, Any]) -> list[str]:
        return [means for means in MEANS if row[means] not in ("", "-")]

    lines = [("kind", "faults", *MEANS, "none")]
    for kind in (*KINDS, "all"):
        of = [sees(row) for row in rows if kind in (row["kind"], "all")]
        lines.append((kind, str(len(of)), *(str(sum(means in seen for seen in of)) for means in MEANS),
                      str(sum(not seen for seen in of))))
    alone = [sees(row) for row in rows]
    lines.append(("alone", "", *(str(alone.count([means])) for means in MEANS), ""))
    return list(columns(lines, set(range(1, 3 + len(MEANS)))))


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="fledge bench planted", description="Faults planted in flight's C, and who "
                                     "sees them.", epilog="example: ./fledge bench planted --faults 8")
    parser.add_argument("folders", nargs="*", metavar="FOLDER", help="or a file, relative to the tree; default: flight")
    parser.add_argument("--faults", type=int, default=20, metavar="N", help="altogether, as many of each kind; "
                        "default: %(default)s")
    parser.add_argument("--seed", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--json", type=Path, default=ROOT / "build/planted.json", metavar="FILE",
                        help="where what was seen is kept; default: build/planted.json")
    chosen = parser.parse_args(arguments)
    count = -(-chosen.faults // len(KINDS))
    bench = Bench(chosen.folders or ["flight"])
    if not bench.units:
        raise Failure(f"planted: there is no module in {', '.join(chosen.folders)}")
    rows = []
    for row in study(bench, count, chosen.seed, chosen.json):
        rows.append(row)
        print(*lines_of(row), sep="\n", flush=True)
    print(*table(rows), sep="\n")
    return 0
