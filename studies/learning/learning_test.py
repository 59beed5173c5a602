# SPDX-License-Identifier: Apache-2.0
"""The conventions of Gymnasium: what its checker demands, and the rules of autoreset."""
import enum
import importlib.util
import sys
from types import ModuleType

import numpy as np
import pytest

import fledge
from fledge import SetupError
from fledge.mission import learning
from fledge.mission.learning import Box, Env, VectorEnv
from fledge.requirements import after, always, implies, never
from fledge.requirements.declared import Declaration, signal
from fledge.units import minute, s

ERROR, RATE, TORQUE = "flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B", "flight.motor.command.u[:4]"


def reward(before, action, after):
    return -np.sum(after[ERROR]**2, axis=1) - np.sum(action[TORQUE]**2, axis=1) + 0 * before[RATE][:, 0]


ARGUMENTS = dict(actions=[TORQUE], observations=[ERROR, RATE], every=0.5 * s, reward=reward, low=-0.2, high=0.2)


@pytest.fixture(scope="module")
def sim():
    return fledge.load("nadir_spin")


def vector(sim, n=3, **options):
    return VectorEnv(sim, n, **{**ARGUMENTS, **options})


def test_one_environment_keeps_the_conventions(sim):
    env = Env(sim, **ARGUMENTS, limit=2 * s)
    seen, info = env.reset(seed=4, options={})
    assert seen in env.observation_space and isinstance(info, dict) and env.unwrapped is env
    ends = []
    for _ in range(4):
        action = env.action_space.sample()
        assert action in env.action_space
        seen, gain, terminated, truncated, info = env.step(action)
        assert seen in env.observation_space and seen.dtype == env.observation_space.dtype
        assert type(gain) is float and type(terminated) is type(truncated) is bool and isinstance(info, dict)
        ends.append((terminated, truncated))
    assert ends == [(False, False)] * 3 + [(False, True)]
    with pytest.raises(SetupError, match=r"reset\(\) first: these episodes have ended: 0"):
        env.step(action)
    env.reset()
    assert env.step(action)[4]["time"] == 0.5 and info["run"] == 0
    env.close()


def test_the_same_seed_gives_the_same_episode_and_no_seed_the_next_one(sim):
    noisy = sim.clone()
    noisy.world.nav.attitude_noise = [1e-3] * 3
    env = Env(noisy, **ARGUMENTS)
    first = env.reset(seed=1)[0]
    other = env.reset()[0]
    assert (first != other).any()
    np.testing.assert_array_equal(env.reset(seed=1)[0], first)
    np.testing.assert_array_equal(env.reset()[0], other)
    assert (env.reset(seed=2)[0] != first).any()
    # A list of seeds gives each of many what one alone has with it.
    many = vector(noisy).reset(seed=[5, 1, 2])[0]
    np.testing.assert_array_equal(many[1], first)
    np.testing.assert_array_equal(many[2], env.reset(seed=2)[0])


def test_many_are_one_each(sim):
    envs, single = vector(sim), Env(sim, **ARGUMENTS)
    seen, _ = envs.reset(seed=0)
    assert seen in envs.observation_space and envs.num_envs == 3
    assert envs.single_action_space == single.action_space and envs.observation_space.shape == (3, 6)
    single.reset(seed=0)
    actions = np.array([[0.1], [0.0], [-0.1]]) * np.ones(4)
    for _ in range(5):
        seen, gains, terminated, truncated, info = envs.step(actions)
        alone = single.step(actions[2])
    np.testing.assert_array_equal(seen[2], alone[0])
    assert gains[2] == alone[1] and gains.shape == terminated.shape == truncated.shape == (3,)
    assert gains.dtype == float and terminated.dtype == truncated.dtype == bool


def test_the_reward_is_of_what_was_before_done_and_after(sim):
    calls = []

    def recorded(before, action, after):
        calls.append((before, action, after))
        return np.zeros(2)

    envs = vector(sim, 2, reward=recorded)
    first, _ = envs.reset()
    actions = np.full((2, 4), 0.05)
    second = envs.step(actions)[0]
    before, action, after = calls[0]
    np.testing.assert_array_equal(before[ERROR], first[:, :3])
    np.testing.assert_array_equal(action[TORQUE], actions)
    np.testing.assert_array_equal(after[RATE], second[:, 3:])


