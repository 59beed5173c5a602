# SPDX-License-Identifier: Apache-2.0
"""What people read when something is wrong: the instance, the rule, what was found, the choices."""

import csv
import re
import unicodedata
from enum import Enum

import pytest

import fledge
from fledge import Orbit, RunError, SetupError, flight as fsw, world
from fledge.cli.console import complain
from fledge.errors import cell, excerpt, field, printable
from fledge.montecarlo.dispersions import Dispersions
from fledge.objects.testing import kinds
from fledge.requirements import settles
from fledge.units import deg, kg, km, m, ms, s
from tests.tree import ROOT

AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


@pytest.fixture
def sim():
    sim = fledge.Simulation()
    f, w = sim.flight, sim.world
    f.control = fsw.MrpFeedback(K=1, P=2)
    f.tracking = fsw.TrackingError()
    w.nav = world.Navigation()
    return sim


def says(text, function, kind=SetupError):
    with pytest.raises(kind) as error:
        function()
    assert str(error.value) == text


def begins(text, function):
    """The same, for the beginning of the text."""
    with pytest.raises(SetupError) as error:
        function()
    assert str(error.value)[:len(text)] == text


# --- values ----------------------------------------------------------------------------------------

@pytest.mark.parametrize(
    "name, value, text",
    [
        ("K", -1, "flight.control.K must be > 0 N m, found -1 N m"),
        ("K", "high", "flight.control.K: expected a number, in N m; found 'high'"),
        ("K", None, "flight.control.K: expected a number, in N m; found None"),
        ("K", True, "flight.control.K: expected a number, in N m; found True"),
        ("K", [1, 2], "flight.control.K: expected a number, in N m; found [1, 2]"),
        ("K", 3 * kg, "flight.control.K: expected a quantity in N m; found 3.0 kg"),
        ("P", [1, 2], "flight.control.P: expected shape (3, 3), or 3 numbers for the diagonal, or one for a "
                      "multiple of the identity, in N m s; found shape (2)"),
        ("P", [[1, 2], [3]], "flight.control.P: expected shape (3, 3), or 3 numbers for the diagonal, or one for a "
                             "multiple of the identity, in N m s; found rows of unequal length"),
        ("error", 3, "flight.control.error: expected AttError or dict of its fields; found 3"),
        ("error", fsw.BodyTorque(), "flight.control.error: expected AttError or dict of its fields; found "
         "BodyTorque"),
    ],
)
def test_a_wrong_value(sim, name, value, text):
    before = repr(sim.flight.control)
    says(text, lambda: setattr(sim.flight.control, name, value))
    assert repr(sim.flight.control) == before


def test_a_wrong_value_inside_a_message(sim):
    says("flight.control.error.sigma_BR: expected shape (3); found shape (2)",
         lambda: setattr(sim.flight.control.error, "sigma_BR", [1, 2]))
    says("flight.control.error.head.quality: expected one of NONE, STALE, DEGRADED, GOOD; found 'BAD'",
         lambda: setattr(sim.flight.control.error.head, "quality", "BAD"))


def test_counts():
    make = fsw.WheelConfig
    says("WheelConfig.J: expected 3 rows, for n is 3, as in axes_B; found 2. Set n first to change it",
         lambda: make(axes_B=AXES, J=[1, 2]))
    says("WheelConfig.J: one number fills the rows that count, and there are none yet; set n, or give an array with "
         "rows, such as axes_B, u_max", lambda: make(J=1))
    says("WheelConfig.axes_B: expected 2 rows, for n is 2, as given; found 3. Set n first to change it",
         lambda: make(n=2, axes_B=AXES))
    says("WheelConfig.axes_B: expected shape (n <= 8, 3); found shape (9, 3)", lambda: make(axes_B=AXES * 3))
    says("WheelConfig.axes_B must have a length, found zero at [1]", lambda: make(axes_B=[[1, 0, 0], [0, 0, 0]]))


def test_bodies_that_do_not_exist():
    with pytest.raises(SetupError, match="VehicleConfig.I_B must be symmetric"):
        fsw.VehicleConfig(I_B=[[1, 0.5, 0], [0, 1, 0], [0, 0, 1]])
    with pytest.raises(SetupError, match="VehicleConfig.I_B "):
        fsw.VehicleConfig(I_B=[1, 1, 3])
    says("VehicleConfig.I_B must be positive definite, found [[1, 0, 0], [0, 1, 0], [0, 0, 0]] kg m^2",
         lambda: fsw.VehicleConfig(I_B=[1, 1, 0]))
    with pytest.raises(SetupError, match=r"Spacecraft.mass must be >= 0 kg, found -3 kg"):
        world.Spacecraft(mass=-3)


