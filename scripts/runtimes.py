#!/usr/bin/env python3
"""Runs the GoogleTest programs on several OpenCL runtimes and says where they agree.

usage: runtimes.py [--runtimes pocl,intel] [--programs test_philox,test_phase] [--limit SECONDS] [--table FILE]

Fetches Intel's CPU runtime from PyPI and Mesa's rusticl from Debian into build/runtimes; neither becomes a driver of
this machine. tests/runtimes/known.txt lists what is known to fail on a runtime, with the reason. Ends with 1 where
anything else fails.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import sysconfig
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KNOWN = ROOT / "tests" / "runtimes" / "known.txt"
# They stand for something else than a device: the absence of one, a driver that fails, the machine's own speed.
NO_TESTS_OF_A_RUNTIME = {"test_no_platform", "test_faults", "test_native_passes"}


class Missing(Exception):
    """The runtime cannot be had on this machine."""


def call(*command: object, folder: Path = ROOT) -> str:
    done = subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise Missing(f"{' '.join(map(str, command[:3]))} ended with {done.returncode}: {done.stdout[-400:].strip()}")
    return done.stdout


def write_vendor(folder: Path, library: Path) -> dict[str, str]:
    """What makes the loader see this driver alone."""
    if not library.exists():
        raise Missing(f"{library} is not there")
    vendors = folder / "vendors"
    vendors.mkdir(parents=True, exist_ok=True)
    (vendors / "driver.icd").write_text(f"{library}\n")
    return {"OCL_ICD_VENDORS": str(vendors), "OPENCL_VENDOR_PATH": str(vendors)}


def pocl(_: Path) -> dict[str, str]:
    return {}


def oclgrind(_: Path) -> dict[str, str]:
    if not shutil.which("oclgrind"):
        raise Missing("the program oclgrind is not there; Debian's package has its name")
    return {"CLSPECKLE_DEVICE": "oclgrind"}


def intel(folder: Path) -> dict[str, str]:
    if not list(folder.rglob("libintelocl.so")):
        call(sys.executable, "-m", "venv", folder)
        call(
            folder / "bin" / "pip",
            "install",
            "-q",
            "--disable-pip-version-check",
            "intel-opencl-rt",
            "intel-cmplr-lib-rt",
        )
    return write_vendor(folder, folder / "lib" / "libintelocl.so")


def rusticl(folder: Path) -> dict[str, str]:
    libraries = folder / "usr" / "lib" / (sysconfig.get_config_var("MULTIARCH") or "")
    driver = libraries / "libRusticlOpenCL.so.1"
    if not driver.exists():
        if not shutil.which("apt-get"):
            raise Missing("mesa-opencl-icd comes from Debian or Ubuntu, and this is neither")
        folder.mkdir(parents=True, exist_ok=True)
        call("apt-get", "-q", "download", "mesa-opencl-icd", folder=folder)
        package = next(folder.glob("mesa-opencl-icd*.deb"))
        needs = [
            name.split("(")[0].split("|")[0].strip() for name in call("dpkg-deb", "-f", package, "Depends").split(",")
        ]
        sudo = [] if os.geteuid() == 0 else ["sudo", "-n"]
        call(*sudo, "apt-get", "-q", "install", "-y", "--no-install-recommends", *needs)
        call("dpkg-deb", "-x", package, folder)
    return write_vendor(folder, driver) | {
        "RUSTICL_ENABLE": "llvmpipe",
        "GALLIUM_PIPE_SEARCH_DIR": str(libraries / "gallium-pipe"),
    }


RUNTIMES = {"pocl": pocl, "oclgrind": oclgrind, "intel": intel, "rusticl": rusticl}
COMMANDS = {"oclgrind": ["oclgrind"]}  # a simulated device, in the process of the program


def environment_of(runtime: str, build: Path) -> dict[str, str]:
    """What a program needs to run on it. Throws Missing."""
    return {"CLSPECKLE_TUNING": "off", "POCL_AFFINITY": "1"} | RUNTIMES[runtime](build / "runtimes" / runtime)


@dataclass
class Known:
    runtime: str
    test: str
    reason: str


def known_failures() -> list[Known]:
    lines = (line.split("#")[0].strip() for line in KNOWN.read_text().splitlines())
    return [Known(*(part.strip() for part in line.split(":", 2))) for line in lines if line]


@dataclass
class Result:
    runtime: str
    device: str = ""
    programs: int = 0
    passed: int = 0
    skipped: int = 0
    known: dict[str, str] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    def row(self) -> str:
        counts = (self.programs, self.passed, self.skipped, len(self.known), len(self.failed))
        return f"| {self.runtime} | {self.device} | {' | '.join(map(str, counts))} |"


def tests_of(report: Path) -> dict[str, str]:
    """ "passed", "failed" or "skipped" by test."""
    result = {}
    for case in ElementTree.parse(report).iter("testcase"):
        name = f"{case.get('classname')}.{case.get('name')}"
        result[name] = (
            "failed"
            if case.find("failure") is not None
            else "skipped"
            if case.find("skipped") is not None
            else "passed"
        )
    return result


def run_programs(runtime: str, build: Path, programs: list[str], limit: float, say=print) -> Result:
    """A program that does not end, or ends by a signal, counts as one failed test of its name."""
    variables = {**os.environ, **environment_of(runtime, build)}
    result = Result(runtime)
    command = COMMANDS.get(runtime, [])
    shown = subprocess.run(
        [*command, build / "bin" / "clspeckle", "devices"], env=variables, capture_output=True, text=True, check=False
    )
    result.device = next(
        (line.split(":", 1)[1].strip() for line in shown.stdout.splitlines() if ": taken" in line), ""
    ).split(": taken")[0]
    result.device = result.device.split("  ")[-1].strip()
    known = [entry for entry in known_failures() if entry.runtime == runtime]
    folder = build / "runtimes" / "results" / runtime
    folder.mkdir(parents=True, exist_ok=True)
    for program in programs:
        report = folder / f"{program}.xml"
        report.unlink(missing_ok=True)
        begin = time.monotonic()
        try:
            done = subprocess.run([*command, build / "bin" / program], env={**variables,
                                                                            "GTEST_OUTPUT": f"xml:{report}"},
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=limit,
                                  check=False)  # fmt: skip
            (folder / f"{program}.log").write_bytes(done.stdout)
            tests = tests_of(report) if report.exists() else {f"{program}: signal {-done.returncode}": "failed"}
        except subprocess.TimeoutExpired as error:
            (folder / f"{program}.log").write_bytes(error.stdout or b"")
            tests = {f"{program}: more than {limit:g} s": "failed"}
        result.programs += 1
        result.passed += list(tests.values()).count("passed")
        result.skipped += list(tests.values()).count("skipped")
        failed = [name for name, how in tests.items() if how == "failed"]
        for name in failed:
            reasons = [entry.reason for entry in known if entry.test in f"{program} {name}"]
            if reasons:
                result.known[name] = reasons[0]
            else:
                result.failed.append(name)
        say(
            f"{runtime}: {program}: {len(tests) - len(failed)} of {len(tests)} in {time.monotonic() - begin:.0f} s "
            f"{' '.join(failed)}"
        )
    return result


def table(results: list[Result]) -> str:
    lines = [
        "| runtime | device | programs | tests passed | skipped | known to fail | fail |",
        "|---|---|--:|--:|--:|--:|--:|",
    ]
    lines += [result.row() for result in results]
    for result in results:
        lines += ["", f"Known of {result.runtime}:", ""] if result.known else []
        lines += [f"- `{name}`: {reason}" for name, reason in sorted(result.known.items())]
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runtimes", default=",".join(RUNTIMES))
    parser.add_argument("--programs", default="", help="all GoogleTest programs if left out")
    parser.add_argument("--limit", type=float, default=900.0, help="seconds for a program")
    parser.add_argument("--build", type=Path, default=ROOT / "build")
    parser.add_argument("--table", type=Path, help="a file for the table; else it is printed")
    arguments = parser.parse_args()
    listed = (arguments.build / "tests" / "gtest_programs.txt").read_text().split()
    programs = arguments.programs.split(",") if arguments.programs else sorted(set(listed) - NO_TESTS_OF_A_RUNTIME)
    results = []
    for runtime in arguments.runtimes.split(","):
        try:
            results.append(
                run_programs(
                    runtime,
                    arguments.build,
                    programs,
                    arguments.limit,
                    lambda line: print(line, file=sys.stderr, flush=True),
                )
            )
        except Missing as missing:
            print(f"{runtime}: cannot be had: {missing}", file=sys.stderr)
            return 1
    text = table(results)
    if arguments.table:
        arguments.table.write_text(text)
    else:
        print(text, end="")
    for result in results:
        for name in result.failed:
            print(f"{result.runtime}: {name} fails", file=sys.stderr)
    return 1 if any(result.failed for result in results) else 0


if __name__ == "__main__":
    sys.exit(main())
