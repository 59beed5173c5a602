# SPDX-License-Identifier: Apache-2.0
"""For tests: an exported mission compiled to a shared object, and its memory as Python sees it."""

import ctypes
import subprocess
from pathlib import Path

import pytest

from fledge import export
from fledge.disk import ROOT
from fledge.targets import build
from tests.needs import needs

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wstrict-prototypes",
          "-ffp-contract=off", "-fno-math-errno"]
CLANG = pytest.param("clang", marks=needs("clang"))
COMPILERS = ["gcc", CLANG]


def objects_of(mission, folder, compiler="gcc", optimise="-O2", roots=(ROOT,)):
    """The objects of Fledge's C that a mission calls, compiled once."""
    paths = [*build.module_sources(mission, roots), *build.math_sources(), *(ROOT / path for path in build.COMMAND)]
    return build.shared_objects(Path(folder), paths, compiler, [*STRICT, optimise, "-fPIC"])


class Row(ctypes.Structure):
    """MissionMessage; the first four also are MissionParameters."""

    _fields_ = [("path", ctypes.c_char_p), ("type", ctypes.c_char_p), ("offset", ctypes.c_uint32),
                ("size", ctypes.c_uint32), ("direction", ctypes.c_int)]


class Compiled:
    """A mission in C, with the source of its modules, in memory of its own."""

    def __init__(self, mission, folder, roots=(), compiler="gcc", optimise="-O0"):
        folder = Path(folder)
        export.write(mission, folder)
        roots = [*map(Path, roots), ROOT]
        objects = objects_of(mission, folder, compiler, optimise, roots)
        own = [path for path in build.module_sources(mission, roots) if path not in objects]
        size = folder / "size.c"
        size.write_text(f'#include "{mission.name}.h"\n\nconst uint32_t mission_size = '
                        f"(uint32_t)sizeof({mission.struct()});\n")
        so = folder / f"{mission.name}.so"
        subprocess.run([compiler, *STRICT, optimise, "-shared", "-fPIC", "-I", folder,
                        *(a for root in roots for a in ("-I", root)), "-o", so, folder / f"{mission.name}.c", size,
                        *own, *objects.values(), "-lm"], check=True)
        self.name, self.so = mission.name, ctypes.CDLL(str(so))
        self.memory = ctypes.create_string_buffer(ctypes.c_uint32.in_dll(self.so, "mission_size").value)
        n = len(mission.inputs) + len(mission.outputs)
        rows = (Row * n).in_dll(self.so, f"{mission.name}_messages")
        self.rows = {row.path.decode(): (row.offset, row.size) for row in rows}
        self.functions = {}
        for name, result, *arguments in (("init", None), ("reset", None), ("next", ctypes.c_int64),
                                         ("tick", None, ctypes.c_int64)):
            function = getattr(self.so, f"{mission.name}_{name}")
            function.restype, function.argtypes = result, [ctypes.c_void_p, *arguments]
            self.functions[name] = function
        self.address = ctypes.addressof(self.memory)
        self("init")

    def __call__(self, function, *arguments):
        return self.functions[function](self.address, *arguments)

    def enter(self, mode):
        getattr(self.so, f"{self.name}_enter")(ctypes.c_void_p(self.address), mode)

    def publish(self, module, t):
        getattr(self.so, f"{self.name}_publish_{module}")(ctypes.c_void_p(self.address), ctypes.c_int64(t))

    def get(self, path):
        offset, size = self.rows[path]
        return ctypes.string_at(self.address + offset, size)

    def put(self, path, raw):
        offset, size = self.rows[path]
        assert len(raw) == size
        ctypes.memmove(self.address + offset, raw, size)


class Recorded:
    """What a desktop run says at each instant: the messages of `paths`, as bytes by time."""

    def __init__(self, sim, paths, every=0):
        self.logs = {}
        for path in paths:
            process, instance, port = path.split(".")
            self.logs[path] = sim.kernel.record(getattr(getattr(getattr(sim, process), instance), port),
                                                round(every * 1e9), True)

    def times(self):
        raw = next(iter(self.logs.values())).times()
        return [int.from_bytes(raw[i:i + 8], "little") for i in range(0, len(raw), 8)]

    def samples(self, path):
        log = self.logs[path]
        raw, size = log.bytes(), log.struct.size
        return [raw[i:i + size] for i in range(0, len(raw), size)]
