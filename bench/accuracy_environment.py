# SPDX-License-Identifier: Apache-2.0
"""How far gravity, ephemerides and time scales are from their definitions and from other sources."""
import contextlib
import os
import random
import re
import tempfile
from datetime import datetime, timedelta
from math import sin
from pathlib import Path

from mpmath import mpf

import fledge
from fledge import Orbit, world

from bench import closed_forms as exact
from bench.accuracy_motion import DAY, HOUR, methods, spacecraft
from bench.accuracy_table import Section, Table

NOON = "2015-03-02T12:00:00 TDB"
REACH = 8_000_000_000    # [s] from J2000, which the clock of a run reaches
J2000 = datetime(2000, 1, 1, 12)


class Missing(Exception):
    """A file of real data that is not here."""


def data(name):
    """The path of a file of real data, which the repository does not hold."""
    root = Path(__file__).resolve().parents[1]
    path = Path(os.environ.get("FLEDGE_TEST_DATA", root.parent / "shared" / "data")) / name
    if not path.exists():
        raise Missing(f"{path} (FLEDGE_TEST_DATA names another folder)")
    return path


# --- gravity ---------------------------------------------------------------------------------------

def read_shadr(path):
    """(mu, radius, coefficients) of a field whose rows have commas, in metres."""
    header, *rows = ([float(x) for x in line.split(",")] for line in path.read_text().splitlines())
    return header[1], header[0], {(int(n), int(m)): (C, S) for n, m, C, S, *_ in rows if n > 0}


def gravity():
    table = Table("Acceleration at 24 points, worst", "field", [("anywhere", "relative"), ("over a pole", "relative")])
    generator = random.Random(1)

    def places(radius):
        """Up to 1.3 radii, and over the poles, a millimetre off them and less."""
        for _ in range(20):
            direction = [generator.uniform(-1, 1) for _ in range(3)]
            factor = radius * generator.uniform(1.0, 1.3) / float(exact.norm(direction))
            yield False, [factor * x for x in direction]
        for z in (1.01, -1.01):
            for off in (1e-3, 1e-6):
                yield True, [off, off / 2, z * radius]

    def worst(sim, to_P, field):
        """The largest relative errors of a spacecraft's acceleration, and over the poles."""
        largest = [0, 0]
        from_P = exact.transpose(to_P)
        for polar, r_P in places(float(field.R)):
            craft = sim.world.craft
            craft.r_BN_N = [float(x) for x in exact.times(from_P, exact.vector(r_P))]
            sim.reset()
            expected = exact.times(from_P, field.gravity(exact.times(to_P, exact.vector(craft.state.r_BN_N))))
            error = exact.relative(exact.vector(craft.state.a_BN_N), expected)
            largest[polar] = max(largest[polar], error)
        return largest

    mars = world.MARS.zonal(6, pole_N=[0, 0, 1])
    field = exact.Harmonics(mars.mu, mars.radius, {
        (n, 0): (-J / exact.mp.sqrt(2 * n + 1), 0) for n, J in enumerate(map(mpf, mars.J), 2)})
    sim = spacecraft(world.RK4(), 1.0, gravity=[mars])
    table.add("Mars, J2 to J6", *worst(sim, exact.identity(), field))
    for body, name, file in ((world.MARS, "Mars, GGM2B, degree 80", "mars-ggm2bc80.shadr.csv"),
                             (world.EARTH, "Earth, GGM03S, degree 180", "earth-ggm03s.shadr.csv")):
        sky = world.Sky(NOON, center=body)
        sim = spacecraft(world.RK4(), 1.0, gravity=[body.harmonics(data(file))], sky=sky)
        to_P = [exact.vector(row) for row in sky.orientation(body).dcm_PN]
        table.add(name, *worst(sim, to_P, exact.Harmonics(*read_shadr(data(file)))))

    jacobi = Table("GGM2B to degree 20, turning with Mars: Jacobi's integral", "method, step or tolerance",
                   [(f"after {name}", "relative") for name in ("1 h", "1 d")])
    # With a pole that stays: the true one's precession, 5e-8 rad a day, would show as 4e-9.
    with tempfile.NamedTemporaryFile("w", suffix=".tpc") as constants:
        constants.write("KPL/PCK\n\\begindata\nBODY499_POLE_RA = ( 317.68 0 )\nBODY499_POLE_DEC = ( 52.89 0 )\n"
                        "BODY499_PM = ( 176.63 350.89198226 0 )\n\\begintext\n")
        constants.flush()
        sky = world.Sky(NOON, world.MARS, pck=constants.name)
    field = exact.Harmonics(*read_shadr(data("mars-ggm2bc80.shadr.csv")), degree=20)
    orbit = Orbit(world.MARS, rp=3800e3, e=0.05, i=1.2, Omega=0.3, omega=1.0)
    for name, method, update in methods([60.0, 20.0, 10.0, 5.0], HOUR):
        sim = spacecraft(method, update, orbit=orbit, sky=sky,
                         gravity=[world.MARS.harmonics(data("mars-ggm2bc80.shadr.csv"), degree=20)])
        sim.reset()
        before = jacobi_integral(sim, sky, field)
        figures = []
        for t in (HOUR, DAY):
            sim.run(until=t)
            figures.append(abs(jacobi_integral(sim, sky, field) / before - 1))
        jacobi.add(name, *figures)
    return Section(
        "Gravity fields",
        "the definition of the potential, with Legendre functions in 60 digits; and Jacobi's integral, which a field "
        "keeps that turns at a constant rate.",
        "At 20 places up to 1.3 radii, and at four a micrometre and a millimetre off the axis over either pole.",
        table,
        "The orbit has its periapsis 400 km above Mars, e = 0.05; the pole is held still.",
        jacobi)


