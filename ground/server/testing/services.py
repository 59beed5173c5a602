# SPDX-License-Identifier: Apache-2.0
"""The imager with stored commands, files and a link by frames: for tests of pages that its mission has no use for."""
import shutil
from pathlib import Path

from fledge import mission

SERVICES = """
    f.stored = fsw.StoredCommands(late=60 * s)
    f.files  = fsw.Files(entity=2, ground=1, rate=2000, allowed=0b1111)
    f.space  = fsw.SpaceLink(spacecraft=68, command_channel=1, cop1=1, cltu=1, segments=1, idle=2)
    f.task("services", every=0.5 * s, run=[f.stored, f.files, f.space])
"""


def imager_with_services(folder: Path) -> Path:
    """Write the mission into a folder; its own folder."""
    shutil.copytree(mission.missions()["earth_imager"].folder, folder / "imager",
                    ignore=shutil.ignore_patterns("*_test.py", "__pycache__"))
    with (folder / "imager/flight.py").open("a") as file:
        file.write(SERVICES)
    return folder / "imager"
