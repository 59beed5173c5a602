# SPDX-License-Identifier: Apache-2.0
"""How flight says that a unit is wrong: `fledge faults sun_safe`."""
from fledge.units import deg, mA, minute, s


def matrix(m):
    """In the Sun, before the planned fault of a converter, and in the shadow."""
    m.begin = [5 * minute, 60 * minute]
    m.fault("world.gyro", "HIGH", size=5 * deg / s)
    m.fault("world.gyro", "BIAS", size=0.5 * deg / s, channels=0b010)
    m.fault("world.css", "BIAS", size=0.5 * mA)
    m.isolates("flight.sun.status.faulty", {"world.adc_a": 0b01, "world.adc_b": 0b10})
    m.detects("flight.tumble.state.tripped", "flight.sun.status.unresolved")