# --- names -----------------------------------------------------------------------------------------

def test_a_misspelt_attribute(sim):
    text = ("flight.control (MrpFeedback) has no attribute 'k'; did you mean 'K'? parameters: K, P, K_I, u_I_max, "
            "hold; inputs: error, vehicle, wheels, speeds, external; outputs: torque; memory: ")
    for act in (lambda: sim.flight.control.k, lambda: setattr(sim.flight.control, "k", 1)):
        with pytest.raises(AttributeError) as error:
            act()
        assert str(error.value).startswith(text)
    with pytest.raises(TypeError, match="MrpFeedback has no attribute 'gain'; parameters: K, P"):
        fsw.MrpFeedback(gain=1)
    with pytest.raises(TypeError, match=r"MrpFeedback takes keywords only, as in K=\.\.\."):
        fsw.MrpFeedback(1)
    with pytest.raises(AttributeError, match="flight.control: 'update' cannot be assigned"):
        sim.flight.control.update = 3
    with pytest.raises(AttributeError, match="flight.control.K cannot be deleted"):
        del sim.flight.control.K


def test_unknown_types_and_bodies_list_the_known():
    with pytest.raises(AttributeError, match="no 'MrpFeedbak'; did you mean 'MrpFeedback'. ./fledge list names all"):
        fsw.MrpFeedbak
    with pytest.raises(AttributeError, match="fledge.flight has no 'Zzz'; there are .*EulerRotation"):
        fsw.Zzz
    with pytest.raises(AttributeError, match="fledge.world has no 'VULCAN'; .*MARS.*Spacecraft"):
        world.VULCAN
    says("Orbit: expected a body, such as world.MARS; found 'VULCAN'. The bodies are SUN, MERCURY, VENUS, EARTH, MOON, "
         "MARS, JUPITER, SATURN, URANUS, NEPTUNE, PLUTO", lambda: Orbit("VULCAN", a=1))


def test_enumerators_have_short_and_whole_names():
    make = fsw.FieldOnBoard
    says("FieldOnBoard.model: expected one of DIPOLE, IGRF, WMM; found 'WMN'; did you mean 'WMM'?",
         lambda: make(model="WMN"))
    assert make(model="WMM").model == make(model="FIELD_WMM").model == make(model=2).model == 2
    model = type(make().model)
    assert model(2).name == "WMM" and model.WMM is model.FIELD_WMM and [member.value for member in model] == [0, 1, 2]
    assert model is fsw.FieldModel and "FieldModel" in dir(fsw) and world.RadioState.LOCKED == 1


@pytest.mark.parametrize("make, text", [
    (lambda: Orbit(world.EARTH, altitude=500 * km, inc=1), "Orbit has no 'inc'; did you mean 'i'? it takes body, a, e, "
     "p, rp, ra, altitude, i, Omega, omega, f, frame"),
    (lambda: Orbit(world.EARTH, altitde=500 * km), "Orbit has no 'altitde'; did you mean 'altitude'? it takes body, "),
    (lambda: Orbit(a=7e6), "Orbit() missing 1 required positional argument: 'body'; it takes body, a, "),
    (lambda: Orbit.from_state(world.EARTH, [7e6, 0, 0], [0, 7e3, 0], frme=1),
     "Orbit.from_state has no 'frme'; did you mean 'frame'? it takes body, r, v, frame"),
    (lambda: world.Sky(date="2026-03-01", center=world.EARTH), "Sky has no 'date'; did you mean 'epoch'? it takes "),
    (lambda: world.EarthOrientation(epo="eop.txt"), "EarthOrientation has no 'epo'; did you mean 'eop'? it takes "),
    (lambda: world.MARS.zonal(degre=2), "Body.zonal has no 'degre'; did you mean 'degree'? it takes degree, pole_N"),
    (lambda: world.Adaptive(rtol=1e-9), "Adaptive has no 'rtol'; did you mean 'relative'? it takes relative, absolute"),
    (lambda: fledge.Simulation(sed=1), "Simulation has no 'sed'; did you mean 'seed'? it takes name, seed, empty"),
    (lambda: fledge.Simulation().record(evry=1), "Simulation.record has no 'evry'; did you mean 'every'? it takes "),
    (lambda: fledge.Simulation().flight.task("a", period=1, run=[]), "Process.task has no 'period'; did you mean "
     "'every'? it takes name, every, run, offset, priority"),
    (lambda: fledge.Simulation().flight.reset_by(None, dwn=1), "Flight.reset_by has no 'dwn'; did you mean 'down'?"),
    (lambda: settles(None, withn=1), "settles has no 'withn'; did you mean 'within'? it takes x, within, lasting"),
    (lambda: Dispersions(fledge.Simulation()).normal(0, 1, hgh=2), "Dispersions.normal has no 'hgh'; did you mean "
     "'high'?"),
    (lambda: fsw.MrpFeedback(k=1), "MrpFeedback has no attribute 'k'; did you mean 'K'?"),
])
def test_a_misspelt_argument(make, text):
    with pytest.raises(TypeError) as error:
        make()
    assert str(error.value).startswith(text)


