# SPDX-License-Identifier: Apache-2.0
"""Users with and without the role to command, in a real browser (users_page_test.mjs)."""
import json
from pathlib import Path

import pytest

from fledge.ground.console.testing.console import browse, checks, served
from fledge.ground.server.testing.services import imager_with_services
from fledge.ground.server.passwords import hashed

SCRIPT = Path(__file__).with_suffix(".mjs")
CHEAP = (16, 8, 1)      # of scrypt
FILE = """
port = 0
folder = "runs"
[[craft]]
name = "imager"
mission = "{imager}"
"""


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """The error of each check in the browser, "" without one."""
    folder = tmp_path_factory.mktemp("room")
    users = "".join(f'[[user]]\nname = "{name}"\npassword = "{hashed(name * 4, CHEAP)}"\nroles = {json.dumps(roles)}\n'
                    for name, roles in (("vera", ["view"]), ("carl", ["view", "command"])))
    (folder / "ground.toml").write_text(FILE.format(imager=imager_with_services(folder)) + users)
    with served(folder / "ground.toml") as address:
        return browse(SCRIPT, address, folder)


@pytest.mark.long("a browser on a room: 10 s")
@pytest.mark.parametrize("check", checks(SCRIPT))
def test_in_the_browser(errors, check):
    assert errors[check] == "", errors[check]
