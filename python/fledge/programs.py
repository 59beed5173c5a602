# SPDX-License-Identifier: Apache-2.0
"""Programs that are not Python, as Fledge starts them."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence


def without_preload(environment: Mapping[str, str]) -> dict[str, str]:
    """An environment for a program that a sanitizer's library slows down, breaks or hangs: the launcher preloads that
    library for Python, and other programs inherit it."""
    return {name: value for name, value in environment.items() if name != "LD_PRELOAD"}


def in_debugger(command: Sequence[str]) -> str:
    """What a user types to run this command in gdb, with the build and the project of this program."""
    project, preset = os.environ.get("FLEDGE_PROJECT"), os.environ.get("FLEDGE_PRESET", "release")
    beside = project and not os.path.realpath(".").startswith(os.path.realpath(project))
    return shlex.join(["./fledge", *(["--project", project] if project and beside else []),
                       *(["--preset", preset] if preset != "release" else []),
                       "exec", "gdb", "-ex", "run", "--args", *command])
