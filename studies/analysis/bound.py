# SPDX-License-Identifier: Apache-2.0
"""A bound of the time of a function on the LEON3, from its object code.

    program = bound.Program("build/spin.elf")
    program.longest("run_gnc")      # cycles that no call can exceed, without interrupts

The paths of a function are those of its control-flow graph. An integer programme (scipy's HiGHS) finds the costliest
one: what enters a block leaves it, and a loop goes round at most as often as its bound says. Functions are bounded from
the leaves up, once for each set of small numbers that a caller passes, so that memcpy costs what its size does.

A loop's bound is read from its object code where a counter goes by a constant step from a known number to another. A
comment `at most N: reason` at the loop, or else `fledge prove`, gives another one, found by the line of the loop's last
branch. The least counts.
"""
from __future__ import annotations

import bisect
import functools
import itertools
import struct
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fledge import elf, prove
from fledge.analysis.sparc import ANNULLED, ICC, RESTORE_LINK, TRAP, Instruction, State, Value, holds, number
from fledge.disk import ROOT
from fledge.errors import Failure
from fledge.prove.loops import STATED

TOOLS = "sparc64-linux-gnu-"
WINDOWS = 8         # of registers; one is always free
SMALL = 1 << 16     # numbers below are passed into functions; addresses are not, which would bound each call anew
ALIGNED = "aligned"     # of a symbol: an address that is a multiple of 8
STACK = 14          # %sp
MOST = 1 << 20      # rounds that are counted
# Functions that are walked for each size, since all their branches follow from it and from how their pointers are
# aligned: name -> registers of the pointers. The size is in %o2.
WALKED = {"memcpy": (8, 9), "memset": (8,), "memmove": (8, 9)}
SIZE = 10
COMPARED = ("memcmp",)      # no loop of it goes round more often than its size is
# What calls through the tables of the board support may reach.
TABLES = {"leon3_interrupt": ("wake", "count_interrupt")}

Bounds = Callable[[str, int], "int | None"]     # (file, line) of a loop -> its most rounds


@dataclass
class Edge:
    """To a block, with the instructions of a delay slot and the cycles of it, or of annulling it. taken: whether this
    is where a branch goes that is taken; None: of no branch, or of one that has no choice"""
    to: int
    delay: tuple[Instruction, ...] = ()
    cycles: int = 0
    taken: bool | None = None


@dataclass
class Block:
    """Instructions without a branch between. calls: what it may call at its end; edges: none, where it ends"""
    code: list[Instruction] = field(default_factory=list)
    calls: list[int] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)

    @property
    def last(self) -> Instruction:
        return self.code[-1]


@dataclass
class Loop:
    """Goes back to its head from its latches, at most `rounds` times for each time that it is entered. within: latches
    of loops in it that have the same head"""
    head: int
    body: set[int]
    latches: set[int]
    within: set[int] = field(default_factory=set)
    rounds: int = 0


@dataclass(frozen=True)
class Cost:
    """cycles: without the traps that spill a window for the first time. windows: how many are below its caller's"""
    cycles: int
    windows: int


