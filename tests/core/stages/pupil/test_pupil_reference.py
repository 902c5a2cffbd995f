"""Pupil shapes and aberrations against the float64 reference, closed forms and what they do to images."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
import scipy.integrate
import scipy.special

from reference import aperture, phase, theory
from reference import pupil as reference

InvalidArgument = clspeckle.errors.InvalidArgumentError


def make(context, grid, diameter=1.0, **options):
    return clspeckle.Aperture(
        (grid.height, grid.width),
        oversampling=grid.oversampling,
        guard_px=grid.guard_px,
        relative_diameter=diameter,
        context=context,
        **options,
    )


GRIDS = [phase.FieldGrid(64, 64), phase.FieldGrid(55, 33), phase.FieldGrid(40, 48, 2, 3)]
POLYGONS = [(3, 0.0, 0.0), (4, 0.3, 0.0), (5, -1.1, 0.5), (6, 0.0, 0.0), (7, 2.0, 0.9), (8, 0.1, 0.02), (32, 5.0, 0.0)]


@pytest.mark.parametrize("grid", GRIDS, ids=["square", "odd", "oversampled"])
@pytest.mark.parametrize("blades", POLYGONS, ids=["{}_rotation{}_curvature{}".format(*p) for p in POLYGONS])
def test_polygon(context, grid, blades):
    """The same frequencies as half planes, or discs, decided in float64: nothing on a boundary passes."""
    count, rotation, curvature = blades
    for diameter in (0.5, 0.93):
        stage = make(context, grid, diameter, blade_count=count, blade_rotation_rad=rotation, blade_curvature=curvature)
        u, v = reference.coordinates(grid, diameter)
        inside = reference.polygon_inside(u, v, count, rotation, curvature)
        assert np.array_equal(stage.pupil(), inside * np.float32(grid.oversampling))
        assert stage.info().pupil_samples == inside.sum()


@pytest.mark.parametrize("blades", POLYGONS, ids=["{}_rotation{}_curvature{}".format(*p) for p in POLYGONS])
def test_polygon_area(context, measured, blades):
    """Transmission of a fine pupil against the polygon's area: the boundary of length about 2 pi R passes through as
    many grid cells, so the area errs by a few cells' standard deviations, sqrt(2 pi R / 12) of pi R^2: 0.02 % at R =
    128."""
    count, rotation, curvature = blades
    grid = phase.FieldGrid(256, 256)
    stage = make(context, grid, blade_count=count, blade_rotation_rad=rotation, blade_curvature=curvature)
    ratio = stage.info().mean_transmission * 4 / reference.polygon_area(count, curvature)
    measured("relative error of the area", abs(ratio - 1))
    # A blade along the grid has its cells all at once: a row of at most 2 R cells.
    assert ratio == pytest.approx(1, abs=0.012 if rotation == 0 else 0.003)


def test_polygon_symmetry_and_limits(context):
    grid = phase.FieldGrid(65, 65)
    # Six blades from 0: symmetric about both axes and in itself; five: about the horizontal axis only.
    six = np.fft.fftshift(make(context, grid, blade_count=6).pupil())
    assert np.array_equal(six, six[::-1])
    assert np.array_equal(six, six[:, ::-1])
    five = np.fft.fftshift(make(context, grid, blade_count=5).pupil())
    assert np.array_equal(five, five[::-1])
    assert not np.array_equal(five, five[:, ::-1])
    # A corner points along +x: there the pupil reaches almost to the rim, opposite only to cos(36 degrees).
    row = five[32] > 0
    assert row[32:].sum() == 33
    assert row[:32].sum() == int(np.floor(np.cos(np.pi / 5) * 32.5))
    # Turning by a blade changes nothing.
    turned = np.fft.fftshift(make(context, grid, blade_count=5, blade_rotation_rad=2 * np.pi / 5).pupil())
    assert np.array_equal(turned, five)
    # Blades as curved as the rim are the rim.
    round_blades = make(context, grid, blade_count=5, blade_curvature=1.0).pupil()
    assert np.array_equal(round_blades, make(context, grid).pupil())


@pytest.mark.parametrize("grid", GRIDS, ids=["square", "odd", "oversampled"])
def test_obstruction(context, grid):
    """Blocks what lies within or on its circle, of any shape."""
    image = np.linspace(0.2, 1, 25, dtype=np.float32).reshape(5, 5)
    for diameter, ratio in ((0.5, 0.3), (0.93, 0.6), (0.75, 0.5)):
        u, v = reference.coordinates(grid, diameter)
        kept = np.hypot(u, v) > ratio * (1 + reference.MARGIN)
        for options in ({}, {"blade_count": 6}, {"pupil_image": image}, {"soft_rim": 0.4}):
            whole = make(context, grid, diameter, **options).pupil()
            blocked = make(context, grid, diameter, obstruction_ratio=ratio, **options).pupil()
            if "soft_rim" in options:
                # Its edge is as soft as the rim.
                into = (2 - np.hypot(u, v) / ratio - 0.6) / 0.4
                whole = whole * 0.5 * (1 + np.cos(np.pi * np.clip(into, 0, 1)))
                assert np.abs(blocked - whole * kept).max() < 3e-7 * grid.oversampling
            else:
                assert np.array_equal(blocked, whole * kept)
        if not options:
            continue
        ring = make(context, grid, diameter, pupil="ring", obstruction_ratio=ratio)
        assert np.array_equal(ring.pupil(), make(context, grid, diameter, obstruction_ratio=ratio).pupil())
    fine = make(context, phase.FieldGrid(256, 256), pupil="ring", obstruction_ratio=0.4)
    assert fine.info().mean_transmission == pytest.approx(np.pi / 4 * (1 - 0.4**2), rel=0.003)


def boundary(grid, diameter, *polygon):
    """Distance of the polygon's boundary in each grid frequency's direction, by bisection."""
    u, v = reference.coordinates(grid, diameter)
    theta = np.arctan2(v, u)
    low, high = np.zeros_like(theta), np.ones_like(theta)
    for _ in range(50):
        middle = (low + high) / 2
        inside = reference.polygon_inside(middle * np.cos(theta), middle * np.sin(theta), *polygon)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


@pytest.mark.parametrize("polygon", [(5, 0.2, 0.0), (7, 0.0, 0.6)])
def test_soft_polygon(context, polygon):
    """A raised cosine along the way from the axis to the boundary."""
    grid, diameter, soft = phase.FieldGrid(48, 40), 0.9, 0.35
    count, rotation, curvature = polygon
    stage = make(
        context,
        grid,
        diameter,
        blade_count=count,
        blade_rotation_rad=rotation,
        blade_curvature=curvature,
        soft_rim=soft,
    )
    u, v = reference.coordinates(grid, diameter)
    way = np.hypot(u, v) / boundary(grid, diameter, *polygon)
    expected = 0.5 * (1 + np.cos(np.pi * np.clip((way - (1 - soft)) / soft, 0, 1))) * (way < 1)
    assert np.abs(stage.pupil() - expected).max() < 1e-6
    # Likewise on the square of an image.
    square = make(context, grid, diameter, pupil_image=np.ones((1, 1)), soft_rim=soft).pupil()
    way = np.maximum(np.abs(u), np.abs(v))
    expected = 0.5 * (1 + np.cos(np.pi * np.clip((way - (1 - soft)) / soft, 0, 1))) * (way < 1)
    assert np.abs(square - expected).max() < 1e-6


def test_reference_zernikes_are_nolls():
    """Orthonormal over the disc (Gauss-Legendre in rho^2, equidistant in theta: exact for these polynomials), and
    Noll's table by hand for a few."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    rho, theta = np.meshgrid(np.sqrt((nodes + 1) / 2), np.arange(24) * 2 * np.pi / 24, indexing="ij")
    values = np.array([reference.zernike(j, rho, theta) for j in range(1, 16)])
    gram = np.einsum("ikl,jkl,k->ij", values, values, weights / 2) / 24
    assert np.abs(gram - np.eye(15)).max() < 1e-12
    assert np.allclose(reference.zernike(4, rho, theta), np.sqrt(3) * (2 * rho**2 - 1))
    assert np.allclose(reference.zernike(5, rho, theta), np.sqrt(6) * rho**2 * np.sin(2 * theta))
    assert np.allclose(reference.zernike(8, rho, theta), np.sqrt(8) * (3 * rho**3 - 2 * rho) * np.cos(theta))
    assert np.allclose(reference.zernike(11, rho, theta), np.sqrt(5) * (6 * rho**4 - 6 * rho**2 + 1))
    assert np.allclose(reference.zernike(14, rho, theta), np.sqrt(10) * rho**4 * np.cos(4 * theta))


