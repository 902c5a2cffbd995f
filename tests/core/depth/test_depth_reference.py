"""Depth from dots against scenes with known truth, SciPy's fits, trying every pair, and the Cramer-Rao bound."""

from __future__ import annotations

import resource
import subprocess
import sys

import clspeckle
import numpy as np
import pytest
from clspeckle import _library

from reference import depth as reference

SIGMA = 1.0
NEAR, FAR = 0.4, 4.0
RIG = reference.rig()
DIRECTIONS = reference.semi_random_directions((0.72, 0.58), 7.5 / RIG.fx, seed=3)


@pytest.fixture(scope="module")
def camera(context):
    return make(context)


def make(context, rig=RIG, directions=DIRECTIONS, **options):
    options = {"near_m": NEAR, "far_m": FAR, "dot_sigma_px": SIGMA, **options}
    return clspeckle.Depth(rig.shape, directions, rig.laser_from_camera, rig.intrinsics, context=context, **options)


def frame_of(name, sigma=SIGMA, **options):
    return reference.render(RIG, reference.SCENES[name], DIRECTIONS, sigma, scale=1000.0, **options)


def truth_of(dots, frame):
    """Centre errors (n, 2) and depth errors of placed dots whose identity is right; how many are wrong."""
    index = dots["dot_index"]
    error = np.stack([dots["x_px"], dots["y_px"]], axis=1) - frame.centres[index]
    right = np.hypot(*error.T) < 1.5  # NaN, a dot that the camera does not see, is not
    return error[right], (dots["depth_m"] - frame.depths[index])[right], right


@pytest.mark.parametrize("name", reference.SCENES)
def test_scenes_without_noise(camera, measured, name):
    """The bar: 99.9 % of the visible dots identified, centres good to 0.01 px RMS. Visible: reference.depth.Frame.
    Under more than 60 degrees (the sphere's limb) the middle of the lit spot is not the middle of the beam any more
    (docs/guide/depth.md), so the centre's bar is for the others; identity has no such limit."""
    frame = frame_of(name)
    result = camera.measure(frame.image.astype(np.float32))
    placed = result.placed
    error, depth_error, right = truth_of(placed, frame)
    found = np.zeros(len(DIRECTIONS), bool)
    found[placed["dot_index"][right]] = True
    assert frame.visible.sum() > 1800
    share = found[frame.visible].mean()
    measured("1 - identified share", 1 - share)
    assert share >= 0.999
    clean = (frame.visible & (frame.cosines > 0.5))[placed["dot_index"][right]]
    rms = np.sqrt((error[clean] ** 2).sum(axis=1).mean())
    measured("centre error, RMS, px", rms)
    assert clean.sum() > 1700
    assert rms < 0.01
    # A centre error moves depth by z^2 / (f b) per pixel; the beam's half is across the lines.
    scale = frame.depths[placed["dot_index"][right]][clean] ** 2 / (RIG.fx * np.linalg.norm(RIG.laser))
    assert np.sqrt(np.mean((depth_error[clean] / scale) ** 2)) < 0.011
    wrong = (~right) & (placed["flags"] == 0)
    measured("wrong dots, share", wrong.mean())
    assert wrong.mean() < 0.005
    assert not result.summary.warnings


def test_frames_of_the_library_itself(context, camera, measured):
    """Rendered by Pattern: a texture of the same dots, looked up bilinearly, on a turned wall. Texels of a sixth of a
    sigma widen the dots a little and evenly."""
    texels, half = 3000, (0.75, 0.6)
    height = round(texels * half[1] / half[0])
    pitch = 2 * half[0] / texels
    pattern_dots = clspeckle.Dots(
        (height, texels),
        (DIRECTIONS + half) / pitch - 0.5,
        sigma_px=SIGMA / RIG.fx / pitch,
        context=context,
    )
    pattern = clspeckle.Pattern(
        pattern_dots.render(),
        half_extent_x=half[0],
        half_extent_y=height * pitch / 2,
        power_scale=1000.0,
        laser_from_geometry=RIG.laser_from_camera,
        context=context,
    )
    truth = frame_of("turned wall")
    geometry = clspeckle.Geometry(
        depth=truth.depth.astype(np.float32), intrinsics=RIG.intrinsics, normal=truth.normal.astype(np.float32)
    )
    image = pattern.lookup(geometry)
    assert np.corrcoef(image.ravel(), truth.image.ravel())[0, 1] > 0.999
    result = camera.measure(image)
    error, _, right = truth_of(result.placed, truth)
    found = np.zeros(len(DIRECTIONS), bool)
    found[result.placed["dot_index"][right]] = True
    assert found[truth.visible].mean() >= 0.999
    clean = truth.visible[result.placed["dot_index"][right]]
    rms = np.sqrt((error[clean] ** 2).sum(axis=1).mean())
    measured("centre error, RMS, px", rms)
    assert rms < 0.01


