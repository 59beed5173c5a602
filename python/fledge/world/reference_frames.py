# SPDX-License-Identifier: Apache-2.0
"""Reference frames by the names that CCSDS messages, SPICE kernels and STK files give them, as axes in a sky's N.

    dcm_FN, omega_FN_F = reference_frames.turning(sky, "ITRF2014", times)

ICRF, GCRF, EME2000 and J2000 have the axes of N: what differs between them is 0.02 arcsec, 0.8 m at 7,000 km.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError

if TYPE_CHECKING:
    import numpy as np

    from fledge.world.sky import Sky

OF_N = ("ICRF", "ICRF1", "ICRF2", "ICRF3", "GCRF", "GCRF1", "GCRF2", "GCRF3", "EME2000", "J2000")
TRUE_OF_DATE = ("TOD", "TOD_EARTH", "TRUE_OF_DATE", "TRUEOFDATE")
TEME = ("TEME", "TEMEOFDATE", "TEME_OF_DATE")
FIXED = ("ITRF", "ITRF1993", "ITRF1997", "ITRF2000", "ITRF2005", "ITRF2008", "ITRF2014", "ITRF2020", "ITRF-93",
         "ITRF-97", "ITRF93", "EARTH_FIXED", "FIXED")
KNOWN = "ICRF, GCRF, EME2000, J2000, TOD, TEME, ITRF... (with world.EarthOrientation), IAU_BODY"
STEP = 10 * 10**9     # [ns] over which the rate of a slow frame is taken


def is_known(frame: str) -> bool:
    """Whether turning() knows a frame by its name, if the sky has what it needs."""
    name = frame.upper().replace(" ", "")
    return name in OF_N + TRUE_OF_DATE + TEME + FIXED or name.startswith("IAU_")


def is_inertial(frame: str) -> bool:
    """Whether a frame has the axes of N."""
    return frame.upper().replace(" ", "") in OF_N


def turning(sky: Sky, frame: str, times: np.ndarray, where: str = "frame") -> tuple[np.ndarray, np.ndarray]:
    """The axes of a frame at times of the run.

    times: (n,) [ns] of the run. Returns dcm_FN (n, 3, 3), which maps N to the frame, and omega_FN_F (n, 3) [rad/s],
    its rate relative to N in its own axes. Raises SetupError, which begins with `where`, for a frame that is not known
    here, and where the sky does not say how a body turns.
    """
    import numpy as np

    name = frame.upper().replace(" ", "")
    if is_inertial(frame):
        return np.broadcast_to(np.eye(3), (len(times), 3, 3)), np.zeros((len(times), 3))
    axes: Any
    if name in TRUE_OF_DATE or name in TEME:
        axes = sky.true_of_date if name in TRUE_OF_DATE else sky.teme_of_date
        dcm = np.array([axes(_seconds(t)) for t in times]).reshape(-1, 3, 3)
        later = np.array([axes(_seconds(t + STEP)) for t in times]).reshape(-1, 3, 3)
        skew = (later - dcm) @ dcm.transpose(0, 2, 1) / (STEP / 1e9)        # d[FN]/dt = -[omega x][FN]
        return dcm, np.stack([skew[:, 1, 2], skew[:, 2, 0], skew[:, 0, 1]], axis=1)
    body = "EARTH" if name in FIXED else name.removeprefix("IAU_") if name.startswith("IAU_") else ""
    if not body:
        raise SetupError(f"{where}: expected a reference frame of {KNOWN}; found {frame}")
    try:
        found = [sky.orientation(body, _seconds(t)) for t in times]
    except SetupError as error:
        raise SetupError(f"{where}: {frame}: {error}") from None
    return (np.array([a.dcm_PN for a in found]).reshape(-1, 3, 3),
            np.array([a.omega_PN_P for a in found]).reshape(-1, 3))


def to_N(sky: Sky, frame: str, center: Any, times: np.ndarray, r: np.ndarray, v: np.ndarray,
         where: str = "frame") -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and velocities [m/s], (n, 3), of a frame about a center, as positions and velocities in N."""
    import numpy as np

    dcm_FN, omega = turning(sky, frame, times, where)
    about = origins(sky, center, times)
    v_F = v + np.cross(omega, r)
    return (np.einsum("nij,ni->nj", dcm_FN, r) + about[:, 0], np.einsum("nij,ni->nj", dcm_FN, v_F) + about[:, 1])


def from_N(sky: Sky, frame: str, center: Any, times: np.ndarray, r: np.ndarray, v: np.ndarray,
           where: str = "frame") -> tuple[np.ndarray, np.ndarray]:
    """The reverse of to_N()."""
    import numpy as np

    dcm_FN, omega = turning(sky, frame, times, where)
    about = origins(sky, center, times)
    r_F = np.einsum("nij,nj->ni", dcm_FN, r - about[:, 0])
    return r_F, np.einsum("nij,nj->ni", dcm_FN, v - about[:, 1]) - np.cross(omega, r_F)


def origins(sky: Sky, center: Any, times: np.ndarray) -> np.ndarray:
    """(n, 2, 3) Positions [m] and velocities [m/s] of a body in N at times of the run [ns] (n,)."""
    import numpy as np

    if center == sky.center:
        return np.zeros((len(times), 2, 3))
    states = (sky.state(center, _seconds(t)) for t in times)
    return np.array([[state.r_PN_N, state.v_PN_N] for state in states], float).reshape(-1, 2, 3)


def _seconds(ns: Any) -> Any:
    return int(ns) / 1e9
