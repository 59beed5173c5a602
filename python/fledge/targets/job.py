# SPDX-License-Identifier: Apache-2.0
"""A flight: a scenario of a mission, its flight processes exported once for all targets, and its duration."""
from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import export
from fledge.commands import Kind, Report, Timed, decoded, read_script, script, sequence_of
from fledge.commands.scripts import unframed
from fledge.errors import Failure
from fledge.frames import FILE
from fledge.mission.folder import without_preset
from fledge.objects import project
from fledge.targets import build
from fledge.targets.rehearsal import Rehearsal, rehearse

if TYPE_CHECKING:
    import numpy as np

    from fledge.archive import Archive
    from fledge.export.read import Mission
    from fledge.frames import Frames
    from fledge.targets.target import Target
    from registers.description import Board


class Part:
    """A flight process of a job, exported. All files go into `folder`, the exported ones into its c/.

    boards: files of boards that its messages pass, or folders of them; none: a board that carries them whole.
    """

    def __init__(self, job: Job, mission: Mission, boards: Sequence[Path | str], folder: Path) -> None:
        self.job, self.mission, self.process, self.folder = job, mission, mission.process, folder
        self.texts = export.board.texts_of(Path(path).resolve() for path in boards)
        self.boards = [path for path, _ in self.texts]
        self.instants: Any = None       # [ns] of the desktop's flight
        self.built: dict[Target, Path] = {}     # what each target has built of it
        self.script: list[Timed] = []   # its commands, once the scenario has been rehearsed
        self.by_radio: bool = any(flight == mission.process for _, flight in job.start.kernel.carriers)
        if fed := [port for port in mission.inputs if port.fed]:
            raise Failure("\n".join(f"{port.path} is fed {port.fed}, and no program does that for a target: wire it "
                                    "to a model of the world" for port in fed))
        self.outputs = [export.host.topic(m.path) for m in mission.outputs]
        self.files = (export.emit_board(mission, self.boards) | export.emit_commands(mission)
                      | export.emit_host(mission))
        self.rounds = any(field.carries for board in self.described() for snorkel in board.snorkels
                          for field in snorkel.fields)      # some numbers pass as counts

    @property
    def frames(self) -> Frames | None:
        """What its queues carry instead of packets."""
        return export.dictionary(self.mission).frames

    @property
    def keys(self) -> Path | None:
        """The file of keys of a secured link."""
        return self.mission.place / FILE if self.frames and self.frames.secured and self.mission.place else None

    def take_script(self) -> None:
        """Take its commands from the job's. Raises Failure if its boards carry none."""
        self.script = [Timed(after, packet) for after, process, packet in self.job.script if process == self.process]
        if self.script and self.boards and not any(lane.carries == "commands" for board in self.described()
                                                   for lane in board.lanes):
            raise Failure(f"the scenario {self.job.scenario} changes {self.process} between its runs, by commands, "
                          f"which no snorkel of {', '.join(path.name for path in self.boards)} carries; add one with "
                          "carries = \"commands\"")

    def compared(self, *records: Archive) -> list[str]:
        """The topics to compare: the outputs, and the modes and activity if any of the records has them."""
        own = (f"/{self.process}/{name}" for name in ("mode", "activity"))
        return self.outputs + [topic for topic in own if any(topic in record.topics for record in records)]

    @cached_property
    def written(self) -> list[Path]:
        """The paths of all exported files, which this writes."""
        return export.write(self.mission, self.folder / "c", self.files)

    def board_files(self) -> list[Path]:
        """The files of the given boards, or that of the mission's own board, which this writes."""
        return self.boards or [path.resolve() for path in self.written if path.suffix == ".toml"]

    def write_script(self) -> Path:
        """The file of its commands, for the node of the board."""
        frames = self.frames
        units = [Timed(command.t, frames.command(command.packet)) for command in self.script] if frames else self.script
        return export.write_files({"script.txt": script(units)}, self.folder)[0]

    def telemetry(self, target: str) -> Path:
        """The file of the packets that it sent on a target: lines as of the script."""
        return self.folder / f"{target}.telemetry.txt"

    def unequal_telemetry(self, target: str) -> str:
        """Where its telemetry on a target is not the desktop's, but for texts of scripts; "" if it is, or if its boards
        carry none."""
        if not self.telemetry(target).exists():
            return ""
        sent = [self._sent(place) for place in ("desktop", target)]
        dictionary = export.dictionary(self.mission)
        if sent[0] != sent[1] and not dictionary.frames:
            sent = [[timed for timed in packets if decoded(dictionary, timed.packet).path != "texts"]
                    for packets in sent]
        for here, there in itertools.zip_longest(*sent):
            if here != there:
                first = min(command.t for command in (here, there) if command)
                return f"telemetry differs from t = {first / 1e9:.9g} s on"
        return ""

    def _sent(self, target: str) -> list[Any]:
        return read_script(self.telemetry(target).read_text(encoding="utf-8"))

    def reports(self, target: str) -> list[Report]:
        """The reports of commands among them."""
        return self._contents(target, "reports")

    def refusals(self, reports: Iterable[Report]) -> list[tuple[str, bool]]:
        """(which command was refused, when and why; whether flight refused it in the scenario on the desktop, too) of
        those of the reports that are refusals."""
        # PDUs are counted apart, and what flight has itself not at all.
        sent = {(sequence_of(command.packet), *command.packet[6:7], False): command.packet for command in self.script}
        dictionary = export.dictionary(self.mission)
        return [(dictionary.refusal(report, sent.get((report.sequence, report.code, report.own))),
                 (self.process, report.sequence) in self.job.in_vain) for report in reports if not report.good]

    def failures(self, target: str) -> list[str]:
        """What went wrong there in updates of the script, the last text of each module."""
        texts = [content.text for content in self._contents(target, "texts") if content.kind is Kind.SCRIPT]
        return list({text.partition(",")[0]: text for text in texts}.values())

    def _contents(self, target: str, path: str) -> list[Any]:
        """Those of the packets of a kind."""
        dictionary = export.dictionary(self.mission)
        packets = self._sent(target) if self.telemetry(target).exists() else []
        if dictionary.frames:
            packets = list(unframed(dictionary.frames, packets))
        decodings = (decoded(dictionary, timed.packet) for timed in packets)
        return [telemetry.content for telemetry in decodings if telemetry.path == path]

    def bounds(self) -> list[tuple[str, float, float, str]]:
        """(field, how much it may differ from the desktop's, [s] from when on, "file:line") by the files of the
        boards."""
        return [(bound.field, bound.at_most, bound.after, f"{board.file}:{bound.line}") for board in self.described()
                for bound in board.bounds if bound.scenario in (None, self.job.scenario)]

    def described(self) -> list[Board]:
        """The boards that were given, as data."""
        return export.board.read(self.mission, self.texts) if self.texts else []

    @property
    def roots(self) -> list[Path]:
        """The folders with headers and sources of modules."""
        own = project.folder()
        return [*self.job.roots, *([own] if own else []), build.ROOT]

    def sources(self) -> list[Path]:
        """All sources of flight: the exported ones, those of its modules, of commands, and flight/math."""
        return self._with_modules(self.written)

    def _with_modules(self, written: Sequence[Path]) -> list[Path]:
        return [*(path.resolve() for path in written if path.suffix == ".c"),
                *build.module_sources(self.mission, self.roots), *build.math_sources(),
                *(build.ROOT / path for path in build.COMMAND)]

    def includes(self) -> list[Path]:
        return [(self.folder / "c").resolve(), *self.roots]

    def table_sources(self) -> list[Path]:
        """The sources of the mission and its boards as data for the outside, which runs no function of flight."""
        data = replace(self.mission, modules=[replace(module, script="") for module in self.mission.modules])
        written = export.write(data, self.folder / "c", self.files)
        return [*self._with_modules(written), *(build.ROOT / path for path in build.TABLES)]

    def tables(self) -> Path:
        """A shared object of it for this machine."""
        sources = self.table_sources()
        return build.program(self.folder / "tables", f"{self.mission.name}.so", sources, self.includes(),
                             flags=["-fPIC"], link=["-shared", "-Wl,-z,defs"], entry="fledge_mission")

    def fields(self) -> list[str]:
        """The names of all numbers that it puts out: "flight.tracking.error.sigma_BR"."""
        return [re.sub(r"\[\d+\]", "", f"{m.path}.{name}") for m in self.mission.outputs
                for name, _, _ in export.leaves(m.struct.fields)]

    def puts_out(self, field: str) -> bool:
        """Whether `field` is the end of the name of one of them: "tracking.error.sigma_BR"."""
        return any(f".{known}".endswith(f".{field}") for known in self.fields())

    def is_instant(self, t: np.ndarray) -> np.ndarray:
        """Of an array of times [ns], which are its: on the grid of any of its tasks. Once the desktop has flown, only
        those at which a task was active there: a target also ticks when none is."""
        import numpy as np

        if self.instants is not None:
            return np.isin(t, self.instants)
        instants = np.zeros(len(t), bool)
        for task in self.mission.tasks:
            instants |= (t >= task.offset) & ((t - task.offset) % task.period == 0)
        return instants

    def step(self) -> int:
        """[ns] The widest grid that has all of its instants."""
        return math.gcd(*(n for task in self.mission.tasks for n in (task.period, task.offset)))