def ended(after):
    """The first of them, always."""
    return np.arange(len(after[ERROR])) == 0


def test_an_episode_that_ends_begins_anew_in_the_same_step(sim):
    envs = vector(sim, terminated=ended, limit=1 * s)
    first, _ = envs.reset(seed=0)
    zero = np.zeros((3, 4))
    seen, _, terminated, truncated, info = envs.step(zero)
    assert getattr(envs.metadata["autoreset_mode"], "value", envs.metadata["autoreset_mode"]) == "SameStep"
    assert terminated.tolist() == [True, False, False] and not truncated.any()
    np.testing.assert_array_equal(seen[0], first[0])        # nothing is drawn: its next run begins as the first
    assert info["_final_obs"].tolist() == [True, False, False] and (info["final_obs"][0] != first[0]).any()
    np.testing.assert_array_equal(info["final_obs"][0], envs.step(zero)[4]["final_obs"][0])
    assert envs.batch.runs.tolist() == [6, 4, 5], "the others have come to their limit"


def test_an_episode_that_ends_begins_anew_in_the_next_step(sim):
    envs = vector(sim, terminated=ended, autoreset="NextStep")
    first, _ = envs.reset(seed=0)
    zero = np.zeros((3, 4))
    seen, gains, terminated, _, info = envs.step(zero)
    assert terminated[0] and "final_obs" not in info and gains[0] < 0
    last = seen[0]
    seen, gains, terminated, truncated, _ = envs.step(zero)
    np.testing.assert_array_equal(seen[0], first[0])
    assert gains[0] == 0 and not terminated[0] and not truncated[0] and gains[1] < 0
    np.testing.assert_array_equal(envs.step(zero)[0][0], last)


@pytest.mark.parametrize("action", [TORQUE, "flight.control.torque.torque_B"])
def test_an_episode_ends_where_a_requirement_is_violated(action):
    """Also where a step ends inside of the instant that violates it."""
    late = fledge.load("nadir_spin")
    error = signal(late, "flight.tracking.error.sigma_BR").norm()
    zero = np.zeros((3, 4 if action == TORQUE else 3))
    envs = vector(late, actions=[action], terminated=always(implies(after(3 * s), error < 0.7)), autoreset="Disabled",
                  reward=lambda b, a, c: np.minimum(c["formula 1"], 1))
    envs.reset(seed=0)
    sizes = []
    for _ in range(8):
        seen, gains, terminated, truncated, info = envs.step(zero)
        sizes.append(np.linalg.norm(seen[0, :3]))
        if terminated.any():
            break
    assert terminated.all() and not truncated.any() and len(sizes) == 6, "after 3 s"
    assert gains[0] == pytest.approx(0.7 - sizes[-1], abs=1e-12) and gains[0] < 0
    assert info["violated"][0].startswith("formula 1 violated, by ") and "at 3 s" in info["violated"][0]
    again, _ = envs.reset(seed=0)
    assert np.isfinite(again).all() and not envs.step(zero)[2].any()


def test_an_action_that_violates_a_requirement_ends_its_own_step(sim):
    small = signal(sim, "flight.motor.command.u").max_abs() < 0.15
    for delay in (0, 2):
        envs = vector(sim, actions=["flight.control.torque.torque_B"], terminated=always(small), autoreset="Disabled",
                      delay=delay, reward=lambda before, action, after: np.zeros(3))
        envs.reset()
        ends = []
        for k in range(6):
            actions = np.zeros((3, 3))
            actions[1] = 5.0 * (k == 2)
            ends.append(envs.step(actions)[2].tolist())
            if any(ends[-1]):
                break
        assert ends == [[False] * 3] * (2 + delay) + [[False, True, False]]


