# SPDX-License-Identifier: Apache-2.0
"""The truth: that of the single spiral. It begins in the middle of the three spirals, at rest."""
from .single_spiral.world import build
