# SPDX-License-Identifier: Apache-2.0
"""`fledge test`: the tests of Fledge or of a project, by ctest and pytest, and their counts."""
from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

from fledge.errors import Failure, did_you_mean
from fledge.disk import ROOT, may_write, write_files
from fledge.launcher import build
from fledge.launcher.context import Context
from fledge.launcher.packages import expanded, need, provide
from fledge.launcher.tools import alone, pass_on, run, say

# Lines of ctest that are left out.
PASSED = re.compile("Internal ctest|Test project|No tests were found| +Start +[0-9]+:|.* Passed +[0-9.]+ sec")


def need_tests(context: Context, every: bool) -> None:
    """Install the packages for tests; Fledge's own tests need more than a project's. every: what any of them needs, as
    a second compiler and those of all targets; else what the quick ones need."""
    from fledge.targets import TARGETS

    need(context, "pytest")
    if context.builds_project or not context.project:
        need(context, "unit")
    if not context.project:
        need(context, "test", if_possible=True)
        if every:
            need(context, "all", if_possible=True)
            provide(context, expanded(TARGETS), without=True)


def need_decisions(context: Context) -> None:
    """Install what counts decisions, and let what is built count them."""
    need(context, "decisions")
    context.observe("mcdc")


class Tests:
    """Those that the options ask for. Raises SystemExit where tests.changed refuses them, or nothing has changed."""

    def __init__(self, context: Context, options: argparse.Namespace) -> None:
        self.context, self.options = context, options
        self.seconds: dict[str, float] = {}     # of the parts of the run
        self.folders = [_folder(Path(name)) for name in options.folders]
        with self._counted("packages"):
            need(context, "run")
            need_tests(context, every=options.long != "none")
            if options.coverage:
                need_decisions(context)
        self.pattern = options.pattern      # names match; of alternatives, "a|b"
        self.long = "all" if options.pattern else options.long      # which of those that are marked long
        self.programs = "tests"             # targets of those of C and C++ that are built
        self.labels: list[str] = []         # the words by which ctest starts these programs alone
        self.cases: str | None = None       # of GoogleTest, its filter; None: as the pattern says
        self.paths: list[str] | None = None     # of Python; None: all
        self.folder = context.build
        if options.changed is not None:
            lines = self._tell("tests.changed", *[options.changed] * bool(options.changed)).splitlines()
            if not lines:
                sys.exit(0)
            self.programs, self.cases, paths = [*lines, "", ""][:3]
            self.paths = paths.split() or None
        elif options.since is not None:
            turn = ["--turn", options.turn] * bool(options.turn)
            self.programs, paths = [*self._tell("tests.changed", "--reach", *turn,
                                                options.since).splitlines(), "", ""][:2]
            self.cases, self.paths = "*", [] if options.compiled else paths.split()
        elif self.folders:
            in_python = {folder: {path.suffix == ".py" for path in _tests_in(folder)} for folder in self.folders}
            self.programs = " ".join(f"tests-{folder.replace('/', '-')}" for folder, kinds in in_python.items()
                                     if False in kinds)
            self.paths = [folder for folder, kinds in in_python.items() if True in kinds]
        if self.cases is not None and self.programs != "tests":
            self.labels = ["-L", f"^({self.programs.replace(' ', '|')})$"]

    def _tell(self, module: str, *words: str) -> str:
        """What a module of tests/, run as a program, prints; if it fails, exit with its code."""
        done = subprocess.run([sys.executable, "-P", "-m", module, *words], cwd=ROOT, stdout=subprocess.PIPE,
                              text=True, env={**os.environ, **self.context.names(), "PYTHONPATH": str(ROOT)})
        if done.returncode:
            sys.exit(done.returncode)
        return done.stdout

    @contextmanager
    def _counted(self, part: str) -> Iterator[None]:
        """Add the seconds of the block to this part of the run."""
        begun = time.monotonic()
        yield
        self.seconds[part] = self.seconds.get(part, 0.0) + time.monotonic() - begun

    def run(self) -> int:
        """Build and run them; prints the sum, and returns the exit code."""
        context, options = self.context, self.options
        kind = context.observed
        with self._counted("build"):
            everything = self.paths is None or any(map(_is_of_product, self.paths))
            programs = f"{self.programs} tests-in-python" if everything and self.programs != "tests" else self.programs
            self.folder = build.compile(context, [kind] if kind else ["all"] * everything, tests=True,
                                        programs=f"{kind}_tests" if kind else programs)
        if context.project:
            say(f"testing {context.project}")
        if not may_write(context.logs, self.folder):
            raise Failure(f"test: writes into {context.logs}, where this user may not", 1)
        if not context.project and not kind and everything:
            # The commands that tests start prepare what they fly on; tests of the targets themselves expect it.
            with self._counted("targets"):
                if self.paths is None or any(map(_flies_on_targets, self.paths)):
                    build.prepare(context)
                if options.long != "none":
                    build.need_node(context)
                build.view(context, if_possible=True)
        if options.build:
            return 0
        with alone(context.logs / f"{context.preset}-tests.lock", "runs these tests"):
            if kind:
                return self._observed()
            shutil.rmtree(self.folder / "tests", ignore_errors=True)
            return self._sum([sum(column) for column in zip(*self._compiled(), self._python())])

    def _sum(self, counts: list[int]) -> int:
        """Print what took how long, then the sum; returns the exit code."""
        if not sum(counts) and not self.options.since:
            say(f"no test matches '{self.pattern}'" if self.pattern else "no test was found")
            counts[1] = 1
        if not self.context.project:
            say(", ".join(f"{part} {seconds:.0f} s" for part, seconds in self.seconds.items()))
            if not self.context.observed:
                write_files({"parts.json": json.dumps(self.seconds)}, self.folder / "tests")
            if not self.pattern and self.cases is None and (ROOT / "tests/circles.py").is_file():
                print(self._tell("tests.circles", "--others", *self.folders), end="")
        print("{} passed, {} failed, {} skipped".format(*counts), flush=True)
        return int(counts[1] != 0)

    def _observed(self) -> int:
        """Run those that count decisions; print which conditions are left, and write all into a file. What they count
        goes into one file of each program, however often it is started."""
        from fledge.verify import decisions

        reports, project, kind = self._reports("decisions"), self.context.project, self.context.observed
        counts = self.folder / "counts"
        shutil.rmtree(counts, ignore_errors=True)
        counts.mkdir()
        variables = {"LLVM_PROFILE_FILE": f"{counts}/%m.profraw", "GTEST_OUTPUT": f"xml:{reports}/",
                     "GTEST_FILTER": ":".join(f"*{name}*" for name in self.pattern.split("|"))}
        programs = sorted((self.folder / f"tests_{kind}").glob("*_test"))
        (counts / "programs").write_text("".join(f"{program}\n" for program in programs), encoding="utf-8")
        log = self.context.logs / f"{kind}-{self.context.preset}.log"
        with self._counted("C and C++"):
            status = run(log, ["xargs", "-a", counts / "programs", "-P", str(os.cpu_count()), "-n1", "env"],
                         self.context.tree, {**os.environ, **variables})
        if status:
            print(log.read_text(encoding="utf-8", errors="replace"), flush=True)
        sums = tally(reports, status)
        if project:
            sums = [sum(pair) for pair in zip(sums, self._python(variables))]
            programs += sorted((self.folder / f"python_{kind}").glob("*.so"))
        written = [path for path in sorted(counts.glob("*.profraw")) if path.stat().st_size]
        if not programs or not written:
            raise Failure("test: no flight code in C has run, whose decisions --coverage counts", 1)
        files = decisions.read(written, programs, [self.context.tree], whole=True)
        print("\n".join(decisions.table(files) if self.options.table else decisions.lines(files)))
        write_files({"decisions.json": json.dumps(decisions.facts(files), indent=1)}, self.context.logs)
        wanted = self.options.strict
        return self._sum(sums) or int(wanted is not None and not decisions.closed(files, wanted.split(",")))

    def _compiled(self) -> list[list[int]]:
        """Run those of C and C++. A pattern stands for sources by their names, and for cases of the other sources of
        GoogleTest."""
        if self.context.project and not self.context.builds_project or not self.programs:
            return []
        if self.cases is not None:
            return [self._ctest("ctest", self.cases, *self.labels)]
        places = {folder: f"^{folder.replace('/', '[.]')}[.]" for folder in self.folders} or {"": ""}
        within = ["-R", "|".join(places.values())] * bool(self.folders)
        if not self.pattern:
            return [self._ctest("ctest", "*", *within)]
        cases = ":".join(f"*{name}*" for name in self.pattern.split("|"))
        sources = "|".join(place if re.search(self.pattern, folder) else f"{place}.*({self.pattern})"
                           for folder, place in places.items())
        return [self._ctest("ctest", "*", "-R", sources),
                self._ctest("cases", cases, "-L", "gtest", "-E", self.pattern, *within)]

    def _ctest(self, name: str, cases: str, *arguments: str) -> list[int]:
        """Run the sources that these arguments of ctest select, and these cases of theirs; print what failed. name: of
        the reports. Many programs wait, so that there are more than processors. A script starts
        its background jobs with SIGINT and SIGQUIT ignored: env restores them for the programs."""
        reports, log = self._reports(name), self.context.logs / f"ctest-{self.context.preset}.log"
        with self._counted("C and C++"):
            status = run(log, ["env", "--default-signal=INT,QUIT", f"GTEST_OUTPUT=xml:{reports}/",
                               f"GTEST_FILTER={cases}", "ctest", "--test-dir", self.folder,
                               "-j", str((os.cpu_count() or 1) + 2), "--no-label-summary", "--output-on-failure",
                               "--output-junit", reports / "ctest.xml", *arguments], self.context.tree)
        for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
            if not PASSED.match(line):
                print(line, flush=True)
        counts = tally(reports, status)
        if lacking := not_installed(reports):
            say("not installed, and tests in C and C++ that were skipped for it: " + ", ".join(
                f"{package} {count}" for package, count in lacking.most_common()))
            counts[1] += self.options.complete
        return counts

    def _python(self, variables: Mapping[str, str] = {}) -> list[int]:
        if self.paths == []:
            return [0, 0, 0]
        reports, project = self._reports("pytest"), self.context.project
        command = [sys.executable, "-m", "pytest", "-q", "-rfEsR", f"--junit-xml={reports}/pytest.xml"]
        if not project:
            # A worker that dies ends the run: pytest-xdist 3.1 would wait for its tests for ever. A test that waits for
            # what does not come is ended, late enough for any load of the machine. One worker more than processors, for
            # tests often wait.
            command += ["--long", self.long, *["--complete"] * self.options.complete]
            if find_spec("xdist"):
                command += ["-n", str((os.cpu_count() or 1) + 1), "--dist", "loadgroup", "--max-worker-restart", "0"]
            if find_spec("pytest_timeout"):
                command += ["--timeout", "1200"]
        else:
            command += ["--import-mode=importlib", "-o", "python_files=*_test.py",
                        "-o", "cache_dir=build/.pytest_cache", "-o", "markers=long: takes long", "--rootdir", "."]
            command += ["-m", "not long"] * (self.long == "none")
        if self.pattern:
            command += ["-k", self.pattern.replace("|", " or ")]
        # For tests of a project that import from missions.NAME. And the tests start Python many hundred times: its
        # bytecode is kept, in the build.
        environment = {**self.context.environment(*[project] if project else []), **variables}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        environment["PYTHONPYCACHEPREFIX"] = str(self.context.logs / "pycache")
        with self._counted("Python"):
            status = pass_on([*command, *(self.paths or [])], self.context.tree, environment)
        return tally(reports, status if status != 5 else 0)     # 5: it found no test; ctest may have found some

    def _reports(self, name: str) -> Path:
        """An empty folder for the reports of this name."""
        folder = self.folder / "tests" / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder


