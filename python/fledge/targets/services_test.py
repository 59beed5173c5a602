# SPDX-License-Identifier: Apache-2.0
"""Flight services on the desktop and on targets: the same bits, reports and packets."""
import pytest

import fledge
from fledge import cli, export
from fledge.commands import (ALL, Action, Code, Reason, Stage, checked, decoded, read_script, read_table, stored,
                             storing, table)
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
    for command in block:
        c.send(command)
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


SERVED = FLIGHT + '''
    f.stored   = fsw.StoredCommands(late=1 * s)
    f.monitors = fsw.Monitors()
    f.log      = fsw.EventLog(least=2, most=2, window=20 * s)
    f.chosen   = fsw.Housekeeping()
    f.task("services", every=400 * ms, run=[f.stored, f.log, f.chosen])
    f.task("watch", every=2 * s, run=[f.monitors])
'''

WATCHES = PLAY + '''

def watches(sim):
    """A limit, an expected value and a change: they start sequences, which turn them off."""
    c, p = sim.flight.commands, sim.flight.commands.packets
    c.sequence(1, [(0 * s, p.mode("point")), (3 * s, p.monitor(0, on=False))])
    c.sequence(2, [(0 * s, p.write("flight.switch", rates=[0, 0, 0.02])[0])])
    sim.run(500 * ms)
    c.monitor(0, "flight.tracking.error.sigma_BR", measure="max_abs", high=0.05, hold=2 * s, count=12, starts=1)
    c.monitor(1, "flight.stored.state.running", bits=0xFFFF, starts=2)
    c.monitor(2, "flight.switch.reference.omega_RN_N", measure="norm", change=True, low=-1e-3, high=1e-3, starts=3)
    sim.run(10 * s)
    c.monitor(5, "flight.motor.command.u[0]", low=-1, high=1)
    sim.run(20 * s)
    c.monitor(1, on=False)
    c.reset()
    sim.run(5 * s)


def services(sim):
    """Both, while reports of chosen numbers and events are sent."""
    c = sim.flight.commands
    c.housekeeping(0, ["flight.tracking.error.sigma_BR", "flight.motor.command.u[0]", "flight.stored.state.skipped"],
                   every=3.1 * s)
    c.housekeeping(7, ["flight.vehicle.vehicle.I_B[1][2]", "flight.log.state.head.t"], every=20 * s)
    passes(sim)
    c.housekeeping(7, on=False)
    c.filter_events(3, "flight.monitors.event")     # all of them
    c.events()
    watches(sim)
    c.housekeeping(0, ["flight.monitors.state.fired"])
    c.events()
    sim.run(10 * s)
'''


def written(folder, flight, scenarios, world=WORLD):
    """A mission in a new folder."""
    folder.mkdir()
    for name, text in (("flight", flight), ("world", world), ("scenarios", scenarios)):
        (folder / f"{name}.py").write_text(text)
    return folder


EVERYWHERE = ("linux", "cfs", "leon3", "micropython")


def fly_everywhere(folder, scenario, out, capsys, names=EVERYWHERE):
    """Fly a scenario on those of the targets that are installed, with records in `out`. Returns their names."""
    on = [name for name in names if not TARGETS[name].missing()]
    assert cli.main(["fly", str(folder), scenario, "--on", ",".join(on), "--out", str(out)]) == 0, capsys.readouterr()
    return on


@pytest.fixture
def mission(tmp_path):
    return written(tmp_path / "passes", STORED, PLAY)


@pytest.fixture
def served(tmp_path):
    return written(tmp_path / "served", SERVED, WATCHES)


@pytest.mark.long("builds and flies on all targets")
def test_services_are_the_same_on_every_target(served, tmp_path, capsys):
    out = tmp_path / "out"
    on = fly_everywhere(served, "services", out, capsys)
    sim = fledge.load(served)
    sim.scenarios["services"]()
    expected = sim.flight.commands.reports
    links = [(out / f"{name}.telemetry.txt").read_text() for name in on]
    assert links == links[:1] * len(on)
    job = Job(str(served), "services", folder=out)
    assert job.parts[0].reports(on[0]) == expected
    dictionary = export.dictionary(job.parts[0].mission)
    for _, packet in sim.flight.commands.sent:
        if packet[6] == Code.WRITE and int.from_bytes(packet[10:12], "big") == dictionary.block("flight.chosen")[0]:
            dictionary.learn(packet[16:])
    values = {}
    for each in read_script(links[0]):
        telemetry = decoded(dictionary, each.packet)
        values.setdefault(telemetry.path, []).append(telemetry.content)
    check_stored(sim, expected, values["flight.stored.state"])
    check_monitors(expected, values)
    check_events(values["events"])
    check_selected(values["selected"])


