"""The pattern of a diffractive element against the float64 reference and against closed forms (doe.h)."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
from scipy.special import j1, jv

from reference import doe

WAVELENGTH = 940e-9
PITCH = 1.5e-6
SIGMA = (60e-6, 75e-6)
BEAM = clspeckle.Beam(covariance_m2=(SIGMA[0] ** 2, SIGMA[1] ** 2))


def random_cell(shape=(24, 32), seed=71):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, shape).astype(np.float32)


def grating(samples, levels=None, depth=1.0):
    """A blazed grating of one period in x; with levels, rounded down to them."""
    ramp = np.arange(samples) / samples
    if levels:
        ramp = np.floor(ramp * levels) / levels
    return (2 * np.pi * depth * ramp).astype(np.float32)[None, :]


def binary_grating(samples, depth_rad=np.pi):
    return np.where(np.arange(samples) < samples // 2, 0, depth_rad).astype(np.float32)[None, :]


def pattern_of(context, phase, *, orders=None, pitch=PITCH, wavelength=WAVELENGTH, levels=0, **options):
    design = clspeckle.DoeElement(phase, pitch, wavelength_m=wavelength, orders=orders, levels=levels)
    options = {"beam": BEAM, "image_shape": (96, 128)} | options
    return clspeckle.DoePattern(design, context=context, **options)


def balanced(info):
    return info.dots + info.zero_order + info.ghosts + info.scatter


@pytest.mark.parametrize("envelope", [True, False])
@pytest.mark.parametrize("half_extent", [(0.313, 0.313), (0.1, 0.2)])
def test_orders_are_spots(context, measured, envelope, half_extent):
    """Every texel of a random cell's pattern, over the brightest one: the spot's table (10 samples per sigma) is linear
    between its nodes, which is worth 1e-3."""
    phase = random_cell()
    made = pattern_of(context, phase, half_extent=half_extent, pixel_envelope=envelope)
    got = doe.texel_shares(made.texels, half_extent)
    expected = doe.order_image(phase, PITCH, WAVELENGTH, SIGMA, got.shape, half_extent, envelope)
    error = np.abs(got - expected).max() / expected.max()
    measured("error over the brightest texel", error)
    assert error < 3e-3
    measured("error of the power inside", abs(made.info.inside_image - expected.sum()))
    assert made.info.inside_image == pytest.approx(expected.sum(), abs=3e-5)  # spots cut by the edge
    assert got.sum() == pytest.approx(made.info.inside_image, rel=1e-6)


@pytest.mark.parametrize("evaluation", ["orders", "aperture"])
def test_energy_is_kept(context, measured, evaluation):
    """Without the envelope all light lies within the sampling limit: the texels of an image that covers it hold the
    power to 1e-6, as do the books. The orders end where the sampling limit is, and half a spot sticks out: the image is
    wider."""
    phase = random_cell((40, 40))
    limit = WAVELENGTH / (2 * PITCH)
    beam = clspeckle.Beam(covariance_m2=(30e-6**2, 40e-6**2))
    options = {"evaluation": evaluation, "pixel_envelope": False, "half_extent": 1.1 * limit, "image_shape": (257, 300)}
    made = pattern_of(context, phase, beam=beam, **options)
    measured("texels", abs(made.info.inside_image - 1))
    assert made.info.inside_image == pytest.approx(1, abs=1e-6)
    assert balanced(made.info) == pytest.approx(1, abs=1e-6)
    assert doe.texel_shares(made.texels, (1.1 * limit,) * 2).sum() == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("envelope", [True, False])
@pytest.mark.parametrize("oversampling", [1, 2, 3])
def test_aperture_is_the_transform_of_the_field(context, measured, envelope, oversampling):
    """A whole aperture with a square flat beam that fills it, so that the field is the phase alone."""
    phase = random_cell((36, 48), seed=72)
    half_extent = (0.25, 0.3)
    beam = clspeckle.Beam("flat_square", width_m=48 * PITCH, height_m=36 * PITCH)
    design = clspeckle.DoeElement(phase, PITCH, periodic=False)
    made = clspeckle.DoePattern(
        design,
        beam=beam,
        oversampling=oversampling,
        pixel_envelope=envelope,
        half_extent=half_extent,
        image_shape=(50, 70),
        context=context,
    )
    got = doe.texel_shares(made.texels, half_extent)
    field = np.exp(1j * phase.astype(np.float64))
    expected = doe.aperture_image(field, PITCH, WAVELENGTH, got.shape, half_extent, oversampling, envelope)
    error = np.abs(got - expected).max() / expected.max()
    measured("error over the brightest texel", error)
    assert error < 2e-5
    assert made.info.inside_image == pytest.approx(expected.sum(), abs=1e-6)


def test_aperture_and_orders_agree(context):
    """The same periodic design both ways: the share of each dot, where the beam covers enough cells. Spots of other
    orders leak into a dot's circle, so the cell has few bright orders."""
    phase = binary_grating(16)
    orders = [[-1, 0], [1, 0], [3, 0], [-3, 0]]
    options = {"orders": orders, "half_extent": 0.3, "image_shape": (3, 1200), "pitch": 1.5e-6}
    beam = clspeckle.Beam(covariance_m2=(60e-6**2, 5e-6**2))
    by_orders = pattern_of(context, phase, beam=beam, **options)
    by_aperture = pattern_of(context, phase, beam=beam, evaluation="aperture", **options)
    assert by_orders.dot_shares == pytest.approx((2 / np.pi / np.array([1, 1, 3, 3])) ** 2, rel=0.03)
    assert by_aperture.info.dots == pytest.approx(by_orders.info.dots, rel=0.02)
    assert by_aperture.info.zero_order < 1e-3
    assert balanced(by_aperture.info) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("error", [-0.2, -0.05, 0, 0.02, 0.1, 0.3])
