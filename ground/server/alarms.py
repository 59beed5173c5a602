# SPDX-License-Identifier: Apache-2.0
"""Alarms: one begins when a parameter leaves its limits. It ends when the parameter is within them again and an
operator has acknowledged it."""
from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NotRequired, TypedDict, cast

from fledge.errors import SetupError
from fledge.ground.database import TIMES, time_text

if TYPE_CHECKING:
    from fledge.ground.server.journal import Row
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.telemetry import Telemetry

LONGEST = 7 * 86400     # [s] for which an alarm is shelved
CONCERNS = ("normal", "watch", "warning", "distress", "critical", "severe")
SEVERITIES = ("info", *CONCERNS[1:])    # of events


class Alarm(TypedDict):
    """A row of the journal. Concerns are places in CONCERNS."""
    id: NotRequired[int]
    name: str               # of the parameter
    concern: int
    worst: int
    since_ns: str
    t_ns: str
    count: int              # how often it became worse
    value: Any              # the newest beyond its limits
    text: str               # the value; a time as its limits are: a date, or in s
    acknowledged: dict[str, str] | None     # user, note, t_ns, received_ns
    shelved_until_ns: str
    ended_ns: str


class Alarms:
    """The alarms of a spacecraft, by the parameter's name. The journal has each change of an alarm: begin, worse, end,
    acknowledged, shelved. The server reads the open ones from it when it starts."""

    def __init__(self, telemetry: Telemetry, reporter: Reporter) -> None:
        self._telemetry, self._clock, self._reporter = telemetry, reporter.clock, reporter
        self._open: dict[str, Alarm] = {}
        self._changed: set[str] = set()     # alarms with a level that the journal does not have yet
        for alarm in cast("list[Alarm]", reporter.all("alarms", is_open=True)):
            if int(alarm["shelved_until_ns"]) > time.time_ns() + LONGEST * 10**9:     # the clock was wrong, or is
                alarm["shelved_until_ns"] = "0"
            self._open[alarm["name"]] = alarm
        self.anew()

    def anew(self) -> None:
        """Begin with a new monitor: it has no values yet, and reports no state that is normal at first."""
        self._unknown = set(self._open)

    def poll(self) -> None:
        """Update alarms that are older than the monitor by its first value, and write levels that changed: a level that
        alternates costs the journal one row for each poll, not for each value."""
        for name in self._unknown & self._open.keys():
            slot = self._telemetry.slot_numbers.get(name)
            if slot is not None and (newest := self._telemetry.monitor.newest(slot)):
                self._unknown.discard(name)
                self.take([(slot, newest[0], self._open[name]["concern"], newest[5])])
        self._keep([self._open[name] for name in sorted(self._changed & self._open.keys())])
        self._changed.clear()

    def compare(self) -> None:
        """Update the alarms by the present states of the monitor, of which notes may be lost."""
        for slot, name in enumerate(self._telemetry.slot_names):
            newest, alarm = self._telemetry.monitor.newest(slot), self._open.get(name)
            before = alarm["concern"] if alarm else 0
            if newest and newest[5] != before:
                self.take([(slot, newest[0], before, newest[5])])

    def rows(self) -> list[Row]:
        """The open alarms. The slot is None if the database no longer has the parameter."""
        return [self._shown(alarm) for alarm in list(self._open.values())]      # from any thread

    def take(self, notes: list[tuple[int, int, int, int]]) -> None:
        """Take changes of limit states: (slot, t, old, new) each."""
        changed: dict[str, Alarm] = {}
        for slot, t, _, new in notes:
            name = self._telemetry.slot_names[slot]
            alarm = self._open.get(name)
            if alarm is None:
                if not new:
                    continue
                alarm = self._open[name] = {
                    "name": name, "concern": 0, "worst": 0, "since_ns": str(t), "t_ns": str(t), "count": 0,
                    "value": None, "text": "", "acknowledged": None, "shelved_until_ns": "0", "ended_ns": ""}
            alarm["count"] += new > alarm["concern"]
            worse = new > alarm["worst"]
            alarm["concern"], alarm["t_ns"], alarm["worst"] = new, str(t), max(new, alarm["worst"])
            if new:
                newest = self._telemetry.monitor.newest(slot)
                alarm["value"] = value = newest[3] if newest else None
                kind = self._telemetry.monitor.slots(slot, 1)[0]["kind"]
                alarm["text"] = time_text(kind, value) if kind in TIMES and isinstance(value, int) else str(value)
            if worse:
                alarm["acknowledged"] = None
            if worse or self._ends(alarm, t):
                changed[name] = alarm
            else:
                self._changed.add(name)
        self._keep(list(changed.values()))

    def acknowledge(self, name: str, user: str, note: str) -> Row:
        """Acknowledge an alarm for a user. Raises SetupError if there is no such alarm, or the journal fails."""
        return self._request(self._named(name), acknowledged={
            "user": user, "note": note, "t_ns": str(self._clock.now), "received_ns": str(time.time_ns())})

    def shelve(self, name: str, seconds: float) -> Row:
        """Do not announce an alarm for some seconds of the server's time; 0: announce it again from now on."""
        if not 0 <= seconds <= LONGEST:
            raise SetupError(f"an alarm is shelved for 0 to {LONGEST} s; found {seconds:g}")
        return self._request(self._named(name), shelved_until_ns=str(time.time_ns() + int(seconds * 1e9))
                             if seconds else "0")

    def stepped(self, by: int) -> None:
        """The server's clock was set, by so much [ns]."""
        for name, alarm in self._open.items():
            if alarm["shelved_until_ns"] != "0":
                alarm["shelved_until_ns"] = str(max(0, int(alarm["shelved_until_ns"]) + by))
                self._changed.add(name)

    def _request(self, alarm: Alarm, **changes: Any) -> Row:
        """Change an alarm for a user, after the journal has it. Raises JournalError: then nothing has changed."""
        later: Row = {**alarm, **changes}
        if not later["concern"] and later["acknowledged"]:
            later["ended_ns"] = str(self._clock.now)
        self._reporter.keep("alarms", later, shown=self._shown, must=True)
        cast("Row", alarm).update(later)
        self._ends(alarm, self._clock.now)
        return self._shown(alarm)

    def _ends(self, alarm: Alarm, t: int) -> bool:
        """End an alarm if its two conditions hold; returns whether they do."""
        if alarm["concern"] or not alarm["acknowledged"]:
            return False
        alarm["ended_ns"] = str(t)
        del self._open[alarm["name"]]
        return True

    def _named(self, name: str) -> Alarm:
        if name not in self._open:
            raise SetupError(f"{self._reporter.name} has no alarm of {name}")
        return self._open[name]

    def _shown(self, alarm: Mapping[str, Any]) -> Row:
        names = self._telemetry.slot_numbers
        return {**alarm, "craft": self._reporter.name, "slot": names.get(alarm["name"]),
                "level": CONCERNS[alarm["concern"]], "worst_level": CONCERNS[alarm["worst"]]}

    def _keep(self, changed: list[Alarm]) -> None:
        self._reporter.keep("alarms", *changed, shown=self._shown)
