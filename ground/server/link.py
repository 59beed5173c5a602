# SPDX-License-Identifier: Apache-2.0
"""The link of one spacecraft: it is opened, and opened again when it broke."""
from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from fledge.commands import Timed
from fledge.errors import SetupError
from fledge.ground import connect
from fledge.ground.scripts.address import open_link
from fledge.ground.scripts.craft import Craft
from fledge.ground.scripts.framed import Framed
from fledge.ground.scripts.links import Link, Streams

if TYPE_CHECKING:
    from fledge.ground.server.clock import Clock
    from fledge.ground.server.mission import LoadedMission
    from fledge.ground.server.run_control import RunControl
    from fledge.ground.server.settings import CraftSettings

TURN = 20_000_000       # [ns] of a link's clock that one turn of the thread waits
AGAIN = 1.0             # [s] until a link that broke is opened again


class Connection:
    """For the spacecraft's own thread; others may read its state.

    mission: that is commanded by the link, or None; flown: the server flies it, so that its simulation is the link
    control: of the run in which the spacecraft flies, or None
    """

    def __init__(self, settings: CraftSettings, clock: Clock, mission: LoadedMission | None, flown: bool,
                 control: RunControl | None) -> None:
        self.state = "not started"              #: in words
        self.link: Link | None = None           #: None: it is down
        self.craft: Craft | None = None         #: of a mission of Fledge: its commands, reports and files
        self.opening = False                    #: it is being opened, which may take long
        self._settings, self._clock, self._mission, self._flown = settings, clock, mission, flown
        self._control = control
        self._retry = 0.0

    @property
    def silent(self) -> str:
        """Why nothing can be sent now; empty: it can."""
        if self.link is None:
            return f"the link is down: {self.state}"
        # Reports of what flight repeats must not be taken for answers to what is sent now.
        return self._control.repeats(self._clock.now / 1e9) if self._control else ""

    @property
    def due(self) -> bool:
        """Whether it is to be opened now."""
        return self.link is None and time.monotonic() >= self._retry

    @property
    def carrier(self) -> Link | None:
        """The link of the moment, without the frames that it may speak."""
        link = self.link        # another thread may lose it meanwhile
        return link.link if isinstance(link, Framed) else link

    @property
    def clients(self) -> int:
        """How many programs are connected to a link that listens."""
        carrier = self.carrier
        return carrier.clients if isinstance(carrier, Streams) else 0

    def open(self) -> bool:
        """Open it; returns whether it was open before. Raises OSError or SetupError."""
        settings, before = self._settings, self.craft
        self.opening = True
        try:
            if self._mission is None:
                self.link = open_link(settings.link)
            else:
                sim = self._mission.simulation
                radio = getattr(sim.world, settings.radio) if settings.radio else None
                craft = connect(sim, process=settings.process, radio=radio, keys=settings.keys, role=settings.role) \
                    if self._flown else connect(settings.link, self._mission.dictionary, keys=settings.keys,
                                                role=settings.role)
                self.link, self.craft = craft.link, before or craft
                self.craft.link = craft.link
        finally:
            self.opening = False
        self.state = "up"
        if settings.link.startswith("cosim:") and (carrier := self.carrier):
            carrier.wait = TURN / 1e9
        return before is not None

    def broke(self, why: str) -> bool:
        """It is gone, or cannot be opened; returns whether that is new."""
        # A simulation that has failed does not go on.
        self._retry = float("inf") if self._flown else time.monotonic() + AGAIN
        new = self.link is not None or self.state != why
        if self.link is not None:
            with suppress(Exception):
                self.link.close()
        self.link, self.state = None, why
        return new

    def reach(self) -> Craft:
        """The spacecraft, to command it and its services. Raises SetupError if nothing can be sent now, or if it is of
        no mission of Fledge."""
        if self.craft is None or self.silent:
            name = self._settings.name
            raise SetupError(f"{name}: {self.silent}" if self._mission else
                             f"{name} is no mission of Fledge: its files, tables and stored commands are not known")
        return self.craft

    def receive(self, until: int) -> list[Timed]:
        """The packets that arrive next, [] when the link's clock [ns] reaches `until`. Raises OSError."""
        assert self.link is not None
        return self.craft.receive(until) if self.craft else self.link.receive(until)

    def gaps(self) -> list[tuple[int, int, str]]:
        """As Link.gaps()."""
        carrier = self.carrier
        return carrier.gaps() if carrier else []

    def damages(self) -> list[str]:
        """As Link.damages()."""
        return self.link.damages() if self.link else []

    def close(self) -> None:
        if self.craft:
            self.craft.__exit__()
        elif self.link:
            self.link.close()
        self.craft = self.link = None

    def describe(self) -> dict[str, Any]:
        """The state for browsers."""
        link, craft = self.link, self.craft
        state: dict[str, Any] = {"address": self._settings.link, "state": self.state, "up": link is not None}
        if link is not None:
            state |= {"skipped": link.skipped, "dropped": link.dropped}
        if isinstance(link, Framed):
            state |= link.counts | {"cop1": link.cop1}
        return state | ({"refused": craft.refused} if craft else {})
