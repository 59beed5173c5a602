# SPDX-License-Identifier: Apache-2.0
"""How fast the world flies without flight code: 9,600 s at 0.1 s (RK4), one spacecraft and its parts about Mars.

    ./fledge bench world
    ./fledge bench world coupled panels

A case and its growth: what 1, 2, 4 and 8 parts cost; wheels and particles are computed by fours. PEERS: the best-known
open peer on this kind of machine, recorded in 2026-11, in seconds. The sizes of its parts are not known, nor the number
of its sloshing particles (here 3), nor whether the wheels beside its panels are balanced (here they are): these ratios
are a guide. All actuators act throughout.
"""
from __future__ import annotations
import time
from functools import partial

from fledge import Orbit, Simulation, world
from fledge.units import deg, kg, km, m, ms, rad, s

from bench.rows import PEER, Rows, in_turn, options, report

SECONDS = 9600
STEPS = 10 * SECONDS
PEERS = {"rigid": 1.17, "wheels": 1.50, "jitter": 1.92, "coupled": 2.21, "panels": 2.42, "slosh": 2.04,
         "wheels and panels": 2.71}
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
    part.valves.head.quality = 3
    return part


def tank():
    return {"isp": 200.0, "propellant": [50.0], "r_KB_B": [[0, 0, 0.2]], "radius": [0.3], "shape": [1]}


def gyros(n=4):
    axes = [PYRAMID[i % 4] for i in range(n)]
    part = world.ControlMomentGyros(gimbal_axes_B=axes, spin_axes_B=[[-y, x, 0] for x, y, _ in axes], J=0.16, J_g=0.1,
                                    J_s=0.05, J_t=0.12, Omega=20.0, lag=1.0)
    part.rates.rate[:n] = 0.01
    part.rates.head.quality = 3
    return part


def rods():
    field = world.Magnetism(body=world.MARS, dipole_P=[1e12, 2e12, -8e12])
    part = world.TorqueRods(field=field, axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], m_max=20.0)
    part.command.dipole[:3] = 5.0
    part.command.head.quality = 3
    return {"field": field, "rods": part}


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
    "gyros": lambda: {"gyros": gyros()},
    "rods": rods,
}
GROWTH = {"coupled": lambda n: wheels(n, jitter=0), "panels": panels, "slosh": slosh, "thrusters": thrusters,
          "gyros": gyros}


def prepared(parts):
    """A simulation of a craft with these parts, by their names, and with what they ask."""
    sim = Simulation("world")
    for name, part in parts.items():
        setattr(sim.world, name, part)
    sim.world.craft = world.Spacecraft(
        mass=750 * kg, I_B=[700, 700, 800] * kg * m**2, gravity=[world.MARS],
        orbit=Orbit(world.MARS, a=7471.618 * km, e=0.4, f=270 * deg), sigma_BN=[0.1, 0.2, -0.3],
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
        rows.add(name, "run", samples, "s",
                 note=f"{PEERS[name] / min(samples):.0f} times the {PEER}" if name in PEERS else "")
        rows.add(name, "derivative", [1e9 * t / (4 * STEPS) for t in samples], "ns", note="with its share of a step")
    for name in names:
        if name in GROWTH:
            grown = in_turn({n: partial(seconds, prepared({"part": GROWTH[name](n)})) for n in (1, 2, 4, 8)},
                            chosen.runs)
            for n, samples in grown.items():
                rows.add(f"{name}: {n} parts", "run", samples, "s")
    report(rows, chosen)
