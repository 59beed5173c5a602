# SPDX-License-Identifier: Apache-2.0
"""What an update costs in the loop: of a prototype, of a function in place of the C (`update=`), and of the C. All of
them publish a constant reference; `rock` also computes by fledge.flight_math, as in docs/prototypes.md."""
from __future__ import annotations

import time

from fledge import Simulation, flight as fsw, prototype
from fledge.flight_math import (fm_sincos, fm_tan, mat_transpose_vec, mrp_compose, mrp_to_dcm, vec3, vec_add, vec_cross,
                                vec_scale)
from fledge.prototype import Vec3, mem, out, par
from fledge.units import s

from bench.rows import Rows, in_turn, options, report

UPDATES = 20_000


class Pointing(prototype.Module):
    """A constant attitude."""
    reference = out(fsw.AttReference)
    sigma_RN = par(Vec3, "[-] the attitude")

    def update(self, t, dt):
        self.reference.sigma_RN = self.sigma_RN
        self.publish(self.reference)


class Rock(Pointing):
    """An attitude that rocks."""
    phase = mem(float, "[rad] of the sine")

    def update(self, t, dt):
        self.phase += 0.02 * dt
        sine, cosine = fm_sincos(self.phase)
        axis_N = mat_transpose_vec(mrp_to_dcm(self.sigma_RN), vec3(1, 0, 0))
        self.reference.sigma_RN = mrp_compose(vec3(fm_tan(0.025 * sine), 0, 0), self.sigma_RN)
        self.reference.omega_RN_N = vec_scale(0.002 * cosine, axis_N)
        self.reference.domega_RN_N = vec_add(vec_scale(-4e-5 * sine, axis_N), vec_cross(axis_N, axis_N))
        self.publish(self.reference)


def function(m, t, dt):
    m.reference.sigma_RN = m.sigma_RN
    m.publish(m.reference)


def main(arguments: list[str], runs: int = 5) -> None:
    chosen = options("prototype", arguments, runs)
    three = [0.1, 0.2, 0.3]
    cases = {"c": lambda: fsw.InertialPointing(sigma_RN=three),
             "function": lambda: fsw.InertialPointing(sigma_RN=three, update=function),
             "prototype": lambda: Pointing(sigma_RN=three), "rock": lambda: Rock(sigma_RN=three)}

    def flown(make):
        sim = Simulation("bench")
        sim.flight.module = make()
        sim.flight.task("task", every=1 * s, run=[sim.flight.module])
        sim.prepare()
        begun = time.perf_counter()
        sim.run(UPDATES * s, progress=False)
        return 1e9 * (time.perf_counter() - begun) / UPDATES

    rows = Rows()
    times = in_turn({name: lambda make=make: flown(make) for name, make in cases.items()}, chosen.runs)
    for name, samples in times.items():
        rows.add(name, "update", samples, "ns", ratio_to=None if name in ("c", "function") else "function")
    report(rows, chosen)
