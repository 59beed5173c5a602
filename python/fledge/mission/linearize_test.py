# SPDX-License-Identifier: Apache-2.0
"""Linear systems of simulations: against closed forms, and against differences by hand."""

import warnings

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm

import fledge
from fledge import SetupError, flight as fsw, world
from fledge.units import N, kg, m, minute, ms, s

I = np.diag([10.0, 20.0, 30.0])
OMEGA, SIGMA = "world.craft.omega_BN_B", "world.craft.sigma_BN"
RATE, TORQUE = "world.craft.state.omega_BN_B", "world.craft.external.torque_B"
CONTROL = "flight.control.torque.torque_B"


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def body(*parts, every=100 * ms, gravity=(), **parameters):
    """A spacecraft with parts, at its first instant."""
    sim = fledge.Simulation("body")
    for i, part in enumerate(parts):
        setattr(sim.world, type(part).__name__.lower() + (str(i) if i > 1 else ""), part)
    sim.world.craft = world.Spacecraft(I_B=I, parts=list(parts), gravity=list(gravity), **parameters)
    sim.world.task("dynamics", every=every, run=[sim.world.craft])
    sim.step()
    return sim


def by_name(lin, names):
    """The rows of A of states, in this order."""
    order = [lin.states.index(name) for name in names]
    return lin.A[np.ix_(order, order)]


def same_poles(found, wanted, tolerance):
    left = list(found)
    for pole in np.ravel(wanted):
        nearest = min(range(len(left)), key=lambda i: abs(left[i] - pole))
        assert abs(left.pop(nearest) - pole) < tolerance, (found, wanted)
    assert not left


# --- closed forms of the world ---------------------------------------------------------------------

def test_a_spinning_body_nutates():
    omega = np.array([0, 0, 0.1])
    lin = body(omega_BN_B=omega).linearize(TORQUE, RATE)
    assert lin.states == [f"{OMEGA}[{i}]" for i in range(3)] and lin.dt is None and not lin.notes
    assert lin.units[f"{OMEGA}[0]"] == "rad/s" and lin.units[f"{TORQUE}[0]"] == "N m"
    A = -np.linalg.solve(I, cross(omega) @ I - cross(I @ omega))
    assert lin.A == pytest.approx(A, abs=1e-13)
    assert lin.B == pytest.approx(np.linalg.inv(I), abs=1e-13)
    assert lin.C == pytest.approx(np.eye(3), abs=1e-13) and not lin.D.any()
    nutation = 0.1 * np.sqrt((30 - 10) * (30 - 20) / (10 * 20))
    same_poles(lin.poles(), [0, 1j * nutation, -1j * nutation], 1e-12)


def test_attitude_and_general_motion():
    omega, sigma = np.array([0.3, -0.2, 0.1]), np.array([0.2, 0.4, -0.1])
    lin = body(omega_BN_B=omega, sigma_BN=sigma).linearize([], ["world.craft.state.sigma_BN", RATE])
    A = by_name(lin, [f"{name}[{i}]" for name in (SIGMA, OMEGA) for i in range(3)])
    bend = (1 - sigma @ sigma) * np.eye(3) + 2 * cross(sigma) + 2 * np.outer(sigma, sigma)
    along = 2 * (sigma @ omega * np.eye(3) + np.outer(sigma, omega) - np.outer(omega, sigma) - cross(omega))
    assert A[:3, 3:] == pytest.approx(bend / 4, abs=1e-12)
    assert A[:3, :3] == pytest.approx(along / 4, abs=1e-12)
    assert A[3:, 3:] == pytest.approx(-np.linalg.solve(I, cross(omega) @ I - cross(I @ omega)), abs=1e-12)
    assert lin.drift[:3] == pytest.approx(bend @ omega / 4)


