# SPDX-License-Identifier: Apache-2.0
"""Headers -> model, by libclang.

All headers are parsed as one unsaved C99 translation unit without function bodies, once for this
machine and once for each of TARGETS, so that a layout which differs anywhere is refused here.

What the model holds: the interfaces (structs with the groups in, out, par, mem) and the messages
(structs that begin with `Head head`) of the folders that the command names, and everything these are
made of, from wherever it is included. They must keep every rule. Other plain structs of the folders
are taken too if they keep the rules. If not, the model leaves them out: they are no interface.
"""
from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from clang.cindex import Cursor, CursorKind, TypeKind
from clang.cindex import Type as ClangType

from introspect import comment, libclang, rules, units
from introspect.errors import HeaderError, Problem, Refusal
from introspect.model import (Argument, Constant, Enumeration, Enumerator, Field, Function, Group, Kind, Model, Struct,
                              Type)
from introspect.sources import Headers, Source

# Where flight code flies besides this machine: big-endian 32-bit SPARC V8, and aarch64.
TARGETS = ("sparc-linux-gnu", "aarch64-linux-gnu")

FIXED = {"double": Type.F64, "float": Type.F32,
         "int8_t": Type.I8, "uint8_t": Type.U8, "int16_t": Type.I16, "uint16_t": Type.U16,
         "int32_t": Type.I32, "uint32_t": Type.U32, "int64_t": Type.I64, "uint64_t": Type.U64}

# Arrays by another name: structs only because C cannot return arrays.
ARRAYS = {"Vec3": (3,), "Mat3": (3, 3)}

DIMS_MAX = 4  # as sim/table.h

_GROUPS = {group.value: group for group in Group if group is not Group.NONE}


def read(sources: Sequence[Source], include: Iterable[Path] = ()) -> Model:
    """The model of all headers of `sources`. `include` are further folders for `#include`, for what
    is used but belongs to another library. Raises HeaderError with every problem found."""
    headers = Headers(sources, include)
    model = _Reader(headers).model()
    for target in TARGETS:
        _compare_layout(model, headers, target)
    return model


def _compare_layout(model: Model, headers: Headers, target: str) -> None:
    problems = []
    for cursor in libclang.parse(headers, target).cursor.get_children():
        struct = model.structs.get(cursor.spelling)
        if cursor.kind is not CursorKind.STRUCT_DECL or not cursor.is_definition() or not struct:
            continue
        here = [*(f.offset for f in struct.fields), struct.size]
        there = [*libclang.offsets(cursor.type, struct.kind.is_interface), cursor.type.get_size()]
        if here != there:
            problems.append(Problem(
                struct.path, struct.line, "a layout is the same everywhere",
                f"`{struct.name}` has offsets and size {here} here, {there} on {target}",
                "declare the same members of fixed width everywhere"))
    if problems:
        raise HeaderError(problems)


