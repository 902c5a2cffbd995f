"""Speckle that moves: the experiments of the thesis (3.2.4 to 3.2.6, 3.2.8) repeated with Motion, Phase and Aperture, and with real images."""

from __future__ import annotations

from pathlib import Path

import clspeckle
import numpy as np
import pytest

from reference import phase

# n = 2^17 independent samples: a field correlation has a standard error of at most 1 / sqrt(2 n) = 2e-3 per polarization. The slope of the bell
# where it is 1/e is 0.77 per correlation length, so the length is known to 0.3 % and BOUND (3.5 errors of the intensity's) is never
# reached by chance; a length that is off by 5 % would move the curve by 0.04.
SHAPE = (256, 512)
BOUND = 7e-3
INTRINSICS = (2e5, 2e5, 255.5, 127.5)  # narrow, so that all pixels look along the axis
LENGTHS = {"lateral": 0.5e-3, "axial": 3e-3, "rotation": np.deg2rad(0.25)}
SPARK = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "spark_memory_effect"


def transform(kind, step):
    """The thesis's three experiments: the device moves by `step`."""
    pose = np.eye(4)
    if kind == "lateral":
        pose[0, 3] = step
    elif kind == "axial":
        pose[2, 3] = step
    else:  # the board turns about an axis in its own plane, at 1 m
        c, s = np.cos(step), np.sin(step)
        pose[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        pose[:3, 3] = np.array([0, 0, 1]) - pose[:3, :3] @ [0, 0, 1]
    return pose


class Experiment:
    """A flat board at 1 m whose field and intensity follow a motion."""

    def __init__(self, context, seed=41, **materials):
        table = clspeckle.MaterialTable([clspeckle.Material(**materials)], context=context)
        self.motion = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, materials=table, context=context)
        self.phase = clspeckle.Phase(SHAPE, dynamics="continuous", polarization_count=1, seed=seed, context=context)
        self.depth = np.ones(SHAPE, np.float32)
        self.phase.refresh(0)
        self.index = 0

    def move(self, pose, frame_time_s=0.0):
        given = clspeckle.MotionInput(depth=self.depth, previous_from_current=pose, frame_time_s=frame_time_s)
        found = self.motion.compute(given, ("path", "correlation"))
        self.index += 1
        self.phase.advance(self.index, path=found["path"], correlation=found["correlation"])

    def field(self):
        return self.phase.field(0).astype(np.complex128)


def correlation(a, b):
    return float(np.mean((a * b.conj()).real))


@pytest.mark.parametrize("kind", LENGTHS)
def test_correlation_lengths_of_the_three_motions(context, measured, kind):
    """From the ACF of the field against displacement, each set length comes back within 1 % (asked: 5 %), and the curve is the bell."""
    experiment = Experiment(context)
    start = experiment.field()
    step = 0.1 * LENGTHS[kind]
    curve = [1.0]
    for _ in range(23):
        experiment.move(transform(kind, step))
        curve.append(correlation(experiment.field(), start))
    displacement = step * np.arange(len(curve))
    length = np.interp(-np.exp(-1), -np.array(curve), displacement)
    measured(f"relative error of the {kind} length", abs(length / LENGTHS[kind] - 1))
    assert abs(length / LENGTHS[kind] - 1) < 0.01
    # The board's edge is half a milliradian off the axis: a rotation about its centre moves it by up to 1.3 mm times the angle.
    difference = np.abs(curve - phase.path_correlation(displacement / LENGTHS[kind])).max()
    measured("difference from the bell", difference)
    assert difference < BOUND


def test_seven_micrometre_steps_give_the_curve_of_large_ones(context, measured):
    """The thesis's step: 140 frames of 7 um against 7 of 140 um; the same autocorrelation within the statistical error."""
    fine, coarse = Experiment(context, seed=42), Experiment(context, seed=43)
    fine_start, coarse_start = fine.field(), coarse.field()
    for _ in range(7):
        for _ in range(20):
            fine.move(transform("lateral", 7e-6))
        coarse.move(transform("lateral", 140e-6))
        a, b = correlation(fine.field(), fine_start), correlation(coarse.field(), coarse_start)
        measured("difference of correlation", abs(a - b))
        assert abs(a - b) < BOUND


def test_a_surface_that_lives(context, measured):
    """Skin with tau = 80 ms at 30 frames a second, in a device that rests: exp(-k dt / tau)."""
    experiment = Experiment(context, seed=44, correlation_time_s=0.08)
    start = experiment.field()
    for frame in range(1, 9):
        experiment.move(np.eye(4), 1 / 30)
        found = correlation(experiment.field(), start)
        measured("difference of correlation", abs(found - np.exp(-frame / 30 / 0.08)))
        assert abs(found - np.exp(-frame / 30 / 0.08)) < BOUND


def test_intensity_behind_the_aperture(context, measured):
    """The intensity's autocorrelation is |R|^2 (Siegert). At D = 0.5 the 2^17 pixels hold about n = pi/16 * 2^17 = 25700 independent speckles: a
    standard error of at most 2 / sqrt(n) = 0.0125; averaged over four boards 0.0062, the bound is 3.5 of them."""
    aperture = clspeckle.Aperture(SHAPE, relative_diameter=0.5, context=context)
    ideal = np.ones(SHAPE, np.float32)
    curves = []
    for seed in range(4):
        experiment = Experiment(context, seed=100 + seed)
        first = aperture.intensity(experiment.phase, ideal)
        curve = []
        for _ in range(6):
            experiment.move(transform("lateral", 0.35 * LENGTHS["lateral"]))
            curve.append(np.corrcoef(first.ravel(), aperture.intensity(experiment.phase, ideal).ravel())[0, 1])
        curves.append(curve)
    found = np.mean(curves, axis=0)
    expected = phase.path_correlation(0.35 * np.arange(1, 7)) ** 2
    measured("difference of correlation", np.abs(found - expected).max())
    assert np.abs(found - expected).max() < 0.022


