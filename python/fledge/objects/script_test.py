# SPDX-License-Identifier: Apache-2.0
"""Flight modules whose update is in Python, on the desktop."""
import inspect

import numpy as np
import pytest

import fledge
from fledge import RunError, SetupError, Simulation, cli, flight as fsw, montecarlo, objects, world
from fledge.mission.wiring import Wiring
from fledge.objects.script import script
from fledge.plot.wiring import dot
from fledge.units import rad, s


def turn(m, t, dt):
    """About its third axis, 0.01 rad in each second, as EulerRotation turns; degraded from 2 s on."""
    m.reference.sigma_RN = m.sigma_RN
    m.reference.sigma_RN[2] = np.tan(0.0025 * t)
    m.reference.omega_RN_N[2] = 0.01 if dt else 0.0
    m.publish(m.reference, quality="DEGRADED" if t >= 2 else "GOOD")


def begin(m):
    m.reference.domega_RN_N = [1, 2, 3]


def turned(update=turn, reset=begin):
    """A module in Python, and one in C that reads it."""
    sim = Simulation("turned")
    f = sim.flight
    f.guidance = fsw.InertialPointing(sigma_RN=[0.1, 0, 0], update=update, reset=reset)
    f.spin = fsw.EulerRotation(rates=[0, 0, 0.1 * rad / s])
    f.connect(f.guidance.reference >> f.spin.base)
    f.task("gnc", every=0.5 * s, run=[f.guidance, f.spin])
    return sim


def test_the_kernel_calls_it_in_place_of_the_c_function():
    sim = turned()
    sim.prepare()
    out = sim.flight.guidance.reference
    assert out.head.sequence == 0 and out.domega_RN_N.tolist() == [1, 2, 3]
    sim.step()
    assert out.omega_RN_N[2] == 0.0     # dt is 0 at the first update
    sim.run(until=1.7 * s)
    assert (out.head.t, out.head.sequence, out.head.quality.name) == (1_500_000_000, 4, "GOOD")
    assert out.sigma_RN.tolist() == [0.1, 0, np.tan(0.0025 * 1.5)] and out.omega_RN_N[2] == 0.01
    np.testing.assert_array_equal(sim.flight.spin.base.sigma_RN, out.sigma_RN)
    sim.run(until=2 * s)
    assert out.head.quality.name == "DEGRADED" and sim.flight.spin.reference.head.quality.name == "DEGRADED"
    sim.reset()
    assert out.head.sequence == 0 and out.sigma_RN.tolist() == [0, 0, 0]   # the reset of the C runs before


def test_none_is_no_script():
    m = fsw.InertialPointing(sigma_RN=[0.1, 0, 0], update=None, reset=None, turns=None)
    m.update(t=1.0)
    assert script(m) is None and m.reference.sigma_RN[0] == 0.1


def test_held_keeps_content_time_and_sequence():
    def lose(m, t, dt):
        if t < 1:
            m.reference.sigma_RN[0] = t
            m.publish(m.reference)
        else:
            m.held(m.reference)

    sim = turned(lose)
    sim.run(3 * s)
    head = sim.flight.guidance.reference.head
    assert (head.t, head.sequence, head.quality.name) == (500_000_000, 2, "DEGRADED")


def count(m, t, dt):
    """Its state is in the struct alone."""
    m.reference.sigma_RN[1] += 0.125
    m.publish(m.reference)


def test_snapshots_and_clones_have_its_state():
    sim = turned(count, None)
    sim.run(2 * s)
    snapshot, other = sim.snapshot(), sim.clone()
    sim.run(2 * s)
    end = objects.memory(sim.flight.guidance)
    other.run(2 * s)
    assert objects.memory(other.flight.guidance) == end
    assert script(other.flight.guidance) == (count, None)
    sim.restore(snapshot)
    sim.run(2 * s)
    assert objects.memory(sim.flight.guidance) == end


