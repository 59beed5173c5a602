# SPDX-License-Identifier: Apache-2.0
"""Which of several outputs an input takes: against a plain search, with random times, qualities and modes; and what is
refused."""

import random
import shutil
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import SetupError
from fledge import flight as fsw
from fledge.mission.wiring import Wiring
from fledge.units import s

NS = 1_000_000_000
MODES = ("safe", "point", "idle")
RULES = {"newest": fsw.newest, "first": fsw.first, "best": fsw.best,
         "by_mode": lambda a, b, c: fsw.by_mode(safe=b, point=a)}


def flying(rule, stale_after, seed):
    """(simulation, log): three sources write at random; the log has what they and their reader's input hold."""
    rng, log = random.Random(seed), []
    sim = fledge.Simulation("choice")
    f = sim.flight

    def write(m, t, dt):
        if rng.random() < 0.4:
            m.reference.head.t = max(0, round(t) - rng.randrange(4)) * NS
            m.reference.head.quality = rng.choice(("NONE", "STALE", "DEGRADED", "GOOD"))
            m.reference.sigma_RN[0] = rng.random()

    def state(reference):
        return reference.head.t, int(reference.head.quality), float(reference.sigma_RN[0])

    f.a, f.b, f.c = (fsw.InertialPointing(update=write) for _ in range(3))
    f.reader = fsw.EulerRotation(update=lambda m, t, dt: log.append(
        (round(t) * NS, [state(module.reference) for module in (f.a, f.b, f.c)], state(m.base))))
    wire = RULES[rule](f.a.reference, f.b.reference, f.c.reference) >> f.reader.base
    f.connect(wire.stale_after(stale_after * s) if stale_after else wire)
    f.task("all", every=1 * s, run=[f.a, f.b, f.c, f.reader])
    for name in MODES:
        f.mode(name, [])
    return sim, log


def searched(rule, sources, mode, held):
    """What the input takes of messages (t, quality, content) that have aged."""
    if rule == "newest":
        return max((source for source in sources if source[1]), key=lambda message: message[0], default=sources[0])
    if rule == "by_mode":
        return {"safe": sources[1], "point": sources[0]}.get(mode, held)
    usable = [source for source in sources if source[1] >= 2]
    return usable[0] if rule == "first" and usable else max(sources, key=lambda message: message[1])


@pytest.mark.parametrize("stale_after", [0, 2])
@pytest.mark.parametrize("rule", RULES)
def test_an_input_takes_what_a_search_finds(rule, stale_after):
    sim, log = flying(rule, stale_after, seed=5)
    rng, held, taken = random.Random(7), (0, 0, 0.0), set()
    for _ in range(60):
        mode = rng.choice(MODES)
        sim.flight.enter(mode)
        log.clear()
        sim.run(5 * s)

        def aged(message, t):
            time, quality, content = message
            return (time, 1, content) if stale_after and quality > 1 and t - time > stale_after * NS else message

        for t, sources, found in log:
            held = aged(searched(rule, [aged(source, t) for source in sources], sim.mode, held), t)
            assert found == held
            taken |= {i for i, source in enumerate(sources) if source[2] == found[2] != 0}
    assert taken == ({0, 1} if rule == "by_mode" else {0, 1, 2})


@pytest.mark.parametrize("rule", RULES)
def test_clones_and_snapshots_choose_as_the_simulation_does(rule):
    sim = choosing(rule)
    sim.run(7 * s)
    twin, data = sim.clone(), sim.snapshot()
    sim.run(9 * s)
    twin.run(9 * s)
    assert twin.snapshot() == sim.snapshot()
    sim.restore(data)
    sim.run(9 * s)
    assert twin.snapshot() == sim.snapshot()
    assert twin.wires == sim.wires