def test_dots_of_the_library_itself(context, measured):
    """Dots of one width in the image plane (clspeckle.Dots), crowded: centres to single precision."""
    shape = (200, 260)
    positions = reference.semi_random_directions((120, 90), 7.0, seed=8) + (129.5, 99.5)
    peaks = np.random.default_rng(9).uniform(60, 200, len(positions))
    image = clspeckle.Dots(shape, positions, sigma_px=1.3, peaks=peaks, context=context).render() + 10
    dots = clspeckle.Depth(shape, dot_sigma_px=1.5, context=context).measure(image).dots
    assert len(dots) == len(positions)
    got = np.stack([dots["x_px"], dots["y_px"]], axis=1)
    nearest = np.argmin(np.linalg.norm(got[:, None] - positions[None], axis=-1), axis=1)
    assert len(set(nearest)) == len(positions)
    error = np.linalg.norm(got - positions[nearest], axis=1)
    measured("centre error, RMS, px", np.sqrt(np.mean(error**2)))
    assert np.sqrt(np.mean(error**2)) < 1e-3
    centroid = np.stack([dots["centroid_x_px"], dots["centroid_y_px"]], axis=1)
    measured("centroid error, RMS, px", np.sqrt(np.mean((centroid - positions[nearest]) ** 2)))
    assert np.sqrt(np.mean((centroid - positions[nearest]) ** 2)) < 0.01
    np.testing.assert_allclose(dots["amplitude_dn"], peaks[nearest], rtol=1e-3)
    np.testing.assert_allclose(dots["shape_px2"][:, [0, 2]], 1.3**2, rtol=0.02)
    np.testing.assert_allclose(dots["background_dn"], 10, atol=0.5)


def test_dot_by_dot_against_scipy(camera, measured):
    """Centres by scipy.optimize.curve_fit, identities by trying every pair, points where two rays come nearest. On a
    noisy frame, so that not all is zero; dots that are alone in their window, as SciPy's are fitted alone. Widths and
    amplitudes too."""
    frame = frame_of("sphere")
    noisy = (frame.image + np.random.default_rng(4).normal(0, 1.0, frame.image.shape)).astype(np.float32)
    result = camera.measure(noisy)
    placed = result.placed
    centres = np.stack([placed["x_px"], placed["y_px"]], axis=1)
    distances = np.linalg.norm(centres[:, None] - centres[None], axis=-1) + 1e9 * np.eye(len(centres))
    lonely = (distances.min(axis=1) > 9.5) & (placed["flags"] == 0)
    assert lonely.sum() > 100
    window = int(np.ceil(3 * SIGMA))
    for dot in placed[lonely][::4]:
        best, covariance = reference.fit_dot(noisy, (dot["x_px"], dot["y_px"]), SIGMA, window)
        shift = np.hypot(dot["x_px"] - best[1], dot["y_px"] - best[2])
        # Neighbours' tails 9.5 px away are below 1e-7 of an amplitude, and a window may lie a pixel beside.
        same_window = (round(best[1]), round(best[2])) == (round(dot["x_px"]), round(dot["y_px"]))
        if not same_window:
            continue
        measured("centre against SciPy, px", shift)
        assert shift < 2e-3
        assert dot["amplitude_dn"] == pytest.approx(best[0], rel=2e-3)
        got = dot["covariance_px2"]
        np.testing.assert_allclose(got[[0, 2]], np.diag(covariance)[1:3], rtol=0.02)

    everyone = result.dots[result.dots["flags"] & _library.CLSP_DOT_FIT_FAILED == 0]
    brute = reference.identify(RIG, DIRECTIONS, np.stack([everyone["x_px"], everyone["y_px"]], 1), NEAR, FAR, 1.0)
    both = (everyone["reason"] == 0) & (brute >= 0)
    assert both.mean() > 0.95
    differ = (everyone["dot_index"][both] != brute[both]).mean()
    measured("identities that differ from brute force's", differ)
    assert differ < 0.005

    for dot in placed[lonely][::4]:
        point = reference.triangulate(RIG, DIRECTIONS[dot["dot_index"]], np.array([dot["x_px"], dot["y_px"]]))
        # Nearest in metres against nearest in pixels: off the axis, a pixel beside the line is worth a part of one
        # along it.
        along = abs(point[2] - dot["depth_m"]) / (dot["depth_m"] ** 2 / (RIG.fx * np.linalg.norm(RIG.laser)))
        measured(
            "point against the rays' middle, px along the line per px beside it", along / abs(dot["epipolar_error_px"])
        )
        assert along < 0.75 * abs(dot["epipolar_error_px"]) + 1e-6
        direction = RIG.rays(DIRECTIONS[dot["dot_index"]][None])[0]
        on_ray = np.cross(dot["position_m"] - RIG.laser, direction / np.linalg.norm(direction))
        assert np.linalg.norm(on_ray) < 1e-9


