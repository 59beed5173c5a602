# SPDX-License-Identifier: Apache-2.0
"""A LEON3 in software, in the hands of an engineer: in the loop, in Python, under gdb, traced, covered, profiled."""

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

import fledge
from fledge import emulator, objects
from fledge.programs import without_preload
from fledge.targets.build import native
from fledge.targets.leon3.board import BOARD
from fledge.targets.leon3.board import program as leon3_program
from fledge.units import N, m, s
from tests.needs import flies_on, needs, skip_without
from tests.waiting import PATIENCE, wait_for

pytestmark = flies_on("leon3")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fly")


@pytest.fixture
def board(folder):
    return emulator.load("nadir_spin", folder=folder)


def every_output(sim):
    return [port for task in sim.flight.tasks for port in (getattr(sim.flight, name) for name in task.run)]


def test_the_computer_flies_to_the_bit_as_the_desktop_does(board):
    desktop = fledge.load("nadir_spin")
    for sim in (board.sim, desktop):
        sim.record(*every_output(sim), sim.world.craft, every=0)
        sim.run(10)
    assert len(desktop.records) >= 8
    for ours, theirs in zip(board.sim.records, desktop.records, strict=True):
        assert (ours.path, ours.times(), ours.bytes()) == (theirs.path, theirs.times(), theirs.bytes())
    assert board.core.instructions > 100_000        # and it is not the desktop that flew
    assert objects.memory(board.sim.flight.control) != objects.memory(desktop.flight.control)


def test_what_would_have_no_effect_is_refused(board):
    """Before the boot, which sets all variables; and in the modules of the simulation, which do not fly."""
    for write in (lambda: setattr(board.flight.control, "K", 3 * N * m), lambda: board.flip("flight.control.K", 3),
                  lambda: board.poke("flight.control.K", bytes(8))):
        with pytest.raises(fledge.SetupError, match="flight.control.K: the program sets its variables when it boots, "
                                                    r"at the first instant, .* sim.step\(\) first, or give the "):
            write()
    board.watchpoint("flight.control.K", 8)
    snapshot = board.snapshot()
    board.sim.step()
    board.flight.control.K = 3 * N * m
    board.sim.step()
    assert board.flight.control.K == 3.0
    for name in ("K", "newest"):
        with pytest.raises(fledge.SetupError, match=f"flight.control.{name}: a computer flies this process, and "
                                                    "nothing reads what is assigned here: .* "
                                                    f"board.flight.control.{name} = "):
            setattr(board.sim.flight.control, name, 1.0)
    with pytest.raises(fledge.SetupError, match="flight.control.newest is memory of a module, and a computer flies it: "
                                                "read board.flight.control.newest"):
        board.sim.flight.control.newest
    with pytest.raises(fledge.SetupError, match="flight: a computer flies this process, and requests and commands here "
                                                r"do not reach it. .* board.in_flight.script.append\(\(after, packet"):
        board.sim.flight.commands.noop()
    packet, = board.sim.flight.commands.packets.write("flight.control", K=4.0)
    board.in_flight.script.append((board.sim.time_ns, packet))
    board.sim.step(10)
    assert board.flight.control.K == 4.0
    board.restore(snapshot)
    with pytest.raises(fledge.SetupError, match="sets its variables when it boots"):
        board.flight.control.K = 3 * N * m


def test_variables_of_flight_are_read_and_written_by_their_names(board):
    board.sim.run(5)
    f = board.flight
    assert f.control.K == 2.531 and f.control.P[1, 1] == 45.0 and f.tracking.sigma_BcB.tolist() == [0, 0, 1]
    assert f.tracking.error.sigma_BR.tolist() == board.sim.flight.tracking.error.sigma_BR.tolist()
    assert f.motor.command.head.t == 5_000_000_000
    f.control.K = 3 * N * m
    f.tracking.sigma_BcB = [0.0, 0.0, 0.5]
    assert f.control.K == 3.0 and f.tracking.sigma_BcB.tolist() == [0, 0, 0.5]
    assert board.peek("fledge_mission", 4) != bytes(4)
    changed = fledge.load("nadir_spin")
    changed.run(5)
    changed.flight.control.K = 3 * N * m
    changed.flight.tracking.sigma_BcB = [0.0, 0.0, 0.5]
    for sim in (board.sim, changed):
        sim.run(5)
    assert objects.memory(board.sim.flight.motor.command) == objects.memory(changed.flight.motor.command)


