"""The effects that a pipeline carries out itself, against closed forms and the float64 reference.

Frames of 256 x 256 pixels at D = 0.386: some 7,600 independent speckles each. The contrast of n of them has a relative
standard error of about 1.5 / sqrt(7,600 n) for exponential statistics (sqrt(2) for exponential, more for the noise of
the mean; measured over seeds 1.3): 0.54 % for 10 frames. Bounds are 4 standard errors (size 6e-5 for each test), and
what is off by 4 % is found with a power of 0.99. Seeds are fixed.
"""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.ndimage

from reference import emva1288, theory

SIZE = 256
SHAPE = (SIZE, SIZE)
DIAMETER = 2.9e-6 / (940e-9 * 8)
FRAMES = 10
BOUND = 4 * 1.5 / np.sqrt(7600 * FRAMES)


def camera(context, **parameters):
    options = {"f_number": 8.0, "normalization": "unit_mean", "output": "intensity", "seed": 5} | parameters
    return clspeckle.Pipeline.from_parameters(SHAPE, context=context, **options)


def moving(pipeline, count=FRAMES, scene=None):
    flat = np.ones(SHAPE, np.float32) if scene is None else scene
    return np.stack([pipeline.render(flat, refresh="all", frame_index=i) for i in range(count)]).astype(np.float64)


def resting(pipeline, count, scene=None):
    flat = np.ones(SHAPE, np.float32) if scene is None else scene
    return np.stack(
        [pipeline.render(flat, refresh="all" if i == 0 else None, frame_index=i) for i in range(count)]
    ).astype(np.float64)


def contrast(frames):
    return np.std(frames) / np.mean(frames)


def knot_correlation(path):
    d = np.minimum(0.9386677132131623 * path, 2.0)
    return (1 - d / 2) * np.cos(np.pi * d / 2) + np.sin(np.pi * d / 2) / np.pi


# --- Laser ---


def heights_in_a_grain(pipeline):
    """How many samples, each with a height of its own, an image point sums: (sum |psf|^2)^2 / sum |psf|^4."""
    spread = np.abs(np.fft.ifft2(pipeline.aperture.pupil().astype(np.float64))) ** 2
    return np.sum(spread) ** 2 / np.sum(spread**2)


@pytest.mark.parametrize("dephasing", [0.5, 1.2])
def test_lines_of_the_laser(context, measured, dephasing):
    offsets = np.arange(-2, 3)  # of the catalogue
    pipeline = camera(context, effects={"linewidth": {"dephasing_rad": dephasing}})
    expected = theory.lines_contrast(offsets, np.exp(-(offsets**2) / 2), dephasing, heights_in_a_grain(pipeline))
    frames = moving(pipeline)
    measured("relative error", abs(contrast(frames) / expected - 1))
    assert contrast(frames) == pytest.approx(expected, rel=BOUND)
    assert frames.mean() == pytest.approx(1, abs=BOUND)


@pytest.mark.parametrize("lines", [2, 3, 6])
def test_number_of_lines(context, lines):
    """Far apart, M lines are M independent patterns, 1/sqrt(M) for equal weights, as far as the heights in a grain
    go."""
    offsets = np.linspace(-2, 2, lines)
    weights = np.exp(-(offsets**2) / 2)
    coarse = camera(context, line_count=lines, dephasing_rad=9.0)
    expected = theory.lines_contrast(offsets, weights, 9.0, heights_in_a_grain(coarse))
    assert contrast(moving(coarse)) == pytest.approx(expected, rel=BOUND)
    # Four times as many heights come nearer to the limit of very many.
    fine = camera(context, line_count=lines, dephasing_rad=9.0, oversampling=2, fill_factor=1e-4)
    limit = theory.lines_contrast(offsets, weights, 9.0)
    assert limit < theory.lines_contrast(offsets, weights, 9.0, heights_in_a_grain(fine)) < expected
    assert contrast(moving(fine)) < contrast(moving(coarse))
    if lines == 2:
        assert limit == pytest.approx(1 / np.sqrt(2), rel=1e-6)


def test_lines_see_one_surface(context):
    """A scene at rest keeps its heights: all frames are the same. One drawn anew has others."""
    frames = resting(camera(context, effects={"linewidth": {"dephasing_rad": 1.0}}), 3)
    np.testing.assert_array_equal(frames[0], frames[2])


def test_power_flicker(context):
    """One factor a frame; 64 normal numbers: the standard deviation is known to 8.8 %, three of which are allowed."""
    still = resting(camera(context), 1)[0]
    frames = resting(camera(context, effects={"power_flicker": {"sigma": 0.1}}), 64)
    factors = frames.mean(axis=(1, 2)) / still.mean()
    np.testing.assert_allclose(frames, factors[:, None, None] * still, rtol=2e-5, atol=1e-6)
    assert np.std(factors, ddof=1) == pytest.approx(0.1, rel=0.27)
    assert np.mean(factors) == pytest.approx(1, abs=4 * 0.1 / 8)


# --- Surface ---


