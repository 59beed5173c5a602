# SPDX-License-Identifier: Apache-2.0
"""Distributed guidance: section 5.5 of the thesis, commanded and sensed, and the deputy's own pointing at the chief."""
from dataclasses import replace

import numpy as np

from fledge import SetupError, scan
from fledge.units import minute, s

from .deputy import ALPHA, LEAD, LINE

RASTER = (LINE + LEAD).to(s)
LATE = 10 * minute      # with several deputies one may begin so much later, and ends its lines, too


def commanded(sim):
    """The chief sends its reference by radio; the deputy scans an asterisk about it (figures 5.20 to 5.22)."""
    # What the radio brings a second late is carried to now by its rate and acceleration.
    _asterisks(sim, "commanded", within=1e-5)


def sensed(sim):
    """No radio: a camera of the deputy sees the attitude of the chief."""
    for name in _deputies(sim):
        sim.process(name).base.source = "SENSED"
    # The noise of the camera is 1e-4 rad about each axis.
    _asterisks(sim, "sensed", within=6e-4)


def changes(sim):
    """In flight: commanded; then sensed; then the deputy looks at the chief; then commanded again, with other gains."""
    if len(_deputies(sim)) > 1:
        raise SetupError("the scenario changes is of one deputy; fly commanded or sensed")
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
        achieved = _achieved(log, "deputy") if name != "own" else scan.path(
            log, "deputy_world.craft.state.sigma_BN", base="deputy.base.reference.sigma_RN")
        off = achieved.off(_commanded(log, "deputy"))[(log.time > begin * 60) & (log.time < end * 60)]
        assert off.max() < within, f"{name}: the deputy is {off.max():.2g} rad off"


def _deputies(sim):
    return [process.name for process in sim.flights if process.name.startswith("deputy")]


def _asterisks(sim, kind, within):
    """Each deputy flies four lines, as far as its computer lives."""
    names = _deputies(sim)
    log = _record(sim)
    sim.run(4 * RASTER + (LATE.to(s) if len(names) > 1 else 0))
    lost = [name for i, name in enumerate(names)
            if len(names) > 1 and int(log["chief_guidance.roll.state.lost"][-1]) >> i & 1]
    for name in names:
        if name not in lost:
            _plot(log, name, kind)
    if len(names) > 1:
        _plot_all(log, names, lost, kind)
    _chief_looks_down(log)
    for name in names:
        _on_the_lines(log, name, within, name in lost)


def _record(sim):
    process = sim.process
    chief = process("chief")
    ports = [process("chief_world").craft.state, chief.base.reference, chief.tracking.error, chief.motor.command]
    for name in (names := _deputies(sim)):
        deputy = process(name)
        ports += [process(f"{name}_world").craft.state, deputy.base.reference, deputy.scan.reference,
                  deputy.rasters.status, deputy.tracking.error, deputy.motor.command]
    if len(names) > 1:
        ports += [process(name).roll.state for name in ("chief_guidance", *names)]
    return sim.record(*ports, every=1 * s)


def _chief_looks_down(log):
    """b1 of the chief points at the planet, once its tumble has ended."""
    late = log.time > 20 * 60
    down = scan.Path(log.time, -log["chief_world.craft.state.r_BN_N"])
    off = scan.path(log, "chief_world.craft.state.sigma_BN", boresight=1).off(down)[late]
    assert off.max() < 1e-5, f"the chief is {off.max():.2g} rad off the planet"
    assert np.abs(log["chief.motor.command.u"]).max() < 0.2 + 1e-12, "the torques exceed their limit"


def _achieved(log, name):
    """Where b1 of a deputy points, by the truth, relative to the chief's true attitude."""
    return scan.path(log, f"{name}_world.craft.state.sigma_BN", base="chief_world.craft.state.sigma_BN")


def _commanded(log, name):
    return scan.path(log, f"{name}.scan.reference.sigma_RN", base=f"{name}.base.reference.sigma_RN")


def _begin(log, name):
    """When a deputy's asterisk begins [s]."""
    return log.time[~np.isnan(log[f"{name}.rasters.status.index"])][0]


def _end(log, name):
    """When the computer of a deputy has written last [s]."""
    return np.nanmax(log[f"{name}.rasters.status.head.t"]) / 1e9


def _on_the_lines(log, name, within, lost):
    """The boresight relative to the chief's true attitude keeps to each line of the asterisk. Of a deputy that is lost,
    to those before that."""
    begin, end = _begin(log, name), _end(log, name)
    off = _achieved(log, name).off(_commanded(log, name))
    flown = (log.time > begin) & (log.time <= end)
    assert lost or set(log[f"{name}.rasters.status.index"][flown]) == {0, 1, 2, 3}, f"{name} did not fly all lines"
    for k in range(4):
        line = off[flown & (log.time > begin + k * RASTER + LEAD.to(s)) & (log.time < begin + (k + 1) * RASTER)]
        # A line is entered from the one before, or from a tumble.
        for first, limit in ((0, 0.25 * ALPHA.value), (300, 50 * within), (900, within)):
            worst = line[first:].max(initial=0)
            assert worst < limit, f"{name} misses line {k + 1} by {worst:.2g} rad, {first} s from its begin"


def _plot(log, name, kind):
    """Figures 5.20 (a, b), 5.21 (c, d, e) and 5.22 of the thesis."""
    title = f"The {name}, {kind}" if name == "deputy" else f"{name}, {kind}"
    log.plot(f"{name}_world.craft.state.sigma_BN", f"{name}_world.craft.state.omega_BN_B",
             f"{name}.tracking.error.sigma_BR", f"{name}.tracking.error.omega_BR_B", f"{name}.motor.command.u",
             titles=["(a) true attitude", "(b) true rate", "(c) attitude error", "(d) rate error", "(e) wheel torques"],
             name=f"formation_{name}_{kind}", title=title)
    begin = _begin(log, name)
    scan.plane(log, {label: path.during(begin + LEAD.to(s), begin + 4 * RASTER)
                     for label, path in (("commanded", _commanded(log, name)), ("achieved", _achieved(log, name)))},
               name=f"formation_{name}_{kind}_plane", title=title + ": relative to the chief")


def _plot_all(log, names, lost, kind):
    """How far each deputy is from its pattern, and how long ago the chief has heard it. A lost deputy has no command
    any more; the others fly the same pattern, whose command goes on."""
    pattern = _commanded(log, next(name for name in names if name not in lost))
    off, silences = [], []
    for i, name in enumerate(names):
        age = log.series("chief_guidance.roll.state.age")
        silent = np.where(age.values[:, i] > 0, age.values[:, i], np.nan) / 60
        silences.append(replace(age, key=name, name="age", port=name, values=silent, unit="min"))
        angle = _achieved(log, name).off(pattern if name in lost else _commanded(log, name))
        angle[log.time < _begin(log, name)] = np.nan
        off.append(replace(age, key=name, name="off", port=name, values=np.log10(np.degrees(angle)), unit=""))
    log.plot(off, silences, titles=["(a) off the pattern: log10 of the angle in degrees",
                                    "(b) minutes since the chief has heard it"],
             name=f"formation_all_{kind}", title=f"{len(names)} deputies, {kind}", size=(7.2, 5))
