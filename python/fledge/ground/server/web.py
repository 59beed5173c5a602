# SPDX-License-Identifier: Apache-2.0
"""The control room by HTTP and WebSocket (api.yaml). Requests only read what the threads of the spacecraft have, or ask
them."""
from __future__ import annotations

import asyncio
import logging
import shutil
import time
from collections import Counter
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, cast

from aiohttp import web

from fledge import __version__
from fledge.ground.server.answers import PART, answer, dumps, in_binary, in_csv, in_json, owner, refusal
from fledge.ground.server.bounds import LoopWatch, memory, raise_descriptors
from fledge.ground.server.commanding import ArgumentError, Hazardous
from fledge.ground.server.displays import displays
from fledge.ground.server.journal import JournalError
from fledge.ground.server.live import Browser, Sender
from fledge.ground.server.questions import Questions
from fledge.ground.server.room import Room
from fledge.ground.server.settings import read, stamp
from fledge.ground.server.routes import ANYONE, RUN, USER, Row, add_routes, described, loads, route, row_of, rows, whole
from fledge.ground.server.spacecraft import AGAIN, PICTURES, Spacecraft
from fledge.ground.server.users import ROLES, Guard, Refusal
from fledge.errors import Failure, SetupError

HERE = Path(__file__).parent
_log = logging.getLogger("fledge.ground.server")
PATIENCE = 10.0     # [s] for the thread of a spacecraft to answer
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """The application of a room."""

    def __init__(self, room: Room) -> None:
        self.room = room
        self.guard = Guard(room.settings.access, self._log, check=self._check, bounds=room.bounds)
        self.questions = Questions(room.publish)
        self.browsers: set[Browser] = set()
        self.sender = Sender()
        self._replaying = asyncio.Lock()    # counted, made and added one at a time
        self.crowded = False    #: all together, browsers and scripts take too little of what waits for them
        self._loop: asyncio.AbstractEventLoop | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self.bounds, self.watch = room.bounds, LoopWatch(self._slow)
        self._queries, self._asked_now = ThreadPoolExecutor(int(self.bounds["queries"]), "query"), 0
        self._reads: Counter[str] = Counter()   # values of the long answers that users are reading
        self._began, crafts = time.monotonic(), room.crafts
        for name, used in (
                ("texts of a socket", lambda: max((one.waiting_texts for one in self.browsers), default=0)),
                ("packets of a socket", lambda: max((one.waiting_packets for one in self.browsers), default=0)),
                ("waiting in all", lambda: sum(one.waiting for one in self.browsers)),
                ("queries", lambda: min(self._asked_now, self.bounds["queries"])),
                ("queries that wait", lambda: max(0, self._asked_now - self.bounds["queries"])),
                ("values read by a user", lambda: max(self._reads.values(), default=0)),
                ("values read", self._reads.total),
                ("replays", lambda: sum(bool(one.replayed) for one in crafts.values())),
                ("clients of a link", lambda: max((getattr(one.link, "clients", 0) for one in crafts.values()),
                                                  default=0)),
                ("files of a spacecraft", lambda: max((one.transfers.bytes for one in crafts.values()), default=0)),
                ("disk that stays free", lambda: shutil.disk_usage(room.settings.folder).free)):
            self.bounds.uses(name, used)
        self.app = web.Application(middlewares=[self.guard.middleware, self._in_words])
        self.guard.attach(self.app)
        add_routes(self.app, self)
        self.app.on_startup.append(whole)
        self.app.on_startup.append(self._begin)
        self.app.on_shutdown.append(self._end)

    # --- in between ---

    async def _begin(self, _: web.Application) -> None:
        self._loop = asyncio.get_running_loop()
        self.room.listeners.append(self._hear)
        self._tasks = [asyncio.ensure_future(one) for one in (
            self._follow(), self.watch.run(), self._crowd(), self.sender.run())]

    async def _end(self, _: web.Application) -> None:
        if self._hear not in self.room.listeners:   # it has ended
            return
        for task in self._tasks:
            task.cancel()
        self.room.listeners.remove(self._hear)
        self._queries.shutdown(wait=False, cancel_futures=True)
        # One that does not read must not hold the others up.
        ends = [asyncio.ensure_future(one.socket.close(code=1001, message=b"the server ends")) for one in self.browsers]
        if ends:
            await asyncio.wait(ends, timeout=5)

    async def _crowd(self) -> None:
        """Look how much waits for all."""
        while True:
            self.crowded = self.bounds.over("waiting in all", sum(one.waiting for one in self.browsers))
            await asyncio.sleep(0.2)

    def _slow(self, late: float) -> None:
        text = (f"the server's loop was blocked for {1000 * late:.0f} ms; it computed for "
                f"{1000 * self.watch.computed:.0f} ms at most, else it waited for a processor")
        _log.warning(text)
        asyncio.get_running_loop().run_in_executor(None, self.room.tell, "", "warning", "server", text)

    def _hear(self, content: dict[str, Any]) -> None:
        """From any thread: something has happened."""
        if self._loop and self.browsers:
            self._loop.call_soon_threadsafe(self._spread, dumps(content), content.get("craft") or "",
                                            content["user"] if content["kind"] == "log" else None)

    def _spread(self, text: str, craft: str, user: str | None) -> None:
        for one in self.browsers:
            if self.sees(one.request, craft, user):
                one.put(text)

    async def _follow(self) -> None:
        """Take users, tokens and certificate of the server's file whenever it or its certificate changes; of what is
        wrong, those before stay."""
        old, access = self.room.settings, self.room.settings.access
        now = looked = old.stamp + stamp(*filter(None, (access.certificate, access.key)))
        while True:
            await asyncio.sleep(AGAIN / 2)
            access = self.guard.access
            before, now = now, stamp(*filter(None, (old.file, access.certificate, access.key)))
            if now == looked or now != before:      # the latter is still being written
                continue
            looked = now
            try:
                found = await asyncio.to_thread(read, old.file)
                found.guarded()
                later = self.guard.take(found.access)
            except Exception as error:      # whatever it is, the next change is looked at
                await asyncio.to_thread(self._tell, "critical", f"{old.file.name} has changed and is refused, users "
                                        "and tokens stay", str(error))
                continue
            later = later or (found.crafts, found.folder, found.more) != (old.crafts, old.folder, old.more)
            await asyncio.to_thread(
                self._tell, "info", f"{old.file.name} has changed, users and tokens are as it says now"
                + "; what else it says counts when the server starts again" * later)

    def _tell(self, severity: str, text: str, why: str = "") -> None:
        """Of the server: with the events of all spacecraft, and in the log. why: for those who see all spacecraft, for
        it may name others, and users."""
        for name in list(self.room.crafts):
            self.room.tell(name, severity, "users", text + "; the log says why" * bool(why))
        self._log("", "users", {"why": f"{text}: {why}" if why else text})

    def _log(self, user: str, action: str, details: dict[str, Any]) -> None:
        """A line of the operators' log; what changes something is not done without it."""
        path = details["request"] if action == "refused" else action
        parts = path.partition(" ")[2].split("/")
        # A refused one could tell its user which spacecraft there are.
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
            raise refusal(400, str(error), argument=error.argument) from None
        except Hazardous as error:
            raise refusal(409, f"this command is hazardous: {error}", hazardous=str(error)) from None
        except (JournalError, Failure) as error:
            raise refusal(409, str(error)) from None
        except SetupError as error:
            raise refusal(400, str(error)) from None
        except asyncio.TimeoutError:
            raise refusal(409, f"the spacecraft's link did not answer within {PATIENCE:g} s") from None

    # --- who may what ---

    def _check(self, request: web.Request) -> None:
        """Raises the answer to who may not ask this, by the row of its route."""
        if not (row := row_of(request)):
            return
        if row.craft:
            request["craft"] = self.seen(request, request.match_info["c"], row)
        elif row.role in ROLES:
            self.guard.require(request, None, row.role)

    def seen(self, request: web.Request, name: str, row: Row) -> Spacecraft:
        """The spacecraft of a name, for which the user has the role. Raises an answer, which is the same for one that
        there is not and for one that the user may not see."""
        there = [one for one in self.room.crafts if request["user"].knows(owner(one))]
        try:
            craft = self.room.craft(name, there)
        except SetupError as error:
            raise refusal(404, str(error)) from None
        self.guard.require(request, owner(name), row.role)
        if row.craft == RUN and craft.control and not all(
                self.guard.allowed(request, owner(one.name), row.role) for one in self.room.crafts.values()
                if one.control is craft.control):
            raise refusal(403, f"other spacecraft fly in the run of {name}, for which {self._user(request)} lacks the "
                               f"role '{row.role}'")
        return craft

    def sees(self, request: web.Request, craft: str, user: str | None = None) -> bool:
        """Whether a user may see something: of a spacecraft, or of all; of what one has done: his own, too."""
        if craft:
            return self.guard.allowed(request, owner(craft), "view") or user == self._user(request)
        return user in (None, self._user(request)) or request["user"].crafts is None

    @staticmethod
    def _craft(request: web.Request) -> Spacecraft:
        """That of the path, for which the user has the role."""
        return cast(Spacecraft, request["craft"])

    async def _body(self, request: web.Request, **kinds: tuple[type, ...] | type) -> dict[str, Any]:
        """The JSON object of a request. kinds: what its keys must be, if they are there."""
        try:
            found = loads(await request.read() or b"{}")
        except ValueError as error:
            raise refusal(400, f"the body: {error}") from None
        if not isinstance(found, dict):
            raise refusal(400, f"the body is an object, as {{}}; found {type(found).__name__}")
        for key, value in found.items():
            if key not in kinds:
                raise refusal(400, f"only known keys count: {', '.join(kinds)}; found '{key}'")
            if not isinstance(value, kinds[key]) or isinstance(value, bool) and kinds[key] is not bool:
                raise refusal(400, f"'{key}' is of the wrong kind; found {str(value)[:80]}")
        return found

    @staticmethod
    def _number(request: web.Request, key: str, default: int | None = None, least: int = -2**63) -> int | None:
        text = request.query.get(key)
        if text is None or text == "":
            return default
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if not least <= value < 2**63:
            raise refusal(400, f"{key} is a whole number; found '{text[:40]}'")
        return value

    @staticmethod
    async def _asked(craft: Spacecraft, what: Callable[[], Any]) -> Any:
        """Something that the spacecraft's thread does."""
        return await asyncio.wait_for(asyncio.wrap_future(craft.call(what)), PATIENCE)

    def _user(self, request: web.Request) -> str:
        return str(request["user"].name)

    # --- spacecraft and parameters ---

    @route("GET", "/api/crafts", "view")
    async def crafts(self, request: web.Request) -> web.StreamResponse:
        return answer([one.told() for one in self.room.crafts.values()
                       if self.sees(request, one.name)])

    @route("GET", "/api/crafts/{c}/slots", "view")
    async def slots(self, request: web.Request) -> web.StreamResponse:
        return await self._told(self._craft(request).slots, self._number(request, "first", 0, 0) or 0)

    @route("PUT", "/api/crafts/{c}/limits/{slot}", "administer")
    async def limits(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, limits=(dict, type(None)), persistence=int)
        slot, levels, persistence = self._slot(craft, request), body.get("limits", {}), body.get("persistence", 1)
        if not 1 <= persistence <= 1000:
            raise refusal(400, f"persistence is from 1 to 1000 values; found {persistence}")
        for level, pair in (levels or {}).items():
            if not isinstance(pair, list) or len(pair) != 2 or not all(
                    one is None or isinstance(one, (int, float)) and not isinstance(one, bool) for one in pair):
                raise refusal(400, f"limits of '{level}' are [low, high], null where open; found {str(pair)[:80]}")
        await self._asked(craft, lambda: craft.limits.change(self._user(request), slot, levels, persistence))
        self.room.publish("slots", craft.name, {"first": slot})
        return answer(craft.slots(slot, 1)[0])

    def _slot(self, craft: Spacecraft, request: web.Request) -> int:
        text = request.match_info["slot"]
        if not text.isdecimal() or len(text) > 9 or int(text) >= len(craft.slot_names):
            raise refusal(404, f"{craft.name} has the slots 0 to {len(craft.slot_names) - 1}; found '{text[:40]}'")
        return int(text)

    @route("GET", "/api/crafts/{c}/displays", "view")
    async def displays(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        folders = [self.room.settings.displays] + ([craft.mission_folder / "displays"] if craft.mission_folder else [])
        return await self._told(lambda: displays(folders, craft.monitor.slots(0), craft.commanding.forms))

    # --- commands ---

    @route("GET", "/api/crafts/{c}/commands", "view")
    async def commands(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        return await self._told(lambda: craft.commanding.forms)

    @route("POST", "/api/crafts/{c}/preview", "view", logged=False)
    async def preview(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, name=str, arguments=dict)
        return answer(craft.commanding.preview(body.get("name", ""), body.get("arguments", {})))

    @route("POST", "/api/crafts/{c}/send", "command")
    async def send(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, name=str, arguments=dict, confirmed=bool)
        row = await self._asked(craft, lambda: craft.commanding.send(
            self._user(request), body.get("name", ""), body.get("arguments", {}), body.get("confirmed", False)))
        return answer({"id": row["id"]})

    @route("POST", "/api/crafts/{c}/raw", "command")
    async def raw(self, request: web.Request) -> web.StreamResponse:
        """A packet that a script has made; it gets the number that is next."""
        craft = self._craft(request)
        body = await self._body(request, hex=str, confirmed=bool)
        ground = await self._asked(craft, lambda: craft.ground)     # in its thread, which opens the link first
        if ground is None:
            raise refusal(409, f"{craft.name} takes no packets now: {craft.state}")
        try:
            packet = bytes.fromhex(body.get("hex", ""))
        except ValueError:
            packet = b""
        if not 8 <= len(packet) <= 1 << 16:
            raise refusal(400, "hex has the digits of a packet of 8 to 65536 bytes")
        if not body.get("confirmed", False) and (why := craft.commanding.hazard(packet)):
            raise Hazardous(f"{why}; a script says confirmed=True in its command")
        # So that a refusal of its number is the server's alone to mend. Once: in the blind, nothing answers.
        if not ground.in_step and not craft.probed:
            craft.probed = True
            await self._asked(craft, lambda: craft.commanding.release(
                self._user(request), "noop", {}, ground.made("noop")))
            for _ in range(round(PATIENCE / 0.05)):
                if ground.in_step:
                    break
                await asyncio.sleep(0.05)

        def release() -> bytes:
            made = ground.numbered(packet)
            craft.commanding.release(self._user(request), ground.dictionary.command(made), {}, [made])
            return made

        return answer({"hex": (await self._asked(craft, release)).hex()})

    @route("GET", "/api/crafts/{c}/dictionary", "view")
    async def dictionary(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        if craft.dictionary is None:
            raise refusal(404, f"{craft.name} is of no mission of Fledge; it has a database of XTCE alone")
        return web.Response(text=craft.dictionary.text(), content_type="application/json")

    @route("GET", "/api/crafts/{c}/sent", "view")
    async def sent(self, request: web.Request) -> web.StreamResponse:
        return await self._list(request, "sent", self._craft(request).name)

    # --- what happened ---

    async def _list(self, request: web.Request, kind: str, craft: str | None,
                    seen: tuple[list[str], str] | None = None) -> web.Response:
        return await self._told(
            self.room.journal.rows, kind, craft, self._number(request, "before"),
            self._number(request, "limit", 200, 1) or 200, self._number(request, "before_ns"), seen)

    @route("GET", "/api/crafts/{c}/events", "view")
    async def events(self, request: web.Request) -> web.StreamResponse:
        return await self._list(request, "events", self._craft(request).name)

    @route("GET", "/api/log", "view")
    async def log(self, request: web.Request) -> web.StreamResponse:
        user = request["user"]
        return await self._list(request, "log", None, None if user.crafts is None else (sorted(user.crafts), user.name))

    @route("GET", "/api/crafts/{c}/alarms", "view")
    async def alarms(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        return await self._told(craft.alarms.rows)

    @route("POST", "/api/crafts/{c}/alarms/{slot}", "command")
    async def alarm(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, acknowledge=bool, note=str, shelve_s=(int, float))
        name = craft.slot_names[self._slot(craft, request)]
        if "shelve_s" in body:
            return answer(await self._asked(craft, lambda: craft.alarms.shelve(name, body["shelve_s"])))
        if not body.get("acknowledge"):
            raise refusal(400, "give {\"acknowledge\": true, \"note\": ...} or {\"shelve_s\": ...}")
        return answer(await self._asked(craft, lambda: craft.alarms.acknowledge(
            name, self._user(request), body.get("note", ""))))

    # --- packets ---

    @route("POST", "/api/crafts/{c}/inspect", "view", logged=False)
    async def inspect(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, hex=str)
        try:
            packet = bytes.fromhex(body.get("hex", ""))
        except ValueError:
            raise refusal(400, "hex has hexadecimal digits, two a byte") from None
        return answer(craft.inspect(packet))

    @route("GET", "/api/crafts/{c}/packets", "view")
    async def packets(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        before = self._number(request, "before_ns", 2**63 - 1) or 0
        limit = min(self._number(request, "limit", 200, 1) or 200, 1000)
        return await self._query(lambda: _json(craft.packet_list(
            before, limit, request.query.get("container"), request.query.get("undecoded") == "1")))

    @route("GET", "/api/crafts/{c}/packets/{id}", "view")
    async def packet(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        found = await self._query(lambda: craft.packet_of(request.match_info["id"]))
        if found is None:
            raise refusal(404, f"{craft.name} has no packet {request.match_info['id'][:60]}")
        return answer(found)

    async def _aside(self, what: Callable[..., Any], *given: Any) -> Any:
        """What takes longer, in a thread of its own."""
        return await asyncio.get_running_loop().run_in_executor(None, what, *given)

    async def _told(self, what: Callable[..., Any], *given: Any) -> web.Response:
        """An answer that may be long, made in such a thread."""
        response: web.Response = await self._aside(lambda: _json(what(*given)))
        return response

    async def _query(self, what: Callable[[], Any]) -> Any:
        """Something of the archive, in one of its threads."""
        if self.bounds.over("queries that wait", self._asked_now + 1 - self.bounds["queries"]):
            raise refusal(429, self.bounds.says("queries that wait"))
        self._asked_now += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._queries, what)
        finally:
            self._asked_now -= 1

    # --- back in time ---

    @route("GET", "/api/crafts/{c}/scene", "view")
    async def scene(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        try:
            return web.Response(body=await self._aside(craft.feed.pack), content_type="application/octet-stream")
        except SetupError as error:
            raise refusal(404, str(error)) from None

    @route("GET", "/api/crafts/{c}/passes", "view")
    async def passes(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        zero = 0 if craft.clock == "simulated" else craft.epoch_ns or 0
        return answer([{"station": one["station"], "elevation": one["elevation"]} | {
            f"{name}_ns": None if one[name] is None else str(zero + round(1e9 * one[name]))
            for name in ("rise", "highest", "set")} for one in await self._aside(craft.contacts.passes)])

    def _kept(self, craft: Spacecraft) -> Spacecraft:
        if craft.history is None:
            raise refusal(404, f"{craft.name} has no archive of its own")
        return craft

    @route("GET", "/api/crafts/{c}/sessions", "view")
    async def sessions(self, request: web.Request) -> web.StreamResponse:
        craft = self._kept(self._craft(request))
        return cast(web.Response, await self._query(lambda: _json(craft.sessions())))

    @route("GET", "/api/crafts/{c}/history", "view")
    async def history(self, request: web.Request) -> web.StreamResponse:
        craft = self._kept(self._craft(request))
        names = list(dict.fromkeys(one for one in request.query.get("names", "").split(",") if one))
        if self.bounds.over("names of a query", len(names)) or not names:
            raise refusal(400, f"{self.bounds.says('names of a query')}; found {len(names)}")
        begin, end, points, session = (self._number(request, key, default, least) or 0 for key, default, least in (
            ("from_ns", 0, -2**63), ("to_ns", 2**63 - 1, -2**63), ("points", 2000, 0), ("session", -1, -1)))
        form = request.query.get("format", "json")
        if form not in ("json", "csv", "binary"):
            raise refusal(400, f"format is json, csv or binary; found '{form[:40]}'")

        found = await self._query(lambda: craft.series(names, begin, end, points, session, form != "binary"))
        kind, parts = {"json": ("application/json", in_json), "csv": ("text/csv", in_csv),
                       "binary": ("application/octet-stream", in_binary)}[form]
        headers = {"Content-Type": kind} | ({"Content-Disposition": "attachment; filename=history.csv"}
                                            if form == "csv" else {})
        n, user = sum(len(one[0]) for one in found.values()), self._user(request)
        if n <= PART:
            return web.Response(body=await self._aside(lambda: b"".join(parts(found))), headers=headers)
        for bound, held in (("values read by a user", self._reads[user]), ("values read", self._reads.total())):
            if self.bounds.over(bound, held + n):
                raise refusal(429, self.bounds.says(bound))
        self._reads[user] += n
        try:    # in parts, so that neither the loop nor the memory has a whole one
            response, rest = web.StreamResponse(headers=headers), parts(found)
            await response.prepare(request)
            while part := await self._aside(next, rest, b""):
                await response.write(part)
        finally:
            self._reads[user] -= n
        return response

    @route("POST", "/api/crafts/{c}/replay", "view")
    async def replay(self, request: web.Request) -> web.StreamResponse:
        from fledge.ground.server.replay import Replay

        source = self._kept(self._craft(request))
        body = await self._body(request, session=int, from_ns=(str, int), to_ns=(str, int), speed=(int, float))
        try:
            begin, end = int(body.get("from_ns", 0)), int(body.get("to_ns", 2**63 - 1))
        except ValueError:
            raise refusal(400, "from_ns and to_ns are whole numbers") from None
        if not -2**63 <= begin <= end < 2**63:
            raise refusal(400, "from_ns comes before to_ns")
        session = body.get("session", -1)
        if not -1 <= session < 2**31:
            raise refusal(400, f"session is a number of the list of sessions, or -1 for the newest; found {session}")
        async with self._replaying:
            if self.bounds.over("replays", 1 + sum(bool(one.replayed) for one in self.room.crafts.values())):
                raise refusal(409, self.bounds.says("replays"))
            made = await self._aside(Replay, self.room, source, session, begin, end, body.get("speed", 1.0))
            self.room.add(made)
        made.start()
        self.room.publish("crafts", "", {})
        return answer(made.told())

    @route("DELETE", "/api/crafts/{c}/replay", "view")
    async def end_replay(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        if not craft.replayed:
            raise refusal(409, f"{craft.name} is no replay")
        await self._aside(self.room.remove, craft.name)
        return answer({})

    # --- files, tables, stored commands ---

    @route("GET", "/api/crafts/{c}/transfers", "view")
    async def transfers(self, request: web.Request) -> web.StreamResponse:
        return await self._list(request, "transfers", self._craft(request).name)

    @route("POST", "/api/crafts/{c}/transfers/{id}", "command")
    async def transfer(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, action=str)
        number = self._id(request)
        return answer(await self._asked(craft, lambda: craft.transfers.action(number, body.get("action", ""))))

    @route("POST", "/api/crafts/{c}/files", "command", body="body of a file")
    async def upload(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        name, data = request.query.get("name", ""), await request.read()
        row = await self._asked(craft, lambda: craft.transfers.put(name, data))
        return answer({"id": row["id"]})

    @route("POST", "/api/crafts/{c}/fetch", "command")
    async def fetch(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, name=str)
        row = await self._asked(craft, lambda: craft.transfers.fetch(body.get("name", "")))
        return answer({"id": row["id"]})

    @route("POST", "/api/crafts/{c}/directory", "command")
    async def directory(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        if "files" not in craft.told()["can"]:
            raise refusal(404, f"the flight software of {craft.name} has no Files")
        body = await self._body(request, path=str)
        listing = await self._asked(craft, lambda: craft.transfers.directory(body.get("path", "")))
        return answer({"names": await asyncio.wait_for(asyncio.wrap_future(listing), 6 * PATIENCE)})

    @route("GET", "/api/crafts/{c}/files", "view")
    async def files(self, request: web.Request) -> web.StreamResponse:
        return await self._told(self._craft(request).transfers.files)

    @route("GET", "/api/crafts/{c}/files/{name}", "view")
    async def file(self, request: web.Request) -> web.StreamResponse:
        craft, name = self._craft(request), request.match_info["name"]
        if name not in [one["name"] for one in await self._aside(craft.transfers.files)]:
            raise refusal(404, f"there is no file '{name[:80]}'")
        return web.FileResponse(craft.transfers.folder / name, headers={
            "Content-Type": "application/octet-stream", "Content-Disposition": "attachment"})

    @route("GET", "/api/crafts/{c}/tables", "view")
    async def tables(self, request: web.Request) -> web.StreamResponse:
        return await self._told(self._craft(request).tables.rows)

    @route("POST", "/api/crafts/{c}/tables/{name}", "command")
    async def table(self, request: web.Request) -> web.StreamResponse:
        craft, name = self._craft(request), request.match_info["name"]
        body = await self._body(request, read=bool, values=dict, confirmed=bool)
        user, given = self._user(request), body.get("values")
        row = await self._asked(craft, lambda: craft.tables.read(user, name) if given is None else
                                craft.tables.write(user, name, given, body.get("confirmed", False)))
        return answer({"ids": [row["id"]]})

    @route("GET", "/api/crafts/{c}/stored", "view")
    async def stored(self, request: web.Request) -> web.StreamResponse:
        return await self._told(self._craft(request).stored.told)

    @route("POST", "/api/crafts/{c}/stored", "command")
    async def command_stored(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, list=int, action=str, step=int, time_ns=(int, str), name=str, arguments=dict,
                                confirmed=bool)
        row = await self._asked(craft, lambda: craft.stored.act(self._user(request), body))
        return answer({"ids": [row["id"]]})

    # --- questions of scripts ---

    @route("POST", "/api/crafts/{c}/questions", "command")
    async def ask(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, text=str)
        return answer(self.questions.ask(craft.name, self._user(request), body.get("text", "")))

    @route("GET", "/api/crafts/{c}/questions", "view")
    async def open_questions(self, request: web.Request) -> web.StreamResponse:
        return answer(self.questions.open(self._craft(request).name))

    @route("GET", "/api/crafts/{c}/questions/{id}", "command")
    async def question(self, request: web.Request) -> web.StreamResponse:
        return answer(self.questions.look(self._craft(request).name, self._id(request)))

    @route("POST", "/api/crafts/{c}/questions/{id}", "command")
    async def answer_question(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        body = await self._body(request, answer=bool)
        if "answer" not in body:
            raise refusal(400, 'give {"answer": true} or {"answer": false}')
        return answer(self.questions.answer(craft.name, self._id(request), self._user(request), body["answer"]))

    @staticmethod
    def _id(request: web.Request) -> int:
        text = request.match_info["id"]
        return int(text) if text.isdecimal() and len(text) < 19 else -1

    # --- run control ---

    def _flown(self, craft: Spacecraft) -> Any:
        if craft.control is None:
            raise refusal(404, f"{craft.name} has no run control: neither the server nor its co-simulation flies it")
        return craft.control

    @route("GET", "/api/crafts/{c}/run", "view")
    async def run(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        run = self._flown(craft)
        return answer(run.told(craft.state if craft.link is None else "") | {"faults": run.faults()})

    @route("POST", "/api/crafts/{c}/run", "command", RUN)
    async def command_run(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        run = self._flown(craft)
        body = await self._body(request, action=str, seconds=(int, float), speed=(int, float), fault=dict)

        def act() -> dict[str, Any]:
            if fault := body.get("fault"):
                before = run.inject(str(fault.get("path", "")), fault.get("value"))
                self.room.tell(craft.name, "warning", "run", f"{self._user(request)} set {fault.get('path')} to "
                               f"{fault.get('value')}; it was {before}")
            if "action" in body or "speed" in body:
                action, seconds = body.get("action", "pause" if run.paused else "go"), body.get("seconds", 1.0)
                run.command(action, seconds, body.get("speed"))
                if action == "rewind":
                    self.room.tell(craft.name, "warning", "run", f"{self._user(request)} asked the run to go "
                                   f"back to {seconds:g} s")
            told: dict[str, Any] = run.told("")
            self.room.publish("run", craft.name, told)
            return told | {"faults": run.faults()}

        return answer(await self._asked(craft, act))

    # --- this server ---

    @route("GET", "/api/server", "administer")
    async def server(self, _: web.Request) -> web.StreamResponse:
        loop = {"longest_ms": 1000 * self.watch.longest, "recent_ms": 1000 * self.watch.recent,
                "computed_ms": 1000 * self.watch.computed}
        held = {"browsers": len(self.browsers), "limits": self.bounds.told(), "loop": loop}
        return await self._told(lambda: held | {
            "version": __version__, "up_s": time.monotonic() - self._began, "cpu_s": time.process_time(), **memory(),
            "journal": {"bytes": sum(one.stat().st_size for one in self.room.journal.path.parent.glob(
                "journal.sqlite*")), "problem": self.room.journal.problem},
            "disk_bytes": shutil.disk_usage(self.room.settings.folder).total})

    # --- the page, and live ---

    @route("GET", "/", ANYONE)
    async def page(self, _: web.Request) -> web.StreamResponse:
        return self._file(HERE.parent / "console/web/index.html")

    @route("GET", "/assets/{name:[a-z0-9._-]+}", ANYONE)
    async def asset(self, request: web.Request) -> web.StreamResponse:
        from fledge.scene.bundle import folder

        name = request.match_info["name"]
        if Path(name).suffix not in (".js", ".css", ".svg", ".png", ".webp"):
            raise refusal(404, f"there is no {name}")
        return self._file(folder() / name)

    @route("GET", "/api/crafts/{c}/picture", "view")
    async def picture(self, request: web.Request) -> web.StreamResponse:
        craft = self._craft(request)
        if craft.picture is None:
            raise refusal(404, f"{craft.name} has no picture: its mission's folder has none of {', '.join(PICTURES)}")
        return self._file(craft.picture)

    @route("GET", "/api/openapi.yaml", USER)
    async def openapi(self, _: web.Request) -> web.StreamResponse:
        known = {(row.method, row.path): row for one in (self, self.guard) for row, _ in rows(one)}
        return web.Response(text=described((HERE / "api.yaml").read_text(encoding="utf-8"), known),
                            content_type="application/yaml")

    @staticmethod
    def _file(path: Path) -> web.StreamResponse:
        if not path.is_file():
            raise refusal(404, f"{path.name} was not built: ./fledge setup --view builds the console, with Node")
        return web.FileResponse(path, headers={"Cache-Control": "no-cache"})

    @route("GET", "/api/live", "view")
    async def live(self, request: web.Request) -> web.StreamResponse:
        browser = Browser(self, request)
        return await browser.serve()


def _json(content: Any) -> web.Response:
    """An answer; long ones are made in another thread."""
    return web.Response(body=dumps(content).encode(), content_type="application/json")


async def serve(room: Room, ready: Callable[[str], Any], over: asyncio.Event) -> None:
    """Serve a room until `over` is set. ready: gets the address of the page."""
    raise_descriptors()
    server = Server(room)
    runner = await server.guard.listen(server.app)
    try:
        room.start()
        host, port = server.guard.addresses[0][:2]
        scheme = "https" if room.settings.access.certificate else "http"
        ready(f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/")
        await over.wait()
    finally:
        await runner.shutdown()     # aiohttp 3.8 does so only for sites of its own
        await runner.cleanup()
