"""Depth from dots (depth.h): scenes rendered without the library, centres by SciPy, identification by trying every
pair, triangulation.

Frames: camera at the origin looking along +z, x to the right, y down; laser at X_L = R X_C + t."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit
from scipy.spatial import cKDTree

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Rig:
    """Camera and laser."""

    shape: tuple[int, int]
    fx: float
    fy: float
    cx: float
    cy: float
    laser_from_camera: Array
    """(3, 4)."""

    @property
    def intrinsics(self) -> tuple[float, float, float, float]:
        return self.fx, self.fy, self.cx, self.cy

    @property
    def laser(self) -> Array:
        """The laser's place in the camera's frame."""
        return -self.laser_from_camera[:, :3].T @ self.laser_from_camera[:, 3]

    def rays(self, directions: Array) -> Array:
        """Directions of the laser's tangent plane, in the camera's frame."""
        d = np.concatenate([directions, np.ones((len(directions), 1))], axis=1)
        return d @ self.laser_from_camera[:, :3]

    def project(self, points: Array) -> Array:
        return np.stack(
            [self.fx * points[..., 0] / points[..., 2] + self.cx, self.fy * points[..., 1] / points[..., 2] + self.cy],
            axis=-1,
        )


def rotation(axis: Sequence[float], angle_rad: float) -> Array:
    """Rodrigues's formula."""
    a = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    k = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle_rad) * k + (1 - np.cos(angle_rad)) * k @ k


def rig(
    shape: tuple[int, int] = (384, 512), focal_px: float = 450.0, baseline_m: float = 0.06, turn_rad: float = 0.01
) -> Rig:
    """A laser beside the camera, a little turned, higher and farther back."""
    turned = rotation((0.3, 1.0, 0.2), turn_rad)
    place = np.array([baseline_m, 0.1 * baseline_m, -0.05 * baseline_m])
    pose = np.concatenate([turned, (-turned @ place)[:, None]], axis=1)
    return Rig(shape, focal_px, 1.01 * focal_px, (shape[1] - 1) / 2 + 3.2, (shape[0] - 1) / 2 - 2.7, pose)


