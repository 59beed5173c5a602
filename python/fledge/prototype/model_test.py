# SPDX-License-Identifier: Apache-2.0
"""World models whose interface and behaviour are classes in Python."""
import re

import numpy as np
import pytest

from fledge import RunError, SetupError, Simulation, objects, prototype, world
from fledge.mission.wiring import Wiring
from fledge.prototype import input, mem, out, par
from fledge.units import kg, m, s


class Drag(prototype.Model):
    """A torque against the body's rotation, with noise that remembers."""
    truth   = input(world.CraftState)
    load    = out(world.ForceTorque, "for the spacecraft's input `external`")
    damping = par(float, "[N m s] >= 0: torque per angular rate")
    noise   = par(float, "[N m] >= 0: standard deviation of a step of the noise")
    walk    = mem(float, "[N m] the noise now")

    def prepare(self):
        if self.damping > 10:
            raise ValueError("that much damping needs a smaller step")

    def reset(self, t):
        self.walk = 1.0
        self.load.torque_B[2] = t
        self.publish(self.load)

    def update(self, t, dt):
        self.walk += self.noise * self.normal()
        self.load.torque_B = -self.damping * self.truth.omega_BN_B
        self.load.torque_B[0] += self.noise and self.walk
        self.publish(self.load)


def damped(seed=1, **parameters):
    sim = Simulation("damped", seed)
    w = sim.world
    w.craft = world.Spacecraft(I_B=[10, 10, 10] * kg * m**2, omega_BN_B=[0, 0, 0.5])
    w.drag = Drag(**{"damping": 1.0, **parameters})
    w.connect(w.craft.state >> w.drag.truth, w.drag.load >> w.craft.external)
    w.task("dynamics", every=0.1 * s, run=[w.craft, w.drag])
    return sim


def test_it_acts_in_the_loop_of_the_world():
    sim = damped()
    log = sim.record(sim.world.craft, sim.world.drag, every=1 * s)
    sim.run(10 * s)
    steps = 100     # the torque of one step acts in the next; from the reset on, there is one
    rate = 0.5
    for _ in range(steps):
        rate -= rate * 1.0 / 10 * 0.1
    np.testing.assert_allclose(log["state.omega_BN_B"][-1], [0, 0, rate], rtol=1e-12)
    assert "Drag; Python: class Drag" in Wiring(sim).outline()
    assert "in Python: class Drag, model_test.py, line " in repr(sim.world.drag)


def test_its_reset_publishes():
    sim = damped()
    sim.prepare()
    head = sim.world.drag.load.head
    assert (head.t, head.sequence, head.quality.name) == (0, 1, "GOOD") and sim.world.drag.walk == 1.0


def test_seed_name_and_memory_fix_its_random_numbers():
    def flown(seed, name="drag"):
        sim = damped(seed, noise=0.1)
        sim.run(2 * s)
        return sim

    first = flown(1)
    walk = first.world.drag.walk
    assert flown(1).world.drag.walk == walk != flown(2).world.drag.walk
    snapshot, clone = first.snapshot(), first.clone()
    for sim in (first, clone):
        sim.run(2 * s)
    end = objects.memory(first.world.drag)
    assert objects.memory(clone.world.drag) == end
    first.restore(snapshot)
    assert first.world.drag.walk == walk
    first.run(2 * s)
    assert objects.memory(first.world.drag) == end
    first.reset()
    first.run(2 * s)
    assert first.world.drag.walk == walk


def uniform_stream(seed, name):
    """sim/random.h once more: FNV-1a of seed and name, splitmix64, xoshiro256**."""
    mask = 2**64 - 1
    state = 0xcbf29ce484222325
    for byte in seed.to_bytes(8, "little") + name.encode():
        state = (state ^ byte) * 0x100000001b3 & mask
    x = []
    for _ in range(4):
        state = state + 0x9e3779b97f4a7c15 & mask
        z = (state ^ state >> 30) * 0xbf58476d1ce4e5b9 & mask
        z = (z ^ z >> 27) * 0x94d049bb133111eb & mask
        x.append(z ^ z >> 31)

    def rotated(value, k):
        return (value << k | value >> 64 - k) & mask
    while True:
        yield ((rotated(x[1] * 5 & mask, 7) * 9 & mask) >> 11) / 2**53
        t = x[1] << 17 & mask
        x[2] ^= x[0]
        x[3] ^= x[1]
        x[1] ^= x[2]
        x[0] ^= x[3]
        x[2] ^= t
        x[3] = rotated(x[3], 45)


def test_its_draws_are_those_of_a_model_in_cpp():
    """The stream of sim/random.h: by its definition, by the moments, and no draw outside of an update."""
    class Draws(prototype.Model):
        """Sums of draws."""
        first  = mem(float, "[-] the first numbers", shape=3)
        n      = mem(int, "[-] draws")
        total  = mem(float, "[-] of uniform numbers")
        square = mem(float, "[-] of normal numbers")

        def reset(self, t):
            self.first = [self.uniform() for _ in range(3)]

        def update(self, t, dt):
            for _ in range(100):
                self.n += 1
                self.total += self.uniform()
                self.square += self.normal() ** 2

    sim = Simulation("draws", 7)
    sim.world.it = Draws()
    sim.world.task("t", every=1 * s, run=[sim.world.it])
    sim.run(99 * s)
    expected = uniform_stream(7, "world.it")
    assert sim.world.it.first.tolist() == [next(expected) for _ in range(3)]
    n = sim.world.it.n
    assert n == 10_000
    assert abs(sim.world.it.total / n - 0.5) < 4 * (1 / 12 / n) ** 0.5
    assert abs(sim.world.it.square / n - 1) < 4 * (2 / n) ** 0.5
    with pytest.raises(SetupError, match="world.it: random numbers are for its own update and reset"):
        sim.world.it.normal()


def test_what_prepare_refuses_is_reported_before_the_run():
    with pytest.raises(SetupError, match=r"model_test.py, line \d+: world.drag before the run: ValueError: that much"):
        damped(damping=11).prepare()


def test_what_its_update_does_wrong_is_reported_with_its_line():
    class Broken(Drag):
        """Divides by zero."""

        def update(self, t, dt):
            self.load.torque_B[0] = np.inf if t > 1 else 0
            self.publish(self.load)

    sim = Simulation("broken")
    sim.world.it = Broken()
    sim.world.task("t", every=1 * s, run=[sim.world.it])
    sim.world.craft = world.Spacecraft(I_B=1)
    sim.world.connect(sim.world.craft.state >> sim.world.it.truth)
    sim.world.task("c", every=1 * s, run=[sim.world.craft])
    with pytest.raises(RunError, match=re.escape("world.it at 2 s: ValueError: world.it.load says GOOD, but its "
                                                 "torque_B[0] is inf")):
        sim.run(5 * s)
    with pytest.raises(SetupError, match=r"Bad.reset: expected a function of \(self, t\); found"):
        type("Bad", (Drag,), {"__doc__": "Bad.", "reset": lambda self: None, "__module__": __name__})


def test_it_does_not_fly():
    sim = Simulation("wrong")
    with pytest.raises(SetupError, match="a Drag is a model of the world and cannot fly"):
        sim.flight.drag = Drag()


def test_a_parameter_that_an_event_changes_counts_at_once():
    sim = damped(damping=0.0)
    sim.world.at(1 * s, lambda: setattr(sim.world.drag, "damping", 2.0))
    sim.run(2 * s)
    assert sim.world.drag.load.torque_B[2] == -2.0 * sim.world.craft.state.omega_BN_B[2] < 0