def test_every_constructor_of_the_world_says_what_it_takes():
    """Whatever stands in fledge.world and can be called with arguments."""
    for name in dir(world):
        constructor = getattr(world, name)
        is_class = isinstance(constructor, type)
        other = issubclass(constructor, (Exception, Enum)) if is_class else constructor is world.RK4
        if callable(constructor) and not other:
            with pytest.raises(TypeError) as error:
                constructor(nonsense=1)
            assert f"{name} has no " in str(error.value) and "'nonsense'" in str(error.value)


def test_a_type_error_of_the_body_of_a_function_stays(sim):
    with pytest.raises(TypeError, match="^unsupported operand") as error:
        world.Adaptive(relative=1, absolute=object() + 1)
    assert "it takes" not in str(error.value)
    with pytest.raises(TypeError) as error:
        world.Body("X", 1.0, 1.0, J=3)
    assert "it takes" not in str(error.value)


def test_words_of_basilisk_have_those_of_fledge():
    """Whatever docs/from-basilisk.md names among the modules."""
    text = (ROOT / "docs/from-basilisk.md").read_text("utf-8").partition("## Modules")[2]
    text = text.partition("\n## ")[0]
    modules = re.findall(r"(?m)^\| (`.*) \| (.*) \|$", text)
    assert len(modules) > 30
    for theirs, ours in modules:
        for word in re.findall(r"`(\w+)`", theirs):
            answers = []
            for module in (fsw, world):
                with pytest.raises(AttributeError) as error:
                    getattr(module, word)
                answers.append(str(error.value).partition(";")[2])
            names = re.findall(r"`(\w+)`", ours) or ["a wire"]
            assert any(name in answer for name in names for answer in answers), (word, answers)


@pytest.mark.parametrize("make, text", [
    (lambda: fsw.MrpFeedback(Ki=1), "MrpFeedback has no attribute 'Ki'; did you mean 'K_I'? parameters: K, P, K_I, "),
    (lambda: world.Spacecraft(IHubPntBc_B=1), "Spacecraft has no attribute 'IHubPntBc_B'; here, Basilisk's "
     "'IHubPntBc_B' is I_B; parameters: "),
    (lambda: fsw.MrpFeedback().torque.recorder(), "MrpFeedback.torque (BodyTorque) has no attribute 'recorder'; here, "
     "Basilisk's 'recorder' is log = sim.record(f.tracking.error, every=1 * s); fields: "),
    (lambda: fledge.Simulation().ExecuteSimulation(), "the simulation has no 'ExecuteSimulation'; here, Basilisk's "
     "'ExecuteSimulation' is sim.run(10 * minute)"),
    (lambda: fledge.Simulation().runn, "the simulation has no 'runn'; did you mean 'run'?"),
    (lambda: fledge.macros, "fledge has no 'macros'; here, Basilisk's 'macros' is units, as in 0.5 * s: from "),
    (lambda: fledge.units.sec2nano, "fledge.units has no unit 'sec2nano'; here, Basilisk's is 0.5 * s; the units are "),
])
def test_a_word_of_basilisk(make, text):
    with pytest.raises((TypeError, AttributeError, ImportError)) as error:
        make()
    assert str(error.value).startswith(text)


def test_a_property_that_fails_says_why():
    sim = fledge.Simulation()
    vars(sim)["_processes"] = None
    with pytest.raises(AttributeError, match="NoneType"):
        sim.processes


