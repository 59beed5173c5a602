# SPDX-License-Identifier: Apache-2.0
"""What is written from the model: tables that compile and read back, checks that check, schemas."""
import ctypes
import re
import subprocess
from dataclasses import replace

import pytest

from introspect.emit import EMITTERS, orders, reference, schema
from introspect.errors import HeaderError
from introspect.model import Bounds, Kind
from introspect.testing import ROOT, read_this, read_tree, write_header
from tests.needs import needs

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes",
          "-Werror", "-ffp-contract=off", "-fPIC"]


@pytest.fixture(scope="module")
def model():
    return read_this()


def write(model, folder, *emitters):
    """All files of some emitters, for all libraries."""
    written = []
    for name in model.library_names:
        for emitter in emitters:
            for file, text in EMITTERS[emitter](model.library(name)).items():
                (folder / file).write_text(text, encoding="utf-8")
                written.append(folder / file)
    return written


def compile_c(source, *options, compiler="gcc"):
    return subprocess.run([compiler, *STRICT, *options, "-c", str(source), "-o", f"{source}.o"],
                          capture_output=True, text=True)


# Tables. Their C declarations once more, for ctypes.

class CEnumerator(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("value", ctypes.c_int64), ("doc", ctypes.c_char_p)]


class CEnum(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("doc", ctypes.c_char_p), ("n", ctypes.c_uint32),
                ("values", ctypes.POINTER(CEnumerator))]


class CField(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("offset", ctypes.c_uint32), ("size", ctypes.c_uint32),
                ("type", ctypes.c_int), ("group", ctypes.c_int), ("flags", ctypes.c_uint32),
                ("bounds", ctypes.c_uint32), ("lo", ctypes.c_double), ("hi", ctypes.c_double),
                ("ndim", ctypes.c_uint32), ("shape", ctypes.c_uint32 * 4),
                ("count", ctypes.c_char_p), ("distinct", ctypes.c_char_p), ("sub", ctypes.c_void_p),
                ("values", ctypes.POINTER(CEnum)), ("unit", ctypes.c_char_p),
                ("dims", ctypes.c_int8 * 8), ("ctype", ctypes.c_char_p), ("doc", ctypes.c_char_p)]


class CStruct(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("doc", ctypes.c_char_p), ("header", ctypes.c_char_p),
                ("folder", ctypes.c_char_p), ("kind", ctypes.c_int), ("size", ctypes.c_uint32),
                ("align", ctypes.c_uint32), ("hash", ctypes.c_uint64), ("n", ctypes.c_uint32),
                ("fields", ctypes.POINTER(CField)), ("schema", ctypes.c_char_p),
                ("reset", ctypes.c_void_p), ("update", ctypes.c_void_p),
                ("service", ctypes.c_void_p), ("events", ctypes.POINTER(CEnum))]


class CLibrary(ctypes.Structure):
    _fields_ = [("version", ctypes.c_uint32), ("name", ctypes.c_char_p), ("n", ctypes.c_uint32),
                ("structs", ctypes.POINTER(ctypes.POINTER(CStruct)))]


KINDS = ["plain", "message", "module", "model"]
GROUPS = ["", "in", "out", "par", "mem"]
TYPES = "F64 F32 I8 U8 I16 U16 I32 U32 I64 U64 CHAR ENUM STRUCT".split()
FLAGS = ["required", "optional", "assumed", "non-zero", "inertia", "spare", "initial"]