@pytest.mark.parametrize(("coherent", "oversampling"), [(0.1, 1), (0.5, 1), (1.0, 1), (0.5, 2), (0.3, 3)])
def test_low_roughness(context, measured, coherent, oversampling):
    """With unit mean the pupil multiplies a constant field by the inverse of its root mean square, 1/sqrt(T), so the
    specular part is c/T times the ideal image against 1 - c of speckle."""
    # A pixel of next to no area, so that the contrast is that of a point.
    point = {"oversampling": oversampling, "fill_factor": 1e-4} if oversampling > 1 else {}
    pipeline = camera(context, effects={"low_roughness": {"coherent_fraction": coherent}}, **point)
    transmission = pipeline.aperture.info().mean_transmission
    assert transmission == pytest.approx(np.pi / 4 * DIAMETER**2, rel=0.02)
    frames = moving(pipeline)
    specular, speckle = coherent / transmission, 1 - coherent
    assert frames.mean() == pytest.approx(specular + speckle, rel=2 * BOUND)
    expected = theory.rician_contrast(specular / speckle) if speckle > 0 else 0.0
    measured("contrast error", abs(contrast(frames) - expected))
    assert contrast(frames) == pytest.approx(expected, rel=3 * BOUND, abs=1e-5)


def test_roughness_of_a_material(context):
    """4 pi h / wavelength of phase: c = exp(-(that)^2), for each pixel's own material."""
    wavelength = 940e-9
    height = 60e-9
    c = np.exp(-((4 * np.pi * height / wavelength) ** 2))
    assert 0.4 < c < 0.6
    pipeline = camera(
        context,
        materials=[clspeckle.Material(), clspeckle.Material(roughness_rms_m=height)],
        wavelength_m=wavelength,
    )
    material = np.zeros(SHAPE, np.uint8)
    material[:, SIZE // 2 :] = 1
    flat = np.ones(SHAPE, np.float32)
    frames = np.stack(
        [pipeline.render(flat, refresh="all", material=material, frame_index=i) for i in range(FRAMES)]
    ).astype(np.float64)
    margin = 16  # the coherent part is filtered by the lens, too
    rough, smooth = frames[:, :, margin : SIZE // 2 - margin], frames[:, :, SIZE // 2 + margin : -margin]
    transmission = pipeline.aperture.info().mean_transmission
    assert contrast(rough) == pytest.approx(1, rel=3 * BOUND)
    # The edge of the coherent half rings: its mean over the half is that of a low-passed step, known to 2 %.
    expected = theory.rician_contrast(c / transmission / (1 - c))
    assert contrast(smooth) == pytest.approx(expected, rel=0.1)
    assert smooth.mean() == pytest.approx(c / transmission + 1 - c, rel=0.03)


def test_polarization_of_materials(context, measured):
    degrees = [0.0, 0.5, 1.0]
    pipeline = camera(context, materials=[clspeckle.Material(degree_of_polarization=p) for p in degrees])
    material = np.repeat(np.arange(3, dtype=np.uint8), 86)[:SIZE][None, :].repeat(SIZE, 0)
    flat = np.ones(SHAPE, np.float32)
    frames = np.stack(
        [pipeline.render(flat, refresh="all", material=material, frame_index=i) for i in range(3 * FRAMES)]
    ).astype(np.float64)
    for i, p in enumerate(degrees):
        part = frames[:, :, 86 * i + 8 : 86 * (i + 1) - 12]
        measured("relative error", abs(contrast(part) / theory.contrast(p) - 1))
        assert contrast(part) == pytest.approx(theory.contrast(p), rel=BOUND * 1.3)
        assert part.mean() == pytest.approx(1, abs=BOUND * 1.3)


def test_one_material_with_the_apertures_polarization_is_no_material(context):
    """The weights before the lens or behind it: the same numbers up to rounding."""
    flat = np.ones(SHAPE, np.float32)
    plain = camera(context, degree_of_polarization=0.3).render(flat)
    table = camera(context, degree_of_polarization=0.3, materials=[clspeckle.Material()])
    np.testing.assert_allclose(table.render(flat, material=np.zeros(SHAPE, np.uint8)), plain, rtol=1e-4, atol=1e-5)


def expected_mean(pipeline, irradiance):
    """E I = |psf|^2 * I0, by float64 transforms: what independent phases leave of an image."""
    pupil = pipeline.aperture.pupil().astype(np.complex128)
    spread = np.abs(np.fft.ifft2(pupil)) ** 2
    return np.fft.ifft2(np.fft.fft2(irradiance) * np.fft.fft2(spread)).real


def spots():
    scene = np.zeros(SHAPE, np.float32)
    scene[24::48, 24::48] = 1.0
    return scipy.ndimage.gaussian_filter(scene, 2.0) * 25 + 0.02


def test_subsurface_scattering(context, measured):
    """Averaged over 150 frames, speckle of contrast 1 leaves 8 % of noise a pixel; over nine spots 2.7 %."""
    scene = spots().astype(np.float32)
    length, fraction = 3.0, 0.6
    pipeline = camera(context, effects={"subsurface_scattering": {"length_px": length, "fraction": fraction}})
    y, x = np.indices(SHAPE)
    r = np.hypot(np.minimum(x, SIZE - x), np.minimum(y, SIZE - y))
    kernel = np.exp(-r / length)
    kernel /= kernel.sum()
    spread = (1 - fraction) * scene + fraction * np.fft.ifft2(np.fft.fft2(scene) * np.fft.fft2(kernel)).real
    average = moving(pipeline, 150, scene).mean(axis=0)
    expected = expected_mean(pipeline, spread)

    def spot(image):
        return np.mean(
            [
                image[24 + 48 * j - 12 : 24 + 48 * j + 13, 24 + 48 * i - 12 : 24 + 48 * i + 13]
                for j in range(1, 4)
                for i in range(1, 4)
            ],
            axis=0,
        )

    error = np.abs(spot(average) - spot(expected)).max() / spot(expected).max()
    measured("largest error over the peak", error)
    assert error < 0.1
    without = np.abs(spot(average) - spot(expected_mean(pipeline, scene))).max() / spot(expected).max()
    assert without > 0.2, "the effect would be seen if it were missing"
    assert average.mean() == pytest.approx(scene.mean(), rel=0.02)


def test_subsurface_fraction_of_a_material_keeps_the_light(context):
    scene = spots().astype(np.float32)
    pipeline = camera(
        context,
        materials=[clspeckle.Material(), clspeckle.Material(subsurface_fraction=0.8)],
        subsurface_length_px=3.0,
    )
    material = np.zeros(SHAPE, np.uint8)
    material[:, SIZE // 2 :] = 1
    frames = np.mean(
        [pipeline.render(scene, refresh="all", material=material, frame_index=i) for i in range(100)],
        axis=0,
        dtype=np.float64,
    )
    assert frames.mean() == pytest.approx(scene.mean(), rel=0.02)
    # Away from the border between them, spots of the first material are as they were, those of the second flat.
    expected = expected_mean(pipeline, scene)
    sharp, soft = frames[24::48, 24:100:48], frames[24::48, 168::48]
    assert sharp.mean() == pytest.approx(expected[24::48, 24:100:48].mean(), rel=0.1)
    assert soft.mean() < 0.5 * expected[24::48, 168::48].mean()


# --- Motion ---


@pytest.mark.parametrize("path", [0.4, 1.66, 2.5])
@pytest.mark.parametrize("dynamics", ["replace", "continuous"])
def test_exposure_path(context, measured, path, dynamics):
    correlation = knot_correlation if dynamics == "continuous" else lambda lags: np.exp(-lags)
    expected = theory.exposure_contrast(path, correlation)
    frames = moving(camera(context, exposure_path=path, dynamics=dynamics))
    measured("relative error", abs(contrast(frames) / expected - 1))
    assert contrast(frames) == pytest.approx(expected, rel=BOUND)
    assert frames.mean() == pytest.approx(1, abs=BOUND)


@pytest.mark.parametrize("path", [0.4, 1.4, 2.5, 6.0])
@pytest.mark.parametrize("dynamics", ["replace", "continuous"])
def test_exposure_of_a_gaussian_correlation(context, measured, path, dynamics):
    expected = theory.exposure_contrast(path, lambda lags: np.exp(-(lags**2)))
    frames = moving(camera(context, exposure_path=path, exposure_correlation="gaussian", dynamics=dynamics))
    measured("relative error", abs(contrast(frames) / expected - 1))
    assert contrast(frames) == pytest.approx(expected, rel=BOUND)
    assert abs(expected / theory.exposure_contrast(path, lambda lags: np.exp(-lags)) - 1) > 0.05
    assert frames.mean() == pytest.approx(1, abs=BOUND)


def test_frames_of_a_moving_exposure_are_independent(context):
    """Correlation of 65,536 pixels, 7,600 independent: standard error 0.011; four of them."""
    frames = moving(camera(context, effects={"motion_decorrelation": {"lags": 2.5}}), 4)
    for i in range(3):
        assert abs(np.corrcoef(frames[i].ravel(), frames[i + 1].ravel())[0, 1]) < 0.046


def test_surface_boiling(context, measured):
    """Intensity correlation exp(-2 k / tau) after k frames; its standard error over 20 starts is about 0.004."""
    tau = 6.0
    pipeline = camera(context, effects={"surface_boiling": {"correlation_frames": tau}})
    flat = np.ones(SHAPE, np.float32)
    lags = (1, 3, 6, 12)
    sums = dict.fromkeys(lags, 0.0)
    for start in range(FRAMES):
        frames = [
            pipeline.render(flat, refresh="all" if k == 0 else None, frame_index=100 * start + k).astype(np.float64)
            for k in range(13)
        ]
        for k in lags:
            sums[k] += np.mean((frames[0] - 1) * (frames[k] - 1)) / FRAMES
    for k, value in sums.items():
        measured("error of the correlation", abs(value - np.exp(-2 * k / tau)))
        assert value == pytest.approx(np.exp(-2 * k / tau), abs=0.02)


def test_vibration_shifts_the_picture(context, measured):
    """Below D = 1/2 the sampled intensity is not aliased, so the shifted picture is known by a Fourier shift. 60 shifts
    along two axes: their root mean square is known to 6.5 %; three of that are allowed."""
    rms = 0.3
    still = resting(camera(context), 1)[0]
    frames = resting(camera(context, effects={"vibration": {"rms_px": rms}}), 61)
    np.testing.assert_array_equal(frames[0], still)
    spectrum = np.fft.fft2(still)
    f = np.fft.fftfreq(SIZE)
    power = np.abs(spectrum) ** 2
    shifts = []
    for frame in frames[1:]:
        # Least squares of the phase over the low frequencies, where it does not wrap.
        cross = np.angle(np.fft.fft2(frame) * np.conj(spectrum))
        low = (np.abs(f)[:, None] < 0.1) & (np.abs(f)[None, :] < 0.1)
        weight = power[low]
        fx, fy = np.broadcast_to(f[None, :], SHAPE)[low], np.broadcast_to(f[:, None], SHAPE)[low]
        a = np.stack([fx, fy], axis=1) * (-2 * np.pi)
        shift = np.linalg.solve(a.T @ (a * weight[:, None]), a.T @ (weight * cross[low]))
        shifts.append(shift)
        moved = np.fft.ifft2(spectrum * np.exp(-2j * np.pi * (f[None, :] * shift[0] + f[:, None] * shift[1]))).real
        error = np.abs(moved - frame).max() / still.max()
        measured("error against a Fourier shift, over the peak", error)
        assert error < 1e-4
    assert np.sqrt(np.mean(np.square(shifts))) == pytest.approx(rms, rel=0.2)


def test_airflow_bends_a_resting_picture_only(context):
    """More air, less correlation with the first frame; the mean and the contrast stay: a phase does not change them."""
    flat = np.ones(SHAPE, np.float32)
    still = resting(camera(context), 1)[0]
    correlations = []
    for rms in (0.25, 0.8):
        pipeline = camera(context, effects={"airflow": {"rms_rad": rms, "scale_px": 6.0}})
        frames = resting(pipeline, 6)
        np.testing.assert_array_equal(frames[0], still)
        np.testing.assert_array_equal(pipeline.render(flat, refresh="all", frame_index=0), still)
        correlations.append(np.mean([np.corrcoef(still.ravel(), f.ravel())[0, 1] for f in frames[1:]]))
        assert contrast(frames[1:]) == pytest.approx(1, rel=0.08)
        assert frames.mean() == pytest.approx(1, abs=0.05)
    assert 1 > correlations[0] > correlations[1] > 0


# --- Optics and pixels ---


@pytest.mark.parametrize("oversampling", [1, 2, 3])
@pytest.mark.parametrize("fill_factor", [0.5, 1.0])
def test_pixel_integration(context, measured, oversampling, fill_factor):
    expected = theory.area_contrast(DIAMETER, fill_factor)
    frames = moving(camera(context, oversampling=oversampling, fill_factor=fill_factor))
    measured("relative error", abs(contrast(frames) / expected - 1))
    assert contrast(frames) == pytest.approx(expected, rel=BOUND)
    assert frames.mean() == pytest.approx(1, abs=BOUND)


def test_pixel_integration_does_not_depend_on_the_oversampling(context):
    """The transfer function of the weights, seen on spots of known shape: mean frames of incoherent sums agree."""
    means = [
        moving(camera(context, oversampling=s, fill_factor=1.0), 100, spots().astype(np.float32)).mean(axis=0)
        for s in (1, 3)
    ]

    def spot(image):
        return np.mean(
            [
                image[24 + 48 * j - 8 : 24 + 48 * j + 9, 24 + 48 * i - 8 : 24 + 48 * i + 9]
                for j in range(5)
                for i in range(5)
            ],
            axis=0,
        )

    assert np.abs(spot(means[0]) - spot(means[1])).max() < 0.12 * spot(means[0]).max()


def test_obstruction_and_mismatch_change_the_grain(context):
    """Half width of the intensity's correlation: a larger f-number widens the grain in proportion."""

    def correlation_at(frames, lag):
        return np.mean((frames[:, :, lag:] - 1) * (frames[:, :, : SIZE - lag] - 1))

    ratio = 1.3
    plain = moving(camera(context, effects={"aperture_mismatch": {"f_number_ratio": ratio}}))
    for lag in (1, 2, 3):
        expected = theory.airy_autocovariance(np.array(lag), DIAMETER / ratio)
        assert correlation_at(plain, lag) == pytest.approx(expected, abs=0.02)
    ring = moving(camera(context, effects={"pupil_obstruction": {"radius_ratio": 0.5}}))
    pupil = camera(context, effects={"pupil_obstruction": {"radius_ratio": 0.5}}).aperture.pupil()
    mu = theory.field_correlation(pupil.astype(np.float64))
    for lag in (1, 2, 3):
        assert correlation_at(ring, lag) == pytest.approx(abs(mu[0, lag]) ** 2, abs=0.02)
        assert abs(abs(mu[0, lag]) ** 2 - theory.airy_autocovariance(np.array(lag), DIAMETER)) > 0.02 or lag == 1


def test_defocus_leaves_the_grain_and_widens_the_spots(context):
    effects = {"defocus": {"waves": 1.0}}
    frames = moving(camera(context, effects=effects))
    assert contrast(frames) == pytest.approx(1, rel=BOUND)
    lagged = np.mean((frames[:, :, 2:] - 1) * (frames[:, :, :-2] - 1))
    assert lagged == pytest.approx(theory.airy_autocovariance(np.array(2), DIAMETER), abs=0.02)
    scene = spots().astype(np.float32)
    pipeline = camera(context, effects=effects)
    average = moving(pipeline, 100, scene).mean(axis=0)
    expected = expected_mean(pipeline, scene)
    sharp = expected_mean(camera(context), scene)
    assert average[24::48, 24::48].mean() == pytest.approx(expected[24::48, 24::48].mean(), rel=0.06)
    assert expected[24::48, 24::48].mean() < 0.8 * sharp[24::48, 24::48].mean()


def test_distortion_moves_light_materials_and_masks_alike(context):
    """A bright square of its own material off the axis: where its light is, its polarization is."""
    pipeline = camera(
        context,
        materials=[clspeckle.Material(degree_of_polarization=1.0), clspeckle.Material(degree_of_polarization=0.0)],
        effects={"lens_distortion": {"k1": 0.2}},
    )
    scene = np.full(SHAPE, 0.2, np.float32)
    material = np.zeros(SHAPE, np.uint8)
    scene[180:230, 180:230], material[180:230, 180:230] = 1.0, 1
    frames = np.stack(
        [pipeline.render(scene, refresh="all", material=material, frame_index=i) for i in range(100)]
    ).astype(np.float64)
    mean = scipy.ndimage.gaussian_filter(frames.mean(axis=0), 1.0)
    cutoff = mean > 0.6
    y, x = np.nonzero(cutoff)
    centre = np.array([x.mean(), y.mean()])
    # Where the square should be: ideal radius from distorted radius by fixed-point iteration, r = 1 at the corner.
    middle = (SIZE - 1) / 2
    v, u = (np.indices(SHAPE) - middle) / (np.sqrt(2) * middle)
    scale = np.ones(SHAPE)
    for _ in range(50):
        scale = 1 / (1 + 0.2 * (u**2 + v**2) * scale**2)
    ideal_x, ideal_y = middle + (u * scale) * np.sqrt(2) * middle, middle + (v * scale) * np.sqrt(2) * middle
    there = (ideal_x > 179.5) & (ideal_x < 229.5) & (ideal_y > 179.5) & (ideal_y < 229.5)
    expected_y, expected_x = np.nonzero(there)
    assert centre == pytest.approx([expected_x.mean(), expected_y.mean()], abs=0.5)
    assert abs(expected_x.mean() - 204.5) > 5
    inside = scipy.ndimage.binary_erosion(cutoff, iterations=6)
    outside = ~scipy.ndimage.binary_dilation(cutoff, iterations=8)
    inner = np.sqrt(np.mean(np.var(frames[:, inside], axis=0))) / frames[:, inside].mean()
    outer = np.sqrt(np.mean(np.var(frames[:, outside], axis=0))) / frames[:, outside].mean()
    assert inner == pytest.approx(theory.contrast(0.0), rel=0.03)
    assert outer == pytest.approx(1.0, rel=0.03)


# --- Light that is not the laser's ---


def test_incoherent_light_has_no_speckle(context):
    scene = np.random.default_rng(3).random(SHAPE, np.float32)
    pipeline = camera(context, effects={"power_flicker": {"sigma": 0.1}, "linewidth": {}})
    np.testing.assert_array_equal(pipeline.render(scene, illumination="incoherent"), scene)
    through = camera(context, normalization="transmission")
    np.testing.assert_allclose(
        through.render(scene, illumination="incoherent"),
        scene * through.aperture.info().mean_transmission,
        rtol=1e-6,
    )


def test_dark_frames_have_no_light(context):
    pipeline = clspeckle.Pipeline.from_parameters(
        SHAPE,
        context=context,
        black_level_dn=64.0,
        read_noise_dn=0.0,
        effects={"ambient_light": {"level_dn": 40.0}, "vignetting": {}, "glare": {}},
    )
    flat = np.ones(SHAPE, np.float32)
    assert (pipeline.render(illumination="dark") == 64).all()
    lit = pipeline.render(0 * flat, illumination="incoherent")
    assert lit.max() == 104 and lit.min() < 95, "ambient light, vignetted"


# --- A resting scene's noise is the sensor's alone ---


def test_averaging_frames_of_a_scene_at_rest(context, measured):
    """Thesis 3.2.3: sigma = 0.015 of full scale, 0.005 after 9 frames. 65,536 pixels: standard errors of 0.3 %."""
    full = 1023
    pipeline = clspeckle.Pipeline.from_parameters(
        SHAPE,
        context=context,
        f_number=8.0,
        normalization="unit_mean",
        exposure_gain_dn=150.0,
        read_noise_dn=0.015 * full,
        seed=8,
    )
    flat = np.ones(SHAPE, np.float32)
    frames = np.stack([pipeline.render(flat, frame_index=i) for i in range(180)]).astype(np.float64) / full
    unclipped = frames.max(axis=0) < 1
    single = np.sqrt(np.mean(np.var(frames[:, unclipped], axis=0, ddof=1)))
    averaged = frames.reshape(20, 9, *SHAPE).mean(axis=1)
    nine = np.sqrt(np.mean(np.var(averaged[:, unclipped], axis=0, ddof=1)))
    measured("one frame, relative", abs(single / 0.015 - 1))
    measured("nine frames, relative", abs(nine / 0.005 - 1))
    assert single == pytest.approx(0.015, rel=0.01)
    assert nine == pytest.approx(0.005, rel=0.01)


def test_incoherent_frames_are_distorted_like_those_of_the_laser(context):
    scene = np.zeros(SHAPE, np.float32)
    scene[200:210, 30:40] = 1.0
    effects = {"lens_distortion": {"k1": 0.2}}
    lamp = camera(context, effects=effects).render(scene, illumination="incoherent")
    speckled = moving(camera(context, effects=effects), 30, scene).mean(axis=0)

    def centre(image):
        y, x = np.indices(SHAPE)
        bright = np.where(image > 0.3 * image.max(), image, 0)
        return np.array([(x * bright).sum(), (y * bright).sum()]) / bright.sum()

    assert np.abs(centre(lamp) - centre(scene)).max() > 2
    np.testing.assert_allclose(centre(lamp), centre(speckled), atol=0.5)


# --- Sensor ---


@pytest.mark.parametrize(("effect", "part"), [("column_gain", 0), ("row_gain", 1), ("prnu", 2)])
def test_gains_of_columns_rows_and_pixels(context, measured, effect, part):
    """A flat field at half of full scale, split into columns, rows and pixels as EMVA 1288 has it: the effect is in its
    own part alone, and frames in the dark have none of it. 256 columns or rows know a standard deviation to 4.4 %: 4
    standard errors (size 6e-5), and what is off by a third is found with a power of 0.99."""
    sensor = {"output": "codes", "bits": 12, "exposure_gain_dn": 2000.0, "read_noise_dn": 2.0}
    pipeline = camera(context, **sensor, effects={effect: {"sigma": 0.01}})
    flat = np.ones(SHAPE, np.float32)
    bright = np.stack([pipeline.render(flat, illumination="incoherent", frame_index=i) for i in range(8)])
    dark = np.stack([pipeline.render(illumination="dark", frame_index=i) for i in range(8)])
    parts = emva1288.split_prnu1288(bright, dark)
    measured("relative error", abs(parts[part] / 0.01 - 1))
    assert parts[part] == pytest.approx(0.01, rel=0.18)
    assert np.all(np.delete(parts, part) < 3e-4)
    pipeline.clear_effect()
    np.testing.assert_array_equal(dark, [pipeline.render(illumination="dark", frame_index=i) for i in range(8)])


CODES = {"output": "codes", "bits": 12, "exposure_gain_dn": 2000.0, "black_level_dn": 200.0, "read_noise_dn": 2.0}


def lamp(pipeline, count, level=1.0):
    flat = np.full(SHAPE, level, np.float32)
    return np.stack([pipeline.render(flat, illumination="incoherent", frame_index=i) for i in range(count)]).astype(
        float
    )


def darkness(pipeline, count):
    return np.stack([pipeline.render(illumination="dark", frame_index=i) for i in range(count)]).astype(float)


def test_row_offsets_stay_in_the_rows(context, measured):
    """256 rows know a standard deviation to 4.4 %: 4 standard errors; half of it would be 11 of them off."""
    pipeline = camera(context, **CODES, effects={"row_fpn": {"sigma_dn": 4.0}})
    first, later = darkness(pipeline, 16).reshape(2, 8, *SHAPE).mean(axis=1)
    rows = first.mean(axis=1)
    measured("relative error", abs(rows.std(ddof=1) / 4 - 1))
    assert rows.std(ddof=1) == pytest.approx(4.0, rel=0.18)
    assert np.corrcoef(rows, later.mean(axis=1))[0, 1] > 0.999
    assert first.mean(axis=0).std() < 0.1
    np.testing.assert_allclose(lamp(pipeline, 8).mean(axis=(0, 2)) - 2000, rows, atol=0.4)  # as much in the light


def test_column_noise_is_new_in_each_frame(context, measured):
    pipeline = camera(context, **CODES, effects={"column_noise": {"sigma_dn": 4.0}})
    columns = darkness(pipeline, 8).mean(axis=1)
    measured("relative error", abs(columns.std(ddof=1) / 4 - 1))
    assert columns.std(ddof=1) == pytest.approx(4.0, rel=0.07)  # 2048 of them: 4.5 standard errors
    assert np.abs(np.corrcoef(columns)[~np.eye(8, dtype=bool)]).max() < 0.3  # 4.8 standard errors


@pytest.mark.parametrize(("u", "v"), [(0.0713, 0.2031), (-0.317, 0.011), (0.25, -0.5)])
def test_a_wave_of_offsets(context, measured, u, v):
    """Least squares of sine and cosine: amplitude and wave are right to the noise of 256 x 256 pixels, 4 standard
    errors of 2.2 sqrt(2 / 4 / 65536) = 0.006 DN; another seed has another phase."""
    phases = []
    for seed in (5, 6):
        effect = {"periodic_offset": {"amplitude_dn": 3.0, "frequency_x": u, "frequency_y": v}}
        frame = darkness(camera(context, **CODES, seed=seed, effects=effect), 4).mean(axis=0) - 200
        y, x = np.indices(SHAPE)
        turns = 2 * np.pi * (u * x + v * y)
        terms = np.stack([np.sin(turns).ravel(), np.cos(turns).ravel()], axis=1)
        found, rest, *_ = np.linalg.lstsq(terms, frame.ravel(), rcond=None)
        measured("error of the amplitude, DN", abs(np.hypot(*found) - 3))
        assert np.hypot(*found) == pytest.approx(3.0, abs=0.03)
        assert np.sqrt(rest[0] / frame.size) < 1.1
        phases.append(np.arctan2(found[1], found[0]))
    assert abs(phases[0] - phases[1]) > 0.1


def test_dull_pixels(context):
    """Some 655 of 65536: their number has a standard error of 25, their mean gain one of 0.0034; the others stay."""
    pipeline = camera(context, **CODES, effects={"pixel_dull": {"fraction": 0.01}})
    dull = lamp(pipeline, 8).mean(axis=0)
    pipeline.clear_effect()
    gain = (dull - 200) / (lamp(pipeline, 8).mean(axis=0) - 200)
    is_dull = gain < 1
    assert is_dull.sum() == pytest.approx(655, abs=102)
    assert gain[is_dull].min() >= 0.7 - 1e-3
    assert gain[is_dull].mean() == pytest.approx(0.85, abs=0.014)
    assert gain[is_dull].std() == pytest.approx(0.3 / np.sqrt(12), rel=0.1)
    assert np.all(gain[~is_dull] == 1)


@pytest.mark.parametrize("centered", [0, 1])
def test_telegraph_noise_has_two_levels(context, centered):
    """1311 of 65536 pixels (standard error 36) are high in half of 32 frames (standard error of all together
    0.0024)."""
    effect = {"telegraph_noise": {"fraction": 0.02, "step_dn": 60.0, "centered": centered}}
    frames = darkness(camera(context, **CODES, effects=effect), 32) - 200
    spread = frames.std(axis=0, ddof=1)
    jumps = frames[:, spread > 12]
    assert jumps.shape[1] == pytest.approx(1311, abs=145)
    middle = 0.0 if centered else 30.0
    high = jumps > middle
    assert high.mean() == pytest.approx(0.5, abs=0.01)
    assert jumps[high].mean() == pytest.approx(middle + 30, abs=0.1)
    assert jumps[~high].mean() == pytest.approx(middle - 30, abs=0.1)
    repeats = (high[1:] == high[:-1]).mean()
    assert repeats == pytest.approx(0.5, abs=0.01)
    assert frames[:, spread < 12].std() == pytest.approx(np.hypot(2, 12**-0.5), rel=0.01)


def test_a_dark_signal_grows_with_the_time(context):
    """Rate times time, in the dark and in the light; photon noise of it with shot_noise only."""
    for ms in (10.0, 40.0):
        for effects, k in (({}, 0.0), ({"shot_noise": {"dn_per_electron": 0.5}}, 0.5)):
            effects = {"dark_current": {"rate_dn_per_ms": 2.0}, **effects}
            frames = darkness(camera(context, **CODES, exposure_time_s=ms * 1e-3, effects=effects), 4) - 200
            variance = 4 + 1 / 12 + k * 2 * ms
            assert frames.mean() == pytest.approx(2 * ms, abs=4 * np.sqrt(variance / frames.size))
            assert frames.var() == pytest.approx(variance, rel=4 * np.sqrt(2.2 / frames.size))
    pipeline = camera(context, **CODES, effects={"dark_current": {"rate_dn_per_ms": 2.0}})
    assert lamp(pipeline, 2).mean() == pytest.approx(200 + 2000 + 20, abs=0.05)


@pytest.mark.parametrize("correlation", [-0.5, -0.1, 0.3])
def test_read_noise_that_neighbours_share(context, measured, correlation):
    """In rows neighbours correlate as stated, all others do not: 1e6 codes, so that a correlation has a standard error
    of 1e-3, and one of 5e-3 off is found in 999 of 1000. The variance stays."""
    effects = {"correlated_read_noise": {"correlation": correlation}}
    frames = darkness(camera(context, **CODES | {"read_noise_dn": 6.0}, effects=effects), 16) - 200
    variance = frames.var()
    assert variance == pytest.approx(36 + 1 / 12, rel=0.01)

    def along(dy, dx):
        height, width = frames.shape[1:]
        return np.mean(frames[:, dy:, dx:] * frames[:, : height - dy, : width - dx]) / variance

    measured("correlation of neighbours", along(0, 1))
    assert along(0, 1) == pytest.approx(correlation * 36 / variance, abs=5e-3)
    for dy, dx in ((0, 2), (0, 3), (1, 0), (1, 1), (2, 0)):
        assert along(dy, dx) == pytest.approx(0, abs=5e-3)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_a_bent_response(context, power):
    """Means of even light follow s (1 - c (s / full)^power) up to full scale."""
    pipeline = camera(context, **CODES, effects={"nonlinearity": {"cubic": 0.05, "power": power}})
    for level in (0.1, 0.5, 1.0, 1.6, 1.9):
        signal = 2000 * level
        expected = signal * (1 - 0.05 * (signal / 4095) ** power)
        assert lamp(pipeline, 4, level).mean() == pytest.approx(200 + expected, abs=0.02)


@pytest.mark.parametrize(("period", "widest"), [(2, 1.0), (4, 2.7), (8, 0.0)])
def test_codes_of_different_widths(context, measured, period, widest):
    """Counts of codes over those of even codes are the widths 1 + a cos(2 pi (n - widest) / period): 65536 pixels of 16
    frames, noise of 12 DN, so that each of the remainders has 1e6 / period and a standard error of period^(1/2)
    1e-3."""
    dnl = {"amplitude_lsb": 0.4, "period_codes": period, "widest_code": widest}
    frames = lamp(camera(context, **CODES | {"read_noise_dn": 12.0}, effects={"differential_nonlinearity": dnl}), 16)
    codes = frames.astype(np.int64)
    share = np.bincount(codes.ravel() % period, minlength=period) / codes.size * period
    expected = 1 + 0.4 * np.cos(2 * np.pi * (np.arange(period) - widest) / period)
    measured("largest error of a width", np.abs(share - expected).max())
    np.testing.assert_allclose(share, expected, atol=5e-3 * np.sqrt(period))
    assert frames.mean() == pytest.approx(2200, abs=0.1)


# --- Stages, effects and time ---


def test_the_surface_moves_on_in_the_dark(context):
    """Boiling goes on under a lamp and in the dark: after 12 frames at tau = 6 little is left."""
    pipeline = camera(context, effects={"surface_boiling": {"correlation_frames": 6.0}})
    flat = np.ones(SHAPE, np.float32)
    first = pipeline.render(flat, frame_index=0).astype(np.float64)
    for i in range(1, 12):
        if i % 2:
            pipeline.render(illumination="dark", frame_index=i)
        else:
            pipeline.render(flat, illumination="incoherent", frame_index=i)
    last = pipeline.render(flat, frame_index=12).astype(np.float64)
    assert np.mean((first - 1) * (last - 1)) == pytest.approx(np.exp(-4), abs=0.06)


def test_an_aperture_is_shared_but_not_the_surface(context):
    flat = np.ones(SHAPE, np.float32)
    phase = clspeckle.Phase(SHAPE, seed=5, context=context)
    aperture = clspeckle.Aperture(SHAPE, f_number=8.0, context=context)
    smooth = clspeckle.Pipeline(phase=phase, aperture=aperture, coherent_fraction=0.9)
    expected = smooth.render(flat, refresh="all", frame_index=0)
    table = clspeckle.MaterialTable([clspeckle.Material()], context=context)
    made_of = clspeckle.Pipeline(phase=phase, aperture=aperture, materials=table)
    np.testing.assert_array_equal(smooth.render(flat, refresh="all", frame_index=0), expected)
    made_of.render(flat, material=np.zeros(SHAPE, np.uint8))
    made_of.close()
    assert contrast(aperture.intensity(phase, flat)) > 0.9
    np.testing.assert_array_equal(smooth.render(flat, refresh="all", frame_index=0), expected)


def test_a_lens_changed_by_its_owner(context):
    scene = spots().astype(np.float32)
    lens = clspeckle.Lens(SHAPE, context=context)
    stages = {
        "phase": clspeckle.Phase(SHAPE, seed=5, context=context),
        "aperture": clspeckle.Aperture(SHAPE, f_number=8.0, context=context),
    }
    pipeline = clspeckle.Pipeline(lens=lens, **stages)
    plain = pipeline.render(scene, refresh="all", frame_index=0)
    lens.configure(k1=0.05, vignetting_corner_loss=0.4)
    changed = pipeline.render(scene, refresh="all", frame_index=0)
    expected = clspeckle.Pipeline(
        lens=clspeckle.Lens(SHAPE, k1=0.05, vignetting_corner_loss=0.4, context=context), **stages
    ).render(scene, refresh="all", frame_index=0)
    np.testing.assert_array_equal(changed, expected)
    lens.configure(k1=0.0, vignetting_corner_loss=0.0)
    np.testing.assert_array_equal(pipeline.render(scene, refresh="all", frame_index=0), plain)


def test_other_effects_leave_lag_and_air_alone(context):
    """A refused effect, and one of another stage, change nothing of what the sensor and the air remember."""

    def frames(disturb):
        pipeline = clspeckle.Pipeline.from_parameters(
            SHAPE, context=context, f_number=8.0, seed=9, lag_fraction=0.5, airflow_rms_rad=0.5, read_noise_dn=0.0
        )
        result = [
            pipeline.render(np.full(SHAPE, level, np.float32), frame_index=i) for i, level in enumerate((0.1, 1.5))
        ]
        disturb(pipeline)
        return [*result, pipeline.render(np.full(SHAPE, 0.1, np.float32), frame_index=2)]

    def refused(pipeline):
        with pytest.raises(clspeckle.errors.InvalidArgumentError):
            pipeline.set_effect("full_well", level_dn=float("nan"))
        with pytest.raises(clspeckle.errors.InvalidArgumentError):
            pipeline.set_effect("aperture_mismatch", f_number_ratio=0.05)
        with pytest.raises(clspeckle.errors.InvalidArgumentError):
            pipeline.set_effect("zero_order")

    def another_stage(pipeline):
        pipeline.set_effect("vignetting", corner_loss=0.3)
        pipeline.clear_effect("vignetting")
        pipeline.set_effect("power_flicker", sigma=0.0)

    expected = frames(lambda pipeline: None)
    np.testing.assert_array_equal(frames(refused), expected)
    np.testing.assert_array_equal(frames(another_stage), expected)


def test_materials_say_it_themselves(context):
    for name in ("coherent_fraction", "subsurface_fraction"):
        with pytest.raises(clspeckle.errors.InvalidArgumentError, match="material table"):
            camera(context, materials=[clspeckle.Material()], subsurface_length_px=2.0, **{name: 0.5})
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="roughness_rms_m"):
        camera(context, materials=[clspeckle.Material()]).set_effect("low_roughness")