def test_depth_error_of_a_binary_grating(context, error):
    """Depth pi (1 + e): zero order cos^2(pi (1 + e) / 2) = sin^2(pi e / 2), first orders (2 / pi)^2 cos^2(pi e / 2)."""
    defects = clspeckle.DoeDefects(relative_depth_error=error)
    made = pattern_of(context, binary_grating(256), pitch=0.1e-6, orders=[[1, 0], [-1, 0]], defects=defects)
    assert made.info.zero_order == pytest.approx(np.sin(np.pi * error / 2) ** 2, rel=0.01, abs=1e-6)
    expected = (2 / np.pi) ** 2 * np.cos(np.pi * error / 2) ** 2
    assert made.dot_shares == pytest.approx([expected, expected], rel=0.01)
    assert balanced(made.info) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("levels", [2, 3, 4, 8, 16])
def test_efficiency_of_limited_levels(context, levels):
    """A blazed grating made with L levels: first order sinc^2(1 / L). A binary one has a twin as bright."""
    made = pattern_of(
        context,
        grating(720),
        pitch=0.05e-6,
        orders=[[1, 0], [-1, 0]],
        defects=clspeckle.DoeDefects(levels=levels),
    )
    first, twin = made.dot_shares
    assert first == pytest.approx(np.sinc(1 / levels) ** 2, rel=0.01)
    if levels == 2:
        assert twin == pytest.approx(first, rel=1e-3)
    else:
        assert twin < 0.02 * first
    continuous = pattern_of(context, grating(720), pitch=0.05e-6, orders=[[1, 0]])
    assert continuous.info.dots == pytest.approx(1, abs=1e-3)


def test_a_design_keeps_its_own_levels(context):
    """Levels that a design has already change nothing, whatever its offset."""
    phase = np.where(random_cell() > 0, np.pi / 2, -np.pi / 2).astype(np.float32)
    plain = pattern_of(context, phase, levels=2)
    limited = pattern_of(context, phase, levels=2, defects=clspeckle.DoeDefects(levels=2))
    assert np.allclose(limited.texels, plain.texels, rtol=1e-4, atol=1e-5 * plain.texels.max())


