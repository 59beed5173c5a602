# SPDX-License-Identifier: Apache-2.0
"""What is read of an FMU, and each refusal with its line."""

import os
import stat
import zipfile

import pytest

from fledge.errors import SetupError
from fledge.fmi import Archive, Description, archive as module
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
    ({TEXT: GOOD, "resources/zeros": bytes(100 << 20)}, "grows from .* bytes; more than 500 times is refused"),
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
def test_what_is_no_fmu_or_not_safe_is_refused(tmp_path, entries, says):
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
