# SPDX-License-Identifier: Apache-2.0
"""A computer on a board, which runs a program, alone or as the flight process of a simulation."""
from __future__ import annotations

import copy
import functools
import os
import random
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fledge import _emulator, objects
from fledge.commands import byte_runs
from fledge.emulator.memory import Variable, address
from fledge.errors import Failure, RunError, SetupError, did_you_mean
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from fledge import _core
    from fledge.mission.process import Process
    from fledge.mission.simulation import Simulation


class Board:
    """A computer that runs a program.

    board: the file that describes it, emulator/boards/*.toml; program: an ELF file; engine: "translator", "threaded"
    or "interpreter", which give the same states. Raises SetupError if a file is wrong.
    """

    def __init__(self, board: Path | str, program: Path | str, engine: str = "translator") -> None:
        self.core = _emulator.Computer(os.fspath(board), os.fspath(program), engine)
        self.on_stop: Callable[[str], object] | None = None     # at breakpoints and watchpoints in the loop
        self.sim: Any = None            # the simulation whose flight process this computer is
        self._link: Any = None
        self.in_flight: Any = None      # its exchange with the simulation

    # --- running ---

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return self.core.now / 1e9

    def run_until(self, t: Any) -> str:
        """Run until a time. Returns the reason of the stop: "time", "early" (a device ended it), "breakpoint" (at its
        instruction), "watchpoint" (behind the instruction) or "error" (a trap while traps are disabled)."""
        return self.core.run_until(time_ns(t, "run_until"))

    def step(self, n: int = 1) -> str:
        """Execute the next instruction, or the next n; a trap counts as one. Returns the reason of the stop."""
        reason = "time"
        for _ in range(_whole(n, 0, 2**63, "step")):
            reason = self.core.step()
            if reason != "time":
                break
        return reason

    # --- its state ---

    @property
    def registers(self) -> dict[str, int]:
        """All registers of the present window, by their names: "%l3", "%f0", "%psr"; f registers as their bits."""
        return self.core.registers()

    @property
    def devices(self) -> dict[str, dict[str, int]]:
        """The registers of the devices, by the names of both; to read them changes nothing."""
        return {device: {name: value for name, (_, value) in words.items()}
                for device, words in self.core.devices().items()}

    def write_device(self, device: str, register: str, value: int) -> None:
        """Write a register of a device, as the program does. Raises SetupError if there is none."""
        devices = self.core.devices()
        names = devices.get(device, {})
        if register not in names:
            there = list(names or devices)
            raise SetupError(f"write_device: there is no '{register if names else device}'; there are "
                             + ", ".join(there))
        self.core.poke(names[register][0], _whole(value, 0, 2**32 - 1, "write_device").to_bytes(4, "big"))

    def peek(self, place: int | str, n: int) -> bytes:
        """n bytes at an address, or at a symbol."""
        return self.core.peek(self.address(place), _whole(n, 0, 2**31, "peek: bytes"))

    def poke(self, place: int | str, content: bytes) -> None:
        """Write bytes at an address, or at a symbol."""
        self.core.poke(self._changed(place), content)

    def address(self, place: int | str) -> int:
        """The address of a symbol, or of a variable of flight, "flight.control.K"; an address itself."""
        if not isinstance(place, str):
            return _whole(place, 0, 2**32 - 1, "an address")
        if self.in_flight is not None and place.startswith(f"{self.in_flight.name}."):
            _, *names, last = place.split(".")
            return address(functools.reduce(getattr, names, self.flight), last)
        symbol = self.core.symbol(place)
        if symbol is None:
            raise SetupError(f"the program has no symbol '{place}'"
                             + did_you_mean(place, self.core.symbols()).rstrip(";"))
        return symbol[0]

    def _changed(self, place: str | int) -> int:
        """address(), for a change of its value. Raises SetupError on a variable of flight before it was booted."""
        if isinstance(place, str) and self.in_flight is not None and place.startswith(f"{self.in_flight.name}."):
            self.refuse_before_boot(place)
        return self.address(place)

    def refuse_before_boot(self, path: str) -> None:
        """Raise SetupError if the program of a flight has not set its variables yet: it would set this one again."""
        if self.in_flight is not None and self._link.reached < 0:
            raise SetupError(f"{path}: the program sets its variables when it boots, at the first instant, so that "
                             "this has no effect: sim.step() first, or give the mission the value")

    @property
    def report(self) -> str:
        """Where it stands: registers, and the calls that led there."""
        return self.core.report()

    @property
    def console(self) -> str:
        """What the program has printed."""
        return self.core.console

    def send(self, data: bytes | str, uart: int = 0) -> None:
        """Bytes that a UART of the board receives: the first one is the console. The program reads them while the
        computer runs. Raises SetupError if they are more than there is room for (1024 that wait)."""
        self.core.send(data.encode() if isinstance(data, str) else bytes(data),
                       _whole(uart, 0, 255, "send: a UART"))

    def snapshot(self) -> Any:
        """The whole state of the computer, and of the simulation that it flies in."""
        return (self.core.snapshot(), self._link and self._link.save(), self.sim and self.sim.snapshot(),
                self.in_flight and copy.deepcopy(self.in_flight.links))

    def restore(self, snapshot: Any) -> None:
        """Go back, or on, to a snapshot of this computer."""
        machine, link, sim, links = snapshot
        if (sim is None) != (self.sim is None):
            raise SetupError("restore: this snapshot was taken " + ("without" if sim is None else "with")
                             + " the simulation")
        self.core.restore(machine)
        if self.sim is not None:
            self._link.restore(link)
            self.sim.restore(sim)
            self.in_flight.links = copy.deepcopy(links)

    def save(self, path: Path | str) -> None:
        """Write the state of the computer, without the simulation, into a file."""
        Path(path).write_bytes(self.core.save())

    def load(self, path: Path | str) -> None:
        """Take the state from a file that save() wrote, of the same board."""
        self.core.load(Path(path).read_bytes())

    # --- faults ---

    def flip(self, place: int | str, bit: int) -> None:
        """Invert a bit: of a register, "%l3" (0, the lowest, to 31), or of the byte at an address or symbol (0 to
        7)."""
        self.core.flip(place if isinstance(place, str) and place.startswith("%") else self._changed(place),
                       _whole(bit, 0, 31, "flip: a bit"))

    def flip_next_read(self, bits: int) -> None:
        """Invert bits of the word that the processor reads next from RAM as data, as on the bus."""
        self.core.flip_next_read(_whole(bits, 0, 2**32 - 1, "flip_next_read"))

    def fail_next_read(self) -> None:
        """The next word that the processor reads from RAM as data has an error of the bus: the read traps."""
        self.core.fail_next_read()

    def interrupt(self, line: int) -> None:
        """Raise an interrupt, 1 to 15, that no device has raised."""
        self.core.raise_interrupt(_whole(line, 1, 15, "interrupt: a line"))

    def stick_interrupts(self, on: Iterable[int] = (), off: Iterable[int] = ()) -> None:
        """From now on these lines are always pending, or never; without any, the lines work again."""
        self.core.stick_interrupts(*(sum({1 << _whole(line, 1, 15, "stick_interrupts: a line") for line in lines})
                                     for lines in (on, off)))

    @property
    def missed(self) -> int:
        """In the loop: ticks that flight did not answer before its next instant."""
        return self._link.missed

    def lose_ticks(self, n: int) -> None:
        """In the loop: the next n ticks do not reach the processor."""
        self._link.lose_ticks(_whole(n, 0, 2**63, "lose_ticks"))

    @property
    def lanes(self) -> dict[str, tuple[int, int]]:
        """In the loop: (address, bytes) of each lane of the boards, "io_board_a.tachometers"."""
        return {name: (at, size) for name, at, size in self._link.registers()}

    def stick_register(self, place: int | str, on: int = 0, off: int = 0) -> None:
        """In the loop: from now on these bits of a register of a board are 1, or 0, for the program and in what it
        writes; a reset does not mend it. place: an address of `lanes`, or the name of a lane, for its first word. One
        register at a time; without bits it works again."""
        lane = self.lanes.get(place) if isinstance(place, str) else None
        at = lane[0] if lane else self.address(place)
        self._link.stick(at, *(_whole(bits, 0, 2**32 - 1, "stick_register: bits") for bits in (on, off)))

    def disturb(self, path: str, kind: str, begin: Any, end: Any, *, late: Any = 1, seed: int = 0) -> None:
        """In the loop: from one time to another a message between world and computer, "world.adc_a.counts", is "LOST"
        (the last one stands), "LATE" by that time [s] (the first ones are lost), or "GARBLED": one bit of each is
        inverted, drawn by the seed."""
        known = list(self.in_flight.paths.values())
        if path not in known:
            raise SetupError(f"disturb: no message '{path}' passes the registers{did_you_mean(path, known)} there are "
                             + ", ".join(known))
        if kind not in ("LOST", "LATE", "GARBLED"):
            raise SetupError(f"disturb: a link is LOST, LATE or GARBLED; found {kind!r}")
        first, last = time_ns(begin, "disturb: begin"), time_ns(end, "disturb: end")
        if first >= last:
            raise SetupError(f"disturb: the end must be after the begin; found {begin} and {end}")
        self.in_flight.links[path] = _Disturbed(kind, first, last, time_ns(late, "disturb: late"), seed, [])

    # --- stops ---

    def breakpoint(self, place: int | str, on: bool = True) -> None:
        """Stop in front of an instruction."""
        self.core.set_breakpoint(self.address(place), on)

    def watchpoint(self, place: int | str, size: int = 4, *, read: bool = False, write: bool = True, on: bool = True
                   ) -> None:
        """Stop behind instructions that read or write these bytes."""
        self.core.set_watchpoint(self.address(place), _whole(size, 1, 2**31, "watchpoint: bytes"), read, write, on)

    def gdb(self, address: str = "127.0.0.1:0") -> int:
        """Serve gdb at [ADDRESS:]PORT, from now on whenever the computer runs; port 0 takes a free one. Returns the
        port. In gdb: target remote :PORT."""
        return self.core.serve_gdb(address)

    def wait_for_gdb(self, timeout: float | None = None) -> bool:
        """Wait until gdb is there, at most so long [s]. The computer then stands until gdb lets it run."""
        return self.core.wait_for_gdb(-1 if timeout is None else round(timeout * 1e3))

    # --- what it does ---

    def trace(self, path: Path | str, begin: Any = 0, end: Any = None) -> None:
        """Write each instruction that begins at these times of the computer into a file, until finish()."""
        self.core.trace(os.fspath(path), time_ns(begin, "trace"), 2**63 - 1 if end is None else time_ns(end, "trace"))

    def coverage(self, path: Path | str) -> None:
        """Count lines and branches until finish(), which writes the file, for genhtml."""
        self.core.coverage(os.fspath(path))

    def profile(self, path: Path | str) -> None:
        """Count instructions and cycles of each function until finish(), which writes the file, for
        callgrind_annotate."""
        self.core.profile(os.fspath(path))

    def watch_stacks(self) -> None:
        """Watch until finish() how deep each stack is used."""
        self.core.stacks()

    def finish(self) -> None:
        """End traces, coverage and profiles. While one of them counts, the plain interpreter runs."""
        self.core.finish()

    @property
    def stacks(self) -> dict[str, tuple[int, int]]:
        """Of each stack since watch_stacks(): (bytes used at most, its size, 0 if that is not known), by its name."""
        return {name: (used, size) for name, used, size in self.core.depths()}

    # --- in the loop ---

    def fly(self, sim: Simulation, tables: Path | str, process: str | None = None) -> None:
        """Become a flight process of a simulation that has not run: its modules no longer run there, and the computer
        puts out their messages, those that cross its registers and all others. tables: the mission as data for the
        outside, as the targets build it."""
        flight = sim.process(process) if process else sim.flight
        if sim.time_ns >= 0:
            raise SetupError(f"fly: {sim.name} has run until {sim.time:g} s; give one that has not run")
        sim.prepare()
        self.sim, self._link = sim, _emulator.Link(self.core, os.fspath(tables))
        self.in_flight = _Flight(self, sim, flight, self._link)
        self._link.on_stop(lambda reason: self.on_stop and self.on_stop(reason))
        sim.kernel.process(flight.name).fly_by(self.in_flight.exchange)
        sim.prepare()

    @property
    def flight(self) -> Any:
        """The modules of flight in the memory of the computer: board.flight.control.K."""
        if self.in_flight is None:
            raise SetupError("this computer flies in no simulation; fledge.emulator.load(MISSION) makes one that does")
        return self.in_flight.modules


