#!/usr/bin/env bash
# Installs what is missing, builds, renders the office desk sequence on the best OpenCL device, and draws a figure.
# usage: scripts/demo.sh [OUTPUT_FOLDER]      (default: demo-output)
set -euo pipefail
cd "$(dirname "$0")/.."
output="${1:-demo-output}"
export POCL_AFFINITY=1
scripts/setup.sh build
scripts/build.sh -DCLSP_BUILD_TESTS=OFF -DCLSP_BUILD_BENCH=OFF

program=build/bin/clspeckle
office=examples/office/gbuffers
cmake -E chdir "$office" cmake -E tar xf frames.tar.xz

echo
echo "== devices"
"$program" devices

echo
# The laser light that comes back from a desk is not polarized (thesis 2.9).
echo "== the sequence: ideal images, frames and previews in $output/office"
"$program" render "$office/sequence.json" -o "$output/office" --degree-of-polarization 0 --exposure-gain auto --save-ideal --stage-times

echo
echo "== its first frame without noise or sensor"
"$program" render "$office/sequence.json" -o "$output/intensity" --degree-of-polarization 0 --frames 1 --no-sensor --format float-npy --no-preview --quiet

echo
.venv/bin/python examples/office/figure.py "$output" --figure "$output/office.png"
