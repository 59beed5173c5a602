# SPDX-License-Identifier: Apache-2.0
"""An orbiter of Mars that is commanded on its flight computer: sections 5.3 to 5.5 of the thesis."""
from fledge import Orbit, world
from fledge.units import day, km

from . import flight, radio
from . import world as truth
from .vehicle import SCIENCE

DATE, SPAN = "2021-02-09T18:40:00", 4 * day     # Mars rises at Goldstone 22 minutes later


def build(sim):
    # N has the axes of J2000 and its origin in Mars.
    sky = world.Sky(DATE, center=world.MARS)
    bodies = [("mars", world.MARS), ("sun", world.SUN), ("earth", world.EARTH)]
    panel, w, f = sim.add_world("panel"), sim.add_world("world"), sim.add_flight("flight")
    flight.build(f, {name: world.fit_ephemeris(sky, body, within=100 * km, duration=SPAN) for name, body in bodies})
    truth.build(w, f, panel, sky, Orbit(world.MARS, **SCIENCE))
    radio.build(w, f, sky)
