"""What `capture check` says of a set whose description contradicts its codes. Captures are made with NumPy alone."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import numpy.typing as npt
import pytest

import clspeckle

HEIGHT, WIDTH, FRAMES = 48, 64, 6
DOTS = [(x, y) for y in range(6, HEIGHT - 4, 12) for x in range(6, WIDTH - 4, 12)]
SIGMA = 1.8
BLACK, NOISE = 64, 4
Array = npt.NDArray[Any]


def speckle(random: np.random.Generator) -> Array:
    """Intensity of mean 1 behind a round pupil 0.55 cycles per pixel wide."""
    field = random.normal(size=(HEIGHT, WIDTH)) + 1j * random.normal(size=(HEIGHT, WIDTH))
    radius = np.hypot(np.fft.fftfreq(HEIGHT)[:, None], np.fft.fftfreq(WIDTH)[None, :])
    intensity = np.abs(np.fft.ifft2(np.fft.fft2(field) * (radius < 0.275))) ** 2
    return np.asarray(intensity / intensity.mean())


def pattern() -> Array:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(sum(np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * SIGMA**2)) for u, v in DOTS))


@pytest.fixture
def recorded() -> dict[str, Array]:
    """A camera without a fault: six sequences of six frames."""
    random = np.random.default_rng(11)

    def codes(frames: list[Array]) -> Array:
        noisy = np.stack(frames) + BLACK + random.normal(0, NOISE, (FRAMES, HEIGHT, WIDTH))
        return np.clip(np.rint(noisy), 0, 1023).astype(np.uint16)

    still = speckle(random)
    light = {"board": 130 * np.ones((HEIGHT, WIDTH)), "dots": 280 * pattern()}
    result = {
        "dark": codes([np.zeros((HEIGHT, WIDTH))] * FRAMES),
        "flat": codes([np.full((HEIGHT, WIDTH), 400.0)] * FRAMES),
    }
    for scene, ideal in light.items():
        result[f"{scene}_static"] = codes([ideal * still] * FRAMES)
        result[f"{scene}_moving"] = codes([ideal * speckle(random) for _ in range(FRAMES)])
    return result


def warnings(arrays: dict[str, Any], dots: Any = DOTS, sigma: float = SIGMA, **camera: Any) -> list[str]:
    capture = clspeckle.Capture.from_arrays(
        arrays, camera={"black_level_dn": BLACK, "read_noise_dn": NOISE, **camera}, dots_px=dots, dots_sigma_px=sigma
    )
    return [f"{entry['sequence']}: {entry['text']}" for entry in capture.summary()["warnings"]]


def test_a_good_set_has_none(recorded: dict[str, Array]) -> None:
    assert warnings(recorded) == []
    assert warnings({"dark": recorded["dark"]}, dots=None, sigma=None) == []  # type: ignore[arg-type]
    assert warnings({"dots_moving": recorded["dots_moving"][:2]}) == []


@pytest.mark.parametrize("scene", ["board", "dots"])
def test_static_and_moving_exchanged(recorded: dict[str, Array], scene: str) -> None:
    static, moving = f"{scene}_static", f"{scene}_moving"
    recorded[static], recorded[moving] = recorded[moving], recorded[static]
    found = warnings(recorded)
    assert len(found) == 3, found
    assert f'{static}: "motion" is "static", but each frame has speckle of its own' in "\n".join(found)
    assert f'{moving}: "motion" is "moving", but all frames show the same speckle' in "\n".join(found)
    assert f"{static} and {moving} look as if the files" in found[-1]


def test_effects_of_real_cameras_are_no_contradiction(recorded: dict[str, Array]) -> None:
    """Boiling with a correlation of 6 frames, the strongest of the catalogue, and speckle of low contrast in motion."""
    random = np.random.default_rng(5)
    field = [random.normal(size=(2, HEIGHT, WIDTH))]
    keep = np.exp(-1 / 6)
    for _ in range(FRAMES - 1):
        field.append(keep * field[-1] + np.sqrt(1 - keep**2) * random.normal(size=(2, HEIGHT, WIDTH)))
    boiling = np.stack([BLACK + 130 * (f**2).sum(axis=0) / 2 for f in field]) + random.normal(
        0, NOISE, (FRAMES, HEIGHT, WIDTH)
    )
    recorded["board_static"] = np.clip(np.rint(boiling), 0, 1023).astype(np.uint16)
    pale = np.stack([BLACK + 130 * (0.7 + 0.3 * speckle(random)) for _ in range(FRAMES)])
    pale += random.normal(0, NOISE, pale.shape)
    recorded["board_moving"] = np.clip(np.rint(pale), 0, 1023).astype(np.uint16)
    assert warnings(recorded) == []


@pytest.mark.parametrize(
    ("camera", "words"),
    [
        ({"black_level_dn": 20}, "DN, is far above /camera/black_level_dn, 20.00 DN"),
        ({"black_level_dn": 90}, "far below /camera/black_level_dn, 90.00 DN"),
        ({"read_noise_dn": 100}, "/camera/read_noise_dn is 100, but the dark frames' noise is 3.9"),
        ({"read_noise_dn": 1}, "/camera/read_noise_dn is 1, but the dark frames' noise is 3.9"),
        ({"bits": 16}, "/camera/bits is 16: if the converter has 10 bits, set bits to 10"),
        ({"principal_point_px": (5000, 20)}, "principal_point_px, (5000, 20), lies outside of the image of 64 x 48"),
    ],
    ids=str,
)
def test_the_camera_contradicts_its_frames(recorded: dict[str, Array], camera: dict[str, Any], words: str) -> None:
    found = warnings(recorded, **camera)
    assert len(found) == 1, found
    assert words in found[0]


def test_what_lies_within_the_data_sheets_tolerance_is_none(recorded: dict[str, Array]) -> None:
    assert warnings(recorded, black_level_dn=59, read_noise_dn=5) == []


def test_read_noise_without_dark_frames(recorded: dict[str, Array]) -> None:
    del recorded["dark"]
    found = warnings(recorded, read_noise_dn=20)
    assert [text.partition(":")[0] for text in found] == ["flat", "board_static", "dots_static"]
    assert "less than /camera/read_noise_dn, 20 DN, alone would give" in found[0]


def test_light_is_measured_by_the_dark_frames_noise(recorded: dict[str, Array]) -> None:
    """A quarter of a pixel's noise, 1 DN here, is the least light; a sheet that is far off changes nothing."""
    random = np.random.default_rng(12)

    def lit(light: float) -> Array:
        return np.rint(random.normal(BLACK + light, NOISE, (FRAMES, HEIGHT, WIDTH))).astype(np.uint16)

    def says_so(arrays: dict[str, Any], sheet: float) -> bool:
        found = warnings(arrays, dots=None, sigma=None, read_noise_dn=sheet)  # type: ignore[arg-type]
        return any("there is hardly any light in it" in text for text in found)

    for sheet in (0.0, 1.0, NOISE, 40.0):
        assert says_so({"dark": recorded["dark"], "flat": lit(0.8)}, sheet), sheet
        assert not says_so({"dark": recorded["dark"], "flat": lit(3.0)}, sheet), sheet
    # Without dark frames, or with one alone, the sheet is all there is.
    for dark in ({}, {"dark": recorded["dark"][:1]}):
        assert says_so({**dark, "flat": lit(3.0)}, 40.0)
        assert not says_so({**dark, "flat": lit(3.0)}, NOISE)


