#!/usr/bin/env bash
# Renders the office desk sequence on the best OpenCL device and draws a figure. Takes the program that is built here or
# installed as a package; else installs what is missing and builds it, without tests, benchmarks and examples.
# usage: scripts/demo.sh [OUTPUT_FOLDER]      (default: demo-output)
set -euo pipefail
cd "$(dirname "$0")/.."
output="${1:-demo-output}"
export POCL_AFFINITY=1
# An installed program of another release may not know what is asked of it here.
header=capi/include/clspeckle/types.h
release="$(sed -n 's/^#define CLSP_VERSION_[A-Z]* \([0-9]*\).*/\1/p' "$header" | paste -sd.)"
program=build/bin/clspeckle
python=
if [ ! -x "$program" ] && clspeckle --version 2>/dev/null | grep -qF "$release"; then
    program=clspeckle
    for python in python3 .venv/bin/python; do
        ! "$python" -c 'import matplotlib, numpy' 2>/dev/null || break
        python=
    done
    [ -n "$python" ] || scripts/setup.sh figure
else
    scripts/setup.sh build
    # Several sources compiled as one take about half the time of theirs.
    scripts/build.sh -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=16 -DCLSP_BUILD_TESTS=OFF \
        -DCLSP_BUILD_BENCH=OFF -DCLSP_BUILD_EXAMPLES=OFF
fi
python="${python:-.venv/bin/python}"
office=examples/office/gbuffers
"$python" -m tarfile -e "$office/frames.tar.xz" "$office"

echo
echo "== devices"
"$program" devices

echo
# The laser light that comes back from a desk is not polarized (thesis 2.9).
echo "== the sequence: ideal images, frames and previews in $output/office"
"$program" render "$office/sequence.json" -o "$output/office" --degree-of-polarization 0 --exposure-gain auto \
    --save-ideal --stage-times

echo
echo "== its first frame without noise or sensor"
"$program" render "$office/sequence.json" -o "$output/intensity" --degree-of-polarization 0 --frames 1 --no-sensor \
    --format float-npy --no-preview --quiet

echo
"$python" examples/office/figure.py "$output" --figure "$output/office.png"

cat <<END

The figure is $output/office.png. To try next:
    more speckle:
        $program render $output/office/ideal_000000.npy -o wall --f-number 8 --seed 7 --exposure-gain auto
    what a camera may do to a frame:
        $program effects
    a stand-in for your camera, and what the simulator lacks:
        $program capture make my-camera --effect defocus:waves=0.9 --width 128 --height 112
        $program diagnose my-camera --html report.html
Tutorials: docs/tutorials. Your own camera: docs/guide/captures.md.
END
