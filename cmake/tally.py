# SPDX-License-Identifier: Apache-2.0
"""Count the cases in the reports of tests: tally.py FOLDER STATUS prints "PASSED FAILED SKIPPED".

FOLDER holds reports in JUnit's format: ctest.xml or pytest.xml, and one of each program of GoogleTest, which ctest
knows as one case. STATUS is the exit status of the runner: if it failed but no case did (it crashed, or could not load
a file), one failure is counted.
"""
import sys
from pathlib import Path
from xml.etree import ElementTree


def outcome(case):
    """0: passed, 1: failed, 2: skipped"""
    if case.find("failure") is not None or case.find("error") is not None:
        return 1
    return 2 if case.find("skipped") is not None or case.get("status") in ("notrun", "disabled") else 0


def tally(folder, status):
    counts = [0, 0, 0]
    reports = {path.stem: path for path in folder.glob("*.xml") if path.stat().st_size}
    for name, path in reports.items():
        found = [outcome(case) for case in ElementTree.parse(path).getroot().iter("testcase")
                 if not (name == "ctest" and case.get("name") in reports)]
        for one in found:
            counts[one] += 1
    if status and not counts[1]:
        counts[1] = 1
    return counts


if __name__ == "__main__":
    print(*tally(Path(sys.argv[1]), int(sys.argv[2])))
