# SPDX-License-Identifier: Apache-2.0
"""What is read of an FMU, and each refusal with its line."""

import os
import signal
import stat
import subprocess
import sys
import time
import zipfile

import pytest

from fledge.errors import SetupError
from fledge.fmi import Archive, Description, archive as module, description
from fmi.testing import oscillator


@pytest.mark.parametrize("version", [2, 3])
def test_an_archive_is_unpacked_for_as_long_as_it_is_used(tmp_path, version):
    archive = Archive(oscillator.make(tmp_path, version))
    folder = archive.library.parents[2]
    assert archive.library.read_bytes() == oscillator.library().read_bytes() and archive.resources.is_dir()
    del archive
    assert not folder.exists()


def test_one_file_is_unpacked_once(tmp_path):
    path = oscillator.make(tmp_path)
    first = module.opened(path)
    assert module.opened(os.path.relpath(path)) is first
    os.utime(path, ns=(1, 1))
    assert module.opened(path) is not first


def packed(folder, entries):
    path = folder / "x.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return path


def link(name):
    entry = zipfile.ZipInfo(name)
    entry.external_attr = (stat.S_IFLNK | 0o777) << 16
    return entry


GOOD = oscillator.description(3)
TEXT = "modelDescription.xml"


@pytest.mark.parametrize(("entries", "says"), [
    ({"../../etc/x": b""}, "the archive has '../../etc/x', which leaves its folder"),
    ({"/etc/x": b""}, "the archive has '/etc/x', which leaves its folder"),
    ({"resources\\..\\x": b""}, "which leaves its folder"),
    ({"C:/x": b""}, "which leaves its folder"),
    ({link("resources/x"): b"/etc/passwd"}, "the archive has 'resources/x', which is a link or device"),
    ({"a/modelDescription.xml": GOOD}, "has no modelDescription.xml at its top, but a"),
    ({TEXT: GOOD, **{f"resources/{i}": bytes(30 << 20) for i in range(3)}},
     "the archive grows from .* to 94,3.* bytes; more than 500 times is refused"),
    ({TEXT: GOOD.replace('valueReference="2"', 'valueReference="4294967296"')},
     "valueReference of <Float64>: expected a number from 0 to 4,294,967,295; found 4294967296"),
    ({TEXT: GOOD.replace('valueReference="2"', 'valueReference="-1"')}, "expected a number from 0 to .*; found -1"),
    ({TEXT: GOOD.replace('factor="0.01"', 'factor="0"')}, "factor of the unit 'cm/s': expected a number that is not 0"),
    ({TEXT: GOOD.replace('name="cm/s"', "")}, "<Unit> has no name"),
    ({TEXT: GOOD.replace('name="x0"', 'name="x0" min="low"')}, "min of 'x0': expected a number; found 'low'"),
    ({TEXT: GOOD.replace('Dimension start="3"', f'Dimension start="{"9" * 4000}"')},
     "<Dimension>: a number of 4,000 digits; at most 1,000,000 elements are read"),
    ({TEXT: GOOD.replace('<Float64 name="in.array"', "".join(
        f'<Float64 name="a{i}" valueReference="{i}"><Dimension start="600000"/></Float64>' for i in (90, 91))
        + '<Float64 name="in.array"')}, "'a91' has 600,000 elements, and 1,200,000 with the arrays before it"),
    ({TEXT: GOOD.replace("<ModelVariables>", f"<ModelVariables>{'<a/>' * 5_001}")}, "more than 5,000 elements"),
    ({TEXT: "hello"}, f"x.fmu: {TEXT}, line 1: expected XML; syntax error"),
    ({TEXT: "<a>\n<b></a>"}, f"{TEXT}, line 2: expected XML; mismatched tag"),
    ({TEXT: "<a/>"}, "expected <fmiModelDescription>; found <a>"),
    ({TEXT: '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]>\n<a>&c;</a>'}, "expected no document type"),
    ({TEXT: GOOD.replace('"3.0"', '"1.0"', 2)}, "line 2: this FMU is of FMI 1.0; Fledge flies 2.0 and 3.0"),
    ({TEXT: GOOD.replace("<CoSimulation", "<ModelExchange")}, "this FMU is for ModelExchange alone"),
    ({TEXT: GOOD.replace("<CoSimulation", '<CoSimulation needsExecutionTool="true"')}, "needs another program to run"),
    ({TEXT: GOOD.replace('instantiationToken="oscillator"', "")}, "<fmiModelDescription> has no instantiationToken"),
    ({TEXT: GOOD.replace('name="v"', 'name="x"')}, "two variables have the name 'x'"),
    ({TEXT: GOOD.replace('valueReference="2"', 'valueReference="two"')}, "expected a number; found 'two'"),
    ({TEXT: GOOD.replace('Dimension start="3"', 'Dimension start="-3"')}, "expected a whole number; found '-3'"),
    ({TEXT: GOOD.replace('Dimension start="3"', 'Dimension start="9999999"')}, "'in.array' has 9,999,999 elements"),
    ({TEXT: GOOD.replace('Dimension start="3"', 'Dimension start="2"')}, "'in.array' has 2 elements; its start has 3"),
    ({TEXT: GOOD.replace('Identifier="oscillator"', 'Identifier="../x"')}, "expected a name; found '../x'"),
    ({TEXT: GOOD}, "has no binaries/[a-z0-9_]+-linux/oscillator.so for this system; it has binaries for no system"),
    ({TEXT: GOOD, "binaries/x86_64-windows/oscillator.dll": b"", "sources/a.c": b""},
     "it has binaries for x86_64-windows; it has sources"),
])
def test_what_is_no_fmu_or_not_safe_is_refused(tmp_path, monkeypatch, entries, says):
    monkeypatch.setattr(description, "MOST_TAGS", 5_000)
    with pytest.raises(SetupError, match=says) as refused:
        Archive(packed(tmp_path, entries))
    assert "x.fmu: " in str(refused.value) and "\n" not in str(refused.value)