def test_levels_do_not_depend_on_where_a_cell_begins(context):
    """Orders of a cell that repeats: rolled, it has the same powers, with a depth error too; and levels that are there
    stay as they are."""
    defects = clspeckle.DoeDefects(levels=8, relative_depth_error=0.1)
    orders = [[m, n] for m in range(-3, 4) for n in range(-3, 4)]
    rng = np.random.default_rng(78)
    on_levels = (rng.integers(0, 8, (16, 16)) * (2 * np.pi / 8)).astype(np.float32)
    on_levels[0, 0] = 5 * 2 * np.pi / 8
    for phase in (on_levels, random_cell()):
        shares = [
            pattern_of(context, np.roll(phase, roll, axis=(0, 1)), orders=orders, defects=defects).dot_shares
            for roll in (0, 1, 5)
        ]
        assert shares[1] == pytest.approx(shares[0], abs=1e-6)
        assert shares[2] == pytest.approx(shares[0], abs=1e-6)
    plain = pattern_of(context, on_levels, orders=orders, defects=clspeckle.DoeDefects(relative_depth_error=0.1))
    limited = pattern_of(context, on_levels, orders=orders, defects=defects)
    assert limited.dot_shares == pytest.approx(plain.dot_shares, abs=1e-6)


@pytest.mark.parametrize("wavelength", [910e-9, 940e-9, 980e-9])
def test_wavelength_moves_and_spoils_dots(context, wavelength):
    """Thesis Fig. 5: directions go with the wavelength; the depth, a length, is wrong for it. Centroid of the dot to
    1e-3."""
    made = pattern_of(
        context,
        binary_grating(40),
        orders=[[1, 0]],
        pitch=0.2e-6,
        lines=[wavelength],
        half_extent=0.2,
        image_shape=(4, 4001),
        beam=clspeckle.Beam(covariance_m2=(100e-6**2, 100e-6**2)),
    )
    shares = doe.texel_shares(made.texels, (0.2, 0.2)).sum(axis=0)
    u = (np.arange(4001) + 0.5) / 4001 * 0.4 - 0.2
    dot = np.abs(u - wavelength / 8e-6) < 0.02
    assert (shares[dot] * u[dot]).sum() / shares[dot].sum() == pytest.approx(wavelength / 8e-6, rel=1e-3)
    depth = np.pi * WAVELENGTH / wavelength
    assert made.info.zero_order == pytest.approx(np.cos(depth / 2) ** 2, rel=0.01, abs=1e-6)
    assert made.info.dots == pytest.approx((2 / np.pi) ** 2 * np.sin(depth / 2) ** 2, rel=0.01)


def test_dispersion(context):
    """The index changes with the wavelength: phase times (n - 1) / (n_0 - 1)."""
    defects = clspeckle.DoeDefects(refractive_index=1.5, dispersion_per_m=-2e5)
    made = pattern_of(context, binary_grating(40), pitch=0.2e-6, lines=[900e-9], defects=defects)
    depth = np.pi * 940 / 900 * (0.5 + 2e5 * 40e-9) / 0.5
    assert made.info.zero_order == pytest.approx(np.cos(depth / 2) ** 2, rel=0.01)


def test_lines_add_up(context):
    """Two lines of 1 and 3 parts are the sum of each alone."""
    phase = random_cell()
    both = pattern_of(context, phase, lines=[(930e-9, 1), (950e-9, 3)], half_extent=0.2)
    alone = [pattern_of(context, phase, lines=[w], half_extent=0.2).texels for w in (930e-9, 950e-9)]
    expected = 0.25 * alone[0] + 0.75 * alone[1]
    assert np.abs(both.texels - expected).max() < 1e-5 * expected.max()


