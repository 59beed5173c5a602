# SPDX-License-Identifier: Apache-2.0
"""Flying in a cFS tree: what is done to a copy of the tree, and how its core is started. The tree here is a stand-in
with the interface of the real one's build (definitions, app list, start-up script, functions of CMake) and the pocket
cFE in place of cFE."""

import pytest

from fledge import cli
from fledge.archive import Archive
from fledge.archive.compare import compare
from fledge.targets import build

MAKEFILE = """\
B = build
prep:
    cmake -S cfe -B $(B) -DDEFS=$(CURDIR)/$(MISSIONCONFIG)_defs -DCMAKE_BUILD_TYPE=$(SIMULATION) >/dev/null
install:
    cmake --build $(B) >/dev/null
    mkdir -p $(B)/exe/cpu1/cf
    mv $(B)/core-cpu1 $(B)/exe/cpu1
    cp $(MISSIONCONFIG)_defs/cpu1_cfe_es_startup.scr $(B)/exe/cpu1/cf/cfe_es_startup.scr
    cp $(B)/*.tbl $(B)/exe/cpu1/cf
""".replace("    ", "\t")
LISTS = """\
cmake_minimum_required(VERSION 3.5)
project(CFETOP C)
set(ROOT "@ROOT@")
set(CMAKE_C_FLAGS "-std=c99 -pedantic -Wall -Wstrict-prototypes -Wwrite-strings -Wpointer-arith -Werror -fno-common")
include_directories(${ROOT} ${ROOT}/targets/cfs/inc)
function(add_cfe_app name)
    add_library(${name} STATIC ${ARGN})
endfunction()
function(add_cfe_tables app)
    foreach(source ${ARGN})
        get_filename_component(stem ${source} NAME_WE)
        add_library(${stem}_table OBJECT ${source})
        file(COPY ${CMAKE_CURRENT_SOURCE_DIR}/cf/${stem}.tbl DESTINATION ${CMAKE_BINARY_DIR})
    endforeach()
endfunction()
function(generate_config_includefile)
    cmake_parse_arguments(G "" "FILE_NAME;FALLBACK_FILE" "" ${ARGN})
    file(WRITE ${CMAKE_BINARY_DIR}/inc/${G_FILE_NAME} "#include \\"${G_FALLBACK_FILE}\\"\\n")
endfunction()
include_directories(${CMAKE_BINARY_DIR}/inc)
include(${DEFS}/targets.cmake)
foreach(app ${cpu1_APPLIST})
    include(${CMAKE_SOURCE_DIR}/../apps/${app}/mission_build.cmake OPTIONAL)
    include(${CMAKE_SOURCE_DIR}/../apps/${app}/arch_build.cmake OPTIONAL)
endforeach()
file(GLOB pocket ${ROOT}/targets/cfs/*.c)
list(FILTER pocket EXCLUDE REGEX "watch.c")
set(listed "#include \\"targets/cfs/pocket.h\\"\\n")
foreach(app ${cpu1_APPLIST})
    string(TOUPPER ${app} upper)
    string(APPEND listed "void ${upper}_AppMain(void);\\n")
    string(APPEND entries "{\\"${upper}_AppMain\\", ${upper}_AppMain}, ")
endforeach()
file(WRITE ${CMAKE_BINARY_DIR}/apps.c "${listed}extern const PocketApp fledge_apps[];\\n"
    "extern const uint32 fledge_apps_n;\\n"
    "const PocketApp fledge_apps[] = {${entries}};\\n"
    "const uint32 fledge_apps_n = sizeof fledge_apps / sizeof fledge_apps[0];\\n")
add_executable(core-cpu1 ${pocket} ${CMAKE_BINARY_DIR}/apps.c)
target_link_libraries(core-cpu1 ${cpu1_APPLIST} pthread)
foreach(app ${cpu1_APPLIST})
    add_subdirectory(../apps/${app} apps/${app})
endforeach()
"""


@pytest.fixture()
def tree(tmp_path):
    tree = tmp_path / "cFS"
    for name in ("cfe/cmake/sample_defs", "osal", "psp", "apps", ".git"):
        (tree / name).mkdir(parents=True)
    (tree / "cfe/CMakeLists.txt").write_text(LISTS.replace("@ROOT@", str(build.ROOT)))
    (tree / "cfe/cmake/Makefile.sample").write_text(MAKEFILE)
    (tree / "cfe/cmake/sample_defs/targets.cmake").write_text("set(cpu1_APPLIST)\n")
    (tree / "cfe/cmake/sample_defs/cpu1_cfe_es_startup.scr").write_text("!\n! this does not count\nCFE_APP...\n")
    return tree


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.long("builds and flies in a tree like that of cFS")
def test_a_mission_is_built_and_flown_in_a_copy_of_a_tree(tree, tmp_path, capsys):
    before = files(tree)
    out = tmp_path / "out"
    fly = ["fly", "nadir_spin", "--for", "10s", "--on", "cfs", "--cfs", str(tree), "--out", str(out)]
    for _ in range(2):                              # again: what was added is not added twice
        assert cli.main(fly) == 0, capsys.readouterr()
        rows = [line.split() for line in capsys.readouterr().out.splitlines()]
        cfs = next(row for row in rows if row and row[0] == "cfs")
        assert cfs[1] == "21" and cfs[3] == "none"
        desktop, flown = Archive(out / "desktop.mcap"), Archive(out / "cfs.mcap")
        assert compare(desktop, flown, [t for t in desktop.topics if t.startswith("/flight/")]) == []
    assert files(tree) == before
    definitions = out / "cfs_tree/sample_defs"
    assert (definitions / "targets.cmake").read_text().count("list(APPEND cpu1_APPLIST fsw)") == 1
    script = (definitions / "cpu1_cfe_es_startup.scr").read_text()
    assert script.startswith("CFE_APP, fsw, FSW_AppMain, FSW,") and script.count("FSW_AppMain") == 1
    assert not (out / "cfs_tree/.git").exists()


