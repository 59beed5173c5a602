# SPDX-License-Identifier: Apache-2.0
"""An array that knows its length. Apart, so that numpy is imported only with the first of them."""

import numpy as np


class Vector(np.ndarray):
    """A numpy array with norm()."""

    def norm(self):
        """The root of the sum of squares."""
        return float(np.sqrt(np.sum(np.square(np.asarray(self)))))
