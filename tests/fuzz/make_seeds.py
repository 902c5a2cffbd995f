"""Writes small files of every format into FOLDER/FORMAT, for the fuzzers to begin with: make_seeds.py FOLDER."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE.parent / "tools"), str(HERE.parent / "io")]
import cli_images as images  # noqa: E402
import numpy as np  # noqa: E402
import png  # noqa: E402
import test_variants_pages as pages  # noqa: E402
import test_variants_tiff as tiff  # noqa: E402
import test_variants_words as words  # noqa: E402
import tifffile  # noqa: E402
from PIL import Image  # noqa: E402

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
    # What changes the meaning of numbers, and samples that are no whole bytes.
    codes = images.gray8()
    for i, (chunks, _) in enumerate(pages.CURVES.values()):
        (folder / "PNG" / f"curve_{i}.png").write_bytes(pages.png(codes, *chunks))
    for i, one in enumerate(pages.UNREADABLE.values()):
        (folder / "PNG" / f"unreadable_{i}.png").write_bytes(pages.png(codes, one))
    xmp = b'<rdf:Description tiff:Orientation="6"/>'
    (folder / "PNG" / "xmp.png").write_bytes(
        pages.png(codes, pages.chunk(b"iTXt", b"XML:com.adobe.xmp" + 5 * b"\0" + xmp))
    )
    Image.fromarray(codes).save(folder / "JPEG" / "xmp.jpg", xmp=xmp)
    with (folder / "PNG" / "short_palette.png").open("wb") as stream:
        colors = [(i, 9, 9) for i in range(15)]
        png.Writer(*codes.shape[::-1], palette=colors, bitdepth=4).write(stream, (codes >> 4).tolist())
    (folder / "TIFF" / "no_palette.tif").write_bytes(
        tiff.tiff_of(codes.tobytes(), codes.shape[::-1], 8, ">", photometric=3)
    )
    for name in ("<f4", ">f8", "<f2", ">i4"):
        np.save(folder / "NPY" / f"swapped_{name[1:]}.npy", (codes / 256).astype(name).byteswap())
    profile = pages.gray_profile(pages.curve(*range(9)))
    Image.fromarray(codes).save(folder / "JPEG" / "profile.jpg", icc_profile=profile)
    Image.fromarray(codes).save(folder / "TIFF" / "profile.tif", icc_profile=profile)
    for bits in (1, 4, 10, 12):
        (folder / "TIFF" / f"packed_{bits}.tif").write_bytes(tiff.packed_tiff(codes >> 8 - min(bits, 8), bits))
    palette = tuple(range(0, 65536, 4096)) * 3
    (folder / "TIFF" / "palette.tif").write_bytes(tiff.packed_tiff(codes >> 4, 4, photometric=3, colors=palette))
    words.imagej(folder / "TIFF" / "calibrated.tif", codes, *words.LINE)
    table = words.table(2.2, 256)
    tifffile.imwrite(folder / "TIFF" / "light.tif", codes, extratags=[(301, "H", len(table), table, True)])
    (folder / "BMP" / "profile.bmp").write_bytes(words.bmp_with(codes, 0x4D424544, behind=profile))
    (folder / "BMP" / "gamma.bmp").write_bytes(words.bmp_with(codes, 0, (144179,) * 3))
    (folder / "TGA" / "gamma.tga").write_bytes(words.tga_with_gamma(codes, (22, 10)))
    (folder / "raw").mkdir(exist_ok=True)
    for i, layout in enumerate(RAW):
        (folder / "raw" / str(i)).write_bytes(f"8x4,{layout}\n".encode() + bytes(range(160)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
