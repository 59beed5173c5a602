# SPDX-License-Identifier: Apache-2.0
"""What `fledge new --from` writes: the header of a prototype, C or C++ that compiles and waits for the translation, and
the test that compares both."""

from __future__ import annotations

import inspect
import os
import textwrap
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fledge.flight_math import HEADERS
from fledge.objects import outside
from introspect.emit import header
from introspect.model import Kind, Struct


def files(cls: Any, source: Path, name: str, path: str, root: Path, namespace: str,
          declared: Mapping[str, str]) -> dict[str, str]:
    """Ending -> text of the files at `path`, "flight/sun_slew", in the folder `root`.

    source: the file of the class; name: of the struct in C; namespace: of the models in C++; declared: name -> header
    of each struct and enumeration that there is already.
    """
    struct = replace(cls._struct, name=name, header=f"{path}.h")
    struct = replace(struct, fields=tuple(replace(f, line=0) for f in struct.fields))
    used = {f.struct.name: f.struct for f in struct.fields if f.struct}
    messages = [message for message in used.values() if message.path.endswith(".py") and message.name not in declared]
    used |= {f.struct.name: f.struct for message in messages for f in message.fields if f.struct}
    enums = {f.enum.name: f.enum for owner in (struct, *messages) for f in owner.fields if f.enum}
    includes = [declared[name] for name in (*enums, *used) if name in declared]
    texts = {".h": header.text(struct, includes or ["flight/msg/head.h"],
                               [enum for enum in enums.values() if enum.name not in declared], messages)}
    where = os.path.relpath(source, root)
    part, ending = ("flight", "_test.py") if struct.kind is Kind.MODULE else ("world", "_model_test.py")
    if struct.kind is Kind.MODULE:
        texts[".c"] = _module(cls, struct, where)
    else:
        texts["_model.h"], texts["_model.cpp"] = _model(cls, struct, where, namespace)
    texts[ending] = _test(cls, struct, where, part, len(Path(path).parts) - 1)
    return texts


def _methods(cls: Any, mark: str) -> dict[str, str]:
    """Name -> the Python of each function, as a comment."""
    names: dict[str, str] = {}
    for function in outside.functions(cls):
        try:
            text = textwrap.dedent(inspect.getsource(function)).strip()
        except (OSError, TypeError):
            text = f"def {function.__name__}(...): its source is not in a file"
        if mark == "*":
            text = text.replace("*/", "* /").replace("/*", "/ *")
        names.setdefault(function.__name__, text)
    return names


def _c_comment(text: str, indent: str = "") -> str:
    lines = "\n".join(f"{indent} *     {line}".rstrip() for line in text.splitlines())
    return f"{indent}/* To translate:\n{lines} */\n"


def _module(cls: Any, s: Struct, where: str) -> str:
    methods = _methods(cls, "*")
    update, reset = methods.pop("update"), methods.pop("reset", None)
    helpers = "".join("\n" + _c_comment(text) for text in methods.values())
    mem = any(f.group.value == "mem" for f in s.fields)
    out = any(f.group.value == "out" for f in s.fields)
    clear = "".join(f"    memset(&m->{group}, 0, sizeof m->{group});\n"
                    for group, there in (("out", out), ("mem", mem)) if there)
    called = {name for function in outside.functions(cls) for name in function.__code__.co_names}
    headers = sorted({HEADERS[name] for name in called & HEADERS.keys()})
    includes = "".join(f'#include "{header}"\n' for header in headers)
    return f"""/* SPDX-License-Identifier: Apache-2.0 */
/* The prototype is {cls.__name__} in {where}. */
#include "{s.header}"

#include <string.h>
{includes and chr(10)}{includes}{helpers}
/* Called before the first update, and when the module's task restarts. Parameters stay. */
void {s.snake_name}_reset({s.name} *m)
{{
{clear or "    (void)m;"}{_c_comment(reset, "    ") if reset else ""}}}

/* Called at each run of the task: t.t is the time, t.dt the time since the last update (0 at first). */
void {s.snake_name}_update({s.name} *m, Tick t)
{{
    (void)m;
    (void)t;
{_c_comment(update, "    ")}}}
"""


