"""Ideal projected dots against the float64 reference, and the Python class."""

from __future__ import annotations

import math

import clspeckle
import numpy as np
import pytest

from reference import dots

SHAPE = (60, 83)  # neither side a multiple of the tiles' 16 pixels


def jittered_lattice(seed=71, pitch=(13.0, 11.0), jitter=1.0):
    """Dots inside and outside of the image."""
    x, y = np.meshgrid(np.arange(-5, 95, pitch[0]), np.arange(-4, 70, pitch[1]))
    lattice = np.stack([x, y], axis=-1).reshape(-1, 2)
    return lattice + np.random.default_rng(seed).uniform(-jitter, jitter, lattice.shape)


def compare(context, measured, positions, shape=SHAPE, **options):
    got = clspeckle.Dots(shape, positions, context=context, **options).render()
    expected = dots.render(shape, positions, **options)
    assert got.dtype == np.float32
    assert got.shape == shape
    error = np.abs(got - expected).max() / expected.max()
    measured("error over the largest value", error)
    assert error < 1e-6
    return got, expected


EVERYTHING = {
    "sigma_px": np.random.default_rng(72).uniform(1, 5, 56),
    "peaks": np.random.default_rng(73).uniform(0, 3, 56),
    "scale": 7.0,
    "principal_point_px": (12.0, 50.5),
    "relative_wavelength_shift": -0.05,
    "beam_skew": 0.5,
    "beam_skew_angle_rad": 2.0,
    "beam_flatness": 0.3,
    "zero_order_relative_intensity": 2.0,
    "ghost_relative_intensity": 0.3,
    "ghost_offset_px": (4.5, -3.0),
    "scatter_fraction": 0.2,
}


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"sigma_px": 0.4},
        {"sigma_px": 9.0},
        {"sigma_px": 300.0},
        {"scale": 0.0, "zero_order_relative_intensity": 0.0, "ghost_relative_intensity": 0.0, "sigma_px": 3.0},
        {"beam_skew": 0.5},
        {"beam_skew": 1.2},
        {"beam_skew": 3.0, "sigma_px": 4.0},
        {"beam_skew": -0.7, "beam_skew_angle_rad": 0.6},
        {"beam_flatness": 0.5},
        {"beam_flatness": 1.0},
        {"beam_flatness": 4.0, "sigma_px": 4.0},
        {"beam_skew": 1.0, "beam_flatness": 0.5},
        {"relative_wavelength_shift": 4 / 940},
        {"relative_wavelength_shift": -0.5},
        {"zero_order_relative_intensity": 20.0},
        {"ghost_relative_intensity": 0.25},
        {"ghost_relative_intensity": 0.06, "ghost_offset_px": (3.0, -4.0)},
        {"scatter_fraction": 0.06},
        {"scatter_fraction": 1.0},
        EVERYTHING,
    ],
    ids=lambda options: "-".join(f"{name}" for name in options)[:60] or "plain",
)
def test_against_the_reference(context, measured, options):
    positions = jittered_lattice()
    assert len(positions) == 56
    if options.get("scale") == 0:
        assert not clspeckle.Dots(SHAPE, positions, context=context, **options).render().any()
        return
    compare(context, measured, positions, **options)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (16, 16), (17, 15), (33, 65)])
def test_sizes(context, measured, shape):
    positions = np.random.default_rng(74).uniform(-3, 1.1 * max(shape), (30, 2))
    compare(context, measured, positions, shape, sigma_px=2.5, beam_skew=0.4, scatter_fraction=0.1)


def test_many_dots_on_one_place(context, measured):
    """Sums of many float32 values, in a fixed order."""
    positions = np.random.default_rng(75).normal((41, 30), 2.0, (5000, 2))
    got, _ = compare(context, measured, positions)
    again = clspeckle.Dots(SHAPE, positions, context=context).render()
    assert np.array_equal(got, again)


@pytest.mark.parametrize("flatness", [0.0, 1.0])
@pytest.mark.parametrize("skew", [0.0, 1.2])
def test_what_is_cut_off(context, flatness, skew):
    """One dot in a large image: what the tiles leave out is below 1e-7 of the peak everywhere, 1e-6 of all light."""
    shape = (160, 160)
    options = {"sigma_px": 6.0, "beam_flatness": flatness, "beam_skew": skew, "beam_skew_angle_rad": 0.3}
    got = clspeckle.Dots(shape, [[71.3, 80.9]], context=context, **options).render().astype(np.float64)
    expected = dots.render(shape, [[71.3, 80.9]], **options)
    cut = got == 0
    assert cut.any()
    assert expected[cut].max() < 1e-7
    assert expected[cut].sum() < 1e-6 * expected.sum()
    assert got.sum() == pytest.approx(expected.sum(), rel=1e-6)


