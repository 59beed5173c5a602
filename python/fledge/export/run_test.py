# SPDX-License-Identifier: Apache-2.0
"""The exported C computes the desktop's bits: its ports get the inputs of the desktop's flight, and all its
outputs are compared at every tick."""

import pytest

import fledge
from fledge import export, objects
from fledge.export.testing import COMPILERS, Compiled, Recorded
from tests.circles import long_after

NS = 1_000_000_000


def first_difference(sim, mission, c, run, every=0, all_instants=False, request=None):
    """Run the desktop by run(sim), then the C over the same inputs; (time, path) where they differ, or None.

    all_instants: tick the C at the world's instants too, and compare there; else only when it asks.
    """
    inputs = [m.path for m in mission.inputs]
    outputs = [m.path for m in mission.outputs]
    recorded = Recorded(sim, [*inputs, *outputs], every)
    run(sim)
    times = recorded.times()
    input_log = {p: recorded.samples(p) for p in inputs}
    recordings = {p: recorded.samples(p) for p in outputs}
    assert len(times) == len(next(iter(recordings.values())))
    ticks = 0
    for i, t in enumerate(times):
        if request:
            request(c, t)
        due = c("next")
        assert due >= t or all_instants, f"the C asks for {due}, the desktop is at {t}"
        if not all_instants and due != t:
            continue
        for path, samples in input_log.items():
            c.put(path, samples[i])
        c("tick", t)
        ticks += 1
        for path, samples in recordings.items():
            if c.get(path) != samples[i]:
                return t, path
    assert ticks > 100
    return None


def whole_run(name, folder, compiler="gcc", optimise="-O0"):
    sim = fledge.load(name)
    mission = export.read(sim)
    c = Compiled(mission, folder, compiler=compiler, optimise=optimise)
    return first_difference(sim, mission, c, lambda s: s.run(160 * 60.0), every=0.5)


@pytest.mark.parametrize("name", long_after(1, ["nadir_spin", "asterisk_scan", "two_body_pointing"], "another mission"))
def test_a_whole_run_is_the_same_bits(name, tmp_path):
    assert whole_run(name, tmp_path) is None


@pytest.mark.long("compiles flight with two compilers, optimised")
@pytest.mark.parametrize("compiler", COMPILERS)
def test_so_it_is_with_another_compiler(compiler, tmp_path):
    assert whole_run("two_body_pointing", tmp_path, compiler, "-O2") is None


def test_a_difference_would_be_seen(tmp_path):
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    c = Compiled(mission, tmp_path)
    sim.flight.control.K = 2.5310000000000006       # the next double
    t, path = first_difference(sim, mission, c, lambda s: s.run(60.0))
    assert path == "flight.control.torque" and t == 0


# --- two rates, offsets, priorities, modes, events, stale wires ------------------------------------

FLIGHT = '''
"""Modes."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, ms, s


def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], J=0.15 * kg * m**2, u_max=0.2 * N * m)
    f.guidance = fsw.HillPointing()
    f.switch   = fsw.EulerRotation(rates=[0, 0, 0.3] * deg / s)      # a keyword of C
    f.spin     = fsw.InertialSpin(omega_RR0_R0=[0.001, 0, 0])
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 1])
    f.control  = fsw.MrpFeedback(K=2.5 * N * m, P=45.0 * N * m * s, K_I=0.01 * N * m / s, u_I_max=0.1 * N * m)
    f.motor    = fsw.WheelTorques()
    f.connect(
        f.guidance.reference >> f.switch.base,
        f.switch.reference   >> f.spin.base,
        f.spin.reference     >> f.tracking.reference,
        f.tracking.error     >> f.control.error,
        f.control.torque     >> f.motor.torque,
        f.vehicle.vehicle    >> f.control.vehicle,
        f.wheels.wheels      >> [f.control.wheels, f.motor.wheels],
    )
    f.task("guide",   every=1 * s, offset=300 * ms, run=[f.guidance, f.switch])
    f.task("turn it", every=700 * ms, run=[f.spin])
    f.task("control", every=200 * ms, priority=2, run=[f.control, f.motor])
    f.task("track",   every=100 * ms, offset=1.2 * s, priority=5, run=[f.tracking])
    f.mode("wait", ["turn it"])
    f.mode("point", ["turn it", "control"])
    f.mode("rest", [])
    f.start_in("wait")
    error = f.watch(f.tracking.error)
    f.event("start",   when=f.watch(f.tracking.error).head.quality >= 2, hold=7.3 * s, enter="point", once=True)
    f.event("settled", when=error.sigma_BR.norm() < 0.05, hold=11 * s, enter=f.rest)
    f.event("late",    when=f.watch(f.control.speeds).head.quality <= 1, hold=500 * ms, enter="wait")
    f.event("off",     when=error.omega_BR_B[1] < -0.02, hold=80 * s, enter="point")
    f.event("wide",    when=error.sigma_BR.max_abs() > 0.3, hold=60 * s, enter="wait")
'''
WORLD = '''
from fledge import Orbit, world
from fledge.units import N, deg, kg, km, m, ms, rad, s


def build(w, f):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2 * N * m)
    w.craft  = world.Spacecraft(
        I_B=[700, 700, 800] * kg * m**2, parts=[w.wheels], gravity=[world.MARS],
        orbit=Orbit(world.MARS, a=7471.618 * km, e=0.4, f=270 * deg),
        sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.001, -0.01, 0.03] * rad / s)
    w.slow   = world.Navigation()
    w.nav    = world.Navigation()
    w.connect(
        w.craft.state   >> [w.nav.truth, w.slow.truth],
        (w.nav.attitude >> f.tracking.attitude).stale_after(150 * ms),
        (w.slow.orbit   >> f.guidance.orbit).stale_after(2 * s),
        w.wheels.speeds >> f.control.speeds,
        f.motor.command >> w.wheels.command,
    )
    w.task("dynamics", every=100 * ms, run=[w.craft, w.nav])
    w.task("slow", every=3 * s, run=[w.slow])
'''


