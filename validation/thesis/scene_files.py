"""Scenes on disk: the first frame of a G-buffer sequence with its dots, and where each dot truly lies."""

from __future__ import annotations

import tarfile
import tempfile
from pathlib import Path

import clspeckle
import matplotlib.image
import numpy as np
import OpenEXR
from clspeckle._json_file import read_json
from scipy import ndimage

ROOT = Path(__file__).resolve().parents[2]


def _channels(folder: Path, name: str) -> dict[str, np.ndarray]:
    """Of one frame, which may lie in the archive frames.tar.xz."""

    def read(path: Path) -> dict[str, np.ndarray]:
        with OpenEXR.File(str(path), separate_channels=True) as stored:
            return {channel: plane.pixels for channel, plane in stored.channels().items()}

    if (folder / name).is_file():
        return read(folder / name)
    with tempfile.TemporaryDirectory() as temporary, tarfile.open(folder / "frames.tar.xz") as archive:
        part = Path(temporary) / "frame.exr"
        part.write_bytes(archive.extractfile(name).read())
        return read(part)


class Scene:
    """The first frame of examples/NAME/gbuffers."""

    def __init__(self, name: str) -> None:
        folder = ROOT / "examples" / name / "gbuffers"
        about = read_json(folder / "sequence.json")
        view, laser = about["camera"], about["laser"]
        pattern = laser["pattern"]
        self.name = name
        self.shape: tuple[int, int] = (about["height"], about["width"])
        self.intrinsics = tuple(float(view[key]) for key in ("fx_px", "fy_px", "cx_px", "cy_px"))
        self.pixel_pitch_m: float = view["pixel_pitch_m"]
        self.wavelength_m: float = laser["wavelength_m"]
        self.pose = np.array(laser["laser_from_geometry"]).reshape(3, 4)
        self.texels = matplotlib.image.imread(folder / pattern["file"]).astype(np.float32)
        self.half_extent = np.array([pattern["half_extent_x"], pattern["half_extent_y"]])
        channels = _channels(folder, about["frames"][0])
        self.depth = channels["Z"].astype(np.float32)
        self.visibility = channels["visibility"].astype(np.float32)
        self.geometry = clspeckle.Geometry(
            depth=self.depth,
            intrinsics=self.intrinsics,
            normal=np.stack([channels[f"N.{axis}"] for axis in "XYZ"], axis=-1).astype(np.float32),
            albedo=channels["albedo"].astype(np.float32),
            visibility=self.visibility,
        )
        self.directions = self._directions(folder / "dots.txt")
        # Of a dot in the image of a wall: the pattern's dots are 2.5 texels wide (make_pattern.py).
        texel = 2 * self.half_extent[0] / self.texels.shape[1]
        self.sigma_px = float(2.5 * texel * self.intrinsics[0])

    def _directions(self, listed: Path) -> np.ndarray:
        """From dots.txt, or the brightest texels of the pattern: centres of dots lie on texels."""
        if listed.is_file():
            return np.loadtxt(listed)
        row, column = np.nonzero(self.texels == self.texels.max())
        size = np.array(self.texels.shape[::-1])
        return self.half_extent * (2 * (np.stack([column, row], axis=-1) + 0.5) / size - 1)

    def pattern(self) -> clspeckle.Pattern:
        return clspeckle.Pattern(
            self.texels,
            projection="tangent_plane",
            half_extent_x=self.half_extent[0],
            half_extent_y=self.half_extent[1],
            laser_from_geometry=self.pose,
            filter="area",
        )

    def pixel_of(self, points: np.ndarray) -> np.ndarray:
        fx, fy, cx, cy = self.intrinsics
        return points[..., :2] / points[..., 2:] * (fx, fy) + (cx, cy)

    def along(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Each dot's pixel, and its true derivative, at the inverse depth q of the point where its beam is."""
        start = -self.pose[:, :3].T @ self.pose[:, 3]
        way = np.column_stack([self.directions, np.ones(len(self.directions))]) @ self.pose[:, :3]
        z = 1 / np.asarray(q)[:, None]
        pixel = self.pixel_of(start + way * (z - start[2]) / way[:, 2:])
        step = 1e-4 / z
        moved = self.pixel_of(start + way * (1 / (1 / z + step) - start[2]) / way[:, 2:])
        return pixel, (moved - pixel) / step


def truth(scene: Scene, jump: float = 0.01, reach_sigmas: float = 3.0) -> dict[str, np.ndarray]:
    """Of each dot: the inverse depth at which its beam meets the surface (NaN: nowhere), its pixel, whether it is
    visible.

    The beam is followed from far to near through the map of inverse depth, and meets it where it passes through one
    surface (neighbouring depths that differ by less than the part `jump`); of several the nearest to the laser counts.
    Visible: its own surface alone, lit, lies within `reach_sigmas` widths, and no other visible dot does.
    """
    known = scene.depth > 0
    inverse = np.where(known, 1 / np.where(known, scene.depth, 1), np.nan)
    low, high = np.nanmin(inverse), np.nanmax(inverse)
    pixels_per_q = float(np.linalg.norm(scene.along(np.full(len(scene.directions), low))[1], axis=1).max())
    q_step = 0.2 / pixels_per_q
    found = np.full(len(scene.directions), np.nan)
    before_gap = before_map = np.full(len(scene.directions), np.nan)
    for q in np.arange(low * 0.98, high * 1.02, q_step):
        pixel, _ = scene.along(np.full(len(scene.directions), q))
        # Inverse depth is linear on planes, so bilinear interpolation is exact there; NaN near holes.
        here = ndimage.map_coordinates(inverse, pixel.T[::-1], order=1, mode="constant", cval=np.nan)
        gap = here - q
        with np.errstate(invalid="ignore"):
            crossed = (before_gap > 0) & (gap <= 0) & (np.abs(here - before_map) <= jump * here)
        share = before_gap[crossed] / (before_gap[crossed] - gap[crossed])
        found[crossed] = q - q_step + share * q_step
        before_gap, before_map = gap, here
    pixel = np.full((len(found), 2), np.nan)
    met = np.isfinite(found)
    pixel[met] = scene.along(np.where(met, found, 1.0))[0][met]
    return {"inverse": found, "pixel": pixel, "visible": _visible(scene, inverse, pixel, jump, reach_sigmas)}


def _visible(scene: Scene, inverse: np.ndarray, pixel: np.ndarray, jump: float, reach_sigmas: float) -> np.ndarray:
    reach = reach_sigmas * scene.sigma_px
    radius = int(np.ceil(reach))
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    disk = x**2 + y**2 <= reach**2 + 1
    # Where an edge of a surface, a hole or the border is near: the largest step to a neighbour within reach.
    edge = ~np.isfinite(inverse)
    for axis in (0, 1):
        with np.errstate(invalid="ignore"):
            step = ~(np.abs(np.diff(inverse, axis=axis)) <= jump * np.delete(inverse, -1, axis))
        edge |= np.pad(step, [(0, 1 - axis), (0, axis)]) | np.pad(step, [(1 - axis, 0), (axis, 0)])
    clear = ~ndimage.binary_dilation(edge | (scene.visibility < 1), disk)
    clear[:radius] = clear[-radius:] = False
    clear[:, :radius] = clear[:, -radius:] = False
    met = np.isfinite(pixel).all(axis=1)
    at = np.clip(np.rint(np.where(met[:, None], pixel, 0)).astype(int), 0, np.array(scene.shape[::-1]) - 1)
    visible = met & clear[at[:, 1], at[:, 0]]
    crowd = np.where(met[:, None], pixel, 1e9 + 1e3 * np.arange(len(pixel))[:, None])
    distance = np.sqrt(((crowd[:, None] - crowd[None]) ** 2).sum(axis=-1)) if len(crowd) < 4000 else None
    if distance is not None:
        np.fill_diagonal(distance, np.inf)
        visible &= distance.min(axis=1) > reach
    return visible
