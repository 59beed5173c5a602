# SPDX-License-Identifier: Apache-2.0
"""The safe mode as numbers."""

import numpy as np
import pytest

import fledge
from fledge import flight as fsw
from fledge.attitude import mrp_to_dcm
from fledge.units import minute, s
from tests.circles import long_after


@pytest.mark.parametrize("scenario", ["safe", "blind"])
def test_the_scenarios_pass(scenario):
    sim = fledge.load("sun_safe")
    sim.plots = False
    sim.scenarios[scenario]()


@pytest.mark.parametrize("seed", long_after(1, range(5), "more draws"))
def test_it_finds_the_sun_from_any_tumble(seed):
    random = np.random.default_rng(seed)
    sim = fledge.load("sun_safe", seed=seed)
    sim.world.craft.sigma_BN = random.uniform(-0.5, 0.5, 3)
    sim.world.craft.omega_BN_B = np.radians(random.uniform(-3, 3, 3))
    log = sim.record(sim.world.craft.state, sim.world.light.light, every=1 * s)
    sim.run(6 * minute)
    b1, sun = mrp_to_dcm(log["state.sigma_BN"][-1])[0], log["light.s_N"][-1]
    assert np.degrees(np.arccos(b1 @ sun)) < 4


def test_a_sun_of_good_quality_is_no_false_one():
    """From 40 random starts: two lit sensors alone have two directions that fit."""
    random = np.random.default_rng(39)
    for seed in range(40):
        sim = fledge.load("sun_safe", seed=seed)
        sim.world.craft.sigma_BN = random.uniform(-0.5, 0.5, 3)
        sim.world.craft.omega_BN_B = np.radians(random.uniform(-3, 3, 3))
        line = sim.flight.line
        log = sim.record(sim.world.craft.state, sim.world.light.light, line.heading, line.rate, line.state,
                         every=0.5 * s)
        sim.run(1 * minute)
        good = log["heading.head.quality"] == fsw.Quality.GOOD
        assert good[log.time > 10].mean() > 0.9
        sun = np.einsum("ijk,ik->ij", mrp_to_dcm(log["craft.state.sigma_BN"]), log["light.s_N"])
        off = np.linalg.norm(log["heading.s_B"] - sun, axis=1)
        rate = np.linalg.norm(np.cross(log["line.rate.omega_BN_B"] - log["craft.state.omega_BN_B"], sun), axis=1)
        assert (off < 5 * log["line.state.std"])[good].all() and (rate < 6 * log["line.state.rate_std"])[good].all()


def test_the_spin_waits_until_the_tumble_has_ended():
    sim = fledge.load("sun_safe")
    log = sim.record(sim.flight.tumble.state, sim.flight.safe.error, every=0.5 * s)
    sim.run(5 * minute)
    tripped = log["state.tripped"] == 1
    calm = log.time[tripped].max()
    spins = np.linalg.norm(log["error.omega_RN_B"], axis=1) > 0
    assert 10 < calm < 180 and not spins[log.time <= calm].any() and spins[log.time > calm + 1].all()


# --- faults of sun sensors, 200 s into the run (thesis, section 5.4.3) ------------------------------

@pytest.fixture(scope="module")
def pointing():
    """On the Sun, two sensors of each pyramid lit; without the planned fault."""
    sim = fledge.load("sun_safe")
    sim.world.adc_a.faults = []
    sim.run(200 * s)
    return sim


def fly(pointing, a=(), b=(), duration=100 * s):
    """A run goes on with faults of the converters: its record, how far b1 is from the Sun [deg], and events' number."""
    sim = pointing.clone()
    sim.world.adc_a.faults, sim.world.adc_b.faults = list(a), list(b)
    log = sim.record(sim.world.craft.state, sim.world.light.light, sim.flight.sun.status, every=0.5 * s)
    sim.run(duration)
    b1 = mrp_to_dcm(log["craft.state.sigma_BN"])[:, 0]
    return log, np.degrees(np.arccos(np.einsum("ij,ij->i", b1, log["light.s_N"]))), sim.flight.sun.event.count


@pytest.mark.parametrize("kind", ["HIGH", "LOW", "BABBLE"])
@pytest.mark.parametrize("channels", long_after(1, [0b1111, 0b0001], "flies again"), ids=["all", "one"])
@pytest.mark.parametrize("which", long_after(1, [0, 1], "flies again"), ids="ab")
def test_the_faulty_converter_is_named_and_the_sun_kept(pointing, which, channels, kind):
    fault = [{"kind": kind, "channels": channels, "begin": 200 * s}]
    log, off, events = fly(pointing, **{"ab"[which]: fault})
    named = log.time[log["status.faulty"] != 0]
    late = 10 if (kind, channels) == ("LOW", 0b1111) else 0     # it looks like a half-shadow, until that lasts too long
    assert 10 <= named[0] - 200 - late < 25, "20 updates later, more where a babble looks sound at times"
    assert set(log["status.faulty"]) == {0, 1 << which}, "the other one was blamed"
    assert log["status.unused"][-1] == channels << 4 * which and events == 1
    assert off.max() < 3, "the panels left the Sun"


@pytest.mark.parametrize("a, b, unused", [
    ([], [], 0),
    ([{"kind": "HIGH"}], [{"kind": "HIGH"}], 0),        # both: neither is blamed, and gyros keep the Sun
    ([{"kind": "LOW"}], [{"kind": "LOW"}], 0),          # looks like an eclipse
    ([{"kind": "HIGH", "channels": 4, "begin": t * s, "lasts": 4 * s} for t in (200, 210, 220, 230)], [], 0b0100),
    ([], [{"kind": "DRIFT", "channels": 1, "size": 2}], 0b00010000),    # [counts/s], a thousandth of a cosine each
    ([{"kind": "DROPOUT", "channels": 1}], [], 0),      # stuck, where nothing moves
], ids=["none", "both high", "both low", "intermittent", "drift", "stuck"])
def test_other_faults(pointing, a, b, unused):
    a, b = ([{"begin": 200 * s, **fault} for fault in faults] for faults in (a, b))
    log, off, events = fly(pointing, a, b, 300 * s)
    assert log["status.unused"][-1] == unused and off.max() < 3
    both = "HIGH" in str(a) and bool(b)
    assert (log["status.unresolved"][-1] > 150) == both and (events > 0) == (both or unused != 0)


def test_a_fault_that_clears_leaves_its_sensor_out_until_the_module_is_reset(pointing):
    log, off, _ = fly(pointing, [{"kind": "HIGH", "channels": 2, "begin": 200 * s, "lasts": 30 * s}])
    assert log["status.unused"][-1] == 2 and off.max() < 3
