# SPDX-License-Identifier: Apache-2.0
"""Read a run's archive: the MCAP file that every target writes.

    a = Archive("nadir_spin.mcap")
    a.topics                          # topic -> Channel, with its fields, units and count
    a["error.sigma_BR"]               # an (n, 3) array; a["/flight/tracking/error"] has all fields
    a.time("error")                   # [s]
    a.frame("error")                  # a pandas DataFrame by time, columns "error.sigma_BR[0]", ...
    a.to_csv("run/"), a.to_hdf5("run.h5")

A truncated or damaged file opens too: `complete` is False, `problem` says what is wrong, where, and
until when the data are good, and what stands before the damage can be read. Chunks, the data
section and the summary carry checksums; in an unchunked file only the closing one covers the
messages, so damage to their values cannot be placed, and shows only if the file has its end.

numpy is loaded when data are read, pandas by `frame`, h5py by `to_hdf5`.
"""

from __future__ import annotations

import csv
import mmap
import os
import re
from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from fledge.archive import mcap
from fledge.errors import SetupError, listed, nearest
from fledge.files import Part
from fledge.series import Series
from fledge.archive.rosmsg import Field

__all__ = ["Archive", "ArchiveError", "Channel", "Field"]

_HEAD = "head"  # the member that every message begins with: time, quality, sequence
_SPARE = re.compile(r"(.*\.)?spare\w*")  # members that stand in for padding


class ArchiveError(Exception):
    """A file that is no archive, a name that is not in it, or data that cannot be decoded."""


class Channel:
    """A topic: its message type, its fields, and how many messages there are.

    topic: "/flight/tracking/error"; name: the same with dots, "flight.tracking.error"
    schema: the message type, "fledge/msg/AttError"; schema_text: its definition
    metadata: what the writer noted about the topic, text to text
    count: number of messages
    """

    def __init__(self, raw, path):
        self._raw = raw
        self._path = path
        self.topic = raw.topic
        self.name = raw.topic.strip("/").replace("/", ".")
        self.schema = raw.schema_name
        self.schema_text = raw.schema_text
        self.metadata = raw.metadata
        self.count = len(raw.offsets)

    @property
    def fields(self) -> dict[str, Field]:
        """True name -> Field (unit, shape, meaning, ...), in memory order; nested ones with dots.

        ArchiveError where the definition cannot be decoded.
        """
        return {f.name: f for f in self._struct().fields()}

    def _struct(self):
        if self._raw.struct is None:
            raise ArchiveError(f"{self._path}: {self.topic} ({self.schema}) cannot be decoded: "
                               f"{self._raw.why_not}")
        return self._raw.struct

    def _names(self):
        """Every name in a message: fields, and the nested messages that hold them."""
        if self._raw.struct is None:
            return []
        names = {}
        for f in self._raw.struct.fields():
            parts = f.name.split(".")
            names.update((".".join(parts[:i]), None) for i in range(1, len(parts) + 1))
        return list(names)

    def __repr__(self):
        return f"<Channel {self.topic}: {self.count} x {self.schema}>"


