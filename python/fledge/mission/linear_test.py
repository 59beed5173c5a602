# SPDX-License-Identifier: Apache-2.0
"""Linear systems: margins and responses against closed forms."""

import copy
import pickle
import warnings

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import block_diag, expm

from fledge import SetupError
from fledge.mission.linear import Linear
from fledge.units import hour, kg, minute, s
from tests.circles import long_after


def of(numerator, denominator, dt=None, same=False):
    """A transfer function, from "u" to "y", or cut at one path."""
    A, B, C, D = signal.tf2ss(numerator, denominator)
    return Linear(A, B, C, D, dt, states=[f"x{i}" for i in range(len(A))], inputs=["u"], outputs=["u" if same else "y"])


@pytest.mark.parametrize("k", [0.5, 2, 20])
def test_three_lags(k):
    """L = k / (s (s + 1) (s + 2)): -1 at k = 6, at sqrt(2)."""
    margins = of([k], [1, 3, 2, 0]).margins()
    up, down = (margins.gain, margins.gain_at), (margins.gain_down, margins.gain_down_at)
    assert (up if k < 6 else down) == pytest.approx((6 / k, np.sqrt(2)))
    assert (down if k < 6 else up)[0] == pytest.approx(0 if k < 6 else np.inf)
    assert margins.stable == (k < 6)
    w = margins.phase_at
    assert w * np.hypot(w, 1) * np.hypot(w, 2) == pytest.approx(k)
    assert margins.phase == pytest.approx(np.pi / 2 - np.arctan(w) - np.arctan(w / 2))
    assert margins.delay == pytest.approx(margins.phase % (2 * np.pi) / w)


def test_a_double_integrator_with_rate():
    """L = (2 z w s + w^2) / s^2 with z = 1/2 has the textbook's 51.8 deg, and every gain is stable."""
    margins = of([1, 1], [1, 0, 0]).margins()
    at = np.sqrt((1 + np.sqrt(5)) / 2)
    assert margins.phase_at == pytest.approx(at) and margins.phase == pytest.approx(np.arctan(at))
    assert (margins.gain, margins.gain_down, margins.stable) == (np.inf, 0, True)
    # The nearest to -1 is where the sensitivity |s^2 / (s^2 + s + 1)| is largest.
    assert margins.modulus == pytest.approx(
        np.sqrt(3) / 2, rel=1e-6) and margins.modulus_at == pytest.approx(np.sqrt(2))


def test_a_late_integrator():
    """L = k / (z (z - 1)) is at its limit with k = 1, where z = (1 + i sqrt(3)) / 2."""
    margins = of([0.25], [1, -1, 0], dt=0.5).margins()
    assert margins.gain == pytest.approx(4) and margins.gain_at == pytest.approx(np.pi / 3 / 0.5)
    assert margins.stable and not of([1.01], [1, -1, 0], dt=0.5).margins().stable


def test_a_static_gain_may_be_the_limit():
    """L = -2 / (s + 1) in a loop with u = -y: unstable at rest, where L = -2."""
    margins = of([-2], [1, 1]).margins()
    assert margins.gain_down == pytest.approx(0.5) and margins.gain_down_at == 0 and not margins.stable


def test_the_limit_may_be_at_infinite_frequency():
    """L = 1/(s + 1) - 0.1 closed by u = -y has its pole at -(1.1 k + ...)/(1 - 0.1 k): away at k = 10."""
    lin = Linear([[-1.0]], [[1.0]], [[1.0]], [[-0.1]], states=["x"], inputs=["u"], outputs=["y"])
    margins = lin.margins(feedback=-1)
    assert (margins.gain, margins.gain_at, margins.stable) == (pytest.approx(10), np.inf, True)
    assert "gain          20 dB  at inf rad/s" in str(margins)
    # Torque to acceleration of a hub with a panel has (s^2 + 0.02 s + 1) / (s^2 + 0.04 s + 2): 1 without bound.
    margins = of([1, 0.02, 1], [1, 0.04, 2]).margins(feedback=1)
    assert (margins.gain, margins.gain_down) == (pytest.approx(2), 0) and margins.gain_at == 0    # L(0) = -1/2
    margins = of([-0.8, -0.02, -1], [1, 0.04, 2]).margins()
    assert (margins.gain, margins.gain_at) == (pytest.approx(1.25), np.inf)
    # The nearest to -1 may be there, too; and 1.5 + 1/(s + 1) withstands no delay.
    assert of([-0.5], [1]).margins().modulus == 0.5
    assert (of([1.5, 2.5], [1, 1]).margins().delay, of([1.5, 2.5], [1, 1]).margins().delay_at) == (0, np.inf)