def test_a_file_that_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "x.fmu"
    with pytest.raises(SetupError, match="x.fmu: expected an FMU; No such file"):
        Archive(path)
    path.write_bytes(b"no zip at all")
    with pytest.raises(SetupError, match="x.fmu: expected an FMU, which is a zip archive"):
        Archive(path)
    data = bytearray(oscillator.make(tmp_path).read_bytes())
    data[100:200] = bytes(100)
    path.write_bytes(data)
    with pytest.raises(SetupError, match="x.fmu: expected an FMU, which is a zip archive"):
        Archive(path)


def test_names_of_an_archive_may_begin_with_the_folder_itself(tmp_path):
    path = oscillator.make(tmp_path)
    with zipfile.ZipFile(path) as archive:
        entries = {f"./{name}": archive.read(name) for name in archive.namelist()}
    assert Archive(packed(tmp_path, {"./": b"", **entries})).description.name == "Oscillator"


def test_other_methods_than_deflate_are_refused(tmp_path):
    path = oscillator.make(tmp_path)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_LZMA) as archive:
        archive.writestr("resources/x", b"x")
    with pytest.raises(SetupError, match="'resources/x' is packed by method 14 of zip, and FMI allows 0"):
        Archive(path)


def test_what_is_not_read_of_a_description_does_not_count(monkeypatch):
    monkeypatch.setattr("fledge.fmi.description.MOST_TAGS", 10)
    assert list(described(2, "", "<LogCategories><Category/></LogCategories>" * 10).variables) == []


def test_an_empty_type_is_none_of_a_variable():
    variable = described(2, '<ScalarVariable name="x" valueReference="1"><Real declaredType="T"/></ScalarVariable>',
                         '<TypeDefinitions><SimpleType name="T"/></TypeDefinitions>').variables["x"]
    assert variable.type == "Float64" and variable.unit is None


