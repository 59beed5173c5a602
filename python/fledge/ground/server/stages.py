# SPDX-License-Identifier: Apache-2.0
"""The stages of commands in the journal."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fledge.ground.server.clock import Clock
    from fledge.ground.server.reporter import Reporter

DELIVERED = "the link knows that it is there"
GIVEN_UP = "the link gave it up after its last transmission; it may have arrived"


class Stages:
    """Of the commands of a spacecraft; a command is a row of the journal."""

    def __init__(self, reporter: Reporter) -> None:
        self.clock: Clock = reporter.clock
        self._reporter = reporter

    def add(self, row: dict[str, Any], stage: str, good: bool | None, text: str, t: int | None = None) -> None:
        """Add a stage to a row. good: None if it is not known; t [ns]: now."""
        if stage == "progress":     # the newest one alone
            row["stages"] = [entry for entry in row["stages"] if entry["stage"] != stage]
        row["stages"].append({"stage": stage, "t_ns": str(self.clock.now if t is None else t), "good": good,
                              "text": text})

    def add_overdue(self, row: dict[str, Any], stage: str, text: str, begin: int, t: int | None = None) -> None:
        """Add that a stage was not reported in time since `begin`: it failed, or it is not known, because telemetry is
        missing."""
        missing = self.clock.missing(begin, self.clock.now if t is None else t)
        if stage == "completed":
            stage = "unknown" if missing else "failed"
        self.add(row, stage, None if missing else False, f"unknown, {missing}: {text}" if missing else text, t)

    def add_delivered(self, row: dict[str, Any], good: bool) -> None:
        """Add what the link has learned of a packet."""
        self.add(row, *(("delivered", True, DELIVERED) if good else ("failed", False, GIVEN_UP)))

    def keep(self, row: dict[str, Any]) -> None:
        """Write the row, and publish it."""
        self._reporter.keep("sent", row)

    def end(self, row: dict[str, Any]) -> None:
        """No more will be known of the command."""
        row.pop("open", None)
        self.keep(row)