NOISES = {"read noise": (3.0, 0.0), "shot noise": (1.0, 0.5), "unknown": (3.0, 0.0)}


@pytest.mark.parametrize("kind", NOISES)
def test_noise_against_the_cramer_rao_bound(context, measured, kind):
    """One lattice of 400 dots at random places between the pixels, 30 frames of noise: 12 000 centres. The ratio of
    the error's variance to the bound's mean has a standard deviation of sqrt(2 / 24 000) = 0.9 %; 5 % allow for what
    least squares lose at this signal (amplitude over noise 11 to 27). The reported variances must agree as well."""
    read_noise, gain = NOISES[kind]
    rng = np.random.default_rng(11)
    sigma, amplitude, background, side = 1.4, 80.0, 20.0, 20 * 16
    grid = (np.stack(np.meshgrid(np.arange(20), np.arange(20)), -1).reshape(-1, 2) + 0.5) * 16
    places = grid + rng.uniform(-0.5, 0.5, grid.shape)
    y, x = np.mgrid[:side, :side]
    ideal = np.full((side, side), background)
    for px, py in places:
        ideal += amplitude * np.exp(-0.5 * ((x - px) ** 2 + (y - py) ** 2) / sigma**2)
    variance = read_noise**2 + gain * ideal
    known = {} if kind == "unknown" else {"read_noise_dn": read_noise, "dn_per_electron": gain}
    depth = clspeckle.Depth((side, side), dot_sigma_px=sigma, context=context, **known)
    radius = int(np.ceil(3 * sigma))
    bounds = []
    for px, py in places:
        u, v = round(px), round(py)
        part = variance[v - radius : v + radius + 1, u - radius : u + radius + 1]
        bounds.append(reference.centre_bound(amplitude, sigma, (px - u, py - v), radius, part))
    bound = np.mean(np.array(bounds), axis=0)
    errors, reported = [], []
    for _ in range(30):
        noisy = (ideal + rng.normal(0, 1, ideal.shape) * np.sqrt(variance)).astype(np.float32)
        dots = depth.measure(noisy).dots
        dots = dots[dots["amplitude_dn"] > amplitude / 2]
        assert len(dots) == len(places)
        got = np.stack([dots["x_px"], dots["y_px"]], 1)
        nearest = np.argmin(np.abs(got[:, None] - places[None]).sum(-1), axis=1)
        errors.append(got - places[nearest])
        reported.append(dots["covariance_px2"])
    error, covariance = np.concatenate(errors), np.concatenate(reported)
    for axis, entry in ((0, 0), (1, 2)):
        ratio = np.mean(error[:, axis] ** 2) / bound[axis, axis]
        measured("error variance over the bound, |ratio - 1|", abs(ratio - 1))
        assert 0.95 < ratio < 1.08
        assert 0.95 < np.mean(covariance[:, entry]) / bound[axis, axis] < 1.06
    assert abs(error.mean()) < 4 * np.sqrt(bound[0, 0] / error.size)
    pull = error[:, 0] / np.sqrt(covariance[:, 0])
    assert np.mean(np.abs(pull) < 1) == pytest.approx(0.683, abs=0.03)


