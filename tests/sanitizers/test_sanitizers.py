"""The GoogleTest programs under sanitizers, and every kernel under oclgrind.

The sanitized library is built in a folder of its own below the build folder; later runs build only what changed. A tool that is
missing is a failure: a check that did not run found nothing.
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
BIN = Path(os.environ.get("CLSPECKLE_BIN", BUILD / "bin"))
CC = os.environ.get("CLSPECKLE_C_COMPILER", "cc")
CXX = os.environ.get("CLSPECKLE_CXX_COMPILER", "c++")
WITHOUT_TRANSFORM = ["test_philox", "test_phase", "test_pattern", "test_sensor", "test_runtime", "test_no_platform"]
WITH_TRANSFORM = ["test_aperture", "test_pipeline", "test_statistics", "test_cpp_binding", "test_concurrency"]
PROGRAMS = WITHOUT_TRANSFORM + WITH_TRANSFORM


def run(*command: object, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        errors="replace",
        env={**os.environ, **variables},
    )


def sanitized_build(folder: str, sanitizers: str, targets: list[str]) -> Path:
    build = BUILD / folder
    done = run("cmake", "-S", ROOT, "-B", build, "-DCMAKE_BUILD_TYPE=RelWithDebInfo", f"-DCLSP_SANITIZE={sanitizers}",
               f"-DCMAKE_C_COMPILER={CC}", f"-DCMAKE_CXX_COMPILER={CXX}", "-DCLSP_BUILD_TOOLS=OFF", "-DCLSP_BUILD_EXAMPLES=OFF",
               "-DCLSP_BUILD_BENCH=OFF", "-DCLSP_BUILD_TESTS=ON")  # fmt: skip
    assert done.returncode == 0, done.stdout
    done = run("cmake", "--build", build, "--parallel", "2", "--target", *targets)
    assert done.returncode == 0, done.stdout[-20000:]
    return build


@pytest.fixture(scope="session")
def address_build() -> Path:
    return sanitized_build("sanitized", "address,undefined", PROGRAMS)


ADDRESS_OPTIONS = {
    # clFFT 2.12.2 deletes its actions through a base class without a virtual destructor; that check cannot be turned off
    # for one library alone.
    "ASAN_OPTIONS": "detect_leaks=1:abort_on_error=0:exitcode=99:new_delete_type_mismatch=0",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1:exitcode=99",
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_address_and_undefined(address_build: Path, program: str) -> None:
    variables = dict(ADDRESS_OPTIONS)
    if program not in WITHOUT_TRANSFORM:
        variables["LSAN_OPTIONS"] = f"suppressions={HERE / 'leaks.supp'}:print_suppressions=0"
    if program == "test_no_platform":
        variables["OCL_ICD_VENDORS"] = variables["OPENCL_VENDOR_PATH"] = str(address_build / "tests" / "no_platform")
    done = run(address_build / "bin" / program, **variables)
    assert done.returncode == 0, done.stdout[-20000:]
    assert "ERROR: AddressSanitizer" not in done.stdout
    assert "runtime error:" not in done.stdout


@pytest.mark.parametrize("fault", ["overflow", "leak", "undefined"])
def test_sanitizers_see_faults(fault: str, tmp_path: Path) -> None:
    """The options above end a faulty program with an error."""
    source = tmp_path / "fault.cpp"
    source.write_text(
        "#include <cstring>\n#include <cstdlib>\nint *volatile kept;\n"
        "int main(int argc, char **argv) {\n"
        '    if (!std::strcmp(argv[1], "overflow")) { kept = new int[4]; kept[argc + 2] = 1; }\n'
        '    if (!std::strcmp(argv[1], "leak")) { kept = new int[4]; kept = nullptr; }\n'
        '    if (!std::strcmp(argv[1], "undefined")) { int volatile top = 0x7fffffff; const int sum = top + argc; top = sum; }\n'
        "    return 0;\n}\n"
    )
    program = tmp_path / "fault"
    done = run(CXX, "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", source, "-o", program)
    assert done.returncode == 0, done.stdout
    assert run(program, "none", **ADDRESS_OPTIONS).returncode == 0
    arguments = [fault, "x"] if fault == "overflow" else [fault]
    assert run(program, *arguments, **ADDRESS_OPTIONS).returncode != 0


@pytest.mark.nightly
def test_threads() -> None:
    build = sanitized_build("thread_sanitized", "thread", ["test_concurrency"])
    done = run(
        build / "bin" / "test_concurrency",
        TSAN_OPTIONS=f"suppressions={HERE / 'threads.supp'}:exitcode=99",
    )
    assert done.returncode == 0, done.stdout[-20000:]


def oclgrind(log: Path, **variables: str) -> tuple[subprocess.CompletedProcess[str], str]:
    """Runs all stages on oclgrind's simulated device; the errors that it found."""
    done = run(
        "oclgrind",
        "--check-api",
        "--data-races",
        "--log",
        log,
        BIN / "all_stages",
        CLSPECKLE_DEVICE="oclgrind",
        **variables,
    )
    return done, log.read_text(errors="replace") if log.is_file() else ""


def test_every_kernel_under_oclgrind(tmp_path: Path) -> None:
    done, errors = oclgrind(tmp_path / "log")
    assert done.returncode == 0, done.stdout[-20000:]
    assert "device: Oclgrind Simulator" in done.stdout
    assert "all stages ran" in done.stdout
    assert errors == ""


def test_every_kernel_ran() -> None:
    """A kernel that all_stages.cpp does not reach is not checked; the instruction counts name what ran."""
    log = run("oclgrind", "--inst-counts", BIN / "all_stages", CLSPECKLE_DEVICE="oclgrind").stdout
    ran = set(re.findall(r"Instructions executed for kernel '(\w+)'", log))
    kernels = set()
    for path in (ROOT / "kernels").glob("*.cl"):
        kernels |= set(re.findall(r"__kernel\s+void\s+(\w+)", path.read_text()))
    assert kernels
    assert not kernels - ran, f"all_stages.cpp does not run {sorted(kernels - ran)}"


WRITE = "to = blocks + blocks_offset + 4 * i;"
FAULTS = {
    "a write beside the buffer": ("to = blocks + blocks_offset + 4 * i + 4096;", "Invalid write"),
    "a race between work-items": ("to = blocks + blocks_offset + 4 * (i / 2);", "race"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_oclgrind_sees_faults(fault: str, tmp_path: Path) -> None:
    source = (ROOT / "kernels" / "philox.cl").read_text()
    assert source.count(WRITE) == 1
    faulty, found = FAULTS[fault]
    (tmp_path / "philox.cl").write_text(source.replace(WRITE, faulty))
    done, errors = oclgrind(tmp_path / "log", CLSPECKLE_KERNEL_DIR=str(tmp_path))
    assert found in errors, f"{fault} goes unseen: {errors[-2000:]}{done.stdout[-2000:]}"
