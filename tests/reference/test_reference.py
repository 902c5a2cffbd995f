"""The reference checked on its own: published vectors, a second implementation, brute force, closed forms. No
device."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import randomgen
import scipy.stats

from reference import aperture, pattern, phase, philox, sensor, statistics, theory


@pytest.mark.parametrize(("counter", "key", "block"), philox.KNOWN_ANSWERS)
def test_philox_known_answers(counter, key, block):
    assert philox.philox4x32_10(np.array(counter, np.uint32), key).tolist() == list(block)


def test_philox_against_randomgen():
    rng = np.random.default_rng(1)
    for _ in range(50):
        counter = rng.integers(0, 2**32, 4, dtype=np.uint32)
        key = rng.integers(0, 2**32, 2, dtype=np.uint32)
        # randomgen counts up before it draws, with carries through all 128 bits.
        start = (sum(int(word) << (32 * i) for i, word in enumerate(counter)) - 1) % 2**128
        generator = randomgen.Philox(counter=start, key=int(key[0]) | int(key[1]) << 32, number=4, width=32)
        expected = generator.random_raw(4).astype(np.uint32)
        assert np.array_equal(philox.philox4x32_10(counter, key), expected)


def test_image_mapping():
    """Row by row from the sentence in philox.h, on a height that is not a multiple of 4."""
    height, width, seed, frame, stream = 10, 5, 0x1234567890ABCDEF, 5 << 32 | 6, 0x8001
    words = philox.image_words(height, width, seed, frame, stream)
    for y in range(height):
        for x in range(width):
            counter = np.array([x, y % 3, 6, 0x8001 | 5 << 16], np.uint32)
            block = philox.philox4x32_10(counter, (0x90ABCDEF, 0x12345678))
            assert words[y, x] == block[y // 3]


def test_uniform_is_single_precision_and_in_range():
    words = np.array([0, 1, 2**31, 2**32 - 2**7, 2**32 - 1], np.uint32)
    u = philox.uniform(words)
    assert u[0] == 2.0**-33
    assert u[-1] == 1.0
    assert np.array_equal(u, u.astype(np.float32))
    words = np.random.default_rng(2).integers(0, 2**32, 100000, dtype=np.uint32)
    assert np.abs(philox.uniform(words) - philox.uniform_exact(words)).max() <= 2.0**-24
    # Exact rational arithmetic, rounded to nearest even once, as an fma does.
    for word in words[:200]:
        exact = Fraction(float(np.float32(word))) / 2**32 + Fraction(1, 2**33)
        assert np.float32(float(exact)) == philox.uniform(np.array([word], np.uint32))[0]


def test_normals_are_normal():
    """n = 200000, seed 3; Kolmogorov-Smirnov at 1e-3."""
    normals = philox.image_normal(500, 400, 3, 0, 0x8000)
    assert scipy.stats.kstest(normals.ravel(), "norm").pvalue > 1e-3


def test_normal_pairs_are_normal_and_independent():
    """n = 2^22 words, seed 8. Both normals of a word by Kolmogorov-Smirnov at 1e-3, and their joint law by chi-square
    in 64 x 64 cells of equal probability at 1e-3: seen would be cells that are off by 1 % (root mean square: 4096
    cells of 1024 pairs, where chance leaves 3.1 %, 0.03 % to either side)."""
    words = np.random.default_rng(8).integers(0, 2**32, 2**22, dtype=np.uint32)
    pairs = philox.normal_pair(words)
    for normals in pairs.T:
        assert scipy.stats.kstest(normals, "norm").pvalue > 1e-3
    cells = np.floor(64 * scipy.stats.norm.cdf(pairs)).astype(int)
    counts = np.bincount(64 * cells[:, 0] + cells[:, 1], minlength=4096)
    assert scipy.stats.chisquare(counts).pvalue > 1e-3


def test_neighbouring_words_make_a_lattice():
    """All words of an interval, every 2^12th of which has its neighbours here, too: 2^20 of 2^32 in 2^8 runs. Within a
    run the radius hardly moves, and the angles must be spread more evenly than chance: the largest gap of 4096
    angles is below three times the mean one (chance: nine times, and below six with probability 1e-4)."""
    for begin in np.random.default_rng(9).integers(0, 2**20, 256, dtype=np.uint32):
        words = begin * np.uint32(4096) + np.arange(4096, dtype=np.uint32)
        pairs = philox.normal_pair(words)
        angle = np.sort(np.arctan2(pairs[:, 1], pairs[:, 0]))
        gaps = np.diff(np.concatenate([angle, [angle[0] + 2 * np.pi]]))
        assert gaps.max() < 3 * 2 * np.pi / 4096


def test_grid_length():
    def smooth(n):
        return all(n % p or p <= 13 for p in range(2, n + 1) if all(p % q for q in range(2, p)))

    for minimum in range(1, 200):
        n = phase.grid_length(minimum)
        assert smooth(n)
        assert n >= minimum
        assert not any(smooth(m) for m in range(minimum, n))


def test_padding_is_that_of_the_nearest_edge():
    grid = phase.FieldGrid(17, 19, oversampling=2, guard_px=5)
    columns = grid.pixel_columns()
    assert columns.size == 44  # 2 (17 + 5)
    assert columns[:34].tolist() == [i // 2 for i in range(34)]
    assert columns[34:].tolist() == [16] * 5 + [0] * 5
    odd = phase.FieldGrid(17, 1, guard_px=3).pixel_columns()
    assert odd[17:].tolist() == [16, 16, 0]


@pytest.mark.parametrize(("width", "height", "oversampling"), [(16, 16, 1), (20, 12, 1), (15, 9, 2), (7, 7, 3)])
@pytest.mark.parametrize("diameter", [0.1, 0.5, 0.8, 1.0])
def test_circle_support_by_brute_force(width, height, oversampling, diameter):
    grid = phase.FieldGrid(width, height, oversampling)
    support = aperture.circle_support(grid, diameter)
    for iy in range(grid.grid_height):
        for ix in range(grid.grid_width):
            ky = iy if 2 * iy < grid.grid_height else iy - grid.grid_height
            kx = ix if 2 * ix < grid.grid_width else ix - grid.grid_width
            squared = (Fraction(kx, grid.grid_width) ** 2 + Fraction(ky, grid.grid_height) ** 2) * oversampling**2
            # The rim (3-4-5 triangles at D = 1, say) is out; 2^-40 decides how near counts as on it.
            assert support[iy, ix] == (squared < (1 - Fraction(1, 2**40)) * Fraction(diameter) ** 2 / 4)
    mirrored = np.roll(support[::-1, ::-1], (1, 1), (0, 1))
    assert np.array_equal(support, mirrored)


def test_pupil_images():
    grid = phase.FieldGrid(64, 64)
    square = aperture.image_pupil(grid, 0.5, np.ones((1, 1)))
    k = aperture.frequencies(64)
    assert np.array_equal(square, ((np.abs(k) < 16)[:, None] & (np.abs(k) < 16)[None, :]).astype(float))
    ramp = aperture.image_pupil(grid, 0.5, np.array([[0.0, 1.0]]))
    assert ramp[0, 0] == pytest.approx(0.5)
    assert ramp[0, 4] == pytest.approx(0.75)
    assert ramp[0, 12] == pytest.approx(1.0)


def test_intensity_of_a_full_pupil_is_the_input():
    rng = np.random.default_rng(4)
    grid = phase.FieldGrid(12, 10)
    irradiance = rng.random((10, 12))
    z = np.exp(2j * np.pi * rng.random((10, 12)))
    assert np.allclose(aperture.intensity(grid, irradiance, [z], np.ones((10, 12))), irradiance)


def test_pattern_of_a_wall():
    """A wall at z = 2 that faces the laser, uniform pattern J = 1: I0 = cos^3 / z^2 / pi."""
    y, x = np.mgrid[-3:4, -4:5] * 0.1
    position = np.stack([x, y, np.full(x.shape, 2.0)], axis=-1)
    normal = np.broadcast_to([0.0, 0.0, -1.0], position.shape)
    value = pattern.lookup(np.ones((4, 4)), position, normal=normal)
    cosine = 2 / np.sqrt(x**2 + y**2 + 4)
    assert np.allclose(value, cosine**3 / 4 / np.pi)
    plane = pattern.lookup(np.ones((4, 4)), position, normal=normal, quantity=pattern.PLANE_IRRADIANCE)
    assert np.allclose(plane, 1 / 4 / np.pi)


def test_sensor_rounds_half_to_even_and_clips():
    device = sensor.Sensor(4, 1, bits=8, exposure_gain_dn=1, black_level_dn=0, read_noise_dn=0)
    assert device.expose(np.array([[0.5, 1.5, -3.0, 300.0]]), 0).tolist() == [[0, 2, 0, 255]]


def test_statistics_by_hand():
    m = statistics.moments(np.array([[1.0, 2.0, 3.0, 6.0]]))
    assert (m.mean, m.count) == (3.0, 4)
    assert m.standard_deviation == pytest.approx(math.sqrt(14 / 3))
    assert m.skewness == pytest.approx(scipy.stats.skew([1, 2, 3, 6]))
    assert m.excess_kurtosis == pytest.approx(scipy.stats.kurtosis([1, 2, 3, 6]))
    assert statistics.histogram(np.array([[-1.0, 0.0, 0.5, 1.0, 2.0]]), 0, 1, 2).tolist() == [1, 1, 1, 2]
    image = np.random.default_rng(5).random((7, 9))
    deviation = image - image.mean()
    covariance = statistics.autocovariance(image, 3)
    direct = np.mean(deviation[2:, :-1] * deviation[:-2, 1:])  # lag (2 rows, -1 column)
    assert covariance[3 + 2, 3 - 1] == pytest.approx(direct / np.mean(deviation**2))


@pytest.mark.parametrize("p", [0.0, 0.5, 1.0])
def test_standard_errors_by_simulation(p):
    """The closed-form standard errors of contrast and mean against the spread over 300 NumPy frames of 128 x 128
    (seed 6): the spread itself is known to 1 / sqrt(600) = 4 %, the bound is 4 of these."""
    grid = phase.FieldGrid(128, 128)
    pupil = aperture.circle_pupil(grid, 0.5)
    rng = np.random.default_rng(6)
    contrasts, means = [], []
    for _ in range(300):
        fields = (rng.standard_normal((2, 128, 128)) + 1j * rng.standard_normal((2, 128, 128))) / np.sqrt(2)
        m = statistics.moments(aperture.intensity(grid, np.ones((128, 128)), list(fields), pupil, p))
        contrasts.append(m.contrast)
        means.append(m.mean / aperture.mean_transmission(pupil))
    assert np.std(contrasts) == pytest.approx(theory.contrast_standard_error(pupil, p), rel=0.16)
    assert np.std(means) == pytest.approx(theory.mean_standard_error(pupil, p), rel=0.16)
    assert np.mean(means) == pytest.approx(1, abs=4 * np.std(means) / np.sqrt(300))


@pytest.mark.parametrize("p", [0.0, 0.3, 1.0])
def test_intensity_cdf(p):
    """n = 20000, seed 7; Kolmogorov-Smirnov at 1e-3."""
    draws = theory.sample_intensity(np.random.default_rng(7), (20000,), p)
    assert scipy.stats.kstest(draws, lambda x: theory.intensity_cdf(x, p)).pvalue > 1e-3


def test_airy_form_is_the_limit_of_the_discrete_correlation():
    pupil = aperture.circle_pupil(phase.FieldGrid(512, 512), 0.25)
    power = np.abs(theory.field_correlation(pupil)) ** 2
    r = np.arange(20)
    assert np.abs(power[0, :20] - theory.airy_autocovariance(r, 0.25)).max() < 2e-3


def test_unit_phasor_contrast_by_simulation():
    """40 NumPy frames of 128 x 128 at D = 0.8 (seed 8): the contrast is known to about 4e-4, the bound is 2e-3."""
    grid = phase.FieldGrid(128, 128)
    pupil = aperture.circle_pupil(grid, 0.8)
    rng = np.random.default_rng(8)
    contrasts = [
        statistics.moments(
            aperture.intensity(grid, np.ones((128, 128)), [np.exp(2j * np.pi * rng.random((128, 128)))], pupil)
        ).contrast
        for _ in range(40)
    ]
    assert np.mean(contrasts) == pytest.approx(theory.unit_phasor_contrast(pupil), abs=2e-3)
    assert theory.unit_phasor_contrast(pupil) < 0.9