def test_a_body_in_orbit_swings_as_a_gravity_gradient_pendulum():
    radius = 7e6
    n = np.sqrt(world.EARTH.mu / radius**3)
    inertia = np.array([10.0, 30.0, 35.0])      # about the vertical, along the track, about the normal: stable
    sim = fledge.Simulation("pendulum")
    w = sim.world
    w.gradient = world.GravityGradient()
    w.craft = world.Spacecraft(I_B=np.diag(inertia), mass=100, parts=[w.gradient], gravity=[world.EARTH],
                               r_BN_N=[radius, 0, 0], v_BN_N=[0, n * radius, 0], omega_BN_B=[0, 0, n])
    w.task("dynamics", every=1 * s, run=[w.craft])
    sim.step()
    lin = sim.linearize([], [], hold=["world.craft.r_CN_N", "world.craft.v_CN_N"])
    A = by_name(lin, [f"{name}[{i}]" for name in (SIGMA, OMEGA) for i in range(3)])
    # In the pitch plane all is as for a pendulum at rest.
    pitch = A[np.ix_([2, 5], [2, 5])]
    swing = n * np.sqrt(3 * (inertia[1] - inertia[0]) / inertia[2])
    same_poles(np.linalg.eigvals(pitch), [1j * swing, -1j * swing], 1e-10)
    # Small angles of the body to its reference, which turns: sigma = angle / 4, whose chart turns half as far.
    assert A[:3, :3] == pytest.approx(-cross([0, 0, n]) / 2, abs=1e-14)
    A[:3, :3] *= 2
    A[:3] *= 4
    A[:, :3] /= 4
    roll = A[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])]
    a, b = (inertia[2] - inertia[0]) / inertia[1], (inertia[2] - inertia[1]) / inertia[0]
    squares = np.roots([1, n**2 * (1 + 3 * a + a * b), 4 * n**4 * a * b])
    same_poles(np.linalg.eigvals(roll), np.concatenate([np.sqrt(squares + 0j), -np.sqrt(squares + 0j)]), 1e-9)


def test_wheels_and_body_exchange_momentum():
    g = np.array([[1, 0, 0], [0, 0.6, 0.8]]).T
    omega, speeds, J = np.array([0.01, 0.02, -0.03]), np.array([100.0, -50.0]), 0.1
    wheels = world.ReactionWheels(axes_B=g.T, J=J, Omega=speeds)
    sim = body(wheels, omega_BN_B=omega)
    path = "world.reactionwheels"
    lin = sim.linearize([f"{path}.command.u[{i}]" for i in range(2)], [RATE, *(f"{path}.speeds.Omega[{i}]"
                                                                               for i in range(2))])
    assert lin.states == [*(f"{OMEGA}[{i}]" for i in range(3)), f"{path}.h[0]", f"{path}.h[1]"]
    h = J * (g.T @ omega + speeds)
    assert lin.x0 == pytest.approx([*omega, *h])
    turn = np.linalg.solve(I, np.hstack([-cross(omega) @ I + cross(I @ omega + g @ h), -cross(omega) @ g]))
    assert lin.A == pytest.approx(np.vstack([turn, np.zeros((2, 5))]), abs=1e-12)
    assert lin.B == pytest.approx(np.vstack([-np.linalg.solve(I, g), np.eye(2)]), abs=1e-12)
    assert lin.C == pytest.approx(np.block([[np.eye(3), np.zeros((3, 2))], [-g.T, np.eye(2) / J]]), abs=1e-9)


def test_a_panel_and_its_hub_swing_against_each_other():
    J, k, c = 2.0, 3.0, 0.05
    panel = world.HingedPanels(mass=5 * kg, I_B=[np.diag([J, 3, 4])], hinge_B=[[0, 0, 0]], axes_B=[[1, 0, 0]],
                               stiffness=k, damping=c)
    sim = body(panel, mass=50)
    lin = sim.linearize(TORQUE, RATE, hold=SIGMA)
    assert lin.states[-2:] == ["world.hingedpanels.theta[0]", "world.hingedpanels.dtheta[0]"]
    both = 1 / J + 1 / I[0, 0]
    same_poles(lin.poles()[-2:], np.roots([1, c * both, k * both]), 1e-10)
    # The hub alone is heavier by the panel about the other axes.
    assert lin.channel(1, 1).frequency(0.1)[0, 0, 0] == pytest.approx(1 / (0.1j * (20 + 3)))


