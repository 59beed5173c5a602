# SPDX-License-Identifier: Apache-2.0
"""Constrained two-body pointing: chapter 2.2.2.1 of the thesis, figure 2.5, on a real date."""
from fledge import scan
from fledge.units import deg, minute, s

COLLINEAR, TRACKED = 1, 2       # the status of the Sun


def earth_and_sun(sim):
    """b1 finds Earth from a tumble and stays on it; b2 points as nearly as possible at the Sun."""
    log = _record(sim)
    sim.run(160 * minute)
    _plot(log)

    assert (log["status.secondary"] == TRACKED).all(), "the Sun is not used"
    assert abs(log["command.u"]).max() < 0.2 + 1e-12, "the torques exceed their limit"
    late = log.time > 40 * 60
    b1_earth, b2_sun, b3_sun, apart = (x[late] for x in _angles(log))

    # The first condition holds exactly; the second as well as it can: b2 lies in the plane of the two
    # bodies, on the Sun's side, and so is a right angle less their separation away from it.
    right = (90 * deg).value
    assert b1_earth.max() < 1e-8, f"the antenna is {b1_earth.max():.2g} rad off Earth"
    assert abs(b3_sun - right).max() < 1e-8, "the Sun is not in the plane of b1 and b2"
    assert abs(b2_sun - (right - apart)).max() < 1e-8, "the panels are not as near to the Sun as can be"
    assert abs(log["status.separation"][late] - apart).max() < 1e-8, "the separation is not as reported"


def near_conjunction(sim):
    """While the Sun is too near the line through Earth, only Earth is tracked, exactly."""
    f = sim.flight
    log = _record(sim)
    sim.run(60 * minute)
    f.guidance.separation_min = 20 * deg    # that day they are 18 deg apart
    sim.run(60 * minute)
    f.guidance.separation_min = 1 * deg
    sim.run(40 * minute)

    given_up = (log.time > 60 * 60) & (log.time <= 120 * 60)
    assert ((log["status.secondary"] == COLLINEAR) == given_up).all(), "the Sun is given up at the wrong time"
    b1_earth, _, b3_sun, _ = _angles(log)
    late = log.time > 40 * 60
    # The small turn back to the Sun, about the line to Earth, shakes the antenna by an arcsecond.
    assert b1_earth[late].max() < 1e-5, f"the antenna is {b1_earth[late].max():.2g} rad off Earth"
    # The body does not turn about the line to Earth, and in an hour the Sun leaves the plane of b1 and
    # b2 by little.
    left = abs(b3_sun - (90 * deg).value)[late]
    assert left.max() < 2e-5, f"the Sun is {left.max():.2g} rad out of the plane of b1 and b2"
    assert abs(log["command.u"][late]).max() < 1e-3, "the wheels work hard when the Sun comes and goes"


def _record(sim):
    f, w = sim.flight, sim.world
    return sim.record(f.guidance.status, f.tracking.error, f.motor.command,
                      w.craft.state, w.earth.state, w.sun.state, every=1 * s)


def _angles(log):
    """Of the truth, from b1 to Earth, b2 to the Sun, b3 to the Sun, Earth to the Sun: four (n,) [rad]."""
    b1, b2, b3 = (scan.path(log, "craft.state.sigma_BN", boresight=k) for k in (1, 2, 3))
    earth, sun = (scan.Path(log.time, log[f"{name}.state.r_PN_N"] - log["craft.state.r_BN_N"])
                  for name in ("earth", "sun"))
    return b1.off(earth), b2.off(sun), b3.off(sun), earth.off(sun)


def _plot(log):
    title = "Earth first, Sun second, from Mars on 2 March 2015"
    log.plot("error.sigma_BR", "error.omega_BR_B", "command.u", "status.separation",
             titles=["(a) attitude error", "(b) rate error", "(c) wheel torques",
                     "(d) Earth and Sun apart"],
             units={"status.separation": "deg"}, columns=2, name="two_body_pointing_errors", title=title)
    axes = {f"$b_{k}$, {what}": scan.path(log, "craft.state.sigma_BN", boresight=k).during(0, 600)
            for k, what in ((1, "the antenna"), (2, "the panels"))}
    scan.sphere(log, axes, view=(235 * deg, 25 * deg), name="two_body_pointing_sphere", title=title,
                marks={"Earth": log["earth.state.r_PN_N"][0], "Sun": log["sun.state.r_PN_N"][0]})
