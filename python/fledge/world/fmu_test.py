# SPDX-License-Identifier: Apache-2.0
"""FMUs as models of the world: an oscillator of fmi/testing against its closed form, and what goes wrong."""

import math
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import fledge
from fledge import SetupError, Simulation, _core, prototype, world
from fledge.export.fmu.build import export
from fledge.export.fmu.composition import simulation_fmu
from fledge.export.fmu.mission import flight_fmu
from fledge.mission.wiring import Wiring
from fledge.montecarlo import Campaign
from fledge.units import N, cm, m, ms, rad, s
from fledge.fmi import interface
from fmi.testing import oscillator

VERSIONS = pytest.mark.parametrize("version", [2, 3])


def flown(path, period=100 * ms, seed=1, **options):
    sim = Simulation("fmus", seed=seed)
    w = sim.world
    w.spring = world.Fmu(path, **options)
    w.task("dynamics", every=period, run=[w.spring])
    return sim


@pytest.fixture(params=[2, 3])
def path(request, tmp_path):
    return oscillator.make(tmp_path, request.param)


def swing(t, omega=2.0, x0=1.0, force=0.0):
    """(x, v) of x'' = force - omega^2 x from rest."""
    rest = force / omega**2
    return rest + (x0 - rest) * np.cos(omega * t), -(x0 - rest) * omega * np.sin(omega * t)


@pytest.mark.parametrize("longest", [0.0, 0.03])
def test_it_swings_as_its_closed_form_also_by_shorter_steps(path, longest):
    sim = flown(path, omega=3 * rad / s, x0=50 * cm, longest=longest * s)
    log = sim.record(sim.world.spring.outputs)
    sim.run(10)
    x, v = swing(np.arange(101) / 10, 3.0, 0.5)
    np.testing.assert_allclose(log["outputs.x"], x, atol=1e-13)
    np.testing.assert_allclose(log["outputs.v"], v / 100, atol=1e-13)   # the FMU says that its v is in cm/s


def test_inputs_of_the_first_instant_count_and_those_of_no_wire_keep_their_start(path):
    sim = flown(path)
    sim.feed(sim.world.spring.inputs, force=[8.0, 8.0, 0.0] * N, time=[0, 1, 2] * s)
    sim.run(1.95 * s)
    assert math.isclose(sim.world.spring.outputs.x, swing(1.9, force=8.0)[0], abs_tol=1e-13)
    free = flown(path)
    free.run(1.95 * s)
    assert math.isclose(free.world.spring.outputs.x, swing(1.9)[0], abs_tol=1e-13)


@VERSIONS
def test_each_type_comes_back_with_its_bits(tmp_path, version):
    sim = flown(oscillator.make(tmp_path, version))
    given = {"in_i32": -2**31, "in_flag": 1, "in_choice": 2, "in_array": [0.1, -1e100, 1e-100], "in_text": "Grüße"}
    if version == 3:
        given |= {"in_f32": np.float32(0.1), "in_i8": -128, "in_u8": 255, "in_i16": -32768, "in_u16": 65535,
                  "in_u32": 2**32 - 1, "in_i64": -2**63, "in_u64": 2**64 - 1}
    sim.feed(sim.world.spring.inputs, **given)
    outputs = sim.world.spring.outputs
    sim.run(100 * ms)
    for name, value in given.items():
        np.testing.assert_array_equal(getattr(outputs, name.replace("in_", "out_")), value, err_msg=name)


def test_events_and_clocks_are_counted(path):
    sim = flown(path, period=500 * ms, every=200 * ms)
    sim.run(1)
    outputs = sim.world.spring.outputs
    assert outputs.events == 5
    assert not hasattr(outputs, "tick") or outputs.tick == 5


