# SPDX-License-Identifier: Apache-2.0
"""Refuses flight code that calls libm or the operating system, allocates, or keeps writable static variables.

    python3 flight_symbols.py --root DIR [--library FILE]... [--advice TEXT] OBJECT...

It reads the symbols and relocations of compiled C (ELF, 64 bits): what the compiler inlined or removed is not there.
The objects may refer to one another, to what the libraries define, and to ALLOWED. It prints FILE:LINE: REASON for
each function that refers to more, and TEXT after it; DIR is where the sources are.
"""

import argparse
import re
import struct
import subprocess
import sys
from pathlib import Path

# Of libm, those functions that IEEE 754 or their own definition rounds exactly.
EXACT = {name + suffix for name in "sqrt fabs floor ceil trunc rint round fmod copysign ldexp frexp modf".split()
         for suffix in ("", "f")}
ALLOWED = {"memcpy", "memmove", "memset", "memcmp", "__assert_fail", *EXACT}
# What compilers call by themselves.
HELPERS = re.compile(r"_GLOBAL_OFFSET_TABLE_|__stack_chk_fail|__mem\w+_chk|__tls_get_addr|__(asan|ubsan|gcov)_\w+|"
                     r"__(u?div|u?mod|u?divmod|mul|popcount|parity|clz|ctz|ffs|bswap)[sdt]i[234]|"
                     r"__float(un)?[sdt]i[sdtx]f|__fix(uns)?[sdtx]f[sdt]i")
# The same functions of flight/math; log10 and the like have none.
OURS = set("sin cos tan sincos asin acos atan atan2 exp log".split())
LIBM = OURS | set("sinh cosh tanh asinh acosh atanh exp2 exp10 expm1 log2 log10 log1p logb pow cbrt hypot erf erfc "
                  "tgamma lgamma fma fmin fmax fdim remainder remquo nearbyint nextafter scalbn".split())
ALLOCATES = set("malloc calloc realloc free alloca aligned_alloc posix_memalign strdup".split())

WRITE, ALLOC, RELA, SYMTAB = 1, 2, 4, 2     # of ELF: flags and types of sections
OBJECT, FUNCTION, SECTION = 1, 2, 3         # of ELF: types of symbols
COMMON = 0xFFF2


class Elf:
    """The sections, symbols and relocations of an object.

    sections: (name, type, flags, offset, size, link, info); symbols: (name, type, section, value, size)
    """

    def __init__(self, data):
        if data[:6] != b"\x7fELF\x02\x01":
            raise ValueError("expected an object file of ELF with 64 bits, little-endian")
        start, = struct.unpack_from("<Q", data, 0x28)
        entry, count, names = struct.unpack_from("<HHH", data, 0x3A)
        raw = [struct.unpack_from("<IIQQQQIIQQ", data, start + i * entry) for i in range(count)]

        def text(table, at):
            at += raw[table][4]
            return data[at:data.index(b"\0", at)].decode()

        self.data = data
        self.x86 = data[0x12] == 62
        self.sections = [(text(names, s[0]), s[1], s[2], s[4], s[5], s[6], s[7]) for s in raw]
        self.symbols = []
        for _, kind, _, offset, size, link, _ in self.sections:
            if kind == SYMTAB:
                for at in range(offset, offset + size, 24):
                    name, info, _, section, value, length = struct.unpack_from("<IBBHQQ", data, at)
                    self.symbols.append((text(link, name), info & 15, section, value, length))

    def references(self):
        """(section, offset, symbol, place within the symbol) of each relocation of what is loaded."""
        for _, kind, _, offset, size, _, target in self.sections:
            if kind == RELA and self.sections[target][2] & ALLOC and not self.sections[target][0].startswith(".eh_"):
                for at in range(offset, offset + size, 24):
                    place, info, addend = struct.unpack_from("<QQq", self.data, at)
                    # Addends of x86-64 that are relative to the code count from the end of the instruction.
                    relative = self.x86 and info & 0xFFFFFFFF in (2, 4, 9, 41, 42)
                    yield target, place, self.symbols[info >> 32], addend + (4 if relative else 0)

    def holder(self, section, offset):
        """The function or variable around a place, without the compiler's suffixes; "" if none is."""
        inside = [s for s in self.symbols
                  if s[2] == section and s[1] in (OBJECT, FUNCTION) and s[3] <= offset < s[3] + s[4]]
        return inside[0][0].split(".")[0] if inside else ""

    def undefined(self):
        return {name for name, _, section, _, _ in self.symbols if name and section == 0}

    def defined(self):
        return {name for name, kind, section, _, _ in self.symbols if name and section != 0 and kind != SECTION}

    def statics(self):
        """The variables that a program could change: symbols."""
        if any(name.startswith("__asan_") for name in self.undefined()):
            return []       # the sanitizer has many of its own
        writable = {i for i, (name, _, flags, *_) in enumerate(self.sections)
                    if flags & WRITE and flags & ALLOC and re.match(r"\.t?(data|bss)(?!\.rel\.ro)", name)}
        return [s for s in self.symbols
                if s[1] not in (FUNCTION, SECTION) and s[4] and (s[2] in writable or s[2] == COMMON)]


