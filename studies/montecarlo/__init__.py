# SPDX-License-Identifier: Apache-2.0
"""Dispersed runs of a mission: `fledge montecarlo MISSION`, or from Python

Example:

    from fledge.montecarlo import Campaign

    campaign = Campaign("nadir_spin")        # as its dispersions.py declares it; see fledge.montecarlo.dispersions
    result = campaign.fly(20, seed=1)
    result.retained["flight.tracking.error.sigma_BR"]     # (20, samples, 3)
    result.draws["world.craft.I_B[0, 0]"]                 # (20,)
    result.failures                                       # index -> text
    sim = campaign.simulation(17, seed=1)                 # that run, ready to be flown by hand

A run is fixed by (seed, index): neither threads nor processes nor their order change a bit of it.

    campaign, sweep campaigns, and those whose runs are the points of a grid
    dispersions     the declarations of a campaign: draws, retained variables, requirements (requirements)
    shares          the results of some runs, and the ways to fly them: by threads, or by a pool (fledge.pool)
    store, counts   where results are kept: rows on disk, counts for percentiles
    result          what came of a campaign
    drivers         on which draws a measure depends
    report, plots   the files of a campaign
"""

from fledge.montecarlo.campaign import Campaign, Chosen, disperse
from fledge.montecarlo.result import Result
from fledge.montecarlo.sweep import Sweep, lin, log

__all__ = ["Campaign", "Chosen", "Result", "Sweep", "disperse", "lin", "log"]
