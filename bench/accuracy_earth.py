# SPDX-License-Identifier: Apache-2.0
"""How far the Earth's orientation is from ERFA's matrices, the light at the edge of its shadow from an integral, its
air from the standard, and magnetic fields from sums in 40 digits."""
from __future__ import annotations
import random
import tempfile
from math import asin, cos, sin, sqrt
from pathlib import Path

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


def still(model, place, t=0.0):
    """The model at a place, where a craft without forces stays, at the time t [s]."""
    sim = fledge.Simulation()
    w = sim.world
    w.craft = world.Spacecraft(I_B=[1, 1, 1], r_BN_N=place)
    w.model = model
    w.connect(w.craft.state >> w.model.truth)
    w.task("model", every=max(t, 1.0), run=[w.craft, w.model])
    sim.run(t)
    return w.model


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
            light = still(world.Sunlight(sun=world.SUN.at([AU, 0, 0]), shadows=[world.EARTH]), place).light
            to_sun = exact.add(exact.vector([AU, 0, 0]), exact.vector(place), -1)
            to_earth = exact.scale(-1, exact.vector(place))
            apart = mp.acos(exact.dot(to_sun, to_earth) / exact.norm(to_sun) / exact.norm(to_earth))
            expected = 1 - hidden(mp.asin(mpf(world.SUN.radius) / exact.norm(to_sun)),
                                  mp.asin(mpf(world.EARTH.radius) / exact.norm(to_earth)), apart)
            figures.append(abs(mpf(light.visible) - expected))
        table.add(name, *figures)
    return table


def air_at(altitude):
    return still(world.Atmosphere(body=world.EARTH, law="STANDARD_1976"), [world.EARTH.radius + altitude, 0.0, 0.0]).air


LAYERS = [(0, "-6.5"), (11, "0"), (20, "1"), (32, "2.8"), (47, "0"), (51, "-2.8"), (71, "-2")]    # [km], [K/km]


def lower_air(altitude):
    """The density [kg/m^3] of the standard at a geometric altitude [m] below 86 km."""
    height = mpf("6356766") * altitude / (mpf("6356766") + altitude)
    R, M, g = mpf("8314.32"), mpf("28.9644"), mpf("9.80665")
    T, p = mpf("288.15"), mpf(101325)
    for (base, gradient), (above, _) in zip(LAYERS, [*LAYERS[1:], (1000, "")]):
        dh, a = min(height, mpf(1000 * above)) - 1000 * base, mpf(gradient) / 1000
        p *= mp.exp(-g * M * dh / (R * T)) if a == 0 else (T / (T + a * dh))**(g * M / (R * a))
        T += a * dh
        if height <= 1000 * above:
            return p * M / (R * T)
    raise ValueError(altitude)


def low_air():
    table = Table("The US Standard Atmosphere 1976 to 86 km", "altitude", [("density", "relative")])
    for km in (0, 8, 15, 25, 40, 50, 60, 80, 86):
        air = air_at(1e3 * km)
        table.add(f"{km} km", abs(mpf(air.density) / lower_air(mpf(air.altitude)) - 1))
    return table


def high_air():
    table = Table("Above it: from the standard's printed table, whose density has four digits", "altitude",
                  [("density", "relative"), ("half a unit of the last digit", "relative")])
    for km, printed in ((100, 5.604e-7), (120, 2.222e-8), (200, 2.541e-10), (300, 1.916e-11), (400, 2.803e-12),
                        (500, 5.215e-13), (600, 1.137e-13), (800, 1.136e-14), (1000, 3.561e-15)):
        half = 0.0005 / float(f"{printed:.3e}".partition("e")[0])
        table.add(f"{km} km", abs(air_at(1e3 * km).density / printed - 1), half)
    return table


def magnetic():
    """Of a file with random coefficients in the form of the World Magnetic Model's, two years after its epoch."""
    drawn, main, rates = random.Random(1), {}, {}
    text = "    2025.0            RANDOM     01/01/2025\n"
    for n in range(1, 13):
        for m in range(n + 1):
            g, h, dg, dh = (round(drawn.uniform(-size, size), 1) for size in (30000 / n**2, 30000 / n**2, 20, 20))
            main[n, m], rates[n, m] = (g, h if m else 0.0), (dg, dh if m else 0.0)
            text += f"{n} {m} {g} {h if m else 0.0} {dg} {dh if m else 0.0}\n"
    a = mpf("6371200")
    # The potential of gravity with mu = a^2 is the magnetic one; Schmidt's normalization lacks the root of 2 n + 1.
    full = {(n, m): [(mpf(str(x)) + 2 * mpf(str(y))) / mp.sqrt(2 * n + 1) for x, y in zip(main[n, m], rates[n, m])]
            for n, m in main}
    sums, moment, spin, t = exact.Harmonics(a * a, a, full), [-3.6e14, 1.2e15, -7.6e15], 7.292115e-5, 3600.0
    sky = world.Sky("2027-01-01 UTC", world.EARTH)
    dcm = [exact.vector(row) for row in sky.orientation(world.EARTH).dcm_PN]
    turned = exact.times(exact.transpose(exact.rotation([mpf(0), mpf(0), -mpf(spin) * mpf(t)])), exact.vector(moment))
    table = Table("Magnetic fields, worst of 6 places", "distance from the centre",
                  [("a dipole that turns", "relative"), ("degree and order 12", "relative")])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "random.COF"
        file.write_text(text + "9" * 48 + "\n", encoding="utf-8")
        for km in (6378, 6778, 7378, 42164):
            worst = [mpf(0), mpf(0)]
            for _ in range(6):
                way = [drawn.uniform(-1, 1) for _ in range(3)]
                place = [1e3 * km * x / sqrt(sum(y * y for y in way)) for x in way]
                r = exact.vector(place)
                up, cubed = exact.scale(1 / exact.norm(r), r), exact.norm(r)**3
                dipole = exact.scale(1 / cubed, exact.add(exact.scale(3 * exact.dot(turned, up), up), turned, -1))
                r_P = exact.times(dcm, r)
                field = exact.add(sums.gravity(r_P), exact.scale(-a * a / cubed, r_P), -1)
                for i, (model, when, expected) in enumerate((
                        (world.Magnetism(body=world.EARTH, dipole_P=moment, spin=spin), t, dipole),
                        (world.Magnetism(body=world.EARTH, sky=sky, coefficients=file), 0.0,
                         exact.times(exact.transpose(dcm), exact.scale(mpf("-1e-9"), field))))):
                    found = exact.vector(still(model, place, when).field.B_N)
                    worst[i] = max(worst[i], exact.relative(found, expected))
            table.add(f"{km:,} km", *worst)
    return table


def air_and_field():
    return Section(
        "The standard atmosphere and magnetic fields",
        "the equations of the standard to 86 km, its printed table above; a dipole's closed form, and the sums of "
        "spherical harmonics of a file of random coefficients, at the beginning of 2027.",
        low_air(),
        high_air(),
        "Both integrate the same equations upwards from 86 km, in steps of their own.",
        magnetic())


def earth():
    return Section(
        "The Earth's orientation and shadow",
        "the matrices of the library ERFA, each from one call for its instant, with UT1 - TAI = -36 s; and the share "
        "of one disc on the sky that another one hides, integrated over the Sun's.",
        orientation(),
        "Fledge evaluates ERFA's series every 6 h, rounds at 6e-14 rad and interpolates: the rounding is what is left.",
        shadow(),
        "Fledge takes both discs as circles in a plane, though they are circles on a sphere.")