@pytest.mark.parametrize("grid", GRIDS, ids=["square", "odd", "oversampled"])
def test_aberrations(context, measured, grid):
    """P = t exp(2 pi i W) to 1e-6: defocus, every Zernike polynomial alone, all at once with an obstructed polygon."""
    diameter = 0.9
    u, v = reference.coordinates(grid, diameter)
    rng = np.random.default_rng(41)
    cases = [({}, 1.3, np.zeros(12)), ({}, -0.4, np.zeros(12))]
    cases += [({}, 0.0, 0.11 * (np.arange(12) == i)) for i in range(12)]
    cases += [({"blade_count": 7, "obstruction_ratio": 0.2, "soft_rim": 0.1}, 0.7, rng.normal(0, 0.05, 12))]
    for options, defocus, zernikes in cases:
        plain = make(context, grid, diameter, **options).pupil()
        assert plain.dtype == np.float32
        stage = make(context, grid, diameter, defocus_waves=defocus, zernike_waves=zernikes, **options)
        expected = plain * np.exp(2j * np.pi * reference.wavefront(u, v, defocus, zernikes))
        got = stage.pupil()
        assert got.dtype == np.complex64
        error = np.abs(got - expected).max() / grid.oversampling
        measured("error of P", error)
        assert error < 1e-6
        assert stage.info().mean_transmission == pytest.approx(np.mean(np.abs(expected) ** 2), rel=1e-6)


