# SPDX-License-Identifier: Apache-2.0
"""A picture of a mission in 3-D, from any record.

Example:

    from fledge import scene

    picture = scene.of("run.mcap")          # fledge.view("run.mcap") writes view.html beside the record
    craft = picture.crafts[0]
    print(craft.name, craft.motion.at([0.0, 60.0]))

The modules:

    scene.py    the parts of a picture: Scene, Craft, and the methods for a mission's view.py
    derive.py   a scene from a record
    tracks.py   motions and signals over time, thinned within bounds
    page.py     a scene as one HTML file
    foxglove.py a record with its scene, for Foxglove
    bundle.py   the viewer, built from web/
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.scene.derive import Facts, derive
from fledge.scene.scene import Craft, Direction, Part, Planet, Plot, Pose, Scene

if TYPE_CHECKING:
    from fledge.archive import Archive
    from fledge.mission.log import Log
    from fledge.mission.simulation import Simulation

__all__ = ["Craft", "Direction", "Part", "Planet", "Plot", "Pose", "Scene", "of", "view"]


def of(source: Archive | Log | Simulation | str | PathLike[str], plots_only: bool = False) -> Scene:
    """The scene of a record: an Archive or its file, a Log, or all records of a simulation.

    plots_only: without spacecraft, for a record that has no attitude
    Raises SetupError if it has no attitude, MissionError with the line if the mission's view.py is wrong.
    """
    from fledge.archive import Archive, ArchiveError
    from fledge.mission.log import Log

    if isinstance(source, (str, PathLike)):
        with Archive(source) as archive:
            return of(archive, plots_only)
    if not isinstance(source, (Archive, Log)):
        first = {record.path: record for record in reversed(source.records)}
        source = Log(source, reversed(first.values()))
    facts = _facts_of_archive(source) if isinstance(source, Archive) else facts_of_simulation(source.simulation)
    try:
        scene = derive(source, facts, plots_only)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        if isinstance(source, Archive) and source.problem:
            raise ArchiveError(f"{source.problem}; there is no scene in it: {error}") from None
        raise
    if facts.folder is not None and not plots_only:
        add_of_mission(scene, facts.folder)
    return scene


def view(source: Archive | Log | Simulation | str | PathLike[str], path: str | PathLike[str] | None = None) -> Path:
    """Write a page that shows a record in 3-D, with its plots; returns its path.

    source: as for of(); path: None: view.html, beside the record's file, else in the current folder
    Raises SetupError as of(), and where the viewer was not built.
    """
    from fledge.scene import page

    if path is None:
        record = source if isinstance(source, (str, PathLike)) else getattr(source, "path", None)
        path = Path(record).with_name("view.html") if record else Path("view.html")
    return page.write(of(source), path)


def _facts_of_archive(archive: Archive) -> Facts:
    from fledge.mission import missions

    run, about = archive.metadata.get("run", {}), archive.metadata
    mission = run.get("mission", "")
    known = missions().get(mission)
    return Facts(mission or archive.path.stem, run.get("scenario", ""), archive.parameters,
                 about.get("instances", {}), about.get("wires", {}), known.folder if known else None)


def facts_of_simulation(sim: Simulation) -> Facts:
    """The facts of a simulation."""
    import json

    from fledge.mission.provenance import instances, parameters, wires

    decode = json.JSONDecoder().raw_decode
    return Facts(sim.name, "", {name: decode(text)[0] for name, text in parameters(sim.processes).items()},
                 instances(sim.processes), wires(sim), sim.mission.folder if sim.mission else None)


def add_of_mission(scene: Scene, folder: Path) -> None:
    """Run build(view) of the mission's view.py, if it has one."""
    from fledge.mission.folder import Mission, MissionFiles

    if (folder / "view.py").exists():
        with MissionFiles(Mission(folder)) as files:
            files.call(files.execute("view", "build").build, scene)
            files.forget()