def test_margins_of_requirements_are_those_of_a_run_alone(sim):
    env = Env(sim, [TORQUE], [ERROR], every=0.5 * s, terminated=["PNT-1", "WHL-1"], reward=lambda b, a, c: c["WHL-1"])
    env.reset(seed=0)
    gains = [env.step(np.full(4, 0.01 * k))[1] for k in range(3)]
    assert len(set(gains)) == 1 and gains[0] > 0, "nothing counts before three minutes"
    with pytest.raises(SetupError, match="WHL-2 is shown by inspection, not by a run"):
        vector(sim, terminated="WHL-2")
    with pytest.raises(SetupError, match="there is no requirement 'PNT-9'; did you mean"):
        vector(sim, terminated="PNT-9")
    with pytest.raises(SetupError, match="expected a function, an id of a requirement or a formula; found 3"):
        vector(sim, terminated=[3])


@pytest.mark.parametrize("what, name", [("command", "telemetry"), ("packet", "flight.tracking.error")])
def test_an_episode_ends_by_what_flight_executes_and_sends(what, name):
    own = fledge.load("nadir_spin")
    commands = own.flight.commands
    commands.script([(1_100_000_000, commands.packets.telemetry("flight.tracking.error"))])
    envs = vector(own, autoreset="Disabled", terminated=never(getattr(Declaration(own), what)("flight", name)))
    for _ in range(2):
        envs.reset()
        ends = [envs.step(np.zeros((3, 4)))[2].tolist() for _ in range(3)]
        assert ends == [[False] * 3] * 2 + [[True] * 3]


def test_some_are_reset_by_a_mask(sim):
    envs = vector(sim, autoreset="Disabled", terminated=ended)
    envs.reset(seed=0)
    envs.step(np.zeros((3, 4)))
    with pytest.raises(SetupError, match="these episodes have ended: 0"):
        envs.step(np.zeros((3, 4)))
    _, info = envs.reset(options={"reset_mask": np.array([True, False, False])})
    assert info["time"].tolist() == [0.0, 0.5, 0.5] and info["run"].tolist() == [3, 1, 2]


def test_a_failure_ends_its_episode_alone(sim):
    gain = "flight.control.K"
    envs = VectorEnv(sim, 2, [gain], [ERROR], every=0.5 * s, reward=lambda b, a, after: after[ERROR].sum(axis=1),
                     failed=-100.0)
    envs.reset(seed=0)
    seen, gains, terminated, _, info = envs.step([[1.0], [-1.0]])
    assert terminated.tolist() == [False, True] and gains[1] == -100 and np.isfinite(seen).all()
    assert info["_failure"].tolist() == [False, True] and "flight.control.K must be > 0" in info["failure"][1]
    assert np.isfinite(info["final_obs"][1]).all() and envs.batch.runs.tolist() == [0, 3]
    envs.step([[1.0], [1.0]])


def test_an_episode_may_begin_from_a_snapshot(sim):
    flown = sim.clone()
    flown.run(1 * minute)
    envs = vector(sim, limit=1 * s)
    _, info = envs.reset(options={"snapshot": flown.snapshot()})
    assert info["time"].tolist() == [60.0] * 3
    assert not envs.step(np.zeros((3, 4)))[3].any() and envs.step(np.zeros((3, 4)))[3].all()


def test_boxes_hold_what_they_say():
    box = Box([-1.0, 0.0, -np.inf, -np.inf], [1.0, np.inf, 2.0, np.inf], (4,), np.float32)
    box.seed(1)
    drawn = [box.sample() for _ in range(200)]
    assert all(x in box for x in drawn)
    box.seed(1)
    np.testing.assert_array_equal(box.sample(), drawn[0])
    assert np.ptp(drawn, axis=0).min() > 1
    assert np.zeros(3, np.float32) not in box and np.full(4, 3, np.float32) not in box and [0.0] * 4 not in box
    assert Box(0, 1, (2,)) == Box(0, 1, (2,)) != Box(0, 2, (2,))


