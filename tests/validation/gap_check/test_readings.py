"""Other readings of the catalogue's lines against closed forms; the first of each leave all codes as they were."""

from __future__ import annotations

import json
import re
import zlib
from collections import Counter
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import erf

from gap_check.camera import ALL_SEQUENCES, LASER_SEQUENCES, SEQUENCES, Camera, draw_camera, stream
from gap_check.effects import CATALOGUE, EFFECTS
from gap_check.generator import generate_sequence
from gap_check.light import air_screens, boil, exposure_modes, pupil, vibration_shifts
from gap_check.plan import Plan, draw_sets, key, load_plan, readings_of, write_drawn, write_plan
from gap_check.readings import AS_CATALOGUED, CHOICES, Readings, draw_readings
from gap_check.scene import dot_image, dot_list, dot_profile, ideal_image, spread
from gap_check.sensor import crosstalk, lagged, pixel_gain
from support import BY_NAME, FRAMES, Array, airy, codes, contrast, correlation, laser, light, moments

SIZE = 128
Y, X = np.mgrid[0:SIZE, 0:SIZE].astype(float)
OTHERS = [(name, choice) for name, choices in CHOICES.items() for choice in choices[1:]]


def with_readings(camera: Camera, **choices: Any) -> Camera:
    """The camera that reads these lines in another way."""
    return replace(camera, readings=Readings(**choices))


# Choices, drawings, plans.


def test_choices_are_of_catalogued_effects_and_begin_with_the_first_reading() -> None:
    assert set(CHOICES) <= set(CATALOGUE)
    assert [f.name for f in fields(Readings)] == list(CHOICES)
    assert all(getattr(AS_CATALOGUED, name) == choices[0] for name, choices in CHOICES.items())
    assert all(len(set(choices)) == len(choices) >= 2 for choices in CHOICES.values())
    assert draw_camera(1, 60, 50).readings == AS_CATALOGUED


def test_the_page_lists_all_readings() -> None:
    page = (Path(__file__).parents[3] / "docs" / "results" / "gap-check.md").read_text()
    table = page[page.index("## Where the catalogue leaves a choice") : page.index("## What can be seen at all")]
    rows = re.findall(r"^\| (`.*`) \| .* \| (.*) \|$", table, re.MULTILINE)
    assert {name for names, other in rows if other != "none" for name in re.findall(r"`(\w+)`", names)} == set(CHOICES)


@pytest.mark.parametrize("name", CHOICES)
def test_unknown_readings_are_refused(name: str) -> None:
    camera = draw_camera(1, 60, 50)
    for choice in CHOICES[name]:
        assert getattr(with_readings(camera, **{name: choice}).readings, name) == choice
    for wrong in ("middle", "", None):
        with pytest.raises(ValueError, match=f"^{name} has the readings {', '.join(CHOICES[name])}, not {wrong!r}$"):
            with_readings(camera, **{name: wrong})


def test_every_choice_is_drawn_as_often() -> None:
    drawn = [draw_readings(stream(seed, "readings")) for seed in range(400)]
    for name, choices in CHOICES.items():
        count = Counter(getattr(d, name) for d in drawn)
        assert set(count) == set(choices), name
        # Of 400 with probability p: five deviations.
        p = 1 / len(choices)
        assert all(abs(n - 400 * p) < 5 * np.sqrt(400 * p * (1 - p)) for n in count.values()), name
    assert len(set(drawn)) == 400


def test_plans_draw_readings_and_keys_tell_them(tmp_path: Path) -> None:
    effects = ("glare", "gamma", "prnu")
    members: dict[str, Any] = {
        "name": "mine",
        "width": 60,
        "height": 50,
        "frames": 2,
        "singles_each": 6,
        "single_effects": effects,
    }
    usual = Plan(**members)
    (tmp_path / "plan.json").write_text(json.dumps({**members, "other_readings": True}))
    other = load_plan(str(tmp_path / "plan.json"))
    assert not usual.other_readings
    assert other == replace(usual, other_readings=True)
    write_plan(tmp_path / "out", other)
    assert load_plan(str(tmp_path / "out" / "plan.json")) == other
    with pytest.raises(ValueError, match="holds another plan"):
        write_plan(tmp_path / "out", usual)
    sets = draw_sets(other)
    assert sets == draw_sets(usual)  # the same sets, read in another way
    differ = 0
    for entry in sets:
        (effect,) = entry.strengths
        assert readings_of(usual, entry) == AS_CATALOGUED
        assert readings_of(other, entry) == readings_of(other, entry)
        chosen = key(other, entry)["readings"]
        assert chosen == ({} if effect == "prnu" else {effect: getattr(readings_of(other, entry), effect)})
        if effect == "glare" and chosen != {"glare": "exponential"}:
            for name, plan in (("usual", usual), ("other", other)):
                write_drawn(tmp_path / name, plan, entry)
            before, after = (np.load(tmp_path / name / "dots_static.npy") for name in ("usual", "other"))
            assert not np.array_equal(before, after)
            camera = replace(draw_camera(entry.camera_seed, 60, 50), readings=readings_of(other, entry))
            expected = generate_sequence(camera, BY_NAME["dots_static"], entry.effects, 2, entry.seed)
            assert np.array_equal(after, expected)
            assert "lorentzian" not in (tmp_path / "other" / "capture.json").read_text()
            differ += 1
    assert differ > 0


