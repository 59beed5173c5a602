# SPDX-License-Identifier: Apache-2.0
"""Rectangular raster: the scan pattern of the thesis' figure 2.6(a), over a planet during a pass."""
from fledge import scan
from fledge.units import deg, minute, s

from .flight import LINE, PITCH, SETTLE, STEP, SWATH

PASS  = 4800                    # [s]
LINES = [SETTLE + k * (LINE + STEP) for k in range(len(PITCH))]     # [s] when they begin
BASE  = "guidance.reference.sigma_RN"


def raster(sim):
    """b1 scans the planet line by line through periapsis, twice; the second pass repeats the first."""
    f, w = sim.flight, sim.world
    log = sim.record(
        f.guidance.reference, f.rasters.status, f.rasters.command, f.scan.reference,
        f.tracking.error, f.motor.command, w.craft.state, every=1 * s)

    sim.run(160 * minute)

    # The control frame's first axis is scanned away from the radial axis, and b1 is opposite to it.
    nominal  = scan.path(log, "scan.reference.sigma_RN", base=BASE, boresight=-1)
    achieved = scan.path(log, "state.sigma_BN", base=BASE)
    _plot(log, nominal, achieved)

    # Every raster begins when it should, to the nanosecond, in both passes.
    elapsed = log["status.head.t"] - log["command.start"]
    assert (elapsed == log["status.elapsed"]).all(), "a raster begins off its time"
    for k in range(2):
        for start in LINES:
            assert round((k * PASS + start) * 1e9) in log["command.start"], \
                f"no line begins at {k * PASS + start} s"

    # b1 follows the lines within the swath, and cuts the corners beyond.
    off, yaw = achieved.off(nominal), nominal.angles(centre=-1)[:, 0]
    for k in range(2):
        for number, start in enumerate(LINES, 1):
            line = _line(log, k, start) & (abs(yaw) <= (SWATH * deg).value)
            assert line.sum() >= 599, f"line {number} of pass {k + 1} is not there"
            assert off[line].max() < 0.2 * deg, \
                f"line {number} of pass {k + 1} is missed by {off[line].max():.2g} rad"

    # The second pass repeats the first from the point where the first pass has reached its first line.
    first, second = achieved.during(800, PASS - 1), achieved.during(PASS + 800, 2 * PASS - 1)
    assert second.off(first).max() < 1e-3 * deg, "the second pass is not the first"
    assert abs(log["command.u"]).max() < 0.1, "the scan works the wheels too hard"


def _line(log, k, start):
    """Which samples belong to the line that begins at `start` in a pass."""
    return (log.time >= k * PASS + start) & (log.time < k * PASS + start + LINE)


def _plot(log, nominal, achieved):
    title = "Rectangular raster about nadir"
    log.plot("error.sigma_BR", "error.omega_BR_B", "command.u",
             titles=["(a) attitude error", "(b) rate error", "(c) wheel torques"],
             name="rectangular_raster_errors", title=title)
    lines = [nominal.during(PASS + t, PASS + t + LINE - 1) for t in LINES]
    turns = [nominal.during(PASS + a + LINE, PASS + b) for a, b in zip(LINES, LINES[1:] + [PASS])]
    paths = {"nominal": lines, "achieved": achieved, "from line to line": turns}
    scan.plane(log, paths, centre=-1, numbered="nominal", name="rectangular_raster_plane", title=title)
    scan.sphere(log, paths, centre=-1, rays="nominal", name="rectangular_raster_sphere", title=title)
