"""The diagnosis on published speckle images: what it says of cameras of which little is known.

    pip install pillow scipy tqdm
    python examples/real_data/real_data.py --data IMAGES --out real-data

docs/results/real-data.md says where the images come from, and what came out.

Each folder of images becomes a capture set with what its source states of the set-up; what is not stated is assumed,
and said so. The reports (JSON and HTML) land in OUT, a table of them in OUT/table.md.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy.io import loadmat
from tqdm import tqdm

import clspeckle

Codes = npt.NDArray[np.uint16]
SIZE = 256  # the middle of each image: enough speckles, and quick
WAVELENGTH_M = 633e-9  # assumed; only wavelength * f_number / pixel_pitch matters
PITCH_M = 5.2e-6  # assumed


@dataclass(frozen=True)
class Set:
    """A capture set from published images."""

    name: str
    sequence: str
    codes: Codes
    bits: int
    relative_diameter: float  # of the pupil, pixel pitch / (wavelength * f-number)
    black_level_dn: float
    assumed: str


def middle(image: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
    """The middle of (..., height, width)."""
    top, left = (max(0, (n - SIZE) // 2) for n in image.shape[-2:])
    return image[..., top : top + SIZE, left : left + SIZE]


def grey(path: Path) -> Codes:
    """8-bit codes of an image file."""
    return np.asarray(Image.open(path).convert("L"), dtype=np.uint16)


def relative_diameter(fwhm_px: float) -> float:
    """Of the pupil whose speckle's autocorrelation, |2 J1(pi D x) / (pi D x)|^2, has that width at half maximum."""
    return 1.029 / fwhm_px


def read(data: Path) -> Iterator[Set]:
    """All sets of which there are files."""
    glass = "pupil from the measured grain (FWHM 7.8 px), black level 5 DN from the darkest pixels"
    for name in ("120", "220", "600", "1500", "ke", "mo"):
        path = data / "spark_grit" / f"{name}.bmp"
        if path.is_file():
            codes = middle(grey(path))[np.newaxis]
            yield Set(f"grit {name}", "board_static", codes, 8, relative_diameter(7.8), 5.0, glass)
    folder = data / "spark_memory_effect"
    if folder.is_dir():
        frames = [middle(grey(folder / f"{step}.bmp")) for step in range(-20, 21)]
        assumed = "pupil from the measured grain (FWHM 7.1 px), black level 20 DN, each frame taken as a new speckle"
        yield Set("pinhole series", "board_moving", np.stack(frames), 8, relative_diameter(7.1), 20.0, assumed)
    path = data / "lsci_invitro_inaoe" / "data.mat"
    if path.is_file():
        frames = np.moveaxis(loadmat(path)["im_raw"], -1, 0).astype(np.uint16)
        assumed = "grain of one pixel (D = 1), black level 0, called static though a fluid flows in it"
        yield Set("flow phantom", "board_static", middle(frames), 8, 1.0, 0.0, assumed)
    folder = data / "bu_deepspeckle"
    if folder.is_dir():
        for path in sorted(folder.glob("*.npy")):
            stack = np.load(path)[..., 0]
            codes = np.rint(stack * 1023).astype(np.uint16)
            assumed = "normalized images put on 10 bits, pupil from the measured grain (FWHM 2 px), black level lost: 0"
            yield Set(path.stem, "board_moving", middle(codes), 10, relative_diameter(2.0), 0.0, assumed)


def diagnose(entry: Set, out: Path) -> clspeckle.Diagnosis:
    """The diagnosis of one set, with its reports in `out`."""
    capture = clspeckle.Capture.from_arrays(
        {entry.sequence: np.ascontiguousarray(entry.codes)},
        camera={
            "bits": entry.bits,
            "pixel_pitch_m": PITCH_M,
            "wavelength_m": WAVELENGTH_M,
            "f_number": PITCH_M / (WAVELENGTH_M * entry.relative_diameter),
            "black_level_dn": entry.black_level_dn,
            "read_noise_dn": 1.0,
        },
    )
    found = clspeckle.diagnose(capture)
    stem = entry.name.replace(" ", "_")
    found.write(out / f"{stem}.json")
    found.write_html(out / f"{stem}.html")
    return found


def row(entry: Set, found: clspeckle.Diagnosis) -> str:
    """A line of the table."""
    worst = ", ".join(dict.fromkeys(f"{p.statistic}" for p in found.where[:6]))
    left = "yes" if found.shrink.residual_detected else "no"
    effects = ", ".join(found.effects) or "-"
    frames = entry.codes.shape[0]
    return f"| {entry.name} | {frames} | {found.verdict} | {effects} | {found.shrink.fraction:.2f} | {left} | {worst} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder that holds the folders of the images")
    parser.add_argument(
        "--out", type=Path, default=Path("real-data"), help="folder of the results (default: %(default)s)"
    )
    arguments = parser.parse_args()
    sets = list(read(arguments.data))
    if not sets:
        print(f"real_data: {arguments.data} has none of the folders spark_grit, spark_memory_effect, "
              "lsci_invitro_inaoe, bu_deepspeckle; give --data", file=sys.stderr)  # fmt: skip
        return 1
    arguments.out.mkdir(parents=True, exist_ok=True)
    lines = ["| set | frames | verdict | effects | part of the gap that is gone | residual | worst statistics |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    for entry in tqdm(sets, unit="set"):
        lines.append(row(entry, diagnose(entry, arguments.out)))
        tqdm.write(lines[-1])
    lines += ["", *dict.fromkeys(f"- {entry.name}: {entry.assumed}" for entry in sets)]
    (arguments.out / "table.md").write_text("\n".join(lines) + "\n")
    print(f"\nwrote {arguments.out / 'table.md'} and {len(sets)} reports, JSON and HTML")
    return 0


if __name__ == "__main__":
    sys.exit(main())
