# SPDX-License-Identifier: Apache-2.0
"""The pages that command, in a real browser at a real server with two flights (commands_page_test.mjs)."""
import asyncio
import json
import os
import re
import shutil
import subprocess
import threading
from pathlib import Path

import pytest

from fledge.control_room import web
from fledge.control_room.room import Room
from fledge.control_room.settings import read
from fledge.errors import SetupError
from fledge.programs import without_preload
from fledge.scene import bundle

SCRIPT = Path(__file__).with_suffix(".mjs")
CHECKS = re.findall(r'^    async "(.*)"\(\)', SCRIPT.read_text(encoding="utf-8"), re.MULTILINE)
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
def found(tmp_path_factory):
    """What the browser found: check -> what went wrong."""
    try:
        bundle.build()
    except SetupError as error:
        pytest.skip(str(error))
    modules = bundle.folder() / "work/node_modules"
    if not (modules / "playwright-core").is_dir() or not shutil.which("chromium"):
        pytest.skip("there is no browser, or not what drives it")
    folder = tmp_path_factory.mktemp("room")
    (folder / "ground.toml").write_text(FILE)
    (folder / "displays").mkdir()
    (folder / "displays/odd.toml").write_text(ODD)
    room, over, loop, at = Room(read(folder / "ground.toml")), None, asyncio.new_event_loop(), []
    heard = threading.Event()

    async def serve():
        nonlocal over
        over = asyncio.Event()
        await web.serve(room, lambda address: (at.append(address), heard.set()), over)

    server = threading.Thread(target=lambda: loop.run_until_complete(serve()))
    server.start()
    try:
        assert heard.wait(60), "the server did not begin"
        done = subprocess.run(
            [shutil.which("node"), SCRIPT, at[0].rstrip("/"), folder, modules, os.environ.get("FLEDGE_PICTURES", "")],
            env=without_preload(os.environ), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=900)
    finally:
        loop.call_soon_threadsafe(over.set)
        server.join()
        room.close()
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("check", CHECKS)
def test_in_the_browser(found, check):
    assert found[check] == "", found[check]
