# SPDX-License-Identifier: Apache-2.0
"""Many flights at a time, in processes of this machine or on a cluster.

Example:

    from fledge.pool import Died, Work, open_pool

    class Squares(Work[int, int]):
        def fly(self, item: int) -> int:
            return item * item

    with open_pool(jobs=2) as pool:
        for place, result in pool.fly(Squares(), [1, 2, 3]):    # as they come; in_order() has the order of the items
            print(place, result.text if isinstance(result, Died) else result)

A process that dies costs its item alone: a Died stands in place of its result, and the others go on. An error of Fledge
(SetupError, RunError, Failure) is raised where the results are read; any other exception ends its process, with a
traceback. Ctrl-C reaches only the reader of the results: when the reader ends, for any reason, the processes end.

    work        the interfaces of a pool, and of its items and their flights
    children    copies of this process, which answer through pipes
    local       a pool of them
    cluster     the workers of a Dask scheduler
    worker      how such a worker flies an item
"""

from __future__ import annotations

from fledge.pool.children import Children, cores, fork, leave
from fledge.pool.local import Local
from fledge.pool.work import LAST_LINES, Died, Pool, Work, anywhere, in_order

__all__ = ["LAST_LINES", "Children", "Died", "Local", "Pool", "Work", "anywhere", "cores", "fork", "in_order", "leave",
           "open_pool"]


def open_pool(jobs: int | None = None, scheduler: str | None = None) -> Pool:
    """A pool of so many processes, default: one for each core; or of the workers of the Dask scheduler at an address,
    as "tcp://127.0.0.1:8786". A context manager. Raises SetupError if there is none, or no worker."""
    if scheduler:
        from fledge.pool.cluster import Cluster

        return Cluster(scheduler)
    return Local(jobs)
