# SPDX-License-Identifier: Apache-2.0
# Flight code once more, compiled so that it counts what it does: what runs with it is observed. Only its C is compiled
# again; what flies and what tests it are linked again, with the objects they have.
#
# A kind of such a build has a name, a launcher in place of the compiler, the options of its C, the options of the link,
# and C that is compiled with it:
#   mcdc        which conditions have decided, as clang counts them (studies/verify/decisions.py)
#   branches    which branches each run of a campaign takes (studies/falsify). Its options turn off the
#               optimisations that replace a small branch by a select

set(FLEDGE_OBSERVED mcdc branches)
set(FLEDGE_OBSERVED_mcdc_LAUNCHER sh ${CMAKE_CURRENT_LIST_DIR}/by_clang.sh)     # an install leaves it no program
set(FLEDGE_OBSERVED_mcdc_OPTIONS -O1 -fprofile-instr-generate -fcoverage-mapping -fcoverage-mcdc)
set(FLEDGE_OBSERVED_mcdc_LINK -fprofile-instr-generate)
set(FLEDGE_OBSERVED_mcdc_SOURCES ${CMAKE_CURRENT_LIST_DIR}/observed_mcdc.c)
set(FLEDGE_OBSERVED_branches_LAUNCHER ${FLEDGE_OBSERVED_mcdc_LAUNCHER})
set(FLEDGE_OBSERVED_branches_OPTIONS -O1 -fsanitize-coverage=trace-pc-guard
    "SHELL:-mllvm -phi-node-folding-threshold=0" "SHELL:-mllvm -two-entry-phi-node-folding-threshold=0"
    "SHELL:-mllvm -bonus-inst-threshold=0")
set(FLEDGE_OBSERVED_branches_LINK "")
set(FLEDGE_OBSERVED_branches_SOURCES ${CMAKE_CURRENT_LIST_DIR}/observed_branches.c)

foreach(kind IN LISTS FLEDGE_OBSERVED)
    add_custom_target(${kind})              # what Python loads
    add_custom_target(${kind}_tests)
endforeach()

# fledge_sources(<variable> <target> <extension>): the absolute paths of its sources.
function(fledge_sources variable target extension)
    get_target_property(sources ${target} SOURCES)
    get_target_property(folder ${target} SOURCE_DIR)
    list(FILTER sources INCLUDE REGEX "[.]${extension}$")
    set(paths "")
    foreach(source IN LISTS sources)
        cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
        list(APPEND paths ${source})
    endforeach()
    set(${variable} ${paths} PARENT_SCOPE)
endfunction()

# fledge_observed_objects(<name> TARGETS <target>...): for each kind, the objects <name>_<kind> of these targets' C.
function(fledge_observed_objects name)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "TARGETS")
    set(all "")
    set(folders "")
    foreach(target IN LISTS arg_TARGETS)
        fledge_sources(sources ${target} c)
        list(APPEND all ${sources})
        list(APPEND folders $<TARGET_PROPERTY:${target},INCLUDE_DIRECTORIES>)
    endforeach()
    foreach(kind IN LISTS FLEDGE_OBSERVED)
        set(own ${name}_${kind})
        add_library(${own} OBJECT EXCLUDE_FROM_ALL ${all} ${FLEDGE_OBSERVED_${kind}_SOURCES})
        # GNU C11, as the existing C of projects.
        set_target_properties(${own} PROPERTIES
            C_STANDARD 11 C_EXTENSIONS ON C_COMPILER_LAUNCHER "${FLEDGE_OBSERVED_${kind}_LAUNCHER}")
        target_include_directories(${own} PRIVATE ${folders})
        target_compile_options(${own} PRIVATE
            -ffp-contract=off -fno-math-errno -w -g ${FLEDGE_OBSERVED_${kind}_OPTIONS})
    endforeach()
endfunction()

# fledge_observed(<target> OBJECTS <name> [HEADERS]): for each kind, <target>_<kind>: the same program or library with
# the objects <name>_<kind>. They come first, so that nothing of the libraries takes their place. HEADERS: its own
# sources are compiled so, too, for what it runs is inline. What Python loads lies in build/<preset>/python_<kind>,
# programs in tests_<kind>.
function(fledge_observed target)
    cmake_parse_arguments(PARSE_ARGV 1 arg "HEADERS" "OBJECTS" "")
    get_target_property(type ${target} TYPE)
    string(REPLACE _LIBRARY "" type ${type})
    foreach(kind IN LISTS FLEDGE_OBSERVED)
        set(own ${target}_${kind})
        set(sources $<TARGET_OBJECTS:${target}>)
        if(arg_HEADERS)
            fledge_sources(sources ${target} cpp)
        endif()
        list(APPEND sources $<TARGET_OBJECTS:${arg_OBJECTS}_${kind}>)
        if(type STREQUAL EXECUTABLE)
            add_executable(${own} EXCLUDE_FROM_ALL ${sources})
            add_dependencies(${kind}_tests ${own})
        else()
            add_library(${own} ${type} EXCLUDE_FROM_ALL ${sources})
            add_dependencies(${kind} ${own})
        endif()
        foreach(property PREFIX SUFFIX)     # pybind11 has its own
            get_target_property(value ${target} ${property})
            if(NOT value MATCHES NOTFOUND)
                set_target_properties(${own} PROPERTIES ${property} "${value}")
            endif()
        endforeach()
        set_target_properties(${own} PROPERTIES OUTPUT_NAME ${target} LINKER_LANGUAGE CXX
            LIBRARY_OUTPUT_DIRECTORY ${FLEDGE_PYTHON_DIR}_${kind}
            RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests_${kind}
            CXX_COMPILER_LAUNCHER "${FLEDGE_OBSERVED_${kind}_LAUNCHER}"
            CXX_LINKER_LAUNCHER "${FLEDGE_OBSERVED_${kind}_LAUNCHER}")
        target_compile_options(${own} PRIVATE -w ${FLEDGE_OBSERVED_${kind}_OPTIONS})
        target_compile_definitions(${own} PRIVATE $<TARGET_PROPERTY:${target},COMPILE_DEFINITIONS>)
        target_link_libraries(${own} PRIVATE $<TARGET_PROPERTY:${target},LINK_LIBRARIES>)
        target_link_options(${own} PRIVATE ${FLEDGE_OBSERVED_${kind}_LINK})
    endforeach()
endfunction()
