# SPDX-License-Identifier: Apache-2.0
"""The WebSocket of a browser or a script: values, texts and packets as they come. One that reads slowly gets fewer
values, and does not slow the others."""
from __future__ import annotations

import asyncio
import logging
import struct
import time
from collections import deque
from functools import lru_cache
from typing import TYPE_CHECKING

from aiohttp import WebSocketError, WSMsgType, web

from fledge.ground.server.answers import Refusal, dumps
from fledge.ground.server.bounds import Bounds, Recent, bound_socket
from fledge.ground.server.routes import USER, loads, message, rows
from fledge.ground.server.spacecraft import Spacecraft
from fledge.errors import SetupError

if TYPE_CHECKING:
    from aiohttp.http import WebSocketWriter

    from fledge.ground.server.web import Server

FRAME = 32          # [bytes] of a frame without values
FEED_S, FEED_AT_ONCE = 0.05, 1 << 18    # [s] between the packets for a script; [bytes] of them in one text
PAUSE = 0.005, 0.25     # [s] until the next turn of a browser, and of one that does not read
PACKET = 200        # [bytes] that one takes besides its own
SLICE = 0.005       # [s] that browsers are served before the loop does something else
PIECE = 2048        # [bytes] that are parsed before their frames are counted
MESSAGE_TYPES = WSMsgType.TEXT, WSMsgType.BINARY, WSMsgType.PING, WSMsgType.PONG


class _Heads:
    """Counts the frames that begin in bytes as they come, by their heads (RFC 6455, 5.2)."""

    def __init__(self) -> None:
        self._head, self._payload = b"", 0     # [bytes] of the payload that are to come

    def count(self, data: bytes) -> int:
        begun = at = 0
        while at < len(data):
            if self._payload:
                at += (step := min(self._payload, len(data) - at))
                self._payload -= step
                continue
            begun += not self._head
            at += len(part := data[at:at + self._missing()])
            self._head += part
            if not self._missing():
                size = self._head[1] & 127
                end = _LENGTHS.get(size, 0)
                self._payload = int.from_bytes(self._head[2:2 + end], "big") if end else size
                self._head = b""
        return begun

    def _missing(self) -> int:
        """[bytes] of the head that are to come: two, then a longer length and a mask."""
        if len(self._head) < 2:
            return 2 - len(self._head)
        return 2 + _LENGTHS.get(self._head[1] & 127, 0) + 4 * (self._head[1] >> 7) - len(self._head)


_LENGTHS = {126: 2, 127: 8}     # [bytes]


class _Socket(web.WebSocketResponse):
    """A WebSocket that takes a bounded number of frames: aiohttp alone would read and keep any number of empty ones,
    pings and parts of a message, which no count of bytes bounds, and serve no other client meanwhile."""

    def __init__(self, bounds: Bounds) -> None:
        super().__init__(heartbeat=30, autoping=False, max_msg_size=int(bounds["message"]), compress=False)
        self.bounds, self._frames, self._heads = bounds, Recent(), _Heads()

    def _post_start(self, request: web.BaseRequest, protocol: str, writer: WebSocketWriter) -> None:
        whole, early = request.protocol, request.protocol._message_tail
        whole._message_tail = b""
        super()._post_start(request, protocol, writer)
        self._parser = whole._payload_parser
        whole._payload_parser = self        # of the parser in aiohttp 3.11, in C, no function can be replaced
        if early:
            self.feed_data(early)

    def feed_data(self, data: bytes) -> tuple[bool, bytes]:
        """Give bytes to aiohttp's parser, in pieces. Returns whether it takes no more, and what it has left."""
        for at in range(0, len(data), PIECE):
            piece = data[at:at + PIECE]
            many = self.bounds.over("frames", self._frames.count(self._heads.count(piece), time.monotonic()))
            if many and self._reader is not None:
                self._reader.set_exception(WebSocketError(1008, self.bounds.says("frames")))
                return True, b""
            over, rest = self._parser.feed_data(piece)
            if over:
                return over, rest
        return False, b""

    def feed_eof(self) -> None:
        self._parser.feed_eof()


