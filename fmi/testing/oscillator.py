# SPDX-License-Identifier: Apache-2.0
"""The FMU of oscillator.c, for tests of importers."""
from __future__ import annotations

import functools
import os
import subprocess
import tempfile
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
FLAGS = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}"]

# Of tests in which it crashes.
CRASH = pytest.mark.skipif(os.environ.get("FLEDGE_PRESET") == "asan",
                           reason="the sanitizers report crashes themselves")


class Variable(NamedTuple):
    reference: int
    name: str
    type: str               # of 3.0
    causality: str
    start: str = "0"
    unit: str = ""
    variability: str = ""
    n: int = 1


_ECHO = [("f32", "Float32"), ("i8", "Int8"), ("u8", "UInt8"), ("i16", "Int16"), ("u16", "UInt16"), ("i32", "Int32"),
         ("u32", "UInt32"), ("i64", "Int64"), ("u64", "UInt64"), ("flag", "Boolean"), ("text", "String"),
         ("choice", "Enumeration"), ("array", "Float64")]
_STARTS = {"Boolean": "false", "String": "", "Enumeration": "1"}

VARIABLES = [
    Variable(0, "time", "Float64", "independent", unit="s"),
    Variable(1, "x", "Float64", "output", unit="m"),
    Variable(2, "v", "Float64", "output", unit="cm/s"),
    Variable(3, "force", "Float64", "input", unit="N"),
    Variable(4, "omega", "Float64", "parameter", "2", "rad/s", "tunable"),
    Variable(5, "x0", "Float64", "parameter", "1", "m", "fixed"),
    Variable(6, "longest", "Float64", "parameter", "0", "s", "tunable"),
    Variable(7, "every", "Float64", "parameter", "0", "s", "fixed"),
    Variable(8, "events", "Int32", "output"),
    Variable(9, "tick", "Clock", "output"),
    *(Variable(base + i, f"{group}.{name}", kind, causality, _STARTS.get(kind, "0"), n=3 if name == "array" else 1)
      for base, group, causality in ((10, "in", "input"), (30, "out", "output"))
      for i, (name, kind) in enumerate(_ECHO)),
]
_UNITS = {"s": 's="1"', "m": 'm="1"', "N": 'kg="1" m="1" s="-2"', "rad/s": 'rad="1" s="-1"',
          "cm/s": 'm="1" s="-1" factor="0.01"'}
_OLD = {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean", "String": "String", "Enumeration": "Enumeration"}


def description(version: int, capabilities: str = "", token: str = "oscillator") -> str:
    """The modelDescription.xml. capabilities: attributes of <CoSimulation>; without any, all that there are."""
    units = "".join(f'<Unit name="{name}"><BaseUnit {base}/></Unit>' for name, base in _UNITS.items())
    items = "".join(f'<Item name="{name}" value="{value}"/>' for name, value in (("OFF", 1), ("ON", 2)))
    if version == 3:
        capabilities = capabilities or ('canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true" '
                                        'canSerializeFMUState="true" hasEventMode="true" '
                                        'canReturnEarlyAfterIntermediateUpdate="true"')
        variables = "".join(map(_new, VARIABLES))
        outputs = "".join(f'<Output valueReference="{v.reference}"/>' for v in VARIABLES if v.causality == "output")
        return (f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="3.0" modelName="Oscillator" '
                f'instantiationToken="{token}"><CoSimulation modelIdentifier="oscillator" {capabilities}/>'
                f'<UnitDefinitions>{units}</UnitDefinitions><TypeDefinitions><EnumerationType name="Choice">{items}'
                f'</EnumerationType></TypeDefinitions><ModelVariables>{variables}</ModelVariables><ModelStructure>'
                f'{outputs}</ModelStructure></fmiModelDescription>\n')
    capabilities = capabilities or ('canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true" '
                                    'canSerializeFMUstate="true"')
    scalars = [v for each in VARIABLES if each.type in _OLD for v in _elements(each)]
    outputs = "".join(f'<Unknown index="{i}"/>' for i, v in enumerate(scalars, 1) if v.causality == "output")
    return (f'<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="2.0" modelName="Oscillator" '
            f'guid="{token}"><CoSimulation modelIdentifier="oscillator" {capabilities}/><UnitDefinitions>{units}'
            f'</UnitDefinitions><TypeDefinitions><SimpleType name="Choice"><Enumeration>{items}</Enumeration>'
            f'</SimpleType></TypeDefinitions><ModelVariables>{"".join(map(_old, scalars))}</ModelVariables>'
            f'<ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>\n')


def _variability(v: Variable, discrete: bool) -> str:
    return f'variability="{v.variability or ("discrete" if discrete else "continuous")}"'


def _new(v: Variable) -> str:
    facts = (f'name="{v.name}" valueReference="{v.reference}" causality="{v.causality}" '
             + _variability(v, not v.type.startswith("Float")))
    if v.type == "Clock":
        return f'<Clock {facts} intervalVariability="triggered"/>'
    starts = v.causality in ("input", "parameter")
    start = f' start="{" ".join([v.start] * v.n)}"' if starts and v.type != "String" else ""
    kind = ' declaredType="Choice"' if v.type == "Enumeration" else ""
    unit = f' unit="{v.unit}"' if v.unit else ""
    inside = f'<Dimension start="{v.n}"/>' * (v.n > 1)
    inside += f'<Start value="{v.start}"/>' * (starts and v.type == "String")
    return f"<{v.type} {facts}{kind}{unit}{start}>{inside}</{v.type}>"


def _elements(v: Variable) -> list[Variable]:
    return [v] if v.n == 1 else [v._replace(reference=v.reference + i, name=f"{v.name}[{i + 1}]", n=1)
                                 for i in range(v.n)]


def _old(v: Variable) -> str:
    start = f' start="{v.start}"' if v.causality in ("input", "parameter") else ""
    kind = ' declaredType="Choice"' if v.type == "Enumeration" else ""
    unit = f' unit="{v.unit}"' if v.unit else ""
    return (f'<ScalarVariable name="{v.name}" valueReference="{v.reference}" causality="{v.causality}" '
            f'{_variability(v, v.type != "Float64")}><{_OLD[v.type]}{kind}{unit}{start}/></ScalarVariable>')


@functools.cache
def library(compiler: str = "gcc") -> Path:
    """oscillator.so, compiled once in a run of tests."""
    folder = Path(tempfile.mkdtemp(prefix="oscillator-"))
    subprocess.run([compiler, *FLAGS, "-shared", "-fPIC", "-Wl,-Bsymbolic", "-o", folder / "oscillator.so",
                    ROOT / "fmi/testing/oscillator.c", "-lm"], check=True)
    return folder / "oscillator.so"


def make(folder: Path, version: int = 3, text: str | None = None, name: str = "oscillator.fmu") -> Path:
    """Write the FMU into a folder. text: of its modelDescription.xml."""
    path = folder / name
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text or description(version))
        archive.write(library(), f"binaries/{'x86_64-linux' if version == 3 else 'linux64'}/oscillator.so")
    return path
