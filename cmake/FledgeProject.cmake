# SPDX-License-Identifier: Apache-2.0
# A user's own modules and models, for find_package(Fledge).

include(FledgeIntrospect)

# fledge_project(<name> [FLIGHT <path>...] [WORLD <path>...] [EXISTING <file>...] [NOT_FLOWN <file>...])
#
# Builds one shared library, which `./fledge --project` loads. In FLIGHT, a path such as
# flight/sun_slew stands for flight/sun_slew.c and flight/sun_slew_test.cpp; in WORLD, a path such as
# world/gas_leak for world/gas_leak_model.cpp and world/gas_leak_model_test.cpp. A test need not be there. Their
# interfaces, and messages, are the headers found in flight/ and world/. EXISTING C comes as it is: no
# warnings, GNU C11. C of FLIGHT and EXISTING that does not compute the same bits everywhere is refused (see
# fledge_flight_symbols()); C that only models of the world call is NOT_FLOWN, and may call all.
#
# The tests link <name>_code, which holds all of it but the tables.
function(fledge_project name)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "FLIGHT;WORLD;EXISTING;NOT_FLOWN")
    if(arg_UNPARSED_ARGUMENTS)
        message(FATAL_ERROR "fledge_project(${name}): what is ${arg_UNPARSED_ARGUMENTS}? "
            "It takes a name, then FLIGHT, WORLD, EXISTING and NOT_FLOWN with their lists")
    endif()
    set(loaded "")
    set(found "")
    if(arg_FLIGHT OR arg_WORLD)
        list(TRANSFORM arg_FLIGHT APPEND .c OUTPUT_VARIABLE modules)
        list(TRANSFORM arg_WORLD APPEND _model.cpp OUTPUT_VARIABLE models)
        foreach(source IN LISTS modules models)
            if(NOT EXISTS ${PROJECT_SOURCE_DIR}/${source})
                message(FATAL_ERROR "CMakeLists.txt lists ${source} in fledge_project(), and there is no such file")
            endif()
        endforeach()
        add_library(${name}_code STATIC ${modules} ${models})
        fledge_flight_options(${name}_code)
        fledge_cxx_options(${name}_code)
        set_target_properties(${name}_code PROPERTIES UNITY_BUILD OFF)  # few sources, that change often
        target_link_libraries(${name}_code PUBLIC fledge::flight fledge::world)
        set(built_by ${name}_code)
        foreach(kind EXISTING NOT_FLOWN)
            if(arg_${kind})
                set(target ${name}_${kind})
                string(TOLOWER ${target} target)
                add_library(${target} STATIC ${arg_${kind}})
                fledge_common_options(${target})
                # gcc 14 takes some warnings for errors.
                target_compile_options(${target} PRIVATE -w -Wno-error=implicit-function-declaration
                    -Wno-error=int-conversion -Wno-error=incompatible-pointer-types -g)
                set_target_properties(${target} PROPERTIES C_STANDARD 11 C_EXTENSIONS ON)
                target_link_libraries(${name}_code PUBLIC ${target})
            endif()
        endforeach()
        if(TARGET ${name}_existing)
            list(APPEND built_by ${name}_existing)
        endif()
        fledge_flight_symbols(${name}_symbols TARGETS ${built_by} LIBRARIES fledge::flight fledge::math
            ADVICE "C that never flies stands below NOT_FLOWN in fledge_project()")

        # The tables of Fledge's own structs are found when Python loads the library, beside _core.
        add_library(${name} SHARED)
        set(folders "")
        if(EXISTS ${PROJECT_SOURCE_DIR}/flight)
            list(APPEND folders MODULES flight)
        endif()
        if(EXISTS ${PROJECT_SOURCE_DIR}/world)
            list(APPEND folders MODELS world EMIT tables layout stubs models)
        endif()
        fledge_introspect(${name} LIBRARY ${name} ${folders}
            BUILT_BY ${built_by} LINE "{path} below {list} in fledge_project() of CMakeLists.txt")
        set_target_properties(${name} PROPERTIES C_VISIBILITY_PRESET default)
        target_link_libraries(${name} PRIVATE ${name}_code)
        add_dependencies(${name} ${name}_symbols)
        set(loaded "${name} $<TARGET_FILE:${name}>\n")
        fledge_observed_objects(${name}_code TARGETS ${built_by})
        fledge_observed(${name} OBJECTS ${name}_code)

        # Without one, the test may be in Python, as `fledge new --from` writes it. The launcher reads the list, and
        # configures anew where a test has come or gone.
        list(TRANSFORM arg_WORLD APPEND _model OUTPUT_VARIABLE models)
        foreach(path IN LISTS arg_FLIGHT models)
            if(NOT EXISTS ${PROJECT_SOURCE_DIR}/${path}_test.cpp)
                string(APPEND found "- ${path}_test.cpp\n")
                continue()
            endif()
            string(APPEND found "+ ${path}_test.cpp\n")
            string(REPLACE / _ test ${path}_test)
            fledge_add_test(${test} SOURCES ${path}_test.cpp LIBRARIES ${name}_code fledge::tables)
            if(BUILD_TESTING)
                fledge_observed(${test} OBJECTS ${name}_code)
            endif()
        endforeach()
    endif()
    file(WRITE ${PROJECT_BINARY_DIR}/fledge-tests.txt "${found}")

    # Editors look for types in one folder of the project: beside its own, links to Fledge's.
    file(GLOB types ${FLEDGE_ROOT}/python/fledge ${FLEDGE_STUBS}/_[cefg]*.pyi)    # not those of a project
    file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/stubs)
    foreach(path IN LISTS types)
        get_filename_component(name ${path} NAME)
        file(CREATE_LINK ${path} ${PROJECT_BINARY_DIR}/stubs/${name} SYMBOLIC)
    endforeach()
    file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/fledge-libraries.txt CONTENT "${loaded}")
    foreach(kind IN LISTS FLEDGE_OBSERVED)
        string(REPLACE ">" "_${kind}>" observed "${loaded}")
        file(GENERATE OUTPUT ${FLEDGE_PYTHON_DIR}_${kind}/fledge-libraries.txt CONTENT "${observed}")
    endforeach()
endfunction()