def test_depth_uncertainty_is_that_of_the_noise(camera, context, measured):
    """A wall with noise, 2000 dots: depth errors over their standard deviations are a normal law's. Their RMS has a
    standard deviation of 1.6 %; the bias of the beam on the wall adds less than 1 %."""
    frame = frame_of("far wall")
    noise = 2.0
    depth = make(context, read_noise_dn=noise)
    noisy = (frame.image + np.random.default_rng(21).normal(0, noise, frame.image.shape)).astype(np.float32)
    placed = depth.measure(noisy).placed
    placed = placed[frame.visible[placed["dot_index"]]]
    assert len(placed) > 1900
    pull = (placed["depth_m"] - frame.depths[placed["dot_index"]]) / placed["depth_sd_m"]
    rms = np.sqrt(np.mean(pull**2))
    measured("depth pull, |RMS - 1|", abs(rms - 1))
    assert 0.93 < rms < 1.07
    epipolar = placed["epipolar_error_px"] / placed["epipolar_sd_px"]
    assert 0.93 < np.sqrt(np.mean(epipolar**2)) < 1.07
    np.testing.assert_allclose(placed["position_sd_m"][:, 2], placed["depth_sd_m"])


@pytest.mark.parametrize(("polarization", "least_found"), [(0.0, 0.985), (1.0, 0.96)])
def test_speckle_of_the_whole_camera(context, measured, polarization, least_found):
    """The end of the chain: a wall at 1 m through phase, aperture (f/2.8) and sensor. Speckle moves centres by a good
    part of a dot, and breaks some fits; nearly every dot is still identified, and none wrongly. One seed; 1100 dots:
    the share of those that are not found, 0.1 % and 0.5 %, has a standard deviation of 0.1 % and 0.2 %."""
    directions = reference.semi_random_directions((0.72, 0.58), 10 / RIG.fx, seed=3)
    frame = reference.render(RIG, [reference.plane(1.0)], directions, 1.6)
    camera = clspeckle.Pipeline.from_parameters(
        RIG.shape,
        seed=7,
        f_number=2.8,
        oversampling=2,
        degree_of_polarization=polarization,
        exposure_gain_dn=500.0,
        context=context,
    )
    codes = camera.render((frame.image / frame.image.max()).astype(np.float32))
    noise = {"read_noise_dn": 4.0, "black_level_dn": 64.0, "saturation_dn": 1023.0}
    placed = make(context, directions=directions, **{"dot_sigma_px": 2.0, **noise}).measure(codes).placed
    error = np.hypot(*(np.stack([placed["x_px"], placed["y_px"]], 1) - frame.centres[placed["dot_index"]]).T)
    right = error < 2.5
    found = np.zeros(len(directions), bool)
    found[placed["dot_index"][right]] = True
    measured("1 - identified share", 1 - found[frame.visible].mean())
    measured("wrong dots, share", 1 - right.mean())
    measured("centre error, RMS, px", np.sqrt(np.mean(error[right] ** 2)))
    depth_error = (placed["depth_m"] - frame.depths[placed["dot_index"]])[right]
    measured("depth error, RMS, mm", 1e3 * np.sqrt(np.mean(depth_error**2)))
    assert found[frame.visible].mean() > least_found
    assert right.mean() > 0.99
    assert 0.1 < np.sqrt(np.mean(error[right] ** 2)) < 0.8
    assert (placed["flags"] & _library.CLSP_DOT_FIXED_SHAPE).any()