def test_a_snapshot_a_clone_and_a_campaign_go_on_with_the_same_bits(path):
    sim = flown(path, every=70 * ms)
    sim.run(1)
    snapshot = sim.snapshot()
    twin = sim.clone()
    sim.run(2)
    last = bytes(np.asarray([sim.world.spring.outputs.x, sim.world.spring.outputs.v]))
    twin.run(2)
    assert bytes(np.asarray([twin.world.spring.outputs.x, twin.world.spring.outputs.v])) == last
    sim.restore(snapshot)
    sim.run(2)
    assert bytes(np.asarray([sim.world.spring.outputs.x, sim.world.spring.outputs.v])) == last
    sim.reset()
    sim.run(3)
    np.testing.assert_allclose(sim.world.spring.outputs.x, swing(3.0)[0], atol=1e-13)


def test_parameters_change_in_a_run_only_where_they_may(path):
    sim = flown(path)
    sim.run(1)
    x, v = swing(1.0)
    sim.world.spring.omega = 4 * rad / s
    sim.run(1)
    assert math.isclose(sim.world.spring.outputs.x, x * math.cos(4) + v / 4 * math.sin(4), abs_tol=1e-12)
    sim.world.spring.x0 = 2 * m
    with pytest.raises(SetupError, match="x0 is an initial value"):
        sim.run(3)


class Push(prototype.Message):
    """A force along an axis."""

    forces = prototype.field(float, "[N] along each axis", shape=2)


class Pusher(prototype.Module):
    """Pushes with a constant force."""

    push = prototype.out(Push)

    def update(self, t, dt):
        self.push.forces = [1.0, 4.0]
        self.publish(self.push)


def test_messages_of_others_have_variables_as_fields(path):
    sim = Simulation("wired")
    f, w = sim.flight, sim.world
    w.spring = world.Fmu(path, messages={"push": (Push, {"forces[1]": "force"})})
    f.pusher = Pusher()
    w.connect(f.pusher.push >> w.spring.push)
    f.task("control", every=100 * ms, run=[f.pusher])
    w.task("dynamics", every=100 * ms, run=[w.spring])
    sim.run(1)
    assert abs(w.spring.outputs.x - swing(1.0, force=4.0)[0]) < 0.1     # the first push may come a tick late
    assert not hasattr(w.spring.inputs, "force")


@pytest.mark.parametrize(("fields", "says"), [
    ({"forces[2]": "force"}, r"spring|beyond the shape \(2,\)"),
    ({"force": "force"}, "has no field 'force'; did you mean 'forces'"),
    ({"forces[0]": "forc"}, "there is no variable 'forc'; did you mean 'force'"),
    ({"forces[0]": "omega", "forces[1]": "force"}, "all inputs, or none is"),
    ({"forces": "force"}, "2 and 1 elements"),
    ({"forces[0]": "in.text"}, "do not fit: a field of double, a variable of String"),
    ({"forces[0]": "x"}, "different dimensions: N and m"),
])
def test_a_message_that_does_not_fit_is_refused(tmp_path, fields, says):
    with pytest.raises(SetupError, match=says):
        world.Fmu(oscillator.make(tmp_path), messages={"push": (Push, fields)})


@pytest.mark.parametrize("factor", [0.01, -0.01])
def test_bounds_have_the_unit_of_their_parameter(tmp_path, factor):
    text = oscillator.description(2, token=str(factor)).replace('s="-1" factor="0.01"', f's="-1" factor="{factor}"')
    text = text.replace('<Real unit="m" start="1"/>', '<Real unit="cm/s" start="1" min="-1" max="300"/>')
    spring = world.Fmu(oscillator.make(tmp_path, 2, text))
    bounds = next(f.bounds for f in _core.struct(spring).fields if f.name == "x0")
    assert spring.x0 == factor and bounds[:2] == tuple(sorted((-factor, 300 * factor)))


