# SPDX-License-Identifier: Apache-2.0
"""The truth: a low orbit, an engine that pushes beside the centre of mass, a tank that empties, fuel that sloshes."""
from fledge import Orbit, world
from fledge.units import N, kg, m, ms, rad, s

LOW, HIGH = 7000e3, 7100e3      # [m] the radii of the orbits
DRY, FUEL, SLOSH = 300, 40, 10  # [kg] the hub, what the engine burns, what sloshes
THRUST, ISP = 100, 220          # [N], [s]


def build(w, f):
    w.engine = world.Thrusters(
        r_TB_B=[[0, 0, -0.7]] * m, axes_B=[[0, 0, 1]], F=THRUST * N, isp=ISP * s, rise=50 * ms, fall=50 * ms,
        r_KB_B=[[0, 0, -0.2]] * m, propellant=[FUEL] * kg, radius=[0.25] * m)
    w.rcs    = world.Thrusters(r_TB_B=f.thrusters.r_TB_B, axes_B=f.thrusters.axes_B, F=5 * N, rise=5 * ms, fall=5 * ms)

    # Of what sloshes: a period of 7 s, damped to 1/e in a minute.
    w.slosh  = world.FuelSlosh(mass=[SLOSH / 2] * 2 * kg, r_B=[[0, 0, -0.1]] * 2 * m, axes_B=[[1, 0, 0], [0, 1, 0]],
                               stiffness=[4] * 2 * N / m, damping=[0.15] * 2 * N * s / m)

    # The centre of mass is a centimetre beside the engine's line.
    w.craft  = world.Spacecraft(
        mass=DRY * kg, center_B=[0.01, 0.005, 0] * m, I_B=[150, 145, 115] * kg * m**2,
        parts=[w.engine, w.rcs, w.slosh], gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, a=LOW * m, e=0),
        sigma_BN=[0.2, -0.1, 0.3], omega_BN_B=[0.002, -0.001, 0.003] * rad / s)

    w.nav    = world.Navigation()
    w.acc    = world.Accelerometer(noise=[(1e-3 * m / s**2)**2 * s] * 3, r_AB_B=[0.1, 0, 0.2] * m)

    w.connect(
        w.craft.state    >> [w.nav.truth, w.acc.truth],

        # what flight sees
        w.nav.attitude   >> [f.tracking.attitude, f.sum.attitude],
        w.acc.force      >> f.sum.force,

        # what flight does
        f.burn.engines   >> w.engine.times,
        f.firing.times   >> w.rcs.times,
    )
    w.integrator = world.RK4()
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav, w.acc])
