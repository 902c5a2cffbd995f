"""Files of a G-buffer sequence, for scripts that bring scenes from elsewhere: frames, pattern, dots.txt, sequence.json.

Everything is in the camera's frame: x right, y down, z forward, metres; integer coordinates are pixel centres. Folders
are written so that one that has a sequence.json holds a complete sequence.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from camera_view import SceneError, rays

F_NUMBER = 5.6
PIXEL_PITCH_M = 2.9e-6
WAVELENGTH_M = 940e-9
LARGEST_PATTERN = 8192  # texels along a side
MOST_DOTS = 16384  # that `clspeckle depth` takes
DOT_SIGMA_TEXELS = 2.5


@dataclass(frozen=True)
class Camera:
    """A pinhole without distortion."""

    width: int
    height: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float

    def rays(self) -> np.ndarray:
        """(height, width, 3), z = 1, through the pixel centres."""
        return rays((self.height, self.width), (self.fx_px, self.fy_px, self.cx_px, self.cy_px))


@dataclass(frozen=True)
class Dots:
    """A pattern of `count` dots in the laser's tangent plane; `texel` is the side of a texel there."""

    half_extent_x: float
    half_extent_y: float
    texel: float
    count: int
    seed: int = 940

    @property
    def shape(self) -> tuple[int, int]:
        return round(2 * self.half_extent_y / self.texel), round(2 * self.half_extent_x / self.texel)


@dataclass(frozen=True)
class Rounding:
    """Of a frame that is to be kept small: depth to so many bits of its mantissa, at most 16; others to parts of 1."""

    depth_bits: int
    normal_steps: int
    albedo_steps: int

    def __call__(self, channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        result = dict(channels)
        mantissa, exponent = np.frexp(channels["Z"])
        result["Z"] = np.ldexp(np.round(np.ldexp(mantissa, self.depth_bits)), exponent - self.depth_bits)
        result["albedo"] = np.round(channels["albedo"] * self.albedo_steps) / self.albedo_steps
        # Two components are rounded, the third follows, rounded down: none may be longer than 1.
        x, y = (np.round(channels[name] * self.normal_steps) / self.normal_steps for name in ("N.X", "N.Y"))
        x, y = (part / np.maximum(np.hypot(x, y), 1.0) for part in (x, y))
        result["N.X"], result["N.Y"] = x, y
        z = np.floor(np.sqrt(np.maximum(1 - x**2 - y**2, 0.0)) * 2 * self.normal_steps) / (2 * self.normal_steps)
        result["N.Z"] = np.where(channels["Z"] > 0, np.copysign(z, channels["N.Z"]), 0.0)
        return result


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Writes beside the path and renames, so that a broken run leaves no half file under the name."""
    part = path.with_name(path.name + ".part")
    try:
        write(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_frame(path: Path, channels: Mapping[str, np.ndarray], rounding: Rounding | None = None) -> None:
    """One EXR; Z stays float32, the other channels become halves."""
    if rounding is not None:
        channels = rounding(channels)
    planes = {
        name: np.ascontiguousarray(plane + 0.0, np.float32 if name == "Z" else np.float16)
        for name, plane in channels.items()
    }
    # PXR24 keeps 24 bits of a float, all that a rounded depth has.
    compression = OpenEXR.ZIP_COMPRESSION if rounding is None else OpenEXR.PXR24_COMPRESSION
    header = {"compression": compression, "type": OpenEXR.scanlineimage}
    write_whole(path, lambda part: OpenEXR.File(header, planes).write(str(part)))


def read_channels(path: Path) -> dict[str, np.ndarray]:
    """All channels of an EXR by name."""
    if not path.is_file():
        raise SceneError(f"{path} is not a file")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as stored:
            return {name: channel.pixels for name, channel in stored.channels().items()}
    except Exception as error:  # OpenEXR raises RuntimeError, and others for damaged files.
        raise SceneError(f"{path} is not a readable EXR file: {error}") from None


def write_pattern(folder: Path, dots: Dots) -> np.ndarray:
    """pattern.png, and the dots' directions (x/z, y/z in the laser's frame) as dots.txt for `clspeckle depth`."""
    # Not at the top: SciPy takes longer to load than a wrong option to refuse.
    sys.path.insert(0, str(Path(__file__).resolve().parent / "office"))
    import make_pattern

    height, width = dots.shape
    margin = 4.0 * DOT_SIGMA_TEXELS
    centres = make_pattern.dot_centers(dots.count, width, height, margin, dots.seed)
    centres = centres[np.lexsort(centres.T)]
    make_pattern.write_png(
        folder / "pattern.png", make_pattern.render_pattern(centres, width, height, DOT_SIGMA_TEXELS)
    )
    half = np.array([dots.half_extent_x, dots.half_extent_y])
    directions = half * (2 * (centres + 0.5) / np.array([width, height]) - 1)
    lines = "".join(f"{x:.6f} {y:.6f}\n" for x, y in directions)
    write_whole(folder / "dots.txt", lambda part: part.write_text(lines))
    return directions


def write_sequence(
    folder: Path,
    camera: Camera,
    laser_from_camera: np.ndarray,
    frames: Sequence[Mapping[str, np.ndarray]],
    dots: Dots,
    materials: Sequence[Mapping[str, object]] = (),
    source: str = "",
    rounding: Rounding | None = None,
) -> None:
    """Frames, pattern, dots.txt, and last sequence.json."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "sequence.json").unlink(missing_ok=True)
    names = [f"frame_{index:04d}.exr" for index in range(len(frames))]
    for name, channels in zip(names, frames):
        write_frame(folder / name, channels, rounding)
    write_pattern(folder, dots)
    about: dict[str, object] = {
        "format": "clspeckle-gbuffer-sequence",
        "version": 1,
        "source": source,
        "width": camera.width,
        "height": camera.height,
        "frames": names,
        "camera": {
            "fx_px": camera.fx_px,
            "fy_px": camera.fy_px,
            "cx_px": camera.cx_px,
            "cy_px": camera.cy_px,
            "f_number": F_NUMBER,
            "pixel_pitch_m": PIXEL_PITCH_M,
        },
        "laser": {
            "wavelength_m": WAVELENGTH_M,
            "laser_from_geometry": [round(float(value), 9) + 0.0 for value in laser_from_camera[:3].ravel()],
            "pattern": {
                "file": "pattern.png",
                "projection": "tangent_plane",
                "quantity": "radiant_intensity",
                "half_extent_x": dots.half_extent_x,
                "half_extent_y": dots.half_extent_y,
            },
        },
    }
    if materials:
        about["materials"] = list(materials)
    text = json.dumps(about, indent=1) + "\n"
    write_whole(folder / "sequence.json", lambda part: part.write_text(text, encoding="utf-8"))


