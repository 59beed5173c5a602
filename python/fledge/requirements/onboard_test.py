# SPDX-License-Identifier: Apache-2.0
"""Requirements that fly: the verdicts and margins of the simulation's judge, bit for bit, at each sample."""
import math
import random
import re

import numpy as np
import pytest

import fledge
from fledge import cli, prototype
from fledge import flight as fsw
from fledge.disk import ROOT
from fledge.errors import SetupError
from fledge.export.run_test import FLIGHT
from fledge.mission import MissionError
from fledge.prototype import field, out, par
from fledge.requirements import (Requirements, after, always, angle, begins, eventually, fly, settles, turned, until)
from fledge.requirements import onboard
from fledge.requirements.declared import Declaration
from fledge.requirements.judge import Judged
from fledge.targets.services_test import written
from fledge.units import ms, s

MONITORED = FLIGHT + """
    f.judge = fsw.RequirementMonitor()
    f.task("services", every=400 * ms, run=[f.judge])
"""


class Numbers(prototype.Message):
    """Any numbers, of a test."""
    x = field(float, "[-] any", shape=6)
    y = field(float, "[-] others", shape=3)
    word = field(np.uint32, "[-] a set of bits")


class Shaken(prototype.Module):
    """Numbers that are drawn, some of which are none, and an output that is stale at times."""
    numbers = out(Numbers, "drawn")
    seed = par(int, "[-] of the draws")

    def update(self, t, dt):
        draw = np.random.default_rng([self.seed, round(t * 1000)])
        self.numbers.x = np.round(draw.normal(size=6), 1)
        self.numbers.y = draw.normal(size=3)
        self.numbers.word = draw.integers(4)
        if draw.random() < 0.1:
            self.numbers.x[draw.integers(6)] = np.nan
        self.publish(self.numbers, quality=1 if draw.random() < 0.1 else 2 if np.isnan(self.numbers.x).any() else 3)


def drawn(seed):
    """A simulation whose flight draws numbers, each 0.5 s, and has a monitor; and a declaration for it."""
    sim = fledge.Simulation()
    f = sim.flight
    f.shaken, f.judge = Shaken(seed=seed), fsw.RequirementMonitor()
    f.task("all", every=500 * ms, run=[f.shaken, f.judge])
    return sim, Declaration(sim)


def a_signal(r, draw):
    """A number of the outputs, by a random expression."""
    x, y = r.signal("flight.shaken.numbers.x"), r.signal("flight.shaken.numbers.y")
    vectors = [y, -2 * y + y, turned(y, [1, 2, 3]), abs(y)] if draw.random() < 0.5 else [x, x + x, 0.5 * x - x, abs(x)]
    vector = draw.choice(vectors)
    kinds = [lambda: vector.norm() - 1, lambda: vector.max_abs() - 1.0, lambda: vector[draw.randrange(3)],
             lambda: x[0] - x[4], lambda: angle(y, turned([0.1, 0.2, draw.random()], y)) - 0.5]
    return draw.choice(kinds)()


def a_formula(r, draw, depth, top=True):
    """A random one; windows without an end stand at the top alone."""
    if not depth:
        signal = a_signal(r, draw)
        if draw.random() < 0.15:
            return r.signal("flight.shaken.numbers.word") == draw.randrange(4)
        if draw.random() < 0.1:
            return r.signal("flight.shaken.numbers.head.quality") == "GOOD"
        limit = round(draw.gauss(0, 1), 1)
        return draw.choice([signal < limit, signal <= limit, signal > limit, signal >= limit])

    def inner(top=False):
        return a_formula(r, draw, draw.randrange(depth), top)

    begin, length = draw.choice([0, 0, draw.randrange(12)]) / 4, draw.randrange(3, 12) / 2
    end = None if top and draw.random() < 0.6 else begin + length
    return draw.choice([
        lambda: ~inner(top), lambda: inner(top) & inner(top), lambda: inner(top) | inner(top),
        lambda: after(inner(top)), lambda: begins(inner(top)), lambda: after(draw.randrange(10)) & inner(top),
        lambda: always(inner(), begin, end), lambda: eventually(inner(), begin, end), lambda: until(
            inner(), inner(), end)])()


