# SPDX-License-Identifier: Apache-2.0
"""What the extension calls when the way through C ends: units, enums, wires, and words for people.

It is imported at the first call.
"""

from fledge import _core
from fledge.units import Quantity, nanoseconds


def strip(value, path, unit, dims, expected):
    """The plain numbers, in the header's unit, behind a quantity, a numpy scalar or a list of such.

    path: "flight.control.K"; unit: as in the header; dims: its exponents; expected: in words.
    Raises SetupError on another dimension, or on what is no number.
    """
    def plain(x):
        if isinstance(x, Quantity):
            if x.dims[:7] != dims[:7]:
                found = x.dims
                raise _core.SetupError(
                    f"{path}: expected {_unit(unit, dims)}; found {x!r}"
                    + ("" if any(found) else ", which has no unit"))
            if unit == "ns":
                return nanoseconds(x)
            return plain(x.value)
        if isinstance(x, (list, tuple)):
            return [plain(y) for y in x]
        if isinstance(x, (float, int)):
            return x
        if hasattr(x, "to_base_units") and hasattr(x, "magnitude"):
            return plain(_from_pint(x))
        if hasattr(x, "tolist"):  # numpy's arrays and scalars, pandas' series
            return plain(x.tolist())
        if hasattr(x, "__index__"):
            return int(x)
        if hasattr(x, "__float__"):
            return float(x)
        raise _core.SetupError(f"{path}: expected {expected}; found {_short(value)}")

    return plain(value)


def _unit(unit, dims):
    return f"a quantity in {unit}" if unit not in ("", "-") else "a number without unit"


def _short(value):
    text = repr(value).replace("\n", " ")
    return text if len(text) <= 80 else text[:77] + "..."


# pint's names of the base dimensions, in the order of our exponents.
_PINT = ("[length]", "[mass]", "[time]", "[current]", "[temperature]", "[substance]", "[luminosity]")


def _from_pint(x):
    """A pint quantity as one of ours. pint itself is not imported: the object knows all."""
    base = x.to_base_units()
    dims = dict(base.dimensionality)
    exponents = []
    for name in _PINT:
        n = dims.pop(name, 0)
        if n != int(n):
            return Quantity(base.magnitude, (99,) * 8)
        exponents.append(int(n))
    magnitude = base.magnitude
    return Quantity(magnitude.tolist() if hasattr(magnitude, "tolist") else magnitude, (*exponents, 0))


def enumeration(name, doc, values):
    """A Python enum for one of C: its members without what all their names begin with."""
    import enum

    stem = name.upper() + "_"
    names = [n[len(stem):] if n.startswith(stem) else n for n, _, _ in values]
    made = enum.IntEnum(name, list(zip(names, (v for _, v, _ in values))), module="fledge")
    made.__doc__ = doc + "\n\n" + "\n".join(f"{n}: {d}" for n, (_, _, d) in zip(names, values))
    return made


def wire(source, target):
    from fledge.process import wire as make

    return make(source, target)


# --- words -----------------------------------------------------------------------------------------

GROUPS = (("par", "parameters"), ("in", "inputs"), ("out", "outputs"), ("mem", "memory"), ("", "fields"))


def names_by_group(obj):
    """Group -> names, spares left out; properties that Python adds count as parameters."""
    groups = {}
    for field in _core.struct(obj).fields:
        if not field.spare:
            groups.setdefault(field.group, []).append(field.name)
    extra = [n for n, v in vars(type(obj)).items() if isinstance(v, property)]
    if extra:
        groups.setdefault("par", []).extend(extra)
    return groups


def unknown_attribute(obj, name):
    """The text of the error for a name that an object does not have."""
    from difflib import get_close_matches

    groups = names_by_group(obj)
    everything = [n for names in groups.values() for n in names]
    text = f"{title(obj)} has no attribute '{name}'"
    near = [n for n in everything if n.lower() == name.lower()] or get_close_matches(name, everything, 1, 0.6)
    if near:
        text += f"; did you mean '{near[0]}'?"
    else:
        text += ";"
    return text + " " + "; ".join(f"{word}: {', '.join(groups[g])}" for g, word in GROUPS if g in groups)