@pytest.mark.parametrize("sigma_px", [0.3, 1.0, 4.0])
def test_rounding_of_features(context, sigma_px):
    """A weak phase a cos(2 pi x / P), blurred by sigma, has the amplitude a exp(-2 pi^2 (sigma / P)^2) and the first
    order J_1^2 of it."""
    period = 40
    phase = (0.2 * np.cos(2 * np.pi * np.arange(period) / period)).astype(np.float32)[None, :]
    defects = clspeckle.DoeDefects(rounding_sigma_m=sigma_px * 0.2e-6, feature_samples=4)
    made = pattern_of(context, phase, pitch=0.2e-6, orders=[[1, 0]], defects=defects)
    amplitude = 0.2 * np.exp(-2 * np.pi**2 * (sigma_px / period) ** 2)
    assert made.info.dots == pytest.approx(jv(1, amplitude) ** 2, rel=0.01)


@pytest.mark.parametrize("rms_m", [10e-9, 60e-9])
def test_etch_noise_scatters(context, rms_m):
    """The share 1 - exp(-s^2), s = 2 pi (n - 1) sigma / lambda, leaves the dots and spreads under the pixel's
    envelope."""
    s = 2 * np.pi * 0.4507 * rms_m / WAVELENGTH
    clean = pattern_of(context, binary_grating(16), orders=[[1, 0], [-1, 0]])
    noisy = pattern_of(
        context, binary_grating(16), orders=[[1, 0], [-1, 0]], defects=clspeckle.DoeDefects(etch_noise_rms_m=rms_m)
    )
    assert noisy.info.scatter == pytest.approx(1 - np.exp(-(s**2)), rel=1e-6)
    assert noisy.info.dots == pytest.approx(clean.info.dots * np.exp(-(s**2)), rel=1e-5)
    assert balanced(noisy.info) == pytest.approx(1, abs=1e-6)
    difference = noisy.texels - np.exp(-(s**2)) * clean.texels
    half = WAVELENGTH / (2 * PITCH)
    u = ((np.arange(128) + 0.5) / 128 * 2 - 1) * half
    v = ((np.arange(96) + 0.5) / 96 * 2 - 1) * half
    envelope = np.sinc(PITCH * u / WAVELENGTH)[None, :] ** 2 * np.sinc(PITCH * v / WAVELENGTH)[:, None] ** 2
    expected = (
        (1 - np.exp(-(s**2))) * envelope * (PITCH / WAVELENGTH) ** 2 * np.sqrt(1 - u[None, :] ** 2 - v[:, None] ** 2)
    )
    dark = clean.texels < 1e-6 * clean.texels.max()
    assert dark.sum() > 1000
    assert np.allclose(difference[dark], expected[dark], rtol=1e-3, atol=1e-6 * expected.max())


def test_etch_noise_drawn(context):
    """The same law where every pixel's error is drawn: 1000 x 40 pixels under a flat beam. The dots lose exp(-s^2) of
    their light, s = 0.3: the mean phasor of n = 40000 pixels has a relative error of s / sqrt(n) = 0.0015, 3.3 of them
    are 0.5 %. Another seed gives another pattern."""
    s, n = 0.3, 40000
    rms_m = s * WAVELENGTH / (2 * np.pi * 0.4507)
    phase = np.tile(binary_grating(20), (40, 50))
    beam = clspeckle.Beam("flat_square", width_m=1000 * PITCH, height_m=40 * PITCH)
    u = WAVELENGTH / (20 * PITCH)
    design = clspeckle.DoeElement(phase, PITCH, periodic=False, directions=[[u, 0], [-u, 0]])
    options = {"beam": beam, "image_shape": (64, 512), "half_extent": 0.3, "context": context}
    clean = clspeckle.DoePattern(design, **options)
    noisy = [
        clspeckle.DoePattern(design, defects=clspeckle.DoeDefects(etch_noise_rms_m=rms_m, seed=seed), **options)
        for seed in (1, 2)
    ]
    assert phase.size == n
    for made in noisy:
        # what is scattered into the dots' own circles is left in
        assert made.info.dots == pytest.approx(clean.info.dots * np.exp(-(s**2)), rel=0.01)
        assert balanced(made.info) == pytest.approx(1, abs=1e-6)
    assert not np.array_equal(noisy[0].texels, noisy[1].texels)
    again = clspeckle.DoePattern(design, defects=clspeckle.DoeDefects(etch_noise_rms_m=rms_m, seed=1), **options)
    assert np.array_equal(again.texels, noisy[0].texels)


