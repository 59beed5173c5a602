# SPDX-License-Identifier: Apache-2.0
"""The scenarios of a loaded mission: the one that is asked for, and what it does before its first run."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import redirect_stdout
from io import StringIO
from typing import Any, NoReturn

from fledge.errors import CompositionError, SetupError, did_you_mean, listed
from fledge.objects.si import time_ns


class _Runs(BaseException):
    """The scenario starts its first run; the argument is the duration [s]."""


def chosen(sim: Any, wanted: str | None) -> tuple[str, Callable]:
    """The scenario of that name, or the first: (name, function). Raises SetupError if there is none."""
    known = sim.mission.scenarios
    name = wanted if wanted else next(iter(known), "")
    if name not in known:
        raise SetupError(f"the mission {sim.name} has no scenario '{name}'{did_you_mean(name, known)} it has "
                         + listed(list(known)))
    return name, known[name]


def lacking(sim: Any, names: Iterable[str]) -> dict[str, list[tuple[str, int, str]]]:
    """Scenarios that would begin to fly a mission that cannot fly: name -> its `problems` then. Where the mission as it
    was loaded, `sim`, has problems, each scenario is executed up to its first run, for it may give what is missing.
    Raises MissionError where it fails on the way."""
    from fledge.mission.folder import MissionError, explain, load

    if not sim.problems:
        return {}
    found = {}
    for name in names:
        fresh = load(sim.mission.folder, sim.seed, **sim.mission.parameters)
        try:
            assert fresh.mission    # load() gives one
            with redirect_stdout(StringIO()):   # what it says is for its flight
                set_up(fresh, fresh.mission.scenarios[name])
        except CompositionError:
            pass
        except Exception as error:
            raise MissionError(explain(error, sim.mission.folder), error) from None
        if problems := fresh.problems:
            found[name] = problems
    return found


def set_up(sim: Any, function: Callable) -> float | None:
    """Execute a scenario up to its first run, without plots. Returns the duration of that run [s]; None if there is
    no run, or if a step comes first."""
    def run(duration: Any = None, *_: Any, until: Any = None, **__: Any) -> NoReturn:
        raise _Runs(time_ns(duration if until is None else until, "run") / 1e9)

    def step(*_: Any, **__: Any) -> NoReturn:
        raise _Runs(None)

    sim.plots, sim.run, sim.step = False, run, step
    try:
        function(sim)
    except _Runs as first:
        return first.args[0]
    finally:
        del sim.run, sim.step
    return None
