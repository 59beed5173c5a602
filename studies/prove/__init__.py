# SPDX-License-Identifier: Apache-2.0
"""Absence of run-time errors in flight C, by abstract interpretation with Frama-C's Eva.

Example:

    from fledge import prove

    for result in prove.prove(["MrpSteering"]):     # or a folder, as flight/actuation
        print(result.name, result.proved, [alarm.text for alarm in result.alarms])

`driver.py` writes from a module's header the program that calls it in all ways; a file x_proof.c beside x.c is such a
program by hand, and `export.py` writes one of the executive of an exported mission. `eva.py` analyses it, `loops.py`
finds how often its loops go round, `sources.py` what belongs to it.

A module is analysed with any bits at its inputs. If alarms are left, it is analysed again with inputs as the header
declares them; an alarm of the first analysis alone is then `beyond` what the header allows. A result is kept in
build/prove/NAME.json of the tree until a source, the analyser or this package changes. NaN arrives whatever a header
declares, so that one that leaves as GOOD stays an alarm.
"""
from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fledge.disk import keep
from fledge.errors import Failure, did_you_mean, listed
from fledge.prove import driver, eva
from fledge.prove.sources import MATH, Tree, named
from introspect.errors import HeaderError
from introspect.model import Group, Struct

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from typing import Any

OPEN = re.compile(r"/\*\s*open(?: (\w+))?:\s*(.*?)\s*\*/", re.S)
DRIVER = "driver.c"
MODEL = Path(__file__).with_name("elementary.c")    # of MATH, where modules call it


@dataclasses.dataclass(frozen=True)
class Finding:
    """An alarm. state: "open" with the reason that the source gives; "beyond": only with inputs beyond those that the
    header declares; else "alarm"."""
    file: str
    line: int
    function: str
    kind: str
    text: str
    state: str
    reason: str = ""


@dataclasses.dataclass(frozen=True)
class Bound:
    """A loop that the analysis reached. bound: its most rounds, None where none is known. how: "proved", "stated" by a
    comment at the loop, or "" """
    file: str
    line: int
    function: str
    bound: int | None
    how: str
    reason: str = ""


@dataclasses.dataclass(frozen=True)
class Result:
    """name, file: of the module, or of the driver by hand. inputs: "any bits", "as declared" or "by hand". sources: the
    SHA-256 of all that was analysed. ranges: what headers state of numbers at the inputs and was assumed. seconds: it
    took, once."""
    name: str
    file: str
    inputs: str
    sources: str
    seconds: float
    functions: int
    reached: int        # statements, of
    statements: int
    alarms: tuple[Finding, ...]
    loops: tuple[Bound, ...]
    ranges: tuple[str, ...] = ()

    @property
    def left(self) -> list[Finding]:
        """The alarms that nothing explains."""
        return [alarm for alarm in self.alarms if alarm.state == "alarm"]

    @property
    def endless(self) -> list[Bound]:
        """The loops without a bound."""
        return [loop for loop in self.loops if loop.bound is None]

    @property
    def proved(self) -> bool:
        return not self.left and not self.endless

    def facts(self) -> dict:
        """For JSON."""
        return {**dataclasses.asdict(self), "proved": self.proved}


@dataclasses.dataclass(frozen=True)
class Unit:
    """A module, or a driver by hand, or an executive (`module` is then None)."""
    name: str
    file: str
    module: Struct | None

    @property
    def words(self) -> list[str]:
        """By which the command line may name it, and its folders."""
        path = self.file.removesuffix("_proof.c").removesuffix(".h")
        return [self.name, self.file, path, path.removeprefix("flight/")]


def units(tree: Tree) -> list[Unit]:
    """All that can be proved in a tree. Raises Failure for a header that breaks the rules."""
    try:
        modules = tree.modules()
    except HeaderError as error:
        raise Failure(str(error)) from None
    by_hand = {proof: Unit(proof.removesuffix("_proof.c"), proof, None) for proof in tree.proofs()}
    driven = {proof.removesuffix("_proof.c") for proof in by_hand}
    generated = [Unit(s.name, s.header, s) for s in modules.values() if s.header.removesuffix(".h") not in driven]
    return sorted([*generated, *by_hand.values()], key=lambda unit: (unit.file, unit.name))


