# SPDX-License-Identifier: Apache-2.0
"""Clones that are stepped together do what each does alone."""
import functools
import gc
import os
import re
import resource
import signal
import threading

import numpy as np
import pytest

import fledge
from fledge import Orbit, SetupError
from fledge import flight as fsw
from fledge import objects, prototype, world
from fledge.mission import neural
from fledge.montecarlo import Campaign
from fledge.units import N, deg, kg, km, m, minute, ms, s

ERROR = ["flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B"]
TORQUE = "world.wheels.command.u"


@pytest.fixture(scope="module")
def sim():
    return fledge.load("nadir_spin")


def make(sim, n=3, actions=(TORQUE,), observations=ERROR, every=0.5 * s, **options):
    return sim.batch(n, actions, observations, every=every, **options)


def test_commands_by_hand_move_the_craft_as_the_wire_does_bit_for_bit(sim):
    # What flight commanded in a run of its own is given to a clone at the same times.
    flown = fledge.load("nadir_spin")
    log = flown.record(flown.flight.motor.command, flown.flight.tracking.error, flown.world.craft.state, every=0.5 * s)
    flown.run(3 * minute)
    batch = make(sim, 2, observations=[*ERROR, "world.craft.state.omega_BN_B"])
    seen = batch.reset()
    np.testing.assert_array_equal(seen[0, :3], log["error.sigma_BR"][0])
    for k, torque in enumerate(log["command.u"][:-1]):
        seen = batch.step({TORQUE: torque * [[1.0], [0.0]]})
        np.testing.assert_array_equal(seen[0], [*log["error.sigma_BR"][k + 1], *log["error.omega_BR_B"][k + 1],
                                                *log["state.omega_BN_B"][k + 1]])
    assert np.abs(seen[1, 6:] - seen[0, 6:]).max() > 1e-3, "the other clone had no torque"


GAINS = np.array([[0.02, 0.001, 0.0, 0.35, 0.0, 0.0],
                  [0.0, 0.02, 0.0, 0.0, 0.3, 0.01],
                  [0.0, 0.0, 0.03, 0.0, 0.0, 0.3]])
STATE = ["flight.tracking.error.sigma_BR", "flight.tracking.error.omega_BR_B"]
LAW = "flight.control.torque.torque_B"


def linear(rows):
    """u = -K x, (n, 3), in the order of the sums of flight."""
    u = np.zeros((len(rows), 3))
    for j in range(6):
        u = u + -GAINS[:, j] * rows[:, j, None]
    return u


class Linear(prototype.Module):
    """The same law in flight."""
    error = prototype.input(fsw.AttError, "what to remove")
    torque = prototype.out(fsw.BodyTorque, "u = -K x")

    def update(self, t, dt):
        x = np.array([[*self.error.sigma_BR, *self.error.omega_BR_B]])
        self.torque.torque_B = linear(x)[0]
        self.publish(self.torque)


def turn(control=None):
    """A turn by this law; not given: in C, as a network without hidden layers."""
    sim = fledge.Simulation("turn")
    w, f = sim.world, sim.flight
    if control is None:
        control = fsw.NeuralFeedback(sigma_unit=1, omega_unit=1, torque_max=1)
        neural.give(control, [(-GAINS, np.zeros(3))])
    f.wheels = fsw.WheelConfig(axes_B=fsw.PYRAMID, J=2e-3 * kg * m**2, u_max=0.05 * N * m)
    f.guidance, f.tracking, f.control = fsw.InertialPointing(), fsw.TrackingError(), control
    f.motor = fsw.WheelTorques()
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.05 * N * m)
    w.craft = world.Spacecraft(I_B=[12, 10, 8] * kg * m**2, parts=[w.wheels], gravity=[world.EARTH],
                               orbit=Orbit(world.EARTH, altitude=500 * km), sigma_BN=[0.5, -0.4, 0.3],
                               omega_BN_B=[0.4, -0.8, 0.6] * deg / s)
    w.nav = world.Navigation()
    f.connect(f.guidance.reference >> f.tracking.reference, f.tracking.error >> f.control.error,
              f.control.torque >> f.motor.torque, f.wheels.wheels >> f.motor.wheels)
    w.connect(w.craft.state >> w.nav.truth, w.nav.attitude >> f.tracking.attitude, f.motor.command >> w.wheels.command)
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.tracking, f.control, f.motor])
    w.task("dynamics", every=250 * ms, run=[w.craft, w.nav])
    return sim