def test_codes_in_the_upper_bits(recorded: dict[str, Array]) -> None:
    shifted = {name: codes * 64 for name, codes in recorded.items()}
    found = warnings(shifted, bits=16, black_level_dn=BLACK * 64, read_noise_dn=NOISE * 64)
    assert len(found) == 1
    assert "all codes are multiples of 64: the converter has 10 effective bits" in found[0]
    assert "divide the codes by 64), bits to 10" in found[0]
    recorded["flat"] = recorded["flat"] // 16 * 16
    assert warnings(recorded) == ["flat: all codes are multiples of 16: the converter has 6 effective bits"]


def test_dots_that_cannot_be(recorded: dict[str, Array]) -> None:
    assert any("neighbouring dots are 12 px apart, so that they merge" in text for text in warnings(recorded, sigma=30))
    between = [(x + 6, y + 6) for x, y in DOTS]
    found = [
        text for text in warnings(recorded, dots=between) if "the light is not where /dots/positions_px says" in text
    ]
    assert [text.partition(":")[0] for text in found] == ["dots_static", "dots_moving"]


def test_dots_at_the_border(recorded: dict[str, Array]) -> None:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    beyond = [(u, v) for v in range(6, HEIGHT - 4, 12) for u in (-2, WIDTH + 1)]
    light = 280 * sum(np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * SIGMA**2)) for u, v in beyond)
    for name in ("dots_static", "dots_moving"):
        recorded[name] = np.rint(recorded[name] + light).astype(np.uint16)
    found = warnings(recorded)
    assert [text.partition(":")[0] for text in found] == ["dots_static", "dots_moving"]
    assert all("List all dots whose light reaches the image" in text for text in found)
    assert warnings(recorded, dots=[*DOTS, *beyond]) == []
    far = [*DOTS, *beyond, (-20, 10)]
    assert "1 of 29 dots lie so far outside" in "".join(warnings(recorded, dots=far))


