# SPDX-License-Identifier: Apache-2.0
"""Sessions of browsers, by their cookies, and of scripts, by their tokens."""
from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable
from typing import Any

from fledge.ground.server.access import OPERATOR, Access, User
from fledge.ground.server.passwords import digest
from fledge.ground.server.request_log import RequestLog

SESSIONS = 16       # of one user; the oldest ends


class Session:
    """A session of a user."""

    def __init__(self, user: User, now: float) -> None:
        self.user, self.used = user, now
        self.csrf = secrets.token_urlsafe(24)
        self.live: set[asyncio.Task[Any]] = set()       # its open WebSockets
        self.end: asyncio.TimerHandle | None = None

    def cut(self) -> None:
        """Close its WebSockets."""
        for task in self.live:
            task.cancel()


class Sessions:
    """The sessions of the users and tokens of `access`. clock: [s] of their idleness."""

    def __init__(self, access: Access, log: RequestLog, clock: Callable[[], float]) -> None:
        self.access, self.clock, self._log = access, clock, log
        self._of_browsers: dict[str, Session] = {}      # by the hash of the cookie
        self._of_scripts: dict[str, Session] = {}       # by the hash of the token
        self._without_users = Session(OPERATOR, 0.0)    # of all requests, if there are no users

    def of_token(self, word: str) -> Session | None:
        """The session of a script's token."""
        hashed = digest(word)
        user = self.access.tokens.get(hashed)
        return None if user is None else self._of_scripts.setdefault(hashed, Session(user, 0.0))

    def of_cookie(self, word: str) -> Session | None:
        """The session of a browser's cookie, which is used now."""
        if not self.access.closed:
            return self._without_users
        name = digest(word)
        session = self._of_browsers.get(name)
        if session and not session.live and self.clock() - session.used > self.access.idle_s:
            self._end(name, "it was idle")
            return None
        if session:
            session.used = self.clock()
        return session

    def begin(self, user: User, word: str) -> Session:
        """Begin a session for a new cookie."""
        own = [key for key, session in self._of_browsers.items() if session.user == user]
        for key in own[:len(own) - SESSIONS + 1]:
            self._end(key, "the user began too many others")
        name, session = digest(word), Session(user, self.clock())
        session.end = asyncio.get_running_loop().call_later(
            self.access.session_s, lambda: self._end(name, "its time was over"))
        self._of_browsers[name] = session
        return session

    def end(self, session: Session, why: str) -> None:
        for name in [key for key, other in self._of_browsers.items() if other is session]:
            self._end(name, why)

    def take(self, access: Access) -> None:
        """End the sessions of users and tokens that differ in new settings."""
        self.access = access
        for name, session in list(self._of_browsers.items()):
            if (now := access.users.get(session.user.name)) != session.user:
                self._end(name, "its password, roles or spacecraft were changed" if now else "the user was removed")
        for hashed, session in list(self._of_scripts.items()):
            if (now := access.tokens.get(hashed)) != session.user:
                del self._of_scripts[hashed]
                session.cut()
                self._log.later(session.user.name, "token ended", {
                    "why": "its name, roles or spacecraft were changed" if now else "the token was removed"})
        if access.closed:
            self._without_users.cut()

    def close(self) -> None:
        for browser in self._of_browsers.values():
            if browser.end:
                browser.end.cancel()

    def _end(self, name: str, why: str) -> None:
        session = self._of_browsers.pop(name)
        if session.end:
            session.end.cancel()
        session.cut()
        self._log.later(session.user.name, "session ended", {"why": why})
