# SPDX-License-Identifier: Apache-2.0
"""The times of tasks on the board are those that the emulator's own profile counts; the search keeps the longest."""
import csv
import json
import re
import shutil

import pytest

import fledge.emulator
from fledge import cli
from fledge.analysis import timing
from fledge.targets import build
from tests.needs import flies_on

pytestmark = flies_on("leon3")


@pytest.fixture(scope="module")
def search(tmp_path_factory):
    return timing.Search("nadir_spin", duration=8.0, folder=tmp_path_factory.mktemp("spin"))


def test_a_task_takes_what_the_profile_counts(search, tmp_path, monkeypatch):
    boards, times = [], []

    class Profiled(fledge.emulator.Board):
        def fly(self, *arguments):
            super().fly(*arguments)
            self.profile(tmp_path / "profile")
            boards.append(self)

    keep = timing._Watch._keep
    monkeypatch.setattr(fledge.emulator, "Board", Profiled)
    monkeypatch.setattr(timing._Watch, "_keep", lambda self, *given: (times.append(given), keep(self, *given)))
    found, *_ = search.fly(timing.Run(0, 0))
    boards[0].finish()
    calls, cycles = re.search(r"cfn=run_gnc\ncalls=(\d+) \d+\n\d+ \d+ (\d+)\n",
                              (tmp_path / "profile").read_text()).groups()
    own = [cycles for task, _, _, cycles, _ in times if task == "gnc"]
    assert (len(own), sum(own)) == (int(calls), int(cycles)) and len(own) == 17
    assert found["gnc", ""].cycles == max(own[1:]) < found[timing.TICK, ""].cycles      # the first one is left out


def test_the_search_keeps_the_longest_and_says_how_to_fly_it_again(search):
    found = search.search(6, jobs=2)
    assert found.runs == 6 and 200 < found.stack < found.stack_size == 65536 and found.heap == 0
    drawn = [search.fly(timing.Run(0, index))[0] for index in range(3)]
    for key, longest in found.longest.items():
        assert longest.cycles >= max(paths[key].cycles for paths in drawn)
        assert longest.time == longest.cycles / search.clock
        assert longest.margin == pytest.approx(100 * (1 - longest.time / 0.5))
        # Its draws are those of the run, and it is what they give.
        again = search.fly(timing.Run(0, longest.run, longest.draws))[0][key]
        assert (again.cycles, again.t, again.inputs, again.draws) == (
            longest.cycles, longest.t, longest.inputs, longest.draws)
    read = found.longest["gnc", ""].inputs["flight.control.error.sigma_BR"]
    assert len(read) == 3 and any(read)
    assert search.search(6, jobs=1) == found


def test_the_longest_path_of_a_mission_is_within_its_bound(search):
    found = search.search(2, jobs=1)
    search.bound(found)
    path = found.longest["gnc", ""]
    assert found.unbounded or path.cycles <= path.bound < 4 * path.cycles
    assert found.longest[timing.TICK, ""].bound is None


@pytest.mark.long("searches another mission")
def test_a_task_has_a_row_for_each_mode(tmp_path, capsys):
    folder = tmp_path / "two_modes"
    shutil.copytree(build.ROOT / "missions/nadir_spin", folder, ignore=shutil.ignore_patterns("*_test.py", "disp*"))
    flight = folder / "flight.py"
    flight.write_text(flight.read_text().replace("    f.task(", "    gnc = f.task(") + """
    f.mode("early", [gnc])
    f.mode("late", [gnc])
    error = f.watch(f.tracking.error)
    f.event("turns", when=error.head.sequence > 6, modes=["early"], enter="late")
""")
    words = ["profile", str(folder), "--on", "leon3", "--longest", "2", "--for", "10s", "--jobs", "1", "--out"]
    assert cli.main([*words, str(tmp_path / "out")]) == 0
    output = capsys.readouterr().out
    assert "which differ in their noise" in output and re.search(r"stack +[\d,]+ of 65,536 bytes", output)
    with (tmp_path / "out/timing.csv").open() as file:
        rows = list(csv.DictReader(file))
    facts = json.loads((tmp_path / "out/timing.json").read_text())
    assert facts["runs"] == 2 and len(rows) == 4
    for row, longest in zip(rows, facts["longest"], strict=True):
        assert float(row["longest [s]"]) == longest["time"] and row["mode"] == longest["mode"]
        assert f"{longest['margin']:.3f} %" in output
    times = {(longest["task"], longest["mode"]): longest["t"] for longest in facts["longest"]}
    assert times["gnc", "early"] <= 3.5 < times["gnc", "late"]


def test_one_of_several_processes_is_chosen(tmp_path, capsys):
    assert cli.main(["profile", "constellation", "--on", "leon3", "--longest", "1", "--out", str(tmp_path)]) == 2
    assert "several flight processes; choose one with --process" in capsys.readouterr().err


@pytest.mark.parametrize("words, wrong", [
    (["--on", "linux"], "--longest is for --on leon3"),
    (["spin,turn", "--on", "leon3"], "has no scenario 'turn'"),
    (["--on", "leon3", "--campaign", "none"], "has no campaign 'none'")])
def test_wrong_words_are_refused(tmp_path, capsys, words, wrong):
    assert cli.main(["profile", "nadir_spin", *words, "--longest", "1", "--for", "1s", "--out", str(tmp_path)]) == 2
    assert wrong in capsys.readouterr().err