def single_spot(context, beam, half_extent, texels=61):
    """The far field of a beam behind a plate without structure."""
    made = clspeckle.DoePattern.ideal(
        [[0, 0]], beam=beam, half_extent=half_extent, image_shape=(texels, texels), context=context
    )
    return doe.texel_shares(made.texels, (half_extent,) * 2), made.info


def test_spots_have_the_shape_of_the_beams_far_field(context):
    """A flat circle gives an Airy pattern, a flat square sinc^2, a rotated Gaussian the inverse covariance. Over the
    peak: tables have 16 nodes per lambda / D, end at 16 lambda / D, and give what lies beyond (1.2 % of an Airy
    pattern) back to the rest."""
    width, half, points = 100e-6, 0.02, 8  # 8 x 8 points of the closed forms in each texel
    u = ((np.arange(61 * points) + 0.5) / (61 * points) * 2 - 1) * half
    grid_u, grid_v = np.meshgrid(u, u)
    r = np.pi * width / WAVELENGTH * np.maximum(np.hypot(grid_u, grid_v), 1e-12)
    closed_forms = {
        "flat_circle": (2 * j1(r) / r) ** 2 * np.pi / 4,
        "flat_square": (np.sinc(width / WAVELENGTH * grid_u) * np.sinc(width / WAVELENGTH * grid_v)) ** 2,
    }
    for kind, form in closed_forms.items():
        got, _ = single_spot(context, clspeckle.Beam(kind, width_m=width), half)
        density = form * (width / WAVELENGTH) ** 2 * (2 * half / (61 * points)) ** 2
        expected = density.reshape(61, points, 61, points).sum(axis=(1, 3))
        assert np.abs(got - expected).max() < 0.02 * expected.max()
    half = 0.04
    u = ((np.arange(61) + 0.5) / 61 * 2 - 1) * half
    grid_u, grid_v = np.meshgrid(u, u)
    covariance = np.array([[40.0, 15.0], [15.0, 20.0]]) * 1e-11
    got, info = single_spot(context, clspeckle.Beam(covariance_m2=covariance), half)
    expected = (WAVELENGTH / (4 * np.pi)) ** 2 * np.linalg.inv(covariance)
    measured_covariance = np.array(
        [[np.sum(got * a * b) for a in (grid_u, grid_v)] for b in (grid_u, grid_v)]
    ) / np.sum(got)
    assert measured_covariance == pytest.approx(expected, rel=0.01)
    assert info.divergence_x_rad == pytest.approx(2 * np.sqrt(expected[0, 0]), rel=0.01)
    assert got.sum() == pytest.approx(1, abs=1e-6)


def test_beam_kinds_agree_where_they_are_the_same(context):
    """A super-Gaussian of order 1, a skewed beam without skew and an image of a Gaussian are that Gaussian; M^2 widens
    the far field; a skew makes the beam narrower, so its far field wider."""
    sigma, half = 60e-6, 0.01
    plain, _ = single_spot(context, clspeckle.Beam(covariance_m2=(sigma**2, sigma**2)), half, 101)
    x = ((np.arange(256) + 0.5) / 256 * 2 - 1) * 6
    image = np.exp(-(x[None, :] ** 2 + x[:, None] ** 2) / 2)
    for beam in (
        clspeckle.Beam("super_gaussian", width_m=4 * sigma, order=1),
        clspeckle.Beam("skewed", covariance_m2=(sigma**2, sigma**2)),
        clspeckle.Beam(image=image, width_m=12 * sigma),
    ):
        other, _ = single_spot(context, beam, half, 101)
        assert np.abs(other - plain).max() < 0.01 * plain.max()
    _, one = single_spot(context, clspeckle.Beam(covariance_m2=(sigma**2, sigma**2)), half, 101)
    _, two = single_spot(context, clspeckle.Beam(covariance_m2=(sigma**2, sigma**2), m_squared=2), half, 101)
    assert one.divergence_x_rad == pytest.approx(2 * WAVELENGTH / (4 * np.pi * sigma), rel=0.01)
    assert two.divergence_x_rad == pytest.approx(2 * one.divergence_x_rad, rel=1e-4)
    _, skewed = single_spot(
        context, clspeckle.Beam("skewed", covariance_m2=(sigma**2, sigma**2), skew=(4, 0)), half, 101
    )
    assert skewed.divergence_x_rad > 1.3 * one.divergence_x_rad
    assert skewed.divergence_y_rad == pytest.approx(one.divergence_y_rad, rel=1e-3)


