# SPDX-License-Identifier: Apache-2.0
"""A computer with Linux, such as a Raspberry Pi, as a board: its program is built here and copied there, and ssh is the
line. A target without a folder: ssh:HOST, or ssh:USER@HOST. Nothing of Fledge need be on that computer."""
from __future__ import annotations

import shlex
from pathlib import Path

from fledge.errors import Failure
from fledge.serial_line import BY_SSH, name_of
from fledge.targets import build
from fledge.targets.bare import Process

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.targets.job import Part

# Its first argument is the line; the others are what is at its end.
JOINED = 'line=$1; shift; exec "$@" < "$line" > "$line"'


class Ssh(Process):
    """A process of Linux on a host. ssh: how ssh is called."""

    about = "a computer with Linux, by ssh"
    cpu_of = "line too"
    sources = (build.ROOT / "targets/linux/line.c", *Process.sources)

    def __init__(self, word: str, ssh: str = "") -> None:
        from fledge.targets import remote

        self.host, self.ssh, self.name = word.removeprefix(BY_SSH), ssh or remote.SSH, name_of(word)
        self.place = ""         # of the program there

    def check(self, part: Part) -> None:
        from fledge.targets import TARGETS, remote

        if not self.compiler:
            native = TARGETS[remote.target_for(self.host, self.ssh)]
            if missing := native.missing():
                raise Failure(f"{self.host} needs {' and '.join(missing)}, not installed here; ./fledge setup --on "
                              f"{native.name}")
            self.compiler = getattr(native, "compiler")
        super().check(part)

    def program_of(self, part: Part) -> Path:
        """Build its program, and leave it here."""
        self.check(part)
        return super().build(part)

    def build(self, part: Part) -> Path:
        from fledge.targets import remote

        built = self.program_of(part)
        self.place = remote.copy(built, self.host, self.ssh, f"fledge/{part.job.title}", f"{built.name}-line")
        return built

    def command(self, built: Path, record: str) -> list[str]:
        return ["sh", "-c", JOINED, "sh", "{line}", *shlex.split(self.ssh), "--", self.host, shlex.quote(self.place)]
