# SPDX-License-Identifier: Apache-2.0
"""Requirements of a small mission, judged while it flies and from its record; formulas as texts; errors."""
import math
import random

import numpy as np
import pytest

import fledge
from fledge import cli
from fledge.archive import Archive
from fledge.commands import SERVICES, Report, Stage, decoded
from fledge.errors import SetupError, Stopped
from fledge.export.run_test import FLIGHT, WORLD
from fledge.requirements import (Requirements, after, always, angle, before, begins, eventually, implies, never,
                                 settles, turned, until, within)
from fledge.requirements.declared import Declaration
from fledge.requirements.judge import Judged
from fledge.requirements.telemetered import SENDERS
from fledge.units import N, deg, m, minute, s

HEAD = '''
from fledge.requirements import *
from fledge.units import N, deg, m, minute, ms, s


def pointing(r):
    """Pointing."""
    error = r.signal("flight.tracking.error.sigma_BR")
'''


@pytest.fixture()
def mission(tmp_path, monkeypatch):
    """A copy of nadir_spin to which a test gives requirements."""
    import shutil

    shutil.copytree(fledge.mission.find("nadir_spin").folder, tmp_path / "plays")
    monkeypatch.chdir(tmp_path)

    def write(*lines):
        (tmp_path / "plays/requirements.py").write_text(HEAD + "".join(f"    {line}\n" for line in lines))
        return fledge.load("./plays")

    return write


def test_a_comparison_of_outputs_of_two_rates_is_reported_unless_it_is_sampled_where_both_are_new(mission, capsys):
    sim = mission('turn = r.signal("world.craft.state.omega_BN_B")[0]',
                  'found = r.signal("flight.tracking.error.omega_BR_B")[0]',
                  'r.require("S-1", "", always(turn - found < -1 * deg / s))',
                  'r.require("S-2", "", always((turn < -1 * deg / s) & (found < -1 * deg / s)))',
                  'r.every = 250 * ms', 'r.require("S-3", "", always(turn < found))',
                  'r.every = 1 * s', 'r.require("S-4", "", always(turn - found < -1 * deg / s))')
    expected = ("it joins flight.tracking.error, written every 0.5 s, with world.craft.state, every 0.1 s: at some "
                "samples the first is older; r.every = 0.5 * s takes those at which both are new")
    assert {requirement.id: requirement.skew for requirement in Requirements(sim).all} == {
        "S-1": expected, "S-2": "", "S-3": expected, "S-4": ""}
    assert cli.main(["run", "plays", "--no-plots"]) == 1
    assert f"\n           S-1: {expected}\n           S-2 violated" in capsys.readouterr().out


def test_verdicts_and_margins_are_those_of_the_record(mission):
    sim = mission('n = error.norm()',
                  'r.require("A-1", "", settles(n < 1e-3, within=20 * minute))',
                  'r.require("A-2", "", always(implies(after(10 * minute), n < 1e-5)))',
                  'r.require("A-3", "", eventually(n < 0.1, 30 * s, 60 * s))',
                  'r.require("A-4", "", always(within(50 * minute, n < 1e-4)))',
                  'r.require("A-5", "", method="analysis", evidence="x", rationale="because", parent="S")',
                  'r.every = 10 * s',
                  'r.require("A-6", "", never(error.max_abs() > 0.9), shown_by="spin")')
    required = Requirements(sim)
    watch = required.watch()
    log = sim.record(sim.flight.tracking.error)
    sim.run(40 * minute)
    live = {outcome.requirement.id: outcome for outcome in watch.outcomes()}
    time, norm = log.time, np.linalg.norm(log["error.sigma_BR"], axis=1)
    late = time >= 600
    # A closed form of each margin, by numpy.
    suffix = np.maximum.accumulate(norm[::-1])[::-1]
    assert live["A-1"].margin == pytest.approx(1e-3 - suffix[time <= 1200].min(), rel=1e-12)
    assert live["A-2"].margin == pytest.approx(1e-5 - norm[late].max(), rel=1e-12)
    assert live["A-3"].margin == pytest.approx(0.1 - norm[(time >= 30) & (time <= 60)].min(), rel=1e-12)
    assert live["A-6"].margin == pytest.approx(0.9 - abs(log["error.sigma_BR"][time % 10 == 0]).max(), rel=1e-12)
    assert {id: outcome.verdict for id, outcome in live.items()} == {
        "A-1": "holds", "A-2": "holds" if norm[late].max() < 1e-5 else "violated",
        "A-3": "holds" if norm[(time >= 30) & (time <= 60)].min() < 0.1 else "violated", "A-4": "holds",
        "A-6": "holds"}
    worst = live["A-2"]
    assert worst.at == time[late][norm[late].argmax()] and worst.where == "norm(flight.tracking.error.sigma_BR) < 1e-05"
    for outcome in required.judge(log, end=40 * minute):
        in_run = live[outcome.requirement.id]
        assert (outcome.verdict, outcome.low, outcome.high, outcome.at) == (
            in_run.verdict, in_run.low, in_run.high, in_run.at)
    assert required.of("A-5").parent == "S" and required.of("A-5").group == "Pointing"
    assert [requirement.id for requirement in required.for_scenario("other")] == ["A-1", "A-2", "A-3", "A-4"]


