# SPDX-License-Identifier: Apache-2.0
"""The requests by which a user logs in and out, and how often a client may try."""
from __future__ import annotations

import asyncio
import hmac
import secrets
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from aiohttp import web

from fledge import __version__
from fledge.ground.server.access import ROLES
from fledge.ground.server.answers import Refusal, answer
from fledge.ground.server.passwords import PASSWORD_MOST, digest
from fledge.ground.server.request_log import RequestLog, network_of
from fledge.ground.server.openapi import TEXT, object_of
from fledge.ground.server.routes import ANYONE, USER, loads, route
from fledge.ground.server.sessions import Sessions
from fledge.loopback import is_loopback

ATTEMPTS, ATTEMPTS_S = 10, 600      # failed logins of one address, or of a browser that was a user before, within [s]
NAMED = 30                          # those of one name, of all addresses and browsers that were never that user
KNOWN_S = 400 * 86400               # how long a browser proves an earlier login; the most that browsers keep
QUEUE = 8                           # logins that wait for their password to be checked


class Logins:
    """clock: [s] of failed attempts."""

    def __init__(self, sessions: Sessions, log: RequestLog, clock: Callable[[], float]) -> None:
        self._sessions, self._log, self._clock = sessions, log, clock
        self._failed: list[tuple[float, str, str]] = []     # (time, address, name) of logins that failed or go on
        self._checker, self._waiting = ThreadPoolExecutor(1), 0

    @route("GET", "/api/session", ANYONE, answers="Session")
    async def session(self, request: web.Request) -> web.Response:
        """The user of this request."""
        user, session = request["user"], request["session"]
        return answer({
            "user": user.name if user else None, "roles": [role for role in ROLES if user and role in user.roles],
            "crafts": sorted(user.crafts) if user and user.crafts is not None else None,
            "csrf": session.csrf if session else "", "version": __version__,
            "login": bool(self._sessions.access.users)})

    @route("POST", "/api/login", ANYONE, logged=False, answers="Session", takes=object_of(user=TEXT, password=TEXT))
    async def login(self, request: web.Request) -> web.Response:
        """Begin a session."""
        access = self._sessions.access
        try:
            given = loads(await request.read())
            name, password = given["user"], given["password"]
            if not isinstance(name, str) or not isinstance(password, str) or len(password) > PASSWORD_MOST:
                raise ValueError
        except (ValueError, KeyError, TypeError):
            raise Refusal(400, "expected {\"user\": \"...\", \"password\": \"...\"}") from None
        if not access.users:
            raise Refusal(400, "this server has no users to log in")
        user = access.users.get(name)
        proof = user.password.proof() if user and user.password else ""
        mark = cookie(request, f"-{digest(name)[:8]}")
        known = bool(proof) and hmac.compare_digest(digest(request.cookies.get(mark, "")), digest(proof))
        if self._waiting >= QUEUE and not known:
            raise Refusal(429, "too many log in at once; try again", {"Retry-After": "5"})
        where = f"a browser of {name}" if known else network_of(request.remote)
        attempt = self._attempt(where, "" if known else name)
        # Unknown names take as long, so that the time does not reveal the known ones.
        expected = (user or next(iter(access.users.values()))).password
        assert expected
        self._waiting += 1
        try:
            fits = await asyncio.get_running_loop().run_in_executor(self._checker, expected.fits, password)
        finally:
            self._waiting -= 1
        # The file may have changed meanwhile.
        if not user or not fits or self._sessions.access.users.get(name) != user:
            raise Refusal(401, "the name or the password is wrong")
        if old := request["session"]:
            self._sessions.end(old, f"{old.user.name} logged in again")
        self._failed = [failed for failed in self._failed if failed[1:] != attempt]
        request["user"], request["session"] = user, self._sessions.begin(user, word := secrets.token_urlsafe(32))
        await self._log.write(user.name, "logged in", {"from": network_of(request.remote)})
        response = await self.session(request)
        _give(request, response, cookie(request), word, self._sessions.access.session_s)
        _give(request, response, mark, proof, KNOWN_S)
        return response

    @route("POST", "/api/logout", USER, logged=False)
    async def logout(self, request: web.Request) -> web.Response:
        """End the session."""
        if request["session"]:
            self._sessions.end(request["session"], "logged out")
        response = answer({})
        _give(request, response, cookie(request), "", 0)
        return response

    def close(self) -> None:
        self._checker.shutdown(wait=False)

    def _attempt(self, where: str, name: str) -> tuple[str, str]:
        """Count an attempt to log in as failed until it has not; refuses one of an address or a browser that guesses,
        and of a name that many guess. name: "" of a browser that was that user before: others must not lock it out, nor
        the server's own machine."""
        now = self._clock()
        self._failed = [failed for failed in self._failed if failed[0] > now - ATTEMPTS_S]
        for most, times, text in ((ATTEMPTS, [failed[0] for failed in self._failed if failed[1] == where], ""),
                                  (NAMED, [failed[0] for failed in self._failed if name and failed[2] == name
                                           and not is_loopback(failed[1]) and not is_loopback(where)],
                                   f" as {name!r}; a browser that was this user before, or on the server's machine, "
                                   "does not wait")):
            if len(times) >= most:
                rest = int(times[-most] + ATTEMPTS_S - now) + 1
                raise Refusal(429, f"{most} attempts have failed; try again in {rest} s{text}",
                              {"Retry-After": str(rest)})
        self._failed.append((now, where, name))
        return where, name


def cookie(request: web.Request, of: str = "") -> str:
    """The name of a cookie of this server."""
    here = request.transport.get_extra_info("sockname") if request.transport else None
    return f"{'__Host-' if request.secure else ''}fledge{of}-{here[1] if here else 0}"  # cookies know no ports


def _give(request: web.Request, response: web.Response, name: str, word: str, age_s: float) -> None:
    response.set_cookie(name, word, max_age=int(age_s), path="/", httponly=True, samesite="Strict",
                        secure=request.secure)
