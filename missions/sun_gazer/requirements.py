# SPDX-License-Identifier: Apache-2.0
"""What the telescope must do: `fledge verify sun_gazer`. Flight judges it, too: preset.py."""
from fledge.requirements import after, always, implies, settles
from fledge.units import deg, minute, ms, s

KEEPS = ["acquire", "leak"]     # no command turns it away


def sun(r):
    """The Sun."""
    r.every = 200 * ms
    off  = (4 * r.signal("flight.safe.error.sigma_BR").norm()).named("the angle to the Sun")
    rate = r.signal("flight.safe.error.omega_BR_B").norm()
    r.require("SUN-1", "The telescope shall be on the Sun within two minutes, up to 0.1 degrees, and stay there.",
              settles(off < (0.1 * deg).value, within=2 * minute),
              rationale="The field of view is as wide as the Sun and 0.1 degrees more on each side.", shown_by=KEEPS)
    r.require("SUN-2", "From then on the telescope shall turn slower than 0.02 deg/s.",
              always(implies(after(2 * minute), rate < 0.02 * deg / s)),
              rationale="An exposure lasts 50 ms, in which a picture may move by 0.001 degrees.", shown_by=KEEPS)
