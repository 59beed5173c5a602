# SPDX-License-Identifier: Apache-2.0
"""Procedures on the desktop: CPython runs their source, as MicroPython their bytecode on board
(targets/micropython/procedure.h). Turns of loops and returns have the limit of the command; memory, and loops within a
function of CPython's own, as sum(range(10**12)), have none here."""
from __future__ import annotations

import ast
import math
from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.commands import Kind, Reason, Text
from fledge.errors import SetupError
from fledge.mission import flying
from fledge.mission.powers import rewritten
from fledge.objects.si import Time, time_ns
from fledge.objects.weak import weakly

if TYPE_CHECKING:
    from fledge.mission.process import Flight, Process

GOES_ON, ENDED, FAILED = 0, 1, 2            # ProcedureHost of sim/structure.h
SOURCES: dict[bytes, tuple[str, str]] = {}  # bytecode that was made here -> its source and its name


class _Wait:
    """What wait() gives, to be yielded."""


class Procedures:
    """Runs those of a process, one at a time, at its instants."""

    def __init__(self, process: Flight, core: Any) -> None:
        self.process = weakly(process)
        self.core = core
        self.texts: list[Text] = []
        self.sequence = 0
        self.t = self.wake = -1
        self.waits: _Wait | None = None
        self.turns = self.left = 0      # in one instant
        self.code: Any = None           # before its first turn
        self.main: Any = None           # the generator
        core.set_procedure_host(self.start, self.turn, self.end)

    # --- what the kernel calls ---

    def start(self, bytecode: list[int], sequence: int, turns: int) -> int:
        """At the command."""
        known = SOURCES.get(bytes(bytecode))
        if known is None:
            return Reason.BYTECODE
        self.sequence, self.wake, self.main, self.turns = sequence, -1, None, turns
        self.code = compile(rewritten(_Counted().visit(ast.parse(known[0], known[1]))), known[1], "exec")
        return Reason.OK

    def turn(self, t: int) -> int:
        """At an instant, after its events."""
        if t < self.wake:
            return GOES_ON
        self.t, self.waits = t, None
        self.left = self.turns
        before = _core.set_flies(True)
        try:
            goes_on = self._run()
            if self.left < 0:           # it has caught that
                self._turn()
        except _OverLimit as error:
            self._say(Kind.PROCEDURE_KILLED, str(error), _line(error, self.code))
            return FAILED
        except Exception as error:      # any of the procedure's
            self._say(Kind.PROCEDURE_KILLED, f"{type(error).__name__}: {error}", _line(error, self.code))
            return FAILED
        finally:
            _core.set_flies(before)
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
                     "__turn__": self._turn, "__name__": "procedure", "__builtins__": flying.BUILTINS}
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

    def _turn(self) -> bool:
        self.left -= 1
        if self.left < 0:
            raise _OverLimit(f"it takes more than {self.turns} turns of loops and returns")
        return True

    def _wait(self, time: Time) -> _Wait:
        ns = time_ns(time, "wait")
        if ns < 0:
            raise SetupError("wait: the time must be >= 0")
        self.wake, self.waits = self.t + ns, _Wait()
        return self.waits

    def _print(self, *values: object, sep: str = " ", end: str = "\n") -> None:
        for line in (sep.join(map(str, values)) + end).splitlines():
            self._say(Kind.PRINTED, line)

    def _say(self, kind: Kind, text: str = "", line: int = 0) -> None:
        self.texts.append(Text(self.t, kind, self.sequence, line, text, 0))


class _OverLimit(BaseException):
    """No Exception: a procedure does not go on after it."""


class _Counted(ast.NodeTransformer):
    """Lets each turn of a loop and each call of a function call __turn__ first."""

    def visit(self, node: ast.AST) -> Any:
        self.generic_visit(node)
        turn = ast.Call(ast.Name("__turn__", ast.Load()), [], [])
        if isinstance(node, (ast.For, ast.While, ast.FunctionDef)):
            node.body.insert(0, ast.copy_location(ast.Expr(turn), node))
        elif isinstance(node, ast.comprehension):
            node.ifs.insert(0, ast.copy_location(turn, node.target))
        elif isinstance(node, ast.Lambda):
            node.body = ast.copy_location(ast.BoolOp(ast.And(), [turn, node.body]), node)
        return node


class _Seen:
    """The process as a procedure sees it."""

    def __init__(self, process: Process, core: Any) -> None:
        object.__setattr__(self, "_seen", (process, core))

    def enter(self, mode: str) -> None:
        """Request a mode. Raises SetupError if its condition does not hold."""
        process, core = self._seen
        if core.command_mode(mode) != Reason.OK:
            raise SetupError(f"mode {process.name}.{mode}: its condition does not hold")

    @property
    def active_mode(self) -> str | None:
        return self._seen[0].active_mode

    def __getattr__(self, name: str) -> Any:
        process = self._seen[0]
        if name not in process.instances:
            raise AttributeError(f"{process.name} has no '{name}' here; it has enter, active_mode, "
                                 + ", ".join(process.instances))
        return process.instances[name]

    def __setattr__(self, name: str, _: object) -> None:
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
