# SPDX-License-Identifier: Apache-2.0
"""Two versions of flight over the same campaign: the same runs, seeds and draws; what moved, and which margin fell.

    this, other = fly("nadir_spin", "HEAD~3", runs=200)
    found = compare(this, other)        # a Change of each requirement and each measure
    regressions(found)                  # of requirements that held in a run and are violated there now

A version is a folder of results that a campaign has written (summary.json, runs.csv), or a source of such results: a
folder with the same mission, a tree of Fledge or of a project, or a revision in git.
"""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import folders
from fledge.columns import columns
from fledge.errors import Failure, SetupError, did_you_mean
from fledge.disk import build_folder, write_files
from fledge.mission.provenance import GIT, ROOT, identity
from fledge.montecarlo import Campaign, report

if TYPE_CHECKING:
    import numpy as np

RESULTS = ("summary.json", "runs.csv")
SOURCES = "sources.json"
REVISION = "revision-"      # begins the name of the folder with its files
PYTHON = ("python", "ground", "cosim", "emulator", "fmi", "studies")     # folders of the package fledge
BESIDE = ("docs", "bench", "tests", "runs", "*.md", "*_test.py", "*_test.cpp")  # no flight depends on these


# --- results ---------------------------------------------------------------------------------------

class Results:
    """The results of a campaign in a folder. columns: name with its unit -> (runs,), NaN where there is no number"""

    def __init__(self, folder: Path) -> None:
        import numpy as np

        self.folder = folder
        try:
            self.summary = json.loads((folder / RESULTS[0]).read_text(encoding="utf-8"))
            with (folder / RESULTS[1]).open(encoding="utf-8", newline="") as file:
                head, *rows = csv.reader(file)
        except (OSError, ValueError) as error:
            raise SetupError(f"{folder} has no results of a campaign that can be compared: {error}") from None
        self.passed = np.array([row[1] == "passed" for row in rows])
        # A margin of names alone is infinite, and of two of these there is no difference: 1 or -1.
        self.columns = {name: np.array([math.copysign(1.0, x) if math.isinf(x) else x
                                        for x in (float(row[i] or "nan") for row in rows)])
                        for i, name in enumerate(head) if name not in ("run", "outcome", "failure")}
        self.draws = {_head(draw["path"], draw["unit"]): draw["nominal"] for draw in self.summary["draws"]}
        self.sources = json.loads((folder / SOURCES).read_text("utf-8")) if (folder / SOURCES).exists() else {}

    def margins(self, requirement: dict[str, Any]) -> np.ndarray:
        """(runs,) How far a requirement, of the summary, is from its limit: > 0 where it holds. Of one number that must
        be another, 1 or -1."""
        import numpy as np

        text, unit = requirement["requirement"], requirement["unit"]
        if (formula := _head(f"margin of {text}", unit)) in self.columns:
            return self.columns[formula]
        comparison = next(word for word in text.split()[::-1] if word in ("<", "<=", ">", ">=", "==", "!="))
        name = text.rpartition(f" {comparison} ")[0]
        values = self.columns[_head(text if _head(text, unit) in self.columns else name, unit)]
        if comparison in ("==", "!="):
            right = (values == requirement["limit"]) == (comparison == "==")
            return np.where(np.isnan(values), np.nan, np.where(right, 1.0, -1.0))
        return requirement["limit"] - values if comparison[0] == "<" else values - requirement["limit"]


