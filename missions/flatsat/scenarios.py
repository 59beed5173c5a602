# SPDX-License-Identifier: Apache-2.0
"""All avionics at work, the three ways to a reset of the computer, and files that outlive it."""
from fledge import flight as fsw
from fledge.units import minute, s


def manoeuvre(sim):
    """A reset in the middle of a turn, a latch-up, and a fault of a converter: flight recovers from each."""
    f, w = sim.flight, sim.world
    log = sim.record(f.tracking.error, f.boot.boot, f.time.time, f.sun.heading, f.sun.status, f.filter.attitude,
                     f.stars.state, f.arrays.state, w.craft.state, w.power.telemetry, every=0.5 * s)
    sim.run(15 * minute)
    log.plot("error.sigma_BR", "error.omega_BR_B", "time.error", "boot.boots", columns=2, name="flatsat",
             title="A reset in the middle of a turn")

    from numpy import arcsin
    from numpy.linalg import norm

    assert log.last("error.sigma_BR").norm() < 1e-5, "the attitude did not settle"
    assert norm(log["error.sigma_BR"], axis=1)[log.time == 63.5] > 0.05, "the reset did not come within the turn"
    assert _sun_off(sim, log)[log.time > 70].max() < 0.03, "the Sun is not where flight sees it"
    before, after = log.time < 360, log.time > 366
    assert not log["status.faulty"][before].any() and (log["status.faulty"][after] == 1).all(), \
        "converter A is faulty from 6 minutes on, and flight finds that, and nothing else"

    card = w.power.telemetry.cards[0]
    assert card.trips == 1 and card.tripped == 0 and card.on == 0b111, "the latch-up did not end"
    late = (log.time > 195) & (log.time < 360)
    on = log["telemetry.cards.on"][:, 0]
    assert (on[late] == 0b111).all() and not (on[log.time == 185] & 0b010).any()
    _is_back(sim, log, boots=2)

    # Star tracker and gyros are behind the load that the latch-up trips: the filter reports that it is blind, and is
    # back within 3 s.
    up = (log.time < 60.5) | (log.time >= 63.5)         # the computer
    good = (log["attitude.head.quality"] == fsw.Quality.GOOD) & up
    assert _attitude_off(log)[good].max() < 5e-4, "the filter's attitude is not that of the truth"
    silent = (log.time >= 181) & (log.time < 190)
    assert not good[silent].any() and not log["stars.state.tracks"][(log.time > 183) & (log.time < 190)].any()
    assert good[(log.time > 2) & (log.time < 60.5) | (log.time > 66) & (log.time < 180) | (log.time > 193)].all()

    # The arrays follow the Sun, as near as their axis, b2, lets them, to the dead band and a step.
    nearest = arcsin(abs(log["heading.s_B"][:, 1:2]))
    assert (log["arrays.state.off"][:, :2] - nearest)[log.time > 300].max() < 0.025, "the arrays are off the Sun"
    assert not log["arrays.state.stuck"].any() and abs(w.drive.angles.theta[0]) > 0.2

    # Each burn has its time, also that at 62 s, when the computer is down: the card has it already.
    times = w.card.thrusters
    assert [x / 1e9 for x in times.on[:4]] == [30, 62, 91, 120], "a burn began at another time"
    assert [(b - a) / 1e9 for a, b in zip(times.on[:4], times.off[:4])] == [0.25, 1, 0.3, 2]
    assert list(times.burns[:4]) == [1, 1, 2, 1] and w.card.state.refused == 0


def commanded(sim):
    """The ground has the power unit reset the computer: once, for the parameter is then as it was built."""
    f, w = sim.flight, sim.world
    log = sim.record(f.tracking.error, f.boot.boot, f.time.time, f.power.command, every=0.5 * s)
    sim.run(3 * minute)
    f.power.reset_computer = 1
    sim.run(5 * minute)
    requested = log["command.reset"] == 1
    assert requested.any() and not requested[log.time > 184].any(), "the parameter outlived the reset"
    assert log.last("error.sigma_BR").norm() < 2e-3, "the attitude did not settle"
    assert w.power.computer.count == 2
    _is_back(sim, log, boots=3)


