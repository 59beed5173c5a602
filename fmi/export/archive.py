# SPDX-License-Identifier: Apache-2.0
"""An .fmu: a zip of the model description, libraries, resources and sources. The same content gives the same bytes."""
from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

from fledge.disk import Part, make

Content = str | bytes | Path        # the text, the bytes, or the file with them


def write_archive(path: Path, files: Mapping[str, Content]) -> Path:
    """Write the files, by their names in the archive, the model description first."""
    make(path.parent)
    names = sorted(files, key=lambda name: (name != "modelDescription.xml", name))
    with Part(path) as part, zipfile.ZipFile(part, "w") as archive:
        for name in names:
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
            info.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(info, content_of(files[name]))
    return path


def content_of(content: Content) -> bytes:
    """The bytes."""
    if isinstance(content, Path):
        return content.read_bytes()
    return content.encode() if isinstance(content, str) else content
