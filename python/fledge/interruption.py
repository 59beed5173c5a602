# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C during a run, and other signals that end a program."""

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any


def _may_set_handlers() -> bool:
    """Python lets the main thread alone set handlers of signals."""
    return threading.current_thread() is threading.main_thread()


@contextmanager
def handled(numbers: Iterable[int], handler: Callable[[int, Any], None] | signal.Handlers) -> Iterator[None]:
    """These signals have this handler within the block, and their own again after it. In another thread than the main
    one, they keep their own."""
    if not _may_set_handlers():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, own in before.items():
            signal.signal(number, own)


class Interruption:
    """Delays Ctrl-C until the current instant has ended, so that it cannot stop a Python event half way.

    A second Ctrl-C takes effect at once.
    """

    def __enter__(self) -> "Interruption":
        self._requested = False
        self._replaced = _may_set_handlers() and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._replaced:
            signal.signal(signal.SIGINT, self._request)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        if self._replaced:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        if kind is None:
            self.check()

    def _request(self, *_: Any) -> None:
        self.check()
        self._requested = True

    def check(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed."""
        if self._requested:
            raise KeyboardInterrupt
