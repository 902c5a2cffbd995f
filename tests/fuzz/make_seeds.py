"""Writes small files of every format into FOLDER/FORMAT, for the fuzzers to begin with: make_seeds.py FOLDER."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import cli_images as images  # noqa: E402

# The registry's names, by the endings of the samples.
FORMATS = {
    ".png": "PNG",
    ".tiff": "TIFF",
    ".exr": "EXR",
    ".hdr": "Radiance HDR",
    ".npy": "NPY",
    ".pgm": "PNM",
    ".ppm": "PNM",
    ".pnm": "PNM",
    ".jpg": "JPEG",
    ".bmp": "BMP",
    ".tga": "TGA",
}
RAW = ["8", "10", "12,msb,big", "10,mipi", "14,mipi", "12,genicam", "12,gige,3", "10,stride=40"]


def main(folder: Path) -> None:
    # Small enough for a million runs.
    images.WIDTH, images.HEIGHT = 16, 6
    images.CROP = (5, 1, 11, 4)
    for name, (write, _) in images.FORMATS.items():
        target = folder / FORMATS[Path(name).suffix]
        target.mkdir(parents=True, exist_ok=True)
        write(target / name)
    single = (folder / "PNM" / "binary10.pgm").read_bytes()
    (folder / "PNM" / "two_images.pgm").write_bytes(2 * single)
    (folder / "raw").mkdir(exist_ok=True)
    for i, layout in enumerate(RAW):
        (folder / "raw" / str(i)).write_bytes(f"8x4,{layout}\n".encode() + bytes(range(160)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