@pytest.mark.parametrize("version", ["2", "3"])
def test_parameters_in_nanoseconds_keep_their_bounds(tmp_path, version):
    sim = flown(export(flight_fmu(fledge.load("flatsat")), tmp_path / "flight.fmu", version))
    sim.check()
    with pytest.raises(SetupError, match=r"flight_stars_tick must be in \[1e?"):
        sim.world.spring.flight_stars_tick = 10 * s if version == "2" else 10_000_000_000


def test_a_start_that_its_type_cannot_hold_is_refused(tmp_path):
    text = oscillator.description(3)
    for name, start, kind in (("in.i8", "300", "Int8"), ("in.u64", "-1", "UInt64"), ("in.flag", "2", "Boolean"),
                              ("in.choice", str(2**40), "Enumeration"), ("in.i32", "9" * 5000, "Int32")):
        wrong = re.sub(f'(name="{name}"[^>]* start=)"[^"]*"', rf'\1"{start}"', text)
        assert wrong != text
        with pytest.raises(SetupError, match=f"the start of {name} is no {kind}: {start[:40]}"):
            world.Fmu(oscillator.make(tmp_path, text=wrong))


def test_names_that_would_be_equal_have_numbers(tmp_path):
    rows = "".join(f'<Float64 name="{"+" * i}" valueReference="{i}" causality="output"/>' for i in range(1, 4))
    text = oscillator.description(3).replace("<ModelVariables>", f"<ModelVariables>{rows}")
    names = [f.name for f in _core.struct(world.Fmu(oscillator.make(tmp_path, text=text)).outputs).fields]
    assert names[1:6] == ["v_", "v__2", "v__3", "x", "v"]


def test_fields_and_the_names_of_their_values_are_limited_together(tmp_path, monkeypatch):
    monkeypatch.setattr(interface, "MOST_FIELDS", 50)
    items = "".join(f'<Item name="i{i}" value="{i}"/>' for i in range(20))
    text = oscillator.description(3).replace('<Item name="ON"', f'{items}<Item name="ON"')
    with pytest.raises(SetupError, match="oscillator.fmu: 14 inputs, 17 outputs and 4 parameters with 44 names of "
                                         "values; at most 50 can be fields"):
        world.Fmu(oscillator.make(tmp_path, text=text))


def both(folder, version):
    """nadir_spin by the FMUs of its world and its flight, in one process; flight after the world."""
    sim = Simulation("both")
    w = sim.world
    w.plant = world.Fmu(export(simulation_fmu(fledge.load("nadir_spin"), "world"), folder / "world.fmu", version))
    w.computer = world.Fmu(export(flight_fmu(fledge.load("nadir_spin")), folder / "flight.fmu", version))
    for port in ("world_nav_attitude", "world_nav_orbit", "world_wheels_speeds"):
        w.connect(getattr(w.plant, port) >> getattr(w.computer, port))
    w.connect(w.computer.flight_motor_command >> w.plant.flight_motor_command)
    w.task("plant", every=100 * ms, run=[w.plant], priority=1)
    w.task("computer", every=500 * ms, run=[w.computer])
    return sim


@pytest.mark.parametrize("version", ["3", "2"])
def test_fmus_of_fledge_have_its_messages_and_bits(tmp_path, version):
    desktop, sim = fledge.load("nadir_spin"), both(tmp_path, version)
    for duration in (0, 30 * s, 30 * s):
        desktop.run(duration)
        sim.restore(sim.snapshot()) if duration else None
        sim.run(duration)
        w, nav = sim.world, desktop.world.nav
        for mine, theirs in ((w.plant.world_nav_attitude, nav.attitude), (w.plant.world_nav_orbit, nav.orbit),
                             (w.computer.flight_motor_command, desktop.flight.motor.command)):
            assert _core.memory(mine) == _core.memory(theirs), _core.path(theirs)


