# SPDX-License-Identifier: Apache-2.0
"""Flight under MicroPython by the thesis' method (chapter 7 and appendix E): a spin about an axis at rest for 400
minutes at 2 Hz, 48,000 cycles, and the sensor example of listing 9, beside the goals and the thesis' figures.

The inputs of flight are those of the closed loop, so its outputs are the desktop's, bit for bit. The goals that are
missed are listed at the end; the bench then ends with 1.
"""
from __future__ import annotations

import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

from fledge.errors import Failure
from fledge.files import build_folder
from fledge.profile import Profile, board, code, desktop, process, valgrind
from fledge.targets import TARGETS, Job, build
from fledge.targets.linux import inputs

from bench.rows import Rows, in_turn, median_ratio, options, report

NEEDS = ["profile", "micropython-dev", "leon3-micropython"]
MISSION, SECONDS, CYCLES = "inertial_spin", 23999.5, 48_000
SENSOR = build.ROOT / "bench/sensor.py"
CASES = ["linux", "micropython", "micropython-dev", "leon3-micropython", "wall", "sensor"]
# Of each target: bytes of the file, bytes of heap in the loop. None: no goal.
GOALS = {"micropython": (150_000, 8 * 1024), "micropython-dev": (200_000, 24 * 1024)}
INSTRUCTIONS = 1.2e9
missed: list[str] = []


def goal(what: str, value: float, limit: float | None, thesis: str = "") -> str:
    """The note beside a figure; a missed goal is kept for the end."""
    if limit is None:
        return thesis
    if value >= limit:
        missed.append(f"{what}: {value:,.0f}, goal under {limit:,.0f}")
    return f"{'MISSED, ' if value >= limit else ''}goal < {limit:,.0f}" + (f"; {thesis}" if thesis else "")


def spin(rows: Rows, name: str, part: Any, record: Path) -> Profile:
    """The figures of the mission on a target."""
    target = TARGETS[name]
    on_board = target.profiled_by == "board"
    found = (board if on_board else process).measure(target, part, record)
    size, heap = GOALS.get(name, (None, None))
    problems = found.problems()
    missed.extend(f"{name}: {one}" for one in problems)
    rows.add(name, "code" if on_board else "file, stripped", found.executable, "B",
             note=goal(f"{name}, file", found.executable, size, "thesis 1,691,816"))
    rows.add(name, "heap at init, most", found.init_heap, "B", note="thesis 206,848")
    rows.add(name, "heap in the loop", found.loop_heap, "B",
             note=goal(f"{name}, heap in the loop", found.loop_heap, heap, "thesis 327,680"))
    first, _, last = found.thirds()[1]
    rows.add(name, "its growth", last - first, "B", note=goal(f"{name}, growth of the heap", last - first, 1))
    if found.allocations is not None:
        rows.add(name, "requests in the loop", found.allocations, "", note=goal(
            f"{name}, requests for memory in the loop", found.allocations, 1))
    rows.add(name, "stack", max(found.init_stack or 0, found.loop_stack or 0), "B")
    rows.add(name, "instructions per cycle", found.per_cycle, "", note="with the record")
    if not on_board:
        built, folder = target.build(part).resolve(), (part.folder / f"profile_{name}").resolve()
        plain = valgrind.callgrind([built, "--inputs", folder / "inputs"], folder, "inputs_mark")
        total = sum(one.total for one in plain)
        rows.add(name, "instructions", total, "", note=goal(f"{name}, instructions", total, INSTRUCTIONS,
                                                            "thesis 3.5e9"))
        rows.add(name, "and with a record", found.total_instructions, "", note=goal(
            f"{name}, instructions with a record", found.total_instructions, INSTRUCTIONS))
        rows.add(name, "time per cycle", 1e6 * found.time["median"], "us", note="median, of the processor")
    else:
        rows.add(name, "instructions", found.total_instructions, "", note="with the record")
        rows.add(name, "time per cycle", 1e6 * found.time["mean"], "us", note="simulated")
    for part_name, n in found.code.items():
        rows.add(name, part_name, n, "B", note="code and constants")
    return found


