# SPDX-License-Identifier: Apache-2.0
"""A film of a page of a scene, as Chromium shows it, an animated WebP; or a picture."""
from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from fledge.disk import Part
from fledge.errors import SetupError
from fledge.progress import Bar
from fledge.scene import browser, page

if TYPE_CHECKING:
    from os import PathLike

    from PIL import Image

    from fledge.scene.scene import Scene

WIDTH, HEIGHT = 800, 450        # [px]
EACH = 80                       # [ms] of each frame
QUALITY = 45                    # of WebP, up to 100


def write(scene: Scene, path: str | PathLike[str], look: str = "", begin: float | None = None, end: float | None = None,
          frames: int = 180) -> Path:
    """Write a film; returns its path.

    look: what follows # in the page's address: camera, layers, theme
    begin, end: [s] of the first and the last frame; None: those of the scene
    frames: two or more, at an even spacing

    Raises SetupError without Chromium, without such frames, or beyond the scene.
    """
    begin, end = scene.begin if begin is None else begin, scene.end if end is None else end
    if not scene.begin <= begin < end <= scene.end or frames < 2:
        raise SetupError(f"a film has two frames or more, from a time to a later one, both from {scene.begin:g} s to "
                         f"{scene.end:g} s; this has {frames}, from {begin:g} s to {end:g} s")
    path = Path(path)
    times = [begin + (end - begin) * k / (frames - 1) for k in range(frames)]
    first, *others = _pictures(scene, path, look, times, "filmed")
    with Part(path) as part:
        first.save(part, "WEBP", save_all=True, append_images=others, duration=EACH, loop=0, quality=QUALITY, method=4)
    return path


def picture(scene: Scene, path: str | PathLike[str], look: str = "", at: float | None = None) -> Path:
    """Write a picture without controls and numbers, at a time [s]; None: the end of the scene. Else as write()."""
    at = scene.end if at is None else at
    if not scene.begin <= at <= scene.end:
        raise SetupError(f"a picture is of a time from {scene.begin:g} s to {scene.end:g} s; this is of {at:g} s")
    path = Path(path)
    _pictures(scene, path, look, [at], "bare")[0].resize((480, 270)).save(path, quality=QUALITY, method=6)
    return path


def _pictures(scene: Scene, path: Path, look: str, times: list[float], style: str) -> list[Image.Image]:
    """Pictures of the page at times [s], with a class of view.css, and the progress under the name of a file."""
    from PIL import Image

    if not browser.PROGRAM:
        raise SetupError("this needs Chromium; as root, run: apt-get install chromium (Ubuntu has it as a snap only)")
    pictures = []
    shown = page.write(scene, path.with_name(f"{path.name}.html"))
    try:
        with browser.Browser(WIDTH, HEIGHT) as chromium, Bar(path.name) as bar:
            chromium.open(shown, f"#map=0&{look}")
            chromium.evaluate(f"fledgeView.root.classList.add('{style}')")
            for k, t in enumerate(times):
                bar.at(k / len(times), f"{k} of {len(times)} frames")
                chromium.evaluate(f"fledgeView.seek({t!r})")
                chromium.wait_for("!fledgeView.dirty")
                pictures.append(Image.open(io.BytesIO(chromium.picture())).convert("RGB"))
    finally:
        shown.unlink(missing_ok=True)
    return pictures