class Job:
    """A mission's scenario before its run. All files go into `folder`; with several flight processes, into a folder in
    it for each.

    scenario: its name; None: the mission's first. duration: [s]; None: as long as the scenario runs. The desktop
    rehearses the scenario: its changes of flight between its runs go to targets as commands.
    boards: files of boards, or folders of them, by flight process; "" stands for the only one. free: take no scenario.
    before: a function of the job, called when all is known but what the rehearsal finds: duration, script, whole,
    in_vain.
    judged: judge the requirements that the scenario shows, too: `problem` and `outcomes` are the verdict.
    parameters: of the mission, as fledge.load() takes them. roots: further folders with headers and sources of
    modules.
    """

    def __init__(self, mission: str, scenario: str | None = None, duration: float | None = None, seed: int = 0,
                 boards: Mapping[str, Sequence[Path | str]] | None = None, folder: Path | str | None = None,
                 free: bool = False, parameters: dict[str, Any] | None = None, roots: Sequence[Path] = (),
                 before: Callable[[Job], None] = lambda job: None, judged: bool = False) -> None:
        self.source, self.parameters, self.seed = mission, parameters or {}, seed    # as other programs are to load it
        self.roots = list(roots)

        def begin(play: Rehearsal) -> None:
            self._begin(play, boards or {}, folder)
            before(self)

        play = rehearse(mission, scenario, duration, seed, free, self.parameters, begin, judged)
        assert play.duration is not None
        self.duration, self.script, self.whole, self.in_vain = play.duration, play.script, play.whole, play.in_vain
        # Of a whole scenario on the desktop.
        self.checked, self.problem, self.outcomes = play.checked, play.problem, play.outcomes
        for part in self.parts:
            part.take_script()

    def _begin(self, play: Rehearsal, boards: Mapping[str, Sequence[Path | str]], folder: Path | str | None) -> None:
        """What is known before the rehearsal flies."""
        self.scenario, self.start, self.begun = play.name, play.start, play.begun
        self.title = play.missions[0].folder
        self.folder = Path(folder) if folder else Path("runs") / self.title / "fly"
        several = len(play.missions) > 1
        known = [mission.process for mission in play.missions]
        own = {known[0] if process == "" and not several else process: files
               for process, files in boards.items()}
        for process in own:
            if process not in known:
                raise Failure(f"a board is of a flight process; write PROCESS=FILE, with one of {', '.join(known)}"
                              if process == "" else self.unknown(process, known))
        self.parts = [Part(self, mission, own.get(mission.process, ()),
                           self.folder / mission.process if several else self.folder)
                      for mission in play.missions]

    @cached_property
    def fresh(self) -> Any:
        """The simulation as the files make it that a target can run: without preset.py and the scenario."""
        return without_preset(self.source, **self.parameters)

    @cached_property
    def own(self) -> dict[str, Mission]:
        """Its flight processes by name."""
        return {mission.process: mission for mission in export.read_all(self.fresh)}

    def unknown(self, process: str, known: Sequence[str]) -> str:
        return f"{self.title} has no flight process '{process}'; it has {', '.join(known)}"

    def part(self, process: str) -> Part:
        """The flight process of that name."""
        for part in self.parts:
            if part.process == process:
                return part
        raise Failure(self.unknown(process, [part.process for part in self.parts]))

    @property
    def others(self) -> list[str]:
        """The names of the processes that are no flight, and have something to step."""
        flights = [part.process for part in self.parts]
        return [process.name for process in self.start.processes if process.tasks and process.name not in flights]

    @property
    def rounds(self) -> bool:
        return any(part.rounds for part in self.parts)

    @property
    def boards(self) -> list[Path]:
        """The files of boards that the user gave."""
        return [path for part in self.parts for path in part.boards]

    def bounds(self) -> list[tuple[str, float, float, str]]:
        """Those of all flight processes."""
        return [bound for part in self.parts for bound in part.bounds()]

    def exchange(self, target: str) -> Path:
        """The path for the record of what the processes read of each other; it is written where boards may round,
        delay or lose messages."""
        return self.folder / f"{target}.exchange.mcap"
