# SPDX-License-Identifier: Apache-2.0
"""`./fledge test --changed` chooses the tests that a change can reach: examples of this tree, against what the compiler
reads, and repositories of git that the tests make."""

import os
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests import changed
from tests.tree import ROOT, files

BUILD = ROOT / "build" / os.environ.get("FLEDGE_PRESET", "release")
CHECKS = {"tests/hygiene_test.py", "tests/include_direction_test.py"}


def near(*paths):
    """(suites of C++, tests in Python)"""
    reached = changed.closure(paths)
    _, cases = changed.programs_and_cases(reached, BUILD)
    return set(cases), changed.python_tests(list(paths), reached)


@pytest.mark.long("looks through all missions")
def test_of_a_flight_module_its_own_test_and_the_smallest_users_are_chosen():
    cases, paths = near("flight/control/mrp_feedback.c")
    assert "MrpFeedback.*" in cases and len(cases) < 6
    rest = paths - CHECKS
    assert "missions/asterisk_scan/asterisk_scan_test.py" in rest and len(rest) == 2 * changed.USERS
    assert all(re.search(r"MrpFeedback", (ROOT / path).with_name("flight.py").read_text()) for path in rest
               if path.startswith("missions/"))
    assert near("flight/control/mrp_feedback.h") == (cases, paths)


@pytest.mark.long("looks through all missions")
def test_a_message_reaches_the_modules_that_take_it_and_their_missions():
    cases, paths = near("flight/msg/rate.h")
    assert cases >= {"MrpSteering.*", "RateServo.*"} and len(cases) < 10
    assert any(path.startswith("missions/") for path in paths) and len(paths - CHECKS) <= 2 * changed.USERS


def test_a_world_model_reaches_the_missions_that_wire_it():
    cases, paths = near("world/dynamics/drag_model.cpp")
    assert "Drag.*" in cases and "missions/check_cases/check_cases_test.py" in paths
    assert changed.reach(["world/dynamics/drag_model.cpp"]) > paths


def test_the_reach_has_all_users_of_a_module():
    users = {str(path.parent) for path in files() if path.parts[0] == "missions" and path.name == "flight.py"
             and "fsw.MrpFeedback(" in (ROOT / path).read_text(encoding="utf-8")}
    users_found = changed.of_modules({"mrpfeedback"}, wide=True)
    assert len(users) > 10 and users <= {os.path.dirname(path) for path in users_found}


def test_the_kernel_reaches_all_that_uses_it():
    cases, paths = near("sim/runtime.cpp")
    assert cases >= {"Schedule.*", "Drag.*"} and not cases & {"MrpFeedback.*", "Interpreter.*"}
    assert paths >= {"missions/nadir_spin/nadir_spin_test.py", "python/fledge/mission/mission_test.py"}
    assert not [path for path in paths if path.startswith("introspect/")]


def test_a_mission_reaches_its_own_tests_and_those_that_name_it():
    cases, paths = near("missions/earth_imager/displays/imager.json")
    assert not cases and "missions/earth_imager/earth_imager_test.py" in paths
    named = {str(path) for path in files() if path.name.endswith("_test.py")
             and re.search(r"""["']earth_imager["']""", (ROOT / path).read_text(encoding="utf-8"))}
    assert named <= paths and "missions/nadir_spin/nadir_spin_test.py" not in paths


@pytest.mark.parametrize("path, cases, least, never", [
    ("docs/guide.md", set(), {"tests/docs_test.py::test_the_guide_shows_what_fledge_prints", "tests/links_test.py",
                              "tests/hygiene_test.py"}, "tests/docs_test.py"),
    ("python/fledge/units.py", set(), {"python/fledge/units_test.py", *CHECKS}, "tests/links_test.py"),
    ("python/fledge/elements.py", set(), {"emulator/python/emulator_test.py", *CHECKS}, "tests/links_test.py"),
    ("python/fledge/units_test.py", set(), {"python/fledge/units_test.py"}, "python/fledge/errors_test.py"),
    ("studies/cli/faults.py", set(), {"python/fledge/cli/check_test.py", "studies/analysis/faults_test.py"},
     "tests/links_test.py"),
    ("targets/leon3/flight.c", set(), {"targets/leon3/leon3_test.py"}, "targets/linux/linux_test.py"),
    ("cosim/bindings/python/fledge_node.py", set(), {"cosim/bindings/python/fledge_node_test.py"},
     "python/fledge/units_test.py"),
    ("flight/CMakeLists.txt", set(), {"tests/collection_test.py"}, "tests/links_test.py"),
    ("fledge", set(), {"tests/launcher_test.py"}, "python/fledge/units_test.py"),
])
def test_what_a_file_chooses(path, cases, least, never):
    suites, paths = near(path)
    assert (ROOT / path).exists() and suites == cases and least <= paths and never not in paths