def test_the_margin_of_an_acceleration_that_is_fed_back_is_the_inertia_of_the_hub():
    """At rest the torque turns hub and panel, 12 kg m^2; the faster, the more the hub alone, 10."""
    panel = world.HingedPanels(mass=5 * kg, I_B=[np.diag([2, 3, 4])], hinge_B=[[0, 0, 0]], axes_B=[[1, 0, 0]],
                               stiffness=3, damping=0.05)
    wheels = world.ReactionWheels(axes_B=[[0, 1, 0], [0, 0, 1]], J=0.1)
    lin = body(panel, wheels, mass=50).linearize(f"{TORQUE}[0]", "world.craft.state.domega_BN_B[0]", hold=SIGMA)
    margins = lin.margins(feedback=1)
    assert (margins.gain, margins.gain_at, margins.gain_down) == (pytest.approx(10), np.inf, 0)
    for gain in (9.9, 10.1):
        closed = np.linalg.eigvals(lin.A + gain * lin.B @ lin.C / (1 - gain * lin.D[0, 0]))
        assert (closed.real > 1e-6).any() == (gain > 10)


def test_a_free_gimbal_and_its_body_nutate():
    """The body's rate about the axis across tilts the gimbal, whose rate turns the body back; about its own axis, a
    free gimbal gives the body nothing."""
    J_g, h, path = 0.02, 0.01 * 500, "world.controlmomentgyros"
    gyro = world.ControlMomentGyros(gimbal_axes_B=[[1, 0, 0]], spin_axes_B=[[0, 1, 0]], J=0.01, J_g=J_g, Omega=500)
    lin = body(gyro, mass=50).linearize([], [])
    assert {f"{path}.h[0]", f"{path}.p[0]", f"{path}.angle[0]"} <= {*lin.states}
    nutation = h / np.sqrt(J_g * I[2, 2])
    A = by_name(lin, [f"{OMEGA}[0]", f"{OMEGA}[2]", f"{path}.p[0]"])
    same_poles(np.linalg.eigvals(A), [0, 1j * nutation, -1j * nutation], 1e-8)


def test_fuel_on_a_spring_and_on_a_rod():
    M, fuel, k, c, length, thrust = 50.0, 4.0, 3.0, 0.1, 0.5, 20.0
    spring = world.FuelSlosh(mass=[fuel], r_B=[[0, 0, 0]], axes_B=[[1, 0, 0]], stiffness=[k], damping=[c])
    lin = body(spring, mass=M).linearize([], ["world.fuelslosh.fuel.r_B[0][0]"])
    assert lin.states == ["world.fuelslosh.rho[0]", "world.fuelslosh.drho[0]"]
    both = 1 / fuel + 1 / M
    same_poles(lin.poles(), np.roots([1, c * both, k * both]), 1e-10)

    sim = fledge.Simulation("rod")
    w = sim.world
    w.rod = world.SloshPendulum(mass=[fuel], length=[length], r_B=[[0, 0, 0]], rod_B=[[0, 0, -1]])
    w.craft = world.Spacecraft(I_B=1e9 * np.eye(3), mass=M, parts=[w.rod])      # it does not turn
    w.task("dynamics", every=10 * ms, run=[w.craft])
    sim.feed(w.craft.external, force_B=[0, 0, thrust] * N)
    sim.step()
    lin = sim.linearize([], [], hold=["world.craft.r_CN_N", "world.craft.v_CN_N", OMEGA, SIGMA])
    # The hub, which the rod pulls aside, is as heavy as if it were alone.
    swing = np.sqrt(thrust / (M * length))
    sideways = by_name(lin, ["world.rod.rod_B[0][0]", "world.rod.drod_B[0][0]"])
    same_poles(np.linalg.eigvals(sideways), [1j * swing, -1j * swing], 1e-9)


