# SPDX-License-Identifier: Apache-2.0
"""Which small changes of the code no test notices.

    ./fledge bench mutants --seed 1 --count 100 record
    ./fledge bench mutants --seed 1 --count 100 record --list       only show what would be changed

draws changes of one operator, constant, condition, returned value or statement (bench/mutation.py) in the folder's C,
C++ and Python, and makes one at a time in a copy of the tree with a build folder of its own. For each, it builds what
depends on the changed file and runs the tests that can see it, nearest first, until one fails:

- of C and C++: the test programs that contain an object of the file, then the tests in Python of its folder and those
  in `SEEN_FROM_PYTHON`, which go through the extension and the programs;
- of Python: the tests of its folder, the test files that import its module, and those in `SEEN_FROM_PYTHON`.

A test that exceeds its time limit notices the change, too. Changes that do not compile, and those that leave every
object the same, are drawn anew and counted by themselves. The seed and the tree determine which changes are drawn.

The tests take the files of FLEDGE_TEST_DATA; default: ../shared/data of this tree.
"""
from __future__ import annotations
import argparse
import ast
import hashlib
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path, PurePath
from types import CodeType
from typing import NamedTuple

from fledge.columns import columns
from fledge.errors import Failure

from bench import mutation

ROOT = Path(__file__).resolve().parents[1]
ENDINGS = {".c", ".cpp", ".h", ".py"}
NOT_PRODUCT = {"testing", "oracle", "templates", "testing.py", "conftest.py", "elementary_hash.c"}
EVERYTHING = ["all", "tests"]               # what ninja builds
BUILD_LIMIT = 1800.0                        # [s]
FIRST_LIMIT = 300.0                         # [s] of a test that has not passed yet; later 5 times its time, and
LEAST_LIMIT = 20.0                          # [s]
MEMORY = 6 << 30                            # of each test; a changed loop may ask for all there is

# Folder -> tests in Python that fly its code through the extension and the programs. Longest folder first counts.
SEEN_FROM_PYTHON = {
    "flight": ["python/fledge/mission", "missions/nadir_spin"],
    "flight/exec": ["python/fledge/mission", "python/fledge/export/run_test.py"],
    "record": ["python/fledge/archive"],
    "sim": ["python/fledge/mission", "python/fledge/archive", "python/fledge/objects", "studies/montecarlo",
            "missions/nadir_spin", "python/fledge/errors_test.py", "python/fledge/targets/reset_test.py"],
    "world": ["python/fledge/world", "missions/nadir_spin", "missions/flyby", "missions/two_body_pointing"],
    "cosim": ["cosim/python", "tests/cosim_nodes_test.py", "tests/cosim_missions_test.py"],
    "fmi": ["fmi", "python/fledge/world"],
    "registers": ["python/fledge/export/board_test.py"],
    "introspect": ["python/fledge/objects"],
    "targets": ["python/fledge/targets", "python/fledge/export"],
    "targets/cfs": ["targets/cfs"],
    "python/fledge/core": ["python/fledge"],
    "python/fledge/cli": ["python/fledge/errors_test.py", "python/fledge/archive", "studies/montecarlo",
                          "python/fledge/mission", "python/fledge/targets/fly_test.py"],
    "python/fledge": ["python/fledge/errors_test.py", "python/fledge/library_test.py", "missions/nadir_spin"],
}


class Mutant(NamedTuple):
    """A change of one file."""

    file: str
    change: mutation.Change
    text: str           # of the file before

    def changed(self) -> str:
        return mutation.applied(self.text, self.change)

    def line(self) -> int:
        return self.text.count("\n", 0, self.change.start) + 1

    def lines(self) -> tuple[str, str]:
        """What stands there before and after, in lines of their own, shortened."""
        begin = self.text.rfind("\n", 0, self.change.start) + 1
        end = self.text.find("\n", self.change.stop)
        before = self.text[begin:end]
        after = self.text[begin:self.change.start] + self.change.after + self.text[self.change.stop:end]
        return " ".join(before.split()), " ".join(after.split())


class Test(NamedTuple):
    """A program or file of tests."""

    name: str
    command: list[str]
    folder: str                     # of its source, relative to the tree
    cwd: Path
    target: str | None              # what ninja builds for it; None: everything

    def needs(self) -> list[str]:
        return [self.target] if self.target else EVERYTHING

    def is_near(self, file: str) -> bool:
        """Whether it stands in the folder of a Python file, or is a program in the top folder of another file."""
        if file.endswith(".py"):
            return is_inside(file, self.folder)
        return bool(self.target) and self.folder.split(os.sep)[0] == file.split(os.sep)[0]


