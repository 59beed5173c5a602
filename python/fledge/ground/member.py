# SPDX-License-Identifier: Apache-2.0
"""Links to a flight process of a co-simulation, whose target has queues of commands and telemetry: as an asynchronous
program, for which the run does not wait, and as a node, for which it does. Both find the run by the variables that
`fledge up` sets."""
from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import accumulate, takewhile
from queue import Queue
from threading import Thread
from typing import Any

from fledge.commands import Timed
from fledge.errors import Failure, SetupError
from fledge.frames import ROOM
from fledge.ground.links import Link, split
from fledge.objects.si import time_ns

PATIENCE = 60.0     # [s] without any message of the run


def _bindings():
    """The module fledge_node, which `fledge up` puts on the path of the programs that it starts."""
    try:
        import fledge_node
    except ImportError:
        raise SetupError("cosim: a link to a co-simulation is for programs that `fledge up` starts: there is no module "
                         "fledge_node") from None
    return fledge_node


def _topics(process):
    return f"/{process}/commands", f"/{process}/telemetry"


def _message(packets: Sequence[bytes]) -> dict[str, Any]:
    whole = b"".join(packets)
    return {"n": len(whole), "bytes": whole}


def _packets(message: Any, raw: bool) -> list[bytes]:
    data = bytes(message["bytes"][:message["n"]])
    whole, rest = ([data], b"") if raw else split(data)
    return [*whole, *([rest] if rest else [])]


class Onlooker(Link):
    """An asynchronous program: what it sends enters the run at the first time that flight was not granted yet, and is
    in the record of the exchange. raw: the messages of telemetry are not cut into packets."""

    def __init__(self, process: str, raw: bool = False) -> None:
        self.raw = raw
        self._hear: Callable[[Any], None] = lambda seen: None
        bindings = _bindings()
        try:
            self._observer = bindings.Observer()
        except bindings.NodeError as error:
            raise SetupError(f"cosim:{process}: {error}") from None
        self._commands, self._telemetry = _topics(process)
        self._observer.subscribe(f"/{process}/")     # all of them say what time it is

    @property
    def t(self) -> int:
        return int(self._observer.t)

    @property
    def topics(self) -> Any:
        """All that the run shows to observers."""
        return self._observer.topics

    def watch(self, topics: Iterable[str], hear: Callable[[Any], None]) -> None:
        """Hear also the messages of these topics, as they come in receive()."""
        self._hear = hear
        self._observer.subscribe(*topics)

    def send(self, packet: bytes) -> None:
        try:
            self._observer.write(self._commands, _message([packet]))
        except _bindings().NodeError as error:
            raise ConnectionError(str(error)) from None

    def receive(self, until: int) -> list[Timed]:
        while self.t < until:
            seen = self._observer.next(PATIENCE if self.wait is None else self.wait)
            if seen is None and self.wait is not None and self._observer.reason is None:
                break       # the run is paused
            if seen is None:
                raise ConnectionError("the run is over" if self._observer.reason is not None else
                                      f"the run has written nothing for {PATIENCE:g} s")
            self.dropped += seen.missed if seen.topic == self._telemetry else 0
            self._hear(seen)
            if seen.topic == self._telemetry and seen["n"]:
                return [Timed(seen.t, one) for one in _packets(seen, self.raw)]
        return []

    def close(self) -> None:
        self._observer.close()


class Member(Link):
    """A node: the run waits while its program thinks. The program's own time is that of the step at which it waits.
    raw: a message of commands is one unit, and those of telemetry are not cut into packets."""

    def __init__(self, process: str, every: str, raw: bool = False) -> None:
        self.raw = raw
        bindings = _bindings()
        try:
            period = time_ns(float(every), "every")
        except ValueError:
            raise SetupError(f"cosim:{process}: every is a number of seconds; found '{every}'") from None
        try:
            self._node = bindings.Node(every=period)
        except bindings.NodeError as error:
            raise SetupError(f"cosim:{process}: {error}") from None
        self._commands, self._telemetry = _topics(process)
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
            found = [Timed(self._t, one) for message in self._node.unread(self._telemetry)
                     for one in _packets(message, self.raw)]
            if found:
                return found
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
        room = ROOM if self.raw else room
        now = list(takewhile(lambda n: n <= room, accumulate(map(len, self._outbox))))
        if now:
            self._node[self._commands] = _message(self._outbox[:len(now)])
            del self._outbox[:len(now)]

    # --- the thread of the program ---

    def _advance(self) -> None:
        """Wait for the node's next instant."""
        found = self._steps.get()
        if isinstance(found, int):
            self._t = found
            return
        self._closed = True
        raise Failure(f"the run ended early: {found}", 1) if found else ConnectionError("the run is over")
