# SPDX-License-Identifier: Apache-2.0
"""The pictures of missions/README.md: a figure of a scenario, or the spacecraft in 3-D.

    /usr/bin/python3 -m missions.pictures [MISSION...]

flies each mission anew and writes its picture.webp. It needs what `fledge view --picture` does.
"""
from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SIZE = (480, 360)       # [px] at most
QUALITY = 60            # of WebP
# Of a mission, its scenario, and a figure that this writes, or the time of a picture in 3-D and its look.
FIGURES = {"nadir_spin": ("", "nadir_spin.png"), "asterisk_scan": ("wide", "asterisk_*_plane.png"),
           "rectangular_raster": ("", "*_sphere.png"), "single_spiral": ("", "*_plane.png"),
           "triple_spiral": ("", "*_plane.png"), "inertial_spin": ("", "inertial_spin.png"),
           "formation": ("", "*_plane.png"), "desaturation": ("", "rods.png"),
           "learned_pointing": ("", "turn.png")}
BARE = "hide=labels,bodyAxes,directions,path,keepout,cones,estimate"
FAR = "camera=orbit&show=enlarged"
SCENES = {"inertial_pointing": ("", "100s", BARE), "mars_orbiter": ("insertion", "4210s", FAR),
          "cubesat": ("imaging", "15min", f"around=5.3,0.25,2.4&{BARE}"), "flatsat": ("", "10min", ""),
          "constellation": ("", "15min", FAR), "star_slew": ("", "5min", ""),
          "relative_orbit": ("", "1h", ""), "earth_imager": ("", "15min", f"around=5.3,0.25,7&{BARE}"),
          "orbit_raising": ("", "60s", BARE), "sun_gazer": ("", "100s", f"camera=sun&{BARE}"),
          "sun_safe": ("", "30min", BARE), "two_body_pointing": ("", "1h", ""), "check_cases": ("", "2h", ""),
          "flyby": ("", "2000s", FAR)}


def fledge(*arguments: str) -> None:
    subprocess.run([sys.executable, "-P", "-m", "fledge.cli", *arguments], check=True, stdout=subprocess.DEVNULL)


def write(mission: str) -> Path:
    """Fly a mission and write its picture; returns its path."""
    from PIL import Image

    path = HERE / mission / "picture.webp"
    figure = mission in FIGURES
    scenario, chosen, *look = FIGURES[mission] if figure else SCENES[mission]
    with tempfile.TemporaryDirectory() as folder:
        fledge("run", mission, *scenario.split(), "--out", folder, *[] if figure else ["--no-plots"])
        if not figure:
            fledge("view", folder, "--picture", str(path), "--at", chosen, "--look", look[0])
            return path
        drawn = Image.open(next(Path(folder).glob(chosen))).convert("RGB")
        drawn.thumbnail(SIZE, Image.Resampling.LANCZOS)
        drawn.save(path, quality=QUALITY, method=6)
    return path


if __name__ == "__main__":
    for name in sys.argv[1:] or [*FIGURES, *SCENES]:
        print(write(name))
