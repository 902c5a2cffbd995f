"""The lens against the float64 reference: points, images, light."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest

from reference import lens as reference

HEIGHT, WIDTH = 60, 96
RNG = np.random.default_rng


def make(context, distortion, **options):
    """The library's lens for a reference distortion."""
    if distortion.focal_length_px is not None:
        options.setdefault("focal_length_px", distortion.focal_length_px)
        options.setdefault("radius_unit", "focal_length")
    return clspeckle.Lens(
        (distortion.height, distortion.width),
        **{name: getattr(distortion, name) for name in ("k1", "k2", "k3", "p1", "p2")},
        principal_point_px=distortion.principal_point_px,
        context=context,
        **options,
    )


DISTORTIONS = {
    "protocol_weak": {"k1": 0.01},
    "protocol_strong": {"k1": 0.05},
    "barrel": {"k1": -0.12},
    "moustache": {"k1": -0.1, "k2": 0.08, "k3": -0.01},
    "tangential": {"k1": 0.03, "p1": 0.01, "p2": -0.02},
    "off_axis": {"k1": 0.04, "k2": -0.01, "principal_point_px": (40.25, 33.5)},
    "opencv": {
        "k1": -0.21,
        "k2": 0.07,
        "k3": -0.01,
        "p1": 1.1e-3,
        "p2": -0.7e-3,
        "focal_length_px": (90.0, 88.0),
        "principal_point_px": (46.1, 30.7),
    },
}


def distortion_of(name):
    return reference.Distortion(WIDTH, HEIGHT, **DISTORTIONS[name])


def pixels():
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    return np.stack([x, y], axis=-1)


@pytest.mark.parametrize("name", DISTORTIONS)
def test_points(context, measured, name):
    """The formula to 1e-11 px; there and back to 1e-9 px, both ways, over and around the image."""
    expected = distortion_of(name)
    lens = make(context, expected)
    points = RNG(5).uniform([-10, -8], [WIDTH + 10, HEIGHT + 8], (500, 2))
    imaged = lens.distort_points(points)
    assert np.abs(imaged - expected.distort(points)).max() < 1e-11
    for error in (
        lens.undistort_points(imaged) - points,
        lens.distort_points(lens.undistort_points(pixels())) - pixels(),
    ):
        measured("round trip, px", np.abs(error).max())
        assert np.abs(error).max() < 1e-9
    assert lens.distort_points(points).shape == points.shape


def test_random_distortions_invert(context, measured):
    """A hundred random distortions, those that fold over left out (they are refused): there and back to 1e-9 px."""
    rng = RNG(6)
    inverted = 0
    for _ in range(100):
        k1, k2, k3 = rng.uniform(-0.25, 0.4, 3) * (1, 0.5, 0.25)
        p1, p2 = rng.uniform(-0.03, 0.03, 2)
        try:
            lens = clspeckle.Lens((9, 14), k1=k1, k2=k2, k3=k3, p1=p1, p2=p2, context=context)
        except clspeckle.errors.InvalidArgumentError as refused:
            if "folds over" not in str(refused):
                raise
            continue
        y, x = np.mgrid[:9, :14].astype(np.float64)
        grid = np.stack([x, y], axis=-1)
        error = np.abs(lens.distort_points(lens.undistort_points(grid)) - grid).max()
        measured("round trip, px", error)
        assert error < 1e-9
        inverted += 1
    assert inverted > 50


def test_corner_convention(context):
    """The protocol's lens_distortion: x -> x (1 + k1 r^2) with r = 1 in the corner."""
    lens = clspeckle.Lens((HEIGHT, WIDTH), k1=0.05, context=context)
    centre = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
    corners = np.array([[0, 0], [WIDTH - 1, 0], [0, HEIGHT - 1], [WIDTH - 1, HEIGHT - 1]], dtype=float)
    assert np.abs(lens.distort_points(corners) - (centre + 1.05 * (corners - centre))).max() < 1e-12
    assert np.array_equal(lens.distort_points(centre), centre)


