# SPDX-License-Identifier: Apache-2.0
"""Linear systems as Simulation.linearize() gives them, for scipy.signal and python3-control as they are.

    lin = sim.linearize(["world.wheels.command.u[0]"], ["world.craft.state.omega_BN_B[0]"])
    scipy.signal.bode(lin), control.ss(*lin)        # (A, B, C, D), of a discrete one (A, B, C, D, dt)
    lin.poles(), lin.modes(), lin.margins(), lin.step(10)
"""
from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import inf, nan, pi
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fledge.columns import columns
from fledge.errors import SetupError, did_you_mean, listed

# Shares that tell a value from rounding: of what differences of a simulation leave in a slope; of the norm of a matrix,
# of an eigenvalue and of a rank or response.
SLOPE, ROUNDING, RANK = 1e-10, 2e-14, 1e-12

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray
    from scipy.signal import StateSpace

    from fledge.objects.si import Time

    Real = NDArray[np.float64]
    Complex = NDArray[np.complex128]


class Mode(NamedTuple):
    """One motion of a linear system: a pole, or two that are conjugate.

    pole: the eigenvalue, of two the one with imag >= 0: [1/s], or of the step of a discrete system
    time: [s] in which the mode changes by the factor e: < 0 if it grows, infinite if, to rounding, it does neither
    omega: [rad/s] |pole|, of a discrete system that of the continuous pole that steps so
    damping: the share -real / |pole| of it: 1 if the mode only decays, 0 if it only swings, < 0 if it grows
    states: path -> share of the mode that is in the state (participation factor), the largest first; they sum to 1
    """
    pole: complex
    time: float
    omega: float
    damping: float
    states: dict[str, float]

    def __str__(self) -> str:
        how = ("neither grows nor decays" if self.time == inf else
               f"{'grows' if self.damping < 0 else 'decays'} by e in {_duration(abs(self.time))}")
        swings = f", {self.omega:.3g} rad/s, damping {self.damping:.3g}" if self.pole.imag else ""
        return f"{how}{swings}: " + listed([f"{path} {share:.0%}" for path, share in [*self.states.items()][:4]
                                            if share >= 0.05])


class Stable:
    """Whether no mode grows, as a truth: `if margins.stable`; margins.stable(slower_than=...) accepts slow growth."""

    def __init__(self, modes: Sequence[Mode]) -> None:
        self._times = [-mode.time for mode in modes if mode.damping < 0]

    def __call__(self, slower_than: Time | None = None) -> bool:
        """Whether no mode grows by the factor e within a time. Raises SetupError unless that is a time > 0."""
        if slower_than is None:
            return bool(self)
        from fledge.objects.si import time_ns

        limit = time_ns(slower_than, "stable: slower_than")
        if limit <= 0:
            raise SetupError(f"stable: slower_than must be a time > 0, such as 10 * hour; found {slower_than!r}")
        return all(1e9 * time > limit for time in self._times)

    def __bool__(self) -> bool:
        return not self._times

    def __eq__(self, other: object) -> bool:
        return bool(self) == other

    def __hash__(self) -> int:
        return hash(bool(self))

    def __repr__(self) -> str:
        return repr(bool(self))


class Margins(NamedTuple):
    """How far a loop is from instability, for the loop gain L of 1 + L = 0. Infinite or NaN where there is none.

    gain: the smallest factor > 1 with which the loop is at its limit; gain_down: the largest < 1; phase [rad]: the
    smallest lag, or lead if negative, that brings it there; delay [s]; modulus: the least distance of L from -1.
    gain_at, gain_down_at, phase_at, delay_at, modulus_at [rad/s]: where.
    modes: of the closed loop, those that grow first, the fastest first.
    stable: whether none of them grows; of a loop that is not stable, the margins say how far it is from that.
    stable(slower_than=10 * hour): whether none grows by the factor e within that time.
    """
    gain: float
    gain_at: float
    gain_down: float
    gain_down_at: float
    phase: float
    phase_at: float
    delay: float
    delay_at: float
    modulus: float
    modulus_at: float
    modes: tuple[Mode, ...]

    @property
    def stable(self) -> Stable:
        """Whether no mode of the closed loop grows, as Linear.stable."""
        return Stable(self.modes)

    def __str__(self) -> str:
        def decibel(x: float) -> str:
            return f"{20 * np.log10(x):.4g} dB" if 0 < x < inf else "none"

        rows = [["gain", decibel(self.gain), f"at {self.gain_at:.4g} rad/s"],
                ["gain reduced", decibel(self.gain_down), f"at {self.gain_down_at:.4g} rad/s"],
                ["phase", f"{np.degrees(self.phase):.4g} deg", f"at {self.phase_at:.4g} rad/s"],
                ["delay", f"{self.delay:.4g} s", f"at {self.delay_at:.4g} rad/s"],
                ["modulus", f"{self.modulus:.4g}", f"at {self.modulus_at:.4g} rad/s"]]
        none = ("nan" in row[2] for row in rows)
        rows = [[row[0], "none", ""] if no else row for row, no in zip(rows, none)]
        growing = [f"  {mode}" for mode in self.modes if mode.damping < 0]
        return "\n".join([*columns(rows), "the closed loop is " + ("NOT stable:" if growing else "stable"), *growing])


