# SPDX-License-Identifier: Apache-2.0
"""The samples that a simulation records in memory, by name.

    log = sim.record(f.tracking.error, f.motor.command, every=1 * s)
    sim.run(160 * minute)
    log["error.sigma_BR"]          # (n, 3)
    log.last("command.u").norm()
    log.frame()                    # pandas
    log.plot("error.sigma_BR", "command.u")

Names may be as short as they are unique; see fledge.records.series.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from fledge.elements import ELEMENTS
from fledge.errors import SetupError, listed, suggesting
from fledge.records.series import (
    HEAD, Records, Series, element_names, frame_of, head_column, head_columns, nested_names, part)

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from fledge import _core
    from fledge.mission.simulation import Simulation


def dtype_of(struct: _core.Struct) -> Any:
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


def leaves(struct: _core.Struct, parts: tuple = ()) -> Iterator[tuple[str, Any, tuple]]:
    """(name, Field, (name, shape) of each part of the name) of every number in a message: "head.t", "parts.share"."""
    for field in struct.fields:
        if field.spare:
            continue
        own = (*parts, (field.name, () if field.type == "char" else field.shape))
        if field.type == "struct":
            yield from leaves(field.struct, own)
        else:
            yield ".".join(name for name, _ in own), field, own


class _Samples:
    """The samples of one port; decoded again only when there are others."""

    def __init__(self, core: _core.Log) -> None:
        self.core = core
        self.name = core.path
        self.type = core.struct.name
        rows = list(leaves(core.struct))
        self.fields = {name: field for name, field, _ in rows}
        self.parts = {name: parts for name, _, parts in rows}
        self.names = nested_names(self.fields)
        self._state: Any = None

    def decoded(self) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """(times in ns, structured array), read-only copies of the present samples."""
        state = len(self.core), self.core.rewinds
        if self._state != state:
            import numpy as np

            self._state, self._decoded = state, (np.frombuffer(self.core.times(), np.int64),
                                                 np.frombuffer(self.core.bytes(), dtype_of(self.core.struct)))
        return self._decoded


@suggesting()
class Log(Records[_Samples]):
    """The records of some ports. Fills while the simulation runs; reset() empties it.

    log["tracking.error.sigma_BR"]: the samples of a field, (n, ...) in SI; of a message, a structured array (n,).
    """

    def __init__(self, simulation: Simulation, logs: Iterable[_core.Log]) -> None:
        self._simulation = simulation
        self._samples = {samples.name: samples for samples in map(_Samples, logs)}

    def _ports(self) -> list[_Samples]:
        return list(self._samples.values())

    def _values(self, port: _Samples) -> NDArray[Any]:
        return port.decoded()[1]

    def _time(self, port: _Samples) -> NDArray[np.float64]:
        return port.decoded()[0] / 1e9

    @property
    def names(self) -> list[str]:
        """The full names of all fields but the heads'."""
        return [f"{path}.{name}" for path, s in self._samples.items() for name in s.fields if not name.startswith(HEAD)]

    def executives(self) -> list[_Samples]:
        """Those of its simulation."""
        return [_Samples(samples) for samples in self._simulation._core.followed]

    @property
    def simulation(self) -> Simulation:
        """The simulation that fills it."""
        return self._simulation

    @property
    def plots(self) -> Any:
        """The collector of this log's figures: that of its simulation. False: draw nothing."""
        return self._simulation.plots

    def time_of(self, key: str) -> NDArray[np.float64]:
        """The times of a field's or message's samples: (n,) [s]. Raises SetupError on an unknown name."""
        return self._time(self._find(key)[0])

    @property
    def time(self) -> NDArray[np.float64]:
        """The times of the samples: (n,) [s]. Raises SetupError if the records have different ones."""
        times = [self._time(s) for s in self._ports()]
        if any(len(t) != len(times[0]) or (t != times[0]).any() for t in times[1:]):
            raise SetupError("the records have different times; ask for time_of(name)")
        return times[0]

    def last(self, key: str) -> Any:
        """The last value of a field: a number, or an array that also has norm(); NaN of what was never written. Raises
        SetupError on an unknown name, and before the first sample."""
        values = self[key]
        if not len(values):
            raise SetupError(f"nothing was recorded of '{key}' yet: run the simulation first")
        from fledge.objects.vector import Vector

        return values[-1].view(Vector) if getattr(values[-1], "ndim", 0) else values[-1].item()

    def __len__(self) -> int:
        return max(len(s.core) for s in self._samples.values())

    def frame(self, *keys: str, head: bool = True, quaternions: bool = False) -> pd.DataFrame:
        """A pandas DataFrame by time [s], one column per number: "error.sigma_BR[0]".

        keys: names of fields or messages; none: all. head: with two columns for the head of each whole message:
        "error.valid_at", the time for which it holds [s], and "error.quality", of the ordered categories none, stale,
        degraded and good. quaternions: with four columns, "error.beta_BR[0]", scalar first, behind "error.sigma_BR[2]".
        `attrs["units"]` and `attrs["meanings"]` map columns to text. Records of different times share
        the index, with NaN where one has no value, as where it was never written. Raises SetupError on unknown names.
        """
        import numpy as np

        tables: list[tuple[NDArray[np.int64], dict[str, Any]]] = []
        units, meanings = {}, {}
        found = [self._find(key)[:2] for key in keys] or [(samples, None) for samples in self._ports()]
        for samples in dict.fromkeys(port for port, _ in found):
            wanted = [name for port, name in found if port is samples]
            columns = {}
            for name, field in samples.fields.items():
                chosen = any(f"{name}.".startswith(f"{key}.") for key in wanted if key)
                if not chosen and (None not in wanted or name.startswith(HEAD)):
                    continue
                values = self._field(samples, name)
                for index, element in zip(np.ndindex(values.shape[1:]), element_names(samples.parts[name])):
                    column = f"{self._short_name(samples)}.{element}"
                    at: tuple[Any, ...] = (slice(None), *index)
                    columns[column] = values[at]
                    units[column], meanings[column] = field.unit, field.doc
            for name, source in (head_columns(samples.fields) if head and None in wanted else {}).items():
                column, field = f"{self._short_name(samples)}.{name}", samples.fields[source]
                columns[column], units[column] = head_column(part(self._values(samples), source), field, source)
                meanings[column] = field.doc
            tables.append((samples.decoded()[0], columns))
        return frame_of(tables, units, meanings, quaternions)

    def plot(self, *panels: str | Series | Sequence[str | Series], **options: Any) -> Figure | None:
        """Plot fields against time, one panel each; see fledge.plot.plot for the options.

        Returns the matplotlib Figure, or None if the simulation draws nothing. In `fledge run` it is saved beside the
        record. Raises SetupError on an unknown name.
        """
        from fledge.plot import deliver, plot, silent

        return None if silent(self) else deliver(plot(self, *panels, **options), self)

    def _repr_html_(self) -> str:
        return self._table(f"log of {self._simulation.name}")

    def __repr__(self) -> str:
        return "\n".join(["log of"] + [f"  {path}, {len(s.core)} samples: "
                                       + listed([n for n in s.fields if not n.startswith(HEAD)], none="a head alone")
                                       for path, s in self._samples.items()])