def select(of: Sequence[Unit], names: Sequence[str]) -> list[Unit]:
    """Those that the names mean; without names, all. Raises Failure."""
    for name in names:
        if not any(named(unit.words, name) for unit in of):
            known = sorted(unit.name for unit in of)
            raise Failure(f"prove: there is no module, folder or driver '{name}'{did_you_mean(name, known)} "
                          f"it takes {listed(known, 6)}")
    return [unit for unit in of if not names or any(named(unit.words, name) for name in names)]


def prove(names: Sequence[str] = (), project: Path | None = None, jobs: int | None = None,
          ended: Callable[[Result], None] = lambda _: None, again: bool = False,
          machine: str = eva.MACHINE) -> list[Result]:
    """Prove modules, drivers or all in folders; without names, all of the project, else of Fledge.

    jobs: analyses at a time; default: one for each core. ended: is called with each result. again: do not use those
    that are kept. machine: of Frama-C (-machdep), "ppc_32" is one of 32 bits whose bytes are in the other order.
    Raises Failure.
    """
    tree = Tree.of(project)
    chosen = select(units(tree), names)
    if not chosen:
        raise Failure(f"prove: there is no module in {tree.roots[0] / 'flight'}", 1)
    analyser = eva.version()
    work = functools.partial(_result, tree, analyser, again, machine)
    results = []
    with ThreadPoolExecutor(jobs or os.cpu_count() or 1) as pool:
        waiting = [pool.submit(work, unit) for unit in chosen]
        try:
            for future in waiting:
                results.append(future.result())
                ended(results[-1])
        except BaseException:
            for future in waiting:
                future.cancel()
            raise
    return results


def kept(project: Path | None = None) -> list[Result]:
    """The kept results that still hold, of the project, else of Fledge: its sources and the analyser are the same."""
    try:
        analyser, tree = eva.version(), Tree.of(project)
    except Failure:
        return []
    results = []
    for unit in units(tree):
        if (path := _place(tree, unit, eva.MACHINE)).is_file():
            digest = _digest(analyser, eva.MACHINE, _programs(tree, unit))
            results += [result] if (result := _kept(path, digest)) else []
    return results


def _result(tree: Tree, analyser: str, again: bool, machine: str, unit: Unit) -> Result:
    return proved(tree, unit, analyser, _programs(tree, unit), again, machine)


def proved(tree: Tree, unit: Unit, analyser: str, programs: Sequence[eva.Program], again: bool, machine: str) -> Result:
    """The kept result, or a new one. programs: the second, of a module, has its inputs as declared."""
    digest, path = _digest(analyser, machine, programs), _place(tree, unit, machine)
    if not again and (result := _kept(path, digest)):
        return result
    first = eva.analyse(programs[0], machine)
    result = _explained(tree, unit, first, digest, "by hand" if unit.file.endswith("_proof.c") else "any bits")
    if unit.module and result.left:
        inner = eva.analyse(programs[1], machine)
        declared = _explained(tree, unit, inner, digest, "as declared")
        within = {(a.file, a.line, a.kind, a.text) for a in declared.alarms}
        beyond = [dataclasses.replace(a, state="alarm" if a.kind == eva.NOT_FINITE else "beyond") for a in result.left
                  if (a.file, a.line, a.kind, a.text) not in within]
        result = dataclasses.replace(declared, seconds=result.seconds + declared.seconds, loops=result.loops,
                                     alarms=(*declared.alarms, *beyond), ranges=_ranges(unit.module))
    keep(path, json.dumps(result.facts(), indent=1) + "\n")
    return result


def _programs(tree: Tree, unit: Unit) -> list[eva.Program]:
    return [_program(tree, unit, declared) for declared in ([False, True] if unit.module else [True])]


def _digest(analyser: str, machine: str, programs: Sequence[eva.Program]) -> str:
    """Of all that decides a result."""
    return hashlib.sha256("\0".join([
        analyser, machine, _own(), *(f"{name}\0{text}" for p in programs for name, text in p.texts.items())]).encode()
    ).hexdigest()


def _place(tree: Tree, unit: Unit, machine: str) -> Path:
    """Where a result is kept."""
    folder = "build/prove" if machine == eva.MACHINE else f"build/prove/{machine}"
    return tree.roots[0] / folder / f"{unit.name.replace('/', '-')}.json"


