# SPDX-License-Identifier: Apache-2.0
"""A mission as an application of RTEMS. Without RTEMS: what the export writes, and the refusals. With an installed one,

    FLEDGE_RTEMS=/opt/rtems/6 /usr/bin/python3 -m pytest targets/leon3_rtems/rtems_test.py

flies there; fly_test.py then flies this target beside all others, too. With a tree of cFS 7 in FLEDGE_CFS, NASA's core
flies under RTEMS, too."""

import os
import re
import subprocess

import pytest

from fledge import cli
from fledge.errors import Failure
from fledge.disk import write_files
from fledge.targets import TARGETS, Job
from fledge.targets.cfs.pocket import write_app
from fledge.targets.fly_test import plays
from fledge.targets.leon3 import toolchain
from fledge.targets.leon3_cfs.app import APP
from fledge.targets.leon3_rtems import NAMED_BY
from fledge.targets.leon3_rtems.real import OWN, RtemsCfs
from tests.needs import flies_on

HERE, TREE = os.environ.get(NAMED_BY), os.environ.get("FLEDGE_CFS")
ON_RTEMS = pytest.mark.skipif(not HERE, reason=f"{NAMED_BY} names no RTEMS")
FACTS = "lib/pkgconfig/sparc-rtems6-leon3.pc"

# What board.c and rtems.c use of RTEMS, declared as in its manual.
STAND_IN = {"rtems.h": """
#include <stdint.h>
typedef uint32_t rtems_id, rtems_name, rtems_event_set, rtems_interval, rtems_task_priority, rtems_option, rtems_mode;
typedef uint32_t rtems_attribute, rtems_vector_number, rtems_fatal_source, rtems_fatal_code;
typedef uintptr_t rtems_task_argument;
typedef enum { RTEMS_SUCCESSFUL = 0, RTEMS_TIMEOUT = 6 } rtems_status_code;
typedef void rtems_task;
typedef struct rtems_tcb rtems_tcb;
typedef struct { struct { uintptr_t total; } Used; } Heap_Information_block;
typedef void (*rtems_interrupt_handler)(void *);
enum { RTEMS_WAIT, RTEMS_NO_TIMEOUT = 0, RTEMS_EVENT_0 = 1, RTEMS_EVENT_1 = 2, RTEMS_EVENT_2 = 4, RTEMS_EVENT_ANY = 2,
       RTEMS_DEFAULT_MODES = 0, RTEMS_FLOATING_POINT = 1, RTEMS_INTERRUPT_UNIQUE = 1, RTEMS_FATAL_SOURCE_APPLICATION };
#define RTEMS_MILLISECONDS_TO_TICKS(ms) ((ms) / 10)
#define rtems_build_name(a, b, c, d) ((rtems_name)(a) << 24 | (rtems_name)(b) << 16 | (rtems_name)(c) << 8 | (d))
void rtems_fatal(rtems_fatal_source source, rtems_fatal_code code) __attribute__((noreturn));
rtems_status_code rtems_event_send(rtems_id id, rtems_event_set events);
rtems_status_code rtems_event_receive(rtems_event_set events, rtems_option options, rtems_interval ticks,
                                      rtems_event_set *got);
rtems_status_code rtems_task_create(rtems_name name, rtems_task_priority priority, size_t stack, rtems_mode modes,
                                    rtems_attribute attributes, rtems_id *id);
rtems_status_code rtems_task_start(rtems_id id, rtems_task (*entry)(rtems_task_argument), rtems_task_argument argument);
rtems_id rtems_task_self(void);
_Bool rtems_workspace_get_information(Heap_Information_block *info);
uint64_t rtems_clock_get_uptime_nanoseconds(void);
rtems_status_code rtems_interrupt_handler_install(rtems_vector_number vector, const char *info, rtems_option options,
                                                  rtems_interrupt_handler routine, void *argument);
""", "rtems/stackchk.h": """
typedef struct { uintptr_t used; } rtems_stack_checker_info;
typedef void (*rtems_stack_checker_visitor)(const rtems_stack_checker_info *info, void *argument);
void rtems_stack_checker_iterate(rtems_stack_checker_visitor visit, void *argument);
""", "bsp/watchdog.h": """
void bsp_watchdog_reload(int watchdog, unsigned int value);
void bsp_watchdog_stop(int watchdog);
""", "bsp.h": "#include <stddef.h>\n", "rtems/confdefs.h": """
#if !defined CONFIGURE_INIT || CONFIGURE_MAXIMUM_TASKS < 2
#error no configuration
#endif
rtems_task (*const rtems_entry)(rtems_task_argument) = CONFIGURE_INIT_TASK_ENTRY_POINT;
"""}

