# SPDX-License-Identifier: Apache-2.0
"""The campaign of line faults, in short. FLEDGE_LINE_FAULTS is the number of its flights."""
import os

import pytest

from fledge.disk import build_folder
from tests import line_faults

RUNS = os.environ.get("FLEDGE_LINE_FAULTS")
pytestmark = pytest.mark.skipif(not (build_folder() / "cosim/fledge_board_node").exists(),
                                reason="the node of boards is not built")


def campaign(runs, capsys):
    code = line_faults.main(["--runs", str(runs)])
    output = capsys.readouterr().out
    assert code == 0, output
    return output


def test_each_flight_is_equal_or_names_its_fault(capsys):
    assert "equal" in campaign(5, capsys)


@pytest.mark.long("a hundred flights, a second each")
def test_each_of_many_flights_is_equal_or_names_its_fault(capsys):
    output = campaign(int(RUNS or 100), capsys)
    assert "equal" in output and "named" in output


def test_a_difference_without_a_name_is_found():
    """The judge itself: a flight whose bits differ, one that ends without a word, and one that hangs."""
    judge = object.__new__(line_faults.Campaign)
    good = line_faults.Flight(0, "", b"record", b"exchange", 100, None)
    judge.undisturbed = {True: good, False: good}
    noise = line_faults.Plan("reset=go-on", flips=1e-5)
    assert judge.verdict(noise, good) == "equal"
    assert judge.verdict(noise, good._replace(record=b"other")).startswith("WRONG: other bits")
    assert judge.verdict(noise, good._replace(exchange=b"other")).startswith("WRONG: other bits")
    assert judge.verdict(noise, good._replace(code=1)).startswith("WRONG: it ended")
    assert judge.verdict(noise, good._replace(code=None)).startswith("WRONG: it did not end")
    assert judge.verdict(noise, good._replace(board=-11)).startswith("WRONG: signal 11")
    silent = good._replace(code=1, text="the board has been silent for 1.2 s in the tick at 1 s")
    assert judge.verdict(noise, silent).startswith("WRONG: it did not get over")
    assert judge.verdict(line_faults.Plan("reset=end", cut_for_good=10), silent) == "ended, named"
    reset = good._replace(record=b"other", text="the board was reset in the tick at 1 s, and begins flight there\n"
                                                "  flown    5 s")
    assert judge.verdict(line_faults.Plan("reset=go-on", resets=(9,)), reset) == "went on after a reset, named"
