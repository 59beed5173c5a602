# SPDX-License-Identifier: Apache-2.0
"""A server of the control room and a page of its console in Chromium, for an hour: 10,332 values at 10 Hz from packets
by UDP, and a mission that the server flies, with a command each minute. The page shows all pages of the console in
turn. Each minute gives the memory of the server, and that of the page after a garbage collection; the figures are those
at a quarter of the time and at the end, and the growth of a straight line through the samples between."""
from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from bench.ground_server import CONTAINERS, Server, beside
from bench.rows import Rows, options, report
from fledge.errors import SetupError
from fledge.scene import bundle

NEEDS = ["ground", "view"]
PERIOD = 60         # [s] between samples
MISSION = '[[craft]]\nname = "imager"\nmission = "earth_imager"\nscenario = "contact"\nspeed = 10\n'
FIGURES = {"server, memory": ("MB", lambda sample: sample["memory"]),
           "page, heap": ("MB", lambda sample: sample["heap"] / 1e6),
           "page, nodes of the document": ("nodes", lambda sample: sample["nodes"]),
           "page, listeners of events": ("listeners", lambda sample: sample["listeners"])}


def growth(times: list[float], values: list[float]) -> float:
    """[1/h] of the straight line with the least squares; times [s]."""
    mean, middle = sum(times) / len(times), sum(values) / len(values)
    return 3600 * (sum((t - mean) * (v - middle) for t, v in zip(times, values)) /
                   sum((t - mean)**2 for t in times))


def fly(minutes: float) -> list[dict[str, Any]]:
    """A sample for each minute: time [s], memory [MB] of the server, and what console_soak.mjs prints."""
    samples: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        server = Server(Path(folder), MISSION)
        sender = beside("send", server.udp, 10 * CONTAINERS, 60 * minutes + 60)
        page = subprocess.Popen(
            ["node", Path(__file__).with_name("console_soak.mjs"),
             f"http://127.0.0.1:{server.http}", folder, bundle.folder() / "work/node_modules",
             shutil.which("chromium"), str(PERIOD)], stdout=subprocess.PIPE, text=True)
        try:
            assert page.stdout
            began = time.monotonic()
            while time.monotonic() - began < 60 * minutes:
                line = page.stdout.readline()
                assert line, "the page has ended"
                samples.append({**json.loads(line), "time": time.monotonic() - began, "memory": server.memory()})
                assert not samples[-1]["problems"], samples[-1]["problems"]
                server.ask("crafts/imager/send", {"name": "flight.noop", "arguments": {}})
                print(json.dumps(samples[-1]), flush=True)
        finally:
            page.kill()
            sender.kill()
            server.end()
    return samples


def main(arguments: list[str]) -> None:
    rows = Rows()
    chosen = options("console", arguments, 60)     # runs: minutes
    bundle.build()
    if not shutil.which("chromium"):
        raise SetupError("this needs Chromium: ./fledge setup --test")
    samples = fly(chosen.runs)
    samples = samples[len(samples) // 4:]
    for name, (unit, value) in FIGURES.items():
        values = [float(value(sample)) for sample in samples]
        rows.add(name, "at a quarter of the time", values[0], unit)
        rows.add(name, "at the end", values[-1], unit)
        rows.add(name, "growth in an hour", growth([sample["time"] for sample in samples], values), unit)
    rows.add("page", "updates", samples[-1]["updates"], "frames")
    report(rows, chosen)
