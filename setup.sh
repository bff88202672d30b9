#!/usr/bin/env bash
# Gets what Lunette needs and cargo does not bring: Embree 4 and a C linker.
#
# Safe to run at any time: it changes nothing where both are there. Embree comes from the
# system's packages where they have it and this may install them (root, or sudo without a
# password); else the binary from PyPI's embreex package is unpacked into .embree/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

readonly folder=.embree
readonly package=embreex==4.4.0.post1
readonly sources=https://github.com/RenderKit/embree
# The two files taken from that package (its build for x86-64 Linux, glibc 2.28 or later).
readonly checksums='
aa4eb9d81e30237d032418832efd9caee19bead50f49939fb08347a053898c7a  libembree4-4aef3270.so.4
08d7ce01dcce5c49f874ee91ba8dad75ee3aa1838d5ce8a92f5b2ec98b9df2ed  libtbb-dcf63f8c.so.12'

say() { echo "setup: $*"; }

fail() {
    echo "setup: $*" >&2
    exit 1
}

have() { command -v "$1" >/dev/null 2>&1; }

# Runs a command as root, or fails at once where that would need a password.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif have sudo && sudo -n true 2>/dev/null; then
        sudo -n "$@"
    else
        return 1
    fi
}

# Brings apt's lists up to date, once; fails where apt or the right to use it is missing.
apt_lists=stale
apt_update() {
    have apt-get || return 1
    [ "$apt_lists" = stale ] || return 0
    as_root apt-get -qq update >&2 || return 1
    apt_lists=fresh
}

apt_install() {
    apt_update || return 1
    say "installing $* with apt-get"
    as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get -qq install -y --no-install-recommends "$@" >&2
}

# ---- the C linker --------------------------------------------------------------------

ensure_linker() {
    have cc && return
    case "$(uname -s)" in
        Darwin) fail "a C linker is missing: run xcode-select --install" ;;
        MINGW* | MSYS* | CYGWIN*) return ;; # Rust's own installer sees to it there
    esac
    apt_install gcc libc6-dev || true
    have cc || fail "a C linker is missing: install gcc (Debian, Ubuntu: apt-get install gcc libc6-dev)"
}

# ---- Embree --------------------------------------------------------------------------

# Prints where the system has Embree 4; fails where it has none.
system_embree() {
    local path
    for path in /opt/homebrew/lib/libembree4.dylib /usr/local/lib/libembree4.dylib; do
        if [ -e "$path" ]; then echo "$path"; return; fi
    done
    PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null |
        awk '$1 == "libembree4.so.4" && !path { path = $NF } END { print path; exit !path }'
}

# Whether a folder holds both files of the package, whole.
is_complete() {
    (cd "$1" 2>/dev/null && sha256sum --check --status <<<"${checksums#$'\n'}" 2>/dev/null)
}

install_from_apt() {
    apt_update || return 1
    [[ $(apt-cache policy libembree4-4 2>/dev/null) == *"Candidate: "[0-9]* ]] || return 1
    apt_install libembree4-4
}

# Prints a Python that has pip: the system's, or one in a fresh environment under $1.
python_with_pip() {
    have python3 || apt_install python3 python3-pip >&2 || return 1
    if python3 -m pip --version >/dev/null 2>&1; then
        echo python3
    elif python3 -m venv "$1/venv" >/dev/null 2>&1; then
        echo "$1/venv/bin/python"
    else
        apt_install python3-pip >&2 && echo python3
    fi
}

install_from_pypi() {
    local partial python
    mkdir -p "$folder"
    partial=$(mktemp -d "$folder/partial.XXXXXX")
    # shellcheck disable=SC2064  # the name as it is now
    trap "rm -rf '$PWD/$partial'; rmdir '$PWD/$folder' 2>/dev/null || true" EXIT

    python=$(python_with_pip "$partial") ||
        fail "python3 with pip is missing: install them (Debian, Ubuntu: apt-get install python3-pip)"
    say "fetching Embree 4.4 from PyPI ($package, 15 MB)"
    # Whatever Python is here, the package is the one whose checksums are known.
    "$python" -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: \
        --python-version 3.11 --implementation cp --platform manylinux_2_28_x86_64 \
        --dest "$partial" "$package" >&2 ||
        fail "could not fetch $package from PyPI: check the network and run ./setup.sh again"
    "$python" - "$partial" <<'PYTHON' || fail "could not unpack $package: run ./setup.sh again"
import glob, os, sys, zipfile
folder = sys.argv[1]
wheel = zipfile.ZipFile(glob.glob(os.path.join(folder, "*.whl"))[0])
for name in wheel.namelist():
    if name.startswith(("embreex.libs/libembree4", "embreex.libs/libtbb")):
        with open(os.path.join(folder, os.path.basename(name)), "wb") as file:
            file.write(wheel.read(name))
PYTHON
    is_complete "$partial" ||
        fail "the Embree in $package is not the one expected: set LUNETTE_EMBREE to a libembree4 you trust"

    # Embree last: Lunette looks for it, and where it is, its TBB is.
    mv -f "$partial"/libtbb* "$folder/"
    mv -f "$partial"/libembree4* "$folder/"
}

ensure_embree() {
    local path
    if [ -n "${LUNETTE_EMBREE:-}" ]; then
        [ -e "$LUNETTE_EMBREE" ] || fail "LUNETTE_EMBREE names $LUNETTE_EMBREE, which is not there: correct or unset it"
        say "Embree 4: $LUNETTE_EMBREE (LUNETTE_EMBREE)"
        return
    fi
    if path=$(system_embree); then
        say "Embree 4: $path"
        return
    fi
    if is_complete "$folder"; then
        say "Embree 4: $folder/"
        return
    fi

    case "$(uname -s)" in
        Linux) ;;
        Darwin) fail "Embree 4 is missing: run brew install embree" ;;
        *) fail "Embree 4 is missing: get it from $sources/releases and set LUNETTE_EMBREE to its library" ;;
    esac
    if install_from_apt && path=$(system_embree); then
        say "Embree 4: $path"
        return
    fi
    if [ "$(uname -m)" != x86_64 ] || ! getconf GNU_LIBC_VERSION >/dev/null 2>&1; then
        fail "no ready-made Embree 4 for this system: build it ($sources) and set LUNETTE_EMBREE to its library"
    fi
    install_from_pypi
    say "Embree 4: $folder/"
}

ensure_linker
ensure_embree
