# SPDX-License-Identifier: Apache-2.0
"""What may differ from the nominal tumble: `fledge montecarlo sun_safe --runs 2000`, or the search for what goes wrong,
`fledge falsify sun_safe SUN-1`."""
from fledge.units import deg, kg, m, minute, s

KINDS = "NONE", "HIGH", "LOW", "BABBLE", "DROPOUT"


def tumbles(d):
    """Any attitude and tumble, on a body and with gyros that flight does not know."""
    d.duration = 5 * minute
    d.every    = 1 * s
    _released(d)


def fault(d):
    """A tumble, and a fault of one sensor of converter B, of any kind and at any time."""
    d.duration = 5 * minute
    d.every    = 1 * s
    _released(d)
    d.fault("world.adc_b", kind=d.choice(*KINDS), channels=d.choice(1, 2, 4, 8), begin=d.uniform(0 * s, 4 * minute),
            lasts=d.uniform(5 * s, 4 * minute))


def faults(d):
    """A tumble, and a fault of each converter: of one sensor, or of all."""
    d.duration = 5 * minute
    d.every    = 1 * s
    _released(d)
    for adc in ("world.adc_a", "world.adc_b"):
        d.fault(adc, kind=d.choice(*KINDS), channels=d.choice(1, 2, 4, 8, 15), begin=d.uniform(0 * s, 4 * minute),
                lasts=d.uniform(5 * s, 4 * minute))


def _released(d):
    d["world.craft.sigma_BN"]   = d.attitude()
    d["world.craft.omega_BN_B"] = d.uniform(-3 * deg / s, 3 * deg / s)
    d["world.craft.I_B"]        = d.nominal + d.normal(0, 3 * kg * m**2, low=-9 * kg * m**2, high=9 * kg * m**2)
    d["world.gyro.bias"]        = d.normal(0, 0.02 * deg / s, low=-0.06 * deg / s, high=0.06 * deg / s)
    d.require("SUN-1", "SUN-2", "SUN-3")