def dots_for(camera: Camera, laser_from_camera: np.ndarray, near_m: float, spacing_px: float, sigma_px: float) -> Dots:
    """A pattern that fills the camera's view from `near_m` on, with dots of `sigma_px` about `spacing_px` apart."""
    corners = np.array([[x, y] for x in (-0.5, camera.width - 0.5) for y in (-0.5, camera.height - 0.5)])
    u = (corners - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)
    rays = np.concatenate([u, np.ones((4, 1))], axis=1)
    # Beyond near_m a point of a ray tends to the direction of the ray itself.
    near = near_m * rays @ laser_from_camera[:, :3].T + laser_from_camera[:, 3]
    far = rays @ laser_from_camera[:, :3].T
    if min(near[:, 2].min(), far[:, 2].min()) <= 0:
        raise SceneError(
            f"the laser stands behind what the camera sees, from {near_m:.3g} m on, or looks away from it: "
            "put it beside the camera"
        )
    seen = np.concatenate([near[:, :2] / near[:, 2:], far[:, :2] / far[:, 2:]])
    texel = sigma_px / DOT_SIGMA_TEXELS / camera.fx_px
    extent = np.ceil((np.abs(seen).max(axis=0) / texel + 5 * DOT_SIGMA_TEXELS) / 8) * 8 * texel
    density = (camera.fx_px / spacing_px) ** 2
    dots = Dots(float(extent[0]), float(extent[1]), float(texel), round(4 * extent.prod() * density))
    if max(dots.shape) > LARGEST_PATTERN or dots.count > MOST_DOTS:
        raise SceneError(
            f"a pattern that fills the view needs {dots.shape[1]} x {dots.shape[0]} texels and {dots.count} dots, "
            f"at most {LARGEST_PATTERN} and {MOST_DOTS} are possible: put the laser nearer to the camera, or take "
            "wider dots farther apart, or fewer pixels"
        )
    return dots