def test_ideal_dots(context):
    """Every dot where it was put, with its power; half of a dot on the image's edge is outside."""
    directions = np.array([[0.1, -0.05], [-0.2, 0.15], [0.3, 0.0], [0.9, 0.0]])
    powers = np.array([1.0, 2.0, 3.0, 4.0])
    made = clspeckle.DoePattern.ideal(
        directions, powers=powers, beam=BEAM, power_w=0.2, half_extent=0.3, image_shape=(300, 300), context=context
    )
    shares = doe.texel_shares(made.texels, (0.3, 0.3), 0.2)
    assert made.info.inside_image == pytest.approx((1 + 2 + 1.5) / 10, rel=1e-4)
    assert made.dot_shares == pytest.approx(powers / 10)
    u = (np.arange(300) + 0.5) / 300 * 0.6 - 0.3
    grid_u, grid_v = np.meshgrid(u, u)
    for (x, y), power in zip(directions[:2], powers):
        near = np.hypot(grid_u - x, grid_v - y) < 0.02
        assert shares[near].sum() == pytest.approx(power / 10, rel=1e-4)
        centroid = [(shares[near] * grid[near]).sum() / shares[near].sum() for grid in (grid_u, grid_v)]
        assert centroid == pytest.approx([x, y], abs=2e-5)


def test_caches(context, tmp_path):
    """From memory, from disk in another context, a damaged file renewed, another parameter never mistaken."""
    phase = random_cell(seed=75)

    def made(in_context, **options):
        return pattern_of(in_context, phase, half_extent=0.2, cache_dir=tmp_path, **options)

    first = made(context)
    assert first.info.source == "computed"
    assert made(context).info.source == "memory"
    assert made(context, defects=clspeckle.DoeDefects(relative_depth_error=0.01)).info.source == "computed"
    files = sorted(tmp_path.iterdir())
    assert len(files) == 2
    assert all(path.suffix == ".doe" for path in files)
    with clspeckle.Context() as other:
        from_disk = made(other)
        assert from_disk.info.source == "disk"
        assert np.array_equal(from_disk.texels, first.texels)
    for path in files:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
    with clspeckle.Context() as other:
        renewed = made(other)
        assert renewed.info.source == "computed"
        assert np.array_equal(renewed.texels, first.texels)
    with clspeckle.Context() as other:
        assert made(other).info.source == "disk"
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:100])
    with clspeckle.Context() as other:
        assert made(other).info.source == "computed"


def test_a_pattern_is_what_the_lookup_takes(context):
    """J / d^2 / pi of a wall that faces the laser, summed over the directions: the power of the pattern."""
    made = pattern_of(context, random_cell(), half_extent=0.2, image_shape=(200, 200), power_w=3.0)
    pattern = made.pattern()
    u = ((np.arange(400) + 0.5) / 400 * 2 - 1) * 0.2
    x, y = np.meshgrid(u, u)
    position = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1).astype(np.float32)  # on a sphere of 1 m
    image = pattern.lookup(clspeckle.Geometry(position=position)).astype(np.float64)
    power = np.sum(image * np.pi / position[..., 2]) * (0.4 / 400) ** 2
    assert power == pytest.approx(made.info.inside_image * 3.0, rel=1e-3)


