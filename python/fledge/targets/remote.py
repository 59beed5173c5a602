# SPDX-License-Identifier: Apache-2.0
"""A flight program on another computer with Linux, such as a Raspberry Pi, by ssh."""
from __future__ import annotations

import os
import re
import shlex
import subprocess
from pathlib import Path

from fledge.errors import Failure
from fledge.programs import without_preload

SSH = "ssh"
MACHINES = {"aarch64": "aarch64", "arm64": "aarch64"}   # what `uname -m` says -> the target whose programs run there


def machine(host: str, ssh: str) -> str:
    """What `uname -m` says on a host. Raises Failure if it cannot be reached."""
    return _there(host, ssh, "uname -m").strip()


def target_for(host: str, ssh: str) -> str:
    """The name of the target whose programs run on a host."""
    board = machine(host, ssh)
    name = MACHINES.get(board) or ("linux" if board == os.uname().machine else "")
    if not name:
        raise Failure(f"load: {host} has {board}, and programs for {' and '.join(dict.fromkeys(MACHINES.values()))} or "
                      f"{os.uname().machine} can be built here; a Raspberry Pi has aarch64 under a Linux of 64 bits")
    return name


def copy(program: Path, host: str, ssh: str, folder: str, name: str = "") -> str:
    """Copy a program into a folder of a host, relative to the user's home; returns its path there. It gets its name
    once it is whole, so that one which flies stays as it is."""
    place = f"{folder.rstrip('/')}/{name or program.name}"
    part = shlex.quote(place + ".part")
    digest = _there(host, ssh, f"umask 022 && mkdir -p -- {shlex.quote(folder)} && cat > {part} && chmod 755 {part} && "
                    f"cksum < {part} && mv -f -- {part} {shlex.quote(place)}", program)
    here = subprocess.run(["cksum"], stdin=program.open("rb"), capture_output=True, text=True, check=True).stdout
    if digest.split() != here.split():
        raise Failure(f"load: {host} has got other bytes of {program.name}; look at its disk, and load again", 1)
    return place


def _there(host: str, ssh: str, command: str, file: str | os.PathLike[str] | None = None) -> str:
    """The output of a command there, whose input is a file."""
    if not re.fullmatch(r"[\w.@:%\[\]-]+", host) or host.startswith("-"):
        raise Failure(f"load: expected ssh:HOST or ssh:USER@HOST; found 'ssh:{host}'")
    words = [*shlex.split(ssh), "--", host, command]
    try:
        with open(file or os.devnull, "rb") as content:
            done = subprocess.run(words, stdin=content, capture_output=True, text=True, errors="replace",
                                  env=without_preload(os.environ))
    except FileNotFoundError:
        raise Failure(f"load: there is no {words[0]}; as root, run: apt-get install openssh-client") from None
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"it ended with {done.returncode}"])[-1]
        raise Failure(f"load: ssh to {host}: {last}" + (
            f"; `{shlex.join([*shlex.split(ssh), host])}` must work before" if done.returncode == 255 else ""), 1)
    return done.stdout
