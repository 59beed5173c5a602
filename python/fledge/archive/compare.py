# SPDX-License-Identifier: Apache-2.0
"""The differences of two records: topics, definitions, times and values, by the messages' names.

    for difference in compare(Archive("desktop.mcap"), Archive("linux.mcap")):
        print(difference)                 # the earliest first
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fledge.archive import ArchiveError
from fledge.errors import listed
from fledge.records.series import part

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from fledge.archive import Archive
    from fledge.archive.reader import Channel

    Times = Callable[[Any], Any]    # from an array of times [ns]: which of them count

STRUCTURE = -1      # the time of a difference in a topic as a whole


@dataclass
class Difference:
    """The first difference in a topic or field.

    t: [ns], of the first message that differs; STRUCTURE if the topic as a whole does
    topic: "flight.tracking.error"; name: of the element, "sigma_BR[1]", or ""
    a, b: the two values; what: the difference in words, if it is not one of values
    ulps: the number of doubles between them; None if the values are no floating-point numbers
    count: of messages in which the field differs; total: of messages compared
    worst: the largest difference of the field's values; 0.0 if they are no numbers
    """
    t: int
    topic: str
    name: str
    a: object
    b: object
    what: str = ""
    ulps: int | None = None
    count: int = 0
    total: int = 0
    worst: float = 0.0
    unit: str = ""

    def __str__(self) -> str:
        full = f"{self.topic}.{self.name}" if self.name else self.topic
        if self.t == STRUCTURE:
            return f"{full}: {self.what}"
        if self.what:
            return f"t = {seconds(self.t)}  {full}: {self.what}"
        unit = f" {self.unit}" if self.unit not in ("", "-") else ""
        # A huge count means only that the numbers have nothing in common.
        ulps = "" if self.ulps is None or self.ulps > 10**9 else f", {self.ulps} ulp" + ("s" if self.ulps != 1 else "")
        return f"t = {seconds(self.t)}  {full}: {self.a!r} and {self.b!r}{unit}{ulps}"


def seconds(ns: int) -> str:
    """A time [ns] in words: "0.5 s"."""
    return f"{ns / 1e9:.9g} s"


def compare(a: Archive, b: Archive, topics: Iterable[str] | None = None, ignore: Sequence[str] = (),
            tolerance: float = 0.0, times: Times | None = None) -> list[Difference]:
    """The Differences between two Archives, the earliest of each field, by time; [] if they have the same bits.

    topics: names or endings of those to compare; None: all of both whose messages are plain structs
    ignore: endings of field names that do not count, as "head.sequence"
    tolerance: differences of numbers up to this do not count
    times: a function that selects from an array of times [ns]; None: all
    A NaN equals a NaN of the same bits; -0.0 and 0.0 differ, unless there is a tolerance. Raises ArchiveError on an
    unknown topic.
    """
    differences = [difference for topic in chosen(a, b, topics)
                   for difference in _topic(a, b, topic, ignore, tolerance, times)]
    return sorted(differences, key=lambda difference: difference.t)


def origins(a: Archive, b: Archive) -> list[tuple[str, str, str]]:
    """(name, value in a, value in b) of the facts with which the two runs began and that differ: mission, scenario,
    seed, version of Fledge, revisions, parameters. Only facts that are in both records."""
    differing = []
    for group in ("run", "revisions", "parameters"):
        here, there = a.metadata.get(group), b.metadata.get(group)
        if not here or not there:
            continue
        for key in dict.fromkeys([*here, *there]):
            if group != "parameters" != key and not (key in here and key in there):
                continue    # a target knows less of its run
            pair = here.get(key, "none"), there.get(key, "none")
            if pair[0] != pair[1] and key != "assumptions":     # these follow from the parameters
                element = _element(*pair) if group == "parameters" else ""
                differing.append((f"revision of {key}" if group == "revisions" else key + element,
                                  _at(pair[0], element), _at(pair[1], element)))
    return differing


def _element(a: str, b: str) -> str:
    """The indices of the first element in which two texts of lists differ: "[2][0]"; "" if they are no such lists."""
    import json

    try:
        p, q = (json.JSONDecoder().raw_decode(text)[0] for text in (a, b))
    except ValueError:
        return ""
    indices = ""
    while isinstance(p, list) and isinstance(q, list) and len(p) == len(q) and p != q:
        i = next(i for i, (x, y) in enumerate(zip(p, q)) if x != y)
        p, q, indices = p[i], q[i], f"{indices}[{i}]"
    return indices


def _at(text: str, element: str) -> str:
    """An element of the list in a text, with the unit that follows the list."""
    import json

    value, end = json.JSONDecoder().raw_decode(text) if element else (text, len(text))
    for i in re.findall(r"\d+", element):
        value = value[int(i)]
    return f"{value}{text[end:]}"


def chosen(a: Archive, b: Archive, topics: Iterable[str] | None = None) -> list[str]:
    """The topics of two Archives with these names or endings, or of a process or instance by its name; None: all whose
    messages are plain structs in both. Raises ArchiveError on a name that is none's, or of several topics."""
    names = list(dict.fromkeys([*a.topics, *b.topics]))
    if topics is None:
        return [name for name in names if not any(name in c.topics and c.topics[name].problem for c in (a, b))]
    wanted = []
    for topic in topics:
        dotted = topic.replace("/", ".").strip(".")
        exact = [n for n in names if n.strip("/").replace("/", ".") == dotted]
        hits = exact or [n for n in names if n.replace("/", ".").endswith("." + dotted)]
        within = [n for n in names if n.strip("/").replace("/", ".").startswith(dotted + ".")]
        if within and not hits:
            wanted += within
            continue
        if len(hits) != 1:
            raise ArchiveError(f"there is {'no' if not hits else 'more than one'} topic {topic}; there are "
                               f"{listed(sorted(n.strip('/').replace('/', '.') for n in hits or names))}")
        wanted += hits
    return wanted


