# SPDX-License-Identifier: Apache-2.0
"""Read a run's archive: the MCAP file that every target writes.

    a = Archive("nadir_spin.mcap")
    a.topics                          # topic -> Channel, with its fields, units and count
    a["error.sigma_BR"]               # an (n, 3) array; a["/flight/tracking/error"] has all fields
    a.time("error")                   # [s]
    a.parameters["flight.control.K"]  # as the run began
    a.frame("error")                  # a pandas DataFrame by time, columns "error.sigma_BR[0]", ...
    a.to_csv("run/"), a.to_hdf5("run.h5"), a.to_mat("run.mat")

A truncated or damaged file opens too: `complete` is False, `problem` names the fault, its byte, and the
time until which the data are good, and the messages before the damage are readable. Chunks, the data section
and the summary carry checksums. In an unchunked file only the last checksum covers the messages: a reader then
detects damaged values only if the file has its end, and cannot tell which.

numpy is loaded when data are read, pandas by `frame`, h5py by `to_hdf5`, scipy by `to_mat`.
"""

from __future__ import annotations

import csv
import itertools
import json
import mmap
import os
import re
import struct as packing
from collections.abc import Callable, Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from fledge.archive import mcap
from fledge.errors import cell, listed, printable
from fledge.disk import Part
from fledge.archive.rosmsg import Field
from fledge.records.series import (
    HEAD, Parts, Records, frame_of, head_column, head_columns, in_words, nested_names, part, with_quaternions, words_of)

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from fledge.archive import rosmsg

__all__ = ["Archive", "ArchiveError", "Channel", "Field"]

# Of MATLAB.
_KEYWORDS = frozenset("break case catch classdef continue else elseif end for function global if otherwise parfor "
                      "persistent return spmd switch try while".split())
NAME_MOST = 200     # bytes of the name of a file, of 255 that disks take
_SPARE = re.compile(r"(.*\.)?spare\w*")  # members that stand in for padding


class ArchiveError(Exception):
    """A file that is no archive, a name that is not in it, or data that cannot be decoded."""


class Channel:
    """A topic: its message type, its fields, and the number of messages.

    topic: "/flight/tracking/error"; name: the same with dots, "flight.tracking.error", and with `_2` where another
        topic has that name already
    schema: the message type, "fledge/msg/AttError"; type: its own name, "AttError"; schema_text: its definition
    metadata: of the topic, by the writer, text to text
    count: number of messages
    problem: why its messages cannot be decoded, as those without a fixed size; None if they can
    """

    def __init__(self, raw: mcap.RawChannel, path: Path) -> None:
        self._raw = raw
        self._path = path
        self.topic = raw.topic
        self.name = raw.topic.strip("/").replace("/", ".") or "topic"
        self.schema = raw.schema_name
        self.type = raw.schema_name.rpartition("/")[2]
        self.schema_text = raw.schema_text
        self.metadata = raw.metadata
        self.count = len(raw.offsets)
        self.problem = raw.why_not

    @property
    def fields(self) -> dict[str, Field]:
        """True name -> Field (unit, shape, meaning, ...), in memory order; nested ones with dots.

        Raises ArchiveError if the definition cannot be decoded.
        """
        return {f.name: f for f in self._struct().fields()}

    def _struct(self) -> rosmsg.Struct:
        if self.problem is not None or self._raw.struct is None:
            raise ArchiveError(f"{self._path}: {self.topic} ({self.schema}) cannot be decoded: {self.problem}")
        return self._raw.struct

    @property
    def offsets(self) -> Sequence[int]:
        """[bytes] where the messages' records begin in the file, in its order."""
        return self._raw.offsets

    @property
    def names(self) -> list[str]:
        """The names of the fields, and of the nested messages that hold them."""
        return nested_names(f.name for f in self._raw.struct.fields()) if self._raw.struct else []

    @property
    def parts(self) -> dict[str, Parts]:
        """The names and shapes of the parts of each field's name. Raises ArchiveError as `fields` does."""
        return {f.name: f.parts for f in self._struct().fields()}

    def __repr__(self) -> str:
        return f"<Channel {self.topic}: {self.count} x {self.schema}>"


