# SPDX-License-Identifier: Apache-2.0
"""A script of the ground: `fledge ground run missions/earth_imager/commission.py --to earth_imager`."""
from math import hypot

from fledge.units import minute, s

POINTS = 5e-4       # of MRPs, which are about a quarter of the angle


def run(craft, script):
    """Commission the wheels of the imager.

    It points with four wheels, with each three of them, and with four again.
    """
    def off():
        return hypot(*craft.telemetry.flight.tracking.error.sigma_BR)

    with script.step("telemetry"):
        for output in ("flight.tracking.error", "flight.monitor.availability"):
            craft.command("telemetry", output).completed(within=10 * s)
    with script.step("pointing"):
        craft.wait(lambda t: hypot(*t.flight.tracking.error.sigma_BR) < POINTS, within=5 * minute)
    script.confirm("go for each wheel out of use, one after the other?")
    for wheel in range(4):
        with script.step(f"without wheel {wheel + 1}"):
            craft.command("write", "flight.monitor", off=1 << wheel).completed(within=10 * s)
            craft.wait(lambda t: not t.flight.monitor.availability.available[wheel], within=10 * s)
            script.hold(30 * s)
            script.check(off() < POINTS, "it points with three wheels", off=off())
    with script.step("all wheels"):
        craft.command("write", "flight.monitor", off=0).completed(within=10 * s)
        seen = craft.wait(lambda t: all(t.flight.monitor.availability.available[:4]), within=10 * s)
        script.check(off() < POINTS, "it points with four wheels", off=off())
        script.value("available", seen.flight.monitor.availability.available[:4])
