"""The independent generator against closed forms: its baseline, every catalogued effect, and effects outside."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.ndimage import gaussian_filter

from gap_check.camera import ALL_SEQUENCES, LONG_DARK, Camera, draw_camera
from gap_check.effects import CATALOGUE, EFFECTS, OUTSIDE, on_camera
from gap_check.generator import generate_sequence, write_capture
from gap_check.light import exposure_modes, field_shifts, pupil
from gap_check.plan import Plan, camera_of, draw_sets, set_name, write_drawn, write_plan
from gap_check.readings import CHOICES, Readings
from gap_check.scene import dot_image, dot_list, dot_profile, ideal_image, spread, undistort
from gap_check.sensor import compress_blocks, crosstalk, pixel_gain, transfer_smear
from support import BY_NAME, FRAMES, Array, airy, codes, contrast, correlation, laser

# Baseline. 24 frames of 128 x 128 at one correlation cell 4 / (pi D^2) = 8.5 px hold 46 000 independent grains: the
# contrast scatters by about 1 / sqrt(46 000) x 2 = 0.01 at most, a distribution function by 0.0025.


@pytest.mark.parametrize("f_number", [5.6, 8.0])
def test_baseline_speckle_is_fully_developed(camera: Camera, f_number: float) -> None:
    camera = replace(camera, f_number=f_number)
    intensity = laser(camera)
    assert intensity.mean() == pytest.approx(1, abs=0.015)
    assert contrast(intensity) == pytest.approx(1, abs=0.025)
    for level in (0.2, 0.7, 1.5, 3.0):
        assert np.mean(intensity <= level * intensity.mean()) == pytest.approx(1 - np.exp(-level), abs=0.01)
    for lag in (1, 2, 3, 4):
        assert correlation(intensity, 0, lag) == pytest.approx(airy(camera.diameter, lag), abs=0.02)
        assert correlation(intensity, lag, 0) == pytest.approx(airy(camera.diameter, lag), abs=0.02)


def test_unit_phasors_have_less_contrast(camera: Camera) -> None:
    """E |z|^4 is 1, not 2: K^2 = 1 - sum |h|^4 / (sum |h|^2)^2, 0.90 for the widest pupil."""
    camera = replace(camera, f_number=5.6)
    h2 = np.abs(np.fft.ifft2(pupil(camera, {}))) ** 2
    expected = np.sqrt(1 - (h2**2).sum() / h2.sum() ** 2)
    assert expected < 0.96
    assert contrast(laser(replace(camera, field="unit_phasor"))) == pytest.approx(expected, abs=0.025)


def test_moving_frames_are_independent_and_static_ones_equal(camera: Camera) -> None:
    moving = laser(camera)
    assert abs(np.corrcoef(moving[3].ravel(), moving[4].ravel())[0, 1]) < 0.1
    assert laser(camera, "board_static").shape[0] == 1


def test_dots_average_to_the_incoherent_image(camera: Camera) -> None:
    mean = laser(camera, "dots_moving", frames=200).mean(axis=0)
    h2 = np.abs(np.fft.ifft2(pupil(camera, {}))) ** 2
    expected = np.fft.ifft2(np.fft.fft2(dot_image(camera, {}, 5)) * np.fft.fft2(h2)).real
    # 200 patterns: each pixel scatters by 7 % of itself.
    assert np.abs(mean - expected).mean() < 0.1 * expected.mean()
    assert mean.mean() == pytest.approx(expected.mean(), rel=0.02)


def test_sensor_noise_and_levels(camera: Camera) -> None:
    dark, flat = codes(camera, "dark"), codes(camera, "flat")
    # 390 000 samples: the mean scatters by 0.007 DN, the deviation by 0.005 DN; a code's rounding adds 1 / 12.
    assert dark.mean() == pytest.approx(camera.black_dn, abs=0.04)
    assert dark.std() == pytest.approx(np.sqrt(camera.read_noise_dn**2 + 1 / 12), abs=0.03)
    assert flat.mean() == pytest.approx(camera.black_dn + camera.level_dn * camera.flat_gain, abs=0.04)
    assert dark.std(axis=0).mean() == pytest.approx(dark.std(), rel=0.05)


def test_camera_draws_cover_their_ranges() -> None:
    cameras = [draw_camera(seed, 96, 80) for seed in range(200)]
    levels = [c.level_dn for c in cameras]
    assert min(levels) < 100
    assert max(levels) > 140
    assert min(levels) >= 95
    assert max(levels) <= 145
    assert {c.f_number for c in cameras} == {5.6, 6.3, 8.0}
    assert all(c.diameter < 0.6 and c.sheet_black_dn == 64 and c.sheet_read_noise_dn == 4 for c in cameras)
    assert np.std([c.black_dn for c in cameras]) == pytest.approx(1.4, abs=0.3)
    assert np.std([c.read_noise_dn for c in cameras]) == pytest.approx(0.37, abs=0.08)
    for c in cameras[:20]:
        inside = (c.positions_px >= 5) & (c.positions_px <= np.array([c.width - 5, c.height - 5]))
        assert inside.all()
        assert len(c.positions_px) >= 20


def test_same_seed_same_codes() -> None:
    small = draw_camera(2, 60, 50)
    effects = {name: info.at(0.5) for name, info in EFFECTS.items() if name not in ("tilt_blur", "frame_repeats")}
    for name in ("dark", "board_static", "dots_moving"):
        first = generate_sequence(small, BY_NAME[name], effects, 4, 9)
        assert np.array_equal(first, generate_sequence(small, BY_NAME[name], effects, 4, 9))
        assert not np.array_equal(first, generate_sequence(small, BY_NAME[name], effects, 4, 10))


# Codes that may differ or not: another draw of the same law, another level, a clip that the flat may not reach, no
# light.
MAY_DIFFER = {
    "defocus": {"board_static", "board_moving"},
    "tilt_blur": {"board_static", "board_moving"},
    "coma": {"board_static", "board_moving"},
    "astigmatism": {"board_static", "board_moving"},
    "ambient_light": {"flat"},
    "mirror_ghost": {"flat"},
    "column_smear": {"flat"},
    "full_well": {"flat"},
    "pixel_dull": {"board_static", "dots_static", "dots_moving"},  # one pixel may be in the dark
}


@pytest.mark.parametrize("effect", EFFECTS)
@pytest.mark.parametrize("strength", [0.0, 1.0])
def test_effects_show_where_they_should_and_nowhere_else(effect: str, strength: float) -> None:
    small = draw_camera(3, 75, 60)
    setting = {effect: EFFECTS[effect].at(strength)}
    for name in ALL_SEQUENCES:
        if name not in MAY_DIFFER.get(effect, set()):
            same = np.array_equal(codes(small, name, 12), codes(small, name, 12, **setting))
            assert same == (name not in EFFECTS[effect].sequences), name


def test_strengths_move_all_parameters_from_weak_to_strong() -> None:
    assert CATALOGUE["subsurface_scattering"].at(0.5) == {"length_px": 2.75, "fraction": 0.6}
    assert CATALOGUE["depolarization"].at(1) == {"degree_of_polarization": 0.0}
    assert [CATALOGUE["adc_bits"].at(s)["bits"] for s in (0, 0.6, 1)] == [8, 7, 6]
    described = (Path(__file__).parents[3] / "docs" / "reference" / "effects.md").read_text(encoding="utf-8")
    assert list(CATALOGUE) == re.findall(r"^\| `(\w+)`", described, re.MULTILINE)
    assert len(OUTSIDE) >= 10
    assert {e.stage for e in OUTSIDE.values()} == {"laser", "doe", "surface", "motion", "optics", "sensor"}


# Laser, surface, motion: contrasts in closed form.


@pytest.mark.parametrize("p", [0.7, 0.3, 0.0])
def test_depolarization(camera: Camera, p: float) -> None:
    measured = contrast(laser(camera, depolarization={"degree_of_polarization": p}))
    assert measured == pytest.approx(np.sqrt((1 + p * p) / 2), abs=0.025)


@pytest.mark.parametrize("s", [0.5, 1.2])
def test_linewidth(camera: Camera, s: float) -> None:
    """Fields of lines j and k correlate by exp(-(j - k)^2 s^2 / 2): K^2 = sum w_j w_k exp(-(j - k)^2 s^2)."""
    k = np.arange(-2, 3)
    w = np.exp(-(k**2) / 2)
    w /= w.sum()
    expected = np.sqrt((w[:, None] * w * np.exp(-((k[:, None] - k) ** 2) * s * s)).sum())
    for name in ("board_moving", "board_static"):
        frames = [contrast(laser(camera, name, seed=seed, linewidth={"dephasing_rad": s})) for seed in range(6)]
        assert np.mean(frames) == pytest.approx(expected, abs=0.03), name


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
@pytest.mark.parametrize("lags", [0.4, 2.5])
def test_motion_decorrelation(camera: Camera, lags: float, field: str) -> None:
    a = 2 * lags
    expected = np.sqrt(2 * (np.exp(-a) - 1 + a) / a**2)
    camera = replace(camera, field=field)
    baseline = contrast(laser(camera, frames=8)) if field == "unit_phasor" else 1.0
    measured = contrast(laser(camera, frames=12, motion_decorrelation={"lags": lags}))
    # The phasors' path has 16 steps; their fourth moment keeps out of the product by a few percent.
    assert measured == pytest.approx(expected * baseline, abs=0.03 if field == "circular_gaussian" else 0.05)
    values, integrals = exposure_modes(lags, 200)
    assert values.sum() == pytest.approx(1, abs=0.01)
    assert (values**2).sum() == pytest.approx(expected**2, rel=0.01)
    assert (integrals**2).sum() == pytest.approx(1, abs=1e-9)


def test_low_roughness(camera: Camera) -> None:
    """A constant of intensity a beside speckle of mean s: K = sqrt(s^2 + 2 s a) / (s + a); the lens passes all of a."""
    c = 0.3
    a, s = c * np.abs(pupil(camera, {})[0, 0]) ** 2, 1 - c
    measured = laser(camera, low_roughness={"coherent_fraction": c})
    assert measured.mean() == pytest.approx(a + s, rel=0.01)
    assert contrast(measured) == pytest.approx(np.sqrt(s * s + 2 * s * a) / (s + a), abs=0.015)


def test_subsurface_scattering_and_glare_spread_exponentially() -> None:
    point = np.zeros((64, 64))
    point[32, 32] = 1
    out = spread(point, 3.0)
    assert out.sum() == pytest.approx(1)
    assert out[32, 38] / out[32, 35] == pytest.approx(np.exp(-1))
    assert out[38, 32] == pytest.approx(out[32, 38])


def test_surface_boiling(camera: Camera) -> None:
    tau = 10.0
    for field in ("circular_gaussian", "unit_phasor"):
        frames = laser(replace(camera, field=field), "board_static", 40, surface_boiling={"correlation_frames": tau})
        delta = frames - frames.mean()
        for lag in (1, 5, 10):
            measured = (delta[lag:] * delta[:-lag]).mean() / delta.var()
            # Unit phasors: K^2 < 1 by their fourth moment, which decays faster.
            assert measured == pytest.approx(np.exp(-2 * lag / tau), abs=0.05), (field, lag)


def test_airflow_disturbs_a_static_scene_the_more_the_stronger(camera: Camera) -> None:
    previous = 1.0
    for rms in (0.25, 0.8):
        frames = laser(camera, "board_static", 30, airflow={"rms_rad": rms, "scale_px": 6.0})
        far = np.mean([np.corrcoef(frames[0].ravel(), f.ravel())[0, 1] for f in frames[15:]])
        near = np.mean([np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in zip(frames, frames[1:], strict=False)])
        assert far < near < previous
        assert contrast(frames) == pytest.approx(1, abs=0.12)
        previous = near
    assert far < 0.97


def test_vibration_and_drift_move_the_image(camera: Camera) -> None:
    still = laser(camera, "board_static")[0]
    fy, fx = np.fft.fftfreq(128)[:, None], np.fft.fftfreq(128)[None, :]
    for effects in ({"vibration": {"rms_px": 0.3}}, {"image_drift": {"px_per_frame": 0.06}}):
        frames = laser(camera, "board_static", **effects)
        shifts = field_shifts(camera, BY_NAME["board_static"], effects, FRAMES, 5)
        assert shifts is not None
        for frame, (dx, dy) in zip(frames, shifts, strict=True):
            moved = np.fft.ifft2(np.fft.fft2(still) * np.exp(-2j * np.pi * (fx * dx + fy * dy))).real
            assert np.allclose(frame, moved, atol=1e-9)
    assert field_shifts(camera, BY_NAME["board_moving"], {"vibration": {"rms_px": 0.3}}, FRAMES, 5) is None
    many = field_shifts(camera, BY_NAME["board_static"], {"vibration": {"rms_px": 0.3}}, 4000, 5)
    assert many is not None
    assert many.std(axis=0) == pytest.approx([0.3, 0.3], rel=0.05)


def test_laser_power(camera: Camera) -> None:
    image = ideal_image(camera, BY_NAME["board_static"], {}, 5)
    assert image.shape == camera.shape
    frames = codes(camera, "board_static", 200, power_flicker={"sigma": 0.05}) - camera.black_dn
    mean = frames.mean(axis=(1, 2))
    # 200 draws: sigma is known within 5 %; clipped codes take a little away.
    assert mean.std() / mean.mean() == pytest.approx(0.05, rel=0.2)
    droop = codes(camera, "board_static", 40, power_warm_up={"droop": 0.2}).mean(axis=(1, 2)) - camera.black_dn
    assert (np.diff(droop) < 0.05).all()
    assert droop[-1] / droop[0] == pytest.approx(1 - 0.2 * (1 - np.exp(-3)), abs=0.02)
    # The bands run on from frame to frame, and the mean over frames keeps none.
    bands = codes(camera, "board_static", 34, row_band_flicker={"modulation": 0.15})
    plain = codes(camera, "board_static", 34)
    rows = bands.mean(axis=2) / plain.mean(axis=2)
    assert rows.std(axis=0).mean() > 0.05
    assert rows.mean(axis=0).std() < 0.2 * rows.std(axis=0).mean()


# Dots: the projector.


def test_dot_shapes() -> None:
    y, x = np.mgrid[-20:20.01:0.1, -20:20.01:0.1]
    plain = dot_profile(x, y, 2.2, {})
    assert np.allclose(plain, np.exp(-(x**2 + y**2) / (2 * 2.2**2)))
    # Light that would be negative is left out, and with it some of a large skewness.
    for skew, low, high in ((0.1, 0.095, 0.1), (0.5, 0.4, 0.5), (1.2, 0.6, 1.2)):
        skewed = dot_profile(x, y, 2.2, {"beam_skew": {"skew": skew}})
        mean = (skewed * x).sum() / skewed.sum()
        deviation = np.sqrt((skewed * (x - mean) ** 2).sum() / skewed.sum())
        third = (skewed * (x - mean) ** 3).sum() / skewed.sum() / deviation**3
        assert skewed.min() >= 0
        assert low < third <= high + 1e-3
    flat = dot_profile(x, y, 2.2, {"beam_flat_top": {"flatness": 1.0}})
    r2 = (x**2 + y**2) / 2.2**2
    assert np.allclose(flat, np.exp(-(r2**3) / 2))


def test_dot_lattices(camera: Camera) -> None:
    positions, powers = dot_list(camera, {}, 1)
    count = len(positions)
    axis = np.array(camera.axis_px)
    moved, _ = dot_list(camera, {"wavelength_shift": {"delta_nm": 9.4}}, 1)
    assert np.allclose(moved - axis, (positions - axis) * 1.01)
    more, faint = dot_list(camera, {"ghost_dots": {"relative_intensity": 0.2}}, 1)
    assert np.allclose(more[count:] - positions, camera.spacing_px / 2)
    assert np.allclose(faint[count:], 0.2)
    more, bright = dot_list(camera, {"zero_order": {"relative_intensity": 7.0}}, 1)
    assert np.allclose(more[-1], axis)
    assert bright[-1] == 7
    turned, _ = dot_list(camera, {"pattern_rotation": {"angle_deg": 1.0}}, 1)
    a, b = positions - axis, turned - axis
    angle = np.rad2deg(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)))
    assert np.allclose(np.abs(angle), 1.0)
    assert np.allclose(np.hypot(*a.T), np.hypot(*b.T))
    assert len(set(np.sign(angle))) == 1
    _, left = dot_list(camera, {"missing_dots": {"fraction": 0.25}}, 1)
    assert (left == 0).sum() == round(0.25 * count)
    _, unequal = dot_list(camera, {"unequal_dots": {"sigma": 0.3}}, 1)
    assert np.log(unequal).std() == pytest.approx(0.3, rel=0.35)  # of some 60 dots
    assert np.array_equal(powers, np.ones(count))


def test_distortion_moves_points_outward(camera: Camera) -> None:
    k1 = 0.05
    x, y = undistort(camera, k1)
    cx, cy = camera.axis_px
    r2 = ((x - cx) ** 2 + (y - cy) ** 2) / camera.corner_px**2
    rows, columns = np.mgrid[0:128, 0:128]
    assert np.allclose(cx + (x - cx) * (1 + k1 * r2), columns)
    assert np.allclose(cy + (y - cy) * (1 + k1 * r2), rows)
    single = replace(camera, positions_px=np.array([[110.0, 100.0]]))
    image = dot_image(single, {"lens_distortion": {"k1": k1}}, 1)
    centre = np.array([(image * columns).sum(), (image * rows).sum()]) / image.sum()
    offset = np.array([110.0, 100.0]) - (cx, cy)
    expected = (cx, cy) + offset * (1 + k1 * (offset @ offset) / camera.corner_px**2)
    assert centre == pytest.approx(expected, abs=0.05)


def test_scatter_keeps_the_light(camera: Camera) -> None:
    plain = ideal_image(camera, BY_NAME["dots_static"], {}, 1)
    for effects in (
        {"scatter_background": {"fraction": 0.25}},
        {"subsurface_scattering": {"length_px": 4.0, "fraction": 0.6}},
    ):
        changed = ideal_image(camera, BY_NAME["dots_static"], effects, 1)
        assert changed.mean() == pytest.approx(plain.mean())
        assert changed.max() < 0.9 * plain.max()
        assert np.allclose(ideal_image(camera, BY_NAME["board_static"], effects, 1), 1)


# Optics.


def test_pupils(camera: Camera) -> None:
    for name in ("aperture_mismatch", "pupil_obstruction", "defocus", "elliptical_pupil", "window_double_image"):
        p = pupil(camera, {name: EFFECTS[name].at(1.0)})
        assert np.mean(np.abs(p) ** 2) == pytest.approx(1), name
    area = np.count_nonzero(pupil(camera, {}))
    assert area / camera.shape[0] ** 2 == pytest.approx(np.pi / 4 * camera.diameter**2, rel=0.02)
    small = np.count_nonzero(pupil(camera, {"aperture_mismatch": {"f_number_ratio": 1.4}}))
    assert small / area == pytest.approx(1 / 1.4**2, rel=0.03)
    ring = np.count_nonzero(pupil(camera, {"pupil_obstruction": {"radius_ratio": 0.6}}))
    assert ring / area == pytest.approx(1 - 0.36, rel=0.03)
    rim = pupil(camera, {"defocus": {"waves": 1.0}})
    fx = np.fft.fftfreq(128)
    column = np.argmin(np.abs(fx - camera.diameter / 4))
    expected = np.exp(2j * np.pi * (fx[column] / (camera.diameter / 2)) ** 2)
    assert rim[0, column] / np.abs(rim[0, column]) == pytest.approx(expected)


def test_defocus_widens_dots_and_leaves_the_grain(camera: Camera) -> None:
    effects = {"defocus": {"waves": 1.5}}
    blurred = laser(camera, "dots_moving", 60, **effects)
    assert blurred.mean(axis=0).max() < 0.7 * laser(camera, "dots_moving", 60).mean(axis=0).max()
    board = laser(camera, **effects)
    assert contrast(board) == pytest.approx(1, abs=0.025)
    assert correlation(board, 0, 2) == pytest.approx(airy(camera.diameter, 2), abs=0.02)


def test_aperture_mismatch_grain(camera: Camera) -> None:
    intensity = laser(camera, aperture_mismatch={"f_number_ratio": 1.3})
    for lag in (1, 2, 3):
        assert correlation(intensity, 0, lag) == pytest.approx(airy(camera.diameter / 1.3, lag), abs=0.025)


def test_elliptical_pupil_grain(camera: Camera) -> None:
    intensity = laser(camera, elliptical_pupil={"axis_ratio": 0.6})
    assert correlation(intensity, 0, 2) == pytest.approx(airy(camera.diameter * 0.6, 2), abs=0.025)
    assert correlation(intensity, 2, 0) == pytest.approx(airy(camera.diameter, 2), abs=0.025)


def test_window_double_image_repeats_the_grain(camera: Camera) -> None:
    a = 0.5
    intensity = laser(camera, window_double_image={"amplitude": a})
    assert correlation(intensity, 1, 4) > correlation(laser(camera), 1, 4) + 0.05
    assert contrast(intensity) == pytest.approx(1, abs=0.03)


def test_tilt_blurs_one_side_only(camera: Camera) -> None:
    frames = {name: laser(camera, "dots_moving", 60, **e).mean(axis=0)
              for name, e in (("plain", {}), ("tilt", {"tilt_blur": {"edge_waves": 2.5}}))}  # fmt: skip
    assert frames["tilt"][:, :50].max() == pytest.approx(frames["plain"][:, :50].max(), rel=0.02)
    assert frames["tilt"][:, 100:].max() < 0.6 * frames["plain"][:, 100:].max()
    assert frames["tilt"].mean() == pytest.approx(frames["plain"].mean(), rel=0.03)
    board = laser(camera, tilt_blur={"edge_waves": 2.5})
    assert contrast(board) == pytest.approx(1, abs=0.03)


def test_vignetting_and_ambient_light(camera: Camera) -> None:
    flat = codes(camera, "flat", vignetting={"corner_loss": 0.4}).mean(axis=0) - camera.black_dn
    level = camera.level_dn * camera.flat_gain
    assert flat[0, 0] / level == pytest.approx(0.6, abs=0.02)
    assert flat[60:68, 60:68].mean() / level == pytest.approx(1, abs=0.01)
    for name in ("flat", "dots_static", "dark"):
        lift = codes(camera, name, ambient_light={"level_dn": 20.0}).mean() - codes(camera, name).mean()
        assert lift == pytest.approx(0 if name == "dark" else 20, abs=0.3)


def test_glare_mirror_ghost_and_fringes(camera: Camera) -> None:
    single = replace(camera, positions_px=np.array([[30.0, 40.0]]))
    base = codes(single, "dots_moving", 40).mean(axis=0) - camera.black_dn
    glare = codes(single, "dots_moving", 40, glare={"fraction": 0.2, "scale_px": 6.0}).mean(axis=0) - camera.black_dn
    assert glare.sum() == pytest.approx(base.sum(), rel=0.05)
    ring = np.s_[36:45, 42:46]  # 12 to 16 px beside the dot
    assert glare[ring].mean() > base[ring].mean() + 0.1
    ghost = codes(single, "dots_moving", 40, mirror_ghost={"fraction": 0.2}).mean(axis=0) - camera.black_dn
    assert ghost[87, 97] > 5
    assert base[87, 97] < 2
    fringed = codes(camera, "board_moving", 40, etalon_fringes={"modulation": 0.25}).mean(axis=0)
    plain = codes(camera, "board_moving", 40).mean(axis=0)
    y, x = np.mgrid[0:128, 0:128]
    carrier = np.exp(-2j * np.pi * (0.043 * x + 0.021 * y))
    depth = 2 * np.abs((carrier * (fringed - plain)).mean()) / (plain.mean() - camera.black_dn)
    assert depth == pytest.approx(0.25, abs=0.03)


# Surface and motion effects outside the catalogue.


def test_uncorrelated_speckle_has_no_grain(camera: Camera) -> None:
    intensity = laser(camera, uncorrelated_speckle={"fraction": 1.0})
    assert contrast(intensity) == pytest.approx(1, abs=0.02)
    assert abs(correlation(intensity, 0, 1)) < 0.01


def test_albedo_texture_stays_with_the_surface(camera: Camera) -> None:
    textured = laser(camera, frames=60, albedo_texture={"sigma": 0.3}).mean(axis=0)
    albedo = ideal_image(camera, BY_NAME["board_moving"], {"albedo_texture": {"sigma": 0.3}}, 5)
    assert albedo.std() == pytest.approx(0.3, abs=0.03)
    assert np.corrcoef(textured.ravel(), albedo.ravel())[0, 1] > 0.6


def test_stuck_frames_see_the_same_surface(camera: Camera) -> None:
    frames = laser(camera, frames=40, stick_slip={"stuck_fraction": 0.5})
    equal = [np.array_equal(a, b) for a, b in zip(frames, frames[1:], strict=False)]
    assert 8 <= sum(equal) <= 31  # 39 pairs of probability 1/2: 5 deviations either way
    recorded = codes(camera, "board_moving", 40, stick_slip={"stuck_fraction": 0.5})
    assert not any(np.array_equal(a, b) for a, b in zip(recorded, recorded[1:], strict=False))


# Sensor.


@pytest.mark.parametrize("f_number", [5.6, 8.0])
def test_pixel_integration(camera: Camera, f_number: float) -> None:
    """K^2 = integral of Lambda(x) Lambda(y) |mu|^2 over lags, Lambda the triangle of a pixel with itself."""
    camera = replace(camera, f_number=f_number)

    def integrand(y: float, x: float) -> float:
        r = np.hypot(x, y)
        return (1 - x) * (1 - y) * (airy(camera.diameter, r) if r > 1e-9 else 1.0)

    expected = np.sqrt(4 * dblquad(integrand, 0, 1, 0, 1, epsabs=1e-7)[0])
    effects = {"pixel_integration": {"fill_factor": 1.0}}
    point, area = laser(camera), laser(camera, **effects)
    assert contrast(area) / contrast(point) == pytest.approx(expected, abs=0.005)
    assert area.mean() == pytest.approx(point.mean(), rel=1e-3)
    tiny = laser(camera, pixel_integration={"fill_factor": 1e-6})
    assert np.allclose(tiny, point, rtol=1e-4, atol=1e-4)


def test_crosstalk_and_transfer_smear_of_a_point() -> None:
    point = np.zeros((1, 9, 9))
    point[0, 4, 4] = 1
    out = crosstalk(point, 0.2)[0]
    assert out[4, 4] == pytest.approx(0.8)
    assert [out[3, 4], out[5, 4], out[4, 3], out[4, 5]] == pytest.approx([0.05] * 4)
    assert crosstalk(np.ones((1, 9, 9)), 0.2) == pytest.approx(np.ones((1, 9, 9)))
    smeared = transfer_smear(point, 0.2)[0]
    assert smeared[4, 3] == 0
    assert smeared[4, 4:7] == pytest.approx([0.8, 0.16, 0.032])


def test_shot_noise_is_the_photon_transfer_line(camera: Camera) -> None:
    k = 0.3
    flat = codes(camera, "flat", shot_noise={"dn_per_electron": k})
    signal = camera.level_dn * camera.flat_gain
    expected = k * signal + camera.read_noise_dn**2 + 1 / 12
    assert flat.var(axis=0, ddof=1).mean() == pytest.approx(expected, rel=0.01)
    assert flat.mean() == pytest.approx(signal + camera.black_dn, abs=0.2)


def test_fixed_patterns_are_the_same_in_all_sequences(camera: Camera) -> None:
    def residue(name: str, **effects: dict) -> np.ndarray:
        return (codes(camera, name, **effects) - codes(camera, name)).mean(axis=0)

    dsnu = {"dsnu": {"sigma_dn": 3.0}}
    assert residue("dark", **dsnu).std() == pytest.approx(3, rel=0.03)
    assert np.corrcoef(residue("dark", **dsnu).ravel(), residue("flat", **dsnu).ravel())[0, 1] > 0.99
    column = residue("dark", column_fpn={"sigma_dn": 3.0})
    assert column.std(axis=0).max() < 0.2
    assert column.mean(axis=0).std() == pytest.approx(3, rel=0.25)
    prnu = residue("flat", prnu={"sigma": 0.02})
    assert prnu.std() / (camera.level_dn * camera.flat_gain) == pytest.approx(0.02, rel=0.03)
    assert np.abs(residue("dark", prnu={"sigma": 0.02})).max() == 0
    gains = {"column_gain": {"sigma": 0.01}}
    column = residue("flat", **gains) / (camera.level_dn * camera.flat_gain)
    assert column.std(axis=0).max() < 1e-3
    assert column.mean(axis=0).std() == pytest.approx(0.01, rel=0.25)
    assert np.abs(residue("dark", **gains)).max() == 0
    gains = {"row_gain": {"sigma": 0.01}}
    row = residue("flat", **gains) / (camera.level_dn * camera.flat_gain)
    assert row.std(axis=1).max() < 1e-3
    assert row.mean(axis=1).std() == pytest.approx(0.01, rel=0.25)
    assert np.abs(residue("dark", **gains)).max() == 0
    row = residue("dark", row_fpn={"sigma_dn": 3.0})
    assert row.std(axis=1).max() < 0.2
    assert row.mean(axis=1).std() == pytest.approx(3, rel=0.25)
    hot = residue("dark", hot_pixels={"fraction": 0.01, "mean_dn": 150.0})
    lit = hot[hot > 1]
    assert len(lit) / hot.size == pytest.approx(0.01, rel=0.3)  # 164 pixels
    assert lit.mean() == pytest.approx(150, rel=0.35)


@pytest.mark.parametrize(("name", "axis"), [("row_noise", 2), ("column_noise", 1)])
def test_line_noise_is_new_each_frame(camera: Camera, name: str, axis: int) -> None:
    noise = codes(camera, "dark", **{name: {"sigma_dn": 3.0}}) - codes(camera, "dark")
    lines = noise.mean(axis=axis)
    assert lines.std() == pytest.approx(3, rel=0.06)  # 3072 draws: 1.3 %
    assert (noise - np.expand_dims(lines, axis)).std() < 0.45  # both codes are rounded: 0.41 DN
    assert abs(np.corrcoef(lines[0], lines[1])[0, 1]) < 0.4


@pytest.mark.parametrize("correlation", [0.2, -0.3])
def test_correlated_read_noise_is_that_of_neighbours_in_a_row(camera: Camera, correlation: float) -> None:
    """Correlations of 400,000 codes: standard errors of 0.0016."""
    noise = codes(camera, "dark", correlated_read_noise={"correlation": correlation})
    noise = noise - noise.mean(axis=0)
    variance = noise.var()
    assert variance == pytest.approx((1 - 1 / len(noise)) * (camera.read_noise_dn**2 + 1 / 12), rel=0.02)

    def along(x: int, y: int) -> float:
        height, width = camera.shape
        return float(np.mean(noise[:, y:, x:] * noise[:, : height - y, : width - x]) / variance)

    assert along(1, 0) == pytest.approx(correlation * (1 - 1 / 12 / variance), abs=0.007)
    assert max(abs(along(x, y)) for x, y in ((2, 0), (3, 0), (0, 1), (1, 1), (camera.shape[1] - 1, 0))) < 0.02


def test_periodic_offset_is_one_line_of_the_spectrum(camera: Camera) -> None:
    wave = {"amplitude_dn": 4.0, "frequency_x": 13 / 128, "frequency_y": -40 / 128}
    for name in ("dark", "flat"):
        pattern = (codes(camera, name, periodic_offset=wave) - codes(camera, name)).mean(axis=0)
        spectrum = np.abs(np.fft.rfft2(pattern)) / pattern.size
        assert np.unravel_index(spectrum.argmax(), spectrum.shape) == (128 - 40, 13)
        assert spectrum.max() == pytest.approx(2.0, rel=0.01)  # a / 2; what is rounded adds 0.41 / sqrt(24) / 128
    drawn = [CATALOGUE["periodic_offset"].at(0.5, seed) for seed in range(200)]
    assert drawn[3] == CATALOGUE["periodic_offset"].at(0.5, 3)
    places = np.array([[d["frequency_x"], d["frequency_y"]] for d in drawn])
    assert 0.03 <= np.abs(places).min() < 0.04
    assert 0.48 < np.abs(places).max() <= 0.5
    assert np.abs((places > 0).mean(axis=0) - 0.5).max() < 0.15  # four deviations
    assert {d["amplitude_dn"] for d in drawn} == {3.0}


def test_dark_current_grows_with_the_exposure(camera: Camera) -> None:
    rate, k = 0.8, 0.3
    current = {"rate_dn_per_ms": rate}
    for sequence in (BY_NAME["dark"], LONG_DARK):
        charge = rate * sequence.exposure_ms
        effects = {"dark_current": current, "shot_noise": {"dn_per_electron": k}}
        dark = generate_sequence(camera, sequence, effects, FRAMES, 5).astype(float)
        # 393 216 samples: 0.012 DN, 0.23 % of the variance.
        assert dark.mean() == pytest.approx(camera.black_dn + charge, abs=0.05)
        assert dark.var(axis=0, ddof=1).mean() == pytest.approx(k * charge + camera.read_noise_dn**2 + 1 / 12, rel=0.01)
    # Without photon noise nothing says what an electron is.
    smooth = codes(camera, "dark", dark_current=current) - codes(camera, "dark")
    assert smooth.mean() == pytest.approx(8, abs=1e-9)
    assert smooth.std() == 0
    on_ten_ms = codes(camera, "flat", dark_current=current) - codes(camera, "flat")
    assert on_ten_ms.mean() == pytest.approx(8, abs=1e-9)


def test_exposures_scale_light() -> None:
    camera = draw_camera(11, 60, 50, read_noise_dn=0.0)
    half = replace(BY_NAME["flat"], exposure_ms=5.0)
    full, lit = (generate_sequence(camera, s, {}, 2, 1).mean() - camera.black_dn for s in (BY_NAME["flat"], half))
    assert lit / full == pytest.approx(0.5, abs=0.004)  # rounded to half a DN of 300


def test_dull_pixels(camera: Camera) -> None:
    def gains(fraction: float) -> Array:
        gain = pixel_gain(camera, {"pixel_dull": {"fraction": fraction}}, 5)
        assert gain is not None
        return gain

    dull = gains(0.02)[gains(0.02) < 1]
    assert len(dull) == round(0.02 * 128 * 128)
    assert dull.min() >= 0.7
    assert dull.mean() == pytest.approx(0.85, abs=0.02)  # 328 of them: 0.005
    assert (gains(1e-9) < 1).sum() == 1


@pytest.mark.parametrize("choice", CHOICES["nonlinearity"])
def test_nonlinearity_bends_the_photon_transfer_line(choice: Any) -> None:
    c, k, level = 0.05, 0.3, 700.0
    camera = draw_camera(11, 128, 128, level_dn=level, flat_gain=1.0, read_noise_dn=0.0)
    camera = replace(camera, readings=Readings(nonlinearity=choice))
    flat = codes(camera, "flat", nonlinearity={"cubic": c}, shot_noise={"dn_per_electron": k})
    bend = c * (level / 1023) ** 3
    expected = level * (1 - bend) + camera.black_dn
    # After photons the mean of the curve is that of its middle, less 6 c s k s / full^3 / 2: 0.03 DN.
    assert flat.mean() == pytest.approx(expected, abs=0.1)
    slope = (1 - 4 * bend) ** 2 if choice == "after_photons" else 1 - bend
    assert flat.var(axis=0, ddof=1).mean() == pytest.approx(k * level * slope + 1 / 12, rel=0.01)


def test_response(camera: Camera) -> None:
    signal = camera.level_dn * camera.flat_gain
    flat = codes(camera, "flat", gamma={"gamma": 0.8}).mean() - camera.black_dn
    assert flat == pytest.approx(1023 * (signal / 1023) ** 0.8, abs=0.1)
    clipped = codes(camera, "board_moving", full_well={"level_dn": 400.0})
    assert clipped.max() < 400 + camera.black_dn + 7 * camera.read_noise_dn
    dnl = {"amplitude_lsb": 0.4, "period_codes": 4.0}
    uneven, even = (codes(camera, "flat", **effects) for effects in ({"differential_nonlinearity": dnl}, {}))
    counts = [np.bincount(stack.astype(int).ravel() % 4) for stack in (uneven, even)]
    widths = counts[0] / counts[1]
    assert np.abs(np.fft.fft(widths))[1] == pytest.approx(2 * 0.4, rel=0.05)
    assert uneven.mean() == pytest.approx(even.mean(), abs=0.02)
    coarse = codes(camera, "board_moving", adc_bits={"bits": 6.0})
    assert set(np.unique(coarse % 16)) == {0}
    assert coarse.max() == 1008
    assert codes(camera, "dark", adc_bits={"bits": 6.0}).mean() == pytest.approx(camera.black_dn, abs=1.5)


def test_mosaics(camera: Camera) -> None:
    signal = camera.level_dn * camera.flat_gain
    flat = (codes(camera, "flat", bayer_mismatch={"delta": 0.05}).mean(axis=0) - camera.black_dn) / signal
    sites = [flat[0::2, 0::2].mean(), flat[0::2, 1::2].mean(), flat[1::2, 0::2].mean(), flat[1::2, 1::2].mean()]
    assert sites == pytest.approx([1, 0.95, 1.05, 1], abs=1e-3)
    rows = (codes(camera, "flat", odd_even_row_gain={"delta": 0.05}).mean(axis=(0, 2)) - camera.black_dn) / signal
    assert [rows[0::2].mean(), rows[1::2].mean()] == pytest.approx([0.95, 1.05], abs=1e-3)


def test_image_lag(camera: Camera) -> None:
    """y_t = (1 - f) x_t + f x_(t-1): neighbours correlate by f (1 - f) / (f^2 + (1 - f)^2), x independent."""
    f = 0.15
    frames = codes(camera, "board_moving", image_lag={"fraction": f})
    delta = frames - frames.mean()
    measured = (delta[1:] * delta[:-1]).mean() / (delta.var() - camera.read_noise_dn**2)
    assert measured == pytest.approx(f * (1 - f) / (f * f + (1 - f) ** 2), abs=0.02)
    assert abs((delta[2:] * delta[:-2]).mean() / delta.var()) < 0.02


def test_block_compression() -> None:
    rng = np.random.default_rng(3)
    raw = np.round(gaussian_filter(rng.normal(500, 800, (2, 160, 164)), (0, 8, 8), mode="wrap"))
    assert np.array_equal(compress_blocks(raw, 1e-6), raw)
    coarse = compress_blocks(raw, 30.0)
    steps = np.abs(np.diff(coarse, axis=2)).mean(axis=(0, 1))
    inside = np.delete(steps, np.arange(7, len(steps), 8))
    assert steps[7::8].mean() > 1.3 * inside.mean()  # jumps at the borders of blocks


def test_repeated_frames(camera: Camera) -> None:
    dark = codes(camera, "dark", 40, frame_repeats={"fraction": 0.3})
    equal = sum(np.array_equal(a, b) for a, b in zip(dark, dark[1:], strict=False))
    assert 3 <= equal <= 23  # 39 x 0.3 = 12, 4 deviations


@pytest.mark.parametrize("choice", CHOICES["telegraph_noise"])
def test_telegraph_pixels(camera: Camera, choice: Any) -> None:
    other = replace(camera, readings=Readings(telegraph_noise=choice))
    step, frames = 40.0, 40
    jumping = codes(other, "dark", frames, telegraph_noise={"fraction": 0.02, "step_dn": step})
    wild = np.ptp(jumping, axis=0) > step  # 0.6 % of the others, and half of those that jump at all, are so by noise
    wild &= jumping.std(axis=0) > 2.5 * camera.read_noise_dn
    assert wild.mean() == pytest.approx(0.02, rel=0.3)
    values = jumping[:, wild] - camera.black_dn + (step / 2 if choice == "centered" else 0)
    up = values > step / 2
    assert values[up].mean() == pytest.approx(step, abs=0.5)
    assert values[~up].mean() == pytest.approx(0, abs=0.5)
    # 328 pixels x 40 frames: 0.0044, and twice that where states last.
    assert up.mean() == pytest.approx(0.5, abs=0.04)
    assert (up[1:] != up[:-1]).mean() == pytest.approx(0.3 if choice == "slow" else 0.5, abs=0.03)


def test_median_denoising_and_column_smear(camera: Camera) -> None:
    quiet = codes(camera, "dark", median_denoising={"weight": 1.0})
    # The median of nine normals has a deviation of 0.408.
    assert quiet.std() == pytest.approx(0.408 * camera.read_noise_dn, rel=0.05)
    single = replace(camera, positions_px=np.array([[30.0, 40.0]]))
    smeared = codes(single, "dots_moving", 40, column_smear={"fraction": 0.15}).mean(axis=0) - camera.black_dn
    assert smeared[100:, 30].mean() > smeared[100:, 90].mean() + 0.5


def test_a_capture_on_disk(tmp_path) -> None:
    small = draw_camera(2, 60, 50)
    write_capture(tmp_path / "set", small, {"defocus": {"waves": 1.0}}, 3, 4)
    assert sorted(p.name for p in (tmp_path / "set").iterdir()) == sorted(
        ["capture.json", *(f"{name}.npy" for name in ALL_SEQUENCES)]
    )
    flat = np.load(tmp_path / "set" / "flat.npy")
    assert flat.dtype == np.uint16
    assert flat.shape == (3, 50, 60)
    assert "defocus" not in (tmp_path / "set" / "capture.json").read_text()
    with pytest.raises(ValueError, match="no effect is called 'blur'"):
        write_capture(tmp_path / "wrong", small, {"blur": {}}, 3, 4)
    with pytest.raises(ValueError, match="takes the parameters waves"):
        write_capture(tmp_path / "wrong", small, {"defocus": {"wave": 1.0}}, 3, 4)


def test_cut_images_end_where_the_world_goes_on(tmp_path) -> None:
    whole, cut = draw_camera(3, 96, 80, f_number=8.0), draw_camera(3, 96, 80, f_number=8.0, border_px=24)
    assert cut.shape == (128, 144)
    assert cut.metadata() == whole.metadata()
    assert cut.corner_px == whole.corner_px

    def opposite_rows(camera: Camera) -> float:
        codes = generate_sequence(camera, BY_NAME["board_moving"], {}, 40, 5).astype(float)
        assert codes.shape == (40, 80, 96)
        return float(np.corrcoef(codes[:, 0].ravel(), codes[:, -1].ravel())[0, 1])

    # Grains are wider than a pixel: the correlation of neighbours, and of 3840 independent pixels at five deviations.
    assert opposite_rows(whole) > 0.3
    assert abs(opposite_rows(cut)) < 0.12

    dark = {"vignetting": {"corner_loss": 0.4}}
    corners = [generate_sequence(c, BY_NAME["flat"], dark, 40, 5).mean(axis=0)[0, 0] - c.black_dn for c in (whole, cut)]
    assert corners[0] / (whole.level_dn * whole.flat_gain) == pytest.approx(0.6, rel=0.02)
    assert corners[1] / corners[0] == pytest.approx(1, rel=0.02)

    write_capture(tmp_path / "cut", cut, {}, 2, 5, (BY_NAME["dots_static"],))
    image = np.load(tmp_path / "cut" / "dots_static.npy").mean(axis=0)
    x, y = np.rint(json.loads((tmp_path / "cut" / "capture.json").read_text())["dots"]["positions_px"][0]).astype(int)
    assert image[y - 4 : y + 5, x - 4 : x + 5].mean() > image.mean()


def test_other_cameras_are_what_their_data_sheets_say() -> None:
    cameras = [draw_camera(seed, 96, 80, other=True) for seed in range(40)]
    assert {c.bits for c in cameras} == {8, 10, 12}
    assert {c.degree_of_polarization for c in cameras} == {1.0, 0.6}
    for c in cameras:
        assert 0.22 <= c.diameter <= 0.9
        assert abs(c.black_dn - c.sheet_black_dn) <= 3.001 * c.dn_scale
        assert c.read_noise_dn == pytest.approx(c.sheet_read_noise_dn, rel=0.21)
        assert c.positions_px.min() > 4
        assert (c.positions_px.max(axis=0) < (96 - 4, 80 - 4)).all()
        assert draw_camera(7, 96, 80, other=True).metadata() == draw_camera(7, 96, 80, other=True).metadata()

    # Codes of 8 bits: 8 frames of 7680 pixels tell a mean to 0.4 % of the noise, and the noise to 0.3 %.
    coarse = draw_camera(3, 96, 80, other=True, bits=8, black_dn=16.2, read_noise_dn=1.1)
    dark = generate_sequence(coarse, BY_NAME["dark"], {}, 8, 5).astype(float)
    assert dark.mean() == pytest.approx(16.2, abs=0.03)
    assert dark.std() == pytest.approx(np.hypot(1.1, 12**-0.5), rel=0.02)
    assert generate_sequence(replace(coarse, level_dn=200.0), BY_NAME["board_static"], {}, 2, 5).max() == 255

    # Two patterns of weights (1 + p) / 2 and (1 - p) / 2.
    half = replace(draw_camera(3, 128, 128), degree_of_polarization=0.6)
    assert contrast(laser(half)) == pytest.approx(np.sqrt((1 + 0.6**2) / 2), abs=0.025)


def test_effects_go_with_the_data_sheet() -> None:
    camera = draw_camera(1, other=True, bits=12, degree_of_polarization=0.6)
    effects = {
        name: EFFECTS[name].at(0)
        for name in ("row_noise", "adc_bits", "depolarization", "glare", "shot_noise", "full_well")
    }
    scale = 4095 / 1023
    assert on_camera(effects, camera) == {
        "row_noise": {"sigma_dn": pytest.approx(0.8 * scale)},
        "adc_bits": {"bits": 10.0},
        "depolarization": {"degree_of_polarization": pytest.approx(0.42)},
        "glare": effects["glare"],
        "shot_noise": {"dn_per_electron": pytest.approx(0.08 * scale)},
        "full_well": {"level_dn": pytest.approx(650 * scale)},
    }
    every = {name: info.at(0.5) for name, info in EFFECTS.items()}
    assert on_camera(every, draw_camera(1)) == every


def test_plans_of_other_cameras(tmp_path: Path) -> None:
    plan = Plan("mine", width=60, height=50, frames=2, singles_each=4, single_effects=("dsnu",), other_cameras=True)
    sets = write_plan(tmp_path, plan)
    assert sets == draw_sets(replace(plan, other_cameras=False))  # the same effects on other cameras
    scales = set()
    for i, entry in enumerate(sets):
        drawn, camera = json.loads((tmp_path / "keys" / f"{set_name(i)}.json").read_text()), camera_of(plan, entry)
        scales.add(camera.dn_scale)
        assert drawn["effects"]["dsnu"]["sigma_dn"] == pytest.approx(
            entry.effects["dsnu"]["sigma_dn"] * camera.dn_scale
        )
    assert len(scales) > 1
    write_drawn(tmp_path / "set", plan, sets[0])
    assert (
        json.loads((tmp_path / "set" / "capture.json").read_text())["camera"]["bits"] == camera_of(plan, sets[0]).bits
    )