# CRC-32 of all sequences (48 x 40 pixels, 3 frames, strength 0.6), as the generator wrote them before it had readings.
# Rounded codes bear other processors' last bits; they change where NumPy's generators of random numbers do.
BEFORE = """
nothing 9f34b18c, linewidth 2752affc, power_flicker 5e1423a3, wavelength_shift 434a6067, beam_skew e85d26a9,
beam_flat_top e560212a, zero_order 1bd59dec, ghost_dots 8041a13d, scatter_background c132ad85,
depolarization ee12a058, low_roughness b119dbf4, subsurface_scattering 0697cbef, motion_decorrelation 5fb1cd27,
surface_boiling 8f4636cb, airflow c715aa33, vibration 4ba89616, defocus 42f9844e, vignetting aa6fc1ab,
aperture_mismatch dd19394c, pupil_obstruction 8384c624, glare c15cc4f2, ambient_light ad75c7d7,
lens_distortion b85b1ab8, pixel_integration 26aff40e, crosstalk 8fa87a1b, shot_noise 1b5f6372, prnu 9b9c4bca,
dsnu ceeb5d50, column_fpn a5ecfa89, hot_pixels ff5b9fac, row_noise f15be4c3, gamma da54d254, full_well 7eed5398,
adc_bits ff40037a, bayer_mismatch ec89c43c, image_lag 32e3acfb, power_warm_up 7106887c,
row_band_flicker 7b82f159, missing_dots ab4d829c, unequal_dots 06868a2c, pattern_rotation 62a8eed5,
uncorrelated_speckle e8ac373a, albedo_texture a3172f3d, image_drift 47c1a0a9, stick_slip 2d4c12de,
mirror_ghost 449d2943, etalon_fringes ba3d63a7, tilt_blur e19de642, elliptical_pupil a1c45033,
window_double_image 9f3a4219, block_compression d60d1141, odd_even_row_gain b33f1c72, frame_repeats 9a11e259,
charge_transfer_smear 4318667e, column_smear ab7aaf03, median_denoising e3b3ff18,
nothing:unit_phasor 6a1aa279, motion_decorrelation:unit_phasor f7fefaa4, surface_boiling:unit_phasor 74765f93
"""


def test_first_readings_leave_all_codes_as_they_were() -> None:
    changed = []
    for item in BEFORE.replace("\n", " ").split(","):
        what, before = item.split()
        effect, _, field = what.partition(":")
        camera = draw_camera(6, 48, 40, field or "circular_gaussian")
        effects: dict[str, Any] = {} if effect == "nothing" else {effect: EFFECTS[effect].at(0.6)}
        checksum = 0
        for sequence in SEQUENCES:
            checksum = zlib.crc32(generate_sequence(camera, sequence, effects, 3, 7).astype("<u2").tobytes(), checksum)
        if f"{checksum:08x}" != before:
            changed.append(what)
    assert not changed


def test_readings_of_effects_that_are_off_change_nothing() -> None:
    for seed in range(4):
        usual = draw_camera(3, 60, 50)
        other = replace(usual, readings=draw_readings(stream(seed, "readings")))
        for name in ALL_SEQUENCES:
            assert np.array_equal(codes(other, name, 3), codes(usual, name, 3))
            noise: dict[str, Any] = {"shot_noise": {"dn_per_electron": 0.3}, "row_noise": {"sigma_dn": 2.0}}
            photons = replace(other, readings=replace(other.readings, shot_noise="poisson"))
            assert np.array_equal(codes(photons, name, 3, **noise), codes(usual, name, 3, **noise))


