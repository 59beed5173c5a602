# SPDX-License-Identifier: Apache-2.0
"""The link to a flight process of a simulation in the same program: waiting lets the simulation run."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge.commands import Timed
from fledge.commands.fields import place_of
from fledge.errors import SetupError, listed
from fledge.ground.scripts.links import Link
from fledge.mission.process import Flight

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation


def flight_of(simulation: Simulation, name: str | None = None) -> Flight:
    """The flight process of a simulation: the only one, or that of a name. Raises SetupError."""
    flights = [process for process in simulation.processes if isinstance(process, Flight)]
    names = [flight.name for flight in flights]
    if name is None and len(names) != 1:
        raise SetupError(f"{simulation.name} has {len(names)} flight processes; choose one by its name, `process`: "
                         + listed(names))
    return flights[0] if name is None else place_of(flights, names, name, "flight process", simulation.name)[1]


def radio_of(simulation: Simulation, path: str) -> Any:
    """The model of a path, "world.radio". Raises SetupError."""
    radios = [carrier for carrier, _ in simulation.kernel.carriers]
    process, name = place_of(radios, radios, path, "radio", simulation.name)[1].split(".")
    return simulation.process(process).instances[name]


class Simulated(Link):
    """Time passes while the ground waits. Packets go straight to flight, which gets them before its next instant; or
    by a radio, a model of the world. By that the ground acts at flight's instants alone, as a node of a co-simulation
    does."""

    def __init__(self, simulation: Simulation, process: str | None = None, radio: Any = None) -> None:
        self.simulation = simulation
        self.process = flight_of(simulation, process)
        self._periods = [(task.period, task.offset) for task in self.process.tasks]
        commands = self.process.commands
        direct = (commands.send_unit, commands.take_units) if commands.dictionary.frames else (
            commands.send, commands.take_packets)
        self._by_radio = radio is not None
        radio = radio_of(simulation, radio) if isinstance(radio, str) else radio
        self._send, self._take = commands.by(radio) if self._by_radio else direct
        self._take()    # they are kept from now on

    @property
    def t(self) -> int:
        return max(int(self.simulation.time_ns), 0)

    def send(self, packet: bytes) -> None:
        self._send(packet)

    def receive(self, until: int) -> list[Timed]:
        while True:
            packets = self._take()
            if packets or self.simulation.time_ns >= until:
                return packets
            then = self._next_instant()
            self.simulation.run(until=(then if self._by_radio else min(until, then)) / 1e9, progress=False)

    def _next_instant(self) -> int:
        """[ns] of flight's next instant."""
        now = int(self.simulation.time_ns)
        return min(offset if now < offset else now + period - (now - offset) % period
                   for period, offset in self._periods)