def test_a_file_that_nothing_uses_chooses_only_what_holds_for_every_file():
    assert near("LICENSE") == (set(), {"tests/hygiene_test.py"}) == (set(), changed.reach(["LICENSE"]))


@pytest.mark.parametrize("path, least, never", [
    ("python/fledge/report/run.py", "ground/server/api_test.py", "python/fledge/mission/feed_test.py"),
    ("cosim/router/router.cpp", "studies/verify/verify_test.py", "python/fledge/mission/feed_test.py"),
    ("missions/flyby/world.py", "tests/cosim_missions_test.py", "missions/flatsat/flatsat_test.py"),
    ("flight/math/trig.c", "python/fledge/units_test.py", "introspect/units_test.py"),
    ("docs/guide.md", "tests/links_test.py", "python/fledge/units_test.py"),
])
def test_the_reach_follows_the_tables(path, least, never):
    reached = changed.reach([path])
    assert least in reached and never not in reached and (ROOT / never).exists()


def reached_by(monkeypatch, capsys, changes, *words):
    """What `--reach` prints: the programs, and the tests in Python."""
    monkeypatch.setattr(changed, "changed_files", lambda root, base: changes)
    monkeypatch.setattr(sys, "argv", ["changed", "--reach", *words, "BASE"])
    changed.main()
    programs, tests = capsys.readouterr().out.splitlines()
    return programs.split(), tests.split()


def test_the_reach_in_c_and_cpp_has_programs_and_a_share_of_the_others(monkeypatch, capsys):
    every = {program for program, _ in changed.programs_of(changed.build_of_programs())}
    own, tests = reached_by(monkeypatch, capsys, ["ccsds/space_packet.c"])
    assert "ccsds_test" in own and set(own) < every and "tests/hygiene_test.py" in tests
    shares = [reached_by(monkeypatch, capsys, ["ccsds/space_packet.c"], "--turn", f"{i}/10")[0] for i in range(10)]
    assert all(set(own) <= set(share) for share in shares) and set().union(*shares) == every
    assert sum(len(set(share) - set(own)) for share in shares) == len(every - set(own))
    assert reached_by(monkeypatch, capsys, [], "--turn", "0/1")[0] == sorted(every)
    for path in ("introspect/emit/tables.py", "registers/CMakeLists.txt", "CMakeLists.txt"):
        assert reached_by(monkeypatch, capsys, [path])[0] == ["tests"]
    assert reached_by(monkeypatch, capsys, ["introspect/emit/emit_test.py"])[0] == []


def test_by_turns_python_has_the_near_tests_and_a_share_of_the_others(monkeypatch, capsys):
    change = ["sim/archive_file.cpp"]
    _, every = reached_by(monkeypatch, capsys, change)
    shares = [set(reached_by(monkeypatch, capsys, change, "--turn", f"{i}/10")[1]) for i in range(10)]
    near = set.intersection(*shares)
    assert set().union(*shares) == set(changed.tests()) > near and "missions/nadir_spin/nadir_spin_test.py" not in near
    assert all(len(share) < len(every) / 2 for share in shares) and "missions/check_cases/check_cases_test.py" in near
    assert near & set(reached_by(monkeypatch, capsys, [], "--turn", "0/1")[1]) == near      # nothing has changed


@pytest.mark.parametrize("path, least, never", [
    ("world/CMakeLists.txt", {"world_dynamics_test", "world_environment_test"}, "ccsds_test"),
    ("emulator/translator/emitter_memory.cpp", {"emulator_translator_test"}, "ccsds_test"),     # without a header
    ("targets/cfs/sb.c", {"pocket_cfe_test"}, "targets_test"),
    ("cosim/node/observer.cpp", {"cosim_node_test"}, "ccsds_test")])
def test_a_source_reaches_the_programs_of_its_folder_that_link_it(path, least, never, monkeypatch, capsys):
    programs, _ = reached_by(monkeypatch, capsys, [path])
    assert least <= set(programs) and never not in programs


def test_each_source_that_a_program_links_reaches_one():
    build = changed.build_of_programs()
    linked = set().union(*changed.linked(build).values())
    sources = [path for path in map(str, files()) if path in linked and Path(path).suffix in changed.C_SUFFIXES]
    assert len(sources) > 50        # those of one object for a folder are known when that is compiled
    assert [path for path in sources if not changed.programs_reached([path], build)] == []


def test_each_source_of_the_product_that_no_program_reaches_has_tests_in_python_near_it():
    build, checks = changed.build_of_programs(), {"tests/hygiene_test.py", *changed.CHECKS.values()}
    checked = 0
    for path in map(str, files()):
        if Path(path).suffix in changed.C_SUFFIXES and path.startswith(("fmi/", "cosim/", "emulator/", "targets/l")) \
                and not changed.is_test(Path(path)) and not changed.programs_reached([path], build) \
                and path != "targets/leon3_qemu/qemu.c":
            checked += 1
            assert changed.python_tests([path], {path}) - checks, path
    assert checked > 10