def choosing(rule):
    """Two references, of which one reader takes one."""
    sim = fledge.Simulation("choosing")
    f = sim.flight
    f.a = fsw.InertialPointing(sigma_RN=[0.1, 0, 0])
    f.b = fsw.InertialSpin(omega_RR0_R0=[0, 0.01, 0])
    f.reader = fsw.EulerRotation(rates=[0, 0, 0.1])
    f.connect(f.a.reference >> f.b.base)
    f.connect({"by_mode": lambda *two: fsw.by_mode(safe=two[0], point=two[1])}.get(rule, RULES[rule])(
        f.a.reference, f.b.reference) >> f.reader.base)
    f.task("a", every=1 * s, run=[f.a])
    f.task("b", every=2 * s, run=[f.b, f.reader])
    f.mode("safe", ["a", "b"])
    f.mode("point", ["b"])
    return sim


@pytest.mark.parametrize("inputs", [["flight.motor.torque.torque_B"], ["flight.control.torque.torque_B"]])
def test_the_linear_system_is_that_of_the_chosen_wire(inputs, tmp_path):
    """Of an input, and of an output that one reads: as with the wire of the law that is chosen alone."""
    found = []
    for law in ("f.control.torque", "fsw.best(f.weak.torque, f.control.torque)"):
        folder = tmp_path / f"spin_{len(found)}"
        shutil.copytree(Path(fledge.__file__).parents[2] / "missions/nadir_spin", folder)
        text = (folder / "flight.py").read_text()
        for old, new in (("f.control.torque     >>", f"{law} >>"),
                         ("    f.motor    =", "    f.weak     = fsw.MrpFeedback(K=1, P=1)\n    f.motor    ="),
                         ("f.tracking.error     >> f.control.error", "f.tracking.error >> f.control.error,\n"
                          "        f.spin.reference >> f.late.reference, f.late.error >> f.weak.error"),
                         ("    f.tracking =", "    f.late     = fsw.TrackingError()\n    f.tracking ="),
                         (">> f.control.vehicle", ">> [f.control.vehicle, f.weak.vehicle]"),
                         ("f.tracking, f.control, f.motor]", "f.tracking, f.late, f.control, f.weak, f.motor]")):
            assert old in text
            text = text.replace(old, new)
        (folder / "flight.py").write_text(text)
        world = (folder / "world.py").read_text().replace(
            "w.nav.attitude  >> f.tracking.attitude,", "w.nav.attitude >> f.tracking.attitude,\n"
            "        (w.nav.attitude >> f.late.attitude).latency(1).stale_after(1e-9 * s),")
        (folder / "world.py").write_text(world)
        sim = fledge.load(folder)
        sim.run(20 * 60 * s)
        if "best" in law:
            assert int(sim.flight.weak.torque.head.quality) == 2 and int(sim.flight.motor.torque.head.quality) == 3
        found.append(sim.linearize(inputs, ["world.craft.state.omega_BN_B"], discrete=True))
    first, second = found
    assert (first.A.tobytes(), first.B.tobytes()) == (second.A.tobytes(), second.B.tobytes()) and abs(first.B).max() > 0


def test_each_wire_is_shown_with_its_choice():
    sim = choosing("first")
    sim.run(1 * s)
    assert [wire for wire in sim.wires if wire[4]] == [
        ("flight.a.reference", "flight.reader.base", 0, 0, "first"),
        ("flight.b.reference", "flight.reader.base", 0, 0, "first")]
    outline = Wiring(sim).outline()
    assert "<< a.reference, first" in outline and "<< b.reference, first" in outline
    assert "<< flight.a.reference, flight.b.reference" in repr(sim.flight.reader)


def refused(text, build, run=False):
    sim = choosing("newest")
    sim.flight.other = fsw.EulerRotation(rates=[0, 0, 0.1])
    with pytest.raises(SetupError, match=text):
        sim.flight.connect(build(sim.flight))
        sim.flight.task("other", every=1 * s, run=[sim.flight.other])
        if run:
            sim.run(1 * s)


def test_what_is_no_choice_is_refused_with_its_reason():
    refused("the output is VehicleData, the input takes AttReference",
            lambda f: fsw.newest(f.a.reference, fsw.VehicleConfig(I_B=1).vehicle) >> f.other.base)
    refused(r"^newest\(flight.a.reference, flight.a.reference\): flight.a.reference stands in it twice",
            lambda f: fsw.newest(f.a.reference, f.a.reference) >> f.other.base)
    refused("expected two outputs or more", lambda f: fsw.best(f.a.reference) >> f.other.base)
    refused(r"expected outputs, as in first\(a.torque, b.torque\); found flight.a$",
            lambda f: fsw.first(f.a, f.b) >> f.other.base)
    refused("flight.reader.base is already written by flight.a.reference",
            lambda f: fsw.best(f.a.reference, f.b.reference) >> f.reader.base)
    refused("a latency is for an input with one wire",
            lambda f: (fsw.best(f.a.reference, f.b.reference) >> f.other.base).latency(1))


