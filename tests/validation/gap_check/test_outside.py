"""Effects that are in no catalogue against closed forms; those that `test_generator.py` does not hold already."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.special import erf

from gap_check.camera import ALL_SEQUENCES, LASER_SEQUENCES, LIT_SEQUENCES, Camera, draw_camera, stream
from gap_check.effects import OUTSIDE
from gap_check.light import dust, pupil
from gap_check.plan import PLANS, draw_sets
from gap_check.scene import dot_image, dot_list, ideal_image
from gap_check.sensor import process
from support import BY_NAME, FRAMES, Array, airy, codes, contrast, correlation, laser, light, moments

SIZE = 128
Y, X = np.mgrid[0:SIZE, 0:SIZE].astype(float)


@pytest.fixture(scope="module")
def one_dot(camera: Camera) -> Camera:
    """A single dot, far from the axis and from all borders."""
    return replace(camera, positions_px=np.array([[92.3, 80.6]]))


def residue(camera: Camera, name: str, **effects: Any) -> Array:
    """What effects add to each frame. Both codes are rounded: 0.41 DN of noise, 0.083 in the mean of 24 frames."""
    return codes(camera, name, **effects) - codes(camera, name)


def test_the_page_lists_all_effects_and_sets() -> None:
    page = (Path(__file__).parents[3] / "docs" / "results" / "gap-check.md").read_text().replace(" \\\n", "")
    table = page[page.index("## Effects outside the catalogue") : page.index("## How it is counted")]
    assert re.findall(r"^\| `(\w+)` \| (\w+) \|", table, re.MULTILINE) == [(e.id, e.stage) for e in OUTSIDE.values()]
    sets = draw_sets(PLANS["full"])
    assert re.findall(r"--plan full .*# (\d+) sets", page) == [str(len(sets))] * 2
    outside = sum(entry.kind == "outside" for entry in sets)
    assert f"| an effect in no catalogue, three of each | d | {outside} |" in page


# Laser, DOE, motion: exact.


def test_second_wavelength_has_neighbours_farther_out(camera: Camera) -> None:
    axis = np.array(camera.axis_px)
    positions, powers = dot_list(camera, {}, 1)
    more, shared = dot_list(camera, {"second_wavelength": {"fraction": 0.3}}, 1)
    count = len(positions)
    assert np.allclose(more[:count], positions)
    assert np.allclose(more[count:] - axis, 1.03 * (positions - axis))
    assert np.allclose(shared, np.repeat([0.7, 0.3], count))
    assert shared.sum() == pytest.approx(powers.sum())


def test_uneven_illumination_is_a_slope_of_laser_light(camera: Camera) -> None:
    effects: dict[str, Any] = {"uneven_illumination": {"slope": 0.3}}
    for name in LASER_SEQUENCES:
        plain, sloping = (ideal_image(camera, BY_NAME[name], e, 1) for e in ({}, effects))
        assert np.allclose(sloping, plain * (0.7 + 0.6 * X / (SIZE - 1))), name
    # And the lens images it: the mean of 60 patterns. A column of 128 x 60 / 8.5 grains scatters by 3 %.
    columns = laser(camera, frames=60, **effects).mean(axis=(0, 1))
    assert np.polyfit(2 * X[0] / (SIZE - 1) - 1, columns, 1) == pytest.approx([0.3, 1.0], abs=0.03)


def test_wide_outer_dots_keep_their_light(camera: Camera, one_dot: Camera) -> None:
    growth = 0.8
    offset = one_dot.positions_px[0] - camera.axis_px
    sigma = camera.dot_sigma_px * (1 + growth * (offset @ offset) / camera.corner_px**2)
    assert sigma > 1.1 * camera.dot_sigma_px
    image = dot_image(one_dot, {"wide_outer_dots": {"growth": growth}}, 1)
    centre, variances = moments(image)
    assert image.sum() == pytest.approx(2 * np.pi * camera.dot_sigma_px**2)
    assert centre == pytest.approx(one_dot.positions_px[0])
    assert variances == pytest.approx([sigma**2] * 2, rel=1e-6)
    middle = replace(camera, positions_px=np.array([camera.axis_px]))
    assert np.allclose(dot_image(middle, {"wide_outer_dots": {"growth": growth}}, 1), dot_image(middle, {}, 1))


def test_shutter_blur_is_the_mean_along_a_path(one_dot: Camera) -> None:
    """The mean of a Gaussian over a path: a difference of error functions."""
    effects: dict[str, Any] = {"shutter_blur": {"path_px": 5.0}}
    (px, py), sigma = one_dot.positions_px[0], one_dot.dot_sigma_px
    ends = [erf((X - px + side * 2.5) / (np.sqrt(2) * sigma)) for side in (1, -1)]
    along = np.sqrt(np.pi / 2) * sigma / 5.0 * (ends[0] - ends[1])
    expected = along * np.exp(-((Y - py) ** 2) / (2 * sigma**2))
    assert np.allclose(ideal_image(one_dot, BY_NAME["dots_moving"], effects, 1), expected, atol=1e-9)
    still = ideal_image(one_dot, BY_NAME["dots_static"], {}, 1)
    assert np.array_equal(ideal_image(one_dot, BY_NAME["dots_static"], effects, 1), still)


@pytest.mark.parametrize("name", ["board_moving", "board_static"])
def test_line_jitter_moves_every_row_by_itself(camera: Camera, name: str) -> None:
    rms = 0.5
    plain, shaken = light(camera, name), light(camera, name, line_jitter={"rms_px": rms})
    assert shaken.shape == (FRAMES, SIZE, SIZE)
    before, after = np.fft.rfft(plain, axis=-1), np.fft.rfft(shaken, axis=-1)
    shifts = -np.angle(after[..., 1] / before[..., 1]) / (2 * np.pi / SIZE)
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(SIZE) * shifts[..., None])
    # The intensity's band ends at D = 0.386: a row shifted between its samples is not negative anywhere.
    assert np.allclose(np.fft.irfft(before * turn, axis=-1), shaken, atol=1e-9)
    assert shifts.std() == pytest.approx(rms)
    # Smoothed by a Gaussian of 4 rows: correlation exp(-dy^2 / 64). 24 frames of 128 / 14 independent rows: 220 values,
    # which know a correlation within 0.03.
    for dy in (2, 6):
        assert correlation(shifts[:, :, None], dy, 0) == pytest.approx(np.exp(-(dy**2) / 64), abs=0.1)
    assert abs((shifts[1:] * shifts[:-1]).mean()) / rms**2 < 0.25


# Optics.


def test_coma(camera: Camera) -> None:
    waves = 1.0
    plain, bent = pupil(camera, {}), pupil(camera, {"coma": {"waves": waves}})
    assert np.allclose(np.abs(bent), np.abs(plain))  # and with it the grain of a board: |mu|^2 is |P|^2's transform
    f = np.fft.fftfreq(SIZE)
    for fx, fy in ((5, 0), (-9, 0), (0, 7), (8, 13), (-11, 4)):
        rho, theta = np.hypot(f[fx], f[fy]) / (camera.diameter / 2), np.arctan2(f[fy], f[fx])
        expected = np.exp(2j * np.pi * waves * (3 * rho**3 - 2 * rho) * np.cos(theta))
        assert bent[fy, fx] / plain[fy, fx] == pytest.approx(expected), (fx, fy)
    # The spot's centroid is the mean of the wave's gradient, 1 for (3 rho^2 - 2) u over the disc: 2 waves / D.
    # The transfer function's phase near 0 tells it; in steps of 1/512 the rim takes 3 % off.
    fine = replace(camera, width=512, height=512)
    spot = np.abs(np.fft.ifft2(pupil(fine, {"coma": {"waves": waves}}))) ** 2
    transfer = np.fft.fft2(spot)
    assert -np.angle(transfer[0, 1]) * 512 / (2 * np.pi) == pytest.approx(-2 * waves / camera.diameter, rel=0.04)
    assert abs(np.angle(transfer[1, 0])) < 1e-9
    assert spot.max() < 0.5 * np.abs(np.fft.ifft2(pupil(fine, {}))).max() ** 2


def test_astigmatism_at_a_line_focus(camera: Camera) -> None:
    """With itself turned by 90 degrees it is a defocus; the spot is sharp along y, and along x a defocus's."""
    aberration = {"waves": 1.2}
    plain, bent = pupil(camera, {}), pupil(camera, {"astigmatism": aberration})
    defocused = pupil(camera, {"defocus": aberration})
    inside = plain != 0
    assert np.array_equal(inside, inside.T)
    assert np.allclose((bent * bent.T)[inside] / plain[inside], defocused[inside])
    spread = [np.abs(np.fft.ifft2(p)) ** 2 for p in (plain, bent, defocused)]
    across, along = [s.sum(axis=0) for s in spread], [s.sum(axis=1) for s in spread]
    assert np.allclose(along[1], along[0], atol=1e-12)
    assert np.allclose(across[1], across[2], atol=1e-12)
    assert across[1].max() < 0.6 * across[0].max()


