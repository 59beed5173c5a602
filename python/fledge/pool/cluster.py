# SPDX-License-Identifier: Apache-2.0
"""A pool of the workers of a Dask scheduler, on any machines.

A task is an item, which a worker flies (worker.py). If a worker dies, Dask gives its items to others. An answer that is
not what was sent is thrown away, and its item flown again. A worker whose Fledge or mission differs from those of the
work is refused, and one that answers wrongly again and again is sent away.
"""

from __future__ import annotations

import logging
import pickle
import queue
import sys
import time
import warnings
from collections import Counter, deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Generic

from fledge.errors import RunError, SetupError, excerpt, listed
from fledge.mission.provenance import digest, identity
from fledge.pool.work import Death, Died, Flown, Item, Pool, Refusal, Result, Work, sealed, taken, unsealed

PATIENCE = 5.0      # [s] for the scheduler to answer, and for a first worker to be there
LOST = 20.0         # [s] until a scheduler that does not answer any more is given up
REFUSALS = 100      # tasks that came back from workers that must not fly, before the work is given up
WRONG = 3           # wrong answers of a worker, before it is sent away
_AHEAD = 3          # tasks for each thread of the workers, so that none waits


class Cluster(Pool):
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
            self.client: Any = Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise SetupError(f"there is no scheduler at {address} ({_in_words(error)}): start one with "
                             "./fledge exec dask-scheduler") from None
        try:
            self.client.wait_for_workers(1, timeout=PATIENCE)
            workers = self.client.scheduler_info()["workers"].values()
        except TimeoutError:
            self.close()
            raise SetupError(f"the scheduler at {address} has no workers: start them with ./fledge exec dask-worker "
                             f"{address}") from None
        self.threads = max(1, sum(worker["nthreads"] for worker in workers))

    def close(self) -> None:
        self.client.close(timeout=1)

    def fly(self, work: Work[Item, Result], items: Sequence[Item], tick: Callable[[], object] = lambda: None
            ) -> Flown[Item, Result]:
        """As of each pool; of an item whose workers died, the results of its parts.

        Raises SetupError if a worker has another Fledge or mission; RunError if the scheduler goes away, or if the only
        worker answers wrongly. A worker of another revision that comes later is sent away, with a warning.
        """
        job = _job(work)
        self._check(job)
        tasks = _Tasks(self, work, job, items)
        try:
            while tasks:
                tasks.submit()
                tick()
                yield from tasks.ended()
            tasks.report()
        finally:
            tasks.cancel()

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

        for worker, problem in self.client.run(check).items():
            if problem:
                raise SetupError(f"the worker {worker} {excerpt(str(problem))}")
        self._checked = job


