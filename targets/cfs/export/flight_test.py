# SPDX-License-Identifier: Apache-2.0
"""Exported apps fly: on the pocket cFE, in lock-step with their registers, they put out the desktop's bits."""

import struct
import subprocess
from dataclasses import replace

import pytest

import fledge
from fledge import export
from fledge.commands import Reason
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.export import around
from fledge.targets.cfs.export.folder import flown_by
from fledge.targets.cfs.testing import HERE, ROOT, Core, Outside, command, linked, telemetry
from fledge.export.testing import Recorded, objects_of
from fledge.disk import write_files
from tests.needs import skip_unless_on

NS = 1_000_000_000


def flown(name, folder, duration, compiler="gcc", order="little", runner=(), **more):
    """Fly an app with the inputs of the desktop's flight; (ticks, where it differs or None, the core's report)."""
    sim = fledge.load(name)
    mission = export.read(sim)
    app = cfs.App("fsw", order=order)
    cfs.write(mission, app, folder / "fsw", outputs="all", simulated=True)
    program = linked.build([(app, folder / "fsw")], folder / "run", compiler, **more)
    inputs, outputs = [m.path for m in mission.inputs], [m.path for m in mission.outputs]
    recorded = Recorded(sim, [*inputs, *outputs], sim.flight.tasks[0].period / NS)
    sim.run(duration)
    input_log = {p: recorded.samples(p) for p in inputs}
    recordings = {p: recorded.samples(p) for p in outputs}
    outside = Outside(mission, folder / "outside")
    core = Core(program, outside, runner=runner, app="FSW")
    try:
        outside.tick(-1)
        for i, t in enumerate(recorded.times()):
            for path, samples in input_log.items():
                outside.put(path, samples[i])
            outside.tick(t, 0)
            for path, samples in recordings.items():
                if outside.take(path, t) != samples[i]:
                    return i, (t, path), None
        outside.stop()
        return i, None, core.end()
    finally:
        core.kill()
        outside.close()


@pytest.mark.long("builds and flies apps of several missions")
def test_an_app_puts_out_the_same_bits(tmp_path):
    """Others fly in fledge/fly/fly_test.py, in the closed loop."""
    ticks, difference, report = flown("nadir_spin", tmp_path, 600.0)
    assert difference is None
    assert ticks >= 1200
    assert report["errors"] == 0 and report["overflow"] == 0


@pytest.mark.long("builds for other processors, flies in QEMU")
@pytest.mark.parametrize("machine, order", [("aarch64", "little"), ("sparc64", "big")])
def test_so_it_does_on_other_machines(machine, order, tmp_path):
    """Of another byte order, too: its tables are files of that order."""
    skip_unless_on(machine)
    compiler, runner = f"{machine}-linux-gnu-gcc", f"qemu-{machine}"
    _, difference, report = flown("nadir_spin", tmp_path, 30.0, compiler, order, [runner], options=("-O1", "-static"))
    assert difference is None
    assert report["errors"] == 0                        # no table was refused


@pytest.mark.long("builds an app")
def test_with_tables_of_the_wrong_order_it_flies_with_those_it_was_exported_with(tmp_path):
    _, difference, report = flown("nadir_spin", tmp_path, 5.0, order="big", options=("-O1",))
    assert difference is None
    assert report["errors"] == 18                       # each of 6: its layout, refused by cFE, defaults


@pytest.mark.long("builds with the thread sanitizer")
def test_main_and_child_task_race_nowhere(tmp_path):
    tried = subprocess.run(f"echo 'int main(void) {{ return 0; }}' > {tmp_path}/t.c && gcc -fsanitize=thread "
                           f"{tmp_path}/t.c -o {tmp_path}/t && {tmp_path}/t", shell=True, capture_output=True)
    if tried.returncode:
        pytest.skip("the thread sanitizer does not start here")
    ticks, difference, report = flown("nadir_spin", tmp_path, 20.0, options=("-O1", "-fsanitize=thread"))
    assert difference is None and report["events"] >= 3 and report["exit"] == 0


