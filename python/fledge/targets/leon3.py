# SPDX-License-Identifier: Apache-2.0
"""A mission on a LEON3 board: on the project's emulator, on stock QEMU, and as an app of the pocket cFE."""
from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.export import cfs
from fledge.export.c_text import wrap
from fledge.export.cfs import around
from fledge.export.write import write_files
from fledge.targets import build
from fledge.targets import leon3_toolchain as toolchain
from fledge.targets.cfs import write_app
from fledge.targets.target import Target

if TYPE_CHECKING:
    from fledge.targets.job import Part

FOLDER = build.ROOT / "targets/leon3"
BOARD = build.ROOT / "emulator/boards/leon3.toml"
SUPPORT = [FOLDER / name for name in ("traps.S", "board.c", "runtime.c", "system.c")]
SHARED = ["targets/mission_io.c", "targets/mission_packets.c", "targets/mission_host.c", "record/mcap.c",
          "record/mcap_crc.c", "registers/lane.c", "registers/field.c", "registers/clock.c", "registers/message.c"]


def read_board(path: Path) -> dict[str, Any]:
    """A board's file."""
    with path.open("rb") as file:
        return tomllib.load(file)


def program(folder: Path, name: str, sources: Sequence[Path], includes: Sequence[Path], flags: Sequence[str] = (),
            board: Path = BOARD, archives: Sequence[Path] = ()) -> Path:
    """Build a program for a LEON3 board, with its board support."""
    described = read_board(board)
    linked = toolchain.link(FOLDER / "leon3.ld", LEON3_RAM=described["ram"]["base"],
                            LEON3_RAM_SIZE=described["ram"]["size"], LEON3_CLOCK=described["clock"])
    return build.program(folder, name, [*SUPPORT, *sources], [*includes, build.ROOT], toolchain.COMPILER,
                         [*toolchain.headers(), "-g", *flags], linked, machine=toolchain.MACHINE, archives=archives)


class Leon3(Target):
    """The program of targets/leon3 on the project's emulator."""

    name = "leon3"
    about = "a LEON3 board, emulated; no operating system"
    emulated = True
    profiled_by = "board"
    cpu_of = "simulated"
    needs: tuple[str, ...] = (toolchain.COMPILER,)
    board = BOARD

    def __init__(self, tools: Sequence[str] = ()) -> None:
        self.tools = tools      # further arguments of fledge_leon3

    def build(self, part: Part) -> Path:
        sources = [*part.sources(), *(build.ROOT / path for path in SHARED), FOLDER / "main.c", FOLDER / "recorder.c"]
        return program(part.folder / "leon3", part.mission.name, sources, part.includes(), board=self.board)

    def command(self, built: Path, record: str) -> list[str]:
        tables = built.parent.parent / f"tables/{built.name}.so"
        return [str(build.native("fledge_leon3", "emulator/tools")), str(self.board), str(built.resolve()), "--tables",
                str(tables.resolve()), "--registers", "{registers}", "--record", record, *self.tools]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, toolchain.SIZE)

    def _flown(self, built, record, figures):
        flown = super()._flown(built, record, figures)
        flown.cpu_of = self.cpu_of
        return flown


class Leon3Qemu(Leon3):
    """The same program on stock QEMU, which knows nothing of the project."""

    name = "leon3-qemu"
    about = "the same program on stock QEMU"
    profiled_by = ""
    cpu_of = "emulated"
    needs = (*Leon3.needs, "qemu-system-sparc", "gcc")
    guests: type[Leon3] = Leon3     # the target whose program it is

    def build(self, part: Part) -> Path:
        self.guests().build(part)
        sources = [*part.table_sources(), FOLDER / "qemu.c",
                   build.ROOT / "targets/mission_io.c",
                   *(build.ROOT / f"registers/{name}.c" for name in ("clock", "message", "shared_file"))]
        return build.program(part.folder / self.name, part.mission.name, sources, part.includes())

    def command(self, built: Path, record: str) -> list[str]:
        return [str(built.resolve()), str(self.guest(built).resolve()), str(read_board(self.board)["ram"]["size"]),
                record, "{registers}"]

    def sizes(self, built: Path) -> tuple[int, int]:
        return super().sizes(self.guest(built))

    def guest(self, built: Path) -> Path:
        """The program of the board."""
        return built.parent.parent / self.guests.name / built.name


class Leon3Cfs(Leon3):
    """The app of the core Flight System on the board, with the pocket cFE."""

    name = "leon3-cfs"
    cpu_of = "simulated, record too"
    about = "an app of the core Flight System on the board, on the pocket cFE"
    profiled_by = ""
    app = cfs.App("fsw", order="big")

    def build(self, part: Part) -> Path:
        folder = (part.folder / self.name).resolve()
        app = write_app(self.app, part, folder)
        files = {f"/cf/{file.name}": file.read_bytes() for file in sorted((app / "cf").iterdir())}
        write_files({"apps.c": around.app_list([self.app]),
                     "files.c": files_in_memory(files | {"/cf/cfe_es_startup.scr": around.startup(self.app).encode()}),
                     **{f"inc/{name}": text for name, text in around.wrappers(self.app).items()}}, folder)
        own = [file for file in (app / "fsw/src").rglob("*.c") if file.name not in LEFT_OUT]
        pocket = [file for file in around.pocket_sources() if file.name not in ("host.c", "port_posix.c")]
        return program(folder, part.mission.name,
                       [*sorted(own), folder / "apps.c", folder / "files.c", *pocket, FOLDER / "port.c",
                        FOLDER / "cfs.c", FOLDER / "recorder.c"],
                       [app, folder / "inc", app / "fsw/inc", app / "fsw/src", build.ROOT / "targets/cfs/inc"],
                       ["-DPOCKET_TASKS=8u", "-include", f"{self.app.name}_names.h"], self.board)


LEFT_OUT = {"fsw_attach.c", "shared_file.c", "watch.c", "file_sink.c"}      # what cfs.c has in place of them


def files_in_memory(files: Mapping[str, bytes]) -> str:
    """C with these files: path -> bytes."""
    lines = ["/* SPDX-License-Identifier: Apache-2.0 */", '#include "targets/leon3/cfs.h"', ""]
    for i, content in enumerate(files.values()):
        lines += [f"static const uint8 file_{i}[] = {{", *wrap([f"{byte}," for byte in content], "    ", "    "), "};"]
    return "\n".join([*lines, "const Leon3File leon3_files[] = {",
                      *(f'    {{"{path}", file_{i}, sizeof file_{i}}},' for i, path in enumerate(files)), "};",
                      f"const uint32 leon3_files_n = {len(files)};", ""])
