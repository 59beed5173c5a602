# SPDX-License-Identifier: Apache-2.0
"""The role that each HTTP route and each message of the WebSocket needs: a row beside its handler. The check, the
document of OpenAPI and the table in docs/ follow from these rows."""
from __future__ import annotations

import json
import re
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from math import isfinite
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

from aiohttp import web

from fledge.ground.server.bounds import DEPTH
from fledge.errors import SetupError

if TYPE_CHECKING:
    from fledge.ground.server.web import Server

USER, ANYONE = "user", "anyone"     # in place of a role: all users; all clients, also without a login
MESSAGE = "message"                 # in the place of a method: of the WebSocket
OWN, RUN = "path", "run"            # the role holds for: the spacecraft that is named; all that its run flies
DIGITS = 40                         # of a number in JSON
Handler = TypeVar("Handler", bound=Callable[..., Any])


@dataclass(frozen=True)
class Row:
    method: str         #: of HTTP, or MESSAGE
    path: str           #: or the message's key
    role: str           #: view, command, administer, USER or ANYONE
    craft: str = ""     #: OWN or RUN; "": no spacecraft is named, and the answer has what the user may see
    logged: bool = False    #: the operators' log has it before it is done
    body: str = "body"      #: the limit of its request (bounds.py)
    summary: str = ""       #: and the rest is for the document (openapi.py)
    answers: Any = field(default_factory=dict)      #: the schema of its answer, or its name, or schemas by media
    query: Any = field(default_factory=dict)        #: the schema of its query
    takes: Any = field(default_factory=dict)        #: the schema of its body, by which it is checked; or by media


def route(method: str, path: str, role: str, craft: str = "", logged: bool | None = None, **more: Any
          ) -> Callable[[Handler], Handler]:
    """Decorates a handler with its row. craft: by default, that of the path; logged: by default, all but GET; more: the
    further ones of a Row. The handler's docstring is the summary."""
    def decorate(handler: Handler) -> Handler:
        setattr(handler, "row", Row(
            method, path, role, craft or (OWN if "{c}" in path else ""), method not in ("GET", MESSAGE)
            if logged is None else logged, summary=" ".join((handler.__doc__ or "").split()), **more))
        return handler

    return decorate


def message(key: str, role: str, craft: str = OWN) -> Callable[[Handler], Handler]:
    """Decorates a handler of a message of the WebSocket."""
    return route(MESSAGE, key, role, craft)


def rows(holder: object) -> Iterator[tuple[Row, Any]]:
    """The rows of a module, a class or an object, with their handlers, as they stand in its file."""
    of = holder if isinstance(holder, (type, ModuleType)) else type(holder)
    for var in vars(of).values():
        if hasattr(var, "row"):
            yield var.row, var if of is holder else getattr(holder, var.__name__)


def bound(handler: Callable[..., Awaitable[web.StreamResponse]], row: Row, server: Server
          ) -> Callable[[web.Request], Awaitable[web.StreamResponse]]:
    """A handler of a module as the application calls it: of a server, and of the spacecraft that its path names."""
    async def handle(request: web.Request) -> web.StreamResponse:
        return await handler(server, request, *([request["craft"]] if row.craft else []))

    setattr(handle, "row", row)
    return handle


def add_routes(app: web.Application, holder: object, server: Server | None = None) -> None:
    """Add the routes of an object, or of a module, with the handlers of a server."""
    for row, handler in rows(holder):
        handler = bound(handler, row, server) if server else handler
        if row.method == "GET":     # and HEAD
            app.router.add_get(row.path, handler)
        elif row.method != MESSAGE:
            app.router.add_route(row.method, row.path, handler)


def row_of(request: web.Request) -> Row | None:
    """None: there is no such route."""
    return getattr(request.match_info.handler, "row", None)


async def whole(app: web.Application) -> None:
    """Raises SetupError for a route without a row; an application does not start with it."""
    for entry in app.router.routes():
        row, path = getattr(entry.handler, "row", None), entry.resource.canonical if entry.resource else ""
        if not isinstance(row, Row) or entry.method not in (row.method, "HEAD" if row.method == "GET" else ""):
            raise SetupError(f"{entry.method} {path} has no row that says who may ask it: give its handler @route")


def loads(text: str | bytes) -> Any:
    """Parse JSON with Unicode texts and finite numbers. Raises ValueError with a sentence."""
    def number(kind: Callable[[str], Any]) -> Callable[[str], Any]:
        def parse(digits: str) -> Any:
            value = kind(digits) if len(digits) <= DIGITS else float("inf")
            if not isfinite(value):
                raise OverflowError(f"a number is finite and has at most {DIGITS} digits; found {digits[:50]}")
            return value
        return parse

    try:
        text = text if isinstance(text, str) else text.decode()
        content = json.loads(text, parse_float=number(float), parse_int=number(int), parse_constant=number(float))
        if re.search(r"\\ud[89a-f]", text, re.I):      # a half of a pair, or both
            json.dumps(content, ensure_ascii=False).encode()
        level, depth = [content], 0
        while level := [inner for value in level if isinstance(value, (dict, list))
                        for inner in (value.values() if isinstance(value, dict) else value)]:
            depth += 1
            if depth > DEPTH:
                raise OverflowError(f"JSON has at most {DEPTH} levels")
        return content
    except OverflowError as error:
        raise ValueError(str(error)) from None
    except UnicodeEncodeError:
        raise ValueError("a text has the half of a surrogate pair, which is no character") from None
    except (ValueError, RecursionError):
        raise ValueError("that is no JSON") from None
