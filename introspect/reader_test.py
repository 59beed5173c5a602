# SPDX-License-Identifier: Apache-2.0
"""The model of headers that keep the rules: this repository's, and small ones of a user's."""
import re
import subprocess
from dataclasses import replace

import pytest

from introspect.model import Bounds, Enumeration, Enumerator, Group, Kind, Type
from introspect.reader import read
from introspect.sources import Source
from introspect.testing import ROOT, read_this, read_tree, write_header


@pytest.fixture(scope="module")
def model():
    return read_this()


def member(struct, name):
    return next(f for f in struct.fields if f.name == name)


# This repository's headers

def test_offsets_and_sizes_are_those_of_the_compiler(model, tmp_path):
    """gcc prints what it lays out; the reader has it from clang."""
    structs = model.structs.values()
    program = "".join(f'#include "{header}"\n' for header in sorted({s.header for s in structs}))
    program += "#include <stdio.h>\n#include <stddef.h>\nint main(void)\n{\n"
    expected = []
    for s in structs:
        program += f'    printf("{s.name} %zu\\n", sizeof({s.name}));\n'
        expected.append(f"{s.name} {s.size}")
        for f in s.fields:
            program += (f'    printf("{s.name}.{f.path} %zu %zu\\n", offsetof({s.name}, {f.path}), '
                        f'sizeof((({s.name} *)0)->{f.path}));\n')
            expected.append(f"{s.name}.{f.path} {f.offset} {f.size}")
    (tmp_path / "print.c").write_text(program + "    return 0;\n}\n")
    subprocess.run(["gcc", "-std=c99", f"-I{ROOT}", tmp_path / "print.c", "-o", tmp_path / "print"],
                   check=True)
    printed = subprocess.run([tmp_path / "print"], check=True, capture_output=True, text=True)
    assert printed.stdout.splitlines() == expected


def test_no_member_is_overlooked(model):
    """Every line that declares a member is in the model, in its order, with its unit."""
    texts = {header: (ROOT / header).read_text() for header in {s.header for s in model.structs.values()}}
    shared = "\n".join(texts.values())      # where the structs of groups with a name are

    def body_of(name, text):
        body = re.search(rf"typedef struct {name} {{\n(.*?)^}} {name};", text, re.M | re.S)[1]
        return re.sub(r"^    (\w+) (?:in|out|par|mem);\n", lambda group: body_of(group[1], shared), body, flags=re.M)

    for s in model.structs.values():
        body = body_of(s.name, texts[s.header])
        declared = re.findall(r"^ +\w+ (\w+)(?:\[[^]]*\])*;(?: *///< *\[([^\]]*)\])?", body, re.M)
        assert [(f.name, f.unit.text if f.unit else "") for f in s.fields] == declared, s.name


def test_kinds_and_libraries_follow_from_headers_and_folders(model):
    kinds = {name: (s.kind, s.library, s.folder) for name, s in model.structs.items()}
    assert kinds["Head"] == (Kind.PLAIN, "flight", "flight/msg")
    assert kinds["AttError"] == (Kind.MESSAGE, "flight", "flight/msg")
    assert kinds["MrpFeedback"] == (Kind.MODULE, "flight", "flight/control")
    assert kinds["CraftState"] == (Kind.MESSAGE, "world", "world/msg")
    assert kinds["Spacecraft"] == (Kind.MODEL, "world", "world/dynamics")
    assert model.library_names == ("flight", "world")
    assert "Vec3" not in kinds and "Mat3" not in kinds


def test_a_interface_has_groups_and_its_members_units_clauses_and_meanings(model):
    feedback = model.structs["MrpFeedback"]
    assert feedback.doc.startswith("Track a moving attitude reference")
    assert feedback.snake_name == "mrp_feedback"

    gain = member(feedback, "K")
    assert (gain.group, gain.path, gain.type, gain.shape) == (Group.PAR, "par.K", Type.F64, ())
    assert gain.unit.text == "N m" and gain.unit.dims == (2, 1, -2, 0, 0, 0, 0, 0)
    assert gain.clauses == {"required"}
    assert gain.bounds == Bounds(lo=0.0, lo_open=True)
    assert gain.doc == "gain on the MRP error"

    matrix = member(feedback, "P")
    assert (matrix.ctype, matrix.type, matrix.shape) == ("Mat3", Type.F64, (3, 3))

    wheels = member(feedback, "wheels")
    assert (wheels.group, wheels.type) == (Group.IN, Type.STRUCT)
    assert wheels.struct is model.structs["WheelSet"]
    assert wheels.clauses == {"optional"} and wheels.unit is None

    vehicle = member(feedback, "vehicle")
    assert not vehicle.clauses and vehicle.doc == "inertia, from the vehicle configuration"


def test_a_group_may_be_a_struct_that_interfaces_share(model):
    for name in ("AttitudeMekf", "AttitudeUkf"):
        gate = member(model.structs[name], "gate")
        assert gate.path == "par.gate" and gate.offset > member(model.structs[name], "state").offset
        assert "required" in gate.clauses and gate.bounds == Bounds(lo=0.0, lo_open=True)
    assert "AttitudeFilterParameters" not in model.structs      # no struct of its own: its clauses are those of a group