def test_a_file_of_the_run_says_the_same(mission, tmp_path):
    sim = mission('r.require("A-1", "", settles(error.norm() < 1e-3, within=20 * minute))')
    required = Requirements(sim)
    watch = required.watch(traces=True)
    sim.record(sim.flight.tracking.error)
    sim.archive(tmp_path / "run.mcap")
    sim.run(30 * minute)
    live = watch.outcomes()[0]
    sim.close_archive()
    with Archive(tmp_path / "run.mcap") as archive:
        judged = required.judged(archive, end=30 * minute, traces=True)
        assert judged.outcomes()[0].margin == live.margin
        comparison = live.requirement.formula.comparisons[0]
        for time, values in (judged.values(comparison), watch.values(comparison)):
            assert (values == np.linalg.norm(archive["error.sigma_BR"], axis=1)).all()
            assert (time == archive.series("error.sigma_BR").time).all()
    other = mission('r.require("A-1", "", always(r.signal("world.craft.state.omega_BN_B").norm() < 1 * deg / s))')
    with Archive(tmp_path / "run.mcap") as archive, pytest.raises(SetupError, match="was not recorded"):
        Requirements(other).judge(archive)


def plays(tmp_path):
    """A mission with modes and events."""
    (tmp_path / "plays").mkdir()
    (tmp_path / "plays/flight.py").write_text(FLIGHT)
    (tmp_path / "plays/world.py").write_text(WORLD)
    return fledge.load(tmp_path / "plays")


def test_modes_and_events(tmp_path):
    sim = plays(tmp_path)
    r = Declaration(sim)
    r.require("M-1", "", always(implies(after(r.event("flight", "start")), r.mode() != "wait")))
    r.require("M-2", "", eventually(r.mode() == "point"))
    for name in sim.flight.events:
        r.require(f"E-{name}", "", never(r.event("flight", name)))
    judged = Judged(list(r._found.values()), sim)
    judged.watch(False)
    log = sim.record(sim.flight.tracking.error)
    sim.run(100 * s)
    live = judged.outcomes()
    assert live[1].verdict == "holds" and live[1].margin == math.inf
    fired = [event.fired[0] for event in sim.flight.events.values()]
    assert any(fired) and not all(fired)
    assert [outcome.verdict for outcome in live[2:]] == ["violated" if n else "holds" for n in fired]
    again = Judged(list(r._found.values()))
    again.play(log, sim.time_ns)
    assert [outcome.verdict for outcome in again.outcomes()] == [outcome.verdict for outcome in live]
    with pytest.raises(SetupError, match="expected one of"):
        r.mode() == "NOWHERE"
    with pytest.raises(SetupError, match="has no event 'nothing'"):
        r.event("flight", "nothing")