@pytest.mark.parametrize("periods", [1, 3])
def test_the_discrete_world_is_the_continuous_one_held(periods):
    wheels = world.ReactionWheels(axes_B=[[1, 0, 0], [0, 1, 0]], J=0.1, Omega=[20, 10])
    panel = world.HingedPanels(mass=5 * kg, I_B=[np.diag([2, 3, 4])], hinge_B=[[0, 0, 1]], axes_B=[[1, 0, 0]],
                               center_B=[[0, 1, 0]], stiffness=3, damping=0.1)
    sim = body(wheels, panel, mass=50, every=10 * ms)
    ports = ["world.reactionwheels.command.u[0]", f"{TORQUE}[1]"], [RATE, "world.hingedpanels.angles.theta[0]"]
    plain = sim.linearize(*ports)
    held = sim.linearize(*ports, discrete=True, period=periods * 10 * ms)
    n, k = len(plain.states), len(plain.inputs)
    both = expm(periods * 0.01 * np.block([[plain.A, plain.B], [np.zeros((k, n + k))]]))
    assert held.states == plain.states and held.dt == periods * 0.01
    assert held.A == pytest.approx(both[:n, :n], abs=1e-8)
    assert held.B == pytest.approx(both[:n, n:], abs=1e-9)
    assert held.C == pytest.approx(plain.C) and not held.D.any()


def test_a_parameter_may_be_an_input():
    sim = body(omega_BN_B=[0.1, 0.2, 0.3])
    lin = sim.linearize("world.craft.I_B[0, 0]", RATE)
    # Euler: I_0 domega_0 = (I_1 - I_2) omega_1 omega_2, and so on.
    wanted = [-(20 - 30) * 0.2 * 0.3 / 10**2, -0.1 * 0.3 / 20, 0.1 * 0.2 / 30]
    assert lin.B[:, 0] == pytest.approx(wanted, rel=1e-9)


# --- the loop --------------------------------------------------------------------------------------

K, P, STEP = 2.0, 10.0, 0.5


def loop(late=(), **control):
    """A body that flight keeps at rest by three wheels, without noise: K sigma + P omega."""
    sim = fledge.Simulation("loop")
    f, w = sim.flight, sim.world
    f.vehicle = fsw.VehicleConfig(I_B=I)
    f.wheels = fsw.WheelConfig(axes_B=np.eye(3), J=0.01 * kg * m**2, u_max=1 * N * m)
    f.guidance = fsw.InertialPointing()
    f.tracking = fsw.TrackingError()
    f.control = fsw.MrpFeedback(K=K, P=P, **control)
    f.motor = fsw.WheelTorques()
    w.wheels = world.ReactionWheels(axes_B=np.eye(3), J=0.01, u_max=1)
    w.craft = world.Spacecraft(I_B=I, parts=[w.wheels])
    w.nav = world.Navigation()
    f.connect(f.guidance.reference >> f.tracking.reference, f.tracking.error >> f.control.error,
              f.control.torque >> f.motor.torque, f.vehicle.vehicle >> f.control.vehicle,
              f.wheels.wheels >> [f.control.wheels, f.motor.wheels], w.craft.state >> w.nav.truth,
              (w.nav.attitude >> f.tracking.attitude).latency(int("attitude" in late)),
              w.wheels.speeds >> f.control.speeds,
              (f.motor.command >> w.wheels.command).latency(int("command" in late)))
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
    f.task("gnc", every=STEP, run=[f.guidance, f.tracking, f.control, f.motor])
    sim.run(2 * s)
    return sim


def loop_gain(omega, inertia, k=K, p=P):
    """K / 4 angle + P rate of a double integrator whose torque holds for a step."""
    z = np.exp(1j * omega * STEP)
    return k / 4 * STEP**2 / (2 * inertia) * (z + 1) / (z - 1)**2 + p * STEP / inertia / (z - 1)


