#!/usr/bin/env bash
# Describes the ABI of a library that was built with debug information: record.sh LIBRARY OUTPUT
# With no arguments it builds the library and renews tests/abi/clspeckle.abi; do that when a release adds to the interface.
set -euo pipefail
root="$(cd "$(dirname "$0")/../.." && pwd)"
if [ $# -eq 0 ]; then
    build="$(mktemp -d)"
    trap 'rm -rf "$build"' EXIT
    cmake -S "$root" -B "$build" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS="-ffile-prefix-map=$root/=" \
          -DCLSP_BUILD_TOOLS=OFF -DCLSP_BUILD_EXAMPLES=OFF -DCLSP_BUILD_TESTS=OFF -DCLSP_BUILD_BENCH=OFF >/dev/null
    cmake --build "$build" --target clspeckle --parallel 2 >/dev/null
    set -- "$build/lib/libclspeckle.so" "$root/tests/abi/clspeckle.abi"
fi
# Only what the exported functions reach, and nothing of the machine that it was recorded on.
abidw --exported-interfaces-only --no-show-locs \
      --no-corpus-path --no-comp-dir-path --no-elf-needed --type-id-style hash "$1" >"$2.part"
mv "$2.part" "$2"
