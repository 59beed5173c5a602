# SPDX-License-Identifier: Apache-2.0
"""What tests want of tests/needs.py: packages that ./fledge installs, which are found, and named where they are not."""
import ast
import re
import subprocess
import sys

import pytest

from fledge.targets import TARGETS
from tests import needs
from tests.tree import ROOT, files

OF_PACKAGES, OF_TARGETS = {"needs", "reason", "skip_without"}, {"flies_on", "reason_on", "skip_unless_on"}


def wanted():
    """(packages, targets) that the calls of tests name."""
    packages, targets = set(), set()
    for path in files():
        if path.suffix != ".py" or "from tests.needs import" not in (text := (ROOT / path).read_text(encoding="utf-8")):
            continue
        nodes = [*ast.walk(ast.parse(text))]
        ours = {name.name for node in nodes if getattr(node, "module", "") == "tests.needs" for name in node.names}
        for call in nodes:
            name = getattr(getattr(call, "func", None), "id", "")
            if name not in ours:
                continue
            words = [word.value for word in call.args if isinstance(word, ast.Constant)]
            packages.update(*(ast.literal_eval(more.value) for more in call.keywords))
            if name in OF_PACKAGES:
                packages.update(words)
            elif name == "module":
                packages.update(words[1:] or [f"python3-{words[0].partition('.')[0].lower()}"])
            elif name == "section":
                packages.update(*map(needs.section, words))
            elif name in OF_TARGETS:
                targets.update(words)
    return packages, targets


def in_lists():
    """All packages, also alternatives."""
    return {name for file in (ROOT / "cmake/packages.txt", *ROOT.glob("targets/*/packages.txt"),
                                     *ROOT.glob("python/fledge/*/packages.txt"))
            for line in re.findall(r"^[^#\s\[].*?(?=\s*(?:#|$))", file.read_text(encoding="utf-8"), re.M)
            for name in line.split(" | ")}


def test_what_tests_need_can_be_installed_and_nothing_else_is_known():
    packages, targets = wanted()
    assert len(packages) > 30 and len(targets) > 5
    assert packages - in_lists() == set() and targets - {*TARGETS} == set()
    of_targets = {name for file in ROOT.glob("targets/*/packages.txt") for name in needs.section(str(file.parent))}
    assert needs.SHOWN_BY.keys() - packages - of_targets == set()


@pytest.mark.skipif(needs.lacking("dpkg") != [], reason="this is no Debian")
def test_what_is_installed_is_found():
    done = subprocess.run(["dpkg-query", "-W", "-f", "${db:Status-Status} ${Package}\n", *needs.SHOWN_BY, *wanted()[0]],
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    installed = [line.removeprefix("installed ") for line in done.stdout.splitlines() if line.startswith("installed ")]
    assert len(installed) > 10 and needs.lacking(*installed) == []


def test_what_is_lacking_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "erfa", None)
    assert needs.reason("graphviz", "casacore-data-jpl-de405", "valgrind") in (
        "not installed: graphviz, valgrind", "not installed: graphviz, casacore-data-jpl-de405, valgrind")
    assert re.match("not installed: .*gcc-arm-none-eabi.*qemu-system-arm", needs.reason_on("linux", "cortex-m7"))
    assert needs.reason_on("linux") == "linux needs gcc and ninja" and needs.reason() == needs.reason_on() == ""
    with pytest.raises(pytest.skip.Exception, match="^tests/needs_test.py: not installed: python3-erfa$"):
        needs.module("erfa")
    assert needs.skipped("", "first", "second").kwargs == {"reason": "first"}
