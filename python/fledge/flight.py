# SPDX-License-Identifier: Apache-2.0
"""The flight modules and their messages, by name: `from fledge import flight as fsw`.

Each is an object on the memory of its C struct: `help(fsw.MrpFeedback)` shows its inputs, outputs and
parameters. The error for an unknown name lists the known ones.
"""

from math import sqrt as _sqrt

from fledge import _core
from fledge.objects import project as _project
from fledge.objects.lookup import lookup
from fledge.objects.wires import best, by_mode, first, newest  # noqa: F401

TYPES = {**_core.library("flight"), **_project.types("flight")}
# Spin axes in B of four wheels in a pyramid, each at 45 degrees to the plane of b1 and b2 (thesis, table 2.2).
_UP = _sqrt(2) / 2
PYRAMID = [[-0.5, 0.5, -_UP], [0.5, 0.5, -_UP], [0.5, -0.5, -_UP], [-0.5, -0.5, -_UP]]
# Where eight sun sensors look in B: two pyramids of four, about b3 and -b3, each sensor at 45 degrees to its axis.
SUN_PYRAMIDS = [[x, y, z] for z in (_UP, -_UP) for x, y in ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))]

__getattr__, __dir__ = lookup(__name__, TYPES, globals())
