# SPDX-License-Identifier: Apache-2.0
"""The CubeSat on each target: a target of the camera and a pass, with the outputs and the telemetry of the desktop, and
the checks of the scenario."""
import os

import pytest

from fledge import cli
from fledge.targets import TARGETS


@pytest.mark.long("builds and flies the CubeSat on targets: 200 s")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET", "release") != "release", reason="the release build shows it")
@pytest.mark.parametrize("target", ["linux", "cfs", "leon3", "leon3-cfs", "micropython", "leon3-micropython"])
def test_a_target_flies_and_says_what_the_desktop_does(target, tmp_path, capsys):
    if TARGETS[target].missing():
        pytest.skip(f"{target} is not installed")
    assert cli.main(["fly", "cubesat", "imaging", "--on", target, "--out", str(tmp_path)]) == 0, capsys.readouterr()
    assert f"passed   desktop, {target}" in capsys.readouterr().out