def test_processes(sim):
    f = sim.flight
    says("the process flight has no 'controll'; did you mean 'control'? it has control, tracking",
         lambda: f.controll, AttributeError)
    says("flight.x: expected a module or model; found 3", lambda: setattr(f, "x", 3))
    says("flight.task: this name is taken by the process itself; choose another",
         lambda: setattr(f, "task", fsw.HillPointing()))
    says("flight.control is already there, a MrpFeedback", lambda: setattr(f, "control", fsw.HillPointing()))
    says("mode flight.control: the name is taken by the module flight.control (MrpFeedback); choose another",
         lambda: f.mode("control", []))
    f.mode("rest", [])
    says("event flight.rest: the name is taken by the mode flight.rest; choose another",
         lambda: f.event("rest", when=f.watch(f.tracking.error).sigma_BR.norm() < 1))
    says("flight.other: this MrpFeedback already is flight.control; make another one",
         lambda: setattr(f, "other", f.control))
    says("flight.wheels: a ReactionWheels is a model of the world and cannot fly; assign it in world.py",
         lambda: setattr(f, "wheels", world.ReactionWheels()))


# --- wires -----------------------------------------------------------------------------------------

def test_wires(sim):
    f, w = sim.flight, sim.world
    says("flight.control.torque >> flight.control.error: the output is BodyTorque, the input takes AttError; "
         "flight.control takes BodyTorque at external", lambda: f.control.torque >> f.control.error)
    f.tdb, f.utc, f.sun_at, f.moon = \
        fsw.TimeCorrelation(), fsw.UtcCorrelation(), fsw.SunOnBoard(), fsw.ChebyshevEphemeris()
    utc = "UtcTime (UTC since 2000-01-01T12:00:00, 86,400 s a day)"
    tdb = "EphemerisTime (TDB since the epoch of the ephemerides, which count it)"
    says(f"flight.tdb.time >> flight.sun_at.time: the output is {tdb}, the input takes {utc}",
         lambda: f.tdb.time >> f.sun_at.time)
    says(f"flight.utc.time >> flight.moon.time: the output is {utc}, the input takes {tdb}",
         lambda: f.utc.time >> f.moon.time)
    says("flight.control.error >> flight.control.error: flight.control.error is no output; flight.control has the "
         "outputs torque", lambda: f.control.error >> f.control.error)
    says("flight.control.error >> flight.tracking.error: a wire leads from an output to an input: write "
         "flight.tracking.error >> flight.control.error", lambda: f.control.error >> f.tracking.error)
    says("flight.tracking.error >> flight.control: name an input, not the module; it has the inputs error, vehicle, "
         "wheels, speeds, external", lambda: f.tracking.error >> f.control)
    says("flight.tracking.error >> 3: expected an input or a list of inputs", lambda: f.tracking.error >> 3)
    f.connect(f.tracking.error >> f.control.error)
    other = f.second = fsw.TrackingError()
    with pytest.raises(SetupError, match="^flight.second.error >> flight.control.error: flight.control.error is "
                                         r"already written by flight.tracking.error: lines (\d+) and (\d+)$"):
        f.connect(other.error >> f.control.error)
    with pytest.raises(SetupError, match="has no name yet; assign it to a process first"):
        f.connect(fsw.TrackingError().error >> f.control.error)
    says("flight.connect: expected wires, as in a.output >> b.input; found 1", lambda: f.connect(1))
    with pytest.raises(SetupError, match="latency must be 0 or 1, found 2"):
        w.connect((w.nav.attitude >> f.tracking.attitude).latency(2))
    with pytest.raises(TypeError, match="a wire ends here"):
        f.tracking.error >> f.control.error >> f.control.error


def test_what_is_missing_is_listed_as_a_whole(sim):
    f = sim.flight
    f.wheels = fsw.WheelConfig()
    f.task("gnc", every=1 * s, run=[f.tracking, f.control])
    with pytest.raises(SetupError) as error:
        sim.run(1 * s)
    for part in ("flight.wheels.axes_B is required", "flight.wheels.J is required", "flight.control.error",
                 "flight.control.vehicle", "flight.tracking.attitude"):
        assert part in str(error.value)