@pytest.mark.parametrize("law", [lambda: None, Linear], ids=["network", "prototype"])
def test_a_law_outside_flies_the_bits_of_the_law_inside(law):
    inside = turn(law())
    batch = inside.batch(2, [LAW], STATE, every=0.5 * s)
    inside.reset()
    inside.run(0 * s)
    seen = batch.reset()

    def memory(part):
        return bytes(objects.memory(part))

    flown = [batch.watched(i) for i in range(2)]
    for k in range(240):
        seen = batch.step(linear(seen))
        for outside in flown:                   # the rest of the instant k, then what comes up to the law at k + 1
            assert memory(outside.flight.motor) == memory(inside.flight.motor), k
        inside.run(0.5 * s)
        for outside in flown:
            for part in ("flight.tracking", "flight.guidance", "world.craft", "world.wheels", "world.nav"):
                process, name = part.split(".")
                assert memory(getattr(getattr(outside, process), name)) == \
                    memory(getattr(getattr(inside, process), name)), (k, part)
            assert outside.time == inside.time
    assert np.linalg.norm(seen[0, :3]) < 0.1 and batch.time[0] == 120.0


def test_a_delay_of_whole_periods_is_that_of_a_law_that_waits():
    class Late(Linear):
        """The same law, whose output waits for so many of its updates."""
        periods = prototype.par(int, "[-] required, in [1, 9]: how many")
        waits = prototype.mem(float, "[N m] torques", shape=(10, 3))

        def update(self, t, dt):
            self.waits[1:] = np.array(self.waits[:-1])
            self.waits[0] = linear(np.array([[*self.error.sigma_BR, *self.error.omega_BR_B]]))[0]
            if t >= 0.5 * self.periods:
                self.torque.torque_B = self.waits[self.periods]
                self.publish(self.torque)

    for periods in (1, 3):
        inside = turn(Late(periods=periods))
        batch = turn().batch(1, [LAW], [*STATE, "world.craft.state.omega_BN_B"], every=0.5 * s, delay=periods)
        assert batch.delay == periods
        seen = batch.reset()
        inside.run(0 * s)
        for _ in range(40):
            seen = batch.step(linear(seen[:, :6]))
            inside.run(0.5 * s)
            np.testing.assert_array_equal(seen[0, :3], inside.flight.tracking.error.sigma_BR)
            np.testing.assert_array_equal(seen[0, 6:], inside.world.craft.state.omega_BN_B)
    with pytest.raises(SetupError, match="delay: expected a whole number"):
        turn().batch(1, [LAW], STATE, every=1 * s, delay=0.5)


def test_late_observations_are_named():
    sim = turn()
    batch = sim.batch(1, [LAW], [*STATE, "flight.motor.command.u", "flight.control.torque.torque_B"], every=0.5 * s)
    assert [block.late for block in batch.observations.values()] == [False, False, True, False]
    assert "flight.motor.command.u  (8,) N m  of the instant before" in repr(batch)
    assert (batch.reset()[0, 6:14] == 0).all() and (batch.step([[0.01, 0, 0]])[0, 6:10] != 0).all()
    assert not any(block.late for block in make(sim, 1).observations.values()), "the world's inputs need no such place"


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_a_clone_is_the_run_of_the_campaign_whatever_the_threads(threads):
    campaign = Campaign("nadir_spin")
    batch = campaign.nominal.batch(7, (), ERROR, every=10 * s, seed=3, dispersions=campaign, threads=threads)
    batch.reset()
    for _ in range(3):
        seen = batch.step()
    batch.reset([2])
    for _ in range(3):
        batch.step()
        seen[2] = batch.observe()[2]
    assert batch.runs.tolist() == [0, 1, 9, 3, 4, 5, 6]
    for clone in (0, 2, 6):
        alone = campaign.simulation(int(batch.runs[clone]), seed=3)
        alone.run(30 * s)
        error = alone.flight.tracking.error
        np.testing.assert_array_equal(seen[clone], [*error.sigma_BR, *error.omega_BR_B])
        assert batch.draws["world.wheels.J[0]"][clone] == alone.world.wheels.J[0]


