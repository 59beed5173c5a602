# SPDX-License-Identifier: Apache-2.0
"""What may differ from the nominal release: `fledge montecarlo cubesat --runs 1000`."""
from fledge.units import A, deg, hour, kg, m, s

from .vehicle import FIELD, GYRO


def releases(d):
    """Any attitude and tumble; a body, a dipole of its own and sensors that flight does not know."""
    d.duration = 3.5 * hour
    d.every    = 2 * s
    d["world.craft.sigma_BN"]   = d.attitude()
    d["world.craft.omega_BN_B"] = d.uniform(-6 * deg / s, 6 * deg / s)
    d["world.craft.I_B"]        = d.nominal + d.normal(0, 0.005 * kg * m**2, low=-0.01 * kg * m**2,
                                                       high=0.01 * kg * m**2)
    d["world.gyro.bias"]        = d.normal(0, GYRO["bias"], low=-3 * GYRO["bias"], high=3 * GYRO["bias"])
    d["world.tam.bias"]         = d.normal(0, FIELD["bias"] / 2, low=-1.5 * FIELD["bias"], high=1.5 * FIELD["bias"])
    d["world.own.m_max"]        = d.uniform(0.001 * A * m**2, 0.02 * A * m**2)
    d.require("REL-1", "REL-2", "REL-3", "KNO-1", "KNO-2", "KNO-3", "PNT-4")
