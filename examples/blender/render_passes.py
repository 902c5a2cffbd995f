"""Run by Blender: renders the passes of the open scene that G-buffers need, and writes what its camera and laser are.

    blender -b room.blend -noaudio -P examples/blender/render_passes.py -- --laser Laser --output passes

writes passes/passes.exr (multilayer: depth, normal, position, diffuse colour, material index, and the diffuse direct
light of the laser alone) and passes/view.json; passes_to_gbuffers.py makes a sequence of them. The scene needs a camera
and a point light where the laser stands; every other light and the world are switched off, the file is not saved. One
ray goes through the centre of each pixel.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import bpy


def fail(message: str) -> None:
    print(f"render_passes: {message}", file=sys.stderr)
    sys.exit(1)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="blender ... -P render_passes.py --",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--output", type=Path, required=True, help="folder for passes.exr and view.json")
    parser.add_argument(
        "--laser", default="Laser", help="name of the point light that stands for the laser (default: Laser)"
    )
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    return parser.parse_args(own)


def prepare(scene: bpy.types.Scene, laser: bpy.types.Object) -> None:
    for item in scene.objects:
        if item.type == "LIGHT" and item is not laser:
            item.hide_render = True
    laser.hide_render = False
    laser.data.shadow_soft_size = 0.0  # a point: shadows have no penumbra
    scene.world = None
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", 1, 0
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    # A depth that is a mean over a pixel lies on no surface: rays go through the centres, to 0.005 px.
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 0.01
    scene.render.use_motion_blur = False
    if scene.camera.data.dof.use_dof:
        scene.camera.data.dof.use_dof = False
    layer = bpy.context.view_layer
    for name in ("z", "normal", "position", "diffuse_color", "diffuse_direct", "material_index"):
        setattr(layer, f"use_pass_{name}", True)
    scene.use_nodes = False
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"


def view(scene: bpy.types.Scene, laser: bpy.types.Object) -> dict[str, object]:
    """What the converter needs, in Blender's own conventions."""
    camera, render = scene.camera, scene.render
    share = render.resolution_percentage / 100

    def rows(item: bpy.types.Object) -> list[list[float]]:
        return [list(row) for row in item.matrix_world]

    used = {m.material.name: m.material for o in scene.objects for m in o.material_slots if m.material}
    return {
        "blender": bpy.app.version_string,
        "layer": bpy.context.view_layer.name,
        "width": int(render.resolution_x * share),
        "height": int(render.resolution_y * share),
        "pixel_aspect": [render.pixel_aspect_x, render.pixel_aspect_y],
        "lens_mm": camera.data.lens,
        "sensor_mm": [camera.data.sensor_width, camera.data.sensor_height],
        "sensor_fit": camera.data.sensor_fit,
        "shift": [camera.data.shift_x, camera.data.shift_y],
        "metres_per_unit": scene.unit_settings.scale_length,
        "world_from_camera": rows(camera),
        "world_from_laser": rows(laser),
        "materials": [{"id": m.pass_index, "name": m.name} for m in sorted(used.values(), key=lambda m: m.pass_index)],
    }


def main() -> None:
    options = arguments()
    scene = bpy.context.scene
    if scene.camera is None or scene.camera.type != "CAMERA" or scene.camera.data.type != "PERSP":
        fail("the scene has no perspective camera; make one the scene's camera")
    laser = scene.objects.get(options.laser)
    if laser is None or laser.type != "LIGHT" or laser.data.type != "POINT":
        lights = ", ".join(o.name for o in scene.objects if o.type == "LIGHT" and o.data.type == "POINT") or "none"
        fail(
            f"there is no point light {options.laser!r}; point lights of this scene: {lights}; choose one with --laser"
        )
    prepare(scene, laser)
    bpy.context.view_layer.update()
    options.output.mkdir(parents=True, exist_ok=True)
    about = options.output / "view.json"
    about.unlink(missing_ok=True)
    scene.render.filepath = str((options.output / "passes.exr").resolve())
    bpy.ops.render.render(write_still=True)
    part = about.with_name("view.json.part")
    part.write_text(json.dumps(view(scene, laser), indent=1) + "\n")
    part.replace(about)
    print(f"render_passes: {options.output / 'passes.exr'}, {about}")


main()
