"""The office desk scene: meshes, materials, textures and the mug's motion, all generated here.

World frame: x right along the wall, y towards the wall, z up, metres; the desk top is the plane z = 0 and the wall the
plane y = WALL_Y. Every part has its mesh in a local frame and a pose that takes it to the world.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from skimage.measure import marching_cubes

Array = np.ndarray
Texture = Callable[[Array], Array]

FLOOR_Z = -0.74
WALL_Y = 0.86
SEAT_Z = -0.28
FRAME_RATE_HZ = 30.0


@dataclass(frozen=True)
class Material:
    """One surface class; `albedo` is the diffuse reflectance at 940 nm, `living` means it never keeps its phase."""

    id: int
    name: str
    albedo: float
    living: bool = False


# Ballpark values, see README.md for the sources. Dyes are nearly transparent at 940 nm, so dark cloth, hair and
# printed covers are much brighter than to the eye; carbon black (black plastic, toner, rubber) stays dark.
MATERIALS: tuple[Material, ...] = (
    Material(1, "wall_paint", 0.80),
    Material(2, "desk_wood", 0.58),
    Material(3, "carpet", 0.34),
    Material(4, "skin", 0.56, living=True),
    Material(5, "cotton_shirt", 0.66, living=True),
    Material(6, "dyed_trousers", 0.48, living=True),
    Material(7, "hair", 0.26, living=True),
    Material(8, "chair_fabric", 0.40),
    Material(9, "black_plastic", 0.06),
    Material(10, "screen", 0.09),
    Material(11, "key_plastic", 0.62),
    Material(12, "gray_plastic", 0.30),
    Material(13, "mug_ceramic", 0.78),
    Material(14, "coffee", 0.14, living=True),
    Material(15, "paper", 0.82),
    Material(16, "book_cover", 0.62),
    Material(17, "coated_steel", 0.45),
    Material(18, "leaf", 0.48),
    Material(19, "terracotta", 0.42),
    Material(20, "white_lacquer", 0.74),
)
MATERIAL_BY_NAME = {material.name: material for material in MATERIALS}


@dataclass
class Mesh:
    vertices: Array
    faces: Array
    normals: Array


@dataclass
class Part:
    """A mesh with one material. `texture` scales the albedo as a function of local positions [n, 3]."""

    name: str
    material: str
    mesh: Mesh
    pose: Array = field(default_factory=lambda: np.eye(4))
    texture: Texture | None = None


# ---------------------------------------------------------------------------------------------------------------------
# Poses


def translation(x: float, y: float, z: float) -> Array:
    pose = np.eye(4)
    pose[:3, 3] = (x, y, z)
    return pose


def rotation(axis: str, degrees: float) -> Array:
    angle = np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    pose = np.eye(4)
    pose[i, i] = pose[j, j] = c
    pose[i, j], pose[j, i] = -s, s
    return pose


def apply(pose: Array, points: Array) -> Array:
    return points @ pose[:3, :3].T + pose[:3, 3]


def placed(mesh: Mesh, pose: Array) -> Mesh:
    return Mesh(apply(pose, mesh.vertices), mesh.faces, mesh.normals @ pose[:3, :3].T)


# ---------------------------------------------------------------------------------------------------------------------
# Meshes


def normalized(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)


def merged(meshes: list[Mesh]) -> Mesh:
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]),
        np.concatenate([mesh.normals for mesh in meshes]),
    )


def grid_faces(rows: int, columns: int) -> Array:
    """Two triangles per cell of a rows x columns vertex grid."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def with_smooth_normals(vertices: Array, faces: Array) -> Mesh:
    """Area-weighted vertex normals, for meshes deformed after they were made."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    face_normals = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for i in range(3):
        np.add.at(normals, faces[:, i], face_normals)
    return Mesh(vertices, faces, normalized(normals))


def rounded_box(size: tuple[float, float, float], radius: float, steps: int = 4, cells: int = 1) -> Mesh:
    """A box centred on the origin whose edges are rounded; `cells` subdivides the flat parts for later bending."""
    half = np.asarray(size) / 2.0
    inner = half - radius
    meshes = []
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        grid = []
        for k in (i, j):
            # Equal angles on the rounded edge: tan, as the points lie on the cube's face before projection.
            edge = radius * np.tan(np.linspace(0.0, np.pi / 4.0, steps + 1))
            flat = np.linspace(-inner[k], inner[k], cells + 1)
            grid.append(np.concatenate([flat[0] - edge[:0:-1], flat, flat[-1] + edge[1:]]))
        u, v = np.meshgrid(*grid, indexing="ij")
        for sign in (-1.0, 1.0):
            points = np.empty((u.size, 3))
            points[:, i], points[:, j], points[:, axis] = u.ravel(), v.ravel(), sign * half[axis]
            core = np.clip(points, -inner, inner)
            normals = normalized(points - core)
            faces = grid_faces(len(grid[0]), len(grid[1]))
            meshes.append(Mesh(core + radius * normals, faces if sign > 0 else faces[:, ::-1], normals))
    return merged(meshes)


def rectangle(width: float, height: float) -> Mesh:
    """The rectangle |x| <= width/2, |y| <= height/2 in the plane z = 0."""
    x, y = width / 2.0, height / 2.0
    vertices = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), np.tile([0.0, 0.0, 1.0], (4, 1)))


def lathe(profile: Array, segments: int = 96) -> Mesh:
    """The profile [(radius, z), ...] turned about the z axis."""
    profile = np.asarray(profile, dtype=float)
    tangent = normalized(np.gradient(profile, axis=0))
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    vertices = np.stack(
        [c * profile[:, 0], s * profile[:, 0], np.broadcast_to(profile[:, 1], c.shape[:1] + profile.shape[:1])], -1
    )
    normals = np.stack([c * tangent[:, 1], s * tangent[:, 1], np.broadcast_to(-tangent[:, 0], vertices.shape[:2])], -1)
    return Mesh(vertices.reshape(-1, 3), grid_faces(*vertices.shape[:2]), normals.reshape(-1, 3))


def arc(center: tuple[float, float], radius: float, start: float, end: float, count: int = 8) -> Array:
    angle = np.radians(np.linspace(start, end, count))
    return np.stack([center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)], -1)


def disc(radius: float, edge: float = 1e-4) -> Mesh:
    return lathe(np.array([[edge, 0.0], [radius, 0.0]])[::-1])


def cylinder(radius: float, height: float, bevel: float = 0.001, segments: int = 48) -> Mesh:
    """A closed cylinder on the plane z = 0 with bevelled rims; flat caps keep flat normals."""
    side = lathe(
        np.concatenate(
            [arc((radius - bevel, bevel), bevel, -90, 0, 5), arc((radius - bevel, height - bevel), bevel, 0, 90, 5)]
        ),
        segments,
    )
    top = disc(radius - bevel)
    return merged([side, placed(top, translation(0, 0, height)), placed(top, rotation("x", 180))])


def tube(path: Array, radius: Array | float, segments: int = 24) -> Mesh:
    """A round tube along a polyline, by parallel transport of its frame."""
    path = np.asarray(path, dtype=float)
    radius = np.broadcast_to(np.asarray(radius, dtype=float), len(path))
    tangent = normalized(np.gradient(path, axis=0))
    side = np.cross(tangent[0], np.eye(3)[np.argmin(np.abs(tangent[0]))])
    angle = np.linspace(0.0, 2.0 * np.pi, segments + 1)
    vertices, normals = [], []
    for point, direction, r in zip(path, tangent, radius, strict=True):
        side = normalized(side - direction * (side @ direction))
        ring = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(direction, side)
        vertices.append(point + r * ring)
        normals.append(ring)
    return Mesh(np.concatenate(vertices), grid_faces(len(path), segments + 1), np.concatenate(normals))


def spline(points: list[tuple[float, ...]], count: int) -> Array:
    """A Catmull-Rom curve through the points."""
    p = np.asarray(points, dtype=float)
    p = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    t = np.linspace(0.0, len(p) - 3, count)
    k = np.minimum(t.astype(int), len(p) - 4)
    f = (t - k)[:, None]
    a, b, c, d = p[k], p[k + 1], p[k + 2], p[k + 3]
    return b + 0.5 * f * (c - a + f * (2 * a - 5 * b + 4 * c - d + f * (3 * (b - c) + d - a)))


# ---------------------------------------------------------------------------------------------------------------------
# Signed distance fields, for the seated figure


def smooth_union(a: Array, b: Array, k: float) -> Array:
    h = np.clip(0.5 + 0.5 * (b - a) / k, 0.0, 1.0)
    return b + (a - b) * h - k * h * (1.0 - h)


def smooth_difference(a: Array, b: Array, k: float) -> Array:
    return -smooth_union(-a, b, k)


def ellipsoid(p: Array, center: tuple[float, ...], radii: tuple[float, ...]) -> Array:
    q = p - center
    k0 = np.linalg.norm(q / radii, axis=-1)
    k1 = np.linalg.norm(q / np.square(radii), axis=-1)
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def round_cone(p: Array, a: Array, b: Array, radius_a: float, radius_b: float) -> Array:
    """A capsule whose radius goes linearly from a to b."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(p - (a + t[..., None] * (b - a)), axis=-1) - (radius_a + t * (radius_b - radius_a))


