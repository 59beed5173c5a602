# SPDX-License-Identifier: Apache-2.0
"""C to programs, by ninja, which compiles only files whose contents have changed."""
from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from fledge.contents import by_contents
from fledge.errors import Failure
from fledge.disk import ROOT, build_folder, write_files
from fledge.programs import without_preload

TYPE_CHECKING = False   # of `typing`, whose import would delay every command
if TYPE_CHECKING:
    from fledge.export.read import Mission

# The same bits on every machine: no contraction, no errno. Small: no tables to unwind a stack that C never unwinds.
FLAGS = ["-std=c99", "-Os", "-pedantic", "-Wall", "-Wextra", "-ffp-contract=off", "-fno-math-errno",
         "-ffunction-sections", "-fdata-sections", "-fno-asynchronous-unwind-tables", "-DMCAP_CRC_TABLES=1",
         "-DFILE_SINK_PATH_MAX=256"]

# C of others, in which gcc 14 takes some warnings for errors.
OF_OTHERS = ["-w", "-Wno-error=implicit-function-declaration", "-Wno-error=int-conversion",
             "-Wno-error=incompatible-pointer-types"]

# Folders whose sources are compiled once for all programs, without the options -D and -I of one of them. A source is
# compiled for a program alone if it, or a header that it includes, has a name that the program defines.
SHARED = ("ccsds", "flight", "record", "registers")
AROUND = ("fmi/fmu", "targets", "targets/cfs", "targets/linux")     # without the folders in them

COMMAND = ["flight/command/command.c", "flight/command/rules.c", "flight/telemetry/telemetry.c"]
TABLES = ["targets/mission_packets.c", "registers/lane.c", "registers/field.c"]    # what a mission's tables refer to


def math_sources() -> list[Path]:
    """The sources of flight/math, which modules call."""
    return _flying("flight/math/*.c")


def flight_sources() -> list[Path]:
    """All C that flies, of every module, with the protocols and the store of files in memory."""
    return [*_flying("flight/*/*.c"), *_flying("ccsds/*.c"), ROOT / "ccsds/store/memory_store.c"]


def _flying(pattern: str) -> list[Path]:
    """Without the program of the hashes and the drivers of proofs."""
    return sorted(path for path in ROOT.glob(pattern)
                  if path.name != "elementary_hash.c" and not path.stem.endswith("_proof"))


def module_sources(mission: Mission, roots: Sequence[Path]) -> list[Path]:
    """The files of a mission's modules, in the first root that has each."""
    paths = []
    for name in mission.sources(roots):
        path = next((root / name for root in roots if (root / name).is_file()), None)
        if path is None:
            raise Failure(f"{mission.title}: the source {name} is in none of {', '.join(map(str, roots))}")
        paths.append(path)
    return paths


def program(folder: Path | str, name: str, sources: Sequence[Path], includes: Sequence[Path], compiler: str = "gcc",
            flags: Sequence[str] = (), link: Sequence[str | Path] = (), entry: str = "main",
            machine: Sequence[str] = (), archives: Sequence[Path] = ()) -> Path:
    """Build an executable or shared object from C in a folder of its own; returns its path.

    NAME.o beside it is the same without the C library, for `sizes`; NAME.map is what the linker took. link: words; a
    Path is a file on which the program depends. machine: flags that select the compiler's machine. archives: libraries
    that are part of the program, not of the system.
    """
    folder = Path(folder)
    if not shutil.which(compiler):
        raise Failure(f"{compiler} is not installed")
    flags = [*FLAGS, *machine, *flags]
    compiled = f"{compiler} {_words(machine)}"
    shared = shared_objects(folder, sources, compiler, flags)
    objects: list[str] = []
    lines: list[str] = []
    for source in sources:
        if source in shared:
            objects.append(_escaped(shared[source]))
            continue
        stem = f"o/{len(objects):02}_{Path(source).stem}.o"
        objects.append(stem)
        lines.append(f"build {stem}: cc {_escaped(source)}")
    whole = f"{name}.o"
    own = list(map(_escaped, archives))
    linked = [*objects, *own, *(["|"] if link else []), *(_escaped(path) for path in link if isinstance(path, Path))]
    text = "\n".join([
        "builddir = .", *_rule(compiler, [*flags, *(f"-I{path}" for path in includes)]),
        "rule link", f"  command = {compiled} $in {_words(link)} -Wl,--gc-sections,-Map=$out.map -o $out",
        "  description = linking $out",
        "rule whole", f"  command = {compiled} -r -nostdlib -Wl,--gc-sections -Wl,-e,{entry} $in -o $out",
        "  description = measuring $out", *lines, f"build {_escaped(name)}: link {' '.join(linked)}",
        f"build {_escaped(whole)}: whole {' '.join([*objects, *own])}",
        f"default {_escaped(name)} {_escaped(whole)}", ""])
    write_files({"build.ninja": text}, folder)
    run_ninja(folder, name)
    return folder / name


