"""Every GoogleTest program under sanitizers (the diagnosis's mathematics at night), and every kernel under oclgrind.

The sanitized library is built in a folder of its own below the build folder; later runs build only what changed. It is
not optimized: that halves the time to compile it, and the programs spend theirs in the compilers of kernels, which are
not sanitized. Clang halves it once more, and so does compiling eight files as one. What was selected runs two at a
time. A tool that is missing is a failure: a check that did not run found nothing.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
BIN = Path(os.environ.get("CLSPECKLE_BIN", BUILD / "bin"))
CC, CXX = "clang", "clang++"
# Written by CMake: a new program is sanitized without being named here.
GTEST_PROGRAMS = (BUILD / "tests" / "gtest_programs.txt").read_text().split()
# What cannot run: the reason.
EXCLUDED = {
    "test_memory": "it bounds the resident memory of the process, which grows by freed memory that a sanitizer keeps",
    "test_native_passes": "what it tests belongs to the benchmarks, which are not part of the sanitized build",
}
MORE = ["test_no_platform", "test_faults"]
PROGRAMS = [name for name in [*GTEST_PROGRAMS, *MORE] if name not in EXCLUDED]
# Programs that run once more with clFFT, whose plans several apertures and threads share, and with the engine
# for GPUs.
RUNS = [*PROGRAMS, "test_aperture-clfft", "test_concurrency-clfft", "test_aperture-gpu"]
Done = subprocess.CompletedProcess[str]
# Programs that measure clFFT beside the other engines: its own leaks are known (leaks.supp).
USERS_OF_CLFFT = {"test_work_groups", "test_tuning", "test_faults"}
# Programs of which a part is enough: what kernels are made of, at the first sizes and options. No more of the library's
# own code runs for the others.
FILTERS = {
    "test_cpu_codelets": "-*/1?",
    "test_diagnosis_api": "-*LeftOut",
    "test_faults": "*/files",
    "test_frame_changes": "-*WhatFluctuates:*OfFewFramesIsNoDrift",
    "test_gpu_codelets": "-*/8:*/9:*/1?",
    "test_judged_part": "-*TakesTheMemory*",
    "test_pattern_lanes": "-*TheSameBits:*AllOptions",
    "test_raw_frames": "-*CleanSets:*JumpsInOneFrame*:*NoiseThatIsShared",
    "test_sensor": "-SensorLanes.TheSameBitsAsTheKernelOfOtherDevices",
    "test_work_groups": "-*EveryCandidateMakes*:*MeasuresEveryShape*",
}
# The mathematics of the diagnosis, which takes half the time and meets no input but numbers. Its C API, files and
# reports are not among them.
FOR_THE_NIGHT = {"inference", "measure", "run", "simulator", "statistics"}


def is_for_the_night(program: str) -> bool:
    source = next((ROOT / "tests").rglob(f"{program.partition('-')[0]}.c*"))
    return (
        source.parent.parent.name == "diagnosis"
        and source.parent.name in FOR_THE_NIGHT
        and not program.endswith("_api")
    )


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
    # Ninja: make would build the targets one after the other.
    done = run("cmake", "-G", "Ninja", "-S", ROOT, "-B", build, f"-DCLSP_SANITIZE={sanitizers}",
               "-DCMAKE_BUILD_TYPE=None", "-DCMAKE_UNITY_BUILD=ON",
               "-DCMAKE_C_FLAGS=-O0 -g1", "-DCMAKE_CXX_FLAGS=-O0 -g1", f"-DCMAKE_C_COMPILER={CC}",
               f"-DCMAKE_CXX_COMPILER={CXX}", "-DCLSP_BUILD_TOOLS=ON", "-DCLSP_BUILD_EXAMPLES=OFF",
               "-DCLSP_BUILD_BENCH=OFF", "-DCLSP_BUILD_TESTS=ON")  # fmt: skip
    assert done.returncode == 0, done.stdout
    done = run("cmake", "--build", build, "--parallel", "2", "--target", *targets)
    assert done.returncode == 0, done.stdout[-20000:]
    return build


ADDRESS_OPTIONS = {
    # clFFT 2.12.2 deletes its actions through a base class without a virtual destructor; that check cannot be turned
    # off for one library alone. intercept_tls_get_addr: the runtime of Clang 14 takes a block of thread-local storage
    # at an address of 16 modulo 4096 for one of glibc 2.19, reads its place from a header that glibc 2.25 dropped, and
    # LeakSanitizer then crashes on it ("Tracer caught signal 11", github.com/google/sanitizers/issues/1322). What such
    # blocks point to is found without it: glibc has them from malloc().
    "ASAN_OPTIONS": "detect_leaks=1:abort_on_error=0:exitcode=99:new_delete_type_mismatch=0:intercept_tls_get_addr=0",
    "UBSAN_OPTIONS": "print_stacktrace=1:halt_on_error=1:exitcode=99",
}


def run_sanitized(build: Path, name: str) -> Done:
    variables = dict(ADDRESS_OPTIONS)
    program, _, engine = name.partition("-")
    if engine:
        variables["CLSPECKLE_FFT"] = engine
    if engine or program in USERS_OF_CLFFT:
        variables["LSAN_OPTIONS"] = f"suppressions={HERE / 'leaks.supp'}:print_suppressions=0"
    if program == "test_no_platform":
        variables["OCL_ICD_VENDORS"] = variables["OPENCL_VENDOR_PATH"] = str(build / "tests" / "no_platform")
    chosen = [f"--gtest_filter={FILTERS[program]}"] if program in FILTERS else []
    done = run(build / "bin" / program, *chosen, **variables)
    # PoCL 3.1 loses the passes of its compiler at the end of a process that compiled with them, and no name in the
    # stack tells that from an OpenCL object that clSpeckle lost. The kernels are in PoCL's cache now: what is lost once
    # more was not PoCL's.
    if re.search(r"SUMMARY: AddressSanitizer: \d+ byte\(s\) leaked", done.stdout):
        done = run(build / "bin" / program, *chosen, **variables)
    return done


@pytest.fixture(scope="session")
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(2) as workers:
        yield workers
        workers.shutdown(cancel_futures=True)


@pytest.fixture(scope="session")
def all_stages_run(pool: ThreadPoolExecutor) -> Future[tuple[Done, str]]:
    return pool.submit(oclgrind)


@pytest.fixture(scope="session")
def sanitized_runs(request: pytest.FixtureRequest, pool: ThreadPoolExecutor) -> dict[str, Future[Done]]:
    """The programs of the tests that were selected, on their way, in the order of the tests; the longest run of all
    before them."""
    if any("watched" in item.fixturenames for item in request.session.items):
        request.getfixturevalue("all_stages_run")
    selected = [
        item.callspec.params["program"]
        for item in request.session.items
        if item.originalname == "test_address_and_undefined"
    ]
    build = sanitized_build(
        "sanitizers/address", "address,undefined", sorted({name.partition("-")[0] for name in selected})
    )
    return {program: pool.submit(run_sanitized, build, program) for program in selected}


@pytest.mark.parametrize(
    "program", [pytest.param(name, marks=[pytest.mark.nightly] if is_for_the_night(name) else []) for name in RUNS]
)
def test_address_and_undefined(sanitized_runs: dict[str, Future[Done]], program: str) -> None:
    done = sanitized_runs[program].result()
    assert done.returncode == 0, done.stdout[-20000:]
    assert "ERROR: AddressSanitizer" not in done.stdout
    assert "runtime error:" not in done.stdout


def test_every_program_is_sanitized() -> None:
    assert set(EXCLUDED) < set(GTEST_PROGRAMS)
    assert set(FILTERS) < set(PROGRAMS)
    assert USERS_OF_CLFFT < set(PROGRAMS)
    assert {*PROGRAMS, *EXCLUDED} == {*GTEST_PROGRAMS, *MORE}


@pytest.mark.parametrize("fault", ["overflow", "leak", "undefined"])
def test_sanitizers_see_faults(fault: str, tmp_path: Path) -> None:
    """The options above end a faulty program with an error."""
    source = tmp_path / "fault.cpp"
    source.write_text(
        "#include <cstring>\n#include <cstdlib>\nint *volatile kept;\n"
        "int main(int argc, char **argv) {\n"
        '    if (!std::strcmp(argv[1], "overflow")) { kept = new int[4]; kept[argc + 2] = 1; }\n'
        '    if (!std::strcmp(argv[1], "leak")) { kept = new int[4]; kept = nullptr; }\n'
        '    if (!std::strcmp(argv[1], "undefined"))\n'
        "    { int volatile top = 0x7fffffff; const int sum = top + argc; top = sum; }\n"
        "    return 0;\n}\n"
    )
    program = tmp_path / "fault"
    done = run(CXX, "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", source, "-o", program)
    assert done.returncode == 0, done.stdout
    assert run(program, "none", **ADDRESS_OPTIONS).returncode == 0
    arguments = [fault, "x"] if fault == "overflow" else [fault]
    assert run(program, *arguments, **ADDRESS_OPTIONS).returncode != 0


# What is shared by threads, and by the driver's own: the engines that run, and arguments.
THREADED: dict[str, tuple[tuple[str, ...], list[str]]] = {
    "test_concurrency": (("auto", "clfft", "gpu"), []),
    # Workers side by side, and a whole diagnosis in them.
    "test_attribution": (("auto", "clfft"), ["--gtest_filter=Workers*:OpenTasks*:Memo*:ReplicateRunner*"]),
    "test_diagnose": (
        ("auto", "clfft"),
        ["--gtest_filter=Diagnosis.SameSeedSameReport:Diagnosis.CanBeCancelled"],
    ),
    "test_aperture": (("gpu",), []),
    "test_launch_guard": (("auto",), []),
    # The kernel of that test is still with PoCL's compiler when the process ends.
    "test_runtime": (("auto",), ["--gtest_filter=-Programs.BrokenKernelGivesTheBuildLog"]),
    "test_safety": (("auto",), []),
}


@pytest.fixture(scope="session")
def threaded_build() -> Path:
    return sanitized_build("sanitizers/thread", "thread", [*THREADED])


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("program", "engine"), [(program, engine) for program, (engines, _) in THREADED.items() for engine in engines]
)
def test_threads(threaded_build: Path, program: str, engine: str) -> None:
    done = run(
        threaded_build / "bin" / program,
        *THREADED[program][1],
        TSAN_OPTIONS=f"suppressions={HERE / 'threads.supp'}:exitcode=99",
        CLSPECKLE_FFT=engine,
    )
    assert done.returncode == 0, done.stdout[-20000:]


# What oclgrind says of a fault: a line that tells it, then where it was.
FAULT = re.compile(r"^(.*)\n\t(?:Kernel|Function): *(.*)$", re.MULTILINE)


def oclgrind(*arguments: str, **variables: str) -> tuple[Done, str]:
    """Runs all_stages on oclgrind's simulated device; the errors that it found."""
    # The instruction counts name the kernels that ran. No --log: that file is written when the last context goes, and
    # clFFT keeps its own.
    options = ("--check-api", "--data-races", "--inst-counts")
    done = run("oclgrind", *options, BIN / "all_stages", *arguments, CLSPECKLE_DEVICE="oclgrind", **variables)
    return done, "\n".join(f"{what} ({where})" for what, where in FAULT.findall(done.stdout))