def test_a_full_folder_is_named(tmp_path):
    path = oscillator.make(tmp_path)
    script = ("import sys; from fledge import SetupError; from fledge.fmi import Archive\n"
              "try:\n    Archive(sys.argv[1])\nexcept SetupError as error:\n    print(error)")
    within = f"mount -t tmpfs -o size=8k,mode=777 none {tmp_path}/small && exec \"$@\""
    (tmp_path / "small").mkdir()
    done = subprocess.run(["unshare", "-rm", "sh", "-c", within, "sh", sys.executable, "-c", script, path], text=True,
                          env={**os.environ, "TMPDIR": f"{tmp_path}/small"}, capture_output=True)
    if "unshare" in done.stderr or "mount" in done.stderr:
        pytest.skip("a folder of its own cannot be mounted here")
    assert done.stdout == (f"{path}: no room to unpack it in {tmp_path}/small: No space left on device; make room "
                           "there, or give another folder by TMPDIR\n")


def test_a_killed_program_leaves_no_folder(tmp_path):
    script = ("import signal, sys; from fledge.fmi import Archive\n"
              "archive = Archive(sys.argv[1]); print(archive.library, flush=True); signal.pause()")
    with subprocess.Popen([sys.executable, "-c", script, oscillator.make(tmp_path)], text=True,
                          env={**os.environ, "TMPDIR": str(tmp_path)}, stdout=subprocess.PIPE) as program:
        library = program.stdout.readline().strip()
        assert os.path.isfile(library) and library.startswith(f"{tmp_path}/fledge-fmu-")
        os.kill(program.pid, signal.SIGKILL)
    until = time.monotonic() + 20
    while list(tmp_path.glob("fledge-fmu-*")):
        assert time.monotonic() < until
        time.sleep(0.01)


def test_a_limit_of_files_and_bytes_holds(tmp_path, monkeypatch):
    path = oscillator.make(tmp_path)
    monkeypatch.setattr(module, "MOST_FILES", 1)
    with pytest.raises(SetupError, match="the archive has 2 files of .* at most 1 files"):
        Archive(path)


def described(version, variables, more=""):
    token = "guid" if version == 2 else "instantiationToken"
    return Description.read(f"""<fmiModelDescription fmiVersion="{version}.0" modelName="a" {token}="1">
        <CoSimulation modelIdentifier="a"/>{more}<ModelVariables>{variables}</ModelVariables><ModelStructure/>
        </fmiModelDescription>""".encode(), "a.fmu")


def test_scalars_with_indices_are_an_array_if_none_is_missing():
    def rows(*names):
        return "".join(f'<ScalarVariable name="{name}" valueReference="{10 - i}" causality="input"><Real start="{i}"/>'
                       "</ScalarVariable>" for i, name in enumerate(names))

    matrix = described(2, rows("A[1,1]", "A[1, 2]", "A[2,1]", "A[2,2]")).variables["A"]
    assert matrix.shape == (2, 2) and matrix.references == (10, 9, 8, 7) and matrix.start == ("0", "1", "2", "3")
    turned = described(2, rows("v[2]", "v[1]")).variables["v"]
    assert turned.references == (9, 10) and turned.start == ("1", "0")
    assert list(described(2, rows("v[1]", "v[3]")).variables) == ["v[1]", "v[3]"]
    assert list(described(2, rows("v[0]", "v[1]")).variables) == ["v[0]", "v[1]"]
    assert list(described(2, rows("v", "v[1]")).variables) == ["v", "v[1]"]


def test_dimensions_follow_a_structural_parameter_and_types_give_units():
    d = described(3, """<UInt64 name="n" valueReference="1" causality="structuralParameter" start="2"/>
        <Float64 name="v" valueReference="2" declaredType="Speed" start="1"><Dimension valueReference="1"/>
        <Dimension start="3"/></Float64>""", """<UnitDefinitions><Unit name="km/h"><BaseUnit m="1" s="-1"
        factor="0.2777777777777778"/></Unit></UnitDefinitions><TypeDefinitions><Float64Type name="Speed" unit="km/h"
        min="0"/></TypeDefinitions>""")
    v = d.variables["v"]
    assert v.shape == (2, 3) and v.start == ("1",) * 6 and v.lo == "0"
    assert v.unit.dims == (1, 0, -1, 0, 0, 0, 0, 0) and v.unit.factor == 0.2777777777777778
