# SPDX-License-Identifier: Apache-2.0
"""Requirements that fly: the verdicts and margins of the simulation's judge, bit for bit, at each sample."""
import random
import re

import numpy as np
import pytest

import fledge
from fledge import cli, prototype
from fledge import flight as fsw
from fledge.commands.protocol import LARGEST
from fledge.errors import Failure, SetupError
from fledge.prototype import field, out, par
from fledge.requirements import (Requirements, after, always, angle, before, begins, eventually, fly, never, settles,
                                 turned, until, within)
from fledge.requirements.declared import Declaration
from fledge.requirements.judge import Judged
from fledge.requirements.onboard import MEMORY, NODES, Compiled
from fledge.targets import TARGETS
from fledge.units import minute, ms, s


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


def said(margin):
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
        wanted = [(said(outcome.low), said(outcome.high)) for outcome in judged.outcomes(so_far=True)]
        decided += sum(low > 0 or high < 0 for low, high in wanted)
    return decided


def test_each_margin_is_that_of_the_simulations_judge_at_each_sample():
    decided = [flown_as_judged(seed) for seed in range(25)]
    assert sum(decided) > 500 and sum(n > 0 for n in decided) > 15


@pytest.mark.long("1,000 flights of random formulas")
def test_each_margin_is_that_of_the_simulations_judge_for_many_formulas():
    assert sum(flown_as_judged(seed) for seed in range(100, 1100)) > 20_000
