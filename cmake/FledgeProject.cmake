# SPDX-License-Identifier: Apache-2.0
# A user's own modules and models, for find_package(Fledge).

include(FledgeIntrospect)

# fledge_project(<name> [FLIGHT <path>...] [WORLD <path>...] [EXISTING <file>...])
#
# Builds one shared library, which `./fledge --project` loads. In FLIGHT, a path such as
# flight/sun_slew stands for flight/sun_slew.c and flight/sun_slew_test.cpp; in WORLD, a path such as
# world/eddy_damping for world/eddy_damping_model.cpp and world/eddy_damping_model_test.cpp. Their
# interfaces, and messages, are the headers found in flight/ and world/. EXISTING C comes as it is: no
# warnings, GNU C11.
#
# The tests link <name>_code, which holds all of it but the tables.
function(fledge_project name)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "FLIGHT;WORLD;EXISTING")
    if(arg_UNPARSED_ARGUMENTS)
        message(FATAL_ERROR "fledge_project(${name}): what is ${arg_UNPARSED_ARGUMENTS}? "
            "It takes a name, then FLIGHT, WORLD and EXISTING with their lists")
    endif()
    set(loaded "")
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
        target_link_libraries(${name}_code PUBLIC fledge::flight fledge::world)
        if(arg_EXISTING)
            add_library(${name}_existing STATIC ${arg_EXISTING})
            fledge_common_options(${name}_existing)
            target_compile_options(${name}_existing PRIVATE -w)
            set_target_properties(${name}_existing PROPERTIES C_STANDARD 11 C_EXTENSIONS ON)
            target_link_libraries(${name}_code PUBLIC ${name}_existing)
        endif()

        # The tables of Fledge's own structs are found when Python loads the library, beside _core.
        add_library(${name} SHARED)
        set(folders "")
        set(built_by ${name}_code)
        if(arg_EXISTING)
            list(APPEND built_by ${name}_existing)
        endif()
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
        set(loaded "${name} $<TARGET_FILE:${name}>\n")

        list(TRANSFORM arg_WORLD APPEND _model OUTPUT_VARIABLE models)
        foreach(path IN LISTS arg_FLIGHT models)
            string(REPLACE / _ test ${path}_test)
            fledge_add_test(${test} SOURCES ${path}_test.cpp LIBRARIES ${name}_code fledge::tables)
        endforeach()
    endif()
    file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/fledge-libraries.txt CONTENT "${loaded}")
endfunction()
