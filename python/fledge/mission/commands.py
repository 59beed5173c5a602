# SPDX-License-Identifier: Apache-2.0
"""Commands to a flight process of a running mission, by the packets and the code of its targets (flight/command).

    sim.run(10 * minute)
    sim.flight.commands.mode("science")
    sim.flight.commands.write(sim.flight.control, K=3 * N * m)
    sim.run(10 * minute)
    sim.flight.commands.reports
"""
from __future__ import annotations

import struct as packing
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fledge import _core
from fledge.commands import (ALL, NUMBERS, TURNS, Action, Code, Dictionary, Packets, Reason, Report, Stage, Text, Timed,
                             byte_runs, frames_of, origins, parameters, reversed_numbers, table, values as values_of)
from fledge.errors import SetupError, suggesting
from fledge.mission import procedures
from fledge.mission.procedures import Procedures
from fledge.objects.si import Time, time_ns
from fledge.objects.weak import weakly

if TYPE_CHECKING:
    from fledge.mission.process import Event, Flight, Mode
    from fledge.objects.words import Instance


class Counters(NamedTuple):
    accepted: int
    executed: int
    refused: int                # at either time
    reasons: dict[Reason, int]  # of those refused


def dictionary(process: Flight) -> Dictionary:
    """What a flight process can be commanded."""
    running = {name for task in process.tasks for name in task.run}
    modules = [(f"{process.name}.{name}", _core.struct(module), name not in running)
               for name, module in process.instances.items()]
    dictionary_ = Dictionary.of(process.name, modules, [name for name, _ in process.modes], list(process.events))
    dictionary_.guards = {mode: guard.text for mode, guard in process.guards.items()}
    dictionary_.frames = next((frames for instance in process.instances.values()
                               if (frames := frames_of(_core.struct(instance), _core.memory(instance)))), None)
    return dictionary_


