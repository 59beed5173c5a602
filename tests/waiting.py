# SPDX-License-Identifier: Apache-2.0
"""How tests wait: for what must happen, however busy the machine is. `fledge test` limits the time of a whole test."""
import time

PATIENCE = 600.0    # [s] where an interface wants a limit; shorter than that of a test, so that it speaks first


def wait_for(what, process=None):
    """Call it until it returns something, and return that; meanwhile a process must not end."""
    while not (found := what()):
        assert process is None or process.poll() is None, (
            f"{process.args} ended: {process.returncode}, {process.stdout and process.stdout.read()}")
        time.sleep(0.01)
    return found
