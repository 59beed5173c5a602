# SPDX-License-Identifier: Apache-2.0
"""All units at work."""
from fledge.units import K, minute, s


def all_units(sim):
    """The body settles, the cards are kept warm, and the burns that the ground asks for all arrive."""
    f, w = sim.flight, sim.world
    log = sim.record(f.tracking.error, f.avionics.direction, f.avionics.volts, f.avionics.power, f.avionics.burn,
                     f.avionics.mode, w.craft.state, w.units.reply, w.units.cards, w.units.bus, every=0.5 * s)
    sim.run(11 * minute)
    f.avionics.cold = 295 * K
    sim.run(4 * minute)

    from fledge.attitude import mrp_to_dcm
    from numpy.linalg import norm

    assert log.last("tracking.error.sigma_BR").norm() < 1e-4, "the attitude did not settle"
    truth = mrp_to_dcm(log.last("craft.state.sigma_BN")) @ w.units.s_N
    assert norm(log.last("direction.s_B") - truth) < 2e-3, "the Sun is not where flight sees it"

    burns = log["burn.number"]
    assert burns[-1] == w.units.burns > 70, f"{w.units.burns} of {burns[-1]} burns arrived"
    fired = [log["burn.duration"][log["burn.thruster"] == k].sum() for k in range(12)]
    assert norm(fired - w.units.burnt) < 1e-9, "a burn had another length, or another thruster"
    assert log["mode.mode"][-1] == 2 and burns[log.time < 300].max() == 0, "the mode is not the one asked for"
    assert burns[log.time > 605].min() == burns[-1], "it burns although the recorder is half full"

    # The last command may be on its way.
    switched, arrived = log["power.number"][-1], w.units.commands
    assert 4 < switched <= arrived + 1 <= switched + 1, f"{arrived} of {switched} commands arrived"
    late = log.time > 300
    assert log["cards.temperature"][late].min() > 289, "a card is cold"
    assert log["cards.temperature"][-1].min() > 294, "the cards are not as warm as was commanded"
    assert log["bus.volts"].max() < 28 and log["bus.volts"].min() > 25, "the bus has another load"