def as_output(margin):
    """As an output of flight says it."""
    return float(np.clip(margin, -np.finfo(float).max, np.finfo(float).max))


def flown_as_judged(seed):
    """Fly random formulas for 20 s, and compare after each sample; returns how many of the verdicts are decided."""
    draw = random.Random(seed)
    sim, r = drawn(seed)
    for i in range(5):
        r.every = draw.choice([0.5, 0.5, 1, 1.5])
        depth, whole = 1 + draw.randrange(3), draw.random() < 0.3
        r.require(f"R-{i}", "drawn", always(a_formula(r, draw, depth, top=False)) if whole else
                  a_formula(r, draw, depth))
    required = list(r._found.values())
    fly(sim, *required)
    judged = Judged(required, sim)
    judged.watch(False)
    wanted, decided = [], 0
    for _ in range(41):
        sim.run(500 * ms)
        state = sim.flight.judge.state
        if wanted:      # as the instant before left it
            assert list(zip(state.low, state.high))[:len(wanted)] == wanted, (seed, sim.time_ns, required)
            assert state.bad == 0
        wanted = [(as_output(outcome.low), as_output(outcome.high)) for outcome in judged.outcomes(so_far=True)]
        decided += sum(low > 0 or high < 0 for low, high in wanted)
    return decided


def test_each_margin_is_that_of_the_simulations_judge_at_each_sample():
    decided = [flown_as_judged(seed) for seed in range(10)]
    assert sum(decided) > 200 and sum(n > 0 for n in decided) > 6


@pytest.mark.long("100 flights of random formulas")
@pytest.mark.parametrize("first", range(100, 1100, 100))
def test_each_margin_is_that_of_the_simulations_judge_for_many_formulas(first):
    assert sum(flown_as_judged(seed) for seed in range(first, first + 100)) > 1500


def test_settles_is_known_from_the_last_sample_of_its_window_on_and_ends_as_the_judge_says():
    sim, r = drawn(7)
    r.every = 500 * ms
    size = r.signal("flight.shaken.numbers.y").max_abs()
    r.require("S-1", "drawn", settles(size < 5, within=3.2 * s))
    r.require("S-2", "its dual", always(eventually(size > 5, 1 * s), 0 * s, 4 * s))
    required = list(r._found.values())
    fly(sim, *required)
    judged = Judged(required, sim)
    judged.watch(False)
    sim.run(3 * s)
    state = sim.flight.judge.state
    assert state.high[0] == as_output(math.inf)
    sim.run(1 * s)
    assert 0 < state.high[0] < 5
    sim.run(16 * s)
    settled, dual = judged.outcomes()       # up to now, which flight sees at the next instant
    sim.run(500 * ms)
    assert state.sampled[0] == 20 * 10**9
    assert (state.high[0], state.low[1]) == (settled.high, dual.low) and -5 < dual.low < 0


PLAY = """
from fledge.units import s


def waits(sim):
    sim.run(2 * s)
"""

REFUSED = [
    ('always(eventually(x < 1))', "needs the future without a bound, by 'at some time .* give that window an end"),
    ('always(truth < 1 * km)', "reads world.craft.state.r_BN_N, which is no output of flight: flight judges"),
    ('always(r.signal("flight.tracking.attitude.sigma_BN")[0] < 1)', "which is no output of flight"),
    ('always(r.event("flight", "start"))', "reads the event flight.start, and flight judges numbers of its outputs"),
    ('always(always(x < 1, 0 * s, 10 * hour))', "remembers 360004 numbers, .* of 4096 on board, .* each 0.4 s: "
     "let r.every be longer, or windows shorter"),
    ('always(within(0.3 * s, x < 1) | eventually(x < 1, 0.1 * s, 0.3 * s))', "has a window without a sample, "),
    ('None, method="inspection"', "is shown by inspection, and has no formula to fly"),
    ('always(x < 1)); r.every = 300 * ms; r.require("B-1", "b", always(x < 1)', "is judged at each 0.3 s, and flight "
     "judges each 0.4 s: let r.every be that or a multiple"),
]


