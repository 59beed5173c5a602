# SPDX-License-Identifier: Apache-2.0
"""A LEON3 board in the closed loop: the emulator counts every instruction, and shows the heap and the stack in the
board's memory, without a change of the program."""
from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

from fledge.emulator import Board
from fledge.profile import code
from fledge.profile.measure import Profile
from fledge.targets.leon3.board import read_board

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from fledge.archive import Archive
    from fledge.targets import Part

MARKS = 60
PAINT = 0x5AC3A53C      # LEON3_PAINT: of a stack that was never used


def measure(target: Any, part: Part, record: Path) -> Profile:
    from fledge.archive import Archive

    built, job = target.build(part), part.job
    board = Board(target.board, built)
    board.fly(job.begun(), part.tables(), part.process)
    flight, core = board.in_flight, board.core
    flight.script = [(entry.t, entry.packet) for entry in part.script]
    after: list[int] = []       # the instructions until the end of each tick; the first is the reset
    heap: list[tuple[int, int]] = []
    stack: list[tuple[int, int]] = []
    memory = Memory(board)
    outputs: list[tuple[int, bytes]] = []
    crossing = [output for id, output in enumerate(part.mission.outputs, len(part.mission.inputs))
                if board._link.carries(id)]
    views = [getattr(board.sim.process(part.process).instances[name], port) for name, port in
             (output.path.split(".")[1:] for output in crossing)]
    tick, exchange = flight.tick, flight.exchange
    every = max(1, len(part.instants) // MARKS)

    def counted(t: int) -> bool:
        answered = tick(t)
        cycle = len(after) - 1
        if cycle < 1 or cycle % every == 0:
            heap.append((cycle, memory.heap()))
            stack.append((cycle, memory.stack()))
        after.append(core.instructions)
        return answered

    def compared(t: int) -> None:
        from fledge import objects

        exchange(t)
        outputs.append((t, b"".join(objects.memory(view) for view in views)))

    flight.tick = counted
    board.sim.kernel.process(part.process).fly_by(compared)
    board.sim.run(until=job.duration)

    n = len(after) - 1
    steps = [b - a for a, b in zip(after, after[1:])]
    parts, static = code.by_part(built)
    clock = read_board(target.board)["clock"]
    link = board._link
    profile = Profile(target.name, "the emulator, in the closed loop", n, code=parts, static=static,
                      executable=sum(parts.values()),
                      time={"mean": link.cycles / link.ticks / clock}, time_of="simulated, from tick to answer")
    with Archive(record) as archive:
        profile.same = _same(archive, crossing, outputs)
    profile.total_instructions = after[-1]
    # The first cycle also begins the record: what that takes belongs to the start.
    profile.init_instructions = after[0] + steps[0] - steps[1]
    steps[0] = steps[1]
    profile.instructions = [(i, sum(steps[i:i + every]) / len(steps[i:i + every])) for i in range(0, n, every)]
    profile.init_heap, profile.init_stack = memory.peak or heap[0][1], stack[0][1]
    profile.heap = [(cycle, bytes_) for cycle, bytes_ in heap[1:]]
    if memory.refused:      # under the lock no request succeeds
        profile.allocations = sum(refusals != memory.refused[0] for refusals in memory.refused)
    profile.loop_heap = max((used for _, used in heap[1:]), default=None)
    profile.loop_stack = max((used for _, used in stack[1:]), default=None)
    return profile


class Memory:
    """The heap and the stack of a program, in the board's memory."""

    def __init__(self, board: Any) -> None:
        self.board, self.peak = board, 0
        self.refused: list[int] = []    # [bytes] of the last request that the lock refused, at each mark under it
        symbols = board.core.symbols()
        self.arena, self.sbrk = "arena_in_use" in symbols, "heap_end" in symbols

    def word(self, place: int | str) -> int:
        return int.from_bytes(self.board.peek(place, 4), "big")

    def heap(self) -> int:
        """[bytes] in use: those of the C library, and of a script's arena."""
        used = self.word("heap_end") - self.board.address("leon3_heap") if self.sbrk else 0
        arena = self.word("arena_in_use") if self.arena else 0
        if arena:       # targets/micropython/arena.h
            _, _, now, peak, locked, wanted = struct.unpack(">6I", self.board.peek(arena, 24))
            self.peak = self.peak or used + peak
            used += now
            if locked:
                self.refused.append(wanted)
        return used

    def stack(self) -> int:
        """[bytes] used so far at most."""
        low, high = map(self.board.address, ("leon3_stack", "leon3_stack_end"))
        words = struct.unpack(f">{(high - low) // 4}I", self.board.peek(low, high - low))
        unused = next((i for i, word in enumerate(words) if word != PAINT), len(words))
        return high - low - 4 * unused


def _same(archive: Archive, messages: Sequence[Any], outputs: Sequence[tuple[int, bytes]]) -> bool:
    """Whether these outputs, all messages at each instant, are those of a record."""
    expected: dict[int, bytes] = {}
    for message in messages:
        topic = f"/{message.path.replace('.', '/')}"
        for t, row in zip(archive.time_ns(topic).tolist(), archive[topic]):
            expected[t] = expected.get(t, b"") + row.tobytes()
    return all(expected[t] == content for t, content in outputs if t in expected)