@pytest.mark.parametrize("dead", [[[0, 1], [0, 0]], [[0, 1, 0], [0, 0, 1], [0, 0, 0]], [[0, 0.03], [-0.03, 0]], [[0]]])
@pytest.mark.parametrize("seen", [True, False])
def test_what_zeros_cancel_is_no_limit(dead, seen):
    """-2/(s + 1) and a pole pair at 0 that is not reached, or not seen, in states that mix both."""
    T = np.random.default_rng(1).normal(size=(1 + len(dead), 1 + len(dead)))
    A = np.linalg.solve(T, block_diag([[-1.0]], dead) @ T)
    reached, ones = np.eye(len(T), 1), np.ones((len(T), 1))
    B, C = np.linalg.solve(T, reached if seen else ones), -2 * (ones if seen else reached).T @ T
    margins = Linear(A, B, C, [[0.0]], states=[f"x{i}" for i in range(len(T))], inputs=["u"], outputs=["y"]).margins()
    assert (margins.gain_down, margins.gain_down_at, margins.gain) == (pytest.approx(0.5), 0, np.inf)
    assert len([mode for mode in margins.modes if mode.damping < 0]) == 1
    assert not of([1], [1, 0, 0]).margins().gain_down       # the limit everywhere is none


@pytest.mark.parametrize("pole", [1e-5, -1e-5, 1e-7])
def test_slow_growth_beside_a_fast_pole_is_growth(pole):
    for lin in (of([1], np.poly([pole, -1e5])),
                Linear(np.diag([pole, -1e5]), np.zeros((2, 0)), np.zeros((0, 2)), np.zeros((0, 0)), states=["a", "b"],
                       inputs=[], outputs=[])):
        assert lin.stable == (pole < 0)
        slow = next(mode for mode in lin.modes() if abs(mode.time) > 1)
        assert slow.time == pytest.approx(-1 / pole, rel=1e-2)
    step = Linear([[1 + 0.1 * pole]], [[0.0]], [[1.0]], [[0.0]], 0.1, states=["a"], inputs=["u"], outputs=["y"])
    assert step.stable == (pole < 0) and step.modes()[0].time == pytest.approx(-1 / pole, rel=1e-2)


def random_loop(rng, dt):
    """Real and swinging poles over four decades, in mixed states; some with D, and modes not reached or not seen."""
    blocks = []
    for _ in range(rng.integers(1, 5)):
        w, z = 10**rng.uniform(-2, 2), 10**rng.uniform(-2.5, 0)
        blocks.append([[[-w if rng.random() < 0.85 else w / 10]], [[-z * w, w], [-w, -z * w]],
                       [[0, 1], [0, -w]] if rng.random() < 0.3 else [[-2 * z * w, -w], [w, 0]]][rng.integers(3)])
    A = block_diag(*blocks)
    B, C = rng.normal(size=(len(A), 1)), rng.normal(size=(1, len(A))) * np.exp(rng.normal())
    dead = rng.integers(0, 3)
    A = block_diag(A, np.diag(-10**rng.uniform(-2, 1, dead) * rng.integers(0, 2, dead)))
    reached = rng.integers(2)
    B = np.vstack([B, (1 - reached) * rng.normal(size=(dead, 1))])
    C = np.hstack([C, reached * rng.normal(size=(1, dead))])
    T = np.linalg.qr(rng.normal(size=A.shape))[0]
    A, B, C, n = T @ A @ T.T, T @ B, C @ T.T, len(A)
    if dt:
        both = expm(dt * np.block([[A, B], [np.zeros((1, n + 1))]]))
        A, B = both[:n, :n], both[:n, n:]
    D = [[rng.choice([0, 0, rng.normal() / 2])]]
    return Linear(A, B, C, D, dt, states=[f"x{i}" for i in range(n)], inputs=["u"], outputs=["y"])


