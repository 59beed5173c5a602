# SPDX-License-Identifier: Apache-2.0
"""An exported app and its ground: commands, tables, housekeeping, events, and starting anew, on the pocket cFE."""

import struct

import pytest

import fledge
from fledge import commands, export
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.export import tables
from fledge.targets.cfs.testing import Core, Outside, command, linked
from fledge.export.run_test import FLIGHT, WORLD

pytestmark = pytest.mark.long("builds apps with cFE's interface, flies each")

CMD, SEND_HK, WAKEUP = 0x18C0, 0x18C1, 0x18C2
FLIGHT_TLM, REPORT = 0x08C0, 0x08C1
REASONS = [reason.name.lower() for reason in commands.Reason]
HOUSEKEEPING = ("time command_counter command_errors spare mode accepted executed refused", " ".join(REASONS),
                "request_errors table_updates table_refusals ticks overdue wakeups_ignored io_refused io_corrupt "
                "io_saturated inputs inputs_refused inputs_missing wakeups_early "
                "wakeups_missing time_sets", "spare_too " * (len(REASONS) % 2))
HOUSEKEEPING = " ".join(HOUSEKEEPING).split()


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """(mission with modes, app, folder, program, the outside of its registers)."""
    folder = tmp_path_factory.mktemp("commands")
    modes = folder / "modes"
    modes.mkdir()
    (modes / "flight.py").write_text(FLIGHT)
    (modes / "world.py").write_text(WORLD)
    mission = export.read(fledge.load(modes))
    app = cfs.App("nav")
    cfs.write(mission, app, folder / "nav", outputs="all", simulated=True)
    program = linked.build([(app, folder / "nav")], folder / "run", options=["-O0"], loaded=True)
    outside = Outside(mission, folder / "outside")
    outside.close()
    return mission, app, folder, program, outside


@pytest.fixture()
def core(built):
    outside = built[4].begin()
    core = Core(built[3], outside, listen="0x08C0-0x08E0")
    core.outside = outside
    core.app, core.mission = built[1], built[0]
    core.version = struct.pack(">H", export.dictionary(built[0], CMD).version)
    try:
        core.until("NAV flies modes")
        yield core
    finally:
        core.kill()
        outside.close()


def housekeeping(core, first=None):
    """The housekeeping that the app sends on request, after the line `first`."""
    core.send(command(SEND_HK, 0))
    if first:
        core.until(first)
    raw = core.telemetry(core.app.ids(core.mission)["NAV_HK_TLM_MID"])
    values = dict(zip(HOUSEKEEPING, struct.unpack(f"<qBBH{len(HOUSEKEEPING) - 4}I", raw[16:]), strict=True))
    assert values["command_counter"] == values["accepted"] % 256
    assert values["command_errors"] == (values["refused"] + values["request_errors"]) % 256
    assert values["refused"] == sum(values[reason] for reason in REASONS)
    assert 1_000_000 <= int.from_bytes(raw[6:10], "big") < 1_001_000     # spacecraft time, as cFE counts by default
    return values


def flown(core, code, *arguments, sequence=0):
    """A command for this dictionary; `arguments` are of 16 bits."""
    version = int.from_bytes(core.version, "big")
    return command(CMD, code, struct.pack(f">{1 + len(arguments)}H", version, *arguments), sequence=sequence)


def report(core):
    """The next report: t, sequence, code, executed, reason, detail, bytes."""
    raw = core.telemetry(REPORT)
    t, sequence, code, executed, reason, detail, n = struct.unpack_from("<q6H", raw, 16)
    assert len(raw) == 16 + 24 + n
    return t, sequence, code, executed, REASONS[reason], detail, raw[40:]


def table_file(built, name, **changes):
    """Write a .tbl with parameters changed by (field, values) into /ram; returns its name there."""
    mission, app, folder = built[:3]
    table = next(t for t in tables.tables(mission, app) if t.name == name)
    content = bytearray(table.content)
    for field, values in changes.items():
        at = next(f.offset for f in table.fields if f.name == field) - table.start
        content[at:at + 8 * len(values)] = struct.pack(f"<{len(values)}d", *values)
    table.content = bytes(content)
    (folder / "run/ram/new.tbl").write_bytes(tables.tbl(app, table))
    return "/ram/new.tbl"


def upload(core, name, file):
    """Replace a table by the services of cFE: load, validate, activate."""
    table = f"NAV.{name}".encode()
    core.send(command(0x1804, 2, struct.pack("64s", file.encode())))
    core.send(command(0x1804, 4, struct.pack("H40s", 0, table)))
    housekeeping(core)
    core.send(command(0x1804, 5, struct.pack("40s", table)))
    return housekeeping(core)