def sdf_mesh(sdf: Callable[[Array], Array], low: Array, high: Array, voxel: float) -> Mesh:
    """Triangulate sdf = 0 by marching cubes; the vertices are pulled onto the surface, normals are its gradient."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    axes = [np.arange(a, b + voxel, voxel) for a, b in zip(low, high, strict=True)]
    volume = np.stack([sdf(np.stack(np.meshgrid(x, axes[1], axes[2], indexing="ij"), -1)[0]) for x in axes[0][:, None]])
    vertices, faces, _, _ = marching_cubes(volume, 0.0, spacing=(voxel,) * 3)
    vertices = vertices.astype(float) + low
    for _ in range(2):
        step = voxel / 4.0
        offsets = step * np.eye(3)
        gradient = np.stack([sdf(vertices + o) - sdf(vertices - o) for o in offsets], -1) / (2.0 * step)
        length = np.maximum(np.linalg.norm(gradient, axis=-1, keepdims=True), 0.2)
        vertices = vertices - np.clip(sdf(vertices)[:, None] / length, -voxel, voxel) * gradient / length
    return Mesh(vertices, faces[:, ::-1], normalized(gradient))


# ---------------------------------------------------------------------------------------------------------------------
# Textures: factors on the material's albedo, functions of local positions


def hash01(*keys: Array) -> Array:
    """A fixed pseudo-random number in [0, 1) per integer tuple."""
    value = np.zeros(np.broadcast_shapes(*(np.shape(key) for key in keys)), dtype=np.uint64)
    for key in keys:
        value = (value ^ np.asarray(key).astype(np.int64).astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        value ^= value >> np.uint64(29)
    return (value >> np.uint64(40)).astype(float) / float(1 << 24)


def wood_grain(p: Array) -> Array:
    """Veneer planks whose grain runs along the front edge (local x)."""
    x, y = p[:, 0], p[:, 1]
    plank = np.floor((y + 1.0) / 0.14)
    shift = 0.31 * plank
    bend = 0.010 * np.sin(3.1 * (x + shift)) + 0.0025 * np.sin(11.0 * (x + 3.0 * shift))
    rings = np.sin(2 * np.pi * (y + bend) / 0.031) + 0.5 * np.sin(2 * np.pi * (y + 1.7 * bend) / 0.0113)
    return 1.0 + 0.055 * rings + 0.09 * (hash01(plank) - 0.5)


def printed_page(p: Array) -> Array:
    """Toner on A4 paper, local x along the lines (|x| < 0.105), y up the page (|y| < 0.1485)."""
    x, y = p[:, 0], p[:, 1]
    line = np.floor((0.125 - y) / 0.0078)
    in_line = np.mod(0.125 - y, 0.0078) < 0.0034
    word = np.floor((x + 0.2) / 0.0105)
    gap = np.mod(x + 0.2, 0.0105) < 0.0025 + 0.003 * hash01(line, word)
    line_end = 0.085 - 0.11 * (hash01(line, np.full_like(line, 99)) ** 6)
    text = in_line & ~gap & (np.abs(x) < 0.085) & (x < line_end) & (line >= 3) & (line < 30)
    heading = (np.abs(y - 0.112) < 0.005) & (x > -0.085) & (x < 0.03)
    chart = (x > -0.08) & (x < 0.01) & (y > -0.06) & (y < 0.0)
    bar = np.floor((x + 0.08) / 0.0129)
    bars = chart & (np.mod(x + 0.08, 0.0129) < 0.009) & (y < -0.06 + 0.055 * (0.25 + 0.75 * hash01(bar, bar + 7)))
    ink = np.where(chart, bars, text | heading)
    return np.where(ink, 0.12, 1.0)


def striped(axis: int, period: float, depth: float) -> Texture:
    return lambda p: 1.0 - depth * (np.mod(p[:, axis], period) < 0.4 * period)


def constant(factor: float) -> Texture:
    return lambda p: np.full(len(p), factor)


def book_cover(factor: float, width: float, length: float) -> Texture:
    """A title panel on the boards and bands with a title on the spine (local -x); local y runs along the spine."""

    def texture(p: Array) -> Array:
        x, y = p[:, 0] / width, p[:, 1] / length
        on_spine = x < -0.49
        bands = (np.abs(np.abs(y) - 0.36) < 0.014) | (np.abs(y) < 0.16)
        panel = (np.abs(x) < 0.28) & (np.abs(y - 0.2) < 0.12)
        return np.where(np.where(on_spine, bands, panel), 0.5 * factor, factor)

    return texture


def mug_print(p: Array) -> Array:
    angle, z = np.arctan2(p[:, 1], p[:, 0]), p[:, 2]
    radius = np.hypot(p[:, 0], p[:, 1])
    outside = (radius > 0.0385) & (radius < 0.0425)
    wave = np.abs(z - 0.048 - 0.009 * np.sin(5.0 * angle)) < 0.006
    rings = (np.abs(z - 0.018) < 0.0025) | (np.abs(z - 0.078) < 0.0025)
    return np.where(outside & (wave | rings), 0.4, 1.0)


def poster(p: Array) -> Array:
    """A framed landscape print: sky, sun, two ridges; local x and y in the picture's plane."""
    x, y = p[:, 0], p[:, 1]
    sky = 0.95 - 0.5 * (y + 0.15)
    sun = np.hypot(x - 0.07, y - 0.06) < 0.03
    far = y < -0.01 + 0.03 * np.sin(17.0 * x) + 0.02 * np.sin(41.0 * x + 1.0)
    near = y < -0.06 + 0.035 * np.sin(11.0 * x + 2.0)
    return np.where(near, 0.3, np.where(far, 0.55, np.where(sun, 1.1, sky)))


