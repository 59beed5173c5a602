# SPDX-License-Identifier: Apache-2.0
"""How far the Earth's orientation is from ERFA's matrices, and the light at the edge of its shadow from an integral."""
from __future__ import annotations
from math import asin, cos, sin

from mpmath import mp, mpf

import fledge
from fledge import world

from bench import closed_forms as exact
from bench.accuracy_table import Section, Table

UT1_TAI, POLE = -36.0, (0.6e-6, 2.1e-6)
AU = 149597870700.0
RADIUS = 6778e3


def orientation():
    import erfa  # of Debian's python3-erfa
    import numpy as np

    table = Table("[PN] of the Earth, worst of 14 instants of a month, at 6778 km", "year",
                  [("IAU 2006/2000A", "m"), ("IAU 1976/1980", "m"), ("between the two", "m")])
    for year in (1975, 1990, 2005, 2020, 2035):
        worst = [0.0, 0.0, 0.0]
        for day in range(1, 29, 2):
            hour, found = day * 5 % 24, []
            tt = erfa.dtf2d("TT", year, 3, day, hour, 17, 0.0)
            tai = erfa.tttai(*tt)
            ut1 = erfa.taiut1(*tai, UT1_TAI)
            equinox = erfa.rz(erfa.gmst82(*ut1) + erfa.eqeq94(*tt), erfa.pnm80(*tt))
            for i, (theory, expected) in enumerate((
                    ("IAU 2006/2000A", erfa.c2t06a(*tt, *ut1, *POLE)),
                    ("IAU 1976/1980", erfa.pom00(*POLE, 0.0) @ equinox))):
                sky = world.Sky(f"{year}-03-{day:02}T{hour:02}:17:00 TT", world.EARTH, earth=world.EarthOrientation(
                    theory=theory, ut1_tai=UT1_TAI, polar_motion=POLE))
                found.append(sky.orientation(world.EARTH).dcm_PN)
                worst[i] = max(worst[i], RADIUS * np.linalg.norm(found[i] - expected, 2))
            worst[2] = max(worst[2], RADIUS * np.linalg.norm(found[0] - found[1], 2))
        table.add(str(year), *worst)
    return table


def hidden(sun, body, apart):
    """The share of a disc of constant brightness that another one hides: two caps of a sphere, of these radii."""
    def arc(rho):
        c = (mp.cos(body) - mp.cos(rho) * mp.cos(apart)) / (mp.sin(rho) * mp.sin(apart))
        return 2 * mp.acos(max(-1, min(1, c))) * mp.sin(rho)

    edges = sorted({mpf(0), sun, *(x for x in (abs(apart - body), apart + body) if 0 < x < sun)})
    return mp.quad(arc, edges) / (2 * mp.pi * (1 - mp.cos(sun)))


def shadow():
    table = Table("Light behind the Earth: the visible share of the Sun's disc", "distance from the centre",
                  [(f"at {share} of the penumbra", "share") for share in ("0.1", "0.5", "0.9")])
    for name, r in (("6778 km", 6778e3), ("42,164 km", 42164e3), ("384,400 km", 3.844e8), ("2,000,000 km", 2e9)):
        figures = []
        for share in (0.1, 0.5, 0.9):
            # Where the discs are this far apart: the Sun stands at x = 1 AU, the angle is that from -x.
            sun, body = asin(world.SUN.radius / AU), asin(world.EARTH.radius / r)
            angle = abs(sun - body) + share * (sun + body - abs(sun - body))
            place = [-r * cos(angle), r * sin(angle), 0.0]
            sim = fledge.Simulation()
            w = sim.world
            w.craft = world.Spacecraft(I_B=[1, 1, 1], r_BN_N=place)
            w.light = world.Sunlight(sun=world.SUN.at([AU, 0, 0]), shadows=[world.EARTH])
            w.connect(w.craft.state >> w.light.truth)
            w.task("light", every=1, run=[w.craft, w.light])
            sim.run(0)
            to_sun = exact.add(exact.vector([AU, 0, 0]), exact.vector(place), -1)
            to_earth = exact.scale(-1, exact.vector(place))
            apart = mp.acos(exact.dot(to_sun, to_earth) / exact.norm(to_sun) / exact.norm(to_earth))
            expected = 1 - hidden(mp.asin(mpf(world.SUN.radius) / exact.norm(to_sun)),
                                  mp.asin(mpf(world.EARTH.radius) / exact.norm(to_earth)), apart)
            figures.append(abs(mpf(w.light.light.visible) - expected))
        table.add(name, *figures)
    return table


def earth():
    return Section(
        "The Earth's orientation and shadow",
        "the matrices of the library ERFA, each from one call for its instant (c2t06a; and pnm80, gmst82, eqeq94 and "
        "pom00), with UT1 - TAI = -36 s; and the share of one disc on the sky that another one hides, integrated over "
        "the Sun's with 40 digits.",
        orientation(),
        "Fledge evaluates ERFA's series every 6 h, rounds at 6e-14 rad and interpolates: the rounding is what is left.",
        shadow(),
        "Fledge takes both discs as circles in a plane, though they are circles on a sphere. The edges of the shadow "
        "are exact all the same.")
