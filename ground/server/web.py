# SPDX-License-Identifier: Apache-2.0
"""The control room by HTTP and WebSocket: its application, its check of roles, and the messages to all
browsers. The handlers are in handlers/. Requests only read what the threads of the spacecraft have, or call them."""
from __future__ import annotations

import asyncio
import logging
import shutil
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from aiohttp import web

from fledge.ground.server.access import ROLES
from fledge.ground.server.answers import dumps, json_answer, Refusal
from fledge.ground.server.bounds import LoopWatch, raise_descriptors
from fledge.ground.server.commanding import ArgumentError, Constrained, Hazardous
from fledge.ground.server.guard import Guard
from fledge.ground.server.handlers import TOPICS, common
from fledge.ground.server.handlers.common import number_of, user_of
from fledge.ground.server.journal import JournalError
from fledge.ground.server.link import AGAIN
from fledge.ground.server.live import Browser, Sender
from fledge.ground.server.questions import Questions
from fledge.ground.server.room import Room, owner
from fledge.ground.server.settings import read, stamp
from fledge.ground.server.routes import RUN, Row, add_routes, row_of, whole
from fledge.ground.server.spacecraft import Spacecraft
from fledge.ground.server.stages import COMMANDS
from fledge.errors import Failure, SetupError

_log = logging.getLogger("fledge.ground.server")
Answer = TypeVar("Answer")
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """The application of a room."""

    def __init__(self, room: Room) -> None:
        self.room = room
        self.guard = Guard(room.settings.access, self._log, check=self._check, bounds=room.bounds)
        self.questions = Questions(room.publish)
        self.browsers: set[Browser] = set()
        self.sender = Sender()
        self.replaying = asyncio.Lock()     #: replays are counted, begun and added one at a time
        self.crowded = False    #: all together, browsers and scripts take too little of what waits for them
        self._loop: asyncio.AbstractEventLoop | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self.bounds, self.watch = room.bounds, LoopWatch(self._slow)
        self._queries, self._queries_now = ThreadPoolExecutor(int(self.bounds["queries"]), "query"), 0
        self.reads: Counter[str] = Counter()    #: values of the long answers that users are reading
        self.began, crafts = time.monotonic(), room.crafts
        for name, used in (
                ("texts of a socket", lambda: max((browser.waiting_texts for browser in self.browsers), default=0)),
                ("packets of a socket", lambda: max((browser.waiting_packets for browser in self.browsers), default=0)),
                ("waiting in all", lambda: sum(browser.waiting for browser in self.browsers)),
                ("queries", lambda: min(self._queries_now, self.bounds["queries"])),
                ("queries that wait", lambda: max(0, self._queries_now - self.bounds["queries"])),
                ("values read by a user", lambda: max(self.reads.values(), default=0)),
                ("values read", self.reads.total),
                ("replays", lambda: room.replays),
                ("clients of a link", lambda: max((craft.connection.clients for craft in crafts.values()), default=0)),
                ("files of a spacecraft", lambda: max((craft.transfers.bytes for craft in crafts.values()), default=0)),
                ("disk that stays free", lambda: shutil.disk_usage(room.settings.folder).free)):
            self.bounds.uses(name, used)
        self.app = web.Application(middlewares=[self.guard.middleware, self._in_words])
        self.guard.attach(self.app)
        for topic in TOPICS:
            add_routes(self.app, topic, self)
        self.app.on_startup.append(whole)
        self.app.on_startup.append(self._begin)
        self.app.on_shutdown.append(self._end)

    # --- in between ---

    async def _begin(self, _: web.Application) -> None:
        self._loop = asyncio.get_running_loop()
        self.room.listeners.append(self._publish)
        self._tasks = [asyncio.ensure_future(task) for task in (
            self._follow(), self.watch.run(), self._crowd(), self.sender.run())]

    async def _end(self, _: web.Application) -> None:
        if self._publish not in self.room.listeners:   # it has ended
            return
        for task in self._tasks:
            task.cancel()
        self.room.listeners.remove(self._publish)
        self._queries.shutdown(wait=False, cancel_futures=True)
        # One that does not read must not hold the others up.
        ends = [asyncio.ensure_future(browser.socket.close(code=1001, message=b"the server ends"))
                for browser in self.browsers]
        if ends:
            await asyncio.wait(ends, timeout=5)

    async def _crowd(self) -> None:
        """Measure how much waits for all clients."""
        while True:
            self.crowded = self.bounds.over("waiting in all", sum(browser.waiting for browser in self.browsers))
            await asyncio.sleep(0.2)

    def _slow(self, late: float) -> None:
        text = (f"the server's loop was blocked for {1000 * late:.0f} ms; it computed for "
                f"{1000 * self.watch.computed:.0f} ms at most, else it waited for a processor")
        _log.warning(text)
        asyncio.get_running_loop().run_in_executor(None, self.room.report, "", "warning", "server", text)

    def _publish(self, content: dict[str, Any]) -> None:
        """From any thread: something has happened."""
        if self._loop and self.browsers:
            self._loop.call_soon_threadsafe(self._spread, dumps(content), content.get("craft") or "",
                                            content["user"] if content["kind"] == "log" else None)

    def _spread(self, text: str, craft: str, user: str | None) -> None:
        for browser in self.browsers:
            if self.sees(browser.request, craft, user):
                browser.put(text)

    async def _follow(self) -> None:
        """Take users, tokens and certificate of the server's file whenever it or its certificate changes; of what is
        wrong, those before stay."""
        old, access = self.room.settings, self.room.settings.access
        now = checked = old.stamp + stamp(*filter(None, (access.certificate, access.key)))
        while True:
            await asyncio.sleep(AGAIN / 2)
            access = self.guard.access
            before, now = now, stamp(*filter(None, (old.file, access.certificate, access.key)))
            if now == checked or now != before:      # a file that still changes is still being written
                continue
            checked = now
            try:
                settings = await asyncio.to_thread(read, old.file)
                settings.guarded()
                later = self.guard.take(settings.access)
            except Exception as error:      # of any kind: the next change is read again
                await asyncio.to_thread(self._report, "critical", f"{old.file.name} has changed and is refused, users "
                                        "and tokens stay", str(error))
                continue
            later = later or (settings.crafts, settings.folder, settings.more) != (old.crafts, old.folder, old.more)
            await asyncio.to_thread(
                self._report, "info", f"{old.file.name} has changed, users and tokens are as it says now"
                + "; what else it says counts when the server starts again" * later)

    def _report(self, severity: str, text: str, why: str = "") -> None:
        """Report about the server: an event of each spacecraft, and a row of the log, which also has why: that may name
        other spacecraft and users."""
        for name in list(self.room.crafts):
            self.room.report(name, severity, "users", text + "; the log says why" * bool(why))
        self._log("", "users", {"why": f"{text}: {why}" if why else text})

    def _log(self, user: str, action: str, details: dict[str, Any]) -> None:
        """A line of the operators' log; what changes something is not done without it."""
        path = details["request"] if action == "refused" else action
        parts = path.partition(" ")[2].split("/")
        # A refused request must not reveal which spacecraft exist.
        craft = parts[3] if action != "refused" and parts[1:3] == ["api", "crafts"] and len(parts) > 3 else ""
        try:
            self.room.log(user, action, dumps(details.get("body", details)) if details else "", craft,
                          action != "refused")
        except JournalError as error:
            if action.startswith(("POST", "PUT", "DELETE")):
                raise Refusal(409, f"nothing is done that cannot be logged: {error}") from None

    @web.middleware
    async def _in_words(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Errors as answers."""
        try:
            return await handler(request)
        except ArgumentError as error:
            raise Refusal(400, str(error), argument=error.argument) from None
        except Hazardous as error:
            await asyncio.to_thread(request["craft"].reporter.event, "info", COMMANDS, f"{user_of(request)} asks for "
                                    f"{error.command}, which is hazardous: {error}; not sent, for it is not confirmed")
            raise Refusal(409, f"this command is hazardous: {error}", hazardous=str(error)) from None
        except Constrained as error:
            if error.hazardous:
                await asyncio.to_thread(request["craft"].reporter.event, "watch", COMMANDS, f"{error.hazardous} of "
                                        f"{user_of(request)}, which is hazardous, does not leave: {error}")
            raise Refusal(409, f"this command may leave when its constraint holds: {error}", constraint=str(error),
                          suspendable=error.suspendable) from None
        except (JournalError, Failure) as error:
            raise Refusal(409, str(error)) from None
        except SetupError as error:
            raise Refusal(400, str(error)) from None
        except asyncio.TimeoutError:
            raise Refusal(409, f"the spacecraft's link did not answer within {common.PATIENCE:g} s") from None

    # --- access ---

    def _check(self, request: web.Request) -> None:
        """Raises an answer if the user may not make a request, by the row of its route."""
        if not (row := row_of(request)):
            return
        if row.craft:
            request["craft"] = self.seen(request, request.match_info["c"], row)
        elif row.role in ROLES:
            self.guard.require(request, None, row.role)

    def seen(self, request: web.Request, name: str, row: Row) -> Spacecraft:
        """The spacecraft of a name, for which the user has the role. Raises an answer, which is the same for one that
        there is not and for one that the user may not see."""
        there = [known for known in self.room.crafts if request["user"].knows(owner(known))]
        try:
            craft = self.room.craft(name, there)
        except SetupError as error:
            raise Refusal(404, str(error)) from None
        self.guard.require(request, owner(name), row.role)
        if row.craft == RUN and craft.control and not all(
                self.guard.allowed(request, owner(other.name), row.role) for other in self.room.crafts.values()
                if other.control is craft.control):
            raise Refusal(403, f"other spacecraft fly in the run of {name}, for which {user_of(request)} lacks the "
                               f"role '{row.role}'")
        return craft

    def sees(self, request: web.Request, craft: str, user: str | None = None) -> bool:
        """Whether a user may see something: of a spacecraft, or of all; of what one has done: his own, too."""
        if craft:
            return self.guard.allowed(request, owner(craft), "view") or user == user_of(request)
        return user in (None, user_of(request)) or request["user"].crafts is None

    # --- answers ---

    async def aside(self, work: Callable[..., Answer], *given: Any) -> Answer:
        """What takes longer, in a thread of its own."""
        return await asyncio.get_running_loop().run_in_executor(None, work, *given)

    async def answer(self, work: Callable[..., Any], *given: Any) -> web.Response:
        """An answer that may be long, made in such a thread."""
        return await self.aside(lambda: json_answer(work(*given)))

    async def query(self, work: Callable[[], Answer]) -> Answer:
        """Something of the archive, in one of its threads."""
        if self.bounds.over("queries that wait", self._queries_now + 1 - self.bounds["queries"]):
            raise Refusal(429, self.bounds.says("queries that wait"))
        self._queries_now += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._queries, work)
        finally:
            self._queries_now -= 1

    async def journal_rows(self, request: web.Request, kind: str, craft: str | None,
                           seen: tuple[list[str], str] | None = None) -> web.Response:
        """The rows of the journal that the query of a request asks for."""
        return await self.answer(
            self.room.journal.rows, kind, craft, number_of(request, "before", None),
            number_of(request, "limit", 200, 1), number_of(request, "before_ns", None), seen)

    @staticmethod
    def file(path: Path) -> web.FileResponse:
        """A file of the console, or of a mission."""
        if not path.is_file():
            raise Refusal(404, f"{path.name} was not built: ./fledge setup --view builds the console, with Node")
        return web.FileResponse(path, headers={"Cache-Control": "no-cache"})

    def describe(self) -> dict[str, Any]:
        """The resources that the server uses, and how long its loop was blocked."""
        return {"browsers": len(self.browsers), "limits": self.bounds.describe(), "loop": {
            "longest_ms": 1000 * self.watch.longest, "recent_ms": 1000 * self.watch.recent,
            "computed_ms": 1000 * self.watch.computed}}


async def serve(room: Room, ready: Callable[[str], Any], over: asyncio.Event) -> None:
    """Serve a room until `over` is set. ready: gets the address of the page."""
    raise_descriptors()
    server = Server(room)
    runner = await server.guard.listen(server.app)
    try:
        room.start()
        host, port = server.guard.connections.addresses[0][:2]
        scheme = "https" if room.settings.access.certificate else "http"
        ready(f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/")
        await over.wait()
    finally:
        await runner.shutdown()     # aiohttp 3.8 does so only for sites of its own
        await runner.cleanup()
