# SPDX-License-Identifier: Apache-2.0
"""The requirements that flight judges on board."""
from fledge.requirements import fly


def preset(sim):
    fly(sim, "SUN-1", "SUN-2")
