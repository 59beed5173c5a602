# SPDX-License-Identifier: Apache-2.0
"""A fault in a board's log is reported as module, function, file and line."""
import re
import subprocess

import pytest

from fledge.targets import TARGETS, Job, faults
from tests.needs import skip_unless_on

LOGS = {"leon3": "flight: trap 0x00000009 at 0x{pc:08x}: the program stops\n"
                 "flight: o 00000000 00000000 00000000 00000000 00000000 00000000 00000000 {call:08x}\n",
        "cortex-m7": "flight: fault: access to protected memory at 0x{pc:08x}, called from 0x{call:08x}\n"
                     "flight: number 4 cfsr 82\n"}


@pytest.mark.parametrize("name", ["cortex-m7", pytest.param("leon3", marks=pytest.mark.long("builds an image"))])
def test_a_fault_is_reported_with_its_module_and_line(name, tmp_path):
    """Here as if flight had stopped at the beginning of a module's update, and in a function that it calls."""
    skip_unless_on(name)
    target = TARGETS[name]
    target.prepare()
    part = Job("nadir_spin", folder=tmp_path, duration=1.0).parts[0]
    program = target.built(part)
    listed = subprocess.run([target.addr2line.replace("addr2line", "nm"), program], capture_output=True, text=True,
                            check=True).stdout
    places = {symbol: int(at, 16) & ~1 for at, symbol in re.findall(r"^(\w+) [Tt] (\w+)$", listed, re.M)}
    update = LOGS[name].format(pc=places["mrp_feedback_update"] + 4, call=1)
    advice = target.advice(f"world: flown 1 s\n{update}world: interrupted\n", part)
    assert re.fullmatch(r"nadir_spin: .* at 0x\w+: in the module flight\.control, mrp_feedback_update, "
                        r"flight/control/mrp_feedback\.c:\d+", advice)
    # Of a function that several modules call, the caller tells which module it was.
    dumped = subprocess.run([target.addr2line.replace("addr2line", "objdump"), "-d", program], capture_output=True,
                            text=True, check=True).stdout
    call = int(re.search(r"^ *(\w+):.*\b(?:call|bl)\b.*<tracking_error_update>", dumped, re.M)[1], 16)
    message = LOGS[name].format(pc=places["fledge_fly"], call=call + (4 if name == "cortex-m7" else 0))
    assert ": in the module flight.tracking, " in target.advice(message, part)
    assert target.advice("world: flown 1 s\n", part) == ""


def test_the_last_of_several_faults_is_reported(tmp_path):
    log = "a: fault: one at 0x10\na: fault: two, with a comma, at 0x20, called from 0x30\n"
    assert faults._FAULT.findall(log)[-1] == ("two, with a comma,", "20", "30")
