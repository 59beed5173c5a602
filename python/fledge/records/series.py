# SPDX-License-Identifier: Apache-2.0
"""Recorded fields by name, as a Log and an Archive have them.

Names are read from the end and may be as short as they are unique: "flight.tracking.error.sigma_BR",
"error.sigma_BR", "sigma_BR". "error" alone is the whole message, "sigma_BR[0]" an element, "wheels[2].axis_B" a field
of a row of an array of structs, "wheels.axis_B" that of all rows.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from fledge.display import table, unit_text
from fledge.elements import short_names
from fledge.errors import SetupError, listed, nearest

if TYPE_CHECKING:
    from typing import Self

    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

HEAD = "head."  # begins the names of the fields that every message has: time, quality, sequence
MODE, ACTIVITY = "ProcessMode", "Activity"     # the messages of executives
NONE, GOOD = 0, 3                              # of Quality: never written; without a defect
STALE_S, STALE_UPDATES = 5.0, 10               # as of stale_after()
HEAD_COLUMNS = {"valid_at": "head.t", "quality": "head.quality"}    # the columns of tables for them


@dataclass
class Series:
    """The samples of a field of a Log or an Archive, and the texts for its labels.

    key: the name that the user gave; name: of the field, with the indices of an element, "sigma_BR[0]"
    port: the path of its message, "flight.tracking.error"
    time: (n,) [s]; values: (n, ...), in `unit`; shape: of one sample
    quality: (n,) of the messages, a Quality each; None if they have no head
    words: value -> name of an enumeration; {} of other fields
    """

    key: str
    name: str
    port: str
    time: NDArray[np.float64]
    values: NDArray[Any]
    unit: str
    meaning: str
    words: dict[int, str]
    quality: NDArray[Any] | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.values.shape[1:])


Parts = Sequence[tuple[str, Sequence[int]]]     # the names and shapes of the parts of a field's name


class Port(Protocol):
    """Where messages of one type pass.

    name: "flight.tracking.error"; type: "AttError"; fields: name -> field, those of an array of structs with the
    dimensions of both; parts: of their names; names: of the fields, and of the nested messages that hold them
    """

    @property
    def name(self) -> str: ...

    @property
    def type(self) -> str: ...

    @property
    def fields(self) -> Mapping[str, Any]: ...

    @property
    def parts(self) -> Mapping[str, Parts]: ...

    @property
    def names(self) -> Sequence[str]: ...


P = TypeVar("P", bound=Port)


class Records(Generic[P]):
    """Messages by the names of their ports, and fields by their own.

    A message that was never written has no values: they are NaN, also those of whole numbers, which then become
    floating-point numbers. `raw` has the bytes as they were recorded.
    """

    _raw = False
    _error: type[Exception] = SetupError
    _label: str = "the log"     # begins the text of an error

    def _ports(self) -> Sequence[P]:
        raise NotImplementedError

    def _values(self, port: P) -> NDArray[Any]:
        """The messages as a structured array."""
        raise NotImplementedError

    def _time(self, port: P) -> NDArray[np.float64]:
        """[s]"""
        raise NotImplementedError

    def executives(self) -> list[P]:
        """The ports with the messages of processes' executives: ProcessMode and Activity."""
        return [port for port in self._ports() if port.type in (MODE, ACTIVITY)]

    def _find(self, key: str) -> tuple[P, str | None, tuple[int | slice, ...]]:
        """(port, name of a field or None, indices) of a key. Ports come before fields, full names before endings."""
        tokens = re.findall(r"[^.\[\]]+(?:\[[\d, ]+\])*", key.replace("/", ".").strip("."))
        given = [tuple(int(i) for i in re.findall(r"\d+", token.partition("[")[2])) for token in tokens]
        dotted = ".".join(token.partition("[")[0] for token in tokens)
        tail, ports = "." + dotted, self._ports()
        for exact in (True, False):
            def fits(full: str) -> bool:
                return full == dotted if exact else full.endswith(tail) and not key.startswith("/")

            # Every message has a head: a key means a field of the head only if it names the head.
            matches: list[tuple[P, str | None]] = [(p, None) for p in ports if fits(p.name)] or [
                (p, n) for p in ports for n in p.names if fits(f"{p.name}.{n}")
                and (exact or not n.startswith(HEAD) or f".{HEAD}" in tail)]
            if len(matches) == 1:
                return *matches[0], self._index(key, *matches[0], given)
            if matches:
                raise self._error(f"{self._label}: '{key}' is ambiguous: it may be "
                                  + listed([full_name(p, n) for p, n in matches], most=12) + "; write more of the name")
        owner, _, last = dotted.rpartition(".")
        if owners := [(p, n) for p in ports for n in (None, *p.names) if owner and n not in p.fields
                      and f".{full_name(p, n)}".endswith(f".{owner}")]:
            known = {full_name(p, n): [field[len(n) + 1 if n else 0:] for field in p.fields
                                       if not field.startswith(HEAD) and field.startswith(f"{n}." if n else "")]
                     for p, n in owners}
            near = list(filter(None, [nearest(last, [field for fields in known.values() for field in fields])]))
            raise self._error(f"{self._label}: there is no '{key}'"
                              + (f"; did you mean {owner}.{near[0]}? " if near else "; ")
                              + "; ".join(f"{name} has {listed(fields, most=12)}" for name, fields in known.items()))
        last = last.lower()
        everything = [full_name(p, n) for p in ports for n in (None, *p.names)]
        near = [full for full in everything if last and last in full.rpartition(".")[2].lower()]
        if not near:  # misspelt: the nearest of all names' endings
            parts = [full.split(".") for full in everything]
            near = list(filter(None, [nearest(dotted, [".".join(p[i:]) for p in parts for i in range(len(p))])]))
        raise self._error(f"{self._label}: there is no '{key}'; "
                          + (f"did you mean {listed(near, most=12)}?" if near else
                             f"there are {listed([p.name for p in ports], most=12)}"))

    def _index(self, key: str, port: P, name: str | None,
               given: list[tuple[int, ...]]) -> tuple[int | slice, ...]:
        """The index into a sample, from the indices of each part of a key: () without any; slices where only an inner
        part is indexed, as in "parts.steps[2]"."""
        parts = self._parts(port, name)
        missing = len(parts) - len(given)
        at = [()] * missing + given if missing > 0 else given[-len(parts):] if parts else []
        index: list[int | slice] = []
        for (_, shape), own in zip(parts, at):
            if len(own) > len(shape) or any(i >= n for i, n in zip(own, shape)):
                break
            index += [*own, *[slice(None)] * (len(shape) - len(own))]
        else:
            if not any(given[:max(-missing, 0)]):
                return tuple(index) if any(at) else ()
        raise self._error(f"{self._label}: '{key}' is out of range: {full_name(port, name)} has the shape "
                          f"{tuple(n for _, shape in parts for n in shape)}")

    def _parts(self, port: P, name: str | None) -> Parts:
        """((name, shape), ...) of the parts of a field's name, or of a nested message's."""
        if not name:
            return ()
        parts = next(parts for field, parts in port.parts.items() if f"{field}.".startswith(f"{name}."))
        return parts[:name.count(".") + 1]

    def __getitem__(self, key: str) -> NDArray[Any]:
        """The values of a field as an (n, ...) array, of an element as (n,), of a message as structured (n,).

        The arrays are read-only. NaN where the message was never written; a whole message has its bytes, and its head
        has the quality.
        """
        port, name, indices = self._find(key)
        return self._field(port, name)[(slice(None), *indices)]

    @property
    def raw(self) -> Self:
        """The same records with the bytes of messages that were never written, which are zeros."""
        records = copy(self)
        records._raw = True
        return records

    def _quality(self, port: P) -> NDArray[Any] | None:
        """(n,) the quality of each message; None if they have no head."""
        values = self._values(port)
        head = values.dtype["head"] if "head" in (values.dtype.names or ()) else None
        return values["head"]["quality"] if head is not None and "quality" in (head.names or ()) else None

    def _missing(self, port: P) -> Sequence[int] | NDArray[Any]:
        """The indices of the messages that were never written."""
        quality = self._quality(port)
        return [] if self._raw or quality is None else (quality == NONE).nonzero()[0]

    def _field(self, port: P, name: str | None) -> NDArray[Any]:
        """The values of a field; NaN where its message was never written. Heads and whole messages have their bytes."""
        values = part(self._values(port), name)
        missing = self._missing(port)
        if len(missing) and values.dtype.kind in "fiub" and not f"{name}.".startswith(HEAD):
            values = values.astype(values.dtype if values.dtype.kind == "f" else float)
            values[missing] = math.nan
            values.setflags(write=False)
        return decoded(values) if values.dtype.kind == "S" else values

    def _ipython_key_completions_(self) -> list[str]:
        """The completions of IPython behind [": each port and field by its full name, and by its short unique one."""
        full = [full_name(p, n) for p in self._ports() for n in (None, *p.names)
                if not (n or "").startswith(HEAD.rstrip("."))]
        short = [".".join(name.split(".")[2:]) or name for name in full]
        seen = Counter(short)
        return [*(name for name in short if seen[name] == 1), *full]

    def _table(self, title: str) -> str:
        """The ports and their fields, for a notebook."""
        groups = []
        for port in self._ports():
            rows = [(name, "x".join(map(str, field.shape)), unit_text(field.unit), _meaning(field))
                    for name, field in port.fields.items() if not name.startswith(HEAD)]
            groups.append((f"{port.name}, {len(self._time(port))} samples", rows))
        return table(title, groups, ("", "shape", "unit", "meaning"))

    def field(self, key: str) -> Any:
        """The declaration of a field: its unit, shape and meaning."""
        port, name, _ = self._find(key)
        if name is None or name not in port.fields:
            raise SetupError(f"'{key}' is a whole message; name one of its fields: "
                             + listed([n for n in port.fields if not n.startswith(HEAD)
                                       and (not name or n.startswith(f"{name}."))]))
        return port.fields[name]

    def series(self, key: str) -> Series:
        """The Series of a field or element, for plots."""
        field = self.field(key)
        port, name, index = self._find(key)
        shown, rest = [], list(index)
        for part, shape in self._parts(port, name):
            inside = [i for i in rest[:len(shape)] if isinstance(i, int)]
            shown.append(part + "".join(f"[{i}]" for i in inside))
            del rest[:len(shape)]
        outer = [i for i, part in enumerate(shown[:-1]) if "[" in part]
        short = ".".join(shown[min(outer, default=-1):])
        words, values = words_of(field), self[key]
        if values.dtype.kind == "U":
            raise SetupError(f"'{key}' is a text, and plots show numbers" + (
                f": plot {key.removesuffix('name')}index, whose axis has the names" if port.type == MODE else ""))
        if port.type == MODE and name == "index":
            table = self._values(port)
            words = {int(i): text.decode() for i, text in zip(table["index"], table["name"])}
        return Series(key, short, port.name, self._time(port), values, field.unit,
                      _meaning(field), words, self._quality(port))

    def _short_name(self, port: P) -> str:
        """The shortest ending of a port's name that is unique here: "error"."""
        parts = port.name.split(".")
        tails = (".".join(parts[-n:]) for n in range(1, len(parts)))
        names = ["." + other.name for other in self._ports()]
        return next((tail for tail in tails if sum(name.endswith("." + tail) for name in names) == 1), port.name)


