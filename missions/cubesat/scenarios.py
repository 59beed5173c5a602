# SPDX-License-Identifier: Apache-2.0
"""A CubeSat from its release on: it finds the Sun by itself; the ground has it look down, at a target and at the
station; and three faults."""
from dataclasses import replace

import numpy as np

from fledge import flight as fsw
from fledge import ground
from fledge.attitude import angle, mrp_to_dcm, relative
from fledge.records.activity import modes
from fledge.units import deg, hour, minute, s

from .vehicle import CAMERA, PANELS

GOOD = fsw.Quality.GOOD


def release(sim):
    """No command: rods stop the tumble, wheels what is left of it, and the panels find the Sun, through eclipses."""
    log = _record(sim)
    sim.run(4 * hour)
    off = _off(log, PANELS, log["light.s_N"])
    _plot(log, "release", "A CubeSat after its release", off, "between the panels and the Sun")
    begins = modes(log)["flight"]
    assert [name for _, name in begins] == ["detumble", "brake", "sun"], begins
    settled = log.time > begins[-1][0] + 300
    worst = off[settled].max()
    assert worst < np.radians(5), f"the panels are {np.degrees(worst):.3g} deg off the Sun"
    assert log["light.visible"][settled].min() == 0, "there was no eclipse"

    # Flight has known its attitude and its place since the first minutes, without star trackers, and still does.
    early = log.time > 600
    assert (log["vectors.attitude.head.quality"][early] == GOOD).all(), "the attitude is degraded"
    assert _wrong(log, "vectors.attitude")[early].max() < np.radians(1.5), "the attitude is wrong"
    assert _away(log)[early].max() < 30, "the place is wrong"
    assert log["telemetry.battery"][-1] > 0.9 * 65535, "the battery empties"


def imaging(sim):
    """It looks down, then at the target of its camera, then at the station, while these are in sight."""
    log = _pointing(sim)
    sim.run(23 * minute)
    miss = _miss(log)
    _plot(log, "imaging", "A target of the camera, and a pass over the station", miss)
    begins = modes(log)["flight"]
    assert [name for _, name in begins] == ["brake", "sun", "nadir", "image", "nadir", "contact", "nadir"], (
        f"expected the target of the camera, then the station; found the modes {begins}")
    _points(log, miss, 0.2 if _sees_stars(sim) else 2)
    seen = (log["world.station.contact.visible"] == 1) & (log.time < sim.time)
    forecast = (log["forecast.state"] == fsw.PassState.NOW) & (log.time < sim.time)
    assert seen.sum() > 100 and (seen != forecast).sum() <= 1, "the forecast of the pass is wrong"


def blinded(sim):
    """Both star trackers fall silent while it looks down: Sun, field and gyro hold it, less well."""
    trackers = [getattr(sim.world, name) for name in ("stars_a", "stars_b") if name in dir(sim.world)]
    for tracker in trackers:
        tracker.faults = [{"kind": "DROPOUT", "begin": 8 * minute}]
    log = _pointing(sim)
    sim.run(55 * minute)
    miss = _miss(log)
    _plot(log, "blinded", "Both star trackers fall silent", miss)
    assert not trackers or log["stars.attitude.head.quality"][-1] < GOOD, "flight still believes them"
    assert log["light.visible"][-1] == 0 and modes(log)["flight"][-1][1] == "nadir", "it does not look down in the dark"
    _points(log, miss, 2)


def without_gps(sim):
    """The receiver of GPS is lost: the filter of the orbit goes on, then elements take its place; it keeps pointing."""
    sim.world.gps.faults = [{"kind": "DROPOUT", "begin": 8 * minute}]
    log = _pointing(sim)
    sim.run(6 * hour)
    assert log["orbit.orbit.head.quality"][-1] < GOOD, "it believes an orbit of hours ago"
    _points(log, _miss(log), 0.5 if _sees_stars(sim) else 2)


