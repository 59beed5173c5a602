# SPDX-License-Identifier: Apache-2.0
"""By radio, with the light's ten minutes each way, as a script of the ground:

    ./fledge ground run missions/mars_orbiter/contact.py --to mars_orbiter --radio world.radio --yes
"""
from math import hypot
from pathlib import Path

from fledge.ground.scripts.files import Files
from fledge.units import arcmin, hour, minute, s

from .pointing import elements
from .radio import LONGEST
from .vehicle import EPOCH

RISE = 25 * minute          # by then, what the station sends reaches the orbiter
PLAN = "plan.txt"


def turn_to_earth(craft, hold):
    """Without a report: where the orbiter is, and the mode that points the antenna."""
    craft.command("write", "flight.epoch", clock_0=EPOCH, time_0=0 * s)
    craft.command("write", "flight.orbit", **elements())
    craft.command("telemetry", "flight.tracking.error", every=4)
    hold(10 * s)            # by then the bodies are known, without which the mode is refused
    craft.command("mode", "two_body")


def run(craft, script):
    """Turn the antenna to the Earth by commands in the blind; hear telemetry; a file up and back."""
    with script.step("before the pass"):
        lost = craft.command("noop")
        script.hold(RISE)
        script.check(not lost.reports, "no answer comes")
    with script.step("in the blind"):
        turn_to_earth(craft, script.hold)
    with script.step("contact"):
        craft.wait(lambda t: 4 * hypot(*t.flight.tracking.error.sigma_BR) < arcmin.value, within=1 * hour)
        sent = craft.link.t
        craft.command("noop").completed(within=1 * hour)
        script.value("there and back [s]", (craft.link.t - sent) / 1e9)
    with script.step("files"):
        craft.files = Files(craft, rate=100, timeout=LONGEST, inactivity=4 * LONGEST)
        Path(PLAN).write_text("".join(f"{hour:02} h: point at Mars\n" for hour in range(24)))
        craft.put(PLAN, to="plan", within=2 * hour)
        craft.fetch("plan", to=f"back_{PLAN}", within=2 * hour)
        script.check(Path(f"back_{PLAN}").read_bytes() == Path(PLAN).read_bytes(), "the file came back whole")
