# SPDX-License-Identifier: Apache-2.0
"""Sensors in simulations: the models that they need; with actuators and faults of all kinds, in campaigns."""
import numpy as np
import pytest

import fledge
from fledge import SetupError, Simulation, flight as fsw, world
from fledge.montecarlo import Campaign
from fledge.units import deg, kg, m, ms, s


def measure(sensor, **wired):
    """Fly a craft with this sensor; a ground station stands for the bodies that are wired."""
    sim = Simulation("sensing")
    w = sim.world
    w.sensor, w.body = sensor, world.GroundStation(body=world.EARTH, latitude=0, longitude=0)
    w.light = world.Sunlight(sun=world.SUN.at([1.5e11, 0, 0]))
    w.craft = world.Spacecraft(I_B=[1, 1, 1] * kg * m**2, r_BN_N=[1e7, 1e7, 0] * m)
    w.connect(w.craft.state >> [sensor.truth, w.light.truth, w.body.truth])
    for name in wired:
        w.connect((w.light.light if name == "light" else w.body.state) >> getattr(sensor, name))
    w.task("world", every=1 * s, run=[w.craft, w.light, w.body, sensor])
    sim.run(1 * s)
    return sensor


def tracker(**given):
    return world.StarTracker(boresight_B=[0, 0, 1], **given)


def sun_sensor(**given):
    return world.SunSensor(boresight_B=[1, 0, 0], view=90 * deg, **given)


def coarse(**given):
    return world.CoarseSunSensors(axes_B=[[1, 0, 0]], current=1, **given)


@pytest.mark.parametrize("make, words", [
    (lambda: tracker(sun_exclusion=0.5), "world.sensor.sun_exclusion is 0.5 rad, but the tracker has no Sun: wire its"),
    (lambda: tracker(moon_exclusion=0.1), "world.sensor.moon_exclusion is 0.1 rad, but the tracker has no moon: wire"),
    (sun_sensor, "world.sensor has no Sun: wire its input sun or light, or give it s_N"),
    (coarse, "world.sensor has no Sun: wire its input sun or light, or give it s_N")])
def test_a_sensor_that_needs_the_sun_or_the_moon_must_have_it(make, words):
    with pytest.raises(SetupError) as error:
        measure(make())
    assert words in str(error.value)
    measure(make(), **{"moon" if "moon" in words else "sun": True})


def test_the_sun_may_be_a_body_a_light_or_a_direction():
    assert measure(tracker(sun_exclusion=0.5, s_N=[0, 0, 1])).blind == 1
    assert measure(tracker(sun_exclusion=0.5, s_N=[1, 0, 0])).blind == 0
    for given, wired in (({"s_N": [1, 0, 0]}, {}), ({}, {"light": True})):
        assert measure(sun_sensor(**given), **wired).heading.s_B == pytest.approx([1, 0, 0], abs=1e-3)
        assert measure(coarse(**given), **wired).currents.current[0] == pytest.approx(1)
    assert measure(sun_sensor(), sun=True).heading.head.sequence == 0  # it stands behind


# --- faults ----------------------------------------------------------------------------------------

KINDS = ("HIGH", "LOW", "BABBLE", "BIAS", "DRIFT", "DROPOUT", "DELAY", "DEAD")

MISSION = '''
from fledge import world
from fledge.units import N, deg, ms, s

def build(sim):
    panel, w = sim.add_world("panel"), sim.add_world("world")
    panel.set = world.FaultPanel(faults=[{"kind": "BABBLE", "channels": 1, "size": 1e-3, "begin": 20 * s}])
    panel.task("panel", every=1 * s, run=[panel.set])
    faults = [{"kind": kind, "channels": 2, "size": 0.5, "begin": 3 * s, "lasts": 30 * s}
              for kind in ("DROPOUT", "DELAY", "DRIFT")]
    triad = {"noise": [1e-8] * 3, "walk": [1e-9] * 3, "limit": 1, "faults": faults}
    w.field   = world.Magnetism(body=world.EARTH, dipole_P=[0, 0, -7.8e15])
    w.light   = world.Sunlight(sun=world.SUN.at([1.5e11, 0, 0]), shadows=[world.EARTH])
    w.rods    = world.TorqueRods(field=w.field, axes_B=[[1, 0, 0]], m_max=10)
    w.wheels  = world.ReactionWheels(axes_B=[[0, 0, 1]], J=0.1, Omega=100, faults=faults)
    w.thrusters = world.Thrusters(axes_B=[[1, 0, 0]], F=1 * N, faults=[{"kind": "BABBLE", "channels": 1}])
    w.craft   = world.Spacecraft(mass=100, I_B=[40, 35, 30], parts=[w.rods, w.wheels, w.thrusters],
                                 omega_BN_B=[0.1, 0, 0.05] * deg / s, r_BN_N=[7e6, 0, 0], v_BN_N=[0, 7500, 0])
    w.other   = world.Spacecraft(I_B=1, r_BN_N=[7e6, 1000, 0], v_BN_N=[0, 7500, 0])
    w.gyro    = world.Gyro(**triad)
    w.accelerometer = world.Accelerometer(**triad)
    w.magnetometer = world.Magnetometer(**triad)
    w.tracker = world.StarTracker(boresight_B=[0, 0, 1], noise_across=1e-9, latency=250 * ms, loss_rate=0.1,
                                  loss_time=2 * s, faults=faults)
    w.sun     = world.SunSensor(boresight_B=[1, 0, 0], view=1, noise=1e-8, faults=faults)
    w.css     = world.CoarseSunSensors(axes_B=[[1, 0, 0], [0, 1, 0]], current=[1e-3, 1e-3], faults=faults)
    w.gps     = world.GpsReceiver(position_noise=[1] * 3, wander=[5] * 3, wander_time=60 * s, latency=2 * s,
                                  faults=faults)
    w.camera  = world.CraftSensor(range_noise=0.1, attitude_noise=1e-3, faults=faults)
    w.nav     = world.Navigation(rate_noise=[1e-4] * 3, faults=faults)
    sensors = [w.gyro, w.accelerometer, w.magnetometer, w.tracker, w.sun, w.css, w.gps, w.camera, w.nav]
    w.connect(*(w.craft.state >> one.truth for one in [w.field, w.light, *sensors]), w.other.state >> w.camera.other,
              w.field.field >> w.magnetometer.field, w.light.light >> [w.sun.light, w.css.light],
              *(panel.set.set >> one.injected for one in [w.wheels, w.thrusters, *sensors]))
    w.task("truth", every=100 * ms, run=[w.craft, w.other, w.field, w.light, *sensors])
'''

