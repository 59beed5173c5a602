# SPDX-License-Identifier: Apache-2.0
"""The time of a packet of 200 bytes in each layer of the link, in telemetry frames of 1024 bytes and as a CLTU; of the
protection of such a frame, and of that of a command; of a command and a packet of telemetry through both ends of the
whole link, plain and secured; of a PDU of 1000 bytes of a file; and the bytes of each layer's code and of its deepest
stack on a LEON3, where its compiler is installed. Before that, the parameters that one core
decodes in a second by a database, of packets of 1500 bytes with a header: 369 integers of 32 bits, as in the
performance test of Yamcs; and 200 numbers of eight kinds with calibrators, once with a size that varies, which is
decoded entry by entry. The monitor's rows: the share of one core that 20,000 packets a second of 369 integers take,
ten times the load of that test, decoded with and without limits, and kept in an archive on this machine's disk; and a
frame of 10,000 changed values for a browser. At the end, the archive of a month (ground_archive), and the whole server
with its browsers (ground_server)."""
from __future__ import annotations

import ctypes
import re
import subprocess
import tempfile
from pathlib import Path

from bench import ground_archive, ground_server
from bench.rows import PEER, Rows, in_turn, options, report
from bench.sim import library
from fledge.disk import ROOT
from fledge.targets import TARGETS

LAYERS = {"header": 1_000_000, "telemetry, framed": 100_000, "telemetry, read": 20_000, "command, as a CLTU": 20_000,
          "command, read": 20_000, "frame of telemetry, protected": 20_000, "frame of telemetry, opened": 20_000,
          "frame of a command, protected": 50_000, "frame of a command, checked": 50_000,
          "link, up and down": 10_000, "link, up and down, secured": 10_000, "PDU of a file, sent": 50_000,
          "PDU of a file, written and received": 50_000}
DECODED = {"369 integers": 20_000, "mixed": 20_000, "mixed, of varying size": 5_000}
RATE = 20_000       # [1/s] packets that a monitor takes
YAMCS = 0.738       # million parameters/s that its performance test sends, at half a core; 5 % of them are decoded


def sizes() -> dict[str, tuple[int, int]]:
    """[bytes] of code and constants of each file, and of the deepest stack of its functions with what they call in the
    other files, for a LEON3. What a function of the caller's takes is not in it, so the cipher is not."""
    from fledge.targets.build import flight_sources
    from fledge.targets.leon3 import toolchain

    code, frames, homes = {}, {}, {}
    calls: dict[str, set[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        own = [path for path in flight_sources() if path.parent == ROOT / "ccsds"]
        for source in [*own, ROOT / "flight/services/space_link.c"]:
            file = str(source.relative_to(ROOT))
            made = Path(folder) / f"{file.replace('/', '_')}.o"
            subprocess.run([toolchain.COMPILER, *toolchain.MACHINE, *toolchain.headers(), "-std=c99", "-Os", "-I", ROOT,
                            "-fcallgraph-info=su", "-c", source, "-o", made], check=True)
            text = subprocess.run([toolchain.SIZE, made], capture_output=True, text=True,
                                  check=True).stdout.splitlines()[1]
            code[file] = int(text.split()[0])
            graph = made.with_suffix(".ci").read_text(encoding="utf-8")
            for name, size in re.findall(r'title: "([^"]+)" label: "[^"]*?(\d+) bytes', graph):
                frames[name] = int(size)
                homes[name] = file
            for caller, called in re.findall(r'sourcename: "([^"]+)" targetname: "([^"]+)"', graph):
                calls.setdefault(caller, set()).add(called)

    def depth(name):
        return frames.get(name, 0) + max((depth(called) for called in calls.get(name, ())), default=0)

    return {name: (size, max(depth(member) for member, home in homes.items() if home == name))
            for name, size in code.items()}


def main(arguments: list[str]) -> int:
    chosen = options("ground", arguments, runs=7)
    lib = library()
    lib.time_link_layer.argtypes = [ctypes.c_char_p, ctypes.c_long]
    lib.time_link_layer.restype = ctypes.c_double
    samples = in_turn({layer: lambda layer=layer, n=n: 1e9 * lib.time_link_layer(layer.encode(), n)
                       for layer, n in LAYERS.items()}, chosen.runs)
    rows = Rows()
    for layer, values in samples.items():
        rows.add(layer, layer.split()[0] if layer.startswith(("frame", "PDU")) else "packet", values, "ns")
    lib.time_decoder.argtypes = [ctypes.c_char_p, ctypes.c_long]
    lib.time_decoder.restype = ctypes.c_double
    decoded = in_turn({packet: lambda packet=packet, n=n: 1e-6 / lib.time_decoder(packet.encode(), n)
                       for packet, n in DECODED.items()}, chosen.runs)
    rows.add("peer's 369 integers", "decoded", YAMCS, "million/s", note=PEER)
    for packet, values in decoded.items():
        rows.add(packet, "decoded", values, "million/s", ratio_to="peer's 369 integers")
    lib.time_monitor.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_long]
    lib.time_changes.argtypes = [ctypes.c_long]
    lib.time_monitor.restype = lib.time_changes.restype = ctypes.c_double

    def monitored(limits, archived):
        with tempfile.TemporaryDirectory() as folder:
            return 100 * RATE * lib.time_monitor(folder.encode() if archived else b"", limits, RATE)

    monitors = in_turn({"monitored": lambda: monitored(False, False),
                        "monitored with limits": lambda: monitored(True, False),
                        "monitored with limits, archived": lambda: monitored(True, True)}, chosen.runs)
    for name, values in monitors.items():
        rows.add(name, f"{RATE} packets of 369 integers a second", values, "% of a core")
    rows.add("10,000 values that changed", "frame for a browser", in_turn(
        {"": lambda: 1e6 * lib.time_changes(200)}, chosen.runs)[""], "us")
    if TARGETS["leon3"].missing():
        print("no sizes: the compiler for LEON3 is not installed; ./fledge setup --on leon3 does it")
    else:
        for name, (size, stack) in sizes().items():
            rows.add(name, "code on a LEON3, -Os", size, "bytes")
            rows.add(name, "stack on a LEON3, -Os", stack, "bytes")
    ground_archive.add_rows(rows, chosen.runs)
    ground_server.add_rows(rows)
    report(rows, chosen)
    return 0