# ---------------------------------------------------------------------------------------------------------------------
# The seated figure. Local frame: x forward, y to its left, z up from the seat.

FIGURE_YAW = -10.0
FIGURE_POSE = translation(-0.47, 0.12, SEAT_Z) @ rotation("z", FIGURE_YAW)
HEAD_POSE = translation(0.075, 0.0, 0.765) @ rotation("z", -9.0) @ rotation("y", 5.0)
KEYBOARD_POSE = translation(0.02, 0.07, 0.0) @ rotation("z", FIGURE_YAW)
MOUSE_POSE = translation(0.035, -0.262, 0.004) @ rotation("z", FIGURE_YAW - 2.0)


def figure_point(x: float, y: float, z: float) -> Array:
    """World to figure."""
    return apply(np.linalg.inv(FIGURE_POSE), np.array([[x, y, z]]))[0]


# Wrist positions (world): the right hand rests on the mouse, the left one on the keys.
RIGHT_WRIST = figure_point(-0.07, -0.245, 0.036)
LEFT_WRIST = figure_point(-0.13, 0.155, 0.052)


def elbow(shoulder: Array, wrist: Array, upper: float, lower: float, pole: Array) -> Array:
    """Two-link inverse kinematics; the elbow bends towards `pole`."""
    reach = wrist - shoulder
    length = min(np.linalg.norm(reach), 0.999 * (upper + lower))
    along = reach / np.linalg.norm(reach)
    x = (upper**2 - lower**2 + length**2) / (2.0 * length)
    side = normalized(pole - along * (pole @ along))
    return shoulder + along * x + side * np.sqrt(max(upper**2 - x**2, 0.0))