def test_times(sim):
    f = sim.flight
    run = [f.control]
    says("task flight.a: its period must be at least 1 ns, found 0 s", lambda: f.task("a", every=0, run=run))
    says("task flight.a: its period must be at least 1 ns, found -0.1 s", lambda: f.task("a", every=-100 * ms, run=run))
    says("task flight.a: every: expected a time, found 1.0 m", lambda: f.task("a", every=1 * m, run=run))
    says("task flight.a: every: expected a time within 292 years, found 1e+300 s",
         lambda: f.task("a", every=1e300, run=run))
    says("run: until: expected a time, found 1.0 m", lambda: sim.run(until=1 * m))
    with pytest.raises(TypeError, match="takes a duration, or until"):
        sim.run()
    for text in ("10", "10 s"):
        found = f"expected a time, such as 10 * s; found '{text}'"
        says(f"run: {found}", lambda: sim.run(text))
        says(f"run: until: {found}", lambda: sim.run(until=text))
        says(f"record: every: {found}", lambda: sim.record(every=text))
        says(f"task flight.a: every: {found}", lambda: f.task("a", every=text, run=run))
        says(f"task flight.a: offset: {found}", lambda: f.task("a", every=1, offset=text, run=run))
        says(f"world.at: {found}", lambda: sim.world.at(text, print))
        says(f"world.nav.attitude >> flight.tracking.attitude: stale_after: {found}",
             lambda: (sim.world.nav.attitude >> f.tracking.attitude).stale_after(text))
        says(f"Sky.utc: t: {found}", lambda: world.Sky("2015-03-02", center=world.MARS).utc(text))


# --- orbits ----------------------------------------------------------------------------------------

@pytest.mark.parametrize(
    "elements, text",
    [
        (dict(a=7000 * km, e=1.2), "a hyperbola .* needs a semi-major axis < 0"),
        (dict(a=-7000 * km, e=0.2), "semi-major axis"),
        (dict(a=7000 * km, e=-0.1), "e"),
        (dict(p=-1), "Orbit: p must be > 0, found -1 m"),
        (dict(a=7000 * s), "Orbit: a: expected a quantity in m; found 7000.0 s"),
        (dict(a=7000 * km, rp=1), "expected a and e, p and e, rp and ra, rp and e, or altitude; found a, rp"),
        (dict(), "found none"),
        (dict(rp=8000 * km, ra=7000 * km), "periapsis, 8e[+]06 m, is above that of apoapsis, 7e[+]06 m"),
        (dict(p=1e7, e=2.0, f=3.0), "f"),
        # inside the body
        (dict(a=7000), r"Orbit: the periapsis must lie outside MARS, of radius 3397000 m; found 7000 m from its "
                       r"centre: are these kilometres\? write a = 7000 \* km \(MARS.with_surface\(0\) allows it\)"),
        (dict(a=7000 * km, e=0.6), r"the periapsis must lie .* found 2800000 m from its centre \(MARS"),
        (dict(altitude=-1), "the periapsis must lie outside MARS, of radius 3397000 m; found 3396999 m from its"),
        (dict(rp=3000 * km, e=1.5), "the position must lie outside MARS, of radius 3397000 m; found 3000000 m"),
        # degrees
        (dict(a=7e6, i=97.4), r"Orbit: i must be within pi; found 97.4 rad: write 97.4 \* deg for degrees"),
        (dict(a=7e6, i=-200 * deg), "Orbit: i must be within pi; found -3.49066 rad$"),
        (dict(a=7e6, f=270), r"Orbit: f must be within 2 pi, or have a unit; found 270 rad: write 270 \* deg"),
        (dict(a=7e6, Omega=90), "Orbit: Omega must be within 2 pi"),
        (dict(a=7e6, omega=-7), "Orbit: omega must be within 2 pi"),
    ],
)
def test_orbits_that_are_none(elements, text):
    with pytest.raises(SetupError, match=text):
        Orbit(world.MARS, **elements)


def test_orbits_that_may_be():
    turns = Orbit(world.MARS, a=7e6, i=180 * deg, f=1000 * deg, Omega=-6.2, omega=6.2)
    assert turns.f == pytest.approx(1000 * deg.value)
    Orbit(world.MARS, rp=3000 * km, e=1.5, f=-90 * deg)      # from afar: it ends at the surface
    Orbit("JUPITER", altitude=0)
    Orbit(world.JUPITER_SYSTEM, a=1000 * km)                 # without a size
    inside = Orbit(world.MARS.with_surface(0), a=7000 * km, e=0.6)
    assert inside.a == pytest.approx(7e6) and inside.body.radius == world.MARS.radius
    Orbit(world.MARS.with_surface(2000 * km), a=7000 * km, e=0.6)
    with pytest.raises(SetupError, match="must lie outside MARS, of radius 2900000 m"):
        Orbit(world.MARS.with_surface(2900 * km), a=7000 * km, e=0.6)
    with pytest.raises(SetupError, match="MARS.with_surface: radius must be >= 0 m, found -1 m"):
        world.MARS.with_surface(-1)

    # An orbit that is read is what it is; assigned, it is checked.
    found = Orbit.from_state(world.MARS, inside.r_BN_N, inside.v_BN_N)
    assert found.p == pytest.approx(inside.p) and found.body is world.MARS
    with pytest.raises(SetupError, match="Spacecraft.orbit: the periapsis must lie outside MARS"):
        world.Spacecraft(orbit=found)


