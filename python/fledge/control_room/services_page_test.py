# SPDX-License-Identifier: Apache-2.0
"""Radio and passes, stored commands and transfers in a real browser (services_page_test.mjs), at a server that flies
the imager: once by its radio, once with services over frames."""
import shutil
from pathlib import Path

import pytest

from fledge import mission
from fledge.control_room.testing.console import browse, checks, served

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
SERVICES = """
    f.stored = fsw.StoredCommands(late=60 * s)
    f.files  = fsw.Files(entity=2, ground=1, rate=2000, allowed=0b1111)
    f.space  = fsw.SpaceLink(spacecraft=68, command_channel=1, cop1=1, cltu=1, segments=1, idle=2)
    f.task("services", every=0.5 * s, run=[f.stored, f.files, f.space])
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What the browser found: check -> what went wrong."""
    folder = tmp_path_factory.mktemp("room")
    shutil.copytree(mission.missions()["earth_imager"].folder, folder / "imager",
                    ignore=shutil.ignore_patterns("*_test.py", "__pycache__"))
    with (folder / "imager/flight.py").open("a") as file:
        file.write(SERVICES)
    (folder / "ground.toml").write_text(FILE.format(imager=folder / "imager"))
    with served(folder / "ground.toml") as address:
        return browse(SCRIPT, address, folder)


@pytest.mark.long("a browser on a room and a mission: 40 s")
@pytest.mark.parametrize("check", checks(SCRIPT))
def test_in_the_browser(found, check):
    assert found[check] == "", found[check]
