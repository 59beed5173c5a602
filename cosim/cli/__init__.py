# SPDX-License-Identifier: Apache-2.0
"""The commands of co-simulation.

Example:

    $ ./fledge up nadir_spin --until 10min
"""
