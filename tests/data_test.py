# SPDX-License-Identifier: Apache-2.0
"""Where a file of real data is missing, the tests that need it are skipped with the file as the reason; none passes."""

import ast
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest

from fledge.disk import build_folder
from tests.circles import long_after
from tests.tree import ROOT, files

OF_CPP = re.compile(r"^TEST(?:_F)?\((\w+), (\w+)\)\n\{\n(.*?)^\}", re.MULTILINE | re.DOTALL)
FILES = {str(file): (ROOT / file).read_text(encoding="utf-8")
         for file in files() if file.name.endswith(("_test.py", "_test.cpp")) and file.name != "data_test.py"}
IN_PYTHON = [name for name, text in FILES.items() if "FLEDGE_TEST_DATA" in text]


def report_of(command, folder, cwd=ROOT):
    """(counts of the report, case -> why it was skipped) of a run that finds no data. A reason None: not skipped."""
    report = folder / "report.xml"
    (folder / "empty").mkdir()
    done = subprocess.run([*command, report], cwd=cwd, env={**os.environ, "FLEDGE_TEST_DATA": str(folder / "empty")},
                          capture_output=True, text=True)
    root = ElementTree.parse(report).getroot()
    suite = root if root.tag == "testsuite" else root[0]
    assert suite.get("failures") == "0" and suite.get("errors", "0") == "0", done.stdout
    reasons = {}
    for case in suite.iter("testcase"):
        skipped, out = case.find("skipped"), case.findtext("system-out", "")
        reasons[case.get("name")] = None if skipped is None else f"{skipped.get('message')} {out}"
    assert suite.get("skipped") == str(len([reason for reason in reasons.values() if reason]))
    return reasons


def test_tests_in_cpp_are_skipped_where_their_data_is_missing(tmp_path):
    names = {f"{suite}.{name}" for text in FILES.values() for suite, name, body in OF_CPP.findall(text)
             if "real_file(" in body}
    assert len(names) > 10
    mentions = sum(text.count("real_file(") for text in FILES.values())
    assert mentions == sum(body.count("real_file(") for text in FILES.values() for _, _, body in OF_CPP.findall(text))
    (tmp_path / "empty").mkdir()
    environment = {**os.environ, "FLEDGE_TEST_DATA": str(tmp_path / "empty"), "GTEST_FILTER": ":".join(names),
                   "GTEST_OUTPUT": f"xml:{tmp_path}/"}
    sources = [name.removesuffix(".cpp").replace("/", ".") for name, text in FILES.items() if "real_file(" in text]
    command = ["ctest", "--test-dir", build_folder(), "-R", rf"^({'|'.join(map(re.escape, sources))})(\.\w+)?$"]
    listed = subprocess.run([*command, "--show-only=json-v1"], stdout=subprocess.PIPE, text=True, check=True).stdout
    if unbuilt := [test["name"] for test in json.loads(listed)["tests"] if "command" not in test]:
        pytest.skip(f"{unbuilt[0]} is not built; ./fledge test builds it")
    subprocess.run(command, env=environment, check=True)
    reasons = {f"{case.get('classname')}.{case.get('name')}": case.findtext("skipped")
               for report in tmp_path.glob("*.xml") for case in ElementTree.parse(report).getroot().iter("testcase")}
    assert set(reasons) == names
    assert [name for name, reason in reasons.items() if "not here: " not in (reason or "")] == []


@pytest.mark.parametrize("file", long_after(1, IN_PYTHON, "runs pytest"))
def test_tests_in_python_are_skipped_where_their_data_is_missing(file, tmp_path):
    tree = ast.parse(FILES[file])
    tests = [node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
             and {"real", "kernel", "DATA"} & {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}]
    assert tests
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *(f"{file}::{name}" for name in tests)]
    reasons = report_of([*command, "--junit-xml"], tmp_path)
    assert {name.partition("[")[0] for name in reasons} == set(tests)
    assert [name for name, reason in reasons.items() if str(tmp_path / "empty") not in (reason or "")] == []
