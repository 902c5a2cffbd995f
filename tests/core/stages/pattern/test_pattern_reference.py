"""The pattern lookup against the float64 reference."""

from __future__ import annotations

import itertools

import clspeckle
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reference import pattern

SHAPE = (60, 80)
HALF_EXTENT = (0.45, 0.4)
POWER = 2.5
INTRINSICS = (90.0, 95.0, 40.2, 29.1)  # fx, fy, cx, cy in pixels
PROJECTIONS = [pattern.TANGENT_PLANE, pattern.DIRECTION_COSINES]
QUANTITIES = [pattern.RADIANT_INTENSITY, pattern.PLANE_IRRADIANCE]


def pose(rotation_vector=(0.1, -0.2, 0.05), translation=(0.05, -0.02, 0.01)):
    return np.hstack([Rotation.from_rotvec(rotation_vector).as_matrix(), np.array(translation)[:, None]])


def random_scene():
    """Positions in front of, beside and behind the laser, normals both ways."""
    rng = np.random.default_rng(51)
    position = rng.uniform([-0.8, -0.6, -0.4], [0.8, 0.6, 2.0], (*SHAPE, 3)).astype(np.float32)
    normal = rng.standard_normal((*SHAPE, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return {
        "position": position,
        "normal": normal.astype(np.float32),
        "albedo": rng.random(SHAPE).astype(np.float32),
        "visibility": rng.random(SHAPE).astype(np.float32),
        "depth": rng.uniform(0.4, 2.0, SHAPE).astype(np.float32),
        "texels": rng.random((48, 64)).astype(np.float32),
    }


def compare(context, measured, position, texels, geometry, maps, options):
    """Library against reference, over the light that the brightest texel would bring to the pixel.

    Left out are pixels within 1e-5 of the pattern's border or of the laser's plane, where single precision may fall
    on the other side (fewer than 1 % of the pixels)."""
    stage = clspeckle.Pattern(texels, context=context, **options)
    got = stage.lookup(clspeckle.Geometry(**geometry, **maps))
    expected = pattern.lookup(texels, position, **maps, **options)
    assert got.dtype == np.float32
    assert np.all(np.isfinite(got))

    transform = np.asarray(options.get("laser_from_geometry", np.eye(3, 4)))
    laser = position[..., :3].astype(np.float64) @ transform[:, :3].T + transform[:, 3]
    with np.errstate(all="ignore"):
        distance = np.linalg.norm(laser, axis=-1)
        below = laser[..., 2:] if options["projection"] == pattern.TANGENT_PLANE else distance[..., None]
        coordinate = np.abs(laser[..., :2] / below)
        border = np.array([options["half_extent_x"], options["half_extent_y"]])
        doubtful = np.any(np.abs(coordinate - border) < 1e-5, axis=-1) | (np.abs(laser[..., 2]) < 1e-5)
        largest = options["power_scale"] * texels.max() / distance**2 / np.pi
        if options["quantity"] == pattern.PLANE_IRRADIANCE:
            largest = largest / np.clip(laser[..., 2] / distance, 1e-3, 1) ** 3
    assert doubtful.mean() < 0.01
    compared = ~doubtful & np.isfinite(largest)
    error = float(np.max(np.abs(got - expected)[compared] / largest[compared]))
    measured("error over the brightest light", error)
    assert error < 2e-5
    assert np.array_equal((got > 0)[compared], (expected > 0)[compared])
    assert not np.any(got[~np.isfinite(largest)])
    return got, expected


def all_options(projection, quantity, **more):
    return {
        "projection": projection,
        "quantity": quantity,
        "half_extent_x": HALF_EXTENT[0],
        "half_extent_y": HALF_EXTENT[1],
        "power_scale": POWER,
        "laser_from_geometry": pose(),
    } | more


@pytest.mark.parametrize(("projection", "quantity"), list(itertools.product(PROJECTIONS, QUANTITIES)))
@pytest.mark.parametrize("maps", [(), ("normal",), ("albedo",), ("visibility",), ("normal", "albedo", "visibility")])
def test_lookup_of_positions(context, measured, projection, quantity, maps):
    scene = random_scene()
    _, expected = compare(
        context,
        measured,
        scene["position"],
        scene["texels"],
        {"position": scene["position"]},
        {name: scene[name] for name in maps},
        all_options(projection, quantity),
    )
    lit = np.mean(expected > 0)
    assert 0.1 < lit < 0.6  # both lit pixels and pixels outside the pattern, behind the laser or turned away


@pytest.mark.parametrize(("projection", "quantity"), list(itertools.product(PROJECTIONS, QUANTITIES)))
@pytest.mark.parametrize("depth_kind", [pattern.ALONG_AXIS, pattern.ALONG_RAY])
def test_lookup_of_depth(context, measured, projection, quantity, depth_kind):
    scene = random_scene()
    position = pattern.positions_from_depth(scene["depth"], *INTRINSICS, depth_kind)
    compare(
        context,
        measured,
        position,
        scene["texels"],
        {"depth": scene["depth"], "depth_kind": depth_kind, "intrinsics": INTRINSICS},
        {"normal": scene["normal"], "albedo": scene["albedo"]},
        all_options(projection, quantity),
    )


@pytest.mark.parametrize("rotation", [(0, 0, 0), (0.5, 0, 0), (0, -0.5, 0), (0, 0, 1.5), (2.0, 0.4, -0.3)])
def test_poses(context, measured, rotation):
    """Rotations about each axis, one that looks away from most of the scene; set_pose() gives what the constructor
    gives."""
    scene = random_scene()
    options = all_options(PROJECTIONS[0], QUANTITIES[0], laser_from_geometry=pose(rotation, (-0.3, 0.1, 0.2)))
    got, _ = compare(
        context,
        measured,
        scene["position"],
        scene["texels"],
        {"position": scene["position"]},
        {"normal": scene["normal"]},
        options,
    )
    moved = clspeckle.Pattern(scene["texels"], context=context, **(options | {"laser_from_geometry": pose()}))
    moved.set_pose(options["laser_from_geometry"])
    assert np.array_equal(moved.lookup(clspeckle.Geometry(position=scene["position"], normal=scene["normal"])), got)


def test_four_component_images_ignore_the_fourth(context):
    scene = random_scene()
    stage = clspeckle.Pattern(scene["texels"], context=context, **all_options(PROJECTIONS[0], QUANTITIES[0]))
    junk = np.full((*SHAPE, 1), np.nan, np.float32)
    three = stage.lookup(clspeckle.Geometry(position=scene["position"], normal=scene["normal"]))
    four = stage.lookup(
        clspeckle.Geometry(
            position=np.concatenate([scene["position"], junk], axis=-1),
            normal=np.concatenate([scene["normal"], junk], axis=-1),
        )
    )
    assert np.array_equal(three, four)


def test_byte_visibility(context, measured):
    """0 to 255 stand for 0 to 1."""
    scene = random_scene()
    visibility = np.random.default_rng(52).integers(0, 256, SHAPE).astype(np.uint8)
    compare(
        context,
        measured,
        scene["position"],
        scene["texels"],
        {"position": scene["position"]},
        {"visibility": visibility},
        all_options(PROJECTIONS[0], QUANTITIES[0]),
    )


def flat_pattern(context, **options):
    return clspeckle.Pattern(
        np.ones((16, 16), np.float32), half_extent_x=1.0, half_extent_y=1.0, context=context, **options
    )


def wall(distance, half_width=0.5, size=32):
    """A wall square to the axis, with its normals."""
    x = ((np.arange(size) + 0.5) / size * 2 - 1) * half_width
    grid_x, grid_y = np.meshgrid(x, x)
    position = np.stack([grid_x, grid_y, np.full_like(grid_x, distance)], axis=-1).astype(np.float32)
    normal = np.broadcast_to(np.array([0, 0, -1], np.float32), position.shape)
    return position, np.ascontiguousarray(normal)


def test_back_facing_and_behind_the_laser_are_dark(context):
    stage = flat_pattern(context)
    position, normal = wall(1.0)
    assert np.all(stage.lookup(clspeckle.Geometry(position=position, normal=normal)) > 0)
    assert not np.any(stage.lookup(clspeckle.Geometry(position=position, normal=-normal)))
    sideways = np.zeros_like(normal)
    sideways[..., 1] = 1.0  # faces down: lit from above only
    lit = stage.lookup(clspeckle.Geometry(position=position, normal=sideways))
    assert np.array_equal(lit > 0, position[..., 1] < 0)
    behind = position * np.array([1, 1, -1], np.float32)
    assert not np.any(stage.lookup(clspeckle.Geometry(position=behind)))
    assert not np.any(stage.lookup(clspeckle.Geometry(position=position * np.array([1, 1, 0], np.float32))))


def test_outside_the_pattern_is_dark(context):
    stage = clspeckle.Pattern(np.ones((4, 4), np.float32), half_extent_x=0.25, half_extent_y=0.125, context=context)
    position, _ = wall(1.0)
    inside = (np.abs(position[..., 0]) < 0.25) & (np.abs(position[..., 1]) < 0.125)
    assert np.array_equal(stage.lookup(clspeckle.Geometry(position=position)) > 0, inside)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_no_surface(context, bad):
    stage = flat_pattern(context)
    position, _ = wall(1.0)
    for component in range(3):
        broken = position.copy()
        broken[5, 6, component] = bad
        got = stage.lookup(clspeckle.Geometry(position=broken))
        assert got[5, 6] == 0
        assert np.count_nonzero(got == 0) == 1


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("depth_kind", [pattern.ALONG_AXIS, pattern.ALONG_RAY])
def test_no_depth(context, bad, depth_kind):
    stage = flat_pattern(context)
    depth = np.ones((16, 16), np.float32)
    depth[3, 4] = bad
    got = stage.lookup(clspeckle.Geometry(depth=depth, depth_kind=depth_kind, intrinsics=(30.0, 30.0, 7.5, 7.5)))
    assert got[3, 4] == 0
    assert np.count_nonzero(got == 0) == 1


def test_centre_texel_and_orientation(context):
    """One bright texel: its light lands where x (right) and y (down) of the laser frame say."""
    texels = np.zeros((9, 11), np.float32)
    texels[2, 8] = 3
    stage = clspeckle.Pattern(texels, half_extent_x=0.55, half_extent_y=0.45, context=context)
    # Centres: x = (8 + 0.5) / 11 * 1.1 - 0.55 = 0.3, y = (2 + 0.5) / 9 * 0.9 - 0.45 = -0.2, on a surface at z = 2.
    position = np.array([[[0.6, -0.4, 2.0], [-0.6, -0.4, 2.0], [0.6, 0.4, 2.0]]], np.float32)
    got = stage.lookup(clspeckle.Geometry(position=position))
    assert got[0, 0] == pytest.approx(3 / (0.36 + 0.16 + 4) / np.pi, rel=1e-5)
    assert np.abs(got[0, 1:]).max() < 1e-5


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_light_on_a_wall_falls_as_the_square_of_its_distance(context, quantity):
    """A wide flat pattern: the irradiance at each pixel of a wall at 2 d is a quarter of that at the same direction
    at d. So the mean over equal solid angles goes as d^-2 (exponent -2 within 1e-5). Over a wall of fixed size the
    direct sum of the cosine law gives the same to the last digit that single precision has."""
    stage = flat_pattern(context, quantity=quantity)
    distances = np.array([0.5, 1.0, 2.0, 4.0])
    same_angle = []
    for distance in distances:
        position, normal = wall(distance, half_width=0.4 * distance)
        image = stage.lookup(clspeckle.Geometry(position=position, normal=normal))
        same_angle.append(image.astype(np.float64).mean())
        x, y = position[..., 0].astype(np.float64), position[..., 1].astype(np.float64)
        cosine = distance / np.sqrt(x**2 + y**2 + distance**2)
        power = 4 - 1 if quantity == pattern.RADIANT_INTENSITY else 0
        assert np.allclose(image, cosine**power / distance**2 / np.pi, rtol=2e-6)
    exponent = np.polyfit(np.log(distances), np.log(same_angle), 1)[0]
    assert exponent == pytest.approx(-2, abs=1e-5)


def test_total_light_on_a_wall_does_not_depend_on_its_distance(context):
    """Power is conserved: summed over the area that the pattern covers, the irradiance of a pattern of random dots is
    the same at any distance, to the accuracy of the sum over pixels (1024^2 points, 1e-4)."""
    texels = np.zeros((32, 32), np.float32)
    texels[4:28, 4:28] = np.random.default_rng(53).random((24, 24))
    stage = clspeckle.Pattern(texels, half_extent_x=0.3, half_extent_y=0.3, context=context)
    total = []
    for distance in (0.5, 1.0, 3.0):
        position, normal = wall(distance, half_width=0.3 * distance, size=1024)
        pixel_area = (2 * 0.3 * distance / 1024) ** 2
        total.append(
            stage.lookup(clspeckle.Geometry(position=position, normal=normal)).astype(np.float64).sum() * pixel_area
        )
    assert np.allclose(total, total[0], rtol=1e-5)
    # The same power from the pattern's side: J over solid angle, d Omega = cos^3 dx dy.
    x = ((np.arange(1024) + 0.5) / 1024 * 2 - 1) * 0.3
    grid_x, grid_y = np.meshgrid(x, x)
    intensity = pattern.lookup_bilinear(texels, grid_x, grid_y, 0.3, 0.3)
    power = np.sum(intensity * (1 + grid_x**2 + grid_y**2) ** -1.5) * (0.6 / 1024) ** 2
    assert total[0] == pytest.approx(power / np.pi, rel=1e-4)
