# SPDX-License-Identifier: Apache-2.0
"""The programs of one flight: a controller, the world of the mission, and the node of the board, which starts the
target. Each is started by fledge_guard, which ends it, and all that it has started, when this program ends however it
does."""

import contextlib
import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

from fledge._console import Failure
from fledge.fly import build

_numbers = itertools.count()


def close(job, target, name, patience=60.0):
    """Fly a job to its end, flight by the command `target`; returns what the target said, key -> text.

    What the programs said stands in job.folder / NAME.log. Raises Failure with it if the run ends early.
    """
    folder = job.folder.resolve()
    simulation = f"{job.mission.name}_{os.getpid()}_{next(_numbers)}"
    address = f"ipc://@fledge-{simulation}"
    options = ["--simulation", simulation, "--address", address]
    seconds = str(patience)
    commands = {
        "controller": [build.native("fledge_controller", "cosim"), *options, "--until", repr(job.duration), "--seed",
                       str(job.seed), "--node", "world", "--node", "flight", "--join", seconds, "--reply", seconds],
        "world": [sys.executable, "-m", "fledge.cli", "node", str(job.asked), "world",
                  *(["--free"] if job.scenario == "free" else [job.scenario]), *options],
        "flight": [build.native("fledge_board_node", "cosim"), *options, "--tables", job.tables().resolve(),
                   "--reply", seconds, "--", *target]}
    with contextlib.ExitStack() as stack:
        log = stack.enter_context((folder / f"{name}.log").open("w+", encoding="utf-8", errors="replace"))
        programs = {which: stack.enter_context(Program(which, command, log, folder if which == "flight" else None))
                    for which, command in commands.items()}
        results = {which: None for which in programs}
        ends = None
        while None in results.values():
            for which, program in programs.items():
                results[which] = program.poll()
            if ends is None and any(r is not None for r in results.values()):
                ends = time.monotonic() + 20.0      # the others then have their end to say
            if ends is not None and time.monotonic() > ends:
                break
            time.sleep(0.01)
        said = programs["flight"].said()
    if any(results.values()) or None in results.values():
        raise Failure(f"{name}: {_what_failed(results, folder / f'{name}.log', job.mission.title)}", 1)
    return said


def _what_failed(results, log, title):
    lines = [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    codes = ", ".join(f"{which} {'did not end' if code is None else f'exit code {code}'}"
                      for which, code in results.items() if code != 0)
    return f"the flight of {title} ended early ({codes}); {log} ends with\n  " + "\n  ".join(lines[-12:])


class Program:
    """A program under the guard; leaving the context ends it."""

    def __init__(self, name, command, log, folder):
        self.name = name
        self.out = open(f"{log.name}.{name}", "w+", encoding="utf-8", errors="replace")
        Path(self.out.name).unlink()
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        for variable in ("FLEDGE_SIMULATION", "FLEDGE_NODE", "FLEDGE_ADDRESS"):
            environment.pop(variable, None)
        self.log = log
        try:
            self.process = subprocess.Popen([build.native("fledge_guard", "cosim"), "--", *map(str, command)],
                                            stdin=subprocess.PIPE, stdout=self.out, stderr=subprocess.STDOUT,
                                            cwd=folder, env=environment)
        except BaseException:
            self.out.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()               # its lifeline: the guard ends what it started
        try:
            self.process.wait(timeout=15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.out.seek(0)
        self.log.write("".join(f"{self.name}: {line.rstrip()}\n" for line in self.out))
        self.log.flush()
        self.out.close()

    def poll(self):
        return self.process.poll()

    def said(self):
        """Lines of a key and a value."""
        self.out.seek(0)
        pairs = (line.split(maxsplit=1) for line in self.out)
        return {pair[0]: pair[1].strip() for pair in pairs if len(pair) == 2}
