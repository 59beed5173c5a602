# SPDX-License-Identifier: Apache-2.0
"""How fast spherical-harmonic gravity is, per evaluation, at degree 12 (that of magnetic fields), 20, 70 and 180.

The world's `Harmonics` runs against a plain evaluation (bench/plain_harmonics.cpp: fully normalised
forward columns, factors computed in advance), in turn, in this process, with the same compiler
flags, by processor time; their results must agree. Each pair of degree and order takes 14 products and sums, of which
a processor of today makes four vectors a cycle at best: the note says how many numbers a nanosecond.
Then a step of RK4 about the Earth by zonal harmonics, with its built-in orientation and with IAU 2006/2000A.
"""
from __future__ import annotations
import ctypes
import time
from functools import partial

from fledge import Orbit, Simulation, world

from bench.rows import Rows, in_turn, median_ratio, options, report

DEGREES = [12, 20, 70, 180]
OPERATIONS = 14        # for each n, m
AGREE = 1e-12


def library():
    from fledge.disk import build_folder
    lib = ctypes.CDLL(str(build_folder() / "python" / "libfledge_bench.so"))
    lib.time_harmonics.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_long]
    lib.time_harmonics.restype = ctypes.c_double
    lib.harmonics_difference.argtypes = [ctypes.c_int]
    lib.harmonics_difference.restype = ctypes.c_double
    return lib


def main(arguments: list[str]) -> None:
    chosen = options("gravity", arguments, runs=15)
    rows = Rows()
    lib = library()
    for degree in DEGREES:
        difference = lib.harmonics_difference(degree)
        if not difference < AGREE:
            raise SystemExit(f"at degree {degree} the results differ by {difference:.3g} (relative): "
                             "the comparison is void")
        pairs = (degree + 1) * (degree + 2) // 2
        calls = max(1, 5_000_000 // pairs)

        def evaluation(which):
            return 1e9 * lib.time_harmonics(which, degree, calls)

        ours, plain = in_turn({which: partial(evaluation, which) for which in (0, 1)}, chosen.runs).values()
        rows.add(f"plain, degree {degree}", "evaluation", plain, "ns")
        rows.add(f"gravity, degree {degree}", "evaluation", ours, "ns", f"plain, degree {degree}",
                 note=f"{1 / median_ratio(ours, plain):.2f} times faster; {OPERATIONS * pairs / min(ours):.1f} a ns")
        rows.add(f"gravity, degree {degree}", "difference", difference, "relative")
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
