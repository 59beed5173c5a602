# SPDX-License-Identifier: Apache-2.0
"""What flies: nadir pointing by wheels, whose momentum magnetic rods take out all the time, and thrusters where it is
too much for them."""
from fledge import flight as fsw
from fledge.units import A, N, T, kg, m, ms, s

CORNERS = [[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
RCS     = dict(r_TB_B=[[0.4 * x, 0.5 * y, 0.6 * z] for x, y, z in CORNERS] * m,
               axes_B=[[0.6 * y * z, 0, 0.8 * x * z] for x, y, z in CORNERS])
RODS    = dict(axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], m_max=120 * A * m**2)


def build(f):
    # The vehicle, as flight knows it.
    f.vehicle   = fsw.VehicleConfig(I_B=[90, 80, 60] * kg * m**2)
    f.wheels    = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.05 * kg * m**2, u_max=0.2 * N * m)
    f.rods      = fsw.RodConfig(**RODS)
    f.thrusters = fsw.ThrusterConfig(**RCS, F_max=1 * N)

    # Attitude: the Hill frame. What the rods give is known to the control; pulses of thrusters are disturbances.
    f.guidance  = fsw.HillPointing()
    f.tracking  = fsw.TrackingError()
    f.control   = fsw.MrpFeedback(K=20 * N * m, P=34 * N * m * s)
    f.motor     = fsw.WheelTorques()

    # Desaturation: rods at any momentum, thrusters from 8 N m s down to 1.
    f.surplus   = fsw.MomentumDump(gain=2e-3 / s)
    f.magnetic  = fsw.RodTorques(field_min=1e-6 * T)
    f.excess    = fsw.MomentumDump(gain=0.05 / s, torque_max=0.05 * N * m, h_start=8 * N * m * s, h_stop=1 * N * m * s)
    f.mapping   = fsw.ThrusterMapping()
    f.firing    = fsw.ThrusterFiring(period=500 * ms, min_on=10 * ms, level_on=0.75, level_off=0.25)

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference  >> f.tracking.reference,
        f.tracking.error      >> f.control.error,
        f.control.torque      >> f.motor.torque,

        # from the wheels' momentum to rods and thrusters
        f.surplus.torque      >> f.magnetic.torque,
        f.magnetic.achieved   >> f.control.external,
        f.excess.torque       >> f.mapping.torque,
        f.mapping.forces      >> f.firing.forces,

        # what the modules know of the vehicle
        f.vehicle.vehicle     >> f.control.vehicle,
        f.wheels.wheels       >> [f.control.wheels, f.motor.wheels, f.surplus.wheels, f.excess.wheels],
        f.rods.rods           >> f.magnetic.rods,
        f.thrusters.thrusters >> [f.mapping.thrusters, f.firing.thrusters],
    )
    f.task("gnc", every=500 * ms, run=[f.guidance, f.tracking, f.surplus, f.magnetic, f.excess, f.mapping, f.firing,
                                       f.control, f.motor])
