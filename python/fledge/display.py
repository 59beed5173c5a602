# SPDX-License-Identifier: Apache-2.0
"""What a notebook shows: tables as HTML, which take the colours of the page, light or dark."""
from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

_WHOLE = 36      # characters that stay in one line
_LINE = "1px solid rgba(128, 128, 128, 0.35)"
_CELL = "padding: 0.15em 1.2em 0.15em 0; text-align: left; vertical-align: top; background: none"


def table(title: str, groups: Iterable[tuple[str, Iterable[Sequence[str]]]], columns: Sequence[str] = (),
          notes: Iterable[str] = ()) -> str:
    """A table of texts, which it escapes, in one line of HTML.

    groups: (heading, rows), the heading "" for none; empty groups are left out. The first cell of a row is a name.
    columns: the headings of the columns; notes: lines below the table
    """
    sized = [(heading, [list(line) for line in lines]) for heading, lines in groups]
    width = max((len(line) for _, lines in sized for line in lines), default=1)
    rows = []
    if any(columns):
        rows.append(
            "".join(f'<th style="{_CELL}; font-weight: normal; opacity: 0.65">{escape(c)}</th>' for c in columns))
    for heading, lines in sized:
        cells = ["".join(_cell(text, i == 0, 1 if i + 1 < len(line) else width - i) for i, text in enumerate(line))
                 for line in lines]
        if cells and heading:
            rows.append(f'<th colspan="{width}" style="{_CELL}; padding-top: 0.5em; border-bottom: {_LINE}">'
                        f"{escape(heading)}</th>")
        rows += cells
    body = "".join(f'<tr style="background: none">{row}</tr>' for row in rows)
    table = f'<table style="border: 0; border-collapse: collapse; font-size: 0.9em; margin: 0.3em 0">{body}</table>'
    below = "".join(f'<div style="font-size: 0.9em; opacity: 0.75">{_text(note)}</div>' for note in notes)
    return f'<div style="overflow-x: auto"><strong>{_text(title)}</strong>{table if rows else ""}{below}</div>'


def _cell(text: object, name: bool, span: int) -> str:
    shown = f'<code style="background: none; padding: 0; font-size: 1em">{_text(text)}</code>' if name else _text(text)
    whole = "; white-space: nowrap" if len(str(text)) <= _WHOLE else ""
    return f'<td colspan="{span}" style="{_CELL}{whole}">{shown}</td>'


def _text(text: object) -> str:
    """Its lines stay lines."""
    return "<br>".join(escape(line) for line in str(text).splitlines())


def unit_text(unit: str) -> str:
    """A unit of a header; "" of a number without one."""
    return "" if unit == "-" else unit


def notebook() -> Any:
    """IPython's shell, where it is that of a notebook; else None."""
    ipython: Any = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return shell if hasattr(shell, "kernel") else None


def shown_by_pyplot(figure: Any) -> None:
    """pyplot shows this figure at the end of a notebook's cell: as the value of that cell it is not shown again."""
    shell = notebook()
    if shell is None:
        return
    cell = shell.execution_count

    def show() -> None:
        if shell.execution_count != cell:
            from IPython.display import display

            del figure._ipython_display_
            display(figure)

    figure._ipython_display_ = show


class Live:
    """A line of a notebook that is shown anew again and again; `there` is whether this is a notebook at all."""

    def __init__(self) -> None:
        self.there = notebook() is not None
        self._handle: Any = None

    def show(self, text: str, done: float | None = None) -> None:
        """done: from 0 to 1, as a bar; none without it."""
        bar = "" if done is None else f'<progress value="{done:.4f}" max="1" style="width: 16em"></progress> '
        data = {"text/plain": text, "text/html": f"<div>{bar}{escape(text)}</div>" if text else ""}
        if self._handle:
            self._handle.update(data, raw=True)
            return
        from IPython.display import display      # it is there: this is a notebook

        self._handle = display(data, raw=True, display_id=True)