def test_straight_lines(context):
    """Lines through the principal point stay straight; others bow by the formula: away from it in a barrel lens."""
    for k1 in (-0.1, 0.05):
        expected = reference.Distortion(WIDTH, HEIGHT, k1=k1)
        lens = make(context, expected)
        t = np.linspace(-1, 1, 101)[:, None]
        centre = expected.principal
        through = lens.distort_points(centre + t * np.array([40.0, 17.0])) - centre
        assert np.abs(through @ np.array([-17.0, 40.0]) / np.hypot(17, 40)).max() < 1e-12
        # A horizontal line 20 px below the axis: its ends, 40 px off, lie at y (1 + k1 (40^2 + 20^2)/R^2), its middle
        # at y (1 + k1 20^2/R^2).
        line = lens.distort_points(centre + np.array([0.0, 20.0]) + t * np.array([40.0, 0.0])) - centre
        sagitta = line[50, 1] - (line[0, 1] + line[100, 1]) / 2
        assert sagitta == pytest.approx(-20 * k1 * 1600 / expected.corner**2, abs=1e-10)
        # Undistorting straightens it again.
        back = lens.undistort_points(line + centre)
        assert np.abs(back[:, 1] - centre[1] - 20).max() < 1e-9


def test_fold_over(context):
    """r (1 + k1 r^2) turns back at r^2 = -1 / (3 k1); the image's corner (r = 1) must be imaged before that."""
    # It reaches 2 / (3 sqrt(-3 k1)) there: r = 1 of the image needs k1 >= -4/27.
    clspeckle.Lens((HEIGHT, WIDTH), k1=-4 / 27 + 1e-6, context=context)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match=r"folds over .* pixel \(0, 0\)"):
        clspeckle.Lens((HEIGHT, WIDTH), k1=-4 / 27 - 1e-6, context=context)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="folds over"):
        clspeckle.Lens((HEIGHT, WIDTH), p1=0.5, context=context)
    lens = clspeckle.Lens((HEIGHT, WIDTH), k1=-0.1, context=context)
    centre = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
    radius = np.hypot(*centre)
    fold = np.sqrt(1 / 0.3)
    along = centre / radius
    imaged = lens.distort_points(
        np.array([centre + 0.999 * fold * radius * along, centre + 1.001 * fold * radius * along])
    )
    assert np.isfinite(imaged[0]).all()
    assert np.isnan(imaged[1]).all()
    farthest = 2 / 3 * fold
    back = lens.undistort_points(
        np.array([centre + 0.999 * farthest * radius * along, centre + 1.001 * farthest * radius * along])
    )
    assert np.isfinite(back[0]).all()
    assert np.isnan(back[1]).all()


def scene(seed=7):
    """Dots of all brightnesses on a gradient."""
    rng = RNG(seed)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    image = 0.1 + 0.002 * x
    for px, py, peak in zip(rng.uniform(0, WIDTH, 60), rng.uniform(0, HEIGHT, 60), rng.uniform(0.2, 3, 60)):
        image += peak * np.exp(-((x - px) ** 2 + (y - py) ** 2) / (2 * 1.2**2))
    return image.astype(np.float32)


