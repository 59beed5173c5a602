# SPDX-License-Identifier: Apache-2.0
"""The program behind the shell script `fledge`. Until main() runs, Ctrl-C ends it at once, with no traceback of an
import."""
import os
import signal
import sys

if sys.version_info < (3, 11):
    sys.exit("fledge: needs Python 3.11 or later, and %s is %s" % (sys.executable, sys.version.split()[0]))
os.environ.pop("PYTHONSAFEPATH", None)      # which the script sets for this program alone

CTRL_C = signal.getsignal(signal.SIGINT)    # ignored in the background of a shell script: then it stays so
if CTRL_C is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})     # the script blocks it

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))

try:
    from fledge.launcher.main import main
except ImportError as error:    # it is made for another Python
    sys.exit(f"fledge: {error}")

try:
    code = main(sys.argv[1:], CTRL_C)
except KeyboardInterrupt:
    code = 130
sys.exit(code)
