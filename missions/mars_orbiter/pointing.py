# SPDX-License-Identifier: Apache-2.0
"""Test 1, section 5.4.1 of the thesis, as a script of the ground:

    ./fledge ground run missions/mars_orbiter/pointing.py --to mars_orbiter --yes
"""
from math import atan2, hypot, sin, sqrt, tan

from fledge.units import arcmin, deg, minute, s

from .vehicle import EPOCH, SCIENCE

REST = [-0.3, 0.1, 0.2]
OFF = 1 * arcmin
SETTLES = 20 * minute


def elements():
    """The parameters on board of the orbit that the orbiter is on at the start."""
    e, f = SCIENCE["e"], SCIENCE["f"].value
    E = 2 * atan2(sqrt(1 - e) * tan(f / 2), sqrt(1 + e))
    return dict(epoch=0 * s, a=SCIENCE["a"], e=e, i=SCIENCE["i"], node=SCIENCE["Omega"], periapsis=SCIENCE["omega"],
                M=(E - e * sin(E)))


def run(craft, script):
    """Lock the navigation; point inertially, at Mars, at the Sun and at Mars again."""
    def off():
        return 4 * hypot(*craft.telemetry.flight.tracking.error.sigma_BR)       # a small MRP is a quarter of the angle

    def point(mode):
        craft.command("mode", mode).completed(within=10 * s)
        script.hold(5 * s)
        craft.wait(lambda t: off() < OFF.value, within=SETTLES)
        script.hold(2 * minute)
        script.check(off() < OFF.value, "it points", off=off())

    with script.step("telemetry"):
        for output in ("flight.tracking.error", "flight.filter.attitude", "flight.line.heading",
                       "flight.time.time", "flight.protection.table"):
            craft.command("telemetry", output, every=2).completed(within=10 * s)
    with script.step("safe"):
        craft.wait(lambda t: hypot(*t.flight.line.heading.s_B[1:]) < 0.01, within=SETTLES)
    with script.step("navigation locks"):
        craft.command("arm", "blind").completed(within=10 * s)
        craft.wait(lambda t: t.flight.filter.attitude.head.quality == "QUALITY_GOOD", within=5 * minute)
    with script.step("inertial"):
        craft.command("write", "flight.rest", sigma_RN=REST).completed(within=10 * s)
        point("inertial")
    with script.step("ephemerides"):
        seen = craft.wait(lambda t: t.flight.time.time.synchronized, within=10 * s).flight.time.time
        script.value("vehicle's time", seen.time)
        craft.command("write", "flight.epoch", clock_0=EPOCH, time_0=0 * s).completed(within=10 * s)
        craft.command("write", "flight.orbit", **elements()).completed(within=10 * s)
        script.hold(1 * s)          # by then the bodies are known, without which the modes are refused
    for mode in ("mars", "sun", "mars"):
        with script.step(mode):
            point(mode)
