# SPDX-License-Identifier: Apache-2.0
"""The mission of Fledge that a spacecraft flies: its simulation, its dictionary of commands, and its database."""
from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.commands import Dictionary
from fledge.commands.fields import place_of
from fledge.disk import write_files

if TYPE_CHECKING:
    from fledge.ground.server.settings import CraftSettings
    from fledge.mission.simulation import Simulation

PICTURES = ("picture.webp", "picture.png", "picture.jpg")     # in a mission's folder


@dataclass(frozen=True)
class LoadedMission:
    """A loaded mission; its simulation is set up by the scenario of the settings."""

    simulation: Simulation
    process: str                #: of flight, to which the link leads
    dictionary: Dictionary
    folder: Path | None
    files: list[Path]           #: of Python, of which the mission is
    picture: Path | None
    epoch_ns: int | None        #: [ns] UTC at the time 0 of the simulation, if its world has a sky

    @classmethod
    def load(cls, settings: CraftSettings) -> LoadedMission:
        """Raises SetupError."""
        from fledge.ground.scripts.simulated import flight_of
        from fledge.mission import load
        from fledge.mission.scenario import chosen, set_up

        sim = load(settings.mission)
        if settings.scenario:
            set_up(sim, chosen(sim, settings.scenario)[1])
        process = flight_of(sim, settings.process)
        if settings.radio:
            models = list(sim.world.instances)
            place_of(models, models, settings.radio, "radio", f"{settings.name}: the world of {sim.name}")
        folder = Path(sim.mission.folder) if sim.mission else None
        own = [module for name, module in sys.modules.copy().items() if name.startswith(f"_mission_{sim.name}_")]
        files = sorted({Path(path) for module in own if (path := getattr(module, "__file__", None))})
        pictures = [folder / name for name in PICTURES] if folder else []
        return cls(sim, process.name, process.commands.dictionary, folder, files,
                   next((picture for picture in pictures if picture.is_file()), None), epoch_of(sim))

    def write_database(self, name: str, folder: Path) -> Path:
        """Write the file NAME.xml of XTCE into a folder."""
        from fledge.export import ground, packets, read
        from fledge.export.xtce import xtce

        database = packets.database(read(self.simulation, self.process))
        text = xtce(self.simulation.name, [database], ground.read(self.folder, [database]))
        return write_files({f"{name}.xml": text}, folder)[0]

    def has(self, service: str) -> bool:
        """Whether flight has a module of this type."""
        return service in {block.type for block in self.dictionary.blocks}


def epoch_of(sim: Simulation) -> int | None:
    """[ns] since 1970, UTC, of the run's start, if its world stands in a sky."""
    from datetime import datetime, timezone

    from fledge.world.sky import Sky

    skies = (getattr(instance, "sky", None) for process in sim.processes for instance in process.instances.values())
    sky = next((sky for sky in skies if isinstance(sky, Sky)), None)
    if sky is None:
        return None
    date, _, rest = sky.utc().rstrip("Z").partition(".")
    begin = datetime.fromisoformat(date).replace(tzinfo=timezone.utc)
    return int(begin.timestamp()) * 10**9 + int(rest.ljust(9, "0")[:9] or 0)
