"""Writes camera codes of what BlenderProc's renderer returns, beside its own writers (write_hdf5, write_bop).

    bproc.renderer.enable_depth_output(activate_antialiasing=False)
    bproc.renderer.enable_normals_output()
    bproc.renderer.set_output_format(view_transform="Standard")     # the default, "Filmic", bends the light
    data = bproc.renderer.render()
    write_codes("codes", data, bproc.camera.get_intrinsics_as_K_matrix(), f_number=5.6)

With BlenderProc's projector among the lights `colors` are the light that the camera receives. With a
:class:`clspeckle.Pattern` they are left aside: the pattern lights depth, normals and albedo (`diffuse`).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from camera_view import SceneError, View, rays, record, write

if TYPE_CHECKING:
    import clspeckle

LARGEST_DEPTH = 1e9  # Blender writes 1e10 where there is no surface.


def linear(colors: np.ndarray) -> np.ndarray:
    """Mean of R, G, B as light: codes of 8 bits after the curve of sRGB, floats as they are."""
    values = np.asarray(colors)[..., :3]
    if values.dtype == np.uint8:
        values = values / 255.0
        values = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    elif values.dtype.kind != "f":
        raise SceneError(f"colors have dtype {values.dtype}; expected uint8, or floats of an EXR")
    return values.mean(axis=-1)


def views_of(
    data: Mapping[str, Sequence[Any]], intrinsics: Any, *, with_light: bool = True, metres_per_unit: float = 1.0
) -> list[View]:
    """The frames of a renderer's dict.

    Args:
        data: lists of one length. "depth", (height, width), along the axis, or "distance", along the rays; "normals",
            (height, width, 3), 0 to 1, as ``enable_normals_output`` writes them; "colors", (height, width, 3 or 4),
            uint8 or float; "diffuse" likewise, the albedo.
        intrinsics: the 3 x 3 matrix K, or fx, fy, cx, cy, in pixels.
        with_light: whether "colors" are the light; else the views bring none, and "diffuse" is needed.
        metres_per_unit: of depths, above 0.

    Raises:
        SceneError: what is missing or of another form, and which call brings it.
    """
    camera = np.asarray(intrinsics, float)
    if camera.shape == (3, 3) and camera[0, 1] == 0:
        camera = camera[[0, 1, 0, 1], [0, 1, 2, 2]]
    if camera.shape != (4,) or not np.isfinite(camera).all() or (camera[:2] <= 0).any():
        raise SceneError("intrinsics are no K matrix without skew; give bproc.camera.get_intrinsics_as_K_matrix()")
    if not 0 < metres_per_unit < float("inf"):
        raise SceneError(f"metres_per_unit is {metres_per_unit}; expected a finite number above 0")
    if "depth" not in data and "distance" not in data:
        raise SceneError("data has no depth; call bproc.renderer.enable_depth_output(activate_antialiasing=False)")
    far = "depth" if "depth" in data else "distance"
    needed = {
        "normals": "enable_normals_output()",
        **({} if with_light else {"diffuse": "enable_diffuse_color_output()"}),
    }
    for key, call in needed.items():
        if key not in data:
            raise SceneError(f"data has no {key}; call bproc.renderer.{call}")
    if with_light and "colors" not in data:
        raise SceneError("data has no colors, which are the light; give a pattern in their place")
    keys = [far, "normals", *(("colors",) if with_light else ()), *(("diffuse",) if "diffuse" in data else ())]
    counts = {key: len(data[key]) for key in keys}
    if len(set(counts.values())) != 1 or not counts[far]:
        raise SceneError(f"data has {counts} frames; expected lists of one length, at least 1")
    return [
        _view(number, {key: np.asarray(data[key][number]) for key in keys}, camera, far, with_light, metres_per_unit)
        for number in range(counts[far])
    ]


def _view(
    number: int, frame: dict[str, np.ndarray], camera: np.ndarray, far: str, with_light: bool, scale: float
) -> View:
    shape = frame[far].shape
    for key, image in frame.items():
        if (
            image.ndim != (2 if key == far else 3)
            or image.shape[:2] != shape
            or image.shape[2:] not in ((), (3,), (4,))
        ):
            raise SceneError(
                f"frame {number}: {key} has shape {image.shape}; expected (height, width) of {far} and (height, width, "
                "3) of others, one size for all. Of a stereo pair give one side: [sides[0] for sides in data[key]]"
            )
    intrinsics = tuple(float(value) for value in camera)
    depth = frame[far].astype(float)
    hit = (depth > 0) & (depth < LARGEST_DEPTH)
    if far == "distance":
        depth = depth / np.linalg.norm(rays(shape, intrinsics), axis=-1)
    normals = frame["normals"][..., :3].astype(float)
    if normals.min() < -1e-3 or normals.max() > 1 + 1e-3:
        raise SceneError(
            f"frame {number}: normals are {normals.min():.3g} to {normals.max():.3g}; expected 0 to 1, as "
            "enable_normals_output() writes them"
        )
    # 0 to 1 are -1 to 1 in Blender's camera: x right, y up, z backward.
    normals = (2 * normals - 1) * (1, -1, -1)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    albedo = linear(frame["diffuse"]) if "diffuse" in frame else np.ones(shape)
    return View(
        intrinsics,
        np.where(hit, depth * scale, 0.0).astype(np.float32),
        np.where(hit[..., None], normals / np.maximum(length, 1e-6), 0.0).astype(np.float32),
        np.clip(albedo, 0.0, 1.0).astype(np.float32),
        linear(frame["colors"]).astype(np.float32) if with_light else None,
    )


def write_codes(
    folder: str | Path,
    data: Mapping[str, Sequence[Any]],
    intrinsics: Any,
    *,
    pattern: clspeckle.Pattern | None = None,
    seed: int = 0,
    metres_per_unit: float = 1.0,
    **camera: Any,
) -> list[Path]:
    """Codes of all frames, with light, depth, normals and albedo, into a folder; the files.

    Args:
        folder: made if it is not there; what it holds of an earlier call is replaced.
        data, intrinsics, metres_per_unit: as for :func:`views_of`.
        pattern: lights the scene; None: "colors" are the light.
        seed: of speckle and noise.
        **camera: :class:`clspeckle.PipelineParameters`.
    """
    views = views_of(data, intrinsics, with_light=pattern is None, metres_per_unit=metres_per_unit)
    return write(Path(folder), record(views, pattern=pattern, seed=seed, **camera), {"source": "BlenderProc"})
