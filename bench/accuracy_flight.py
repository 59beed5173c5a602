# SPDX-License-Identifier: Apache-2.0
"""How good elementary functions, navigation noise and the closed loop are."""
import ctypes
import random
import runpy
from math import ldexp, pi, sqrt

import numpy as np
from mpmath import mp, mpf

import fledge
from fledge import attitude, mission, world

from bench import closed_forms as exact
from bench.accuracy_table import Section, Table
from bench.sim import compare, library, simulator_state

AGREE = 1e-12    # what simulator and hand-written loop must agree to

# --- elementary functions --------------------------------------------------------------------------


def spread(low, high):
    """Numbers whose every exponent from low to high is equally likely."""
    return lambda generator: ldexp(1.0 + generator.random(), generator.randint(low, high))


def either_sign(draw):
    return lambda generator: generator.choice((-1.0, 1.0)) * draw(generator)


def between(low, high):
    return lambda generator: generator.uniform(low, high)


# Of each function: arguments as they are in use, and over the whole range of double.
ARGUMENTS = {
    "sin": (between(-2 * pi, 2 * pi), either_sign(spread(-1074, 1023))),
    "cos": (between(-2 * pi, 2 * pi), either_sign(spread(-1074, 1023))),
    "tan": (between(-pi / 2, pi / 2), either_sign(spread(-1074, 1023))),
    "asin": (between(-1, 1), either_sign(spread(-1074, -1))),
    "acos": (between(-1, 1), either_sign(spread(-1074, -1))),
    "atan": (between(-10, 10), either_sign(spread(-1074, 1023))),
    "exp": (between(-10, 10), between(-745, 709)),
    "log": (between(0, 10), spread(-1074, 1023)),
}


def elementary():
    lib = library()
    lib.elementary.argtypes, lib.elementary.restype = [ctypes.c_char_p, ctypes.c_double], ctypes.c_double
    table = Table("Worst of 2,000 arguments", "function", [("in ordinary use", "ulp"), ("over all exponents", "ulp")])
    for name, ranges in ARGUMENTS.items():
        worst = []
        for draw in ranges:
            generator = random.Random(1)
            arguments = [draw(generator) for _ in range(2000)]
            worst.append(max(ulps(lib.elementary(name.encode(), x), getattr(mp, name)(mpf(x))) for x in arguments))
        table.add(name, *worst)
    return Section(
        "Elementary functions",
        "mpmath with 40 digits.",
        "The nearest double is at most 0.5 ulp away. Ordinary use is one turn and a ratio, an exponent or an argument "
        "of up to 10. flight/math/README.md has the worst errors of ten million arguments.",
        table)


def ulps(found, expected):
    """|found - expected| in units of the last place of a double of that size."""
    place = max(mp.frexp(expected)[1] - 53, -1074)
    return mp.ldexp(abs(mpf(found) - expected), -int(place))


# --- navigation ------------------------------------------------------------------------------------

def navigation():
    n = 20000
    noise = dict(attitude_noise=[1e-3, 2e-3, 3e-3], rate_noise=[1e-5, 2e-5, 3e-5], position_noise=[1.0, 2.0, 3.0],
                 velocity_noise=[0.1, 0.2, 0.3])
    sim = fledge.Simulation(seed=1)
    w = sim.world
    w.craft = world.Spacecraft(I_B=np.eye(3), sigma_BN=[0.3, -0.2, 0.5], omega_BN_B=[0.01, 0.02, -0.03])
    w.nav = world.Navigation(**noise)
    w.connect(w.craft.state >> w.nav.truth)
    w.task("dynamics", every=0.1, run=[w.craft, w.nav])
    log = sim.record(w.craft.state, w.nav.attitude, w.nav.orbit, every=0.1)
    sim.run(0.1 * (n - 1))

    turns = attitude.dcm_to_prv(attitude.mrp_to_dcm(log["attitude.sigma_BN"])
                                @ np.swapaxes(attitude.mrp_to_dcm(log["state.sigma_BN"]), 1, 2))
    table = Table(f"{n:,} updates, the three axes, worst", "of", [
        ("mean", "deviation"), ("standard deviation", "relative"), ("correlation of axes", "-"),
        ("with the update before", "-"), ("beyond 3 deviations", "share")])
    for name, error, deviation in (
            ("attitude", turns, noise["attitude_noise"]),
            ("rate", log["attitude.omega_BN_B"] - log["state.omega_BN_B"], noise["rate_noise"]),
            ("position", log["orbit.r_BN_N"] - log["state.r_BN_N"], noise["position_noise"]),
            ("velocity", log["orbit.v_BN_N"] - log["state.v_BN_N"], noise["velocity_noise"])):
        x = error / deviation
        table.add(name, np.abs(x.mean(axis=0)).max(), np.abs(x.std(axis=0) - 1).max(),
                  max(abs(np.mean(x[:, i] * x[:, i - 1])) for i in range(3)),
                  np.abs(np.mean(x[1:] * x[:-1], axis=0)).max(), np.mean(np.abs(x) > 3))
    table.add("one standard error", 1 / sqrt(n), 1 / sqrt(2 * n), 1 / sqrt(n), 1 / sqrt(n),
              sqrt(0.0027 / (3 * n)))
    return Section(
        "Navigation noise",
        "the statistics of independent normal numbers of the given deviations.",
        "The last row is one standard error: what chance alone makes of a figure. Each figure is the worst of three "
        "axes, so twice that is nothing unusual. The share is of all axes; of normal numbers, 0.0027 lie beyond three "
        "deviations.",
        table)