class Program:
    """A linked program for the LEON3, with its symbols. bounds: of loops, by the line of their source. Raises Failure
    if it is none, or has no lines."""

    def __init__(self, path: Path | str, bounds: Bounds = lambda file, line: None) -> None:
        self.path, self.bounds = Path(path), bounds
        file = elf.read(self.path)
        if file.machine != "SPARC" or file.bits != 32:
            raise Failure(f"{path} is for {file.processor}; build it for the LEON3")
        data = self.path.read_bytes()
        self._memory = [(part.load, data[part.place:part.place + part.stored]) for part in file.segments]
        rows = [line.split() for line in _run("nm", "-n", str(path)).splitlines()]
        symbols = [(int(row[0], 16), row[2]) for row in rows if len(row) == 3 and row[1] in "tTwW"]
        self._starts, self._names = [start for start, _ in symbols], [name for _, name in symbols]
        self.symbols = {name: start for start, name in reversed(symbols)}
        self._costs: dict[tuple, Cost] = {}
        self._underway: list[int] = []
        self._lines: dict[int, tuple[str, int]] = {}
        if ".debug_line" not in _run("readelf", "-S", "-W", str(path)):
            raise Failure(f"{path} has no lines of its source; build it with -g")

    def longest(self, function: str) -> int:
        """[cycles] That no call of a function exceeds, with the traps of register windows, without interrupts.
        Its first argument is an address that is a multiple of 8."""
        if function not in self.symbols:
            raise Failure(f"{self.path} has no function {function}")
        cost = self.cost(self.symbols[function], {8: ((ALIGNED, 8), 0)})
        return cost.cycles + cost.windows * self.overflow

    @property
    def overflow(self) -> int:
        """[cycles] Of a trap that spills a window."""
        return TRAP + self._straight(self.symbols["leon3_traps"] + 16 * 5) + self._straight(
            self.symbols["window_overflow"])

    @property
    def underflow(self) -> int:
        """[cycles] Of a trap that fills a window."""
        return TRAP + self._straight(self.symbols["leon3_traps"] + 16 * 6) + self._straight(
            self.symbols["window_underflow"])

    def interrupt(self) -> int:
        """[cycles] Of an interrupt whose handler does nothing but count, with all windows that it moves: those that it
        spills are filled once more by the program."""
        code = _Function(self, self.symbols["interrupt"], {})
        windows = 1 + code.windows      # the trap's own, too
        return (TRAP + self._straight(self.symbols["leon3_traps"] + 16 * 0x11) + code.cycles +
                windows * (self.overflow + self.underflow))

    def _straight(self, pc: int) -> int:
        """[cycles] Up to the first jump, with its delay slot."""
        cycles = 0
        while not (code := self.at(pc)).is_jump:
            cycles, pc = cycles + code.cycles, pc + 4
        return cycles + code.cycles + self.at(pc + 4).cycles

    def at(self, pc: int) -> Instruction:
        return Instruction(pc, self.word(pc))

    def word(self, address: int) -> int:
        for begin, content in self._memory:
            if 0 <= address - begin <= len(content) - 4:
                return struct.unpack_from(">I", content, address - begin)[0]
        raise Failure(f"{self.path}: its code goes on at {address:#x}, where it has none")

    def name(self, pc: int) -> str:
        i = bisect.bisect_right(self._starts, pc) - 1
        return self._names[i] if i >= 0 else hex(pc)

    def begins(self, pc: int) -> bool:
        """Whether a function begins there."""
        return self._starts[bisect.bisect_right(self._starts, pc) - 1] == pc

    def line(self, pc: int) -> tuple[str, int]:
        """(file, line) of an instruction; line 0: it is not known."""
        if pc not in self._lines:
            file, _, line = _run("addr2line", "-e", str(self.path), hex(pc)).split(" ")[0].strip().rpartition(":")
            self._lines[pc] = file, int(line) if line.isdigit() else 0
        return self._lines[pc]

    def place(self, pc: int) -> str:
        """ "mat_mul, flight/math/mat.c:12"."""
        file, line = self.line(pc)
        return self.name(pc) + (f", {file}:{line}" if line else "")

    def cost(self, start: int, arguments: Mapping[int, Value] | None = None) -> Cost:
        """Of a function whose arguments (register -> value) are known so far. Raises Failure."""
        key = start, tuple(sorted((arguments or {}).items(), key=str))
        if key not in self._costs:
            if start in self._underway:
                raise Failure(f"{self.path.name}: {self.name(start)} calls itself, by "
                              f"{', '.join(map(self.name, self._underway[self._underway.index(start):]))}; "
                              "write it as a loop with a bound")
            self._underway.append(start)
            try:
                if self.name(start) in WALKED:
                    self._costs[key] = self._walked(start, arguments or {})
                else:
                    function = _Function(self, start, arguments or {})
                    self._costs[key] = Cost(function.cycles, function.windows)
            finally:
                self._underway.pop()
        return self._costs[key]

    def _walked(self, start: int, arguments: Mapping[int, Value]) -> Cost:
        """Of a function of memory: the costliest of all its alignments, each executed."""
        pointers = WALKED[self.name(start)]
        ways = [(alignment(arguments[register]),) if register in arguments else range(8) for register in pointers]
        costs = []
        for order in (1, -1) if len(pointers) == 2 else (1,):
            for low in itertools.product(*ways):
                state: State = [((start, register), 0) for register in range(32)] + [None]
                state[0], state[SIZE] = number(0), arguments[SIZE]
                for register, offset in zip(pointers, low):
                    state[register] = number((1 << 30) + order * (register << 20) + offset)
                costs.append(self._walk(start, state))
        return Cost(max(cycles for cycles, _ in costs), max(windows for _, windows in costs))

    def _walk(self, pc: int, state: State) -> tuple[int, int]:
        """(cycles, windows) of the only path. Raises Failure if it is not the only one."""
        cycles = depth = deepest = steps = 0
        while steps < 8 * MOST:
            code, steps = self.at(pc), steps + 1
            cycles += code.cycles
            if not (code.is_branch or code.is_return):
                if code.is_call or code.is_jump:
                    break
                depth += code.is_save - code.is_restore
                deepest, pc = max(deepest, depth), pc + 4
                code.follow(state)
                continue
            edges = [Edge(0, (self.at(pc + 4),), self.at(pc + 4).cycles)] if code.is_return else _leave(
                self, code)[1]
            if len(edges) == 2:
                compared = state[ICC]
                if not (code.is_integer_branch and compared and compared[0][0] is None is compared[1][0]
                        and _decides(code, compared)):
                    break
                edges = [edge for edge in edges
                         if edge.taken is holds(code.condition, compared[0][1], compared[1][1])]
            cycles, pc = cycles + edges[0].cycles, edges[0].to
            if code.is_return:
                return cycles, deepest
            for slot in edges[0].delay:
                slot.follow(state)
        raise Failure(f"{self.path.name}: {self.place(pc)} does more than its size decides")


