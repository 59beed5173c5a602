# SPDX-License-Identifier: Apache-2.0
"""The scenarios of a loaded mission: the scenario of a given name, and what it does before its first run."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import redirect_stdout
from io import StringIO
from typing import TYPE_CHECKING, Any, NoReturn

from fledge.errors import CompositionError, SetupError, did_you_mean, listed
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation


class _Runs(BaseException):
    """The scenario starts its first run; the argument is the duration [s]."""


def chosen(sim: Simulation, wanted: str | None) -> tuple[str, Callable[[Simulation], object]]:
    """The scenario of that name, or the first: (name, function). Raises SetupError if there is none."""
    assert sim.mission      # load() sets it
    known = sim.mission.scenarios
    name = wanted if wanted else next(iter(known), "")
    if name not in known:
        if name in sim.mission.functions and not name.startswith("_"):
            raise SetupError(f"the mission {sim.name}: {name}() of scenarios.py takes more, or less, than the "
                             "simulation, and is no scenario. Parameters belong to build() of flight.py or world.py, "
                             "as in build(f, stiffness=0.2), and --set gives them")
        raise SetupError(f"the mission {sim.name} has no scenario '{name}'{did_you_mean(name, known)} it has "
                         + listed(list(known)))
    return name, known[name]


def lacking(sim: Simulation, names: Iterable[str]) -> dict[str, list[tuple[str, int, str]]]:
    """Scenarios that would begin to fly a mission that cannot fly: name -> its `problems` then. Where the mission as it
    was loaded, `sim`, has problems, each scenario is executed up to its first run, for it may give what is missing.
    Raises MissionError where it fails on the way."""
    from fledge.mission.folder import MissionError, explain, load

    assert sim.mission      # load() sets it
    if not sim.problems:
        return {}
    scenarios = {}
    for name in names:
        fresh = load(sim.mission.folder, sim.seed, **sim.mission.parameters)
        try:
            assert fresh.mission
            with redirect_stdout(StringIO()):   # its output is for its flight
                set_up(fresh, fresh.mission.scenarios[name])
        except CompositionError:
            pass
        except Exception as error:
            raise MissionError(explain(error, sim.mission.folder), error) from None
        if problems := fresh.problems:
            scenarios[name] = problems
    return scenarios


def set_up(sim: Simulation, function: Callable[[Simulation], object]) -> float | None:
    """Execute a scenario up to its first run, without plots. Returns the duration of that run [s]; None if there is
    no run, or if a step comes first."""
    def run(duration: Any = None, *_: Any, until: Any = None, **__: Any) -> NoReturn:
        raise _Runs(time_ns(duration if until is None else until, "run") / 1e9)

    def step(*_: Any, **__: Any) -> NoReturn:
        raise _Runs(None)

    sim.plots = False
    own = vars(sim)
    own["run"], own["step"] = run, step     # in place of the methods
    try:
        function(sim)
    except _Runs as first:
        return first.args[0]
    finally:
        del own["run"], own["step"]
    return None
