# SPDX-License-Identifier: Apache-2.0
"""Inputs that are fed by hand, in place of a wire: with constants, arrays over time, or a record.

    sim.feed(f.tracking.attitude, sigma_BN=[0, 0, 0.1])
    sim.feed(f.control.speeds, time=[0, 60, 120] * s, Omega=speeds)             # (3, 8), each held until the next
    sim.feed(f.tracking.attitude, fledge.Archive("telemetry.mcap"), topic="nav.attitude")
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.elements import ELEMENTS
from fledge.errors import SetupError, did_you_mean, listed
from fledge.mission.log import dtype_of, leaves
from fledge.objects.si import enumerator, time_ns, to_enumerators, to_si
from fledge.objects.wires import caller
from fledge.records.series import HEAD, HEAD_COLUMNS, Records, element_names, part, words_of
from fledge.units import s

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray


def feed(core: Any, port: Any, record: Any = None, /, *, time: Any = None, topic: str | None = None,
         linear: Any = False, stale_after: Any = 0, quality: Any = "GOOD", **fields: Any) -> None:
    """See Simulation.feed(). core: the simulation in the extension."""
    if not isinstance(port, _core.Message) or _core.root(port) is None:
        raise SetupError("feed: expected an input, as in sim.flight.tracking.attitude; found "
                         + repr(port).partition("\n")[0][:80])
    path, struct = _core.path(port), _core.struct(port)
    what = f"feed {path}"
    if isinstance(record, dict):
        record, fields = None, {**record, **fields}
    if record is not None and (fields or time is not None):
        raise SetupError(f"{what}: give a record, or the fields themselves, not both")
    if record is None and not fields:
        raise SetupError(f"{what}: give a record, or some of the fields: {listed(_own(struct))}")
    if record is None:
        times, messages = _by_fields(what, port, time, quality, fields)
    elif isinstance(record, Records):
        times, messages = _by_record(what, path, struct, record, topic)
    elif hasattr(record, "columns") and hasattr(record, "index"):
        times, messages = _by_frame(what, struct, record, topic)
    else:
        raise SetupError(f"{what}: expected a Log, an Archive or a pandas DataFrame; found {record!r:.80}")
    always = record is None and time is None
    doubles = _linear(what, struct, linear, always)
    words = "by hand, constant" if always else (
        f"by hand, {len(times)} samples" + (f" from {times[0] / 1e9:g} to {times[-1] / 1e9:g} s" if len(times) else "")
        + (", linear" if doubles else ""))
    core.feed(port, times.tobytes(), messages.tobytes(), always, doubles,
              time_ns(stale_after, f"{what}: stale_after"), words)
    root = _core.root(port)
    context = _core.context(root) if root is not None else None
    assert context is not None
    context().declare(path, caller())


def _own(struct: _core.Struct) -> list[str]:
    return [f.name for f in struct.fields if f.name != "head" and not f.spare]


def _linear(what: str, struct: _core.Struct, linear: bool | Iterable[str], always: bool) -> list[int]:
    """[bytes] of the doubles that change linearly."""
    names = [] if linear is False else _own(struct) if linear is True else list(linear)
    if names and always:
        raise SetupError(f"{what}: linear is for samples over time; give their times")
    numbers = {name: field for name, field, parts in leaves(struct)
               if field.type == "f64" and len(parts) == 1 and not name.startswith(HEAD)}
    for name in () if linear is True else names:
        if name not in numbers:
            raise SetupError(
                f"{what}: linear: expected fields of plain numbers: {listed(list(numbers))}; found {name!r}")
    return [field.offset + at for name, field in numbers.items() if name in names for at in range(0, field.size, 8)]


# --- fields ----------------------------------------------------------------------------------------

def _by_fields(what: str, port: Any, time: Any, quality: Any,
               fields: dict[str, Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    import numpy as np

    struct = _core.struct(port)
    times = np.zeros(1, np.int64) if time is None else _times(what, time)
    messages = np.repeat(np.frombuffer(_core.starts(port), dtype_of(struct)), len(times))
    _fill(messages, struct, fields, what, time is not None)
    messages["head"]["t"] = times
    messages["head"]["sequence"] = np.arange(1, len(times) + 1)
    head = next(f for f in struct.fields if f.name == "head").struct
    grade = next(f for f in head.fields if f.name == "quality")
    messages["head"]["quality"] = enumerator(grade.ctype, grade.enumerators, quality, f"{what}: quality")
    return times, messages


def _times(what: str, time: Any) -> NDArray[Any]:
    import numpy as np

    seconds = np.asarray(_array(f"{what}: time", to_si(time, f"{what}: time", "s", s.dims, "times in s")), float)
    if seconds.ndim != 1 or not len(seconds):
        raise SetupError(f"{what}: time: expected a list of times; found the shape {seconds.shape}")
    if not (abs(seconds) < 9e9).all():
        raise SetupError(f"{what}: time: expected times of less than 9e9 s; found {seconds[~(abs(seconds) < 9e9)][0]}")
    return np.rint(seconds * 1e9).astype(np.int64)


def _array(path: str, values: Any) -> NDArray[Any]:
    import numpy as np

    try:
        return np.array(values)
    except ValueError:
        raise SetupError(f"{path}: expected an array, whose rows have one length") from None


def _fill(messages: NDArray[Any], struct: _core.Struct, values: Any, path: str, timed: bool) -> None:
    """Write values, constants or one for each message, into messages."""
    if not isinstance(values, dict):
        raise SetupError(f"{path}: expected a dict of {listed(_own(struct))}; found {values!r:.80}")
    known = {f.name: f for f in struct.fields if not f.spare and f.name != "head"}
    for name, value in values.items():
        if name not in known:
            raise SetupError(f"{path}: {struct.name} has no '{name}'{did_you_mean(name, known)} it has "
                             + listed(list(known)))
        field, here = known[name], f"{path}: {name}"
        if field.type == "struct" and field.shape:
            if not isinstance(value, (list, tuple)) or len(value) > field.shape[0]:
                raise SetupError(f"{here}: expected a list of up to {field.shape[0]} dicts; found {value!r:.80}")
            for i, row in enumerate(value):
                _fill(messages[name][:, i], field.struct, row, f"{here}[{i}]", timed)
            rows = len(value)
        elif field.type == "struct":
            _fill(messages[name], field.struct, value, here, timed)
            continue
        elif field.type == "char":
            if not isinstance(value, str) or len(value.encode()) >= field.size:
                raise SetupError(f"{here}: expected a text of less than {field.size} bytes; found {value!r:.80}")
            messages[name] = value.encode()
            continue
        else:
            numbers = _numbers(here, field, value, len(messages), timed)
            if not field.shape:
                messages[name] = numbers
                continue
            rows = numbers.shape[-len(field.shape)]
            messages[name][:, :rows] = numbers
        if field.count and field.count not in values:
            messages[field.count] = rows


def _numbers(path: str, field: _core.Field, value: Any, n: int, timed: bool) -> NDArray[Any]:
    """An array of the field's shape, or one for each message; of fewer rows where the first ones are given, but not of
    vectors."""
    import numpy as np

    if field.type == "enum":
        numbers = _array(path, to_enumerators(field.ctype, field.enumerators, value, path))
    else:
        numbers = _array(path, to_si(value, path, field.unit, field.dims, "numbers"))
    kind = np.dtype(ELEMENTS[field.type].dtype)
    if kind.kind != "f" and numbers.dtype.kind not in "iu":
        raise SetupError(f"{path}: expected whole numbers; found {value!r:.80}")
    if kind.kind != "f" and numbers.size and not (np.iinfo(kind).min <= numbers.min()
                                                  and numbers.max() <= np.iinfo(kind).max):
        raise SetupError(f"{path}: expected numbers of {8 * kind.itemsize} bits; found {value!r:.80}")
    shape = numbers.shape
    if timed and len(shape) == len(field.shape) + 1 and shape[0] == n:
        shape = shape[1:]
    vectors = len(field.shape) == {"Vec3": 1, "Mat3": 2}.get(field.ctype)
    if len(shape) != len(field.shape) or shape[1:] != field.shape[1:] or shape > field.shape or (
            vectors and shape != field.shape):
        wanted = str(field.shape) if field.shape else "one number"
        raise SetupError(f"{path}: expected {wanted}" + (f", or {(n, *field.shape)} for {n} times" if timed else "")
                         + f"; found the shape {numbers.shape}")
    return numbers


# --- records ---------------------------------------------------------------------------------------

def _by_record(what: str, path: str, struct: _core.Struct, record: Any,
               topic: str | None) -> tuple[NDArray[Any], NDArray[Any]]:
    import numpy as np

    ports = {port.name: port for port in record._ports()}
    if topic is not None:
        name = record._find(topic)[0].name
    else:
        fitting = [name for name, port in ports.items() if _type_of(port) == struct.name]
        if path in fitting:
            fitting = [path]
        if len(fitting) != 1:
            raise SetupError(f"{what}: the record has " + (
                f"several of {struct.name}: {listed(fitting)}; choose one by topic=" if fitting else
                f"no {struct.name}; it has " + listed([f"{n} ({_type_of(p)})" for n, p in ports.items()], most=12)))
        name = fitting[0]
    if _type_of(ports[name]) != struct.name:
        raise SetupError(f"{what}: it takes {struct.name}, and {name} is {_type_of(ports[name])}")
    values = record._values(ports[name])
    times = np.rint(np.asarray(record._time(ports[name])) * 1e9).astype(np.int64)
    messages = np.zeros(len(values), dtype_of(struct))
    _copy(messages, values, f"{what}: {name}")
    return _last_of_each(what, times, messages)


def _type_of(port: Any) -> str:
    """The name of a port's message, of a Log or an Archive."""
    return port.core.struct.name if hasattr(port, "core") else port.schema.rpartition("/")[2]


