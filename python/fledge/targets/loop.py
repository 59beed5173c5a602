# SPDX-License-Identifier: Apache-2.0
"""The programs of one flight: a controller, the worlds of the mission, and for each flight process the node of its
board, which starts its target. fledge_guard starts each of them, and ends it with all its children when this program
ends in any way."""
from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from fledge.errors import Failure, printable
from fledge.progress import Progress
from fledge.targets import build

if TYPE_CHECKING:
    from fledge.targets.job import Job, Part

CONTROLLER = "the controller"     # no process has this name
_numbers = itertools.count()


def close(job: Job, programs: dict[str, list[Any]], name: str, options: list[Any], timeout: float = 60.0,
          pace: float = 0.0) -> dict[str, dict[str, str]]:
    """Fly a job to its end, its flight processes by these `programs`, each a command, with the `options` of
    `meeting`; the others by their Python; pace: simulated seconds per second. Returns the figures that each program
    printed, key -> text, by process.

    The output of the programs goes into job.folder / NAME.log. Raises Failure with its end if the run ends early.
    """
    nodes = [*job.others, *programs]
    commands = {CONTROLLER: [build.native("fledge_controller", "cosim"), *options, "--until", repr(job.duration),
                             "--seed", job.seed, *(word for node in nodes for word in ("--node", node)), "--join",
                             timeout, "--reply", timeout, *(["--pace", pace] if pace else []),
                             *(["--record", job.exchange(name)] if job.boards else [])],
                **{other: python_node(job, other, options) for other in job.others}, **programs}
    return _run(job, name, commands)


def meeting(job: Job) -> list[Any]:
    """The options by which the programs of one flight meet."""
    simulation = f"{job.title}_{os.getpid()}_{next(_numbers)}"
    return ["--simulation", simulation, "--address", f"ipc://@fledge-{simulation}"]


def python_node(job: Job, process: str, options: list[Any]) -> list[Any]:
    """The command of a process that flies on the desktop's code."""
    return [sys.executable, "-P", "-m", "fledge.cli", "node", job.source, process,
            *(["--free"] if job.scenario == "free" else [job.scenario, "--scripted"]), "--name", process, *options,
            *(word for name, value in job.parameters.items() for word in ("--set", f"{name}={value!r}"))]


def board_node(part: Part, options: list[Any], target: list[str], name: str) -> list[Any]:
    """The command of a target's board, which starts the command `target`; name: of the target."""
    script = ["--script", part.write_script().resolve()] if part.script else []
    part.telemetry(name).unlink(missing_ok=True)    # of an earlier flight
    return [build.native("fledge_board_node", "cosim"), *options, "--tables", part.tables().resolve(), *script,
            "--telemetry", part.telemetry(name).resolve(), "--", *target]


def join(part: Part, target: list[str], name: str, address: str, simulation: str, node: str,
         keys: Path | str | None = None, further: Sequence[str] = ()) -> dict[str, str]:
    """Fly a part for a run whose controller and other nodes are elsewhere, the controller at `address`. further:
    options of the node."""
    options: list[Any] = ["--address", address, "--simulation", simulation, "--node", node, *further]
    if keys:
        options += ["--keys", Path(keys).resolve()]
    options += ["--by-radio"] * part.by_radio
    return _run(part.job, name, {part.process: board_node(part, options, target, name)})[part.process]


