# SPDX-License-Identifier: Apache-2.0
"""Which ground stations of a mission see its spacecraft now, what its radio does, and the passes of the coming day.

The orbit of the moment is that of the simulation, or what navigation says in telemetry. Passes are predicted from it by
two bodies and J2: without other bodies, drag, thrust and finer gravity, so the farther the less exact.
"""
from __future__ import annotations

import math
from collections.abc import Callable
from threading import Lock
from time import monotonic
from typing import TYPE_CHECKING, Any, TypedDict

from fledge.ground.server.scene import Feed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fledge.mission.simulation import Simulation
    from fledge.world import GroundStation, Radio, Sky, Spacecraft
    from fledge.world.bodies import Body

    Array = NDArray[np.float64]

DAY = 86400.0           # [s] ahead
STEP = 10.0             # [s] between the times at which passes are looked for; shorter ones may be missed
AGAIN = 5.0             # [s] of real time from a prediction to the next
SPEED_OF_LIGHT = 299792458.0
WORDS = {"LOW": "below the mask", "HIDDEN": "hidden by a body", "WEAK": "too weak"}     # of RadioState, for some
LINK = ("range", "light_time", "elevation", "eb_n0_dB", "bit_error_rate")
TRAFFIC = ("bytes", "sent", "dropped", "lost", "received", "damaged", "waiting")


class Pass(TypedDict):
    """Over a station; times [s]. rise, set: None where they lie outside the predicted day."""
    station: str
    rise: float | None
    set: float | None
    highest: float
    elevation: float        # [rad] of then


class Station:
    """A ground station of the world: where it stands in the frame P of its body, and how that turns."""

    def __init__(self, path: str, station: GroundStation, craft: Spacecraft) -> None:
        from fledge.scene.derive import FLATTENING, place_on
        from fledge.world.bodies import equator

        self.path, self.name, self.mask, self.craft = path, path.partition(".")[2], float(station.mask), craft
        self._body, self._sky, self._spin = station.body, station.sky, float(station.spin)
        self._stands = equator(self._body.pole_N)
        self.place, self.up = place_on(self._body.radius, FLATTENING.get(self._body.name, 0.0), station.latitude,
                                       station.longitude, station.altitude)

    def direction(self, times: Array, r: Array) -> tuple[Array, Array]:
        """(elevation [rad], range [m]) of places r [m] (n, 3) in N at times [s] (n,)."""
        import numpy as np

        if self._sky:
            turned = np.array([self._sky.orientation(self._body, t).dcm_PN for t in times])
        else:
            c, s, o = np.cos(self._spin * times), np.sin(self._spin * times), 0 * times
            turned = np.stack([c, s, o, -s, c, o, o, o, o + 1], axis=1).reshape(-1, 3, 3) @ np.array(self._stands)
        way = np.einsum("nij,nj->ni", turned, r - origin(self._body, self._sky, times)[0]) - self.place
        distance = np.linalg.norm(way, axis=1)
        return np.arcsin(way @ self.up / distance), distance

    def passes(self, t: float, r: Array, v: Array) -> list[Pass]:
        """The passes from t [s] on for a day of a spacecraft at r [m], v [m/s] in N."""
        import numpy as np
        from scipy.optimize import brentq, minimize_scalar

        body, sky = self.craft.gravity[0], self.craft.sky
        at, speed = (rows[0] for rows in origin(body, sky, np.array([t])))
        pole = sky.orientation(body, t).dcm_PN[2] if sky and not body.pole_stays else np.array(body.pole_N)
        flight = orbit(body, pole, r - at, v - speed)
        times = np.append(np.arange(0.0, DAY, STEP), DAY)

        def over(after: float | Array) -> Array:
            after = np.atleast_1d(after)
            place = flight(after)[:3].T + origin(body, sky, t + after)[0]
            return self.direction(t + after, place)[0] - self.mask

        heights = over(times)
        cuts = [float(brentq(lambda x: over(x)[0], times[k], times[k + 1], xtol=1e-3))
                for k in np.flatnonzero(np.diff(heights > 0))]
        ends = ([None] if heights[0] > 0 else []) + cuts + ([None] if heights[-1] > 0 else [])
        predicted: list[Pass] = []
        for rise, end in zip(ends[::2], ends[1::2]):
            within = (0.0 if rise is None else rise, DAY if end is None else end)
            best = times[(inside := (times >= within[0]) & (times <= within[1]))]
            near = best[np.argmax(heights[inside])] if len(best) else sum(within) / 2
            top = minimize_scalar(lambda x: -over(x)[0], method="bounded", options={"xatol": 1e-2}, bounds=(
                max(within[0], near - STEP), min(within[1], near + STEP)))
            predicted.append({"station": self.name, "rise": None if rise is None else t + rise,
                              "set": None if end is None else t + end, "highest": t + float(top.x),
                              "elevation": self.mask - float(top.fun)})
        return predicted


def origin(body: Body, sky: Sky | None, times: Array) -> tuple[Array, Array]:
    """(r [m], v [m/s]), each (n, 3): of a body in N."""
    import numpy as np

    if sky and body.naif == sky.center:
        return np.zeros((len(times), 3)), np.zeros((len(times), 3))
    if sky:
        states = [sky.state(body, t) for t in times]
        return np.array([state.r_PN_N for state in states]), np.array([state.v_PN_N for state in states])
    return (np.array(body.r_PN_N) + np.outer(times, body.v_PN_N),
            np.tile(np.array(body.v_PN_N, dtype=float), (len(times), 1)))


