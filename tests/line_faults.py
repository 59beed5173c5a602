# SPDX-License-Identifier: Apache-2.0
"""The campaign of line faults: flights of a real mission on a board that is a process, through a line that is noisy,
cut or gone for a while, and with resets of the board. Each flight gives the bits of the undisturbed one, or names its
fault.

    python3 -m tests.line_faults [--runs 1000] [--seed 1] [--first 0] [--mission nadir_spin] [--duration 5]

The faults of a flight follow from the seed, its number, and how many bytes an undisturbed flight needs; they come at
numbers of bytes, not at times. A flight that is neither equal nor named is reported, with the command that repeats it.
"""
from __future__ import annotations

import argparse
import collections
import os
import random
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from fledge import cli
from fledge.cli.cosim import node as cli_node
from fledge.targets import Job, build
from tests.board_process import Process
from tests.waiting import PATIENCE

# Messages of fledge_board_node about faults. Noise alone needs none: the line corrects it.
NAMED = {"reset": r"the board was reset in ", "gone": r"the device has vanished in ",
         "silent": r"the board has been silent for ", "unheard": r"(nothing has|bytes have|frames have) come"}
AT_THE_START = "has vanished while it was opened"
RECORD_CUT = "the board was reset while it was sent"


class Plan(NamedTuple):
    """The faults of one flight."""
    options: str                            # of its line
    record: bool = True                     # whether the record of flight comes through the line
    flips: float = 0.0                      # the part of the bits that change
    losses: float = 0.0                     # and of the bytes that are lost, or come twice
    resets: tuple[int, ...] = ()            # the numbers of bytes after which the board is reset
    cuts: tuple[tuple[int, int], ...] = ()  # (from which byte, how many bytes are lost)
    gone: tuple[int, ...] = ()              # after which the device vanishes, and comes back
    cut_for_good: int = 0                   # after which nothing passes any more


def plan(seed: int, number: int, sizes: dict[bool, int]) -> Plan:
    """sizes: how many bytes an undisturbed flight needs, with its record and without."""
    rng = random.Random(f"{seed}/{number}")
    record = rng.random() < 0.5
    size = sizes[record]

    def places(most: int) -> tuple[int, ...]:
        return tuple(sorted(rng.randrange(size) for _ in range(rng.randint(1, most))))

    kind = rng.choices(["noise", "losses", "cuts", "gone", "reset", "resets", "all", "dead"],
                       [5, 3, 3, 3, 3, 3, 3, 1])[0]
    flips = 10 ** rng.uniform(-6, -4) if kind in ("noise", "all") else 0.0
    return Plan(f"reset={'end' if kind == 'reset' else 'go-on'}&cut={1.2 if kind == 'dead' else 300}",
                record, flips,
                10 ** rng.uniform(-5, -3) if kind in ("losses", "all") else 0.0,
                places(1 if kind == "reset" else 3) if kind in ("reset", "resets", "all") else (),
                tuple((at, rng.randint(1, 2000)) for at in places(3)) if kind in ("cuts", "all") else (),
                places(2) if kind in ("gone", "all") else (),
                rng.randrange(size) + 1 if kind == "dead" else 0)