@pytest.fixture(scope="session")
def watched(all_stages_run: Future[tuple[Done, str]]) -> tuple[Done, str]:
    return all_stages_run.result()


def test_every_kernel_under_oclgrind(watched: tuple[Done, str]) -> None:
    done, errors = watched
    assert done.returncode == 0, done.stdout[-20000:]
    assert "device: Oclgrind Simulator" in done.stdout
    assert "all stages ran" in done.stdout
    assert errors == ""


def test_every_kernel_ran(watched: tuple[Done, str]) -> None:
    """A kernel that all_stages.cpp does not reach is not checked."""
    log = watched[0].stdout
    ran = set(re.findall(r"Instructions executed for kernel '(\w+)'", log))
    kernels = set()
    for path in (ROOT / "kernels").rglob("*.cl"):
        kernels |= set(re.findall(r"__kernel\s+(?:WORK_GROUP_SIZE\s+)?void\s+(\w+)", path.read_text()))
    assert kernels
    assert not kernels - ran, f"all_stages.cpp does not run {sorted(kernels - ran)}"


WRITE = "to = blocks + blocks_offset + 4 * i;"
FAULTS = {
    "a write beside the buffer": ("to = blocks + blocks_offset + 4 * i + 4096;", "Invalid write"),
    "a race between work-items": ("to = blocks + blocks_offset + 4 * (i / 2);", "race"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_oclgrind_sees_faults(fault: str, tmp_path: Path) -> None:
    source = (ROOT / "kernels" / "stages" / "philox.cl").read_text()
    assert source.count(WRITE) == 1
    faulty, found = FAULTS[fault]
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "philox.cl").write_text(source.replace(WRITE, faulty))
    done, errors = oclgrind("philox", CLSPECKLE_KERNEL_DIR=str(tmp_path))
    assert found in errors, f"{fault} goes unseen: {errors[-2000:]}{done.stdout[-2000:]}"
