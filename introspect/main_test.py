# SPDX-License-Identifier: Apache-2.0
"""The command line: which files it writes when, and its messages."""
import os
import re

import pytest

from introspect.__main__ import main
from introspect.testing import ROOT, write_header

MESSAGE = "/** M. */\ntypedef struct {0} {{\n    Head head;\n    double x; ///< [m] x\n}} {0};"


@pytest.fixture
def tree(tmp_path):
    write_header(tmp_path, "m/a.h", MESSAGE.format("MsgA"))
    write_header(tmp_path, "w/b.h", MESSAGE.format("MsgB"))
    write_header(tmp_path, "empty/c.h", "")
    return tmp_path


def run(tree, *more, folders=("--library", "one", "--modules", "m", "--library", "two",
                              "--models", "w")):
    return main(["--root", str(tree), *folders, "--include", str(ROOT), "--out", str(tree / "out"),
                 *more])


def times(tree):
    return {path.name: path.stat().st_mtime_ns for path in (tree / "out").iterdir()}


def test_only_what_changed_is_written(tree, capsys):
    assert run(tree) == 0
    files = ["one_layout.c", "one_tables.c", "two_layout.c", "two_tables.c"]
    assert sorted(times(tree)) == files
    assert capsys.readouterr().out.count("wrote ") == 4
    for name in files:
        os.utime(tree / "out" / name, (1, 1))

    assert run(tree) == 0
    assert capsys.readouterr().out == ""
    assert set(times(tree).values()) == {10**9}

    header = tree / "m/a.h"
    header.write_text(header.read_text().replace("[m] x", "[s] x"))
    assert run(tree) == 0
    assert capsys.readouterr().out == f"wrote {tree}/out/one_tables.c\n"
    assert [name for name, time in times(tree).items() if time != 10**9] == ["one_tables.c"]

    assert run(tree, "-v", "--time") == 0
    out = capsys.readouterr().out
    assert out.count("unchanged ") == 4 and "ms\n" in out


def test_the_depfile_names_headers_folders_and_the_program(tree):
    assert run(tree, "--depfile", str(tree / "d")) == 0
    target, needed = (tree / "d").read_text().split(":", 1)
    needed = needed.replace("\\\n", " ").split()
    assert target == str(tree / "out/one_tables.c")
    for path in (tree / "m", tree / "m/a.h", tree / "w/b.h", ROOT / "flight/msg/head.h",
                 ROOT / "introspect/reader.py", ROOT / "introspect/emit/tables.py"):
        assert str(path) in needed
    assert all(os.path.exists(path) for path in needed)
    assert not any(path.endswith("_test.py") for path in needed)


def test_a_module_that_cmake_does_not_compile_is_refused(tree, capsys):
    write_header(tree, "m/spin.h", '#include "m/a.h"\n/** S. */\ntypedef struct Spin {\n    struct {\n        MsgA a;\n'
                 "    } out;\n} Spin;\nvoid spin_reset(Spin *m);\nvoid spin_update(Spin *m, Tick t);")
    line = ("--line", "{path} or {short} below {list}")
    assert run(tree, "--compiled", str(tree), "", *line) == 0, capsys.readouterr().err   # its source is elsewhere
    (tree / "m/spin.c").touch()
    assert run(tree, "--compiled", str(tree / "m"), "a.c;b.c", *line) == 1
    assert re.search(r"m/spin.h:\d+: CMake compiles every module; it does not compile m/spin.c; "
                     r"add m/spin or spin below FLIGHT\n", capsys.readouterr().err)
    assert run(tree, "--compiled", str(tree / "m"), "a.c;spin.c", *line) == 0


def test_a_refused_header_leaves_everything_as_it_was(tree, capsys):
    assert run(tree) == 0
    before = times(tree)
    capsys.readouterr()
    header = tree / "w/b.h"
    header.write_text(header.read_text().replace("[m] x", "x"))
    assert run(tree) == 1
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith(f"{header}:8: a number has a unit; ")
    assert times(tree) == before


def test_a_single_library_may_be_named_anywhere(tree):
    assert run(tree, folders=("--modules", "m", "--models", "w", "--library", "all")) == 0
    assert sorted(times(tree)) == ["all_layout.c", "all_tables.c"]
    text = (tree / "out/all_tables.c").read_text()
    assert "fledge_struct_MsgA" in text and "fledge_struct_MsgB" in text


def test_schemas_on_demand(tree):
    assert run(tree, "--emit", "schema") == 0
    assert sorted(times(tree)) == ["MsgA.msg", "MsgB.msg"]


@pytest.mark.parametrize("folders, message", [
    ((), "give a --library, and a folder with --modules or --models"),
    (("--modules", "m"), "--modules m: give its --library before"),
    (("--modules", "m", "--library", "a", "--library", "b"),
     "--modules m: give its --library before"),
    (("--library", "a-b", "--modules", "m"), "--library a-b: a name is letters, digits and _"),
    (("--library", "one", "--modules", "m", "--library", "two"),
     "--library two: give it a folder, with --modules or --models"),
    (("--library", "empty", "--modules", "empty"),
     "library `empty`: no module, model or message in its folders"),
    (("--library", "one", "--modules", "nowhere"), "no such folder or header"),
])
def test_wrong_options_are_explained(tree, capsys, folders, message):
    assert run(tree, folders=folders) == 1
    assert message in capsys.readouterr().err
    assert not (tree / "out").exists()


def test_help_has_an_example(capsys):
    with pytest.raises(SystemExit) as done:
        main(["--help"])
    assert done.value.code == 0
    assert "python3 -m introspect --library flight" in capsys.readouterr().out
