# SPDX-License-Identifier: Apache-2.0
"""The time of an update of control and actuation: each shall need less than 150 ns.

Best-known open peer on this kind of machine, recorded in 2026-11: 66 to 470 ns per update of such a module.
"""
from __future__ import annotations

from bench.rows import Rows, in_turn, options, report
from bench.sim import library

MODULES = ["MrpFeedback", "MrpSteering", "RateServo", "WheelTorques", "WheelBalance", "WheelMonitor", "ThrusterMapping",
           "ThrusterFiring", "MomentumDump", "RodTorques"]
FORCED = "ThrusterMapping, with a force"
REVERSED = "ThrusterMapping, another torque each time"    # so that other thrusters push: its worst case
LIMIT = 150.0   # [ns]


def main(arguments: list[str]) -> int:
    chosen = options("control", arguments, runs=7)
    lib = library()
    lib.time_control_update.argtypes = lib.time_flight_update.argtypes
    lib.time_control_update.restype = lib.time_flight_update.restype
    names = [*MODULES, FORCED, REVERSED]
    samples = in_turn({m: lambda m=m: 1e9 * lib.time_control_update(m.encode(), 200_000) for m in names}, chosen.runs)
    rows = Rows()
    for module, values in samples.items():
        rows.add(module, "update", values, "ns", note="" if min(values) < LIMIT else f"more than {LIMIT:g}")
    report(rows, chosen)
    return int(any(min(samples[module]) >= LIMIT for module in MODULES))
