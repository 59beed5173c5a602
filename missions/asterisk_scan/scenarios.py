# SPDX-License-Identifier: Apache-2.0
"""Asterisk scanning: the thesis' second maneuver, chapter 2.2.3.2, table 2.4, figures 2.11 and 2.12."""
from fledge import scan
from fledge.units import deg, minute, s

from .flight import LINE, asterisk


def narrow(sim):
    """alpha = 8 deg, each line entered half of alpha early: the body follows it from end to end."""
    _fly(sim, alpha=8 * deg, lead=0.5)


def narrow_no_lead(sim):
    """alpha = 8 deg, without a lead: a quarter of each line passes before the body is on it."""
    _fly(sim, alpha=8 * deg, lead=0.0)


def wide(sim):
    """alpha = 24 deg, each line entered half of alpha early, which is enough for a three times longer way."""
    _fly(sim, alpha=24 * deg, lead=0.5)


def wide_no_lead(sim):
    """alpha = 24 deg, without a lead."""
    _fly(sim, alpha=24 * deg, lead=0.0)


def _fly(sim, alpha, lead):
    f, w = sim.flight, sim.world
    for name, value in asterisk(alpha, lead).items():
        setattr(f.rasters, name, value)
    log = sim.record(
        f.guidance.reference, f.rasters.status, f.rasters.command, f.scan.reference,
        f.tracking.error, f.motor.command, w.craft.state, every=1 * s)

    sim.run(160 * minute)

    # Each raster begins with the lead and goes on with the line.
    entry    = lead / 2 * LINE.to(s)
    raster   = entry + LINE.to(s)
    nominal  = scan.path(log, "scan.reference.sigma_RN", base="guidance.reference.sigma_RN")
    achieved = scan.path(log, "state.sigma_BN", base="guidance.reference.sigma_RN")
    lines    = [nominal.during(k * raster + entry, (k + 1) * raster - 1) for k in range(4)]
    flown    = [achieved.during(k * raster + entry, (k + 1) * raster - 1) for k in range(4)]
    leads    = {"lead": [nominal.during(k * raster, k * raster + entry) for k in range(4)]} if lead else {}
    _plot(log, {"nominal": lines, "achieved": achieved, **leads}, alpha, lead)

    # Every raster begins when it should, to the nanosecond.
    late = log["status.elapsed"] + log["command.start"] - log["status.head.t"]
    assert not late.any(), f"a raster begins {abs(late).max()} ns off its time"
    due = {round(k * raster * 1e9) for k in range(5)}
    assert set(log["command.start"]) == due, "a raster begins off its time"

    # On the lines: from the angle that is left at a, to nothing at b. Without the lead the body is
    # still on its way from the line before, as far away as 2 alpha.
    on_line = 0.002 * alpha.value
    for number, (is_, wanted) in enumerate(zip(flown, lines), 1):
        off = is_.off(wanted)
        assert off[-1] < 1e-6 * alpha.value, f"line {number} is missed by {off[-1]:.2g} rad at its end"
        missed = (off > on_line).mean()
        if lead:
            assert missed == 0, f"line {number} is missed by {off.max():.2g} rad"
        else:
            assert 0.15 < missed < 0.35, f"{missed:.0%} of line {number} pass before the body is on it"

    # The wheels keep to their limit, and the body rests where it began.
    assert abs(log["command.u"]).max() < 0.2 + 1e-12, "the torques exceed their limit"
    home = asterisk(alpha)["angles"].value[0][0]
    yaw, pitch = achieved.angles()[-1]
    assert abs(yaw - home) + abs(pitch) < 1e-9, "the boresight did not return to 1a"
    assert log.last("state.omega_BN_B").norm() < 1e-9, "the body does not rest at the end"


def _plot(log, paths, alpha, lead):
    degrees = f"{alpha.to(deg):g}"
    name  = f"asterisk_{degrees}_deg" + ("" if lead else "_without_lead")
    entry = f"entered {lead:g} $\\alpha$ early" if lead else "without a lead"
    title = rf"Asterisk, $\alpha$ = {degrees} deg, {entry}"
    log.plot("error.sigma_BR", "error.omega_BR_B", "command.u",
             titles=["(a) attitude error", "(b) rate error", "(c) wheel torques"],
             name=f"{name}_errors", title=title)
    scan.plane(log, paths, numbered="nominal", name=f"{name}_plane", title=title)
    scan.sphere(log, paths, rays="nominal", name=f"{name}_sphere", title=title)
