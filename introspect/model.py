# SPDX-License-Identifier: Apache-2.0
"""The typed model of a set of C headers: what the reader makes and the emitters write from.

Everything is by value and immutable. Offsets and sizes are in bytes and hold on every target: the
reader has compared them.
"""
from __future__ import annotations

import enum
import functools
import os.path
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from introspect.files import fnv1a


class Type(enum.Enum):
    """What a field, or each element of it, is."""
    F64 = enum.auto()
    F32 = enum.auto()
    I8 = enum.auto()
    U8 = enum.auto()
    I16 = enum.auto()
    U16 = enum.auto()
    I32 = enum.auto()
    U32 = enum.auto()
    I64 = enum.auto()
    U64 = enum.auto()
    CHAR = enum.auto()    # an element of a fixed-size text
    ENUM = enum.auto()
    STRUCT = enum.auto()

    @property
    def is_integer(self) -> bool:
        return self.name[0] in "IU" and self.name[1:].isdigit()

    @property
    def is_unsigned(self) -> bool:
        return self.is_integer and self.name[0] == "U"

    @property
    def is_number(self) -> bool:
        return self.is_integer or self in (Type.F64, Type.F32)


class Group(enum.Enum):
    """Where a member of an interface stands; NONE in messages and plain structs."""
    NONE = ""
    IN = "in"
    OUT = "out"
    PAR = "par"
    MEM = "mem"


class Kind(enum.Enum):
    PLAIN = "plain"      # a struct that messages are made of
    MESSAGE = "message"  # begins with `Head head`
    MODULE = "module"    # flight: groups, reset, update
    MODEL = "model"      # world: groups; its behaviour is C++

    @property
    def is_interface(self) -> bool:
        return self in (Kind.MODULE, Kind.MODEL)


@dataclass(frozen=True)
class Unit:
    """A unit as the header writes it, its exponents of m, kg, s, A, K, mol, cd, rad, and the factor
    to SI (1 but for ns)."""
    text: str
    dims: tuple[int, ...]
    scale: float = 1.0


@dataclass(frozen=True)
class Bounds:
    """The limits of a number; None is unbounded."""
    lo: float | None = None
    hi: float | None = None
    lo_open: bool = False
    hi_open: bool = False


@dataclass(frozen=True)
class Enumerator:
    name: str
    value: int
    doc: str


@dataclass(frozen=True)
class Enumeration:
    """A `typedef enum NAME {...} NAME`, 4 bytes."""
    name: str
    doc: str
    values: tuple[Enumerator, ...]
    header: str
    library: str = ""

    @property
    def type(self) -> Type:
        """The integer that holds it."""
        return Type.I32 if any(e.value < 0 for e in self.values) else Type.U32

    @functools.cached_property
    def short_names(self) -> dict[str, int]:
        """Values by name, without the prefix that all names share: QUALITY_GOOD -> GOOD."""
        common = os.path.commonprefix([e.name for e in self.values])
        prefix = common[:common.rfind("_") + 1]
        return {e.name[len(prefix):] or e.name: e.value for e in self.values}


@dataclass(frozen=True)
class Field:
    """One member, of a group of an interface or of any other struct."""
    name: str
    type: Type
    ctype: str                  # as in the header, without dimensions: "Vec3", "double"
    shape: tuple[int, ...]      # () is a scalar; Vec3 and Mat3 are F64 with trailing (3) and (3, 3)
    offset: int                 # from the start of the outermost struct
    size: int                   # of all elements
    line: int
    group: Group = Group.NONE
    unit: Unit | None = None    # None where the header gives none
    clauses: frozenset[str] = frozenset()  # of comment.WORDS
    bounds: Bounds | None = None
    count: str | None = None    # the field that says how many leading rows count
    distinct: str | None = None  # the other input whose content this one's must differ from
    doc: str = ""
    struct: Struct | None = None      # Type.STRUCT
    enum: Enumeration | None = None   # Type.ENUM
    range: Bounds | None = None       # where the number is in use, both ends; nothing checks it

    @property
    def is_spare(self) -> bool:
        """It fills a gap and means nothing."""
        return self.name.startswith("spare")

    @property
    def path(self) -> str:
        """As C writes it: "par.K"."""
        return f"{self.group.value}.{self.name}" if self.group.value else self.name

    @property
    def element_size(self) -> int:
        count = 1
        for n in self.shape:
            count *= n
        return self.size // count


