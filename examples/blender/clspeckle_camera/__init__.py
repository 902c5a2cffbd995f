"""An add-on of Blender: renders the scene, makes the codes of a laser-dot depth camera of it, and saves both.

One click on "Record" in the properties of the rendering, or without a window:

    blender -b room.blend --addons clspeckle_camera --python-expr \\
        "import bpy; bpy.context.scene.clspeckle.laser = bpy.data.objects['Laser']; bpy.ops.clspeckle.record()"
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import passes, rendering
from .passes import SceneError, camera_view

bl_info = {
    "name": "clSpeckle camera",
    "description": "What a laser-dot depth camera records of the scene",
    "author": "The clSpeckle authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Render > clSpeckle camera",
    "category": "Render",
}


class Settings(bpy.types.PropertyGroup):
    """Of a scene: its laser and the camera's lens and sensor. Lengths and angles as their names say."""

    laser: PointerProperty(
        type=bpy.types.Object,
        name="Laser",
        description="Any object where the laser stands. It looks along its -z, a point light where the camera does",
    )
    dot_count: IntProperty(name="Dots", default=4000, min=1, max=100000, description="Random dots of the pattern")
    laser_fov_deg: FloatProperty(
        name="Laser's field of view (degrees)", default=75, min=1, max=150, description="Of the pattern, side to side"
    )
    dot_sigma_mrad: FloatProperty(name="Dot sigma (mrad)", default=2.0, min=0.2, max=20)
    wavelength_nm: FloatProperty(name="Wavelength (nm)", default=940, min=400, max=2000)
    f_number: FloatProperty(name="f-number", default=5.6, min=0.7, max=64)
    pixel_pitch_um: FloatProperty(name="Pixel pitch (um)", default=2.9, min=0.5, max=50)
    degree_of_polarization: FloatProperty(name="Degree of polarization", default=0, min=0, max=1)
    bits: IntProperty(name="Bits", default=10, min=8, max=16)
    exposure_gain_dn: FloatProperty(
        name="Exposure gain (DN)",
        default=0,
        min=0,
        max=1e9,
        description="DN per unit of light; 0: by the first frame",
    )
    seed: IntProperty(name="Seed", default=1, min=0, max=2**31 - 1, description="Of dots, speckle and noise")
    animation: BoolProperty(name="Animation", default=False, description="All frames of the scene, or the present one")
    folder: StringProperty(name="Folder", default="//clspeckle", subtype="DIR_PATH", description="Where the files go")


def record(scene: Any, layer: Any) -> list[Path]:
    """Renders, speckles and saves as the scene's settings say; the files that were written.

    Raises:
        SceneError, RuntimeError, OSError, clspeckle.errors.ClspeckleError: with what to do.
    """
    try:
        clspeckle = importlib.import_module("clspeckle")
    except (ImportError, OSError) as error:
        raise SceneError(
            f"clspeckle cannot be imported ({error}); install its wheel: {sys.executable} -m pip install "
            "clspeckle-*.whl"
        ) from error
    given = scene.clspeckle
    if given.laser is None:
        raise SceneError("no object is named as the laser; name one in the panel, or set scene.clspeckle.laser")
    if given.folder.startswith("//") and not bpy.data.filepath:
        raise SceneError(f"the folder {given.folder} is beside a file that is not saved; save it, or name another one")
    folder = Path(bpy.path.abspath(given.folder))
    folder.mkdir(parents=True, exist_ok=True)
    half = math.tan(math.radians(given.laser_fov_deg) / 2)
    side = min(4096, max(256, math.ceil(2 * half / (given.dot_sigma_mrad * 1e-3 / 2.5))))  # 2.5 texels in a sigma
    texels = camera_view.random_dots(
        given.dot_count, given.seed, side, side, given.dot_sigma_mrad * 1e-3 * side / (2 * half)
    )
    camera = {
        "f_number": given.f_number,
        "pixel_pitch_m": given.pixel_pitch_um * 1e-6,
        "wavelength_m": given.wavelength_nm * 1e-9,
        "degree_of_polarization": given.degree_of_polarization,
        "bits": given.bits,
        **({"exposure_gain_dn": given.exposure_gain_dn} if given.exposure_gain_dn > 0 else {}),
    }
    frames = range(scene.frame_start, scene.frame_end + 1) if given.animation else [scene.frame_current]
    present, views = scene.frame_current, []
    with clspeckle.Pattern(texels, half_extent_x=half, half_extent_y=half, filter="area") as pattern:
        try:
            for frame in frames:
                scene.frame_set(frame)
                with tempfile.TemporaryDirectory() as own:
                    file = Path(own) / "passes.exr"
                    about = rendering.render_passes(scene, layer, given.laser, file)
                    seen = passes.scene_of(passes.read_exr(file), about)
                pattern.set_pose(seen.laser_from_camera)
                light = pattern.lookup(seen.view.geometry(visibility=seen.visibility))
                views.append(dataclasses.replace(seen.view, ideal=light))
        finally:
            scene.frame_set(present)
    said = {"source": f"Blender {bpy.app.version_string}, Cycles", "blender_frames": list(frames)}
    return camera_view.write(folder, camera_view.record(views, seed=given.seed, **camera), said)


class CLSPECKLE_OT_record(bpy.types.Operator):
    """Render the scene, make codes of it, and save them"""

    bl_idname = "clspeckle.record"
    bl_label = "Record"

    def execute(self, context: Any) -> set[str]:
        try:
            written = record(context.scene, context.view_layer)
        except Exception as error:  # whatever it is, the user is told, and Blender goes on
            self.report({"ERROR"}, f"clSpeckle: {error}")
            return {"CANCELLED"}
        codes = [file for file in written if file.name.endswith(".codes.png")]
        bpy.data.images.load(str(codes[0]), check_existing=True).reload()
        self.report({"INFO"}, f"clSpeckle: {len(codes)} frames in {codes[0].parent}")
        return {"FINISHED"}


class CLSPECKLE_PT_panel(bpy.types.Panel):
    """The settings and the button"""

    bl_label = "clSpeckle camera"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "render"

    def draw(self, context: Any) -> None:
        self.layout.use_property_split = True
        for name in Settings.__annotations__:
            self.layout.prop(context.scene.clspeckle, name)
        self.layout.operator(CLSPECKLE_OT_record.bl_idname)


CLASSES = (Settings, CLSPECKLE_OT_record, CLSPECKLE_PT_panel)


def register() -> None:
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.clspeckle = PointerProperty(type=Settings)


def unregister() -> None:
    del bpy.types.Scene.clspeckle
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
