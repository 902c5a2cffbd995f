"""The laws of speckle, on what the library draws.

All seeds are fixed: a test gives the same answer every time. Levels and powers are those of the procedure over seeds.
"""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.stats

from reference import aperture, phase, statistics, theory
from speckle_frames import GAUSSIAN, SIZE, Camera

LEVEL = 1e-3
UNIT_PHASOR = "unit_phasor"


def critical_distance(n):
    """Kolmogorov-Smirnov distance that a true law exceeds with probability 1e-3, for large n (Smirnov 1948)."""
    return np.sqrt(-np.log(LEVEL / 2) / 2 / n)


def distance(samples, degree_of_polarization):
    """Largest distance between the samples' distribution and the law of mean 1 with that degree of polarization."""
    ordered = np.sort(np.ravel(samples))
    cdf = theory.intensity_cdf(ordered, degree_of_polarization)
    n = ordered.size
    return max(np.max(np.arange(1, n + 1) / n - cdf), np.max(cdf - np.arange(n) / n))


# --- Contrast ---


@pytest.mark.parametrize("p", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("diameter", [0.25, 0.5, 1.0])
def test_contrast_is_that_of_fully_developed_speckle(context, measured, diameter, p):
    """sqrt((1 + p^2) / 2) at any aperture: 16 frames of 512 x 512.

    A frame's contrast has the standard error of theory.contrast_standard_error(): pixels are correlated, and at p = 1
    a frame counts as n / sum |mu|^4 independent ones, mu the autocorrelation of the field (28 000 at D = 0.25, 112
    000 at 0.5, 261 000 at 1). The mean over the frames must lie within 2.6 of its standard errors (level 1 %) and the
    frames must spread as their standard error says (chi^2 of 15 degrees of freedom at 1e-3 on either side).

    Power: the standard error of the mean is 3e-4 to 1.5e-3; a degree of polarization off by 0.1 moves the contrast by
    3.5e-3 (p = 0), 4.6e-2 (p = 1). At p = 0, D = 0.25 that is found with a probability of 0.89, elsewhere above
    0.999.
    """
    frames = 16
    camera = Camera(context, diameter, p)
    contrasts = [statistics.moments(frame).contrast for frame in camera.frames(frames)]
    expected = theory.contrast(p)
    error = theory.contrast_standard_error(camera.pupil, p)
    z = (np.array(contrasts) - expected) / error
    measured("standard errors of the mean contrast", abs(z.mean()) * np.sqrt(frames))
    assert abs(z.mean()) * np.sqrt(frames) < 2.6
    spread = np.sum((z - z.mean()) ** 2)
    assert scipy.stats.chi2.ppf(LEVEL, frames - 1) < spread < scipy.stats.chi2.ppf(1 - LEVEL, frames - 1)
    # The library's own statistics of the last frame.
    self_made = clspeckle.statistics.moments(frame_of(camera), context=camera.state.context).contrast
    assert abs(self_made - expected) < 5 * error


def frame_of(camera):
    return camera.stage.intensity(camera.state, camera.flat)


def test_contrast_test_can_fail(context):
    """Speckle that is not fully developed (unit phasors, contrast 0.617 at D = 1 and 0.954 at D = 0.5), or of p = 0.9
    (0.951), is 196, 15 and 16 standard errors of a frame away from 1; and the unit phasors' contrast is what their
    own theory says, sqrt(1 - sum |h|^4 / (sum |h|^2)^2)."""
    for diameter, p, field, at_least in (
        (1.0, 1.0, UNIT_PHASOR, 100),
        (0.5, 1.0, UNIT_PHASOR, 5),
        (0.5, 0.9, GAUSSIAN, 5),
    ):
        camera = Camera(context, diameter, p, field)
        contrasts = [statistics.moments(frame).contrast for frame in camera.frames(4)]
        error = theory.contrast_standard_error(camera.pupil, 1.0)
        assert abs(np.mean(contrasts) - 1) / error > at_least
        if field == UNIT_PHASOR:
            assert np.mean(contrasts) == pytest.approx(theory.unit_phasor_contrast(camera.pupil), abs=0.006)


@pytest.mark.parametrize(("oversampling", "diameter", "p"), [(2, 1.1, 1.0), (2, 1.1, 0.0), (3, 2.5, 1.0)])
def test_contrast_after_integration_over_the_pixel(context, oversampling, diameter, p):
    """A pixel of 2.9 um at f/2.8 (D = 1.1) sees less than one speckle: the contrast falls to the value that the
    average of |mu|^2 over the pixel gives (0.72 at D = 1.1, p = 1). 12 frames of 256 x 256; within 4 standard errors,
    estimated from the frames (3e-4 to 9e-4, so 1 % at p = 1 would be found with probability above 0.999 at D = 1.1
    and 0.99 at D = 2.5)."""
    camera = Camera(context, diameter, p, size=256, oversampling=oversampling)
    contrasts = np.array([statistics.moments(frame).contrast for frame in camera.frames(12)])
    expected = theory.integrated_contrast(camera.pupil, oversampling, p)
    assert expected < 0.9 * theory.contrast(p)
    error = contrasts.std(ddof=1) / np.sqrt(contrasts.size)
    assert error < 2e-3
    assert abs(contrasts.mean() - expected) < 4.0 * error  # Student's t with 11 degrees of freedom at level 2e-3


# --- First-order laws ---

SPACED_FRAMES, PITCH = 24, 8  # 98304 samples; neighbours correlated by |mu|^2 < 7e-4 at D = 0.5, 1e-4 at D = 1


@pytest.mark.parametrize("diameter", [0.5, 1.0])
@pytest.mark.parametrize("p", [0.0, 0.5, 1.0])
def test_intensity_law(context, measured, diameter, p):
    """Exponential at p = 1, Gamma(2) at p = 0, the sum of two exponentials between them; mean known, not fitted.

    Kolmogorov-Smirnov at level 1e-3 on n = 98304 pixels of 24 frames, 8 px apart: critical distance 6.2e-3. For the
    power see test_power_of_the_intensity_laws().
    """
    samples = Camera(context, diameter, p).spaced(SPACED_FRAMES, PITCH)
    found = distance(samples, p)
    measured("distance over the critical one", found / critical_distance(samples.size))
    assert found < critical_distance(samples.size)


@pytest.mark.parametrize("p", [0.0, 1.0])
def test_intensity_law_of_one_pixel(context, measured, p):
    """As figure 31 of the thesis: one pixel of many small images, each with phases of its own; exactly independent.
    n = 4000, level 1e-3, critical distance 3.1e-2; the other of the two laws is 0.14 away."""
    camera = Camera(context, 0.5, p, size=64)
    samples = np.array([frame[20, 31] for frame in camera.frames(4000)])
    measured("distance over the critical one", distance(samples, p) / critical_distance(4000))
    assert distance(samples, p) < critical_distance(4000)
    assert distance(samples, 1 - p) > critical_distance(4000)


@pytest.mark.parametrize(
    ("true_p", "tested_p", "power"),
    [(0.9, 1.0, 0.99), (0.6, 0.5, 0.99), (0.4, 0.5, 0.99), (0.3, 0.0, 0.9), (1.0, 0.0, 0.99)],
)
def test_power_of_the_intensity_laws(true_p, tested_p, power):
    """Simulation with 100 sets of n = 98304 independent draws, as many as test_intensity_law() has: how often a wrong
    degree of polarization is rejected, and the true one at most 3 times (level 1e-3).

    Off by 0.1 is always found from p = 1 and 0.5. At p = 0 the law depends on p^2 alone: p = 0.1 is 1.3e-3 away, for
    which this test would need 7 million samples; there 0.3 is found, and the contrast finds 0.1.
    """
    rng = np.random.default_rng(82)
    n = SPACED_FRAMES * (SIZE // PITCH) ** 2
    rejected = accepted = 0
    for _ in range(100):
        draws = theory.sample_intensity(rng, (n,), true_p)
        rejected += distance(draws, tested_p) > critical_distance(n)
        accepted += distance(draws, true_p) < critical_distance(n)
    assert rejected >= 100 * power
    assert accepted >= 97


@pytest.mark.parametrize(
    ("diameter", "p", "field", "tested_p"),
    [
        (1.0, 1.0, UNIT_PHASOR, 1.0),
        (1.0, 0.0, UNIT_PHASOR, 0.0),
        (0.5, 1.0, UNIT_PHASOR, 1.0),
        (0.5, 0.9, GAUSSIAN, 1.0),
        (1.0, 0.9, GAUSSIAN, 1.0),
        (0.5, 0.6, GAUSSIAN, 0.5),
        (0.5, 0.0, GAUSSIAN, 1.0),
        (0.5, 1.0, GAUSSIAN, 0.0),
    ],
)
def test_intensity_law_rejects_other_speckle(context, diameter, p, field, tested_p):
    """What is not the law is rejected on real output too: the thesis's unit phasors (their speckle is not fully
    developed, at D = 1 by far, at D = 0.5 still visibly), degrees of polarization that are off by 0.1, polarized for
    unpolarized."""
    samples = Camera(context, diameter, p, field).spaced(SPACED_FRAMES, PITCH)
    assert distance(samples, tested_p) > critical_distance(samples.size)


# --- Mean, aperture, correlation ---


@pytest.mark.parametrize("p", [0.0, 1.0])
@pytest.mark.parametrize("diameter", [0.1, 0.5, 1.0])
def test_mean_is_the_mean_transmission(context, diameter, p):
    """E[I] = mean_transmission I0: 8 frames of 512 x 512, within 3.3 standard errors (level 1e-3), at p = 1 0.26 % at
    D = 1 and 2.6 % at D = 0.1. An error of twice that is found with probability above 0.999."""
    camera = Camera(context, diameter, p)
    mean = np.mean([frame.mean() for frame in camera.frames(8)])
    assert abs(mean - 1) < 3.3 * theory.mean_standard_error(camera.pupil, p) / np.sqrt(8)
    assert camera.transmission == pytest.approx(np.pi * diameter**2 / 4, rel=0.01)


def dot_image(size=SIZE):
    """Gaussian dots on black, as in the thesis's section 4.2."""
    y, x = np.mgrid[:size, :size]
    return np.exp(-(((x + 8) % 16 - 8) ** 2 + ((y + 8) % 16 - 8) ** 2) / (2 * 2.0**2)).astype(np.float32)


@pytest.mark.parametrize("picture", ["flat", "dots"])
def test_total_intensity_is_quadratic_in_the_diameter(context, picture):
    """Thesis figure 34. 8 frames at each of D = 0.1, 0.2 ... 1: the exponent of a power law fitted to the totals is 2
    to 0.015. Its standard error is about 0.002: a total of 8 frames is known to 0.5 % at D = 0.1 and 0.05 to 0.2 % at
    D = 1. Each total is within 4.8 standard errors of pi D^2 / 4, which the lattice of frequencies follows to 0.5 %.
    The errors are estimated from the frames (Student's t with 7 degrees of freedom at level 2e-3)."""
    irradiance = np.ones((SIZE, SIZE), np.float32) if picture == "flat" else dot_image()
    diameters = np.arange(1, 11) / 10
    totals = []
    for diameter in diameters:
        camera = Camera(context, diameter, 0.0)
        frames = [
            frame.sum() * camera.transmission / irradiance.sum(dtype=np.float64)
            for frame in camera.frames(8, irradiance)
        ]
        area = np.pi * diameter**2 / 4
        assert abs(np.mean(frames) - area) < 4.8 * np.std(frames, ddof=1) / np.sqrt(8) + 0.005 * area
        totals.append(np.mean(frames))
    exponent = np.polyfit(np.log(diameters), np.log(totals), 1)[0]
    assert exponent == pytest.approx(2, abs=0.015)


def test_autocovariance_is_the_airy_form(context, measured):
    """|2 J1(pi D r) / (pi D r)|^2 (Goodman, "Speckle Phenomena in Optics", chapter 4) at D = 0.25, all lags up to
    12 px (the first dark ring is at 4.9): mean of 24 frames of 512 x 512 by the library's own autocovariance. Against
    the exact correlation of the pupil's samples within 6 standard errors (estimated from the frames, 3e-4 to 1.7e-3)
    at each of the 312 lags; against the Airy form within that and 2e-3 for the lattice. The width is that of D, not
    of 1.1 D, which differs by 0.07 at r = 2: more than 50 standard errors."""
    frames, max_lag = 24, 12
    camera = Camera(context, 0.25)
    images = [
        clspeckle.statistics.autocovariance(frame.astype(np.float32), max_lag, context=context)
        for frame in camera.frames(frames)
    ]
    mean = np.mean(images, axis=0, dtype=np.float64)
    error = np.std(images, axis=0, ddof=1, dtype=np.float64) / np.sqrt(frames)
    lags = np.arange(-max_lag, max_lag + 1)
    exact = np.abs(theory.field_correlation(camera.pupil))[np.ix_(lags, lags)] ** 2
    airy = theory.airy_autocovariance(np.hypot(*np.meshgrid(lags, lags)), 0.25)
    half = np.ones(mean.shape, bool)
    half[max_lag, max_lag] = False
    z = (mean - exact)[half] / error[half]
    measured("largest deviation in standard errors", np.abs(z).max())
    assert np.abs(z).max() < 6.0  # Student's t with 23 degrees of freedom, 312 lags, level 1e-3
    assert np.abs(mean - airy).max() < 0.01
    assert np.all(np.abs(mean - airy)[half] < 6.0 * error[half] + 2e-3)
    wrong = theory.airy_autocovariance(np.hypot(*np.meshgrid(lags, lags)), 0.275)
    assert np.max(np.abs(mean - wrong)[half] / error[half]) > 50


@pytest.mark.parametrize("p", [0.0, 1.0])
def test_mean_of_many_frames_recovers_the_image(context, p):
    """Thesis section 4.2, recovering the beam profile: the mean of 400 frames of 64 x 64 is the ideal image as the
    aperture blurs it incoherently, E[I] = I0 convolved with |h|^2. The deviations of the pixels, over their standard
    errors, have the mean square of 1 that chance gives (to 0.15, four standard errors: n / sum |mu|^4 = 1750
    independent pixels), and none exceeds 6; a flat image would miss by far."""
    frames, size, diameter = 400, 64, 0.5
    irradiance = dot_image(size) + np.float32(0.05)
    camera = Camera(context, diameter, p, size=size)
    images = np.array(list(camera.frames(frames, irradiance)))
    blur = np.abs(np.fft.ifft2(camera.pupil)) ** 2
    expected = np.fft.ifft2(np.fft.fft2(irradiance) * np.fft.fft2(blur)).real / camera.transmission
    z = (images.mean(axis=0) - expected) / (expected * theory.contrast(p) / np.sqrt(frames))
    assert abs(np.mean(z**2) - 1) < 0.15
    assert np.abs(z).max() < 6
    flat = (images.mean(axis=0) - expected.mean()) / (expected * theory.contrast(p) / np.sqrt(frames))
    assert np.mean(flat**2) > 50


def test_polarizations_and_frames_are_uncorrelated(context):
    """Intensities of successive frames (n = 98304 pixels, 8 px apart) and of the two polarizations (n = 4096) are
    correlated by less than 3.5 / sqrt(n)."""
    first = Camera(context, 0.5, 1.0)
    frames = [frame[::PITCH, ::PITCH].ravel() for frame in first.frames(SPACED_FRAMES + 1)]
    a, b = np.concatenate(frames[:-1]), np.concatenate(frames[1:])
    assert abs(np.corrcoef(a, b)[0, 1]) < 3.5 / np.sqrt(a.size)

    state = clspeckle.Phase((SIZE, SIZE), seed=83, context=context)
    first_grid = phase.FieldGrid(SIZE, SIZE)
    pupil = aperture.circle_pupil(first_grid, 0.5)
    state.refresh(0)
    ones = np.ones((SIZE, SIZE), np.float32)
    images = [
        aperture.filtered_intensity(first_grid, aperture.spectrum(first_grid, ones, state.field(k)), pupil)[::8, ::8]
        for k in (0, 1)
    ]
    assert abs(np.corrcoef(images[0].ravel(), images[1].ravel())[0, 1]) < 3.5 / 64
