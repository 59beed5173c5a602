# SPDX-License-Identifier: Apache-2.0
"""What is written for a board: clean for every compiler, and true to the description."""
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from registers import emit_c, emit_markdown
from registers.description import read
from tests.circles import long_after
from tests.needs import skip_unless_on, skip_without

ROOT = Path(__file__).resolve().parents[1]
BOARDS = [read(file) for file in sorted((ROOT / "registers/testing/boards").glob("*.toml"))]
STRICT = ["-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wstrict-prototypes", "-Werror",
          "-ffp-contract=off", f"-I{ROOT}"]
COMPILERS = {"gcc": [], "clang": [], "aarch64-linux-gnu-gcc": ["qemu-aarch64", "-L",
             "/usr/aarch64-linux-gnu"], "sparc64-linux-gnu-gcc": ["qemu-sparc64", "-L",
             "/usr/sparc64-linux-gnu"]}

# Prints, of every lane, what the tables say; and sets and gets what the accessors reach.
PROBE = r"""
#include <stdio.h>
%(includes)s
static uint64_t memory[%(words)d];

static void show(const RegisterBoard *board)
{
    for (uint32_t i = 0; i < board->n_lanes; i++) {
        const RegisterLane *l = &board->lanes[i];
        printf("%%s %%s %%lu %%lu %%lu %%lu %%lu %%ld\n", board->name, l->name,
               (unsigned long)l->address, (unsigned long)l->descriptors,
               (unsigned long)l->capacity, (unsigned long)l->stride, (unsigned long)l->depth,
               (long)l->interrupt);
    }
}

int main(void)
{
    RegisterWindow w = register_window(&io_board_a, (volatile uint32_t *)memory);
    const unsigned char *bytes = (const unsigned char *)memory;
%(shows)s
    if (io_board_a_wheel_volts_set_command(&w, 2u, -5.0) != 0
        || io_board_a_wheel_volts_set_command(&w, 3u, 11.0) != 1) {
        return 1;
    }
    memory[IO_BOARD_A_SUN_SENSOR_ADDRESS / 8u] = ~UINT64_C(0);
    for (uint32_t i = 8; i < 12; i++) {
        printf("%%02x", (unsigned)bytes[IO_BOARD_A_WHEEL_VOLTS_ADDRESS + i]);
    }
    printf(" %%.17g %%.17g\n",
           io_board_a_sun_sensor_current(&w, 0u), io_board_a_sun_sensor_saturated(&w, 1u));
    return 0;
}
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boards")
    for board in BOARDS:
        for name, text in emit_c.emit(board).items():
            (folder / name).write_text(text, encoding="utf-8")
    (folder / "probe.c").write_text(PROBE % {
        "includes": "".join(f'#include "{b.name}.h"\n' for b in BOARDS),
        "shows": "".join(f"    show(&{b.name});\n" for b in BOARDS),
        "words": max(b.size for b in BOARDS) // 8})
    return folder


@pytest.mark.parametrize("compiler, runner", long_after(1, COMPILERS.items(), "another compiler"),
                         ids=list(COMPILERS))
def test_headers_and_tables_are_strict_c99_and_say_what_the_description_says(written, compiler,
                                                                             runner):
    if runner:
        skip_unless_on(compiler.partition("-")[0])
    elif compiler == "clang":
        skip_without("clang")
    program = written / f"probe_{compiler}"
    # Of the messages' byte orders, which are generated elsewhere, a lone name will do here.
    (written / "orders.c").write_text("".join(
        f"extern const RegisterMessage fledge_message_{m};\n"
        f"const RegisterMessage fledge_message_{m} = {{0, 0u, 0u, 0}};\n"
        for m in sorted({s.message for b in BOARDS for s in b.snorkels if s.message})),
        encoding="utf-8")
    orders = (written / "orders.c").read_text()
    (written / "orders.c").write_text('#include "registers/message.h"\n' + orders)
    sources = [*[str(written / f"{b.name}.c") for b in BOARDS], str(written / "orders.c"),
               *[str(ROOT / f"registers/{n}.c") for n in ("lane", "field", "clock", "message")]]
    built = subprocess.run([compiler, "-std=c99", *STRICT, f"-I{written}", "-O1", "-Wno-cast-qual",
                            str(written / "probe.c"), *sources, "-o", str(program)],
                           capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    ran = subprocess.run([*runner, str(program)], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    *lanes, values = ran.stdout.splitlines()
    assert lanes == [
        f"{b.name} {lane.name} {lane.address} "
        f"{0xFFFFFFFF if lane.descriptor.address is None else lane.descriptor.address} "
        f"{lane.capacity} {lane.stride} {lane.depth} "
        f"{b.lines.index(lane.interrupt) if lane.interrupt else -1}"
        for b in BOARDS for lane in b.lanes]
    # -5 V at 10/32768 V a count is -16384, big-endian on every machine; the field has 16 bits.
    assert values.split() == ["0000c000", f"{4095 * 2.44140625e-6:.17g}", "1"]


@pytest.mark.parametrize("standard", ["c99", "c11"])
def test_a_header_stands_by_itself(written, standard):
    for board in BOARDS:
        source = written / "alone.c"
        source.write_text(f'#include "{board.name}.h"\n#include "{board.name}.h"\n')
        for compiler in filter(shutil.which, ("gcc", "clang")):
            done = subprocess.run([compiler, f"-std={standard}", *STRICT, f"-I{written}", "-c",
                                   str(source), "-o", str(written / "alone.o")],
                                  capture_output=True, text=True)
            assert done.returncode == 0, done.stderr


def test_defines_are_the_addresses(written):
    for board in BOARDS:
        text = (written / f"{board.name}.h").read_text()
        defines = {name: int(value, 16) for name, value in
                   re.findall(r"#define (\w+) +(0x[0-9a-f]+)u", text)}
        upper = board.name.upper()
        assert defines[f"{upper}_BASE"] == board.base
        for lane in board.lanes:
            assert defines[f"{upper}_{lane.name.upper()}_ADDRESS"] == lane.address


def test_a_message_of_another_size_does_not_compile(written):
    header = (written / "single_board_computer.h").read_text()
    (written / "wrong.c").write_text(header.replace("sizeof(NavAttitude) == 64u",
                                                    "sizeof(NavAttitude) == 72u"))
    done = subprocess.run(["gcc", "-std=c99", f"-I{ROOT}", "-c", str(written / "wrong.c"), "-o",
                           str(written / "wrong.o")], capture_output=True, text=True)
    assert done.returncode != 0 and "is_of_the_size_of_NavAttitude" in done.stderr


def test_documentation_names_every_lane_and_field_in_the_order_of_addresses():
    for board in BOARDS:
        text = emit_markdown.emit(board)[f"{board.name}.md"]
        addresses = [int(a, 16) for a in re.findall(r"^\| (0x\w+) \|", text, re.MULTILINE)]
        assert addresses == sorted(addresses)
        for snorkel in board.snorkels:
            assert all(f"| {lane.address:#06x} | {lane.name} |" in text for lane in snorkel.lanes)
            assert all(f"| {f.name} |" in text for f in snorkel.fields)
        rows = {cells[1]: cells[-1] for line in text.splitlines() if line.startswith("| 0x")
                for cells in [[cell.strip() for cell in line.strip("|").split("|")]]}
        for lane in board.lanes:
            assert ("it swaps units of" in rows[lane.name]) == bool(lane.swap)
            assert ("it adds" in rows[lane.name]) == bool(lane.add)
            assert ("end removes" in rows[lane.name]) == bool(lane.remove)


def test_equal_boards_give_equal_bytes():
    for file in (ROOT / "registers/testing/boards").glob("*.toml"):
        assert emit_c.emit(read(file)) == emit_c.emit(read(file))


def test_no_text_of_a_board_breaks_its_c(tmp_path):
    hostile = 'end */ begin /* "quoted" \\\\ ??/ %s \\n caf\u00e9 #include'
    text = ("""name = "b"
doc = "HOSTILE"
base = 0
size = 0x1000
order = "big"
[[snorkel]]
name = "s"
doc = "HOSTILE"
form = "word"
direction = "both"
address = 0
write_address = 4
[[snorkel.field]]
name = "f"
doc = "HOSTILE"
unit = "HOSTILE"
bits = [0, 8]
""").replace("HOSTILE", hostile.replace('"', '\\"'))
    (tmp_path / "b.toml").write_text(text, encoding="utf-8")
    for name, written in emit_c.emit(read(tmp_path / "b.toml")).items():
        (tmp_path / name).write_text(written, encoding="utf-8")
    for compiler in filter(shutil.which, ("gcc", "clang")):
        done = subprocess.run([compiler, "-std=c99", *STRICT, f"-I{tmp_path}", "-c",
                               str(tmp_path / "b.c"), "-o", str(tmp_path / "b.o")],
                              capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
