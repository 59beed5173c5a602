# SPDX-License-Identifier: Apache-2.0
"""Scripts of the ground against flight on the desktop, and against links that lose and repeat packets."""
import pytest

import fledge
from fledge import ground
from fledge.commands import Dictionary, FileAction, Timed
from fledge.errors import SetupError
from fledge.export.run_test import FLIGHT, WORLD
from fledge.ground.scripts.links import Link
from fledge.targets.services_test import SERVED, written
from fledge.units import N, kg, m, minute, s


@pytest.fixture()
def craft():
    with ground.connect(fledge.load("nadir_spin")) as opened:
        yield opened


def test_commands_are_followed_to_their_execution_in_simulated_time(craft):
    sim = craft.link.simulation
    assert repr(craft.command("noop")) == "<noop: sent>"
    craft.listen(2 * s)
    assert sim.time == 2 and craft.sent[0].completed(0).reports[-1].t == 0
    sent = craft.command("write", "flight.control", K=3 * N * m)
    assert sent.accepted(1 * s).reports[0].t == 2 * 10**9 and sim.flight.control.K == 2.531
    assert sent.completed(within=1 * s) is sent and sim.time == 2.5 and sim.flight.control.K == 3
    assert sent.reports[1].t == 2_500_000_000 and repr(sent) == "<write flight.control.K: executed>"
    assert craft.command("read", "flight.control", "K").completed().data.hex() == "4008000000000000"
    whole = craft.command("read", "flight.vehicle")
    assert whole.completed().data[:8].hex() == "4085e00000000000" and sim.time == 3.5


def test_what_flight_refuses_ends_the_wait_with_its_reason(craft):
    craft.listen(1 * s)
    with pytest.raises(ground.NoAnswer, match=r"refused write flight.control.K, at 1.5 s: the parameters would break a "
                                              r"rule: flight.control.K must be"):
        craft.command("write", "flight.control", K=-3 * N * m).completed()
    wrong = bytearray(craft.command("noop").packets[0])
    wrong[3] += 1
    with pytest.raises(ground.NoAnswer, match="its checksum is wrong"):
        craft.send([bytes(wrong)]).accepted()
    assert craft.command("noop").completed() and craft.link.t == 2 * 10**9


def test_files_and_tables_go_to_flight_and_from_it(tmp_path):
    (tmp_path / "flight.py").write_text(FLIGHT + "    f.files = fsw.Files(entity=2, ground=1, rate=1000 / s, "
                                        "segment=50, allowed=7)\n    f.task('files', every=500 * ms, run=[f.files])\n")
    (tmp_path / "world.py").write_text(WORLD)
    with ground.connect(fledge.load(tmp_path)) as craft:
        flight = craft.link.simulation.flight
        craft.command("telemetry", "flight.files.state")
        (tmp_path / "table").write_bytes(flight.commands.table(flight.control, K=4))
        craft.put(tmp_path / "table", within=60 * s)
        craft.command("load_table", "flight.control", "table").completed()
        assert flight.control.K == 4
        craft.command("dump_table", "flight.control", "now").completed()
        assert craft.directory() == ["now", "table"]
        craft.fetch("now", tmp_path / "now", within=60 * s)
        assert (tmp_path / "now").read_bytes() == (tmp_path / "table").read_bytes()
        (tmp_path / "long").write_bytes(bytes(range(256)) * 20)
        craft.put(tmp_path / "long", within=60 * s)

        sent = craft.command("send_file", "long").started()
        assert repr(sent) == "<file send long: started>" and sent.progress == 0
        craft.wait(lambda _: 20 <= sent.progress < 100, within=10 * s)
        assert repr(sent) == f"<file send long: under way, {sent.progress} %>"
        assert sent.completed(60 * s).progress == 100 and repr(sent) == "<file send long: executed>"
        assert craft.files.received[-1].read_bytes() == (tmp_path / "long").read_bytes()
        lost = craft.command("send_file", "long").started()
        craft.command("control_file", FileAction.CANCEL, lost.reports[-1].detail).completed()
        with pytest.raises(ground.NoAnswer, match="refused file send long, at .* s: it was not done to its end: CFDP "
                                                  "ended it by its condition 15"):
            lost.completed(within=200 * s)
        assert craft.wait(lambda t: t.flight.files.state.failed == 1, within=2 * s).flight.files.state.received == 2


