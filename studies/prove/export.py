# SPDX-License-Identifier: Apache-2.0
"""The executive of an exported mission: its C, with any inputs, commands and parameters, for any number of ticks.

Example:

    import fledge
    from fledge import export
    from fledge.prove import export as executive
    from fledge.prove.sources import Tree

    mission = export.read(fledge.load("nadir_spin"))
    print(executive.program(Tree.of(None), mission).texts["driver.c"])
    # result = executive.prove_export(mission)

A module stands for all that its own proof allows: it leaves any bits in its outputs and memory, with a Quality in each
head. Where the executive calls it, it asserts what that proof takes for granted: a Quality in the head of each input,
the bounds of parameters, and the times of a Tick. So the proofs of the modules and this one make one of the whole; what
is left to the reader is that ticks rise in time, as the exported header demands.
"""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from fledge import export, prove
from fledge.errors import Failure
from fledge.export.read import Mission
from fledge.prove import driver, eva
from fledge.prove.sources import INCLUDED, MATH, Tree
from introspect.errors import HeaderError
from introspect.model import Field, Group, Kind, Struct, Type
from introspect.reader import read
from introspect.sources import Source

LINKED = ("flight/telemetry/telemetry.c", "ccsds/space_packet.c", *MATH)   # what an executive calls, besides modules


def prove_export(mission: Mission, project: Path | None = None, again: bool = False,
                 machine: str = eva.MACHINE) -> prove.Result:
    """Prove the executive that `fledge export c MISSION` writes. Kept as modules' results are. Raises Failure."""
    analyser, tree = eva.version(), Tree.of(project)
    return prove.proved(tree, prove.Unit(f"export {mission.title}", f"{mission.name}.c", None), analyser,
                        [program(tree, mission)], again, machine)


def program(tree: Tree, mission: Mission) -> eva.Program:
    """The mission's C and what it calls, with the driver in place of its modules. Raises Failure."""
    try:
        known = read([Source(root, "flight", Kind.MODULE, "own") for root in tree.roots if (root / "flight").is_dir()],
                     tree.roots).structs
        modules = {module.name: known[module.type] for module in mission.modules}
    except HeaderError as error:
        raise Failure(str(error)) from None
    except KeyError as error:
        raise Failure(f"prove: there is no header in flight/ of the module {error.args[0]} of {mission.title}", 1) \
            from None
    written = {name: text for name, text in {**export.emit_c(mission), **export.emit_commands(mission)}.items()
               if name.endswith((".c", ".h"))}
    included = {name for text in written.values() for name in INCLUDED.findall(text)}
    texts = tree.closure(*included, *LINKED, with_c=False)
    return eva.Program(mission.name, {**texts, **written, prove.DRIVER: write(mission, modules)}, (prove.DRIVER,),
                       ("-eva-precision", "0", "-eva-slevel", "4", "-eva-auto-loop-unroll", "200"))


