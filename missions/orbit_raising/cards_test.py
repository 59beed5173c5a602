# SPDX-License-Identifier: Apache-2.0
"""The same burns through two propulsion cards behind a power unit: the thrusters' pulses and the engine's burns are the
same bits; a card that is lost and valves that are stuck are seen."""

from pathlib import Path

import pytest

import fledge
from fledge.units import ms, s

HERE = Path(__file__).parent
FLIGHT = '''
    f.pulses = fsw.PropulsionManager(n=8, armed=1, persistence=1 * s, silent_after=1 * s)
    f.long   = fsw.PropulsionManager(n=1, armed=1, persistence=1 * s, silent_after=1 * s)
    f.connect(f.firing.times >> f.pulses.times, f.burn.engines >> f.long.times)
    f.task("engine_card", every=100 * ms, run=[f.long])
    f.task("thruster_card", every=250 * ms, run=[f.pulses])
'''
WORLD = '''
    w.power    = world.PowerUnit(n=17, on=0x10001, volts=30, load=[10] * 17, count_current=1e-3, count_volts=1e-3)
    w.rcs_card = world.PropulsionCard(n=8, load=0, min_on=20 * ms)
    w.dv_card  = world.PropulsionCard(n=1, load=16)
    w.connect(w.power.supply >> [w.rcs_card.power, w.dv_card.power],
              f.pulses.command >> w.rcs_card.command, w.rcs_card.thrusters >> w.rcs.times,
              w.rcs.output >> w.rcs_card.thrust, w.rcs_card.state >> f.pulses.card,
              f.long.command >> w.dv_card.command, w.dv_card.thrusters >> w.engine.times,
              w.engine.output >> w.dv_card.thrust, w.dv_card.state >> f.long.card)
'''
WIRES = ("        f.burn.engines   >> w.engine.times,\n", "        f.firing.times   >> w.rcs.times,\n")
TASK = "run=[w.craft, "


AVOID = "    f.connect(f.pulses.availability >> f.mapping.availability)\n"


def build(folder, more=""):
    text = (HERE / "world.py").read_text()
    for old, new in (*((wire, "") for wire in WIRES), (TASK, "run=[w.power, w.rcs_card, w.dv_card, w.craft, "),
                     ("    w.integrator", WORLD + "    w.integrator")):
        assert old in text
        text = text.replace(old, new)
    folder.mkdir()
    (folder / "world.py").write_text(text)
    (folder / "flight.py").write_text((HERE / "flight.py").read_text() + FLIGHT + more)
    return fledge.load(folder)


@pytest.fixture
def through_cards(tmp_path):
    return build(tmp_path / "by_cards")


def test_through_two_cards_it_flies_the_same_bits(through_cards):
    cards, direct = through_cards, fledge.load("orbit_raising")
    logs = [sim.record(sim.world.craft.state, sim.world.engine.output, sim.world.rcs.output, sim.flight.burn.state,
                       every=10 * s) for sim in (cards, direct)]
    for sim in (cards, direct):
        sim.run(1500 * s)
    for field in ("state.r_BN_N", "state.sigma_BN", "engine.output.impulse", "rcs.output.impulse", "burn.state.gained"):
        assert (logs[0][field] == logs[1][field]).all(), field
    w, f = cards.world, cards.flight
    assert w.engine.output.impulse[0] > 9000 and f.plan.state.phase.name == "WAITS", "the first burn is over"
    assert w.rcs_card.state.begun > 500 and w.rcs_card.state.refused == w.dv_card.state.refused == 0
    assert w.dv_card.state.begun == 1
    assert 0 <= f.pulses.command.number - w.rcs_card.state.number <= 1 and w.rcs_card.state.number > 500
    for health in (f.pulses.health, f.long.health):
        assert health.stuck_open == health.stuck_shut == health.silent == health.disarmed == 0


def test_stuck_valves_are_named(through_cards):
    sim = through_cards
    sim.world.engine.faults = [{"kind": "DEAD", "begin": 1250 * s}]
    sim.world.rcs.faults = [{"kind": "HIGH", "channels": 1 << 5, "begin": 1250 * s}]
    sim.run(1250 * s)
    assert sim.flight.long.health.stuck_shut == 0 and sim.world.dv_card.state.driven[0] > 0
    sim.run(3 * s)
    assert sim.flight.long.health.stuck_shut == 1 and sim.flight.pulses.health.stuck_open == 1 << 5
    assert sim.flight.long.health.stuck_open == sim.flight.pulses.health.stuck_shut == 0


def test_a_lost_card_shuts_the_engine_and_is_named(through_cards):
    sim = through_cards
    sim.world.power.faults = [{"kind": "DEAD", "channels": 1 << 2, "begin": 1251 * s}]    # the switch card of load 16
    sim.run(1250 * s)
    assert sim.world.engine.output.thrust[0] == 100
    sim.run(3 * s)
    assert sim.world.engine.output.thrust[0] == 0
    assert sim.flight.long.health.silent == sim.flight.long.health.disarmed == 1
    assert sim.flight.pulses.health.silent == 0


def test_the_attitude_is_held_without_the_thruster_that_is_stuck_shut(tmp_path, through_cards):
    aware = build(tmp_path / "aware", AVOID)
    errors = []
    for sim in (through_cards, aware):
        sim.world.rcs.faults = [{"kind": "DEAD", "channels": 1 << 5, "begin": 100 * s}]
        sim.run(250 * s)
        assert sim.flight.pulses.health.stuck_shut == 1 << 5
        log = sim.record(sim.flight.mapping.forces, sim.flight.tracking.error, every=250 * ms)
        sim.run(1250 * s)    # into the first burn
        errors.append(abs(log["error.sigma_BR"]).max())
        assert sim.flight.mapping.forces.head.quality.name == "GOOD", "seven thrusters give every torque"
    assert (log["forces.F"][:, 5] == 0).all() and (log["forces.F"].max(axis=0)[[0, 1, 2, 3, 4, 6, 7]] > 0).all()
    assert errors[1] < 0.7 * errors[0]


def test_of_a_silent_card_no_thruster_is_used(tmp_path):
    sim = build(tmp_path / "aware", AVOID)
    sim.world.power.faults = [{"kind": "DEAD", "channels": 1 << 0, "begin": 50 * s}]    # the switch card of load 0
    sim.run(50 * s)
    assert max(sim.flight.mapping.forces.F) > 0 and sim.flight.mapping.forces.head.quality.name == "GOOD"
    sim.run(3 * s)
    assert max(sim.flight.mapping.forces.F) == 0 and sim.flight.mapping.forces.head.quality.name == "DEGRADED"
