# SPDX-License-Identifier: Apache-2.0
"""The program of MicroPython on a LEON3 board, on stock QEMU.

Example:

    $ ./fledge fly nadir_spin --on leon3-micropython-qemu --for 10min
"""
from fledge.targets.leon3_micropython import Leon3MicroPython
from fledge.targets.leon3_qemu import Leon3Qemu


class Leon3MicroPythonQemu(Leon3Qemu):
    uses = ("leon3-qemu", "leon3-micropython")
    guests = Leon3MicroPython
