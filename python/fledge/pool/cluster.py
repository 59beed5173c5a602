# SPDX-License-Identifier: Apache-2.0
"""A pool of the workers of a Dask scheduler, on any machines.

A task is an item, which a worker flies (worker.py). If a worker dies, Dask gives its items to others. A worker
whose Fledge or mission differs from those of the work is refused.
"""

from __future__ import annotations

import logging
import pickle
import queue
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Self

from fledge.errors import RunError, SetupError
from fledge.mission.provenance import digest, identity
from fledge.pool.work import Died, Flown, Item, Result, Work, opened

PATIENCE = 5.0      # [s] for the scheduler to answer, and for a first worker to be there
LOST = 20.0         # [s] until a scheduler that does not answer any more is given up
REFUSALS = 100      # tasks that came back from workers that must not fly, before the work is given up
_AHEAD = 3          # tasks for each thread of the workers, so that none waits


class Cluster:
    """The workers of the scheduler at an address, as "tcp://127.0.0.1:8786".

    threads: of all workers at first. Raises SetupError if there is no scheduler, or no worker.
    """

    def __init__(self, address: str) -> None:
        try:
            import cloudpickle      # noqa: F401
            import distributed
        except ImportError:
            raise SetupError("a scheduler needs Dask: apt-get install python3-distributed") from None
        for name in ("distributed", "distributed.client", "distributed.core"):
            logging.getLogger(name).setLevel(logging.CRITICAL)      # their errors are named here

        class Client(distributed.Client):
            def __del__(self) -> None:      # it would wait once more for a scheduler that is not there
                pass

        self.address = address
        self._checked = b""     # the job that all workers may fly
        try:
            self._client: Any = Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise SetupError(f"there is no scheduler at {address} ({_in_words(error)}): start one with "
                             "./fledge exec dask-scheduler") from None
        try:
            self._client.wait_for_workers(1, timeout=PATIENCE)
            workers = self._client.scheduler_info()["workers"].values()
        except TimeoutError:
            self.close()
            raise SetupError(f"the scheduler at {address} has no workers: start them with ./fledge exec dask-worker "
                             f"{address}") from None
        self.threads = max(1, sum(worker["nthreads"] for worker in workers))

    def close(self) -> None:
        self._client.close(timeout=1)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def fly(self, work: Work[Item, Result], items: Sequence[Item],
            tick: Callable[[], Any] = lambda: None) -> Flown[Item, Result]:
        """As of Local; of an item whose workers died, the results of its parts.

        Raises SetupError if a worker has another Fledge or mission; RunError if the scheduler goes away. A worker of
        another revision that comes later is sent away, with a warning.
        """
        import distributed

        client = self._client
        tasks: dict[Any, tuple[int, Item]] = {}     # by future
        job = _job(work)
        self._check(job)
        waiting = deque(enumerate(items))
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        refused: list[str] = []     # addresses of workers
        answered = time.monotonic()
        try:
            while waiting or tasks:
                if client.status == "running":
                    answered = time.monotonic()
                elif client.status == "closed" or time.monotonic() - answered > LOST:
                    raise RunError(f"the scheduler at {self.address} has gone")
                while client.status == "running" and waiting and len(tasks) < _AHEAD * self.threads:
                    place, item = waiting.popleft()
                    task = client.submit(_fly, job, pickle.dumps(item), not work.split(item), pure=False)
                    tasks[task] = place, item
                    task.add_done_callback(done.put)
                tick()
                try:
                    task = done.get(timeout=0.2)
                except queue.Empty:
                    continue
                place, item = tasks.pop(task)
                if task.status == "finished":
                    answer = task.result()
                    if isinstance(answer, tuple):
                        if answer[0] not in refused:
                            self._send_away(*answer)
                        refused.append(answer[0])
                        if len(refused) > REFUSALS:
                            raise SetupError("the worker {} {}".format(*answer))
                        waiting.appendleft((place, item))
                        continue
                elif task.status != "error":                    # lost, with the scheduler
                    waiting.appendleft((place, item))
                    time.sleep(0.2)
                    continue
                elif not isinstance(task.exception(), distributed.scheduler.KilledWorker):
                    raise RunError(f"the scheduler at {self.address}: {task.exception()}")
                else:
                    answer = "the workers that flew it were ended"
                if isinstance(answer, bytes):
                    yield place, opened(answer)
                elif parts := work.split(item):
                    waiting.extendleft((place, part) for part in reversed(parts))
                else:
                    yield place, Died(item, answer)
        finally:
            if client.status == "running":
                with suppress(OSError):
                    client.cancel(list(tasks), force=True)

    def _check(self, job: bytes) -> None:
        """Raise SetupError if there is a worker that must not fly a job."""
        if job == self._checked:
            return

        def check() -> str:     # sent by value to the workers, which may have no Fledge
            try:
                from fledge.pool.worker import check_job
            except ImportError as error:
                return f"cannot import fledge ({error}): start it with ./fledge exec dask-worker"
            return check_job(job)

        for worker, problem in self._client.run(check).items():
            if problem:
                raise SetupError(f"the worker {worker} {problem}")
        self._checked = job

    def _send_away(self, worker: str, problem: str) -> None:
        """Close a worker that must not fly."""
        import warnings

        async def leave(dask_worker: Any) -> None:
            import asyncio

            asyncio.ensure_future(dask_worker.close(nanny=True))

        warnings.warn(f"the worker {worker} {problem}; it is sent away", RuntimeWarning, stacklevel=4)
        self._client.run(leave, workers=[worker], wait=False)


def _in_words(error: Exception) -> str:
    return str(error).splitlines()[0].partition(": ")[0].removeprefix("Timed out ") or type(error).__name__


def _job(work: Work[Any, Any]) -> bytes:
    """A work for workers. Functions that they cannot import go as they are."""
    import cloudpickle

    kind, arguments = work.recipe
    for argument in arguments:
        module = sys.modules.get(getattr(argument, "__module__", None) or "")
        if callable(argument) and module and not module.__name__.startswith(("fledge.", "__main__")):
            cloudpickle.register_pickle_by_value(module)
    # By value: workers may have no Fledge, or other modules.
    return bytes(cloudpickle.dumps({
        "work": (kind, arguments), "identity": {**identity(work.folder), **work.facts},
        "digests": {name: digest(name, work.folder) for name in ("fledge", "mission")}}))


def _fly(job: bytes, item: bytes, twice: bool) -> bytes | str | tuple[str, str]:
    """On a worker: the answer; how the process died that flew it; or (address of the worker, why it must not fly)."""
    import distributed

    worker = distributed.get_worker().address
    try:
        from fledge.pool.worker import Refused, fly
    except ImportError as error:
        return worker, f"cannot import fledge ({error}): start it with ./fledge exec dask-worker"
    try:
        return fly(job, item, twice)
    except Refused as error:
        return worker, str(error)
