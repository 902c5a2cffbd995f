#!/usr/bin/env python3
"""Render the G-buffers of an office desk while a mug is lifted: one EXR per frame, sequence.json and the pattern.

The geometry comes from office_scene.py, rays are traced with Mitsuba 3, and everything is given in the camera's frame
(x right, y down, z forward, metres). Pixel (x, y) looks along ((x - cx) / fx, (y - cy) / fy, 1): integer coordinates
are pixel centres, and one ray goes through each centre, so depth and normals carry no sampling noise. README.md lists
the channels.
"""

from __future__ import annotations

import argparse
import json
import lzma
import os
import sys
import tarfile
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import make_pattern
import numpy as np
import office_scene as office
import OpenEXR

FORMAT_NAME = "clspeckle-gbuffer-sequence"
FORMAT_VERSION = 1
WAVELENGTH_M = 940e-9
PIXEL_PITCH_M = 2.9e-6
F_NUMBER = 5.6
BASELINE_M = 0.075
# 60 degrees across, for any image width.
FOCAL_PER_WIDTH = 0.875
CAMERA_POSITION = (0.06, -1.22, 0.66)
CAMERA_TARGET = (0.06, 0.20, 0.125)

# Normals are stored as half: 11 bits, so a component is off by at most 2^-12.
NORMAL_TOLERANCE = 1e-3

ARCHIVE_NAME = "frames.tar.xz"
HALF_CHANNELS = ("N.X", "N.Y", "N.Z", "albedo", "visibility", "material", "refresh")
CHANNELS = ("Z", *HALF_CHANNELS)


