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

# Columns and rows of the zooms: the mug and its shadow, the face, the keyboard.
ZOOMS = {"mug": (350, 288, 96), "face": (90, 92, 96), "keyboard": (262, 262, 96)}


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

    figure, axes = plt.subplots(1 + len(ZOOMS), 3, figsize=(13, 4 * 3.28), height_ratios=[3, 4, 4, 4], layout="constrained")
    for column, (title, image) in enumerate(columns.items()):
        # The ideal image and the speckle share the scale of the ideal one's mean; codes run from the black level up.
        low, high = (0.0, np.percentile(image, 99.7)) if column < 2 else (40.0, 1023.0)
        axes[0, column].imshow(image, cmap="gray", vmin=low, vmax=high)
        axes[0, column].set_title(title, fontsize=13)
        for row, (name, (x, y, side)) in enumerate(ZOOMS.items(), start=1):
            axes[0, column].add_patch(Rectangle((x - 0.5, y - 0.5), side, side, fill=False, color="tab:orange", lw=1))
            axes[row, column].imshow(image[y : y + side, x : x + side], cmap="gray", vmin=low, vmax=high, interpolation="nearest")
            if column == 0:
                axes[row, 0].set_ylabel(f"{name}, {side} x {side} pixels", fontsize=11)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[])
    temporary = arguments.figure.with_name(arguments.figure.name + ".tmp.png")
    figure.savefig(temporary, dpi=90)
    temporary.replace(arguments.figure)
    print(f"figure: {arguments.figure}")


if __name__ == "__main__":
    main()
