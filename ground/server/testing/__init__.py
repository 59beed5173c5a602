# SPDX-License-Identifier: Apache-2.0
"""What tests of the control room share."""
from __future__ import annotations

import asyncio
from pathlib import Path

from aiohttp.test_utils import TestClient, TestServer

from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.ground.server.web import Server


def response_of(file: Path, method: str, path: str, text: str) -> tuple[int, str]:
    """(status, text) of what a server of a file answers to one request, before its flights begin."""
    async def ask() -> tuple[int, str]:
        room = Room(read(file))
        try:
            async with TestClient(TestServer(Server(room).app)) as client:
                answer = await client.request(method, path, data=text)
                return answer.status, await answer.text()
        finally:
            room.close()

    return asyncio.run(ask())
