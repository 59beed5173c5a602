# SPDX-License-Identifier: Apache-2.0
# Unit tests in GoogleTest. The target `tests` builds them; `all` does not, so that a flight does not
# wait for its tests. ctest starts each program once; `./fledge test -k` selects cases by GTEST_FILTER, and counts
# them in GoogleTest's own reports.

add_custom_target(tests)
file(WRITE ${PROJECT_BINARY_DIR}/tests.txt "")      # on each line a program and its sources: tests/changed.py reads it

# A test runs once: to optimise its source takes longer than it saves. The code under test keeps the
# options of its library.
set(FLEDGE_TEST_OPTIONS "" CACHE STRING "compile options of the sources of tests")
mark_as_advanced(FLEDGE_TEST_OPTIONS)

if(BUILD_TESTING)
    find_package(GTest REQUIRED)
endif()

# fledge_add_test(<name> SOURCES <file>... [LIBRARIES <target>...])
function(fledge_add_test name)
    if(NOT BUILD_TESTING)
        return()
    endif()
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LIBRARIES")
    add_executable(${name} EXCLUDE_FROM_ALL ${arg_SOURCES})
    file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
    list(TRANSFORM arg_SOURCES PREPEND ${folder}/ OUTPUT_VARIABLE sources)
    list(JOIN sources " " sources)
    file(APPEND ${PROJECT_BINARY_DIR}/tests.txt "${name} ${sources}\n")
    fledge_cxx_options(${name})
    # What gcc 12 says at -O1 about Eigen's unset members is false alarm.
    target_compile_options(${name} PRIVATE ${FLEDGE_TEST_OPTIONS} -Wno-maybe-uninitialized)
    target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} GTest::gtest_main)
    if(TARGET fledge_test_headers)
        target_compile_options(${name} PRIVATE -fpch-preprocess)
        target_precompile_headers(${name} REUSE_FROM fledge_test_headers)
    endif()
    add_dependencies(tests ${name})
    add_test(NAME ${name} COMMAND ${name})
    set_tests_properties(${name} PROPERTIES TIMEOUT 1200 LABELS gtest)
endfunction()

# fledge_precompile_test_headers(<header>...): compile headers of the system once, for all tests that
# follow.
function(fledge_precompile_test_headers)
    if(NOT BUILD_TESTING)
        return()
    endif()
    # An executable as the tests are: gcc takes only headers that were compiled with the same options.
    file(CONFIGURE OUTPUT fledge_test_headers.cpp CONTENT "int main() {}\n")
    add_executable(fledge_test_headers EXCLUDE_FROM_ALL ${CMAKE_CURRENT_BINARY_DIR}/fledge_test_headers.cpp)
    fledge_cxx_options(fledge_test_headers)
    target_compile_options(fledge_test_headers PRIVATE ${FLEDGE_TEST_OPTIONS})
    target_link_libraries(fledge_test_headers PRIVATE GTest::gtest Eigen3::Eigen)
    fledge_precompile(fledge_test_headers ${ARGN})
endfunction()