def test_a_fall_ends_the_run_with_time_and_altitude(tmp_path):
    def fly(body):
        sim = fledge.Simulation()
        w = sim.world
        w.craft = world.Spacecraft(I_B=1, gravity=[body], orbit=Orbit(body, rp=3380 * km, e=1.5, f=-30 * deg))
        w.task("dynamics", every=1 * s, run=[w.craft])
        sim.run(1000 * s)
        return sim.world.craft.orbit

    with pytest.raises(RunError, match=r"^world.craft: inside MARS at [0-9]+ s, at an altitude of -[0-9.]+ m over its "
                                       r"radius of 3397000 m .* last good state at [0-9]+ s: r_BN_N"):
        fly(world.MARS)
    for body in (world.MARS.with_surface(0), world.MARS.with_surface(3379 * km)):
        assert fly(body).f > 0


def test_a_spacecraft_takes_parts_and_bodies():
    with pytest.raises(SetupError, match="Spacecraft.parts: expected a part of a spacecraft, such as ReactionWheels; "
                                         "found HillPointing"):
        world.Spacecraft(parts=[fsw.HillPointing()])
    with pytest.raises(SetupError, match="Spacecraft.gravity: expected a body, such as world.MARS; found 'VULCAN'"):
        world.Spacecraft(gravity=["VULCAN"])
    with pytest.raises(SetupError, match=r"Spacecraft.orbit: expected Orbit\(body, ...\); found 7"):
        world.Spacecraft(orbit=7)


# --- events ----------------------------------------------------------------------------------------

def test_events(sim):
    f = sim.flight
    sigma = f.watch(f.tracking.error).sigma_BR
    says("norm(flight.tracking.error.sigma_BR): expected a number without unit; found 3.0 m",
         lambda: sigma.norm() < 3 * m)
    says("flight.tracking.error.sigma_BR has shape (3,): compare an element, norm() or max_abs()", lambda: sigma < 3)
    with pytest.raises(SetupError, match="compare one of its fields: head, sigma_BR"):
        f.watch(f.tracking.error) < 3
    with pytest.raises(AttributeError, match="has no attribute 'sigma'; did you mean 'sigma_BR'"):
        f.watch(f.tracking.error).sigma
    with pytest.raises(TypeError, match="only known when the mission runs"):
        bool(sigma)
    with pytest.raises(SetupError, match="flight's events are data"):
        f.event("e", when=lambda: True, do=print)
    with pytest.raises(SetupError, match="event flight.e enters the mode science; the process has"):
        f.event("e", when=sigma.norm() < 1, enter="science")


def test_conditions():
    sim = fledge.Simulation("kinds")
    f, types = sim.flight, kinds()[1]
    f.noise = types["Noise"]()
    k = f.watch(f.noise.kinds)
    here = "flight.noise.kinds"
    says(f"{here}.phase ==: expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found 'SCEINCE'; did you mean 'SCIENCE'?",
         lambda: k.phase == "SCEINCE")
    begins(f"{here}.phase ==: expected one of NOT_SAFE", lambda: k.phase == 7)
    says(f"{here}.phase !=: expected one of NOT_SAFE, SAFE, SCIENCE, DRAIN; found <Quality.GOOD: 3>",
         lambda: k.phase != f.noise.kinds.head.quality.__class__.GOOD)
    begins(f"{here}.x < {here}.i64: the first is in m, the second without unit", lambda: k.x < k.i64)
    begins(f"{here}.phase == {here}.i32: the first is Phase, the second without unit", lambda: k.phase == k.i32)
    begins(f"{here}.since < {here}.rate: the first is in ns, the second in rad/s", lambda: k.since < k.rate)
    begins(f"{here}.x < {here}.x: this compares a field with itself", lambda: k.x < k.x)
    begins(f"{here}.v has shape (3,): compare an element", lambda: k.x < k.v)
    begins(f"{here}.x < inf: expected a finite number", lambda: k.x < float("inf"))
    begins(f"{here}.u64 < {2**64 + 1}: expected a finite number, and a whole one of up to 64 bits",
           lambda: k.u64 < 2**64 + 1)
    begins(f"{here}.label is a text; compare a number", lambda: k.label == "a")
    begins(f"{here}.parts: compare one of its fields: phase, share, pairs, steps", lambda: k.parts == 1)
    begins(f"{here}.parts[3]: expected a whole number below 3", lambda: k.parts[3])
    begins("Kinds.x is in no module or model: compare a field of one", lambda: f.watch(types["Kinds"]()).x < 1)
    with pytest.raises(AttributeError, match=r"is an array of Part; pick one, as in flight.noise.kinds.parts\[0\]"):
        k.parts.phase
    with pytest.raises(AttributeError, match=r"parts\[1\] \(Part\) has no attribute 'fase'; did you mean 'phase'"):
        k.parts[1].fase
    for wrong in (lambda: k.x > 0 and k.y > 0, lambda: 0 < k.x < 1, lambda: not (k.x > 0)):
        with pytest.raises(TypeError, match=r"join conditions with &, \| and ~, each in parentheses"):
            wrong()
    with pytest.raises(TypeError, match="unsupported operand"):
        (k.x > 0) & True