def test_a_plain_run_repeats_a_row(sim):
    noisy = sim.clone()
    noisy.world.nav.rate_noise = [1e-4] * 3
    campaign = Campaign("nadir_spin")
    batch = make(noisy, 4, [TORQUE], ERROR, every=2 * s, seed=5, dispersions=campaign)
    batch.reset()
    batch.reset([2])                        # it flies its second run
    actions = np.random.default_rng(1).normal(0, 0.01, (5, 4, len(batch.action_names)))
    for rows in actions:
        seen = batch.step(rows)
    assert batch.runs.tolist() == [0, 1, 6, 3]
    for clone in range(4):
        alone = batch.repeat(clone, actions[:, clone])
        error = alone.flight.tracking.error
        np.testing.assert_array_equal(seen[clone], [*error.sigma_BR, *error.omega_BR_B])
        assert alone.snapshot() == batch.simulation(clone).snapshot()
    actions[3, 0, 0] = 0.02
    assert batch.repeat(0, actions[:, 0]).snapshot() != batch.simulation(0).snapshot()
    with pytest.raises(SetupError, match=r"expected the shape \(steps, 8\), found \(5, 3\)"):
        batch.repeat(0, actions[:, 0, :3])
    with pytest.raises(SetupError, match="there is no clone 4"):
        batch.repeat(4, actions[:, 0])


def test_prototypes_fly_in_a_batch(tmp_path):
    class Lag(prototype.Model):
        """A torque that decays."""
        load = prototype.out(world.ForceTorque, "for the spacecraft")
        rate = prototype.par(float, "[1/s] > 0, required: of the decay")
        now = prototype.mem(float, "[N m] the torque")

        def reset(self, t):
            self.now = 0.1 * self.uniform()

        def update(self, t, dt):
            self.now -= self.rate * self.now * dt
            self.load.torque_B = [self.now, 0, 0]
            self.publish(self.load)

    sim = fledge.load("nadir_spin")
    w = sim.world
    w.lag = Lag(rate=0.1)
    w.connect(w.lag.load >> w.craft.external)
    w.task("lag", every=1 * s, run=[w.lag])
    batch = make(sim, 3, (), [*ERROR, "world.lag.now"], every=1 * s, seed=3)
    batch.reset()
    seen = [batch.step() for _ in range(5)][-1]
    assert len(set(seen[:, -1])) == 3
    for clone in range(3):
        alone = batch.repeat(clone, np.empty((5, 0)))
        np.testing.assert_array_equal(seen[clone], [*alone.flight.tracking.error.sigma_BR,
                                                    *alone.flight.tracking.error.omega_BR_B, alone.world.lag.now])
    batch.reset(seed=3)
    w.lag.rate = 0.2                        # the clones keep what they were made with
    np.testing.assert_array_equal([batch.step() for _ in range(5)][-1], seen)


def test_random_streams_differ_between_clones_and_after_a_snapshot(sim):
    noisy = sim.clone()
    noisy.world.nav.rate_noise = [1e-4] * 3
    noisy.run(1 * s)
    batch = make(noisy, 4, (), ["world.nav.attitude.omega_BN_B"], every=1 * s, seed=1)
    batch.reset()
    first = batch.step()
    assert len({row.tobytes() for row in first}) == 4
    batch.reset(seed=1)
    np.testing.assert_array_equal(batch.step(), first)
    # From one snapshot, streams of the runs' own: the same again with the same seeds and runs.
    snapshot = noisy.snapshot()
    batch.reset(seed=1, snapshot=snapshot)
    assert (batch.time == 1.0).all()
    later = batch.step()
    assert len({row.tobytes() for row in later}) == 4
    batch.reset([3, 1], seed=1, runs=[3, 1], snapshot=snapshot)
    np.testing.assert_array_equal(batch.step()[[1, 3]], later[[1, 3]])


