# SPDX-License-Identifier: Apache-2.0
"""The launcher, run in a copy with stand-ins for the tools that change the machine."""

import os
import re
import shutil
import subprocess

import pytest

import fledge
from fledge import cli
from tests.tree import ROOT

# What the launcher may find on the PATH besides the stand-ins: no sudo, no compiler.
TOOLS = ("cat cksum cut date dirname find flock getconf grep head ls mkdir readlink rm sed sleep tail tr "
         "env").split()

STAND_INS = {
    "id": 'echo "${FAKE_UID:-0}"',
    "dpkg-query": 'cat "$FAKE/installed" 2>/dev/null; exit 1',
    # The first install of each run of the test fails, as it does when the lists are outdated.
    "apt-get": 'echo "$*" >> "$FAKE/apt"\n'
               'case "$*" in *install*) [ -e "$FAKE/updated" ] || { echo "E: no"; exit 100; } ;;\n'
               '*) : > "$FAKE/updated" ;; esac\n'
               'echo "Need to get 12.3 MB of archives."',
    "cmake": 'echo "$*" >> "$FAKE/cmake"; mkdir -p build/$2; : > build/$2/build.ninja\n'
             'echo "BUILD_TESTING:BOOL=${3#*=}" > build/$2/CMakeCache.txt',
    "ninja": 'echo "$*" >> "$FAKE/ninja"; [ ! -e "$FAKE/broken" ] || {\n'
             'cat "$FAKE/broken"; exit 1; }; echo "ninja: no work to do."',
    "ctest": 'while [ $# -gt 0 ]; do [ "$1" != --output-junit ] || report=$2; shift; done\n'
             '[ ! -e "$FAKE/report" ] || cat "$FAKE/report" > "$report"\n'
             'exit "$(cat "$FAKE/status")"',
}

REPORT = ('<?xml version="1.0"?>\n<testsuite name="x"\n\ttests="5"\n\tfailures="{}"\n'
          '\tdisabled="0"\n\tskipped="1"\n>\n</testsuite>')


@pytest.fixture
def launch(tmp_path):
    """launch(*arguments, **environment) runs the copy; launch.said(name) is what a tool got."""
    (tmp_path / "cmake").mkdir()
    (tmp_path / "bin").mkdir()
    (tmp_path / "fake").mkdir()
    shutil.copy(ROOT / "fledge", tmp_path)
    shutil.copy(ROOT / "cmake/packages.txt", tmp_path / "cmake")
    (tmp_path / "CMakeLists.txt").touch()
    (tmp_path / "a_test.py").write_text("def test_one():\n    pass\n")
    (tmp_path / "pytest.ini").write_text("[pytest]\npython_files = *_test.py\n")
    for tool in TOOLS:
        (tmp_path / "bin" / tool).symlink_to(shutil.which(tool))
    for name, script in STAND_INS.items():
        (tmp_path / "bin" / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / "bin" / name).chmod(0o755)

    def run(*arguments, **environment):
        return subprocess.run(
            ["/bin/sh", tmp_path / "fledge", *arguments], capture_output=True, text=True,
            cwd=tmp_path, env={"PATH": str(tmp_path / "bin"), "FAKE": str(tmp_path / "fake"),
                               **environment})

    def said(name):
        path = tmp_path / "fake" / name
        return path.read_text().splitlines() if path.exists() else []

    run.said = said
    run.fake = tmp_path / "fake"
    return run


def packages(purpose):
    """The names in that section of the list."""
    section = (ROOT / "cmake/packages.txt").read_text().split(f"[{purpose}]")[1].split("[")[0]
    return re.findall(r"^[^#\s]+", section, re.MULTILINE)


def test_setup_installs_what_is_missing_and_only_that(launch):
    (launch.fake / "installed").write_text("installed cmake\nconfig-files ninja-build\n")
    (launch.fake / "updated").touch()
    done = launch("setup")
    assert done.returncode == 0, done.stderr
    (command,) = [line for line in launch.said("apt") if " install " in line]
    wanted = command.split("--no-install-recommends ")[1].split()
    assert wanted == [name for name in packages("run") if name != "cmake"]
    assert "12.3 MB" in done.stderr


def test_setup_does_nothing_the_second_time(launch):
    (launch.fake / "updated").touch()
    launch("setup")
    before = launch.said("apt")
    again = launch("setup")
    assert launch.said("apt") == before
    assert len(launch.said("cmake")) == 1
    assert again.stderr == "fledge: ready\n"


def test_package_lists_are_fetched_only_when_an_install_fails(launch):
    done = launch("setup")
    assert done.returncode == 0, done.stderr
    words = [word for line in launch.said("apt") for word in line.split()
             if word in ("install", "update")]
    assert words[-2:] == ["update", "install"]
    assert words.count("update") == 1


def test_without_root_or_sudo_it_says_what_to_type_and_touches_nothing(launch):
    done = launch("setup", FAKE_UID="1000")
    assert done.returncode == 1
    assert "apt-get install --no-install-recommends " + " ".join(packages("run")) in done.stderr
    assert launch.said("apt") == launch.said("cmake") == []


