# SPDX-License-Identifier: Apache-2.0
"""How fast the world flies without flight code: 9,600 s at 0.1 s (RK4), one spacecraft and its parts about Mars
(with the World Magnetic Model about the Earth).

    ./fledge bench world
    ./fledge bench world coupled panels

A case and its growth: what 1, 2, 4 and 8 parts cost; wheels and particles are computed by fours. All actuators act
throughout. PEER_RATIOS: what a case of the best-known open peer, the development branch of 2026-07 built from its
sources, took of its rigid one, with the same numbers, on two quiet cores in 2026-11. There its rigid case took 1.07 s,
and Fledge's 0.0088 s.
"""
from __future__ import annotations
import time
from functools import partial

from fledge import Orbit, Simulation, world
from fledge.units import deg, kg, m, ms, rad, s

from bench.rows import PEER, Rows, in_turn, options, report

SECONDS = 9600
STEPS = 10 * SECONDS
PEER_RATIOS = {"wheels": 1.37, "jitter": 1.67, "coupled": 1.91, "panels": 2.18, "slosh": 3.37,
               "wheels and panels": 2.54, "8 thrusters": 1.11, "thrusters and tank": 1.45, "8 thrusters and tank": 1.55,
               "gyros": 1.97, "rods": 1.09}
PYRAMID = [[x, y, -0.5**0.5] for x, y in ((-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5))]


def wheels(n=4, **more):
    axes = [PYRAMID[i % 4] for i in range(n)]
    if more:
        more.update(unbalance=4.8e-6, couple=1.54e-7, r_WB_B=[[0.3 * x for x in axis] for axis in axes])
    return world.ReactionWheels(axes_B=axes, J=0.16, Omega=[20.0 + 3 * i for i in range(n)] * rad / s, **more)


def panels(n=2):
    sides = [-1.0 if i % 2 else 1.0 for i in range(n)]
    return world.HingedPanels(
        n=n, mass=20.0, I_B=[[[10, 0, 0], [0, 5, 0], [0, 0, 14]]] * n * kg * m**2, axes_B=[[1, 0, 0]] * n,
        hinge_B=[[0, 1.2 * side, 0.1] for side in sides], center_B=[[0, 1.5 * side, 0] for side in sides],
        stiffness=300.0, damping=0.1, theta=[0.02] * n)


def slosh(n=3):
    lines = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    return world.FuelSlosh(n=n, mass=10.0, r_B=[[0.1, 0, -0.1]] * n, axes_B=[lines[i % 3] for i in range(n)],
                           stiffness=23.0, damping=0.4, rho=[0.05] * n)


def thrusters(n=4, **tank):
    arms = [[x, y, -0.5] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    part = world.Thrusters(r_TB_B=[arms[i % 4] for i in range(n)], axes_B=[[0, 0, 1]] * n, F=0.1, **tank)
    part.valves.open[:n] = 1
    part.valves.head.quality = "GOOD"
    return part


def tank(shape=1, **more):
    return {"isp": 200.0, "propellant": [50.0], "r_KB_B": [[0, 0, 0.2]], "radius": [0.3], "shape": [shape], **more}


def gyros(n=4):
    axes = [PYRAMID[i % 4] for i in range(n)]
    part = world.ControlMomentGyros(gimbal_axes_B=axes, spin_axes_B=[[-y, x, 0] for x, y, _ in axes], J=0.16, J_g=0.1,
                                    J_s=0.05, J_t=0.12, Omega=20.0, lag=1.0)
    part.rates.rate[:n] = 0.01
    part.rates.head.quality = "GOOD"
    return part


def rods(**earth):
    field = world.Magnetism(**earth or {"body": world.MARS, "dipole_P": [1e12, 2e12, -8e12]})
    part = world.TorqueRods(field=field, axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], m_max=20.0)
    part.command.dipole[:3] = 5.0
    part.command.head.quality = "GOOD"
    return {"field": field, "rods": part}


