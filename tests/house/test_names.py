"""One concept has one name. Older names stand where they are still read, and in pages of what was."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HISTORY = ("CHANGELOG.md", "docs/results/archive.md", "tests/house/test_names.py")
# The older name, what it is called, and the files that read or explain it.
OLD = {
    r"\bfused\b": ("cpu, gpu: the engines", {
        # Other words.
        "bench/native/butterflies.hpp", "capi/include/clspeckle/doe.h", "docs/method/model.md", "tools/doe_pattern.cpp",
        "core/fft/engine_choices.cpp", "core/fft/engine_spec.cpp", "core/fft/engine_spec.hpp",
        "core/fft/plan/tuning_record.cpp", "docs/guide/runtime.md", "tests/core/stages/engines/test_engines.py",
        "tests/core/tuning/test_tuning.py",
    }),
    r"\bfft_backend": ("fft_engine", {
        "bindings/python/src/clspeckle/_generated.py", "capi/aperture.cpp", "capi/include/clspeckle/aperture.h",
        "docs/guide/runtime.md", "tests/abi/clspeckle.abi", "tests/core/stages/aperture/test_aperture.cpp",
        "tests/core/tuning/test_tuning.cpp",
    }),
    r"first.?look": ("screening", set()),
    r"FftChoice": ("Engine", set()),
    r"kept lines": ("pupil columns", set()),
    r"held points|makeshift": ("points per work-item; over budget", set()),
    r"evidence_measures": ("statistics", set()),
    r"effect_visibility|effect_reach": ("applicability", set()),
    r"go_with_camera|goes_out|kHopeless": ("names that say what they gate", set()),
    r"cross-talk|polarisation|coloured?\b": ("crosstalk, polarization, colored", set()),
}  # fmt: skip


def tracked() -> list[str]:
    done = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=True)
    ends = (".cpp", ".hpp", ".h", ".c", ".cl", ".py", ".md", ".txt", ".abi", ".cmake", ".sh")
    return [name for name in done.stdout.splitlines() if name.endswith(ends) and name not in HISTORY]


@pytest.mark.parametrize("old", OLD)
def test_old_names_are_gone(old: str) -> None:
    name, files = OLD[old]
    found = {path for path in tracked() if re.search(old, (ROOT / path).read_text(errors="replace"), re.IGNORECASE)}
    assert found - files == set(), f"say {name}"
    assert files - found == set(), "no longer there"