HEADERS = ["flight/control/mrp_feedback.h", "flight/msg/attitude.h", "world/dynamics/drag.h", "sim/runtime.h",
           "flight/math/vec.h", "cosim/protocol/protocol.h"]


@pytest.mark.long("the compiler lists headers of many sources")
def test_each_test_whose_headers_the_compiler_finds_changed_is_chosen():
    """The compiler's list of the headers of some sources of tests, drawn by a seed."""
    tests = sorted(str(path) for path in files() if path.name.endswith("_test.cpp")
                   and path.parts[0] in ("flight", "world", "sim", "cosim"))
    closures = {header: changed.closure([header]) for header in HEADERS}
    checked = 0
    for source in random.Random(1).sample(tests, 20):
        command = ["g++", "-std=c++20", "-MM", "-I.", "-isystem", "/usr/include/eigen3", source]
        printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for header in {*HEADERS} & {*printed.split()}:
            checked += 1
            assert source in closures[header]
    assert checked >= 10


def test_every_test_of_c_and_cpp_has_suites_and_a_program_that_ninja_knows():
    sources = {str(path) for path in files() if path.name.endswith(("_test.cpp", "_test.c"))
               and not str(path).startswith(changed.TEMPLATES)}
    assert [source for source in sources if not changed.programs_and_cases({source}, BUILD)[1]] == []
    if (BUILD / "tests.txt").exists():
        programs, _ = changed.programs_and_cases(sources, BUILD)
        assert "tests" not in programs and len(programs) > 10


def test_a_program_that_the_build_does_not_know_is_found_by_building_all(tmp_path):
    source = "flight/control/mrp_feedback_test.cpp"
    assert changed.programs_and_cases({source}, tmp_path) == ({"tests"}, ["MrpFeedback.*"])
    (tmp_path / "tests.txt").write_text(f"one a_test.cpp\ntwo b_test.cpp flight/x/../control/{source[15:]}\n")
    assert changed.programs_and_cases({source}, tmp_path) == ({"two"}, ["MrpFeedback.*"])


# --- git -------------------------------------------------------------------------------------------

@pytest.fixture
def repository(tmp_path, monkeypatch):
    """(folder, git): a repository whose branch main has two commits, of the files a and b."""
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))

    def git(*words):
        subprocess.run(["git", "-c", "user.name=n", "-c", "user.email=e", *words], cwd=tmp_path, check=True,
                       capture_output=True)

    git("init", "-q", "-b", "main")
    for name in "ab":
        (tmp_path / name).write_text("1\n")
        git("add", name)
        git("commit", "-qm", name)
    return tmp_path, git


def test_the_base_is_where_the_branch_began_or_the_last_commit(repository):
    folder, git = repository
    assert changed.changed_files(folder) == ["b"]                       # main, and a clean tree
    (folder / "a").write_text("2\n")
    (folder / "a new one").write_text("")
    assert changed.changed_files(folder) == ["a", "a new one"]          # uncommitted and untracked
    git("switch", "-qc", "work")
    git("add", ".")
    git("commit", "-qm", "work")
    git("mv", "b", "c")
    assert changed.changed_files(folder) == ["a", "a new one", "b", "c"]
    assert changed.changed_files(folder, "HEAD") == ["b", "c"]
    git("switch", "-q", "main")
    git("commit", "-qm", "moved")
    (folder / "d").write_text("")
    git("add", "d")
    git("commit", "-qm", "d")
    git("switch", "-q", "work")
    assert changed.changed_files(folder, "main") == ["a", "a new one"]      # not what main did meanwhile


def test_without_git_or_with_a_wrong_base_one_line_says_so(repository, monkeypatch, tmp_path_factory):
    folder, _ = repository
    for base in ("nothing", "-x", ""):
        with pytest.raises(changed.Failure, match=f"git knows no commit '{base}'"):
            changed.changed_files(folder, base)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", "/")
    with pytest.raises(changed.Failure, match="needs a repository of git"):
        changed.changed_files(tmp_path_factory.mktemp("empty"))
    monkeypatch.setenv("PATH", "")
    with pytest.raises(changed.Failure, match="not installed"):
        changed.changed_files(folder)


@pytest.mark.long("starts the program several times")
def test_the_program_prints_three_lines_or_one_of_error():
    def run(*words):
        return subprocess.run([sys.executable, "-P", "-m", "tests.changed", *words], cwd=ROOT, capture_output=True,
                              text=True, env={**os.environ, "PYTHONPATH": str(ROOT)})

    done = run("nothing")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    if changed.git(ROOT, "rev-parse", "HEAD"):
        done = run()
        assert done.returncode == 0 and done.stdout.count("\n") in (0, 3), done.stderr