def test_modes_and_tasks_that_are_not_there_are_refused_at_the_start():
    refused("flight.b.reference >> flight.other.base, in sleep: the modes of flight are safe and point",
            lambda f: fsw.by_mode(safe=f.a.reference, sleep=f.b.reference) >> f.other.base, run=True)

    def idle(f):
        f.idle = fsw.InertialPointing()
        return fsw.newest(f.a.reference, f.idle.reference) >> f.other.base

    refused("flight.idle.reference >> flight.other.base, newest: no task runs flight.idle", idle, run=True)


def commanding(wire, order="tasks first", tasks=(("a", 2 * s, 0 * s), ("b", 3 * s, 1 * s))):
    """Two modules command one set of wheels. tasks: name, period and offset of each one's task, of modes of its own."""
    sim = fledge.Simulation("commanding")
    f, w = sim.flight, sim.world

    def write(scale):
        def update(m, t, dt):
            m.command.head.t, m.command.head.quality = round(t * 1e9), "GOOD"
            m.command.u[0] = scale * (t + 1)
            m.publish(m.command)
        return update

    f.a, f.b = (fsw.WheelTorques(update=write(scale)) for scale in (1, -1))
    f.wheels = fsw.WheelConfig(axes_B=[[1, 0, 0]], J=1, u_max=100)
    f.zero = fsw.RateDamping(P=1, torque_max=1)
    w.wheels = fledge.world.ReactionWheels(axes_B=[[1, 0, 0]], J=1, u_max=100)
    w.craft = fledge.world.Spacecraft(I_B=1, parts=[w.wheels])
    w.gyro = fledge.world.Gyro()
    f.connect(f.wheels.wheels >> [f.a.wheels, f.b.wheels], f.zero.torque >> [f.a.torque, f.b.torque])
    w.connect(w.craft.state >> w.gyro.truth, w.gyro.rate >> f.zero.gyro)
    if order != "tasks first":
        w.connect(wire(f) >> w.wheels.command)
    for name, every, offset in tasks:
        f.task(name, every=every, offset=offset, run=[f.instances[name]])
    f.task("zero", every=10 * s, run=[f.zero])
    for mode, (name, *_) in zip(("safe", "point"), tasks):
        f.mode(mode, [name])
    if order == "tasks first":
        w.connect(wire(f) >> w.wheels.command)
    w.task("dynamics", every=1 * s, run=[w.craft, w.gyro])
    return sim


@pytest.mark.parametrize("order", ["tasks first", "wires first"])
@pytest.mark.parametrize("rule, names", [("newest", ("a", "b")), ("by_mode", ("safe", "point"))])
def test_flight_chooses_among_commands_for_the_world(rule, names, order):
    make = getattr(fsw, rule)
    sim = commanding(lambda f: make(f.a.command, f.b.command) if rule == "newest" else
                     make(safe=f.a.command, point=f.b.command), order)
    f, w = sim.flight, sim.world
    assert [task[1:4] for task in f.tasks if task.name == "wheels_command"] == [(1_000_000_000, 0, -1)]
    assert ("flight.wheels_command.command", "world.wheels.command", 0, 0, "") in sim.wires
    sim.run(4 * s)
    assert w.wheels.command.u[0] == 5 - 2      # the world acts on flight's output of the instant before
    for mode, sign, module in (("point", -1, f.b), ("safe", 1, f.a)):
        f.enter(mode)
        sim.run(10 * s)
        assert np.sign(w.wheels.command.u[0]) == sign and f.wheels_command.command.u[0] == module.command.u[0]
        assert f.wheels_command.command.head.t == module.command.head.t
    twin = sim.clone()
    sim.run(5 * s), twin.run(5 * s)
    assert twin.snapshot() == sim.snapshot() and twin.flight.command_choices == sim.flight.command_choices


