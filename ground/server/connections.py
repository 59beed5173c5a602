# SPDX-License-Identifier: Apache-2.0
"""The connections of a server: where it listens, how many there are of each address, and how long each may last."""
from __future__ import annotations

import asyncio
import logging
import socket
import ssl
from collections import Counter
from time import monotonic, thread_time
from typing import Any
from weakref import WeakKeyDictionary

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from fledge.errors import SetupError
from fledge.ground.server.access import Access
from fledge.ground.server.bounds import Bounds, bound_socket
from fledge.ground.server.request_log import RequestLog, network_of

ACCEPTED, WAITING = 8, 1024         # connections, requests that are taken in a turn of the loop; connections that wait


class Times:
    """The times [s] of a connection after its handshake."""

    def __init__(self, opened: float) -> None:
        self.opened, self.requested = opened, 0.0   # requested: when its last request came
        self.known = self.live = False              # a user has used it; it is a WebSocket

    def over(self, bounds: Bounds) -> str:
        """The limit by which it has to end."""
        now = monotonic()
        for bound, since in (("first request", self.opened if not self.requested else now),
                             ("connection without a login", self.opened if not self.known else now),
                             ("time of an answer", self.requested if self.requested and not self.live else now)):
            if bounds.over(bound, now - since):
                return bound
        return ""


class Connections:
    """The open connections. log: gets those that are refused."""

    def __init__(self, bounds: Bounds, log: RequestLog) -> None:
        self.bounds, self._log = bounds, log
        self.addresses: list[tuple[Any, ...]] = []      #: where the server listens
        self.handshakes: set[asyncio.Transport] = set()     #: connections in their handshake of TLS
        self._times: WeakKeyDictionary[asyncio.BaseTransport, Times] = WeakKeyDictionary()
        self._tls: ssl.SSLContext | None = None
        self._counts: Counter[str] = Counter()          # connections of each address
        self._counted = 0.0                             # when they may be counted again
        self._runner: web.AppRunner | None = None
        self._sweeper: asyncio.Task[None] | None = None
        bounds.uses("connections", lambda: len(self.all()))
        bounds.uses("connections of an address", lambda: max(Counter(map(_peer, self.all())).values(), default=0))

    async def listen(self, app: web.Application, access: Access) -> web.AppRunner:
        """Serve an application at the address of the file, which `addresses` then has. Raises SetupError."""
        listener: list[asyncio.AbstractServer] = []

        async def close(_: web.Application) -> None:
            for server in listener:
                server.close()
            for transport in self.handshakes:
                transport.abort()

        app.on_shutdown.append(close)
        # No decompression: a client could expand some hundred bytes to gigabytes, in the event loop.
        runner = web.AppRunner(app, logger=logger(), access_log=None, keepalive_timeout=30, auto_decompress=False)
        await runner.setup()
        self._runner = runner
        self._tls = access.tls()
        try:
            server = await asyncio.get_running_loop().create_server(
                lambda: _Entrance(self, runner, self._tls), access.host, access.port, backlog=ACCEPTED)
        except OSError as error:
            await runner.cleanup()
            raise SetupError(f"{access.host}, port {access.port}: {error.strerror or error}") from None
        listener.append(server)
        for listening in server.sockets:    # asyncio accepts as many at once as its backlog has; more may wait
            with socket.fromfd(listening.fileno(), listening.family, listening.type) as same:
                same.listen(WAITING)
        self._sweeper = asyncio.create_task(self._sweep())
        self.addresses = [listening.getsockname() for listening in server.sockets]
        return runner

    def take(self, access: Access) -> bool:
        """Go on with a certificate that has changed; returns whether the server has one. Raises what
        load_cert_chain() does."""
        if not self._tls or not access.certificate:
            return False
        self._tls.load_cert_chain(access.certificate, access.key, password=lambda: "")
        return True

    def admitted(self, transport: asyncio.Transport, opened: float) -> None:
        """A connection has ended its handshake. opened: [s] when it began."""
        self._times[transport] = Times(opened)

    def times(self, request: web.Request) -> Times | None:
        """The times of a request's connection; None: it is closed, or of another server."""
        return self._times.get(request.transport) if request.transport else None

    def all(self) -> list[asyncio.Transport]:
        """The connections, with those in their handshake."""
        server = self._runner.server if self._runner else None
        return [*self.handshakes, *[connection.transport
                                    for connection in server.connections if connection.transport]] if server else []

    def full(self, address: str) -> bool:
        """Whether a further connection would exceed a limit; otherwise it is counted."""
        for last in (False, True):
            n, each = self._counts.total(), self._counts[address]
            if n < self.bounds["connections"] and each < self.bounds["connections of an address"] or last:
                break
            self._recount()     # some may have gone
        if not (self.bounds.over("connections", n + 1) or self.bounds.over("connections of an address", each + 1)):
            self._counts[address] += 1
            return False
        if times := self._log.times(address, "connections"):
            self._log.later("", "refused", {"why": f"{n} connections", "from": address, "times": times})
        return True

    def close(self) -> None:
        if self._sweeper:
            self._sweeper.cancel()

    def _recount(self) -> None:
        """Count the connections of each address anew, for at most a fifth of the processor time of this thread."""
        if (began := monotonic()) >= self._counted:
            used = thread_time()
            self._counts = Counter(map(_peer, self.all()))
            self._counted = began + 5 * (thread_time() - used)

    async def _sweep(self) -> None:
        """Close the connections that have exceeded a limit of time."""
        before = monotonic()
        while True:
            await asyncio.sleep(min(0.25, self.bounds["first request"] / 2))
            self._recount()
            slept, before = monotonic() - before, monotonic()
            if slept > 1:       # the server was late itself, and their requests may wait
                continue
            server = self._runner.server if self._runner else None
            for connection in server.connections if server else []:
                if connection.transport and (times := self._times.get(connection.transport)):
                    waits = len(connection._messages)      # of aiohttp, which would keep any number of requests
                    bound = "requests at once" if self.bounds.over("requests at once", waits) else times.over(
                        self.bounds)
                    if bound:
                        connection.transport.abort()