@suggesting()
class Commands:
    """Sends commands to a process, which executes them at its next instant, before its tasks.

    Each method returns the reports of the acceptance of its packets; `reports` has all so far. `module` is the object,
    its name, or its path.
    """

    def __init__(self, process: Flight, core: Any) -> None:
        self._process = weakly(process)
        self._core = core
        self.dictionary = dictionary(process)
        self._packets = Packets(self.dictionary)
        self._sent: list[tuple[int, bytes]] = []
        self.spoke_frames = False   # what came in frames is not in `sent`
        self.plays_frames = False   # of a target that flew, whose packets are not known here
        core.take_received()   # from now on, the kernel keeps them
        self._reports: list[Report] = []
        self._procedures = Procedures(process, core)
        self._attach()

    def _attach(self) -> None:
        """Give the dictionary to the kernel. A clone has it, with the commands that wait."""
        if self._core.dictionary == self.dictionary.version:
            return
        process = self._process()
        rows = []
        for block in self.dictionary.blocks:
            name = block.path.partition(".")[2]
            _, start, _ = parameters(_core.struct(process.instances[name]))
            rules = [(r.offset, r.n, r.row, r.rows_at, r.flags, NUMBERS.index(r.number), r.low, r.high)
                     for r in block.rules]
            rows.append((name, start, block.size, block.configuration, block.runs, rules))
        outputs = []
        for output in self.dictionary.outputs:
            name, port = output.path.split(".")[1:]
            field = next(f for f in _core.struct(process.instances[name]).fields
                         if f.name == port and f.group == "out")
            outputs.append((name, field.offset, output.size, byte_runs(field.struct.fields)))
        d = self.dictionary
        self._core.set_dictionary(d.stream, d.telemetry, d.version, d.room, rows, outputs)

    @property
    def packets(self) -> Packets:
        """Makes packets, which count on from the last one that flight has accepted: a clone, or a simulation that was
        restored, may have accepted more than came from here."""
        begun, last = self._core.ground
        if begun and not 0 < (self._packets.sequence - last) % 0x4000 < 0x2000:
            self._packets.sequence = last + 1
        return self._packets

    # --- the commands ---

    def mode(self, mode: Mode | str) -> list[Report]:
        """Request a mode, by its name or handle."""
        return self._send([self.packets.mode(mode)])

    def write(self, module: Instance | str, **values: object) -> list[Report]:
        """Write parameters of a module, with units as when it was made."""
        path, target = self._module(module)
        copy = type(target)(**values)
        fields, start, _ = parameters(_core.struct(target))
        block = block_bytes(copy)
        return self._send(self.packets.write_bytes(path, {
            f.offset - start: block[f.offset - start:f.offset - start + f.size] for f in fields if f.name in values}))

    def load(self, module: Instance | str, like: Instance) -> list[Report]:
        """Stage all parameters of `like`, a module of the same type, and commit them."""
        path, target = self._module(module)
        if type(like) is not type(target):
            raise SetupError(f"load: {path} is a {_core.struct(target).name}; found {like!r}")
        return self._send(self.packets.load(path, block_bytes(like)))

    def publish(self, module: Instance | str) -> list[Report]:
        """Publish the parameters of a module of the configuration."""
        return self._send([self.packets.publish(self._module(module)[0])])

    def reset(self) -> list[Report]:
        """Let the process begin again; its parameters stay."""
        return self._send([self.packets.reset()])

    def arm(self, event: Event | str, on: bool = True) -> list[Report]:
        """Arm an event, by its name or handle, or disarm it."""
        return self._send([self.packets.arm(event, on)])

    def read(self, module: Instance | str, field: str | None = None) -> list[Report]:
        """Read back a parameter, or all: the reports of the execution have the bytes, big-endian."""
        return self._send(self.packets.read(self._module(module)[0], field))

    def telemetry(self, output: str | None = None, on: bool = True, every: int = 1) -> list[Report]:
        """The rate of packets of an output, or of all, which take_packets() has."""
        return self._send([self.packets.telemetry(output, on, every)])

    def procedure(self, bytecode: bytes, source: str = "", name: str = "", turns: int = TURNS, slot: int = 0
                  ) -> list[Report]:
        """Send a procedure and start it. On the desktop CPython runs its source, of the file `name`; without it, the
        desktop refuses it. fledge.targets.procedure() makes the bytecode of a file. turns: of its loops and returns of
        functions that it may take on board in one instant."""
        packets = self.packets.procedure(bytecode, turns, slot)
        if source:
            procedures.SOURCES[bytecode] = source, name
        return self._send(packets)

    def stop_procedure(self, slot: int = 0) -> list[Report]:
        """Stop the procedure of a slot."""
        return self._send([self.packets.stop(slot)])

    def at(self, time: Time, packet: bytes, step: int = 0) -> list[Report]:
        """Store a command of `packets` that is executed at a time."""
        return self._send([self.packets.store(0, step, time_ns(time, "at"), packet)])

    def sequence(self, number: int, steps: Iterable[tuple[Time, bytes]]) -> list[Report]:
        """Store a block of commands as a list, 1 to 15: (time since its start, packet) of each."""
        return self._send(self.packets.store_sequence(number, [
            (time_ns(t, "sequence"), packet) for t, packet in steps]))

    def control(self, action: Action, number: int = ALL) -> list[Report]:
        """Start, stop, hold, release, inhibit or allow a list of stored commands, or all."""
        return self._send([self.packets.control(action, number)])

    def delete(self, number: int = ALL, step: int = ALL) -> list[Report]:
        """Delete a stored command, a list, or all."""
        return self._send([self.packets.delete(number, step)])

    def stored(self, number: int) -> list[Report]:
        """Ask for what a list has: fledge.commands.stored() reads the data of the report of the execution."""
        return self._send([self.packets.stored(number)])

    def monitor(self, place: int, number: str = "", *, hold: Time = 0, **values: Any) -> list[Report]:
        """Write one of the monitors, as Packets.monitor() says."""
        return self._send([self.packets.monitor(place, number, hold=time_ns(hold, "monitor"), **values)])

    def rule(self, place: int, number: str = "", *, hold: Time = 0, **values: Any) -> list[Report]:
        """Write one of the rules of the fault protection, as Packets.rule() says."""
        return self._send([self.packets.rule(place, number, hold=time_ns(hold, "rule"), **values)])

    def unit(self, unit: int, state: str, even: bool = False) -> list[Report]:
        """Set the state of a unit, as Packets.unit() says."""
        return self._send([self.packets.unit(unit, state, even)])

    def clear_fault(self, unit: int | None = None) -> list[Report]:
        """Clear the fault of a unit, or of all."""
        return self._send([self.packets.clear_fault(unit)])

    def preset(self, *packets: bytes) -> None:
        """Before the first run: let what these packets of Code.WRITE write, as rules and monitors, be so from the
        start. A reset of the computer keeps it, where it forgets what commands have written."""
        if self._process()._core_simulation.time >= 0 or any(packet[6] != Code.WRITE for packet in packets):
            raise SetupError("preset: give packets that write parameters, before the first run")
        for packet in packets:
            place, at = packing.unpack_from(">HI", packet, 10)
            block = self.dictionary.blocks[place]
            _, target = self._module(block.path)
            data, whole = packet[16:], block_bytes(target)
            values = values_of(block.fields, whole[:at] + data + whole[at + len(data):])
            for name, value in _without_spares(values).items():
                setattr(target, name, value)

    def table(self, module: Instance | str, like: Instance | None = None, **values: Any) -> bytes:
        """The file of a table for packets.load_table(): the parameters of a module, or of `like`, another one of its
        type, with some values, in the units of its header, in their place."""
        path, target = self._module(module)
        if like is not None and type(like) is not type(target):
            raise SetupError(f"table: {path} is a {_core.struct(target).name}; found {like!r}")
        return table(self.dictionary, path, block_bytes(target if like is None else like), **values)

    def events(self) -> list[Report]:
        """Let the log of events send again what it has."""
        return self._send([self.packets.events()])

    def filter_events(self, place: int, output: str = "", **values: Any) -> list[Report]:
        """Write one of the filters of the log of events, as Packets.filter_events() says."""
        return self._send([self.packets.filter_events(place, output, **values)])

    def housekeeping(self, place: int, numbers: Sequence[str] = (), *, every: Time = 0,
                     on: bool = True) -> list[Report]:
        """Define a report of chosen numbers, or turn one on or off, as Packets.housekeeping() says."""
        return self._send([self.packets.housekeeping(place, numbers, every=time_ns(every, "housekeeping"), on=on)])

    def noop(self) -> list[Report]:
        return self._send([self.packets.noop()])

    def reset_counters(self) -> list[Report]:
        return self._send([self.packets.reset_counters()])

    def send(self, packet: bytes) -> list[Report]:
        """Send any bytes."""
        return self._send([packet])

    def send_unit(self, unit: bytes) -> list[Report]:
        """Send a unit of frames to flight that speaks them, as it is."""
        self._process().refuse_if_flown()
        self.spoke_frames = True
        before = len(self.reports)
        self._core.command(unit)
        return self.reports[before:]

    def script(self, packets: Iterable[tuple[int, bytes]]) -> None:
        """Send packets at times [ns], which rise: each before the first instant after its time. Before the first
        run they replace the commands that wait."""
        self._core.set_script([(t, self._unit(packet)) for t, packet in packets])

    # --- what became of them ---

    @property
    def sent(self) -> list[tuple[int, bytes]]:
        """(time [ns], packet) of each command that has come, by radio too: its instant is the next one."""
        self._sent += self._core.take_received()
        return self._sent

    @property
    def reports(self) -> list[Report]:
        """All reports since these commands were first used, in order."""
        self._reports += [Report(t, sequence, code, Stage(stage), Reason(reason), detail, data, *origins(origin))
                          for t, sequence, code, stage, reason, detail, data, origin in self._core.take_reports()]
        return list(self._reports)

    def take_packets(self) -> list[Timed]:
        """The packets of telemetry since the last call, and the instant [ns] of each, as targets send them; -1: before
        the first instant. They are kept from the first call on."""
        return [Timed(t, packet) for t, packet in self._core.take_packets()]

    def play(self, packets: Iterable[Timed]) -> None:
        """Send these from now on, of a target that flew, in the order of time, or its frames; by
        radios, too."""
        self.plays_frames = self.dictionary.frames is not None
        self._core.play_telemetry([(packet.t, packet.packet) for packet in packets])

    def by(self, radio: Any) -> tuple[Callable[[bytes], None], Callable[[], list[Timed]]]:
        """The ground's end of a radio, a world.Radio that serves this process: send(bytes); and take(), what has come
        since the last call and when [ns], kept from the first one on. Raises SetupError if it is none."""
        core, process = self._core, self._process

        def send(packet: bytes) -> None:
            process().refuse_if_flown()
            self.spoke_frames |= self.dictionary.frames is not None
            core.send_by(radio, packet)

        def take() -> list[Timed]:
            return [Timed(*unit) for unit in core.take_from(radio, process()._core_simulation.time)]

        take()
        return send, take

    def take_keys(self, file: Path | str) -> None:
        """Those of a secured link. Raises SetupError for a file that is none, or that others may read."""
        self._core.set_keys(str(file))

    def take_units(self) -> list[Timed]:
        """As take_packets() the frames, of flight that speaks them."""
        return [Timed(t, unit) for t, unit in self._core.take_units()]

    @property
    def texts(self) -> list[Text]:
        """The texts that procedures have sent so far, in order."""
        return list(self._procedures.texts)

    @property
    def counters(self) -> Counters:
        accepted, executed, refused, reasons = self._core.command_counters
        return Counters(accepted, executed, refused, {Reason(i): n for i, n in enumerate(reasons) if n})

    def _send(self, packets: Iterable[bytes]) -> list[Report]:
        self._process().refuse_if_flown()
        before = len(self.reports)
        for packet in packets:
            self.sent.append((self._process()._core_simulation.time, packet))
            self._core.command(self._unit(packet))
        return self.reports[before:]

    def _unit(self, packet: bytes) -> bytes:
        """As the link carries it."""
        return self.dictionary.frames.command(packet) if self.dictionary.frames else packet

    def _module(self, module: Instance | str) -> tuple[str, Any]:
        """(path, object) of what a caller names."""
        process = self._process()
        names = {id(instance): name for name, instance in process.instances.items()}
        name = names.get(id(module)) or str(module).removeprefix(f"{process.name}.")
        self.dictionary.block(f"{process.name}.{name}")     # refuses what is not there
        return f"{process.name}.{name}", process.instances[name]


