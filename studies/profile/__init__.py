# SPDX-License-Identifier: Apache-2.0
"""What flight costs on a target: memory, code, instructions and time, initialisation and loop apart.

    run.py        a profile of each target
    measure.py    the figures of a target, and those that must not grow
    process.py    a process on this machine, by Valgrind, with the inputs of the closed loop
    board.py      a LEON3 board, by the emulator, in the closed loop
    line.py       a board behind a serial line, by QEMU's count, in the closed loop
    desktop.py    the same mission under CPython, by Valgrind
    valgrind.py   runs Callgrind and Massif, and reads what they write
    code.py       code by its parts, from the map of the linker
    page.py       the tables and plots on one HTML page

Example:

    $ ./fledge profile nadir_spin --on leon3
"""

from fledge.profile.measure import Profile
from fledge.profile.run import profile

__all__ = ["Profile", "profile"]