def users_of(elf, variable):
    """The places that refer to a variable: [(section, offset)]."""
    _, _, section, value, size = variable
    return [(place, offset) for place, offset, symbol, within in elf.references()
            if symbol == variable or symbol[1:3] == (SECTION, section) and value <= within < value + size]


def line_of(path, elf, place):
    """The line of the source; 1 without debug information."""
    section, offset = place
    done = subprocess.run(["addr2line", "-e", path, "-j", elf.sections[section][0], hex(offset)], capture_output=True,
                          text=True)
    match = re.search(r":(\d+)", done.stdout)
    return max(1, int(match[1])) if match else 1


def why(callee):
    plain = callee if callee in LIBM else callee[:-1] if callee[-1] in "fl" else callee
    if plain in LIBM:
        instead = f"fm_{plain} of flight/math/elementary.h" if plain in OURS else "the functions of flight/math"
        return f"calls {callee} of libm, whose last bits differ between machines; use {instead}"
    if callee in ALLOCATES:
        return f"calls {callee}; flight code does not allocate: keep memory in `mem` of the module"
    return (f"refers to {callee}, which is neither flight code nor in flight/math; messages bring inputs and carry "
            "results")


def complaints(path, elf, known):
    """(line, text) of what one object does."""
    seen = {}
    for section, offset, (name, _, where, _, _), _ in elf.references():
        if where == 0 and name and name not in known and not HELPERS.fullmatch(name):
            seen.setdefault((elf.holder(section, offset), name), (section, offset))
    for (holder, name), place in seen.items():
        yield line_of(path, elf, place), f"{holder or 'this file'} {why(name)}"
    for variable in elf.statics():
        users = users_of(elf, variable)
        holders = sorted({elf.holder(*place) for place in users} - {""})
        name = variable[0].split(".")[0]
        yield (line_of(path, elf, users[0]) if users else 1,
               f"{', '.join(holders) or 'this file'} keeps the variable {name}, which all instances, clones and "
               "threads share; put it into `mem` of the module, or make it const")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=Path())
    parser.add_argument("--library", action="append", default=[])
    parser.add_argument("--advice", default="")
    parser.add_argument("objects", nargs="*", metavar="OBJECT")
    options = parser.parse_args()

    objects = {path: Elf(Path(path).read_bytes()) for path in options.objects if path.endswith((".c.o", ".c.obj"))}
    known = set(ALLOWED).union(*(elf.defined() for elf in objects.values()))
    if options.library:
        listed = subprocess.run(["nm", "--defined-only", *options.library], check=True, capture_output=True, text=True)
        known.update(line.split()[-1] for line in listed.stdout.splitlines() if line)
    problems, advice = [], options.advice and f"; {options.advice}"
    for path, elf in objects.items():
        source = options.root / re.sub(r".*CMakeFiles/[^/]+\.dir/(.*)\.o(bj)?$", r"\1", path).replace("__/", "../")
        problems += [f"{source}:{line}: {text}{advice}" for line, text in sorted(complaints(path, elf, known))]
    if problems:
        print("\n".join(problems), file=sys.stderr)
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main())
