#!/bin/bash
# Install what fenicsmech needs on Debian: packages from apt, and .venv on top of them.
#
#   tools/install-debian.sh run       what `make demo` needs; downloads from Debian only
#   tools/install-debian.sh test      that, and what `make test` needs: more packages, and pinned tools from PyPI
#   tools/install-debian.sh docs      that, and what `make docs` needs
#
# Does nothing, quickly, when all is in place. Needs root or sudo if a package is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

purpose=${1:-}
python=/usr/bin/python3 # Debian's own: dolfinx is built for it, whatever Python comes first on PATH
venv=.venv

fail() {
    printf 'tools/install-debian.sh: %s\n' "$@" >&2
    exit 1
}

packages() { # the names in the package lists of this purpose, without the comments
    local lists=(tools/packages/run.txt)
    if [ "$purpose" != run ]; then lists+=(tools/packages/test.txt); fi
    if [ "$purpose" = docs ]; then lists+=(tools/packages/docs.txt); fi
    sed -E 's/#.*//' "${lists[@]}" | xargs -n 1
}

missing_packages() {
    comm -23 <(packages | sort) \
        <(packages | xargs dpkg-query -W -f '${Status} ${Package}\n' 2>/dev/null | sed -n 's/^install ok installed //p' | sort)
}

install_packages() {
    local names=("$@") as_root=()
    if [ "$(id -u)" != 0 ]; then
        command -v sudo >/dev/null || fail "these Debian packages are missing, and neither root nor sudo is at hand." \
            "Have an administrator run:" "  apt-get install --no-install-recommends ${names[*]}"
        as_root=(sudo)
    fi
    echo "Installing Debian packages: ${names[*]}"
    "${as_root[@]}" apt-get update -q
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -qy --no-install-recommends "${names[@]}" \
        || fail "apt-get could not install the packages above." \
            "\`make demo\` needs Debian 12 or 13, \`make test\` Debian 12 (Debian 13 has no CalculiX)."
}

# A venv that sees Debian's packages, and this tree through a .pth file: unlike `pip install -e .` that needs no
# build backend and no network.
make_venv() {
    echo "Creating $venv"
    "$python" -m venv --clear --system-site-packages "$venv"
    pwd >"$("$venv/bin/python3" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/fenicsmech.pth"
}

install_tools() { # the versions pinned in pyproject.toml
    local tools
    mapfile -t tools < <("$python" -c 'import tomllib
for tool in tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["dev"]: print(tool)')
    echo "Installing ${tools[*]}"
    "$venv/bin/python3" -m pip install --quiet --disable-pip-version-check "${tools[@]}" \
        || fail "the tools above could not be installed with pip, which needs to reach a Python package index" \
            "(behind a proxy or with a mirror of your own, set PIP_PROXY or PIP_INDEX_URL and try again)."
}

case $purpose in
    run | test | docs) ;;
    *) fail "usage: tools/install-debian.sh run|test|docs" ;;
esac
command -v apt-get >/dev/null || fail "this is not Debian: install the packages listed in tools/packages by hand."

mapfile -t missing < <(missing_packages)
if [ ${#missing[@]} -gt 0 ]; then
    install_packages "${missing[@]}"
fi

# The default the alternatives system picks, unless someone chose another by hand.
blas=$(readlink -f /usr/lib/*/libblas.so.3 | head -n 1)
if [[ $blas != *openblas* ]]; then
    echo "Note: the BLAS in use is $blas; OpenBLAS factors about twice as fast as the reference BLAS" \
        "(sudo update-alternatives --config libblas.so.3-$(uname -m)-linux-gnu)." >&2
fi

recipe=$({ cat tools/install-debian.sh pyproject.toml; "$python" --version; pwd; } | sha256sum)
if [ "$(cat "$venv/recipe-run" 2>/dev/null)" != "$recipe" ]; then
    make_venv
    echo "$recipe" >"$venv/recipe-run"
fi
if [ "$purpose" != run ] && [ "$(cat "$venv/recipe-test" 2>/dev/null)" != "$recipe" ]; then
    install_tools
    echo "$recipe" >"$venv/recipe-test"
fi
