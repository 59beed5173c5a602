# SPDX-License-Identifier: Apache-2.0
# The types of the flight modules and messages. The build writes them from the headers.
from typing import Any

from fledge.objects.wires import best as best, by_mode as by_mode, first as first, newest as newest
from _fledge_flight import *
from _project_flight import *

PYRAMID: list[list[float]]
SUN_PYRAMIDS: list[list[float]]
TYPES: dict[str, Any]
