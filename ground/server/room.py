# SPDX-License-Identifier: Apache-2.0
"""All spacecraft of a server, and the listeners to their events."""
from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from threading import RLock
from typing import TYPE_CHECKING, Any

from fledge.ground.server.bounds import Bounds
from fledge.ground.server.journal import Journal, JournalError, Row
from fledge.ground.server.settings import Settings
from fledge.ground.server.run_control import Steered
from fledge.ground.server.spacecraft import Spacecraft
from fledge.errors import SetupError, did_you_mean, listed

if TYPE_CHECKING:
    from fledge.ground.server.postgres import Postgres

UNSAVED = 10_000    # events that wait for a journal that cannot be written
KINDS = {"sent": "sent", "events": "event", "alarms": "alarm", "transfers": "transfer", "stored": "stored",
         "log": "log"}


def owner(craft: str) -> str:
    """The spacecraft whose roles count: a replay has those of its source."""
    return craft.partition("@")[0]


class Room:
    """The spacecraft of the settings, from start() to close(). steered: the co-simulation's run that this is a part
    of."""

    def __init__(self, settings: Settings, steered: Steered | None = None) -> None:
        self.settings = settings
        self.bounds = Bounds()
        self.journal = Journal(settings.folder)
        self.listeners: list[Callable[[Row], None]] = []    #: get all objects for browsers, from any thread
        self.crafts: dict[str, Spacecraft] = {}
        self._numbers = 0
        self._unsaved: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}     # of each craft, while the journal fails
        self._left_out = 0      # events besides
        self._failed: set[str] = set()      # spacecraft with an event about the failed journal
        self._keeping = RLock()
        self.steered = steered
        self.postgres: Postgres | None = None
        try:
            for craft in settings.crafts:
                self.add(Spacecraft(self, craft, self._numbers))
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
        if not (craft := self.crafts.pop(name, None)):      # another request was first
            raise SetupError(f"{name} has ended")
        craft.close()
        self.publish("crafts", "", {})

    @property
    def next_index(self) -> int:
        return self._numbers

    @property
    def replays(self) -> int:
        """How many there are."""
        return sum(bool(craft.source) for craft in self.crafts.values())

    def craft(self, name: str, among: list[str] | None = None) -> Spacecraft:
        """The spacecraft of a name, of all or among some. Raises SetupError."""
        among = list(self.crafts) if among is None else among
        if name not in among:
            raise SetupError(f"there is no spacecraft '{name[:80]}'{did_you_mean(name, among)} there is "
                             + listed(among))
        return self.crafts[name]

    def start(self) -> None:
        for craft in self.crafts.values():
            craft.start()
        if self.postgres:
            self.postgres.start()

    def close(self) -> None:
        """End all in order."""
        if self.postgres:
            self.postgres.close()
        for craft in self.crafts.values():
            craft.end()
        for craft in self.crafts.values():
            craft.close()
        for name in list(self._unsaved):
            self.flush(name)
        self.journal.close()

    def _postgres(self, table: dict[str, Any]) -> Postgres:
        try:
            from fledge.ground.server.postgres import Postgres, PostgresSettings
        except ModuleNotFoundError as error:
            raise SetupError(f"[postgres] needs Debian's package python3-psycopg ({error})") from None
        return Postgres(PostgresSettings.read(table), self)

    # --- what happens ---

    def publish(self, kind: str, craft: str, content: Mapping[str, Any]) -> None:
        """Send an object to all browsers."""
        for listener in list(self.listeners):
            listener({**content, "kind": kind, "craft": craft})

    def keep(self, kind: str, craft: str, *objects: Mapping[str, Any], shown: Callable[[Row], Row] = dict,
             must: bool = False) -> None:
        """Write objects into the journal, and publish them, as `shown` has them. What the journal does not take is
        published, too, and is written as soon as it can be. must: raise JournalError instead, for a request is refused
        then."""
        if must:
            self.journal.save(kind, craft, *objects)
        elif objects:
            with self._keeping:
                waiting = self._unsaved.setdefault(craft, [])
                for row in objects:
                    if kind == "events" and len(waiting) >= UNSAVED:
                        self._left_out += 1
                    elif not any(row is other for _, other in waiting):
                        waiting.append((kind, row))
            self.flush(craft)
        for row in objects:
            self.publish(KINDS[kind], craft, shown({"id": None, **row}))

    def flush(self, craft: str) -> None:
        """Write the rows of a spacecraft that the journal has not taken before, in its thread. The first failure is an
        event, and the recovery."""
        with self._keeping:
            waiting, failed = self._unsaved.get(craft), craft in self._failed
            if not waiting:
                return
            try:
                self.journal.save_all([(kind, craft, content) for kind, content in waiting])
            except JournalError as error:
                self._failed.add(craft)
                if not failed:
                    event = self.event(craft, "critical", "server", str(error))
                    waiting.append(("events", event))
                    self.publish("event", craft, event | {"id": None})
                return
            waiting.clear()
            self._failed.discard(craft)
            left_out, self._left_out = self._left_out, 0
        if failed:
            self.report(craft, "info", "server", "the journal is written again"
                        + f"; {left_out} events meanwhile are not in it" * bool(left_out))

    def event(self, craft: str, severity: str, source: str, text: str, t: int | None = None) -> Row:
        """An event as the journal has it. severity: of alarms.SEVERITIES."""
        if t is None and craft in self.crafts:
            t = self.crafts[craft].clock.now
        return {"craft": craft, "t_ns": str(t or 0), "received_ns": str(time.time_ns()), "severity": severity,
                "source": source, "text": text}

    def report(self, craft: str, severity: str, source: str, text: str, t: int | None = None) -> None:
        """Keep an event."""
        self.keep("events", craft, self.event(craft, severity, source, text, t))

    def log(self, user: str, action: str, text: str, craft: str = "", good: bool = True,
            also: Sequence[tuple[str, Row]] = ()) -> None:
        """Keep a user's action, and also (kind, object) of it, all or none. Raises JournalError: then the server must
        not carry it out."""
        row = {"craft": craft or None, "time_ns": str(time.time_ns()), "user": user, "action": action, "text": text,
               "good": good}
        self.journal.save_all([*((kind, craft, content) for kind, content in also),
                               ("log", owner(craft), row)])
        self.publish("log", craft, row)
