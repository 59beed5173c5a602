# SPDX-License-Identifier: Apache-2.0
# Compile options for flight code (strict C99) and for C++, and the two that carry the promise
# of the same bits on every machine.

# Include paths are relative to the repository's root: #include "flight/math/vec.h".
#
# The floating-point options are PUBLIC, because headers hold inline arithmetic:
#   -ffp-contract=off  a*b + c is two roundings everywhere, also where the machine has FMA;
#   -fno-math-errno    sqrt is one instruction. It changes no result.
# Never -march=native, never -ffast-math (which flight/math refuses to compile with).
function(fledge_common_options target)
    target_include_directories(${target} PUBLIC
        $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${FLEDGE_HOME}>)
    target_compile_options(${target} PUBLIC -ffp-contract=off -fno-math-errno)
endfunction()

# Warnings are errors where Fledge is developed: CMAKE_COMPILE_WARNING_AS_ERROR is on in the presets for developers, and
# in the release preset after `./fledge setup --develop`. A compiler that came later has others, which must not stop
# those who only use Fledge.

# fledge_flight_options(<target>): C that flies. Strict C99, also clean as C11. Always with what a
# debugger needs (docs/debugging.md): it changes no instruction, and costs 0.4 MB and under a second.
function(fledge_flight_options target)
    fledge_common_options(${target})
    target_compile_options(${target} PRIVATE
        $<$<COMPILE_LANGUAGE:C>:-pedantic -Wall -Wextra -Wconversion -Wstrict-prototypes -g>
        $<$<COMPILE_LANG_AND_ID:C,GNU>:-Wcast-align=strict>)
endfunction()

# fledge_flight_symbols(<name> TARGETS <target>... [LIBRARIES <target>...] [ADVICE <text>])
#
# Adds a target that refuses C which does not keep the promise: it calls libm or the operating system, allocates, or
# keeps writable static variables. TARGETS, all of one folder, are checked; their C may call the LIBRARIES.
function(fledge_flight_symbols name)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "ADVICE" "TARGETS;LIBRARIES")
    set(program ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/flight_symbols.py)
    set(options --root ${CMAKE_CURRENT_SOURCE_DIR})
    if(arg_ADVICE)
        list(APPEND options --advice ${arg_ADVICE})
    endif()
    set(objects "")
    foreach(target IN LISTS arg_TARGETS)
        list(APPEND objects $<TARGET_OBJECTS:${target}>)
    endforeach()
    foreach(library IN LISTS arg_LIBRARIES)
        list(APPEND options --library $<TARGET_FILE:${library}>)
    endforeach()
    set(stamp ${CMAKE_CURRENT_BINARY_DIR}/${name}.stamp)
    add_custom_command(
        OUTPUT ${stamp}
        COMMAND ${Python_EXECUTABLE} ${program} ${options} ${objects}
        COMMAND ${CMAKE_COMMAND} -E touch ${stamp}
        DEPENDS ${program} ${objects} ${arg_LIBRARIES}
        COMMENT "Checking what flight code calls and keeps"
        COMMAND_EXPAND_LISTS VERBATIM)
    add_custom_target(${name} ALL DEPENDS ${stamp})
endfunction()

# Under the sanitizers only C++ that computes for long is optimised: that of folders that set FLEDGE_COMPUTING.
set(FLEDGE_COMPUTING_OPTIONS "" CACHE STRING "more compile options of C++ where FLEDGE_COMPUTING is set")
mark_as_advanced(FLEDGE_COMPUTING_OPTIONS)

# fledge_cxx_options(<target>): C++ of the kernel, the world and the tools. Not -pedantic, for the
# flight headers that it includes use C99's compound literals. What gcc 12 says at -O3 about the
# bounds of std::string and std::vector is false alarm; the sanitizers watch those. It warns of a class with a member
# from an anonymous namespace, unless that class stands in the file that is compiled: with FLEDGE_UNITY none does.
# clang warns of what gcc's own headers use, and takes a local name that a namespace has, too, for a shadow.
# gcc searches its memory for garbage each time that it has grown by a third, which takes a seventh of the time of a
# large object: below 1 GB it need not. The largest objects take 1.6 GB so, and 1.1 GB else.
function(fledge_cxx_options target)
    fledge_common_options(${target})
    set_target_properties(${target} PROPERTIES UNITY_BUILD ${FLEDGE_UNITY} UNITY_BUILD_BATCH_SIZE 0)
    target_compile_options(${target} PRIVATE
        $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wnon-virtual-dtor>
        $<$<COMPILE_LANG_AND_ID:CXX,Clang>:-Wno-deprecated-declarations>
        $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wshadow -Wno-restrict -Wno-array-bounds -Wno-stringop-overflow
            $<$<BOOL:${FLEDGE_UNITY}>:-Wno-subobject-linkage>
            --param=ggc-min-expand=100 --param=ggc-min-heapsize=1000000>)
    if(FLEDGE_COMPUTING)
        target_compile_options(${target} PRIVATE ${FLEDGE_COMPUTING_OPTIONS})
    endif()
endfunction()

# fledge_precompile(<target> <header>...): compile headers of libraries once for all sources of a target in C++.
# For a library that is one object (FLEDGE_UNITY) they cost more than they save.
function(fledge_precompile target)
    target_precompile_headers(${target} PRIVATE ${ARGN})
    target_compile_options(${target} PRIVATE -fpch-preprocess)    # so that ccache can cache them
endfunction()