def test_what_its_build_says_is_reported(tree, tmp_path, capsys):
    (tree / "Makefile").write_text("prep:\n\t@echo no toolchain; false\n")
    (tree / "sample_defs").mkdir()
    (tree / "sample_defs/targets.cmake").write_text("")
    assert cli.main(["fly", "nadir_spin", "--for", "1s", "--on", "cfs", "--cfs", str(tree), "--out",
                     str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    assert "make prep failed" in error and "no toolchain" in error


@pytest.mark.long("builds a tree like that of cFS")
def test_a_bundle_of_configurations_is_built_by_goals_of_its_own_and_its_script_is_made(tree, tmp_path, capsys):
    sample = tree / "sample_defs"
    (tree / "cfe/cmake/sample_defs").rename(sample)
    (sample / "cpu1_cfe_es_startup.scr").unlink()
    (sample / "generate_startup.cmake").write_text(
        'function (generate_cfs_startup_script to)\n'
        '    set (STARTUP_FILE "${to}/cpu1_cfe_es_startup.scr")\n'
        '    file (WRITE ${STARTUP_FILE} "")\n'
        'endfunction(generate_cfs_startup_script)\n')
    (tree / "target-configs.mk").write_text("ARCH_native_eds = native\nARCH_native_std = native\nARCH_pi = arm\n")
    script = '\tcmake -P $(CURDIR)/$(MISSIONCONFIG)_defs/make.cmake\n'
    (sample / "make.cmake").write_text("include(${CMAKE_CURRENT_LIST_DIR}/generate_startup.cmake)\n"
                                       "generate_cfs_startup_script(${CMAKE_CURRENT_LIST_DIR})\n")
    text = MAKEFILE.replace("B = build", "B = build-native_std").replace("prep:\n", "native_std.prep:\n" + script)
    (tree / "Makefile").write_text(text.replace("\ninstall:", "\nnative_std.install:") +
                                   "prep install:\n\t@echo another compiler is missing; false\n")
    out = tmp_path / "out"
    assert cli.main(["fly", "nadir_spin", "--for", "1s", "--on", "cfs", "--cfs", str(tree), "--out",
                     str(out)]) == 0, capsys.readouterr()
    assert (out / "cfs_tree/build-native_std/exe/cpu1/core-cpu1").is_file()
    other = tree.rename(tmp_path / "other")         # what stands in the copy of another tree is not mixed with it
    (other / "target-configs.mk").write_text("ARCH_pi = arm\n")
    assert cli.main(["fly", "nadir_spin", "--for", "1s", "--on", "cfs", "--cfs", str(other), "--out",
                     str(out)]) in (1, 2)
    assert "has no configuration for this machine" in capsys.readouterr().err
    assert not (out / "cfs_tree/build-native_std").exists()


def test_a_queue_that_is_too_short_is_reported(tree, tmp_path, capsys):
    lists = tree / "cfe/CMakeLists.txt"
    (tree / "core.c").write_text('#include <stdio.h>\nint main(void)\n{\n    puts("the msg_max parameter");\n'
                                 '    return 1;\n}\n')
    lists.write_text("cmake_minimum_required(VERSION 3.5)\nproject(CFETOP C)\nadd_executable(core-cpu1 ../core.c)\n")
    (tree / "cfe/cmake/Makefile.sample").write_text(MAKEFILE.replace("\tcp $(B)/*.tbl $(B)/exe/cpu1/cf\n", ""))
    assert cli.main(["fly", "nadir_spin", "--for", "1s", "--on", "cfs", "--cfs", str(tree), "--out",
                     str(tmp_path / "out")]) == 1
    assert "as root: echo 64 > /proc/sys/fs/mqueue/msg_max" in capsys.readouterr().err


@pytest.mark.parametrize("options, says", [
    (["--on", "cfs", "--cfs", "."], "this is no cFS tree, for it has no cfe, osal, psp"),
    (["--on", "linux", "--cfs", "."], "--cfs is for --on cfs")])
def test_what_is_no_tree_is_refused(options, says, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["fly", "nadir_spin", *options]) == 2
    assert says in capsys.readouterr().err
