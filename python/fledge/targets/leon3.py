# SPDX-License-Identifier: Apache-2.0
"""A mission on a LEON3 board: on the project's emulator, on stock QEMU, and as an app of the pocket cFE."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.export import cfs
from fledge.export.c_text import wrap
from fledge.export.cfs import around
from fledge.export.write import write_files
from fledge.targets import build
from fledge.targets import leon3_toolchain as toolchain
from fledge.targets.cfs import Cfs
from fledge.targets.restarts import join_starts
from fledge.targets.target import Target

if TYPE_CHECKING:
    from fledge.targets.job import Part

FOLDER = build.ROOT / "targets/leon3"
BOARD = build.ROOT / "emulator/boards/leon3.toml"
RAM, RAM_SIZE, CLOCK = 0x40000000, 0x800000, 80_000_000
SUPPORT = [FOLDER / name for name in ("traps.S", "board.c", "runtime.c", "system.c")]
SHARED = ["targets/mission_io.c", "targets/mission_packets.c", "targets/mission_host.c", "record/mcap.c",
          "record/mcap_crc.c", "registers/lane.c", "registers/field.c", "registers/clock.c", "registers/message.c"]


def program(folder: Path, name: str, sources: Sequence[Path], includes: Sequence[Path],
            flags: Sequence[str] = ()) -> Path:
    """Build a program for a LEON3 board, with its board support."""
    linked = toolchain.link(FOLDER / "leon3.ld", LEON3_RAM=RAM, LEON3_RAM_SIZE=RAM_SIZE, LEON3_CLOCK=CLOCK)
    return build.program(folder, name, [*SUPPORT, *sources], [*includes, build.ROOT], toolchain.COMPILER,
                         [*toolchain.headers(), *flags], linked, machine=toolchain.MACHINE)


class Leon3(Target):
    """The program of targets/leon3 on the project's emulator."""

    name = "leon3"
    about = "a LEON3 board, emulated; no operating system"
    emulated = True
    cpu_of = "simulated"
    needs: tuple[str, ...] = (toolchain.COMPILER,)

    def build(self, part: Part) -> Path:
        return program(part.folder / "leon3", part.mission.name,
                       [*part.sources(), *(build.ROOT / path for path in SHARED), FOLDER / "main.c"], part.includes())

    def command(self, built: Path, record: str) -> list[str]:
        tables = built.parent.parent / f"tables/{built.name}.so"
        return [str(build.native("fledge_leon3", "emulator/tools")), str(BOARD), str(built.resolve()), "--tables",
                str(tables.resolve()), "--registers", "{registers}", "--record", record]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, toolchain.SIZE)

    def _flown(self, built, record, figures):
        join_starts(record)
        flown = super()._flown(built, record, figures)
        flown.cpu_of = self.cpu_of
        return flown


class Leon3Qemu(Leon3):
    """The same program on stock QEMU, which knows nothing of the project."""

    name = "leon3-qemu"
    about = "the same program on stock QEMU"
    cpu_of = "emulated"
    needs = (*Leon3.needs, "qemu-system-sparc", "gcc")

    def build(self, part: Part) -> Path:
        super().build(part)
        sources = [*part.sources(), *(build.ROOT / path for path in build.TABLES), FOLDER / "qemu.c",
                   build.ROOT / "targets/mission_io.c",
                   *(build.ROOT / f"registers/{name}.c" for name in ("clock", "message", "shared_file"))]
        return build.program(part.folder / self.name, part.mission.name, sources, part.includes())

    def command(self, built: Path, record: str) -> list[str]:
        return [str(built.resolve()), str(self.guest(built).resolve()), str(RAM_SIZE), record, "{registers}"]

    def sizes(self, built: Path) -> tuple[int, int]:
        return super().sizes(self.guest(built))

    @staticmethod
    def guest(built: Path) -> Path:
        """The program of the board."""
        return built.parent.parent / Leon3.name / built.name


class Leon3Cfs(Leon3):
    """The app of the core Flight System on the board, with the pocket cFE."""

    name = "leon3-cfs"
    about = "an app of the core Flight System on the board, on the pocket cFE"
    app = cfs.App("fsw", order="big")

    def build(self, part: Part) -> Path:
        folder = (part.folder / self.name).resolve()
        app = folder / self.app.name
        written = cfs.write(part.mission, self.app, app, part.board_files(), (), part.roots[:-1], watched=True)
        for old in {file for file in app.rglob("*") if file.is_file()} - set(written):
            old.unlink()                # of an earlier export
        files = {f"/cf/{file.name}": file.read_bytes() for file in sorted((app / "cf").iterdir())}
        write_files({"apps.c": around.app_list([self.app]),
                     "files.c": files_in_memory(files | {"/cf/cfe_es_startup.scr": around.startup(self.app).encode()}),
                     **{f"inc/{name}": text for name, text in around.wrappers(self.app).items()}}, folder)
        own = [file for file in (app / "fsw/src").rglob("*.c") if file.name not in LEFT_OUT]
        pocket = [file for file in around.pocket_sources() if file.name not in ("host.c", "port_posix.c")]
        return program(folder, part.mission.name,
                       [*sorted(own), folder / "apps.c", folder / "files.c", *pocket, FOLDER / "port.c",
                        FOLDER / "cfs.c"],
                       [app, folder / "inc", app / "fsw/inc", app / "fsw/src", build.ROOT / "targets/cfs/inc"],
                       ["-DPOCKET_TASKS=8u", "-include", f"{self.app.name}_names.h"])


LEFT_OUT = {"fsw_attach.c", "watch.c", "file_sink.c"}     # what cfs.c has in place of them


def files_in_memory(files: Mapping[str, bytes]) -> str:
    """C with these files: path -> bytes."""
    lines = ["/* SPDX-License-Identifier: Apache-2.0 */", '#include "targets/leon3/cfs.h"', ""]
    for i, content in enumerate(files.values()):
        lines += [f"static const uint8 file_{i}[] = {{", *wrap([f"{byte}," for byte in content], "    ", "    "), "};"]
    return "\n".join([*lines, "const Leon3File leon3_files[] = {",
                      *(f'    {{"{path}", file_{i}, sizeof file_{i}}},' for i, path in enumerate(files)), "};",
                      f"const uint32 leon3_files_n = {len(files)};", ""])