def test_noop_and_reset_of_the_counters(core):
    core.outside.tick(-1)
    core.send(command(CMD, 0, sequence=7))
    assert report(core) == (-1, 7, 0, 0, "ok", 0, b"")      # accepted, and done at the next instant
    core.send(command(CMD, 9))
    assert report(core) == (-1, 0, 9, 0, "length", 0, b"")
    core.reports("NAV 3: Command 9 (read), sequence 0, is refused: length")
    core.outside.tick(0)
    assert report(core) == (0, 7, 0, 1, "ok", 0, b"")
    core.reports("NAV 2: Command 0 (no operation), sequence 7, is done; NAV ")
    counters = housekeeping(core)
    assert (counters["accepted"], counters["executed"], counters["refused"], counters["length"]) == (1, 1, 1, 1)
    core.send(command(CMD, 1))
    report(core)
    core.outside.tick(100_000_000)
    core.reports("NAV 2: Command 1 (reset counters), sequence 0, is done")
    assert {k: v for k, v in housekeeping(core).items() if v} == {
        "time": 100_000_000, "ticks": 2, "inputs_missing": 3}


WORDS = {"unknown": "unknown code", "absent": "no interpreter"}
REFUSED = [
    (command(CMD, 0, checksum=0x17), "checksum"),
    (bytes.fromhex("18c0c000000000"), "length"),
    (command(CMD, 0, b"x"), "length"),
    (command(CMD, 2, b"\0\0\0"), "length"),
    (command(CMD, 64), "unknown"),
    (command(CMD, 127), "unknown"),
    (command(CMD, 2, bytes(4)), "version"),
    (lambda core: flown(core, 2, 3), "place"),
    (lambda core: flown(core, 6, 99), "place"),
    (lambda core: flown(core, 10, 0, 2, 1), "value"),
    (lambda core: flown(core, 10, 0, 1, 0), "value"),
    (lambda core: flown(core, 13, 0), "absent"),
]


@pytest.mark.parametrize("packet, reason", REFUSED)
def test_what_is_refused_is_an_event_a_report_and_a_counter(core, packet, reason):
    core.send(packet(core) if callable(packet) else packet)
    assert report(core)[3:5] == (0, reason)
    core.reports(f"is refused: {WORDS.get(reason, reason)}")
    counters = housekeeping(core)
    assert counters["accepted"] == 0 and counters["refused"] == 1 and counters[reason] == 1


@pytest.mark.parametrize("packet", [command(SEND_HK, 0, b"xx"), command(WAKEUP, 0, b"xx")])
def test_a_request_of_the_wrong_length_is_reported(core, packet):
    core.send(packet)
    core.until("NAV 22: A request has 10 bytes, expected 8")
    assert housekeeping(core)["request_errors"] == 1


def test_a_wakeup_without_a_tick_changes_nothing(core):
    core.send(command(WAKEUP, 0))
    assert housekeeping(core)["wakeups_ignored"] == 1


def test_a_pipe_that_is_full_of_commands_lets_the_rest_in(built):
    core = Core(built[3], listen="0x08C0-0x08E0", hold=True)
    core.app, core.mission = built[1], built[0]
    try:
        core.until("NAV flies modes")
        for _ in range(6):                          # the app still waits for the system to be operational
            core.send(command(CMD, 0))
        for _ in range(2):
            core.until("CFE_SB 17: Message 0x18C0 lost: too many of them wait in pipe NAV_PIPE")
        core.write("go")
        assert housekeeping(core)["accepted"] == 4
        assert core.stop()["overflow"] == 2
    finally:
        core.kill()


def test_a_mode_is_entered_at_the_next_tick(core):
    core.outside.tick(-1)
    core.outside.tick(0)
    core.send(flown(core, 2, 1, sequence=5))
    assert report(core) == (0, 5, 2, 0, "ok", 0, b"")
    assert housekeeping(core)["mode"] == 0
    core.outside.tick(100_000_000)
    assert report(core) == (100_000_000, 5, 2, 1, "ok", 0, b"")
    counters = housekeeping(core)
    assert counters["mode"] == 1 and counters["ticks"] == 2 and counters["time"] == 100_000_000


def inertia(core):
    """I_B[0][0] as flight publishes it."""
    message = next(m for m in core.mission.outputs if m.path == "flight.vehicle.vehicle")
    at = next(f.offset for f in message.struct.fields if f.name == "I_B")
    return struct.unpack_from("<d", core.outside.take(message.path, 0), at)[0]


