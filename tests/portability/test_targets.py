"""Every kernel, compiled for devices that need not be at hand: AMD's and NVIDIA's GPUs to machine code, and to SPIR for a device without
any extension (no double precision, as Intel's GPUs), by clang. Calls of built-in functions stay open, as no device's library is linked.

PoCL takes its clang's extensions for granted, and runs work-groups of any size in any memory; what only it accepts is found here.
"""

from __future__ import annotations

import os
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
BIN = Path(os.environ.get("CLSPECKLE_BIN", BUILD / "bin"))
RECORDER = BUILD / "lib" / "libprogram_recorder.so"

TARGETS = {
    "amd": ["--target=amdgcn-amd-amdhsa", "-mcpu=gfx1030", "-nogpulib", "-S"],
    "nvidia": ["--target=nvptx64-nvidia-nvcl", "-Xclang", "-target-cpu", "-Xclang", "sm_70", "-S"],
    "no extensions": ["--target=spir64-unknown-unknown", "-Xclang", "-cl-ext=-all", "-S", "-emit-llvm"],
}
KERNEL = re.compile(r"__kernel\s+(?:GROUP_SIZE\s+)?void\s+(\w+)")
Program = tuple[str, str]  # source and options


def in_lanes(program: Program) -> bool:
    """Whether it is a program for CPUs."""
    return "-DLANES=" in program[1]


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> list[Program]:
    """The library's programs that all_stages builds, in both shapes of the engine."""
    folder = tmp_path_factory.mktemp("programs")
    variables = {"CLSP_RECORDED_PROGRAMS": str(folder), "CLSPECKLE_DISK_CACHE": "off", "LD_PRELOAD": str(RECORDER)}
    done = subprocess.run(
        [BIN / "all_stages"],
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-20000:]
    found = set()
    for path in folder.glob("*.cl"):
        options = path.with_suffix(".options").read_text()
        if options.startswith("-cl-std="):  # clFFT gives none
            found.add((path.read_text(), options))
    return sorted(found)


def compile_program(program: Program, target: str) -> subprocess.CompletedProcess[str]:
    source, options = program
    # -Werror: a warning would stand in the build log of every user of such a device.
    command = ["clang", "-x", "cl", *options.split(), "-Xclang", "-finclude-default-header", *TARGETS[target], "-O2", "-Werror"]
    return subprocess.run([*command, "-o", "-", "-"], input=source, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("target", TARGETS)
def test_every_program_compiles(programs: list[Program], target: str) -> None:
    chosen = [program for program in programs if target == "no extensions" or not in_lanes(program)]
    with ThreadPoolExecutor(2) as pool:
        for program, done in zip(chosen, pool.map(lambda p: compile_program(p, target), chosen), strict=True):
            assert done.returncode == 0, f"{program[1]}\n{done.stderr[:8000]}"
            assert done.stdout


def test_no_kernel_is_forgotten(programs: list[Program]) -> None:
    recorded = {kernel for source, _ in programs for kernel in KERNEL.findall(source)}
    kernels = {kernel for path in (ROOT / "kernels").glob("*.cl") for kernel in KERNEL.findall(path.read_text())}
    assert kernels
    assert not kernels - recorded


FAULTS = {
    "double": "__kernel void f(__global float *a) { a[0] = (float)((double)a[0] * 2.0); }",
    "half": "#pragma OPENCL EXTENSION cl_khr_fp16 : enable\n__kernel void f(__global half *a) { a[0] = a[1] * a[0]; }",
    "address space": "__kernel void f(__global float *a, __local float *b) { __global float *c = b; a[0] = c[0]; }",
    "unknown function": "__kernel void f(__global float *a) { a[0] = __builtin_ia32_sqrtss_nobody(a[0]); }",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_no_device_takes_is_refused(fault: str) -> None:
    assert compile_program((FAULTS[fault], "-cl-std=CL1.2"), "no extensions").returncode != 0
