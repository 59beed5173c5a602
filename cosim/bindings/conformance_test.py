# SPDX-License-Identifier: Apache-2.0
"""Frames, definitions and messages as C++ writes and refuses them (tools/testing/frames.cpp), in both byte orders:
Python reads the same bytes and writes them again; what C++ refuses, Python refuses for the same reason."""
import subprocess
import sys
from pathlib import Path

import pytest

import _core

HERE = Path(__file__).resolve().parent
FRAMES = Path(_core.__file__).resolve().parents[1] / "cosim/cosim_frames"
pytestmark = pytest.mark.skipif(not FRAMES.exists(), reason="cosim_frames is not built")

sys.path.insert(0, str(HERE / "python"))
from fledge_node import KINDS, NodeError, Schema, _Reader, _Writer  # noqa: E402

# What the body of each kind holds, from protocol.h: B I Q are integers, p bytes, S a schema, R a record, [] a list;
# before the name of a field n is a name, t lines, q a time, d a duration. Nodes in Python read no flags; as bytes they
# may be anything.
FORMS = dict(zip(KINDS, [
    "B B B B n:simulation n:node", "n:address n:shared Q", "t:reason", "Q d:end q:start n:frontend n:backend p",
    "[ d:period d:offset ] B B", "", "[ n:topic B B S ]", "[ I n:topic S ]", "[ I S p ]", "[ I n:topic S ]", "",
    "q:until [ R ]", "q:reached d:compute_ns B [ R ]", "t:reason", "", "t:reason",
    "n:frontend n:backend [ I n:topic S ]", "R n:node", "q:time", "p"], strict=True))
PARTS = {"S": "n:type t:definition I Q", "R": "q:t I I p"}
SIZES = {"B": 1, "I": 4, "Q": 8, "q": 8, "d": 8, "n": 4, "t": 4, "p": 4}
FLAGS = ("there is no latency", "there is no role", "expected 0 or 1")


def read(r, form):
    values = []
    while form:
        (code, _, field), form = form[0].partition(":"), form[1:]
        if code == "[":
            inner, form = form[:form.index("]")], form[form.index("]") + 1:]
            values.append(r.list(lambda inner=inner: read(r, inner), sum(SIZES[member[0]] for member in inner)))
        elif code in "nt":
            values.append({"n": r.name, "t": r.lines}[code](field))
        elif code in "qd":
            values.append(r.time(field, {"q": -1, "d": 0}[code]))
        else:
            values.append(r.bytes() if code == "p" else r.number(code))
    return values


def write(w, form, values):
    for value in values:
        code, form = form[0][0], form[1:]
        if code == "[":
            inner, form = form[:form.index("]")], form[form.index("]") + 1:]
            w.number("I", len(value))
            for item in value:
                write(w, inner, item)
        elif code in "ntp":
            (w.bytes if code == "p" else w.text)(value)
        else:
            w.number("q" if code == "d" else code, value)


def in_python(line):
    """What Python makes of a line's bytes: the same line."""
    kind, data, *rest = line.split(" ", 2)
    data = bytes.fromhex(data)
    if kind in ("schema", "nonsense"):
        return line if kind == "nonsense" else f"schema {data.hex()} {fields(data.decode())}"
    if kind == "message":
        schema = Schema("Rich", data.decode())
        little, big = (bytes.fromhex(payload) for payload in rest[0].split())
        return (f"message {data.hex()} 00010000{schema.pack(schema.unpack(big)).hex()} "
                f"00000000{schema.pack(schema.unpack(little), '>').hex()}")
    try:
        r, w = _Reader(data), _Writer("<" if data[4] else ">")
        form = " ".join(PARTS.get(part, part) for part in FORMS[r.kind].split()).split()
        write(w, form, read(r, form))
        r.end()
        return "frame " + w.frame(r.kind, r.request).hex()
    except NodeError as error:
        return f"garbage {data.hex()} {error}"


def fields(text):
    """As far as Python knows them: name, numbers."""
    return "".join(f"{name}|{n}; " for name, n, _ in Schema("", text).fields).encode().hex()


def names_and_counts(line):
    """A schema's line with what Python knows."""
    kind, data, *rest = line.split(" ", 2)
    if kind != "schema":
        return line
    columns = [field.split("|") for field in bytes.fromhex(rest[0]).decode().split("; ")[:-1]]
    return f"schema {data} " + "".join(f"{c[0]}|{c[6]}; " for c in columns).encode().hex()


@pytest.fixture(scope="module")
def lines():
    printed = subprocess.run([FRAMES], capture_output=True, text=True, check=True).stdout.splitlines()
    for kind, least in [("frame", 1000), ("garbage", 3000), ("schema", 100), ("nonsense", 500), ("message", 100)]:
        assert sum(line.startswith(kind + " ") for line in printed) >= least
    return printed


def test_python_reads_and_writes_what_cpp_does(lines):
    lines = [names_and_counts(line) for line in lines if not any(flag in line for flag in FLAGS)]
    for line in lines:
        assert in_python(line) == line
    for fault in ("is not UTF-8", "holds the control character", "ns; expected -1 to", "ns; expected 0 to"):
        assert sum(fault in line for line in lines) >= 20, fault
