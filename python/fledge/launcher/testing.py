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
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from fledge.errors import Failure
from fledge.disk import ROOT, may_write, write_files
from fledge.launcher import build
from fledge.launcher.context import Context
from fledge.launcher.packages import expanded, need, provide
from fledge.launcher.tools import alone, pass_on, run, say

# Lines of ctest that are left out.
PASSED = re.compile("Internal ctest|Test project|No tests were found| +Start +[0-9]+:|.* Passed +[0-9.]+ sec")


def need_tests(context: Context) -> None:
    """Install the packages for tests; Fledge's own tests need more than a project's."""
    from fledge.targets import TARGETS

    need(context, "pytest")
    if context.builds_project or not context.project:
        need(context, "unit")
    if not context.project:
        need(context, "test", if_possible=True)
        provide(context, expanded(TARGETS), without=True)


def need_decisions(context: Context) -> None:
    """Install what counts decisions, and let what is built count them."""
    need(context, "decisions")
    context.observe("mcdc")


class Tests:
    """Those that the options ask for. Raises SystemExit where tests.changed refuses them, or nothing has changed."""

    def __init__(self, context: Context, options: argparse.Namespace) -> None:
        self.context, self.options = context, options
        self.pattern = options.pattern      # names match; of alternatives, "a|b"
        self.long = "all" if options.pattern else options.long      # which of those that are marked long
        self.programs = "tests"             # of C and C++, that are built
        self.cases: str | None = None       # of GoogleTest, its filter; None: as the pattern says
        self.paths: list[str] = []          # of Python; none: all
        self.folder = context.build
        if options.changed is not None:
            lines = self._changed(*[options.changed] * bool(options.changed)).splitlines()
            if not lines:
                sys.exit(0)
            self.programs, self.cases, paths = [*lines, "", ""][:3]
            self.paths = paths.split()
        if options.since:
            self.paths = self._changed("--reach", options.since).split() or ["tests/hygiene_test.py"]

    def _changed(self, *words: str) -> str:
        """What tests.changed prints."""
        done = subprocess.run([sys.executable, "-P", "-m", "tests.changed", *words], cwd=ROOT, stdout=subprocess.PIPE,
                              text=True, env={**os.environ, **self.context.names(), "PYTHONPATH": str(ROOT)})
        if done.returncode:
            sys.exit(done.returncode)
        return done.stdout

    def run(self) -> int:
        """Build and run them; prints the sum, and returns the exit code."""
        context, kind = self.context, self.context.observed
        self.folder = build.compile(context, [kind] if kind else ["all"], tests=True,
                                    programs=f"{kind}_tests" if kind else self.programs)
        if context.project:
            say(f"testing {context.project}")
        if not may_write(context.logs, self.folder):
            raise Failure(f"test: writes into {context.logs}, where this user may not", 1)
        if not context.project and not kind:
            # The commands that tests start prepare what they fly on; tests of the targets themselves expect it.
            if self.cases is None or any(map(_flies_on_targets, self.paths)):
                build.prepare(context)
            build.need_node(context)
            build.view(context, if_possible=True)
        with alone(context.logs / f"{context.preset}-tests.lock", "runs these tests"):
            if kind:
                return self._observed()
            counts = [sum(column) for column in zip(*self._compiled(), self._python())]
        return self._sum(counts)

    def _sum(self, counts: list[int]) -> int:
        """Print the sum; returns the exit code."""
        if not sum(counts):
            say(f"no test matches '{self.pattern}'")
            counts[1] = 1
        print("{} passed, {} failed, {} skipped".format(*counts), flush=True)
        return int(counts[1] != 0)

    def _observed(self) -> int:
        """Run those that count decisions; print which conditions are left, and write all into a file. What they count
        goes into one file of each program, however often it is started."""
        from fledge.verify import decisions

        reports, project, kind = self._reports(), self.context.project, self.context.observed
        counts = self.folder / "counts"
        shutil.rmtree(counts, ignore_errors=True)
        counts.mkdir()
        variables = {"LLVM_PROFILE_FILE": f"{counts}/%m.profraw", "GTEST_OUTPUT": f"xml:{reports}/",
                     "GTEST_FILTER": ":".join(f"*{name}*" for name in self.pattern.split("|"))}
        programs = sorted((self.folder / f"tests_{kind}").glob("*_test"))
        (counts / "programs").write_text("".join(f"{program}\n" for program in programs), encoding="utf-8")
        log = self.context.logs / f"{kind}-{self.context.preset}.log"
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
        if self.context.project and not self.context.builds_project:
            return []
        if self.cases is not None:
            labels = ".*" if self.programs == "tests" else self.programs.replace(" ", "|")
            return [self._ctest(self.cases, "-L", f"^({labels})$")] if labels else []
        if not self.pattern:
            return [self._ctest("*")]
        cases = ":".join(f"*{name}*" for name in self.pattern.split("|"))
        return [self._ctest("*", "-R", self.pattern), self._ctest(cases, "-L", "gtest", "-E", self.pattern)]

    def _ctest(self, cases: str, *arguments: str) -> list[int]:
        """Run the sources that these arguments of ctest select, and these cases of theirs; print what failed. In the
        background of a script Ctrl-C is ignored, which the programs would inherit."""
        reports, log = self._reports(), self.context.logs / f"ctest-{self.context.preset}.log"
        status = run(log, ["env", "--default-signal=INT,QUIT", f"GTEST_OUTPUT=xml:{reports}/", f"GTEST_FILTER={cases}",
                           "ctest", "--test-dir", self.folder, "-j", str(os.cpu_count()), "--no-label-summary",
                           "--output-on-failure", "--output-junit", reports / "ctest.xml", *arguments],
                     self.context.tree)
        for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
            if not PASSED.match(line):
                print(line, flush=True)
        return tally(reports, status)

    def _python(self, variables: Mapping[str, str] = {}) -> list[int]:
        reports, project = self._reports(), self.context.project
        command = [sys.executable, "-m", "pytest", "-q", "-rfEsR", f"--junit-xml={reports}/pytest.xml"]
        if not project:
            # A worker that dies ends the run: pytest-xdist 3.1 would wait for its tests for ever. A test that waits for
            # what does not come is ended, late enough for any load of the machine. One worker more than processors, for
            # tests often wait.
            command += ["-n", str((os.cpu_count() or 1) + 1), "--dist", "loadgroup", "--max-worker-restart", "0",
                        "--timeout", "1200", "--long", self.long]
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
        status = pass_on([*command, *self.paths], self.context.tree, environment)
        return tally(reports, status if status != 5 else 0)     # 5: it found no test; ctest may have found some

    def _reports(self) -> Path:
        """The folder of the reports, emptied."""
        folder = self.folder / "tests"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder


def _flies_on_targets(path: str) -> bool:
    file = ROOT / path.partition("::")[0]
    return file.is_file() and bool(re.search("^(from|import) fledge.*targets", file.read_text(encoding="utf-8"), re.M))


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


def _outcome(case: ElementTree.Element) -> int:
    """0: passed, 1: failed, 2: skipped"""
    if case.find("failure") is not None or case.find("error") is not None:
        return 1
    return 2 if case.find("skipped") is not None or case.get("status") in ("notrun", "disabled") else 0
