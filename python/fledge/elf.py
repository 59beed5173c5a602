# SPDX-License-Identifier: Apache-2.0
"""What an ELF file says of itself: its processor, what of memory it fills, and its build id."""
from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from pathlib import Path

from fledge.errors import Failure

# By the number in the header; others are "processor N".
MACHINES = {2: "SPARC", 3: "x86", 4: "68000", 8: "MIPS", 20: "PowerPC", 21: "PowerPC", 22: "S/390", 40: "ARM",
            42: "SuperH", 43: "SPARC", 62: "x86", 94: "Xtensa", 183: "ARM", 243: "RISC-V", 258: "LoongArch"}
EXECUTABLE = 2
_LOAD, _BUILD_ID = 1, 3
# Where headers differ between 32 and 64 bits: that of the file behind its version, and that of a segment, with the
# places of its type, offset, address, address to load, bytes in the file and in memory.
_HEADER = {32: "IIIIHHH", 64: "QQQIHHH"}
_SEGMENT = {32: ("IIIIIIII", (0, 1, 2, 3, 4, 5)), 64: ("IIQQQQQQ", (0, 2, 3, 4, 5, 6))}


@dataclass
class Segment:
    """What a program fills of memory: `stored` bytes, which are in the file, from `load` on before it starts; `size`
    bytes from `begin` on while it runs. place: of its bytes in the file."""
    place: int
    load: int
    stored: int
    begin: int
    size: int


@dataclass
class Elf:
    """An ELF file."""
    path: Path
    machine: str
    bits: int
    big_endian: bool
    kind: int           # EXECUTABLE, or what is no program
    flags: int
    entry: int
    segments: list[Segment] = field(default_factory=list)
    build_id: str = ""  # in hexadecimal; "": it has none

    @property
    def processor(self) -> str:
        """ "ARM, 32 bits"."""
        return f"{self.machine}, {self.bits} bits" + ", big-endian" * self.big_endian

    @property
    def doubles(self) -> bool:
        """Whether its functions pass numbers in registers of 64-bit floating point; False where its flags do not
        say."""
        return bool(self.machine == "ARM" and self.bits == 32 and self.flags & 0x400
                    or self.machine == "RISC-V" and self.flags & 6 == 4)


def read(path: Path | str) -> Elf:
    """Raises Failure if it is no ELF file, or not a whole one."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise Failure(f"{path}: {(error.strerror or str(error)).lower()}; name the program that was built, an ELF file"
                      ) from None
    if data[:4] != b"\x7fELF" or len(data) < 16 or data[4] not in (1, 2) or data[5] not in (1, 2):
        raise Failure(f"{path} is no ELF file; name the program as the linker made it, not a .bin or .hex of it")
    try:
        return _read(path, data)
    except struct.error:
        raise Failure(f"{path} is cut off: it ends within its headers; build or copy it again") from None


def _read(path: Path, data: bytes) -> Elf:
    bits, order = 32 * data[4], "<>"[data[5] - 1]

    kind, machine, _ = struct.unpack_from(order + "HHI", data, 16)
    entry, at, _, flags, _, size, n = struct.unpack_from(order + _HEADER[bits], data, 24)
    elf = Elf(path, MACHINES.get(machine, f"processor {machine}"), bits, order == ">", kind, flags, entry)
    form, places = _SEGMENT[bits]
    for i in range(n):
        row = struct.unpack_from(order + form, data, at + i * size)
        which, offset, begin, load, stored, wide = (row[i] for i in places)
        if which == _LOAD and wide:
            if offset + stored > len(data):
                raise Failure(f"{path} is cut off: it ends within its segments; build or copy it again")
            elf.segments.append(Segment(offset, load, stored, begin, wide))
    # The note of the linker, wherever its script has put it.
    length = re.search(re.escape(struct.pack(order + "I", 4)) + b"(....)"
                       + re.escape(struct.pack(order + "I", _BUILD_ID)) + b"GNU\0", data, re.DOTALL)
    if length:
        elf.build_id = data[length.end():length.end() + struct.unpack(order + "I", length[1])[0]].hex()
    return elf
