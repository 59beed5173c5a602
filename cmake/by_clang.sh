#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# by_clang.sh COMPILER ARGUMENT...: runs clang, or for C++ clang++, with the arguments of gcc or g++. CMake has one
# compiler of each language; as a launcher this is another one.
compiler=clang
case $1 in *++*) compiler=clang++ ;; esac
shift
for version in 19 18; do
    if command -v $compiler-$version >/dev/null; then
        exec $compiler-$version "$@"
    fi
done
echo "there is neither $compiler-19 nor $compiler-18: apt-get install clang-19 (or clang-18) and libclang-rt-19-dev" >&2
exit 1