# --- the closed loop -------------------------------------------------------------------------------

class Paced:
    """A process whose tasks run at the rates given here, not at those of the mission."""

    def __init__(self, process, every):
        object.__setattr__(self, "process", process)
        object.__setattr__(self, "every", every)

    def __getattr__(self, name):
        return getattr(self.process, name)

    def __setattr__(self, name, value):
        setattr(self.process, name, value)

    def task(self, name, *, every, run, **others):
        return self.process.task(name, every=self.every, run=run, **others)


def nadir_spin(step, method, flight=0.5):
    """The mission, its world updated every `step` and its flight software every `flight` seconds."""
    folder = mission.find("nadir_spin").folder
    sim = fledge.Simulation()
    runpy.run_path(str(folder / "flight.py"))["build"](Paced(sim.flight, flight))
    runpy.run_path(str(folder / "world.py"))["build"](Paced(sim.world, step), sim.flight)
    sim.world.integrator = method
    return sim


def errors(sim):
    error = sim.flight.tracking.error
    return exact.norm(exact.vector(error.sigma_BR)), exact.norm(exact.vector(error.omega_BR_B))


def loop():
    minutes = (10, 40, 160)

    by_hand = Table("Simulator against the loop written by hand, RK4 at 0.1 s", "after", [("end state", "relative")])
    lib, sim = library(), fledge.load("nadir_spin")
    for t in minutes:
        sim.run(until=60 * t)
        end = (ctypes.c_double * 16)()
        lib.hand_written_loop(600 * t, end)
        difference = compare(simulator_state(sim), list(end))
        if not difference < AGREE:
            raise SystemExit(f"after {t} min simulator and hand-written loop differ by {difference:.2g}")
        # Its sine is the C library's, so the last digits are the machine's.
        by_hand.add(f"{t} min", f"< {AGREE:.0e}")

    def fly(sim):
        found = []
        for t in minutes:
            sim.run(until=60 * t)
            found.append(simulator_state(sim))
        return found

    reference = fly(nadir_spin(0.5, world.Adaptive(1e-14, 1e-14)))
    steps = Table("State against Adaptive at 1e-14", "method, step",
                  [(f"after {t} min", "relative") for t in minutes]
                  + [("tracking error after 160 min", "-"), ("rate error", "rad/s")])
    for step in (0.5, 0.25, 0.1, 0.05, 0.02, 0.01):
        sim = nadir_spin(step, world.RK4())
        steps.add(f"RK4, {step:g} s", *(compare(a, b) for a, b in zip(fly(sim), reference)), *errors(sim))

    periods = Table("Flight software run more often", "period of flight",
                    [("tracking error after 160 min", "-"), ("rate error", "rad/s")])
    for period in (1.0, 0.5, 0.25, 0.1, 0.05):
        sim = nadir_spin(period / round(period / 0.05), world.RK4(), period)
        sim.run(160 * 60)
        periods.add(f"{period:g} s", *errors(sim))
    return Section(
        "The closed loop",
        "a second implementation of the whole nadir spin, written by hand for this one mission "
        "(bench/hand_written_loop.cpp); and the same mission with the tightest integration.",
        "The largest difference of position, velocity, attitude, rate and wheel speeds, each over the length of its "
        "vector. The mission passes periapsis after 41 min.",
        by_hand, steps,
        "At the mission's step, 0.1 s, rounding is what is left. The tracking error is the control law's: a torque is "
        "held for a whole period of flight while the reference turns on, so the error falls with that period.",
        periods)
