# SPDX-License-Identifier: Apache-2.0
# Fledge for programs and projects outside this tree.
#
# The build is a CMake package: find_package(Fledge) with Fledge_DIR=<Fledge>/build/<preset>. So is an installed Fledge,
# with CMAKE_PREFIX_PATH=<prefix>. Below the prefix, `cmake --install build/release --prefix P` writes
#
#   bin/fledge                              the command
#   share/bash-completion, share/zsh        its completion
#   lib/fledge/                             this tree without its tests, and what was built
#   lib/python3.11/*-packages/fledge.pth    for `import fledge`: a Python of that prefix reads it
#
# Headers and sources are installed too: projects include them, and `fledge export` compiles them. `./fledge package`
# makes a wheel (fledge_wheel.py) and a .deb (fledge_deb.py) of what is written there.

set(libraries fledge_ccsds fledge_ccsds_security fledge_ccsds_keys fledge_ccsds_store fledge_math
    fledge_flight fledge_command fledge_record fledge_sim fledge_tables fledge_world fledge_cosim_protocol
    fledge_cosim_security fledge_cosim_transport fledge_cosim_controller fledge_cosim_node fledge_cosim_router
    fledge_cosim_tools fledge_cosim fledge_node)
foreach(library IN LISTS libraries)
    string(REPLACE fledge_ "" name ${library})
    set_target_properties(${library} PROPERTIES EXPORT_NAME ${name})
endforeach()
export(TARGETS ${libraries} NAMESPACE fledge:: FILE ${PROJECT_BINARY_DIR}/FledgeTargets.cmake)

string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
set(FLEDGE_C_FLAGS "${CMAKE_C_FLAGS_${type}}")
set(FLEDGE_CXX_FLAGS "${CMAKE_CXX_FLAGS_${type}}")
set(FLEDGE_COMPILER "${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}")
set(FLEDGE_CMAKE_DIR ${PROJECT_SOURCE_DIR}/cmake)
set(FLEDGE_STUBS ${PROJECT_BINARY_DIR}/introspect/stubs)
configure_file(
    ${PROJECT_SOURCE_DIR}/cmake/FledgeConfig.cmake.in ${PROJECT_BINARY_DIR}/FledgeConfig.cmake @ONLY)
set(FLEDGE_CMAKE_DIR "\${CMAKE_CURRENT_LIST_DIR}")
set(FLEDGE_STUBS "\${CMAKE_CURRENT_LIST_DIR}/../python")
configure_file(
    ${PROJECT_SOURCE_DIR}/cmake/FledgeConfig.cmake.in ${PROJECT_BINARY_DIR}/installed/FledgeConfig.cmake @ONLY)

# --- the install -----------------------------------------------------------------------------------

install(TARGETS ${libraries} EXPORT FledgeTargets DESTINATION ${FLEDGE_HOME}/lib)
install(EXPORT FledgeTargets NAMESPACE fledge:: DESTINATION ${FLEDGE_HOME}/cmake)
install(TARGETS fledge_controller fledge_board_node fledge_guard DESTINATION ${FLEDGE_HOME}/cosim)
install(TARGETS fledge_leon3 DESTINATION ${FLEDGE_HOME}/emulator/tools)
install(DIRECTORY emulator/boards DESTINATION ${FLEDGE_HOME}/emulator)
# A wheel brings shared libraries in lib/fledge/lib. RPATH, unlike RUNPATH, also counts for what they load in turn.
set(loaders _core _cosim _emulator _ground fledge_controller fledge_board_node fledge_guard fledge_leon3 fledge_node)
set_target_properties(${loaders} PROPERTIES BUILD_WITH_INSTALL_RPATH ON INSTALL_RPATH "$ORIGIN/../lib")
set_target_properties(fledge_node PROPERTIES INSTALL_RPATH "$ORIGIN")
set_target_properties(fledge_leon3 PROPERTIES INSTALL_RPATH "$ORIGIN/../../lib")
foreach(loader IN LISTS loaders)
    target_link_options(${loader} PRIVATE LINKER:--disable-new-dtags)
endforeach()
install(TARGETS _core _cosim _emulator _ground fledge_fmu_simulation fledge_fmu_board
    DESTINATION ${FLEDGE_HOME}/python)
install(FILES ${FLEDGE_PYTHON_DIR}/_core_build.py ${FLEDGE_PYTHON_DIR}/_fledge_protocol.py
    DESTINATION ${FLEDGE_HOME}/python)

