# SPDX-License-Identifier: Apache-2.0
"""SPICE's kernels of attitudes, CK (.bc), of type 3: quaternions over time, some with rates.

    for segment in ck.read("craft.bc", sclk.read("craft.tsc")):
        segment.at(segment.times[0])

Source: NAIF, "CK Required Reading", type 3.
"""
from __future__ import annotations

import os
from typing import Any

import numpy as np

from fledge.errors import SetupError
from fledge.files import daf
from fledge.files.ephemeris import RATES, AemSegment
from fledge.files.sclk import Sclk

KIND = "DAF/CK  "
TYPE = 3


def read(path: str | os.PathLike[str], clock: Sclk) -> list[AemSegment]:
    """The attitudes of a kernel, a segment for each span without a gap, at the times that its spacecraft's clock had:
    of REF_FRAME_B, the number of the instrument, relative to REF_FRAME_A, a name of daf.FRAMES or another's number.
    Where segments overlap, SPICE takes the last.
    Columns ANGVEL_X to ANGVEL_Z [rad/s] have the rates of a kernel that has them, in axes of REF_FRAME_A.

    Raises SetupError with the file, the segment and what is wrong, also for other types of segments.
    """
    file = daf.read(path, KIND)
    return [found for number, segment in enumerate(file.segments, 1) for found in _spans(file, number, segment, clock)]


def _spans(file: daf.Daf, number: int, segment: daf.Segment, clock: Sclk) -> list[AemSegment]:
    instrument, frame, kind, rates = segment.integers
    where, words = f"segment {number}, {segment.name}", segment.words
    if kind != TYPE:
        file.refuse(f"{where}: expected type {TYPE}; found {kind}")
    spans, count = (int(x) if 1 <= x <= len(words) and x == int(x) else 0 for x in (*words[-2:], 0)[:2])
    width = 7 if rates else 4
    ends = np.cumsum([width * count, count, (count - 1) // 100, spans, (spans - 1) // 100, 2])
    if not spans or not count or ends[-1] != len(words):
        file.refuse(f"{where}: is damaged: {count} attitudes in {spans} spans do not fill its {len(words)} words")
    rows, ticks, starts = words[:ends[0]].reshape(count, width), words[ends[0]:ends[1]], words[ends[2]:ends[3]]
    first = np.searchsorted(ticks, starts)
    beta = rows[:, :4]
    if not (np.all(np.isfinite(rows)) and np.all(np.abs(beta) < 2)
            and np.all(np.abs(np.linalg.norm(beta, axis=1) - 1) < 0.1)):
        file.refuse(f"{where}: is damaged: expected unit quaternions, and finite rates")
    if not (np.all(np.diff(ticks) > 0) and np.all(np.diff(starts) > 0) and first[0] == 0
            and np.array_equal(ticks[np.minimum(first, count - 1)], starts)):
        file.refuse(f"{where}: is damaged: expected ticks that increase, at which the spans begin")
    axes = daf.FRAMES.get(frame, str(frame))
    meta = {"OBJECT_NAME": segment.name, "OBJECT_ID": str(-clock.number), "REF_FRAME_A": axes,
            "REF_FRAME_B": str(instrument), "ATTITUDE_DIR": "A2B", "TIME_SYSTEM": "TDB",
            "INTERPOLATION_METHOD": "LINEAR", "INTERPOLATION_DEGREE": 1}
    if rates:
        meta |= {"ATTITUDE_TYPE": "QUATERNION/ANGVEL", "ANGVEL_FRAME": axes}
    found = []
    for begin, end in zip(first, np.append(first[1:], count)):
        within = ticks[begin:end]
        if within[0] > segment.last or within[-1] < segment.first:
            continue
        try:
            bounds = clock.ns([max(within[0], segment.first), min(within[-1], segment.last)])
            found.append(_span(clock, within, rows[begin:end],
                               {**meta, "USEABLE_START_TIME": int(bounds[0]), "USEABLE_STOP_TIME": int(bounds[1])}))
        except SetupError as error:
            file.refuse(f"{where}: {error}")
    return found


def _span(clock: Sclk, ticks: np.ndarray, rows: np.ndarray, meta: dict[str, Any]) -> AemSegment:
    # NAIF's quaternion turns vectors of A into those of B, ours the axes of A into those of B: its conjugate.
    span = AemSegment.of(meta, clock.ns(ticks), rows[:, :4] * [1, -1, -1, -1])
    if "ANGVEL_FRAME" in meta:
        span.table.columns.update(zip(RATES, rows[:, 4:].T))
    return span