@pytest.mark.parametrize("name", ["board_moving", "dots_static"])
def test_incoherent_double_image(camera: Camera, name: str) -> None:
    f = 0.25
    plain, double = light(camera, name), light(camera, name, incoherent_double_image={"fraction": f})
    assert np.allclose(double, (1 - f) * plain + f * np.roll(plain, (2, 5), axis=(1, 2)))
    if name == "board_moving":
        # Intensities add: K^2 = (1 - f)^2 + f^2 + 2 f (1 - f) |mu(5, 2)|^2. 46 000 grains: 0.01 at most.
        expected = (1 - f) ** 2 + f**2 + 2 * f * (1 - f) * airy(camera.diameter, np.hypot(5, 2))
        assert contrast(double) == pytest.approx(np.sqrt(expected), abs=0.025)


def test_dust_is_twelve_grains() -> None:
    camera = draw_camera(4, 400, 360)
    absorption = 0.4
    seed = 2  # whose grains touch neither each other nor the border
    transmission = dust(camera, absorption, seed)
    grains, count = label(transmission < 1 - absorption / 2)
    assert count == 12
    radii = []
    for grain in range(1, count + 1):
        shadow = 1 - transmission[grains == grain]
        # A pixel's centre is within 0.71 px of the grain's: 0.94 of the peak at least, for the smallest.
        assert 0.93 * absorption < shadow.max() <= absorption
        radii.append(np.sqrt(shadow.size / (2 * np.pi * np.log(2))))  # half of the peak at r^2 = 2 ln 2 radius^2
    assert min(radii) > 1.8
    assert max(radii) < 5.2
    assert np.std(radii) > 0.3
    # The light that they take, 2 pi a r^2 each.
    assert (1 - transmission).sum() == pytest.approx(2 * np.pi * absorption * np.square(radii).sum(), rel=0.1)


