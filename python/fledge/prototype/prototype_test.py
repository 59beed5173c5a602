# SPDX-License-Identifier: Apache-2.0
"""Modules whose interface and behaviour are classes in Python."""
import enum
import inspect
import random
import re

import numpy as np
import pytest

import fledge
from fledge import RunError, SetupError, Simulation, _core, cli, flight as fsw, montecarlo, objects, prototype
from fledge.mission.wiring import Wiring
from fledge.prototype import Mat3, Vec3, field, input, mem, out, par
from fledge.objects.layout import described
from fledge.units import Quantity, deg, rad, s


class Phase(enum.IntEnum):
    """What the slew does."""
    WAIT = 0
    SLEW = 1


class SunSlew(prototype.Module):
    """Turns the reference at a constant rate.

    About one axis of N.
    """
    base      = input(fsw.AttReference, "optional: where it begins")
    reference = out(fsw.AttReference, "where the body shall point")
    rate      = par(float, "[rad/s] required, > 0: of the turn")
    axis_N    = par(Vec3, "[-] non-zero: of the turn")
    n         = par(np.uint8, "[-] <= 3: how many waits there are")
    waits     = par(float, "[s] count n, >= 0: from the start", shape=3)
    inertia   = par(Mat3, "[kg m^2] of the body")
    phase     = mem(float, "[rad] the angle so far")
    mode      = mem(Phase, "what it does")
    HALF = 0.25

    def reset(self):
        self.phase = 0.125

    def waiting(self, t):
        return any(wait <= t < wait + 1 for wait in self.waits)

    def update(self, t, dt):
        self.mode = Phase.WAIT if self.waiting(t) else Phase.SLEW
        if self.mode == Phase.SLEW:
            self.phase += self.rate * dt
        self.reference.sigma_RN = np.tan(self.HALF * self.phase) * self.axis_N
        self.publish(self.reference, quality="DEGRADED" if self.mode == Phase.WAIT else "GOOD")


def slewing(made=None, name="slewing"):
    """The prototype, and a module in C that reads it."""
    sim = Simulation(name)
    f = sim.flight
    f.slew = made or SunSlew(rate=1 * deg / s, axis_N=[0, 0, 1], waits=[2 * s])
    f.spin = fsw.EulerRotation(rates=[0, 0, 0.1 * rad / s])
    f.connect(f.slew.reference >> f.spin.base)
    f.task("gnc", every=0.5 * s, run=[f.slew, f.spin])
    return sim


def test_it_flies_in_the_loop_as_any_module():
    sim = slewing()
    log = sim.record(sim.flight.slew, sim.flight.spin, every=1 * s)
    sim.run(4 * s)
    waited = 0.5 + 0.5      # at 2 s and 2.5 s
    assert sim.flight.slew.phase == pytest.approx(0.125 + (4 - waited) * deg.value, rel=1e-14)
    np.testing.assert_allclose(log["slew.reference.sigma_RN"][-1],
                               [0, 0, np.tan(sim.flight.slew.phase / 4)], rtol=1e-15)
    np.testing.assert_array_equal(sim.flight.spin.base.sigma_RN, sim.flight.slew.reference.sigma_RN)
    assert [finding for finding in sim.health if finding.kind == "degraded" and finding.path == "flight.slew.reference"]
    sim.reset()
    assert sim.flight.slew.phase == 0.125 and not sim.flight.slew.reference.sigma_RN.any()


def test_its_parameters_have_the_checks_of_a_header():
    with pytest.raises(SetupError, match=re.escape("SunSlew.rate must be > 0 rad/s, found -1 rad/s")):
        SunSlew(rate=-1)
    with pytest.raises(SetupError, match="SunSlew.rate: expected a quantity in rad/s; found 1.0 s"):
        SunSlew(rate=1 * s)
    with pytest.raises(SetupError, match="SunSlew.axis_N must have a length, found zero$"):
        SunSlew(rate=1, axis_N=[0, 0, 0])
    with pytest.raises(SetupError, match="flight.slew.rate is required: of the turn"):
        slewing(SunSlew(axis_N=[0, 0, 1])).prepare()
    with pytest.raises(TypeError, match="SunSlew has no attribute 'rates'; did you mean 'rate'"):
        SunSlew(rates=1)
    with pytest.raises(SetupError, match="SunSlew.waits: expected shape"):
        SunSlew(waits=[1, 2, 3, 4])