def wall(rows: Rows, part: Any, runs: int) -> None:
    """The whole program, from its start to its end, beside the same mission under CPython, in turn."""
    folder = part.folder.resolve()
    file = inputs.write(folder / "inputs", inputs.capture(part, TARGETS["desktop"].fly(part.job)[part.process].record))

    def seconds(command: list[Any]) -> tuple[float, float]:
        """(in all, of the processor)"""
        start, before = time.perf_counter(), os.times()
        subprocess.run(list(map(str, command)), cwd=folder, check=True, stdout=subprocess.DEVNULL)
        after = os.times()
        return (time.perf_counter() - start, after.children_user + after.children_system - before.children_user
                - before.children_system)

    python = [sys.executable, "-P", "-c"]
    whole = desktop.PROGRAM.format(mission=MISSION, parameters={}, seed=0, duration=SECONDS)
    # Without flight: what is left of the loop is the world.
    world = whole.replace("sim.prepare()", "sim.flight.start_in(sim.flight.mode('off', []))\nsim.prepare()")
    cases: dict[str, Any] = {"CPython": partial(seconds, [*python, whole]),
                             "its world": partial(seconds, [*python, world])}
    for name in ("linux", "micropython", "micropython-dev"):
        cases[name] = partial(seconds, [TARGETS[name].build(part).resolve(), "--inputs", file])
    samples = in_turn(cases, runs)
    thesis = {"CPython": "flight and world; thesis 0.824, flight alone", "its world": "the same without flight",
              "micropython": "thesis 0.649"}
    for i, figure in enumerate(("whole run", "its processor time")):
        for name, pairs in samples.items():
            values, python_values = [one[i] for one in pairs], [one[i] for one in samples["CPython"]]
            note = thesis.get(name, "") if i == 0 else ""
            if name in GOALS:
                ratio = median_ratio(values, python_values)
                note = f"{ratio:.3g} of CPython's, pair by pair; {note}".rstrip("; ")
                if ratio >= 1 and i == 0:
                    missed.append(f"{name}: takes {ratio:.3g} of the time of CPython")
            rows.add(name, figure, values, "s", note=note)


def sensor(rows: Rows) -> None:
    """Listing 9: what its heap is at most, and in the loop."""
    folder = (build_folder() / "bench_micropython/sensor").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    under = {"PYTHONMALLOC": "malloc", "PYTHONHASHSEED": "0", "PATH": os.environ["PATH"]}
    script = "import os, sys; exec(open(sys.argv[1]).read()); init(); loop(); os._exit(0)"
    seen = valgrind.massif([sys.executable, "-I", "-c", script, SENSOR], folder, False, under)
    rows.add("sensor, Python 3", "heap, most", max(one.heap for one in seen), "B", note="Massif; thesis 1.1 MiB")
    rows.add("sensor, Python 3", "heap in the loop", seen[-1].heap, "B", note="Massif; thesis 1.1 MiB")
    for name, development in (("without compiler", False), ("with compiler", True)):
        built = interpreter(folder / name.partition(" ")[0], development)
        said = subprocess.run([built, *([SENSOR] if development else [])], check=True, capture_output=True, text=True,
                              cwd=folder).stdout.splitlines()[-1]
        start, peak, loop, after = (int(word) for word in said.replace(":", " ").split() if word.isdigit())
        rows.add(f"sensor, {name}", "heap, most", peak, "B", note=goal(f"sensor, {name}, heap", peak, 104.8 * 1024,
                                                                       "thesis 107,315"))
        rows.add(f"sensor, {name}", "heap in the loop", loop, "B", note=goal(
            f"sensor, {name}, heap in the loop", loop, 57 * 1024, "thesis 58,368"))
        rows.add(f"sensor, {name}", "its growth", after - loop, "B", note=goal(
            f"sensor, {name}, growth of the heap", after - loop, 1))
        rows.add(f"sensor, {name}", "file, stripped", code.stripped(built, "size"), "B", note="thesis 408,976")


def interpreter(folder: Path, development: bool) -> Path:
    """The plain interpreter, with the example frozen."""
    from fledge.files import write_files
    from fledge.targets.micropython import toolchain

    library = toolchain.library("host", development)
    frozen, = write_files({"frozen.c": toolchain.freeze({"script.py": SENSOR}, library)}, folder)
    sources = [build.ROOT / "targets/micropython/interpreter/main.c", frozen.resolve(), *build.math_sources(),
               *(build.ROOT / path for path in build.COMMAND)]
    return build.program(folder, "interpreter", sources, [build.ROOT], library.compiler,
                         [*library.flags, "-DSCRIPT_CYCLES=1"], ["-no-pie", "-lm"], archives=[library.archive])


def main(arguments: list[str]) -> int:
    chosen = options("micropython", arguments, runs=5, cases=CASES)
    cases = chosen.cases or CASES
    rows = Rows()
    job = Job(MISSION, None, SECONDS, free=True, folder=build_folder() / "bench_micropython")
    part = job.parts[0]
    record = TARGETS["desktop"].fly(job)[part.process].record
    if len(part.instants) != CYCLES:
        raise Failure(f"{MISSION} has {len(part.instants)} cycles in {SECONDS:g} s, not {CYCLES}")
    for name in cases:
        if name in TARGETS:
            spin(rows, name, part, record)
        elif name == "wall":
            wall(rows, part, chosen.runs)
        elif name == "sensor":
            sensor(rows)
    report(rows, chosen)
    for one in missed:
        print(f"missed: {one}")
    return 1 if missed else 0