@pytest.mark.parametrize("attempt, complaint", [
    (lambda f: setattr(f.control, "K", 3 * s), "flight.control.K: expected a quantity in N m; found"),
    (lambda f: setattr(f.control, "P", [1.0, 2.0]), r"flight.control.P has shape \[3, 3\]; found \[2\]"),
    (lambda f: setattr(f.control, "error", 1.0), "flight.control.error is a struct; write its numbers"),
    (lambda f: f.control.k, "flight.control has no 'k'; did you mean 'K'"),
    (lambda f: f.controls, "flight has no 'controls'; did you mean 'control'"),
    (lambda f: setattr(f, "control", 1), "flight.control: set a field of it"),
])
def test_a_wrong_variable_is_refused_with_advice(board, attempt, complaint):
    with pytest.raises((AttributeError, fledge.SetupError), match=complaint):
        attempt(board.flight)


def test_computer_and_world_go_back_together(board, tmp_path):
    board.sim.run(5)
    start = board.snapshot()
    ends = []
    for _ in range(2):
        board.sim.run(5)
        ends.append((objects.memory(board.sim.flight.motor.command), objects.memory(board.sim.world.craft.state),
                     board.registers, board.core.instructions))
        board.restore(start)
    assert ends[0] == ends[1]
    board.flip("%f2", 30)       # and another flight after a fault
    board.flight.tracking.sigma_BcB = [0.0, 0.0, 0.9]
    board.sim.run(5)
    assert objects.memory(board.sim.flight.motor.command) != ends[0][0]
    board.save(tmp_path / "state")
    before = board.registers
    board.step(100)
    assert board.registers != before
    board.load(tmp_path / "state")
    assert board.registers == before


def test_breakpoints_watchpoints_and_steps_stop_the_computer(board):
    board.sim.run(1)
    update = board.address("mrp_feedback_update")
    stops = []
    board.on_stop = lambda reason: stops.append((reason, board.registers["%pc"], board.flight.control.newest))
    board.breakpoint("mrp_feedback_update")
    board.sim.run(1)
    assert [stop[:2] for stop in stops] == [("breakpoint", update)] * 2
    board.breakpoint("mrp_feedback_update", on=False)
    board.watchpoint("flight.control.newest", 8)
    stops.clear()
    board.sim.run(0.5)
    assert {reason for reason, *_ in stops} == {"watchpoint"} and len(stops) <= 2      # a store for each word
    assert "mrp_feedback_update" in board.core.place(stops[0][1])
    with pytest.raises(fledge.SetupError, match="no symbol 'mrp_feedback_updat'; did you mean 'mrp_feedback_update'"):
        board.breakpoint("mrp_feedback_updat")


def test_a_fault_is_reported_and_the_watchdog_begins_anew(board):
    board.sim.run(1)
    board.poke("mrp_feedback_update", bytes(4))         # unimp
    answers = board.in_flight.record()
    board.sim.run(30)
    assert re.search(r"trap 0x0+2 at 0x4", board.console)
    assert board.core.resets == board.core.watchdog_resets == 1
    missed = [answer is None for _, answer in answers]
    assert missed[0] and not missed[-1] and missed == sorted(missed, reverse=True)


def test_without_a_watchdog_the_computer_tells_where_it_failed(folder, tmp_path):
    text = BOARD.read_text(encoding="utf-8")
    assert "\nwatchdog " in text
    (tmp_path / "board.toml").write_text(re.sub(r"(?m)^watchdog .*$", "", text))
    board = emulator.load("nadir_spin", folder=folder, board=tmp_path / "board.toml")
    board.sim.run(1)
    board.poke("mrp_feedback_update", bytes(4))
    with pytest.raises(fledge.RunError, match=r"(?s)in the tick at 1.5 s\n.*backtrace.*last words:\ntrap 0x0+2 at 0x4"):
        board.sim.run(20)


