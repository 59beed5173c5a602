# SPDX-License-Identifier: Apache-2.0
# Unit tests in GoogleTest. The target `tests` builds them; `all` does not, so that a flight does not
# wait for its tests. A program has the tests of a folder; ctest starts it once for each
# source; `./fledge test -k` selects cases by GTEST_FILTER, and counts them in GoogleTest's own reports. The target
# tests-A-B builds those of the folder A/B and below, for `./fledge test A/B`.

add_custom_target(tests)
add_custom_target(tests-in-python)      # what those call beside the product
add_dependencies(tests tests-in-python)
file(WRITE ${PROJECT_BINARY_DIR}/tests.txt "")      # on each line a program and its sources: tests/changed.py reads it

# A test runs once: to optimise its source takes longer than it saves. A folder whose tests compute for long or with
# Eigen sets FLEDGE_COMPUTING_TESTS. The code under test keeps the options of its library.
set(FLEDGE_TEST_OPTIONS "" CACHE STRING "compile options of the sources of tests")
set(FLEDGE_COMPUTING_TEST_OPTIONS "" CACHE STRING "more compile options of tests where FLEDGE_COMPUTING_TESTS is set")
mark_as_advanced(FLEDGE_TEST_OPTIONS FLEDGE_COMPUTING_TEST_OPTIONS)

if(BUILD_TESTING)
    find_package(GTest REQUIRED)
    add_library(fledge_test_main STATIC EXCLUDE_FROM_ALL ${CMAKE_CURRENT_LIST_DIR}/test_main.cpp)
    fledge_cxx_options(fledge_test_main)
    target_link_libraries(fledge_test_main PUBLIC GTest::gtest)
endif()

# fledge_add_test(<program> SOURCES <file>... [LIBRARIES <target>...])
#
# Adds tests to a program; several calls may name the same one. ctest has a test for each source NAME_test.cpp, whose
# name is the path of the source below the project (a.b.x_test of a/b/x_test.cpp), and whose label is the program.
function(fledge_add_test program)
    if(NOT BUILD_TESTING)
        return()
    endif()
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LIBRARIES")
    if(NOT TARGET ${program})
        add_executable(${program} EXCLUDE_FROM_ALL)
        fledge_cxx_options(${program})
        set_target_properties(${program} PROPERTIES UNITY_BUILD_BATCH_SIZE 8)   # so that all processors compile
        # What gcc 12 says at -O1 about Eigen's unset members is false alarm.
        target_compile_options(${program} PRIVATE ${FLEDGE_TEST_OPTIONS} -Wno-maybe-uninitialized)
        set(headers fledge_test_headers)
        if(FLEDGE_COMPUTING_TESTS)
            set(headers fledge_eigen_test_headers)
            target_compile_options(${program} PRIVATE ${FLEDGE_COMPUTING_TEST_OPTIONS})
        endif()
        target_compile_definitions(${program} PRIVATE FLEDGE_ROOT="${PROJECT_SOURCE_DIR}")
        if(TARGET ${headers})
            target_compile_options(${program} PRIVATE -fpch-preprocess)
            target_precompile_headers(${program} REUSE_FROM ${headers})
        endif()
        add_dependencies(tests ${program})
    endif()
    target_sources(${program} PRIVATE ${arg_SOURCES})
    target_link_libraries(${program} PRIVATE ${arg_LIBRARIES} fledge_test_main)
    foreach(source IN LISTS arg_SOURCES)
        get_filename_component(source ${source} ABSOLUTE)
        file(RELATIVE_PATH path ${PROJECT_SOURCE_DIR} ${source})
        file(APPEND ${PROJECT_BINARY_DIR}/tests.txt "${program} ${path}\n")
        get_filename_component(folder ${path} DIRECTORY)
        while(folder AND PROJECT_NAME STREQUAL fledge)
            string(REPLACE / - tests tests-${folder})
            if(NOT TARGET ${tests})
                add_custom_target(${tests})
            endif()
            add_dependencies(${tests} ${program})
            get_filename_component(folder ${folder} DIRECTORY)
        endwhile()
        if(path MATCHES "^(.*_test)[.]cpp$")
            string(REPLACE / . test ${CMAKE_MATCH_1})
            get_property(tests GLOBAL PROPERTY FLEDGE_TESTS)
            if(test IN_LIST tests)
                string(APPEND test .${program})     # a source of two programs
            endif()
            set_property(GLOBAL APPEND PROPERTY FLEDGE_TESTS ${test})
            add_test(NAME ${test} COMMAND ${program} --source=${path} --report=${test})
            set_tests_properties(${test} PROPERTIES TIMEOUT 1200 LABELS "gtest;${program}")
        else()      # what tests share may replace functions of the library, as `operator new`
            set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
        endif()
    endforeach()
endfunction()

# fledge_precompile_test_headers(<header>...): compile headers of the system once, with <Eigen/Dense> and without, for
# all tests that follow.
function(fledge_precompile_test_headers)
    if(NOT BUILD_TESTING)
        return()
    endif()
    # An executable as the tests are: gcc takes only headers that were compiled with the same options.
    file(CONFIGURE OUTPUT fledge_test_headers.cpp CONTENT "int main() {}\n")
    foreach(target fledge_test_headers fledge_eigen_test_headers)
        add_executable(${target} EXCLUDE_FROM_ALL ${CMAKE_CURRENT_BINARY_DIR}/fledge_test_headers.cpp)
        fledge_cxx_options(${target})
        target_compile_options(${target} PRIVATE ${FLEDGE_TEST_OPTIONS})
        target_link_libraries(${target} PRIVATE GTest::gtest)
    endforeach()
    target_compile_options(fledge_eigen_test_headers PRIVATE ${FLEDGE_COMPUTING_TEST_OPTIONS})
    target_link_libraries(fledge_eigen_test_headers PRIVATE Eigen3::Eigen)
    fledge_precompile(fledge_test_headers ${ARGN})
    fledge_precompile(fledge_eigen_test_headers <Eigen/Dense> ${ARGN})
endfunction()
