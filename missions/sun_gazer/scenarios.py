# SPDX-License-Identifier: Apache-2.0
"""From a tumble to the Sun, a turn that the ground commands, and a leak: where the momentum is in all of them."""
import numpy as np

from fledge import ground
from fledge.attitude import mrp_to_dcm
from fledge.units import N, m, minute, s

PUSH = np.array([0, 0, 0.005])    # [N m] of the leak, in B
SUN  = np.array([1, -2, -2]) / 3  # its direction in N


def acquire(sim):
    """The Sun is found within two minutes. Nothing acts from outside: the gyros keep the momentum of the tumble."""
    log = _record(sim)
    sim.run(5 * minute)
    _plot(log, "acquire", "From a tumble to the Sun by control moment gyros")
    off, H = _off(log), _momentum(sim, log)
    assert off[0] > np.pi / 2, "the Sun was seen from the beginning"
    assert off[log.time > 120].max() < 1e-3, f"the telescope is {off[log.time > 120].max():.2g} rad off the Sun"
    assert _lost(H) < 1e-6, "momentum came from nowhere"
    # At rest, the gyros have it all.
    carried = _momentum(sim, log, body=False)[-1]
    assert np.linalg.norm(carried - H[0]) < 5e-3 * np.linalg.norm(H[0]), "the body still turns"


def turn(sim):
    """The ground turns the telescope by 20 degrees, and back, in frames, of which the first is lost on the way."""
    log, craft = _record(sim), ground.connect(sim)
    link = craft.link.link
    send, link.send = link.send, lambda unit: setattr(link, "send", send)
    sim.run(2 * minute)
    for angle in np.radians([20, 0]):
        craft.command("write", "flight.safe", axis_B=[np.cos(angle), np.sin(angle), 0]).delivered(within=1 * minute)
        craft.listen(2 * minute)
        assert abs(_off(log)[-1] - angle) < 1e-3, f"it is {_off(log)[-1]:.3g} rad off the Sun, not {angle:.3g}"
    _plot(log, "turn", "A turn by command, and back")
    assert sim.flight.commands.counters.executed == 2, "a command was lost, or executed twice"
    assert _lost(_momentum(sim, log)) < 1e-6, "momentum came from nowhere"


def leak(sim):
    """A leak turns the body for ten minutes: the telescope stays on the Sun, and the gyros take what it gave."""
    log = _record(sim)
    sim.run(2 * minute)
    acts = sim.world.leak.external
    for torque, duration in ((PUSH, 10 * minute), (0 * PUSH, 1 * minute)):
        acts.torque_B, acts.head.quality = torque * N * m, "GOOD"
        sim.run(duration)
    _plot(log, "leak", "A leak fills the gyros")
    H, pushed = _momentum(sim, log), (log.time >= 120) & (log.time < 720)
    off = _off(log)[pushed][-300:].mean()     # at rest K sigma is the torque, and 4 sigma the angle
    assert abs(off - 4 * np.linalg.norm(PUSH) / sim.flight.control.K) < 5e-5, f"the leak turns it by {off:.3g} rad"
    pushes = np.einsum("ikj,k->ij", mrp_to_dcm(log["craft.state.sigma_BN"][pushed]), PUSH)
    given = 0.2 * pushes.sum(axis=0)
    assert np.linalg.norm(H[-1] - H[0] - given) < 1e-3 * np.linalg.norm(given), "the gyros did not take what it gave"


def _record(sim):
    f, w = sim.flight, sim.world
    return sim.record(w.craft.state, w.gyros.gimbals, w.gyros.speeds, w.eye.heading, f.safe.error, f.steering.rates,
                      every=0.2 * s)


def _plot(log, name, title):
    log.plot("heading.s_B", "craft.state.omega_BN_B", "gimbals.angle", "steering.rates.rate",
             units={"craft.state.omega_BN_B": "deg/s", "gimbals.angle": "deg"},
             titles=["(a) direction to the Sun, as the sensor sees it", "(b) rates", "(c) angles of the gimbals",
                     "(d) commanded rates of the gimbals"], name=name, title=title)


def _off(log):
    """[rad] Between b1 and the true direction to the Sun."""
    return np.arccos(np.clip(mrp_to_dcm(log["craft.state.sigma_BN"])[:, 0] @ SUN, -1, 1))


def _lost(H):
    """The largest change of the momentum, as a share of it."""
    return np.linalg.norm(H - H[0], axis=1).max() / np.linalg.norm(H[0])


def _momentum(sim, log, body=True):
    """[N m s] The angular momentum of body and gyros about their centre of mass, N components; of the gyros alone."""
    gyros, omega = sim.world.gyros, log["craft.state.omega_BN_B"]
    H = omega @ sim.world.craft.I_B.T if body else 0 * omega
    for k in range(gyros.n):
        g, s0 = (axis / np.linalg.norm(axis) for axis in (gyros.gimbal_axes_B[k], gyros.spin_axes_B[k]))
        angle, rate = log["gimbals.angle"][:, k, None], log["gimbals.rate"][:, k]
        spin = s0 * np.cos(angle) + np.cross(g, s0) * np.sin(angle)
        across = np.cross(g, spin)
        along = np.einsum("ij,ij->i", omega, spin)
        H = H + spin * (gyros.J[k] * (along + log["speeds.Omega"][:, k]) + gyros.J_s[k] * along)[:, None] \
            + g * (gyros.J_g[k] * (omega @ g + rate))[:, None] \
            + across * (gyros.J_t[k] * np.einsum("ij,ij->i", omega, across))[:, None]
    return np.einsum("ikj,ik->ij", mrp_to_dcm(log["craft.state.sigma_BN"]), H)
