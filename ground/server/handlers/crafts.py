# SPDX-License-Identifier: Apache-2.0
"""Spacecraft: their state, parameters and limits, alarms, events, displays."""
from __future__ import annotations

from typing import TYPE_CHECKING

from aiohttp import web

from fledge.ground.server.answers import answer, Refusal
from fledge.ground.server.displays import displays as read_displays
from fledge.ground.server.handlers.common import body_of, in_thread, number_of, slot_of, user_of
from fledge.ground.server.mission import PICTURES
from fledge.ground.server.openapi import (
    BYTES, EMPTY, FROM_ZERO, LIMITS_OR_NULL, LIST, NATURAL, OFF, WHOLE, array, described, object_of)
from fledge.ground.server.routes import route

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.server.web import Server


@route("GET", "/api/crafts", "view", answers=array("Craft"))
async def crafts(server: Server, request: web.Request) -> web.StreamResponse:
    """The spacecraft that the user may see."""
    return answer([craft.describe() for craft in server.room.crafts.values() if server.sees(request, craft.name)])


@route("GET", "/api/crafts/{c}/picture", "view", answers={f"image/{kind}": BYTES for kind in ("webp", "png", "jpeg")})
async def picture(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The picture in its mission's folder."""
    if craft.mission is None or craft.mission.picture is None:
        raise Refusal(404, f"{craft.name} has no picture: its mission's folder has none of {', '.join(PICTURES)}")
    return server.file(craft.mission.picture)


@route("GET", "/api/crafts/{c}/slots", "view", answers=array("Slot"),
       query=object_of("first", first=described(NATURAL, "from this slot on")))
async def slots(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The parameters, by the number that values have over the WebSocket."""
    return await server.answer(craft.telemetry.slots, number_of(request, "first", 0, 0))


@route("GET", "/api/crafts/{c}/missing", "view", answers=described(
    array(array(NATURAL) | {"minItems": 2, "maxItems": 2}), "the first and the last of each stretch"))
async def missing(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The parameters that no packet has brought yet, in stretches of their numbers."""
    return await server.answer(lambda: craft.telemetry.monitor.missing())


@route("PUT", "/api/crafts/{c}/limits/{slot}", "administer", answers="Slot", takes=object_of(
    "limits persistence", limits=LIMITS_OR_NULL, persistence=WHOLE | {"minimum": 1, "maximum": 1000, "default": 1}))
async def limits(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Other limits of a parameter, by an administrator, which are kept; null: the database's again."""
    body = await body_of(request)
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


@route("GET", "/api/crafts/{c}/displays", "view", answers=array("Display"))
async def displays(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The displays of the mission."""
    folders = [server.room.settings.displays]
    if craft.mission and craft.mission.folder:
        folders.append(craft.mission.folder / "displays")
    return await server.answer(lambda: read_displays(folders, craft.telemetry.monitor.slots(0),
                                                     craft.commanding.forms))


@route("GET", "/api/crafts/{c}/alarms", "view", answers=array("Alarm"))
async def alarms(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Open alarms: parameters out of limits, or back in them and not yet acknowledged."""
    return await server.answer(craft.alarms.rows)


@route("POST", "/api/crafts/{c}/alarms/{slot}", "command", answers="Alarm", takes=object_of(
    "acknowledge note shelve_s", acknowledge=OFF, note=EMPTY, shelve_s=FROM_ZERO))
async def alarm(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Acknowledge or shelve an alarm."""
    body = await body_of(request)
    name = craft.telemetry.slot_names[slot_of(request, craft)]
    if "shelve_s" in body:
        return answer(await in_thread(craft, lambda: craft.alarms.shelve(name, body["shelve_s"])))
    if not body["acknowledge"]:
        raise Refusal(400, "give {\"acknowledge\": true, \"note\": ...} or {\"shelve_s\": ...}")
    return answer(await in_thread(craft, lambda: craft.alarms.acknowledge(name, user_of(request), body["note"])))


@route("GET", "/api/crafts/{c}/events", "view", answers=array("Event"), query=LIST)
async def events(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """What happened, the newest first."""
    return await server.journal_rows(request, "events", craft.name)


@route("GET", "/api/log", "view", answers=array("Entry"), query=LIST)
async def log(server: Server, request: web.Request) -> web.StreamResponse:
    """What operators did, the newest first; of a user's spacecraft, and what he did himself."""
    user = request["user"]
    return await server.journal_rows(request, "log", None,
                                     None if user.crafts is None else (sorted(user.crafts), user.name))
