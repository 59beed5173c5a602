# SPDX-License-Identifier: Apache-2.0
"""Tables of plain text."""
from __future__ import annotations

from collections.abc import Container, Sequence


def columns(rows: Sequence[Sequence[str]], right: Container[int] = (), indent: str = "") -> list[str]:
    """Rows as lines with aligned columns. right: the columns to align at the right."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    return [(indent + "  ".join(cell.rjust(width) if i in right else cell.ljust(width)
                                for i, (cell, width) in enumerate(zip(row, widths)))).rstrip() for row in rows]