def wmm():
    return {"body": world.EARTH, "coefficients": "WMM2025", "sky": world.Sky("2026-01-01", center=world.EARTH)}


CASES = {
    "rigid": lambda: {},
    "wheels": lambda: {"wheels": wheels()},
    "jitter": lambda: {"wheels": wheels(jitter=1)},
    "coupled": lambda: {"wheels": wheels(jitter=0)},
    "panels": lambda: {"panels": panels()},
    "slosh": lambda: {"slosh": slosh()},
    "wheels and panels": lambda: {"wheels": wheels(), "panels": panels()},
    "thrusters": lambda: {"thrusters": thrusters()},
    "thrusters and tank": lambda: {"thrusters": thrusters(**tank())},
    "8 thrusters": lambda: {"thrusters": thrusters(8)},
    "8 thrusters and tank": lambda: {"thrusters": thrusters(8, **tank())},
    "8 thrusters and filled tank": lambda: {"thrusters": thrusters(8, **tank(0))},
    "8 thrusters and settled tank": lambda: {"thrusters": thrusters(8, **tank(2, fill=[0.7], down_B=[[0, 0, -1]]))},
    "gyros": lambda: {"gyros": gyros()},
    "rods": rods,
    "rods with WMM": lambda: rods(**wmm()),
    "rods with WMM to 0.1 nT": lambda: rods(**wmm(), tolerance=1e-10),
}
GROWTH = {"coupled": lambda n: wheels(n, jitter=0), "panels": panels, "slosh": slosh, "thrusters": thrusters,
          "gyros": gyros}


def prepared(parts):
    """A simulation of a craft with these parts, by their names, and with what they ask, whose body it flies about."""
    body = next((part.body for part in parts.values() if isinstance(part, world.Magnetism)), world.MARS)
    sim = Simulation("world")
    for name, part in parts.items():
        setattr(sim.world, name, part)
    sim.world.craft = world.Spacecraft(
        mass=750 * kg, I_B=[700, 700, 800] * kg * m**2, gravity=[body],
        orbit=Orbit(body, a=2.2 * body.radius, e=0.4, f=270 * deg), sigma_BN=[0.1, 0.2, -0.3],
        omega_BN_B=[0.001, -0.01, 0.03] * rad / s,
        parts=[part for part in parts.values() if not isinstance(part, world.Magnetism)])
    sim.world.integrator = world.RK4()
    sim.world.task("dynamics", every=100 * ms, run=[sim.world.craft])
    for part in parts.values():
        if isinstance(part, world.Magnetism):
            sim.world.connect(sim.world.craft.state >> part.truth)
            sim.world.task("messages", every=SECONDS * s, run=[part])
    return sim


def seconds(sim):
    """The time of one run, of the processor."""
    sim.reset()
    start = time.process_time()
    sim.run(SECONDS * s)
    return time.process_time() - start


def main(arguments: list[str]) -> None:
    chosen = options("world", arguments, runs=9, cases=list(CASES))
    names = chosen.cases or list(CASES)
    rows = Rows()
    times = in_turn({name: partial(seconds, prepared(CASES[name]())) for name in names}, chosen.runs)
    for name, samples in times.items():
        note = f"{min(samples) / min(times['rigid']):.3g} x rigid" if "rigid" in times and name != "rigid" else ""
        rows.add(name, "run", samples, "s",
                 note=note and note + (f"; {PEER_RATIOS[name]:g} x its own: {PEER}" if name in PEER_RATIOS else ""))
        rows.add(name, "derivative", [1e9 * t / (4 * STEPS) for t in samples], "ns", note="with its share of a step")
    for name in names:
        if name in GROWTH:
            grown = in_turn({n: partial(seconds, prepared({"part": GROWTH[name](n)})) for n in (1, 2, 4, 8)},
                            chosen.runs)
            for n, samples in grown.items():
                rows.add(f"{name}: {n} parts", "run", samples, "s")
    report(rows, chosen)
