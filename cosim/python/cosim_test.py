# SPDX-License-Identifier: Apache-2.0
"""Missions split into nodes: which wires cross and how, what is refused, and that nothing else changes."""

import itertools
import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import fledge
from fledge import cosim
from fledge.attitude import mrp_to_dcm
from tests.waiting import PATIENCE

FLIGHT = """
from fledge import flight as fsw
AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]

def build(f):
    f.vehicle  = fsw.VehicleConfig(I_B=[700, 700, 800])
    f.guidance = fsw.HillPointing()
    f.tracking = fsw.TrackingError()
    f.control  = fsw.MrpFeedback(K=2.5, P=45)
    f.wheels   = fsw.WheelConfig(axes_B=AXES, J=0.16, u_max=0.2)
    f.motor    = fsw.WheelTorques()
    f.connect(f.guidance.reference >> f.tracking.reference,
              f.tracking.error >> f.control.error,
              f.control.torque >> f.motor.torque,
              f.vehicle.vehicle >> f.control.vehicle, f.wheels.wheels >> [f.control.wheels, f.motor.wheels])
    look = f.task("look", every=0.5, run=[f.guidance, f.tracking])
    act  = f.task("act", every=0.5, run=[f.control, f.motor])
    f.mode("rest", [look])
    f.mode("work", [look, act])
    f.event("go", when=f.watch(f.tracking.error).sigma_BR.norm() > 0.1, hold=3, enter=f.work)
"""

WORLD = """
from fledge import Orbit, world

def build(w, f, there=0, back=0):
    w.wheels = world.ReactionWheels(axes_B=f.wheels.axes_B, J=f.wheels.J, u_max=0.2)
    w.craft = world.Spacecraft(I_B=[700, 700, 800], gravity=[world.MARS], sigma_BN=[0.1, 0.2, -0.3],
                               parts=[w.wheels], orbit=Orbit(world.MARS, a=7471618, e=0.4, f=4.7))
    w.nav = world.Navigation(rate_noise=[1e-5] * 3)
    w.connect(w.craft.state >> w.nav.truth,
              (w.nav.attitude >> f.tracking.attitude).latency(there),
              (w.nav.orbit >> f.guidance.orbit).latency(there).stale_after(0.05),
              w.wheels.speeds >> f.control.speeds,
              (f.motor.command >> w.wheels.command).latency(back))
    w.task("dynamics", every=0.1, run=[w.craft, w.nav])
    EVENT
"""


@pytest.fixture
def mission(tmp_path):
    """A function that makes a mission, its last line of world.py as given, and loads it."""
    def make(event="pass", seed=0, **parameters):
        folder = tmp_path / "pair"
        folder.mkdir(exist_ok=True)
        (folder / "flight.py").write_text(FLIGHT)
        (folder / "world.py").write_text(WORLD.replace("EVENT", event))
        return fledge.load(str(folder), seed, **parameters)
    return make


def record(sim):
    """All outputs, at the periods of their processes, as far as they are here."""
    for process in sim.processes:
        sim.record(*process, every=0.1 if process.name == "world" else 0.5)


def records(*sims):
    return {log.path: (log.times(), log.bytes()) for sim in sims for log in sim.records}


_number = itertools.count()


def fly_apart(make, until, seed, names):
    """Each process a node in a thread of its own; returns their simulations."""
    controller = cosim.Controller("pair", names, until, seed=seed,
                                  address=f"ipc://@fledge-test-{os.getpid()}-{next(_number)}", join=PATIENCE,
                                  reply=PATIENCE)
    sims, threads, failures = [], [], []
    for name in names:
        sim = make()
        sims.append(sim)
        node = cosim.split(sim, name)
        record(sim)

        def serve(node=node):
            try:
                node.serve(controller.address, simulation="pair", timeout=PATIENCE)
            except Exception as error:
                failures.append(str(error))

        threads.append(threading.Thread(target=serve))
        threads[-1].start()
    reason = controller.run()
    for thread in threads:
        thread.join()
    assert (reason, failures) == ("", [])
    return sims


