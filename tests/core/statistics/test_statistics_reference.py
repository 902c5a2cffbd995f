"""Moments, histogram and autocovariance on the device against the float64 reference and SciPy."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.stats

from reference import statistics

MEMBERS = ("mean", "standard_deviation", "contrast", "skewness", "excess_kurtosis")


def speckle_like(shape, seed=71):
    return np.random.default_rng(seed).exponential(1.0, shape)


IMAGES = {
    "uint8": (speckle_like((101, 77)) * 40).clip(0, 255).astype(np.uint8),
    "uint16": (speckle_like((101, 77)) * 5000).clip(0, 65535).astype(np.uint16),
    "float32": speckle_like((101, 77)).astype(np.float32),
    "on a pedestal": (speckle_like((101, 77)) + 1000).astype(np.float32),
    "negative": (-speckle_like((64, 64)) - 3).astype(np.float32),
    "small values": (speckle_like((33, 5)) * 1e-20).astype(np.float32),
    "row": speckle_like((1, 300)).astype(np.float32),
    "column": speckle_like((300, 1)).astype(np.float32),
    "two pixels": np.array([[1.0, 4.0]], np.float32),
}


def check_moments(got, expected):
    assert got.count == expected.count
    assert got.minimum == expected.minimum
    assert got.maximum == expected.maximum
    for member in MEMBERS:
        assert getattr(got, member) == pytest.approx(getattr(expected, member), rel=1e-6, abs=1e-30)


@pytest.mark.parametrize("name", IMAGES)
def test_moments(context, name):
    image = IMAGES[name]
    got = clspeckle.statistics.moments(image, context=context)
    check_moments(got, statistics.moments(image))
    assert got.skewness == pytest.approx(scipy.stats.skew(image.astype(np.float64), axis=None), abs=1e-5)
    assert got.excess_kurtosis == pytest.approx(scipy.stats.kurtosis(image.astype(np.float64), axis=None), abs=1e-5)


@pytest.mark.parametrize("name", ["uint8", "uint16", "float32"])
def test_masked_moments(context, name):
    image = IMAGES[name]
    mask = (np.random.default_rng(72).random(image.shape) < 0.3).astype(np.uint8) * 77
    check_moments(clspeckle.statistics.moments(image, mask, context=context), statistics.moments(image, mask))
    one = np.zeros(image.shape, np.uint8)
    one[5, 6] = 1
    got = clspeckle.statistics.moments(image, one, context=context)
    assert (got.count, got.mean, got.standard_deviation) == (1, image[5, 6], 0)
    assert np.isnan(got.skewness)


def test_moments_of_a_large_image(context):
    """4 million pixels: sums in single precision would lose digits that this finds."""
    image = (speckle_like((2048, 2048)) + 100).astype(np.float32)
    check_moments(clspeckle.statistics.moments(image, context=context), statistics.moments(image))


def test_constant_image(context):
    got = clspeckle.statistics.moments(np.full((40, 30), 0.1, np.float32), context=context)
    assert got.mean == pytest.approx(np.float32(0.1), rel=1e-12)
    assert got.standard_deviation == pytest.approx(0, abs=1e-9)
    dark = clspeckle.statistics.moments(np.zeros((4, 3), np.float32), context=context)
    assert dark.standard_deviation == 0
    assert np.isnan(dark.contrast)
    assert np.isnan(dark.skewness)
    assert np.isnan(dark.excess_kurtosis)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_pixels_that_are_no_numbers(context, bad):
    """An error where the pixel counts, nothing where the mask leaves it out."""
    image = speckle_like((20, 30)).astype(np.float32)
    image[7, 8] = bad
    on_device = clspeckle.DeviceImage.from_array(image, context=context)
    with pytest.raises(clspeckle.errors.InvalidDataError):
        clspeckle.statistics.moments(on_device, context=context)


HISTOGRAMS = [
    ("float32", 0.0, 3.0, 100),
    ("float32", -1.0, 0.5, 7),
    ("float32", 0.25, 0.26, 3),
    ("float32", 100.0, 200.0, 5),
    ("uint8", 0.0, 256.0, 256),
    ("uint8", 3.5, 100.5, 97),
    ("uint16", 10.0, 60000.0, 1000),
    ("uint16", 0.0, 65536.0, 65536),
    ("uint16", 0.0, 65536.0, 1),
]


@pytest.mark.parametrize(("name", "low", "high", "bins"), HISTOGRAMS)
@pytest.mark.parametrize("masked", [False, True])
def test_histogram(context, name, low, high, bins, masked):
    image = IMAGES[name]
    mask = (np.random.default_rng(73).random(image.shape) < 0.6).astype(np.uint8) if masked else None
    got = clspeckle.statistics.histogram(image, low, high, bins, mask, context=context)
    expected = statistics.histogram(image, low, high, bins, mask)
    assert got.below == expected[0]
    assert got.above == expected[-1]
    assert np.array_equal(got.counts, expected[1:-1])
    assert got.below + got.above + got.counts.sum() == (image.size if mask is None else np.count_nonzero(mask))


def test_values_on_the_edges_of_bins(context):
    """A bin has its lower edge and not its upper one."""
    image = np.arange(-2, 11, dtype=np.float32)[None, :] / 4  # -0.5 to 2.5 in quarters
    got = clspeckle.statistics.histogram(image, 0.0, 2.0, 4, context=context)
    assert (got.below, got.above) == (2, 3)
    assert got.counts.tolist() == [2, 2, 2, 2]


AUTOCOVARIANCES = [("float32", 20), ("float32", 76), ("uint8", 5), ("uint16", 30), ("on a pedestal", 8), ("row", 0)]


@pytest.mark.parametrize(("name", "max_lag"), AUTOCOVARIANCES)
def test_autocovariance(context, measured, name, max_lag):
    """Within 2e-6 of float64 (measured 5.8e-7 on PoCL, at the largest lags, which have few pairs)."""
    image = IMAGES[name]
    got = clspeckle.statistics.autocovariance(image, max_lag, context=context)
    error = np.abs(got - statistics.autocovariance(image, max_lag)).max()
    measured("error of the autocovariance", error)
    assert error < 2e-6
    assert got[max_lag, max_lag] == 1


def test_autocovariance_keeps_directions(context, measured):
    """An image that varies along x only is correlated along y; a shear leans to the right side; nothing wraps
    around."""
    rng = np.random.default_rng(74)
    stripes = np.broadcast_to(rng.random(90), (60, 90)).astype(np.float32)
    got = clspeckle.statistics.autocovariance(stripes, 10, context=context)
    assert np.abs(got[:, 10] - 1).max() < 1e-5  # x lag 0
    assert np.abs(got[10, :10]).max() < 0.5
    base = rng.random((60, 90)).astype(np.float32)
    leaning = base.copy()
    leaning[3:, 2:] += base[:-3, :-2]
    got = clspeckle.statistics.autocovariance(leaning, 5, context=context)
    expected = statistics.autocovariance(leaning, 5)
    assert np.abs(got - expected).max() < 2e-6
    assert got[5 + 3, 5 + 2] > 0.3
    assert abs(got[5 + 3, 5 - 2]) < 0.1