def test_commands_are_seen_once_and_from_a_record_as_in_the_run(tmp_path):
    sim = plays(tmp_path)
    r = Declaration(sim)
    kinds = [("mode", "executed"), ("mode", "accepted"), ("mode", "refused"), ("noop", "executed"), ("", "executed"),
             ("write", "executed"), ("", "refused")]
    for i, (name, became) in enumerate(kinds):
        r.require(f"C-{i}", "", eventually(r.command("flight", name, became)))
    r.require("T-1", "", always(implies(r.command("flight", "mode"), within(1 * s, r.mode() == "rest"))))
    r.require("T-2", "", always(implies(r.command("flight", "mode"), within(1 * s, r.mode() == "point"))))
    judged = Judged(list(r._found.values()), sim, traces=True)
    judged.watch(False)
    log = sim.record(sim.flight.tracking.error)
    sim.run(7 * s)
    commands = sim.flight.commands
    commands.mode("rest")
    commands.send(commands.packets.noop())
    sim.run(9 * s)
    commands.send(commands.packets.mode("rest")[:-1] + b"\xff")        # there is no such mode
    sim.run(9 * s)
    live = judged.outcomes()
    assert [outcome.verdict == "holds" for outcome in live] == [True, True, True, True, True, False, True, True, False]
    times = [judged.values(outcome.requirement.formula.comparisons[0]) for outcome in live[:7]]
    found = [list(time[values > 0]) for time, values in times]
    executed = [report.t / 1e9 for report in commands.reports if report.executed and report.reason == 0]
    assert len(executed) == 2 and found[0] == found[3] == [executed[0]] and found[4] == sorted(set(executed))
    assert found[1][0] > 7 and found[2] == found[6] and found[2][0] > 16 and found[5] == []
    again = Judged(list(r._found.values()))
    again.play(log, sim.time_ns)
    assert [outcome.verdict for outcome in again.outcomes()] == [outcome.verdict for outcome in live]
    for bad, text in ((lambda: r.command("flight", "mod"), "there is no command 'mod'; did you mean 'mode'"),
                      (lambda: r.command("flight", "mode", "done"), "there is no such state 'done'.*executed"),
                      (lambda: r.command("world", "mode"), "world is no process of flight")):
        with pytest.raises(SetupError, match=text):
            bad()


def trusted(name):
    """Of an output, as the ground decodes it: the second number of a field, unless the message is not to be trusted."""
    return lambda content: math.nan if content["head"]["quality"] in ("NONE", "STALE") else content[name][1]


DECODED = {"flight.tracking.error.sigma_BR": trusted("sigma_BR"), "flight.control.torque.torque_B": trusted("torque_B"),
           "flight.tracking.error.head.sequence": lambda content: content["head"]["sequence"],
           "housekeeping.mode": lambda state: state["mode"], "housekeeping.t": lambda state: state["t"],
           "housekeeping.accepted": lambda state: state["accepted"], "reports.code": lambda report: report.code}


def telemetered(tmp_path):
    """(a mission, formulas on its packets and their numbers, what judges them)."""
    sim = plays(tmp_path)
    r = Declaration(sim)
    for name in ("housekeeping", "flight.tracking.error", "flight.control.torque", "reports"):
        r.require(name, "", eventually(r.packet("flight", name)))
    for path in DECODED:
        number = r.telemetry("flight", path)
        r.require(path, "", eventually(number == "rest" if path.endswith("mode") else
                                       (number[1] if number.shape else number) < 1e30))
    judged = Judged(list(r._found.values()), sim, traces=True)
    judged.watch(False)
    return sim, r, judged


def test_packets_and_their_numbers_are_what_the_ground_decodes(tmp_path):
    sim, _, judged = telemetered(tmp_path)
    commands = sim.flight.commands
    commands.take_packets()
    sim.run(3 * s)
    commands.telemetry("flight.tracking.error", every=3)
    commands.telemetry("housekeeping", every=7)
    sim.run(2 * s)
    commands.telemetry("flight.control.torque")
    commands.mode("rest")
    sim.run(6 * s)
    commands.mode("point")
    sim.run(4 * s)
    flown = commands.take_packets()
    packets = [(t, decoded(commands.dictionary, packet)) for t, packet in flown]
    live = judged.outcomes()
    assert {outcome.verdict for outcome in live} == {"holds"}
    for outcome in live:
        id, comparison = outcome.requirement.id, outcome.requirement.formula.comparisons[0]
        time, values = judged.values(comparison)
        of = [(t, packet.content) for t, packet in packets if id == packet.path or id.startswith(f"{packet.path}.")]
        assert len(of) > 3
        # The first sample that sees each: a command comes, and is accepted, after the instant that its report bears.
        at = np.searchsorted(np.rint(time * 1e9), [
            t + (isinstance(content, Report) and content.stage == Stage.ACCEPTED) for t, content in of])
        if id not in DECODED:
            assert list(np.flatnonzero(values)) == sorted(set(at)), id
            continue
        expected = np.full(len(time), math.nan)
        for k, (_, content) in zip(at, of):
            expected[k:] = DECODED[id](content)
        assert np.array_equal(values, expected, equal_nan=True) and len(set(expected)) > 2, id

    # The packets of a target that flew say the same; a run that begins anew knows nothing of the one before.
    played = fledge.load(tmp_path / "plays")
    played.flight.commands.play(flown)
    again = Judged([outcome.requirement for outcome in live], played)
    again.watch(False)
    played.run(15 * s)
    assert [(outcome.verdict, outcome.margin) for outcome in again.outcomes()] == [
        (outcome.verdict, outcome.margin) for outcome in live]
    sim.reset()
    sim.run(1 * s)
    found = judged.outcomes()
    assert [outcome.verdict for outcome in found] == ["violated"] * 4 + ["unknown"] * len(DECODED)
    assert "was never sent" in found[-1].reason


