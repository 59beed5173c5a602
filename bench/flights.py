# SPDX-License-Identifier: Apache-2.0
"""Random missions, each flight process on a target at random, against the desktop: equal hashes, or the number of the
mission that repeats the difference.

    ./fledge bench flights --count 1000 --seed 5
    ./fledge bench flights --on micropython
"""
from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from fledge.pool import cores
from fledge.targets import TARGETS
from fledge.targets.testing import fly_mission


def fly_drawn(number: int, names: Sequence[str]) -> tuple[int, str, str]:
    """(number, the mission and target that flew, the problem or "")"""
    with tempfile.TemporaryDirectory(prefix="fledge-flights-") as folder:
        try:
            return number, *fly_mission(number, Path(folder), names)
        except Exception as error:      # whatever it is, the others fly
            return number, "", f"{type(error).__name__}: {error}"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="fledge bench flights",
                                     epilog="example: ./fledge bench flights --count 1000 --seed 5")
    parser.add_argument("--count", type=int, default=100, help="how many missions (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="the number of the first (default %(default)s)")
    parser.add_argument("--on", metavar="TARGET,...", help="only these targets (default: all that are installed)")
    parser.add_argument("--verbose", action="store_true", help="a line for each mission")
    chosen = parser.parse_args(arguments)
    names = chosen.on.split(",") if chosen.on else []
    for name in names:
        if name not in TARGETS or name == "desktop":
            parser.error(f"--on takes targets other than the desktop: {', '.join(list(TARGETS)[1:])}; found {name}")
    wrong, processes = [], 0
    numbers = range(chosen.seed, chosen.seed + chosen.count)
    with ProcessPoolExecutor(cores()) as pool:
        for number, flown, problem in pool.map(partial(fly_drawn, names=names), numbers):
            processes += flown.count("=")
            if chosen.verbose:
                print(f"{number:6}  {flown}", flush=True)
            if problem:
                wrong.append(number)
                on = f" --on {chosen.on}" if chosen.on else ""
                print(f"{number:6}  {flown}\n        {problem}\n        again: ./fledge bench flights --count 1 --seed "
                      f"{number}{on}", flush=True)
    print(f"{chosen.count - len(wrong)} of {chosen.count} missions, {processes} flight processes: equal hashes")
    return 1 if wrong else 0
