# SPDX-License-Identifier: Apache-2.0
"""How fast spherical-harmonic gravity is, per evaluation, at degree 12 (that of magnetic fields), 20, 70 and 180.

By processor time. Each pair of degree and order takes 14 products and sums, of which a processor of today makes four
vectors a cycle at best: the note says how many numbers a nanosecond.
Then a step of RK4 about the Earth by zonal harmonics, with its built-in orientation and with IAU 2006/2000A.
"""
from __future__ import annotations
import ctypes
import time
from functools import partial

from fledge import Orbit, Simulation, world

from bench.rows import Rows, in_turn, options, report

DEGREES = [12, 20, 70, 180]
OPERATIONS = 14        # for each n, m


def library():
    from fledge.disk import build_folder
    lib = ctypes.CDLL(str(build_folder() / "python" / "libfledge_bench.so"))
    lib.time_harmonics.argtypes = [ctypes.c_int, ctypes.c_long]
    lib.time_harmonics.restype = ctypes.c_double
    return lib


def main(arguments: list[str]) -> None:
    chosen = options("gravity", arguments, runs=15)
    rows = Rows()
    lib = library()
    for degree in DEGREES:
        pairs = (degree + 1) * (degree + 2) // 2
        calls = max(1, 5_000_000 // pairs)
        samples = [1e9 * lib.time_harmonics(degree, calls) for _ in range(chosen.runs)]
        rows.add(f"gravity, degree {degree}", "evaluation", samples, "ns",
                 note=f"{OPERATIONS * pairs / min(samples):.1f} a ns")
    earths = {"built in": None, "IAU 2006/2000A": world.EarthOrientation(ut1_tai=-33.0)}
    steps = in_turn({name: partial(time_of_a_step, earth) for name, earth in earths.items()}, chosen.runs)
    rows.add("Earth's orientation built in", "step of RK4, J2 to J6", steps["built in"], "ns")
    rows.add("Earth's orientation IAU 2006/2000A", "step of RK4, J2 to J6", steps["IAU 2006/2000A"], "ns",
             "Earth's orientation built in")
    report(rows, chosen)


def time_of_a_step(earth, steps=20_000):
    """[ns] of processor time."""
    sim = Simulation("gravity")
    sim.world.craft = world.Spacecraft(I_B=1, sky=world.Sky("2007-11-20", world.EARTH, earth=earth),
                                       gravity=[world.EARTH.zonal(6)], orbit=Orbit(world.EARTH, altitude=400e3, i=1.0))
    sim.world.integrator = world.RK4()
    sim.world.task("dynamics", every=1, run=[sim.world.craft])
    sim.run(1)
    start = time.process_time()
    sim.run(steps)
    return 1e9 * (time.process_time() - start) / steps
