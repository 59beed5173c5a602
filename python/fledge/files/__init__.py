# SPDX-License-Identifier: Apache-2.0
"""Files of orbits and attitudes, as others write and read them.

Example:

    from fledge import files

    message = files.read('''CCSDS_OPM_VERS = 3.0
    CREATION_DATE = 2026-01-01T00:00:00
    ORIGINATOR = TEAM
    OBJECT_NAME = CRAFT
    OBJECT_ID = 2026-001A
    CENTER_NAME = EARTH
    REF_FRAME = GCRF
    TIME_SYSTEM = UTC
    EPOCH = 2026-01-01T00:00:00
    X = 7000 [km]
    Y = 0 [km]
    Z = 0 [km]
    X_DOT = 0 [km/s]
    Y_DOT = 7.5 [km/s]
    Z_DOT = 0 [km/s]
    ''')
    print(message["STATE"]["X"])        # 7000000.0, in m
"""
from __future__ import annotations

import re

from fledge.errors import SetupError

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import os
    from typing import Any

    from fledge.files import ck, ephemeris, mean_elements, ndm, sclk, spk, stk
    from fledge.files.sections import Message

__all__ = ["ck", "ephemeris", "mean_elements", "ndm", "read", "read_all", "sclk", "spk", "stk", "write"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"fledge.files has no '{name}'; there are {', '.join(__all__)}")
    from importlib import import_module

    return import_module(f"fledge.files.{name}")


def _reader(source: str | os.PathLike[str]) -> Any:
    """The module that reads a file or text, by its content."""
    from fledge.files import kvn, mean_elements, ndm

    data, where = kvn.content(source)
    if data.startswith(b"DAF/"):
        raise SetupError(f"{where}: is a kernel of SPICE, which may hold many objects: read it with "
                         "files.spk.read(path), or files.ck.read(path, clock)")
    begin = data.lstrip(kvn.SPACE)
    if begin.startswith(b"stk.v."):
        from fledge.files import stk

        return stk
    if begin[:1] == b"<" or b"\0" in data[:8] or b"CCSDS_" in data:
        return ndm
    if begin[:1] not in (b"{", b"[") and b"MEAN_MOTION" not in data and not re.search(rb"^[12] ", data, re.MULTILINE):
        found = kvn.decoded(begin, where).split("\n")[0]
        kvn.refuse(where, 1, "expected a message of CCSDS (CCSDS_..._VERS = ... first), an ephemeris or attitude of "
                             f"STK (stk.v... first), or mean elements in two lines, JSON or CSV; found {found!r}")
    return mean_elements


def read(source: str | os.PathLike[str]) -> Any:
    """What a file, or a text of several lines, holds; its form is known by its content: a message of CCSDS in KVN or
    XML (ndm.Message), an ephemeris or attitude of STK as an OEM or AEM, or mean elements in two lines, JSON or CSV
    (MeanElements). Raises SetupError, also where there are several."""
    return _reader(source).read(source)


def read_all(source: str | os.PathLike[str]) -> list[Any]:
    """All that a file, or a text of several lines, holds, as read() gives it. Raises SetupError."""
    found: list[Any] = _reader(source).read_all(source)
    return found


def write(message: Message, path: str | os.PathLike[str], form: str = "kvn") -> None:
    """Write a message of CCSDS into a file. form: "kvn", "xml" or, of an OEM and AEM, "stk". Raises SetupError where it
    would not read back, OSError where it cannot be written."""
    from fledge.files import ndm, stk

    if form == "stk":
        stk.write(message, path)
    else:
        ndm.write(message, path, form)
