# SPDX-License-Identifier: Apache-2.0
"""The solar system on a real date: positions and attitudes of the bodies, and scales of time.

    sky = world.Sky("2015-03-02T12:00:00", center=world.MARS)
    w.earth = world.CelestialBody(body=world.EARTH, sky=sky)
    w.craft = world.Spacecraft(..., sky=sky, gravity=[world.MARS, world.SUN, world.JUPITER])

docs/environment.md describes the models and their accuracy.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Sequence
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

from fledge import _core
from fledge.errors import SetupError
from fledge.objects.si import time_ns

if TYPE_CHECKING:
    from fledge.world.bodies import Body


BodyAttitude = namedtuple("BodyAttitude", "dcm_PN omega_PN_P")
BodyAttitude.__doc__ = """The attitude of a body: P is fixed in it, with p3 along its pole and p1 in its prime meridian.

dcm_PN (3, 3) maps N to P; omega_PN_P [rad/s] (3,) is the rate of P relative to N, in P.
"""


class Sky:
    """The solar system from an epoch on, which is the time 0 of the run; the run's clock counts TDB.

    epoch: "2015-03-02T12:00:00", in UTC unless " TDB", " TT" or " TAI" follows.
    center: the body or barycentre in which N has its origin: world.MARS, "Mars", a NAIF number,
        world.SSB for the barycentre of the solar system. The axes of N are those of the ICRF (J2000).
    kernels: SPICE SPK files (.bsp); later ones have precedence. Without any: DE405, with Sun, planets and
        Moon from 1960 to 2060. "DE405" in the list puts it among the kernels.
    leap_seconds: a SPICE file (.tls). None: the leap seconds up to 2016-12-31.
    pck: a SPICE text file (.tpc) with the bodies' rotations. None: the constants of the IAU's report of 2000.

    Positions are geometric, without light time. For a planet that the ephemeris has only together with its
    moons (Jupiter in DE405), the Sky uses their barycentre; `assumptions` names such planets.

    Raises SetupError for an invalid epoch, an unknown body, files that are missing, damaged or of another
    kind, and an ephemeris without the center at the epoch.
    """

    def __init__(self, epoch: str, center: Body | str | int,
                 kernels: str | PathLike[str] | Sequence[str | PathLike[str]] = (), *,
                 leap_seconds: str | PathLike[str] | None = None, pck: str | PathLike[str] | None = None) -> None:
        if not isinstance(epoch, str):
            raise SetupError(f'Sky: epoch: expected a text like "2015-03-02T12:00:00"; found {epoch!r}')
        listed = kernels if isinstance(kernels, (list, tuple)) else [kernels]
        files = [_path(k, "Sky: kernels") for k in listed] or ["DE405"]
        try:
            self._core = _core.Sky(epoch, number(center, "Sky: center"), files,
                                   None if leap_seconds is None else _path(leap_seconds, "Sky: leap_seconds"),
                                   None if pck is None else _path(pck, "Sky: pck"))
        except SetupError as error:
            text = str(error)
            raise SetupError(text if text.startswith("Sky: ") else f"Sky: {text}") from None

    @classmethod
    def _of(cls, core):
        sky = object.__new__(cls)
        sky._core = core
        return sky

    @property
    def center(self) -> int:
        """The NAIF number of the body in which N has its origin."""
        return self._core.center

    @property
    def bodies(self) -> list[str]:
        """All bodies that the ephemeris has, as texts: "MARS (499)"."""
        return [_core.body_name(n) for n in self._core.bodies]

    def state(self, body: Body | str | int, t: Any = 0, center: Body | str | int | None = None) -> Any:
        """A body's position, velocity and acceleration at a time of the run, as a BodyState message.

        center: the origin; None: N's origin. Axes of N. Raises SetupError if the ephemeris does not have the
        body at that time.
        """
        from fledge.flight import BodyState

        ns = time_ns(t, "Sky.state: t")
        r, v, a = self._core.state(number(body, "Sky.state: body"),
                                   self.center if center is None else number(center, "Sky.state: center"), ns)
        state = BodyState(r_PN_N=r, v_PN_N=v, a_PN_N=a)
        state.head.t, state.head.quality, state.head.sequence = ns, 3, 1
        return state

    def orientation(self, body: Body | str | int, t: Any = 0) -> BodyAttitude:
        """The attitude and rate of a body at a time of the run: BodyAttitude(dcm_PN, omega_PN_P)."""
        from numpy import array

        dcm_PN, omega_PN_P = self._core.orientation(number(body, "Sky.orientation: body"),
                                                    time_ns(t, "Sky.orientation: t"))
        return BodyAttitude(array(dcm_PN), array(omega_PN_P))

    def utc(self, t: Any = 0) -> str:
        """The date and time in UTC at a time of the run, as text."""
        return self._core.text(time_ns(t, "Sky.utc: t"), "UTC")

    def tdb(self, t: Any = 0) -> str:
        """The date and time in TDB at a time of the run, as text."""
        return self._core.text(time_ns(t, "Sky.tdb: t"), "TDB")

    def epoch_at(self, t: Any = 0) -> float:
        """Seconds of TDB past J2000 at a time of the run, which SPICE calls ephemeris time."""
        return self._core.seconds(time_ns(t, "Sky.epoch_at: t"))

    def time_of(self, date: str) -> float:
        """The time of the run [s] at a date, written like the epoch."""
        return self.time_ns_of(date) / 1e9

    def time_ns_of(self, date: str) -> int:
        """The time of the run at a date [ns]."""
        return self._core.time_of(date)

    def __repr__(self):
        return f"<Sky from {self.utc()}, N about {_core.body_name(self.center)}>"


def number(body: Any, path: str) -> int:
    """The NAIF number of a Body, a name or a number. Raises SetupError that lists the names."""
    if isinstance(body, int) and not isinstance(body, bool):
        return body
    if isinstance(body, str):
        try:
            return _core.body_id(body)
        except SetupError as error:
            raise SetupError(f"{path}: {error}") from None
    naif = getattr(body, "naif", None)
    if naif is None:
        raise SetupError(f"{path}: expected a body, such as world.MARS, a name or a NAIF number; found {body!r}")
    return naif


def _path(value, path):
    if not isinstance(value, (str, PathLike)):
        raise SetupError(f"{path}: expected the path of a file; found {value!r}")
    return fspath(value)
