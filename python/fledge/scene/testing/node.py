# SPDX-License-Identifier: Apache-2.0
"""The viewer's own code, outside of a browser."""

from __future__ import annotations

import json
import os
import subprocess
from typing import Any

import pytest

from fledge.scene import bundle
from tests.needs import needs, reason, skipped

needs_node = needs("nodejs")


def not_built(*files: str) -> str:
    """Why a page of these files cannot be written; by default, one of the viewer's. "" if they are built."""
    return "" if bundle.is_built(*files) else \
        reason("npm") or "the pages are not built; ./fledge setup --view builds them"


def opens(*files: str) -> pytest.MarkDecorator:
    """The mark of a test that opens a page of these files; by default, of the viewer's."""
    return skipped(reason("chromium"), not_built(*files),
                   "sanitizers see nothing of a page" if os.environ.get("FLEDGE_PRESET") == "asan" else "")


def in_node(text: str) -> Any:
    """Run a module in JavaScript, and parse the JSON that it prints. SOURCES in it is the folder of the viewer."""
    sources = (bundle.WEB / "src").as_uri()
    done = subprocess.run(["node", "--expose-gc", "--input-type=module", "-e", text.replace("SOURCES", sources)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