def check_stored(sim, reports, states):
    ended = [report for report in reports if report.stored_on is not None and (report.executed or not report.good)]
    assert [(report.stored_on, report.code, report.reason) for report in ended][:12] == [
        (1, Code.MODE, Reason.OK), (1, Code.WRITE, Reason.OK), (1, Code.ARM, Reason.OK),
        (0, Code.MODE, Reason.OK), (0, Code.WRITE, Reason.OK), (1, Code.READ, Reason.OK),
        (0, Code.CONTROL, Reason.OK), (2, Code.WRITE, Reason.RULE), (2, Code.MODE, Reason.OK),
        (2, Code.MODE, Reason.INHIBITED), (1, Code.MODE, Reason.OK), (0, Code.NOOP, Reason.LATE)]
    assert [report.reason for report in reports if report.stored_on is None and report.monitor is None
            and not report.good] == [
        Reason.CRC, Reason.RUNNING]
    lists = [[row.step for row in stored(report.data)]
             for report in reports if report.code == Code.LIST and report.executed]
    assert lists == [[0, 1, 2, 3], [4]]
    assert next(state for state in states if state["head"]["t"] == 64 * 10**9)["stored"] == 0     # all are deleted
    assert sim.flight.control.K == 3.5
    assert {state["running"] for state in states} == {0, 2, 4} and {state["held"] for state in states} == {0, 1, 2}


def check_monitors(reports, values):
    started = [(report.monitor, report.reason) for report in reports if report.monitor is not None and report.executed]
    assert started == [(0, Reason.OK), (1, Reason.OK), (2, Reason.PLACE)]       # list 3 has nothing
    states = values["flight.monitors.state"]
    assert states[-1]["on"] & 1 == 0 and states[-1]["bad"] == 0
    assert {event["id"] for event in values["flight.monitors.event"]} == {0, 1, 2}     # 0: none yet


def check_events(events):
    """Those that are grave enough, all of the monitors, and twice all again: what a reset keeps, counts on."""
    events_ = [(str(event).partition(",")[0].split(": ")[1], event.number, event.before) for event in events]
    stored = [("INHIBITED list 2", 1, 1), ("LATE list 0", 2, 0)]
    monitors = [("FIRED monitor 0", 3, 0), ("FIRED monitor 1", 4, 0), ("FIRED monitor 2", 5, 0),
                ("RIGHT monitor 2", 6, 0), ("RIGHT monitor 1", 7, 0)]
    assert events_ == stored + stored + monitors + stored + monitors
    assert events[2:4] == events[:2] and events[-7:] == events[:2] + events[4:9]
    assert (events[0].severity, events[0].output, events[0].t) == ("low", "flight.stored.event", 21 * 10**9)
    assert events[1].arguments["late"] == pytest.approx(1.4)


