# SPDX-License-Identifier: Apache-2.0
"""Answers by HTTP and WebSocket: JSON, CSV, series in binary, refusals with their reason."""
from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from aiohttp import web

from fledge.ground.server.alarms import CONCERNS
from fledge.errors import field, for_json
from fledge.ground.database import TIMES

if TYPE_CHECKING:
    from fledge.ground.server.past import Series

PART = 8192     # values of a series that become text at once


def dumps(content: object) -> str:
    """As JSON, in which a number that is not finite is null."""
    try:
        return json.dumps(content, allow_nan=False)
    except ValueError:
        return json.dumps(for_json(content))


def _texts(kind: str, exact: list[Any]) -> list[str | None]:
    """Values as texts with all digits: a label's word, bytes in hex, times in seconds since 1970 UTC, durations in
    seconds."""
    if kind in TIMES:
        return [None if v is None else f"{'-' * (v < 0)}{abs(v) // 10**9}.{abs(v) % 10**9:09}" for v in exact]
    return [None if v is None else v.hex() if isinstance(v, bytes) else str(v) for v in exact]


def in_json(all_series: dict[str, Series]) -> Iterator[bytes]:
    """Series by their names, in parts: numbers, integers with all digits; those that a double or a browser cannot hold
    have `text` too."""
    before = "{"
    for name, series in all_series.items():
        yield f"{before}{dumps(name)}: ".encode()
        before, inner = ", ", "{"
        for key, column in _columns(series).items():
            yield f'{inner}"{key}": ['.encode()
            inner, between = ", ", ""
            for at in range(0, len(series.t), PART):
                if part := column(slice(at, at + PART)):
                    yield (between + dumps(part)[1:-1]).encode()
                    between = ", "
            yield b"]"
        yield b"}"
    yield b"}"


def _columns(series: Series) -> dict[str, Callable[[slice], list[Any]]]:
    """The lists of a series; each function returns a part of one."""
    t, value, low, high, concern, worst, exact = series
    assert exact is not None
    kind, values = exact
    columns: dict[str, Callable[[slice], list[Any]]] = {
        "t_ns": lambda part: list(map(str, t[part].tolist())), "concern": lambda part: concern[part].tolist(),
        "worst": lambda part: worst[part].tolist()}
    if kind in ("text", "binary"):
        return columns | {"value": lambda part: _texts(kind, values[part]), "low": lambda _: [], "high": lambda _: []}
    if kind in ("label", *TIMES) or kind in ("natural", "integer") and any(abs(n or 0) >= 2**53 for n in values):
        columns["text"] = lambda part: _texts(kind, values[part])
    whole = kind in ("natural", "integer", "boolean")
    return columns | {"value": lambda part: [n if n is None else int(n) for n in values[part]] if whole else
                      value[part].tolist(),
                      "low": lambda part: low[part].tolist(), "high": lambda part: high[part].tolist()}


def in_csv(all_series: dict[str, Series]) -> Iterator[bytes]:
    """Series as lines: numbers as they are, other values as in `text`."""
    yield b"t_ns,name,value,state\n"
    for name, (t, value, _, _, concern, _, values) in all_series.items():
        assert values is not None
        name, (kind, exact) = field(name), values
        for at in range(0, len(t), PART):
            part = slice(at, at + PART)
            if kind == "real":
                texts = list(map(repr, value[part].tolist()))
            elif kind == "boolean":
                texts = ["" if flag is None else str(int(flag)) for flag in exact[part]]
            else:
                texts = [text or "" for text in _texts(kind, exact[part])]
                if kind in ("label", "text"):
                    texts = [field(text) for text in texts]
            yield "".join(f"{at},{name},{text},{CONCERNS[state]}\n" for at, text, state in zip(
                t[part].tolist(), texts, concern[part].tolist())).encode()


def in_binary(all_series: dict[str, Series]) -> Iterator[bytes]:
    """Series in the order of their names, each with its arrays."""
    yield struct.pack("<II", 0x32484C46, len(all_series))
    for t, value, low, high, _, worst, _ in all_series.values():
        yield struct.pack("<II", len(t), 0)
        for array in (t.astype("<i8"), *(real.astype("<f8") for real in (value, low, high)), worst):
            if len(array):
                yield array.tobytes()
        if len(t) % 8:
            yield bytes(-len(t) % 8)


def answer(content: object) -> web.Response:
    """A short answer in JSON."""
    return web.Response(text=dumps(content), content_type="application/json")


def json_answer(content: object) -> web.Response:
    """An answer that may be long: the calling thread, not the event loop, encodes it."""
    return web.Response(body=dumps(content).encode(), content_type="application/json")


class Refusal(web.HTTPException):
    """An answer with its reason in a sentence. more: further keys of its JSON."""

    def __init__(self, status: int, why: str, headers: dict[str, str] | None = None, **more: object) -> None:
        self.status_code = status
        super().__init__(text=dumps({"error": why} | more), content_type="application/json", headers=headers)
        self.why = why