def _kept(path: Path, digest: str) -> Result | None:
    try:
        facts: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        del facts["proved"]
        facts["alarms"] = tuple(Finding(**a) for a in facts["alarms"])
        facts["loops"] = tuple(Bound(**b) for b in facts["loops"])
        facts["ranges"] = tuple(facts["ranges"])
        return Result(**facts) if facts["sources"] == digest else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


@functools.cache
def _own() -> str:
    """All that decides how a program is analysed."""
    return "\0".join(path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parent.glob("*"))
                     if path.suffix in (".py", ".h") and not path.stem.endswith("_test"))


def _program(tree: Tree, unit: Unit, declared: bool) -> eva.Program:
    if unit.module is None:
        texts = tree.closure(unit.file)
        return eva.Program(unit.name, texts, (unit.file,), _options(texts[unit.file]))
    texts = {**tree.closure(unit.file, without=MATH), MODEL.name: MODEL.read_text(encoding="utf-8")}
    if (source := unit.file.removesuffix(".h") + ".c") not in texts:
        raise Failure(f"prove: {unit.name} is declared in {unit.file}, and there is no {source}", 1)
    return eva.Program(unit.name, {**texts, DRIVER: driver.write(unit.module, declared)}, (DRIVER, MODEL.name),
                       _options(texts[source]))


def _options(source: str) -> tuple[str, ...]:
    """Those for Frama-C in a source's comment."""
    more = re.search(r"^[ /*]*options: (.*?)(?:\*/)?$", source, re.M)
    return tuple(more[1].split()) if more else ()


def _explained(tree: Tree, unit: Unit, analysis: eva.Analysis, digest: str, inputs: str) -> Result:
    alarms = tuple(_finding(tree, unit, alarm) for alarm in analysis.alarms)
    loops = tuple(Bound(loop.file, loop.line, loop.function, loop.stated if bound is None else bound,
                        "proved" if bound is not None else "stated" if loop.stated else "", loop.reason)
                  for loop, bound in analysis.loops)
    return Result(unit.name, unit.file, inputs, digest, round(analysis.seconds, 1), analysis.functions,
                  analysis.reached, analysis.statements, alarms, loops)


def _finding(tree: Tree, unit: Unit, alarm: eva.Alarm) -> Finding:
    """An alarm where a reader looks for it: one of the driver stands at the module's update."""
    file, line, text, port = alarm.file, alarm.line, alarm.text, ""
    if file == DRIVER and unit.module:
        file = unit.file.removesuffix(".h") + ".c"
        path = tree.find(file)
        lines = path.read_text(encoding="utf-8").splitlines() if path else []
        entrance = re.compile(rf"\b{unit.module.snake_name}_update\b")
        line = next((n for n, words in enumerate(lines, 1) if entrance.search(words)), 1)
        if found := re.search(r"out__(\w+)", text):
            text = f"out.{found[1].replace('__', '.')} is finite"
            port = text.split(".")[1]
    for name, reason in _opened(tree, file, 0 if port else line):
        if name == port:
            return Finding(file, line, alarm.function, alarm.kind, text, "open", reason)
    return Finding(file, line, alarm.function, alarm.kind, text, "alarm")


def _opened(tree: Tree, file: str, line: int) -> Iterator[tuple[str, str]]:
    """(port, reason) of the comments `open` that end in this line or the one before; line 0: all of the file."""
    if path := tree.find(file):
        text = path.read_text(encoding="utf-8", errors="replace")
        for match in OPEN.finditer(text):
            ends = text.count("\n", 0, match.end()) + 1
            if line in (0, ends, ends + 1):
                yield match[1] or "", " ".join(match[2].replace("\n *", "\n").split())


def _ranges(module: Struct) -> tuple[str, ...]:
    """ "in.sun.r_PN_N in [-1e13, 1e13]" """
    texts: dict[str, None] = {}

    def look(struct: Struct, path: str) -> None:
        for f in struct.fields:
            if f.struct:
                look(f.struct, f"{path}{f.name}.")
            elif limits := f.range:
                texts[f"{path}{f.name} in [{limits.lo:g}, {limits.hi:g}]"] = None

    for port in module.fields:
        if port.group is Group.IN and port.struct:
            look(port.struct, f"in.{port.name}.")
    return tuple(texts)
