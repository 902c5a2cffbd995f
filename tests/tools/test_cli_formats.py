"""Every input format gives the frame of the NPY of the same values, and every output format holds the same codes."""

from __future__ import annotations

import re
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile


@pytest.mark.parametrize("name", sorted(images.FORMATS))
def test_same_values_same_frame(ok, tmp_path: Path, name: str) -> None:
    write, values = images.FORMATS[name]
    write(tmp_path / name)
    np.save(tmp_path / "reference.npy", values().astype(np.float32))
    settings = ["--format", "npy", "--no-preview", "--irradiance-scale", "0.5", "--read-noise", "1"]
    settings += ["--transfer", "linear"]  # JPEG is sRGB by its format
    result = ok("render", name, "-o", "given", *settings)
    told = re.findall(r"clspeckle: warning: (.*)", result.err)
    if name in images.NO_FULL_SCALE:
        assert any("tells no full scale" in text for text in told)
        told = [text for text in told if "full scale" not in text and "at the top code" not in text]
    expected = images.WARNINGS.get(Path(name).suffix)
    assert len(told) == (1 if expected else 0) and all(f"{name}: {expected}" in text for text in told)
    ok("render", "reference.npy", "-o", "reference", *settings)
    given = (tmp_path / "given" / "frame_000000.npy").read_bytes()
    assert given == (tmp_path / "reference" / "frame_000000.npy").read_bytes()
    frame = np.load(tmp_path / "given" / "frame_000000.npy")
    assert frame.shape == (images.HEIGHT, images.WIDTH)
    assert frame.std() > 5, "an image that hardly varies would pass for any other"


@pytest.mark.parametrize("name", sorted(images.FORMATS))
def test_statistics_see_the_stored_values(ok, tmp_path: Path, name: str) -> None:
    """Without a mask or a region: mean, least and greatest value to single precision, in units of the file."""
    write, values = images.FORMATS[name]
    write(tmp_path / name)
    frame = ok("statistics", name, "--json").json()["frames"][0]
    expected = values().astype(np.float64)
    integer = frame["top_code"] is not None
    if integer:
        expected = np.rint(expected * frame["top_code"])
    assert frame["count"] == expected.size
    assert frame["minimum"] == pytest.approx(expected.min(), rel=1e-6)
    assert frame["maximum"] == pytest.approx(expected.max(), rel=1e-6)
    assert frame["mean"] == pytest.approx(expected.mean(), rel=1e-6)
    assert frame["standard_deviation"] == pytest.approx(expected.std(ddof=1), rel=1e-5)


def test_help_readme_and_samples_name_the_same_formats(ok) -> None:
    """What the registry lists; a format without samples here would be tested nowhere."""
    told = re.search(r"ideal infrared image \((.*?)\)", ok("render", "--help").out, re.DOTALL)
    assert told
    names = {re.sub(r" [\d/a-z]+$", "", " ".join(name.split())) for name in told[1].split(",")}
    assert len(names) >= 6 and "Radiance HDR" in names
    suffixes = {Path(name).suffix for name in images.FORMATS}
    of_format = {"PNM": {".pgm", ".ppm", ".pnm"}, "JPEG": {".jpg"}, "raw": set()}  # raw: test_cli_raw.py
    expected = [of_format.get(name, {f".{name.split()[-1].lower()}"}) for name in names]
    assert set().union(*expected) == suffixes
    page = Path(__file__).resolve().parents[2] / "docs" / "guide" / "command-line.md"
    listed = re.search(r"image may be ([^.]*)\.", " ".join(page.read_text().split()))
    assert listed
    assert set(re.split(r", | or ", listed[1])) == names


def test_color_is_averaged_with_a_warning(ok, tmp_path: Path) -> None:
    color = np.random.default_rng(6).integers(0, 256, (images.HEIGHT, images.WIDTH, 3), dtype=np.uint8)
    iio.imwrite(tmp_path / "color.png", color)
    np.save(tmp_path / "mean.npy", (color.astype(float).mean(axis=-1).astype(np.float32) / 255.0).astype(np.float32))
    given = ok("render", "color.png", "-o", "given", "--format", "npy", "--no-preview")
    ok("render", "mean.npy", "-o", "mean", "--format", "npy", "--no-preview")
    assert "color.png: the 3 color channels differ; their mean is taken" in given.err
    frames = [np.load(tmp_path / folder / "frame_000000.npy") for folder in ("given", "mean")]
    np.testing.assert_array_equal(*frames)


def test_opacity_is_ignored_with_a_warning(ok, tmp_path: Path) -> None:
    pixels = np.dstack([images.gray8()] * 3 + [np.full_like(images.gray8(), 128)])
    iio.imwrite(tmp_path / "transparent.png", pixels)
    assert "the opacity channel is ignored" in ok("statistics", "transparent.png").err