def silent(sim):
    """Flight's heartbeat stops, and the power unit's watchdog resets the computer."""
    f, w = sim.flight, sim.world
    log = sim.record(f.tracking.error, f.boot.boot, f.time.time, f.power.command, every=0.5 * s)
    sim.run(2 * minute)
    f.power.silent = 1
    sim.run(3 * minute)
    beats = log["command.heartbeat"]
    assert len(set(beats[(log.time > 120) & (log.time < 126)])) == 1 and (beats[log.time > 140] > 0).all()
    assert w.power.computer.count == 2, "the watchdog did not bark, or more than once"
    _is_back(sim, log, boots=3)


def kept(sim):
    """A file that the ground sends before the reset is there after it: the recorder has kept it, although a page is
    worn out and bits have flipped meanwhile. One that has lost two bits of a word is dropped."""
    from pathlib import Path
    from random import Random
    from tempfile import TemporaryDirectory

    from fledge import ground

    f, w = sim.flight, sim.world
    with TemporaryDirectory() as folder, ground.connect(sim) as craft:
        plan, table, back = (Path(folder) / name for name in ("plan", "table", "back"))
        plan.write_bytes(Random(1).randbytes(1500))
        table.write_bytes(Random(2).randbytes(700))
        craft.listen(20 * s)
        craft.put(plan, to="plans", within=15 * s)
        craft.put(table, within=15 * s)
        while f.files.state.waiting:
            craft.listen(0.5 * s)
        assert sim.time < 60, "the recorder took too long"
        craft.listen((85 - sim.time) * s)
        assert f.files.state.waiting == 0 and f.files.state.dropped == w.recorder.state.damaged == 1
        assert craft.directory() == ["plans"] and w.recorder.state.corrected == 2 and w.recorder.state.worn == 1
        craft.fetch("plans", to=back, within=20 * s)
        assert back.read_bytes() == plan.read_bytes(), "the file is not what it was"
        craft.listen((120 - sim.time) * s)


def _is_back(sim, log, boots):
    """The start was counted in non-volatile memory, and the vehicle's time is that of the master, which goes on."""
    f, w = sim.flight, sim.world
    assert log["boot.boots"][-1] == boots == w.memory.memory[3][0], "the starts are not counted"
    assert w.memory.state.resets == boots - 1 and f.boot.boot.own == 0
    time, slave = w.clock.epoch + sim.time_ns, w.clock.reading.time.coarse * 10**9 + w.clock.reading.time.fine
    assert abs(f.time.time.time - time) < 50_000 and abs(slave - time) < 50_000, "the time is wrong"
    assert f.time.time.synchronized and f.time.time.jams == 1
    # Within three pulses of the start of flight.
    down = log["time.synchronized"] == 0
    assert down[log.time == 63.5] and not down[(log.time > 67) & (log.time < 120)].any()


def _attitude_off(log):
    """The angle between the filter's attitude and the true one [rad], at each sample."""
    from fledge.attitude import mrp_to_dcm
    from numpy import arcsin, einsum, eye, linalg

    turn = einsum("nij,nkj->nik", mrp_to_dcm(log["attitude.sigma_BN"]), mrp_to_dcm(log["state.sigma_BN"]))
    return 2 * arcsin((linalg.norm(turn - eye(3), axis=(1, 2)) / 8**0.5).clip(0, 1))


def _sun_off(sim, log):
    """The angle between the Sun and where flight sees it [rad], at each sample."""
    from fledge.attitude import mrp_to_dcm
    from numpy import array, einsum, linalg

    s_N = array(sim.world.css.s_N)
    s_B = einsum("nij,j->ni", mrp_to_dcm(log["state.sigma_BN"]), s_N / linalg.norm(s_N))
    return linalg.norm(log["heading.s_B"] - s_B, axis=1)
