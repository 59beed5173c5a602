# SPDX-License-Identifier: Apache-2.0
"""Random missions, each flight process on a target at random, against the desktop: equal hashes, or the number of the
mission that repeats the difference.

    ./fledge bench flights --count 1000 --seed 5
"""
from __future__ import annotations

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from fledge.montecarlo import cores
from fledge.progress import Progress
from fledge.targets.testing import fly_mission


def one(number: int) -> tuple[int, str, str]:
    """(number, what flew where, what is wrong or "")"""
    with tempfile.TemporaryDirectory(prefix="fledge-flights-") as folder:
        try:
            return number, *fly_mission(number, Path(folder))
        except Exception as error:      # whatever it is, the others fly
            return number, "", f"{type(error).__name__}: {error}"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="fledge bench flights",
                                     epilog="example: ./fledge bench flights --count 1000 --seed 5")
    parser.add_argument("--count", type=int, default=100, help="how many missions (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="the number of the first (default %(default)s)")
    parser.add_argument("--verbose", action="store_true", help="a line for each mission")
    chosen = parser.parse_args(arguments)
    wrong, processes = [], 0
    with ProcessPoolExecutor(cores()) as pool, Progress("flights", 0, chosen.count) as bar:
        numbers = range(chosen.seed, chosen.seed + chosen.count)
        for n, (number, flown, problem) in enumerate(pool.map(one, numbers), 1):
            bar.at(n)
            processes += flown.count("=")
            if chosen.verbose:
                print(f"{number:6}  {flown}", flush=True)
            if problem:
                wrong.append(number)
                print(f"{number:6}  {flown}\n        {problem}\n        again: ./fledge bench flights --count 1 --seed "
                      f"{number}", flush=True)
    print(f"{chosen.count - len(wrong)} of {chosen.count} missions, {processes} flight processes: equal hashes")
    return 1 if wrong else 0