@dataclass(frozen=True)
class Struct:
    """An interface, a message, or what they are made of."""
    name: str
    doc: str
    kind: Kind
    size: int
    align: int
    fields: tuple[Field, ...]   # in the order of memory; members of groups flattened
    header: str                 # relative to its root, with "/"
    path: str                   # of the header, for messages to people
    line: int
    library: str = ""           # empty: declared outside the folders that the command names
    service: bool = False       # a module with a CommandService
    events: Enumeration | None = None   # a module with an output FlightEvent: what it says

    @property
    def folder(self) -> str:
        return os.path.dirname(self.header)

    @property
    def snake_name(self) -> str:
        """Prefix of the C functions: MrpFeedback -> mrp_feedback."""
        return snake(self.name)

    @functools.cached_property
    def hash(self) -> int:
        """The 64-bit FNV-1a of names, types, shapes, offsets and units, also of nested structs: equal for structs whose
        bytes have the same meaning."""
        text = [f"{self.name} {self.kind.value} {self.size}"]
        for f in self.fields:
            unit = f.unit.text if f.unit else ""
            text.append(f"{f.path} {f.type.name} {f.ctype} {f.shape} {f.offset} {unit}")
            if f.struct:
                text.append(f"{f.struct.hash:016x}")
            if f.enum:
                text.append(" ".join(f"{e.name}={e.value}" for e in f.enum.values))
        return fnv1a("\n".join(text))

    def uses(self) -> Iterator[Struct]:
        """The structs that its fields are, direct ones only, each once."""
        return iter({f.struct.name: f.struct for f in self.fields if f.struct}.values())


def snake(name: str) -> str:
    """MrpFeedback -> mrp_feedback"""
    words = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name)
    return re.sub(r"([A-Z])([A-Z][a-z])", r"\1_\2", words).lower()


@dataclass(frozen=True)
class Argument:
    """What a function takes or gives: a double, an int, or a struct of one array of doubles."""
    name: str
    ctype: str                  # "double", "int", "Vec3"
    shape: tuple[int, ...]      # () is a number


@dataclass(frozen=True)
class Function:
    """A function of numbers and arrays: double, int for what it gives, Vec3 and their like."""
    name: str
    doc: str
    takes: tuple[Argument, ...]
    returns: Argument | None
    fills: tuple[Argument, ...]  # what it writes through pointers, its last parameters
    header: str
    library: str = ""


@dataclass(frozen=True)
class Library:
    """What the headers of one library declare, each in the order of names."""
    name: str
    structs: tuple[Struct, ...]
    enums: tuple[Enumeration, ...]
    functions: tuple[Function, ...] = ()
    constants: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Constant:
    """An enumerator of an enum without a name."""
    name: str
    value: int
    library: str = ""


@dataclass(frozen=True)
class Model:
    """All that was read: structs and enums by name, the libraries in the order of the command,
    functions of numbers, the files and folders on which this depends, and constants."""
    structs: dict[str, Struct]
    enums: dict[str, Enumeration]
    library_names: tuple[str, ...]
    functions: tuple[Function, ...] = field(default=(), compare=False)
    files: tuple[str, ...] = field(default=(), compare=False)
    folders: tuple[str, ...] = field(default=(), compare=False)
    constants: tuple[Constant, ...] = field(default=(), compare=False)

    def library(self, name: str) -> Library:
        if name not in self.library_names:
            raise KeyError(f"no library `{name}`; there are: {', '.join(self.library_names)}")
        return Library(name,
                       tuple(s for s in self.structs.values() if s.library == name),
                       tuple(e for e in self.enums.values() if e.library == name),
                       tuple(f for f in self.functions if f.library == name),
                       {c.name: c.value for c in self.constants if c.library == name})
