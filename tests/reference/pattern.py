"""The projected pattern (pattern.h; thesis section 3.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

TANGENT_PLANE = "tangent_plane"
DIRECTION_COSINES = "direction_cosines"
RADIANT_INTENSITY = "radiant_intensity"
PLANE_IRRADIANCE = "plane_irradiance"
ALONG_AXIS = "along_axis"
ALONG_RAY = "along_ray"


def positions_from_depth(
    depth: NDArray, fx_px: float, fy_px: float, cx_px: float, cy_px: float, depth_kind: str = ALONG_AXIS
) -> NDArray[np.float64]:
    """Positions in the camera frame, (height, width, 3), NaN where there is no surface. Pixel centres are integers."""
    depth = np.asarray(depth, dtype=np.float64)
    height, width = depth.shape
    y, x = np.mgrid[:height, :width]
    ray = np.stack([(x - cx_px) / fx_px, (y - cy_px) / fy_px, np.ones(depth.shape)], axis=-1)
    if depth_kind == ALONG_RAY:
        ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    elif depth_kind != ALONG_AXIS:
        raise ValueError(f"unknown depth kind {depth_kind!r}")
    valid = np.isfinite(depth) & (depth > 0)
    return ray * np.where(valid, depth, np.nan)[..., None]


def lookup_bilinear(
    texels: NDArray, x: NDArray[np.float64], y: NDArray[np.float64], half_extent_x: float, half_extent_y: float
) -> NDArray[np.float64]:
    """The image that covers [-half_extent, half_extent], pixel edges on the boundary; 0 outside, edge texels
    clamped."""
    texels = np.asarray(texels, dtype=np.float64)
    height, width = texels.shape
    inside = (np.abs(x) <= half_extent_x) & (np.abs(y) <= half_extent_y)
    tx = np.clip((np.where(inside, x, 0) / half_extent_x + 1) / 2 * width - 0.5, 0, width - 1)
    ty = np.clip((np.where(inside, y, 0) / half_extent_y + 1) / 2 * height - 0.5, 0, height - 1)
    ix = np.minimum(tx.astype(int), width - 2)
    iy = np.minimum(ty.astype(int), height - 2)
    wx = tx - ix
    wy = ty - iy
    top = texels[iy, ix] * (1 - wx) + texels[iy, ix + 1] * wx
    bottom = texels[iy + 1, ix] * (1 - wx) + texels[iy + 1, ix + 1] * wx
    return np.where(inside, top * (1 - wy) + bottom * wy, 0.0)


def lookup(
    texels: NDArray,
    position: NDArray,
    *,
    normal: NDArray | None = None,
    albedo: NDArray | None = None,
    visibility: NDArray | None = None,
    projection: str = TANGENT_PLANE,
    quantity: str = RADIANT_INTENSITY,
    half_extent_x: float = 0.5,
    half_extent_y: float = 0.5,
    power_scale: float = 1.0,
    laser_from_geometry: NDArray | None = None,
) -> NDArray[np.float64]:
    """I0 = E albedo / pi with E = power_scale J max(0, -w . R N) / d^2 visibility.

    E is the inverse-square and cosine law of a point source of radiant intensity J; a Lambertian surface of reflectance
    `albedo` sends back the radiance E albedo / pi. A pattern given as the irradiance of a plane at unit distance,
    E_plane = J cos^3 (d = 1/cos, cosine of incidence cos), has J = E_plane / cos^3.
    """
    pose = np.eye(3, 4) if laser_from_geometry is None else np.asarray(laser_from_geometry, np.float64).reshape(3, 4)
    rotation, translation = pose[:, :3], pose[:, 3]
    position = np.asarray(position, dtype=np.float64)[..., :3]
    valid: NDArray[np.bool_] = np.all(np.isfinite(position), axis=-1)
    laser = np.where(valid[..., None], position, 0.0) @ rotation.T + translation
    valid &= laser[..., 2] > 0
    laser = np.where(valid[..., None], laser, np.array([0.0, 0.0, 1.0]))

    distance = np.linalg.norm(laser, axis=-1)
    w = laser / distance[..., None]
    if projection == TANGENT_PLANE:
        x, y = laser[..., 0] / laser[..., 2], laser[..., 1] / laser[..., 2]
    elif projection == DIRECTION_COSINES:
        x, y = w[..., 0], w[..., 1]
    else:
        raise ValueError(f"unknown projection {projection!r}")
    intensity = lookup_bilinear(texels, x, y, half_extent_x, half_extent_y)
    if quantity == PLANE_IRRADIANCE:
        intensity = intensity / w[..., 2] ** 3
    elif quantity != RADIANT_INTENSITY:
        raise ValueError(f"unknown quantity {quantity!r}")

    irradiance = power_scale * intensity / distance**2
    if normal is not None:
        turned = np.asarray(normal, dtype=np.float64)[..., :3] @ rotation.T
        irradiance = irradiance * np.maximum(0.0, -np.sum(w * turned, axis=-1))
    if visibility is not None:
        visibility = np.asarray(visibility)
        scale = 1 / 255 if visibility.dtype == np.uint8 else 1.0
        irradiance = irradiance * visibility.astype(np.float64) * scale
    if albedo is None:
        reflectance: NDArray[np.float64] | float = 1.0
    else:
        albedo = np.asarray(albedo, dtype=np.float64)
        reflectance = np.where(albedo > 0, albedo, 0.0)
    return np.where(valid, irradiance * reflectance / np.pi, 0.0)
