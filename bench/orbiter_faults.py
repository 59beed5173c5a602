# SPDX-License-Identifier: Apache-2.0
"""Two faults at random in the orbiter while it points at Mars: how each run ends, and why.

    ./fledge bench orbiter_faults desktop
    ./fledge bench orbiter_faults leon3

The first flies faults of sensors, motors and avionics; the second one flies the application on the emulated computer,
and has at least one fault of its memory, registers, bus, links or interrupts.

A run ends well if it points at Mars, or if it is in the safe mode with -b1 on the Sun; else the spacecraft must have
reported why: a unit that is faulted, a kind that is lost, a rule that has fired, sensors that contradict each other, or
a time that is not synchronized. A computer that no longer answers reports nothing. Each run has a process of its own,
which is ended after WALL.
"""
from __future__ import annotations

import json
import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

import fledge
from fledge import emulator, ground
from fledge import flight as fsw
from fledge.attitude import mrp_to_dcm
from fledge.columns import columns
from fledge.targets.build import ROOT
from fledge.units import minute, s

from bench.rows import options

WITHIN, LASTS = 10 * minute, 40 * minute        # when faults begin, and how long a run goes on
SETTLES = 900                                   # [s] after the last command of test 1
POINTS, SAFE = 5e-3, 0.1                        # [rad] from Mars, from the Sun
KINDS = ("DEAD", "HIGH", "LOW", "BABBLE", "DROPOUT", "DRIFT", "BIAS")
WALL = 3600                                     # [s] of this machine: a run that lasts longer hangs
Random = np.random.Generator


class Orbiter:
    """The orbiter at the end of test 1: at Mars, with all units as they were. board: the computer that flies; None: the
    desktop. later: what happens at which times [s]."""

    def __init__(self, on: str = "desktop") -> None:
        self.on, self.board = on, None
        self.later: list[tuple[float, Callable[[], object]]] = []
        if on == "desktop":
            self.sim: Any = fledge.load("mars_orbiter")
            self.sim.plots = False
            ground.perform(self.sim, "pointing.py")
            return
        with TemporaryDirectory() as scratch:
            self.board = emulator.load("mars_orbiter", "pointing", folder=scratch,
                                       registers=[ROOT / "missions/mars_orbiter/boards"])
        self.sim = self.board.sim
        self.sim.step()
        # The program's record of all outputs has a status for outputs that cannot be sent: no program reads it here.
        self.board.poke(self.board.address("kept") + 12, (1).to_bytes(4, "big"))
        self.sim.run(until=self.board.in_flight.script[-1][0] / 1e9 + SETTLES, progress=False)

    @property
    def world(self) -> Any:
        return self.sim.process("world")


Plan = Callable[[Orbiter, float, Random], str]


class Fault(NamedTuple):
    """What it is called, of which group it is, and what plans it, from a time [s] on; that returns its details."""
    name: str
    group: str
    plan: Plan


def channel(model: str, channels: int, sizes: dict[str, float], kinds: tuple[str, ...] = KINDS
            ) -> Plan:
    """A fault of one channel of a model, or of all of them. sizes: by its kind."""
    def plan(craft: Orbiter, begin: float, random: Random) -> str:
        kind = str(random.choice(kinds))
        which = int(random.choice([*(1 << k for k in range(channels)), (1 << channels) - 1]))
        owner = getattr(craft.world, model)
        owner.faults = [{"kind": kind, "channels": which, "begin": begin * s, "size": sizes.get(kind, 0.0)}]
        return f"{kind} {which:#b}"
    return plan


def only(model: str, bits: list[int], kind: str = "DEAD") -> Plan:
    """One channel of these fails."""
    def plan(craft: Orbiter, begin: float, random: Random) -> str:
        which = int(random.choice(bits))
        getattr(craft.world, model).faults = [{"kind": kind, "channels": 1 << which, "begin": begin * s}]
        return f"{kind} channel {which}"
    return plan


def latch_up(craft: Orbiter, begin: float, random: Random) -> str:
    power = craft.world.power
    load = int(random.choice([0, 1, 3, 5, 8, 10, 16]))
    power.latch_up_at, power.latch_up_load, power.latch_up_current = begin * s, load, 20.0
    return f"load {load}"


def reset(craft: Orbiter, begin: float, random: Random) -> str:
    craft.world.power.reset_at = [begin, 0, 0, 0]
    return ""


