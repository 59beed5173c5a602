# SPDX-License-Identifier: Apache-2.0
"""A pool of the workers of a Dask scheduler: the same bits although a worker is killed; errors name the problem."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from unittest.mock import patch

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.falsify import Flights, search
from fledge.montecarlo import Campaign, Sweep
from fledge.montecarlo.dispersions_test import mission
from fledge.montecarlo.montecarlo_test import RELEASE, same
from fledge.pool.pool_test import OfFaults, OfFlips, OfSweep, OfTiming, OfVerify, compiled
from fledge.verify import flights as verification
from fledge.verify.flight import Flight
from tests.waiting import PATIENCE, wait_for

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")    # of tornado

ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path))),
               "DASK_DISTRIBUTED__WORKER__DAEMON": "True", "OMP_NUM_THREADS": "1"}


def start(program, *arguments, folder, until):
    """A program of Dask, and the address that it names."""
    with open(folder / f"{program.rpartition('_')[2]}-{time.monotonic_ns()}.log", "w+", encoding="utf-8") as log:
        child = subprocess.Popen([sys.executable, "-m", f"distributed.cli.{program}", *arguments], cwd=folder,
                                 env=ENVIRONMENT, stdout=log, stderr=log)

        def address():
            log.seek(0)
            return re.search(until, log.read())

        return child, wait_for(address, child)[1]


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """Of which a campaign waits for the answer, however busy the machine."""
    folder = tmp_path_factory.mktemp("scheduler")
    child, address = start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show",
                           folder=folder, until=r"Scheduler at:\s+(tcp://[\d.:]+)")
    with patch("fledge.pool.cluster.PATIENCE", PATIENCE):
        yield address
    child.kill()
    child.wait()


@pytest.fixture
def worker(scheduler, tmp_path):
    """A function that starts a worker, and returns its process and its address."""
    children = []

    def add(folder=tmp_path, preload=()):
        child, address = start("dask_worker", scheduler, "--host", "127.0.0.1", "--no-nanny", "--no-dashboard",
                               "--nthreads", "1", "--memory-limit", "0", "--local-directory", str(tmp_path),
                               "--name", f"worker-{time.monotonic_ns()}", *(f"--preload={path}" for path in preload),
                               folder=folder, until=r"Registered to[\s\S]*?(tcp://[\d.:]+)")
        children.append(child)
        return child

    yield add
    for child in children:
        child.kill()
        child.wait()


@pytest.mark.long("a thousand runs")
def test_a_thousand_runs_are_the_same_by_threads_and_by_workers_one_of_which_is_killed(scheduler, worker, tmp_path):
    mission(tmp_path, RELEASE.replace("10 * s, 1 * s", "2 * s, 1 * s"))
    campaign = Campaign(tmp_path)
    by_one_thread, by_two_threads = (campaign.fly(1000, seed=7, threads=n) for n in (1, 2))
    first, _ = worker(), worker()
    seen = []

    def progress(finished, failed):
        seen.append(finished)
        if first.poll() is None and finished >= 100:
            first.kill()

    far = campaign.fly(1000, seed=7, scheduler=scheduler, progress=progress)
    assert first.poll() == -signal.SIGKILL and seen[0] == 0 and seen[-1] == 1000 and len(set(seen)) > 5
    assert far.flown.all() and same(by_one_thread, by_two_threads) and same(by_one_thread, far)
    variable = campaign.dispersions.retained["world.nav.attitude.sigma_BN"].summary
    for shown in ((5, 50, 95), (1, 25, 99)):
        assert (by_one_thread.bands(variable, shown) == by_two_threads.bands(variable, shown)).all()
        assert (by_one_thread.bands(variable, shown) == far.bands(variable, shown)).all()


@pytest.mark.long("starts a scheduler and workers")
def test_a_run_that_ends_its_process_has_failed_and_no_worker_dies(scheduler, worker, tmp_path):
    mission(tmp_path, RELEASE + "    d['world.craft.mass'] = d.uniform(0, 2)\n",
            "\n    import os\n    w.at(3 * s, lambda: w.craft.mass > 1.5 and os._exit(3))\n")
    child = worker()
    campaign = Campaign(tmp_path)
    result, near = campaign.fly(12, seed=3, scheduler=scheduler), campaign.fly(12, seed=3, threads=2)
    assert child.poll() is None and 0 < len(result.failures) < 12 and same(result, near)
    assert set(result.failures.values()) == {"the process that flew it ended with code 3"}


def test_what_was_printed_before_a_death_is_reported_as_on_this_machine(scheduler, worker, tmp_path, capfd):
    """The last lines of a flight's own log; of other items, what a process of this machine prints itself."""
    mission(tmp_path, RELEASE, "\n    import os, sys\n    w.at(3 * s, lambda: print('it tears apart', file="
            "sys.stderr) or os._exit(3))\n")
    (tmp_path / "requirements.py").write_text(
        "from fledge.requirements import always\n\ndef slow(r):\n    r.require('PNT-1', 'It turns slowly.', always("
        "r.signal('flight.tracking.error.omega_BR_B').norm() < 1))\n")
    (tmp_path / "scenarios.py").write_text(
        "def fly(sim):\n    for n in range(9):\n        print('line', n)\n    sim.run(9)\n")
    worker()
    died, errors = "the process that flew it ended with code 3", []
    for address in (None, scheduler):
        flight = Flight(str(tmp_path), "fly", "desktop", 0, {}, False, tmp_path / "out")
        flown, = verification.fly([flight], tmp_path, 1, True, lambda _: None, scheduler=address)
        errors.append(flown.error)
    assert errors[0] == errors[1] == "\n    ".join([died, *(f"line {n}" for n in range(5, 9)), "it tears apart"])
    capfd.readouterr()
    for address in (None, scheduler):
        result = Campaign(tmp_path).fly(1, seed=3, threads=1, scheduler=address, progress=lambda *_: None)
        assert dict(result.failures) == {0: died} and "it tears apart\n" in capfd.readouterr().err