def test_arrays_of_vectors_counts_and_spares(model):
    config = model.structs["WheelConfig"]
    axes, spare = member(config, "axes_B"), member(config, "spare")
    assert axes.shape == (8, 3) and axes.size == 192 and axes.element_size == 8
    assert axes.count == "n" and axes.clauses == {"required", "non-zero"}
    assert member(config, "n").bounds == Bounds(1.0, 8.0)
    assert spare.is_spare and not axes.is_spare
    assert member(model.structs["VehicleConfig"], "I_B").clauses == {"required", "inertia"}
    assert member(model.structs["ReactionWheels"], "friction").clauses == {"assumed"}


def test_enums(model):
    assert model.enums["Quality"].short_names == {"NONE": 0, "STALE": 1, "DEGRADED": 2, "GOOD": 3}
    assert model.enums["Quality"].type is Type.U32
    quality = member(model.structs["Head"], "quality")
    assert quality.type is Type.ENUM and quality.enum is model.enums["Quality"]
    assert quality.enum.values[1].doc == "older than its wire allows"


# A user's headers

MIXED = """
typedef uint16_t Count;
typedef Count Counts[2];
typedef double Quat[4];
/** Which way. */
typedef enum Way {
    WAY_BACK = -1, ///< astern
    WAY_ON = 1
} Way;
typedef struct Part {
    Quat q[2];   ///< [-] σ — attitudes
    float f[2];  ///< [m/s] two
} Part;
/** A message
 *  with "quotes" and a \\ in it. */
typedef struct Mixed {
    Head head;
    Part parts[2];   /**< [-] the parts */
    Counts counts;   ///< [-] numbers,
                     ///< over two lines
    uint8_t bytes[4];  ///< [-] x: y
    char name[8];    ///< who
    Way way;         ///< which way
    uint32_t n;      ///< [-] in [0, 4]: how many
    int64_t at[4];   ///< [ns] count n: when
} Mixed;
"""


def test_types_through_typedefs_arrays_and_structs(tmp_path):
    write_header(tmp_path, "m/mixed.h", MIXED)
    mixed = read_tree(tmp_path).structs["Mixed"]
    found = [(f.name, f.type, f.ctype, f.shape, f.offset, f.size) for f in mixed.fields]
    assert found == [
        ("head", Type.STRUCT, "Head", (), 0, 16),
        ("parts", Type.STRUCT, "Part", (2,), 16, 144),
        ("counts", Type.U16, "Counts", (2,), 160, 4),
        ("bytes", Type.U8, "uint8_t", (4,), 164, 4),
        ("name", Type.CHAR, "char", (8,), 168, 8),
        ("way", Type.ENUM, "Way", (), 176, 4),
        ("n", Type.U32, "uint32_t", (), 180, 4),
        ("at", Type.I64, "int64_t", (4,), 184, 32)]
    part = mixed.fields[1].struct
    assert [(f.type, f.shape, f.doc) for f in part.fields] == [
        (Type.F64, (2, 4), "σ — attitudes"), (Type.F32, (2,), "two")]
    assert mixed.doc == 'A message\nwith "quotes" and a \\ in it.'
    assert member(mixed, "counts").doc == "numbers, over two lines"
    assert member(mixed, "bytes").doc == "x: y"
    assert member(mixed, "at").unit.text == "ns" and member(mixed, "at").count == "n"
    assert member(mixed, "way").enum == Enumeration(
        "Way", "Which way.", (Enumerator("WAY_BACK", -1, "astern"), Enumerator("WAY_ON", 1, "")),
        "m/mixed.h", "user")
    assert member(mixed, "way").enum.type is Type.I32


def test_a_users_library_uses_messages_of_another_without_owning_them(tmp_path):
    write_header(tmp_path, "m/mod.h", '#include "flight/msg/attitude.h"\n' + """
/** A user's module. */
typedef struct MyMod {
    struct {
        AttError error;
    } in;
} MyMod;
void my_mod_reset(MyMod *m);
void my_mod_update(MyMod *m, Tick t);
""")
    model = read_tree(tmp_path)
    assert [s.name for s in model.library("user").structs] == ["MyMod"]
    assert {name: s.library for name, s in model.structs.items() if name != "MyMod"} == {
        "AttError": "", "Head": ""}
    assert model.structs["AttError"].header == "flight/msg/attitude.h"
    assert model.structs["MyMod"].header == "m/mod.h"


def test_several_roots_in_one_read(tmp_path):
    for i in "ab":
        write_header(tmp_path / i, f"msg/{i}.h", MIXED.replace("Mixed", f"Mixed{i.upper()}")
                     if i == "a" else "/** B. */\ntypedef struct B {\n    Head head;\n} B;")
    model = read([Source(tmp_path / "a", "msg", Kind.MODULE, "one"),
                  Source(tmp_path / "b", "msg/b.h", Kind.MODEL, "two")], include=[ROOT])
    assert [s.name for s in model.library("one").structs] == ["MixedA", "Part"]
    assert [(s.name, s.header) for s in model.library("two").structs] == [("B", "msg/b.h")]
    with pytest.raises(KeyError, match="no library `three`; there are: one, two"):
        model.library("three")


