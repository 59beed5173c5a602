# SPDX-License-Identifier: Apache-2.0
"""Scripts of the ground with steps, as `fledge ground run` runs them: a function run(craft, script) in a file.

    def run(craft, script):
        \"\"\"Stiffen the control loop.\"\"\"
        with script.step("telemetry"):
            craft.command("telemetry", "flight.tracking.error", every=2).completed(within=5 * s)
        with script.step("gain"):
            script.confirm("go for a stiffer loop?")
            craft.command("write", "flight.control", K=3 * N * m).completed(within=5 * s)
            seen = craft.wait(lambda t: abs(t.flight.tracking.error.sigma_BR[0]) < 1e-3, within=20 * minute)
            script.check(craft.missed == 0, "no packet was lost", missed=craft.missed)
        script.hold(10 * s)

`craft` is a fledge.ground.Craft. Each thing that it sends, receives and waits for becomes an entry; the page of a run
(fledge.report.script) is made from the entries alone. The times are those of the link's clock: simulated ones of a
simulation, so that a script leaves the same entries wherever it runs.
"""
from __future__ import annotations

import ast
import inspect
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime, timezone
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from fledge.commands import Dictionary, sequence_of
from fledge.errors import Failure, SetupError
from fledge.ground.scripts.craft import Craft, Newest
from fledge.ground.scripts.links import Link, NoAnswer
from fledge.ground.scripts.member import Member
from fledge.ground.scripts.simulated import Simulated
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from fledge.ground.scripts.craft import Sent

INTERRUPTED = 130
SLICE = 0.2             # [s] of receiving in real time between two checks for the operator's answer

Entry = dict[str, Any]


class _Noting(Newest):
    """The newest telemetry, with a record of the values that were read."""

    def __init__(self, dictionary: Dictionary) -> None:
        super().__init__(dictionary)
        self.seen: dict[str, Any] = {}

    def _content(self, path: str) -> Any:
        self.seen[path] = content = super()._content(path)
        return content


class Watched(Craft):
    """A craft that reports its actions to its script."""

    script: Script

    def __init__(self, link: Link, dictionary: Dictionary, sequence: int = 0) -> None:
        super().__init__(link, dictionary, sequence)
        self.telemetry: _Noting = _Noting(dictionary)
        self.events = self.telemetry.events
        self._words: dict[str, str] = {}

    def command(self, name: str, /, *arguments: Any, confirmed: bool = False, unchecked: bool = False,
                **values: Any) -> Sent:
        self._words = {key: str(value) for key, value in values.items()}
        try:
            return super().command(name, *arguments, confirmed=confirmed, unchecked=unchecked, **values)
        finally:
            self._words = {}

    def _before_send(self, sent: Sent) -> None:
        self.script.sent(sent, self._words)

    def wait(self, condition: Callable[[Newest], Any], within: Any, otherwise: Callable[[], str] | None = None
             ) -> Newest:
        begin, self.telemetry.seen = self.link.t, {}
        why: str | None = "interrupted"
        try:
            telemetry = super().wait(condition, within, otherwise)
            why = None
            return telemetry
        except Exception as error:
            why = str(error)
            raise
        finally:
            self.script.note_stages()
            self.script.note("wait", within_ns=time_ns(within, "within"), took_ns=self.link.t - begin,
                             good=why is None, why=why or "", values=_plain(self.telemetry.seen))

    def put(self, local: Any, to: str | None = None, **options: Any) -> Any:
        self.script.note("file", text=f"put {os.fspath(local)}" + (f" as {to}" if to else ""))
        return super().put(local, to, **options)

    def fetch(self, name: str, to: Any = None, **options: Any) -> Any:
        self.script.note("file", text=f"fetch {name}" + (f" as {os.fspath(to)}" if to else ""))
        return super().fetch(name, to, **options)


class CheckFailed(Failure):
    """A check of a script does not hold, or the operator answered no."""

    def __init__(self, text: str) -> None:
        super().__init__(text, 1)