def test_what_is_python_is_seen():
    sim = slewing()
    line = inspect.getsourcelines(SunSlew)[1]
    assert f"  in Python: class SunSlew, prototype_test.py, line {line}\n" in repr(sim.flight.slew)
    assert "SunSlew; Python: class SunSlew\n" in Wiring(sim).outline()
    assert "    rate: float [rad/s], required, > 0\n        of the turn" in type(sim.flight.slew).__doc__
    assert isinstance(sim.flight.slew, SunSlew) and isinstance(sim.flight.slew, objects.Module)


def test_snapshots_and_clones_have_its_state():
    sim = slewing()
    sim.run(2 * s)
    snapshot, other = sim.snapshot(), sim.clone()
    sim.run(3 * s)
    end = objects.memory(sim.flight.slew)
    other.run(3 * s)
    assert objects.memory(other.flight.slew) == end and isinstance(other.flight.slew, SunSlew)
    sim.restore(snapshot)
    assert objects.memory(sim.flight.slew) != end
    sim.run(3 * s)
    assert objects.memory(sim.flight.slew) == end


def test_a_class_derived_from_a_prototype_has_its_fields_and_methods():
    class Backwards(SunSlew):
        """Turns the other way."""
        rounds = mem(int, "[-] updates")

        def update(self, t, dt):
            super().update(t, dt)
            self.reference.sigma_RN[2] *= -1
            self.rounds += 1

    sim = slewing(Backwards(rate=1, axis_N=[0, 0, 1]))
    sim.run(1 * s)
    assert sim.flight.slew.rounds == 3 and sim.flight.slew.reference.sigma_RN[2] == -np.tan(1.125 / 4)


def test_a_class_that_is_defined_again_has_the_memory_of_the_first():
    def define(factor):
        class Ramp(prototype.Module):
            """Scales a number."""
            value = mem(float, "[-] of it")

            def update(self, t, dt):
                self.value = factor * t

        return Ramp

    first, second = define(2), define(3)
    first_module, second_module = first(), second()
    for module in (first_module, second_module):
        module.reset()
        module.update(t=1.0)
    assert type(first_module) is type(second_module) and (first_module.value, second_module.value) == (2, 3)


def test_the_tables_of_headers_and_their_description_agree():
    """The description of a table, from which a prototype's is made, has the hash that introspect gave to the header."""
    for types in (_core.library("flight"), _core.library("world")):
        for type_ in types.values():
            table = _core.struct(type_)
            assert described(table).hash == table.hash, table.name


# --- messages --------------------------------------------------------------------------------------

class Sweep(prototype.Message):
    """Where a sweep is."""
    angle = field(float, "[rad] of the sweep")
    n     = field(np.uint8, "[-] <= 3: how many points there are")
    at    = field(Vec3, "[m] count n: the points", shape=3)
    mode  = field(Phase, "what it does")


class Give(prototype.Module):
    """Puts a message out that no header has."""
    sweep = out(Sweep)

    def update(self, t, dt):
        self.sweep.angle = t
        self.sweep.at = [[t, 1, 2]]
        self.sweep.mode = Phase.SLEW
        self.publish(self.sweep)


class Take(prototype.Module):
    """Reads it."""
    sweep = input(Sweep)
    twice = mem(float, "[rad] twice the angle")

    def update(self, t, dt):
        self.twice = 2 * self.sweep.angle


def test_a_message_without_a_header_is_wired_and_recorded(tmp_path):
    sim = Simulation("sweep")
    f = sim.flight
    f.give, f.take = Give(), Take()
    f.connect(f.give.sweep >> f.take.sweep)
    f.task("t", every=1 * s, run=[f.give, f.take])
    log = sim.record(f.give, every=1 * s)
    sim.archive(tmp_path / "run.mcap")
    sim.run(3 * s)
    sim.close_archive()
    run = fledge.Archive(tmp_path / "run.mcap")
    assert f.take.twice == 6.0 and run["sweep.angle"].tolist() == log["sweep.angle"].tolist() == [0, 1, 2, 3]
    assert run["sweep.at"][3].tolist() == [[3, 1, 2], [0, 0, 0], [0, 0, 0]]
    assert run["sweep.mode"].tolist() == [Phase.SLEW] * 4
    assert Sweep(angle=2 * deg).angle == 2 * deg.value
    other = slewing().flight
    other.take = Take()
    with pytest.raises(SetupError, match="the output is AttReference, the input takes Sweep"):
        other.connect(other.slew.reference >> other.take.sweep)


