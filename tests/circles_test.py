# SPDX-License-Identifier: Apache-2.0
"""A test that is marked long has a reason, and its folder has a shorter test that each run includes."""

import re
import subprocess
import sys

import pytest

from tests import circles
from tests.tree import ROOT, files


def test_each_folder_with_a_long_test_has_a_quick_one(collected):
    cases = [circles.case(item) for item in collected]
    quick = {case.folder for case in cases if case.why is None}
    collected_files = {item.path.relative_to(ROOT) for item in collected}
    partly = {str(path.parent) for path in files() if path.name.endswith("_test.py") and path not in collected_files}
    assert {case.folder for case in cases if case.why is not None} - quick - partly == set()


def run(tmp_path, text, *options):
    """(exit code, output) of a file with tests, under this tree's settings."""
    (tmp_path / "some_test.py").write_text(f"import pytest\n\n\n{text}")
    done = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", ROOT, "-c",
                           ROOT / "pytest.ini", "--confcutdir", ROOT, "-p", "conftest", *options, tmp_path],
                          cwd=ROOT, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_a_long_test_without_a_reason_is_refused(tmp_path):
    for mark in ("long", "long()", 'long(" ")', "long(3)"):
        code, output = run(tmp_path, f"@pytest.mark.{mark}\ndef test_it():\n    pass\n")
        assert code == 4 and 'is marked long without a reason: @pytest.mark.long("200 flights")' in output, mark


@pytest.mark.long("starts pytest six times")
def test_the_shares_of_the_long_tests_are_all_of_them(tmp_path):
    text = '@pytest.mark.long("20")\n@pytest.mark.parametrize("n", range(20))\ndef test_it(n):\n    pass\n' \
        '@pytest.mark.long("an hour", share=False)\ndef test_hour():\n    pass\n' \
        "def test_quick():\n    pass\n"

    def passed(wanted):
        code, output = run(tmp_path, text, "--long", wanted, "-rp")
        assert code == 0, output
        return {line.rpartition("::")[2] for line in output.splitlines() if line.startswith("PASSED")}

    shares = [passed(f"{i}/3") for i in range(3)]
    assert all("test_quick" in share and len(share) > 2 for share in shares)
    assert sum(len(share) - 1 for share in shares) == 20
    assert passed("all") - set.union(*shares) == {"test_hour"}
    assert passed("none") == {"test_quick"}
    code, output = run(tmp_path, text, "--long", "some")
    assert code == 4 and "--long takes all, none or I/N, such as 0/5; found some" in output


def test_the_reports_have_the_set_ups_of_cases_and_rooms_have_their_sums(tmp_path):
    text = '@pytest.fixture(scope="module")\ndef slow():\n    time.sleep(0.2)\n\n\n' \
        'def test_first(slow):\n    time.sleep(0.1)\n\n\ndef test_second(slow):\n    pass\n\n\n' \
        '@pytest.mark.long("sleeps")\ndef test_long():\n    time.sleep(0.3)\n'
    (tmp_path / "pytest").mkdir()
    code, output = run(tmp_path, "import time\n\n\n" + text, "--junit-xml", tmp_path / "pytest/pytest.xml")
    assert code == 0, output
    times = {name.partition("::")[2]: time for name, time in circles.seconds(tmp_path / "pytest/pytest.xml").items()}
    first, second, long = (times[f"test_{name}"] for name in ("first", "second", "long"))
    assert first.setup >= 0.2 and first.whole >= first.setup + 0.09 and long.long and long.whole >= 0.3
    assert second.setup < first.setup
    (room, (cpp, python)), = circles.by_room(tmp_path).items()
    assert cpp == 0 and python == pytest.approx(first.whole + second.whole, abs=0.05)
    assert len(circles.slowest(times, 2).splitlines()) == 3


@pytest.mark.parametrize("name, room", [
    ("flight.math.vec_test", "flight"), ("ground.python.server.api_test", "ground"),
    ("python.fledge.mission.log_test", "python/fledge/mission"),
    ("python.fledge.units_test", "python/fledge"), ("tests.docs_test::test_it[a.b]", "tests")])