# --- drawing ---------------------------------------------------------------------------------------

def is_product(path: PurePath) -> bool:
    return (path.suffix in ENDINGS and not path.stem.endswith(("_test", "_fuzz", "_proof"))
            and not NOT_PRODUCT.intersection(path.parts))


def files_of(root: Path) -> list[str]:
    """What belongs to the tree: all that git does not ignore, also what is not committed."""
    listed = subprocess.run(["git", "-C", str(root), "ls-files", "-z", "-c", "-o", "--exclude-standard"], check=True,
                            capture_output=True, text=True).stdout
    return sorted({name for name in filter(None, listed.split("\0"))
                   if (root / name).is_file() or (root / name).is_symlink()})


def mutants_of(root: Path, names: list[str], folders: list[str]) -> list[Mutant]:
    """All changes of the folders' files."""
    found: list[Mutant] = []
    for name in names:
        if is_product(PurePath(name)) and any(is_inside(name, folder) for folder in folders):
            text = (root / name).read_text(encoding="utf-8")
            found += [Mutant(name, change, text) for change in mutation.changes(name, text)]
    return found


def drawn(mutants: list[Mutant], seed: int) -> list[Mutant]:
    """One change of each place, in an order that the seed determines."""
    order = mutants.copy()
    random.Random(seed).shuffle(order)
    return list({(m.file, m.change.start): m for m in reversed(order)}.values())[::-1]


def is_inside(name: str, folder: str) -> bool:
    return PurePath(os.path.normpath(folder)) in (PurePath(name), *PurePath(name).parents)


# --- a copy of the tree ----------------------------------------------------------------------------

class Tree:
    """A copy of the tree, built. Files that did not change keep their time, so that a later campaign builds little."""

    def __init__(self, folder: Path) -> None:
        self.root, self.build = folder, folder / "build/release"
        self.environment = {
            **os.environ, "FLEDGE_PRESET": "release", "FLEDGE_PROJECT": "", "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONPATH": os.pathsep.join(map(str, (folder / "python", folder, self.build / "python"))),
            "FLEDGE_TEST_DATA": os.environ.get("FLEDGE_TEST_DATA", str(ROOT.parent / "shared/data")),
            "GTEST_FAIL_FAST": "1",
        }
        self.environment.pop("LD_PRELOAD", None)    # a sanitizer's library would need more memory than the limit

    def copy(self, source: Path, names: list[str]) -> None:
        for name in names:
            if (source / name).is_symlink():
                (self.root / name).parent.mkdir(parents=True, exist_ok=True)
                (self.root / name).unlink(missing_ok=True)
                (self.root / name).symlink_to(os.readlink(source / name))
            else:
                put(self.root / name, (source / name).read_bytes(), (source / name).stat().st_mode)
        for path in list(self.root.rglob("*")):
            name = str(path.relative_to(self.root))
            if path.is_file() and not is_inside(name, "build") and name not in names:
                path.unlink()
        self.files = names

    def configure(self) -> None:
        done = self.run(["cmake", "--preset", "release", "-DBUILD_TESTING=ON"], BUILD_LIMIT)
        if done.returncode:
            raise Failure(f"mutants: the copy in {self.root} cannot be configured:\n{done.stdout[-2000:]}", 1)

    def make(self, targets: list[str]) -> None:
        """Build what must build: nothing is changed."""
        if not self.ninja(targets):
            raise Failure(f"mutants: the copy of the tree does not build; ninja -C {self.build} shows why", 1)

    def ninja(self, targets: list[str]) -> bool:
        return self.run(["ninja", "-C", str(self.build), *targets], BUILD_LIMIT).returncode == 0

    def run(self, command: list[str], limit: float, cwd: Path | None = None) -> subprocess.CompletedProcess:
        """Run a command in a session of its own, whose processes end with it. Raises subprocess.TimeoutExpired."""
        with tempfile.TemporaryFile() as out, subprocess.Popen(
                command, cwd=cwd or self.root, env=self.environment, stdin=subprocess.DEVNULL, stdout=out,
                stderr=subprocess.STDOUT, start_new_session=True,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))) as process:
            try:
                process.wait(limit)
            finally:
                try:
                    os.killpg(process.pid, signal.SIGKILL)
                except ProcessLookupError:
                    pass
                process.wait()
            out.seek(0)
            return subprocess.CompletedProcess(command, process.returncode, out.read().decode(errors="replace"))

    # -- what depends on what

    def objects(self) -> dict[str, list[str]]:
        """File of the tree -> the objects that were compiled from it."""
        listed = subprocess.run(["ninja", "-C", str(self.build), "-t", "deps"], check=True, capture_output=True,
                                text=True).stdout
        found: dict[str, list[str]] = {}
        object_ = ""
        for line in listed.splitlines():
            if line and not line[0].isspace():
                object_ = line.partition(": #deps")[0]
            elif line.strip() and object_.endswith(".o"):
                path = Path(os.path.normpath(self.build / line.strip()))
                if path.is_relative_to(self.root):
                    found.setdefault(str(path.relative_to(self.root)), []).append(object_)
        return found

    def programs(self) -> list[Test]:
        """The tests that ctest knows; those of a program of GoogleTest are one."""
        listed = subprocess.run(["ctest", "--test-dir", str(self.build), "--show-only=json-v1"], check=True,
                                capture_output=True, text=True).stdout
        found: dict[str, Test] = {}
        for test in json.loads(listed)["tests"]:
            command = test.get("command", [])
            cwd = next((Path(p["value"]) for p in test.get("properties", []) if p["name"] == "WORKING_DIRECTORY"),
                       self.build)
            base = self.build if cwd.is_relative_to(self.build) else self.root
            folder = str(cwd.relative_to(base)) if cwd.is_relative_to(base) else ""
            if any(p["name"] == "LABELS" and "gtest" in p["value"] for p in test.get("properties", [])):
                program = str(Path(command[0]).relative_to(self.build))
                found[program] = Test(program, [command[0], "--gtest_brief=1"], folder, cwd, program)
            elif command:
                found[test["name"]] = Test(test["name"], command, folder, cwd, None)
        return list(found.values())

    def symbols(self, file: str, kinds: str) -> frozenset[str]:
        """The functions and variables that an object or program defines."""
        listed = subprocess.run(["nm", "--defined-only", "--format=posix", str(self.build / file)], check=True,
                                capture_output=True, text=True).stdout
        words = (line.split() for line in listed.splitlines())
        return frozenset(w[0] for w in words if len(w) > 1 and w[1] in kinds) - {"main"}

    def code(self, objects: list[str]) -> str:
        """A hash of objects without what debuggers need."""
        total = hashlib.sha256()
        with tempfile.TemporaryDirectory() as folder:
            for name in objects:
                bare = Path(folder) / "bare.o"
                subprocess.run(["objcopy", "--strip-debug", str(self.build / name), str(bare)], check=True)
                total.update(bare.read_bytes())
        return total.hexdigest()