def test_what_an_event_does():
    sim = fledge.Simulation("kinds")
    f, types = sim.flight, kinds()[1]
    f.noise, f.flags, f.sink = types["Noise"](), types["Flags"](), types["Sink"]()
    f.task("all", every=1 * s, run=[f.noise, f.sink])
    f.mode("science", [])
    w = sim.world
    w.craft = world.Spacecraft(I_B=1)
    w.task("all", every=1 * s, run=[w.craft])
    w.mode("dark", [])
    when = f.watch(f.noise.kinds).x > 1

    def event(text, **does):
        begins(f"event flight.e{text}", lambda: f.event("e", **{"when": when, "enter": "science", **does}))

    event(": count: expected a whole number; found 1.5", count=1.5)
    event(": the count must be >= 1, found 0", count=0)
    event(": with once, it does not arm itself again: leave out until", once=True, until=~when)
    event(": until takes a condition, as in watch(port).field < 1; found True", until=True)
    event(" looks in the mode scince; the process has science", modes="scince")
    event(": <mode dark> is of another process", modes=[w.dark])
    event(": set takes pairs of a field and a value, as in set=[(f.watch(f.module).parameter, 1)]; found 1", set=[1])
    event(" sets flight.noise.state: an event sets parameters", set=[(f.watch(f.noise).state, 1)])
    event(" sets world.craft.I_B: an event sets what modules of its own process have", set=[(f.watch(w.craft).I_B, 1)])
    begins("flight.noise.x must be >= 0 m, found -1 m",
           lambda: f.event("e", when=when, set=[(f.watch(f.noise).x, -1)]))
    begins("flight.noise.level: expected a whole number from 0 to 255; found 300",
           lambda: f.event("e", when=when, set=[(f.watch(f.noise).level, 300)]))
    begins("norm(flight.noise.v): set an element of it, or the whole field",
           lambda: f.event("e", when=when, set=[(f.watch(f.noise).v.norm(), 3)]))
    begins("flight.noise.kinds.x: an event sets numbers that are finite; found nan",
           lambda: f.event("e", when=when, set=[(f.watch(f.noise.kinds).x, float("nan"))]))
    assert not f.events and f.noise.x == 0
    f.event("a", when=when, arm="b", disarm=["c"], set=[(f.watch(f.flags.kinds).x, 1)])
    with pytest.raises(SetupError) as error:
        sim.prepare()
    texts = [line.partition(": ")[2] for line in str(error.value).splitlines()]      # after file and line
    assert texts[:3] == [
        "event flight.a arms b; the events of flight are a", "event flight.a disarms c; the events of flight are a",
        "event flight.a sets flight.flags.kinds, which follows from the parameters of a module in no task: set those"]


def test_lists_of_what_there_is_are_never_empty():
    sim = fledge.Simulation("kinds")
    f, types = sim.flight, kinds()[1]
    f.noise, f.sink = types["Noise"](), types["Sink"]()
    d = Dispersions(sim)
    says("flight.sink.kinds.x is no parameter, and only these can be dispersed; flight.sink has none",
         lambda: d.__setitem__("flight.sink.kinds.x", d.uniform(0, 1)))
    says("flight.sink.kinds >> flight.noise.hint: flight.sink.kinds is no output; flight.sink has the outputs (none)",
         lambda: f.sink.kinds >> f.noise.hint)
    says("flight.noise.kinds >> flight.sink: name an input, not the module; it has the inputs kinds",
         lambda: f.noise.kinds >> f.sink)
    says("process flight has no mode safe; it has (none)", lambda: f.enter("safe"))
    f.task("all", every=1 * s, run=[f.sink])
    f.mode("rest", [])
    assert repr(f).endswith("  mode rest: no task of its own")
    with pytest.raises(SetupError, match="flight.noise is in no task: name it in the `run` of one, or leave it out$"):
        sim.prepare()