def test_ticks_can_be_lost_and_interrupts_stick(board):
    board.sim.run(1)
    answers = board.in_flight.record()
    board.lose_ticks(2)
    board.sim.run(2)
    assert [answer is None for _, answer in answers[:4]].count(True) >= 1
    board.core.raise_interrupt(9)       # spurious: no handler is there
    board.core.stick_interrupts(1 << 9, 0)
    board.sim.run(1)
    assert answers[-1][1] is not None


def test_a_read_that_fails_traps_and_the_watchdog_brings_flight_back(board):
    board.sim.run(4)
    answers = board.in_flight.record()
    board.fail_next_read()
    board.sim.run(12)
    assert board.core.watchdog_resets == 1 and "trap 0x00000009 at" in board.console
    assert answers[0][1] is None and answers[-1][1] is not None


def test_a_register_that_is_stuck_is_so_until_it_works_again(board):
    board.sim.run(4)
    state, lane = board.snapshot(), "nadir_spin_board.nav_attitude"
    assert board.lanes[lane][0] % 8 == 0 and set(board.lanes) > {lane, "nadir_spin_board.motor_command"}
    seen, latest = [], board.lanes[lane][0] + 16       # which slot has the message
    for place, off in ((lane, 0), (latest, 0xFFFFFFFF), (latest, 0), (lane, 0)):
        board.restore(state)
        board.stick_register(place, off=off)
        answers = board.in_flight.record()
        board.sim.run(2)
        seen.append([answer for _, answer in answers])
    assert seen[0] == seen[2] == seen[3] != seen[1]
    with pytest.raises(fledge.SetupError, match="stick_register: bits must be a whole number from 0 to 4294967295; "
                                                "found -1"):
        board.stick_register(lane, on=-1)


def test_a_link_loses_delays_and_garbles_messages(board):
    board.sim.run(4)
    state, path = board.snapshot(), "flight.motor.command"
    command = board.sim.flight.motor.command

    def flown(*fault, **more):
        board.restore(state)
        if fault:
            board.disturb(path, fault[0], 4.6, 6.6, **more)
        seen = []
        for _ in range(6):
            board.sim.run(0.5)
            seen.append(objects.memory(command))
        return seen

    right, lost, late, garbled = flown(), flown("LOST"), flown("LATE", late=1), flown("GARBLED", seed=3)
    assert lost[0] == right[0] and set(lost[:5]) == {right[0]} and lost[5] != right[0]
    assert late[1:3] == [right[0]] * 2 and late[3] == right[1]
    assert sum((a ^ b).bit_count() for a, b in zip(garbled[1], right[1])) == 1
    assert flown("GARBLED", seed=3) == garbled != flown("GARBLED", seed=4) and flown() == right
    for fault, message in ((("flight.motor.comand", "LOST", 1, 2), "no message 'flight.motor.comand' passes the regi"),
                           ((path, "BROKEN", 1, 2), "a link is LOST, LATE or GARBLED; found 'BROKEN'"),
                           ((path, "LOST", 2, 1), "the end must be after the begin; found 2 and 1")):
        with pytest.raises(fledge.SetupError, match=message):
            board.disturb(*fault)


def begin_gdb(program, *commands):
    words = [word for command in commands for word in ("-ex", command)]
    return subprocess.Popen(["gdb-multiarch", "-q", "-nx", "-batch", *words, program], stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, text=True, env=without_preload(os.environ))


def gdb(board, program, *commands, seconds=3.0):
    """What gdb-multiarch prints for these commands, while the simulation runs."""
    child = begin_gdb(program, f"target remote :{board.gdb()}", *commands)
    try:
        assert board.wait_for_gdb(PATIENCE)
        board.sim.run(seconds)
        return child.communicate()[0]
    finally:
        child.kill()


def in_order(text, *patterns):
    at = 0
    for pattern in patterns:
        found = re.compile(pattern).search(text, at)
        assert found, f"{pattern!r} is not there, in its place:\n{text}"
        at = found.end()
    return True


@pytest.fixture
def program(folder, board):
    return folder / "leon3/nadir_spin"