@pytest.mark.parametrize("gain", [0.1, 2.0])
def test_dim_flats_are_no_boards(gain: float) -> None:
    """Noise of 2 DN and that of few electrons is more than such light; speckle of it is still told."""
    random = np.random.default_rng(12)

    def codes(light: Array | float, read: float = 2.0) -> Array:
        electrons = random.poisson(np.broadcast_to(np.asarray(light) / gain, (16, HEIGHT, WIDTH)))
        return np.clip(np.rint(BLACK + gain * electrons + random.normal(0, read, electrons.shape)), 0, 1023).astype(
            np.uint16
        )

    dark = codes(0.0)
    for level in (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0):
        found = warnings({"dark": dark, "flat": codes(level)}, dots=None, sigma=None, read_noise_dn=2.0)  # type: ignore[arg-type]
        assert not [text for text in found if "contrast" in text], level
    moving = [speckle(random) for _ in range(16)]
    for light in (10 * speckle(random), 100 * speckle(random), 100 * np.stack(moving)):
        found = warnings({"dark": dark, "flat": codes(light)}, dots=None, sigma=None, read_noise_dn=2.0)  # type: ignore[arg-type]
        assert [text for text in found if "Is it a board or dots in laser light?" in text]


def test_scenes_exchanged(recorded: dict[str, Array]) -> None:
    recorded["flat"], recorded["board_moving"] = recorded["board_moving"], recorded["flat"]
    found = "\n".join(warnings(recorded))
    assert "flat: its contrast is" in found
    assert "board_moving: its contrast is 0.0" in found


def test_exposures_exchanged(recorded: dict[str, Array]) -> None:
    flat = recorded.pop("flat")
    made = {
        **recorded,
        "flat_1": clspeckle.CaptureSequence(flat, scene="flat", exposure_ms=20),
        "flat_2": clspeckle.CaptureSequence(BLACK + (flat - BLACK) * 2, scene="flat", exposure_ms=10),
    }
    found = [text for text in warnings(made) if "multiples of 2" not in text]  # twice the codes
    assert len(found) == 1
    assert "flat_1: was exposed for 20 ms, longer than flat_2 with 10 ms, but is darker" in found[0]


def test_motion_of_what_cannot_move(recorded: dict[str, Array]) -> None:
    made = {**recorded, "dark": clspeckle.CaptureSequence(recorded["dark"], scene="dark", motion="moving")}
    assert warnings(made) == ['dark: "motion" is "moving", but the dark shows no motion; it is taken as static']


def test_saturated_and_masked(recorded: dict[str, Array]) -> None:
    recorded["board_moving"] = np.clip(recorded["board_moving"].astype(int) * 10, 0, 1023).astype(np.uint16)
    assert any(
        "board_moving: " in text and "at the top code, 1023: the sequence is saturated" in text
        for text in warnings(recorded)
    )
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[:2] = 1
    masked = {**recorded, "board_moving": clspeckle.CaptureSequence(recorded["board_static"], scene="board", mask=mask)}
    assert any("its mask leaves 4.2 % of the pixels" in text for text in warnings(masked))


def test_bytes_behind_an_array(
    cli: Callable[..., subprocess.CompletedProcess[str]], recorded: dict[str, Array], tmp_path: Path
) -> None:
    clspeckle.Capture.from_arrays(recorded, dots_px=DOTS, dots_sigma_px=SIGMA).write(tmp_path / "set")
    with (tmp_path / "set" / "flat.npy").open("ab") as file:
        np.save(file, recorded["flat"])  # a second array: only the first one is read
    shown = cli("capture", "check", "set").stderr
    size = recorded["flat"].nbytes + 128
    assert f"flat: set/flat.npy: {size} bytes follow the last image and are not read" in shown
    summary = json.loads(cli("capture", "check", "set", "--json", "-").stdout)
    assert summary["sequences"][1]["frames"] == FRAMES


def test_frames_that_are_missing_in_a_folder(tmp_path: Path, recorded: dict[str, Array]) -> None:
    """One of six PNG files, frame_3.png, was lost: what lies before and after it is no step in time."""
    folder = tmp_path / "set"
    clspeckle.Capture.from_arrays({"flat": recorded["flat"]}).write(folder)
    text = json.loads((folder / "capture.json").read_text())
    text["sequences"][0]["file"] = "flat"
    (folder / "capture.json").write_text(json.dumps(text))
    (folder / "flat").mkdir()
    for number, codes in enumerate(recorded["flat"]):
        iio.imwrite(folder / "flat" / f"frame_{number}.png", codes)
    assert clspeckle.Capture.open(folder).summary()["warnings"] == []
    (folder / "flat" / "frame_3.png").unlink()
    found = clspeckle.Capture.open(folder).summary()["warnings"]
    assert [entry["sequence"] for entry in found] == ["flat"]
    assert "1 of the numbers 0 to 5 is missing, the first one is 3" in found[0]["text"]
