# SPDX-License-Identifier: Apache-2.0
"""The store of a campaign's results: a row of numbers for each run, and the retained variables over time.

In memory, or in the folder `unfinished` of the campaign's own:

    plan.json       the campaign: another one begins anew
    rows.npy        the numbers of each run, column after column, so that a column is read by itself
    series-0.npy    a retained variable of all runs, as long as all runs retain few numbers (EXACT) together
    state.npz       which runs are finished, their errors and findings, and beyond EXACT the counts of the percentiles

Neither the order of the shares nor a break between them changes a bit.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.disk import Part, reserve
from fledge.interruption import Interruption
from fledge.mission.provenance import identity
from fledge.mission.simulation import Finding
from fledge.montecarlo.counts import Counts
from fledge.montecarlo.shares import Series, Share, numbers_of_run

if TYPE_CHECKING:
    import numpy as np

    from fledge.montecarlo.campaign import Campaign
    from fledge.montecarlo.requirements import Reported, Variable

EXACT = 2**25           # numbers that all runs together may retain, to be kept one by one (256 MiB)
LINES = 12              # failed runs whose retained variables are kept beyond that, those of the lowest indices
SAVED_EVERY = 5.0       # [s] of wall time: the state on disk may be so old

_NOT_FLOWN, _COMPLETE, _ERROR = range(3)    # the first column


class Store:
    """The results of a campaign of so many runs. folder: of the campaign, or None for memory alone.

    Raises SetupError where there is no room.
    """

    def __init__(self, campaign: Campaign, runs: int, seed: int, folder: Path | None = None,
                 strict: bool = False) -> None:
        import numpy as np

        d = campaign.dispersions
        self.campaign, self.runs = campaign, runs
        self.strict: bool = strict
        self.names = ["outcome", "findings", *d.columns, *d.modes, *(repr(measure.final) for measure in d.measures()),
                      *(text for i in range(len(d.requirements)) for text in (f"worst {i}", f"time {i}"))]
        self.exact: bool = runs * numbers_of_run(campaign) <= EXACT
        self.panels: list[Variable] = [] if self.exact else [panel for variable in d.shown for panel in variable.panels]
        self.counts: list[Counts] = [Counts(len(d.ns)) for _ in self.panels]
        self.errors: dict[int, str] = {}
        self.health: dict[int, list[Finding]] = {}      # of each run with findings, if exact
        self.unhealthy: dict[tuple[str, str], tuple[int, int, Finding]] = {}    # how many runs, the first, its finding
        self.seen: dict[int, np.ndarray] = {}           # of each run, if the campaign keeps it
        self.lines: dict[int, list[np.ndarray]] = {}    # retained variables of failed runs, if not exact
        self._shapes = [(runs, len(d.ns), len(variable.field_path.elements))
                        for variable in d.retained.values()] * self.exact
        self._saved = time.monotonic()
        self.folder: Any = folder and Path(folder) / "unfinished"
        self._check_room()
        self.done: np.ndarray = np.zeros(runs, bool)
        if self.folder:
            self._plan = json.dumps({"mission": str(campaign.folder), "campaign": campaign.name,
                                     "declared": repr(d), "every": d.every, "seed": seed, "runs": runs,
                                     "columns": self.names,
                                     **identity(campaign.folder)}, indent=1)
            if not self._resume():
                self._begin()
        else:
            self._memory = [np.full((runs, len(self.names)), np.nan, order="F"),
                            *(np.full(shape, np.nan) for shape in self._shapes)]

    # --- what there is ---

    @property
    def finished(self) -> int:
        """How many runs are flown."""
        return int(self.done.sum())

    def missing(self) -> list[tuple[int, int]]:
        """The ranges of runs that are not flown yet: (first, one beyond the last)."""
        import numpy as np

        edges = np.flatnonzero(np.diff(np.concatenate([[True], self.done, [True]]).astype(int)))
        return list(zip(edges[::2].tolist(), edges[1::2].tolist()))

    def column(self, name: str) -> np.ndarray:
        """(runs,) numbers, NaN where not flown."""
        import numpy as np

        column = self._array(0)[:, self.names.index(name)]
        return np.array(column) if self.folder else column

    def value(self, name: str, run: int) -> float:
        """A number of one run."""
        return float(self._array(0)[run, self.names.index(name)])

    def series(self) -> Series:
        """What all runs retained. Raises SetupError beyond EXACT."""
        if not self.exact:
            raise SetupError(f"{self.runs} runs retain more than {EXACT} numbers, of which the percentiles are kept "
                             "and no more")
        d = self.campaign.dispersions
        return Series(d.ns, {path: self._shaped(variable, self._array(i)) for i, (path, variable)
                             in enumerate(d.retained.items(), 1)})

    # --- what comes ---

    def add(self, share: Share) -> None:
        """Keep the runs of a share that are not there yet. Ctrl-C takes effect after it."""
        with Interruption():
            self._add(share)
        if self.folder and time.monotonic() - self._saved > SAVED_EVERY:
            self.save()

    def _add(self, share: Share) -> None:
        import numpy as np

        d = self.campaign.dispersions
        new = np.array(share.flown, bool) & ~self.done[share.first:share.first + len(share.flown)]
        runs = share.first + np.flatnonzero(new)
        if not len(runs):
            return
        retained = share.retained if new.all() else [values[new] for values in share.retained]
        series = Series(d.ns, {path: self._shaped(variable, values)
                               for (path, variable), values in zip(d.retained.items(), retained)})
        errors = [error for error, chosen in zip(share.errors, new) if chosen]
        health = [[Finding(*row) for row in rows] for rows, chosen in zip(share.health, new) if chosen]
        complete = np.array([not error for error in errors])
        good = complete & ~np.array([self.strict and bool(findings) for findings in health])
        columns = [np.where(complete, _COMPLETE, _ERROR), [len(findings) for findings in health],
                   *share.draws[new].T, *share.entered[new].T,
                   *(measure.values(series, slice(-1, None))[:, 0] for measure in d.measures())]
        for requirement in d.requirements:
            worst, times, holds = requirement.worst(series)
            columns += [worst, times]
            good &= holds
        self._write(0, runs, np.column_stack(columns))
        if self.campaign.keeps_seen:
            self.seen.update(zip(runs.tolist(), share.seen[new]))
        for run, error, findings in zip(runs.tolist(), errors, health):
            if error:
                self.errors[run] = error
            if findings and self.exact:
                self.health[run] = findings
            for key, finding in {(finding.kind, finding.path): finding for finding in reversed(findings)}.items():
                n, first, of_first = self.unhealthy.get(key, (0, run, finding))
                self.unhealthy[key] = (n + 1, *min((first, of_first), (run, finding), key=lambda entry: entry[0]))
        if self.exact:
            for i, values in enumerate(retained, 1):
                self._write(i, runs, values)
        else:
            for counts, panel in zip(self.counts, self.panels):
                counts.add(panel.values(series)[complete])
            for k in np.flatnonzero(~good)[:LINES]:
                self.lines[int(runs[k])] = [values[k].copy() for values in retained]
            self.lines = dict(sorted(self.lines.items())[:LINES])
        self.done[runs] = True

    @staticmethod
    def _shaped(variable: Variable | Reported, values: np.ndarray) -> np.ndarray:
        values = values.reshape(*values.shape[:2], *variable.field_path.shape)
        values.flags.writeable = False
        return values

    # --- memory and files ---

    def _check_room(self) -> None:
        wanted = 8 * (self.runs * len(self.names) + sum(a * b * c for a, b, c in self._shapes))
        if self.folder:
            there = next(parent for parent in self.folder.parents if parent.exists())
            room, what = shutil.disk_usage(there).free, f"what is left of the disk of {there}"
        else:
            room, what = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2, "half of this machine's memory"
        if wanted > room:
            raise SetupError(f"{self.runs} runs need {wanted / 1e6:,.1f} MB, more than {what}, {room / 1e6:,.1f} MB: "
                             "fly fewer, or " + ("free some" if self.folder else "give a folder"))

    def _name(self, i: int) -> Path:
        return self.folder / ("rows.npy" if i == 0 else f"series-{i - 1}.npy")

    def _array(self, i: int) -> np.ndarray:
        """The rows, or a retained variable after them. Files stay open no longer than their array is used."""
        import numpy as np

        return np.load(self._name(i), mmap_mode="r") if self.folder else self._memory[i]

    def _write(self, i: int, runs: np.ndarray, values: np.ndarray) -> None:
        import numpy as np

        if self.folder:
            array = np.load(self._name(i), mmap_mode="r+")
        else:
            array = self._memory[i]
        if len(runs) == runs[-1] - runs[0] + 1:
            array[runs[0]:runs[-1] + 1] = values
        else:
            array[runs] = values

    def _begin(self) -> None:
        import numpy as np

        if self.folder.exists():
            shutil.rmtree(self.folder)
        self.folder.mkdir(parents=True)
        for i, shape in enumerate([(self.runs, len(self.names)), *self._shapes]):
            array = np.lib.format.open_memmap(self._name(i), "w+", float, shape, fortran_order=i == 0)
            reserve(self._name(i))
            for first in range(0, shape[0], 2**16):     # NaN is not what an empty file has
                array[first:first + 2**16] = np.nan
            del array
        with Part(self.folder / "plan.json") as part:
            part.write_text(self._plan, encoding="utf-8")

    def save(self) -> None:
        """Write the state, for a campaign that goes on later."""
        import numpy as np

        if not self.folder or not self.folder.exists():
            return
        notes = {"errors": list(self.errors.items()), "health": list(self.health.items()),
                 "unhealthy": list(self.unhealthy.values())}
        arrays: dict[str, Any] = {"done": np.packbits(self.done),
                                  "notes": np.frombuffer(json.dumps(notes).encode(), np.uint8)}
        for i, counts in enumerate(self.counts):
            arrays |= {f"keys-{i}": counts.keys, f"counts-{i}": counts.counts}
        for run, lines in self.lines.items():
            arrays |= {f"line-{run}-{i}": values for i, values in enumerate(lines)}
        with Part(self.folder / "state.npz") as part, part.open("wb") as file:
            np.savez(file, **arrays)
        self._saved = time.monotonic()

    def _resume(self) -> bool:
        """Go on with what an earlier program left, if it flew the same."""
        import numpy as np

        try:
            if (self.folder / "plan.json").read_text(encoding="utf-8") != self._plan:
                return False
            with np.load(self.folder / "state.npz") as state:
                notes: dict[str, Any] = json.loads(state["notes"].tobytes())
                self.done = np.unpackbits(state["done"], count=self.runs).astype(bool)
                for i, counts in enumerate(self.counts):
                    counts.keys, counts.counts = state[f"keys-{i}"], state[f"counts-{i}"]
                for name in state.files:
                    if name.startswith("line-"):
                        self.lines.setdefault(int(name.split("-")[1]), []).append(state[name])
        except (FileNotFoundError, ValueError):
            return False
        self.errors = {run: text for run, text in notes["errors"]}
        self.health = {run: [Finding(*row) for row in rows] for run, rows in notes["health"]}
        self.unhealthy = {(row[0], row[1]): (n, first, Finding(*row)) for n, first, row in notes["unhealthy"]}
        return True

    def close(self) -> None:
        """Delete the files of a campaign whose report is written. Beyond EXACT its rows stay, as rows.npy beside the
        report."""
        if not self.folder:
            return
        if not self.exact and self.finished:
            self._name(0).replace(self.folder.parent / "rows.npy")
        shutil.rmtree(self.folder)