def test_a_packet_is_seen_at_the_instant_at_which_it_is_sent(tmp_path):
    sim, r, _ = telemetered(tmp_path)
    r.require("A-1", "", never(r.packet("flight", "flight.tracking.error")))
    judged = Judged([r._found["A-1"]], sim)
    judged.watch(True)
    sim.run(3 * s)
    sim.flight.commands.telemetry("flight.tracking.error", every=4)
    sim.flight.commands.take_packets()
    with pytest.raises(Stopped, match="A-1 violated, at 3.4 s, a packet flight.tracking.error is sent"):
        sim.run(9 * s)
    assert [packet.t for packet in sim.flight.commands.take_packets()][-1] == sim.time_ns == 3_400_000_000
    log = sim.record(sim.flight.tracking.error)
    with pytest.raises(SetupError, match="records have no packets"):
        Judged([r._found["A-1"]]).play(log, None)


def test_of_packets_that_are_not_known_here_nothing_is_known():
    sim = fledge.load("sun_gazer")      # it speaks frames
    sim.flight.commands.play([])
    r = Declaration(sim)
    r.require("A-1", "", never(r.packet("flight", "housekeeping")))
    judged = Judged(list(r._found.values()), sim)
    judged.watch(False)
    sim.run(1 * s)
    assert judged.outcomes()[0].verdict == "unknown"


@pytest.mark.parametrize("make, text", [
    (lambda r: r.packet("flight", "housekeping"), "sends no packet 'housekeping'; did you mean 'housekeeping'"),
    (lambda r: r.packet("flight", "flight.tracking.eror"), "did you mean 'flight.tracking.error'"),
    (lambda r: r.packet("world", "housekeeping"), "world is no process of flight"),
    (lambda r: r.telemetry("world", "housekeeping.mode"), "world is no process of flight"),
    (lambda r: r.telemetry("flight", "housekeeping.moda"), "has no number 'moda'; did you mean 'mode'"),
    (lambda r: r.telemetry("flight", "housekeping.mode"), "did you mean 'housekeeping'"),
    (lambda r: r.packet("flight", "events"), "no packet 'events'; it sends housekeeping, reports, flight.vehicle"),
    (lambda r: r.telemetry("flight", "flight.tracking.error"), "is a whole message; name one of its fields"),
    (lambda r: r.telemetry("flight", "flight.tracking.error.sigma_BN"), "has no 'sigma_BN'; did you mean 'sigma_BR'"),
    (lambda r: r.telemetry("flight", "flight.control.K"), "is no field of an output of flight"),
    (lambda r: r.telemetry("flight", "flight.mode"), "is no field of an output of flight"),
    (lambda r: r.telemetry("flight", "housekeeping.mode") == "rust", "did you mean 'rest'"),
    (lambda r: r.telemetry("flight", "flight.tracking.error.omega_BR_B")[0] < 1 * m, "expected a quantity in rad/s")])
def test_what_is_no_packet_or_number_of_one_is_refused(tmp_path, make, text):
    with pytest.raises(SetupError, match=text):
        make(Declaration(plays(tmp_path)))