def test_telemetry_is_found_by_its_path(craft):
    with pytest.raises(ground.NotSeen):
        craft.telemetry.housekeeping
    with pytest.raises(ground.NoAnswer, match=r'no packet of flight.control.torque came within 3 s; command\("telemetry'
                                              r'", "flight.control.torque"\) turns it on'):
        craft.wait(lambda t: t.flight.control.torque.torque_B[0] < 9, within=3 * s)
    craft.command("telemetry", "flight.control.torque")
    craft.command("telemetry", "housekeeping", every=4)
    seen = craft.wait(lambda t: t.flight.control.torque.head.t >= 10 * 10**9, within=1 * fledge.units.minute)
    assert craft.link.simulation.time == 10
    torque = craft.link.simulation.flight.control.torque.torque_B.tolist()
    assert seen.flight.control.torque.torque_B == seen["flight.control.torque.torque_B"] == torque
    assert seen["flight.control.torque"]["head"]["quality"] == "QUALITY_GOOD"
    assert craft.wait(lambda t: t.housekeeping["executed"] == 2, within=2 * s).housekeeping["refused"] == 0
    with pytest.raises(ground.NoAnswer, match="the condition was not fulfilled within 1 s"):
        craft.wait(lambda t: t.housekeeping["executed"] == 5, within=1 * s)
    for wrong, says in [("flight.contrl.torque", "did you mean 'flight.control.torque'"),
                        ("flight.control.torque.tork_B", "did you mean 'torque_B'")]:
        with pytest.raises(SetupError, match=says):
            craft.telemetry[wrong]
    with pytest.raises(AttributeError, match="did you mean 'torque_B'"):
        craft.telemetry.flight.control.torque.tork_B


def test_the_mode_is_known_by_its_name(tmp_path):
    (tmp_path / "flight.py").write_text(FLIGHT)
    (tmp_path / "world.py").write_text(WORLD)
    with ground.connect(fledge.load(tmp_path)) as craft:
        craft.command("telemetry", "housekeeping")
        assert craft.wait(lambda t: t.mode, within=10 * s).mode == "wait"
        craft.command("mode", "rest").completed()
        seen = craft.wait(lambda t: t.flight.housekeeping.mode == "rest", within=1 * s)
        assert seen.mode == seen.flight.mode == seen["flight.housekeeping"]["mode"] == "rest"
        assert seen.flight.housekeeping.executed == seen.housekeeping["executed"] == 2
        with pytest.raises(SetupError, match="no output 'flight.housekeping'; did you mean 'flight.housekeeping'"):
            seen.flight.housekeping
        with pytest.raises(SetupError, match="has no mode 'ret'; did you mean 'rest'"):
            craft.command("mode", "ret")
    with ground.connect(fledge.load("nadir_spin")) as craft, pytest.raises(SetupError, match="has no modes"):
        craft.telemetry.mode


def test_a_ground_that_begins_anew_counts_on():
    sim = fledge.load("nadir_spin")
    first = ground.connect(sim)
    for _ in range(5):
        first.command("noop").completed()
    again = ground.connect(sim)
    two = again.command("noop"), again.command("write", "flight.control", K=2.0)
    assert two[1].completed().reports[-1].sequence == 6 and two[0].completed().reports[-1].sequence == 5
    assert again.command("noop").completed().reports[-1].sequence == 7
    assert sim.flight.commands.counters.executed == 8


def test_telemetry_goes_on_in_a_clone_and_after_a_snapshot():
    """The same packets, byte for byte, with their sequences."""
    sim = fledge.load("nadir_spin")
    commands = sim.flight.commands
    commands.take_packets()
    commands.telemetry()
    commands.telemetry("flight.control.torque", every=3)
    sim.run(5.5 * s)
    snapshot, other = sim.snapshot(), sim.clone()
    other.flight.commands.take_packets()
    commands.take_packets()
    sim.run(5 * s)
    other.run(5 * s)
    sent = commands.take_packets()
    assert len(sent) > 60 and other.flight.commands.take_packets() == sent
    sim.restore(snapshot)
    sim.run(5 * s)
    assert commands.take_packets() == sent


@pytest.fixture()
def served(tmp_path):
    return fledge.load(written(tmp_path / "served", SERVED, ""))


def test_events_reach_the_ground_each_once(served):
    with ground.connect(served) as craft:
        craft.command("monitor", 3, "flight.tracking.error.sigma_BR", measure="max_abs", high=1e-4).completed()
        craft.wait(lambda t: any(event.name == "FIRED" for event in t.events), within=1 * minute)
        fired = craft.events[-1]
        worst = max(map(abs, served.flight.tracking.error.sigma_BR.tolist()))
        assert str(fired).startswith("flight.monitors: FIRED monitor 3, value 0.") and fired.severity == "medium"
        assert fired.arguments["monitor"] == 3 and 0 < fired.arguments["value"] <= 1.1 * worst
        assert fired.output == "flight.monitors.event" and fired.before == 0 and "medium, t = " in repr(fired)
        before = list(craft.events)
        craft.command("events").completed()
        craft.listen(3 * s)
        assert craft.events == before
        again = ground.connect(served)
        again.command("events").completed()
        again.listen(3 * s)
        assert again.events == before


