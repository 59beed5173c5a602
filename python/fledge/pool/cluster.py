# SPDX-License-Identifier: Apache-2.0
"""Campaigns on the workers of a Dask scheduler, on any machines.

A task is a share of runs, which a worker flies (worker.py). If a worker dies, Dask gives its shares to others. One
whose Fledge or mission is another one than that of the campaign is refused.
"""

from __future__ import annotations

import logging
import pickle
import queue
import sys
import time
from collections import deque
from collections.abc import Generator
from typing import TYPE_CHECKING, Any

from fledge.errors import RunError, SetupError
from fledge.mission.provenance import identity
from fledge.montecarlo.shares import Progress, Ranges, Share, cut, halves

if TYPE_CHECKING:
    from fledge.montecarlo.campaign import Campaign

PATIENCE = 5.0      # [s] for the scheduler to answer, and for a first worker to be there
LOST = 20.0         # [s] until a scheduler that does not answer any more is given up
REFUSALS = 100      # tasks that came back from workers that must not fly, before the campaign is given up
RUNS_MOST = 500     # of a task
_AHEAD = 3          # tasks for each thread of the workers, so that none waits
_TASKS = 8          # shares for each thread, at least, so that all end at about the same time


def by_scheduler(campaign: Campaign, ranges: Ranges, seed: int, address: str,
                 progress: Progress) -> Generator[Share, None, None]:
    """Fly the runs on the workers of the scheduler at an address, as "tcp://127.0.0.1:8786".

    Raises SetupError if there is no scheduler, no worker, or one of another revision; RunError if the scheduler goes
    away. A worker of another revision that comes later is sent away, with a warning.
    """
    try:
        import distributed
        from cloudpickle import dumps
    except ImportError:
        raise SetupError("a scheduler needs Dask: apt-get install python3-distributed") from None
    for name in ("distributed", "distributed.client", "distributed.core"):
        logging.getLogger(name).setLevel(logging.CRITICAL)      # their errors are named here

    class Client(distributed.Client):
        def __del__(self):      # it would wait once more for a scheduler that is not there
            pass

    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SetupError(f"there is no scheduler at {address} ({_in_words(error)}): start one with "
                         "./fledge exec dask-scheduler") from None
    tasks: dict[Any, tuple[int, int]] = {}      # future -> its runs
    try:
        # As they are, to workers that may have no Fledge, and whose modules may be other ones.
        job = dumps({"seed": seed, "campaign": _recipe(campaign), "identity": identity(campaign.folder)})
        threads = _check_workers(client, address, job)
        runs = sum(end - first for first, end in ranges)
        waiting = deque(cut(campaign, ranges, min(RUNS_MOST, -(-runs // (_TASKS * threads)))))
        done: queue.SimpleQueue = queue.SimpleQueue()
        finished = failed = 0
        refused: list[str] = []     # addresses of workers
        heard = time.monotonic()
        while waiting or tasks:
            if client.status == "running":
                heard = time.monotonic()
            elif client.status == "closed" or time.monotonic() - heard > LOST:
                raise RunError(f"the scheduler at {address} has gone, after {finished} runs")
            while client.status == "running" and waiting and len(tasks) < _AHEAD * threads:
                first, end = waiting.popleft()
                task = client.submit(_fly_task, job, first, end, pure=False)
                tasks[task] = first, end
                task.add_done_callback(done.put)
            progress(finished, failed)
            try:
                task = done.get(timeout=0.2)
            except queue.Empty:
                continue
            first, end = tasks.pop(task)
            if task.status == "finished":
                answer = task.result()
                if isinstance(answer, tuple):
                    if answer[0] not in refused:
                        _send_away(client, *answer)
                    refused.append(answer[0])
                    if len(refused) > REFUSALS:
                        raise SetupError("the worker {} {}".format(*answer))
                    waiting.appendleft((first, end))
                    continue
                for found in map(pickle.loads, answer):
                    share = found if isinstance(found, Share) else Share.failed(campaign, *found)
                    finished, failed = finished + len(share.flown), failed + sum(map(bool, share.errors))
                    yield share
            elif task.status != "error":                    # lost, with the scheduler
                waiting.appendleft((first, end))
                time.sleep(0.2)
            elif not isinstance(task.exception(), distributed.scheduler.KilledWorker):
                raise RunError(f"the scheduler at {address}: {task.exception()}")
            elif end - first > 1:
                waiting.extendleft(halves(first, end))
            else:
                finished, failed = finished + 1, failed + 1
                yield Share.failed(campaign, first, "the workers that flew it were ended")
    finally:
        if client.status == "running":
            client.cancel(list(tasks), force=True)
        client.close(timeout=1)


def _in_words(error):
    return str(error).splitlines()[0].partition(": ")[0].removeprefix("Timed out ") or type(error).__name__


def _recipe(campaign):
    """(class, arguments) that make the campaign anew; functions that a worker cannot import go as they are."""
    import cloudpickle

    for one in campaign.recipe[1]:
        module = sys.modules.get(getattr(one, "__module__", None) or "")
        if callable(one) and module and not module.__name__.startswith(("fledge.", "__main__")):
            cloudpickle.register_pickle_by_value(module)
    return campaign.recipe


def _check_workers(client, address, job):
    """How many threads the workers have. Raises SetupError if there is none, or one that must not fly."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise SetupError(f"the scheduler at {address} has no workers: start them with ./fledge exec dask-worker "
                         f"{address}") from None

    def check():        # goes to the workers as it is: they may have no Fledge
        try:
            from fledge.montecarlo.worker import check_job
        except ImportError as error:
            return f"cannot import fledge ({error}): start it with ./fledge exec dask-worker"
        return check_job(job)

    for worker, problem in client.run(check).items():
        if problem:
            raise SetupError(f"the worker {worker} {problem}")
    return max(1, sum(one["nthreads"] for one in client.scheduler_info()["workers"].values()))


def _fly_task(job, first, end):
    """The shares of these runs, as bytes; or (address of the worker, why it must not fly)."""
    import distributed

    worker = distributed.get_worker().address
    try:
        from fledge.montecarlo.worker import Refused, fly
    except ImportError as error:
        return worker, f"cannot import fledge ({error}): start it with ./fledge exec dask-worker"
    try:
        return fly(job, first, end)
    except Refused as error:
        return worker, str(error)


def _send_away(client, worker, problem):
    """Close a worker that must not fly."""
    import warnings

    async def leave(dask_worker):
        import asyncio

        asyncio.ensure_future(dask_worker.close(nanny=True))

    warnings.warn(f"the worker {worker} {problem}; it is sent away", RuntimeWarning, stacklevel=4)
    client.run(leave, workers=[worker], wait=False)