def alignment(value: Value) -> int | None:
    """An address modulo 8; None: it is not known. Stacks and the mission's memory are aligned."""
    symbol, offset = value
    return offset % 8 if symbol is None or symbol[0] == ALIGNED or symbol[1:] == (STACK,) else None


class _Function:
    """A function for given arguments: its graph, its values, its loops and the costliest path."""

    def __init__(self, program: Program, start: int, arguments: Mapping[int, Value]) -> None:
        self.program, self.start, self.arguments = program, start, arguments
        self.blocks = _graph(program, start)
        self.states: dict[int, State] = {}
        self.alive: dict[int, list[Edge]] = {}
        self.incoming: dict[int, dict[tuple[int, int], State]] = {}
        self._follow()
        self.costs = {at: self._block(at) for at in self.states}
        saves = any(code.is_save for at in self.states for code in self.blocks[at].code)
        self.windows = saves + max((deep for _, deep in self.costs.values()), default=0)
        self.cycles = self._path()
        # A window below which so many are used is spilled, filled when control returns, and makes room once more.
        if saves and self.windows >= WINDOWS - 1:
            self.cycles += program.overflow + program.underflow

    # --- what is known of registers

    def _follow(self) -> None:
        """The state at the begin of each block that can be reached. A symbol that turned out to stand for one value
        alone, which comes from a pass in a wrong order, is left out, and all is followed anew."""
        met: dict[int, set[int]] = {}
        while True:
            self._propagate(met)
            idle = [(at, place) for at, places in met.items() if at in self.incoming for place in places - {ICC}
                    if len({state[place] for state in self.incoming[at].values()} - {((at, place, "phi"), 0)}) == 1]
            if not idle:
                return
            for at, place in idle:
                met[at].remove(place)

    def _propagate(self, met: dict[int, set[int]]) -> None:
        """The least fixed point in which the registers of `met` are symbols at their blocks; adds to them."""
        entry: State = [((self.start, register), 0) for register in range(32)] + [None]
        entry[0] = number(0)
        for register, value in self.arguments.items():
            entry[register] = value
        self.states, self.alive = {}, {}
        incoming = self.incoming = {self.start: {(-1, 0): entry}}
        waiting = [self.start]
        while waiting:
            at = waiting.pop()
            state = self._meet(at, list(incoming[at].values()), met.setdefault(at, set()))
            if self.states.get(at) == state:
                continue
            self.states[at] = state
            after = self._after(at)
            self.alive[at] = list(self._possible(at, after))
            for edge in self.alive[at]:
                incoming.setdefault(edge.to, {})[at, self.blocks[at].edges.index(edge)] = self._delayed(after, edge)
                waiting.append(edge.to)

    @staticmethod
    def _meet(at: int, states: Sequence[State], met: set[int]) -> State:
        result = list(states[0])
        for place in range(33):
            if place in met or any(state[place] != result[place] for state in states):
                met.add(place)
                result[place] = ((at, place, "phi"), 0) if place < ICC else None
        return result

    def _after(self, at: int) -> State:
        """The state at the end of a block, before the delay slot of a branch; behind a call."""
        state, block = list(self.states[at]), self.blocks[at]
        for code in block.code:
            code.follow(state)
        if block.calls:
            for register in (*range(1, 8), *range(8, 14), 15):
                state[register] = (block.last.pc, register), 0
            state[ICC] = None
        return state

    def _possible(self, at: int, state: State) -> Iterator[Edge]:
        """The edges that can be taken."""
        last = self.blocks[at].last
        for edge in self.blocks[at].edges:
            known = state[ICC] if edge.taken is not None and last.is_integer_branch else None
            if known and known[0][0] is known[1][0] is None and _decides(last, known):
                if holds(last.condition, known[0][1], known[1][1]) is not edge.taken:
                    continue
            yield edge

    @staticmethod
    def _delayed(state: State, edge: Edge) -> State:
        state = list(state)
        for code in edge.delay:
            code.follow(state)
        return state

    # --- costs

    def _block(self, at: int) -> tuple[int, int]:
        """(cycles, windows of what it calls)."""
        block = self.blocks[at]
        cycles = sum(code.cycles for code in block.code)
        if not block.calls:
            return cycles, 0
        costs = []
        for arriving in self.incoming[at].values():     # one by one: paths that meet may pass different sizes
            state = list(arriving)
            for code in block.code:
                code.follow(state)
            given = self._given(state)
            costs += [self.program.cost(callee, self._sized(block, callee, given)) for callee in block.calls]
        return cycles + max(cost.cycles for cost in costs), max(cost.windows for cost in costs)

    @staticmethod
    def _given(state: State) -> dict[int, Value]:
        """What a callee knows of its arguments."""
        given: dict[int, Value] = {}
        for register in range(8, 14):
            value = state[register]
            if value[0] is None and (value[1] + SMALL) & 0xFFFFFFFF < 2 * SMALL:
                given[register] = value
            elif (low := alignment(value)) is not None:
                given[register] = (ALIGNED, register), low
        return given

    def _sized(self, block: Block, callee: int, given: dict[int, Value]) -> dict[int, Value]:
        """The same with the size that a comment states."""
        name = self.program.name(callee)
        if name not in (*WALKED, *COMPARED) or SIZE in given and given[SIZE][0] is None:
            return given
        call = next(code.pc for code in reversed(block.code) if code.is_call or code.is_branch)
        size = self.program.bounds(*self.program.line(call))
        if size is None:
            raise Failure(f"{self.program.path.name}: {self.program.place(call)} calls {name} for a size that is not "
                          "constant; write at it /* at most N: why */, in bytes")
        return {**given, SIZE: number(size)}

    def _path(self) -> int:
        """[cycles] Of the costliest path."""
        import numpy as np
        from scipy.optimize import Bounds as Range, LinearConstraint, milp
        from scipy.sparse import lil_matrix

        edges = [(at, edge) for at in self.states for edge in self.alive[at]]
        places = {at: i for i, at in enumerate(self.states)}
        ends = [at for at in self.states if not self.blocks[at].edges]
        if not ends:
            raise Failure(f"{self.program.path.name}: {self.program.place(self.start)} never returns; it has no bound")
        loops = self._loops(edges)
        # How often each edge is taken, then where it ends.
        n = len(edges) + len(ends)
        flow, low = lil_matrix((len(places) + len(loops), n)), np.zeros(len(places) + len(loops))
        high, gain = low.copy(), np.zeros(n)
        low[0] = high[0] = -1       # enters the first block
        for i, (at, edge) in enumerate(edges):
            flow[places[edge.to], i] += 1
            flow[places[at], i] -= 1
            gain[i] = self.costs[at][0] + edge.cycles
        for i, at in enumerate(ends, len(edges)):
            flow[places[at], i] -= 1
            gain[i] = self.costs[at][0]
        for row, loop in enumerate(loops, len(places)):
            low[row] = -np.inf
            for i, (at, edge) in enumerate(edges):
                if edge.to == loop.head and at not in loop.within:
                    flow[row, i] = 1 if at in loop.latches else -loop.rounds
            if loop.head == self.start:
                high[row] = loop.rounds
        found = milp(-gain, integrality=np.ones(n), bounds=Range(0, np.inf),
                     constraints=LinearConstraint(flow.tocsr(), low, high))
        if not found.success:
            raise Failure(f"{self.program.path.name}: {self.program.place(self.start)}: no longest path was found: "
                          f"{found.message}")
        return round(-found.fun)

    def _loops(self, edges: Sequence[tuple[int, Edge]]) -> list[Loop]:
        """Raises Failure for a loop without a bound. Nested loops that begin at one block differ in where they go
        back to it."""
        before: dict[int, set[int]] = {at: set() for at in self.states}
        for at, edge in edges:
            before[edge.to].add(at)
        dominators = _dominators(self.start, before)
        back: dict[int, set[int]] = {}
        for at, edge in edges:
            if edge.to in dominators[at]:
                back.setdefault(edge.to, set()).add(at)
        if _cyclic(self.states, [(at, e.to) for at, e in edges if e.to not in dominators[at]]):
            raise Failure(f"{self.program.path.name}: {self.program.place(self.start)} has a loop with two entries; "
                          "write it without goto")
        bodies = {head: _body(head, latches, before) for head, latches in back.items()}
        loops = []
        for head, latches in back.items():
            inner = set().union(*(other for other in bodies.values() if other < bodies[head]))
            whole = Loop(head, bodies[head], latches)
            if self._bounded(whole, inner, dominators):
                loops.append(whole)
                continue
            parts = sorted((Loop(head, _body(head, {latch}, before), {latch}) for latch in latches),
                           key=lambda loop: len(loop.body))
            for outer, part in enumerate(parts):
                part.within = {latch for other in parts[:outer] for latch in other.latches}
                if len(parts) == 1 or not self._bounded(part, inner, dominators):
                    place = self.program.place(self.blocks[max(part.latches)].last.pc)
                    raise Failure(f"{self.program.path.name}: a loop of {place} has no bound: count it by a constant, "
                                  "prove it (fledge prove), or write at it /* at most N: why */")
            loops += parts
        return loops

    def _bounded(self, loop: Loop, inner: set[int], dominators: Mapping[int, set[int]]) -> bool:
        """Set the most rounds of a loop; False if nothing is known of them. inner: blocks of loops in it"""
        counted = [rounds for at in loop.body if all(at in dominators[latch] for latch in loop.latches)
                   and (rounds := self._counted(at, loop)) is not None]
        lines = {self.program.line(self.blocks[at].last.pc) for at in loop.body - inner
                 if at in loop.latches or any(edge.to not in loop.body for edge in self.alive[at])}
        by_line = [rounds for file, line in lines if (rounds := self.program.bounds(file, line)) is not None]
        if self.program.name(self.start) in COMPARED and SIZE in self.arguments:
            by_line.append(self.arguments[SIZE][1])
        loop.rounds = min([*counted, *([max(by_line)] if by_line else [])], default=0)
        return bool(counted or by_line)

    def _counted(self, at: int, loop: Loop) -> int | None:
        """How often a loop goes on after a comparison with a known number; None: it is not so."""
        last, head, body = self.blocks[at].last, loop.head, loop.body
        within = {code.pc for b in body for code in (
            *self.blocks[b].code, *(slot for edge in self.blocks[b].edges for slot in edge.delay))}
        stay = {edge.taken for edge in self.alive[at] if edge.to in body}
        compared = self._after(at)[ICC]
        if not (last.is_integer_branch and compared and len(stay) == 1 and _decides(last, compared)
                and len(self.alive[at]) == 2):
            return None
        for place, sign in ((0, 1), (1, -1)):
            counter, limit = compared[place], compared[1 - place]
            symbol, ahead = counter
            if symbol is None or len(symbol) != 3 or symbol[0] != head or limit[0] is not None and (
                    limit[0][0] in body | within):
                continue
            register = symbol[1]
            arriving = [(b, state[register]) for (b, _), state in self.incoming[head].items()]
            begins = {value for b, value in arriving if b not in loop.latches | loop.within}
            steps = {value for b, value in arriving if b in loop.latches}
            if any(value != (symbol, 0) for b, value in arriving if b in loop.within):
                continue
            if len(begins) != 1 or len(steps) != 1:
                continue
            (first,), (again,) = begins, steps
            if again[0] != symbol or first[0] != limit[0]:
                continue
            base = 1 << 30 if limit[0] is not None else 0   # of an address, which does not turn over
            value, step, end = base + first[1] + ahead, again[1], base + limit[1]
            rounds, wanted = 0, stay == {True}
            while rounds <= MOST:
                a, b = value & 0xFFFFFFFF, end & 0xFFFFFFFF
                if holds(last.condition, *((a, b) if sign > 0 else (b, a))) is not wanted:
                    return rounds
                rounds, value = rounds + 1, value + step
        return None


