# SPDX-License-Identifier: Apache-2.0
"""For tests: random missions of several flight processes, each process flown on a target at random.

    fly_mission(7, folder)      # the mission of the number 7, and what differs from the desktop
"""
from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any

from fledge import flight as fsw, objects
from fledge.archive import Archive
from fledge.archive.compare import compare, digest
from fledge.objects.testing import kinds
from fledge.targets import TARGETS, Job, fly

MS = 1e-3
DURATION = 4.0      # [s]
PHASES = ["NOT_SAFE", "SAFE", "SCIENCE", "DRAIN"]
# Fields of a Kinds that conditions compare: with one another within a row.
NUMBERS = ["i8", "u8", "i16", "i32", "u32", "i64", "u64", "single"]
CONSTANTS = [0, 1, -2, 0.5, 126, 32766, 2**53, 2**53 + 1, -2**53 - 1, 2**62 + 1, 2**64 - 3]


# --- a mission -------------------------------------------------------------------------------------

def build(sim: Any, number: int = 0) -> None:
    """The random mission of a number."""
    dice = Random(number)
    names = [f"p{k}" for k in range(dice.randint(1, 4))]
    if dice.random() < 0.4:
        names.insert(dice.randint(0, len(names)), "world")      # flight may run before the world, too
    for name in names:
        add = sim.add_world if name == "world" else sim.add_flight
        (_world if name == "world" else _flight)(dice, add(name), "world" in names)
    _connect(dice, sim)
    for flight in sim.flights:
        _events(dice, flight)


def _world(dice, w, _):
    from fledge import Orbit, world
    from fledge.units import km

    w.craft = world.Spacecraft(I_B=[7, 8, 9], gravity=[world.MARS], orbit=Orbit(world.MARS, a=7400 * km, e=0.1),
                               sigma_BN=[dice.uniform(-0.4, 0.4) for _ in range(3)],
                               omega_BN_B=[dice.uniform(-1, 1) for _ in range(3)])
    w.nav = world.Navigation(attitude_noise=[1e-3] * 3, position_noise=[dice.choice([0, 5])] * 3)
    w.connect(w.craft.state >> w.nav.truth)
    w.task("truth", every=dice.choice([20, 50, 70]) * MS, run=[w.craft, w.nav])


def _flight(dice, f, has_world):
    _, types = kinds()

    def vector(most):
        return [dice.uniform(-most, most) for _ in range(3)]

    makers = {
        "noise": lambda: types["Noise"](seed=dice.randrange(2**64), x=dice.uniform(0, 3), step=dice.randint(-9, 9),
                                        wide=[dice.randint(-2**63, 2**63 - 1), 7], phase=dice.choice(PHASES)),
        "turn": lambda: fsw.EulerRotation(angles=vector(1), rates=vector(3)),
        "spin": lambda: fsw.InertialSpin(omega_RR0_R0=vector(2)),
        "base": lambda: fsw.BaseReference(hold=dice.choice([0.03, 0.2]), source=dice.choice(["COMMANDED", "OWN"])),
        "rasters": lambda: fsw.RasterManager(
            angles=[vector(1) for _ in range(3)], rates=[vector(1) for _ in range(3)], repeat=dice.randint(0, 1),
            durations=[dice.uniform(0.05, 1.5) for _ in range(3)]),
        "rest": lambda: fsw.InertialPointing(sigma_RN=vector(0.3)),
        **({"nadir": fsw.HillPointing, "beacon": lambda: fsw.OrbitBeacon(lead=dice.uniform(0, 2)),
            "error": lambda: fsw.TrackingError(sigma_BcB=vector(0.3))} if has_world else {})}
    # Configuration in no task, whose outputs may cross, too.
    f.still = fsw.InertialPointing(sigma_RN=vector(0.3))
    f.flags = types["Flags"](x=dice.uniform(-3, 3), i64=dice.randint(-2**63, 2**63 - 1), phase=dice.choice(PHASES))
    tasks = []
    for t in range(dice.randint(1, 3)):
        run = []
        for kind in ["noise", *dice.choices(list(makers), k=dice.randint(1, 3))]:
            name = f"{kind}{t}{len(run)}"
            setattr(f, name, makers[kind]())
            run.append(getattr(f, name))
        tasks.append(f.task(f"task{t}", every=dice.choice([10, 20, 30, 50, 70, 250]) * MS, run=run,
                            offset=dice.choice([0, 0, 0, 5, 10, 35]) * MS, priority=dice.randint(0, 2)))
    if dice.random() < 0.6:
        for k in range(dice.randint(1, 3)):
            f.mode(f"mode{k}", dice.sample(tasks, dice.randint(0, len(tasks))))


