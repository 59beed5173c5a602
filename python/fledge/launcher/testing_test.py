# SPDX-License-Identifier: Apache-2.0
from fledge.launcher.testing import not_installed, tally


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


def test_a_report_that_cannot_be_read_counts_as_a_failure_and_the_others_count(tmp_path, capsys):
    (tmp_path / "a.xml").write_text('<testsuites><testcase name="one"/></testsuites></testsuites>')
    (tmp_path / "b.xml").write_text('<testsuites><testcase name="one"/><testcase name="two"/></testsuites>')
    assert tally(tmp_path, 0) == [2, 1, 0]
    assert "a.xml cannot be read: not well-formed" in capsys.readouterr().err


def test_cases_that_want_a_package_are_counted_by_it(tmp_path):
    (tmp_path / "ctest.xml").write_text(
        '<testsuite><testcase name="a" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/>'
        '<system-out>not installed: clang, qemu-user\n</system-out></testcase>'
        '<testcase name="b"><system-out>not installed: of no case that was skipped</system-out></testcase></testsuite>')
    (tmp_path / "b.xml").write_text(
        '<testsuites><testsuite><testcase name="two" status="run" result="skipped">'
        '<skipped message="a_test.cpp:40&#x0A;not installed: tshark">'
        '<![CDATA[a_test.cpp:40\nnot installed: tshark]]></skipped></testcase>'
        '<testcase name="three"><skipped message="a_test.cpp:9&#x0A;not now"/></testcase></testsuite></testsuites>')
    (tmp_path / "c.xml").write_text("<testsuites>")
    assert not_installed(tmp_path) == {"clang": 1, "qemu-user": 1, "tshark": 1}