@pytest.mark.parametrize("late", [(), ("command",), ("attitude",), ("attitude", "command")])
@pytest.mark.parametrize("cut", [CONTROL, "flight.motor.torque.torque_B", "world.wheels.command.u"])
def test_the_loop_gain_is_that_of_theory_wherever_it_is_cut(late, cut):
    out = {"world.wheels.command.u": "flight.motor.command.u"}.get(cut, CONTROL)
    lin = loop(late).linearize(f"{cut}[1]", f"{out}[1]", discrete=True, hold="world.wheels.h")
    omega = np.geomspace(0.01, 6, 20)
    delay = np.exp(-1j * omega * STEP) if "attitude" in late else 1
    assert -lin.frequency(omega)[:, 0, 0] == pytest.approx(loop_gain(omega, 20) * delay, rel=1e-8)
    assert lin.dt == STEP and not lin.notes
    waits = any(name.startswith("world.nav.attitude.sigma_BN") for name in lin.states)
    assert waits == ("attitude" in late)


def test_inputs_of_flight_and_of_the_world_act_from_the_same_instant():
    """The torque that flight reads at an instant, and one on the body from then on: each over a step."""
    lin = loop().linearize([f"{CONTROL}[1]", f"{TORQUE}[1]"], [f"{RATE}[1]", f"{CONTROL}[1]"], discrete=True)
    omega = np.geomspace(0.01, 6, 10)
    z = np.exp(1j * omega * STEP)
    response = lin.frequency(omega)
    for i in range(2):
        assert response[:, 0, i] == pytest.approx(STEP / 20 / (z - 1), rel=1e-8)
        assert -response[:, 1, i] == pytest.approx(loop_gain(omega, 20), rel=1e-8)


def test_margins_of_the_loop():
    sim = loop()
    lin = sim.linearize(f"{CONTROL}[0]", f"{CONTROL}[0]", discrete=True)
    margins = lin.margins()
    assert margins.stable
    # At half the rate the loop gain is -P T / (2 I), and nothing else brings it to -1 earlier.
    assert margins.gain == pytest.approx(2 * 10 / (P * STEP)) and margins.gain_at == pytest.approx(np.pi / STEP)
    at = loop_gain(margins.phase_at, 10)
    assert abs(at) == pytest.approx(1) and margins.phase == pytest.approx(np.pi + np.angle(at))
    assert margins.delay == pytest.approx(margins.phase / margins.phase_at)
    # With all the gain that the margin allows, the loop is at its limit: a pole at -1.
    sim.flight.control.K *= margins.gain
    sim.flight.control.P *= margins.gain
    poles = sim.linearize([], [f"{CONTROL}[0]"], discrete=True, hold="world.wheels.h").poles()
    assert abs(poles + 1).min() < 1e-6


@pytest.mark.filterwarnings("ignore:linearize")     # its wheels begin at their limits
def test_the_closed_loop_against_differences_by_hand():
    """What two runs from states beside each other differ by, a period later."""
    def run(which, h):
        sim = fledge.load("nadir_spin")
        getattr(sim.world.craft, which)[1] += h
        sim.step()
        return sim

    def numbers(sim):
        c, w = sim.world.craft.state, sim.world.wheels
        h = np.asarray(w.J[:4]) * (w.speeds.Omega[:4] + np.asarray(w.axes_B[:4]) @ c.omega_BN_B)
        return np.concatenate([c.r_BN_N, c.v_BN_N, c.sigma_BN, c.omega_BN_B, h, sim.flight.motor.command.u[:4]])

    lin = run("sigma_BN", 0).linearize([], [], discrete=True)
    assert lin.dt == 0.5
    for which, h in (("sigma_BN", 1e-5), ("omega_BN_B", 1e-7), ("r_BN_N", 10.0)):
        pair = run(which, h), run(which, -h)
        before = (numbers(pair[0]) - numbers(pair[1])) / (2 * h)
        for simulation in pair:
            simulation.run(until=0.5)
        after = (numbers(pair[0]) - numbers(pair[1])) / (2 * h)
        assert lin.A @ before == pytest.approx(after, rel=1e-6, abs=1e-7 * abs(after).max())