def test_missing_and_spurious_dots(camera, measured):
    """A third of the dots missing, a fifth more that are nobody's: nearly all that are placed are right, and nearly
    all are found."""
    rng = np.random.default_rng(31)
    kept = rng.random(len(DIRECTIONS)) > 1 / 3
    frame = reference.render(RIG, reference.SCENES["sphere"], DIRECTIONS[kept], SIGMA, scale=1000.0)
    height, width = RIG.shape
    y, x = np.mgrid[:height, :width]
    image = frame.image.copy()
    strangers = rng.uniform((6, 6), (width - 7, height - 7), (300, 2))
    for px, py in strangers:
        near = np.s_[int(py) - 5 : int(py) + 7, int(px) - 5 : int(px) + 7]
        image[near] += 300 * np.exp(-0.5 * ((x[near] - px) ** 2 + (y[near] - py) ** 2) / SIGMA**2)
    result = camera.measure(image.astype(np.float32))
    placed = result.placed
    real = np.flatnonzero(kept)
    centres = np.full((len(DIRECTIONS), 2), np.nan)
    centres[real] = frame.centres
    error = np.hypot(placed["x_px"] - centres[placed["dot_index"], 0], placed["y_px"] - centres[placed["dot_index"], 1])
    wrong = np.mean(~(error < 1.5))
    found = np.zeros(len(DIRECTIONS), bool)
    found[placed["dot_index"][error < 1.5]] = True
    alone = (
        np.linalg.norm(frame.centres[:, None] - strangers[None], axis=-1).min(axis=1) > 5
    )  # not hidden by a stranger
    share = found[real[frame.visible & alone]].mean()
    measured("wrong among placed", wrong)
    measured("1 - identified share", 1 - share)
    assert wrong < 0.05  # strangers that by chance lie on a line at their neighbours' depth
    assert share > 0.98
    reasons = result.reasons()
    assert sum(count for reason, count in reasons.items() if reason != "placed") > 150


def test_lattices_are_called_ambiguous(context, measured):
    """A square lattice whose rows lie along the lines repeats within the range of depth: nothing is guessed."""
    rig = reference.rig(turn_rad=0.0)
    directions = reference.lattice_directions((0.72, 0.58), 12 / rig.fx)
    pose = np.eye(3, 4)
    pose[0, 3] = -0.06
    rig = reference.Rig(rig.shape, rig.fx, rig.fx, rig.cx, rig.cy, pose)
    frame = reference.render(rig, [reference.plane(1.0)], directions, SIGMA, scale=1000.0)
    result = make(context, rig, directions).measure(frame.image.astype(np.float32))
    inner = (np.abs(result.dots["x_px"] - rig.cx) < 120) & (np.abs(result.dots["y_px"] - rig.cy) < 120)
    assert inner.sum() > 300
    ambiguous = np.mean(result.dots["reason"][inner] == _library.CLSP_DEPTH_REASON_AMBIGUOUS)
    measured("1 - ambiguous share", 1 - ambiguous)
    assert ambiguous > 0.99
    assert "few_placed" in result.summary.warnings
    assert np.count_nonzero(result.pattern["reason"] == _library.CLSP_DEPTH_REASON_AMBIGUOUS) > 100


@pytest.mark.parametrize("apart", [3.2, 3.6, 4.6])
def test_merged_dots_are_flagged(context, apart):
    """Nearer than 3.5 sigma."""
    shape = (64, 64)
    places = [(32 - apart / 2, 32.2), (32 + apart / 2, 32.2)]
    image = clspeckle.Dots(shape, places, sigma_px=1.5, scale=100, context=context).render()
    dots = clspeckle.Depth(shape, dot_sigma_px=1.5, context=context).measure(image).dots
    assert len(dots) >= 1
    assert (dots["flags"] & (_library.CLSP_DOT_MERGED | _library.CLSP_DOT_FIT_FAILED)).all()


@pytest.mark.parametrize("apart", [4.6, 4.8, 5.2])
def test_close_dots_have_honest_deviations(context, apart):
    """Two equal dots of 1.3 px at 3.5 widths and more: 40 draws of noise. The errors over their deviations, 80 of them
    along x, have an RMS of 1 within 0.25 (3 standard errors), and some more for the bias that is left at 3.5 widths;
    nothing is flagged."""
    rng = np.random.default_rng(84)
    finder = clspeckle.Depth((40, 60), dot_sigma_px=1.3, read_noise_dn=2, context=context)
    y, x = np.mgrid[:40, :60]
    ideal = sum(200 * np.exp(-((x - c) ** 2 + (y - 20.2) ** 2) / (2 * 1.3**2)) for c in (25.3, 25.3 + apart))
    pulls = []
    for _ in range(40):
        dots = finder.measure(ideal + rng.normal(0, 2, ideal.shape)).dots
        assert len(dots) == 2
        assert not dots["flags"].any()
        found = np.sort(dots, order="x_px")
        deviation = np.sqrt(np.array([c[0] for c in found["covariance_px2"]]))
        pulls += list((found["x_px"] - (25.3, 25.3 + apart)) / deviation)
    assert 0.75 < np.sqrt(np.mean(np.square(pulls))) < 1.35


