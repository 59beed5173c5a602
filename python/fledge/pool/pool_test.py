# SPDX-License-Identifier: Apache-2.0
"""Pools of processes: results in any order, a process that dies, errors, Ctrl-C; and all users of a pool."""

import gc
import os
import signal
import textwrap
import threading

import pytest

import fledge
from fledge.analysis import faults, timing
from fledge.analysis.matrix import Fault, Matrix
from fledge.emulator import flips
from fledge.errors import Failure
from fledge.mission import provenance
from fledge.mission.folder import MissionError
from fledge.montecarlo import Campaign, Sweep
from fledge.montecarlo.dispersions_test import mission
from fledge.montecarlo.montecarlo_test import RELEASE
from fledge.montecarlo.shares import Runs
from fledge.pool import Died, Local, Work, children, in_order, open_pool, worker
from fledge.pool.work import sealed, unsealed
from fledge.units import s
from fledge.verify import flights as verification
from fledge.verify.flight import Flight
from tests.needs import flies_on

KILLED = "the process that flew it was ended by SIGKILL"
compiled = flies_on("leon3")


class Squares(Work[int, int]):
    """Of 3 its process dies, of 4 too: by an exception."""

    def fly(self, item):
        if item == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return 1 // (4 - item) * 0 + item * item


class Apart(Squares):
    fresh = True


@pytest.fixture
def begun(monkeypatch):
    """The processes that pools have begun."""
    found, fork = [], children.fork

    def listed(*arguments, **options):
        process = fork(*arguments, **options)
        found.append(process)
        return process

    monkeypatch.setattr(children, "fork", listed)
    return found


def ended(processes):
    """Whether none of the processes exists any more, not even as a zombie."""
    def there(process):
        try:
            return os.kill(process, 0) is None
        except ProcessLookupError:
            return False

    return not any(map(there, processes))


# --- the pool --------------------------------------------------------------------------------------

@pytest.mark.parametrize("work", [Squares(), Apart()], ids=["kept", "fresh"])
@pytest.mark.parametrize("jobs", [1, 2, 7])
def test_results_come_with_their_places_and_a_death_is_that_of_its_item(begun, work, jobs, capfd):
    with open_pool(jobs) as pool:
        found = dict(pool.fly(work, range(1, 10)))
        assert pool.threads == jobs and len(found) == 9 and ended(begun)
    assert found.pop(2) == Died(3, KILLED) and found.pop(3) == Died(4, "the process that flew it ended with code 1")
    assert found == {place: (place + 1)**2 for place in found}
    assert capfd.readouterr().err.endswith("ZeroDivisionError: integer division or modulo by zero\n")
    least, most = (9, 9) if work.fresh else (3, 3) if jobs == 1 else (jobs, jobs + 2)   # two are begun anew, if in time
    assert least <= len(begun) <= most


class Logged(Squares):
    """Each item has a log."""

    def last_lines(self, item):
        return [f"begins {item}", "ends"]


def test_the_last_lines_of_an_item_come_with_its_death():
    found = dict(Local(2).fly(Logged(), [2, 3]))
    assert found == {0: 4, 1: Died(3, KILLED, ("begins 3", "ends"))}


def test_the_order_of_the_items_is_kept_where_it_is_wanted():
    assert list(in_order(iter([(2, "c"), (0, "a"), (1, "b"), (3, "d")]))) == list("abcd")
    assert [found for found in in_order(Local(3).fly(Squares(), [5, 6, 7, 8]))] == [25, 36, 49, 64]


def test_more_jobs_than_items_and_no_items(begun):
    assert list(Local(9).fly(Squares(), [1])) == [(0, 1)] and len(begun) == 1
    assert list(Local(2).fly(Squares(), [])) == []
    with pytest.raises(fledge.SetupError, match="jobs must be >= 1, found 0"):
        Local(0)


def test_a_worker_is_refused_by_its_files_not_by_its_revision(tmp_path, monkeypatch):
    """Other revisions of the same files fly; a fact that differs, or files that do, are named."""
    (tmp_path / "flight.py").write_text("x = 1\n")
    here = {"fledge": "aaaa", "mission": "bbbb"}
    monkeypatch.setattr(worker, "identity", lambda folder: here)

    def problem(identity, digests):
        return worker._work({"work": (lambda: work, ()), "identity": identity, "digests": digests})[1]

    work = Squares()
    work.folder, work.facts = tmp_path, {"program": "p"}
    digests = {name: provenance.digest(name, tmp_path) for name in here}
    assert problem({"fledge": "cccc", "mission": "bbbb-dirty with files 0", "program": "p"}, digests) == ""
    assert problem({**here, "program": "q"}, digests) == "has another program: p, not q"
    assert problem({"fledge": "cccc"}, {**digests, "fledge": "0"}) == "has another revision of Fledge: aaaa, not cccc"
    (tmp_path / "flight.py").write_text("x = 2\n")
    assert problem({"mission": "dddd"}, digests) == "has another mission: bbbb, not dddd"


