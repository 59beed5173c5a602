# SPDX-License-Identifier: Apache-2.0
"""Requirements of a mission as data, in requirements.py beside its other files.

Example:

    from fledge.requirements import after, always, implies, settles, within
    from fledge.units import deg, minute

    def pointing(r):
        \"\"\"Pointing.\"\"\"
        error = r.signal("flight.tracking.error.sigma_BR").norm()
        r.require("PNT-1", "The body settles on its target.", settles(error < 1e-3, within=10 * minute))
        r.require("PNT-2", "It stays there.", always(implies(after(10 * minute), error < 2e-3)))

Every public function of the file that takes `r` is a group; its docstring is the title. A formula is of signal
temporal logic; its margin (robustness) is its distance from a change of its truth.
"""
from fledge.requirements.declared import Requirement, Requirements
from fledge.requirements.formula import (Comparison, Formula, Signal, after, always, angle, before, begins, eventually,
                                         implies, never, settles, turned, until, within)
from fledge.requirements.judge import Judged, Outcome
from fledge.requirements.onboard import fly

__all__ = ["Comparison", "Formula", "Judged", "Outcome", "Requirement", "Requirements", "Signal", "after", "always",
           "angle", "before", "begins", "eventually", "fly", "implies", "never", "settles", "turned", "until", "within"]
