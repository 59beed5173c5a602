# SPDX-License-Identifier: Apache-2.0
"""Flight under MicroPython by the thesis' method (chapter 7 and appendix E): a spin about an axis at rest for 400
minutes at 2 Hz, 48,000 cycles, and the sensor example of listing 9, beside the goals and the figures that the thesis
recorded elsewhere; and beside flight alone under CPython, which does the same work here.

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

from fledge.archive import Archive
from fledge.errors import Failure
from fledge.disk import build_folder
from fledge.profile import Profile, board, code, process, valgrind
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
    missed.extend(f"{name}: {problem}" for problem in problems)
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
        total = sum(stretch.total for stretch in plain)
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


# Flight alone under CPython: its process, without the world, with the messages that it read in the closed loop.
FLIGHT = """
import os, resource, sys, time
import numpy as np
import fledge
from fledge import objects
sim = fledge.load({mission!r})
sim.isolate({process!r})
flight = sim.process({process!r})
with np.load(sys.argv[1]) as data:
    times = data["times"].tobytes()
    for name in data.files:
        if name != "times":
            _, module, port = name.split(".")
            sim.kernel.feed(getattr(flight.instances[module], port), times, data[name].tobytes(), False, [], 0, "")
sim.prepare()
begin = time.perf_counter(), time.process_time()
sim.run({duration}, progress=False)
print(time.perf_counter() - begin[0], time.process_time() - begin[1])
for path in {outputs!r}:
    _, module, port = path.split(".")
    print(path, objects.memory(getattr(flight.instances[module], port)).hex())
sys.stdout.flush()
os._exit(0)
"""


def wall(rows: Rows, part: Any, runs: int) -> None:
    """The whole program, from its start to its end, and its loop alone; beside flight alone under CPython, in turn. All
    have the same inputs, and no record."""
    import numpy as np

    folder = part.folder.resolve()
    record = TARGETS["desktop"].fly(part.job)[part.process].record
    instants = inputs.capture(part, record)
    whole, first = inputs.write(folder / "inputs", instants), inputs.write(folder / "first", instants[:1])
    messages = {message.ends[0]: np.frombuffer(b"".join(dict(found)[id] for _, found in instants), np.uint8)
                for id, message in enumerate(part.mission.inputs)}
    np.savez(folder / "inputs.npz", times=np.array([t for t, _ in instants], np.int64), **messages)
    outputs = [output.path for output in part.mission.outputs]
    with Archive(record) as archive:
        expected = [f"{path} {archive['/' + path.replace('.', '/')][-1].tobytes().hex()}" for path in outputs]

    def seconds(command: list[Any]) -> tuple[tuple[float, float], list[str]]:
        """((in all, of the processor), the lines that it printed)"""
        start, before = time.perf_counter(), os.times()
        done = subprocess.run(list(map(str, command)), cwd=folder, check=True, stdout=subprocess.PIPE, text=True)
        after = os.times()
        return (time.perf_counter() - start, after.children_user + after.children_system - before.children_user
                - before.children_system), done.stdout.splitlines()

    def python() -> tuple[tuple[float, float], tuple[float, float]]:
        """(whole run, loop), each (in all, of the processor)"""
        run, lines = seconds([sys.executable, "-P", "-c", FLIGHT.format(
            mission=MISSION, process=part.process, duration=SECONDS, outputs=outputs), folder / "inputs.npz"])
        if lines[1:] != expected:
            raise Failure("flight alone under CPython ends with other outputs than in the closed loop")
        in_all, processor = map(float, lines[0].split())
        return run, (in_all, processor)

    def target(built: Path) -> tuple[tuple[float, float], tuple[float, float]]:
        """The same; its loop is what the first cycle alone does not take."""
        run, start = seconds([built, "--inputs", whole])[0], seconds([built, "--inputs", first])[0]
        return run, (run[0] - start[0], run[1] - start[1])

    cases: dict[str, Any] = {"CPython": python}
    for name in ("linux", "micropython", "micropython-dev"):
        cases[name] = partial(target, TARGETS[name].build(part).resolve())
    samples = in_turn(cases, runs)
    thesis = {"CPython": "thesis 0.824", "micropython": "thesis 0.649"}
    for k, what in enumerate(("whole run", "loop")):
        for i, figure in enumerate((what, f"{what}, processor time")):
            for name, found in samples.items():
                values, python_values = ([sample[k][i] for sample in runs_] for runs_ in (found, samples["CPython"]))
                note = thesis.get(name, "") if k == i == 0 and name in thesis else ""
                if name in GOALS:
                    ratio = median_ratio(values, python_values)
                    note = f"{ratio:.3g} of CPython's, pair by pair; {note}".rstrip("; ")
                    if ratio >= 1 and k == i == 0:
                        missed.append(f"{name}: takes {ratio:.3g} of the time of CPython")
                rows.add(name, figure, values, "s", note=note)


def sensor(rows: Rows) -> None:
    """Listing 9: what its heap is at most, and in the loop."""
    folder = (build_folder() / "bench_micropython/sensor").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    under = {"PYTHONMALLOC": "malloc", "PYTHONHASHSEED": "0", "PATH": os.environ["PATH"]}
    script = "import os, sys; exec(open(sys.argv[1]).read()); init(); loop(); os._exit(0)"
    seen = valgrind.massif([sys.executable, "-I", "-c", script, SENSOR], folder, False, under)
    rows.add("sensor, Python 3", "heap, most", max(sample.heap for sample in seen), "B", note="Massif; thesis 1.1 MiB")
    rows.add("sensor, Python 3", "heap in the loop", seen[-1].heap, "B", note="Massif; thesis 1.1 MiB")
    for name, development in (("without compiler", False), ("with compiler", True)):
        built = interpreter(folder / name.partition(" ")[0], development)
        output = subprocess.run([built, *([SENSOR] if development else [])], check=True, capture_output=True, text=True,
                                cwd=folder).stdout.splitlines()[-1]
        start, peak, loop, after = (int(word) for word in output.replace(":", " ").split() if word.isdigit())
        rows.add(f"sensor, {name}", "heap, most", peak, "B", note=goal(f"sensor, {name}, heap", peak, 104.8 * 1024,
                                                                       "thesis 107,315"))
        rows.add(f"sensor, {name}", "heap in the loop", loop, "B", note=goal(
            f"sensor, {name}, heap in the loop", loop, 57 * 1024, "thesis 58,368"))
        rows.add(f"sensor, {name}", "its growth", after - loop, "B", note=goal(
            f"sensor, {name}, growth of the heap", after - loop, 1))
        rows.add(f"sensor, {name}", "file, stripped", code.stripped(built, "size"), "B", note="thesis 408,976")


def interpreter(folder: Path, development: bool) -> Path:
    """The plain interpreter, with the example frozen."""
    from fledge.disk import write_files
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
    for problem in missed:
        print(f"missed: {problem}")
    return 1 if missed else 0