def link(model, folder, includes):
    """The libraries of a model as one shared object, with functions that do nothing, and with empty
    tables for what belongs to a library that is not there."""
    sources = write(model, folder, "tables", "layout")
    modules = [s for s in model.structs.values() if s.kind is Kind.MODULE]
    stubs = "".join(f'#include "{s.header}"\n' for s in modules) + "".join(
        f"void {s.snake_name}_reset({s.name} *m)\n{{\n    (void)m;\n}}\n"
        f"void {s.snake_name}_update({s.name} *m, Tick t)\n{{\n    (void)m;\n    (void)t;\n}}\n"
        + f"const CommandService {s.snake_name}_service = {{0}};\n" * s.service for s in modules)
    foreign = '#include "sim/table.h"\n' + "".join(
        f"extern const FledgeStruct fledge_struct_{s.name};\n"
        f"const FledgeStruct fledge_struct_{s.name} = {{.size = {s.size}u}};\n"
        for s in model.structs.values() if not s.library)
    (folder / "stubs.c").write_text(stubs + foreign)
    for source in [*sources, folder / "stubs.c"]:
        assert compile_c(source, *includes).stderr == ""
    # -Bsymbolic: the tables refer to one another, not to tables of the same names that this process has loaded.
    subprocess.run(["gcc", "-shared", "-Wl,-Bsymbolic", "-o", folder / "tables.so",
                    *(f"{source}.o" for source in [*sources, folder / "stubs.c"])], check=True)
    return ctypes.CDLL(str(folder / "tables.so"))


def text(c):
    return None if c is None else c.decode()


def compare_field(c, f, so):
    assert (text(c.name), c.offset, c.size) == (f.name, f.offset, f.size)
    assert (TYPES[c.type], GROUPS[c.group]) == (f.type.name, f.group.value)
    flags = {flag for i, flag in enumerate(FLAGS) if c.flags & 1 << i}
    assert flags == f.clauses | ({"spare"} if f.is_spare else set()) and c.flags < 1 << len(FLAGS)
    bounds = f.bounds or Bounds()
    assert c.bounds == ((bounds.lo is not None) * 1 + (bounds.hi is not None) * 2
                        + bounds.lo_open * 4 + bounds.hi_open * 8)
    assert (c.lo, c.hi) == (bounds.lo or 0.0, bounds.hi or 0.0)
    assert tuple(c.shape[:c.ndim]) == f.shape and not any(c.shape[c.ndim:])
    assert text(c.count) == f.count
    assert text(c.distinct) == f.distinct
    assert text(c.unit) == (f.unit.text if f.unit else "")
    assert tuple(c.dims) == (f.unit.dims if f.unit else (0,) * 8)
    assert (text(c.ctype), text(c.doc)) == (f.ctype, f.doc)
    if f.struct:
        assert c.sub == ctypes.addressof(CStruct.in_dll(so, f"fledge_struct_{f.struct.name}"))
    else:
        assert c.sub is None
    if f.enum:
        values = [(text(v.name), v.value, text(v.doc))
                  for v in c.values.contents.values[:c.values.contents.n]]
        assert values == [(v.name, v.value, v.doc) for v in f.enum.values]
        assert (text(c.values.contents.name), text(c.values.contents.doc)) == (
            f.enum.name, f.enum.doc)
    else:
        assert not c.values


def compare_library(so, library):
    c_library = CLibrary.in_dll(so, f"fledge_library_{library.name}")
    assert (c_library.version, text(c_library.name)) == (4, library.name)
    assert c_library.n == len(library.structs)
    for pointer, s in zip(c_library.structs[:c_library.n], library.structs):
        c = pointer.contents
        assert ctypes.addressof(c) == ctypes.addressof(
            CStruct.in_dll(so, f"fledge_struct_{s.name}"))
        assert (text(c.name), text(c.doc), text(c.header), text(c.folder)) == (
            s.name, s.doc, s.header, s.folder)
        assert (KINDS[c.kind], c.size, c.align, c.hash) == (s.kind.value, s.size, s.align, s.hash)
        assert text(c.schema) == (schema.text(s) if s.kind is Kind.MESSAGE else None)
        for verb in ("reset", "update"):
            function = getattr(so, f"{s.snake_name}_{verb}") if s.kind is Kind.MODULE else None
            assert getattr(c, verb) == (ctypes.cast(function, ctypes.c_void_p).value
                                        if function else None)
        service = ctypes.c_char.in_dll(so, f"{s.snake_name}_service") if s.service else None
        assert c.service == (ctypes.addressof(service) if service is not None else None)
        assert bool(c.events) == bool(s.events)
        if s.events:
            assert ctypes.addressof(c.events.contents) == ctypes.addressof(
                CEnum.in_dll(so, f"fledge_enum_{s.events.name}"))
        assert c.n == len(s.fields)
        for c_field, f in zip(c.fields[:c.n], s.fields):
            compare_field(c_field, f, so)