@functools.cache
def stated(file: str) -> dict[int, int]:
    """The bounds that comments of a source state: line -> most rounds, for the line of the comment's end and the next
    one."""
    try:
        text = Path(file).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return {}
    found = {}
    for comment in STATED.finditer(text):
        line = text.count("\n", 0, comment.end()) + 1
        found[line] = found[line + 1] = int(comment[1])
    return found


def proofs(project: Path | None = None) -> dict[tuple[str, int], int]:
    """(file, line) -> the most rounds of a loop in any module of which `fledge prove` has kept a result that still
    holds, of the project or Fledge; without those that some module has no bound of. Files as `flight/math/vec.h`."""
    found: dict[tuple[str, int], int | None] = {}
    for result in [result for own in dict.fromkeys((project, None)) for result in prove.kept(own)]:
        for loop in result.loops:
            before = found.get((loop.file, loop.line), 0)
            found[loop.file, loop.line] = None if before is None or loop.bound is None else max(before, loop.bound)
    return {key: rounds for key, rounds in found.items() if rounds is not None}


def known(project: Path | None = None) -> Bounds:
    """The bounds of loops by comments, else by proofs."""
    proved = proofs(project)
    roots = [str(root) + "/" for root in (project, ROOT) if root]

    def bound(file: str, line: int) -> int | None:
        if (rounds := stated(file).get(line)) is not None:
            return rounds
        return next((proved[file.removeprefix(root), line] for root in roots
                     if (file.removeprefix(root), line) in proved), None)
    return bound


