# SPDX-License-Identifier: Apache-2.0
"""Velocity pointing (appendix A of the thesis) past Mars, 80 minutes before and after periapsis."""
from fledge import scan, trajectory, world
from fledge.units import deg, minute, s


def flyby(sim):
    """b2 follows the velocity past Mars; flight does not know the pull of Sun and Jupiter."""
    f, w = sim.flight, sim.world
    log = sim.record(f.guidance.reference, f.tracking.error, f.motor.command, w.craft.state, every=1 * s)

    sim.run(160 * minute)

    velocity = scan.Path(log.time, log["state.v_BN_N"], frame="n")
    b2       = scan.path(log, "state.sigma_BN", boresight=2)
    _plot(log, velocity, b2, w.craft.sky)

    # It passes periapsis as planned, half way through the run.
    radius = (log["state.r_BN_N"]**2).sum(axis=1)**0.5
    assert abs(radius.min() - 3897e3) < 10, f"periapsis is {radius.min() - 3897e3:.2g} m too high"
    assert abs(radius.argmin() - 4800) < 10, f"periapsis is at {radius.argmin()} s"

    # b2 finds the velocity from a tumble and follows it, also through periapsis, where the velocity
    # turns by 0.03 deg/s and its rate changes all the time.
    off = b2.off(velocity)
    late = log.time > 20 * 60
    assert off[late].max() < 5e-6, f"b2 is {off[late].max():.2g} rad off the velocity"
    assert off[-1] < 1e-7, f"b2 ends {off[-1]:.2g} rad off the velocity"
    torque = abs(log["command.u"]).max(axis=1)
    assert torque.max() < 0.2 + 1e-12 and torque[late].max() < 0.01, "the fly-by works the wheels too hard"


def _plot(log, velocity, b2, sky):
    title = "Fly-by of Mars, 2 March 2015"
    log.plot("error.sigma_BR", "error.omega_BR_B", "reference.omega_RN_N", "command.u",
             titles=["(a) attitude error", "(b) rate error",
                     "(c) rate of the velocity frame", "(d) wheel torques"],
             columns=2, name="flyby_errors", title=title)
    bodies = {name: sky.state(body, 80 * minute).r_PN_N
              for name, body in (("Sun", world.SUN), ("Jupiter", world.JUPITER_SYSTEM))}
    scan.sphere(log, {"velocity": velocity, "$b_2$": b2}, view=(212 * deg, 25 * deg), marks=bodies,
                name="flyby_sphere", title=title)
    trajectory.plot(log, "craft.state", world.MARS, {"$b_1$": 1, "$b_2$, along the velocity": 2},
                    every=10 * minute, name="flyby_trajectory", title=title)
