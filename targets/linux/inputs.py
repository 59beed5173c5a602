# SPDX-License-Identifier: Apache-2.0
"""What a flight process reads on the desktop, instant by instant, as a file that the Linux target plays
(targets/linux/inputs.h). Flight then computes the bits of the closed loop without the world."""
from __future__ import annotations

import struct
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.archive import Archive
from fledge.errors import Failure

if TYPE_CHECKING:
    from fledge.targets.job import Part

MAGIC = b"FINPUTS1"
COMMAND, INSTANT, MARK = 0xFFFFFFFF, 0xFFFFFFFE, 0xFFFFFFFD


def capture(part: Part, record: Path) -> list[tuple[int, list[tuple[int, bytes]]]]:
    """(t [ns], (id of a message or COMMAND, bytes) of all that comes before it) of each instant of a flight process.

    record: of its flight on the desktop. The desktop flies again; the record has the place of flight.
    """
    job, mission = part.job, part.mission
    instants: list = []
    sim = job.begun()
    sim.prepare()
    process = sim.process(part.process)
    inputs = [(id, getattr(process.instances[name], port)) for id, (_, name, port) in
              ((id, port.ends[0].split(".")) for id, port in enumerate(mission.inputs))]
    with Archive(record) as archive:
        played = []
        for output in mission.outputs:
            _, name, port = output.path.split(".")
            topic = f"/{output.path.replace('.', '/')}"
            messages = archive[topic]
            played.append((getattr(process.instances[name], port),
                           dict(zip(archive.time_ns(topic).tolist(), (row.tobytes() for row in messages)))))
    script = list(part.script)

    def instant(t: int) -> None:
        rows = [(id, kernel.incoming(view)) for id, view in inputs]
        while script and script[0].t < t:
            rows.append((COMMAND, script.pop(0).packet))
        instants.append((t, rows))
        for view, messages in played:
            if t in messages:
                kernel.put_out(view, messages[t])

    kernel = sim.kernel.process(part.process)
    kernel.fly_by(instant)
    for other in job.parts:
        if other is not part:
            sim.process(other.process).commands.script([command for command in other.script if command.t >= 0])
    sim.prepare()
    sim.run(until=job.duration)
    if process.outages:
        raise Failure(f"{job.title}: the scenario {job.scenario} resets the computer of {part.process}, which inputs "
                      "from a file cannot do; end before that, with --for")
    return instants


def write(path: Path, instants: list[tuple[int, list[tuple[int, bytes]]]], marks: Collection[int] = ()) -> Path:
    """Write them into a file, with marks in front of the instants of these indices."""
    marked = set(marks)
    with path.open("wb") as file:
        file.write(MAGIC if struct.pack("=H", 1) == b"\1\0" else MAGIC[::-1])
        for i, (t, rows) in enumerate(instants):
            for what, content in [*([(MARK, b"")] if i in marked else []), *rows, (INSTANT, b"")]:
                file.write(struct.pack("=qII", t, what, len(content)) + content + bytes(-len(content) % 8))
    return path
