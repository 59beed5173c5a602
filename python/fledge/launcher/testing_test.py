# SPDX-License-Identifier: Apache-2.0
from fledge.launcher.testing import tally


def test_the_cases_of_a_program_of_googletest_count_and_a_crashed_one_counts_once(tmp_path):
    (tmp_path / "ctest.xml").write_text(
        '<testsuite name="x"><testcase name="a"><failure/></testcase><testcase name="b"><failure/></testcase>'
        '<testcase name="c"/></testsuite>')
    (tmp_path / "a.xml").write_text(
        '<testsuites><testsuite><testcase name="one"/><testcase name="two"><failure/></testcase>'
        '<testcase name="three"><skipped/></testcase><testcase name="four" status="notrun"/></testsuite>'
        '</testsuites>')
    (tmp_path / "b.xml").touch()        # it did not live to write it
    assert tally(tmp_path, 8) == [2, 2, 2]
