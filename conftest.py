# SPDX-License-Identifier: Apache-2.0
"""Lets a bare `/usr/bin/python3 -m pytest` find the packages and the release build's extension.

The launcher sets PYTHONPATH itself, to the build under test, and that one wins.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
sys.path.extend(str(ROOT / part) for part in ("python", ".", "build/release/python"))
