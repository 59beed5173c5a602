# SPDX-License-Identifier: Apache-2.0
"""Trajectories: what is drawn of a fly-by."""

import numpy as np

from fledge import Orbit, Simulation, trajectory, world
from fledge.plot import save
from fledge.units import deg, km, minute, s


def test_a_hyperbola_lies_with_its_periapsis_up(tmp_path):
    sim = Simulation()
    sim.plots = type("Collected", (list,), {"add": list.append})()
    sim.world.craft = world.Spacecraft(
        I_B=1, gravity=[world.EARTH],
        orbit=Orbit(world.EARTH, rp=8000 * km, e=1.5, i=50 * deg, Omega=20 * deg, f=-90 * deg))
    sim.world.task("dynamics", every=1, run=[sim.world.craft])
    log = sim.record(sim.world.craft.state, every=10 * s)
    sim.run(60 * minute)
    figure = trajectory.plot(log, "craft.state", world.EARTH, {"b1": 1, "b3": 3}, every=5 * minute)
    assert sim.plots == [figure]
    (axis,) = figure.axes
    x, y = axis.lines[0].get_data()
    # At a true anomaly of -90 deg it is as far out as the semi-latus rectum, level with the body.
    assert (abs(x[0] + 20), abs(y[0])) < (0.02, 0.02) and abs(y.max() - 8) < 1e-3
    first, second = (c for c in axis.collections)
    assert first.N == second.N == 13
    # At rest in N, with b3 along n3: seen in a plane inclined by 50 deg.
    seen = np.hypot(second.U, second.V)
    np.testing.assert_allclose(seen, np.sin(np.radians(50)), rtol=1e-6)
    assert save(figure, tmp_path).read_bytes()[:4] == b"\x89PNG"

    sim.plots = False
    assert trajectory.plot(log, "craft.state", world.EARTH, {"b1": 1}, every=5 * minute) is None