foreach(folder ccsds flight record registers sim world targets cosim fmi introspect missions)
    install(DIRECTORY ${folder} DESTINATION ${FLEDGE_HOME}
        REGEX "(_test[.](c|cpp|py)|/CMakeLists[.]txt|/__pycache__|/[.].*|/runs|/build|/oracle)$" EXCLUDE
        REGEX "/(cosim|fmi)/(cli|export|python)$" EXCLUDE)
endforeach()

# fledge_install_package(<folder> <destination>): a package of Python, with what its links lead to in their place: a
# wheel has no links.
function(fledge_install_package folder destination)
    file(GLOB_RECURSE links LIST_DIRECTORIES true ${folder}/*)
    set(names "")
    foreach(link IN LISTS links)
        if(IS_SYMLINK ${link})
            file(RELATIVE_PATH name ${folder} ${link})
            file(REAL_PATH ${link} inner)
            fledge_install_package(${inner} ${destination}/${name})
            list(APPEND names ${name})
        endif()
    endforeach()
    list(JOIN names "|" names)
    get_filename_component(last ${folder} NAME)     # not all of the path, which may have signs of a pattern
    install(DIRECTORY ${folder}/ DESTINATION ${destination}
        REGEX "(_test[.](py|mjs)|[.]cpp|python/loaded[.]h|fledge/CMakeLists[.]txt|/__pycache__)$" EXCLUDE
        REGEX "(fledge/(templates|core)|scene/web|(scene|server|console)/testing)$" EXCLUDE
        REGEX "/${last}/(${names})$" EXCLUDE)
endfunction()
fledge_install_package(${PROJECT_SOURCE_DIR}/python/fledge ${FLEDGE_HOME}/python/fledge)
install(DIRECTORY ${PROJECT_BINARY_DIR}/introspect/stubs/ DESTINATION ${FLEDGE_HOME}/python)
install(DIRECTORY build/view/ DESTINATION ${FLEDGE_HOME}/python/fledge/scene/view OPTIONAL
    PATTERN work EXCLUDE PATTERN stamp EXCLUDE)
install(DIRECTORY python/fledge/templates DESTINATION ${FLEDGE_HOME}/python/fledge
    REGEX "/__pycache__$" EXCLUDE)     # with the tests that a project begins with
install(DIRECTORY registers introspect DESTINATION ${FLEDGE_HOME}/python
    FILES_MATCHING PATTERN "*.py" PATTERN "*_test.py" EXCLUDE PATTERN "testing" EXCLUDE PATTERN "boards" EXCLUDE)
install(DIRECTORY cmake DESTINATION ${FLEDGE_HOME} FILES_MATCHING
    PATTERN "*.cmake" PATTERN "packages.txt" PATTERN "flight_symbols.py" PATTERN "test_main.cpp"
    PATTERN "by_clang.sh" PATTERN "observed_*.c")
install(FILES ${PROJECT_BINARY_DIR}/installed/FledgeConfig.cmake DESTINATION ${FLEDGE_HOME}/cmake)
install(FILES docs/conf.py DESTINATION ${FLEDGE_HOME}/docs)       # for `fledge docs` of a project
install(FILES docs/static/fledge.css DESTINATION ${FLEDGE_HOME}/docs/static)
install(FILES LICENSE DESTINATION ${FLEDGE_HOME})
install(PROGRAMS fledge DESTINATION ${FLEDGE_HOME})

# Both files name what they need relative to themselves: the prefix may be moved.
file(CONFIGURE OUTPUT installed/fledge.pth CONTENT "../../fledge/python\n")
file(CONFIGURE OUTPUT installed/fledge @ONLY CONTENT
"#!/bin/sh
exec \"$(dirname -- \"$(readlink -f -- \"$0\")\")/../${FLEDGE_HOME}/fledge\" \"$@\"
")
install(PROGRAMS ${PROJECT_BINARY_DIR}/installed/fledge DESTINATION bin)
install(FILES python/fledge/launcher/completion.sh DESTINATION share/bash-completion/completions RENAME fledge)
install(FILES python/fledge/launcher/completion.sh DESTINATION share/zsh/site-functions RENAME _fledge)
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter)
foreach(packages site-packages dist-packages)     # the latter in Debian's own Python
    install(FILES ${PROJECT_BINARY_DIR}/installed/fledge.pth
        DESTINATION lib/python${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}/${packages})
endforeach()