CAMPAIGN = f'''
from fledge.units import s
def failures(d):
    d.duration, d.every = 20 * s, 1 * s
    d["world.gyro.faults[2].kind"] = d.choice(*{KINDS})
    d["world.gyro.faults[2].begin"] = d.uniform(0 * s, 10 * s)
    d["panel.set.faults[0].size"] = d.uniform(0.1, 1)
    d["panel.set.faults[0].begin"] = d.uniform(0 * s, 10 * s)
    for path in ("gyro.rate.omega_BN_B", "tracker.attitude.sigma_BN", "gps.orbit.r_BN_N", "camera.seen.r_TB_B"):
        d.retain("world." + path)
'''


def test_campaigns_with_faults_do_not_depend_on_the_number_of_threads(tmp_path):
    (tmp_path / "mission.py").write_text(MISSION)
    (tmp_path / "dispersions.py").write_text(CAMPAIGN)
    alone, parallel = (Campaign(tmp_path).fly(12, seed=1, threads=n) for n in (1, 3))
    assert not any(alone.failures) and len(set(alone.draws["world.gyro.faults[2].kind"])) > 3
    for path, values in alone.retained.items():
        np.testing.assert_array_equal(values, parallel.retained[path])
        assert len(np.unique(values.reshape(12, -1), axis=0)) == 12, path


def test_an_event_injects_a_fault_and_heals_it(tmp_path):
    (tmp_path / "mission.py").write_text(MISSION)
    sim = fledge.load(tmp_path)
    panel, gyro = sim.process("panel"), sim.world.gyro
    panel.set.n_faults = gyro.n_faults = 0
    panel.at(5 * s, lambda: setattr(panel.set, "faults", [{"kind": "DEAD"}]))
    panel.at(9 * s, lambda: setattr(panel.set, "n_faults", 0))
    log = sim.record(gyro.rate, every=100 * ms)
    sim.run(14 * s)
    silent = log.time[log["rate.head.quality"] == 2]
    # The panel's message of 5 s reaches the gyro at its update at 6 s, or before.
    assert 5 < silent[0] <= 6 and silent[-1] == pytest.approx(silent[0] + 3.9)


def test_six_sun_sensors_without_a_converter_see_the_sun_in_a_tumble():
    faces = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    sim = Simulation("cube")
    f, w = sim.flight, sim.world
    w.light = world.Sunlight(sun=world.SUN.at([1.5e11, 2e10, -5e10]))
    w.css = world.CoarseSunSensors(axes_B=faces, current=5e-3)
    w.craft = world.Spacecraft(I_B=[1, 2, 3] * kg * m**2, omega_BN_B=[3, -5, 4] * deg / s, r_BN_N=[1e7, 1e7, 0] * m)
    f.sun = fsw.SunDirection(axes_B=faces, current=5e-3, dark=0.02, differ=0.01)
    f.line = fsw.SunLine(noise=0.01, length=0.02, rate_noise=1e-9, walk=1e-14, rate_std=1e-3, gate=5, good=3 * deg,
                         hold=5 * s, persistence=20)
    w.gyro = world.Gyro()
    w.connect(w.craft.state >> [w.light.truth, w.css.truth, w.gyro.truth], w.light.light >> w.css.light,
              w.css.currents >> f.sun.currents, w.gyro.rate >> f.line.gyro)
    f.connect(f.sun.cosines >> f.line.cosines, f.sun.heading >> f.line.guess)
    f.task("sun", every=500 * ms, run=[f.sun, f.line])
    w.task("world", every=500 * ms, run=[w.craft, w.light, w.css, w.gyro])
    log = sim.record(w.craft.state, f.sun.heading, f.line.heading, every=500 * ms)
    sim.run(300 * s)
    to_sun = np.array([1.5e11, 2e10, -5e10]) - log["state.r_BN_N"]
    to_sun /= np.linalg.norm(to_sun, axis=1)[:, None]
    seen = np.einsum("nij,nj->ni", fledge.attitude.mrp_to_dcm(log["state.sigma_BN"]), to_sun)
    for name, least, within in (("sun.heading", 0.7, 1e-6), ("line.heading", 0.9, 0.02)):
        good = log[f"{name}.head.quality"] == 3
        off = np.linalg.norm(log[f"{name}.s_B"] - seen, axis=1)[good]
        assert good.mean() > least and off.max() < within, (name, good.mean(), off.max())