def head_sdf(world: Array) -> Array:
    """Head and neck; local x forward, z up, origin between the ears."""
    p = apply(np.linalg.inv(HEAD_POSE), world)
    m = p * [1.0, 0.0, 1.0] + np.abs(p) * [0.0, 1.0, 0.0]
    d = ellipsoid(p, (-0.012, 0, 0.035), (0.096, 0.075, 0.083))
    d = smooth_union(d, ellipsoid(p, (0.030, 0, -0.035), (0.056, 0.056, 0.083)), 0.03)
    d = smooth_union(d, round_cone(m, (-0.012, 0.054, -0.055), (0.055, 0.016, -0.103), 0.014, 0.014), 0.03)
    d = smooth_union(d, ellipsoid(p, (0.070, 0, -0.104), (0.016, 0.02, 0.015)), 0.018)
    d = smooth_union(d, ellipsoid(m, (0.058, 0.042, -0.026), (0.02, 0.018, 0.016)), 0.02)
    d = smooth_union(d, round_cone(m, (0.070, 0.042, 0.017), (0.084, 0.006, 0.017), 0.008, 0.009), 0.016)
    d = smooth_difference(d, ellipsoid(m, (0.096, 0.032, -0.001), (0.017, 0.016, 0.011)), 0.014)
    d = smooth_union(d, ellipsoid(m, (0.071, 0.031, -0.001), (0.013, 0.0135, 0.0115)), 0.003)
    d = smooth_union(d, ellipsoid(p, (0.066, 0, -0.062), (0.026, 0.032, 0.034)), 0.02)
    d = smooth_union(d, round_cone(p, (0.084, 0, 0.008), (0.107, 0, -0.032), 0.0085, 0.0105), 0.016)
    d = smooth_union(d, ellipsoid(m, (0.097, 0.0115, -0.036), (0.010, 0.0075, 0.0075)), 0.010)
    d = smooth_union(d, round_cone(m, (0.079, 0.021, -0.070), (0.0905, 0.0, -0.066), 0.003, 0.0052), 0.006)
    d = smooth_union(d, round_cone(m, (0.079, 0.018, -0.073), (0.0890, 0.0, -0.077), 0.003, 0.0056), 0.006)
    d = smooth_union(d, ellipsoid(m, (-0.010, 0.077, -0.006), (0.019, 0.009, 0.032)), 0.006)
    d = smooth_difference(d, ellipsoid(m, (-0.005, 0.088, -0.004), (0.010, 0.008, 0.018)), 0.005)
    return smooth_union(d, round_cone(p, (-0.028, 0, -0.06), (-0.055, 0, -0.22), 0.052, 0.058), 0.03)


def hair_sdf(world: Array) -> Array:
    p = apply(np.linalg.inv(HEAD_POSE), world)
    d = ellipsoid(p, (-0.018, 0, 0.043), (0.104, 0.086, 0.092))
    d = smooth_union(d, ellipsoid(p, (-0.07, 0, -0.03), (0.045, 0.066, 0.06)), 0.03)
    d = smooth_union(d, ellipsoid(p, (0.055, 0.01, 0.10), (0.05, 0.06, 0.027)), 0.02)
    strands = np.sin(85.0 * np.arctan2(p[..., 1] - 0.03, p[..., 2] + 0.02) + 60.0 * p[..., 0])
    d = d - 0.0012 * strands * np.clip(p[..., 2] * 20.0 + 1.0, 0.0, 1.0)
    d = smooth_difference(d, ellipsoid(p, (0.115, 0, -0.035), (0.078, 0.12, 0.108)), 0.012)
    return smooth_difference(d, ellipsoid(p, (0.02, 0, -0.085), (0.066, 0.12, 0.07)), 0.012)


def hand_sdf(p: Array, side: float, curl: float) -> Array:
    """A hand; x to the fingers, z up, origin at the wrist. side: -1 right, +1 left; curl bends the fingers down."""
    p = p * [1.0, -side, 1.0]
    d = round_cone(p, (-0.10, 0, 0.0), (0.0, 0, 0.0), 0.031, 0.025)
    d = smooth_union(d, ellipsoid(p, (0.05, 0, 0.001), (0.055, 0.041, 0.0165)), 0.02)
    for y, base, first, second, radius in (
        (0.029, 0.088, 0.043, 0.036, 0.0086),
        (0.010, 0.094, 0.047, 0.040, 0.0088),
        (-0.010, 0.090, 0.044, 0.037, 0.0084),
        (-0.028, 0.080, 0.035, 0.030, 0.0074),
    ):
        spread = 0.12 * y / 0.03
        a = np.array([base, y, 0.004])
        b = a + first * np.array([np.cos(0.3 * curl), spread, -np.sin(0.3 * curl)])
        c = b + second * np.array([np.cos(1.1 * curl), spread, -np.sin(1.1 * curl)])
        d = smooth_union(d, round_cone(p, a, b, radius + 0.0012, radius), 0.008)
        d = smooth_union(d, round_cone(p, b, c, radius, radius - 0.0014), 0.003)
    thumb = np.array([[0.020, 0.026, -0.004], [0.058, 0.055, -0.012], [0.088, 0.052, -0.018]])
    d = smooth_union(d, round_cone(p, thumb[0], thumb[1], 0.016, 0.0105), 0.015)
    return smooth_union(d, round_cone(p, thumb[1], thumb[2], 0.0105, 0.0085), 0.004)


def arm_joints() -> list[tuple[Array, Array, Array]]:
    """(shoulder, elbow, wrist) of the right and the left arm."""
    joints = []
    for side, wrist in ((-1.0, RIGHT_WRIST), (1.0, LEFT_WRIST)):
        shoulder = np.array([0.01, side * 0.178, 0.512])
        pole = np.array([-0.5, side * 0.75, -1.0])
        joints.append((shoulder, elbow(shoulder, wrist, 0.285, 0.262, pole), wrist))
    return joints


