# SPDX-License-Identifier: Apache-2.0
"""Headers -> model, by libclang.

All headers are parsed as one unsaved C99 translation unit without function bodies, once for this
machine and once for each of TARGETS, so that a layout which differs anywhere is refused here.

What the model holds: the faces (structs with the groups in, out, par, mem) and the messages
(structs that begin with `Head head`) of the folders that were asked for, and everything these are
made of, from wherever it is included. They must keep every rule. Other plain structs of the folders
are taken too if they keep the rules, and left out if not: they are nobody's interface.
"""
from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from clang import cindex
from clang.cindex import CursorKind, TypeKind

from introspect import comment, rules
from introspect.errors import HeaderError, Problem, Refusal
from introspect.model import (Enumeration, Enumerator, Field, Group, Kind, Model, Struct, Type)

# Where flight code flies besides this machine: big-endian 32-bit SPARC V8, and aarch64.
TARGETS = ("sparc-linux-gnu", "aarch64-linux-gnu")

FIXED = {"double": Type.F64, "float": Type.F32,
         "int8_t": Type.I8, "uint8_t": Type.U8, "int16_t": Type.I16, "uint16_t": Type.U16,
         "int32_t": Type.I32, "uint32_t": Type.U32, "int64_t": Type.I64, "uint64_t": Type.U64}

# Arrays by another name: structs only because C cannot return arrays.
ARRAYS = {"Vec3": (3,), "Mat3": (3, 3)}

DIMS_MAX = 4  # as sim/table.h

# The hosted headers of C99, which a compiler alone does not bring. Layout needs nothing of them but
# size_t, so that for another target empty ones will do and no C library of it need be installed.
_HOSTED = ("assert", "complex", "ctype", "errno", "fenv", "inttypes", "locale", "math", "setjmp",
           "signal", "stdio", "stdlib", "string", "time", "wchar", "wctype")
_HERE = os.path.dirname(os.path.abspath(__file__))

_ALL = "everything.c"
_LIBCLANG = cindex.conf.lib
_LIBCLANG.clang_Cursor_getCommentRange.argtypes = [cindex.Cursor]
_LIBCLANG.clang_Cursor_getCommentRange.restype = cindex.SourceRange


@dataclass(frozen=True)
class Source:
    """Headers to be read: those of a folder and its subfolders, or a single one.

    root     what `#include "..."` and the model's `header` are relative to
    path     of the folder or header, relative to root
    kind     what its faces are: Kind.MODULE (reset and update in C) or Kind.MODEL
    library  to which its declarations belong
    """
    root: Path
    path: str
    kind: Kind
    library: str


def read(sources: Sequence[Source], include: Iterable[Path] = ()) -> Model:
    """The model of all headers of `sources`. `include` are further folders for `#include`, for what
    is used but belongs to another library. Raises HeaderError with every problem found."""
    return _Reader(sources, include).model()


def find_headers(source: Source) -> tuple[list[str], list[str]]:
    """The headers (`*.h`) of a source, C++ ones too, and the folders that were searched for them."""
    top = os.path.normpath(os.path.join(source.root, source.path))
    if os.path.isfile(top):
        return [top], []
    if not os.path.isdir(top):
        raise FileNotFoundError(f"{top}: no such folder or header")
    headers, folders = [], []
    for folder, subfolders, files in os.walk(top):
        subfolders[:] = sorted(name for name in subfolders if not name.startswith((".", "__")))
        folders.append(folder)
        headers += [os.path.join(folder, name) for name in sorted(files) if name.endswith(".h")]
    return headers, folders


def is_cpp(text: str) -> bool:
    """Whether a header is C++, as those of the models' behaviour are: it opens a namespace, includes
    a header without .h, or declares a template."""
    return bool(re.search(r"^\s*(?:inline\s+)?namespace\s+\w|^\s*#\s*include\s*<\w+>|^\s*template\s*<",
                          text, re.M))


