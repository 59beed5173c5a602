# SPDX-License-Identifier: Apache-2.0
"""How fast the orbiter of Mars flies in one co-simulation, and which program takes the time.

    ./fledge bench orbiter
    ./fledge bench orbiter --repeat 100

It is missions/mars_orbiter/up.toml as fast as it goes: world, panel, flight on an emulated LEON3 by its boards, and the
server of the control room, which decodes and archives all telemetry. When Goldstone sees it, a command turns its
antenna to the Earth; a figure is of what follows the first packets. A program's part is the processor time of
its processes for a simulated second.

--repeat flies test 1 in place of that, so many times in a new process each, and compares a hash of all its telemetry.
"""
from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import fledge
from fledge import cli, ground
from fledge.cosim.up.processes import descendants
from fledge.errors import Failure, SetupError
from fledge.scene import bundle
from fledge.scene.browser import PROGRAM, Browser

from bench.rows import Rows, report
from missions.mars_orbiter.contact import RISE, turn_to_earth
from missions.mars_orbiter.insertion import telemetry

NEEDS = ["build cosim", "leon3", "ground", "build ground", "view"]
MISSION = Path(__file__).resolve().parents[1] / "missions/mars_orbiter"
LATEST = 300            # [s] for programs to start
SETTLES = 60            # [s] simulated, for a page to open
FIRST_TELEMETRY = 4 * 3600        # [s] simulated, until there is telemetry
PARTS = ("world", "panel", "board", "emulator", "controller", "ground", "up")
CASES = {"alone": None, "overview": ("#/overview", "document.body?.innerText.includes('orbiter')"),
         "view": ("#/view", "document.querySelector('.fledge-view')?.dataset.opened")}    # page, and when it is open
OUTPUTS = ("flight.tracking.error", "flight.filter.attitude", "flight.line.heading", "flight.time.time",
           "flight.protection.table")       # in telemetry besides what always is, as in test 1


def part(command: list[str]) -> str:
    """Of which program of the co-simulation a process is, by its command; "" for a guard."""
    program, words = Path(command[0]).name, " ".join(command[1:])
    if program.startswith("fledge_"):
        return {"fledge_controller": "controller", "fledge_board_node": "board", "fledge_leon3": "emulator"
                }.get(program, "")
    for words_of, name in ((" ground serve ", "ground"), (" fly ", "board"), (" node mars_orbiter world ", "world"),
                           (" node mars_orbiter panel ", "panel"), (" up ", "up")):
        if words_of in words:
            return name
    return ""


def used(pid: int) -> float:
    """[s] of processors that a process has had; 0 if it has ended."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def spent(up: int, browser: int | None) -> dict[str, float]:
    """Part -> [s] of processors so far."""
    found = dict.fromkeys(PARTS, 0.0)
    for pid in (up, *descendants(up)):
        try:
            command = Path(f"/proc/{pid}/cmdline").read_text(errors="replace").split("\0")
        except OSError:
            continue
        if name := part(command):
            found[name] += used(pid)
    if browser:
        found["browser"] = sum(map(used, (browser, *descendants(browser))))
    return found


def seen(port: int) -> Any:
    """The entry of the orbiter in the control room's server; {} before it serves."""
    try:
        with urlopen(f"http://127.0.0.1:{port}/api/crafts", timeout=30) as made:
            return json.load(made)[0]
    except OSError:
        return {}


def files(folder: Path, port: int) -> Path:
    """The mission's up.toml and the control room's file, as they are flown here."""
    (folder / "control_room.toml").write_text(
        f'port = {port}\nfolder = "{folder}/ground"\n[[craft]]\nname = "orbiter"\nmission = "{MISSION}"\n'
        'link = "cosim:flight?radio=world.radio"\nlight_time = 650\n', encoding="utf-8")
    text, n = re.subn(r"(?m)^pace .*$", "pace = 0", (MISSION / "up.toml").read_text(encoding="utf-8"))
    assert n == 1, "up.toml has no pace"
    path = folder / "up.toml"
    path.write_text(text, encoding="utf-8")
    return path


