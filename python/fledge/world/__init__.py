# SPDX-License-Identifier: Apache-2.0
"""The world's models by name, celestial bodies, orbits and methods of integration.

Example:

    from fledge import Orbit, Simulation, world
    from fledge.units import deg, kg, km, m

    sim = Simulation()
    w = sim.world
    w.craft = world.Spacecraft(I_B=[700, 700, 800] * kg * m**2, gravity=[world.MARS],
                               orbit=Orbit(world.MARS, a=7471.618 * km, e=0.4, f=270 * deg))
    w.integrator = world.Adaptive(relative=1e-10, absolute=1e-9)
    w.task("dynamics", every=1, run=[w.craft])
    sim.run(600)

N is an inertial frame. If a body's pole matters, N is the mean equator and equinox of J2000. With a Sky, an
ephemeris gives the positions of bodies, and N has its origin in one of them.
"""

from fledge import _core
from fledge.errors import SetupError, suggesting
from fledge.objects import project as _project
from fledge.objects.lookup import lookup
from fledge.world.attributes import add_attributes
from fledge.world.bodies import (BODIES, EARTH, EMB, JUPITER, JUPITER_SYSTEM, MARS, MERCURY, MOON, NEPTUNE,
                                 NEPTUNE_SYSTEM, PLUTO, PLUTO_SYSTEM, SATURN, SATURN_SYSTEM, SSB, SUN, URANUS,
                                 URANUS_SYSTEM, VENUS, Body)
from fledge.world.chebyshev import fit_ephemeris
from fledge.world.fmu import Fmu
from fledge.world.orbit import Orbit
from fledge.world.sky import EarthOrientation, Sky, SpaceWeather
from fledge.world.turning import fit_orientation

TYPE_CHECKING = False
if TYPE_CHECKING:  # Type checkers and editors assume that it is true. The build writes these stubs from the headers.
    from _fledge_world import *
    from _project_world import *
del TYPE_CHECKING

_own = _project.types("world")
TYPES = {**_core.library("world"), **_own}
add_attributes(TYPES, _own)


def RK4() -> _core.Integrator:
    """The classical fourth-order method of Runge and Kutta: one step per update."""
    return _core.rk4()


@suggesting(rtol="relative", atol="absolute")
def Adaptive(relative: float = 1e-10, absolute: float = 1e-12) -> _core.Integrator:
    """A method of order 8 with error control: as many steps per update as the tolerances require.

    relative, absolute: tolerances of each state, in its own unit.
    """
    for name, value in (("relative", relative), ("absolute", absolute)):
        if not isinstance(value, (int, float)) or not value > 0:
            raise SetupError(f"Adaptive: {name} must be a number > 0, found {value!r}")
    return _core.adaptive(float(relative), float(absolute))


__getattr__, __dir__ = lookup(__name__, TYPES, globals())