def orbit(body: Body, pole: Array, r: Array, v: Array) -> Callable[[Array], Array]:
    """The motion (r, v) about a body in the coming day, as a function of the time from now [s]: by its mass, and by its
    J2 if the mission has more than its mass."""
    import numpy as np
    from scipy.integrate import solve_ivp

    from fledge.world import BODIES

    oblate = body.J[0] or (BODIES[body.name].zonal(2).J[0] if body.field is not None and body.name in BODIES else 0.0)
    factor = 1.5 * oblate * body.radius**2

    def rate(_: float, y: Array) -> Array:
        place = y[:3]
        square = float(place @ place)
        z = float(place @ pole)
        pull = -body.mu / (square * math.sqrt(square))
        return np.concatenate([y[3:], pull * ((1 + factor / square * (1 - 5 * z * z / square)) * place
                                              + 2 * factor / square * z * pole)])

    return solve_ivp(rate, (0.0, DAY), np.concatenate([r, v]), method="DOP853", rtol=1e-9, atol=1e-3,
                     dense_output=True).sol


class Contacts:
    """The stations and radios of a mission's world, and what the feed has of its spacecraft. radio: the name of that by
    which the server's packets pass, or "" """

    def __init__(self, feed: Feed, simulation: Simulation | None, radio: str = "") -> None:
        self._feed, self._used = feed, radio
        self._lock = Lock()
        self._predicted: tuple[float, list[Pass]] = (-math.inf, [])
        self.state: dict[str, Any] = {"stations": [], "radios": []}   #: the present state, for any thread
        self._states: dict[str, tuple[float, Array, Array]] = {}      # station -> t [s], r [m], v [m/s]
        self._stations: list[Station] = []
        self._radios: dict[str, tuple[str, Radio]] = {}             # radio -> its station, itself
        if simulation is None:
            return
        models: dict[str, Any] = {f"{process.name}.{name}": model for process in simulation.processes
                                  if process not in simulation.flights for name, model in process.instances.items()}
        facts = feed.facts
        for path in facts.all_of("GroundStation"):
            craft = models.get(facts.wires.get(f"{path}.truth", "").rpartition(".")[0])
            if path in models and models[path].body and craft is not None and craft.gravity:
                self._stations.append(Station(path, models[path], craft))
        self._radios = {path: (str(facts.of(path, "station", "")), models[path]) for path in facts.all_of("Radio")
                        if path in models}

    def poll(self) -> None:
        """Take the present state. Call it in the thread that has the link."""
        import numpy as np

        from fledge.world import RadioState

        if not self._stations and not self._radios:
            return
        newest = self._feed.newest("CraftState", "NavOrbit", "RadioLink", "RadioTraffic")
        # Of several orbits that flight says the newest, then the best, then the one that it prefers.
        preferred = self._feed.facts.preferred([name for name in newest if name in self._feed.flight_ports])
        by_navigation = max((newest[name] for name in preferred), default=None,
                            key=lambda sample: (sample[0], int(sample[1]["head"]["quality"])))
        stations, states = [], {}
        for station in self._stations:
            state = newest.get(self._feed.facts.wires[f"{station.path}.truth"])
            state = state or by_navigation
            if state is None:
                continue
            t, r, v = state[0], np.array(state[1]["r_BN_N"]), np.array(state[1]["v_BN_N"])
            states[station.path] = t, r, v
            elevation, distance = (float(found[0]) for found in station.direction(np.array([t]), r[None]))
            stations.append({"name": station.name, "elevation": elevation, "mask": station.mask, "range": distance,
                             "seen": elevation >= station.mask, "light_time": distance / SPEED_OF_LIGHT})
        radios = []
        for path, (place, radio) in self._radios.items():
            row: dict[str, Any] = {"name": path, "station": place.partition(".")[2],
                                   "carries": path.partition(".")[2] == self._used}
            for way in ("down", "up"):
                link, traffic = (newest.get(f"{path}.{way}{more}", (0, None))[1] for more in ("", "_traffic"))
                word = "" if link is None else RadioState(int(link["state"])).name
                row[way] = {"rate": getattr(radio, f"{way}_rate")} | (
                    {} if link is None else {"state": WORDS.get(word, word.lower()), "lock": bool(link["lock"])}
                    | {name: float(link[name]) for name in LINK}) | (
                    {} if traffic is None else {name: int(traffic[name]) for name in TRAFFIC})
            radios.append(row)
        with self._lock:
            self._states = states
        self.state = {"stations": stations, "radios": radios}

    def passes(self) -> list[Pass]:
        """Those of the coming day, of each station, soonest first; for all threads."""
        with self._lock:
            if monotonic() - self._predicted[0] > AGAIN:
                self._predicted = monotonic(), sorted(
                    (entry for station in self._stations if station.path in self._states
                     for entry in station.passes(*self._states[station.path])), key=lambda entry: entry["highest"])
            return self._predicted[1]
