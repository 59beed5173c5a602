# SPDX-License-Identifier: Apache-2.0
"""An exported app and its ground: commands, tables, housekeeping, events, and starting anew, on the pocket cFE."""

import struct

import pytest

import fledge
from fledge import export
from fledge.export import cfs
from fledge.export.cfs import tables
from fledge.export.cfs.testing import Core, Outside, command, linked
from fledge.export.run_test import FLIGHT, WORLD

CMD, SEND_HK, WAKEUP, HK = 0x18C0, 0x18C1, 0x18C2, 0x08C0
HOUSEKEEPING = ("time commands command_errors spare bad_checksum bad_length unknown_code refused mode table_updates "
                "table_refusals ticks overdue wakeups_ignored io_refused io_corrupt io_saturated inputs "
                "inputs_refused").split()


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
    program = linked.build([(app, folder / "nav")], folder / "run", options=["-O1"])
    outside = Outside(mission, folder / "outside")
    outside.close()
    return mission, app, folder, program, outside


@pytest.fixture()
def core(built):
    outside = built[4].begin()
    core = Core(built[3], outside, listen="0x08C0-0x08E0")
    core.outside = outside
    try:
        core.until("NAV flies modes")
        yield core
    finally:
        core.kill()
        outside.close()


def housekeeping(core, first=None):
    """What the app tells when asked; `first` is said before."""
    core.send(command(SEND_HK, 0))
    if first:
        core.until(first)
    raw = core.telemetry(HK)
    assert len(raw) == 88
    return dict(zip(HOUSEKEEPING, struct.unpack("<qBBH15I", raw[16:]), strict=True)) | {
        "stamp": struct.unpack(">IH", raw[6:12])}


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


def load(name, file):
    return command(CMD, 3, struct.pack("16s64s", name.encode(), file.encode()))


def test_noop_and_reset_of_the_counters(core):
    core.send(command(CMD, 0))
    core.until("NAV 2: No operation: NAV version ")
    core.send(command(CMD, 9))
    core.until("NAV 23:")
    assert {k: v for k, v in housekeeping(core).items() if v} == {
        "time": -1, "commands": 1, "command_errors": 1, "unknown_code": 1, "stamp": (0, 0)}
    core.send(command(CMD, 1))
    core.until("NAV 3: Counters are reset")
    assert {k: v for k, v in housekeeping(core).items() if v} == {"time": -1, "stamp": (0, 0)}


REFUSED = [
    (command(CMD, 0, checksum=0x17), "NAV 21: Command refused: its checksum is wrong; code, found 0", "bad_checksum"),
    (bytes.fromhex("18c0c000000000"), "NAV 22: Command refused: it is shorter than its header, found 7", "bad_length"),
    (command(CMD, 0, b"x"), "NAV 22: Command refused: its length is not that of its code, found 9", "bad_length"),
    (command(CMD, 2, b"\0\0\0"), "NAV 22: Command refused: its length is not that of its code, found 11",
     "bad_length"),
    (command(CMD, 5), "NAV 23: Command refused: its code is unknown, found 5", "unknown_code"),
    (command(CMD, 127), "NAV 23: Command refused: its code is unknown, found 127", "unknown_code"),
    (command(CMD, 2, struct.pack("<I", 3)), "NAV 5: Command refused: there is no such mode, found 3", "refused"),
    (command(SEND_HK, 0, b"xx"), "NAV 22: A request has 10 bytes, expected 8", "bad_length"),
    (command(WAKEUP, 0, b"xx"), "NAV 22: A request has 10 bytes, expected 8", "bad_length"),
    (load("Nothing", "/cf/nav_control.tbl"), "NAV 7: Table Nothing is not loaded", "refused"),
    (load("Control", "/cf/absent.tbl"), "NAV 7: Table Control is not loaded from /cf/absent.tbl: 0xCC00002C",
     "refused"),
    (load("Control", "/cf/nav_motor.tbl"), "NAV 7: Table Control is not loaded", "refused"),
]