def test_an_input_of_flight_leads_through_the_loop():
    """Its steady state: the body turns to the new reference."""
    lin = loop().linearize("flight.tracking.reference.sigma_RN[2]", "world.craft.state.sigma_BN[2]", discrete=True)
    t, y = lin.step(10 * minute)
    assert y[0, 0, 0] == 0 and y[-1, 0, 0] == pytest.approx(1, abs=1e-3) and t[1] == 0.5


def test_a_part_runs_alone():
    sim = loop()
    plant = sim.linearize([f"world.wheels.command.u[{i}]" for i in range(3)], RATE, discrete=True, part="world")
    assert plant.dt == 0.1 and plant.B[:3] == pytest.approx(-0.1 * np.linalg.inv(I), abs=1e-9)
    flight = sim.linearize("flight.tracking.attitude.sigma_BN", CONTROL, discrete=True, part=sim.flight)
    assert flight.D == pytest.approx(-K * np.eye(3), abs=1e-9) and not flight.states
    control = sim.linearize("flight.control.error.omega_BR_B", CONTROL, discrete=True, part=[sim.flight.control])
    assert control.D == pytest.approx(-P * np.eye(3), abs=1e-9)


def test_memory_of_modules_is_a_state():
    lin = loop(K_I=0.1, u_I_max=5.0).linearize([f"{CONTROL}[0]"], [f"{CONTROL}[0]"], discrete=True)
    assert any(name.startswith("flight.control.") for name in lin.states)


@pytest.mark.filterwarnings("ignore:linearize")
def test_nothing_of_it_changes_the_run():
    sim, other = fledge.load("nadir_spin"), fledge.load("nadir_spin")
    for simulation in (sim, other):
        simulation.run(10 * s)
    before = sim.snapshot()
    sim.linearize(CONTROL, CONTROL, discrete=True)
    sim.linearize("world.wheels.command.u[0]", RATE)
    assert sim.snapshot() == before
    for simulation in (sim, other):
        simulation.run(10 * s)
    assert sim.snapshot() == other.snapshot()


# --- what is not smooth ----------------------------------------------------------------------------

def test_limits_and_steps_are_reported():
    sim = loop()
    command = "world.wheels.command.u[0]"
    sim.world.wheels.u_max[0] = 0.25
    sim.flight.wheels.u_max[0] = 0.25
    sim.flight.guidance.sigma_RN[0] = 0.2       # asks for 0.4 N m
    sim.run(1 * s)
    with pytest.warns(UserWarning, match=r"is not smooth in world.wheels.command.u\[0\]: its slope is 0 below and -0"):
        lin = sim.linearize(command, RATE)
    assert lin.notes
    with pytest.warns(UserWarning, match="is at its limits, where more has no effect"):
        sim.linearize("flight.motor.torque.torque_B[0]", "flight.motor.command.u[0]", discrete=True)


def test_a_limit_near_by_is_not_at_the_point():
    sim = loop()
    sim.world.wheels.u_max[0] = 0.25
    sim.flight.guidance.sigma_RN[0] = 0.12495   # asks for 0.2499 N m
    sim.run(0.5)
    lin = sim.linearize("world.wheels.command.u[0]", RATE, hold="world.wheels.h")
    assert abs(lin.u0[0]) == pytest.approx(0.2499) and lin.B[0, 0] == pytest.approx(-0.1, rel=1e-9) and not lin.notes


