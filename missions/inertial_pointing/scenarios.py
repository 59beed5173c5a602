# SPDX-License-Identifier: Apache-2.0
"""From a tumble to inertial pointing: the first distributed maneuver of the thesis, figures 3.3 and 3.4."""
from fledge.units import minute, s


def detumble(sim):
    """A tumbling spacecraft comes to rest on the axes of N; the wheels take up its angular momentum."""
    f, w = sim.flight, sim.world
    log = sim.record(
        w.craft.state, w.wheels.speeds, w.nav.attitude,
        f.guidance.reference, f.tracking.error, f.motor.command, every=1 * s)

    sim.run(20 * minute)

    log.plot(
        "craft.state.sigma_BN", "craft.state.omega_BN_B", "speeds.Omega",
        titles=["(a) attitude", "(b) angular rate", "(c) wheel speeds"],
        units={"speeds.Omega": "rpm"}, name="world", title="The spacecraft (figure 3.3)")
    log.plot(
        "error.sigma_BR", "error.omega_BR_B", "command.u",
        titles=["(a) attitude error", "(b) rate error", "(c) wheel torques"],
        name="flight", title="The flight computer (figure 3.4)")

    assert log.last("error.sigma_BR").norm() < 1e-6, "the attitude did not settle"
    assert log.last("craft.state.omega_BN_B").norm() < 1e-6, "the body still turns"
    late = log.time > 80
    assert abs(log["command.u"][late]).max() < 0.2, "the wheels saturate after the first 80 s"
    assert abs(log["command.u"][-1]).max() < 1e-5, "the wheels still work, although all rests"
