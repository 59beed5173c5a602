# SPDX-License-Identifier: Apache-2.0
"""Commands of a database, by the verifiers that it gives them: a stage is passed by the first packet in its window that
fulfils the verifier; a window that ends before is a stage that failed."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.commands import sequence_of
from fledge.ground.database import TIMES, time_text

if TYPE_CHECKING:
    from fledge.ground.database import Form, Verifier
    from fledge.ground.server.stages import Command, Stage, Stages
    from fledge.ground.server.telemetry import Telemetry

STAGES = {"TransferredToRange": "transferred", "SentFromRange": "sent", "Received": "received",
          "Accepted": "accepted", "Queued": "queued", "Execution": "started", "Complete": "completed",
          "Failed": "failed"}
OPEN = 3_600_000_000_000    # [ns] of a window that the database does not end
LATE = 60_000_000_000       # [ns] for which an answer is known that comes behind its window
SEQUENCE = "/yamcs/cmdHist/ccsds-seqcount"      # which a verifier may compare, as it does arguments


def words_of(form: Form, arguments: dict[str, Any]) -> dict[str, str]:
    """The arguments of a command as the monitor takes them: as text."""
    values = {argument["name"]: (argument["type"], arguments.get(argument["name"], argument["initial"]))
              for argument in form["arguments"]}
    return {name: word_of(kind, value) for name, (kind, value) in values.items() if value is not None}


def word_of(kind: str, value: Any) -> str:
    """A time in ns has its unit, for the monitor takes numbers without one as seconds."""
    text = str(value).lower() if isinstance(value, bool) else str(value)
    if kind in TIMES and isinstance(value, (int, float, str)):
        try:
            ns = int(value)
            return f"{ns} ns" if kind == "duration" else time_text(kind, ns)
        except (ValueError, TypeError, OverflowError):      # a text with its unit, or beyond 64 bits
            return text
    return text


@dataclass
class Waiting:
    """A command with verifiers that are not decided. Numbers are those of monitor.expect()."""

    row: Command
    release: int                #: [ns]
    passed: int                 #: [ns] when its last verifier passed, or its release
    open: dict[int, Verifier] = field(default_factory=dict)   #: in the order of their stages
    places: dict[int, int] = field(default_factory=dict)            #: in the form, of those that are or were open
    late: dict[int, tuple[Stage, int]] = field(default_factory=dict)      #: (the failed stage, [ns])

    def window(self, number: int) -> tuple[int, int]:
        """[ns]"""
        verifier = self.open[number]
        begin = self.release if verifier["from_release"] else self.passed
        stop = OPEN if verifier["stop"] is None else int(verifier["stop"] * 1e9)
        return begin + int(verifier["start"] * 1e9), begin + stop

    def over(self, t: int) -> list[int]:
        """The verifiers with ended windows. A window that begins at the last verifier waits for those before it."""
        ended: list[int] = []
        for number, verifier in self.open.items():
            before = [other for other in self.open if other < number and other not in ended]
            if self.window(number)[1] < t and (verifier["from_release"] or verifier["stage"] == "failed" or not before):
                ended.append(number)
        return ended


class Verifying:
    """For the spacecraft's own thread."""

    def __init__(self, stages: Stages, telemetry: Telemetry) -> None:
        self._stages, self._telemetry, self._clock = stages, telemetry, stages.clock
        self._waiting: list[Waiting] = []
        self._newest: tuple[int, int] | None = None     # the verifier and time of the last packet

    def prepare(self, form: Form) -> None:
        """Set the stage of each verifier of a form, and its problem if it cannot be watched."""
        names = {argument["name"]: "0" for argument in form["arguments"]} | {SEQUENCE: "0"}
        for place, verifier in enumerate(form["verifiers"]):
            stage = "progress" if verifier["percent"] is not None else STAGES[verifier["stage"]]
            verifier["problem"], verifier["stage"] = "", stage
            try:
                self._telemetry.monitor.forget(self._telemetry.monitor.expect(form["path"], place, names))
            except SetupError as error:
                verifier["problem"] = str(error)

    def begin(self, row: Command, form: Form, packet: bytes) -> None:
        """Wait for the verifiers of a command that leaves now, or, after the server has started, has left before."""
        words = words_of(form, row["arguments"]) | {SEQUENCE: str(sequence_of(packet))}
        release, about = int(row["t_ns"]), row.get("open", {})
        command = Waiting(row, release, int(about.get("passed_ns", release)))
        for place, verifier in enumerate(form["verifiers"]):
            if place not in about.get("verifiers", [place]):
                continue
            if verifier["problem"]:
                self._stage(row, verifier, None, f"not watched: {verifier['problem']}", self._clock.now)
            else:
                number = self._telemetry.monitor.expect(form["path"], place, words)
                command.open[number], command.places[number] = verifier, place
        if command.open:
            self._waiting.append(command)
        self._mark(command)

    def take(self, number: int, t: int, returned: str) -> None:
        """A packet fulfils a verifier."""
        self.poll(t)
        command = next((command for command in self._waiting if number in command.open or number in command.late), None)
        if command is None:
            return
        if number in command.late:
            stage, _ = command.late.pop(number)
            stage["text"] += f"; it came {(t - command.release) / 1e9:g} s after the release"
            self._telemetry.monitor.forget(number)
            self._keep(command)
        elif command.window(number)[0] <= t:
            self._passed(command, number, t, returned)
        self._rid()

    def poll(self, t: int) -> None:
        """Fail what has waited too long."""
        for command in self._waiting:
            over = command.over(t)
            for number in over:
                (begin, end), verifier = command.window(number), command.open.pop(number)
                if verifier["stage"] == "failed":       # it did not fail
                    self._telemetry.monitor.forget(number)
                    continue
                since = "the release" if verifier["from_release"] or command.passed == command.release else \
                    "the verifier before"
                within = verifier["stop"] or OPEN / 1e9
                self._stages.add_overdue(command.row, verifier["stage"], f"no {verifier['text']} within {within:g} s "
                                         f"of {since}", begin, end)
                command.late[number] = command.row["stages"][-1], end
            for number in [number for number, (_, end) in command.late.items() if t > end + LATE]:
                self._telemetry.monitor.forget(number)
                del command.late[number]
            if over:
                self._keep(command)
        self._rid()

    def stepped(self, by: int) -> None:
        """The server's clock was set [ns]."""
        for command in self._waiting:
            command.release += by
            command.passed += by
            command.late = {number: (stage, end + by) for number, (stage, end) in command.late.items()}

    def end(self, why: str) -> None:
        """No verifier will be known."""
        for command in self._waiting:
            if command.open:
                self._stages.add(command.row, "failed", False, why)
                command.open.clear()
                self._keep(command)
        self._waiting.clear()

    def _passed(self, command: Waiting, number: int, t: int, returned: str) -> None:
        verifier = command.open.pop(number)
        self._telemetry.monitor.forget(number)
        text = verifier["text"] + f": {returned}" * bool(returned)
        others = any(verifier is other for waiting in self._waiting for other in waiting.open.values())
        if not verifier["own"] and (others or self._newest == (id(verifier), t)):
            text += "; other commands waited for it, too, and it does not tell whose it is"
        self._newest = id(verifier), t
        left = {other["stage"] for other in command.open.values()}
        if verifier["stage"] != "completed" or "completed" not in left:     # all of them are needed
            self._stage(command.row, verifier, verifier["stage"] != "failed", text, t)
            if verifier["stage"] in ("completed", "failed"):
                for other in [*command.open, *command.late]:
                    self._telemetry.monitor.forget(other)
                command.open.clear()
                command.late.clear()
        command.passed = t
        self._keep(command)

    def _stage(self, row: Command, verifier: Verifier, good: bool | None, text: str, t: int) -> None:
        name = "failed" if good is False and verifier["stage"] == "completed" else verifier["stage"]
        self._stages.add(row, name, good, text, t)
        if name == "progress" and good:
            row["stages"][-1]["percent"] = verifier["percent"]

    def _rid(self) -> None:
        self._waiting = [command for command in self._waiting if command.open or command.late]

    @staticmethod
    def _mark(command: Waiting) -> None:
        """Write into the row what a server that starts has to wait for."""
        command.row.pop("open", None)
        if command.open:
            command.row["open"] = {"verifiers": [command.places[number] for number in command.open],
                                   "passed_ns": str(command.passed)}

    def _keep(self, command: Waiting) -> None:
        self._mark(command)
        self._stages.keep(command.row)
