# SPDX-License-Identifier: Apache-2.0
"""Addresses of links.

    udp://HOST:PORT?listen=[ADDRESS:]PORT   datagrams to HOST:PORT, and from any that sends to the other port
    tcp://HOST:PORT                         a stream, as a client
    listen://[ADDRESS:]PORT                 a stream, as a server of any number of clients
    serial:/dev/ttyUSB0?baud=115200         a serial device
    cosim:PROCESS                           a flight process of the co-simulation that `fledge up` runs; the run does
                                            not wait
    cosim:PROCESS?every=0.5                 the same as a node, which steps every 0.5 s of simulated time; the run waits
    cosim:PROCESS?radio=world.radio         by a radio of the world; as a node with every=, the period of flight
    http://HOST:PORT/CRAFT, https://...     a spacecraft of a control room's server (fledge.ground.scripts.served)

Without an ADDRESS, a port is open to this machine alone. A link of any kind may carry frames: `frames=68` of a
spacecraft with that id and otherwise the settings with which others begin, `frames=spacecraft:68,cop1:1,...`, or, of a
mission, those of its dictionary (fledge.ground.connect). timer=5 [s]: until a frame is sent again; limit=20: how often
it is sent; keys=link.keys and role=0: of a secured link.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Any
from urllib.parse import SplitResult, parse_qs, urlsplit

from fledge.errors import SetupError, listed
from fledge.frames import Frames
from fledge.ground.scripts.links import Link, Streams, Udp
from fledge.ground.scripts.member import Member, Onlooker

LOOPBACK = "127.0.0.1"
OF_FRAMES = {"timer", "limit", "keys", "role"}


def open_link(address: str, accepts: Callable[[bytes], bool] | None = None, frames: Frames | None = None) -> Link:
    """The link of an address. accepts: as of a Splitter. frames: those that it carries, unless the address has others.
    Raises SetupError."""
    try:
        return link_of(address, accepts, frames)()
    except OSError as error:
        raise SetupError(f"{address}: {error.strerror or error}") from None


def link_of(address: str, accepts: Callable[[bytes], bool] | None = None, frames: Frames | None = None
            ) -> Callable[[], Link]:
    """What opens the link of an address. Raises SetupError if it is none."""
    try:
        parts = urlsplit(address)
        options = {key: values[-1] for key, values in parse_qs(parts.query, strict_parsing=bool(parts.query)).items()}
        port = parts.port
    except ValueError as error:
        raise SetupError(f"{address}: {error}; {FORMS}") from None
    known = {"udp": {"listen"}, "serial": {"baud"}, "cosim": {"every", "radio"}}.get(parts.scheme, set()) | {"frames"}
    if "frames" in options:
        frames = Frames.parse(options.pop("frames"))
    known |= OF_FRAMES if frames else set()
    if unknown := set(options) - known:
        raise SetupError(f"{address}: there is no option {listed(sorted(unknown))}; "
                         f"there is {listed(sorted(known))}")
    if frames:
        return _framed(address, parts, options, frames)
    return _link_of(address, parts, options, port, accepts, False)


def _framed(address: str, parts: SplitResult, options: dict[str, str], frames: Any) -> Callable[[], Any]:
    """What opens a link of frames over the link of an address."""
    from fledge.ground.scripts.framed import LIMIT, TIMER, Framed

    given = {key: options.pop(key) for key in OF_FRAMES & set(options)}
    try:
        timer = float(given.get("timer", TIMER))
    except ValueError:
        timer = 0.0
    if not timer > 0:
        raise SetupError(f"{address}: timer is a number of seconds, above 0; found '{given['timer']}'")
    limit = _whole(address, "limit", given.get("limit", str(LIMIT)), 255)
    role = _whole(address, "role", given["role"], 3) if given.get("role", "0") != "0" else 0
    below = _link_of(address, parts, options, parts.port, None, True)
    return lambda: Framed(below(), frames, given.get("keys"), role, timer, limit)


def _link_of(address: str, parts: SplitResult, options: dict[str, str], port: int | None, accepts: Any,
             raw: bool) -> Callable[[], Any]:
    there = (parts.hostname or LOOPBACK, port or 0)
    if parts.scheme == "udp" and port and "listen" in options:
        here = _listening(address, options["listen"])
        return lambda: Udp(there, here, raw)
    if parts.scheme == "tcp" and port:
        return lambda: Streams.connect(there, accepts, raw)
    if parts.scheme == "listen":
        here = _listening(address, parts.netloc)
        return lambda: Streams.listen(here, accepts, raw)
    if parts.scheme == "serial" and parts.path:
        baud = _whole(address, "baud", options.get("baud", "115200"), 1 << 24)
        return lambda: Streams.device(parts.path, baud, accepts, raw)
    if parts.scheme == "cosim" and parts.path:
        if "every" in options:
            return lambda: Member(parts.path, options["every"], raw, options.get("radio"))
        return lambda: Onlooker(parts.path, raw, options.get("radio"))
    raise SetupError(f"'{address}' is no address of a link; {FORMS}")


FORMS = "an address is udp://HOST:PORT?listen=PORT, tcp://HOST:PORT, listen://PORT, serial:DEVICE?baud=N or " \
        "cosim:PROCESS"


def _listening(address: str, text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    return host.strip("[]") or LOOPBACK, _whole(address, "a port", port, 65535)


def _whole(address: str, name: str, text: str, most: int) -> int:
    if not text.isascii() or not text.isdigit() or not 0 < int(text) <= most:
        raise SetupError(f"{address}: {name} is a whole number from 1 to {most}; found '{text}'")
    return int(text)
