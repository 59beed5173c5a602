# SPDX-License-Identifier: Apache-2.0
"""An Earth imager: nadir, a handover to a ground station and back, the same with a wheel that seizes, and the radio."""
import numpy as np

from fledge import ground
from fledge.attitude import mrp_to_dcm
from fledge.units import N, m, minute, s

SETTLE = 150     # [s] that a handover may take


def handover(sim):
    """The camera looks down; while the station sees the spacecraft, it looks at the station."""
    log = _record(sim)
    sim.run(35 * minute)
    _plot(log, "handover")
    _points(sim, log)
    assert (log["availability.available"][:, :4] == 1).all(), "a sound wheel was taken out of use"


def seized_wheel(sim):
    """A wheel's bearing seizes before the pass: it is taken out of use, and three wheels fly the handover."""
    def seizes():
        sim.world.wheels.friction = [0, 0.03 * N * m, 0, 0]

    sim.world.at(8 * minute, seizes)
    log = _record(sim)
    sim.run(35 * minute)
    _plot(log, "seized_wheel")
    assert list(log["availability.available"][-1][:4]) == [1, 0, 1, 1], "the seized wheel is in use"
    taken = log.time[log["availability.available"][:, 1] == 1].max() - 8 * 60
    assert 0 < taken < 10, f"it was taken out {taken:g} s after it failed"
    _points(sim, log, disturbed=8 * 60)


def contact(sim):
    """The ground speaks with the imager by radio: in vain before the pass, then for as long as the link holds."""
    w = sim.world
    log = sim.record(w.station.contact, w.radio.down, w.radio.down_traffic, every=1 * s)
    craft = ground.connect(sim, radio=w.radio)
    early = craft.command("telemetry", "housekeeping")
    sim.run(16 * minute)
    assert not early.reports, "a command has come to a spacecraft that no station sees"
    while not w.radio.up.lock:
        sim.run(5 * s)
    craft.command("telemetry", "flight.tracking.error").completed(within=5 * s)
    craft.listen(35 * minute - sim.time * s)
    log.plot(
        "contact.elevation", "down.eb_n0_dB", "down.lock", "down_traffic.bytes", units={"contact.elevation": "deg"},
        titles=["(a) elevation over the station", "(b) Eb/N0 of telemetry", "(c) the ground's receiver is locked",
                "(d) bytes that the ground received"],
        name="contact", title="An Earth imager and its ground station speak by radio")

    traffic, visible = w.radio.down_traffic, log["contact.visible"] == 1
    assert w.radio.up_traffic.lost == 1 and traffic.lost > 0, "nothing was lost"
    assert craft.telemetry.flight.tracking.error.head.t / 1e9 > log.time[log["down.lock"] == 1].max() - 1
    assert (log["down.lock"][~visible] == 0).all() and log["down.lock"][visible].mean() > 0.9
    assert traffic.received + traffic.lost == traffic.sent and traffic.damaged <= craft.refused + craft.missed


def _record(sim):
    f, w = sim.flight, sim.world
    return sim.record(w.craft.state, w.wheels.speeds, w.station.state, w.station.contact, f.station.contact,
                      f.base.reference, f.tracking.error, f.monitor.availability, f.balance.command, every=1 * s)


def _plot(log, name):
    elevation = "world.station.contact.elevation"
    log.plot(elevation, "error.sigma_BR", "speeds.Omega", "command.u", units={elevation: "deg"},
             titles=["(a) elevation over the station", "(b) attitude error", "(c) wheel speeds", "(d) wheel torques"],
             name=name, title="An Earth imager hands over to a ground station")


def _points(sim, log, disturbed=0):
    """b1 by the truth: on the centre of the Earth, or on the station while that sees the spacecraft."""
    r, b1 = log["craft.state.r_BN_N"], mrp_to_dcm(log["craft.state.sigma_BN"])[:, 0]
    visible = log["world.station.contact.visible"] == 1
    assert visible.any(), "the station never saw the spacecraft"
    assert (visible != (log["flight.station.contact.visible"] == 1)).sum() < 3, "flight expects another pass"
    off = _angle(b1, np.where(visible[:, None], log["world.station.state.r_PN_N"] - r, -r))

    # A handover ends after SETTLE, as the acquisition does, and what disturbs it.
    changes = [0, disturbed, *log.time[1:][np.diff(visible.astype(int)) != 0]]
    settled = np.all([(log.time < t) | (log.time > t + SETTLE) for t in changes], axis=0)
    assert off[settled].max() < 2e-3, f"the camera is {off[settled].max():.2g} rad off"


def _angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
