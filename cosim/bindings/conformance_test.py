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

# What the body of each kind holds, from protocol.h: B I Q q are integers, n a name, t a text, p bytes,
# S a schema, R a record, [] a list. Nodes in Python read no flags; as bytes they may be anything.
FORMS = dict(zip(KINDS, ["BBBBnn", "ttQ", "t", "Qqqttp", "[qq]BB", "", "[nBBS]", "[InS]", "[ISp]", "[InS]", "", "q[R]",
                         "qqB[R]", "t", "", "t", "tt[InS]", "Rn", "q", "p"], strict=True))
SIZES = {"B": 1, "I": 4, "Q": 8, "q": 8, "n": 4, "t": 4, "p": 4}
FLAGS = ("there is no latency", "there is no role", "expected 0 or 1")


def read(r, form):
    values = []
    while form:
        code, form = form[0], form[1:]
        if code == "[":
            inner, _, form = form.partition("]")
            values.append(r.list(lambda inner=inner: read(r, inner), sum(map(SIZES.get, inner))))
        elif code in "ntp":
            values.append({"n": r.name, "t": r.text, "p": r.bytes}[code]())
        else:
            values.append(r.number(code))
    return values


def write(w, form, values):
    for value in values:
        code, form = form[0], form[1:]
        if code == "[":
            inner, _, form = form.partition("]")
            w.number("I", len(value))
            for item in value:
                write(w, inner, item)
        elif code in "ntp":
            (w.bytes if code == "p" else w.text)(value)
        else:
            w.number(code, value)


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
        form = FORMS[r.kind].replace("S", "ntIQ").replace("R", "qIIp")
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


def compare(lines, answers):
    """All are the same, but that C++ does not mind what bytes a text is made of."""
    assert len(lines) == len(answers)
    texts = 0
    for line, answer in zip(lines, answers):
        if line != answer:
            data = bytes.fromhex(line.split()[1])
            assert answer.endswith("a text is not UTF-8") and max(data[24:]) > 127, f"{line}\n{answer}"
            texts += 1
    assert texts < len(lines) / 10


def test_python_reads_and_writes_what_cpp_does(lines):
    lines = [names_and_counts(line) for line in lines if not any(flag in line for flag in FLAGS)]
    compare(lines, [in_python(line) for line in lines])