def _run(job: Job, name: str, commands: dict[str, list[Any]]) -> dict[str, dict[str, str]]:
    """Run programs until all have ended. When the first has ended, the others have 20 s; after a failure that tells
    why, less."""
    log = job.folder.resolve() / f"{name}.log"
    folders = {part.process: part.folder.resolve() for part in job.parts}
    with contextlib.ExitStack() as stack:
        text = stack.enter_context(log.open("w", encoding="utf-8", errors="replace"))
        bar = stack.enter_context(Progress(name, 0, round(job.duration * 1e9)))
        how_far = stack.enter_context(HowFar()) if CONTROLLER in commands else None
        if how_far:
            commands[CONTROLLER] += ["--status", how_far.write]
        # Python looks for missions from here; a target writes its record into the folder of its process.
        programs = {which: stack.enter_context(Program(
            which, command, text, folders.get(which) if command[0] != sys.executable else None,
            [how_far.write] if how_far and which == CONTROLLER else [])) for which, command in commands.items()}
        results, ends = {}, math.inf
        while time.monotonic() < ends:
            if how_far:
                bar.reaches(how_far.now())
            results = {which: program.poll() for which, program in programs.items()}
            for line in (line for program in programs.values() for line in program.line_problems()):
                print(f"  {printable(line)}", file=sys.stderr)
            if None not in results.values():
                break
            if any(code is not None for code in results.values()):
                # What is wrong with a board at a line is known: the others' reasons need no wait. A controller that
                # failed has told the programs that had joined; one that had not joined would wait for ever.
                at_line = any(code and programs[which].device for which, code in results.items())
                wait = 0.5 if at_line else 5.0 if results.get(CONTROLLER) else 20.0
                ends = min(ends, time.monotonic() + wait)
            time.sleep(0.01)
        figures = {which: program.figures() for which, program in programs.items()}
    if any(code != 0 for code in results.values()):
        raise Failure(_what_failed(results, log, job.title), 1)
    return figures


COUNTED = re.compile(r"\w+: \w+ -?\d+")  # "flight: ticks 0", which gives no reason for a failure


def _what_failed(results: dict[str, int | None], log: Path, title: str) -> str:
    lines = [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines()
             if line.strip() and not COUNTED.fullmatch(line)]
    codes = ", ".join(f"{which} {'did not end' if code is None else f'ended with exit code {code}'}"
                      for which, code in results.items() if code != 0)
    return f"the flight of {title} ended early: {codes}; {log} ends with\n    " + "\n    ".join(lines[-12:])


def environment() -> dict[str, str]:
    """The environment for programs that start in another folder: the same module path, and absolute paths of keys."""
    variables = {**os.environ, "PYTHONUNBUFFERED": "1",
                 "PYTHONPATH": os.pathsep.join(os.path.abspath(path) for path in sys.path if path)}
    if variables.get("FLEDGE_KEYS"):
        variables["FLEDGE_KEYS"] = os.path.abspath(variables["FLEDGE_KEYS"])
    return variables


class HowFar:
    """The progress that the controller reports, for the bar."""

    def __enter__(self) -> HowFar:
        self.read, self.write = os.pipe()
        os.set_blocking(self.read, False)
        self.rest, self.t = b"", 0
        return self

    def __exit__(self, *_: object) -> None:
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
        self.device = _device(command)
        self.shown = 0              # [bytes] of its output, by line_problems()
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

    def __exit__(self, *_: object) -> None:
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

    def line_problems(self) -> list[str]:
        """Its messages about its board's serial line since the last call: "/dev/ttyACM0: ..."."""
        if not self.device:
            return []
        text = os.pread(self.out.fileno(), 1 << 20, self.shown)     # its own place in the file stays
        text = text[:text.rfind(b"\n") + 1]
        self.shown += len(text)
        lines = text.decode("utf-8", "replace").splitlines()
        return [line for line in lines if line.startswith(f"{self.device}: ")]

    def figures(self) -> dict[str, str]:
        """The lines of a key and a value in its output."""
        self.out.seek(0)
        pairs = (line.split(maxsplit=1) for line in self.out)
        return {pair[0]: pair[1].strip() for pair in pairs if len(pair) == 2}


def _device(command: Sequence[object]) -> str:
    """The device of the serial line that the node of a board has; "" without, or if it is a pseudo terminal of its
    own."""
    words = list(map(str, command))
    line = words[words.index("--line") + 1] if "--line" in words else ""
    return line.partition("?")[0].removeprefix("pty")