@pytest.mark.parametrize("name", DISTORTIONS)
@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
def test_images(context, measured, name, interpolation):
    expected = distortion_of(name)
    lens = make(context, expected)
    sources = expected.sources()
    image = scene()
    # Where rounding decides between two pixels, or between inside and outside, float and double may differ.
    undecided = np.abs((sources + 0.5) - np.round(sources + 0.5)).min(axis=-1) < 1e-5
    got, want = lens.distort(image, interpolation=interpolation), reference.warp(image, sources, interpolation)
    compared = ~undecided
    assert compared.mean() > 0.95
    error = np.abs(got - want)[compared].max()
    measured(f"{interpolation}, of a peak of {image.max():.1f}", error)
    assert error < (1e-12 if interpolation == "nearest" else 3e-6)
    # Vectors go the way that light goes.
    vectors = RNG(8).normal(size=(HEIGHT, WIDTH, 3)).astype(np.float32)
    for channels, outside in ((2, 0.0), (3, np.nan)):
        part = np.ascontiguousarray(vectors[..., :channels])
        want = reference.warp(part, sources, interpolation, outside)
        got = lens.distort(part, interpolation=interpolation)
        assert np.allclose(got[compared], want[compared], rtol=0, atol=1e-5, equal_nan=True)
    if interpolation == "nearest":
        for dtype in (np.uint8, np.uint16, np.uint32):
            integers = RNG(9).integers(0, np.iinfo(dtype).max, (HEIGHT, WIDTH), dtype=dtype, endpoint=True)
            want = reference.warp(integers, sources, "nearest")
            assert np.array_equal(lens.distort(integers)[compared], want[compared])
        mask = image > 0.5
        assert np.array_equal(lens.distort(mask)[compared], reference.warp(mask, sources, "nearest")[compared])


@pytest.mark.parametrize("options", [*DISTORTIONS.values(), {"k1": -0.148}, {"k1": 4.0}], ids=str)
def test_ramps_show_where_pixels_come_from(context, measured, options):
    """A whole image's sources are found another way than those of points: cubics pass ramps on as they are, to 3e-5 px.
    -0.148 folds over just behind the corner; 4 brings it there from half of its radius."""
    lens = make(context, reference.Distortion(WIDTH, HEIGHT, **options))
    sources = lens.undistort_points(pixels())
    inside = ((sources > 2) & (sources < np.array([WIDTH, HEIGHT]) - 3)).all(axis=-1)
    assert inside.sum() > 500
    for axis in (0, 1):
        shown = lens.distort(pixels()[..., axis].astype(np.float32))
        error = np.abs(shown - sources[..., axis])[inside].max()
        measured("sources, px", error)
        assert error < 3e-5


def test_cubic_keeps_light_positive(context):
    """A bright pixel beside dark ones: the cubic's undershoot is cut, light that may be negative keeps it."""
    lens = clspeckle.Lens((HEIGHT, WIDTH), k1=0.05, context=context)
    image = np.zeros((HEIGHT, WIDTH), np.float32)
    image[::7, ::7] = 100
    assert lens.distort(image, interpolation="cubic").min() == 0
    assert lens.distort((image - 1), interpolation="cubic").min() == -1


def test_dots_land_where_their_points_do(context, measured):
    """A dot's centroid in the warped image against distort_points of its place: 0.02 px (dot of sigma 1.5 px)."""
    lens = clspeckle.Lens((HEIGHT, WIDTH), k1=0.05, p1=0.004, context=context)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    for place in ([20.3, 15.6], [70.8, 44.1], [48.0, 30.0]):
        dot = np.exp(-((x - place[0]) ** 2 + (y - place[1]) ** 2) / (2 * 1.5**2)).astype(np.float32)
        warped = lens.distort(dot).astype(np.float64)
        centroid = np.array([(warped * x).sum(), (warped * y).sum()]) / warped.sum()
        error = np.abs(centroid - lens.distort_points(place)).max()
        measured("centroid, px", error)
        assert error < 0.02


def test_no_distortion_is_a_copy(context):
    lens = clspeckle.Lens((HEIGHT, WIDTH), context=context)
    image = scene()
    image[3, 4] = np.nan
    for interpolation in ("nearest", "cubic"):
        got = lens.distort(image, interpolation=interpolation)
        if interpolation == "nearest":
            assert np.array_equal(got, image, equal_nan=True)
        else:
            # A NaN stays one, wherever the cubic's taps reach it.
            bad = np.isnan(got)
            assert bad[3, 4]
            assert bad.sum() <= 16
            assert np.array_equal(got[~bad], image[~bad])
    assert np.array_equal(lens.finish(scene()), scene())


