# SPDX-License-Identifier: Apache-2.0
"""The chief and its deputies call the roll: each deputy has a beacon, and all know which are heard."""
from fledge import flight as fsw
from fledge.units import s

PERIOD = 1 * s


def build(chief, deputies, worlds):
    for f, w in zip(deputies, worlds):
        f.beacon = fsw.OrbitBeacon(lead=PERIOD)
        f.connect(w.nav.orbit >> f.beacon.orbit)
    for f in [chief] + deputies:
        f.roll = fsw.FormationRoll()
        for other, member in zip(deputies, "abcdefgh"):
            if other is not f:
                f.connect((other.beacon.body >> getattr(f.roll, member)).latency(1).stale_after(3 * s))
        f.task("roll", every=PERIOD, run=[f.roll] if f is chief else [f.beacon, f.roll])
