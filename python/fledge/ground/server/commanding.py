# SPDX-License-Identifier: Apache-2.0
"""Commands of a spacecraft: forms of its database, their bytes, and how far each is.

A command is in the journal before it leaves. Its stages: released, delivered (the link's COP-1), accepted, started,
progress, completed or failed, by flight's own reports; of a spacecraft that is no mission of Fledge, by the verifiers
of its database.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fledge.commands import Code, Stage, checksummed, numbered
from fledge.ground.server.verifying import Verifying
from fledge.errors import SetupError, did_you_mean
from fledge.ground.scripts.craft import Sent
from fledge.ground.scripts.framed import Framed

if TYPE_CHECKING:
    from fledge.commands import Dictionary
    from fledge.ground.server.clock import Clock
    from fledge.ground.server.link import Connection
    from fledge.ground.server.past import Past
    from fledge.ground.server.reporter import Reporter
    from fledge.ground.server.settings import CraftSettings
    from fledge.ground.server.telemetry import Telemetry

WITHIN = 60_000_000_000     # [ns] of the spacecraft's clock until a command without a report counts as failed
DELIVERED = "the link knows that it is there"
GIVEN_UP = "the link gave it up after its last transmission; it may have arrived"
CHECKSUM = 56               # [bits] in front of it in a command of Fledge
STORED = 24                 # [bytes] in front of the command that another one stores
NUMBERS = ("natural", "integer", "label", "boolean")
WORDS = {Stage.ACCEPTED: "accepted", Stage.STARTED: "started", Stage.UNDER_WAY: "progress", Stage.DONE: "completed"}


class ArgumentError(SetupError):
    """A command's argument is wrong."""

    def __init__(self, text: str, argument: str = "") -> None:
        super().__init__(text)
        self.argument = argument


class Hazardous(SetupError):
    """The command must be confirmed."""


