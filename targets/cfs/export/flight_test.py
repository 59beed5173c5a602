# SPDX-License-Identifier: Apache-2.0
"""Exported apps fly: on the pocket cFE, in lock-step with their registers, they put out the desktop's bits."""

import shutil
import struct
import subprocess

import pytest

import fledge
from fledge import export
from fledge.targets.cfs import export as cfs
from fledge.targets.cfs.export import around
from fledge.targets.cfs.export.folder import flown_by
from fledge.targets.cfs.testing import HERE, ROOT, Core, Outside, command, linked, telemetry
from fledge.export.testing import Recorded, fly
from fledge.files import write_files

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
    said = {p: recorded.samples(p) for p in outputs}
    outside = Outside(mission, folder / "outside")
    core = Core(program, outside, runner=runner, app="FSW")
    try:
        outside.tick(-1)
        for i, t in enumerate(recorded.times()):
            for path, samples in input_log.items():
                outside.put(path, samples[i])
            outside.tick(t, 0)
            for path, samples in said.items():
                if outside.take(path, t) != samples[i]:
                    return i, (t, path), None
        outside.stop()
        return i, None, core.end()
    finally:
        core.kill()
        outside.close()


def test_an_app_puts_out_the_same_bits(tmp_path):
    """Others fly in fledge/fly/fly_test.py, in the closed loop."""
    ticks, difference, report = flown("nadir_spin", tmp_path, 600.0)
    assert difference is None
    assert ticks >= 1200
    assert report["errors"] == 0 and report["overflow"] == 0


@pytest.mark.parametrize("machine, order", [("aarch64", "little"), ("sparc64", "big")])
def test_so_it_does_on_other_machines(machine, order, tmp_path):
    """Of another byte order, too: its tables are files of that order."""
    compiler, runner = f"{machine}-linux-gnu-gcc", f"qemu-{machine}"
    for program in (compiler, runner):
        if not shutil.which(program):
            pytest.skip(f"{program} is not installed")
    _, difference, report = flown("nadir_spin", tmp_path, 30.0, compiler, order, [runner], options=("-O1", "-static"))
    assert difference is None
    assert report["errors"] == 0                        # no table was refused


def test_with_tables_of_the_wrong_order_it_flies_with_those_it_was_exported_with(tmp_path):
    _, difference, report = flown("nadir_spin", tmp_path, 5.0, order="big", options=("-O1",))
    assert difference is None
    assert report["errors"] == 18                       # each of 6: its layout, refused by cFE, defaults


def test_main_and_child_task_race_nowhere(tmp_path):
    tried = subprocess.run(f"echo 'int main(void) {{ return 0; }}' > {tmp_path}/t.c && gcc -fsanitize=thread "
                           f"{tmp_path}/t.c -o {tmp_path}/t && {tmp_path}/t", shell=True, capture_output=True)
    if tried.returncode:
        pytest.skip("the thread sanitizer does not start here")
    ticks, difference, report = flown("nadir_spin", tmp_path, 20.0, options=("-O1", "-fsanitize=thread"))
    assert difference is None and report["events"] >= 3 and report["exit"] == 0


def test_on_a_board_without_an_operating_system(tmp_path):
    """Registers are memory, tasks take turns, there are no files: the same source, and the same bits."""
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    app = cfs.App("fsw")
    cfs.write(mission, app, tmp_path / "fsw", (), outputs="all")
    flags = [*linked.FLAGS, *linked.EXACT, "-O1", *linked.included()]
    objects = linked.compiled(app, tmp_path / "fsw", tmp_path / "o", options=["-O1"])
    flown_, _ = flown_by(mission, (), "all")
    write_files(flown_ | {"apps.c": around.app_list([app])}, tmp_path / "outside")
    pocket = [f for f in around.pocket_sources() if f.name not in ("host.c", "port_posix.c")]
    registers = [ROOT / "registers" / f"{name}.c" for name in ("lane", "field", "clock", "message")]
    ours = sorted((tmp_path / "outside").glob("*.c"))
    subprocess.run(list(map(str, ["gcc", *flags, f"-Dfledge_io={mission.name}_io", "-I", tmp_path / "outside", *pocket,
                                  *ours, *registers, ROOT / "targets/mission_io.c", HERE / "bare.c", HERE /
                                  "port_bare.c", *objects, fly("gcc", "-O2"), "-lm", "-o", tmp_path / "bare"])),
                   check=True)
    inputs, outputs = [m.path for m in mission.inputs], [m.path for m in mission.outputs]
    recorded = Recorded(sim, [*inputs, *outputs], 0.5)
    sim.run(120.0)
    samples = {p: recorded.samples(p) for p in (*inputs, *outputs)}
    times = recorded.times()
    input_log = b"".join(t.to_bytes(8, "little") + b"".join(samples[p][i] for p in inputs) for i, t in enumerate(times))
    done = subprocess.run([tmp_path / "bare"], input=input_log, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout == b"".join(samples[p][i] for i in range(len(times)) for p in outputs)
    said = done.stderr.decode()
    assert said.count("keeps its defaults") == 6 and "The run has ended after 241 ticks" in said


def test_on_the_bus_alone_it_puts_out_the_same_bits(tmp_path):
    """Inputs are packets, and a scheduler's message wakes it: no registers, no child task."""
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    app = cfs.App("fsw", wakeup=0x18D0, wires={"world.nav.attitude": 0x0890})
    cfs.write(mission, app, tmp_path / "fsw")
    program = linked.build([(app, tmp_path / "fsw")], tmp_path / "run", options=["-O1", "-DFSW_TIME_FROM_MET=0"])
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
                    assert struct.unpack(">IH", packet[6:12]) == (t // NS, t % NS * 2**16 // NS)
                before[message.path] = raw
        assert i == 120
    finally:
        core.kill()


def test_a_sender_without_a_head_gets_one_and_time_is_that_of_the_core(tmp_path):
    sim = fledge.load("nadir_spin")
    mission = export.read(sim)
    app = cfs.App("fsw")
    cfs.write(mission, app, tmp_path / "fsw")
    program = linked.build([(app, tmp_path / "fsw")], tmp_path / "run", options=["-O1"])
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
