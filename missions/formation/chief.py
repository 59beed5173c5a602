# SPDX-License-Identifier: Apache-2.0
"""The chief's two computers: guidance at 1 Hz knows the spacecraft and where to point; control at 4 Hz follows it."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, s

RADIO = 1 * s    # the deputy reads what the chief's guidance wrote an exchange ago, which is its period


def build_guidance(f):
    # The vehicle, as the chief knows it: published to the other computer.
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=0.1591549 * kg * m**2, u_max=0.2 * N * m)

    # Nadir: the Hill frame, and an attitude offset, with which b1 looks down (thesis figure 5.19).
    f.nadir    = fsw.HillPointing()
    f.offset   = fsw.EulerRotation(angles=[180, 0, 0] * deg)

    # Where the chief will be when the deputy reads it.
    f.beacon   = fsw.OrbitBeacon(lead=RADIO)

    f.connect(f.nadir.reference >> f.offset.base)
    f.task("guidance", every=RADIO, run=[f.nadir, f.offset, f.beacon])


def build_control(f, guidance):
    # Guidance is slower: its reference is carried to now.
    f.base     = fsw.BaseReference(hold=5 * s, source="COMMANDED")
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=2.531 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques()

    f.connect(
        (guidance.offset.reference >> f.base.commanded).stale_after(3 * s),
        f.base.reference           >> f.tracking.reference,
        f.tracking.error           >> f.control.error,
        f.control.torque           >> f.motor.torque,
        guidance.vehicle.vehicle   >> f.control.vehicle,
        guidance.wheels.wheels     >> [f.control.wheels, f.motor.wheels],
    )
    f.task("control", every=0.25 * s, run=[f.base, f.tracking, f.control, f.motor])
