# SPDX-License-Identifier: Apache-2.0
"""A Scene from a record: from its messages, and from the parameters, types and wires that it holds."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from fledge.errors import SetupError
from fledge.records.activity import happenings, modes
from fledge.records.series import HEAD, NONE, Records, element_names, stale_after
from fledge.scene.scene import Craft, Direction, Part, Planet, Plot, Pose, RadioLink, Scene, Station
from fledge.scene.tracks import Motion, Signal, Turning

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from fledge import world

HAPPENINGS = 500    # on the time line
LONG, WIDE = 4.0, 1.6   # [-] largest length and radius of a cone, in extents of its spacecraft; half of it to keep out
DENSITY = 150.0     # [kg/m^3] of a spacecraft whose mass is not known
FLATTENING = {"EARTH": 1 / 298.257223563, "MARS": 1 - 3376.20 / 3396.19}     # WGS 84; of the IAU's report of 2000


class Facts:
    """What a record says of its run.

    title, about: of the page; parameters: path -> value in SI; types: path of an instance -> its type;
    wires: input -> output, or several; folder: of the mission, or None
    periods [s]: of the instances that a task runs, where they are known
    """

    def __init__(self, title: str, about: str, parameters: dict[str, Any], types: dict[str, str],
                 wires: dict[str, str], folder: Any, periods: dict[str, float] | None = None) -> None:
        self.title, self.about, self.folder = title, about, folder
        self.parameters, self.types, self.wires, self.periods = parameters, types, wires, periods

    def of(self, path: str, name: str, default: Any = None) -> Any:
        """A parameter of an instance."""
        return self.parameters.get(f"{path}.{name}", default)

    def all_of(self, *types: str) -> list[str]:
        """The paths of the instances of some types."""
        return [path for path, type_ in self.types.items() if type_ in types]

    def preferred(self, names: list[str]) -> list[str]:
        """Of outputs with the same meaning, those that no other of them is computed from, in flight's own order of
        preference: of an attitude and its correction the correction, of two that flight chooses from both."""
        into: dict[str, list[str]] = {}     # input -> the outputs of `names` that are wired to it
        for target, text in self.wires.items():
            sources = [word.partition(" (")[0] for word in text.split(", ")]
            into[target] = [source for source in sources if source in names]
        choices = [sources for sources in into.values() if len(sources) > 1]
        consumed = {source for target, sources in into.items() for source in sources for name in names
                    if name != source and name.rpartition(".")[0] == target.rpartition(".")[0]
                    and not any({name, source} <= {*sources} for sources in choices)}
        order = [source for sources in choices for source in sources] + names
        return sorted((name for name in names if name not in consumed), key=order.index)


def derive(records: Records, facts: Facts, plots_only: bool = False) -> Scene:
    """The Scene of a record. Raises SetupError if it has no attitude, unless plots_only."""
    derivation = Derivation(records, facts)
    if not plots_only:
        derivation.add_flight()
    derivation.add_plots()
    derivation.scene.modes = modes(records)
    derivation.scene.happened = [event for event in happenings(records) if event.kind != "mode"][:HAPPENINGS]
    return derivation.scene


class Derivation:
    """Derives a scene from records.

    live: the tracks of the scene can grow, by track.source(Derivation(later records, facts, live=True))
    used: the names of the ports whose messages the motions, attitudes and levels come from
    """

    def __init__(self, records: Any, facts: Facts, live: bool = False) -> None:
        self._records, self._facts, self._live = records, facts, live
        executives = [port.name for port in records.executives()]
        self._ports = {port.name: port for port in records._ports()
                       if port.names and port.name not in executives and (live or len(records._time(port)))}
        self.used: set[str] = set()
        self.scene = Scene(facts.title, facts.about)

    def _grows(self, make: Callable[[Derivation], Any]) -> Any:
        """The track that make(derivation) makes."""
        track = make(self)
        if self._live and track is not None:
            track.source = make
        return track

    def add_plots(self) -> None:
        self.scene.plots = [plot for name, port in self._ports.items() if not self._live or name in self.used
                            for plot in self._plots(port)]
        if not self.scene.crafts:
            times = [self._records._time(port) for port in self._ports.values()]
            self.scene.begin, self.scene.end = min(t[0] for t in times), max(t[-1] for t in times)

    def add_flight(self) -> None:
        records, scene = self._records, self.scene
        for path in self._of("CraftState"):
            scene.crafts.append(self._craft(path))
        if not scene.crafts:
            self._from_estimates()
        if len(scene.crafts) == 1:
            scene.crafts[0].label = self._facts.title
        if not scene.crafts:
            raise SetupError(f"{records._label}: no attitude is recorded, so there is nothing to show; "
                             f"{self._what_to_record()}")
        scene.begin = min(craft.turning.time[0] for craft in scene.crafts)
        scene.end = max(craft.turning.time[-1] for craft in scene.crafts)
        self._surroundings()
        self._stations()
        for craft in scene.crafts:
            self._fit_out(craft)
        if scene.sun is None and scene.sun_N is None:
            scene.notes.append("The record does not say where the Sun is: give the spacecraft a sky, or record the "
                               "direction to the Sun. The light comes from a fixed direction.")

    # --- recorded messages ---------------------------------------------------------------------------

    def _of(self, *types: str) -> list[str]:
        """The names of recorded ports with messages of some types."""
        return [name for name, port in self._ports.items() if port.type in types]

    def _rows(self, name: str, *fields: str) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """(messages of a port, whether each is the last of its instant, whether it was written, and is finite)"""
        import numpy as np

        self.used.add(name)
        table, last = self._records._values(self._ports[name]), self._last(name)
        good = (table["head"]["quality"] != NONE) & last
        for field in fields:
            good &= np.isfinite(table[field]).all(axis=tuple(range(1, table[field].ndim)))
        return table, last, good

    def _last(self, name: str) -> NDArray[Any]:
        """Whether each message of a port is the last of its instant."""
        import numpy as np

        time = self._records._time(self._ports[name])
        return np.append(np.diff(time) > 0, True)[:len(time)]

    def _values(self, name: str, *fields: str, gaps: bool = False) -> tuple[NDArray[Any], ...]:
        """(times [s], values of each field) of a port's messages that were written, the last one of each instant.

        gaps: with NaN for those that were not written and follow one that was
        """
        import numpy as np

        table, last, good = self._rows(name, *fields)
        chosen = last & np.logical_or.accumulate(good) if gaps and not self._live else last if self._live else good
        columns = [np.array(table[field][chosen], dtype=float) for field in fields]
        for column in columns:
            column[~good[chosen]] = np.nan
        return self._records._time(self._ports[name])[chosen], *columns

    def _stale_after(self, name: str, table: NDArray[Any]) -> float:
        """[s] The age at which messages of a port are stale. Without its task's period, by the shortest time between
        two messages that follow each other; messages that are written once do not age."""
        import numpy as np

        if self._facts.periods is not None:
            period = self._facts.periods.get(name.rpartition(".")[0])
            return math.inf if period is None else stale_after(period)
        apart, more = np.diff(table["head"]["t"]), np.diff(table["head"]["sequence"].astype(np.int64))
        on = (apart > 0) & (more > 0)
        return stale_after((apart[on] / more[on]).min() / 1e9) if on.any() else math.inf

    def _written(self, name: str, table: NDArray[Any]) -> NDArray[Any]:
        """[s] When each message of a port was written, if it was stale when it was recorded; else NaN."""
        import numpy as np

        t = table["head"]["t"] / 1e9
        old = self._records._time(self._ports[name]) - t > self._stale_after(name, table)
        return np.where(old & (table["head"]["quality"] != NONE), t, np.nan)

    def _newest(self, names: list[str], *fields: str, gaps: bool = True) -> tuple[NDArray[Any], ...]:
        """(times [s], values of each field, when they were written [s]) of outputs with the same meaning: at each time
        the newest message, of equally new ones the best, of equally good ones that of the first name. The last column
        is NaN where a value is not stale.

        gaps: with NaN for messages that were not written and follow one that was
        """
        import numpy as np

        outputs = []
        for name in names:
            table, last, good = self._rows(name, *fields)
            time, head = self._records._time(self._ports[name]), table["head"]
            columns = [np.array(table[field], dtype=float) for field in fields]
            outputs.append([column[last] for column in (time, good, head["t"] / 1e9, head["quality"],
                                                        self._written(name, table), *columns)])
        times = np.unique(np.concatenate([time for time, *_ in outputs]))
        if getattr(self._records, "single", False):
            times = times[-1:]
        best = (np.full(len(times), -np.inf), np.zeros(len(times)))     # time and quality
        chosen = [np.full((len(times), *column.shape[1:]), np.nan) for column in outputs[0][4:]]
        for time, good, t, quality, *columns in outputs:
            i = np.searchsorted(time, times, side="right") - 1
            has = (i >= 0) & (good[i] if len(good) else False)
            t, quality = (np.where(has, column[i], 0) if len(column) else np.zeros(len(times))
                          for column in (t, quality))
            better = has & ((t > best[0]) | (t == best[0]) & (quality > best[1]))
            best = np.where(better, t, best[0]), np.where(better, quality, best[1])
            for into, column in zip(chosen, columns):
                into[better] = column[i[better]]
        some = np.isfinite(best[0]) if not gaps else np.logical_or.accumulate(np.isfinite(best[0])) if (
            not self._live) else slice(None)
        written, *values = (column[some] for column in chosen)
        return times[some], *values, written

    def _aged(self, track: Any, written: NDArray[Any]) -> Any:
        """A track with the times when it was written, if a value is stale or the track grows."""
        import numpy as np

        if self._live or np.isfinite(written).any():
            track.written = written
        return track

    def _signal(self, name: str, field: str, element: int | None = None) -> Signal | None:
        """The Signal of a field or of an element of it; None if the port was not recorded."""
        if name not in self._ports:
            return None

        def make(source: Derivation) -> Signal:
            time, values = source._values(name, field, gaps=True)
            values = values.reshape(len(time), math.prod(values.shape[1:]))
            return Signal(time, values if element is None else values[:, [element]], read=True)

        signal = self._grows(make)
        return signal if self._live or len(signal.time) else None

    def _what_to_record(self) -> str:
        crafts = self._facts.all_of("Spacecraft")
        if crafts:
            return "record " + ", ".join(f"{path}.state" for path in crafts)
        return "record a CraftState, or a NavAttitude with a NavOrbit"

    # --- spacecraft ----------------------------------------------------------------------------------

    def _craft(self, name: str) -> Craft:
        def all_of(source: Derivation) -> tuple[NDArray[Any], ...]:
            return source._values(name, "r_BN_N", "v_BN_N", "sigma_BN")

        if not len(all_of(self)[0]):
            raise SetupError(f"{self._records._label}: {name} has no attitude that was written")
        path = name.rpartition(".")[0]
        several = [state.rpartition(".")[0] for state in self._of("CraftState")
                   if state.partition(".")[0] == path.partition(".")[0]]
        craft = Craft(path.partition(".")[0] if len(several) == 1 else path, path,
                      self._grows(lambda source: Motion(*all_of(source)[:3])),
                      self._grows(lambda source: Turning.of_mrp(*all_of(source)[::3])), self._facts.folder)
        rate = self._signal(name, "omega_BN_B")
        if rate:
            craft.signals["rate"] = rate
        return craft

    def _from_estimates(self) -> None:
        """Spacecraft by their navigation, in a record without the truth: that of a real spacecraft."""
        import numpy as np

        by_process: dict[str, list[str]] = {}
        for name in self._of("NavAttitude"):
            by_process.setdefault(name.partition(".")[0], []).append(name)
        for process, names in by_process.items():
            turning = self._turning(names, "sigma_BN", gaps=False)
            time = turning.time
            if not len(time):
                continue
            motion = self._estimated_motion(process)
            if motion is None:
                motion = Motion(time[[0]], np.zeros((1, 3)), np.zeros((1, 3)))
                self.scene.notes.append(f"No position of {process} is recorded: it stands at the origin. Record its "
                                        "NavOrbit.")
            path = self._facts.preferred(names)[0].rpartition(".")[0]
            self.scene.crafts.append(Craft(process, path, motion, turning, self._facts.folder))

    def _estimated_motion(self, process: str) -> Motion | None:
        """The motion by navigation of the orbit; None without it."""
        names = self._facts.preferred([name for name in self._of("NavOrbit") if name.partition(".")[0] == process])
        if not names:
            return None
        motion = self._grows(lambda source: Motion(*source._newest(names, "r_BN_N", "v_BN_N", gaps=False)[:3]))
        return motion if self._live or len(motion.time) else None

    def _turning(self, names: list[str], field: str, gaps: bool = True) -> Turning:
        """The Turning of a field with MRP, of outputs with the same meaning."""
        names = self._facts.preferred(names)

        def make(source: Derivation) -> Turning:
            time, sigma, written = source._newest(names, field, gaps=gaps)
            return source._aged(Turning.of_mrp(time, sigma), written)

        return self._grows(make)

    def _home(self, process: str) -> Craft | None:
        """The spacecraft that a process belongs to: the one whose world it commands, else the one whose world it reads;
        None if there are several or none."""
        crafts = {craft.process: craft for craft in self.scene.crafts}
        if process in crafts:
            return crafts[process]
        if len(crafts) == 1:
            return next(iter(crafts.values()))
        pairs = [(a.partition(".")[0], b.partition(".")[0]) for a, b in self._facts.wires.items()]
        for candidates in ({a for a, b in pairs if b == process}, {b for a, b in pairs if a == process}):
            if len(candidates & crafts.keys()) == 1:
                return crafts[(candidates & crafts.keys()).pop()]
        return None

    def _fit_out(self, craft: Craft) -> None:
        """Add its parts, sensors, estimates, references and directions."""
        facts = self._facts
        parts = [word for word in facts.of(craft.path, "parts", "").split("; ") if word]
        for path in parts:
            add = getattr(self, f"_add_{facts.types.get(path, '')}", None)
            if add:
                add(craft, path)
        for path in facts.all_of("StarTracker", "SunSensor", "CraftSensor", "CoarseSunSensors", "SolarArray"):
            if facts.wires.get(f"{path}.truth", f"{path.partition('.')[0]}.") in (
                    f"{craft.path}.state", f"{craft.process}."):
                getattr(self, f"_add_{facts.types[path]}")(craft, path)
        craft.parts.insert(0, Part("box", "hub", size=self._hub(craft)))
        for part in craft.parts:
            if part.kind == "cone" and not part.length:
                part.length = craft.extent * min(LONG, WIDE / math.tan(part.half_angle)) / (2 if part.keep_out else 1)
        if self._of("CraftState"):      # else the spacecraft itself is at its estimate
            self._add_pose(craft, "estimate", self._outputs_about(craft, "NavAttitude"), "sigma_BN")
        self._add_pose(craft, "reference", self._outputs_about(craft, "AttReference"), "sigma_RN")
        if errors := self._facts.preferred(self._outputs_about(craft, "AttError")):
            craft.signals["attitude error"] = self._angle(errors)
        for name in self._of("MagneticField"):
            if self._home(name.partition(".")[0]) is craft:
                craft.directions.append(Direction("magnetic field", self._unit(name, "B_N")))

    def _outputs_about(self, craft: Craft, kind: str) -> list[str]:
        """The outputs with messages of a type that belong to a spacecraft: those of flight, else those of its world."""
        names = [name for name in self._of(kind) if self._home(name.partition(".")[0]) is craft]
        return [name for name in names if name.partition(".")[0] != craft.process] or names

    def _add_pose(self, craft: Craft, kind: str, names: list[str], field: str) -> None:
        if not names:
            return
        turning = self._turning(names, field)
        if self._live or len(turning.time):
            motion = self._estimated_motion(names[0].partition(".")[0]) if kind == "estimate" else None
            craft.poses.append(Pose(kind, ", ".join(self._facts.preferred(names)), turning, motion))

    def _angle(self, names: list[str]) -> Signal:
        """[rad] The size of the attitude's error."""
        import numpy as np

        def make(source: Derivation) -> Signal:
            time, sigma, written = source._newest(names, "sigma_BR")
            angle = 4 * np.arctan(np.linalg.norm(sigma, axis=1, keepdims=True))
            return source._aged(Signal(time, angle, read=True), written)

        return self._grows(make)

    def _unit(self, name: str, field: str) -> Signal:
        import numpy as np

        def make(source: Derivation) -> Signal:
            time, values = source._values(name, field, gaps=True)
            size = np.linalg.norm(values, axis=1, keepdims=True)
            return Signal(time, values / np.where(size > 0, size, 1))

        return self._grows(make)

    def _hub(self, craft: Craft) -> list[float]:
        """[m] (3,) The edges of a uniform box with the spacecraft's inertia, within its thrusters."""
        import numpy as np

        inertia = np.array(self._facts.of(craft.path, "I_B", np.eye(3) * 10))
        moments = np.linalg.eigvalsh(inertia) if np.abs(inertia - np.diag(np.diag(inertia))).max() > 0.1 * \
            inertia.max() else np.diag(inertia)
        squares = np.maximum(6 * (moments.sum() - 2 * moments), 0.05 * moments.sum())   # edge^2 times the mass
        mass = self._facts.of(craft.path, "mass", 0) or (DENSITY**2 * squares.prod()) ** 0.2
        half = np.sqrt(squares / mass) / 2
        reach = [np.abs(np.array(part.at_B) / half).max() for part in craft.parts
                 if part.kind == "thruster" and any(part.at_B)]
        return (2 * half * min([1.0, *reach])).tolist()

    def _count(self, path: str, name: str) -> list[Any]:
        return self._facts.of(path, name) or []

    def _add_ReactionWheels(self, craft: Craft, path: str) -> None:
        import numpy as np

        axes, limits = self._count(path, "axes_B"), self._count(path, "Omega_max")
        for k, axis in enumerate(axes):
            level = self._signal(f"{path}.speeds", "Omega", k)
            at = (self._count(path, "r_WB_B") or [[0, 0, 0]] * len(axes))[k]
            full = limits[k] if limits else 0
            if not full and level and len(level.time) and (whole := self._signal(f"{path}.speeds", "Omega")):
                full = float(np.nanmax(np.abs(whole.values[:, :len(axes)])))
            craft.parts.append(Part("wheel", f"{path.partition('.')[2]} {k + 1}", at, _unit(axis), level=level,
                                    full=full))
        self._advise(f"{path}.speeds", "the wheels stand still")

    def _add_ControlMomentGyros(self, craft: Craft, path: str) -> None:
        for k, axis in enumerate(self._count(path, "spin_axes_B")):
            craft.parts.append(Part("wheel", f"{path.partition('.')[2]} {k + 1}", axis_B=_unit(axis),
                                    level=self._signal(f"{path}.speeds", "Omega", k),
                                    full=(self._count(path, "Omega_max") or [0] * 8)[k]))
        self._advise(f"{path}.speeds", "the gyros' wheels stand still")

    def _add_Thrusters(self, craft: Craft, path: str) -> None:
        places = self._count(path, "r_TB_B") or [[0, 0, 0]] * 8
        for k, (at, axis) in enumerate(zip(places, self._count(path, "axes_B"))):
            craft.parts.append(Part("thruster", f"{path.partition('.')[2]} {k + 1}", at, _unit(axis),
                                    level=self._signal(f"{path}.output", "thrust", k),
                                    full=self._count(path, "F")[k]))
        self._advise(f"{path}.output", "the thrusters have no plumes")

    def _add_TorqueRods(self, craft: Craft, path: str) -> None:
        for k, axis in enumerate(self._count(path, "axes_B")):
            craft.parts.append(Part("rod", f"{path.partition('.')[2]} {k + 1}", axis_B=_unit(axis),
                                    level=self._signal(f"{path}.applied", "dipole", k),
                                    full=(self._count(path, "m_max") or [0] * 8)[k]))

    def _add_HingedPanels(self, craft: Craft, path: str) -> None:
        import numpy as np

        for k, hinge in enumerate(self._count(path, "hinge_B")):
            centre = np.array((self._count(path, "center_B") or [[0, 0, 0]] * 8)[k], dtype=float)
            moments, frame = np.linalg.eigh(np.array(self._count(path, "I_B")[k], dtype=float))
            mass = self._count(path, "mass")[k]
            # A thin plate: the largest moment is about its normal, the sum of the other two.
            edges = np.sqrt(12 * np.maximum(moments[:2], 1e-9) / mass)[::-1]
            craft.parts.append(Part("panel", f"{path.partition('.')[2]} {k + 1}", (np.array(hinge) + centre).tolist(),
                                    frame[:, 2].tolist(), edges.tolist(), hinge_B=hinge,
                                    hinge_axis_B=_unit(self._count(path, "axes_B")[k]),
                                    level=self._signal(f"{path}.angles", "theta", k)))
        self._advise(f"{path}.angles", "the panels do not turn")

    def _add_StarTracker(self, craft: Craft, path: str) -> None:
        name, axis = path.partition(".")[2], _unit(self._facts.of(path, "boresight_B"))
        craft.parts.append(Part("cone", name, axis_B=axis, half_angle=0.14))
        exclusion = self._facts.of(path, "sun_exclusion", 0)
        if 0 < exclusion < 1.5:
            craft.parts.append(Part("cone", f"{name}, Sun", axis_B=axis, half_angle=exclusion, keep_out="Sun"))

    def _add_SunSensor(self, craft: Craft, path: str) -> None:
        self._view_cone(craft, path.partition(".")[2], self._facts.of(path, "boresight_B"),
                        self._facts.of(path, "view", 0))

    _add_CraftSensor = _add_SunSensor

    def _add_CoarseSunSensors(self, craft: Craft, path: str) -> None:
        for k, axis in enumerate(self._count(path, "axes_B")):
            self._view_cone(craft, f"{path.partition('.')[2]} {k + 1}", axis,
                            (self._count(path, "view") or [0] * 8)[k])

    def _view_cone(self, craft: Craft, name: str, axis: Sequence[float], view: Any) -> None:
        if axis is not None and any(axis) and 0 < view < 1.4:
            craft.parts.append(Part("cone", name, axis_B=_unit(axis), half_angle=view))

    def _add_SolarArray(self, craft: Craft, path: str) -> None:
        """A square wing for each panel, beside the spacecraft along the axis nearest to its plane, or about which a
        drive turns it."""
        import numpy as np

        sides: dict[int, int] = {}
        drive = self._facts.wires.get(f"{path}.angles", "")
        hinges = self._count(path, "axes_B") or [[0, 0, 0]] * 8
        for k, (normal, area) in enumerate(zip(self._count(path, "normals_B"), self._count(path, "areas"))):
            axis = _unit(normal)
            angle = self._signal(drive, "theta", k) if any(hinges[k]) else None
            along = int(np.argmin(np.abs(axis)) if angle is None else np.argmax(np.abs(hinges[k])))
            sides[along] = -sides.get(along, -1)
            edge = float(np.sqrt(area))
            at = np.zeros(3)
            at[along] = sides[along] * (0.6 + edge / 2)
            part = Part("panel", path.partition(".")[2], at.tolist(), axis, [edge, edge])
            if angle is not None:
                part.name += f" {k + 1}"
                part.hinge_B, part.hinge_axis_B, part.level = at.tolist(), _unit(hinges[k]), angle
            craft.parts.append(part)

    def _advise(self, port: str, without: str) -> None:
        if port not in self._ports:
            self.scene.notes.append(f"{port} is not recorded: {without}.")

    # --- surroundings --------------------------------------------------------------------------------

    def _surroundings(self) -> None:
        """The celestial bodies, and the Sun."""
        import numpy as np

        from fledge import world

        first = self.scene.crafts[0].path
        gravity = re.findall(r"(?:^|; )([A-Z][A-Z ]*), mu = (\S+) m\^3/s\^2, radius = (\S+) km",
                             self._facts.of(first, "gravity", "") or "")
        ephemeris = world.Sky.of_text(self._facts.of(first, "sky", "") or "")
        if not ephemeris:
            for name, mu, radius in gravity[:1]:    # at the origin of N
                self.scene.planets.append(Planet(name, float(radius) * 1e3, None, self._spinning(),
                                                 FLATTENING.get(name, 0.0), float(mu)))
            self._recorded_sun()
            return
        centre = ephemeris.center
        self.scene.epoch = ephemeris.utc().removesuffix("Z")
        wanted = [world.BODIES[name] for name, *_ in gravity if name in world.BODIES]
        wanted += [body for body in world.BODIES.values() if body.naif == centre]
        wanted += ([world.MOON] if centre == world.EARTH.naif else [])
        for body in dict.fromkeys([*wanted, world.SUN]):
            try:
                motion = self._moves(ephemeris, body) if body.naif != centre else None
            except SetupError:      # the mission has its own ephemeris of this body
                continue
            if body is world.SUN:
                self.scene.sun = motion or Motion(np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))
                if body not in wanted:
                    continue
            self.scene.planets.append(Planet(body.name, body.radius, motion, self._turns(ephemeris, body),
                                             FLATTENING.get(body.name, 0.0), body.mu))

    def _times(self) -> NDArray[Any]:
        """[s] The times of the bodies' tracks: over the span of the run; in a growing scene those of the spacecraft."""
        import numpy as np

        if self._live:
            return self._values(*([(name, "r_BN_N") for name in self._of("CraftState", "NavOrbit")][0]))[0]
        return np.linspace(self.scene.begin, self.scene.end,
                           1 + max(16, int((self.scene.end - self.scene.begin) / 3600)))

    def _moves(self, sky: world.Sky, body: world.Body) -> Motion:
        import numpy as np

        def make(source: Derivation) -> Motion:
            times = source._times()
            states = [sky.state(body, t) for t in times]
            return Motion(times, np.array([s.r_PN_N for s in states]).reshape(-1, 3),
                          np.array([s.v_PN_N for s in states]).reshape(-1, 3))

        return self._grows(make)

    def _turns(self, sky: world.Sky, body: world.Body) -> Turning | None:
        import numpy as np

        def make(source: Derivation) -> Turning:
            times = source._times()
            return Turning.of_dcm(times, np.array([sky.orientation(body, t).dcm_PN for t in times]).reshape(-1, 3, 3))

        try:
            return self._grows(make)
        except SetupError:
            return None

    def _spinning(self) -> Turning | None:
        """The turning of a body without a sky: about its third axis, at the `spin` of a station on it."""
        import numpy as np

        spin = max((self._facts.of(path, "spin", 0) for path in self._facts.all_of("GroundStation")), default=0)
        if not spin:
            return None

        def make(source: Derivation) -> Turning:
            half = spin * (times := source._times()) / 2
            return Turning(times, np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=1))

        return self._grows(make)

    def _stations(self) -> None:
        """The stations on the ground, one for each place, and their radios."""
        by_place: dict[tuple, Station] = {}
        of: dict[str, Station] = {}     # path -> its station
        for path in self._facts.all_of("GroundStation"):
            planet = str(self._facts.of(path, "body", "")).partition(",")[0]
            body = next((candidate for candidate in self.scene.planets if candidate.name == planet), None)
            if body is None:
                continue
            place, up = place_on(body.radius, body.flattening, *(
                self._facts.of(path, name, 0.0) for name in ("latitude", "longitude", "altitude")))
            of[path] = by_place.setdefault((planet, *place), Station(path.partition(".")[2], planet, place, up,
                                                                     self._facts.of(path, "mask", 0.0)))
        for path in self._facts.all_of("Radio"):
            station, craft = of.get(self._facts.of(path, "station", "")), self._home(path.partition(".")[0])
            if station and craft:
                station.links.append(RadioLink(path, craft.name, self._lock(f"{path}.down"), self._lock(f"{path}.up")))
                self._advise(f"{path}.down", "nothing says when the ground's receiver is locked")
        self.scene.stations = list(by_place.values())

    def _lock(self, name: str) -> Signal | None:
        """(locked, Eb/N0 [dB]) of a radio's link."""
        import numpy as np

        if name not in self._ports:
            return None

        def make(source: Derivation) -> Signal:
            time, lock, ratio = source._values(name, "lock", "eb_n0_dB", gaps=True)
            return Signal(time, np.stack([lock, ratio], axis=1))

        return self._grows(make)

    def _recorded_sun(self) -> None:
        """The Sun of a run without a sky: recorded by a model, or a parameter of a sensor."""
        import numpy as np

        for name in self._of("Illumination"):
            time, s_N = self._values(name, "s_N")
            if len(time):
                self.scene.sun = Motion(time, 1.495978707e11 * s_N, np.gradient(1.495978707e11 * s_N, time, axis=0)
                                        if len(time) > 1 else 0 * s_N)
                return
        for name in self._of("BodyState"):
            if str(self._facts.of(name.rpartition(".")[0], "body", "")).startswith("SUN"):
                self.scene.sun = Motion(*self._values(name, "r_PN_N", "v_PN_N"))
                return
        for path in self._facts.all_of("StarTracker", "SunSensor", "CoarseSunSensors"):
            s_N = self._facts.of(path, "s_N")
            if s_N and any(s_N):
                self.scene.sun_N = np.array(_unit(s_N))
                return

    # --- plots ---------------------------------------------------------------------------------------

    def _plots(self, port: Any) -> Iterator[Plot]:
        """A Plot of each numeric field of a port; of long arrays, the elements up to the last that is not always 0."""
        import numpy as np

        for name, about in port.fields.items():
            values = self._records._field(port, name)
            if name.startswith(HEAD) or values.dtype.kind not in "fiub":
                continue
            size = math.prod(values.shape[1:])
            used = size if size <= 3 or self._live else max(
                (k for k in range(size) if np.nan_to_num(values.reshape(-1, size)[:, k].astype(float)).any()),
                default=0) + 1

            def make(source: Derivation, name: str = name, size: int = size, used: int = min(used, 16)) -> Signal:
                of, last = source._ports[port.name], source._last(port.name)
                time, table = source._records._time(of)[last], source._records._values(of)
                flat = source._records._field(of, name).reshape(-1, size)[last].astype(float)
                signal = Signal(time, np.ascontiguousarray(flat[:, :used]))
                if "head" not in table.dtype.names:
                    return signal
                return source._aged(signal, source._written(port.name, table)[last])

            signal = self._grows(make)
            labels = element_names(port.parts[name])[:signal.values.shape[1]]
            meaning = about.meaning if hasattr(about, "meaning") else about.doc
            yield Plot(f"{port.name}.{name}", about.unit, meaning,
                       ["".join(label.partition("[")[1:]) for label in labels],
                       signal)


def place_on(radius: float, flattening: float, latitude: float, longitude: float, altitude: float
             ) -> tuple[list[float], list[float]]:
    """(place [m], zenith), each (3,) in a body's frame, of geodetic coordinates [rad, m] over an ellipsoid with an
    equatorial radius [m]."""
    up = [math.cos(latitude) * math.cos(longitude), math.cos(latitude) * math.sin(longitude), math.sin(latitude)]
    share = (1 - flattening) ** 2       # of the squares of the polar and the equatorial radius
    normal = radius / math.sqrt(up[0]**2 + up[1]**2 + share * up[2]**2)
    return [(normal + altitude) * up[0], (normal + altitude) * up[1], (share * normal + altitude) * up[2]], up


def _unit(axis: Iterable[float]) -> list[float]:
    size = sum(x * x for x in axis) ** 0.5
    return [x / size for x in axis]