def shirt_sdf(p: Array) -> Array:
    d = ellipsoid(p, (0.0, 0, 0.13), (0.135, 0.172, 0.13))
    d = smooth_union(d, ellipsoid(p, (0.022, 0, 0.25), (0.122, 0.155, 0.17)), 0.05)
    d = smooth_union(d, ellipsoid(p, (0.015, 0, 0.40), (0.115, 0.170, 0.19)), 0.05)
    m = p * [1.0, 0.0, 1.0] + np.abs(p) * [0.0, 1.0, 0.0]
    d = smooth_union(d, round_cone(m, (0.01, 0.0, 0.52), (0.01, 0.155, 0.518), 0.07, 0.058), 0.05)
    d = smooth_union(d, round_cone(m, (0.0, 0.09, 0.55), (0.012, 0.03, 0.60), 0.035, 0.035), 0.04)
    folds = 0.003 * np.sin(70.0 * p[..., 2] + 18.0 * np.abs(p[..., 1]) + 25.0 * p[..., 0])
    d = d + folds * np.exp(-(((p[..., 2] - 0.17) / 0.09) ** 2))
    for shoulder, bend, wrist in arm_joints():
        forearm_end = bend + 0.93 * (wrist - bend)
        upper = round_cone(p, shoulder, bend, 0.060, 0.049)
        lower = round_cone(p, bend, forearm_end, 0.049, 0.036)
        arm = smooth_union(upper, lower, 0.025)
        # Creases run around the arm and fade away from the elbow; they are deeper inside the bend.
        reach = np.linalg.norm(p - bend, axis=-1)
        crease = np.sin(150.0 * reach + 14.0 * p[..., 1]) + 0.6 * np.sin(90.0 * reach - 30.0 * p[..., 2])
        arm = arm + 0.0022 * crease * np.exp(-((reach / 0.13) ** 2))
        cuff = round_cone(p, forearm_end - 0.16 * (wrist - bend), forearm_end, 0.0385, 0.0375)
        arm = smooth_union(arm, cuff, 0.003)
        d = smooth_union(d, arm, 0.035)
    # Collar: a torus, tilted towards the chest.
    q = apply(np.linalg.inv(translation(0.024, 0, 0.603) @ rotation("y", 22.0)), p)
    ring = np.hypot(np.hypot(q[..., 0], q[..., 1]) - 0.066, 0.55 * q[..., 2]) - 0.0095
    d = smooth_union(d, ring, 0.008)
    return smooth_difference(d, round_cone(p, (0.02, 0, 0.59), (0.03, 0, 0.70), 0.056, 0.060), 0.004)


def trousers_sdf(p: Array) -> Array:
    m = p * [1.0, 0.0, 1.0] + np.abs(p) * [0.0, 1.0, 0.0]
    d = ellipsoid(p, (0.0, 0, 0.085), (0.135, 0.178, 0.095))
    d = smooth_union(d, round_cone(m, (0.05, 0.088, 0.082), (0.43, 0.11, 0.095), 0.085, 0.064), 0.03)
    d = smooth_union(d, round_cone(m, (0.43, 0.11, 0.09), (0.45, 0.11, -0.36), 0.062, 0.05), 0.03)
    folds = np.sin(60.0 * (m[..., 0] - 0.43) + 35.0 * m[..., 2])
    return d + 0.0025 * folds * np.exp(-((np.linalg.norm(m - [0.43, 0.11, 0.06], axis=-1) / 0.13) ** 2))


def figure_parts() -> list[Part]:
    right_hand = translation(*RIGHT_WRIST) @ rotation("z", 4.0) @ rotation("y", -4.0)
    left_hand = translation(*LEFT_WRIST) @ rotation("z", -16.0) @ rotation("y", 6.0)
    lift_right, lift_left = 0.55, 0.75
    head = sdf_mesh(head_sdf, (-0.09, -0.12, 0.56), (0.215, 0.12, 0.90), 0.0022)
    hair = sdf_mesh(hair_sdf, (-0.09, -0.12, 0.66), (0.215, 0.12, 0.93), 0.0026)
    low, high = (-0.13, -0.075, -0.09), (0.20, 0.075, 0.06)
    hands = [
        placed(sdf_mesh(lambda p: hand_sdf(p, -1.0, lift_right), low, high, 0.002), right_hand),
        placed(sdf_mesh(lambda p: hand_sdf(p, 1.0, lift_left), low, high, 0.002), left_hand),
    ]
    shirt = sdf_mesh(shirt_sdf, (-0.20, -0.45, -0.03), (0.47, 0.45, 0.68), 0.005)
    trousers = sdf_mesh(trousers_sdf, (-0.17, -0.24, -0.46), (0.56, 0.24, 0.21), 0.006)
    shoe = sdf_mesh(
        lambda p: smooth_union(
            ellipsoid(p, (0.06, 0, 0.03), (0.13, 0.045, 0.045)),
            ellipsoid(p, (-0.03, 0, 0.06), (0.05, 0.04, 0.06)),
            0.03,
        ),
        (-0.12, -0.07, 0.0),
        (0.22, 0.07, 0.14),
        0.006,
    )
    sole = FLOOR_Z - SEAT_Z
    shoes = merged([placed(shoe, translation(0.45, y, sole)) for y in (-0.11, 0.11)])
    return [
        Part("head", "skin", head, FIGURE_POSE),
        Part("hair", "hair", hair, FIGURE_POSE),
        Part("hands", "skin", merged(hands), FIGURE_POSE),
        Part("shirt", "cotton_shirt", shirt, FIGURE_POSE),
        Part("trousers", "dyed_trousers", trousers, FIGURE_POSE),
        Part("shoes", "black_plastic", shoes, FIGURE_POSE),
    ]


# ---------------------------------------------------------------------------------------------------------------------
# Furniture and things


