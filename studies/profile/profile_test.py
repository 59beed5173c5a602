# SPDX-License-Identifier: Apache-2.0
"""A short profile has all figures, the page shows those of the file, and what grows is found."""
import json
import os
import re
import shutil

import pytest

from fledge import cli
from fledge.profile import Profile, code, line, process, run, valgrind
from fledge.targets import TARGETS, build
from fledge.targets.bare import Bare
from fledge.targets.linux import RUNNER, Linux
from tests import bare_machine
from tests.circles import long_after
from tests.needs import reason, skip_unless_on, skip_without, skipped

needs_valgrind = skipped(reason("valgrind"), "valgrind shares no process with the sanitizers"
                         if os.environ.get("FLEDGE_PRESET") == "asan" else "")


@needs_valgrind
@pytest.mark.parametrize("target", long_after(
    1, ["linux", "micropython", "leon3"], "flies under valgrind or on a board"))
def test_a_short_flight_is_profiled(tmp_path, capsys, target):
    skip_unless_on(target)
    out = str(tmp_path / "out")
    assert cli.main(["profile", "inertial_spin", "--free", "--for", "15s", "--on", target, "--out", out]) == 0
    output = capsys.readouterr().out
    facts = json.loads((tmp_path / "out/profile.json").read_text())
    page = (tmp_path / "out/profile.html").read_text()
    assert (facts["mission"], facts["duration"]) == ("inertial_spin", 15.0)
    row, = facts["targets"]
    assert row["target"] == target and row["cycles"] == 31 and row["same"] is True and row["problems"] == []
    assert row["per_cycle"] > 1000 and row["total_instructions"] > 31 * row["per_cycle"] * 0.9
    assert row["init_instructions"] > 1000
    assert len(row["thirds"]["instructions"]) == 3 and len(row["thirds"]["heap"]) == 3
    assert 200 < row["init_stack"] < 65536 and 200 < row["loop_stack"] < 65536
    assert {"modules", "tables and scripts", "registers, record and host"} <= set(row["code"])
    assert 30_000 < sum(row["code"].values()) < 2_000_000
    if "micropython" in target:
        assert 1000 < row["loop_heap"] < 65536 and {"interpreter", "executive and binding"} <= set(row["code"])
    else:
        assert row["loop_heap"] == 0
    for shown in (f"{row['per_cycle']:,.0f}", f"{row['init_instructions']:,}", f"{row['loop_stack']:,} B"):
        assert shown in page and shown in output
    assert page.count("data:image/png;base64,") >= 2 and "http" not in page


BARE = [name for name, target in TARGETS.items() if isinstance(target, Bare) and target.emulator]