@pytest.fixture()
def modes(tmp_path):
    folder = tmp_path / "modes"
    folder.mkdir()
    (folder / "flight.py").write_text(FLIGHT)
    (folder / "world.py").write_text(WORLD)
    return folder


# One set of wheels, three laws in three modes, and a fourth mode without one, in which another module commands the
# wheels; two sensors.
CHOICES = '''
"""Three laws drive one set of wheels."""
from fledge import flight as fsw
from fledge.units import N, deg, kg, m, ms, s


def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800] * kg * m**2)
    f.wheels   = fsw.WheelConfig(axes_B=[[1, 0, 0], [0, 1, 0], [0, 0, 1]], J=0.15 * kg * m**2, u_max=0.2 * N * m)
    f.guidance = fsw.HillPointing()
    f.spin     = fsw.EulerRotation(rates=[0, 0, 0.3] * deg / s)
    f.rest     = fsw.InertialPointing(sigma_RN=[0, 0.1, 0])
    f.tracking = fsw.TrackingError(sigma_BcB=[0, 0, 1])
    f.backup   = fsw.TrackingError(sigma_BcB=[0, 0, 1])
    f.brake    = fsw.MrpFeedback(K=0.5 * N * m, P=80.0 * N * m * s)
    f.slew     = fsw.MrpFeedback(K=5 * N * m, P=60.0 * N * m * s)
    f.fine     = fsw.MrpFeedback(K=2.5 * N * m, P=45.0 * N * m * s)
    f.motor    = fsw.WheelTorques(hold=2 * s)
    f.reserve  = fsw.WheelTorques()
    f.connect(
        f.guidance.reference >> f.spin.base,
        f.brake.torque       >> f.reserve.torque,
        (fsw.newest(f.spin.reference, f.rest.reference) >> [f.tracking.reference, f.backup.reference]),
        fsw.first(f.tracking.error, f.backup.error) >> [f.brake.error, f.fine.error],
        (fsw.best(f.backup.error, f.tracking.error) >> f.slew.error).stale_after(500 * ms),
        (fsw.by_mode(calm=f.brake.torque, turn=f.slew.torque, point=f.fine.torque)
         >> f.motor.torque).stale_after(1 * s),
        f.vehicle.vehicle    >> [f.brake.vehicle, f.slew.vehicle, f.fine.vehicle],
        f.wheels.wheels      >> [f.brake.wheels, f.slew.wheels, f.fine.wheels, f.motor.wheels, f.reserve.wheels],
    )
    f.task("guide", every=1 * s, run=[f.guidance, f.spin])
    f.task("still", every=1 * s, run=[f.rest])
    f.task("track", every=100 * ms, run=[f.tracking])
    f.task("look",  every=700 * ms, run=[f.backup])
    f.task("laws",  every=200 * ms, run=[f.brake, f.slew, f.fine, f.motor])
    f.mode("calm",  ["still", "track"])
    f.mode("turn",  ["still", "look"])
    f.mode("point", ["guide", "track", "look"])
    f.task("spare", every=300 * ms, offset=100 * ms, priority=1, run=[f.reserve])
    f.mode("drift", ["look", "spare"])
    command = f.watch(f.motor.command).head.quality
    f.event("braked",  when=command >= 2, hold=30 * s, modes=["calm"], enter="turn")
    f.event("slewed",  when=command >= 2, hold=50 * s, modes=["turn"], enter="point")
    f.event("pointed", when=command >= 2, hold=70 * s, modes=["point"], enter="drift")
    f.event("drifted", when=f.watch(f.backup.error).head.quality >= 2, hold=20 * s, modes=["drift"], enter="calm")
'''
CHOICES_WORLD = WORLD.replace("from fledge import", "from fledge import flight as fsw,").replace(
    "f.motor.command >> w.wheels.command", "(fsw.by_mode(calm=f.motor.command, turn=f.motor.command, "
    "point=f.motor.command, drift=f.reserve.command)\n         >> w.wheels.command).stale_after(900 * ms)").replace(
    "(w.nav.attitude >> f.tracking.attitude).stale_after(150 * ms)",
    "(w.slow.attitude >> f.tracking.attitude).stale_after(1.1 * s), w.nav.attitude >> f.backup.attitude").replace(
    "w.wheels.speeds >> f.control.speeds", "w.wheels.speeds >> [f.brake.speeds, f.slew.speeds, f.fine.speeds]")


