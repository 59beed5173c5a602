# SPDX-License-Identifier: Apache-2.0
"""Flight services on the desktop and on targets: the same bits, reports and packets."""
import pytest

import fledge
from fledge import cli, export
from fledge.commands import ALL, Action, Code, Reason, decoded, read_script, stored, storing
from fledge.errors import SetupError
from fledge.export.run_test import FLIGHT, WORLD
from fledge.targets import TARGETS
from fledge.targets.job import Job
from fledge.units import s

STORED = FLIGHT + '''
    f.stored = fsw.StoredCommands(late=1 * s)
    f.task("services", every=400 * ms, run=[f.stored])
'''

PLAY = '''
from fledge.commands import Action, storing
from fledge.units import ms, s


def passes(sim):
    """Sequences and absolute commands while the modes change, which suspend the other tasks."""
    f = sim.flight
    c, p = f.commands, f.commands.packets
    c.telemetry()
    c.at(7.25 * s, p.mode("rest"), step=1)              # between the instants of this mode
    c.at(7.25 * s, p.write("flight.control", K=3.5)[0], step=2)
    c.at(19 * s, p.control(Action.START, 2), step=3)
    c.at(60 * s, p.noop(), step=4)
    sim.run(1 * s)
    block = p.store_sequence(1, [(0, p.mode("point")), (1_500_000_000, p.write("flight.switch", rates=[0, 0, 0.01])[0]),
                           (1_500_000_000, p.arm("off", False)), (4_000_000_000, p.read("flight.control", "K")[0])])
    for one in block:
        c.send(one)
    c.send(p.control(Action.START, 1, storing(block)[1:]))      # it is another one
    sim.run(1 * s)
    c.sequence(2, [(0, p.write("flight.control", K=-3)[0]), (1 * s, p.mode("point")), (2 * s, p.mode("wait"))])
    sim.run(3 * s)
    c.send(p.control(Action.START, 1, storing(block)))
    sim.run(2 * s)
    c.control(Action.HOLD, 1)
    sim.run(3.3 * s)
    c.control(Action.RELEASE, 1)
    c.control(Action.START, 1)                          # it runs
    c.stored(1)
    sim.run(10 * s)                                     # list 2 has begun, and is refused its first step
    c.control(Action.INHIBIT, 2)
    sim.run(1 * s)
    c.control(Action.ALLOW)
    c.delete(2)
    sim.run(2 * s)
    c.control(Action.START, 1)
    sim.run(1 * s)
    c.reset()                                           # stops it; the store stays
    sim.run(2 * s)
    c.stored(0)
    c.control(Action.HOLD, 0)
    sim.run(35 * s)                                     # what is due at 60 s is too late afterwards
    c.control(Action.RELEASE, 0)
    sim.run(2 * s)
    c.delete()
    sim.run(1 * s)
'''


def written(folder, flight, scenarios):
    """A mission in a new folder."""
    folder.mkdir()
    for name, text in (("flight", flight), ("world", WORLD), ("scenarios", scenarios)):
        (folder / f"{name}.py").write_text(text)
    return folder


@pytest.fixture
def mission(tmp_path):
    return written(tmp_path / "passes", STORED, PLAY)