def test_a_message_is_that_of_a_header_with_the_same_name_and_fields():
    class BodyTorque(prototype.Message):
        """As in flight/msg/vehicle.h."""
        torque_B = field(Vec3, "[N m]")

    assert type(BodyTorque()) is fsw.BodyTorque


@pytest.mark.parametrize("members, complaint", [
    (dict(angle=par(float, "[rad] it")), r"field\(\) is for messages; .*`angle` of Sent"),
    (dict(), "a prototype has fields; `Sent` has none"),
    (dict(angle=field(float, "[rad] required: it")), "only a member of `par` is required"),
    (dict(double=field(float, "[rad] it")), "a name is no keyword; `double` is one in C"),
])
def test_what_a_message_cannot_hold_is_refused(members, complaint):
    with pytest.raises(SetupError, match=rf"prototype_test.py, line \d+: {complaint}"):
        type("Sent", (prototype.Message,), {"__doc__": "Sent.", "__module__": __name__, **members})


# --- what is refused where the class is defined ----------------------------------------------------

def line_of(function, text):
    lines, first = inspect.getsourcelines(function)
    return first + next(i for i, line in enumerate(lines) if text in line)


def update(self, t, dt):
    pass


def define(doc="It does something.", functions=(update,), **members):
    members = {"__doc__": doc, "__module__": __name__, **{function.__name__: function for function in functions},
               **members}
    return type(prototype.Module)("Tried", (prototype.Module,), members)


@pytest.mark.parametrize("members, complaint", [
    (dict(rate=field(float, "[-] a number")), r"field\(\) is for messages"),
    (dict(rate=par(float, "of the turn")), r"a number has a unit; `rate` has none; begin its text with one, as in "
     r"\"\[rad/s\] of the turn\""),
    (dict(rate=par(float, "[deg] of the turn")), "a unit is made of .*; `deg` in .deg.; angles are in rad"),
    (dict(rate=mem(float, "[-] required: a gain")), "only a member of `par` is required; `mem.rate` is in `mem`"),
    (dict(rate=par(float, "[-] > 2, < 1: a gain")), "bounds leave room for a value"),
    (dict(wanted=input(float, "[-] torque")), "`in` and `out` hold messages; `in.wanted` is of type double"),
    (dict(name=par(str, "its name")), "a type is one of: .*`name` has <class 'str'>"),
    (dict(rate=par(Quantity, "[-] a gain")), "a type is one of: float, .*`rate` has <class"),
    (dict(rate=par("Qualify", "the least")), "an enumeration is .*; `rate` is a 'Qualify'; did you mean 'Quality'"),
    (dict(rate=par(enum.Enum("Kind", "A B"), "which")), "an enumeration is an IntEnum"),
    (dict(rate=par(float, "[-] gains", shape=0)), r"a shape is 1 to 4 whole numbers > 0; `rate` has \(0,\)"),
    (dict(rate=par(float, "[-] count n: gains", shape=3)), "`count` names an unsigned integer of the same group"),
    (dict(Rate=par(float, "[-] a gain"), rate=mem(float, "[-] a gain")), "names differ in more than case"),
    (dict(double=par(float, "[-] a gain")), "a name is no keyword; `double` is one in C"),
    (dict(held=par(float, "[-] a gain")), "no member is named held"),
    (dict(), "a prototype has ports, parameters or memory; `Tried` has none"),
])
def test_a_declaration_that_a_header_could_not_have_is_refused_with_its_line(members, complaint):
    with pytest.raises(SetupError, match=rf"prototype_test.py, line \d+: {complaint}"):
        define(**members)


async def asleep(self, t, dt):
    pass


def test_methods_that_no_prototype_has_are_refused():
    value = mem(float, "[-] a number")
    for complaint, options in {
        "has no docstring": dict(doc=None),
        r"has no update\(self, t, dt\)": dict(functions=()),
        r"Tried.update: expected a function of \(self, t, dt\); found .* with the arguments \(self, t\)":
            dict(functions=(), update=lambda self, t: None),
        "is asynchronous": dict(functions=(), update=asleep),
        r"has __init__\(\)": dict(__init__=lambda self: None),
    }.items():
        with pytest.raises(SetupError, match=complaint):
            define(value=value, **options)
    with pytest.raises(SetupError, match="Module is a base"):
        prototype.Module()
    with pytest.raises(TypeError, match="SunSlew takes keywords only"):
        SunSlew(1)
    with pytest.raises(TypeError, match="is the memory of a prototype; call its class instead"):
        type(SunSlew(rate=1))()


