#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Proof that Fledge starts from nothing: an empty Debian or Ubuntu made with debootstrap, a clone of this
# repository in it, and the launcher's commands, each twice but for the tests; then how long every step took, how
# much it downloaded, how many tests passed, and why others were skipped. As root, on a Debian or Ubuntu with
# debootstrap and git:
#
#   tests/fresh_debian.sh bookworm                      all of demo, fly, test and package
#   tests/fresh_debian.sh trixie demo 'test -k mrp'     other commands, one per argument
#   tests/fresh_debian.sh noble demo                    Ubuntu 24.04
#   tests/fresh_debian.sh bookworm package=FOLDER       packages that are made already
#
# The flight is that of nadir_spin on five targets, which prints the hash of each. `package` makes both
# packages; then a second empty system installs the .deb and a third one the wheel, and they fly without a compiler.
#
# FLEDGE_TEST_DATA, where set, is shown to the tests in there. The mirror is FLEDGE_MIRROR, or else that of the
# system which this machine's apt uses; for Ubuntu also the one beside that of Debian. FLEDGE_FRESH_CACHE names a folder
# where packages are kept for the next run. Mounts and processes live in namespaces of their own and vanish with the
# script; so do the chroots, below ${TMPDIR:-/tmp}, about 5 GB at their largest. The last line counts the steps; where
# nothing can be mounted, or debootstrap is not there, it says so and counts one step that was skipped.
set -euo pipefail

skip() { echo "fresh_debian: $1"; echo "0 passed, 0 failed, 1 skipped"; exit 0; }

if [ "${FLEDGE_FRESH_INSIDE:-}" != 1 ]; then
    [ "$(id -u)" = 0 ] || skip "must be root"
    for tool in debootstrap git unshare; do
        command -v "$tool" > /dev/null || skip "there is no $tool here"
    done
    unshare --mount --pid --fork mount -t tmpfs none /mnt 2> /dev/null || skip "nothing can be mounted here"
    FLEDGE_FRESH_INSIDE=1 exec unshare --mount --pid --fork --kill-child "$0" "$@"
fi

suite=${1:?a system: bookworm, trixie or noble}
shift
[ $# != 0 ] || set -- demo "fly nadir_spin --on desktop,linux,leon3,cfs,micropython" test package
label=Debian components=main script=sid
[ "$suite" != noble ] || label=Ubuntu components=main,universe script=gutsy
root=$(cd "$(dirname "$0")/.." && pwd -P)
version="Fledge $(sed -n 's/^__version__ = "\(.*\)"/\1/p' "$root/python/fledge/__init__.py") ($(
    git -C "$root" rev-parse --short HEAD))"
place=$(mktemp -d "${TMPDIR:-/tmp}/fledge-fresh.XXXXXX")
chmod 755 "$place"
mount --bind "$place" "$place"  # a root that can be mounted over, as namespaces do
trap 'umount -R -l "$place" && rm -rf --one-file-system "$place"' EXIT     # a mount that stays would be emptied
empty=$place/empty fresh=$place/build

mirror=${FLEDGE_MIRROR:-$(apt-get indextargets --format '$(SITE)' \
    'Created-By: Packages' "Label: $label" 'Component: main' | sed -n 1p)}
if [ -z "$mirror" ] && [ "$label" = Ubuntu ]; then      # many mirrors have both
    mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 'Label: Debian' 'Component: main' |
        sed -n 's/debian$/ubuntu/p' | sed -n 1p)
fi
[ -n "$mirror" ] || { echo "fresh_debian: apt knows no mirror of $label; set FLEDGE_MIRROR" >&2; exit 1; }

table=() passed=0 refused=0 reasons=

# The packages that apt and debootstrap have fetched so far, in bytes.
fetched() { find "$fresh/var/cache/apt/archives" -name '*.deb' -printf '%s\n' 2>/dev/null |
    awk '{ n += $1 } END { printf "%d", n }'; }

# step NAME COMMAND...: run it, and keep its seconds, the megabytes of packages it fetched, the sum of tests that it
# prints last, and why tests were skipped.
step() {
    local name=$1 begun before status=0 sum shown tee
    shift
    echo "== $name"
    begun=$(date +%s%N) before=$(fetched)
    exec {shown}> >(tee "$place/step")
    tee=$!
    "$@" >&$shown || status=$?
    exec {shown}>&-
    wait $tee || :
    sum=$(tail -n 1 "$place/step" | grep -E '^[0-9]+ passed, ' || :)
    reasons+=$(sed -nE 's/^SKIPPED \[([0-9]+)\] [^ ]+: /\1 /p' "$place/step")
    table+=("$(awk -v name="$name" -v t="$(($(date +%s%N) - begun))" -v status=$status -v sum="$sum" \
        -v bytes="$(($(fetched) - before))" \
        'BEGIN { printf "%-44s %9.1f s %9.1f MB   exit %d   %s", name, t / 1e9, bytes / 1e6, status, sum }')")
    if [ $status = 0 ]; then passed=$((passed + 1)); else refused=$((refused + 1)); fi
    return $status
}

