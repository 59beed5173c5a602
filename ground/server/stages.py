# SPDX-License-Identifier: Apache-2.0
"""The stages of commands in the journal."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, NotRequired, TypedDict

if TYPE_CHECKING:
    from fledge.ground.server.clock import Clock
    from fledge.ground.server.reporter import Reporter

COMMANDS = "commands"       # the source of events about them
DELIVERED = "the link knows that it is there"
GIVEN_UP = "the link gave it up after its last transmission; it may have arrived"


class Stage(TypedDict):
    """How far a command is. good: None if it is not known."""
    stage: str
    t_ns: str
    good: bool | None
    text: str
    percent: NotRequired[float | None]


class Command(TypedDict):
    """A row of the journal."""
    id: NotRequired[int]
    craft: str
    t_ns: str
    user: str
    name: str
    arguments: dict[str, Any]
    hex: str                # of its packets
    stages: list[Stage]
    hazardous: NotRequired[str]         # why; absent: it is not
    open: NotRequired[dict[str, Any]]   # what a server that starts waits for; absent: no more will be known
    data: NotRequired[str]  # that it read back, in hex


class Stages:
    """Of the commands of a spacecraft."""

    def __init__(self, reporter: Reporter) -> None:
        self.clock: Clock = reporter.clock
        self._reporter = reporter

    def add(self, row: Command, stage: str, good: bool | None, text: str, t: int | None = None) -> None:
        """Add a stage to a row. good: None if it is not known; t [ns]: now."""
        if stage == "progress":     # the newest one alone
            row["stages"] = [entry for entry in row["stages"] if entry["stage"] != stage]
        row["stages"].append({"stage": stage, "t_ns": str(self.clock.now if t is None else t), "good": good,
                              "text": text})
        if stage in ("failed", "unknown") and "hazardous" in row:
            outcome = "failed" if stage == "failed" else "has an unknown end"
            self._reporter.event("warning", COMMANDS, f"{row['name']} of {row['user']}, which is hazardous, {outcome}: "
                                 f"{text}", t)

    def add_overdue(self, row: Command, stage: str, text: str, begin: int, t: int | None = None) -> None:
        """Add that a stage was not reported in time since `begin`: it failed, or it is not known, because telemetry is
        missing."""
        missing = self.clock.missing(begin, self.clock.now if t is None else t)
        if stage == "completed":
            stage = "unknown" if missing else "failed"
        self.add(row, stage, None if missing else False, f"unknown, {missing}: {text}" if missing else text, t)

    def add_delivered(self, row: Command, good: bool) -> None:
        """Add what the link has learned of a packet."""
        self.add(row, *(("delivered", True, DELIVERED) if good else ("failed", False, GIVEN_UP)))

    def keep(self, row: Command) -> None:
        """Write the row, and publish it."""
        self._reporter.keep("sent", row)

    def end(self, row: Command) -> None:
        """No more will be known of the command."""
        row.pop("open", None)
        self.keep(row)
