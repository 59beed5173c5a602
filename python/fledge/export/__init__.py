# SPDX-License-Identifier: Apache-2.0
"""A mission as source that flies where there is no Python.

Example:

    import fledge
    from fledge import export

    mission = export.read(fledge.load("nadir_spin"))     # the live objects, as plain data
    export.write(mission, "runs/nadir_spin/c")           # nadir_spin.h, nadir_spin.c

`read` looks at the objects that flight.py made; `emit_c` writes them as C, and other exports use both.
`emit_board` adds the board that its messages pass, and the tables of how (targets/mission_io.h); `emit_commands` the
tables of commands and telemetry; `emit_host` all that a host needs to know (targets/mission_host.h). What one target
alone needs lies in its folder: targets/cfs/export, targets/micropython/export. The database for ground stations is made
by packets.py, xtce.py and stations.py, with what a mission's ground.toml adds (ground.py). FMUs are in fmu/.
"""

from fledge.commands import leaves
from fledge.export.board import emit_board
from fledge.export.c_source import emit as emit_c
from fledge.export.commands import dictionary, emit_commands
from fledge.export.host import emit_host
from fledge.export.read import ExportError, read, read_all
from fledge.export.write import write
from fledge.disk import write_files

__all__ = ["ExportError", "dictionary", "emit_board", "emit_c", "emit_commands", "emit_host", "leaves", "read",
           "read_all", "write", "write_files"]