class Archive:
    """A run, read from the file at `path`. Raises ArchiveError if it is no MCAP file at all.

    topics: topic -> Channel, in the order of their declaration
    metadata: name -> {key: value}, all text; records of one name are merged
    complete: whether the file is whole and all its checksums are right
    problem: None, or a sentence that says what is wrong, where and what the data are worth
    good_until: [s] all messages before this time are there and right; None where that cannot be
        told, or where there are none
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
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
        self.topics: dict[str, Channel] = {}
        for id, raw in scan.channels.items():
            # Two channels may share a topic in files of other writers.
            topic = raw.topic if raw.topic not in self.topics else f"{raw.topic}#{id}"
            raw.topic = topic
            self.topics[topic] = Channel(raw, self.path)
        self._decoded: dict[str, Any] = {}

    def close(self) -> None:
        """Let go of the file. Arrays and frames that were read stay valid."""
        self._data.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        lines = [f"<Archive {self.path}{'' if self.complete else ', incomplete'}>"]
        lines += [f"  {c.topic}  {c.count} x {c.schema}" for c in self.topics.values()]
        return "\n".join(lines)

    # ---- names ----

    def _find(self, key):
        """A key -> (Channel, name of a field or None). Topics come before fields."""
        dotted = key.replace("/", ".").strip(".")
        if key in self.topics:
            return self.topics[key], None
        tail = "." + dotted
        channels = list(self.topics.values())
        for exact in (True, False):
            def fits(full):
                return full == dotted if exact else full.endswith(tail) and not key.startswith("/")

            found = [(c, None) for c in channels if fits(c.name)]
            if not found:
                # Every message has a head: it is meant only when it is named.
                found = [(c, n) for c in channels for n in c._names()
                         if fits(f"{c.name}.{n}")
                         and (exact or not n.startswith(_HEAD + ".") or f".{_HEAD}." in tail)]
            if len(found) == 1:
                return found[0]
            if found:
                raise ArchiveError(f'{self.path}: "{key}" is ambiguous: it may be '
                                   + _listing([_full(c, n) for c, n in found]))
        last = re.sub(r"\[\d+\]", "", dotted).rpartition(".")[2].lower()
        near = [full for c in channels for full in [c.name] + [_full(c, n) for n in c._names()]
                if last and last in full.rpartition(".")[2].lower()]
        if not near:  # misspelt: the nearest of all names' endings
            full = [_full(c, n).split(".") for c in channels for n in c._names()]
            near = [one for one in [nearest(dotted, [".".join(f[i:]) for f in full for i in range(len(f))])] if one]
        raise ArchiveError(f'{self.path}: there is no "{key}"; '
                           + (f"did you mean {_listing(near)}?" if near else
                              f"the topics are {_listing(list(self.topics))}"))

    def _channel(self, key):
        return self._find(key)[0]

    def _select(self, topics, head):
        """Patterns or names of topics or fields -> {Channel: [Field]}, in the archive's order."""
        keys = [topics] if isinstance(topics, str) else topics
        wanted = {}
        for key in ["*"] if keys is None else keys:
            if any(mark in key for mark in "*?"):
                hits = [c for c in self.topics.values()
                        if fnmatchcase(c.topic, key) or fnmatchcase(c.name, key)]
                if not hits and keys is not None:
                    raise ArchiveError(f'{self.path}: no topic matches "{key}"; the topics are '
                                       + _listing(list(self.topics)))
                hits = [(c, None) for c in hits]
            else:
                hits = [self._find(key)]
            for channel, name in hits:
                if name is None:
                    names = [f for f in channel.fields if not _SPARE.fullmatch(f)
                             and (head or not f.startswith(_HEAD + "."))]
                else:
                    names = [f for f in channel.fields if f"{f}.".startswith(f"{name}.")]
                wanted.setdefault(channel, set()).update(names)
        return {c: [f for f in c.fields.values() if f.name in wanted[c]]
                for c in self.topics.values() if c in wanted}

    def short_name(self, topic: str) -> str:
        """The shortest ending of a topic's name that no other topic has: "error"."""
        channel = self._channel(topic)
        others = ["." + c.name for c in self.topics.values() if c is not channel]
        parts = channel.name.split(".")
        for n in range(1, len(parts)):
            tail = ".".join(parts[-n:])
            if not any(o.endswith("." + tail) for o in others):
                return tail
        return channel.name

    def series(self, key: str) -> Series:
        """The Series of a field or element, for plots."""
        channel, name = self._find(re.sub(r"\[\d+\]", "", key))
        if name is None or name not in channel.fields:
            raise SetupError(f"'{key}' is a whole message; name one of its fields: "
                             + ", ".join(n for n in channel.fields if not n.startswith(_HEAD + ".")))
        field = channel.fields[name]
        name = name.rpartition(".")[2] + "".join(re.findall(r"\[\d+\]", key))
        return Series(key, name, channel.name, self.time(key), self[key], field.unit, field.meaning)

    # ---- data ----

    def __getitem__(self, key: str) -> Any:
        """All values of a topic or a field, by a name from the end on as long as it is unique.

        A topic gives an (n,) structured array whose fields have their true names and shapes; a
        field an (n, ...) array; an element, "error.sigma_BR[0]", an (n,) array. All are read-only.
        ArchiveError lists the candidates where the name is unknown or ambiguous.
        """
        indices = tuple(int(i) for i in re.findall(r"\[(\d+)\]", key))
        channel, name = self._find(re.sub(r"\[\d+\]", "", key))
        values = self._values(channel)
        for part in name.split(".") if name else ():
            values = values[part]
        if indices:
            if len(indices) >= values.ndim or any(
                    i >= n for i, n in zip(indices, values.shape[1:])):
                raise ArchiveError(f'{self.path}: "{key}" is out of range: {_full(channel, name)} '
                                   f"has the shape {values.shape[1:]}")
            values = values[(slice(None),) + indices]
        return values

    def time_ns(self, topic: str) -> Any:
        """The simulated times of a topic's (or field's) messages: (n,) int64 [ns]."""
        return self._gather(self._channel(topic), mcap.TIME_AT, "<i8").astype("=i8")

    def time(self, topic: str) -> Any:
        """The simulated times of a topic's (or field's) messages: (n,) float64 [s]."""
        return self.time_ns(topic) / 1e9

    def _gather(self, channel, at, dtype):
        """What stands `at` bytes into each of the channel's Message records: (n,) of the dtype."""
        import numpy as np
        offsets = np.frombuffer(channel._raw.offsets, np.uint64) if channel.count else \
            np.empty(0, np.uint64)
        dtype = np.dtype(dtype)
        if not channel.count or not dtype.itemsize:
            return np.empty(channel.count, dtype)
        # Opaque items that overlap, one at every byte of the file: picking some is a memcpy each.
        items = np.ndarray(len(self._data) - dtype.itemsize + 1, f"V{dtype.itemsize}", self._data,
                           strides=(1,))
        return items[offsets + np.uint64(at)].view(dtype)

    def _values(self, channel):
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

    def frame(self, topics: str | Iterable[str] | None = None, head: bool = False) -> Any:
        """A pandas DataFrame by time [s], one column per number.

        topics: names (as for []) or patterns ("/flight/*") of topics or fields, one or several;
            None: all. Topics of different rates share the index, with NaN where one has no value.
        head: with the columns of the messages' heads, "error.head.quality" and so on; members
            named spare are left out
        Columns have the shortest names that are unique, "error.sigma_BR[0]"; `attrs["units"]` and
        `attrs["meanings"]` map them to text.
        """
        import numpy as np
        import pandas as pd
        frames, units, meanings = [], {}, {}
        for channel, fields in self._select(topics, head).items():
            short = self.short_name(channel.topic)
            columns: dict[str, Any] = {}
            for field in fields:
                names = [f"{short}.{c}" for c in field.columns()]
                columns.update(zip(names, self._elements(channel, field)))
                units.update(dict.fromkeys(names, field.unit))
                meanings.update(dict.fromkeys(names, field.meaning))
            frames.append(pd.DataFrame(columns, index=self.time_ns(channel.topic)))
        if len(frames) == 1:
            frame = frames[0]
        elif all(f.index.is_unique for f in frames):
            frame = pd.concat(frames, axis=1, sort=True) if frames else pd.DataFrame()
        else:
            # Several messages of a topic at one instant: the k-th of one stands beside the k-th of
            # the others.
            for f in frames:
                nth = f.groupby(level=0).cumcount() if len(f) else np.empty(0, int)
                f.index = pd.MultiIndex.from_arrays([f.index, nth])
            frame = pd.concat(frames, axis=1).sort_index().droplevel(1)
        frame.index = pd.Index(np.asarray(frame.index, dtype=float) / 1e9, name="time [s]")
        frame.attrs = {"units": units, "meanings": meanings}
        return frame

    def _elements(self, channel, field):
        """A field's values as one (n,) array per element, in the order of Field.columns()."""
        values = self._values(channel)
        for part in field.name.split("."):
            values = values[part]
        values = values.reshape(channel.count, -1) if channel.count else \
            values.reshape(0, len(field.columns()))
        return values.astype(values.dtype.newbyteorder("="), copy=False).T

    # ---- other formats ----

    def to_csv(self, path: str | os.PathLike[str], topics: str | Iterable[str] | None = None,
               head: bool = False) -> list[Path]:
        """Write CSV; returns the paths written.

        Rates differ, so every topic is a file of its own, `<path>/flight.tracking.error.csv`; a
        path that ends in .csv takes exactly one topic. The first column is the time in seconds,
        exact to the nanosecond; numbers are written such that reading them gives the same bits (in
        pandas, with float_precision="round_trip");
        headings carry the units: "sigma_BR[0] [-]". topics, head: as for `frame`. Metadata are
        left out.
        """
        path = Path(path)
        selected = self._select(topics, head)
        if path.suffix.lower() == ".csv":
            if len(selected) != 1:
                raise ArchiveError(f"{path}: a CSV file takes one topic, not {len(selected)} ("
                                   + _listing([c.topic for c in selected])
                                   + "): name one, or give a folder")
            files = {path: next(iter(selected.items()))}
        else:
            path.mkdir(parents=True, exist_ok=True)
            files = {path / (re.sub(r"[^\w.-]", "_", c.name) + ".csv"): (c, fields)
                     for c, fields in selected.items()}
        for file, (channel, fields) in files.items():
            with Part(file) as part, open(part, "w", newline="", encoding="utf-8") as out:
                self._write_csv(csv.writer(out, lineterminator="\n"), channel, fields)
        return list(files)

    def _write_csv(self, writer, channel, fields):
        headings, columns = ["time [s]"], []
        for field in fields:
            unit = f" [{field.unit}]" if field.unit else ""
            headings += [name + unit for name in field.columns()]
            columns += [column.tolist() for column in self._elements(channel, field)]
        times = (f"{t // 10**9}.{t % 10**9:09d}" for t in self.time_ns(channel.topic).tolist())
        writer.writerow(headings)
        writer.writerows(zip(times, *columns))

    def to_hdf5(self, path: str | os.PathLike[str], topics: str | Iterable[str] | None = None,
                head: bool = False) -> Path:
        """Write HDF5: a group per topic, in it a dataset (n, ...) per field; returns the path.

        Datasets have the attributes `unit`, `meaning` and, for an enumeration, `values`; `_time`
        [s] and `_time_ns` hold the times. The run's metadata are attributes of
        `/_metadata/<name>`.
        topics, head: as for `frame`.
        """
        import h5py
        # Made in memory: where a disk is full, HDF5 ends the process.
        with h5py.File(os.fspath(path), "w", driver="core", backing_store=False) as out:
            for name, pairs in self.metadata.items():
                out.require_group(f"_metadata/{name}").attrs.update(pairs)
            for channel, fields in self._select(topics, head).items():
                group = out.require_group(channel.name.replace(".", "/"))
                group.attrs["schema"] = channel.schema
                group.attrs.update(channel.metadata)
                for name, unit, values in (("_time", "s", self.time(channel.topic)),
                                           ("_time_ns", "ns", self.time_ns(channel.topic))):
                    group.create_dataset(name, data=values).attrs["unit"] = unit
                for field in fields:
                    values = self._values(channel)
                    for p in field.name.split("."):
                        values = values[p]
                    data = group.create_dataset(field.name, data=values)
                    data.attrs["unit"] = field.unit
                    data.attrs["meaning"] = field.meaning
                    if field.values:
                        data.attrs["values"] = ", ".join(
                            f"{k}={v}" for k, v in field.values.items())
            out.flush()
            with Part(path) as part:
                part.write_bytes(out.id.get_file_image())
        return Path(path)


def _map(path):
    """The file's bytes, mapped into memory, if it begins as an MCAP file does."""
    try:
        with open(path, "rb") as file:
            begin = file.read(len(mcap.MAGIC))
            if begin != mcap.MAGIC:
                found = f"{begin.hex(' ')} ({begin!r})" if begin else "an empty file"
                raise ArchiveError(f"{path}: not an MCAP file: expected it to begin with "
                                   f"{mcap.MAGIC.hex(' ')}, found {found}")
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be opened: {error.strerror}") from None


def _full(channel, name):
    return f"{channel.name}.{name}" if name else channel.name


def _listing(names):
    return listed(names, most=12)