def test_a_broken_build_shows_its_error_and_fails(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "broken").write_text("a.c:7:1: error: it is broken\n")
    done = launch("demo")
    assert done.returncode == 1
    assert "the build failed" in done.stderr and "a.c:7:1: error: it is broken" in done.stderr


def test_a_refused_header_is_shown_although_much_follows(launch):
    (launch.fake / "updated").touch()
    refusal = "/sat/flight/a.h:39: a struct holds no padding; add `uint32_t spare;`"
    (launch.fake / "broken").write_text(f"FAILED: {'tables.c ' * 99}\n{refusal}\n" + "a_test.cpp:1:1: note: x\n" * 99)
    done = launch("demo")
    assert refusal in done.stderr
    assert max(len(line) for line in done.stderr.splitlines() if line.startswith("FAILED")) == 200


def test_demo_installs_no_test_packages(launch):
    (launch.fake / "updated").touch()
    launch("demo")
    assert not any("pytest" in line for line in launch.said("apt"))
    assert launch.said("cmake") == ["--preset release -DBUILD_TESTING=OFF"]


def test_a_bench_builds_what_it_measures_in_c(launch):
    (launch.fake / "updated").touch()
    launch("bench")
    assert launch.said("ninja")[-1].endswith(" all")
    launch("bench", "sim", "--json", "sim.json")
    assert launch.said("ninja")[-1].endswith(" all fledge_bench")
    (command,) = [line for line in launch.said("apt") if "mpmath" in line]
    assert "pytest" not in command


@pytest.mark.parametrize("failures, status, line", [
    (0, 0, "5 passed, 0 failed, 1 skipped"),
    (2, 8, "3 passed, 2 failed, 1 skipped"),
    (0, 8, "5 passed, 1 failed, 1 skipped"),     # it failed, but no test did
    (None, 8, "1 passed, 1 failed, 0 skipped"),  # it left no report
])
def test_the_closing_line_adds_up_and_the_status_is_honest(launch, failures, status, line):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text(str(status))
    if failures is not None:
        (launch.fake / "report").write_text(REPORT.format(failures))
    done = launch("test")
    assert done.stdout.splitlines()[-1] == line, done.stdout + done.stderr
    assert done.returncode == (status != 0)


def test_the_closing_line_counts_what_ctest_skips(launch, tmp_path):
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/CTestTestfile.cmake").write_text(
        'add_test(passes "true")\nadd_test(skips "echo" "[  SKIPPED ] Sky.Moon")\n'
        'set_tests_properties(skips PROPERTIES SKIP_REGULAR_EXPRESSION "\\\\[  SKIPPED \\\\]")\n')
    subprocess.run(["ctest", "--test-dir", tmp_path / "tests", "--output-junit", launch.fake / "report"], check=True)
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    done = launch("test")
    assert done.stdout.splitlines()[-1] == "2 passed, 0 failed, 1 skipped"      # with the one of pytest


def test_alternatives_in_a_pattern_are_for_both_runners(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(REPORT.format(0))
    done = launch("test", "-k", "nothing_here|test_one")
    assert done.returncode == 0 and done.stdout.splitlines()[-1] == "5 passed, 0 failed, 1 skipped", done.stdout


def test_a_pattern_that_matches_nothing_fails(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text('<testsuite name="x" tests="0" failures="0" skipped="0">')
    done = launch("test", "-k", "nothing_has_this_name")
    assert done.returncode == 1
    assert "no test matches 'nothing_has_this_name'" in done.stderr


# The launcher's own, and those of the command line proper.
COMMANDS = ["setup", "demo", "test", "exec", *next(a.choices for a in cli.parser()._actions if a.dest == "command")]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command):
    done = subprocess.run([ROOT / "fledge", command, "--help"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"fledge {command}" in done.stdout and "example" in done.stdout.lower()


def test_the_usage_names_every_command():
    usage = subprocess.run([ROOT / "fledge", "help"], capture_output=True, text=True).stdout
    assert [name for name in COMMANDS if not re.search(rf"  {name} ", usage)] == []


def test_it_prints_the_version():
    done = subprocess.run([ROOT / "fledge", "--version"], capture_output=True, text=True)
    assert done.stdout == f"fledge {fledge.__version__}\n"


def test_exec_finds_the_python_that_the_extension_is_built_for(launch):
    (launch.fake / "updated").touch()
    assert launch("exec", "/bin/sh", "-c", "echo $PATH").stdout.startswith("/usr/bin:")


@pytest.mark.parametrize("arguments", [["test", "--bogus"], ["setup", "--bogus"], ["demo", "now"], ["test", "-k"]])
def test_a_wrong_command_line_is_told_from_a_failure(launch, arguments):
    assert launch(*arguments).returncode == 2


def test_an_unknown_command_is_refused(launch):
    done = launch("hover")
    assert done.returncode == 2
    assert "unknown command 'hover'" in done.stderr and "usage:" in done.stderr


def test_the_launcher_is_plain_posix():
    assert os.access(ROOT / "fledge", os.X_OK)
    assert subprocess.run(["/bin/sh", "-n", ROOT / "fledge"]).returncode == 0
