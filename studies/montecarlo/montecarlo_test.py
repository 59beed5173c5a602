# SPDX-License-Identifier: Apache-2.0
"""Campaigns: the same bits however they are flown, failures that can be flown again, and reports."""

import contextlib
import csv
import json
import os
import pty
import re
import shlex
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

import fledge
from fledge import Archive, _core, cli
from fledge.export.run_test import FLIGHT, WORLD
from fledge.montecarlo.dispersions_test import mission
from fledge.montecarlo import report, Campaign, Sweep, drivers, plots, report, store
from fledge.montecarlo.counts import BOUND, Counts
from fledge.montecarlo.requirements import Variable
from fledge.montecarlo.result import Result
from fledge.montecarlo.shares import Share, fly_share
from fledge.report import campaign as pages
from fledge.report.report_test import Page
from fledge.requirements import Requirements, after, always, implies, within
from fledge.units import N, deg, kg, m, s


def short(d):
    """Twenty seconds, with noise, so that each run's own random streams matter."""
    d.duration, d.every = 20 * s, 1 * s
    d["world.craft.sigma_BN"] = d.attitude()
    d["world.craft.I_B"] = d.nominal + d.normal(0, 10 * kg * m**2)
    d["world.nav.attitude_noise"] = d.uniform(0, 0.01 * deg)
    error = d.retain("flight.tracking.error.sigma_BR")
    d.retain("flight.motor.command.u[0]", "world.nav.attitude.sigma_BN")
    d.check(error.norm().final < 0.8, "far away")


def same(a, b):
    return (a.failures == b.failures and (a.flown == b.flown).all()
            and a.health == b.health
            and all(np.array_equal(a.draws[p], b.draws[p], equal_nan=True) for p in a.draws)
            and all(np.array_equal(a.retained[p], b.retained[p], equal_nan=True) for p in a.retained))


@pytest.fixture(scope="module")
def campaign():
    return Campaign("nadir_spin", short)


@pytest.fixture(scope="module")
def result(campaign):
    return campaign.fly(40, seed=5, threads=1)


# --- the same bits ---------------------------------------------------------------------------------

@pytest.mark.parametrize("threads", [2, 3, 7])
def test_threads_change_no_bit(campaign, result, threads):
    assert same(campaign.fly(40, seed=5, threads=threads), result)


def test_processes_give_the_same(campaign, result):
    assert same(campaign.fly(40, seed=5, threads=2, processes=True), result)


def test_a_longer_campaign_begins_with_the_shorter(campaign, result):
    longer = campaign.fly(60, seed=5)
    assert all((longer.retained[p][:40] == result.retained[p]).all() for p in result.retained)
    other = campaign.fly(40, seed=6)
    assert not any((other.draws[p] == result.draws[p]).all() for p in result.draws)


@pytest.mark.parametrize("index", [0, 23, 39])
def test_one_run_by_hand(campaign, result, index):
    sim = campaign.simulation(index, seed=5)
    f = sim.flight
    log = sim.record(f.tracking.error, f.motor.command, sim.world.nav.attitude, every=1 * s)
    sim.run(20 * s)
    assert (log["error.sigma_BR"] == result.retained["flight.tracking.error.sigma_BR"][index]).all()
    assert (log["command.u[0]"] == result.retained["flight.motor.command.u[0]"][index]).all()
    assert (log["attitude.sigma_BN"] == result.retained["world.nav.attitude.sigma_BN"][index]).all()
    assert campaign.drawn(sim) == {path: values[index] for path, values in result.draws.items()}


def test_the_nominal_simulation_is_left_alone(campaign, result):
    assert campaign.drawn(campaign.nominal) == campaign.drawn(fledge.load("nadir_spin"))
    assert campaign.nominal.seed == 0 and campaign.nominal.time_ns == -1


def test_the_noise_differs_from_run_to_run(campaign, result):
    seen = result.retained["world.nav.attitude.sigma_BN"][:, 1]
    assert len(np.unique(seen[:, 0])) == 40
    assert campaign.simulation(3, seed=5).seed != campaign.simulation(4, seed=5).seed


# --- Python in the world's events ------------------------------------------------------------------

CALLABLES = """
    kicks = []
    def kick():
        kicks.append(w.craft.state.omega_BN_B[0])
        w.craft.mass = len(kicks)      # what an earlier run left behind would show
    w.at(3 * s, kick)
"""
RELEASE = """
from fledge.units import deg, s
def release(d):
    d.duration, d.every = 10 * s, 1 * s
    d["world.craft.omega_BN_B"] = d.normal(0, 1 * deg / s)
    d["world.nav.attitude_noise"] = d.uniform(0, 0.01 * deg)
    d.retain("world.nav.attitude.sigma_BN")
"""


