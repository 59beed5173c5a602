# SPDX-License-Identifier: Apache-2.0
"""Commands of a spacecraft: forms of its database, their bytes, and how far each is.

A command is in the journal before it leaves. Its stages: released, delivered (the link's COP-1), accepted, started,
progress, completed or failed, as its uplink knows them (uplink.py).
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, cast

from fledge.errors import SetupError, did_you_mean
from fledge.ground.server.stages import COMMANDS, Stages
from fledge.ground.server.uplink import DatabaseUplink, FlightUplink, Uplink, finished
from fledge.ground.server.verifying import words_of

if TYPE_CHECKING:
    from fledge.commands import Dictionary
    from fledge.ground.database import Argument, Form
    from fledge.ground.scripts.craft import Sent
    from fledge.ground.server.link import Connection
    from fledge.ground.server.past import Past
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.settings import CraftSettings
    from fledge.ground.server.stages import Command
    from fledge.ground.server.telemetry import Telemetry

NUMBERS = ("natural", "integer", "label", "boolean")


class ArgumentError(SetupError):
    """A command's argument is wrong."""

    def __init__(self, text: str, argument: str = "") -> None:
        super().__init__(text)
        self.argument = argument


class Hazardous(SetupError):
    """The command must be confirmed."""

    def __init__(self, why: str, command: str) -> None:
        super().__init__(why)
        self.command = command


class Constrained(SetupError):
    """A constraint of the command does not hold, or cannot be judged. suspendable: an operator may send it unchecked;
    timeout [s]: it may wait for the constraint; hazardous: its name, if it is."""

    def __init__(self, text: str, suspendable: bool, timeout: float, hazardous: str) -> None:
        super().__init__(text)
        self.suspendable, self.timeout, self.hazardous = suspendable, timeout, hazardous


