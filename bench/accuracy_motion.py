# SPDX-License-Identifier: Apache-2.0
"""How far rotation, orbits and wheels are from their closed forms, by step and over time."""
from math import cos, degrees, sqrt

import numpy as np
from mpmath import mp, mpf

import fledge
from fledge import Orbit, flight, world

from bench import closed_forms as exact
from bench.accuracy_table import Section, Table

MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0
TOLERANCES = [1e-6, 1e-8, 1e-10, 1e-12, 1e-14]


def methods(steps, update):
    """(name of a row, method, update) for RK4 by step, then for Adaptive by tolerance."""
    for step in steps:
        yield f"RK4, {step:g} s", world.RK4(), step
    for tolerance in TOLERANCES:
        yield f"Adaptive, {tolerance:.0e}".replace("e-0", "e-"), world.Adaptive(tolerance, tolerance), update


def spacecraft(method, update, I_B=((1, 0, 0), (0, 1, 0), (0, 0, 1)), **given):
    """A simulation of a spacecraft alone, or with what it is given."""
    sim = fledge.Simulation()
    for part in given.get("parts", []):
        sim.world.wheels = part
    sim.world.craft = world.Spacecraft(I_B=I_B, **given)
    sim.world.integrator = method
    sim.world.task("dynamics", every=update, run=[sim.world.craft])
    return sim


# --- rotation --------------------------------------------------------------------------------------

TOP = dict(I_B=np.diag([700.0, 700.0, 900.0]), sigma_BN=[0.3, -0.2, 0.5], omega_BN_B=[0.06, -0.03, 0.09])
TUMBLER = dict(I_B=np.diag([500.0, 700.0, 900.0]), sigma_BN=[0.3, -0.2, 0.5], omega_BN_B=[0.08, 0.0, 0.06])
STEPS_OF_ROTATION = [1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01]


def momentum_and_energy(state, I_B):
    omega = exact.vector(state.omega_BN_B)
    momentum = exact.times([exact.vector(row) for row in I_B], omega)
    return (exact.times(exact.transpose(exact.dcm(exact.vector(state.sigma_BN))), momentum),
            exact.dot(omega, momentum) / 2)


def rotation():
    top = Table("Symmetric top: attitude error", "method, step or tolerance",
                [(f"after {name}", "rad") for name in ("1 min", "10 min", "1 h")])
    closed = exact.SymmetricTop(700, 900, TOP["sigma_BN"], TOP["omega_BN_B"])
    for name, method, update in methods(STEPS_OF_ROTATION, MINUTE):
        sim = spacecraft(method, update, **TOP)
        errors = []
        for t in (MINUTE, 10 * MINUTE, HOUR):
            sim.run(until=t)
            attitude = exact.dcm(exact.vector(sim.world.craft.state.sigma_BN))
            errors.append(exact.angle_between(attitude, closed.dcm_BN(t)))
        top.add(name, *errors)

    tumbler = Table("Tumbling body: after 1 h", "method, step or tolerance",
                    [("momentum", "relative"), ("energy", "relative"), ("rate", "relative")])
    closed = exact.Tumbler(np.diag(TUMBLER["I_B"]), TUMBLER["omega_BN_B"])
    for name, method, update in methods(STEPS_OF_ROTATION, MINUTE):
        sim = spacecraft(method, update, **TUMBLER)
        sim.reset()
        state, I_B = sim.world.craft.state, TUMBLER["I_B"]
        before = momentum_and_energy(state, I_B)
        sim.run(HOUR)
        after = momentum_and_energy(state, I_B)
        tumbler.add(name, exact.relative(after[0], before[0]), abs(after[1] / before[1] - 1),
                    exact.relative(exact.vector(state.omega_BN_B), closed.omega_B(HOUR)))
    return Section(
        "Torque-free rotation",
        "the closed form of the symmetric top; for a body with three moments, Jacobi's elliptic functions and the "
        "conservation of angular momentum in N and of energy.",
        "The top has moments of inertia of 700, 700, 900 kg m^2 and turns at 0.11 rad/s; the other body has 500, 700, "
        "900 kg m^2 and tumbles about its middle axis at 0.1 rad/s. Adaptive is updated every minute.",
        top, tumbler)


# --- orbits ----------------------------------------------------------------------------------------

ORBIT = dict(i=0.9, Omega=1.0, omega=2.0)
STEPS_OF_ORBITS = [60.0, 20.0, 10.0, 5.0, 2.0, 1.0, 0.1]
LONG = 10 * MINUTE    # what all steps divide


