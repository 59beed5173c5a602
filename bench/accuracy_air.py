# SPDX-License-Identifier: Apache-2.0
"""How far the laws of the Earth's upper air are from what their authors publish."""
import ctypes
from math import isnan, nan

from bench.accuracy_table import Section, Table
from bench.sim import library


class PublishedAir(ctypes.Structure):
    """A row of bench/air.cpp."""
    _fields_ = [("set", ctypes.c_char_p),
                *((name, ctypes.c_double) for name in ("km", "density", "density_found", "temperature",
                                                       "temperature_found"))]


def published():
    """The rows by the names of their sets, in the order of the tests' tables."""
    lib, sets = library(), {}
    lib.published_air.argtypes = [ctypes.c_int, ctypes.POINTER(PublishedAir)]
    index, row = 0, PublishedAir()
    while lib.published_air(index, row):
        sets.setdefault(row.set.decode(), []).append(row)
        index, row = index + 1, PublishedAir()
    return sets


def relative(found, expected):
    return nan if isnan(expected) else abs(found / expected - 1)


def side_by_side(found, expected):
    """Both with seven digits, and the relative difference."""
    return [f"{expected:#.7g}", f"{found:#.7g}", relative(found, expected)]


DENSITY = [("published", "kg/m^3"), ("Fledge", "kg/m^3"), ("difference", "relative")]
TEMPERATURE = [("published", "K"), ("Fledge", "K"), ("difference", "relative")]


def rows_of(title, rows):
    """Density, and temperature where it is published."""
    warm = not isnan(rows[0].temperature)
    table = Table(title, "case, altitude", DENSITY + warm * TEMPERATURE)
    for case, row in enumerate(rows, 1):
        table.add(f"{case}, {row.km:g} km", *side_by_side(row.density_found, row.density),
                  *(warm * side_by_side(row.temperature_found, row.temperature)))
    return table


def upper_air():
    sets = published()
    worst = Table("All published values: the largest difference", "law, values",
                  [("values", ""), ("density", "relative"), ("temperature", "relative")])
    for name, rows in sets.items():
        temperature = max(relative(row.temperature_found, row.temperature) for row in rows)
        worst.add(name, str(len(rows)), max(relative(row.density_found, row.density) for row in rows),
                  "" if isnan(temperature) else temperature)
    return Section(
        "The Earth's upper air",
        "the values that the authors of each law publish, or that their programs print: most of a difference is the "
        "print's rounding.",
        worst,
        "JB2008's rows of 2009 and 2017 have the Sun's place in 4 digits. JEOD integrates MET with weights of 7 "
        "digits, which counts up to 105 km.",
        rows_of("NRLMSISE-00: NRL's 17 test cases, density without anomalous oxygen", sets["NRLMSISE-00"]),
        rows_of("JB2008: 7 to 12 November 2004, with storms", sets["JB2008, storms"]),
        rows_of("DTM2000: CNES's test cases", sets["DTM2000, CNES"]),
        rows_of("MET: NASA's RUN_T02_MET_VER", sets["MET, 100 to 1000 km"]))
