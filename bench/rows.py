# SPDX-License-Identifier: Apache-2.0
"""What every bench reports: a table for people, and the same as a list of rows for `--json`."""
import argparse
import json
import statistics


class Rows:
    """The figures of one bench.

    A figure is the median of its samples, and their least. A ratio is this median over that of the case
    that it is compared with.
    """

    def __init__(self):
        self._rows = []

    def add(self, case, figure, samples, unit, ratio_to=None, note=""):
        """Add a figure from its samples (or one number). `ratio_to` names a case with the same figure,
        added before."""
        samples = samples if isinstance(samples, (list, tuple)) else [samples]
        value = statistics.median(samples)
        least = min(samples) if len(samples) > 1 else None
        ratio = None
        if ratio_to is not None:
            other = [r for r in self._rows if r["case"] == ratio_to and r["figure"] == figure]
            if not other:
                raise KeyError(f"no case {ratio_to!r} with the figure {figure!r} to compare with")
            ratio = value / other[0]["value"]
        self._rows.append(dict(case=case, figure=figure, value=value, unit=unit, ratio_to=ratio_to,
                               ratio=ratio, least=least, note=note))
        return value

    def print(self):
        table = [("case", "figure", "least", "median", "unit", "ratio", "")]
        for r in self._rows:
            table.append((
                r["case"], r["figure"], "" if r["least"] is None else f"{r['least']:.4g}",
                f"{r['value']:.4g}", r["unit"],
                "" if r["ratio"] is None else f"{r['ratio']:.3g} x {r['ratio_to']}",
                r["note"]))
        widths = [max(len(row[i]) for row in table) for i in range(7)]
        right = {2, 3}
        for row in table:
            cells = (c.rjust(w) if i in right else c.ljust(w)
                     for i, (c, w) in enumerate(zip(row, widths)))
            print("  ".join(cells).rstrip())

    def write(self, path):
        keys = ("case", "figure", "value", "least", "unit", "ratio_to", "ratio")
        with open(path, "w") as file:
            json.dump([{k: r[k] for k in keys} for r in self._rows], file, indent=1)
            file.write("\n")


def options(name, arguments, runs):
    """What every bench takes on the command line."""
    parser = argparse.ArgumentParser(prog=f"fledge bench {name}",
                                     epilog=f"example: ./fledge bench {name} --json {name}.json")
    parser.add_argument("--json", metavar="FILE", help="write the figures as a list of rows, too")
    parser.add_argument("--runs", type=int, default=runs, help="samples of each figure (default %(default)s)")
    return parser.parse_args(arguments)


def report(rows, chosen):
    rows.print()
    if chosen.json:
        rows.write(chosen.json)
