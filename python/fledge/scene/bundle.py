# SPDX-License-Identifier: Apache-2.0
"""The viewer and the control room's console: built by Node into a script and a style each, where Node is installed. The
console loads the viewer, as viewer.js, only for its 3-D page.

    python3 -m fledge.scene.bundle

npm fetches what web/package-lock.json names, and checks its hashes; esbuild joins it. It is built anew after a change
of a file in web/ or ground/console/web/.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from fledge.disk import may_write
from fledge.errors import SetupError
from fledge.programs import without_preload

WEB = Path(__file__).with_name("web")
CONSOLE = WEB.parents[1] / "ground/console/web"
BUILT = ("view.js", "view.css", "viewer.js", "console.js", "console.css")
ADVICE = "The 3-D view and interactive plots need Node when Fledge is built: ./fledge setup --view installs it"


def folder() -> Path:
    """Where they are: build/view of the checkout, or beside web/ where Fledge is installed."""
    root = Path(__file__).resolve().parents[3]
    return root / "build/view" if (root / "CMakeLists.txt").exists() else WEB.parent / "view"


def built() -> tuple[str, str]:
    """The viewer's script and style. Raises SetupError if it was not built."""
    try:
        return (folder() / "view.js").read_text(encoding="utf-8"), (folder() / "view.css").read_text(encoding="utf-8")
    except OSError:
        raise SetupError(ADVICE) from None


def is_built(*names: str) -> bool:
    """Whether these files are there; by default the viewer's."""
    return all((folder() / name).exists() for name in names or BUILT[:2])


def build() -> None:
    """Build both if a source has changed. Raises SetupError with npm's or esbuild's words if that fails."""
    out = folder()
    sources = {root / path.relative_to(tree): path for tree, root in ((WEB, Path()), (CONSOLE, Path("console")))
               for path in sorted(tree.rglob("*")) if path.is_file() and "node_modules" not in path.parts}
    state = hashlib.sha256(b"".join(f"{name}\0".encode() + path.read_bytes() for name, path in sources.items()))
    stamp = out / "stamp"

    def is_new() -> bool:
        return is_built(*BUILT) and stamp.exists() and stamp.read_text() == state.hexdigest()

    if is_new():
        return
    npm = shutil.which("npm")
    if npm is None:
        raise SetupError(ADVICE)
    if not may_write(out.parent, out):
        raise SetupError(f"the 3-D view must be built, and this user may not write into {out}; its owner can: ./fledge "
                         "setup --view")
    with open(out.with_name("view.lock"), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)    # npm deletes files that another process would use
        if is_new():
            return
        _make(out, npm, sources)
        stamp.write_text(state.hexdigest())


def _make(out: Path, npm: str, sources: dict[Path, Path]) -> None:
    work = out / "work"
    shutil.rmtree(work / "console", ignore_errors=True)     # so that no deleted source remains
    for name, path in sources.items():
        copy = work / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
    for command in ([npm, "ci", "--no-audit", "--no-fund", "--ignore-scripts"], [npm, "run", "--silent", "build"]):
        done = subprocess.run(command, cwd=work, text=True, env=without_preload(os.environ),
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode:
            raise SetupError(f"{' '.join(command[1:3])} failed in {work}:\n{done.stdout.strip()}")
    for built_file in BUILT:
        shutil.copyfile(work / "dist" / built_file, out / built_file)


if __name__ == "__main__":
    try:
        build()
    except SetupError as error:
        sys.exit(f"fledge: {error}")
