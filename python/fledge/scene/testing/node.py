# SPDX-License-Identifier: Apache-2.0
"""The viewer's own code, outside of a browser."""

from __future__ import annotations

import json
import shutil
import subprocess
from typing import Any

import pytest

from fledge.scene import bundle

needs_node = pytest.mark.skipif(not shutil.which("node"), reason="needs node, which runs the viewer's code")


def in_node(text: str) -> Any:
    """Run a module in JavaScript, and parse the JSON that it prints. SOURCES in it is the folder of the viewer."""
    sources = (bundle.WEB / "src").as_uri()
    done = subprocess.run(["node", "--expose-gc", "--input-type=module", "-e", text.replace("SOURCES", sources)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
