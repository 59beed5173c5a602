# SPDX-License-Identifier: Apache-2.0
"""Which processors are refused; flights with resets, large boards and other boards. Its support is in
targets/bare/boards_test.py, what all targets have in common in fly_test.py."""
import re
import types

import pytest

from fledge import cli
from fledge.errors import Failure
from fledge.targets import TARGETS
from tests.needs import flies_on

TARGET = TARGETS["riscv64"]
pytestmark = flies_on("riscv64")


def test_a_processor_without_a_unit_for_double_precision_is_refused(monkeypatch):
    part = types.SimpleNamespace(frames=None)
    TARGET.check(part)
    for machine in (("-march=rv64imafc", "-mabi=lp64f"), ("-march=rv64imac", "-mabi=lp64")):
        monkeypatch.setattr(TARGET, "machine", machine)
        with pytest.raises(Failure, match=f"riscv64: {' '.join(machine)} has no unit for double precision"):
            TARGET.check(part)


@pytest.mark.long("builds and flies two images")
def test_a_reset_of_the_computer_in_flight(tmp_path, capsys):
    """The record goes on, and all bits and all telemetry are the desktop's."""
    assert cli.main(["fly", "flatsat", "silent", "--on", "riscv64", "--out", str(tmp_path)]) == 0, capsys.readouterr()
    row, = (line for line in capsys.readouterr().out.splitlines() if line.startswith("  riscv64"))
    assert " none " in row and "flight: recorded 589\n" in (tmp_path / "riscv64.log").read_text()


@pytest.mark.long("builds and flies an image")
def test_a_mission_with_a_large_board(tmp_path, capsys):
    """Of 700 KiB: commands, files and tables cross it."""
    assert cli.main(["fly", "mars_orbiter", "pointing", "--for", "20s", "--on", "riscv64", "--out", str(tmp_path)]) == 0
    assert "passed   desktop, riscv64" in capsys.readouterr().out


@pytest.mark.long("builds images of two boards")
@flies_on("cortex-m7")
def test_boards_of_different_processors_fly_in_one_run(tmp_path, capsys):
    assert cli.main(["fly", "formation", "sensed", "--for", "10s", "--on", "deputy=riscv64,chief=cortex-m7", "--out",
                     str(tmp_path)]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if re.search(" on (riscv64|cortex-m7) ", line)]
    assert len(rows) == 2 and all(" none " in row for row in rows)