def test_stored_commands_are_the_same_on_every_target(mission, tmp_path, capsys):
    on = [name for name in ("linux", "cfs", "leon3", "micropython") if not TARGETS[name].missing()]
    out = tmp_path / "out"
    assert cli.main(["fly", str(mission), "passes", "--on", ",".join(on), "--out", str(out)]) == 0, capsys.readouterr()
    sim = fledge.load(mission)
    sim.scenarios["passes"]()
    expected = sim.flight.commands.reports
    kept = [one for one in expected if one.stored_on is not None]
    assert [(one.stored_on, one.code, one.reason) for one in kept if one.executed or not one.good] == [
        (1, Code.MODE, Reason.OK), (1, Code.WRITE, Reason.OK), (1, Code.ARM, Reason.OK),
        (0, Code.MODE, Reason.OK), (0, Code.WRITE, Reason.OK), (1, Code.READ, Reason.OK),
        (0, Code.CONTROL, Reason.OK), (2, Code.WRITE, Reason.RULE), (2, Code.MODE, Reason.OK),
        (2, Code.MODE, Reason.INHIBITED), (1, Code.MODE, Reason.OK), (0, Code.NOOP, Reason.LATE)]
    assert [one.reason for one in expected if one.stored_on is None and not one.good] == [Reason.CRC, Reason.RUNNING]
    lists = [[row.step for row in stored(one.data)] for one in expected if one.code == Code.LIST and one.executed]
    assert lists == [[0, 1, 2, 3], [4]]
    assert sim.flight.stored.state.stored == 0 and sim.flight.control.K == 3.5

    links = [(out / f"{name}.telemetry.txt").read_text() for name in on]
    assert links == links[:1] * len(on)
    job = Job(str(mission), "passes", folder=out)
    assert job.parts[0].reports(on[0]) == expected
    found = export.dictionary(job.parts[0].mission)
    states = [one.content for one in (decoded(found, each.packet) for each in read_script(links[0]))
              if one.path == "flight.stored.state"]
    assert {one["running"] for one in states} == {0, 2, 4} and {one["held"] for one in states} == {0, 1, 2}


def test_what_is_stored_is_a_parameter_that_flies_from_the_start(mission):
    """A store that was made with the mission, a snapshot of one that runs, and a clone."""
    sim = fledge.load(mission)
    packets = sim.flight.commands.packets
    for one in packets.store_sequence(1, [(1_000_000_000, packets.mode("rest"))]):
        sim.flight.commands.send(one)
    sim.flight.commands.control(Action.START, 1)
    sim.run(0.5 * s)
    clone, before = sim.clone(), sim.snapshot()
    assert sim.flight.active_mode == "wait"
    for _ in range(2):
        sim.run(1 * s)
        assert sim.flight.active_mode == "rest"
        sim.restore(before)
    clone.run(1 * s)
    assert clone.flight.active_mode == "rest"
    other = fledge.load(mission)
    other.flight.stored.commands = sim.flight.stored.commands
    other.flight.stored.commands[0].list = 0        # whose checksum does not hold any more
    other.run(2 * s)
    assert [one.reason for one in other.flight.commands.reports] == [Reason.CRC]


def test_a_process_has_one_service_of_a_kind(mission):
    text = (mission / "flight.py").read_text()
    text = text.replace("    f.task(\"services\"", "    f.more = fsw.StoredCommands()\n    f.task(\"services\"")
    (mission / "flight.py").write_text(text.replace("[f.stored]", "[f.stored, f.more]"))
    sim = fledge.load(mission)
    with pytest.raises(SetupError, match="flight.more is another StoredCommands: flight.stored is there already"):
        sim.run(1 * s)


def test_the_ground_refuses_what_cannot_be_stored(mission):
    packets = fledge.load(mission).flight.commands.packets
    for wrong in ((16, 0, 0), (1, ALL, 0), (1, 0, -1)):
        with pytest.raises(SetupError, match="a stored command has a list from 0 to 15"):
            packets.store(*wrong, packets.noop())
    with pytest.raises(SetupError, match="a stored command has 8 to 112 bytes; found 120"):
        packets.store(1, 0, 0, bytes(120))
    first, second = (packets.store(1, step, round(t * 1e9), packets.noop()) for step, t in ((0, 2.0), (1, 1.0)))
    assert [(one.step, one.size, one.code) for one in storing([first, second])] == [(1, 8, 0), (0, 8, 0)]
    assert packets.control(Action.HOLD)[10:16] == b"\xFF\xFF\0\2\0\0"


WATCHED = STORED + '''
    f.monitors = fsw.Monitors()
    f.task("watch", every=2 * s, run=[f.monitors])
'''

