# SPDX-License-Identifier: Apache-2.0
"""Through the lanes of a board, flight has the same inputs and outputs; through words, to within their counts.
The outside's end here is the C of flight's end, called the other way round."""

import ctypes
import math
import random
import struct
import subprocess
from pathlib import Path

import pytest

import fledge
from fledge import export
from fledge.export import board as boards
from fledge.export.testing import ROOT, STRICT, Compiled, Recorded

GLUE = '''
#include "%(name)s_io.h"

#include <string.h>

volatile uint64_t memory[2][1 << 13];    /* of each board, aligned */
static RegisterWindow w[2];
static MissionIoCounts counts;
static Tick now;

void set_up(void)
{
    memset((void *)(uintptr_t)memory, 0, sizeof memory);
    memset(&counts, 0, sizeof counts);
    for (uint32_t i = 0u; i < %(name)s_io.n_boards; i++) {
        w[i] = register_window(%(name)s_io.boards[i], (volatile uint32_t *)memory[i]);
    }
}

void outside_put(uint32_t id, const void *message) { mission_io_put(&%(name)s_io, w, id, message, &counts); }
void outside_take(uint32_t id, void *message, int64_t t)
{
    mission_io_take(&%(name)s_io, w, id, message, t, &counts);
}

int exchange(%(struct)s *m, int64_t t)
{
    const RegisterWindow *clock = &w[mission_io_clock(&%(name)s_io)];
    register_clock_start(clock, (Tick){t, 0});
    if (!register_clock_due(clock, &now)) {
        return 1;
    }
    if (now.t < 0) {
        %(name)s_reset(m);
    } else {
        mission_io_read(&%(name)s_io, w, m, now.t, &counts);
        %(name)s_tick(m, now.t);
    }
    mission_io_write(&%(name)s_io, w, m, &counts);
    register_clock_finish(clock);
    return 0;
}

uint32_t trouble(int i) { return i == 0 ? counts.refused : i == 1 ? counts.corrupt : counts.saturated; }
'''


class OnBoard(Compiled):
    """A mission with its board, in one library; both sides of the board."""

    def __init__(self, mission, folder, files=(), outputs=()):
        folder = Path(folder)
        super().__init__(mission, folder / "c")
        self.messages = [*mission.inputs, *mission.outputs]
        self.ids = {m.path: i for i, m in enumerate(self.messages)}
        written = export.write(mission, folder, export.emit_board(mission, files, outputs))
        glue = folder / "glue.c"
        glue.write_text(GLUE % {"name": mission.name, "struct": mission.struct()})
        so = folder / "board.so"
        flags = [f for f in STRICT if f != "-Wstrict-prototypes"]
        sources = [path for path in written if path.suffix == ".c" and path.stem != mission.name]
        library = [ROOT / f"{name}.c" for name in ("registers/lane", "registers/field", "registers/clock",
                                                   "registers/message", "targets/mission_io",
                                                   "targets/mission_packets")]
        subprocess.run(["gcc", *flags, "-shared", "-fPIC", "-I", folder, "-I", ROOT, "-o", so, glue, *sources,
                        *library, self.so._name], check=True)
        self.board = ctypes.CDLL(str(so))
        self.board.set_up()

    def put(self, path, raw):
        self.board.outside_put(self.ids[path], raw)

    def take(self, path, t, held=b""):
        message = self.messages[self.ids[path]]
        raw = ctypes.create_string_buffer(held or bytes(message.struct.size), message.struct.size)
        self.board.outside_take(self.ids[path], raw, ctypes.c_int64(t))
        return raw.raw

    def tick(self, t):
        assert self.board.exchange(ctypes.c_void_p(self.address), ctypes.c_int64(t)) == 0

    def trouble(self):
        return [self.board.trouble(i) for i in range(3)]


@pytest.mark.long("compiles a board for each mission")
@pytest.mark.parametrize("name", ["nadir_spin", "asterisk_scan", "two_body_pointing"])
def test_messages_pass_whole(name, tmp_path):
    sim = fledge.load(name)
    mission = export.read(sim)
    c = OnBoard(mission, tmp_path, outputs="all")
    inputs = [m.path for m in mission.inputs]
    outputs = [m.path for m in mission.outputs]
    recorded = Recorded(sim, [*inputs, *outputs], 0.5)
    c.tick(-1)
    assert [c.take(p, 0) for p in outputs] == [c.get(p) for p in outputs]
    sim.run(600.0)
    input_log = {p: recorded.samples(p) for p in inputs}
    samples = {p: recorded.samples(p) for p in outputs}
    for i, t in enumerate(recorded.times()):
        for path in inputs:
            c.put(path, input_log[path][i])
        c.tick(t)
        for path in outputs:
            assert c.take(path, t) == samples[path][i], (path, t)
    assert i == 1200 and c.trouble() == [0, 0, 0]


# --- words -----------------------------------------------------------------------------------------

