# SPDX-License-Identifier: Apache-2.0
"""A pool, its work, and the results of its items."""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, NamedTuple, Self, TypeVar

from fledge.errors import Failure, RunError, SetupError

Item = TypeVar("Item")
Result = TypeVar("Result")


class Work(Generic[Item, Result]):
    """Flies items, one after the other. Each process of a pool has a copy; items and results are pickled.

    fresh: each item needs a process of its own. folder: of the mission, which a worker of a cluster must have too;
    facts: name -> what else must be the same there, in words
    """

    fresh = False
    folder: Path
    facts: dict[str, str] = {}

    @property
    def recipe(self) -> tuple[Callable[..., Work[Item, Result]], tuple[Any, ...]]:
        """(a function, its arguments) that create this work on another machine."""
        raise SetupError("this flies on this machine alone, not by a scheduler")

    def begin(self) -> None:
        """Called once in each process, before its first item."""

    def fly(self, item: Item) -> Result:
        raise NotImplementedError

    def split(self, item: Item) -> Sequence[Item]:
        """Smaller items in place of one in which a process died; none: the item itself has died."""
        return ()

    def last_lines(self, item: Item) -> Sequence[str]:
        """Of the log of an item, if it has its own; called on the machine where its process has died."""
        return ()


@dataclass(frozen=True)
class Died(Generic[Item]):
    """The process that flew an item has ended; text: how, as "the process that flew it was ended by SIGKILL";
    last_lines: of the item's own log."""
    item: Item
    text: str
    last_lines: tuple[str, ...] = ()


class Death(NamedTuple):
    """How a process of another machine ended, and the last lines that it printed there."""
    text: str
    printed: tuple[str, ...] = ()


class Refusal(NamedTuple):
    """A worker, by its address, must not fly; problem: why."""
    worker: str
    problem: str


LAST_LINES = 5      # that are kept of what a process printed which has died

# (place, result) of items, as they come.
Flown = Generator[tuple[int, Died[Item] | Result], None, None]


class Pool:
    """Flies items, several at a time; a context manager. threads: how many at a time"""

    threads: int

    def fly(self, work: Work[Item, Result], items: Sequence[Item], tick: Callable[[], object] = lambda: None
            ) -> Flown[Item, Result]:
        """(place, result) of each item, as they come; tick() is called before the first, and some times a second."""
        raise NotImplementedError

    def close(self) -> None:
        """End what it has begun."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def anywhere(mission: str | os.PathLike[str]) -> str:
    """A mission as a process with another working directory names it: its name, or the whole path of its folder."""
    path = Path(mission)
    return str(path.resolve() if path.is_dir() else path)


def death(code: int) -> str:
    """Why a process ended, by its exit code, < 0 of a signal."""
    if code < 0:
        return f"the process that flew it was ended by {signal.Signals(-code).name}"
    return f"the process that flew it ended with code {code}"


def in_order(results: Iterable[tuple[int, Result]]) -> Iterator[Result]:
    """The results of a pool in the order of the items, each as soon as those before it are there."""
    early: dict[int, Result] = {}
    following = 0
    for place, result in results:
        early[place] = result
        while following in early:
            yield early.pop(following)
            following += 1


_ERRORS: tuple[type[Exception], ...] = SetupError, RunError, Failure


class _Raised(NamedTuple):
    """An error, to be raised by the process that reads the result. kind: its place in _ERRORS"""
    kind: int
    text: str


def answer(work: Work[Item, Any], item: Item) -> bytes:
    """The result of an item, or the error that it raises, pickled, for taken()."""
    try:
        return pickle.dumps(work.fly(item))
    except _ERRORS as error:
        kind = next(place for place, type_ in enumerate(_ERRORS) if isinstance(error, type_))
        return pickle.dumps(_Raised(kind, str(error)))


def taken(result: Any) -> Any:
    """A result of answer(), unpickled; raises its error."""
    if isinstance(result, _Raised):
        raise _ERRORS[result.kind](result.text)
    return result


_CHECKSUM = 16      # bytes


def sealed(reply: bytes, *request: bytes) -> bytes:
    """A reply to a request, for a way on which bytes may change: behind a checksum of both."""
    return _checksum(reply, request) + reply


def unsealed(reply: object, *request: bytes) -> bytes:
    """The reply that was sealed for a request. Raises ValueError if this is not what was sealed."""
    if not isinstance(reply, bytes):
        raise ValueError(f"the answer is no bytes but of the type {type(reply).__name__}")
    found = reply[_CHECKSUM:]
    if _checksum(found, request) != reply[:_CHECKSUM]:
        raise ValueError("the checksum of the answer is wrong")
    return found


def _checksum(reply: bytes, request: Sequence[bytes]) -> bytes:
    checksum = hashlib.blake2b(digest_size=_CHECKSUM)
    for part in (*request, reply):
        checksum.update(len(part).to_bytes(8, "little"))
        checksum.update(part)
    return checksum.digest()
