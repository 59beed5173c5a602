# SPDX-License-Identifier: Apache-2.0
"""NASA's check cases of orbital dynamics: eight hours of a spacecraft without flight software, a case at a time."""
from . import world


def build(sim, case="RUN_2", field=str(world.GGM05C)):
    world.build(sim.add_world("world"), case, field)