@pytest.fixture()
def choices(tmp_path):
    folder = tmp_path / "choices"
    folder.mkdir()
    (folder / "flight.py").write_text(CHOICES)
    (folder / "world.py").write_text(CHOICES_WORLD)
    return folder


def entered(sim, seen, duration):
    """Run, and note the modes that were in effect."""
    for _ in range(round(duration / 5)):
        sim.run(5.0)
        if not seen or seen[-1] != sim.mode:
            seen.append(sim.mode)


@pytest.mark.parametrize("all_instants", [False, True])
def test_modes_events_rates_and_stale_wires_are_the_same_bits(modes, all_instants, tmp_path):
    sim = fledge.load(modes)
    mission = export.read(sim)
    c = Compiled(mission, tmp_path / "c")
    seen = []
    assert first_difference(sim, mission, c, lambda s: entered(s, seen, 2500.0), all_instants=all_instants) is None
    assert {"wait", "point", "rest"} <= set(seen) and len(seen) > 4, seen     # or this would show nothing


def test_an_input_of_several_outputs_takes_the_same_bits(choices, tmp_path):
    sim = fledge.load(choices)
    mission = export.read(sim)
    c = Compiled(mission, tmp_path / "c")
    seen = []
    assert first_difference(sim, mission, c, lambda s: entered(s, seen, 500.0)) is None
    assert seen[:5] == ["calm", "turn", "point", "drift", "calm"]


def test_a_mode_that_is_requested_from_outside(modes, tmp_path):
    sim = fledge.load(modes)
    mission = export.read(sim)
    c = Compiled(mission, tmp_path / "c")

    def run(s):
        for mode in ("rest", "wait", "point", "rest", "point"):
            s.flight.enter(mode)
            s.run(3.3)

    requests = {0: "rest", 3_400_000_000: "wait", 6_700_000_000: "point", 10_000_000_000: "rest",
                13_300_000_000: "point"}

    def request(compiled, t):
        if t in requests:
            compiled.enter(mission.modes.index(requests[t]))

    sim.run(0.0)
    sim.reset()
    assert first_difference(sim, mission, c, run, all_instants=True, request=request) is None


# --- at the reset ----------------------------------------------------------------------------------

@pytest.mark.long("compiles each mission's code")
@pytest.mark.parametrize("name", sorted(fledge.missions()))
def test_after_init_every_module_is_as_the_desktop_has_it(name, tmp_path):
    sim = fledge.load(name)
    for mission in export.read_all(sim):            # which also resets the desktop's
        c = Compiled(mission, tmp_path)
        live = sim.process(mission.process).instances
        assert modules_of(c, mission) == b"".join(unread(mission, m, objects.memory(live[m.path.partition(".")[2]]))
                                                  for m in in_order(mission))


def unread(mission, module, memory):
    """A module before the first exchange, which brings the configuration of other processes."""
    outside = {wire.target for wires in mission.wires.values() for wire in wires if wire.source.startswith("in.")}
    memory = bytearray(memory)
    for field in module.fields("in"):
        if f"{module.name}.in.{field.name}" in outside:
            memory[field.offset:field.offset + field.size] = bytes(field.size)
    return bytes(memory)


def in_order(mission):
    return [*mission.configuration, *(m for t in mission.tasks for m in t.run)]


def modules_of(c, mission):
    """The modules stand at the end of the struct, one after the other."""
    size = sum(m.struct.size for m in mission.modules)
    return c.memory.raw[-size:]


def test_a_reset_in_flight_leads_back_and_keeps_parameters(tmp_path):
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    c = Compiled(mission, tmp_path)
    begin = c.memory.raw
    first = first_difference(sim, mission, c, lambda s: s.run(100.0))
    assert first is None and c.memory.raw != begin
    c("reset")
    assert c.memory.raw == begin


def test_a_changed_parameter_is_published(tmp_path):
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    c = Compiled(mission, tmp_path)
    sim.run(10.0)
    sim.flight.vehicle.I_B = [600, 700, 800]
    sim.run(until=10.5)                             # the next instant of flight, which publishes it
    before = c.get("flight.vehicle.vehicle")
    vehicle = next(m for m in mission.modules if m.name == "vehicle")
    offset = next(f.offset for f in vehicle.struct.fields if f.name == "I_B")
    start = c.rows["flight.vehicle.vehicle"][0] + offset
    c.memory[start:start + 72] = objects.memory(sim.flight.vehicle)[offset:offset + 72]
    c.publish("vehicle", 10500 * NS // 1000)
    after = c.get("flight.vehicle.vehicle")
    assert after != before and after == objects.memory(sim.flight.vehicle)[:len(after)]


def test_a_late_tick_goes_on_at_the_next_time_of_its_grid(tmp_path):
    sim = fledge.load("nadir_spin")
    c = Compiled(export.read(sim), tmp_path)
    c("tick", 0)
    assert c("next") == NS // 2
    c("tick", 3 * NS // 4)
    assert c("next") == NS