@pytest.fixture
def mission(tmp_path):
    """Writes a mission whose flight has a monitor, with a requirement."""
    def write(formula, fly="fly(sim, *[each.id for each in Requirements(sim).all])"):
        folder = written(tmp_path / "judged", MONITORED, PLAY)
        (folder / "requirements.py").write_text(f"""
from fledge.requirements import *
from fledge.units import hour, km, ms, s


def group(r):
    x, truth = r.signal("flight.tracking.error.sigma_BR")[0], r.signal("world.craft.state.r_BN_N")[0]
    r.every = 400 * ms
    r.require("A-1", "a", {formula})
""")
        (folder / "preset.py").write_text("from fledge.requirements import Requirements, fly\n\n\n"
                                          f"def preset(sim):\n    {fly}\n")
        return folder
    return write


@pytest.mark.parametrize("formula, says", REFUSED)
def test_what_cannot_fly_is_refused_with_what_to_do(formula, says, mission):
    with pytest.raises(MissionError, match=f"requirements.py, line [0-9]+: [AB]-1 .*{says}"):
        fledge.load(mission(formula))


def test_how_fly_is_called_wrongly(mission):
    folder = mission("always(x < 1)", "pass")
    sim = fledge.load(folder)
    with pytest.raises(SetupError, match="there is no requirement 'A-2'; did you mean 'A-1'"):
        fly(sim, "A-2")
    with pytest.raises(SetupError, match="judges up to 8 requirements; found 9"):
        fly(sim, *["A-1"] * 9)
    sim.run(1 * s)
    with pytest.raises(SetupError, match="fly: before the first run, as in preset.py"):
        fly(sim, "A-1")
    with pytest.raises(SetupError, match="no flight software has a RequirementMonitor: compose one in flight.py"):
        fly(fledge.load("nadir_spin"), "PNT-1")


def test_the_mode_is_that_of_the_sample(mission):
    folder = mission('always((r.mode() == "wait") | (x < 2))')
    sim = fledge.load(folder)
    judged = Requirements(sim).watch()
    wanted = None
    for _ in range(100):
        sim.run(400 * ms)
        if wanted:
            assert (sim.flight.judge.state.low[0], sim.flight.judge.state.high[0]) == wanted
        (outcome,) = judged.outcomes(so_far=True)
        wanted = as_output(outcome.low), as_output(outcome.high)
    assert sim.flight.active_mode == "point" and 0 < wanted[1] < 3


@pytest.mark.parametrize("mission, lines", [
    ("sun_gazer", ["SUN-1 5 operations, 2 numbers remembered", "SUN-2 7"]),
    ("nadir_spin", ["PNT-1", "PNT-3 reads world.craft.state"])])
def test_check_says_which_can_fly(mission, lines, capsys):
    assert cli.main(["check", mission, "--on-board"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert all(line in text for line in lines), text


def test_the_bounds_are_those_of_the_headers():
    text = "".join((ROOT / "flight" / name).read_text(encoding="utf-8")
                   for name in ("msg/requirement.h", "services/requirement_monitor.h"))
    of = {name: int(value) for name, value in re.findall(r"\b(\w+) = (\d+)\b", text)}
    assert (onboard.REQUIREMENTS, onboard.NODES, onboard.MEMORY, onboard.NUMBERS_MOST, onboard.VALUES, onboard.VECTOR
            ) == tuple(of[name] for name in ("REQUIREMENTS", "FORMULA_NODES", "FORMULA_MEMORY", "FORMULA_NUMBERS",
                                             "FORMULA_VALUES", "FORMULA_VECTOR"))
