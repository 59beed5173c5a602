# SPDX-License-Identifier: Apache-2.0
"""For tests: random missions of several flight processes, each process flown on a target at random.

    fly_mission(7, folder)      # the mission of the number 7, and what differs from the desktop

The mission is a text, a mission.py, because some targets read it.
"""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from random import Random

from fledge import flight, objects
from fledge.archive import Archive
from fledge.archive.compare import compare, digest
from fledge.objects.testing import kinds
from fledge.targets import TARGETS, Job, fly
from fledge.targets.desktop import Desktop

flight.TYPES.update(kinds()[1])     # so that a mission finds fsw.Noise

MS = 1e-3
DURATION = 4.0      # [s]
PHASES = ["NOT_SAFE", "SAFE", "SCIENCE", "DRAIN"]
# Fields of a Kinds that conditions compare: with one another within a row.
NUMBERS = ["i8", "u8", "i16", "i32", "u32", "i64", "u64", "single"]
CONSTANTS = [0, 1, -2, 0.5, 126, 32766, 2**53, 2**53 + 1, -2**53 - 1, 2**62 + 1, 2**63 - 3]
HEAD = """from fledge import Orbit, flight as fsw, world
from fledge.units import km

try:
    import fledge.targets.testing
except ImportError:
    pass


def build(sim):
"""


# --- a mission -------------------------------------------------------------------------------------

