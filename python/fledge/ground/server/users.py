# SPDX-License-Identifier: Apache-2.0
"""Users with roles, sessions that end, tokens of scripts, and limits on what clients without a login use.

    access = Access.read(table, folder)         # of the server's file; refuses a network address without TLS
    guard = Guard(access, log, check=check)     # log(user, action, details) is the operators' log; check(request)
                                                # raises the answer to who may not ask this
    app = web.Application(middlewares=[guard.middleware])
    guard.attach(app)                           # GET /api/session, POST /api/login, POST /api/logout
    runner = await guard.listen(app)

    host = "0.0.0.0"                # without it, this machine alone
    certificate = "server.pem"      # PEM, with its chain; and its key, which only its owner may read
    key = "server.key"              # instead of both: plain_http = "everybody on this network may read what passes"
    session_h = 12                  # after which a user logs in again; idle_min = 30 without a request or a live page
    [[user]]
    name = "ada"
    password = "scrypt:..."         # `fledge ground password` prints the line
    roles = ["view", "command"]     # of view, command, administer
    crafts = ["imager"]             # the roles hold for these alone; without it, for all
    [[token]]                       # `fledge ground token NAME` prints both; a script sends "Authorization: Bearer ..."
    name = "night pass"
    hash = "sha256:..."
    roles = ["view"]

Without users and tokens everybody on this machine is "operator" with all roles. Pages of other origins are refused in
either case: a changing request carries the header X-Fledge-CSRF with the word of GET /api/session, or a token.
"""
from __future__ import annotations

import asyncio
import hashlib
import hmac
import logging
import os
import secrets
import socket
import ssl
from base64 import urlsafe_b64decode, urlsafe_b64encode
from binascii import Error as NotBase64
from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from ipaddress import ip_address, ip_network
from json import dumps
from pathlib import Path
from time import monotonic
from typing import Any
from urllib.parse import unquote_to_bytes, urlsplit
from weakref import WeakKeyDictionary

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from fledge import __version__
from fledge.ground.server.bounds import Bounds, Recent, bound_socket
from fledge.ground.server.routes import ANYONE, USER, add_routes, loads, route, row_of
from fledge.errors import SetupError, did_you_mean, listed
from fledge.ground.scripts.address import is_loopback

ROLES = ("view", "command", "administer")
KEYS = {"host", "port", "certificate", "key", "plain_http", "session_h", "idle_min", "user", "token"}  # of its file
PLAIN = "everybody on this network may read what passes"
PORT = 8080
NAMES = ("localhost", "127.0.0.1", "::1")
COST = (1 << 15, 8, 3)              # n, r, p of scrypt: 32 MiB, about 0.3 s
PASSWORD_LEAST, PASSWORD_MOST = 10, 1024            # characters
ATTEMPTS, ATTEMPTS_S = 10, 600      # failed logins of one address, or of a browser that was a user before, within [s]
NAMED = 30                          # those of one name, of all addresses and browsers that were never that user
KNOWN_S = 400 * 86400               # how long a browser says that it was a user; the most that browsers keep
QUEUE = 8                           # logins that wait for their password to be checked
SESSIONS = 16                       # of one user; the oldest ends
LOGGED = 2000                       # bytes of a body whose content the log gets, and of a stranger's
HEADERS_MOST = 128                  # of a request
ACCEPTED, WAITING = 8, 1024         # connections, requests that are taken in a turn of the loop; connections that wait
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
                               "media-src 'self' blob:; object-src 'none'; base-uri 'none'; form-action 'self'; "
                               "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff", "X-Frame-Options": "DENY", "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Resource-Policy": "same-origin", "Server": "fledge"}

Log = Callable[[str, str, dict[str, Any]], None]
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


# --- secrets ---------------------------------------------------------------------------------------

def hashed(password: str, cost: tuple[int, int, int] = COST) -> str:
    """The text by which the server's file knows a password (RFC 7914)."""
    salt = secrets.token_bytes(16)
    return ":".join(["scrypt", *map(str, cost), _text(salt), _text(_scrypt(password, salt, *cost))])


def token() -> tuple[str, str]:
    """(a new token, its hash in the server's file)."""
    made = f"fledge_{secrets.token_urlsafe(32)}"
    return made, f"sha256:{_digest(made)}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode(errors="replace")).hexdigest()


def _text(data: bytes) -> str:
    return urlsafe_b64encode(data).decode().rstrip("=")


def _bytes(text: str) -> bytes:
    return urlsafe_b64decode(text + "=" * (-len(text) % 4))


