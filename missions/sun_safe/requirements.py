# SPDX-License-Identifier: Apache-2.0
"""What the safe mode must do."""
from fledge.requirements import after, always, angle, implies, turned
from fledge.units import deg, minute, s

SETTLED = after(3 * minute)


def sun(r):
    """The Sun."""
    r.every  = 1 * s
    s_B      = turned(r.signal("world.craft.state.sigma_BN"), r.signal("world.light.light.s_N"))
    rate     = r.signal("world.craft.state.omega_BN_B").norm()
    heading  = r.signal("flight.line.heading.s_B")
    quality  = r.signal("flight.line.heading.head.quality")

    r.require("SUN-1", "The panels face the Sun three minutes after the release, and from then on.",
              always(implies(SETTLED, angle(s_B, [1, 0, 0]) < 3 * deg)),
              rationale="The battery lasts for five minutes of a tumble.", shown_by="safe")
    r.require("SUN-2", "By then the body turns slowly.",
              always(implies(SETTLED, rate < 0.3 * deg / s)),
              rationale="The star trackers see stars at 0.3 deg/s and below.", shown_by="safe")
    r.require("SUN-3", "A direction to the Sun that flight says is good is no false one.",
              always(implies(quality == "GOOD", angle(heading, s_B) < 5 * deg)),
              rationale="Two lit sensors alone have two directions that fit.")