@needs("gdb-multiarch")
def test_gdb_stops_in_flight_reads_flips_and_goes_back(board, program):
    output = gdb(board, program,
                 "break mrp_feedback_update", "continue", "print m->par.K", "backtrace", "info registers psr wim pc",
                 "monitor snapshot here", "next", "next", "reverse-step", "reverse-continue", "monitor time",
                 "print/x &m->par.K", "monitor flip %f2 3", "set var m->par.K = 7.5", "print m->par.K",
                 "monitor restore here", "maintenance flush register-cache", "print m->par.K", "stepi", "reverse-stepi",
                 "delete", "watch -l m->mem.newest", "continue",
                 "monitor devices irqmp", "print/x *(int *)0x80000240", "monitor nonsense", "detach")
    assert in_order(output, "Breakpoint 1 at 0x4", r"Breakpoint 1, mrp_feedback_update \(m=0x4", r"\$1 = 2.531",
                    "#0  mrp_feedback_update", "#1 .* in run_gnc", "#2 .* nadir_spin_tick", "#.* main", r"psr +0xf3",
                    "snapshot here taken",
                    r"\d+\s+Quality quality =", "Breakpoint 1, mrp_feedback_update", "instructions",
                    rf"\$2 = {board.address('flight.control.K'):#x}\b", "bit 3 inverted", r"\$3 = 7.5", "restored",
                    r"\$4 = 2.531",
                    r"\d+\s+({|Quality quality =)", "Breakpoint 1, mrp_feedback_update",
                    "Hardware watchpoint 2: -location m->mem.newest", "Old value = 0", "New value = ",
                    r"0x80000240 irqmp mask 0x0000\w+", r"\$5 = 0x\w+", r"monitor snapshot \[NAME\]",
                    "detached"), output
    desktop = fledge.load("nadir_spin")
    desktop.run(3)
    assert objects.memory(board.sim.flight.motor.command) == objects.memory(desktop.flight.motor.command)


def test_a_trace_shows_each_instruction_in_words(board, tmp_path):
    board.sim.run(1)
    board.trace(tmp_path / "trace.txt", board.now, board.now + 0.51)
    before = board.core.instructions, board.snapshot()
    board.sim.run(0.5)
    board.finish()
    lines = (tmp_path / "trace.txt").read_text().splitlines()
    assert len([line for line in lines if " traps: " not in line]) == board.core.instructions - before[0]
    entry = next(i for i, line in enumerate(lines) if re.search(
        r" mrp_feedback_update +save %sp, -0x[0-9a-f]+, %sp  %o6=[0-9a-f]{8}$", line))
    assert re.search(r" (nadir_spin_tick|run_gnc)\S* +(call|nop|mov|std|ldd|st|ld|add|or)", lines[entry - 1])
    cycles = [int(line.split()[0]) for line in lines]
    assert cycles == sorted(cycles) and cycles[0] < cycles[-1]
    end = board.registers
    board.restore(before[1])
    board.sim.run(0.5)
    assert board.registers == end       # a trace changes nothing


def test_coverage_tells_the_lines_and_branches_that_ran(board, program, tmp_path):
    board.coverage(tmp_path / "flight.info")
    board.sim.run(2)
    board.finish()
    text = (tmp_path / "flight.info").read_text()
    file = next(part for part in text.split("end_of_record") if "flight/control/mrp_feedback.c\n" in part)
    source = next(line[3:] for line in file.splitlines() if line.startswith("SF:"))
    lines = dict(map(int, line[3:].split(",")[:2]) for line in file.splitlines() if line.startswith("DA:"))
    numbers = {text.strip(): i for i, text in enumerate(open(source, encoding="utf-8"), 1)}
    assert "FNDA:5,mrp_feedback_update" in file
    assert re.search(r"^DA:\d+,0$", text, re.M) and max(lines.values()) >= 5
    assert lines[numbers["Vec3 last = mrp_nearer(m->mem.sigma_BR, error->sigma_BR);"]] == 5
    branches = [line.split(",")[-1] for line in text.splitlines() if line.startswith("BRDA:")]
    assert {"5", "0"} <= set(branches) and len(branches) % 2 == 0
    skip_without("lcov")
    page = subprocess.run(["genhtml", "--branch-coverage", "-o", tmp_path / "html", tmp_path / "flight.info"],
                          capture_output=True, text=True)
    assert page.returncode == 0 and re.search(r"lines\.+: ", page.stdout), page.stdout + page.stderr
    assert next((tmp_path / "html").rglob("mrp_feedback.c.gcov.html")).stat().st_size > 1000


