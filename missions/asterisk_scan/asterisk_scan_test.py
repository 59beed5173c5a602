# SPDX-License-Identifier: Apache-2.0
"""The asterisk as numbers: figures 2.11 and 2.12 of the thesis, against the lines of table 2.4 themselves."""

import numpy as np
import pytest

import fledge
from fledge import attitude
from fledge.units import minute, s

# alpha [deg], lead, and the largest distance from the nominal lines [deg], in the order of the lines
LED = [("narrow", 8, [0.0021, 0.0058, 0.0097, 0.0023]), ("wide", 24, [0.0060, 0.0170, 0.0302, 0.0066])]

# Where the lines begin and end, in units of alpha: table 2.4 and figure 2.12(a).
ENDS = [((1, 0), (-1, 0)), ((-1, -1), (1, 1)), ((1, -1), (-1, 1)), ((0, 1), (0, -1))]


def flown(scenario):
    """(sim, time, yaw and pitch [deg] of the body in N, largest torque), sampled each second."""
    sim = fledge.load("asterisk_scan")
    sim.plots = False
    log = sim.record(sim.world.craft.state, sim.flight.motor.command, every=1 * s)
    sim.scenarios[scenario]()
    angles = np.degrees(attitude.mrp_to_euler(log["state.sigma_BN"]))[:, :2]
    return sim, log.time, angles, np.abs(log["command.u"]).max(axis=1)


@pytest.mark.parametrize("scenario, alpha, limits", LED)
def test_with_the_lead_every_line_is_flown_on_time_from_end_to_end(scenario, alpha, limits):
    _, time, angles, torque = flown(scenario)
    for k, ((a, b), limit) in enumerate(zip(ENDS, limits)):
        # The lead takes 400 s, the line 1600 s at a constant rate.
        share = (time - (2000 * k + 400))[:, None] / 1600
        line = alpha * ((1 - share) * np.array(a) + share * np.array(b))
        on = (share[:, 0] >= 0) & (share[:, 0] < 1)
        off = np.linalg.norm(angles - line, axis=1)[on]
        assert on.sum() == 1600 and off.max() < limit and off.argmax() == 0
        assert off[-400:].max() < 1e-5 * alpha
    np.testing.assert_allclose(angles[-1], [alpha, 0], atol=1e-10)
    # Between the captures next to nothing is needed: the lines are nearly great circles.
    quiet = np.concatenate([torque[2000 * k + 400:2000 * k + 2000] for k in range(4)])
    assert quiet.max() < 1e-3 and [torque[2000 * k:2000 * k + 5].max() > 0.03 for k in range(5)] == [True] * 5


@pytest.mark.parametrize("scenario, alpha", [("narrow_no_lead", 8), ("wide_no_lead", 24)])
def test_without_it_a_quarter_of_each_line_is_missed(scenario, alpha):
    _, time, angles, _ = flown(scenario)
    for k, (a, b) in enumerate(ENDS):
        share = (time - 1600 * k)[:, None] / 1600
        line = alpha * ((1 - share) * np.array(a) + share * np.array(b))
        on = (share[:, 0] >= 0) & (share[:, 0] < 1)
        off = np.linalg.norm(angles - line, axis=1)[on]
        before = (0, 0) if k == 0 else ENDS[k - 1][1]
        assert off[0] == pytest.approx(alpha * np.hypot(*np.subtract(a, before)), rel=1e-2)
        assert 250 < np.argmax(off < 0.002 * alpha) < 450 and off[-1] < 1e-6 * alpha


def test_rasters_begin_to_the_nanosecond_whatever_the_rate_of_the_task():
    sim = fledge.load("asterisk_scan")
    f = sim.flight
    durations = np.array([100.1, 33.333333333, 7.25, 0.7, 50])
    f.rasters.durations = durations
    log = sim.record(f.rasters.command, f.rasters.status, f.scan.euler)
    sim.run(4 * minute)
    starts = [0, *np.cumsum(np.round(durations * 1e9).astype(int))]
    assert list(dict.fromkeys(log["command.start"])) == starts
    assert (log["status.head.t"] == log["command.start"] + log["status.elapsed"]).all()
    # Seen up to half a second late, each line is where it would be had it been seen at once.
    index = log["status.index"]
    since = log["euler.head.t"] / 1e9 - np.array(starts)[index] / 1e9
    running = log["status.done"] == 0
    expected = f.rasters.angles[index] + f.rasters.rates[index] * since[:, None]
    np.testing.assert_allclose(log["euler.angles"][running], expected[running], atol=1e-15)


@pytest.mark.long("draws all figures")
def test_it_draws_its_figures(tmp_path):
    from fledge.cli import main

    assert main(["run", "asterisk_scan", "--out", str(tmp_path)]) == 0
    assert sorted(p.stem for p in tmp_path.glob("*.png")) == [
        "asterisk_8_deg_errors", "asterisk_8_deg_plane", "asterisk_8_deg_sphere"]
