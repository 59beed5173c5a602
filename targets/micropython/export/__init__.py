# SPDX-License-Identifier: Apache-2.0
"""A mission for MicroPython: its script composes it where it flies, and C runs it (targets/micropython).

The modules' memory, the board, the host, commands and telemetry are those of the export as C; the executive's functions
stand where the exported ones do. Besides there are the tables of the script (tables.py).

Example:

    $ ./fledge export micropython nadir_spin
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export.board import emit_board
from fledge.export.c_source import emit as emit_c
from fledge.export.commands import emit_commands
from fledge.export.host import emit_host
from fledge.targets.micropython.export.script import COMPUTED, Scripts, read_scripts
from fledge.targets.micropython.export.tables import emit_tables
from fledge.export.read import ExportError

if TYPE_CHECKING:
    from fledge.export.read import Mission
    from fledge.mission.simulation import Simulation


@dataclass
class Composed:
    """A flight process for MicroPython."""
    mission: Mission
    files: dict[str, str]       # name -> text of its C, its board and its packets
    scripts: Scripts


def compose(sim: Simulation, mission: Mission, own: Mission | None = None, boards: Sequence[Path | str] = (),
            outputs: Sequence[str] | str = ()) -> Composed:
    """A flight process of `sim`, which was loaded from a mission's folder, as files.

    own: the mission as its scripts compose it, where `mission` is what a scenario has changed of it since.
    """
    if fed := [port for port in mission.inputs if port.fed]:
        raise ExportError("\n".join(f"{port.path} is fed {port.fed}, which the script cannot do on a target: wire it "
                                    "to a model of the world" for port in fed))
    own = replace(own or mission, form="micropython")
    scripts = read_scripts(sim)
    left = {module.name: module.memory for module in own.modules}
    mission = replace(mission, form="micropython", changed=[
        module for module in mission.modules if module.memory != left[module.name]],
        begins=mission.initial_mode if mission.initial_mode != own.initial_mode else None)
    files = (emit_c(mission) | emit_board(mission, boards, outputs) | emit_commands(mission) | emit_host(mission)
             | emit_tables(own, scripts.module, scripts.whole, [process.name for process in sim.processes],
                           COMPUTED in scripts.files, scripts.names))
    return Composed(mission, files, scripts)
