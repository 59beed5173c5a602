# SPDX-License-Identifier: Apache-2.0
"""The functions that the extension calls in Python. It imports this module at the first call."""

from fledge.objects.script import check_script, script_failed
from fledge.objects.si import enumeration, to_enumerators, to_si
from fledge.objects.wires import wire
from fledge.objects.words import show, unknown_attribute

__all__ = ["check_script", "enumeration", "script_failed", "show",
           "to_enumerators", "to_si", "unknown_attribute", "wire"]
