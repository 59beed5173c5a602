# SPDX-License-Identifier: Apache-2.0
"""How a board that is no folder of targets is written: serial:DEVICE, or serial:DEVICE?baud=921600&reset=go-on&cut=10;
or a computer with Linux, ssh:HOST."""
from __future__ import annotations

import re
from pathlib import Path

from fledge.errors import Failure, did_you_mean

BEGIN, BY_SSH = "serial:", "ssh:"
EXAMPLE = "serial:/dev/ttyACM0?baud=921600"
BAUDS = range(300, 20_000_001)      # [bits/s]
RESETS = ("end", "go-on")


def is_line(word: str | None) -> bool:
    """Whether a word names a board at a serial line, and no target of a folder."""
    return word is not None and word.startswith(BEGIN)


def is_apart(word: str | None) -> bool:
    """Whether a word names no target of a folder."""
    return is_line(word) or word is not None and word.startswith(BY_SSH)


def name_of(word: str) -> str:
    """What files and tables call a target: its name; "serial-ttyACM0" by its device, "ssh-pi-raspberrypi"."""
    if not is_line(word):
        return re.sub(r"[^\w.-]", "-", word)
    device = word.removeprefix(BEGIN).removeprefix("//").partition("?")[0]
    return "serial-" + re.sub(r"[^\w.-]", "-", device.removeprefix("/dev/").strip("/"))


def read(word: str) -> tuple[str, dict[str, str]]:
    """(device, options) of a line: baud [bits/s]; reset: whether a board's reset ends the run, "end", or flight begins
    within it, "go-on"; cut: how long [s] the line may be cut. Raises Failure."""
    device, _, query = word.removeprefix(BEGIN).removeprefix("//").partition("?")
    if not is_line(word) or not device.startswith("/") or not device.strip("/"):
        raise Failure(f"{word}: expected serial:DEVICE, as in {EXAMPLE}")
    options = {}
    for pair in filter(None, query.split("&")):
        name, _, value = pair.partition("=")
        if name not in _VALUES:
            raise Failure(f"{word}: a serial line has no '{name}'{did_you_mean(name, _VALUES)} it has "
                          f"{', '.join(_VALUES)}")
        right, what = _VALUES[name]
        if not right(value):
            raise Failure(f"{word}: {name} is {what}; found '{value}'")
        options[name] = value
    return device, options


def _is_seconds(text: str) -> bool:
    return re.fullmatch(r"\d+(\.\d+)?", text) is not None and float(text) <= 1e6


_VALUES = {
    "baud": (lambda text: text.isascii() and text.isdigit() and len(text) < 9 and int(text) in BAUDS,
             f"bits per second, from {BAUDS[0]} to {BAUDS[-1]}"),
    "reset": (RESETS.__contains__, " or ".join(RESETS)),
    "cut": (_is_seconds, "a number of seconds"),
}


def devices() -> list[str]:
    """The serial devices of this machine that a board may be, those with a name of their own first."""
    return [str(path) for pattern in ("serial/by-id/*", "ttyACM*", "ttyUSB*") for path in sorted(
        Path("/dev").glob(pattern))]
