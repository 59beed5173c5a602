# SPDX-License-Identifier: Apache-2.0
"""The functions of flight/math, by their names in C: vectors, attitudes, elementary functions.

    from fledge.flight_math import fm_sin, mrp_compose, vec_norm

They take numbers, and lists or arrays of the shape that each docstring states, and give floats and new arrays with the
bits of C. So a prototype that computes by them in the order of its C puts out the same bits. What C fills by a pointer
is given back: `s, c = fm_sincos(x)`. Plain numbers in SI: quantities with units are refused. Raises TypeError for
another shape.
"""

from fledge import _core

_FOUND = _core.functions()
FUNCTIONS = {name: function for name, (function, _) in _FOUND.items()}
HEADERS = {name: header for name, (_, header) in _FOUND.items()}
__all__ = sorted(FUNCTIONS)
globals().update(FUNCTIONS)
