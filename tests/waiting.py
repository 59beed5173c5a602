# SPDX-License-Identifier: Apache-2.0
"""How tests wait: for what must happen, however busy the machine is."""
import time

PATIENCE = 600.0    # [s] where an interface wants a limit; shorter than that of a test, so that it speaks first


def wait_for(what, process=None, says=lambda: ""):
    """Call it until it returns something, and return that; meanwhile a process must not end. says: what there is
    instead, if that was in vain."""
    end = time.monotonic() + PATIENCE
    while not (found := what()):
        assert process is None or process.poll() is None, (
            f"{process.args} ended: {process.returncode}, {process.stdout and process.stdout.read()}")
        assert time.monotonic() < end, f"waited in vain for {PATIENCE:g} s; {says()}"
        time.sleep(0.01)
    return found
