# SPDX-License-Identifier: Apache-2.0
"""Commands of a database, by the verifiers that it gives them: a stage is passed by the first packet in its window that
fulfils the verifier; a window that ends before is a stage that failed."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError

if TYPE_CHECKING:
    from fledge.ground.server.clock import Clock
    from fledge.ground.server.stages import Stages
    from fledge.ground.server.telemetry import Telemetry

STAGES = {"TransferredToRange": "transferred", "SentFromRange": "sent", "Received": "received",
          "Accepted": "accepted", "Queued": "queued", "Execution": "started", "Complete": "completed",
          "Failed": "failed"}
OPEN = 3_600_000_000_000    # [ns] of a window that the database does not end
LATE = 60_000_000_000       # [ns] for which an answer is known that comes behind its window
SEQUENCE = "/yamcs/cmdHist/ccsds-seqcount"      # what a database may compare besides arguments


@dataclass
class Waiting:
    """A command with verifiers that are not decided. Numbers are those of monitor.expect()."""

    row: dict[str, Any]
    release: int                #: [ns]
    passed: int                 #: [ns] when its last verifier passed, or its release
    open: dict[int, dict[str, Any]] = field(default_factory=dict)   #: in the order of their stages
    places: dict[int, int] = field(default_factory=dict)            #: in the form, of those that are or were open
    late: dict[int, tuple[dict[str, Any], int]] = field(default_factory=dict)      #: (the failed stage, [ns])

    def window(self, number: int) -> tuple[int, int]:
        """[ns]"""
        one = self.open[number]
        begin = self.release if one["from_release"] else self.passed
        stop = OPEN if one["stop"] is None else int(one["stop"] * 1e9)
        return begin + int(one["start"] * 1e9), begin + stop

    def over(self, t: int) -> list[int]:
        """Whose windows have ended. A window from the last verifier on waits for those before it."""
        found: list[int] = []
        for number, one in self.open.items():
            before = [other for other in self.open if other < number and other not in found]
            if self.window(number)[1] < t and (one["from_release"] or one["stage"] == "failed" or not before):
                found.append(number)
        return found


class Verifying:
    """For the spacecraft's own thread."""

    def __init__(self, stages: Stages, telemetry: Telemetry, clock: Clock) -> None:
        self._stages, self._telemetry, self._clock = stages, telemetry, clock
        self._waiting: list[Waiting] = []
        self._newest: tuple[int, int] | None = None     # the verifier and time of the last packet

    def prepare(self, form: dict[str, Any]) -> None:
        """Name the stages of a form's verifiers, and say of each why it cannot be watched, if so."""
        names = {argument["name"]: "0" for argument in form["arguments"]} | {SEQUENCE: "0"}
        for place, one in enumerate(form["verifiers"]):
            one |= {"problem": "", "stage": "progress" if one["percent"] is not None else STAGES[one["stage"]]}
            try:
                self._telemetry.monitor.forget(self._telemetry.monitor.expect(form["path"], place, names))
            except SetupError as error:
                one["problem"] = str(error)

    def begin(self, row: dict[str, Any], form: dict[str, Any], packet: bytes) -> None:
        """Wait for the verifiers of a command that leaves now, or, after the server has started, has left before."""
        words = {SEQUENCE: str(int.from_bytes(packet[2:4], "big") & 0x3FFF)}
        for one in form["arguments"]:
            value = row["arguments"].get(one["name"], one["initial"])
            words[one["name"]] = str(value).lower() if isinstance(value, bool) else str(value)
        release, about = int(row["t_ns"]), row.get("open", {})
        made = Waiting(row, release, int(about.get("passed_ns", release)))
        for place, one in enumerate(form["verifiers"]):
            if place not in about.get("verifiers", [place]):
                continue
            if one["problem"]:
                self._stage(row, one, None, f"not watched: {one['problem']}", self._clock.now)
            else:
                number = self._telemetry.monitor.expect(form["path"], place, words)
                made.open[number], made.places[number] = one, place
        if made.open:
            self._waiting.append(made)
        self._mark(made)

    def take(self, number: int, t: int, returned: str) -> None:
        """A packet fulfils a verifier."""
        self.poll(t)
        one = next((one for one in self._waiting if number in one.open or number in one.late), None)
        if one is None:
            return
        if number in one.late:
            stage, _ = one.late.pop(number)
            stage["text"] += f"; it came {(t - one.release) / 1e9:g} s after the release"
            self._telemetry.monitor.forget(number)
            self._keep(one)
        elif one.window(number)[0] <= t:
            self._passed(one, number, t, returned)
        self._rid()

    def poll(self, t: int) -> None:
        """Fail what has waited too long."""
        for one in self._waiting:
            over = one.over(t)
            for number in over:
                (begin, end), verifier = one.window(number), one.open.pop(number)
                if verifier["stage"] == "failed":       # it did not fail
                    self._telemetry.monitor.forget(number)
                    continue
                since = "the release" if verifier["from_release"] or one.passed == one.release else \
                    "the verifier before"
                within = verifier["stop"] or OPEN / 1e9
                self._stages.add_overdue(one.row, verifier["stage"], f"no {verifier['text']} within {within:g} s "
                                         f"of {since}", begin, end)
                one.late[number] = one.row["stages"][-1], end
            for number in [number for number, (_, end) in one.late.items() if t > end + LATE]:
                self._telemetry.monitor.forget(number)
                del one.late[number]
            if over:
                self._keep(one)
        self._rid()

    def stepped(self, by: int) -> None:
        """Somebody has set the server's clock [ns]."""
        for one in self._waiting:
            one.release += by
            one.passed += by
            one.late = {number: (stage, end + by) for number, (stage, end) in one.late.items()}

    def end(self, why: str) -> None:
        """No verifier will be known."""
        for one in self._waiting:
            if one.open:
                self._stages.add(one.row, "failed", False, why)
                one.open.clear()
                self._keep(one)
        self._waiting.clear()

    def _passed(self, one: Waiting, number: int, t: int, returned: str) -> None:
        verifier = one.open.pop(number)
        self._telemetry.monitor.forget(number)
        text = verifier["text"] + f": {returned}" * bool(returned)
        others = any(verifier is each for other in self._waiting for each in other.open.values())
        if not verifier["own"] and (others or self._newest == (id(verifier), t)):
            text += "; other commands waited for it, too, and it does not tell whose it is"
        self._newest = id(verifier), t
        left = {each["stage"] for each in one.open.values()}
        if verifier["stage"] != "completed" or "completed" not in left:     # all of them are needed
            self._stage(one.row, verifier, verifier["stage"] != "failed", text, t)
            if verifier["stage"] in ("completed", "failed"):
                for each in [*one.open, *one.late]:
                    self._telemetry.monitor.forget(each)
                one.open.clear()
                one.late.clear()
        one.passed = t
        self._keep(one)

    def _stage(self, row: dict[str, Any], verifier: dict[str, Any], good: bool | None, text: str, t: int) -> None:
        name = "failed" if good is False and verifier["stage"] == "completed" else verifier["stage"]
        self._stages.add(row, name, good, text, t)
        if name == "progress" and good:
            row["stages"][-1]["percent"] = verifier["percent"]

    def _rid(self) -> None:
        self._waiting = [one for one in self._waiting if one.open or one.late]

    @staticmethod
    def _mark(one: Waiting) -> None:
        """Write into the row what a server that starts has to wait for."""
        one.row.pop("open", None)
        if one.open:
            one.row["open"] = {"verifiers": [one.places[number] for number in one.open], "passed_ns": str(one.passed)}

    def _keep(self, one: Waiting) -> None:
        self._mark(one)
        self._stages.keep(one.row)
