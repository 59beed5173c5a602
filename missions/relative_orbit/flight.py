# SPDX-License-Identifier: Apache-2.0
"""What flies on the deputy: about its chief on a relative orbit, by a camera that sees it, with eight thrusters."""
from fledge import flight as fsw
from fledge.units import N, kg, m, ms, s

# At the corners of a cube, and tilted so that they push and turn the body in every direction.
CORNERS = [[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
RCS     = dict(r_TB_B=[[0.5 * x, 0.5 * y, 0.5 * z] for x, y, z in CORNERS] * m,
               axes_B=[[x * z, x * y, y * z] for x, y, z in CORNERS])
MASS    = 50 * kg
MU      = 3.986004415e14 * m**3 / s**2


def build(f):
    f.vehicle   = fsw.VehicleConfig(I_B=[8, 8, 8] * kg * m**2)
    f.wheels    = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=2e-3 * kg * m**2, u_max=0.05 * N * m)
    f.thrusters = fsw.ThrusterConfig(**RCS, F_max=0.5 * N)

    # Attitude, by wheels; their momentum goes to the thrusters, too.
    f.guidance  = fsw.HillPointing()
    f.tracking  = fsw.TrackingError()
    f.control   = fsw.MrpFeedback(K=0.3 * N * m, P=1.2 * N * m * s)
    f.motor     = fsw.WheelTorques()
    f.dump      = fsw.MomentumDump(gain=0.01 / s, h_start=0.3 * N * m * s, h_stop=0.05 * N * m * s)

    # The chief, as the camera sees it; an ellipse of 100 m by 200 m about it, inclined by 50 m.
    f.chief     = fsw.SeenTarget(hold=10 * s)
    f.keeping   = fsw.FormationKeeping(mu=MU, mass=MASS, a=100 * m, b=50 * m, K=2e-5 / s**2, P=8e-3 / s, quiet=2 * m,
                                       force_max=0.4 * N)
    f.mapping   = fsw.ThrusterMapping()
    f.firing    = fsw.ThrusterFiring(period=1 * s, min_on=10 * ms, level_on=0.75, level_off=0.25)

    f.connect(
        # attitude
        f.guidance.reference  >> f.tracking.reference,
        f.tracking.error      >> f.control.error,
        f.control.torque      >> f.motor.torque,
        f.dump.torque         >> f.mapping.torque,

        # from the chief to the thrusters
        f.chief.body          >> f.keeping.chief,
        f.keeping.force       >> f.mapping.force,
        f.mapping.forces      >> f.firing.forces,

        # what the modules know of the vehicle
        f.vehicle.vehicle     >> f.control.vehicle,
        f.wheels.wheels       >> [f.control.wheels, f.motor.wheels, f.dump.wheels],
        f.thrusters.thrusters >> [f.mapping.thrusters, f.firing.thrusters],
    )
    f.task("attitude", every=0.5 * s, run=[f.guidance, f.tracking, f.control, f.motor, f.dump])
    f.task("orbit", every=1 * s, run=[f.chief, f.keeping, f.mapping, f.firing])