def test_light_of_each_defect(context):
    """Sums over the image, dots far enough inside: closed forms of dots.h."""
    shape, sigma, ghost, zero, scatter = (120, 140), 2.5, 0.2, 8.0, 0.3
    rng = np.random.default_rng(76)
    positions = rng.uniform((25, 25), (115, 95), (40, 2))
    gaussian = 40 * 2 * math.pi * sigma**2

    def light(**options):
        stage = clspeckle.Dots(shape, positions, sigma_px=sigma, context=context, **options)
        return stage.render().astype(np.float64).sum() / gaussian

    assert light() == pytest.approx(1, rel=1e-6)
    assert light(relative_wavelength_shift=0.01) == pytest.approx(1, rel=1e-6)
    assert light(beam_skew=0.8) == pytest.approx(1, rel=2e-4)  # the kink where it is clipped, summed over pixels
    assert light(scatter_fraction=scatter) == pytest.approx(1, rel=1e-6)
    assert light(zero_order_relative_intensity=zero) == pytest.approx(1 + zero / 40, rel=1e-6)
    ghosts = light(ghost_relative_intensity=ghost, ghost_offset_px=(6.0, 5.0))
    assert ghosts == pytest.approx(1 + ghost, rel=1e-6)
    for flatness in (0.5, 1.0):
        p = 1 + 2 * flatness
        expected = 2 ** (1 / p) * math.gamma(1 + 1 / p) / 2
        assert light(beam_flatness=flatness) == pytest.approx(expected, rel=1e-3)  # a steep edge, summed over pixels


def test_positions_of_a_set_with_another_wavelength(context):
    """Centroids of well separated dots: 12 nm of 940 nm move a dot 60 px from the axis by 0.77 px."""
    x, y = np.meshgrid(np.arange(15, 150, 20.0), np.arange(15, 120, 20.0))
    positions = np.stack([x, y], axis=-1).reshape(-1, 2) + np.random.default_rng(77).uniform(-2, 2, (x.size, 2))
    shape, centre, shift = (130, 160), np.array([79.5, 64.5]), 12 / 940
    image = clspeckle.Dots(shape, positions, sigma_px=1.4, relative_wavelength_shift=shift, context=context).render()
    expected = centre + (1 + shift) * (positions - centre)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    for (px, py), (old_x, old_y) in zip(expected, positions):
        window = (np.abs(columns - px) < 8) & (np.abs(rows - py) < 8)
        weight = image[window].astype(np.float64)
        got = np.array([(weight * columns[window]).sum(), (weight * rows[window]).sum()]) / weight.sum()
        assert np.allclose(got, (px, py), atol=2e-3)
        assert np.hypot(px - old_x, py - old_y) == pytest.approx(shift * np.hypot(*(np.array([old_x, old_y]) - centre)))


@pytest.mark.parametrize(
    ("name", "vectors"),
    [
        ("square", ((15.0, 0.0), (0.0, 15.0))),
        ("oblong", ((20.0, 0.0), (0.0, 11.0))),
        ("turned", ((14.0, 4.0), (-4.0, 14.0))),
        ("oblique", ((15.0, 2.0), (3.0, 14.0))),
    ],
)
def test_ghosts_without_an_offset_lie_in_the_middle_of_the_cell(context, name, vectors):
    """A lattice jittered by 1 px: the median over 24 x 24 dots finds half the cell's diagonal within 0.2 px."""
    i, j = np.meshgrid(np.arange(-12, 12), np.arange(-12, 12))
    v, w = np.array(vectors)
    lattice = 100 + i.reshape(-1, 1) * v + j.reshape(-1, 1) * w
    lattice = lattice + np.random.default_rng(78).uniform(-1, 1, lattice.shape)
    assert np.allclose(dots.lattice_offset(lattice), (v + w) / 2, atol=0.2), name
    options = {"sigma_px": 1.5, "ghost_relative_intensity": 0.2}
    automatic = clspeckle.Dots((200, 200), lattice, context=context, **options).render()
    told = clspeckle.Dots(
        (200, 200), lattice, ghost_offset_px=tuple(dots.lattice_offset(lattice)), context=context, **options
    ).render()
    assert np.abs(automatic - told).max() < 1e-6


def test_ghosts_of_many_dots_are_found_from_a_part_of_them(context):
    """4096 dots, of which 1024 are asked: the same offset as from all of them within 0.1 px along each axis; the images
    differ by no more than the slope of a ghost, 0.25 * 0.61 / 1.5 per px."""
    x, y = np.meshgrid(np.arange(64) * 6.0, np.arange(64) * 6.0)
    lattice = np.stack([x, y], axis=-1).reshape(-1, 2) + np.random.default_rng(79).uniform(-0.5, 0.5, (4096, 2))
    options = {"sigma_px": 1.5, "ghost_relative_intensity": 0.25}
    got = clspeckle.Dots((380, 380), lattice, context=context, **options).render()
    told = clspeckle.Dots(
        (380, 380), lattice, ghost_offset_px=tuple(dots.lattice_offset(lattice)), context=context, **options
    ).render()
    assert np.abs(got - told).max() < 0.1 * math.sqrt(2) * 0.25 * 0.61 / 1.5


# --- The Python class ---


