# SPDX-License-Identifier: Apache-2.0
"""Flights, several at a time, each in a process of its own; those with the same hash are taken from the report
before."""
from __future__ import annotations

import dataclasses
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fledge import mission as missions
from fledge.errors import Failure, RunError, SetupError
from fledge.disk import write_files
from fledge.pool import LAST_LINES, Died, Work, anywhere, open_pool
from fledge.verify.flight import FILE, Flight, Flown
from fledge.verify.judging import judged

LOG = "flight.log"      # what a flight prints, in its folder


class Verification(Work[tuple[Flight, str], dict[str, bytes]]):
    """Flights with their hashes, as the work of a pool. The results are files in the folder of the flight; far: on
    another machine, which has a temporary folder for them, and returns them: name -> bytes."""

    fresh = True

    def __init__(self, mission: str, far: bool = False) -> None:
        # Here, so that the process of each flight has them: it draws.
        import matplotlib.backends.backend_svg  # noqa: F401
        import matplotlib.style  # noqa: F401

        self.mission, self.folder = mission, missions.find(mission).folder
        self._far = TemporaryDirectory() if far else None

    @property
    def recipe(self) -> tuple[Callable[..., Verification], tuple[Any, ...]]:
        return Verification, (anywhere(self.mission), True)

    def fly(self, item: tuple[Flight, str]) -> dict[str, bytes]:
        flight, hash = item
        folder = self._folder(flight)
        if not self._far:
            _fly(flight, hash)
            return {}
        folder.mkdir(parents=True, exist_ok=True)
        flown = _fly(dataclasses.replace(flight, mission=self.mission, folder=folder), hash)
        files = {name: (folder / name).read_bytes() for name in (FILE, LOG, flown.record) if name}
        shutil.rmtree(folder)
        return files

    def last_lines(self, item: tuple[Flight, str]) -> list[str]:
        folder = self._folder(item[0])
        log = folder / LOG
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []
        if self._far:
            shutil.rmtree(folder, ignore_errors=True)
        return lines[-LAST_LINES:]

    def _folder(self, flight: Flight) -> Path:
        """Of the files of a flight on this machine."""
        return Path(self._far.name, flight.scenario, flight.target) if self._far else flight.folder


def fly(flights: Sequence[Flight], mission: Path, jobs: int | None, again: bool, tell: Callable[[Flown], None],
        progress: Callable[[int, int], None] = lambda done, all_: None, scheduler: str | None = None) -> list[Flown]:
    """The results of all flights, in their order. mission: its folder; jobs: processes at a time; scheduler: the
    address of a Dask scheduler, whose workers fly instead; again: fly all of them; tell: is called with each result as
    it comes; progress(done, all), of what is flown, about every second."""
    results: dict[int, Flown] = {}
    items: list[tuple[Flight, str]] = []
    places: list[int] = []      # of the items
    for place, flight in enumerate(flights):
        hash = flight.hash(mission)
        before = None if again else Flown.read(flight.folder / FILE)
        if before and before.hash == hash and not before.error and (flight.folder / before.record).exists():
            results[place] = dataclasses.replace(before, before=True)
            tell(results[place])
        else:
            flight.folder.mkdir(parents=True, exist_ok=True)
            for name in (FILE, LOG):
                (flight.folder / name).unlink(missing_ok=True)
            items.append((flight, hash))
            places.append(place)
    done = 0
    if items:
        work = Verification(flights[0].mission)
        with open_pool(jobs, scheduler) as pool:
            flown = pool.fly(work, items, lambda: progress(done, len(items)))
            with closing(flown):
                for place, files in flown:
                    results[places[place]] = _result(*items[place], files)
                    done += 1
                    tell(results[places[place]])
    return [results[place] for place in range(len(flights))]


def _fly(flight: Flight, hash: str) -> Flown:
    """In a process of its own: fly, print into the flight's folder, and write the results there."""
    log = (flight.folder / LOG).open("w", encoding="utf-8", errors="replace", buffering=1)
    os.dup2(log.fileno(), 1)
    os.dup2(log.fileno(), 2)
    sys.stdout = sys.stderr = log
    try:
        flown = judged(flight, hash)
    except (Failure, SetupError, OSError) as error:
        flown = Flown(flight.scenario, flight.target, flight.seed, hash, str(error))
    try:
        write_files({FILE: flown.as_json()}, flight.folder)
    except OSError as error:
        raise RunError("\n  ".join([f"{flight.title}: {flown.error or 'it has flown'}",
                                    f"{error.filename}: {error.strerror}"])) from None
    return flown


def _result(flight: Flight, hash: str, files: dict[str, bytes] | Died[Any]) -> Flown:
    """Of a flight that has ended."""
    if not isinstance(files, Died):
        write_files(files, flight.folder)
        flown = Flown.read(flight.folder / FILE)
        assert flown
        return flown
    return Flown(flight.scenario, flight.target, flight.seed, hash, "\n    ".join([files.text, *files.last_lines]))
