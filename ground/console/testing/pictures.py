# SPDX-License-Identifier: Apache-2.0
"""Write pictures of every page of the console, 400, 1,280 and 1,920 px wide, light and dark, and list the parts that
are cut or wider than the window; the same for pages that commands wrote.

    /usr/bin/python3 -m fledge.ground.console.testing.pictures DIR [--mission NAME]... [--page NAME]... [FILE.html]...
"""
from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from fledge.ground.console.testing.console import run_script, served
from fledge.ground.server.passwords import hashed

USER, PASSWORD = "vera", "verification"


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dir", type=Path, help="where the pictures are written")
    parser.add_argument("files", type=Path, nargs="*", help="pages of commands, as report.html")
    parser.add_argument("--mission", action="append", help="default: cubesat; the first one alone is in the overview")
    parser.add_argument("--page", action="append", help="of the console, or login, or none; default: all")
    chosen = parser.parse_intermixed_args(arguments)
    chosen.dir.mkdir(parents=True, exist_ok=True)
    missions = chosen.mission or ["cubesat"]
    pages = [page for page in chosen.page or ["login", "all"] if page != "none"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        crafts = "".join(f'[[craft]]\nname = "{mission}"\nmission = "{mission}"\nspeed = 20\n' for mission in missions)
        (folder / "room.toml").write_text(
            f'port = 0\nfolder = "runs"\n{crafts}[[user]]\nname = "{USER}"\n'
            f'password = "{hashed(PASSWORD, (16, 8, 1))}"\nroles = ["view", "command", "administer"]\n')
        (folder / "pictures.json").write_text(json.dumps({
            "out": str(chosen.dir.resolve()), "user": USER, "password": PASSWORD, "pages": pages, "crafts": missions,
            "files": [file.resolve().as_uri() for file in chosen.files]}))
        with served(folder / "room.toml") as address:
            done = run_script(Path(__file__).with_suffix(".mjs"), address, folder)
    print(done.stderr or "nothing is cut or too wide")
    if problem := json.loads(done.stdout)["pictures"]:
        sys.exit(problem)


if __name__ == "__main__":
    main(sys.argv[1:])