def _folder(given: Path) -> str:
    """A folder of Fledge with tests, from its root, of a name from the current folder or from the root."""
    place = given if given.is_absolute() else next((
        base / given for base in (Path.cwd(), ROOT) if (base / given).is_dir()), ROOT / given)
    inside = os.path.relpath(place.resolve(), ROOT)     # links in the package lead to the folders of tests
    if inside == ".":
        raise Failure(f"test: {given} is all of Fledge: ./fledge test")
    if place.is_file():
        raise Failure(f"test: {given} is no folder; -k {given.stem} runs the tests of that name")
    if not place.is_dir() or inside.split("/")[0] in ("..", "build", "runs"):
        known = [path.name for path in ROOT.iterdir() if path.is_dir() and any(_tests_in(path.name))]
        raise Failure(f"test: Fledge has no folder {given}{did_you_mean(str(given), known)} folders with tests are "
                      f"{', '.join(sorted(known))}, and those below them")
    if not any(_tests_in(inside)):
        raise Failure(f"test: {inside} has no tests")
    return inside


def _tests_in(folder: str) -> Iterator[Path]:
    """The files with tests below a folder; those of the templates are for projects."""
    for suffix in (".py", ".cpp", ".c"):
        for path in (ROOT / folder).rglob(f"*_test{suffix}"):
            if not {"templates", "build", "runs"} & set(path.relative_to(ROOT).parts):
                yield path


