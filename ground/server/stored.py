# SPDX-License-Identifier: Apache-2.0
"""Stored commands: those that wait on board, as they were last reported."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge.commands import ALL, LISTS, Action, Code, Stored, stored, storing
from fledge.errors import SetupError

if TYPE_CHECKING:
    from fledge.ground.scripts.craft import Sent
    from fledge.ground.server.commanding import Commanding
    from fledge.ground.server.link import Connection
    from fledge.ground.server.journal import Row
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.stages import Command
    from fledge.ground.server.telemetry import Telemetry


class StoredLists:
    """path: of flight's StoredCommands, "" without them. `describe` is for all threads, the rest for the spacecraft's
    own."""

    def __init__(self, path: str, connection: Connection, commanding: Commanding, telemetry: Telemetry,
                 reporter: Reporter) -> None:
        self.path, self._connection, self._commanding = path, connection, commanding
        self._telemetry, self._clock, self._reporter = telemetry, reporter.clock, reporter
        self._lists: dict[int, tuple[list[Stored], str | None]] = {}    # and when they were read
        self._names: dict[int, str] = {}        # of commands that were stored from here, by their CRC
        self._begun: dict[int, int] = {}        # [ns] of flight, when a sequence was started from here, and held
        self._held: dict[int, int] = {}
        self._rows: dict[int, Row] = {}         # of the journal
        if not reporter.clock.simulated:         # the lists of a simulation end with it
            for row in reporter.all("stored"):
                number = row["list"]
                self._rows[number] = row
                self._lists[number] = [Stored(int(command["time_ns"]), command["step"], command["size"], command["crc"],
                                              command["code"]) for command in row["commands"]], row["read_ns"]
                self._names |= {command["crc"]: command["name"] for command in row["commands"]}
                self._begun |= {} if row["begun"] is None else {number: row["begun"]}
                self._held |= {} if row["held"] is None else {number: row["held"]}

    def poll(self) -> None:
        """Forget the starts of sequences that have ended: the next start may be that of others."""
        if self._begun:
            running, t = (self._newest(name)[1] or 0 for name in ("running", "head.t"))
            for number in [number for number, begun in self._begun.items() if not running & 1 << number and t > begun]:
                del self._begun[number]
                self._save(number)

    def describe(self) -> dict[str, Any]:
        """All lists."""
        if not self.path:
            return {"lists": [], "text": f"the flight software of {self._reporter.name} has no StoredCommands"}
        running, held, inhibited = (self._newest(name)[1] or 0 for name in ("running", "held", "inhibited"))
        ahead = self._ahead()
        now = self._clock.now - ahead        # of flight
        lists = []
        for number in range(LISTS):
            bit = 1 << number
            begun = self._begun.get(number) if running & bit and not held & bit else None
            commands, when = self._lists.get(number, ([], None))
            if number == 0 and not held & bit:      # they leave the store when they are due
                commands = [command for command in commands if command.time > now]
            due = None if held & bit or inhibited & bit else 0 if number == 0 else begun
            lists.append({
                "list": number, "read_ns": when, "t_ns": None if begun is None else str(now - begun),
                "state": "inhibited" if inhibited & bit else "held" if held & bit else "running" if running & bit
                else "idle",
                "commands": [self._row(command) | {"due_ns": None if due is None else str(due + ahead + command.time)}
                             for command in commands]})
        due = self._newest("next")[1]
        return {"lists": lists, "text": "", "flight_ns": str(now),
                "next_ns": None if due is None or due < 0 else str(due + ahead),
                **{name: self._newest(name)[1] for name in ("stored", "released", "skipped")}}

    def act(self, user: str, request: dict[str, Any]) -> Command:
        """Carry out a browser's request for a list; returns the row of the command. Raises SetupError."""
        craft, number = self._connection.reach(), request.get("list", 0)
        if not self.path:
            raise SetupError(self.describe()["text"])
        if not 0 <= number < LISTS:
            raise SetupError(f"a list is a number from 0 to {LISTS - 1}; found {number!r}")
        action, step = request.get("action"), request.get("step", ALL)
        commanding, note = self._commanding, ""
        if action is None:
            packet, note = commanding.packet_of(str(request.get("name", "")), request.get("arguments", {}),
                                                request.get("confirmed", False), request.get("unchecked", False))
            try:
                packets = craft.packets("store", number, step, int(request.get("time_ns", 0)), packet)
            except ValueError:
                raise SetupError(f"time_ns is a whole number; found '{request['time_ns']}'") from None
            self._names[int.from_bytes(packets[0][10:12], "big")] = craft.dictionary.command(packet)
        elif action == "report":
            packets = craft.packets("stored", number)
        elif action == "delete":
            packets = craft.packets("delete", number, step)
        elif action.upper() in Action.__members__:
            packets = craft.packets("control", Action[action.upper()], number)
        else:
            raise SetupError(f"a list can report, delete, {', '.join(member.name.lower() for member in Action)}; found "
                             f"'{action}'")

        def then(sent: Sent) -> None:
            known = self._lists.get(number, ([], None))[0]
            if action == "report":
                self._keep(number, stored(sent.data), str(self._clock.now))
            elif action is None:
                self._keep(number, [*(c for c in known if c.step != step), *storing(sent.packets)])
            elif action == "delete":
                self._keep(number, [c for c in known if step not in (ALL, c.step)])
            elif action == "start":
                self._begun[number] = sent.reports[-1].t
            elif action == "hold":
                self._held[number] = sent.reports[-1].t
            elif action == "release" and number in self._begun and number in self._held:
                self._begun[number] += sent.reports[-1].t - self._held.pop(number)      # its time stood
            self._save(number)

        given = {key: value for key, value in request.items() if key != "action"}
        return commanding.release(user, action or "store", given, packets, then, note=note)

    def _keep(self, number: int, commands: list[Stored], read: str | None = None) -> None:
        """Set the commands of a list. read: when they were reported; None: executed commands imply them."""
        self._lists[number] = sorted(commands), read or self._lists.get(number, ([], None))[1]

    def _row(self, command: Stored) -> Row:
        code = command.code
        return {"step": command.step, "time_ns": str(command.time), "size": command.size, "crc": command.crc,
                "code": code, "name": self._names.get(command.crc) or (
                    Code(code).name.lower() if code in Code._value2member_map_ else f"code {code}")}

    def _save(self, number: int) -> None:
        """Into the journal, for the next server."""
        commands, read = self._lists.get(number, ([], None))
        row = self._rows.setdefault(number, {"list": number})
        row.update(t_ns=str(self._clock.now), commands=list(map(self._row, commands)), read_ns=read,
                   begun=self._begun.get(number), held=self._held.get(number))
        self._reporter.keep("stored", row, shown=lambda row: {"list": row["list"]})

    def _newest(self, name: str) -> tuple[int, int | None]:
        """([ns] of the spacecraft's clock, a number that telemetry has of all lists); None before it has come."""
        slot = self._telemetry.slot_numbers.get(f"{self.path}.state.{name}")
        newest = self._telemetry.monitor.newest(slot) if slot is not None else None
        t, _, _, value, *_ = newest or (0, 0, None, None)
        return t, int(value) if isinstance(value, (int, float)) else None

    def _ahead(self) -> int:
        """[ns] of the spacecraft's clock here over flight's time."""
        here, flight = self._newest("head.t")
        return 0 if self._clock.simulated or flight is None else here - flight