def test_an_event_that_arms_itself_ends_the_run():
    sim = fledge.Simulation()
    w = sim.world
    w.craft = world.Spacecraft(I_B=1)
    w.task("all", every=1 * s, run=[w.craft])
    again = w.event("again", when=lambda: sim.time >= 2, do=lambda: setattr(again, "armed", True))
    with pytest.raises(RunError, match="event world.again fires again at 2 s"):
        sim.run(10 * s)


def test_an_event_that_is_added_by_another_waits_for_the_next_instant():
    sim = fledge.Simulation()
    w, fired = sim.world, []
    w.craft = world.Spacecraft(I_B=1)
    w.task("all", every=1 * s, run=[w.craft])

    def again():
        fired.append(sim.time)
        w.at(sim.time, again)

    w.at(2 * s, again)
    sim.run(4 * s)
    assert fired == [2, 3, 4]


# --- what a simulation takes -----------------------------------------------------------------------

def test_seeds_snapshots_and_the_room_for_records(sim):
    says("seed: expected a whole number from 0 to 2^64 - 1; found -1", lambda: fledge.Simulation(seed=-1))
    says("seed: expected a whole number from 0 to 2^64 - 1; found 1.5", lambda: setattr(sim, "seed", 1.5))
    says("restore: expected the bytes that snapshot() gives; found 'text'", lambda: sim.restore("text"))
    small = fledge.Simulation()
    small.world.craft = world.Spacecraft(I_B=1)
    small.world.task("all", every=1 * s / 1e9, run=[small.world.craft])
    small.record(small.world.craft.state)
    with pytest.raises(SetupError, match="record world.craft.state: 900000000000000000. samples of [0-9]+ bytes are "
                                         "more than there is memory for; record less often, or run in parts"):
        small.run(9e9)


# --- texts from outside ----------------------------------------------------------------------------

def test_a_text_from_outside_is_shown_and_drives_nothing():
    assert printable("caf\u00e9 \u2713 \u65b0\n\tnext") == "caf\u00e9 \u2713 \u65b0\n\tnext"
    assert printable("a\x1b[2J\x9b\u202eb\u200b\ud800") == \
        "a\u27e81B\u27e9[2J\u27e89B\u27e9\u27e8202E\u27e9b\u27e8200B\u27e9\u27e8D800\u27e9"
    for point in range(0x110000):
        character, kind = chr(point), unicodedata.category(chr(point))
        if kind in ("Cc", "Cs", "Zl", "Zp") or unicodedata.bidirectional(character) in (
                "LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"):
            assert (printable(character) != character) == (character not in "\n\t"), hex(point)
            assert printable(character, lines=False).isprintable()
        elif kind[0] in "LNPS" or character == " ":
            assert printable(character) == character, hex(point)


def test_a_text_of_another_program_floods_no_terminal(capsys):
    complain("one\n\x1b[2J" + "x" * 10**6)
    assert excerpt("short") == "short" and excerpt("abc", 1) == "a ... and 2 more characters"
    head, line = capsys.readouterr().err.splitlines()
    assert head == "fledge: one" and line.startswith("\u27e81B\u27e9[2Jx") and len(line) < 2100


@pytest.mark.parametrize("before", ["", " ", "\t", "\r", "\n", '"', "'", " ' \"", "\u00a0", "\u2018", "\u3000"])
@pytest.mark.parametrize("begin", "=+-@\uff1d\uff0b\uff0d\uff20")
def test_no_text_is_a_formula_in_a_table(before, begin):
    text = field(before + begin + "1+1;=2")
    read, = csv.reader([text])
    assert read == [cell(before + begin + "1+1;=2")] and read[0].startswith("'") and text.startswith('"')
    assert cell("\u200b" + begin) == "\u27e8200B\u27e9" + begin


def test_a_plain_text_is_itself_in_a_table():
    assert [field(text) for text in ("a=b", "POINT", "1e5", "")] == ["a=b", "POINT", "1e5", ""]