DISTURBED = """
from fledge.pool import worker
kinds = []

def disturbed(*arguments, fly=worker.fly):
    answer = fly(*arguments)
    kinds[:] = kinds or [answer[:-1], bytes(500), 42, None, answer[:-9] + bytes([answer[-9] ^ 1]) + answer[-8:]]
    return kinds.pop()

if worker.fly.__name__ == "fly":    # Dask may execute this twice
    worker.fly = disturbed
"""


@pytest.mark.long("starts a scheduler and workers")
def test_no_answer_that_changed_on_its_way_is_taken(scheduler, worker, tmp_path, monkeypatch):
    """A cut, a random one, another type, None, one bit: that worker is sent away; if no other is left, it ends."""
    mission(tmp_path, RELEASE.replace("10 * s, 1 * s", "2 * s, 1 * s"))
    (tmp_path / "disturbed.py").write_text(DISTURBED)
    worker(preload=[tmp_path / "disturbed.py"])
    campaign, near = Campaign(tmp_path), Campaign(tmp_path).fly(12, seed=3, threads=2)
    monkeypatch.setattr("fledge.pool.cluster.WRONG", 6)
    with pytest.warns(RuntimeWarning, match="the checksum of the answer is wrong; what it flew is flown again"), \
            pytest.raises(fledge.RunError, match=r"the worker tcp://127[\d.:]+ gave 6 wrong answers, the last: the "
                                                 "checksum .* no other worker is left"):
        campaign.fly(12, seed=3, scheduler=scheduler, progress=lambda *_: None)
    worker()
    with pytest.warns(RuntimeWarning) as warned:
        assert same(campaign.fly(12, seed=3, scheduler=scheduler), near)
    assert any(re.search(r"\d+ answers of workers were wrong, .*: \d+ of tcp://127", str(w.message)) for w in warned)


@pytest.mark.long("starts a scheduler and workers")
def test_a_worker_with_another_mission_is_refused(scheduler, worker, tmp_path, monkeypatch, capsys):
    for name, more in (("here", ""), ("there", "\n    w.craft.mass = 2\n")):
        (tmp_path / name / "missions" / "looker").mkdir(parents=True)
        mission(tmp_path / name / "missions" / "looker", RELEASE, more)
    other = worker(tmp_path / "there")
    monkeypatch.chdir(tmp_path / "here")
    assert cli.main(["montecarlo", "looker", "--runs", "4", "--scheduler", scheduler]) == 2
    assert re.search(r"the worker tcp://[\d.:]+ has another mission: .* with files \w+, not .* with files \w+\n",
                     capsys.readouterr().err)
    # One that comes later is sent away, and those that come after it fly.
    monkeypatch.setattr("fledge.pool.cluster.Cluster._check", lambda *_: None)
    others = []

    def progress(finished, failed):
        if other.poll() is not None and not others:
            others.append(worker(tmp_path / "here"))

    with pytest.warns(RuntimeWarning, match="has another mission: .*; it is sent away"):
        result = Campaign("looker").fly(60, seed=1, scheduler=scheduler, progress=progress)
    assert result.passed.all() and others[0].poll() is None


