# SPDX-License-Identifier: Apache-2.0
# Tables and layout checks from headers, by the reader in introspect/.

get_filename_component(FLEDGE_ROOT ${CMAKE_CURRENT_LIST_DIR}/.. ABSOLUTE)

# fledge_introspect(<target> LIBRARY <name> [ROOT <dir>] [MODULES <dir>...] [MODELS <dir>...]
#                   [INCLUDE <dir>...] [EMIT <what>...] [BUILT_BY <target>... LINE <text>])
#
# Adds to a target what follows from the headers of a library:
#   tables  its structs as data: `fledge_library_<name>`, see sim/table.h
#   layout  a file that compiles only where structs lie in memory as the tables say
#   orders  the byte order of its messages: `fledge_messages_<name>`, see registers/message.h
#   models  what makes its models: `fledge_models_<name>`, see sim/model_library.h
#   functions  what Python may call of its math/: `fledge_functions_<name>`, see sim/function.h
#   stubs   stubs/*.pyi, its types for Python's editors and type checkers
#   protocol  _fledge_protocol.py, what a ground and a flight process must agree on
# Without EMIT: tables, layout and stubs. Folders are relative to ROOT (default: the project); INCLUDE names
# further roots that headers include from, besides Fledge itself. BUILT_BY names the targets that compile the
# modules or models: one whose source lies beside its header and is not compiled is refused. LINE says what to add
# where, with {path}, {short} (the path within its first folder) and {list} (FLIGHT or WORLD).
#
# The reader walks the folders, so that a new header costs no line here. It runs again when a header
# or folder changes, and rewrites only what reads differently.
function(fledge_introspect target)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "LIBRARY;ROOT;LINE" "MODULES;MODELS;INCLUDE;EMIT;BUILT_BY")
    if(NOT arg_LIBRARY OR arg_UNPARSED_ARGUMENTS)
        message(FATAL_ERROR "fledge_introspect(${target}): give LIBRARY <name>, and only what it takes")
    endif()
    if(NOT arg_ROOT)
        set(arg_ROOT ${PROJECT_SOURCE_DIR})
    endif()
    if(NOT arg_EMIT)
        set(arg_EMIT tables layout stubs)
    endif()

    set(options --library ${arg_LIBRARY} --root ${arg_ROOT})
    foreach(folder IN LISTS arg_MODULES)
        list(APPEND options --modules ${folder})
    endforeach()
    foreach(folder IN LISTS arg_MODELS)
        list(APPEND options --models ${folder})
    endforeach()
    foreach(folder IN LISTS arg_INCLUDE ITEMS ${FLEDGE_ROOT})
        list(APPEND options --include ${folder})
    endforeach()

    foreach(one IN LISTS arg_BUILT_BY)
        list(APPEND options --compiled $<TARGET_PROPERTY:${one},SOURCE_DIR> $<TARGET_PROPERTY:${one},SOURCES>)
    endforeach()
    if(arg_LINE)
        list(APPEND options --line ${arg_LINE})
    endif()

    set(out ${CMAKE_CURRENT_BINARY_DIR})
    set(written "")
    foreach(what IN LISTS arg_EMIT)
        list(APPEND options --emit ${what})
        list(APPEND written ${out}/${arg_LIBRARY}_${what})
    endforeach()
    list(TRANSFORM written APPEND .c REGEX "_(tables|layout|orders|functions)$")
    list(TRANSFORM written APPEND .cpp REGEX "_models$")
    list(TRANSFORM written REPLACE "^.*_protocol$" ${FLEDGE_PYTHON_DIR}/_fledge_protocol.py)
    if(arg_LIBRARY MATCHES "^(flight|world)$")
        list(TRANSFORM written REPLACE "[^/]*_stubs$" stubs/_fledge_${arg_LIBRARY}.pyi)
    else()
        list(TRANSFORM written REPLACE "[^/]*_stubs$" stubs/_project_flight.pyi)
    endif()
    list(GET written 0 first)
    add_custom_command(
        OUTPUT ${written}
        COMMAND ${CMAKE_COMMAND} -E env PYTHONPATH=${FLEDGE_ROOT}
            ${Python_EXECUTABLE} -m introspect ${options} --out ${out} --depfile ${first}.d
        DEPFILE ${first}.d
        COMMENT "Reading the headers of ${arg_LIBRARY}"
        VERBATIM)
    # Ninja runs a command after what all its targets depend on. A target of its own depends on nothing: headers are
    # read, and the sources after them compiled, before the libraries are built that the other target links.
    add_custom_target(${target}_${arg_LIBRARY}_headers DEPENDS ${written})
    add_dependencies(${target} ${target}_${arg_LIBRARY}_headers)
    # A program that makes no models by name links them without their tables.
    set_source_files_properties(${written} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    target_sources(${target} PRIVATE ${written})
    target_include_directories(${target} PRIVATE ${arg_ROOT} ${arg_INCLUDE} ${FLEDGE_ROOT})
endfunction()
