#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test. A missing OpenCL device, a failed test and a test that was
# skipped without a reason listed in tests/allowed_skips.txt all end with an error. Further arguments go to ctest.
set -euo pipefail
cd "$(dirname "$0")/.."
export POCL_AFFINITY=1
scripts/setup.sh test
# Some tests build the library once more, elsewhere: what is compiled alike is compiled once.
export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
scripts/build.sh -DCLSP_BUILD_TESTS=ON -DCLSP_BUILD_BENCH=ON -DCLSP_WARNINGS_AS_ERRORS=ON

echo "== devices"
build/bin/clspeckle devices

echo "== tests"
results="$PWD/build/test-results"
rm -rf "$results"
mkdir -p "$results"
export CLSP_TEST_RESULTS="$results"
# CLSP_NIGHTLY=1 adds what takes long: a thousand contexts, ThreadSanitizer, fuzzers.
levels=(--label-exclude nightly)
[ "${CLSP_NIGHTLY:-0}" = 0 ] || levels=()
status=0
ctest --test-dir build --parallel 2 --output-on-failure --no-tests=error "${levels[@]}" \
    --output-junit "$results/ctest.xml" "$@" || status=$?
.venv/bin/python scripts/check_skips.py "$results" tests/allowed_skips.txt || status=1
exit "$status"