def _whole(value: Any, low: int, high: int, what: str) -> int:
    """A whole number within bounds. Raises SetupError."""
    if not isinstance(value, (int, np.integer)) or not low <= value <= high:
        raise SetupError(f"{what} must be a whole number from {low} to {high}; found {value!r}")
    return int(value)


class _Modules:
    """The modules of a flight process, as attributes."""

    def __init__(self, name: str, variables: dict[str, Variable]) -> None:
        self._name, self._found = name, variables

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self._found:
            raise AttributeError(f"{self._name} has no '{name}'{did_you_mean(name, list(self._found))} there are "
                                 + ", ".join(self._found))
        return self._found[name]

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            raise AttributeError(f"{self._name}.{name}: set a field of it, as in {self._name}.control.K = 3 * N * m")
        object.__setattr__(self, name, value)

    def __dir__(self) -> list[str]:
        return list(self._found)


class _Disturbed(NamedTuple):
    """A link with a fault; times [ns]."""
    kind: str
    begin: int
    end: int
    late: int
    seed: int
    waiting: list[tuple[int, bytes]]        # messages that are late

    def passes(self, t: int, message: bytes) -> bytes | None:
        """What comes out at an instant; None: nothing new."""
        if not self.begin <= t < self.end:
            return message
        if self.kind == "GARBLED":
            byte, bit = divmod(random.Random(f"{self.seed} {t}").randrange(8 * len(message)), 8)
            return message[:byte] + bytes([message[byte] ^ 1 << bit]) + message[byte + 1:]
        if self.kind == "LOST":
            return None
        self.waiting.append((t + self.late, message))
        return self.waiting.pop(0)[1] if self.waiting[0][0] <= t else None


