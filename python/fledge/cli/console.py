# SPDX-License-Identifier: Apache-2.0
"""Output and saved plots, which all commands share."""
from __future__ import annotations

import os
import sys
from pathlib import Path

from fledge.errors import excerpt, printable

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from matplotlib.figure import Figure

LINE = 2000     # characters of a line of a complaint


def say(text: str = "") -> None:
    print(printable(text), flush=True)  # names may come from files and other programs


def complain(text: str, head: str = "fledge: ") -> None:
    """A line on stderr, or some. A text of another program is not trusted: it drives no terminal and floods none."""
    print(head + "\n".join(excerpt(line, LINE) for line in text.split("\n")), file=sys.stderr, flush=True)


def trace(options: argparse.Namespace) -> None:
    """With --debug, print the traceback of the present error."""
    if options.debug:
        import traceback

        traceback.print_exc()


def itemized(head: str, texts: Sequence[str]) -> str:
    """ "HEAD: TEXT", or the head and a line for each text."""
    return f"{head}: {texts[0]}" if len(texts) == 1 else \
        "\n  ".join([f"{head}:", *(text.replace("\n", "\n  ") for text in texts)])


def cannot_fly(texts: Sequence[str]) -> str:
    """What a user reads of a mission with problems, as placed() has them."""
    return itemized("the mission cannot fly", texts)


def placed(problems: Sequence[tuple[str, int, str]]) -> list[str]:
    """The problems of a simulation as texts."""
    return [(f"{file}, line {line}: " if file else "") + text for file, line, text in problems]


def counted(n: int, thing: str) -> str:
    """"1 program", "2 programs"."""
    return f"{n} {thing}" + ("" if n == 1 else "s")


def size_of(path: Path | str) -> str:
    """The size of a file: "6.6 MB"."""
    size = os.path.getsize(path)
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"


class Plots:
    """Saves the figures of a scenario, and lists their paths."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.saved: list[Path] = []
        self.earlier = set(_open_figures())      # of what this program did before

    def add(self, figure: Figure) -> None:
        """Save a figure. The second of a name is NAME-2."""
        from fledge.plot import file_name, save

        name, n = file_name(figure), 2
        while self.folder / f"{name}.png" in self.saved:
            name, n = f"{file_name(figure)}-{n}", n + 1
        self.saved.append(save(figure, self.folder, name))

    def whole(self) -> list[Path]:
        """Save the figures of pyplot that the scenario opened, too, and close them. Returns the paths of all."""
        for number in _open_figures():
            if number not in self.earlier:
                import matplotlib.pyplot as plt

                self.add(plt.figure(number))
                plt.close(number)
        return self.saved


def _open_figures() -> list[int]:
    """The numbers of the open figures of pyplot, if the program uses it."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    return pyplot.get_fignums() if pyplot else []
