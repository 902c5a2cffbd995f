"""The aperture against the float64 reference, given the same z."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest

from reference import aperture, phase

# height, width. One FFT size each; 848 has the prime factor 53 and is padded to 858.
CAMERA_SIZES = [(64, 64), (480, 848), (720, 1280), (1080, 1920), (1000, 1001), (2048, 2048)]
BOUND = 2e-6


def dots(height, width):
    """Irradiance with structure: a grid of Gaussian dots on a gradient, some pixels without any light."""
    y, x = np.mgrid[:height, :width]
    pitch = 23.7
    near_y = (y + pitch / 2) % pitch - pitch / 2
    near_x = (x + 0.3 * y + pitch / 2) % pitch - pitch / 2
    image = 8 * np.exp(-(near_y**2 + near_x**2) / (2 * 2.5**2)) + 0.2 * x / width + 0.1 * y / height
    image[(x // 16 + y // 16) % 11 == 0] = 0
    return image.astype(np.float32)


def noise_image(height, width):
    return np.random.default_rng(31).exponential(1.0, (height, width)).astype(np.float32)


def drawn_phase(context, grid, seed=32, field="circular_gaussian"):
    state = clspeckle.Phase(
        (grid.height, grid.width),
        oversampling=grid.oversampling,
        guard_px=grid.guard_px,
        field=field,
        seed=seed,
        context=context,
    )
    state.refresh(0)
    return state


def make(context, grid, **options):
    return clspeckle.Aperture(
        (grid.height, grid.width),
        oversampling=grid.oversampling,
        guard_px=grid.guard_px,
        context=context,
        **options,
    )


def relative_error(got, expected):
    return float(np.linalg.norm(got - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize(
    "size",
    [
        pytest.param((h, w), id=f"{h}x{w}", marks=[pytest.mark.large] if h * w > 500_000 else [])
        for h, w in CAMERA_SIZES
    ],
)
def test_intensity_of_camera_sizes(context, measured, size):
    """Relative L2 error below 2e-6 for p in {0, 0.5, 1} and D in {0.1, 0.5, 1} (measured 2.2e-7 to 3.3e-7 on PoCL),
    the pupil exactly that of the integer rule. One FFT plan per size serves all nine."""
    height, width = size
    grid = phase.FieldGrid(width, height)
    state = drawn_phase(context, grid)
    irradiance = dots(height, width)
    spectra = [aperture.spectrum(grid, irradiance, state.field(k)) for k in (0, 1)]
    for diameter in (0.1, 0.5, 1.0):
        pupil = aperture.circle_pupil(grid, diameter)
        images = [aperture.filtered_intensity(grid, spectrum, pupil) for spectrum in spectra]
        for p in (0.0, 0.5, 1.0):
            stage = make(context, grid, relative_diameter=diameter, degree_of_polarization=p)
            error = relative_error(stage.intensity(state, irradiance), aperture.polarized_sum(*images, p))
            measured("relative L2 error", error)
            assert error < BOUND
        assert np.array_equal(stage.pupil(), pupil)


SMALL = [
    # height, width, oversampling, guard_px, D: square, odd, thin, padded (17, 29, 53), guard, oversampled
    (64, 64, 1, 0, 0.5),
    (33, 55, 1, 0, 0.5),
    (55, 33, 1, 0, 1.0),
    (1, 64, 1, 0, 0.9),
    (64, 1, 1, 0, 0.9),
    (7, 7, 1, 0, 0.7),
    (1, 1, 1, 0, 0.5),
    (17, 29, 1, 0, 0.5),
    (53, 34, 1, 0, 0.8),
    (19, 17, 1, 3, 1.0),
    (60, 50, 1, 4, 0.4),
    (17, 19, 2, 5, 1.7),
    (48, 64, 2, 0, 2.0),
    (48, 64, 2, 8, 1.2),
    (29, 53, 3, 1, 2.2),
    (24, 20, 3, 0, 3.0),
]


@pytest.mark.parametrize("case", SMALL, ids=["{}x{} s{} guard{} D{}".format(*case) for case in SMALL])
def test_intensity_of_small_sizes(context, measured, case):
    height, width, oversampling, guard_px, diameter = case
    grid = phase.FieldGrid(width, height, oversampling, guard_px)
    for field in ("circular_gaussian", "unit_phasor"):
        state = drawn_phase(context, grid, field=field)
        fields = [state.field(k) for k in (0, 1)]
        pupil = aperture.circle_pupil(grid, diameter)
        for p in (0.0, 0.3, 1.0):
            stage = make(context, grid, relative_diameter=diameter, degree_of_polarization=p)
            for irradiance in (noise_image(height, width), dots(height, width) + np.float32(0.01)):
                expected = aperture.intensity(grid, irradiance, fields, pupil, p)
                error = relative_error(stage.intensity(state, irradiance), expected)
                measured("relative L2 error", error)
                assert error < BOUND


def test_whole_library_path_from_the_seed(context):
    """The same with the reference's own z instead of the library's."""
    grid = phase.FieldGrid(80, 60, 2, 3)
    state = drawn_phase(context, grid, seed=77)
    expected_state = phase.PhaseState(grid, seed=77)
    expected_state.refresh(0)
    irradiance = dots(60, 80)
    stage = make(context, grid, relative_diameter=1.5, degree_of_polarization=0.4)
    expected = aperture.intensity(
        grid, irradiance, [expected_state.field(k) for k in (0, 1)], aperture.circle_pupil(grid, 1.5), 0.4
    )
    assert relative_error(stage.intensity(state, irradiance), expected) < BOUND


DIAMETERS = [0.01, 0.1, 0.3, 0.5, 0.6, 0.8, 0.9999999, 1.0]


@pytest.mark.parametrize(
    "size", [(64, 64), (120, 160), (33, 55), (100, 100), pytest.param((1080, 1920), marks=pytest.mark.large)]
)
def test_pupil_samples_are_those_of_the_integer_rule(context, size):
    """Rim ties included: 3-4-5 triangles at 100 x 100 and 120 x 160, D = 0.5, 1."""
    height, width = size
    grid = phase.FieldGrid(width, height)
    for diameter in DIAMETERS:
        expected = aperture.circle_pupil(grid, diameter)
        stage = make(context, grid, relative_diameter=diameter)
        assert np.array_equal(stage.pupil(), expected)
        assert stage.info().pupil_samples == np.count_nonzero(expected)
        assert stage.info().mean_transmission == pytest.approx(aperture.mean_transmission(expected), rel=1e-12)


def test_pupil_rim_is_out(context):
    """At 100 x 100 and D = 1 the rim goes through (30, 40): a triangle of sides 30, 40, 50 ends exactly on it."""
    pupil = make(context, phase.FieldGrid(100, 100), relative_diameter=1.0).pupil()
    assert pupil[30, 40] == 0
    assert pupil[30, 39] == 1
    assert pupil[50, 0] == 0  # the Nyquist frequency
    assert pupil[49, 0] == 1


@pytest.mark.parametrize(("oversampling", "diameter"), [(2, 1.3), (3, 0.7), (3, 2.5)])
def test_oversampled_pupil(context, oversampling, diameter):
    grid = phase.FieldGrid(40, 30, oversampling, 2)
    assert np.array_equal(
        make(context, grid, relative_diameter=diameter).pupil(), aperture.circle_pupil(grid, diameter)
    )


def over_pixels(samples, oversampling, side):
    """Band-limited, periodic samples integrated over squares of `side` pixels around the pixels' centres, which lie
    (oversampling - 1) / 2 samples beyond their first ones: exact, by the Fourier transform."""
    spectrum = np.fft.fft2(samples)
    for axis, count in enumerate(samples.shape):
        f = np.fft.fftfreq(count)  # cycles per sample
        transfer = np.sinc(side * oversampling * f) * np.exp(1j * np.pi * f * (oversampling - 1))
        spectrum *= transfer[:, None] if axis == 0 else transfer
    return np.fft.ifft2(spectrum).real[::oversampling, ::oversampling]


@pytest.mark.parametrize("fill_factor", [0.25, 0.8, 1.0])
@pytest.mark.parametrize(("oversampling", "diameter"), [(1, 0.3), (2, 0.55), (3, 0.8), (4, 1.1)])
@pytest.mark.parametrize("degree_of_polarization", [0.3, 1.0])
def test_light_over_a_pixels_area(context, measured, fill_factor, oversampling, diameter, degree_of_polarization):
    """Everywhere, also where the area's samples lie beyond the border: the field is periodic. The taps come near the
    exact integral (the largest error of a pixel, measured 3e-6 to 1.7e-3 of the mean for pupils of 0.27 to 0.3 cycles
    per sample; wider ones are nearer to the end of what 7 or 8 taps can do). A border that is read wrong is off by
    the mean itself."""
    grid = phase.FieldGrid(36, 30, oversampling)
    state = drawn_phase(context, grid)
    irradiance = np.ones((30, 36), np.float32)
    pupil = aperture.circle_pupil(grid, diameter)
    images = [np.abs(np.fft.ifft2(aperture.spectrum(grid, irradiance, state.field(k)) * pupil)) ** 2 for k in (0, 1)]
    p = degree_of_polarization
    expected = over_pixels((1 + p) / 2 * images[0] + (1 - p) / 2 * images[1], oversampling, np.sqrt(fill_factor))
    stage = make(context, grid, relative_diameter=diameter, degree_of_polarization=p, fill_factor=fill_factor)
    assert (stage.info().grid_width, stage.info().grid_height) == (36 * oversampling, 30 * oversampling)
    error = float(np.abs(stage.intensity(state, irradiance) - expected).max() / expected.mean())
    measured("largest error", error)
    assert error < 2.5e-3


def test_relative_diameter_from_the_lens(context):
    """D = pixel_pitch / (wavelength f_number): 2.9 um at 940 nm and f/8 is 0.386."""
    grid = phase.FieldGrid(64, 64)
    stage = make(context, grid, f_number=8.0, pixel_pitch_m=2.9e-6, wavelength_m=940e-9)
    expected = aperture.relative_diameter(8.0, 2.9e-6, 940e-9)
    assert expected == pytest.approx(0.3856, abs=1e-4)
    assert stage.info().relative_diameter == pytest.approx(expected, rel=1e-15)
    assert np.array_equal(stage.pupil(), aperture.circle_pupil(grid, expected))


@pytest.mark.parametrize("soft_rim", [0.01, 0.2, 0.7, 1.0])
@pytest.mark.parametrize("case", [(48, 64, 1, 0, 0.6), (33, 55, 1, 2, 1.0), (30, 20, 2, 0, 1.5)])
def test_soft_rim(context, measured, case, soft_rim):
    height, width, oversampling, guard_px, diameter = case
    grid = phase.FieldGrid(width, height, oversampling, guard_px)
    stage = make(context, grid, relative_diameter=diameter, soft_rim=soft_rim)
    expected = aperture.circle_pupil(grid, diameter, soft_rim)
    got = stage.pupil()
    measured("error of the pupil", np.abs(got - expected).max())
    assert np.abs(got - expected).max() < 1e-6
    assert stage.info().mean_transmission == pytest.approx(aperture.mean_transmission(expected), rel=1e-6)
    state = drawn_phase(context, grid)
    irradiance = noise_image(height, width)
    expected_image = aperture.intensity(grid, irradiance, [state.field(0)], expected)
    assert relative_error(stage.intensity(state, irradiance), expected_image) < BOUND


PUPIL_IMAGES = {
    "one_texel": np.ones((1, 1)),
    "two_texels": np.array([[0.25, 1.0]]),
    "column": np.linspace(0, 1, 7)[:, None],
    "random": np.random.default_rng(33).random((9, 13)),
    "asymmetric": np.tri(16, 12),
    "fine": np.random.default_rng(34).random((300, 200)),
}


@pytest.mark.parametrize("name", PUPIL_IMAGES)
@pytest.mark.parametrize("case", [(48, 64, 1, 0, 0.6), (33, 55, 1, 2, 1.0), (30, 20, 2, 0, 1.5)])
def test_pupil_image(context, measured, case, name):
    """Any shape of pupil; an image of one texel is a square, and rows and columns keep their sense (x to the right, y
    down)."""
    height, width, oversampling, guard_px, diameter = case
    grid = phase.FieldGrid(width, height, oversampling, guard_px)
    image = PUPIL_IMAGES[name].astype(np.float32)
    stage = make(context, grid, relative_diameter=diameter, pupil_image=image)
    expected = aperture.image_pupil(grid, diameter, image)
    got = stage.pupil()
    measured("error of the pupil", np.abs(got - expected).max())
    assert np.abs(got - expected).max() < 1e-6
    assert stage.info().mean_transmission == pytest.approx(aperture.mean_transmission(expected), rel=1e-6)
    state = drawn_phase(context, grid)
    irradiance = noise_image(height, width)
    expected_image = aperture.intensity(grid, irradiance, [state.field(0)], expected)
    assert relative_error(stage.intensity(state, irradiance), expected_image) < BOUND


@pytest.mark.parametrize(
    "options",
    [{}, {"soft_rim": 0.5}, {"pupil_image": PUPIL_IMAGES["random"].astype(np.float32)}],
    ids=["circle", "soft", "image"],
)
def test_unit_mean_normalization(context, options):
    """The pupil scaled so that the mean of |P|^2 is 1; info still has the transmission before that."""
    grid = phase.FieldGrid(64, 48, 1, 3)
    stage = make(context, grid, relative_diameter=0.6, normalization="unit_mean", degree_of_polarization=0.5, **options)
    plain = (
        aperture.image_pupil(grid, 0.6, options["pupil_image"])
        if "pupil_image" in options
        else aperture.circle_pupil(grid, 0.6, options.get("soft_rim", 0))
    )
    expected = aperture.unit_mean(plain)
    assert np.abs(stage.pupil() - expected).max() < 1e-6 * expected.max()
    assert np.mean(stage.pupil().astype(np.float64) ** 2) == pytest.approx(1, rel=1e-6)
    assert stage.info().mean_transmission == pytest.approx(aperture.mean_transmission(plain), rel=1e-6)
    state = drawn_phase(context, grid)
    irradiance = noise_image(48, 64)
    expected_image = aperture.intensity(grid, irradiance, [state.field(0), state.field(1)], expected, 0.5)
    assert relative_error(stage.intensity(state, irradiance), expected_image) < BOUND


def test_bad_pixels_count_as_dark(context):
    grid = phase.FieldGrid(32, 32)
    state = drawn_phase(context, grid)
    irradiance = noise_image(32, 32)
    bad = irradiance.copy()
    bad[3, 4], bad[5, 6], bad[7, 8], bad[9, 10] = np.nan, np.inf, -np.inf, -1
    dark = irradiance.copy()
    for y, x in ((3, 4), (5, 6), (7, 8), (9, 10)):
        dark[y, x] = 0
    stage = make(context, grid, relative_diameter=0.5)
    image = clspeckle.DeviceImage.from_array(bad, context=context)
    out = clspeckle.DeviceImage((32, 32), np.float32, context=context)
    stage.enqueue_intensity(state, image, out).wait()
    assert np.array_equal(out.read(), stage.intensity(state, dark))


def test_dark_image(context):
    grid = phase.FieldGrid(33, 20, 1, 2)
    stage = make(context, grid, relative_diameter=0.5, degree_of_polarization=0.5)
    assert not np.any(stage.intensity(drawn_phase(context, grid), np.zeros((20, 33), np.float32)))


def test_scales_with_the_irradiance(context):
    """I is linear in I0 over the range of the sensor's units; powers of four leave the bits alone."""
    grid = phase.FieldGrid(64, 64)
    state = drawn_phase(context, grid)
    stage = make(context, grid, relative_diameter=0.5)
    irradiance = noise_image(64, 64)
    one = stage.intensity(state, irradiance)
    for factor in (np.float32(4.0**-20), np.float32(4.0**20)):
        assert np.array_equal(stage.intensity(state, irradiance * factor), one * factor)
