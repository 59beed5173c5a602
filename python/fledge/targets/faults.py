# SPDX-License-Identifier: Apache-2.0
"""Where the program of a board stopped: its log of a fault or trap, as module, function, file and line."""
from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from fledge.export.read import Mission

# As targets/bare/fault.c and targets/leon3/board.c say it.
_FAULT = re.compile(r"fault: (?P<what>.+) at 0x(?P<pc>[0-9a-f]+)(?:, called from 0x(?P<caller>[0-9a-f]+))?$", re.M)
_TRAP = re.compile(r"(?P<what>trap 0x[0-9a-f]+) at 0x(?P<pc>[0-9a-f]+): the program stops$", re.M)
_CALLS = re.compile(r"(?:^|: )[oi](?: [0-9a-f]{8}){7} ([0-9a-f]{8})$", re.M)    # %o7 and %i7: of call instructions


def named(log: str, program: Path, tool: str, mission: Mission, roots: Sequence[Path]) -> str:
    """What the last fault in a log was, and in which module of the mission; "" if there is none. tool: addr2line of the
    program's processor; roots: folders that the names of files are relative to."""
    matches = [*_FAULT.finditer(log), *_TRAP.finditer(log)]
    if not matches:
        return ""
    last = matches[-1].groupdict()
    callers = ([int(last["caller"], 16) - 1] if last.get("caller") else
               [int(address, 16) for address in _CALLS.findall(log[matches[-1].end():])])
    (function, place), *calls = _places(program, tool, [int(last["pc"], 16), *callers])
    module = _module(mission, place, [place for _, place in calls])
    return f"{program.name}: {last['what']} at 0x{last['pc']}: in {module}{function}, {_relative(place, roots)}"


def _places(program: Path, tool: str, addresses: Iterable[int]) -> list[tuple[str, str]]:
    """(function, "file:line") of each address."""
    lines = subprocess.run([tool, "-f", "-e", program, *map(hex, addresses)], capture_output=True, text=True,
                           check=True).stdout.splitlines()
    return [(function, place.partition(" (")[0]) for function, place in zip(lines[::2], lines[1::2])]


def _module(mission: Any, place: str, calls: Iterable[str]) -> str:
    """The module whose function it is, by the exported line that called it, else by its source."""
    stem = Path(place.rpartition(":")[0]).stem
    for call in [place, *calls]:
        file, _, line = call.rpartition(":")
        if Path(file).stem == mission.name and line.isdigit() and Path(file).is_file():
            text = Path(file).read_text(encoding="utf-8").splitlines()[int(line) - 1]
            own = re.search(r"\(&m->(\w+)[,)]", text)
            for module in mission.modules:
                if own and module.name == own[1]:
                    return f"the module {module.path}, "
    several = [module.path for module in mission.modules if module.function == stem]
    return f"the module {' or '.join(several)}, " if several else ""


def _relative(place: str, roots: Iterable[object]) -> str:
    for root in roots:
        if place.startswith(f"{root}/"):
            return place[len(f"{root}/"):]
    return place
