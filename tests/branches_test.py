# SPDX-License-Identifier: Apache-2.0
"""`fledge falsify` with the build that counts the branches of flight code."""
import json
import os
import subprocess
import sys

from tests.needs import needs, section
from tests.tree import ROOT

pytestmark = needs(*section("decisions"))

FLOWN = """
import json
import numpy as np
from fledge.falsify import Flights

flights = Flights("sun_safe", "SUN-3", "fault", threads=1)
margins = flights(flights.space.values(np.random.default_rng(3).random((12, flights.space.n))))
print(json.dumps([margins.tolist(), flights.counts_branches, flights.seen.shape[1],
                  len({tuple(row) for row in flights.seen.tolist()})]))
"""


def run(*words, code=0, **variables):
    done = subprocess.run([str(word) for word in words], text=True, capture_output=True,
                          env={**os.environ, "FLEDGE_PROJECT": "", **variables})
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


def test_rare_branches_are_bred_and_margins_keep_their_bits(tmp_path):
    facts = json.loads(run(ROOT / "fledge", "falsify", "sun_safe", "SUN-2", "--campaign", "tumbles", "--runs", "40",
                           "--json", "--out", tmp_path))
    assert facts["branches"] and facts["runs"] == 40 and facts["stages"]["breeding"] == 14

    build = ROOT / "build" / os.environ["FLEDGE_PRESET"]
    flown = [json.loads(run(sys.executable, "-c", FLOWN, FLEDGE_OBSERVED=kind, PYTHONPATH=os.pathsep.join(
        [str(build / f"python_{kind}"), str(build / "python"), str(ROOT / "python"), str(ROOT)])))
        for kind in ("", "branches")]
    (margins, counts, pairs, few), (same, counted, all_, many) = flown
    assert margins == same and not counts and counted and pairs < 10 and all_ > 2000
    assert few < many