@needs("valgrind")
def test_a_profile_has_the_cost_of_each_function_and_of_what_it_calls(board, tmp_path):
    board.sim.run(1)
    board.profile(tmp_path / "callgrind.out.flight")
    before = board.core.instructions
    board.sim.run(5)
    board.finish()
    spent = board.core.instructions - before
    output = subprocess.run(["callgrind_annotate", "--inclusive=yes", "--threshold=100", "--auto=no",
                             tmp_path / "callgrind.out.flight"], capture_output=True, text=True, check=True).stdout
    total = int(re.search(r"([\d,]+) \(100.0%\).*PROGRAM TOTALS", output)[1].replace(",", ""))
    assert total == spent
    costs = {name: int(n.replace(",", "")) for n, name in re.findall(r"^ *([\d,]+) \(.*:(\w+)(?: \[|$)", output, re.M)}
    assert 0 < costs["mrp_feedback_update"] < costs["nadir_spin_tick"] < costs["mission_host_exchange"] < spent


def test_the_depth_of_the_stack_is_seen(board):
    board.watch_stacks()
    board.sim.run(2)
    board.finish()
    (used, size), = board.stacks.values()
    assert list(board.stacks) == ["main"] and size == 0x10000 and 1000 < used < 8000


def test_wrong_files_and_addresses_are_refused(board, tmp_path):
    def refused(what, complaint):
        with pytest.raises(fledge.SetupError, match=complaint):
            what()

    (tmp_path / "no.toml").write_text("name = 1")
    refused(lambda: emulator.Board(tmp_path / "no.toml", tmp_path / "no.toml"), "no.toml")
    refused(lambda: board.gdb("localhost"), r"gdb: expected \[ADDRESS:\]PORT")
    refused(lambda: board.trace(tmp_path / "none/trace"), "none/trace cannot be written")
    refused(lambda: board.flip("%q3", 1), "there is no register %q3; there are %g0")
    for name in 2 * list(board.registers):      # and back
        board.flip(name, 3)
    refused(lambda: board.flip(4, 8), "flip: a byte of memory has the bits 0 to 7; found 8")
    refused(lambda: board.flip("%l3", -1), "flip: a bit must be a whole number from 0 to 31; found -1")
    refused(lambda: board.flip(0x30000000, 1), "the board has no memory at 0x30000000")
    refused(lambda: board.peek(0x30000000, 4), "no memory at 0x30000000")
    refused(lambda: board.peek(0x40000000, 2**40), "peek: bytes must be a whole number from 0 to 2147483648; found 1")
    for line in (0, 16, -1, 2**70, 2.5, "3", None):
        refused(lambda: board.interrupt(line), f"interrupt: a line must be a whole number from 1 to 15; found {line!r}")
        refused(lambda: board.stick_interrupts(on=[line]),
                "stick_interrupts: a line must be a whole number from 1 to 15")
    for place in (0x40000002, 0x30000000, 0x80000240, 0x40800000):
        refused(lambda: board.breakpoint(place),
                f"breakpoint: expected a multiple of 4 in RAM or ROM; found {place:#x}")
    for place in (-4, 2**32, 1.5, None):
        refused(lambda: board.breakpoint(place), "an address must be a whole number from 0 to 4294967295; found ")
        refused(lambda: board.watchpoint(place), "an address must be a whole number from 0 to 4294967295; found ")
    for size in (0, -1, 1.5):
        refused(lambda: board.watchpoint(0x40000000, size), "watchpoint: bytes must be a whole number from 1 to ")
    refused(lambda: board.watchpoint(0x407FFFFE), "watchpoint: expected reads or writes of bytes of RAM or ROM; found ")
    refused(lambda: board.write_device("irqmp", "mask", 2**32),
            "write_device must be a whole number from 0 to 4294967295")
    refused(lambda: board.watchpoint(0x80000240), "watchpoint: expected reads or writes of bytes of RAM or ROM; found "
                                                  "writes of 4 bytes at 0x80000240")
    refused(lambda: board.write_device("irqmp", "masks", 1), "there is no 'masks'; there are level, pending, force, ")
    refused(lambda: board.write_device("irq", "mask", 1), "there is no 'irq'; there are ftmctrl, console, irqmp, ")
    refused(lambda: board.send("a", uart=-1), "send: a UART must be a whole number from 0 to 255; found -1")
    refused(lambda: board.send("a", uart=2), "the board has no UART 2")
    refused(lambda: board.send(bytes(1025)), "send: the UART has room for 1024 bytes")
    board.sim.run(1)
    refused(lambda: board.fly(board.sim, "tables.so"), "fly: nadir_spin has run until 1 s")