def test_render_into_what_is_given(context):
    positions = jittered_lattice()
    stage = clspeckle.Dots(SHAPE, positions, context=context)
    expected = stage.render()
    out = np.empty(SHAPE, np.float32)
    assert stage.render(out=out) is out
    assert np.array_equal(out, expected)
    image = clspeckle.DeviceImage(SHAPE, np.float32, context=context)
    assert stage.render(out=image) is image
    assert np.array_equal(image.read(), expected)
    stage.enqueue_render(image).wait()
    assert np.array_equal(image.read(), expected)
    assert stage.shape == SHAPE
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="out has shape"):
        stage.render(out=np.empty((3, 3), np.float32))
    with pytest.raises(TypeError, match="irradiance"):
        stage.enqueue_render(out)


def test_configure(context):
    positions = jittered_lattice()
    stage = clspeckle.Dots(SHAPE, positions, context=context, **EVERYTHING)
    single = {name: EVERYTHING[name] for name in ("sigma_px", "peaks")}
    stage.configure(scatter_fraction=0.5)
    expected = clspeckle.Dots(SHAPE, positions, scatter_fraction=0.5, context=context, **single).render()
    assert np.array_equal(stage.render(), expected)
    for bad in ({"scatter_fraction": 2.0}, {"beam_skew": math.nan}, {"peaks": np.ones(56)}, {"sigma_px": np.ones(56)}):
        with pytest.raises(clspeckle.errors.InvalidArgumentError):
            stage.configure(**bad)
    with pytest.raises(TypeError, match="did you mean"):
        stage.configure(beam_skw=1.0)
    assert np.array_equal(stage.render(), expected)
    stage.configure(positions[:3], sigma_px=1.0)
    assert np.array_equal(stage.render(), clspeckle.Dots(SHAPE, positions[:3], sigma_px=1.0, context=context).render())
    stage.close()
    with pytest.raises(clspeckle.errors.InvalidHandleError):
        stage.render()


def test_defaults():
    defaults = clspeckle.Dots.defaults()
    assert defaults["sigma_px"] == 2.0
    assert defaults["scale"] == 1.0
    assert {value for name, value in defaults.items() if name not in ("sigma_px", "scale")} == {0.0}


@pytest.mark.parametrize(
    ("arguments", "options", "error", "words"),
    [
        (((0, 5), [[1, 2]]), {}, clspeckle.errors.InvalidArgumentError, "shape"),
        ((SHAPE, []), {}, clspeckle.errors.InvalidArgumentError, r"positions_px has shape \(0,\), expected \(n, 2\)"),
        ((SHAPE, np.zeros((0, 2))), {}, clspeckle.errors.InvalidArgumentError, "positions_px"),
        ((SHAPE, [[1, 2, 3]]), {}, clspeckle.errors.InvalidArgumentError, "positions_px"),
        ((SHAPE, None), {}, TypeError, "positions_px"),
        ((SHAPE, "dots"), {}, TypeError, "positions_px"),
        ((SHAPE, [[1j, 2]]), {}, clspeckle.errors.InvalidFormatError, "positions_px"),
        ((SHAPE, [[1, math.nan]]), {}, clspeckle.errors.InvalidDataError, "y of dot 0 is nan"),
        ((SHAPE, [[math.inf, 1]]), {}, clspeckle.errors.InvalidDataError, "x of dot 0 is inf"),
        ((SHAPE, [[1, 2]]), {"sigma_px": 0}, clspeckle.errors.InvalidArgumentError, "sigma_px"),
        ((SHAPE, [[1, 2]]), {"sigma_px": [-1.0]}, clspeckle.errors.InvalidDataError, r"sigmas_px\[0\]"),
        ((SHAPE, [[1, 2]]), {"sigma_px": [1.0, 2.0]}, clspeckle.errors.InvalidArgumentError, "sigma_px has shape"),
        ((SHAPE, [[1, 2]]), {"peaks": [1.0, 2.0]}, clspeckle.errors.InvalidArgumentError, "peaks has shape"),
        ((SHAPE, [[1, 2]]), {"peaks": [-1.0]}, clspeckle.errors.InvalidDataError, r"peaks\[0\]"),
        ((SHAPE, [[1, 2]]), {"peaks": "one"}, TypeError, "peaks"),
        ((SHAPE, [[1, 2]]), {"principal_point_px": 3}, TypeError, r"principal_point_px must be \(x, y\)"),
        ((SHAPE, [[1, 2]]), {"principal_point_px": "34"}, TypeError, "principal_point_px"),
        ((SHAPE, [[1, 2]]), {"ghost_offset_px": (1, math.inf)}, clspeckle.errors.InvalidArgumentError, "ghost_offset"),
        ((SHAPE, [[1, 2]]), {"ghost_relative_intensity": 1.0}, clspeckle.errors.InvalidArgumentError, "no lattice"),
        ((SHAPE, [[1, 2]]), {"scatter_fraction": 1.01}, clspeckle.errors.InvalidArgumentError, "scatter_fraction"),
        ((SHAPE, [[1, 2]]), {"scale": "bright"}, TypeError, "scale"),
    ],
)
def test_bad_input(context, arguments, options, error, words):
    with pytest.raises(error, match=words):
        clspeckle.Dots(*arguments, context=context, **options)