@pytest.mark.long("a campaign by processes")
def test_python_events_fall_back_to_processes(tmp_path, capfd):
    mission(tmp_path, RELEASE, CALLABLES)
    campaign = Campaign(tmp_path)
    assert campaign.has_callables
    by_two_threads, by_one_thread = campaign.fly(9, seed=2, threads=2), campaign.fly(9, seed=2, threads=1)
    assert same(by_one_thread, by_two_threads) and len(by_one_thread.passed) == 9 and by_one_thread.passed.all()
    sim = campaign.simulation(7, seed=2)
    sim.run(10 * s)
    assert sim.world.craft.mass == 1
    assert (sim.world.nav.attitude.sigma_BN == by_two_threads.retained["world.nav.attitude.sigma_BN"][7, -1]).all()
    with pytest.raises(fledge.SetupError, match="cannot be flown by threads"):
        _core.fly(campaign.nominal.kernel, campaign.plan, 1)
    # The same without Python, by threads: an event that only reads changes nothing.
    mission(tmp_path, RELEASE)
    assert same(Campaign(tmp_path).fly(9, seed=2), by_two_threads)

    mission(tmp_path, RELEASE, CALLABLES)
    assert cli.main(["montecarlo", str(tmp_path), "--runs", "3", "--jobs", "2", "--out", str(tmp_path / "out")]) == 0
    out, err = capfd.readouterr()
    assert "the mission calls Python, so 2 processes fly the runs" in err and err.count("\n") == 1
    assert "3 of 3" in out and "on 2 processes" in out


def test_a_process_that_dies_is_a_failed_run(tmp_path):
    mission(tmp_path, RELEASE + "    d['world.craft.mass'] = d.uniform(0, 2)\n",
            "\n    import os\n    w.at(3 * s, lambda: w.craft.mass > 1 and os._exit(3))\n"
            "    w.at(4 * s, lambda: 1 / 0 if w.craft.mass < 0.3 else None)\n")
    result = Campaign(tmp_path).fly(16, threads=2)
    mass = result.draws["world.craft.mass"]
    died = np.isnan(mass)   # its draws are lost, too
    assert 2 < died.sum() < 14 and result.flown.all()
    for i, text in result.failures.items():
        assert (text == "the process that flew it ended with code 3") if died[i] else "ZeroDivisionError" in text
    assert set(result.failures) == set(np.flatnonzero(died | (mass < 0.3)))


def test_a_mission_that_cannot_be_loaded_for_a_run_has_failed_that_run(tmp_path):
    mission(tmp_path, RELEASE)
    (tmp_path / "world.py").write_text((tmp_path / "world.py").read_text().replace(
        "def build(w, f):", "def build(w, f, a=1.0, b=1.0):") + "\n    w.craft.mass = 1 / abs(a - b)\n")
    result = Sweep(tmp_path, {"a": [2.0, 3.0], "b": [1.0, 3.0]}).fly(threads=2)
    assert list(result.failures) == [3] and "ZeroDivisionError: float division by zero" in result.failures[3]


# --- health --------------------------------------------------------------------------------------

def limited(d):
    """Wheels that only some of the runs saturate."""
    d.duration, d.every = 2 * s, 1 * s
    d["world.craft.omega_BN_B"] = d.uniform(-1e-4, 1e-4)
    d["flight.control.K"] = d.uniform(0.01 * N * m, 5 * N * m)
    d.retain("flight.motor.command.u")


def test_a_campaign_counts_the_findings_of_its_runs_and_strict_fails_them(tmp_path):
    campaign = Campaign("nadir_spin", limited)
    lenient, strict = campaign.fly(30, seed=2), campaign.fly(30, seed=2, strict=True)
    with_findings = {i for i, found in enumerate(lenient.health) if found}
    assert 0 < len(with_findings) < 30
    assert lenient.passed.all() and set(strict.failures) == with_findings
    data = report.summary(lenient, str)
    motor = next(finding for finding in data["health"] if finding["path"] == "flight.motor")
    assert motor["kind"] == "saturated" and motor["runs"] == len(with_findings) and motor["run"] == min(with_findings)
    assert f"in {len(with_findings)} of 30 runs, as in run {min(with_findings)}: flight.motor was" in report.text(data)


# --- failures --------------------------------------------------------------------------------------

def test_each_failure_is_a_failure_of_its_own():
    def heavy(d):
        d.duration, d.every = 5 * s, 1 * s
        d["world.craft.mass"] = d.normal(0, 1 * kg)    # half of them are refused by the header's rule
        d.check(d.retain("flight.tracking.error.sigma_BR").norm() < 0.9)

    campaign = Campaign("nadir_spin", heavy)
    result = campaign.fly(60)
    mass = result.draws["world.craft.mass"]
    assert 15 < (mass < 0).sum() < 45
    assert set(result.failures) == set(np.flatnonzero(mass < 0)) == set(result.errors)
    for i, text in result.failures.items():
        assert "world.py, line 14: world.craft.mass must be >= 0 kg, found -" in text    # of the craft
        assert np.isnan(result.retained["flight.tracking.error.sigma_BR"][i]).all()
    assert (result.passed == (mass >= 0)).all()


