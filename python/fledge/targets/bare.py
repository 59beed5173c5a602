# SPDX-License-Identifier: Apache-2.0
"""The class of boards that fly behind a serial line, without an operating system or in a task of one: the mission's C,
the C of targets/bare, and the board's own few functions (targets/bare/port.h) are one program.

A board is a folder with a class that declares its compiler and its sources; targets/cortex_m7 is one. Its `emulator` is
the command of a machine that runs the program, with the line as its serial port.
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets import build
from fledge.targets.target import Target

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Sequence

    from fledge.targets.job import Part

# The sources of a program besides the mission's and the board's: of any board, and of one behind a line.
FLIGHT = [build.ROOT / path for path in (
    "targets/mission_io.c", "targets/mission_packets.c", "targets/mission_host.c", "targets/bare/main.c",
    "targets/bare/recorder.c", "record/mcap.c", "record/mcap_crc.c", "registers/lane.c", "registers/field.c",
    "registers/clock.c", "registers/message.c")]
LINE = [build.ROOT / path for path in (
    "targets/bare/line_board.c", "targets/bare/say.c", "targets/bare/fault.c", "registers/line.c")]


class Bare(Target):
    """A board behind a serial line."""

    cpu_of = "emulated"
    parts = ("loop",)
    compiler = ""                       # its gcc, "arm-none-eabi-gcc"; its `size` is called alike
    machine: tuple[str, ...] = ()       # the flags that select its processor
    library: tuple[str, ...] = ("--specs=picolibc.specs",)      # those that select its C library
    scripts: tuple[Path, ...] = ()      # the linker's, one after the other; none: that of the C library
    start = True                        # whether its sources begin the program, and not the C library
    sources: tuple[Path, ...] = ()      # the board's own: port.h's five functions, and how it starts
    flags: tuple[str, ...] = ()         # further flags of the compiler
    link: tuple[str, ...] = ()          # and of the linker
    line = "pty?baud=921600"            # of its node: fledge_board_node's --line
    # The command of a machine that runs a program: {program} stands for it, and {line} for the serial line.
    emulator: tuple[str, ...] = ()
    takes_gdb = True

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.addr2line = cls.compiler.removesuffix("gcc") + "addr2line"

    def __init__(self, tools: Sequence[str] = ()) -> None:
        self.tools = tools      # --gdb [ADDRESS:]PORT

    def program(self, folder: Path, name: str, sources: list[Path], includes: list[Path],
                flags: tuple[str, ...] = (), link: tuple[str, ...] = ()) -> Path:
        """Build a program of C for the board, with its own sources."""
        scripts: list[str | Path] = []
        for script in self.scripts:
            scripts += ["-T", script]
        return build.program(folder, name, [*sources, *self.sources], [*includes, build.ROOT], self.compiler,
                             [*self.library, "-g", f'-DTARGET="{self.name}"', *self.flags, *flags],
                             [*self.library, *["-nostartfiles"] * self.start, "-static", "-Wl,--build-id",
                              *scripts, *self.link, *link],
                             machine=self.machine)

    def check(self, part: Part) -> None:
        import re
        import subprocess

        from fledge.errors import Failure

        super().check(part)
        macros = dict(re.findall(r"^#define (\w+) (\w+)$", subprocess.run(
            [self.compiler, *self.machine, "-dM", "-E", "-x", "c", "/dev/null"], capture_output=True, text=True,
            check=True).stdout, re.M))
        # ARM: the sum of the sizes that its unit has, 8 bytes among them; RISC-V: the widest of them in bits.
        arm, risc_v = (int(macros.get(name, "0"), 0) for name in ("__ARM_FP", "__riscv_flen"))
        if "__ARM_ARCH" in macros and not arm & 8 or "__riscv" in macros and risc_v < 64:
            raise Failure(f"{self.name}: {' '.join(self.machine)} has no unit for double precision, and the compiler's "
                          "software for it has other bits (exp); take a processor with one, as a Cortex-M7 "
                          "(-mfpu=fpv5-d16) or an rv64gc")

    def build(self, part: Part) -> Path:
        from fledge.export.board import read, texts_of

        # Twice the boards' memory: there is a shadow of it (registers/line.h).
        room = sum(2 * board.size for board in read(part.mission, texts_of(part.board_files())))
        return self.program(part.folder / self.name, part.mission.name,
                            [*part.sources(), *FLIGHT, *LINE], part.includes(),
                            (f"-DFLEDGE_LINE_BYTES={room}",))

    def command(self, built: Path, record: str) -> list[str]:
        address = dict(zip(self.tools[::2], self.tools[1::2])).get("--gdb", "")
        waits = ["-S", "-gdb", f"tcp:{address if ':' in address else f':{address}'}"] if address else []
        return [*(word.format(program=built.resolve(), line="{line}") for word in self.emulator), *waits]

    def node_options(self, built: Path, record: str) -> list[str]:
        from fledge import elf

        return ["--line", f"{self.line}&build={elf.read(built).build_id}", "--line-record", record]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, self.compiler.removesuffix("gcc") + "size")


class Process(Bare):
    """A board that is a process of Linux."""

    library = ()
    start = False
    sources: tuple[Path, ...] = (build.ROOT / "targets/linux/line_io.c",)
    scripts = (build.ROOT / "targets/linux/line.ld",)