def chair_parts() -> list[Part]:
    pose = FIGURE_POSE
    seat = rounded_box((0.50, 0.49, 0.085), 0.035, 6)
    back = rounded_box((0.06, 0.46, 0.60), 0.028, 6, cells=16)
    v = back.vertices
    bent = v + np.stack([0.9 * v[:, 1] ** 2 - 0.10 * v[:, 2] - 0.25 * v[:, 2] ** 2, 0 * v[:, 0], 0 * v[:, 0]], -1)
    back = placed(with_smooth_normals(bent, back.faces), translation(-0.215, 0, 0.345))
    cushions = merged([placed(seat, translation(0.02, 0, -0.045)), back])
    frame = []
    for side in (-1.0, 1.0):
        rest = placed(rounded_box((0.25, 0.075, 0.03), 0.013), translation(-0.04, side * 0.30, 0.215))
        post = tube(
            spline([(-0.04, side * 0.30, 0.21), (-0.05, side * 0.31, 0.05), (-0.03, side * 0.2, -0.08)], 16), 0.016
        )
        frame += [rest, post]
    frame.append(placed(cylinder(0.03, 0.34), translation(0, 0, -0.42)))
    for k in range(5):
        angle = np.radians(72.0 * k + 20.0)
        end = (0.30 * np.cos(angle), 0.30 * np.sin(angle))
        frame.append(tube(spline([(0, 0, -0.36), (0.5 * end[0], 0.5 * end[1], -0.385), (*end, -0.405)], 10), 0.018))
        caster = placed(cylinder(0.028, 0.04), translation(0, 0.02, 0) @ rotation("x", 90))
        frame.append(placed(caster, translation(*end, -0.43)))
    frame.append(tube(spline([(-0.21, 0, 0.2), (-0.27, 0, 0.05), (-0.1, 0, -0.09)], 20), 0.025))
    return [
        Part("chair_cushions", "chair_fabric", cushions, pose),
        Part("chair_frame", "black_plastic", merged(frame), pose),
    ]


def desk_parts() -> list[Part]:
    low, high = np.array([-0.27, -0.50]), np.array([0.74, 0.84])
    center = (low + high) / 2.0
    top = rounded_box((high[0] - low[0], high[1] - low[1], 0.028), 0.004, 3)
    height = -0.028 - FLOOR_Z
    legs = [
        placed(rounded_box((0.06, 0.06, height), 0.004, 3), translation(x, y, FLOOR_Z + height / 2.0))
        for x in (low[0] + 0.10, high[0] - 0.05)
        for y in (low[1] + 0.08, high[1] - 0.05)
    ]
    for x in (low[0] + 0.10, high[0] - 0.05):
        span = high[1] - low[1] - 0.13
        legs.append(placed(rounded_box((0.03, span, 0.05), 0.004, 3), translation(x, center[1], -0.055)))
    return [
        Part("desk_top", "desk_wood", top, translation(center[0], center[1], -0.014), wood_grain),
        Part("desk_legs", "coated_steel", merged(legs)),
    ]


def monitor_parts() -> list[Part]:
    """Local: x out of the screen, y to the viewer's right as seen from the front, z up from the desk."""
    pose = translation(0.47, 0.29, 0.0) @ rotation("z", 180.0 + 35.0)
    width, height, lift = 0.545, 0.325, 0.105
    middle = lift + height / 2.0
    bezel = placed(rounded_box((0.022, width, height), 0.006), translation(-0.011, 0, middle))
    hump = placed(rounded_box((0.035, 0.30, 0.20), 0.015), translation(-0.035, 0, middle - 0.01))
    screen = rounded_box((0.002, width - 0.022, height - 0.034), 0.0009, 3)
    neck = rounded_box((0.022, 0.06, 0.25), 0.008)
    foot = rounded_box((0.19, 0.26, 0.012), 0.005)
    stand = merged([placed(neck, translation(-0.062, 0, 0.13)), placed(foot, translation(-0.035, 0, 0.006))])
    return [
        Part("monitor_case", "black_plastic", merged([bezel, hump]), pose),
        Part("monitor_screen", "screen", screen, pose @ translation(0.0005, 0, middle + 0.006)),
        Part("monitor_stand", "gray_plastic", stand, pose),
    ]


def keyboard_parts() -> list[Part]:
    """Local: x away from the typist, y to the typist's left, z up; a full-size ISO layout on a 19 mm pitch."""
    pose = KEYBOARD_POSE @ translation(0, 0, 0.014) @ rotation("y", -3.0)
    pitch = 0.019
    case = placed(rounded_box((0.140, 0.442, 0.016), 0.005, 3), translation(0.002, 0, 0))
    main = [
        [1.0, -1.0, 1, 1, 1, 1, -0.5, 1, 1, 1, 1, -0.5, 1, 1, 1, 1],
        [1] * 13 + [2],
        [1.5] + [1] * 12 + [1.5],
        [1.75] + [1] * 11 + [2.25],
        [1.25] + [1] * 11 + [2.75],
        [1.25, 1.25, 1.25, 6.25, 1.25, 1.25, 1.25, 1.25],
    ]
    block_starts = (0.0, 15.25, 18.5)
    navigation = [[1, 1, 1], [1, 1, 1], [1, 1, 1], [], [-1, 1], [1, 1, 1]]
    numbers = [[], [1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1], [1, 1, 1, 1], [2, 1]]
    caps = []
    for start, rows in zip(block_starts, (main, navigation, numbers), strict=True):
        for row, widths in enumerate(rows):
            left = start
            depth = 2.5 - row + (0.25 if row == 0 else 0.0)
            for units in widths:
                if units > 0:
                    cap = rounded_box((pitch - 0.0028, units * pitch - 0.0028, 0.009), 0.0018, 2)
                    y = (11.25 - (left + units / 2.0)) * pitch
                    caps.append(placed(cap, translation(depth * pitch, y, 0.0095)))
                left += abs(units)
    return [
        Part("keyboard_case", "gray_plastic", case, pose),
        Part("keyboard_keys", "key_plastic", merged(caps), pose),
    ]