class _Entrance(asyncio.Protocol):
    """A connection until it is admitted and its handshake of TLS has ended; then aiohttp has it."""

    def __init__(self, connections: Connections, runner: web.AppRunner, tls: ssl.SSLContext | None) -> None:
        self._connections, self._runner, self._tls = connections, runner, tls
        self._opening: asyncio.Task[None] | None = None
        self._early, self._lost = b"", False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        if self._runner.server is None or self._connections.full(_peer(transport)):     # None: it ends
            transport.abort()
        elif self._tls:
            self._connections.handshakes.add(transport)
            self._opening = asyncio.get_running_loop().create_task(self._handshake(transport, self._tls))
        else:
            self._enter(transport, monotonic())

    async def _handshake(self, transport: asyncio.Transport, tls: ssl.SSLContext) -> None:
        loop, connections, opened = asyncio.get_running_loop(), self._connections, monotonic()
        try:
            secured = await loop.start_tls(transport, self, tls, server_side=True,
                                           ssl_handshake_timeout=connections.bounds["first request"])
        except (OSError, asyncio.CancelledError):
            transport.abort()
            return
        finally:
            connections.handshakes.discard(transport)
        assert isinstance(secured, asyncio.Transport)
        self._enter(secured, opened)

    def data_received(self, data: bytes) -> None:       # with the end of the handshake
        self._early += data

    def connection_lost(self, _: Exception | None) -> None:
        self._lost = True

    def _enter(self, transport: asyncio.Transport, opened: float) -> None:
        if self._runner.server is None or self._lost:
            transport.abort()
            return
        bound_socket(transport, self._connections.bounds["unread"])
        self._connections.admitted(transport, opened)
        inside = self._runner.server()
        transport.set_protocol(inside)
        inside.connection_made(transport)
        if self._early:
            inside.data_received(self._early)


def _peer(transport: asyncio.BaseTransport) -> str:
    peer = transport.get_extra_info("peername")
    return network_of(peer[0] if peer else None)


def logger() -> logging.Logger:
    """The logger for aiohttp, without traces of malformed requests, which are answered with 400."""
    log = logging.getLogger("fledge.ground.server")
    if not log.filters:
        # The assertion: aiohttp goes on with the requests of a closed connection.
        log.addFilter(lambda record: not (record.exc_info and (
            isinstance(record.exc_info[1], HttpProcessingError) or
            isinstance(record.exc_info[1], AssertionError) and record.msg == "Unhandled exception")))
    return log
