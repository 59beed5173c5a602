# SPDX-License-Identifier: Apache-2.0
"""Commands: their forms, bytes and stages; packets of scripts, and the scripts' questions to operators."""
from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from aiohttp import web

from fledge.ground.server.answers import answer, Refusal
from fledge.ground.server.commanding import Hazardous
from fledge.ground.server.handlers import common
from fledge.ground.server.handlers.common import body_of, id_of, in_thread, patiently, user_of
from fledge.ground.server.openapi import FLAG, ID, LIST, OBJECT, OFF, TEXT, array, described, object_of
from fledge.ground.server.questions import LONGEST
from fledge.ground.server.routes import route

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.server.web import Server

ARGUMENTS = described(OBJECT | {"default": {}}, "values by the names of the form")


@route("GET", "/api/crafts/{c}/commands", "view", answers=array("Form"))
async def commands(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The forms of commands."""
    return await server.answer(lambda: craft.commanding.forms)


@route("POST", "/api/crafts/{c}/preview", "view", logged=False, answers="Preview",
       takes=object_of("arguments", name=TEXT, arguments=ARGUMENTS))
async def preview(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The bytes of a command, which is not sent."""
    body = await body_of(request)
    return answer(await server.aside(lambda: craft.commanding.preview(**body)))


@route("POST", "/api/crafts/{c}/send", "command", answers=ID, takes=object_of(
    "arguments confirmed unchecked", name=TEXT, arguments=ARGUMENTS, confirmed=OFF,
    unchecked=described(OFF, "its constraints are not checked, where they may be suspended")))
async def send(_: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Send a command."""
    body = await body_of(request)
    row = await patiently(request, craft, lambda: craft.commanding.send(user_of(request), **body))
    return answer({"id": row["id"]})


@route("POST", "/api/crafts/{c}/raw", "command", takes=object_of(
    "confirmed unchecked", hex=TEXT, confirmed=described(OFF, "needed if it is hazardous"), unchecked=OFF),
    answers=object_of(hex=described(TEXT, "of the packet as it was sent")))
async def raw(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Send a packet that a script has made; it gets the next number."""
    body = await body_of(request)
    opened = await in_thread(craft, lambda: craft.connection.craft)     # in its thread, which opens the link first
    if opened is None:
        raise Refusal(409, f"{craft.name} takes no packets now: {craft.connection.state}")
    flight = opened
    try:
        packet = bytes.fromhex(body["hex"])
    except ValueError:
        packet = b""
    if not 8 <= len(packet) <= 1 << 16:
        raise Refusal(400, "hex has the digits of a packet of 8 to 65536 bytes")
    if not body["confirmed"] and (why := await server.aside(craft.commanding.hazard, packet)):
        raise Hazardous(f"{why}; a script says confirmed=True in its command", flight.dictionary.command(packet))
    await patiently(request, craft, lambda: craft.commanding.unchecked_in(packet, body["unchecked"]))
    # So that a refusal of its number is the server's alone to mend. Once: in the blind, nothing answers.
    if not flight.in_step and not craft.probed:
        craft.probed = True
        await in_thread(craft, lambda: craft.commanding.release(user_of(request), "noop", {}, flight.packets("noop")))
        for _wait in range(round(common.PATIENCE / 0.05)):
            if flight.in_step:
                break
            await asyncio.sleep(0.05)

    def release() -> bytes:
        note = craft.commanding.unchecked_in(packet, body["unchecked"])
        numbered = flight.numbered(packet)
        craft.commanding.release(user_of(request), flight.dictionary.command(numbered), {}, [numbered], note=note)
        return numbered

    return answer({"hex": (await in_thread(craft, release)).hex()})


@route("GET", "/api/crafts/{c}/dictionary", "view", answers=described(OBJECT, "MISSION_packets.json"))
async def dictionary(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The packets of a mission of Fledge, for fledge.ground."""
    if craft.mission is None:
        raise Refusal(404, f"{craft.name} is of no mission of Fledge; it has a database of XTCE alone")
    return web.Response(text=await server.aside(craft.mission.dictionary.text), content_type="application/json")


@route("GET", "/api/crafts/{c}/sent", "view", answers=array("Sent"), query=LIST)
async def sent(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Commands and how far each has come, the newest first."""
    return await server.journal_rows(request, "sent", craft.name)


# --- questions of scripts ----------------------------------------------------------------------------

@route("POST", "/api/crafts/{c}/questions", "command", answers="Question",
       takes=object_of(text=described(TEXT, f"at most {LONGEST} characters")))
async def ask(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Ask the operators."""
    body = await body_of(request)
    return answer(server.questions.ask(craft.name, user_of(request), body["text"]))


@route("GET", "/api/crafts/{c}/questions", "view", answers=array("Question"))
async def open_questions(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Questions of scripts that no operator has answered yet."""
    return answer(server.questions.open(craft.name))


@route("GET", "/api/crafts/{c}/questions/{id}", "command", answers="Question")
async def question(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """A question, for its script; it is withdrawn if the script does not poll it for 30 s."""
    return answer(server.questions.poll(craft.name, id_of(request)))


@route("POST", "/api/crafts/{c}/questions/{id}", "command", answers="Question", takes=object_of(answer=FLAG))
async def answer_question(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Answer a question."""
    body = await body_of(request)
    if "answer" not in body:
        raise Refusal(400, 'give {"answer": true} or {"answer": false}')
    return answer(server.questions.answer(craft.name, id_of(request), user_of(request), body["answer"]))