def test_a_configuration_module_may_be_in_python():
    def inertia(m, t, dt):
        m.vehicle.I_B = 2 * m.I_B
        m.publish(m.vehicle)

    sim = turned()
    f = sim.flight
    f.vehicle = fsw.VehicleConfig(I_B=10, update=inertia)
    f.control = fsw.MrpFeedback(K=1, P=1)
    f.tracking = fsw.TrackingError()
    f.connect(f.vehicle.vehicle >> f.control.vehicle, f.tracking.error >> f.control.error,
              f.spin.reference >> f.tracking.reference)
    sim.world.craft = world.Spacecraft(I_B=10)
    sim.world.nav = world.Navigation()
    f.connect(sim.world.craft.state >> sim.world.nav.truth, sim.world.nav.attitude >> f.tracking.attitude)
    f.task("control", every=0.5 * s, run=[f.tracking, f.control])
    sim.world.task("dynamics", every=0.5 * s, run=[sim.world.craft, sim.world.nav])
    sim.run(1 * s)
    assert f.control.vehicle.I_B[1, 1] == 20 and f.control.vehicle.head.sequence == 1


def test_an_exception_ends_the_run_with_line_and_time():
    def broken(m, t, dt):
        m.publish(m.reference)
        if t >= 1:
            m.reference.sigma_RN[3] = 1

    line = inspect.getsourcelines(broken)[1] + 3
    sim = turned(broken)
    with pytest.raises(RunError, match=rf"script_test.py, line {line}: flight.guidance at 1 s: IndexError") as error:
        sim.run(10 * s)
    assert isinstance(error.value.__cause__, IndexError) and sim.state_time == 0.5
    with pytest.raises(RunError, match="reset it, or restore a snapshot"):
        sim.run(1 * s)


def test_an_exception_at_its_reset_names_the_line_too():
    def begin(m):
        m.publish(m.reference)

    sim = turned(turn, begin)
    with pytest.raises(RunError, match=r"script_test.py, line \d+: flight.guidance at its reset: SetupError: "
                       r"flight.guidance.publish\(\) is for its own update"):
        sim.prepare()
    with pytest.raises(RunError, match="at its reset"):
        sim.run(1 * s)


@pytest.mark.parametrize("wrong, complaint", [
    (lambda m: setattr(m.reference, "sigma", 1), "has no attribute 'sigma'; did you mean 'sigma_RN'?"),
    (lambda m: setattr(m.reference, "sigma_RN", [1, 2]), "sigma_RN: expected shape"),
    (lambda m: setattr(m.reference, "sigma_RN", "x"), "sigma_RN: expected shape"),
    (lambda m: m.publish(m.sigma_RN), r"expected an output of the module; found .* It has reference"),
    (lambda m: m.publish(m.reference, quality="BEST"), "quality"),
    (lambda m: m.publish(), "publish"),
    (lambda m: (m.reference.sigma_RN.fill(np.nan), m.publish(m.reference)),
     r"script_test.py, line \d+: .* ValueError: flight.guidance.reference says GOOD, but its sigma_RN\[0\] is nan"),
])
def test_what_it_does_wrong_has_the_message_of_an_assignment(wrong, complaint):
    with pytest.raises(RunError, match=complaint):
        turned(lambda m, t, dt: wrong(m)).run(1 * s)


def test_outputs_can_be_written_in_the_update_alone():
    sim = turned()
    sim.run(1 * s)
    m = sim.flight.guidance
    for action in (lambda: m.publish(m.reference), lambda: m.held(m.reference)):
        with pytest.raises(SetupError, match="is for its own update in Python"):
            action()
    with pytest.raises(SetupError, match="an assignment has no effect"):
        m.reference.head.t = 0
    with pytest.raises(AttributeError, match="'update' cannot be assigned"):
        m.update = turn


def test_an_update_writes_its_own_module_alone():
    def meddle(m, t, dt):
        wrong(sim.flight.spin)

    sim = turned(meddle)
    for wrong, complaint in ((lambda spin: setattr(spin, "rates", [1, 2, 3]), "spin.rates is of another module"),
                             (lambda spin: setattr(spin.base.head, "t", 3), "base.head.t is of another module"),
                             (lambda spin: spin.rates.fill(1), "read-only")):
        sim.reset()
        with pytest.raises(RunError, match=complaint):
            sim.run(1 * s)
    sim.flight.spin.rates = [1, 2, 3]


async def asleep(m, t, dt):
    pass


def stepwise(m, t, dt):
    yield