def _copy(to: NDArray[Any], source: NDArray[Any], path: str) -> None:
    """The same fields by name: a record may be of another version of the header."""
    names = to.dtype.names or ()
    ours, theirs = set(names), {name for name in source.dtype.names or () if not name.startswith("spare")}
    if ours != theirs:
        raise SetupError(f"{path} was recorded with other fields: {listed(sorted(ours ^ theirs))}")
    for name in names:
        if to.dtype[name].names:
            _copy(to[name], source[name], f"{path}.{name}")
        elif to.dtype[name].shape != source.dtype[name].shape:
            raise SetupError(f"{path}.{name} was recorded in the shape {source.dtype[name].shape}; "
                             f"it has {to.dtype[name].shape}")
        else:
            to[name] = source[name]


def _last_of_each(what: str, times: NDArray[Any], messages: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Of several messages at one instant, the last is what a reader saw."""
    import numpy as np

    if not len(times):
        raise SetupError(f"{what}: the record has no samples of it")
    last = np.append(times[1:] != times[:-1], True)
    return times[last], messages[last]


def _by_frame(what: str, struct: _core.Struct, frame: Any, topic: str | None) -> tuple[NDArray[Any], NDArray[Any]]:
    """frame: as frame() of a Log or an Archive gives it, by time [s]; columns by the names of fields, "sigma_BN[0]", or
    behind the name of a topic, "attitude.sigma_BN[0]"."""
    import numpy as np

    numbers, heads = _columns(what, struct, frame, topic)
    known = {source for sources in (*numbers.values(), heads.values()) for source in sources if source}
    frame = frame[sorted(known)].dropna(how="all")
    if frame.index.dtype.kind in "mM":
        raise SetupError(f"{what}: the frame's index must be seconds; of dates, take "
                         "(frame.index - start).total_seconds()")
    times = _times(what, frame.index.to_numpy())
    messages = np.zeros(len(frame), dtype_of(struct))
    for name, sources in numbers.items():
        target = part(messages, name)
        for index, source in zip(np.ndindex(target.shape[1:]), sources):
            if source:
                try:
                    target[(slice(None), *index)] = frame[source].to_numpy()
                except (TypeError, ValueError) as error:
                    raise SetupError(f"{what}: column {source}: {error}") from None
    head = next(f for f in struct.fields if f.name == "head").struct
    quality = words_of(next(f for f in head.fields if f.name == "quality"))
    grades = {word: number for number, word in quality.items()}
    messages["head"]["t"] = _times(what, frame[heads["valid_at"]].to_numpy()) if heads["valid_at"] else times
    words = frame[heads["quality"]] if heads["quality"] else ["good"] * len(frame)
    if unknown := [word for word in words if word not in grades]:
        raise SetupError(f"{what}: column {heads['quality']}: expected {listed(list(grades))}; found {unknown[0]!r}")
    messages["head"]["quality"] = [grades[word] for word in words]
    messages["head"]["sequence"] = np.arange(1, len(times) + 1)
    return _last_of_each(what, times, messages)


def _columns(what: str, struct: _core.Struct, frame: Any,
             topic: str | None) -> tuple[dict[str, list[str | None]], dict[str, str | None]]:
    """The columns of the elements of each field, and those of the head; None where the frame has none."""
    prefix = f"{topic}." if topic else ""
    columns = [str(c) for c in frame.columns if str(c).startswith(prefix)]
    known: set[str] = set()

    def found(name: str) -> str | None:
        fitting = [c for c in columns if c == f"{prefix}{name}" or not prefix and c.endswith(f".{name}")]
        if len(fitting) > 1:
            raise SetupError(f"{what}: {name} may be {listed(fitting)}; choose one by topic=")
        known.update(fitting)
        return fitting[0] if fitting else None

    numbers = {name: [found(element) for element in element_names(parts)]
               for name, field, parts in leaves(struct) if not name.startswith(HEAD) and field.type != "char"}
    heads = {column: found(column) for column in HEAD_COLUMNS}
    if unknown := [c for c in columns if c not in known]:
        advice = ("; times are the frame's index, as by read_csv(..., index_col=0)"
                  if frame.index.equals(frame.reset_index(drop=True).index) else "")
        raise SetupError(
            f"{what}: {struct.name} has no {listed(unknown, most=6)}; it has {listed(_own(struct))}{advice}")
    for name, sources in numbers.items():
        if any(sources) and not all(sources):
            raise SetupError(
                f"{what}: the frame has some elements of {name} only: {listed(list(filter(None, sources)))}")
    if not any(source for sources in numbers.values() for source in sources):
        raise SetupError(f"{what}: the frame has no column of {struct.name}" + (f" behind {prefix}" if topic else "")
                         + f": {listed(_own(struct))}")
    return numbers, heads
