#!/usr/bin/env bash
# Installs what is missing: Debian packages (with sudo if need be) and a Python virtual environment in .venv.
# usage: scripts/setup.sh figure|build|test     (figure: what scripts of figures need beside an installed program)
set -euo pipefail
cd "$(dirname "$0")/.."
level="${1:-build}"

packages=(build-essential cmake ninja-build pkg-config ocl-icd-opencl-dev opencl-headers opencl-clhpp-headers
          pocl-opencl-icd libclfft-dev libfmt-dev libeigen3-dev libcli11-dev nlohmann-json3-dev libjs-vega
          libspng-dev libtiff-dev libjpeg62-turbo-dev libstb-dev libopenexr-dev python3 python3-venv)
if [ "$level" = figure ]; then
    packages=(pocl-opencl-icd python3 python3-venv)
elif [ "$level" = test ]; then
    packages+=(libgtest-dev libgmock-dev libbenchmark-dev libfftw3-dev abigail-tools oclgrind clang libclang-rt-dev
               git ccache doxygen groff-base mmdebstrap libegl-dev libgl-dev libegl-mesa0 libgl1-mesa-dri chromium)
fi

missing=()
for package in "${packages[@]}"; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
done
if [ "${#missing[@]}" -gt 0 ]; then
    sudo=""
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || {
            echo "These packages are missing, and neither root nor sudo is at hand to install them: ${missing[*]}" >&2
            exit 1
        }
        sudo=sudo
    fi
    echo "Installing: ${missing[*]}"
    export DEBIAN_FRONTEND=noninteractive
    $sudo apt-get -q update
    $sudo apt-get -q install -y --no-install-recommends "${missing[@]}"
fi

# A virtual environment whose making was interrupted has no pip.
.venv/bin/python -m pip --version >/dev/null 2>&1 || { rm -rf .venv; python3 -m venv .venv; }
.venv/bin/python -m pip install -q --disable-pip-version-check "pip>=23.1" "numpy>=1.24" matplotlib
[ "$level" = figure ] || .venv/bin/python -m pip install -q --disable-pip-version-check "scikit-build-core>=0.11"
if [ "$level" = test ]; then
    requirements=()
    for folder in tests/reference tests/bindings/python tests/tools tests/install tests/examples docs; do
        requirements+=(-r "$folder/requirements.txt")
    done
    .venv/bin/python -m pip install -q --disable-pip-version-check "${requirements[@]}"
fi
