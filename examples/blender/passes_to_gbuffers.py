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
import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parent / "clspeckle_camera")]
from camera_view import SceneError, read_json
from gbuffer_files import Camera, Rounding, dots_for, read_channels, write_sequence
from passes import scene_of

COMPACT = Rounding(depth_bits=16, normal_steps=256, albedo_steps=256)


def load_view(path: Path) -> dict:
    try:
        about = read_json(path)
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


def convert(folder: Path, output: Path, spacing_px: float, sigma_px: float, compact: bool) -> dict[str, float | str]:
    view = load_view(folder / "view.json")
    scene = scene_of(read_channels(folder / "passes.exr"), view)
    depth, normals, hit = scene.view.depth, scene.view.normal, scene.view.depth > 0
    camera = Camera(view["width"], view["height"], *scene.view.intrinsics)
    frame = {
        "Z": depth,
        **{f"N.{axis}": normals[..., i] for i, axis in enumerate("XYZ")},
        "albedo": scene.view.albedo,
        "visibility": scene.visibility.astype(float),
        "material": scene.material,
    }
    pose = scene.laser_from_camera
    near = float(depth[hit].min())
    dots = dots_for(camera, pose, 0.95 * near, spacing_px, sigma_px)
    materials = [{"id": entry["id"], "name": entry["name"]} for entry in view.get("materials", []) if entry["id"] > 0]
    if len({entry["id"] for entry in materials}) < len(materials):
        materials = []  # ids that several materials share say nothing
    source = f"Blender {view.get('blender', '')}, Cycles"
    write_sequence(output, camera, pose, [frame], dots, materials, source, COMPACT if compact else None)
    return {**scene.about, "dots": dots.count}


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