def check_selected(reports):
    """At the first update at or after each period, when it is turned on, and with what is chosen then."""
    ms = 10**6
    every = [(report.t // ms, list(report.values)) for report in reports if report.report == 0]
    assert [t for t, _ in every][:6] == [0, 3200, 6400, 9600, 12400, 15600]
    fired = [t for t, names in every if names == ["flight.monitors.state.fired"]]
    assert fired == list(range(100_000, 110_000, 400))
    assert [report.t // ms for report in reports if report.report == 7] == [0, 20_000, 24_400, 40_000,
                                                                            60_000]    # 24.4: a reset
    first = next(report for report in reports if report.t == 62 * 10**9)
    assert first.values["flight.stored.state.skipped"] == 1 and not first.left_out
    assert len(first.values["flight.tracking.error.sigma_BR"]) == 3 and len(first.data) == 36


def test_what_is_stored_is_a_parameter_that_flies_from_the_start(mission):
    """A store that was made with the mission, a snapshot of one that runs, and a clone."""
    sim = fledge.load(mission)
    packets = sim.flight.commands.packets
    for packet in packets.store_sequence(1, [(1_000_000_000, packets.mode("rest"))]):
        sim.flight.commands.send(packet)
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
    assert [report.reason for report in other.flight.commands.reports] == [Reason.CRC]


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
    assert [(report.step, report.size, report.code) for report in storing([first, second])] == [(1, 8, 0), (0, 8, 0)]
    assert packets.control(Action.HOLD)[10:16] == b"\xFF\xFF\0\2\0\0"


def test_a_monitor_names_a_number_of_an_output(served):
    sim = fledge.load(served)
    dictionary, packets = sim.flight.commands.dictionary, sim.flight.commands.packets
    places = {o.path: i for i, o in enumerate(dictionary.outputs)}
    for path, measure, output, offset, n in (
            ("flight.tracking.error.sigma_BR[2]", "", "flight.tracking.error", 32, 1),
            ("flight.tracking.error.sigma_BR", "norm", "flight.tracking.error", 16, 3),
            ("flight.stored.state.head.t", "", "flight.stored.state", 0, 1),
            ("flight.vehicle.vehicle.I_B[1][2]", "", "flight.vehicle.vehicle", 16 + 8 * 5, 1)):
        place, _, at, many = dictionary.number(path, measure)
        assert (place, at, many) == (places[output], offset, n), path
    for path, measure in (("flight.tracking.error.sigma_BR", ""), ("flight.tracking.error.sigma_BR[3]", ""),
                          ("flight.tracking.error.sigma_BR[0]", "norm"), ("flight.tracking.error", ""),
                          ("flight.tracking.error.sigma_BR", "sum"), ("sigma_BR[0]", "")):
        with pytest.raises(SetupError, match="is no number of an output of flight: give one, as in"):
            dictionary.number(path, measure)
    with pytest.raises(SetupError, match="flight.monitors has the monitors 0 to 15; found 16"):
        packets.monitor(16, on=False)
    for both in ({"equals": 1, "low": 0}, {"bits": 1, "equals": 1}, {"bits": 1, "change": True}):
        with pytest.raises(SetupError, match="either equals, or bits, or low and high"):
            packets.monitor(0, "flight.stored.state.running", **both)
    for number, check, says in (
            ("flight.stored.state.running", {"bits": 1 << 32},
             "is a u32: expected bits from 1 to 0xffffffff; found 42"),
            ("flight.stored.state.running", {"bits": 0}, "expected bits from 1 to"),
            ("flight.stored.state.head.t", {"bits": 1}, "bits are of one whole number of up to 32 bits, not of i64"),
            ("flight.tracking.error.sigma_BR", {"bits": 1, "measure": "norm"}, "up to 32 bits, not of its norm")):
        with pytest.raises(SetupError, match=says):
            packets.monitor(0, number, **check)
    with pytest.raises(SetupError, match="a monitor that is on needs a number"):
        packets.monitor(0, low=0)


CARRYING = FLIGHT + '''
    f.files = fsw.Files(entity=2, ground=1, rate=4000 / s, ack_timer=5 * s, ack_limit=3)
    f.task("services", every=400 * ms, run=[f.files])
'''

CARRIES = r'''
from fledge.commands import Code, FileAction, Stage
from fledge.units import s


def carries(sim):
    """Tables up and a dump down, with parts that come twice or again, while flight changes its mode and is reset."""
    f = sim.flight
    c, p = f.commands, f.commands.packets
    c.telemetry("flight.files.state")
    c.telemetry("flight.files.event")

    def say(kind, data, number, down=False):
        ids = b"\0\2%b\0\1" % number.to_bytes(4, "big") if down else b"\1%c\2" % number
        c.send(p.packet(Code.PDU, b"%c%b%c%b" % (kind, len(data).to_bytes(2, "big"), 0x13 if down else 0, ids) + data))

    sim.run(0.5 * s)
    for number, (name, K) in enumerate([("good", 3.5), ("wrong", -1)]):
        table = c.table(f.control, K=K)
        words = table.ljust(-(-len(table) // 4) * 4, b"\0")
        check = sum(int.from_bytes(words[i:i + 4], "big") for i in range(0, len(words), 4)) & 0xFFFFFFFF
        size = len(table).to_bytes(4, "big")
        say(0x20, b"\7\0%b%c%b%c%b" % (size, len(name), name.encode(), len(name), name.encode()), number)
        for at in [32, 32, 0, *range(64, len(table), 32)]:
            say(0x30, at.to_bytes(4, "big") + table[at:at + 32], number)
        say(0x20, b"\4\0%b%b" % (check.to_bytes(4, "big"), size), number)
        sim.run(1.3 * s)
        say(0x20, b"\6\x51\2", number)                  # FINISHED is acknowledged
    sim.run(1 * s)
    for name in ("wrong", "good", "none"):
        c.send(p.load_table("flight.control", name))
    c.send(p.check("flight.control"))
    c.send(p.dump_table("flight.control", "dump"))
    c.mode("point")
    sim.run(0.7 * s)
    c.send(p.send_file("dump", "got"))
    sim.run(1 * s)
    c.reset()
    number = next(report.detail for report in c.reports if report.stage == Stage.STARTED)
    say(0x28, b"\x08" + bytes(4) + b"\0\0\0\x40" + bytes(8) + b"\0\0\0\x10\0\0\0\x40", number, True)    # a NAK
    sim.run(2 * s)
    say(0x28, b"\6\x40\1", number, True)                # EOF is acknowledged
    sim.run(2 * s)
    say(0x28, b"\5\2", number, True)                    # FINISHED
    sim.run(2 * s)
    c.send(p.send_file("good"))
    sim.run(1 * s)
    c.send(p.control_file(FileAction.SUSPEND, number + 1))
    for _ in range(2):
        c.send(p.remove_file("wrong"))
    say(0xFF, bytes(30), 0)
    sim.run(20 * s)
    c.send(p.control_file(FileAction.RESUME, number + 1))
    sim.run(40 * s)                                     # nothing answers: it ends by itself
'''


@pytest.mark.long("builds and flies on all targets")
def test_files_are_the_same_on_every_target(tmp_path, capsys):
    folder = written(tmp_path / "carries", CARRYING, CARRIES)
    out = tmp_path / "out"
    on = fly_everywhere(folder, "carries", out, capsys)
    sim = fledge.load(folder)
    commands = sim.flight.commands
    commands.take_packets()
    sim.scenarios["carries"]()
    reports = [(report.code, report.stage, report.reason) for report in commands.reports
               if report.code >= Code.FILE_SEND and report.stage != Stage.ACCEPTED]
    number = next(report.detail for report in commands.reports if report.stage == Stage.STARTED)
    assert [report for report in reports if report[1] != Stage.UNDER_WAY] == [
        (Code.TABLE_LOAD, Stage.DONE, Reason.RULE), (Code.TABLE_LOAD, Stage.DONE, Reason.OK),
        (Code.TABLE_LOAD, Stage.DONE, Reason.PLACE), (Code.CHECK, Stage.DONE, Reason.OK),
        (Code.TABLE_DUMP, Stage.DONE, Reason.OK), (Code.FILE_SEND, Stage.STARTED, Reason.OK),
        (Code.FILE_SEND, Stage.DONE, Reason.OK), (Code.FILE_SEND, Stage.STARTED, Reason.OK),
        (Code.FILE_CONTROL, Stage.DONE, Reason.OK), (Code.FILE_REMOVE, Stage.DONE, Reason.OK),
        (Code.FILE_REMOVE, Stage.DONE, Reason.PLACE), (Code.FILE_CONTROL, Stage.DONE, Reason.OK),
        (Code.FILE_SEND, Stage.DONE, Reason.FAILED)]
    assert sim.flight.control.K == 3.5 and sim.flight.files.state.failed == 1
    desktop = [(decoded(commands.dictionary, packet.packet).path, packet) for packet in commands.take_packets()]
    links = [read_script((out / f"{name}.telemetry.txt").read_text()) for name in on]
    assert links == links[:1] * len(on)
    sent = [(timed.t, timed.packet[16:]) for path, timed in desktop if path == "files"]
    job = Job(str(folder), "carries", folder=out)
    dictionary = export.dictionary(job.parts[0].mission)
    assert job.parts[0].reports(on[0]) == commands.reports
    assert [(link.t, link.packet[16:]) for link in links[0] if decoded(dictionary, link.packet).path == "files"] == sent

    down = {}
    for _, pdu in sent:                                 # data of the first file that came down
        if pdu[0] == 0x30 and int.from_bytes(pdu[6:10], "big") == number:
            down[int.from_bytes(pdu[12:16], "big")] = pdu[16:]
    path, values = read_table(commands.dictionary, b"".join(down[at] for at in sorted(down) if at != 16))
    assert (path, values["K"]) == ("flight.control", 3.5)
    size, crc = checked(next(report.data for report in commands.reports if report.code == Code.CHECK
                             and report.executed))
    whole = commands.table(sim.flight.control)
    assert (size, crc) == (len(whole) - 16, int.from_bytes(whole[12:14], "big"))


MEETING = SERVED + '''
    f.files = fsw.Files(entity=2, ground=1, rate=1000 / s, segment=32, allowed=7)
    f.task("files", every=400 * ms, run=[f.files])
'''

FAULTY = WORLD.replace("w.nav    = world.Navigation()",
                       "w.nav    = world.Navigation(faults=[dict(kind='BIAS', channels=1, size=0.5, begin=4 * s)])")

MEETS = '''
from pathlib import Path
from tempfile import TemporaryDirectory

from fledge import ground
from fledge.commands import Packets
from fledge.units import s


def meets(sim):
    """A ground in the loop: commands, a table up and down, and a fault, which a monitor answers by a sequence."""
    with TemporaryDirectory() as folder, ground.connect(sim) as craft:
        p, table, back = Packets(craft.dictionary), Path(folder) / "table", Path(folder) / "back"
        table.write_bytes(sim.flight.commands.table(sim.flight.control, K=3.5))
        craft.command("telemetry").completed()
        answer = [(0, p.mode("rest")), (10**9, p.write("flight.control", K=-3)[0])]
        craft.command("store_sequence", 1, answer).completed()
        craft.command("monitor", 0, "flight.tracking.error.sigma_BR", measure="max_abs", change=True, low=-0.05,
                      high=0.05, starts=1).completed()
        craft.put(table, to="next", within=10 * s)
        craft.command("load_table", "flight.control", "next").completed()
        craft.command("mode", "point").completed()
        craft.command("dump_table", "flight.control", "now").completed()
        craft.fetch("now", back, within=10 * s)
        assert back.read_bytes() == table.read_bytes() and sim.time < 4
        craft.wait(lambda t: t.mode == "rest", within=10 * s)
        craft.listen(2 * s)
'''


@pytest.mark.long("builds and flies on all targets")
def test_the_same_flight_gives_the_same_packets_on_every_target(tmp_path, capsys, monkeypatch):
    """Byte for byte, those of the desktop too, and the ground in the scenario is content with each."""
    folder = written(tmp_path / "meets", MEETING, MEETS, FAULTY)
    out = tmp_path / "out"
    on = fly_everywhere(folder, "meets", out, capsys, EVERYWHERE + ("aarch64",))
    assert capsys.readouterr().out.count(": write, at 5.1 s: the parameters would break a rule\n") == 1 + len(on)
    sim = fledge.load(folder)
    commands, desktop = sim.flight.commands, []
    take = commands.take_packets

    def taken():
        flown = take()
        desktop.extend(flown)
        return flown

    monkeypatch.setattr(commands, "take_packets", taken)
    sim.scenarios["meets"]()
    for name in on:
        flown = read_script((out / f"{name}.telemetry.txt").read_text())
        assert [timed.packet for timed in flown] == [timed.packet for timed in desktop], name
    paths = [decoded(commands.dictionary, timed.packet).path for timed in desktop]
    assert {path: paths.count(path) for path in ("files", "reports", "flight.files.event")} == {
        "files": 14, "reports": 20, "flight.files.event": 3}
    own = [(report.monitor, report.stored_on, report.code, report.reason) for report in commands.reports
           if report.executed and (report.monitor, report.stored_on) != (None, None)]
    assert own == [(0, None, Code.CONTROL, Reason.OK), (None, 1, Code.MODE, Reason.OK),
                   (None, 1, Code.WRITE, Reason.RULE)]


def test_files_on_board_have_names(tmp_path):
    packets = fledge.load(written(tmp_path / "carries", CARRYING, CARRIES)).flight.commands.packets
    for wrong in ("", "a>b>c", ">b", "a>", "n" * 128, "a\0"):
        with pytest.raises(SetupError, match="a file on board has a name of 1 to 127 bytes without '>' and NUL"):
            packets.send_file(wrong)
    with pytest.raises(SetupError, match="a file on board has a name"):
        packets.remove_file("a>b")
    assert packets.send_file("a", "b", unacknowledged=True)[10:] == b"\0\1a>b"


def test_a_table_is_whole(tmp_path):
    sim = fledge.load(written(tmp_path / "carries", CARRYING, CARRIES))
    commands = sim.flight.commands
    dictionary = commands.dictionary
    whole = commands.table(sim.flight.control, K=4)
    path, values = read_table(dictionary, whole)
    assert (path, values["K"], values["P"][1]) == ("flight.control", 4.0, [0.0, 45.0, 0.0])
    assert table(dictionary, path, **{name: value for name, value in values.items() if name != "spare"}) == whole
    for wrong in (b"", whole[:-1], b"X" + whole[1:], whole[:-1] + bytes([whole[-1] ^ 1])):
        with pytest.raises(SetupError, match="bytes are no table, or not a whole one"):
            read_table(dictionary, wrong)
    with pytest.raises(SetupError, match="the table is for version 0x0000 of a dictionary; that of flight is"):
        read_table(dictionary, whole[:4] + b"\0\0" + whole[6:])
    with pytest.raises(SetupError, match="a table has all parameters of flight.control: give"):
        table(dictionary, "flight.control", K=1)
    with pytest.raises(SetupError, match="bytes of parameters; found 1"):
        table(dictionary, "flight.control", b"1")
