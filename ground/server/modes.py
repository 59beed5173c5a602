# SPDX-License-Identifier: Apache-2.0
"""The modes of a spacecraft: events of their changes, as telemetry shows them."""
from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fledge.ground.database import Monitor
    from fledge.ground.server.reporter import Reporter

OWN = ".housekeeping.mode"      # of a mission of Fledge
MODE = re.compile(r"(^|[._])((flight|system|aocs|adcs)_)?mode([._\[]|$)", re.IGNORECASE)    # of others, as glance.js
MOST = 16       # parameters that are watched, and events of one of them in a batch of packets


class Modes:
    """For the spacecraft's own thread."""

    def __init__(self, monitor: Monitor, reporter: Reporter) -> None:
        self._reporter = reporter
        self._known: dict[str, float] = {}    # the newest number of each mode
        self.begin(monitor)

    def begin(self, monitor: Monitor) -> None:
        """Watch the modes in the monitor of another database."""
        self._monitor = monitor
        self._watched: dict[str, tuple[int, int]] = {}      # name -> slot, trigger
        self.learn(0)

    def learn(self, first: int) -> None:
        """Watch those among the new slots, from one on: Fledge's own; where it has none, enumerated ones by name."""
        named = {slot["name"]: slot["slot"] for slot in self._monitor.slots(first)
                 if slot["kind"] == "label" and MODE.search(slot["name"])}
        own = [name for name in (*named, *self._watched) if name.endswith(OWN)]
        for name in own or named:
            if name not in self._watched and len(self._watched) < MOST:
                self._watched[name] = named[name], self._monitor.trigger([named[name]])

    def poll(self) -> None:
        """Report the changes in the packets since the last call."""
        for name, (slot, trigger) in self._watched.items():
            rows = np.frombuffer(self._monitor.rows(trigger)).reshape(-1, 2)
            rows = rows[np.isfinite(rows[:, 1])]
            changes = rows[np.flatnonzero(np.diff(rows[:, 1], prepend=self._known.get(name, np.nan)))]
            for row in changes[:MOST]:
                before = self._word(slot, self._known[name]) if name in self._known else ""
                self._known[name] = row[1]
                self._reporter.event("watch" if before else "info", name, f"the mode is {self._word(slot, row[1])}"
                                     + f"; before, it was {before}" * bool(before), int(row[:1].view(np.int64)[0]))
            if len(changes) > MOST:
                self._known[name] = rows[-1, 1]
                self._reporter.event("watch", name, f"the mode changed {len(changes) - MOST} times more at once; now "
                                     f"it is {self._word(slot, rows[-1, 1])}", int(rows[-1, :1].view(np.int64)[0]))

    def _word(self, slot: int, number: float) -> str:
        return self._monitor.label(slot, number) or f"{number:.0f}"
