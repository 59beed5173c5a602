# SPDX-License-Identifier: Apache-2.0
"""What executives say, on a target as on the desktop."""

import fledge
from fledge import cli
from fledge.records.activity_test import here
from fledge.archive.compare import compare
from fledge.records.activity import happenings, modes

__all__ = ["here"]


def test_a_target_records_the_same(here):
    assert cli.main(["fly", "modal", "--on", "linux"]) == 0
    desktop, linux = (fledge.Archive(here / "runs" / "modal" / "fly" / f"{name}.mcap") for name in ("desktop", "linux"))
    assert compare(desktop, linux) == [] and modes(linux) == {"flight": [(0.0, "coast"), (61.0, "point")]}
    assert [happening for happening in happenings(linux)] == [happening for happening in happenings(desktop)
                                                              if happening.process == "flight"]
