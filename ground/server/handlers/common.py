# SPDX-License-Identifier: Apache-2.0
"""What handlers share: the parts of a request, and the thread of a spacecraft."""
from __future__ import annotations

import asyncio
from collections.abc import Callable
from copy import copy
from typing import TYPE_CHECKING, Any, TypeVar

from aiohttp import web

from fledge.ground.server.answers import Refusal
from fledge.ground.server.commanding import Constrained
from fledge.ground.server.routes import loads, row_of

if TYPE_CHECKING:
    from fledge.ground.server.spacecraft import Spacecraft

PATIENCE = 10.0     # [s] for the thread of a spacecraft to answer
AGAIN = 0.1         # [s] until the constraints of a command that waits are judged again
KINDS: dict[str | None, tuple[type, ...]] = {       # of values in JSON, by the types of schemas; None: a time
    "string": (str,), "boolean": (bool,), "integer": (int,), "number": (int, float), "object": (dict,),
    None: (str, int)}

Answer = TypeVar("Answer")
Default = TypeVar("Default", int, None)


def user_of(request: web.Request) -> str:
    """The name of the user who sent a request."""
    return str(request["user"].name)


async def body_of(request: web.Request) -> dict[str, Any]:
    """The JSON object of a request as its row takes it, with the defaults of what it lacks."""
    row = row_of(request)
    assert row
    schemas = row.takes["properties"]
    # A required text that is missing counts as empty, which the handler refuses.
    defaults = {key: copy(schema["default"]) for key, schema in schemas.items() if "default" in schema} | {
        key: "" for key in row.takes.get("required", ()) if schemas[key].get("type") == "string"}
    try:
        body = loads(await request.read() or b"{}")
    except ValueError as error:
        raise Refusal(400, f"the body: {error}") from None
    if not isinstance(body, dict):
        raise Refusal(400, f"the body is an object, as {{}}; found {type(body).__name__}")
    for key, value in body.items():
        if key not in schemas:
            raise Refusal(400, f"only known keys count: {', '.join(schemas)}; found '{key}'")
        kinds = KINDS[schemas[key].get("type")] + (type(None),) * schemas[key].get("nullable", False)
        if not isinstance(value, kinds) or isinstance(value, bool) and bool not in kinds:
            raise Refusal(400, f"'{key}' is of the wrong kind; found {str(value)[:80]}")
    return defaults | body


def number_of(request: web.Request, key: str, default: Default, least: int = -2**63) -> int | Default:
    """A whole number of its query, `least` at least."""
    text = request.query.get(key)
    if text is None or text == "":
        return default
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if not least <= value < 2**63:
        raise Refusal(400, f"{key} is a whole number; found '{text[:40]}'")
    return value


def id_of(request: web.Request) -> int:
    """The number of its path; -1, which nothing has, if it is none."""
    text = request.match_info["id"]
    return int(text) if text.isdecimal() and len(text) < 19 else -1


def slot_of(request: web.Request, craft: Spacecraft) -> int:
    """The slot of its path."""
    text, n = request.match_info["slot"], len(craft.telemetry.slot_names)
    if not text.isdecimal() or len(text) > 9 or int(text) >= n:
        raise Refusal(404, f"{craft.name} has the slots 0 to {n - 1}; found '{text[:40]}'")
    return int(text)


async def patiently(request: web.Request, craft: Spacecraft, action: Callable[[], Answer]) -> Answer:
    """As in_thread, again and again while a constraint of a command lets it wait, by the spacecraft's clock."""
    begin = craft.clock.now
    request["live"].add(asyncio.current_task())     # it ends with the login
    while True:
        try:
            return await in_thread(craft, action)
        except Constrained as error:
            if craft.clock.now - begin >= error.timeout * 1e9:
                raise
        await asyncio.sleep(AGAIN)


async def in_thread(craft: Spacecraft, request: Callable[[], Answer]) -> Answer:
    """Call a function in the spacecraft's thread; its result."""
    return await asyncio.wait_for(asyncio.wrap_future(craft.call(request)), PATIENCE)
