"""The statistics sub-command against NumPy."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest


def test_moments_region_mask_and_bits(ok, tmp_path: Path) -> None:
    codes = np.random.default_rng(0).gamma(2.0, 200.0, (60, 80)).clip(0, 1023).astype(np.uint16)
    codes[0, :5] = 0
    iio.imwrite(tmp_path / "codes.png", codes)
    mask = np.random.default_rng(1).integers(0, 2, codes.shape, dtype=np.uint8)
    iio.imwrite(tmp_path / "mask.png", mask)

    def check(values: np.ndarray, *arguments: object) -> dict:
        frame = ok("statistics", "codes.png", "--json", "--bits", 10, *arguments).json()["frames"][0]
        values = values.astype(float)
        assert frame["count"] == values.size
        assert frame["mean"] == pytest.approx(values.mean(), rel=1e-9)
        assert frame["standard_deviation"] == pytest.approx(values.std(ddof=1), rel=1e-7)
        assert frame["contrast"] == pytest.approx(values.std(ddof=1) / values.mean(), rel=1e-7)
        third = ((values - values.mean()) ** 3).mean() / values.std() ** 3
        assert frame["skewness"] == pytest.approx(third, rel=1e-5)
        assert (frame["minimum"], frame["maximum"]) == (values.min(), values.max())
        assert frame["top_code"] == 1023
        assert frame["top_share"] == pytest.approx(np.mean(values == 1023), abs=1e-15)
        assert frame["zero_share"] == pytest.approx(np.mean(values == 0), abs=1e-15)
        return frame

    assert check(codes)["top_share"] > 0.01
    check(codes[10:40, 20:70], "--region", "20,10,50,30")
    masked = check(codes[mask != 0], "--mask", "mask.png")
    assert masked["speckle_width_px"] is None
    check(codes[10:40, 20:70][mask[10:40, 20:70] != 0], "--mask", "mask.png", "--region", "20,10,50,30")


def test_histogram(ok, tmp_path: Path) -> None:
    values = np.random.default_rng(2).normal(5.0, 2.0, (64, 64)).astype(np.float32)
    np.save(tmp_path / "values.npy", values)
    whole = ok("statistics", "values.npy", "--json", "--histogram", 16).json()["frames"][0]["histogram"]
    assert sum(whole["counts"]) == values.size and whole["below"] == whole["above"] == 0
    assert len(whole["edges"]) == 17
    part = ok("statistics", "values.npy", "--json", "--histogram", 8, "--histogram-range", "4,6").json()
    part = part["frames"][0]["histogram"]
    assert part["below"] == np.sum(values < 4) and part["above"] == np.sum(values >= 6)
    expected = np.histogram(values.astype(float), bins=np.linspace(4, 6, 9))[0]
    assert np.abs(np.array(part["counts"]) - expected).max() <= 1, "a value on an edge may round either way"
    codes = np.random.default_rng(3).integers(0, 256, (32, 32), dtype=np.uint8)
    np.save(tmp_path / "codes.npy", codes)
    counts = ok("statistics", "codes.npy", "--json", "--bits", 8, "--histogram", 256).json()["frames"][0]["histogram"][
        "counts"
    ]
    np.testing.assert_array_equal(counts, np.bincount(codes.ravel(), minlength=256))
    text = ok("statistics", "codes.npy", "--histogram", 4).out
    assert "####" in text


@pytest.mark.parametrize(("sigma_x", "sigma_y"), [(1.0, 1.0), (2.5, 1.5)])
def test_speckle_size(ok, tmp_path: Path, sigma_x: float, sigma_y: float) -> None:
    """White noise blurred by a Gaussian has a Gaussian autocovariance of sqrt(2) its width: FWHM = 2 sqrt(2 ln 2)
    sqrt(2) sigma. 192 x 192 pixels hold some 3000 cells of the wider blur, which leaves an error of about 2 %; the
    interpolation adds less than 1 %."""
    side = 192
    noise = np.random.default_rng(4).normal(size=(side, side))
    frequency = 2 * np.pi * np.fft.fftfreq(side)
    blur = np.exp(-0.5 * ((sigma_x * frequency[None, :]) ** 2 + (sigma_y * frequency[:, None]) ** 2))
    image = np.fft.ifft2(np.fft.fft2(noise) * blur).real
    np.save(tmp_path / "blurred.npy", (image / image.std() + 10).astype(np.float32))
    frame = ok("statistics", "blurred.npy", "--json").json()["frames"][0]
    factor = 2 * np.sqrt(2 * np.log(2)) * np.sqrt(2)
    assert frame["speckle_width_px"] == pytest.approx(factor * sigma_x, rel=0.06)
    assert frame["speckle_height_px"] == pytest.approx(factor * sigma_y, rel=0.06)


def test_speckle_of_a_rendered_frame(ok, tmp_path: Path) -> None:
    """Fully developed speckle through a circular aperture of D cycles per pixel: its autocovariance is (2 J1(x) / x)^2
    with x = pi D r, which falls to one half at x = 1.6163, so FWHM = 1.029 / D. Contrast 1: 128 x 128 pixels with D =
    0.25 hold some 800 speckles, so that the contrast is known to about 4 % and the size to about 3 %."""
    np.save(tmp_path / "flat.npy", np.ones((128, 128), np.float32))
    ok("render", "flat.npy", "-o", "out", "--no-sensor", "--format", "float-npy", "--relative-diameter", 0.25)
    frame = ok("statistics", "out/frame_000000.npy", "--json").json()["frames"][0]
    assert frame["contrast"] == pytest.approx(1, abs=0.12)
    assert frame["speckle_width_px"] == pytest.approx(1.029 / 0.25, rel=0.1)
    assert frame["speckle_height_px"] == pytest.approx(1.029 / 0.25, rel=0.1)


def test_temporal(ok, refused, tmp_path: Path) -> None:
    """As a stack and as files, with a mask and a region, against NumPy to rounding."""
    stack = np.random.default_rng(5).normal(100, 3, (5, 40, 50)).astype(np.float32) + np.arange(50, dtype=np.float32)
    np.save(tmp_path / "stack.npy", stack)
    for i, frame in enumerate(stack):
        np.save(tmp_path / f"frame_{i}.npy", frame)
    deviation = stack.astype(float).std(axis=0, ddof=1)
    for arguments in (["stack.npy"], ["frame_*.npy"]):
        temporal = ok("statistics", *arguments, "--temporal", "--json").json()["temporal"]
        assert temporal["frames"] == 5
        assert temporal["mean_standard_deviation"] == pytest.approx(deviation.mean(), rel=1e-9)
        assert temporal["rms_standard_deviation"] == pytest.approx(np.sqrt((deviation**2).mean()), rel=1e-9)
    mask = (np.indices((40, 50)).sum(0) % 3 == 0).astype(np.uint8)
    np.save(tmp_path / "mask.npy", mask)
    temporal = ok(
        "statistics", "stack.npy", "--temporal", "--json", "--mask", "mask.npy", "--region", "5,6,30,20"
    ).json()["temporal"]
    part = deviation[6:26, 5:35][mask[6:26, 5:35] != 0]
    assert temporal["mean_standard_deviation"] == pytest.approx(part.mean(), rel=1e-9)
    assert "temporal standard deviation" in ok("statistics", "stack.npy", "--temporal").out
    assert "two frames" in refused("statistics", "frame_0.npy", "--temporal")


def test_table_and_stacks(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "stack.npy", np.random.default_rng(6).random((2, 20, 30), dtype=np.float32))
    np.save(tmp_path / "constant.npy", np.full((20, 30), 2.0, np.float32))
    run = ok("statistics", "stack.npy", "constant.npy", "--json").json()
    assert [frame["file"] for frame in run["frames"]] == ["stack.npy[0]", "stack.npy[1]", "constant.npy"]
    constant = run["frames"][2]
    assert constant["standard_deviation"] == 0 and constant["contrast"] == 0
    assert constant["skewness"] is None and constant["speckle_width_px"] is None
    lines = ok("statistics", "stack.npy", "constant.npy").out.splitlines()
    assert len(lines) == 4 and lines[0].split()[:3] == ["file", "size", "mean"]


BAD = [
    (["--region", "0,0,0,5"], "above 0"),
    (["--region", "50,0,20,5"], "leaves the image"),
    (["--region", "1,2,3"], "--region"),
    (["--region", "a,b,c,d"], "--region"),
    (["--region=-1,0,5,5"], "--region"),
    (["--bits", "0"], "--bits"),
    (["--histogram", "0"], "--histogram"),
    (["--histogram", "4", "--histogram-range", "5,5"], "--histogram-range"),
    (["--mask", "missing.png"], "missing.png"),
    (["--mask", "small.npy"], "small.npy"),
    (["--mask", "zero.npy"], "no pixel"),
    (["--device", "no such device"], "no such device"),
]


@pytest.mark.parametrize(("arguments", "word"), BAD, ids=[" ".join(a) for a, _ in BAD])
def test_bad_arguments(cli, ideal: Path, tmp_path: Path, arguments: list[str], word: str) -> None:
    np.save(tmp_path / "small.npy", np.ones((4, 4), np.uint8))
    np.save(tmp_path / "zero.npy", np.zeros((48, 64), np.uint8))
    result = cli("statistics", ideal, *arguments)
    assert result.code == (2 if "--device" in arguments else 1), result.err
    assert word in result.err and result.out == ""


def test_values_that_are_not_finite(refused, tmp_path: Path) -> None:
    image = np.ones((20, 30), np.float32)
    image[4, 9] = np.inf
    np.save(tmp_path / "bad.npy", image)
    assert "bad.npy: pixel (9, 4) is inf" in refused("statistics", "bad.npy")
