# SPDX-License-Identifier: Apache-2.0
"""The class of all targets: places where a mission flies. A target builds the exported C, and gives the command that
starts it, and its size; all else is the same for all targets."""
from __future__ import annotations

import shutil
from pathlib import Path

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from fledge.targets.flown import Flown
    from fledge.targets.job import Part


class Target:
    """A place where an exported mission flies behind the registers of its boards.

    Its module imports nothing but the standard library before one of its functions is called, and neither fledge._core
    nor numpy: the launcher asks it what to install before anything is built."""

    name = ""                       # that of its folder, targets/NAME
    about = ""
    cpu_of = ""                     # what its processor time includes, or of which processor it is: "emulated"
    uses: tuple[str, ...] = ()      # other targets whose packages and programs it needs, and which must be prepared
    needs: tuple[str, ...] = ()     # programs that are not always there; the packages that have them: packages.txt
    parts: tuple[str, ...] = ("loop",)      # of Fledge's build, for a flight there: targets of CMake
    profiled_by = ""                # how `fledge profile` measures it: fledge.profile.METHODS; "": it cannot
    frames = True                   # whether a mission's SpaceLink frames what passes there
    secures = False                 # whether it has the cipher of a secured one
    takes_tools = False             # whether it is made with the options of a debugger, as Leon3 is
    takes_gdb = False               # the same of --gdb alone
    addr2line = ""                  # the program that knows the lines of its programs; "": these tell no addresses
    used: Sequence[Target] = ()     # those that it uses, once fledge.targets.TARGETS has made it

    def __init_subclass__(cls) -> None:
        package, _, module = cls.__module__.partition("fledge.targets.")
        if not package and module:
            cls.name = module.partition(".")[0].replace("_", "-")

    def with_used(self) -> list[Target]:
        """Itself and all targets that it uses."""
        return list(dict.fromkeys([self, *(target for used in self.used for target in used.with_used())]))

    def missing(self) -> list[str]:
        """The programs that are not installed."""
        programs = dict.fromkeys(program for target in self.with_used() for program in target.needs)
        if programs:
            programs["ninja"] = None    # which builds for all of them
        return [program for program in programs if not shutil.which(program)]

    def prepare(self) -> None:
        """Build what all programs of this target need, such as a C library, if it is not there."""

    def check(self, part: Part) -> None:
        """Raise Failure if a flight process cannot fly here, as far as that shows before anything is written."""
        from fledge.errors import Failure

        if part.frames and not self.frames:
            raise Failure(f"{self.name}: its bus carries packets; fly {part.mission.title} without its SpaceLink there")
        if part.frames and part.frames.secured and not self.secures:
            raise Failure(f"{self.name}: there is no BearSSL for it, which has the cipher of a secured link; fly "
                          f"{part.mission.title} with secured=0 there")
        for target in self.used:
            target.check(part)

    def build(self, part: Part) -> Path:
        """Build a flight process for this target, in part.folder / name; only what changed. Returns what `command`
        starts."""
        raise NotImplementedError

    def built(self, part: Part) -> Path:
        """The same, built once for all flights of a job."""
        if self not in part.built:
            part.built[self] = self.build(part)
        return part.built[self]

    def command(self, built: Path, record: str) -> list[str]:
        """The arguments that start it: {registers} stands for the register file; it writes all outputs of flight into
        `record`, a file in its working directory, and at its end prints lines of a key and a value, at least ticks and
        cpu_ns; what a script of its own did has keys that begin with "script."."""
        raise NotImplementedError

    def node_options(self, built: Path, record: str) -> list[str]:
        """Further options of the node of its board; one of a board behind a line writes the record."""
        return []

    def sizes(self, built: Path) -> tuple[int | None, int | None]:
        """(bytes of code and constants, bytes of memory), without the C library; None: not known."""
        return None, None

    def advice(self, log: str, part: Part) -> str:
        """What a user may do about a flight that ended early with this log, or where its program stopped; "" if neither
        is known."""
        if not self.addr2line or self not in part.built:
            return ""
        from fledge.targets import faults

        return faults.named(log, part.built[self], self.addr2line, part.mission, part.roots)

    def reason(self, log: str) -> str:
        """Why a flight ended early with this log, with the remedy, if that is known so well that nothing else counts;
        else ""."""
        return ""

    def prepared(self, part: Part, options: list[Any], timeout: float) -> tuple[list[Any], Callable[..., Flown]]:
        """(the command of its node in a run, a function from the figures that this prints to a Flown)."""
        from fledge.targets import flown, loop

        built, record = self.built(part), flown.new_record(part.folder, self.name)
        return (loop.board_node(part, [*options, "--node", part.process, "--reply", timeout,
                                       *self.node_options(built, record.name)],
                                self.command(built, record.name), self.name),
                lambda figures: self.flown(built, record, figures))

    def join(self, part: Part, address: str, simulation: str, node: str, keys: Path | str | None = None) -> Flown:
        """The same of one process, as a node of a run whose controller is at `address`; keys: of the node, else
        FLEDGE_KEYS."""
        from fledge.targets import flown, loop

        built, record = self.build(part), flown.new_record(part.folder, self.name, part=False)
        return self.flown(built, record, loop.join(
            part, self.command(built, record.name), self.name, address, simulation, node, keys,
            self.node_options(built, record.name)))

    def flown(self, built: Path, record: Path, figures: dict[str, str]) -> Flown:
        """The results of a flight, of what its programs printed."""
        from fledge.targets import flown

        return flown.results(record, figures, self.cpu_of, *self.sizes(built))