def mouse_parts() -> list[Part]:
    def sdf(p: Array) -> Array:
        d = ellipsoid(p, (0.0, 0, 0.0), (0.062, 0.033, 0.037))
        d = smooth_difference(d, round_cone(p, (0.03, 0, 0.036), (0.08, 0, 0.012), 0.0012, 0.0012), 0.002)
        return np.maximum(d, -p[..., 2])

    body = sdf_mesh(sdf, (-0.07, -0.04, -0.004), (0.07, 0.04, 0.045), 0.002)
    mat = rounded_box((0.22, 0.20, 0.004), 0.0015, 2)
    return [
        Part("mouse", "black_plastic", body, MOUSE_POSE),
        Part("mouse_mat", "gray_plastic", mat, MOUSE_POSE @ translation(-0.01, 0.0, -0.0021)),
    ]


def book(size: tuple[float, float, float], factor: float, name: str, pose: Array) -> list[Part]:
    """A hardcover lying flat on z = 0: size (width, spine length, thickness), spine at local -x."""
    width, length, thickness = size
    board = 0.003
    covers = [
        placed(rounded_box((width, length, board), 0.001, 2), translation(0, 0, z))
        for z in (board / 2.0, thickness - board / 2.0)
    ]
    spine = placed(rounded_box((board, length, thickness), 0.0012, 2), translation(-width / 2.0, 0, thickness / 2.0))
    pages = rounded_box((width - 0.008, length - 0.008, thickness - 2 * board), 0.0005, 1)
    return [
        Part(f"{name}_cover", "book_cover", merged([*covers, spine]), pose, book_cover(factor, width, length)),
        Part(f"{name}_pages", "paper", pages, pose @ translation(-0.001, 0, thickness / 2.0), striped(2, 0.004, 0.12)),
    ]


def book_parts() -> list[Part]:
    parts: list[Part] = []
    z = 0.0
    for i, (size, factor, yaw) in enumerate(
        [((0.19, 0.26, 0.034), 0.8, 98.0), ((0.17, 0.24, 0.026), 0.35, 84.0), ((0.15, 0.22, 0.040), 1.15, 105.0)]
    ):
        parts += book(size, factor, f"stacked_book_{i}", translation(0.06, 0.62, z) @ rotation("z", yaw))
        z += size[2]
    return parts


def shelf_parts() -> list[Part]:
    """A low bookcase beside the desk with a row of binders and books on it."""
    x0, x1, y0, top = 0.80, 1.55, 0.54, 0.16
    height = top - FLOOR_Z
    panel = 0.022
    boards = [
        placed(rounded_box((x1 - x0, WALL_Y - y0, panel), 0.002, 2), translation((x0 + x1) / 2, (WALL_Y + y0) / 2, z))
        for z in (top - panel / 2, top - 0.34, top - 0.68)
    ]
    for x in (x0 + panel / 2, x1 - panel / 2):
        side = rounded_box((panel, WALL_Y - y0, height), 0.002, 2)
        boards.append(placed(side, translation(x, (WALL_Y + y0) / 2, FLOOR_Z + height / 2)))
    parts = [Part("bookcase", "white_lacquer", merged(boards))]
    # Upright volumes: their spines face the room (-y).
    for level, x, end in ((top, x0 + 0.03, x1), (top - 0.34 + panel / 2, x0 + 0.035, x1 - 0.2)):
        index = 0
        while True:
            r = hash01(np.array([index, index, index]), np.array([1, 2, 3]) + int(level > 0))
            thickness, tall, factor = 0.028 + 0.035 * r[0], 0.21 + 0.085 * r[1], 0.25 + 0.95 * r[2]
            if x + thickness > end or index > 9:
                break
            upright = translation(x + thickness, y0 + 0.13, level + tall / 2) @ rotation("z", 90) @ rotation("x", 90)
            parts += book((0.19, tall, thickness), float(factor), f"volume_{int(level > 0)}_{index}", upright)
            x += thickness + 0.003
            index += 1
    return parts


def paper_parts() -> list[Part]:
    sheets = [
        ("printed_page", translation(0.33, -0.30, 0.0012) @ rotation("z", -78.0)),
        ("page_below", translation(0.345, -0.285, 0.0004) @ rotation("z", -84.0)),
    ]
    page = rounded_box((0.21, 0.297, 0.0008), 0.0003, 1)
    parts = [Part(name, "paper", page, pose, printed_page) for name, pose in sheets]
    barrel = merged(
        [cylinder(0.0045, 0.125, 0.0008), placed(lathe(np.array([[0.0008, 0.139], [0.0042, 0.125]])), np.eye(4))]
    )
    pen = translation(0.36, -0.36, 0.0062) @ rotation("z", 25.0) @ rotation("y", 90.0)
    parts.append(Part("pen", "black_plastic", barrel, pen))
    return parts


def lamp_parts() -> list[Part]:
    base = cylinder(0.085, 0.018, 0.006)
    joint, head = (0.02, -0.02, 0.36), (0.20, -0.10, 0.50)
    arm = tube(spline([(0, 0, 0.015), (-0.045, 0.0, 0.19), joint], 20), 0.008)
    reach = tube(np.linspace(joint, head, 8), 0.008)
    elbow_joint = placed(
        cylinder(0.018, 0.03, 0.003), translation(joint[0], joint[1] + 0.015, joint[2]) @ rotation("x", 90)
    )
    outer = np.concatenate(
        [arc((0.02, 0.0), 0.012, 90, 20, 6), np.array([[0.045, -0.035], [0.068, -0.085], [0.075, -0.115]])]
    )
    shade = lathe(np.concatenate([outer, (outer - [0.002, 0.001])[::-1]]))
    tilt = translation(head[0] + 0.01, head[1], head[2] + 0.012) @ rotation("y", -12.0)
    pose = translation(0.28, 0.70, 0.0)
    return [
        Part("lamp_stand", "coated_steel", merged([base, arm, reach, elbow_joint]), pose),
        Part("lamp_shade", "white_lacquer", placed(shade, tilt), pose),
    ]


