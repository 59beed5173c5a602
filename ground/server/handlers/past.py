# SPDX-License-Identifier: Apache-2.0
"""What has come: packets, sessions, values of the past and replays; the 3-D scene, and passes."""
from __future__ import annotations

from typing import TYPE_CHECKING

from aiohttp import web

from fledge.errors import SetupError
from fledge.ground.server.answers import PART, answer, in_binary, in_csv, in_json, json_answer, Refusal
from fledge.ground.server.handlers.common import body_of, number_of, user_of
from fledge.ground.server.openapi import (
    BEFORE_NS, BYTES, FROM_ZERO, LIMIT, NATURAL, OBJECT, TEXT, TIME, WHOLE, array, described, enum, object_of, ref)
from fledge.ground.server.routes import route

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.server.web import Server

SESSION = WHOLE | {"minimum": -1, "default": -1}


@route("POST", "/api/crafts/{c}/inspect", "view", logged=False, answers="Inspection", takes=object_of(hex=TEXT))
async def inspect(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The values of a packet of given bytes, with the place of each."""
    body = await body_of(request)
    try:
        packet = bytes.fromhex(body["hex"])
    except ValueError:
        raise Refusal(400, "hex has hexadecimal digits, two a byte") from None
    return answer(await server.aside(craft.telemetry.inspect, packet))


@route("GET", "/api/crafts/{c}/packets", "view", answers=array("Packet"), query=object_of(
    "before_ns limit container undecoded", before_ns=BEFORE_NS, limit=LIMIT, container=described(TEXT, "its path"),
    undecoded=described(enum("0", "1"), "1: only these")))
async def packets(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Packets, the newest first."""
    before = number_of(request, "before_ns", 2**63 - 1)
    limit = min(number_of(request, "limit", 200, 1), 1000)
    return await server.query(lambda: json_answer(craft.past.packet_list(
        before, limit, request.query.get("container"), request.query.get("undecoded") == "1")))


@route("GET", "/api/crafts/{c}/packets/{id}", "view", answers="Inspection")
async def packet(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """A packet with the place of each value."""
    words = await server.query(lambda: craft.past.packet_of(request.match_info["id"]))
    if words is None:
        raise Refusal(404, f"{craft.name} has no packet {request.match_info['id'][:60]}")
    return answer(words)


@route("GET", "/api/crafts/{c}/scene", "view", answers={"application/octet-stream": BYTES})
async def scene(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """What does not move in the view in 3-D, for its page."""
    try:
        return web.Response(body=await server.aside(craft.feed.pack), content_type="application/octet-stream")
    except SetupError as error:
        raise Refusal(404, str(error)) from None


@route("GET", "/api/crafts/{c}/passes", "view", answers=described(
    array("Pass"), "soonest first; without rise_ns it is in view already"))
async def passes(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The passes of the coming day over the stations of its mission, predicted by two bodies and J2."""
    zero = 0 if craft.clock.simulated else craft.epoch_ns or 0

    def ns(t: float | None) -> str | None:
        return None if t is None else str(zero + round(1e9 * t))

    return answer([{"station": row["station"], "elevation": row["elevation"], "rise_ns": ns(row["rise"]),
                    "highest_ns": ns(row["highest"]), "set_ns": ns(row["set"])}
                   for row in await server.aside(craft.contacts.passes)])


def _archived(craft: Spacecraft) -> None:
    if craft.telemetry.history is None:
        raise Refusal(404, f"{craft.name} has no archive of its own")


@route("GET", "/api/crafts/{c}/sessions", "view", answers=array("Stretch"))
async def sessions(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The stretches of the archive whose times do not step back."""
    _archived(craft)
    return await server.query(lambda: json_answer(craft.past.sessions()))


@route("GET", "/api/crafts/{c}/history", "view", query=object_of(
    "from_ns to_ns points session format", names=described(TEXT, "names with commas between"), from_ns=TIME, to_ns=TIME,
    points=described(NATURAL | {"default": 2000},
                     "at most so many, each the last value and the extremes of its stretch; 0: all values"),
    session=described(SESSION, "-1: the newest"), format=enum("json", "csv", "binary") | {"default": "json"}),
    answers={"application/json": OBJECT | {"additionalProperties": ref("Series")}, "text/csv": TEXT,
             "application/octet-stream": BYTES})
async def history(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Parameters back in time."""
    _archived(craft)
    names = list(dict.fromkeys(word for word in request.query.get("names", "").split(",") if word))
    if server.bounds.over("names of a query", len(names)) or not names:
        raise Refusal(400, f"{server.bounds.says('names of a query')}; found {len(names)}")
    begin, end, points, session = (number_of(request, key, default, least) for key, default, least in (
        ("from_ns", 0, -2**63), ("to_ns", 2**63 - 1, -2**63), ("points", 2000, 0), ("session", -1, -1)))
    form = request.query.get("format", "json")
    if form not in ("json", "csv", "binary"):
        raise Refusal(400, f"format is json, csv or binary; found '{form[:40]}'")

    series = await server.query(lambda: craft.past.series(names, begin, end, points, session, form != "binary"))
    kind, parts = {"json": ("application/json", in_json), "csv": ("text/csv", in_csv),
                   "binary": ("application/octet-stream", in_binary)}[form]
    headers = {"Content-Type": kind} | ({"Content-Disposition": "attachment; filename=history.csv"}
                                        if form == "csv" else {})
    n, user, reads = sum(len(series_[0]) for series_ in series.values()), user_of(request), server.reads
    if n <= PART:
        return web.Response(body=await server.aside(lambda: b"".join(parts(series))), headers=headers)
    for bound, held in (("values read by a user", reads[user]), ("values read", reads.total())):
        if server.bounds.over(bound, held + n):
            raise Refusal(429, server.bounds.says(bound))
    reads[user] += n
    try:    # in parts, so that neither the loop nor the memory has a whole one
        response, rest = web.StreamResponse(headers=headers), parts(series)
        await response.prepare(request)
        while part := await server.aside(lambda: next(rest, b"")):
            await response.write(part)
    finally:
        reads[user] -= n
    return response


@route("POST", "/api/crafts/{c}/replay", "view", answers="Craft", takes=object_of(
    "session from_ns to_ns speed", session=SESSION, from_ns=TIME, to_ns=TIME, speed=FROM_ZERO | {"default": 1.0}))
async def replay(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Show a part of the archive again, as a spacecraft of its own."""
    from fledge.ground.server.replay import Replay

    _archived(craft)
    body = await body_of(request)
    room = server.room
    try:
        begin, end = int(body.get("from_ns", 0)), int(body.get("to_ns", 2**63 - 1))
    except ValueError:
        raise Refusal(400, "from_ns and to_ns are whole numbers") from None
    if not -2**63 <= begin <= end < 2**63:
        raise Refusal(400, "from_ns comes before to_ns")
    session = body["session"]
    if not -1 <= session < 2**31:
        raise Refusal(400, f"session is a number of the list of sessions, or -1 for the newest; found {session}")
    async with server.replaying:
        if server.bounds.over("replays", 1 + room.replays):
            raise Refusal(409, server.bounds.says("replays"))
        further = await server.aside(lambda: Replay(room, craft, session, begin, end, body["speed"]))
        room.add(further)
    further.start()
    room.publish("crafts", "", {})
    return answer(further.describe())


@route("DELETE", "/api/crafts/{c}/replay", "view")
async def end_replay(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """End a replay, which is the spacecraft."""
    if not craft.source:
        raise Refusal(409, f"{craft.name} is no replay")
    await server.aside(server.room.remove, craft.name)
    return answer({})
