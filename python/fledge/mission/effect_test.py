# SPDX-License-Identifier: Apache-2.0
"""What is written has an effect, or is refused with what to do instead; what is implausible warns."""

import re
import subprocess
import sys
import warnings

import pytest

import fledge
from fledge import Orbit, SetupError, cli, flight as fsw, world
from fledge.targets.loop import environment
from fledge.units import N, deg, kg, km, m, mm, rad, s


@pytest.fixture
def sim():
    return fledge.load("nadir_spin")


# --- inputs ----------------------------------------------------------------------------------------

def test_a_wired_input_is_not_assigned_and_its_arrays_are_read_only(sim):
    text = (r"^flight.control.error.sigma_BR: flight.tracking.error >> flight.control.error writes this input before "
            r"each update, so that an assignment has no effect. Change what flight.tracking works with; or leave out "
            r"the wire, and give the messages by sim.feed\(flight.control.error, ...\)$")
    for _ in range(2):      # before the first run, and between two
        twin = sim.clone()
        with pytest.raises(SetupError, match=text):
            sim.flight.control.error.sigma_BR = [0.1, 0, 0]
        with pytest.raises(SetupError, match="flight.control.error: flight.tracking.error >> "):
            sim.flight.control.error = {"sigma_BR": [0.1, 0, 0]}
        with pytest.raises(ValueError, match="read-only"):
            sim.flight.control.error.sigma_BR[0] = 0.1
        with pytest.raises(SetupError, match=r"world.wheels.command.u: flight.motor.command >> world.wheels.command "):
            twin.world.wheels.command.u = 0.1
        sim.run(10 * s)


def test_an_input_without_a_wire_is_assigned_and_one_that_is_fed_is_not():
    sim = fledge.Simulation()
    f = sim.flight
    f.control = fsw.MrpFeedback(K=1, P=2)
    f.control.error.sigma_BR = [0.1, 0, 0]
    assert f.control.error.sigma_BR[0] == 0.1
    sim.feed(f.control.error, sigma_BR=[0, 0.2, 0])
    with pytest.raises(SetupError, match=r"error.sigma_BR: this input is fed by hand, so that an assignment has no "
                                         r"effect; give other messages by sim.feed\(flight.control.error, ...\)"):
        f.control.error.sigma_BR = [0.1, 0, 0]


def test_an_assigned_input_that_says_that_nothing_was_written_is_refused(sim):
    """A module reads an input by its head."""
    sim.flight.control.external.torque_B = [0.1, 0, 0]
    for _ in range(2):
        with pytest.raises(SetupError, match=r"^flight.control.external was assigned, but its head says that nothing "
                                             r"was written, so that nothing reads it: give the message by sim.feed\("):
            sim.run(1 * s)
    sim.flight.control.external.head = {"quality": "GOOD", "sequence": 1}
    sim.run(1 * s)
    sim.reset()
    sim.feed(sim.flight.control.external, torque_B=[0.1, 0, 0])
    sim.run(1 * s)


def test_a_free_input_that_is_assigned_between_two_runs_acts_as_the_refusal_says():
    """No feed can begin then."""
    sim = craft(mass=2 * kg)
    sim.run(1 * s)
    external = sim.world.craft.external
    external.force_N = [4, 0, 0] * N
    with pytest.raises(SetupError, match=r'it: write its head too, world.craft.external.head = {"quality": "GOOD", '
                                         r'"sequence": 1}; or reset\(\) the simulation, and give the message by '):
        sim.run(1 * s)
    external.head = {"quality": "GOOD", "sequence": 1}
    sim.run(1 * s)
    assert sim.world.craft.state.v_CN_N[0] == pytest.approx(2.0)


def test_a_process_that_is_left_alone_has_inputs_to_write(sim):
    """Its wires from others are gone."""
    sim.isolate("flight")
    sim.flight.tracking.attitude.sigma_BN = [0.1, 0, 0]
    with pytest.raises(SetupError, match="flight.tracking.reference: flight.spin.reference >> "):
        sim.flight.tracking.reference = {}


# --- before the first run --------------------------------------------------------------------------

def two_modes():
    sim = fledge.load("nadir_spin")
    f = sim.flight
    f.mode("on", [f.gnc])
    f.mode("off", [])
    f.event("late", when=f.watch(f.tracking.error).sigma_BR.norm() < 10, armed=False, enter=f.off)
    return sim