def test_a_campaign_disperses_parameters_of_an_fmu(path, tmp_path):
    folder = tmp_path / "spring"
    folder.mkdir()
    (folder / "world.py").write_text(f"""from fledge import world


def build(w, f):
    w.spring = world.Fmu({str(path)!r})
    w.task("dynamics", every=0.1, run=[w.spring])
""")
    (folder / "flight.py").write_text("""from fledge import flight as fsw


def build(f):
    f.guidance = fsw.InertialPointing()
    f.task("gnc", every=1, run=[f.guidance])
""")
    (folder / "dispersions.py").write_text("""from fledge.units import m, rad, s


def spread(d):
    \"\"\"Any start.\"\"\"
    d.duration = 2 * s
    d.every = 1 * s
    d["world.spring.x0"] = d.uniform(-1 * m, 1 * m)
    d["world.spring.omega"] = d.uniform(1 * rad / s, 3 * rad / s)
    d.retain("world.spring.outputs.x")
""")
    result = Campaign(folder).fly(20, seed=3, threads=2)
    x0, omega = (result.draws[f"world.spring.{name}"] for name in ("x0", "omega"))
    assert not result.failures
    np.testing.assert_allclose(result.retained["world.spring.outputs.x"][:, 2], x0 * np.cos(2 * omega), atol=1e-14)


def test_what_shows_a_mission_names_the_file(path):
    assert "spring  Oscillator; oscillator.fmu, FMI " in Wiring(flown(path)).outline()


def test_parameters_have_units_and_names(path):
    with pytest.raises(SetupError, match="expected a quantity in m; found 1.0 s"):
        world.Fmu(path, x0=1 * s)
    with pytest.raises(AttributeError, match="omga"):
        world.Fmu(path, omga=1)
    with pytest.raises(SetupError, match="x0 is given twice"):
        world.Fmu(path, {"x0": 1 * m}, x0=2 * m)


def test_an_fmu_without_states_flies_but_has_no_snapshot(tmp_path):
    text = oscillator.description(3, 'canHandleVariableCommunicationStepSize="true"')
    sim = flown(oscillator.make(tmp_path, text=text))
    sim.clone().run(1)      # from the start
    sim.run(1)
    with pytest.raises(SetupError, match=r"world.spring \(oscillator.fmu\): no snapshot.* canSerializeFMUState"):
        sim.snapshot()


def test_a_single_instance_in_a_program_is_kept_to(tmp_path):
    text = oscillator.description(3, 'canBeInstantiatedOnlyOncePerProcess="true"')
    path = oscillator.make(tmp_path, text=text)
    first = flown(path)
    first.run(1)
    with pytest.raises(SetupError, match="may be in a program once"):
        flown(path).run(1)
    del first
    flown(path).run(1)


MISBEHAVING = """
import os, signal, sys
import numpy
from fledge import Simulation, _core, world, errors
from fledge.fmi import interface

for line in sys.stdin:      # each case is a process of its own, which need not import all that again
    path, os.environ["OSCILLATOR"], output = line[:-1].split("\\t")
    if not (child := os.fork()):
        break
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
else:
    sys.exit()
signal.alarm(60)
os.dup2(os.open(output, os.O_WRONLY | os.O_CREAT), 2)
_core.limit_updates(300_000_000)
sim = Simulation("fmus")
w = sim.world
w.spring = world.Fmu(path)
w.task("dynamics", every=0.1, run=[w.spring])
try:
    sim.run(1)
    sim.snapshot()
except (errors.SetupError, errors.RunError) as error:
    sys.exit(str(error))
"""


@pytest.fixture(scope="module")
def misbehaving():
    """Fly an FMU with a fault in a process of its own; returns the exit code and what it says."""
    with subprocess.Popen([sys.executable, "-c", MISBEHAVING], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                          env={**os.environ, "OPENBLAS_NUM_THREADS": "1"}) as process:     # it forks
        def fly(path, fault):
            output = path.with_suffix(".err")
            print(path, fault, output, sep="\t", file=process.stdin, flush=True)
            return int(process.stdout.readline()), output.read_text()

        yield fly


