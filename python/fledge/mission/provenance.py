# SPDX-License-Identifier: Apache-2.0
"""What a run began with, for its record and its report: the instances, their parameters and wires, and the revisions
of Fledge and of the mission's files."""
from __future__ import annotations

import hashlib
import json
import subprocess
import tomllib
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge import __version__, objects
from fledge.disk import sources
from fledge.errors import SetupError
from fledge.objects import project

if TYPE_CHECKING:
    from fledge.mission.simulation import Simulation

ROOT = Path(__file__).resolve().parents[3]      # of the checkout; that of an installed tree has no .git
GIT = ["git", "--no-optional-locks", "-c", "core.fsmonitor=false"]  # reads only, and starts no other program


# --- instances, wires, parameters ------------------------------------------------------------------

def instances(processes: Any) -> dict[str, str]:
    """The types of all instances: "flight.control" -> "MrpFeedback"."""
    return {objects.path(instance): objects.struct(instance).name for process in processes for instance in process}


def wires(simulation: Simulation) -> dict[str, str]:
    """The wires from their ends: "flight.control.error" -> "flight.tracking.error"; of several into an input, as
    "flight.a.error (newest), flight.b.error (newest)"."""
    sources: dict[str, str] = {}
    for source, target, _, _, choice in simulation.wires:
        before = f"{sources[target]}, " if target in sources else ""
        sources[target] = before + source + (f" ({choice})" if choice else "")
    return sources


def parameters(processes: Any) -> dict[str, str]:
    """The parameters of all instances now: "flight.control.K" -> "2.531 N m", numbers and lists as JSON writes them."""
    values = {}
    for instance in (member for process in processes for member in process):
        for field in objects.struct(instance).fields:
            if field.group == "par" and not field.spare:
                for name, owner, member in members(instance, field):
                    unit = "" if member.unit in ("", "-") else f" {member.unit}"
                    values[f"{objects.path(instance)}.{name}"] = json.dumps(plain(owner, member)) + unit
        for name, prop in added(instance):
            values[f"{objects.path(instance)}.{name}"] = json.dumps(in_words(instance, name), ensure_ascii=False)
    return values


def members(owner: Any, field: Any) -> Iterator[tuple[str, Any, Any]]:
    """(name, its owner, Field) of a field that is no struct, or else of the fields of that: "wheels[2].u_max"."""
    if field.type != "struct":
        yield field.name, owner, field
        return
    value = getattr(owner, field.name)
    for i, message in enumerate(value if isinstance(value, tuple) else [value]):
        start = f"{field.name}[{i}]" if isinstance(value, tuple) else field.name
        for member in objects.struct(message).fields:
            if not member.spare:
                for name, inner, leaf in members(message, member):
                    yield f"{start}.{name}", inner, leaf


def plain(owner: Any, field: Any) -> Any:
    """A field as a number, a list, or a text: the name of an enumerator."""
    value = getattr(owner, field.name)
    return value.tolist() if hasattr(value, "tolist") else getattr(value, "name", value)


def added(instance: Any) -> list[tuple[str, property]]:
    """The properties that Python adds to a model: its parts, the bodies that attract it, its orbit."""
    return [(name, prop) for name, prop in vars(type(instance)).items() if isinstance(prop, property)]


def in_words(instance: Any, name: str) -> str:
    """What such a property holds, in words. "" for nothing."""
    try:
        content = getattr(instance, name)
    except (SetupError, AttributeError):
        return ""
    return "; ".join(objects.path(value) if isinstance(value, objects.Model) else value if isinstance(value, str)
                     else repr(value).strip("<>")
                     for value in (content if isinstance(content, (list, tuple)) else [content]) if value is not None)


# --- revisions -------------------------------------------------------------------------------------