class Line:
    """The line between the node, which opens `path`, and the board, at a socket."""

    def __init__(self, path: Path, faults: Plan, rng: random.Random) -> None:
        self.path, self.faults, self.rng = path, faults, rng
        self.ours, self.boards = socket.socketpair()
        self.ours.setblocking(False)
        self.passed, self.lost_until, self.seen = 0, 0, False
        self.resets, self.gone = list(faults.resets), list(faults.gone)
        self.master = -1
        self.plug()

    def plug(self) -> None:
        self.path.unlink(missing_ok=True)   # first: another program may have the next terminal of this number
        if self.master >= 0:
            os.close(self.master)
        self.master, other = os.openpty()
        os.set_blocking(self.master, False)
        self.path.symlink_to(os.ttyname(other))
        os.close(other)     # else this program has the device open

    def close(self) -> None:
        self.path.unlink(missing_ok=True)
        os.close(self.master)
        self.ours.close()

    def pump(self, board: subprocess.Popen[bytes]) -> None:
        """Pass the bytes that have arrived, at most 10 ms later."""
        ready, _, _ = select.select([self.master, self.ours], [], [], 0.01)
        if self.ours in ready:
            bytes_ = self.receive(lambda: self.ours.recv(4096))
            try:
                os.write(self.master, self.disturbed(bytes_, board))
            except OSError:
                pass        # the node has not opened it, or it is full: bytes are lost
        if self.master in ready:
            bytes_ = self.receive(lambda: os.read(self.master, 4096))
            if not bytes_:
                time.sleep(0.002)       # no program has the other end open
            try:
                self.ours.send(self.disturbed(bytes_, board))
            except OSError:
                pass

    @staticmethod
    def receive(read: Callable[[], bytes]) -> bytes:
        try:
            return read()
        except OSError:
            return b""

    def disturbed(self, bytes_: bytes, board: subprocess.Popen[bytes]) -> bytes:
        """The bytes that arrive at the other end."""
        out = bytearray()
        faults = self.faults
        for byte in bytes_:
            self.passed += 1
            if self.resets and self.passed >= self.resets[0]:
                del self.resets[0]
                board.send_signal(signal.SIGUSR1)
            if self.gone and self.passed >= self.gone[0]:
                del self.gone[0]
                self.plug()
                return b""
            for at, n in faults.cuts:
                if at == self.passed:
                    self.lost_until = at + n
            if self.passed < self.lost_until or 0 < faults.cut_for_good <= self.passed:
                continue
            if faults.losses and self.rng.random() < faults.losses:
                out += bytes([byte, byte]) * (self.rng.random() < 0.5)
                continue
            if faults.flips and self.rng.random() < 8 * faults.flips:
                byte ^= 1 << self.rng.randrange(8)
            out.append(byte)
        return bytes(out)


class Flight(NamedTuple):
    code: int | None    # of the node; None: it did not end
    text: str           # its output
    record: bytes       # of flight
    exchange: bytes     # the record of what flight and the world read of each other
    passed: int         # bytes through the line
    board: int | None   # exit code of the board's program; None: it still ran