class Script:
    """One run of a script. write: takes each entry, a dict for JSON, as it is made; ask: puts a question to the
    operator, and returns the answer and the operator's name."""

    def __init__(self, path: Path, craft: Watched, write: Callable[[Entry], None],
                 ask: Callable[[str], tuple[bool, str]]) -> None:
        self.craft, self._write, self._ask = craft, write, ask
        self._path = str(path.resolve())
        source = path.read_text(encoding="utf-8")
        self._statements = _statements(source)
        self._steps: list[str] = []
        self._sent: list[tuple[int, Sent, list[bytes], int, int]] = []  # not over: what was recorded
        self._commands = 0
        craft.script = self

    # --- for scripts ---

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """A part of the script with a name; steps may stand in steps."""
        self._steps.append(name)
        self.note("step")
        why = "interrupted"
        try:
            yield
            why = ""
        except Exception as error:
            why = _in_words(error)
            raise
        finally:
            self.note_stages()
            self.note("step ends", good=not why, why=why)
            self._steps.pop()

    def check(self, condition: Any, text: str = "", **values: Any) -> None:
        """The script has failed unless a condition is true: a value, or a function of the newest telemetry. values:
        what belongs to it."""
        self.craft.telemetry.seen = {}
        holds = bool(condition(self.craft.telemetry) if callable(condition) else condition)
        self.note("check", good=holds, text=text, values=_plain({**self.craft.telemetry.seen, **values}))
        if not holds:
            raise CheckFailed(f"the check does not hold: {text or self._statement()[1]}"
                              + "".join(f", {name} = {value}" for name, value in values.items()))

    def hold(self, duration: Any) -> None:
        """Take what comes for a duration on the link's clock."""
        begin = self.craft.link.t
        try:
            self.craft.listen(duration)
        finally:
            self.note_stages()
            self.note("hold", took_ns=self.craft.link.t - begin, within_ns=time_ns(duration, "hold"))

    def value(self, name: str, value: Any) -> None:
        """Note a value for the page."""
        self.note("value", values=_plain({name: value}))

    def confirm(self, question: str) -> None:
        """Ask the operator; the script goes on after a yes. Real time goes on meanwhile, simulated time waits."""
        link: Any = self.craft.link
        link = getattr(link, "link", link)
        if isinstance(link, (Simulated, Member)):
            good, operator = self._ask(question)
        else:
            good, operator = self._confirmed_in_real_time(question)
        self.note_stages()
        self.note("confirm", text=question, good=good, why=operator)
        if not good:
            raise CheckFailed(f"the operator said no: {question}")

    def _confirmed_in_real_time(self, question: str) -> tuple[bool, str]:
        """Packets are taken, and frames sent again, while the operator thinks."""
        answers: list[tuple[bool, str] | BaseException] = []

        def ask() -> None:
            try:
                answers.append(self._ask(question))
            except BaseException as error:      # is raised in the script's own thread
                answers.append(error)

        thread = threading.Thread(target=ask, daemon=True)
        thread.start()
        while thread.is_alive():
            self.craft.listen(SLICE)
        if isinstance(answer := answers[0], BaseException):
            raise answer
        return answer

    # --- entries ---

    def note(self, kind: str, **content: Any) -> None:
        """Make an entry."""
        line, source = self._statement()
        self._write({"kind": kind, "t_ns": self.craft.link.t, "step": list(self._steps), "line": line,
                     "source": source, **content})

    def sent(self, command: Sent, values: dict[str, str]) -> None:
        """A command is about to be sent."""
        self.note_stages()
        self._commands += 1
        self._sent.append((self._commands, command, list(command.packets), 0, 0))
        self.note("command", id=self._commands, values=values, packets=[packet.hex() for packet in command.packets],
                  text=", ".join(dict.fromkeys(map(self.craft.dictionary.command, command.packets))))

    def note_stages(self) -> None:
        """Add entries of the stages that commands have reached since the last call."""
        for place, (number, sent, packets, reports, arrived) in enumerate(self._sent):
            if sent.packets != packets:
                self.note("stage", id=number, stage="numbered", good=True, text="anew, behind the commands of others",
                          packets=[packet.hex() for packet in sent.packets])
            if len(sent.arrived) > arrived:
                self.note("stage", id=number, stage="delivered", good=True,
                          text=f"the link knows that {len(sent.arrived)} of {len(sent.packets)} packets are there")
            for report in sent.reports[reports:]:
                packet = next((p for p in sent.packets if sequence_of(p) == report.sequence), sent.packets[0])
                self.note("stage", id=number, stage=report.stage_text if report.good else "refused", good=report.good,
                          on_board_ns=report.t,
                          text="" if report.good else self.craft.dictionary.refusal(report, packet),
                          data=report.data.hex())
            self._sent[place] = (number, sent, list(sent.packets), len(sent.reports), len(sent.arrived))
        self._sent = [entry for entry in self._sent if not entry[1].over]

    def _statement(self) -> tuple[int, str]:
        """The line of the script that is being executed, and its statement."""
        frame = sys._getframe(1)
        while frame and os.path.realpath(frame.f_code.co_filename) != self._path:
            frame = frame.f_back    # type: ignore[assignment]
        return (frame.f_lineno, self._statements.get(frame.f_lineno, "")) if frame else (0, "")

    # --- the run ---

    def run(self, function: Callable[[Craft, Script], Any], trace: Callable[[], Any] = lambda: None
            ) -> tuple[str, int]:
        """Run a script; returns (what is wrong or "", the exit code). trace: is called while its exception is handled.
        """
        why, code = "", 0
        try:
            function(self.craft, self)
        except KeyboardInterrupt:
            why, code = "interrupted", INTERRUPTED
        except Exception as error:
            trace()
            why, code = _in_words(error), 1
            line, at = 0, error.__traceback__
            while at:
                if os.path.realpath(at.tb_frame.f_code.co_filename) == self._path:
                    line = at.tb_lineno
                at = at.tb_next
            self.note_stages()
            self._write({"kind": "exception", "t_ns": self.craft.link.t, "step": [], "line": line,
                         "source": self._statements.get(line, ""), "text": why})
            why = f"{Path(self._path).name}, line {line}: {why}" if line else why
        self.note_stages()
        self._write({"kind": "end", "t_ns": self.craft.link.t, "step": [], "line": 0, "source": "",
                     "outcome": "passed" if not why else "interrupted" if code == INTERRUPTED else "failed",
                     "why": why, "missed": self.craft.missed, "refused": self.craft.refused})
        return why, code