class _Tasks(Generic[Item, Result]):
    """The items of a work, as tasks of the workers of a cluster."""

    def __init__(self, cluster: Cluster, work: Work[Item, Result], job: bytes, items: Sequence[Item]) -> None:
        self._cluster, self._work, self._job = cluster, work, job
        self._waiting = deque(enumerate(items))
        self._flying: dict[Any, tuple[int, Item, bytes]] = {}  # by future; the bytes are the pickled item
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._refused: list[str] = []       # addresses of workers
        self._wrong: Counter[str] = Counter()   # answers of workers, by address
        self._answered = time.monotonic()   # when the scheduler was last there

    def __bool__(self) -> bool:
        return bool(self._waiting or self._flying)

    def submit(self) -> None:
        """Give the workers as many as keep all of them busy. Raises RunError if the scheduler has gone."""
        client = self._cluster.client
        if client.status == "running":
            self._answered = time.monotonic()
        elif client.status == "closed" or time.monotonic() - self._answered > LOST:
            raise RunError(f"the scheduler at {self._cluster.address} has gone")
        while client.status == "running" and self._waiting and len(self._flying) < _AHEAD * self._cluster.threads:
            place, item = self._waiting.popleft()
            data = pickle.dumps(item)
            task = client.submit(_fly, self._job, data, not self._work.split(item), pure=False)
            self._flying[task] = place, item, data
            task.add_done_callback(self._done.put)

    def ended(self) -> Flown[Item, Result]:
        """(place, result) of a task that ends within a short time, if it has one. What a process printed before it
        died goes to stderr, as that of a process of this machine."""
        try:
            task = self._done.get(timeout=0.2)
        except queue.Empty:
            return
        place, item, data = self._flying.pop(task)
        answer = self._answer(task, data)
        if answer is None:
            self._waiting.appendleft((place, item))
        elif not isinstance(answer[0], Death):
            yield place, taken(answer[0])
        elif parts := self._work.split(item):
            self._waiting.extendleft((place, part) for part in reversed(parts))
        else:
            sys.stderr.writelines(f"{excerpt(line)}\n" for line in answer[0].printed)
            yield place, Died(item, excerpt(answer[0].text))

    def _answer(self, task: Any, data: bytes) -> tuple[Any] | None:
        """Of a task that has ended; None: it must be flown again."""
        import distributed

        if task.status == "finished":
            try:
                answer = pickle.loads(unsealed(task.result(), self._job, data))
            except distributed.CancelledError:      # lost, with the scheduler
                return None
            except Exception as error:      # of Dask, of what it cannot read
                self._distrust(task, str(error))
                return None
            if not isinstance(answer, Refusal):
                return answer,
            self._refuse(answer)
        elif task.status != "error":        # lost, with the scheduler
            time.sleep(0.2)
        elif isinstance(task.exception(), distributed.scheduler.KilledWorker):
            return Death("the workers that flew it were ended"),
        else:
            raise RunError(f"the scheduler at {self._cluster.address}: {excerpt(str(task.exception()))}")
        return None

    def _distrust(self, task: Any, problem: str) -> None:
        """Count a wrong answer of a worker; send it away after some. Raises RunError if no other one is there."""
        client, problem = self._cluster.client, excerpt(problem)
        worker = next((worker for worker, keys in client.has_what().items() if task.key in keys), "that has gone")
        self._wrong[worker] += 1
        if self._wrong[worker] == 1:
            warnings.warn(f"the worker {worker}: {problem}; what it flew is flown again", RuntimeWarning, stacklevel=2)
        elif self._wrong[worker] >= WRONG and worker in (there := set(client.scheduler_info()["workers"])):
            problem = f"gave {WRONG} wrong answers, the last: {problem}"
            if not there - {worker, *self._refused}:
                raise RunError(f"the worker {worker} {problem}; no other worker is left: start one on another machine")
            self._refuse(Refusal(worker, problem))

    def report(self) -> None:
        """Warn of what was flown again."""
        if self._wrong:
            wrong = listed([f"{n} of {worker}" for worker, n in self._wrong.items()], 10)
            warnings.warn(f"{self._wrong.total()} answers of workers were wrong, and what they were about was flown "
                          f"again: {wrong}", RuntimeWarning, stacklevel=2)

    def _refuse(self, refusal: Refusal) -> None:
        """Close a worker that must not fly. Raises SetupError after too many."""
        async def leave(dask_worker: Any) -> None:
            import asyncio

            asyncio.ensure_future(dask_worker.close(nanny=True))

        worker, problem = refusal.worker, excerpt(refusal.problem)
        if worker not in self._refused:
            warnings.warn(f"the worker {worker} {problem}; it is sent away", RuntimeWarning, stacklevel=2)
            self._cluster.client.run(leave, workers=[worker], wait=False, on_error="ignore")
        self._refused.append(worker)
        if len(self._refused) > REFUSALS:
            raise SetupError(f"the worker {worker} {problem}")

    def cancel(self) -> None:
        """Fly none of them any more."""
        if self._cluster.client.status == "running":
            with suppress(OSError):
                self._cluster.client.cancel(list(self._flying), force=True)


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


def _fly(job: bytes, item: bytes, twice: bool) -> bytes:
    """On a worker: its answer, as of worker.fly()."""
    import distributed

    address = distributed.get_worker().address
    try:
        from fledge.pool.worker import Refused, fly

        return fly(job, item, twice)
    except ImportError as error:
        problem = f"cannot import fledge ({error}): start it with ./fledge exec dask-worker"
    except Refused as error:
        problem = str(error)
    except Exception as error:      # as a lack of memory for a child
        raise RuntimeError(f"the worker {address}: {type(error).__name__}: {excerpt(str(error))}") from None
    return sealed(pickle.dumps(Refusal(address, problem)), job, item)
