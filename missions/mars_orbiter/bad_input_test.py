# SPDX-License-Identifier: Apache-2.0
"""What the ground may do wrong. Each is refused with its reason in telemetry, and the orbiter ends in a mode that
defines where it points, by the truth."""
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from numpy import arccos, array
from numpy.linalg import norm

import fledge
from fledge import flight as fsw
from fledge import ground
from fledge.attitude import mrp_to_dcm
from fledge.commands import Action, Code, Reason, storing, table
from fledge.ground import NoAnswer
from fledge.mission.commands import block_bytes, fill_store
from fledge.units import kg, m, minute, s
from missions.mars_orbiter import insertion
from missions.mars_orbiter.vehicle import EPOCH, STORED
from tests.circles import long_after

LOCKED = 12 * minute        # by then -b1 is on the Sun and the attitude is known


@pytest.fixture()
def craft():
    with ground.connect(fledge.load("mars_orbiter")) as connected:
        connected.simulation = connected.link.simulation
        connected.events, take = [], connected.take

        def taken(packet):
            found = take(packet)
            if found is not None and found.path == "events" and found.content not in connected.events:
                connected.events.append(found.content)
            return found

        connected.take = taken
        connected.command("telemetry", "housekeeping")
        yield connected


def lock(craft, epoch=True):
    """As far as a contact brings it: the navigation is locked, and by the epoch the bodies are known."""
    craft.listen(LOCKED)
    if epoch:
        craft.command("write", "flight.epoch", clock_0=EPOCH, time_0=0 * s).completed()
        craft.listen(5 * s)


def off(craft):
    """[rad] Between -b1 and the Sun by the truth."""
    w = craft.simulation.process("world")
    state = w.craft.state
    to = array(w.sun.state.r_PN_N) - state.r_BN_N
    return arccos(-mrp_to_dcm(state.sigma_BN)[0] @ to / norm(to))


def refused(craft, why, what, *arguments, **values):
    with pytest.raises(NoAnswer, match=why):
        craft.command(what, *arguments, **values).completed(within=10 * s)


def ends_on_the_sun(craft, within=20 * minute):
    """The safe mode, and -b1 on the Sun."""
    assert craft.listen(within).mode == "safe" and off(craft) < 0.01


@pytest.mark.long("flies minutes of the orbiter")
def test_a_mode_before_its_time(craft):
    """Without an attitude, and without the bodies."""
    for mode in ("inertial", "mars", "delta_v"):
        refused(craft, "the mode's condition does not hold: .* only if .*differ.attitude", "mode", mode)
    lock(craft, epoch=False)
    for mode in ("sun", "mars", "two_body"):
        refused(craft, "the mode's condition does not hold: .*flight.sun_at.body", "mode", mode)
    assert craft.telemetry.housekeeping["reasons"] == {Reason.GUARDED: 6}
    ends_on_the_sun(craft)


@pytest.mark.long("flies minutes of the orbiter")
def test_commands_of_another_version(craft):
    """One to be executed now, one that is stored, and a sequence in a table."""
    packets = craft.link.simulation.flight.commands.packets
    other = craft.dictionary.version ^ 1
    lock(craft)
    old = packets.packet(Code.MODE, b"\0\6", other)
    with pytest.raises(NoAnswer, match="another version of the mission's dictionary"):
        craft.send([craft.numbered(old)]).completed()
    at = round((EPOCH.value + craft.simulation.time + 60) * 1e9)
    with pytest.raises(NoAnswer, match="another version of the mission's dictionary"):
        craft.send([craft.numbered(packets.store(0, 0, at, old))]).completed()
    stored = craft.simulation.flight.stored
    steps = [packets.store(1, 0, 0, old), packets.store(1, 1, 0, packets.noop())]
    load(craft, "stored", block_bytes(fill_store(fsw.StoredCommands(**STORED), steps)))
    craft.command("control", Action.START, 1).completed()
    craft.listen(5 * s)
    assert [(report.reason, report.stored_on) for report in craft.simulation.flight.commands.reports[-3:]] == [
        (Reason.VERSION, 1), (Reason.OK, 1), (Reason.OK, 1)] and stored.state.running == 0
    ends_on_the_sun(craft)


def load(craft, module, block, to=None, spoil=lambda file: file):
    """Bring a table on board as a file, and let it count."""
    name = f"flight.{module}"
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_bytes(spoil(table(craft.dictionary, name, block)))
        craft.put(path, to=to or module, within=1 * minute)
    if to is None:
        craft.command("load_table", name, module).completed(within=10 * s)


@pytest.mark.parametrize("spoil, why", long_after(1, [
    (lambda file: file[:40] + bytes([file[40] ^ 4]) + file[41:], "what is staged is not what it names"),
    (lambda file: file[:4] + bytes([file[4] ^ 1]) + file[5:], "another version of the mission's dictionary"),
    (lambda file: file[:-8], "its length is wrong")], "resets the computer"),
    ids=["a flipped bit", "another version", "its end is missing"])
