# SPDX-License-Identifier: Apache-2.0
"""A pool of processes of this machine."""

from __future__ import annotations

import pickle
import traceback
from collections.abc import Callable, Sequence
from itertools import islice
from multiprocessing.connection import Connection
from typing import Any

from fledge.errors import SetupError
from fledge.pool.children import Children, cores, leave
from fledge.pool.work import Died, Flown, Item, Pool, Result, Work, answer, taken


class Local(Pool):
    """jobs: processes at a time; default: one for each core."""

    def __init__(self, jobs: int | None = None) -> None:
        self.threads = cores() if jobs is None else jobs
        if self.threads < 1:
            raise SetupError(f"jobs must be >= 1, found {jobs}")

    def fly(self, work: Work[Item, Result], items: Sequence[Item], tick: Callable[[], object] = lambda: None
            ) -> Flown[Item, Result]:
        children = Children()
        waiting = iter(range(len(items)))

        def start(place: int) -> None:
            pipe = children.fork(place)
            if pipe:
                _serve(work, items, place, pipe)

        try:
            for place in islice(waiting, self.threads):
                start(place)
            while children:
                tick()
                for place, reply, pipe in children.answers():
                    following = next(waiting, None)
                    if pipe and following is not None and not work.fresh:
                        children.give(pipe, following)
                    else:
                        if pipe:
                            children.dismiss(pipe)
                        if following is not None:
                            start(following)
                    yield place, (taken(pickle.loads(reply)) if isinstance(reply, bytes) else
                                  Died(items[place], reply, tuple(work.last_lines(items[place]))))
        finally:
            children.end()


def _serve(work: Work[Item, Any], items: Sequence[Item], place: int | None, pipe: Connection) -> None:
    """Fly items in this copy of the process until there is none, or nothing reads the results; does not return."""
    code = 1
    try:
        work.begin()
        while place is not None:
            result = answer(work, items[place])
            try:
                pipe.send_bytes(result)
                place = pipe.recv()
            except (EOFError, OSError):
                break
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        leave(code)