class _Flight:
    """The exchange between a simulation and the computer that is one of its flight processes."""

    def __init__(self, board: Board, sim: Simulation, process: Process, link: _emulator.Link) -> None:
        self.board, self.sim, self.link, self.name = board, sim, link, process.name
        self.kernel = sim.kernel.process(process.name)
        # with record(): (t [ns], what crossed the registers, None if no answer came)
        self.answers: list[tuple[int, bytes | None]] | None = None
        self.script: list[tuple[int, bytes]] = []       # (after [ns], packet) of commands, in the order of time
        self.telemetry: list[tuple[int, bytes]] = []    # (t [ns], packet)
        self.links: dict[str, _Disturbed] = {}          # by the path of a message
        wires = {source: target for source, target, *_ in sim.wires if target.startswith(f"{process.name}.")}
        self.inputs: list[tuple[int, Any]] = []
        self.carried: list[tuple[int, Any]] = []
        self.inside: list[tuple[int, int, Any, Any]] = []
        mission = link.mission()        # its address in the computer
        places = {}
        self.paths = {id: path for id, (path, *_) in enumerate(link.messages()) if link.carries(id)}
        for id, (path, offset, size, is_input) in enumerate(link.messages()):
            _, name, port = path.split(".")
            if is_input:
                target = wires.get(path, path).split(".")
                self.inputs.append((id, getattr(process.instances[target[1]], target[2])))
                continue
            instance = process.instances[name]
            field = next(member for member in objects.struct(instance).fields if member.name == port)
            places[name] = mission + offset - field.offset
            view = getattr(instance, port)
            if link.carries(id):
                self.carried.append((id, view))
            else:
                self.inside.append((mission + offset, size, _reversal(field.struct), view))
        self.modules = _Modules(process.name, {
            name: Variable(board, places[name], objects.struct(instance), f"{process.name}.{name}")
            for name, instance in process.instances.items() if name in places})

    def exchange(self, t: int) -> None:
        """At an instant of flight: write its inputs into the registers, run it, and read its outputs."""
        link = self.link
        if self.sim.kernel.now < 0:
            self.tick(-1)
        for id, view in self.inputs:
            message = self.through(t, id, self.kernel.incoming(view))
            if message is not None:
                link.put(id, message)
        if link.is_down(t):
            return                      # its outputs stay
        for after, packet in self.script:
            if link.reached <= after < t:
                link.send(packet)
        answered = self.tick(t)
        for id, view in self.carried:
            message = self.through(t, id, self.link.take(id))
            if message is not None:
                self.kernel.put_out(view, message)
        for place, size, order, view in self.inside:
            self.kernel.put_out(view, np.frombuffer(self.board.core.peek(place, size), np.uint8)[order].tobytes())
        self.telemetry += [(t, packet) for packet in link.receive()]
        if self.answers is not None:
            outputs = (objects.memory(view) for _, view in self.carried)
            self.answers.append((t, b"".join(outputs) if answered else None))

    def through(self, t: int, id: int, message: bytes) -> bytes | None:
        """What comes of a message through its link; None: nothing new."""
        link = self.links.get(self.paths.get(id, "")) if self.links else None
        return link.passes(t, message) if link else message

    def tick(self, t: int) -> bool:
        """Returns whether flight has answered; a world that records it goes on without an answer."""
        missed = self.link.missed
        if self.link.tick(t):
            return self.link.missed == missed
        if self.answers is None:
            printed = "\n".join(self.board.console.splitlines()[-12:])
            raise RunError(f"the processor is in its error mode, in the tick at {t / 1e9:g} s\n{self.board.report}"
                           + (f"the program's last words:\n{printed}" if printed else ""))
        return False

    def record(self) -> list[tuple[int, bytes | None]]:
        """From now on, into a new list, which this returns."""
        self.answers = []
        return self.answers