def test_tables_read_back_as_the_model(model, tmp_path):
    so = link(model, tmp_path, [f"-I{ROOT}", "-Wcast-align=strict"])
    for name in model.library_names:
        compare_library(so, model.library(name))


DIFFICULT = r"""
/** Quotes ", a backslash \, a trigraph ??=, 100 %, and σ over
 *  two lines. */
typedef struct Difficult {
    Head head;
    double x[300]; ///< [-] in [-1e-300, 0.1]: "σ" ??) \n
""" + "".join(f"    double y{i}; ///< [m] {'meaning ' * 9}\n" for i in range(80)) + """
} Difficult;
/** A model. */
typedef struct Model {
    struct {
        double x; ///< [m] >= -2.5, < 1e22: x
    } par;
} Model;
"""


def test_difficult_texts_and_numbers_survive(tmp_path):
    write_header(tmp_path, "w/difficult.h", DIFFICULT)
    write_header(tmp_path, "m/user.h", '#include "w/difficult.h"\n' + """
/** A module. */
typedef struct UserModule {
    struct {
        Difficult x;
    } in;
} UserModule;
void user_module_reset(UserModule *m);
void user_module_update(UserModule *m, Tick t);
""")
    model = read_tree(tmp_path)
    assert len(schema.text(model.structs["Difficult"])) > 4095  # more than C99 promises to take
    compare_library(link(model, tmp_path, [f"-I{tmp_path}", f"-I{ROOT}"]), model.library("user"))


def test_tables_are_the_same_again(model):
    again = read_this()
    for name in EMITTERS:
        for library in model.library_names:
            assert EMITTERS[name](model.library(library)) == EMITTERS[name](again.library(library))


@needs("clang")
def test_clang_compiles_tables_too(model, tmp_path):
    for source in write(model, tmp_path, "tables"):
        assert compile_c(source, f"-I{ROOT}", compiler="clang").stderr == ""


# Layout

@pytest.mark.parametrize("compiler", ["gcc", "gcc -std=c11", *(pytest.param(compiler, marks=needs(*packages)) for (
    compiler, *packages) in (("clang", "clang"),
                             ("aarch64-linux-gnu-gcc", "gcc-aarch64-linux-gnu", "libc6-dev-arm64-cross"),
                             ("sparc64-linux-gnu-gcc -m32 -mcpu=v8", "gcc-sparc64-linux-gnu",
                              "libc6-dev-sparc64-cross")))])
def test_the_layout_holds_with_every_compiler(model, tmp_path, compiler):
    compiler, *options = compiler.split()
    if "-m32" in options:
        # The one header that Debian's 64-bit C library lacks lists functions that do not exist.
        (tmp_path / "gnu").mkdir()
        (tmp_path / "gnu/stubs-32.h").write_text("")
        options += ["-idirafter", str(tmp_path)]
    for source in write(model, tmp_path, "layout"):
        done = compile_c(source, f"-I{ROOT}", *options, compiler=compiler)
        assert (done.returncode, done.stderr) == (0, "")


def test_another_layout_does_not_compile(tmp_path):
    body = "/** M. */\ntypedef struct M {\n    Head head;\n    double x; ///< [m] x\n} M;"
    header = write_header(tmp_path, "m/m.h", body)
    source, = write(read_tree(tmp_path), tmp_path, "layout")
    assert compile_c(source, f"-I{tmp_path}", f"-I{ROOT}").returncode == 0
    header.write_text(header.read_text().replace("double x;", "uint64_t more;\n    double x;"))
    refused = compile_c(source, f"-I{tmp_path}", f"-I{ROOT}").stderr
    assert "fledge_layout_M_x" in refused and "is negative" in refused


