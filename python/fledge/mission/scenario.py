# SPDX-License-Identifier: Apache-2.0
"""The scenarios of a loaded mission: the one that is asked for, and what it does before its first run."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fledge.errors import SetupError, did_you_mean, listed
from fledge.objects.si import time_ns


class _Runs(BaseException):
    """The scenario starts its first run; the argument is the duration [s]."""


def chosen(sim: Any, wanted: str | None) -> tuple[str, Callable]:
    """The scenario of that name, or the first: (name, function). Raises SetupError if there is none."""
    known = sim.mission.scenarios
    name = wanted if wanted else next(iter(known), "")
    if name not in known:
        raise SetupError(f"the mission {sim.name} has no scenario '{name}'{did_you_mean(name, known)} it has "
                         + listed(list(known), none="none"))
    return name, known[name]


def set_up(sim: Any, function: Callable) -> float | None:
    """Execute a scenario up to its first run, without plots. Returns the duration of that run [s]; None if there is
    no run, or if a step comes first."""
    def run(duration=None, *_, until=None, **__):
        raise _Runs(time_ns(duration if until is None else until, "run") / 1e9)

    def step(*_, **__):
        raise _Runs(None)

    sim.plots, sim.run, sim.step = False, run, step
    try:
        function(sim)
    except _Runs as first:
        return first.args[0]
    finally:
        del sim.run, sim.step
    return None
