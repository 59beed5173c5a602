# SPDX-License-Identifier: Apache-2.0
"""What each model of the air, of light and of tides costs a step.

A step of RK4 of a spacecraft in a field of J2 to J6, 400 km over the Earth, with drag by each law of the air, and with
sunlight and the Earth's light on six facets; in a field of degree 8 with tides, where the ephemeris is asked for the
Moon and the Sun in any case, and where it is not. In turn, in this process, by processor time. A step asks four times.
"""
from __future__ import annotations
import tempfile
import time
from functools import partial
from pathlib import Path

from fledge import Orbit, Simulation, world

from bench.rows import Rows, in_turn, options, report

BOX = {"areas": [1.0] * 6, "normals_B": [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]],
       "centres_B": [[0.5, 0, 0], [-0.5, 0, 0], [0, 0.5, 0], [0, -0.5, 0], [0, 0, 0.5], [0, 0, -0.5]]}


def drag(sky, w, air, **free):
    w.air = air
    w.drag = world.Drag(air=w.air, **(free or {"Cd": 2.2}), **BOX)
    return w.drag


def upper(sky, w, law, **free):
    return drag(sky, w, world.EarthAtmosphere(law=law, F107=150, ap=15, sky=sky), **free)


def light(sky, w, oblate=0, rings=0):
    w.light = world.Sunlight(sun=world.SUN, shadows=[world.EARTH, world.MOON], oblate=oblate, sky=sky)
    w.pressure = world.SolarPressure(light=w.light, specular=[0.2] * 6, **BOX)
    if rings:
        w.planet = world.PlanetRadiation(body=world.EARTH, light=w.light, rings=rings, law="KNOCKE_1988", sky=sky)
        w.pressure.radiation = w.planet
    return w.pressure


def field(tides):
    """The Earth's, from a file with J2 alone."""
    given = {(0, 0): 1.0, (2, 0): -world.EARTH.J[0] / 5**0.5}
    rows = ["product_type gravity_field", f"earth_gravity_constant {world.EARTH.mu}", f"radius {world.EARTH.radius}",
            "max_degree 8", "norm fully_normalized", "tide_system tide_free", "end_of_head",
            *(f"gfc {n} {m} {given.get((n, m), 0.0)} 0" for n in range(9) for m in range(n + 1))]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "J2.gfc"
        file.write_text("\n".join(rows), encoding="utf-8")
        return world.EARTH.harmonics(file, degree=8, tides=tides)


CASES = {
    "gravity alone": None,
    "US Standard Atmosphere 1976": lambda sky, w: drag(sky, w, world.Atmosphere(
        body=world.EARTH, law="STANDARD_1976", sky=sky)),
    **{law: partial(upper, law=law) for law in ("NRLMSISE_00", "JB2008", "DTM2000", "MET")},
    "MET, free molecular flow": partial(upper, law="MET", T_wall=300, accommodation=0.9),
    "sunlight": light,
    "sunlight, oblate shadow": partial(light, oblate=1),
    "sunlight, Earth's light of 2 rings": partial(light, rings=2),
}


def main(arguments: list[str]) -> None:
    chosen = options("surroundings", arguments, runs=9)
    rows = Rows()
    steps = in_turn({name: partial(time_of_a_step, case) for name, case in CASES.items()}, chosen.runs)
    for name in CASES:
        rows.add(name, "step of RK4", steps[name], "ns", None if name == "gravity alone" else "gravity alone")
    earths = {"field of degree 8": [field(False)], "and tides": [field(True)]}
    earths |= {f"{name}, Moon and Sun": [*earth, world.MOON, world.SUN] for name, earth in earths.items()}
    steps = in_turn({name: partial(time_of_a_step, None, gravity) for name, gravity in earths.items()}, chosen.runs)
    for name in earths:
        rows.add(name, "step of RK4", steps[name], "ns",
                 name.replace("and tides", "field of degree 8") if "tides" in name else None)
    report(rows, chosen)


def time_of_a_step(case, gravity=(world.EARTH.zonal(6),), steps=5_000):
    """[ns] of processor time."""
    sim = Simulation("surroundings")
    w, sky = sim.world, world.Sky("2015-03-20T12:00:00", world.EARTH)
    part = case(sky, w) if case else None
    w.craft = world.Spacecraft(I_B=10, mass=100, sky=sky, gravity=list(gravity), parts=[part] if part else [],
                               orbit=Orbit(world.EARTH, altitude=400e3, i=1.0))
    for model in ("air", "light", "planet"):        # which a task runs at another rate, so that it counts little
        if hasattr(w, model):
            w.connect(w.craft.state >> getattr(w, model).truth)
            w.task(model, every=1000, run=[getattr(w, model)])
    w.integrator = world.RK4()
    w.task("dynamics", every=1, run=[w.craft])
    sim.run(1)
    start = time.process_time()
    sim.run(steps)
    return 1e9 * (time.process_time() - start) / steps