def test_dust_is_the_same_in_all_light(camera: Camera) -> None:
    effects: dict[str, Any] = {"dust": {"absorption": 0.5}}
    transmission = dust(camera, 0.5, 5)
    assert 0.2 < transmission.min() < 0.55
    for name in LIT_SEQUENCES:
        assert np.allclose(light(camera, name, 2, **effects), transmission * light(camera, name, 2)), name
    assert np.array_equal(codes(camera, "dark", 2, **effects), codes(camera, "dark", 2))


# Sensor.


def test_sharpening_lifts_noise_and_points(camera: Camera) -> None:
    a = 0.8
    effects: dict[str, Any] = {"sharpening": {"amount": a}}
    point = np.full((1, 9, 9), 100.0)
    point[0, 4, 4] = 190.0
    out = process(camera, "flat", point, effects, 1)[0].astype(float)
    assert out[4, 4] == 190 + 64  # a (190 - 110)
    assert out[3:6, 3:6].sum() == 190 + 64 + 8 * (100 - 8)
    assert set(np.delete(out.ravel(), np.arange(81).reshape(9, 9)[3:6, 3:6].ravel())) == {100.0}
    centre, beside = 1 + 8 * a / 9, -a / 9
    raw, sharp = codes(camera, "dark"), codes(camera, "dark", **effects)
    # 390 000 samples of white noise: a variance within 0.3 %, a correlation within 0.002.
    variance = (camera.read_noise_dn**2 + 1 / 12) * (centre**2 + 8 * beside**2)
    assert sharp.var() == pytest.approx(variance + 1 / 12, rel=0.015)
    assert correlation(sharp, 0, 1) == pytest.approx(
        (2 * centre * beside + 4 * beside**2) * raw.var() / variance, abs=0.01
    )
    assert sharp.mean() == pytest.approx(raw.mean(), abs=0.01)


def test_temporal_denoising_is_recursive(camera: Camera) -> None:
    """y = (1 - w) x + w y before: variance (1 - w) / (1 + w), correlation w; each step's rounding goes the same way."""
    w = 0.5
    raw, quiet = codes(camera, "dark"), codes(camera, "dark", temporal_denoising={"weight": w})
    assert np.array_equal(quiet[0], raw[0])
    settled = quiet[8:] - quiet[8:].mean()
    expected = ((1 - w) ** 2 * (camera.read_noise_dn**2 + 1 / 12) + 1 / 12) / (1 - w * w)
    # 16 frames of 16 384 pixels, every third of them independent: 0.5 %.
    assert settled.var() == pytest.approx(expected, rel=0.02)
    assert (settled[1:] * settled[:-1]).mean() / settled.var() == pytest.approx(w, abs=0.015)
    assert (settled[3:] * settled[:-3]).mean() / settled.var() == pytest.approx(w**3, abs=0.015)
    # A step fades by w from frame to frame.
    step = np.zeros((4, 8, 8))
    step[0] = 800.0
    faded = process(camera, "flat", step, {"temporal_denoising": {"weight": w}}, 1)
    assert [float(frame.mean()) for frame in faded] == [800, 400, 200, 100]
    assert step[1].max() == 0  # what came in stays as it was


