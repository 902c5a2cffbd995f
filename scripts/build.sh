#!/usr/bin/env bash
# Builds into build/ and installs the Python package into .venv. Further arguments go to cmake. Sources are compiled one
# by one unless these say otherwise (the demo compiles several as one): what did not change is not compiled again.
set -euo pipefail
cd "$(dirname "$0")/.."
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DCLSP_PYTHON="$PWD/.venv/bin/python" \
    -DCMAKE_UNITY_BUILD=OFF "$@"
cmake --build build --parallel
.venv/bin/python -m pip install -q --disable-pip-version-check --no-build-isolation \
    -C "cmake.define.CLSP_PYTHON_LIBRARY=$PWD/build/lib/libclspeckle.so" .
