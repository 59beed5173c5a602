# SPDX-License-Identifier: Apache-2.0
"""A chief points at the planet; deputies scan about where the chief points. Each spacecraft has a world."""
from fledge import SetupError
from fledge.units import deg

from . import chief, deputy, roll, truth


def build(sim, deputies=1):
    if not isinstance(deputies, int) or not 1 <= deputies <= 8:
        raise SetupError(f"deputies: expected a whole number from 1 to 8; found {deputies!r}")
    names = ["deputy"] if deputies == 1 else [f"deputy{i + 1}" for i in range(deputies)]

    # In this order they run at equal times.
    chief_world, worlds = sim.add_world("chief_world"), [sim.add_world(f"{name}_world") for name in names]
    guidance, control = sim.add_flight("chief_guidance"), sim.add_flight("chief")
    others = [sim.add_flight(name) for name in names]
    chief.build_guidance(guidance)
    chief.build_control(control, guidance)
    truth.build(chief_world, control, guidance.wheels, f=270 * deg,
                orbits=[guidance.nadir.orbit, guidance.beacon.orbit])
    for i, (w, f) in enumerate(zip(worlds, others)):
        deputy.build(f, guidance)
        truth.build(w, f, f.wheels, f=(269.5 - 0.5 * i) * deg, orbits=[f.look.orbit])
        truth.see(w, chief_world, f)
    if deputies > 1:
        roll.build(guidance, others, worlds)