def crippled(sim):
    """Two wheels seize: rods and the momentum of what is left point the camera, coarsely."""
    def seize():
        sim.world.wheels.friction = [0.01, *sim.world.wheels.friction[1:-1], 0.01]      # [N m] the first and the last

    sim.world.at(8 * minute, seize)
    log = _pointing(sim)
    sim.run(9 * hour)
    miss = _miss(log)
    _plot(log, "crippled", "Two wheels seize", miss)
    assert modes(log)["flight"][-1][1] == "hover", modes(log)
    worst = np.degrees(miss[log.time > 7 * 3600].max())
    assert worst < 5, f"the camera is {worst:.3g} deg off"


def _pointing(sim, after=5 * minute):
    """A CubeSat that turns slowly finds the Sun, and then the ground has it look down."""
    sim.world.craft.omega_BN_B = [0.2, -0.5, 0.3] * deg / s
    sim.flight.start_in("brake")
    log = _record(sim)
    sim.run(after)
    ground.connect(sim).command("mode", "nadir").completed(within=10 * s)
    return log


def _sees_stars(sim):
    """Whether the mission was loaded with star trackers."""
    return "stars" in dir(sim.flight)


def _record(sim):
    f, w = sim.flight, sim.world
    stars = [f.stars.attitude] if _sees_stars(sim) else []
    return sim.record(w.craft.state, w.light.light, w.wheels.speeds, w.power.telemetry, w.station.contact,
                      w.station.state, f.vectors.attitude, f.vectors.state, f.orbit.orbit, f.elements.orbit,
                      f.window.command, f.b_dot.state, f.plan.state, f.shadow.shadow, f.passes.forecast,
                      f.tracking.error, f.sun_safe.error, f.off.error, f.slew.status, f.keep_out.status,
                      f.target.target, *stars, every=2 * s)


def _plot(log, name, title, angles, between="between the camera and what the mode looks at"):
    """angles [rad]: what the scenario is about, between what; the record does not have them."""
    what = replace(log.series("craft.state.sigma_BN"), key="angle", name="angle", values=angles, unit="rad",
                   meaning=between)
    log.plot("craft.state.omega_BN_B", what, "speeds.Omega", "window.command.dipole",
             units={"craft.state.omega_BN_B": "deg/s", "angle": "deg", "speeds.Omega": "rpm"},
             titles=["(a) rates", f"(b) angle {between}", "(c) wheel speeds", "(d) dipoles of the rods"],
             name=name, title=title)


def _miss(log):
    """[rad] Between the camera and what the mode says that it looks at; NaN in other modes."""
    r = log["craft.state.r_BN_N"]
    ways = {"nadir": -r, "hover": -r, "contact": log["world.station.state.r_PN_N"] - r,
            "image": log["target.target.r_PN_N"] - r}
    off = np.full(len(log.time), np.nan)
    for begin, name in modes(log)["flight"]:
        since = log.time >= begin
        off[since] = _off(log, CAMERA, ways[name])[since] if name in ways else np.nan
    return off


def _points(log, miss, limit):
    """Once a slew has ended, the camera misses [rad] what the mode says by less than a limit [deg], by the truth."""
    miss, there = np.degrees(miss), log["slew.status.phase"] == fsw.SlewPhase.TRACKING
    begins = modes(log)["flight"]
    for (begin, name), (end, _) in zip(begins, [*begins[1:], (log.time[-1], "")], strict=True):
        late = (log.time > begin) & (log.time < end) & there
        if name in ("nadir", "contact", "image"):
            assert late.any(), f"{name}, from {begin:g} s on: it does not arrive"
            assert miss[late].max() < limit, f"{name}, from {begin:g} s: the camera is {miss[late].max():.3g} deg off"


def _off(log, axis_B, way_N):
    """[rad] Between an axis of the body and a direction, by the truth."""
    axis = np.einsum("nji,j->ni", mrp_to_dcm(log["craft.state.sigma_BN"]), axis_B)
    return np.arctan2(np.linalg.norm(np.cross(axis, way_N), axis=1), np.einsum("ij,ij->i", axis, way_N))


def _wrong(log, attitude):
    """[rad] Between an attitude that flight knows and the truth."""
    return angle(relative(log[f"{attitude}.sigma_BN"], log["craft.state.sigma_BN"]))


def _away(log):
    """[m] Between the filtered place and the truth."""
    return np.linalg.norm(log["orbit.orbit.r_BN_N"] - log["craft.state.r_BN_N"], axis=1)
