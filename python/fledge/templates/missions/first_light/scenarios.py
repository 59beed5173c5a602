# SPDX-License-Identifier: Apache-2.0
"""Scenarios: each function of a simulation runs it, plots results, and checks them."""
from fledge.units import minute, s


def acquire(sim):
    """From a slow tumble onto the Hill frame."""
    f = sim.flight
    log = sim.record(f.tracking.error, f.motor.command, every=1 * s)

    sim.run(15 * minute)

    log.plot("error.sigma_BR", "error.omega_BR_B", "command.u",
             titles=["attitude error", "rate error", "wheel torques"], name="first_light")
    assert log.last("error.sigma_BR").norm() < 1e-4, "the attitude did not settle"
    assert log.last("error.omega_BR_B").norm() < 1e-5, "the rate did not settle"
