# SPDX-License-Identifier: Apache-2.0
"""A target's flight in the place of flight: its outputs and packets come from records, and the world runs as always."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from fledge import export, objects
from fledge.errors import Failure

if TYPE_CHECKING:
    from fledge.archive import Archive
    from fledge.commands import Timed
    from fledge.mission.simulation import Simulation


def stand_in(sim: Simulation, records: dict[str, Archive], exchange: Archive | None = None,
             packets: Mapping[str, Sequence[Timed]] | None = None) -> None:
    """From its first run on, the processes of a simulation put out the messages of records, and say what the executives
    said there; none of their modules runs, so that parameters, modes and commands change nothing. Configuration is
    published as always.

    records: the record of each process by its name, of all outputs at all instants of flight
    exchange: the record of what other processes read of them, where boards round, delay or lose messages
    packets: the telemetry of each process that sent any, for a ground in the scenario
    """
    for name, record in records.items():
        process, core = sim.process(name), sim.kernel.process(name)
        topics = [_messages(record, f"/{name}/{topic}") for topic in ("mode", "activity")]
        if process.modes and not topics[0][0]:
            raise Failure(f"{record.path}: it has no /{name}/mode, so {name} cannot be judged by it")
        core.play_executive(*topics)
        if packets and name in packets:
            process.commands.play(packets[name])
        for module in dict.fromkeys(module for task in process.tasks for module in task.run):
            instance = process.instances[module]
            for field in objects.struct(instance).fields:
                if field.group == "out":
                    topic = export.host.topic(f"{name}.{module}.{field.name}")
                    if topic not in record.topics:
                        raise Failure(f"{record.path}: it has no {topic}, so {name} cannot be judged by it")
                    for source, sent in ((record, False), (exchange, True)):
                        if source and topic in source.topics:
                            core.play(getattr(instance, field.name), *_messages(source, topic), sent)


def _messages(record: Archive, topic: str) -> tuple[bytes, bytes]:
    """(times, messages) of what the record has."""
    return (record.time_ns(topic).tobytes(), record[topic].tobytes()) if topic in record.topics else (b"", b"")
