# SPDX-License-Identifier: Apache-2.0
"""All requirements of a mission over its scenarios and targets, as `fledge verify` flies them and writes its report.

    flight.py     a scenario on a target: its hash, and its results
    judging.py    it is flown, and its requirements are judged
    flights.py    all of them, by a pool, or from the report before
    evidence.py   the verdict of each requirement, what shows it, and the differences to an earlier report
    tables.py     the requirements as CSV, in and out; the verdicts as JUnit
    figure.py     the comparison that decided, with its limit
    coverage.py   the lines and branches of flight that ran on a board
    decisions.py  the conditions of flight that have decided, as clang counts them
    page.py       the report on one HTML page
    book.py       the book of evidence, with clauses of standards

Example:

    $ ./fledge verify nadir_spin --on desktop,leon3
"""
