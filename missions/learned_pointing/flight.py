# SPDX-License-Identifier: Apache-2.0
"""What flies: a reference at rest, tracked by a small network that train.py has trained."""
from fledge import flight as fsw
from fledge.units import N, kg, m, rad, s

from .weights import WEIGHTS


def build(f):
    # The vehicle, as flight knows it: the network does not.
    f.wheels   = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=2e-3 * kg * m**2, u_max=0.05 * N * m)

    # Guidance: the axes of N.
    f.guidance = fsw.InertialPointing(sigma_RN=[0, 0, 0])
    f.tracking = fsw.TrackingError()

    # Control: 16 neurons between six errors and three torques.
    f.control  = fsw.NeuralFeedback(
        sigma_unit=0.25, omega_unit=0.02 * rad / s, torque_max=0.08 * N * m, hidden=1, neurons=[16], activation="TANH",
        weights=WEIGHTS + [0.0] * (1379 - len(WEIGHTS)))    # there is room for more
    f.motor    = fsw.WheelTorques()

    f.connect(
        # from where to point to what the wheels do
        f.guidance.reference >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,
        f.wheels.wheels      >> f.motor.wheels,
    )
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.tracking, f.control, f.motor])