@pytest.mark.parametrize("seeds", long_after(1, [range(30), range(30, 100)], "70 loops more"))
@pytest.mark.parametrize("dt", [None, 0.1, 1.0])
def test_margins_of_random_loops_are_where_an_eigenvalue_of_the_closed_loop_leaves(dt, seeds):
    """For gains and phases: none within the margin, and some at it."""
    for seed in seeds:
        lin = random_loop(np.random.default_rng([seed, int(10 * (dt or 0))]), dt)
        margins = lin.margins()

        def growing(factors):
            """How many poles grow, for any of the factors."""
            k = np.atleast_1d(factors)[:, None, None]
            poles = np.linalg.eigvals(lin.A - k * (lin.B @ lin.C) / (1 + k * lin.D[0, 0]))
            least = 1e-10 + 1e-12 * abs(poles).max(axis=1, keepdims=True)
            return set(np.count_nonzero((poles.real if dt is None else abs(poles) - 1) > least, axis=1))

        now = growing(1)
        assert (now == {0}) == margins.stable, seed
        for limit, end in ((margins.gain, 1e3), (margins.gain_down, 1e-3)):
            inside = min(limit, end) if end > 1 else max(limit, end)
            assert growing(np.geomspace(1, inside, 60)[1:-1]) <= now, (seed, limit)
            beyond = inside * (1.0005 if end > 1 else 1 / 1.0005)
            assert (growing(beyond) == now) == (inside == end), (seed, limit)
        at = margins.phase
        inside = min(abs(at), np.pi)
        for sign in (-1, 1):
            assert growing(np.exp(sign * 1j * np.linspace(0, inside, 60)[1:-1])) <= now, (seed, at)
        if at < np.inf:
            assert growing(np.exp(-1j * 1.002 * at)) != now, (seed, at)


def test_a_loop_that_nothing_closes_has_no_crossing():
    with warnings.catch_warnings(action="error"):
        at = Linear([[-1.0]], [[0.0]], [[1.0]], [[0.0]], states=["x"], inputs=["u"], outputs=["y"]).margins()
    assert at.stable and at.gain == at.phase == at.delay == np.inf and at.modulus == 1


def test_the_sign_of_a_cut_loop():
    cut = of([-1], [1, 3, 2, 0], same=True)
    assert cut.margins() == of([1], [1, 3, 2, 0]).margins() == cut.margins(feedback=1)
    assert not cut.margins(feedback=-1).stable
    with pytest.raises(SetupError, match="feedback must be 1 or -1; found 3"):
        cut.margins(feedback=3)


def test_the_modes_of_an_oscillator_continuous_and_discrete():
    """z = 0.1, w = 2: it decays by e in 1 / (z w), in both states alike; beside it a mode that grows in 47 h."""
    A = np.zeros((3, 3))
    A[:2, :2], A[2, 2] = [[0, 1], [-4, -0.4]], 1 / (47 * 3600)
    names = ["angle", "rate", "drift"]
    for dt in (None, 0.1):
        step = A if dt is None else expm(A * dt)
        lin = Linear(step, np.zeros((3, 0)), np.zeros((0, 3)), np.zeros((0, 0)), dt, states=names, inputs=[],
                     outputs=[])
        slow, fast = lin.modes()
        assert slow.time == pytest.approx(-47 * 3600) and slow.damping == pytest.approx(-1) and not slow.pole.imag
        assert (fast.time, fast.omega, fast.damping) == pytest.approx((5, 2, 0.1)) and fast.pole.imag > 0
        assert next(iter(slow.states.items())) == ("drift", pytest.approx(1))
        assert fast.states["angle"] == pytest.approx(0.5) and fast.states["rate"] == pytest.approx(0.5)
        assert str(slow) == "grows by e in 47 h: drift 100%"
        assert str(fast) == "decays by e in 5 s, 2 rad/s, damping 0.1: angle 50%, rate 50%"
        assert not lin.stable and lin.stable(slower_than=46 * hour) and not lin.stable(slower_than=48 * hour)
        for wrong, text in ((0, "a time > 0"), (-1 * minute, "a time > 0"), (1 * kg, "stable: slower_than")):
            with pytest.raises(SetupError, match=text):
                lin.stable(slower_than=wrong)