def test_a_channel_of_an_exr_can_be_named(ok, refused, tmp_path: Path) -> None:
    images.exr(tmp_path / "layers.exr", {"direct": images.real(), "indirect": 2 * images.real()})
    np.save(tmp_path / "twice.npy", 2 * images.real())
    message = refused("render", "layers.exr", "-o", "out")
    assert "for example layers.exr:direct" in message and "direct, indirect" in message
    assert 'no channel "indrect"' in refused("render", "layers.exr", "-o", "out", "--channel", "indrect")
    settings = ["--format", "npy", "--no-preview"]
    ok("render", "layers.exr", "-o", "given", "--channel", "indirect", *settings)
    ok("render", "twice.npy", "-o", "twice", *settings)
    given, twice = ((tmp_path / folder / "frame_000000.npy").read_bytes() for folder in ("given", "twice"))
    assert given == twice


@pytest.mark.parametrize("name", ["stack.npy", "pages.tiff", "fortran.npy"])
def test_stacks_are_sequences(ok, tmp_path: Path, name: str) -> None:
    stack = np.random.default_rng(7).random((3, images.HEIGHT, images.WIDTH), dtype=np.float32)
    if name == "pages.tiff":
        tifffile.imwrite(tmp_path / name, stack, photometric="minisblack")
    else:
        np.save(tmp_path / name, np.asfortranarray(stack) if name == "fortran.npy" else stack)
    for i, frame in enumerate(stack):
        np.save(tmp_path / f"single_{i}.npy", frame)
    settings = ["--format", "npy-stack", "--no-preview"]
    ok("render", name, "-o", "stack", *settings)
    ok("render", "single_*.npy", "-o", "files", *settings)
    whole = np.load(tmp_path / "stack" / "frames.npy")
    assert whole.shape == stack.shape and whole.dtype == np.uint16
    np.testing.assert_array_equal(whole, np.load(tmp_path / "files" / "frames.npy"))
    assert not np.array_equal(whole[0], whole[1])


def test_names_are_taken_in_natural_order(ok, tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    for i in (1, 2, 10):
        np.save(tmp_path / "frames" / f"frame_{i}.npy", np.full((images.HEIGHT, images.WIDTH), i, np.float32))
    ok("render", "frames", "-o", "out", "--format", "npy", "--exposure-gain", 20, "--read-noise", 0, "--save-ideal")
    means = [float(np.load(path).mean()) for path in sorted((tmp_path / "out").glob("ideal_*.npy"))]
    assert means == [1, 2, 10]


def test_output_formats_hold_the_same_codes(ok, ideal: Path, tmp_path: Path) -> None:
    for name in ("png16", "tiff16", "npy", "npy-stack", "float-npy", "float-npy-stack", "float-tiff"):
        ok("render", ideal, "-o", name, "--format", name, "--exposure-gain", 3000)
    codes = np.load(tmp_path / "npy" / "frame_000000.npy")
    assert codes.dtype == np.uint16 and codes.shape == (48, 64)
    assert codes.max() == 1023, "the bright dots reach the top code of 10 bits, which is stored as 1023"
    png = iio.imread(tmp_path / "png16" / "frame_000000.png")
    assert png.dtype == np.uint16
    np.testing.assert_array_equal(png, codes)
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "tiff16" / "frame_000000.tiff"), codes)
    np.testing.assert_array_equal(np.load(tmp_path / "npy-stack" / "frames.npy"), codes[None])
    values = np.load(tmp_path / "float-npy" / "frame_000000.npy")
    assert values.dtype == np.float32
    np.testing.assert_array_equal(np.rint(values.astype(float) * 1023), codes)
    np.testing.assert_array_equal(np.load(tmp_path / "float-npy-stack" / "frames.npy"), values[None])
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "float-tiff" / "frame_000000.tiff"), values)


def test_preview_is_8_bit_and_scaled(ok, ideal: Path, tmp_path: Path) -> None:
    ok("render", ideal, "-o", "out", "--format", "npy")
    preview = iio.imread(tmp_path / "out" / "preview_000000.png")
    codes = np.load(tmp_path / "out" / "frame_000000.npy").astype(float)
    assert preview.dtype == np.uint8 and preview.shape == codes.shape
    assert preview.min() == 0 and preview.max() == 255
    low, high = (np.sort(codes.ravel())[round(share * (codes.size - 1))] for share in (0.001, 0.999))
    expected = np.clip((codes - low) * 255 / (high - low), 0, 255)
    assert np.abs(preview - expected).max() <= 0.51


def test_float_intensity_without_a_sensor(ok, refused, ideal: Path, tmp_path: Path) -> None:
    """Fully developed speckle of a flat image: its mean is the mean transmission within four standard errors."""
    np.save(tmp_path / "flat.npy", np.ones((128, 128), np.float32))
    run = ok(
        "render", "flat.npy", "-o", "out", "--no-sensor", "--format", "float-npy", "--json", "--relative-diameter", 0.5
    )
    intensity = np.load(tmp_path / "out" / "frame_000000.npy")
    aperture = run.json()["aperture"]
    assert aperture["mean_transmission"] == pytest.approx(np.pi * 0.25 / 4, rel=0.02)
    # The total energy is a sum of one exponential variate per pupil sample.
    error = aperture["mean_transmission"] / np.sqrt(aperture["pupil_samples"])
    assert abs(intensity.mean() - aperture["mean_transmission"]) < 4 * error
    message = refused("render", ideal, "-o", "none", "--no-sensor")
    assert "float-" in message
