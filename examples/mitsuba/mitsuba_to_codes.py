#!/usr/bin/env python3
"""From a scene of Mitsuba 3 to the codes of a camera, in one call.

    python examples/mitsuba/mitsuba_to_codes.py -o codes                          # a scene that the script builds
    python examples/mitsuba/mitsuba_to_codes.py room.xml -o codes --f-number 5.6  # or yours
    record = codes_of(mitsuba.load_file("room.xml"), f_number=5.6)                # in Python

The scene's own light is the laser's: a `projector` beside the camera gives the dots, with shadows and what surfaces
reflect onto each other. Mitsuba renders that light, and depth, normals and albedo along one ray through the centre of
each pixel. clSpeckle makes codes of it.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from camera_view import Record, SceneError, View, random_dots, rays, record, write

# Mitsuba's camera axes (x left, y up, z forward) to ours (x right, y down, z forward).
OURS_FROM_MITSUBA = np.diag([-1.0, -1.0, 1.0])
CENTRE_TOLERANCE = 1e-3  # of the depth, between where a ray should end and where Mitsuba says that it does


def mitsuba(variant: str | None = None) -> Any:
    """The package, with a variant: that one, or the one that is set already, or scalar_rgb, which runs anywhere."""
    try:
        package = importlib.import_module("mitsuba")
    except ImportError as error:
        raise SceneError(f"Mitsuba 3 cannot be imported ({error}); install it: pip install mitsuba") from None
    if variant is not None and variant not in package.variants():
        raise SceneError(f"Mitsuba has no variant {variant!r}; it has {', '.join(package.variants())}")
    if variant is not None:
        package.set_variant(variant)
    elif package.variant() is None:
        package.set_variant("scalar_rgb")
    if not package.variant().endswith("_rgb"):
        raise SceneError(
            f"the variant {package.variant()} has spectra or polarization; expected scalar_rgb or llvm_ad_rgb, whose "
            "colors' mean is taken for the infrared light"
        )
    return package


def view_of(
    scene: Any,
    *,
    sensor: int = 0,
    samples: int = 16,
    seed: int = 0,
    metres_per_unit: float = 1.0,
    variant: str | None = None,
) -> View:
    """What a sensor of a scene sees.

    Args:
        scene: a ``mitsuba.Scene``, or a dict as ``mitsuba.load_dict`` takes it.
        sensor: its number in the scene; a ``perspective`` one. Its film's filter is left out: pixels are areas.
        samples: rays of a pixel for the light, at least 1.
        seed: of those rays, below 2^32.
        metres_per_unit: of lengths in the scene, above 0.
        variant: of Mitsuba, for example "scalar_rgb"; None: see :func:`mitsuba`.

    Raises:
        SceneError: Mitsuba is missing, or this scene or sensor is not one that can be taken; the message says why.
    """
    if samples < 1 or not 0 < metres_per_unit < float("inf"):
        raise SceneError(f"samples is {samples}, metres_per_unit {metres_per_unit}; expected at least 1, and above 0")
    if not 0 <= seed < 2**32:
        raise SceneError(f"seed is {seed}; expected 0 to 4294967295")
    mi = mitsuba(variant)
    if isinstance(scene, dict):
        try:
            scene = mi.load_dict(scene)
        except (RuntimeError, TypeError) as error:
            raise SceneError(f"Mitsuba does not load the scene: {error}") from None
    if not isinstance(scene, mi.Scene):
        raise SceneError(
            f"scene is a {type(scene).__name__}; expected a dict, or a scene that mitsuba.load_dict or load_file made "
            f"with the variant {mi.variant()}"
        )
    sensors = scene.sensors()
    if not 0 <= sensor < len(sensors):
        raise SceneError(f"sensor is {sensor}; the scene has {len(sensors)}, counted from 0")
    width, height, given, own, axes, place = _perspective(mi, sensors[sensor])
    fx = width / 2 / np.tan(np.radians(given["fov"]) / 2)
    # Pixel 0 has its centre half a pixel from the film's edge. The offsets move the picture, in parts of its sides.
    cx = (width - 1) / 2 - given["principal_point_offset_x"] * width
    cy = (height - 1) / 2 - given["principal_point_offset_y"] * height
    intrinsics = (float(fx), float(fx), float(cx), float(cy))

    # Without jitter the one ray of a pixel goes through its centre: depth and normals are of one point.
    centres = mi.load_dict({**own, "sampler": {"type": "stratified", "sample_count": 1, "jitter": False}})
    aovs = mi.load_dict(
        {"type": "aov", "aovs": "depth:depth,place:position,facet:geo_normal,normal:sh_normal,albedo:albedo"}
    )
    seen = np.array(mi.render(scene, sensor=centres, integrator=aovs, spp=1), np.float64)
    distance, position, facet, normal, albedo = np.split(seen, (1, 4, 7, 10), axis=-1)
    hit = distance[..., 0] > 0
    if not hit.any():
        raise SceneError("the sensor sees no surface; check its to_world, near_clip and far_clip")
    # Mitsuba's own depth is a distance along the ray, from the near plane on. Positions tell what is wanted.
    position = (position - place) @ axes.T * metres_per_unit
    depth = np.where(hit, position[..., 2], 0.0)
    way = rays(depth.shape, intrinsics)
    off = np.linalg.norm(way * depth[..., None] - position, axis=-1)[hit] / depth[hit]
    if off.max() > CENTRE_TOLERANCE:
        raise SceneError(
            f"rays miss the pixels' centres, by up to {off.max():.2%} of the depth; is the sensor animated?"
        )
    # Of a surface's two sides the camera sees one.
    facet, normal = facet @ axes.T, normal @ axes.T
    side = -np.sign((facet * way).sum(axis=-1, keepdims=True))

    integrator = scene.integrator() or mi.load_dict({"type": "path", "max_depth": 8})
    light = mi.load_dict({**own, "sampler": {"type": "multijitter", "sample_count": samples}})
    image = np.array(mi.render(scene, sensor=light, integrator=integrator, spp=samples, seed=seed), np.float64)
    ideal = image[..., :3].mean(axis=-1)
    bad = int((~np.isfinite(ideal)).sum())
    if bad:
        raise SceneError(f"{bad} pixels have light that is not finite; check the materials")
    return View(
        intrinsics,
        depth.astype(np.float32),
        np.where(hit[..., None], side * normal, 0.0).astype(np.float32),
        np.clip(albedo.mean(axis=-1), 0.0, 1.0).astype(np.float32),
        np.maximum(ideal, 0.0).astype(np.float32),
    )


def _perspective(mi: Any, sensor: Any) -> tuple[int, int, dict[str, float], dict[str, Any], np.ndarray, np.ndarray]:
    """A pinhole sensor: its size, numbers, the dict of one like it, our axes in the world, and its place."""
    parameters = mi.traverse(sensor)
    kind = sensor.class_name()
    if kind != "PerspectiveCamera":
        instead = "; a thin lens blurs, which defocus_waves does here" if kind == "ThinLensCamera" else ""
        raise SceneError(f"the sensor is a {kind}; expected a perspective one{instead}")
    film = sensor.film()
    (width, height), (crop_width, crop_height) = (map(int, size) for size in (film.size(), film.crop_size()))
    if (width, height) != (crop_width, crop_height):
        raise SceneError(
            f"the film is cropped to {crop_width} x {crop_height} of {width} x {height} pixels; render the whole film"
        )
    numbers = {
        name: float(np.array(parameters[key]).ravel()[0])
        for name, key in (
            ("fov", "x_fov"),
            *((f"principal_point_offset_{axis}",) * 2 for axis in "xy"),
            *((f"{side}_clip",) * 2 for side in ("near", "far")),
        )
    }
    pose = np.array(parameters["to_world"].matrix, np.float64).reshape(4, 4)
    turn = pose[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > 1e-4 or np.linalg.det(turn) < 0:
        raise SceneError("the sensor's to_world scales, shears or mirrors; expected a rotation and a translation")
    own = {
        "type": "perspective",
        **numbers,
        "fov_axis": "x",
        "to_world": mi.ScalarTransform4f(pose),
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
    }
    return width, height, numbers, own, OURS_FROM_MITSUBA @ turn.T, pose[:3, 3]


def codes_of(
    scene: Any,
    *,
    sensor: int = 0,
    samples: int = 16,
    seed: int = 0,
    metres_per_unit: float = 1.0,
    variant: str | None = None,
    **camera: Any,
) -> Record:
    """The codes that a camera records of a scene: :func:`view_of`, then :func:`camera_view.record` with `camera`."""
    view = view_of(scene, sensor=sensor, samples=samples, seed=seed, metres_per_unit=metres_per_unit, variant=variant)
    return record([view], seed=seed, **camera)[0]


def sample_scene(width: int = 640, height: int = 480, dots: int = 3000, seed: int = 1) -> dict[str, Any]:
    """A ball and a box before a wall, seen by a camera at the origin, lit by a projector of dots 75 mm to its right.

    The world's axes are those of the camera: x right, y down, z forward, metres.
    """
    mi = mitsuba()
    image = np.repeat(random_dots(dots, seed, 1024, 768, 1.5)[..., None], 3, axis=-1)
    transform = mi.ScalarTransform4f

    def look(x: float) -> Any:
        return transform().look_at(origin=[x, 0, 0], target=[x, 0, 1], up=[0, -1, 0])

    def diffuse(albedo: float) -> dict[str, Any]:
        return {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}

    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "sensor": {
            "type": "perspective",
            "fov": 60,
            "near_clip": 0.05,
            "to_world": look(0.0),
            "film": {"type": "hdrfilm", "width": width, "height": height},
        },
        "projector": {
            "type": "projector",
            "fov": 70,
            "irradiance": {"type": "bitmap", "bitmap": mi.Bitmap(image), "raw": True},
            "to_world": look(0.075),
        },
        "wall": {
            "type": "rectangle",
            "to_world": transform().translate([0, 0, 1.5]).scale(3).rotate([1, 0, 0], 180),
            "bsdf": diffuse(0.6),
        },
        "ball": {"type": "sphere", "center": [-0.15, 0.05, 0.9], "radius": 0.15, "bsdf": diffuse(0.8)},
        "box": {
            "type": "cube",
            "to_world": transform().translate([0.25, 0.15, 1.1]).rotate([0, 1, 0], 30).scale(0.1),
            "bsdf": diffuse(0.4),
        },
    }


def matplotlib_figure() -> Any:
    """Matplotlib's class of figures."""
    try:
        return importlib.import_module("matplotlib.figure").Figure
    except ImportError as error:
        raise SceneError(f"a figure needs matplotlib ({error}); install it: pip install matplotlib") from None