def test_a_table_that_is_not_what_was_made(craft, spoil, why):
    """The old one stays, and so it does after a reset of the computer that finds such a table in boot."""
    f = craft.simulation.flight
    lock(craft)
    before = block_bytes(f.plan)
    good = block_bytes(fsw.BurnPlan(n=1, start=[5e8] * s, dv_N=[[0, 2, 0]] * m / s))
    with pytest.raises(NoAnswer, match=why):
        load(craft, "plan", good, spoil=spoil)
    assert block_bytes(f.plan) == before
    load(craft, "plan", good, to="boot/plan", spoil=spoil)
    craft.listen(1 * minute)                # until the recorder has it
    craft.events.clear()
    craft.command("write", "flight.power", reset_computer=1)
    craft.listen(2 * minute)
    assert f.boot.boot.boots == 2 and block_bytes(f.plan) == before and f.files.state.tables == 0
    assert "REFUSED" in [event.name for event in craft.events if event.output == "flight.files.event"]
    ends_on_the_sun(craft)


@pytest.mark.parametrize("mode, body", long_after(
    1, [("mars", "mars"), ("sun", "sun"), ("two_body", "earth")], "flies 24 min with another body"))
def test_an_ephemeris_that_ends(craft, mode, body):
    """Where it ends, the body stands still: telemetry says so, soon the Sun is safe, and the mode is refused."""
    lock(craft)
    craft.command("write", f"flight.{body}_at", duration=craft.simulation.time * s + 20 * minute).completed()
    craft.command("mode", mode).completed()
    assert craft.listen(20 * minute).mode == mode
    craft.events.clear()
    assert craft.listen(4 * minute).mode == "safe"
    assert [event.text for event in craft.events
            if event.output == "flight.monitors.event"] == ["FIRED monitor 5, value 2"]
    refused(craft, f"the mode's condition does not hold: .*{body}_at", "mode", mode)
    ends_on_the_sun(craft)


def test_two_sequences_that_contradict_each_other(craft):
    """The second one is not started. A list that runs is not started again, nor with a content that the ground does not
    know."""
    f = craft.simulation.flight
    packets = f.commands.packets
    lock(craft)
    steps = {number: packets.store_sequence(number, [(60 * 10**9, packets.mode(mode))])
             for number, mode in ((1, "sun"), (2, "inertial"))}
    for number in (2, 1):
        for step in steps[number]:
            craft.send([craft.numbered(step)]).completed()
    with pytest.raises(NoAnswer, match="not what it names"):
        craft.send([craft.numbered(packets.control(Action.START, 1, storing(steps[2])))]).completed()
    start = [craft.numbered(packets.control(Action.START, n, storing(steps[n]))) for n in (1, 2)]
    with pytest.raises(NoAnswer, match="another list asks for another mode at the same time"):
        craft.send(start).completed()
    refused(craft, "runs, stands or is held already", "control", Action.START, 1)
    craft.listen(2 * minute)
    done = [report for report in f.commands.reports if report.stored_on and report.executed]
    assert [report.stored_on for report in done] == [1] and done[0].good
    assert craft.telemetry.mode == "sun"
    craft.listen(20 * minute)
    assert norm(f.tracking.error.sigma_BR) < 1e-3


@pytest.mark.long("thousands of commands")
def test_a_ground_that_floods(craft):
    """2000 packets a second, PDUs of nothing, commands and rubbish: what finds no room is refused and counted, and a
    command after them counts."""
    f = craft.simulation.flight
    packets = f.commands.packets
    lock(craft)
    for _ in range(15):
        for k in range(200):
            f.commands.send([packets.pdu(bytes(500)), craft.numbered(packets.noop()), bytes([k]) * 40][k % 3])
        craft.simulation.run(0.1 * s)
    refusals = f.commands.counters.reasons
    assert refusals[Reason.LENGTH] == 990 and refusals[Reason.BUSY] > 100
    craft.command("mode", "inertial").completed()
    assert craft.listen(5 * minute).mode == "inertial" and f.boot.boot.boots == 1
    assert craft.telemetry.housekeeping["reasons"] == refusals
    craft.command("mode", "safe").completed()
    ends_on_the_sun(craft)


@pytest.mark.long("flies the insertion again")
@pytest.mark.parametrize("left", [0.01, 60], ids=["empty", "empty soon"])
def test_a_burn_without_propellant(left):
    flown = insertion.fly(fledge.load("mars_orbiter"), engines=lambda planned: {"propellant": [left] * kg})
    insertion.check_safe(flown, "NO_THRUST")
