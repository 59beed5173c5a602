# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene of a spacecraft, while it flies: what the viewer begins with, and what comes to its tracks.

The truth is that of the simulation which the server flies, or of a co-simulation's messages. What flight says of its
attitude, position and reference comes from telemetry, as the monitor decodes it: the ghost is what the ground knows.
A spacecraft without a truth is shown by its telemetry alone.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from math import inf, prod
from threading import Lock
from time import monotonic
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from fledge import objects
from fledge.errors import SetupError, listed
from fledge.mission.log import dtype_of, leaves
from fledge.records.series import GOOD, HEAD, Records, nested_names, part, stale_after
from fledge.scene import add_of_mission, facts_of_simulation, page
from fledge.scene.derive import Derivation, Facts

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fledge import _core
    from fledge.ground.database import Monitor
    from fledge.ground.scripts.links import Link
    from fledge.mission.simulation import Simulation
    from fledge.scene.scene import Scene

PERIOD = 0.25       # [s] of wall time between two samples
MOST = 2048         # samples that are kept for browsers which come later
RECENT = 64         # of which the changes are kept for browsers that are there
RADIO = ("RadioLink", "RadioTraffic")       # beside what the scene shows
OF_FLIGHT = ("NavAttitude", "NavOrbit", "AttReference", "AttError")      # outputs of flight, which telemetry brings

Sample = dict[str, tuple[float, bytes]]     # port -> (t [s], message)


@runtime_checkable
class Observing(Protocol):
    """A link that has other messages of a co-simulation besides packets."""

    @property
    def topics(self) -> Mapping[str, object]:
        """All that the run shows to observers."""

    def watch(self, topics: Iterable[str], receive: Callable[[Any], None], /) -> None:
        """Give the messages of these topics to a function, as they come."""


class Port:
    """An output of the mission, of which messages come."""

    def __init__(self, name: str, struct: _core.Struct) -> None:
        self.name, self.type, self.dtype = name, struct.name, dtype_of(struct)
        rows = list(leaves(struct))
        self.fields = {name: field for name, field, _ in rows}
        self.parts = {name: parts for name, _, parts in rows}
        self.names = nested_names(self.fields)

    def packed(self, values: Mapping[str, Any]) -> bytes:
        """The message of numbers by their names, as co-simulations have them: "head.t", "rows[2].axis_B", arrays as
        flat lists. Texts and what the message does not have are left out."""
        import numpy as np

        row = np.zeros(1, self.dtype)
        for name, value in values.items():
            at = row
            try:
                for field, index in re.findall(r"(\w+)(?:\[(\d+)\])?", name):
                    at = at[field][:, int(index)] if index else at[field]
            except (ValueError, IndexError):
                continue
            if at.dtype.kind in "fiu":
                at[...] = np.reshape(value, at.shape[1:])
        return row.tobytes()


class Window(Records[Port]):
    """The messages of some samples. What telemetry has not brought anew when it became stale stands in a sample with
    the sample's time, too.

    single: it is one sample, of which the end counts: what led to it has been there
    """

    def __init__(self, label: str, ports: Mapping[str, Port], samples: list[Sample],
                 periods: Mapping[str, float]) -> None:
        import numpy as np

        self._label = label
        self._all = list(ports.values())
        self._messages = {}
        self.single = len(samples) == 1
        ends = list(map(end_of, samples))
        for port in self._all:
            old = stale_after(periods.get(port.name.rpartition(".")[0], inf)) if port.type in OF_FLIGHT else inf
            rows: list[tuple[float, bytes]] = []
            for end, sample in zip(ends, samples):
                t, message = sample.get(port.name, (-inf, b""))
                for at in (t, end) if end - t > old else (t,):
                    if at > (rows[-1][0] if rows else -inf) and message:    # a message holds until the next
                        rows.append((at, message))
            self._messages[port.name] = (np.array([t for t, _ in rows], dtype=float),
                                         np.frombuffer(b"".join(message for _, message in rows), port.dtype))

    def _ports(self) -> list[Port]:
        return self._all

    def _time(self, port: Port) -> NDArray[Any]:
        return self._messages[port.name][0]

    def _values(self, port: Port) -> NDArray[Any]:
        return self._messages[port.name][1]

    def executives(self) -> list[Port]:
        return []