@pytest.mark.parametrize(("name", "choice"), OTHERS)
@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
def test_every_reading_shows_where_its_effect_does(name: str, choice: str, field: str) -> None:
    usual = draw_camera(3, 60, 50, field)
    other = with_readings(usual, **{name: choice})
    effects: dict[str, Any] = {name: EFFECTS[name].at(1.0)}
    if name in ("gamma", "full_well", "nonlinearity", "ambient_light"):  # they differ in photons alone
        effects["shot_noise"] = EFFECTS["shot_noise"].at(1.0)
    shows = [
        s for s in ALL_SEQUENCES if not np.array_equal(codes(usual, s, 4, **effects), codes(other, s, 4, **effects))
    ]
    expected = set(CATALOGUE[name].sequences)
    if (name, field) == ("surface_boiling", "unit_phasor"):  # phasors' moduli stay by either reading
        expected = set()
    if (name, choice) == ("image_lag", "added"):  # a scene that rests sees its own past
        expected = {*LASER_SEQUENCES, "flat"}
    if name == "ambient_light":  # the flat sees it, too; calibration takes it for the flat's gain
        expected = {*LASER_SEQUENCES, "flat"}
    if name == "defocus":  # another draw of the same speckle
        expected = set(LASER_SEQUENCES)
    if name == "full_well" and "flat" not in shows:  # this camera's flat is below the well
        expected -= {"flat"}
    assert set(shows) == expected


# Surface and motion.


@pytest.mark.parametrize("field", ["circular_gaussian", "unit_phasor"])
@pytest.mark.parametrize("lags", [0.4, 2.5])
def test_gaussian_decorrelation(camera: Camera, lags: float, field: str) -> None:
    """K^2 = 2 integral (1 - t) exp(-a^2 t^2), a = sqrt(2) lags: sqrt(pi) erf(a) / a - (1 - exp(-a^2)) / a^2."""
    a = np.sqrt(2) * lags
    expected = np.sqrt(np.sqrt(np.pi) * erf(a) / a - (1 - np.exp(-a * a)) / (a * a))
    camera = with_readings(replace(camera, field=field), motion_decorrelation="gaussian")
    baseline = contrast(laser(camera, frames=8)) if field == "unit_phasor" else 1.0
    measured = contrast(laser(camera, frames=12, motion_decorrelation={"lags": lags}))
    # Tolerances as for the exponential; what that would have is 0.05 (weak) or 0.11 (strong) away.
    assert measured == pytest.approx(expected * baseline, abs=0.03 if field == "circular_gaussian" else 0.04)
    values, integrals = exposure_modes(lags, 200, "gaussian")
    assert values.sum() == pytest.approx(1)
    assert (values**2).sum() == pytest.approx(expected**2, rel=1e-3)
    assert (integrals**2).sum() == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("choice", CHOICES["airflow"])
def test_airflow(camera: Camera, choice: str) -> None:
    scale, frames = 6.0, 150
    setting: dict[str, Any] = {"rms_rad": 0.7, "scale_px": scale}
    screens = air_screens(with_readings(camera, airflow=choice), setting, frames, 5, "board_static")
    if choice == "wind":
        for t in (1, 2, 40):
            assert np.array_equal(screens[t], np.roll(screens[0], 3 * t, axis=1))
        return
    # A screen has 128^2 / (4 pi scale^2) = 36 patches (18 of the wide ones), and 150 frames are some 15 (fast: 50) new
    # ones: 540 (270) values, which know a deviation within 4 % and a correlation within 0.03.
    assert screens.std() == pytest.approx(0.7, rel=0.1)
    patch = 2 * scale**2 * (2 if choice == "wide" else 1)
    for lag in (4, 8):
        expected = np.exp(-(lag**2) / patch)
        assert correlation(screens, 0, lag) == pytest.approx(expected, abs=0.06)
        assert correlation(screens, lag, 0) == pytest.approx(expected, abs=0.06)
    following = (screens[1:] * screens[:-1]).mean() / screens.var()
    assert following == pytest.approx(0.5 if choice == "fast" else np.exp(-1 / 5), abs=0.05)


