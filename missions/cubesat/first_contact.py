# SPDX-License-Identifier: Apache-2.0
"""A script of the ground: `fledge ground run missions/cubesat/first_contact.py --to cubesat`."""
from fledge.units import hour, minute, s


def run(craft, script):
    """Meet the CubeSat after its release, check what it knows of itself, and have it look down."""
    with script.step("sun"):
        craft.command("telemetry", "housekeeping").completed(within=10 * s)
        craft.wait(lambda t: t.mode == "sun", within=4 * hour)
    with script.step("health"):
        for output in ("flight.power.state", "flight.vectors.attitude", "flight.vectors.state", "flight.orbit.orbit",
                       "flight.passes.forecast", "flight.slew.status"):
            craft.command("telemetry", output).completed(within=10 * s)
        seen = craft.telemetry.flight
        script.check(seen.power.state.battery > 0.4 * 65535, "the battery is charged", battery=seen.power.state.battery)
        script.check(seen.vectors.attitude.head.quality == "QUALITY_GOOD", "it knows its attitude")
        script.check(seen.orbit.orbit.head.quality == "QUALITY_GOOD", "it knows its orbit")
        script.value("gyro's bias", seen.vectors.state.bias_B)
        script.value("next pass", seen.passes.forecast.rise / 1e9)
    script.confirm("go for looking down?")
    with script.step("nadir"):
        craft.command("mode", "nadir").completed(within=10 * s)
        craft.wait(lambda t: t.flight.slew.status.phase == "SLEW_TRACKING", within=5 * minute)
