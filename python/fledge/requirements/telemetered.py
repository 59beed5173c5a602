# SPDX-License-Identifier: Apache-2.0
"""What flight sends: packets of telemetry by the names of its dictionary, and their numbers as signals."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.commands import HOUSEKEEPING, REPORTS, SERVICES
from fledge.commands.protocol import EVENT_RECORD, HOUSEKEEPING_RECORD, REPORT_RECORD, TEXT_RECORD, Record
from fledge.elements import ELEMENTS
from fledge.errors import SetupError, did_you_mean, listed
from fledge.mission.field_path import FieldPath, ModeField
from fledge.requirements.formula import Comparison, Signal
from fledge.units import ns

if TYPE_CHECKING:
    from fledge.commands import Dictionary
    from fledge.mission.simulation import Simulation

RECORDS: dict[str, Record] = {"housekeeping": HOUSEKEEPING_RECORD, "reports": REPORT_RECORD, "texts": TEXT_RECORD,
                              "events": EVENT_RECORD}
SENDERS = {"events": "EventLog", "selected": "Housekeeping", "files": "Files"}     # the modules of services


class RecordField:
    """A number of a packet that is no output, as FieldPath describes those of outputs. offset: [bytes] behind the
    packet's header"""

    has_quality = of_mode = False

    def __init__(self, path: str, name: str, type: str, n: int, offset: int, modes: list[str]) -> None:
        self.path, self.offset, self.width = path, offset, ELEMENTS[type].size
        self.shape: tuple[int, ...] = (n,) if n > 1 else ()
        self.elements = list(range(n))
        self.stored = _Field(type, *(("ns", ns.dims) if name == "t" else ("-", (0,) * 8)))
        self.field = ModeField([(mode, i) for i, mode in enumerate(modes)]) if modes else self.stored
        self.unit = "ns" if name == "t" else ""


class _Field:
    def __init__(self, type: str, unit: str, dims: tuple[int, ...]) -> None:
        self.type, self.unit, self.dims = type, unit, dims


class Sent:
    """The packets of a flight process."""

    def __init__(self, simulation: Simulation, what: str, process: str) -> None:
        from fledge.mission.commands import dictionary
        from fledge.mission.process import Flight

        flight = simulation.process(process)
        if not isinstance(flight, Flight):
            raise SetupError(f"{what}: {process} is no process of flight, and only these send telemetry")
        self._simulation, self._what, self._process = simulation, what, process
        self._modes = [name for name, _ in flight.modes]
        d: Dictionary = dictionary(flight)
        self._streams = {"housekeeping": d.telemetry + HOUSEKEEPING, "reports": d.telemetry + REPORTS,
                         **{output.path: output.stream for output in d.outputs}, "texts": d.texts,
                         **{service: d.texts + 1 + i for i, service in enumerate(SERVICES)
                            if any(_core.struct(module).name == SENDERS[service] for module in flight)}}

    def packet(self, name: str) -> Comparison:
        """True at a sample up to which a packet of a stream was sent since the sample before."""
        if name not in self._streams:
            raise SetupError(f"{self._what}: {self._process} sends no packet '{name}'"
                             f"{did_you_mean(name, self._streams)} it sends " + listed(list(self._streams), most=12))
        text = f"a packet {name}" + f" of {self._process}" * ("." not in name)
        sent = Signal("event", text=text, event=(self._process, "packet", name), place=self._streams[name])
        return Comparison(sent, "==", 1.0, f"{text} is sent")

    def number(self, path: str) -> Signal:
        """Numbers of the newest packet of a stream: of an output, or of what RECORDS has."""
        packet, _, name = path.partition(".")
        if packet not in self._streams and packet != self._process:
            self.packet(packet)
        field: Any = self._of_record(path, packet, name) if packet in self._streams else self._of_output(path)
        stream = self._streams[packet if packet in self._streams else field.port]
        return Signal("telemetry", text=f"telemetry of {path}", shape=field.shape, unit=field.unit,
                      dims=field.field.dims, field=field, event=(self._process, "telemetry", path), place=stream)

    def _of_output(self, path: str) -> FieldPath:
        field = FieldPath(self._simulation, path)
        if field.port not in self._streams:
            raise SetupError(f"{self._what}: {path} is no field of an output of {self._process}, and its packets have "
                             "outputs, or are " + listed([name for name in self._streams if "." not in name]))
        return field

    def _of_record(self, path: str, packet: str, name: str) -> RecordField:
        known, offset = {}, 0
        for field, type, n in RECORDS.get(packet, ()):
            known[field] = type, n, offset
            offset += n * ELEMENTS[type].size
        known.pop("spare", None)
        if name not in known:
            raise SetupError(f"{self._what}: {path}: a packet {packet} " + (
                f"has no number '{name}'{did_you_mean(name, known)} it has {listed(list(known))}" if known else
                "has no numbers with a name"))
        return RecordField(path, name, *known[name], self._modes if path == "housekeeping.mode" else [])
