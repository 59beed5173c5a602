# SPDX-License-Identifier: Apache-2.0
"""A telescope's slew by star tracker and gyro, the same with faults of both, and how the wheels shake it."""
import numpy as np

from fledge import flight as fsw
from fledge.attitude import mrp_to_dcm
from fledge.units import deg, hour, minute, ms, rad, s

TARGET = [0, 0, 0.41]       # 89 deg about b3
SLEW = 4 * 60               # [s] when it begins
JUMP = SLEW + 240           # [s] when the gyro's bias jumps


def slew(sim):
    """From one target to another, with the gyro alone where the body turns too fast for the star tracker."""
    log = _fly(sim, "slew")
    off, error = _errors(log)
    assert log.last("filter.state.rejected") == 0, "a sound attitude was rejected"
    turning = np.degrees(np.linalg.norm(log["craft.state.omega_BN_B"], axis=1)) > 0.6
    assert np.ptp(log["filter.state.used"][turning]) <= 1, "the star tracker sees while the body turns fast"
    _settles(log, off, error)


def faults(sim):
    """The star tracker says the same from before the slew until after it; later the gyro's bias jumps."""
    stars, gyro = sim.world.stars, sim.world.gyro
    stars.n_faults, gyro.n_faults = 1, 1
    stuck, jump = stars.faults[0], gyro.faults[0]
    stuck.kind, stuck.size, stuck.begin, stuck.lasts = "HIGH", 0.1, (SLEW - 20) * s, 150 * s
    jump.kind, jump.size, jump.channels = "BIAS", float(30 * deg / hour / (rad / s)), 0b010
    jump.begin = JUMP * s

    log = _fly(sim, "faults")
    off, error = _errors(log)
    quality = log["filter.attitude.head.quality"]
    assert quality[(log.time > SLEW + 70) & (log.time < SLEW + 125)].max() == fsw.Quality.DEGRADED, \
        "an old attitude is said to be good"
    assert log.last("filter.state.restarts") == 1, "the filter did not begin anew, once, after the jump"
    _settles(log, off, error, disturbed=JUMP)


def exposure(sim):
    """A second of the telescope at rest: what the wheels' imbalance adds between the updates of the control."""
    log = sim.record(sim.world.craft.state, every=4 * ms)
    sim.run(1 * minute)
    shaken = np.degrees(np.sqrt(np.mean(_shaking(log)**2, axis=0))) * 3600e3
    print("the wheels shake the telescope by", ", ".join(
        f"{angle:.2g}" for angle in shaken), "mas about its axes (1 sigma)")
    assert 0.5 < shaken.max() < 5, f"the wheels shake the telescope by {shaken.max():.2g} mas (1 sigma)"


def _shaking(log):
    """(n, 3) [rad] In the last second, the attitude less a parabola through each 0.2 s of constant torque."""
    t = np.round(log.time - log.time[-1] + 1, 9)
    last = (t >= 0) & (t < 1)
    t, attitude = t[last], log["craft.state.sigma_BN"][last]
    turned = _turn(attitude, attitude[:1])
    for i in range(5):
        part = (t >= 0.2 * i) & (t < 0.2 * (i + 1))
        x = np.vander(t[part] - 0.2 * i, 3)
        turned[part] -= x @ np.linalg.lstsq(x, turned[part], rcond=None)[0]
    return turned


def _fly(sim, name):
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, w.wheels.speeds, w.panels.angles,
                     f.filter.attitude, f.filter.state, f.tracking.error, every=1 * s)
    sim.run(SLEW * s)
    f.guidance.sigma_RN = TARGET
    sim.run(8 * minute)
    log.plot("tracking.error.sigma_BR", "filter.state.attitude_std", "filter.state.bias_B", "panels.angles.theta",
             "speeds.Omega",
             titles=["(a) attitude error, as flight knows it", "(b) standard deviations of the attitude",
                     "(c) estimated bias of the gyro", "(d) panels", "(e) wheel speeds"],
             units={"filter.state.attitude_std": "arcsec", "filter.state.bias_B": "deg/hour"},
             name=name, title="A slew by star tracker and gyro")
    return log


def _errors(log):
    """(n, 3) turns [rad]: from the target to the body, and from the estimated attitude to the true one."""
    target = np.where((log.time > SLEW)[:, None], TARGET, [0, 0, 0])
    return (_turn(log["craft.state.sigma_BN"], target),
            _turn(log["craft.state.sigma_BN"], log["filter.attitude.sigma_BN"]))


def _turn(a, b):
    c = mrp_to_dcm(a) @ np.swapaxes(mrp_to_dcm(b), 1, 2)
    return np.stack([c[:, 1, 2] - c[:, 2, 1], c[:, 2, 0] - c[:, 0, 2], c[:, 0, 1] - c[:, 1, 0]], axis=1) / 2


def _settles(log, off, error, disturbed=None):
    """By the truth: the estimate is as good as it says, and the body on its targets."""
    std = log["filter.state.attitude_std"]
    good = log["filter.attitude.head.quality"] == fsw.Quality.GOOD
    if disturbed:
        good &= abs(log.time - disturbed - 4) > 4       # until it is clear that not the star tracker is wrong
    assert (np.abs(error[good]) < 5 * std[good]).all(), "the attitude is worse than the filter says"
    for late in ((log.time > SLEW - 60) & (log.time <= SLEW), log.time > log.time[-1] - 60):
        worst = np.linalg.norm(off[late], axis=1).max()
        assert worst < 4e-4, f"the body is {worst:.2g} rad off its target"
