"""Frames with the pattern of a diffractive element beside frames with ideal dots (thesis 3.3): the same texture size,
the same lookup.

    PYTHONPATH=bindings/python/src python bench/compare_patterns.py

Frames of both kinds are rendered in turn, so that whatever else the machine does meets both alike. Prints medians, the
ratio of the means and its 95 % interval by a bootstrap over blocks of pairs.
"""

from __future__ import annotations

import argparse
import time

import clspeckle
import numpy as np
from tqdm import tqdm


def patterns(context: clspeckle.Context, texels: int) -> dict[str, clspeckle.Pattern]:
    """About 2500 dots: the orders of a cell of 50 x 50 pixels of 1 um, and ideal dots in their directions."""
    rng = np.random.default_rng(5)
    pitch, wavelength = 1e-6, 940e-9
    phase = rng.uniform(0, 2 * np.pi, (50, 50)).astype(np.float32)
    options = {"image_shape": (texels, texels), "half_extent": 0.47, "context": context}
    element = clspeckle.DoePattern(clspeckle.DoeElement(phase, pitch, wavelength_m=wavelength), **options)
    m, n = np.meshgrid(np.arange(-25, 25), np.arange(-25, 25))
    directions = np.stack([m.ravel(), n.ravel()], axis=-1) * wavelength / (50 * pitch)
    return {"element": element.pattern(), "ideal": clspeckle.DoePattern.ideal(directions, **options).pattern()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=120, help="frames of each kind (default: %(default)s)")
    parser.add_argument("--size", type=int, nargs=2, default=(1024, 1024), metavar=("HEIGHT", "WIDTH"))
    parser.add_argument(
        "--texels", type=int, default=2048, help="along each side of the texture (default: %(default)s)"
    )
    arguments = parser.parse_args()
    shape = tuple(arguments.size)
    with clspeckle.Context() as context:
        found = patterns(context, arguments.texels)
        depth = np.full(shape, 1.5, np.float32)
        focal = shape[1]
        geometry = clspeckle.Geometry(depth=depth, intrinsics=(focal, focal, (shape[1] - 1) / 2, (shape[0] - 1) / 2))
        cameras = {
            name: clspeckle.Pipeline.from_parameters(
                shape, pattern=pattern, relative_diameter=0.5, seed=1, context=context
            )
            for name, pattern in found.items()
        }
        seconds: dict[str, list[float]] = {name: [] for name in cameras}
        for index in tqdm(range(arguments.pairs + 3), unit="pair"):
            for name in list(cameras)[:: 1 if index % 2 else -1]:
                start = time.perf_counter()
                cameras[name].render(geometry, refresh="all", frame_index=index)
                if index >= 3:  # warm by then
                    seconds[name].append(time.perf_counter() - start)
    element, ideal = (np.array(seconds[name]) for name in ("element", "ideal"))
    rng = np.random.default_rng(0)
    draws = rng.integers(0, element.size, (4000, element.size))
    low, high = np.quantile(element[draws].mean(axis=1) / ideal[draws].mean(axis=1), (0.025, 0.975))
    print(
        f"{shape[0]} x {shape[1]} pixels, {element.size} pairs: medians {1e3 * np.median(element):.2f} ms with the "
        f"element, {1e3 * np.median(ideal):.2f} ms with ideal dots; ratio of the means "
        f"{element.mean() / ideal.mean():.3f} (95 % interval {low:.3f} to {high:.3f})"
    )


if __name__ == "__main__":
    main()