def test_boiling_phases_keep_their_moduli(camera: Camera) -> None:
    tau = 10.0
    camera = with_readings(camera, surface_boiling="phases")
    z = boil(camera, 30, tau, stream(1, "boil"))
    assert np.allclose(np.abs(z), np.abs(z[0]))
    # 16 384 pixels: 0.01. Circular Gaussian in each frame: E |z|^2 = 1, E |z|^4 = 2 within 0.035.
    assert (np.abs(z[0]) ** 2).mean() == pytest.approx(1, abs=0.04)
    assert (np.abs(z[0]) ** 4).mean() == pytest.approx(2, abs=0.18)
    for lag in (1, 5, 10):
        measured = (z[lag:] * z[:-lag].conj()).mean()
        assert measured == pytest.approx(np.exp(-lag / tau), abs=0.02), lag
    # Intensities: with the moduli's part, k = sum |h|^4 / (sum |h|^2)^2: r^2 + k (1 - r^2), r = exp(-lag / tau).
    h2 = np.abs(np.fft.ifft2(pupil(camera, {}))) ** 2
    k = (h2**2).sum() / h2.sum() ** 2
    frames = laser(camera, "board_static", 40, surface_boiling={"correlation_frames": tau})
    delta = frames - frames.mean()
    for lag in (1, 5, 10):
        r2 = np.exp(-2 * lag / tau)
        measured = (delta[lag:] * delta[:-lag]).mean() / delta.var()
        assert measured == pytest.approx(r2 + k * (1 - r2), abs=0.05), lag


def periodic_shift(frame: Array, x: float, y: float) -> Array:
    fy, fx = np.fft.fftfreq(SIZE)[:, None], np.fft.fftfreq(SIZE)[None, :]
    return np.fft.ifft2(np.fft.fft2(frame) * np.exp(-2j * np.pi * (fx * x + fy * y))).real


def spline_transfer(shift: float, order: int) -> Array:
    """Transfer along an axis of a shift by interpolation: straight lines, or cubic B-splines through the samples."""
    turn = 2 * np.pi * np.fft.fftfreq(SIZE)
    whole, s = np.floor(shift), shift - np.floor(shift)
    if order == 1:
        weights, through = {0: 1 - s, 1: s}, np.ones(SIZE)
    else:
        weights = {-1: (1 - s) ** 3, 0: 4 - 6 * s**2 + 3 * s**3, 1: 1 + 3 * s + 3 * s**2 - 3 * s**3, 2: s**3}
        through = 4 + 2 * np.cos(turn)
    return np.asarray(sum(w * np.exp(-1j * turn * (whole + n)) for n, w in weights.items()) / through)


@pytest.mark.parametrize(("choice", "order"), [("linear", 1), ("cubic", 3)])
@pytest.mark.parametrize("name", ["board_static", "dots_static"])
def test_vibration_by_interpolation(camera: Camera, choice: str, order: int, name: str) -> None:
    effects: dict[str, Any] = {"vibration": {"rms_px": 0.3}}
    still = light(camera, name)[0]
    shaken = light(with_readings(camera, vibration=choice), name, **effects)
    field = light(camera, name, **effects)
    shifts = vibration_shifts(BY_NAME[name], effects, FRAMES, 5)
    assert shifts is not None
    assert shaken.shape == (FRAMES, SIZE, SIZE)
    for frame, ideal, (x, y) in zip(shaken, field, shifts, strict=True):
        transfer = spline_transfer(y, order)[:, None] * spline_transfer(x, order)[None, :]
        assert np.allclose(frame, np.maximum(np.fft.ifft2(np.fft.fft2(still) * transfer).real, 0), atol=1e-9)
        assert np.allclose(ideal, periodic_shift(still, x, y), atol=1e-9)  # by the same path
    assert np.array_equal(
        light(with_readings(camera, vibration=choice), "board_moving", 3, **effects), light(camera, frames=3)
    )


# Laser, DOE: dots.


def test_ghosts_along_one_axis(camera: Camera) -> None:
    positions, _ = dot_list(camera, {}, 1)
    for choice, along in (("x", (7.5, 0.0)), ("y", (0.0, 7.5))):
        more, faint = dot_list(with_readings(camera, ghost_dots=choice), {"ghost_dots": {"relative_intensity": 0.2}}, 1)
        assert np.allclose(more[len(positions) :] - positions, along)
        assert np.allclose(faint[len(positions) :], 0.2)


def test_lopsided_along_other_axes(camera: Camera) -> None:
    setting: dict[str, Any] = {"beam_skew": {"skew": 0.8}}
    y, x = np.mgrid[-20:20.01:0.25, -20:20.01:0.25]
    along_x = dot_profile(x, y, 2.2, setting)
    assert np.allclose(dot_profile(x, y, 2.2, setting, "-x"), along_x[:, ::-1])
    assert np.allclose(dot_profile(x, y, 2.2, setting, "y"), along_x.T)
    diagonal = dot_profile(x, y, 2.2, setting, "diagonal")
    turned = dot_profile((x + y) / np.sqrt(2), (y - x) / np.sqrt(2), 2.2, setting)
    assert np.allclose(diagonal, turned)
    centres = {}
    single = replace(camera, positions_px=np.array([[60.0, 70.0]]))
    for choice in CHOICES["beam_skew"]:
        image = dot_image(with_readings(single, beam_skew=choice), setting, 1)
        centre, _ = moments(image)
        third = [(image * (places - c) ** 3).sum() / image.sum() for places, c in zip((X, Y), centre, strict=True)]
        centres[choice] = np.array(third) / camera.dot_sigma_px**3
    strong = centres["x"][0]
    assert 0.4 < strong < 0.8
    assert centres["x"] == pytest.approx([strong, 0], abs=1e-6)
    assert centres["-x"] == pytest.approx([-strong, 0], abs=1e-6)
    assert centres["y"] == pytest.approx([0, strong], abs=1e-6)
    # Along a diagonal: E u^3 of u = (x + y) / sqrt(2) is what it was along x; x and y share it.
    assert centres["diagonal"][0] == pytest.approx(centres["diagonal"][1])
    assert 0.2 * strong < centres["diagonal"][0] < 0.6 * strong


