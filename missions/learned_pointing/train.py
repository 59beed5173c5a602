# SPDX-License-Identifier: Apache-2.0
"""Trains the network of this mission, and writes weights.py:

    fledge exec python3 missions/learned_pointing/train.py [FILE]

An evolution strategy (Salimans et al. 2017): each of 64 clones flies a turn with weights of its own, of the module in
C itself. In pairs, one has the weights plus a random step, its twin minus the same step, both in the same turn; the
weights move along the steps of those that did better. All biases stay zero: no error, no torque. With the same seed the
numbers are the same, on any number of cores.
"""
import sys
from pathlib import Path

import numpy as np

import fledge
from fledge.mission.learning import VectorEnv
from fledge.montecarlo import Campaign
from fledge.units import minute, s

HERE = Path(__file__).resolve().parent
NEURONS, PAIRS, STEP, RATE = 16, 32, 0.05, 0.03
FORM = [((NEURONS, 6), NEURONS), ((3, NEURONS), 3)]
ERROR, TURN = "flight.tracking.error.sigma_BR", "world.craft.state.omega_BN_B"


def size(rows):
    """(n,) the lengths of (n, 3)."""
    return np.sqrt(rows[:, 0]**2 + rows[:, 1]**2 + rows[:, 2]**2)


def reward(before, action, after):
    """How near the body is to its target and to rest; a degree counts as much at the end as a radian at first."""
    return -(np.minimum(size(after[ERROR]), 1) + 5 * size(after[TURN]))


def environment(simulation):
    """64 clones, whose actions are the weights."""
    n = NEURONS * 7 + 3 * (NEURONS + 1)
    return VectorEnv(simulation, 2 * PAIRS, [f"flight.control.weights[:{n}]"], [ERROR, TURN], every=5 * s,
                     limit=2 * minute, reward=reward, dispersions=Campaign(HERE, "turns"), autoreset="Disabled")


def numbers(parameters):
    """(..., 163) the weights of the module, of (..., 144): biases are zero."""
    W0, W1 = np.split(parameters, [NEURONS * 6], axis=-1)
    zero = np.zeros_like(parameters)
    return np.concatenate([W0, zero[..., :NEURONS], W1, zero[..., :3]], axis=-1)


def trained(generations=1000, seed=1, report=None):
    """(163,) the weights after so many generations. report(generation, mean reward) is called after each."""
    simulation = fledge.load(HERE)
    env, random = environment(simulation), np.random.default_rng(seed)
    at = random.normal(0, 0.3, NEURONS * 9)
    mean, square = np.zeros_like(at), np.zeros_like(at)
    for generation in range(1, generations + 1):
        steps = random.normal(size=(PAIRS, at.size))
        given = numbers(at + STEP * np.concatenate([steps, -steps]))
        # Twins fly the same turn: run i of the seed of this generation.
        env.reset(seed=generation, options={"runs": np.tile(np.arange(PAIRS), 2)})
        total, over = np.zeros(2 * PAIRS), False
        while not over:
            _, gained, ended, cut, info = env.step(given)
            total += gained * (1 + info["time"] / 20)
            over = (ended | cut).all()
        better = np.sign(total[:PAIRS] - total[PAIRS:])
        slope = (better[:, None] * steps).sum(axis=0) / PAIRS
        mean, square = 0.9 * mean + 0.1 * slope, 0.99 * square + 0.01 * slope**2
        fade = 1 - generation / (generations + 1)
        at = at + RATE * fade * mean / (1 - 0.9**generation) / np.sqrt(square / (1 - 0.99**generation) + 1e-12)
        if report:
            report(generation, total.mean())
    return numbers(at)


def text(weights):
    """The file weights.py: of each number six digits count, which fly as they stand there."""
    rows = [", ".join(f"{float(f'{x:.6g}')!r}" for x in row) for row in np.array_split(weights, len(weights) // 8)]
    return ('# SPDX-License-Identifier: Apache-2.0\n"""Written by train.py: W0 by rows, b0, W1 by rows, b1 of the '
            'network."""\n\nWEIGHTS = [\n    ' + ",\n    ".join(rows) + ",\n]\n")


if __name__ == "__main__":
    def line(generation, gained):
        if generation % 50 == 0:
            print(f"{generation:5d} {gained:9.2f}", flush=True)
    Path(sys.argv[1] if len(sys.argv) > 1 else HERE / "weights.py").write_text(text(trained(report=line)))