inside() { chroot "$fresh" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb \
    DEBIAN_FRONTEND=noninteractive ${http_proxy:+http_proxy="$http_proxy"} \
    ${certificates:+NODE_EXTRA_CA_CERTS=/etc/host.crt} ${FLEDGE_TEST_DATA:+FLEDGE_TEST_DATA=/data} \
    sh -c "cd /home && cd ./fledge 2>/dev/null; $1"; }

finish() {
    printf '\n'
    printf '%s\n' "${table[@]}"
    # Package lists are no packages: apt tells their size itself.
    grep -h '^Fetched' "$place"/build/home/fledge/build/apt-update.log 2>/dev/null |
        sed 's/^/and the package lists: /' || :
    sort <<< "$reasons" | awk 'NF { n = $1; $1 = ""; sum[$0] += n } END { for (why in sum) print sum[why] why }' |
        sort -rn | sed 's/^/skipped: /'
    echo "$version on $(sed -n 's/^PRETTY_NAME="\(.*\)"/\1/p' "$empty/etc/os-release"), $(date +%F)"
    echo "$passed passed, $refused failed, 0 skipped"
}
failed() { echo "fresh_debian: $1" >&2; finish; exit 1; }

# another NAME: make a copy of the empty system, in which `inside` runs from now on.
another() {
    fresh=$place/$1
    cp -a "$empty" "$fresh"
    if [ -n "${FLEDGE_FRESH_CACHE:-}" ]; then
        mkdir -p "$FLEDGE_FRESH_CACHE/$suite/partial"
        mount --bind "$FLEDGE_FRESH_CACHE/$suite" "$fresh/var/cache/apt/archives"
    fi
    mount -t proc proc "$fresh/proc"
    mkdir -p "$fresh/dev/pts"
    mount -t devpts -o newinstance,ptmxmode=0666 devpts "$fresh/dev/pts"
    ln -sf pts/ptmx "$fresh/dev/ptmx"
    printf '[[craft]]\nmission = "earth_imager"\nscenario = "handover"\nspeed = 10\n' > "$fresh/home/room.toml"
    if [ -n "${FLEDGE_TEST_DATA:-}" ]; then
        mkdir "$fresh/data"
        mount --bind -o ro "$FLEDGE_TEST_DATA" "$fresh/data"
    fi
}

# Ubuntu's keys are not in each Debian.
keys=--force-check-gpg
[ "$label" = Debian ] || [ -e /usr/share/keyrings/ubuntu-archive-keyring.gpg ] || keys=--no-check-gpg
if [ -n "${FLEDGE_FRESH_CACHE:-}" ]; then
    mkdir -p "$FLEDGE_FRESH_CACHE/$suite"
    keys+=" --cache-dir=$(cd "$FLEDGE_FRESH_CACHE/$suite" && pwd)"
fi
step "debootstrap" debootstrap $keys --variant=minbase --components=$components "$suite" "$empty" "$mirror" $script \
    > "$place/log" ||
    { tail "$place/log"; exit 1; }
echo force-unsafe-io > "$empty/etc/dpkg/dpkg.cfg.d/vanishes"
echo 'APT::Keep-Downloaded-Packages "true";' > "$empty/etc/apt/apt.conf.d/keep"  # to be counted
cp /etc/resolv.conf "$empty/etc/resolv.conf"
certificates=/etc/ssl/certs/ca-certificates.crt     # npm shall trust what this machine trusts, its proxy for one
[ -e $certificates ] && cp $certificates "$empty/etc/host.crt" || certificates=

# begin: make an empty system with a clone.
begin() {
    another build
    git clone -q "file://$root" "$fresh/home/fledge"
    for tool in python3 git sudo; do
        ! inside "command -v $tool" || { echo "fresh_debian: it has $tool already" >&2; exit 1; }
    done

    # Without root and without sudo it must print the command for root, and change nothing.
    output=$(chroot --userspec=65534:65534 "$fresh" /home/fledge/fledge setup 2>&1) &&
        { echo "fresh_debian: set-up without root should have failed" >&2; exit 1; }
    [[ $output == *"apt-get satisfy --no-install-recommends"* ]] || { echo "$output" >&2; exit 1; }
}

# --- packages --------------------------------------------------------------------------------------

# refuses PATTERN COMMAND: the command must fail, with a line that matches; $advice is the command for root in it.
refuses() {
    local output status=0
    output=$(inside "$2" 2>&1 > /dev/null) || status=$?
    echo "$output"
    [ "$status" != 0 ] && [[ $output =~ $1 ]] && [ "$(grep -c 'as root, run' <<< "$output")" = 1 ] || return 1
    advice=$(sed -n 's/.*as root, run: //p' <<< "$output")
}

# serves FLEDGE: the control room flies a mission, and answers within 30 s of the command.
serves() {
    inside "$1 ground serve room.toml > served.log 2>&1 & server=\$!
        tries=0 status=1
        while [ \$((tries += 1)) -le 300 ] && [ \$status != 0 ]; do
            sleep 0.1
            python3 -c 'import urllib.request; urllib.request.urlopen(\"http://127.0.0.1:8080/\").read()' 2>/dev/null &&
                status=0
        done
        kill -INT \$server; wait \$server; cat served.log; exit \$status"
}