@pytest.mark.parametrize("keywords, complaint", [
    (dict(update=3), r"InertialPointing.update: expected a function of \(m, t, dt\); found 3"),
    (dict(update=begin), r"update: .* found begin\(\), script_test.py, line \d+ with the arguments \(m\)"),
    (dict(update=turn, reset=turn), r"reset: expected a function of \(m\); found turn\(\)"),
    (dict(update=asleep), "is asynchronous"),
    (dict(update=stepwise), "is a generator"),
    (dict(reset=begin), "reset= goes with update="),
    (dict(turns=5), "turns= goes with update="),
    (dict(update=turn, turns=0), "turns: expected a whole number from 1 to 2\\^31 - 1; found 0"),
])
def test_what_is_no_function_of_a_module_is_refused(keywords, complaint):
    with pytest.raises(SetupError, match=complaint):
        fsw.InertialPointing(**keywords)


def test_a_model_of_the_world_is_refused():
    with pytest.raises(TypeError, match="Spacecraft is a model of the world: update= and reset= are for flight"):
        world.Spacecraft(I_B=1, update=turn)


def test_a_module_in_python_is_tried_alone():
    m = fsw.InertialPointing(update=turn, turns=500)
    m.reset()
    m.update(t=1.0, dt=0.5)
    assert (m.reference.head.t, m.reference.omega_RN_N[2]) == (1_000_000_000, 0.01)
    with pytest.raises(RunError, match=r"script_test.py, line \d+: InertialPointing at 0 s: ZeroDivisionError"):
        fsw.InertialPointing(update=lambda m, t, dt: 1 / t).update()


def test_what_is_python_is_seen():
    sim = turned()
    assert "  update in Python: turn(), script_test.py, line " in repr(sim.flight.guidance)
    assert "  reset in Python: begin(), script_test.py, line " in repr(sim.flight.guidance)
    wiring = Wiring(sim)
    assert "InertialPointing; Python: turn()\n" in wiring.outline() and "Python: turn()" in dot(wiring)


def test_health_sees_its_numbers():
    def infinite(m, t, dt):
        m.publish(m.reference)
        m.reference.sigma_RN[0] = 1e300 * 1e300

    with pytest.raises(RunError, match=r"flight.guidance.reference says GOOD at 0 s, but its sigma_RN\[0\] is inf"):
        turned(infinite).run(1 * s)


MISSION = '''
from fledge import flight as fsw
from fledge.units import s

seen = []

def wander(m, t, dt):
    seen.append(t)
    m.reference.sigma_RN = m.sigma_RN * (1 + 0.001 * len(seen))
    m.publish(m.reference)


def build(f):
    f.guidance = fsw.InertialPointing(sigma_RN=[0.1, 0.2, 0.3], update=wander)
    f.task("gnc", every=0.5 * s, run=[f.guidance])
'''


def test_export_to_c_and_cfs_name_its_line(tmp_path, capfd):
    (tmp_path / "flight.py").write_text(MISSION)
    for words in (["c"], ["cfs", "--app", "nav"]):
        assert cli.main(["export", words[0], str(tmp_path), *words[1:], "--out", str(tmp_path / "out")]) == 2
        assert (f"{tmp_path}/flight.py, line 14: flight.guidance is still Python (wander(), flight.py, line 7): write "
                "it in C, or fly it with export micropython") in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


DISPERSED = """
from fledge.units import s


def disperse(d):
    d.duration, d.every = 5 * s, 1 * s
    d["flight.guidance.sigma_RN"] = d.uniform(0, 0.5)
    d.retain("flight.guidance.reference.sigma_RN")
"""


def test_processes_fly_a_campaign_because_functions_may_share_data(tmp_path):
    (tmp_path / "flight.py").write_text(MISSION)
    (tmp_path / "dispersions.py").write_text(DISPERSED)
    campaign = montecarlo.Campaign(tmp_path)
    assert campaign.has_callables
    first, second = (campaign.fly(5, seed=2, threads=n) for n in (1, 2))
    key = "flight.guidance.reference.sigma_RN"
    np.testing.assert_array_equal(first.retained[key], second.retained[key])
    np.testing.assert_array_equal(first.retained[key][:, -1, 0], first.retained[key][:, 0, 0] / 1.001 * 1.011)
