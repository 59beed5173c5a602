# SPDX-License-Identifier: Apache-2.0
"""Spiral scanning: the thesis' third maneuver, chapter 2.2.3.3, figures 2.14 and 2.15."""
from math import pi

from fledge import scan
from fledge.units import minute, s

from .flight import OUTWARD, TURN

HALF = 80 * minute      # of the run: four turns


def spiral(sim):
    """b1 draws four turns, out to 12 deg, and returns to the centre."""
    f, w = sim.flight, sim.world
    log = sim.record(
        f.guidance.reference, f.tilt.reference, f.tracking.error, f.motor.command, w.craft.state, every=1 * s)

    sim.run(HALF)
    # Ground ends the spiral: no rates, and angles that are zero at the centre. The roll is back
    # at its initial angle, so that the body only has to tilt back.
    f.turn.rates, f.tilt.rates = [0, 0, 0], [0, 0, 0]
    sim.run(HALF)

    nominal  = scan.path(log, "tilt.reference.sigma_RN", base="guidance.reference.sigma_RN")
    achieved = scan.path(log, "state.sigma_BN", base="guidance.reference.sigma_RN")
    drawn    = nominal.during(0, HALF.to(s))
    _plot(log, drawn, achieved)

    # The commanded spiral is one: its radius grows with the angle.
    radius = drawn.off([1, 0, 0])
    assert abs(radius - (OUTWARD * s).value * drawn.time).max() < 1e-12, "the radius does not grow evenly"
    assert abs(TURN.value * HALF.value - 4 * 2 * pi) < 1e-12, "these are not four turns"

    # Once the body has caught up with the roll, tracking is perfect, with small torques.
    off = achieved.off(nominal)
    tracked = (log.time > 600) & (log.time <= HALF.to(s))
    assert off[tracked].max() < 1e-6, f"the spiral is missed by {off[tracked].max():.2g} rad"
    assert abs(log["command.u"][tracked]).max() < 0.01, "tracking the spiral takes large torques"
    assert abs(log["command.u"]).max() < 0.2 + 1e-12, "the torques exceed their limit"

    # The boresight returns to its centre, and rests there.
    assert off[-1] < 1e-9, f"the boresight ends {off[-1]:.2g} rad off the centre"
    assert log.last("state.omega_BN_B").norm() < 1e-9, "the body does not rest at the end"


def _plot(log, drawn, achieved):
    title = "Spiral: four turns, and back to the centre"
    # Colours as in figure 2.14: magenta is commanded, blue is flown.
    paths, colors = {"nominal": drawn, "achieved": achieved}, (scan.MAGENTA, scan.DARK)
    log.plot("error.sigma_BR", "error.omega_BR_B", "command.u",
             titles=["(a) attitude error", "(b) rate error", "(c) wheel torques"],
             name="single_spiral_errors", title=title)
    scan.plane(log, paths, colors=colors, marks={"start and end": (0, 0)},
               name="single_spiral_plane", title=title)
    scan.sphere(log, paths, colors=colors, name="single_spiral_sphere", title=title)