def clock(craft: Orbiter, begin: float, random: Random) -> str:
    craft.world.clock.drift = int(random.choice([-1, 1])) * 5_000_000
    return "5 ms/s"


def flips(craft: Orbiter, begin: float, random: Random) -> str:
    page, bit = int(random.integers(0, 64)), int(random.integers(0, 2047))
    craft.world.recorder.faults = [
        {"kind": "FLIP", "page": page, "bit": bit, "bits": int(random.integers(1, 4)), "begin": begin * s}]
    return f"page {page}"


FAULTS = [
    Fault("gyro a", "sensor", channel("gyro_a", 3, {"HIGH": 0.1, "LOW": 0.1, "BABBLE": 0.1, "DROPOUT": 0.5,
                                                    "DRIFT": 1e-5, "BIAS": 1e-3})),
    Fault("star tracker a", "sensor", channel("tracker_a", 3, {"HIGH": 1, "LOW": 1, "BABBLE": 1, "DROPOUT": 0.5,
                                                               "DRIFT": 1e-5, "BIAS": 1e-2})),
    Fault("accelerometer", "sensor", channel("acc", 3, {"HIGH": 1, "LOW": 1, "BABBLE": 1, "DRIFT": 1e-4, "BIAS": 0.1})),
    Fault("converter a", "sensor", channel("adc_a", 4, {"DROPOUT": 0.5, "DRIFT": 1, "BIAS": 100})),
    Fault("converter b", "sensor", channel("adc_b", 4, {"DROPOUT": 0.5, "DRIFT": 1, "BIAS": 100})),
    Fault("star tracker's registers", "register", channel("stars_a", 4, {"DROPOUT": 0.5, "DRIFT": 1e5, "BIAS": 1e7})),
    Fault("gyro's registers", "register", channel("angles_a", 3, {"DROPOUT": 0.5, "DRIFT": 100, "BIAS": 1e5})),
    Fault("wheel", "actuator", only("wheels", [0, 1, 2, 3])),
    Fault("wheel's tachometer", "actuator", only("wheels", [8, 9, 10, 11])),
    Fault("thruster stuck shut", "actuator", only("rcs", list(range(8)))),
    Fault("thruster stuck open", "actuator", only("rcs", list(range(8)), "HIGH")),
    Fault("array drive", "actuator", only("drive", [0, 1])),
    Fault("propulsion card", "bus", only("card_a", [8])),
    Fault("card of the power unit", "bus", only("power", [0, 1, 2, 3, 4])),
    Fault("latch-up", "bus", latch_up),
    Fault("reset", "reset", reset),
    Fault("clock", "clock", clock),
    Fault("bits of the recorder", "memory", flips),
]


# ---- of the computer

def on_board(act: Callable[[Any, Random], tuple[str, Callable[[], object]]]) -> Plan:
    """A fault that comes at its time. act: draws it for a board; returns its details, and what brings it."""
    def plan(craft: Orbiter, begin: float, random: Random) -> str:
        details, bring = act(craft.board, random)
        craft.later.append((begin, bring))
        return details
    return plan


def memory(begin: str, end: str, before: int = 0) -> Plan:
    """A bit of what lies between two symbols, from so many bytes before the first one on."""
    def act(board: Any, random: Random) -> tuple[str, Callable[[], object]]:
        at, bit = int(random.integers(board.address(begin) - before, board.address(end))), int(random.integers(8))
        return f"{board.core.place(at) or hex(at)} bit {bit}", lambda: board.flip(at, bit)
    return on_board(act)


def processor(board: Any, random: Random) -> tuple[str, Callable[[], object]]:
    """A bit of a register, at an instruction of an instant of flight."""
    name, bit = str(random.choice(list(board.registers))), int(random.integers(32))
    after = int(random.integers(300_000))
    return f"{name} bit {bit}", lambda: board.core.plan_flip(board.core.instructions + after, None, [(name, bit)])