def fly(duration: float, page: tuple[str, str] | None) -> tuple[float, dict[str, float], float]:
    """(simulated seconds per second; part -> [s] of processors per simulated second; packets per simulated second)."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        browser = stack.enter_context(Browser(1280, 720)) if page else None
        pid = browser.pid if browser else None
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        folder = Path(name)
        with open(folder / "output", "w+", encoding="utf-8") as output:
            up = subprocess.Popen([sys.executable, "-P", "-m", "fledge.cli", "up", files(folder, port), "--out",
                                   folder / "run"], stdout=output, stderr=subprocess.STDOUT)
            try:
                def reach(t: float) -> Any:
                    """The orbiter at a time [s], as the server has it."""
                    end = time.monotonic() + LATEST + t
                    while not (craft := seen(port)) or int(craft["t_ns"]) < t * 1e9:
                        if up.poll() is not None or time.monotonic() > end:
                            output.seek(0)
                            raise Failure(f"the co-simulation does not come to {t:g} s:\n{output.read()}", 1)
                        time.sleep(0.1)
                    return craft

                def now() -> float:
                    return float(reach(0)["t_ns"]) / 1e9

                reach(RISE.value)
                with ground.connect(f"http://127.0.0.1:{port}/orbiter") as craft:
                    for output in OUTPUTS:
                        craft.command("telemetry", output, every=2)
                    turn_to_earth(craft, lambda span: reach(now() + span.value))
                while not reach(now() + 1)["packets"]:
                    if now() > FIRST_TELEMETRY:
                        raise Failure(f"after {FIRST_TELEMETRY} s no telemetry has come", 1)
                if browser and page:
                    browser.go(f"http://127.0.0.1:{port}/{page[0]}")
                    browser.wait_for(page[1])
                first = reach(now() + SETTLES)
                before, began = spent(up.pid, pid), time.monotonic()
                last = reach(int(first["t_ns"]) / 1e9 + duration)
                after, wall = spent(up.pid, pid), time.monotonic() - began
                if browser and browser.problems:
                    raise Failure(f"the page has problems: {browser.problems}", 1)
            finally:
                up.send_signal(signal.SIGINT)
                up.wait(60)
    simulated = (int(last["t_ns"]) - int(first["t_ns"])) / 1e9
    if last["undecoded"] or last["packets"] == first["packets"]:
        raise Failure(f"of {last['packets']} packets the ground has not decoded {last['undecoded']}", 1)
    return (simulated / wall, {name: (after[name] - before[name]) / simulated for name in after},
            (last["packets"] - first["packets"]) / simulated)


def measure(duration: float, runs: int, cases: list[str]) -> Rows:
    rows = Rows()
    for case in cases or CASES:
        flown = [fly(duration, CASES[case]) for _ in range(runs)]
        rows.add(case, "speed", [speed for speed, *_ in flown], "times real time",
                 note=f"{flown[0][2]:.1f} packets per simulated second")
        for name in flown[0][1]:
            rows.add(case, f"processor, {name}", [1e3 * parts[name] for _, parts, _ in flown], "ms per simulated s")
        rows.add(case, "processor, all", [1e3 * sum(parts.values()) for _, parts, _ in flown], "ms per simulated s")
    return rows


# ---- the same telemetry, always

def digest(packets: list[bytes]) -> str:
    return hashlib.sha256(b"".join(len(packet).to_bytes(4, "big") + packet for packet in packets)).hexdigest()


def on_desktop() -> tuple[int, str]:
    """Fly test 1: (how many packets, hash of all)."""
    sim = fledge.load(str(MISSION))
    packets = telemetry(sim.flight.commands)
    ground.perform(sim, "pointing.py")
    sim.flight.commands.take_packets()
    return len(packets), digest(packets)


def on_leon3() -> tuple[int, str]:
    """The same on the emulated board, through the four boards."""
    from fledge.commands import read_script

    with tempfile.TemporaryDirectory() as folder:
        if cli.main(["fly", str(MISSION), "pointing", "--on", "leon3", "--board", str(MISSION / "boards"), "--out",
                     folder]):
            raise Failure("test 1 does not pass on leon3", 1)
        text = Path(folder, "leon3.telemetry.txt").read_text(encoding="utf-8")
    packets = [entry.packet for entry in read_script(text)]
    return len(packets), digest(packets)


def repeat(times: int, on: str) -> list[tuple[int, str]]:
    """Fly test 1 so many times, each in a process that has flown nothing yet."""
    found = []
    for _ in range(times):
        done = subprocess.run([sys.executable, "-m", "bench.orbiter", on], check=True, capture_output=True, text=True)
        n, digits = done.stdout.split()[-2:]
        found.append((int(n), digits))
    return found


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="fledge bench orbiter", epilog="example: ./fledge bench orbiter --repeat 100")
    parser.add_argument("--duration", type=float, default=600, metavar="S", help="simulated, of each flight (default "
                        "%(default)s)")
    parser.add_argument("--runs", type=int, default=3, help="flights of each case (default %(default)s)")
    parser.add_argument("--repeat", type=int, metavar="N", help="fly test 1 N times, and compare its telemetry")
    parser.add_argument("--on", choices=("desktop", "leon3"), default="desktop",
                        help="of --repeat (default %(default)s)")
    parser.add_argument("--json", metavar="FILE", help="write the figures as a list of rows, too")
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"only these of {', '.join(CASES)}: the page that is "
                        "open")
    chosen = parser.parse_args(arguments)
    if wrong := set(chosen.cases) - set(CASES):
        parser.error(f"there is no case {', '.join(wrong)}; there are {', '.join(CASES)}")
    if chosen.duration <= 0 or chosen.runs < 1 or chosen.repeat is not None and chosen.repeat < 1:
        parser.error("--duration, --runs and --repeat are greater than 0")
    if chosen.repeat is None:
        bundle.build()
        if not PROGRAM:
            raise SetupError("this needs Chromium: ./fledge setup --test")
        report(measure(chosen.duration, chosen.runs, chosen.cases), chosen)
        return 0
    found = repeat(chosen.repeat, chosen.on)
    rows = Rows()
    rows.add(f"test 1 on {chosen.on}", "hashes of all telemetry", len(set(found)), "hashes",
             note=f"{chosen.repeat} runs; {found[0][0]} packets, sha256 {found[0][1]}")
    report(rows, chosen)
    return int(len(set(found)) > 1)


if __name__ == "__main__":
    print(*{"desktop": on_desktop, "leon3": on_leon3}[sys.argv[1]]())