def framed(content: str | bytes) -> bytes:
    """A message as a WebSocket has it."""
    first, body = (0x81, content.encode()) if isinstance(content, str) else (0x82, content)
    size = len(body)
    return (struct.pack("!BB", first, size) if size < 126 else struct.pack("!BBH", first, 126, size)
            if size < 1 << 16 else struct.pack("!BBQ", first, 127, size)) + body


_shared = lru_cache(16)(framed)     # of texts that go to all


class Sender:
    """Serves the browsers for which something is due, in turn, a slice of time at once. Frames that several get are in
    `frames`, for as long as a turn of all lasts."""

    def __init__(self) -> None:
        self.frames: dict[tuple[object, ...], tuple[int, bytes]] = {}
        self._due: deque[Browser] = deque()
        self._wake = asyncio.Event()

    def add(self, browser: Browser) -> None:
        self._due.append(browser)
        self._wake.set()

    async def run(self) -> None:
        """Until it is cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            self._wake.clear()
            await self._wake.wait()
            while self._due:
                end = loop.time() + SLICE
                for _ in range(len(self._due)):
                    browser = self._due.popleft()
                    try:
                        browser.turn(loop.time())
                    except Exception:       # the others are served
                        logging.getLogger("fledge.ground.server").exception("a browser is not served any more")
                        if browser.request.transport:
                            browser.request.transport.abort()
                    if loop.time() >= end:
                        await asyncio.sleep(0)
                        end = loop.time() + SLICE
                self.frames.clear()


class Browser:
    """One WebSocket. It gets a frame of values or texts only when the last one has left, so that no write has to wait,
    as one by aiohttp may."""

    def __init__(self, server: Server, request: web.Request) -> None:
        self.server, self.request, self.bounds = server, request, server.room.bounds
        self.socket = _Socket(self.bounds)
        self.wanted: dict[str, _Subscription] = {}
        self.skipped = self._reported = 0
        self._texts: deque[bytes] = deque()     # framed
        self.waiting_texts = 0  #: [bytes] of them
        self._messages = Recent()  # its messages
        self._pause, self._queued = PAUSE[0], False
        self._timer: asyncio.TimerHandle | None = None
        self._feeds: dict[str, _PacketFeed] = {}

    def put(self, text: str) -> None:
        frame = _shared(text)
        waits = self.waiting_texts + len(frame)
        if self.bounds.over("texts of a socket", waits) or self._texts and self.server.crowded:
            self.skipped += len(self._texts)    # it has to ask again for what these lists have
            self._texts.clear()
            self.waiting_texts = 0
        self._texts.append(frame)
        self.waiting_texts += len(frame)
        if not self._timer or self._pause == PAUSE[0]:      # else it does not read, and is looked at later
            self.wake()

    def wake(self) -> None:
        """Let it be served at once."""
        if self._timer:
            self._timer.cancel()
            self._timer = None
        if not self._queued:
            self._queued = True
            self.server.sender.add(self)

    @property
    def waiting(self) -> int:
        """[bytes] that wait for it."""
        transport = self.request.transport
        return self.waiting_texts + self.waiting_packets + (transport.get_write_buffer_size() if transport else 0)

    @property
    def waiting_packets(self) -> int:
        return sum(feed.waiting for feed in self._feeds.values())

    async def serve(self) -> web.WebSocketResponse:
        await self.socket.prepare(self.request)
        transport = self.request.transport
        if transport is None:
            return self.socket
        bound_socket(transport, self.bounds["unread"])
        self.server.browsers.add(self)
        try:
            async for message in self.socket:
                if message.type in MESSAGE_TYPES and self.bounds.over(
                        "messages", self._messages.count(1, time.monotonic())):
                    await self.socket.close(code=1008, message=self.bounds.says("messages").encode())
                    break
                if message.type == WSMsgType.PING:
                    await self.socket.pong(message.data)
                elif message.type == WSMsgType.TEXT:
                    try:
                        self._take(message.data)
                    except (SetupError, Refusal) as error:
                        why = error.why if isinstance(error, Refusal) else str(error)
                        self.put(dumps({"kind": "refused", "error": why}))
                await asyncio.sleep(0)      # others are served between two messages
        finally:
            self.server.browsers.discard(self)
            if self._timer:
                self._timer.cancel()
            for feed in self._feeds.values():
                feed.craft.telemetry.sinks.remove(feed.take)
        return self.socket

    def _take(self, text: str) -> None:
        """What the browser asks for. Raises SetupError and Refusal."""
        try:
            message = loads(text)
        except ValueError as error:
            raise SetupError(f"a message is JSON: {error}") from None
        entry = MESSAGES.get(next(iter(message)), None) if isinstance(message, dict) and len(message) == 1 else None
        content = next(iter(message.values())) if entry else None
        name = content.get("craft") if isinstance(content, dict) else content
        if not entry or not isinstance(name, str):
            raise SetupError('a message is {"subscribe": {"craft": ..., "slots": [...], "hz": 10}}, '
                             '{"unsubscribe": ...} or {"subscribe_packets": ...}')
        row, handler = entry
        handler(self, self.server.seen(self.request, name, row) if row.craft else name, content)
        self.wake()

    @message("unsubscribe", USER, craft="")
    def _unsubscribe(self, name: str, _: object) -> None:
        self.wanted.pop(name, None)

    @message("subscribe_packets", "view")
    def _subscribe_packets(self, craft: Spacecraft, _: object) -> None:
        if craft.name not in self._feeds:
            self._feeds[craft.name] = _PacketFeed(craft, self.server)
            craft.telemetry.sinks.append(self._feeds[craft.name].take)

    @message("subscribe", "view")
    def _subscribe(self, craft: Spacecraft, content: object) -> None:
        if not isinstance(content, dict):
            raise SetupError('subscribe is {"craft": ..., "slots": [...], "hz": 10}')
        slots, hz = content.get("slots", []), content.get("hz", 10)
        if isinstance(slots, list) and self.bounds.over("values of a subscription", len(slots)):
            raise SetupError(self.bounds.says("values of a subscription"))
        if slots != "all" and not (isinstance(slots, list) and all(
                isinstance(slot, int) and not isinstance(slot, bool) and 0 <= slot < 2**32 for slot in slots)):
            raise SetupError("slots are \"all\" or numbers")
        if not isinstance(hz, (int, float)) or isinstance(hz, bool) or not 0.01 <= hz <= 60:
            raise SetupError("hz is from 0.01 to 60")
        packed = None if slots == "all" else struct.pack(f"<{len(slots)}I", *slots)
        self.wanted[craft.name] = _Subscription(craft, packed, 1 / hz, bool(content.get("truth")))

    def turn(self, now: float) -> None:
        """Write what is due, and set the time of the next turn."""
        transport, self._queued = self.request.transport, False
        if not transport or transport.is_closing() or self.socket.closed or self not in self.server.browsers:
            return
        free = not transport.get_write_buffer_size()
        self._pause = PAUSE[0] if free else min(2 * self._pause, PAUSE[1])     # one that does not read costs little
        self._values(now, transport)
        if free and self.skipped != self._reported:
            self._reported = self.skipped
            self._texts.appendleft(frame := framed(dumps({"kind": "skipped", "count": self.skipped})))
            self.waiting_texts += len(frame)
        for feed in list(self._feeds.values()):
            if now >= feed.due and not transport.get_write_buffer_size():
                transport.write(framed(feed.text()))
                feed.due = now + FEED_S * (not feed.waiting)
        while self._texts and not transport.get_write_buffer_size():
            self.waiting_texts -= len(frame := self._texts.popleft())
            transport.write(frame)
        due = [source.due for source in self.wanted.values()] + [source.due for source in self._feeds.values()]
        if due or self._texts:
            wait = 0 if self._texts else min(due) - now
            self._timer = asyncio.get_running_loop().call_later(max(wait, self._pause), self.wake)

    def _values(self, now: float, transport: asyncio.Transport) -> None:
        frames = self.server.sender.frames
        key: tuple[object, ...]
        for name, wanted in list(self.wanted.items()):
            if now < wanted.due:
                continue
            # Those of one rate are due together, and get the same frame.
            wanted.due = wanted.period * ((now / wanted.period + 0.1) // 1 + 1)
            if self.server.room.crafts.get(name) is not wanted.craft:
                self.wanted.pop(name, None)
                continue
            if wanted.truth and not transport.get_write_buffer_size():
                key = wanted.craft.feed, wanted.number
                if key not in frames:
                    number, texts = wanted.craft.feed.since(wanted.number)
                    frames[key] = number, b"".join(framed(dumps(text)) for text in texts)
                wanted.number, frame = frames[key]
                transport.write(frame)
            monitor = wanted.craft.telemetry.monitor
            if monitor is not wanted.monitor:      # another database: all anew
                wanted.monitor, wanted.version = monitor, 0
            if transport.get_write_buffer_size():
                self.skipped += monitor.version != wanted.version
                continue
            if (key := (wanted.craft, monitor, wanted.version, wanted.slots)) not in frames:
                frames[key] = wanted.frame()
            wanted.version, frame = frames[key]
            transport.write(frame)


MESSAGES = {row.path: (row, handler) for row, handler in rows(Browser)}


class _PacketFeed:
    """The packets of a spacecraft for a script: all of them, unless it is too slow."""

    def __init__(self, craft: Spacecraft, server: Server) -> None:
        self.craft, self.due, self._server, self._dropped = craft, 0.0, server, 0
        self._rows: deque[tuple[int, int, bytes]] = deque()
        self._in = self._out = 0    # [bytes] since it began; each by one thread alone

    def take(self, rows: list[tuple[int, int, bytes]]) -> None:
        """In the spacecraft's thread."""
        size = sum(len(packet) + PACKET for _, _, packet in rows)
        if self._server.room.bounds.over("packets of a socket", self.waiting + size) or self._server.crowded:
            self._dropped += len(rows)
        else:
            self._rows.extend(rows)
            self._in += size

    @property
    def waiting(self) -> int:
        return self._in - self._out

    def text(self) -> str:
        """What has come since the last one."""
        rows, end = [], self._out + FEED_AT_ONCE
        while self._rows and self._out < end:
            rows.append(self._rows.popleft())
            self._out += len(rows[-1][2]) + PACKET
        clock = self.craft.clock
        now = clock.now if clock.simulated else max(clock.now, time.time_ns())
        return dumps({"kind": "packets", "craft": self.craft.name, "t_ns": str(now), "dropped": self._dropped,
                      "packets": [[str(t), packet.hex()] for t, _, packet in rows]})


class _Subscription:
    def __init__(self, craft: Spacecraft, slots: bytes | None, period: float, truth: bool) -> None:
        self.craft, self.slots, self.period, self.truth = craft, slots, period, truth
        self.monitor = craft.telemetry.monitor
        self.version, self.number, self.due = 0, 0, 0.0

    def frame(self) -> tuple[int, bytes]:
        """(version, the frame of what has come since the last one), empty if other slots have changed."""
        if self.monitor.version == self.version:
            return self.version, b""
        version, frame = self.monitor.changes(self.version, self.slots)
        if len(frame) == FRAME:
            return version, b""
        numbered = bytearray(frame)
        struct.pack_into("<I", numbered, 4, self.craft.index)
        return version, framed(bytes(numbered))