def _head(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


@dataclass
class Change:
    """The change of a requirement's margins, or of a measure, from the other version to this one, run by run.

    required: whether it is a requirement; this, other: (runs,) its margins or values
    """
    name: str
    unit: str
    required: bool
    other: np.ndarray
    this: np.ndarray

    @property
    def moved(self) -> np.ndarray:
        """(runs,) this less the other; 0 where neither has a number."""
        import numpy as np

        both = np.isnan(self.this) & np.isnan(self.other)
        return np.where(both, 0.0, self.this - self.other)

    @property
    def lost(self) -> list[int]:
        """The runs in which a requirement held, and does not now."""
        return [int(i) for i in ((self.other > 0) & ~(self.this > 0)).nonzero()[0]] if self.required else []

    def worst(self, values: np.ndarray) -> tuple[float, int]:
        """(least, its run); (NaN, -1) if there is no number."""
        import numpy as np

        return (float(np.nanmin(values)), int(np.nanargmin(values))) if not np.isnan(values).all() else (np.nan, -1)


def compare(this: Results, other: Results) -> list[Change]:
    """The changes, requirements first. Raises SetupError unless both flew the same runs with the same draws."""
    import numpy as np

    for name in ("campaign", "seed", "runs", "duration", "points"):
        if this.summary.get(name) != other.summary.get(name):
            raise SetupError(f"{this.folder} and {other.folder} are of different runs: {name} is "
                             f"{this.summary.get(name)} and {other.summary.get(name)}")
    for results in (this, other):
        if results.summary["flown"] < results.summary["runs"]:
            raise SetupError(f"{results.folder}: only {results.summary['flown']} of {results.summary['runs']} runs "
                             "were flown")
    for name in sorted({*this.draws, *other.draws}):
        here, there = this.columns.get(name), other.columns.get(name)
        # A parameter of flight that is drawn about its nominal value differs with that.
        if here is None or there is None or this.draws.get(name) == other.draws.get(name) and not np.array_equal(
                here, there, equal_nan=True):
            raise SetupError(f"the draws of {name} differ: both versions need the same dispersions")
    changes = []
    known = {requirement["requirement"]: requirement for requirement in other.summary["requirements"]}
    for requirement in this.summary["requirements"]:
        if requirement["requirement"] in known:
            changes.append(Change(requirement["requirement"], requirement["unit"], True,
                                  other.margins(known[requirement["requirement"]]),
                                  this.margins(requirement)))
    changes += [Change(name, "", False, other.columns[name], values) for name, values in this.columns.items()
                if name not in this.draws and name in other.columns]
    return changes


def regressions(changes: Sequence[Change]) -> list[Change]:
    """Those of requirements that hold in fewer runs: of which a run has held, and does not now."""
    return [change for change in changes if change.lost]


# --- words -----------------------------------------------------------------------------------------

def text(this: Results, other: Results, changes: Sequence[Change]) -> list[str]:
    """Lines: the requirements with their least margins, then what moved."""
    import numpy as np

    def number(x: float) -> str:
        return "-" if np.isnan(x) else f"{x:.4g}"

    lines = [f"{this.summary['mission']}, {this.summary['campaign']}: {this.summary['runs']} runs, seed "
             f"{this.summary['seed']}", *(f"  {name:8} {results.folder}" + "".join(
                 f", {what} {revision}" for what, revision in results.sources.items())
                 for name, results in (("this", this), ("other", other)))]
    rows: list[tuple[str, ...]] = [("required", "held", "of the other", "least margin", "of the other", "run",
                                    "lost in", "")]
    for change in changes:
        if change.required:
            (now, at), (then, _) = change.worst(change.this), change.worst(change.other)
            rows.append((change.name, str(int((change.this > 0).sum())), str(int((change.other > 0).sum())),
                         number(now), number(then), str(at) if at >= 0 else "-", str(len(change.lost)),
                         "FELL, run " + ", ".join(map(str, change.lost[:5])) if change.lost else
                         "fell" if now < then else "rose" if now > then else "same"))
    if len(rows) > 1:
        lines += ["", *columns(rows, right=set(range(1, 7)), indent="  ")]
    rows = [("moved", "median", "most", "run")]
    for change in changes:
        sizes = np.abs(change.moved)
        if not change.required and np.nan_to_num(sizes, nan=np.inf).any():
            at = int(np.argmax(np.nan_to_num(sizes, nan=np.inf)))
            rows.append((change.name, number(float(np.nanmedian(change.moved))), number(float(change.moved[at])),
                         str(at)))
    lines += ["", *columns(rows, right={1, 2, 3}, indent="  ")] if len(rows) > 1 else ["", "  nothing moved by a bit"]
    only = [(name, {requirement["requirement"] for requirement in a.summary["requirements"]} -
             {requirement["requirement"] for requirement in b.summary["requirements"]})
            for name, a, b in (("this", this, other), ("other", other, this))]
    lines += [f"  not compared: {requirement} is required in the {name} version alone" for name, texts in only
              for requirement in sorted(texts)]
    return lines


def as_csv(this: Results, changes: Sequence[Change]) -> str:
    """A line for each run: its draws; the margins and measures of both versions."""
    import io

    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    named = [(f"margin: {change.name}" if change.required else change.name, change) for change in changes]
    draws = sorted(this.draws)
    writer.writerow(["run", *draws, *(f"{name}, {which}" for name, _ in named for which in ("other", "this"))])
    for i in range(len(this.passed)):
        writer.writerow([i, *(repr(float(this.columns[name][i])) for name in draws), *(
            "" if value != value else repr(float(value))
            for _, change in named for value in (change.other[i], change.this[i]))])
    return out.getvalue()


# --- flying ----------------------------------------------------------------------------------------

def fly(mission: str, against: str, campaign: str | None = None, runs: int = 100, seed: int = 0,
        folder: Path | None = None, threads: int | None = None) -> tuple[Results, Results]:
    """Fly this version and the other one; returns the results of both.

    against: see above. folder: for the results of both, in `this` and `other`; default: runs/MISSION/versions.
    Raises SetupError on a version that does not exist, Failure if the other tree does not fly.
    """
    ours = Campaign(mission, campaign)
    folder = folder or Path("runs") / ours.nominal.name / "versions"
    other = _version(ours.folder, against, folder)      # before the runs: it may not exist
    place = Path(against)
    this = _flown(ours, runs, seed, folder / "this", threads)
    if (place / RESULTS[0]).exists():
        return this, Results(place)
    tree, theirs = other
    if tree is None:
        return this, _flown(Campaign(theirs, ours.name), runs, seed, folder / "other", threads)
    return this, _by_launcher(tree, theirs, ours.name if campaign else None, runs, seed, folder / "other", threads)


def _flown(campaign: Campaign, runs: int, seed: int, folder: Path, threads: int | None) -> Results:
    result = campaign.fly(runs, seed, threads)
    if result.interrupted:
        raise KeyboardInterrupt
    summary = report.summary(result, lambda index: f"./fledge montecarlo {campaign.nominal.name} --campaign "
                             f"{campaign.name} --seed {seed} --only {index}")
    write_files({RESULTS[0]: json.dumps(summary, indent=1) + "\n", RESULTS[1]: report.as_csv(result),
                 SOURCES: json.dumps(identity(campaign.folder), indent=1) + "\n"}, folder)
    return Results(folder)


def _version(mission: Path, against: str, scratch: Path) -> tuple[Path | None, Path]:
    """(the tree whose launcher flies, or None for this Fledge; the folder of the mission) of a version."""
    place = Path(against)
    if (place / RESULTS[0]).exists() or folders.is_mission(place):
        return None, place.resolve()
    top = _git(mission, "rev-parse", "--show-toplevel")
    inside = mission.relative_to(Path(top).resolve()) if top else None
    if place.is_dir():
        tree = place.resolve()
        relative = inside if inside and folders.is_mission(tree / inside) else Path("missions") / mission.name
        if not folders.is_mission(tree / relative):
            raise SetupError(f"--against {against}: it has neither results of a campaign, nor a mission, nor the "
                             f"mission {relative}")
        return (tree if _builds(tree) else None), tree / relative
    if not top or inside is None:
        raise SetupError(f"--against {against}: there is no such folder, and the mission {mission} is not in git"
                         + ("" if shutil.which("git") else ", which is not installed"))
    revision = _git(mission, "rev-parse", "--verify", "--quiet", f"{against}^{{commit}}")
    if not revision:
        known = (_git(mission, "for-each-ref", "--format=%(refname:short)") or "").split()
        raise SetupError(f"--against {against}: there is no such folder, and no such revision in {top}"
                         + did_you_mean(against, known).rstrip(";"))
    beside = [f":(exclude){path}" for path in (inside.parent.as_posix() if len(inside.parts) > 1 else ".", *BESIDE)]
    same = not _builds(Path(top)) or not _differ(top, revision, beside)
    tree = scratch.resolve() / f"{REVISION}{revision[:12]}"
    if not tree.exists():
        _extract(top, revision, [inside.parent.as_posix()] if same and len(inside.parts) > 1 else ["."], tree)
    if not folders.is_mission(tree / inside):
        raise SetupError(f"--against {against}: the mission {inside} is not there")
    return (None if same else tree), tree / inside


def _differ(top: str, revision: str, beside: Sequence[str]) -> bool:
    """Whether the files of a repository differ from those of a revision, but for some."""
    done = subprocess.run([*GIT, "-C", top, "diff", "--quiet", revision, "--", ".", *beside], check=False)
    return done.returncode != 0


def _builds(tree: Path) -> bool:
    """Whether a tree has C of its own to be built: Fledge itself, or a project."""
    file = tree / "CMakeLists.txt"
    return (tree / "fledge").is_file() or (file.exists() and "fledge_project" in file.read_text("utf-8"))


def _extract(top: str, revision: str, paths: Sequence[str], folder: Path) -> None:
    """The files of a revision, in a folder."""
    part = folder.with_name(f"{folder.name}.part-{os.getpid()}")
    part.mkdir(parents=True)
    with subprocess.Popen([*GIT, "-C", top, "archive", revision, "--", *paths], stdout=subprocess.PIPE) as archive:
        done = subprocess.run(["tar", "-x", "-C", part], stdin=archive.stdout, check=False)
    if archive.returncode or done.returncode:
        import shutil

        shutil.rmtree(part)
        raise SetupError(f"the revision {revision[:12]} of {top} cannot be read")
    part.rename(folder)


def _git(folder: Path, *words: str) -> str:
    """The output of git; "" if it fails or is not installed."""
    try:
        done = subprocess.run([*GIT, "-C", str(folder), *words], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _by_launcher(tree: Path, mission: Path, campaign: str | None, runs: int, seed: int, folder: Path,
                 threads: int | None) -> Results:
    """Have another tree build and fly the campaign."""
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "FLEDGE_PROJECT")}
    launcher = [str(tree / "fledge")] if (tree / "fledge").is_file() else [str(ROOT / "fledge"), "--project", str(tree)]
    revision = tree.name.removeprefix(REVISION)
    if revision != tree.name and (tree / "fledge").is_file() and not _differ(str(ROOT), revision, [
            f":(exclude){path}" for path in ("missions", *(f"{folder}/**.py" for folder in PYTHON), *BESIDE)]):
        # Nothing that is compiled differs: its Python takes the extension of this build.
        launcher = [sys.executable, "-P", str(tree / "python/fledge/cli/__main__.py")]
        environment["PYTHONPATH"] = os.pathsep.join(map(str, (tree / "python", tree, build_folder() / "python")))
    words = [*launcher, "montecarlo", str(mission), *(["--campaign", campaign] if campaign else []),
             "--runs", str(runs), "--seed", str(seed), *(["--jobs", str(threads)] if threads else []), "--out",
             str(folder.resolve())]
    done = subprocess.run(words, env=environment, stdout=subprocess.DEVNULL, stderr=sys.stderr, check=False)
    if done.returncode not in (0, 1):
        raise Failure(f"versions: {' '.join(words)} ended with {done.returncode}", 1)
    sources = {"fledge": revision if revision != tree.name else str(tree)}
    (folder / SOURCES).write_text(json.dumps(sources) + "\n", encoding="utf-8")
    return Results(folder)
