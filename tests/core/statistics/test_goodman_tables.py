"""The tables of J. W. Goodman, "Speckle Phenomena in Optics" (2nd ed., SPIE 2020), on what the library draws: contrast
against looks, polarization and roughness, the size of a speckle against the f-number, intensities at two points.

All seeds are fixed. Bounds are in standard errors that the frames themselves yield, or that theory gives; each test
states its power.
"""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.optimize
import scipy.special
import scipy.stats

from reference import theory
from speckle_frames import Camera

LEVEL = 1e-3
HALF_POWER = 1.616339948  # where (2 J1(x) / x)^2 is 1/2
FIRST_ZERO = 3.831705970  # of J1


def within(values, expected, level=LEVEL):
    """Whether the mean of independent estimates lies where Student's t puts it; and its standard error."""
    values = np.asarray(values)
    error = values.std(ddof=1) / np.sqrt(values.size)
    bound = scipy.stats.t.ppf(1 - level / 2, values.size - 1) * error
    return abs(values.mean() - expected) <= bound, error


def correlation(frames):
    """Covariance of each frame over its mean squared, by the power spectrum: the plane is periodic, lag [0, 0]
    first."""
    for frame in frames:
        relative = frame / frame.mean() - 1
        yield np.fft.ifft2(np.abs(np.fft.fft2(relative)) ** 2).real / relative.size


# --- Looks ---


