# SPDX-License-Identifier: Apache-2.0
"""What reviewers ask of flight software besides its requirements:

    faults      each fault of each unit in each mode: what flight notices, isolates and survives (FMEA)
    page        that matrix as a page that a person filters, and as CSV
    versions    two versions of flight over the same campaign: what moved, and which margin fell
    timing      the longest observed path of each task on a board
"""

from fledge.analysis.faults import Matrix, fly

__all__ = ["Matrix", "fly"]
