"""The statistics of captures against float64 NumPy, through the program gap_statistics_dump.

The frames are made here: what a camera records of flat light, speckle and dots, with a few defects, so that no
statistic is near its value for nothing. Every value but those of the dots' shape, which test_gap_statistics.cpp checks
on dots of known shape, is found twice.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import png
import pytest
from numpy.typing import NDArray

from reference import gap_statistics as reference

DUMP = Path(os.environ["CLSPECKLE_BIN"]) / "gap_statistics_dump"
PRACTICE = Path(os.environ.get("CLSPECKLE_TEST_DATA", "none")) / "practice"
HEIGHT, WIDTH, FRAMES, BITS = 66, 92, 9, 10
BLACK, READ = 64.3, 4.0
F_NUMBER, PITCH_UM, WAVELENGTH_NM = 6.3, 2.9, 940.0
SCENES = {
    "dark": ("dark", False),
    "flat": ("flat", False),
    "board_static": ("board", False),
    "board_moving": ("board", True),
    "dots_static": ("dots", False),
    "dots_moving": ("dots", True),
}
POSITIONS = [
    [9.2 + 14.8 * i + 0.9 * np.sin(i + 2 * j), 8.7 + 15.1 * j + 0.9 * np.cos(3 * i + j)]
    for j in range(4)
    for i in range(6)
]


def cutoff(f_number: float = F_NUMBER) -> float:
    return PITCH_UM * 1e-6 / (WAVELENGTH_NM * 1e-9 * f_number)


def speckle(rng: np.random.Generator, ideal: NDArray[np.float64]) -> NDArray[np.float64]:
    fy, fx = np.fft.fftfreq(HEIGHT)[:, None], np.fft.fftfreq(WIDTH)[None]
    pupil = (np.hypot(fx, fy) < cutoff() / 2).astype(np.float64)
    z = rng.standard_normal((HEIGHT, WIDTH)) + 1j * rng.standard_normal((HEIGHT, WIDTH))
    field = np.fft.ifft2(np.fft.fft2(np.sqrt(ideal / 2) * z) * pupil / np.sqrt((pupil**2).mean()))
    return np.abs(field) ** 2


def make_codes(scene: str, moving: bool, seed: int) -> NDArray[np.uint16]:
    """Frames with vignetting, a mosaic, shot, row and pixel noise, column offsets, hot pixels and a flicker of the
    light."""
    rng = np.random.default_rng(seed)
    ys, xs = np.mgrid[:HEIGHT, :WIDTH]
    ideal = np.zeros((HEIGHT, WIDTH)) if scene == "dark" else np.ones((HEIGHT, WIDTH))
    if scene == "dots":
        ideal = sum(np.exp(-((xs - x) ** 2 + (ys - y) ** 2) / (2 * 2.2**2)) for x, y in POSITIONS)
    falloff = 1 - 0.3 * ((xs / (WIDTH - 1) - 0.5) ** 2 + (ys / (HEIGHT - 1) - 0.4) ** 2)
    gain = (
        {"dark": 0.0, "flat": 390.0, "board": 130.0, "dots": 290.0}[scene] * falloff * (1 + 0.01 * (-1.0) ** (xs + ys))
    )
    columns = rng.normal(0, 0.7, WIDTH)
    hot = 90.0 * (rng.random((HEIGHT, WIDTH)) < 0.002)
    wave = 1.2 * np.sin(2 * np.pi * (0.1337 * xs - 0.291 * ys) + 1.0)
    light = speckle(rng, ideal) if scene in ("board", "dots") else ideal
    frames = []
    for _ in range(FRAMES):
        if moving:
            light = speckle(rng, ideal)
        signal = gain * light * (1 + 0.02 * rng.standard_normal())
        noise = np.sqrt(READ**2 + 0.1 * signal) * rng.standard_normal(signal.shape) + rng.normal(0, 0.6, (HEIGHT, 1))
        frames.append(np.rint(signal + BLACK + columns + wave + hot + noise))
    return np.clip(np.array(frames), 0, 2**BITS - 1).astype(np.uint16)


def make_mask() -> NDArray[np.bool_]:
    mask = np.random.default_rng(3).random((HEIGHT, WIDTH)) > 0.05
    mask[20:31, 40:52] = False
    mask[:, 77] = False
    return mask


def write_capture(folder: Path, codes: dict[str, NDArray[np.uint16]], mask: NDArray[np.bool_] | None) -> None:
    sequences = []
    for name, stack in codes.items():
        np.save(folder / f"{name}.npy", stack)
        scene, moving = SCENES[name]
        entry = {"name": name, "file": f"{name}.npy", "scene": scene, "motion": "moving" if moving else "static"}
        sequences.append(entry | ({"mask": "mask.png"} if mask is not None else {}))
    if mask is not None:
        with (folder / "mask.png").open("wb") as file:
            png.Writer(WIDTH, HEIGHT, greyscale=True, bitdepth=8).write(file, (255 * mask.astype(np.uint8)).tolist())
    description = {
        "format": "clspeckle-capture",
        "version": 1,
        "camera": {
            "width": WIDTH,
            "height": HEIGHT,
            "bits": BITS,
            "pixel_pitch_um": PITCH_UM,
            "f_number": F_NUMBER,
            "black_level_dn": BLACK,
            "read_noise_dn": READ,
        },
        "laser": {"wavelength_nm": WAVELENGTH_NM, "degree_of_polarization": 1.0},
        "baseline": {"field": "circular_gaussian"},
        "dots": {"sigma_px": 2.2, "positions_px": POSITIONS},
        "sequences": sequences,
    }
    (folder / "capture.json").write_text(json.dumps(description))


def dump(folder: Path, *options: str) -> dict[str, reference.Values]:
    run = subprocess.run([DUMP, folder, *options], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    values: dict[str, reference.Values] = {}
    for line in run.stdout.splitlines():
        sequence, _stage, name, region, _unit, value = line.split(",")
        values.setdefault(sequence, {})[name, region] = float(value)
    return values


def compare(library: reference.Values, expected: reference.Values, measured) -> None:
    missing = sorted(set(expected) - set(library))
    assert not missing, missing
    for key, value in expected.items():
        # The library adds up single precision along rows: errors are a 1e-4 of the value, or 2e-5 of a correlation or
        # moment near 0.
        error = abs(library[key] - value) / max(abs(value), 0.2)
        measured("error over the larger of value and 0.2", error)
        assert error < 1e-4, (key, library[key], value)


@pytest.fixture(scope="module")
def codes() -> dict[str, NDArray[np.uint16]]:
    return {name: make_codes(*scene, seed=index) for index, (name, scene) in enumerate(SCENES.items())}


@pytest.mark.parametrize("masked", [False, True], ids=["whole", "masked"])
def test_values_agree_with_the_reference(codes, masked, tmp_path, measured):
    mask = make_mask() if masked else None
    write_capture(tmp_path, codes, mask)
    library = dump(tmp_path, "--calibration", str(BLACK), str(READ), "--threads", "2")
    whole = np.ones((HEIGHT, WIDTH), bool)
    count = 0
    for name, (scene, moving) in SCENES.items():
        sequence = reference.Sequence(
            codes[name], scene, moving, BLACK, READ, BITS, cutoff(), whole if mask is None else mask
        )
        expected = reference.compute(sequence)
        compare(library[name], expected, measured)
        count += len(expected)
        if scene != "dots":  # what is not compared is known by name
            assert set(library[name]) - set(expected) <= {("fixed_pattern_lines", "all")}
    assert count > 300


def test_masked_codes_do_not_matter(codes, tmp_path):
    mask = make_mask()
    write_capture(tmp_path, codes, mask)
    before = dump(tmp_path)
    changed = {name: np.where(mask, stack, 2**BITS - 1).astype(np.uint16) for name, stack in codes.items()}
    write_capture(tmp_path, changed, mask)
    assert dump(tmp_path) == before


def test_the_black_level_is_no_gap(codes, tmp_path):
    """A black level higher by 7 DN, calibrated, changes nothing that is relative to the light; only what belongs to the
    code itself."""
    write_capture(tmp_path, codes, None)
    before = dump(tmp_path)
    write_capture(
        tmp_path, {name: (stack + 7).clip(max=2**BITS - 1).astype(np.uint16) for name, stack in codes.items()}, None
    )
    after = dump(tmp_path)
    of_codes = ("codes_multiple", "share_above", "bright_end", "histogram")
    for sequence in ("dark", "flat", "dots_moving", "board_moving"):
        for key, value in before[sequence].items():
            if not key[0].startswith(of_codes):
                # The lit frames clip 7 DN earlier: seen in the tails.
                assert after[sequence][key] == pytest.approx(value, rel=0.02, abs=0.02), (sequence, key)


def test_the_light_level_is_no_gap(codes, tmp_path):
    """Twice the light on the flat: fall-off, mosaic and regions stay."""
    write_capture(tmp_path, {"dark": codes["dark"], "flat": codes["flat"]}, None)
    before = dump(tmp_path)["flat"]
    dark = codes["dark"].mean()
    doubled = np.clip(np.rint((codes["flat"] - dark) * 2 + dark), 0, 2**BITS - 1).astype(np.uint16)
    write_capture(tmp_path, {"dark": codes["dark"], "flat": doubled}, None)
    after = dump(tmp_path)["flat"]
    for key in before:
        if key[0] in (
            "gradient_x",
            "gradient_y",
            "radial_falloff",
            "mosaic_checker",
            "region_mean",
            "frame_mean_fluctuation",
        ):
            assert after[key] == pytest.approx(before[key], abs=2e-3), key


def test_practice_sets_agree_with_the_reference(measured):
    """On frames of another generator."""
    if not PRACTICE.is_dir():
        pytest.skip("CLSPECKLE_TEST_DATA names no folder with practice sets")
    for name in ("p01", "p06", "p10"):
        folder = PRACTICE / name
        description = json.loads((folder / "capture.json").read_text())
        camera, laser = description["camera"], description["laser"]
        own_cutoff = camera["pixel_pitch_um"] * 1e3 / (laser["wavelength_nm"] * camera["f_number"])
        black, noise = reference.sequence_level(np.load(folder / "dark.npy"))
        read = np.sqrt(noise**2 - reference.ROUNDING_VARIANCE)
        library = dump(folder)
        for entry in description["sequences"]:
            stack = np.load(folder / entry["file"])
            whole = np.ones(stack.shape[1:], bool)
            sequence = reference.Sequence(
                stack, entry["scene"], entry["motion"] == "moving", black, read, camera["bits"], own_cutoff, whole
            )
            compare(library[entry["name"]], reference.compute(sequence), measured)
