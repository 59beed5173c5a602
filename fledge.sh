#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Fledge's launcher: installs what is missing, builds what has changed, then runs the command.
# POSIX shell, because a fresh Debian has no Python. What it has to say goes to stderr.
set -eu

root=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd -P)
build=$root/build
preset=${FLEDGE_PRESET:-release}
python=/usr/bin/python3     # Debian's packages are built for this one; PATH may hold another
ticker=

usage() {
    cat <<'END'
usage: ./fledge COMMAND [ARGUMENTS]

  demo                fly the mission nadir_spin and plot it
  test [-k PATTERN]   run every test, or those whose names match
  setup [--test]      only install what is missing, and build

  run MISSION         fly a mission           list              what there is to fly
  plot RUN            plot what was recorded  convert RUN       write it as CSV or HDF5
  bench [NAME]        measure

The first use installs Debian packages (cmake/packages.txt) and builds; later ones only rebuild
what has changed. Every command has --help. FLEDGE_PRESET=debug or asan takes another build.

example: ./fledge demo
END
}

say() { printf 'fledge: %s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

# Stop the progress line, whichever way we leave.
stop_ticker() {
    [ -n "$ticker" ] || return 0
    kill "$ticker" 2>/dev/null || :
    wait "$ticker" 2>/dev/null || :
    ticker=
    printf '\r\033[K' >&2
}
trap stop_ticker EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# quietly LOG COMMAND...: run COMMAND with its output in build/LOG.log. A terminal shows the log's
# last line meanwhile.
quietly() {
    log=$build/$1.log
    shift
    mkdir -p "$build"
    : > "$log"
    if [ -t 2 ]; then
        while kill -0 $$ 2>/dev/null; do
            printf '\r\033[K%s' "$(tail -n 1 "$log" | tr -d '\r' | cut -c 1-78)" >&2
            sleep 0.2
        done &
        ticker=$!
    fi
    status=0
    "$@" > "$log" 2>&1 < /dev/null || status=$?
    stop_ticker
    return $status
}

# explain LOG WHAT: say that WHAT failed, with the first errors and the end of its log, and leave.
explain() {
    log=$build/$1.log
    say "$2 failed; the whole log is $log"
    { grep -n -m 8 -E '(^E:|[Ee]rror:|^FAILED:|CMake Error)' "$log" || :; } >&2
    echo '  ...' >&2
    tail -n 30 "$log" >&2
    exit 1
}

# --- packages ------------------------------------------------------------------------------------

# wanted PURPOSE: the packages of that section of cmake/packages.txt.
wanted() {
    sed -n -e 's/#.*//' -e "/^\[$1\]/,/^\[/ { /^\[/d; s/[[:space:]]//g; /./p; }" \
        "$root/cmake/packages.txt"
}

# missing NAME...: those of the packages that are not installed.
missing() {
    have=$(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "$@" 2>/dev/null |
        sed -n 's/^installed //p')
    printf '%s\n' "$@" | while read -r name; do
        case "
$have
" in
            *"
$name
"*) ;;
            *) echo "$name" ;;
        esac
    done
}

# as_root COMMAND...: run it as root, or say what to type.
as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        return 1
    fi
}

apt_get() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -y -o DPkg::Lock::Timeout=120 "$@"; }