def test_packets_of_services_are_those_of_their_modules():
    r = Declaration(fledge.load("flatsat"))
    assert "a packet files of flight is sent" == str(r.packet("flight", "files"))
    with pytest.raises(SetupError, match="a packet files has no numbers with a name"):
        r.telemetry("flight", "files.n")
    assert set(SENDERS) == set(SERVICES) and all(hasattr(fledge.flight, module) for module in SENDERS.values())


def test_a_run_stops_at_the_first_violation_and_may_go_on(mission):
    sim = mission('r.require("A-1", "", always(error.norm() > 0.1))')
    Requirements(sim).watch(stop=True)
    log = sim.record(sim.flight.tracking.error)
    with pytest.raises(Stopped, match="A-1 violated") as found:
        sim.run(30 * minute)
    norm = np.linalg.norm(log["error.sigma_BR"], axis=1)
    assert (norm[:-1] > 0.1).all() and norm[-1] <= 0.1 and found.value.outcomes[0].at == sim.time
    state = sim.snapshot()
    sim.run(1 * minute)
    sim.restore(state)


def test_a_run_that_begins_anew_is_judged_anew_and_one_that_goes_back_is_unknown(mission):
    sim = mission('r.require("A-1", "", always(error.norm() > 1e-9))')
    watch = Requirements(sim).watch()
    sim.run(1 * minute)
    first = watch.outcomes()[0]
    state = sim.snapshot()
    sim.run(1 * minute)
    sim.restore(state)
    sim.run(1 * s)
    assert watch.outcomes()[0].verdict == "unknown" and "went back" in watch.outcomes()[0].reason
    sim.reset()
    sim.run(1 * minute)
    assert watch.outcomes()[0].margin == first.margin


def test_what_was_never_written_is_unknown(mission):
    sim = mission('r.require("A-1", "", always(error.norm() < 9))',
                  'r.require("A-2", "", eventually(error.norm() < 9))')
    judged = Judged(list(Requirements(sim).all))
    bad = np.array([[math.nan] * 3, [0.1] * 3])
    judged.play_samples(np.array([0, 1]), [bad])
    unknown, holds = judged.outcomes()
    assert unknown.verdict == "unknown" and "never written" in unknown.reason and holds.verdict == "holds"
    judged.play_samples(np.array([0, 1]), [np.array([[math.nan] * 3, [9] * 3])])
    assert [outcome.verdict for outcome in judged.outcomes()] == ["violated", "unknown"]


def test_the_end_of_the_run_leaves_windows_unknown(mission):
    sim = mission('r.require("A-1", "", always(within(10 * s, error.norm() < 1e-9)))')
    judged = Judged(Requirements(sim).all)
    judged.play_samples(np.array([0, 5_000_000_000]), [np.ones((2, 3))])
    outcome = judged.outcomes()[0]
    assert outcome.verdict == "unknown" and "the run ends at 5 s" in outcome.reason


def test_a_window_beyond_the_end_is_the_reason_where_names_decide(mission):
    """What is false in a window that goes on has a value; beside what has none, that is the reason."""
    sim = mission('good = r.signal("flight.tracking.error.head.quality") == "GOOD"',
                  'r.require("A-1", "", always(implies(after(8 * s), within(10 * s, good))))',
                  'r.require("A-2", "", always(good | (error.norm() < 1)))')
    judged = Judged(Requirements(sim).all)
    fields = [source.fields[0].path for source in judged.sources]
    numbers = {"flight.tracking.error.head.quality": np.ones((4, 1)),
               "flight.tracking.error.sigma_BR": np.array([[0.1] * 3, [0.1] * 3, [math.nan] * 3, [0.1] * 3])}
    judged.play_samples(np.arange(4) * 5_000_000_000, [numbers[path] for path in fields])
    ahead, without = judged.outcomes()
    assert (ahead.verdict, ahead.reason) == ("unknown", "what decides it comes after the end of the run")
    assert without.verdict == "unknown" and "never written, or is stale, at 10 s" in without.reason


