"""How far surface points have moved (motion.h; thesis sections 3.2.4 to 3.2.8), in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LATERAL_M, AXIAL_M, ROTATION_RAD = 0.5e-3, 3e-3, np.deg2rad(0.25)


def rotation(axis: tuple[float, float, float], angle: float) -> NDArray[np.float64]:
    """The matrix that turns by `angle` about `axis` (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def points(depth: NDArray, intrinsics: tuple[float, float, float, float], along_ray: bool = False) -> NDArray[np.float64]:
    """Positions of the pixels of a depth image."""
    fx, fy, cx, cy = intrinsics
    y, x = np.mgrid[: depth.shape[0], : depth.shape[1]].astype(np.float64)
    rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], -1)
    if along_ray:
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return rays * np.asarray(depth, dtype=np.float64)[..., None]


def pixels(position: NDArray, intrinsics: tuple[float, float, float, float]) -> NDArray[np.float64]:
    """Where positions lie in the image, (x, y)."""
    fx, fy, cx, cy = intrinsics
    return np.stack([fx * position[..., 0] / position[..., 2] + cx, fy * position[..., 1] / position[..., 2] + cy], -1)


def displacement(now: NDArray, before: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lateral (>= 0) and axial part of now - before, seen from the origin."""
    view = now / np.linalg.norm(now, axis=-1, keepdims=True)
    delta = now - before
    axial = np.sum(delta * view, axis=-1)
    return np.linalg.norm(delta - axial[..., None] * view, axis=-1), axial


def angle_between(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Angle between vectors; the arc cosine would lose small ones."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1))


def path(
    lateral: NDArray,
    axial: NDArray,
    angle: NDArray | float,
    lengths: tuple[NDArray | float, NDArray | float, NDArray | float] = (LATERAL_M, AXIAL_M, ROTATION_RAD),
) -> NDArray[np.float64]:
    """In correlation lengths."""
    return np.sqrt((lateral / lengths[0]) ** 2 + (axial / lengths[1]) ** 2 + (angle / lengths[2]) ** 2)
