# SPDX-License-Identifier: Apache-2.0
"""The reference pages of a library, in Markdown: its modules or models, and its messages.

Every declaration gets a heading that other pages link to, its doc comment, and tables of its fields with
unit, condition and meaning; a module or model also with the comment at the head of its source. Indented lines of
comments, such as equations, stay as they are. docs/conf.py gives the pages to Sphinx.
"""
from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from pathlib import Path

from introspect.comment import plain_text
from introspect.model import Bounds, Enumeration, Field, Group, Kind, Library, Struct

_HEADINGS = {Group.IN: "Inputs", Group.OUT: "Outputs", Group.PAR: "Parameters", Group.MEM: "Memory"}
_KINDS = {Kind.MODULE: "modules", Kind.MODEL: "models"}


def emit(library: Library, root: Path) -> dict[str, str]:
    """A page of modules or models, if the library has any, and one of messages and their parts. root: of the sources"""
    pages = {}
    title = library.name.replace("_", " ").capitalize()
    for kind, word in _KINDS.items():
        interfaces = [s for s in library.structs if s.kind is kind]
        if interfaces:
            pages[f"{library.name}-{word}.md"] = _page(f"{title} {word}", _by_folder(interfaces, root))
    messages = [s for s in library.structs if s.kind is Kind.MESSAGE]
    parts = [s for s in library.structs if s.kind is Kind.PLAIN]
    sections = [("Messages", map(_struct, messages)), ("Parts of messages", map(_struct, parts)),
                ("Enumerations", map(_enum, library.enums))]
    text = _page(f"{title} messages", sections)
    return pages | {f"{library.name}-messages.md": text} if messages or parts or library.enums else pages


def _page(title: str, sections: Iterable[tuple[str, Iterable[str]]]) -> str:
    parts = [f"# {title}\n"]
    for heading, entries in sections:
        entries = list(entries)
        if entries:
            parts += [f"## {heading}\n", *entries]
    return "\n".join(parts)


def _by_folder(structs: list[Struct], root: Path) -> Iterable[tuple[str, Iterable[str]]]:
    for folder in sorted({s.folder for s in structs}):
        yield f"{folder}/", [_struct(s, _algorithm(root / s.header)) for s in structs if s.folder == folder]


def _algorithm(header: Path) -> str:
    """The comment at the head of a module's or model's source; "" if there is none."""
    for source in (header.with_suffix(".c"), header.with_name(f"{header.stem}_model.cpp")):
        if source.exists():
            text = re.sub(r"^(/\*|//) SPDX.*\n", "", source.read_text(encoding="utf-8"))
            match = re.match(r"/\*.*?\*/|(//.*\n)+", text, re.S if text.startswith("/*") else 0)
            return plain_text(match[0]) if match else ""
    return ""


def _struct(struct: Struct, algorithm: str = "") -> str:
    doc, *source = re.split(r"^(?=Sources?: )", struct.doc, 1, re.M)
    parts = [_heading(struct.name), prose(doc), f"**Algorithm**\n\n{prose(algorithm)}" if algorithm else "",
             prose("".join(source)), f"Declared in `{struct.header}`, {struct.size} bytes.\n"]
    for group in Group:
        fields = [f for f in struct.fields if f.group is group and not f.is_spare]
        if fields:
            if group in _HEADINGS:
                parts.append(f"**{_HEADINGS[group]}**\n")
            parts.append(_table(fields))
    return "\n".join(parts)


def _enum(enum: Enumeration) -> str:
    rows = [f"| `{e.name}` | {e.value} | {_text(e.doc)} |" for e in enum.values]
    return "\n".join([_heading(enum.name), prose(enum.doc), f"Declared in `{enum.header}`.\n",
                      "| value | number | meaning |", "|---|---|---|", *rows, ""])


def _heading(name: str) -> str:
    return f"(c-{name.lower()})=\n### {name}\n"


def _table(fields: list[Field]) -> str:
    """Ports have no unit; columns that would be empty are left out."""
    columns = [("name", [f"`{f.name}`" for f in fields]),
               ("type", [_type(f) for f in fields]),
               ("unit", [_text(f.unit.text) if f.unit and f.unit.text != "-" else "" for f in fields]),
               ("condition", [_condition(f) for f in fields]),
               ("meaning", [_text(f.doc or (f.struct.doc if f.struct else "")) for f in fields])]
    columns = [(title, cells) for title, cells in columns if any(cells)]
    rows = zip(*(cells for _, cells in columns))
    return "\n".join(["| " + " | ".join(title for title, _ in columns) + " |", "|---" * len(columns) + "|",
                      *("| " + " | ".join(row) + " |" for row in rows), ""])


def _type(field: Field) -> str:
    declared = field.struct or field.enum
    name = f"{{ref}}`{declared.name} <c-{declared.name.lower()}>`" if declared and declared.library else field.ctype
    shape = field.shape[:-{"Vec3": 1, "Mat3": 2}.get(field.ctype, 0) or None]
    return name + "".join(f"\\[{n}\\]" for n in shape)


def _condition(field: Field) -> str:
    words = sorted(field.clauses)
    if field.bounds:
        words.append(_bounds(field.bounds))
    if field.count:
        words.append(f"the first `{field.count}` count")
    if field.distinct:
        words.append(f"another source than `{field.distinct}`")
    if field.range:
        words.append(f"in use from {field.range.lo:g} to {field.range.hi:g}")
    return ", ".join(words)


def _bounds(bounds: Bounds) -> str:
    low = f"{'>' if bounds.lo_open else '≥'} {bounds.lo:g}" if bounds.lo is not None else ""
    high = f"{'<' if bounds.hi_open else '≤'} {bounds.hi:g}" if bounds.hi is not None else ""
    return " and ".join(filter(None, [low, high]))


def prose(text: str) -> str:
    """A comment of several lines: paragraphs, and indented lines as they are."""
    parts = []
    for indented, block in re.findall(r"((?:^ .*\n+)+)|((?:^\S.*\n)+)", text.strip("\n") + "\n", re.M):
        parts.append(f"```text\n{textwrap.dedent(indented).rstrip()}\n```\n" if indented else f"{_text(block)}\n")
    return "\n".join(parts)


def _text(text: str) -> str:
    """A comment's words: code in backticks; what Markdown would take for other markup escaped."""
    parts = " ".join(text.split()).split("`")
    if len(parts) % 2 == 0:
        parts[-2:] = ["`".join(parts[-2:])]     # a single one is no mark
    parts[::2] = [re.sub(r"([\\*_{}\[\]<>|#$])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)
