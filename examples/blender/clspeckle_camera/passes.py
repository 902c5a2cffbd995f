"""Blender's render passes as clSpeckle wants them. Needs NumPy only.

Blender's camera looks along -z with y up, and its normals and positions are the world's. Its depth pass is taken for
what it is: the position pass tells whether it runs along the axis or along the rays. The diffuse light of a point light
in the laser's place tells what the laser sees.
"""

from __future__ import annotations

import dataclasses
import struct
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

try:
    from . import camera_view
except ImportError:  # in the checkout it is two folders up; in the add-on's archive it is beside this file
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    import camera_view

SceneError, View, rays = camera_view.SceneError, camera_view.View, camera_view.rays

# Blender's camera axes (x right, y up, z backward) to ours (x right, y down, z forward).
OURS_FROM_BLENDER = np.diag([1.0, -1.0, -1.0])
LARGEST_DEPTH = 1e9  # Blender writes 1e10 where there is no surface.
POSITION_TOLERANCE = 1e-3  # of the depth: rays pass within 0.005 px of the centres, on slopes that is some 1e-4
# Names of passes in files: until Blender 4, and from 5 on.
NAMES = {
    "Depth": ("Depth", "Z"),
    "Normal": ("Normal", "XYZ"),
    "Position": ("Position", "XYZ"),
    "Diffuse Color": ("DiffCol", "RGB"),
    "Diffuse Direct": ("DiffDir", "RGB"),
    "Material Index": ("IndexMA", "X"),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A view, and what its laser does."""

    view: View
    visibility: np.ndarray
    """(height, width) bool: the laser sees the point."""
    material: np.ndarray
    """(height, width) pass indices, 0 without a surface."""
    laser_from_camera: np.ndarray
    """(3, 4), [R|t], both in our axes."""
    about: dict[str, float | str]
    """depth: "along the axis" or "along the rays"; position_error_m; light_within_1e-4; lit."""


def intrinsics_of(about: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy of Blender's lens, sensor, fit and shift."""
    width, height = about["width"], about["height"]
    if list(about.get("pixel_aspect", [1, 1])) != [1, 1]:
        raise SceneError(f"pixels must be square; the scene's pixel aspect is {about['pixel_aspect']}")
    vertical = about["sensor_fit"] == "VERTICAL" or (about["sensor_fit"] == "AUTO" and height > width)
    # AUTO measures the longer side of the image with the sensor's width, whichever it is.
    sensor = about["sensor_mm"][1 if about["sensor_fit"] == "VERTICAL" else 0]
    side = height if vertical else width
    focal = about["lens_mm"] / sensor * side
    shift_x, shift_y = about["shift"]
    return focal, focal, (width - 1) / 2 - shift_x * side, (height - 1) / 2 + shift_y * side


def rigid(rows: Any, what: str) -> np.ndarray:
    """4 x 4 without the scale that an object may have."""
    pose = np.array(rows, float)
    pose[:3, :3] /= np.linalg.norm(pose[:3, :3], axis=0)
    if np.abs(pose[:3, :3].T @ pose[:3, :3] - np.eye(3)).max() > 1e-4:
        raise SceneError(f"the {what}'s matrix is sheared; clear its parent's scale")
    return pose


def planes(channels: Mapping[str, np.ndarray], layer: str, name: str) -> np.ndarray:
    """One pass, (height, width, components)."""
    older, parts = NAMES[name]
    found = []
    for part in parts:
        names = [f"{layer}.{each}.{end}" for each in (older, name) for end in (part, "V")]
        known = [each for each in names if each in channels]
        if not known:
            raise SceneError(f"passes.exr has no channel {names[0]!r}; it has: {', '.join(sorted(channels))}")
        found.append(channels[known[0]].astype(float))
    return np.stack(found, axis=-1)


def along_axis(depth: np.ndarray, positions: np.ndarray, hit: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, str]:
    """The depth along the axis, and which of the two the pass holds; positions are in the camera's frame."""
    kinds = {"along the axis": depth, "along the rays": depth / np.linalg.norm(way, axis=-1)}
    errors = {
        kind: float(np.median(np.linalg.norm(way * z[..., None] - positions, axis=-1)[hit] / z[hit]))
        for kind, z in kinds.items()
    }
    best = min(errors, key=errors.__getitem__)
    if errors[best] > POSITION_TOLERANCE:
        raise SceneError(
            "depth and position contradict each other: reprojected, the depth is off by "
            f"{errors[best]:.2%} of itself at best; view.json must belong to passes.exr"
        )
    return kinds[best], best


def scene_of(channels: Mapping[str, np.ndarray], about: Mapping[str, Any]) -> Scene:
    """What the passes of a rendering say.

    Args:
        channels: of passes.exr by name, (height, width).
        about: what ``rendering.describe`` says of the camera and the laser.
    """
    layer, scale = about["layer"], float(about.get("metres_per_unit", 1.0))
    intrinsics = intrinsics_of(about)
    raw = planes(channels, layer, "Depth")[..., 0]
    if raw.shape != (about["height"], about["width"]):
        raise SceneError(
            f"passes.exr has {raw.shape[1]} x {raw.shape[0]} pixels, view.json says {about['width']} x "
            f"{about['height']}"
        )
    hit = raw < LARGEST_DEPTH
    if not hit.any():
        raise SceneError("the camera sees no surface")
    world_from_camera = rigid(about["world_from_camera"], "camera")
    world_from_laser = rigid(about["world_from_laser"], "laser")
    turn = OURS_FROM_BLENDER @ world_from_camera[:3, :3].T
    way = rays(raw.shape, intrinsics)
    normals = planes(channels, layer, "Normal") @ turn.T
    positions = (planes(channels, layer, "Position") - world_from_camera[:3, 3]) @ turn.T * scale
    depth, kind = along_axis(np.where(hit, raw, 0.0) * scale, positions, hit, way)
    away = np.linalg.norm(way * depth[..., None] - positions, axis=-1)[hit]

    # A point light has no direction of its own: such a laser looks where the camera does.
    directed = about.get("laser_is_directed", False)
    laser_turn = OURS_FROM_BLENDER @ world_from_laser[:3, :3].T @ turn.T if directed else np.eye(3)
    laser = (turn @ (world_from_laser[:3, 3] - world_from_camera[:3, 3])) * scale
    to_laser = laser - positions
    expected = np.maximum((normals * to_laser).sum(axis=-1), 0.0) / np.linalg.norm(to_laser, axis=-1) ** 3
    light = planes(channels, layer, "Diffuse Direct").mean(axis=-1)
    lit = hit & (light > 0)
    if not lit.any():
        raise SceneError("the laser lights nothing that the camera sees")
    ratio = light[lit] / np.maximum(expected[lit], 1e-9)
    factor = np.median(ratio)
    # Below a half of what an unobstructed laser gives: its light is blocked, or hardly touches the surface.
    visible = lit & (light > 0.5 * factor * expected)
    color = planes(channels, layer, "Diffuse Color").mean(axis=-1)
    material = planes(channels, layer, "Material Index")[..., 0]
    view = View(
        intrinsics,
        np.where(hit, depth, 0.0).astype(np.float32),
        np.where(hit[..., None], normals, 0.0).astype(np.float32),
        np.clip(color, 0.0, 1.0).astype(np.float32),
    )
    said: dict[str, float | str] = {
        "depth": kind,
        "position_error_m": float(np.median(away)),
        "light_within_1e-4": float((np.abs(ratio / factor - 1) < 1e-4).mean()),
        "lit": float(visible.sum() / hit.sum()),
    }
    pose = np.concatenate([laser_turn, -(laser_turn @ laser)[:, None]], axis=1)
    return Scene(view, visible, np.where(hit, material, 0.0), pose, said)


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """All channels by name, (height, width), of an EXR of one part with uncompressed scan lines, as we have it written.

    Blender's Python brings no reader, and images of several layers have no pixels there.
    """
    try:
        return _channels(path, Path(path).read_bytes())
    except (IndexError, KeyError, MemoryError, OverflowError, TypeError, ValueError, struct.error):
        raise SceneError(f"{path} is cut off or no uncompressed EXR; save it again") from None


def _channels(path: Path, data: bytes) -> dict[str, np.ndarray]:
    if data[:4] != b"\x76\x2f\x31\x01" or struct.unpack_from("<I", data, 4)[0] & 0x1A00:
        raise SceneError(f"{path} is no EXR file of one part with scan lines")
    place = 8
    header: dict[str, bytes] = {}
    while data[place] != 0:
        name_end = data.index(0, place)
        kind_end = data.index(0, name_end + 1)
        (size,) = struct.unpack_from("<I", data, kind_end + 1)
        header[data[place:name_end].decode()] = data[kind_end + 5 : kind_end + 5 + size]
        place = kind_end + 5 + size
    if header["compression"] != b"\0":
        raise SceneError(f"{path} is compressed; expected an uncompressed file")
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    if width < 1 or height < 1:
        raise ValueError("no pixels")
    row: list[tuple[str, Any]] = []
    entries = header["channels"]
    while entries[0] != 0:
        end = entries.index(0)
        (kind,) = struct.unpack_from("<I", entries, end + 1)
        row.append((entries[:end].decode(), (("<u4", "<f2", "<f4")[kind], width)))
        entries = entries[end + 17 :]
    line = np.dtype([("y", "<i4"), ("size", "<i4"), *row])
    lines = np.frombuffer(data, line, count=height, offset=place + 1 + 8 * height)
    return {name: np.array(lines[name][np.argsort(lines["y"])]) for name, _ in row}