def _topic(a: Archive, b: Archive, topic: str, ignore: Sequence[str], tolerance: float,
           times: Times | None) -> Iterator[Difference]:
    import numpy as np

    name = topic.strip("/").replace("/", ".")
    for here, there in ((a, b), (b, a)):
        if topic not in here.topics:
            yield Difference(STRUCTURE, name, "", None, None,
                             f"only in {there.path}, {there.topics[topic].count} messages")
            return
    first, second = a.topics[topic], b.topics[topic]
    if text := _definitions_differ(first, second):
        yield Difference(STRUCTURE, name, "", None, None, text)
        return
    ta, tb = a.time_ns(topic), b.time_ns(topic)
    ka, kb = (np.ones(len(t), bool) if times is None else times(t) for t in (ta, tb))
    va, vb = a[topic][ka], b[topic][kb]
    ta, tb = ta[ka], tb[kb]
    n = min(len(ta), len(tb))
    moved = np.nonzero(ta[:n] != tb[:n])[0]
    if len(moved):
        n = int(moved[0])
    if n < max(len(ta), len(tb)):
        yield _unpaired(a, b, name, ta, tb, n)
    yield from _values(first, name, va[:n], vb[:n], ta[:n], ignore, tolerance)


def _definitions_differ(first: Channel, second: Channel) -> str:
    if first.schema != second.schema:
        return f"a {first.type} here, a {second.type} there"
    fields, others = first.fields, second.fields
    for name in dict.fromkeys([*fields, *others]):
        if name not in fields or name not in others:
            return f"its definition has {name} only {'here' if name in fields else 'there'}"
        f, g = fields[name], others[name]
        for property_ in ("dtype", "shape", "unit"):
            here, there = getattr(f, property_), getattr(g, property_)
            if here != there:
                return f"{name} has the {property_} {here} here and {there} there"
    if list(fields) != list(others):
        return "its fields stand in another order"
    return ""