def plant_parts() -> list[Part]:
    pose = translation(0.64, -0.12, 0.0)
    outer = np.array([[0.001, 0.0], [0.038, 0.0], [0.040, 0.003], [0.052, 0.085], [0.056, 0.087], [0.057, 0.105]])
    inner = np.array([[0.052, 0.105], [0.049, 0.088], [0.001, 0.087]])
    leaves = []
    for k in range(13):
        r = hash01(np.full(3, k), np.arange(3))
        azimuth, rise, length = 137.5 * k + 20.0 * r[0], 38.0 + 40.0 * r[1], 0.11 + 0.06 * r[2]
        u = np.linspace(0.0, 1.0, 14)[:, None]
        v = np.linspace(-1.0, 1.0, 7)[None, :]
        width = 0.023 * np.sin(np.pi * u**0.8) ** 0.8 + 0.0012
        bend = np.radians(rise) - 1.1 * u
        x, z = length * np.cumsum(np.cos(bend), 0) / 14.0, length * np.cumsum(np.sin(bend), 0) / 14.0
        points = np.stack([x + 0 * v, width * v, z + 0.25 * width * np.abs(v)], -1).reshape(-1, 3)
        leaf = with_smooth_normals(points, grid_faces(14, 7))
        leaves.append(placed(leaf, translation(0, 0, 0.085) @ rotation("z", azimuth)))
    return [
        Part("plant_pot", "terracotta", lathe(np.concatenate([outer, inner])), pose),
        Part("plant_leaves", "leaf", merged(leaves), pose),
    ]


def room_parts() -> list[Part]:
    wall = Part("wall", "wall_paint", rectangle(8.0, 6.0), translation(0, WALL_Y, 0) @ rotation("x", 90))
    floor = Part("floor", "carpet", rectangle(8.0, 8.0), translation(0, 0, FLOOR_Z))
    base = placed(rounded_box((8.0, 0.014, 0.08), 0.003, 2), translation(0, WALL_Y - 0.007, FLOOR_Z + 0.04))
    frame = []
    width, height = 0.44, 0.32
    for x, z, size in (
        (0, height / 2, (width + 0.03, 0.02, 0.03)),
        (0, -height / 2, (width + 0.03, 0.02, 0.03)),
        (width / 2, 0, (0.03, 0.02, height)),
        (-width / 2, 0, (0.03, 0.02, height)),
    ):
        frame.append(placed(rounded_box(size, 0.003, 2), translation(x, 0, z)))
    hung = translation(0.02, WALL_Y - 0.01, 0.58)
    print_pose = hung @ rotation("x", 90)
    return [
        wall,
        floor,
        Part("skirting_board", "white_lacquer", base),
        Part("picture_frame", "gray_plastic", merged(frame), hung),
        Part("picture", "paper", rectangle(width - 0.02, height - 0.02), print_pose, poster),
    ]


def static_parts() -> list[Part]:
    """Everything that stays where it is."""
    return [
        *room_parts(),
        *desk_parts(),
        *monitor_parts(),
        *keyboard_parts(),
        *mouse_parts(),
        *paper_parts(),
        *book_parts(),
        *shelf_parts(),
        *lamp_parts(),
        *plant_parts(),
        *chair_parts(),
        *figure_parts(),
    ]


def mug_pose(frame: int) -> Array:
    """Where the mug is: it stands on the desk in frame 0, then rises, drifts towards the figure and tilts a little.

    Per frame it moves 5 mm sideways, 3 mm towards the camera and 2.5 (2 f - 1) mm up until it rises 9 mm per frame.
    """
    f = float(frame)
    rise = sum(min(0.0025 * (2 * k - 1), 0.009) for k in range(1, frame + 1))
    start = translation(0.20, -0.13, 0.0)
    return translation(-0.005 * f, -0.003 * f, rise) @ start @ rotation("z", -50.0 + 1.5 * f) @ rotation("y", 0.6 * f)


def mug_parts() -> list[Part]:
    """The mug and the coffee in it, in the mug's frame (foot at z = 0, handle at +x); `pose` is left to mug_pose."""
    outer, wall, height = 0.041, 0.0035, 0.096
    inner = outer - wall
    profile = np.concatenate(
        [
            np.array([[0.0005, 0.002], [0.028, 0.002], [0.030, 0.0]]),
            arc((outer - 0.006, 0.006), 0.006, -80, 0),
            np.array([[outer, 0.03], [outer, 0.06]]),
            arc((outer - wall / 2, height - wall / 2), wall / 2, 0, 180, 12),
            np.array([[inner, 0.06], [inner, 0.03]]),
            arc((inner - 0.006, 0.011), 0.006, 0, -90),
            np.array([[0.0005, 0.005]]),
        ]
    )
    handle = tube(
        spline(
            [
                (0.038, 0, 0.080),
                (0.055, 0, 0.081),
                (0.069, 0, 0.066),
                (0.069, 0, 0.042),
                (0.055, 0, 0.024),
                (0.038, 0, 0.022),
            ],
            40,
        ),
        0.0058,
    )
    coffee = placed(disc(inner + 0.0002), translation(0, 0, 0.080))
    return [
        Part("mug", "mug_ceramic", merged([lathe(profile), handle]), texture=mug_print),
        Part("coffee", "coffee", coffee),
    ]
