# SPDX-License-Identifier: Apache-2.0
"""The Linux target, cross-built for a Raspberry Pi, under an emulator.

The emulator has the processor of the oldest Raspberry Pi of 64 bits (3 and Zero 2), so a program that flies there flies
on all later ones, too: an instruction that this processor lacks ends it. It emulates no kernel and no clock.

Example:

    $ ./fledge fly nadir_spin --on aarch64 --for 10min
"""
from fledge.targets.linux import Linux


class Aarch64(Linux):
    about = "the same for a Raspberry Pi, under qemu-user"
    cpu_of = "emulated"
    profiled_by = ""
    secures = False     # Debian has the library for the machine of the compiler alone
    compiler, size, runner = "aarch64-linux-gnu-gcc", "aarch64-linux-gnu-size", ("qemu-aarch64", "-cpu", "cortex-a53")
    needs = (compiler, runner[0])
