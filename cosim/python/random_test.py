# SPDX-License-Identifier: Apache-2.0
"""Random missions, in one program and in many: tasks of any rate and offset, wires of any latency and age
between any two processes, modes and events. FLEDGE_LONG=1 tries two thousand of them."""

import os
import random
import threading

import pytest

import fledge
from fledge import cosim, flight as fsw, objects
from fledge.units import rad, s

LONG = os.environ.get("FLEDGE_LONG", "") not in ("", "0")
MS = 1e-3


def build(seed):
    """A mission of some flight processes, in each of them chains and rings of turns."""
    dice = random.Random(seed)
    sim = fledge.Simulation(f"random{seed}", empty=True)
    turns = []
    for p in range(dice.randint(2, 4)):
        f = sim.add_flight(f"p{p}")
        tasks = []
        for t in range(dice.randint(1, 3)):
            run = []
            for k in range(dice.randint(1, 2)):
                name = f"turn{t}{k}"
                setattr(f, name, fsw.EulerRotation(angles=[dice.uniform(-1, 1) for _ in range(3)],
                                                   rates=[dice.uniform(-3, 3) for _ in range(3)] * rad / s))
                run.append(getattr(f, name))
            tasks.append(f.task(f"task{t}", every=dice.choice([10, 20, 30, 50, 70]) * MS, run=run,
                                offset=dice.choice([0, 0, 0, 5, 10, 35]) * MS, priority=dice.randint(0, 2)))
            turns += run
        # What starts a chain: configuration in no task, whose output may cross, too.
        f.still = fsw.InertialPointing(sigma_RN=[dice.uniform(-0.3, 0.3) for _ in range(3)])
        turns.append(f.still)
        if len(tasks) > 1 and dice.random() < 0.5:
            f.mode("one", tasks[:1])
            f.mode("all", tasks)
            f.start_in(dice.choice(["one", "all"]))
            looked = f.watch(next(iter(f)).reference)
            for name, mode in (("up", "all"), ("down", "one")):
                value = looked.sigma_RN[dice.randint(0, 2)]
                bound = dice.uniform(-0.3, 0.3)
                f.event(name, when=value > bound if name == "up" else value < bound, enter=mode,
                        hold=dice.choice([0, 40]) * MS, once=dice.random() < 0.3)
    latencies = {}
    for reader in turns:
        if not hasattr(reader, "base"):
            continue
        writer = dice.choice(turns)
        home, there = (objects.path(end).partition(".")[0] for end in (reader, writer))
        # A process reads one output at one latency; within a process there is none.
        key = (home, objects.path(writer))
        latency = 0 if home == there else latencies.setdefault(key, dice.randint(0, 1))
        wire = (writer.reference >> reader.base).latency(latency)
        if dice.random() < 0.4:
            wire.stale_after(dice.choice([1, 15, 40]) * MS)
        sim.processes[0].connect(wire)
    # Each port at the instants of the one task that writes it, which a run in one program has as well.
    for process in sim.processes:
        for _, period, _, _, names in process.tasks:
            sim.record(*(getattr(process, name) for name in names), every=5 * MS)
    return sim


def messages(sims):
    """All that was written, by output. A message has the time of writing in its head; the times of the samples
    are the instants, which are fewer in a program of one process."""
    found = {}
    for sim in sims:
        for log in sim.records:
            size = len(log.last())
            data = log.bytes()
            written = []
            for i in range(0, len(data), size):
                sample = data[i:i + size]
                if any(sample) and sample not in written[-1:]:
                    written.append(sample)
            found[log.path] = written
    return found


def fly_apart(seed, names, until):
    controller = cosim.Controller("random", names, until, join=30, reply=30,
                                  address=f"ipc://@fledge-random-{os.getpid()}-{seed}",
                                  sharing="allowed" if seed % 2 else "forbidden")
    sims, ends, threads = [], [], []
    for name in names:
        sim = build(seed)
        node = cosim.split(sim, name)
        sims.append(sim)

        def serve(node=node):
            try:
                ends.append(node.serve(controller.address, simulation="random"))
            except Exception as error:
                ends.append(str(error))

        threads.append(threading.Thread(target=serve))
        threads[-1].start()
    ends.append(controller.run())
    for thread in threads:
        thread.join()
    assert set(ends) == {""}
    return sims


@pytest.mark.parametrize("part", range(4))
def test_random_missions_are_the_same_in_many_programs(part):
    seen = 0
    for seed in range(part, 2000 if LONG else 40, 4):
        whole = build(seed)
        whole.run(2)
        together = messages([whole])
        apart = messages(fly_apart(seed, [p.name for p in whole.processes], 2))
        assert sorted(apart) == sorted(together)
        for path, written in together.items():
            assert apart[path] == written, f"seed {seed}, {path}"
            seen += len(written)
    assert seen > 3000
