# SPDX-License-Identifier: Apache-2.0
"""Signals within a block have its handler; in another thread than the main one they keep their own."""
import signal
import subprocess
import sys
import threading

from fledge.interruption import handled


def test_a_signal_has_the_handler_of_the_block_and_its_own_after_it():
    program = ("import os, signal\n"
               "from fledge.interruption import handled\n"
               "with handled([signal.SIGUSR1], lambda *_: print('handled')):\n"
               "    os.kill(os.getpid(), signal.SIGUSR1)\n"
               "assert signal.getsignal(signal.SIGUSR1) == signal.SIG_DFL")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout, done.returncode) == ("handled\n", 0), done.stderr


def test_another_thread_leaves_the_handlers_as_they_are():
    before, within = signal.getsignal(signal.SIGUSR1), []

    def block():
        with handled([signal.SIGUSR1], signal.SIG_IGN):
            within.append(signal.getsignal(signal.SIGUSR1))

    thread = threading.Thread(target=block)
    thread.start()
    thread.join()
    assert within == [before]
