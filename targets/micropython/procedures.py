# SPDX-License-Identifier: Apache-2.0
"""Procedures of scenarios: fledge.targets.procedure(sim.flight, "check.py")."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fledge.commands import TURNS, Report
from fledge.errors import SetupError
from fledge.targets.micropython.toolchain import compile_mpy

if TYPE_CHECKING:
    from fledge.mission.process import Process


def procedure(process: Process, file: Path | str, turns: int = TURNS, slot: int = 0) -> list[Report]:
    """Send a procedure, a file with a function main(f), to a flight process, and start it: CPython runs it on the
    desktop, MicroPython its bytecode on board. turns: of its loops and returns of functions that it may take there in
    one instant. Returns the reports of the acceptance of its commands."""
    path = Path(file)
    try:
        source = path.read_text(encoding="utf-8")
    except OSError as error:
        raise SetupError(f"procedure: {path}: {error.strerror}") from None
    return process.commands.procedure(compile_mpy(source, path.name), source, path.name, turns, slot)
