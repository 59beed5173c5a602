# SPDX-License-Identifier: Apache-2.0
"""The time of an update of the filters of navigation: each shall need less than 5 us, also one with a measurement.

    ./fledge bench filters
"""
from __future__ import annotations

import ctypes

from bench.rows import Rows, in_turn, options, report
from bench.sim import library

CASES = {"AttitudeMekf": ["rates alone", "measured attitude, 1 rate", "measured attitude, 16 rates"],
         "AttitudeUkf": ["rates alone", "measured attitude, 1 rate", "measured attitude, 16 rates"],
         "SunLine": ["with a gyro", "without a gyro"],
         "ChebyshevEphemeris": ["16 coefficients"],
         "ElementEphemeris": ["J2"]}
LIMIT = 5.0     # [us]


def main(arguments: list[str]) -> int:
    chosen = options("filters", arguments, runs=7)
    lib = library()
    lib.time_filter_update.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_long]
    lib.time_filter_update.restype = ctypes.c_double
    samples = in_turn({(module, i): lambda module=module, i=i: 1e6 * lib.time_filter_update(module.encode(), i, 50_000)
                       for module, cases in CASES.items() for i in range(len(cases))}, chosen.runs)
    rows = Rows()
    for (module, i), values in samples.items():
        rows.add(f"{module}, {CASES[module][i]}", "update", values, "us",
                 note="" if min(values) < LIMIT else f"more than {LIMIT:g}")
    report(rows, chosen)
    return int(any(min(values) >= LIMIT for values in samples.values()))