# Debian's compiler in place of RTEMS'; it links without a library.
COMPILER = """#!/bin/sh
for word; do
    shift
    case $word in
    -qrtems) set -- "$@" -r -nostdlib ;;
    -B* | -Wl,*) ;;
    *) set -- "$@" "$word" ;;
    esac
done
exec {words} "$@"
"""


def folder_of_rtems(folder, files):
    """A folder that looks as if it had RTEMS."""
    write_files(files, folder)
    for tool in folder.glob("bin/*"):
        tool.chmod(0o755)
    return folder


@pytest.mark.parametrize("files, complaint", [
    (None, "leon3-rtems needs RTEMS 6 with the BSP leon3 (--rtems DIR, or FLEDGE_RTEMS, is its folder), not installed"),
    ({}, "has no RTEMS, and no sparc-rtems6-leon3: name the folder into which RTEMS 6 was installed with the BSP"),
    ({"lib/pkgconfig/sparc-rtems5-leon3.pc": "", "lib/pkgconfig/arm-rtems6-stm32h7.pc": "", "lib/pkgconfig/x.pc": ""},
     "has arm-rtems6-stm32h7 sparc-rtems5-leon3, and no sparc-rtems6-leon3: name the folder"),
    ({FACTS: ""}, "has no compiler: sparc-rtems6-gcc is neither in its bin nor on the PATH; the RTEMS Source Builder"),
])
def test_what_is_no_rtems_is_refused(files, complaint, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(NAMED_BY, "")
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    named = [] if files is None else ["--rtems", str(folder_of_rtems(tmp_path / "rtems", {"README": "", **files}))]
    assert cli.main(["fly", "nadir_spin", "--for", "1s", "--on", "leon3-rtems", *named, "--out",
                     str(tmp_path / "out")]) == 1
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if "leon3-rtems" in line]
    assert len(lines) == 1 and complaint in lines[0], captured.err
    assert "failed   leon3-rtems: did not fly (passed: desktop)" in captured.out


def test_rtems_is_for_one_target(capsys):
    assert cli.main(["fly", "nadir_spin", "--for", "1s", "--on", "linux", "--rtems", "/opt/rtems/6"]) == 2
    assert "--rtems is for --on leon3-rtems" in capsys.readouterr().err


