"""Variables of the environment count for nothing in a process that has more rights than who started it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
BUILD = Path(os.environ.get("CLSPECKLE_BUILD_DIR", ROOT / "build"))
MORE_RIGHTS = BUILD / "lib" / "libmore_rights.so"
# Each is refused where it counts.
WRONG = {
    "CLSPECKLE_KERNEL_DIR": "kernel_dir",
    "CLSPECKLE_DISK_CACHE": "CLSPECKLE_DISK_CACHE is",
    "CLSPECKLE_DEVICE": "no-such-thing",
    "CLSPECKLE_FFT": "CLSPECKLE_FFT",
}
SCRIPT = """
import clspeckle
with clspeckle.Context() as context:
    clspeckle.Aperture((64, 64), relative_diameter=0.5, context=context).info
"""


def run(python: str, variables: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [python, "-c", SCRIPT], env={**os.environ, **variables}, capture_output=True, check=False, text=True
    )


@pytest.mark.parametrize("name", WRONG)
def test_variables_are_not_read_with_more_rights(name: str) -> None:
    plain = run(sys.executable, {name: "no-such-thing"})
    assert plain.returncode == 1
    assert WRONG[name] in plain.stderr
    assert MORE_RIGHTS.is_file()
    secure = run(sys.executable, {name: "no-such-thing", "LD_PRELOAD": str(MORE_RIGHTS)})
    assert secure.returncode == 0, secure.stderr


def test_a_platform_without_devices_says_why(tmp_path: Path) -> None:
    """PoCL has no device where it cannot write its cache, and tells OpenCL nothing of it."""
    script = SCRIPT.replace("Context()", 'Context("Portable")')
    caches = ("XDG_CACHE_HOME", "POCL_CACHE_DIR")
    others = {name: value for name, value in os.environ.items() if name not in caches}

    def of_pocl(variables: dict[str, str]) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", script],
            env={**others, "HOME": "/proc/nowhere", **variables},
            capture_output=True,
            check=False,
            text=True,
        )

    refused = of_pocl({})
    assert refused.returncode == 1
    assert "Portable Computing Language" in refused.stderr
    named = re.findall(r"[A-Z_]*(?:HOME|CACHE_DIR)", refused.stderr.split("PoCL offers no device")[1])
    assert named == ["POCL_CACHE_DIR", "XDG_CACHE_HOME", "HOME"]
    for name in named:
        followed = of_pocl({name: str(tmp_path)})
        assert followed.returncode == 0, followed.stderr


def test_no_source_reads_them_otherwise() -> None:
    sources = [path for top in ("io", "core", "diagnosis", "capi", "tools") for path in (ROOT / top).rglob("*.[ch]pp")]
    assert len(sources) > 300
    reads = [path.name for path in sources if re.search(r"(?<!secure_)getenv\s*\(", path.read_text())]
    assert reads == []
    # All of them at once: behind a look at AT_SECURE.
    environ = [path.name for path in sources if re.search(r"\benviron\b", path.read_text())]
    assert environ == ["context.cpp"]
    assert "AT_SECURE" in (ROOT / "core" / "runtime" / "context.cpp").read_text()


IN_ORDER_ONLY = """
import clspeckle
try:
    clspeckle.Queue(out_of_order=True)
except clspeckle.errors.UnsupportedError as error:
    assert "the device has no out-of-order queues; make an in-order one" in str(error)
else:
    raise SystemExit("a queue out of order was made")
clspeckle.Queue().finish()
"""


def test_a_device_without_queues_out_of_order_says_so() -> None:
    preload = {"LD_PRELOAD": str(BUILD / "lib" / "libin_order.so")}
    done = subprocess.run(
        [sys.executable, "-c", IN_ORDER_ONLY],
        env={**os.environ, **preload},
        capture_output=True,
        check=False,
        text=True,
    )
    assert done.returncode == 0, done.stderr
