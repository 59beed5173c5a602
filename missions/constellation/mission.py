# SPDX-License-Identifier: Apache-2.0
"""A ring of spacecraft, each with a world and a flight computer: twice as many processes."""
from fledge import SetupError

from . import flight, world


def build(sim, spacecraft=4):
    if not isinstance(spacecraft, int) or not 2 <= spacecraft <= 999:
        raise SetupError(f"spacecraft: expected a whole number from 2 to 999; found {spacecraft!r}")
    fleet = []
    for number in range(spacecraft):
        w = sim.add_world(f"sat{number}_world")
        f = sim.add_flight(f"sat{number}_flight")
        flight.build(f)
        world.build(w, f, number, spacecraft)
        fleet.append(f)

    # By radio each spacecraft receives the beacon of the one ahead and, if that is another one, of the one behind.
    for number, f in enumerate(fleet):
        ahead, behind = fleet[(number + 1) % spacecraft], fleet[number - 1]
        f.connect((ahead.beacon.body >> f.guidance.primary).latency(1))
        if behind is not ahead:
            f.connect((behind.beacon.body >> f.guidance.secondary).latency(1))