def stale_after(period: float) -> float:
    """[s] The age at which a message that is written each `period` [s] becomes stale: ten updates, as for flight itself
    (data_lost() of flight/msg/head.h), and 5 s at least, since telemetry comes later."""
    return max(STALE_S, STALE_UPDATES * period)


def full_name(port: Port, name: str | None) -> str:
    """ "flight.tracking.error.sigma_BR", or the port's name"""
    return f"{port.name}.{name}" if name else port.name


def nested_names(fields: Iterable[str]) -> list[str]:
    """The names of fields, and of the nested messages that hold them."""
    parts = [name.split(".") for name in fields]
    return list(dict.fromkeys(".".join(p[:i]) for p in parts for i in range(1, len(p) + 1)))


def element_names(parts: Parts) -> list[str]:
    """The names of a field's elements in memory order: "sigma_BR[0]", "wheels[2].axis_B[0]"."""
    names = [""]
    for part_name, shape in parts:
        elements = [""]
        for n in shape:
            elements = [f"{e}[{i}]" for e in elements for i in range(n)]
        dot = "." if names != [""] else ""
        names = [f"{prefix}{dot}{part_name}{e}" for prefix in names for e in elements]
    return names


def _meaning(field: Any) -> str:
    """The meaning of a field of a header or of an archive."""
    return field.meaning if hasattr(field, "meaning") else field.doc