WORDS = '''
name  = "converters"
base  = 0xB0000000
size  = 0x1000
order = "little"
[clock]
address = 0x0
[[snorkel]]
name      = "attitude"
form      = "word"
direction = "read"
address   = 0x100
count     = 3
[[snorkel.field]]
name    = "sigma"
bits    = [0, 16]
signed  = true
scale   = 0.00005
carries = "world.nav.attitude.sigma_BN"
[[snorkel.field]]
name    = "omega"
bits    = [16, 16]
signed  = true
scale   = 0.00001
unit    = "rad/s"
carries = "world.nav.attitude.omega_BN_B"
[[snorkel]]
name      = "speeds"
form      = "word"
direction = "read"
address   = 0x120
count     = 4
[[snorkel.field]]
name    = "speed"
bits    = [0, 20]
signed  = true
scale   = 0.002
unit    = "rad/s"
carries = "world.wheels.speeds.Omega"
[[snorkel]]
name      = "quality"
form      = "word"
direction = "read"
address   = 0x140
[[snorkel.field]]
name    = "quality"
bits    = [4, 2]
carries = "world.wheels.speeds.head.quality"
[[snorkel]]
name      = "orbit"
form      = "message"
direction = "read"
address   = 0x200
size      = 88
carries   = "world.nav.orbit"
[[snorkel]]
name      = "second_wheel"
form      = "word"
direction = "write"
address   = 0x180
count     = 3
[[snorkel.field]]
name    = "torque"
bits    = [3, 14]
signed  = true
scale   = 0.00003
offset  = 0.001
unit    = "N m"
carries = "flight.motor.command.u[1]"
'''


def test_numbers_pass_in_words_to_the_nearest_count(tmp_path):
    (tmp_path / "converters.toml").write_text(WORDS)
    mission = export.read(fledge.load("nadir_spin"))
    c = OnBoard(mission, tmp_path / "out", [tmp_path / "converters.toml"])
    rng = random.Random(7)
    for k in range(1, 200):
        t = k * 500_000_000
        sigma, omega = [[rng.uniform(-a, a) for _ in range(3)] for a in (1.6, 0.3)]
        speeds = [rng.uniform(-1000, 1000) for _ in range(8)]
        quality = rng.randrange(4)
        c.put("world.nav.attitude", struct.pack("=qiI6d", 1, 2, 3, *sigma, *omega))
        c.put("world.wheels.speeds", struct.pack("=qiI8d", 1, quality, 3, *speeds))
        c.tick(t)
        seen = struct.unpack("=qiI6d", c.get("world.nav.attitude"))
        assert seen[:3] == (t, 3, k)          # measured now, good, and counted
        for number, value, step in zip(seen[3:], [*sigma, *omega], [5e-5] * 3 + [1e-5] * 3):
            assert abs(number - value) <= step / 2 * (1 + 1e-9)
            assert abs(number / step - round(number / step)) < 1e-6
        seen = struct.unpack("=qiI8d", c.get("world.wheels.speeds"))
        assert seen[:3] == (t, quality, k)
        assert all(abs(a - b) <= 0.001 * (1 + 1e-9) for a, b in zip(seen[3:7], speeds))
        assert seen[7:] == (0, 0, 0, 0)       # no word carries them
        values = struct.unpack("=qiI8d", c.get("flight.motor.command"))
        taken = struct.unpack("=qiI8d", c.take("flight.motor.command", t))
        assert taken[:3] == (t, 3, 1) and taken[3] == 0
        assert all(abs(a - b) <= 1.5e-5 * (1 + 1e-9) for a, b in zip(taken[4:7], values[4:7]))
    assert c.trouble() == [0, 0, 0]
    c.put("world.nav.attitude", struct.pack("=qiI6d", 1, 2, 3, 2.0, -2.0, math.nan, 0, 0, 0))
    c.tick(10**12)
    seen = struct.unpack("=qiI6d", c.get("world.nav.attitude"))
    assert seen[3:6] == (32767 * 5e-5, -32768 * 5e-5, -32768 * 5e-5) and c.trouble() == [0, 0, 3]


def test_what_is_no_message_is_as_if_never_written(tmp_path):
    mission = export.read(fledge.load("nadir_spin"))
    c = OnBoard(mission, tmp_path)
    c.put("world.nav.attitude", bytes(range(64)))
    c.tick(0)
    assert c.get("world.nav.attitude") == bytes(range(64))
    memory = (ctypes.c_uint8 * 65536).in_dll(c.board, "memory")
    for slot in range(4):                     # the first word of a payload tells its byte order
        at = boards.FIRST + 32 + 80 * slot + 8
        memory[at:at + 4] = [0, 7, 0, 0]
    c.tick(500_000_000)
    assert c.get("world.nav.attitude") == bytes(64) and c.trouble() == [0, 1, 0]


# --- what is wrong with a board --------------------------------------------------------------------