def test_chosen_numbers_reach_the_ground(served):
    paths = ["flight.vehicle.vehicle.I_B", "flight.vehicle.vehicle.I_B[2][1]", "flight.stored.state.next"]
    with ground.connect(served) as craft:
        with pytest.raises(ground.NoAnswer, match="no packet of selected 2 came within 1 s$"):
            craft.wait(lambda t: t.selected(2), within=1 * s)
        craft.command("housekeeping", 2, paths, every=5_000_000_000).completed()
        craft.listen(12 * s)
        assert craft.telemetry.selected(2) == {
            paths[0]: [[700, 0, 0], [0, 700, 0], [0, 0, 800]], paths[1]: 0, paths[2]: -1}
        assert craft.telemetry._contents["selected"].t == 10 * 10**9
        craft.command("housekeeping", 2, on=False).completed()
        craft.command("write", "flight.chosen", reports=[report(2**16 - 1)] + 7 * [report(0)]).completed()
        craft.listen(1 * s)
        assert served.flight.chosen.state.bad == 1


def report(output):
    choice = {"output": output, "offset": 16, "type": 0, "n": 1}
    return {"period": 0, "on": 1, "n": 1, "choices": 16 * [choice]}


def test_a_ground_that_begins_anew_learns_what_was_chosen(served, tmp_path):
    ground.connect(served).command("housekeeping", 0, ["flight.motor.command.u[1]"], every=0).completed()
    file = tmp_path / "packets.json"
    file.write_text(served.flight.commands.dictionary.text())
    craft = ground.Craft(ground.connect(served).link, Dictionary.load(file))
    craft.listen(2 * s)
    with pytest.raises(SetupError, match="another ground has defined the report 0 of flight"):
        craft.telemetry.selected(0)
    craft.dictionary.learn(craft.command("read", "flight.chosen", "reports").completed().data)
    craft.listen(1 * s)
    assert list(craft.telemetry.selected(0)) == ["flight.motor.command.u[1]"]


def test_what_cannot_be_chosen_is_refused(served, craft):
    packets, number = served.flight.commands.packets, "flight.log.state.kept"
    for call, says in (
            (lambda: packets.housekeeping(8, [number]), "flight.chosen has the reports 0 to 7; found 8"),
            (lambda: packets.housekeeping(0, 17 * [number]), "up to 16 numbers or fields; found 17"),
            (lambda: packets.housekeeping(0, ["flight.log.state"]), "flight.log.state is no number of an output"),
            (lambda: packets.filter_events(0, "flight.log.state", least="grave"), "no severity 'grave'"),
            (lambda: craft.command("housekeeping", 0, [number]), "has no module Housekeeping"),
    ):
        with pytest.raises(SetupError, match=says):
            call()


class Damaged(Link):
    """A link that loses, repeats and damages packets, over another."""

    def __init__(self, link, losses=(), repeats=()):
        self.link, self.losses, self.repeats, self.n = link, losses, repeats, 0

    @property
    def t(self):
        return self.link.t

    def send(self, packet):
        self.link.send(packet)

    def receive(self, until):
        packets = []
        for t, packet in self.link.receive(until):
            packets += [Timed(t, packet)] * (self.n not in self.losses) + [Timed(t, packet)] * (self.n in self.repeats)
            self.n += 1
        return packets + ([Timed(until, b"\x08\x80no packet")] if self.n in self.losses else [])


def test_lost_repeated_and_strange_packets_are_counted():
    inner = ground.connect(fledge.load("nadir_spin"))
    craft = ground.Craft(Damaged(inner.link, losses={8, 9, 20}, repeats={2, 12, 13}), inner.dictionary)
    craft.command("telemetry", "flight.control.torque").completed()
    craft.listen(20 * s)
    assert craft.missed == 3 and craft.refused > 0
    assert craft.command("noop").completed().reports[-1].executed


def test_a_report_that_is_lost_ends_in_no_answer():
    inner = ground.connect(fledge.load("nadir_spin"))
    craft = ground.Craft(Damaged(inner.link, losses={1}), inner.dictionary)
    with pytest.raises(ground.NoAnswer, match="<noop: accepted> was not reported as executed within 4 s"):
        craft.command("noop").completed(within=4 * s)


@pytest.mark.parametrize("call, says", [
    (lambda craft: craft.command("nop"), "there is no command 'nop'; did you mean 'noop'"),
    (lambda craft: craft.command("mode"), "mode takes mode: missing a required argument"),
    (lambda craft: craft.command("write", "flight.control"), "give parameters and their values"),
    (lambda craft: craft.command("write", "flight.contrl", K=1), "did you mean 'flight.control'"),
    (lambda craft: craft.command("write", "flight.control", K=1 * kg), "expected a quantity in N m; found 1.0 kg"),
    (lambda craft: craft.command("write", "flight.control", K="x"), "K is a double"),
    (lambda craft: craft.wait(lambda t: True, within="soon"), "within: expected a time"),
    (lambda craft: ground.connect("udp://127.0.0.1:1?listen=2"), "give the dictionary"),
    (lambda craft: ground.connect(fledge.load("constellation")), "4 flight processes; choose one"),
    (lambda craft: ground.connect(fledge.load("constellation"), process="sat1_flght"), "did you mean 'sat1_flight'"),
])
def test_what_a_script_gets_wrong_is_reported_at_once(craft, call, says):
    with pytest.raises(SetupError, match=says):
        call(craft)
    assert craft.sent == [] and craft.link.t == 0