def test_a_case_belongs_to_a_room(name, room):
    assert circles.room_of(name.partition("::")[0]) == room


def test_the_others_are_named_with_their_seconds():
    rooms = {"flight": [40.0, 2.0], "world": [60.0, 6.0], "python/fledge/mission": [0.0, 90.0]}
    line = circles.others(["flight"], rooms)
    assert "python/fledge/mission 90 s, world 66 s" in line and "flight " not in line.replace("fledge: ", "")
    assert "mission" not in circles.others(["flight", "python"], rooms)
    assert "is not known here yet: ./fledge test" in circles.others(["flight"], {"flight": [1.0, 1.0]})


def test_passes_are_kept_and_what_none_of_them_ran_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(circles, "PASSED", tmp_path / "passed")
    monkeypatch.setattr(circles, "BUILD", tmp_path)
    monkeypatch.setattr(circles, "KEPT", tmp_path / "seconds.json")
    cases = [circles.Case("a", f"a_test::test_{i}", "it is long", i % 10) for i in range(30)]
    never = circles.Case("a", "a_test::test_hour", "an hour", None)
    circles.keep({"tests": [1.2, 3.4]})
    for i in range(12):
        circles.add_pass(f"{i:040x}", str(i % 10), "sanitizers, decisions, in 28 min")
    shares = [share for _, share, _ in circles.passes()]
    assert shares == ["1", "0", "9", "8", "7", "6", "5", "4", "3", "2"]
    assert circles.kept() == {"tests": [1.2, 3.4]} and "\ntests 1 3\n" in (tmp_path / "passed").read_text()
    assert circles.missed(cases, shares) == "fledge: each long test has run in one of the last 10 passes\n"
    assert "ran: the 3 of the tenth 9; those that are in no share, for which CI has no time: a_test::test_hour" in (
        circles.missed([*cases, never], [share for share in shares if share != "9"]))
    assert "each long test has run" in circles.missed([*cases, never], [*shares[:3], "all"])
    (tmp_path / "seconds.json").write_text('{"tests": [')       # its writer was killed
    circles.add_pass("f" * 40, "all", "1")
    assert circles.kept() == {"tests": [1.0, 3.0]}


def test_the_last_pass_says_what_is_due(tmp_path, monkeypatch):
    monkeypatch.setattr(circles, "PASSED", tmp_path / "passed")
    assert circles.last() == "none -1 9"
    for commit, share, what, line in (("a", "2", "sanitizers systems, in 40 min", "2 0"),
                                      ("b", "3", "sanitizers", "3 1"), ("c", "all", "by hand", "3 2")):
        circles.add_pass(commit * 40, share, what)
        assert circles.last() == f"{commit * 40} {line}"


def test_what_is_skipped_for_want_of_a_package_is_summed_and_may_fail(tmp_path):
    text = "from tests.needs import needs\n\n\n@needs('gcc-vax', 'python3')\ndef test_it():\n    pass\n\n\n" \
        "@needs('gcc-vax')\ndef test_too():\n    pass\n\n\ndef test_other():\n    pytest.skip('no network')\n"
    for options, wanted in (([], 0), (["--complete"], 1)):
        code, output = run(tmp_path, text, *options)
        assert code == wanted and re.search(
            "not installed, and .* skipped for it: gcc-vax 2[;,].* ./fledge set", output)
    other = "from tests import needs\n\nneeds.reason_on = lambda target: '{}'\n\n\n" \
        "def test_other():\n    pytest.skip('{}')\n"
    for why, of_targets, code, line in (
            ("no network", "", 0, ""),
            ("the pages are not built", "", 1, "not built, and tests that were skipped for it: pages 1"),
            ("no network", "not installed: vax", 1, "not installed, and tests that were skipped for it: vax 0")):
        found, output = run(tmp_path, other.format(of_targets, why), "--complete")
        assert found == code and line in output and ("skipped for it" in output) == bool(line)
