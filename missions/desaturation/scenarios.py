# SPDX-License-Identifier: Apache-2.0
"""Momentum leaves the wheels, while the body keeps pointing."""
import numpy as np

from fledge.units import minute, rad, s


def rods(sim):
    """Magnetic rods alone, over two orbits: the field turns, so that no direction keeps its momentum."""
    log = _fly(sim, "rods", 190 * minute)
    h, off = _momentum(sim, log), _pointing(log)
    assert h[0] > 4 and h[-1] < 1e-2 * h[0], f"{h[-1]:.3g} N m s are left of {h[0]:.3g}"
    assert off[log.time > 300].max() < 1e-3, "the rods disturb the attitude"
    assert log["rcs.output.impulse"][-1].max() == 0, "thrusters fired"


def thrusters(sim):
    """Too much for the rods: thrusters take the wheels from near their limit down to where the rods suffice."""
    sim.world.wheels.Omega = [400, 100, -300, 200] * rad / s
    log = _fly(sim, "thrusters", 20 * minute)
    h, off = _momentum(sim, log), _pointing(log)
    assert h[0] > 25 and h[-1] < 1, f"{h[-1]:.3g} N m s are left of {h[0]:.3g}"
    dumps = log["excess.torque.torque_B"].any(axis=1)
    assert (np.diff(dumps.astype(int)) == -1).sum() == 1 and not dumps[-1], "the thrusters were used again"
    assert off[log.time > 150].max() < 0.02, "the thrusters disturb the attitude too much"
    assert 0 < log["rcs.output.impulse"][-1].sum() < 3 * h[0] / 0.4, "the thrusters burnt more than the momentum needs"


def _momentum(sim, log):
    """[N m s] The size of the wheels' momentum relative to the body."""
    wheels = sim.world.wheels
    axes = wheels.axes_B / np.linalg.norm(wheels.axes_B, axis=1, keepdims=True)
    return np.linalg.norm((wheels.J * log["speeds.Omega"][:, :wheels.n]) @ axes, axis=1)


def _pointing(log):
    """[rad] The attitude error."""
    return 4 * np.arctan(np.linalg.norm(log["error.sigma_BR"], axis=1))


def _fly(sim, name, duration):
    f, w = sim.flight, sim.world
    log = sim.record(w.wheels.speeds, w.rods.torque, w.rcs.output, f.magnetic.command, f.excess.torque,
                     f.tracking.error, every=1 * s)
    sim.run(duration)
    panels = ["speeds.Omega", "error.sigma_BR", "magnetic.command.dipole", "output.impulse"]
    log.plot(*panels[:3 if name == "rods" else 4],
             titles=["(a) wheel speeds", "(b) attitude error", "(c) dipoles", "(d) impulse of the thrusters"],
             name=name, title=f"Desaturation by {name}")
    return log
