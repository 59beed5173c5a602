# SPDX-License-Identifier: Apache-2.0
"""Links to a flight process of a co-simulation, by its queues of commands and telemetry: as an asynchronous program,
for which the run does not wait, and as a node, for which it does. Both find the run by the variables that
`fledge up` sets."""
from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import accumulate, takewhile
from pathlib import Path
from queue import Queue
from struct import Struct
from threading import Thread
from time import monotonic
from typing import TYPE_CHECKING, Any

from fledge.commands import Timed
from fledge.errors import Failure, SetupError
from fledge.frames import ROOM
from fledge.ground.scripts.links import Link, split
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from types import ModuleType

BATCH, TURN = 1000, 0.02    # packets, [s]: the most that a turn takes from the link
PATIENCE = 60.0     # [s] without any message of the run
UNIT = Struct(">qI")    # before each unit of cosim/node/units.h: its time [ns], its length


def _bindings() -> ModuleType:
    """The module fledge_node, which `fledge up` puts on the path of the programs that it starts."""
    try:
        import fledge_node
    except ImportError:
        raise SetupError("cosim: a link to a co-simulation is for programs that `fledge up` starts: there is no module "
                         "fledge_node") from None
    return fledge_node


def topics_of(process: str, radio: str | None = None) -> tuple[str, str]:
    """The topics of commands to a flight process and of its telemetry: its queues, or a radio of the world."""
    way = f"/{radio.replace('.', '/')}" if radio else f"/{process}"
    return (f"{way}/uplink", f"{way}/downlink") if radio else (f"{way}/commands", f"{way}/telemetry")


class _Messages:
    """How messages hold units. raw: a message of a queue is one unit, and not packets one after another."""

    def __init__(self, raw: bool, radio: str | None) -> None:
        self.raw, self.radio = raw, radio

    def fitting(self, units: Sequence[bytes], room: int) -> int:
        """How many of them a message takes."""
        sizes = [len(unit) + UNIT.size * bool(self.radio) for unit in units]
        return sum(1 for _ in takewhile(lambda n: n <= (ROOM if self.raw and not self.radio else room),
                                        accumulate(sizes)))

    def of(self, units: Sequence[bytes]) -> dict[str, Any]:
        whole = b"".join(UNIT.pack(0, len(unit)) + unit if self.radio else unit for unit in units)
        return {"n": len(whole), "bytes": whole}

    def units(self, message: Any, t: int) -> list[Timed]:
        """Those in a message of the time t, each with that of its arrival."""
        data = bytes(message["bytes"][:message["n"]])
        if not self.radio:
            whole, rest = ([data], b"") if self.raw else split(data)
            return [Timed(t, unit) for unit in [*whole, *([rest] if rest else [])]]
        timed, at = [], 0
        while at < len(data):
            arrived, n = UNIT.unpack_from(data, at)
            at += UNIT.size + n
            timed.append(Timed(arrived, data[at - n:at]))
        return timed


class Onlooker(Link):
    """An asynchronous program: what it sends enters the run at the first time that flight was not granted yet, and is
    in the record of the exchange. Of a controller that was killed, that record also has what the controller had not
    passed on. raw: the messages of telemetry are not cut into packets. radio: by that model of the world,
    "world.radio"."""

    def __init__(self, process: str, raw: bool = False, radio: str | None = None) -> None:
        self._messages = _Messages(raw, radio)
        self._newest: int | None = None      # [ns] of the last message of telemetry
        self._gaps: list[tuple[int, int, str]] = []
        self._rest: Iterator[list[Timed]] | None = None     # once the controller is gone: what its record has
        self._gone = ""                                     # and why there is no more
        self._receive: Callable[[Any], None] = lambda message: None
        bindings = _bindings()
        try:
            self._observer = bindings.Observer()
        except bindings.NodeError as error:
            raise SetupError(f"cosim:{process}: {error}") from None
        self._commands, self._telemetry = topics_of(process, radio)
        self._observer.subscribe(f"/{process}/", self._telemetry)   # all of them have the time

    @property
    def t(self) -> int:
        return max(int(self._observer.t), self._newest or 0)

    @property
    def topics(self) -> Any:
        """All that the run shows to observers."""
        return self._observer.topics

    def watch(self, topics: Iterable[str], receive: Callable[[Any], None]) -> None:
        """Receive also the messages of these topics, as they come in receive()."""
        self._receive = receive
        self._observer.subscribe(*topics)

    def send(self, packet: bytes) -> None:
        try:
            self._observer.write(self._commands, self._messages.of([packet]))
        except _bindings().NodeError as error:
            raise ConnectionError(str(error)) from None

    def receive(self, until: int) -> list[Timed]:
        wait = PATIENCE if self.wait is None else self.wait
        packets: list[Timed] | None = []
        while packets is not None and not packets and self.t < until:
            packets = self._next(wait)
        # A turn of a program that waits no longer than that costs more than a message.
        end = monotonic() + TURN
        while packets and self.wait is not None and len(packets) < BATCH and monotonic() < end:
            more = self._next(0.0)
            if more is None:
                break
            packets += more
        return packets or []

    def _next(self, wait: float) -> list[Timed] | None:
        """The packets of the next message; None: it has not come in time [s]."""
        try:
            message = self._observer.next(wait) if self._rest is None else None
        except _bindings().NodeError as error:
            self._gone, self._rest, message = str(error), self._recorded(), None
        if self._rest is not None:
            packets = next(self._rest, None)
            if packets is None and wait:    # else there are packets before that
                raise ConnectionError(self._gone)
            return packets
        if message is None:
            if wait and (self.wait is None or self._observer.reason is not None):
                raise ConnectionError("the run is over" if self._observer.reason is not None else
                                      f"the run has written nothing for {PATIENCE:g} s")
            return None     # the run is paused, or there is no more now
        self._receive(message)
        if message.topic != self._telemetry:
            return []
        self._count(message)
        return self._messages.units(message, message.t) if message["n"] else []

    def _recorded(self) -> Iterator[list[Timed]]:
        """The packets of each message that the controller has recorded after the newest one that came. Then a gap, if
        the record has no end: it lacks the controller's last second."""
        newest, n, name = self._newest, 0, os.environ.get("FLEDGE_EXCHANGE")
        whole, problem = False, "" if name else ", and there is no record of its messages here"
        if name and newest is not None:     # else this program does not know where it came in
            from fledge.archive import Archive, ArchiveError

            path = Path(name)
            path = path if path.exists() else path.with_name(f"{path.name}.part")
            try:
                with Archive(path) as record:
                    times = record.time_ns(self._telemetry)
                    first = int(times.searchsorted(newest, "right"))
                    for t, message in zip(times[first:].tolist(), record.messages(self._telemetry, first)):
                        newest = self._newest = t
                        n += 1
                        yield self._messages.units(message, t) if message["n"] else []
                problem = f"; {n} messages of {self._telemetry} are from {path}"
                whole = record.complete and "end" in record.metadata
            except ArchiveError as error:
                problem = f", and its record cannot be read: {error}"
        self._gone += problem
        if not whole:
            self._gone += "; what was sent later is lost"
            self._gaps.append((-1 if newest is None else newest, -1, self._gone))

    def hurry(self) -> None:
        """Wait no more for a controller whose connection is lost."""
        self._observer.patience = 0

    def leave(self) -> None:
        """Take what is left from the controller's record, for this program has no time to wait for the run's end."""
        if self._rest is None:
            self._gone, self._rest = "this program ended before the run", self._recorded()

    @property
    def goes_on(self) -> bool:
        """Whether the run goes on, as far as is known here."""
        return self._rest is None and self._observer.reason is None and not self._observer.lost

    def gaps(self) -> list[tuple[int, int, str]]:
        gaps, self._gaps = self._gaps, []
        return gaps

    def _count(self, message: Any) -> None:
        """Record the messages of telemetry that were lost before this one, also those before the first if this program
        came late."""
        missed = message.missed if self._newest is not None else max(message.count - 1, 0)
        self.dropped += message.missed
        if missed:
            self._gaps.append((-1, message.t, f"{message.topic} was not heard here") if self._newest is None else (
                self._newest, message.t, f"{missed} messages of {message.topic} went lost on their way here"))
        self._newest = message.t

    def close(self) -> None:
        self._observer.close()


