# SPDX-License-Identifier: Apache-2.0
"""Checks each request: its origin, its user, its size; and writes it into the operators' log.

    access = Access.read(table, folder)         # of the server's file; refuses a network address without TLS
    guard = Guard(access, log, check=check)     # log(user, action, details) is the operators' log; check(request)
                                                # raises the answer if the user may not make it
    app = web.Application(middlewares=[guard.middleware])
    guard.attach(app)                           # GET /api/session, POST /api/login, POST /api/logout
    runner = await guard.listen(app)

Pages of other origins are refused, also where there are no users: a changing request carries the header X-Fledge-CSRF
with the word of GET /api/session, or a token.
"""
from __future__ import annotations

import asyncio
import hmac
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from time import monotonic
from typing import Any
from urllib.parse import unquote_to_bytes, urlsplit

from aiohttp import web

from fledge.errors import SetupError
from fledge.ground.server.access import NAMES, Access, User
from fledge.ground.server.answers import Refusal
from fledge.ground.server.bounds import Bounds
from fledge.ground.server.connections import ACCEPTED, Connections, logger
from fledge.ground.server.logins import Logins, cookie
from fledge.ground.server.request_log import Log, RequestLog
from fledge.ground.server.routes import ANYONE, add_routes, loads, row_of
from fledge.ground.server.sessions import Session, Sessions
from fledge.loopback import is_loopback