WATCHES = '''
from fledge.units import ms, s


def watches(sim):
    """A limit, an expected value and a change: they start sequences, which turn them off."""
    c, p = sim.flight.commands, sim.flight.commands.packets
    c.telemetry("flight.monitors.event")
    c.telemetry("flight.monitors.state")
    c.sequence(1, [(0 * s, p.mode("point")), (3 * s, p.monitor(0, on=False))])
    c.sequence(2, [(0 * s, p.write("flight.switch", rates=[0, 0, 0.02])[0])])
    sim.run(500 * ms)
    c.monitor(0, "flight.tracking.error.sigma_BR", measure="max_abs", high=0.2, hold=2 * s, count=12, starts=1)
    c.monitor(1, "flight.stored.state.running", equals=0, starts=2)
    c.monitor(2, "flight.switch.reference.omega_RN_N", measure="norm", change=True, low=-1e-3, high=1e-3, starts=3)
    sim.run(10 * s)
    c.monitor(5, "flight.motor.command.u[0]", low=-1, high=1)
    sim.run(20 * s)
    c.monitor(1, on=False)
    c.reset()
    sim.run(5 * s)
'''


@pytest.fixture
def watched(tmp_path):
    return written(tmp_path / "watched", WATCHED, WATCHES)


def test_monitors_are_the_same_on_every_target(watched, tmp_path, capsys):
    on = [name for name in ("linux", "cfs", "leon3", "micropython") if not TARGETS[name].missing()]
    out = tmp_path / "out"
    assert cli.main(["fly", str(watched), "watches", "--on", ",".join(on), "--out", str(out)]) == 0, capsys.readouterr()
    sim = fledge.load(watched)
    sim.scenarios["watches"]()
    expected = sim.flight.commands.reports
    started = [(one.monitor, one.reason) for one in expected if one.monitor is not None and one.executed]
    assert started == [(0, Reason.OK), (1, Reason.OK), (2, Reason.PLACE)]       # list 3 has nothing
    links = [(out / f"{name}.telemetry.txt").read_text() for name in on]
    assert links == links[:1] * len(on)
    job = Job(str(watched), "watches", folder=out)
    assert job.parts[0].reports(on[0]) == expected
    found = export.dictionary(job.parts[0].mission)
    contents = [decoded(found, each.packet) for each in read_script(links[0])]
    events = [(one.content["monitor"], one.content["wrong"]) for one in contents if one.path == "flight.monitors.event"]
    states = [one.content for one in contents if one.path == "flight.monitors.state"]
    assert {place for place, _ in events} >= {0, 1} and {wrong for _, wrong in events} == {0, 1}
    assert states[-1]["on"] & 1 == 0 and states[-1]["bad"] == 0


def test_a_monitor_names_a_number_of_an_output(watched):
    sim = fledge.load(watched)
    found, packets = sim.flight.commands.dictionary, sim.flight.commands.packets
    places = {o.path: i for i, o in enumerate(found.outputs)}
    for path, measure, output, offset, n in (
            ("flight.tracking.error.sigma_BR[2]", "", "flight.tracking.error", 32, 1),
            ("flight.tracking.error.sigma_BR", "norm", "flight.tracking.error", 16, 3),
            ("flight.stored.state.head.t", "", "flight.stored.state", 0, 1),
            ("flight.vehicle.vehicle.I_B[1][2]", "", "flight.vehicle.vehicle", 16 + 8 * 5, 1)):
        place, _, at, many = found.number(path, measure)
        assert (place, at, many) == (places[output], offset, n), path
    for path, measure in (("flight.tracking.error.sigma_BR", ""), ("flight.tracking.error.sigma_BR[3]", ""),
                          ("flight.tracking.error.sigma_BR[0]", "norm"), ("flight.tracking.error", ""),
                          ("flight.tracking.error.sigma_BR", "sum"), ("sigma_BR[0]", "")):
        with pytest.raises(SetupError, match="is no number of an output of flight: give one, as in"):
            found.number(path, measure)
    with pytest.raises(SetupError, match="flight.monitors has the monitors 0 to 15; found 16"):
        packets.monitor(16, on=False)
    with pytest.raises(SetupError, match="either equals, or low and high"):
        packets.monitor(0, "flight.stored.state.running", equals=1, low=0)
    with pytest.raises(SetupError, match="a monitor that is on needs a number"):
        packets.monitor(0, low=0)
