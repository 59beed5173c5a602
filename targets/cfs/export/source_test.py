# SPDX-License-Identifier: Apache-2.0
"""An exported app's folder: whole, clean under what a cFS tree imposes, for every version, beside other apps."""

import binascii
import re
import struct
import subprocess
from xml.etree import ElementTree

import pytest

import fledge
from fledge import cli, export
from fledge.commands import Dictionary, Reason
from fledge.elements import ELEMENTS
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.export import eds, sources, tables
from fledge.targets.cfs.testing import HERE, ROOT, Core, command, linked, read_tbl
from fledge.export.run_test import FLIGHT, WORLD
from fledge.export.source_test import MISSIONS, mission_of
from fledge.export.testing import COMPILERS
from tests.circles import long_after

STRICTER = ["-Wextra", "-Wconversion", "-Wmissing-prototypes"]
CFE = {"caelum": ["-I", HERE / "cfe", "-DCAELUM"], "draco": ["-I", HERE / "cfe"]}      # their headers, for an app


@pytest.fixture(scope="module")
def nadir():
    return export.read(fledge.load("nadir_spin"))


@pytest.fixture(scope="module")
def written(nadir, tmp_path_factory):
    folder = tmp_path_factory.mktemp("nadir") / "nadir"
    cfs.write(nadir, cfs.App("nadir"), folder)
    return folder


@pytest.mark.parametrize("version", ["caelum", "draco"])
@pytest.mark.parametrize("compiler", long_after(1, COMPILERS, "another compiler"))
def test_it_compiles_under_the_flags_and_headers_of_every_version(written, version, compiler, tmp_path):
    included = [*CFE[version], *linked.own(cfs.App("nadir"), written, tmp_path)]
    app = sorted((written / "fsw/src").rglob("*.c"))
    only = [file for file in app if file.name.startswith("nadir_") and "spin" not in file.name]
    assert {file.name for file in only} == {f"nadir_{n}.c" for n in ("app", "cmds", "dispatch", "flight", "mission",
                                                                     "params")}
    flags = [*linked.FLAGS, *STRICTER, *(["-Wcast-align=strict"] if compiler == "gcc" else [])]
    subprocess.run(list(map(str, [compiler, *flags, "-fsyntax-only", *included,
                                  *(only if version == "caelum" else app)])), check=True, cwd=tmp_path)
    subprocess.run(list(map(str, [compiler, *flags, "-fsyntax-only", *included,
                                  *sorted((written / "fsw/tables").glob("*.c"))])), check=True, cwd=tmp_path)


def test_an_app_for_flight_has_no_call_of_a_simulation(nadir, written, tmp_path):
    calls = re.compile(r"\b(getenv|setenv|mmap|futex|open|fopen|clock_gettime) *\(")
    texts = {file: file.read_text() for file in written.rglob("*.[ch]")}
    assert [file for file, text in texts.items() if calls.search(re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))] == []
    assert not [file for file in texts if "registers" in str(file.relative_to(written))]
    cfs.write(nadir, cfs.App("nadir"), tmp_path / "board", ())          # with registers in memory: none as well
    texts = {file: file.read_text() for file in (tmp_path / "board").rglob("*.c")}
    assert any(file.name == "nadir_attach.c" for file in texts)
    assert [file for file, text in texts.items() if calls.search(re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))] == []


def test_the_build_names_every_file_and_no_other(written):
    text = (written / "CMakeLists.txt").read_text()
    listed = set(re.findall(r"fsw/\S+\.c", text))
    there = {file.relative_to(written).as_posix() for file in written.glob("fsw/**/*.c")}
    assert listed == there
    assert set(re.findall(r"fsw/\S+\.c", (written / "unit-test/CMakeLists.txt").read_text())) == {
        file for file in there if "/src/" in file}
    assert "-ffp-contract=off" in text and "project(CFE_NADIR C)" in text
    headers = re.findall(r"nadir_\w+\.h", "".join((written / f"{scope}_build.cmake").read_text()
                                                  for scope in ("mission", "arch")))
    assert {f"default_{header}" for header in headers} == {file.name for file in (written / "config").iterdir()}


