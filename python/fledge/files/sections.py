# SPDX-License-Identifier: Apache-2.0
"""A message of CCSDS: segments of sections, each with values by keyword and, some, a table."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NoReturn

from fledge.errors import did_you_mean, listed
from fledge.files.kvn import refuse
from fledge.files.messages import TRIANGLE
from fledge.files.values import Clock

if TYPE_CHECKING:
    import numpy as np

Value = str | int | float


@dataclass
class Section:
    """A block of a message.

    name: that in messages.py, "META"; values: by keyword, texts, numbers [SI, rad] and times [ns], as values.Clock
    has them; columns: of its table, each of its shape (n,), by name; where, line: its place in the file.
    section["X"] is a value; it raises SetupError where there is none.
    """
    name: str
    values: dict[str, Value] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    where: str = "the message"
    line: int = 0

    def __getitem__(self, key: str) -> Any:
        if key not in self.values:
            self.refuse(f"{self.name} has no {key}{did_you_mean(key, self.values)} it has {listed(list(self.values))}")
        return self.values[key]

    def get(self, key: str, default: Any = None) -> Any:
        """A value by its keyword, or the default."""
        return self.values.get(key, default)

    def refuse(self, text: str) -> NoReturn:
        """Raise SetupError, with the place of the section."""
        refuse(self.where, self.line, text)

    def covariance(self) -> np.ndarray:
        """The covariance of position and velocity [m, s] of a block COVARIANCE: (6, 6), or up to (9, 9) with the
        ballistic terms of a conjunction. Raises SetupError if it is not positive semi-definite."""
        import numpy as np

        names = [key for key in TRIANGLE if key in self.values]
        size = int((8 * len(names) + 1) ** 0.5) // 2
        if not names or size * (size + 1) // 2 != len(names):
            self.refuse(f"{self.name} has no covariance; a block COVARIANCE of an OPM, OMM, OEM or CDM has")
        matrix = np.zeros((size, size))
        matrix[np.tril_indices(size)] = [self.values[name] for name in names]
        matrix += np.tril(matrix, -1).T
        self.require_positive(matrix)
        return matrix

    def require_positive(self, matrix: np.ndarray) -> None:
        """Raise SetupError for a covariance that is not positive semi-definite, to roundings of a printed one."""
        import numpy as np

        scale = np.sqrt(np.abs(np.diag(matrix)))
        scale[scale == 0] = 1
        least = float(np.linalg.eigvalsh(matrix / scale / scale[:, None])[0])
        if np.any(np.diag(matrix) < 0) or least < -1e-3:
            self.refuse("expected a covariance that is positive semi-definite; found the least eigenvalue "
                        f"{least:.3g} of its correlations: write another, or leave it out")


@dataclass
class Segment:
    """What a message says of an object over a time: its blocks in their order, META first."""
    sections: list[Section]

    @property
    def meta(self) -> Section:
        """Its block META."""
        return self.sections[0]

    def all(self, name: str) -> list[Section]:
        """The sections of a name; [] if there is none."""
        return [section for section in self.sections if section.name == name]

    def __getitem__(self, name: str) -> Section:
        """The first section of a name. Raises SetupError without."""
        found = self.all(name)
        if not found:
            names = list(dict.fromkeys(section.name for section in self.sections))
            self.meta.refuse(f"the segment has no {name}; it has {listed(names)}")
        return found[0]

    @property
    def clock(self) -> Clock:
        """The scale of its times; CDMs have UTC."""
        return Clock(self.meta.get("TIME_SYSTEM", "UTC"), self.meta.where, self.meta.line,
                     self.meta.get("EPOCH_TZERO", ""))


@dataclass
class Message:
    """A message. kind: "OEM"; version: "2.0"; front: HEADER and, of a CDM, RELATIVE."""
    kind: str
    version: str
    front: list[Section]
    segments: list[Segment]

    @property
    def header(self) -> Section:
        """Its block HEADER."""
        return self.front[0]

    @property
    def segment(self) -> Segment:
        """The only segment. Raises SetupError where there are several."""
        if len(self.segments) != 1:
            self.header.refuse(f"expected a single segment; found {len(self.segments)}: choose among .segments")
        return self.segments[0]

    def __getitem__(self, name: str) -> Section:
        """The first section of a name, of the front or of the only segment. Raises SetupError without, and where
        there are several segments."""
        found = [section for section in self.front if section.name == name]
        return found[0] if found else self.segment[name]
