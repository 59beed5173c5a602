# SPDX-License-Identifier: Apache-2.0
"""Modules, models and messages as text: their tables, and the errors for unknown names."""

from __future__ import annotations

from typing import Any, TypeAlias

from fledge import _core
from fledge.errors import SetupError, did_you_mean, instead
from fledge.objects.script import function_text, prototype, python_text, script
from fledge.objects.si import enumerator_names

Instance: TypeAlias = "_core.Module | _core.Model"
Shown: TypeAlias = "Instance | _core.Message"
GROUPS = (("par", "parameters"), ("in", "inputs"), ("out", "outputs"), ("mem", "memory"), ("", "fields"))


def names_by_group(obj: Shown) -> dict[str, list[str]]:
    """Group -> names, spares left out; properties that Python adds count as parameters."""
    groups: dict[str, list[str]] = {}
    for field in _core.struct(obj).fields:
        if not field.spare:
            groups.setdefault(field.group, []).append(field.name)
    extra = [n for n, v in vars(type(obj)).items() if isinstance(v, property)]
    if extra:
        groups.setdefault("par", []).extend(extra)
    return groups


def unknown_attribute(obj: Shown, name: str) -> str:
    """The error text for an unknown attribute."""
    groups = names_by_group(obj)
    everything = [n for names in groups.values() for n in names]
    return f"{title(obj)} has no attribute '{name}'{instead(str(name), everything)} " + "; ".join(
        f"{word}: {', '.join(groups[g])}" for g, word in GROUPS if g in groups)


def undeclared_attribute(obj: Shown, name: str) -> str:
    """The error text for an assignment to an attribute that a prototype does not declare."""
    memory = names_by_group(obj).get("mem", [])
    return (f"{title(obj)} has no '{name}'{did_you_mean(str(name), memory)} a prototype remembers what it declares: "
            f"{name} = mem(float, \"[-] meaning\"), in its class")


def wired_input(obj: Instance, path: str) -> str:
    """The error text for an assignment to a field, by its path, of an input that has a wire or a feed."""
    context = _core.context(obj)
    process = context() if context else None        # None: its simulation is gone
    port = ".".join(path.split(".")[:3])
    wires = process._core_simulation.wires if process else []
    if source := next((source for source, target, *_ in wires if target == port), ""):
        return (f"{path}: {source} >> {port} writes this input before each update, so that an assignment has no "
                f"effect. Change what {source.rpartition('.')[0]} works with; or leave out the wire, and give the "
                f"messages by sim.feed({port}, ...)")
    return (f"{path}: this input is fed by hand, so that an assignment has no effect; give other messages by "
            f"sim.feed({port}, ...)")


def flown_elsewhere(obj: Shown, path: str) -> str:
    """The error text for an assignment to a field of a module in whose place a computer flies."""
    return (f"{path}: a computer flies this process, and nothing reads what is assigned here: write to its memory, as "
            f"in board.{path} = ..., or send it a command")


def unknown_memory(obj: Instance, path: str) -> str:
    """The error text for the memory of a module whose outputs come from elsewhere."""
    if _core.maker(obj) == "computer":
        return f"{path} is memory of a module, and a computer flies it: read board.{path}"
    name, whole = path.rpartition(".")[2], _core.path(obj)
    outputs = {f"{whole}.{port.name}": [field.name
                                        for field in port.struct.fields if not field.spare and field.name != "head"]
               for port in _core.struct(obj).fields if port.group == "out"}
    same = [f"{port}.{name}" for port, fields in outputs.items() if name in fields]
    return (f"{path} is memory of a module, which the record of a target does not have. A check reads outputs: "
            + (same[0] if same else "; ".join(f"{port} has {', '.join(fields)}" for port, fields in outputs.items())
               or f"{whole} has none, so give it one"))


def title(obj: Shown) -> str:
    """"flight.control (MrpFeedback)", or the type's name alone."""
    path, kind = _core.path(obj), _core.struct(obj).name
    return kind if path == kind else f"{path} ({kind})"


def _groups(obj: Shown) -> dict[str, list[tuple[str, ...]]]:
    """Group -> (name, value, unit or rule, meaning) of its fields."""
    groups: dict[str, list[tuple[str, ...]]] = {}
    for field in _core.struct(obj).fields:
        if not field.spare:
            meaning = field.doc or (first_sentence(field.struct.doc) if field.type == "struct" else "")
            groups.setdefault(field.group, []).append((*_row(obj, field), meaning))
    for name, value in vars(type(obj)).items():
        if isinstance(value, property):
            groups.setdefault("par", []).append((name, _property(obj, name), "", first_sentence(value.__doc__ or "")))
    return groups