@pytest.mark.parametrize("change, message", [
    (dict(autoreset="Never"), "autoreset: expected SameStep, NextStep, Disabled; found 'Never'"),
    (dict(limit=0.1 * s), "limit must be at least a step, 0.5 s; found 0.1 s"),
    (dict(low=1.0), "a lower one is above the upper one"),
    (dict(low=[1.0, 2.0]), "bounds: expected a number"),
    (dict(reward=lambda b, a, c: c["flight.tracking.error.sigma"]),
     r"there is no 'flight.tracking.error.sigma' here; did you mean 'flight.tracking.error.sigma_BR'\? there are "),
    (dict(reward=lambda b, a, c: 0.0), r"reward\(\) must give an array of the shape \(3,\); found \(\)"),
    (dict(terminated=lambda c: np.zeros(2)), r"terminated\(\) must give an array of the shape"),
    (dict(reset=dict(options={"speed": 2})), "options: expected reset_mask, runs and snapshot; found speed"),
])
def test_what_cannot_be_is_refused(sim, change, message):
    reset = change.pop("reset", {})
    with pytest.raises(SetupError, match=message):
        envs = vector(sim, **change)
        envs.reset(**reset)
        envs.step(np.zeros((3, 4)))


def test_a_step_needs_a_reset(sim):
    with pytest.raises(SetupError, match="reset.. first"):
        vector(sim).step(np.zeros((3, 4)))


@pytest.fixture
def beside_gymnasium(monkeypatch):
    """The module as it is where Gymnasium is installed, of which a stand-in has what it takes from it."""
    class Seeded:
        np_random = seeds = None

        def reset(self, *, seed=None, options=None):
            self.seeds = [*(self.seeds or []), seed]

    class Space:
        def __init__(self, low, high, shape=None, dtype=None):
            self.low, self.high, self.shape, self.dtype = low, high, low.shape, np.dtype(dtype)

    gymnasium, vector, spaces = (ModuleType(f"gymnasium{part}") for part in ("", ".vector", ".spaces"))
    gymnasium.Env, vector.VectorEnv, spaces.Box = type("Env", (Seeded,), {}), type("VectorEnv", (Seeded,), {}), Space
    vector.AutoresetMode = enum.Enum("AutoresetMode", {"SAME_STEP": "SameStep", "DISABLED": "Disabled"})
    gymnasium.vector, gymnasium.spaces = vector, spaces
    for module in (gymnasium, vector, spaces):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    spec = importlib.util.spec_from_file_location("learning_beside_gymnasium", learning.__file__)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module, gymnasium


def test_the_classes_are_those_of_gymnasium_where_it_is_installed(sim, beside_gymnasium):
    module, gymnasium = beside_gymnasium
    env, envs = module.Env(sim, **ARGUMENTS), module.VectorEnv(sim, 2, **ARGUMENTS)
    assert isinstance(env, gymnasium.Env) and isinstance(envs, gymnasium.vector.VectorEnv)
    assert envs.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    for space in (env.action_space, envs.single_action_space, envs.observation_space):
        assert isinstance(space, gymnasium.spaces.Box) and space.low.flags.writeable and space.dtype == float
    assert envs.action_space.low.shape == (2, 4) and (envs.action_space.high == 0.2).all()
    first, plain = env.reset(seed=5)[0], Env(sim, **ARGUMENTS).reset(seed=5)[0]
    np.testing.assert_array_equal(first, plain)
    envs.reset(seed=[1, 2])
    assert env.seeds == [5] and envs.seeds == [None]


def test_random_numbers_of_an_environment_begin_anew_with_its_seed(sim):
    env = Env(sim, **ARGUMENTS)
    env.reset(seed=5)
    first = env.np_random.random(3)
    env.reset()
    assert (env.np_random.random(3) != first).all()
    env.reset(seed=5)
    np.testing.assert_array_equal(env.np_random.random(3), first)


def test_gymnasium_agrees_where_it_is_installed(sim):
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    assert gymnasium.vector.AutoresetMode(vector(sim).metadata["autoreset_mode"])
    check_env(Env(sim, **ARGUMENTS), skip_render_check=True)
