# SPDX-License-Identifier: Apache-2.0
"""A constellation: all spacecraft find their neighbours from a tumble, and keep their antennas on them."""
from fledge import scan
from fledge.units import minute, s


def link(sim):
    """Every spacecraft finds the one ahead of it and keeps its antenna on it, to a tenth of a milliradian."""
    count = len(sim.flights)
    ports = [port for number in range(count) for port in (
        sim.process(f"sat{number}_world").craft.state, sim.process(f"sat{number}_flight").tracking.error,
        sim.process(f"sat{number}_flight").guidance.status, sim.process(f"sat{number}_flight").motor.command)]
    log = sim.record(*ports, every=2 * s)

    sim.run(20 * minute)

    shown = range(min(count, 4))
    log.plot(*(f"sat{number}_flight.tracking.error.sigma_BR" for number in shown),
             titles=[f"spacecraft {number}" for number in shown], columns=2, name="constellation",
             title=f"Attitude errors of {len(shown)} of {count} spacecraft")

    late = log.time > 15 * 60
    for number in range(count):
        off = _off(log, number, (number + 1) % count)[late]
        assert off.max() < 1e-4, f"the antenna of spacecraft {number} is {off.max():.2g} rad off"
        torque = abs(log[f"sat{number}_flight.motor.command.u"][late]).max()
        assert torque < 0.01, f"the wheels of spacecraft {number} work with {torque:.2g} N m"


def _off(log, number, ahead):
    """The angle between b1 and the true way to the one ahead, at all times [rad]."""
    here, there = (log[f"sat{k}_world.craft.state.r_BN_N"] for k in (number, ahead))
    return scan.path(log, f"sat{number}_world.craft.state.sigma_BN", boresight=1).off(scan.Path(log.time, there - here))
