# SPDX-License-Identifier: Apache-2.0
"""The pages that command, in a real browser at a real server with two flights (commands_page_test.mjs)."""
from pathlib import Path

import pytest

from fledge.ground.console.testing.console import browse, checks, served

SCRIPT = Path(__file__).with_suffix(".mjs")
FILE = """
port = 0
folder = "runs"
[[craft]]
name = "imager"
mission = "earth_imager"
speed = 10
[[craft]]
name = "flatsat"
mission = "flatsat"
speed = 20
"""
ODD = """title = "Odd"
[[panel]]
title = "<img src=x onerror=alert(1)>"
values = [
    "flight.tracking.error.head.t",
    "flight.tracking.eror",
]
[[panel]]
plot = ["flight.tracking.error.sigma_BR"]
[[panel]]
commands = [{ command = "flight.noop", label = "Nothing" }, "flight.telemetri"]
"""


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """The error of each check in the browser, "" without one."""
    folder = tmp_path_factory.mktemp("room")
    (folder / "ground.toml").write_text(FILE)
    (folder / "displays").mkdir()
    (folder / "displays/odd.toml").write_text(ODD)
    with served(folder / "ground.toml") as address:
        return browse(SCRIPT, address, folder)


@pytest.mark.long("a browser on a room and a mission: 45 s")
@pytest.mark.parametrize("check", checks(SCRIPT))
def test_in_the_browser(errors, check):
    assert errors[check] == "", errors[check]
