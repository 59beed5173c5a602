# SPDX-License-Identifier: Apache-2.0
"""Triple-spiral scanning: the thesis' figures 2.16 and 2.17."""
from fledge import scan
from fledge.units import minute, s

from .flight import OUTWARD, SETTLE, SPIRAL

PERIOD = (SETTLE + SPIRAL).to(s)


def spirals(sim):
    """b1 draws three spirals of three turns, each about a centre of its own, and returns to the middle."""
    f, w = sim.flight, sim.world
    log = sim.record(
        f.guidance.reference, f.centre.reference, f.tilt.reference, f.turns.command, f.tilts.command,
        f.centres.command, f.tracking.error, f.motor.command, w.craft.state, every=1 * s)

    sim.run(160 * minute)

    base     = "guidance.reference.sigma_RN"
    nominal  = scan.path(log, "tilt.reference.sigma_RN", base=base)
    centre   = scan.path(log, "centre.reference.sigma_RN", base=base)
    achieved = scan.path(log, "state.sigma_BN", base=base)
    begin    = [k * PERIOD + SETTLE.to(s) for k in range(3)]
    drawn    = [nominal.during(t, t + SPIRAL.to(s) - 1) for t in begin]
    _plot(log, drawn, achieved)

    # The three lists keep step, and every raster begins when it should, to the nanosecond.
    spiral, rest = {round(t * 1e9) for t in begin}, {round(k * PERIOD * 1e9) for k in range(4)}
    for name, due in (("turns", spiral | rest), ("tilts", spiral | rest), ("centres", rest)):
        assert set(log[f"{name}.command.start"]) == due, f"a raster of {name} begins off its time"

    # Each is a spiral about its own centre, tracked once the body has caught up with the roll.
    off = achieved.off(nominal)
    for number, t in enumerate(begin, 1):
        now = (log.time >= t) & (log.time < t + SPIRAL.to(s))
        radius = nominal.off(centre)[now]
        assert abs(radius - (OUTWARD * s).value * (log.time[now] - t)).max() < 1e-12, f"spiral {number} is none"
        late = now & (log.time > t + 300)
        assert off[late].max() < 1e-4, f"spiral {number} is missed by {off[late].max():.2g} rad"
        assert abs(log["command.u"][late]).max() < 0.01, f"tracking spiral {number} takes large torques"
    assert abs(log["command.u"]).max() < 0.2 + 1e-12, "the torques exceed their limit"

    # The boresight returns to the middle.
    assert off[-1] < 1e-5, f"the boresight ends {off[-1]:.2g} rad off the middle"


def _plot(log, drawn, achieved):
    # Colours as in figure 2.16: magenta is commanded, blue is flown.
    title, colors = "Three spirals, and back to the middle", (scan.MAGENTA, scan.DARK)
    paths = {"nominal": drawn, "achieved": achieved}
    log.plot("error.sigma_BR", "error.omega_BR_B", "command.u",
             titles=["(a) attitude error", "(b) rate error", "(c) wheel torques"],
             name="triple_spiral_errors", title=title)
    scan.plane(log, paths, colors=colors, numbered="nominal", marks={"start and end": (0, 0)},
               name="triple_spiral_plane", title=title)
    scan.sphere(log, paths, colors=colors, name="triple_spiral_sphere", title=title)