ECHO = """
#include <stdint.h>
int main(void)
{
    volatile uint32_t *const uart = (volatile uint32_t *)0x80000100;
    for (;;) {
        while ((uart[1] & 1) == 0) {
        }
        uart[0] = uart[0] + 1;
    }
}
"""


def test_python_talks_to_a_uart_and_to_devices(folder):
    (folder / "echo.c").write_text(ECHO)
    board = emulator.Board(BOARD, leon3_program(folder / "echo", "echo", [folder / "echo.c"], []))
    board.run_until(0.01)
    assert not board.devices["console"]["status"] & 1
    board.send("HAL")
    assert board.devices["console"]["status"] & 1       # and reading the register changes nothing
    board.run_until(0.02)
    assert board.console == "IBM"
    board.write_device("irqmp", "mask", 0x140)
    assert board.devices["irqmp"]["mask"] == 0x140
    assert board.devices["dsu"]["time_tag"] == board.core.cycles


COUNTER = """
volatile unsigned counter;
static unsigned depth(unsigned n) { return n ? depth(n - 1) + counter % 2 : 0; }
int main(void)
{
    for (;;) {
        counter++;
        depth(20);
    }
}
"""


@pytest.fixture(scope="module")
def counter(folder):
    (folder / "counter.c").write_text(COUNTER)
    return leon3_program(folder / "counter", "counter", [folder / "counter.c"], [], ["-fno-optimize-sibling-calls"])


@needs("gdb-multiarch")
def test_gdb_interrupts_a_program_and_sees_all_its_windows(counter, tmp_path):
    """Of a program without a mission, deeper in calls than the processor has windows."""
    board = subprocess.Popen([native("fledge_leon3", "emulator/tools"), BOARD, counter, "--gdb", "0",
                              "--console", tmp_path / "console"], stderr=subprocess.PIPE, text=True)
    try:
        def spent():
            """The time of a processor that the board has taken."""
            return sum(map(int, Path(f"/proc/{board.pid}/stat").read_text().rpartition(")")[2].split()[11:13]))

        port = re.search(r"target remote :(\d+)", board.stderr.readline())[1]
        child = begin_gdb(counter, f"target remote :{port}", "break depth if n == 3", "continue", "backtrace", "delete",
                          "echo runs\\n", "continue", "print counter > 1000", "watch counter", "continue",
                          "reverse-continue", "detach")
        output = ""
        for line in child.stdout:
            output += line
            if "runs" in output:
                break
        before = spent()
        wait_for(lambda: spent() > before + 10, child)      # ticks of 10 ms: it runs on
        child.send_signal(signal.SIGINT)
        output += child.communicate()[0]
        assert in_order(output, r"#0 +depth \(n=3\)", r"#10 .*depth \(n=13\)", r"#18 .*main", "received signal SIGINT",
                        r"\$1 = 1", "Hardware watchpoint 2: counter", r"Old value = \d", "Hardware watchpoint",
                        "detached")
        assert board.poll() is None     # it runs on
        board.terminate()
        assert board.wait() == 0
    finally:
        board.kill()
