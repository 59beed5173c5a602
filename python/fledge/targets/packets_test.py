# SPDX-License-Identifier: Apache-2.0
"""Missions behind boards whose packets, with descriptors and in queues, carry their messages."""

import re

import pytest

from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.targets import TARGETS

HEAD = '''
name  = "bus"
base  = 0xA0000000
size  = 0x4000
order = "big"

[clock]
address = 0x0
'''

SENSORS = '''
[[snorkel]]
name       = "sensors"
doc        = "three kinds of packets in one queue, behind a header of three bytes"
form       = "packet"
direction  = "read"
address    = 0x100
capacity   = 160
queue      = 8
descriptor = {address = 0x40, length = [0, 12], tag = [16, 8], valid = [31, 1]}
add        = [0xAA, 0x55, 0x01]
[[snorkel.field]]
name    = "speed"
at      = 3
type    = "f64"
order   = "little"
count   = 8
unit    = "rad/s"
carries = "world.wheels.speeds.Omega"
[[snorkel.field]]
name    = "sigma"
tag     = 2
at      = 11
type    = "f64"
count   = 3
carries = "world.nav.attitude.sigma_BN"
[[snorkel.field]]
name    = "rate"
tag     = 2
at      = 35
type    = "f64"
order   = "little"
count   = 3
carries = "world.nav.attitude.omega_BN_B"
[[snorkel.field]]
name    = "position"
tag     = 200
at      = 80
type    = "f64"
count   = 3
carries = "world.nav.orbit.r_BN_N"
[[snorkel.field]]
name    = "velocity"
tag     = 200
at      = 3
type    = "f64"
count   = 3
carries = "world.nav.orbit.v_BN_N"
[[snorkel.field]]
name    = "acceleration"
tag     = 200
at      = 27
type    = "f64"
count   = 3
carries = "world.nav.orbit.a_BN_N"
'''

MOTORS = '''
[[snorkel]]
name       = "motors"
form       = "packet"
direction  = "write"
address    = 0x1000
size       = 70
queue      = 4
remove     = 4
descriptor = {address = 0x80}
[[snorkel.field]]
name    = "torque"
at      = 6
type    = "f64"
count   = 8
unit    = "N m"
carries = "flight.motor.command.u"
'''

SAME = '''
[[bound]]
field   = "flight.tracking.error.sigma_BR"
at_most = 0
[[bound]]
field   = "flight.motor.command.u"
at_most = 0
'''


def fly(folder, text, *options, on="linux", duration="3min", mission="nadir_spin"):
    folder.mkdir(exist_ok=True)
    board = folder / "bus.toml"
    board.write_text(text)
    return cli.main(["fly", mission, "--on", on, "--for", duration, "--board", str(board), "--out", str(folder / "out"),
                     *options])


@pytest.mark.long("builds boards")
def test_packets_with_descriptors_in_queues_carry_numbers_to_the_bit(tmp_path, capsys):
    """Only the heads are written anew: the numbers of a closed loop are the desktop's, on machines of both orders."""
    on = ",".join(name for name in ("linux", "aarch64", "sparc64", "cfs", "leon3") if not TARGETS[name].missing())
    assert fly(tmp_path, HEAD + SENSORS + MOTORS + SAME, on=on) == 0, capsys.readouterr()
    assert "within 0" in capsys.readouterr().out
    desktop = Archive(tmp_path / "out/desktop.mcap")
    flown = [Archive(tmp_path / f"out/{name}.mcap") for name in on.split(",")]
    outputs = [t for t in desktop.topics if t.startswith("/flight/")]
    for flight in flown:
        assert compare(desktop, flight, outputs, ignore=["sequence"]) == []
        assert compare(flown[0], flight, outputs) == []
    page = (tmp_path / "out/c/bus.md").read_text()
    assert "| 35..58, 2 | rate | 3 x f64, little-endian, - | |  |" in page
    header = (tmp_path / "out/c/bus.h").read_text()
    assert re.search(r"#define BUS_SENSORS_RATE_AT +0x23u", header)


def line_of(text, words):
    return text[:text.index(words)].count("\n") + 1


@pytest.mark.parametrize("old, new, where, complaint", [
    ('tag     = 2\nat      = 35', 'at      = 88', "world.nav.attitude.omega",
     "a packet carries numbers of one message, and line {first} of world.wheels.speeds; give world.nav.attitude"),
    ("count   = 8\nunit    = \"rad/s\"", "count   = 9\nunit    = \"rad/s\"", "world.wheels.speeds.Omega",
     "world.wheels.speeds.Omega has 8 numbers from there on; the field has 9"),
    ('unit    = "N m"', 'unit    = "A"', "flight.motor.command.u", "flight.motor.command.u is in N m, the field in A"),
    ('direction  = "write"', 'direction  = "read"', "flight.motor.command.u",
     'flight puts out flight.motor.command; the snorkel\'s direction must be "write"'),
    ("world.nav.orbit.r_BN_N", "world.nav.orbit.head", "world.nav.orbit.head", "world.nav.orbit.head is a struct"),
    ("world.nav.orbit.v_BN_N", "world.nav.orbit.r_BN_N[1]",
     "world.nav.orbit.r_BN_N[1]", "world.nav.orbit.r_BN_N[1] has 2 numbers from"),
])
def test_packets_that_cannot_carry_are_refused_with_their_line(tmp_path, capsys, old, new, where, complaint):
    text = (HEAD + SENSORS + MOTORS).replace(old, new)
    assert fly(tmp_path, text, duration="10s") == 2
    complaint = complaint.format(first=line_of(text, "world.wheels.speeds.Omega"))
    assert f"bus.toml:{line_of(text, where)}: {complaint}" in capsys.readouterr().err