def test_a_reply_is_that_which_was_sealed_for_the_request():
    whole = sealed(b"reply", b"job", b"item")
    assert unsealed(whole, b"job", b"item") == b"reply"
    for wrong in (None, 42, "", b"", *(whole[:n] for n in range(len(whole))), whole + b"!",
                  *(whole[:i] + bytes([whole[i] ^ 1 << bit]) + whole[i + 1:]
                    for i in range(len(whole)) for bit in range(8))):
        with pytest.raises(ValueError, match="answer is"):
            unsealed(wrong, b"job", b"item")
    for request in ([b"job", b"other"], [b"jobi", b"tem"], [b"job"]):
        with pytest.raises(ValueError, match="checksum"):
            unsealed(whole, *request)


class Refusing(Work[Exception, None]):
    def fly(self, item):
        raise item


@pytest.mark.parametrize("error, kind", [
    (MissionError("line 3", ValueError()), fledge.SetupError), (fledge.RunError("it diverges"), fledge.RunError),
    (Failure("no compiler"), Failure)], ids=["SetupError", "RunError", "Failure"])
def test_an_error_of_fledge_is_raised_where_the_results_are_read(begun, error, kind):
    with pytest.raises(kind) as raised:
        list(Local(2).fly(Refusing(), [error] * 8))
    assert str(raised.value) == str(error) and ended(begun)


class Endless(Work[int, int]):
    """Flies until it is ended."""

    def fly(self, item):
        threading.Event().wait()


def test_ctrl_c_is_for_the_reader_alone_and_ends_all(begun):
    def tick():
        os.killpg(0, signal.SIGINT)     # as a terminal sends it, to all

    child = os.fork()
    if not child:
        code = 1
        os.setpgid(0, 0)    # the signal is not for the other tests
        try:
            list(Local(2).fly(Endless(), range(5), tick))
        except KeyboardInterrupt:
            code = 0 if len(begun) == 2 and ended(begun) else 2
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0