FINE = phase.FieldGrid(192, 192)


def strehl(stage, flat):
    """Peak of a point's image over that without aberrations."""
    return float(np.abs(stage.pupil().mean(dtype=np.complex128)) ** 2 / flat.mean(dtype=np.float64) ** 2)


def test_defocus_strehl(context, measured):
    """w rho^2 has the Strehl ratio (sin(pi w) / (pi w))^2; the disc of 96 samples' radius has it to 0.004."""
    flat = make(context, FINE).pupil()
    for waves in (0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.5):
        error = abs(strehl(make(context, FINE, defocus_waves=waves), flat) - np.sinc(waves) ** 2)
        measured("Strehl ratio", error)
        assert error < 0.004


def test_marechal(context, measured):
    """A small RMS error sigma costs exp(-(2 pi sigma)^2), whatever its shape (Born and Wolf 9.1.3)."""
    flat = make(context, FINE).pupil()
    for i in range(12):
        for sigma in (0.02, 0.04):
            waves = sigma * (np.arange(12) == i)
            error = abs(strehl(make(context, FINE, zernike_waves=waves), flat) - np.exp(-((2 * np.pi * sigma) ** 2)))
            measured("Strehl ratio", error)
            assert error < 2e-3


def point_image(context, stage, grid, place):
    """Image of a point of light."""
    state = clspeckle.Phase((grid.height, grid.width), seed=3, context=context)
    state.refresh(0)
    ideal = np.zeros((grid.height, grid.width), np.float32)
    ideal[place] = 1
    return stage.intensity(state, ideal) / np.abs(state.field(0)[place]) ** 2


@pytest.mark.parametrize("waves", [0.0, 0.6, 1.5])
def test_defocused_point_spread(context, measured, waves):
    """The image of a point against the Fraunhofer integral over a disc with a quadratic phase,
    U(r) = (pi D^2 / 4) 2 Int_0^1 exp(2 pi i w rho^2) J0(pi D r rho) rho d rho: within 1 % of the peak in focus."""
    grid, diameter = phase.FieldGrid(192, 192), 0.5
    image = point_image(context, make(context, grid, diameter, defocus_waves=waves), grid, (90, 100))

    def integral(distance):
        def part(function):
            return scipy.integrate.quad(
                lambda rho: (
                    2 * rho * function(2 * np.pi * waves * rho**2) * scipy.special.j0(np.pi * diameter * distance * rho)
                ),
                0,
                1,
            )[0]

        return part(np.cos) ** 2 + part(np.sin) ** 2

    peak = (np.pi * diameter**2 / 4) ** 2
    for dy, dx in ((0, 0), (0, 1), (2, 0), (3, 4), (-5, 2), (0, -9), (12, 5), (20, 20)):
        error = abs(image[90 + dy, 100 + dx] / peak - integral(np.hypot(dx, dy)))
        measured("of the peak", error)
        assert error < 0.01


