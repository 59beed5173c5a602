# SPDX-License-Identifier: Apache-2.0
"""Inertial spinning: the maneuver of the thesis' chapter 7, figure 7.14, in closed loop."""
from fledge.units import deg, minute, s


def spin(sim):
    """From a tumble to a spin at a constant rate about an axis at rest."""
    f, w = sim.flight, sim.world
    log = sim.record(
        w.craft.state, f.guidance.reference, f.spin.reference, f.tracking.error, f.motor.command, every=1 * s)

    sim.run(40 * minute)

    log.plot(
        "spin.reference.sigma_RN", "error.sigma_BR", "command.u",
        titles=["(a) reference", "(b) attitude error", "(c) wheel torques"],
        name="inertial_spin", title="Inertial spinning (figure 7.14)")

    # The body settles on its reference, and the motors work at their limit only while it does.
    assert log.last("error.sigma_BR").norm() < 1e-4, "the attitude did not settle"
    assert log.last("error.omega_BR_B").norm() < 1e-5, "the rate did not settle"
    late = log.time > 150
    assert abs(log["command.u"][late]).max() < 0.2, "the wheels saturate after the first 150 s"

    # The body itself: its third axis rests where R0 has it, and it has turned about it at the given rate.
    off, ahead = _off(sim)
    assert off < 4e-4, "the axis of the spin is off"
    assert abs(ahead) < 4e-4, "it spins at another rate"


def _off(sim):
    """(the angle between b3 and the third axis of R0, how far b1 is ahead of 0.3 deg/s about it) now [rad]."""
    from fledge.attitude import mrp_to_dcm
    from numpy import arctan2, hypot, pi, radians

    base = mrp_to_dcm(sim.flight.guidance.sigma_RN)
    b1, _, b3 = mrp_to_dcm(sim.world.craft.state.sigma_BN) @ base.T
    ahead = arctan2(b1[1], b1[0]) - radians(0.3) * sim.time
    return arctan2(hypot(b3[0], b3[1]), b3[2]), (ahead + pi) % (2 * pi) - pi