def test_the_processes_end_with_this_one():
    """Which is killed, so that it can end nothing itself."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        try:
            list(Local(2).fly(Endless(), range(2), lambda: os.kill(os.getpid(), signal.SIGKILL)))
        finally:
            os._exit(1)
    os.close(writer)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    assert os.read(reader, 1) == b""    # the end of the pipe, which all of them had
    os.close(reader)


class Threaded:
    """In a cycle of references, so that only the collector deletes it. It stands for an object whose destructor waits
    for a thread."""

    def __init__(self):
        self.myself, self.process = self, os.getpid()

    def __del__(self):
        if os.getpid() != self.process:
            os._exit(9)


class Collecting(Work[int, bool]):
    """Collects garbage."""

    def fly(self, item):
        gc.collect()
        return gc.isenabled()


def test_a_copy_does_not_collect_the_garbage_of_this_process():
    gc.collect()
    Threaded()
    assert dict(Local(2).fly(Collecting(), range(3))) == {0: True, 1: True, 2: True}
    assert gc.isenabled()


# --- all users of pools ----------------------------------------------------------------------------

def short(d):
    d.duration, d.every = 2 * s, 1 * s
    d["world.craft.sigma_BN"] = d.attitude()
    d.retain("flight.tracking.error.sigma_BR")


class User:
    """Flies some items. fly(jobs, progress, scheduler): (results to compare, None for each that died, how these died);
    owner, name: of a function that a process calls with each item"""

    def __init__(self, folder):
        self.folder = folder


class OfCampaign(User):
    owner, name, runs = Runs, "fly", 4

    def made(self):
        return Campaign("nadir_spin", short)

    def fly(self, jobs=None, progress=None, scheduler=None):
        result = self.made().fly(self.runs, seed=3, threads=jobs, processes=True, scheduler=scheduler,
                                 progress=progress and (lambda *_: progress()))
        if result.interrupted:
            raise KeyboardInterrupt
        values, = result.retained.values()
        failed = dict(result.failures)
        return [None if run in failed else row.tobytes() for run, row in enumerate(values)], list(failed.values())


class OfSweep(OfCampaign):
    runs = 1

    def made(self):
        folder = self.folder / "swept"
        folder.mkdir(exist_ok=True)
        mission(folder, RELEASE, "\n    w.craft.mass = mass\n")
        (folder / "world.py").write_text((folder / "world.py").read_text().replace(
            "def build(w, f):", "def build(w, f, mass=1.0):"))
        return Sweep(folder, {"mass": [1.0, 2.0, 3.0, 4.0]})


class OfVerify(User):
    owner, name = verification, "judged"

    def fly(self, jobs=None, progress=None, scheduler=None):
        folder = self.folder / "missions/brief"
        if not folder.exists():
            folder.mkdir(parents=True)
            mission(folder, RELEASE)
            (folder / "requirements.py").write_text(textwrap.dedent("""
                from fledge.requirements import always

                def pointing(r):
                    error = r.signal("flight.tracking.error.sigma_BR").norm()
                    r.require("PNT-1", "It is never off.", always(error < 0.5))
            """))
            (folder / "scenarios.py").write_text("".join(
                f"def fly{n}(sim):\n    sim.run({n})\n\n" for n in range(1, 4)))
        sim = fledge.load(folder)
        flown = verification.fly(
            [Flight(str(folder), name, "desktop", 0, {}, False, self.folder / "out" / name)
             for name in sim.mission.scenarios], folder, jobs, True, lambda _: None,
            progress and (lambda *_: progress()) or (lambda *_: None), scheduler)
        assert all((self.folder / "out" / flight.scenario / flight.record).exists() for flight in flown)
        return [None if flight.error else (flight.scenario, flight.time, flight.shown) for flight in flown], [
            flight.error.split("\n")[0] for flight in flown if flight.error]


class OfFaults(User):
    owner, name = faults, "compare"

    def fly(self, jobs=None, progress=None, scheduler=None):
        matrix = Matrix("sun_safe")
        found = faults.fly(matrix, faults=[Fault("world.gyro", kind) for kind in ("DEAD", "DROPOUT")],
                           begin=[15 * s, 25 * s], limit=30 * s, jobs=jobs, scheduler=scheduler,
                           progress=progress and (lambda done, *_: progress()) or (lambda *_: None))
        return [None if flight.effect == "failed" else flight for flight in found], [
            flight.text for flight in found if flight.effect == "failed"]


class OfFlips(User):
    owner, name, campaign = flips.Campaign, "flip", None

    def fly(self, jobs=None, progress=None, scheduler=None):
        campaign = self.campaign = self.campaign or flips.Campaign("nadir_spin", at=1, duration=1, after=1)
        found = campaign.fly(4, 1, jobs, progress and (lambda _: progress()) or (lambda _: None), scheduler)
        texts = [text.rpartition(": ")[2] for text in campaign.died]
        flown = {outcome.flip: outcome for outcome in found}
        return [flown.get(campaign.flip(1, i)) for i in range(4)], texts


class OfTiming(User):
    owner, name, search = timing.Search, "_fly", None

    def fly(self, jobs=None, progress=None, scheduler=None):
        self.search = self.search or timing.Search("nadir_spin", duration=2.0, folder=self.folder)
        found = self.search.search(4, jobs, progress and (lambda _: progress()) or (lambda _: None), scheduler)
        return [None] * len(found.died) + [found.longest], [text.rpartition(": ")[2] for text in found.died]


@pytest.fixture(scope="module", params=[
    OfCampaign, OfSweep, OfVerify, OfFaults, pytest.param(OfFlips, marks=compiled),
    pytest.param(OfTiming, marks=[compiled, pytest.mark.long("compiles flight once more for another processor")])])
def user(request, tmp_path_factory):
    user = request.param(tmp_path_factory.mktemp("user"))
    user.whole, texts = user.fly(jobs=1)
    assert texts == [] and None not in user.whole
    return user


def test_a_killed_process_costs_its_item_alone(user, tmp_path, monkeypatch):
    called, own = getattr(user.owner, user.name), os.getpid()
    # The calls of all processes are counted in a file; in the second one its process is killed.
    count = tmp_path / "calls"

    def deadly(*arguments):
        if os.getpid() != own:
            with count.open("a") as file:
                file.write("x")
            if count.stat().st_size == 2:
                os.kill(os.getpid(), signal.SIGKILL)
        return called(*arguments)

    monkeypatch.setattr(user.owner, user.name, deadly)
    found, texts = user.fly(jobs=1)
    assert texts == [KILLED] and found.count(None) == 1
    if not isinstance(user, OfTiming):      # whose later runs follow from the earlier ones
        assert [whole for whole, result in zip(user.whole, found, strict=True) if result is not None] == [
            result for result in found if result is not None]


def test_ctrl_c_ends_all_processes(user, begun):
    def interrupt():
        if begun:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        user.fly(jobs=2, progress=interrupt)
    assert begun and ended(begun)


def test_the_number_of_processes_changes_no_bit(user):
    assert user.fly(jobs=3) == (user.whole, [])
