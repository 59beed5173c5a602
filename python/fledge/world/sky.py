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
from fledge.errors import SetupError, suggesting
from fledge.objects.si import time_ns, to_number, to_si

if TYPE_CHECKING:
    from fledge.world.bodies import Body


# The exponents of the base units, as in fledge.units.
TIME = (0, 0, 1, 0, 0, 0, 0, 0)
ANGLE = (0, 0, 0, 0, 0, 0, 0, 1)

BodyAttitude = namedtuple("BodyAttitude", "dcm_PN omega_PN_P")
BodyAttitude.__doc__ = """The attitude of a body: P is fixed in it, with p3 along its pole and p1 in its prime meridian.

dcm_PN (3, 3) maps N to P; omega_PN_P [rad/s] (3,) is the rate of P relative to N, in P.
"""


@suggesting()
class EarthOrientation:
    """The orientation of the Earth, for Sky(earth=...): by a theory of the IAU and measurements of the IERS.

    eop: a file of the IERS, EOP 14 C04 or 20 C04 (with dX and dY): UT1 and polar motion, day by day.
    theory: "IAU 2006/2000A", or "IAU 1976/1980" to compare with older tools, without dX and dY and with N as the mean
        equator and equinox of J2000.
    ut1_tai: UT1 - TAI [s]; polar_motion: (x, y) [rad]. They replace those of the file. Without a file ut1_tai is
        required, and the pole does not move unless polar_motion is given.

    Raises SetupError on arguments of another kind. The Sky reads the file, and refuses a damaged one with its line.
    """

    def __init__(self, eop: str | PathLike[str] | None = None, *, theory: str = "IAU 2006/2000A", ut1_tai: Any = None,
                 polar_motion: Any = None) -> None:
        name = "EarthOrientation"
        if theory not in ("IAU 2006/2000A", "IAU 1976/1980"):
            raise SetupError(f'{name}: theory: expected "IAU 2006/2000A" or "IAU 1976/1980"; found {theory!r}')
        pole = None
        if polar_motion is not None:
            pole = to_si(polar_motion, f"{name}: polar_motion", "rad", ANGLE, "two angles")
            if not isinstance(pole, list) or len(pole) != 2:
                raise SetupError(f"{name}: polar_motion: expected two angles; found {polar_motion!r}")
        self.eop = None if eop is None else _path(eop, f"{name}: eop")
        self.theory, self.polar_motion = theory, pole
        self.ut1_tai = None if ut1_tai is None else to_number(ut1_tai, f"{name}: ut1_tai", "s", TIME)
        self._core = _core.EarthData(theory == "IAU 1976/1980", self.eop, self.ut1_tai, pole)


@suggesting()
class SpaceWeather:
    """The activity of the Sun and of the magnetic field, for EarthAtmosphere(weather=...).

    files: a file of indices, or several, in the forms of CelesTrak (SW-All.csv, SW-All.txt), GFZ
        (Kp_ap_Ap_SN_F107_since_1932.txt), NOAA (45-day-ap-forecast.txt; DSD.txt and DGD.txt together) or, of JB2008,
        SOLFSMY.TXT and DTCFILE.TXT; what several have is taken of the first.

    Raises SetupError, with file and line, for a form that is not known, a damaged line, days out of order or missing,
    and values out of range. An EarthAtmosphere refuses a run that the files do not cover, before the first step.
    """

    def __init__(self, files: str | PathLike[str] | Sequence[str | PathLike[str]]) -> None:
        listed = files if isinstance(files, (list, tuple)) else [files]
        self._core = _core.SpaceWeather([_path(file, "SpaceWeather: files") for file in listed])

    @classmethod
    def _of(cls, core: _core.SpaceWeather) -> SpaceWeather:
        weather = object.__new__(cls)
        weather._core = core
        return weather

    def __repr__(self) -> str:
        return f"<SpaceWeather of {self._core.files}>"


