# SPDX-License-Identifier: Apache-2.0
"""Modes, events, commands and resets as data, and messages that were never written: in records, plots and pages."""

import json
import re
import shutil
import textwrap
from pathlib import Path

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.archive.compare import digest
from fledge.errors import SetupError
from fledge.records.activity import happenings, modes
from fledge.units import minute, s

ROOT = Path(__file__).resolve().parents[3]
FLIGHT = '''
    nav = f.task("nav", every=0.5 * s, run=[f.guidance, f.spin, f.tracking])
    act = f.task("act", every=0.5 * s, run=[f.control, f.motor])
    f.fine = fsw.TrackingError()
    f.connect(f.spin.reference >> f.fine.reference)
    fine = f.task("fine", every=1 * s, run=[f.fine])
    f.mode("coast", [])
    f.mode("point", [act])
    f.mode("science", [act, fine])
    error = f.watch(f.tracking.error)
    f.event("start", when=error.head.t > 60 * s, enter=f.point, once=True)
    f.event("lost", when=error.sigma_BR.norm() > 0.99, enter=f.coast)
'''
SCENARIOS = '''
from fledge.units import minute, s


def coasting(sim):
    """From rest to pointing."""
    f = sim.flight
    log = sim.record(f.tracking.error, f.motor.command, f.fine.error, every=1 * s)
    sim.run(3 * minute)
    log.plot("tracking.error.sigma_BR", "command.u", "fine.error.sigma_BR", name="modes")
'''
DISPERSIONS = '''
from fledge.units import minute


def any_attitude(d):
    """Requirements on what exists, and on what does not."""
    d["world.craft.sigma_BN"] = d.attitude()
    d.duration = 3 * minute
    d.check(d.retain("flight.tracking.error.sigma_BR").norm().final < 2)
    d.check(d.retain("flight.mode").final == "point", "it does not point")
    d.check(d.retain("flight.fine.error.sigma_BR").norm().final < 0.05, "it is not exact")
    d.check(d.retain("flight.fine.error.sigma_BR", raw=True).norm().final < 0.05)
'''


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with nadir_spin, which begins at rest, points after a minute, and never comes to its third mode."""
    folder = tmp_path / "missions" / "modal"
    shutil.copytree(ROOT / "missions" / "nadir_spin", folder,
                    ignore=shutil.ignore_patterns("*_test.py", "__pycache__", "requirements.py"))
    flight, world = folder / "flight.py", folder / "world.py"
    flight.write_text(flight.read_text().partition('    f.task("gnc"')[0] + FLIGHT)
    world.write_text(world.read_text().replace("f.tracking.attitude,", "[f.tracking.attitude, f.fine.attitude],"))
    (folder / "scenarios.py").write_text(SCENARIOS)
    (folder / "dispersions.py").write_text(DISPERSIONS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_record_says_which_modes_began_and_which_events_fired(here, capsys):
    assert cli.main(["run", "modal", "--report"]) == 0
    assert "modes    flight: coast at 0 s; point at 61 s; never science\n" in capsys.readouterr().out
    folder = here / "runs" / "modal" / "coasting"
    archive = fledge.Archive(folder / "run.mcap")
    assert modes(archive) == {"flight": [(0.0, "coast"), (61.0, "point")]}
    assert [tuple(happening) for happening in happenings(archive) if happening.kind == "event"] == [
        (60.5, "flight", "event", "start", "flight.tracking.error.head.t > 60000000000 ns")]
    assert archive["flight.mode.name"].tolist() == ["coast", "point"]
    assert archive["flight.activity"].dtype.names[:3] == ("head", "kind", "index")
    flight = json.loads((folder / "summary.json").read_text())["processes"]["flight"]
    assert flight["mode"] == "point" and flight["events"]["start"] == {
        "fired": 1, "first": 60.5, "when": "flight.tracking.error.head.t > 60000000000 ns"}
    assert flight["modes"] == {"coast": {"entered": 1, "first": 0.0}, "point": {"entered": 1, "first": 61.0},
                               "science": {"entered": 0, "first": None}}
    page = (folder / "report.html").read_text()
    assert "What happened" in page and "none was ever\nwritten" in page
    # The hash is over flight's outputs alone.
    assert digest(archive, archive.topics) == digest(archive, [t for t in archive.topics if t.count("/") > 2])


def test_a_message_that_was_never_written_has_no_value(here):
    sim = fledge.load("modal")
    f = sim.flight
    log = sim.record(f.motor.command, f.fine.error, f.tracking.error, every=1 * s)
    sim.run(3 * minute)
    assert np.isnan(log.last("fine.error.sigma_BR").norm()) and (log.raw.last("fine.error.sigma_BR") == 0).all()
    assert np.isnan(log["command.u"][:61]).all() and np.isfinite(log["command.u"][61:]).all()
    frame = log.frame("command")
    assert frame["command.u[0]"].isna().sum() == 61 == (frame["command.quality"] == "none").sum()
    figure = log.plot("command.u", "fine.error.sigma_BR")
    assert [text.get_text() for axis in figure.axes for text in axis.texts] == ["coast", "point", "never written"]
    scene = fledge.scene.of(log, plots_only=True)
    signal = {plot.name: plot.signal.thinned() for plot in scene.plots}["flight.motor.command.u"]
    assert np.isnan(signal.at(np.array([0.0, 60.9]))).all() and np.isfinite(signal.at(np.array([61.0, 180]))).all()
    assert scene.modes == {"flight": [(0.0, "coast"), (61.0, "point")]}
    assert sim.activity["flight.mode.name"].tolist() == ["coast", "point"]


@pytest.mark.long("flies a campaign")
def test_a_campaign_judges_no_missing_data(here, capsys):
    result = fledge.montecarlo.Campaign("modal").fly(30, seed=1)
    d = result.campaign.dispersions
    held = [int(result.reached(requirement)[2].sum()) for requirement in d.requirements]
    assert held[0] == held[3] == 30 and held[2] == 0 and 0 < held[1] < 30
    assert "it is not exact: norm(flight.fine.error.sigma_BR) at the end < 0.05 cannot be judged: flight.fine.error " \
        "was never written at the end" in result.failures[0]
    # The same run by hand has the same modes.
    first = result.entered("flight.mode.point")
    assert np.isnan(result.entered("flight.mode.science")).all() and (result.entered("flight.mode.coast") == 0).all()
    for run in (0, 7):
        sim = result.campaign.simulation(run, seed=1)
        sim.run(3 * minute)
        assert sim.flight.entered["point"][1] == first[run]
    assert cli.main(["montecarlo", "modal", "--runs", "30", "--seed", "1"]) == 1
    out = capsys.readouterr().out
    assert "flight.mode.science  begun in 0 of 30" in out and "no good data in 30" in out
    summary = json.loads((here / "runs/modal/montecarlo/any_attitude/summary.json").read_text())
    assert [mode["runs"] for mode in summary["modes"]] == [30, 30, 0]
    assert "flight.mode.science [s]" in (here / "runs/modal/montecarlo/any_attitude/runs.csv").read_text()


def test_a_requirement_on_modes_alone_has_no_margin_in_a_campaign_and_modes_that_are_sampled_begin_once(here, capsys):
    (here / "missions/modal/dispersions.py").write_text(textwrap.dedent('''
        from fledge.requirements import always, eventually
        from fledge.units import minute, s

        def any_attitude(d):
            """What modes alone decide."""
            d["world.craft.sigma_BN"] = d.attitude()
            d.duration, d.every = 2 * minute, 1 * s
            mode = d.retain("flight.mode") and d.signal("flight.mode")
            d.check(eventually(mode == "point"), "it points")
            d.check(always(mode == "coast"), "it stays")
    '''))
    assert cli.main(["montecarlo", "modal", "--runs", "3"]) == 1
    out = capsys.readouterr().out
    assert "3 of 3\n" in out and "0 of 3\n" in out and "worst" not in out and "inf" not in out
    assert "it stays: always flight.mode == coast is violated at 61 s\n" in out
    assert re.search(r"flight\.mode +(- +)?point( +point)*\n", out)
    folder = here / "runs/modal/montecarlo/any_attitude"
    json.loads((folder / "summary.json").read_text(), parse_constant=pytest.fail)
    assert cli.main(["montecarlo", "modal", "--only", "0"]) == 1
    assert "FAILS    always flight.mode == coast: at 61 s\n" in capsys.readouterr().out
    archive = fledge.Archive(folder / "0/run.mcap")
    assert archive.time("flight.mode").tolist() == [0, 61]      # the file has no samples besides
    assert modes(archive) == {"flight": [(0.0, "coast"), (61.0, "point")]}


def test_requirements_on_degraded_data_alone_are_not_fulfilled(here):
    (here / "missions/modal/dispersions.py").write_text(textwrap.dedent('''
        from fledge.units import s

        def blind(d):
            """The attitude that flight reads is as old as the run."""
            d["world.craft.sigma_BN"] = d.attitude()
            d.duration = 20 * s
            d.check(d.retain("flight.tracking.error.sigma_BR").norm().after(5 * s) < 10)
    '''))
    world = here / "missions/modal/world.py"
    world.write_text(world.read_text() +
                     '    f.feed(f.tracking.attitude, time=[0], sigma_BN=[[0, 0, 0]], stale_after=1 * s)\n')
    world.write_text(world.read_text().replace("[f.tracking.attitude, f.fine.attitude],", "f.fine.attitude,").replace(
        "from fledge.units import", "from fledge.units import s,"))
    result = fledge.montecarlo.Campaign("modal").fly(3)
    assert not result.passed.any()
    assert "cannot be judged: flight.tracking.error was never good after 5 s" in result.failures[0]


def test_commands_and_their_answers_are_recorded(here):
    sim = fledge.load("modal")
    f = sim.flight
    sim.run(5 * s)
    f.commands.mode("science")
    sim.run(5 * s)
    f.commands.send(f.commands.packets.mode("point")[:-1] + b"\0")
    sim.run(5 * s)
    commands = [(happening.name, happening.text)
                for happening in happenings(sim.activity) if happening.kind == "command"]
    assert commands[:2] == [("mode, sequence 0", "accepted"), ("mode, sequence 0", "executed")]
    assert len(commands) == 3 and "refused at its arrival: checksum" in commands[2][1]
    assert [name for _, name in modes(sim.activity)["flight"]] == ["coast", "science"]


@pytest.mark.parametrize("path, why", [
    ("world.mode", "the process world has no modes"), ("flight.mood", "expected process.instance.name"),
    ("fligh.mode", "expected process.instance.name")])
def test_paths_of_modes(here, path, why):
    from fledge.montecarlo.dispersions import Dispersions

    d = Dispersions(fledge.load("modal"))
    with pytest.raises(SetupError, match=why):
        d.retain(path)
    with pytest.raises(SetupError, match="flight.mode is no parameter"):
        d["flight.mode"] = d.choice("point", "coast")
    with pytest.raises(SetupError, match="science"):
        d.retain("flight.mode").final == "scince"
