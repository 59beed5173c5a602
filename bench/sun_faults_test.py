# SPDX-License-Identifier: Apache-2.0
"""A short study of faults of sun sensors: what geometry shows is found, and no sound converter is blamed."""
import numpy as np
import pytest

from bench import sun_faults


def test_geometry_finds_the_direction_and_what_does_not_fit():
    random, geometry = np.random.default_rng(3), sun_faults.Geometry()
    for k in range(20):
        cosines = np.maximum(0, sun_faults.AXES @ sun_faults.direction(random))
        assert geometry.misfits(cosines).max() < 1e-4
        worse = sun_faults.faulty(cosines, k % 8, "high", random)
        misfits = geometry.misfits(worse)
        assert misfits[k % 8] < 1e-4 and misfits[8 + (k % 8) // 4] < 1e-4 and misfits[10] > 0.3
        assert geometry.shows(worse, (k % 8) // 4) and not geometry.shows(cosines, 0)


@pytest.mark.long("many faults of sun sensors")
def test_what_geometry_shows_is_found_and_no_sensor_blamed_wrongly():
    table = sun_faults.study(10, seed=2)
    for kind, row in table.items():
        assert row["wrongly"] == 0 and row["faults"] == 80
        assert row["found of these"] >= row["shown"] - 2 and row["found of others"] <= 6, (kind, row)
        assert row["error [rad]"] < 0.1
    assert table["high"]["shown"] == 80 and 30 < table["low"]["shown"] < 45
    lines = sun_faults.show(table)
    assert len(lines) == 1 + len(sun_faults.KINDS) and lines[2].split()[:2] == ["low", "80"]
