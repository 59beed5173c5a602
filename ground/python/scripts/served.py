# SPDX-License-Identifier: Apache-2.0
"""The link to a spacecraft of a control room's server: `http://127.0.0.1:8080/imager`. The server numbers the commands,
logs them, and has their stages, as those of its own users."""
from __future__ import annotations

import asyncio
import json
import os
import time
from collections.abc import Awaitable
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any, TypeVar
from urllib.parse import unquote, urlsplit

from aiohttp import ClientError, ClientSession

from fledge.commands import Dictionary, Timed
from fledge.commands.fields import place_of
from fledge.errors import Failure, SetupError
from fledge.ground.scripts.links import Link
from fledge.loopback import is_loopback

PATIENCE = 60.0         # [s] for an answer of the server
POLL = 0.5              # [s] between requests for the answer of an operator
TOKEN = "FLEDGE_TOKEN"  # environment variable with the script's token (`fledge ground token`)

Answer = TypeVar("Answer")


class Served(Link):
    """The clock is the spacecraft's: simulated time, or since the link was opened. Raises SetupError."""

    numbers = True

    def __init__(self, address: str, token: str | None = None) -> None:
        parts = urlsplit(address)
        self._server, self._name = f"{parts.scheme}://{parts.netloc}", unquote(parts.path.strip("/"))
        self._token = token or os.environ.get(TOKEN, "")
        if self._token and parts.scheme != "https" and not is_loopback(parts.hostname or ""):
            raise SetupError(f"{address}: a token passes there so that others may read it; use https://, or an SSH "
                             "tunnel to localhost")
        self._queue: SimpleQueue[dict[str, Any] | None] = SimpleQueue()
        self._begin = self._t = 0
        self._csrf = ""
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        try:
            self._call(self._open())
        except BaseException:
            self.close()
            raise

    @property
    def t(self) -> int:
        return self._t - self._begin

    def send(self, packet: bytes) -> bytes:
        """Returns the packet with the server's number."""
        return bytes.fromhex(self._call(self._post(f"crafts/{self._name}/raw", hex=packet.hex(),
                                                   confirmed=self.confirmed, unchecked=self.unchecked))["hex"])

    def receive(self, until: int) -> list[Timed]:
        while self.t < until:
            try:
                message = self._queue.get(timeout=PATIENCE)
            except Empty:
                raise ConnectionError(f"the server has said nothing for {PATIENCE:g} s") from None
            if message is None:
                raise ConnectionError("the server has closed the connection")
            if message["kind"] == "refused":
                raise ConnectionError(f"the server refused: {message['error']}")
            self.dropped = message["dropped"]
            self._t = max(self._t, int(message["t_ns"]))
            if message["packets"]:
                return [Timed(int(t) - self._begin, bytes.fromhex(packet)) for t, packet in message["packets"]]
        return []

    def ask(self, question: str) -> tuple[bool, str]:
        """Ask the operators of the server's console: (the answer, the operator). Waits for it."""
        here = f"crafts/{self._name}/questions"
        number = self._call(self._post(here, text=question))["id"]
        while (row := self._call(self._get(f"{here}/{number}")))["answer"] is None:
            time.sleep(POLL)
        return row["answer"], f"by {row['by']}"

    def close(self) -> None:
        if self._loop.is_closed():
            return
        try:
            self._call(self._shut())
        except (OSError, Failure, SetupError):
            pass
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    # --- in the thread of the connection ---

    def _call(self, request: Awaitable[Answer]) -> Answer:
        async def patiently() -> Answer:
            return await asyncio.wait_for(request, PATIENCE)

        try:
            return asyncio.run_coroutine_threadsafe(patiently(), self._loop).result()
        except (ClientError, asyncio.TimeoutError) as error:
            raise ConnectionError(f"{self._server}: {error or 'no answer'}") from None

    async def _open(self) -> None:
        self._session = ClientSession(headers={"Authorization": f"Bearer {self._token}"} if self._token else {},
                                      trust_env=False)
        self._csrf = (await self._get("session"))["csrf"]
        crafts = await self._get("crafts")
        craft = place_of(crafts, [row["name"] for row in crafts], self._name, "spacecraft", self._server)[1]
        self._t = int(craft["t_ns"])
        self.dictionary = Dictionary.read(json.dumps(await self._get(f"crafts/{self._name}/dictionary")), self._name)
        self._socket = await self._session.ws_connect(f"{self._server}/api/live", heartbeat=30)
        await self._socket.send_json({"subscribe_packets": self._name})
        self._reader = asyncio.ensure_future(self._read())
        first = await asyncio.get_running_loop().run_in_executor(None, self._queue.get, True, PATIENCE)
        if first is None or first["kind"] == "refused":
            raise SetupError(f"{self._server}: {first['error'] if first else 'the connection was closed'}")
        self._t = int(first["t_ns"])
        self._begin = self._t if craft["clock"] == "utc" else 0
        if first["packets"]:
            self._queue.put(first)

    async def _read(self) -> None:
        async for message in self._socket:
            content = json.loads(message.data) if isinstance(message.data, str) else {"kind": ""}
            if content["kind"] in ("packets", "refused"):
                self._queue.put(content)
        self._queue.put(None)

    async def _get(self, path: str) -> Any:
        async with self._session.get(f"{self._server}/api/{path}", allow_redirects=False) as answer:
            return await self._answer(answer)

    async def _post(self, path: str, **content: Any) -> Any:
        async with self._session.post(f"{self._server}/api/{path}", json=content, allow_redirects=False,
                                      headers={"X-Fledge-CSRF": self._csrf}) as answer:
            return await self._answer(answer)

    async def _answer(self, answer: Any) -> Any:
        text = await answer.text()
        try:
            content = json.loads(text)
        except ValueError:
            raise SetupError(f"{self._server} is no server of a control room") from None
        if answer.status != 200:
            why = content.get("error", "") if isinstance(content, dict) else ""
            raise Failure(f"{self._server} refused: {why or answer.status}"
                          + f"; the variable {TOKEN} has a script's token" * (answer.status == 401), 1)
        return content

    async def _shut(self) -> None:
        if hasattr(self, "_reader"):
            self._reader.cancel()
            await self._socket.close()
        await self._session.close()
