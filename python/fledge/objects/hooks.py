# SPDX-License-Identifier: Apache-2.0
"""The functions that the extension calls in Python. It imports this module at the first call."""

from fledge.objects.outside import changed_outside, outside_state
from fledge.objects.script import air_numbers, check_script, script_failed
from fledge.objects.si import enumeration, to_enumerators, to_si
from fledge.objects.wires import wire
from fledge.objects.words import (flown_elsewhere, show, show_html, undeclared_attribute, unknown_attribute,
                                  unknown_memory, wired_input)

__all__ = ["air_numbers", "changed_outside", "check_script", "enumeration", "flown_elsewhere", "outside_state",
           "script_failed", "show", "show_html", "to_enumerators", "to_si", "undeclared_attribute", "unknown_attribute",
           "unknown_memory", "wire", "wired_input"]