class Archive(Records[Channel]):
    """A run, read from the file at `path`. Raises ArchiveError if it is no MCAP file at all.

    archive["tracking.error.sigma_BR"]: a field, read-only (n, ...) in its unit; of a topic, a structured array (n,).
    Raises ArchiveError on unknown names, and for messages that cannot be decoded, as the methods do.

    topics: topic -> Channel, in the order of their declaration
    metadata: name -> {key: value}, all text; records of one name are merged: "run" has the mission, scenario, seed and
        version, "parameters" and "revisions" what the run began with, "end" its outcome
    complete: whether the file is whole, all its checksums are right, and it has the run from its begin
    problem: None, or a sentence with the fault, its byte and the data that are good, or with what is missing
    good_until: [s] all messages before this time are right, and none is missing behind the first; None if unknown, or
        if there are none
    """

    _error = ArchiveError

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._label = str(path)
        self._data = _map(self.path)
        try:
            scan = mcap.Scan(self._data)
        except mcap.Unsupported as error:
            self._data.close()
            raise ArchiveError(f"{self.path}: cannot be read: {error}") from None
        self.metadata = scan.metadata
        self.complete = scan.problem is None
        self.good_until = None if scan.t_good is None else scan.t_good / 1e9
        self.problem = None
        if scan.problem is not None:
            worth = "no time up to which the data are good can be given" if scan.t_good is None \
                else f"the data are good before t = {self.good_until!r} s"
            self.problem = (f"{self.path}: damaged or cut off at byte {scan.problem_at} of "
                            f"{scan.size}: {scan.problem}; {worth}")
        if missing := missing_of(self.metadata):
            self.complete = False
            self.problem = f"{self.problem or self.path}: {missing}"
        self.topics: dict[str, Channel] = {}
        for id, raw in scan.channels.items():
            # Two channels may share a topic in files of other writers.
            raw.topic += f"#{id}" if raw.topic in self.topics else ""
            self.topics[raw.topic] = Channel(raw, self.path)
        taken: set[str] = set()
        for channel in self.topics.values():
            channel.name = unique(channel.name, taken)
        self._decoded: dict[str, NDArray[Any]] = {}

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters with which the run began: "flight.control.K" -> a number, a list or a text, in SI.

        `metadata["parameters"]` has them as texts with units. {} if the file has none. Raises ArchiveError if they are
        damaged.
        """
        decode = json.JSONDecoder().raw_decode
        parameters = {}
        for name, text in self.metadata.get("parameters", {}).items():
            try:
                parameters[name] = decode(text)[0]
            except (ValueError, RecursionError):
                damage = f"; {self.problem}" if self.problem else ""
                raise ArchiveError(f"{self.path}: the metadata of the parameter {printable(name)} are damaged: found "
                                   f"{printable(text[:60])!r}{damage}") from None
        return parameters

    def close(self) -> None:
        """Close the file. Arrays and frames that were read stay valid."""
        self._data.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        run = self.metadata.get("run", {})
        about = ", ".join(run[key] for key in ("mission", "scenario") if key in run)
        return self._table(f"{self.path}{f', {about}' if about else ''}{'' if self.complete else ', incomplete'}")

    def __repr__(self) -> str:
        lines = [f"<Archive {self.path}{'' if self.complete else ', incomplete'}>"]
        lines += [f"  {c.topic}  {c.count} x {c.schema}" for c in self.topics.values()]
        return "\n".join(lines)

    # ---- names ----

    def _ports(self) -> list[Channel]:
        return list(self.topics.values())

    def _time(self, port: Channel) -> NDArray[np.float64]:
        return self.time(port.topic)

    def _find(self, key: str) -> tuple[Channel, str | None, tuple[int | slice, ...]]:
        return (self.topics[key], None, ()) if key in self.topics else super()._find(key)

    def _channel(self, key: str) -> Channel:
        return self._find(key)[0]

    def _select(self, topics: str | Iterable[str] | None,
                head: bool) -> list[tuple[Channel, list[Field], dict[str, str]]]:
        """Patterns or names of topics or fields -> [(Channel, [Field], columns for the head)], in the archive's order.

        head: whether whole messages have columns for their heads.
        """
        keys = [topics] if isinstance(topics, str) else topics
        wanted: dict[Channel, set[str]] = {}
        whole = set()
        hits: list[tuple[Channel, str | None]]
        for key in ["*"] if keys is None else keys:
            if any(mark in key for mark in "*?"):
                hits = [(c, None) for c in self.topics.values()
                        if fnmatchcase(c.topic, key) or fnmatchcase(c.name, key)]
                if not hits and keys is not None:
                    raise ArchiveError(f"{self.path}: no topic matches '{key}'; there are "
                                       + listed(list(self.topics), most=12))
            else:
                hits = [self._find(key)[:2]]
            for channel, name in hits:
                if name is None:
                    names = [f for f in channel.fields if not _SPARE.fullmatch(f) and not f.startswith(HEAD)]
                    whole.add(channel)
                else:
                    names = [f for f in channel.fields if f"{f}.".startswith(f"{name}.")]
                wanted.setdefault(channel, set()).update(names)
        return [(c, [f for f in c.fields.values() if f.name in wanted[c]],
                 head_columns(c.fields) if head and c in whole else {}) for c in self.topics.values() if c in wanted]

    def short_name(self, topic: str) -> str:
        """The shortest ending of a topic's name that no other topic has: "error". Raises ArchiveError on an unknown
        one."""
        return self._short_name(self._channel(topic))

    # ---- data ----

    def time_ns(self, topic: str) -> NDArray[np.int64]:
        """The simulated times of a topic's (or field's) messages: (n,) int64 [ns]. Raises ArchiveError on an unknown
        name, and for times beyond int64."""
        channel = self._channel(topic)
        times = self._gather(channel, mcap.TIME_AT, "<i8").astype("=i8")
        if (times < 0).any():       # MCAP's have no sign
            i = int((times < 0).argmax())
            raise ArchiveError(f"{self.path}: {channel.topic}: message {i} has the time {int(times[i]) + 2**64} ns; "
                               f"times up to {2**63 - 1} ns are read")
        return times

    def contents(self, topic: str) -> Iterator[bytes]:
        """The messages of a topic, of any schema, as CDR behind its 4 bytes that state the order. Raises
        ArchiveError on an unknown one."""
        for at in self._channel(topic).offsets:
            length, = packing.unpack_from("<Q", self._data, at + 1)
            yield self._data[at + mcap.PAYLOAD_AT:at + mcap.CONTENT_AT + length]

    def messages(self, topic: str, first: int = 0) -> Iterator[np.void]:
        """The messages of a topic from a number on, one after another: a["/topic"][first:], of which only one is in
        memory. Raises ArchiveError on an unknown topic, and if the definition cannot be decoded."""
        import numpy as np
        channel = self._channel(topic)
        struct = channel._struct()
        for at in channel.offsets[first:]:
            little = self._data[at + mcap.CDR_AT + 1] == 1
            yield np.frombuffer(self._data[at + mcap.PAYLOAD_AT:at + mcap.PAYLOAD_AT + struct.size],
                                struct.dtype("<" if little else ">"))[0]

    def time(self, topic: str) -> NDArray[np.float64]:
        """The simulated times of a topic's (or field's) messages: (n,) float64 [s]. Raises as time_ns()."""
        return self.time_ns(topic) / 1e9

    def _gather(self, channel: Channel, at: int, dtype: Any) -> NDArray[Any]:
        """The values `at` bytes into each of the channel's Message records: (n,) of the dtype."""
        import numpy as np
        dtype = np.dtype(dtype)
        if not channel.count or not dtype.itemsize:
            return np.empty(channel.count, dtype)
        offsets = np.frombuffer(channel._raw.offsets, np.uint64)
        # Opaque items that overlap, one at every byte of the file: picking some is a memcpy each.
        items: np.ndarray = np.ndarray(len(self._data) - dtype.itemsize + 1, f"V{dtype.itemsize}", self._data,
                                       strides=(1,))
        return items[offsets + np.uint64(at)].view(dtype)

    def _values(self, channel: Channel) -> NDArray[Any]:
        import numpy as np
        if channel.topic in self._decoded:
            return self._decoded[channel.topic]
        struct = channel._struct()
        little, big = struct.dtype("<"), struct.dtype(">")
        header = self._gather(channel, mcap.CDR_AT, "V4").view("u1").reshape(-1, 4)
        is_little = header[:, 1] == 1
        strange = (header[:, 0] != 0) | (header[:, 1] > 1)
        if strange.any():
            i = int(strange.argmax())
            raise ArchiveError(f"{self.path}: {channel.topic}: message {i} at byte "
                               f"{channel._raw.offsets[i]} begins with "
                               f"{bytes(header[i]).hex(' ')}, expected plain CDR: 00 00 or 00 01")
        raw = self._gather(channel, mcap.PAYLOAD_AT, f"V{struct.size}") if struct.size else \
            np.empty(channel.count, "V0")
        if is_little.all():
            values = raw.view(little)
        else:
            values = raw.view(big).astype(little)
            values[is_little] = raw[is_little].view(little)
        values.setflags(write=False)
        self._decoded[channel.topic] = values
        return values

    def frame(self, topics: str | Iterable[str] | None = None, head: bool = True,
              quaternions: bool = False) -> pd.DataFrame:
        """A pandas DataFrame by time [s], one column per number.

        topics: names (as for []) or patterns ("/flight/*") of topics or fields, one or several;
            None: all but those of executives, which have no rate. Topics of different rates share the index, with NaN
            where a topic has no value, and where a message was never written.
        head: with two columns for the head of each whole message: "error.valid_at", the time for which it holds
            [s], and "error.quality", of the ordered categories none, stale, degraded and good
        quaternions: with four columns, "error.beta_BR[0]", scalar first, behind those of each "error.sigma_BR"
        Members named spare are left out. Columns have the shortest names that are unique, "error.sigma_BR[0]";
        `attrs["units"]` and `attrs["meanings"]` map them to text.
        Raises ArchiveError on an unknown name, and for a topic that cannot be decoded.
        """
        tables: list[tuple[NDArray[np.int64], dict[str, Any]]] = []
        units: dict[str, str] = {}
        meanings: dict[str, str] = {}
        if topics is None:
            topics = [topic.topic for topic in self.topics.values() if topic not in self.executives()]
        for channel, fields, heads in self._select(topics, head):
            short = self._short_name(channel)
            columns: dict[str, Any] = {}
            for field in fields:
                names = [f"{short}.{c}" for c in field.columns()]
                columns.update(zip(names, self._elements(channel, field)))
                units.update(dict.fromkeys(names, field.unit))
                meanings.update(dict.fromkeys(names, field.meaning))
            for name, source in heads.items():
                field = channel.fields[source]
                columns[f"{short}.{name}"], unit = head_column(part(self._values(channel), source), field, source)
                units[f"{short}.{name}"], meanings[f"{short}.{name}"] = unit, field.meaning
            tables.append((self.time_ns(channel.topic), columns))
        return frame_of(tables, units, meanings, quaternions)

    def _elements(self, channel: Channel, field: Field) -> NDArray[Any]:
        """A field's values as one (n,) array per element, in the order of Field.columns()."""
        values = self._field(channel, field.name).reshape(channel.count, len(field.columns()))
        return values.astype(values.dtype.newbyteorder("="), copy=False).T

    # ---- other formats ----

    def _columns(self, channel: Channel, fields: list[Field],
                 heads: dict[str, str]) -> Iterator[tuple[str, NDArray[Any], Field, str]]:
        """(name, values, field, unit) of fields, and of the columns for the head."""
        for field in fields:
            yield field.name, self._field(channel, field.name), field, field.unit
        for name, source in heads.items():
            values, seconds = part(self._values(channel), source), source == "head.t"
            yield name, values / 1e9 if seconds else values, channel.fields[source], "s" if seconds else ""

    def to_csv(self, path: str | os.PathLike[str], topics: str | Iterable[str] | None = None,
               head: bool = True, quaternions: bool = False) -> list[Path]:
        """Write CSV; returns the paths written.

        Rates differ, so every topic is a file of its own, `<path>/flight.tracking.error.csv`, whose name gets `_2`
        where another topic has it already; a path that ends in .csv takes exactly one topic. The first column is the
        time in seconds, exact to the nanosecond; numbers are written such that reading them gives the same bits (in
        pandas, with float_precision="round_trip");
        headings carry the units: "sigma_BR[0] [-]". Cells of a message that was never written are
        empty. topics, head, quaternions: as for `frame`; the last columns are "valid_at [s]"
        and "quality", by its names. Metadata are left out. Raises ArchiveError as `frame` does, and if a .csv would
        have several topics; OSError if it cannot be written.
        """
        path = Path(path)
        selected = self._select(topics, head)
        if path.suffix.lower() == ".csv":
            if len(selected) != 1:
                raise ArchiveError(f"{path}: a CSV file takes one topic, not {len(selected)} ("
                                   + listed([c.topic for c, *_ in selected], most=12) + "): name one, or give a folder")
            files = {path: selected[0]}
        else:
            path.mkdir(parents=True, exist_ok=True)
            files = {}
            taken: set[str] = set()
            for row in selected:    # topics that differ in other characters have one name
                name = re.sub(r"[^\w.-]", "_", row[0].name).encode()[:NAME_MOST].decode(errors="ignore")
                name = unique(name, taken, str.lower)   # as some disks see it
                files[path / f"{name}.csv"] = row
        for file, chosen in files.items():
            with Part(file) as unfinished, open(unfinished, "w", newline="", encoding="utf-8") as out:
                self._write_csv(csv.writer(out, lineterminator="\n"), *chosen, quaternions)
        return list(files)

    def _write_csv(self, writer: Any, channel: Channel, fields: list[Field], heads: dict[str, str],
                   quaternions: bool) -> None:
        headings, columns = ["time [s]"], []
        missing = self._missing(channel)
        numbers = {name: column for field in fields
                   for name, column in zip(field.columns(), self.raw._elements(channel, field))}
        units = {name: field.unit for field in fields for name in field.columns()}
        for name, column in (with_quaternions(numbers) if quaternions else numbers).items():
            unit = units.get(name, "-")
            headings.append(f"{name} [{unit}]" if unit else name)
            columns.append([*map(cell, column.tolist())] if column.dtype.kind == "U" else column.tolist())
            for i in missing:
                columns[-1][i] = ""
        for name, source in heads.items():
            values = part(self._values(channel), source)
            headings.append(f"{name} [s]" if source == "head.t" else name)
            columns.append(_exact(values) if source == "head.t" else in_words(values, channel.fields[source]))
        writer.writerow(headings)
        writer.writerows(zip(_exact(self.time_ns(channel.topic)), *columns))

    def to_hdf5(self, path: str | os.PathLike[str], topics: str | Iterable[str] | None = None,
                head: bool = True) -> Path:
        """Write HDF5: a group per topic, in it a dataset (n, ...) per field; returns the path.

        Datasets have the attributes `unit`, `meaning` and, for an enumeration, `values`; `_time`
        [s] and `_time_ns` hold the times. The run's metadata are attributes of
        `/_metadata/<name>`.
        topics, head: as for `frame`; `valid_at` [s] and `quality`, an enumeration, are datasets too. Raises
        ArchiveError as `frame` does, OSError if it cannot be written.
        """
        import h5py
        # In memory first: where a disk is full, HDF5 ends the process.
        with h5py.File(os.fspath(path), "w", driver="core", backing_store=False) as out:
            for name, pairs in self.metadata.items():
                out.require_group(f"_metadata/{printable(name)}").attrs.update(_attributes(pairs))
            for channel, fields, heads in self._select(topics, head):
                group = _group(out, channel, {*(field.name for field in fields), *heads})
                group.attrs.update(_attributes({**channel.metadata, "schema": channel.schema}))
                taken = {"_time", "_time_ns"}
                for name, unit, values in (("_time", "s", self.time(channel.topic)),
                                           ("_time_ns", "ns", self.time_ns(channel.topic))):
                    group.create_dataset(name, data=values).attrs["unit"] = unit
                for name, values, field, unit in self._columns(channel, fields, heads):
                    kind = None
                    if name in heads and unit != "s":
                        kind = h5py.enum_dtype({word: value for value, word in words_of(field).items()}, values.dtype)
                    values = values.astype("S") if values.dtype.kind == "U" else values
                    data = group.create_dataset(unique(name, taken), data=values, dtype=kind)
                    data.attrs.update(_attributes({"unit": unit, "meaning": field.meaning}))
                    if field.values and name not in heads:
                        data.attrs["values"] = ", ".join(
                            f"{k}={v}" for k, v in field.values.items())
            out.flush()
            with Part(path) as unfinished:
                unfinished.write_bytes(out.id.get_file_image())
        return Path(path)

    def to_mat(self, path: str | os.PathLike[str], topics: str | Iterable[str] | None = None,
               head: bool = True) -> Path:
        """Write a file of MATLAB, version 5, which Octave and scipy read too; returns the path.

        A struct per topic, `flight_tracking_error`: in it `time` (n, 1) [s], `time_ns`, and an array (n, ...) per
        field; its structs `units`, `meanings` and, of enumerations, `values` have texts by the same names. The run's
        metadata are the struct `metadata`. In names, each character that MATLAB does not take is `_`; one that is then
        another's gets `_2`, and one that would be too long is cut.
        topics, head: as for `to_hdf5`. Raises ArchiveError for a topic of 4 GB, which the format does not hold.
        """
        from scipy.io import savemat
        from scipy.io.matlab import MatWriteError

        taken = {"metadata"}
        content: dict[str, Any] = {"metadata": {}}
        names: set[str] = set()
        for name, pairs in self.metadata.items():
            content["metadata"][_legal(name, names)] = _struct_of(pairs)
        for channel, fields, heads in self._select(topics, head):
            names = {"units", "meanings", "values"}
            table: dict[str, Any] = {_legal("time", names): self.time(channel.topic),
                                     _legal("time_ns", names): self.time_ns(channel.topic)}
            units, meanings, values = {"time": "s", "time_ns": "ns"}, {}, {}
            for name, column, field, unit in self._columns(channel, fields, heads):
                legal = _legal(name, names)
                table[legal] = column.astype(object) if column.dtype.kind == "U" else column
                units[legal], meanings[legal] = unit, field.meaning
                if unit != "s" and (words := words_of(field)):
                    values[legal] = ", ".join(f"{word}={value}" for value, word in words.items())
            content[_legal(channel.name, taken)] = {**table, "units": units, "meanings": meanings, "values": values}
        with Part(path) as unfinished, open(unfinished, "wb") as out:
            try:
                savemat(out, content, long_field_names=True, oned_as="column")
            except (MatWriteError, OverflowError, ValueError) as error:
                raise ArchiveError(f"{path}: cannot be written: {error}; choose topics, or write HDF5") from None
        return Path(path)


