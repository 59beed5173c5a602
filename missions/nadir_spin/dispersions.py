# SPDX-License-Identifier: Apache-2.0
"""What may differ from the nominal nadir spin, run by run: `fledge montecarlo nadir_spin --runs 2000`."""
from fledge.units import N, deg, kg, m, minute, s


def release(d):
    """Released at any attitude, tumbling, with mass properties that flight does not know."""
    d.duration = 10 * minute
    d.every    = 2 * s

    # how it is let go
    d["world.craft.sigma_BN"]   = d.attitude()
    d["world.craft.omega_BN_B"] = d.normal(0, 0.5 * deg / s, low=-1.5 * deg / s, high=1.5 * deg / s)

    # the body and its wheels, of which flight knows the nominal values
    d["world.craft.I_B"]        = d.nominal + d.normal(0, 10 * kg * m**2)
    d["world.wheels.J"]         = d.nominal * d.uniform(0.95, 1.05)
    d["world.wheels.axes_B"]    = d.nominal + d.normal(0, 0.5 * deg)

    # how the attitude sensor is mounted
    d["world.nav.attitude_bias"] = d.normal(0, 0.01 * deg)

    error, rate, torque = d.retain(
        "flight.tracking.error.sigma_BR",
        "flight.tracking.error.omega_BR_B",
        "flight.motor.command.u",
    )
    d.check(error.norm().final < 2e-3, "the attitude did not settle")
    d.check(rate.norm().final < 0.02 * deg / s, "the rate did not settle")
    d.check(torque.max_abs().after(5 * minute) < 0.2 * N * m, "the wheels saturate after the first five minutes")