class _Reader:
    def __init__(self, sources: Sequence[Source], include: Iterable[Path]):
        self._sources: dict[str, Source] = {}  # by the header's absolute path
        self._shown: dict[str, str] = {}       # absolute path -> as the caller would write it
        self._texts: dict[str, str] = {}
        self._ignored: list[str] = []          # C++
        self._folders: list[str] = []
        for source in sources:
            headers, folders = find_headers(source)
            self._folders += folders
            for header in headers:
                text = Path(header).read_text(encoding="utf-8", errors="replace")
                path = os.path.abspath(header)
                if is_cpp(text):
                    self._ignored.append(path)
                else:
                    self._sources[path] = source
                    self._texts[path] = text
                    self._shown[path] = header
        self._libraries = tuple(dict.fromkeys(source.library for source in sources))
        self._roots = list(dict.fromkeys(
            os.path.abspath(path) for path in [s.root for s in sources] + list(include)))
        self._headers = sorted(self._sources)
        self._structs: dict[str, Struct] = {}
        self._enums: dict[str, Enumeration] = {}
        self._problems: dict[str, list[Problem]] = {}  # by struct
        self._parsing: list[str] = []

    def model(self) -> Model:
        self._refuse_shared_guards()
        unit = self._parse()
        declarations = [c for c in unit.cursor.get_children() if self._file(c)]
        self._typedefs = {c.spelling: c for c in declarations if c.kind is CursorKind.TYPEDEF_DECL}
        self._functions = {c.spelling: c for c in declarations
                           if c.kind is CursorKind.FUNCTION_DECL}
        asked_for = [c for c in declarations
                     if c.kind is CursorKind.STRUCT_DECL and c.is_definition()
                     and self._file(c) in self._sources
                     and self._struct_name(c) not in ARRAYS]
        for cursor in asked_for:
            self._struct(cursor)
        for cursor in declarations:
            if cursor.kind is CursorKind.ENUM_DECL and self._file(cursor) in self._sources:
                self._keep_if_sound(cursor)
        self._judge()
        files = sorted({os.path.abspath(i.include.name) for i in unit.get_includes()}
                       | set(self._ignored))
        model = Model(dict(sorted(self._structs.items())), dict(sorted(self._enums.items())),
                      self._libraries, tuple(files), tuple(sorted(set(self._folders))))
        for target in TARGETS:
            self._compare_layout(model, target)
        return model

    # Files and parsing

    def _parse(self, target: str | None = None) -> cindex.TranslationUnit:
        text = "".join(f'#include "{header}"\n' for header in self._headers)
        args = ["-xc", "-std=c99", *(f"-I{root}" for root in self._roots)]
        unsaved = [(_ALL, text)]
        if target:
            args += [f"--target={target}", "-ffreestanding", f"-isystem{_HERE}"]
            unsaved += [(f"{_HERE}/{name}.h", "#include <stddef.h>\n") for name in _HOSTED]
        unit = cindex.Index.create().parse(
            _ALL, args=args, unsaved_files=unsaved,
            options=cindex.TranslationUnit.PARSE_SKIP_FUNCTION_BODIES)
        problems = []
        for diagnostic in unit.diagnostics:
            if diagnostic.severity >= cindex.Diagnostic.Error:
                problems.append(self._compile_problem(diagnostic, target))
        if problems:
            raise HeaderError(problems)
        return unit

    def _compile_problem(self, diagnostic: cindex.Diagnostic, target: str | None) -> Problem:
        place = diagnostic.location
        file = self._show(place.file.name) if place.file else "command line"
        if match := re.search(r"redefinition .*'(?:struct )?(\w+)'|redefinition of '(\w+)'",
                              diagnostic.spelling):
            others = [f" in {self._show(note.location.file.name)}:{note.location.line}"
                      for note in diagnostic.children if note.location.file]
            return Problem(file, place.line, "a name stands for one thing in all headers",
                           f"{diagnostic.spelling}; the other is{(others or [' elsewhere'])[0]}",
                           f"rename one `{match[1] or match[2]}`")
        where = f" for {target}, without an operating system" if target else ""
        return Problem(file, place.line, f"a header compiles as C99{where}",
                       f"clang says: {diagnostic.spelling}", "correct it")

    def _refuse_shared_guards(self) -> None:
        """The second header with a guard would vanish without a word."""
        guards: dict[str, str] = {}
        problems = []
        for header, text in sorted(self._texts.items()):
            match = re.search(r"^[ \t]*#[ \t]*ifndef[ \t]+(\w+)\s+#[ \t]*define[ \t]+\1\b", text, re.M)
            if match and guards.setdefault(match[1], header) != header:
                line = text.count("\n", 0, match.start()) + 1
                problems.append(Problem(self._show(header), line, "an include guard is a header's own",
                                        f"`{match[1]}` also guards {self._show(guards[match[1]])}",
                                        "name it after the header's path"))
        if problems:
            raise HeaderError(problems)

    @staticmethod
    def _file(cursor: cindex.Cursor) -> str:
        file = cursor.location.file
        return os.path.abspath(file.name) if file and file.name != _ALL else ""

    def _show(self, file: str) -> str:
        return self._shown.get(os.path.abspath(file), file)

    def _relative(self, file: str) -> str:
        for root in self._roots:
            if file.startswith(root + os.sep):
                return os.path.relpath(file, root).replace(os.sep, "/")
        return file

    # Structs

    @staticmethod
    def _struct_name(cursor: cindex.Cursor) -> str:
        """The tag, or, where there is none, what the type is spelt as: its typedef's name."""
        return cursor.spelling or cursor.type.spelling

    def _struct(self, cursor: cindex.Cursor) -> Struct | None:
        """The struct, read once; None where it is so wrong that nothing more can be said."""
        name = self._struct_name(cursor)
        if name in self._problems:
            return self._structs.get(name)
        self._problems[name] = []
        self._parsing.append(name)
        try:
            file = self._file(cursor)
            source = self._sources.get(file)
            struct = Struct(name, comment.doc_text(cursor.raw_comment), Kind.PLAIN,
                            cursor.type.get_size(), cursor.type.get_align(), (),
                            self._relative(file), self._show(file), cursor.location.line,
                            source.library if source else "")
            self._check_typedef(cursor, name, "struct")
            members = list(cursor.type.get_fields())
            if not members:
                self._refuse(cursor, "a struct has members", f"`{name}` has none", "leave it out")
            if any(self._is_group(member) for member in members):
                kind = source.kind if source else Kind.MODULE
                struct = replace(struct, kind=kind, fields=self._face_fields(members))
                if kind is Kind.MODULE:
                    self._check_prototypes(struct)
            else:
                struct = replace(struct, fields=self._fields(members, Group.NONE, 0))
                first = struct.fields[0] if struct.fields else None
                if first and first.ctype == "Head" and first.name == "head":
                    struct = replace(struct, kind=Kind.MESSAGE)
            self._problems[name] += rules.check(struct)
            self._structs[name] = struct
            return struct
        finally:
            self._parsing.pop()

    def _refuse(self, cursor: cindex.Cursor, rule: str, found: str, advice: str) -> None:
        place = cursor.location
        self._problems[self._parsing[-1]].append(
            Problem(self._show(place.file.name), place.line, rule, found, advice))

    def _check_typedef(self, cursor: cindex.Cursor, name: str, word: str) -> None:
        typedef = self._typedefs.get(name)
        if not cursor.spelling or typedef is None \
                or typedef.type.get_canonical() != cursor.type.get_canonical():
            tag = f"the tag `{cursor.spelling}`" if cursor.spelling else "no tag"
            shown = f"`{name}` with {tag}" if re.fullmatch(r"\w+", name) else f"{word} with {tag}"
            self._refuse(cursor, f"a {word} is `typedef {word} NAME {{...}} NAME;`", shown,
                         "give tag and typedef one name")

    @staticmethod
    def _is_group(member: cindex.Cursor) -> bool:
        declaration = _stripped(member.type).get_declaration()
        return declaration.kind is CursorKind.STRUCT_DECL and not declaration.spelling \
            and _stripped(member.type).kind is not TypeKind.TYPEDEF \
            and member.type.kind is not TypeKind.TYPEDEF

    def _face_fields(self, members: list[cindex.Cursor]) -> tuple[Field, ...]:
        fields: tuple[Field, ...] = ()
        for member in members:
            valid = [group.value for group in Group if group.value]
            if member.spelling not in valid or not self._is_group(member) \
                    or member.type.kind is TypeKind.CONSTANTARRAY:
                self._refuse(member, "a face consists of the groups in, out, par and mem, each a "
                             "`struct {...}`", f"`{member.spelling or member.type.spelling}`",
                             "put it into one of them")
                continue
            inner = list(_stripped(member.type).get_fields())
            if not inner:
                self._refuse(member, "a group has members", f"`{member.spelling}` has none",
                             "leave it out")
            fields += self._fields(inner, Group(member.spelling), member.get_field_offsetof() // 8)
        return fields

    def _check_prototypes(self, struct: Struct) -> None:
        for verb, arguments in (("reset", [f"{struct.name} *"]),
                                ("update", [f"{struct.name} *", "Tick"])):
            name = f"{struct.snake_name}_{verb}"
            wanted = f"void {name}({struct.name} *m{', Tick t' if verb == 'update' else ''});"
            function = self._functions.get(name)
            rule = f"a module declares `{wanted}`"
            if function is None:
                self._problems[struct.name].append(
                    Problem(struct.path, struct.line, rule, "it is not declared",
                            "declare it after the struct, in the same header"))
            elif function.result_type.kind is not TypeKind.VOID or \
                    [a.type.spelling for a in function.get_arguments()] != arguments:
                self._refuse(function, rule, f"`{name}` is `{function.type.spelling}`", "correct it")

    # Fields

    def _fields(self, members: list[cindex.Cursor], group: Group, start: int) -> tuple[Field, ...]:
        fields, lines, comments = [], {}, {}
        for member in members:
            line = member.location.line
            extent = _LIBCLANG.clang_Cursor_getCommentRange(member).start
            place = (extent.file.name, extent.offset) if extent.file else None
            other = lines.get(line) or (place and comments.get(place))
            if other:
                self._refuse(member, "a line declares one member, with its own comment",
                             f"`{member.spelling}` shares the line or comment of `{other}`",
                             "give it a line and a comment")
                continue
            lines[line] = member.spelling
            if place:
                comments[place] = member.spelling
            if field := self._field(member, group, start):
                fields.append(field)
        return tuple(fields)

    def _field(self, member: cindex.Cursor, group: Group, start: int) -> Field | None:
        try:
            if not member.spelling:
                raise Refusal("a member has a name", f"`{member.type.spelling}` has none",
                              "name it")
            if member.is_bitfield():
                raise Refusal("there are no bit-fields",
                              f"`{member.spelling}` has {member.get_bitfield_width()} bits",
                              "use a whole integer, with flags as constants")
            field = self._typed_field(member, group, start)
        except Refusal as refusal:
            self._refuse(member, refusal.rule, refusal.found, refusal.advice)
            return None
        try:
            text = comment.field_text(member.raw_comment)
            if member.raw_comment and text is None:
                raise Refusal("a member's comment stands after it, as `///< ...`",
                              f"`{member.raw_comment.splitlines()[0]}` before `{field.name}`",
                              "move it to the end of the line")
            said = comment.parse(text or "")
        except Refusal as refusal:
            self._refuse(member, refusal.rule, refusal.found, refusal.advice)
            return replace(field, unit=comment.parse("[-]").unit)  # one complaint is enough
        return replace(field, unit=said.unit, clauses=said.clauses, bounds=said.bounds,
                       count=said.count, doc=said.meaning)

    def _typed_field(self, member: cindex.Cursor, group: Group, start: int) -> Field:
        element, shape = member.type, ()
        while element.kind is TypeKind.CONSTANTARRAY:
            shape += (element.element_count,)
            element = element.element_type
        ctype = element.spelling
        if element.is_const_qualified() or element.is_volatile_qualified():
            raise Refusal("a member is neither const nor volatile", f"`{ctype} {member.spelling}`",
                          "leave out the qualifier")
        # Typedefs of typedefs, and typedefs of arrays, down to a name with a fixed width.
        while element.spelling not in FIXED:
            if element.kind is TypeKind.TYPEDEF:
                element = element.get_declaration().underlying_typedef_type
            elif element.kind is TypeKind.ELABORATED:
                element = element.get_named_type()
            elif element.kind is TypeKind.CONSTANTARRAY:
                shape += (element.element_count,)
                element = element.element_type
            else:
                break
        type_, struct, enumeration = FIXED.get(element.spelling), None, None
        if type_ is None:
            if element.kind in (TypeKind.CHAR_S, TypeKind.CHAR_U) and shape:
                type_ = Type.CHAR
            elif element.kind is TypeKind.ENUM:
                type_, enumeration = Type.ENUM, self._enum(element.get_declaration(), member)
            elif element.kind is TypeKind.RECORD:
                declaration = element.get_declaration()
                name = self._struct_name(declaration)
                if name in ARRAYS:
                    type_, shape = Type.F64, shape + self._array_shape(declaration)
                else:
                    type_, struct = Type.STRUCT, self._member_struct(declaration, member)
            else:
                raise _plain_type(element, ctype, member.spelling)
        if 0 in shape or len(shape) > DIMS_MAX:
            raise Refusal(f"an array has 1 to {DIMS_MAX} dimensions, none of them 0",
                          f"`{member.spelling}` has {list(shape)}", "change its shape")
        return Field(member.spelling, type_, ctype, shape,
                     start + member.get_field_offsetof() // 8, member.type.get_size(),
                     member.location.line, group, struct=struct, enum=enumeration)

    def _member_struct(self, declaration: cindex.Cursor, member: cindex.Cursor) -> Struct:
        if declaration.kind is CursorKind.UNION_DECL:
            raise Refusal("there are no unions", f"`{member.spelling}`",
                          "give each meaning a member of its own")
        if not declaration.spelling and "(" in declaration.type.spelling:
            raise Refusal("a struct within a struct has a name of its own",
                          f"`{member.spelling}` is an unnamed struct",
                          "declare `typedef struct NAME {...} NAME;` before")
        struct = self._struct(declaration)
        if struct is None or not struct.fields:
            raise Refusal("a member's type keeps the rules too",
                          f"`{member.spelling}` is a {self._struct_name(declaration)}",
                          "correct that struct first")
        if struct.kind.is_face:
            raise Refusal("a face is no member of another struct",
                          f"`{member.spelling}` is a {struct.name}", "wire modules by messages")
        return struct

    @staticmethod
    def _array_shape(declaration: cindex.Cursor) -> tuple[int, ...]:
        name = declaration.type.spelling.removeprefix("struct ")
        shape, members = (), list(declaration.type.get_fields())
        inner = members[0].type if len(members) == 1 else declaration.type
        while inner.kind is TypeKind.CONSTANTARRAY:
            shape += (inner.element_count,)
            inner = inner.element_type
        if inner.kind is not TypeKind.DOUBLE or shape != ARRAYS[name]:
            dims = "".join(f"[{n}]" for n in ARRAYS[name])
            raise Refusal(f"a {name} is one member of double{dims}",
                          "another struct of that name", "rename it")
        return shape

    # Enums

    def _enum(self, cursor: cindex.Cursor, member: cindex.Cursor | None = None) -> Enumeration:
        name = cursor.spelling
        if not name:
            raise Refusal("an enum is `typedef enum NAME {...} NAME;`",
                          f"`{member.spelling}` is an untagged enum" if member else "an untagged one",
                          "give tag and typedef one name")
        if name in self._enums:
            return self._enums[name]
        typedef = self._typedefs.get(name)
        if typedef is None or typedef.type.get_canonical() != cursor.type.get_canonical():
            raise Refusal("an enum is `typedef enum NAME {...} NAME;`",
                          f"`enum {name}` has no typedef of its name", "give it one")
        if cursor.type.get_size() != 4:
            raise Refusal("an enum has 4 bytes", f"`{name}` has {cursor.type.get_size()}",
                          "leave out attributes, and keep its values within 32 bits")
        file = self._file(cursor)
        source = self._sources.get(file)
        values = tuple(Enumerator(c.spelling, c.enum_value, comment.field_text(c.raw_comment) or "")
                       for c in cursor.get_children() if c.kind is CursorKind.ENUM_CONSTANT_DECL)
        self._enums[name] = Enumeration(name, comment.doc_text(cursor.raw_comment), values,
                                        self._relative(file), source.library if source else "")
        return self._enums[name]

    def _keep_if_sound(self, cursor: cindex.Cursor) -> None:
        """An enum that no field has is kept where it may be used by another library."""
        try:
            self._enum(cursor)
        except Refusal:
            pass  # Constants by another name, or private to some function: nobody's interface.

    # All of them

    def _judge(self) -> None:
        """Raise what is wrong with interfaces; leave out what is wrong elsewhere."""
        interfaces = [s for s in self._structs.values() if s.kind is not Kind.PLAIN]
        strict = set()
        pending = [s.name for s in interfaces if s.library]
        while pending:
            name = pending.pop()
            if name not in strict:
                strict.add(name)
                pending += self._used_by(name)
        problems = [p for name in strict for p in self._problems[name]]
        if problems:
            raise HeaderError(problems)
        self._structs = {name: struct for name, struct in self._structs.items()
                         if name in strict or self._is_sound(name)}

    def _used_by(self, name: str) -> list[str]:
        return [struct.name for struct in self._structs[name].uses()] if name in self._structs else []

    def _is_sound(self, name: str) -> bool:
        return not self._problems[name] and all(self._is_sound(used) for used in self._used_by(name))

    def _compare_layout(self, model: Model, target: str) -> None:
        unit = self._parse(target)
        problems = []
        for cursor in unit.cursor.get_children():
            if cursor.kind is not CursorKind.STRUCT_DECL or not cursor.is_definition():
                continue
            struct = model.structs.get(cursor.spelling)
            if struct is None:
                continue
            here = [struct.size, *(f.offset for f in struct.fields)]
            there = [cursor.type.get_size(), *_offsets(cursor.type)]
            if here != there:
                problems.append(Problem(struct.path, struct.line, "a layout is the same everywhere",
                                        f"`{struct.name}` has size and offsets {here} here, {there} "
                                        f"on {target}", "use fixed-width types, 8-byte ones first"))
        if problems:
            raise HeaderError(problems)


def _offsets(record: cindex.Type, start: int = 0) -> list[int]:
    """The offsets of all members, those of unnamed structs (groups) in their place."""
    offsets = []
    for member in record.get_fields():
        offset = start + member.get_field_offsetof() // 8
        if _Reader._is_group(member):
            offsets += _offsets(member.type.get_canonical(), offset)
        else:
            offsets.append(offset)
    return offsets


def _stripped(type_: cindex.Type) -> cindex.Type:
    """The type without its array dimensions and without the word `struct`."""
    while type_.kind is TypeKind.CONSTANTARRAY:
        type_ = type_.element_type
    return type_.get_named_type() if type_.kind is TypeKind.ELABORATED else type_


def _plain_type(element: cindex.Type, ctype: str, name: str) -> Refusal:
    if element.kind is TypeKind.POINTER:
        return Refusal("there are no pointers", f"`{name}` is a `{ctype}`", "hold the thing itself")
    if element.kind in (TypeKind.INCOMPLETEARRAY, TypeKind.VARIABLEARRAY):
        return Refusal("an array has a fixed size", f"`{name}` is a `{ctype}`",
                       "give the largest size, and say with `count` how much of it is used")
    if element.kind in (TypeKind.CHAR_S, TypeKind.CHAR_U):
        return Refusal("char is for texts, as an array", f"`char {name}`", "use int8_t or uint8_t")
    return Refusal("numbers are double, float, or integers of fixed width", f"`{ctype} {name}`",
                   "use int32_t, uint32_t or another of <stdint.h>, uint8_t for a truth value")