@pytest.mark.parametrize("name", ["dark", "flat"])
def test_dark_shading_glows_from_a_corner(camera: Camera, name: str) -> None:
    corner = 18.0
    expected = corner * np.exp(-np.hypot(X, Y) / (0.4 * np.hypot(63.5, 63.5)))
    glow = residue(camera, name, dark_shading={"corner_dn": corner}).mean(axis=0)
    assert np.abs(glow - expected).max() < 0.5  # six deviations of the rounding's noise
    assert glow.mean() == pytest.approx(expected.mean(), abs=0.01)
    assert glow[:4, :4].mean() > 0.8 * corner
    assert glow[-4:, -4:].mean() < 0.1 * corner


@pytest.mark.parametrize("level", [78.0, 83.0, 88.0, 93.0])
def test_converter_ripple(camera: Camera, level: float) -> None:
    """E sin(2 pi (m + n) / 96) = sin(2 pi m / 96) exp(-(2 pi sigma / 96)^2 / 2); noise goes as 1 + the sine's slope."""
    amplitude, turn = 6.0, 2 * np.pi / 96
    camera = replace(camera, level_dn=level)
    damping = np.exp(-((turn * camera.read_noise_dn) ** 2) / 2)
    for name, signal in (("dark", 0.0), ("flat", level * camera.flat_gain)):
        phase = turn * (signal + camera.black_dn)
        rippled = codes(camera, name, 8, converter_ripple={"amplitude_dn": amplitude})
        # 131 000 samples: 0.011 DN.
        moved = rippled.mean() - signal - camera.black_dn
        assert moved == pytest.approx(amplitude * damping * np.sin(phase), abs=0.05), name
        slope = 1 + amplitude * turn * damping * np.cos(phase)
        assert rippled.std() == pytest.approx(slope * camera.read_noise_dn, rel=0.03), name


def test_interference_is_a_wave_of_a_new_phase_in_each_frame(camera: Camera) -> None:
    amplitude = 5.0
    place = 2 * np.pi * (0.061 * X + 0.013 * Y).ravel()
    basis = np.stack([np.sin(place), np.cos(place)], axis=1)
    phases = {}
    for name in ("dark", "flat"):
        waves = residue(camera, name, interference={"amplitude_dn": amplitude}).reshape(FRAMES, -1)
        found, *_ = np.linalg.lstsq(basis, waves.T, rcond=None)
        # The rounding's 0.41 DN on 16 384 pixels: 0.005 DN.
        assert np.hypot(*found) == pytest.approx(np.full(FRAMES, amplitude), abs=0.03)
        assert (waves - (basis @ found).T).std() < 0.45
        phases[name] = np.exp(1j * np.arctan2(found[1], found[0]))
        # Rayleigh: 24 phases at random leave more than 0.55 in exp(-24 x 0.3) = 0.07 % of draws.
        assert abs(phases[name].mean()) < 0.55
    assert abs((phases["dark"] / phases["flat"]).mean()) < 0.55


def test_dead_pixels_see_nothing(camera: Camera) -> None:
    effects: dict[str, Any] = {"dead_pixels": {"fraction": 0.02}}
    dead = stream(5, "dead_pixels").random(camera.shape) < 0.02
    assert dead.sum() == pytest.approx(0.02 * dead.size, rel=0.22)  # 328 +- 18
    for name in LIT_SEQUENCES:
        blind, plain = codes(camera, name, 8, **effects), codes(camera, name, 8)
        assert np.array_equal(blind[:, ~dead], plain[:, ~dead]), name
        # 2600 samples: 0.08 DN.
        assert blind[:, dead].mean() == pytest.approx(camera.black_dn, abs=0.4), name
        assert blind[:, dead].std() == pytest.approx(np.hypot(camera.read_noise_dn, 12**-0.5), rel=0.07), name
    assert np.array_equal(codes(camera, "dark", 8, **effects), codes(camera, "dark", 8))


@pytest.mark.parametrize("name", ALL_SEQUENCES[:3])
def test_black_level_drift_is_a_line(camera: Camera, name: str) -> None:
    total = 8.0
    drift = residue(camera, name, black_level_drift={"total_dn": total})
    frames = drift.mean(axis=(1, 2))
    if name == "board_static":  # codes that are clipped at 1023 do not rise: P(I > 8) of exponential light
        frames = drift[:, codes(camera, name).max(axis=0) < 1000].mean(axis=1)
    assert frames == pytest.approx(np.linspace(-total / 2, total / 2, FRAMES), abs=0.02)
    assert (drift - frames[:, None, None]).std() < 0.45
