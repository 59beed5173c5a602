# SPDX-License-Identifier: Apache-2.0
"""Clocks of spacecraft by SPICE's kernels (.tsc, type 1): their readings, ticks and instants.

    clock = sclk.read("craft.tsc")
    clock.ns(clock.ticks_of("1/0401930040:07327"))
    clock.text(clock.ticks(times))

A reading is a partition, from a reset of the clock to the next, and fields, the last of which counts ticks. Ticks count
on through all partitions.

Source: NAIF, "SCLK Required Reading".
"""
from __future__ import annotations

import os
import re
from dataclasses import dataclass
from itertools import accumulate
from math import prod
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from fledge.errors import listed
from fledge.files import text_kernel
from fledge.files.kvn import refuse_at
from fledge.files.values import Clock

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

READING = re.compile(r"\s*(?:(\d{1,18})\s*/)?\s*(\d{1,18}(?:(?:\s*[.:,-]\s*|\s+)\d{1,18})*)\s*", re.ASCII)
DELIMITERS = ".:-, "        # by SCLK01_OUTPUT_DELIM, from 1
J2000 = "2000-01-01T12:00:00"


@dataclass
class Sclk:
    """A clock. number: of the spacecraft, NAIF's without its sign; moduli, offsets: of the fields; partitions: first
    and last ticks of each, as the fields count; scale: "TDB" or "TT", of parallel.

    From begins[i] (n,) [ticks] on, at parallel[i] (n,) [ns] past J2000 on the scale, a count of the first field takes
    rates[i] (n,) [s].
    """
    where: str
    number: int
    moduli: list[int]
    offsets: list[int]
    delimiter: str
    partitions: list[tuple[int, int]]
    scale: str
    begins: np.ndarray
    parallel: np.ndarray
    rates: np.ndarray

    def refuse(self, text: str) -> NoReturn:
        """Raise SetupError, with the file."""
        refuse_at(self.where, text)

    @property
    def weights(self) -> list[int]:
        """Ticks of a count of each field."""
        return [prod(self.moduli[i + 1:]) for i in range(len(self.moduli))]

    @property
    def ends(self) -> list[int]:
        """Ticks at the end of each partition."""
        return list(accumulate(last - first for first, last in self.partitions))

    def ticks_of(self, reading: str) -> int:
        """Ticks of a reading "1/12:30". Fields that are left out have their least value; without a partition it is the
        first that has the reading. Raises SetupError."""
        found = READING.fullmatch(reading)
        fields = re.split(r"\s*[.:,-]\s*|\s+", found[2]) if found else []
        if not found or len(fields) > len(self.moduli):
            self.refuse(f"expected a reading of up to {len(self.moduli)} fields, {self.text(0)}; found {reading!r}")
        count = sum((int(value) - offset) * weight for value, offset, weight in zip(fields, self.offsets, self.weights))
        chosen = [int(found[1]) - 1] if found[1] else range(len(self.partitions))
        for i in chosen:
            if 0 <= i < len(self.partitions) and self.partitions[i][0] <= count <= self.partitions[i][1]:
                return self.ends[i] - self.partitions[i][1] + count
        self.refuse(f"expected a reading within a partition, {self._spans()}; found {reading!r}")

    def _spans(self) -> str:
        return listed([f"{i}/{self._fields(first)} to {i}/{self._fields(last)}"
                       for i, (first, last) in enumerate(self.partitions, 1)])

    def _fields(self, count: int) -> str:
        texts = []
        for modulus, offset, weight in zip(self.moduli, self.offsets, self.weights):
            value, count = divmod(count, weight)
            texts.append(f"{value + offset:0{len(str(modulus + offset - 1))}}")
        return self.delimiter.join(texts)

    def text(self, ticks: float) -> str:
        """The reading at ticks, rounded to a whole one. Raises SetupError."""
        whole, ends = round(float(ticks)), self.ends
        self._require(np.array([float(ticks)]), 0)
        i = next((i for i, end in enumerate(ends) if whole < end), len(ends) - 1)
        return f"{i + 1}/{self._fields(self.partitions[i][1] - ends[i] + whole)}"

    def _require(self, ticks: np.ndarray, least: float) -> None:
        bad = ticks[~((ticks >= least) & (ticks <= self.ends[-1]))]
        if len(bad):
            self.refuse(f"expected ticks from {least:.0f} to {self.ends[-1]}; found {bad[0]:.15g}")

    def ns(self, ticks: ArrayLike) -> np.ndarray:
        """[ns] (m,) of TDB past J2000 at ticks (m,), which need not be whole. Raises SetupError."""
        at = np.atleast_1d(np.asarray(ticks, float))
        self._require(at, self.begins[0])
        i = _before(self.begins, at)
        past = (at - self.begins[i]) / self.weights[0] * self.rates[i] * 1e9
        if np.any(np.abs(past) > 2.0**61):
            self.refuse(f"expected ticks up to 73 years past those of the kernel; found {np.max(at):.15g}")
        found: np.ndarray = self.parallel[i] + np.rint(past).astype(np.int64)
        return found if self.scale == "TDB" else self._tdb(found)

    def _tdb(self, tt: np.ndarray) -> np.ndarray:
        clock = Clock("TT", zero=J2000)
        return np.array([clock.past(int(t)) for t in tt], dtype=np.int64)

    def ticks(self, times: ArrayLike) -> np.ndarray:
        """Ticks (m,), with fractions, at times [ns] (m,) of TDB past J2000. Raises SetupError."""
        t = np.atleast_1d(np.asarray(times, dtype=np.int64))
        if self.scale == "TT":      # TDB - TT is the same to 1 ns at instants that differ by as little
            t = 2 * t - self._tdb(t)
        if np.any(t < self.parallel[0]):
            begin = Clock("TDB").text(self.ns(self.begins[0])[0])
            self.refuse(f"the clock is known from {begin} TDB on; found an earlier time")
        i = _before(self.parallel, t)
        found = self.begins[i] + (t - self.parallel[i]) / 1e9 / self.rates[i] * self.weights[0]
        self._require(found, self.begins[0])
        return found


