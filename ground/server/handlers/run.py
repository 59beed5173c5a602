# SPDX-License-Identifier: Apache-2.0
"""The run in which a spacecraft flies: pauses, steps, speed, faults."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aiohttp import web

from fledge.ground.server.answers import answer, Refusal
from fledge.ground.server.handlers.common import body_of, in_thread, user_of
from fledge.ground.server.openapi import ANY, FROM_ZERO, TEXT, enum, object_of
from fledge.ground.server.routes import RUN, route

if TYPE_CHECKING:
    from fledge.ground.server.run_control import RunControl
    from fledge.ground.server.spacecraft import Spacecraft
    from fledge.ground.server.web import Server


def _control(craft: Spacecraft) -> RunControl:
    if craft.control is None:
        raise Refusal(404, f"{craft.name} has no run control: neither the server nor its co-simulation flies it")
    return craft.control


@route("GET", "/api/crafts/{c}/run", "view", answers="Run")
async def run(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """The simulation of a craft that the server flies, and what may be changed in its world."""
    faults = await server.aside(_control(craft).faults)
    return answer((craft.describe_run() or {}) | {"faults": faults})


@route("POST", "/api/crafts/{c}/run", "command", RUN, answers="Run", takes=object_of(
    "action seconds speed fault", action=enum("pause", "go", "step", "rewind"),
    seconds=FROM_ZERO | {"default": 1.0}, speed=FROM_ZERO, fault=object_of(path=TEXT, value=ANY)))
async def command_run(server: Server, request: web.Request, craft: Spacecraft) -> web.StreamResponse:
    """Pause it, let it go on, change its world, or rewind a co-simulation to the instant `seconds`."""
    control = _control(craft)
    body = await body_of(request)

    def act() -> dict[str, Any]:
        if fault := body.get("fault"):
            before = control.inject(str(fault.get("path", "")), fault.get("value"))
            craft.reporter.event("warning", "run", f"{user_of(request)} set {fault.get('path')} to "
                                 f"{fault.get('value')}; it was {before}")
        if "action" in body or "speed" in body:
            action, seconds = body.get("action", "pause" if control.paused else "go"), body["seconds"]
            control.command(action, seconds, body.get("speed"))
            if action == "rewind":
                craft.reporter.event("warning", "run", f"{user_of(request)} asked the run to go back to {seconds:g} s")
        state = control.describe()
        server.room.publish("run", craft.name, state)
        return state | {"faults": control.faults()}

    return answer(await in_thread(craft, act))
