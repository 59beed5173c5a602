# SPDX-License-Identifier: Apache-2.0
"""Two versions of a mission's flight over the same campaign: the version in the tree against one with another gain."""
import csv
import shutil
import subprocess

import numpy as np
import pytest

from fledge import cli
from fledge.analysis.versions import Results, compare, fly, regressions
from fledge.montecarlo import Campaign
from fledge.targets import build

RUNS = 12


def mutated(folder, old="P=45.0", new="P=20.0", file="flight.py"):
    """nadir_spin in a folder, with a change."""
    shutil.copytree(build.ROOT / "missions/nadir_spin", folder / "nadir_spin",
                    ignore=shutil.ignore_patterns("*_test.py"))
    place = folder / "nadir_spin" / file
    text = place.read_text()
    assert text.count(old) == 1
    place.write_text(text.replace(old, new))
    return folder / "nadir_spin"


@pytest.fixture(scope="module")
def weak(tmp_path_factory):
    return mutated(tmp_path_factory.mktemp("weak"))


def test_a_weaker_gain_is_found_and_the_tree_is_no_worse_than_itself(weak, tmp_path, capsys):
    out = tmp_path / "out"
    words = ["--runs", str(RUNS), "--seed", "3", "--out", str(out)]
    assert cli.main(["versions", str(weak), "--against", str(build.ROOT / "missions/nadir_spin"), *words]) == 1
    output = capsys.readouterr()
    assert "held in" in output.err and "FELL" in output.out
    # Margins and moves, against the campaigns themselves.
    this, other = (Campaign(folder).fly(RUNS, seed=3) for folder in (weak, build.ROOT / "missions/nadir_spin"))
    error = this.campaign.dispersions.requirements[0]
    theirs, ours = other.reached(other.campaign.dispersions.requirements[0])[0], this.reached(error)[0]
    with (out / "versions.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == RUNS
    for which, values in (("this", ours), ("other", theirs)):
        found = [float(row[f"margin: {error!r}, {which}"]) for row in rows]
        np.testing.assert_allclose(found, error.limit - values, rtol=1e-15)
    lost = [i for i in range(RUNS) if theirs[i] < error.limit <= ours[i]]
    assert lost and f"held in {len(lost)} run" in output.err and f"run {lost[0]}" in output.err

    # The other way, against the stored results: the tree is better.
    assert cli.main(["versions", "nadir_spin", "--against", str(out / "this"), "--runs", str(RUNS), "--seed", "3",
                     "--out", str(tmp_path / "back")]) == 0
    assert cli.main(["versions", "nadir_spin", "--against", str(tmp_path / "back/this"), "--runs", str(RUNS), "--seed",
                     "3", "--out", str(tmp_path / "same")]) == 0
    assert "nothing moved by a bit" in capsys.readouterr().out


def test_a_revision_is_flown(tmp_path):
    """A mission in a repository of its own: the revision has the gain of the tree, what is there now a weaker one."""
    folder = tmp_path / "repository"
    shutil.copytree(build.ROOT / "missions/nadir_spin", folder / "missions/nadir_spin")
    git = ["git", "-C", str(folder), "-c", "user.name=x", "-c", "user.email=x@example.com"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "first"], ["tag", "v1"]):
        subprocess.run([*git, *words], check=True)
    flight = folder / "missions/nadir_spin/flight.py"
    flight.write_text(flight.read_text().replace("P=45.0", "P=20.0"))
    this, other = fly(str(folder / "missions/nadir_spin"), "v1", runs=4, seed=3, folder=tmp_path / "out")
    again, tree = fly("nadir_spin", str(other.folder), runs=4, seed=3, folder=tmp_path / "tree")
    assert not [change for change in compare(again, tree) if change.moved.any()]
    found = compare(this, other)
    assert {change.name for change in found if change.required} == {
        change.name for change in compare(again, tree) if change.required}
    assert any(np.abs(change.moved).max() > 0 for change in found)
    assert all(regression.lost for regression in regressions(found))


def test_only_the_same_runs_are_compared(weak, tmp_path):
    this, other = fly(str(weak), str(build.ROOT / "missions/nadir_spin"), runs=2, folder=tmp_path / "a")
    drawn = mutated(tmp_path / "drawn", "d.uniform(0.95, 1.05)", "d.uniform(0.9, 1.1)", "dispersions.py")
    with pytest.raises(Exception, match=r"the draws of world.wheels.J\[0\] .* differ"):
        compare(*fly(str(drawn), str(this.folder), runs=2, folder=tmp_path / "b"))
    with pytest.raises(Exception, match="different runs: seed is 1 and 0"):
        compare(*fly(str(weak), str(other.folder), runs=2, seed=1, folder=tmp_path / "c"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(Exception, match="has no results of a campaign"):
        Results(tmp_path / "empty")


@pytest.mark.parametrize("words, wrong", [
    (["--against", "no-such-version"], "there is no such folder, and no such revision"),
    (["--against", "."], "it has neither results of a campaign, nor a mission"),
    (["--campaign", "other", "--against", "HEAD"], "has no campaign 'other'")])
def test_wrong_words_are_refused(tmp_path, monkeypatch, capsys, words, wrong):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["versions", "nadir_spin", *words, "--runs", "1", "--out", str(tmp_path / "out")]) == 2
    assert wrong in capsys.readouterr().err
