# SPDX-License-Identifier: Apache-2.0
"""Missions, and the simulations that they become.

    folder.py      a mission's folder: find it, execute its files, load it
    process.py     processes: instances by name, tasks, modes, events
    simulation.py  processes on one clock: run, record, save and restore
    scenario.py    the scenarios of a mission
    log.py         what was recorded in memory
    feed.py        inputs that are fed by hand
    batch.py       clones that are stepped together; learning (studies/learning): as reinforcement
                   learning steps them
    neural.py      weights of a trained network, as parameters of its flight module
    rebinding.py   Python functions made anew for a clone
    linearize.py   linear systems about a state (linear.py); trim.py: states at rest
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