@pytest.mark.parametrize("change, complaint", [
    (('carries = "world.nav.attitude.sigma_BN"', 'carries = "world.nav.attitude.sigma"'),
     "converters.toml:19: world.nav.attitude has no field sigma; choose of head, sigma_BN, omega_BN_B"),
    (('carries   = "world.nav.orbit"', 'carries   = "world.nav.orbits"'),
     "there is no message world.nav.orbits in nadir_spin; choose of world.nav.attitude"),
    (('carries   = "world.nav.orbit"', ''),
     "converters.toml: flight reads world.nav.orbit (flight.guidance.orbit), which no snorkel carries; add one "
     'with carries = "world.nav.orbit"'),
    (('size      = 88', 'size      = 80'), "world.nav.orbit has 88 bytes; write size = 88"),
    (('carries = "flight.motor.command.u[1]"', 'carries = "flight.motor.command.u[6]"'),
     "flight.motor.command.u[6] has 2 numbers from there on; the snorkel has 3 words"),
    (('carries = "flight.motor.command.u[1]"', 'carries = "world.wheels.speeds.Omega[4]"'),
     'flight reads world.wheels.speeds; the snorkel\'s direction must be "read"'),
    (('unit    = "rad/s"\ncarries = "world.wheels', 'unit    = "deg/s"\ncarries = "world.wheels'),
     'world.wheels.speeds.Omega is in rad/s, the field in deg/s; write unit = "rad/s"'),
    (('carries = "world.wheels.speeds.head.quality"', 'carries = "world.wheels.speeds.Omega[3]"'),
     "converters.toml:48: world.wheels.speeds passes already by "),
    (('carries = "world.wheels.speeds.head.quality"', 'carries = "world.wheels.speeds.head"'),
     "world.wheels.speeds.head is a struct; name one of its numbers: t, quality, sequence"),
    (('carries = "world.wheels.speeds.head.quality"', 'carries = "world.wheels.speeds"'), "is no number"),
    (("[clock]\naddress = 0x0", ""), "no board has a clock"),
    (("address   = 0x120", "address   = 0x104"), "addresses do not overlap"),
])
def test_a_board_that_does_not_fit_is_refused_and_nothing_is_written(change, complaint, tmp_path):
    text = WORDS.replace(*change)
    assert text != WORDS
    file = tmp_path / "converters.toml"
    file.write_text(text)
    mission = export.read(fledge.load("nadir_spin"))
    with pytest.raises(export.ExportError) as refused:
        export.emit_board(mission, [file])
    assert complaint in str(refused.value)


QUEUES = """
[[snorkel]]
name      = "uplink"
doc       = "-"
form      = "packet"
direction = "read"
address   = 0x4000
capacity  = 1024
queue     = 4
carries   = "commands"
"""


def test_a_board_of_words_can_have_the_queues_too(tmp_path):
    mission = export.read(fledge.load("nadir_spin"))
    (tmp_path / "converters.toml").write_text(WORDS.replace("size  = 0x1000", "size  = 0x8000") + QUEUES)
    io = export.emit_board(mission, [tmp_path / "converters.toml"])["nadir_spin_io.c"]
    assert "{0u, CONVERTERS_LANE_UPLINK}," in io and "{MISSION_NO_BOARD, 0u}," in io and "packet, 1024u" in io


@pytest.mark.parametrize("change, complaint", [
    (("queue     = 4\n", ""), "commands pass in a queue of packets of variable size"),
    (("capacity  = 1024", "size = 1024"), "commands pass in a queue of packets of variable size"),
    (('"read"', '"write"'), 'direction = "read", a capacity and a queue'),
    (("capacity  = 1024", "capacity = 512"), "commands need a capacity of 528 bytes; it is 512"),
    (('"commands"', '"telemetry"'), 'direction = "write", a capacity and a queue'),
])
def test_a_queue_that_does_not_fit_is_refused(change, complaint, tmp_path):
    assert change[0] in QUEUES
    (tmp_path / "converters.toml").write_text(WORDS.replace("size  = 0x1000", "size  = 0x8000")
                                              + QUEUES.replace(*change))
    with pytest.raises(export.ExportError) as refused:
        export.emit_board(export.read(fledge.load("nadir_spin")), [tmp_path / "converters.toml"])
    assert complaint in str(refused.value)


def test_an_output_that_flight_does_not_have_is_refused():
    mission = export.read(fledge.load("nadir_spin"))
    with pytest.raises(export.ExportError, match="flight puts out no flight.motor.torque; it has flight.control.torq"):
        boards.toml(mission, ["flight.motor.torque"])


def test_the_same_mission_gives_the_same_files():
    first, two = (export.emit_board(export.read(fledge.load("asterisk_scan")), outputs="all") for _ in range(2))
    assert first == two and set(first) == {f"asterisk_scan_{e}" for e in
                                           ("board.toml", "board.h", "board.c", "board.md", "io.h", "io.c")}
