# SPDX-License-Identifier: Apache-2.0
"""Random events: the desktop's are those that their definition in plain Python gives, and the exported C's the same."""

import math
import operator
from random import Random

import pytest

from fledge import export, objects
from fledge.export.testing import COMPILERS, Compiled
from fledge.mission.simulation import Simulation
from fledge.objects.testing import decoded, kinds
from fledge.units import m
from tests.circles import long_after

RELATIONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq,
             "!=": operator.ne}
PHASES = {"NOT_SAFE": -7, "SAFE": 0, "SCIENCE": 3, "DRAIN": 100}
# Fields that compare with one another: their paths in a Kinds.
PLAIN = ["single", "i8", "u8", "i16", "i32", "u32", ("u16", 0), ("u16", 1), "i64", "u64", ("wide", 0), ("wide", 1),
         ("serials", 0), ("serials", 1), ("turn", 1, 1), ("parts", 2, "pairs", 1, "count"), ("part", "share"),
         ("parts", 0, "steps", 3), ("wide", "norm"), ("turn", "max_abs"),
         ("u16", "norm"), ("parts", 1, "steps", "norm")]
LENGTHS = ["x", "y", ("v", 1), ("v", "norm"), ("grid", 1, 1), ("grid", "max_abs"), ("part", "pairs", 0, "x")]
ENUMS = ["phase", ("phases", 2), ("part", "phase"), ("parts", 1, "phase")]
CONSTANTS = [0, 1, -1, 0.5, 2**53, 2**53 + 1, -2**53 - 1, 2**62 + 1, 2**63, 2**64 - 1, -2**63, 0.1, 65535, 2**32 - 2]


# --- by definition ---------------------------------------------------------------------------------

def path_of(path):
    return path if isinstance(path, tuple) else (path,)


def watched(port, path):
    """The Watch of a path."""
    steps = list(path_of(path))
    while steps:
        step = steps.pop(0)
        if isinstance(step, int):
            indices = [step]
            while steps and isinstance(steps[0], int):
                indices.append(steps.pop(0))
            port = port[tuple(indices) if len(indices) > 1 else step]
        else:
            port = getattr(port, step)() if step in ("norm", "max_abs") else getattr(port, step)
    return port


def number(values, path):
    """The same number of decoded values."""
    for step in path_of(path):
        if step in ("norm", "max_abs"):
            flat = [float(x) for row in values for x in (row if isinstance(row, list) else [row])]
            total = 0.0
            for x in flat:
                total += x * x
            return math.sqrt(total) if step == "norm" else max(map(abs, flat))
        values = values[step]
    return values


def comparison(random, port):
    """(condition, function of decoded values)"""
    relation = random.choice(list(RELATIONS))
    holds = RELATIONS[relation]
    group = random.choice([PLAIN, PLAIN, PLAIN, LENGTHS, ENUMS])
    path = random.choice(group)
    if random.random() < 0.5:
        other = random.choice([name for name in group if name != path])
        return holds(watched(port, path), watched(port, other)), lambda v: holds(number(v, path), number(v, other))
    if group is ENUMS:
        name, value = random.choice(list(PHASES.items()))
        given = random.choice([name, "PHASE_" + name, value])
        return holds(watched(port, path), given), lambda v: holds(number(v, path), value)
    constant = random.choice(CONSTANTS)
    given = constant * m if group is LENGTHS and random.random() < 0.5 else constant
    return holds(watched(port, path), given), lambda v: holds(number(v, path), constant)


def compound(random, port, depth=3):
    if depth == 0 or random.random() < 0.3:
        return comparison(random, port)
    a, f = compound(random, port, depth - 1)
    if random.random() < 0.2:
        return ~a, lambda v: not f(v)
    b, g = compound(random, port, depth - 1)
    if random.random() < 0.5:
        return a & b, lambda v: f(v) and g(v)
    return a | b, lambda v: f(v) or g(v)


class Expected:
    """An event by its definition: it looks back over what held since it was last armed."""

    def __init__(self, event, when, until, rules):
        self.event, self.when, self.until, self.rules = event, when, until, rules
        self.armed, self.waits, self.fired = rules["armed"], False, None
        self.past = []      # (t, whether it held)

    def fires(self, t, values, mode):
        holds = (mode in self.rules["modes"] or not self.rules["modes"]) and self.when(values)
        if self.waits and (self.until(values) if self.until else not holds):
            self.waits, self.armed, self.past = False, True, []
            return False
        if not (self.armed or self.waits):
            self.past = []
            return False
        self.past.append((t, holds))
        run = []
        for row, held in reversed(self.past):
            if not held:
                break
            run.append(row)
        if self.waits or not run or len(run) < self.rules["count"] or t - run[-1] < self.rules["hold"] * 10**9:
            return False
        self.armed, self.waits, self.fired = False, not self.rules["once"], t
        return True

    def arm(self, on):
        self.armed, self.waits = on, False


