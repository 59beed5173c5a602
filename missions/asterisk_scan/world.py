# SPDX-License-Identifier: Apache-2.0
"""The truth: that of the single spiral. It begins where the lines will cross, at rest."""
from .single_spiral.world import build
