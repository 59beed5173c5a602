# SPDX-License-Identifier: Apache-2.0
# The libraries of FMUs for 64-bit Arm, by Debian's cross compiler (g++-aarch64-linux-gnu):
#
#     cmake -S . -B build/aarch64 -G Ninja -D CMAKE_TOOLCHAIN_FILE=cmake/aarch64.cmake -D CMAKE_BUILD_TYPE=Release
#     ninja -C build/aarch64 fledge_fmu_simulation fledge_fmu_board
#
# The first one needs ERFA of that machine: `sudo dpkg --add-architecture arm64`, then liberfa-dev:arm64, or its
# liberfa.a by -D FLEDGE_STATIC_ERFA=FILE. `fledge export fmu --platform aarch64` takes the libraries from there.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
# Else Eigen's products fuse by themselves, and the bits are not those of x86-64.
set(CMAKE_CXX_FLAGS_INIT -U__ARM_FEATURE_FMA)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(BUILD_TESTING OFF CACHE BOOL "its programs run elsewhere")