@pytest.mark.long("builds boards")
def test_a_second_clock_that_paces_is_refused(tmp_path, capsys):
    other = tmp_path / "other.toml"
    other.write_text(HEAD.replace("bus", "other").replace("0xA", "0xB"))
    board = tmp_path / "bus.toml"
    board.write_text(HEAD + SENSORS + MOTORS)
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--for", "5s", "--board", str(board), str(other)]) == 2
    assert f"{other}: {board} has a [clock] already, which paces flight; write [slave_clock]" in capsys.readouterr().err
    slave = HEAD.replace("bus", "other").replace("0xA", "0xB").replace("[clock]", "[slave_clock]\ndrift = -3.5")
    other.write_text(slave)
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--for", "5s", "--board", str(board), str(other), "--out",
                     str(tmp_path / "out")]) == 0
    assert ".drift" not in (source := (tmp_path / "out/c/other.c").read_text()) and "-3500, 100000," in source


COMPUTER = '''
name = "computer"
base = 0xA0001000
[clock]
[[snorkel]]
name      = "motors"
form      = "packet"
direction = "write"
carries   = "flight.motor.command"
'''

UNITS = '''
name = "units"
base = 0xA0000000
[interrupts]
lines = ["wheels"]
level = 12
[[snorkel]]
name      = "wheels"
form      = "packet"
direction = "read"
interrupt = "wheels"
carries   = "world.wheels.speeds"
[[snorkel]]
name      = "navigation"
form      = "packet"
direction = "read"
carries   = ["world.nav.attitude.omega_BN_B", "world.nav.attitude.sigma_BN"]
[[snorkel]]
name      = "orbit"
form      = "packet"
direction = "read"
carries   = "world.nav.orbit"
'''


def boards(folder, **texts):
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text.lstrip())
    return folder


@pytest.mark.long("builds two boards")
def test_a_mission_has_the_boards_of_a_folder(tmp_path, capsys):
    """Whose packets carry messages by their name alone; the same if each file is named."""
    folder = boards(tmp_path / "boards", computer=COMPUTER, units=UNITS)
    on = ",".join(name for name in ("linux", "sparc64", "cfs", "leon3", "micropython") if not TARGETS[name].missing())
    assert cli.main(["fly", "nadir_spin", "--on", on, "--for", "30s", "--board", str(folder), "--within",
                     "tracking.error.sigma_BR=0", "--out", str(tmp_path / "out")]) == 0, capsys.readouterr()
    assert "30 s, through computer.toml, units.toml" in capsys.readouterr().out
    desktop = Archive(tmp_path / "out/desktop.mcap")
    outputs = [t for t in desktop.topics if t.startswith("/flight/")]
    for name in on.split(","):
        assert compare(desktop, Archive(tmp_path / f"out/{name}.mcap"), outputs, ignore=["sequence"]) == []
    page = (tmp_path / "out/c/units.md").read_text()
    assert "level 12 of the processor" in page and "| 24..47, 0 | sigma_bn | 3 x f64, big-endian, - |" in page
    apart = [word for name in ("computer", "units") for word in ("--board", str(folder / f"{name}.toml"))]
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--for", "1s", *apart, "--out", str(tmp_path / "two")]) == 0
    assert cli.main(["export", "c", "nadir_spin", *apart, "--out", str(tmp_path / "c")]) == 0
    for name in ("units.h", "computer.h", "nadir_spin_io.c"):
        assert (tmp_path / "c" / name).read_text() == (tmp_path / "out/c" / name).read_text()


@pytest.mark.parametrize("more, complaint", [
    ({"more": UNITS.replace('"units"', '"more"').replace("0xA0000000", "0xA0002000")},
     "{units}:11: world.wheels.speeds passes already by {more}:11"),
    ({"more": 'name = "more"\nbase = 0xA0001010\n[interrupts]\nlines = ["a"]\n'},
     "{more}:1: boards do not overlap; more [0xa0001010, 0xa0001030) overlaps computer [0xa0001000, 0xa0001160) of "
     "{computer}; move one"),
    ({"more": UNITS.replace("0xA0000000", "0xA0002000")},
     "{units}:1: boards' names differ; `units` is also {more}'s; rename one"),
    ({"units": UNITS.replace("world.nav.orbit", "world.nav.orbits")},
     "there is no message world.nav.orbits in nadir_spin; choose of world.nav.attitude, "),
    ({"units": UNITS.replace("omega_BN_B", "omega")},
     "world.nav.attitude has no numbers world.nav.attitude.omega; it has world.nav.attitude.sigma_BN, world.nav.att"),
    ({"units": UNITS.replace("world.wheels.speeds", "flight.motor.command")},
     'flight puts out flight.motor.command; the snorkel\'s direction must be "write"'),
    ({"units": UNITS[:UNITS.index('[[snorkel]]\nname      = "orbit"')]},
     "flight reads world.nav.orbit (flight.guidance.orbit), which no snorkel carries"),
    ({"computer": COMPUTER.replace("[clock]\n", "")}, "no board has a clock"),
])
def test_boards_that_do_not_fit_together_are_refused_with_their_files(tmp_path, capsys, more, complaint):
    folder = boards(tmp_path / "boards", **{"computer": COMPUTER, "units": UNITS} | more)
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--for", "1s", "--board", str(folder)]) == 2
    files = {name: folder / f"{name}.toml" for name in ("computer", "units", "more")}
    assert complaint.format(**files) in capsys.readouterr().err


def test_a_folder_without_boards_is_refused(tmp_path, capsys):
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--for", "1s", "--board", str(tmp_path)]) == 2
    assert f"{tmp_path}: the folder of boards has no file *.toml" in capsys.readouterr().err
