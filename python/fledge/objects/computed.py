# SPDX-License-Identifier: Apache-2.0
"""What the scripts of a mission compute of the world for flight. A target cannot: its export freezes the results."""
from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


class Computed(NamedTuple):
    """A result of a function of the world, for flight."""
    file: str       # of the script that called the function
    function: str
    result: Any


_collected: ContextVar[list[Computed] | None] = ContextVar("_found", default=None)


@contextmanager
def recorded() -> Iterator[list[Computed]]:
    """The results of all functions `for_flight` that are called meanwhile, in order."""
    collected: list[Computed] = []
    token = _collected.set(collected)
    try:
        yield collected
    finally:
        _collected.reset(token)


def for_flight(function: Function) -> Function:
    """A function of the world whose result, of numbers, is for flight."""
    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        result = function(*given, **named)
        if (collected := _collected.get()) is not None:
            collected.append(Computed(sys._getframe(1).f_code.co_filename, function.__name__, result))
        return result

    return call     # type: ignore[return-value]
