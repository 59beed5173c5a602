# SPDX-License-Identifier: Apache-2.0
"""What a record knows of the beginning of its run: parameters, and revisions in every kind of tree."""

import json
import os
import shutil
import subprocess
import warnings

import pytest

import fledge
from fledge import Archive, new
from fledge.mission import provenance
from fledge.mission.provenance import Revisions, parameters

IDENTITY = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull,
            **{f"GIT_{role}_{what}": "a@b" for role in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}}


def git(folder, *arguments):
    done = subprocess.run(["git", "-C", folder, *arguments], env={**os.environ, **IDENTITY}, capture_output=True,
                          text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A repository in place of Fledge's; the repository around it has nothing to do with it."""
    git(tmp_path, "init", "-q")
    root = tmp_path / "fledge"
    (root / "missions" / "m").mkdir(parents=True)
    (root / "missions" / "m" / "flight.py").write_text("\n")
    git(root, "init", "-q")
    git(root, "add", ".")
    git(root, "commit", "-qm", "first")
    monkeypatch.setattr(provenance, "ROOT", root)
    return root


def test_the_commit_and_whether_files_differ_from_it(tree):
    commit = git(tree, "rev-parse", "HEAD")[:12]
    assert Revisions(None).read() == Revisions(tree / "missions" / "m").read() == {"fledge": commit}
    for name in ("runs/m/run.mcap", "build/x", "missions/m/__pycache__/flight.pyc"):   # come of the run itself
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).touch()
    assert Revisions(None).read() == {"fledge": commit}
    (tree / "missions" / "m" / "world.py").write_text("")                       # not committed yet
    assert Revisions(None).read() == {"fledge": f"{commit}-dirty"}
    git(tree, "add", ".")
    git(tree, "commit", "-qm", "second")
    assert Revisions(None).read() == {"fledge": git(tree, "rev-parse", "HEAD")[:12]} != {"fledge": commit}


def test_a_project_that_names_another_fledge_warns(tree, tmp_path, monkeypatch):
    project = tmp_path / "sat"
    new.project(project)
    file = project / "pyproject.toml"
    monkeypatch.setenv("FLEDGE_PROJECT", str(project))

    def warned(text):
        provenance.compare_with_project.cache_clear()
        file.write_text(text)
        with warnings.catch_warnings(record=True) as found:
            fledge.load(fledge.mission.find("nadir_spin").folder)
            fledge.load(fledge.mission.find("nadir_spin").folder)
        return [(str(warning.message), warning.filename, warning.lineno) for warning in found
                if "of Fledge" in str(warning.message)]

    written, commit = file.read_text(), git(tree, "rev-parse", "HEAD")
    assert f'version = "{fledge.__version__}"\n' in written
    assert warned(written) == warned(f'[tool.fledge]\nrevision = "{commit}"') == warned("[tool.mypy]") == []
    assert warned('# A comment.\n[tool.fledge]\nversion = "9.1"\n') == [
        (f"this project names the version 9.1 of Fledge, and {fledge.__version__} runs: take that, or name this here",
         str(file), 2)]
    (text, _, line), = warned(f'[tool.fledge]\nversion = "{fledge.__version__}"\nrevision = "0123456789ab"\n')
    assert line == 1
    assert text.startswith(f"this project names the revision 0123456789ab of Fledge, and {commit[:12]} runs")
    for wrong, why in (("[tool.fledge]\nversions = 1\n", "has version and revision; found versions"),
                       ("[tool]\nfledge = '0.1'\n", "expected a table .tool.fledge.* found '0.1'")):
        with pytest.raises(fledge.SetupError, match=why):
            warned(wrong)
    file.write_bytes(b"# \xe9\n")
    provenance.compare_with_project.cache_clear()
    with pytest.raises(fledge.SetupError, match="pyproject.toml: 'utf-8' codec"):
        fledge.load(fledge.mission.find("nadir_spin").folder)


def test_a_worktree_a_detached_head_and_packed_refs(tree):
    commit = git(tree, "rev-parse", "HEAD")[:12]
    git(tree, "worktree", "add", "-q", "--detach", str(tree.parent / "other"))
    git(tree, "pack-refs", "--all")
    provenance.ROOT = tree.parent / "other"         # the fixture's monkeypatch restores it
    assert Revisions(None).read() == {"fledge": commit}
    (provenance.ROOT / "missions" / "m" / "flight.py").write_text("changed\n")
    assert Revisions(None).read() == {"fledge": f"{commit}-dirty"}


def test_a_mission_elsewhere_has_a_revision_of_its_own(tree, tmp_path):
    own = tmp_path / "own"
    (own / "missions" / "n").mkdir(parents=True)
    (own / "missions" / "n" / "flight.py").write_text("\n")
    git(own, "init", "-q")
    git(own, "add", ".")
    git(own, "commit", "-qm", "mine")
    ours, theirs = (git(folder, "rev-parse", "HEAD")[:12] for folder in (tree, own))
    assert Revisions(own / "missions" / "n").read() == {"fledge": ours, "mission": theirs}
    (own / "notes.txt").write_text("not of the mission")
    assert Revisions(own / "missions" / "n").read()["mission"] == theirs


def test_a_tree_that_is_in_no_repository_of_its_own_has_no_revision(tree, monkeypatch):
    shutil.rmtree(tree / ".git")                    # as installed; the repository around it is not Fledge's
    assert Revisions(None).read() == {}
    git(tree, "init", "-q")                         # nothing committed yet
    assert Revisions(None).read() == {}
    git(tree, "add", ".")
    git(tree, "commit", "-qm", "first")
    monkeypatch.setenv("PATH", str(tree))           # no git here
    assert Revisions(None).read() == {}


def test_a_record_has_the_parameters_with_which_its_run_began(tmp_path):
    sim = fledge.load("nadir_spin")
    sim.flight.control.K = 3.25
    sim.record(sim.flight.tracking.error)
    sim.archive(tmp_path / "run.mcap")
    sim.run(2)
    sim.flight.control.K = 4
    sim.run(2)
    sim.close_archive()
    with Archive(tmp_path / "run.mcap") as archive:
        assert archive.metadata["parameters"]["flight.control.K"] == "3.25 N m"
        known = archive.parameters
    assert known["flight.control.K"] == 3.25 and known["world.craft.parts"] == "world.wheels"
    assert known["world.craft.I_B"] == sim.world.craft.I_B.tolist()
    assert known["world.craft.gravity"].startswith("MARS, mu = ")
    now = parameters(sim.processes)
    assert set(now) == set(known) and json.loads(now["flight.control.K"].partition(" ")[0]) == 4
    assert not [text for text in now.values() if " at 0x" in text or str(provenance.ROOT) in text]


@pytest.mark.long("loads all missions, twice")
def test_every_mission_writes_the_same_parameters_each_time():
    for name in fledge.missions():
        first, second = (parameters(fledge.load(name).processes) for _ in range(2))
        assert first == second and len(first) > 10


def test_each_file_of_a_scenario_that_begins_anew_has_its_revisions(tmp_path):
    sim = fledge.load("nadir_spin")
    sim.record(sim.flight.tracking.error)
    sim.archive(tmp_path / "run.mcap")
    sim.run(1)
    sim.reset()
    sim.run(1)
    sim.close_archive(outcome="passed")
    first, second = (Archive(tmp_path / name).metadata for name in ("run.mcap", "run-2.mcap"))
    assert first.get("revisions") == second.get("revisions") and first["parameters"] == second["parameters"]
    assert (provenance.ROOT / ".git").exists() == ("revisions" in first)
    assert second["end"] == {"outcome": "passed"}