class Draft:
    """The text of the random mission of a number."""

    def __init__(self, number: int) -> None:
        self.dice = dice = Random(number)
        self.lines: list[str] = []
        self.instances: list[tuple[str, str, str]] = []     # (process, name, type)
        self.modes: dict[str, list[str]] = {}   # by process
        self.flights = [f"p{k}" for k in range(dice.randint(1, 4))]
        names = list(self.flights)
        self.has_world = dice.random() < 0.4
        if self.has_world:
            names.insert(dice.randint(0, len(names)), "world")      # flight may run before the world, too
        for name in names:
            if name == "world":
                self.world()
            else:
                self.flight(name)
        self.connect()
        for name in self.flights:
            self.events(name)

    @property
    def text(self) -> str:
        return HEAD + "".join(f"    {line}\n" for line in self.lines)

    def vector(self, most: float) -> list[float]:
        return [self.dice.uniform(-most, most) for _ in range(3)]

    def world(self) -> None:
        self.lines += [
            'w = sim.add_world("world")',
            "w.craft = world.Spacecraft(I_B=[7, 8, 9], gravity=[world.MARS], orbit=Orbit(world.MARS, a=7400 * km, "
            f"e=0.1), sigma_BN={self.vector(0.4)}, omega_BN_B={self.vector(1)})",
            "w.nav = world.Navigation(attitude_noise=[1e-3] * 3, "
            f"position_noise=[{self.dice.choice([0, 5])}] * 3)",
            "w.connect(w.craft.state >> w.nav.truth)",
            f'w.task("truth", every={self.dice.choice([20, 50, 70]) * MS}, run=[w.craft, w.nav])']

    def make(self, process: str, name: str, type: str, **values: object) -> None:
        given = ", ".join(f"{key}={value!r}" for key, value in values.items())
        self.lines.append(f"{process}.{name} = fsw.{type}({given})")
        self.instances.append((process, name, type))

    def module(self, process: str, kind: str, name: str) -> None:
        """A module of a kind, with random parameters."""
        dice, vector = self.dice, self.vector
        if kind == "noise":
            self.make(process, name, "Noise", seed=dice.randrange(2**63), x=dice.uniform(0, 3),
                      step=dice.randint(-9, 9), wide=[dice.randint(1 - 2**63, 2**63 - 1), 7],
                      phase=dice.choice(PHASES))
        elif kind == "turn":
            self.make(process, name, "EulerRotation", angles=vector(1), rates=vector(3))
        elif kind == "spin":
            self.make(process, name, "InertialSpin", omega_RR0_R0=vector(2))
        elif kind == "base":
            self.make(process, name, "BaseReference", hold=dice.choice([0.03, 0.2]),
                      source=dice.choice(["COMMANDED", "OWN"]))
        elif kind == "rasters":
            self.make(process, name, "RasterManager", angles=[vector(1) for _ in range(3)],
                      rates=[vector(1) for _ in range(3)], repeat=dice.randint(0, 1),
                      durations=[dice.uniform(0.05, 1.5) for _ in range(3)])
        elif kind == "rest":
            self.make(process, name, "InertialPointing", sigma_RN=vector(0.3))
        elif kind == "nadir":
            self.make(process, name, "HillPointing")
        elif kind == "beacon":
            self.make(process, name, "OrbitBeacon", lead=dice.uniform(0, 2))
        else:
            self.make(process, name, "TrackingError", sigma_BcB=vector(0.3))

    def flight(self, process: str) -> None:
        dice = self.dice
        known = ["noise", "turn", "spin", "base", "rasters", "rest"] + ["nadir", "beacon", "error"] * self.has_world
        self.lines.append(f'{process} = sim.add_flight("{process}")')
        # Configuration in no task, whose outputs may cross, too.
        self.module(process, "rest", "still")
        self.make(process, "flags", "Flags", x=dice.uniform(-3, 3), i64=dice.randint(1 - 2**63, 2**63 - 1),
                  phase=dice.choice(PHASES))
        tasks = []
        for t in range(dice.randint(1, 3)):
            run: list[str] = []
            for kind in ["noise", *dice.choices(known, k=dice.randint(1, 3))]:
                run.append(f"{kind}{t}{len(run)}")
                self.module(process, kind, run[-1])
            tasks.append(f"task{t}")
            self.lines.append(
                f'{process}.task("task{t}", every={dice.choice([10, 20, 30, 50, 70, 250]) * MS}, '
                f"offset={dice.choice([0, 0, 0, 5, 10, 35]) * MS}, priority={dice.randint(0, 2)}, "
                f"run=[{', '.join(f'{process}.{name}' for name in run)}])")
        self.modes[process] = [f"mode{k}" for k in range(dice.randint(1, 3))] if dice.random() < 0.6 else []
        ports = [f"{name}.kinds" for p, name, type in self.instances if p == process and type == "Noise"]
        for mode in self.modes[process]:
            given = [repr(dice.sample(tasks, dice.randint(0, len(tasks))))]
            if dice.random() < 0.3:
                given.append(f"when={self.condition(process, ports)}")
            if dice.random() < 0.2:
                given.append(f"after={dice.sample(self.modes[process], 1)!r}")
            self.lines.append(f'{process}.mode("{mode}", {", ".join(given)})')

    def connect(self) -> None:
        """Wire each input to an output of its type anywhere; optional ones often."""
        dice = self.dice
        outputs: dict[str, list[tuple[str, str]]] = {}
        if self.has_world:
            from fledge import world

            for field in objects.struct(world.Navigation).fields:
                if field.group == "out":
                    outputs.setdefault(field.struct.name, []).append(("w", f"nav.{field.name}"))
        for process, name, type in self.instances:
            for field in objects.struct(flight.TYPES[type]).fields:
                if field.group == "out":
                    outputs.setdefault(field.struct.name, []).append((process, f"{name}.{field.name}"))
        latencies: dict[tuple[str, str, str], int] = {}
        for process, name, type in self.instances:
            for field in objects.struct(flight.TYPES[type]).fields:
                writers = outputs.get(field.struct.name) if field.group == "in" else None
                if not writers or field.optional and dice.random() < 0.2:
                    continue
                there, port = dice.choice(writers)
                # A process reads one output at one latency; within a process there is none.
                latency = 0 if process == there else latencies.setdefault((process, there, port), dice.randint(0, 1))
                stale = f".stale_after({dice.choice([1, 15, 40, 120]) * MS})" if dice.random() < 0.4 else ""
                self.lines.append(f"{process}.connect(({there}.{port} >> {process}.{name}.{field.name})"
                                  f".latency({latency}){stale})")

    def events(self, process: str) -> None:
        dice, modes = self.dice, self.modes[process]
        ports = [f"{name}.kinds" for p, name, type in self.instances if p == process and type == "Noise"]
        for k in range(dice.choice([0, 1, 2, 4])):
            given = [f"when={self.condition(process, ports)}"]
            if not modes or dice.random() < 0.4:
                value = dice.randint(1 - 2**63, 2**63 - 1)
                given.append(f"set=[({process}.watch({process}.flags).i64, {value})]")
            else:
                given.append(f"enter={dice.choice(modes)!r}")
            if k and dice.random() < 0.5:
                given.append(f'{dice.choice(["arm", "disarm"])}="event{dice.randrange(k)}"')
            once = dice.random() < 0.2
            given += [f"hold={dice.choice([0, 0, 40, 110]) * MS}", f"count={dice.randint(1, 3)}", f"once={once}",
                      f"armed={dice.random() < 0.8}"]
            if modes and dice.random() < 0.3:
                given.append(f"modes={dice.sample(modes, 1)!r}")
            if not once and dice.random() < 0.3:
                given.append(f"until={self.condition(process, ports, 0)}")
            self.lines.append(f'{process}.event("event{k}", {", ".join(given)})')

    def condition(self, process: str, ports: Sequence[str], depth: int = 2) -> str:
        dice = self.dice
        if depth and dice.random() < 0.6:
            a, b = self.condition(process, ports, depth - 1), self.condition(process, ports, depth - 1)
            return dice.choice([f"({a}) & ({b})", f"({a}) | ({b})", f"~({a}) & ({b})"])
        port = f"{process}.watch({process}.{dice.choice(ports)})"
        if dice.random() < 0.3:
            return f"{port}.phase == {dice.choice(PHASES)!r}"
        if dice.random() < 0.2:
            return f"{port}.parts[{dice.randrange(3)}].pairs[1].count > {dice.choice(CONSTANTS)}"
        if dice.random() < 0.2:
            return f"{port}.wide.max_abs() > {dice.choice(CONSTANTS)}"
        a, b = dice.sample(NUMBERS, 2)
        relation = dice.choice(["<", "<=", ">", ">=", "==", "!="])
        return f"{port}.{a} {relation} " + (f"{port}.{b}" if dice.random() < 0.5 else f"{dice.choice(CONSTANTS)}")