def test_shares_do_not_depend_on_units_nor_on_poles_that_are_alike():
    A, T = np.array([[0, 1.0], [-4, -0.4]]), np.diag([1e-6, 1e6])
    for matrix in (A, np.linalg.inv(T) @ A @ T):
        mode, = Linear(matrix, np.zeros((2, 0)), np.zeros((0, 2)), np.zeros((0, 0)), states=["a", "b"], inputs=[],
                       outputs=[]).modes()
        assert list(mode.states.values()) == pytest.approx([0.5, 0.5])
    still = of([1], [1, 0, 0])
    assert still.stable and all(sum(mode.states.values()) == pytest.approx(1) for mode in still.modes())
    assert "neither grows nor decays: x" in str(still.modes()[0])


def test_a_loop_that_is_not_stable_says_what_grows_and_how_fast():
    """1 / (s - p) in a loop with the gain p - 1e-5: what is left grows in 1e5 s."""
    margins = of([0.5 - 1e-5], [1, -0.5]).margins()
    assert not margins.stable and margins.stable(slower_than=27 * hour) and not margins.stable(slower_than=28 * hour)
    assert margins.modes[0].time == pytest.approx(-1e5) and margins.stable == False     # noqa: E712
    assert str(margins).splitlines()[-2:] == ["the closed loop is NOT stable:", "  grows by e in 27.8 h: x0 100%"]
    late = of([1.01], [1, -1, 0], dt=0.5).margins()
    assert late.modes[0].omega == pytest.approx(np.pi / 3 / 0.5, rel=0.01) and len(late.modes) == 1
    # u = y with y = u + x has no solution.
    loop = Linear([[-1.0]], [[1.0]], [[1.0]], [[1.0]], states=["x"], inputs=["u"], outputs=["u"]).margins()
    assert not loop.stable and not loop.stable(slower_than=1 * s)


def test_steps():
    t, y = of([2], [1, 0.5]).step(10 * s, n=40)
    assert t[-1] == 10 and y[:, 0, 0] == pytest.approx(4 * (1 - np.exp(-0.5 * t)), abs=1e-12)
    t, y = of([1], [1, -0.5], dt=0.1).step(1)
    assert t == pytest.approx(np.arange(11) / 10) and y[:, 0, 0] == pytest.approx(2 * (1 - 0.5**np.arange(11)))
    for wrong in (0, -1, 0.01):
        with pytest.raises(SetupError, match="is no time, or shorter than the step of 0.1 s"):
            of([1], [1, -0.5], dt=0.1).step(wrong)


def test_a_badly_scaled_system_keeps_its_response():
    lin = of([1], [1, 0.2, 1])
    T = np.diag([1e-9, 1e9])
    other = Linear(np.linalg.inv(T) @ lin.A @ T, np.linalg.inv(T) @ lin.B, lin.C @ T, lin.D, states=lin.states,
                   inputs=lin.inputs, outputs=lin.outputs)
    w = np.geomspace(0.1, 10, 20)
    assert other.frequency(w)[:, 0, 0] == pytest.approx(1 / (1 - w**2 + 0.2j * w), rel=1e-9)


def test_channels_and_words():
    A = np.diag([-1.0, -2.0])
    lin = Linear(A, np.eye(2), np.eye(2), np.zeros((2, 2)), states=["a", "b"], inputs=["u", "v"], outputs=["x", "y"],
                 units={"u": "N m", "x": "rad/s"}, u0=np.array([1.0, 2.0]))
    channel = lin.channel("y", "v")
    assert (channel.inputs, channel.outputs, channel.u0.tolist()) == (["v"], ["y"], [2])
    assert channel.frequency(1.0)[0, 0, 0] == pytest.approx(1 / (2 + 1j))
    assert "input   0  u  N m" in repr(lin) and "continuous: 2 states" in repr(lin)
    for made in (pickle.loads(pickle.dumps(lin)), copy.deepcopy(lin)):
        assert made.inputs == lin.inputs and (made[0] == lin.A).all() and made.units == lin.units
    with pytest.raises(SetupError, match="there is no output 'z'; there are x, y"):
        lin.channel("z")
    with pytest.raises(SetupError, match="there is no input 2"):
        lin.channel(0, 2)
    text = str(lin.margins())
    assert text.splitlines()[0].split() == ["gain", "none"] and "the closed loop is stable" in text


def test_the_plot_shows_the_margins():
    figure = of([-1], [1, 3, 2, 0], same=True).plot()
    texts = [text.get_text() for axis in figure.axes for text in axis.texts]
    assert texts == ["gain margin 15.6 dB", "phase margin 53.4 deg"]
    assert not [text for axis in of([1], [1, 3, 2, 0]).plot().axes for text in axis.texts]
