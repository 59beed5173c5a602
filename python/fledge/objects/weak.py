# SPDX-License-Identifier: Apache-2.0
"""References that do not keep an object alive."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def weakly(x: T) -> Callable[[], T]:
    """What gives an object for as long as it lives."""
    return weakref.ref(x)       # type: ignore[return-value]
