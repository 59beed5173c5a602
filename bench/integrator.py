# SPDX-License-Identifier: Apache-2.0
"""What a method of integration is worth: the error after a day of a body that tumbles in an orbit, against Kepler's
equation and the closed form of the symmetric top, and what the day costs.
"""
from __future__ import annotations

import time

from fledge import Orbit, world

from bench import closed_forms as exact
from bench.accuracy_motion import DAY, MINUTE, TOP, methods, spacecraft
from bench.rows import Rows, in_turn, options, report

STEPS = [10.0, 5.0, 2.0, 1.0, 0.5, 0.1]


def main(arguments: list[str]) -> None:
    chosen = options("integrator", arguments, runs=5)
    orbit = Orbit(world.EARTH, a=6900e3, e=0.01, i=0.9)
    there = exact.kepler(world.EARTH.mu, orbit.r_BN_N, orbit.v_BN_N, DAY)[0]
    turned = exact.SymmetricTop(700, 900, TOP["sigma_BN"], TOP["omega_BN_B"]).dcm_BN(DAY)
    flown = {name: spacecraft(method, update, gravity=[world.EARTH], orbit=orbit, **TOP)
             for name, method, update in methods(STEPS, MINUTE)}

    def day(name):
        def fly():
            flown[name].reset()
            begin = time.process_time()
            flown[name].run(DAY)
            return time.process_time() - begin
        return fly

    times = in_turn({name: day(name) for name in flown}, chosen.runs)
    rows = Rows()
    for name, sim in flown.items():
        state = sim.world.craft.state
        off = exact.norm(exact.add(exact.vector(state.r_BN_N), there, -1))
        rows.add(name, "position", float(off), "m")
        rows.add(name, "attitude", float(exact.angle_between(exact.dcm(exact.vector(state.sigma_BN)), turned)), "rad")
        rows.add(name, "time of a day", times[name], "s")
    report(rows, chosen)
