#!/usr/bin/env python3
"""Turn a disparity or depth map and a photograph into a G-buffer sequence with a dot pattern.

    python examples/depth_map/depth_map_to_gbuffers.py --disparity aloeGT.png --photo aloeL.jpg --focal-px 3740 \\
        --baseline-m 0.16 --disparity-offset-px 270 --width 360 -o gbuffers
    python examples/depth_map/depth_map_to_gbuffers.py --depth kinect.png --depth-unit-m 0.001 --photo color.png \\
        --focal-px 525 -o gbuffers
    clspeckle render gbuffers/sequence.json -o frames --exposure-gain auto

A map holds steps (whole pixels of disparity, millimetres) and holes. The steps are smoothed first, within each surface
and never by more than their rounding. Over each output pixel a plane is then fitted to the inverse depth of the map's
pixels that lie on the same surface: its value there is the depth, its slope the normal. What is unknown at a pixel's
centre stays without a surface. The photograph's brightness is taken for the albedo, its shading included. The laser's
shadows come from the map itself: a point is dark where the way to the laser passes through a surface. Surfaces are
sheets there, as what lies behind them is not known.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from gbuffer_files import Camera, Rounding, SceneError, dots_for, write_sequence

COMPACT = Rounding(depth_bits=14, normal_steps=32, albedo_steps=32)
STEP_PX = 0.25  # of the way to the laser
CONTACT_PX = 1.5  # the way's first part lies within the rounding of the surface that it starts from


@dataclass(frozen=True)
class MapCamera:
    """The pinhole of the map."""

    focal_px: float
    cx_px: float
    cy_px: float


def read_image(path: Path) -> np.ndarray:
    """(height, width) or (height, width, channels), as stored."""
    if not path.is_file():
        raise SceneError(f"{path} is not a file")
    try:
        if path.suffix.lower() == ".npy":
            return np.load(path, allow_pickle=False)
        with Image.open(path) as image:
            return np.array(image)
    except (OSError, ValueError) as error:
        raise SceneError(f"{path} cannot be read: {error}") from None


def read_map(path: Path) -> np.ndarray:
    """float64, NaN where the map is 0, negative or not finite."""
    given = read_image(path)
    if given.ndim != 2 or given.dtype.kind not in "fiu":
        raise SceneError(f"{path} has shape {given.shape} and dtype {given.dtype}; a map has one real number per pixel")
    values = given.astype(float)
    known = np.isfinite(values) & (values > 0)
    if not known.any():
        raise SceneError(f"{path}: every pixel is unknown (0, negative or not finite)")
    return np.where(known, values, np.nan)


def output_camera(view: MapCamera, shape: tuple[int, int], width: int) -> Camera:
    """The same view with `width` pixels; the ratio of the sides is rounded, the pixels stay square."""
    factor = width / shape[1]
    height = round(shape[0] * factor)
    focal = view.focal_px * factor
    return Camera(width, height, focal, focal, (view.cx_px + 0.5) * factor - 0.5, (view.cy_px + 0.5) * factor - 0.5)


def without_steps(inverse: np.ndarray, low: np.ndarray, high: np.ndarray, jump: float, rounds: int) -> np.ndarray:
    """Diffusion of the inverse depth between neighbours of the same surface, held between `low` and `high`.

    After n rounds it reaches sqrt(n / 2) pixels far; the steps of a slope become the slope.
    """
    known = np.isfinite(inverse)
    value = np.where(known, inverse, 0.0).astype(np.float32)
    low, high = (np.where(known, bound, 0.0).astype(np.float32) for bound in (low, high))
    # 1 where a pixel and its neighbour to the right, or below, lie on the same surface.
    links = []
    for axis in (0, 1):
        first, second = np.delete(inverse, -1, axis), np.delete(inverse, 0, axis)
        with np.errstate(invalid="ignore"):
            links.append((np.abs(first - second) <= jump * first).astype(np.float32))
    for _ in range(rounds):
        flow_y, flow_x = 0.25 * links[0] * np.diff(value, axis=0), 0.25 * links[1] * np.diff(value, axis=1)
        value[:-1] += flow_y
        value[1:] -= flow_y
        value[:, :-1] += flow_x
        value[:, 1:] -= flow_x
        np.clip(value, low, high, out=value)
    return np.where(known, value, np.nan).astype(float)


def fit_planes(
    inverse: np.ndarray, camera: Camera, factor: float, sigma_px: float, jump: float
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse depth at the output pixels and its slopes (d/du, d/dv); NaN without a surface.

    On a plane 1/z is linear in u = x/z and v = y/z. Gaussian weights of `sigma_px` map pixels, and 0 for pixels whose
    inverse depth differs by more than the part `jump`: they lie on another surface.
    """
    height, width = inverse.shape
    y, x = np.indices((camera.height, camera.width))
    at_x, at_y = (x + 0.5) / factor - 0.5, (y + 0.5) / factor - 0.5
    near_x, near_y = np.clip(np.rint(at_x), 0, width - 1).astype(int), np.clip(np.rint(at_y), 0, height - 1).astype(int)
    centre = inverse[near_y, near_x]
    reach = int(np.ceil(2.5 * sigma_px))
    moments = np.zeros((6, *centre.shape))
    right = np.zeros((3, *centre.shape))
    for j in range(-reach, reach + 1):
        for i in range(-reach, reach + 1):
            from_x, from_y = near_x + i, near_y + j
            inside = (from_x >= 0) & (from_x < width) & (from_y >= 0) & (from_y < height)
            value = inverse[np.clip(from_y, 0, height - 1), np.clip(from_x, 0, width - 1)]
            dx, dy = from_x - at_x, from_y - at_y
            with np.errstate(invalid="ignore"):
                same = inside & (np.abs(value - centre) <= jump * centre)
            weight = np.where(same, np.exp(-(dx**2 + dy**2) / (2 * sigma_px**2)), 0.0)
            value = np.where(same, value, 0.0)
            for row, term in enumerate((1.0, dx, dy, dx * dx, dx * dy, dy * dy)):
                moments[row] += weight * term
            for row, term in enumerate((1.0, dx, dy)):
                right[row] += weight * term * value
    one, sx, sy, sxx, sxy, syy = moments
    # A ridge of a hundredth of a pixel^2: where the pixels lie on a line the slope across it is 0.
    matrix = np.stack([one, sx, sy, sx, sxx + 0.01 * one, sxy, sy, sxy, syy + 0.01 * one], axis=-1)
    known = np.isfinite(centre) & (one > 0)
    matrix = np.where(known[..., None], matrix, np.eye(3).ravel()).reshape(*centre.shape, 3, 3)
    solved = np.linalg.solve(matrix, np.moveaxis(right, 0, -1)[..., None])[..., 0]
    # Never farther off the map than its own rounding and noise may be.
    value = np.clip(solved[..., 0], centre * (1 - jump), centre * (1 + jump))
    slopes = solved[..., 1:] * camera.fx_px / factor
    return np.where(known, value, np.nan), np.where(known[..., None], slopes, 0.0)


