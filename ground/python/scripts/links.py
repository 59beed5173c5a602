# SPDX-License-Identifier: Apache-2.0
"""Links that carry space packets between a ground system and a spacecraft, each with a clock of its own: by sockets and
devices. A datagram is a packet, or several whole ones. A stream has packets one after another; bytes that cannot begin
a packet are skipped and counted."""
from __future__ import annotations

import re
import select
import socket
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from threading import Lock
from time import monotonic_ns, time_ns
from typing import Any

from fledge.commands import Timed, sequence_of
from fledge.errors import Failure, SetupError

PACKET_LEAST, PACKET_MOST = 7, 6 + 65536    # [bytes] of a space packet
NEAR = 16                                   # packets of an application that may be lost in a damage of a stream
CHUNK = 1 << 16                             # [bytes] that are read or written at once
AT_ONCE = 500                               # datagrams
WAITING = 1 << 22                           # [bytes] of datagrams that the operating system keeps
OUTBOX = 1 << 20                            # [bytes] that wait for a reader that is slower than the link
SLICE = 50_000_000                          # [ns] after which a stream sends again what waits
CLIENTS, UNREAD = 16, 30                    # of a server; [s] after which one that takes no byte is cut off
USER_TIMEOUT = 18                           # TCP_USER_TIMEOUT of Linux
GONE = "the other end of the link is gone"


class NoAnswer(Failure):
    """What a script waited for did not happen in time, or the spacecraft refused it."""

    def __init__(self, text: str) -> None:
        super().__init__(text, 1)


class Link(ABC):
    """A way to a spacecraft and back. One thread receives; send() may come from another."""

    numbers = False     #: it numbers what it sends, and counts on behind others by itself
    unchecked = False   #: a server does not check the constraints of what it sends now, where they may be suspended
    confirmed = False   #: what it sends now is meant, also if it is hazardous: a server of a control room asks for it
    skipped = 0     #: bytes that were no packet
    dropped = 0     #: packets that a slow reader missed
    #: [s] of real time after which receive() returns, also while the link's own clock stands; None: it waits on
    wait: float | None = None

    @property
    @abstractmethod
    def t(self) -> int:
        """[ns] of the link's clock: simulated time in a simulation, else since the link was opened."""

    @property
    def origin(self) -> int:
        """[ms] Rises from one link to a spacecraft to the next, so that each may number what it sends from there."""
        return self.t // 10**6 + 1

    @abstractmethod
    def send(self, packet: bytes) -> bytes | None:
        """Send a packet. Returns it as it went, if the link has numbered it anew. Raises OSError if the link is
        broken."""

    @abstractmethod
    def receive(self, until: int) -> list[Timed]:
        """The packets that arrive next, each with the time [ns] of its arrival; [] when the clock reaches `until`."""

    def answers(self) -> list[tuple[bytes, bool]]:
        """(packet, whether the spacecraft has it) of those of which the link has learned it since the last call; False:
        the link gave up, and it may have arrived or not. A link that never knows has none."""
        return []

    def gaps(self) -> list[tuple[int, int, str]]:
        """(from, to, why) [ns] of the link's clock, of which the link has learned since the last call that packets
        between were lost on their way to this program; from -1: what was sent before it was here; to -1: what was
        sent until the end of a run, which this program did not hear."""
        return []

    def damages(self) -> list[str]:
        """In words, what the link has skipped since the last call: how many bytes, where and why."""
        return []

    def close(self) -> None:
        """Let go of the link."""

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()