def decoded(values: NDArray[np.bytes_]) -> NDArray[np.str_]:
    """The texts of an array of char arrays."""
    import numpy as np

    return np.char.decode(values, "utf-8", "replace")


def part(values: NDArray[Any], name: str | None) -> NDArray[Any]:
    """A field of a structured array by its name with dots; None: the whole."""
    for word in name.split(".") if name else ():
        values = values[word]
    return values


def head_columns(fields: Iterable[str]) -> dict[str, str]:
    """Column of tables -> field of the head, of a message with these fields: {"valid_at": "head.t", ...}."""
    known = set(fields)
    return {f"{HEAD}{name}" if name in known else name: field for name, field in HEAD_COLUMNS.items() if field in known}


def words_of(field: Any) -> dict[int, str]:
    """Value -> name of an enumeration, as 3 -> "good"; {} of other fields."""
    named = dict(getattr(field, "values", None) or getattr(field, "enumerators", None) or {})
    return {named[name]: short.lower().replace("_", " ") for name, short in short_names(named).items()}


def in_words(values: NDArray[Any], field: Any) -> list[str]:
    """The values of an enumeration by their names; a number without a name stays a number."""
    words = words_of(field)
    return [words.get(value, str(value)) for value in values.tolist()]


def head_column(values: NDArray[Any], field: Any, source: str) -> tuple[NDArray[Any] | pd.Categorical, str]:
    """(the values for a DataFrame, their unit) of a column for the head: seconds, or ordered categories."""
    if source == "head.t":
        return values / 1e9, "s"
    import pandas as pd

    words = in_words(values, field)
    return pd.Categorical(words, categories=list(dict.fromkeys([*words_of(field).values(), *words])), ordered=True), ""


