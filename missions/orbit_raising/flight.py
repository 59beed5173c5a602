# SPDX-License-Identifier: Apache-2.0
"""What flies: two burns of one engine, by accelerometers; eight thrusters hold the attitude."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, ms, rad, s

# Eight thrusters at the corners of a box, tilted so that they turn the body about every axis in both directions.
CORNERS = [[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
RCS     = dict(r_TB_B=[[0.4 * x, 0.5 * y, 0.6 * z] for x, y, z in CORNERS],
               axes_B=[[0.6 * y * z, 0, 0.8 * x * z] for x, y, z in CORNERS])


def build(f):
    # The vehicle, as flight knows it: with half of its propellant.
    f.vehicle   = fsw.VehicleConfig(I_B=[160, 150, 120] * kg * m**2)
    f.thrusters = fsw.ThrusterConfig(**RCS, F_max=5 * N)

    # Guidance: the burns that the ground has planned, Hohmann's transfer (orbit_raising_test.py computes it), and r1
    # along their thrust. Of the control frame Bc, the first axis is the engine's, b3.
    f.plan      = fsw.BurnPlan(start=[1200, 4145.7037] * s,
                               dv_N=[[-25.692161, 7.309712, 0], [25.610192, -7.252201, 0]] * m / s,
                               rate_N=[[0, 0, 1.0780076e-3], [0, 0, 1.0553132e-3]] * rad / s)
    f.pointing  = fsw.BurnPointing()
    f.tracking  = fsw.TrackingError(sigma_BcB=[-1 / 3, -1 / 3, -1 / 3])

    # The burn: what accelerometers add up, and the engine's cut-off.
    f.sum       = fsw.DeltaVAccumulation()
    f.burn      = fsw.BurnExecution(engines_used=0b1, longest=300 * s, error_max=5 * deg, wait=60 * s,
                                    a_min=0.05 * m / s**2, settle=5 * s, hold=2 * s)

    # Attitude by thrusters.
    f.control   = fsw.MrpFeedback(K=100 * N * m, P=110 * N * m * s, K_I=5 * N * m / s, u_I_max=2 * N * m)
    f.mapping   = fsw.ThrusterMapping()
    f.firing    = fsw.ThrusterFiring(period=250 * ms, min_on=20 * ms, level_on=0.75, level_off=0.25)

    f.connect(
        # from the plan to the attitude
        f.plan.command         >> [f.pointing.command, f.burn.command],
        f.pointing.reference   >> f.tracking.reference,
        f.tracking.error       >> [f.control.error, f.burn.error],
        f.control.torque       >> f.mapping.torque,
        f.mapping.forces       >> f.firing.forces,

        # the burn
        f.sum.sum              >> f.burn.sum,
        f.burn.state           >> f.plan.state,

        # what the modules know of the vehicle
        f.vehicle.vehicle      >> f.control.vehicle,
        f.thrusters.thrusters  >> [f.mapping.thrusters, f.firing.thrusters],
    )
    f.task("burns", every=100 * ms, run=[f.plan, f.sum, f.burn])
    f.task("attitude", every=250 * ms, run=[f.pointing, f.tracking, f.control, f.mapping, f.firing])
