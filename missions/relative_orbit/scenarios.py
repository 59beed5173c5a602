# SPDX-License-Identifier: Apache-2.0
"""A deputy flies about its chief: it enters a relative orbit, and keeps it with next to no propellant."""
import numpy as np

from fledge.units import minute, s


def enter(sim):
    """Onto the ellipse within half an hour, and twice around it."""
    log = _fly(sim, 220 * minute)
    log.plot("relative.rho_H", "relative.rho_error_H", "output.impulse",
             titles=["(a) position relative to the chief", "(b) error", "(c) impulse of the thrusters"],
             name="enter", title="A relative orbit")
    off = np.linalg.norm(_apart(log) - _wanted(sim, log), axis=1)
    late = log.time > 30 * 60
    assert off[0] > 100 and off[late].max() < 6, f"the deputy is {off[late].max():.3g} m off"

    # What the relative orbit costs: far less than holding a point at its distance would, m 3 n^2 a for an orbit.
    impulse = log["output.impulse"].sum(axis=1)
    per_orbit = (impulse[-1] - impulse[late][0]) / (220 - 30) * 94.6
    hold = 50 * 3 * 1.1068e-3**2 * 100 * 94.6 * 60
    assert per_orbit < 0.1 * hold, f"{per_orbit:.3g} N s an orbit"


def blind(sim):
    """The camera fails: after ten seconds the deputy drifts freely, with no force, and near where it was."""
    sim.world.camera.faults = [{"kind": "DEAD", "begin": 40 * minute}]
    sim.run(40 * minute)
    used = sim.world.rcs.output.impulse.sum()
    sim.run(30 * minute)
    assert sim.flight.keeping.force.head.quality.name == "DEGRADED" and not sim.flight.keeping.force.force_B.any()
    assert sim.world.rcs.output.impulse.sum() - used < 3, "the thrusters fired on old data"
    assert np.linalg.norm(sim.world.chief.state.r_BN_N - sim.world.craft.state.r_BN_N) < 300


def _fly(sim, duration):
    f, w = sim.flight, sim.world
    log = sim.record(w.chief.state, w.craft.state, w.rcs.output, f.keeping.relative, f.tracking.error, every=2 * s)
    sim.run(duration)
    return log


def _apart(log):
    """[m] The deputy relative to the chief in the chief's Hill frame, by the truth."""
    r, v = log["chief.state.r_BN_N"], log["chief.state.v_BN_N"]
    out, normal = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (r, np.cross(r, v)))
    apart = log["craft.state.r_BN_N"] - r
    return np.stack([np.einsum("ij,ij->i", apart, x) for x in (out, np.cross(normal, out), normal)], axis=1)


def _wanted(sim, log):
    """[m] The free motion of Clohessy and Wiltshire that the deputy shall follow."""
    p = sim.flight.keeping
    u = np.sqrt(p.mu / np.linalg.norm(log["chief.state.r_BN_N"][0])**3) * log.time + p.start
    return np.stack([p.a * np.cos(u), p.lead - 2 * p.a * np.sin(u), p.b * np.cos(u + p.phase)], axis=1)