@dataclass(frozen=True)
class Camera:
    width: int
    height: int

    @property
    def focal(self) -> float:
        return FOCAL_PER_WIDTH * self.width

    @property
    def center(self) -> tuple[float, float]:
        return (self.width - 1) / 2.0, (self.height - 1) / 2.0

    def rays(self, shift: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
        """Directions [height * width, 3] with z = 1 through the pixel centres, or shifted by a part of a pixel."""
        x = (np.arange(self.width) + shift[0] - self.center[0]) / self.focal
        y = (np.arange(self.height) + shift[1] - self.center[1]) / self.focal
        return np.stack([*(a.ravel() for a in np.meshgrid(x, y)), np.ones(self.width * self.height)], -1)


def camera_from_world() -> np.ndarray:
    position, target = np.array(CAMERA_POSITION), np.array(CAMERA_TARGET)
    forward = office.normalized(target - position)
    right = office.normalized(np.cross(forward, [0.0, 0.0, 1.0]))
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = -pose[:3, :3] @ position
    return pose


def load_mitsuba(variant: str) -> ModuleType:
    """Import Mitsuba 3 with a vectorized variant, or end with what to install."""
    try:
        import mitsuba
    except ImportError as error:
        raise SystemExit(f"render_gbuffers: Mitsuba 3 is missing ({error}); pip install mitsuba") from error
    if variant not in mitsuba.variants() or variant.startswith("scalar"):
        known = ", ".join(name for name in mitsuba.variants() if not name.startswith("scalar"))
        raise SystemExit(f"render_gbuffers: --variant {variant} is not one of the vectorized variants: {known}")
    try:
        mitsuba.set_variant(variant)
        mitsuba.Float([0.0]) + 1.0
    except Exception as error:
        raise SystemExit(
            f"render_gbuffers: the Mitsuba variant {variant} does not run here: {error}\n"
            "The llvm variants need libLLVM (Debian: apt install libllvm15), the cuda ones an NVIDIA driver."
        ) from error
    return mitsuba


class Tracer:
    """Parts merged into one Mitsuba mesh in the camera frame; the hit triangle tells the part."""

    def __init__(self, mitsuba: ModuleType, parts: list[office.Part], camera_pose: np.ndarray) -> None:
        self.mi = mitsuba
        self.parts = parts
        meshes = [office.placed(part.mesh, camera_pose @ part.pose) for part in parts]
        self.part_of_face = np.repeat(np.arange(len(parts)), [len(mesh.faces) for mesh in meshes])
        mesh = office.merged(meshes)
        shape = mitsuba.Mesh("parts", len(mesh.vertices), len(mesh.faces), has_vertex_normals=True)
        values = mitsuba.traverse(shape)
        values["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
        values["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
        values["faces"] = mesh.faces.astype(np.uint32).ravel()
        values.update()
        self.scene = mitsuba.load_dict({"type": "scene", "parts": shape})

    def _vector(self, points: np.ndarray):
        return self.mi.Vector3f(*(points[:, i].astype(np.float32) for i in range(3)))

    def hit(self, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return depth (inf where nothing is hit), shading and geometric normals, and part index (-1) per ray."""
        unit = office.normalized(rays)
        ray = self.mi.Ray3f(self.mi.Point3f(0.0), self._vector(unit))
        si = self.scene.ray_intersect(ray)
        valid = np.array(si.is_valid())
        depth = np.where(valid, np.array(si.t, dtype=float) * unit[:, 2], np.inf)
        flat = np.array(si.n, dtype=float).T
        smooth = office.normalized(np.array(si.sh_frame.n, dtype=float).T)
        flat[np.sum(flat * unit, 1) > 0] *= -1.0
        smooth[np.sum(flat * smooth, 1) < 0] *= -1.0
        # Interpolated normals may turn away from the camera at a silhouette; the triangle's own normal cannot.
        smooth = np.where((np.sum(smooth * unit, 1) < 0)[:, None], smooth, flat)
        face = np.minimum(np.array(si.prim_index), len(self.part_of_face) - 1)
        part = np.where(valid, self.part_of_face[face], -1)
        return depth, smooth, flat, part

    def occluded(self, points: np.ndarray, flat: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Whether the way from each point to the target is blocked, starting 0.2 mm off the surface."""
        origin = points + 2e-4 * flat
        way = target - origin
        distance = np.linalg.norm(way, axis=1)
        ray = self.mi.Ray3f(
            self.mi.Point3f(self._vector(origin)),
            self._vector(way / distance[:, None]),
            self.mi.Float((distance - 1e-4).astype(np.float32)),
            self.mi.Float(0.0),
            [],
        )
        return np.array(self.scene.ray_test(ray))


@dataclass
class Surface:
    """What the camera sees of one tracer: full-precision buffers, one row per pixel."""

    depth: np.ndarray
    normal: np.ndarray
    flat: np.ndarray
    part: np.ndarray
    albedo: np.ndarray
    material: np.ndarray


def shade(tracer: Tracer, camera: Camera, camera_pose: np.ndarray, supersampling: int = 4) -> Surface:
    """Trace the pixel centres; textures are averaged over the pixel's footprint on the tangent plane."""
    rays = camera.rays()
    depth, normal, flat, part = tracer.hit(rays)
    albedo = np.zeros(len(rays))
    material = np.zeros(len(rays), dtype=int)
    steps = (np.arange(supersampling) + 0.5) / supersampling - 0.5
    for index, piece in enumerate(tracer.parts):
        seen = np.flatnonzero(part == index)
        if not len(seen):
            continue
        surface = office.MATERIAL_BY_NAME[piece.material]
        material[seen] = surface.id
        albedo[seen] = surface.albedo
        if piece.texture is None:
            continue
        local_from_camera = np.linalg.inv(camera_pose @ piece.pose)
        center, facing = rays[seen] * depth[seen, None], flat[seen]
        total = np.zeros(len(seen))
        for shift_x in steps:
            for shift_y in steps:
                ray = rays[seen] + [shift_x / camera.focal, shift_y / camera.focal, 0.0]
                # Close to grazing the footprint would run off to infinity: it ends 1 cm from the centre.
                slope = np.minimum(np.sum(facing * ray, 1), -1e-3)
                point = ray * (np.sum(facing * center, 1) / slope)[:, None]
                way = point - center
                point = center + way * np.minimum(1.0, 0.01 / np.maximum(np.linalg.norm(way, axis=1), 1e-9))[:, None]
                total += piece.texture(office.apply(local_from_camera, point))
        albedo[seen] *= total / supersampling**2
    return Surface(depth, normal, flat, part, np.clip(albedo, 0.0, 1.0), material)


def nearest(still: Surface, moving: Surface) -> tuple[Surface, np.ndarray]:
    """Join two surfaces by depth; also say where the moving one is seen."""
    front = moving.depth < still.depth
    pick = {
        name: np.where(
            front[:, None] if getattr(still, name).ndim == 2 else front, getattr(moving, name), getattr(still, name)
        )
        for name in Surface.__dataclass_fields__
    }
    return Surface(**pick), front


def lit(surface: Surface, rays: np.ndarray, tracers: list[Tracer], laser: np.ndarray) -> np.ndarray:
    """1 where the laser sees the surface, 0 where something stands between or the surface faces away from it."""
    hit = np.isfinite(surface.depth)
    points = rays[hit] * surface.depth[hit, None]
    flat, way = surface.flat[hit], laser - points
    blocked = (np.sum(flat * way, 1) <= 0) | (np.sum(surface.normal[hit] * way, 1) <= 0)
    for tracer in tracers:
        blocked |= tracer.occluded(points, flat, laser)
    visible = np.zeros(len(rays))
    visible[hit] = ~blocked
    return visible


def to_channels(surface: Surface, visibility: np.ndarray, refresh: np.ndarray, camera: Camera) -> dict[str, np.ndarray]:
    shape = (camera.height, camera.width)
    hit = np.isfinite(surface.depth)
    planes = {
        "Z": np.where(hit, surface.depth, 0.0),
        **{f"N.{axis}": np.where(hit, surface.normal[:, i], 0.0) for i, axis in enumerate("XYZ")},
        "albedo": surface.albedo,
        "visibility": visibility,
        "material": surface.material,
        "refresh": refresh,
    }
    return {
        name: (planes[name] + 0.0).astype(np.float32 if name == "Z" else np.float16).reshape(shape) for name in CHANNELS
    }


def write_frame(path: Path, channels: dict[str, np.ndarray]) -> None:
    """Write one EXR beside `path` and rename it, so that a broken run leaves no half file under its name."""
    part = path.with_name(path.name + ".part")
    try:
        # Uncompressed: the archive then finds what consecutive frames share.
        header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, dict(channels)).write(str(part))
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def read_frame(path: Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as stored:
        return {name: channel.pixels for name, channel in stored.channels().items()}


def write_archive(path: Path, frames: list[Path]) -> None:
    """Pack the frames as .tar.xz with nothing in it that differs between two runs (owner, time)."""
    part = path.with_name(path.name + ".part")
    # The dictionary spans all frames of the default sequence, so that a still surface is stored once.
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "dict_size": 1 << 26}]
    try:
        with lzma.open(part, "wb", filters=filters) as stream, tarfile.open(fileobj=stream, mode="w") as archive:
            for frame in frames:
                entry = tarfile.TarInfo(frame.name)
                entry.size = frame.stat().st_size
                with frame.open("rb") as content:
                    archive.addfile(entry, content)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def row_major(pose: np.ndarray) -> list[float]:
    """The 12 numbers of a 3x4 matrix, row by row."""
    return [round(float(value), 9) + 0.0 for value in pose[:3].ravel()]


def describe(camera: Camera, frames: list[str], mug_poses: list[np.ndarray]) -> dict[str, object]:
    return {
        "format": FORMAT_NAME,
        "version": FORMAT_VERSION,
        "width": camera.width,
        "height": camera.height,
        "frame_rate_hz": office.FRAME_RATE_HZ,
        "frames": frames,
        "camera": {
            "fx_px": camera.focal,
            "fy_px": camera.focal,
            "cx_px": camera.center[0],
            "cy_px": camera.center[1],
            "f_number": F_NUMBER,
            "pixel_pitch_m": PIXEL_PITCH_M,
        },
        "laser": {
            "wavelength_m": WAVELENGTH_M,
            "laser_from_geometry": row_major(office.translation(-BASELINE_M, 0.0, 0.0)),
            "pattern": {
                "file": "pattern.png",
                "projection": "tangent_plane",
                "quantity": "radiant_intensity",
                "half_extent_x": make_pattern.HALF_EXTENT_X,
                "half_extent_y": make_pattern.HALF_EXTENT_Y,
            },
        },
        "materials": [{"id": m.id, "name": m.name, "albedo": m.albedo, "living": m.living} for m in office.MATERIALS],
        "moving_objects": [
            {
                "name": "mug",
                "material_ids": [office.MATERIAL_BY_NAME[part.material].id for part in office.mug_parts()],
                "geometry_from_object": [row_major(pose) for pose in mug_poses],
            }
        ],
    }


def flood_image(surface: Surface, rays: np.ndarray, camera: Camera, tracers: list[Tracer]) -> np.ndarray:
    """A uint16 image of the scene under a soft infrared floodlight: albedo * (ambient occlusion + a lamp overhead)."""
    hit = np.isfinite(surface.depth)
    points, flat, normal = rays[hit] * surface.depth[hit, None], surface.flat[hit], surface.normal[hit]
    rng = np.random.default_rng(1)
    samples = 48
    sky = np.zeros(len(points))
    for _ in range(samples):
        # Cosine-weighted: the normal plus a uniform unit vector.
        way = office.normalized(normal + 0.999 * office.normalized(rng.normal(size=normal.shape)))
        open_sky = np.ones(len(points), dtype=bool)
        for tracer in tracers:
            open_sky &= ~tracer.occluded(points, flat, points + 0.6 * way)
        sky += open_sky
    lamp = office.apply(camera_from_world(), np.array([[-0.5, -1.6, 1.7]]))[0]
    lamp_light = np.zeros(len(points))
    for _ in range(16):
        target = lamp + 0.25 * rng.normal(size=3)
        way = target - points
        distance = np.linalg.norm(way, axis=1)
        light = np.maximum(np.sum(normal * way, 1) / distance, 0.0) * (2.0 / distance) ** 2
        for tracer in tracers:
            light *= ~tracer.occluded(points, flat, target)
        lamp_light += light / 16
    image = np.zeros(len(rays))
    image[hit] = surface.albedo[hit] * (0.55 * sky / samples + 0.6 * lamp_light)
    return (np.clip(image, 0.0, 1.0) ** (1 / 2.2) * 65535).astype(np.uint16).reshape(camera.height, camera.width)


def planarity_mm(surface: Surface, rays: np.ndarray, tracer: Tracer, name: str) -> float:
    """Largest distance of the named part's up- or forward-facing points from their common plane, in millimetres."""
    index = [part.name for part in tracer.parts].index(name)
    seen = surface.part == index
    points, normal = rays[seen] * surface.depth[seen, None], surface.flat[seen]
    level = np.sum(normal * np.median(normal, 0), 1) > 0.9999
    points = points[level]
    center = points.mean(0)
    axes = np.linalg.svd(points - center, full_matrices=False)[2]
    return 1e3 * float(np.abs((points - center) @ axes[2]).max())


def render(camera: Camera, frame_count: int, output: Path, variant: str, preview: Path | None, archive: bool) -> None:
    mitsuba = load_mitsuba(variant)
    output.mkdir(parents=True, exist_ok=True)
    # The description is removed first and written last, so a folder that has one holds a complete sequence.
    (output / "sequence.json").unlink(missing_ok=True)
    (output / ARCHIVE_NAME).unlink(missing_ok=True)
    pose = camera_from_world()
    rays = camera.rays()
    laser = np.array([BASELINE_M, 0.0, 0.0])
    living = np.zeros(1 + max(m.id for m in office.MATERIALS), dtype=bool)
    living[[m.id for m in office.MATERIALS if m.living]] = True

    print("building the scene")
    still_tracer = Tracer(mitsuba, office.static_parts(), pose)
    still = shade(still_tracer, camera, pose)
    for name in ("wall", "desk_top"):
        flatness = planarity_mm(still, rays, still_tracer, name)
        print(f"{name}: {flatness:.5f} mm from a plane")
        if flatness > 0.01:
            raise SystemExit(f"render_gbuffers: {name} should be plane to 0.01 mm but is off by {flatness:.4f} mm")

    frames: list[str] = []
    mug_poses: list[np.ndarray] = []
    seen_before = np.zeros(len(rays), dtype=bool)
    for number in range(frame_count):
        mug_pose = office.mug_pose(number)
        mug_parts = office.mug_parts()
        for part in mug_parts:
            part.pose = mug_pose
        mug_tracer = Tracer(mitsuba, mug_parts, pose)
        surface, mug_seen = nearest(still, shade(mug_tracer, camera, pose))
        tracers = [still_tracer, mug_tracer]
        # The mug is the only thing that moves, so the pixels that show another surface than before are those where it
        # is seen now (all its points moved) or was seen in the previous frame (disocclusion). Its moving shadow changes
        # the light but not the surface, and no phase.
        moved = mug_seen | seen_before if number else np.ones(len(rays), dtype=bool)
        refresh = moved | living[surface.material]
        channels = to_channels(surface, lit(surface, rays, tracers, laser), refresh, camera)
        path = output / f"frame_{number:04d}.exr"
        write_frame(path, channels)
        stored = read_frame(path)
        for name in CHANNELS:
            if stored[name].dtype != channels[name].dtype or not np.array_equal(stored[name], channels[name]):
                raise SystemExit(f"render_gbuffers: {path}: channel {name} does not read back as written")
        print(f"{path.name}: {path.stat().st_size} bytes, {int(mug_seen.sum())} pixels of mug")
        if preview is not None:
            preview.mkdir(parents=True, exist_ok=True)
            image = flood_image(surface, rays, camera, tracers)
            make_pattern.write_png(preview / f"flood_{number:04d}.png", image)
        frames.append(path.name)
        mug_poses.append(pose @ mug_pose)
        seen_before = mug_seen

    if archive:
        write_archive(output / ARCHIVE_NAME, [output / name for name in frames])
    make_pattern.write_pattern(output / "pattern.png")
    write_text(output / "sequence.json", json.dumps(describe(camera, frames, mug_poses), indent=2) + "\n")


# ---------------------------------------------------------------------------------------------------------------------
# The check works on the files alone and needs no renderer.


def check(folder: Path) -> list[str]:
    """Return what is wrong with a sequence; an empty list means it is sound."""
    # Not at the top: rendering does not need it.
    from clspeckle._json_file import read_json

    wrong: list[str] = []

    def expect(condition: bool, message: str) -> None:
        if not condition:
            wrong.append(message)

    try:
        about = read_json(folder / "sequence.json")
    except (OSError, ValueError) as error:
        return [f"{folder / 'sequence.json'}: {error}"]
    if (about.get("format"), about.get("version")) != (FORMAT_NAME, FORMAT_VERSION):
        return [f"{folder / 'sequence.json'}: expected {FORMAT_NAME} version {FORMAT_VERSION}"]
    shape = (about["height"], about["width"])
    view = about["camera"]
    y, x = np.indices(shape)
    rays = np.stack([(x - view["cx_px"]) / view["fx_px"], (y - view["cy_px"]) / view["fy_px"], np.ones(shape)], -1)
    laser_pose = np.array(about["laser"]["laser_from_geometry"]).reshape(3, 4)
    laser = -laser_pose[:, :3].T @ laser_pose[:, 3]
    ids = {entry["id"]: entry for entry in about["materials"]}
    living_ids = [key for key, entry in ids.items() if entry["living"]]
    moving_ids = [key for entry in about["moving_objects"] for key in entry["material_ids"]]
    corners = np.concatenate([part.mesh.vertices for part in office.mug_parts()])
    box = corners.min(0), corners.max(0)
    pattern = folder / about["laser"]["pattern"]["file"]
    expect(pattern.is_file(), f"{pattern} is missing")
    absent = [name for name in about["frames"] if not (folder / name).is_file()]
    archive = folder / ARCHIVE_NAME
    if absent:
        hint = f"; unpack them first: tar -xf {archive} -C {folder}" if archive.is_file() else ""
        return [*wrong, f"{folder}: {absent[0]} and {len(absent) - 1} more of the frames are missing{hint}"]
    if archive.is_file():
        try:
            with tarfile.open(archive) as packed:
                same = packed.getnames() == about["frames"] and all(
                    packed.extractfile(name).read() == (folder / name).read_bytes() for name in about["frames"]
                )
            expect(same, f"{archive}: does not hold the frames that lie beside it")
        except (tarfile.TarError, lzma.LZMAError, EOFError, OSError) as error:
            wrong.append(f"{archive}: cannot be read: {error}")

    before: dict[str, np.ndarray] | None = None
    for number, name in enumerate(about["frames"]):
        try:
            planes = read_frame(folder / name)
        except Exception as error:  # OpenEXR raises its own kinds for a missing or damaged file.
            wrong.append(f"{name}: cannot be read: {error}")
            break
        missing = [channel for channel in CHANNELS if channel not in planes]
        if missing:
            wrong.append(f"{name}: lacks the channels {', '.join(missing)}")
            continue
        if any(planes[channel].shape != shape for channel in CHANNELS):
            wrong.append(f"{name}: is not {shape[1]} x {shape[0]}")
            continue
        types_fit = all(planes[c].dtype == (np.float32 if c == "Z" else np.float16) for c in CHANNELS)
        expect(types_fit, f"{name}: Z must be float32 and the others half")
        planes = {channel: planes[channel].astype(float) for channel in CHANNELS}
        expect(all(np.isfinite(plane).all() for plane in planes.values()), f"{name}: has values that are not finite")
        depth, material = planes["Z"], planes["material"].astype(int)
        hit = depth > 0
        expect(bool((depth >= 0).all()), f"{name}: has negative depth")
        expect(depth[hit].min() > 0.6 and depth[hit].max() < 3.5, f"{name}: depth leaves 0.6 to 3.5 m")
        normal = np.stack([planes["N.X"], planes["N.Y"], planes["N.Z"]], -1)
        length = np.linalg.norm(normal, axis=-1)
        expect(np.abs(length[hit] - 1).max() < NORMAL_TOLERANCE, f"{name}: normals are not of unit length")
        away = np.sum(normal * rays, -1) / np.linalg.norm(rays, axis=-1)
        expect(away[hit].max() < NORMAL_TOLERANCE, f"{name}: normals face away from the camera")
        expect(bool(((planes["albedo"] > 0) & (planes["albedo"] <= 1))[hit].all()), f"{name}: albedo leaves (0, 1]")
        expect(bool(np.isin(planes["visibility"], (0, 1)).all()), f"{name}: visibility is neither 0 nor 1")
        expect(set(np.unique(material[hit])) <= set(ids), f"{name}: a material is not in the table")
        expect(not planes["visibility"][~hit].any(), f"{name}: the laser sees a pixel without a surface")
        way = laser - rays * depth[..., None]
        facing = np.sum(normal * way, -1) / np.linalg.norm(way, axis=-1)
        behind = (planes["visibility"] > 0) & (facing < -NORMAL_TOLERANCE)
        expect(not behind.any(), f"{name}: {int(behind.sum())} pixels are lit from behind")
        expect(
            0.5 < planes["visibility"][hit].mean() < 0.99, f"{name}: the laser sees next to nothing, or no shadow falls"
        )

        moving = np.isin(material, moving_ids)
        living = np.isin(material, living_ids)
        if before is None:
            expected = np.ones(shape, dtype=bool)
        else:
            was_moving = np.isin(before["material"].astype(int), moving_ids)
            expected = moving | was_moving | living
            changed = np.any([before[c] != planes[c] for c in ("Z", "N.X", "N.Y", "N.Z", "albedo", "material")], 0)
            expect(not (changed & (planes["refresh"] == 0)).any(), f"{name}: a surface changed under a kept phase")
            expect(moving.any() and not np.array_equal(moving, was_moving), f"{name}: nothing moved")
        expect(np.array_equal(planes["refresh"], expected), f"{name}: refresh is not exactly what moved or lives")

        # The points on a rigid object, taken back to its frame, must fit its box in every frame.
        for entry in about["moving_objects"]:
            own = np.array(entry["geometry_from_object"][number]).reshape(3, 4)
            seen = np.isin(material, entry["material_ids"])
            local = ((rays * depth[..., None])[seen] - own[:, 3]) @ own[:, :3]
            inside = ((local > box[0] - 1e-5) & (local < box[1] + 1e-5)).all()
            expect(bool(inside), f"{name}: points of the {entry['name']} are not where its pose puts it")

        wall = (material == office.MATERIAL_BY_NAME["wall_paint"].id) & hit
        points = (rays * depth[..., None])[wall]
        center = points.mean(0)
        axes = np.linalg.svd((points - center)[:: max(1, len(points) // 20000)], full_matrices=False)[2]
        expect(1e3 * np.abs((points - center) @ axes[2]).max() < 0.01, f"{name}: the wall is not plane to 0.01 mm")
        before = planes
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent / "gbuffers"
    parser.add_argument("--frames", type=int, default=8, help="number of frames, 1 to 20 (default: 8)")
    parser.add_argument("--width", type=int, default=640, help="image width in pixels (default: 640)")
    parser.add_argument("--height", type=int, default=480, help="image height in pixels (default: 480)")
    parser.add_argument("--output", type=Path, default=default, help="folder of the sequence (default: gbuffers/)")
    parser.add_argument("--variant", default="llvm_ad_rgb", help="Mitsuba variant (default: llvm_ad_rgb)")
    parser.add_argument("--preview", type=Path, help="also write floodlit images of the scene to this folder")
    parser.add_argument("--archive", action="store_true", help=f"also pack the frames into {ARCHIVE_NAME}")
    parser.add_argument("--check", action="store_true", help="only check the sequence in --output, render nothing")
    arguments = parser.parse_args()
    if not 1 <= arguments.frames <= 20:
        parser.error(f"--frames must lie in 1 to 20 (the mug's path ends there), got {arguments.frames}")
    for side in ("width", "height"):
        if not 64 <= getattr(arguments, side) <= 8192:
            parser.error(f"--{side} must lie in 64 to 8192, got {getattr(arguments, side)}")
    if not arguments.check:
        try:
            camera = Camera(arguments.width, arguments.height)
            render(camera, arguments.frames, arguments.output, arguments.variant, arguments.preview, arguments.archive)
        except OSError as error:
            print(f"render_gbuffers: cannot write to {arguments.output}: {error}", file=sys.stderr)
            return 1
    try:
        wrong = check(arguments.output)
    except KeyError as error:
        wrong = [f"{arguments.output / 'sequence.json'}: lacks the key {error}"]
    for line in wrong:
        print(f"render_gbuffers: {line}", file=sys.stderr)
    if not wrong:
        sizes = {path.name: path.stat().st_size for path in sorted(arguments.output.iterdir()) if path.is_file()}
        print(f"{arguments.output}: sound;", ", ".join(f"{name} {size}" for name, size in sizes.items()))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
