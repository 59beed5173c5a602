# SPDX-License-Identifier: Apache-2.0
"""The launcher, run in a copy with stand-ins for the tools that change the machine."""

import compileall
import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import pytest

import fledge
from fledge.disk import create
from fledge.launcher.packages import listed
from fledge.launcher.parser import parser
from tests.circles import long_after
from tests.needs import skip_without
from tests.tree import ROOT

pytestmark = pytest.mark.spread

# The PATH of the launcher and the stand-ins: no sudo, no compiler.
TOOLS = "cat dirname env find grep id mkdir paste readlink sed sleep touch tr".split()

STAND_INS = {
    "dpkg-query": 'cat "$FAKE/installed" 2>/dev/null; exit 1',
    # The first install of each run of the test fails, as it does when the lists are outdated.
    "apt-get": 'echo "$*" >> "$FAKE/apt"; . "$FAKE/during" "$0"\n'
               'case "$*" in "-s "*) exit ;;\n*satisfy*) [ -e "$FAKE/updated" ] || { echo "E: no"; exit 100; } ;;\n'
               '*) : > "$FAKE/updated" ;; esac\n'
               'for name in $(echo "$*" | tr ",|" "  "); do echo "installed $name, " >> "$FAKE/installed"; done\n'
               'echo "Need to get 12.3 MB of archives."',
    "cmake": 'echo "$*" >> "$FAKE/cmake"; . "$FAKE/during" "$0"\n'
             'for one; do case $one in release | debug) dir=$PWD/build/$one ;; /*/build/*) dir=$one ;;\n'
             '-DBUILD_TESTING=*) tests=${one#*=} ;; -DFledge_DIR=*) fledge=${one#*=} ;;\n'
             '*AS_ERROR=*) strict=${one#*=} ;; esac; done\n'
             'mkdir -p "$dir"; cd "$dir"; : > build.ninja; : > FledgeConfig.cmake; cd "$OLDPWD"\n'
             'printf "CMAKE_HOME_DIRECTORY:INTERNAL=%s\\nBUILD_TESTING:BOOL=%s\\nFledge_DIR:PATH=%s\\n'
             'CMAKE_COMPILE_WARNING_AS_ERROR:BOOL=%s\\n" '
             '"$PWD" "$tests" "$fledge" "$strict" > "$dir/CMakeCache.txt"',
    "ninja": 'case "$*" in *" -t "*) exit ;; esac; echo "$*" >> "$FAKE/ninja"; . "$FAKE/during" "$0"\n'
             '[ ! -e "$FAKE/broken" ] || { cat "$FAKE/broken"; exit 1; }; echo "ninja: no work to do."',
    "ctest": 'echo "$*" >> "$FAKE/ctest"\n'
             'while [ $# -gt 0 ]; do case $1 in --output-junit) report=$2 ;; -E) exit 0 ;; esac; shift; done\n'
             'grep SigIgn /proc/$$/status > "$FAKE/ignored"\n'
             '[ ! -e "$FAKE/report" ] || cat "$FAKE/report" > "$report"\n'
             'exit "$(cat "$FAKE/status")"',
}