def test_parameters_come_by_command_and_by_table_and_the_table_shows_both(core, built):
    """flight/command writes flight's memory, cFE's table services check and bring files: the table has what flies."""
    core.outside.tick(-1)
    core.outside.tick(0)
    assert inertia(core) == 700.0
    for packet in commands.Packets(export.dictionary(core.mission, CMD)).write("flight.vehicle", I_B=[
            [600.0, 0, 0], [0, 700, 0], [0, 0, 800]]):
        core.send(packet)
        assert report(core)[3:5] == (0, "ok")
    core.outside.tick(100_000_000)
    assert report(core)[3:5] == (1, "ok")
    assert inertia(core) == 600.0
    assert upload(core, "Vehicle", table_file(built, "Vehicle", I_B=[650.0, 0, 0, 0, 700, 0, 0, 0, 800]))[
        "table_updates"] == 1
    core.outside.tick(200_000_000)
    assert inertia(core) == 650.0
    assert housekeeping(core)["table_updates"] == 1     # what came by command was no update of a table


@pytest.mark.parametrize("table, change, says", [
    ("Control", {"K": [0.0]}, "NAV 32: Control.K, number 0, must be 0 or of size 1e-100 to 1e100, > 0 N m"),
    ("Control", {"K_I": [float("nan")]}, "Control.K_I, number 0, must be 0 or of size 1e-100 to 1e100, >= 0 N m / s"),
    ("Control", {"P": [45.0, 0, 0, 0, float("inf")]}, "Control.P, number 4, must be 0 or of size 1e-100 to 1e100"),
    ("Vehicle", {"I_B": [-1.0]}, "NAV 32: Vehicle.I_B, number 0, must be 0 or of size 1e-100 to 1e100, inertia"),
])
def test_parameters_that_break_a_rule_stay_out(core, built, table, change, says):
    result = upload(core, table, table_file(built, table, **change))
    assert any(says in line for line in core.seen)
    assert result["table_refusals"] == 1 and result["table_updates"] == 0


def test_without_its_tables_it_flies_with_those_it_was_exported_with(built):
    folder, program = built[2:4]
    stored = {file: file.read_bytes() for file in (folder / "run/cf").glob("*.tbl")}
    try:
        for file in stored:
            file.unlink()
        core = Core(program, listen="0x08C0")
        try:
            for _ in stored:
                core.until("NAV 33: Table")
            core.until("NAV flies modes")
        finally:
            core.kill()
    finally:
        for file, raw in stored.items():
            file.write_bytes(raw)


def test_outputs_go_out_as_packets_at_the_commanded_rate(core):
    mission = core.mission
    core.outside.tick(-1)
    place = [m.path for m in mission.outputs].index("flight.wheels.wheels")
    core.send(flown(core, 10, place, 1, 2))             # every second writing
    report(core)
    core.outside.tick(0)
    report(core)
    for i in range(1, 5):
        core.send(flown(core, 6, 1))                    # the module of the wheels publishes
        report(core)
        core.outside.tick(i * 100_000_000)
        report(core)
    sent = [bytes.fromhex(line[4:]) for line in core.seen if line.startswith(f"TLM {0x08C2 + place:04x}")]
    for k, (wheels, t) in enumerate(zip(sent, (100_000_000, 300_000_000), strict=True)):
        assert struct.unpack(">H", wheels[2:4])[0] == 0xC000 + k and struct.unpack("<q", wheels[16:24])[0] == t


def test_flight_begins_anew_where_it_is_commanded_to(core):
    core.outside.tick(-1)
    core.outside.tick(0)
    core.outside.tick(700_000_000)
    core.send(flown(core, 7))
    report(core)
    core.outside.tick(800_000_000)
    assert report(core)[3:5] == (1, "ok")
    assert core.outside.take("flight.wheels.wheels", 0)[12:16] == struct.pack("<I", 1)   # published once since


def test_an_app_that_is_started_again_in_place_flies_on_from_nothing(core):
    core.outside.tick(-1)
    core.outside.tick(0)
    core.outside.tick(100_000_000)
    core.send(command(CMD, 0))
    report(core)
    for _ in range(3):
        core.write("restart NAV")
        core.until("CFE_ES_ExitApp: NAV ends with status 5")
        core.until("NAV flies modes")
        counters = housekeeping(core)
        assert (counters["ticks"], counters["accepted"], counters["time"]) == (0, 0, -1)
        core.outside.tick(200_000_000)              # it still has the registers, and the time is theirs
        counters = housekeeping(core)
        assert (counters["ticks"], counters["time"]) == (1, 200_000_000)
        assert core.outside.take("flight.wheels.wheels", 0)[12:16] == struct.pack("<I", 1)


