# SPDX-License-Identifier: Apache-2.0
"""Which units of the fault protection are which of the world, where they have no load of their own:
`fledge faults mars_orbiter`."""
from .vehicle import PLACE


def matrix(m):
    """The units by their places in flight's table; faults of a single wheel too."""
    wheels = sum(1 << PLACE[f"wheel {k}"] for k in range(1, 5))
    arrays = sum(1 << PLACE[f"array {k}"] for k in (1, 2))
    m.isolates("flight.protection.table.faulted", {
        "world.adc_a": 1 << PLACE["converter a"], "world.adc_b": 1 << PLACE["converter b"],
        "world.wheels": wheels, "world.driver": wheels, "world.drive": arrays})
    m.nominal("FDP-2", "FDP-4", "FDP-5")
    m.detects("flight.protection.table.wrong", "flight.pyramids.status.unresolved")
    for kind in ("HIGH", "LOW", "BABBLE", "DROPOUT", "DEAD"):
        size = {} if kind in ("DROPOUT", "DEAD") else {"size": 0.2}
        m.fault("world.wheels", kind, channels=0b0001, **size)
        m.fault("world.wheels", kind, channels=0b1111, **size)