def orbits():
    tables = []
    for e in (0.0, 0.4, 0.7, 1.5):
        closed = e < 1.0
        orbit = Orbit(world.EARTH, rp=7000e3, e=e, f=0.5 if closed else -1.9, **ORBIT)
        if closed:
            times = [LONG * round(k * orbit.period / LONG) for k in (1, 10, 100)]
            names = ["1 revolution", "10 revolutions", "100 revolutions"]
        else:
            times, names = [HOUR, DAY, 10 * DAY], ["1 h", "1 d", "10 d"]
        there = [exact.kepler(world.EARTH.mu, orbit.r_BN_N, orbit.v_BN_N, t)[0] for t in times]
        table = Table(f"e = {e:g}: position error", "method, step or tolerance", [(f"after {n}", "m") for n in names])
        for name, method, update in methods(STEPS_OF_ORBITS, LONG):
            sim = spacecraft(method, update, gravity=[world.EARTH], orbit=orbit)
            errors = []
            for t, r in zip(times, there):
                sim.run(until=t)
                errors.append(exact.norm(exact.add(exact.vector(sim.world.craft.state.r_BN_N), r, -1)))
            table.add(name, *errors)
        tables.append(table)
    return Section(
        "Orbits about a point mass",
        "Kepler's equation in universal variables.",
        "Periapsis is at 7000 km; the run begins 0.5 rad after it, that of the hyperbola 1.9 rad before it. Adaptive "
        "is updated every 10 minutes. An error of energy changes the period, so most errors grow with the square of "
        "time, and some pass through zero before.",
        *tables)


# --- the oblate planet -----------------------------------------------------------------------------

def oblate():
    """A planet with J2 alone about the third axis of N."""
    def planet(J2):
        return world.Body("planet", mu=3.986004415e14, radius=6378.1363e3, J=(J2,)).zonal(2)

    p, e, i = 7500e3, 0.1, 0.9
    mu, R, J2 = 3.986004415e14, 6378.1363e3, 1.0826e-3

    kept = Table("J2 = 1.0826e-3: after 20 revolutions", "method, step or tolerance",
                 [("energy", "relative"), ("momentum about the pole", "relative")])
    start = Orbit(planet(J2), p=p, e=e, i=i)
    for name, method, update in methods(STEPS_OF_ORBITS, LONG):
        sim = spacecraft(method, update, gravity=[planet(J2)], orbit=start)
        sim.reset()
        before = energy_and_polar_momentum(sim.world.craft.state, mu, R, J2)
        sim.run(LONG * round(20 * start.period / LONG))
        after = energy_and_polar_momentum(sim.world.craft.state, mu, R, J2)
        kept.add(name, *(abs(a / b - 1) for a, b in zip(after, before)))

    drift = Table("Secular rates, Adaptive, 1e-12", "J2",
                  [(f"{angle}, {what}", unit) for angle in ("node", "periapsis")
                   for what, unit in (("found", "deg/d"), ("theory", "deg/d"), ("difference", "relative"))])
    for J2 in (1.0826e-3, 1.0826e-4, 1.0826e-5):
        sim = spacecraft(world.Adaptive(1e-12, 1e-9), MINUTE, gravity=[planet(J2)], orbit=start)
        log = sim.record(sim.world.craft.state, every=MINUTE)
        sim.run(50 * start.period)
        found = [Orbit.from_state(start.body, r, v) for r, v in zip(log["state.r_BN_N"], log["state.v_BN_N"])]
        a = np.mean([orbit.a for orbit in found])  # the mean elements of the theory
        ecc = np.mean([orbit.e for orbit in found])
        inclination = np.mean([orbit.i for orbit in found])
        factor = 1.5 * sqrt(mu / a**3) * J2 * (R / (a * (1 - ecc**2)))**2
        figures = []
        for angle, theory in ((np.unwrap([o.Omega for o in found]), -factor * cos(inclination)),
                              (np.unwrap([o.omega for o in found]), factor * (2 - 2.5 * (1 - cos(inclination)**2)))):
            # A smooth window leaves nothing of what goes to and fro with each revolution.
            rate = np.average(np.diff(angle), weights=np.hanning(len(angle) - 1)) / MINUTE
            figures += [degrees(rate) * DAY, degrees(theory) * DAY, abs(rate / theory - 1)]
        drift.add(f"{J2:.4e}".replace("e-0", "e-"), *figures)
    return Section(
        "Orbits about an oblate planet",
        "the conservation of energy and of the angular momentum about the pole; and the secular rates of node and "
        "periapsis in the first order of J2.",
        "p = 7500 km, e = 0.1, i = 0.9 rad. Adaptive is updated every 10 minutes.",
        kept,
        "Rates and elements are means over 50 revolutions. The difference is the theory's second order, which is left "
        "out: it falls in proportion to J2.",
        drift)


