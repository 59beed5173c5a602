# SPDX-License-Identifier: Apache-2.0
# The functions of flight/math. The build writes them from the headers.
from typing import Any

from _fledge_flight_math import *

FUNCTIONS: dict[str, Any]
HEADERS: dict[str, str]
