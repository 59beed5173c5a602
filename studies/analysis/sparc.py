# SPDX-License-Identifier: Apache-2.0
"""SPARC V8 as the LEON3 has it: the parts of an instruction, its cycles, and what it makes of known values.

The cycles are those of emulator/cpu/timing.cpp, which depend on the operation alone: caches hit.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable

ANNULLED, TRAP = 1, 5
RESTORE_LINK = 15   # %o7: where a call came from
ICC = 32            # the place of the condition codes in a State, behind the registers

_ARITHMETIC = {**dict.fromkeys((0x0A, 0x0B, 0x1A, 0x1B), 4), **dict.fromkeys((0x0E, 0x0F, 0x1E, 0x1F), 35),
               0x38: 3, 0x39: 3}
_MEMORY = {**dict.fromkeys((0x03, 0x13, 0x23), 2),
           **dict.fromkeys((0x04, 0x05, 0x06, 0x14, 0x15, 0x16, 0x24, 0x25), 2),
           **dict.fromkeys((0x07, 0x17, 0x27), 3), **dict.fromkeys((0x0D, 0x0F, 0x1D, 0x1F, 0x3C), 5)}
_FLOATING = {0x29: 24, 0x2A: 25, 0x4D: 16, 0x4E: 17}    # all others: 4

# A value that is known: a number (None, n), or n more than what a symbol stands for: (pc, register) of the instruction
# that made it, or (block, register, "phi") where paths with different values meet.
Value = tuple[tuple | None, int]
# Of the 32 registers, and of the condition codes: (a, b, carry) of the comparison a - b that set them, where carry says
# whether they tell of unsigned numbers too; None: of something else.
State = list


def number(n: int) -> Value:
    return None, n & 0xFFFFFFFF


def plus(a: Value, b: Value, sign: int = 1) -> Value | None:
    """a + b or a - b, where that is known."""
    if b[0] is None:
        return a[0], (a[1] + sign * b[1]) & 0xFFFFFFFF
    if sign > 0 and a[0] is None:
        return b[0], (a[1] + b[1]) & 0xFFFFFFFF
    return number(a[1] - b[1]) if sign < 0 and a[0] == b[0] else None


def signed(n: int) -> int:
    return n - (1 << 32) if n & 0x80000000 else n


def holds(condition: int, a: int, b: int) -> bool:
    """Whether a branch is taken after the comparison of two numbers of 32 bits."""
    difference = (a - b) & 0xFFFFFFFF
    less, low = signed(a) < signed(b), a < b
    return [False, a == b, signed(a) <= signed(b), less, a <= b, low, difference >> 31 == 1,
            signed(difference) != signed(a) - signed(b)][condition & 7] ^ (condition >= 8)


@dataclass(frozen=True)
class Instruction:
    """A word of code at its address."""
    pc: int
    word: int

    @property
    def op(self) -> int:
        return self.word >> 30

    @property
    def op2(self) -> int:
        return self.word >> 22 & 7

    @property
    def op3(self) -> int:
        return self.word >> 19 & 0x3F

    @property
    def rd(self) -> int:
        return self.word >> 25 & 31

    @property
    def rs1(self) -> int:
        return self.word >> 14 & 31

    @property
    def immediate(self) -> int | None:
        """None: the second operand is a register."""
        return (self.word & 0x1FFF ^ 0x1000) - 0x1000 if self.word & 0x2000 else None

    @property
    def condition(self) -> int:
        return self.word >> 25 & 15

    @property
    def annuls(self) -> bool:
        return bool(self.word >> 29 & 1)

    @property
    def is_branch(self) -> bool:
        return self.op == 0 and self.op2 in (2, 6)

    @property
    def is_integer_branch(self) -> bool:
        return self.op == 0 and self.op2 == 2

    @property
    def is_call(self) -> bool:
        return self.op == 1

    @property
    def is_jump(self) -> bool:
        return self.op == 2 and self.op3 == 0x38

    @property
    def is_return(self) -> bool:
        return (self.is_jump and self.rd == 0 and self.rs1 in (15, 31) and self.immediate in (8, 12)
                or self.op == 2 and self.op3 == 0x39)

    @property
    def is_save(self) -> bool:
        return self.op == 2 and self.op3 == 0x3C

    @property
    def is_restore(self) -> bool:
        return self.op == 2 and self.op3 == 0x3D

    @property
    def is_gap(self) -> bool:
        """The size of a struct behind the call of a function that returns it, which is not executed."""
        return self.op == 0 and self.op2 == 0

    @property
    def target(self) -> int:
        """Of a call or a branch."""
        bits = 30 if self.is_call else 22
        displacement = (self.word & (1 << bits) - 1 ^ 1 << bits - 1) - (1 << bits - 1)
        return (self.pc + 4 * displacement) & 0xFFFFFFFF

    @cached_property
    def cycles(self) -> int:
        """Without what it annuls or traps."""
        if self.op == 2 and self.op3 in (0x34, 0x35):
            return _FLOATING.get(self.word >> 5 & 0x1FF, 4)
        return {2: _ARITHMETIC, 3: _MEMORY}.get(self.op, {}).get(self.op3, 1)

    def follow(self, state: State) -> None:
        """Change a state as the instruction does. What it does not know becomes a symbol of its own."""
        made: Callable[[int], Value] = lambda register: ((self.pc, register), 0)
        if self.op == 0:
            if self.op2 == 4 and self.rd:
                state[self.rd] = number(self.word << 10)
            return
        if self.op == 3:
            if self.op3 < 0x20 and self.op3 & 15 not in (4, 5, 6, 7) or self.op3 == 0x3C:  # loads and exchanges
                for register in {self.rd, self.rd | (self.op3 & 15 == 3)} - {0}:
                    state[register] = made(register)
            return
        if self.op == 1 or self.op3 in (0x34, 0x35, 0x39, 0x3A) or 0x30 <= self.op3 <= 0x33:
            return
        a = state[self.rs1]
        b = number(self.immediate) if self.immediate is not None else state[self.word & 31]
        result = self._result(a, b)
        if self.is_save:
            state[24:32] = state[8:16]
            state[8:24] = [made(register) for register in range(8, 24)]
        elif self.is_restore:
            state[8:16] = state[24:32]
            state[16:32] = [made(register) for register in range(16, 32)]
        if 0x10 <= self.op3 < 0x20 or self.op3 in (0x20, 0x21, 0x22, 0x23, 0x24):
            zero = number(0)
            state[ICC] = {0x14: (a, b, True), 0x10: (a, number(-b[1]), False) if b[0] is None else None}.get(
                self.op3, (result, zero, True) if self.op3 in (0x11, 0x12, 0x13) and result else None)
            if state[ICC] is None and self.op3 in (0x11, 0x12, 0x13) and self.rd:
                state[ICC] = (made(self.rd), zero, True)
        if self.rd:
            state[self.rd] = result or made(self.rd)

    def _result(self, a: Value, b: Value) -> Value | None:
        kind = self.op3 & ~0x10 if self.op3 < 0x20 else self.op3
        if kind in (0, 0x3C, 0x3D):
            return plus(a, b)
        if kind == 4:
            return plus(a, b, -1)
        if kind == 2 and number(0) in (a, b):
            return b if a == number(0) else a
        if a[0] is None is b[0]:
            x, y = a[1], b[1]
            known = {1: x & y, 2: x | y, 3: x ^ y, 5: x & ~y, 0x25: x << (y & 31), 0x26: x >> (y & 31),
                     0x27: signed(x) >> (y & 31)}.get(kind)
            return None if known is None else number(known)
        return None
