# SPDX-License-Identifier: Apache-2.0
"""The rules of the fault protection, the monitors and the reports of housekeeping: data, of which the ground can change
each by command."""
from fledge import flight as fsw

from .vehicle import PLACE

S = 10**9       # [ns]
STOP = 15       # the list that lets the commands of list 0 rest, after a burn that was aborted


def preset(sim):
    c, p = sim.flight.commands, sim.flight.commands.packets
    rules = []

    def rule(number, unit=None, **what):
        rules.append(p.rule(len(rules), number, unit=None if unit is None else PLACE[unit],
                            becomes="" if unit is None else "faulted", **what))

    # What is silent gives way to its pair. A star tracker may be blind for a while: fast turns, the Sun, Mars.
    for k, name in enumerate("ab"):
        rule(f"flight.stars.choice.age[{k}]", f"stars {name}", high=10, hold=1800 * S)
        rule(f"flight.gyro.choice.age[{k}]", f"gyro {name}", high=3, hold=3 * S)

    # What modules have found out.
    for k, name in enumerate("ab"):
        rule("flight.pyramids.status.faulty", f"converter {name}", bits=1 << k)
    for wheel in range(4):
        rule(f"flight.monitor.availability.available[{wheel}]", f"wheel {wheel + 1}", equals=1)
    rule("flight.pulses.health.silent", "propulsion a", equals=0, hold=5 * S)
    rule("flight.engines.health.silent", "propulsion b", equals=0, hold=5 * S)

    # A safe mode that does not come to the Sun may believe a wrong gyro, which nothing else shows: try the other one.
    rule("flight.sun_safe.error.sigma_BR", "gyro a", measure="norm", high=0.05, hold=900 * S, limit=1)

    # A thruster that is stuck open: the card's load has the latch valve, too.
    rule("flight.pulses.health.stuck_open", "propulsion a", equals=0)
    rule("flight.engines.health.stuck_open", "propulsion b", equals=0)

    # What ends in the safe mode: it stands last, so that it has the last word.
    rule("flight.burn.state.phase", high=fsw.BurnPhase.COMPLETE + 0.5, mode="safe", starts=STOP)
    rule("flight.tracking.error.sigma_BR", measure="norm", high=0.05, hold=1800 * S, mode="safe")
    rule("flight.differ.state.tripped", equals=0, hold=300 * S, mode="safe")
    rule("flight.protection.table.lost", equals=0, mode="safe", limit=1)

    c.preset(
        *rules,
        *(p.monitor(k, f"flight.speeds.speeds.Omega[{k}]", low=-400, high=400, hold=10 * S) for k in range(4)),
        p.monitor(4, "flight.time.time.synchronized", equals=1, hold=30 * S),
        p.monitor(5, "flight.tracking.error.head.quality", equals=fsw.Quality.GOOD, hold=60 * S),
        p.housekeeping(0, ["flight.filter.attitude.sigma_BN", "flight.filter.attitude.omega_BN_B",
                           "flight.speeds.speeds.Omega", "flight.power.state.on"], every=10 * S),
        p.housekeeping(1, ["flight.protection.table.used", "flight.protection.table.faulted",
                           "flight.protection.table.lost", "flight.pyramids.status.faulty",
                           "flight.differ.state.trips"], every=10 * S))
