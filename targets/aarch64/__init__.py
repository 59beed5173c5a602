# SPDX-License-Identifier: Apache-2.0
"""The Linux target, cross-built, under an emulator."""
from fledge.targets.linux import Linux


class Aarch64(Linux):
    about = "the same for a Raspberry Pi, under qemu-user"
    cpu_of = "emulated"
    profiled_by = ""
    secures = False     # Debian has the library for the machine of the compiler alone
    compiler, size, runner = "aarch64-linux-gnu-gcc", "aarch64-linux-gnu-size", ("qemu-aarch64",)
    needs = (compiler, *runner)
