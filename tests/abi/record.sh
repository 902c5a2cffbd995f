#!/usr/bin/env bash
# Describes the ABI of a library that was built with debug information: record.sh LIBRARY OUTPUT
# With no arguments it renews tests/abi/clspeckle.abi from the public headers; do that when a release adds to the
# interface.
set -euo pipefail
root="$(cd "$(dirname "$0")/../.." && pwd)"
if [ $# -eq 0 ]; then
    folder="$(mktemp -d)"
    trap 'rm -rf "$folder"' EXIT
    python3 "$root/tests/abi/stub.py" "$folder/libclspeckle.so"
    set -- "$folder/libclspeckle.so" "$root/tests/abi/clspeckle.abi"
fi
# Only what the exported functions reach, and nothing of the machine that it was recorded on.
abidw --exported-interfaces-only --no-show-locs \
      --no-corpus-path --no-comp-dir-path --no-elf-needed --type-id-style hash "$1" >"$2.part"
# Some compiler launchers leave the source folder in the debug information.
sed -i "s#path='$root/#path='#" "$2.part"
mv "$2.part" "$2"
