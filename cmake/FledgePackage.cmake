# SPDX-License-Identifier: Apache-2.0
# Fledge's build as a CMake package: find_package(Fledge) with Fledge_DIR=<Fledge>/build/<preset>.

set(libraries fledge_math fledge_flight fledge_record fledge_sim fledge_tables fledge_world
    fledge_cosim_protocol fledge_cosim_security fledge_cosim_transport fledge_cosim_controller fledge_cosim_node
    fledge_cosim_router fledge_cosim_tools fledge_cosim fledge_node)
foreach(library IN LISTS libraries)
    string(REPLACE fledge_ "" name ${library})
    set_target_properties(${library} PROPERTIES EXPORT_NAME ${name})
endforeach()
export(TARGETS ${libraries} NAMESPACE fledge:: FILE ${PROJECT_BINARY_DIR}/FledgeTargets.cmake)

string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
set(FLEDGE_C_FLAGS "${CMAKE_C_FLAGS_${type}}")
set(FLEDGE_CXX_FLAGS "${CMAKE_CXX_FLAGS_${type}}")
set(FLEDGE_COMPILER "${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}")
configure_file(
    ${PROJECT_SOURCE_DIR}/cmake/FledgeConfig.cmake.in ${PROJECT_BINARY_DIR}/FledgeConfig.cmake @ONLY)
