"""A sequence that is two scenes, one after the other: its halves are alike, its frames are not. Never without a gap."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from diagnosed import diagnosed
from gap_check.camera import draw_camera
from gap_check.generator import write_capture

ROOT = Path(__file__).resolve().parents[3]
PROGRAM = Path(os.environ.get("CLSPECKLE_CLI", ROOT / "build" / "bin" / "clspeckle"))
FRAMES = 16


@pytest.mark.parametrize("change", ["none", "speckle", "level"])
def test_a_scene_that_changes_half_way_is_a_gap(tmp_path: Path, change: str) -> None:
    camera = draw_camera(901, 96, 80)
    one, other = tmp_path / "one", tmp_path / "other"
    write_capture(one, camera, {}, FRAMES, 91)
    path = one / "board_static.npy"
    codes = np.load(path)
    half = FRAMES // 2
    if change == "speckle":
        write_capture(other, camera, {}, FRAMES, 92)
        codes[half:] = np.load(other / "board_static.npy")[half:]
    elif change == "level":
        codes[half:] = np.clip(np.rint(64 + 0.6 * (codes[half:].astype(float) - 64)), 0, 1023)
    np.save(path, codes)
    report = diagnosed(one)
    changes = report["gap"]["frame_changes"]
    if change == "none":
        assert changes == []
        assert report["cause"]["verdict"] == "none"
        return
    assert [c["sequence"] for c in changes] == ["board_static"]
    assert f"at frame {half}:" in changes[0]["text"]
    assert report["gap"]["detected"] and report["gap"]["p_value"] <= 1e-6
    assert report["cause"]["verdict"] == "unknown" and report["shrink"]["residual_detected"]
    rungs = {rung["rung"]: rung for rung in report["cause"]["rungs"]}
    assert rungs["board"]["verdict"] == "unknown" and rungs["board"]["residual_p_value"] <= 1e-6
    assert rungs["dark"]["verdict"] == "none"


@pytest.mark.parametrize("scene", ["dark", "board_static"])
def test_noise_that_doubles_half_way_is_a_gap(tmp_path: Path, scene: str) -> None:
    """Halves with as much noise as each other have statistics that one camera could have; frames tell."""
    folder = tmp_path / "set"
    write_capture(folder, draw_camera(904, 96, 80), {}, FRAMES, 97)
    codes = np.load(folder / f"{scene}.npy").astype(float)
    half = FRAMES // 2
    codes[half:] += np.random.default_rng(98).normal(0, 8 if scene == "dark" else 12, codes[half:].shape)
    np.save(folder / f"{scene}.npy", np.clip(np.rint(codes), 0, 1023).astype(np.uint16))
    described = json.loads((folder / "capture.json").read_text())
    described["sequences"] = [s for s in described["sequences"] if s["name"] in ("dark", scene)]
    (folder / "capture.json").write_text(json.dumps(described))
    report = diagnosed(folder)
    [change] = report["gap"]["frame_changes"]
    assert change["sequence"] == scene
    assert "the noise steps from" in change["text"] and f"at frame {half}:" in change["text"]
    assert report["gap"]["detected"] and report["gap"]["p_value"] <= 1e-6
    assert report["cause"]["verdict"] == "unknown"
    rungs = {rung["rung"]: rung["verdict"] for rung in report["cause"]["rungs"]}
    assert rungs["dark" if scene == "dark" else "board"] == "unknown"


@pytest.mark.parametrize("change", ["drift", "step"])
def test_a_lamp_drifts_in_a_lab_and_steps_in_none(tmp_path: Path, change: str) -> None:
    """Both by 20 % of the light: a drift is calibrated and told, a step is another scene."""
    folder = tmp_path / "set"
    write_capture(folder, draw_camera(903, 96, 80), {}, FRAMES, 95)
    codes = np.load(folder / "flat.npy")
    times = np.arange(FRAMES)
    factors = 1 - 0.2 * (times / (FRAMES - 1) if change == "drift" else times >= FRAMES // 2)
    dark = np.load(folder / "dark.npy").astype(float)
    deviation = np.sqrt(dark.var(axis=0, ddof=1).mean() - 1 / 12)  # rounding comes again
    noise = np.random.default_rng(96).normal(0, deviation, codes.shape)
    signal = (codes.mean() - dark.mean()) * factors[:, None, None]
    codes = np.clip(np.rint(dark.mean() + signal + noise), 0, 1023).astype(np.uint16)
    np.save(folder / "flat.npy", codes)
    report = diagnosed(folder)
    drifts = [d["sequence"] for d in report["calibration"]["illumination"]["lamp_drifts"]]
    if change == "drift":
        assert drifts == ["flat"] and report["gap"]["frame_changes"] == []
        assert report["cause"]["verdict"] == "none"
    else:
        assert drifts == [] and [c["sequence"] for c in report["gap"]["frame_changes"]] == ["flat"]
        assert report["cause"]["verdict"] == "unknown"


def test_a_comparison_tells_which_set_changes(tmp_path: Path) -> None:
    camera = draw_camera(902, 96, 80)
    steady, stepping = tmp_path / "steady", tmp_path / "stepping"
    write_capture(steady, camera, {}, FRAMES, 93)
    write_capture(stepping, camera, {}, FRAMES, 93)
    codes = np.load(stepping / "board_static.npy")
    codes[FRAMES // 2 :] = np.clip(np.rint(64 + 0.6 * (codes[FRAMES // 2 :].astype(float) - 64)), 0, 1023)
    np.save(stepping / "board_static.npy", codes)
    for real, sim, of_sim in ((steady, stepping, True), (stepping, steady, False)):
        command = [str(PROGRAM), "gap", "compare", str(real), str(sim), "--json", str(tmp_path / "r.json"), "--quiet"]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        report = json.loads((tmp_path / "r.json").read_text())
        assert report["cause"]["verdict"] == "unknown"
        [change] = report["gap"]["frame_changes"]
        assert change["sequence"] == "board_static" and "the level steps" in change["text"]
        assert change["text"].startswith("of the simulator") == of_sim