@pytest.mark.parametrize("p", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("looks", [1, 2, 4, 9, 25])
def test_contrast_against_looks(context, looks, p):
    """The mean of M independent intensities has the contrast sqrt((1 + p^2) / (2 M)) (Goodman 3.2, 4.5).

    10 groups of M frames of 192 x 192 at D = 0.5: the contrast is known to 0.2 to 0.3 %, Student's t at level 1e-3 (15
    of them: 1.5 % that one fails by chance over seeds). One look more or less changes it by 2 % at M = 25: 7 standard
    errors, found with a probability above 0.95.
    """
    camera = Camera(context, 0.5, p, size=192, seed=901)
    frames = camera.frames(10 * looks)
    contrasts = []
    for _ in range(10):
        mean = sum(next(frames) for _ in range(looks)) / looks
        contrasts.append(mean.std() / mean.mean())
    expected = theory.contrast(p) / np.sqrt(looks)
    good, error = within(contrasts, expected)
    assert good
    assert error < 0.004 * expected
    assert not within(contrasts, theory.contrast(p) / np.sqrt(looks + 1))[0]


@pytest.mark.parametrize(("looks", "p"), [(2, 1.0), (5, 1.0), (3, 0.0)])
def test_law_of_looks(context, measured, looks, p):
    """The mean of M looks follows the Gamma law of shape M at p = 1 (Goodman 3.2) and 2 M at p = 0. Kolmogorov-Smirnov
    at level 1e-3 on 9216 pixels 8 px apart of 4 means (critical distance 0.020); a shape off by one is 0.05 or more
    away, and is refused."""
    camera = Camera(context, 0.5, p, size=384, seed=902)
    frames = camera.frames(4 * looks)
    means = [sum(next(frames)[::8, ::8] for _ in range(looks)) / looks for _ in range(4)]
    samples = np.ravel(means)
    shape = looks * (2 if p == 0 else 1)
    critical = np.sqrt(-np.log(LEVEL / 2) / 2 / samples.size)

    def distance(k):
        return scipy.stats.kstest(samples, scipy.stats.gamma(k, scale=1 / k).cdf).statistic

    measured("distance over the critical one", distance(shape) / critical)
    assert distance(shape) < critical
    assert distance(shape + 1) > critical
    assert distance(shape - 1) > critical


# --- Roughness ---


@pytest.mark.parametrize("height_over_wavelength", [0.0, 0.02, 0.04, 0.06, 0.08, 0.12, 0.5])
def test_contrast_against_roughness(context, measured, height_over_wavelength):
    """A surface of RMS height h keeps the fraction c = exp(-(4 pi h / w)^2) of the light in step (Goodman 3.2, thesis
    2.4). The lens takes all of that, and the part T of the scattered light: r = c / (T (1 - c)), contrast sqrt(1 + 2 r)
    / (1 + r).

    20 frames of 128 x 128 at D = 0.8: known to 0.5 % or better, Student's t at level 1e-3. A height off by 10 % is
    refused from 0.04 to 0.12 wavelengths, where c is neither next to 0 nor to 1.
    """
    wavelength = 940e-9
    camera = clspeckle.Pipeline.from_parameters(
        (128, 128),
        relative_diameter=0.8,
        wavelength_m=wavelength,
        materials=[clspeckle.Material(roughness_rms_m=height_over_wavelength * wavelength)],
        output="intensity",
        seed=903,
        context=context,
    )
    transmission = camera.aperture.info().mean_transmission
    flat, material = np.ones((128, 128), np.float32), np.zeros((128, 128), np.uint8)
    contrasts = []
    for index in range(20):
        frame = camera.render(flat, refresh="all", material=material, frame_index=index).astype(np.float64)
        contrasts.append(frame.std() / frame.mean())

    def expected(ratio):
        c = np.exp(-((4 * np.pi * ratio) ** 2))
        return theory.rician_contrast(c / transmission / (1 - c)) if c < 1 else 0.0

    measured("contrast error", abs(np.mean(contrasts) - expected(height_over_wavelength)))
    if height_over_wavelength == 0.0:
        assert max(contrasts) < 1e-5
        return
    good, error = within(contrasts, expected(height_over_wavelength))
    assert good
    assert error < 5e-3 * expected(height_over_wavelength)
    if 0.04 <= height_over_wavelength <= 0.12:
        assert not within(contrasts, expected(1.1 * height_over_wavelength))[0]
        assert not within(contrasts, expected(0.9 * height_over_wavelength))[0]


# --- Size of a speckle ---


@pytest.mark.parametrize("f_number", [2.0, 2.8, 4.0, 5.6, 8.0, 11.0])
def test_size_of_a_speckle_against_the_f_number(context, measured, f_number):
    """Behind a circular pupil the intensity's correlation has the full width at half maximum 1.029 w F and its first
    zero at 1.220 w F, and covers the area 4 w^2 F^2 / pi (Goodman 4.4). Pixels of 0.9 um, so that the smallest speckle,
    1.93 um, spans two of them.

    The mean of 16 frames of 256 x 256, interpolated between pixels by its own Fourier series, which is exact below D =
    1 / 2 (F = 2: D = 0.479). Each frame yields a width; the mean is known to 0.3 to 1.2 %. The pupil's discs on the
    grid of frequencies differ from a circle's area by at most 0.7 % here, a bias that the bound allows. The thesis's
    radius for a diameter, or w F without the 1.03 (3 %) would be seen but for F = 11.
    """
    pitch, wavelength, size = 0.9e-6, 940e-9, 256
    state = clspeckle.Phase((size, size), polarization_count=1, seed=904, context=context)
    stage = clspeckle.Aperture(
        (size, size),
        f_number=f_number,
        pixel_pitch_m=pitch,
        wavelength_m=wavelength,
        degree_of_polarization=1.0,
        context=context,
    )
    flat = np.ones((size, size), np.float32)

    def frames():
        for index in range(16):
            state.refresh(index)
            yield stage.intensity(state, flat).astype(np.float64)

    scale = wavelength * f_number / pitch  # w F in pixels
    fx = np.fft.fftfreq(size)

    def along_x(found, x):
        """Row 0 of the correlation at any x."""
        spectrum = np.fft.fft(found[0]) / size
        return float((spectrum @ np.exp(2j * np.pi * fx * x)).real)

    widths, areas = [], []
    for found in correlation(frames()):
        peak = found[0, 0]
        widths.append(
            2 * scipy.optimize.brentq(lambda x, f=found, h=peak / 2: along_x(f, x) - h, 0.1 * scale, 1.0 * scale)
        )
        # Normalized by the true contrast; the sum over all lags is 0 by the mean's removal, so a disc out to the third
        # ring counts.
        y = np.minimum(np.arange(size), size - np.arange(size))
        disc = np.hypot(*np.meshgrid(y, y)) < 3.238 * scale
        areas.append(found[disc].sum())
    law = 2 * HALF_POWER / np.pi
    assert law == pytest.approx(1.029, abs=1e-3)
    measured("width error, relative", abs(np.mean(widths) / (law * scale) - 1))
    error = np.std(widths, ddof=1) / 4
    assert error < 0.015 * law * scale
    assert abs(np.mean(widths) - law * scale) < 4.07 * error + 0.005 * law * scale  # Student's t, 15 degrees of freedom
    # A disc to the third zero holds 93.8 % of the Airy pattern (its encircled energy, Born & Wolf 8.5).
    encircled = 1 - scipy.special.j0(np.pi * 3.238) ** 2 - scipy.special.j1(np.pi * 3.238) ** 2
    area = 4 / np.pi * scale**2
    assert abs(np.mean(areas) - encircled * area) < 4.07 * np.std(areas, ddof=1) / 4 + 0.02 * area
    # The mean correlation is smallest at the dark ring.
    mean = np.mean(list(correlation(frames())), axis=0)
    assert abs(along_x(mean, FIRST_ZERO / np.pi * scale)) < 0.02


# --- Two points ---


@pytest.mark.parametrize("p", [0.0, 1.0])
@pytest.mark.parametrize("diameter", [0.3, 0.5, 0.8])
def test_covariance_of_intensities_behind_a_circular_pupil(context, measured, diameter, p):
    """cov(I1, I2) = <I>^2 (1 + p^2) / 2 |2 J1(pi D r) / (pi D r)|^2 (Goodman 4.3.2) at every lag up to 10 px: 16 frames
    of 384 x 384. Within 6 standard errors of the frames (Student's t with 15 degrees of freedom, 220 lags, level 2e-3)
    and 3e-3 for the lattice of frequencies. A diameter off by 5 % is more than 15 standard errors away."""
    camera = Camera(context, diameter, p, size=384, seed=905)
    reach = np.arange(-10, 11)
    found = np.array([each[np.ix_(reach, reach)] for each in correlation(camera.frames(16))])
    mean, error = found.mean(axis=0), found.std(axis=0, ddof=1) / 4
    distance = np.hypot(*np.meshgrid(reach, reach))

    def law(d):
        return theory.contrast(p) ** 2 * theory.airy_autocovariance(distance, d)

    deviation = np.abs(mean - law(diameter))
    measured("largest deviation", deviation.max())
    assert np.all(deviation < 6 * error + 3e-3)
    assert (np.abs(mean - law(1.05 * diameter)) / error).max() > 15


def test_higher_moments_of_two_intensities(context, measured):
    """Two points with the coherence factor mu: <I1^2 I2^2> = 4 (1 + 4 |mu|^2 + |mu|^4), <I1 I2^2> = 2 (1 + 2 |mu|^2),
    by the moment theorem of circular Gaussian fields (Goodman 2.8), at distances 1 to 3 px at D = 0.5, where |mu|^2 is
    0.52, 0.02 and 0.01. 24 frames of 384 x 384, known to 1 %; a field that is not Gaussian, the same |mu| with unit
    phasors at D = 1, misses <I^4> = 24 by more than half."""
    camera = Camera(context, 0.5, 1.0, size=384, seed=906)
    mu = np.abs(theory.field_correlation(camera.pupil)) ** 2
    third, fourth = [], []
    for frame in camera.frames(24):
        intensity = frame / frame.mean()
        shifted = [np.roll(intensity, lag, axis=1) for lag in (1, 2, 3)]
        third.append([np.mean(intensity * s**2) for s in shifted])
        fourth.append([np.mean(intensity**2 * s**2) for s in shifted])
    squared = mu[0, 1:4]
    for values, expected in ((third, 2 * (1 + 2 * squared)), (fourth, 4 * (1 + 4 * squared + squared**2))):
        error = np.std(values, axis=0, ddof=1) / np.sqrt(len(values))
        z = (np.mean(values, axis=0) - expected) / error
        measured("standard errors", np.abs(z).max())
        assert np.all(error < 0.012 * expected)
        assert np.all(np.abs(z) < 4.2)  # Student's t, 23 degrees of freedom, 3 lags, level 1e-3
    phasors = Camera(context, 1.0, 1.0, "unit_phasor", size=384, seed=906)
    frame = next(phasors.frames(1))
    assert np.mean((frame / frame.mean()) ** 4) < 12
