# SPDX-License-Identifier: Apache-2.0
"""The programs of one flight: a controller, the world of the mission, and the node of the board, which starts the
target. fledge_guard starts each of them, and ends it with all its children when this program ends in any way."""
from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from fledge.errors import Failure
from fledge.progress import Progress
from fledge.targets import build

if TYPE_CHECKING:
    from fledge.targets.job import Job

_numbers = itertools.count()


def close(job: Job, target: list[str], name: str, timeout: float = 60.0) -> dict[str, str]:
    """Fly a job to its end, flight by the command `target`; returns the figures that the target printed, key -> text.

    The output of the programs goes into job.folder / NAME.log. Raises Failure with its end if the run ends early.
    """
    simulation = f"{job.mission.name}_{os.getpid()}_{next(_numbers)}"
    options = ["--simulation", simulation, "--address", f"ipc://@fledge-{simulation}"]
    return _run(job, name, {
        "controller": [build.native("fledge_controller", "cosim"), *options, "--until", repr(job.duration), "--seed",
                       job.seed, "--node", "world", "--node", "flight", "--join", timeout, "--reply", timeout,
                       *(["--record", job.exchange(name)] if job.boards else [])],
        "world": [sys.executable, "-P", "-m", "fledge.cli", "node", job.asked, "world",
                  *(["--free"] if job.scenario == "free" or job.loads else [job.scenario]), *options,
                  *(word for name, value in job.parameters.items() for word in ("--set", f"{name}={value!r}"))],
        "flight": [*_board(job, options), "--reply", timeout, "--", *target]})


def join(job: Job, target: list[str], name: str, address: str, simulation: str, node: str,
         keys: Path | str | None = None) -> dict[str, str]:
    """The same for a run whose controller and world are elsewhere, the controller at `address`."""
    options: list[object] = ["--address", address, "--simulation", simulation, "--node", node]
    if keys:
        options += ["--keys", Path(keys).resolve()]
    return _run(job, name, {"flight": [*_board(job, options), "--", *target]})


def _board(job, options):
    loads = ["--loads", job.write_loads().resolve()] if job.loads else []
    return [build.native("fledge_board_node", "cosim"), *options, "--tables", job.tables().resolve(), *loads]


def _run(job, name, commands):
    """Run programs until all have ended. When the first has ended, the others have 20 s."""
    folder = job.folder.resolve()
    log = folder / f"{name}.log"
    with contextlib.ExitStack() as stack:
        text = stack.enter_context(log.open("w", encoding="utf-8", errors="replace"))
        bar = stack.enter_context(Progress(name, 0, round(job.duration * 1e9)))
        how_far = stack.enter_context(HowFar()) if bar.wanted and "controller" in commands else None
        if how_far:
            commands["controller"] += ["--status", how_far.write]
        # Python looks for missions from here; a target writes its record into the folder.
        programs = {which: stack.enter_context(Program(
            which, command, text, folder if which == "flight" else None,
            [how_far.write] if how_far and which == "controller" else [])) for which, command in commands.items()}
        results, ends = {}, None
        while ends is None or time.monotonic() < ends:
            if how_far:
                bar.at(how_far.now())
            results = {which: program.poll() for which, program in programs.items()}
            if None not in results.values():
                break
            if ends is None and any(code is not None for code in results.values()):
                ends = time.monotonic() + 20.0
            time.sleep(0.01)
        figures = programs["flight"].figures()
    if any(code != 0 for code in results.values()):
        raise Failure(_what_failed(results, log, job.mission.title), 1)
    return figures


COUNTED = re.compile(r"\w+: \w+ -?\d+")  # "flight: ticks 0", which gives no reason for a failure


def _what_failed(results, log, title):
    lines = [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines()
             if line.strip() and not COUNTED.fullmatch(line)]
    codes = ", ".join(f"{which} {'did not end' if code is None else f'ended with exit code {code}'}"
                      for which, code in results.items() if code != 0)
    return f"the flight of {title} ended early: {codes}; {log} ends with\n    " + "\n    ".join(lines[-12:])


def environment() -> dict[str, str]:
    """The environment for programs that start in another folder: the same module path, and absolute paths of keys."""
    found = {**os.environ, "PYTHONUNBUFFERED": "1",
             "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in sys.path if path)}
    if found.get("FLEDGE_KEYS"):
        found["FLEDGE_KEYS"] = os.path.abspath(found["FLEDGE_KEYS"])
    return found


class HowFar:
    """The progress that the controller reports, for the bar."""

    def __enter__(self) -> HowFar:
        self.read, self.write = os.pipe()
        os.set_blocking(self.read, False)
        self.rest, self.t = b"", 0
        return self

    def __exit__(self, *_) -> None:
        os.close(self.read)
        os.close(self.write)

    def now(self) -> int:
        """[ns]"""
        with contextlib.suppress(BlockingIOError):
            self.rest += os.read(self.read, 65536)
        *lines, self.rest = self.rest.split(b"\n")
        for line in lines:
            self.t = max(self.t, round(json.loads(line).get("t", 0) * 1e9))
        return self.t


class Program:
    """A program under the guard; leaving the context ends it."""

    def __init__(self, name: str, command: Sequence[object], log: TextIO, folder: Path | None,
                 descriptors: Sequence[int] = ()) -> None:
        self.name = name
        self.out = open(f"{log.name}.{name}", "w+", encoding="utf-8", errors="replace")
        Path(self.out.name).unlink()
        self.log = log
        try:
            self.process = subprocess.Popen([build.native("fledge_guard", "cosim"), "--", *map(str, command)],
                                            stdin=subprocess.PIPE, stdout=self.out, stderr=subprocess.STDOUT,
                                            cwd=folder, env=environment(), pass_fds=descriptors)
            self._lifeline: Any = self.process.stdin
        except BaseException:
            self.out.close()
            raise

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_) -> None:
        self._lifeline.close()               # its lifeline: the guard ends what it started
        try:
            self.process.wait(timeout=15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.out.seek(0)
        self.log.write("".join(f"{self.name}: {line.rstrip()}\n" for line in self.out))
        self.log.flush()
        self.out.close()

    def poll(self) -> int | None:
        return self.process.poll()

    def figures(self) -> dict[str, str]:
        """The lines of a key and a value in its output."""
        self.out.seek(0)
        pairs = (line.split(maxsplit=1) for line in self.out)
        return {pair[0]: pair[1].strip() for pair in pairs if len(pair) == 2}
