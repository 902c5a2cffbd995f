"""A frame whose kernels do not all build is refused before its first command: the phases stay as they were."""

from __future__ import annotations

from pathlib import Path

import clspeckle
import numpy as np
import pytest

KERNELS = Path(__file__).resolve().parents[3] / "kernels"
SHAPE = (32, 40)
IDEAL = np.ones(SHAPE, np.float32)
MOTION = {"intrinsics": (40.0, 40.0, 19.5, 15.5)}


def moved() -> clspeckle.MotionInput:
    previous_from_current = np.eye(3, 4)
    previous_from_current[2, 3] = 1e-4
    return clspeckle.MotionInput(depth=np.full(SHAPE, 0.5, np.float32), previous_from_current=previous_from_current)


# What carries a phase on: with explicit vectors on CPU devices, and sample by sample.
ADVANCE = ("stages/phase_advance_lanes.cl", "stages/phase.cl")
# The kernel files, what of them does not build, the camera, the first frame and the frame that needs it.
CASES = {
    "airflow, drawn anew": (
        ("stages/field_sample.h",),
        "!SCREEN",
        {"airflow_rms_rad": 0.3},
        {},
        {"refresh": "all"},
    ),
    "blur, the intensity before the sensor": (
        ("fft/cpu/rows_inverse.cl",),
        "!SENSOR",
        {"motion": MOTION, "shutter_fraction": 0.5},
        {"refresh": "all"},
        {"motion": True},
    ),
    "blur of a phase that moves along": (
        ADVANCE,
        "ADVANCE==1 && HAS_PATH==1 && HAS_SHIFT==0",
        {"motion": {**MOTION, "translate": True}, "shutter_fraction": 0.5},
        {"refresh": "all"},
        {"motion": True},
    ),
    "boiling under motion": (
        ADVANCE,
        "ADVANCE==1 && HAS_PATH==1 && BOILS==1",
        {"motion": MOTION, "boiling_correlation_frames": 9.0},
        {"refresh": "all"},
        {"motion": True},
    ),
    "sub-exposures of frames drawn anew": (
        ADVANCE,
        "ADVANCE==1 && BOILS==1",
        {"exposure_path": 1.0},
        {},
        {"refresh": "all"},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_kernel_that_does_not_build_is_found_before_the_first_command(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files, condition, camera, first, second = CASES[case]
    monkeypatch.setenv("CLSPECKLE_FFT", "cpu")
    for file in files:
        text = (KERNELS / file).read_text()
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(f"#if {condition}\n#error broken on purpose\n#endif\n{text}")
    context = clspeckle.Context(kernel_dir=tmp_path)
    pipeline = clspeckle.Pipeline.from_parameters(SHAPE, context=context, relative_diameter=0.5, seed=1, **camera)
    pipeline.render(IDEAL, frame_index=0, **first)
    before = pipeline.phase.save().copy()
    if second.get("motion"):
        second = {**second, "motion": moved()}
    with pytest.raises(clspeckle.errors.BuildError):
        pipeline.render(IDEAL, frame_index=1, **second)
    np.testing.assert_array_equal(before, pipeline.phase.save())
