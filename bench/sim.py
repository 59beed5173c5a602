# SPDX-License-Identifier: Apache-2.0
"""How fast the nadir spin flies: 9,600 s at 0.1 s (RK4) with flight at 2 Hz.

The simulator runs against a loop of the same equations written by hand for this one mission, in
turn, in this process, with the same compiler flags; their end states must agree.
The best-known open peer, built from its sources, took 3.22 s for this run where Fledge took 0.0307 s, in turn on two
quiet cores in 2026-11; 0.65 to 1.2 s to import, 125 to 230 MB.
"""
from __future__ import annotations
import ctypes
import os
import subprocess
import sys
import tempfile
import time

import fledge
from fledge.units import s

from bench.rows import Rows, in_turn, options, pair_by_pair, report

SECONDS = 9600
STEPS = 10 * SECONDS
UPDATES = ["HillPointing", "EulerRotation", "TrackingError", "MrpFeedback", "WheelTorques"]


def library():
    from fledge.disk import build_folder
    path = build_folder() / "python" / "libfledge_bench.so"
    lib = ctypes.CDLL(str(path))
    lib.hand_written_loop.argtypes = [ctypes.c_long, ctypes.POINTER(ctypes.c_double)]
    lib.time_flight_update.argtypes = [ctypes.c_char_p, ctypes.c_long]
    lib.time_flight_update.restype = ctypes.c_double
    return lib


def wall(work):
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def simulator_state(sim):
    state = sim.world.craft.state
    speeds = sim.world.wheels.speeds.Omega[:4]
    return [*state.r_BN_N, *state.v_BN_N, *state.sigma_BN, *state.omega_BN_B, *speeds]


def compare(ours, theirs):
    """The largest relative difference of the end states, each vector by its own length."""
    worst = 0.0
    for first, last in ((0, 3), (3, 6), (6, 9), (9, 12), (12, 16)):
        a, b = ours[first:last], theirs[first:last]
        length = sum(x * x for x in b) ** 0.5
        worst = max(worst, sum((x - y) ** 2 for x, y in zip(a, b)) ** 0.5 / length)
    return worst


def prepared(record=None):
    """The mission before its first instant, recording every so often."""
    sim = fledge.load("nadir_spin")
    if record:
        sim.record(sim.flight.tracking.error, sim.flight.motor.command, every=record)
    sim.reset()
    return sim


def start_up(rows, runs):
    """Import and build in fresh interpreters, which report their own peak, in turn with an import of numpy alone."""
    code = ("import time; start = time.perf_counter(); import fledge\n"
            "sim = fledge.load('nadir_spin'); sim.reset(); built = time.perf_counter()\n"
            "import resource; peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024\n"
            "peak_built = peak(); before = time.perf_counter()\n"
            f"sim.run({SECONDS}); print(built - start, peak_built, time.perf_counter() - before, peak())\n")
    numpy = "import time; start = time.perf_counter(); import numpy; print(time.perf_counter() - start)"
    cached = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}

    def figures(program):
        done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True, env=cached)
        return [float(x) for x in done.stdout.split()]

    turns = in_turn({"numpy": lambda: figures(numpy), "sim": lambda: figures(code)}, runs)
    rows.add("import numpy", "import and build", [seconds for seconds, in turns["numpy"]], "s")
    for figure, unit, values in zip(("import and build", "peak memory built", "first run", "peak memory flown"),
                                    ("s", "MB", "s", "MB"), zip(*turns["sim"])):
        rows.add("nadir_spin", figure, values, unit, "import numpy" if figure == "import and build" else None)


def main(arguments: list[str]) -> None:
    chosen = options("sim", arguments, runs=15)
    runs = chosen.runs
    rows = Rows()
    lib = library()
    end = (ctypes.c_double * 16)()
    sim = prepared()
    recorded = prepared(record=10 * s)
    archived = prepared(record=10 * s)

    def fly(simulation):
        simulation.run(SECONDS * s)

    alone = fledge.load("nadir_spin")
    alone.flight.mode("on", [alone.flight.gnc])
    alone.flight.start_in(alone.flight.mode("off", []))

    # In turn, so that a slow spell of the machine meets all alike.
    times: dict[str, list[float]] = {"hand": [], "sim": [], "recorded": [], "archived": [], "alone": []}
    with tempfile.TemporaryDirectory() as folder:
        for i in range(runs + 1):
            for simulation in (sim, recorded, archived, alone):
                simulation.reset()
            archived.archive(os.path.join(folder, "run.mcap"))
            sample = dict(
                hand=wall(lambda: lib.hand_written_loop(STEPS, end)), sim=wall(lambda: fly(sim)),
                recorded=wall(lambda: fly(recorded)), archived=wall(lambda: fly(archived)),
                alone=wall(lambda: fly(alone)))
            archived.close_archive()
            if i:  # the first warms up
                for name, value in sample.items():
                    times[name].append(value)
    difference = compare(simulator_state(sim), list(end))
    if not difference < 1e-9:
        raise SystemExit(f"the end states differ by {difference:.3g} (relative): the comparison is void")

    per_step = {name: [1e9 * t / STEPS for t in values] for name, values in times.items()}
    rows.add("hand_written_loop", "wall", times["hand"], "s")
    rows.add("nadir_spin", "wall", times["sim"], "s", "hand_written_loop",
             note=pair_by_pair(times["sim"], times["hand"]))
    rows.add("hand_written_loop", "step", per_step["hand"], "ns")
    rows.add("nadir_spin", "step", per_step["sim"], "ns", "hand_written_loop")
    rows.add("recorded every 10 s", "wall", times["recorded"], "s",
             "nadir_spin", note=pair_by_pair(times["recorded"], times["sim"]))
    rows.add("and archived", "wall", times["archived"], "s", "nadir_spin",
             note=pair_by_pair(times["archived"], times["sim"]))
    rows.add("end state", "difference", difference, "relative", note="simulator against hand-written loop")

    # The shares of a step: schedule and wires are the rest after the world and the updates. Least times are
    # compared, because a slow spell of the machine does not change them.
    flight = 0.0
    for module in UPDATES:
        samples = [1e9 * lib.time_flight_update(module.encode(), 200_000) for _ in range(7)]
        rows.add(module, "update", samples, "ns")
        flight += min(samples) / 5
    rows.add("world alone", "step", per_step["alone"], "ns")
    rows.add("flight updates", "share of a step", flight, "ns", note="a fifth of their sum: 2 Hz against 10 Hz")
    rest = min(per_step["sim"]) - min(per_step["alone"]) - flight
    rows.add("schedule and wires", "share of a step", max(rest, 0.0), "ns",
             note="those of flight" if rest > 0.0 else "less than these times can resolve")

    start_up(rows, runs)
    report(rows, chosen)
