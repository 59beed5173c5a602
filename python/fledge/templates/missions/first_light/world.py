# SPDX-License-Identifier: Apache-2.0
"""The truth: a rigid body with three wheels in a low orbit of the Earth, perfect navigation."""
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.1 * N * m)
    w.craft  = world.Spacecraft(
        I_B=[40, 35, 30] * kg * m**2, parts=[w.wheels], gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, altitude=500 * km, i=97.4 * deg),
        sigma_BN=[0.2, -0.1, 0.1], omega_BN_B=[0.005, -0.01, 0.005] * rad / s)
    w.nav    = world.Navigation()

    # Add a model of your own here, such as that which `fledge new model Damping` begins,
    #     w.damping = world.Damping(damping=1e-4 * N * m * s)
    # wire w.craft.state >> w.damping.truth and w.damping.load >> w.craft.external, and add it to the task.
    w.connect(
        w.craft.state   >> w.nav.truth,

        # what flight sees
        w.nav.attitude  >> f.tracking.attitude,
        w.nav.orbit     >> f.guidance.orbit,
        w.wheels.speeds >> f.control.speeds,

        # what flight does
        f.motor.command >> w.wheels.command,
    )
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
