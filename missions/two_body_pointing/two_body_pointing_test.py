# SPDX-License-Identifier: Apache-2.0
"""Two-body pointing by its angle conditions, against another ephemeris than the one that it flies on."""

import os
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import attitude
from fledge import flight as fsw
from fledge.units import deg, minute, s
from tests.needs import module

DATA = Path(os.environ.get("FLEDGE_TEST_DATA", Path(__file__).parents[3] / "shared" / "data"))
JD = 2457084.0  # 2015-03-02 12:00 UTC; the 67.184 s to TDB are added below


@pytest.mark.parametrize("scenario", ["earth_and_sun", "near_conjunction"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("two_body_pointing")
    sim.plots = False
    sim.scenarios[scenario]()


def test_antenna_and_panels_by_de430():
    jplephem = module("jplephem.spk")
    kernel = DATA / "de430-2015-03-02.bsp"
    if not kernel.exists():
        pytest.skip(f"the kernel {kernel} is not there")
    sim = fledge.load("two_body_pointing")
    log = sim.record(sim.world.craft.state, every=10 * s)
    sim.run(100 * minute)
    late = log.time > 40 * 60
    time = JD, (log.time[late] + 67.184) / 86400

    with jplephem.SPK.open(str(kernel)) as spk:
        mars = spk[0, 4].compute(*time)
        earth = spk[0, 3].compute(*time) + spk[3, 399].compute(*time)
        sun = spk[0, 10].compute(*time)
    seen = [1e3 * (body - mars).T - log["state.r_BN_N"][late] for body in (earth, sun)]
    earth, sun = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in seen)
    b1, b2, b3 = np.moveaxis(attitude.mrp_to_dcm(log["state.sigma_BN"][late]), 1, 0)

    # DE405 and DE430 differ by less than 1 km there, of 2 au.
    assert np.linalg.norm(np.cross(b1, earth), axis=1).max() < 2e-8 and np.sum(b1 * earth, axis=1).min() > 0
    assert np.abs(np.sum(b3 * sun, axis=1)).max() < 2e-8
    # No other direction across the antenna's is nearer to the Sun than b2.
    best = np.linalg.norm(np.cross(earth, sun), axis=1)
    np.testing.assert_allclose(np.sum(b2 * sun, axis=1), best, rtol=2e-8)


def test_without_the_sun_earth_is_kept_and_the_reference_is_degraded():
    sim = fledge.load("two_body_pointing")
    f = sim.flight
    f.guidance.separation_min = 20 * deg
    log = sim.record(f.guidance.reference, f.guidance.status, sim.world.earth.state, sim.world.craft.state,
                     every=10 * s)
    sim.run(100 * minute)
    assert (log["reference.head.quality"] == fsw.Quality.DEGRADED).all() and (log["status.secondary"] == 1).all()
    late = log.time > 40 * 60
    line = log["earth.state.r_PN_N"][late] - log["craft.state.r_BN_N"][late]
    b1 = attitude.mrp_to_dcm(log["craft.state.sigma_BN"][late])[:, 0]
    assert np.linalg.norm(np.cross(b1, line), axis=1).max() < 1e-8 * np.linalg.norm(line[0])


def test_it_draws_its_figures(tmp_path):
    from fledge.cli import main

    assert main(["run", "two_body_pointing", "--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("two_body_pointing_*.png"))) == 2