def test_a_clone_gives_its_choice_a_task_of_its_own():
    sim = commanding(lambda f: fsw.newest(f.a.command, f.b.command), tasks=[])
    twin = sim.clone()
    for simulation, period in ((twin, 2), (sim, 4)):
        simulation.flight.task("both", every=period * s, run=[simulation.flight.a, simulation.flight.b])
        choice, = simulation.flight.command_choices
        assert choice.task == (period * 10**9, 0, -1)
        assert "wheels_command" in [task.name for task in simulation.flight.tasks]


def test_a_choice_for_flight_and_the_world_chooses_for_each():
    sim = commanding(lambda f: fsw.newest(f.a.command, f.b.command))
    f, w = sim.flight, sim.world
    f.monitor = fsw.WheelMonitor(torque_max=1, persistence=1)
    w.more = fledge.world.ReactionWheels(axes_B=[[0, 1, 0]], J=1, u_max=100)
    w.craft.parts = [w.more]
    w.connect((fsw.newest(f.a.command, f.b.command) >> [f.monitor.command, w.more.command]).stale_after(9 * s))
    ends = ("flight.monitor.", "world.more", "flight.more")
    assert sorted(wire for wire in sim.wires if wire[1].startswith(ends)) == [
        ("flight.a.command", "flight.monitor.command", 0, 9_000_000_000, "newest"),
        ("flight.a.command", "flight.more_command.chosen", 0, 9_000_000_000, "newest"),
        ("flight.b.command", "flight.monitor.command", 0, 9_000_000_000, "newest"),
        ("flight.b.command", "flight.more_command.chosen", 0, 9_000_000_000, "newest"),
        ("flight.more_command.command", "world.more.command", 0, 9_000_000_000, "")]


def test_a_command_of_several_outputs_may_come_one_exchange_late():
    sim = commanding(lambda f: fsw.newest(f.a.command, f.b.command))
    w, f = sim.world, sim.flight
    w.late = fledge.world.ReactionWheels(axes_B=[[0, 1, 0]], J=1, u_max=100)
    w.craft.parts = [w.late]
    w.connect((fsw.newest(f.a.command, f.b.command) >> w.late.command).latency(1))
    assert ("flight.late_command.command", "world.late.command", 1, 0, "") in sim.wires
    sim.run(40 * s)
    assert w.late.command.head.t < w.wheels.command.head.t


def test_what_no_module_passes_on_is_refused_with_those_that_flight_chooses():
    sim = choosing("newest")
    f, w = sim.flight, sim.world
    f.first, f.second = fsw.PowerManager(on=1), fsw.PowerManager(on=2)
    w.power = fledge.world.PowerUnit(n=1, on=1, volts=8, load=[1], trip=[1])
    with pytest.raises(SetupError, match=r"^newest\(flight.first.command, flight.second.command\) >> "
                                         r"world.power.command: flight chooses among commands to actuators "
                                         r"\(.*RodCommand.*\), not among PowerCommand; let a module of flight"):
        w.connect(fsw.newest(f.first.command, f.second.command) >> w.power.command)


def test_outputs_of_another_process_are_refused():
    sim = choosing("newest")
    f, w = sim.flight, sim.world
    f.tracking = fsw.TrackingError()
    w.craft = fledge.world.Spacecraft(I_B=1, gravity=[fledge.world.MARS],
                                      orbit=fledge.Orbit(fledge.world.MARS, altitude=4e5))
    w.first, w.second = fledge.world.Navigation(), fledge.world.Navigation()
    w.connect(w.craft.state >> [w.first.truth, w.second.truth], f.reader.reference >> f.tracking.reference,
              fsw.first(w.first.attitude, w.second.attitude) >> f.tracking.attitude)
    f.task("tracking", every=1 * s, run=[f.tracking])
    w.task("dynamics", every=1 * s, run=[w.craft, w.first, w.second])
    with pytest.raises(SetupError, match="world.second.attitude >> flight.tracking.attitude, first: outputs to choose "
                                         "from are of the process of their reader, flight"):
        sim.run(1 * s)
