# SPDX-License-Identifier: Apache-2.0
"""Flights, several at a time, each in a process of its own; those with the same hash are taken from the report
before."""
from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from fledge.montecarlo.shares import death
from fledge.progress import completed
from fledge.verify.flight import FILE, Flight, Flown, dumps

LOG = "flight.log"      # of a worker, in the folder of its flight


def fly(flights: Sequence[Flight], mission: Path, jobs: int, again: bool, tell: Callable[[Flown], None],
        progress: Callable[[int, int], None] = lambda done, all_: None) -> list[Flown]:
    """The results of all flights, in their order. mission: its folder; jobs: processes at a time; again: fly all of
    them; tell: is called with each result as it comes; progress(done, all), of what is flown, about every second."""
    results: dict[int, Flown] = {}
    running: set[subprocess.Popen] = set()
    with ThreadPoolExecutor(jobs) as pool:
        try:
            tasks = {}
            for i, flight in enumerate(flights):
                hash = flight.hash(mission)
                before = None if again else Flown.read(flight.folder / FILE)
                if before and before.hash == hash and not before.error and (flight.folder / before.record).exists():
                    results[i] = dataclasses.replace(before, before=True)
                    tell(results[i])
                else:
                    tasks[pool.submit(_by_worker, flight, hash, running)] = i

            def tick():
                progress(sum(task.done() for task in tasks), len(tasks))

            tick()
            for task in completed(tasks, tick):
                results[tasks[task]] = task.result()
                tell(task.result())
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in list(running):
                process.kill()
    return [results[i] for i in range(len(flights))]


def _by_worker(flight, hash, running):
    """The results of a flight in a new process."""
    flight.folder.mkdir(parents=True, exist_ok=True)
    (flight.folder / FILE).unlink(missing_ok=True)
    job = dumps({"flight": {**dataclasses.asdict(flight), "folder": str(flight.folder)}, "hash": hash})
    with open(flight.folder / LOG, "w+", encoding="utf-8", errors="replace") as log:
        process = subprocess.Popen([sys.executable, "-P", "-m", "fledge.verify.worker"], stdin=subprocess.PIPE,
                                   stdout=log, stderr=subprocess.STDOUT)
        pipe: Any = process.stdin
        running.add(process)
        try:
            # The pipe stays open: its end would end the worker.
            pipe.write(job.encode().replace(b"\n", b"") + b"\n")
            pipe.flush()
            code = process.wait()
            pipe.close()
        except BrokenPipeError:     # it has ended already
            code = process.wait()
        running.discard(process)
        found = Flown.read(flight.folder / FILE)
        if found and not code:
            return found
        log.seek(0)
        last = "\n    ".join(log.read().splitlines()[-5:])
        return Flown(flight.scenario, flight.target, flight.seed, hash, death(code) + (f"\n    {last}" if last else ""))