# --- a flight --------------------------------------------------------------------------------------

def fly_mission(number: int, folder: Path, names: Sequence[str] = ()) -> tuple[str, str]:
    """Fly the mission of a number on the desktop, and once more with each process on a target at random, of those named
    or of all. Returns ("p0=cfs,p1=linux: 812 messages", the first difference or "")."""
    mission = folder / "random"
    mission.mkdir(parents=True, exist_ok=True)
    (mission / "mission.py").write_text(Draft(number).text)
    job = Job(str(mission), duration=DURATION, folder=folder / "out", free=True, seed=number, roots=[kinds()[0]])
    dice = Random(-number - 1)
    installed = list(names) or [name for name, target in TARGETS.items() if name != "desktop" and not target.missing()]
    on = {part.process: dice.choice(installed) for part in job.parts}
    desktop = Desktop().fly(job)
    flown = fly(job, {process: TARGETS[name] for process, name in on.items()}, "apart")
    words = ",".join(f"{process}={name}" for process, name in on.items())
    messages, hashes, first = 0, [], ""
    for part in job.parts:
        with Archive(desktop[part.process].record) as a, Archive(flown[part.process].record) as b:
            differences = compare(a, b, part.outputs, times=part.is_instant)
            first = first or (str(differences[0]) if differences else "")
            hashes.append([digest(record, part.outputs, part.is_instant) for record in (a, b)])
            messages += sum(b.topics[topic].count for topic in part.outputs)
    if not first and any(a != b for a, b in hashes):
        first = "the hashes differ"
    return f"{words}: {messages} messages", first