def test_expressions_are_those_of_numpy():
    """On random numbers: each operation against numpy, and attitudes against the library's own conversion."""
    from fledge.attitude import mrp_to_dcm

    sim = fledge.load("nadir_spin")
    r = Declaration(sim)
    sigma, omega = r.signal("world.craft.state.sigma_BN"), r.signal("flight.tracking.error.omega_BR_B")
    rate = r.signal("world.craft.state.omega_BN_B")
    made = [sigma[1], sigma.norm(), sigma.max_abs(), abs(sigma[0]), (omega - rate).norm(), (omega + 2 * rate)[2],
            angle(omega, rate), turned(sigma, omega)[0], angle(turned(sigma, omega), [0, 0, 1]),
            omega[0] - 3 * deg / s]
    wanted = [lambda a, b, c: a[1], lambda a, b, c: np.linalg.norm(a), lambda a, b, c: abs(a).max(),
              lambda a, b, c: abs(a[0]), lambda a, b, c: np.linalg.norm(b - c), lambda a, b, c: b[2] + 2 * c[2],
              lambda a, b, c: np.arccos(b @ c / np.linalg.norm(b) / np.linalg.norm(c)),
              lambda a, b, c: (mrp_to_dcm(a) @ b)[0],
              lambda a, b, c: np.arccos((mrp_to_dcm(a) @ b)[2] / np.linalg.norm(b)),
              lambda a, b, c: b[0] - np.radians(3)]
    for i, signal in enumerate(made):
        r.require(f"X-{i}", "", signal < 0 * (deg if signal.unit == "rad" else deg / s if signal.unit else 1))
    judged = Judged(list(r._found.values()))
    of = {"world.craft.state.sigma_BN": 0, "flight.tracking.error.omega_BR_B": 1, "world.craft.state.omega_BN_B": 2}
    random_ = np.random.default_rng(1)
    for _ in range(50):
        numbers = random_.normal(size=(3, 3))
        judged.play_samples(np.array([0]), [numbers[of[source.field.path]][None] for source in judged.sources])
        for outcome, f in zip(judged.outcomes(), wanted):
            assert -outcome.low == pytest.approx(f(*numbers), rel=1e-9, abs=1e-12)


def test_a_mixture_of_units_is_judged_by_fractions_of_the_limits(mission):
    sim = mission('rate = r.signal("flight.tracking.error.omega_BR_B").norm()',
                  'r.require("A-1", "", always((error.norm() < 2) & (rate < 10 * deg / s)))')
    judged = Judged(Requirements(sim).all)
    judged.play_samples(np.array([0]), [np.array([[1.0, 0, 0]]), np.array([[np.radians(8), 0, 0]])])
    outcome = judged.outcomes()[0]
    assert outcome.margin == pytest.approx(0.2) and outcome.unit == "" and outcome.margin_text == "20 % of the limit"
    assert "omega_BR_B" in outcome.where


def test_formulas_print_as_sentences_and_mathematics():
    r = Declaration(fledge.load("nadir_spin"))
    x = r.signal("flight.tracking.error.sigma_BR")[0] < 0.5
    w = r.signal("flight.tracking.error.omega_BR_B").norm() > 0.5 * deg / s
    a, b = "flight.tracking.error.sigma_BR[0] < 0.5", "norm(flight.tracking.error.omega_BR_B) > 0.5 deg/s"
    for formula, sentence, mathematics in [
            (always(implies(x, within(5 * minute, w))), f"always (if {a} then (within 5 min {b}))",
             f"□(({a}) → ◇[0,300]({b}))"),
            (until(x & w, ~x, within=10 * s), f"({a} and {b}) until within 10 s (not {a})",
             f"(({a}) ∧ ({b})) U[0,10] ¬({a})"),
            (never(x | w), f"never ({a} or {b})", f"□¬(({a}) ∨ ({b}))"),
            (settles(x, within=1 * s, lasting=2 * s), f"within 1 s {a}, and stays so for 2 s", f"◇[0,1]□[0,2]({a})"),
            (always(x, 1 * s, 2 * s) & eventually(w), f"(always from 1 s to 2 s later {a}) and (at some time {b})",
             f"□[1,2]({a}) ∧ ◇({b})"),
            (after(x) & after(3 * s) & before(9 * s), f"(({a} has held) and after 3 s) and (before 9 s)",
             f"(◆({a}) ∧ (t ≥ 3)) ∧ (t < 9)"),
            (begins(x), f"{a} begins", f"↑({a})")]:
        assert (str(formula), formula.mathematics) == (sentence, mathematics)
    assert settles(x, within=1 * s, lasting=2 * s).reach == 3_000_000_000
    with pytest.raises(TypeError, match="only known after a run"):
        bool(x)