def unique(name: str, taken: set[str], key: Callable[[str], str] = str) -> str:
    """The name, with `_2`, `_3` and so on if its key is among those that are taken; it is taken then."""
    name = next(other for other in itertools.chain([name], (f"{name}_{i}" for i in itertools.count(2)))
                if key(other) not in taken)
    taken.add(key(name))
    return name


def _legal(name: str, taken: set[str]) -> str:
    """A name as a variable or field of MATLAB, of up to 63 letters, digits and `_`, that no other one has."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)[:56]
    return unique(name if re.match("[A-Za-z]", name) and name not in _KEYWORDS else f"x{name}", taken)


def _group(out: Any, channel: Channel, names: set[str]) -> Any:
    """The group of a topic in a file of HDF5, for datasets of these names. Where a dataset or another topic is in the
    way, as /a with a field b is in that of /a/b, the whole name is that of the group."""
    whole = printable(channel.name, lines=False)
    nested = "/".join(part for part in whole.split(".") if part)
    for path in itertools.chain([nested] * bool(nested), [whole], (f"{whole}_{i}" for i in itertools.count(2))):
        try:
            group = out.require_group(path)
        except (TypeError, ValueError):
            continue
        if names.isdisjoint(group) and "_time" not in group:
            return group


def _attributes(pairs: dict[str, str]) -> dict[str, str]:
    """Texts that HDF5 takes as attributes."""
    return {printable(key, lines=False) or "_": printable(text) for key, text in pairs.items()}


def _struct_of(pairs: dict[str, str]) -> dict[str, str]:
    """Texts as a struct of MATLAB."""
    taken: set[str] = set()
    return {_legal(name, taken): text for name, text in pairs.items()}


def missing_of(metadata: dict[str, dict[str, str]]) -> str:
    """The data that a record lacks, by its metadata, in words; "" if none."""
    if "missing" not in metadata:
        return ""
    about = metadata["missing"]
    until = about.get("until", "").removesuffix(" ns")
    time = f"{int(until) / 1e9:g} s" if until.isdecimal() and len(until) < 20 else "an unknown time"
    return f"the data up to t = {time} are missing: {about.get('why', 'the reason is unknown')}"


def _exact(times: NDArray[Any]) -> list[str]:
    """Times [ns] as texts in seconds, exact to the nanosecond."""
    return [f"{'-' * (t < 0)}{abs(t) // 10**9}.{abs(t) % 10**9:09d}" for t in times.tolist()]


def _map(path: Path) -> mmap.mmap:
    """The file's bytes, mapped into memory, if it begins as an MCAP file does."""
    try:
        with open(path, "rb") as file:
            begin = file.read(len(mcap.MAGIC))
            if begin != mcap.MAGIC:
                content = f"{begin.hex(' ')} ({begin!r})" if begin else "an empty file"
                raise ArchiveError(f"{path}: not an MCAP file: expected it to begin with "
                                   f"{mcap.MAGIC.hex(' ')}, found {content}")
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be opened: {error.strerror}") from None
