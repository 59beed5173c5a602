# SPDX-License-Identifier: Apache-2.0
"""What the reader refuses, where, and in which words; most of it stands in refusals.txt."""
import re
from pathlib import Path

import pytest

from introspect import libclang
from introspect.errors import HeaderError
from introspect.testing import read_tree, write_header

MESSAGE = """/** A message. */
typedef struct Msg {
    Head head;
%s
} Msg;
"""
INTERFACE = MESSAGE % "    double x; ///< [m] x" + """
typedef struct Plain {
    double x; ///< [m] x
} Plain;
/** A module. */
typedef struct Mod {
%s
} Mod;
void mod_reset(Mod *m);
void mod_update(Mod *m, Tick t);
"""
PAR = INTERFACE % "struct {\n%s\n} par;"
BODIES = {"header": "%s", "message": MESSAGE, "interface": INTERFACE, "par": PAR}


def refusals():
    text = (Path(__file__).parent / "refusals.txt").read_text()
    case = re.compile(r"^\[([^\n]*)\] (header|message|interface|par)\n(.*?)^=> (.*?)\n(?=\n|\Z)",
                      re.M | re.S)
    for name, where, body, expected in case.findall(text[text.index("# What"):]):
        yield pytest.param(BODIES[where] % body, " ".join(expected.split()), id=name)


def test_a_libclang_that_is_not_understood(tmp_path, monkeypatch):
    monkeypatch.setattr(libclang, "tag", lambda cursor: cursor.spelling or "struct (a new way to say unnamed)")
    header = write_header(tmp_path, "m/x.h", PAR.replace("Msg", "Other") % "double P; ///< [-] P")
    with pytest.raises(HeaderError, match=rf"{header}:\d+: .* `Mod` looks like one, .*; install another version"):
        read_tree(tmp_path)


@pytest.mark.parametrize("body, expected", refusals())
def test_a_broken_rule_is_refused_at_its_line(tmp_path, body, expected):
    header = write_header(tmp_path, "m/x.h", body)
    text = header.read_text()
    line = text.count("\n", 0, text.index("@@")) + 1
    header.write_text(text.replace("@@", ""))
    with pytest.raises(HeaderError) as error:
        read_tree(tmp_path)
    assert str(error.value) == f"{header}:{line}: {expected}"


def test_no_refusal_is_overlooked():
    text = (Path(__file__).parent / "refusals.txt").read_text()
    assert len(list(refusals())) == text.count("\n=> ") > 70


def problems(root):
    with pytest.raises(HeaderError) as error:
        read_tree(root)
    return str(error.value).split("\n")


def test_all_problems_are_reported_at_once_in_order(tmp_path):
    b = write_header(tmp_path, "m/b.h", MESSAGE % "double *p; ///< [m] p\nint n; ///< [-] n")
    a = write_header(tmp_path, "m/a.h", MESSAGE.replace("Msg", "A") % "double x;")
    found = problems(tmp_path)
    assert [line.split(": ")[0] for line in found] == [f"{a}:8", f"{b}:8", f"{b}:9"]


def test_a_refused_member_draws_no_complaint_about_a_gap(tmp_path):
    write_header(tmp_path, "m/x.h", MESSAGE % "double *p;\ndouble x; ///< [m] x")
    assert len(problems(tmp_path)) == 1


def test_two_structs_of_one_name(tmp_path):
    a = write_header(tmp_path, "m/a.h", MESSAGE % "double x; ///< [m] x")
    b = write_header(tmp_path, "m/b.h", MESSAGE % "double y; ///< [m] y")
    assert problems(tmp_path) == [
        f"{b}:6: a name stands for one thing in all headers; clang says: redefinition of 'Msg' "
        f"(before in {a}:6); rename one of them"]


def test_two_headers_with_one_include_guard(tmp_path):
    a = write_header(tmp_path, "m/a.h", MESSAGE % "double x; ///< [m] x")
    b = tmp_path / "m" / "b.h"
    b.write_text("/* another */\n" + a.read_text().replace("Msg", "Other"))
    assert problems(tmp_path) == [
        f"{b}:2: an include guard is a header's own; `M_A_H` also guards {a}; name it after the "
        "header's path"]


def test_a_layout_that_depends_on_the_machine(tmp_path):
    header = write_header(tmp_path, "m/x.h", MESSAGE % (
        "#ifdef __sparc__\ndouble more; ///< [m] more\n#endif\ndouble x; ///< [m] x"))
    assert problems(tmp_path) == [
        f"{header}:6: a layout is the same everywhere; `Msg` has offsets and size [0, 16, 24] "
        "here, [0, 16, 24, 32] on sparc-linux-gnu; declare the same members of fixed width "
        "everywhere"]


def test_a_comment_in_another_encoding(tmp_path):
    header = write_header(tmp_path, "m/x.h", MESSAGE % "double x; ///< [m] Höhe" + "/* Größe */")
    header.write_bytes(header.read_text().encode("latin-1"))
    assert problems(tmp_path) == [
        f"{header}:8: a header is in UTF-8; 0xF6, byte 21 of the line; save it as UTF-8",
        f"{header}:10: a header is in UTF-8; 0xF6, byte 6 of the line; save it as UTF-8"]
    header.write_bytes(header.read_bytes().replace(b"H\xf6he", b"height"))
    assert "Msg" in read_tree(tmp_path).structs     # what the model takes is in ASCII


def test_a_header_that_needs_an_operating_system(tmp_path):
    header = write_header(tmp_path, "m/x.h", "#include <unistd.h>\n")
    assert problems(tmp_path) == [
        f"{header}:5: a header compiles as C99 for sparc-linux-gnu, without an operating system; "
        "clang says: 'unistd.h' file not found; correct it"]


def test_a_struct_of_the_users_that_breaks_a_rule_is_reported_where_it_is_declared(tmp_path):
    part = write_header(tmp_path, "lib/part.h", "typedef struct Part {\n    double x;\n} Part;")
    write_header(tmp_path, "m/x.h", '#include "lib/part.h"\n' + MESSAGE % "Part part;")
    assert problems(tmp_path)[0].startswith(f"{part}:6: a number has a unit; `x` has none; ")