# need PURPOSE: bring the packages of that purpose onto the machine. A stamp newer than dpkg's
# own records, over the same list, says that nothing can be missing.
need() {
    stamp=$build/packages-$1.stamp
    list=$(cksum < "$root/cmake/packages.txt")
    if [ "$(cat "$stamp" 2>/dev/null)" = "$list" ] &&
        [ -z "$(find /var/lib/dpkg/status -newer "$stamp" 2>/dev/null)" ]; then
        return 0
    fi
    command -v dpkg-query >/dev/null ||
        die "this is no Debian; install what cmake/packages.txt lists by hand, then use CMake"
    names=$(missing $(wanted "$1"))
    if [ -n "$names" ]; then
        names=$(echo $names)
        command="apt-get install --no-install-recommends $names"
        if [ "$(id -u)" != 0 ] && ! command -v sudo >/dev/null; then
            say "these packages are missing, and there is no sudo; as root, run:"
            die "  $command"
        fi
        say "installing for '$1': $names"
        begun=$(date +%s)
        if [ "$(id -u)" != 0 ]; then
            sudo -v || die "without sudo, as root, run: $command"
        fi
        # Lists may be missing (a container) or outdated (the install fails): fetch them then.
        if ! ls /var/lib/apt/lists/*_Packages* >/dev/null 2>&1 ||
            ! quietly "apt-$1" apt_get install --no-install-recommends $names; then
            say "fetching apt's package lists"
            quietly "apt-update" apt_get update || explain "apt-update" "apt-get update"
            quietly "apt-$1" apt_get install --no-install-recommends $names ||
                explain "apt-$1" "apt-get install"
        fi
        size=$(sed -n 's/^Need to get \(.*\) of archives.*/\1/p' "$build/apt-$1.log")
        say "installed ($size) in $(($(date +%s) - begun)) s"
    fi
    mkdir -p "$build"
    echo "$list" > "$stamp"
}

# --- building ------------------------------------------------------------------------------------

# compile WITH_TESTS: configure when there is nothing configured yet, or when the tests are asked
# for and were left out, then build. Ninja configures again by itself when a CMake file changes.
compile() {
    dir=$build/$preset
    begun=$(date +%s)
    cd "$root"
    if [ ! -e "$dir/build.ninja" ]; then
        say "building ($preset)"
        quietly "configure-$preset" cmake --preset "$preset" "-DBUILD_TESTING=$1" ||
            explain "configure-$preset" "the configuration"
    elif [ "$1" = ON ] && ! grep -q '^BUILD_TESTING:BOOL=ON' "$dir/CMakeCache.txt"; then
        quietly "configure-$preset" cmake --preset "$preset" -DBUILD_TESTING=ON ||
            explain "configure-$preset" "the configuration"
    fi
    targets=all
    if [ "$1" = ON ]; then targets="all tests"; fi
    quietly "build-$preset" ninja -C "$dir" $targets || explain "build-$preset" "the build"
    if ! grep -q '^ninja: no work to do' "$build/build-$preset.log"; then
        say "built ($preset) in $(($(date +%s) - begun)) s"
    fi
    cd "$here"
}

# python_path: the packages, and the extension of the chosen build.
python_path() { echo "$root/python:$root:$build/$preset/python"; }

# cli ARGUMENTS...: the command line proper, fledge/cli.py.
cli() {
    PYTHONPATH=$(python_path)${PYTHONPATH:+:$PYTHONPATH} \
        "$python" -m fledge.cli "$@"
}

# --- testing -------------------------------------------------------------------------------------

# tally REPORT STATUS: add the counts of a JUnit report to passed, failed and skipped. A runner that
# fails without a failed test (it crashed, it could not load a file) counts as one failure.
tally() {
    suite=$(head -c 4000 "$1" 2>/dev/null | tr '\n\t' '  ' | sed -n 's/.*<testsuite \([^>]*\)>.*/ \1/p')
    bad=0 idle=0
    for name in failures errors; do bad=$((bad + $(attribute "$name"))); done
    for name in skipped disabled; do idle=$((idle + $(attribute "$name"))); done
    passed=$((passed + $(attribute tests) - bad - idle))
    skipped=$((skipped + idle))
    if [ "$2" != 0 ] && [ $bad = 0 ]; then bad=1; fi
    failed=$((failed + bad))
}

attribute() {
    value=$(printf '%s' "$suite" | sed -n "s/.* $1=\"\([0-9]*\)\".*/\1/p")
    echo "${value:-0}"
}

