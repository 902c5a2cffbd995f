#!/usr/bin/env python3
"""Draw the semi-random dot pattern of the office example as a 16-bit grayscale PNG.

The image is the laser's tangent plane, x = X/Z and y = Y/Z in the laser's frame (x right, y down, z forward). It covers
[-half_extent_x, half_extent_x] x [-half_extent_y, half_extent_y] from edge to edge, so the centre of texel
(column, row) is at x = half_extent_x * (2 * (column + 0.5) / width - 1), and y likewise. Values are linear: radiant
intensity relative to 65535, with no gamma.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np
import png
from scipy.spatial import cKDTree
from scipy.stats import qmc

PATTERN_WIDTH = 1024
PATTERN_HEIGHT = 704
# The camera sees |x| < 0.571 and |y| < 0.428. At 0.7 m the 75 mm baseline shifts the laser's view by 0.107, and a
# margin is left for the dots' skirts, so no pixel of a surface beyond 0.7 m falls off the pattern.
HALF_EXTENT_X = 0.704
HALF_EXTENT_Y = 0.484
DOT_COUNT = 2509
DOT_SIGMA_TEXELS = 2.5
SEED = 940
# 8-bit steps of peak intensity keep the file small; half a step is 0.2 % of the peak.
LEVELS = 255


def dot_centers(count: int, width: int, height: int, margin: float, seed: int) -> np.ndarray:
    """Return `count` texel centres (column, row), uniformly scattered with a minimum distance between them.

    A saturated Poisson-disc set is drawn with the largest radius that still yields enough dots, and the surplus is
    dropped at random. The directions of a diffractive beam splitter lie on the lattice of its diffraction orders;
    here the lattice is the texel grid, which also lets every dot have the same samples.
    """
    low = np.array([margin, margin])
    size = np.array([width, height], dtype=float) - 1.0 - 2.0 * margin
    # Random sequential adsorption of discs saturates at a coverage of 0.547.
    radius = np.sqrt(0.547 * size.prod() / (count * np.pi / 4.0))
    while True:
        rng = np.random.default_rng(seed)
        engine = qmc.PoissonDisk(d=2, radius=radius / size.max(), rng=rng, l_bounds=[0, 0], u_bounds=size / size.max())
        points = engine.fill_space() * size.max() + low
        if len(points) >= count:
            break
        radius *= min(0.999, 0.998 * np.sqrt(len(points) / count))
    return np.rint(points[rng.permutation(len(points))[:count]]).astype(int)


def render_pattern(centers: np.ndarray, width: int, height: int, sigma: float) -> np.ndarray:
    """Return the pattern as uint16 [height, width]: the same Gaussian at every centre."""
    reach = int(np.ceil(sigma * np.sqrt(2.0 * np.log(2.0 * LEVELS))))
    axis = np.arange(-reach, reach + 1)
    dot = np.exp(-(axis[:, None] ** 2 + axis[None, :] ** 2) / (2.0 * sigma**2))
    image = np.zeros((height + 2 * reach, width + 2 * reach))
    for column, row in centers:
        image[row : row + 2 * reach + 1, column : column + 2 * reach + 1] += dot
    image = image[reach:-reach, reach:-reach]
    return (np.rint(np.minimum(image, 1.0) * LEVELS) * (65535 // LEVELS)).astype(np.uint16)


def write_png(path: Path, image: np.ndarray) -> None:
    """Write a 2-D uint16 image to a temporary file beside `path` and rename it."""
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as stream:
            writer = png.Writer(image.shape[1], image.shape[0], greyscale=True, bitdepth=16, compression=9)
            writer.write(stream, image.tolist())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_pattern(path: Path, count: int = DOT_COUNT, seed: int = SEED) -> dict[str, float]:
    """Write the pattern and return what was drawn: dot count, smallest and median distance to the nearest dot."""
    margin = 4.0 * DOT_SIGMA_TEXELS
    centers = dot_centers(count, PATTERN_WIDTH, PATTERN_HEIGHT, margin, seed)
    image = render_pattern(centers, PATTERN_WIDTH, PATTERN_HEIGHT, DOT_SIGMA_TEXELS)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, image)
    nearest = cKDTree(centers).query(centers, k=2)[0][:, 1]
    return {"dots": len(centers), "nearest_texels": float(nearest.min()), "median_texels": float(np.median(nearest))}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = Path(__file__).resolve().parent / "gbuffers" / "pattern.png"
    parser.add_argument("--output", type=Path, default=default, help="PNG file (default: gbuffers/pattern.png)")
    parser.add_argument("--dots", type=int, default=DOT_COUNT, help=f"number of dots (default: {DOT_COUNT})")
    parser.add_argument("--seed", type=int, default=SEED, help=f"seed of the dot positions (default: {SEED})")
    arguments = parser.parse_args()
    if not 1 <= arguments.dots <= 20000:
        parser.error(f"--dots must lie in 1 to 20000, got {arguments.dots}")
    if arguments.seed < 0:
        parser.error(f"--seed must not be negative, got {arguments.seed}")
    try:
        drawn = write_pattern(arguments.output, arguments.dots, arguments.seed)
    except OSError as error:
        print(f"make_pattern: cannot write {arguments.output}: {error.strerror}", file=sys.stderr)
        return 1
    print(
        f"{arguments.output}: {drawn['dots']} dots, sigma {DOT_SIGMA_TEXELS} texels, "
        f"closest pair {drawn['nearest_texels']:.1f} texels, median to the nearest {drawn['median_texels']:.1f} texels"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
