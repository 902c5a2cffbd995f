"""Builds a scene of Blender's own objects (Suzanne, torus, cone, sphere, cube, cylinder on a table before a wall), with
a camera and a point light that is called "Laser".

    blender -b --factory-startup -noaudio -P examples/blender/sample_scene.py -P examples/blender/render_passes.py \\
        -- --output passes

Blender's world: z up, metres. Only `bpy` is needed. The colours stand for albedos at 940 nm.
"""

from __future__ import annotations

import math

import bpy
from mathutils import Matrix, Vector

BASELINE_M = 0.075
CAMERA_POSITION = (0.0, -1.05, 0.42)
CAMERA_TARGET = (0.0, 0.1, 0.10)

# Name, albedo.
MATERIALS = (
    ("wall", 0.75),
    ("table", 0.55),
    ("suzanne", 0.60),
    ("torus", 0.45),
    ("cone", 0.70),
    ("ball", 0.80),
    ("dark_cube", 0.20),
    ("cylinder", 0.50),
)


def diffuse(name: str, albedo: float) -> bpy.types.Material:
    """A Lambertian material; its place in MATERIALS, from 1 on, is its pass index."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (albedo, albedo, albedo, 1.0)
    shader.inputs["Roughness"].default_value = 0.0
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    return material


def checkered(material: bpy.types.Material, albedo: float) -> None:
    """Squares of 4 cm with two albedos, so that the texture of a renderer is in the chain too."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    checker, place = nodes.new("ShaderNodeTexChecker"), nodes.new("ShaderNodeNewGeometry")
    for name, factor in (("Color1", 1.0), ("Color2", 0.6)):
        checker.inputs[name].default_value = (factor * albedo,) * 3 + (1.0,)
    checker.inputs["Scale"].default_value = 25.0
    shift = nodes.new("ShaderNodeVectorMath")  # off the table's own plane, where the checker would flicker
    shift.inputs[1].default_value = (0.0, 0.0, 0.02)
    links.new(place.outputs["Position"], shift.inputs[0])
    links.new(shift.outputs[0], checker.inputs["Vector"])
    diffuse_node = next(node for node in nodes if node.type == "BSDF_DIFFUSE")
    links.new(checker.outputs["Color"], diffuse_node.inputs["Color"])


def add(operator: object, material: str, smooth: bool = False, **options: object) -> bpy.types.Object:
    operator(**options)
    made = bpy.context.active_object
    made.data.materials.append(bpy.data.materials[material])
    if smooth:
        bpy.ops.object.shade_smooth()
    return made


def build() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for index, (name, albedo) in enumerate(MATERIALS, start=1):
        diffuse(name, albedo).pass_index = index
    checkered(bpy.data.materials["table"], dict(MATERIALS)["table"])
    mesh = bpy.ops.mesh
    add(mesh.primitive_plane_add, "table", size=3.0)
    add(mesh.primitive_plane_add, "wall", size=4.0, location=(0, 0.55, 0), rotation=(math.pi / 2, 0, 0))
    monkey = add(mesh.primitive_monkey_add, "suzanne", smooth=True, size=0.30, location=(-0.16, 0.05, 0.148))
    monkey.rotation_euler = (-0.35, 0.0, 0.35)
    monkey.modifiers.new("subdivision", "SUBSURF").render_levels = 3
    add(
        mesh.primitive_torus_add,
        "torus",
        smooth=True,
        major_radius=0.085,
        minor_radius=0.035,
        major_segments=96,
        minor_segments=48,
        location=(0.10, -0.18, 0.035),
    )
    add(mesh.primitive_cone_add, "cone", vertices=192, radius1=0.08, depth=0.24, location=(0.30, 0.20, 0.12))
    add(
        mesh.primitive_uv_sphere_add,
        "ball",
        smooth=True,
        segments=192,
        ring_count=96,
        radius=0.07,
        location=(0.12, 0.10, 0.07),
    )
    add(mesh.primitive_cube_add, "dark_cube", size=0.12, location=(-0.32, -0.12, 0.06), rotation=(0, 0, 0.5))
    add(mesh.primitive_cylinder_add, "cylinder", vertices=192, radius=0.05, depth=0.30, location=(-0.40, 0.28, 0.15))

    forward = (Vector(CAMERA_TARGET) - Vector(CAMERA_POSITION)).normalized()
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.matrix_world = Matrix.Translation(CAMERA_POSITION) @ forward.to_track_quat("-Z", "Y").to_matrix().to_4x4()
    camera.data.sensor_width, camera.data.lens = 36.0, 36.0
    # The laser stands to the right of the camera, not rotated.
    laser = bpy.data.objects.new("Laser", bpy.data.lights.new("Laser", "POINT"))
    laser.matrix_world = camera.matrix_world @ Matrix.Translation((BASELINE_M, 0.0, 0.0))
    laser.data.energy, laser.data.shadow_soft_size = 10.0, 0.0
    for item in (camera, laser):
        bpy.context.collection.objects.link(item)
    scene = bpy.context.scene
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 480, 360, 100


build()