class Splitter:
    """Finds the packets in a stream of bytes.

    accepts: whether a packet may begin with these six bytes; without it, any of the version 0. A byte at which none
    can begin is skipped, so that the stream is found again after a damage. So is a packet of an unusual length, if
    others inside of it continue their applications' counts and lead beyond its end: its length is damaged. (The first
    of an application has no usual length: it is a packet if others continue behind it.)
    """

    def __init__(self, accepts: Callable[[bytes], bool] | None = None) -> None:
        self._accepts = accepts or (lambda header: header[0] >> 5 == 0)
        self._rest = bytearray()
        self._begin = 0                                     # [bytes] of the stream before the rest
        self._known: dict[bytes, tuple[int, int]] = {}      # count and size of the last packet, by its first two bytes
        self._heads: re.Pattern[bytes] | None = None        # where one of these two bytes stands
        self._check = 0                                     # [bytes] of a packet at which to look into it again
        self._lost: tuple[int, str] | None = None           # where the bytes that are being skipped begin, and why
        self.skipped = 0
        self.damages: list[str] = []    #: what was skipped, where and why; the caller empties it

    def feed(self, data: bytes) -> list[bytes]:
        """The packets that are whole now."""
        self._rest += data
        at, packets = 0, []
        while len(self._rest) - at >= PACKET_LEAST:
            header = bytes(self._rest[at:at + 6])
            if not self._accepts(header):
                self._skip(at, at + 1, "no packet can begin there")
                at += 1
                continue
            size = _size(header)
            end = at + size
            if (inside := self._inside(at, end)) is not None:
                self._skip(at, inside, f"a packet of {size} bytes would begin there, but others that continue those "
                           "before stand inside of it")
                at, self._check = inside, 0
                continue
            if end > len(self._rest):
                break
            self._report(at)
            packets.append(bytes(self._rest[at:end]))
            if header[:2] not in self._known:
                self._heads = re.compile(b"(?=%s)" % b"|".join(map(re.escape, [*self._known, header[:2]])), re.DOTALL)
            self._known[header[:2]] = sequence_of(header), size
            at, self._check = end, 0
        del self._rest[:at]
        self._begin += at
        return packets

    def _skip(self, at: int, to: int, why: str) -> None:
        self.skipped += to - at
        self._lost = self._lost or (self._begin + at, why)

    def _report(self, at: int) -> None:
        """A packet begins: note what was skipped before it."""
        if self._lost:
            begin, why = self._lost
            self.damages.append(f"{self._begin + at - begin} bytes of the stream from byte {begin} on are no packet: "
                                f"{why}")
            self._lost = None

    def _inside(self, at: int, end: int) -> int | None:
        """Where packets begin inside of one whose length must be damaged."""
        there = len(self._rest)
        known = self._known.get(bytes(self._rest[at:at + 2]))
        if end == there or known and known[1] == end - at or not known and self._lead(at, at, 2):
            return None
        if end > there:
            if there - at < self._check:
                return None
            self._check = (there - at) * 9 // 8 + 64     # seldom, as it is long
        stop = min(end, there) - 6
        begins = (found.start() for found in self._heads.finditer(self._rest, at + 1, stop + 1)) if self._heads else \
            range(at + 1, stop)
        least = 1 if self._known and end + 6 <= there and not self._continues(bytes(self._rest[end:end + 6]), {}) else 2
        return next((begin for begin in begins if self._lead(begin, end, least)), None)

    def _continues(self, header: bytes, counts: dict[bytes, int]) -> bool | None:
        """Whether a packet may begin there that continues its application, by its last count in `counts` or before;
        None: the application is new."""
        before = counts.get(header[:2], self._known[header[:2]][0] if header[:2] in self._known else None)
        if not self._accepts(header) or not any(header[:4]):    # zeros are rather data
            return False
        return None if before is None else 0 < (sequence_of(header) - before) % 0x4000 <= NEAR

    def _lead(self, at: int, end: int, least: int) -> bool:
        """Whether lengths lead from packets there beyond an end, or to the end of what has come, and at least so many
        of them continue others. Where they lead to that end, the packet holds them."""
        counts: dict[bytes, int] = {}
        behind = 0
        while len(self._rest) - at >= PACKET_LEAST:
            header = bytes(self._rest[at:at + 6])
            continues = self._continues(header, counts)
            if continues is False:
                return behind >= least and at > end
            behind += continues is True
            counts[header[:2]] = sequence_of(header)
            at += _size(header)
            if at == end:
                return False
        return behind >= least and (at > end or end > len(self._rest))


def _size(header: bytes) -> int:
    return int.from_bytes(header[4:6], "big") + PACKET_LEAST


class Raw:
    """In place of a Splitter: the bytes of a stream as they come."""

    skipped = 0

    def __init__(self) -> None:
        self.damages: list[str] = []

    def feed(self, data: bytes) -> list[bytes]:
        return [data]


