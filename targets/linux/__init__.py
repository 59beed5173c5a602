# SPDX-License-Identifier: Apache-2.0
"""A process of its own on this machine, or, cross-built, on another (aarch64, sparc64).

    main.c        the process: it flies tick by tick, with the clock of its registers, or with the machine's
    crash.c       what it says when a trap ends it
    inputs.py, .c what flight reads on the desktop, as a file that the process plays
    clock.py      a process by the machine's clock, with histograms; pace.c measures them
    relay.c       the outside of the registers for a program that talks to flight (targets/micropython/console.py)

Example:

    $ ./fledge fly nadir_spin --on linux --for 10min
"""
from __future__ import annotations

from pathlib import Path

from fledge.targets import build
from fledge.targets.target import Target

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.export.read import Mission
    from fledge.targets.job import Part

# The sources of the program besides the mission's.
RUNNER = ["targets/mission_io.c", "targets/mission_packets.c", "targets/mission_host.c", "targets/linux/main.c",
          "targets/linux/crash.c", "targets/linux/pace.c", "targets/linux/inputs.c", "record/mcap.c",
          "record/mcap_crc.c", "record/file_sink.c", "registers/lane.c", "registers/field.c", "registers/clock.c",
          "registers/message.c", "registers/shared_file.c"]

# The same of a mission with a secured link.
SECURED = ["ccsds/sdls.c", "ccsds/security/aes_gcm.c", "ccsds/security/key_file.c", "targets/linux/keys.c"]
KEYS = "link.keys"      # beside the program


def runner_of(mission: Mission) -> tuple[list[Path], list[str]]:
    """The sources of the program besides the mission's, and their flags: with a store in a folder if it has files."""
    files = any(m.type == "Files" for m in mission.modules)
    return ([build.ROOT / path for path in [*RUNNER, *["ccsds/store/posix_store.c"] * files]],
            ["-DFLEDGE_FILES"] * files)


class Linux(Target):
    """A process of its own."""

    about = "a process of its own on this machine"
    profiled_by = "process"
    compiler, size = "gcc", "size"
    link: tuple[str, ...] = ("-static", "-no-pie")  # one file, for a board, and for emulators without libraries
    runner: tuple[str, ...] = ()
    needs: tuple[str, ...] = ("gcc",)
    secures = True

    def build(self, part: Part) -> Path:
        runner, defines = runner_of(part.mission)
        sources = [*part.sources(), *runner]
        flags, link = ["-fno-pie", *defines], [*self.link]
        place = part.folder / self.name / KEYS
        place.unlink(missing_ok=True)
        if keys := part.keys:
            sources += [build.ROOT / path for path in SECURED]
            flags, link = [*flags, "-DFLEDGE_LINK_KEYS"], [*link, "-lbearssl"]
            place.parent.mkdir(parents=True, exist_ok=True)
            place.symlink_to(keys.resolve())    # the program reads the keys where they are: no copy of them is made
        return build.program(part.folder / self.name, part.mission.name, sources, part.includes(), self.compiler,
                             flags=flags, link=link)

    def command(self, built: Path, record: str) -> list[str]:
        keys = built.resolve().with_name(KEYS)
        secured = ["--keys", str(keys)] if keys.is_symlink() else []
        return [*self.runner, str(built.resolve()), "--record", record, *secured, "{registers}"]

    def sizes(self, built: Path) -> tuple[int, int]:
        return build.sizes(built, self.size)
