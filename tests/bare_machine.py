# SPDX-License-Identifier: Apache-2.0
"""A program on the machine of a bare target, whose line is the standard input and output here."""
from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from fledge.targets import build
from fledge.targets.bare import Bare

# Without an operating system: output of a program, and the end of the machine at the end of the program.
CONSOLE = [build.ROOT / "targets/bare/testing/console.c", build.ROOT / "targets/bare/fault.c"]

ENDS = {"cortex-m7": build.ROOT / "targets/cortex_m7/testing/semihosting.c"}


def program(target: Bare, folder: Path, name: str, sources: Sequence[Path], *flags: str) -> Path:
    """Build a program that prints through its board's line."""
    ends = [ENDS[target.name]] if target.name in ENDS else []
    return target.program(folder, name, [*sources, *ends, *CONSOLE], [], flags, ("-lm",))


def printed(target: Bare, program: Path, *options: str) -> str:
    """The output of a program, which must end with status 0."""
    with Machine(target, program, *options) as machine:
        text = machine.process.communicate()[0].decode().replace("\r", "")
        assert machine.process.returncode == 0, text
    return text


class Machine:
    """Runs until its program ends it; leaving the context ends it, too."""

    def __init__(self, target: Bare, program: Path, *options: str) -> None:
        command = [word.format(line="stdio", program=program) for word in target.emulator]
        ends = ["-semihosting"] if target.name in ENDS else []
        self.process = subprocess.Popen([*command, *ends, *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.text = ""

    def __enter__(self) -> Machine:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.process.kill()
        self.process.communicate()

    def until(self, pattern: str) -> re.Match[str]:
        """The next match in the output of the program; later calls search behind it."""
        while not (match := re.search(pattern, self.text, re.MULTILINE)):
            assert self.process.stdout is not None
            more = self.process.stdout.read1(65536)
            assert more, f"it ended, and said no '{pattern}':\n{self.text}"
            self.text += more.decode(errors="replace").replace("\r", "")
        self.text = self.text[match.end():]
        return match

    def send(self, text: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(text.encode())
        self.process.stdin.flush()