def test_the_wires_that_cross():
    found = cosim.crossing_wires(fledge.load("nadir_spin"))
    assert [(w.topic, w.port, w.latency, w.message.name, w.optional) for w in found] == [
        ("/world/nav/attitude", "flight.tracking.attitude", "same_instant", "NavAttitude", False),
        ("/world/nav/orbit", "flight.guidance.orbit", "same_instant", "NavOrbit", False),
        ("/world/wheels/speeds", "flight.control.speeds", "same_instant", "WheelSpeeds", True),
        ("/flight/motor/command", "world.wheels.command", "next_instant", "WheelCommand", True)]


def test_latency_and_age_cross_too(mission):
    wires = {w.port: w for w in cosim.crossing_wires(mission(there=1))}
    assert wires["flight.tracking.attitude"].latency == "next_exchange"
    assert wires["flight.guidance.orbit"].stale_after == 50_000_000
    assert wires["world.wheels.command"].latency == "next_instant"


@pytest.mark.parametrize("there, back", itertools.product([0, 1], [0, 1]))
def test_modes_events_noise_and_ages_are_the_same_in_two(mission, there, back):
    """A mode is entered by an event, an input gets old, and random draws come from the controller's seed."""
    def make(seed=0):
        return mission("w.event('once', when=w.watch(w.craft.state).sigma_BN.norm() > 0.01, do=lambda: w.nav)",
                       seed, there=there, back=back)

    first = make(seed=7)
    record(first)
    first.run(30)
    assert first.mode == "work" and first.flight.motor.command.u.any()
    together = records(first)
    apart = records(*fly_apart(make, 30, 7, ["flight", "world"]))
    assert sorted(apart) == sorted(together)
    assert [path for path in together if apart[path] != together[path]] == []


PUSHED = """
from fledge import Orbit, world

def build(sim):
    # Two probes in the air, and a craft that feels all that acts on them.
    air, hub = sim.add_world("air"), sim.add_world("world")
    air.air = world.Atmosphere(body=world.EARTH, law="STANDARD_1976", spin=7e-5)
    air.light = world.Sunlight(sun=world.SUN.at([1.5e11, 0, 0]), irradiance=1361)
    loads = []
    for k in (1, 2):
        drag = world.Drag(air=air.air, Cd=2.2 * k, area=3, centre_B=[0.1, 0.2 * k, 0])
        press = world.SolarPressure(light=air.light, Cr=1.2, area=9 * k, centre_B=[0, 0.3, 0])
        probe = world.Spacecraft(mass=50, I_B=[9, 8, 7], parts=[drag, press], gravity=[world.EARTH],
                                 omega_BN_B=[0.01 * k, 0.02, 0.03], orbit=Orbit(world.EARTH, altitude=120e3, f=0.1 * k))
        for name, model in (("drag", drag), ("press", press), ("probe", probe)):
            setattr(air, f"{name}{k}", model)
        loads += [drag.load, press.load]
    hub.craft = world.Spacecraft(mass=20, I_B=[3, 4, 5], omega_BN_B=[0.02, 0, 0.01])
    hub.connect(*(load >> hub.craft.external for load in loads))
    air.connect(air.probe1.state >> [air.air.truth, air.light.truth])
    air.task("air", every=0.5, run=[air.air, air.light, air.probe1, air.probe2])
    hub.task("craft", every=0.1, run=[hub.craft])
"""


def test_forces_of_several_sources_add_up_in_one_program_and_in_two(tmp_path):
    folder = tmp_path / "pair"
    folder.mkdir()
    (folder / "mission.py").write_text(PUSHED)

    def make():
        return fledge.load(str(folder))

    whole = make()
    record(whole)
    whole.run(20)
    w = whole.process("world")
    inputs = [part.external for part in (w.craft, w.craft_external_2, w.craft_external_3, w.craft_external_4)]
    assert min(np.linalg.norm(load.force_B) for load in inputs) > 1e-6
    C_BN = mrp_to_dcm(w.craft.state.sigma_BN)
    omega, I_B = w.craft.state.omega_BN_B, np.diag([3, 4, 5])
    torque = sum(load.torque_B for load in inputs) - np.cross(omega, I_B @ omega)
    np.testing.assert_allclose(w.craft.state.a_BN_N, C_BN.T @ sum(load.force_B for load in inputs) / 20, rtol=1e-12)
    np.testing.assert_allclose(w.craft.state.domega_BN_B, np.linalg.solve(I_B, torque), rtol=1e-12)
    with pytest.raises(fledge.SetupError, match="air.press2.load >> world.craft.external: .* by .*_external_4"):
        w.connect(whole.process("air").press2.load >> w.craft.external)
    together = records(whole)
    apart = records(*fly_apart(make, 20, 0, ["air", "world"]))
    assert sorted(apart) == sorted(together)
    assert [path for path in together if apart[path] != together[path]] == []


