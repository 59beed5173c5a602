# SPDX-License-Identifier: Apache-2.0
"""A chief points at the planet; a deputy scans about where the chief points. Three flight computers, two worlds."""
from fledge.units import deg

from . import chief, deputy, truth


def build(sim):
    # In this order they run at equal times.
    chief_world, deputy_world = sim.add_world("chief_world"), sim.add_world("deputy_world")
    guidance, control, other = sim.add_flight("chief_guidance"), sim.add_flight("chief"), sim.add_flight("deputy")
    chief.build_guidance(guidance)
    chief.build_control(control, guidance)
    deputy.build(other, guidance)
    truth.build(chief_world, control, guidance.wheels, f=270 * deg,
                orbits=[guidance.nadir.orbit, guidance.beacon.orbit])
    truth.build(deputy_world, other, other.wheels, f=269.5 * deg, orbits=[other.look.orbit])
    truth.see(deputy_world, chief_world, other)
