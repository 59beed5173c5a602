# SPDX-License-Identifier: Apache-2.0
"""Arrays with norm(). A module of its own, because it imports numpy."""

import numpy as np


class Vector(np.ndarray):
    """A numpy array with norm()."""

    def norm(self) -> float:
        """The root of the sum of squares."""
        return float(np.sqrt(np.sum(np.square(np.asarray(self)))))
