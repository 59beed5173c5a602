# SPDX-License-Identifier: Apache-2.0
"""Alarms: a parameter beyond its limits is one until it is within them again and somebody has acknowledged it."""
from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError

if TYPE_CHECKING:
    from fledge.control_room.spacecraft import Spacecraft

CONCERNS = ("normal", "watch", "warning", "distress", "critical", "severe")


class Alarms:
    """Those of a spacecraft, by the parameter's name. What a person did, and each that begins, worsens or ends, is in
    the journal; whoever restarts the server finds them again."""

    def __init__(self, craft: Spacecraft) -> None:
        self.craft = craft
        self._open: dict[str, dict[str, Any]] = {}
        for one in reversed(craft.room.journal.rows("alarms", craft.name)):
            if not one["ended_ns"]:
                self._open[one["name"]] = one

    def rows(self) -> list[dict[str, Any]]:
        """The open ones; of a parameter that the database has no more, the slot is None."""
        return [self._told(one) for one in self._open.values()]

    def take(self, notes: list[tuple[int, int, int, int]]) -> None:
        """Limit states have changed: (slot, t, old, new) of each."""
        changed: dict[str, dict[str, Any]] = {}
        for slot, t, _, new in notes:
            name = self.craft.slot_names[slot]
            one = self._open.get(name)
            if one is None:
                if not new:
                    continue
                one = self._open[name] = {
                    "name": name, "concern": 0, "worst": 0, "since_ns": str(t), "t_ns": str(t), "count": 0,
                    "value": None, "text": "", "acknowledged": None, "shelved_until_ns": "0", "ended_ns": ""}
            one["count"] += new > one["concern"]
            worse = new > one["worst"]
            one.update(concern=new, t_ns=str(t), worst=max(new, one["worst"]))
            if new:
                newest = self.craft.monitor.newest(slot)
                one["value"] = value = newest[3] if newest else None
                one["text"] = f"{value:g}" if isinstance(value, float) else str(value)
            if worse:
                one["acknowledged"] = None
            if worse or self._ends(one, t):
                changed[name] = one
        self._keep(list(changed.values()))

    def acknowledge(self, name: str, user: str, note: str) -> dict[str, Any]:
        """Somebody has seen it. Raises SetupError if there is none."""
        one = self._named(name)
        one["acknowledged"] = {"user": user, "note": note, "t_ns": str(self.craft.now),
                               "received_ns": str(time.time_ns())}
        self._ends(one, self.craft.now)
        self._keep([one])
        return self._told(one)

    def shelve(self, name: str, seconds: float) -> dict[str, Any]:
        """Let nobody be disturbed by it for a while of the server's time; 0: from now on again."""
        if not 0 <= seconds <= 7 * 86400:
            raise SetupError(f"an alarm is shelved for 0 to {7 * 86400} s; found {seconds:g}")
        one = self._named(name)
        one["shelved_until_ns"] = str(time.time_ns() + int(seconds * 1e9)) if seconds else "0"
        self._keep([one])
        return self._told(one)

    def _ends(self, one: dict[str, Any], t: int) -> bool:
        """Whether it is over now."""
        if one["concern"] or not one["acknowledged"]:
            return False
        one["ended_ns"] = str(t)
        del self._open[one["name"]]
        return True

    def _named(self, name: str) -> dict[str, Any]:
        if name not in self._open:
            raise SetupError(f"{self.craft.name} has no alarm of {name}")
        return self._open[name]

    def _told(self, one: dict[str, Any]) -> dict[str, Any]:
        names = self.craft.slot_numbers
        return one | {"craft": self.craft.name, "slot": names.get(one["name"]), "level": CONCERNS[one["concern"]],
                      "worst_level": CONCERNS[one["worst"]]}

    def _keep(self, changed: list[dict[str, Any]]) -> None:
        self.craft.room.keep("alarms", self.craft.name, *changed, told=self._told)
