# SPDX-License-Identifier: Apache-2.0
"""Programs that are not Python, as Fledge starts them."""

from __future__ import annotations

from collections.abc import Mapping


def without_preload(environment: Mapping[str, str]) -> dict[str, str]:
    """An environment for a program that a sanitizer's library slows down, breaks or hangs: the launcher preloads that
    library for Python, and other programs inherit it."""
    return {name: value for name, value in environment.items() if name != "LD_PRELOAD"}
