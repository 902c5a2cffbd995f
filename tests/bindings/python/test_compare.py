"""clspeckle.compare: captures of three kinds, what a simulator lacks, refusals.

The captures are small and the cause is gross.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from clspeckle import errors

HEIGHT, WIDTH, FRAMES = 48, 64, 8
QUICK: dict[str, Any] = {"null_replicates": 12, "max_effects": 1}


def codes(seed: int, row_dn: float = 0.0, width: int = WIDTH) -> dict[str, npt.NDArray[np.uint16]]:
    """Dark and flat of a camera with black level 64 and read noise 4; its rows jump by row_dn in each frame."""
    random = np.random.default_rng(seed)
    result = {}
    for name, light in (("dark", 0.0), ("flat", 300.0)):
        rows = row_dn * random.normal(size=(FRAMES, HEIGHT, 1))
        signal = 64 + light + rows + random.normal(0, 4, (FRAMES, HEIGHT, width))
        result[name] = np.clip(np.rint(signal), 0, 1023).astype(np.uint16)
    return result


def test_what_a_simulator_lacks(context: clspeckle.Context, tmp_path: Path) -> None:
    real, sim = codes(1, 3.0), codes(2)
    told: list[float] = []

    def report(what: str, fraction: float) -> None:
        assert what
        told.append(fraction)

    found = clspeckle.compare(real, sim, progress=report, context=context, **QUICK)
    assert told == sorted(told)
    assert found.detected
    assert found.ranking[0].effect == "row_noise"
    assert found.quantities == (), "both sets are brought to one light and noise first"
    assert found.ranking[0].parameters["sigma_dn"] == pytest.approx(3.0, abs=0.6)
    assert found.shrink.fraction > 0.5
    compared = found.report["compare"]
    assert [(pair["real"], pair["sim"]) for pair in compared["pairs"]] == [("dark", "dark"), ("flat", "flat")]
    assert "defocus" in [entry["effect"] for entry in compared["cannot_be_applied"]]
    # Captures, folders and dicts mixed give the same report.
    clspeckle.Capture.from_arrays(real).write(tmp_path / "real")
    with clspeckle.Capture.from_arrays(sim) as opened:
        again = clspeckle.compare(tmp_path / "real", opened, context=context, **QUICK)
        opened.write(tmp_path / "sim")  # still open
    assert again.report == found.report
    page = tmp_path / "report.html"
    found.write_html(page)
    assert "What was compared" in page.read_text(encoding="utf-8")


def test_equal_sets(context: clspeckle.Context) -> None:
    found = clspeckle.compare(codes(1), codes(2), context=context, evidence=False, **QUICK)
    assert found.verdict == "none"
    assert found.effects == ()


def test_bad_arguments(context: clspeckle.Context, tmp_path: Path) -> None:
    good = codes(1)
    with pytest.raises(errors.InvalidArgumentError, match="64 x 48 pixels, those of the simulated set 72 x 48"):
        clspeckle.compare(good, codes(1, width=72), context=context)
    with pytest.raises(errors.InvalidArgumentError, match="no sequence of the real set has a partner"):
        clspeckle.compare({"dark": good["dark"]}, {"flat": good["flat"]}, context=context)
    with pytest.raises(errors.ClspeckleError, match="missing"):
        clspeckle.compare(good, tmp_path / "missing", context=context)
    with pytest.raises(errors.InvalidArgumentError, match="defokus"):
        clspeckle.compare(good, good, without=["defokus"], context=context)
    with pytest.raises(TypeError, match="capture must be"):
        clspeckle.compare(good, 3, context=context)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="camera belongs"):
        clspeckle.compare(tmp_path, tmp_path, camera={"bits": 10}, context=context)
    with pytest.raises(errors.CancelledError):
        clspeckle.compare(good, good, progress=lambda _what, _fraction: False, context=context)
