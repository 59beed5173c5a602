# SPDX-License-Identifier: Apache-2.0
"""What the picture of a run shows besides what the record has: body, panels and camera."""
from fledge.units import deg, m

from .vehicle import CAMERA


def build(view):
    craft = view.craft()
    craft.box([0.34, 0.22, 0.22] * m)
    for side in (1, -1):
        craft.panel([0, side * 0.24, -0.11] * m, [0.33, 0.24] * m, normal_B=[0, 0, -1])
    craft.cone("camera", CAMERA, half_angle=3 * deg, at_B=[0, 0, 0.11] * m, length=8 * m)
