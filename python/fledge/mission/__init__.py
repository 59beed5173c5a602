# SPDX-License-Identifier: Apache-2.0
"""Missions, and the simulations that they become.

    folder.py      a mission's folder: find it, execute its files, load it
    process.py     processes: instances by name, tasks, modes, events
    simulation.py  processes on one clock: run, record, save and restore
    log.py         what was recorded in memory
    wiring.py      what a simulation consists of, and what is connected to what

Example:

    from fledge.mission import load
    from fledge.units import minute

    sim = load("nadir_spin", seed=2)
    log = sim.record(sim.world.craft.state, every=1)
    sim.run(10 * minute)
    state = sim.snapshot()
    sim.run(10 * minute)
    sim.restore(state)          # 10 minutes back
"""

from fledge.mission.folder import Mission, MissionError, explain, find, load, missions

__all__ = ["Mission", "MissionError", "explain", "find", "load", "missions"]