def test_a_message_is_reversed_number_by_number(tmp_path):
    write_header(tmp_path, "m/x.h", """
typedef struct Part {
    int16_t x[3]; ///< [-] counts
    uint16_t y;   ///< [-] more
} Part;
/** M. */
typedef struct Msg {
    Head head;
    float a[2];    ///< [-] small
    Part parts[2]; ///< the parts
    int8_t b[2];   ///< [-] bytes
    char name[6];  ///< who
    Quality worst; ///< the worst
    uint32_t spare;
    Vec3 c;        ///< [m] a place
} Msg;
""")
    # A run goes on into the next field: head's quality and sequence, then a.
    assert orders.runs(read_tree(tmp_path).structs["Msg"]) == [(8, 1), (4, 4), (2, 8), (1, 8), (4, 2), (8, 3)]


# Schemas

def test_a_schema_is_written_as_agreed(tmp_path):
    write_header(tmp_path, "m/x.h", """
typedef struct Part {
    double q[2][4]; ///< [-] attitudes
} Part;
/** M. */
typedef struct Msg {
    Head head;
    Vec3 sigma_BR;    ///< [-]  MRP of B relative to R
    Mat3 I_B[2];      ///< [kg m^2] inertias
    Part parts[3];    ///< the parts
    double K;         ///< [N m / s] >= 0: gain; 0: off
    char name[6];     ///< who
    uint8_t flags[2]; ///< [-]
    Quality worst;    ///< the worst
    uint32_t spare;
} Msg;
""")
    assert schema.emit(read_tree(tmp_path).library("user")) == {"Msg.msg": """\
fledge/Head head  # head
float64[3] sigma_br  # sigma_BR [-] (3) MRP of B relative to R
float64[18] i_b  # I_B [kg m^2] (2, 3, 3) inertias
fledge/Part[3] parts  # parts (3) the parts
float64 k  # K [N m / s] gain; 0: off
char[6] name  # name (6) who
uint8[2] flags  # flags [-] (2)
uint32 worst  # worst the worst {NONE=0, STALE=1, DEGRADED=2, GOOD=3}
uint32 spare  # spare
""" + "=" * 80 + """
MSG: fledge/Head
int64 t  # t [ns] time of validity, since the start of the run
uint32 quality  # quality [-] how far the content may be trusted \
{NONE=0, STALE=1, DEGRADED=2, GOOD=3}
uint32 sequence  # sequence [-] counts the writings, from 1
""" + "=" * 80 + """
MSG: fledge/Part
float64[8] q  # q [-] (2, 4) attitudes
"""}


def cdr_offsets(definitions, name, at=0):
    """Where CDR puts the fields that a schema declares, as (true name, offset), and its end."""
    found = []
    for line in definitions[name]:
        kind, count, low, true = re.fullmatch(
            r"([\w/]+?)(?:\[(\d+)\])? ([a-z][a-z0-9_]*)  # (\w+)(?: .*)?", line).groups()
        assert low == true.lower()
        for i in range(int(count or 1)):
            if "/" in kind:
                inner, end = cdr_offsets(definitions, kind.split("/")[1], at)
                start, at = inner[0][1], end
            else:
                size = 1 if kind == "char" else int(re.search(r"\d+$", kind)[0]) // 8
                at += -at % size
                start, at = at, at + size
            if i == 0:
                found.append((true, start))
    return found, at


def test_a_structs_bytes_are_the_cdr_of_its_schema(model):
    for message in (s for s in model.structs.values() if s.kind is Kind.MESSAGE):
        first, *others = schema.text(message).split("=" * 80 + "\n")
        definitions = {message.name: first.splitlines()}
        for other in others:
            head, *lines = other.splitlines()
            definitions[head.removeprefix("MSG: fledge/")] = lines
        assert cdr_offsets(definitions, message.name) == (
            [(f.name, f.offset) for f in message.fields], message.size)


def test_a_message_with_padding_has_no_schema(model):
    message = model.structs["AttError"]
    *others, last = message.fields
    padded = replace(message, fields=(*others, replace(last, offset=last.offset + 8)),
                     size=message.size + 8)
    with pytest.raises(HeaderError, match="a message's bytes are its CDR; `AttError` has padding"):
        schema.text(padded)
    with pytest.raises(HeaderError, match=f"padding at byte {message.size}"):
        schema.text(replace(message, size=message.size + 8))


