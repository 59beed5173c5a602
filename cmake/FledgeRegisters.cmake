# SPDX-License-Identifier: Apache-2.0
# Boards of the register space, from their TOML files.

get_filename_component(FLEDGE_ROOT ${CMAKE_CURRENT_LIST_DIR}/.. ABSOLUTE)
set(FLEDGE_REGISTERS_LIST_DIR ${FLEDGE_ROOT} CACHE INTERNAL "where the package `registers` is")

# fledge_registers(<target> BOARDS <file>...)
#
# Adds to a target the tables of boards, and their headers to what it and its users include:
# `#include <io_board_a.h>` of io_board_a.toml, a board named as its file.
function(fledge_registers target)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "BOARDS")
    if(NOT arg_BOARDS OR arg_UNPARSED_ARGUMENTS)
        message(FATAL_ERROR "fledge_registers(${target}): give BOARDS <file>..., and nothing else")
    endif()
    set(root ${FLEDGE_REGISTERS_LIST_DIR})
    set(out ${CMAKE_CURRENT_BINARY_DIR}/boards_${target})
    set(written "")
    set(files "")
    foreach(board IN LISTS arg_BOARDS)
        get_filename_component(file ${board} ABSOLUTE)
        get_filename_component(name ${board} NAME_WE)
        list(APPEND files ${file})
        list(APPEND written ${out}/${name}.c ${out}/${name}.h ${out}/${name}.md)
    endforeach()
    # All are read together: boards do not overlap. What is unchanged is not written: so the stamp.
    add_custom_command(
        OUTPUT ${out}/stamp
        BYPRODUCTS ${written}
        COMMAND ${CMAKE_COMMAND} -E env PYTHONPATH=${root}
            ${Python_EXECUTABLE} -m registers ${files} --out ${out} --depfile ${out}/stamp.d
        COMMAND ${CMAKE_COMMAND} -E touch ${out}/stamp
        DEPENDS ${files}
        DEPFILE ${out}/stamp.d
        COMMENT "Reading the boards of ${target}"
        VERBATIM)
    set(sources ${written})
    list(FILTER sources INCLUDE REGEX "[.][ch]$")
    target_sources(${target} PRIVATE ${out}/stamp ${sources})
    target_include_directories(${target} PUBLIC ${out} ${root})
endfunction()