@pytest.mark.parametrize("packet, event, counter", REFUSED, ids=[f"{p[:8].hex()}" for p, _, _ in REFUSED])
def test_what_is_refused_is_an_event_and_a_counter(core, packet, event, counter):
    core.send(packet)
    core.until(event)
    found = housekeeping(core)
    assert found["commands"] == 0 and found["command_errors"] == 1 and found[counter] == 1
    assert sum(found[c] for c in ("bad_checksum", "bad_length", "unknown_code", "refused")) == 1


def test_a_wakeup_without_a_tick_changes_nothing(core):
    core.send(command(WAKEUP, 0))
    assert housekeeping(core)["wakeups_ignored"] == 1


def test_a_pipe_that_is_full_of_commands_lets_the_rest_in(built):
    core = Core(built[3], listen="0x08C0", hold=True)
    try:
        core.until("NAV flies modes")
        for _ in range(6):                          # the app still waits for the system to be operational
            core.send(command(CMD, 0))
        for _ in range(2):
            core.until("CFE_SB 17: Message 0x18C0 lost: too many of them wait in pipe NAV_PIPE")
        core.write("go")
        assert housekeeping(core)["commands"] == 4
        assert core.stop()["overflow"] == 2
    finally:
        core.kill()


def test_a_mode_is_entered_at_the_next_tick(core):
    core.outside.tick(-1)
    core.outside.tick(0)
    assert housekeeping(core)["mode"] == 0
    core.send(command(CMD, 2, struct.pack("<I", 1)))
    core.until("NAV 4: Mode 1 is entered at the next tick")
    assert housekeeping(core)["mode"] == 0
    core.outside.tick(100_000_000)
    found = housekeeping(core)
    assert found["mode"] == 1 and found["ticks"] == 2 and found["time"] == 100_000_000
    assert found["stamp"] == (0, int(0.1 * 2**16))


def test_parameters_from_the_ground_count_from_the_next_tick(core, built):
    mission = built[0]
    vehicle = "flight.vehicle.vehicle"
    at = next(f.offset for m in mission.outputs if m.path == vehicle for f in m.struct.fields if f.name == "I_B")
    core.outside.tick(-1)
    core.outside.tick(0)
    assert struct.unpack_from("<d", core.outside.take(vehicle, 0), at)[0] == 700.0
    core.send(load("Vehicle", table_file(built, "Vehicle", I_B=[600.0, 0, 0, 0, 700, 0, 0, 0, 800])))
    core.until("NAV 6: Table Vehicle is loaded from /ram/new.tbl")
    core.outside.tick(100_000_000)
    assert struct.unpack_from("<d", core.outside.take(vehicle, 0), at)[0] == 600.0
    # Again, by the services of the tables: nothing counts before the request for housekeeping.
    file = table_file(built, "Vehicle", I_B=[650.0, 0, 0, 0, 700, 0, 0, 0, 800])
    core.send(command(0x1804, 2, struct.pack("64s", file.encode())))
    core.send(command(0x1804, 4, struct.pack("H40s", 0, b"NAV.Vehicle")))
    assert housekeeping(core, "CFE_TBL 13: NAV.Vehicle: the load is valid")["table_updates"] == 1
    core.send(command(0x1804, 5, struct.pack("40s", b"NAV.Vehicle")))
    assert housekeeping(core, "NAV 30: Table Vehicle is in effect")["table_updates"] == 2
    core.outside.tick(200_000_000)
    assert struct.unpack_from("<d", core.outside.take(vehicle, 0), at)[0] == 650.0
    assert housekeeping(core)["table_updates"] == 2