def mission(seed, events=8):
    """A simulation with random events, and what is expected of them."""
    _, types = kinds()
    random = Random(seed)
    sim = Simulation("events", seed)
    f = sim.flight
    f.noise = types["Noise"](seed=seed, x=1.0)
    f.other = types["Noise"](seed=seed + 1)
    f.flags = types["Flags"](phase="SAFE")
    f.sink = types["Sink"]()
    f.connect(f.flags.kinds >> f.sink.kinds)
    f.task("fast", every=0.5, run=[f.noise, f.sink])
    f.task("slow", every=0.7, offset=0.1, run=[f.other])
    for name, tasks in (("idle", []), ("work", ["slow"]), ("rest", [])):
        f.mode(name, tasks)
    expected = []
    names = [f"e{i}" for i in range(events)]
    for i, name in enumerate(names):
        condition, when = compound(random, f.watch(f.noise.kinds))
        rules = {"hold": random.choice([0, 0, 0.5, 1.2]), "count": random.choice([1, 1, 2, 3]),
                 "once": random.random() < 0.2, "armed": random.random() < 0.8,
                 "modes": random.choice([[], [], ["work"], ["idle", "rest"]])}
        until, again = None, None
        if not rules["once"] and random.random() < 0.3:
            until, again = compound(random, f.watch(f.noise.kinds), 1)
        actions = {"set": [(f.watch(f.flags).i64, random.choice([i, 2**53 + i, -2**63])),
                           *random.sample([(f.watch(f.flags).phase, random.choice(list(PHASES))),
                                           (f.watch(f.flags).x, 0.1 * i * m), (f.watch(f.noise).step, i - 4),
                                           (f.watch(f.noise).counts[1], 65535), (f.watch(f.noise).counts, [i, 7]),
                                           (f.watch(f.noise).v, [1, -0.0, i]),
                                           (f.watch(f.other.kinds).parts[1].pairs[0].count, 2**62 + i),
                                           (f.watch(f.other.kinds).grid[1, 2], 0.5 * m),
                                           (f.watch(f.other.kinds).turn, 3)], random.randrange(4))]}
        if random.random() < 0.5:
            actions["enter"] = random.choice(["idle", "work", "rest"])
        for action in ("arm", "disarm"):
            actions[action] = random.sample(names, random.choice([0, 0, 1, 2]))
        event = f.event(name, when=condition, until=until, **rules, **actions)
        expected.append(Expected(event, when, again, {**rules, **actions}))
    return sim, expected


def flown(sim, expected, steps=300):
    """Fly, and compare with what is expected at each instant. Returns (times, outputs of each, firings)."""
    f = sim.flight
    ports = {f"flight.{name}.kinds": getattr(f, name).kinds for name in ("noise", "other", "flags")}
    mode, requested = "idle", "idle"
    flown, firings = [], 0
    for _ in range(steps):
        sim.step()
        t, mode = sim.kernel.now, requested
        values = decoded(objects.struct(f.noise.kinds), objects.memory(f.noise.kinds))
        ran = t % 500_000_000 == 0 or mode == "work" and t % 700_000_000 == 100_000_000
        for row in expected:
            if ran and row.fires(t, values, mode):
                firings += 1
                requested = row.rules.get("enter", requested)
                for other in expected:
                    name = other.event.name
                    if name in row.rules["arm"]:
                        other.arm(True)
                    if name in row.rules["disarm"]:
                        other.arm(False)
        assert sim.mode == mode
        for row in expected:
            assert row.event.fired_at == (None if row.fired is None else row.fired / 1e9), (t, row.event)
            assert row.event.armed == row.armed, (t, row.event)
        flown.append((t, {path: objects.memory(port) for path, port in ports.items()}))
    return flown, firings


@pytest.mark.parametrize("seed", range(20))
def test_random_events_are_those_of_their_definition(seed):
    flown(*mission(seed))


@pytest.mark.long("flies 10 s of random events")
def test_they_fire():
    counts = [flown(*mission(seed))[1] for seed in range(20)]
    assert sum(counts) > 500 and sum(n > 0 for n in counts) > 15