def _reversal(struct: _core.Struct) -> np.ndarray:
    """Of each byte of a message, its place in the other byte order."""
    order: list[int] = []
    at = 0
    for width, n in byte_runs(struct.fields):
        for _ in range(n):
            order += range(at + width - 1, at - 1, -1)
            at += width
    return np.array(order)


def load(mission: str, scenario: str | None = None, *, process: str | None = None, engine: str = "translator",
         board: Path | str | None = None, registers: Sequence[Path | str] = (), folder: Path | str | None = None,
         **parameters: Any) -> Board:
    """Export a mission, build it for a LEON3, and boot it on a board around which the mission's world runs, as the
    scenario sets it up (default: the first). `sim` of the Board is that simulation, which has not run yet.

    process: the flight process; None: the only one. board: the file of the computer; registers: files of boards that
    its messages pass; none: one that carries them whole. folder: for what is built; default: runs/MISSION/fly.
    parameters: of the mission, as fledge.load() takes them.
    """
    from fledge.targets import Job
    from fledge.targets.leon3 import Leon3
    from fledge.targets.leon3.board import BOARD

    boards = {process or "": registers} if registers else None
    job = Job(mission, scenario, boards=boards, folder=folder, parameters=parameters)
    if process is None and len(job.parts) > 1:
        raise Failure(f"{mission} has several flight processes; name one: {', '.join(p.process for p in job.parts)}")
    part = job.part(process) if process else job.parts[0]
    flying = Board(board or BOARD, Leon3().build(part), engine)
    flying.fly(job.start, part.tables(), part.process)
    flying.in_flight.script = [(entry.t, entry.packet) for entry in part.script]
    return flying