def test_the_rule_of_the_thesis(context):
    """Kept below the threshold, replaced above it, whatever the path: (3.3) with a threshold of a tenth of a length."""
    motion = clspeckle.Motion(SHAPE, intrinsics=INTRINSICS, rule="replace", replace_threshold=0.1, context=context)
    state = clspeckle.Phase(SHAPE, field="unit_phasor", seed=5, context=context)
    state.refresh(0)
    start = state.field(0)
    depth = np.ones(SHAPE, np.float32)
    for index, (step, moves) in enumerate([(40e-6, False), (60e-6, True)], 1):
        given = clspeckle.MotionInput(depth=depth, previous_from_current=transform("lateral", step))
        state.advance(index, mask=motion.compute(given, ("mask",))["mask"])
        assert np.any(state.field(0) != start) == moves
        assert not moves or not np.any(state.field(0) == start)


# --- 41 images of speckle behind ground glass while a pinhole moves in steps of 0.05 mm (shared/data beside the checkout). ---


def spark_image(index):
    """720 x 540 pixels of an 8-bit BMP with a palette of greys; its rows run upwards."""
    raw = np.fromfile(SPARK / f"{index}.bmp", np.uint8)
    return raw[1078:].reshape(540, 720)[::-1].astype(np.float64)


def spectrum(image):
    return np.fft.rfft2(image - image.mean()) / image.std()


def peak_correlation(a, b):
    """The largest value of the normalised cross-correlation of two images, of whose spectra these are."""
    return float(np.fft.irfft2(a.conj() * b, s=(540, 720)).max() / (540 * 720))


STEPS = (1, 2, 3, 4, 5, 6, 7, 8)
TAIL = (10, 12, 15)


def measured_correlations():
    """Mean and spread over the reference images of the peak correlation after each number of steps."""
    spectra = {k: spectrum(spark_image(k)) for k in range(-20, 21)}
    table = {}
    for step in STEPS + TAIL:
        values = [peak_correlation(spectra[k], spectra[k + step]) for k in range(-20, 21 - step)]
        table[step] = (np.mean(values), np.std(values))
    return table


def simulated_correlations(context, length_steps, noise_fraction, seed=3):
    """The same series: 8 px of shift for each step, decorrelation by one length; speckle of the width of the images' (ACF 7.1 px wide at half
    height: D = 1.03 / 7.1 of a circular pupil), on a background that the correlation takes off, with white noise."""
    shape = (540, 720)
    state = clspeckle.Phase(
        shape, dynamics="continuous", translate=True, polarization_count=1, seed=seed, context=context
    )
    aperture = clspeckle.Aperture(shape, relative_diameter=1.03 / 7.1, context=context)
    ideal = np.ones(shape, np.float32)
    rng = np.random.default_rng(seed)
    shift = np.zeros((*shape, 2), np.float32)
    shift[..., 0] = -8

    def image():
        intensity = aperture.intensity(state, ideal)
        noise = np.sqrt(noise_fraction / (1 - noise_fraction)) * intensity.std()
        return 20 + 10 * intensity + 10 * rng.normal(0, noise, shape)

    state.refresh(0)
    spectra = [spectrum(image())]
    for step in range(1, 19):
        state.advance(step, path=1 / length_steps, shift=shift)
        spectra.append(spectrum(image()))
    return {
        step: np.mean([peak_correlation(spectra[k], spectra[k + step]) for k in range(len(spectra) - step)])
        for step in STEPS + TAIL
    }


def fitted(table):
    """The length in steps and the fraction of white noise that R^2 fits best, by least squares over STEPS; of the 720 px, 8 a step have
    left the image."""
    steps = np.array(STEPS)
    means = np.array([table[step][0] for step in STEPS])

    def misfit(length, noise):
        return np.sum((means - (1 - noise) * (1 - 8 * steps / 720) * phase.path_correlation(steps / length) ** 2) ** 2)

    best = min(
        (misfit(length, noise), length, noise) for length in np.arange(6, 14, 0.05) for noise in np.arange(0, 0.08, 0.005)
    )
    return best[1], best[2]


def test_translation_series_of_real_speckle(context, measured):
    """Peak correlation against step: where there is a peak to speak of (0.95 down to 0.25) the simulation lies within two spreads of the
    measurement (a spread is 0.012; 0.8 of one were measured). Beyond, both fall to the height of chance peaks; there the real tail is
    heavier than the bell's, by up to 0.06 (step 10: 0.146, and 0.10 simulated), and that is all that is claimed."""
    if not SPARK.is_dir():
        pytest.skip("shared/data beside the checkout is not there")
    table = measured_correlations()
    length, noise = fitted(table)
    simulated = simulated_correlations(context, length, noise)
    for step in STEPS:
        mean, spread = table[step]
        measured(f"step {step}: spreads", abs(simulated[step] - mean) / spread)
        assert abs(simulated[step] - mean) < 2 * spread, step
    for step in TAIL:
        measured(f"step {step}: difference", abs(simulated[step] - table[step][0]))
        assert abs(simulated[step] - table[step][0]) < 0.06, step
    assert 8 < length < 12  # 0.4 to 0.6 mm: the thesis has 0.5 mm