@pytest.mark.parametrize("prepared", [False, True])
@pytest.mark.parametrize("changes", [False, True])
def test_a_request_before_the_first_run_waits_for_it(prepared, changes):
    """Also where a changed parameter lets the simulation begin anew."""
    sim, other = two_modes(), two_modes()
    for simulation in (sim, other):
        if prepared:
            simulation.prepare()
    sim.flight.off.enter()
    other.flight.late.armed = True
    assert sim.flight.requested_mode == "off" and sim.mode == "on" and other.flight.late.armed
    for simulation in (sim, other, sim.clone()):
        if changes:
            simulation.flight.control.K = 3 * N * m
        simulation.run(10 * s)
        assert simulation.mode == "off"
    assert other.flight.late.fired_at == 0
    for simulation in (sim, other):        # and a reset forgets it
        simulation.reset()
        simulation.run(10 * s)
        assert simulation.mode == "on"


def test_a_command_before_the_first_run_waits_for_it_too(sim):
    sim.flight.commands.write(sim.flight.control, K=9 * N * m)
    sim.flight.control.P = 46 * N * m * s
    sim.run(1 * s)
    assert sim.flight.control.K == 9 and sim.flight.control.P[0, 0] == 46
    assert [report.executed for report in sim.flight.commands.reports] == [False, True]


@pytest.mark.parametrize("change", [
    lambda w: setattr(w.craft, "gravity", [world.MOON]), lambda w: setattr(w.craft, "parts", [world.ExternalForce()]),
    lambda w: setattr(w.craft, "sky", world.Sky("2026-01-01", "Mars")),
    lambda w: setattr(w, "integrator", world.RK4())])
def test_the_set_up_of_a_model_is_changed_before_the_run(change, sim):
    sim.run(1 * s)
    with pytest.raises(SetupError, match="the simulation has run until 1 s; reset it before its structure or seed "):
        change(sim.world)


def test_gravity_counts_that_comes_after_the_simulation_was_prepared():
    ends = []
    for prepared in (False, True):
        sim = craft(mass=10 * kg, r_BN_N=[7000 * km, 0, 0])
        if prepared:
            sim.prepare()
        sim.world.craft.gravity = [world.EARTH]
        sim.run(10 * s)
        ends.append(sim.world.craft.state.r_BN_N[0])
    assert ends[0] == ends[1] < 6999.8e3


def test_outputs_and_memory_are_not_set_before_the_run_which_resets_them():
    sim = fledge.Simulation()
    with pytest.raises(SetupError, match="flight.control: torque of this MrpFeedback cannot be set, for the run begins "
                                         "with a reset, which clears outputs and memory; set parameters"):
        sim.flight.control = fsw.MrpFeedback(K=1, P=2, torque={"torque_B": [1, 2, 3]})
    sim = fledge.load("nadir_spin")
    for _ in range(2):
        with pytest.raises(SetupError, match="flight.control.newest is memory, and the run begins with a reset"):
            sim.flight.control.newest = 3
        sim.step()
        sim.flight.control.newest = 3
        twin = sim.clone()
        twin.flight.control.newest = 4
        assert sim.flight.control.newest == 3
        sim.reset()


# --- names -----------------------------------------------------------------------------------------

@pytest.mark.parametrize("write, text", [
    (lambda sim: setattr(sim, "sed", 3), "Simulation has no 'sed' to set; did you mean 'seed'?"),
    (lambda sim: setattr(sim, "plot", False), "Simulation has no 'plot' to set; did you mean 'plots'?"),
    (lambda sim: setattr(sim.flight.late, "hold", 3), "event flight.late: 'hold' cannot be set, only 'armed'; the rest "
     "is given where the event is declared"),
    (lambda sim: setattr(sim.flight.late, "armd", True), "event flight.late: 'armd' cannot be set, only 'armed'"),
    (lambda sim: setattr(sim.world.craft.orbit, "i", 0.1), "Orbit: 'i' cannot be set, for nothing would follow it: "
     "make another Orbit(...), and give it to the craft"),
])
def test_a_name_that_nothing_reads_is_refused(write, text):
    with pytest.raises((AttributeError, SetupError)) as error:
        write(two_modes())
    assert str(error.value).startswith(text)


def test_the_mode_to_begin_with_is_chosen_before_the_run():
    sim = two_modes()
    sim.prepare()
    sim.flight.start_in("off")
    sim.run(1 * s)
    assert sim.mode == "off"
    with pytest.raises(SetupError, match="the simulation has run until 1 s; reset it before its structure or seed"):
        sim.flight.start_in("on")


# --- implausible values ----------------------------------------------------------------------------

@pytest.fixture
def warned():
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield lambda: [str(warning.message) for warning in found]


def craft(**parameters):
    sim = fledge.Simulation()
    sim.world.craft = world.Spacecraft(**{"I_B": [700, 700, 800] * kg * m**2, **parameters})
    sim.world.task("dynamics", every=1 * s, run=[sim.world.craft])
    return sim