def test_defocus_leaves_the_speckle_alone_and_widens_the_dots(context, measured):
    """The grain's law depends on |P| only: contrast within five standard errors (theory.contrast_standard_error, 0.6 %)
    of 1, the autocovariance within 0.03 of the Airy law, with and without defocus. Mean images of a dot over 200
    surfaces are I0 * |IFFT2 P|^2: its light within circles agrees to 0.03 of all, and half of it takes a much larger
    circle."""
    grid, diameter = phase.FieldGrid(256, 256), 0.5
    state = clspeckle.Phase((256, 256), seed=5, context=context)
    state.refresh(0)
    flat = np.ones((256, 256), np.float32)
    for waves in (0.0, 1.2):
        image = make(context, grid, diameter, defocus_waves=waves).intensity(state, flat).astype(np.float64)
        contrast = image.std() / image.mean()
        error = theory.contrast_standard_error(aperture.circle_pupil(grid, diameter), 1.0)
        measured("contrast, in standard errors", abs(contrast - 1) / error)
        assert abs(contrast - 1) < 5 * error
        spectrum = np.abs(np.fft.fft2(image - image.mean())) ** 2
        covariance = np.fft.ifft2(spectrum).real / spectrum.sum() * spectrum.size
        for lag in (1, 2, 3, 4, 6):
            expected = theory.airy_autocovariance(np.array(lag), diameter)
            measured("autocovariance", abs(covariance[0, lag] / covariance[0, 0] - expected))
            assert abs(covariance[0, lag] / covariance[0, 0] - expected) < 0.03
            assert abs(covariance[lag, 0] / covariance[0, 0] - expected) < 0.03
    small = phase.FieldGrid(64, 64)
    y, x = np.mgrid[:64, :64] - 32.0
    dot = np.exp(-(x**2 + y**2) / (2 * 1.5**2)).astype(np.float32)
    surface = clspeckle.Phase((64, 64), seed=6, context=context)
    radius = np.hypot(x, y)
    half_light = []
    for waves in (0.0, 1.2):
        stage = make(context, small, diameter, defocus_waves=waves, normalization="unit_mean")
        mean = np.zeros((64, 64))
        for frame in range(200):
            surface.refresh(frame)
            mean += stage.intensity(surface, dot)
        spread = reference.point_spread(stage.pupil().astype(np.complex128))
        expected = np.fft.ifft2(np.fft.fft2(dot) * np.fft.fft2(spread)).real
        # Parts of the light within circles: the second moment of an Airy pattern does not converge.
        got = np.array([mean[radius <= r].sum() / mean.sum() for r in range(1, 20)])
        want = np.array([expected[radius <= r].sum() / expected.sum() for r in range(1, 20)])
        measured("encircled light", np.abs(got - want).max())
        assert np.abs(got - want).max() < 0.03
        half_light.append(np.interp(0.5, got, np.arange(1, 20)))
    assert half_light[1] > 1.5 * half_light[0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"blade_count": 2}, "blade_count is 2, it must be 3 to 32"),
        ({"blade_count": 33}, "blade_count"),
        ({"blade_count": 6, "blade_curvature": -0.1}, "blade_curvature"),
        ({"blade_count": 6, "blade_curvature": 1.1}, "blade_curvature"),
        ({"blade_count": 6, "blade_rotation_rad": np.nan}, "blade_rotation_rad"),
        ({"blade_rotation_rad": np.inf}, "blade_rotation_rad"),
        ({"obstruction_ratio": 1.0}, "obstruction_ratio"),
        ({"obstruction_ratio": -0.1}, "obstruction_ratio"),
        ({"obstruction_ratio": np.nan}, "obstruction_ratio"),
        ({"pupil": "ring"}, "obstruction_ratio"),
        ({"obstruction_ratio": 0.9999, "relative_diameter": 0.1}, "passes nothing"),
        ({"defocus_waves": np.nan}, "defocus_waves"),
        ({"defocus_waves": 1001}, "defocus_waves"),
        ({"zernike_waves": {9: np.inf}}, r"zernike_waves.*9"),
        ({"zernike_waves": {15: -2000}}, r"zernike_waves.*15"),
        # 4 w / D pixels on either side, of a grid of 64.
        ({"defocus_waves": 9}, "fewer waves"),
        ({"zernike_waves": {7: 4}}, "fewer waves"),
    ],
)
def test_bad_parameters(context, options, words):
    options = {"relative_diameter": 1.0, **options}
    with pytest.raises(InvalidArgument, match=words):
        clspeckle.Aperture((64, 64), context=context, **options)


def test_the_largest_defocus_that_fits(context):
    """A point's image fills the grid: 8 w / D pixels across (w = D N / 8, less half a bin's slope)."""
    clspeckle.Aperture((64, 64), relative_diameter=1.0, defocus_waves=8.0, context=context)
    clspeckle.Aperture((64, 64), relative_diameter=1.0, defocus_waves=9.0, guard_px=16, context=context)
