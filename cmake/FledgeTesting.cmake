# SPDX-License-Identifier: Apache-2.0
# Unit tests in GoogleTest. They are built by the target `tests`, not by `all`, so that flying a
# mission waits for no test, and each case is known to ctest by its own name.

add_custom_target(tests)

if(BUILD_TESTING)
    find_package(GTest REQUIRED)
    include(GoogleTest)
endif()

# fledge_add_test(<name> SOURCES <file>... [LIBRARIES <target>...])
function(fledge_add_test name)
    if(NOT BUILD_TESTING)
        return()
    endif()
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LIBRARIES")
    add_executable(${name} EXCLUDE_FROM_ALL ${arg_SOURCES})
    fledge_cxx_options(${name})
    target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} GTest::gtest_main)
    add_dependencies(tests ${name})
    gtest_discover_tests(${name} TEST_PREFIX ${name}/ PROPERTIES TIMEOUT 300)
endfunction()