def _decides(branch: Instruction, compared: tuple) -> bool:
    """Whether a comparison tells what a branch asks."""
    return compared[2] or branch.condition & 7 not in (4, 5)


def _graph(program: Program, start: int) -> dict[int, Block]:
    """The blocks of a function, by their addresses."""
    leaders, waiting, ends = {start}, [start], {}
    while waiting:      # where control flow goes, block by block; a block is cut later where another one begins
        pc = waiting.pop()
        while True:
            code = program.at(pc)
            if code.is_branch or code.is_call or code.is_jump:
                if pc not in ends:
                    ends[pc] = _leave(program, code)
                    for edge in ends[pc][1]:
                        if edge.to not in leaders:
                            leaders.add(edge.to)
                            waiting.append(edge.to)
                break
            if code.op == 2 and code.op3 == 0x3A or code.is_gap:
                raise Failure(f"{program.path.name}: {program.place(pc)} traps; a path that ends the program has no "
                              "bound")
            pc += 4
    blocks = {}
    for leader in leaders:
        block, pc = Block(), leader
        while True:
            block.code.append(program.at(pc))
            if pc in ends:
                block.calls, block.edges, more = ends[pc]
                block.code += more
                break
            pc += 4
            if pc in leaders:
                block.edges = [Edge(pc)]
                break
        blocks[leader] = block
    return blocks