def load(path: Path) -> Callable[[Craft, Script], Any]:
    """The function run(craft, script) of a file. Raises SetupError."""
    folder = path.resolve().parent
    package = ModuleType(f"_scripts_{folder.name}")     # of the files beside it, for `from .vehicle import ...`
    package.__path__ = [str(folder)]
    spec = spec_from_file_location(f"{package.__name__}.{path.stem}", path)
    if spec is None or spec.loader is None:
        raise SetupError(f"{path}: a script is a file of Python, NAME.py")
    module = module_from_spec(spec)
    sys.modules[package.__name__] = package
    sys.path.insert(0, str(folder))
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        raise SetupError(f"{error.filename}, line {error.lineno}: {error.msg}") from None
    except OSError as error:
        raise SetupError(f"{path}: {error.strerror or error}") from None
    except Exception as error:
        raise SetupError(f"{path}: {_in_words(error)}") from error
    finally:
        sys.path.pop(0)
    function = getattr(module, "run", None)
    if not callable(function):
        raise SetupError(f"{path}: there is no function run(craft, script)")
    return function     # type: ignore[no-any-return]


def begin(path: Path, target: str, function: Callable[..., Any]) -> Entry:
    """The first entry of a run."""
    return {"kind": "run", "script": path.name, "about": inspect.cleandoc(function.__doc__ or ""), "target": target,
            "began": datetime.now(timezone.utc).isoformat(timespec="seconds")}


def _statements(source: str) -> dict[int, str]:
    """The statement without a body of its own, or the head of one with a body, by each of its lines."""
    statements: dict[int, str] = {}
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            last = body[0].lineno - 1 if body else node.end_lineno or node.lineno
            text = "\n".join([lines[node.lineno - 1][node.col_offset:], *lines[node.lineno:last]])
            for line in range(node.lineno, max(last, node.lineno) + 1):
                statements[line] = text.strip()
    return statements


def _in_words(error: BaseException) -> str:
    return str(error) if isinstance(error, (Failure, SetupError)) else f"{type(error).__name__}: {error}"


def _plain(value: Any) -> Any:
    """What JSON takes: dicts without the headers of messages, lists, numbers, texts."""
    if isinstance(value, dict):
        return {str(name): _plain(item) for name, item in value.items() if name != "head"}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value if isinstance(value, (bool, int, float, str)) or value is None else str(value)


__all__ = ["CheckFailed", "NoAnswer", "Script", "Watched", "begin", "load"]