def energy_and_polar_momentum(state, mu, R, J2):
    r, v = exact.vector(state.r_BN_N), exact.vector(state.v_BN_N)
    distance = exact.norm(r)
    s = r[2] / distance
    potential = mu / distance * (1 - mpf(J2) * (mpf(R) / distance)**2 * (3 * s * s - 1) / 2)
    return exact.dot(v, v) / 2 - potential, exact.cross(r, v)[2]


# --- wheels ----------------------------------------------------------------------------------------

BODY, WHEEL = 20.0, 0.5    # [kg m^2] inertia of the body and of the wheel, about the wheel's axis
STEPS_OF_WHEELS = [1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01]


def one_wheel(method, update, **given):
    sim = spacecraft(method, update, I_B=np.diag([10.0, 15.0, BODY]),
                     parts=[world.ReactionWheels(axes_B=[[0, 0, 1]], J=WHEEL, **given)])
    log = sim.record(sim.world.wheels.speeds, every=update)
    return sim, log


def command(wheels, torques):
    wheels.command.u[:len(torques)] = torques
    wheels.command.head.quality = "GOOD"


def wheels():
    both = 1 / mpf(WHEEL) + 1 / mpf(BODY)
    alone = Table("One wheel on a free body: wheel speed", "method, step or tolerance",
                  [("constant torque", "relative"), ("viscous run-down", "relative"),
                   ("Coulomb run-down, sliding", "rad/s"), ("and stopping", "rad/s")])
    u, c, F = 0.2, 0.05, 0.1
    for name, method, update in [*methods(STEPS_OF_WHEELS, 1.0)]:
        sim, _ = one_wheel(method, update)
        command(sim.world.wheels, [u])
        sim.run(100)
        driven = mpf(float(sim.world.wheels.speeds.Omega[0])) / (mpf(u) * both * 100) - 1

        sim, _ = one_wheel(method, update, Omega=40.0, viscosity=c)
        sim.run(MINUTE)
        slowed = mpf(float(sim.world.wheels.speeds.Omega[0])) / (40 * mp.exp(-mpf(c) * both * 60)) - 1

        sim, log = one_wheel(method, update, Omega=5.0, friction=F)
        sim.run(MINUTE)
        left = 5 - F * float(both) * log.time
        error = np.abs(log["speeds.Omega[0]"] - np.maximum(left, 0))
        alone.add(name, abs(driven), abs(slowed), error[left > 0].max(), error[left <= 0].max())

    together = Table("Four wheels at work: total momentum", "method, step or tolerance",
                     [(f"after {t} min", "relative") for t in (1, 10, 60)])
    I_B = np.diag([50.0, 60.0, 80.0])
    for name, method, update in methods(STEPS_OF_WHEELS, 1.0):
        sim = spacecraft(method, update, I_B=I_B, sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.02, -0.03, 0.01], parts=[
            world.ReactionWheels(axes_B=flight.PYRAMID, J=0.16, u_max=0.2, Omega=[0, 10, 20, 30], viscosity=1e-3,
                                 friction=0.01)])
        sim.reset()
        before = total_momentum(sim.world, I_B)
        figures = []
        for t in range(0, 3600, 10):
            command(sim.world.wheels, [0.1 * ((t // 10 * k) % 7 - 3) / 3 for k in (1, 2, 3, 5)])
            sim.run(10)
            if t + 10 in (60, 600, 3600):
                figures.append(exact.relative(total_momentum(sim.world, I_B), before))
        together.add(name, *figures)
    return Section(
        "Reaction wheels",
        "closed forms of one wheel on a free body under a constant torque, viscous friction or Coulomb friction; and "
        "the conservation of the total angular momentum in N.",
        "0.2 N m for 100 s; 40 rad/s and c = 0.05 N m s for 60 s; 5 rad/s and 0.1 N m, which stop the wheel after 24.4"
        " s. Adaptive is updated every second. Where a wheel comes to rest within an update, a slip is left, whatever "
        "the method, which dies away within a few more.",
        alone,
        "Four wheels of J = 0.16 kg m^2 with both frictions; every 10 s the motors get other torques.",
        together)


def total_momentum(w, I_B):
    """Of body and wheels, N components."""
    omega = exact.vector(w.craft.state.omega_BN_B)
    momentum = exact.times([exact.vector(row) for row in I_B], omega)
    for axis, J, Omega in zip(w.wheels.axes_B, w.wheels.J, w.wheels.speeds.Omega):
        axis = exact.vector(axis)
        axis = exact.scale(1 / exact.norm(axis), axis)
        momentum = exact.add(momentum, axis, mpf(float(J)) * (exact.dot(axis, omega) + mpf(float(Omega))))
    return exact.times(exact.transpose(exact.dcm(exact.vector(w.craft.state.sigma_BN))), momentum)
