# SPDX-License-Identifier: Apache-2.0
"""Modes that may not always be entered: commands, stored commands, rules, events and procedures that request them, on
the desktop and on targets."""
import json

import pytest

import fledge
from fledge import export
from fledge.archive import Archive
from fledge.commands import Code, Dictionary, Reason, decoded, read_script
from fledge.errors import SetupError
from fledge.export.commands import dictionary
from fledge.export.packets import commands
from fledge.export.run_test import FLIGHT
from fledge.records.activity import happenings
from fledge.targets.job import Job
from fledge.targets.services_test import fly_everywhere, written
from fledge.units import s

ERROR = "    error = f.watch(f.tracking.error)\n"
NEAR = "if (flight.tracking.error.head.quality >= DEGRADED) & (norm(flight.tracking.error.sigma_BR) < 0.45)"
WAIT = '    f.mode("wait", ["turn it"])\n'
POINT = 'f.mode("point", ["turn it", "control"]'
GUARDED = FLIGHT.replace(ERROR, "").replace(WAIT, ERROR + WAIT).replace(
    POINT, f"{POINT}, when=(error.head.quality >= 2) & (error.sigma_BR.norm() < 0.45)").replace(
    'f.mode("rest", [])', 'f.mode("rest", [], after="point")') + '''
    f.protection = fsw.FaultProtection()
    f.stored     = fsw.StoredCommands()
    f.log        = fsw.EventLog(least=1)
    f.task("services", every=400 * ms, run=[f.protection, f.stored, f.log])
'''

PLAY = '''
from fledge.commands import Action
from fledge.units import ms, s


def requests(sim):
    """All ways to request a mode, in time and out of time."""
    c, p = sim.flight.commands, sim.flight.commands.packets
    c.preset(p.rule(0, "flight.stored.state.running", bits=0b10, hold=10**9, mode="rest"))
    c.telemetry()
    c.mode("rest")                          # before the first instant
    sim.run(5 * s)
    c.mode("rest")                          # not from "wait"
    c.mode("point")
    sim.run(4 * s)                          # the event "start" fires
    c.sequence(1, [(1 * s, p.mode("rest")), (30 * s, p.mode("point")), (60 * s, p.mode("rest"))])
    c.control(Action.START, 1)
    for _ in range(12):
        sim.run(20 * s)
        c.mode("point")
    c.mode("wait")
    c.mode("rest")                          # it is still in "point"
    sim.run(10 * s)
    c.reset()
    sim.run(20 * s)
'''


@pytest.fixture
def mission(tmp_path):
    return written(tmp_path / "guarded", GUARDED, PLAY)


@pytest.mark.long("builds and flies on all targets")
def test_a_mode_is_refused_alike_on_every_target(mission, tmp_path, capsys):
    out = tmp_path / "out"
    on = fly_everywhere(mission, "requests", out, capsys)
    sim = fledge.load(mission)
    given = sim.flight.commands
    assert given.take_packets() == []
    sim.scenarios["requests"]()
    desktop = [packet.packet for packet in given.take_packets()]
    for name in on:
        assert [timed.packet for timed in read_script((out / f"{name}.telemetry.txt").read_text())] == desktop, name
        with Archive(out / f"{name}.mcap") as record:
            assert [happening for happening in happenings(record)] == [
                happening for happening in happenings(sim.activity) if happening.process == "flight"], name
    assert Job(str(mission), "requests", folder=out).parts[0].reports(on[0]) == given.reports
    done = [(report.t / 1e9, report.rule, report.stored_on, report.reason) for report in given.reports
            if report.code == Code.MODE and report.executed]
    refused = [report[:3] for report in done if report[3] == Reason.GUARDED]
    assert refused == [(0.0, None, None), (5.1, None, None), (5.1, None, None), (10.1, None, 1), (10.3, 0, None),
                       (29.1, None, None), (39.1, None, 1), (69.1, None, 1)]
    assert len(done) == 21 and given.counters.reasons[Reason.GUARDED] == len(refused)
    telemetry = [decoded(given.dictionary, packet) for packet in desktop]
    assert [str(message.content) for message in telemetry if message.path == "events"] == [
        "flight.stored: STARTED list 1", "flight.protection: GUARDED rule 0, mode 2", "flight.stored: ENDED list 1"]
    happened = [(happening.t, happening.kind, happening.name, happening.text.endswith("; its mode was refused"))
                for happening in happenings(sim.activity) if happening.kind in ("event", "mode")]
    assert happened == [
        (0.0, "mode", "wait", False), (0.7, "event", "late", False), (8.5, "event", "start", True),
        (49.1, "mode", "point", False), (61.2, "event", "wide", False), (61.3, "mode", "wait", False),
        (69.1, "mode", "point", False), (249.1, "mode", "rest", False), (259.1, "mode", "wait", False),
        (259.6, "event", "late", False), (267.1, "event", "start", True)]


def test_the_ground_knows_when_a_mode_is_entered(mission):
    sim = fledge.load(mission)
    facts = dictionary(export.read(sim))
    assert facts.guards == sim.flight.commands.dictionary.guards == {"point": NEAR, "rest": "after point"}
    assert json.loads(facts.text())["guards"] == facts.guards
    assert Dictionary.read(facts.text(), "").guards == facts.guards
    about = next(command for command in commands(export.read(sim), facts) if command.path == "flight.mode").about
    assert about.endswith(f"; point is entered only {NEAR}; rest is entered only after point")
    assert "rest: no task of its own; only after point" in repr(sim.flight)


def test_by_hand_a_mode_is_refused_with_its_condition(mission):
    sim = fledge.load(mission)
    with pytest.raises(SetupError, match="mode flight.rest may be entered only after point, which is not so before the "
                       "run in the mode wait"):
        sim.flight.rest.enter()
    sim.run(5 * s)
    with pytest.raises(SetupError, match="mode flight.point may be entered only if .* at 5 s in the mode wait"):
        sim.flight.enter("point")
    sim.run(100 * s)
    sim.flight.enter("point")
    sim.run(1 * s)
    assert sim.mode == "point"


@pytest.mark.parametrize("old, new, says", [
    ('after="point"', 'after="pint"', "mode flight.rest is entered after pint; the modes of flight are wait, point and "
     "rest"),
    ('after="point"', "when=3", "mode flight.rest: when takes a condition, as in watch"),
    ("f.mode(\"rest\"", "f.spin.rest = 3; f.mode(\"rest\"", "rest")])
def test_what_is_no_condition_is_refused(tmp_path, old, new, says):
    assert old in GUARDED
    with pytest.raises(SetupError, match=says):
        fledge.load(written(tmp_path / "wrong", GUARDED.replace(old, new), PLAY)).run(0)


def test_a_mode_that_looks_into_another_process_is_not_exported(mission):
    sim = fledge.load(mission)
    sim.flight.mode("far", [], when=sim.flight.watch(sim.world.nav.attitude).sigma_BN.norm() < 1)
    with pytest.raises(SetupError, match="mode flight.far looks at world.nav: flight cannot see into other processes"):
        export.read(sim)