def test_the_data_sheet_has_every_packet_with_its_size_and_topic(nadir, written):
    ns = {"s": "http://www.ccsds.org/schema/sois/seds"}
    package = ElementTree.parse(written / "eds/nadir.xml").getroot().find("s:Package", ns)
    types = {type_.get("name"): type_ for type_ in package.find("s:DataTypeSet", ns)}
    sizes = {"CFE_HDR/TelemetryHeader": 16, "CFE_HDR/CommandHeader": 8, "BASE_TYPES/double": 8, "BASE_TYPES/float": 4}
    sizes |= {f"BASE_TYPES/{sign}int{bits}": bits // 8 for sign in ("", "u") for bits in (8, 16, 32, 64)}

    labels = {e.get("label"): e.get("value") for e in types["Head_quality"].iter(f"{{{ns['s']}}}Enumeration")}
    assert labels == {"QUALITY_NONE": "0", "QUALITY_STALE": "1", "QUALITY_DEGRADED": "2", "QUALITY_GOOD": "3"}

    def size(name):
        if name in sizes:
            return sizes[name]
        type_ = types[name]
        if type_.tag.endswith("ArrayDataType"):
            n = 1
            for dimension in type_.iter(f"{{{ns['s']}}}Dimension"):
                n *= int(dimension.get("size"))
            return n * size(type_.get("dataTypeRef"))
        encoding = [part for part in type_ if part.tag.endswith("DataEncoding")]
        if encoding:
            return int(encoding[0].get("sizeInBits")) // 8
        return (size(type_.get("baseType")) if type_.get("baseType") else 0) + sum(
            size(entry.get("type")) for entry in type_.iter(f"{{{ns['s']}}}Entry"))

    app = cfs.App("nadir")
    component = package.find("s:ComponentSet/s:Component", ns)
    interfaces = component.find("s:RequiredInterfaceSet", ns)
    packets = {interface.get("name"): interface.find("s:GenericTypeMapSet/s:GenericTypeMap", ns).get("type")
               for interface in interfaces}
    kinds = {interface.get("name"): interface.get("type").partition("/")[2].upper() for interface in interfaces}
    tables_ = tables.tables(nadir, app)
    for table in tables_:
        assert kinds.pop(table.name) == "TABLE" and size(packets[table.name]) == 8 + len(table.content)
    assert {f"NADIR_MISSION_{name}_TOPICID" for name in kinds} == set(app.topics(nadir))
    numbers = {v.get("name"): v.get("initialValue") for v in component.iter(f"{{{ns['s']}}}Variable")}
    assert len(set(numbers.values())) == len(kinds)     # of commands and of telemetry in one list
    for map_ in component.iter(f"{{{ns['s']}}}ParameterMap"):
        name = map_.get("interface")
        topic = app.topics(nadir)[f"NADIR_MISSION_{name}_TOPICID"]
        assert numbers[map_.get("variableRef")] == f"${{CFE_MISSION/{kinds[name]}_BASE_TOPICID}} + {topic}"
    for kind, messages in (("TLM", nadir.outputs), ("IN", nadir.inputs)):
        for message in messages:
            assert size(packets[f"{message.name.upper()}_{kind}"]) == 16 + message.struct.size
    reasons = 4 * len(Reason)
    assert (size(packets["HK_TLM"]), size(packets["FLIGHT_TLM"]), size(packets["REPORT_TLM"])) == (
        104 + reasons + reasons % 8, 48 + reasons, 40)
    assert size("ReadReportTlm") == 40 + 512 and size("ArmCmd") == 14
    for command in ("Write", "Stage"):                  # a command for each parameter, and none for another byte
        written_to = {(i, at) for i, table in enumerate(tables_) for at in range(len(table.content))}
        for name in (name for name in types if types[name].get("baseType") == f"{command}Cmd"):
            module, offset = (int(value.get("value")) for value in types[name].iter(f"{{{ns['s']}}}ValueConstraint"))
            assert name.startswith(f"{command}{tables_[module].name}_")
            part = {(module, at) for at in range(offset, offset + size(name) - 16)}
            assert part and part <= written_to
            written_to -= part
        assert not written_to


def test_a_sheet_leaves_to_others_what_is_theirs(nadir, tmp_path):
    app = cfs.App("nadir", wakeup=0x18D0, wires={"world.nav.orbit": 0x0890})
    text = str(cfs.emit(nadir, app)["eds/nadir.xml"])
    assert '"NAV_ATTITUDE_IN"' in text
    assert '"NAV_ORBIT_IN"' not in text and '"WAKEUP"' not in text


def test_a_sheet_has_no_type_for_two_things():
    types = eds.Types()
    assert [types.container("Same", [("A", type_, "")]) for type_ in ("x", "y", "x", "z", "y")] == [
        "Same", "Same_2", "Same", "Same_3", "Same_2"]
    assert "\n".join(types.lines).count("<ContainerDataType") == 3


def test_copies_are_the_files_as_they_are(written):
    for file in sorted((written / "fsw/src").rglob("*")):
        ours = ROOT / file.relative_to(written / "fsw/src")
        if ours.is_file():
            text = file.read_text()
            if file.suffix == ".c":
                first, _, text = text.partition("\n")
                assert first == '#include "nadir_names.h"'
            assert text == ours.read_text(), file


@pytest.mark.long("builds two apps")
def test_two_apps_are_linked_into_one_core_and_both_run(nadir, tmp_path):
    other = export.read(fledge.load("two_body_pointing"))
    apps = [(cfs.App("nav", 0xC0), nadir), (cfs.App("point", 0xE0), other)]
    for app, mission in apps:
        cfs.write(mission, app, tmp_path / "apps" / app.name)
    program = linked.build([(app, tmp_path / "apps" / app.name) for app, _ in apps], tmp_path / "run", options=["-O0"])
    core = Core(program)
    try:
        ready = set()
        core.until(lambda line: ready.update(a.name for a, m in apps if f"flies {m.title}" in line) or len(ready) == 2)
        core.send(command(0x18C0, 0, checksum=1))
        core.until("NAV 3: Command 0 (no operation), sequence 0, is refused: checksum")
        core.send(command(0x18E0, 0, checksum=1))
        core.until("POINT 3: Command 0 (no operation), sequence 0, is refused: checksum")
    finally:
        core.kill()
    # Whatever is seen from outside of an app has its prefix: the linker looked only at what these two have.
    for app, _ in apps:
        objects = sorted((tmp_path / "run/objects" / app.name).glob("*.o"))
        listed = subprocess.run(["nm", "-g", "--defined-only", *map(str, objects)], check=True, capture_output=True,
                                text=True).stdout
        assert [line for line in listed.splitlines() if len(line.split()) == 3
                and not line.split()[2].startswith(app.prefix + "_")] == []


def test_the_same_mission_gives_the_same_bytes_and_a_folder_of_the_same_is_left_alone(nadir, written):
    before = {file: file.stat().st_mtime_ns for file in written.rglob("*") if file.is_file()}
    cfs.write(export.read(fledge.load("nadir_spin", seed=9)), cfs.App("nadir"), written)
    assert before == {file: file.stat().st_mtime_ns for file in written.rglob("*") if file.is_file()}


@pytest.mark.parametrize("text, names", [
    ("int f(void) { return g(1); }\nstatic int h(int a)\n{ return a; }", {"f"}),
    ("/* int f(void) { */ const T table[2] = {{1}, {2}};\nstatic T other;\nextern const T third;", {"table"}),
    ("#define F(x) \\\n  int x(void) {\nunsigned long\nlong_one(const char *a,\n  int (*b)(int))\n{ if (a) { } }",
     {"long_one"}),
    ("typedef struct S { int a; } S;\nstruct S one;\nS *two, x;\nenum { A, B };\nstruct S;\nint f(void);",
     {"one", "two", "x"}),
    ('extern const S s;\nconst S s = {"int t(void) {", 1};\nint n;\nstatic inline int k(void) { return 0; }',
     {"s", "n"}),
])
def test_what_a_file_defines_for_others_is_found(text, names):
    assert sources.external(text) == names


@pytest.mark.long("builds an app")
def test_an_app_may_be_called_as_its_mission(nadir, tmp_path):
    cfs.write(nadir, cfs.App("nadir_spin"), tmp_path / "nadir_spin")
    linked.build([(cfs.App("nadir_spin"), tmp_path / "nadir_spin")], tmp_path / "run", options=["-O0"])


class Stub:
    """As much of a mission as the search for its source looks at."""
    title = "stub"

    def __init__(self, *paths):
        self.paths = paths

    def sources(self, roots):
        return list(self.paths)


def test_source_that_a_users_module_wraps_comes_along(tmp_path):
    files = {"flight/own/mod.h": '#include "flight/legacy/old.h"\n#include "flight/msg/head.h"\n',
             "flight/own/mod.c": '#include "flight/own/mod.h"\nvoid mod_update(void) { old_step(); }\n',
             "flight/own/mod_test.c": "int main(void) { return 0; }\n",
             "flight/legacy/old.h": "void old_step(void);\n",
             "flight/legacy/old.c": '#include "old.h"\n#include "part.h"\nvoid old_step(void) { part(); }\n',
             "flight/legacy/part.h": "void part(void);\n",
             "flight/legacy/part.c": '#include "part.h"\nvoid part(void) {}\n',
             "flight/legacy/unused.c": "void unused(void) {}\n"}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    collected = sources.collect(Stub("flight/own/mod.c"), [tmp_path, ROOT], {})
    assert {name for name in collected if (tmp_path / name).is_file()} == set(files) - {
        "flight/own/mod_test.c", "flight/legacy/unused.c"}
    assert "flight/msg/head.h" in collected
    with pytest.raises(export.ExportError, match="stub needs flight/none.c, which is in none of"):
        sources.collect(Stub("flight/none.c"), [tmp_path, ROOT], {})
    (tmp_path / "flight/legacy/part.h").write_text('#include "absent.h"\n')
    with pytest.raises(export.ExportError, match=r"flight/legacy/part\.h needs absent\.h"):
        sources.collect(Stub("flight/own/mod.c"), [tmp_path, ROOT], {})


# --- tables ----------------------------------------------------------------------------------------

@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("name", MISSIONS)
def test_table_files_read_back_as_the_parameters(name, order):
    mission = export.read(fledge.load(name))
    app = cfs.App("nav", order=order)
    for table in tables.tables(mission, app):
        content_id, subtype, full, about, content = read_tbl(tables.tbl(app, table))
        assert (content_id, subtype) == (b"cFE1", 8)
        assert full == f"NAV.{table.name}" and table.module.path in about and len(table.name) <= 15
        end = "<" if order == "little" else ">"
        layout, check = struct.unpack(end + "II", content[:8])
        content = content[8:]
        assert (layout, check) == (table.layout, 0x10000 + binascii.crc_hqx(content, 0xFFFF))
        for _, field, offset in export.leaves(table.fields):    # each number by itself, as a ground tool would
            letter = ELEMENTS[field.type].code
            n = field.size // struct.calcsize(letter)
            assert struct.unpack_from(f"{end}{n}{letter}", content, offset - table.start) == \
                struct.unpack_from(f"={n}{letter}", table.module.memory, offset)


@pytest.mark.parametrize("order", ["little", "big"])
def test_the_dictionary_says_the_order_of_the_bus(nadir, order, tmp_path):
    files = cfs.emit(nadir, cfs.App("nav", order=order))
    file = tmp_path / "packets.json"
    file.write_text(str(next(text for path, text in files.items() if path.endswith("_packets.json"))))
    assert Dictionary.load(file).order == order
    assert export.dictionary(nadir).order == "big"      # of its own board


def test_the_sources_of_tables_hold_the_same_bytes(written, nadir, tmp_path):
    app = cfs.App("nadir")
    for table in tables.tables(nadir, app):
        obj = tmp_path / f"{table.stem}.o"
        subprocess.run(list(map(str, ["gcc", *linked.FLAGS, "-Wcast-align=strict", *CFE["caelum"], "-I",
                                      written / "fsw/inc", *linked.own(app, written, tmp_path), "-c",
                                      written / f"fsw/tables/{table.stem}.c", "-o", obj])),
                       check=True)
        subprocess.run(["objcopy", "-O", "binary", "-j", ".data", obj, obj.with_suffix(".bin")], check=True)
        raw = obj.with_suffix(".bin").read_bytes()
        assert struct.pack("<II", table.layout, 0) + table.content in raw
        for text in (f"NADIR.{table.name}", f"{table.stem}.tbl", f"NADIR_{table.name}"):
            assert text.encode() + b"\0" in raw
        assert len(f"{table.stem}.tbl") <= 19


def test_long_names_are_shortened_and_stay_apart():
    taken = set()
    names = [tables.shortened(text, 8, taken) for text in ("controller_a", "controller_b", "Controlle", "short")]
    assert names == ["controll", "control2", "Control3", "short"] and len({n.lower() for n in names}) == 4


# --- what is refused -------------------------------------------------------------------------------

@pytest.mark.parametrize("arguments, says", [
    ([], "name the app, as in --app nav"),
    (["--app", "Nav"], "--app Nav: an app's name has 1 to 12"),
    (["--app", "navigation_computer"], "an app's name has 1 to 12"),
    (["--app", "sample_app"], "--app sample_app: a cFS build has this name already"),
    (["--app", "int"], "--app int: a cFS build has this name already"),
    (["--app", "nav", "--topic", "ten"], "--topic must be a number, as 0xC0; found ten"),
    (["--app", "nav", "--topic", "0x1A"], "0x0 to 0x1f are of the core's services"),
    (["--app", "nav", "--topic", "0x7A"], "0x80 to 0xbf are of the apps that come with cFS"),
    (["--app", "nav", "--wakeup", "soon"], "--wakeup must be a number, as 0xC0; found soon"),
    (["--app", "nav", "--topic", "0x55"], "0x60 to 0x63 are of the core's time service"),
    (["--app", "nav", "--wakeup", "0x2000"], "--wakeup: the message id of a command is 0x1800 to 0x1fff; found 0x2000"),
    (["--app", "nav", "--wakeup", "0x08C9"], "--wakeup: the message id of a command is 0x1800 to 0x1fff; found 0x08c9"),
    (["--app", "nav", "--input", "world.nav.orbit=0x18D0"], "--input world.nav.orbit: the message id of a telemetry is "
     "0x0800 to 0x0fff; found 0x18d0"),
    (["--app", "nav", "--wakeup", "own", "--simulated"], "--wakeup own: the clock of a board gives flight its time"),
    (["--app", "nav", "--wakeup", "0x18C0"], "NAV_CMD_MID and NAV_WAKEUP_MID would both be 0x18c0"),
    (["--app", "nav", "--input", "world.nav=0x0890"], "--input world.nav: nadir_spin has no such input from outside; "
     "it has world.nav.attitude, world.nav.orbit, world.wheels.speeds"),
    (["--app", "nav", "--input", "world.nav.orbit=0x08C3"], "NAV_WHEELS_WHEELS_TLM_MID and NAV_NAV_ORBIT_IN_MID "
     "would both be 0x08c3; one message id has one writer"),
    (["--app", "nav", "--topic", "0x7FC"], "needs topics up to 0x80a; the highest is 0x7ff"),
])
def test_the_command_writes_nothing_where_it_refuses(arguments, says, tmp_path, capsys):
    out = tmp_path / "apps/nav"
    assert cli.main(["export", "cfs", "nadir_spin", *arguments, "--out", str(out)]) == 2
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_ids_that_another_app_of_the_tree_has_are_refused(tmp_path, capsys):
    other = tmp_path / "apps/dish/fsw/platform_inc/dish_msgids.h"
    other.parent.mkdir(parents=True)
    topics = tmp_path / "apps/lamp/fsw/inc/lamp_topicids.h"            # as 7.x has them
    topics.parent.mkdir(parents=True)
    topics.write_text("#define LAMP_MISSION_CMD_TOPICID LAMP_MISSION_TIDVAL(CMD)\n"
                      "#define DEFAULT_LAMP_MISSION_CMD_TOPICID 224 /* 0xE0 */\n")
    assert cli.main(["export", "cfs", "nadir_spin", "--app", "nav", "--topic", "0xE0", "--out",
                     str(tmp_path / "apps/nav")]) == 2
    assert "NAV_CMD_MID would be 0x18e0, which is DEFAULT_LAMP_MISSION_CMD_TOPICID in" in capsys.readouterr().err
    topics.unlink()
    other.write_text("#define DISH_CMD_MID      0x18A1\n#define DISH_HK_TLM_MID DISH_TOPIC\n"
                     "#define DISH_X_MID (0x08C4)\n")
    out = tmp_path / "apps/nav"
    assert cli.main(["export", "cfs", "nadir_spin", "--app", "nav", "--out", str(out)]) == 2
    assert "NAV_GUIDANCE_REFERENCE_TLM_MID would be 0x08c4, which is DISH_X_MID in" in capsys.readouterr().err
    assert not out.exists()
    assert cli.main(["export", "cfs", "nadir_spin", "--app", "nav", "--topic", "0xE0", "--out", str(out)]) == 0
    assert "NAV_CMD_MID" in (out / "config/default_nav_msgids.h").read_text()
    # Another exported app is known by its topics.
    assert cli.main(["export", "cfs", "nadir_spin", "--app", "star", "--topic", "0xE2", "--out",
                     str(tmp_path / "apps/star")]) == 2
    assert "which is NAV_MISSION_WAKEUP_TOPICID in" in capsys.readouterr().err
    # So is one in another folder, if it is named.
    star = ["export", "cfs", "nadir_spin", "--app", "star", "--topic", "0xE2", "--out"]
    assert cli.main([*star, str(tmp_path / "there/star"), "--beside", str(tmp_path / "nowhere")]) == 2
    assert "nowhere: there is no such folder" in capsys.readouterr().err
    assert cli.main([*star, str(tmp_path / "there/star"), "--beside", str(out)]) == 2
    assert "which is NAV_MISSION_WAKEUP_TOPICID in" in capsys.readouterr().err
    # Again into the same place: its own ids are no conflict.
    assert cli.main(["export", "cfs", "nadir_spin", "--app", "nav", "--topic", "0xE0", "--out", str(out)]) == 0


def test_a_folder_that_cannot_be_written_leaves_nothing(nadir, tmp_path):
    (tmp_path / "apps/nav/fsw").mkdir(parents=True)
    (tmp_path / "apps/nav/fsw/src").write_text("a file where a folder shall be")
    with pytest.raises(OSError):
        cfs.write(nadir, cfs.App("nav"), tmp_path / "apps/nav")
    assert sorted(p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")) == [
        "apps", "apps/nav", "apps/nav/fsw", "apps/nav/fsw/src"]


@pytest.mark.long("compiles each")
@pytest.mark.parametrize("what", ["triple_spiral", "words", "subset"])
def test_rasters_words_modes_and_subsets_compile_as_well(what, tmp_path):
    files, tasks = (), None
    sim = fledge.load("nadir_spin" if what == "words" else what if what != "subset" else
                      mission_of(tmp_path, FLIGHT, WORLD))
    if what == "words":
        files = [ROOT / "missions/nadir_spin/converters.toml"]
    if what == "subset":
        tasks = ["control"]
    folder = tmp_path / "apps/part"
    cfs.write(export.read(sim, tasks=tasks), cfs.App("part"), folder, files)
    if what == "subset":
        assert "0 wait, 1 point, 2 rest" in (folder / "config/default_part_msgdefs.h").read_text()
    sources_ = [*(folder / "fsw/src").glob("*.c"), *(folder / "fsw/tables").glob("*.c")]
    subprocess.run(list(map(str, ["gcc", *linked.FLAGS, *STRICTER, "-fsyntax-only", *CFE["draco"],
                                  *linked.own(cfs.App("part"), folder, tmp_path), *sources_])), check=True)
