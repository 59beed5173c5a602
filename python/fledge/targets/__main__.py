# SPDX-License-Identifier: Apache-2.0
"""Builds what all flights on targets need, such as a C library, if it is not there:

    python3 -P -m fledge.targets leon3,micropython      for these targets; without names, for all that are installed
"""
import sys

from fledge.errors import Failure
from fledge.targets import TARGETS

if __name__ == "__main__":
    try:
        TARGETS.ready(sys.argv[1].split(",") if sys.argv[1:] else [
            name for name, target in TARGETS.items() if not target.missing()], "setup")
    except Failure as failure:
        sys.exit(f"fledge: {failure}")
