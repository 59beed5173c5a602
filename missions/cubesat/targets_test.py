# SPDX-License-Identifier: Apache-2.0
"""The CubeSat on each target, and through four boards: it looks at a target and at the station with the outputs and the
telemetry of the desktop, and the checks of the scenario hold."""
import os
from pathlib import Path

import pytest

from fledge import cli
from tests.needs import skip_unless_on

BOARDS = Path(__file__).with_name("boards")


@pytest.mark.long("builds and flies the CubeSat on targets: 200 s")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it")
@pytest.mark.parametrize("target, boards", [
    *((target, []) for target in ("linux", "cfs", "leon3", "leon3-cfs", "micropython", "leon3-micropython")),
    *((target, ["--board", str(BOARDS)]) for target in ("linux", "leon3"))],
    ids=lambda values: values if isinstance(values, str) else "boards" if values else "whole")
def test_a_target_flies_and_says_what_the_desktop_does(target, boards, tmp_path, capsys):
    skip_unless_on(target)
    code = cli.main(["fly", "cubesat", "imaging", "--on", target, *boards, "--out", str(tmp_path)])
    printed = capsys.readouterr()
    assert code == 0 and "  none  " in printed.out, printed