def _without_spares(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _without_spares(part) for name, part in value.items() if not name.startswith("spare")}
    return [_without_spares(part) for part in value] if isinstance(value, list) else value


def fill_store(stored: Any, packets: Sequence[bytes]) -> Any:
    """Let a StoredCommands have what packets of Code.STORE store, and nothing else; returns it. For a table of it."""
    if len(packets) > len(stored.commands) or any(packet[6] != Code.STORE for packet in packets):
        raise SetupError(f"fill_store: give up to {len(stored.commands)} packets of Packets.store(); "
                         f"found {len(packets)}")
    for place, packet in zip(stored.commands, [*packets, *[bytes(24)] * (len(stored.commands) - len(packets))]):
        place.crc, place.list, place.step, place.time = packing.unpack_from(">HHHq", packet, 10)
        place.size = len(packet) - 24
        place.packet = [*packet[24:], *bytes(len(place.packet) - place.size)]
    return stored


def block_bytes(module: Instance, memory: bytes | None = None) -> bytes:
    """The parameters of a module, or in the memory of one like it, big-endian."""
    fields, start, end = parameters(_core.struct(module))
    block = (_core.memory(module) if memory is None else memory)[start:end]
    return reversed_numbers(fields, block, start) if sys.byteorder == "little" else block