class Revisions:
    """The revisions of Fledge and of a mission's files, as git finds them now, while the program goes on.

    mission: the folder of the mission, or None.
    """

    def __init__(self, mission: Path | None) -> None:
        self._running = {"fledge": _status(ROOT)} if (ROOT / ".git").exists() else {}
        if mission and not (self._running and mission.is_relative_to(ROOT)):
            own = project.folder()
            self._running["mission"] = _status(own if own and mission.is_relative_to(own) else mission)

    def read(self) -> dict[str, str]:
        """What is known: "fledge" and, if it is elsewhere, "mission" -> "1098750e70ef", with "-dirty" if there are
        files that are not of that revision."""
        return {name: text for name, running in self._running.items() if running and (text := _revision(running))}


def _status(folder: Path) -> subprocess.Popen[bytes] | None:
    # Records and builds are no sources of a run.
    paths = [".", ":(exclude)runs", ":(exclude)verification", ":(exclude)build", ":(exclude,glob)**/__pycache__/**"]
    try:
        return subprocess.Popen([*GIT, "-C", str(folder), "status", "--porcelain=v2", "--branch",
                                 "--untracked-files=normal", "--", *paths], stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True)
    except OSError:     # no git
        return None


def _revision(running: subprocess.Popen[bytes]) -> str:
    try:
        lines = running.communicate(timeout=10)[0].decode(errors="replace").splitlines()
    except subprocess.TimeoutExpired:
        running.kill()
        running.communicate()
        return ""
    commit = next((line.split()[2] for line in lines if line.startswith("# branch.oid ")), "(initial)")
    if running.returncode or commit == "(initial)":
        return ""
    return commit[:12] + "-dirty" * any(not line.startswith("#") for line in lines)


@cache
def compare_with_project(folder: Path) -> None:
    """Warn, once, where another Fledge runs than the project's pyproject.toml names in [tool.fledge]: by `version`, or
    by `revision`, of which 12 digits count."""
    file = folder / "pyproject.toml"
    try:
        text = file.read_text(encoding="utf-8") if file.is_file() else ""
        tool = tomllib.loads(text).get("tool", {})
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SetupError(f"{file}: {error}") from None
    named = tool.get("fledge", {}) if isinstance(tool, dict) else {}
    if not isinstance(named, dict):
        raise SetupError(f"{file}: expected a table [tool.fledge] with version and revision; found {named!r}")
    if other := named.keys() - {"version", "revision"}:
        raise SetupError(f"{file}: [tool.fledge] has version and revision; found {', '.join(sorted(other))}")
    for name, wanted in named.items():
        found = __version__ if name == "version" else Revisions(None).read().get("fledge", "")
        if not (found == wanted if name == "version" else found and found.startswith(str(wanted)[:12])):
            line = next((i for i, line in enumerate(text.splitlines(), 1) if "tool.fledge" in line), 1)
            warnings.warn_explicit(f"this project names the {name} {wanted} of Fledge, and {found or 'an unknown one'} "
                                   f"runs: take that, or name this here", UserWarning, str(file), line)


def extension() -> Path:
    """The file of the extension `_core`, as it is built here."""
    from fledge import _core

    return Path(_core.__file__)


def identity(mission: Path) -> dict[str, str]:
    """What tells whether another program computes the same: the revisions of Fledge and of a mission's folder.

    Where git knows none, or files differ from it, a digest stands for them: of the mission's Python files, or of
    Fledge's and the extension `_core`, as it is built here.
    """
    revisions = Revisions(mission).read()
    if mission.is_relative_to(ROOT):
        revisions.setdefault("mission", revisions.get("fledge", ""))
    for name in ("fledge", "mission"):
        text = revisions.get(name, "")
        if not text or text.endswith("-dirty"):
            revisions[name] = f"{text or __version__} with files {digest(name, mission)}"
    return revisions


def digest(name: str, mission: Path) -> str:
    """Twelve digits, of the Python files of "mission", or of those of "fledge" and the extension `_core`."""
    own = name == "fledge"
    files = [file for file in sources() if file.suffix == ".py"] + [extension()] if own else [*mission.rglob("*.py")]
    parts = sorted(file.name.encode() + hashlib.sha256(file.read_bytes()).digest() for file in files)
    return hashlib.sha256(b"".join(parts)).hexdigest()[:12]
