"""The demo's figure: ideal, speckled and recorded image of the office desk side by side, with zooms on dots.

usage: figure.py OUTPUT_FOLDER --figure FILE.png      (OUTPUT_FOLDER as scripts/demo.sh leaves it)
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

BLACK_LEVEL_DN = 64.0  # the program's default
# Left, top, width, height of the zooms.
ZOOMS = {"mug": (350, 284, 84, 63), "face and collar": (90, 100, 84, 63)}


def first(folder: Path, pattern: str) -> Path:
    """The first file of a folder that matches; an error that names both if there is none."""
    files = sorted(folder.glob(pattern))
    if not files:
        raise SystemExit(f"no {pattern} in {folder}; run scripts/demo.sh first")
    return files[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, help="folder that scripts/demo.sh wrote")
    parser.add_argument("--figure", type=Path, required=True, help="PNG file to write")
    arguments = parser.parse_args()

    codes = np.round(matplotlib.image.imread(first(arguments.output / "office", "frame_*.png")) * 65535)
    columns = {
        "ideal infrared image": np.load(first(arguments.output / "office", "ideal_*.npy")),
        "with speckle": np.load(first(arguments.output / "intensity", "*.npy")),
        "recorded, 10 bit": codes,
    }

    figure, axes = plt.subplots(1 + len(ZOOMS), 3, figsize=(15, 11.8), layout="constrained")
    for column, (title, image) in enumerate(columns.items()):
        # Brightness as the square root, as a display shows it; codes from the black level up.
        shown = np.sqrt(np.maximum(image - (BLACK_LEVEL_DN if image is codes else 0.0), 0.0))
        low, high = 0.0, np.percentile(shown, 99.8)
        axes[0, column].imshow(shown, cmap="gray", vmin=low, vmax=high)
        axes[0, column].set_title(title, fontsize=15)
        for row, (name, (x, y, width, height)) in enumerate(ZOOMS.items(), start=1):
            axes[0, column].add_patch(
                Rectangle((x - 0.5, y - 0.5), width, height, fill=False, color="tab:orange", lw=1.5)
            )
            zoom = shown[y : y + height, x : x + width]
            axes[row, column].imshow(zoom, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
            if column == 0:
                axes[row, 0].set_ylabel(f"{name}, {width} x {height} pixels", fontsize=13)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[])
    temporary = arguments.figure.with_name(arguments.figure.name + ".tmp.png")
    figure.savefig(temporary, dpi=70)
    temporary.replace(arguments.figure)
    print(f"figure: {arguments.figure}")


if __name__ == "__main__":
    main()
