# SPDX-License-Identifier: Apache-2.0
"""All spacecraft of a server, and the listeners to their events."""
from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from fledge.control_room.journal import Journal, JournalError
from fledge.control_room.bounds import Bounds
from fledge.control_room.settings import Settings
from fledge.control_room.simulated import Steered
from fledge.control_room.spacecraft import Spacecraft
from fledge.cosim.steering import Steering
from fledge.errors import SetupError, did_you_mean, listed

KINDS = {"sent": "sent", "events": "event", "alarms": "alarm", "transfers": "transfer", "log": "log"}


class Room:
    """The spacecraft of the settings, from start() to close()."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.journal = Journal(settings.folder)
        self.listeners: list[Callable[[dict[str, Any]], None]] = []    #: hear of all, from any thread
        self.bounds = Bounds()
        self.crafts: dict[str, Spacecraft] = {}
        self._numbers = 0
        steering = Steering.of_run()
        #: the run of the co-simulation that this is a part of
        self.steered: Steered | None = Steered(steering) if steering else None
        self.postgres: Any = None
        try:
            for one in settings.crafts:
                self.add(Spacecraft(self, one, self._numbers))
            if "postgres" in settings.more:
                self.postgres = self._postgres(settings.more["postgres"])
        except BaseException:
            self.close()
            raise

    def add(self, craft: Spacecraft) -> None:
        if craft.name in self.crafts:
            raise SetupError(f"there is a spacecraft {craft.name} already")
        self.crafts[craft.name] = craft
        self._numbers += 1

    def remove(self, name: str) -> None:
        self.crafts.pop(name).close()
        self.publish("crafts", "", {})

    @property
    def next_index(self) -> int:
        return self._numbers

    def craft(self, name: str, among: list[str] | None = None) -> Spacecraft:
        """The spacecraft of a name, of all or among some. Raises SetupError."""
        among = list(self.crafts) if among is None else among
        if name not in among:
            raise SetupError(f"there is no spacecraft '{name[:80]}'{did_you_mean(name, among)} there is "
                             + listed(among))
        return self.crafts[name]

    def start(self) -> None:
        for one in self.crafts.values():
            one.start()
        if self.postgres:
            self.postgres.start()

    def close(self) -> None:
        """End all in order."""
        if self.postgres:
            self.postgres.close()
        for one in self.crafts.values():
            one.close()
        self.journal.close()

    def _postgres(self, table: dict[str, Any]) -> Any:
        try:
            from fledge.control_room.postgres import Postgres, PostgresSettings
        except ModuleNotFoundError as error:
            raise SetupError(f"[postgres] needs Debian's package python3-psycopg ({error})") from None
        return Postgres(PostgresSettings.read(table), self)

    # --- what happens ---

    def publish(self, kind: str, craft: str, content: dict[str, Any]) -> None:
        """Tell all browsers."""
        for one in list(self.listeners):
            one(content | {"kind": kind, "craft": craft})

    def keep(self, kind: str, craft: str, *objects: dict[str, Any],
             told: Callable[[dict[str, Any]], dict[str, Any]] = dict) -> None:
        """Write objects into the journal, and tell all browsers. A journal that cannot be written is told, too."""
        if not objects:
            return
        failed = bool(self.journal.problem)
        try:
            self.journal.save(kind, craft, *objects)
        except JournalError as error:
            if not failed:
                self.publish("event", craft, self.event(craft, "critical", "server", str(error)) | {"id": None})
        for one in objects:
            self.publish(KINDS[kind], craft, told(one))

    def event(self, craft: str, severity: str, source: str, text: str, t: int | None = None) -> dict[str, Any]:
        """An event as the journal has it. severity: info, watch, warning, distress, critical, severe."""
        return {"craft": craft, "t_ns": str(self.crafts[craft].now if t is None and craft in self.crafts else t or 0),
                "received_ns": str(time.time_ns()), "severity": severity, "source": source, "text": text}

    def tell(self, craft: str, severity: str, source: str, text: str, t: int | None = None) -> None:
        """Keep an event."""
        self.keep("events", craft, self.event(craft, severity, source, text, t))

    def log(self, user: str, action: str, text: str, craft: str = "", good: bool = True) -> None:
        """Keep a user's action. Raises JournalError: then the server must not carry it out."""
        row = {"craft": craft or None, "time_ns": str(time.time_ns()), "user": user, "action": action, "text": text,
               "good": good}
        self.journal.save("log", craft, row)
        self.publish("log", craft, row)