# Runs a program as a user that is neither root nor the owner of the tree, where that is possible.
OTHER = ["/usr/bin/setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.getuid() == 0 else []


def report(failures):
    """The report of ctest on five tests, of which one was skipped."""
    cases = ["<failure/>"] * failures + ["<skipped/>"] + [""] * (4 - failures)
    return ('<?xml version="1.0"?>\n<testsuite name="x">\n' +
            "".join(f'<testcase name="t{i}">{what}</testcase>\n' for i, what in enumerate(cases)) + "</testsuite>\n")


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A tree of the launcher alone, with its modules compiled: each test has a copy of its own."""
    tree = tmp_path_factory.mktemp("launcher") / "tree"
    (tree / "cmake").mkdir(parents=True)
    for name in ("fledge", "conftest.py"):
        shutil.copy(ROOT / name, tree)
    shutil.copy(ROOT / "cmake/packages.txt", tree / "cmake")
    (tree / "CMakeLists.txt").touch()
    (tree / "a_test.py").write_text("def test_one():\n    pass\n")
    (tree / "pytest.ini").write_text("[pytest]\npython_files = *_test.py\n")
    for path in [*ROOT.glob("python/fledge/*.py"), *ROOT.glob("python/fledge/cli/*.*"),
                 *ROOT.glob("python/fledge/cli/*/*.py"), *ROOT.glob("python/fledge/*/packages.txt"),
                 *ROOT.glob("python/fledge/launcher/*.*"), *ROOT.glob("bench/*.py"),
                 *ROOT.glob("python/fledge/targets/*.py"), *ROOT.glob("targets/*/__init__.py"),
                 *ROOT.glob("targets/*/packages.txt")]:
        if not path.stem.endswith("_test"):
            (tree / path.relative_to(ROOT)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, tree / path.relative_to(ROOT))
    with open(tree / "python/fledge/cli/__init__.py", "a", encoding="utf-8") as file:
        file.write("\n\ndef carry_out(options):\n"
                   "    print(*options.words, 'in', os.getcwd(), 'for', os.environ['FLEDGE_PROJECT'], flush=True)\n"
                   "    return 0\n")
    (tree / "python/fledge/targets/__main__.py").write_text(
        "import os, sys\nopen(os.environ['FAKE'] + '/prepared', 'a').write(' '.join(sys.argv[1:]) + '\\n')\n")
    compileall.compile_dir(tree / "python/fledge", quiet=1)
    return tree


@pytest.fixture
def launch(copied):
    """launch(*arguments, **environment) runs the copy in launch.tree; launch.calls(name) has the arguments
    of each call of a tool. A tool executes launch.fake/"during" with its path as $1. Every user can read the folders,
    unlike pytest's."""
    place = Path(tempfile.mkdtemp(prefix="fledge-"))
    place.chmod(0o755)
    tree, bin_, fake = place / "tree", place / "bin", place / "fake"
    subprocess.run(["cp", "-a", copied, tree], check=True)
    for folder in (bin_, fake):
        folder.mkdir()
    fake.chmod(0o777)
    (fake / "during").touch()
    for tool in TOOLS:
        (bin_ / tool).symlink_to(shutil.which(tool))
    for name, script in STAND_INS.items():
        (bin_ / name).write_text(f"#!/bin/sh\n{script}\n")
        (bin_ / name).chmod(0o755)

    def start(*arguments, cwd=None, program=None, user=(), **environment):
        return subprocess.Popen(
            [*user, "/bin/sh", program or run.tree / "fledge", *arguments], text=True, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, cwd=cwd or run.tree, start_new_session=True,
            env={"PATH": str(bin_), "FAKE": str(fake), "LC_ALL": "C.UTF-8", **environment})

    def run(*arguments, **options):
        process = start(*arguments, **options)
        out, error = process.communicate()
        return subprocess.CompletedProcess(process.args, process.returncode, out, error)

    def calls(name):
        path = fake / name
        return path.read_text().splitlines() if path.exists() else []

    run.start, run.calls, run.fake, run.tree, run.place = start, calls, fake, tree, place
    yield run
    subprocess.run(["chmod", "-R", "u+w", place], check=True)
    shutil.rmtree(place)


def packages(purpose):
    """The names in that section of the list, or in the three of `run`; of alternatives, the first."""
    return [line.partition(" ")[0] for line in listed(purpose)]


# Name of a target's folder -> the packages that the target needs.
ROOMS = {path.parent.name: packages(str(path.parent)) for path in ROOT.glob("targets/*/packages.txt")}


def test_setup_installs_what_is_missing_and_only_that(launch):
    (launch.fake / "installed").write_text(
        "installed cmake, cmake-data (= 3.25)\nconfig-files ninja-build, \ninstalled x, python-clang-x.y, g++ (= 12)\n")
    (launch.fake / "updated").touch()
    done = launch("setup")
    assert done.returncode == 0, done.stderr
    (command,) = (line for line in launch.calls("apt") if " satisfy " in line)
    wanted = command.split("--no-install-recommends ")[1].split(", ")
    assert wanted == [name for name in packages("run") if name not in ("cmake", "python3-clang", "g++")]
    assert "12.3 MB" in done.stderr


def test_setup_does_nothing_the_second_time(launch):
    (launch.fake / "updated").touch()
    launch("setup")
    before = launch.calls("apt")
    again = launch("setup")
    assert launch.calls("apt") == before
    assert len(launch.calls("cmake")) == 1
    assert again.stderr == "fledge: ready\n"


def test_package_lists_are_fetched_only_when_an_install_fails(launch):
    done = launch("setup")
    assert done.returncode == 0, done.stderr
    words = [word for line in launch.calls("apt") for word in line.split()
             if word in ("satisfy", "update")]
    assert words[-2:] == ["update", "satisfy"]
    assert words.count("update") == 1


def test_without_root_or_sudo_it_says_what_to_type_and_touches_nothing(launch):
    done = launch("setup", user=OTHER)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("fledge: packages are missing; as root, run: apt-get satisfy --no-install-recommends 'g++, ")
    assert "python3-clang | python-clang-x.y, " in line and packages("run")[-1] in line
    assert launch.calls("apt") == launch.calls("cmake") == []


@pytest.fixture
def without_python(launch, tmp_path):
    """launch() on a machine without Python, until apt-get installs it."""
    python = Path("/usr/bin/python3").resolve()
    hidden = tmp_path / "nothing"
    hidden.touch(mode=0o644)
    namespace = ["/usr/bin/unshare", "--mount", "/bin/sh", "-c",
                 '/bin/mount --bind "$1" "$2" && shift 2 && exec "$@"', "sh", hidden, python]
    if subprocess.run([*namespace, "true"], capture_output=True).returncode:
        pytest.skip("this machine lets the user mount nothing")
    (launch.fake / "during").write_text(
        f'case "$0 $*" in *apt-get*install*python3) /bin/umount {python} ;; esac\n')
    (launch.fake / "updated").touch()
    return lambda *words, user=(): launch(*words, user=[*namespace, *user])


def test_a_machine_without_python_gets_it_first(launch, without_python):
    for words in (["help"], [], ["run", "--help"]):
        done = without_python(*words)
        assert done.returncode == 0 and done.stdout.startswith("usage: ./fledge") and launch.calls("apt") == []
    assert without_python("--version").stdout == f"fledge {fledge.__version__}\n"
    done = without_python("list")
    assert done.returncode == 0 and done.stdout.startswith("list in "), done.stderr
    assert done.stderr.startswith("fledge: installing python3\nfledge: installing for 'run': g++, ")
    assert "install --no-install-recommends python3" in launch.calls("apt")[0]


def test_a_machine_without_python_says_what_it_lacks(launch, without_python):
    if OTHER:
        done = without_python("list", user=OTHER)
        assert done.returncode == 1 and launch.calls("apt") == []
        assert done.stderr == ("fledge: packages are missing; as root, run: apt-get satisfy --no-install-recommends "
                               f"'{', '.join(listed('run'))}'\n")
    (launch.fake / "during").write_text(
        'case "$0 $*" in *apt-get*) echo "E: Failed to fetch x  Temporary failure resolving m.x"; exit 100 ;; esac\n')
    done = without_python("list")
    assert done.returncode == 1
    assert done.stderr.splitlines()[1].startswith("fledge: apt-get failed: the network or a server does not answer")
    (launch.place / "bin/apt-get").unlink()
    done = without_python("list")
    assert done.stderr.startswith("fledge: this is no Debian, and lacks /usr/bin/python3; install by hand what is "
                                  "missing of: g++ cmake ")


def test_what_only_developers_like_comes_when_they_ask(launch):
    (launch.fake / "updated").touch()
    launch("setup")
    assert "ccache" not in " ".join(launch.calls("apt"))
    launch("setup", "--develop")
    assert launch.calls("apt")[-1].endswith("ccache, pre-commit, debootstrap")


def on_system(launch, text):
    """Let the copy read this in the place of /etc/os-release."""
    (launch.fake / "os-release").write_text(text)
    program = launch.tree / "python/fledge/launcher/packages.py"
    (launch.fake / "x_Packages").touch()        # apt has lists
    program.write_text(program.read_text().replace("/etc/os-release", str(launch.fake / "os-release")).replace(
        "/var/lib/apt/lists", str(launch.fake)))


def test_a_system_without_apt_reads_what_it_lacks_and_may_be_forced(launch):
    (launch.place / "bin/apt-get").unlink()
    on_system(launch, "NAME=Fedora\nVERSION_CODENAME=\"\"\nPRETTY_NAME=\"Fedora Linux 42\"\n")
    done = launch("list")
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1 and line.startswith(
        "fledge: this is Fedora Linux 42, and Fledge is made for Debian 12, Debian 13, Ubuntu 24.04; it has no "
        "apt-get, g++; install by hand what is missing of: g++ cmake ")
    assert line.endswith("; to try it here: ./fledge --force COMMAND")
    done = launch("--force", "list")
    assert done.returncode == 0 and "list in" in done.stdout
    assert done.stderr.startswith("fledge: this is Fedora Linux 42: it has no apt-get, g++; install by hand")
    assert launch("list").stderr == ""


def test_another_debian_reads_which_packages_it_lacks_and_is_tried_without_them(launch):
    (launch.fake / "during").write_text('case "$0 $*" in *apt-get*cppzmq-dev*) exit 100 ;; esac\n')
    (launch.fake / "updated").touch()
    on_system(launch, "PRETTY_NAME='x'\nPRETTY_NAME=\"Debian GNU/Linux 14 (forky)\"\nVERSION_CODENAME=forky\n")
    done = launch("setup")
    assert done.returncode == 1 and done.stderr == (
        "fledge: this is Debian GNU/Linux 14 (forky), and Fledge is made for Debian 12, Debian 13, Ubuntu 24.04; it "
        "has no cppzmq-dev; to try it here: ./fledge --force COMMAND\n")
    assert all(line.startswith("-s ") for line in launch.calls("apt")) and not launch.calls("cmake")
    done = launch("--force", "demo")
    assert "\nfledge: this system has no cppzmq-dev; without it, what needs it is skipped\n" in done.stderr
    assert "list in" in launch("list").stdout       # it is not asked again, nor are the commands that demo starts


@pytest.mark.parametrize("text", ["VERSION_CODENAME=trixie\n", 'ID=linuxmint\nVERSION_CODENAME=xia\nUBUNTU_CODENAME='
                                  '"noble"\n', "VERSION_CODENAME=faye\nDEBIAN_CODENAME=bookworm\n"])
def test_what_is_made_of_a_known_system_is_known(launch, text):
    (launch.fake / "updated").touch()
    on_system(launch, text)
    assert launch("list").returncode == 0


def test_tests_go_on_without_the_packages_that_only_some_of_them_need(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    (launch.fake / "during").write_text('case "$0 $*" in *apt-get*frama-c-base* | *apt-get*qemu-system-arm*)\n'
                                        'echo "E: Unable to locate package"; exit 100 ;; esac\n')
    done = launch("test", "--all")
    assert "fledge: this system has no frama-c-base; without it, what needs it is skipped\n" in done.stderr
    assert "fledge: going on without cortex_m7\n" in done.stderr
    assert any("tshark" in line and "frama" not in line for line in launch.calls("apt") if not line.startswith("-s "))
    assert "5 passed, 0 failed" in done.stdout
    (launch.fake / "during").write_text('case "$0 $*" in *"-s "*) ;; *apt-get*satisfy*gdb*) echo "E: no gdb"; exit 100'
                                        ' ;; esac\n')
    (launch.tree / "build/packages-test.stamp").unlink()
    (launch.fake / "installed").unlink()
    done = launch("test")       # apt knows it, and cannot fetch it
    assert "fledge: apt cannot install gdb; without it, what needs it is skipped; " in done.stderr
    assert done.returncode == 0 and "installed make, " in (launch.fake / "installed").read_text()
    assert (launch.tree / "build/apt-test.log").read_text() == "E: no gdb\n"
    (launch.fake / "during").write_text("")
    assert launch("test").returncode == 0 and "installed gdb, " in (launch.fake / "installed").read_text()
    (launch.fake / "during").write_text('case "$0 $*" in *apt-get*libgmock-dev*) exit 100 ;; esac\n')
    (launch.tree / "build/packages-unit.stamp").unlink()
    (launch.fake / "installed").unlink()
    assert launch("test").returncode == 1       # without that, no test can be built


def test_warnings_are_errors_for_developers_alone(launch):
    (launch.fake / "updated").touch()
    launch("setup")
    launch("setup", "--develop")
    launch("setup", "--develop", "--test")
    assert launch.calls("cmake")[:2] == [
        "--fresh --preset release -DBUILD_TESTING=OFF",
        "--preset release -DBUILD_TESTING=OFF -DCMAKE_COMPILE_WARNING_AS_ERROR=ON"]
    assert launch.calls("cmake")[-1] == "--preset release -DBUILD_TESTING=ON -DCMAKE_COMPILE_WARNING_AS_ERROR=ON"


def test_a_broken_build_shows_its_error_and_fails(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "broken").write_text("a.c:7:1: error: it is broken\n")
    done = launch("demo")
    assert done.returncode == 1
    assert "the build failed" in done.stderr and "a.c:7:1: error: it is broken" in done.stderr


def test_refused_headers_come_first_then_errors_then_the_end(launch):
    (launch.fake / "updated").touch()
    refusal = "/my sat/flight/a.h:39: a struct holds no padding; add `uint32_t spare;`"
    (launch.fake / "broken").write_text(
        f"FAILED: {'tables.c ' * 99}\n: && /usr/bin/g++ a.o\nb.c:3:9: error: expected ';'\n  x\n    ^\n{refusal}\n"
        + "a_test.cpp:1:1: note: x\n" * 99 + "/usr/bin/g++ -c d.cpp\n/usr/bin/ld: d.o: undefined reference to `f'\n")
    shown = launch("demo").stderr.splitlines()
    assert shown[shown.index("fledge: building (release)") + 2:][:4] == [
        refusal, "b.c:3:9: error: expected ';'", "  x", "    ^"]
    assert shown[-1] == "/usr/bin/ld: d.o: undefined reference to `f'"
    assert len(shown) < 16 and not any("FAILED" in line or "/g++" in line for line in shown)


def test_demo_installs_no_test_packages(launch):
    (launch.fake / "updated").touch()
    launch("demo")
    assert not any("pytest" in line for line in launch.calls("apt"))
    assert launch.calls("cmake") == ["--fresh --preset release -DBUILD_TESTING=OFF"]


def test_a_bench_builds_what_it_measures_in_c(launch):
    (launch.fake / "updated").touch()
    launch("bench")
    assert launch.calls("ninja")[-1].endswith(" desktop")
    launch("bench", "sim", "--json", "sim.json")
    assert launch.calls("ninja")[-1].endswith(" all fledge_bench")
    (command,) = [line for line in launch.calls("apt") if "mpmath" in line]
    assert "pytest" not in command


@pytest.mark.long("runs ./fledge test in a tree of its own")
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
        (launch.fake / "report").write_text(report(failures))
    done = launch("test")
    assert done.stdout.splitlines()[-1] == line, done.stdout + done.stderr
    assert done.returncode == (status != 0)


@pytest.mark.long("runs ./fledge test in a tree of its own")
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


@pytest.mark.parametrize("arguments, parts", long_after(8, [
    (["run", "x"], "desktop"), (["up", "x.toml"], "desktop cosim"), (["exec", "true"], "all"),
    (["up", str(ROOT / "missions/earth_imager/board.toml")], "desktop cosim loop fledge_leon3 ground"),
    (["fly", "x", "--on", "desktop"], "desktop"), (["fly", "x", "--on", "linux"], "desktop loop"),
    (["fly", "x", "--on", "leon3-qemu"], "desktop loop fledge_leon3"),
    (["profile", "x", "--on", "leon3"], "desktop _emulator loop fledge_leon3"),
    (["test"], "all tests")], "starts pytest"))
def test_a_command_builds_the_parts_that_it_needs(launch, arguments, parts):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    launch(*arguments)
    assert launch.calls("ninja")[-1].endswith(f"build/release {parts}")


def test_the_tests_of_fledge_run_from_elsewhere_only_on_request(launch):
    """Refused before anything is installed or built. In the checkout and below they need no option."""
    (launch.fake / "updated").touch()
    (launch.fake / "broken").write_text("it went too far")
    elsewhere = launch.place / "elsewhere"
    elsewhere.mkdir()
    for words in ([], ["--all"], ["-k", "x"], ["--changed"]):
        done = launch("test", *words, cwd=elsewhere)
        assert (done.returncode, done.stdout) == (2, "") and not launch.calls("apt")
        assert done.stderr == (
            "fledge: test: there is no project around this folder; go into one, or name it (fledge --project DIR "
            "test); --fledge runs the tests of Fledge itself, which take long\n")
    for words, cwd in (([], launch.tree), ([], launch.tree / "cmake"), (["--fledge"], elsewhere)):
        done = launch("test", *words, cwd=cwd)
        assert done.returncode == 1 and "it went too far" in done.stderr, done.stderr


def test_an_installed_fledge_tests_projects_only(launch):
    (launch.tree / "CMakeLists.txt").unlink()
    for words in ([], ["--fledge"]):
        done = launch("test", *words, cwd=launch.place)
        assert done.returncode == 1 and "an installed Fledge has no tests of its own; go into a pro" in done.stderr


@pytest.mark.long("runs ./fledge test in a tree of its own")
def test_alternatives_in_a_pattern_are_for_both_runners(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    done = launch("test", "-k", "nothing_here|test_one")
    assert done.returncode == 0 and done.stdout.splitlines()[-1] == "5 passed, 0 failed, 1 skipped", done.stdout


@pytest.mark.long("runs ./fledge test in a tree of its own")
def test_a_pattern_that_matches_nothing_fails(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text('<testsuite name="x"/>')
    done = launch("test", "-k", "nothing_has_this_name")
    assert done.returncode == 1
    assert "no test matches 'nothing_has_this_name'" in done.stderr


def test_the_tests_of_a_folder_are_built_and_run(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    for name in ("flight/math/vec_test.cpp", "world/orbit_test.py", "python/fledge/units_test.py"):
        (launch.tree / name).parent.mkdir(parents=True, exist_ok=True)
        (launch.tree / name).write_text("def test_two():\n    pass\n" * name.endswith(".py"))
    for words, cwd, parts, runners, line in (
            (["flight"], "", "tests-flight", "-R ^flight[.]", "4 passed, 0 failed, 1 skipped"),
            (["math"], "flight", "tests-flight-math", "-R ^flight[.]math[.]", "4 passed, 0 failed, 1 skipped"),
            (["world"], "", "all tests-in-python", "", "1 passed, 0 failed, 0 skipped"),
            (["flight", "python"], "", "all tests-flight tests-in-python",
             "-R ^flight[.]|^python[.]", "5 passed, 0 failed, 1 skipped"),
            (["flight", "-k", "vec"], "", "tests-flight", "-R ^flight[.].*(vec)", "4 passed, 0 failed, 1 skipped"),
            (["flight/math", "-k", "math"], "", "tests-flight-math", "-R ^flight[.]math[.]\n", "4 passed, 0 failed, "
             "1 skipped")):
        done = launch("test", *words, cwd=launch.tree / cwd)
        assert done.returncode == 0 and done.stdout.splitlines()[-1] == line, done.stderr
        assert launch.calls("ninja")[-1].endswith(f"build/release {parts}")
        assert runners in "\n".join(launch.calls("ctest"))
        (launch.fake / "ctest").unlink(missing_ok=True)
    for words, message in (
            (["fligt"], "no folder fligt; did you mean 'flight'? folders with tests are flight, python, world"),
            (["cmake"], "cmake has no tests"), (["a_test.py"], "a_test.py is no folder; -k a_test runs the tests of"),
            (["."], ". is all of Fledge: ./fledge test"),
            (["-k", "x", "--since", "HEAD"], "--since chooses the tests, as -k and --changed do; give one of them"),
            (["--turn", "1/2"], "--turn and --compiled are about what --since chooses"),
            (["flight", "--since", "HEAD"], "FOLDER is not for --changed, --since and --coverage")):
        done = launch("test", *words)
        assert done.returncode == 2 and message in done.stderr, done.stderr


def test_what_a_change_reaches_is_built_and_run(launch):
    """tests/changed.py says what; here one that always says the same."""
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    (launch.tree / "tests").mkdir()
    says = launch.tree / "tests/changed.py"
    for text, words, parts, runner, line in (
            ("one two\na_test.py", ["--turn", "3/10"], "all one two tests-in-python", "-L ^(one|two)$", "5 passed"),
            ("one two\na_test.py", ["--compiled"], "one two", "-L ^(one|two)$", "4 passed"),
            ("tests\n", ["--complete"], "tests", "", "4 passed"),
            ("\na_test.py", [], "all tests-in-python", None, "1 passed"),
            ("one\na_test.py", ["--build"], "all one tests-in-python", None, None)):
        for name in ("ninja", "ctest"):
            (launch.fake / name).unlink(missing_ok=True)
        says.write_text(f"import pathlib, sys\npathlib.Path({str(launch.fake / 'words')!r}).write_text("
                        f"' '.join(sys.argv[1:]))\nprint({text!r})\n")
        done = launch("test", "--since", "HEAD", *words)
        assert done.returncode == 0 and (not done.stdout if line is None else line in done.stdout), done.stderr
        assert (launch.fake / "words").read_text() == " ".join(["--reach", *words[:2] * ("--turn" in words), "HEAD"])
        assert [call.partition("build/release ")[2] for call in launch.calls("ninja")][-1:] == [parts] * bool(parts)
        calls = launch.calls("ctest") if (launch.fake / "ctest").exists() else []
        assert len(calls) == (runner is not None) and all(("-L" in call) == bool(runner) and runner in call
                                                          for call in calls)
    says.write_text("import sys\nsys.exit(2)\n")
    assert launch("test", "--since", "HEAD").returncode == 2


def test_each_runner_keeps_its_reports(launch):
    """Those of the one stay when the other begins, and what an earlier run has left goes."""
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    reports = launch.tree / "build/release/tests"
    reports.mkdir(parents=True)
    (reports / "old.xml").touch()
    assert launch("test").returncode == 0
    assert {str(path.relative_to(reports)) for path in reports.rglob("*.xml")} == {
        "ctest/ctest.xml", "pytest/pytest.xml"}
    assert set(json.loads((reports / "parts.json").read_text())) == {
        "packages", "build", "targets", "C and C++", "Python"}


# --- copies, other places, other users ---------------------------------------------------------------

def test_a_copied_tree_builds_its_own_code(launch):
    (launch.fake / "updated").touch()
    launch("setup")
    first = launch.tree
    launch.tree = launch.place / "a copy"
    shutil.copytree(first, launch.tree)
    (launch.tree / "build/release/old.o").touch()
    done = launch("list")
    assert done.stderr == (f"fledge: building anew (release): {launch.tree}/build/release was made in {first}\n")
    assert len(launch.calls("cmake")) == 2 and not (launch.tree / "build/release/old.o").exists()
    assert launch("list").stderr == ""


def test_a_project_is_built_anew_for_another_place_or_another_fledge(launch):
    (launch.fake / "updated").touch()
    sat = launch.place / "sat"
    sat.mkdir()
    (sat / "CMakeLists.txt").touch()
    assert f"building {sat} (release)" in launch("--project", sat, "list").stderr
    assert launch("--project", sat, "list").stderr == ""
    moved = sat.rename(launch.place / "moved")
    assert f"building {moved} anew" in launch("--project", moved, "list").stderr
    assert launch("--project", moved, "list").stderr == ""
    before = launch.tree
    launch.tree = launch.tree.rename(launch.place / "fledge")
    assert f"building {moved} anew (release): {moved}/build/release was made in {moved} with {before}" in launch(
        "--project", moved, "list").stderr


def test_a_project_is_configured_again_when_a_test_comes_or_goes(launch):
    (launch.fake / "updated").touch()
    sat = launch.place / "sat"
    sat.mkdir()
    (sat / "CMakeLists.txt").touch()

    def configured():
        assert launch("--project", sat, "list").returncode == 0
        return len(launch.calls("cmake"))

    first, found = configured(), sat / "build/release/fledge-tests.txt"
    found.write_text("+ one_test.cpp\n- two_test.cpp\n")
    (sat / "one_test.cpp").touch()
    assert configured() == first
    (sat / "two_test.cpp").touch()
    assert configured() == first + 1
    found.write_text("+ one_test.cpp\n+ two_test.cpp\n")
    (sat / "one_test.cpp").unlink()
    assert configured() == first + 2


def test_two_fledges_keep_their_builds_of_one_project(launch):
    (launch.fake / "updated").touch()
    other, sat = launch.place / "other", launch.place / "sat"
    shutil.copytree(launch.tree, other)
    sat.mkdir()
    (sat / "CMakeLists.txt").touch()

    def builds(program):
        done = launch("--project", sat, "exec", "/bin/sh", "-c", "echo $FLEDGE_PROJECT_BUILD", program=program, cwd=sat)
        assert done.returncode == 0 and "anew" not in done.stderr
        return Path(done.stdout.strip())

    ours, theirs = [builds(tree / "fledge") for tree in (launch.tree, other)]
    assert ours == sat / "build/release" != theirs and theirs.parent == ours.parent
    assert [builds(tree / "fledge") for tree in (launch.tree, other)] == [ours, theirs]
    shutil.rmtree(launch.tree)
    assert builds(other / "fledge") == theirs


def test_packages_are_looked_for_on_another_machine_too(launch):
    """The stamp of a copied folder does not count: it holds the state of another dpkg."""
    (launch.fake / "updated").touch()
    launch("setup")
    (launch.fake / "installed").unlink()
    stamp = launch.tree / "build/packages-run.stamp"
    stamp.write_text("".join(stamp.read_text().splitlines(True)[:1]) + "1 2 3 4\n")
    before = len(launch.calls("apt"))
    launch("setup")
    assert len(launch.calls("apt")) > before


def test_a_stamp_that_another_command_writes_now_is_left_to_it(launch):
    (launch.fake / "updated").touch()
    (launch.tree / "build").mkdir()
    lock = create(launch.tree / "build/packages-run.stamp.part")
    try:
        done = launch("list")
    finally:
        os.close(lock)
    assert "list in" in done.stdout and done.returncode == 0, done.stderr


@pytest.mark.long("builds a tree of its own")
def test_two_first_commands_do_not_collide(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "during").write_text('until [ -e "$FAKE/go" ]; do sleep 0.01; done\n')
    first = launch.start("list")
    while not launch.calls("apt"):
        pass
    second = launch.start("test")
    assert second.stderr.readline() == "fledge: waiting for another fledge, which installs packages\n"
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    (launch.fake / "go").touch()
    assert "list in" in first.communicate()[0]
    out, error = second.communicate()
    assert first.returncode == second.returncode == 0, out + error
    (for_run,) = (line for line in launch.calls("apt") if " cmake, " in line)


def test_the_second_build_waits_for_the_first(launch):
    (launch.fake / "updated").touch()
    launch("setup")
    (launch.fake / "during").write_text('until [ -e "$FAKE/go" ]; do sleep 0.01; done\n')
    first = launch.start("list")
    while len(launch.calls("ninja")) < 2:
        pass
    second = launch.start("list")
    assert second.stderr.readline() == "fledge: waiting for another fledge, which builds (release)\n"
    (launch.fake / "go").touch()
    for process in (first, second):
        assert "list in" in process.communicate()[0]


@pytest.fixture
def reader(launch):
    """launch() by a user that can only read the tree, which is built."""
    (launch.fake / "updated").touch()
    launch("setup")
    (launch.fake / "installed").write_text("".join(
        f"installed {name}\n" for names in (*map(packages, ("run", "unit", "pytest", "test", "docs")),
                                            *ROOMS.values())
        for name in names))
    subprocess.run(["chmod", "-R", "a-w", launch.tree], check=True)
    (launch.fake / "ninja").chmod(0o666)
    return lambda *arguments: launch(*arguments, user=OTHER)


@pytest.mark.parametrize("words", [["list"], ["run", "x", "--report"], ["view", "x"]])
def test_a_user_with_read_access_flies_with_a_tree(launch, request, words):
    scene = launch.tree / "python/fledge/scene"
    scene.mkdir()
    (scene / "bundle.py").touch()       # the viewer is built
    done = request.getfixturevalue("reader")(*words)
    assert (done.returncode, done.stderr) == (0, "") and f"{' '.join(words)} in" in done.stdout
    assert " -n " in launch.calls("ninja")[-1]


@pytest.mark.parametrize("command", ["test", "docs"])
def test_a_command_that_must_write_refuses_a_user_with_read_access(launch, reader, command):
    done = reader(command)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1 and "this user may not" in line


@pytest.mark.skipif(os.getuid() != 0, reason="only root can be another user")
@pytest.mark.parametrize("arguments", [["list"], ["--preset", "debug", "list"]])
def test_a_user_with_read_access_reads_which_user_must_build(launch, reader, arguments):
    (launch.fake / "broken").write_text("[1/2] Building C object\n")
    done = reader(*arguments)
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1
    assert re.fullmatch(rf"fledge: {launch.tree} must be built, and this user may not write into .*/build/\w+; "
                        rf"{launch.tree.owner()} can, by the same command", line)


def test_a_tree_on_a_disk_that_cannot_be_written_must_be_copied(launch, reader):
    (launch.fake / "broken").write_text("[1/2] Building C object\n")
    if os.getuid() == 0:
        os.chown(launch.tree, 65534, 65534)     # the user of the command
    assert reader("list").stderr.endswith(f"; copy {launch.tree} to a disk that can be written\n")


# --- faults of the machine ----------------------------------------------------------------------------

LACKS = {"the disk is full": "/tmp/a.s: fatal error: closing a.d: No space left on device",
         "a process was killed": "g++: fatal error: Killed signal terminated program cc1plus",
         "the network or a server": "E: Failed to fetch http://m.example/x.deb  Connection failed [IP: 1 80]"}


@pytest.mark.parametrize("lack", LACKS)
def test_what_the_machine_lacks_is_one_line_and_the_next_try_goes_on(launch, lack):
    (launch.fake / "updated").touch()
    (launch.fake / "broken").write_text(f"[1/2] x\na.c:7:1: error: what follows from it\n{LACKS[lack]}\n")
    (line,) = launch("list").stderr.splitlines()[3:]
    assert line.startswith(f"fledge: the build failed: {lack}") and "try again" in line
    (launch.fake / "broken").unlink()
    assert launch("list").returncode == 0 and len(launch.calls("cmake")) == 1


def test_a_build_that_was_killed_says_so(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "during").write_text('case $0 in */ninja) kill -9 $$ ;; esac\n')
    assert "fledge: the build failed: a process was killed" in launch("list").stderr


def test_an_installation_without_a_network_is_one_line(launch):
    """apt-get update then only warns."""
    (launch.fake / "during").write_text(
        'case "$0 $*" in *apt-get*update) echo "W: Failed to fetch x  Temporary failure resolving m.example" ;;\n'
        '*apt-get*) echo "E: Unable to locate package g++"; exit 100 ;; esac\n')
    done = launch("list")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("fledge: apt-get satisfy failed: the network or a server does not")
    (launch.fake / "during").write_text("")
    assert launch("list").returncode == 0


def test_files_from_the_future(launch):
    """Sources would be built for ever, or Ninja would configure for ever; objects would never be built again."""
    (launch.fake / "updated").touch()
    assert launch("list").returncode == 0
    late, object_ = launch.tree / "cmake/packages.txt", launch.tree / "build/release/a.o"
    object_.touch()
    for path in (late, object_):
        os.utime(path, (time.time() + 7200,) * 2)
    done = launch("list")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"fledge: {late} is from the future: set the clock; if it is right, find ")
    subprocess.run(line.split(", ")[1], shell=True, check=True)
    assert launch("list").returncode == 0 and not object_.exists()


@pytest.mark.long("configures a tree several times")
def test_what_a_failed_configuration_found_is_forgotten(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "during").write_text('case $0 in */cmake) echo "CMake Error: no compiler"; exit 1 ;; esac\n')
    assert "CMake Error: no compiler" in launch("list").stderr
    (launch.fake / "during").write_text("")
    assert launch("list").returncode == 0
    assert launch("test", "-k", "x").args and launch.calls("cmake") == [
        "--fresh --preset release -DBUILD_TESTING=OFF"] * 2 + ["--preset release -DBUILD_TESTING=ON"]


def test_the_first_command_runs_after_an_install(launch):
    """An installation of packages changes nothing of the command after it."""
    (launch.fake / "updated").touch()
    for arguments in (["run", "nadir_spin"], ["fly", "x", "--on", "aarch64"], ["new", "module", "X"], ["bench", "sim"]):
        for stamp in (launch.tree / "build").glob("*.stamp"):
            stamp.unlink()
        (launch.fake / "installed").unlink(missing_ok=True)
        done = launch(*arguments)
        assert done.stdout.startswith(" ".join(arguments) + " in "), done.stderr


@pytest.mark.parametrize("arguments, needed, prepared", long_after(10, [
    (["setup", "--on", "leon3"], ["leon3"], ["leon3"]), (["setup"], [], []),
    (["setup", "--test"], [*ROOMS, "profile"], [""]), (["test", "--all"], [*ROOMS, "profile"], [""]),
    (["test"], [], [""]),
    (["fly", "x"], [], []), (["fly", "x", "--on", "linux", "--out", "leon3_old"], [], []),
    (["fly", "x", "--on", "linux,leon3"], ["leon3"], []), (["fly", "x", "--on=aarch64"], ["aarch64"], []),
    (["fly", "x", "--on", "a=leon3-qemu,b=leon3-cfs"], ["leon3", "leon3_qemu"], []),
    (["fly", "x", "--on", "leon3-micropython"], ["leon3", "micropython"], []),
    (["fly", "x", "--on", "a=cortex-m7,b=riscv64"], ["cortex_m7", "riscv64"], []),
    (["fly", "x", "--on", "vax"], [], []),
    (["profile", "x"], ["profile"], []), (["profile", "x", "--on", "leon3"], ["profile", "leon3"], []),
    (["verify", "x"], [], []), (["verify", "x", "--on", "desktop,leon3"], ["leon3"], []),
    (["console", "x"], ["micropython"], []), (["flips", "x"], ["leon3"], []),
    (["export", "micropython", "x"], ["micropython"], []), (["export", "c", "micropython"], [], []),
    (["bench", "flown_requirements"], ["leon3"], []), (["bench", "sim", "leon3"], [], []),
    (["plot", "runs/x/fly/micropython.mcap"], [], [])], "another command"))
def test_what_the_targets_of_a_command_need_comes_with_it(launch, arguments, needed, prepared):
    """An installed compiler, and a library that `setup` builds; other commands build it when they fly."""
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    done = launch(*arguments)
    assert done.returncode == 0, done.stderr
    lists = {room: set(names) - set(packages("test"))
             for room, names in [*ROOMS.items(), ("profile", packages("profile"))]}
    installed = {name for line in launch.calls("apt") for name in re.split("[ ,|]+", line)}
    assert installed & set().union(*lists.values()) == set().union(*(lists[target] for target in needed))
    assert launch.calls("prepared") == prepared


@pytest.mark.parametrize("words, name", [
    (["montecarlo", "x", "--scheduler", "tcp://a:1"], "python3-distributed"),
    (["exec", "dask-worker"], "python3-distributed"), (["view", "x", "--film", "x.webp"], "python3-pil"),
    (["ground", "serve", "x.toml"], "python3-aiohttp"), (["load", "ssh:a", "x"], "openssh-client"),
    (["ground", "run", "x.py", "--to", "http://a:1/sat"], "python3-aiohttp"),
    (["ground", "run", "x.py", "--to", "https://a/sat"], "python3-aiohttp")])
def test_what_an_option_needs_comes_with_it(launch, words, name):
    (launch.fake / "updated").touch()
    launch("list")
    launch("ground", "run", "x.py", "--to", "udp:a:1")
    assert not any(name in line for line in launch.calls("apt"))
    launch(*words)
    assert any(name in line for line in launch.calls("apt"))


def test_a_target_that_cannot_be_installed_does_not_stop_the_others(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "during").write_text(
        'case "$0 $*" in *apt-get*aarch64*) echo "E: Unable to locate package"; exit 100 ;; esac\n')
    done = launch("fly", "x", "--on", "aarch64,leon3")
    assert done.returncode == 0 and done.stdout.startswith("fly x --on aarch64,leon3 in "), done.stderr
    assert "fledge: apt-get satisfy failed" in done.stderr and "fledge: going on without aarch64\n" in done.stderr
    assert any("sparc" in line for line in launch.calls("apt"))      # and the next one has come
    assert launch("setup", "--on", "aarch64").returncode == 1       # a request for this target alone fails


def test_the_targets_of_a_project_say_what_they_need(launch):
    (launch.fake / "updated").touch()
    target = launch.place / "a project/targets/vax"
    target.mkdir(parents=True)
    (launch.place / "a project/CMakeLists.txt").touch()
    (target / "__init__.py").write_text("from fledge.targets.linux import Linux\n\n\nclass Vax(Linux):\n    pass\n")
    (target / "packages.txt").write_text("gcc-vax   # its compiler\n")
    done = launch("--project", launch.place / "a project", "fly", "x", "--on", "vax,linux")
    assert done.stdout.startswith("fly x --on vax,linux in "), done.stderr
    assert launch.calls("apt")[-1].endswith(" gcc-vax")


def test_commands_run_where_the_user_stands(launch):
    (launch.fake / "updated").touch()
    here = launch.place / "Müller & Söhne/a folder"
    (here / "my sat").mkdir(parents=True)
    (here / "my sat/CMakeLists.txt").touch()
    (here / "json.py").write_text("1 / 0")      # no module of Python's
    link = here / "link"
    link.symlink_to(launch.tree / "fledge")
    done = launch("run", "x", "--out", "some where", cwd=here, program=link, CDPATH="/:.")
    assert done.stdout == f"run x --out some where in {here} for \n", done.stderr
    done = launch("--project", "my sat", "list", cwd=here, program=link, CDPATH="/:.")
    assert done.stdout == f"list in {here} for {here}/my sat\n", done.stderr


# --- which project -----------------------------------------------------------------------------------

def test_a_project_is_found_around_the_folder_where_one_stands(launch):
    (launch.fake / "updated").touch()
    sat, other = launch.place / "sat", launch.place / "other"
    deep = sat / "missions/scan"
    for folder in (deep, other, launch.tree / "inner"):
        folder.mkdir(parents=True)
    (deep / "CMakeLists.txt").write_text("# fledge_project(no)\n")
    (other / "CMakeLists.txt").touch()
    for folder in (sat, launch.tree / "inner"):
        (folder / "CMakeLists.txt").write_text("project(sat)\n\nfledge_project(sat\n)\n")

    def project(*arguments, cwd, **environment):
        done = launch(*arguments, "list", cwd=cwd, **environment)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip().split(" for ")[1:]

    assert project(cwd=deep) == project(cwd=sat) == [str(sat)]
    assert project("--project", "../other", cwd=sat) == project(cwd=deep, FLEDGE_PROJECT=str(other)) == [str(other)]
    assert project("--project", "", cwd=deep) == project(cwd=deep, FLEDGE_PROJECT="") == []
    assert project(cwd=launch.place) == project(cwd=launch.tree / "inner") == []     # none; Fledge's own
    assert project(cwd=deep, HOME=str(deep)) == []                                   # the home ends the search


@pytest.mark.skipif(os.getuid() != 0, reason="only root can make files of another user")
def test_the_project_of_another_user_is_not_used_unasked(launch):
    (launch.fake / "updated").touch()
    sat = launch.place / "sat"
    sat.mkdir()
    (sat / "CMakeLists.txt").write_text("fledge_project(sat)\n")
    os.chown(sat / "CMakeLists.txt", 65534, 65534)
    done = launch("list", cwd=sat)
    assert done.returncode == 1 and f"fledge: the project {sat} belongs to another user" in done.stderr
    assert launch("--project", ".", "list", cwd=sat).returncode == 0


# --- builds that a debugger likes --------------------------------------------------------------------

@pytest.mark.parametrize("arguments, environment", [
    (["setup", "--preset", "debug"], {}), (["--preset", "debug", "exec", "/bin/true"], {}),
    (["exec", "/bin/true"], {"FLEDGE_PRESET": "debug"})])
def test_one_command_makes_the_debug_build(launch, arguments, environment):
    (launch.fake / "updated").touch()
    done = launch(*arguments, **environment)
    assert done.returncode == 0, done.stderr
    assert launch.calls("cmake") == ["--fresh --preset debug -DBUILD_TESTING=OFF"]


# --- Ctrl-C ------------------------------------------------------------------------------------------

@pytest.mark.parametrize("tool", ["apt-get", "cmake", "ninja"])
def test_ctrl_c_ends_an_install_and_a_build_and_breaks_nothing(launch, tool):
    (launch.fake / "updated").touch()
    (launch.fake / "during").write_text(f'case $0 in */{tool}) trap "" INT; kill -INT 0; exit 2 ;; esac\n')
    done = launch("list")
    assert done.returncode == 130 and "failed" not in done.stderr and done.stdout == ""
    (launch.fake / "during").write_text("")
    done = launch("list")
    assert done.returncode == 0 and "list in" in done.stdout


def test_an_interrupted_installation_of_packages_is_completed(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "during").write_text(
        'case $0 in */apt-get) [ -e "$FAKE/configured" ] || {\n'
        'echo "E: dpkg was interrupted, you must manually run \'dpkg --configure -a\' to correct the problem."\n'
        'exit 100; } ;; esac\n')
    dpkg = launch.place / "bin/dpkg"
    dpkg.write_text('#!/bin/sh\n[ "$*" = "--configure -a" ] && : > "$FAKE/configured"\n')
    dpkg.chmod(0o755)
    done = launch("setup")
    assert done.returncode == 0, done.stderr
    assert "completing an interrupted installation of packages" in done.stderr


INTERRUPTS = """
import os, signal, sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == os.environ["INTERRUPTS"]:
            os.kill(os.getpid(), signal.SIGINT)

if os.environ["INTERRUPTS"] == "sitecustomize":
    Finder().find_spec("sitecustomize")
sys.meta_path.insert(0, Finder())
"""


@pytest.mark.parametrize("module", ["sitecustomize", "fledge", "argparse", "fledge.cli", "fledge.cli.compare",
                                    "fledge.mission", "numpy", "numpy.lib"])
def test_ctrl_c_while_python_starts_leaves_no_traceback(tmp_path, module):
    (tmp_path / "sitecustomize.py").write_text(INTERRUPTS)
    (tmp_path / "m").mkdir()
    (tmp_path / "m/flight.py").write_text("import numpy\ndef build(f):\n    pass\n")
    done = subprocess.run([ROOT / "fledge", "run", "m", "--for", "1s"], capture_output=True, text=True, cwd=tmp_path,
                          env={**os.environ, "PYTHONPATH": str(tmp_path), "INTERRUPTS": module})
    assert done.returncode in (130, -2), done.stderr
    lines = [line for line in done.stderr.splitlines() if "waiting for another fledge" not in line]  # a test beside it
    assert lines in ([], ["fledge: interrupted"])


COMMANDS = list(next(a.choices for a in parser()._actions if a.dest == "command"))


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(command):
    done = subprocess.run([ROOT / "fledge", command, "--help"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"fledge {command}" in done.stdout and "example" in done.stdout.lower()


def test_a_command_begins_without_what_only_some_need():
    program = ("import sys\nfrom fledge.launcher.parser import parser\nparser()\n"
               "print([name for name in ('typing', 'dataclasses', 'numpy', 'fledge.archive') if name in sys.modules])")
    done = subprocess.run(["/usr/bin/python3", "-S", "-c", program], capture_output=True, text=True)
    assert done.stdout == "[]\n", done.stderr


def test_help_lists_each_command():
    usage = subprocess.run([ROOT / "fledge", "help"], capture_output=True, text=True).stdout
    listed = dict(re.findall(r"^  (\w+) .{,20}?  +(.*)", usage, re.M))
    assert set(listed) == {*COMMANDS, "help"}


def test_help_of_a_command_is_what_the_command_says():
    for words in (["setup"], ["run"], ["keys", "new"]):
        by_help, by_option = (subprocess.run([ROOT / "fledge", *command], capture_output=True, text=True)
                              for command in (["help", *words], [*words, "--help"]))
        assert (by_help.returncode, by_help.stdout) == (0, by_option.stdout) and words[0] in by_option.stdout


def test_it_prints_the_version():
    done = subprocess.run([ROOT / "fledge", "--version"], capture_output=True, text=True)
    assert done.stdout == f"fledge {fledge.__version__}\n"


@pytest.mark.long("runs ./fledge test in a tree of its own")
def test_tests_have_default_signals_in_the_background_of_a_script(launch):
    (launch.fake / "updated").touch()
    (launch.fake / "status").write_text("0")
    (launch.fake / "report").write_text(report(0))
    done = launch("test", user=["/usr/bin/env", "--ignore-signal=INT,QUIT"])
    assert done.returncode == 0, done.stderr
    assert int(launch.calls("ignored")[0].split()[1], 16) & (1 << signal.SIGINT - 1 | 1 << signal.SIGQUIT - 1) == 0


def test_no_file_takes_the_place_of_a_standard_stream_that_is_closed(launch):
    (launch.fake / "updated").touch()
    done = launch("exec", "/bin/sh", "-c", "echo; readlink /proc/$$/fd/0 /proc/$$/fd/2 > $FAKE/streams",
                  user=["/bin/sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh"])
    assert (done.returncode, launch.calls("streams")) == (0, ["/dev/null"] * 2)


def test_asserts_count_whatever_the_environment_says(launch):
    """The launcher, and all that it starts, has Python's asserts."""
    (launch.tree / "python/fledge/launcher/__main__.py").write_text(
        "import os, sys\nassert 1 == 2, f'{sys.flags.optimize} {os.environ.get(\"PYTHONOPTIMIZE\")}'\n")
    done = launch("run", "nadir_spin", PYTHONOPTIMIZE="1")
    assert done.returncode == 1 and done.stderr.endswith("AssertionError: 0 None\n")


def test_exec_finds_the_python_that_the_extension_is_built_for(launch):
    (launch.fake / "updated").touch()
    assert launch("exec", "/bin/sh", "-c", "echo $PATH").stdout.startswith("/usr/bin:")


@pytest.mark.parametrize("tool, packages, message", [
    ("ipython4", "ipython4 - a shell", "exec: ipython4 is not installed; as root, run: apt-get install ipython4"),
    ("pytest4", "python3-pytest4 - tests", "as root, run: apt-get install python3-pytest4"),
    ("a.b+", "", "exec: a.b+ is not installed, and no Debian package has its name: try 'apt-file search bin/a.b+'"),
    ("./tool", "tool - x", "exec: there is no program ./tool")])
def test_exec_names_the_package_of_a_tool_that_is_not_installed(launch, tool, packages, message):
    (launch.fake / "updated").touch()
    apt = launch.place / "bin/apt-cache"
    apt.write_text(f"#!/bin/sh\necho \"$*\" >> \"$FAKE/apt-cache\"\necho '{packages}'\n")
    apt.chmod(0o755)
    done = launch("exec", tool)
    assert done.returncode == 127 and message in done.stderr.splitlines()[-1]
    pattern = {"a.b+": "a\\.b\\+"}.get(tool, tool)
    assert launch.calls("apt-cache") in ([], [f"search --names-only ^(python3-)?{pattern}3?$"])
    assert launch.calls("ninja") == []       # nothing is built first


@pytest.mark.parametrize("arguments", [["test", "--bogus"], ["setup", "--bogus"], ["demo", "now"], ["test", "-k"],
                                       ["test", "--share", "x"], ["test", "-k", "x", "--changed"], ["exec"],
                                       ["package", "--bogus"], ["package", "--out"], ["--preset", "debug", "package"],
                                       ["fly", "--on", "leon3"], ["run", "x", "--bogus"], ["--project"]])
def test_a_wrong_command_line_is_refused_before_anything_is_installed(launch, arguments):
    done = launch(*arguments)
    assert done.returncode == 2 and done.stderr.startswith("fledge") and launch.calls("apt") == []


def test_an_unknown_command_is_refused(launch):
    done = launch("hover")
    assert done.returncode == 2
    assert done.stderr == "fledge: unknown command 'hover'; './fledge help' lists all\n"


# --- completion --------------------------------------------------------------------------------------

# Scripts that print the completions of a command line.
SHELLS = {
    "bash": """source {script}
               COMP_LINE="$1" COMP_POINT=${{#1}}
               _fledge && printf '%s\\n' "${{COMPREPLY[@]}}" """,
    "zsh": """compdef() {{ :; }}; compadd() {{ shift; print -l -- "$@"; }}; _files() {{ :; }}
              source {script}
              words=("${{(@s: :)1}}") CURRENT=${{#words}}
              _fledge """,
}


@pytest.fixture(params=long_after(1, SHELLS, "another shell"))
def complete(request, tmp_path):
    """complete(line) -> the completions of the shell at its end, in a folder with a project and runs."""
    skip_without(request.param)
    (tmp_path / "CMakeLists.txt").write_text("fledge_project(sat)\n")
    (tmp_path / "missions/first_scan").mkdir(parents=True)
    (tmp_path / "missions/first_scan/flight.py").touch()
    (tmp_path / "missions/first_scan/scenarios.py").write_text(
        "import x\ndef acquire(sim): pass\ndef _part(sim): pass\ndef both(a, b): pass\n")
    for run in ("scan/free/run.mcap", "two/a/run.mcap", "two/b/run.mcap", "fly/fly/cfs.mcap", "fly/fly/linux.mcap",
                "fly/a/run.mcap", "kept/best/run.mcap", "kept/best/run.scene.mcap"):
        (tmp_path / "runs" / run).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "runs" / run).touch()
    script = SHELLS[request.param].format(script=ROOT / "python/fledge/launcher/completion.sh")

    def offered(line):
        done = subprocess.run([request.param, "-c", script, request.param, line], cwd=tmp_path, text=True,
                              capture_output=True, check=True, env={"PATH": f"{ROOT}:/usr/bin:/bin"})
        assert done.stderr == ""
        return done.stdout.split()

    yield offered
    assert not (tmp_path / "build").exists()        # nothing is built


def test_the_shell_completes_commands_and_their_arguments(complete):
    assert complete("fledge ") == sorted([*COMMANDS, "help"]) == complete("fledge help ")
    assert complete("fledge mo") == ["montecarlo"]
    assert complete("fledge run --s") == ["--seed", "--set", "--stop", "--strict"]
    assert complete("fledge setup --o") == complete("fledge --preset debug setup --o") == ["--on"]
    assert complete("fledge setup --v") == ["--view"]       # of the second line of its usage
    assert complete("fledge --preset r") == complete("fledge test --preset r") == ["release"]
    assert complete("fledge keys new --") == ["--help", "--keys"]
    assert complete("fledge new mo") == ["model", "module"]
    assert complete("fledge new module X --kind d") == ["determination"]
    assert complete("fledge bench cosim_") == ["cosim_scaling"]


def test_the_shell_completes_missions_scenarios_runs_and_targets(complete):
    assert complete("fledge run f") == ["first_scan", "flatsat", "flyby", "formation"]
    assert complete("fledge run first_scan ") == complete("fledge run --seed 3 first_scan ") == ["acquire"]
    assert complete("fledge --project /nowhere run f") == []
    assert complete("fledge new mission X --from fl") == ["flatsat", "flyby"]
    assert complete("fledge new module X --from fl") == []      # a file
    assert complete("fledge montecarlo nadir_spin --campaign ") == ["release"]
    assert complete("fledge plot ") == complete("fledge compare scan ") == [
        "best", "runs/fly/a", "runs/fly/fly/cfs.mcap", "runs/fly/fly/linux.mcap", "runs/two/a", "runs/two/b", "scan"]
    assert complete("fledge fly nadir_spin --on desktop,li") == ["desktop,linux"]
    assert complete("fledge setup --on leon3-q") == ["leon3-qemu"]
    assert complete("fledge run first_scan --out ") == []       # the shell's files


def test_completion_begins_without_what_would_delay_it():
    program = ("import sys; sys.path.insert(0, 'python'); from fledge.launcher import completion\n"
               "assert completion.offers(['run', 'nadir_spin', 's']) == ['spin']\n"
               "print([name for name in ('typing', 'numpy', '_core', 'subprocess') if name in sys.modules])")
    done = subprocess.run(["/usr/bin/python3", "-S", "-c", program], capture_output=True, text=True, cwd=ROOT)
    assert done.stdout == "[]\n", done.stderr


def test_the_launcher_is_plain_posix():
    assert os.access(ROOT / "fledge", os.X_OK)
    assert subprocess.run(["/bin/sh", "-n", ROOT / "fledge"]).returncode == 0
