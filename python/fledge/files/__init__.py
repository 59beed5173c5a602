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

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import os

    from fledge.files.mean_elements import MeanElements
    from fledge.files.ndm import Message


def read_all(source: str | os.PathLike[str]) -> list[Message] | list[MeanElements]:
    """What a file, or a text of several lines, holds; its form is known by its content: all messages of CCSDS in KVN or
    XML, or mean elements in two lines, JSON or CSV. Raises SetupError."""
    from fledge.files import mean_elements, ndm

    data, _ = ndm.content(source)
    begin = data.lstrip(b"\xef\xbb\xbf \t\r\n")
    if begin[:1] == b"<" or b"CCSDS_" in data or b"\0" in data[:8]:
        return ndm.read_all(source)
    return mean_elements.read_all(source)


def read(source: str | os.PathLike[str]) -> Message | MeanElements:
    """The only message, or set of mean elements, of a file or text. Raises SetupError where there are several."""
    from fledge.files import mean_elements, ndm

    found = read_all(source)
    return ndm.read(source) if isinstance(found[0], ndm.Message) else mean_elements.read(source)


def write(message: Message, path: str | os.PathLike[str], form: str = "kvn") -> None:
    """Write a message of CCSDS. form: "kvn" or "xml". Raises SetupError where it would not read back."""
    from fledge.files import ndm

    ndm.write(message, path, form)