def test_vignetting(context, measured):
    """In the corner the light is 1 - a, in the centre 1."""
    flat = np.ones((HEIGHT + 1, WIDTH + 1), np.float32)
    for loss in (0.12, 0.45, 1.0):
        lens = clspeckle.Lens(flat.shape, vignetting_corner_loss=loss, context=context)
        got = lens.finish(flat)
        want = reference.vignetting(reference.Distortion(WIDTH + 1, HEIGHT + 1), loss)
        assert np.abs(got - want).max() < 1e-6
        for corner in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
            assert abs(got[corner] - (1 - loss)) < 2.5e-7
        assert got[HEIGHT // 2, WIDTH // 2] == 1
    # Off the axis: r = 1 in the farthest corner.
    distortion = reference.Distortion(WIDTH, HEIGHT, principal_point_px=(30.0, 20.0))
    lens = make(context, distortion, vignetting_corner_loss=0.3)
    got = lens.finish(flat[:HEIGHT, :WIDTH])
    assert np.abs(got - reference.vignetting(distortion, 0.3)).max() < 1e-6
    assert abs(got[-1, -1] - 0.7) < 2.5e-7
    # cos^4, with and without.
    for loss in (0.0, 0.2):
        options = {"cos4_falloff": True, "focal_length_px": (70.0, 65.0), "vignetting_corner_loss": loss}
        got = clspeckle.Lens((HEIGHT, WIDTH), context=context, **options).finish(flat[:HEIGHT, :WIDTH])
        want = reference.vignetting(reference.Distortion(WIDTH, HEIGHT), loss, (70.0, 65.0))
        measured("error", np.abs(got - want).max())
        assert np.abs(got - want).max() < 1e-6


@pytest.mark.parametrize("scale_px", [0.5, 2.0, 6.0])
def test_glare(context, measured, scale_px):
    """1e-6 of the peak on the same grid in float64; against an image that really goes on beyond its borders 3e-4 of the
    peak times the fraction (what the other side's edge adds)."""
    light = RNG(11).exponential(1.0, (HEIGHT, WIDTH)).astype(np.float32)
    fraction = 0.2
    lens = clspeckle.Lens((HEIGHT, WIDTH), glare_fraction=fraction, glare_scale_px=scale_px, context=context)
    got = lens.finish(light)
    distortion = reference.Distortion(WIDTH, HEIGHT)
    want = reference.finish(light, distortion, glare_fraction=fraction, glare_scale_px=scale_px)
    measured("of the peak", np.abs(got - want).max() / light.max())
    assert np.abs(got - want).max() < 1e-6 * light.max()
    reach = int(np.ceil(25 * scale_px))
    extended = np.pad(light.astype(np.float64), reach, mode="edge")
    spread = reference.exponential_spread(*extended.shape, scale_px)
    far = np.fft.ifft2(np.fft.fft2(extended) * np.fft.fft2(spread)).real[reach:-reach, reach:-reach]
    error = np.abs(got - ((1 - fraction) * light + fraction * far)).max()
    measured("of the peak and the fraction, borders", error / light.max() / fraction)
    assert error < 3e-4 * light.max() * fraction


def test_glare_keeps_energy_and_spreads_a_dot(context, measured):
    lens = clspeckle.Lens((129, 129), glare_fraction=0.3, glare_scale_px=4, context=context)
    flat = np.full((129, 129), 2.5, np.float32)
    assert np.abs(lens.finish(flat) - 2.5).max() < 2.5e-6
    dot = np.zeros((129, 129), np.float32)
    dot[64, 64] = 1
    got = lens.finish(dot).astype(np.float64)
    # All light is still there, but for what leaves the image: (1 + R/L) exp(-R/L) of the glare beyond R = 64 at most.
    lost = 0.3 * (1 + 16) * np.exp(-16)
    assert abs(got.sum() - 1) < lost + 2e-6
    # The tail follows the kernel: ratios of exp(-d/L) along an axis and along a diagonal.
    for d in (1, 5, 20):
        assert got[64, 64 + d + 4] / got[64, 64 + d] == pytest.approx(np.exp(-1), rel=1e-3)
        assert got[64 + d, 64 + d] / got[64, 64 + d] == pytest.approx(np.exp(-(np.sqrt(2) - 1) * d / 4), rel=1e-3)
    h = reference.exponential_spread(129, 129, 4)
    assert got[64, 64] == pytest.approx(0.7 + 0.3 * h[0, 0], rel=1e-6)
    assert got.min() >= 0


def test_ambient_order_and_dark(context):
    """Ambient light is vignetted like all light, gets no glare of its own (it is flat), is missing in dark frames."""
    light = RNG(12).exponential(1.0, (HEIGHT, WIDTH)).astype(np.float32)
    distortion = reference.Distortion(WIDTH, HEIGHT)
    options = {"glare_fraction": 0.1, "glare_scale_px": 3.0, "vignetting_corner_loss": 0.3}
    lens = clspeckle.Lens((HEIGHT, WIDTH), ambient=0.7, context=context, **options)
    want = reference.finish(light, distortion, ambient=0.7, **options)
    assert np.abs(lens.finish(light) - want).max() < 2e-6 * light.max()
    want = reference.finish(light, distortion, **options)
    assert np.abs(lens.finish(light, dark=True) - want).max() < 2e-6 * light.max()
    only = clspeckle.Lens((HEIGHT, WIDTH), ambient=0.25, context=context)
    assert np.array_equal(only.finish(light), light + np.float32(0.25))
    assert np.array_equal(only.finish(light, dark=True), light)


def test_in_place_and_device_images(context):
    light = RNG(13).exponential(1.0, (HEIGHT, WIDTH)).astype(np.float32)
    lens = clspeckle.Lens(
        (HEIGHT, WIDTH), k1=0.03, glare_fraction=0.1, ambient=0.1, vignetting_corner_loss=0.2, context=context
    )
    image = clspeckle.DeviceImage.from_array(light, context=context)
    lens.enqueue_finish(image, image).wait()
    assert np.array_equal(image.read(), lens.finish(light))
    source = clspeckle.DeviceImage.from_array(light, context=context)
    lens.enqueue_distort(source, image).wait()
    assert np.array_equal(image.read(), lens.distort(light))
    lens.enqueue_distort(source, image, interpolation="linear").wait()
    assert np.array_equal(image.read(), lens.distort(light, interpolation="linear"))
    with pytest.raises(clspeckle.errors.OverlapError):
        lens.enqueue_distort(image, image)
    out = np.empty((HEIGHT, WIDTH), np.float32)
    assert lens.distort(light, out=out) is out


def test_bad_pixels_do_not_spread(context):
    """A NaN in a device image spoils its own pixel, not the frame."""
    light = np.ones((HEIGHT, WIDTH), np.float32)
    light[10, 20], light[30, 40], light[50, 60] = np.nan, np.inf, -1
    lens = clspeckle.Lens((HEIGHT, WIDTH), glare_fraction=0.2, context=context)
    image = clspeckle.DeviceImage.from_array(light, context=context)
    lens.enqueue_finish(image, image).wait()
    got = image.read()
    good = light == 1
    assert np.isfinite(got[good]).all()
    assert (got[good] <= 1 + 1e-6).all()
    assert (got[good] > 0.9).all()
    assert got[50, 60] == -1


def test_configure(context):
    """A new lens in place of the old one; after an error the old one stays."""
    flat = np.ones((HEIGHT, WIDTH), np.float32)
    lens = clspeckle.Lens((HEIGHT, WIDTH), vignetting_corner_loss=0.5, context=context)
    before = lens.finish(flat)
    for bad in ({"k1": -0.5}, {"glare_fraction": 1.5}, {"k1": np.nan}):
        with pytest.raises(clspeckle.errors.InvalidArgumentError):
            lens.configure(**bad)
        assert np.array_equal(lens.finish(flat), before)
    with pytest.raises(TypeError, match='did you mean "ambient"'):
        lens.configure(ambiant=1)
    lens.configure(k1=0.05)
    assert np.array_equal(lens.finish(flat), flat)
    fresh = clspeckle.Lens((HEIGHT, WIDTH), k1=0.05, context=context)
    assert np.array_equal(lens.distort(scene()), fresh.distort(scene()))
    lens.configure((4, 6), ambient=1)
    assert lens.finish(np.zeros((4, 6), np.float32)).tolist() == [[1.0] * 6] * 4
    assert lens.shape == (4, 6)


def test_defaults_change_nothing():
    defaults = clspeckle.Lens.defaults()
    assert defaults["glare_scale_px"] == 6.0
    assert defaults["radius_unit"] == "corner"
    assert all(defaults[name] == 0 for name in ("k1", "k2", "k3", "p1", "p2", "ambient", "glare_fraction"))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"k1": "strong"}, TypeError, "k1 must be a number"),
        ({"radius_unit": "diagonal"}, clspeckle.errors.InvalidArgumentError, "radius_unit"),
        ({"radius_unit": "focal_length", "k1": 0.1}, clspeckle.errors.InvalidArgumentError, "focal_length_x_px"),
        ({"cos4_falloff": True}, clspeckle.errors.InvalidArgumentError, "focal_length_x_px"),
        ({"focal_length_px": (100.0, -1.0)}, clspeckle.errors.InvalidArgumentError, "focal_length_y_px"),
        ({"focal_length_px": 100.0}, TypeError, "two numbers"),
        ({"principal_point_px": (np.nan, 0.0)}, clspeckle.errors.InvalidArgumentError, "principal_point_x_px"),
        ({"vignetting_corner_loss": -0.1}, clspeckle.errors.InvalidArgumentError, "vignetting_corner_loss"),
        ({"vignetting_corner_loss": 1.1}, clspeckle.errors.InvalidArgumentError, "vignetting_corner_loss"),
        ({"glare_scale_px": 0}, clspeckle.errors.InvalidArgumentError, "glare_scale_px"),
        ({"ambient": -1}, clspeckle.errors.InvalidArgumentError, "ambient"),
        ({"ambient": np.inf}, clspeckle.errors.InvalidArgumentError, "ambient"),
        ({"cos4_falloff": 1}, TypeError, "cos4_falloff must be True or False"),
    ],
)
def test_bad_parameters(context, options, error, words):
    with pytest.raises(error, match=words):
        clspeckle.Lens((HEIGHT, WIDTH), context=context, **options)


def test_bad_arguments(context):
    lens = clspeckle.Lens((HEIGHT, WIDTH), k1=0.05, context=context)
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="shape"):
        lens.finish(np.ones((4, 4), np.float32))
    with pytest.raises(clspeckle.errors.InvalidDataError):
        lens.finish(np.full((HEIGHT, WIDTH), np.nan, np.float32))
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="did you mean"):
        lens.distort(scene(), interpolation="cubik")
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="use nearest"):
        lens.distort(np.zeros((HEIGHT, WIDTH), np.uint8), interpolation="linear")
    with pytest.raises(clspeckle.errors.InvalidFormatError, match="int64"):
        lens.distort(np.zeros((HEIGHT, WIDTH), np.int64))
    with pytest.raises(TypeError, match="dark must be True or False"):
        lens.finish(scene(), dark=1)
    with pytest.raises(clspeckle.errors.InvalidDataError, match="point 1"):
        lens.distort_points([[0, 0], [np.nan, 1]])
    with pytest.raises(clspeckle.errors.InvalidArgumentError, match="shape"):
        lens.undistort_points([1, 2, 3])
    assert lens.distort_points(np.empty((0, 2))).shape == (0, 2)