class Campaign:
    def __init__(self, mission: str, duration: float, folder: Path) -> None:
        self.folder, self.duration = folder, duration
        self.job = Job(mission, duration=duration, folder=folder / "job")
        (part,) = self.job.parts
        (self.world,) = self.job.others
        if part.script:
            raise SystemExit(f"{mission} needs commands, which this campaign does not send")
        self.flight, self.program = part.process, Process().build(part).resolve()
        self.tables = part.tables().resolve()
        self.sim = self.job.begun()
        self.undisturbed = {record: self.fly(Plan("reset=end", record), random.Random(0), "undisturbed")
                            for record in (True, False)}
        for record, flown in self.undisturbed.items():
            if flown.code != 0 or bool(flown.record) != record or flown.exchange != self.undisturbed[True].exchange:
                raise SystemExit(f"the undisturbed flight failed:\n{flown.text}")

    def fly(self, faults: Plan, rng: random.Random, name: str, timeout: float = PATIENCE) -> Flight:
        run = f"faults-{os.getpid()}-{name}"
        common = ["--simulation", "faults", "--address", f"ipc://@fledge-{run}"]
        record, exchange, log = (self.folder / f"{run}.{end}" for end in ("mcap", "exchange.mcap", "log"))
        with log.open("wb") as out:
            world = self.fork_world(common, out.fileno())   # before the line, of which it would keep an end
            line = Line(self.folder / f"{run}.tty", faults, rng)
            board = subprocess.Popen([self.program, str(line.boards.fileno())], pass_fds=[line.boards.fileno()],
                                     stdout=out, stderr=out)
            line.boards.close()
            controller = subprocess.Popen(
                [build.native("fledge_controller", "cosim"), *common, "--until", repr(self.duration), "--seed", "0",
                 "--node", self.flight, "--node", self.world, "--join", "60", "--reply", "60",
                 "--record", exchange],
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            node = subprocess.Popen(
                [build.native("fledge_board_node", "cosim"), *common, "--node", self.flight, "--tables", self.tables,
                 "--patience", "30",
                 "--line", f"{line.path}?{faults.options}", *(["--line-record", record] if faults.record else [])],
                stdout=out, stderr=out)
            ends = time.monotonic() + timeout
            while node.poll() is None and time.monotonic() < ends:
                line.pump(board)
            code, ended = node.poll(), board.poll()
            line.close()
            if code == 0:
                controller.wait()   # it writes its record to the end
            for process in (node, controller, board):
                process.kill()
                process.wait()
            os.kill(world, signal.SIGKILL)
            os.waitpid(world, 0)
        flown = Flight(code, log.read_text(encoding="utf-8", errors="replace"),
                       *(path.read_bytes() if path.exists() else b"" for path in (record, exchange)), line.passed,
                       ended)
        for path in (record, exchange, log):
            path.unlink(missing_ok=True)
            path.with_name(path.name + ".part").unlink(missing_ok=True)
        return flown

    def fork_world(self, common: list[str], out: int) -> int:
        """The world's node, in a copy of this program, which has the mission loaded already."""
        options = cli.parsed(["node", self.job.source, self.world, self.job.scenario, *common])
        pid = os.fork()
        if pid == 0:
            try:
                os.dup2(out, 1)
                os.dup2(out, 2)
                cli_node._single(self.sim, self.job.scenario, self.world, options)
            finally:
                os._exit(0)
        return pid

    def verdict(self, faults: Plan, flown: Flight) -> str:
        """The result of a flight; begins with "WRONG" where it must not occur."""
        names = [name for name, text in NAMED.items() if re.search(text, flown.text)]
        if flown.code is None:
            return "WRONG: it did not end"
        if (flown.board or 0) < 0:
            return f"WRONG: signal {-flown.board} ended the board's program"
        undisturbed = self.undisturbed[faults.record]
        equal = (flown.record, flown.exchange) == (undisturbed.record, undisturbed.exchange)
        if flown.code == 0 and equal:
            return "equal"
        if flown.code != 0 and faults.gone and AT_THE_START in flown.text:
            return "ended, named"
        if not names:
            return f"WRONG: {'other bits' if flown.code == 0 else 'it ended'}, and no fault was named"
        if not faults.record and RECORD_CUT in flown.text:
            return "WRONG: it misses a record that no program takes"
        if not faults.resets and not faults.cut_for_good:
            return "WRONG: it did not get over faults that pass"
        if "begins flight there" in flown.text and "  flown    " in flown.text:
            cut = ", without the record" if RECORD_CUT in flown.text else ""
            return f"went on after a reset, named{cut}"
        return "other bits, named" if flown.code == 0 else "ended, named"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, usual in (("runs", 1000), ("seed", 1), ("first", 0)):
        parser.add_argument(f"--{name}", type=int, default=usual)
    parser.add_argument("--mission", default="nadir_spin")
    parser.add_argument("--duration", type=float, default=5.0, help="[s] of simulated time")
    parser.add_argument("--verbose", action="store_true", help="a line for each flight")
    options = parser.parse_args(arguments)
    verdicts: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        campaign = Campaign(options.mission, options.duration, Path(folder))
        sizes = {record: flown.passed for record, flown in campaign.undisturbed.items()}
        for number in range(options.first, options.first + options.runs):
            begin = time.monotonic()
            faults = plan(options.seed, number, sizes)
            flown = campaign.fly(faults, random.Random(f"{options.seed}/{number}/line"), str(number))
            verdict = campaign.verdict(faults, flown)
            verdicts[verdict] += 1
            if options.verbose:
                print(f"{number:5} {time.monotonic() - begin:6.2f} s  {verdict}; {faults}\n{flown.text}", flush=True)
            if verdict.startswith("WRONG"):
                print(f"{verdict}; {faults}\n    python3 -m tests.line_faults --mission {options.mission} --duration "
                      f"{options.duration} --seed {options.seed} --first {number} --runs 1\n{flown.text}", flush=True)
    for verdict, n in verdicts.most_common():
        print(f"{n:6}  {verdict}")
    return int(any(verdict.startswith("WRONG") for verdict in verdicts))


if __name__ == "__main__":
    sys.exit(main())
