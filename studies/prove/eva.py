# SPDX-License-Identifier: Apache-2.0
"""Frama-C's Eva on a program: what may go wrong, and where.

A program is analysed in a folder of its own, on copies of its sources in which loops show their counters (loops.py).
The options hold for Frama-C 25 to 31. Numbers may be infinite or NaN, as IEEE 754 and flight's rules have them; so
a division of doubles by zero is no alarm, while one of integers, and the conversion of such a number to an integer, is.
"""
from __future__ import annotations

import csv
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which

from fledge.errors import Failure
from fledge.prove.loops import Loop, watched
from fledge.prove.sources import INCLUDED

HERE = Path(__file__).parent
OPTIONS = ("-eva-precision", "2", "-eva-domains", "octagon", "-eva-split-return", "auto", "-warn-special-float", "none")
MACHINE = "gcc_x86_64"
MISSING = "prove: Frama-C is not installed; as root, run: apt-get install frama-c-base"
NOT_FINITE = "not finite while GOOD"
STATES = ("Unknown", "Invalid", "Invalid or unreachable", "Invalid under hypotheses")
KINDS = {
    "division_by_zero": "division by zero", "index_bound": "index out of range", "mem_access": "pointer out of range",
    "signed_overflow": "overflow", "shift": "shift out of range", "float_to_int": "conversion out of range",
    "is_nan_or_infinite": "conversion of a number that is not finite", "initialization": "read before it is set",
    "dangling_pointer": "pointer to what has ended", "separation": "writes that overlap",
    "overlap": "copy between parts that overlap", "user assertion": "assertion",
    "ptr_comparison": "comparison of pointers to different objects", "function_pointer": "call of a wrong pointer",
}


@dataclass(frozen=True)
class Program:
    """texts: the sources and headers by name; drivers: those of them that are no part of flight."""
    name: str
    texts: Mapping[str, str]
    drivers: tuple[str, ...] = ()
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Alarm:
    file: str
    line: int
    function: str
    kind: str       # a value of KINDS, or Frama-C's word
    text: str       # what should hold there


@dataclass
class Analysis:
    """What an analysis has found. functions: analysed; reached, statements: of them; loops: each that was reached, with
    its bound, None for none."""
    seconds: float
    functions: int
    reached: int
    statements: int
    alarms: list[Alarm] = field(default_factory=list)
    loops: list[tuple[Loop, int | None]] = field(default_factory=list)


def version() -> str:
    """Of Frama-C: "25.0 (Manganese)". Raises Failure."""
    if not which("frama-c"):
        raise Failure(MISSING)
    return subprocess.run(["frama-c", "-version"], stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


def analyse(program: Program, machine: str = MACHINE) -> Analysis:
    """Analyse a program from its main(). Raises Failure, of code that Frama-C cannot analyse."""
    begun = time.monotonic()
    included = {name for text in program.texts.values() for name in INCLUDED.findall(text)}
    with tempfile.TemporaryDirectory(prefix="fledge-prove-") as folder:
        loops: list[Loop] = []
        for number, (name, text) in enumerate(program.texts.items()):
            path = Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            if name not in program.drivers:
                text, found = watched(text, name, number)
                loops += found
            path.write_text(text, encoding="utf-8")
        done = subprocess.run(
            ["frama-c", "-eva", *OPTIONS, *program.options, "-machdep", machine,
             f"-cpp-extra-args=-I. -I{HERE} -include fledge_prove.h",
             *(name for name in program.texts if name.endswith(".c") and name not in included),
             "-then", "-report-csv", "alarms.csv"], cwd=folder, env={**os.environ, "PWD": folder},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
        table = Path(folder, "alarms.csv")
        _refuse(program, done.stdout, done.returncode if table.exists() else 1)
        analysis = _counts(done.stdout)
        analysis.alarms = list(_alarms(table.read_text(encoding="utf-8").splitlines(), folder))
    if "Frama_C_show_each_returned" not in done.stdout and program.drivers and "Frama_C_show_each_returned" in "".join(
            program.texts[name] for name in program.drivers):
        analysis.alarms.append(Alarm(program.drivers[0], 0, "main", "no return", "each call returns"))
    analysis.loops = _bounds(loops, done.stdout)
    analysis.seconds = time.monotonic() - begun
    return analysis


def _refuse(program: Program, output: str, status: int) -> None:
    """Raise Failure for what cannot be analysed."""
    if recursive := re.search(r"[Rr]ecursive call[^\n]*?\b(?:to|of|function)\b[^\n]*", output):
        at = re.search(r"^\[[\w:.-]+\] ([^\s:]+:\d+): (?:Warning: )?\s*[^\n]*recursive", output, re.M)
        names = re.findall(r"function (\w+)", output[recursive.start():recursive.start() + 300])
        name = names[0] if names else "a function"
        raise Failure(f"{program.name}: {at[1] + ': ' if at else ''}{name} calls itself; "
                      "flight code has a stack of known size: write a loop", 1)
    if unknown := re.search(r"Neither code nor specification for function (\w+)", output):
        raise Failure(f"{program.name}: no source of {unknown[1]} was found; it stands in the .c beside the .h that "
                      "declares it", 1)
    if status:
        errors = re.findall(r"^([\w./]+:\d+:.*error: .*|\[kernel\].*(?:User Error|Failure): (?:.|\n  )*)", output,
                            re.M)
        raise Failure(f"{program.name}: Frama-C cannot read it: "
                      f"{' '.join(errors[0].split()) if errors else output.strip()[-300:]}", 1)


def _counts(output: str) -> Analysis:
    functions = re.search(r"(\d+) functions? analyzed", output)
    statements = re.search(r"(\d+) statements? reached \(out of (\d+)\)", output)
    return Analysis(0.0, int(functions[1]) if functions else 0, int(statements[1]) if statements else 0,
                    int(statements[2]) if statements else 0)


def _alarms(rows: Sequence[str], folder: str) -> list[Alarm]:
    alarms = set()
    for row in csv.DictReader(rows, delimiter="\t", quoting=csv.QUOTE_NONE):
        where = Path(row["directory"], row["file"]).as_posix().removeprefix(f"{folder}/")
        # Clauses are of functions without a source; what one of the C library needs is a row at each call, too.
        if row["status"] in STATES and not row["property kind"].endswith("clause") and "FRAMAC_SHARE" not in where:
            kind, text = row["property kind"], row["property"]
            if kind == "user assertion" and "finite" in text:
                kind = NOT_FINITE
            alarms.add(Alarm(where, int(row["line"]), re.sub(r"_\d+$", "", row["function"]), KINDS.get(kind, kind),
                             re.sub(r"\b(\w+?)_\d+\b", r"\1", text)))
    return sorted(alarms, key=lambda a: (a.file, a.line, a.kind, a.text))


def _bounds(loops: Sequence[Loop], output: str) -> list[tuple[Loop, int | None]]:
    """The bound of each loop that the analyser reached."""
    values: dict[str, list[tuple[int, int]]] = {}
    for id_, shown in re.findall(r"Frama_C_show_each_(L\d+_\d+):\s+([^\n]*)", output):
        numbers = [int(n) for n in re.findall(r"-?\d+", shown.partition("]")[0])]      # {0; 1}, or [0..9],1%2
        unknown = "--" in shown or not numbers
        values.setdefault(id_, []).append((-2**63, 2**64) if unknown else (min(numbers), max(numbers)))
    return [(loop, loop.bound(values[loop.id])) for loop in loops if loop.id in values]