class _ByTheClock(Link):
    """A link in real time, by sockets or devices that poll() knows. raw: what arrives is not cut into packets."""

    def __init__(self, raw: bool = False) -> None:
        self.raw = raw
        self._opened = monotonic_ns()
        self._arrived: deque[Timed] = deque()
        self._damages: list[str] = []

    @property
    def t(self) -> int:
        return monotonic_ns() - self._opened

    @property
    def origin(self) -> int:
        return time_ns() // 10**6 % 2**32

    def receive(self, until: int) -> list[Timed]:
        while not self._arrived:
            rest = until - self.t
            self._work(min(max(rest, 0), SLICE) / 1e9)
            if rest <= 0:
                break
        packets = list(self._arrived)
        self._arrived.clear()
        return packets

    def damages(self) -> list[str]:
        damages, self._damages = self._damages, []
        return damages

    @abstractmethod
    def _work(self, wait: float) -> None:
        """Receive and send what is possible; wait at most so long [s]."""


class Udp(_ByTheClock):
    """Datagrams: to an address, from any sender."""

    def __init__(self, to: tuple[str, int], listen: tuple[str, int], raw: bool = False) -> None:
        super().__init__(raw)
        self._to = to
        self._socket = _socket(socket.SOCK_DGRAM, *listen)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, WAITING)
        self._socket.setblocking(False)

    def send(self, packet: bytes) -> None:
        try:
            self._socket.sendto(packet, self._to)
        except (BlockingIOError, ConnectionRefusedError):   # no program listens there now; a datagram may be lost
            self.dropped += 1

    def close(self) -> None:
        self._socket.close()

    def _work(self, wait: float) -> None:
        if _ready([self._socket], [], wait):
            try:
                for _ in range(AT_ONCE):
                    data = self._socket.recv(PACKET_MOST)
                    whole, rest = ([data], b"") if self.raw else split(data)
                    self._arrived.extend(Timed(self.t, packet) for packet in whole)
                    if rest:
                        self.skipped += len(rest)
                        self._damages.append(f"{len(rest)} bytes at the end of a datagram of {len(data)} are no whole "
                                             "packet")
            except (BlockingIOError, ConnectionRefusedError):   # no more; an earlier datagram found no receiver
                pass


class _Stream:
    """One connection or device: packets out of its bytes, and bytes that wait until it takes them."""

    def __init__(self, end: Any, read: Callable[[int], bytes], write: Callable[[bytes], int],
                 splitter: Splitter | Raw) -> None:
        self.end, self._read, self._write = end, read, write
        self.splitter = splitter
        self._lock = Lock()
        self._waiting = bytearray()
        self.broken = False     # the thread that receives takes it away

    @property
    def waits(self) -> bool:
        return bool(self._waiting)

    def put(self, packet: bytes) -> bool:
        """Send a packet now or later; False: too much waits already, and the packet is dropped whole."""
        with self._lock:
            if len(self._waiting) + len(packet) > OUTBOX:
                return False
            self._waiting += packet
        self.flush()
        return True

    def flush(self) -> None:
        """Send what the other end takes now."""
        with self._lock:
            try:
                while self._waiting and (n := self._write(bytes(self._waiting[:CHUNK]))):
                    del self._waiting[:n]
            except (BlockingIOError, InterruptedError):
                return
            except OSError:
                self.broken = True

    def take(self) -> list[bytes] | None:
        """The packets that have come; None: the other end is gone."""
        try:
            data = self._read(CHUNK)
        except (BlockingIOError, InterruptedError):
            return []
        except OSError:
            return None
        return self.splitter.feed(data) if data else None


