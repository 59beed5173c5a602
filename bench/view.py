# SPDX-License-Identifier: Apache-2.0
"""How long a record takes to be shown: a page from it, its first picture, and how smoothly it plays.

The record is the Earth imager over 16.5 hours, at 2 Hz: 100 MB. The browser is headless Chromium, which draws in
software where there is no graphics processor. A frame's time on the processor is that of all of the browser's programs:
on a machine that does nothing else, frames follow at that time divided by the processors that share it.
"""
from __future__ import annotations

import glob
import os
import tempfile
import time
from pathlib import Path

import fledge
from fledge import scene
from fledge.scene import foxglove, page
from fledge.scene.browser import PROGRAM, Browser
from fledge.units import hour, s

from bench.rows import Rows, options, report

NEEDS = ["view"]
HOURS = 16.5


def recorded(path: Path, hours: float) -> None:
    """Fly the imager, and write its record."""
    sim = fledge.load("earth_imager")
    f, w = sim.flight, sim.world
    sim.record(w.craft.state, w.wheels.speeds, f.base.reference, f.tracking.error, f.balance.command, every=0.5 * s)
    sim.plots = False
    sim.archive(path, mission="earth_imager", scenario=f"{hours:g} h")
    sim.run(hours * hour)
    sim.close_archive()


def processor(browser: Browser) -> float:
    """[s] The time that all programs of a browser have had on processors."""
    found = {}
    for name in glob.glob("/proc/[0-9]*/stat"):
        try:
            fields = Path(name).read_text().rpartition(")")[2].split()
        except OSError:
            continue
        found[int(name.split("/")[2])] = int(fields[1]), int(fields[11]) + int(fields[12])
    ours, more = {browser.pid}, True
    while more:
        more = {pid for pid, (parent, _) in found.items() if parent in ours} - ours
        ours |= more
    return sum(found[pid][1] for pid in ours if pid in found) / os.sysconf("SC_CLK_TCK")


def main(arguments: list[str]) -> None:
    chosen = options("view", arguments, 3)
    rows = Rows()
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "run.mcap"
        recorded(record, HOURS)
        rows.add("record", "size", record.stat().st_size / 1e6, "MB")
        begin = time.perf_counter()
        shown = scene.of(record)
        path = page.write(shown, Path(folder) / "view.html")
        rows.add("page", "time to write", time.perf_counter() - begin, "s")
        rows.add("page", "size", path.stat().st_size / 1e6, "MB")
        begin = time.perf_counter()
        both = foxglove.write(shown, record, Path(folder) / "run.scene.mcap")
        rows.add("for Foxglove", "time to write", time.perf_counter() - begin, "s")
        rows.add("for Foxglove", "size", both.stat().st_size / 1e6, "MB")
        if PROGRAM:
            in_browser(rows, path, chosen.runs)
    report(rows, chosen)


def in_browser(rows: Rows, path: Path, runs: int) -> None:
    opened = []
    with Browser(1280, 720) as browser:
        for _ in range(runs):
            browser.open(path)
            opened.append(float(browser.evaluate("document.querySelector('.fledge-view').dataset.opened")) / 1e3)
        rows.add("browser", "time to the first picture", opened, "s")
        count = "fledgeView.stage.renderer.info.render.frame"
        browser.evaluate("fledgeView.play(true)")
        time.sleep(4)       # the picture finds its resolution
        begin, frames, before = time.perf_counter(), browser.evaluate(count), processor(browser)
        time.sleep(8)
        frames, busy = browser.evaluate(count) - frames, processor(browser) - before
        rows.add("browser", "rate", frames / (time.perf_counter() - begin), "1/s", note="1280 x 720")
        rows.add("browser", "of a processor, per frame", 1e3 * busy / frames, "ms")
        rows.add("browser", "pixels drawn per pixel, along an edge", browser.evaluate("fledgeView.stage.ratio"), "-")