def figure(result: Record, path: Path) -> None:
    """Depth, normals, light and codes, side by side."""
    view = result.view
    sheet = matplotlib_figure()(figsize=(12, 2.7), layout="constrained")
    axes = sheet.subplots(1, 4)
    shown = axes[0].imshow(np.where(view.depth > 0, view.depth, np.nan), cmap="viridis")
    sheet.colorbar(shown, ax=axes[0], label="m")
    axes[1].imshow(np.clip((1 - view.normal * (-1, 1, 1)) / 2, 0, 1))
    axes[2].imshow(view.ideal, cmap="gray", vmax=np.percentile(view.ideal, 99.5))
    axes[3].imshow(result.codes, cmap="gray", vmax=np.percentile(result.codes, 99.5))
    for axis, title in zip(axes, ("depth", "normals", "Mitsuba's light", "clSpeckle's codes")):
        axis.set(xticks=[], yticks=[], title=title)
    sheet.savefig(path, dpi=80)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", type=Path, nargs="?", help="Mitsuba's XML file; none: a scene of the script's own")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder of codes, light, depth, normals, albedo"
    )
    parser.add_argument("--variant", help="Mitsuba's, for example llvm_ad_rgb (default: scalar_rgb)")
    parser.add_argument("--sensor", type=int, default=0, help="number of the scene's sensor (default: 0)")
    parser.add_argument("--samples", type=int, default=16, help="rays of a pixel (default: 16)")
    parser.add_argument("--metres-per-unit", type=float, default=1.0, help="of the scene's lengths (default: 1)")
    parser.add_argument("--size", type=int, nargs=2, default=(640, 480), help="of the own scene (default: 640 480)")
    parser.add_argument("--seed", type=int, default=0, help="of rays, speckle and noise, below 2^32 (default: 0)")
    parser.add_argument("--f-number", type=float, default=5.6, help="of the camera's lens (default: 5.6)")
    parser.add_argument("--degree-of-polarization", type=float, default=0.0, help="0 to 1 (default: 0)")
    parser.add_argument("--figure", type=Path, help="write a picture of the result; needs matplotlib")
    given = parser.parse_args()
    import clspeckle

    try:
        if given.figure:
            matplotlib_figure()  # before the rendering, which takes long
        mi = mitsuba(given.variant)
        if given.scene is None:
            scene: Any = sample_scene(*given.size)
        elif not given.scene.is_file():
            raise SceneError(f"{given.scene} is not a file")
        else:
            try:
                scene = mi.load_file(str(given.scene))
            except RuntimeError as error:
                raise SceneError(f"{given.scene}: Mitsuba does not load it: {error}") from None
        result = codes_of(
            scene,
            sensor=given.sensor,
            samples=given.samples,
            seed=given.seed,
            metres_per_unit=given.metres_per_unit,
            f_number=given.f_number,
            degree_of_polarization=given.degree_of_polarization,
        )
        write(given.output, [result], {"source": f"Mitsuba {mi.__version__}, {mi.variant()}"})
        if given.figure:
            figure(result, given.figure)
    except (SceneError, OSError, clspeckle.errors.ClspeckleError) as error:
        print(f"mitsuba_to_codes: {error}", file=sys.stderr)
        return 1
    seen = result.view.depth[result.view.depth > 0]
    print(
        f"{given.output}: {result.codes.shape[1]} x {result.codes.shape[0]} pixels, depth {seen.min():.3f} to "
        f"{seen.max():.3f} m, codes {result.codes.min()} to {result.codes.max()}, "
        f"exposure gain {result.camera['exposure_gain_dn']:.4g} DN"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