class Feed:
    """The scene of one spacecraft of the control room.

    craft: its name there; simulation: of its mission, or None; monitor: of its telemetry, or None
    flown: the server flies this simulation, so that its outputs are the truth
    link: gives the link of the moment, below its frames; of a co-simulation its messages are the truth
    zero: [ns] of the spacecraft's clock at the time 0 of the mission's simulation
    """

    def __init__(self, craft: str, simulation: Simulation | None, monitor: Monitor | None = None, flown: bool = True,
                 link: Callable[[], Link | None] = lambda: None, zero: int = 0) -> None:
        self.craft, self._simulation, self._monitor, self._flown, self._link = craft, simulation, monitor, flown, link
        self._zero = zero
        self._lock = Lock()
        self._samples: list[Sample] = []
        self._recent: deque[tuple[int, Sample]] = deque(maxlen=RECENT)
        self._texts: dict[int, dict[str, Any]] = {}      # number -> message
        self._number = 0
        self._sources: list[Callable[[Derivation], Any]] = []   # of the tracks; [] before the first scene
        self._used: set[str] | None = None
        self._next = 0.0
        self._slots: dict[str, list[tuple[str, list[int]]]] | None = None   # port -> (field, its slots)
        self._watched: Observing | None = None          # the link that delivers messages here
        self._received: dict[str, Any] = {}                # port -> its newest message, as a co-simulation has it
        self._truth: dict[str, Port] = {}
        self.flight_ports: dict[str, Port] = {}
        self.periods: dict[str, float] = {}     #: [s] of the instances that a task runs
        self._flights: set[str] = set()
        self._places: dict[str, int] = {}               # process of flight -> slot of its mode
        self._modes: dict[str, list[tuple[float, str]]] = {}    # process -> (t [s], mode) since when telemetry has it
        self._outputs: dict[str, Any] = {}
        if simulation is None:
            return
        self._flights = flights = {flight.name for flight in simulation.flights}
        for process in simulation.processes:
            for instance in process:
                for field in objects.struct(instance).fields:
                    if field.group == "out" and field.struct and not field.shape:
                        name, port = f"{objects.path(instance)}.{field.name}", Port
                        if process.name in flights:
                            if field.struct.name in OF_FLIGHT:
                                self.flight_ports[name] = port(name, field.struct)
                        else:
                            self._truth[name] = port(name, field.struct)
                            self._outputs[name] = getattr(instance, field.name)
        self.facts: Facts = facts_of_simulation(simulation)
        self.facts.periods = self.periods = periods_of(simulation)

    # --- the thread that has the link ---

    def sample(self) -> None:
        """Take what is there now, at most once in PERIOD; for the thread that flies, between two runs."""
        now = monotonic()
        if now < self._next or self._simulation is None:
            return
        self._next = now + PERIOD
        self._watch()
        sample = self._true() | self._from_telemetry()
        self._note_modes()
        if not sample:
            return
        t = end_of(sample)
        with self._lock:
            last = end_of(self._samples[-1]) if self._samples else None
            if last is not None and t < last:       # it was reset, or another session began
                self._samples.clear()
                self._recent.clear()
                self._texts.clear()
                self._modes.clear()
                self._number += 1
                self._texts[self._number] = {"kind": "truth", "craft": self.craft, "again": True}
                self._recent.append((self._number, {}))
            elif last is not None and t == last:
                return
            self._number += 1
            self._samples.append(sample)
            self._recent.append((self._number, sample))
            if len(self._samples) > MOST:
                self._thin()

    def _true(self) -> Sample:
        """What the world does."""
        if not self._flown:
            return self._packed(self._truth)
        assert self._simulation is not None
        t = float(self._simulation.state_time)
        if self._simulation.time_ns < 0:
            return {}
        return {name: (t, objects.memory(output)) for name, output in self._outputs.items()
                if self._used is None or name in self._used}

    def _packed(self, names: Iterable[str]) -> Sample:
        """What was received: packed only when it is sampled, for most messages are followed by others before."""
        newest = dict(self._received)   # at once, as the link's thread adds to it
        return {name: (newest[name].t / 1e9, self._truth[name].packed(newest[name])) for name in names
                if name in newest}

    def _from_telemetry(self) -> Sample:
        """The newest outputs of flight, each with its time."""
        import numpy as np

        sample: Sample = {}
        if self._monitor is None or not self.flight_ports:
            return sample
        if self._slots is None:
            self._slots = self._slots_of_ports()
        for name, fields in self._slots.items():
            port = self.flight_ports[name]
            row = np.zeros(1, port.dtype)
            row["head"]["quality"] = GOOD       # where telemetry has no head
            times = set()
            for field, slots in fields:
                newest = [value for slot in slots if (value := self._monitor.newest(slot))]
                if len(newest) < len(slots):
                    break
                times |= {value[0] for value in newest}
                at = part(row, field)
                at[...] = np.array([value[2] for value in newest]).reshape(at.shape[1:])
            else:
                if len(times) == 1:     # else a packet came in between
                    row["head"]["t"] = t = times.pop() - self._zero     # flight sends what it writes, at once
                    sample[name] = (t / 1e9, row.tobytes())
        return sample

    def _note_modes(self) -> None:
        """The modes of flight, when telemetry brings another one."""
        if self._monitor is None:
            return
        for process, slot in self._places.items():
            newest = self._monitor.newest(slot)
            began = self._modes.get(process, [])
            if newest is not None and newest[3] and (not began or began[-1][1] != newest[3]):
                self._modes[process] = [*began, ((newest[0] - self._zero) / 1e9, str(newest[3]))]

    def _slots_of_ports(self) -> dict[str, list[tuple[str, list[int]]]]:
        """Which parameters of telemetry have the fields of flight's outputs: "flight.filter.attitude.sigma_BN[1]"."""
        assert self._monitor is not None
        places: dict[str, list[int]] = {}
        for slot in self._monitor.slots():
            places.setdefault(slot["name"].partition("[")[0], []).append(slot["slot"])
        self._places = {process: places[f"{process}.housekeeping.mode"][0] for process in self._flights
                        if f"{process}.housekeeping.mode" in places}
        ports = {}
        for name, port in self.flight_ports.items():
            fields = []
            for field, about in port.fields.items():
                slots = places.get(f"{name}.{field}", [])
                if len(slots) == prod(about.shape):
                    fields.append((field, slots))
            if any(not field.startswith(HEAD) for field, _ in fields):
                ports[name] = fields
        return ports

    def _watch(self) -> None:
        """Take the messages of a co-simulation."""
        link = None if self._flown else self._link()
        if link is self._watched or not isinstance(link, Observing):
            return
        self._watched = link
        topics = {topic_of(name): port for name, port in self._truth.items()}

        def receive(message: Any) -> None:
            if (port := topics.get(message.topic)) and message.t >= 0 and (
                    self._used is None or port.name in self._used or port.type in RADIO):
                self._received[port.name] = message

        link.watch(sorted(set(topics) & set(link.topics)), receive)

    def _thin(self) -> None:
        """Give all but the newest quarter of the samples an even spacing, of half as many."""
        times = list(map(end_of, self._samples))
        newest = len(times) - MOST // 4
        gap, last, samples = (times[newest] - times[0]) / (MOST // 2), float("-inf"), []
        for i, (t, sample) in enumerate(zip(times, self._samples)):
            if i >= newest or t - last >= gap:
                samples.append(sample)
                last = t
        self._samples = samples

    def newest(self, *types: str) -> dict[str, tuple[float, np.void]]:
        """Output -> (t [s], message, a record of NumPy): the newest ones of some types, of the world and in telemetry;
        for the thread that has the link."""
        import numpy as np

        ports = {name: port for name, port in (self._truth | self.flight_ports).items() if port.type in types}
        sample = self._packed(ports) | self._from_telemetry()
        if self._flown and self._simulation and self._simulation.time_ns >= 0:
            t = float(self._simulation.state_time)
            sample |= {name: (t, objects.memory(self._outputs[name])) for name in ports if name in self._outputs}
        return {name: (t, np.frombuffer(message, ports[name].dtype)[0]) for name, (t, message) in sample.items()
                if name in ports}

    # --- all threads ---

    def pack(self) -> bytes:
        """The scene, with all that is known of its tracks, as the viewer reads it. Raises SetupError that names what is
        missing."""
        derivation = self._derived()
        data, tracks = page.pack_growing(derivation.scene)
        with self._lock:
            if not self._sources:
                self._used, self._sources = derivation.used, [track.source for track in tracks]
        return data

    def scene(self) -> Scene:
        """The scene, with all that is known of its tracks. Raises SetupError that names what is missing."""
        return self._derived().scene

    def since(self, number: int) -> tuple[int, list[dict[str, Any]]]:
        """(the number of the newest sample, what the tracks got after a number): texts for browsers."""
        with self._lock:
            if not self._sources:
                return number, []
            for old in set(self._texts) - {n for n, _ in self._recent}:
                del self._texts[old]
            news = []
            for n, sample in self._recent:
                if n > number and (sample or number):       # an empty one: read the scene again; a new page just did
                    if n not in self._texts:
                        self._texts[n] = self._message(sample)
                    news.append(self._texts[n])
            return self._number, news

    def _ports(self) -> dict[str, Port]:
        return {name: port for name, port in (self._truth | self.flight_ports).items()
                if self._used is None or name in self._used}

    def _derived(self) -> Derivation:
        if self._simulation is None:
            raise SetupError(f"{self.craft}: there is no 3-D view: it needs the spacecraft's mission; there is a "
                             "database alone")
        with self._lock:
            samples = list(self._samples)
        came = {name for sample in samples for name in sample}
        coming = came | set(self._slots or {}) | {name for name in self._truth if self._watched is not None
                                                  and topic_of(name) in self._watched.topics}
        ports = {name: port for name, port in self._ports().items() if name in coming}
        if not any(ports[name].type in ("CraftState", "NavAttitude") for name in came if name in ports):
            raise SetupError(self._missing())
        derivation = Derivation(Window(self.craft, ports, samples, self.periods), self.facts, live=True)
        derivation.add_flight()
        derivation.add_plots()
        scene = derivation.scene
        scene.modes = {process: list(began) for process, began in self._modes.items()}
        scene.end = max(map(end_of, samples))
        self._explain(scene)
        if self.facts.folder is not None:
            add_of_mission(scene, self.facts.folder)
        return derivation

    def _explain(self, scene: Scene) -> None:
        """What is not shown, and why."""
        for craft in scene.crafts:
            if not any(pose.kind == "estimate" for pose in craft.poses) and craft.path not in self.flight_ports:
                scene.notes.append(f"Telemetry has no attitude of {craft.name} by navigation (NavAttitude): there is "
                                   "no ghost.")
        if not any(port.type == "CraftState" for port in self._truth.values() if self._used is None or
                   port.name in self._used):
            scene.notes.append("There is no truth: the spacecraft is shown as telemetry says.")

    def _missing(self) -> str:
        """Why there is nothing to show."""
        states = [name for name, port in self._truth.items() if port.type == "CraftState"]
        if self._flown:
            return f"{self.craft}: the simulation has not run yet"
        if self._watched is not None:
            topics = [topic_of(name) for name in states]
            absent = [topic for topic in topics if topic not in self._watched.topics]
            if absent:
                return (f"{self.craft}: the co-simulation does not show {listed(absent)} to observers; give it "
                        f"watch = {absent} in its file")
            return f"{self.craft}: nothing has come of {listed(topics)} yet"
        if any(port.type == "NavAttitude" for port in self.flight_ports.values()):
            return f"{self.craft}: telemetry has not brought an attitude yet: " + listed(
                [name for name, port in self.flight_ports.items() if port.type == "NavAttitude"])
        if self._link() is None:
            return f"{self.craft}: the link is not up"
        return (f"{self.craft}: a 3-D view needs the truth of a simulation, or a NavAttitude and a NavOrbit among "
                "flight's outputs; this mission's flight has none")

    def _message(self, sample: Sample) -> dict[str, Any]:
        """What a sample adds to the tracks, by their numbers: (times, their numbers one row after the other)."""
        import numpy as np

        later = Derivation(Window(self.craft, self._ports(), [sample], self.periods), self.facts, live=True)
        tracks = {}
        for number, source in enumerate(self._sources):
            new = source(later)
            if len(new.time):
                columns = [getattr(new, name) for name in ("r", "v", "q", "values") if hasattr(new, name)]
                columns += [] if new.written is None else [new.written[:, None]]
                numbers = np.hstack(columns).ravel()
                tracks[number] = [new.time.tolist(), [x if abs(x) < np.inf else None for x in numbers.tolist()]]
        return {"kind": "truth", "craft": self.craft, "end": end_of(sample), "tracks": tracks,
                "modes": {process: began[-1] for process, began in self._modes.items()}}


def periods_of(simulation: Simulation) -> dict[str, float]:
    """[s] The periods of the instances that tasks run."""
    periods: dict[str, float] = {}
    for process in simulation.processes:
        for task in process.tasks:
            for name in task.run:
                path = f"{process.name}.{name}"
                periods[path] = min(periods.get(path, inf), task.period / 1e9)
    return periods


def end_of(sample: Sample) -> float:
    """[s] The time of its newest message."""
    return max(t for t, _ in sample.values())


def topic_of(name: str) -> str:
    """The topic of a co-simulation that has the messages of an output."""
    return "/" + name.replace(".", "/")
