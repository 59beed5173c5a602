# SPDX-License-Identifier: Apache-2.0
"""How far drag, the pressure of sunlight and the torque of gravity are from their closed forms, by step and over
time."""
from mpmath import mp, mpf

import fledge
from fledge import Orbit, world

from bench import closed_forms as exact
from bench.accuracy_motion import HOUR, MINUTE, methods
from bench.accuracy_table import Section, Table

DAY = 24 * HOUR


def fly(method, update, *parts, sources=(), **given):
    """A simulation of a spacecraft with these parts, and the models that they ask."""
    sim = fledge.Simulation()
    w = sim.world
    for part in parts:
        setattr(w, type(part).__name__.lower(), part)
    w.craft = world.Spacecraft(parts=parts, **{"mass": 100, "I_B": [1, 1, 1], **given})
    for name, source in sources:
        setattr(w, name, source)
        w.connect(w.craft.state >> source.truth)
    w.integrator = method
    w.task("dynamics", every=update, run=[w.craft, *(source for _, source in sources)])
    sim.reset()
    return sim


def drag():
    """Along a straight line without gravity: v = v0 / (1 + k v0 t), s = log(1 + k v0 t) / k."""
    density, Cd, area, speed = 1e-6, 2.0, 1.0, 7000.0
    k = mpf(density) * mpf(Cd) * mpf(area) / 200
    table = Table("Drag: a craft slows down in still air", "method, step or tolerance",
                  [(f"{what} after {name}", unit) for name in ("1 h", "1 d")
                   for what, unit in (("way", "relative"), ("speed", "relative"))])
    for name, method, update in methods([600.0, 200.0, 100.0, 50.0, 20.0, 10.0], HOUR):
        air = world.Atmosphere(body=world.EARTH, law="CONSTANT", density=density)
        sim = fly(method, update, world.Drag(air=air, Cd=Cd, area=area), sources=[("air", air)],
                  r_BN_N=[7e6, 0, 0], v_BN_N=[0, speed, 0])
        figures = []
        for t in (HOUR, DAY):
            sim.run(until=t)
            state, slower = sim.world.craft.state, 1 + k * mpf(speed) * mpf(t)
            figures += [abs(mpf(float(state.r_BN_N[1])) * k / mp.log(slower) - 1),
                        abs(mpf(float(state.v_BN_N[1])) * slower / mpf(speed) - 1)]
        table.add(name, *figures)
    return table


def pressure():
    """With gravity, it keeps v^2 / 2 - mu / r + K / d, d the distance from the Sun."""
    sun, Cr, area, irradiance = [-3e9, 2e9, 4e9], 1.3, 20.0, 1361.0
    K = mpf(irradiance) / 299792458 * mpf(149597870700)**2 * mpf(Cr) * mpf(area) / 100

    def energy(state):
        r, v = exact.vector(state.r_BN_N), exact.vector(state.v_BN_N)
        return (exact.dot(v, v) / 2 - mpf(world.EARTH.mu) / exact.norm(r)
                + K / exact.norm(exact.add(r, exact.vector(sun), -1)))

    table = Table("Sunlight: the energy with gravity and light", "method, step or tolerance",
                  [(f"after {name}", "relative") for name in ("1 h", "1 d")])
    for name, method, update in methods([60.0, 20.0, 10.0, 5.0, 2.0], 10 * MINUTE):
        light = world.Sunlight(sun=world.SUN.at(sun), irradiance=irradiance)
        sim = fly(method, update, world.SolarPressure(light=light, Cr=Cr, area=area),
                  sources=[("light", light)], gravity=[world.EARTH], orbit=Orbit(world.EARTH, rp=7000e3, e=0.1, i=1.0))
        before, figures = energy(sim.world.craft.state), []
        for t in (HOUR, DAY):
            sim.run(until=t)
            figures.append(abs((energy(sim.world.craft.state) - before) / before))
        table.add(name, *figures)
    return table


def gradient():
    """In the plane of a circular orbit: theta'' = -3/2 n^2 (B - A) / C sin 2 theta, so sin theta = k sn(w t, k^2) with
    w^2 = 3 n^2 (B - A) / C and k the sine of the amplitude."""
    A, B, C = 500.0, 900.0, 1000.0
    a = 7e6
    n = mp.sqrt(mpf(world.EARTH.mu) / mpf(a)**3)
    w, k = n * mp.sqrt(3 * (mpf(B) - mpf(A)) / mpf(C)), mp.sin(mpf(40) * mp.pi / 180)
    table = Table("Gravity's gradient: the angle of a libration of 40 deg", "method, step or tolerance",
                  [(f"after {name}", "rad") for name in ("1 h", "1 d")])
    for name, method, update in methods([60.0, 20.0, 10.0, 5.0, 2.0], 10 * MINUTE):
        sim = fly(method, update, world.GravityGradient(), gravity=[world.EARTH], I_B=[A, B, C],
                  r_BN_N=[a, 0, 0], v_BN_N=[0, float(a * n), 0], omega_BN_B=[0, 0, float(n + k * w)])
        figures = []
        for t in (HOUR, DAY):
            sim.run(until=t)
            attitude = exact.dcm(exact.vector(sim.world.craft.state.sigma_BN))
            theta = mp.asin(k * mp.ellipfun("sn", w * mpf(t), m=k * k))
            wanted = exact.transpose(exact.rotation([mpf(0), mpf(0), mp.fmod(n * mpf(t), 2 * mp.pi) + theta]))
            figures.append(exact.angle_between(attitude, wanted))
        table.add(name, *figures)
    return table


def surroundings():
    return Section(
        "Air, sunlight and the gradient of gravity",
        "a body that the air alone slows down, the potential of the sunlight's pressure, and the libration in the "
        "plane of a circular orbit in Jacobi's elliptic functions.",
        "The craft flies through still air of 1e-6 kg/m^3 at 7 km/s, without gravity; after a day it has 0.14 of that.",
        drag(),
        "The Sun is only 5.4 million km away, so that its push of 9e-4 m/s^2 changes along the orbit.",
        pressure(),
        "The orbit at 7000 km. The error of the orbit itself is in it.",
        gradient())
