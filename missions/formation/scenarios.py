# SPDX-License-Identifier: Apache-2.0
"""Distributed guidance: section 5.5 of the thesis, commanded and sensed, and the deputy's own pointing at the chief."""
import numpy as np

from fledge import scan
from fledge.units import minute, s

from .deputy import ALPHA, LEAD, LINE

RASTER = (LINE + LEAD).to(s)


def commanded(sim):
    """The chief sends its reference by radio; the deputy scans an asterisk about it (figures 5.20 to 5.22)."""
    log = _record(sim)
    sim.run(4 * RASTER)
    _plot(log, "commanded")
    _chief_looks_down(log)

    # What the radio brings a second late is carried to now by its rate and acceleration.
    _on_the_lines(log, within=1e-5)


def sensed(sim):
    """No radio: a camera of the deputy sees the attitude of the chief."""
    sim.process("deputy").base.source = "SENSED"
    log = _record(sim)
    sim.run(4 * RASTER)
    _plot(log, "sensed")
    _chief_looks_down(log)

    # The noise of the camera is 1e-4 rad about each axis.
    _on_the_lines(log, within=6e-4)


def changes(sim):
    """In flight: commanded; then sensed; then the deputy looks at the chief; then commanded again, with other gains."""
    deputy = sim.process("deputy")
    log = _record(sim)
    sim.run(30 * minute)
    deputy.base.source = "SENSED"
    sim.run(10 * minute)
    deputy.base.source = "OWN"
    sim.run(30 * minute)
    deputy.base.source = "COMMANDED"
    deputy.control.K = 3.0
    sim.run(30 * minute)

    # About the chief's attitude, or the way to the chief, lies what the rasters command at that time.
    for name, begin, end, within in (("commanded", 20, 25, 1e-6), ("sensed", 35, 40, 1e-3), ("own", 65, 70, 1e-4),
                                     ("commanded again", 95, 100, 1e-5)):
        off = _off(log, "own" if name == "own" else "chief")[(log.time > begin * 60) & (log.time < end * 60)]
        assert off.max() < within, f"{name}: the deputy is {off.max():.2g} rad off"


def _record(sim):
    process = sim.process
    chief, deputy = process("chief"), process("deputy")
    return sim.record(process("chief_world").craft.state, process("deputy_world").craft.state, chief.base.reference,
                      chief.tracking.error, chief.motor.command, deputy.base.reference, deputy.scan.reference,
                      deputy.rasters.status, deputy.tracking.error, deputy.motor.command, every=1 * s)


def _chief_looks_down(log):
    """b1 of the chief points at the planet, once its tumble has ended."""
    late = log.time > 20 * 60
    down = scan.Path(log.time, -log["chief_world.craft.state.r_BN_N"])
    off = scan.path(log, "chief_world.craft.state.sigma_BN", boresight=1).off(down)[late]
    assert off.max() < 1e-5, f"the chief is {off.max():.2g} rad off the planet"
    assert np.abs(log["chief.motor.command.u"]).max() < 0.2 + 1e-12, "the torques exceed their limit"


def _off(log, base="chief"):
    """How far b1 of the deputy is from where it should be, by the truth: the base, turned as the deputy commands."""
    nominal = scan.path(log, "deputy.scan.reference.sigma_RN", base="deputy.base.reference.sigma_RN")
    true = "chief_world.craft.state.sigma_BN" if base == "chief" else "deputy.base.reference.sigma_RN"
    return scan.path(log, "deputy_world.craft.state.sigma_BN", base=true).off(nominal)


def _on_the_lines(log, within):
    """The deputy's boresight relative to the chief's true attitude keeps to each line of the asterisk."""
    off = _off(log)
    assert set(log["deputy.rasters.status.index"]) == {0, 1, 2, 3}, "not all lines were flown"
    for k in range(4):
        line = off[(log.time > k * RASTER + LEAD.to(s)) & (log.time < (k + 1) * RASTER)]
        # A line is entered from the one before, or from a tumble.
        for begin, limit in ((0, 0.25 * ALPHA.value), (300, 50 * within), (900, within)):
            worst = line[begin:].max()
            assert worst < limit, f"line {k + 1} is missed by {worst:.2g} rad, {begin} s from its begin"


def _plot(log, name):
    title = f"The deputy, {name}"
    log.plot("deputy.tracking.error.sigma_BR", "deputy.tracking.error.omega_BR_B", "deputy.motor.command.u",
             titles=["(a) attitude error", "(b) rate error", "(c) wheel torques"], name=f"formation_{name}_errors",
             title=title)
    paths = {"nominal": scan.path(log, "deputy.scan.reference.sigma_RN", base="deputy.base.reference.sigma_RN"),
             "achieved": scan.path(log, "deputy_world.craft.state.sigma_BN", base="chief_world.craft.state.sigma_BN")}
    scan.plane(log, {key: path.during(LEAD.to(s), 4 * RASTER) for key, path in paths.items()},
               name=f"formation_{name}_plane", title=title + ": relative to the chief")