@pytest.mark.parametrize("threads", [1, 2])
def test_a_run_into_the_planet_has_failed(tmp_path, threads):
    mission(tmp_path, "def fall(d):\n    d.duration, d.every = 20, 1\n"
                      "    d['world.craft.v_BN_N'] = d.nominal + d.uniform(-1000, 1000)\n"
                      "    d.check(d.retain('world.craft.state.r_BN_N').norm() > 0)\n",
            "\n    w.craft.r_BN_N, w.craft.v_BN_N = [3400e3, 0, 0], [0, 3000, 0]\n")
    result = Campaign(tmp_path).fly(30, threads=threads)
    up = result.draws["world.craft.v_BN_N[0]"]
    failed = np.flatnonzero(~result.passed)
    assert set(np.flatnonzero(up < -200)) <= set(failed) <= set(np.flatnonzero(up < 0)) and len(failed) > 5
    for i in failed:
        assert re.match(r"world.craft: inside MARS at [0-9.]+ s, at an altitude of -", result.failures[i])


@pytest.mark.long("flies a campaign and its failures")
def test_the_command_of_a_failure_repeats_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = RELEASE + ("    error = d.retain('flight.tracking.error.sigma_BR')\n"
                      "    d.check(error.norm().final < 0.9, 'far away')\n")
    mission(tmp_path, text)
    assert cli.main(["montecarlo", str(tmp_path), "--runs", "12", "--seed", "3"]) == 1
    folder = tmp_path / "runs" / tmp_path.name / "montecarlo" / "release"
    data = json.loads((folder / "summary.json").read_text())
    assert 0 < data["failed"] < 12
    failure = data["failures"][0]
    assert failure["command"] == f"./fledge montecarlo {tmp_path} --seed 3 --only {failure['run']}"
    assert failure["text"] in capsys.readouterr().out

    assert cli.main(shlex.split(failure["command"])[1:]) == 1
    out, err = capsys.readouterr()
    assert failure["text"] in err and "FAILS" in out and (folder / str(failure["run"]) / "retained.png").exists()
    archive = Archive(folder / str(failure["run"]) / "run.mcap")
    campaign = Campaign(tmp_path)
    retained = campaign.fly(12, seed=3).retained["flight.tracking.error.sigma_BR"][failure["run"]]
    assert (archive["flight.tracking.error.sigma_BR"] == retained).all()

    good = next(i for i in range(12) if i not in {f["run"] for f in data["failures"]})
    assert cli.main(["montecarlo", str(tmp_path), "--seed", "3", "--only", str(good)]) == 0
    assert "passed" in capsys.readouterr().out


def test_drawn_enumerators_have_their_names_and_times_are_seconds(tmp_path, capsys):
    """Of sun_safe's faults: in the run alone, and in the report, where they have counts and no mean."""
    campaign = Campaign("sun_safe", "faults")
    kind, begin = (f"world.adc_a.faults[1].{name}" for name in ("kind", "begin"))
    drawn = {path: values[3] for path, values in campaign.fly(4).draws.items()}
    name = {text: number for number, text in campaign.enumerators(kind).items()}
    assert len(name) > 5 and campaign.enumerators(begin) == {}
    printed = {}
    assert cli.main(["montecarlo", "sun_safe", "--campaign", "faults", "--only", "3", "--out", str(tmp_path)]) == 0
    for line in capsys.readouterr().out.splitlines():
        if line.startswith("  drawn "):
            printed[line.split()[1]] = line.split(maxsplit=2)[2].partition(", nominal ")[::2]
    assert name[printed[kind][0]] == drawn[kind] and printed[kind][1] == "NONE"
    assert printed[begin] == (f"{drawn[begin] / 1e9:.7g} s", "0 s")
    row, = (draw for draw in report.summary(campaign.fly(4), str)["draws"] if draw["path"] == kind)
    assert sum(row["counts"].values()) == 4 and row["counts"][printed[kind][0]] >= 1 and "mean" not in row


# --- errors of the command -------------------------------------------------------------------------