class Commanding:
    """All of it but `preview` and `forms` is for the spacecraft's own thread.

    dictionary: of a mission of Fledge, or None; flown: the server flies it; past: the sessions before
    """

    def __init__(self, settings: CraftSettings, dictionary: Dictionary | None, flown: bool, connection: Connection,
                 telemetry: Telemetry, past: Past, clock: Clock, reporter: Reporter) -> None:
        self._settings, self._dictionary, self._flown, self._connection = settings, dictionary, flown, connection
        self._telemetry, self._past, self._clock, self._reporter = telemetry, past, clock, reporter
        self.verifying = Verifying(self, telemetry, clock, reporter)
        self.load()
        self._open: list[tuple[dict[str, Any], Sent, int]] = []     # row, what was sent, reports that are in it
        self._then: dict[int, Callable[[Sent], None]] = {}      # by the row's id
        self._stepped: dict[int, int] = {}      # [ns] by the row's id, by which the clock was set since its release
        self._sequences: dict[int, int] = {}                # of a database's commands: the next of each stream
        self._going: dict[bytes, dict[str, Any]] = {}       # and of which the link has not said that they are there
        #: those that had not ended when the last server did
        self.left = [one for one in reporter.all("sent", is_open=True)
                     if isinstance(one.get("open"), dict)]

    def restore(self) -> None:
        """Go on with the commands of the last server: flight may report them yet. What it said meanwhile is missing."""
        clock, craft, left = self._clock, self._connection.craft, self.left
        self.left = []
        if not clock.simulated:
            clock.gaps.append((max((int(one["last_ns"]) for one in self._past.sessions()),
                                   default=int(left[0]["t_ns"])), clock.now))
        for row in left:
            form, packets = self._forms.get(row["name"]), [bytes.fromhex(one) for one in row["hex"].split()]
            if self._flown or clock.simulated and clock.now < int(row["t_ns"]):
                self.stage(row, "unknown", None, "the run that it was sent to has ended")
                self.over(row)
            elif craft:
                sent = Sent(craft, packets)
                craft.sent.insert(0, sent)
                self._open.append((row, sent, 0))
            elif form:
                self.verifying.begin(row, form, packets[0])
                self._keep(row)
            else:
                self.stage(row, "unknown", None, "the database does not have this command any more")
                self.over(row)

    def over(self, row: dict[str, Any]) -> None:
        """No more will be known of a command."""
        row.pop("open", None)
        self._stepped.pop(row["id"], None)
        self._keep(row)

    def load(self) -> None:
        """Take the forms of the database."""
        self._forms = {one["name"]: one for one in self._telemetry.database.forms()}
        for form in self._forms.values():       # the server counts bytes itself, so no form asks for it
            counts = {one["counted_by"] for one in form["arguments"]}
            form["arguments"] = [one for one in form["arguments"] if one["name"] not in counts]
            if self._dictionary:                # flight's own reports say more
                form["verifiers"] = []
            self.verifying.prepare(form)
        self.verifying.end("the database has changed: the verifiers of this command are not known any more")

    @property
    def forms(self) -> list[dict[str, Any]]:
        return [{key: value for key, value in one.items() if key != "path"} for one in self._forms.values()]

    def preview(self, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        """The bytes that a command would have, its sequence apart. Raises ArgumentError."""
        form, given, packet = self._encoded(name, arguments)
        packet = self._finished(packet, 0)
        known = {one["name"]: one for one in form["arguments"]}
        whole, fields = int.from_bytes(packet, "big"), []
        for field, is_argument, bit, bits in self._telemetry.database.places(form["path"], **given):
            raw = whole >> 8 * len(packet) - bit - bits & (1 << bits) - 1
            one = known.get(field) if is_argument else None
            digits = f"{raw:0{-(-bits // 4)}x}" if one and one["type"] not in NUMBERS else str(raw)
            fields.append({"name": field, "value": arguments.get(field, one["initial"]) if one else str(raw),
                           "unit": one["unit"] if one else "", "bit": bit, "bits": bits, "argument": bool(one),
                           "raw": digits})
        return {"hex": packet.hex(), "fields": fields, "hazardous": form["hazardous"]}

    def send(self, user: str, name: str, arguments: dict[str, Any], confirmed: bool) -> dict[str, Any]:
        """Send a command of a form; its row of the journal. Raises ArgumentError, Hazardous, SetupError."""
        packet = self.made(name, arguments, confirmed)
        return self.release(user, name, arguments, [packet], form=self._forms[name])

    def hazard_of(self, *names: str) -> str:
        """Why one of these commands is hazardous; empty: none is."""
        return next((str(why) for name in names if (form := self._forms.get(name)) and (why := form["hazardous"])), "")

    def hazard(self, packet: bytes) -> str:
        """Why a packet that was made elsewhere is hazardous; empty: it is not. It is what a hazardous form makes: it
        has the form's stream, and all that the form fixes behind the primary header but the checksum."""
        while packet[6] == Code.STORE and len(packet) > STORED + 6:
            if why := self._hazard(packet):
                return why
            packet = packet[STORED:]
        return self._hazard(packet)

    def _hazard(self, packet: bytes) -> str:
        whole = int.from_bytes(packet, "big")
        for form in self._forms.values():
            if not form["hazardous"]:
                continue
            _, given, sample = self._encoded(form["name"], {one["name"]: _sample(one) for one in form["arguments"]})
            open_ = {one[key] for one in form["arguments"] for key in ("name", "counted_by")}
            fixed = [(bit, bits) for name, _, bit, bits in self._telemetry.database.places(form["path"], **given)
                     if name not in open_ and bit >= 48 and bit != CHECKSUM]
            other = int.from_bytes(sample, "big")
            if packet[:2] == sample[:2] and all(
                    bit + bits <= 8 * len(packet) and (whole >> 8 * len(packet) - bit - bits ^ other >> 8 * len(sample)
                                                       - bit - bits) & (1 << bits) - 1 == 0 for bit, bits in fixed):
                return str(form["hazardous"])
        return ""

    def made(self, name: str, arguments: dict[str, Any], confirmed: bool) -> bytes:
        """The packet of a command, as it is sent or stored on board. Raises ArgumentError, Hazardous, SetupError."""
        form, _, packet = self._encoded(name, arguments)
        if form["hazardous"] and not confirmed:
            raise Hazardous(form["hazardous"])
        return self.numbered(packet)

    def numbered(self, packet: bytes) -> bytes:
        """With the sequence that is next."""
        return self._connection.craft.numbered(packet) if self._connection.craft else self._numbered(packet)

    def release(self, user: str, name: str, arguments: dict[str, Any], packets: list[bytes],
                then: Callable[[Sent], None] | None = None, form: dict[str, Any] | None = None) -> dict[str, Any]:
        """Send packets that are one command: into the journal, then by the link. then: is called when flight has
        executed it; form: of a command with verifiers. Raises SetupError; JournalError: then nothing was sent."""
        connection, name_of_craft = self._connection, self._reporter.name
        if connection.link is None or connection.silent:
            raise SetupError(f"{name_of_craft}: {connection.silent}; so nothing was sent")
        row: dict[str, Any] = {"craft": name_of_craft, "t_ns": str(self._clock.now), "user": user, "name": name,
                               "arguments": arguments, "hex": " ".join(one.hex() for one in packets), "stages": []}
        if connection.craft or form and form["verifiers"]:
            row["open"] = {}
        self.stage(row, "released", True, f"{len(packets)} packets" if len(packets) > 1 else "")
        self._reporter.save("sent", row)    # before it leaves
        sent = None
        try:
            if connection.craft:
                sent = connection.craft.send(packets)
            else:
                for packet in packets:
                    connection.link.send(packet)
                    if isinstance(connection.link, Framed) and connection.link.frames.cop1:
                        self._going[packet] = row
                if form:
                    self.verifying.begin(row, form, packets[0])
        except OSError as error:
            row.pop("open", None)
            self.stage(row, "failed", False, f"the link broke: {error.strerror or error}; it may have arrived or not")
        self._keep(row)
        if sent:
            self._open.append((row, sent, 0))
            if then:
                self._then[row["id"]] = then
        return row

    def stepped(self, by: int) -> None:
        """Somebody has set the server's clock [ns]."""
        self.verifying.stepped(by)
        for row, _, _ in self._open:
            self._stepped[row["id"]] = self._stepped.get(row["id"], 0) + by

    def look(self) -> None:
        """Note what became of commands since the last look."""
        connection = self._connection
        self.verifying.look(self._clock.now)
        for packet, good in connection.link.answers() if connection.link and not connection.craft else ():
            if row := self._going.pop(packet, None):
                self.stage(row, *(("delivered", True, DELIVERED) if good else ("failed", False, GIVEN_UP)))
                self._keep(row)
        if not self._open:
            return
        left = []
        for row, sent, seen in self._open:
            n = len(row["stages"])
            over = self._looked(row, sent, seen)
            if over:
                self.over(row)
            elif len(row["stages"]) != n:
                self._keep(row)
            if not over:
                left.append((row, sent, len(sent.reports)))
            elif (then := self._then.pop(row["id"], None)) and row["stages"][-1]["stage"] == "completed":
                then(sent)
        self._open = left
        if connection.craft and not left:
            del connection.craft.sent[:-1]        # a late report would match none; the last one has flight's sequence

    def _looked(self, row: dict[str, Any], sent: Sent, seen: int) -> bool:
        """Whether it is over."""
        stages = {one["stage"] for one in row["stages"]}
        if "delivered" not in stages and sent.arrived and len(sent.arrived) == len(sent.packets):
            self.stage(row, "delivered", True, DELIVERED)
        if sent.given_up and not sent.reports and "failed" not in stages:
            self.stage(row, "failed", False, GIVEN_UP)
            return True
        dictionary = self._dictionary
        assert dictionary is not None
        if len(sent.reports) < seen:        # flight counts otherwise, and all was sent again
            row["hex"] = " ".join(one.hex() for one in sent.packets)
            seen = 0
        for report in sent.reports[seen:]:
            if not report.good:
                packet = next((one for one in sent.packets if int.from_bytes(one[2:4], "big") & 0x3FFF
                               == report.sequence), None)
                self.stage(row, "failed", False, dictionary.refusal(report, packet))
                return True
            word = WORDS.get(report.stage, "progress")
            same = {one.sequence for one in sent.reports if one.stage == report.stage and one.good}
            if word != "progress" and (word in stages or len(same) < len(sent.packets)):
                continue
            stages.add(word)
            at = f"at {report.t / 1e9:g} s" if report.stage != Stage.ACCEPTED else ""
            self.stage(row, word, True, f"{report.detail} %" if word == "progress" else at)
            if word == "progress":
                row["stages"][-1]["percent"] = report.detail
            if word == "completed":
                row["data"] = sent.data.hex()
                return True
        within = WITHIN + round(2e9 * self._settings.light_time)
        age = self._clock.now - int(row["t_ns"]) - self._stepped.get(row["id"], 0)
        if age > within and not any(one["stage"] in (
                "started", "progress", "unknown", "failed") for one in row["stages"]):
            self.overdue(row, "completed", f"no report of its execution within {within / 1e9:g} s", int(row["t_ns"]))
        return age > 60 * within

    def _encoded(self, name: str, arguments: dict[str, Any]
                 ) -> tuple[dict[str, Any], dict[str, Any], bytes]:
        """(form, what the encoder is given, packet)."""
        if name not in self._forms:
            raise SetupError(f"{self._reporter.name} has no command '{name}'{did_you_mean(name, list(self._forms))}")
        form = self._forms[name]
        known = {one["name"]: one for one in form["arguments"]}
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
            named = sorted((one for one in known if one in str(error)), key=len)
            raise ArgumentError(str(error), named[-1] if named else "") from None

    @staticmethod
    def _value(argument: dict[str, Any], value: Any) -> Any:
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

    def _numbered(self, packet: bytes) -> bytes:
        """A packet of a database with its sequence and length."""
        stream = int.from_bytes(packet[:2], "big") & 0x7FF
        if stream not in self._sequences:       # on from that of the last server
            sent = [one for row in self._reporter.newest("sent")
                    for one in reversed(list(map(bytes.fromhex, row["hex"].split())))]
            self._sequences[stream] = next((int.from_bytes(one[2:4], "big") & 0x3FFF for one in sent
                                            if int.from_bytes(one[:2], "big") & 0x7FF == stream), -1)
        number = self._sequences[stream] = self._sequences[stream] + 1
        return self._finished(packet, number)

    def _finished(self, packet: bytes, number: int) -> bytes:
        """A packet with what its header has besides. Raises SetupError if it has no room for a checksum."""
        header = "cfs" if self._dictionary else self._settings.header
        if header == "none" or header == "ccsds" and len(packet) < 7:
            return packet
        if header == "cfs" and len(packet) < 8:
            raise SetupError(f"a command of cFS has 8 bytes at least, the last of them its checksum; this one has "
                             f"{len(packet)}: header = \"ccsds\" is without")
        made = numbered(packet, number)
        return checksummed(made) if header == "cfs" else made

    def stage(self, row: dict[str, Any], stage: str, good: bool | None, text: str, t: int | None = None) -> None:
        """Add a stage to a row. good: None if it is not known; t [ns]: now."""
        if stage == "progress":     # the newest one alone
            row["stages"] = [one for one in row["stages"] if one["stage"] != stage]
        row["stages"].append({"stage": stage, "t_ns": str(self._clock.now if t is None else t), "good": good,
                              "text": text})

    def overdue(self, row: dict[str, Any], stage: str, text: str, begin: int, t: int | None = None) -> None:
        """Add that a stage was not reported in time since `begin`: it failed, or it is not known, because telemetry is
        missing."""
        missing = self._clock.missing(begin, self._clock.now if t is None else t)
        if stage == "completed":
            stage = "unknown" if missing else "failed"
        self.stage(row, stage, None if missing else False, f"unknown, {missing}: {text}" if missing else text, t)

    def _keep(self, row: dict[str, Any]) -> None:
        self._reporter.keep("sent", row)


def _sample(argument: dict[str, Any]) -> Any:
    """A value that an argument may have."""
    if argument["labels"]:
        return argument["labels"][0]
    if argument["type"] not in NUMBERS and argument["type"] not in ("real", "time"):
        return ""
    low, high = (argument[key] if argument[key] is not None else otherwise for key, otherwise in (
        ("low", min(argument["high"] or 0, 0)), ("high", max(argument["low"] or 0, 0) + 2)))
    return (low + high) / 2 if argument["type"] == "real" else int(low + high) // 2
