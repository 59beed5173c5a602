# SPDX-License-Identifier: Apache-2.0
import sys

from fledge.cli import main

sys.exit(main())