def test_cpp_headers_are_left_alone_but_watched(tmp_path):
    write_header(tmp_path, "w/model.h", "#include <vector>\nnamespace user {\nclass Model {};\n}")
    write_header(tmp_path, "w/interface.h", "/** B. */\ntypedef struct B {\n    Head head;\n} B;")
    model = read_tree(tmp_path)
    assert [s.name for s in model.library("user").structs] == ["B"]
    assert str(tmp_path / "w/model.h") in model.files


@pytest.mark.parametrize("lines", [
    "/* Names here share one\n   namespace with others, and a\n   template <of words>.\n*/\n//\tnamespace x {\n",
    '#define TEXT "/*"\n/*\n#include <vector>\n*/\n',
    '#ifdef __cplusplus\n#include <cstdint>\nextern "C" {\n#else\n#include <stdint.h>\n#endif\n'
    "#if defined(__cplusplus)\n}\n#endif\n",
    "#ifndef __cplusplus\n#include <stdint.h>\n#else\n#ifdef X\n#include <x>\n#endif\nnamespace x {}\n#endif\n",
    "#if !defined(__cplusplus)\n#elif defined X\nnamespace x {}\n#endif\n",
    "#if __cplusplus >= 201103L\ntemplate <class T> struct X;\n#endif\n"])
def test_headers_of_both_languages_are_read(tmp_path, lines):
    header = write_header(tmp_path, "m/x.h", lines + "/** B. */\ntypedef struct B {\n    Head head;\n} B;")
    subprocess.run(["g++", "-fsyntax-only", "-x", "c++", f"-I{ROOT}", header], check=True)
    assert "B" in read_tree(tmp_path).structs


@pytest.mark.parametrize("lines", ["#ifdef X\nnamespace x {}\n#else\nnamespace y {}\n#endif\n",
                                   "#if defined(X) || defined(__cplusplus)\n#include <vector>\n#endif\n",
                                   "#ifndef __cplusplus\n#error it is C++\n#endif\nnamespace x {}\n"])
def test_headers_that_may_be_cpp_in_c_are_left_alone(tmp_path, lines):
    write_header(tmp_path, "m/x.h", lines)
    assert not read_tree(tmp_path).structs


def test_structs_that_are_no_interface_may_be_as_they_like(tmp_path):
    write_header(tmp_path, "m/x.h", """
typedef struct List {
    struct List *next;
    int n;
} List;
typedef struct Pair {
    double a; ///< [m] kept, for another library may use it
} Pair;
union U { int i; float f; };
enum { A, B };
""")
    assert list(read_tree(tmp_path).structs) == ["Pair"]


def test_models_need_no_functions(tmp_path):
    write_header(tmp_path, "w/x.h", '#include "flight/msg/attitude.h"\n' + """
/** A model. */
typedef struct Model {
    struct {
        AttError base;
    } in;
} Model;
""")
    model = read_tree(tmp_path).structs["Model"]
    assert model.kind is Kind.MODEL and model.fields[0].name == "base"


def test_the_example_in_the_readme_keeps_the_rules(tmp_path):
    example = re.search(r"```c\n(.*?)```", (ROOT / "introspect/README.md").read_text(), re.S)[1]
    messages = "".join(f'#include "flight/msg/{name}.h"\n'
                       for name in ("attitude", "vehicle", "wheels"))
    write_header(tmp_path, "m/rate_hold.h", messages + example)
    hold = read_tree(tmp_path).structs["RateHold"]
    assert member(hold, "rates").doc == "the first n of them count; a comment may go on"


def test_no_such_folder():
    with pytest.raises(FileNotFoundError, match="nowhere: no such folder or header"):
        read([Source(ROOT, "nowhere", Kind.MODULE, "x")])


@pytest.mark.parametrize("name, snake", [
    ("MrpFeedback", "mrp_feedback"), ("Rk4", "rk4"), ("CFDPSender", "cfdp_sender"),
    ("Mode2Guard", "mode2_guard"), ("A", "a"), ("SunVectorB", "sun_vector_b")])
def test_functions_are_named_after_the_struct(model, name, snake):
    assert replace(model.structs["Head"], name=name).snake_name == snake


def test_the_hash_knows_what_bytes_mean_and_nothing_else(tmp_path):
    def hash_of(text):
        write_header(tmp_path, "m/mixed.h", text)
        return read_tree(tmp_path).structs["Mixed"].hash

    original = hash_of(MIXED)
    assert original == hash_of(MIXED.replace("who", "whose name").replace("A message", "It"))
    changes = [("char name", "char label"), ("[m/s] two", "[m] two"),
               ("float f[2]", "int32_t f[2]"), ("bytes[4]", "bytes[2][2]"),
               ("WAY_ON = 1", "WAY_ON = 2")]
    assert len({hash_of(MIXED.replace(*change)) for change in changes} | {original}) == 6
