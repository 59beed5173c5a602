# SPDX-License-Identifier: Apache-2.0
"""The link to a flight process of a simulation in the same program: waiting lets the simulation run."""
from __future__ import annotations

from typing import Any

from fledge.commands import Timed
from fledge.errors import SetupError
from fledge.ground.links import Link
from fledge.mission.process import Flight


class Simulated(Link):
    """Packets go straight to flight, which gets them before its next instant; time passes while the ground waits."""

    def __init__(self, simulation: Any, process: Flight | None = None) -> None:
        flights = [one for one in simulation.processes if isinstance(one, Flight)]
        if process is None and len(flights) != 1:
            raise SetupError(f"{simulation.name} has {len(flights)} flight processes: name one, as in "
                             "connect(simulation, process=simulation.flight)")
        self.simulation = simulation
        self.process = process or flights[0]
        self._periods = [(task.period, task.offset) for task in self.process.tasks]
        self.process.commands.take_packets()    # they are kept from now on

    @property
    def t(self) -> int:
        return max(int(self.simulation.time_ns), 0)

    def send(self, packet: bytes) -> None:
        self.process.commands.send(packet)

    def receive(self, until: int) -> list[Timed]:
        while True:
            found = self.process.commands.take_packets()
            if found or self.simulation.time_ns >= until:
                return found
            self.simulation.run(until=min(until, self._next_instant()) / 1e9, progress=False)

    def _next_instant(self) -> int:
        """[ns] of flight's next instant."""
        now = int(self.simulation.time_ns)
        return min(offset if now < offset else now + period - (now - offset) % period
                   for period, offset in self._periods)