def write(mission: Mission, modules: Mapping[str, Struct]) -> str:
    """The source of the driver. modules: the Struct of each by its name in the mission."""
    parts, name = driver.Parts(declared=False), mission.name
    body = [f"{name}_init(&m);", f"telemetry_begin(&{name}_telemetry);", "while (any) {"]
    for message in mission.inputs:
        body += [f"    any_bits(&m.{message.member}, sizeof m.{message.member});",
                 f"    m.{message.member}.head.quality = (Quality)any_integer(QUALITY_NONE, QUALITY_GOOD);"]
    for module, struct in modules.items():
        # All rows of arrays at once: the executive reads none.
        par = [dataclasses.replace(f, count=None) for f in struct.fields
               if f.group is Group.PAR and "initial" not in f.clauses]
        body += [f"    within_{struct.snake_name}(&m.{module});",
                 *(f"    {line}" for line in parts.draw(par, f"m.{module}.", parameter=True))]
    commands = f"{name}_commands"
    body += ["    const int64_t t = any_integer(0, PROVE_TIME);"]
    # What flight/command calls, by the dictionary and with what it lets through.
    if any(f.group is Group.PAR for struct in modules.values() for f in struct.fields):
        body += [f"    const uint16_t block = (uint16_t)any_unsigned(0u, {commands}.n_blocks - 1u);",
                 f"    any = *(uint8_t *){commands}.parameters(&m, block);",
                 "    if (any) {", f"        {commands}.publish(&m, block, t);", "    }"]
    if mission.modes:
        enters = [f"{commands}.enter(&m, (uint16_t)any_unsigned(0u, {len(mission.modes) - 1}u));"]
        if mission.guards:
            enters += [f"any = {commands}.may_enter(&m, (uint16_t)any_unsigned(0u, {len(mission.modes) - 1}u));"]
        body += ["    if (any) {", *(f"        {line}" for line in enters), "    }"]
    if mission.events:
        body += [f"    {commands}.arm(&m, (uint16_t)any_unsigned(0u, {len(mission.events) - 1}u), any != 0);"]
    body += [f"    {commands}.telemetry(&m, (uint16_t)any_unsigned(0u, {len(mission.outputs)}u), any != 0, "
             "(uint16_t)any_unsigned(1u, 0xFFFFu));",
             "    if (any) {", f"        {commands}.reset(&m, t);", "    }",
             f"    {name}_tick(&m, t);", f"    any = {name}_next(&m) > t;",
             f"    telemetry_send(&{name}_telemetry, &m, t, &commands, sink, NULL);",
             "    Frama_C_show_each_returned();", "}"]
    stubs = [line for struct in {s.name: s for s in modules.values()}.values() for line in _stub(struct, parts)]
    return "\n".join([
        f"/* {mission.title}: any inputs, parameters, commands and ticks. Written by `fledge prove --export`. */",
        f'#include "{name}_commands.h"', "", f"static {mission.struct()} m;", "static CommandState commands;", "",
        *parts.functions, *stubs,
        "static void sink(void *user, const uint8_t *packet, uint32_t n)", "{",
        "    /*@ assert whole: n >= 1 && \\valid_read(packet + (0 .. n - 1)); */", "    (void)user;", "}", "",
        "void main(void)", "{", "    any_bits(&commands, sizeof commands);", *(f"    {line}" for line in body), "}",
        ""])


def _stub(struct: Struct, parts: driver.Parts) -> Iterator[str]:
    """The functions of a module: what its own driver gives it, and may get from it."""
    groups = {f.group for f in struct.fields}
    left = [f"any_bits(&x->{group.value}, sizeof x->{group.value});" for group in (Group.OUT, Group.MEM)
            if group in groups]
    left += [line for f in struct.fields if f.group is Group.OUT for line in parts.fields(f, f"x->out.{f.name}")]
    given = [f"/*@ assert quality_of_{f.name}: x->in.{f.name}.head.quality <= QUALITY_GOOD; */"
             for f in struct.fields if f.group is Group.IN and f.struct]
    within = [line for f in struct.fields if f.group is Group.PAR for line in _within(f)]
    yield from [f"static void within_{struct.snake_name}(const {struct.name} *x)", "{",
                *(f"    {line}" for line in within or ["(void)x;"]), "}", "",
                f"void {struct.snake_name}_reset({struct.name} *x)", "{", *(f"    {line}" for line in left), "}", "",
                f"void {struct.snake_name}_update({struct.name} *x, Tick tick)", "{",
                "    /*@ assert tick: 0 <= tick.t <= PROVE_TIME && tick.dt <= PROVE_TIME; */",
                *(f"    {line}" for line in given), f"    within_{struct.snake_name}(x);",
                f"    {struct.snake_name}_reset(x);", "}", ""]


def _within(f: Field) -> Iterator[str]:
    """That a parameter is within its bounds, of counted rows those that count."""
    if f.is_spare or f.type is Type.CHAR or f.struct:
        return
    ctype = {Type.F64: "double", Type.F32: "float"}.get(f.type, f.ctype)    # an element of a Vec3, too
    if f.type in (Type.F64, Type.F32):
        low, high = (repr(limit) for limit in driver.floats(f, True))
    elif f.type is Type.ENUM and f.enum:
        values = [e.value for e in f.enum.values]
        low, high = str(min(values)), str(max(values))
    else:
        bits = 8 * f.element_size
        limits = (0, 2**bits - 1) if f.type.is_unsigned else (-2**(bits - 1), 2**(bits - 1) - 1)
        if (within := driver.integers(f, *limits, None)) == limits:
            return
        low, high = (str(limit) for limit in within)
    n = f"{math.prod(f.shape[1:])}u * x->par.{f.count}" if f.count else f"{math.prod(f.shape)}u"
    yield from [f"for (size_t k = 0u; k < {n}; k++) {{",
                f"    const {ctype} value = ((const {ctype} *)&x->{f.path})[k];",
                f"    const int within_{f.name} = {low} <= value && value <= {high};",
                f"    /*@ assert within_{f.name} == 1; */", "}"]
