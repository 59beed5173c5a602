# SPDX-License-Identifier: Apache-2.0
"""What the picture of a run shows besides what the record has: the imager's wings and camera, and its star tracker."""
from fledge.units import deg, m


def build(view):
    craft = view.craft()
    craft.box([0.7, 0.6, 0.8] * m)
    for side in (1, -1):
        craft.panel([0, side * 1.15, 0] * m, [1.4, 0.7] * m, normal_B=[-1, 0, 0])
    craft.cone("camera", [1, 0, 0], half_angle=6 * deg, at_B=[0.35, 0, 0] * m, length=12 * m)
    craft.cone("star tracker", [-0.5, 0, 0.87], half_angle=10 * deg, at_B=[0, 0, 0.4] * m)
    craft.cone("star tracker, Sun", [-0.5, 0, 0.87], half_angle=30 * deg, at_B=[0, 0, 0.4] * m, keep_out="Sun",
               length=2.5 * m)
