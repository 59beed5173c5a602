# SPDX-License-Identifier: Apache-2.0
# What holds for all code, whatever its language and folder.

set(CMAKE_C_STANDARD 99)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)

# Everything may end up in the Python extension. Hidden symbols let the compiler inline across
# functions there as it does in a program.
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_C_VISIBILITY_PRESET hidden)
set(CMAKE_CXX_VISIBILITY_PRESET hidden)
set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)

set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

# One object of all C++ sources of a target: headers are read once, and a build from nothing takes half the time. Names
# in anonymous namespaces differ within a target therefore. OFF recompiles only the sources that a change reaches.
option(FLEDGE_UNITY "compile all C++ sources of a target as one" ON)

find_program(FLEDGE_CCACHE ccache)
mark_as_advanced(FLEDGE_CCACHE)
if(FLEDGE_CCACHE)
    # The sloppiness lets ccache keep what was compiled with precompiled headers.
    set(CMAKE_C_COMPILER_LAUNCHER ${FLEDGE_CCACHE})
    set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${FLEDGE_CCACHE})
endif()

# Debian's packages are built for Debian's Python; another one may be first on the PATH.
set(Python_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "the interpreter that loads the extension")
set(Python3_EXECUTABLE ${Python_EXECUTABLE} CACHE FILEPATH "the same, for older modules")
set(PYBIND11_FINDPYTHON ON)

# Where the extension goes, and hence what PYTHONPATH holds besides the repository's root.
set(FLEDGE_PYTHON_DIR ${PROJECT_BINARY_DIR}/python)

# Where an installed Fledge is, below the prefix.
set(FLEDGE_HOME lib/fledge)