class _Reader:
    def __init__(self, headers: Headers):
        self._headers = headers
        self._unit = libclang.parse(headers)
        self._declarations = [c for c in self._unit.cursor.get_children() if libclang.file_of(c)]
        self._typedefs = self._by_name(CursorKind.TYPEDEF_DECL)
        self._functions = self._by_name(CursorKind.FUNCTION_DECL)
        self._variables = self._by_name(CursorKind.VAR_DECL)
        self._enum_cursors = self._by_name(CursorKind.ENUM_DECL)
        self._structs: dict[str, Struct] = {}
        self._enums: dict[str, Enumeration] = {}
        # By struct: its problems, and the structs of its members.
        self._problems: dict[str, list[Problem]] = {}
        self._uses: dict[str, list[str]] = {}
        self._incomplete: set[str] = set()  # structs with a member that was refused
        self._reading: list[str] = []       # the struct being read, after those it is part of
        self._unread: list[Problem] = []    # structs that look like interfaces, and are read as none

    def _by_name(self, kind: CursorKind) -> dict[str, Cursor]:
        return {c.spelling: c for c in self._declarations if c.kind is kind}

    def model(self) -> Model:
        for cursor in self._declarations:
            if libclang.file_of(cursor) not in self._headers.sources or not cursor.is_definition():
                continue
            if cursor.kind is CursorKind.STRUCT_DECL and libclang.struct_name(cursor) not in ARRAYS:
                self._struct(cursor)
            elif cursor.kind is CursorKind.ENUM_DECL:
                self._keep_if_sound(cursor)
        self._judge()
        included = {os.path.abspath(i.include.name) for i in self._unit.get_includes()}
        return Model(dict(sorted(self._structs.items())), dict(sorted(self._enums.items())),
                     self._headers.libraries, tuple(self._number_functions()),
                     tuple(sorted(included | self._headers.ignored)),
                     tuple(sorted(self._headers.folders)), tuple(self._constants()))

    def _constants(self) -> Iterator[Constant]:
        for cursor in self._declarations:
            file = libclang.file_of(cursor)
            if cursor.kind is CursorKind.ENUM_DECL and file in self._headers.sources and not libclang.tag(cursor):
                yield from (Constant(c.spelling, c.enum_value, self._headers.library(file))
                            for c in cursor.get_children() if c.kind is CursorKind.ENUM_CONSTANT_DECL)

    def _judge(self) -> None:
        """Raise the problems of interfaces and messages; leave out other structs with problems. Where these are all
        interfaces that there may be, this libclang is not understood."""
        if self._unread and not any(struct.kind.is_interface for struct in self._structs.values()):
            raise HeaderError(self._unread)
        strict: set[str] = set()
        pending = [s.name for s in self._structs.values() if s.library and s.kind is not Kind.PLAIN]
        while pending:
            name = pending.pop()
            if name not in strict:
                strict.add(name)
                pending += self._uses[name]
        problems = [problem for name in strict for problem in self._problems[name]]
        if problems:
            raise HeaderError(problems)
        self._structs = {name: struct for name, struct in self._structs.items()
                         if name in strict or self._is_sound(name)}

    def _is_sound(self, name: str) -> bool:
        return not self._problems[name] and all(map(self._is_sound, self._uses[name]))

    def _comment(self, cursor: Cursor) -> str | None:
        """The comment of a declaration. Raises HeaderError if it is not in UTF-8."""
        try:
            text: str | None = cursor.raw_comment
        except UnicodeDecodeError:
            raise self._headers.no_utf8(libclang.file_of(cursor)) from None
        return text

    def _refuse(self, cursor: Cursor, refusal: Refusal) -> None:
        """Note a problem of the struct being read."""
        place = cursor.location
        self._problems[self._reading[-1]].append(
            refusal.at(self._headers.show(place.file.name), place.line))

    def _drop(self, cursor: Cursor, refusal: Refusal) -> None:
        """The same, of a member that can be no Field."""
        self._refuse(cursor, refusal)
        self._incomplete.add(self._reading[-1])

    # Structs

    def _struct(self, cursor: Cursor) -> Struct:
        """The struct, read once, its problems collected."""
        name = libclang.struct_name(cursor)
        if name in self._structs:
            return self._structs[name]
        self._problems[name], self._uses[name] = [], []
        self._reading.append(name)
        self._check_typedef(cursor, name)
        file = libclang.file_of(cursor)
        source = self._headers.sources.get(file)
        members = list(cursor.type.get_fields())
        if not members:
            self._refuse(cursor, Refusal("a struct has members", f"`{name}` has none",
                                         "leave it out"))
        if _is_interface(members):
            kind, fields = source.kind if source else Kind.MODULE, self._interface_fields(members)
        else:
            if source and members and {member.spelling for member in members} <= _GROUPS.keys():
                self._unread.append(Problem(
                    self._headers.show(file), cursor.location.line, "a library has modules or models",
                    f"`{name}` looks like one, and libclang reads none", "install another version of python3-clang"))
            kind, fields = Kind.PLAIN, self._fields(members, Group.NONE, 0)
            if fields and fields[0].ctype == "Head" and fields[0].name == "head":
                kind = Kind.MESSAGE
        struct = Struct(name, comment.doc_text(self._comment(cursor)), kind, cursor.type.get_size(),
                        cursor.type.get_align(), fields, self._headers.relative(file),
                        self._headers.show(file), cursor.location.line,
                        self._headers.library(file))
        if kind is Kind.MODULE:
            self._check_prototypes(cursor, struct)
            struct = replace(struct, service=f"{struct.snake_name}_service" in self._variables,
                             events=self._event_ids(cursor, struct))
        self._problems[name] += rules.check(struct, complete=name not in self._incomplete)
        self._reading.pop()
        self._structs[name] = struct
        return struct

    def _check_typedef(self, cursor: Cursor, name: str) -> None:
        if not libclang.tag(cursor):
            found = f"`{name}` has no tag"
        elif not self._has_typedef(cursor):
            found = f"`struct {name}` has no typedef of its name"
        else:
            return
        self._refuse(cursor, Refusal("a struct is `typedef struct NAME {...} NAME;`", found,
                                     "give tag and typedef one name"))

    def _has_typedef(self, cursor: Cursor) -> bool:
        typedef = self._typedefs.get(cursor.spelling)
        return typedef is not None and typedef.type.get_canonical() == cursor.type.get_canonical()

    def _interface_fields(self, members: list[Cursor]) -> tuple[Field, ...]:
        fields: tuple[Field, ...] = ()
        for member in members:
            name, record = libclang.member_name(member), member.type.get_canonical()
            if name not in _GROUPS or record.kind is not TypeKind.RECORD \
                    or record.get_declaration().kind is not CursorKind.STRUCT_DECL:
                self._drop(member, Refusal(
                    "an interface consists of the groups in, out, par and mem, each a `struct {...}`",
                    f"`{name}`" if name else "an unnamed member", "put it into one of them"))
                continue
            inner = list(record.get_fields())
            if not inner:
                self._refuse(member, Refusal("a group has members", f"`{name}` has none",
                                             "leave it out"))
            own = self._fields(inner, _GROUPS[name], member.get_field_offsetof() // 8)
            if not libclang.is_group(member):   # a struct that several interfaces share, declared elsewhere
                own = tuple(replace(field, line=member.location.line) for field in own)
            fields += own
        return fields

    def _check_prototypes(self, cursor: Cursor, struct: Struct) -> None:
        own, name = f"{struct.name} *", struct.snake_name
        for function, arguments, written in (
                (f"{name}_reset", [own], f"void {name}_reset({own}m);"),
                (f"{name}_update", [own, "Tick"], f"void {name}_update({own}m, Tick t);")):
            rule, declared = f"a module declares `{written}`", self._functions.get(function)
            if declared is None:
                self._refuse(cursor, Refusal(rule, f"`{function}` is not declared",
                                             "declare it after the struct"))
            elif declared.result_type.kind is not TypeKind.VOID or \
                    [a.type.spelling for a in declared.get_arguments()] != arguments:
                self._refuse(declared, Refusal(
                    rule, f"`{function}` is `{declared.type.spelling}`", "correct it"))

    def _event_ids(self, cursor: Cursor, struct: Struct) -> Enumeration | None:
        """What a module with an output FlightEvent says, by an enum beside it."""
        if not any(f.group is Group.OUT and f.struct and f.struct.name == "FlightEvent" for f in struct.fields):
            return None
        name, begin = f"{struct.name}EventId", f"{struct.snake_name.upper()}_"
        declared = self._enum_cursors.get(name)
        if declared is None:
            self._refuse(cursor, Refusal("a module with an output FlightEvent has an enum of its events",
                                         f"`{name}` is not declared",
                                         f"declare `typedef enum {name} {{...}} {name};` before the struct"))
            return None
        for child in declared.get_children():
            try:
                comment.event(comment.field_text(self._comment(child)) or "")
                if not child.spelling.startswith(begin) or child.enum_value < 0:
                    raise Refusal(f"an event's id begins with {begin} and is not negative",
                                  f"`{child.spelling} = {child.enum_value}`", "correct it")
            except Refusal as refusal:
                self._refuse(child, refusal)
        return self._enum(declared)

    # Fields

    def _fields(self, members: list[Cursor], group: Group, start: int) -> tuple[Field, ...]:
        """The fields of a struct, or of a group that begins at byte `start` of its interface."""
        fields: list[Field] = []
        lines: dict[int, str] = {}
        comments: dict[tuple[str, int], str] = {}
        for member in members:
            line, place = member.location.line, libclang.comment_place(member)
            other = lines.get(line) or (comments.get(place) if place else None)
            lines[line] = member.spelling
            if place:
                comments[place] = member.spelling
            try:
                if other:
                    raise Refusal("a line declares one member, with its own comment",
                                  f"`{member.spelling}` shares the line or comment of `{other}`",
                                  "give it a line and a comment")
                field = self._typed_field(member, group, start)
            except Refusal as refusal:
                self._drop(member, refusal)
            else:
                fields.append(self._commented(field, member))
        return tuple(fields)

    def _commented(self, field: Field, member: Cursor) -> Field:
        """The field with unit, clauses and meaning from its comment."""
        raw = self._comment(member)
        text = comment.field_text(raw)
        try:
            if raw and text is None:
                raise Refusal("a member's comment stands after it, as `///< ...`",
                              f"`{raw.splitlines()[0]}` before `{field.name}`",
                              "move it to the end of the line")
            parsed = comment.parse(text or "")
        except Refusal as refusal:
            self._refuse(member, refusal)
            return replace(field, unit=units.DIMENSIONLESS)  # one complaint is enough
        return replace(field, unit=parsed.unit, clauses=parsed.clauses, bounds=parsed.bounds,
                       count=parsed.count, distinct=parsed.distinct, doc=parsed.meaning, range=parsed.range)

    def _typed_field(self, member: Cursor, group: Group, start: int) -> Field:
        """The field without its comment. Raises Refusal."""
        name = libclang.member_name(member)
        if not name:
            raise Refusal("a member has a name", "an unnamed member", "name it")
        if member.is_bitfield():
            raise Refusal("there are no bit-fields",
                          f"`{name}` has {member.get_bitfield_width()} bits",
                          "use a whole integer, with flags as constants")
        element, shape = _element(member.type)
        ctype = element.spelling
        if element.is_const_qualified() or element.is_volatile_qualified():
            raise Refusal("a member is neither const nor volatile", f"`{ctype} {name}`",
                          "leave out the qualifier")
        # Typedefs of typedefs, and typedefs of arrays, down to a name with a fixed width.
        while element.spelling not in FIXED and element.kind in (TypeKind.TYPEDEF,
                                                                 TypeKind.ELABORATED):
            if element.kind is TypeKind.TYPEDEF:
                element = element.get_declaration().underlying_typedef_type
            else:
                element = element.get_named_type()
            element, more = _element(element)
            shape += more

        type_, struct, enumeration = FIXED.get(element.spelling), None, None
        declaration = element.get_declaration()
        if element.kind is TypeKind.RECORD:
            if libclang.struct_name(declaration) in ARRAYS:
                type_, shape = Type.F64, shape + _array_shape(declaration)
            else:
                type_, struct = Type.STRUCT, self._member_struct(declaration, name)
        elif element.kind is TypeKind.ENUM:
            type_, enumeration = Type.ENUM, self._enum(declaration, f"the type of `{name}`")
        elif element.kind in (TypeKind.CHAR_S, TypeKind.CHAR_U) and shape:
            type_ = Type.CHAR
        if type_ is None:
            raise _no_type(element, ctype, name)
        if 0 in shape or len(shape) > DIMS_MAX:
            raise Refusal(f"an array has 1 to {DIMS_MAX} dimensions, none of them 0",
                          f"`{name}` has {list(shape)}", "change its shape")
        return Field(name, type_, ctype, shape, start + member.get_field_offsetof() // 8,
                     member.type.get_size(), member.location.line, group,
                     struct=struct, enum=enumeration)

    def _member_struct(self, declaration: Cursor, member: str) -> Struct:
        if declaration.kind is CursorKind.UNION_DECL:
            raise Refusal("there are no unions", f"`{member}` is one",
                          "give each meaning a member of its own")
        if declaration.is_anonymous():
            raise Refusal("a struct within a struct has a name of its own",
                          f"`{member}` is an unnamed struct",
                          "declare it before, as `typedef struct NAME {...} NAME;`")
        struct = self._struct(declaration)
        self._uses[self._reading[-1]].append(struct.name)
        if struct.kind.is_interface:
            raise Refusal("an interface is no member of another struct",
                          f"`{member}` is of type {struct.name}", "wire modules by messages")
        return struct

    # Functions

    def _number_functions(self) -> Iterator[Function]:
        """The functions of the headers whose parameters are numbers and arrays, and pointers to results at the end."""
        for name, cursor in sorted(self._functions.items()):
            file = libclang.file_of(cursor)
            if file not in self._headers.sources:
                continue
            cursors = list(cursor.get_arguments())
            pointers = [a.type.kind is TypeKind.POINTER for a in cursors]
            if pointers != sorted(pointers):
                continue
            arguments = [_argument(a.spelling, a.type.get_pointee() if pointer else a.type)
                         for a, pointer in zip(cursors, pointers)]
            known = [argument for argument in arguments if argument]
            takes, fills = known[:pointers.count(False)], known[pointers.count(False):]
            returns = _argument("", cursor.result_type)
            if len(known) < len(arguments) or not returns and cursor.result_type.kind is not TypeKind.VOID \
                    or not returns and not fills or any(take.ctype == "int" for take in takes):
                continue
            doc = comment.doc_text(self._comment(cursor)) or comment.field_text(self._comment(cursor)) or ""
            yield Function(name, doc, tuple(takes), returns, tuple(fills), self._headers.relative(file),
                           self._headers.library(file))

    # Enums

    def _enum(self, cursor: Cursor, where: str = "the enum") -> Enumeration:
        name = libclang.tag(cursor)
        if name in self._enums:
            return self._enums[name]
        rule = "an enum is `typedef enum NAME {...} NAME;`"
        if not name:
            raise Refusal(rule, f"{where} has no tag", "give tag and typedef one name")
        if not self._has_typedef(cursor):
            raise Refusal(rule, f"`enum {name}` has no typedef of its name",
                          "give tag and typedef one name")
        if cursor.type.get_size() != 4:
            raise Refusal("an enum has 4 bytes", f"`{name}` has {cursor.type.get_size()}",
                          "leave out attributes, and keep its values within 32 bits")
        file = libclang.file_of(cursor)
        values = tuple(Enumerator(c.spelling, c.enum_value, comment.field_text(self._comment(c)) or "")
                       for c in cursor.get_children() if c.kind is CursorKind.ENUM_CONSTANT_DECL)
        self._enums[name] = Enumeration(name, comment.doc_text(self._comment(cursor)), values,
                                        self._headers.relative(file), self._headers.library(file))
        return self._enums[name]

    def _keep_if_sound(self, cursor: Cursor) -> None:
        """An enum that no field has is kept where another library may use it."""
        try:
            self._enum(cursor)
        except Refusal:
            pass  # constants without a common name: no interface


def _is_interface(members: list[Cursor]) -> bool:
    """Whether a struct is meant as an interface: it has one of the groups, or nothing but groups."""
    groups = [member.spelling for member in members if libclang.is_group(member)]
    return bool(groups) and (len(groups) == len(members) or not _GROUPS.keys().isdisjoint(groups))


def _element(type_: ClangType) -> tuple[ClangType, tuple[int, ...]]:
    """What an array is made of, and its dimensions."""
    shape: tuple[int, ...] = ()
    while type_.kind is TypeKind.CONSTANTARRAY:
        shape += (type_.element_count,)
        type_ = type_.element_type
    return type_, shape


def _argument(name: str, type_: ClangType) -> Argument | None:
    """A number, or a struct of one array of doubles; None if it is neither."""
    if type_.is_const_qualified():
        return None
    if type_.spelling in ("double", "int"):
        return Argument(name, type_.spelling, ())
    record = type_.get_canonical()
    members = list(record.get_fields()) if record.kind is TypeKind.RECORD else []
    element, shape = _element(members[0].type) if len(members) == 1 else (record, ())
    return Argument(name, type_.spelling, shape) if shape and element.kind is TypeKind.DOUBLE else None


def _array_shape(declaration: Cursor) -> tuple[int, ...]:
    """The shape of a Vec3 or Mat3, which is what its name promises."""
    name = libclang.struct_name(declaration)
    members = list(declaration.type.get_fields())
    element, shape = _element(members[0].type if len(members) == 1 else declaration.type)
    if element.kind is not TypeKind.DOUBLE or shape != ARRAYS[name]:
        dims = "".join(f"[{n}]" for n in ARRAYS[name])
        raise Refusal(f"a {name} is a struct of one double{dims}", f"another struct {name}",
                      "rename it")
    return shape


def _no_type(element: ClangType, ctype: str, name: str) -> Refusal:
    if element.kind is TypeKind.POINTER:
        return Refusal("there are no pointers", f"`{name}` is a `{ctype}`", "hold the thing itself")
    if element.kind is TypeKind.INCOMPLETEARRAY:
        return Refusal("an array has a fixed size", f"`{name}` is a `{ctype}`",
                       "give the largest size, and say with `count` how much of it is used")
    if element.kind in (TypeKind.CHAR_S, TypeKind.CHAR_U):
        return Refusal("char is for texts, as an array", f"`{ctype} {name}`",
                       "use int8_t or uint8_t")
    return Refusal("numbers are double, float, or integers of fixed width", f"`{ctype} {name}`",
                   "use int32_t, uint32_t or another of <stdint.h>, uint8_t for a truth value")
