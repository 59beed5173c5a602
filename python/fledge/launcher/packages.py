# SPDX-License-Identifier: Apache-2.0
"""Debian's packages: which a command needs, and those that are missing, installed.

A purpose is a section of cmake/packages.txt, with those of COMPOSED, or a part of the package or the folder of a
target, whose packages.txt has its packages. What a command needs besides what all need, `needs` of its parser, is a
list of

    a section, a part, or a target's name   its packages; of a target, those too of the targets that it uses
    "build PART"                            this part of Fledge's build
    "view", "try view"                      the 3-D view is built; "try": if there is Node

Names are those of SYSTEMS. Another system is refused until the user forces it.
"""
from __future__ import annotations

import os
import re
import time
import zlib
from collections.abc import Iterable
from pathlib import Path
from shutil import which

from fledge.errors import Failure
from fledge.disk import ROOT, keep, may_write
from fledge.launcher.context import Context
from fledge.launcher.tools import alone, failure, pass_on, run, say

PACKAGE = ROOT / "python/fledge"
STATUS = Path("/var/lib/dpkg/status")
OS_RELEASE = Path("/etc/os-release")
SYSTEMS = {"bookworm": "Debian 12", "trixie": "Debian 13", "noble": "Ubuntu 24.04"}    # by VERSION_CODENAME
COMPOSED = {"run": ("project", "build", "fly"),      # sections that are of another purpose, too
            "all": ("profile", "prove", "load", "ssh", "film", "decisions", "docs")}
BUILDING = ("project", "unit", "pytest", "docs")      # purposes for which an installed Fledge lacks packages


def listed(purpose: str) -> list[str]:
    """The packages of a purpose; of alternatives, "a | b"."""
    own_file = PACKAGE / purpose / "packages.txt"       # `purpose` may be the whole path of a target's folder
    if own_file.is_file():
        text = own_file.read_text(encoding="utf-8")
    else:
        text = (ROOT / "cmake/packages.txt").read_text(encoding="utf-8").partition(f"\n[{purpose}]\n")[2]
        text = text.partition("\n[")[0]
    own = re.findall(r"^[^#\s].*?(?=\s*(?:#|$))", text, re.M)
    return [line for section in COMPOSED.get(purpose, ()) for line in listed(section)] + own


