# SPDX-License-Identifier: Apache-2.0
# Extensions of Python, by pybind11.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module NumPy)
find_package(pybind11 REQUIRED)

# Most functions of the extensions only call what the libraries do: to optimise them costs seconds, and gains nothing.
set(only_calls $<$<CONFIG:Release>:-O1>)

# fledge_extension_stub(<extension>): the target <extension>_stub, its types for editors and type checkers, as pybind11
# knows them. With the address sanitizer, Python loads that library first; with that of threads it does not start.
function(fledge_extension_stub extension)
    string(TOUPPER "${CMAKE_BUILD_TYPE}" kind)
    set(flags "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${kind}}")
    set(environment PYTHONPATH=${FLEDGE_PYTHON_DIR}:${PROJECT_SOURCE_DIR}/python)
    if(flags MATCHES "-fsanitize=address")
        foreach(library asan stdc++)
            execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=lib${library}.so
                OUTPUT_VARIABLE path OUTPUT_STRIP_TRAILING_WHITESPACE)
            string(APPEND preload ":${path}")
        endforeach()
        list(APPEND environment LD_PRELOAD=${preload} ASAN_OPTIONS=detect_leaks=0)
    endif()
    set(stub ${PROJECT_BINARY_DIR}/introspect/stubs/${extension}.pyi)
    if(flags MATCHES "-fsanitize=thread")
        set(stub "")
    else()
        add_custom_command(OUTPUT ${stub}
            COMMAND ${CMAKE_COMMAND} -E env ${environment} ${Python_EXECUTABLE}
                ${PROJECT_SOURCE_DIR}/cmake/extension_stubs.py ${extension} ${stub}
            DEPENDS ${extension} _core ${PROJECT_SOURCE_DIR}/cmake/extension_stubs.py
            COMMENT "Reading the types of ${extension}"
            VERBATIM)
    endif()
    add_custom_target(${extension}_stub ALL DEPENDS ${stub})
endfunction()

# fledge_add_extension(<extension> SOURCES <file>... LIBRARIES <target>...): an extension beside `_core`, for the Python
# of the folder that calls this.
function(fledge_add_extension extension)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LIBRARIES")
    pybind11_add_module(${extension} MODULE NO_EXTRAS ${arg_SOURCES})
    fledge_cxx_options(${extension})
    target_compile_options(${extension} PRIVATE ${only_calls})
    target_include_directories(${extension} PRIVATE ${PROJECT_SOURCE_DIR}/python/fledge)
    target_link_libraries(${extension} PRIVATE ${arg_LIBRARIES})
    set_target_properties(${extension} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${FLEDGE_PYTHON_DIR})
    fledge_extension_stub(${extension})
endfunction()
