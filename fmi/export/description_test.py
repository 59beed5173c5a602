# SPDX-License-Identifier: Apache-2.0
"""Descriptions of the flight of all missions keep the rules of the standard; where FLEDGE_TEST_DATA has its schemas, in
fmi/3.0/*.xsd and fmi/2.0/*.xsd, xmllint checks them, too."""

import os
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest

import fledge
from fledge.disk import ROOT
from fledge.export import read_all
from fledge.export.fmu.description import build_description, description, terminals
from fledge.export.fmu.mission import facts, layout
from fledge.units import BASE
from tests.needs import needs

MISSIONS = sorted(path.parent.name for path in (ROOT / "missions").glob("*/flight.py"))
DATA = Path(os.environ.get("FLEDGE_TEST_DATA", ROOT.parent / "shared" / "data")) / "fmi"
NAME = re.compile(r"[A-Za-z_]\w*(\[\d+(,\d+)*\])?(\.[A-Za-z_]\w*(\[\d+(,\d+)*\])?)*", re.ASCII)
VERSIONS = pytest.mark.parametrize("version", ["3.0", "2.0"])


@pytest.fixture(scope="module")
def processes():
    return [(facts(mission), layout(mission)) for name in MISSIONS for mission in read_all(fledge.load(name))]


def variables_of(root):
    """(attributes, tag, attributes of its type, element) of each variable, in both versions."""
    for element in root.find("ModelVariables"):
        inner = element[0] if element.tag == "ScalarVariable" else element
        yield element.attrib, inner.tag, inner.attrib, element


def check(root, version):
    rows = list(variables_of(root))
    outside = [row[0] for row in rows]
    names, references = [a["name"] for a in outside], [a["valueReference"] for a in outside]
    assert len(set(names)) == len(names) and len(set(references)) == len(references)
    assert all(map(NAME.fullmatch, names))
    assert [a["causality"] for a in outside].count("independent") == 1
    units = {unit.attrib["name"]: unit.find("BaseUnit").attrib for unit in root.iter("Unit")}
    types = {t.attrib["name"]: [int(i.attrib["value"]) for i in t.iter("Item")] for t in root.find("TypeDefinitions")}
    assert not set(types) & set(names)
    for attributes, tag, inner, element in rows:
        has_start = "start" in inner or element.find("Start") is not None
        assert has_start == (attributes["causality"] in ("input", "parameter"))
        assert (attributes["variability"] in ("fixed", "tunable")) == (attributes["causality"] == "parameter")
        assert attributes["variability"] != "continuous" or tag in ("Float64", "Float32", "Real")
        assert "unit" not in inner or inner["unit"] in units
        for value in map(float, inner.get("start", "0").split() if tag not in ("String",) else []):
            assert float(inner.get("min", value)) <= value <= float(inner.get("max", value))
        if tag == "Enumeration":
            items = types[inner["declaredType"]]
            assert len(set(items)) == len(items) and all(int(x) in items for x in inner.get("start", "").split())
    for factors in units.values():
        assert set(factors) <= {*BASE, "factor"}
    outputs = [(str(i), a["valueReference"]) for i, a in enumerate(outside, 1) if a["causality"] == "output"]
    structure = root.find("ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        found = ([row.attrib["valueReference"] for row in structure.iter(kind)] if version == "3.0" else
                 [row.attrib["index"] for row in structure.find(f"{kind}s")])
        assert found == [reference if version == "3.0" else index for index, reference in outputs]


@VERSIONS
def test_descriptions_keep_the_rules(processes, version):
    assert len(processes) >= 20
    for about, variables in processes:
        root = ElementTree.fromstring(description(about, variables, version, "0"))
        check(root, version)
        parts = [part.tag for part in root]
        assert parts.index("ModelVariables") + 1 == parts.index("ModelStructure")


def test_arrays_of_3_are_the_elements_of_2(processes):
    """The elements of 2.0 have the name and value reference of the array of 3.0, and count on."""
    for about, variables in processes:
        three, two = ({a["name"]: (int(a["valueReference"]), element) for a, _, _, element in variables_of(
            ElementTree.fromstring(description(about, variables, version, "0")))} for version in ("3.0", "2.0"))
        for name, (reference, element) in three.items():
            lengths = [int(d.attrib["start"]) for d in element.findall("Dimension")]
            if not lengths and element.tag not in ("Clock", "Binary"):
                assert two.pop(name)[0] == reference
            for i in range(lengths[-1] if lengths else 0):
                first = f"{name}[{','.join(['1'] * (len(lengths) - 1) + [str(i + 1)])}]"
                assert two.pop(first)[0] == reference + i
        assert all("[" in name and "," in name for name in two)     # further rows


@needs("libxml2-utils")
@pytest.mark.skipif(not DATA.is_dir(), reason=f"not here: {DATA}")
def test_the_schemas_of_the_standard_hold(processes, tmp_path):
    for about, variables in processes:
        texts = {"3.0/fmi3ModelDescription.xsd": description(about, variables, "3.0", "0"),
                 "2.0/fmi2ModelDescription.xsd": description(about, variables, "2.0", "0"),
                 "3.0/fmi3TerminalsAndIcons.xsd": terminals(variables),
                 "3.0/fmi3BuildDescription.xsd": build_description(
                     replace(about, sources=["a.c", "b.cpp"], needs={"m": "of C"}), "-O2")}
        for schema, text in texts.items():
            (tmp_path / "file.xml").write_text(text, encoding="utf-8")
            subprocess.run(["xmllint", "--noout", "--schema", DATA / schema, tmp_path / "file.xml"], check=True)
