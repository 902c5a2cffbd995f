"""In Blender: renders the passes of a scene that clSpeckle needs, and leaves the scene as it was."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

PASSES = ("z", "normal", "position", "diffuse_color", "diffuse_direct", "material_index")

# One uncompressed part; what comes first allows what follows. The first and the last are Blender 5's.
FORMAT = {
    "media_type": "MULTI_LAYER_IMAGE",
    "file_format": "OPEN_EXR_MULTILAYER",
    "color_depth": "32",
    "exr_codec": "NONE",
    "use_exr_interleave": True,
}


def camera_of(scene: Any) -> Any:
    """The scene's camera; a RuntimeError where it is no pinhole."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        raise RuntimeError("the scene has no perspective camera; make one the scene's camera")
    return camera


@contextlib.contextmanager
def prepared(scene: Any, layer: Any, laser: Any, file: Path) -> Iterator[None]:
    """The scene while its passes are rendered to `file`: one ray a pixel, and no light but a point at the laser's."""
    changed: list[tuple[Any, str, Any]] = []

    def put(owner: Any, name: str, value: Any) -> None:
        changed.append((owner, name, getattr(owner, name)))
        setattr(owner, name, value)

    settings = scene.render.image_settings
    format_before = {name: getattr(settings, name) for name in FORMAT if hasattr(settings, name)}
    point = bpy.data.lights.new("clSpeckle laser", "POINT")
    point.energy, point.shadow_soft_size = 10.0, 0.0  # a point: shadows have no penumbra
    stand_in = bpy.data.objects.new("clSpeckle laser", point)
    try:
        stand_in.matrix_world = laser.matrix_world
        scene.collection.objects.link(stand_in)
        for item in scene.objects:
            if item.type == "LIGHT" and item is not stand_in:
                put(item, "hide_render", True)
        render, camera = scene.render, scene.camera.data
        put(scene, "world", None)
        put(render, "engine", "CYCLES")
        cycles = scene.cycles
        # A depth that is a mean over a pixel lies on no surface: rays go through the centres, to 0.005 px.
        for name, value in (
            ("device", "CPU"),
            ("samples", 1),
            ("seed", 0),
            ("use_denoising", False),
            ("use_adaptive_sampling", False),
            ("pixel_filter_type", "BOX"),
            ("filter_width", 0.01),
        ):
            put(cycles, name, value)
        for name in ("use_motion_blur", "use_compositing", "use_sequencer", "use_border"):
            put(render, name, False)
        put(camera.dof, "use_dof", False)
        for name in PASSES:
            put(layer, f"use_pass_{name}", True)
        for other in scene.view_layers:
            put(other, "use", other == layer)
        for name in format_before:
            setattr(settings, name, FORMAT[name])
        put(render, "use_file_extension", False)
        put(render, "filepath", str(file))
        yield
    finally:
        for owner, name, value in reversed(changed):
            setattr(owner, name, value)
        for name, value in format_before.items():
            with contextlib.suppress(TypeError):  # of a format that has no such thing
                setattr(settings, name, value)
        bpy.data.objects.remove(stand_in)
        bpy.data.lights.remove(point)


def describe(scene: Any, layer: Any, laser: Any) -> dict[str, Any]:
    """What passes.py needs of the camera and the laser, in Blender's own conventions."""
    camera, render = camera_of(scene).data, scene.render
    share = render.resolution_percentage / 100
    used = {m.material.name: m.material for o in scene.objects for m in o.material_slots if m.material}
    return {
        "blender": bpy.app.version_string,
        "layer": layer.name,
        "width": int(render.resolution_x * share),
        "height": int(render.resolution_y * share),
        "pixel_aspect": [render.pixel_aspect_x, render.pixel_aspect_y],
        "lens_mm": camera.lens,
        "sensor_mm": [camera.sensor_width, camera.sensor_height],
        "sensor_fit": camera.sensor_fit,
        "shift": [camera.shift_x, camera.shift_y],
        "metres_per_unit": scene.unit_settings.scale_length,
        "world_from_camera": [list(row) for row in scene.camera.matrix_world],
        "world_from_laser": [list(row) for row in laser.matrix_world],
        "laser_is_directed": not (laser.type == "LIGHT" and laser.data.type == "POINT"),
        "materials": [{"id": m.pass_index, "name": m.name} for m in sorted(used.values(), key=lambda m: m.pass_index)],
    }


def render_passes(scene: Any, layer: Any, laser: Any, file: Path) -> dict[str, Any]:
    """Renders the passes of a scene to an EXR of several layers, and says what :func:`describe` does."""
    camera_of(scene)
    with prepared(scene, layer, laser, file):
        layer.update()
        about = describe(scene, layer, laser)
        if (
            bpy.ops.render.render(write_still=True, scene=scene.name, layer=layer.name) != {"FINISHED"}
            or not file.is_file()
        ):
            raise RuntimeError("Blender did not finish the rendering")
    return about