def _unpaired(a: Archive, b: Archive, name: str, ta: NDArray[Any], tb: NDArray[Any], n: int) -> Difference:
    """The first message without a partner of the same time."""
    if n < len(ta) and n < len(tb):
        early, here = (ta[n], a) if ta[n] < tb[n] else (tb[n], b)
        return Difference(int(early), name, "", None, None, f"a message only in {here.path}; from here on the two "
                          "have other times")
    longer, t = (a, ta) if len(ta) > n else (b, tb)
    return Difference(int(t[n]), name, "", None, None, f"{len(t) - n} more messages in {longer.path}, from here to "
                      f"{seconds(t[-1])}")


def _values(channel: Channel, topic: str, va: NDArray[Any], vb: NDArray[Any], t: NDArray[Any], ignore: Sequence[str],
            tolerance: float) -> Iterator[Difference]:
    """The first difference of each field."""
    import numpy as np

    if not len(t) or va.tobytes() == vb.tobytes():
        return
    for field in channel.fields.values():
        if any(field.name == end or field.name.endswith("." + end) for end in ignore):
            continue
        x, y = (np.ascontiguousarray(part(v, field.name)).reshape(len(v), -1) for v in (va, vb))
        if x.dtype.kind == "S":
            if len(rows := np.flatnonzero((x != y).any(axis=1))):
                p, q = (v[rows[0], 0].decode(errors="replace") for v in (x, y))
                yield Difference(int(t[rows[0]]), topic, field.columns()[0], p, q, count=len(rows), total=len(t))
            continue
        bits = x.view(f"u{x.dtype.itemsize}") != y.view(f"u{y.dtype.itemsize}")
        distance = np.zeros(bits.shape)
        if field.dtype[0] != "?":
            with np.errstate(invalid="ignore", over="ignore"):
                distance = np.abs(x.astype("f8") - y.astype("f8"))
            distance[np.isnan(distance) & bits] = np.inf
            distance[~bits] = 0.0
        if tolerance:
            bits &= distance > tolerance
        rows = bits.any(axis=1)
        if not rows.any():
            continue
        i = int(rows.argmax())
        j = int(bits[i].argmax())
        p, q = x[i, j].item(), y[i, j].item()
        names = {v: k for k, v in (field.values or {}).items()} if field.values else {}
        yield Difference(int(t[i]), topic, field.columns()[j], names.get(p, p), names.get(q, q),
                         ulps=_ulps(x[i, j], y[i, j]), count=int(rows.sum()), total=len(t),
                         worst=float(distance.max()), unit=field.unit)


def _ulps(p: Any, q: Any) -> int | None:
    """The steps from one floating-point number to another, over representable ones; None if it has no meaning."""
    import math
    import struct

    if p.dtype.kind != "f" or not (math.isfinite(p) and math.isfinite(q)):
        return None
    code, mask = (("<d", "<q"), 1 << 63) if p.dtype.itemsize == 8 else (("<f", "<i"), 1 << 31)

    def place(v: Any) -> int:
        n = struct.unpack(code[1], struct.pack(code[0], float(v)))[0]
        return n if n >= 0 else -(n + mask)
    return abs(place(p) - place(q))


def digest(archive: Archive, topics: Iterable[str], times: Times | None = None) -> str:
    """A hash of all messages of some topics, by their names, times and bytes: 16 hexadecimal digits. The messages of
    executives, modes and activity, are left out. times: as of compare(). Raises ArchiveError on an unknown topic."""
    import hashlib

    import numpy as np

    total = hashlib.sha256()
    executives = {port.topic for port in archive.executives()}
    for topic in sorted(set(topics) - executives):
        t = archive.time_ns(topic)
        counted = np.ones(len(t), bool) if times is None else times(t)
        total.update(topic.encode() + b"\0")
        total.update(t[counted].astype("<i8").tobytes())
        if archive.topics[topic].problem is None:
            total.update(archive[topic][counted].tobytes())
        else:
            for content, counts in zip(archive.contents(topic), counted):
                total.update(len(content).to_bytes(8, "little") + content if counts else b"")
    return total.hexdigest()[:16]