class Linear(tuple[Any, ...]):
    """(A, B, C, D), or of a discrete system (A, B, C, D, dt), of deviations from a point of operation.

    Continuous: dx/dt = A x + B u; discrete: x(k+1) = A x(k) + B u(k); y = C x + D u.
    A, B, C, D: (n, n), (n, m), (p, n), (p, m); dt [s], None of a continuous system
    states, inputs, outputs: their paths; units: path -> unit, "-" if it has none
    x0, u0, y0: the point of operation; drift: there, dx/dt, or x(k+1) - x(k)
    notes: what a user should know, such as directions in which a slope depends on the sign
    """
    A: Real
    B: Real
    C: Real
    D: Real
    dt: float | None
    states: list[str]
    inputs: list[str]
    outputs: list[str]
    units: dict[str, str]
    x0: Real
    u0: Real
    y0: Real
    drift: Real
    notes: list[str]

    def __new__(cls, A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, dt: float | None = None, *,
                states: Sequence[str], inputs: Sequence[str], outputs: Sequence[str],
                units: dict[str, str] | None = None, x0: Real | None = None, u0: Real | None = None,
                y0: Real | None = None, drift: Real | None = None, notes: Sequence[str] = ()) -> Linear:
        matrices = [np.asarray(matrix, float) for matrix in (A, B, C, D)]
        self = super().__new__(cls, [*matrices, *([] if dt is None else [dt])])     # type: ignore[list-item]
        self.A, self.B, self.C, self.D = matrices
        self.dt, self.states, self.inputs, self.outputs = dt, list(states), list(inputs), list(outputs)
        self.units, self.notes = dict(units or {}), list(notes)
        self.x0, self.drift = (np.zeros(len(self.states)) if v is None else v for v in (x0, drift))
        self.u0 = np.zeros(len(self.inputs)) if u0 is None else u0
        self.y0 = np.zeros(len(self.outputs)) if y0 is None else y0
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.__dict__,)

    # --- parts ---

    def ss(self) -> StateSpace:
        """The same as a scipy.signal.StateSpace."""
        from scipy import signal

        return signal.StateSpace(self.A, self.B, self.C, self.D, **({} if self.dt is None else {"dt": self.dt}))

    def channel(self, output: str | int = 0, input: str | int = 0) -> Linear:
        """From one input to one output, by their paths or places. Raises SetupError on an unknown one."""
        i = _place(self.outputs, output, "output")
        j = _place(self.inputs, input, "input")
        return Linear(self.A, self.B[:, [j]], self.C[[i]], self.D[[i]][:, [j]], self.dt, states=self.states,
                      inputs=[self.inputs[j]], outputs=[self.outputs[i]], units=self.units, x0=self.x0,
                      u0=self.u0[[j]], y0=self.y0[[i]], drift=self.drift, notes=self.notes)

    # --- what it does ---

    def poles(self) -> Complex:
        """The eigenvalues of A, complex (n,), by magnitude: [1/s], or of the step of a discrete system."""
        found = np.linalg.eigvals(self.A)
        return found[np.lexsort((found.imag, abs(found)))]

    def modes(self) -> tuple[Mode, ...]:
        """What A does by itself: those that grow first, the fastest first, then the others, the slowest first."""
        return _modes(self.A, self.dt, self.states)

    @property
    def stable(self) -> Stable:
        """Whether no mode grows; stable(slower_than=10 * hour): whether none grows by the factor e within that time."""
        return Stable(self.modes())

    def frequency(self, omega: ArrayLike) -> Complex:
        """The complex response (k, p, m) at frequencies (k,) [rad/s], of a discrete system up to pi / dt."""
        at = np.atleast_1d(np.asarray(omega, float))
        points = 1j * at if self.dt is None else np.exp(1j * at * self.dt)
        n = len(self.states)
        if not n:
            return np.broadcast_to(self.D.astype(complex), (len(at), *self.D.shape))
        # In units in which the elements of A are alike: positions [m] stand beside attitudes.
        from scipy.linalg import matrix_balance

        A, T = matrix_balance(self.A, permute=False)
        B, C = np.linalg.solve(T, self.B), self.C @ T
        return np.concatenate([C @ np.linalg.solve(some[:, None, None] * np.eye(n) - A, B[None]) + self.D
                               for some in np.array_split(points, len(points) // 256 + 1)])

    def step(self, duration: Time, n: int = 500) -> tuple[Real, Real]:
        """(times [s], outputs (times, p, m)) after a step of 1 of each input by itself. duration: a time.

        Of a continuous system, n + 1 times; of a discrete one, its own. The values are exact at these times. Raises
        SetupError if the duration is not > 0, or shorter than the step of a discrete system.
        """
        from scipy.linalg import expm

        from fledge.objects.si import time_ns

        span = time_ns(duration, "step: duration") / 1e9
        m, size = len(self.inputs), len(self.states)
        if self.dt is None:
            dt = span / n
            both = expm(dt * np.block([[self.A, self.B], [np.zeros((m, size + m))]]))
            A, B = both[:size, :size], both[:size, size:]
        else:
            dt, n, A, B = self.dt, int(span / self.dt + 1e-9), self.A, self.B
        if n < 1 or span <= 0:
            raise SetupError(f"step: {span:g} s is no time, or shorter than the step of {dt:g} s")
        x, samples = np.zeros((size, m)), []
        for _ in range(n + 1):
            samples.append(self.C @ x + self.D)
            x = A @ x + B
        return dt * np.arange(n + 1), np.array(samples)

    def margins(self, output: str | int = 0, input: str | int = 0, feedback: int | None = None) -> Margins:
        """The margins of the loop that this input and output leave open.

        feedback: 1 if the loop is closed by u = y, -1 by u = -y; not given: 1 where both have the same path, which is
        how a loop is cut, else -1. Raises SetupError on unknown paths, and on another feedback.
        """
        lin = self.channel(output, input)
        sign = feedback or (1 if lin.inputs == lin.outputs else -1)
        if sign not in (1, -1):
            raise SetupError(f"margins: feedback must be 1 or -1; found {feedback!r}")
        modes = _modes(_closed(lin, sign), lin.dt, lin.states)
        part = _minimal(lin)
        grid = _grid(part, np.concatenate([_zeros(part), _eigenvalues(_closed(part, sign))]))
        # At its ends the response is real.
        return _margins(_loop(part, -sign), grid, [0.0, inf if lin.dt is None else pi / lin.dt], modes)

    def plot(self, output: str | int = 0, input: str | int = 0, margins: bool | None = None) -> Figure:
        """A Bode plot of one channel as a matplotlib Figure: magnitude and phase by frequency.

        margins: show those of the loop; not given: where the loop was cut, the same path at both ends. Raises
        SetupError on unknown paths.
        """
        import matplotlib.pyplot as plt

        from fledge.plot import STYLE

        lin = self.channel(output, input)
        cut = lin.inputs == lin.outputs
        at = lin.margins() if (cut if margins is None else margins) else None
        part = _minimal(lin)
        grid = _grid(part, _zeros(part))[:-1]       # at its end, a discrete response jumps
        response = part.frequency(grid)[:, 0, 0] * (-1 if cut else 1)
        with plt.style.context(STYLE):
            figure, (size, phase) = plt.subplots(2, sharex=True, figsize=(7, 5), constrained_layout=True)
            size.loglog(grid, abs(response))
            phase.semilogx(grid, np.degrees(np.unwrap(np.angle(response))))
            size.set_ylabel("gain" + (f" [{unit}]" if (unit := self._ratio(lin)) else ""))
            phase.set_ylabel("phase [deg]")
            phase.set_xlabel("frequency [rad/s]")
            size.set_title(f"loop cut at {lin.inputs[0]}" if cut else f"{lin.inputs[0]} to {lin.outputs[0]}")
            if at:
                size.axhline(1, linewidth=0.8, color="0.6")
                for axis, where, text in (
                        (size, at.gain_at, f"gain margin {20 * np.log10(at.gain):.3g} dB" if at.gain < inf else ""),
                        (phase, at.phase_at, f"phase margin {np.degrees(at.phase):.3g} deg")):
                    if where == where and text:
                        axis.axvline(where, linewidth=0.8, color="0.6", linestyle="--")
                        left = where**2 > grid[0] * grid[-1]    # of the line there is more room
                        axis.annotate(text, (where, 1), xycoords=("data", "axes fraction"),
                                      xytext=(-5 if left else 5, -5), ha="right" if left else "left",
                                      textcoords="offset points", va="top", fontsize="small")
        return figure

    def _ratio(self, lin: Linear) -> str:
        into, out = (self.units.get(path, "") for path in (lin.inputs[0], lin.outputs[0]))
        return "" if into == out else f"{out or '-'} per {into or '-'}"

    def __repr__(self) -> str:
        kind = "continuous" if self.dt is None else f"discrete, every {self.dt:g} s"
        rows = [[word, str(i), name, self.units.get(name, "")]
                for word, names in (("state", self.states), ("input", self.inputs), ("output", self.outputs))
                for i, name in enumerate(names)]
        return "\n".join([f"linear system, {kind}: {len(self.states)} states, {len(self.inputs)} inputs, "
                          f"{len(self.outputs)} outputs", *columns(rows, indent="  "),
                          *(f"  note: {note}" for note in self.notes)])


def _again(values: dict[str, Any]) -> Linear:
    matrices = ("A", "B", "C", "D", "dt")
    return Linear(*(values[name] for name in matrices),
                  **{name: value for name, value in values.items() if name not in matrices})


def _place(names: Sequence[str], which: str | int, word: str) -> int:
    if isinstance(which, int) and -len(names) <= which < len(names):
        return which % len(names)
    if which in names:
        return names.index(which)
    near = did_you_mean(which, names) if isinstance(which, str) else ";"
    raise SetupError(f"there is no {word} {which!r}{near} there are {listed(names)}")


def _modes(A: Real, dt: float | None, states: Sequence[str]) -> tuple[Mode, ...]:
    """The modes of a matrix; of one that is not finite, that of a loop that has no solution."""
    from scipy.linalg import eig, matrix_balance

    if not np.isfinite(A).all():
        return (Mode(complex(inf), -0.0, inf, -1.0, {}),)
    if not len(A):
        return ()
    # In units in which the elements of A are alike: shares of a mode do not depend on units.
    A = matrix_balance(A, permute=False)[0]
    poles, left, right = eig(A, left=True)
    shares = abs(left * right)
    alone = abs(right)**2       # poles that are alike may have one motion, in which left and right share nothing
    shares = np.where(shares.sum(axis=0) > 1e-6, shares, alone)
    shares = shares / shares.sum(axis=0)
    with np.errstate(divide="ignore"):
        rates = poles if dt is None else np.log(poles) / dt
    # To rounding, modes that a loop does not reach may neither grow nor decay. A pole moves, at first order, by this
    # share of the elements of A that it depends on, and by rounding within eig().
    alike = np.maximum(abs((left.conj() * right).sum(axis=0)), np.sqrt(SLOPE))
    rounding = (SLOPE * (abs(left) * (abs(A) @ abs(right))).sum(axis=0) + ROUNDING * np.linalg.norm(A)) / alike
    still = abs(poles.real if dt is None else abs(poles) - 1) <= rounding
    modes = []
    for pole, rate, zero, share in zip(poles, rates, still, shares.T):
        if pole.imag < 0:
            continue
        real, omega = (0.0 if zero else float(rate.real)), float(abs(rate))
        time = inf if real == 0 else -1 / real
        damping = 0.0 if real == 0 else 1.0 if real == -inf else -real / omega
        order = np.argsort(-share, kind="stable")
        modes.append(Mode(complex(pole), time, omega, damping, {states[i]: float(share[i]) for i in order}))
    return tuple(sorted(modes, key=lambda mode: (mode.time >= 0, -mode.time)))


def _eigenvalues(A: Real) -> Complex:
    """Of a matrix that is not finite, none."""
    return np.linalg.eigvals(A).astype(complex) if np.isfinite(A).all() else np.empty(0, complex)


def _closed(lin: Linear, sign: int) -> Real:
    """A of the loop closed by u = sign y, NaN where that has no solution."""
    d = 1 - sign * lin.D[0, 0]
    return lin.A + sign * (lin.B @ lin.C) / d if d else np.full_like(lin.A, nan)


def _minimal(lin: Linear) -> Linear:
    """A channel without what its input does not reach or its output does not see: poles that zeros cancel."""
    from scipy.linalg import matrix_balance

    n = len(lin.states)
    # In units in which the elements of A, B and C are alike.
    both = matrix_balance(np.block([[lin.A, lin.B], [lin.C, np.zeros((1, 1))]]), permute=False)[0]
    A, B, C = both[:n, :n], both[:n, n:], both[n:, :n]
    for find in (_krylov, _reached):
        for _ in range(2):      # what the input reaches; of the transposed system, what the output sees
            kept = find(A, B[:, 0])
            A, B, C = kept.T @ A.T @ kept, kept.T @ C.T, B.T @ kept
    return Linear(A, B, C, lin.D, lin.dt, states=[f"x{i}" for i in range(len(A))], inputs=lin.inputs,
                  outputs=lin.outputs)


def _krylov(A: Real, b: Real) -> Real:
    """A base of what b reaches, by b, A b, A^2 b, ...: also where poles that it does not reach are alike."""
    span, new, least = np.empty((len(A), 0)), b, 0.0
    while span.shape[1] < len(A) and np.linalg.norm(new) > least:
        span = np.column_stack([span, new / np.linalg.norm(new)])
        new = A @ span[:, -1]
        for _ in range(2):      # a second time for what rounding left
            new = new - span @ (span.T @ new)
        least = RANK * float(np.linalg.norm(A))
    return span if span.shape[1] < len(A) else np.eye(len(A))


def _reached(A: Real, b: Real) -> Real:
    """A base of what b reaches, normal to the left eigenvectors that are normal to b: also after many states."""
    from scipy.linalg import eig, null_space

    left = eig(A, left=True, right=False)[1] if len(A) else A
    dead = left[:, abs(left.conj().T @ b) <= SLOPE * (abs(left).T @ abs(b))]
    return null_space(np.vstack([dead.real.T, dead.imag.T]), rcond=1e-6) if dead.size else np.eye(len(A))


def _zeros(lin: Linear) -> Complex:
    """The finite zeros of one channel."""
    from scipy.linalg import eigvals

    n = len(lin.states)
    found = eigvals(np.block([[lin.A, lin.B], [lin.C, lin.D]]), np.diag([1.0] * n + [0.0]))
    return found[np.isfinite(found)]


def _duration(t: float) -> str:
    """47.2 h, 3.1 s"""
    scales = (86400 * 365.25, "years"), (86400, "days"), (3600, "h"), (60, "min"), (1, "s")
    size, unit = next(scale for scale in scales if t >= 2 * scale[0] or scale[0] == 1)
    return f"{t / size:.3g} {unit}"


def _grid(lin: Linear, more: ArrayLike) -> Real:
    """Frequencies [rad/s] from well below all that happens to well above, denser about lightly damped poles."""
    poles = np.concatenate([lin.poles(), np.atleast_1d(more)])
    top = inf
    if lin.dt is not None:
        with np.errstate(divide="ignore"):
            poles, top = np.log(poles[poles != 0] + 0j) / lin.dt, pi / lin.dt
    poles = poles[np.isfinite(poles)]
    sizes = abs(poles)
    sizes = sizes[(sizes > 1e-9) & (sizes < 1e9)]
    low, high = (sizes.min() / 100, min(sizes.max() * 100, top)) if len(sizes) else (1e-3, min(1e3, top))
    low = min(low, high / 1e4)
    grid = [np.geomspace(low, high, 1500)]
    for p in poles[abs(poles.imag) > 5 * abs(poles.real)]:
        width = np.geomspace(1e-3, 30, 40) * max(abs(p.real), 1e-6 * abs(p))
        grid += [abs(p.imag) + width, abs(p.imag) - width]
    whole = np.unique(np.concatenate(grid))
    return whole[(whole >= low) & (whole <= high)]


def _loop(lin: Linear, sign: int) -> Callable[[ArrayLike], tuple[Complex, Real]]:
    """The response of one channel times a sign, and what rounding may have made of it; NaN at a pole."""
    def response(omega: ArrayLike) -> tuple[Complex, Real]:
        at = np.atleast_1d(np.asarray(omega, float))
        found, unsure = np.empty(len(at), complex), np.empty(len(at))
        for i in range(0, len(at), 256):
            part = slice(i, i + 256)
            finite = np.isfinite(at[part])
            w = np.where(finite, at[part], 1 + np.linalg.norm(lin.A))
            points = (1j * w if lin.dt is None else np.exp(1j * w * lin.dt))[:, None, None]
            M = points * np.eye(len(lin.A)) - lin.A
            try:
                x, y = np.linalg.solve(M, lin.B[None]), np.linalg.solve(M.transpose(0, 2, 1), lin.C.T[None])
            except np.linalg.LinAlgError:
                found[part] = unsure[part] = nan
                for k in range(i, i + len(w)) if len(w) > 1 else ():
                    found[k:k + 1], unsure[k:k + 1] = response(at[k])
                continue
            size = abs(y).transpose(0, 2, 1) @ (abs(lin.A) @ abs(x) + abs(points) * abs(x))
            found[part] = sign * (np.where(finite, (lin.C @ x)[:, 0, 0], 0) + lin.D[0, 0])
            unsure[part] = RANK * (np.where(finite, size[:, 0, 0].real, 0) + abs(lin.D[0, 0]))
        return found, unsure

    return response


def _margins(loop: Callable[[ArrayLike], tuple[Complex, Real]], grid: Real, ends: list[float],
             modes: tuple[Mode, ...]) -> Margins:
    from scipy.optimize import brentq, minimize_scalar

    values, unsure = loop(grid)

    def crossings(of: Callable[[Complex], NDArray[Any]]) -> list[float]:
        """Where a real function of L passes through zero, and not through a pole."""
        sizes = of(values)
        sure = np.flatnonzero(abs(sizes) > unsure)
        pairs = [(i, k) for i, k in zip(sure, sure[1:]) if sizes[i] * sizes[k] < 0]
        at = [brentq(lambda w: float(of(loop(w)[0])[0]), grid[i], grid[k], rtol=1e-13) for i, k in pairs]
        return [w for w in at for L, error in [loop(w)] if abs(of(L)[0]) < 1e-4 * abs(L[0]) and error[0] < abs(L[0])]

    def best(pairs: list[tuple[float, float]], key: Callable[[tuple[float, float]], float]) -> tuple[float, float]:
        return min(pairs, key=key, default=(nan, nan))

    def at(w: float) -> complex:
        return complex(loop(w)[0][0])

    def end(w: float) -> complex:
        """L at an end; where rounding has left a pole at rest, what L comes to before it; NaN where it grows."""
        (L,), (error,) = loop(w)
        if w == 0 and not error < abs(L):
            (L,), (error,) = loop(grid[0] / 100)
            L = L.real if abs(L - values[0]) < 0.1 * abs(L) else nan
        return complex(L) if error < abs(L) else complex(nan)

    sure = [(w, L) for w in ends for L in [end(w)] if L == L]
    through = [(w, L) for w, L in [*((w, at(w)) for w in crossings(np.imag)), *sure] if L.real < 0]
    gains = [(1 / abs(L), float(w)) for w, L in through]
    phases = [(float(np.angle(-at(w))), float(w)) for w in crossings(lambda L: abs(L) - 1)]
    delays = [((p % (2 * pi)) / w, w) for p, w in phases]
    if ends[-1] == inf and abs(at(inf)) > 1:    # of the fast waves in such a loop, none decays after any delay
        delays.append((0.0, inf))
    i = int(np.nanargmin(abs(1 + values)))
    near = minimize_scalar(lambda w: abs(1 + at(w)), bounds=(grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)]),
                           method="bounded", options={"xatol": 1e-12})
    up = best([margin for margin in gains if margin[0] > 1], lambda margin: margin[0])
    down = best([margin for margin in gains if margin[0] < 1], lambda margin: -margin[0])
    phase, delay = best(phases, lambda margin: abs(margin[0])), best(delays, lambda margin: margin[0])
    modulus = best([(float(near.fun), float(near.x)), *((abs(1 + L), w) for w, L in sure)], lambda margin: margin[0])
    gain, lag, time = (inf if x != x else float(x) for x in (up[0], phase[0], delay[0]))
    reduced = 0.0 if down[0] != down[0] else down[0]
    return Margins(gain, up[1], reduced, down[1], lag, phase[1], time, delay[1], *modulus, modes)