def shared_objects(folder: Path, sources: Sequence[Path], compiler: str, flags: Sequence[str]) -> dict[Path, Path]:
    """Compile those of the sources that are the same for all missions; returns the object of each.

    The objects lie in the build's folder, one folder for each compiler with its flags, so that each program finds what
    others have compiled; an installed Fledge keeps them in the program's folder.
    """
    import hashlib
    import re

    own = [flag for flag in flags if flag.startswith(("-D", "-I")) and flag not in FLAGS]
    named = set(re.findall(r"-D(\w+)", " ".join(own)))
    known = {ROOT / path: path for folder in SHARED for path in sorted(
        path.relative_to(ROOT) for path in (ROOT / folder).rglob("*.c") if "testing" not in path.parts)}
    known |= {path: path.relative_to(ROOT) for folder in AROUND for path in sorted((ROOT / folder).glob("*.c"))}

    @cache
    def read(path: Path) -> tuple[bool, list[Path]]:
        """Whether a file has one of the names, and what it includes."""
        text = path.read_text("utf-8") if path.is_file() else ""
        return not named.isdisjoint(re.findall(r"\w+", text)), [
            place / name for name in re.findall('^#include "(.+)"', text, re.M) for place in (path.parent, ROOT)]

    def changes(source: Path) -> bool:
        todo, seen = [source], {source}
        while named and todo:
            has_one, included = read(todo.pop())
            if has_one:
                return True
            todo += set(included) - seen
            seen.update(included)
        return False

    objects = {source: known[Path(source)].with_suffix(".o") for source in sources
               if Path(source) in known and not changes(Path(source))}
    if not objects or "-include" in flags:      # each object depends on that file, which is the program's
        return {}
    rule = _rule(compiler, [*(flag for flag in flags if flag not in own), f"-I{ROOT}"])
    place = build_folder() if (ROOT / "CMakeLists.txt").exists() and os.access(build_folder(), os.W_OK) else folder
    place = place / "objects" / hashlib.sha256("".join(rule).encode()).hexdigest()[:16]
    builds = (f"build {path.with_suffix('.o')}: cc {_escaped(source)}" for source, path in known.items())
    text = "\n".join(["builddir = .", *rule, *builds, ""])
    place.mkdir(parents=True, exist_ok=True)
    with (place / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)    # Ninja expects to be alone
        write_files({"build.ninja": text}, place)
        run_ninja(place, "objects", list(map(str, objects.values())))
    return {source: (place / path).resolve() for source, path in objects.items()}


def run_ninja(folder: Path, output: str, targets: Sequence[str] = ()) -> None:
    """Build folder / output as folder / "build.ninja" says: all of it, or some targets. Raises Failure with the words
    of the compiler."""
    # ccache finds in one folder what was compiled in another, for it sees paths from the folder above.
    environment = {"CCACHE_BASEDIR": str(folder.resolve().parent), **without_preload(os.environ)}
    with by_contents(folder):
        done = subprocess.run(["ninja", "-C", folder, *targets], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              text=True, errors="replace", env=environment)
    if done.returncode:
        failed = done.stdout.partition("FAILED:")[2] or done.stdout
        raise Failure(f"{folder / output} cannot be built:\n{failed.strip()}", 1)


def sizes(built: Path, tool: str = "size") -> tuple[int, int]:
    """(bytes of code and constants, bytes of memory) of what `program` built, without the C library."""
    done = subprocess.run([tool, f"{built}.o"], capture_output=True, text=True, check=True)
    text, data, bss = map(int, done.stdout.splitlines()[1].split()[:3])
    return text, data + bss


@contextmanager
def once(name: str, recipe: str, what: str) -> Iterator[tuple[Path, bool]]:
    """(the folder of what is built once for all missions, whether it must be built now by this recipe): build/NAME, or,
    where this user may not write there and it is not built, ~/.cache/fledge/NAME. Others wait meanwhile; once it is
    whole, the folder has its stamp. `what` is printed when it is built."""
    ours = build_folder().parent
    others = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fledge"
    places = [*([ours / name] if ours.name == "build" else []), others / name]

    def is_built(folder: Path) -> bool:
        stamp = folder / "stamp"
        return stamp.is_file() and stamp.read_text(encoding="utf-8") == recipe

    for folder in places:
        if is_built(folder):
            yield folder, False
            return
    folder = places[0] if len(places) > 1 and os.access(ours, os.W_OK) else others / name
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        missing = not is_built(folder)
        if missing:
            (folder / "stamp").unlink(missing_ok=True)
            print(f"fledge: building {what}, once", file=sys.stderr)
        yield folder, missing
        if missing:
            write_files({"stamp": recipe}, folder)


def native(name: str, part: str) -> Path:
    """A program of Fledge's own build: native("fledge_guard", "cosim")."""
    path = build_folder() / part / name
    if not os.access(path, os.X_OK):
        raise Failure(f"{path} is not built; ./fledge setup builds it")
    return path


def _rule(compiler: str, flags: Iterable[object]) -> list[str]:
    """The lines of ninja's rule that compiles."""
    cached = "ccache " if shutil.which("ccache") else ""
    return ["rule cc", f"  command = {cached}{compiler} {_words(flags)} -MMD -MF $out.d -c $in -o $out",
            "  depfile = $out.d", "  deps = gcc", "  description = compiling $in"]


def _escaped(path: object) -> str:
    """A path as ninja reads it."""
    return str(path).replace("$", "$$").replace(" ", "$ ").replace(":", "$:")


def _words(words: Iterable[object]) -> str:
    """Words of a command as the shell reads them, in a line that ninja reads."""
    import shlex

    return shlex.join(map(str, words)).replace("$", "$$")
