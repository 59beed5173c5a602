# SPDX-License-Identifier: Apache-2.0
"""A test that is marked long has a reason, and its folder has a shorter test that each run includes."""

import subprocess
import sys

import pytest

from tests import circles
from tests.tree import ROOT, files


def test_each_folder_with_a_long_test_has_a_quick_one(collected):
    cases = [circles.case(item) for item in collected]
    print(circles.table(cases, circles.seconds(circles.REPORT)))
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