@pytest.mark.parametrize("arguments, words", [
    ([], "give --runs N, or --only INDEX"),
    (["--runs", "3", "--only", "1"], "give --runs N, or --only INDEX"),
    (["--runs", "0"], "runs must be >= 1, found 0"),
    (["--runs", "2", "--jobs", "0"], "--jobs must be >= 1, found 0"),
    (["--runs", "2", "--seed", "-1"], "seed must be a whole number from 0 to 2^64 - 1, found -1"),
    (["--only", "-1"], "a run's index must be >= 0, found -1"),
    (["--only", "1", "--json"], "--json is for --runs"),
    (["--campaign", "storm", "--runs", "2"], "has no campaign 'storm'; it has release"),
    (["--runs", "10000000000"], "more than what is left of the disk of "),
])
def test_wrong_commands(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["montecarlo", "nadir_spin", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_nominal_mission_that_cannot_fly_is_refused_at_once(tmp_path):
    mission(tmp_path, RELEASE, "    w.craft.r_BN_N = [1, 0, 0]\n")
    with pytest.raises(fledge.SetupError, match="world.craft.r_BN_N: must lie outside MARS"):
        Campaign(tmp_path).fly(5)


# --- Ctrl-C ----------------------------------------------------------------------------------------

@pytest.mark.parametrize("processes", [False, True])
def test_ctrl_c_keeps_what_is_finished(campaign, processes):
    calls = []

    def progress(finished, failed):
        calls.append(finished)
        if finished >= 3:
            os.kill(os.getpid(), signal.SIGINT)

    runs = 3000 if processes else 20000
    result = campaign.fly(runs, seed=5, threads=2, processes=processes, progress=progress)
    assert result.interrupted and 3 <= result.flown.sum() < runs
    i = np.flatnonzero(result.flown)[-1]
    whole = campaign.fly(int(i) + 1, seed=5)
    for path, values in result.retained.items():
        assert (values[i] == whole.retained[path][i]).all()
        assert np.isnan(values[~result.flown]).all()


def test_other_exceptions_end_it(campaign):
    def progress(finished, failed):
        raise ValueError("enough")

    with pytest.raises(ValueError, match="enough"):
        campaign.fly(20000, progress=progress)


@pytest.mark.long("a campaign that is interrupted")
def test_ctrl_c_on_the_command_line_leaves_a_report(tmp_path):
    text = RELEASE.replace("10 * s, 1 * s", "1e5 * s, 1e4 * s")
    mission(tmp_path, text)
    terminal, theirs = pty.openpty()
    child = subprocess.Popen([sys.executable, "-m", "fledge.cli", "montecarlo", str(tmp_path), "--runs", "5000",
                              "--out", str(tmp_path / "out"), "--jobs", "1"], stderr=theirs,
                             stdout=subprocess.PIPE, text=True,
                             env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    os.close(theirs)
    with open(terminal, encoding="utf-8", newline="") as shown:
        err = ""
        while not re.search(r"[1-9]\d* of 5000", err):  # the bar, which a terminal shows, counts finished runs
            err += shown.read(1)
        child.send_signal(signal.SIGINT)
        out, _ = child.communicate()
        with contextlib.suppress(OSError):  # a terminal has no end of file
            while True:
                err += shown.read(1)
    assert child.returncode == 130 and re.search(r"interrupted; the report is about the \d+ runs", err), err
    data = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert data["interrupted"] and data["flown"] < 5000 and data["runs"] == 5000
    assert f"stopped before {5000 - data['flown']} more" in out


# --- reports ---------------------------------------------------------------------------------------

@pytest.mark.long("draws four reports")
def test_the_same_report_however_it_was_flown(campaign, tmp_path):
    paths = {}
    for name, options in (("one", dict(threads=1)), ("two", dict(threads=2)), ("three", dict(processes=True))):
        _, paths[name] = report.write(campaign.fly(40, seed=5, **options), tmp_path / name, lambda i: f"again {i}")
    assert [p.name for p in paths["one"]] == [
        "summary.txt", "summary.json", "runs.csv", "runs.h5", "bands-flight_tracking_error_sigma_BR.png",
        "bands-flight_motor_command_u_0.png", "bands-world_nav_attitude_sigma_BN.png", "requirements.png",
        "final.png", *(["drivers.png"] if len(paths["one"]) == 11 else []), "draws.png"]
    for a, *others in zip(*paths.values()):
        assert all(a.read_bytes() == b.read_bytes() for b in others), a.name


@pytest.mark.long("draws a report with all its figures")
def test_the_figures_in_the_report(campaign, result, tmp_path):
    import h5py

    data, _ = report.write(result, tmp_path, lambda i: f"again {i}")
    error = np.linalg.norm(result.retained["flight.tracking.error.sigma_BR"], axis=2)
    final = {measure["measure"]: measure for measure in data["final"]}["norm(flight.tracking.error.sigma_BR)"]
    assert final["percentiles"] == {str(p): pytest.approx(np.percentile(error[:, -1], p)) for p in (5, 25, 50, 75, 95)}
    failed = np.flatnonzero(error[:, -1] >= 0.8)
    assert 0 < len(failed) < 40 and [f["run"] for f in data["failures"]] == failed.tolist()
    assert data["requirements"][0]["worst_run"] == int(np.argmax(error[:, -1]))
    assert data["requirements"][0]["held"] == data["passed"] == 40 - len(failed)
    text = (tmp_path / "summary.txt").read_text()
    assert "too few runs for the percentiles 1, 99" in text and f"again {failed[0]}" in text

    rows = list(csv.DictReader((tmp_path / "runs.csv").open()))
    assert [float(r["world.craft.I_B[0, 0] [kg m^2]"]) for r in rows] == result.draws["world.craft.I_B[0, 0]"].tolist()
    assert [r["outcome"] for r in rows] == ["passed" if ok else "failed" for ok in result.passed]
    assert [float(r["norm(flight.tracking.error.sigma_BR) at the end"]) for r in rows] == pytest.approx(error[:, -1])
    with h5py.File(tmp_path / "runs.h5") as file:
        assert (file["retained/flight.motor.command.u[0]"][:] == result.retained["flight.motor.command.u[0]"]).all()
        assert file["retained/flight.motor.command.u[0]"].attrs["unit"] == "N m"
        assert (file["passed"][:] == result.passed).all() and file["time"][-1] == 20


@pytest.mark.parametrize("n, expected", [
    (1, (50,)), (2, (50,)), (3, (25, 50, 75)), (18, (25, 50, 75)), (19, (5, 25, 50, 75, 95)), (98, (5, 25, 50, 75, 95)),
    (99, (1, 5, 25, 50, 75, 95, 99))])
def test_percentiles_that_so_many_runs_can_tell(n, expected):
    assert plots.percentiles(n) == expected


def test_confidence_of_a_rate():
    assert report.confidence(5, 10) == (pytest.approx(0.2366, abs=1e-4), pytest.approx(0.7634, abs=1e-4))
    assert report.confidence(0, 10) == (0, pytest.approx(0.2775, abs=1e-4))
    assert report.confidence(10, 10) == (pytest.approx(0.7225, abs=1e-4), 1)


@pytest.mark.long("draws a report with all its figures")
@pytest.mark.parametrize("runs", [1, 2, 5])
@pytest.mark.filterwarnings("error")
def test_few_runs_have_a_report_too(campaign, runs, tmp_path):
    result = campaign.fly(runs)
    data, paths = report.write(result, tmp_path, str)
    assert data["flown"] == runs and sum(p.suffix == ".png" for p in paths) == 6


@pytest.mark.filterwarnings("error")
def test_a_campaign_of_failures_has_a_report_too(tmp_path):
    def heavy(d):
        d.duration = 5 * s
        d["world.craft.mass"] = d.normal(-7, 1)
        d.check(d.retain("flight.motor.command.u").max_abs() < 1 * N * m)

    (tmp_path / "mine.png").touch()
    (tmp_path / "bands-older.png").touch()
    data, paths = report.write(Campaign("nadir_spin", heavy).fly(3), tmp_path, str)
    assert (tmp_path / "mine.png").exists() and not (tmp_path / "bands-older.png").exists()
    assert data["passed"] == 0 and data["failed"] == 3 and not data["final"][0]["percentiles"]
    assert [p.name for p in paths] == ["summary.txt", "summary.json", "runs.csv", "runs.h5"]
    assert "world.craft.mass must be >= 0" in report.text(data)


@pytest.mark.long("draws a report with all its figures")
def test_a_page_is_whole_and_has_no_links_outside(campaign, result, tmp_path):
    data, paths = report.write(result, tmp_path, lambda i: f"again <{i}>")
    page = Page(pages.write(tmp_path / "report.html", data, [p for p in paths if p.suffix == ".png"], "fledge <again>",
                            campaign.nominal.mission.folder).read_text(encoding="utf-8"))
    assert not {"script", "link", "iframe"} & set(page.tags)
    for link in page.links:
        assert link.startswith("data:image/png;base64,") or (link[:1] == "#" and link[1:] in page.ids), link[:80]
    failed = next(iter(result.failures))
    for words in (f"{len(result.passed) - len(result.failures)} of 40 passed", "far away", f"again <{failed}>",
                  "norm(flight.tracking.error.sigma_BR) at the end < 0.8", "world.craft.I_B[0, 0]", "fledge <again>",
                  "nominal + normal(0, 10 kg m^2)"):
        assert page.says(words), words
    assert page.source.count("<figure>") == sum(p.suffix == ".png" for p in paths)


# --- more runs than are stored one by one ----------------------------------------------------------

def shares_of(campaign, cuts, seed=5):
    return [fly_share(campaign, seed, first, end)[0] for first, end in cuts]


def test_errors_have_the_order_of_the_runs_not_of_their_ends(campaign):
    kept = store.Store(campaign, 3, 5)
    for run in (2, 0, 1):
        kept.add(Share.failed(campaign, run, f"of run {run}"))
    assert list(Result(campaign, 5, kept).errors.items()) == [(run, f"of run {run}") for run in range(3)]


@pytest.mark.long("many random shares")
def test_percentiles_from_counts_do_not_depend_on_the_shares(campaign, result, tmp_path, monkeypatch):
    monkeypatch.setattr(store, "EXACT", 100)
    results = []
    for folder, cuts in ((None, [(0, 40)]), (tmp_path, [(33, 40), (0, 3), (10, 33), (3, 10), (0, 5)])):
        kept = store.Store(campaign, 40, 5, folder)
        for share in shares_of(campaign, cuts):
            kept.add(share)
        results.append(Result(campaign, 5, kept))
    first, second = results
    assert not first.exact and first.failures == second.failures == result.failures
    assert first.unhealthy() == second.unhealthy()
    for path, values in result.draws.items():
        assert (first.draws[path] == values).all() and (second.draws[path] == values).all()
    for variable in campaign.dispersions.shown:
        for panel in variable.panels:
            bands = first.bands(panel, (5, 50, 95))
            assert (bands == second.bands(panel, (5, 50, 95))).all()
            lower = np.percentile(panel.values(result.store.series()), (5, 50, 95), axis=0, method="lower")
            assert (np.abs(bands - lower) <= BOUND * np.abs(lower)).all()
        assert list(first.runs_of(panel, range(40))) == list(result.failures)[:store.LINES]
        for run, values in first.runs_of(panel, range(40)).items():
            assert (values == result.runs_of(panel, [run])[run]).all()
    with pytest.raises(fledge.SetupError, match="of which the percentiles are kept"):
        first.retained
    data, paths = report.write(second, tmp_path, str)
    second.close()
    rows = np.load(tmp_path / "rows.npy")
    assert "runs.csv" not in [p.name for p in paths] and not (tmp_path / "unfinished").exists()
    path = "world.craft.I_B[0, 0]"
    assert (rows[:, data["columns"].index(path)] == result.draws[path]).all()


def test_counts_of_any_numbers_have_the_stated_bound():
    values = np.random.default_rng(0).normal(size=(2001, 4)) * [1e-12, 1, 1e12, 0]
    values[:, 1] = np.round(values[:, 1])
    counts = Counts(4)
    for part in np.array_split(values, 7):
        counts.add(part)
    lower = np.percentile(values, (0, 1, 50, 99, 100), axis=0, method="lower")
    found = counts.percentiles((0, 1, 50, 99, 100))
    assert (np.abs(found - lower) <= BOUND * np.abs(lower)).all() and (found[:, 3] == 0).all()
    assert abs(counts.least_positive() / values[values > 0].min() - 1) <= BOUND


@pytest.mark.parametrize("exact", [store.EXACT, 100])
def test_a_campaign_that_was_broken_off_goes_on(campaign, result, tmp_path, monkeypatch, exact):
    monkeypatch.setattr(store, "EXACT", exact)
    kept = store.Store(campaign, 40, 5, tmp_path)
    for share in shares_of(campaign, [(0, 7), (20, 25)]):
        kept.add(share)
    kept.save()
    kept.add(shares_of(campaign, [(25, 30)])[0])    # a crash: this has not been saved
    seen = []
    again = campaign.fly(40, seed=5, folder=tmp_path, progress=lambda finished, failed: seen.append(finished))
    assert seen[0] == 12 and seen[-1] == 40
    assert again.failures == result.failures and again.unhealthy() == result.unhealthy()
    assert all((again.draws[path] == values).all() for path, values in result.draws.items())
    if exact > 100:
        assert same(again, result)
    else:
        whole = campaign.fly(40, seed=5)
        variable = campaign.dispersions.measures()[0]
        assert (again.bands(variable, (5, 95)) == whole.bands(variable, (5, 95))).all()
    other = campaign.fly(40, seed=6, folder=tmp_path, progress=lambda finished, failed: seen.append(finished))
    assert seen.index(0) and other.seed == 6        # another plan begins anew
    other.close()
    assert not list(tmp_path.glob("unfinished"))


# --- drivers ---------------------------------------------------------------------------------------

def test_chance_makes_a_driver_as_seldom_as_documented():
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(400):
        flown = Drawn({f"x{i}": rng.normal(size=200) for i in range(5)})
        found += bool(drivers.drivers(flown, rng.normal(size=200)))
    assert found <= 4   # 0.4 are expected; so many come by chance with a probability below 1e-3


class Drawn:
    """Draws, without flights."""

    def __init__(self, draws):
        self.draws = draws
        self.complete = np.ones(len(next(iter(draws.values()))), bool)


@pytest.mark.parametrize("shape, correlation", [(lambda x: x, 1), (lambda x: -x**3, -1), (np.abs, 0), (np.cos, 0),
                                                (np.round, 1)])
def test_dependences_of_any_shape_are_found(shape, correlation):
    rng = np.random.default_rng(4)
    x = rng.permutation(np.linspace(-3, 3, 300))
    draws = {"x": x, "n": rng.integers(0, 3, 300).astype(float), "y": rng.normal(size=300)}
    first, *others = drivers.drivers(Drawn(draws), shape(x) + 0.1 * rng.normal(size=300))
    assert first.path == "x" and first.share > 0.9 and abs(first.correlation - correlation) < 0.2 and not others
    first, *others = drivers.drivers(Drawn(draws), draws["n"] == 1)
    assert first.path == "n" and first.share == pytest.approx(1) and not others


def test_quantiles_of_chi_squared():
    for degrees, p, table in ((1, 0.999, 10.828), (4, 0.999, 18.467), (15, 0.999, 37.697), (15, 0.95, 24.996)):
        assert table <= drivers.chi_squared(p, degrees) * 1.001 < 1.02 * table


def test_the_draw_that_matters_is_found():
    def push(d):
        d.duration, d.every = 5 * s, 1 * s
        d["world.craft.I_B[2, 2]"] = d.nominal + d.normal(0, 1)
        d["world.craft.omega_BN_B[1]"] = d.normal(0, 1 * deg / s)
        rate = d.retain("world.craft.state.omega_BN_B")
        d.check(rate[1].final < 1)
        d.check(rate.norm().final < 1)

    result = Campaign("nadir_spin", push).fly(60)
    linear, even = (drivers.drivers(result, result.reached(requirement)[0])
                    for requirement in result.campaign.dispersions.requirements)
    assert [driver.path for driver in linear] == [driver.path for driver in even] == ["world.craft.omega_BN_B[1]"]
    assert linear[0].share > 0.9 and linear[0].correlation > 0.99
    assert even[0].share > 0.5 and abs(even[0].correlation) < 0.5


def test_formulas_are_checks_of_a_campaign(tmp_path):
    """Their margins are those of the retained variables; an unknown verdict fails."""
    shutil.copytree(fledge.mission.find("nadir_spin").folder, tmp_path / "plays")
    (tmp_path / "plays/requirements.py").write_text(
        'from fledge.requirements import always\n\n\ndef rates(r):\n    """Rates."""\n'
        '    r.require("RATE-1", "slow", always(r.signal("world.craft.state.omega_BN_B").norm() < 0.04))\n'
        '    r.require("RATE-2", "", method="analysis")\n')

    def push(d):
        d.duration, d.every = 20 * s, 1 * s
        d["world.craft.omega_BN_B[1]"] = d.normal(0, 1 * deg / s)
        rate = d.signal("world.craft.state.omega_BN_B").norm()
        d.check(always(implies(after(10 * s), rate < 0.036)), "fast")
        d.require("RATE-1")
        d.retain("world.craft.state.omega_BN_B")

    result = Campaign(tmp_path / "plays", push).fly(40)
    rates = np.linalg.norm(result.retained["world.craft.state.omega_BN_B"], axis=2)
    for requirement, wanted in zip(result.campaign.dispersions.requirements,
                                   (0.036 - rates[:, 10:].max(axis=1), 0.04 - rates.max(axis=1))):
        margins, times, holds = result.reached(requirement)
        assert margins == pytest.approx(wanted, rel=1e-12) and (holds == (wanted > 0)).all()
        assert 0 < holds.sum() < 40 and not np.isnan(times).any()
    failures = "".join(result.failures.values())
    assert "fast: " in failures and "is violated by 0.0" in failures

    # Looked at as often as where it is flown alone: by its own r.every, of samples that are close enough.
    text = (tmp_path / "plays/requirements.py").read_text()
    (tmp_path / "plays/requirements.py").write_text(
        text.replace("    r.require", "    r.every = 0.1\n    r.require", 1))

    def coarse(d):
        push(d)
        d.every = 4 * s

    finer = Campaign(tmp_path / "plays", coarse).fly(4)
    rates = np.linalg.norm(finer.retained["world.craft.state.omega_BN_B"], axis=2)
    assert finer.campaign.dispersions.every == 0.1 and rates.shape == (4, 201)
    assert finer.reached(finer.campaign.dispersions.requirements[1])[0] == pytest.approx(0.04 - rates.max(axis=1))
    (tmp_path / "plays/requirements.py").write_text(text.replace("    r.require", "    r.every = 3\n    r.require", 1))
    coarser = Campaign(tmp_path / "plays", push).fly(4)
    rates = np.linalg.norm(coarser.retained["world.craft.state.omega_BN_B"], axis=2)
    assert coarser.reached(coarser.campaign.dispersions.requirements[1])[0] == pytest.approx(
        0.04 - rates[:, ::3].max(axis=1))
    (tmp_path / "plays/requirements.py").write_text(text)

    def longer(d):
        push(d)
        d.check(within(30 * s, d.signal("world.craft.state.omega_BN_B").norm() < 0.01))

    with pytest.raises(fledge.SetupError, match="30 s ahead, which is longer than a run of 20 s"):
        Campaign(tmp_path / "plays", longer)
    with pytest.raises(fledge.SetupError, match="RATE-2 is shown by analysis"):
        Campaign(tmp_path / "plays", lambda d: d.require("RATE-2"))
    with pytest.raises(fledge.SetupError, match="did you mean 'RATE-1'"):
        Campaign(tmp_path / "plays", lambda d: d.require("RATE-11"))


REPORTS = """
from fledge.requirements import *
from fledge.units import s


def reports(r):
    \"\"\"What happens, and what packets say.\"\"\"
    for every in 0.5, 2:
        name, r.every = every, every * s
        r.require(f"EVENT-{name}", "", never(after(4 * s) & r.event("flight", "start")))
        r.require(f"MODE-{name}", "", always(implies(r.command("flight", "mode"), within(4 * s, r.mode() == "point"))))
        r.require(f"NOOP-{name}", "", never(r.command("flight", "noop", "accepted")))
        r.require(f"SENT-{name}", "", eventually(r.packet("flight", "flight.tracking.error"), 9 * s, 11 * s))
        r.require(f"SAID-{name}", "", always(implies(
            after(12 * s), r.telemetry("flight", "flight.tracking.error.sigma_BR").norm() < 0.6)))
        r.require(f"BOTH-{name}", "", always(implies(after(12 * s), (r.telemetry(
            "flight", "flight.tracking.error.sigma_BR") - r.signal("flight.tracking.error.sigma_BR")).norm() < 0.01)))
"""


@pytest.fixture(scope="module")
def reporting(tmp_path_factory):
    """A campaign of runs that get commands, with requirements on events, commands and packets."""
    folder = tmp_path_factory.mktemp("reporting") / "plays"
    folder.mkdir()
    for name, text in (("flight", FLIGHT), ("world", WORLD), ("requirements", REPORTS)):
        (folder / f"{name}.py").write_text(text)

    def commanded(d):
        d.duration, d.every = 20 * s, 0.5 * s
        d["world.craft.sigma_BN"] = d.attitude()
        d.command(d.packets.telemetry("flight.tracking.error", every=3), at=d.uniform(1 * s, 16 * s))
        d.command(d.choice(None, d.packets.noop(), d.packets.mode("rest")), at=d.uniform(1 * s, 19 * s))
        d.require(*REQUIRED)

    return Campaign(folder, commanded)


REQUIRED = [f"{name}-{every}" for every in ("0.5", "2") for name in ("EVENT", "MODE", "NOOP", "SENT", "SAID", "BOTH")]


def test_events_commands_and_packets_are_judged_as_in_each_run_alone(reporting):
    result = reporting.fly(30, seed=3)
    reached = [result.reached(requirement) for requirement in reporting.dispersions.requirements]
    verdicts = {id: set() for id in REQUIRED}
    for index in range(30):
        sim = reporting.simulation(index, seed=3)
        judged, watch = Requirements(sim).watch(), reporting.watch(sim)
        log = sim.record(*(retained.port(sim) for retained in reporting.dispersions.retained.values()
                           if isinstance(retained, Variable)), every=0.5 * s)
        sim.run(20 * s)
        assert reporting.judge(log, watch).failures.get(0) == result.failures.get(index)
        for outcome, (margins, times, holds) in zip(judged.outcomes(), reached):
            verdicts[outcome.requirement.id].add(outcome.verdict)
            assert holds[index] == (outcome.verdict == "holds"), outcome
            if outcome.verdict != "unknown":
                at = np.nan if outcome.at is None else outcome.at
                assert np.array_equal([margins[index], times[index]], [outcome.margin, at], equal_nan=True), outcome
    mixed = {id for id, found in verdicts.items() if "holds" in found and len(found) > 1}
    assert mixed == {id for id in REQUIRED if not id.startswith("EVENT")}, verdicts
    assert same(reporting.fly(30, seed=3, threads=3), result)
    assert same(reporting.fly(6, seed=3, processes=True), reporting.fly(6, seed=3))
    with pytest.raises(fledge.SetupError, match="nothing watches what the campaign retains"):
        _core.fly(reporting.nominal.kernel, reporting.plan, 1)


def test_a_live_line_on_a_terminal(monkeypatch, capsys):
    from fledge.cli.studies.montecarlo import _Live

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with _Live("nadir_spin, release", 200) as line:
        monkeypatch.setattr(_Live, "spent", 10.0)
        line.count(0, 0)
        line.count(50, 2)
    assert re.search(r"nadir_spin, release \[#######\.+\]  25%  50 of 200, 2 failed, 5 a second, 30 s left",
                     capsys.readouterr().err)