def test_shorter_wavelength_draws_dots_together(camera: Camera) -> None:
    axis = np.array(camera.axis_px)
    setting: dict[str, Any] = {"wavelength_shift": {"delta_nm": 9.4}}
    moved, powers = dot_list(with_readings(camera, wavelength_shift="shorter"), setting, 1)
    assert np.allclose(moved - axis, 0.99 * (camera.positions_px - axis))
    assert np.array_equal(powers, np.ones(len(moved)))


@pytest.mark.parametrize("choice", CHOICES["lens_distortion"])
def test_distortion_of_images_and_of_positions(camera: Camera, choice: str) -> None:
    k1 = 0.05
    setting: dict[str, Any] = {"lens_distortion": {"k1": k1}}
    single = with_readings(replace(camera, positions_px=np.array([[104.0, 94.0]])), lens_distortion=choice)
    offset = single.positions_px[0] - camera.axis_px
    expected = camera.axis_px + offset * (
        1 + (-k1 if "inward" in choice else k1) * (offset @ offset) / camera.corner_px**2
    )
    image = dot_image(single, setting, 1)
    centre, variances = moments(image)
    assert centre == pytest.approx(expected, abs=0.05)
    listed, _ = dot_list(single, setting, 1)
    r2 = ((X - expected[0]) ** 2 + (Y - expected[1]) ** 2) / camera.dot_sigma_px**2
    if "positions" in choice:  # a dot as it was, at another place
        assert listed[0] == pytest.approx(expected)
        assert np.allclose(image, np.exp(-r2 / 2), atol=1e-12)
    else:  # stretched: along the radius by 1 + 3 k1 r^2
        assert np.array_equal(listed, single.positions_px)
        assert (variances > 1.01 * camera.dot_sigma_px**2).all() == ("inward" not in choice)
        assert not np.allclose(image, np.exp(-r2 / 2), atol=0.01)


def test_scattered_light_on_top(camera: Camera) -> None:
    plain = ideal_image(camera, BY_NAME["dots_static"], {}, 1)
    setting: dict[str, Any] = {"scatter_background": {"fraction": 0.25}}
    added = ideal_image(with_readings(camera, scatter_background="added"), BY_NAME["dots_static"], setting, 1)
    assert np.allclose(added, plain + 0.25 * plain.mean())


# Optics.


def test_tails() -> None:
    point = np.zeros((401, 401))
    point[200, 200] = 1
    tails: Any
    for tails in CHOICES["glare"]:
        assert spread(point, 3.0, tails).sum() == pytest.approx(1)
    whole, cut, wide = (spread(point, 3.0, tails)[200, 200:] for tails in ("exponential", "truncated", "lorentzian"))
    r = np.arange(201) / 3.0
    assert np.allclose(whole / whole[0], np.exp(-r), atol=1e-9)
    assert np.allclose(cut / cut[0], np.exp(-r) * (r <= 4), atol=1e-9)
    assert cut[0] > whole[0]
    assert np.allclose(wide / wide[0], (1 + r * r) ** -1.5, atol=1e-9)
    # A line's image: 2 / (1 + (y / scale)^2); the 401 pixels' ends take 0.1 % at most.
    line = spread(point, 3.0, "lorentzian").sum(axis=1)[200:]
    assert line[[3, 6, 12, 30]] / line[0] == pytest.approx(1 / (1 + r[[3, 6, 12, 30]] ** 2), rel=0.02)


