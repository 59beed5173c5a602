# SPDX-License-Identifier: Apache-2.0
"""A run on one HTML page, as `fledge run --report` writes it: no other file, no script, no network.

Example:

    import fledge
    from fledge.report import Outcome, Report

    sim = fledge.load("nadir_spin")
    report = Report(sim, "by hand")                         # before the run: it has the parameters of the beginning
    sim.run(60)
    report.write("report.html", Outcome("flown"))           # after it, whatever came of it

The modules:

    run         gathers the facts of a run
    campaign    the page of a campaign
    numbers     writes numbers, vectors and matrices as a person does
    templates   the page and its style
"""

from fledge.report.run import Outcome, Report

__all__ = ["Outcome", "Report"]