def test_it_ends_with_the_run_and_with_its_surroundings(built):
    program, outside = built[3], built[4].begin()
    core = Core(program, outside)
    try:
        outside.tick(-1)
        outside.tick(0)
        outside.stop()
        core.until("NAV 43: The run has ended after 1 ticks")
        report = core.end()
        assert core.process.returncode == 0 and report["errors"] == 0
    finally:
        core.kill()
        outside.close()
    outside.begin()
    core = Core(program, outside)
    try:
        outside.tick(-1)
        outside.close()                                # as if the other process were gone
        core.until("NAV 41: The outside of the registers has ended without saying so")
        core.end()
        assert core.process.returncode == 1
    finally:
        core.kill()
        outside.close()


def test_what_is_kept_outlives_the_app_and_the_rest_begins_anew(built, tmp_path):
    mission = built[0]
    app = cfs.App("nav", keep=["parameters", "flight.control"])
    cfs.write(mission, app, tmp_path / "nav", outputs="all", simulated=True)
    program = linked.build([(app, tmp_path / "nav")], tmp_path / "run", options=["-O0"], loaded=True)
    vehicle = "flight.vehicle.vehicle"
    at = next(f.offset for m in mission.outputs if m.path == vehicle for f in m.struct.fields if f.name == "I_B")
    outside = built[4].begin()
    core = Core(program, outside, listen="0x08C0-0x08E0")
    core.app, core.mission = app, mission
    try:
        core.until("NAV flies modes")
        outside.tick(-1)
        outside.tick(0)
        file = table_file(built, "Vehicle", I_B=[600.0, 0, 0, 0, 700, 0, 0, 0, 800])
        (tmp_path / "run/ram/new.tbl").write_bytes((built[2] / "run/ram/new.tbl").read_bytes())
        upload(core, "Vehicle", file)
        outside.tick(100_000_000)
        core.write("restart NAV")
        core.until("NAV 35: Flight has what was kept")
        core.until("NAV 40: The registers are there")
        outside.tick(200_000_000)
        assert struct.unpack_from("<d", outside.take(vehicle, 0), at)[0] == 600.0
        assert outside.take(vehicle, 0)[12:16] == struct.pack("<I", 1)      # flight itself began anew
    finally:
        core.kill()
        outside.close()


def test_two_apps_at_one_register_file_are_reported(tmp_path, built):
    mission, _, _, _, outside = built
    apps = [(cfs.App("nav"), tmp_path / "nav"), (cfs.App("two", 0xE0), tmp_path / "two")]
    for app, folder in apps:
        cfs.write(mission, app, folder, outputs="all", simulated=True)
    program = linked.build(apps, tmp_path / "run", options=["-O0"])
    outside.begin()
    core = Core(program, outside, variables={"TWO_REGISTERS": f"/dev/fd/{outside.fd}"})
    try:
        line = core.until(lambda line: " 41: Registers /dev/fd/" in line)
        assert ("NAV 41" in line and line.endswith(": the app TWO")) or ("TWO 41" in line and
                                                                         line.endswith(": the app NAV"))
        outside.tick(-1)
        outside.tick(0)                             # the other one flies
    finally:
        core.kill()
        outside.close()


def test_an_app_tells_what_it_waits_for(built):
    core = Core(built[3], variables={"NAV_REGISTERS": "/dev/shm/fledge_no_such_registers"})
    try:
        core.until("NAV 44: Waits for the registers in /dev/shm/fledge_no_such_registers")
    finally:
        core.kill()


def test_a_restart_in_the_middle_of_a_table_load_loses_the_load_and_is_reported(core, built):
    core.outside.tick(-1)
    core.outside.tick(0)
    file = table_file(built, "Vehicle", I_B=[600.0, 0, 0, 0, 700, 0, 0, 0, 800])
    core.send(command(0x1804, 2, struct.pack("64s", file.encode())))
    core.until("CFE_TBL 12: Command 2 accepted /ram/new.tbl")
    core.write("restart NAV")
    core.until("NAV 40: The registers are there")
    core.send(command(0x1804, 4, struct.pack("H40s", 0, b"NAV.Vehicle")))
    core.until("CFE_TBL 50: Command 4 refused")         # there is no load
    core.outside.tick(100_000_000)
    assert inertia(core) == 700.0
    assert core.stop()["table_errors"] == 1


def test_a_table_that_is_cut_is_refused(core, built):
    """cFE loads it, and the rest of the table keeps what it had."""
    core.outside.tick(-1)
    core.outside.tick(0)
    file = table_file(built, "Vehicle", I_B=[600.0, 0, 0, 0, 710, 0, 0, 0, 800])
    path = built[2] / "run/ram/new.tbl"
    raw = bytearray(path.read_bytes())
    raw[72:76] = struct.pack(">I", 8 + 24)              # as long as the header says
    path.write_bytes(raw[:116 + 8 + 24])
    assert upload(core, "Vehicle", file)["table_refusals"] == 1
    core.reports("NAV 37: Vehicle is cut or damaged: its bytes do not fit its check 0x0001")
    assert inertia(core) == 700.0
