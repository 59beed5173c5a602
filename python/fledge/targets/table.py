# SPDX-License-Identifier: Apache-2.0
"""The table of flights on targets."""

HEADS = ("target", "steps", "flight outputs", "first difference", "CPU per step", "code", "memory")


def lines(rows):
    """The lines of the table. rows: (target, Flown or None, hash of the outputs, first difference)"""
    cells = [HEADS]
    for name, flown, digest, difference in rows:
        if flown is None:
            cells.append((name, "-", "-", difference, "-", "-", "-"))
            continue
        cells.append((name, str(flown.steps), digest, difference,
                      cpu(flown.cpu) + (f", {flown.cpu_of}" if flown.cpu_of else ""), size(flown.code),
                      size(flown.memory)))
    widths = [max(len(row[i]) for row in cells) for i in range(len(HEADS))]
    for row in cells:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()


def cpu(seconds):
    if seconds is None:
        return "-"
    return f"{seconds * 1e6:.3g} us" if seconds >= 1e-6 else f"{seconds * 1e9:.3g} ns"


def size(n):
    return "-" if n is None else f"{n / 1024:.1f} KiB"