def test_a_sweep_flies_on_workers_too(scheduler, worker, tmp_path):
    mission(tmp_path, RELEASE)
    (tmp_path / "world.py").write_text((tmp_path / "world.py").read_text().replace(
        "def build(w, f):", "def build(w, f, mass=1.0):") + "\n    w.craft.mass = mass\n")
    worker()
    sweep = Sweep(tmp_path, {"mass": [1.0, 2.0, 3.0], "flight.control.K": [2, 3]}, dispersed=True)
    far = sweep.fly(3, seed=1, scheduler=scheduler)
    assert far.draws["mass"].tolist() == [1, 2, 3] * 6 and same(far, sweep.fly(3, seed=1, threads=2))


def test_a_search_flies_on_workers_too(scheduler, worker, tmp_path):
    mission(tmp_path, RELEASE)
    (tmp_path / "requirements.py").write_text(
        "from fledge.requirements import always\n\ndef pointing(r):\n    r.require('PNT-1', 'It turns slowly.', always("
        "r.signal('flight.tracking.error.omega_BR_B').norm() < 0.1))\n")
    worker()
    found = []
    for address in (None, scheduler):
        with Flights(tmp_path, "PNT-1", seed=2, threads=2, scheduler=address) as flights:
            found.append(search(flights, flights.space, 60, seed=1))
    near, far = found
    assert len(near.margins) > 30 and near.stages == far.stages
    assert np.array_equal(near.margins, far.margins) and np.array_equal(near.values, far.values)


@pytest.mark.long("flies all that a pool flies on workers")
@pytest.mark.parametrize("user", [
    OfSweep, OfVerify, OfFaults, pytest.param(OfFlips, marks=compiled), pytest.param(OfTiming, marks=compiled)])
def test_workers_give_what_processes_give(scheduler, worker, tmp_path, user):
    worker(), worker()
    flights = user(tmp_path)
    assert flights.fly(2) == flights.fly(scheduler=scheduler)


@pytest.mark.long("starts a scheduler and workers")
def test_functions_go_to_the_workers_as_they_are(scheduler, worker, tmp_path):
    low = 1.0

    def heavy(d):
        d.duration, d.every = 2, 1
        d["world.craft.mass"] = d.uniform(low, 2)
        d.retain("flight.tracking.error.sigma_BR")

    worker()
    campaign = Campaign("nadir_spin", heavy)
    assert same(campaign.fly(20, scheduler=scheduler), campaign.fly(20))


@pytest.mark.long("waits for schedulers that do not answer")
def test_a_scheduler_that_is_not_there(tmp_path, capsys, monkeypatch, scheduler):
    monkeypatch.setattr("fledge.pool.cluster.PATIENCE", 1.0)
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        for address in ("tcp://127.0.0.1:9", f"tcp://127.0.0.1:{silent.getsockname()[1]}", "nonsense://x"):
            assert cli.main(["montecarlo", "nadir_spin", "--runs", "2", "--scheduler", address]) == 2
            err = capsys.readouterr().err
            assert f"there is no scheduler at {address} (" in err and err.count("\n") == 1, err
    monkeypatch.setattr("fledge.pool.cluster.PATIENCE", 10.0)
    with pytest.raises(fledge.SetupError, match="has no workers: start them with ./fledge exec dask-worker tcp://"):
        Campaign("nadir_spin").fly(2, scheduler=scheduler)
    assert not list(tmp_path.glob("runs/*/*/*/*"))


def test_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(fledge.SetupError, match="apt-get install python3-distributed"):
        Campaign("nadir_spin").fly(2, scheduler="tcp://127.0.0.1:9")
