# SPDX-License-Identifier: Apache-2.0
"""docs/accuracy.md is what the bench writes now: its frame, and the sections that are quick to measure."""
import math
import os
import re
import subprocess
from pathlib import Path

import numpy
import pytest

from tests.needs import module

module("mpmath")

from bench import (accuracy, accuracy_air, accuracy_earth, accuracy_flight, accuracy_motion, accuracy_parts,
                   accuracy_surroundings)
from bench import closed_forms as exact
from bench.accuracy_table import Table, two_digits

TREE = Path(__file__).resolve().parents[1]
WRITTEN = accuracy.DOCUMENT.read_text(encoding="utf-8")


@pytest.mark.parametrize("measure", [accuracy_motion.rotation, accuracy_motion.wheels, accuracy_parts.moving,
                                     accuracy_parts.actuators, accuracy_surroundings.surroundings,
                                     accuracy_earth.air_and_field])
def test_what_is_written_is_what_is_measured(measure):
    section, written = accuracy.wrap(measure().markdown()), WRITTEN
    if not numpy.__version__.startswith("1.24."):   # of Debian 12: others round their own functions otherwise
        section, written = (re.sub(r"\b\d\.\de-1[5-9]", "rounding", text) for text in (section, written))
    assert section in written, "the models have changed: run ./fledge bench accuracy, and look at what it changes"


@pytest.mark.long("compiles what the bench measures in C++")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="benches measure the release build")
@pytest.mark.parametrize("measure", [accuracy_air.upper_air, accuracy_flight.elementary])
def test_what_is_written_is_what_is_measured_in_cpp(measure):
    subprocess.run(["ninja", "-C", TREE / "build/release", "fledge_bench"], check=True, stdout=subprocess.DEVNULL)
    assert accuracy.wrap(measure().markdown()) in WRITTEN, "run ./fledge bench accuracy, and look at what it changes"


def test_every_section_is_written():
    assert WRITTEN.startswith(accuracy.document([]))
    assert WRITTEN.count("\n## ") == WRITTEN.count("\n*Held against:* ") == len(accuracy.SECTIONS)


def test_figures_have_two_digits():
    numbers = [1.24e-9, 0.00123, 0.0123, 0.999, 1.0, 12.34, 987.0, 9990.0, 99900.0, -3.46, 0.0]
    assert list(map(two_digits, numbers)) == ["1.2e-9", "0.0012", "0.012", "1.0", "1.0", "12", "990", "1.0e4", "1.0e5",
                                              "-3.5", "0"]
    table = Table("a title", "step", [("error", "m"), ("state", "")])
    table.add("1 s", 0.5, "fine")
    assert table.markdown() == ("**a title**\n\n| step | error [m] | state |\n| ---- | --------: | ----: |\n"
                                "| 1 s  |      0.50 |  fine |")


# --- the closed forms solve their equations: by differences over 1e-12 s, in 40 digits -------------

H = exact.mpf(10)**-12


def slope(function, t):
    return exact.scale(1 / (2 * H), exact.add(function(t + H), function(t - H), -1))


@pytest.mark.parametrize("e", [0.0, 0.4, 0.99, 1.5])
def test_kepler_falls_towards_the_mass(e):
    mu, rp = 4e14, 7e6
    start = [rp, 0.0, 0.0], [0.0, 0.6 * math.sqrt(mu * (1 + e) / rp), 0.8 * math.sqrt(mu * (1 + e) / rp)]
    for t in (500, 3000, 10**6):
        r, v = exact.kepler(mu, *start, t)
        assert exact.relative(slope(lambda s: exact.kepler(mu, *start, s)[0], t), v) < 1e-18
        fall = exact.scale(-mu / exact.norm(r)**3, r)
        assert exact.relative(slope(lambda s: exact.kepler(mu, *start, s)[1], t), fall) < 1e-15


def test_a_jet_takes_the_angular_momentum_of_its_nozzle_along():
    # d(I omega)/dt = -flow distance^2 omega
    distance, flow, fuel, radius = exact.mpf(2), exact.mpf(3), exact.mpf(50), exact.mpf("0.3")

    def momentum(t):
        left = fuel - flow * t
        inertia = 800 + exact.mpf(2) / 5 * left * (radius * (left / fuel)**(exact.mpf(1) / 3))**2
        return inertia * exact.jet_damping(800, distance, flow, fuel, radius, t)

    for t in (1, 10):
        change = (momentum(t + H) - momentum(t - H)) / (2 * H)
        rate = exact.jet_damping(800, distance, flow, fuel, radius, t)
        assert abs(change / (-flow * distance**2 * rate) - 1) < 1e-15


def euler(inertia, omega):
    """omega' of a free body with principal moments."""
    return [(inertia[i - 2] - inertia[i - 1]) * omega[i - 2] * omega[i - 1] / inertia[i] for i in range(3)]


def test_the_tumbler_obeys_eulers_equations():
    tumbler = exact.Tumbler([500, 700, 900], [0.08, 0.0, 0.06])
    assert exact.relative(tumbler.omega_B(0), exact.vector([0.08, 0.0, 0.06])) < 1e-38
    for t in (1, 20, 50):
        assert exact.relative(slope(tumbler.omega_B, t), euler([500, 700, 900], tumbler.omega_B(t))) < 1e-18


def test_the_top_turns_as_eulers_equations_say():
    top = exact.SymmetricTop(700, 900, [0.3, -0.2, 0.5], [0.06, -0.03, 0.09])

    def rate(t):  # dcm' = -tilde(omega) dcm
        ahead, behind = top.dcm_BN(t + H), top.dcm_BN(t - H)
        tilde = exact.product([exact.scale(1 / (2 * H), exact.add(b, a, -1)) for a, b in zip(ahead, behind)],
                              exact.transpose(top.dcm_BN(t)))
        return [tilde[2][1], tilde[0][2], tilde[1][0]]

    assert exact.relative(rate(exact.mpf(0)), exact.vector([0.06, -0.03, 0.09])) < 1e-18
    assert exact.angle_between(top.dcm_BN(0), exact.dcm(exact.vector([0.3, -0.2, 0.5]))) < 1e-30
    h = exact.mpf(10)**-5
    change = exact.scale(1 / (2 * h), exact.add(rate(5 + h), rate(5 - h), -1))
    assert exact.relative(change, euler([700, 700, 900], rate(exact.mpf(5)))) < 1e-9


def test_harmonics_are_those_of_a_known_field():
    # Degree 2, order 0, 1 and 2 in Cartesian coordinates.
    C20, C21, S22 = -5e-4, 2e-5, 3e-5
    field = exact.Harmonics(4e14, 6.4e6, {(2, 0): (C20, 0.0), (2, 1): (C21, 0.0), (2, 2): (0.0, S22)})
    x, y, z = exact.vector([5e6, -3e6, 4e6])
    r = exact.norm([x, y, z])
    root = exact.mp.sqrt
    sum_of_terms = (C20 * root(5) * (3 * z * z / r**2 - 1) / 2 + C21 * root(15) * x * z / r**2
                    + S22 * root(15) / 2 * 2 * x * y / r**2)
    expected = 4e14 / r * (1 + (exact.mpf(6.4e6) / r)**2 * sum_of_terms)
    assert abs(field.potential_at([x, y, z]) / expected - 1) < 1e-35
    ahead, behind = (field.potential_at([x + h, y, z]) for h in (exact.mpf("1e-9"), exact.mpf("-1e-9")))
    assert abs(field.gravity([x, y, z])[0] / ((ahead - behind) / exact.mpf("2e-9")) - 1) < 1e-15
