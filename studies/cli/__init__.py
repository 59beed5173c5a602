# SPDX-License-Identifier: Apache-2.0
"""The commands of studies: many runs of a mission, and what is shown of its flight software.

Example:

    $ ./fledge montecarlo nadir_spin --runs 100
"""
