# SPDX-License-Identifier: Apache-2.0
"""What the server says by HTTP and WebSocket: JSON, CSV, refusals in words."""
from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from aiohttp import web

from fledge.control_room.alarms import CONCERNS
from fledge.control_room.users import Refusal
from fledge.errors import field


def dumps(content: Any) -> str:
    """As JSON, in which a number that is not finite is null."""
    try:
        return json.dumps(content, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(content))


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


def owner(craft: str) -> str:
    """Whose roles count: those of a replay are of its spacecraft."""
    return craft.partition("@")[0]


def _texts(kind: str, exact: list[Any]) -> list[str | None]:
    """Values as texts, all digits: of a label its word, bytes in hex, times in seconds."""
    if kind == "time":
        return [None if one is None else f"{'-' * (one < 0)}{abs(one) // 10**9}.{abs(one) % 10**9:09}" for one in exact]
    return [None if one is None else one.hex() if isinstance(one, bytes) else str(one) for one in exact]


def in_json(t: Any, value: Any, low: Any, high: Any, concern: Any, worst: Any,
             exact: tuple[str, list[Any]]) -> dict[str, Any]:
    """A series: numbers, integers with all digits; `text` of those that a double or a browser does not hold."""
    kind, values = exact
    made: dict[str, Any] = {"t_ns": [str(one) for one in t.tolist()], "concern": concern.tolist(),
                            "worst": worst.tolist()}
    if kind in ("text", "binary"):
        return made | {"value": _texts(kind, values), "low": [], "high": []}
    if kind in ("label", "time") or kind in ("natural", "integer") and any(abs(one or 0) >= 2**53 for one in values):
        made["text"] = _texts(kind, values)
    whole = kind in ("natural", "integer", "boolean")
    return made | {"value": [one if one is None else int(one) for one in values] if whole else value.tolist(),
                   "low": low.tolist(), "high": high.tolist()}


def in_csv(name: str, series: tuple[Any, ...]) -> Iterator[str]:
    """Lines of a series: a number as it is, else what `text` is."""
    t, value, _, _, concern, _, (kind, exact) = series
    if kind == "real":
        texts = [repr(one) for one in value.tolist()]
    elif kind == "boolean":
        texts = ["" if one is None else str(int(one)) for one in exact]
    else:
        texts = [one or "" for one in _texts(kind, exact)]
        if kind in ("label", "text"):
            texts = [field(one) for one in texts]
    name = field(name)
    return (f"{at},{name},{one},{CONCERNS[state]}" for at, one, state in zip(t.tolist(), texts, concern.tolist()))


def answer(content: Any) -> web.Response:
    return web.Response(text=dumps(content), content_type="application/json")


def refusal(status: int, why: str, **more: str) -> Refusal:
    made = Refusal(status, why)
    made.text = dumps({"error": why} | more)
    return made