@pytest.mark.parametrize("make, text", [
    (lambda: Orbit(world.EARTH, altitude=500), "Orbit: its lowest point is 500 m above EARTH; for kilometres write "
     r"500 \* km, and EARTH.with_surface\("),
    (lambda: Orbit("Mars", rp=3400 * km, e=0.5), "Orbit: its lowest point is 3000 m above MARS"),
    (lambda: craft(omega_BN_B=[0, 3, 0]).run(1), "world.craft.omega_BN_B: 3 rad/s is 171.9 deg/s; for degrees write 3 "
     r"\* deg / s"),
    (lambda: craft(mass=10 * kg, I_B=[2e6, 2e6, 3e6]).step(), "world.craft: 10 kg with an inertia of 3e.06 kg m.2 is a "
     "body of some 5.5e.02 m; look at both units"),
    (lambda: craft(mass=10 * kg, center_B=[120, 0, 0]).run(1), "world.craft.center_B: 120 m is far from the body's "
     r"origin; for millimetres write 120 \* mm"),
])
def test_an_implausible_value_warns_with_what_may_be_meant(make, text, warned):
    make()
    found, = warned()
    assert re.match("implausible: " + text, found)


def test_what_is_implausible_warns_once_in_the_life_of_a_simulation(warned, tmp_path):
    (tmp_path / "flight.py").write_text("def build(f):\n    pass\n")
    (tmp_path / "world.py").write_text("from fledge import world\n\n\ndef build(w, f):\n    w.craft = world.Spacecraft("
                                       "I_B=1, omega_BN_B=[0, 3, 0])\n    w.task('dynamics', every=1, run=[w.craft])\n")
    sim = fledge.load(tmp_path)
    for simulation in (sim, sim.clone()):
        simulation.run(1)
    sim.reset()
    sim.run(1)
    assert len(warned()) == 1
    sim.reset()
    sim.world.craft.omega_BN_B = [0, 4, 0]
    sim.run(1)
    assert len(warned()) == 2


def test_a_period_in_nanoseconds_warns_before_the_flight_at_its_line(warned):
    sim = craft()
    sim.world.probe, sim.world.other = (world.Spacecraft(mass=1, I_B=1) for _ in range(2))
    exec(compile("w.task('slow', every=100_000_000, run=[w.probe])\nw.task('rare', every=10 * 86400, run=[w.other])",
                 "world.py", "exec"), {"w": sim.world})
    with pytest.warns(UserWarning) as found:
        sim.run(1)
    assert [(str(each.message), each.filename, each.lineno) for each in found] == [
        ("implausible: world.slow runs every 1157.41 days; every is in seconds", "world.py", 1)]


def test_values_with_a_unit_and_plausible_ones_do_not_warn(warned):
    Orbit(world.EARTH, altitude=120 * km)
    Orbit(world.MOON, altitude=20 * km)
    Orbit(world.EARTH.with_surface(6370 * km), altitude=500 * m)
    Orbit.from_state(world.EARTH, [6378.2 * km, 0, 0], [0, 7.9 * km / s, 0])
    craft(omega_BN_B=[0, 0, 60 * deg / s], mass=1.3 * kg, center_B=[20, 0, 0] * mm).run(1)
    craft(omega_BN_B=[0, 0, 6.28] * rad / s, mass=420e3, I_B=[1.3e8, 1e8, 2e8]).run(1)
    assert warned() == []


def test_no_mission_has_an_implausible_value(warned):
    for name in fledge.missions():
        fledge.load(name)
    assert [text for text in warned() if text.startswith("implausible")] == []


def test_configuration_that_nothing_reads_warns(tmp_path, warned):
    (tmp_path / "flight.py").write_text("from fledge import flight as fsw\n\n\ndef build(f):\n"
                                        "    f.vehicle = fsw.VehicleConfig(I_B=[1, 1, 1])\n")
    fledge.load(tmp_path)
    assert warned() == ["flight.vehicle: nothing reads vehicle of this VehicleConfig, so that its parameters "
                        "have no effect; wire it, or leave it out"]


KEPT = """import numpy as np

from fledge import flight as fsw
from fledge.units import s


def build(f):
    f.wheels = fsw.WheelConfig(axes_B=np.eye(3), J=1, u_max=1)
    f.damp = fsw.RateDamping(P=1, torque_max=1)
    f.motor = fsw.WheelTorques(hold=2 * s)
    f.connect(f.damp.torque >> f.motor.torque, f.wheels.wheels >> f.motor.wheels)
    f.task("law", every=1 * s, run=[f.damp])
    f.task("act", every=1 * s, run=[f.motor])
    f.mode("on", ["law", "act"])
    f.mode("off", ["act"])
"""
KEPT_WORLD = """import numpy as np

from fledge import world


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=np.eye(3), J=1, u_max=1)
    w.gyro = world.Gyro()
    w.craft = world.Spacecraft(I_B=1, parts=[w.wheels])
    w.connect(f.motor.command >> w.wheels.command, w.craft.state >> w.gyro.truth, w.gyro.rate >> f.damp.gyro)
    w.task("dynamics", every=1, run=[w.craft, w.gyro])
"""