@pytest.mark.parametrize("choice", CHOICES["glare"])
def test_glare_and_subsurface_scattering_take_their_tails(camera: Camera, choice: Any) -> None:
    plain = light(camera, "dots_static")
    glare = light(with_readings(camera, glare=choice), "dots_static", glare={"fraction": 0.2, "scale_px": 6.0})
    assert np.allclose(glare, 0.8 * plain + 0.2 * spread(plain, 6.0, choice))
    if choice in CHOICES["subsurface_scattering"]:
        image = ideal_image(camera, BY_NAME["dots_static"], {}, 1)
        setting: dict[str, Any] = {"subsurface_scattering": {"length_px": 2.0, "fraction": 0.6}}
        soft = ideal_image(with_readings(camera, subsurface_scattering=choice), BY_NAME["dots_static"], setting, 1)
        assert np.allclose(soft, 0.4 * image + 0.6 * spread(image, 2.0, choice))


def test_defocus_to_the_other_side(camera: Camera) -> None:
    """The conjugate pupil: the spot turned by 180 degrees, which is the same one."""
    setting: dict[str, Any] = {"defocus": {"waves": 1.3}}
    far, near = pupil(camera, setting), pupil(with_readings(camera, defocus="near"), setting)
    assert np.allclose(near, far.conj())
    assert np.abs(near - far).max() > 1
    assert np.allclose(np.abs(np.fft.ifft2(near)), np.abs(np.fft.ifft2(far)))


# Sensor.


@pytest.mark.parametrize("points", [2, 3])
def test_pixels_of_points(camera: Camera, points: int) -> None:
    """The mean of the light at n x n points; K^2 is the mean of |mu|^2 over all pairs of them."""
    setting: dict[str, Any] = {"pixel_integration": {"fill_factor": 1.0}}
    offsets = (np.arange(points) - (points - 1) / 2) / points
    places = [(x, y) for x in offsets for y in offsets]
    still = laser(camera, "board_static")[0]
    measured = laser(with_readings(camera, pixel_integration=f"points{points}"), "board_static", **setting)[0]
    assert np.allclose(measured, np.mean([periodic_shift(still, x, y) for x, y in places], axis=0), atol=1e-9)
    pairs = [airy(camera.diameter, np.hypot(a[0] - b[0], a[1] - b[1])) for a in places for b in places]
    area = laser(with_readings(camera, pixel_integration=f"points{points}"), **setting)
    assert contrast(area) / contrast(laser(camera)) == pytest.approx(np.sqrt(np.mean(pairs)), abs=0.005)


@pytest.fixture(scope="module")
def bright(camera: Camera) -> Camera:
    """A flat of 400 DN over black."""
    return replace(camera, level_dn=400.0 / camera.flat_gain)


def read_variance(camera: Camera) -> float:
    return camera.read_noise_dn**2 + 1 / 12


def test_photons_after_the_curve(bright: Camera) -> None:
    """Variance k S times the squared slope of the curve, or k times the curve's value. 390 000 samples: 0.25 %."""
    k, exponent = 0.3, 0.75
    effects: dict[str, Any] = {"gamma": {"gamma": exponent}, "shot_noise": {"dn_per_electron": k}}
    value = 1023 * (400 / 1023) ** exponent
    slope = exponent * value / 400
    for choice, expected in (("after_photons", k * 400 * slope**2), ("before_photons", k * value)):
        flat = codes(with_readings(bright, gamma=choice), "flat", **effects)
        assert flat.var(axis=0, ddof=1).mean() == pytest.approx(expected + read_variance(bright), rel=0.012), choice
        assert flat.mean() == pytest.approx(value + bright.black_dn, abs=0.2), choice
    before = with_readings(bright, gamma="before_photons")  # without photons there is no before
    bent = {"gamma": effects["gamma"]}
    assert np.array_equal(codes(before, "flat", 3, **bent), codes(bright, "flat", 3, **bent))


def test_photons_after_the_well(bright: Camera) -> None:
    """The level is 9 deviations of the photons below the signal: it cuts their noise off, or the noise is its own."""
    k, level = 0.3, 300.0
    effects: dict[str, Any] = {"full_well": {"level_dn": level}, "shot_noise": {"dn_per_electron": k}}
    for choice, expected in (("after_photons", 0.0), ("before_photons", k * level)):
        flat = codes(with_readings(bright, full_well=choice), "flat", **effects)
        assert flat.var(axis=0, ddof=1).mean() == pytest.approx(expected + read_variance(bright), rel=0.012), choice
        assert flat.mean() == pytest.approx(level + bright.black_dn, abs=0.1), choice