@pytest.mark.long("builds and flies on a board")
@pytest.mark.parametrize("target", BARE)
def test_a_board_behind_a_line_is_profiled(tmp_path, capsys, target):
    skip_unless_on(target)
    assert cli.main(["profile", "inertial_spin", "--free", "--for", "15s", "--on", target, "--out", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    row, = json.loads((tmp_path / "profile.json").read_text())["targets"]
    assert row["cycles"] == 31 and row["same"] is True and row["problems"] == []
    assert 1000 < row["per_cycle"] < row["init_instructions"] and row["loop_heap"] == row["allocations"] == 0
    assert 200 < row["loop_stack"] < 65536 and {"modules", "tables and scripts"} <= set(row["code"])
    assert f"{row['per_cycle']:,.0f}" in output


@pytest.mark.parametrize("name, loop", [("cortex-m7", "subs %0, %0, #1"), ("riscv64", "addi %0, %0, -1")])
def test_an_instruction_is_a_nanosecond_of_a_board(tmp_path, name, loop):
    """The processor counts a loop of two instructions, whose number is known."""
    skip_unless_on(name)
    target, again = TARGETS[name], "bne 1b" if name == "cortex-m7" else "bnez %0, 1b"
    (tmp_path / "loop.c").write_text(
        '#include "targets/bare/port.h"\n#include <stdio.h>\nint main(void)\n{\n    unsigned long n = 1000000;\n'
        '    const int64_t begin = board_time();\n'
        f'    __asm__ volatile("1: {loop}\\n\\t{again}" : "+r"(n) : : "cc");\n'
        '    printf("%ld\\n", (long)(board_time() - begin));\n    return 0;\n}\n')
    program = bare_machine.program(target, tmp_path, "loop", [tmp_path / "loop.c"])
    assert int(bare_machine.printed(target, program, *line.COUNTED)) == pytest.approx(2_000_000, abs=2000)


class Planted(Linux):
    """The Linux target with a function around each exchange."""
    name = "planted"
    text = ""

    def build(self, part):
        folder = part.folder / self.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "around.c").write_text(
            "#include \"targets/mission_host.h\"\n#include <stdlib.h>\n"
            "#define WITH const MissionHost *h, const RegisterWindow *w, int64_t t, MissionIoCounts *c\n"
            "void __real_mission_host_exchange(WITH);\nvoid __wrap_mission_host_exchange(WITH);\n"
            "static volatile unsigned n;\nstatic void *volatile kept;\nvoid __wrap_mission_host_exchange(WITH)\n"
            "{\n    " + self.text + "\n    __real_mission_host_exchange(h, w, t, c);\n}\n")
        sources = [*part.sources(), *(build.ROOT / path for path in RUNNER), (folder / "around.c").resolve()]
        return build.program(folder, part.mission.name, sources, part.includes(), flags=["-fno-pie"],
                             link=[*self.link, "-Wl,--wrap=mission_host_exchange"])


@pytest.mark.long("builds and flies under valgrind")
@needs_valgrind
@pytest.mark.parametrize("text, wrong", [
    ("kept = malloc(100); n += kept != NULL;", ["its heap grows in the loop, from [\\d,]+ to [\\d,]+ bytes",
                                                "its loop allocates: 30 requests in 31 cycles"]),
    ("n++; for (unsigned i = 0u; i < 400u * n; i++) { kept = NULL; }", ["a cycle takes ever more instructions: "])])
def test_what_grows_is_found(tmp_path, monkeypatch, capsys, text, wrong):
    planted = Planted()
    planted.text = text
    monkeypatch.setitem(TARGETS._targets, "planted", planted)
    monkeypatch.setitem(TARGETS.folders, "planted", TARGETS.folders["linux"])
    monkeypatch.setattr(process, "LOOP", ("__wrap_mission_host_exchange", "mission_record_take"))
    assert cli.main(["profile", "inertial_spin", "--free", "--for", "15s", "--on", "planted", "--out",
                     str(tmp_path)]) == 1
    errors = capsys.readouterr().err
    page = (tmp_path / "profile.html").read_text()
    assert len(errors.splitlines()) == len(wrong)
    for script in wrong:
        assert re.search(f"fledge: planted: {script}", errors) and re.search(f"planted: {script}", page), errors


@pytest.mark.long("flies under valgrind")
@needs_valgrind
def test_a_script_that_allocates_in_the_loop_is_found(tmp_path, capsys):
    skip_unless_on("micropython")
    mission = tmp_path / "careless"
    shutil.copytree(build.ROOT / "missions/inertial_spin", mission)
    text = (mission / "flight.py").read_text()
    spin = "f.spin     = fsw.InertialSpin("
    assert text.count(spin) == 1
    (mission / "flight.py").write_text(text.replace(spin, f"{spin}update=careless, ").replace("def build(f):", (
        "def careless(m, t, dt):\n    pair = [t, dt]\n    m.publish(m.reference)\n\n\ndef build(f):")))
    assert cli.main(["profile", str(mission), "--free", "--for", "15s", "--on", "micropython", "--out",
                     str(tmp_path / "out")]) == 1
    errors = capsys.readouterr().err
    assert re.search(r"^fledge: micropython: its loop allocates: \d+ requests in 31 cycles$", errors,
                     re.MULTILINE), errors


def flight(instructions, heap, **more):
    return Profile("x", "", 30, instructions=list(enumerate(instructions)), heap=list(enumerate(heap)), **more)


def test_only_a_loop_that_grows_is_a_problem():
    assert not flight([100] * 30, [8] * 30).problems()
    assert not flight([100, 900] + [100] * 28, [8] * 30).problems()                 # the start is dearer
    assert not flight([100] * 10 + [120] * 10 + [90] * 10, [8] * 30).problems()     # a manoeuvre
    assert not flight([100 + i / 100 for i in range(30)], [8] * 30).problems()
    assert "ever more" in flight([100 + i for i in range(30)], [8] * 30).problems()[0]
    assert not flight([100] * 9 + [120] * 10 + [150] * 11, [8] * 30, changes=[9, 19]).problems()    # of three modes
    assert not flight([100 + i for i in range(30)], [8] * 30, changes=[*range(4, 30, 5)]).problems()    # too short
    assert flight([100] * 12 + [120 + i for i in range(18)], [8] * 30, changes=[12]).problems() == [
        "a cycle takes ever more instructions: 122, 128 and 134 in the thirds of the cycles 12 to 30, of one mode, "
        "+9.8%"]
    heap, = flight([100] * 30, [100 + 16 * i for i in range(30)]).problems()
    assert "from 260 to 564 bytes between the first and the last third, 15.2 bytes per cycle" in heap
    assert "allocates: 3 requests" in flight([100] * 30, [8] * 30, allocations=3).problems()[0]
    assert "differ" in flight([100] * 30, [8] * 30, same=False).problems()[0]
    assert not flight([100 + i for i in range(30)], range(30), strict=False).problems()


def test_callgrind_and_massif_are_read():
    found = valgrind.read_callgrind(
        "events: Ir\n\nfn=(1) main\n16 100\ncfn=(2) malloc\ncalls=3 0 \n16 30\nfn=(2)\n0 30\n\n"
        "fn=(1)\n+3 5\ncfn=(3) step'2\ncalls=1 0\n* 7\n")
    assert found.total == 135 and found.own == {"main": 105, "malloc": 30}
    assert found.calls == {"malloc": 3, "step": 1} and found.inclusive == {"malloc": 30, "step": 7}
    text = "snapshot=0\n#-----------\ntime=5\nmem_heap_B=10\nmem_heap_extra_B=2\nmem_stacks_B=3\nheap_tree=empty\n"
    assert valgrind.read_massif(text) == [valgrind.Snapshot(5, 12, 3)]


def test_the_map_is_read():
    text = ("Discarded input sections\n .text.gone 0x0 0x10 o/00_a.o\nLinker script and memory map\n\n"
            " .text.run      0x0000000000401000       0x20 o/00_a.o\n"
            " .text.a_function_with_a_long_name\n                0x0000000000401020       0x10 o/01_b.o\n"
            "                0x0000000000401020                a_function_with_a_long_name\n"
            " .rodata        0x0000000000402000        0x8 /lib/libc.a(printf.o)\n"
            " *fill*         0x0000000000402008        0x8 \n"
            " .bss           0x0000000000403000       0x40 libmicropython.a(py_vm.o)\n")
    assert code.sections(text) == [(".text.run", 32, "o/00_a.o"), (".text.a_function_with_a_long_name", 16, "o/01_b.o"),
                                   (".rodata", 8, "/lib/libc.a(printf.o)"), (".bss", 64, "libmicropython.a(py_vm.o)")]
    sources = {"o/00_a.o": f"{build.ROOT}/flight/control/a.c", "o/01_b.o": "/somewhere/c/mission.c"}
    assert [code.part_of(file, sources) for _, _, file in code.sections(text)] == [
        "modules", "tables and scripts", "C library", "interpreter"]
    assert code.part_of("/build/libmicropython.a(micropython_objects.o)", {}) == "executive and binding"


@pytest.mark.long("starts the command for each")
@pytest.mark.parametrize("arguments, wrong", [
    (["--on", "moon"], "cannot profile on 'moon'; there are "),
    (["--on", "aarch64"], "cannot profile on 'aarch64'; there are "),
    (["--on", ","], "--on names no target"),
    (["--free"], "--free is without a scenario, and needs --for"),
    (["--for", "0.5s", "--free"], "2 cycles are too few; fly longer with --for")])
def test_wrong_words_are_refused(tmp_path, capsys, arguments, wrong):
    if "0.5s" in arguments:
        skip_without("valgrind")
    words = ["profile", "inertial_spin", "--out", str(tmp_path), *arguments]
    assert cli.main(words if "--for" in arguments or "--free" in arguments else [*words, "--for", "1s"]) == 2
    assert wrong in capsys.readouterr().err
    assert run.METHODS.keys() >= {target.profiled_by for target in TARGETS.values()} - {""}
