# SPDX-License-Identifier: Apache-2.0
"""Exported apps fly: on the pocket cFE, in lock-step with their registers, they put out the desktop's bits."""

import pytest

import fledge
from fledge import export
from fledge.export import cfs
from fledge.export.cfs import hosted
from fledge.export.cfs.testing import Core, Outside
from fledge.export.testing import Recorded

NS = 1_000_000_000


def flown(name, folder, duration):
    """Fly an app with what the desktop's flight is told; (ticks, where it differs or None, the core's report)."""
    sim = fledge.load(name)
    mission = export.read(sim)
    app = cfs.App("fsw")
    cfs.write(mission, app, folder / "fsw", outputs="all")
    program = hosted.build([(app, folder / "fsw")], folder / "run")
    inputs, outputs = [m.path for m in mission.inputs], [m.path for m in mission.outputs]
    recorded = Recorded(sim, [*inputs, *outputs], sim.flight._core_process.tasks[0][1] / NS)
    sim.run(duration)
    told = {p: recorded.samples(p) for p in inputs}
    said = {p: recorded.samples(p) for p in outputs}
    outside = Outside(mission, folder / "outside")
    core = Core(program, outside)
    try:
        outside.tick(-1)
        for i, t in enumerate(recorded.times()):
            for path, samples in told.items():
                outside.put(path, samples[i])
            outside.tick(t, 0)
            for path, samples in said.items():
                if outside.take(path, t) != samples[i]:
                    return i, (t, path), None
        outside.stop()
        return i, None, core.end()
    finally:
        core.kill()
        outside.close()


@pytest.mark.parametrize("name", ["nadir_spin", "asterisk_scan", "two_body_pointing"])
def test_an_app_puts_out_the_same_bits(name, tmp_path):
    ticks, difference, report = flown(name, tmp_path, 600.0)
    assert difference is None
    assert ticks >= 1200
    assert report["errors"] == 0 and report["overflow"] == 0
