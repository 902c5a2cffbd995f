"""Every kernel, compiled for devices that need not be at hand: AMD's and NVIDIA's GPUs to machine code, and to SPIR for
a device without any extension (no double precision, as Intel's GPUs), by clang. Calls of built-in functions stay open,
as no device's library is linked. The options are those that all_stages takes, not all that there are.

PoCL takes its clang's extensions for granted; what only it accepts is found here.
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

# How a compiled kernel begins, and the command line.
ENTRY = {
    "amd": re.compile(r"\.amdhsa_kernel (\w+)"),
    "nvidia": re.compile(r"\.entry (\w+)"),
    "no extensions": re.compile(r"define (?:dso_local )?spir_kernel void @(\w+)"),
}
TARGETS = {
    "amd": ["--target=amdgcn-amd-amdhsa", "-mcpu=gfx1030", "-nogpulib", "-S"],
    "nvidia": ["--target=nvptx64-nvidia-nvcl", "-Xclang", "-target-cpu", "-Xclang", "sm_70", "-S"],
    "no extensions": ["--target=spir64-unknown-unknown", "-Xclang", "-cl-ext=-all", "-S", "-emit-llvm"],
}
KERNEL = re.compile(r"__kernel\s+(?:GROUP_SIZE\s+)?void\s+(\w+)")
# Of programs that are built for devices with double precision alone.
NEEDS_DOUBLE = "OPENCL EXTENSION cl_khr_fp64 : enable"
GPU_VECTOR_WIDTH = (
    "2"  # of floats: the least with which a CPU takes lanes, which are then those of a GPU that is forced to
)
LANES = re.compile(r"-DLANES=(\d+)")
GPU_LANES = "4"  # what lanes are where vectors are no wider
Program = tuple[str, str]  # source and options


def for_gpus(program: Program) -> bool:
    """Whether GPUs get it: wider lanes are for CPUs."""
    lanes = LANES.search(program[1])
    return lanes is None or lanes[1] == GPU_LANES


def record(folder: Path, vector_width: str | None) -> set[Program]:
    """The library's programs that all_stages builds, in both shapes of the engine."""
    assert RECORDER.is_file()
    # No disk cache: programs from binaries are not recorded.
    variables = {"CLSP_RECORDED_PROGRAMS": str(folder), "CLSPECKLE_DISK_CACHE": "off", "LD_PRELOAD": str(RECORDER)}
    if vector_width is not None:
        variables["CLSP_RECORDED_VECTOR_WIDTH"] = vector_width
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
    for path in folder.glob("*.options"):
        options = path.read_text()
        if options.startswith("-cl-std="):  # clFFT gives none
            found.add((path.with_suffix(".cl").read_text(), options))
    return found


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> list[Program]:
    """Those for this device, and those in lanes as GPUs get them."""
    own, of_gpus = (record(tmp_path_factory.mktemp("programs"), width) for width in (None, GPU_VECTOR_WIDTH))
    assert any(f"-DLANES={GPU_LANES}" in options for _, options in of_gpus)
    return sorted(own | of_gpus)


def compile_program(program: Program, target: str) -> subprocess.CompletedProcess[str]:
    source, options = program
    # -Werror: a warning would stand in the build log of every user of such a device. -Wpedantic: what this clang takes
    # beyond OpenCL C, other compilers need not take: NVIDIA's refuses variadic macros. Functions and variables are left
    # over where a part is switched off, and not every target has a use for every option of OpenCL.
    warnings = [
        "-Wall",
        "-Wno-unused-command-line-argument",
        "-Wno-unused-function",
        "-Wno-unused-variable",
        "-Wpedantic",
        "-Werror",
    ]
    command = [
        "clang",
        "-x",
        "cl",
        *options.split(),
        "-Xclang",
        "-finclude-default-header",
        *TARGETS[target],
        "-O2",
        *warnings,
    ]
    return subprocess.run([*command, "-o", "-", "-"], input=source, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("target", TARGETS)
def test_every_kernel_compiles(programs: list[Program], target: str) -> None:
    without_double = target == "no extensions"
    chosen = [
        program
        for program in programs
        if (without_double or for_gpus(program)) and not (without_double and NEEDS_DOUBLE in program[0])
    ]
    compiled: set[str] = set()
    with ThreadPoolExecutor(2) as pool:
        for program, done in zip(chosen, pool.map(lambda p: compile_program(p, target), chosen), strict=True):
            assert done.returncode == 0, f"{program[1]}\n{done.stderr[:8000]}"
            compiled.update(ENTRY[target].findall(done.stdout))
    files = [path.read_text() for path in (ROOT / "kernels").rglob("*.cl")]
    kernels = {
        kernel for file in files if not (without_double and NEEDS_DOUBLE in file) for kernel in KERNEL.findall(file)
    }
    assert len(kernels) > 40
    assert not kernels - compiled


FAULTS = {
    "double": ("__kernel void f(__global float *a) { a[0] = (float)((double)a[0] * 2.0); }", "cl_khr_fp64"),
    "half": ("__kernel void f(__global half *a) { half b = a[1]; a[0] = b * b; }", "half"),
    "address space": (
        "__kernel void f(__global float *a, __local float *b) { __global float *c = b; a[0] = c[0]; }",
        "address space",
    ),
    "variadic macro": (
        "#define f(a, ...) g(a, __VA_ARGS__)\n__kernel void k(__global float *a) { a[0] = 1.0f; }",
        "variadic macros",
    ),
    "unknown function": ("__kernel void f(__global float *a) { a[0] = sqrt_of_nobody(a[0]); }", "sqrt_of_nobody"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_no_device_takes_is_refused(fault: str) -> None:
    source, message = FAULTS[fault]
    done = compile_program((source, "-cl-std=CL1.2"), "no extensions")
    assert done.returncode != 0
    assert message in done.stderr


def test_local_memory_that_no_gpu_has_is_refused() -> None:
    source = (
        "__kernel void f(__global float *a) {{ __local float b[{0}]; b[get_local_id(0)] = a[0]; a[1] = b[{0} - 1]; }}\n"
    )
    assert compile_program((source.format(1024), "-cl-std=CL1.2"), "amd").returncode == 0
    done = compile_program((source.format(100_000), "-cl-std=CL1.2"), "amd")
    assert done.returncode != 0
    assert "local memory" in done.stderr
