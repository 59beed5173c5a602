# SPDX-License-Identifier: Apache-2.0
"""The targets by their names: found by their folders, imported before anything is built, and refused in words."""

import os
import subprocess
import sys

import pytest

from fledge import targets
from fledge.errors import Failure
from fledge.disk import ROOT
from fledge.targets import PLACES, TARGETS, Targets

OWN = "from fledge.targets.linux import Linux\n\n\nclass Own(Linux):\n    "


@pytest.fixture
def project(tmp_path, monkeypatch):
    """project(name, text) -> the targets with that of a project's folder, targets/NAME."""
    def folder_with(name, text):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(text)
        monkeypatch.setattr(targets, "__path__", [*targets.__path__, str(tmp_path)])
        monkeypatch.delitem(sys.modules, f"fledge.targets.{name}", raising=False)
        return Targets([*PLACES, tmp_path])
    return folder_with


def test_each_folder_is_a_target_with_its_name():
    folders = {path.parent.name.replace("_", "-") for path in ROOT.glob("targets/*/__init__.py")}
    assert {*TARGETS} == folders and next(iter(TARGETS)) == "desktop"
    assert all(target.name == name and target.about for name, target in TARGETS.items())


def test_a_target_of_a_project_stands_beside_those_of_fledge(project):
    targets = project("vax_780", OWN + "needs = ('gcc-vax',)\n")
    assert {*targets} == {*TARGETS, "vax-780"} and targets["vax-780"].name == "vax-780"
    with pytest.raises(Failure, match="fly: vax-780 needs gcc-vax, not installed here"):
        targets.ready(["vax-780"], "fly")


def test_a_target_needs_what_those_that_it_uses_need(project):
    targets = project("vax", OWN + "uses, needs = ('leon3-micropython', 'linux'), ('gcc-vax',)\n")
    names = [target.name for target in targets["vax"].with_used()]
    assert names == ["vax", "leon3-micropython", "leon3", "micropython", "linux"]
    assert targets["vax"].missing()[0] == "gcc-vax"


@pytest.mark.parametrize("name, text, message", [
    ("vax", "import no_such_module\n", "vax/__init__.py: ModuleNotFoundError: No module named 'no_such_module'"),
    ("vax", "x = \n", "vax/__init__.py: SyntaxError: invalid syntax"),
    ("vax", "from fledge.targets.linux import Linux\n", "has no class that derives from fledge.targets.Target"),
    ("vax", OWN + "uses = ('pdp',)\n", "vax: it uses pdp, and there is no such target"),
    ("loop", OWN + "pass\n", "loop: Fledge has .*/loop.py by this name; give the folder another one"),
    ("linux", OWN + "pass\n", "linux: Fledge has .*/linux/__init__.py by this name"),
])
def test_a_folder_that_is_no_target_is_refused(project, name, text, message):
    targets = project(name, text)
    assert name in targets        # its name is known, and nothing else is disturbed
    with pytest.raises(Failure, match=message):
        targets.ready([name], "fly")
    assert targets["cfs"].name == "cfs"


def test_the_classes_need_nothing_that_is_built():
    """Only the standard library, without what would delay the launcher."""
    program = ("import sys; from fledge.targets import TARGETS; from fledge.launcher import packages, parser\n"
               "for one in TARGETS.values(): one.missing()\n"
               "options = parser.parsed(['profile', 'x', '--on', 'leon3'])\n"
               "assert 'build fledge_leon3' in packages.expanded(options.needs(options))\n"
               "late = {'_core', 'numpy', 'dataclasses', 'inspect', 'typing', 'tarfile', 'hashlib', 'tomllib'}\n"
               "assert not late & set(sys.modules), late & set(sys.modules)\n"
               "own = {'.'.join(name.split('.')[:2]) for name in sys.modules if name.startswith('fledge')}\n"
               "rooms = {'', '.cli', '.launcher', '.targets', '.contents', '.errors', '.disk', '.folders', "
               "'.programs', '.progress', '.serial_line'}\n"
               "assert own == {f'fledge{room}' for room in rooms}, own")
    subprocess.run([sys.executable, "-P", "-S", "-c", program], check=True,
                   env={**os.environ, "PYTHONPATH": str(ROOT / "python")})