def semi_random_directions(half_extent: tuple[float, float], separation: float, seed: int) -> Array:
    """Darts thrown on a rectangle; those too near to an earlier one do not count. (n, 2)."""
    rng = np.random.default_rng(seed)
    area = 4 * half_extent[0] * half_extent[1]
    darts = rng.uniform(-1, 1, (int(12 * area / separation**2), 2)) * half_extent
    taken: dict[tuple[int, int], list[tuple[float, float]]] = {}
    kept = []
    for x, y in darts:
        u, v = int(x // separation), int(y // separation)
        near = (p for i in (-1, 0, 1) for j in (-1, 0, 1) for p in taken.get((u + i, v + j), ()))
        if all((x - px) ** 2 + (y - py) ** 2 >= separation**2 for px, py in near):
            taken.setdefault((u, v), []).append((x, y))
            kept.append((x, y))
    return np.array(kept)


def lattice_directions(half_extent: tuple[float, float], separation: float) -> Array:
    """A square lattice along the axes."""
    x = np.arange(-half_extent[0], half_extent[0], separation)
    y = np.arange(-half_extent[1], half_extent[1], separation)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


# Surfaces: hit(origin, rays) gives the distance along each ray (inf for none); normal(points) the unit normals.


@dataclasses.dataclass(frozen=True)
class Plane:
    """Points with n . X = distance, where x lies in [low, high)."""

    n: tuple[float, float, float]
    distance: float
    low: float = -np.inf
    high: float = np.inf

    def hit(self, origin: Array, rays: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            s = (self.distance - origin @ np.array(self.n)) / (rays @ np.array(self.n))
            x = origin[0] + s * rays[..., 0]
        return np.where((s > 0) & (x >= self.low) & (x < self.high), s, np.inf)

    def normal(self, points: Array) -> Array:
        return np.broadcast_to(np.array(self.n) / np.linalg.norm(self.n), points.shape)


@dataclasses.dataclass(frozen=True)
class Sphere:
    centre: tuple[float, float, float]
    radius: float

    def hit(self, origin: Array, rays: Array) -> Array:
        to_origin = origin - np.array(self.centre)
        a, b = np.sum(rays**2, -1), rays @ to_origin
        root = b**2 - a * (to_origin @ to_origin - self.radius**2)
        with np.errstate(invalid="ignore"):
            s = (-b - np.sqrt(root)) / a
        return np.where((root > 0) & (s > 0), s, np.inf)

    def normal(self, points: Array) -> Array:
        return (points - np.array(self.centre)) / self.radius


Scene = Sequence[Plane | Sphere]


def first_hit(scene: Scene, origin: Array, rays: Array) -> tuple[Array, NDArray[np.intp]]:
    """The distance along each ray, and which surface it is."""
    hits = np.stack([surface.hit(origin, rays) for surface in scene])
    return hits.min(axis=0), hits.argmin(axis=0)


def plane(depth_m: float, slope_x: float = 0.0, slope_y: float = 0.0) -> Plane:
    """z = depth + slope_x X + slope_y Y."""
    return Plane((-slope_x, -slope_y, 1.0), depth_m)


SCENES: dict[str, Scene] = {
    "near wall": [plane(0.6)],
    "far wall": [plane(2.0)],
    "turned wall": [plane(1.0, slope_x=0.5)],
    "floor": [plane(1.2, slope_x=-0.3, slope_y=-0.8)],
    "step": [Plane((0, 0, 1), 0.9, -np.inf, 0.05), Plane((0, 0, 1), 1.1, 0.05, np.inf)],
    "sphere": [Sphere((0.05, -0.02, 1.0), 0.25), plane(1.6)],
}


@dataclasses.dataclass(frozen=True)
class Frame:
    """An ideal image, and the truth about its dots."""

    image: Array
    depth: Array
    """z of each pixel."""
    normal: Array
    lit: NDArray[np.bool_]
    centres: Array
    """(n, 2): where the middle of each dot's beam meets the scene, projected; NaN if the camera does not see that."""
    depths: Array
    """(n,)."""
    cosines: Array
    """(n,): of the angle between the surface's normal and the camera's ray."""
    visible: NDArray[np.bool_]
    """(n,): dots with nothing but their own surface, lit, within 3 sigma, apart from others and from the border."""


def render(rig: Rig, scene: Scene, directions: Array, sigma_px: float, scale: float = 1.0) -> Frame:
    """The Gaussian dots of the laser on the scene, 1/d^2 and cosine, at pixel centres: no texture, no interpolation."""
    height, width = rig.shape
    y, x = np.mgrid[:height, :width].astype(np.float64)
    rays = np.stack([(x - rig.cx) / rig.fx, (y - rig.cy) / rig.fy, np.ones(rig.shape)], axis=-1)
    depth, surface = first_hit(scene, np.zeros(3), rays)
    points = rays * depth[..., None]
    normals = np.zeros(points.shape)
    for index, part in enumerate(scene):
        normals[surface == index] = part.normal(points[surface == index])
    normals *= -np.sign(np.sum(normals * rays, -1, keepdims=True))  # towards the camera
    from_laser = points - rig.laser
    reach, _ = first_hit(scene, rig.laser, from_laser)
    lit = reach > 1 - 1e-6
    laser = points @ rig.laser_from_camera[:, :3].T + rig.laser_from_camera[:, 3]
    uv = laser[..., :2] / laser[..., 2:]
    sigma = sigma_px / rig.fx
    distances, _ = cKDTree(directions).query(uv.reshape(-1, 2), k=4)
    pattern = np.exp(-0.5 * (distances / sigma) ** 2).sum(axis=1).reshape(rig.shape)
    d2 = np.sum(laser**2, axis=-1)
    cosine = np.maximum(0, -np.sum(from_laser * normals, axis=-1) / np.sqrt(d2))
    image = scale * pattern * cosine / d2 * lit / np.pi

    beams = rig.rays(directions)
    s, struck = first_hit(scene, rig.laser, beams)
    struck_points = rig.laser + np.where(np.isfinite(s), s, 1.0)[:, None] * beams
    centres = rig.project(struck_points)
    seen, _ = first_hit(scene, np.zeros(3), struck_points)
    normals_there = np.zeros(struck_points.shape)
    for index, part in enumerate(scene):
        normals_there[struck == index] = part.normal(struck_points[struck == index])
    slant = np.abs(np.sum(normals_there * struck_points, -1)) / np.linalg.norm(struck_points, axis=-1)
    good = np.isfinite(s) & (seen > 1 - 1e-6) & (struck_points[:, 2] > 0)
    centres[~good] = np.nan
    margin = int(np.ceil(3 * sigma_px))
    inside = (centres > margin).all(axis=1) & (centres < np.array([width, height]) - 1 - margin).all(axis=1)
    nearest = np.full(len(centres), np.inf)
    nearest[good] = cKDTree(centres[good]).query(centres[good], k=2)[0][:, 1]
    visible = inside & (nearest > 3 * sigma_px)
    for j in np.flatnonzero(visible):
        u, v = np.rint(centres[j]).astype(int)
        window = np.s_[v - margin : v + margin + 1, u - margin : u + margin + 1]
        visible[j] = bool((surface[window] == struck[j]).all() and lit[window].all())
    return Frame(image, depth, normals, lit, centres, struck_points[:, 2], slant, visible)


def gaussian(xy: Array, amplitude: float, x: float, y: float, a: float, b: float, c: float, background: float) -> Array:
    dx, dy = xy[0] - x, xy[1] - y
    return amplitude * np.exp(-0.5 * (a * dx * dx + 2 * b * dx * dy + c * dy * dy)) + background


def fit_dot(image: Array, start: Sequence[float], sigma_px: float, radius: int) -> tuple[Array, Array]:
    """Least squares by scipy.optimize.curve_fit around `start` (x, y): the seven parameters and their covariance."""
    u, v = round(float(start[0])), round(float(start[1]))
    y, x = np.mgrid[v - radius : v + radius + 1, u - radius : u + radius + 1].astype(np.float64)
    data = image[v - radius : v + radius + 1, u - radius : u + radius + 1].astype(np.float64)
    precision = 1 / sigma_px**2
    first = (float(np.ptp(data)), start[0], start[1], precision, 0.0, precision, float(data.min()))
    return curve_fit(gaussian, np.stack([x.ravel(), y.ravel()]), data.ravel(), p0=first, xtol=1e-12, ftol=1e-12)[:2]


def centre_bound(
    amplitude: float, sigma_px: float, centre: Sequence[float], radius: int, variance: Array | float
) -> Array:
    """The Cramer-Rao bound of a dot's centre: the inverse of Fisher's information of all seven parameters, its part of
    (x, y). variance: of each pixel, or of all. J. Mendel's and S. Kay's textbooks: independent Gaussian noise."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1].astype(np.float64)
    dx, dy = x - centre[0], y - centre[1]
    e = np.exp(-0.5 * (dx**2 + dy**2) / sigma_px**2)
    model = amplitude * e
    derivatives = np.stack(
        [
            e,
            model * dx / sigma_px**2,
            model * dy / sigma_px**2,
            -model * dx**2 / 2,
            -model * dx * dy,
            -model * dy**2 / 2,
            0 * e + 1,
        ]
    ).reshape(7, -1)
    weights = np.broadcast_to(1 / np.asarray(variance, np.float64), x.shape).ravel()
    return np.linalg.inv((derivatives * weights) @ derivatives.T)[1:3, 1:3]


def triangulate(rig: Rig, direction: Array, centre: Array) -> Array:
    """The middle of where the two rays come nearest to each other."""
    camera_ray = np.array([(centre[0] - rig.cx) / rig.fx, (centre[1] - rig.cy) / rig.fy, 1.0])
    laser_ray = rig.rays(direction[None])[0]
    normal = np.stack([camera_ray, -laser_ray], axis=1)
    (s, t), *_ = np.linalg.lstsq(normal, rig.laser, rcond=None)
    return (s * camera_ray + rig.laser + t * laser_ray) / 2


def identify(
    rig: Rig, directions: Array, centres: Array, near_m: float, far_m: float, tolerance_px: float
) -> NDArray[np.intp]:
    """Every pair of a centre and a direction, and of two neighbours: a centre gets the candidate with which most of
    its twelve neighbours have a candidate of nearly the same inverse depth; -1 where there is no candidate or no
    winner."""
    beams = rig.rays(directions)
    slope = beams[:, :2] / beams[:, 2:]
    start = np.array([rig.fx, rig.fy]) * slope + np.array([rig.cx, rig.cy])
    step = np.array([rig.fx, rig.fy]) * (rig.laser[:2] - rig.laser[2] * slope)  # centre(q) = start + q step
    length = np.linalg.norm(step, axis=1)
    along = np.einsum("ijk,jk->ij", centres[:, None] - start[None], step) / length**2
    offset = centres[:, None] - start[None]
    across = (step[None, :, 0] * offset[..., 1] - step[None, :, 1] * offset[..., 0]) / length
    possible = (np.abs(across) < tolerance_px) & (along > 1 / far_m) & (along < 1 / near_m)
    candidates = [np.flatnonzero(row) for row in possible]
    distances, neighbours = cKDTree(centres).query(centres, k=13)
    identity = np.full(len(centres), -1)
    for i, own in enumerate(candidates):
        votes = []
        for j in own:
            q = along[i, j]
            count = 0
            for distance, other in zip(distances[i, 1:], neighbours[i, 1:]):
                allowed = (0.7 + min(0.3, 2.75 / near_m * length[j] / rig.fx) * distance) / length[j]
                count += bool(np.any(np.abs(along[other, candidates[other]] - q) < allowed))
            votes.append(count)
        if votes:
            order = np.sort(votes)
            if len(order) == 1 or order[-1] > order[-2]:
                identity[i] = own[int(np.argmax(votes))]
    return identity