count = 0


def by_global(self, t, dt):
    global count
    count += 1


def by_default(self, t, dt, seen=[]):
    seen.append(t)


def by_nonlocal():
    n = 0

    def update(self, t, dt):
        nonlocal n
        n += 1
    return update


@pytest.mark.parametrize("function, text, complaint", [
    (by_global, "count += 1", r"by_global\(\) assigns count, a variable outside of the object"),
    (by_nonlocal(), "n += 1", r"update\(\) assigns n, a variable outside of the object"),
    (by_default, "def by_default", r"by_default\(\) has the default \[\], which lives on from call to call"),
])
def test_state_that_the_code_shows_is_refused_where_the_class_is_defined(function, text, complaint):
    with pytest.raises(SetupError, match=rf"prototype_test.py, line {line_of(function, text)}: Tried: {complaint}"):
        define(value=mem(float, "[-] a number"), update=function)


# --- what is reported during a run ---------------------------------------------------------------------

seen = []
noise = np.random.default_rng(1)
numbers = (n * n for n in range(1000))


def helper():
    seen.append(1)


def closure():
    history = {}

    def update(self, t, dt):
        history[t] = dt
    return update


def own_attribute(self, t, dt):
    own_attribute.last = t


@pytest.mark.parametrize("function, line, complaint", [
    (lambda self, t, dt: seen.append(t), None, "Tried changed seen, which is not in its memory"),
    (lambda self, t, dt: helper(), line_of(helper, "seen.append"), "Tried changed seen"),
    (closure(), None, "Tried changed history"),
    (own_attribute, None, "Tried changed own_attribute.last"),
    (lambda self, t, dt: self.LIST.append(t), None, "Tried changed Tried.LIST"),
    (lambda self, t, dt: self.ARRAY.fill(t + 1), None, "Tried changed Tried.ARRAY"),
    (lambda self, t, dt: noise.normal(), None, "Tried changed noise"),
    (lambda self, t, dt: next(numbers), None, "Tried changed numbers"),
    (lambda self, t, dt: random.random(), None, "Tried changed the random numbers of Python or numpy, .* draws by "),
    (lambda self, t, dt: np.random.normal(), None, "Tried changed the random numbers of Python or numpy"),
])
def test_state_outside_of_the_memory_is_reported_with_its_line(function, line, complaint):
    cls = define(value=mem(float, "[-] a number"), update=function, LIST=[], ARRAY=np.zeros(3))
    sim = Simulation("outside")
    sim.flight.it = cls()
    sim.flight.task("t", every=1 * s, run=[sim.flight.it])
    if "Tried." in complaint:
        line = cls._struct.line     # where the attribute is
    line = line or function.__code__.co_firstlineno + (function.__name__ == "update") * 1
    with pytest.raises(RunError, match=rf"prototype_test.py, line \d+: flight.it at 0 s: {complaint}") as error:
        sim.run(10 * s)
    assert abs(int(re.search(r"line (\d+)", str(error.value))[1]) - line) <= 1


def test_state_that_changes_late_is_reported_too():
    calls = []

    def update(self, t, dt):
        self.value += 1
        if self.value > 5:
            calls.append(t)

    sim = Simulation("late")
    sim.flight.it = define(value=mem(float, "[-] a number"), update=update)()
    sim.flight.task("t", every=1 * s, run=[sim.flight.it])
    with pytest.raises(RunError, match="flight.it at 7 s: Tried changed calls"):
        sim.run(100 * s)


