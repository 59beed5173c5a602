# SPDX-License-Identifier: Apache-2.0
"""What docs/evidence.md says of the cost of flown requirements is so."""
import re

import pytest

from fledge.disk import ROOT
from fledge.targets import TARGETS

from bench import flown_requirements

pytestmark = pytest.mark.skipif(bool(TARGETS["leon3"].missing()), reason="the compiler for SPARC is not installed")


def test_the_table_of_the_documents_is_what_the_board_counts():
    """The bytes are those of the headers; compilers of other versions may differ by some instructions."""
    text = (ROOT / "docs/evidence.md").read_text(encoding="utf-8").partition("\n## Requirements on board\n")[2]
    found = {name: [float(cell.replace(",", "")) for cell in cells.split("|")]
             for name, cells in re.findall(r"^\| (.*?) \| (\d.*) \|$", text.partition("\n## ")[0], re.M)}
    measured = {name: figures for name, *figures in flown_requirements.measured()}
    assert list(found) == list(measured)
    for name, (mean, most, *exact) in measured.items():
        assert found[name][2:] == exact, name
        assert found[name][:2] == pytest.approx([mean, most], rel=0.25), name


def test_a_window_costs_what_its_operation_is_known_to():
    """One of `always` by the height of a tree, which 60 more samples do not change much; one of `until` by its samples;
    and each of its samples is four numbers."""
    most = {name: figures for name, *figures in flown_requirements.measured()}
    always = [most[f"`always(within({n} s, a))`"] for n in (10, 60, 120)]
    until = [most[f"`always(until(a, b, within={n} s))`"] for n in (10, 60)]
    assert max(row[1] for row in always) < 1.2 * min(row[1] for row in always)
    assert until[1][1] - until[0][1] > 50 * 20          # instructions, for each sample more
    assert [b[4] - a[4] for a, b in (always[:2], always[1:], until)] == [50 * 32, 60 * 32, 50 * 32]
