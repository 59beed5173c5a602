# SPDX-License-Identifier: Apache-2.0
"""What a simulation recorded in memory, by name.

    log = sim.record(f.tracking.error, f.motor.command, every=1 * s)
    sim.run(160 * minute)
    log["error.sigma_BR"]          # (n, 3)
    log.last("command.u").norm()
    log.frame()                    # pandas
    log.plot("error.sigma_BR", "command.u")

Names are read from the end and may be as short as they are unique: "flight.tracking.error.sigma_BR",
"error.sigma_BR", "sigma_BR". "error" alone is the whole message, a structured array.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from fledge.elements import ELEMENTS
from fledge.errors import SetupError, did_you_mean
from fledge.series import Series


def dtype_of(struct: Any) -> Any:
    """The numpy dtype of a C struct: the same bytes, with the names of the header."""
    import numpy as np

    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    kind: Any
    for field in struct.fields:
        if field.spare:
            continue
        if field.type == "char":
            kind = f"S{field.size}"
        else:
            kind = dtype_of(field.struct) if field.type == "struct" else np.dtype(ELEMENTS[field.type].dtype)
            kind = (kind, field.shape) if field.shape else kind
        names.append(field.name)
        formats.append(kind)
        offsets.append(field.offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": struct.size})


def leaves(struct: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """(name, Field) of every number in a message, with dots: "head.t", "sigma_BR"."""
    for field in struct.fields:
        if field.spare:
            continue
        if field.type == "struct" and not field.shape:
            yield from leaves(field.struct, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, field


class _Samples:
    """The samples of one port; decoded again only when there are more."""

    def __init__(self, core):
        self.core = core
        self.path = core.path
        self.fields = dict(leaves(core.struct))
        self._decoded = None

    def decoded(self) -> tuple[Any, Any]:
        """(times in ns, structured array), read-only copies of what is there now."""
        if self._decoded is None or len(self._decoded[0]) != len(self.core):
            import numpy as np

            self._decoded = (np.frombuffer(self.core.times(), np.int64),
                             np.frombuffer(self.core.bytes(), dtype_of(self.core.struct)))
        return self._decoded


class Log:
    """The records of some ports. Fills while the simulation runs; reset() empties it."""

    def __init__(self, simulation, logs):
        self._simulation = simulation
        self._samples = {samples.path: samples for samples in map(_Samples, logs)}

    # --- names ---

    @property
    def names(self) -> list[str]:
        """The full names of all fields but the heads'."""
        return [f"{path}.{name}" for path, s in self._samples.items() for name in s.fields
                if not name.startswith("head.")]

    def find(self, key: str) -> tuple[_Samples, str | None, tuple[int, ...]]:
        """(samples, name of a field or None, indices) for a name. SetupError lists the candidates."""
        indices = tuple(int(i) for i in re.findall(r"\[(\d+)\]", key))
        wanted = re.sub(r"\[\d+\]", "", key).replace("/", ".").strip(".")
        ports = [(s, None) for path, s in self._samples.items() if ("." + path).endswith("." + wanted)]
        fields = [(s, name) for path, s in self._samples.items() for name in s.fields
                  if f".{path}.{name}".endswith("." + wanted)]
        if "head" not in wanted.split("."):
            fields = [f for f in fields if not f[1].startswith("head.")]
        found = ports or fields
        if len(found) == 1:
            samples, name = found[0]
            return samples, name, indices
        if found:
            raise SetupError(f"the record's '{key}' may be "
                             + " or ".join(s.path + (f".{n}" if n else "") for s, n in found)
                             + "; write more of the name")
        endings = [ending for full in self.names for ending in _endings(full)]
        raise SetupError(f"the record has no '{key}'{did_you_mean(wanted, endings)} it has {', '.join(self.names)}")

    def field(self, key: str) -> Any:
        """What the header says of a field: its unit, shape and meaning."""
        samples, name, _ = self.find(key)
        if name is None:
            raise SetupError(f"'{key}' is a whole message; name one of its fields: "
                             + ", ".join(n for n in samples.fields if not n.startswith("head.")))
        return samples.fields[name]

    def series(self, key: str) -> Series:
        """The Series of a field or element, for plots."""
        samples, name, indices = self.find(key)
        field = self.field(key)
        short = str(name).rpartition(".")[2] + "".join(f"[{i}]" for i in indices)
        return Series(key, short, samples.path, self.time_of(key), self[key], field.unit, field.doc)

    def short_name(self, path: str) -> str:
        """The shortest ending of a port's path that is unique here: "error"."""
        parts = path.split(".")
        for n in range(1, len(parts)):
            tail = ".".join(parts[-n:])
            if sum(("." + other).endswith("." + tail) for other in self._samples) == 1:
                return tail
        return path

    @property
    def plots(self) -> Any:
        """What collects the figures of this log: that of its simulation. False: nothing is to be drawn."""
        return self._simulation.plots

    # --- data ---

    def __getitem__(self, key: str) -> Any:
        """The values of a field as an (n, ...) array, of an element as (n,), of a message as structured (n,).

        The arrays are read-only, and keep what was there when they were read.
        """
        samples, name, indices = self.find(key)
        values = samples.decoded()[1]
        for part in name.split(".") if name else ():
            values = values[part]
        if indices:
            if len(indices) >= values.ndim or any(i >= n for i, n in zip(indices, values.shape[1:])):
                raise SetupError(f"the record's '{key}': {samples.path}.{name} has shape {values.shape[1:]}")
            values = values[(slice(None), *indices)]
        return values

    def time_of(self, key: str) -> Any:
        """The times of a field's or message's samples [s]."""
        return self.find(key)[0].decoded()[0] / 1e9

    @property
    def time(self) -> Any:
        """The times of the samples [s]; for records at one rate."""
        times = [s.decoded()[0] for s in self._samples.values()]
        if any(len(t) != len(times[0]) or (t != times[0]).any() for t in times[1:]):
            raise SetupError("the records have different times; ask for time_of(name)")
        return times[0] / 1e9

    def last(self, key: str) -> Any:
        """The last value of a field: a number, or an array that also has norm()."""
        values = self[key]
        if not len(values):
            raise SetupError(f"nothing was recorded of '{key}' yet: run the simulation first")
        from fledge.objects.vector import Vector

        return values[-1].view(Vector) if getattr(values[-1], "ndim", 0) else values[-1].item()

    def __len__(self) -> int:
        return max(len(s.core) for s in self._samples.values())

    def frame(self, *keys: str, head: bool = False) -> Any:
        """A pandas DataFrame by time [s], one column per number: "error.sigma_BR[0]".

        keys: names of fields or messages; none: all. head: with the messages' heads.
        `attrs["units"]` and `attrs["meanings"]` map columns to text. Records of different times share
        the index, with NaN where one has no value.
        """
        import numpy as np
        import pandas as pd

        frames, units, meanings = [], {}, {}
        for path in dict.fromkeys(self.find(k)[0].path for k in keys or self._samples):
            samples = self._samples[path]
            wanted = [self.find(k)[1] for k in keys if self.find(k)[0] is samples]
            columns = {}
            for name, field in samples.fields.items():
                is_head = name.startswith("head.")
                if not (name in wanted or ((not wanted or None in wanted) and (head or not is_head))):
                    continue
                values = self[f"{path}.{name}"]
                for index in np.ndindex(values.shape[1:]):
                    column = f"{self.short_name(path)}.{name}" + "".join(f"[{i}]" for i in index)
                    columns[column] = values[(slice(None), *index)]
                    units[column], meanings[column] = field.unit, field.doc
            frames.append(pd.DataFrame(columns, index=samples.decoded()[0]))
        frame = frames[0] if len(frames) == 1 else pd.concat(frames, axis=1, sort=True)
        frame.index = pd.Index(frame.index.to_numpy(dtype=float) / 1e9, name="time [s]")
        frame.attrs = {"units": units, "meanings": meanings}
        return frame

    def plot(self, *panels: str | list[str], **options: Any) -> Any:
        """Plot fields against time, one panel each; see fledge.plot.plot for the options.

        Returns the matplotlib Figure. In `fledge run` it is saved beside the record.
        """
        from fledge.plot import deliver, plot

        return None if self.plots is False else deliver(plot(self, *panels, **options), self.plots)

    def __repr__(self):
        return "\n".join(["log of"] + [f"  {path}, {len(s.core)} samples: "
                                       + ", ".join(n for n in s.fields if not n.startswith("head."))
                                       for path, s in self._samples.items()])


def _endings(full):
    parts = full.split(".")
    return [".".join(parts[i:]) for i in range(len(parts))]