def title(obj):
    """"flight.control (MrpFeedback)", or the type's name alone."""
    path, kind = _core.path(obj), _core.struct(obj).name
    return kind if path == kind else f"{path} ({kind})"


def show(obj):
    """The repr of a module, model or message: a small table, group by group."""
    groups = {}
    for field in _core.struct(obj).fields:
        if not field.spare:
            groups.setdefault(field.group, []).append(_row(obj, field))
    for name, value in vars(type(obj)).items():
        if isinstance(value, property):
            groups.setdefault("par", []).append((name, _property(obj, name), ""))
    lines = [title(obj)]
    for group, word in GROUPS:
        rows = groups.get(group, [])
        if group and rows:
            lines.append(f"  {word}")
        widths = [max((len(cell) for cell in column if len(cell) <= _WIDE), default=0) for column in zip(*rows)]
        for row in rows:
            lines.append(("    " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths))).rstrip())
    return "\n".join(lines)


_WIDE = 48  # longer values do not set the width of their column


def _property(obj, name):
    try:
        value = getattr(obj, name)
    except (_core.SetupError, AttributeError):
        return "none"
    if isinstance(value, (list, tuple)):
        return ", ".join(getattr(x, "name", None) or _core.path(x) for x in value) or "none"
    return repr(value)


def _row(obj, field):
    """(name, value, unit or rule) of a field."""
    unit = field.unit if field.unit not in ("", "-") else ""
    if field.group in ("in", "out"):
        return field.name, field.struct.name, _wiring(obj, field)
    if field.type == "struct":
        value = getattr(obj, field.name)
        if field.name == "head":
            quality = value.quality
            text = f"t = {value.t / 1e9:g} s, {getattr(quality, 'name', quality)}, {value.sequence}"
            return field.name, text, ""
        return field.name, field.struct.name, ""
    note = unit
    if field.group == "par" and field.name not in _core.given(obj):
        note = (unit + "  " if unit else "") + ("required" if field.required and not _any(obj, field) else "")
    return field.name, _value(obj, field), note.rstrip()


def _any(obj, field):
    value = getattr(obj, field.name)
    return bool(value.any()) if field.shape and field.type != "char" else bool(value)


def _value(obj, field):
    value = getattr(obj, field.name)
    if not field.shape or field.type == "char":
        return f"{value:.7g}" if isinstance(value, float) else getattr(value, "name", repr(value))
    return _array(value.tolist())


def _array(value):
    """A nested list on one line; a multiple of the identity and a diagonal as such."""
    if isinstance(value, list) and value and isinstance(value[0], list) and len(value) == len(value[0]):
        diagonal = [row[i] for i, row in enumerate(value)]
        if all(x == 0 for i, row in enumerate(value) for j, x in enumerate(row) if i != j):
            if len(set(diagonal)) == 1:
                return f"{diagonal[0]:.7g} identity" if diagonal[0] else "0"
            return f"diagonal {_array(diagonal)}"
    if isinstance(value, list):
        return "[" + ", ".join(_array(x) for x in value) + "]"
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def _wiring(obj, field):
    """Where a port's wires come from or go to."""
    context = _core.context(obj)
    process = context() if context is not None else None
    path = f"{_core.path(obj)}.{field.name}"
    if process is None:
        return "optional" if field.optional else ""
    wires = process._core_simulation.wires
    if field.group == "in":
        sources = [source for source, target, *_ in wires if target == path]
        return "<< " + sources[0] if sources else "not wired, optional" if field.optional else "not wired"
    targets = [target for source, target, *_ in wires if source == path]
    return ">> " + ", ".join(targets) if targets else ""