def _leave(program: Program, code: Instruction) -> tuple[list[int], list[Edge], list[Instruction]]:
    """What a block calls at its end, its edges, and the delay slot that belongs to the block."""
    delay, pc = program.at(code.pc + 4), code.pc
    if code.is_branch:
        if code.condition == 8 and program.begins(code.target) and program.name(pc) != program.name(code.target):
            return [code.target], [], [] if code.annuls else [delay]    # the callee returns to the caller
        slot = (delay,), delay.cycles
        always, never = code.condition == 8, code.condition == 0
        taken = [] if never else [Edge(code.target, *((), ANNULLED), True) if always and code.annuls
                                  else Edge(code.target, *slot, True)]
        left = [] if always else [Edge(pc + 8, (), ANNULLED, False) if code.annuls else Edge(pc + 8, *slot, False)]
        if len(taken) + len(left) == 1:
            (*taken, *left)[0].taken = None
        return [], [*taken, *left], []
    if code.is_return or delay.is_return:      # of a function, or of a trap
        return [], [], [delay]
    if code.is_call:
        callees = [code.target]
    elif code.rd == RESTORE_LINK and program.name(pc) in TABLES:
        callees = [program.symbols[name] for name in TABLES[program.name(pc)] if name in program.symbols]
    else:
        raise Failure(f"{program.path.name}: {program.place(pc)} " + (
            "calls through a pointer; call the function by its name" if code.rd == RESTORE_LINK else
            "jumps by a table; build it with -fno-jump-tables"))
    if delay.is_restore or delay.rd == RESTORE_LINK and delay.op == 2:     # the callee returns to the caller
        return callees, [], [delay]
    return callees, [Edge(pc + 12 if program.at(pc + 8).is_gap else pc + 8)], [delay]


