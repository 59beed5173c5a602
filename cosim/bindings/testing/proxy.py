# SPDX-License-Identifier: Apache-2.0
"""A bad network between a controller and its nodes, without keys: a relay of TCP that delays, splits, joins, cuts and
stalls what it carries. The same seed gives the same delays and pieces."""
import random
import socket
import struct
import threading
import time

from fledge_node import _Reader, _Writer

GREETING = 64  # bytes before ZMTP's first frame


class Proxy:
    """address: where nodes greet, in place of the controller's address `to`.

    delay, jitter: [s] of each piece, the second one random; piece: the most bytes of a piece
    cut_after, stall_after: so many bytes of a node's own connection pass; then it is broken off, or silent
    """

    def __init__(self, to, seed=0, delay=0.0, jitter=0.0, piece=65536, cut_after=None, stall_after=None):
        self._seed, self._delay, self._jitter, self._piece = seed, delay, jitter, piece
        self._cut_after, self._stall_after = cut_after, stall_after
        self._sockets, self._passed, self._closed = [], 0, threading.Event()
        self._lock = threading.Lock()
        self.address = self._listen(to, greets=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._closed.set()
        with self._lock:
            for each in self._sockets:
                _break_off(each)

    def _listen(self, to, greets):
        listener = self._keep(socket.create_server(("127.0.0.1", 0)))
        threading.Thread(target=self._accept, args=(listener, to, greets), daemon=True).start()
        return f"tcp://127.0.0.1:{listener.getsockname()[1]}"

    def _keep(self, connection):
        with self._lock:
            self._sockets.append(connection)
        return connection

    def _accept(self, listener, to, greets):
        host, _, port = to.removeprefix("tcp://").rpartition(":")
        try:
            while True:
                near = self._keep(listener.accept()[0])
                far = self._keep(socket.create_connection((host, int(port))))
                for each in (near, far):
                    each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                number = len(self._sockets)
                for way in ((near, far, f"{number} there", None),
                            (far, near, f"{number} back", _Welcomes(self) if greets else None)):
                    threading.Thread(target=self._carry, args=(*way, not greets), daemon=True).start()
        except OSError:
            pass  # the proxy is closed

    def _carry(self, source, sink, name, welcomes, own):
        chance = random.Random(f"{self._seed} {name}")
        try:
            while data := source.recv(65536):
                data = welcomes.changed(data) if welcomes else data
                while data:
                    n = chance.randint(1, self._piece)
                    time.sleep(self._delay + chance.random() * self._jitter)
                    if own and self._stopped(min(n, len(data)), (source, sink)):
                        return
                    sink.sendall(data[:n])
                    data = data[n:]
        except OSError:
            pass
        _break_off(sink)

    def _stopped(self, n, ends):
        """Whether a node's own connection carries no more."""
        with self._lock:
            self._passed += n
            passed = self._passed
        if self._cut_after is not None and passed > self._cut_after:
            for end in ends:
                _break_off(end)
            return True
        if self._stall_after is not None and passed > self._stall_after:
            self._closed.wait()
            return True
        return False


class _Welcomes:
    """The bytes from the controller's address for greetings. A Welcome gets the address of the proxy."""

    def __init__(self, proxy):
        self._proxy, self._bytes, self._left = proxy, b"", GREETING

    def changed(self, data):
        out, data = data[:self._left], data[self._left:]  # both sides exchange the greeting in parts
        self._left -= len(out)
        self._bytes += data
        while len(self._bytes) >= (size := self._next()):
            part, self._bytes = self._bytes[:size], self._bytes[size:]
            out += self._redirected(part)
        return out

    def _next(self):
        """The size of the next frame of ZMTP."""
        long = self._bytes[:1] and self._bytes[0] & 2
        if len(self._bytes) < (9 if long else 2):
            return 9
        return 9 + struct.unpack(">Q", self._bytes[1:9])[0] if long else 2 + self._bytes[1]

    def _redirected(self, part):
        body = part[9 if part[0] & 2 else 2:]
        if part[0] & 4 or body[:4] != b"FLCS" or (r := _Reader(body)).kind != "Welcome":
            return part
        w = _Writer()
        w.text(self._proxy._listen(r.name("address"), greets=False))
        w.text(r.name("shared"))
        w.number("Q", r.number("Q"))
        frame = w.frame("Welcome", r.request)
        return bytes([part[0] & ~2, len(frame)]) + frame


def _break_off(end):
    """Close it at once; both sides see a reset."""
    try:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        end.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass
    end.close()