class Commanding:
    """The spacecraft's own thread calls all methods but `preview`, `forms` and `hazard`.

    dictionary: of a mission of Fledge, or None; flown: the server flies it; past: the sessions before
    """

    def __init__(self, settings: CraftSettings, dictionary: Dictionary | None, flown: bool, connection: Connection,
                 telemetry: Telemetry, past: Past, reporter: Reporter) -> None:
        self._flown, self._connection, self._telemetry = flown, connection, telemetry
        self._past, self._clock, self._reporter = past, reporter.clock, reporter
        self._stages = Stages(reporter)
        self.uplink: Uplink = FlightUplink(settings, dictionary, connection, telemetry, self._stages) \
            if dictionary else DatabaseUplink(settings, connection, telemetry, reporter, self._stages)
        self.load()
        #: commands that had not ended when the last server stopped
        self.left = [cast("Command", row) for row in reporter.all("sent", is_open=True)
                     if isinstance(row.get("open"), dict)]

    def restore(self) -> None:
        """Go on with the commands of the last server: flight may report them yet. Reports sent meanwhile are lost."""
        clock, left = self._clock, self.left
        self.left = []
        if not clock.simulated:
            clock.gaps.append((max((int(session["last_ns"]) for session in self._past.sessions()),
                                   default=int(left[0]["t_ns"])), clock.now))
        for row in left:
            form, packets = self._forms.get(row["name"]), [bytes.fromhex(word) for word in row["hex"].split()]
            ended = self._flown or clock.simulated and clock.now < int(row["t_ns"])
            if ended or not self.uplink.restore(row, packets, form):
                self._stages.add(row, "unknown", None, "the run that it was sent to has ended" if ended else
                                 "the database does not have this command any more")
                self._stages.end(row)

    def load(self) -> None:
        """Take the forms of the database."""
        forms = {form["name"]: form for form in self._telemetry.database.forms()}
        for form in forms.values():             # the server counts bytes itself, so no form asks for it
            counts = {argument["counted_by"] for argument in form["arguments"]}
            form["arguments"] = [argument for argument in form["arguments"] if argument["name"] not in counts]
            self.uplink.prepare(form)
        self._forms = forms                     # other threads read it
        self.uplink.reload()

    @property
    def forms(self) -> list[dict[str, Any]]:
        return [{key: value for key, value in form.items() if key != "path"} for form in self._forms.values()]

    def preview(self, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        """The bytes that a command would have, its sequence apart. Raises ArgumentError."""
        form, given, packet = self._encoded(name, arguments)
        packet = finished(packet, 0, self.uplink.header)
        known = {argument["name"]: argument for argument in form["arguments"]}
        whole, fields = int.from_bytes(packet, "big"), []
        for field, is_argument, bit, bits in self._telemetry.database.places(form["path"], **given):
            raw = whole >> 8 * len(packet) - bit - bits & (1 << bits) - 1
            argument = known.get(field) if is_argument else None
            digits = f"{raw:0{-(-bits // 4)}x}" if argument and argument["type"] not in NUMBERS else str(raw)
            fields.append({"name": field, "value": arguments.get(field, argument["initial"]) if argument else str(raw),
                           "unit": argument["unit"] if argument else "", "bit": bit, "bits": bits,
                           "argument": bool(argument), "raw": digits})
        return {"hex": packet.hex(), "fields": fields, "hazardous": form["hazardous"]}

    def send(self, user: str, name: str, arguments: dict[str, Any], confirmed: bool,
             unchecked: bool = False) -> Command:
        """Send a command of a form; its row of the journal. Raises ArgumentError, Hazardous, Constrained,
        SetupError."""
        packet, note = self.packet_of(name, arguments, confirmed, unchecked)
        return self.release(user, name, arguments, [packet], form=self._forms[name], note=note)

    def hazard_of(self, *names: str) -> str:
        """Why one of these commands is hazardous; empty: none is."""
        return next((str(why) for name in names if (form := self._forms.get(name)) and (why := form["hazardous"])), "")

    def hazard(self, packet: bytes) -> str:
        """Why a packet that was made elsewhere is hazardous, or a command that it stores; empty: it is not."""
        return next((str(form["hazardous"]) for form in self._forms_in(packet, "hazardous")), "")

    def unchecked_in(self, packet: bytes, unchecked: bool) -> str:
        """As `_unchecked`, of a packet that was made elsewhere and the commands that it stores. What depends on their
        arguments cannot be judged."""
        return "; ".join(filter(None, (self._unchecked(form, None, unchecked)
                                       for form in self._forms_in(packet, "constraints"))))

    def _forms_in(self, packet: bytes, key: str) -> Iterator[Form]:
        """The forms of the commands in a packet that have something."""
        forms = [form for form in self._forms.values() if form[key]]    # type: ignore[literal-required]
        for command in self.uplink.commands_in(packet) if forms else ():
            yield from (form for form in forms if command in (form["name"], form["path"])
                        or form["name"].startswith(f"{command}.from_"))

    def packet_of(self, name: str, arguments: dict[str, Any], confirmed: bool, unchecked: bool) -> tuple[bytes, str]:
        """The packet of a command, as it is sent or stored on board, and the note of what is not checked. Raises
        ArgumentError, Hazardous, Constrained, SetupError."""
        form, _, packet = self._encoded(name, arguments)
        if form["hazardous"] and not confirmed:
            raise Hazardous(form["hazardous"], name)
        note = self._unchecked(form, arguments, unchecked)
        return self.uplink.numbered(packet), note

    def _unchecked(self, form: Form, arguments: dict[str, Any] | None, unchecked: bool) -> str:
        """What a command does not wait for, as a note for the journal. A constraint that does not hold stops it, unless
        it is suspendable, or cannot be judged, and the operator says that it is not checked. Raises Constrained."""
        if not form["constraints"]:
            return ""
        words = {} if arguments is None else words_of(form, arguments)
        failing = [row for row in self._telemetry.monitor.judge(form["path"], words) if not row[0]]
        if not failing:
            return ""
        text = " and ".join(row[1] for row in failing)
        suspendable = all(holds is None or can for holds, _, _, can in failing)
        if not (unchecked and suspendable):
            raise Constrained(text, suspendable, min(timeout for _, _, timeout, _ in failing),
                              form["name"] if form["hazardous"] else "")
        return f"not checked: {text}"

    def release(self, user: str, name: str, arguments: dict[str, Any], packets: list[bytes],
                then: Callable[[Sent], None] | None = None, form: Form | None = None, note: str = "") -> Command:
        """Send packets that are one command: into the journal, then by the link. then: is called when flight has
        executed it; form: of a command with verifiers; note: for the journal. Raises SetupError; JournalError: then
        nothing was sent."""
        connection, name_of_craft = self._connection, self._reporter.name
        if connection.link is None or connection.silent:
            raise SetupError(f"{name_of_craft}: {connection.silent}; so nothing was sent")
        row: Command = {"craft": name_of_craft, "t_ns": str(self._clock.now), "user": user, "name": name,
                        "arguments": arguments, "hex": " ".join(packet.hex() for packet in packets), "stages": []}
        if why := form["hazardous"] if form else next(filter(None, map(self.hazard, packets)), ""):
            row["hazardous"] = why
        if self.uplink.follows(form):
            row["open"] = {}
        several = f"{len(packets)} packets" if len(packets) > 1 else ""
        self._stages.add(row, "released", True, "; ".join(filter(None, (several, note))))
        self._reporter.save("sent", row)    # before it leaves
        if why:
            self._reporter.event("watch", COMMANDS, f"{user} sends {name}, which is hazardous: {why}")
        try:
            self.uplink.send(row, packets, form, then)
        except OSError as error:
            row.pop("open", None)
            self._stages.add(row, "failed", False,
                             f"the link broke: {error.strerror or error}; it may have arrived or not")
        self._stages.keep(row)
        return row

    def _encoded(self, name: str, arguments: dict[str, Any]) -> tuple[Form, dict[str, Any], bytes]:
        """(form, what the encoder is given, packet)."""
        if name not in self._forms:
            raise SetupError(f"{self._reporter.name} has no command '{name}'{did_you_mean(name, list(self._forms))}")
        form = self._forms[name]
        known = {argument["name"]: argument for argument in form["arguments"]}
        given: dict[str, Any] = {}
        for key, value in arguments.items():
            if key not in known:
                raise ArgumentError(f"{name} has no argument '{key}'{did_you_mean(key, list(known))}", key)
            given[key] = self._value(known[key], value)
            if counter := known[key]["counted_by"]:
                given[counter] = len(given[key].encode() if isinstance(given[key], str) else given[key])
        try:
            return form, given, self._telemetry.database.encode(form["path"], **given)
        except SetupError as error:
            named = sorted((argument for argument in known if argument in str(error)), key=len)
            raise ArgumentError(str(error), named[-1] if named else "") from None

    @staticmethod
    def _value(argument: Argument, value: Any) -> Any:
        """What the encoder takes, of what JSON has."""
        if argument["type"] == "binary":
            try:
                return bytes.fromhex(str(value).removeprefix("0x"))
            except ValueError:
                raise ArgumentError(f"{argument['name']} is given as hexadecimal digits; found '{value}'",
                                    argument["name"]) from None
        if value is None or argument["type"] not in ("aggregate", "array") and isinstance(value, (dict, list)):
            raise ArgumentError(f"{argument['name']}: give a value; found {value!r}", argument["name"])
        return value