def with_quaternions(columns: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of a table, and behind those of each attitude, "error.sigma_BR[0]" to "[2]", those of its quaternion,
    scalar first, "error.beta_BR[0]" to "[3]"."""
    import numpy as np

    from fledge.attitude import mrp_to_quaternion

    found = {}
    for column, values in columns.items():
        found[column] = values
        if match := re.fullmatch(r"(.*\b)sigma_([A-Z]\w*)\[2\]", column):
            sigma = np.stack([columns[f"{column[:-2]}{i}]"] for i in range(3)], axis=-1)
            for i, beta in enumerate(np.moveaxis(mrp_to_quaternion(sigma), -1, 0)):
                found[f"{match[1]}beta_{match[2]}[{i}]"] = beta
    return found


def frame_of(tables: Iterable[tuple[NDArray[np.int64], dict[str, Any]]], units: dict[str, str],
             meanings: dict[str, str], quaternions: bool) -> pd.DataFrame:
    """A pandas DataFrame by time [s] of tables, each (times [ns], column -> values). NaN where one has no value."""
    import numpy as np
    import pandas as pd

    if quaternions:
        tables = [(times, with_quaternions(columns)) for times, columns in tables]
        for column in (name for _, columns in tables for name in columns if name not in units):
            units[column], meanings[column] = "-", "quaternion, scalar first"
    frames = [pd.DataFrame(columns, index=times) for times, columns in tables]
    if len(frames) == 1:
        frame = frames[0]
    elif all(f.index.is_unique for f in frames):
        frame = pd.concat(frames, axis=1, sort=True) if frames else pd.DataFrame()
    else:
        # Several messages of a topic have the same time: its k-th is in a row with the k-th of other topics.
        for f in frames:
            nth = f.groupby(level=0).cumcount() if len(f) else np.empty(0, int)
            f.index = pd.MultiIndex.from_arrays([f.index, nth])
        frame = pd.concat(frames, axis=1).sort_index().droplevel(1)
    frame.index = pd.Index(np.asarray(frame.index, dtype=float) / 1e9, name="time [s]")
    frame.attrs = {"units": units, "meanings": meanings}
    return frame