def _functions(obj: Shown) -> list[str]:
    """What of it is Python, a line each."""
    if prototype(obj):
        return [f"in Python: {python_text(obj)}"]
    functions = script(obj) or ()
    return [f"{name} in Python: {function_text(function)}" for name, function in zip(("update", "reset"), functions)
            if function is not None]


def show_html(obj: Shown) -> str:
    """What a notebook shows of a module, model or message: the table of its repr, with the meanings."""
    from fledge.display import table

    groups = _groups(obj)
    return table(title(obj), [(word if group else "", groups.get(group, [])) for group, word in GROUPS],
                 ("", "value", "unit", "meaning"), _functions(obj))


def show(obj: Shown) -> str:
    """The repr of a module, model or message: a small table, group by group."""
    groups = _groups(obj)
    lines = [title(obj), *(f"  {line}" for line in _functions(obj))]
    for group, word in GROUPS:
        rows = [row[:3] for row in groups.get(group, [])]
        if group and rows:
            lines.append(f"  {word}")
        widths = [max((len(cell) for cell in column if len(cell) <= _WIDE), default=0) for column in zip(*rows)]
        for row in rows:
            lines.append(("    " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths))).rstrip())
    return "\n".join(lines)


_WIDE = 48  # longer values do not set the width of their column


def _property(obj: Shown, name: str) -> str:
    try:
        value = getattr(obj, name)
    except (SetupError, AttributeError):
        return "none"
    if isinstance(value, (list, tuple)):
        return ", ".join(getattr(x, "name", None) or _core.path(x) for x in value) or "none"
    return repr(value)


def _row(obj: Any, field: _core.Field) -> tuple[str, str, str]:
    """(name, value, unit or rule) of a field."""
    unit = field.unit if field.unit not in ("", "-") else ""
    if field.group in ("in", "out"):
        return field.name, field.struct.name, _wiring(obj, field)
    if field.group == "mem" and _core.struct(obj).kind == "module" and _core.maker(obj) != "itself":
        return field.name, "not known here", unit
    if field.type == "struct":
        value = getattr(obj, field.name)
        if field.name == "head":
            quality = value.quality
            text = f"t = {value.t / 1e9:g} s, {getattr(quality, 'name', quality)}, {value.sequence}"
            return field.name, text, ""
        return field.name, (f"{len(value)} " if field.shape else "") + field.struct.name, ""
    note = unit
    if field.group == "par" and field.name not in _core.given(obj):
        note = (unit + "  " if unit else "") + ("required" if field.required and not _any(obj, field) else "")
    return field.name, _value(obj, field), note.rstrip()


def _any(obj: Shown, field: _core.Field) -> bool:
    value = getattr(obj, field.name)
    return bool(value.any()) if field.shape and field.type != "char" else bool(value)


def _value(obj: Shown, field: _core.Field) -> str:
    value = getattr(obj, field.name)
    if not field.shape or field.type == "char":
        return f"{value:.7g}" if isinstance(value, float) else getattr(value, "name", repr(value))
    return _array(value.tolist(), enumerator_names(field))


def _array(value: Any, names: dict[int, str] = {}) -> str:
    """A nested list on one line; a multiple of the identity and a diagonal as such. names: of an enumeration"""
    if isinstance(value, list) and value and isinstance(value[0], list) and len(value) == len(value[0]):
        diagonal = [row[i] for i, row in enumerate(value)]
        if all(x == 0 for i, row in enumerate(value) for j, x in enumerate(row) if i != j):
            if len(set(diagonal)) == 1:
                return f"{diagonal[0]:.7g} identity" if diagonal[0] else "0"
            return f"diagonal {_array(diagonal)}"
    if isinstance(value, list):
        return "[" + ", ".join(_array(x, names) for x in value) + "]"
    return f"{value:.7g}" if isinstance(value, float) else names.get(value, str(value))


def _wiring(obj: Instance, field: _core.Field) -> str:
    """The other ends of a port's wires."""
    context = _core.context(obj)
    process = context() if context is not None else None
    path = f"{_core.path(obj)}.{field.name}"
    if process is None:
        return "optional" if field.optional else ""
    wires = process._core_simulation.wires
    if field.group == "in":
        sources = [source for source, target, *_ in wires if target == path]
        sources += [source for target, source, _ in process._core_simulation.feeds if target == path]
        return "<< " + ", ".join(sources) if sources else "not wired, optional" if field.optional else "not wired"
    targets = [target for source, target, *_ in wires if source == path]
    return ">> " + ", ".join(targets) if targets else ""


def first_sentence(doc: str) -> str:
    """The first sentence of a docstring or a header's comment, on one line."""
    return " ".join(doc.split()).split(". ")[0].rstrip(".") + "."