def missing(purpose: str) -> list[str]:
    """What of a purpose no installed package is or provides."""
    import subprocess

    try:
        text = subprocess.run(["dpkg-query", "-W", "-f", "${db:Status-Status} ${Package}, ${Provides}\n"],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    except OSError:
        text = ""
    installed = {name.split(" ")[0] for line in text.splitlines() if line.startswith("installed ")
                 for name in line.removeprefix("installed ").split(", ")}
    return [line for line in listed(purpose) if not installed & set(line.split(" | "))]


def need(context: Context, purpose: str, if_possible: bool = False) -> None:
    """Install the missing packages of a purpose. An installed Fledge has what flies, and only says what building adds;
    Python says which of its packages it misses. if_possible: without those that this system does not have."""
    if context.installed:
        if purpose in BUILDING and which("apt-get") and (names := missing(purpose)):
            raise Failure(f"{context.command}: packages are missing; as root, run: apt-get install " +
                          " ".join(line.split(" | ")[0] for line in names), 1)
        return
    stamp = ROOT / f"build/packages-{Path(purpose).name}.stamp"
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == _checked(purpose):
        return
    name = _other_system()
    if name and purpose == "run" and not stamp.exists() and not context.force:
        raise Failure(f"this is {name}, and Fledge is made for {', '.join(SYSTEMS.values())}; {_lacks(purpose)}; to "
                      "try it here: ./fledge --force COMMAND", 1)
    if which("apt-get"):
        if (names := missing(purpose)) and not _install(purpose, names, if_possible or bool(name)):
            return      # without a stamp: the next command tries again
    else:
        say(f"this is {name}: {_lacks(purpose)}")
    keep(stamp, _checked(purpose))


def _other_system() -> str:
    """The name of a system that is none of SYSTEMS, nor made of one of them; of these, ""."""
    try:
        text = OS_RELEASE.read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    facts = dict(re.findall(r'^(\w+)="?([^"\n]*)"?$', text, re.M))
    known = {facts.get(f"{kind}_CODENAME") for kind in ("VERSION", "DEBIAN", "UBUNTU")} & SYSTEMS.keys()
    return "" if known and which("apt-get") else facts.get("PRETTY_NAME") or "an unknown system"


def _lacks(purpose: str) -> str:
    """What another system lacks, as far as it can be known without its package manager."""
    if which("apt-get"):
        names = missing(purpose) if _has_lists() else []
        had = _obtainable(names)
        never = [line for line in names if line not in had]
        return f"it has no {', '.join(never)}" if never else "no test was run here"
    lacks = [tool for tool in ("apt-get", "cmake", "ninja", "g++") if not which(tool)]
    return (f"it has no {', '.join(lacks)}; install by hand what is missing of: "
            + " ".join(line.replace(" ", "") for line in listed(purpose)))


def _has_lists() -> bool:
    """In a container apt's lists of packages may be missing."""
    return any(Path("/var/lib/apt/lists").glob("*_Packages*"))


def _obtainable(names: list[str]) -> list[str]:
    """Those of these packages that apt could install."""
    import subprocess

    if not names or subprocess.run(
            ["apt-get", "-s", "satisfy", "--no-install-recommends", ", ".join(names)], stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0:
        return names
    half = len(names) // 2
    return _obtainable(names[:half]) + _obtainable(names[half:]) if half else []


def _checked(purpose: str) -> str:
    """What a stamp holds: of the list, and of the state of dpkg. While both are the same, no package can be missing."""
    try:
        status = STATUS.stat()
        state = f"{status.st_dev} {status.st_ino} {status.st_size} {status.st_mtime_ns}"
    except OSError:
        state = ""
    return f"{zlib.crc32(chr(10).join(listed(purpose)).encode())}\n{state}\n"


def _install(purpose: str, names: list[str], if_possible: bool) -> bool:
    """Install what is missing, unless another launcher has done so meanwhile. if_possible: without what apt does not
    have, or cannot fetch. Returns False if it could not fetch some, which a later command may."""
    logs, name = ROOT / "build", Path(purpose).name

    def by_hand() -> str:
        return f"as root, run: apt-get satisfy --no-install-recommends '{', '.join(names)}'"

    as_root = [] if os.geteuid() == 0 else ["sudo"]
    if not may_write(logs) or as_root and not which("sudo"):
        if names := _obtainable(names) if if_possible else names:
            raise Failure(f"packages are missing; {by_hand()}", 1)
        return True
    with alone(logs / "packages.lock", "installs packages") as lock:
        names = missing(purpose)
        if not names:
            return True
        lacking: list[str] = []
        say(f"installing for '{name}': {', '.join(names)}")
        begun = time.monotonic()
        if as_root and pass_on(["sudo", "true"]):     # which may ask for a password
            raise Failure(f"without sudo, {by_hand()}", 1)
        as_root += ["env", "DEBIAN_FRONTEND=noninteractive"]
        apt_get = [*as_root, "apt-get", "-y", "-o", "DPkg::Lock::Timeout=120"]
        log, update, dpkg = logs / f"apt-{name}.log", logs / "apt-update.log", logs / "dpkg.log"

        def satisfy(names: list[str], *options: str) -> int:
            return run(log, [*apt_get, *options, "satisfy", "--no-install-recommends", ", ".join(names)], lock=lock)

        # Outdated lists make the install fail, and so does an install that was interrupted before.
        if not _has_lists() or satisfy(names):
            if log.exists() and "dpkg --configure -a" in log.read_text(encoding="utf-8", errors="replace"):
                say("completing an interrupted installation of packages")
                if status := run(dpkg, [*as_root, "dpkg", "--configure", "-a"], lock=lock):
                    raise failure(dpkg, "dpkg --configure -a", status)
            say("fetching apt's package lists")
            if status := run(update, [*apt_get, "update"], lock=lock):
                raise failure(update, "apt-get update", status)
            status = satisfy(names)
            if status and if_possible and len(had := _obtainable(names)) < len(names):
                say(f"this system has no {', '.join(line for line in names if line not in had)}; without it, "
                    "what needs it is skipped")
                names = had
                status = satisfy(names) if names else 0
            if status and if_possible:      # it knows all, and cannot fetch some
                once = "-o", "Acquire::Retries=0", "-o", "Acquire::http::Timeout=10"
                refusals = b""
                for line in names:
                    if satisfy([line], *once):
                        lacking.append(line)
                        refusals += log.read_bytes()
                status = 0
                if lacking:
                    log.write_bytes(refusals)
                    say(f"apt cannot install {', '.join(lacking)}; without it, what needs it is skipped; {log} says "
                        "why")
            if status:
                with open(log, "ab") as file:
                    file.write(update.read_bytes())     # apt-get update only warns of what fails
                raise failure(log, "apt-get satisfy", status)
        size = re.search("^Need to get (.*) of archives", log.read_text(encoding="utf-8", errors="replace"), re.M)
        say(f"installed ({size[1] if size else ''}) in {time.monotonic() - begun:.0f} s")
        return not lacking


# --- what a command needs --------------------------------------------------------------------------

def provide(context: Context, needs: Iterable[str], without: bool = False) -> list[str]:
    """Install the packages of what a command needs, expanded; returns the parts of the build, and "view". An installed
    Fledge has all parts. without: a target whose packages cannot be installed is left out."""
    if context.installed:
        return []
    others = []
    for purpose in needs:
        if purpose.startswith("build "):
            others.append(purpose.removeprefix("build "))
        elif purpose.endswith("view"):
            others.append(purpose)
        else:
            try:
                need(context, purpose)
            except Failure as error:
                if not without or not Path(purpose).is_absolute():
                    raise
                say(str(error))
                say(f"going on without {Path(purpose).name}")
    return others


def expanded(needs: Iterable[str]) -> list[str]:
    """The same with purposes and parts in the place of targets, each once."""
    from fledge.targets import TARGETS

    packages: list[str] = []
    for purpose in needs:
        used = TARGETS[purpose].with_used() if purpose in TARGETS else []
        folders = [TARGETS.folders[target.name] for target in used]
        packages += [str(folder) for folder in folders if (folder / "packages.txt").is_file()] if used else [purpose]
        packages += [f"build {part}" for target in used for part in target.parts]
    return list(dict.fromkeys(packages))
