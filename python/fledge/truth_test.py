# SPDX-License-Identifier: Apache-2.0
"""Every reader of a run shows a value that flight had, or says that there is none: random missions with modes, events,
late, lost and missing wires. FLEDGE_LONG=1 tries a hundred thousand of them."""

import csv
import math
import os
import random

import numpy as np
import pytest

import fledge
from fledge import objects, scene
from fledge.cosim.random_test import build
from fledge.montecarlo.requirements import Requirement
from fledge.montecarlo.shares import Series
from fledge.records.activity import happenings, modes
from fledge.scene.tracks import SHARE
from tests.circles import long_after

LONG = os.environ.get("FLEDGE_LONG", "") not in ("", "0")
DURATION = 0.6


def flown(seed, path=None):
    """(simulation, log of all its outputs) of a random mission."""
    sim = build(seed)
    dice = random.Random(seed)
    instances = [instance for process in sim.processes for instance in process]
    log = sim.record(*instances, every=dice.choice([0, 0.01, 0.05]))
    if path:
        sim.archive(path)
    sim.run(DURATION)
    sim.close_archive()
    return sim, log


def truth(log, port, name):
    """(values of a field, whether each was written), from the bytes that were recorded."""
    table = log.raw[port]
    written = np.array([row["head"]["sequence"] > 0 for row in table], bool)
    return np.array([row[name] for row in table], float).reshape(len(table), -1), written


def fields(log):
    for path in log.names:
        port, _, name = path.rpartition(".")
        if log.field(path).type != "struct":
            yield port, name, path


@pytest.mark.parametrize("seed", long_after(30, range(100_000 if LONG else 60), "more draws"))
def test_readers(seed, tmp_path):
    every = seed % 10 == 0  # files and figures take long
    sim, log = flown(seed, tmp_path / "run.mcap" if every else None)
    sources = [log] + ([fledge.Archive(tmp_path / "run.mcap")] if every else [])
    shown = {plot.name: plot.signal for plot in scene.of(log, plots_only=True).plots}
    for port, name, path in fields(log):
        values, written = truth(log, port, name)
        expected = np.where(written[:, None], values, np.nan)
        for source in sources:
            np.testing.assert_array_equal(np.array(source[path], float).reshape(len(values), -1), expected)
        np.testing.assert_array_equal(np.ravel(log.last(path)), expected[-1])
        signal = shown[path].thinned()
        if not len(signal.time):
            assert not written.any()
            continue
        found = signal.at(log.time_of(path))
        assert np.array_equal(np.isnan(found[:, 0]), ~written), path
        used = values[:, :found.shape[1]]
        assert np.nanmax(np.abs(found - used)) <= (
            1.001 * SHARE * np.ptp(used[written], axis=0).max() + 1e-14)
    if every:
        tables(sources[1], tmp_path)
        figure = log.plot(*[path for *_, path in fields(log)][:6])
        for axis, (port, name, path) in zip(figure.axes, fields(log)):
            values, written = truth(log, port, name)
            for k, line in enumerate(axis.lines):
                y = np.array(line.get_ydata())
                assert np.isnan(y[~written]).all()
                kept = ~np.isnan(y)     # a line is interrupted at a jump to the shadow set
                assert (y[kept] == values[kept, k]).all()
            assert written.any() or "never written" in [text.get_text() for text in axis.texts]


def tables(archive, folder):
    for path in archive.to_csv(folder / "csv"):
        with path.open(newline="") as file:
            rows = list(csv.reader(file))
        quality = rows[0].index("quality")
        head = rows[0].index("valid_at [s]")
        for row in rows[1:]:
            assert all((cell == "") == (row[quality] == "none") for cell in row[1:head])


@pytest.mark.parametrize("seed", long_after(30, range(100_000 if LONG else 60), "more draws"))
def test_what_executives_say_is_what_a_second_run_sees(seed):
    sim, _ = flown(seed)
    activity = {process.name: dict(modes(sim.activity)).get(process.name, []) for process in sim.processes}
    other = build(seed)
    seen, fired = {process.name: [] for process in other.processes}, []
    before = {}
    while True:
        other.step()
        if other.time > DURATION:
            break
        for process in other.processes:
            mode = process.active_mode
            if mode and (not seen[process.name] or seen[process.name][-1][1] != mode):
                seen[process.name].append((other.time, mode))
            for event in process.events.values():
                if event.fired_at is not None and event.fired_at != before.get((process.name, event.name)):
                    before[process.name, event.name] = event.fired_at
                    fired.append((event.fired_at, process.name, event.name))
    for process, rows in activity.items():
        assert [mode for _, mode in rows] == [mode for _, mode in seen[process]]
        assert rows[1:] == seen[process][1:]    # it says the first one at its first instant
        counted = {mode: sum(name == mode for _, name in rows) for _, mode in rows}
        for mode, (n, first) in sim.process(process).entered.items():
            assert n == counted.get(mode, 0)
            assert first == next((t for t, name in rows if name == mode), None)
    assert sorted((happening.t, happening.process, happening.name)
                  for happening in happenings(sim.activity) if happening.kind == "event") \
        == sorted(fired)


@pytest.mark.parametrize("seed", long_after(100, range(20_000 if LONG else 300), "more draws"))
def test_requirements_judge_only_what_exists(seed):
    dice = np.random.default_rng(seed)
    n = int(dice.integers(1, 6))
    quality = dice.choice([0, 1, 2, 3], n, p=dice.dirichlet([1, 1, 1, 1]))
    values = np.where(quality > 0, dice.integers(-2, 3, n), np.nan)
    comparison = str(dice.choice(["<", "<=", ">", ">=", "==", "!="]))

    class Of:
        def __init__(self, rows):
            self.rows = rows

        def samples(self, ns):
            return slice(0, len(ns))

        def values(self, _, part):
            return self.rows[None, part].astype(float)

    requirement = Requirement(Of(values), comparison, 0.0)
    requirement.quality = Of(quality)
    worst, time, holds = requirement.worst(Series(np.arange(n) * 10**9))
    there = [float(v) for v, q in zip(values, quality) if q > 0]
    fulfilled = [eval(f"{v} {comparison} 0.0") for v in there]
    assert holds[0] == (3 in quality and all(fulfilled))
    if 3 not in quality:
        assert math.isnan(worst[0]) and math.isnan(time[0]) == (not there)
    else:
        assert worst[0] in there and values[int(time[0])] == worst[0]
