# SPDX-License-Identifier: Apache-2.0
"""What the trained controller must do: `fledge verify learned_pointing`."""
from fledge.requirements import after, always, implies
from fledge.units import deg, minute, s


def pointing(r):
    """Pointing."""
    r.every = 1 * s
    error   = r.signal("flight.tracking.error.sigma_BR").norm()
    rate    = r.signal("world.craft.state.omega_BN_B").norm()
    r.require("PNT-1", "After two minutes the body points to 1 degree.",
              always(implies(after(2 * minute), error < 0.00436)),
              rationale="The camera sees 3 degrees; an MRP of 0.00436 is 1 degree.")
    r.require("PNT-2", "After two minutes it turns by less than 0.02 deg/s.",
              always(implies(after(2 * minute), rate < 0.02 * deg / s)), rationale="A picture is exposed for 0.1 s.")
