"""The area filter of the pattern lookup: dots keep their light at any distance (pattern.h)."""

from __future__ import annotations

import clspeckle
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

WIDTH, HEIGHT = 320, 240
FOCAL = 280.0
INTRINSICS = (FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
HALF_EXTENT = 0.4
DISTANCES = [0.4, 0.7, 1.0, 1.6, 2.5, 3.6, 5.0]
BASELINE = [[1, 0, 0, 0.05], [0, 1, 0, 0], [0, 0, 1, 0]]


def dots(context, texels=2048, sigma=8e-4, count=7):
    """A lattice of dots, each sigma wide in direction cosines; a pixel is 1 / 280 wide, 9 texels."""
    beam = clspeckle.Beam(covariance_m2=((940e-9 / (4 * np.pi * sigma)) ** 2,) * 2)
    axis = np.linspace(-0.24, 0.24, count) + 0.0013
    directions = np.stack([a.ravel() for a in np.meshgrid(axis, axis[1:-1] * 0.7)], axis=1)
    return (
        clspeckle.DoePattern.ideal(
            directions, beam=beam, half_extent=HALF_EXTENT, image_shape=(texels, texels), context=context
        ),
        directions,
    )


def energies(image, directions, distance, pose=BASELINE):
    """The light of every dot over the wall: what its pixels show, times pi d^2 over their solid angle from the
    laser."""
    pose = np.asarray(pose, np.float64)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    ray = np.stack([(x - INTRINSICS[2]) / FOCAL, (y - INTRINSICS[3]) / FOCAL, np.ones_like(x)], axis=-1) * distance
    laser = ray @ pose[:, :3].T + pose[:, 3]
    d = np.linalg.norm(laser, axis=-1)
    w = laser / d[..., None]
    # The wall z = distance in the camera's frame has the normal (0, 0, -1) there.
    cosine = -(w @ (pose[:, :3] @ np.array([0.0, 0.0, -1.0])))
    power = image * np.pi * (distance / FOCAL) ** 2  # E dA with E = J cos / d^2
    label = np.argmin(np.hypot(w[..., 0, None] - directions[:, 0], w[..., 1, None] - directions[:, 1]), axis=-1)
    assert np.all(cosine > 0)
    return np.bincount(label.ravel(), weights=power.ravel(), minlength=len(directions))


def inside(directions, distance, pose=BASELINE):
    """Which dots fall well within the camera's field."""
    pose = np.asarray(pose, np.float64)
    rays = np.concatenate([directions, np.sqrt(1 - np.sum(directions**2, axis=1, keepdims=True))], axis=1)
    rotation, translation = pose[:, :3], pose[:, 3]
    # Points s w with z = distance in the camera's frame: X = R^T (s w - t).
    turned = rays @ rotation
    shift = rotation.T @ translation
    points = turned * ((distance + shift[2]) / turned[:, 2])[:, None] - shift
    x = points[:, 0] / distance * FOCAL + INTRINSICS[2]
    y = points[:, 1] / distance * FOCAL + INTRINSICS[3]
    return (x > 10) & (x < WIDTH - 11) & (y > 10) & (y < HEIGHT - 11)


def look(pattern, distance):
    depth = np.full((HEIGHT, WIDTH), distance, np.float32)
    normal = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    normal[..., 2] = -1
    return pattern.lookup(clspeckle.Geometry(depth=depth, intrinsics=INTRINSICS, normal=normal)).astype(np.float64)


@pytest.mark.parametrize("texels", [512, 2048, 4096])
def test_energy_per_dot_from_near_to_far(context, measured, texels):
    """Every dot's light within 1 % from 0.4 m to 5 m, pixels from 2 to 18 texels wide; the bilinear lookup is far
    off."""
    made, directions = dots(context, texels)
    area, bilinear = (
        made.pattern(filter="area", laser_from_geometry=BASELINE),
        made.pattern(laser_from_geometry=BASELINE),
    )
    worst = 0.0
    for distance in DISTANCES:
        seen = inside(directions, distance)
        assert seen.sum() >= 20
        light = energies(look(area, distance), directions, distance)[seen] * len(directions)
        error = np.abs(light - 1).max()
        measured(f"error of a dot's light with {texels} texels", error)
        assert error < 0.01
        plain = energies(look(bilinear, distance), directions, distance)[seen] * len(directions)
        worst = max(worst, np.abs(plain - 1).max())
    if texels > 512:
        assert worst > 0.2


def test_magnified_pattern_is_the_bilinear_one(context):
    """Texels of many pixels: the mean over a pixel's footprint is the bilinear value to the curvature over a pixel."""
    texels = np.random.default_rng(81).random((16, 16)).astype(np.float32)
    options = {"half_extent_x": 0.4, "half_extent_y": 0.4, "context": context}
    area, bilinear = (clspeckle.Pattern(texels, filter=name, **options) for name in ("area", "bilinear"))
    a, b = look(area, 1.0), look(bilinear, 1.0)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    u, v = (x - INTRINSICS[2]) / FOCAL, (y - INTRINSICS[3]) / FOCAL
    interior = (np.abs(u) < 0.37) & (np.abs(v) < 0.37)
    assert interior.sum() > 30000
    assert np.abs(a - b)[interior].max() < 0.05 * b.max()
    assert np.abs(a - b)[interior].mean() < 2e-3 * b.mean()
    far = (np.abs(u) > 0.43) | (np.abs(v) > 0.43)
    assert not np.any(a[far])


@pytest.mark.parametrize("taps", [1, 2, 4])
def test_mean_of_an_even_pattern(context, taps):
    """An even pattern stays even, whatever the footprint, turned or not."""
    turned = np.hstack([Rotation.from_rotvec([0, 0, 0.6]).as_matrix(), np.zeros((3, 1))])
    pattern = clspeckle.Pattern(
        np.full((300, 300), 2.0, np.float32),
        filter="area",
        filter_taps=taps,
        half_extent_x=1.5,
        half_extent_y=1.5,
        laser_from_geometry=turned,
        context=context,
    )
    depth = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    image = pattern.lookup(clspeckle.Geometry(depth=depth, intrinsics=INTRINSICS, depth_kind="along_ray"))
    assert np.allclose(image, 2.0 / 4.0 / np.pi, rtol=1e-4)


def test_turned_camera(context, measured):
    """The camera rolled by 0.3 rad against the pattern, dots about as wide as a pixel: two taps keep each dot within 1
    %."""
    made, directions = dots(context, sigma=1.6e-3, count=5)
    pose = np.hstack([Rotation.from_rotvec([0, 0, 0.3]).as_matrix(), [[0.0], [0.0], [0.0]]])
    seen = inside(directions, 1.0, pose)
    assert seen.sum() >= 10
    pattern = made.pattern(filter="area", filter_taps=2, laser_from_geometry=pose)
    light = energies(look(pattern, 1.0), directions, 1.0, pose)[seen] * len(directions)
    measured("error of a dot's light", np.abs(light - 1).max())
    assert np.abs(light - 1).max() < 0.01


def test_edges_of_objects_do_not_smear(context):
    """A near strip before a far wall: its border pixels have the footprint of the strip, not of the jump."""
    made, _ = dots(context)
    pattern = made.pattern(filter="area", laser_from_geometry=BASELINE)
    depth = np.full((HEIGHT, WIDTH), 3.0, np.float32)
    depth[:, 100:200] = 0.6
    scene = pattern.lookup(clspeckle.Geometry(depth=depth, intrinsics=INTRINSICS))
    near = pattern.lookup(clspeckle.Geometry(depth=np.full_like(depth, 0.6), intrinsics=INTRINSICS))
    # Footprints from the nearer neighbour differ from those of the whole strip only by which side was nearer.
    assert np.allclose(scene[1:-1, 101:199], near[1:-1, 101:199], rtol=1e-5, atol=1e-6 * near.max())
    edge = scene[1:-1, [100, 199]], near[1:-1, [100, 199]]
    assert np.abs(edge[0] - edge[1]).max() < 0.05 * near.max()


@pytest.mark.parametrize(
    ("options", "message"),
    [({"filter": "cubic"}, "filter"), ({"filter_taps": 0}, "filter_taps"), ({"filter_taps": 5}, "1 to 4")],
)
def test_bad_filters_are_refused(context, options, message):
    with pytest.raises((clspeckle.ClspeckleError, TypeError), match=message):
        clspeckle.Pattern(np.ones((4, 4), np.float32), context=context, **options)
