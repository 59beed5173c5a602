# SPDX-License-Identifier: Apache-2.0
"""What docs/accuracy.md is made of: sections of text and tables, written with two significant digits,
so that every machine writes the same."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bench.rows import Rows


class Table:
    """Figures in rows and columns.

    rows: what a row's name means, "step [s]". columns: (name, unit) each. A figure is a number, or a
    text where there is none.
    """

    def __init__(self, title: str, rows: str, columns: Sequence[tuple[str, str]]) -> None:
        self.title, self.row_title, self.columns = title, rows, columns
        self.rows: list[tuple[str, list]] = []

    def add(self, name: str, *figures: Any) -> None:
        if len(figures) != len(self.columns):
            raise ValueError(f"{self.title}: {len(figures)} figures for {len(self.columns)} columns")
        self.rows.append((name, [f if isinstance(f, str) else float(f) for f in figures]))

    def markdown(self) -> str:
        units = [f" [{unit}]" if unit else "" for _, unit in self.columns]
        lines = [[self.row_title] + [name + unit for (name, _), unit in zip(self.columns, units)]]
        lines += [[name] + [f if isinstance(f, str) else two_digits(f) for f in figures]
                  for name, figures in self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
        lines.insert(1, ["-" * widths[0]] + ["-" * (w - 1) + ":" for w in widths[1:]])
        text = ["| " + " | ".join([line[0].ljust(widths[0])] +
                                  [cell.rjust(w) for cell, w in zip(line[1:], widths[1:])]) + " |" for line in lines]
        return "\n".join([f"**{self.title}**", "", *text])


class Section:
    """A model: what it is held against, and how far it is from that."""

    def __init__(self, title: str, oracle: str, *parts: Any) -> None:
        self.title, self.oracle, self.parts = title, oracle, parts

    def markdown(self) -> str:
        parts = [part.markdown() if isinstance(part, Table) else part for part in self.parts]
        return "\n\n".join([f"## {self.title}", f"*Held against:* {self.oracle}", *parts])

    def fill(self, rows: Rows) -> None:
        """Add every figure to a bench's Rows."""
        for table in self.parts:
            if isinstance(table, Table):
                for name, figures in table.rows:
                    for (column, unit), figure in zip(table.columns, figures):
                        if not isinstance(figure, str):
                            rows.add(f"{table.title}, {name}", column, figure, unit)


def two_digits(x: float) -> str:
    """1.2e-9, 0.012, 1.2, 12, 120, 1200, 1.2e5"""
    if x == 0.0:
        return "0"
    mantissa, _, power = f"{x:.1e}".partition("e")
    exponent = int(power)
    if -3 <= exponent < 4:
        return f"{float(f'{x:.1e}'):.{max(1 - exponent, 0)}f}"
    return f"{mantissa}e{exponent}"