@suggesting(date="epoch", time="epoch", utc="epoch", body="center", kernel="kernels")
class Sky:
    """The solar system from an epoch on, which is the time 0 of the run; the run's clock counts TDB.

    epoch: "2015-03-02T12:00:00", in UTC unless " TDB", " TT", " TAI" or " GPS" follows.
    center: the body or barycentre in which N has its origin: world.MARS, "Mars", a NAIF number,
        world.SSB for the barycentre of the solar system. The axes of N are those of the ICRF (J2000).
    kernels: SPICE SPK files (.bsp); later ones have precedence. Without any: DE405, with Sun, planets and
        Moon from 1960 to 2060. "DE405" in the list puts it among the kernels.
    leap_seconds: a SPICE file (.tls), with all leap seconds before the dates that are asked for as UTC. None: those up
        to 2016-12-31.
    pck: a SPICE text file (.tpc) with the bodies' rotations. None: the constants of the IAU's report of 2000.
    earth: an EarthOrientation, in place of the Earth's constants, which are within 0.2 deg.
    moon: "mean Earth", by the constants, or "principal axes", by the librations of DE405, to which gravity fields of
        the Moon refer.

    Positions are geometric, without light time. For a planet that the ephemeris has only together with its
    moons (Jupiter in DE405), the Sky uses their barycentre; `assumptions` names such planets.

    Raises SetupError for an invalid epoch, an unknown body, files that are missing, damaged or of another
    kind, and an ephemeris without the center at the epoch.
    """

    def __init__(self, epoch: str, center: Body | str | int,
                 kernels: str | PathLike[str] | Sequence[str | PathLike[str]] = (), *,
                 leap_seconds: str | PathLike[str] | None = None, pck: str | PathLike[str] | None = None,
                 earth: EarthOrientation | None = None, moon: str = "mean Earth") -> None:
        if earth is not None and not isinstance(earth, EarthOrientation):
            raise SetupError(f"Sky: earth: expected world.EarthOrientation(...); found {earth!r}")
        if moon not in ("mean Earth", "principal axes"):
            raise SetupError(f'Sky: moon: expected "mean Earth" or "principal axes"; found {moon!r}')
        if not isinstance(epoch, str):
            raise SetupError(f'Sky: epoch: expected a text like "2015-03-02T12:00:00"; found {epoch!r}')
        listed = kernels if isinstance(kernels, (list, tuple)) else [kernels]
        files = [_path(k, "Sky: kernels") for k in listed] or ["DE405"]
        try:
            self._core = _core.Sky(epoch, number(center, "Sky: center"), files,
                                   None if leap_seconds is None else _path(leap_seconds, "Sky: leap_seconds"),
                                   None if pck is None else _path(pck, "Sky: pck"),
                                   None if earth is None else earth._core, moon == "principal axes")
        except SetupError as error:
            text = str(error)
            raise SetupError(text if text.startswith("Sky: ") else f"Sky: {text}") from None

    @classmethod
    def _of(cls, core: _core.Sky) -> Sky:
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
        """The attitude and rate of a body at a time of the run: BodyAttitude(dcm_PN, omega_PN_P).

        Raises SetupError for a body whose rotation is not known, and at a time that the data of `earth` or the Moon's
        librations do not cover.
        """
        from numpy import array

        dcm_PN, omega_PN_P = self._core.orientation(number(body, "Sky.orientation: body"),
                                                    time_ns(t, "Sky.orientation: t"))
        return BodyAttitude(array(dcm_PN), array(omega_PN_P))

    def equator(self, body: Body | str | int, t: Any = 0) -> Any:
        """The axes, in N, of a body's equator at a time of the run, as the rows of a (3, 3) array.

        For Orbit(frame=...). The third is along the body's pole, the first where its equator ascends over N's
        plane of the axes 1 and 2. For the Earth true_of_date() has the equinox in place of that node.
        """
        from numpy import array

        from fledge.world.bodies import equator

        return array(equator(self.orientation(body, t).dcm_PN[2]))

    def true_of_date(self, t: Any = 0) -> Any:
        """The axes, in N, of the Earth's true equator and equinox at a time of the run: the rows of a (3, 3) array."""
        from numpy import array

        return array(self._core.true_of_date(time_ns(t, "Sky.true_of_date: t")))

    def teme_of_date(self, t: Any = 0) -> Any:
        """The axes, in N, of the Earth's true equator and mean equinox, the frame TEME of two-line elements, at a time
        of the run: the rows of a (3, 3) array. By IAU 1976/1980."""
        from numpy import array

        return array(self._core.teme_of_date(time_ns(t, "Sky.teme_of_date: t")))

    def gps(self, t: Any = 0) -> tuple[int, float]:
        """The week and the seconds of GPS time at a time of the run; weeks count from 1980-01-06 and do not wrap."""
        week, rest = divmod(self._core.gps(time_ns(t, "Sky.gps: t")), 604_800 * 10**9)
        return week, rest / 1e9

    def utc(self, t: Any = 0) -> str:
        """The date and time in UTC at a time of the run, as text."""
        return self._core.text(time_ns(t, "Sky.utc: t"), "UTC")

    def utc_ns(self, t: Any = 0) -> int:
        """[ns] of UTC since 2000-01-01T12:00:00 at a time of the run, 86,400 s a day: as flight's clocks count."""
        from datetime import datetime

        text, _, part = self.utc(t).rstrip("Z").partition(".")
        whole = datetime.fromisoformat(text.replace(":60", ":59")) - datetime(2000, 1, 1, 12)   # a leap second repeats
        return (whole.days * 86400 + whole.seconds) * 10**9 + int(part.ljust(9, "0"))

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

    @classmethod
    def of_text(cls, text: str) -> Sky | None:
        """The sky that a record names as repr() does, with the default ephemeris; None if the text names none."""
        import re

        found = re.match(r"<?Sky from (\S+?)Z, N about .*\((-?\d+)\)", text)
        return cls(found[1], center=int(found[2])) if found else None

    def __repr__(self) -> str:
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


def _path(value: Any, path: str) -> str:
    if not isinstance(value, (str, PathLike)):
        raise SetupError(f"{path}: expected the path of a file; found {value!r}")
    return fspath(value)
