# SPDX-License-Identifier: Apache-2.0
"""The Linux target on a machine of the other byte order, under an emulator.

Example:

    $ ./fledge fly nadir_spin --on sparc64 --for 10min
"""
from fledge.targets.aarch64 import Aarch64


class Sparc64(Aarch64):
    about = "the same for a big-endian machine, under qemu-user"
    compiler, size, runner = "sparc64-linux-gnu-gcc", "sparc64-linux-gnu-size", ("qemu-sparc64",)
    needs = (compiler, *runner)
