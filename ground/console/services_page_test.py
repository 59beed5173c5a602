# SPDX-License-Identifier: Apache-2.0
"""Radio and passes, stored commands and transfers in a real browser (services_page_test.mjs), at a server that flies
the imager: once by its radio, once with services over frames."""
from pathlib import Path

import pytest

from fledge.ground.console.testing.console import browse, checks, served
from fledge.ground.server.testing.services import imager_with_services

SCRIPT = Path(__file__).with_suffix(".mjs")
FILE = """
port = 0
folder = "runs"
[[craft]]
name = "radio"
mission = "earth_imager"
radio = "radio"
[[craft]]
name = "services"
mission = "{imager}"
"""


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """The error of each check in the browser, "" without one."""
    folder = tmp_path_factory.mktemp("room")
    (folder / "ground.toml").write_text(FILE.format(imager=imager_with_services(folder)))
    with served(folder / "ground.toml") as address:
        return browse(SCRIPT, address, folder)


@pytest.mark.long("a browser on a room and a mission: 40 s")
@pytest.mark.parametrize("check", checks(SCRIPT))
def test_in_the_browser(errors, check):
    assert errors[check] == "", errors[check]
