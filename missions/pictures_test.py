# SPDX-License-Identifier: Apache-2.0
"""Each mission has its picture in the gallery."""

import fledge
from missions import pictures
from tests.needs import module

OTHERS = {"downlink"}       # programs around another mission's


def test_each_mission_has_a_row_and_a_recipe():
    readme = (pictures.HERE / "README.md").read_text(encoding="utf-8")
    missions = set(fledge.missions()) - OTHERS
    assert {*pictures.FIGURES, *pictures.SCENES} == missions
    for mission in missions:
        assert f"| ![{mission}]({mission}/picture.webp) | [`{mission}`]({mission}) |" in readme


def test_pictures_are_small():
    image = module("PIL.Image")
    for mission in (*pictures.FIGURES, *pictures.SCENES):
        path = pictures.HERE / mission / "picture.webp"
        with image.open(path) as shown:
            assert shown.size[0] <= 480 and shown.size[1] <= 360
        assert path.stat().st_size < 25_000
