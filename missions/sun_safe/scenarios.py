# SPDX-License-Identifier: Apache-2.0
"""From a tumble to the Sun, through a failed converter and an eclipse; and where no Sun is seen at first."""
import numpy as np

from fledge.attitude import mrp_to_dcm
from fledge.units import minute, s


def safe(sim):
    """The panels find the Sun within three minutes, and keep to it, also in the shadow of the Earth."""
    log = _fly(sim, 100 * minute)
    log.plot("heading.s_B", "light.visible", "craft.state.omega_BN_B", "command.u",
             units={"craft.state.omega_BN_B": "deg/s"},
             titles=["(a) direction to the Sun, as flight knows it", "(b) how much of the Sun is seen", "(c) rates",
                     "(d) wheel torques"],
             name="sun_safe", title="From a tumble to the Sun")
    off, rate = _off(log), np.linalg.norm(log["craft.state.omega_BN_B"], axis=1)
    dark = log["light.visible"] == 0
    assert rate[0] > np.radians(3) and dark.sum() > 1500, "there was no tumble, or no eclipse"
    late = log.time > 180
    assert off[late].max() < np.radians(3), f"the panels are {np.degrees(off[late].max()):.3g} deg off the Sun"
    assert abs(rate[log.time > 240] - np.radians(0.1)).max() < np.radians(0.05), "it does not spin as it should"

    # The sensor of A whose channel stays at its end is out of use twenty updates later, and nothing else.
    faulty, unused = log["sun.status.faulty"], log["sun.status.unused"]
    assert not faulty[log.time < 480].any() and (faulty[log.time > 491] == 1).all() and (unused[-1] == 1 << 3)


def blind(sim):
    """For 15 minutes no Sun is seen: the body stops to tumble, searches, and then finds it."""
    sim.world.css.faults = [{"kind": "DEAD", "lasts": 15 * minute}]
    log = _fly(sim, 25 * minute)
    off, rates = _off(log), log["craft.state.omega_BN_B"]
    searches = (log.time > 300) & (log.time < 890)
    wanted = sim.flight.safe.search_B
    assert np.abs(rates[searches] - wanted).max() < np.radians(0.05), "it does not search"
    assert off[log.time > 1100].max() < np.radians(3), "it has not found the Sun"
    assert off[searches].max() > np.radians(60), "there was nothing to search"


def _fly(sim, duration):
    f, w = sim.flight, sim.world
    log = sim.record(w.craft.state, w.light.light, f.line.heading, f.sun.status, f.safe.error, f.tumble.state,
                     f.motor.command, every=1 * s)
    sim.run(duration)
    return log


def _off(log):
    """[rad] Between b1 and the true direction to the Sun."""
    b1, sun = mrp_to_dcm(log["craft.state.sigma_BN"])[:, 0], log["light.s_N"]
    return np.arctan2(np.linalg.norm(np.cross(b1, sun), axis=1), np.einsum("ij,ij->i", b1, sun))
