# SPDX-License-Identifier: Apache-2.0
"""Spacecraft: their state, parameters and limits, alarms, events, displays."""
from __future__ import annotations

from typing import TYPE_CHECKING

from aiohttp import web

from fledge.ground.server.answers import answer, Refusal
from fledge.ground.server.displays import displays as read_displays
from fledge.ground.server.handlers.common import body_of, in_thread, number_of, slot_of, user_of
from fledge.ground.server.mission import PICTURES
from fledge.ground.server.routes import route

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.server.web import Server


@route("GET", "/api/crafts", "view")
async def crafts(server: Server, request: web.Request) -> web.StreamResponse:
    return answer([craft.describe() for craft in server.room.crafts.values() if server.sees(request, craft.name)])


@route("GET", "/api/crafts/{c}/picture", "view")
async def picture(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    if craft.mission is None or craft.mission.picture is None:
        raise Refusal(404, f"{craft.name} has no picture: its mission's folder has none of {', '.join(PICTURES)}")
    return server.file(craft.mission.picture)


@route("GET", "/api/crafts/{c}/slots", "view")
async def slots(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.answer(craft.telemetry.slots, number_of(request, "first", 0, 0))


@route("GET", "/api/crafts/{c}/missing", "view")
async def missing(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.answer(lambda: craft.telemetry.monitor.missing())


@route("PUT", "/api/crafts/{c}/limits/{slot}", "administer")
async def limits(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    body = await body_of(request, limits=(dict, type(None)), persistence=1)
    slot, levels, persistence = slot_of(request, craft), body.get("limits", {}), body["persistence"]
    if not 1 <= persistence <= 1000:
        raise Refusal(400, f"persistence is from 1 to 1000 values; found {persistence}")
    for level, pair in (levels or {}).items():
        if not isinstance(pair, list) or len(pair) != 2 or not all(
                end is None or isinstance(end, (int, float)) and not isinstance(end, bool) for end in pair):
            raise Refusal(400, f"limits of '{level}' are [low, high], null where open; found {str(pair)[:80]}")
    await in_thread(craft, lambda: craft.limits.change(user_of(request), slot, levels, persistence))
    server.room.publish("slots", craft.name, {"first": slot})
    return answer(craft.telemetry.slots(slot, 1)[0])


@route("GET", "/api/crafts/{c}/displays", "view")
async def displays(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    folders = [server.room.settings.displays]
    if craft.mission and craft.mission.folder:
        folders.append(craft.mission.folder / "displays")
    return await server.answer(lambda: read_displays(folders, craft.telemetry.monitor.slots(0),
                                                     craft.commanding.forms))


@route("GET", "/api/crafts/{c}/alarms", "view")
async def alarms(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.answer(craft.alarms.rows)


@route("POST", "/api/crafts/{c}/alarms/{slot}", "command")
async def alarm(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    body = await body_of(request, acknowledge=False, note="", shelve_s=(int, float))
    name = craft.telemetry.slot_names[slot_of(request, craft)]
    if "shelve_s" in body:
        return answer(await in_thread(craft, lambda: craft.alarms.shelve(name, body["shelve_s"])))
    if not body["acknowledge"]:
        raise Refusal(400, "give {\"acknowledge\": true, \"note\": ...} or {\"shelve_s\": ...}")
    return answer(await in_thread(craft, lambda: craft.alarms.acknowledge(name, user_of(request), body["note"])))


@route("GET", "/api/crafts/{c}/events", "view")
async def events(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    return await server.journal_rows(request, "events", craft.name)


@route("GET", "/api/log", "view")
async def log(server: Server, request: web.Request) -> web.StreamResponse:
    user = request["user"]
    return await server.journal_rows(request, "log", None,
                                     None if user.crafts is None else (sorted(user.crafts), user.name))
