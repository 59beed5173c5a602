# SPDX-License-Identifier: Apache-2.0
"""The time of a packet of 200 bytes in each layer of the link, in telemetry frames of 1024 bytes and as a CLTU; and the
bytes of each layer's code on a LEON3, where its compiler is installed."""
from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path

from bench.rows import Rows, in_turn, options, report
from bench.sim import library
from fledge.files import ROOT
from fledge.targets import TARGETS

LAYERS = {"header": 1_000_000, "telemetry, framed": 100_000, "telemetry, read": 20_000, "command, as a CLTU": 20_000,
          "command, read": 20_000}
FILES = ["space_packet", "packet_zone", "tm_frame", "tc_frame", "sync", "farm", "fop"]


def sizes() -> dict[str, int]:
    """[bytes] of code and constants of each file, for a LEON3."""
    from fledge.targets.leon3 import toolchain

    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in FILES:
            made = Path(folder) / f"{name}.o"
            subprocess.run([toolchain.COMPILER, *toolchain.MACHINE, *toolchain.headers(), "-std=c99", "-Os", "-I", ROOT,
                            "-c", ROOT / f"ccsds/{name}.c", "-o", made], check=True)
            text = subprocess.run([toolchain.SIZE, made], capture_output=True, text=True,
                                  check=True).stdout.splitlines()[1]
            found[name] = int(text.split()[0])
    return found


def main(arguments: list[str]) -> int:
    chosen = options("ground", arguments, runs=7)
    lib = library()
    lib.time_link_layer.argtypes = [ctypes.c_char_p, ctypes.c_long]
    lib.time_link_layer.restype = ctypes.c_double
    samples = in_turn({layer: lambda layer=layer, n=n: 1e9 * lib.time_link_layer(layer.encode(), n)
                       for layer, n in LAYERS.items()}, chosen.runs)
    rows = Rows()
    for layer, values in samples.items():
        rows.add(layer, "packet", values, "ns")
    if TARGETS["leon3"].missing():
        print("no sizes: the compiler for LEON3 is not installed; ./fledge setup --on leon3 does it")
    else:
        for name, size in sizes().items():
            rows.add(f"ccsds/{name}.c", "code on a LEON3, -Os", size, "bytes")
    report(rows, chosen)
    return 0
