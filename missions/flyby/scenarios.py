# SPDX-License-Identifier: Apache-2.0
"""Velocity pointing (appendix A of the thesis) past Mars, 80 minutes before and after periapsis."""
from fledge import scan, world
from fledge.units import deg, minute, s


def flyby(sim):
    """b2 keeps to the velocity past Mars, while Sun and Jupiter pull, of which flight does not know."""
    f, w = sim.flight, sim.world
    log = sim.record(f.guidance.reference, f.tracking.error, f.motor.command, w.craft.state, every=1 * s)

    sim.run(160 * minute)

    velocity = scan.Path(log.time, log["state.v_BN_N"], frame="n")
    b2       = scan.path(log, "state.sigma_BN", boresight=2)
    _plot(log, velocity, b2, w.craft.sky)

    # It passes where it was meant to, half way through the run.
    radius = (log["state.r_BN_N"]**2).sum(axis=1)**0.5
    assert abs(radius.min() - 3897e3) < 10, f"periapsis is {radius.min() - 3897e3:.2g} m too high"
    assert abs(radius.argmin() - 4800) < 10, f"periapsis is at {radius.argmin()} s"

    # b2 finds the velocity from a tumble and keeps to it, most of all through periapsis, where it
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
    _picture(log, title)


def _picture(log, title):
    """The way past Mars in the plane of the orbit, with two of the body's axes every ten minutes."""
    import matplotlib.style
    import numpy as np
    from fledge.attitude import mrp_to_dcm
    from fledge.plot import STYLE, deliver
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    if log._simulation.plots is False:
        return
    # To the right: the velocity at periapsis. Up: periapsis. In thousands of km.
    r, v = log["state.r_BN_N"] / 1e6, log["state.v_BN_N"]
    low = np.linalg.norm(r, axis=1).argmin()
    plane = np.stack([v[low] / np.linalg.norm(v[low]), r[low] / np.linalg.norm(r[low])], axis=-1)
    way, axes = r @ plane, mrp_to_dcm(log["state.sigma_BN"]) @ plane
    outward = (v / np.linalg.norm(v, axis=1, keepdims=True)) @ plane @ [[0, 1], [-1, 0]]
    with matplotlib.style.context(STYLE):
        figure = Figure(figsize=(9.4, 4.6), layout="constrained")
        figure.fledge_name = "flyby_orbit"
        axis = figure.add_subplot()
        axis.add_patch(Circle((0, 0), world.MARS.radius / 1e6, facecolor="#d9835f", edgecolor="#a85a3a"))
        axis.annotate("Mars", (0, 0), ha="center", va="center", color="white", fontweight="bold")
        axis.plot(*way.T, color="#aab4bf", linewidth=2.5)
        for k, label, color in ((0, "$b_1$", scan.MAGENTA), (1, "$b_2$, along the velocity", scan.DARK)):
            axis.quiver(*way[::600].T, *axes[::600, k].T, color=color, label=label, angles="xy", scale_units="xy",
                        scale=1 / 1.7, width=0.0032, zorder=3)
        for minutes in range(0, 161, 20):
            now = 60 * minutes
            axis.annotate("periapsis" if minutes == 80 else f"{minutes - 80:+d} min", way[now] + 2.7 * outward[now],
                          ha="center", va="center", fontsize=8, color=scan.SOFT)
        axis.set_xlim(-22, 22)
        axis.set_ylim(-7, 8)
        axis.set_aspect("equal")
        axis.set_xlabel("along the velocity at periapsis  [1000 km]")
        axis.set_ylabel("towards periapsis  [1000 km]")
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold", color=scan.INK)
    deliver(figure, log._simulation.plots)