run_tests() {
    passed=0 failed=0 skipped=0
    jobs=$(getconf _NPROCESSORS_ONLN)
    report=$build/$preset/tests
    rm -f "$report.c.xml" "$report.py.xml"
    cd "$root"

    set -- ctest --test-dir "$build/$preset" -j "$jobs" --output-on-failure --progress \
        --output-junit "$report.c.xml"
    if [ -n "$pattern" ]; then set -- "$@" -R "$pattern"; fi
    status=0
    "$@" || status=$?
    tally "$report.c.xml" "$status"

    set -- "$python" -m pytest -q --junit-xml="$report.py.xml"
    if [ -n "$pattern" ]; then set -- "$@" -k "$pattern"; fi
    if [ "$preset" = asan ]; then
        # The interpreter is not instrumented, so the sanitizer's library has to come first; it is
        # told to let leaks pass, for the interpreter keeps its memory on leaving.
        set -- env ASAN_OPTIONS=detect_leaks=0 \
            "LD_PRELOAD=$(gcc -print-file-name=libasan.so) $(gcc -print-file-name=libstdc++.so)" "$@"
    fi
    status=0
    FLEDGE_PRESET=$preset PYTHONPATH=$(python_path) "$@" || status=$?
    if [ "$status" = 5 ]; then status=0; fi     # 5: no test matched; ctest may have had some
    tally "$report.py.xml" "$status"

    if [ $((passed + failed + skipped)) = 0 ]; then say "no test matches '$pattern'"; failed=1; fi
    echo "$passed passed, $failed failed, $skipped skipped"
    [ "$failed" = 0 ]
}

# --- commands ------------------------------------------------------------------------------------

here=$(pwd)
command=${1:-help}
if [ $# -gt 0 ]; then shift; fi

asks_help() {
    for argument; do
        case $argument in -h | --help) return 0 ;; esac
    done
    return 1
}

case $command in
    help | -h | --help)
        usage
        ;;
    setup)
        with_tests=OFF
        for argument; do
            case $argument in
                -h | --help)
                    echo "usage: ./fledge setup [--test]"
                    echo "Install the Debian packages that are missing and build; --test: for the tests too."
                    echo "example: ./fledge setup --test"
                    exit 0 ;;
                --test) with_tests=ON ;;
                *) die "setup: unknown argument '$argument'; the only one is --test" ;;
            esac
        done
        need run
        if [ $with_tests = ON ]; then need test; fi
        compile $with_tests
        say "ready"
        ;;
    demo)
        if asks_help "$@"; then
            echo "usage: ./fledge demo"
            echo "Fly the mission nadir_spin, as './fledge run nadir_spin' does."
            echo "example: ./fledge demo"
            exit 0
        fi
        [ $# = 0 ] || die "demo: takes no arguments; './fledge run' does"
        need run
        compile OFF
        cli run nadir_spin
        ;;
    test)
        pattern=
        while [ $# -gt 0 ]; do
            case $1 in
                -h | --help)
                    echo "usage: ./fledge test [-k PATTERN] [--preset release|debug|asan]"
                    echo "Run every test of C, C++ and Python, or those whose names match."
                    echo "example: ./fledge test -k tracking"
                    exit 0 ;;
                -k | --preset)
                    [ $# -gt 1 ] || die "test: $1 needs a value"
                    if [ "$1" = -k ]; then pattern=$2; else preset=$2; fi
                    shift 2 ;;
                *) die "test: unknown argument '$1'; see './fledge test --help'" ;;
            esac
        done
        need run
        need test
        compile ON
        run_tests
        ;;
    run | list | plot | convert | bench)
        # Help needs no build, provided that there is a Python to print it.
        if ! asks_help "$@"; then
            need run
            compile OFF
        elif [ ! -x "$python" ]; then
            usage
            exit 0
        fi
        cli "$command" "$@"
        ;;
    *)
        say "unknown command '$command'"
        usage >&2
        exit 2
        ;;
esac
