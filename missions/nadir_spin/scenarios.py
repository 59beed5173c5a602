# SPDX-License-Identifier: Apache-2.0
"""Nadir spinning: the thesis' first maneuver, chapter 2.2.3.1, figure 2.9."""
from fledge.units import minute, s


def spin(sim):
    """b1 follows nadir through periapsis while the body turns about it."""
    f = sim.flight
    log = sim.record(
        f.guidance.reference, f.spin.euler, f.spin.reference,
        f.tracking.error, f.motor.command, every=1 * s)

    sim.run(160 * minute)

    log.plot(
        "guidance.reference.sigma_RN", "error.sigma_BR",
        "euler.angles",                "error.omega_BR_B",
        "spin.reference.sigma_RN",     "command.u",
        titles=[
            "(a) base: the Hill frame $R_0$",          "(d) attitude error",
            "(b) Euler angles of $R$ relative to $R_0$", "(e) rate error",
            "(c) reference $R$",                       "(f) wheel torques",
        ],
        columns=2, units={"euler.angles": "deg"}, name="nadir_spin", title="Nadir spinning at Mars")

    # The body settles on its reference, and the motors work at their limit only while it does.
    assert log.last("error.sigma_BR").norm() < 1e-4, "the attitude did not settle"
    assert log.last("error.omega_BR_B").norm() < 1e-5, "the rate did not settle"
    late = log.time > 150
    assert abs(log["command.u"][late]).max() < 0.2, "the wheels saturate after the first 150 s"

    # b1 points down: b1 in N follows from the attitude, nadir from the position.
    assert _off_nadir(sim) < 4e-4, "the boresight is off nadir"


def _off_nadir(sim):
    """The angle between b1 and nadir now [rad]."""
    from fledge.attitude import mrp_to_dcm
    from numpy import arctan2, cross, dot
    from numpy.linalg import norm

    state = sim.world.craft.state
    b1 = mrp_to_dcm(state.sigma_BN)[0]
    return arctan2(norm(cross(b1, -state.r_BN_N)), dot(b1, -state.r_BN_N))
