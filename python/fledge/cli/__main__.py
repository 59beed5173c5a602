# SPDX-License-Identifier: Apache-2.0
"""The program `fledge`. Until main() runs, Ctrl-C ends it at once, with no traceback of an import."""
import signal
import sys

CTRL_C = signal.getsignal(signal.SIGINT)    # ignored in the background of a shell script: then it stays so
if CTRL_C is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})     # the launcher blocks it

try:
    import fledge  # noqa: F401
except ImportError as error:    # it is made for another Python
    sys.exit(f"fledge: {error}")

from fledge.cli import main  # noqa: E402

try:
    signal.signal(signal.SIGINT, CTRL_C)
    code = main()
except KeyboardInterrupt:
    code = 130
sys.exit(code)
