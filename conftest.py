# SPDX-License-Identifier: Apache-2.0
"""Lets a bare `/usr/bin/python3 -m pytest` find the packages and the extension of the release build, in any folder.

The launcher sets PYTHONPATH itself, to the build under test, and that one wins.
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
FOLDERS = [str(ROOT / part) for part in ("python", ".", f"build/{os.environ.get('FLEDGE_PRESET', 'release')}/python")]

# In a sub-folder, `python3 -m pytest` puts that folder first: python/fledge/flight.py would hide flight/.
sys.path[:] = [*(path for path in sys.path if path not in ("", os.getcwd())), *FOLDERS]
# The programs that tests start.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), *FOLDERS]))