def test_starts_of_64_bits_are_exact():
    numbers = [1, 2**63 + 1, 2**64 - 1]
    assert interface._array(numbers, np.dtype("u8")).tolist() == numbers
    for wrong, dtype in (([2**64], "u8"), ([-1], "u8"), ([300], "i1"), ([np.nan], "i4")):
        with pytest.raises(ValueError):
            interface._array(wrong, np.dtype(dtype))


def test_a_feed_leaves_other_inputs_at_their_starts(path):
    sim = flown(path)
    sim.feed(sim.world.spring.inputs, force=8 * N)
    sim.run(1)
    assert sim.world.spring.outputs.out_choice == 1 and sim.world.spring.inputs.force == 8


@VERSIONS
@pytest.mark.parametrize(("fault", "says"), [
    pytest.param("segv DoStep 0.5", "segmentation fault (SIGSEGV) in world.spring (Oscillator), task dynamics, in "
                 "fmi{v}DoStep of oscillator.fmu, at t = 0.6 s", marks=oscillator.CRASH),
    ("endless DoStep 0.5", "no end of the update in world.spring (Oscillator), task dynamics, in fmi{v}DoStep of "
     "oscillator.fmu, at t = 0.6 s: it has taken longer than 0.3 s"),
    ("endless Reset", "no end of the update in fmi{v}Reset of oscillator.fmu: it has taken longer than 0.3 s"),
    pytest.param("abort Instantiate", "abort (SIGABRT) in fmi{v}Instantiate{c} of oscillator.fmu",
                 marks=oscillator.CRASH),
    ("error DoStep 0.2", "world.spring (oscillator.fmu): fmi{v}DoStep answers with an error at t = 0.2 s of the FMU; "
     "the FMU says: this function fails on purpose"),
    ("fatal ExitInitializationMode", "fmi{v}ExitInitializationMode answers with a fatal error"),
    ("nothing Instantiate", "world.spring (oscillator.fmu): fmi{v}Instantiate{c} makes no instance"),
    ("negative DoStep", "fmi{v}DoStep answers with status -1; known are OK (0), warning, discard, error"),
    ("large DoStep", "fmi{v}DoStep answers with status 77; known are OK"),
    pytest.param("thread DoStep 0.5", "segmentation fault (SIGSEGV) in another thread, while one was in world.spring "
                 "(Oscillator), task dynamics, in fmi{v}DoStep of oscillator.fmu, at t = 0.6 s",
                 marks=oscillator.CRASH),
    pytest.param("overflow DoStep 0.5", "stack overflow in world.spring (Oscillator), task dynamics, in "
                 "fmi{v}DoStep of oscillator.fmu, at t = 0.6 s", marks=oscillator.CRASH),
    pytest.param("smash DoStep 0.5", "segmentation fault (SIGSEGV) in world.spring (Oscillator), task dynamics, in "
                 "fmi{v}DoStep of oscillator.fmu, at t = 0.6 s", marks=oscillator.CRASH),
    pytest.param("segv Library", "segmentation fault (SIGSEGV) in the destructors of oscillator.fmu",
                 marks=oscillator.CRASH),
    ("huge SerializedFMUStateSize", "tateSize answers with a state of 1152921504606846976 bytes"),
    ("nothing DoStep", "no step from t = 0 s of the FMU comes to 0.1 s"),
    ("version GetVersion", "its description is of FMI {v}.0, and fmi{v}GetVersion of its library says"),
    ("end DoStep 0.3", "world.spring (oscillator.fmu) ends the simulation at t = 0."),
    ("grow GetFMUState", "its state has grown to"),
])
def test_what_an_fmu_does_wrong_is_a_line(misbehaving, tmp_path, version, fault, says):
    code, output = misbehaving(oscillator.make(tmp_path, version), fault)
    assert code != 0 and "Traceback" not in output
    assert says.format(v=version, c="CoSimulation" if version == 3 else "") in output