def _scrypt(password: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(password.encode(errors="replace"), salt=salt, n=n, r=r, p=p, maxmem=256 * r * (n + p + 2))


@dataclass(frozen=True)
class _Password:
    """What an entered password is compared with."""

    cost: tuple[int, int, int]
    salt: bytes
    key: bytes

    @classmethod
    def read(cls, text: Any, where: str) -> _Password:
        try:
            kind, n, r, p, salt, key = text.split(":")
            made = cls((int(n), int(r), int(p)), _bytes(salt), _bytes(key))
            n, r, p = made.cost
            if kind == "scrypt" and n & n - 1 == 0 and 1 < n <= 1 << 20 and 0 < r * p <= 64 and len(made.key) == 64:
                return made
        except (AttributeError, ValueError, NotBase64):
            pass
        raise SetupError(f"{where}: password is no line of `fledge ground password`, which begins with \"scrypt:")

    def proof(self) -> str:
        """What a browser gets that has logged in by it: nobody has it who did not, and a new password ends it."""
        return hmac.digest(self.key, b"a browser of this user", "sha256").hex()

    def fits(self, password: str) -> bool:
        return hmac.compare_digest(_scrypt(password, self.salt, *self.cost), self.key)


# --- the server's file -----------------------------------------------------------------------------

@dataclass(frozen=True)
class User:
    """A person or a script."""

    name: str
    roles: frozenset[str]
    crafts: frozenset[str] | None = None            #: None: all
    password: _Password | None = field(default=None, repr=False)

    def may(self, craft: str | None, role: str) -> bool:
        """Whether a role holds for a craft; for None, for any."""
        return role in self.roles and (craft is None or self.knows(craft))

    def knows(self, craft: str) -> bool:
        """Whether its roles hold for a craft."""
        return self.crafts is None or craft in self.crafts


OPERATOR = User("operator", frozenset(ROLES))


@dataclass(frozen=True)
class Access:
    """Where the server listens, and to whom."""

    host: str = NAMES[1]
    port: int = PORT
    certificate: Path | None = None
    key: Path | None = None
    plain: bool = False             #: the file says in words that others may read what passes
    session_s: float = 12 * 3600.0
    idle_s: float = 30 * 60.0
    users: dict[str, User] = field(default_factory=dict)
    tokens: dict[str, User] = field(default_factory=dict)       #: by the token's hash

    @classmethod
    def read(cls, table: dict[str, Any], folder: Path) -> Access:
        """That of the server's file, whose other keys are not looked at. folder: where its paths begin.
        Raises SetupError."""
        def given(name: str, kinds: type | tuple[type, ...], default: Any, what: str) -> Any:
            found = table.get(name, default)
            if name in table and (not isinstance(found, kinds) or isinstance(found, bool)):
                raise SetupError(f"{name} is {what}; found {found!r}")
            return found

        host = given("host", str, NAMES[1], "an address of this machine, as \"127.0.0.1\"")
        port = given("port", int, PORT, "a number from 0 to 65535")
        if not 0 <= port < 1 << 16:
            raise SetupError(f"port is a number from 0 to 65535; found {port}")
        times = [given(name, (int, float), default, "a number above 0")
                 for name, default in (("session_h", 12), ("idle_min", 30))]
        for name, found in zip(("session_h", "idle_min"), times):
            if not 0 < found < 1e5:
                raise SetupError(f"{name} is a number above 0; found {found}")
        files = [given(name, str, None, "the path of a PEM file") for name in ("certificate", "key")]
        if (files[0] is None) != (files[1] is None):
            raise SetupError("certificate and key belong together; found one of them")
        plain = given("plain_http", str, None, f"\"{PLAIN}\"")
        if plain not in (None, PLAIN) or plain and files[0]:
            raise SetupError(f"plain_http is \"{PLAIN}\", and instead of certificate and key; found {plain!r}"
                             + " beside them" * bool(files[0]))
        users = {one.name: one for one in _people(given("user", list, [], "a table [[user]]"), "user")}
        tokens: dict[str, User] = {}
        for entry, one in zip(table.get("token", []), _people(given("token", list, [], "a table [[token]]"), "token")):
            kind, _, digest = str(entry.get("hash")).partition(":")
            if kind != "sha256" or len(digest) != 64 or set(digest) - set("0123456789abcdef"):
                raise SetupError(f"token {one.name}: hash is no line of `fledge ground token`, which begins with "
                                 "\"sha256:")
            tokens[digest] = one
        if not is_loopback(host) and not ((files[0] or plain) and (users or tokens)):
            lacks = [what for what, there in ((f"certificate and key, for TLS (or plain_http = \"{PLAIN}\")",
                                               files[0] or plain),
                                              ("[[user]] or [[token]]", users or tokens)) if not there]
            raise SetupError(f"host = \"{host}\" opens the server to a network, which needs {' and '.join(lacks)}; "
                             "without host it is open to this machine alone")
        certificate, key = [folder / one if one else None for one in files]
        access = cls(host, port, certificate, key, bool(plain), times[0] * 3600.0, times[1] * 60.0, users, tokens)
        access.tls()
        return access

    @property
    def closed(self) -> bool:
        """Whether the server asks for a login or a token."""
        return bool(self.users or self.tokens)

    def tls(self) -> ssl.SSLContext | None:
        """The context of TLS, if the server has a certificate. Raises SetupError."""
        if not self.certificate or not self.key:
            return None
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        try:
            context.load_cert_chain(self.certificate, self.key, password=lambda: "")
        except OSError as error:
            raise SetupError(f"certificate {self.certificate} and key {self.key} cannot be used: "
                             f"{error.strerror or error}") from None
        own(self.key, "it is a secret key; if they might have, make a new one")
        return context


def own(path: Path, why: str) -> None:
    """Refuse a file of secrets that others may read. As ssh has it, a file of another owner, as root's, may be read by
    a group. Raises SetupError."""
    found = path.stat()
    if found.st_mode & (0o77 if found.st_uid == os.geteuid() else 0o37):
        raise SetupError(f"others may read or change {path}: chmod 600 {path} keeps it its owner's, for {why}")


def _people(entries: list[Any], kind: str) -> list[User]:
    known = {"name", "roles", "crafts", "password" if kind == "user" else "hash"}
    found: list[User] = []
    for place, entry in enumerate(entries, 1):
        name = entry.get("name") if isinstance(entry, dict) else None
        if not isinstance(name, str) or not 0 < len(name) <= 100 or not name.isprintable():
            raise SetupError(f"{kind} {place}: name is a text of 1 to 100 characters; found {name!r}")
        where = f"{kind} {name}"
        for key in entry:
            if key not in known:
                raise SetupError(f"{where}: there is no '{key}'{did_you_mean(key, known)} there is "
                                 + listed(sorted(known)))
        roles, crafts = entry.get("roles"), entry.get("crafts")
        if not isinstance(roles, list) or not roles or not set(map(str, roles)) <= set(ROLES):
            raise SetupError(f"{where}: roles is a list of {listed(ROLES)}; found {roles!r}")
        if crafts is not None and (not isinstance(crafts, list) or not all(isinstance(one, str) for one in crafts)):
            raise SetupError(f"{where}: crafts is a list of names; found {crafts!r}")
        if any(one.name == name for one in found):
            raise SetupError(f"{where}: there are two of this name")
        found.append(User(name, frozenset(roles), None if crafts is None else frozenset(crafts),
                          _Password.read(entry.get("password"), where) if kind == "user" else None))
    return found


# --- requests --------------------------------------------------------------------------------------

class _Session:
    """What a browser with a cookie may do, until it ends."""

    def __init__(self, user: User, now: float) -> None:
        self.user, self.used = user, now
        self.csrf = secrets.token_urlsafe(24)
        self.live: set[asyncio.Task[Any]] = set()       # its open WebSockets
        self.end: asyncio.TimerHandle | None = None

    def cut(self) -> None:
        """Close its WebSockets."""
        for task in self.live:
            task.cancel()


class Refusal(web.HTTPException):
    """An answer with a sentence why."""

    def __init__(self, status: int, why: str, headers: dict[str, str] | None = None) -> None:
        self.status_code = status
        super().__init__(text=dumps({"error": why}), content_type="application/json", headers=headers)
        self.why = why


class Guard:
    """Checks every request. clock: [s] of sessions' idleness and of failed attempts."""

    def __init__(self, access: Access, log: Log, clock: Callable[[], float] = monotonic,
                 check: Callable[[web.Request], None] = lambda request: None, bounds: Bounds | None = None) -> None:
        self.access, self.log, self.clock, self.check = access, log, clock, check
        self.bounds = bounds or Bounds()
        self.addresses: list[tuple[Any, ...]] = []      #: where the server listens
        self._tls: ssl.SSLContext | None = None
        self.doors: set[asyncio.Transport] = set()      #: connections in their handshake of TLS
        self._sessions: dict[str, _Session] = {}        # by the hash of the cookie
        self._nobody = _Session(OPERATOR, 0.0)          # of all requests, if there are no users
        self._scripts: dict[str, _Session] = {}         # by the hash of the token
        self._failed: list[tuple[float, str, str]] = []     # when, where, and as whom a login has failed or goes on
        self._strangers: Counter[tuple[str, str]] = Counter()   # their refusals
        self._times_of: WeakKeyDictionary[Any, _Times] = WeakKeyDictionary()    # of connections
        self._rows: dict[tuple[str, str], Recent] = defaultdict(Recent)     # those that a user caused in the journal
        self._counts: Counter[str] = Counter()          # connections of each address
        self._counted = 0.0                             # when they may be counted again
        self._bodies = 0                                # [bytes] of those that are held
        self._gate = asyncio.Semaphore(ACCEPTED)
        self._runner: web.AppRunner | None = None
        self._sweeper: asyncio.Task[None] | None = None
        self.bounds.uses("connections", lambda: len(self._there()))
        self.bounds.uses("connections of an address",
                         lambda: max(Counter(map(_peer, self._there())).values(), default=0))
        self.bounds.uses("bodies at once", lambda: self._bodies)
        self._checker, self._writer, self._waiting = ThreadPoolExecutor(1), ThreadPoolExecutor(1), 0

    def attach(self, app: web.Application) -> None:
        """Add the routes and headers to an application whose middleware this is."""
        add_routes(app, self)
        app.on_response_prepare.append(self._secured)
        app.on_cleanup.append(self._stop)

    def allowed(self, request: web.Request, craft: str | None, role: str) -> bool:
        """Whether the user of a request has a role for a craft; for None, for any."""
        user: User | None = request.get("user")
        return user is not None and user.may(craft, role)

    def require(self, request: web.Request, craft: str | None, role: str) -> None:
        """Raises the answer 403, and notes it."""
        if not self.allowed(request, craft, role):
            raise Refusal(403, f"{request['user'].name} lacks the role '{role}'" + (f" for {craft}" if craft else ""))

    def take(self, access: Access) -> bool:
        """Go on with what the changed file says of users, tokens, times and the certificate, which ends the sessions of
        those who are others now; returns whether it says more, which waits for the next start. Raises SetupError."""
        old, same = self.access, access
        if not is_loopback(old.host) and not access.closed:
            raise SetupError(f"the server is open to a network, at {old.host}, and needs [[user]] or [[token]]")
        if self._tls and access.certificate:
            self._tls.load_cert_chain(access.certificate, access.key, password=lambda: "")
        else:
            same = replace(access, certificate=old.certificate, key=old.key)
        self.access = replace(same, host=old.host, port=old.port, plain=old.plain)
        for name, one in list(self._sessions.items()):
            if (now := access.users.get(one.user.name)) != one.user:
                self._end(name, "its password, roles or spacecraft were changed" if now else "the user was removed")
        for digest, one in list(self._scripts.items()):
            if (now := access.tokens.get(digest)) != one.user:
                del self._scripts[digest]
                one.cut()
                self._writer.submit(self.log, one.user.name, "token ended", {
                    "why": "its name, roles or spacecraft were changed" if now else "the token was removed"})
        if access.closed:
            self._nobody.cut()
        return self.access != access

    @web.middleware
    async def middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Of the application."""
        if times := self._times_of.get(request.transport):
            times.asked = monotonic()
        request["user"], request["bytes"] = None, 0
        async with self._gate:      # of a crowd that comes at once, a few in each turn of the loop
            await asyncio.sleep(0)
        try:
            return await self._admitted(request, handler)
        except web.HTTPException as error:
            if error.status < 400:
                raise
            why = error.why if isinstance(error, Refusal) else error.text or error.reason
            if error.status in (401, 403, 413, 429) or request["user"] and _changes(request):
                await self._aside(self._refused, request, error.status, why)
            if isinstance(error, Refusal):
                raise
            kept = {name: error.headers[name] for name in ("Allow", "Retry-After") if name in error.headers}
            raise Refusal(error.status, why, kept) from None
        except ConnectionError:     # it has gone meanwhile
            raise
        except Exception:
            _logger().exception("%s %s", request.method, request.path)
            await self._aside(self._refused, request, 500, "the server made an error")
            raise Refusal(500, "the server made an error, which its terminal shows") from None
        finally:
            self._bodies -= request["bytes"]

    async def _admitted(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if len(request.headers) > HEADERS_MOST:     # newer versions of aiohttp refuse them earlier
            raise Refusal(400, f"a request has at most {HEADERS_MOST} headers")
        if request._message.url.is_absolute():      # whose scheme and host would count as those of the connection
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
        found, by_token = self._who(request)
        user, session = found.user if found else None, None if by_token else found
        request["user"], request["session"], request["live"] = user, session, found.live if found else None
        row = row_of(request)
        if times := self._times_of.get(request.transport):
            times.known = user is not None
        if user is None and (row.role != ANYONE if row else request.path.startswith("/api/")):
            raise Refusal(401, "log in first: POST /api/login, or a token")
        if _changes(request) and session and request.path != "/api/login" and not hmac.compare_digest(
                request.headers.get("X-Fledge-CSRF", "").encode(errors="replace"), session.csrf.encode()):
            raise Refusal(403, "the header X-Fledge-CSRF is missing or old: a request that changes something has it, "
                          "with the word csrf of GET /api/session; or Authorization: Bearer TOKEN")
        self.check(request)
        if _changes(request) and not request.match_info.http_exception:     # a route that there is
            await self._note(request, row.logged if row else True, row.body if row else "body")
            if user and not (row and row.role == ANYONE) and self._who(request)[0] is not found:    # while it came
                raise Refusal(401, "the session has ended meanwhile: log in again")
        task = asyncio.current_task()
        try:
            return await handler(request)
        finally:
            if found and task in found.live:
                found.live.discard(task)
                found.used = self.clock()

    def _who(self, request: web.Request) -> tuple[_Session | None, bool]:
        """The session of a cookie, or of a token and True."""
        given = request.headers.get("Authorization")
        if given is not None:
            if not request.secure and not is_loopback(request.remote or ""):
                raise Refusal(403, "a token does not come over plain HTTP from another machine, where others may have "
                              "read it: make a new one, and use https")
            kind, _, word = given.partition(" ")
            digest = _digest(word.strip())
            user = self.access.tokens.get(digest) if kind.lower() == "bearer" else None
            if user is None:
                raise Refusal(401, "the token is none of this server")
            return self._scripts.setdefault(digest, _Session(user, 0.0)), True
        if not self.access.closed:
            return self._nobody, False
        name = _digest(request.cookies.get(self._cookie(request), ""))
        session = self._sessions.get(name)
        if session and not session.live and self.clock() - session.used > self.access.idle_s:
            self._end(name, "it was idle")
            return None, False
        if session:
            session.used = self.clock()
        return session, False

    async def _note(self, request: web.Request, logged: bool, bound: str) -> None:
        """Read the body of a changing request, and write the request into the log."""
        stranger = request["user"] is None
        if stranger and ((request.content_length or 0) > LOGGED or "Transfer-Encoding" in request.headers):
            raise Refusal(413, f"a login has at most {LOGGED} bytes, and says how many")
        most = int(self.bounds[bound])
        size = most if request.content_length is None else request.content_length
        if self.bounds.over(bound, size):
            raise Refusal(413, self.bounds.says(bound))
        if self.bounds.over("bodies at once", self._bodies + size):
            raise Refusal(429, self.bounds.says("bodies at once"), {"Retry-After": "5"})
        request["bytes"] = size
        self._bodies += size
        request._client_max_size = most + 1     # aiohttp's, which is of the whole application
        try:
            body = await asyncio.wait_for(request.read(), self.bounds["time of a body"])
        except web.HTTPRequestEntityTooLarge:
            raise Refusal(413, self.bounds.refuses(bound)) from None
        except asyncio.TimeoutError:
            raise Refusal(408, self.bounds.refuses("time of a body")) from None
        if stranger or not logged:
            return
        if not self._row(request["user"].name, "changes of a user"):
            raise Refusal(429, self.bounds.says("changes of a user"), {"Retry-After": "60"})
        details: dict[str, Any] = {"bytes": len(body)}
        if len(body) <= LOGGED:
            with suppress(ValueError):
                details = {"body": loads(body)} if body else {}
        if request.query_string:
            details["query"] = dict(request.query) if len(request.query_string) <= LOGGED else "..."
        await self._aside(self.log, request["user"].name, f"{request.method} {request.path}", details)

    async def _aside(self, what: Callable[..., None], *given: Any) -> None:
        """What writes into the log, which waits for the disk, in a thread."""
        await asyncio.get_running_loop().run_in_executor(self._writer, what, *given)

    def _row(self, user: str, bound: str) -> bool:
        """Whether a user may cause one more row in the journal now."""
        now, rows = self.clock(), self._rows[user, bound]
        if self.bounds.over(bound, rows.within(now) + 1):
            return False
        rows.count(1, now)
        return True

    def _refused(self, request: web.Request, status: int, why: str) -> None:
        """A refusal in the log; those of strangers, and of users who have too many, at the 1st, the 10th, the 100th,
        ... time, for they cost nothing."""
        user, address = request["user"], _address(request.remote)
        details: dict[str, Any] = {"request": f"{request.method} {request.path}"[:200], "status": status,
                                   "why": why[:200], "from": address}
        if user is None or not self._row(user.name, "refusals of a user"):
            details["times"] = self._times(user.name if user else address, f"{status}")
            if not details["times"]:
                return
        self.log(user.name if user else "", "refused", details)

    def _times(self, address: str, what: str) -> int:
        if len(self._strangers) > 10_000:
            self._strangers.clear()
        self._strangers[address, what] += 1
        times = self._strangers[address, what]
        return times if str(times).strip("0") == "1" else 0

    # --- sessions ---

    def _cookie(self, request: web.Request, of: str = "") -> str:
        here = request.transport.get_extra_info("sockname") if request.transport else None
        return f"{'__Host-' if request.secure else ''}fledge{of}-{here[1] if here else 0}"  # cookies know no ports

    @route("GET", "/api/session", ANYONE)
    async def _session(self, request: web.Request) -> web.Response:
        user, session = request["user"], request["session"]
        return web.json_response({
            "user": user.name if user else None, "roles": [one for one in ROLES if user and one in user.roles],
            "crafts": sorted(user.crafts) if user and user.crafts is not None else None,
            "csrf": session.csrf if session else "", "version": __version__,
            "login": bool(self.access.users)})

    @route("POST", "/api/login", ANYONE, logged=False)
    async def _login(self, request: web.Request) -> web.Response:
        try:
            given = loads(await request.read())
            name, password = given["user"], given["password"]
            if not isinstance(name, str) or not isinstance(password, str) or len(password) > PASSWORD_MOST:
                raise ValueError
        except (ValueError, KeyError, TypeError):
            raise Refusal(400, "expected {\"user\": \"...\", \"password\": \"...\"}") from None
        if not self.access.users:
            raise Refusal(400, "this server has no users to log in")
        user = self.access.users.get(name)
        proof = user.password.proof() if user and user.password else ""
        mark = self._cookie(request, f"-{_digest(name)[:8]}")
        known = bool(proof) and hmac.compare_digest(_digest(request.cookies.get(mark, "")), _digest(proof))
        if self._waiting >= QUEUE and not known:
            raise Refusal(429, "too many log in at once; try again", {"Retry-After": "5"})
        where = f"a browser of {name}" if known else _address(request.remote)
        attempt = self._attempt(where, "" if known else name)
        # Unknown names take as long, so that the time does not tell which there are.
        kept = (user or next(iter(self.access.users.values()))).password
        assert kept
        self._waiting += 1
        try:
            fits = await asyncio.get_running_loop().run_in_executor(self._checker, kept.fits, password)
        finally:
            self._waiting -= 1
        if not user or not fits or self.access.users.get(name) != user:     # the file may have changed meanwhile
            raise Refusal(401, "the name or the password is wrong")
        if old := request["session"]:
            self._end_of(old, f"{old.user.name} logged in again")
        self._failed = [one for one in self._failed if one[1:] != attempt]
        request["user"], request["session"] = user, self._begin(user, word := secrets.token_urlsafe(32))
        await self._aside(self.log, user.name, "logged in", {"from": _address(request.remote)})
        response = await self._session(request)
        self._give(request, response, self._cookie(request), word, self.access.session_s)
        self._give(request, response, mark, proof, KNOWN_S)
        return response

    @route("POST", "/api/logout", USER, logged=False)
    async def _logout(self, request: web.Request) -> web.Response:
        if request["session"]:
            self._end_of(request["session"], "logged out")
        response = web.json_response({})
        self._give(request, response, self._cookie(request), "", 0)
        return response

    @staticmethod
    def _give(request: web.Request, response: web.Response, name: str, word: str, age_s: float) -> None:
        response.set_cookie(name, word, max_age=int(age_s), path="/", httponly=True,
                            samesite="Strict", secure=request.secure)

    def _begin(self, user: User, word: str) -> _Session:
        own = [key for key, one in self._sessions.items() if one.user == user]
        for key in own[:len(own) - SESSIONS + 1]:
            self._end(key, "the user began too many others")
        name, session = _digest(word), _Session(user, self.clock())
        session.end = asyncio.get_running_loop().call_later(
            self.access.session_s, lambda: self._end(name, "its time was over"))
        self._sessions[name] = session
        return session

    def _end_of(self, session: _Session, why: str) -> None:
        for name in [key for key, one in self._sessions.items() if one is session]:
            self._end(name, why)

    def _end(self, name: str, why: str) -> None:
        session = self._sessions.pop(name)
        if session.end:
            session.end.cancel()
        session.cut()
        self._writer.submit(self.log, session.user.name, "session ended", {"why": why})

    def _attempt(self, where: str, name: str) -> tuple[str, str]:
        """Count an attempt to log in as failed until it has not; refuses one of an address or a browser that guesses,
        and of a name that many guess. name: "" of a browser that was that user before: others must not lock it out, nor
        the server's own machine."""
        now = self.clock()
        self._failed = [one for one in self._failed if one[0] > now - ATTEMPTS_S]
        for most, times, text in ((ATTEMPTS, [one[0] for one in self._failed if one[1] == where], ""),
                                  (NAMED, [one[0] for one in self._failed if name and one[2] == name
                                           and not is_loopback(one[1]) and not is_loopback(where)],
                                   f" as {name!r}; a browser that was this user before, or on the server's machine, "
                                   "does not wait")):
            if len(times) >= most:
                rest = int(times[-most] + ATTEMPTS_S - now) + 1
                raise Refusal(429, f"{most} attempts have failed; try again in {rest} s{text}",
                              {"Retry-After": str(rest)})
        self._failed.append((now, where, name))
        return where, name

    async def _secured(self, request: web.Request, response: web.StreamResponse) -> None:
        if isinstance(response, web.WebSocketResponse) and (task := asyncio.current_task()):
            if times := self._times_of.get(request.transport):
                times.live = True
            request["live"].add(task)       # so that it ends with its session, whatever headers opened it
        response.headers.update(HEADERS)
        if request.secure:
            response.headers["Strict-Transport-Security"] = "max-age=31536000"
        if request.path.startswith("/api/"):
            response.headers.setdefault("Cache-Control", "no-store")

    async def _stop(self, _: web.Application) -> None:
        self._checker.shutdown(wait=False)
        self._writer.shutdown()     # which has written all
        if self._sweeper:
            self._sweeper.cancel()
        for one in self._sessions.values():
            if one.end:
                one.end.cancel()

    # --- connections ---

    async def listen(self, app: web.Application) -> web.AppRunner:
        """Serve an application where the file says; `addresses` then has where. Raises SetupError."""
        listener: list[asyncio.AbstractServer] = []

        async def close(_: web.Application) -> None:
            for one in listener:
                one.close()
            for door in self.doors:
                door.abort()

        app.on_shutdown.append(close)
        # Not decompressed: of some hundred bytes, anybody could make gigabytes, in the loop.
        runner = web.AppRunner(app, logger=_logger(), access_log=None, keepalive_timeout=30, auto_decompress=False)
        await runner.setup()
        self._runner = runner
        self._tls = self.access.tls()
        try:
            server = await asyncio.get_running_loop().create_server(
                lambda: _Door(self, runner, self._tls), self.access.host, self.access.port, backlog=ACCEPTED)
        except OSError as error:
            await runner.cleanup()
            raise SetupError(f"{self.access.host}, port {self.access.port}: {error.strerror or error}") from None
        listener.append(server)
        for one in server.sockets:      # of asyncio, the backlog is also how many are accepted at once; more may wait
            with socket.fromfd(one.fileno(), one.family, one.type) as same:
                same.listen(WAITING)
        self._sweeper = asyncio.create_task(self._sweep())
        self.addresses = [one.getsockname() for one in server.sockets]
        return runner

    def _there(self) -> list[asyncio.Transport]:
        """The connections, with those in their handshake."""
        server = self._runner.server if self._runner else None
        return [*self.doors, *[one.transport for one in server.connections if one.transport]] if server else []

    def full(self, address: str) -> bool:
        """Whether one more connection would be too many."""
        for last in (False, True):
            n, each = self._counts.total(), self._counts[address]
            if n < self.bounds["connections"] and each < self.bounds["connections of an address"] or last:
                break
            self._recount()     # some may have gone
        if not (self.bounds.over("connections", n + 1) or self.bounds.over("connections of an address", each + 1)):
            self._counts[address] += 1
            return False
        if times := self._times(address, "connections"):
            self._writer.submit(self.log, "", "refused", {"why": f"{n} connections", "from": address, "times": times})
        return True

    def _recount(self) -> None:
        """Count the connections of each address, for a fifth of the time at most."""
        if (began := monotonic()) >= self._counted:
            self._counts = Counter(map(_peer, self._there()))
            self._counted = began + 5 * (monotonic() - began)

    async def _sweep(self) -> None:
        """End the connections whose time is over."""
        before = monotonic()
        while True:
            await asyncio.sleep(min(0.25, self.bounds["first request"] / 2))
            self._recount()
            slept, before = monotonic() - before, monotonic()
            if slept > 1:       # the server was late itself, and their requests may wait
                continue
            server = self._runner.server if self._runner else None
            for one in server.connections if server else []:
                if (times := self._times_of.get(one.transport)) and one.transport:
                    waits = len(one._messages)      # of aiohttp, which would keep any number of requests
                    bound = "requests at once" if self.bounds.over("requests at once", waits) else times.over(
                        self.bounds)
                    if bound:
                        one.transport.abort()


class _Times:
    """Those of a connection [s], whose handshake has ended."""

    def __init__(self, opened: float) -> None:
        self.opened, self.asked = opened, 0.0       # asked: when its last request came
        self.known = self.live = False              # it was a user's; it is a WebSocket

    def over(self, bounds: Bounds) -> str:
        """The limit by which it has to end."""
        now = monotonic()
        for bound, since in (("first request", self.opened if not self.asked else now),
                             ("connection without a login", self.opened if not self.known else now),
                             ("time of an answer", self.asked if self.asked and not self.live else now)):
            if bounds.over(bound, now - since):
                return bound
        return ""


class _Door(asyncio.Protocol):
    """A connection until it is admitted and its handshake of TLS has ended; then aiohttp has it."""

    def __init__(self, guard: Guard, runner: web.AppRunner, tls: ssl.SSLContext | None) -> None:
        self._guard, self._runner, self._tls = guard, runner, tls
        self._opening: asyncio.Task[None] | None = None
        self._early, self._lost = b"", False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        if self._runner.server is None or self._guard.full(_peer(transport)):     # None: it ends
            transport.abort()
        elif self._tls:
            self._guard.doors.add(transport)
            self._opening = asyncio.get_running_loop().create_task(self._handshake(transport, self._tls))
        else:
            self._enter(transport, monotonic())

    async def _handshake(self, transport: asyncio.Transport, tls: ssl.SSLContext) -> None:
        loop, guard, opened = asyncio.get_running_loop(), self._guard, monotonic()
        try:
            secured = await loop.start_tls(transport, self, tls, server_side=True,
                                           ssl_handshake_timeout=guard.bounds["first request"])
        except (OSError, asyncio.CancelledError):
            transport.abort()
            return
        finally:
            guard.doors.discard(transport)
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
        bound_socket(transport, self._guard.bounds["unread"])
        self._guard._times_of[transport] = _Times(opened)
        inside = self._runner.server()
        transport.set_protocol(inside)
        inside.connection_made(transport)
        if self._early:
            inside.data_received(self._early)


def _peer(transport: asyncio.BaseTransport) -> str:
    peer = transport.get_extra_info("peername")
    return _address(peer[0] if peer else None)


@lru_cache(10_000)
def _address(remote: str | None) -> str:
    """Where a request comes from: an address of IPv4, or a network of IPv6, of which one host has 2^64 addresses."""
    try:
        address = ip_address(remote or "")
    except ValueError:
        return str(remote)
    return str(address) if address.version == 4 or address.is_loopback else str(ip_network((address, 64), strict=False))


def _host(request: web.Request) -> str:
    try:
        return urlsplit(f"//{request.host}").hostname or ""
    except ValueError:
        return request.host


def _changes(request: web.Request) -> bool:
    return request.method not in ("GET", "HEAD", "OPTIONS")


def _logger() -> logging.Logger:
    """aiohttp's, without a trace of each request that is none: those are answered with 400."""
    logger = logging.getLogger("fledge.ground.server")
    if not logger.filters:
        # The latter: aiohttp goes on with the requests of a connection that is gone.
        logger.addFilter(lambda record: not (record.exc_info and (
            isinstance(record.exc_info[1], HttpProcessingError) or
            isinstance(record.exc_info[1], AssertionError) and record.msg == "Unhandled exception")))
    return logger
