# SPDX-License-Identifier: Apache-2.0
"""The search for the run in which a requirement has the least margin: `fledge falsify MISSION REQ`, or from Python

Example:

    from fledge.falsify import Flights, probability, scenario, search

    flights = Flights("sun_safe", "SUN-1")              # of the first campaign of its dispersions.py
    tried = search(flights, flights.space, 1000, seed=1)
    worst = tried.values[tried.best], tried.margins[tried.best]
    smallest = flights.smallest(*worst)                 # if it fails
    print(scenario(flights, smallest, "by hand"))       # a regression test
    print(probability(flights.repetition, flights.space))

The modules:

    space       the draws of a campaign as the unit cube
    stages      the stages of the search
    splitting   failure probabilities that counting does not reach
    flights     runs with chosen numbers, and their margins
    reduction   the smallest counterexample
    regression  it as a scenario
"""

from fledge.falsify.flights import Flights
from fledge.falsify.regression import scenario
from fledge.falsify.stages import Tried, random_search, search
from fledge.falsify.reduction import Counterexample, smallest
from fledge.falsify.space import Space
from fledge.falsify.splitting import Probability, probability

__all__ = ["Counterexample", "Flights", "Probability", "Space", "Tried", "probability", "random_search", "scenario",
           "search", "smallest"]