@pytest.mark.parametrize("table, change, says", [
    ("Control", {"K": [0.0]}, "NAV 32: Control.K, number 0, must be 0 or of size 1e-100 to 1e100, > 0 N m"),
    ("Control", {"K_I": [float("nan")]}, "Control.K_I, number 0, must be 0 or of size 1e-100 to 1e100, >= 0 N m / s"),
    ("Control", {"P": [45.0, 0, 0, 0, float("inf")]}, "Control.P, number 4, must be 0 or of size 1e-100 to 1e100"),
    ("Vehicle", {"I_B": [-1.0]}, "NAV 32: Vehicle.I_B, number 0, must be 0 or of size 1e-100 to 1e100, inertia"),
])
def test_parameters_that_break_a_rule_stay_out(core, built, table, change, says):
    core.send(load(table, table_file(built, table, **change)))
    core.until(says)
    core.until(f"NAV 7: Table {table} is not loaded from /ram/new.tbl: 0xFFFFFFFF")
    found = housekeeping(core)
    assert found["table_refusals"] == 1 and found["refused"] == 1 and found["table_updates"] == 0


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


def test_outputs_go_out_as_packets_stamped_by_flight(core, built):
    mission = built[0]
    core.outside.tick(-1)
    core.outside.tick(0)
    ids = {m.path: 0x08C1 + i for i, m in enumerate(mission.outputs)}
    wheels = core.telemetry(ids["flight.wheels.wheels"])
    assert wheels[16:] == core.outside.take("flight.wheels.wheels", 0)
    assert struct.unpack(">IH", wheels[6:12]) == (0, 0)
    core.outside.tick(100_000_000)
    core.send(load("Wheels", table_file(built, "Wheels", J=[0.25])))
    core.until("NAV 6: Table Wheels is loaded")
    core.outside.tick(200_000_000)
    wheels = core.telemetry(ids["flight.wheels.wheels"])    # not again before it was written again
    assert struct.unpack(">H", wheels[2:4])[0] == 0xC002 and wheels[16:24] == struct.pack("<q", 100_000_000)


def test_flight_begins_anew_where_it_is_told_to(core):
    core.outside.tick(-1)
    core.outside.tick(0)
    core.outside.tick(700_000_000)
    core.send(command(CMD, 4))
    core.until("NAV 8: Flight is reset")
    core.outside.tick(800_000_000)
    assert core.outside.take("flight.wheels.wheels", 0)[12:16] == struct.pack("<I", 1)   # published once since


def test_an_app_that_is_started_again_in_place_flies_on_from_nothing(core):
    core.outside.tick(-1)
    core.outside.tick(0)
    core.outside.tick(100_000_000)
    core.send(command(CMD, 0))
    core.until("NAV 2:")
    for _ in range(3):
        core.write("restart NAV")
        core.until("CFE_ES_ExitApp: NAV ends with status 5")
        core.until("NAV flies modes")
        found = housekeeping(core)
        assert (found["ticks"], found["commands"], found["time"]) == (0, 0, -1)
        core.outside.tick(200_000_000)              # it still has the registers, and the time is theirs
        found = housekeeping(core)
        assert (found["ticks"], found["time"]) == (1, 200_000_000)
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
    program = linked.build([(app, tmp_path / "nav")], tmp_path / "run", options=["-O1"])
    vehicle = "flight.vehicle.vehicle"
    at = next(f.offset for m in mission.outputs if m.path == vehicle for f in m.struct.fields if f.name == "I_B")
    outside = built[4].begin()
    core = Core(program, outside, listen="0x08C0-0x08E0")
    try:
        core.until("NAV flies modes")
        outside.tick(-1)
        outside.tick(0)
        file = table_file(built, "Vehicle", I_B=[600.0, 0, 0, 0, 700, 0, 0, 0, 800])
        (tmp_path / "run/ram/new.tbl").write_bytes((built[2] / "run/ram/new.tbl").read_bytes())
        core.send(load("Vehicle", file))
        core.until("NAV 6: Table Vehicle is loaded")
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


def test_two_apps_at_one_register_file_are_told(tmp_path, built):
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
