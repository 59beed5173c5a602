# SPDX-License-Identifier: Apache-2.0
"""A process on this machine. The desktop flies first; its inputs of flight then play in the process, which puts out the
same bits, without the world and the exchange. Callgrind counts instructions between marks in these inputs, Massif sees
the heap and the stack, and the program itself measures its time and its script's heap."""
from __future__ import annotations

import copy
import subprocess
from bisect import bisect_right
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.errors import Failure
from fledge.profile import code, valgrind
from fledge.profile.measure import Profile
from fledge.targets.linux import inputs

if TYPE_CHECKING:
    from fledge.targets import Part

MARKS = 60
LOOP = ("mission_host_exchange", "mission_record_take")     # a cycle: the exchange, and its record
ALLOCATORS = ("malloc", "calloc", "realloc", "memalign", "arena_take", "arena_resize")


def measure(target: Any, part: Part, record: Path) -> Profile:
    built, folder = target.build(part).resolve(), (part.folder / f"profile_{target.name}").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    instants = inputs.capture(part, record)
    n = len(instants)
    if n < 6:
        raise Failure(f"profile: {n} cycles are too few; fly longer with --for")
    marks = sorted({round(i * (n - 1) / MARKS) for i in range(MARKS + 1)})
    file = inputs.write(folder / "inputs", instants, marks)
    command = [built, "--inputs", file, "--record", "record.mcap"]

    figures = plain(command, folder)
    with Archive(record) as ours, Archive(folder / "record.mcap") as its:
        same = not compare(ours, its, part.outputs, times=part.is_instant)
    parts, static = code.by_part(built)
    profile = Profile(target.name, "Valgrind, with the inputs of the closed loop", n, same, code=parts, static=static,
                      executable=code.stripped(built, target.size), time=times(figures), time_of="processor time")

    first, *stretches = valgrind.callgrind(command, folder, "inputs_mark")
    profile.init_instructions = first.total
    profile.total_instructions = first.total + sum(stretch.total for stretch in stretches)
    loop = stretches[:-1]       # what follows the last mark is the last cycle, and the end
    profile.instructions = [(mark, sum(stretch.inclusive[name] for name in LOOP) / (end - mark))
                            for stretch, mark, end in zip(loop, marks, marks[1:])]
    profile.allocations = sum(stretch.calls[name] for stretch in loop for name in ALLOCATORS)
    own: Counter[str] = sum((stretch.own for stretch in loop), Counter())
    profile.functions = [(name, cost / marks[-1]) for name, cost in own.most_common(12)]

    # Massif sees only an allocator that it can replace by one in a library.
    shared = copy.copy(target)
    shared.name, shared.link = f"{target.name}_shared", ("-no-pie",)
    snapshots = valgrind.massif([shared.build(part).resolve(), *command[1:]], folder)
    loader = snapshots[-1].time - profile.total_instructions      # what loads that library runs first
    ends = [first.total + loader]       # the instructions until each mark
    for stretch in loop:
        ends.append(ends[-1] + stretch.total)
    before = [snapshot for snapshot in snapshots if snapshot.time < ends[0]]
    during = [snapshot for snapshot in snapshots if ends[0] <= snapshot.time < ends[-1]]
    script = heap_marks(figures)
    profile.init_heap = max((snapshot.heap for snapshot in before), default=0) + max(
        (peak for t, _, peak in script[:1]), default=0)
    profile.init_stack = max((snapshot.stack for snapshot in before), default=None)
    profile.loop_stack = max((snapshot.stack for snapshot in during), default=None)

    def cycle_at(time: int) -> int:
        return marks[max(0, bisect_right(ends, time) - 1)]

    def script_heap(at: int) -> int:
        return next((used for tick, used, _ in reversed(script) if tick <= at), 0)

    heap: dict[int, int] = {mark: 0 for mark in marks}
    for seen in during:
        heap[cycle_at(seen.time)] = max(heap[cycle_at(seen.time)], seen.heap)
    held = 0
    for mark in marks:      # Massif writes a snapshot only now and then
        held = heap[mark] = heap[mark] or held
    profile.heap = [(mark, n + script_heap(mark)) for mark, n in heap.items()]
    profile.loop_heap = round(max(n for _, n in profile.heap))
    return profile


def plain(command: list[Any], folder: Path) -> dict[str, str]:
    """Run a target's program; returns its figures."""
    done = subprocess.run(list(map(str, command)), cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise Failure(f"profile: {command[0]} failed:\n{done.stderr.strip()}", 1)
    return dict(line.split(maxsplit=1) for line in done.stdout.splitlines() if " " in line)


def times(figures: dict[str, str]) -> dict[str, float]:
    """[s] The processor time of a cycle."""
    return {name: int(figures[f"cycle_cpu_ns_{name}"]) / 1e9 for name in ("least", "median", "p99", "most")}


def heap_marks(figures: dict[str, str]) -> list[tuple[int, int, int]]:
    """(cycles until then, bytes in use, most until then) of a script's heap."""
    marks = []
    for word in figures.get("heap", "").split():
        tick, used, peak = map(int, word.split(":"))
        marks.append((tick, used, peak))
    return marks
