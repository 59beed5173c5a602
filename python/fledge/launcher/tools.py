# SPDX-License-Identifier: Apache-2.0
"""Programs that the launcher starts: their logs and progress, locks, and what it says when one fails.

What a tool installs or builds it leaves whole when the terminal stops it: Ctrl-C ends the launcher after the tool.
"""
from __future__ import annotations

import fcntl
import os
import re
import signal
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from fledge.errors import Failure

SMALLEST_DISK = 10_000 * 1024       # [bytes] with less free space a disk is called full

# Texts of a log, by what the machine lacks.
DISK = re.compile("No space left on device|enough free space")
MEMORY = re.compile("Killed signal|out of memory|annot allocate memory|failed to map segment")
NETWORK = re.compile("^E: (Failed|Unable) to fetch|Temporary failure resolving|Could not connect|ENOTFOUND|ECONN|"
                     "ETIMEDOUT", re.M)

REFUSED = re.compile(r"[^:]+\.(h|c|toml):[0-9]+: ")      # HEADER:LINE: RULE
WRONG = re.compile("^E: |Depends: .* but |[Ee]rror: |undefined reference|CMake Error")
NOISE = re.compile(r"--$|FAILED: |ninja: build stopped|/[^ ]*/bin/[^ :]+ |: && |cd .* && ")


def say(text: str) -> None:
    print(f"fledge: {text}", file=sys.stderr, flush=True)


# --- signals ---------------------------------------------------------------------------------------

def stop(number: int, _frame: FrameType | None = None) -> None:
    sys.exit(128 + number)


def set_stops(handler: signal._HANDLER) -> None:
    """What Ctrl-C and SIGTERM do; those that are ignored, as Ctrl-C in the background of a script, stay so."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


@contextmanager
def delayed_stops() -> Iterator[None]:
    """Ctrl-C and SIGTERM take effect after the block, as they did before it."""
    caught: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    set_stops(lambda number, _: caught.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:     # Python cannot restore a handler that C installed
                signal.signal(number, handler)
    if caught:
        signal.raise_signal(caught[0])


# --- a tool ----------------------------------------------------------------------------------------

def run(log: Path, command: Sequence[str | Path], folder: Path | None = None,
        environment: Mapping[str, str] | None = None, lock: int | None = None) -> int:
    """Run a command, and write its output into the log; show its progress meanwhile. Returns its exit code, or that of
    a shell where a signal has ended it. `lock`: the file of a lock, which the command and its children hold, too."""
    import subprocess

    log.parent.mkdir(parents=True, exist_ok=True)
    log.unlink(missing_ok=True)     # it may be another user's
    with open(log, "wb") as file, delayed_stops():
        try:
            child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT,
                                     cwd=folder, env=environment, pass_fds=() if lock is None else (lock,))
        except OSError as error:
            file.write(f"{command[0]}: {error.strerror}\n".encode())
            return 127
        with progress(log):
            status = child.wait()
    return status if status >= 0 else 128 - status


def pass_on(command: Sequence[str | Path], folder: Path | None = None,
            environment: Mapping[str, str] | None = None) -> int:
    """Run a command that has the launcher's own streams; returns its exit code."""
    import subprocess

    with delayed_stops():
        return subprocess.Popen(command, cwd=folder, env=environment).wait()


@contextmanager
def progress(log: Path) -> Iterator[None]:
    """Show the last line of the log again and again: on a terminal in place, elsewhere as a line every 5 s."""
    import threading

    in_place = sys.stderr.isatty()
    ended = threading.Event()

    def show() -> None:
        before = ""
        while not ended.wait(0.2 if in_place else 5):
            line = last_line(log)[:78]
            if in_place:
                print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)
            elif line != before:
                print(f"    {line}", file=sys.stderr, flush=True)
            before = line

    thread = threading.Thread(target=show, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        if in_place:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def last_line(log: Path) -> str:
    with open(log, "rb") as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - 4096))
        lines = file.read().decode(errors="replace").replace("\r", "").splitlines()
    return lines[-1] if lines else ""


def failure(log: Path, what: str, status: int) -> Failure:
    """The Failure of `what`, with the reason that its log shows: one line for what the machine lacks. Else refused
    headers come first, then errors with the lines that follow them; the end of the log where there are neither."""
    text = log.read_text(encoding="utf-8", errors="replace")
    disk = os.statvfs(log.parent)
    lack = ""
    if DISK.search(text) or disk.f_bavail * disk.f_frsize < SMALLEST_DISK:
        lack = "the disk is full: free some space"
    elif MEMORY.search(text) or status > 128:
        lack = "a process was killed or had no memory: close other programs"
    elif NETWORK.search(text):
        lack = "the network or a server does not answer: look for a connection"
    if lack:
        return Failure(f"{what} failed: {lack}, then try again, it goes on from there; the whole log is {log}", 1)
    lines = text.splitlines()
    refused = [line for line in lines if REFUSED.match(line)]
    shown = [*refused[:8], *_with_following(line for line in lines if not REFUSED.match(line))] or lines[-30:]
    return Failure("\n".join([f"{what} failed; the whole log is {log}",
                              *(line[:400] for line in shown if not NOISE.match(line))]), 1)


def _with_following(lines: Iterable[str], errors: int = 4, following: int = 5) -> Iterator[str]:
    """The first lines that are errors, each with some that follow it."""
    left = 0
    for line in lines:
        if errors and WRONG.search(line):
            errors, left = errors - 1, following + 1
        if left:
            left -= 1
            yield line


# --- files -----------------------------------------------------------------------------------------

@contextmanager
def alone(lock: Path, what: str) -> Iterator[int]:
    """Wait until no other launcher holds the lock, because it does `what`. Yields the lock's file, which the programs
    that work under it inherit: they hold it, should the launcher be killed."""
    file = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say(f"waiting for another fledge, which {what}")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield file
    finally:
        os.close(file)