@pytest.mark.parametrize("line, says", [
    ('r.require("A-1", "", error.norm() < 1 * m)', "expected a number without unit"),
    ('r.require("A-1", "", error.norm() < 1 * N * m)', "expected a number without unit"),
    ('r.require("A-1", "", error < 1)', "has shape"),
    ('r.require("A-1", "", error.norm())', "expected a formula"),
    ('r.require("A-1", "")', "needs a formula"),
    ('r.require("A-1", "", error.norm() < 1, method="analysis")', "others have none"),
    ('r.require("A-1", "", method="guess")', "there is no method 'guess'"),
    ('r.require("A 1", "", error.norm() < 1)', "an id has no spaces"),
    ('r.require("A-1", "", error.norm() < 1, shown_by="spinn")', "did you mean 'spin'"),
    ('r.require("A-1", "", error.norm() == 0.1)', "hardly ever equal"),
    ('r.signal("flight.tracking.error.sigma_B")', "has no 'sigma_B'"),
    ('r.signal("flight.control.K")', "no field of an input or output"),
    ('r.require("A-1", "", always(error.norm() < 1, 2 * s, 1 * s))', "ends after its beginning"),
    ('r.require("A-1", "", within(0, error.norm() < 1))', "a time above 0"),
    ('r.require("A-1", "", within(1 * m, error.norm() < 1))', "within"),
    ('angle(error, [1, 2])', "3 numbers"),
    ('error - r.signal("flight.tracking.error.omega_BR_B")', "they differ in shape or unit"),
    ('r.evry = 1 * s', "did you mean 'every'"),
    ('r.every = -1 * s', "must be >= 0"),
    ('error[3]', "whole numbers below"),
    ('always(True)', "expected a formula"),
])
def test_bad_input_is_named_with_file_and_line(line, says, mission):
    sim = mission(line)
    with pytest.raises(SetupError, match="requirements.py, line 9") as found:
        Requirements(sim)
    assert says in str(found.value)


def test_two_requirements_with_one_id_are_refused(mission):
    sim = mission('r.require("A-1", "", error.norm() < 1)', 'r.require("A-1", "", error.norm() < 2)')
    with pytest.raises(SetupError, match="line 10.*two requirements have the id A-1.*line 9"):
        Requirements(sim)
    assert not Requirements(fledge.load("inertial_spin"))
    with pytest.raises(SetupError, match="did you mean 'A-1'"):
        Requirements(mission('r.require("A-1", "", error.norm() < 1)')).of("A-2")


def test_windows_longer_than_a_run_are_refused_before_it(mission):
    sim = mission('r.require("A-1", "", within(5 * minute, error.norm() < 1))')
    required = Requirements(sim)
    required.refuse_longer(300_000_000_000, required.all)
    with pytest.raises(SetupError, match="line 9: A-1 looks 5 min ahead, which is longer than the run of 299 s"):
        required.refuse_longer(299_000_000_000, required.all)


def test_the_order_of_random_formulas_does_not_matter(mission):
    """De Morgan, and the duals of windows, on random signals: equal margins."""
    sim = mission('pass')
    r = Declaration(sim)
    a = r.signal("flight.tracking.error.sigma_BR")[0] < 0.5
    b = r.signal("flight.tracking.error.sigma_BR")[1] > -0.5
    pairs = [(~(a & b), ~a | ~b), (~always(a, 1, 3), eventually(~a, 1, 3)), (never(a), ~eventually(a)),
             (implies(a, b), ~a | b), (within(2, a), eventually(a, 0, 2)), (until(after(0), a), eventually(a)),
             (settles(a, within=3), eventually(always(a), 0, 3))]
    for i, pair in enumerate(pairs):
        for k in (0, 1):
            r.require(f"P-{i}-{k}", "", pair[k])
    judged = Judged(list(r._found.values()))
    draw = random.Random(3)
    for _ in range(100):
        n = draw.randrange(1, 12)
        times = np.cumsum([draw.randrange(1, 3) for _ in range(n)]) * 1_000_000_000
        judged.play_samples(times, [np.array([[draw.uniform(-1, 1) for _ in range(3)] for _ in range(n)])])
        found = judged.outcomes()
        for first, second in zip(found[::2], found[1::2]):
            assert (first.low, first.high) == (second.low, second.high), first