@pytest.mark.long("compiles a mission's image")
@flies_on("leon3")
@pytest.mark.parametrize("mission", [["earth_imager"], ["formation", "--process", "deputy"]])
def test_the_folder_has_all_that_rtems_has_not(mission, tmp_path, capsys):
    """It compiles without a warning, and calls beyond itself only RTEMS, the compiler's (__...) and the C library."""
    out = tmp_path / "out"
    assert cli.main(["export", "rtems", *mission, "--out", str(out)]) == 0, capsys.readouterr()
    assert f"{out}/README.md says how to build them" in capsys.readouterr().out
    words = " ".join([toolchain.COMPILER, *toolchain.MACHINE, *toolchain.headers(), "-Werror"])
    prefix = folder_of_rtems(tmp_path / "rtems", {
        FACTS: "ABI_FLAGS=-mcpu=leon3\n", "bin/sparc-rtems6-gcc": COMPILER.format(words=words),
        **{f"sparc-rtems6/leon3/lib/include/{name}": text for name, text in STAND_IN.items()}})
    done = subprocess.run(["make", "-j2", f"RTEMS={prefix}"], cwd=out, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    program = next(path for path in out.iterdir() if path.is_file() and not path.suffix and path.name != "Makefile")
    missing = {line.split()[-1] for line in subprocess.run(
        ["sparc64-linux-gnu-nm", "-u", program], capture_output=True, text=True, check=True).stdout.splitlines()}
    declared = " ".join(STAND_IN.values())
    linker = {"text_start", "_endtext", "data_start", "edata", "_end", "leon3_registers"}
    library = {"exit", "memcmp", "memcpy", "memmove", "memset", "strlen", "strcmp", "strncmp", "sqrt", "fmod"}
    unknown = {name for name in missing - linker - library if f" {name}(" not in declared and name[:2] != "__"}
    assert not unknown, unknown
    assert {"rtems_task_create", "rtems_event_send", "bsp_watchdog_reload"} < missing


def test_the_page_has_the_threads_and_their_priorities(tmp_path):
    from fledge.export.run_test import FLIGHT, WORLD

    write_files({"modes/flight.py": FLIGHT, "modes/world.py": WORLD}, tmp_path)
    assert cli.main(["export", "rtems", str(tmp_path / "modes"), "--out", str(tmp_path / "out")]) == 0
    rows = [[cell.strip() for cell in line.split("|")[1:-1]]
            for line in (tmp_path / "out/README.md").read_text().splitlines() if line.startswith("| ")][2:]
    periods = [float(row[2].split()[0]) for row in rows]
    assert len(rows) > 2 and periods == sorted(periods) and periods[0] < periods[-1]
    assert [int(row[3]) for row in rows] == [*range(11, 11 + len(rows))]
    assert f"TASKS := {len(rows)}\n" in (tmp_path / "out/mission.mk").read_text()


def tree_of_cfs(folder, more):
    """A folder that looks as if it were a tree of cFS."""
    write_files({f"{name}/README": "" for name in ("cfe", "osal", "psp", *more)}, folder)
    return folder


def test_a_tree_without_a_port_to_rtems_is_refused(tmp_path):
    tree = tree_of_cfs(tmp_path / "tree", ["osal/src/bsp/pc-rtems"])
    with pytest.raises(Failure, match="--cfs .*/tree: its OSAL has no port to RTEMS 6; use cFS 7"):
        RtemsCfs(tree).build(Job("nadir_spin", duration=1.0, folder=tmp_path / "out").parts[0])
    assert cli.main(["fly", "nadir_spin", "--on", "linux", "--cfs", str(tree)]) == 2


def test_the_app_for_nasas_core_has_all_that_it_lists(tmp_path):
    tree = tree_of_cfs(tmp_path / "tree", [])
    app = write_app(APP, Job("flatsat", duration=1.0, folder=tmp_path / "out").parts[0], tmp_path / "made")
    RtemsCfs(tree).put(app, tmp_path / "apps/fsw")
    listed = set(re.findall(r"fsw/src/\S+?\.c", (tmp_path / "apps/fsw/CMakeLists.txt").read_text()))
    assert all((tmp_path / "apps/fsw" / name).is_file() for name in listed)
    assert {f"fsw/src/{name}" for name in OWN} < listed and not any(name.endswith("/watch.c") for name in listed)


@ON_RTEMS
@pytest.mark.skipif(not TREE, reason="FLEDGE_CFS names no tree")
@pytest.mark.parametrize("play", ["all", "at_random"])
def test_nasas_core_flies_under_rtems(play, tmp_path, capsys):
    """With commands, right and wrong."""
    assert cli.main(["fly", str(plays(tmp_path)), play, "--on", "leon3-rtems", "--cfs", TREE, "--out",
                     str(tmp_path / "out")]) == 0, capsys.readouterr()
    log = (tmp_path / "out/leon3-rtems.log").read_text()
    assert "CFE_ES_Main entering OPERATIONAL state" in log and "FSW flies" in log


@ON_RTEMS
@pytest.mark.parametrize("words", [["star_slew", "--for", "20s"], ["flatsat", "silent"], ["PLAYS", "all"],
                                   ["PLAYS", "at_random"]], ids=lambda words: " ".join(words[:2]))
def test_a_flight_on_rtems_is_the_desktops_and_the_boards(words, tmp_path, capsys):
    """Many rates; resets by the power unit's watchdog, over which the record goes on; commands, right and wrong."""
    words = [str(plays(tmp_path)) if word == "PLAYS" else word for word in words]
    assert cli.main(["fly", *words, "--on", "leon3,leon3-rtems", "--out", str(tmp_path / "out")]) == 0, \
        capsys.readouterr()
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("  leon3")]
    assert rows[0][1:4] == rows[1][1:4] and rows[0][3] == "none"
    bare, rtems = ((tmp_path / f"out/{name}.telemetry.txt").read_text() for name in ("leon3", "leon3-rtems"))
    assert bare == rtems


@ON_RTEMS
def test_two_boards_with_rtems_fly_in_one_run(tmp_path, capsys):
    assert cli.main(["fly", "formation", "sensed", "--for", "30s", "--on", "deputy=leon3-rtems,chief=leon3-rtems",
                     "--out", str(tmp_path)]) == 0, capsys.readouterr()
    rows = [line for line in capsys.readouterr().out.splitlines() if " on leon3-rtems" in line]
    assert len(rows) == 2 and all(" none " in row for row in rows)


@ON_RTEMS
def test_an_exported_folder_builds_as_its_page_says(tmp_path):
    assert cli.main(["export", "rtems", "nadir_spin", "--out", str(tmp_path)]) == 0
    done = subprocess.run(["make", f"RTEMS={HERE}", "BSP=leon3", "CFLAGS=-Os -Wall -Wextra -Werror"], cwd=tmp_path,
                          capture_output=True, text=True)
    assert done.returncode == 0 and (tmp_path / "nadir_spin").is_file(), done.stderr
    assert not TARGETS["leon3-rtems"].missing()
