"""What numbers mean: light that is encoded, units, full scales, negative lobes; and frames that cannot be meant."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms
from test_cli_scene import CAMERA, LASER, PATTERN, albedo, depth, position, rendered, scene

__all__ = ["scene"]

ARGUMENTS = ["-o", "out", *CAMERA, *PATTERN, *LASER]


def light(ok, folder: Path, *arguments: object) -> tuple[np.ndarray, str]:
    """The ideal image that is rendered, and what is said on the way."""
    result = ok("render", *arguments, "-o", "light", "--save-ideal", "--no-preview")
    return np.load(folder / "light" / "ideal_000000.npy"), result.err


def decoded(values: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    values = values.astype(float)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_profile() -> bytes:
    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


ENCODED = {
    "gray.png": lambda path: Image.fromarray(images.gray8()).save(path, icc_profile=srgb_profile()),
    "gray.tif": lambda path: Image.fromarray(images.gray8()).save(path, icc_profile=srgb_profile()),
}


@pytest.mark.parametrize("name", ENCODED)
def test_encoded_light_is_decoded_and_told(ok, tmp_path: Path, name: str) -> None:
    ENCODED[name](tmp_path / name)
    values = images.gray8() / 255
    given, told = light(ok, tmp_path, name)
    np.testing.assert_allclose(given, decoded(values), rtol=1e-5, atol=1e-7)
    assert f"{name}: its numbers are encoded for a screen (sRGB, says its ICC profile)" in told
    assert "--transfer linear" in told
    given, told = light(ok, tmp_path, name, "--transfer", "linear")
    np.testing.assert_array_equal(given, values.astype(np.float32))
    assert "warning" not in told


def test_jpeg_is_decoded(ok, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(images.jpeg())
    given, told = light(ok, tmp_path, "a.jpg")
    np.testing.assert_allclose(given, decoded(images.jpeg_values()), rtol=1e-5, atol=1e-7)
    assert "(sRGB, says the format)" in told


def test_a_file_that_says_nothing_is_linear_unless_told(ok, tmp_path: Path) -> None:
    color = np.random.default_rng(6).integers(0, 256, (images.HEIGHT, images.WIDTH, 3), dtype=np.uint8)
    iio.imwrite(tmp_path / "a.png", color)
    given, told = light(ok, tmp_path, "a.png")
    np.testing.assert_allclose(given, (color / 255).mean(-1), rtol=1e-6)
    assert "encoded" not in told
    given, _ = light(ok, tmp_path, "a.png", "--transfer", "srgb")
    np.testing.assert_allclose(given, decoded(color / 255).mean(-1), rtol=1e-5)  # each color before the mean


def test_albedos_and_patterns_are_light_and_depths_are_not(ok, scene: Path) -> None:
    codes = np.rint(albedo() * 255).astype(np.uint8)
    Image.fromarray(codes).save(scene / "codes.png", icc_profile=srgb_profile())
    np.save(scene / "values.npy", decoded(codes / 255).astype(np.float32))
    Image.fromarray((depth() * 1000).astype(np.uint16)).save(scene / "mm.png", icc_profile=srgb_profile())
    np.save(scene / "m.npy", (depth() * 1000).astype(np.uint16).astype(np.float32) * 0.001)
    given = rendered(ok, scene, "--depth", "mm.png", "--depth-scale", 0.001, "--albedo", "codes.png", *CAMERA)
    expected = rendered(ok, scene, "--depth", "m.npy", "--albedo", "values.npy", *CAMERA)
    assert np.abs(given.astype(int) - expected).max() <= 1
    arguments = [*CAMERA, *LASER, *PATTERN[2:], "--exposure-gain", 30000, "--no-preview", "--format", "npy"]
    for name in ("codes.png", "values.npy"):
        ok("render", "--depth", "z.npy", "--pattern", name, "-o", name + ".out", *arguments)
    frames = [np.load(scene / f"{name}.out" / "frame_000000.npy").astype(int) for name in ("codes.png", "values.npy")]
    assert np.abs(frames[0] - frames[1]).max() <= 1


def test_a_curve_that_is_not_known(ok, tmp_path: Path) -> None:
    curve = b"curv" + bytes(4) + struct.pack(">IHHH", 3, 0, 9000, 65535)
    data = bytes(128) + struct.pack(">I4sII", 1, b"kTRC", 144, len(curve)) + curve
    Image.fromarray(images.gray8()).save(tmp_path / "a.png", icc_profile=struct.pack(">I", len(data)) + data[4:])
    given, told = light(ok, tmp_path, "a.png")
    np.testing.assert_array_equal(given, (images.gray8() / 255).astype(np.float32))
    assert "its ICC profile has a curve that is not known here; the numbers are taken as linear light" in told
    assert "warning" not in light(ok, tmp_path, "a.png", "--transfer", "linear")[1]


# --- depth ---

MM = (depth() * 1000).astype(np.uint16)
INTEGERS = {
    "mm.png": lambda path: iio.imwrite(path, MM),
    "mm.tif": lambda path: tifffile.imwrite(path, MM),
    "u4.tif": lambda path: tifffile.imwrite(path, MM.astype(np.uint32)),
    "i4.npy": lambda path: np.save(path, MM.astype(np.int32)),
    "u2.npy": lambda path: np.save(path, MM),
    "mm.pgm": lambda path: images.pgm(path, MM, 65535),
}


@pytest.mark.parametrize("name", INTEGERS)
def test_integers_are_no_metres(ok, refused, scene: Path, name: str) -> None:
    INTEGERS[name](scene / name)
    np.save(scene / "m.npy", (MM * 0.001).astype(np.float32))
    message = refused("render", "--depth", name, *ARGUMENTS)
    assert f"{name}: depth must be floating-point metres, not " in message
    advice = re.search(r"(--depth-scale) ([\d.]+)", message)
    assert advice
    np.testing.assert_array_equal(
        rendered(ok, scene, "--depth", name, advice[1], advice[2], *CAMERA),
        rendered(ok, scene, "--depth", "m.npy", *CAMERA),
    )


def test_millimetres_as_metres_are_warned_of(ok, scene: Path) -> None:
    np.save(scene / "mm.npy", depth() * 1000)
    images.exr(scene / "mm.exr", {"Z": depth() * 1000})
    expected = rendered(ok, scene, "--depth", "z.npy", *CAMERA)
    for given in (["--depth", "mm.npy"], ["mm.exr"]):
        told = ok("render", *given, *ARGUMENTS, "--no-preview").err
        assert "m away in the median" in told and "--depth-scale 0.001" in told and "the frame has no light" in told
        frame = rendered(ok, scene, *given, "--depth-scale", 0.001, *CAMERA)
        assert np.abs(frame.astype(int) - expected).max() <= 1
    np.save(scene / "pmm.npy", position() * 1000)
    given = rendered(ok, scene, "--position", "pmm.npy", "--depth-scale", 0.001)
    assert np.abs(given.astype(int) - rendered(ok, scene, "--position", "p.npy")).max() <= 1


@pytest.mark.parametrize("background", [0.0, np.inf, np.nan, 65504.0, 1e10])
def test_backgrounds_are_no_surface(ok, scene: Path, background: float) -> None:
    plane = depth()
    plane[:, 30:] = 0
    np.save(scene / "nothing.npy", plane)
    plane[:, 30:] = background
    np.save(scene / "background.npy", plane)
    np.testing.assert_array_equal(
        rendered(ok, scene, "--depth", "background.npy", *CAMERA),
        rendered(ok, scene, "--depth", "nothing.npy", *CAMERA),
    )


@pytest.mark.parametrize(
    ("plane", "words"), [(-depth(), "depths are negative"), (np.full_like(depth(), 1e10), "all depths are 0, infinite")]
)
def test_a_scene_without_surfaces(ok, scene: Path, plane: np.ndarray, words: str) -> None:
    np.save(scene / "none.npy", plane)
    told = ok("render", "--depth", "none.npy", *ARGUMENTS).err
    assert "none.npy: no pixel has a surface: " + words in told and "the frame has no light" in told


# --- full scale ---


@pytest.mark.parametrize("name", ["u2.npy", "i2.npy", "i4.npy", "u4.tif", "u2.png", "u2.tif"])
def test_integers_of_unknown_full_scale(ok, tmp_path: Path, name: str) -> None:
    codes = images.gray10()
    kind = {"u2": np.uint16, "i2": np.int16, "i4": np.int32, "u4": np.uint32}[name[:2]]
    path = tmp_path / name
    (np.save if name.endswith("npy") else iio.imwrite if name.endswith("png") else tifffile.imwrite)(
        path, codes.astype(kind)
    )
    told = light(ok, tmp_path, name)[1]
    advice = re.search(r"(--full-scale) (\d+)", told)
    assert advice and f"{name}: its " in told and "of 10 bits" in told or "have 10 bits" in told
    given, told = light(ok, tmp_path, name, advice[1], advice[2])
    np.testing.assert_array_equal(given, images.scaled(codes, 1023))
    assert "warning" not in told


def test_codes_that_fill_their_type_are_no_question(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", images.gray16())
    np.save(tmp_path / "b.npy", images.gray8())
    for name in ("a.npy", "b.npy"):
        assert "warning" not in light(ok, tmp_path, name)[1]


# --- frames that cannot be meant ---


def test_a_frame_without_light(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "dim.npy", np.full((32, 48), 1e-6, np.float32))
    told = ok("render", "dim.npy", "-o", "out").err
    assert "dim.npy: the frame has no light: the brightest number is 1e-06" in told and "--exposure-gain auto" in told
    assert "warning" not in ok("render", "dim.npy", "-o", "auto", "--exposure-gain", "auto").err
    assert "warning" not in ok("render", "dim.npy", "-o", "dark", "--illumination", "dark").err
    np.save(tmp_path / "black.npy", np.zeros((32, 48), np.float32))
    black = ok("render", "black.npy", "-o", "float", "--no-sensor", "--format", "float-npy").err
    assert "the frame has no light" in black


def test_a_frame_that_is_all_at_the_top_code(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "bright.npy", np.full((32, 48), 800, np.int16))
    told = ok("render", "bright.npy", "-o", "out").err
    assert re.search(r"bright.npy: \d+ % of the frame is at the top code: the mean light is 800", told)
    assert "--full-scale N divides" in told and "--exposure-gain auto finds one" in told
    assert "top code:" not in ok("render", "bright.npy", "-o", "auto", "--exposure-gain", "auto").err
    assert "top code:" not in ok("render", "bright.npy", "-o", "scale", "--full-scale", 1023).err


def test_negative_lobes(ok, refused, scene: Path) -> None:
    lobes = images.real()
    lobes[3:5, 6] = -0.0015
    images.exr(scene / "lobes.exr", {"R": lobes, "G": lobes, "B": lobes})
    message = refused("render", "lobes.exr", "-o", "out")
    assert "pixel (6, 3) is -0.0015" in message and "--clip-negative" in message
    given, told = light(ok, scene, "lobes.exr", "--clip-negative")
    np.testing.assert_array_equal(given, np.maximum(lobes, 0))
    assert f"lobes.exr: 2 of {lobes.size} pixels of the ideal image were negative, down to -0.0015" in told
    plane = albedo()
    plane[7, 11] = -0.5
    np.save(scene / "albedo.npy", plane)
    given = ["--depth", "z.npy", "--albedo", "albedo.npy"]
    assert "--clip-negative" in refused("render", *given, *ARGUMENTS)
    assert "1 of 1728 pixels of the albedo were negative" in ok("render", *given, *ARGUMENTS, "--clip-negative").err
    lobes[0, 0] = np.nan
    np.save(scene / "nan.npy", lobes)
    assert "pixel (0, 0) is nan" in refused("render", "nan.npy", "-o", "nan", "--clip-negative")


def test_what_holds_for_all_frames_is_said_once(ok, tmp_path: Path) -> None:
    color = np.random.default_rng(6).integers(0, 256, (images.HEIGHT, images.WIDTH, 3), dtype=np.uint8)
    for i in range(4):
        Image.fromarray(np.roll(color, i, axis=0)).save(tmp_path / f"frame_{i}.png", icc_profile=srgb_profile())
    told = ok("render", "frame_*.png", "-o", "out").err
    assert told.count("color channels differ") == 1 and told.count("encoded for a screen") == 1