@pytest.mark.long("builds for a board")
def test_on_a_board_without_an_operating_system(tmp_path):
    """Registers are memory, tasks take turns, files are in memory: the same source, and the same bits."""
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    app = cfs.App("fsw")
    cfs.write(mission, app, tmp_path / "fsw", (), outputs="all")
    flags = [*linked.FLAGS, *linked.EXACT, "-O1", "-DTASK_STACK=65536", *linked.included()]
    objects = linked.compiled(app, tmp_path / "fsw", tmp_path / "o", options=["-O0"])
    flown_, _ = flown_by(mission, (), "all")
    write_files(flown_ | {"apps.c": around.app_list([app])}, tmp_path / "outside")
    pocket = [f for f in around.pocket_sources() if f.name not in ("host.c", "port_posix.c")]
    registers = [ROOT / "registers" / f"{name}.c" for name in ("lane", "field", "clock", "message")]
    ours = sorted((tmp_path / "outside").glob("*.c"))
    subprocess.run(list(map(str, ["gcc", *flags, f"-Dfledge_io={mission.name}_io", "-I", tmp_path / "outside", *pocket,
                                  *ours, *registers, ROOT / "targets/mission_io.c", HERE / "bare.c",
                                  HERE / "contexts.c", ROOT / "targets/bare/tasks.c", ROOT / "targets/bare/files.c",
                                  *objects, *objects_of(mission, tmp_path).values(), "-lm", "-o",
                                  tmp_path / "bare"])), check=True)
    inputs, outputs = [m.path for m in mission.inputs], [m.path for m in mission.outputs]
    recorded = Recorded(sim, [*inputs, *outputs], 0.5)
    sim.run(120.0)
    samples = {p: recorded.samples(p) for p in (*inputs, *outputs)}
    times = recorded.times()
    input_log = b"".join(t.to_bytes(8, "little") + b"".join(samples[p][i] for p in inputs) for i, t in enumerate(times))
    done = subprocess.run([tmp_path / "bare"], input=input_log, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout == b"".join(samples[p][i] for i in range(len(times)) for p in outputs)
    error = done.stderr.decode()
    assert error.count("keeps its defaults") == 6 and "The run has ended after 241 ticks" in error


def test_on_the_bus_alone_it_puts_out_the_same_bits(tmp_path):
    """Inputs are packets, and a scheduler's message wakes it: no registers, no child task."""
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    app = cfs.App("fsw", wakeup=0x18D0, wires={"world.nav.attitude": 0x0890})
    cfs.write(mission, app, tmp_path / "fsw")
    program = linked.build([(app, tmp_path / "fsw")], tmp_path / "run", options=["-O0", "-DFSW_TIME_FROM_MET=0"])
    inputs, outputs = [m.path for m in mission.inputs], [m.path for m in mission.outputs]
    recorded = Recorded(sim, [*inputs, *outputs], 0.5)
    sim.run(60.0)
    samples = {p: recorded.samples(p) for p in (*inputs, *outputs)}
    ids = app.ids(mission)
    core = Core(program, listen="0x08C0-0x08E0")
    try:
        core.until("FSW flies nadir_spin")
        core.send(telemetry(0x0890, b"too short"))
        core.until("FSW 25: world.nav.attitude has 25 bytes, expected 80")
        before = {}
        for i, t in enumerate(recorded.times()):
            for message in mission.inputs:
                core.send(telemetry(ids[f"FSW_{message.name.upper()}_IN_MID"], samples[message.path][i]))
            core.send(command(0x18D0, 0))
            for message in (m for m in mission.outputs if m.direction == "out"):    # others, when they are asked for
                raw = samples[message.path][i]
                if raw[12:16] != before.get(message.path, bytes(16))[12:16]:    # written anew: in the order of ids
                    packet = core.telemetry(ids[f"FSW_{message.name.upper()}_TLM_MID"])
                    assert packet[16:] == raw, (t, message.path)
                    assert 1_000_000 <= int.from_bytes(packet[6:10], "big") < 1_001_000     # spacecraft time
                before[message.path] = raw
        assert i == 120
    finally:
        core.kill()


@pytest.mark.long("builds an app")
def test_a_sender_without_a_head_gets_one_and_time_is_that_of_the_core(tmp_path):
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    app = cfs.App("fsw")
    cfs.write(mission, app, tmp_path / "fsw")
    program = linked.build([(app, tmp_path / "fsw")], tmp_path / "run", options=["-O0"])
    recorded = Recorded(sim, [m.path for m in mission.inputs], 0.5)
    sim.run(0.5)
    ids = app.ids(mission)
    core = Core(program, listen="0x08C0-0x08E0")
    try:
        core.until("FSW flies nadir_spin")
        for message in mission.inputs:
            core.send(telemetry(ids[f"FSW_{message.name.upper()}_IN_MID"],
                                bytes(16) + recorded.samples(message.path)[0][16:]))
        core.send(command(0x18C2, 0))
        wheels = core.telemetry(ids["FSW_MOTOR_COMMAND_TLM_MID"])
        t, quality, sequence = struct.unpack("<qiI", wheels[16:32])
        assert (quality, sequence) == (3, 1) and t % (NS // 2) == 0 and t < 60 * NS
        core.send(command(0x18C2, 0))                   # in the same half second: no new instant
        core.send(command(0x18C1, 0))
        assert struct.unpack_from("<q", core.telemetry(ids["FSW_HK_TLM_MID"]), 16)[0] in (t, t + NS // 2)
    finally:
        core.kill()


HK = f"<qBBH{19 + len(Reason) + len(Reason) % 2}I"
COUNTERS = {name: 4 + i for i, name in enumerate(
    "mode accepted executed refused".split())} | {name: 4 + 4 + len(Reason) + i for i, name in enumerate(
        "request_errors table_updates table_refusals ticks overdue wakeups_ignored io_refused io_corrupt io_saturated "
        "inputs inputs_refused inputs_missing wakeups_early wakeups_missing time_sets".split())} | {
            "time": 0, "inputs_stale": 3}


def built(app, folder):
    """(mission, app, program)"""
    mission = export.read(fledge.load("nadir_spin"))
    cfs.write(mission, app, folder / app.name)
    return mission, app, linked.build([(app, folder / app.name)], folder / "run", options=["-O0"])


@pytest.fixture(scope="module")
def on_bus(tmp_path_factory):
    """The same of an app that waits for wake-ups."""
    return built(cfs.App("fsw"), tmp_path_factory.mktemp("bus"))


class Bus(Core):
    def __init__(self, mission, app, program):
        super().__init__(program, listen="0x08C0-0x08FF")
        self.mission, self.app = mission, app
        self.ids = app.ids(mission)
        self.until(f"{app.prefix} flies nadir_spin, version ")

    def housekeeping(self):
        self.send(command(self.ids[f"{self.app.prefix}_SEND_HK_MID"], 0))
        values = struct.unpack(HK, self.telemetry(self.ids[f"{self.app.prefix}_HK_TLM_MID"])[16:])
        return {name: values[i] for name, i in COUNTERS.items()}

    def wake(self, met=None):
        if met is not None:
            self.write(f"met {met}")
        self.send(command(0x18C2, 0))


@pytest.mark.long("builds an app")
def test_wakeups_that_are_missing_or_too_many_are_reported_and_counted(on_bus):
    core = Bus(*on_bus)
    try:
        core.wake(met=10)
        counters = core.housekeeping()
        assert (counters["time"], counters["ticks"], counters["wakeups_missing"]) == (10 * NS, 1, 0)    # since 10 s
        for _ in range(4):
            core.wake(met=10)
        core.until("FSW 27: Wake-ups come too often: 1 within a step of 500 ms")
        core.until("FSW 27: Wake-ups come too often: 4 within")         # at the 1st, 2nd, 4th, 8th
        core.wake(met=20)
        core.until("FSW 28: 19 wake-ups are missing before 20 s of mission elapsed time, gap 1")
        counters = core.housekeeping()
        assert (counters["time"], counters["ticks"]) == (20 * NS, 2)
        assert (counters["wakeups_early"], counters["wakeups_ignored"], counters["wakeups_missing"]) == (4, 4, 19)
    finally:
        core.kill()


@pytest.mark.long("builds an app")
def test_wakeups_halfway_between_steps_are_regular(tmp_path):
    mission = export.read(fledge.load("nadir_spin"))
    mission = replace(mission, tasks=[replace(task, period=10 * NS) for task in mission.tasks])
    app = cfs.App("fsw")
    cfs.write(mission, app, tmp_path / "fsw")
    core = Bus(mission, app, linked.build([(app, tmp_path / "fsw")], tmp_path / "run", options=["-O0"]))
    try:
        for i, met in enumerate((15, 25, 34, 45, 54, 65)):      # some nearer to the step before
            core.wake(met=met)
            counters = core.housekeeping()
            assert (counters["time"], counters["ticks"], counters["wakeups_early"]) == ((20 + 10 * i) * NS, i + 1, 0)
        core.wake(met=73)                                       # too early to be the next
        counters = core.housekeeping()
        assert (counters["ticks"], counters["wakeups_early"], counters["wakeups_missing"]) == (6, 1, 0)
    finally:
        core.kill()


@pytest.mark.long("builds an app")
def test_flight_begins_anew_where_the_mission_elapsed_time_goes_back(on_bus):
    core = Bus(*on_bus)
    try:
        core.wake(met=5000)
        assert core.housekeeping()["time"] == 5000 * NS
        core.wake(met=100)
        core.until("FSW 29: The mission elapsed time went back from 5000 s to 100 s: flight begins anew")
        assert core.housekeeping()["time"] == 100 * NS
        core.wake(met=101)
        counters = core.housekeeping()
        assert [counters[name] for name in ("time", "ticks", "time_sets", "wakeups_missing")] == [101 * NS, 3, 1, 1]
        core.wake(met=100)                              # as at cFE's first tones
        counters = core.housekeeping()
        assert (counters["ticks"], counters["wakeups_early"], counters["time_sets"]) == (3, 1, 1)
    finally:
        core.kill()


def test_a_reset_and_no_operation_need_no_wakeup(on_bus):
    core = Bus(*on_bus)
    try:
        version = struct.pack(">H", export.dictionary(core.mission, 0x18C0).version)
        core.send(command(0x18C0, 0, sequence=5))
        core.until("FSW 2: Command 0 (no operation), sequence 5, is done; FSW ")
        core.wake(met=10)
        core.send(command(0x18C0, 7, version, sequence=6))
        core.until("FSW 2: Command 7 (reset flight), sequence 6, is done; FSW ")
        core.send(command(0x18C0, 1, sequence=7))
        core.until("FSW 2: Command 1 (reset counters), sequence 7, is done; FSW ")
        core.wake(met=11)
        assert core.housekeeping()["ticks"] == 2
    finally:
        core.kill()


def test_inputs_that_never_came_are_reported_and_configuration_comes_again(on_bus):
    core = Bus(*on_bus)
    try:
        vehicle = core.ids["FSW_VEHICLE_VEHICLE_TLM_MID"]
        version = export.dictionary(core.mission, 0x18C0).version
        core.send(command(0x18C0, 10, struct.pack(">4H", version, 0xFFFF, 1, 1)))    # telemetry of all outputs
        core.wake(met=10)
        core.telemetry(vehicle)
        assert core.housekeeping()["inputs_missing"] == 3
        core.reports("FSW 26: 3 inputs never came, the first is world.nav.attitude")
        core.send(telemetry(core.ids["FSW_NAV_ATTITUDE_IN_MID"], struct.pack("<qiI", 1, 3, 1) + bytes(48)))
        core.wake(met=11)                               # nothing new of the vehicle
        assert core.housekeeping()["inputs_missing"] == 2
        seen = len(core.all_of(vehicle))
        core.wake(met=12)                               # it was not sent between two requests
        core.telemetry(vehicle)
        assert (seen, len(core.all_of(vehicle))) == (1, 2)
    finally:
        core.kill()


def test_an_input_that_stops_coming_is_reported_once_and_counted_until_it_comes(on_bus):
    core = Bus(*on_bus)

    def come():
        core.send(telemetry(core.ids["FSW_NAV_ATTITUDE_IN_MID"], bytes(64)))    # its head is the app's to write

    try:
        for met in (10, 12, 14):                        # every 2 s
            come()
            core.wake(met=met)
            core.housekeeping()                         # it has flown
        core.send(telemetry(core.ids["FSW_WHEELS_SPEEDS_IN_MID"], bytes(80)))   # once: how often it comes is not known
        core.wake(met=34)                               # for ten of its steps
        assert core.housekeeping()["inputs_stale"] == 0
        core.wake(met=36)
        core.until("FSW 38: world.nav.attitude has not come for 22000 ms; it came every 2000 ms")
        core.wake(met=136)
        assert core.housekeeping()["inputs_stale"] == 1
        come()
        core.wake(met=137)
        assert core.housekeeping()["inputs_stale"] == 0
        assert len([line for line in core.seen if " 38: " in line]) == 1
    finally:
        core.kill()


@pytest.mark.long("waits for the clock")
def test_an_app_wakes_itself(tmp_path):
    core = Bus(*built(cfs.App("own", 0xE0, timer=True), tmp_path))
    try:
        first = counters = core.housekeeping()
        while counters["ticks"] < first["ticks"] + 4:
            assert counters["time"] % (NS // 2) == 0 or counters["time"] == -1
            counters = core.housekeeping()
        ticks = counters["ticks"] - first["ticks"]
        assert first["time"] < 0 or counters["time"] - first["time"] >= ticks * NS // 2
        assert counters["wakeups_early"] == 0
        core.stop()
        assert core.process.returncode == 0
    finally:
        core.kill()
