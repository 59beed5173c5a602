# SPDX-License-Identifier: Apache-2.0
"""What flight does by its services: files, tables of parameters, stored commands."""
from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from aiohttp import web

from fledge.ground.server.answers import answer, Refusal
from fledge.ground.server.handlers import common
from fledge.ground.server.handlers.common import body_of, id_of, in_thread, patiently, user_of
from fledge.ground.server.openapi import (
    BYTES, EMPTY, FLAG, ID, IDS, LIST, MAYBE_TIME, OBJECT, OFF, TEXT, TEXTS, TIME, WHOLE, array, described, enum,
    nullable, object_of)
from fledge.ground.server.routes import route

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.server.web import Server


@route("GET", "/api/crafts/{c}/transfers", "view", answers=array("Transfer"), query=LIST)
async def transfers(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Files that go or went, the newest first."""
    return await server.journal_rows(request, "transfers", craft.name)


@route("POST", "/api/crafts/{c}/transfers/{id}", "command", answers="Transfer",
       takes=object_of(action=enum("cancel", "suspend", "resume")))
async def transfer(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """What to do with a transfer."""
    body, number = await body_of(request), id_of(request)
    return answer(await in_thread(craft, lambda: craft.transfers.action(number, body["action"])))


@route("POST", "/api/crafts/{c}/files", "command", body="body of a file", answers=ID,
       query=object_of(name=described(TEXT, "on board")), takes={"application/octet-stream": BYTES})
async def upload(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Send a file to the spacecraft."""
    name, data = request.query.get("name", ""), await request.read()
    row = await in_thread(craft, lambda: craft.transfers.put(name, data))
    return answer({"id": row["id"]})


@route("POST", "/api/crafts/{c}/fetch", "command", answers=ID, takes=object_of(name=TEXT))
async def fetch(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Get a file from the spacecraft."""
    body = await body_of(request)
    row = await in_thread(craft, lambda: craft.transfers.fetch(body["name"]))
    return answer({"id": row["id"]})


@route("POST", "/api/crafts/{c}/directory", "command", answers=object_of(closed=True, names=TEXTS),
       takes=object_of("path", path=EMPTY))
async def directory(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The names of files on board, by a request to the spacecraft."""
    if not craft.mission or not craft.mission.has("Files"):
        raise Refusal(404, f"the flight software of {craft.name} has no Files")
    body = await body_of(request)
    listing = await in_thread(craft, lambda: craft.transfers.directory(body["path"]))
    return answer({"names": await asyncio.wait_for(asyncio.wrap_future(listing), 6 * common.PATIENCE)})


@route("GET", "/api/crafts/{c}/files", "view", answers=array(object_of(closed=True, name=TEXT, size=WHOLE, t_ns=TIME)))
async def files(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Files that came down."""
    return await server.answer(craft.transfers.files)


@route("GET", "/api/crafts/{c}/files/{name}", "view", answers={"application/octet-stream": BYTES})
async def file(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The bytes of a file that came down."""
    name = request.match_info["name"]
    if name not in [row["name"] for row in await server.aside(craft.transfers.files)]:
        raise Refusal(404, f"there is no file '{name[:80]}'")
    return web.FileResponse(craft.transfers.folder / name, headers={
        "Content-Type": "application/octet-stream", "Content-Disposition": "attachment"})


@route("GET", "/api/crafts/{c}/tables", "view", answers=array("Table"))
async def tables(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Parameters on board, by module."""
    return await server.answer(craft.tables.rows)


@route("POST", "/api/crafts/{c}/tables/{name}", "command", answers=IDS, takes=object_of(
    "read values confirmed", read=FLAG, values=OBJECT, confirmed=OFF))
async def table(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Read the parameters of a module from on board, or write some."""
    user, name = user_of(request), request.match_info["name"]
    body = await body_of(request)
    values = body.get("values")
    row = await in_thread(craft, lambda: craft.tables.read(user, name) if values is None else
                          craft.tables.write(user, name, values, body["confirmed"]))
    return answer({"ids": [row["id"]]})


@route("GET", "/api/crafts/{c}/stored", "view", answers=object_of(
    "flight_ns next_ns stored released skipped", closed=True, text=TEXT, lists=array("Stored"), flight_ns=TIME,
    next_ns=MAYBE_TIME, stored=nullable(WHOLE), released=nullable(WHOLE), skipped=nullable(WHOLE)))
async def stored(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Stored commands and sequences."""
    return await server.answer(craft.stored.describe)


@route("POST", "/api/crafts/{c}/stored", "command", answers=IDS, takes=object_of(
    "action step time_ns name arguments confirmed unchecked", list=WHOLE, action=TEXT, step=WHOLE, time_ns=TIME,
    name=TEXT, arguments=OBJECT, confirmed=FLAG, unchecked=FLAG))
async def command_stored(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Command a list."""
    body = await body_of(request)
    row = await patiently(request, craft, lambda: craft.stored.act(user_of(request), body))
    return answer({"ids": [row["id"]]})