def test_converter_that_cuts_off(camera: Camera) -> None:
    for bits, step in ((8, 4), (6, 16)):
        for name in ("dark", "board_moving"):
            plain = codes(camera, name, 4)
            down = codes(with_readings(camera, adc_bits="down"), name, 4, adc_bits={"bits": float(bits)})
            assert np.array_equal(down, plain // step * step)


def test_lags_of_a_flash(camera: Camera) -> None:
    f = 0.15
    flash = np.zeros((6, 2, 2))
    flash[1] = 100.0
    for choice, expected in (
        ("once", [85, 15, 0, 0, 0]),
        ("recursive", 85 * f ** np.arange(5)),
        ("added", [100, 15, 0, 0, 0]),
    ):
        seen = lagged(with_readings(camera, image_lag=choice), flash, f)
        assert seen[:, 0, 0] == pytest.approx(expected), choice
        steady = lagged(with_readings(camera, image_lag=choice), np.full((6, 2, 2), 100.0), f)
        assert np.allclose(steady, 115 if choice == "added" else 100), choice
    assert flash[2:].max() == 0  # what came in stays as it was


@pytest.mark.parametrize("choice", CHOICES["image_lag"])
def test_image_lag(camera: Camera, choice: str) -> None:
    """Frames of independent speckle correlate by f (1 - f) / (f^2 + (1 - f)^2), by f^n, by f / (1 + f^2)."""
    f = 0.15
    setting: dict[str, Any] = {"image_lag": {"fraction": f}}
    camera = with_readings(camera, image_lag=choice)
    frames = codes(camera, "board_moving", 40, **setting)
    delta = frames - frames.mean()
    variance = delta.var() - read_variance(camera)
    expected = {
        "once": [f * (1 - f) / (f * f + (1 - f) ** 2), 0],
        "recursive": [f, f * f],
        "added": [f / (1 + f * f), 0],
    }
    # 40 frames of 1900 grains know a correlation within 0.004.
    for lag in (1, 2):
        measured = (delta[lag:] * delta[:-lag]).mean() / variance
        assert measured == pytest.approx(expected[choice][lag - 1], abs=0.02), lag
    # Scenes that rest are as bright as those that move: the flat exactly, speckle within 1.5 % and what is clipped.
    rise = 1 + f * (choice == "added")
    flat = codes(camera, "flat", 4, **setting).mean() - camera.black_dn
    assert flat == pytest.approx(rise * camera.level_dn * camera.flat_gain, abs=0.1)
    for name in ("board_static", "board_moving"):
        mean = codes(camera, name, **setting).mean() - camera.black_dn
        assert mean == pytest.approx(rise * camera.level_dn, rel=0.05), name


@pytest.mark.parametrize("choice", CHOICES["shot_noise"])
def test_third_moment_of_photons(bright: Camera, choice: str) -> None:
    """Poisson: variance k S, third central moment k^2 S; Gaussian: the same variance, none."""
    k = 2.0
    flat = codes(with_readings(bright, shot_noise=choice), "flat", shot_noise={"dn_per_electron": k})
    delta = flat - flat.mean()
    assert flat.mean() == pytest.approx(400 + bright.black_dn, abs=0.3)
    assert delta.var() == pytest.approx(k * 400 + read_variance(bright), rel=0.012)
    # 390 000 samples: sqrt(6 / n) sigma^3 = 91.
    assert (delta**3).mean() == pytest.approx(k * k * 400 if choice == "poisson" else 0, abs=400)


def test_hot_pixels(camera: Camera) -> None:
    setting: dict[str, Any] = {"hot_pixels": {"fraction": 0.01, "mean_dn": 150.0}}
    dark = codes(camera, "dark")
    rise = {
        c: (codes(with_readings(camera, hot_pixels=c), "dark", **setting) - dark).mean(axis=0)
        for c in CHOICES["hot_pixels"]
    }
    hot = rise["constant"] > 75
    assert hot.sum() == pytest.approx(164, abs=5 * 12.8)
    for values in rise.values():  # the same pixels
        assert values[~hot].max() == 0
    # Both codes are rounded: 0.083 DN in the mean of 24 frames.
    assert rise["constant"][hot] == pytest.approx(np.full(hot.sum(), 150.0), abs=0.5)
    # 164 of a deviation of 150 / sqrt(3) = 87: mean within 7, deviation within 4 (the fourth moment is 9/5).
    assert rise["uniform"][hot].mean() == pytest.approx(150, abs=27)
    assert rise["uniform"][hot].std() == pytest.approx(150 / np.sqrt(3), abs=16)
    assert rise["uniform"].max() < 300.5
    assert rise["exponential"].max() > 400  # 164 draws: exp(-164 exp(-8 / 3)) leaves 1e-5 below


def test_green_sites(camera: Camera) -> None:
    signal = camera.level_dn * camera.flat_gain
    for choice, expected in (
        ("odd_even", [1, 0.95, 1.05, 1]),
        ("even_odd", [1, 1.05, 0.95, 1]),
        ("main_diagonal", [0.95, 1, 1, 1.05]),
    ):
        flat = codes(with_readings(camera, bayer_mismatch=choice), "flat", bayer_mismatch={"delta": 0.05}).mean(axis=0)
        sites = [(flat[row::2, column::2].mean() - camera.black_dn) / signal for row in (0, 1) for column in (0, 1)]
        # 98 000 samples of 4 DN on 390: 3e-5.
        assert sites == pytest.approx(expected, abs=3e-4), choice


def test_crosstalk_around_the_border(camera: Camera) -> None:
    point = np.zeros((1, 9, 9))
    point[0, 0, 8] = 1
    periodic = crosstalk(point, 0.2, "periodic")[0]
    assert periodic[0, 8] == pytest.approx(0.8)
    assert [periodic[8, 8], periodic[1, 8], periodic[0, 7], periodic[0, 0]] == pytest.approx([0.05] * 4)
    assert crosstalk(point, 0.2)[0, 0, 8] == pytest.approx(0.9)
    # Within the sensor, whose read noise is left out here: inside nothing differs, at the border it comes from beyond.
    quiet = replace(camera, read_noise_dn=0.0)
    setting: dict[str, Any] = {"crosstalk": {"fraction": 0.2}}
    usual, other = (
        codes(c, "board_static", 1, **setting)[0] for c in (quiet, with_readings(quiet, crosstalk="periodic"))
    )
    assert np.array_equal(usual[1:-1, 1:-1], other[1:-1, 1:-1])
    signal = camera.level_dn * laser(camera, "board_static")[0]
    around = sum(np.roll(signal, move, axis=(0, 1)) for move in ((1, 0), (-1, 0), (0, 1), (0, -1)))
    expected = np.clip(np.round(0.8 * signal + 0.05 * around + camera.black_dn), 0, 1023)
    assert np.array_equal(other, expected)


def test_smooth_ambient_light(bright: Camera) -> None:
    """Of 400 DN from the flat and 40 from elsewhere all have photon noise, or the flat's alone; gains go for both."""
    k = 0.3
    effects: dict[str, Any] = {"ambient_light": {"level_dn": 40.0}, "shot_noise": {"dn_per_electron": k}}
    smooth = with_readings(bright, ambient_light="smooth")
    for camera, photons in ((bright, 440), (smooth, 400)):
        flat = codes(camera, "flat", **effects)
        assert flat.var(axis=0, ddof=1).mean() == pytest.approx(k * photons + read_variance(bright), rel=0.012)
        assert flat.mean() == pytest.approx(440 + bright.black_dn, abs=0.1)
    # As much of it as there is: under vignetting, in the corners of the flat. 1024 pixels of 24 frames: 0.9 %.
    dim: dict[str, Any] = {**effects, "ambient_light": {"level_dn": 200.0}, "vignetting": {"corner_loss": 0.45}}
    flat = codes(smooth, "flat", **dim)
    ends = np.r_[0:16, 112:128]
    light_there = 400 * (1 - 0.45 * ((X - 63.5) ** 2 + (Y - 63.5) ** 2) / camera.corner_px**2)[np.ix_(ends, ends)]
    measured = flat.var(axis=0, ddof=1)[np.ix_(ends, ends)].mean()
    assert measured == pytest.approx(k * light_there.mean() + read_variance(bright), rel=0.05)
    # Far from a single dot there is ambient light alone: 40 DN times the pixel's gain, nothing where that is 0.
    single = replace(smooth, positions_px=np.array([[20.0, 20.0]]))
    uneven: dict[str, Any] = {"prnu": {"sigma": 0.03}, "dead_pixels": {"fraction": 0.02}}
    gain = pixel_gain(single, uneven, 5)
    assert gain is not None
    frames = codes(single, "dots_static", **effects, **uneven) - single.black_dn
    mean, gain = frames.mean(axis=0)[64:, 64:], gain[64:, 64:]
    blind = gain == 0
    assert mean[blind].mean() == pytest.approx(0, abs=0.5)  # some 80 pixels of 24 frames: 0.1 DN
    # The gains' deviation is 1.2 DN, the means' noise 0.8 on 4000 pixels: a slope within 0.4.
    assert np.polyfit(gain[~blind], mean[~blind], 1)[0] == pytest.approx(40, abs=2)
    assert frames[:, 64:, 64:][:, ~blind].var(axis=0, ddof=1).mean() == pytest.approx(read_variance(bright), rel=0.03)