def test_a_gain_is_an_action_and_a_bad_one_fails_its_clone_alone(sim):
    batch = make(sim, 3, ["flight.control.K"], every=30 * s)
    batch.reset()
    seen = batch.step(np.array([[2.531], [-1.0], [5.0]]))
    assert batch.failed.tolist() == [False, True, False]
    assert "flight.control.K must be > 0 N m, found -1 N m" in batch.failures[1]
    assert np.isnan(seen[1]).all() and np.isfinite(seen[[0, 2]]).all() and (seen[0] != seen[2]).any()
    batch.step([[2.531], [np.nan], [5.0]])    # what a failed clone is given does not count
    assert batch.time.tolist() == [60, 0, 60]
    seen = batch.reset(batch.failed)
    assert not batch.failed.any() and batch.time.tolist() == [60, 0, 60] and np.isfinite(seen).all()
    assert batch.simulation(1).flight.control.K == 2.531
    alone = sim.clone()
    alone.reset()
    alone.run(60 * s)
    np.testing.assert_array_equal(seen[0, :3], alone.flight.tracking.error.sigma_BR)


def test_a_run_that_is_no_longer_finite_fails_alone(sim):
    batch = make(sim, 2, ["world.craft.external.torque_B"], every=1 * s)
    batch.reset()
    batch.step([[0.0] * 3, [1e300, 0, 0]])
    assert batch.failed.tolist() == [False, True] and "finite" in batch.failures[1], batch.failures
    seen = batch.step(np.zeros((2, 3)))
    assert batch.time.tolist() == [2, 0] and np.isfinite(seen[0]).all()


def test_parts_by_name_and_the_original_left_alone(sim):
    before = sim.time, len(sim.wires)
    batch = make(sim, 2, [TORQUE, "flight.control.K"], [*ERROR, "world.wheels.speeds.Omega[1]", "world.craft.mass"])
    assert (batch.action_names[0], batch.action_names[-1]) == ("world.wheels.command.u[0]", "flight.control.K")
    assert batch.observation_names[-2:] == ["world.wheels.speeds.Omega[1]", "world.craft.mass"]
    named = batch.by_name(batch.reset())
    assert named[ERROR[0]].shape == (2, 3) and named["world.craft.mass"].shape == (2,)
    assert batch.observations[ERROR[1]].unit == "rad/s" and "rate" in batch.observations[ERROR[1]].meaning
    assert (sim.time, len(sim.wires)) == before
    assert "2 clones of nadir_spin" in repr(batch)


def test_arrays_of_any_layout_and_number_are_taken(sim):
    batch = make(sim, 4)
    n = len(batch.action_names)
    given = np.arange(4 * n).reshape(4, n) % 3 * 0.01
    results = []
    for form in (given, np.asfortranarray(given), given.astype(np.float32).astype(float), given[::-1][::-1],
                 given.tolist(), np.repeat(given, 2, axis=1)[:, ::2]):
        batch.reset(seed=0)
        results.append(batch.step(form))
    np.testing.assert_array_equal(results[0], results[1])
    for other in results[3:]:
        np.testing.assert_array_equal(results[0], other)
    batch.reset(seed=0)
    np.testing.assert_array_equal(batch.step(given.astype(np.float32)).shape, (4, 6))


@pytest.mark.parametrize("change, message", [
    (dict(actions=["world.wheels.command.w"]), "world.wheels.command has no 'w'"),
    (dict(actions=["flight.control.torqe.L"]), "did you mean 'torque'"),
    (dict(actions=["world.craft.sigma_BN"]), "initial value, which counts only until the first instant"),
    (dict(actions=["world.nav.orbit"]), "is a whole message; name one of its fields"),
    (dict(actions=["flight.spin.euler.angles"]), "flight.spin.euler feeds no input"),
    (dict(actions=["world.wheels.command.u", "flight.motor.command.u"]), "two actions in the same place"),
    (dict(actions=[TORQUE, TORQUE]), "is there twice"),
    (dict(observations=["flight.nothing.x"]), "flight"),
    (dict(actions=["world.wheels.command.u[:9]"]), "has the shape (8,); name some of its first rows"),
    (dict(actions=["flight.control.K[:1]"]), "has the shape (); name some of its first rows"),
    (dict(n=0), "batch: n must be a whole number >= 1, found 0"),
    (dict(threads=0), "threads must be a whole number >= 1"),
    (dict(every=0 * s), "the duration of a step must be > 0"),
    (dict(every=3 * N), "expected"),
    (dict(seed=-1), "seed: expected a whole number from 0"),
])
def test_a_batch_that_cannot_be_is_refused(sim, change, message):
    with pytest.raises(SetupError, match=re.escape(message)):
        make(sim, **change)