def test_designs_are_saved_and_loaded(tmp_path):
    design = clspeckle.DoeElement(
        random_cell(), PITCH, wavelength_m=850e-9, levels=0, orders=[[1, 2, 0.5], [3, -4, 1.0]]
    )
    design.save(tmp_path / "cell.npy")
    loaded = clspeckle.DoeElement.load(tmp_path / "cell")
    assert np.array_equal(loaded.phase, design.phase)
    assert (loaded.pixel_pitch_m, loaded.wavelength_m, loaded.periodic, loaded.levels) == (PITCH, 850e-9, True, 0)
    assert np.array_equal(loaded.orders, design.orders)
    with pytest.raises(clspeckle.errors.InputOutputError, match="nothing"):
        clspeckle.DoeElement.load(tmp_path / "nothing.npy")
    (tmp_path / "cell.json").write_text('{"wavelength_m": 1}')
    with pytest.raises(clspeckle.errors.InvalidDataError, match="pixel_pitch_m"):
        clspeckle.DoeElement.load(tmp_path / "cell.npy")


REFUSED = {
    "beam larger than the DOE": ({"doe_size_m": (1e-4, 1e-4)}, "larger than the DOE"),
    "cell larger than the DOE": ({"doe_size_m": (1e-5, 1e-3)}, "smaller than its own cell"),
    "orders closer than the diffraction limit": (
        {"beam": clspeckle.Beam(covariance_m2=(1e-11, 1e-11))},
        "diffraction limit",
    ),
    "direction beyond 90 degrees": ({"orders": [[60, 0]]}, "beyond 90 degrees"),
    "an order twice": ({"orders": [[1, 0], [1, 0]]}, "twice"),
    "levels that are not there": ({"levels": 4}, "4 levels"),
    "NaN": ({"phase": np.full((4, 4), np.nan, np.float32)}, "finite"),
    "prime size": ({"phase": np.zeros((17, 16), np.float32)}, "18"),
    "memory": ({"max_memory_bytes": 4096}, "MiB"),
    "line far off": ({"lines": [300e-9]}, "half to twice"),
    "wide beam in an aperture": (
        {"evaluation": "aperture", "beam": clspeckle.Beam(covariance_m2=(1e-4, 1e-4))},
        "samples",
    ),
    "M^2 in an aperture": ({"evaluation": "aperture", "beam": clspeckle.Beam(m_squared=2)}, "APERTURE|aperture"),
    "covariance": ({"beam": clspeckle.Beam(covariance_m2=(1e-8, 2e-8, 1e-8))}, "positive definite"),
    "dark beam": ({"beam": clspeckle.Beam(image=np.zeros((4, 4)))}, "0 everywhere"),
    "one level": ({"defects": clspeckle.DoeDefects(levels=1)}, "levels"),
    "negative noise": ({"defects": clspeckle.DoeDefects(etch_noise_rms_m=-1e-9)}, "etch_noise_rms_m"),
    "no power": ({"power_w": 0.0}, "power_w"),
    "extent": ({"half_extent": 1.5}, "half_extent_x"),
    "endless orders": (
        {"phase": np.zeros((1, 1), np.float32), "pitch": 0.3, "half_extent": 1.0, "image_shape": (8, 8)},
        "smaller cell",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_contradictions_are_refused(context, name):
    options, message = REFUSED[name]
    options = {"phase": random_cell()} | options
    with pytest.raises(clspeckle.ClspeckleError, match=message):
        pattern_of(context, options.pop("phase"), **options)


def test_bad_dots_are_refused(context):
    for arguments, message in (
        ({"directions": np.zeros((0, 2))}, "directions"),
        ({"directions": [[0.8, 0.7]]}, "below 1"),
        ({"directions": [[np.nan, 0]]}, "below 1"),
        ({"directions": [[0, 0]], "powers": [0.0]}, "all 0"),
        ({"directions": [[0, 0]], "half_extent": 0.0}, "half_extent_x"),
    ):
        with pytest.raises(clspeckle.ClspeckleError, match=message):
            clspeckle.DoePattern.ideal(context=context, **arguments)