def test_the_reference_has_each_declaration_with_unit_condition_and_meaning(model):
    pages = reference.emit(model.library("flight"), ROOT)
    assert sorted(pages) == ["flight-messages.md", "flight-modules.md"]
    text = "".join(pages.values())
    for struct in model.library("flight").structs:
        assert text.count(f"\n### {struct.name}\n") == 1
        section = re.split(r"\n#", text.partition(f"\n### {struct.name}\n")[2])[0]
        rows = re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)
        assert sorted(rows) == sorted(f.name for f in struct.fields if not f.is_spare)
        assert ("\nSource: " in section) == ("Source: " in struct.doc)
    assert "| `K` | double | N m | required, > 0 | gain on the MRP error |" in text
    assert "| `error` | {ref}`AttError <c-atterror>` |" in text
    assert "| `QUALITY_STALE` | 1 | older than its wire allows |" in text
    assert "```text\nL = -gain (h - h_wanted),   h = sum J_i Omega_i g_i,   |L| <= torque_max\n```\n\nfrom" in text
    assert "After `hold` without new data" in text
    algorithm = text.partition("\n### WheelTorques\n")[2].partition("**Algorithm**\n\nMinimum-norm wheel torques.")[2]
    assert "```text\nu = -A^T (A A^T)^+ C L,\n```" in algorithm.partition("**Inputs**")[0]


@pytest.mark.parametrize("text, page", [
    ("One.\nTwo:\n   a = b\n     c\nthree `d_e` f_g.\n\nFour.",
     "One. Two:\n\n```text\na = b\n  c\n```\n\nthree `d_e` f\\_g.\n\nFour.\n"),
    ("a ` b", "a ` b\n"), ("", "")])
def test_comments_become_paragraphs_with_equations_as_they_are(text, page):
    assert reference.prose(text) == page


# --- the protocol with the ground ------------------------------------------------------------------

def test_the_protocol_has_the_numbers_of_the_header_and_records_without_gaps(model):
    files = EMITTERS["protocol"](model.library("flight"))
    assert len(files) == 2 and len(set(files.values())) == 1       # what runs, and what a type checker reads
    generated: dict = {}
    exec(next(iter(files.values())), generated)
    header = (ROOT / "flight/command/command.h").read_text(encoding="utf-8")
    for name, begin in (("Code", "CommandCode"), ("Reason", "CommandReason"), ("Action", "ListAction")):
        body = re.search(rf"enum {begin} \{{(.*?)\}} {begin};", header, re.S)[1]
        numbers = {word.partition("_")[2]: int(value) for word, value in re.findall(r"(\w+) = (\d+)", body)}
        assert len(numbers) > 5 and {member.name: int(member) for member in generated[name]} == numbers
    assert [member.name for member in generated["Stream"]] == ["EVENTS", "SELECTED", "FILES"]
    assert generated["DATA_MAX"] == int(re.search(r"COMMAND_DATA_MAX = (\d+)", header)[1]) and generated["FLAGS"] == {
        name: 1 << int(bit) for file in ("exec/bounds", "command/rules") for name, bit in re.findall(
            r"(\w+) = 1 << (\d)", (ROOT / f"flight/{file}.h").read_text(encoding="utf-8"))}
    for name, record in (("CommandReport", "REPORT_RECORD"), ("TelemetryText", "TEXT_RECORD"),
                         ("TelemetryHousekeeping", "HOUSEKEEPING_RECORD"), ("EventRecord", "EVENT_RECORD")):
        assert sum(int(kind[1:]) // 8 * n for _, kind, n in generated[record]) == model.structs[name].size
    assert EMITTERS["protocol"](model.library("world")) == {}
    with pytest.raises(ValueError, match="library `flight` lacks COMMAND_ALL, .*STORED_LISTS, of the protocol"):
        EMITTERS["protocol"](replace(model.library("flight"), constants={}))