PLACE = "world.wheels.friction", "flight.control.K"


def kicked(limit):
    """A simulation whose event acts on it by what it has captured, by a helper and by a default."""
    sim = fledge.load("nadir_spin")
    wheels, world = sim.world.wheels, sim.world

    def gain():
        return sim.flight.control.K

    def knock(by=(1e-3, 3.0)):
        wheels.friction = [by[0] * (2 + world.craft.state.omega_BN_B[0])] * 4
        sim.flight.control.K = gain() * by[1]

    sim.world.event("knock", when=lambda: abs(world.craft.state.omega_BN_B[1]) > limit, do=knock, once=True)
    return sim


@pytest.mark.parametrize("action, torque", [(TORQUE, [0.2, 0.2, -0.2, -0.2, 0, 0, 0, 0]), (LAW, [0, 0.4, 0])])
def test_events_in_python_act_on_their_own_clone(action, torque):
    sim = kicked(0.02)
    batch = sim.batch(3, actions=[action], observations=PLACE, every=1 * s)
    batch.reset()
    actions = np.outer([0, 1, -1], torque)
    rows = np.array([batch.step(actions) for _ in range(60)])
    when = [next((k for k, row in enumerate(rows) if row[i, 0] > 0), None) for i in range(3)]
    assert len(set(when)) == 3, "clones that turn otherwise meet their event at other times"
    assert sim.world.wheels.friction[0] == 0 and sim.world.knock.fired_at is None
    for i in range(3):
        copy = batch.simulation(i)
        assert copy.flight.control.K == sim.flight.control.K * (1 if when[i] is None else 3)
        assert batch.repeat(i, np.broadcast_to(actions[i], (60, len(torque)))).snapshot() == copy.snapshot()
    batch.reset(seed=0)
    np.testing.assert_array_equal([batch.step(actions) for _ in range(60)], rows)


def test_a_copy_in_the_middle_of_an_instant_has_the_events_of_that_instant():
    sim = fledge.load("nadir_spin")
    wheels = sim.world.wheels

    def knock():
        wheels.friction = [1e-3] * 4

    sim.world.at(2 * s, knock, name="knock")
    batch = sim.batch(2, [LAW], PLACE, every=0.5 * s)
    batch.reset()
    for _ in range(4):
        batch.step(np.zeros((2, 3)))
    copy = batch.simulation(1)
    assert copy.time == batch.time[1] == 2
    assert copy.world.knock.fired_at is None and not copy.world.wheels.friction.any()
    copy.run(0 * s)
    assert copy.world.knock.fired_at == 2 and copy.world.wheels.friction[0] == 1e-3
    copy.run(1 * s)
    for _ in range(2):
        seen = batch.step(np.zeros((2, 3)))
    assert batch.watched(1).world.knock.fired_at == 2 and seen[1, 0] == 1e-3
    np.testing.assert_array_equal(copy.world.craft.state.sigma_BN, batch.watched(1).world.craft.state.sigma_BN)


def test_a_clone_with_python_has_the_bits_of_its_simulation_alone():
    sim, alone = kicked(0.009), kicked(0.009)
    batch = sim.batch(2, observations=["world.craft.state.sigma_BN", "world.wheels.friction"], every=10 * s)
    batch.reset()
    for _ in range(6):
        seen = batch.step()
    alone.run(1 * minute)
    expected = [*alone.world.craft.state.sigma_BN, *alone.world.wheels.friction]
    assert expected[3] > 0
    np.testing.assert_array_equal(seen, [expected, expected])