LOGGED = 2000                       # [bytes] of a body that the log gets whole; the most without a login
HEADERS_MOST = 128                  # of a request
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
                               "media-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'self'; "
                               "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY", "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Resource-Policy": "same-origin", "Server": "fledge"}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Guard:
    """clock: [s] of sessions' idleness and of failed attempts."""

    def __init__(self, access: Access, log: Log, clock: Callable[[], float] = monotonic,
                 check: Callable[[web.Request], None] = lambda request: None, bounds: Bounds | None = None) -> None:
        self.check, self.bounds = check, bounds or Bounds()
        self.log = RequestLog(log, self.bounds, clock)
        self.sessions = Sessions(access, self.log, clock)
        self.logins = Logins(self.sessions, self.log, clock)
        self.connections = Connections(self.bounds, self.log)
        self.bodies = 0                                 #: [bytes] of those that are held
        self._gate = asyncio.Semaphore(ACCEPTED)
        self.bounds.uses("bodies at once", lambda: self.bodies)

    @property
    def access(self) -> Access:
        """The access settings in force."""
        return self.sessions.access

    def attach(self, app: web.Application) -> None:
        """Add the routes and headers to the application that has the middleware."""
        add_routes(app, self.logins)
        app.on_response_prepare.append(self._secured)
        app.on_cleanup.append(self._stop)

    async def listen(self, app: web.Application) -> web.AppRunner:
        """As Connections.listen()."""
        return await self.connections.listen(app, self.access)

    def allowed(self, request: web.Request, craft: str | None, role: str) -> bool:
        """Whether the user of a request has a role for a craft; for None, for any."""
        user: User | None = request.get("user")
        return user is not None and user.may(craft, role)

    def require(self, request: web.Request, craft: str | None, role: str) -> None:
        """Raises the answer 403, which the log gets, unless the user has the role."""
        if not self.allowed(request, craft, role):
            raise Refusal(403, f"{request['user'].name} lacks the role '{role}'" + (f" for {craft}" if craft else ""))

    def take(self, access: Access) -> bool:
        """Apply users, tokens, times and certificate of the changed file, and end the sessions of users that differ;
        returns whether other keys have changed, which count from the next start. Raises SetupError."""
        old, same = self.access, access
        if not is_loopback(old.host) and not access.closed:
            raise SetupError(f"the server is open to a network, at {old.host}, and needs [[user]] or [[token]]")
        if not self.connections.take(access):
            same = replace(access, certificate=old.certificate, key=old.key)
        self.sessions.take(replace(same, host=old.host, port=old.port, plain=old.plain))
        return self.access != access

    @web.middleware
    async def middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """The application calls it for each request."""
        if times := self.connections.times(request):
            times.requested = monotonic()
        request["user"], request["bytes"] = None, 0
        async with self._gate:      # of many requests at once, a few in each turn of the loop
            await asyncio.sleep(0)
        try:
            return await self._admitted(request, handler)
        except web.HTTPException as error:
            if error.status < 400:
                raise
            why = error.why if isinstance(error, Refusal) else error.text or error.reason
            if error.status in (401, 403, 413, 429) or request["user"] and _changes(request):
                await self.log.refused(request, error.status, why)
            if isinstance(error, Refusal):
                raise
            headers = {name: error.headers[name] for name in ("Allow", "Retry-After") if name in error.headers}
            raise Refusal(error.status, why, headers) from None
        except ConnectionError:     # it has gone meanwhile
            raise
        except Exception:
            logger().exception("%s %s", request.method, request.path)
            await self.log.refused(request, 500, "the server made an error")
            raise Refusal(500, "the server made an error, which its terminal shows") from None
        finally:
            self.bodies -= request["bytes"]

    async def _admitted(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if len(request.headers) > HEADERS_MOST:     # newer versions of aiohttp refuse them earlier
            raise Refusal(400, f"a request has at most {HEADERS_MOST} headers")
        if request._message.url.is_absolute():      # its scheme and host would replace those of the connection
            raise Refusal(400, "a request names a path, without a scheme and a host before it")
        if request.headers.get("Content-Encoding", "identity") != "identity":
            raise Refusal(415, "the body of a request comes as it is, without a Content-Encoding")
        try:
            unquote_to_bytes(request.raw_path).decode()
        except UnicodeError:
            raise Refusal(400, "the path and query of a request are text in UTF-8") from None
        host = _host(request)
        if is_loopback(self.access.host) and host not in (*NAMES, self.access.host):
            raise Refusal(403, f"this server is {NAMES[0]}; the request is for {host!r}")
        origin = request.headers.get("Origin")
        if origin is not None and origin != f"{request.scheme}://{request.host}":
            raise Refusal(403, f"a page of {origin} may not do this here")
        if request.headers.get("Sec-Fetch-Site") in ("cross-site", "same-site") and request.path.startswith("/api/"):
            raise Refusal(403, "a page of another site may not ask this")
        active, by_token = self._session(request)
        user, session = active.user if active else None, None if by_token else active
        request["user"], request["session"], request["live"] = user, session, active.live if active else None
        row = row_of(request)
        if times := self.connections.times(request):
            times.known = user is not None
        if user is None and (row.role != ANYONE if row else request.path.startswith("/api/")):
            raise Refusal(401, "log in first: POST /api/login, or a token")
        if _changes(request) and session and request.path != "/api/login" and not hmac.compare_digest(
                request.headers.get("X-Fledge-CSRF", "").encode(errors="replace"), session.csrf.encode()):
            raise Refusal(403, "the header X-Fledge-CSRF is missing or old: a request that changes something has it, "
                          "with the word csrf of GET /api/session; or Authorization: Bearer TOKEN")
        self.check(request)
        if _changes(request) and not request.match_info.http_exception:     # the route exists
            await self._read(request, row.logged if row else True, row.body if row else "body")
            if user and not (row and row.role == ANYONE) and self._session(request)[0] is not active:  # it ended
                raise Refusal(401, "the session has ended meanwhile: log in again")
        task = asyncio.current_task()
        try:
            return await handler(request)
        finally:
            if active and task in active.live:
                active.live.discard(task)
                active.used = self.sessions.clock()

    def _session(self, request: web.Request) -> tuple[Session | None, bool]:
        """The session of a cookie, or of a token and True."""
        given = request.headers.get("Authorization")
        if given is None:
            return self.sessions.of_cookie(request.cookies.get(cookie(request), "")), False
        if not request.secure and not is_loopback(request.remote or ""):
            raise Refusal(403, "a token does not come over plain HTTP from another machine, where others may have "
                          "read it: make a new one, and use https")
        kind, _, word = given.partition(" ")
        session = self.sessions.of_token(word.strip()) if kind.lower() == "bearer" else None
        if session is None:
            raise Refusal(401, "the token is none of this server")
        return session, True

    async def _read(self, request: web.Request, logged: bool, bound: str) -> None:
        """Read the body of a changing request, and write the request into the log."""
        stranger = request["user"] is None
        if stranger and ((request.content_length or 0) > LOGGED or "Transfer-Encoding" in request.headers):
            raise Refusal(413, f"a login has at most {LOGGED} bytes, and says how many")
        most = int(self.bounds[bound])
        size = most if request.content_length is None else request.content_length
        if self.bounds.over(bound, size):
            raise Refusal(413, self.bounds.says(bound))
        if self.bounds.over("bodies at once", self.bodies + size):
            raise Refusal(429, self.bounds.says("bodies at once"), {"Retry-After": "5"})
        request["bytes"] = size
        self.bodies += size
        request._client_max_size = most + 1     # aiohttp's, which is of the whole application
        try:
            body = await asyncio.wait_for(request.read(), self.bounds["time of a body"])
        except web.HTTPRequestEntityTooLarge:
            raise Refusal(413, self.bounds.refuses(bound)) from None
        except asyncio.TimeoutError:
            raise Refusal(408, self.bounds.refuses("time of a body")) from None
        if stranger or not logged:
            return
        if not self.log.allows(request["user"].name, "changes of a user"):
            raise Refusal(429, self.bounds.says("changes of a user"), {"Retry-After": "60"})
        details: dict[str, Any] = {"bytes": len(body)}
        if len(body) <= LOGGED:
            with suppress(ValueError):
                details = {"body": loads(body)} if body else {}
        if request.query_string:
            details["query"] = dict(request.query) if len(request.query_string) <= LOGGED else "..."
        await self.log.write(request["user"].name, f"{request.method} {request.path}", details)

    async def _secured(self, request: web.Request, response: web.StreamResponse) -> None:
        if isinstance(response, web.WebSocketResponse) and (task := asyncio.current_task()):
            if times := self.connections.times(request):
                times.live = True
            request["live"].add(task)       # so that it ends with its session, whatever headers opened it
        response.headers.update(HEADERS)
        if request.secure:
            response.headers["Strict-Transport-Security"] = "max-age=31536000"
        if request.path.startswith("/api/"):
            response.headers.setdefault("Cache-Control", "no-store")

    async def _stop(self, _: web.Application) -> None:
        self.logins.close()
        self.log.close()
        self.connections.close()
        self.sessions.close()


def _host(request: web.Request) -> str:
    try:
        return urlsplit(f"//{request.host}").hostname or ""
    except ValueError:
        return request.host


def _changes(request: web.Request) -> bool:
    return request.method not in ("GET", "HEAD", "OPTIONS")