def stuck(board: Any, random: Random) -> tuple[str, Callable[[], object]]:
    """A bit of a register of a board."""
    lane = str(random.choice(list(board.lanes)))
    at, size = board.lanes[lane]
    word, bit, on = int(random.integers(size // 4)), 1 << int(random.integers(32)), bool(random.integers(2))
    return (f"{lane} word {word} {bit:#x} at {int(on)}",
            lambda: board.stick_register(at + 4 * word, on=bit if on else 0, off=0 if on else bit))


def link(kind: str) -> Plan:
    """Of a message between the world and the computer, for up to five minutes."""
    def plan(craft: Orbiter, begin: float, random: Random) -> str:
        path, lasts = str(random.choice(list(craft.board.in_flight.paths.values()))), float(random.uniform(1, 300))
        late, seed = float(random.uniform(0.5, 10)), int(random.integers(2**31))
        craft.board.disturb(path, kind, begin, begin + lasts, late=late, seed=seed)
        return f"{path} for {lasts:.3g} s" + (f" by {late:.3g} s" if kind == "LATE" else "")
    return plan


def commands(craft: Orbiter, begin: float, random: Random) -> str:
    """A hundred commands of which some bits are inverted, and rubbish."""
    packets = craft.sim.flight.commands.packets
    for k in range(100):
        packet = packets.mode(str(random.choice(["safe", "sleep", "inertial", "delta_v"])))
        garbled = bytearray(packet if k % 2 else random.bytes(len(packet)))
        garbled[int(random.integers(len(garbled)))] ^= 1 << int(random.integers(8))
        craft.board.in_flight.script.append((int((begin + 0.1 * k) * 1e9), bytes(garbled)))
    return ""


def act_once(name: str, least: int, most: int) -> Plan:
    """A method of the board, with a number."""
    def act(board: Any, random: Random) -> tuple[str, Callable[[], object]]:
        n = int(random.integers(least, most, endpoint=True))
        return f"{n}", lambda: getattr(board, name)(n)
    return on_board(act)


def word(board: Any, random: Random) -> tuple[str, Callable[[], object]]:
    bit = int(random.integers(32))
    return f"bit {bit}", lambda: board.flip_next_read(1 << bit)


OF_COMPUTER = [
    Fault("bit of code", "memory", memory("leon3_traps", "leon3_data_load")),
    Fault("bit of data", "memory", memory("leon3_data", "leon3_bss_end")),
    Fault("bit of the stack", "memory", memory("leon3_stack_end", "leon3_stack_end", 2048)),
    Fault("register of the processor", "register", on_board(processor)),
    Fault("register of a board, stuck", "register", on_board(stuck)),
    Fault("word on the bus", "bus", on_board(word)),
    Fault("error of the bus", "bus", on_board(lambda board, random: ("", board.fail_next_read))),
    Fault("link lost", "link", link("LOST")),
    Fault("link late", "link", link("LATE")),
    Fault("link garbled", "link", link("GARBLED")),
    Fault("commands garbled", "link", commands),
    Fault("ticks lost", "clock", act_once("lose_ticks", 1, 200)),
    Fault("interrupt of ticks silent", "clock", on_board(
        lambda board, random: ("", lambda: board.stick_interrupts(off=[10])))),
    Fault("interrupt without a cause", "clock", act_once("interrupt", 1, 15)),
]


class End(NamedTuple):
    """How a run ended: faults and their details; the mode, how far from Mars and from the Sun [rad], whether that is
    good, what the spacecraft reported, and how often the computer was reset."""
    faults: tuple[str, str]
    details: tuple[str, str]
    mode: str
    mars: float
    sun: float
    good: bool
    reported: tuple[str, ...]
    resets: int


def fly(craft: Orbiter, run: int, seed: int) -> End:
    """One run, which spends the orbiter."""
    random = np.random.default_rng([seed, run])
    sim, board = craft.sim, craft.board
    if board is None:
        first, second = (FAULTS[k] for k in random.choice(len(FAULTS), 2, replace=False))
    else:
        first = OF_COMPUTER[random.integers(len(OF_COMPUTER))]
        others = [fault for fault in FAULTS + OF_COMPUTER if fault is not first]
        second = others[random.integers(len(others))]
    end = sim.time + LASTS.value
    begins = sim.time + random.uniform(0, WITHIN.value, 2)
    details = tuple(fault.plan(craft, float(begin), random) for fault, begin in zip((first, second), begins))
    if board:
        board.core.renew_engine()
        board.in_flight.record()        # so that the world goes on without an answer
    for time, bring in sorted(craft.later, key=lambda entry: entry[0]):
        sim.run(until=time, progress=False)
        bring()
    sim.run(until=end, progress=False)
    answers = board is None or any(answer for _, answer in board.in_flight.answers[-50:])
    f, w = sim.flight, craft.world
    BN, r = mrp_to_dcm(np.array(w.craft.state.sigma_BN)), np.array(w.craft.state.r_BN_N)
    mars, sun = (_angle(BN[0], way) for way in (-r, r - np.array(w.sun.state.r_PN_N)))
    table = f.protection.table
    reported = [name for name, yes in (
        ("unit faulted", table.faulted), ("kind lost", table.lost), ("rule fired", table.responses),
        ("sun sensors", f.pyramids.status.unused or f.pyramids.status.unresolved > 100),
        ("time", not f.time.time.synchronized), ("power unit", f.power.state.silent or f.power.state.tripped),
        ("thrusters", f.pulses.health.stuck_open or f.pulses.health.stuck_shut),
        ("attitude", f.filter.attitude.head.quality < fsw.Quality.GOOD), ("attitudes differ", f.differ.state.trips),
        ("boots", f.boot.boot.boots > 1)) if yes and answers]
    mode = _mode(sim) if answers else "no answer"
    good = (mode == "mars" and mars < POINTS) or (mode == "safe" and sun < SAFE)
    return End((first.name, second.name), details, mode, mars, sun, good, tuple(reported),  # type: ignore[arg-type]
               board.core.resets if board else int(f.boot.boot.boots) - 1)


def _mode(sim: Any) -> str:
    """By what guides: it has the newest output, or held it."""
    f = sim.flight
    guides = {"safe": f.sun_safe.error, "inertial": f.rest.reference, "sun": f.sun_axes.reference,
              "mars": f.mars_axes.reference, "two_body": f.two_axes.reference, "delta_v": f.burn_axes.reference}
    newest = max(guides, key=lambda name: guides[name].head.t)
    return newest if guides[newest].head.t > sim.time_ns - 2_000_000_000 else f"{newest}, held"


def _angle(a: Any, b: Any) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def study(craft: Orbiter, runs: range, seed: int = 1, workers: int = 2) -> Iterator[End]:
    """The ends of runs, each in a process that begins as a copy of this one."""
    fork = multiprocessing.get_context("fork")

    def begin(run: int) -> tuple[Any, Any]:
        here, there = fork.Pipe(False)
        child = fork.Process(target=lambda: there.send(fly(craft, run, seed)))
        child.start()
        there.close()
        return child, here

    for first in range(0, len(runs), workers):
        for child, pipe in [begin(run) for run in runs[first:first + workers]]:
            found = None
            try:
                found = pipe.recv() if pipe.poll(WALL) else None
            except EOFError:
                pass
            child.kill()
            child.join()
            yield found or End(("?", "?"), ("", ""), "the run hangs or died", np.inf, np.inf, False, (), 0)


def show(ends: list[End]) -> list[str]:
    """A line for each fault, and one for each run that ended neither pointing nor on the Sun."""
    rows = [["fault", "runs", "at Mars", "safe on the Sun", "neither, said why", "silent", "resets"]]
    for name in [fault.name for fault in FAULTS + OF_COMPUTER]:
        of = [end for end in ends if name in end.faults]
        count = Counter("mars" if end.good and end.mode == "mars" else "safe" if end.good else
                        "reported" if end.reported else "silent" for end in of)
        if of:
            rows.append([name, str(len(of)), *(str(count[kind]) for kind in ("mars", "safe", "reported", "silent")),
                         str(sum(end.resets for end in of))])
    lines = list(columns(rows, set(range(1, 7))))
    for run, end in enumerate(ends):
        if not end.good:
            what = ", ".join(f"{name} {detail}".strip() for name, detail in zip(end.faults, end.details))
            lines.append(f"run {run}: {what}: mode {end.mode}, {end.mars:.3g} rad from Mars, {end.sun:.3g} rad from "
                         f"the Sun, {end.resets} resets; it reports: {', '.join(end.reported) or 'nothing'}")
    return lines


def main(arguments: list[str]) -> int:
    chosen = options("orbiter_faults", arguments, runs=200, cases=("desktop", "leon3"))
    everything = {}
    for case in chosen.cases or ("desktop", "leon3"):
        ends = everything[case] = []
        for end in study(Orbiter(case), range(chosen.runs)):
            ends.append(end)
            if chosen.json:     # so that a campaign that is stopped has what it has flown
                Path(chosen.json).write_text(json.dumps({name: [end._asdict() for end in found] for name, found in
                                                         everything.items()}, indent=1) + "\n", encoding="utf-8")
        print(case, *show(ends), sep="\n")
    return int(any(not end.good and not end.reported for ends in everything.values() for end in ends))