def _model(cls: Any, s: Struct, where: str, namespace: str) -> tuple[str, str]:
    """The class and its functions in C++."""
    methods = _methods(cls, "//")
    known = {name: methods.pop(name, "") for name in ("prepare", "reset", "update")}
    helpers = "".join(_cpp_comment(text) + "\n" for text in methods.values())
    groups = [group for group in ("out", "mem") if any(f.group.value == group for f in s.fields)]
    model, base = f"{s.name}Model", s.header.removesuffix(".h")
    class_text = f"""// SPDX-License-Identifier: Apache-2.0
// The behaviour behind {s.header}.
#pragma once

#include "sim/model.h"
#include "sim/random.h"
#include "{s.header}"

namespace {namespace} {{

class {model} final : public fledge::sim::Model {{
public:
    explicit {model}({s.name} &interface) : interface_(interface) {{}}

    void prepare(const fledge::sim::Setup &setup) override;
    void reset(fledge::sim::Ns t) override;
    void update(Tick tick) override;
    void reseed() override {{ random_ = seeded_; }}

    /// All state of a run besides the interface: snapshots and clones copy it.
    std::span<std::byte> memory() override {{ return std::as_writable_bytes(std::span(&random_, 1)); }}

private:
    {s.name} &interface_;
    fledge::sim::Random seeded_; ///< the stream at the start of each run
    fledge::sim::Random random_; ///< normal() and uniform() draw what the prototype's do
}};

}} // namespace {namespace}
"""
    clear = "".join(f"    interface_.{group} = {{}};\n" for group in groups)
    functions = f"""// SPDX-License-Identifier: Apache-2.0
// The prototype is {cls.__name__} in {where}.
#include "{base}_model.h"

namespace {namespace} {{

{helpers}// Before each set of runs: check what the header cannot express, and allocate memory. A run allocates none.
void {model}::prepare(const fledge::sim::Setup &setup)
{{
    seeded_ = fledge::sim::Random(setup.seed, setup.name);
{_cpp_comment(known["prepare"], "    ")}}}

// Before each run: the initial state from the parameters.
void {model}::reset(fledge::sim::Ns)
{{
    random_ = seeded_;
{clear}{_cpp_comment(known["reset"], "    ")}}}

// Advance to tick.t; the inputs are constant since tick.t - tick.dt.
void {model}::update(Tick)
{{
{_cpp_comment(known["update"], "    ")}}}

}} // namespace {namespace}
"""
    return class_text, functions


def _cpp_comment(text: str, indent: str = "") -> str:
    if not text:
        return ""
    lines = (f"{indent}//     {line}".rstrip() + "\n" for line in text.splitlines())
    return f"{indent}// To translate:\n" + "".join(lines)


def _test(cls: Any, s: Struct, where: str, part: str, depth: int) -> str:
    library, imported = ("fsw", "flight as fsw") if part == "flight" else ("world", "world")
    kind = "C" if part == "flight" else "C++"
    mission = str(Path(where).parent)
    return f'''# SPDX-License-Identifier: Apache-2.0
"""{s.name} in {kind} puts out what its prototype does, over a recorded run of a mission."""
from pathlib import Path

from fledge import {imported}, prototype
from fledge.units import s

ROOT = Path(__file__).resolve().parents[{depth}]
MISSION = ROOT / "{mission}"    # one that flies {s.name}, the prototype or the {kind}
DURATION = 60 * s
# How far numbers may lie apart, in parts of themselves or of 1 if they are smaller. 0: not by a bit, which holds where
# the prototype calls the functions of flight/math that the {kind} calls, in the same order.
WITHIN = 0.0


def test_it_puts_out_what_its_prototype_does():
    first = prototype.load(f"{{ROOT}}/{where}:{cls.__name__}")
    prototype.compare(MISSION, first, {library}.{s.name}, DURATION, within=WITHIN)
'''
