# SPDX-License-Identifier: Apache-2.0
"""To an orbit 100 km higher by two burns, with fuel that sloshes and a tank that empties."""
import numpy as np

from fledge import flight as fsw
from fledge import world
from fledge.units import N, s

from .world import DRY, FUEL, HIGH, ISP, LOW, SLOSH, THRUST


def transfer(sim):
    """Hohmann's transfer: both burns end at their change of velocity, and the orbit is a circle again."""
    log = _record(sim)
    sim.run(5500 * s)
    log.plot("burn.state.gained", "error.sigma_BR", ["fuel.v_B[0][0]", "fuel.v_B[1][1]"], "engine.output.thrust",
             titles=["(a) gained", "(b) attitude error", "(c) rates of what sloshes, along b1 and b2", "(d) thrust"],
             name="transfer", title="To an orbit 100 km higher")
    plan, phase = sim.flight.plan, fsw.BurnPhase(log["burn.state.phase"][-1])
    assert phase == fsw.BurnPhase.COMPLETE, f"the last burn is in phase {phase.name}"

    # Cut off within what an update of the burn's task gains.
    missing = log["burn.state.to_go"][-1]
    assert abs(missing) < 0.1 * THRUST / DRY, f"{missing:.3g} m/s are missing"

    # Between the burns the orbit touches both circles.
    a, e = _orbit(log, 2000)
    assert abs(a - (LOW + HIGH) / 2) < 1000 and abs(a * (1 + e) - HIGH) < 2000, f"a = {a / 1e3:.4g} km, e = {e:.2g}"

    # The engine's propellant is that of the rocket equation for the whole craft; the thrusters add about a percent.
    used, all_dv = log["engine.output.used"][-1], np.linalg.norm(plan.dv_N[:2], axis=1).sum()
    expected = (DRY + FUEL + SLOSH) * (1 - np.exp(-all_dv / (9.80665 * ISP)))
    assert abs(used / expected - 1) < 0.02, f"{used:.4g} kg were used, not {expected:.4g} kg"

    a, e = _orbit(log, -1)
    assert abs(a - HIGH) < 1000 and e < 1e-4, f"a = {a / 1e3:.4g} km, e = {e:.2g}"
    assert np.abs(log["fuel.v_B"]).max() > 1e-3, "nothing sloshed"


def failed_engine(sim):
    """The engine gives no thrust: the burn is aborted, and with it the plan."""
    sim.world.engine.F = 1e-3 * N
    log = _record(sim)
    sim.run(1300 * s)
    state = sim.flight.burn.state
    phase, reason = state.phase.name, state.abort.name
    assert (phase, reason) == ("ABORTED", "NO_THRUST"), f"{phase}, {reason}"
    assert 5 < (state.ended - state.begun) / 1e9 < 6, "it took another time to notice"
    assert abs(_orbit(log, -1)[0] - LOW) < 1000


def _record(sim):
    f, w = sim.flight, sim.world
    return sim.record(w.craft.state, w.engine.output, w.slosh.fuel, f.burn.state, f.tracking.error, every=1 * s)


def _orbit(log, i):
    """Semi-major axis [m] and eccentricity of a sample."""
    r, v, mu = log["craft.state.r_BN_N"][i], log["craft.state.v_BN_N"][i], world.EARTH.mu
    radius = np.linalg.norm(r)
    return 1 / (2 / radius - v @ v / mu), np.linalg.norm(np.cross(v, np.cross(r, v)) / mu - r / radius)
