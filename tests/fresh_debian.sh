#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Proof that Fledge starts from nothing: an empty Debian or Ubuntu made with debootstrap, a clone of this
# repository in it, and the launcher's commands, each twice; then how long every step took and how
# much it downloaded. Run by hand, as root, on a Debian or Ubuntu with debootstrap and git:
#
#   tests/fresh_debian.sh bookworm                      demo and test
#   tests/fresh_debian.sh trixie demo 'test -k mrp'     other commands, one per argument
#   tests/fresh_debian.sh noble demo                    Ubuntu 24.04
#
# FLEDGE_TEST_DATA, where set, is shown to the tests in there. The mirror is FLEDGE_MIRROR, or else that of the
# system which this machine's apt uses. Mounts and processes live in namespaces of their own and vanish with the
# script; so does the chroot, below ${TMPDIR:-/tmp}, about 3 GB at its largest.
set -euo pipefail

if [ "${FLEDGE_FRESH_INSIDE:-}" != 1 ]; then
    [ "$(id -u)" = 0 ] || { echo "fresh_debian: must be root" >&2; exit 1; }
    for tool in debootstrap git unshare; do
        command -v "$tool" > /dev/null || { echo "fresh_debian: there is no $tool here" >&2; exit 1; }
    done
    FLEDGE_FRESH_INSIDE=1 exec unshare --mount --pid --fork --kill-child "$0" "$@"
fi

suite=${1:?a system: bookworm, trixie or noble}
shift
[ $# -gt 0 ] || set -- demo test
label=Debian components=main script=sid
[ "$suite" != noble ] || label=Ubuntu components=main,universe script=gutsy
root=$(cd "$(dirname "$0")/.." && pwd -P)
fresh=$(mktemp -d "${TMPDIR:-/tmp}/fledge-fresh.XXXXXX")
chmod 755 "$fresh"
mount --bind "$fresh" "$fresh"  # a root that can be mounted over, as namespaces do
trap 'umount -R "$fresh" 2>/dev/null || :; rm -rf --one-file-system "$fresh"' EXIT

mirror=${FLEDGE_MIRROR:-$(apt-get indextargets --format '$(SITE)' \
    'Created-By: Packages' "Label: $label" 'Component: main' | sed -n 1p)}
[ -n "$mirror" ] || { echo "fresh_debian: apt knows no mirror of $label; set FLEDGE_MIRROR" >&2; exit 1; }

table=()

# The packages that apt and debootstrap have fetched so far, in bytes.
fetched() { find "$fresh/var/cache/apt/archives" -name '*.deb' -printf '%s\n' 2>/dev/null |
    awk '{ n += $1 } END { printf "%d", n }'; }

# step NAME COMMAND...: run it, and keep its seconds and the megabytes of packages it fetched.
step() {
    local name=$1 begun before status=0
    shift
    echo "== $name"
    begun=$(date +%s%N) before=$(fetched)
    "$@" || status=$?
    table+=("$(awk -v name="$name" -v t="$(($(date +%s%N) - begun))" -v status=$status \
        -v bytes="$(($(fetched) - before))" \
        'BEGIN { printf "%-32s %9.1f s %9.1f MB   exit %d", name, t / 1e9, bytes / 1e6, status }')")
    return $status
}

inside() { chroot "$fresh" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb \
    ${http_proxy:+http_proxy="$http_proxy"} ${FLEDGE_TEST_DATA:+FLEDGE_TEST_DATA=/data} \
    sh -c "cd /home/fledge && $1"; }

finish() {
    printf '\n'
    printf '%s\n' "${table[@]}"
    # Package lists are no packages: apt tells their size itself.
    grep -h '^Fetched' "$fresh"/home/fledge/build/apt-update.log 2>/dev/null |
        sed 's/^/and the package lists: /' || :
}

step "debootstrap" debootstrap --variant=minbase --components=$components "$suite" "$fresh" "$mirror" $script \
    > "$fresh.log" ||
    { tail "$fresh.log"; exit 1; }
rm -f "$fresh.log"
echo 'APT::Keep-Downloaded-Packages "true";' > "$fresh/etc/apt/apt.conf.d/keep"  # to be counted
cp /etc/resolv.conf "$fresh/etc/resolv.conf"
mount -t proc proc "$fresh/proc"
mkdir -p "$fresh/dev/pts"
mount -t devpts -o newinstance,ptmxmode=0666 devpts "$fresh/dev/pts"
ln -sf pts/ptmx "$fresh/dev/ptmx"
if [ -n "${FLEDGE_TEST_DATA:-}" ]; then
    mkdir "$fresh/data"
    mount --bind -o ro "$FLEDGE_TEST_DATA" "$fresh/data"
fi
git clone -q "file://$root" "$fresh/home/fledge"
for tool in python3 git sudo; do
    ! inside "command -v $tool" || { echo "fresh_debian: it has $tool already" >&2; exit 1; }
done

# Without root and without sudo it must say what to type, and touch nothing.
said=$(chroot --userspec=65534:65534 "$fresh" /home/fledge/fledge setup 2>&1) &&
    { echo "fresh_debian: set-up without root should have failed" >&2; exit 1; }
[[ $said == *"apt-get satisfy --no-install-recommends"* ]] || { echo "$said" >&2; exit 1; }

status=0
for command; do
    step "./fledge $command" inside "./fledge $command" || { status=1; break; }
    step "./fledge $command, again" inside "./fledge $command" || { status=1; break; }
done
finish
exit $status
