# SPDX-License-Identifier: Apache-2.0
"""Which processors are refused, and a flight's figures. Its support is in targets/bare/boards_test.py, what all targets
have in common in fly_test.py."""
import re
import types

import pytest

from fledge import cli
from fledge.errors import Failure
from fledge.targets import TARGETS
from tests.needs import flies_on

TARGET = TARGETS["cortex-m7"]
pytestmark = flies_on("cortex-m7")


def test_a_processor_without_a_unit_for_double_precision_is_refused(monkeypatch):
    part = types.SimpleNamespace(frames=None)
    TARGET.check(part)
    for machine in (("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"), ("-mcpu=cortex-m3",)):
        monkeypatch.setattr(TARGET, "machine", ("-mthumb", *machine))
        with pytest.raises(Failure, match="no unit for double precision, and the compiler's software for it has other"):
            TARGET.check(part)


@pytest.mark.long("builds and flies images of two boards")
def test_a_flight_prints_what_it_needed_beside_another_board(tmp_path, capsys):
    on = "deputy=cortex-m7" + ("" if TARGETS["leon3"].missing() else ",chief=leon3")
    assert cli.main(["fly", "formation", "sensed", "--for", "10s", "--on", on, "--out", str(tmp_path)]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if " on cortex-m7" in line or " on leon3" in line]
    assert len(rows) == len(on.split(",")) and all(" none " in row for row in rows)
    figures = dict(re.findall(r"deputy: (\w+) (\d+)", (tmp_path / "apart.log").read_text()))
    assert figures["ticks"] == figures["recorded"] == "21" and figures["refused"] == figures["line_resets"] == "0"
    assert 500 < int(figures["stack_bytes"]) < 20_000 and int(figures["data_bytes"]) < int(figures["ram_bytes"])
    assert 20_000 < int(figures["program_bytes"]) < 200_000 and int(figures["ram_bytes"]) < 1_000_000
