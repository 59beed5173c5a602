# SPDX-License-Identifier: Apache-2.0
"""A recorded field over time, as plots need it."""

from dataclasses import dataclass
from typing import Any, Protocol


@dataclass
class Series:
    """The samples of a field of a Log or an Archive, with what is needed to label them.

    key: the name that was asked for; name: of the field, with the indices of an element, "sigma_BR[0]"
    port: the path of its message, "flight.tracking.error"
    time: (n,) [s]; values: (n, ...), in `unit`; shape: of one sample
    """

    key: str
    name: str
    port: str
    time: Any
    values: Any
    unit: str
    meaning: str

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.values.shape[1:])


class Source(Protocol):
    """A Log or an Archive."""

    def series(self, key: str) -> Series: ...
