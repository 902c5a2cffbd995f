#!/usr/bin/env python3
"""Turn Blender's passes (render_passes.py) into a G-buffer sequence with a dot pattern.

    python examples/blender/passes_to_gbuffers.py passes -o gbuffers
    clspeckle render gbuffers/sequence.json -o frames --exposure-gain auto

Blender's camera looks along -z with y up, and its normals and positions are the world's. Its depth pass is taken for
what it is: the position pass tells whether it runs along the axis or along the rays. The laser's diffuse light tells
what the laser sees.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from gbuffer_files import Camera, Rounding, SceneError, dots_for, read_channels, write_sequence

# Blender's camera axes (x right, y up, z backward) to ours (x right, y down, z forward).
OURS_FROM_BLENDER = np.diag([1.0, -1.0, -1.0])
LARGEST_DEPTH = 1e9  # Blender writes 1e10 where there is no surface.
COMPACT = Rounding(depth_bits=16, normal_steps=256, albedo_steps=256)
POSITION_TOLERANCE = 1e-3  # of the depth: rays pass within 0.005 px of the centres, on slopes that is some 1e-4


def load_view(path: Path) -> dict:
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{path} cannot be read ({error.strerror}); render_passes.py writes it last") from None
    except ValueError as error:
        raise SceneError(f"{path} is not JSON: {error}") from None
    wanted = (
        "layer",
        "width",
        "height",
        "lens_mm",
        "sensor_mm",
        "sensor_fit",
        "shift",
        "world_from_camera",
        "world_from_laser",
    )
    missing = [key for key in wanted if key not in about]
    if missing:
        raise SceneError(f"{path} lacks {', '.join(missing)}; was it written by render_passes.py?")
    return about


def camera_of(view: dict) -> Camera:
    """The pinhole of Blender's lens, sensor, fit and shift."""
    width, height = view["width"], view["height"]
    if view.get("pixel_aspect", [1, 1]) != [1, 1]:
        raise SceneError(f"pixels must be square; the scene's pixel aspect is {view['pixel_aspect']}")
    vertical = view["sensor_fit"] == "VERTICAL" or (view["sensor_fit"] == "AUTO" and height > width)
    # AUTO measures the longer side of the image with the sensor's width, whichever it is.
    sensor = view["sensor_mm"][1 if view["sensor_fit"] == "VERTICAL" else 0]
    side = height if vertical else width
    focal = view["lens_mm"] / sensor * side
    shift_x, shift_y = view["shift"]
    return Camera(width, height, focal, focal, (width - 1) / 2 - shift_x * side, (height - 1) / 2 + shift_y * side)


def rigid(rows: list, what: str) -> np.ndarray:
    """4 x 4 without the scale that an object may have."""
    pose = np.array(rows, float)
    pose[:3, :3] /= np.linalg.norm(pose[:3, :3], axis=0)
    if np.abs(pose[:3, :3].T @ pose[:3, :3] - np.eye(3)).max() > 1e-4:
        raise SceneError(f"the {what}'s matrix is sheared; clear its parent's scale")
    return pose


def planes(channels: dict[str, np.ndarray], layer: str, name: str, parts: str) -> np.ndarray:
    names = [f"{layer}.{name}.{part}" for part in parts]
    missing = [entry for entry in names if entry not in channels]
    if missing:
        raise SceneError(f"passes.exr has no channel {missing[0]!r}; it has: {', '.join(sorted(channels))}")
    return np.stack([channels[entry].astype(float) for entry in names], axis=-1)


def along_axis(depth: np.ndarray, positions: np.ndarray, hit: np.ndarray, camera: Camera) -> tuple[np.ndarray, str]:
    """The depth along the axis, and which of the two the pass holds; positions are in the camera's frame."""
    rays = camera.rays()
    kinds = {"along the axis": depth, "along the rays": depth / np.linalg.norm(rays, axis=-1)}
    errors = {
        kind: float(np.median(np.linalg.norm(rays * z[..., None] - positions, axis=-1)[hit] / z[hit]))
        for kind, z in kinds.items()
    }
    best = min(errors, key=errors.__getitem__)
    if errors[best] > POSITION_TOLERANCE:
        raise SceneError(
            "depth and position contradict each other: reprojected, the depth is off by "
            f"{errors[best]:.2%} of itself at best; view.json must belong to passes.exr"
        )
    return kinds[best], best