def same_in_c(seed, folder, compiler):
    sim, expected = mission(seed)
    c = Compiled(export.read(sim), folder, roots=[kinds()[0]], compiler=compiler)
    for t, outputs in flown(sim, expected)[0]:
        assert c("next") == t
        c("tick", t)
        assert {path: c.get(path) for path in outputs} == outputs, t


@pytest.mark.parametrize("compiler", long_after(1, COMPILERS, "another compiler"))
@pytest.mark.parametrize("seed", long_after(2, range(8), "more draws"))
def test_random_events_in_c_are_the_desktops(seed, compiler, tmp_path):
    same_in_c(seed, tmp_path, compiler)


@pytest.mark.parametrize("seed", [3, 5])
def test_a_snapshot_and_a_clone_have_the_events_state(seed):
    sim, _ = mission(seed)
    sim.step(60)
    saved, clone = sim.snapshot(), sim.clone()
    sim.step(200)
    end = sim.snapshot()
    clone.step(200)
    assert clone.snapshot() == end
    assert [repr(e) for e in clone.flight.events.values()] == [repr(e) for e in sim.flight.events.values()]
    sim.restore(saved)
    sim.step(200)
    assert sim.snapshot() == end


# --- without modes, and of a part of flight --------------------------------------------------------

def plain_mission():
    types = kinds()[1]
    sim = Simulation("plain")
    f = sim.flight
    f.noise, f.other, f.flags, f.sink = types["Noise"](), types["Noise"](), types["Flags"](), types["Sink"]()
    f.connect(f.flags.kinds >> f.sink.kinds)
    f.task("one", every=1, run=[f.noise, f.sink])
    f.task("two", every=1, run=[f.other])
    k = f.watch(f.noise.kinds)
    f.event("flag", when=k.x > 0, arm="last", set=[(f.watch(f.flags).i64, 5)])
    f.event("both", when=f.watch(f.other.kinds).x > f.watch(f.noise.kinds).x, set=[(f.watch(f.flags).x, 2)])
    f.event("far", when=k.x > 0, set=[(f.watch(f.other).step, 2)])
    f.event("last", when=k.x > 0, armed=False, count=2, disarm=[
            "flag", "both"], set=[(f.watch(f.flags).phase, "DRAIN")])
    return sim


@pytest.mark.parametrize("compiler", long_after(1, COMPILERS, "another compiler"))
def test_a_mission_without_modes_has_events(compiler, tmp_path):
    sim = plain_mission()
    c = Compiled(export.read(sim), tmp_path, roots=[kinds()[0]], compiler=compiler)
    for t in range(40):
        sim.step()
        c("tick", sim.kernel.now)
        for path in ("noise", "other", "flags"):
            assert c.get(f"flight.{path}.kinds") == objects.memory(getattr(sim.flight, path).kinds), (t, path)
    assert sim.flight.last.fired_at and not sim.flight.flag.armed and sim.flight.flags.phase.name == "DRAIN"


def test_a_part_of_flight_leaves_out_the_events_of_the_rest(tmp_path):
    mission = export.read(plain_mission(), tasks=["one"])
    assert [(e.name, e.arms) for e in mission.events] == [("flag", [("last", True)]), ("last", [("flag", False)])]
    assert {"the event both", "the event far"} <= set(mission.left_out)
    Compiled(mission, tmp_path, roots=[kinds()[0]])


def test_what_an_event_sets_is_no_change_by_hand():
    """The next run takes a parameter that an event has set as it is, and does not publish it again."""
    sim = plain_mission()
    for t in range(20):
        sim.step()
        written = sim.flight.flags.kinds.head.sequence
        sim.run(until=t + 0.5)      # no instant
        assert sim.flight.flags.kinds.head.sequence == written
    assert sim.flight.flags.i64 == 5 and written > 2


def test_events_see_what_earlier_ones_arm_at_once_and_later_ones_at_the_next_instant():
    types = kinds()[1]
    sim = Simulation("order")
    f = sim.flight
    f.noise = types["Noise"](x=100)
    f.task("all", every=1, run=[f.noise])
    high = f.watch(f.noise.kinds).x > 0
    f.event("before", when=high, armed=False, enter=f.mode("a", []))
    f.event("middle", when=high, once=True, arm=["before", "after"])
    f.event("after", when=high, armed=False, enter="a")
    sim.step(2)
    assert [f.before.fired_at, f.middle.fired_at, f.after.fired_at] == [1, 0, 0]