def jacobi_integral(sim, sky, field):
    """v^2 / 2 - U - omega . (r x v), which a field keeps that turns at a constant omega."""
    attitude = sky.orientation(world.MARS, sim.time)
    to_P = [exact.vector(row) for row in attitude.dcm_PN]
    r, v = exact.vector(sim.world.craft.state.r_BN_N), exact.vector(sim.world.craft.state.v_BN_N)
    r_P, v_P = exact.times(to_P, r), exact.times(to_P, v)
    return (exact.dot(v, v) / 2 - field.potential_at(r_P)
            - exact.dot(exact.vector(attitude.omega_PN_P), exact.cross(r_P, v_P)))


# --- all of it together --------------------------------------------------------------------------

def check_cases():
    columns = [("position", "m"), ("velocity", "m/s"), ("attitude", "rad"), ("rate", "rad/s")]
    table = Table("The end after eight hours, RK4 at 0.25 s", "case", columns)
    for case, what in (("RUN_2", "a point mass, free rotation"), ("RUN_3A", "field of 4 x 4"),
                       ("RUN_3B", "field of 8 x 8"), ("RUN_4", "Sun and Moon"),
                       ("RUN_6A", "air of constant density"), ("RUN_6B", "air by MET"),
                       ("RUN_6C", "a burn of 93 s"), ("RUN_7B", "field of 8 x 8, Sun and Moon"),
                       ("RUN_7C", "field of 4 x 4, Sun and Moon, air by MET"),
                       ("RUN_7D", "field of 8 x 8, Sun and Moon, air by MET"), ("RUN_10A", "gravity's torque")):
        sim = fledge.load("check_cases", case=case)
        sim.plots = False
        with contextlib.redirect_stdout(None):
            found = sim.scenarios["compare"]()
        table.add(f"{case}: {what}", *(found.get(name, "") for name, _ in columns))
    return Section(
        "NASA's check cases",
        "the states that NASA publishes for JEOD, its own package of orbital dynamics.",
        "The mission check_cases flies them, with the field GGM05C, the Earth's orientation by IAU 1976/1980 without "
        "polar motion, and DE405. In RUN_6A the air turns about the third axis of N, as NASA's does.",
        table,
        "What is left of the cases with a field is the apparent sidereal time: Fledge has the two terms that the IAU "
        "added to the equation of the equinoxes in 1994, 4 cm on the ground.",
        "No number in Fledge's models comes from the cases with air by MET. That air moves the end by 3 km; here it "
        "turns about the pole of date.")


