# SPDX-License-Identifier: Apache-2.0
"""A scenario on the desktop, to find its set-up, its duration and its changes of flight between its runs, which become
commands. Its plots are left out; its checks must hold, as far as it is flown."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, NoReturn

from fledge import export, mission as missions, objects
from fledge.commands import Code, moved, parameters, sequence_of
from fledge.errors import Failure, SetupError
from fledge.mission.checks import has_checks
from fledge.mission.commands import block_bytes
from fledge.mission.scenario import chosen, set_up
from fledge.objects.si import time_ns
from fledge.requirements import Outcome, Requirements
from fledge.requirements.judge import problem_of


class Command(NamedTuple):
    """What a scenario changes of flight between two runs, as one command."""
    after: int              # [ns] the end of the run before; -1: before the first
    process: str
    packet: bytes


class _Ends(BaseException):
    """The duration of the flight is over."""


def rehearse(mission: str, scenario: str | None = None, duration: float | None = None, seed: int = 0,
             free: bool = False, given: dict[str, Any] | None = None,
             before: Callable[[Rehearsal], None] = lambda play: None, judged: bool = False) -> Rehearsal:
    """Returns a Rehearsal. duration: [s], of what is to be flown; None: all that the scenario runs. before: called
    before the first run, with `start` and `missions`. judged: judge the requirements that the scenario shows."""
    def load() -> Any:
        sim = missions.load(mission, **(given or {}))
        sim.seed = seed
        return sim

    sim = load()
    play = Rehearsal(sim, duration, load, before)
    known = sim.mission.scenarios
    if free or scenario is None and not known:
        if duration is None:
            raise Failure(f"the mission {sim.name} has no scenarios, so give a duration with --for")
        play.name = "free"
        play.begin()
        return play
    play.name, function = chosen(sim, scenario)
    required = Requirements(sim).for_scenario(play.name) if judged else []
    play.checked = has_checks(function) or bool(required)
    watch = Requirements(sim).watch([requirement.id for requirement in required]) if required else None
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
        if not play.ready:
            raise       # not the scenario's
        raise Failure(f"the scenario {play.name} fails on the desktop: {error}", 1) from error
    if play.start is None:
        raise Failure(f"the scenario {play.name} runs nothing")
    play.finish()
    if play.whole:
        play.outcomes = watch.outcomes() if watch else []
        play.problem = problem_of(play.outcomes, sim.time)
    return play


class Rehearsal:
    """name; duration [s]; whole: whether the scenario came to its end; start: the simulation as it stood before its
    first run, and missions: its flight processes, exported; script: its commands, in the order of time."""

    def __init__(self, sim: Any, duration: float | None, load: Callable[[], Any],
                 before: Callable[[Rehearsal], None]) -> None:
        self.sim, self.duration, self.load, self.before_runs = sim, duration, load, before
        self.name = ""
        self.whole = False      # the scenario came to its end
        self.checked = False    # whether anything judges it
        self.problem = ""       # then: the verdict on it
        self.outcomes: list[Outcome] = []
        self.ready = True       # False while `before` is called
        self.start: Any = None
        self.missions: list[Any] = []
        self.script: list[Command] = []
        self.in_vain: set[tuple[str, int]] = set()      # (process, sequence) of what the scenario sent in vain
        self.sent_as: dict[tuple[str, int], int] = {}   # (process, sequence) as the scenario sent it -> in the script

    def begin(self) -> None:
        self.missions = export.read_all(self.sim)
        self.sent = {flight.name: 0 for flight in self.sim.flights}
        self.sequence = {flight.name: 0 for flight in self.sim.flights}      # of the next packet in the script
        for flight in self.sim.flights:
            packets = flight.commands.packets
            wanted = [packets.mode(flight.requested_mode)] if flight.requested_mode != flight.active_mode else []
            armed = [packets.arm(e, e.armed) for e in flight.events.values() if e.armed != e.starts_armed]
            self.add(-1, flight, [*armed, *wanted])
        self.start = self.sim.clone()
        self.ready = False
        self.before_runs(self)
        self.ready = True

    def begun(self) -> Any:
        """A simulation that stands before the first run. It is loaded anew, for what the scenario has a world do at a
        time refers to the simulation that the scenario was given, and to none of its clones."""
        sim = self.load()
        if self.name != "free":
            sim.record = lambda *_, **__: None
            set_up(sim, chosen(sim, self.name)[1])
            del sim.record
        return sim

    def add(self, now: int, flight: Any, packets: Iterable[bytes]) -> None:
        """Add commands to the script, then those that the scenario itself has sent since the last time."""
        if flight.commands.spoke_frames:
            raise Failure(f"the scenario commands {flight.name} by frames, which no target gets from it; command by "
                          "sim.flight.commands, or in a co-simulation (docs/ground.md)")
        sent = flight.commands.sent[self.sent[flight.name]:]
        self.sent[flight.name] += len(sent)
        # Those that come first were made last: on the link from the ground, sequences follow the order of sending.
        packets, end = list(packets), flight.commands.packets.sequence
        sent_before = end - len(packets) - self.sequence[flight.name]
        self.sequence[flight.name] = end
        self.script += [Command(now, flight.name, moved(packet, -sent_before)) for packet in packets]
        for t, entry in sent:
            if entry[6:7] == bytes([Code.PDU]):       # counted apart
                self.script.append(Command(t, flight.name, entry))
                continue
            packet = moved(entry, len(packets))
            self.script.append(Command(t, flight.name, packet))
            self.sent_as[flight.name, sequence_of(entry)] = sequence_of(packet)

    def run(self, duration: Any = None, *, until: Any = None, **_: Any) -> None:
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
        type(sim).run(sim, until=end / 1e9)
        self.before = _memory(sim), _requests(sim)

    def flies(self, path: str) -> bool:
        """Whether an instance is of a flight process."""
        return path.partition(".")[0] in [flight.name for flight in self.sim.flights]

    def compare(self, now: int) -> None:
        """Add the changes of the scenario since the last run to the script."""
        sim, (before, requested) = self.sim, self.before
        after, requested_now = _memory(sim), _requests(sim)
        changed = [path for path, memory in after.items() if memory != before[path]]
        for path in changed:
            memory, (owner, name) = after[path], path.split(".")
            _, low, high = parameters(objects.struct(sim.process(owner).instances[name]))
            same = memory[:low] == before[path][:low] and memory[high:] == before[path][high:]
            if not (self.flies(path) and same):
                what = "" if same else ", and not only parameters,"
                raise Failure(f"the scenario {self.name} changes {path}{what} between its runs; a target "
                              "takes only parameters of flight")
        for process in sim.processes:
            if not self.flies(f"{process.name}."):
                if requested[process.name] != requested_now[process.name]:
                    raise Failure(f"the scenario {self.name} asks for a mode or arms an event of {process.name} "
                                  "between its runs; a target takes only those of flight")
                continue
            packets = process.commands.packets
            changes: list[bytes] = []
            for path in changed:
                if path.startswith(f"{process.name}."):
                    module = process.instances[path.partition(".")[2]]
                    changes += packets.change(path, block_bytes(module, before[path]), block_bytes(module))
            (mode, armed), (now_mode, now_armed) = requested[process.name], requested_now[process.name]
            changes += [packets.arm(event, on == 1) for event, on in now_armed.items() if armed.get(event) != on]
            self.add(now, process, changes if mode == now_mode else [*changes, packets.mode(now_mode)])

    def refused(self, *_: object, **__: object) -> NoReturn:
        raise SetupError(f"the scenario {self.name} does more than run: steps, resets and restored states cannot be "
                         "had on a target")

    def finish(self) -> None:
        if self.duration is None:
            self.duration = self.sim.time
        self.in_vain = {(flight.name, self.sent_as.get((flight.name, report.sequence), report.sequence))
                        for flight in self.sim.flights for report in flight.commands.reports if not report.good}
        self.script.sort(key=lambda command: command.after)


def _memory(sim: Any) -> dict[str, bytes]:
    """Path -> bytes of every instance."""
    return {f"{process.name}.{name}": objects.memory(module) for process in sim.processes
            for name, module in process.instances.items()}


def _requests(sim: Any) -> dict[str, tuple[str, dict[str, int]]]:
    """Process -> (the mode that it is in or shall enter, {event: whether and how it is armed})."""
    return {p.name: (p.requested_mode, {name: event.arming for name, event in p.events.items()}) for p in sim.processes}
