# SPDX-License-Identifier: Apache-2.0
"""A real browser at a real server, for the tests of the console's pages."""
from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fledge.ground.server import web
from fledge.ground.server.room import Room
from fledge.ground.server.settings import read
from fledge.errors import SetupError
from fledge.programs import without_preload
from fledge.scene import bundle
from tests.needs import reason, skip_without


def checks(script: Path) -> list[str]:
    """The names of a script's checks: its `async "name"(...)`."""
    return re.findall(r'^    async "(.*)"\(', script.read_text(encoding="utf-8"), re.MULTILINE)


@contextmanager
def served(file: Path) -> Iterator[str]:
    """Serve a control room's file, which has port = 0; yields the address."""
    room, over, loop = Room(read(file)), asyncio.Event(), asyncio.new_event_loop()
    addresses: list[str] = []
    begun = threading.Event()       # or failed

    def ready(address: str) -> None:
        addresses.append(address)
        begun.set()

    def run() -> None:
        try:
            loop.run_until_complete(web.serve(room, ready, over))
        finally:
            begun.set()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert begun.wait(60) and addresses, "the server did not begin"
        yield addresses[0].rstrip("/")
    finally:
        loop.call_soon_threadsafe(over.set)
        thread.join()
        room.close()
        loop.close()


def run_script(script: Path, address: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a script of console.mjs in a browser. Raises SetupError where Node, Chromium or playwright is missing."""
    bundle.build()
    modules, node, browser = bundle.folder() / "work/node_modules", shutil.which("node"), shutil.which("chromium")
    if not node or not browser or not (modules / "playwright-core").is_dir():
        raise SetupError("there is no Node, no Chromium or no playwright-core")
    return subprocess.run([node, str(script), address, str(folder), str(modules), browser], text=True,
                          env=without_preload(os.environ), stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def browse(script: Path, address: str, folder: Path) -> dict[str, str]:
    """Run a script of checks (console.mjs) in a browser: check -> "" or its error. Skips without a browser."""
    skip_without("chromium", "nodejs")
    try:
        done = run_script(script, address, folder)
    except SetupError as error:
        pytest.skip(reason("npm") or f"the pages are not built: {error}")
    assert done.returncode == 0, done.stderr
    errors: dict[str, str] = json.loads(done.stdout)
    return errors