# --- ephemerides -----------------------------------------------------------------------------------

def ephemerides():
    reading = Table("SPK kernels: worst of 20 instants in every segment", "kernel",
                    [("position", "m"), ("velocity", "m/s")])
    generator = random.Random(1)
    for file, epoch in (("de430-2015-03-02.bsp", NOON), ("de441-1969.bsp", "1969-07-29T00:00:00 TDB"),
                        ("jup310-excerpt.bsp", "2021-02-26T12:00:00 TDB")):
        kernel = exact.Kernel(data(file))
        worst = [0, 0]
        for segment in kernel.segments:
            sky = world.Sky(epoch, segment.center, [data(file)])
            begin = sky.epoch_at(0)
            first = max(int(segment.start_second), -REACH) + 1    # some say that they hold for ever
            last = min(int(segment.end_second), REACH) - 1
            for _ in range(20):
                t = generator.randint(first, last)
                state = sky.state(segment.target, t - begin)
                r, v = kernel.state(segment, t)
                for i, (ours, theirs) in enumerate(((state.r_PN_N, r), (state.v_PN_N, v))):
                    worst[i] = max(worst[i], exact.norm(exact.add(exact.vector(ours), theirs, -1)))
        reading.add(file, *worst)

    between = Table("DE405 against DE430, worst of 2015-03-02", "body, relative to",
                    [("position", "m"), ("velocity", "m/s")])
    kernel = exact.Kernel(data("de430-2015-03-02.bsp"))
    of = {(s.center, s.target): s for s in kernel.segments}
    sky = world.Sky(NOON, world.SSB)
    for name, target, center, plus, minus in (
            *((f"{name}, Sun", number, 10, [(0, number)], [(0, 10)]) for number, name in enumerate(
                ["Mercury", "Venus", "Earth and Moon", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto"], 1)),
            ("Moon, Earth", 301, 399, [(3, 301)], [(3, 399)]), ("Sun, solar system", 10, 0, [(0, 10)], [])):
        worst = [0, 0]
        for hour in range(-12, 13, 4):
            state = sky.state(target, hour * HOUR, center=center)
            sums = [exact.vector(x) for x in (state.r_PN_N, state.v_PN_N)]
            for sign, pairs in ((-1, plus), (1, minus)):
                for pair in pairs:
                    theirs = kernel.state(of[pair], sky.epoch_at(hour * HOUR))
                    sums = [exact.add(x, y, sign) for x, y in zip(sums, theirs)]
            worst = [max(w, exact.norm(x)) for w, x in zip(worst, sums)]
        between.add(name, *worst)
    return Section(
        "Ephemerides",
        "the kernels' Chebyshev polynomials, found in the file by jplephem and summed in 40 digits; and DE430 in place"
        " of DE405.",
        "A double of the size of Pluto's distance resolves 1 mm, and that is all of the difference in position.",
        reading,
        "The other table is what 16 more years of observations changed from DE405 to DE430. It bounds every error of "
        "reading DE405, whose format nothing else here reads.",
        between)


def planets():
    """Planets flown as spacecraft: ephemeris, third bodies and integration at once."""
    table = Table("A planet flown as a spacecraft: distance from DE405", "planet",
                  [("after 1 d", "m"), ("10 d", "m"), ("100 d", "m"), ("1 d, but for relativity", "m")])
    sky = world.Sky(NOON, world.SSB)
    for planet in (world.MERCURY, world.VENUS, world.EARTH, world.MARS, world.JUPITER, world.SATURN):
        at, sun = sky.state(planet), sky.state(world.SUN)
        sim = spacecraft(world.Adaptive(1e-13, 1e-6), HOUR, sky=sky, r_BN_N=at.r_PN_N, v_BN_N=at.v_PN_N,
                         gravity=[body for body in world.BODIES.values() if body is not planet])
        gaps = []
        for t in (DAY, 10 * DAY, 100 * DAY):
            sim.run(until=t)
            gaps.append(exact.add(exact.vector(sky.state(planet, t).r_PN_N),
                                  exact.vector(sim.world.craft.state.r_BN_N), -1))
        relativity = exact.relativity(world.SUN.mu, at.r_PN_N - sun.r_PN_N, at.v_PN_N - sun.v_PN_N)
        rest = exact.add(gaps[0], relativity, -DAY**2 / 2)
        table.add(planet.name.capitalize(), *map(exact.norm, gaps), exact.norm(rest))
    return Section(
        "Third bodies",
        "DE405, which is integrated with all that is known of the solar system.",
        "A spacecraft is put in a planet's place with its velocity, attracted by the Sun and the other planets as "
        "points (Adaptive, 1e-13, updated every hour). General relativity is missing: the last column takes off t^2 / "
        "2 times Schwarzschild's term at the start. The Earth keeps 5 cm, for the Moon feels its flattening; Saturn "
        "keeps what a double resolves at its distance, 0.2 mm.",
        table)


# --- time ------------------------------------------------------------------------------------------

def tdb_minus_tt(t):
    """[s] at t days of TT past J2000, within 10 us. Source: USNO Circular 179, Eq. (2.6)."""
    T = t / 36525
    return (0.001657 * sin(628.3076 * T + 6.2401) + 0.000022 * sin(575.3385 * T + 4.2970)
            + 0.000014 * sin(1256.6152 * T + 6.1969) + 0.000005 * sin(606.9777 * T + 4.0212)
            + 0.000005 * sin(52.9691 * T + 0.4444) + 0.000002 * sin(21.3299 * T + 5.5431)
            + 0.000010 * T * sin(628.3076 * T + 4.2490))


def time_scales():
    table = Table("Time scales", "what", [("largest difference", "s")])
    sky = world.Sky(NOON, world.SUN)
    worst = 0.0
    for day in range(-40 * 365, 60 * 365, 7):
        date = (J2000 + timedelta(day)).isoformat()
        ours = sky.time_ns_of(f"{date} TT") - sky.time_ns_of(f"{date} TDB")
        worst = max(worst, abs(1e-9 * ours - tdb_minus_tt(day)))
    table.add("TDB - TT, weekly from 1960 to 2059", worst)

    leaps = [(datetime.strptime(date, "%Y-%b-%d"), int(seconds)) for seconds, date in
             re.findall(r"(\d+),\s*@(\d+-[A-Z]+-\d+)", data("naif0011.tls").read_text())]
    generator = random.Random(1)
    instants = [date + timedelta(seconds=s) for date, _ in leaps[1:] for s in (-1, 0, 1)]
    span = (datetime(2015, 12, 31) - leaps[0][0]).total_seconds()
    instants += [leaps[0][0] + timedelta(seconds=int(span * generator.random())) for _ in range(10000)]
    worst = 0
    for utc in instants:
        offset = max((date, seconds) for date, seconds in leaps if date <= utc)[1]
        tt = utc + timedelta(seconds=offset, milliseconds=32184)
        worst = max(worst, abs(sky.time_ns_of(f"{utc.isoformat()} UTC") - sky.time_ns_of(f"{tt.isoformat()} TT")))
    table.add("TT - UTC, around every leap second and at 10,000 instants from 1972 to 2015", 1e-9 * worst)
    return Section(
        "Time scales",
        "the series of USNO Circular 179, Eq. (2.6), for TDB; Python's calendar and NAIF's table of leap seconds for "
        "UTC.",
        "TDB follows the model of SPICE, which is given as within 30 us of the theory; the series is within 10 us. All"
        " else is integer arithmetic in nanoseconds, and exact.",
        table)
