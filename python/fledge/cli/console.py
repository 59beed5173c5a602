# SPDX-License-Identifier: Apache-2.0
"""What the commands share: how they speak, and keep what is plotted."""

import os


def say(text=""):
    print(text, flush=True)


def counted(n, thing):
    """"1 program", "2 programs"."""
    return f"{n} {thing}" + ("" if n == 1 else "s")


def size_of(path):
    """The size of a file, in words."""
    size = os.path.getsize(path)
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"


class Plots:
    """Saves what a scenario plots, and remembers it."""

    def __init__(self, folder):
        self.folder = folder
        self.saved = []

    def add(self, figure):
        from fledge.plot import save

        self.saved.append(save(figure, self.folder))