def _before(knots: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The index of the last knot that is not after x (m,), bisected as SPICE does: kernels of LRO, TGO and SELENE have
    knots out of order, at which the way decides."""
    last = len(knots) - 1
    low, high = np.zeros(len(x), dtype=int), np.full(len(x), last)
    while np.any(high - low > 1):
        middle = (low + high) // 2
        is_after = x < knots[middle]
        low, high = np.where(is_after, low, middle), np.where(is_after, middle, high)
    return np.where(x >= knots[last], last, low)


def read(path: str | os.PathLike[str], spacecraft: int | None = None) -> Sclk:
    """The clock of a kernel. spacecraft: its NAIF number, of a kernel with several. Raises SetupError with file and
    line."""
    kernel = text_kernel.read(path)
    known = [int(name[15:]) for name in kernel.values if re.fullmatch("SCLK_DATA_TYPE_[0-9]{1,9}", name)]
    if len(known) != 1 and spacecraft is None or spacecraft is not None and abs(spacecraft) not in known:
        kernel.refuse("expected the number of a spacecraft whose clock the kernel has, "
                      f"{listed([str(-n) for n in known])}; found {spacecraft}")
    n = known[0] if spacecraft is None else abs(spacecraft)
    if (kind := kernel.numbers(f"SCLK_DATA_TYPE_{n}", 1)[0]) != 1:
        kernel.refuse(f"SCLK_DATA_TYPE_{n}: expected 1; found {kind}")
    fields = int(kernel.numbers(f"SCLK01_N_FIELDS_{n}", 1)[0])
    moduli, offsets = ([int(x) for x in kernel.numbers(f"SCLK01_{name}_{n}", fields)] for name in ("MODULI", "OFFSETS"))
    delimiter = int(kernel.numbers(f"SCLK01_OUTPUT_DELIM_{n}", 1)[0])
    system = kernel.numbers(f"SCLK01_TIME_SYSTEM_{n}", 1)[0] if f"SCLK01_TIME_SYSTEM_{n}" in kernel.values else 1
    firsts = [int(x) for x in kernel.numbers(f"SCLK_PARTITION_START_{n}")]
    lasts = [int(x) for x in kernel.numbers(f"SCLK_PARTITION_END_{n}", len(firsts))]
    knots = kernel.numbers(f"SCLK01_COEFFICIENTS_{n}")
    begins, rates = (np.array(knots[i::3], float) for i in (0, 2))
    parallel = [int(round(x * 10**9)) for x in knots[1::3]]
    for name, good, expected in (
            ("SCLK01_N_FIELDS", fields == len(moduli) == len(offsets), "the number of the moduli and offsets"),
            ("SCLK01_MODULI", min(moduli) > 0 and moduli == kernel.numbers(f"SCLK01_MODULI_{n}"), "whole numbers > 0"),
            ("SCLK01_OUTPUT_DELIM", 1 <= delimiter <= len(DELIMITERS), "a number from 1 to 5"),
            ("SCLK01_TIME_SYSTEM", system in (1, 2), "1 (TDB) or 2 (TT)"),
            ("SCLK_PARTITION_END", all(a < b for a, b in zip(firsts, lasts)), "an end after each start"),
            ("SCLK01_COEFFICIENTS", len(knots) % 3 == 0 and bool(np.all(rates > 0))
             and all(abs(t) < 2**62 for t in parallel),
             "triplets of ticks, a time within 146 years of 2000 and a rate > 0")):
        if not good:
            kernel.refuse(f"{name}_{n}: expected {expected}", kernel.values[f"{name}_{n}"][0].line)
    return Sclk(kernel.where, n, moduli, offsets, DELIMITERS[delimiter - 1], list(zip(firsts, lasts)),
                "TDB" if system == 1 else "TT", begins, np.array(parallel, dtype=np.int64), rates)
