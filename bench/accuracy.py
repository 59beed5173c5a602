# SPDX-License-Identifier: Apache-2.0
"""How accurate each model is: against its closed form, conservation law or an independent oracle, over
time and step size. Writes docs/accuracy.md, the same on every machine.
"""
from __future__ import annotations
import argparse
import sys
import textwrap
from pathlib import Path

from bench import accuracy_air as air
from bench import accuracy_earth as earth
from bench import accuracy_environment as environment
from bench import accuracy_flight as flight
from bench import accuracy_motion as motion
from bench import accuracy_parts as parts
from bench import accuracy_surroundings as around
from bench.rows import Rows

SECTIONS = [motion.rotation, motion.orbits, motion.oblate, environment.gravity, environment.planets,
            environment.check_cases, environment.ephemerides, environment.time_scales, earth.earth, motion.wheels,
            parts.moving, parts.actuators, around.surroundings, earth.air_and_field, air.upper_air,
            flight.navigation, flight.elementary, flight.loop]

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "accuracy.md"

INTRODUCTION = """\
# Accuracy

What each model is held against, and how far it is from that. Written by `./fledge bench accuracy`: every figure \
is measured when it runs, and has two significant digits, so that every machine writes the same file.

- Closed forms are evaluated in 40 digits from the very numbers that the simulation starts with: all of a difference \
is the simulation's.
- *RK4* is of order 4, one step per update. *Adaptive* is the method of Dormand and Prince of order 8. Its tolerance \
(relative and absolute alike, in SI; 1e-10 by default) bounds the estimated error of each step and of each state, \
not what they add up to: about the Earth, 1e-6 allows every step to be off by 7 m.
- *Relative* errors are those of a vector over its length. Where steps are short, rounding is all that is left, and it \
grows with their number.
"""


def document(sections):
    """docs/accuracy.md as text."""
    return wrap("\n\n".join([INTRODUCTION.rstrip(), *(section.markdown() for section in sections)])) + "\n"


def wrap(markdown):
    """Paragraphs and list items within 100 columns; tables and headings as they are."""
    return "\n".join(
        line if line.startswith(("|", "#"))
        else textwrap.fill(line, 100, break_on_hyphens=False, subsequent_indent="  " if line.startswith("- ") else "")
        for line in markdown.split("\n"))


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="fledge bench accuracy", description="Measure, and write docs/accuracy.md.",
                                     epilog="example: ./fledge bench accuracy --json accuracy.json")
    parser.add_argument("--json", metavar="FILE", help="write the figures as a list of rows, too")
    parser.add_argument("--out", metavar="FILE", type=Path, default=DOCUMENT, help="in place of docs/accuracy.md")
    chosen = parser.parse_args(arguments)

    sections, missing, rows = [], [], Rows()
    for measure in SECTIONS:
        try:
            sections.append(measure())
        except environment.Missing as error:
            missing.append(f"{measure.__name__} needs {error}")
        else:
            print(f"measured: {sections[-1].title}", file=sys.stderr)
            sections[-1].fill(rows)
    rows.print()
    if chosen.json:
        rows.write(chosen.json)
    if missing:
        print(f"{chosen.out} is not written, because it would not be whole:", *missing, sep="\n  ", file=sys.stderr)
        return 1
    chosen.out.write_text(document(sections), encoding="utf-8")
    print(f"written: {chosen.out}", file=sys.stderr)
    return 0
