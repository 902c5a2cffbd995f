"""Shot noise: the Poisson law, from a twentieth of an electron to a hundred thousand."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.stats

from reference import sensor

MEANS = (0.05, 0.3, 1.0, 4.0, 9.0, 11.99, 12.0, 15.0, 30.0, 100.0, 1e3, 1e4, 1e5)
SHAPE = (512, 512)
FRAMES = 4
N = FRAMES * SHAPE[0] * SHAPE[1]


def electrons(context, image, frame_index=0, seed=0x5EED_0F_51604A15):
    """Electrons of one frame: one DN for an electron, above 30000 electrons a quarter."""
    gain = 1.0 if np.max(image) < 30000 else 0.25
    stage = clspeckle.Sensor(
        image.shape,
        context=context,
        bits=16,
        seed=seed,
        exposure_gain_dn=gain,
        black_level_dn=0.0,
        read_noise_dn=0.0,
        conversion_gain_dn_per_e=gain,
        shot_noise=True,
        quantize=False,
        float_full_scale=65535.0 / gain,
    )
    counts = stage.expose(image.astype(np.float32), frame_index=frame_index, dtype=np.float32).astype(np.float64)
    whole = np.rint(counts)
    assert np.abs(counts - whole).max() <= 0.05
    return whole


@pytest.fixture(scope="module")
def counts(context):
    return {
        mean: np.stack([electrons(context, np.full(SHAPE, mean), t) for t in range(FRAMES)]).ravel() for mean in MEANS
    }


@pytest.mark.parametrize("mean", MEANS)
def test_moments(counts, mean, measured):
    """Mean m, variance m, skewness 1 / sqrt(m): n = 2^20, fixed seed, 4.5 standard errors each (size 7e-6 each, 3e-4
    over all 39). A mean off by 6 sqrt(1 / (n m)), a variance off by 6 sqrt((2 + 1/m) / n) = 1 % (large m) or a
    skewness off by 6 sqrt(6 / n) = 0.014 is found with a power of 0.93. The standard error of the skewness is taken
    from the law itself by its moments up to the sixth."""
    sample = counts[mean]
    assert sample.size == N
    standard = (sample - mean) / np.sqrt(mean)
    errors = {
        "mean": standard.mean() / np.sqrt(1 / N),
        "variance": (np.mean(standard**2) - 1) / np.sqrt((2 + 1 / mean) / N),
    }
    k = np.arange(int(mean + 12 * np.sqrt(mean) + 12))
    k = k[k >= mean - 12 * np.sqrt(mean)]
    law = scipy.stats.poisson.pmf(k, mean)
    z = (k - mean) / np.sqrt(mean)
    third, sixth = np.sum(law * z**3), np.sum(law * z**6)
    errors["skewness"] = (np.mean(standard**3) - third) / np.sqrt((sixth - third**2) / N)
    for what, value in errors.items():
        measured(f"{what}, standard errors", abs(value))
        assert abs(value) < 4.5, what


def chi_square(sample, mean):
    """Statistic and degrees of freedom against the Poisson law, in bins that reach from 20 expected counts below to
    20 above: each count for itself where there are few, else about 180 bins of equal probability, and in the tails
    each half as wide as the one before."""
    tail = 20 / N * 2.0 ** np.arange(9)
    below = np.concatenate([tail, np.arange(1, 181) / 181])
    edges = np.concatenate([scipy.stats.poisson.ppf(below, mean), scipy.stats.poisson.isf(tail, mean)])
    edges = np.unique(edges)
    expected = N * np.diff(np.concatenate([[0.0], scipy.stats.poisson.cdf(edges, mean), [1.0]]))
    expected[-1] = N * scipy.stats.poisson.sf(edges[-1], mean)
    observed = np.bincount(np.searchsorted(edges, sample, side="left"), minlength=expected.size).astype(float)
    while expected[-1] < 20:
        observed = np.append(observed[:-2], observed[-2:].sum())
        expected = np.append(expected[:-2], expected[-2:].sum())
    while expected[0] < 20:
        observed = np.append(observed[:2].sum(), observed[2:])
        expected = np.append(expected[:2].sum(), expected[2:])
    return float(np.sum((observed - expected) ** 2 / expected)), expected.size - 1


@pytest.mark.parametrize("mean", MEANS)
def test_goodness_of_fit(counts, mean, measured):
    """p > 1e-4 (size 1.3e-3 over all 13 means, fixed seed). With n = 2^20 and 200 bins a noncentrality of 120 is
    found with a power of 0.95: every probability off by 1.1 %, up and down. The approximation itself has a
    noncentrality below 1 at any mean."""
    statistic, freedom = chi_square(counts[mean], mean)
    measured("chi-square over its degrees of freedom", statistic / freedom)
    assert scipy.stats.chi2.sf(statistic, freedom) > 1e-4


def test_the_fit_finds_what_is_not_poisson():
    """The power of the test above, shown on a rounded normal, and on means and variances 1 % off."""
    rng = np.random.default_rng(62)
    for mean in (30.0, 1000.0):
        for wrong in (
            np.rint(rng.normal(mean, np.sqrt(mean), N)),
            rng.poisson(1.01 * mean, N),
            1.01 * rng.poisson(mean, N),
        ):
            statistic, freedom = chi_square(wrong, mean)
            assert scipy.stats.chi2.sf(statistic, freedom) < 1e-6
        statistic, freedom = chi_square(rng.poisson(mean, N), mean)
        assert scipy.stats.chi2.sf(statistic, freedom) > 1e-4


def test_zero_light_has_no_noise(context):
    assert np.all(electrons(context, np.zeros(SHAPE)) == 0)


def test_each_pixel_has_the_quantile_of_its_random_number(context, measured):
    """The very electrons of the reference, of means from 0.01 to 29000. In single precision the quantile falls on the
    other side of a step in few pixels, and then by one electron (measured: a share of 3e-4 from 12 electrons on, none
    below)."""
    shape = (256, 256)
    mean = np.geomspace(0.01, 29000, shape[0] * shape[1]).astype(np.float32).reshape(shape)
    got = electrons(context, mean, 5, seed=63)
    exact = sensor.Sensor(shape[1], shape[0], seed=63).poisson(mean.astype(np.float64), 5)
    difference = got - exact
    few, many = mean < 12, mean >= 12
    measured("share below 12 electrons", np.mean(difference[few] != 0))
    measured("share from 12 on", np.mean(difference[many] != 0))
    assert np.abs(difference).max() <= 1
    assert np.mean(difference[few] != 0) < 1e-4
    assert np.mean(difference[many] != 0) < 3e-3


def test_pixels_and_frames_are_independent(context):
    """Correlation with the neighbours, with the rows that share a Philox block, and with the next frame: n = 2^18,
    fixed seed, 4 standard errors (size 6e-5 each); a correlation of 0.01 is found with a power of 0.86."""
    for mean in (3.0, 50.0):
        frames = [(electrons(context, np.full(SHAPE, mean), t) - mean) / np.sqrt(mean) for t in range(2)]
        others = [np.roll(frames[0], 1, 1), np.roll(frames[0], 1, 0), frames[1]]
        others += [np.roll(frames[0], SHAPE[0] // 4 * j, 0) for j in (1, 2)]
        for other in others:
            assert abs(np.mean(frames[0] * other)) < 4 / np.sqrt(frames[0].size)
            assert abs(np.mean((frames[0] ** 2 - 1) * (other**2 - 1))) < 4 * (2 + 1 / mean) / np.sqrt(frames[0].size)


def test_shot_noise_keeps_the_mean_of_an_image(context):
    """Over 64 frames each pixel's mean is its light, the variance its light: relative to their standard errors both
    are standard normal over the pixels (mean of 64^2 within 4 / 64)."""
    light = np.random.default_rng(64).exponential(20.0, (64, 64))
    frames = np.stack([electrons(context, light, t) for t in range(64)])
    z = (frames.mean(axis=0) - light) / np.sqrt(light / 64)
    assert abs(z.mean()) < 4 / 64
    assert abs(z.std() - 1) < 0.06