class Streams(_ByTheClock):
    """Streams of bytes: one connection or device, or those of all clients of a server."""

    def __init__(self, accepts: Callable[[bytes], bool] | None = None, raw: bool = False) -> None:
        super().__init__(raw)
        self._accepts = accepts
        self._server: socket.socket | None = None
        self._streams: list[_Stream] = []
        self._gone = 0      # bytes that closed streams have skipped
        self.refused = 0    #: clients of a server beyond CLIENTS

    @classmethod
    def connect(cls, to: tuple[str, int], accepts: Callable[[bytes], bool] | None = None, raw: bool = False
                ) -> Streams:
        """A client of a server."""
        link = cls(accepts, raw)
        link._join(socket.create_connection(to, timeout=10))
        return link

    @classmethod
    def listen(cls, at: tuple[str, int], accepts: Callable[[bytes], bool] | None = None, raw: bool = False) -> Streams:
        """A server; all of its clients get each packet."""
        link = cls(accepts, raw)
        link._server = server = _socket(socket.SOCK_STREAM, *at)
        server.listen()
        server.setblocking(False)
        return link

    @classmethod
    def device(cls, path: str, baud: int, accepts: Callable[[bytes], bool] | None = None, raw: bool = False
               ) -> Streams:
        """A serial device, 8 bits without parity."""
        try:
            import serial
        except ImportError:
            raise SetupError("a serial device needs Debian's python3-serial") from None
        try:
            end = serial.Serial(path, baud, timeout=0, write_timeout=0)
        except (serial.SerialException, ValueError) as error:
            raise SetupError(f"serial:{path}: {error}") from None
        link = cls(accepts, raw)

        def write(data: bytes) -> int:
            try:
                return int(end.write(data) or 0)
            except serial.SerialTimeoutException:
                raise BlockingIOError from None

        def read(n: int) -> bytes:
            try:
                return bytes(end.read(n))
            except serial.SerialException:  # the device was taken away
                return b""

        link._streams.append(_Stream(end, read, write, link._splitter()))
        return link

    @property
    def clients(self) -> int:
        return len(self._streams)

    def send(self, packet: bytes) -> None:
        for stream in list(self._streams):
            self.dropped += not stream.put(packet)
            if stream.broken and not self._server:
                raise ConnectionError(GONE)

    def close(self) -> None:
        for stream in list(self._streams):
            self._leave(stream, expected=True)
        if self._server:
            self._server.close()

    def _join(self, end: socket.socket) -> None:
        end.setblocking(False)
        end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._streams.append(_Stream(end, end.recv, end.send, self._splitter()))

    def _accept(self, server: socket.socket) -> None:
        try:
            end = server.accept()[0]
        except OSError:     # it has gone already, or there are no descriptors
            return
        if len(self._streams) >= CLIENTS:
            self.refused += 1
            end.close()
            return
        end.setsockopt(socket.IPPROTO_TCP, USER_TIMEOUT, 1000 * UNREAD)
        self._join(end)

    def _splitter(self) -> Splitter | Raw:
        return Raw() if self.raw else Splitter(self._accepts)

    def _leave(self, stream: _Stream, expected: bool = False) -> None:
        if stream in self._streams:
            self._streams.remove(stream)
            self._gone += stream.splitter.skipped
            stream.end.close()
        if not self._server and not expected:
            raise ConnectionError(GONE)

    def _work(self, wait: float) -> None:
        for stream in [stream for stream in self._streams if stream.broken]:
            self._leave(stream)
        streams = {stream.end: stream for stream in self._streams}
        server = [self._server] if self._server else []
        ready = _ready([*server, *streams], [end for end, stream in streams.items() if stream.waits], wait)
        for end, events in ready:
            if end is self._server:
                self._accept(self._server)
                continue
            if events & select.POLLOUT:
                streams[end].flush()
            if events & ~select.POLLOUT:
                packets = streams[end].take()
                if packets is None:
                    self._leave(streams[end])
                else:
                    self._arrived.extend(Timed(self.t, packet) for packet in packets)
                    damages, streams[end].splitter.damages = streams[end].splitter.damages, []
                    self._damages += damages
        self.skipped = self._gone + sum(stream.splitter.skipped for stream in self._streams)


def split(data: bytes) -> tuple[list[bytes], bytes]:
    """(the whole packets that follow one another, the rest that is none)."""
    packets = []
    while len(data) >= PACKET_LEAST:
        n = int.from_bytes(data[4:6], "big") + PACKET_LEAST
        if n > len(data):
            break
        packets.append(data[:n])
        data = data[n:]
    return packets, data


def _ready(reads: list[Any], writes: list[Any], wait: float) -> list[tuple[Any, int]]:
    """(end, events of poll()) of those that are ready within a time [s]. select() knows no descriptor above 1023."""
    poll = select.poll()
    ends = {read.fileno(): read for read in reads}
    for number in ends:
        poll.register(number, select.POLLIN)
    for write in writes:
        poll.register(write, select.POLLIN | select.POLLOUT)
    return [(ends[number], events) for number, events in poll.poll(max(0, 1000 * wait))]


def _socket(kind: socket.SocketKind, host: str, port: int) -> socket.socket:
    """A socket that is bound to an address."""
    family, *_, where = socket.getaddrinfo(host, port, type=kind)[0]
    bound = socket.socket(family, kind)
    if kind == socket.SOCK_STREAM:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind(where)
    except OSError:
        bound.close()
        raise
    return bound
