# SPDX-License-Identifier: Apache-2.0
"""Procedures on the desktop: CPython runs their source, as MicroPython their bytecode on board
(targets/micropython/procedure.h). There is no limit of turns or memory here."""
from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fledge.commands import Kind, Reason, Text
from fledge.errors import SetupError
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from fledge.mission.process import Flight

GOES_ON, ENDED, FAILED = 0, 1, 2            # ProcedureHost of sim/structure.h
SOURCES: dict[bytes, tuple[str, str]] = {}  # bytecode that was made here -> its source and its name


class _Wait:
    """What wait() gives, to be yielded."""


class Procedures:
    """Runs those of a process, one at a time, at its instants."""

    def __init__(self, process: Flight, core: Any) -> None:
        self.process: Callable[[], Any] = weakref.ref(process)
        self.core = core
        self.texts: list[Text] = []
        self.sequence = 0
        self.t = self.wake = -1
        self.waits: _Wait | None = None
        self.code: Any = None           # before its first turn
        self.main: Any = None           # the generator
        core.set_procedure_host(self.start, self.turn, self.end)

    # --- what the kernel calls ---

    def start(self, bytecode: list[int], sequence: int) -> int:
        """At the command."""
        known = SOURCES.get(bytes(bytecode))
        if known is None:
            return Reason.BYTECODE
        self.sequence, self.wake, self.main = sequence, -1, None
        self.code = compile(known[0], known[1], "exec")
        return Reason.OK

    def turn(self, t: int) -> int:
        """At an instant, after its events."""
        if t < self.wake:
            return GOES_ON
        self.t, self.waits = t, None
        try:
            goes_on = self._run()
        except Exception as error:      # any of the procedure's
            self._say(Kind.PROCEDURE_KILLED, f"{type(error).__name__}: {error}", _line(error, self.code))
            return FAILED
        if not goes_on:
            self._say(Kind.PROCEDURE_ENDED)
        return GOES_ON if goes_on else ENDED

    def end(self, t: int, killed: bool, why: str) -> None:
        """By a change that is refused, a command, or a reset."""
        self.t = t
        self._say(Kind.PROCEDURE_KILLED if killed else Kind.PROCEDURE_STOPPED, why)

    # --- a turn ---

    def _run(self) -> bool:
        if self.main is None:
            self._say(Kind.PROCEDURE_STARTED)
            names = {"wait": self._wait, "norm": _norm, "max_abs": _max_abs, "print": self._print,
                     "__name__": "procedure"}
            exec(self.code, names)
            if "main" not in names:
                raise SetupError("a procedure defines main(f)")
            self.main = names["main"](_Seen(self.process(), self.core))     # type: ignore[operator]
            if self.main is None:
                return False
            if not hasattr(self.main, "send"):
                raise SetupError("main(f) returns nothing, or yields")
        try:
            value = next(self.main)
        except StopIteration:
            return False
        if value is not self.waits:
            raise SetupError("a procedure yields nothing, or wait(time)")
        return True

    def _wait(self, time: Any) -> _Wait:
        ns = time_ns(time, "wait")
        if ns < 0:
            raise SetupError("wait: the time must be >= 0")
        self.wake, self.waits = self.t + ns, _Wait()
        return self.waits

    def _print(self, *values: Any, sep: str = " ", end: str = "\n") -> None:
        for line in (sep.join(map(str, values)) + end).splitlines():
            self._say(Kind.PRINTED, line)

    def _say(self, kind: Kind, text: str = "", line: int = 0) -> None:
        self.texts.append(Text(self.t, kind, self.sequence, line, text, 0))


class _Seen:
    """The process as a procedure sees it."""

    def __init__(self, process: Any, core: Any) -> None:
        object.__setattr__(self, "_seen", (process, core))

    def enter(self, mode: str) -> None:
        """Request a mode."""
        self._seen[1].command_mode(mode)

    @property
    def active_mode(self) -> str | None:
        return self._seen[0].active_mode

    def __getattr__(self, name: str) -> Any:
        process = self._seen[0]
        if name not in process.instances:
            raise AttributeError(f"{process.name} has no '{name}' here; it has enter, active_mode, "
                                 + ", ".join(process.instances))
        return process.instances[name]

    def __setattr__(self, name: str, _: Any) -> None:
        raise SetupError(f"{self._seen[0].name}.{name} cannot be set here; set parameters, as in f.control.K = 3")


def _norm(array: Any) -> float:
    """As flight/exec/event.h, in the same order."""
    total = 0.0
    for x in array.flat:
        total += float(x) * float(x)
    return math.sqrt(total)


def _max_abs(array: Any) -> float:
    return max((abs(float(x)) for x in array.flat), default=0.0)


def _line(error: BaseException, code: Any) -> int:
    """The innermost line of the procedure's file; 0: none."""
    line, trace = 0, error.__traceback__
    while trace:
        if trace.tb_frame.f_code.co_filename == code.co_filename:
            line = trace.tb_lineno
        trace = trace.tb_next
    return line