# Debian 12 has a compiler wherever python3-matplotlib is: by python3-scipy and python3-pythran.
hide_compiler() { inside 'mkdir -p /hidden; cd /usr/bin; mv *gcc* *g++* cc c++ /hidden 2> /dev/null || :'; }
show_compiler() { inside 'mv /hidden/* /usr/bin 2> /dev/null || :'; }

# flies FLEDGE: the commands that need no compiler.
flies() {
    hide_compiler
    step "$1 run nadir_spin" inside "$1 run nadir_spin" &&
        step "$1 run earth_imager" inside "$1 run earth_imager" &&
        step "$1 view earth_imager" inside "$1 view earth_imager && test -s runs/earth_imager/handover/view.html" &&
        step "$1 montecarlo nadir_spin --runs 20" inside "$1 montecarlo nadir_spin --runs 20" &&
        step "$1 ground serve: first answer" serves "$1" &&
        step "$1 new project" inside "$1 new project sat && $1 --project sat new mission scan --from nadir_spin" &&
        step "$1 run scan, of the project" inside "$1 --project sat run scan" &&
        step "$1 montecarlo scan --runs 20, of the project" inside "$1 --project sat montecarlo scan --runs 20" &&
        step "$1 new mission imager" inside "$1 --project sat new mission imager --from earth_imager" &&
        inside "sed -i s/earth_imager/imager/ room.toml" &&
        step "$1 ground serve, of the project: first answer" serves "$1 --project sat" || failed "it does not fly"
    ! inside "command -v gcc || command -v g++ || command -v cc || command -v cmake" || failed "it has a compiler"
}

# builds FLEDGE, after `flies`: the others name the package of the compiler, and work with it.
builds() {
    step "$1 fly --on linux, without a compiler" refuses "linux needs gcc" "$1 fly nadir_spin --for 60s --on linux" &&
        step "$1 new module" inside "$1 --project sat new module SunSlew" &&
        step "$1 list, of the project" refuses "packages are missing" "$1 --project sat list" && show_compiler &&
        step "$advice" inside "$advice -y > /dev/null" &&
        step "$1 list, of the project" inside "$1 --project sat list --ports | grep SunSlew" &&
        step "$1 fly --on linux" inside "$1 fly nadir_spin --for 60s --on linux" || failed "it does not build"
}

# packs [FOLDER]: make both packages, or take those of a folder; install them, fly, and build.
packs() {
    local package=${1:-$place/build/home/fledge/build/packages}
    if [ $# = 0 ]; then
        step "./fledge package" inside "./fledge package" || failed "there is no package"
    fi
    another deb
    cp "$package"/*.deb "$fresh/home"
    step "apt-get update" inside "apt-get update > /dev/null"
    step "apt install ./fledge_*.deb" inside "apt-get install -y ./fledge_*.deb > /dev/null" || failed "no .deb"
    inside "dpkg --verify fledge && python3 -c 'import fledge; print(fledge.__file__)'"
    flies fledge
    step "fledge run mars_orbiter pointing --report" inside "fledge run mars_orbiter pointing --report" ||
        failed "it does not fly"
    builds fledge
    another wheel
    cp "$package"/*.whl "$fresh/home"
    inside "apt-get update > /dev/null"
    step "apt install python3-venv, numpy, matplotlib, jinja2" \
        inside "apt-get install -y --no-install-recommends python3-venv python3-numpy \
            python3-matplotlib python3-jinja2 > /dev/null"
    step "python3 -m venv, pip install fledge-*.whl" \
        inside "python3 -m venv --system-site-packages env && env/bin/pip install -q --no-index fledge-*.whl" ||
        failed "no wheel"
    step "ground serve, without aiohttp" refuses "aiohttp is not" "env/bin/fledge ground serve room.toml" &&
        step "$advice" inside "$advice -y --no-install-recommends > /dev/null" &&
        step "run earth_imager, without planets" refuses "DE405 is not" "env/bin/fledge run earth_imager" &&
        step "$advice" inside "$advice -y --no-install-recommends > /dev/null" &&
        step "montecarlo, without h5py" refuses "h5py is not" "env/bin/fledge montecarlo nadir_spin --runs 3" &&
        step "$advice" inside "$advice -y --no-install-recommends > /dev/null" ||
        failed "it does not say what it needs"
    flies env/bin/fledge
    builds env/bin/fledge
}

# --- the commands ----------------------------------------------------------------------------------

case $1 in
    package=*) ;;
    *) begin ;;
esac
status=0
for command; do
    case $command in
        package) packs ;;
        package=*) packs "$(cd "${command#*=}" && pwd)" ;;
        *)
            step "./fledge $command" inside "./fledge $command" || { status=1; continue; }
            case $command in
                test*) ;;
                *) step "./fledge $command, again" inside "./fledge $command" || status=1 ;;
            esac
            ;;
    esac
done
finish
exit $status