def test_depths_end_where_the_range_does(context):
    """A wall at 2 m lies 0.36 px beyond a range that ends at 1.95 m: within the slack that speckle needs for
    candidates, and yet without depths."""
    frame = frame_of("far wall").image.astype(np.float32)
    inside, outside = (make(context, far_m=far_m).measure(frame) for far_m in (2.05, 1.95))
    assert len(inside.placed) > 0.9 * len(inside.dots)
    assert len(outside.placed) < 0.02 * len(outside.dots)
    assert (outside.dots["reason"] == _library.CLSP_DEPTH_REASON_NO_CANDIDATE).mean() > 0.9


def test_direction_cosines_are_the_same_dots(context):
    frame = frame_of("turned wall")
    cosines = DIRECTIONS / np.sqrt(1 + np.sum(DIRECTIONS**2, axis=1, keepdims=True))
    image = frame.image.astype(np.float32)
    tangent = make(context).measure(image).dots
    other = make(context, directions=cosines, projection="direction_cosines").measure(image).dots
    np.testing.assert_array_equal(tangent["dot_index"], other["dot_index"])
    np.testing.assert_allclose(tangent["depth_m"], other["depth_m"], rtol=1e-9)


def test_python_class(context, camera):
    frame = frame_of("near wall")
    image = frame.image.astype(np.float32)
    host = camera.measure(image)
    device = clspeckle.DeviceImage.from_array(image, context=context)
    camera.enqueue_detect(device).wait()
    again = camera.result()
    np.testing.assert_array_equal(host.dots, again.dots)
    np.testing.assert_array_equal(camera.measure(device).dots, host.dots)
    codes = np.round(image).astype(np.uint16)
    from_codes = camera.measure(codes)
    assert abs(len(from_codes.placed) - len(host.placed)) < 20
    assert host.dots.dtype.names[:2] == ("x_px", "y_px")
    assert host.reasons()["placed"] == host.summary.placed_count == len(host.placed)
    assert len(host.pattern) == len(DIRECTIONS)
    assert clspeckle.Depth.defaults()["dot_sigma_px"] == 1.5
    with pytest.raises(clspeckle.errors.InvalidDataError, match="image"):
        camera.measure(np.full(RIG.shape, np.nan, np.float32))
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="shape"):
        camera.measure(image[:-1])
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="laser_from_camera and intrinsics"):
        clspeckle.Depth(RIG.shape, DIRECTIONS, context=context)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="need at least"):
        clspeckle.Depth((8, 30), context=context)
    with pytest.raises(TypeError, match="intrinsics"):
        clspeckle.Depth(RIG.shape, DIRECTIONS, RIG.laser_from_camera, 450.0, context=context)
    with pytest.raises(clspeckle.errors.InvalidStateError, match="no frame"):
        make(context).result()


WIDE_DOTS = """
import numpy as np, clspeckle
frame = 500 * clspeckle.Dots((64, 64), [[20.0, 20.0], [44.0, 40.0]], sigma_px=4.5).render()
for max_dots in (2, 33, 4096, 100_000):
    dots = clspeckle.Depth((64, 64), dot_sigma_px=5, max_dots=max_dots).measure(frame).dots
    assert len(dots) == 2 and abs(dots["x_px"] - [20, 44]).max() < 0.01, dots["x_px"]
"""


def test_wide_dots_take_little_of_a_thread(tmp_path):
    """A driver's threads have the stack that the process has: windows of 27 x 27 pixels fit one of a megabyte."""
    limit = (1 << 20, resource.getrlimit(resource.RLIMIT_STACK)[1])
    done = subprocess.run(
        [sys.executable, "-c", WIDE_DOTS], cwd=tmp_path, capture_output=True, check=False, text=True, timeout=300,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_STACK, limit),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
