# SPDX-License-Identifier: Apache-2.0
"""What the nadir spin must do: `fledge verify nadir_spin`."""
from fledge.requirements import after, always, angle, implies, settles, turned
from fledge.units import N, deg, m, minute, ms, s


def pointing(r):
    """Pointing."""
    r.every = 500 * ms
    error   = r.signal("flight.tracking.error.sigma_BR").norm()
    rate    = r.signal("flight.tracking.error.omega_BR_B").norm()
    r.require("PNT-1", "The body settles on its reference within 20 minutes.",
              settles(error < 1e-3, within=20 * minute),
              rationale="The scan begins half an hour after the maneuver.", parent="SYS-1")
    r.require("PNT-2", "Once settled, the body follows its reference to 0.001 deg/s.",
              always(implies(after(20 * minute), rate < 0.001 * deg / s)),
              rationale="The instrument integrates for a second.", parent="SYS-1")

    down = turned(r.signal("world.craft.state.sigma_BN"), r.signal("world.craft.state.r_BN_N"))
    r.require("PNT-3", "Once settled, b1 points down to 0.05 deg.",
              always(implies(after(20 * minute), angle(down, [-1, 0, 0]) < 0.05 * deg)),
              rationale="The instrument looks along b1.", parent="SYS-1")


def wheels(r):
    """Wheels."""
    r.every = 500 * ms
    r.require("WHL-1", "The motors saturate in the first three minutes only.",
              always(implies(after(3 * minute), r.signal("flight.motor.command.u").max_abs() < 0.2 * N * m)),
              rationale="A saturated motor does not follow the control law.", parent="SYS-1")
    r.require("WHL-2", "The wheels have a second bearing.", method="inspection", evidence="data sheet of the wheels")
