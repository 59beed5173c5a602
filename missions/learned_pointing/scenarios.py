# SPDX-License-Identifier: Apache-2.0
"""A turn of 137 degrees, from a tumble to rest."""
from fledge.units import minute, s


def turn(sim):
    """The network turns the body to its target, and stops it there."""
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, f.tracking.error, f.control.torque, f.motor.command, every=1 * s)

    sim.run(5 * minute)

    log.plot("error.sigma_BR", "craft.state.omega_BN_B", "torque.torque_B",
             titles=["(a) attitude error", "(b) angular rate", "(c) the network's torque"],
             units={"craft.state.omega_BN_B": "deg/s"}, name="turn", title="A turn by a trained network")

    assert log.last("error.sigma_BR").norm() < 0.00436, "it does not point to 1 degree"
    assert log.last("craft.state.omega_BN_B").norm() < 3.5e-4, "it still turns"
