# SPDX-License-Identifier: Apache-2.0
"""A run on one HTML page, as `fledge run --report` writes it: no other file, no script, no network.

    report = Report(sim, "spin", scenario)   # before the run: notes the parameters it begins with
    ...
    report.write(path, outcome)              # after it, whatever came of it

    run         gathers the facts of a run
    numbers     writes numbers, vectors and matrices as a person does
    templates   the page and its style
"""

from fledge.report.run import Outcome, Report

__all__ = ["Outcome", "Report"]
