# SPDX-License-Identifier: Apache-2.0
"""The archive of a month at 10 packets of 108 bytes a second, of ten containers in turn: what it takes to write and to
find one parameter of one day again, all values or 2000 points, and a page of the newest packets."""
from __future__ import annotations

import struct
import tempfile
import time
from pathlib import Path

from bench.rows import Rows

SECOND, DAY, MONTH = 10**9, 86400, 30 * 86400
RATE, CONTAINERS, NUMBERS = 10, 10, 25


def xtce() -> str:
    """Packets of an identifier and as many numbers of 32 bits, one container of each identifier."""
    def entries(names):
        return "<EntryList>" + "".join(f'<ParameterRefEntry parameterRef="{name}"/>' for name in names) + "</EntryList>"

    names = ["id", "spare", *(f"p{k}_{i}" for k in range(CONTAINERS) for i in range(NUMBERS))]
    heirs = "".join(
        f'<SequenceContainer name="C{k}">{entries([f"p{k}_{i}" for i in range(NUMBERS)])}<BaseContainer '
        f'containerRef="Packet"><RestrictionCriteria><Comparison parameterRef="id" value="{k}"/></RestrictionCriteria>'
        "</BaseContainer></SequenceContainer>" for k in range(CONTAINERS))
    parameters = "".join(f'<Parameter name="{name}" parameterTypeRef="u32"/>' for name in names)
    return ('<SpaceSystem name="S"><TelemetryMetaData><ParameterTypeSet><IntegerParameterType name="u32">'
            '<IntegerDataEncoding sizeInBits="32"/></IntegerParameterType></ParameterTypeSet>'
            f'<ParameterSet>{parameters}</ParameterSet><ContainerSet><SequenceContainer name="Packet" abstract="true">'
            f'{entries(["id", "spare"])}</SequenceContainer>{heirs}</ContainerSet></TelemetryMetaData></SpaceSystem>')


def add_rows(rows: Rows, runs: int) -> None:
    from fledge import _ground

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "s.xml").write_text(xtce(), encoding="utf-8")
        database = _ground.Database.read([(f"{folder}/s.xml", "")])
        places = [database.containers.index(f"/S/C{k}") for k in range(CONTAINERS)]
        archive = _ground.PacketArchive(folder, "craft", database)
        began = time.perf_counter()
        for i in range(MONTH * RATE):
            k = i % CONTAINERS
            archive.put(i * (SECOND // RATE), i, struct.pack(">27I", k, 0, i, *range(1, NUMBERS)), places[k])
            if i % 1000 == 999:
                archive.save()
        archive.close()
        rows.add("archive, a month", "written", MONTH * RATE / (time.perf_counter() - began) / 1e6, "million packets/s")
        size = sum(path.stat().st_size for path in (Path(folder) / "craft").iterdir())
        rows.add("archive, a month", "size", size / 1e9, "GB")

        def spent(ask, count):
            began = time.perf_counter()
            found = ask(_ground.History(folder, "craft", database))
            assert len(found) == count, f"{len(found)} found, {count} are there"
            return time.perf_counter() - began

        day = (17 * DAY * SECOND, 18 * DAY * SECOND - 1)
        for figure, ask, count in (
                ("a day of one parameter, all values", lambda store: store.series(["p3_0"], *day)["p3_0"][1], DAY),
                ("a day of one parameter, 2000 points", lambda store: store.series(["p3_0"], *day, 2000)["p3_0"][1],
                 2000),
                ("a day of a parameter of all packets", lambda store: store.series(["spare"], *day)["spare"][1],
                 DAY * RATE),
                ("the newest 100 packets", lambda store: store.packets(limit=100, backwards=True), 100),
                ("the sessions", lambda store: store.sessions(), 1)):
            rows.add("archive, a month", figure, [spent(ask, count) for _ in range(runs)], "s")