@pytest.mark.parametrize("wrong, complaint", [
    (lambda self: setattr(self, "count", 1), r"AttributeError: flight.slew \(Tried\) has no 'count'; a prototype "
     r"remembers what it declares: count = mem\(float"),
    (lambda self: 1 / 0, "ZeroDivisionError"),
    (lambda self: setattr(self, "value", [1, 2]), "flight.slew.value: expected a number"),
    (lambda self: setattr(self.reference, "sigma_RN", [1, 2]), "sigma_RN: expected shape"),
    (lambda self: setattr(self, "update", 1), "'update' cannot be assigned"),
    (lambda self: setattr(self, "gain", 2.0), "flight.slew.gain is a parameter or an input: an update only reads"),
    (lambda self: setattr(self, "gain", 2), "flight.slew.gain is a parameter or an input: an update only reads"),
    (lambda self: setattr(self.base, "sigma_RN", [1, 2, 3]), "slew.base.sigma_RN is a parameter or an input"),
    (lambda self: self.base.sigma_RN.fill(1), "read-only"),
    (lambda self: self.publish(self.base), r"an output of the module; found flight.slew.base\. It has reference"),
    (lambda self: (self.reference.sigma_RN.fill(np.nan), self.publish(self.reference)),
     r"ValueError: flight.slew.reference says GOOD, but its sigma_RN\[0\] is nan"),
])
def test_what_an_update_does_wrong_is_reported_with_its_line(wrong, complaint):
    made = define(value=mem(float, "[-] a number"), gain=par(float, "[-] a number"), reference=out(fsw.AttReference),
                  base=input(fsw.AttReference, "optional: another"), update=lambda self, t, dt: wrong(self))
    line = wrong.__code__.co_firstlineno
    place = rf"prototype_test.py, line ({line}|{line + 1}): flight.slew at 0 s: "
    with pytest.raises(RunError, match=f"{place}.*{complaint}"):
        slewing(made()).run(1 * s)


def test_an_output_that_is_degraded_may_hold_what_is_not_finite():
    def update(self, t, dt):
        self.reference.sigma_RN.fill(np.inf)
        self.publish(self.reference, quality="DEGRADED")

    sim = slewing(define(reference=out(fsw.AttReference), update=update)())
    sim.run(1 * s)
    assert "not finite" in {finding.kind for finding in sim.health}


# --- missions --------------------------------------------------------------------------------------

PROTOTYPES = '''
from fledge import flight as fsw, prototype
from fledge.prototype import mem, out, par

class Turn(prototype.Module):
    """Turns about the third axis."""
    reference = out(fsw.AttReference)
    rate = par(float, "[rad/s] required: of the turn")
    angle = mem(float, "[rad] so far")

    def update(self, t, dt):
        self.angle += self.rate * dt
        self.reference.omega_RN_N[2] = self.angle
        self.publish(self.reference)
'''
FLIGHT = '''
from fledge.units import s
from .prototypes import Turn

def build(f):
    f.turn = Turn(rate=0.1)
    f.task("gnc", every=0.5 * s, run=[f.turn])
'''
DISPERSED = """
from fledge.units import s

def disperse(d):
    d.duration, d.every = 5 * s, 1 * s
    d["flight.turn.rate"] = d.uniform(1, 2)
    d.retain("flight.turn.reference.omega_RN_N")
"""


@pytest.fixture
def mission(tmp_path):
    for name, text in (("prototypes", PROTOTYPES), ("flight", FLIGHT), ("dispersions", DISPERSED)):
        (tmp_path / f"{name}.py").write_text(text)
    return tmp_path


def test_a_campaign_disperses_its_parameters(mission):
    flown = montecarlo.Campaign(mission).fly(3, seed=2, threads=2)
    omega = flown.retained["flight.turn.reference.omega_RN_N"][:, -1, 2]
    np.testing.assert_allclose(omega, 5 * np.ravel(flown.draws["flight.turn.rate"]), rtol=1e-14)


def test_what_breaks_a_rule_is_reported_once_with_its_own_line(mission):
    source = mission / "prototypes.py"
    source.write_text(PROTOTYPES.replace("[rad] so far", "so far"))
    with pytest.raises(fledge.MissionError) as error:
        fledge.load(mission)
    assert re.fullmatch(rf"{source}, line 9: a number has a unit; `angle` has none; .*", str(error.value))


def test_every_export_names_the_line_of_the_class(mission, capfd):
    for words in (["c"], ["cfs", "--app", "nav"], ["micropython"]):
        assert cli.main(["export", words[0], str(mission), *words[1:], "--out", str(mission / "out")]) == 2
        assert (f"{mission}/flight.py, line 6: flight.turn is still Python (the class Turn, {mission}/prototypes.py, "
                f"line 5): ./fledge new module Turn --from {mission}/prototypes.py:Turn begins its C"
                ) in capfd.readouterr().err
    assert not (mission / "out").exists()


def test_a_record_has_its_parameters(mission):
    sim = fledge.load(mission)
    sim.archive(mission / "run.mcap")
    sim.record(sim.flight.turn, every=1 * s)
    sim.run(2 * s)
    sim.close_archive()
    assert fledge.Archive(mission / "run.mcap").parameters["flight.turn.rate"] == 0.1