def test_a_memory_without_names_is_reported():
    sim = loop()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sim.linearize(f"{CONTROL}[0]", f"{CONTROL}[0]", discrete=True)
    sim = fledge.Simulation("tracker")
    w = sim.world
    w.craft = world.Spacecraft(I_B=I)
    w.tracker = world.StarTracker(boresight_B=[0, 0, 1], latency=0.3)
    w.connect(w.craft.state >> w.tracker.truth)
    w.task("dynamics", every=100 * ms, run=[w.craft, w.tracker])
    sim.run(1 * s)
    with pytest.warns(UserWarning, match="world.tracker remembers it in a memory without names"):
        sim.linearize(f"{TORQUE}[0]", ["world.tracker.attitude.sigma_BN", RATE], discrete=True)


# --- other tools take it ---------------------------------------------------------------------------

@pytest.mark.filterwarnings("ignore:Badly conditioned")
def test_scipy_takes_it_as_it_is():
    sim = loop()
    plain = sim.linearize("world.wheels.command.u[0]", f"{RATE}[0]")
    _, size, _ = signal.bode(tuple(plain), [1.0])
    assert size == pytest.approx([20 * np.log10(1 / 10)])
    assert signal.StateSpace(*plain).poles == pytest.approx(plain.ss().poles)
    held = sim.linearize("world.wheels.command.u[0]", f"{RATE}[0]", discrete=True, part="world")
    (_, (y,)) = signal.dstep(held, n=6)
    assert y[:, 0] == pytest.approx(held.step(0.5)[1][:, 0, 0])
    assert held.ss().dt == 0.1


# --- bad input -------------------------------------------------------------------------------------

@pytest.mark.parametrize("inputs, outputs, options, text", [
    ("world.wheels.command.v", RATE, {}, "world.wheels.command has no 'v'"),
    ("world.wheel.command.u", RATE, {}, "the process world has no 'wheel'; did you mean 'wheels'"),
    (TORQUE, "world.craft.state", {}, "is a whole message; name one of its fields"),
    (TORQUE, TORQUE, {}, f"{TORQUE} is no output"),
    ("world.craft.sigma_BN", RATE, {}, "is an initial value, which has no effect any more"),
    ("world.craft.state.head.t", RATE, {}, "expected numbers of the type double"),
    (CONTROL, RATE, {}, "flight.motor.torque is read by no model that integrates"),
    (TORQUE, CONTROL, {}, "does not follow from the differential equations"),
    ("flight.motor.command.saturated", RATE, {}, "has no 'saturated'"),
    ([f"{TORQUE}[0]", TORQUE], RATE, {}, "torque_B.0. is named twice"),
    (1, RATE, {}, "int"),
    ([1], RATE, {}, "expected paths"),
    (TORQUE, RATE, {"period": 1}, "part and period are for discrete=True"),
    (TORQUE, RATE, {"hold": "world.craft.omega"}, "no differential state world.craft.omega; did you mean"),
    (TORQUE, RATE, {"discrete": True, "part": "moon"}, "there is no 'moon'; expected processes"),
    (TORQUE, RATE, {"discrete": True, "period": 0.3}, "expected a multiple of 0.5 s"),
    (TORQUE, CONTROL, {"discrete": True, "part": "world"}, "is not of the part"),
    ("world.nav.orbit.r_BN_N", RATE, {"discrete": True}, "nothing reads world.nav.orbit"),
])
def test_bad_input(inputs, outputs, options, text):
    with pytest.raises((SetupError, TypeError), match=text):
        loop().linearize(inputs, outputs, **options)


def test_there_must_be_a_state():
    sim = fledge.load("nadir_spin")
    with pytest.raises(SetupError, match="nadir_spin has not run, so it is in no state yet; sim.step"):
        sim.linearize(CONTROL, CONTROL, discrete=True)
    sim = fledge.Simulation("flight alone")
    sim.flight.guidance = fsw.InertialPointing()
    sim.flight.task("gnc", every=1, run=[sim.flight.guidance])
    sim.step()
    with pytest.raises(SetupError, match="no model of flight alone integrates differential equations"):
        sim.linearize([], [])
