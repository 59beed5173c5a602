# SPDX-License-Identifier: Apache-2.0
"""Which Python flies, and what is refused before anything is built, with its line."""

import sys

import pytest

import fledge
from fledge import export
from fledge.targets.micropython.export.script import placed, read_scripts

FLIGHT = '''"""What flies."""
from fledge import flight as fsw
from fledge.units import s


def build(f, turn=0.0):
    f.rest = fsw.InertialPointing()
    f.task("gnc", every=1 * s, run=[f.rest])
'''


def mission(folder, text=FLIGHT, **files):
    folder = folder / "small"
    folder.mkdir()
    for name, content in {"flight": text, **files}.items():
        file = folder / f"{name}.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text(content)
    return folder


def names(folder, **parameters):
    return list(read_scripts(fledge.load(folder, **parameters)).files)


def test_a_mission_brings_what_it_imports_and_no_more(tmp_path):
    folder = mission(tmp_path, FLIGHT.replace("\n\n\n", "\nfrom .gains import K\nfrom .parts import wheels\n\n\n", 1),
                     gains="from math import sqrt\nK = 2.5\n", scenarios="import numpy\n", unused="import numpy\n",
                     **{"parts/wheels": "from ..gains import K\n"})
    assert names(folder) == ["small/flight.py", "small/gains.py", "small/parts/wheels.py"]


def test_those_of_another_mission_and_a_folder_of_modules(tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "other/gains.py").write_text("K = 1.0\n")
    folder = mission(tmp_path, "from .other.gains import K\nfrom . import parts\n" + FLIGHT,
                     **{"parts/__init__": "from .one import K\n", "parts/one": "K = 1\n"})
    assert names(folder) == ["small/flight.py", "small/other/gains.py", "small/parts/__init__.py",
                             "small/parts/one.py"]


def test_those_of_a_mission_of_fledge_from_a_project(tmp_path):
    folder = mission(tmp_path, "from .nadir_spin.flight import build as spin\n" + FLIGHT)
    assert names(folder) == ["small/flight.py", "small/nadir_spin/flight.py"]


def test_names_are_imported_one_by_one(tmp_path):
    text = FLIGHT.replace("from fledge.units import s", "from fledge.units import *")
    with pytest.raises(export.ExportError, match=r"flight.py, line 3: the target cannot import \* from fledge.units"):
        names(mission(tmp_path, text))


def test_mission_py_brings_all_that_it_builds():
    assert names("formation") == [f"formation/{name}.py" for name in ("mission", "chief", "deputy", "roll", "truth")]


def test_given_parameters_reach_build(tmp_path):
    scripts = read_scripts(fledge.load(mission(tmp_path), turn=0.25))
    assert scripts.module == "small.given" and "build(it):\n    _build(it, turn=0.25)" in scripts.files[
        "small/given.py"]
    assert read_scripts(fledge.load(tmp_path / "small")).module == "small.flight"


def test_own_python_of_the_mission_s_folder_flies_too(tmp_path, monkeypatch):
    folder = mission(tmp_path, "import gains_of_mine\n" + FLIGHT)
    (folder / "gains_of_mine.py").write_text("K = 2\n")
    monkeypatch.syspath_prepend(str(folder))
    assert names(folder) == ["small/flight.py", "gains_of_mine.py"]
    del sys.modules["gains_of_mine"]


@pytest.mark.parametrize("text, line, message", [
    ("import numpy as np", 1, "numpy is not on the target: lists with units"),
    ("if True:\n    from os import path", 2, "os is not on the target: a flight computer has no files"),
    ("def f():\n    import dataclasses", 2, "dataclasses is not on the target: a dict"),
    ("from fledge import attitude", 1, "fledge.attitude is not on the target"),
    ("import fledge.plot", 1, "fledge.plot is not on the target"),
    ("from fledge.attitude import mrp_to_dcm", 1, "fledge.attitude is not on the target"),
    ("import itertools", 1, "itertools is not on the target: it has fledge"),
])
def test_what_the_target_does_not_have_is_refused_with_its_line(text, line, message, tmp_path):
    folder = mission(tmp_path, f"{text}\n{FLIGHT}")
    with pytest.raises(export.ExportError) as refused:
        names(folder)
    assert str(refused.value).startswith(f"{folder}/flight.py, line {line}: {message}")


def test_the_line_is_that_of_the_file_that_imports(tmp_path):
    folder = mission(tmp_path, "from .gains import K\n" + FLIGHT, gains="K = 1\n\nimport json\n")
    with pytest.raises(export.ExportError, match=f"{folder}/gains.py, line 3: json is not on the target"):
        names(folder)


def test_what_the_target_does_not_execute_is_not_refused(tmp_path):
    folder = mission(tmp_path, "from __future__ import annotations\nTYPE_CHECKING = False\nif TYPE_CHECKING:\n"
                     "    import numpy\ntry:\n    import numpy\nexcept ImportError:\n    numpy = None\n" + FLIGHT)
    assert names(folder) == ["small/flight.py", "__future__.py"]


def test_a_simulation_without_files_has_no_script():
    with pytest.raises(export.ExportError, match="made without files"):
        read_scripts(fledge.Simulation("mine"))


def test_errors_of_the_target_name_the_user_s_files(tmp_path):
    files = read_scripts(fledge.load(mission(tmp_path))).files
    assert placed("small/flight.py, line 7: ValueError: no",
                  files) == f"{tmp_path}/small/flight.py, line 7: ValueError: no"