def normals_of(inverse: np.ndarray, slopes: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Unit normals towards the camera: a plane n.X = d has 1/z = n.(u, v, 1) / d, so n goes with the gradient of it."""
    third = inverse - (slopes * rays[..., :2]).sum(axis=-1)
    normal = -np.concatenate([slopes, third[..., None]], axis=-1)
    return normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)


def lit(inverse: np.ndarray, normals: np.ndarray, camera: Camera, laser: np.ndarray, jump: float) -> np.ndarray:
    """True where the way to the laser passes through no surface of the map, and the surface faces the laser."""
    known = np.isfinite(inverse)
    depth = np.where(known, 1 / np.where(known, inverse, 1.0), np.nan)
    points = camera.rays() * depth[..., None]
    facing = (normals * (laser - points)).sum(axis=-1) > 0
    nearest = np.nanmin(depth)
    visible = known & facing
    focal = np.array([camera.fx_px, camera.fy_px])
    # Position on the way by the parameter t of p + t (laser - p); it leaves the range of depth at the nearest surface.
    far = np.nanmax(depth)
    longest = np.linalg.norm(focal * laser[:2]) * (1 / nearest - 1 / far) + 2 * CONTACT_PX
    count = int(np.ceil(longest / STEP_PX))
    ys, xs = np.nonzero(visible)
    start = points[ys, xs]
    pixel = np.stack([xs, ys], axis=-1).astype(float)
    vanishing = focal * laser[:2]  # the way's pixel moves by this per unit of inverse depth, for a laser at z = 0
    rate = np.linalg.norm(vanishing)
    blocked = np.zeros(len(start), bool)
    before = np.full(len(start), np.nan)
    sheet = np.full(len(start), np.nan)
    for step in range(count):
        moved = CONTACT_PX + step * STEP_PX
        q = 1 / start[:, 2] + moved / rate
        place = np.rint(pixel + vanishing * (moved / rate)).astype(int)
        inside = (place >= 0).all(axis=1) & (place[:, 0] < camera.width) & (place[:, 1] < camera.height)
        seen = np.where(
            inside,
            inverse[np.clip(place[:, 1], 0, camera.height - 1), np.clip(place[:, 0], 0, camera.width - 1)],
            np.nan,
        )
        behind = seen - q  # above 0: the way is behind the surface there
        with np.errstate(invalid="ignore"):
            joined = np.abs(seen - sheet) <= jump * seen
            blocked |= joined & (before > 0) & (behind <= 0)
        before, sheet = behind, seen
    visible[ys[blocked], xs[blocked]] = False
    return visible


def albedo_of(photo: np.ndarray, camera: Camera, brightest: float) -> np.ndarray:
    """Linear red (the channel nearest to infrared) or gray, averaged over the output pixels.

    Its 98th percentile becomes `brightest`.
    """
    values = photo[..., 0] if photo.ndim == 3 else photo
    if values.dtype.kind == "u":
        encoded = values / np.iinfo(values.dtype).max
        linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    else:
        linear = values.astype(float)  # floats are taken as linear
    small = Image.fromarray(linear.astype(np.float32)).resize((camera.width, camera.height), Image.Resampling.BOX)
    result = np.asarray(small, float)
    level = np.percentile(result, 98)
    if not level > 0:
        raise SceneError("the photograph is black; its brightness is the albedo")
    return np.clip(result * brightest / level, 0.02, 0.95)


def inverse_depths(options: argparse.Namespace) -> np.ndarray:
    """Of the map, without its steps."""
    if options.depth is not None:
        stored = read_map(options.depth)

        def inverse(values: np.ndarray) -> np.ndarray:
            return 1 / (np.maximum(values, 1e-3) * options.depth_unit_m)
    else:
        if options.baseline_m is None:
            raise SceneError("a disparity needs --baseline-m, the distance of the two cameras")
        stored = read_map(options.disparity)
        least = np.nanmin(stored) / options.disparity_scale + options.disparity_offset_px
        if least <= 0:
            raise SceneError(
                f"--disparity-offset-px {options.disparity_offset_px:g} leaves a disparity of {least:g} px: no depth"
            )

        def inverse(values: np.ndarray) -> np.ndarray:
            return (values / options.disparity_scale + options.disparity_offset_px) / (
                options.focal_px * options.baseline_m
            )

    bounds = inverse(stored - options.rounding), inverse(stored + options.rounding)
    return without_steps(
        inverse(stored), np.minimum(*bounds), np.maximum(*bounds), options.jump, round(2 * options.level_px**2)
    )


def convert(options: argparse.Namespace) -> str:
    inverse = inverse_depths(options)
    photo = read_image(options.photo)
    if photo.shape[:2] != inverse.shape:
        raise SceneError(
            f"the map has {inverse.shape[1]} x {inverse.shape[0]} pixels, "
            f"the photograph {photo.shape[1]} x {photo.shape[0]}; they must be of the same view"
        )
    shape = inverse.shape
    view = MapCamera(
        options.focal_px,
        (shape[1] - 1) / 2 if options.cx_px is None else options.cx_px,
        (shape[0] - 1) / 2 if options.cy_px is None else options.cy_px,
    )
    camera = output_camera(view, shape, options.width or shape[1])
    factor = camera.width / shape[1]
    fitted, slopes = fit_planes(inverse, camera, factor, options.smooth_px, options.jump)
    laser = np.array([options.laser_x_m, options.laser_y_m, 0.0])
    depth = np.where(np.isfinite(fitted), 1 / fitted, 0.0)
    normals = normals_of(np.where(np.isfinite(fitted), fitted, 1.0), slopes, camera.rays())
    surface = depth > 0
    visible = lit(fitted, normals, camera, laser, options.jump)
    frame = {
        "Z": depth,
        **{f"N.{axis}": np.where(surface, normals[..., i], 0.0) for i, axis in enumerate("XYZ")},
        "albedo": albedo_of(photo, camera, options.brightest_albedo),
        "visibility": visible.astype(float),
    }
    pose = np.concatenate([np.eye(3), -laser[:, None]], axis=1)
    near, far = float(depth[surface].min()), float(depth.max())
    dots = dots_for(camera, pose, 0.95 * near, options.dot_spacing_px, options.dot_sigma_px)
    source = f"{(options.disparity or options.depth).name}, {options.photo.name}"
    write_sequence(
        options.output, camera, pose, [frame], dots, source=source, rounding=COMPACT if options.compact else None
    )
    return (
        f"{options.output}: {camera.width} x {camera.height}, depth {near:.3f} to {far:.3f} m, "
        f"{1 - surface.mean():.1%} unknown, {1 - visible.sum() / surface.sum():.1%} of the surfaces in the laser's "
        f"shadow, {dots.count} dots"
    )


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--disparity", type=Path, help="disparity map: PNG, TIFF or NPY; 0 is unknown")
    source.add_argument("--depth", type=Path, help="depth map along the optical axis: PNG, TIFF or NPY; 0 is unknown")
    parser.add_argument(
        "--photo", type=Path, required=True, help="photograph of the same view and size; its brightness is the albedo"
    )
    parser.add_argument("--focal-px", type=float, required=True, help="focal length in pixels of the map")
    parser.add_argument("--cx-px", type=float, help="principal point of the map (default: its middle)")
    parser.add_argument("--cy-px", type=float, help="likewise")
    parser.add_argument("--baseline-m", type=float, help="distance of the two cameras of a disparity map")
    parser.add_argument(
        "--disparity-scale", type=float, default=1.0, help="stored values per pixel of disparity (default: 1)"
    )
    parser.add_argument(
        "--disparity-offset-px", type=float, default=0.0, help="added to the disparity, for cropped pairs (default: 0)"
    )
    parser.add_argument(
        "--depth-unit-m", type=float, default=0.001, help="metres per stored unit of depth (default: 0.001)"
    )
    parser.add_argument("--width", type=int, help="width of the frames in pixels (default: the map's)")
    parser.add_argument(
        "--rounding",
        type=float,
        default=0.5,
        help="the most by which steps are smoothed, in stored units (default: 0.5)",
    )
    parser.add_argument(
        "--level-px", type=float, default=12.0, help="how far, in pixels of the map; 0: not at all (default: 12)"
    )
    parser.add_argument("--smooth-px", type=float, default=4.0, help="of the planes, in pixels of the map (default: 4)")
    parser.add_argument(
        "--jump", type=float, default=0.01, help="relative step of depth that separates two surfaces (default: 0.01)"
    )
    parser.add_argument(
        "--laser-x-m",
        type=float,
        default=0.075,
        help="where the laser stands, to the right of the camera (default: 0.075)",
    )
    parser.add_argument("--laser-y-m", type=float, default=0.0, help="and below it (default: 0)")
    parser.add_argument(
        "--brightest-albedo", type=float, default=0.8, help="of the photograph's 98th percentile (default: 0.8)"
    )
    parser.add_argument(
        "--dot-spacing-px", type=float, default=11.0, help="mean distance of dots in the image (default: 11)"
    )
    parser.add_argument("--dot-sigma-px", type=float, default=1.4, help="width of dots in the image (default: 1.4)")
    parser.add_argument(
        "--compact", action="store_true", help="round depth to 14 bits, normals and albedo to 1/32: half the size"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the sequence")
    options = parser.parse_args()
    limits = {
        "focal_px": (1, 1e6),
        "baseline_m": (1e-4, 100),
        "disparity_scale": (1e-3, 1e6),
        "depth_unit_m": (1e-9, 1e3),
        "width": (32, 8192),
        "rounding": (0, 1e6),
        "level_px": (0, 50),
        "smooth_px": (0.5, 20),
        "jump": (1e-4, 0.5),
        "laser_x_m": (-10, 10),
        "laser_y_m": (-10, 10),
        "brightest_albedo": (0.05, 0.95),
        "dot_spacing_px": (4, 100),
        "dot_sigma_px": (0.5, 10),
    }
    for name, (low, high) in limits.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            parser.error(f"--{name.replace('_', '-')} must lie in {low:g} to {high:g}, got {value:g}")
    if np.hypot(options.laser_x_m, options.laser_y_m) < 1e-3:
        parser.error("the laser must stand beside the camera: --laser-x-m or --laser-y-m at least 0.001")
    return options


def main() -> int:
    options = parse()
    try:
        print(convert(options))
    except (SceneError, OSError) as error:
        print(f"depth_map_to_gbuffers: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