def test_functions_of_modules_fly_in_a_batch():
    sim = fledge.Simulation("probe")
    factor = np.array([2.0, 3.0, 4.0])
    factor.flags.writeable = False

    def push(m, t, dt):
        m.torque.torque_B = factor * m.gyro.omega_BN_B * sim.flight.vehicle.I_B[0, 0]
        m.publish(m.torque)

    sim.flight.vehicle = fsw.VehicleConfig(I_B=[5, 5, 5])
    sim.flight.law = fsw.RateDamping(P=1, update=push)
    sim.flight.task("gnc", every=1 * s, run=[sim.flight.law])
    rate, torque = "flight.law.gyro.omega_BN_B", "flight.law.torque.torque_B"
    batch = sim.batch(2, [rate, "flight.vehicle.I_B[0, 0]"], [torque], every=1 * s)
    batch.reset()
    batch.step([[1, 1, 1, 5], [1, 1, 1, 6]])
    seen = batch.step([[1, 1, 1, 5], [1, 1, 1, 6]])
    np.testing.assert_array_equal(seen, [[10, 15, 20], [12, 18, 24]])


def counting():
    count = []
    return lambda: count.append(1)


def assigning():
    n = 0

    def add():
        nonlocal n
        n += 1
    return add


@pytest.mark.parametrize("do, message", [
    (counting(), r"event world.knock: <lambda>.*uses count, a list outside of the simulation, which"),
    (assigning(), r"event world.knock: add\(\).* assigns n in line \d+, a variable outside of it"),
    (lambda: np.random.normal(), "draws random numbers that clones would share"),
    ([].clear, "uses itself, a builtin_function_or_method outside of the simulation"),
    (functools.partial(print), "uses itself, a partial outside"),
])
def test_functions_that_keep_what_clones_would_share_are_refused(do, message):
    sim = fledge.load("nadir_spin")
    sim.world.at(5 * s, do, name="knock")
    with pytest.raises(SetupError, match=message):
        make(sim)


@pytest.mark.parametrize("give, message", [
    (lambda b: b.step(np.zeros((3, 3))), r"expected the shape \(3, \d+\), found \(3, 3\)"),
    (lambda b: b.step({TORQUE: np.zeros((2, 4))}), "world.wheels.command.u: expected the shape"),
    (lambda b: b.step({"flight.motor.command.u": 0}), "the actions are world.wheels.command.u; found flight.motor"),
    (lambda b: b.step(np.full((3, len(b.action_names)), "x")), "expected numbers"),
    (lambda b: b.step(np.full((3, len(b.action_names)), np.inf)), "of clone 0: expected a finite number, found inf"),
    (lambda b: b.reset([0, 0]), "different indices from 0 to 2"),
    (lambda b: b.reset([3]), "different indices from 0 to 2"),
    (lambda b: b.reset(np.array([True, False])), "expected a mask of 3"),
    (lambda b: b.reset(seed=[1, 2]), "seed: expected one number, or 3; found 2"),
    (lambda b: b.reset(runs=1.5), "runs: expected a whole number"),
    (lambda b: b.reset(snapshot=b"nothing"), "this snapshot .7 bytes. is truncated or damaged"),
    (lambda b: b.simulation(3), "there is no clone 3"),
])
def test_bad_input_is_refused_before_any_clone_moves(sim, give, message):
    batch = make(sim)
    batch.reset()
    with pytest.raises(SetupError, match=message):
        give(batch)
    assert (batch.time == 0).all() and not batch.failed.any()


def test_a_step_before_the_first_reset_is_refused(sim):
    with pytest.raises(SetupError, match="clone 0 has not begun: reset it first"):
        make(sim, actions=()).step()


@pytest.mark.long("a thousand batches")
@pytest.mark.skipif(os.environ.get("FLEDGE_PRESET") == "asan", reason="the sanitizer holds back freed memory")
def test_memory_does_not_grow(sim):
    def flown():
        batch = make(sim, 64, threads=2)
        batch.reset()
        for _ in range(200):
            batch.step({TORQUE: 0.0})
            batch.reset([5])

    flown()
    gc.collect()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(3):
        flown()
        gc.collect()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 8000    # [kB]; a batch of these has 10,000


def test_ctrl_c_ends_a_step_and_the_next_one_takes_it_up(sim):
    batch = make(sim, 8, (), every=200 * minute, threads=2)
    batch.reset()
    timer = threading.Timer(0.02, signal.raise_signal, [signal.SIGINT])
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        while True:     # a fast machine may end a step before the signal
            batch.step()
    timer.join()
    batch.step()
    assert len(set(batch.time)) == 1, "all have come to the same end"
