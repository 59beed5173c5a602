# SPDX-License-Identifier: Apache-2.0
"""Where turns begin: `fledge montecarlo learned_pointing --runs 1000`. The network was trained on such turns, too."""
from fledge.units import deg, minute, s


def turns(d):
    """Any attitude, up to 1 deg/s about each axis."""
    d.duration = 5 * minute
    d.every    = 1 * s
    _begins(d)
    d.require("PNT-1", "PNT-2")


def bodies(d):
    """The same on bodies that the training has not seen: to 15 % lighter or heavier about each axis."""
    d.duration = 5 * minute
    d.every    = 1 * s
    _begins(d)
    d["world.craft.I_B"] = d.nominal * d.uniform(0.85, 1.15)
    d.require("PNT-1", "PNT-2")


def _begins(d):
    d["world.craft.sigma_BN"]   = d.attitude()
    d["world.craft.omega_BN_B"] = d.uniform(-1 * deg / s, 1 * deg / s)