def test_what_runs_elsewhere_answers_nothing(mission):
    sim = mission()
    f = sim.flight
    cosim.split(sim, "world")
    with pytest.raises(fledge.SetupError, match="flight runs in another program"):
        sim.flight
    with pytest.raises(fledge.SetupError, match="flight.control: flight runs in another program"):
        f.control
    assert sim.world.craft is not None


@pytest.mark.parametrize("event, text", [
    ("w.event('e', when=w.watch(f.control.torque).torque_B.norm() > 1, do=print)",
     r"world.py, line 15: event world.e watches flight.control, .* watch that input"),
    ("w.event('e', when=lambda: f.control.K > 3, do=print)", "line 15: event world.e calls Python that reaches flight"),
    ("w.at(3, lambda: f.enter('work'))", r"line 15: event world.at_3000000000_ns calls Python that reaches flight"),
    ("g = f.control.torque; w.at(3, lambda: [print(x) for x in [g]])", "reaches flight.control.torque"),
    ("w.connect((w.nav.attitude >> f.guidance.nothing)) if 0 else f.connect(w.nav.attitude >> f.again.attitude)",
     r"line 15: flight.again.attitude reads world.nav.attitude at same_instant, and flight.tracking.attitude at "
     "next_exchange"),
])
def test_what_cannot_be_split_is_refused(mission, event, text, monkeypatch):
    if "again" in event:
        more = ("    f.again = fsw.TrackingError()\n    f.task('more', every=0.5, run=[f.again])\n"
                "    f.connect(f.guidance.reference >> f.again.reference)\n")
        monkeypatch.setitem(globals(), "FLIGHT", FLIGHT + more)
    for process in ("world", "flight"):
        sim = mission(event, there=1)
        with pytest.raises(fledge.SetupError, match=text):
            cosim.split(sim, process)
        assert len(sim.processes) == 2


def test_a_wrong_process_a_late_one_and_an_idle_one(mission):
    with pytest.raises(fledge.SetupError, match="pair has no process 'ground'; it has world, flight"):
        cosim.split(mission(), "ground")
    sim = mission()
    sim.step()
    with pytest.raises(fledge.SetupError, match="has run until 0 s"):
        cosim.split(sim, "flight")
    with pytest.raises(fledge.SetupError, match="world has no task, so it can be no node.*; it is empty"):
        cosim.split(fledge.Simulation("nothing"), "world")


INTERRUPTED = """
import fledge, sys
from fledge import cosim
sim = fledge.load("nadir_spin")
node = cosim.split(sim, "flight")
sim.open_archive = lambda **_: print("begun", flush=True)
print("ready", flush=True)
node.serve(sys.argv[1])
"""


@pytest.mark.parametrize("running", [False, True], ids=["before the run", "in it"])
def test_ctrl_c_leaves(running):
    address = f"ipc://@fledge-test-{os.getpid()}-{next(_number)}"
    threads, outcomes = [], []
    if running:
        controller = cosim.Controller("nadir_spin", ["flight", "world"], 1e8, address=address, join=PATIENCE,
                                      reply=PATIENCE)
        world = cosim.split(fledge.load("nadir_spin"), "world")
        threads = [threading.Thread(target=lambda: outcomes.append(controller.run())),
                   threading.Thread(target=lambda: outcomes.append(world.serve(address)))]
    with subprocess.Popen([sys.executable, "-c", INTERRUPTED, address], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True) as program:
        try:
            for thread in threads:
                thread.start()
            assert program.stdout.readline() == "ready\n"
            assert not running or program.stdout.readline() == "begun\n"
            program.send_signal(signal.SIGINT)
            assert "KeyboardInterrupt" in program.communicate()[1]
        finally:
            program.kill()
            for thread in threads:
                thread.join()
    assert len(outcomes) == len(threads)
    assert all("flight" in reason for reason in outcomes), outcomes


def test_a_node_without_a_controller_is_an_error(mission):
    with pytest.raises(fledge.RunError, match="no controller answers at"):
        cosim.split(mission(), "flight").serve(f"ipc://@fledge-none-{os.getpid()}", timeout=0.05)
