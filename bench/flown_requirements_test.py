# SPDX-License-Identifier: Apache-2.0
"""What docs/evidence.md says of the cost of flown requirements is so."""
import re
import subprocess

import pytest

from fledge.disk import ROOT
from fledge.targets import TARGETS

from bench import flown_requirements
from tests.needs import flies_on

pytestmark = flies_on("leon3")


def gcc_12():
    """Whether the board's compiler is that of Debian 12, of which the documents' figures are."""
    done = subprocess.run([TARGETS["leon3"].needs[0], "-dumpversion"], capture_output=True, text=True, check=True)
    return done.stdout.startswith("12")


def test_the_table_of_the_documents_is_what_the_board_counts():
    """The bytes are those of the headers; compilers of other versions may differ by some instructions."""
    text = (ROOT / "docs/evidence.md").read_text(encoding="utf-8").partition("\n## Requirements on board\n")[2]
    found = {name: [float(cell.replace(",", "")) for cell in cells.split("|")]
             for name, cells in re.findall(r"^\| (.*?) \| (\d.*) \|$", text.partition("\n## ")[0], re.M)}
    measured = {name: figures for name, *figures in flown_requirements.measured()}
    assert list(found) == list(measured)
    for name, (mean, most, *exact) in measured.items():
        assert found[name][2:] == exact, name
        assert found[name][:2] == pytest.approx([mean, most], rel=0.2 if gcc_12() else 0.25), name


def test_a_window_costs_what_its_operation_is_known_to():
    """One of `always` by the height of a tree, which 60 more samples do not change much; one of `until` by its samples;
    and each of its samples is four numbers."""
    most = {name: figures for name, *figures in flown_requirements.measured()}
    always = [most[f"`always(within({n} s, a))`"] for n in (10, 60, 120)]
    until = [most[f"`always(until(a, b, within={n} s))`"] for n in (10, 60)]
    most_of = [row[1] for row in always]
    assert max(most_of) < 1.2 * min(most_of)
    assert not gcc_12() or most_of[0] < most_of[1] < most_of[2]     # others spend more on the shortest window
    assert until[1][1] - until[0][1] > 50 * 20          # instructions, for each sample more
    assert [b[4] - a[4] for a, b in (always[:2], always[1:], until)] == [50 * 32, 60 * 32, 50 * 32]