def _is_of_product(path: str) -> bool:
    """Whether tests of Python need what is built: all but that of the repository's own files."""
    return path != "tests/hygiene_test.py"


def _flies_on_targets(path: str) -> bool:
    place = ROOT / path.partition("::")[0]
    files = [place] if place.is_file() else [test for test in _tests_in(path) if test.suffix == ".py"]
    return any(re.search("^(from|import) fledge.*targets", file.read_text(encoding="utf-8"), re.M) for file in files)


# --- counts ----------------------------------------------------------------------------------------

def tally(folder: Path, status: int) -> list[int]:
    """[passed, failed, skipped] of the reports in a folder in JUnit's format: ctest.xml or pytest.xml, and one of each
    program of GoogleTest, which ctest knows as one case. status: of the runner; if it failed but no case did (it
    crashed, or could not load a file), one failure is counted, and so is a report that cannot be read."""
    counts = [0, 0, 0]
    reports = {path.stem: path for path in folder.glob("*.xml") if path.stat().st_size}
    for name, path in reports.items():
        try:
            cases = list(ElementTree.parse(path).getroot().iter("testcase"))
        except ElementTree.ParseError as error:
            say(f"{path} cannot be read: {error}")
            counts[1] += 1
            continue
        for case in cases:
            if not (name == "ctest" and case.get("name") in reports):
                counts[_outcome(case)] += 1
    if status and not counts[1]:
        counts[1] = 1
    return counts


def not_installed(folder: Path) -> Counter[str]:
    """Package -> how many cases were skipped for want of it, by the reports in a folder."""
    packages: Counter[str] = Counter()
    for path in folder.glob("*.xml"):
        try:
            cases = [case for case in ElementTree.parse(path).getroot().iter("testcase") if _outcome(case) == 2]
        except ElementTree.ParseError:
            continue
        for case in cases:
            if reason := re.search("not installed: ([^<\"&\n]+)", ElementTree.tostring(case, "unicode")):
                packages.update(reason[1].strip().split(", "))
    return packages


def _outcome(case: ElementTree.Element) -> int:
    """0: passed, 1: failed, 2: skipped"""
    if case.find("failure") is not None or case.find("error") is not None:
        return 1
    return 2 if case.find("skipped") is not None or case.get("status") in ("notrun", "disabled") else 0
