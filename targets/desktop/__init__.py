# SPDX-License-Identifier: Apache-2.0
"""The run in one program, with which the other targets are compared. Beside targets, a `fledge node`.

Example:

    $ ./fledge fly nadir_spin --on desktop --for 10min
"""
from __future__ import annotations

from fledge.targets.target import Target

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from fledge.targets.flown import Flown
    from fledge.targets.job import Job, Part


class Desktop(Target):
    about = "the run in one program, under Python"
    parts = ()
    profiled_by = "desktop"

    def prepared(self, part: Part, options: list[Any], timeout: float) -> tuple[list[Any], Callable[..., Flown]]:
        from fledge.archive import Archive
        from fledge.targets import flown, loop

        record = flown.new_record(part.folder, "node")
        script = ["--script", part.write_script()] if part.script else []
        command = loop.python_node(part.job, part.process, [*options, "--patience", timeout, "--outputs", record,
                                                            *script])

        def results(_: dict[str, str]) -> Flown:
            with Archive(record) as archive:
                steps = int(part.is_instant(archive.time_ns(part.outputs[0])).sum())
                return flown.Flown(record, steps, None, "")

        return command, results

    def fly(self, job: Job, timeout: float = 60.0) -> dict[str, Flown]:
        from time import process_time

        from fledge import commands
        from fledge.archive import Archive
        from fledge.disk import write_files
        from fledge.targets import flown

        sim = job.begun()
        for part in job.parts:
            flight = sim.process(part.process)
            sim.record(*(getattr(getattr(flight, module), port) for module, port in
                         (m.path.split(".")[1:] for m in part.mission.outputs)), every=part.step() / 1e9)
            flight.commands.script(part.script)     # what comes before the first run, too, as a target has it
            flight.commands.take_units()
        record = flown.new_record(job.folder, self.name)
        sim.archive(record, mission=sim.name, target="desktop")
        start = process_time()
        try:
            sim.run(until=job.duration)
        finally:
            sim.close_archive()
        spent = process_time() - start
        with Archive(record) as archive:
            for part in job.parts:
                units = sim.process(part.process).commands.take_units()
                write_files({part.telemetry(self.name).name: commands.script(units)}, part.folder)
                times = archive.time_ns(part.outputs[0])
                for start, end in sim.process(part.process).outages:
                    times = times[(times < start) | (times >= end)]
                part.instants = times[part.is_instant(times)]
        total = sum(len(part.instants) for part in job.parts)
        return {part.process: flown.Flown(record, len(part.instants), spent / total if total else None,
                                          "world too", reports=sim.process(part.process).commands.reports)
                for part in job.parts}
