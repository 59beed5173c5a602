# SPDX-License-Identifier: Apache-2.0
"""For tests: apps on the pocket cFE in a process of its own, the outside of their registers, and packets by hand."""

import ctypes
import os
import queue
import struct
import subprocess
import threading
from pathlib import Path

from fledge.targets.cfs.export.folder import flown_by
from fledge.export.testing import STRICT, objects_of
from fledge.disk import ROOT, write_files

HERE = ROOT / "targets/cfs/testing"
LONG_NS = 60_000_000_000


class Outside:
    """The registers' other side."""

    def __init__(self, mission, folder, files=(), outputs="all"):
        folder = Path(folder)
        flown, _ = flown_by(mission, files, outputs)
        write_files(flown, folder)
        so = folder / "outside.so"
        sources = [ROOT / "registers" / f"{name}.c" for name in ("lane", "field", "clock", "message", "shared_file")]
        subprocess.run(list(map(str, ["gcc", *STRICT, "-O1", "-shared", "-fPIC", f"-Dfledge_io={mission.name}_io", "-I",
                                      folder, "-I", ROOT, *(folder / f for f in flown if f.endswith(".c")), *sources,
                                      ROOT / "targets/mission_io.c", HERE / "outside.c",
                                      *objects_of(mission, folder).values(), "-lm", "-o", so])), check=True)
        self.so = ctypes.CDLL(str(so))
        self.so.outside_tick.argtypes = [ctypes.c_int64] * 3
        self.so.outside_take.argtypes = [ctypes.c_uint32, ctypes.c_void_p, ctypes.c_int64]
        self.so.outside_put.argtypes = [ctypes.c_uint32, ctypes.c_void_p]
        self.messages = {m.path: (i, m.struct.size) for i, m in enumerate((*mission.inputs, *mission.outputs))}
        self.begin()

    def begin(self):
        """A new file, all zero."""
        self.fd = self.so.outside_open()
        assert self.fd >= 0
        self.open = True
        return self

    def put(self, path, raw):
        self.so.outside_put(self.messages[path][0], raw)

    def take(self, path, t):
        id, size = self.messages[path]
        raw = ctypes.create_string_buffer(size)
        self.so.outside_take(id, raw, t)
        return raw.raw

    def tick(self, t, dt=0):
        done = self.so.outside_tick(t, dt, LONG_NS)
        assert done == 0, {1: "flight is late", 2: "flight is gone"}[done]

    def stop(self):
        self.so.outside_stop()

    def close(self):
        if self.open:
            self.open = False
            self.so.outside_close()


class Core:
    """The program of linked.build: packets to it, and its lines."""

    def __init__(self, program, outside=None, listen="", hold=False, runner=(), app="NAV",
                 variables=None):
        environment = dict(os.environ)
        environment |= variables or {}
        if outside:
            environment[f"{app}_REGISTERS"] = f"/dev/fd/{outside.fd}"
        self.process = subprocess.Popen(
            [*runner, str(program), "--root", str(Path(program).parent), "--ground",
             *(["--listen", listen] if listen else []),
             *(["--hold"] if hold else [])], env=environment, pass_fds=[outside.fd] if outside else [],
            cwd=Path(program).parent,           # without an outside, an app waits for a register file there
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        assert self.process.stdin and self.process.stdout
        self.stdin, self.stdout = self.process.stdin, self.process.stdout
        self.lines: queue.Queue[str | None] = queue.Queue()
        self.seen: list[str] = []
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        for line in self.stdout:
            self.lines.put(line.decode(errors="replace").rstrip("\n"))
        self.lines.put(None)

    def send(self, packet):
        self.write(packet.hex())

    def write(self, line):
        self.stdin.write((line + "\n").encode())
        self.stdin.flush()

    def until(self, wanted):
        """The next line that has this text in it, or for which wanted(line) is true."""
        while True:
            line = self.lines.get()
            assert line is not None, "\n".join(self.seen[-30:])
            self.seen.append(line)
            if wanted(line) if callable(wanted) else wanted in line:
                return line

    def reports(self, wanted):
        """A line that has this text in it, now or before: lines of several tasks may change places."""
        return next((line for line in self.seen if wanted in line), None) or self.until(wanted)

    def telemetry(self, mid):
        """The next packet of an id, as bytes."""
        return bytes.fromhex(self.until(lambda line: line.startswith(f"TLM {mid:04x}"))[4:])

    def all_of(self, mid):
        """All packets of an id so far, as bytes."""
        return [bytes.fromhex(line[4:]) for line in self.seen if line.startswith(f"TLM {mid:04x}")]

    def stop(self):
        """Ask it to end, and give what it reports."""
        self.process.terminate()
        return self.end()

    def end(self):
        """Wait for its end, and give what it reports: name -> number."""
        self.stdin.close()
        while (line := self.lines.get()) is not None:
            self.seen.append(line)
        self.process.wait()
        values = {words[0]: float(words[1]) for words in map(str.split, self.seen) if len(words) == 2 and
                  words[1].replace(".", "").isdigit()}
        return values | {"exit": self.process.returncode}

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.stdin.close()


def command(mid, code, payload=b"", checksum=None, sequence=0):
    """A command's bytes, written out once more from the contract."""
    size = 8 + len(payload)
    packet = bytearray(struct.pack(">HHHBB", mid, 0xC000 | sequence, size - 7, code, 0) + payload)
    sum_ = 0xFF
    for byte in packet:
        sum_ ^= byte
    packet[7] = sum_ if checksum is None else checksum
    return bytes(packet)


def telemetry(mid, payload, sequence=1):
    """The bytes of a telemetry packet without a time."""
    return struct.pack(">HHH10x", mid, 0xC000 | sequence, 16 + len(payload) - 7) + payload


def read_tbl(raw):
    """(content id, subtype, full name, description, content) of a .tbl file."""
    assert len(raw) >= 116
    content_id, subtype, length = raw[:4], int.from_bytes(raw[4:8], "big"), int.from_bytes(raw[8:12], "big")
    assert length == 64
    reserved, offset, size = (int.from_bytes(raw[i:i + 4], "big") for i in (64, 68, 72))
    assert (reserved, offset) == (0, 0) and len(raw) == 116 + size
    text = [part.partition(b"\0")[0].decode() for part in (raw[76:116], raw[32:64])]
    return content_id, subtype, text[0], text[1], raw[116:]
