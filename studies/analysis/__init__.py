# SPDX-License-Identifier: Apache-2.0
"""What reviewers ask of flight software besides its requirements:

    matrix      the faults of each unit of a mission
    faults      each of them flown in each mode: what flight notices, isolates and survives (FMEA)
    comparison  a flight with a fault beside the one without it
    page        the matrix as a page that a person filters, and as CSV
    versions    two versions of flight over the same campaign: what moved, and which margin fell
    timing      the longest observed path of each task on a board

Example:

    $ ./fledge faults sun_safe --double
"""

from fledge.analysis.faults import fly
from fledge.analysis.matrix import Matrix

__all__ = ["Matrix", "fly"]