def put(path: Path, data: bytes, mode: int = 0o644) -> None:
    """Write a file, unless it holds that already."""
    if not (path.is_file() and path.read_bytes() == data):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    path.chmod(mode)


# --- which tests can see a file --------------------------------------------------------------------

class Sight:
    """Which tests can see a change of a file."""

    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        self.objects = tree.objects()
        self.programs = tree.programs()
        self._symbols = {t.name: tree.symbols(t.target, "TDBRtdbr") for t in self.programs if t.target}
        tests = [PurePath(name) for name in tree.files if name.endswith("_test.py") and "templates" not in name]
        self._imports = {test: imported(tree.root / test) for test in tests}
        self._tests: dict[str, list[Test]] = {}

    def tests(self, file: str) -> list[Test]:
        """Nearest first."""
        if file not in self._tests:
            self._tests[file] = self._find(PurePath(file))
        return self._tests[file]

    def _find(self, path: PurePath) -> list[Test]:
        found: list[Test] = []
        if path.suffix != ".py":
            own = [self.tree.symbols(file, "TDBR") for file in self.objects.get(str(path), [])]
            for test in self.programs:
                symbols = self._symbols.get(test.name)
                if symbols is None:     # no program of GoogleTest: it belongs to its folder
                    seen = PurePath(test.folder) in path.parents
                else:
                    seen = any(names & symbols for names in own)
                if seen:
                    found.append(test)
            found.sort(key=lambda test: (-common(PurePath(test.folder), path), path.stem not in test.name, test.name))
        return found + [self._pytest(test) for test in self.in_python(path)]

    def in_python(self, path: PurePath) -> list[PurePath]:
        folders = {test.parent for test in self._imports}
        nearest = next((parent for parent in path.parents[:-1] if parent in folders), None)
        near = [test for test in self._imports if test.parent == nearest]
        near.sort(key=lambda test: (test.stem != f"{path.stem}_test", test))
        folder = max((f for f in SEEN_FROM_PYTHON if PurePath(f) in path.parents), key=len, default=None)
        further = [test for package in (SEEN_FROM_PYTHON[folder] if folder else []) for test in self._imports
                   if PurePath(package) == test or PurePath(package) in test.parents]
        place = re.sub(r"^(ground|cosim|emulator|fmi)/(python/)?", r"fledge/\1/", str(path.with_suffix("")))
        place = re.sub("^studies/", "fledge/", place).removeprefix("python/")
        module = place.replace("/", ".").removesuffix(".__init__")
        users = [test for test, names in self._imports.items() if path.suffix == ".py" and module in names]
        return list(dict.fromkeys([*near, *users, *further]))

    def _pytest(self, test: PurePath) -> Test:
        return Test(str(test), [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", str(test)],
                    str(test.parent), self.tree.root, None)


def common(first: PurePath, second: PurePath) -> int:
    return len([a for a, b in zip(first.parts, second.parts) if a == b])


def imported(file: Path) -> set[str]:
    """The modules that a file imports, and the names that it takes from them, which may be modules."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.update([node.module, *(f"{node.module}.{name.name}" for name in node.names)])
    return names


# --- a campaign ------------------------------------------------------------------------------------

TESTED = ("killed", "killed by time", "survived")
KINDS = (*TESTED, "not compiled", "equivalent")


class Campaign:
    """Makes the changes one after the other."""

    def __init__(self, tree: Tree, near: bool) -> None:
        self.tree, self.sight, self.near = tree, Sight(tree), near
        self._code: dict[str, str] = {}         # file -> its objects without a change
        self._seconds: dict[str, float] = {}    # test -> how long it takes to pass
        self._sound: set[str] = set()           # tests that pass without a change
        self.left_out: set[str] = set()         # and those that do not

    def outcome(self, mutant: Mutant) -> tuple[str, str]:
        """One of KINDS, and the test that noticed it."""
        if mutant.file not in self._code:
            objects = self._objects(mutant.file)
            if objects:
                self.tree.make(objects)
            self._code[mutant.file] = self.tree.code(objects)
        try:
            self._write(mutant, mutant.changed())
            return self._refused(mutant) or self._noticed(mutant)
        finally:
            self._write(mutant, mutant.text)

    def _objects(self, file: str) -> list[str]:
        objects = self.sight.objects.get(file, [])
        return [name for name in objects if not self.near or name.split(os.sep)[0] == file.split(os.sep)[0]]

    def _write(self, mutant: Mutant, text: str) -> None:
        (self.tree.root / mutant.file).write_text(text, encoding="utf-8")

    def _refused(self, mutant: Mutant) -> tuple[str, str] | None:
        """Why there is nothing to test."""
        if mutant.file.endswith(".py"):
            try:
                after = compile(mutant.changed(), mutant.file, "exec")
            except SyntaxError:
                return "not compiled", ""
            return ("equivalent", "") if same_code(compile(mutant.text, mutant.file, "exec"), after) else None
        objects = self._objects(mutant.file)
        if not (self.tree.ninja(objects) if objects else self._compiles(mutant)):
            return "not compiled", ""
        return ("equivalent", "") if objects and self.tree.code(objects) == self._code[mutant.file] else None

    def _noticed(self, mutant: Mutant) -> tuple[str, str]:
        compiled = not mutant.file.endswith(".py")
        for test in self.sight.tests(mutant.file):
            if test.name in self.left_out or (self.near and not test.is_near(mutant.file)):
                continue
            if compiled and not self.tree.ninja(test.needs()):
                return "not compiled", ""
            kind = self._failure(test)
            if kind and self._is_sound(test, mutant, compiled):
                return kind, test.name
        return "survived", ""

    def _failure(self, test: Test) -> str:
        """Run a test; how it notices the change, or ""."""
        limit = LEAST_LIMIT + 5 * self._seconds[test.name] if test.name in self._seconds else FIRST_LIMIT
        begun = time.monotonic()
        try:
            if self.tree.run(test.command, limit, test.cwd).returncode not in PASSED:
                return "killed"
        except subprocess.TimeoutExpired:
            return "killed by time"
        self._seconds.setdefault(test.name, time.monotonic() - begun)
        return ""

    def _is_sound(self, test: Test, mutant: Mutant, compiled: bool) -> bool:
        """Whether a test that failed passes without the change; run once for each test."""
        if test.name not in self._sound:
            self._write(mutant, mutant.text)
            if compiled:
                self.tree.make(test.needs())
            (self.left_out if self._failure(test) else self._sound).add(test.name)
            self._write(mutant, mutant.changed())
        return test.name in self._sound

    def _compiles(self, mutant: Mutant) -> bool:
        """Of a file that the build does not compile: those of targets, which `fledge fly` compiles."""
        return self.tree.run(["gcc", "-std=c99", "-fsyntax-only", f"-I{self.tree.root}",
                              f"-I{self.tree.root / 'targets/cfs/inc'}", mutant.file], 60).returncode == 0


PASSED = (0, 5, 77)     # pytest found no test; a test of ctest skipped


def same_code(first: CodeType, second: CodeType) -> bool:
    """Whether two codes of Python differ in nothing but places."""
    return (first.co_code == second.co_code and first.co_names == second.co_names
            and len(first.co_consts) == len(second.co_consts)
            and all(same_code(a, b) if isinstance(a, CodeType) and isinstance(b, CodeType)
                    else (type(a), repr(a)) == (type(b), repr(b)) for a, b in zip(first.co_consts, second.co_consts)))


def shown(mutant: Mutant) -> str:
    before, after = mutant.lines()
    return f"{mutant.file}:{mutant.line()}\n    {before}\n    {after}"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="fledge bench mutants", description="Which small changes no test notices.",
                                     epilog="example: ./fledge bench mutants --seed 1 --count 20 record")
    parser.add_argument("folders", nargs="+", metavar="FOLDER", help="or a file, relative to the tree")
    parser.add_argument("--seed", type=int, default=1, help="default: %(default)s")
    parser.add_argument("--count", type=int, default=20, metavar="K", help="changes to test (default: %(default)s)")
    parser.add_argument("--list", action="store_true", help="only show the first K that are drawn")
    parser.add_argument("--near", action="store_true",
                        help="of Python only the tests beside the file, of others only the programs of its top folder")
    parser.add_argument("--again", metavar="FILE", help="only the survivors that a --json of before names")
    parser.add_argument("--at", type=Path, default=ROOT / "build/mutants", metavar="DIR",
                        help="where the copy of the tree is (default: build/mutants)")
    parser.add_argument("--json", metavar="FILE", help="write each change and its outcome, too")
    chosen = parser.parse_args(arguments)

    names = files_of(ROOT)
    order = mutants_of(ROOT, names, chosen.folders)
    if not order:
        raise Failure(f"mutants: there is nothing to change in {', '.join(chosen.folders)}")
    if chosen.again:
        before = json.loads(Path(chosen.again).read_text(encoding="utf-8"))
        survivors = {(r["file"], r["before"], r["after"]) for r in before if r["outcome"] == "survived"}
        order = [m for m in order if (m.file, *m.lines()) in survivors]
    else:
        order = drawn(order, chosen.seed)
    if chosen.list:
        print(*map(shown, order[:chosen.count]), sep="\n")
        return 0

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))    # what runs ends, too
    tree = Tree(chosen.at.resolve() / "tree")
    tree.copy(ROOT, names)
    tree.configure()
    tree.make(EVERYTHING)
    campaign = Campaign(tree, chosen.near)
    rows: list[dict] = []
    for mutant in order:
        rows.append(row(mutant, *campaign.outcome(mutant)))
        if rows[-1]["outcome"] == "survived":
            print(shown(mutant), flush=True)
        if chosen.json:
            Path(chosen.json).write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
        if sum(r["outcome"] in TESTED for r in rows) == chosen.count:
            break
    for name in sorted(campaign.left_out):
        print(f"left out: {name} fails without a change")
    print(*table(rows, chosen.folders), sep="\n")
    return 0


def row(mutant: Mutant, outcome: str, by: str) -> dict:
    before, after = mutant.lines()
    return {"file": mutant.file, "line": mutant.line(), "before": before, "after": after, "outcome": outcome, "by": by}


def table(rows: list[dict], folders: list[str]) -> list[str]:
    """How many of each outcome, for each folder."""
    lines = [("folder", "tested", *KINDS)]
    for folder in folders:
        of = [r["outcome"] for r in rows if is_inside(r["file"], folder)]
        lines.append((folder, str(sum(kind in TESTED for kind in of)), *(str(of.count(kind)) for kind in KINDS)))
    return list(columns(lines, set(range(1, len(KINDS) + 2))))