@pytest.mark.parametrize("old, new, expected", [
    ("", "", ["flight.motor.torque: the mode off suspends flight.damp.torque, so that the last value stays good and "
              "acts on; write .stale_after(2 * s) behind its wire, or let a module that runs then write it"]),
    ("f.damp.torque >> f.motor.torque,", "(f.damp.torque >> f.motor.torque).stale_after(2 * s),", []),
    ('"off", ["act"]', '"off", ["law", "act"]', []),
])
def test_a_torque_that_outlives_its_mode_warns(tmp_path, warned, old, new, expected):
    (tmp_path / "flight.py").write_text(KEPT.replace(old, new))
    (tmp_path / "world.py").write_text(KEPT_WORLD)
    sim = fledge.load(tmp_path)
    assert warned() == expected
    sim.run(10 * s)
    sim.flight.enter("off")
    sim.run(60 * s)
    command, law = sim.flight.motor.command, sim.flight.damp.torque
    old = sim.time_ns - law.head.t >= 59e9
    assert (command.head.quality.name == "GOOD") == (expected != [] or not old)


def test_a_command_says_it_once_in_one_line(tmp_path):
    mission = tmp_path / "low"
    mission.mkdir()
    (mission / "flight.py").write_text("def build(f):\n    pass\n")
    (mission / "world.py").write_text(
        "from fledge import Orbit, world\n\n\ndef build(w, f):\n"
        "    w.craft = world.Spacecraft(I_B=[1, 1, 1], gravity=[world.EARTH], orbit=Orbit(world.EARTH, altitude=500))\n"
        "    w.task('dynamics', every=1, run=[w.craft])\n")
    done = subprocess.run([sys.executable, "-m", "fledge.cli", "run", str(mission), "--for", "1s"], cwd=tmp_path,
                          env=environment(), capture_output=True, text=True)
    line, = done.stderr.splitlines()
    assert done.returncode == 0 and line.startswith("fledge: low/world.py, line 5: implausible: Orbit: its lowest "
                                                    "point is 500 m above EARTH")


# --- files that name the wrong process -------------------------------------------------------------

FLIGHT = """from fledge import flight as fsw


def build({arguments}):
    {arguments}.target = fsw.InertialPointing()
    {arguments}.task("gnc", every=1, run=[{arguments}.target])
"""
WORLD = """from fledge import flight as fsw, world


def build({arguments}):
    w.nav = world.CelestialBody(body="Earth")
    {more}
"""


@pytest.mark.parametrize("flight, arguments, more, text", [
    ("w", "w, f", "", r"bad/flight.py, line 4: build\(\) gets f, flight; it calls the flight 'w'$"),
    ("f", "w, altitude=500, *, turn=4", "", r"bad/world.py, line 4: build\(\) gets w, f, world and flight, and then "
     r"its parameters: write build\(w, f, altitude=500, turn=4\)$"),
    ("f", "", "", r"bad/world.py, line 4: build\(\) gets w, f, .*: write build\(w, f\)$"),
    ("f", "f, w", "", r"bad/world.py, line 4: build\(\) gets w, f, world and flight; it calls the world 'f'$"),
    ("f", "w, f", "f.more = fsw.InertialPointing()", r"bad/world.py makes flight.more: what flies is composed in "
     "flight.py, which targets take; world.py joins the world to it$"),
    ("f", "w, f", "f.mode('x', []); f.task('y', every=1, run=[f.target])", "world.py makes |is already in task"),
    ("f", "w, f", "w.more = fsw.InertialPointing()", "world.more: a InertialPointing is a flight module, and this "
     "process is a world; assign it to a flight process, in flight.py"),
])
def test_a_file_that_composes_the_wrong_process_is_refused(flight, arguments, more, text, tmp_path, capsys):
    mission = tmp_path / "bad"
    mission.mkdir()
    (mission / "flight.py").write_text(FLIGHT.format(arguments=flight))
    (mission / "world.py").write_text(WORLD.format(arguments=arguments, more=more or "pass"))
    assert cli.main(["run", str(mission), "--for", "1s"]) == 2
    assert re.search(text, capsys.readouterr().err.strip())