def _connect(dice, sim):
    """Wire each input to an output of its type anywhere; optional ones often."""
    outputs: dict[str, list[Any]] = {}
    inputs = []
    for process in sim.processes:
        for one in process:
            for field in objects.struct(one).fields:
                if field.group == "out":
                    outputs.setdefault(field.struct.name, []).append(getattr(one, field.name))
                elif field.group == "in" and process in sim.flights:
                    inputs.append((one, field))
    latencies: dict[tuple[str, str], int] = {}
    for one, field in inputs:
        writers = outputs.get(field.struct.name)
        if not writers or field.optional and dice.random() < 0.2:
            continue
        writer = dice.choice(writers)
        home, there = (objects.path(end).partition(".")[0] for end in (one, writer))
        # A process reads one output at one latency; within a process there is none.
        key = home, objects.path(writer)
        latency = 0 if home == there else latencies.setdefault(key, dice.randint(0, 1))
        wire = (writer >> getattr(one, field.name)).latency(latency)
        if dice.random() < 0.4:
            wire.stale_after(dice.choice([1, 15, 40, 120]) * MS)
        sim.processes[0].connect(wire)


def _events(dice, f):
    ports = [one.kinds for name, one in f.instances.items() if name.startswith("noise")]
    modes = [name for name, _ in f.modes]
    names: list[str] = []
    for k in range(dice.choice([0, 1, 2, 4])):
        name = f"event{k}"
        actions: dict[str, Any] = {"set": [(f.watch(f.flags).i64, dice.randint(-2**63, 2**63 - 1))]} if (
            not modes or dice.random() < 0.4) else {"enter": dice.choice(modes)}
        if names and dice.random() < 0.5:
            actions[dice.choice(["arm", "disarm"])] = dice.choice(names)
        once = dice.random() < 0.2
        f.event(name, when=_condition(dice, f, ports), hold=dice.choice([0, 0, 40, 110]) * MS, count=dice.randint(1, 3),
                once=once, armed=dice.random() < 0.8,
                modes=dice.sample(modes, 1) if modes and dice.random() < 0.3 else None,
                until=_condition(dice, f, ports, 0) if not once and dice.random() < 0.3 else None, **actions)
        names.append(name)


def _condition(dice, f, ports, depth=2):
    if depth and dice.random() < 0.6:
        a, b = _condition(dice, f, ports, depth - 1), _condition(dice, f, ports, depth - 1)
        return dice.choice([a & b, a | b, ~a & b])
    port = f.watch(dice.choice(ports))
    if dice.random() < 0.3:
        return port.phase == dice.choice(PHASES)
    if dice.random() < 0.2:
        return port.parts[dice.randrange(3)].pairs[1].count > dice.choice(CONSTANTS)
    if dice.random() < 0.2:
        return port.wide.max_abs() > dice.choice(CONSTANTS)
    a, b = dice.sample(NUMBERS, 2)
    return getattr(port, a) > (getattr(port, b) if dice.random() < 0.5 else dice.choice(CONSTANTS))


# --- a flight --------------------------------------------------------------------------------------

def fly_mission(number: int, folder: Path) -> tuple[str, str]:
    """Fly the mission of a number on the desktop, and once more with each process on a target at random. Returns
    ("p0=cfs,p1=linux: 812 messages", the first difference or "")."""
    mission = folder / "random"
    mission.mkdir(parents=True, exist_ok=True)
    (mission / "mission.py").write_text("from fledge.targets.testing import build\n")
    job = Job(str(mission), duration=DURATION, folder=folder / "out", free=True, parameters={"number": number},
              seed=number, roots=[kinds()[0]])
    dice = Random(-number - 1)
    installed = [name for name, target in TARGETS.items() if name != "desktop" and not target.missing()
                 and not target.composes]      # the mission's Python is the desktop's
    on = {part.process: dice.choice(installed) for part in job.parts}
    desktop = TARGETS["desktop"].fly(job)
    flown = fly(job, {process: TARGETS[name] for process, name in on.items()}, "apart")
    words = ",".join(f"{process}={name}" for process, name in on.items())
    messages, hashes, first = 0, [], ""
    for part in job.parts:
        with Archive(desktop[part.process].record) as a, Archive(flown[part.process].record) as b:
            found = compare(a, b, part.outputs, times=part.is_instant)
            first = first or (str(found[0]) if found else "")
            hashes.append([digest(one, part.outputs, part.is_instant) for one in (a, b)])
            messages += sum(b.topics[topic].count for topic in part.outputs)
    if not first and any(a != b for a, b in hashes):
        first = "the hashes differ"
    return f"{words}: {messages} messages", first
