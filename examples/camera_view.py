"""A renderer's view of a scene and what clSpeckle's camera records of it, for scripts that bring scenes from elsewhere.

Everything is in the camera's frame: x right, y down, z forward, metres; integer coordinates are pixel centres.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shutil
import struct
import tempfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import clspeckle


IMAGES = ("ideal", "depth", "normal", "albedo")


class SceneError(Exception):
    """What a user gave cannot be turned into a scene or its codes; the message says why and what would do."""


@dataclasses.dataclass(frozen=True, eq=False)
class View:
    """What one camera sees, all images (height, width)."""

    intrinsics: tuple[float, float, float, float]
    """fx, fy, cx, cy in pixels."""
    depth: np.ndarray
    """float32, metres along the optical axis; 0: no surface."""
    normal: np.ndarray
    """(height, width, 3) float32, unit length, of the side that the camera sees; 0 without a surface."""
    albedo: np.ndarray
    """float32, diffuse reflectance 0 to 1."""
    ideal: np.ndarray | None = None
    """float32, >= 0: the light that comes to the camera, without speckle; None: a pattern gives it."""

    def rays(self) -> np.ndarray:
        """(height, width, 3), z = 1, through the pixel centres."""
        return rays(self.depth.shape, self.intrinsics)

    def geometry(self, **more: Any) -> clspeckle.Geometry:
        """For :meth:`clspeckle.Pattern.lookup`; `more`: its other members, for example visibility."""
        import clspeckle

        return clspeckle.Geometry(
            depth=self.depth, intrinsics=self.intrinsics, normal=self.normal, albedo=self.albedo, **more
        )


def rays(shape: Sequence[int], intrinsics: Sequence[float]) -> np.ndarray:
    """(height, width, 3), z = 1, through the pixel centres of a pinhole camera."""
    fx, fy, cx, cy = intrinsics
    y, x = np.indices((shape[0], shape[1]))
    return np.stack([(x - cx) / fx, (y - cy) / fy, np.ones(y.shape)], axis=-1)


@dataclasses.dataclass(frozen=True, eq=False)
class Record:
    """A view with its codes."""

    view: View
    codes: np.ndarray
    """(height, width) uint16."""
    camera: dict[str, Any]
    """Parameters of :meth:`clspeckle.Pipeline.from_parameters`. Its ``render(view.ideal, frame_index=frame_index,
    refresh="all")`` gives these codes again."""
    frame_index: int
    """Counter of its speckle and noise."""


def record(
    views: Sequence[View], *, pattern: clspeckle.Pattern | None = None, seed: int = 0, **camera: Any
) -> list[Record]:
    """What a camera records of views, one frame after the other; each frame has speckle of its own.

    Args:
        views: of one size.
        pattern: gives the light of views that bring none.
        seed: of speckle and noise.
        **camera: :class:`clspeckle.PipelineParameters`. Without `exposure_gain_dn` the first view is exposed so that
            its 99.9th percentile has a mean of half of full scale, as ``clspeckle render --exposure-gain auto`` does.

    Raises:
        SceneError: no views, views of several sizes or with values that cannot be, or the first one is dark.
    """
    import clspeckle

    if not views:
        raise SceneError("there is no view; give at least one")
    shape = views[0].depth.shape
    for number, view in enumerate(views):
        if view.depth.shape != shape:
            raise SceneError(f"view {number} is of {view.depth.shape}, the first of {shape}; views must have one size")
        if pattern is None and view.ideal is None:
            raise SceneError(f"view {number} brings no light and there is no pattern; give one of them")
        for name, least in (("depth", 0), ("normal", -np.inf), ("albedo", 0), ("ideal", 0)):
            image = getattr(view, name)
            if image is not None and not (np.isfinite(image).all() and image.min() >= least):
                sign = "" if np.isinf(least) else ", at least 0"
                raise SceneError(
                    f"view {number}: {name} is {image.min():.3g} to {image.max():.3g}; expected finite numbers{sign}"
                )
    lit = [pattern.lookup(view.geometry()) if view.ideal is None else view.ideal for view in views]
    with clspeckle.Pipeline.from_parameters(shape, seed=seed, **camera) as pipeline:
        sensor = pipeline.sensor
        if "exposure_gain_dn" not in camera:
            bright = float(np.percentile(lit[0], 99.9)) or float(lit[0].max())
            if bright <= 0:
                raise SceneError("no light comes to the camera: does the projector meet what the camera sees?")
            aperture = {**pipeline.aperture.defaults(), **camera}
            passed = 1.0 if aperture["normalization"] == "unit_mean" else pipeline.aperture.info().mean_transmission
            top = 2 ** {**sensor.defaults(), **camera}["bits"] - 1
            sensor.exposure_gain_dn = 0.5 * top / (bright * passed)
        used = {**camera, "seed": seed, "exposure_gain_dn": sensor.exposure_gain_dn}
        return [
            Record(
                dataclasses.replace(view, ideal=light),
                pipeline.render(light, frame_index=index, refresh="all"),
                used,
                index,
            )
            for index, (view, light) in enumerate(zip(views, lit))
        ]


def random_dots(count: int, seed: int, width: int, height: int, sigma: float) -> np.ndarray:
    """(height, width) float32: Gaussian dots of `sigma` texels and peak 1 in random places."""
    image = np.zeros((height, width), np.float32)
    reach = int(np.ceil(4 * sigma))
    last = np.array([width, height]) - 1 - reach
    if last.min() <= reach:
        raise SceneError(f"dots of {sigma:.3g} texels do not fit into {width} x {height}; make them smaller")
    for x, y in np.random.default_rng(seed).uniform(reach, last, (count, 2)):
        columns, rows = (np.arange(int(c) - reach, int(c) + reach + 1) for c in (x, y))
        dot = np.exp(-((columns - x) ** 2 + (rows[:, None] - y) ** 2) / (2 * sigma**2))
        image[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] += dot
    return image


def png(codes: np.ndarray) -> bytes:
    """A gray PNG of 16 bits."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width = codes.shape
    rows = np.zeros((height, 1 + 2 * width), np.uint8)  # each begins with the filter: none
    rows[:, 1:] = np.ascontiguousarray(codes, ">u2").view(np.uint8).reshape(height, -1)
    head = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def write(folder: Path, records: Sequence[Record], about: Mapping[str, object]) -> list[Path]:
    """Codes as PNG, ideal image, depth, normals and albedo as NPY, and last camera.json, in place of those there.

    A folder that has a camera.json holds all files that it names. Frames that an earlier one names are taken away.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=".part-", dir=folder))
    try:
        frames = []
        for number, each in enumerate(records):
            name = f"frame_{number:04d}"
            (part / f"{name}.codes.png").write_bytes(png(each.codes))
            for kind in IMAGES:
                np.save(part / f"{name}.{kind}.npy", getattr(each.view, kind).astype(np.float32))
            frames.append({"name": name, "intrinsics": list(each.view.intrinsics), "frame_index": each.frame_index})
        camera = {key: value for key, value in records[0].camera.items() if value is not None}
        text = json.dumps({**about, "camera": camera, "frames": frames}, indent=1, default=_plain) + "\n"
        (part / "camera.json").write_text(text, encoding="utf-8")
        earlier = _frames_of(folder / "camera.json")
        (folder / "camera.json").unlink(missing_ok=True)
        for name in earlier - {frame["name"] for frame in frames}:
            for kind in ("codes.png", *(f"{image}.npy" for image in IMAGES)):
                (folder / f"{name}.{kind}").unlink(missing_ok=True)
        written = []
        for file in sorted(part.iterdir(), key=lambda file: file.name == "camera.json"):
            written.append(folder / file.name)
            os.replace(file, written[-1])
        return written
    finally:
        shutil.rmtree(part, ignore_errors=True)


def read_json(path: Path) -> Any:
    """What a JSON file holds, within the bounds of the package's own reader. ValueError: it is none, or beyond them."""
    from clspeckle._json_file import read_json

    return read_json(path)


def _frames_of(file: Path) -> set[str]:
    """The frames that a camera.json names, none if it is not one of ours."""
    try:
        names = {frame["name"] for frame in read_json(file)["frames"]}
        return {name for name in names if re.fullmatch(r"frame_\d{4,}", name)}
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def _plain(value: Any) -> Any:
    """NumPy's numbers and arrays as JSON has them."""
    return np.asarray(value).tolist()