def _body(head: int, latches: set[int], before: Mapping[int, set[int]]) -> set[int]:
    """The blocks from which a latch is reached without the head."""
    body, waiting = {head}, list(latches)
    while waiting:
        if (block := waiting.pop()) not in body:
            body.add(block)
            waiting += before[block]
    return body


def _dominators(start: int, before: Mapping[int, set[int]]) -> dict[int, set[int]]:
    found = {at: set(before) for at in before}
    found[start] = {start}
    changed = True
    while changed:
        changed = False
        for at in before:
            if at != start:
                new = {at}.union(set.intersection(*(found[b] for b in before[at])))
                changed |= new != found[at]
                found[at] = new
    return found


def _cyclic(nodes: Mapping[int, object], edges: Sequence[tuple[int, int]]) -> bool:
    count = dict.fromkeys(nodes, 0)
    after: dict[int, list[int]] = {}
    for a, b in edges:
        count[b] += 1
        after.setdefault(a, []).append(b)
    ready = [at for at, n in count.items() if not n]
    for at in ready:
        for b in after.get(at, ()):
            count[b] -= 1
            if not count[b]:
                ready.append(b)
    return len(ready) < len(count)


def _run(tool: str, *words: str) -> str:
    try:
        return subprocess.run([TOOLS + tool, *words], capture_output=True, text=True, check=True).stdout
    except FileNotFoundError:
        raise Failure(f"{TOOLS}{tool} is not installed; ./fledge setup --on leon3 installs it") from None
    except subprocess.CalledProcessError as error:
        raise Failure(error.stderr.strip().splitlines()[-1]) from None
