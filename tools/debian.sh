#!/bin/bash
# Run a command on the current tree in a root of another Debian suite, built with debootstrap.
#
#   tools/debian.sh SUITE COMMAND...        SUITE: trixie (Debian 13) or sid (the newest)
#
# The root is built when it is missing or when what it is made of has changed, and kept in
# ${XDG_CACHE_HOME:-$HOME/.cache}/fenicsmech/SUITE (FENICSMECH_ROOTS overrides the folder above SUITE). That of sid, which
# moves by itself, is brought up to date before each run. Each run starts from a fresh copy of the tree in
# /fenicsmech; nothing is written back. Needs root, or sudo.
set -euo pipefail

suite=${1:-}
shift || true
tree=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
root=${FENICSMECH_ROOTS:-${XDG_CACHE_HOME:-$HOME/.cache}/fenicsmech}/$suite
environment=(HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
    OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_btl=^tcp
    PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe)

fail() {
    printf 'tools/debian.sh: %s\n' "$@" >&2
    exit 1
}

packages() { # the names in the package lists, without the comments
    sed -E 's/#.*//' "$tree/tools/packages/run.txt" "$tree/tools/packages/other-suites.txt" | xargs
}

# The mirror the host's own Debian packages come from.
host_mirror() {
    local uri
    uri=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Origin: Debian' 'Label: Debian' || true)
    uri=${uri%%$'\n'*}
    if [[ $uri == mirror+file:* ]]; then # a file that lists mirrors, as Debian's cloud images have it
        uri=$(grep -oEm 1 'https?://[^[:space:]]+' "${uri#mirror+file:}" || true)
    fi
    if [[ $uri != http?(s)://* ]]; then
        uri=http://deb.debian.org/debian
    fi
    echo "${uri%/}"
}

# wget, which debootstrap downloads with, learns of a proxy from the environment only, and apt may have one of its own;
# the apt in the root, in its turn, has no other environment than ours.
use_host_proxy() {
    local http='' https='' name
    eval "$(apt-config shell http Acquire::http::Proxy https Acquire::https::Proxy)"
    if [[ $http == http* ]]; then export http_proxy=${http_proxy:-$http}; fi
    if [[ $https == http* ]]; then export https_proxy=${https_proxy:-$https}; fi
    for name in http_proxy https_proxy no_proxy; do
        if [ -n "${!name:-}" ]; then environment+=("$name=${!name}"); fi
    done
}

# How the host reaches its mirror (names, proxy, certificates, retries, clock tolerance), for the apt in the root.
copy_network_settings() {
    local target=$1 settings=$1/etc/apt/apt.conf.d/00host file
    apt-config dump | { grep -E '^Acquire::(https?|Retries|Check|ForceIPv)' || true; } \
        | sed '/Auto-\?Detect/d' >"$settings" # a program of the host's
    for file in /etc/hosts /etc/resolv.conf /etc/ssl/certs/ca-certificates.crt \
        $(sed -nE 's/^.*"(\/[^"]+)";$/\1/p' "$settings"); do
        if [ -f "$file" ]; then
            mkdir -p "$target${file%/*}"
            cp -L "$file" "$target$file"
        fi
    done
}

# Mounts live in a namespace of their own, so that none is left behind however this ends.
may_mount() {
    unshare --mount true 2>/dev/null
}
own_mounts=(unshare --mount --propagation private)

# Run a command inside a root. Where mounting is forbidden (some containers) the device nodes that debootstrap made must
# do, and UCX and hwloc, which miss /proc and /sys but do without, are kept from saying so in the output of every program.
enter() {
    local target=$1
    shift
    if may_mount; then
        "${own_mounts[@]}" bash -euc '
            target=$1; shift
            mount --rbind /dev "$target/dev"
            mount -t tmpfs -o mode=1777 tmpfs "$target/dev/shm"
            mount --rbind /sys "$target/sys"
            mount -t proc proc "$target/proc"
            exec chroot "$target" /usr/bin/env -i "$@"' enter "$target" "${environment[@]}" "$@"
    else
        chroot "$target" /usr/bin/env -i "${environment[@]}" UCX_LOG_LEVEL=fatal HWLOC_HIDE_ERRORS=2 "$@"
    fi
}

fill() { # a new root
    local target=$1 mirror=$2
    use_host_proxy
    if ! may_mount; then own_mounts=(); fi
    "${own_mounts[@]}" debootstrap --variant=minbase "$suite" "$target" "$mirror"
    copy_network_settings "$target"
    # Documentation and translations, which nothing here reads, take as long to unpack as the programs.
    printf 'path-exclude=/usr/share/%s/*\n' doc man locale >"$target/etc/dpkg/dpkg.cfg.d/fenicsmech"
    echo force-unsafe-io >>"$target/etc/dpkg/dpkg.cfg.d/fenicsmech"
    enter "$target" apt-get update
    # shellcheck disable=SC2046 # one word for each package
    enter "$target" apt-get install -y --no-install-recommends $(packages)
    enter "$target" apt-get clean
    echo /fenicsmech >"$target/usr/lib/python3/dist-packages/fenicsmech.pth"
}

build() {
    local mirror
    mirror=$(host_mirror)
    echo "Building a root of Debian $suite in $root from $mirror: about two minutes"
    rm -rf --one-file-system "$root.partial" "$root"
    mkdir -p "$root.partial"
    trap 'tail -n 5 "$root.log" >&2; fail "the root could not be built; the whole log is $root.log"' EXIT
    (fill "$root.partial" "$mirror") >"$root.log" 2>&1
    trap - EXIT
    echo "$recipe" >"$root.partial/recipe"
    mv "$root.partial" "$root"
}

upgrade() { # of a suite that moves by itself
    enter "$root" sh -c 'apt-get update -q && apt-get dist-upgrade -qy --no-install-recommends && apt-get clean' \
        >"$root.log" 2>&1 || fail "the root could not be brought up to date; the whole log is $root.log"
}

copy_tree() {
    rm -rf --one-file-system "$root/fenicsmech"
    mkdir "$root/fenicsmech"
    tar -C "$tree" --exclude-vcs --exclude=./.venv --exclude=./results --exclude=__pycache__ --exclude='.*_cache' \
        -cf - . | tar -C "$root/fenicsmech" --no-same-owner -xf -
}

if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null || fail "building and entering a root needs root or sudo, and neither is at hand"
    pass=("FENICSMECH_ROOTS=${root%/*}")
    for name in http_proxy https_proxy no_proxy; do
        if [ -n "${!name:-}" ]; then pass+=("$name=${!name}"); fi
    done
    exec sudo env "${pass[@]}" bash "${BASH_SOURCE[0]}" "$suite" "$@"
fi

case $suite in
    trixie | sid) ;;
    *) fail "fenicsmech is not tested on '$suite': give trixie or sid" ;;
esac
[ $# -gt 0 ] || fail "no command given, for example: tools/debian.sh trixie python3 -c 'import fenicsmech'"
command -v debootstrap >/dev/null || fail "debootstrap is missing; run: make install-test"

mkdir -p "${root%/*}"
exec 9>"$root.lock"
flock 9 # one build or run at a time
recipe=$({ packages; declare -f fill copy_network_settings; } | sha256sum)
if [ "$(cat "$root/recipe" 2>/dev/null)" != "$recipe" ]; then
    build
elif [ "$suite" = sid ]; then
    upgrade
fi
copy_tree
enter "$root" env -C /fenicsmech "$@"
