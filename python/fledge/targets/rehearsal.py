# SPDX-License-Identifier: Apache-2.0
"""A scenario on the desktop, to find its set-up, its duration and its changes between its runs. Its plots are left
out; its checks must hold, as far as it is flown."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

from fledge import export, mission as missions, objects
from fledge.errors import Failure, SetupError
from fledge.mission.scenario import chosen
from fledge.objects.si import time_ns


@dataclass
class Load:
    """Parameters of a module of flight that the scenario changes between two runs."""
    after: int              # [ns] the last instant of the run before
    path: str               # flight.turn
    block: bytes
    snapshot: bytes         # of the desktop, with all changes of that time


class _Ends(BaseException):
    """The duration of the flight is over."""


def rehearse(mission: str, scenario: str | None = None, duration: float | None = None, seed: int = 0,
             free: bool = False, parameters: dict[str, Any] | None = None) -> Rehearsal:
    """Returns a Rehearsal. duration: [s], of what is to be flown; None: all that the scenario runs."""
    def load():
        return missions.load(mission, **(parameters or {}))

    sim = load()
    sim.seed = seed
    play = Rehearsal(sim, duration)
    known = sim.mission.scenarios
    if free or scenario is None and not known:
        if duration is None:
            raise Failure(f"the mission {sim.name} has no scenarios, so give a duration with --for")
        play.name = "free"
        play.begin()
        return play
    play.name, function = chosen(sim, scenario)
    sim.plots, sim.run = False, play.run
    sim.step = sim.reset = sim.restore = play.refused
    try:
        function(sim)
        play.whole = True
    except _Ends:
        pass
    except (SetupError, Failure):
        raise
    except Exception as error:
        raise Failure(f"the scenario {play.name} fails on the desktop: {error}", 1) from error
    if play.start is None:
        raise Failure(f"the scenario {play.name} runs nothing")
    play.finish(load, seed)
    return play


class Rehearsal:
    """name; duration [s]; whole: whether the scenario came to its end; start: the simulation as it stood before its
    first run, and missions: its flight processes, exported; loads."""

    def __init__(self, sim: Any, duration: float | None) -> None:
        self.sim, self.duration = sim, duration
        self.name = ""
        self.whole = False      # the scenario came to its end
        self.start: Any = None
        self.missions: list[Any] = []
        self.loads: list[Load] = []

    def begin(self) -> None:
        self.missions = export.read_all(self.sim)
        self.start = self.sim.clone()

    def run(self, duration: Any = None, *, until: Any = None, **_) -> None:
        """In place of the simulation's run()."""
        sim = self.sim
        now = max(sim.time_ns, 0)
        end = now + time_ns(duration, "run") if until is None else time_ns(until, "run: until")
        if self.start is None:
            self.begin()
        else:
            self.compare(now)
        limit = None if self.duration is None else round(self.duration * 1e9)
        if limit is not None and end > limit:
            raise _Ends
        type(sim).run(sim, until=end / 1e9, progress=False)
        self.before = sim.snapshot(), _memory(sim)

    def flies(self, path: str) -> bool:
        """Whether an instance is of a flight process."""
        return path.partition(".")[0] in [flight.name for flight in self.sim.flights]

    def compare(self, now: int) -> None:
        """Add the changes of the scenario since the last run to `loads`."""
        sim, (snapshot, before) = self.sim, self.before
        after, changed = _memory(sim), []
        for path, memory in after.items():
            if memory == before[path]:
                continue
            low, high = _parameters(sim, path)
            same = memory[:low] == before[path][:low] and memory[high:] == before[path][high:]
            if not self.flies(path) or not same:
                what = "" if same else ", and not only parameters,"
                raise Failure(f"the scenario {self.name} changes {path}{what} between its runs; a target "
                              "takes only parameters of flight")
            if any(m.path == path for mission in self.missions for m in mission.configuration):
                raise Failure(f"the scenario {self.name} changes {path} between its runs, which flight publishes: "
                              "targets do not take these")
            changed.append((path, memory[low:high]))
        if not changed and sim.snapshot() != snapshot:
            raise Failure(f"the scenario {self.name} asks for a mode between its runs, which no target takes")
        now_so = sim.snapshot() if changed else b""
        self.loads += [Load(now, path, block, now_so) for path, block in changed]

    def refused(self, *_, **__) -> NoReturn:
        raise SetupError(f"the scenario {self.name} does more than run: steps, resets and restored states cannot be "
                         "had on a target")

    def finish(self, load: Callable[[], Any], seed: int) -> None:
        if self.duration is None:
            self.duration = self.sim.time
        if self.loads:
            # The world's program flies without the scenario then, so it must be as its file makes it.
            fresh = load()
            fresh.seed = seed
            fresh.prepare()
            ours, theirs = _memory(self.start), _memory(fresh)
            for path in theirs:
                if not self.flies(path) and ours[path] != theirs[path]:
                    raise Failure(f"the scenario {self.name} changes {path} before it runs, and flight between its "
                                  "runs: the world's program can have only one of them")


def _memory(sim):
    """Path -> bytes of every instance."""
    return {f"{process.name}.{name}": objects.memory(one) for process in sim.processes
            for name, one in process.instances.items()}


def _parameters(sim, path):
    """(from, to) of the parameters in an instance's bytes."""
    process, name = path.split(".")
    fields = [f for f in objects.struct(sim.process(process).instances[name]).fields if f.group == "par"]
    return (fields[0].offset, max(f.offset + f.size for f in fields)) if fields else (0, 0)