def convert(folder: Path, output: Path, spacing_px: float, sigma_px: float, compact: bool) -> dict[str, float | str]:
    view = load_view(folder / "view.json")
    channels = read_channels(folder / "passes.exr")
    camera, layer = camera_of(view), view["layer"]
    scale = float(view.get("metres_per_unit", 1.0))
    raw = planes(channels, layer, "Depth", "Z")[..., 0]
    if raw.shape != (camera.height, camera.width):
        raise SceneError(
            f"passes.exr has {raw.shape[1]} x {raw.shape[0]} pixels, view.json says {camera.width} x {camera.height}"
        )
    hit = raw < LARGEST_DEPTH
    if not hit.any():
        raise SceneError("the camera sees no surface")
    world_from_camera, world_from_laser = (
        rigid(view["world_from_camera"], "camera"),
        rigid(view["world_from_laser"], "laser"),
    )
    turn = OURS_FROM_BLENDER @ world_from_camera[:3, :3].T
    normals = planes(channels, layer, "Normal", "XYZ") @ turn.T
    positions = (planes(channels, layer, "Position", "XYZ") - world_from_camera[:3, 3]) @ turn.T * scale
    depth, kind = along_axis(np.where(hit, raw, 0.0) * scale, positions, hit, camera)
    away = np.linalg.norm(camera.rays() * depth[..., None] - positions, axis=-1)[hit]

    # A point light has no direction of its own: the laser looks where the camera does.
    laser = (turn @ (world_from_laser[:3, 3] - world_from_camera[:3, 3])) * scale
    way = laser - positions
    distance = np.linalg.norm(way, axis=-1)
    expected = np.maximum((normals * way).sum(axis=-1), 0.0) / distance**3
    light = planes(channels, layer, "DiffDir", "RGB").mean(axis=-1)
    lit = hit & (light > 0)
    if not lit.any():
        raise SceneError("the laser lights nothing that the camera sees")
    ratio = light[lit] / np.maximum(expected[lit], 1e-9)
    factor = np.median(ratio)
    # Below a half of what an unobstructed laser gives: its light is blocked, or hardly touches the surface.
    visible = lit & (light > 0.5 * factor * expected)
    color = planes(channels, layer, "DiffCol", "RGB").mean(axis=-1)
    material = planes(channels, layer, "IndexMA", "X")[..., 0]
    frame = {
        "Z": np.where(hit, depth, 0.0),
        **{f"N.{axis}": np.where(hit, normals[..., i], 0.0) for i, axis in enumerate("XYZ")},
        "albedo": np.clip(color, 0.0, 1.0),
        "visibility": visible.astype(float),
        "material": np.where(hit, material, 0.0),
    }
    pose = np.concatenate([np.eye(3), -laser[:, None]], axis=1)
    near = float(depth[hit].min())
    dots = dots_for(camera, pose, 0.95 * near, spacing_px, sigma_px)
    materials = [{"id": entry["id"], "name": entry["name"]} for entry in view.get("materials", []) if entry["id"] > 0]
    if len({entry["id"] for entry in materials}) < len(materials):
        materials = []  # ids that several materials share say nothing
    source = f"Blender {view.get('blender', '')}, Cycles"
    write_sequence(output, camera, pose, [frame], dots, materials, source, COMPACT if compact else None)
    return {
        "depth": kind,
        "position_error_m": float(np.median(away)),
        "light_within_1e-4": float((np.abs(ratio / factor - 1) < 1e-4).mean()),
        "lit": float(visible.sum() / hit.sum()),
        "dots": dots.count,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("passes", type=Path, help="folder with passes.exr and view.json")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the sequence")
    parser.add_argument(
        "--dot-spacing-px", type=float, default=11.0, help="mean distance of dots in the image (default: 11)"
    )
    parser.add_argument("--dot-sigma-px", type=float, default=1.4, help="width of dots in the image (default: 1.4)")
    parser.add_argument(
        "--compact", action="store_true", help="round depth to 16 bits, normals and albedo to 1/256: half the size"
    )
    arguments = parser.parse_args()
    for name, low, high in (("dot_spacing_px", 4.0, 100.0), ("dot_sigma_px", 0.5, 10.0)):
        if not low <= getattr(arguments, name) <= high:
            parser.error(f"--{name.replace('_', '-')} must lie in {low:g} to {high:g}, got {getattr(arguments, name)}")
    try:
        said = convert(
            arguments.passes, arguments.output, arguments.dot_spacing_px, arguments.dot_sigma_px, arguments.compact
        )
    except (SceneError, OSError) as error:
        print(f"passes_to_gbuffers: {error}", file=sys.stderr)
        return 1
    print(
        f"{arguments.output}: depth {said['depth']}, reprojected to the position pass within "
        f"{said['position_error_m']:.1e} m (median); the laser's light falls as cos/d^2 within 1e-4 "
        f"on {said['light_within_1e-4']:.1%} of the lit pixels; it sees {said['lit']:.1%} of the scene; "
        f"{said['dots']} dots"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
