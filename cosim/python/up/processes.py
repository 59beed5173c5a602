# SPDX-License-Identifier: Apache-2.0
"""Programs, each under a guard (cosim/tools/guard.c), which leaves nothing of it behind.

A guard lives as long as this program holds the guard's standard input open, so every command ends with this program,
even if a signal kills it. If a signal kills a guard, its command ends too; the kernel makes this program the parent of
the command's children, because it is their subreaper, and `end_strays` ends them.
"""
from __future__ import annotations

import ctypes
import os
import shlex
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO, cast

_SUBREAPER = 36     # prctl(2)


def adopt_strays() -> None:
    """Become the parent of descendants that lose theirs."""
    ctypes.CDLL(None, use_errno=True).prctl(_SUBREAPER, 1, 0, 0, 0)


class Process:
    """A command under its guard. `code` is None while it runs, then its exit code: 128 + N if signal N killed it."""

    def __init__(self, command: list[str], guard: str, log: BinaryIO, launcher: Sequence[str] = (),
                 env: dict[str, str] | None = None, directory: str | None = None,
                 remote: tuple[str, dict[str, str]] | None = None, pass_fds: Sequence[int] = ()):
        """remote: (folder, variables) on another machine, whose shell starts the command. Raises OSError if the
        command cannot start."""
        if remote is None:
            whole = [*launcher, guard, "--", *command]
        else:
            folder, variables = remote
            there = " && ".join([f"cd {_quoted(folder)}",
                                 *(f"{name}={_quoted(value)} && export {name}" for name, value in variables.items()),
                                 " ".join(["exec", _quoted(guard), "--", *map(_quoted, command)])])
            whole = [*launcher, f"exec sh -c {shlex.quote(there)}"]     # for any shell there
        self._process = subprocess.Popen(whole, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT,
                                         env=env, cwd=directory, start_new_session=True, pass_fds=pass_fds)
        self._lifeline = cast(BinaryIO, self._process.stdin)
        self.code: int | None = None

    @property
    def pid(self) -> int:
        """Of its guard, or of the launcher of the guard."""
        return self._process.pid

    def poll(self) -> bool:
        """Whether it has ended; then `code` is set."""
        if self.code is None:
            code = self._process.poll()
            if code is not None:
                self.code = code if code >= 0 else 128 - code
                self._lifeline.close()
        return self.code is not None

    def end(self) -> None:
        """Make the guard end it: with SIGTERM, five seconds later with SIGKILL. Does not wait; see poll()."""
        if not self._lifeline.closed:
            self._lifeline.close()


def _quoted(word: str) -> str:
    """For a shell, which replaces a leading ~/ itself."""
    return "~/" + shlex.quote(word[2:]) if word.startswith("~/") else shlex.quote(word)


def in_words(code: int | None) -> str:
    """How a program ended."""
    if code and code > 128:
        try:
            return f"was killed by {signal.Signals(code - 128).name}"
        except ValueError:
            pass
    return f"ended with exit code {code}"


def descendants(of: int) -> list[int]:
    """The living processes that come from one, parents first."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                rest = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
            except OSError:
                continue
            if rest[0] not in "ZX":
                parents.setdefault(int(rest[1]), []).append(int(entry.name))
    children = list(parents.get(of, ()))
    for pid in children:
        children += parents.get(pid, ())
    return children


def end_strays(known: set[int]) -> int:
    """Reap and kill the processes that this program inherited because their parent was killed. known: the processes
    that this program started. Returns the number of those killed."""
    count = 0
    while True:
        try:
            ended = os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        except ChildProcessError:
            break
        if ended is None or ended.si_pid in known:
            break
        os.waitpid(ended.si_pid, 0)
    rest = set(known)
    for pid in descendants(os.getpid()):
        if pid in rest:
            continue
        try:
            parent = int(Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[1])
            if parent in rest:
                rest.add(pid)
                continue
            os.kill(pid, signal.SIGKILL)
            count += 1
        except (OSError, IndexError):
            pass    # gone meanwhile
    return count