class Member(Link):
    """A node: the run waits while its program thinks. The program's own time is that of the step at which it waits.
    raw: a message of commands is one unit, and those of telemetry are not cut into packets. radio: by that model of the
    world, "world.radio"."""

    def __init__(self, process: str, every: str, raw: bool = False, radio: str | None = None) -> None:
        self._messages = _Messages(raw, radio)
        bindings = _bindings()
        try:
            period = time_ns(float(every), "every")
        except ValueError:
            raise SetupError(f"cosim:{process}: every is a number of seconds; found '{every}'") from None
        try:
            self._node = bindings.Node(every=period)
        except bindings.NodeError as error:
            raise SetupError(f"cosim:{process}: {error}") from None
        self._commands, self._telemetry = topics_of(process, radio)
        self._node.reads(self._telemetry, keep=True)
        self._node.writes(self._commands)
        self._t = -1
        self._outbox: list[bytes] = []
        self._steps: Queue[int | BaseException | None] = Queue(1)   # an instant; the end of the run, or why it ended
        self._goes_on: Queue[bool] = Queue(1)                       # the program waits for the next instant
        self._closed = False
        self._node.step(self._step)
        self._thread = Thread(target=self._serve, daemon=True)
        self._thread.start()
        self._advance()

    @property
    def t(self) -> int:
        return self._t

    def send(self, packet: bytes) -> None:
        self._outbox.append(packet)

    def receive(self, until: int) -> list[Timed]:
        while self._t < until:
            self._goes_on.put(True)
            self._advance()
            messages = self._node.unread(self._telemetry)
            if messages and messages[0].get("every", 0) not in (0, self._node.every):
                raise Failure(f"{self._node.name}: what comes by radio comes every {messages[0]['every'] / 1e9:g} s, "
                              f"with flight's instants; write every={messages[0]['every'] / 1e9:g}", 1)
            packets = [unit for message in messages for unit in self._messages.units(message, self._t)]
            if packets:
                return packets
        return []

    def close(self) -> None:
        """The program waits for nothing more. The node still takes part, and the run goes on to its end."""
        if not self._closed:
            self._closed = True
            self._goes_on.put(False)
            self._thread.join()

    # --- the thread of the node ---

    def _serve(self) -> None:
        try:
            self._node.run()
            self._steps.put(None)
        except BaseException as error:  # is raised in the program's own thread
            self._steps.put(error)

    def _step(self, t: int) -> None:
        if self._closed:
            return
        self._steps.put(t)
        self._goes_on.get()
        room = next(n for name, n, _ in self._node.schema(self._commands).fields if name == "bytes")
        if now := self._messages.fitting(self._outbox, room):
            self._node[self._commands] = self._messages.of(self._outbox[:now])
            del self._outbox[:now]

    # --- the thread of the program ---

    def _advance(self) -> None:
        """Wait for the node's next instant."""
        step = self._steps.get()
        if isinstance(step, int):
            self._t = step
            return
        self._closed = True
        raise Failure(f"the run ended early: {step}", 1) if step else ConnectionError("the run is over")
