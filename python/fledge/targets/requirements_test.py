# SPDX-License-Identifier: Apache-2.0
"""Requirements that flight judges, on the desktop and on targets: the judge's margins, events, and rules on them."""
import pytest

import fledge
from fledge.commands import decoded, read_script
from fledge.export.run_test import FLIGHT
from fledge.requirements import Requirements
from fledge.requirements.onboard_test import as_output
from fledge.targets.services_test import fly_everywhere, written
from fledge.units import ms

JUDGED = FLIGHT + '''
    f.judge      = fsw.RequirementMonitor()
    f.protection = fsw.FaultProtection()
    f.log        = fsw.EventLog(least=1)
    f.task("services", every=400 * ms, run=[f.judge, f.protection, f.log])
'''

REQUIREMENTS = '''
from fledge.requirements import after, always, angle, implies, settles, turned, within
from fledge.units import ms, s


def all_kinds(r):
    r.every = 400 * ms
    error = r.signal("flight.tracking.error.sigma_BR")
    point = r.mode() == "point"
    r.require("J-1", "A mode and an angle.", always(implies(
        point, angle(turned(error, [1, 0, 0]), [0.6, 0.8, 0]) > 0.2)))
    r.require("J-2", "Windows, one in the other.", always(within(4 * s, always(error.norm() < 0.9, 0 * s, 2 * s))))
    r.require("J-3", "The end.", settles(r.signal("flight.motor.command.u").max_abs() < 0.25, within=6 * s))
    r.require("J-4", "What is violated, for the rule.", always(~after(20 * s) | (error.norm() < 0.01)),
              shown_by="violates")
'''

PRESET = '''
from fledge.requirements import fly


def preset(sim):
    fly(sim, "J-1", "J-2", "J-3", "J-4")
    c, p = sim.flight.commands, sim.flight.commands.packets
    c.preset(p.rule(0, "flight.judge.state.violated", bits=0b1000, mode="rest", limit=1))
'''

PLAY = '''
from fledge.units import s


def judges(sim):
    sim.flight.commands.telemetry()
    sim.run(30 * s)


def violates(sim):
    sim.run(30 * s)
'''


@pytest.fixture
def mission(tmp_path):
    folder = written(tmp_path / "judged", JUDGED, PLAY)
    (folder / "requirements.py").write_text(REQUIREMENTS)
    (folder / "preset.py").write_text(PRESET)
    return folder


def test_a_rule_acts_on_a_violation_and_the_event_says_it(mission):
    sim = fledge.load(mission)
    judged = Requirements(sim).watch()
    assert sim.flight.commands.take_packets() == []
    sim.flight.commands.telemetry()
    state, wanted, modes = sim.flight.judge.state, [], {}
    for _ in range(75):
        sim.run(400 * ms)
        for i, known in enumerate(wanted):
            if i != 2:      # flight knows it before the end
                assert (state.low[i], state.high[i]) == known, i
        wanted = [(as_output(outcome.low), as_output(outcome.high)) for outcome in judged.outcomes(so_far=True)]
        modes[sim.time_ns // 10**6] = sim.mode
    assert state.violated == 0b1000 and state.on == 0b1111 and -2 < state.high[3] < 0
    assert 0 < wanted[0][1] < 1.1 and 0 < wanted[1][1] < 1
    assert min(t for t, mode in modes.items() if mode == "rest") == 20_400     # when the sample at 20 s is judged
    events = [decoded(sim.flight.commands.dictionary, each.packet).content
              for each in sim.flight.commands.take_packets()
              if decoded(sim.flight.commands.dictionary, each.packet).path == "events"]
    violated = [event for event in events if event.output == "flight.judge.event"]
    assert [(event.name, event.severity, event.arguments["requirement"], event.arguments["sampled"])
            for event in violated] == [("VIOLATED", "medium", 3, 20.0)]
    assert violated[0].arguments["margin"] == state.high[3]


@pytest.mark.long("builds and flies on all targets")
def test_requirements_are_judged_alike_on_every_target(mission, tmp_path, capsys):
    out = tmp_path / "out"
    on = fly_everywhere(mission, "judges", out, capsys)
    sim = fledge.load(mission)
    commands = sim.flight.commands
    commands.take_packets()
    sim.scenarios["judges"]()
    desktop = [command.packet for command in commands.take_packets()]
    for name in on:
        assert [timed.packet for timed in read_script((out / f"{name}.telemetry.txt").read_text())] == desktop, name
    states = [content.content for content in (decoded(commands.dictionary, packet) for packet in desktop)
              if content.path == "flight.judge.state"]
    assert len(states) > 70 and states[-1]["violated"] == 0b1000 and sim.mode == "rest"
