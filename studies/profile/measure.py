# SPDX-License-Identifier: Apache-2.0
"""What is measured of a target, and what of it must not grow."""
from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

GROWTH = 0.02       # of the instructions per cycle, from the first third of the loop to the last
WITHIN = 6          # points that a stay in a mode needs to be judged
Points = list[tuple[int, float]]    # (cycle, value)


@dataclass
class Profile:
    """Sizes in bytes. None: not known of this target."""
    target: str
    method: str
    cycles: int
    same: bool | None = None            # whether flight put out the bits of the desktop
    strict: bool = True                 # its loop must not grow; False: of the desktop, which keeps what is recorded
    # initialisation
    init_instructions: int | None = None
    init_heap: int | None = None        # at most
    init_stack: int | None = None       # at most
    # loop
    instructions: Points = field(default_factory=list)  # per cycle, of the cycles from this one to the next point
    changes: list[int] = field(default_factory=list)    # the cycles at which the mode changes
    heap: Points = field(default_factory=list)
    loop_heap: int | None = None        # at most
    loop_stack: int | None = None       # at most
    allocations: int | None = None      # requests to allocators in the loop
    functions: list[tuple[str, float]] = field(default_factory=list)   # instructions per cycle, the dearest first
    time: dict[str, float] = field(default_factory=dict)        # [s] per cycle: median, p99, most
    time_of: str = ""
    # the program
    static: int | None = None           # memory that the program has from its start
    code: dict[str, int] = field(default_factory=dict)          # of each part
    executable: int | None = None       # the file, stripped
    total_instructions: int | None = None       # of the whole program

    @property
    def per_cycle(self) -> float | None:
        """Instructions of a cycle, the mean of the loop."""
        return _mean(self.instructions, 0, self.cycles, self.cycles)

    def thirds(self) -> tuple[list[float], list[float]]:
        """(instructions per cycle, heap at most) in each third of the loop; [] of figures that are not known."""
        parts = _parts(0, self.cycles)
        heap = [[h for cycle, h in self.heap if a <= cycle <= b] for a, b in parts]
        counts = [_mean(self.instructions, a, b, self.cycles) for a, b in parts]
        return ([count for count in counts if count is not None] if None not in counts else [],
                [max(samples) for samples in heap] if all(heap) else [])

    def problems(self) -> list[str]:
        """What is wrong with the loop, in words."""
        texts = [] if self.same in (None, True) else ["its outputs differ from the desktop's"]
        if not self.strict:
            return texts
        _, heap = self.thirds()
        if heap and heap[2] > heap[0]:
            texts.append(f"its heap grows in the loop, from {heap[0]:,.0f} to {heap[2]:,.0f} bytes between the first "
                         f"and the last third, {(heap[2] - heap[0]) / (self.cycles * 2 / 3):.3g} bytes per cycle")
        if self.allocations:
            texts.append(f"its loop allocates: {self.allocations:,} requests in {self.cycles:,} cycles")
        for begin, end in self._stays():
            first, second, third = (_mean(self.instructions, *part, cycles=self.cycles) or 0.0
                                    for part in _parts(begin, end))
            if first < second < third and third > first * (1 + GROWTH):
                where = f"the cycles {begin:,} to {end:,}, of one mode" if self.changes else "the loop"
                texts.append(f"a cycle takes ever more instructions: {first:,.0f}, {second:,.0f} and {third:,.0f} in "
                             f"the thirds of {where}, {third / first - 1:+.1%}")
        return texts

    def _stays(self) -> Iterator[tuple[int, int]]:
        """(begin, end) of the cycles in each mode, in whole points; another mode may well take more."""
        stops = [*(cycle for cycle, _ in self.instructions[1:]), self.cycles]
        for begin, end in zip([0, *self.changes], [*self.changes, self.cycles]):
            own = [(start, stop) for (start, _), stop in zip(self.instructions, stops)
                   if begin <= start < stop <= end]
            if len(own) >= (WITHIN if self.changes else 1):
                yield own[0][0] if self.changes else begin, own[-1][1]

    def as_json(self) -> dict[str, Any]:
        counts, heap = self.thirds()
        return {**dataclasses.asdict(self), "per_cycle": self.per_cycle,
                "thirds": {"instructions": counts, "heap": heap}, "problems": self.problems()}


def _parts(begin: int, end: int) -> list[tuple[int, int]]:
    """(begin, end) of each third of some cycles."""
    ends = [begin + round((end - begin) * i / 3) for i in range(4)]
    return list(zip(ends, ends[1:]))


def _mean(points: Points, begin: int, end: int, cycles: int) -> float | None:
    """The mean of a step function of the cycle."""
    if not points or end <= begin:
        return None
    stops = [*(cycle for cycle, _ in points[1:]), cycles]
    total = sum(value * max(0, min(stop, end) - max(start, begin)) for (start, value), stop in zip(points, stops))
    return total / (end - begin)
