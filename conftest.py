# SPDX-License-Identifier: Apache-2.0
"""Lets a bare `/usr/bin/python3 -m pytest` find the packages and the extension of the release build, in any folder.

The launcher sets PYTHONPATH itself, to the build under test, and that one wins.
"""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent
FOLDERS = [str(ROOT / part) for part in ("python", ".", f"build/{os.environ.get('FLEDGE_PRESET', 'release')}/python")]

# In a sub-folder, `python3 -m pytest` puts that folder first: python/fledge/flight.py would hide flight/.
sys.path[:] = [*(path for path in sys.path if path not in ("", os.getcwd())), *FOLDERS]
# The programs that tests start.
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), *FOLDERS]))

# Tests of the launcher, of documents, of the build and of programs of targets, none of which the sanitizers look into.
IN_RELEASE = [ROOT / path for path in (
    "bench/mutants_test.py", "python/fledge/export/cfs/flight_test.py", "python/fledge/targets/cfs_test.py",
    "python/fledge/targets/console_test.py", "python/fledge/targets/procedure_test.py",
    "python/fledge/targets/random_test.py", "tests/docs_test.py",
    "tests/format_test.py", "tests/install_test.py", "tests/launcher_test.py", "tests/project_test.py")]


def pytest_collection_modifyitems(items):
    """Under the sanitizers, leave out what they would only slow down."""
    if os.environ.get("FLEDGE_PRESET", "release") in ("asan", "tsan"):
        for item in items:
            if item.path in IN_RELEASE:
                item.add_marker(pytest.mark.skip(reason="the release build shows it"))
