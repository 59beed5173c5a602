# SPDX-License-Identifier: Apache-2.0
"""The console's pages and their WebSocket, the description of the interface, and the state of the server itself."""
from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING

from aiohttp import web

from fledge import __version__
from fledge.ground.server.answers import Refusal
from fledge.ground.server.bounds import memory
from fledge.ground.server.live import Browser
from fledge.ground.server.openapi import TEXT, document
from fledge.ground.server.routes import ANYONE, USER, route

if TYPE_CHECKING:
    from fledge.ground.server.web import Server

SERVER = Path(__file__).parents[1]


@route("GET", "/api/server", "administer", answers="Server")
async def state(server: Server, _: web.Request) -> web.StreamResponse:
    """The limits of the server and what is in use; how long its event loop was blocked."""
    held, room = server.describe(), server.room
    return await server.answer(lambda: held | {
        "version": __version__, "up_s": time.monotonic() - server.began, "cpu_s": time.process_time(), **memory(),
        "journal": {"bytes": sum(path.stat().st_size for path in room.journal.path.parent.glob("journal.sqlite*")),
                    "problem": room.journal.problem},
        "disk_bytes": shutil.disk_usage(room.settings.folder).total})


@route("GET", "/", ANYONE)
async def page(server: Server, _: web.Request) -> web.StreamResponse:
    return server.file(SERVER.parent / "console/web/index.html")


@route("GET", "/assets/{name:[a-z0-9._-]+}", ANYONE)
async def asset(server: Server, request: web.Request) -> web.StreamResponse:
    from fledge.scene.bundle import folder

    name = request.match_info["name"]
    if Path(name).suffix not in (".js", ".css", ".svg", ".png", ".webp"):
        raise Refusal(404, f"there is no {name}")
    return server.file(folder() / name)


@route("GET", "/api/openapi.yaml", USER, answers={"application/yaml": TEXT})
async def openapi(_: Server, request: web.Request) -> web.StreamResponse:
    """This document."""
    rows = [getattr(entry.handler, "row") for entry in request.app.router.routes()]
    return web.Response(text=json.dumps(document(rows), indent=1), content_type="application/yaml")     # JSON is YAML


@route("GET", "/api/live", "view")
async def live(server: Server, request: web.Request) -> web.StreamResponse:
    return await Browser(server, request).serve()
