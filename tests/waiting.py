# SPDX-License-Identifier: Apache-2.0
"""Waiting for a condition in tests, on a machine that may be busy."""
import time
from collections.abc import Callable
from subprocess import Popen
from typing import Any, TypeVar

T = TypeVar("T")
PATIENCE = 600.0    # [s] for interfaces that need a limit; shorter than the limit of a test


def wait_for(condition: Callable[[], T], process: Popen[Any] | None = None, details: Callable[[], object] = str) -> T:
    """Call the condition until its result is true, and return that; meanwhile the process must not end. details: for
    the message of a timeout."""
    end = time.monotonic() + PATIENCE
    while not (result := condition()):
        assert process is None or process.poll() is None, (
            f"{process.args!r} ended: {process.returncode}, {process.stdout and process.stdout.read()!r}")
        assert time.monotonic() < end, f"waited in vain for {PATIENCE:g} s; {details()}"
        time.sleep(0.01)
    return result
