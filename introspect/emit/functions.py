# SPDX-License-Identifier: Apache-2.0
"""The functions of sim/function.h, in C99: those of `math/` in a library's folder, for Python; and their stubs.

A function is called by pointers to doubles, whatever it takes, so that one caller serves all.
"""
from __future__ import annotations

from introspect.emit import ctext
from introspect.emit.ctext import string
from introspect.model import Argument, Function, Library


def emit(library: Library) -> dict[str, str]:
    functions = [f for f in library.functions if "math" in f.header.split("/")[:-1]]
    rows = "".join(_row(f) for f in functions)
    text = "".join([
        ctext.banner(f"The functions of library {library.name}."), ctext.includes(functions),
        '#include "sim/function.h"\n\n#include <string.h>\n', *map(_call, functions),
        f"\nstatic const FledgeFunction functions[] = {{\n{rows}}};\n",
        f"\nextern const FledgeFunctions fledge_functions_{library.name};\n",
        f"const FledgeFunctions fledge_functions_{library.name} = {{{len(functions)}u, functions}};\n"])
    return {f"{library.name}_functions.c": text, f"stubs/_fledge_{library.name}_math.pyi": _stubs(functions)}


def results(f: Function) -> tuple[Argument, ...]:
    """What Python gets: what it returns, then what it fills."""
    return (*((f.returns,) if f.returns else ()), *f.fills)


def _call(f: Function) -> str:
    lines = [f"\nstatic void call_{f.name}(const double *const *in, double *const *out)\n{{"]
    for i, argument in enumerate(f.takes):
        lines += [f"    {argument.ctype} a{i};", f"    memcpy(&a{i}, in[{i}], sizeof a{i});"]
    first = 1 if f.returns else 0
    lines += [f"    {argument.ctype} r{i};" for i, argument in enumerate(f.fills, first)]
    words = [*(f"a{i}" for i in range(len(f.takes))), *(f"&r{i}" for i in range(first, first + len(f.fills)))]
    call = f"{f.name}({', '.join(words)});"
    lines.append(f"    {f.returns.ctype} r0 = {call}" if f.returns else f"    {call}")
    for i, argument in enumerate(results(f)):
        lines.append(f"    *out[{i}] = (double)r{i};" if argument.ctype == "int" else
                     f"    memcpy(out[{i}], &r{i}, sizeof r{i});")
    if not f.takes:
        lines.append("    (void)in;")
    return "\n".join([*lines, "}", ""])


def _row(f: Function) -> str:
    def arguments(these: tuple[Argument, ...]) -> str:
        rows = [f"{{{string(a.name)}, {len(a.shape)}u, {{{', '.join(f'{n}u' for n in a.shape) or '0u'}}}, "
                f"{int(a.ctype == 'int')}u}}" for a in these]
        return f"{{{', '.join(rows)}}}"

    empty = '{{"", 0u, {0u}, 0u}}'
    return (f"    {{{string(f.name)}, {string(f.doc)}, {string(f.header)}, {len(f.takes)}u,\n"
            f"     {arguments(f.takes) if f.takes else empty},\n     {len(results(f))}u, {arguments(results(f))}, "
            f"call_{f.name}}},\n")


_STUBS = '''\
# Written by introspect from the C headers: do not edit.
from typing import Any, Sequence, Union

from numpy.typing import NDArray

# What an argument may be, by its number of dimensions.
_1 = Union[Sequence[float], NDArray[Any]]
_2 = Union[Sequence[_1], NDArray[Any]]
'''


def _stubs(functions: list[Function]) -> str:
    def taken(argument: Argument) -> str:
        return f"{argument.name}: {f'_{len(argument.shape)}' if argument.shape else 'float'}"

    def given(f: Function) -> str:
        types = ["NDArray[Any]" if result.shape else "int" if result.ctype == "int" else "float"
                 for result in results(f)]
        return types[0] if len(types) == 1 else f"tuple[{', '.join(types)}]"

    lines = [_STUBS]
    for f in functions:
        arguments = "".join(f"{taken(take)}, " for take in f.takes)
        lines.append(f"def {f.name}({arguments}{'/' if f.takes else ''}) -> {given(f)}:\n"
                     f'    """{f.doc or f.header}"""\n'.replace("\\", "\\\\"))
    return "\n".join(lines)
