# SPDX-License-Identifier: Apache-2.0
"""What flight does by its services: files, tables of parameters, stored commands."""
from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from aiohttp import web

from fledge.ground.server.answers import answer, Refusal
from fledge.ground.server.handlers import common
from fledge.ground.server.handlers.common import body_of, id_of, in_thread, patiently, user_of
from fledge.ground.server.routes import route

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.server.web import Server


@route("GET", "/api/crafts/{c}/transfers", "view")
async def transfers(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.journal_rows(request, "transfers", craft.name)


@route("POST", "/api/crafts/{c}/transfers/{id}", "command")
async def transfer(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    body, number = await body_of(request, action=""), id_of(request)
    return answer(await in_thread(craft, lambda: craft.transfers.action(number, body["action"])))


@route("POST", "/api/crafts/{c}/files", "command", body="body of a file")
async def upload(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    name, data = request.query.get("name", ""), await request.read()
    row = await in_thread(craft, lambda: craft.transfers.put(name, data))
    return answer({"id": row["id"]})


@route("POST", "/api/crafts/{c}/fetch", "command")
async def fetch(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    body = await body_of(request, name="")
    row = await in_thread(craft, lambda: craft.transfers.fetch(body["name"]))
    return answer({"id": row["id"]})


@route("POST", "/api/crafts/{c}/directory", "command")
async def directory(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    if not craft.mission or not craft.mission.has("Files"):
        raise Refusal(404, f"the flight software of {craft.name} has no Files")
    body = await body_of(request, path="")
    listing = await in_thread(craft, lambda: craft.transfers.directory(body["path"]))
    return answer({"names": await asyncio.wait_for(asyncio.wrap_future(listing), 6 * common.PATIENCE)})


@route("GET", "/api/crafts/{c}/files", "view")
async def files(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.answer(craft.transfers.files)


@route("GET", "/api/crafts/{c}/files/{name}", "view")
async def file(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    name = request.match_info["name"]
    if name not in [row["name"] for row in await server.aside(craft.transfers.files)]:
        raise Refusal(404, f"there is no file '{name[:80]}'")
    return web.FileResponse(craft.transfers.folder / name, headers={
        "Content-Type": "application/octet-stream", "Content-Disposition": "attachment"})


@route("GET", "/api/crafts/{c}/tables", "view")
async def tables(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.answer(craft.tables.rows)


@route("POST", "/api/crafts/{c}/tables/{name}", "command")
async def table(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    user, name = user_of(request), request.match_info["name"]
    body = await body_of(request, read=bool, values=dict, confirmed=False)
    values = body.get("values")
    row = await in_thread(craft, lambda: craft.tables.read(user, name) if values is None else
                          craft.tables.write(user, name, values, body["confirmed"]))
    return answer({"ids": [row["id"]]})


@route("GET", "/api/crafts/{c}/stored", "view")
async def stored(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.answer(craft.stored.describe)


@route("POST", "/api/crafts/{c}/stored", "command")
async def command_stored(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    body = await body_of(request, list=int, action=str, step=int, time_ns=(int, str), name=str, arguments=dict,
                         confirmed=bool, unchecked=bool)
    row = await patiently(request, craft, lambda: craft.stored.act(user_of(request), body))
    return answer({"ids": [row["id"]]})
