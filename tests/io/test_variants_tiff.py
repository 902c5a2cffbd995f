"""TIFF in many variants: equal to what tifffile or Pillow reads, or refused with words."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image
from test_variants import Dump, noise

Array = np.ndarray
SIZE = (41, 23)  # no multiple of 8: rows of packed samples end within a byte


def bit_rows(codes: Array, bits: int) -> bytes:
    """Samples bit by bit, the highest first; each row begins a byte."""
    shifts = np.arange(bits - 1, -1, -1)
    rows = (codes.astype(np.int64)[..., None] >> shifts & 1).reshape(codes.shape[0], -1)
    return np.packbits(rows.astype(np.uint8), axis=1).tobytes()


def tiff_of(data: bytes, size: tuple[int, int], bits: int, order: str = "<", **tags: int | tuple[int, ...]) -> bytes:
    """One strip by hand: what tifffile writes only with further packages."""
    names = {
        "photometric": 262,
        "channels": 277,
        "format": 339,
        "fill_order": 266,
        "colors": 320,
        "planar": 284,
        "compression": 259,
        "exif": 34665,
    }
    entries: dict[int, int | tuple[int, ...]] = {
        256: size[0], 257: size[1], 258: bits, 259: 1, 262: 1, 277: 1, 278: size[1], 279: len(data), 273: 8,
        **{names[name]: value for name, value in tags.items()},
    }  # fmt: skip
    at = 8 + len(data) + len(data) % 2
    behind, directory = b"", struct.pack(order + "H", len(entries))
    end = at + 2 + 12 * len(entries) + 4
    for tag, value in sorted(entries.items()):
        if isinstance(value, tuple):
            directory += struct.pack(order + "HHII", tag, 3, len(value), end + len(behind))
            behind += struct.pack(f"{order}{len(value)}H", *value)
        else:
            directory += struct.pack(order + "HHII", tag, 4, 1, value)
    mark = b"II*\0" if order == "<" else b"MM\0*"
    return mark + struct.pack(order + "I", at) + data + bytes(len(data) % 2) + directory + bytes(4) + behind


def packed_tiff(codes: Array, bits: int, **tags: int) -> bytes:
    return tiff_of(bit_rows(codes, bits), (codes.shape[1], codes.shape[0]), bits, **tags)


TYPES = [np.uint8, np.uint16, np.uint32, np.int8, np.int16, np.int32, np.float16, np.float32, np.float64]
LAYOUTS: dict[str, dict] = {
    "plain": {},
    "big_endian": {"byteorder": ">"},
    "bigtiff": {"bigtiff": True},
    "strips": {"rowsperstrip": 5},
    "tiles": {"tile": (16, 32)},
    "deflate": {"compression": "zlib"},
    "deflate_tiles": {"compression": "zlib", "tile": (16, 16), "byteorder": ">"},
}


def values(dtype: type) -> Array:
    random = np.random.default_rng(7)
    if np.issubdtype(dtype, np.floating):
        return random.normal(0.5, 0.2, SIZE[::-1]).astype(dtype)
    limits = np.iinfo(dtype)
    # Whole numbers that float32 holds.
    return random.integers(max(limits.min, -(2**23)), min(limits.max, 2**23), SIZE[::-1], dtype=np.int64).astype(dtype)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_types_and_layouts(tmp_path: Path, layout: str) -> None:
    for dtype in TYPES:
        path = tmp_path / f"{np.dtype(dtype)}.tif"
        tifffile.imwrite(path, values(dtype), photometric="minisblack", **LAYOUTS[layout])
        Dump(path).check(tifffile.imread(path), {"uint8": 255, "uint16": 65535}.get(str(np.dtype(dtype)), 0))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_colors(tmp_path: Path, dtype: type) -> None:
    color = np.stack([values(dtype), values(dtype)[::-1], values(dtype)[:, ::-1]])
    for name, planes, planar in (("chunky", np.moveaxis(color, 0, -1), "contig"), ("planar", color, "separate")):
        for more in ({}, {"tile": (16, 16)}, {"compression": "zlib"}):
            path = tmp_path / f"{name}.tif"
            tifffile.imwrite(path, np.ascontiguousarray(planes), photometric="rgb", planarconfig=planar, **more)
            given = Dump(path)
            np.testing.assert_array_equal(given.values[0], np.moveaxis(color, 0, -1).astype(np.float32))


@pytest.mark.parametrize("bits", [1, 2, 4, 5, 7, 9, 10, 12, 14, 15])
def test_packed_samples(tmp_path: Path, bits: int) -> None:
    codes = np.random.default_rng(bits).integers(0, 2**bits, SIZE[::-1], dtype=np.uint16)
    top = 2**bits - 1
    scale = 255 / top if bits < 8 else 1
    for order in "<>":
        (tmp_path / "a.tif").write_bytes(tiff_of(bit_rows(codes, bits), SIZE, bits, order))
        given = Dump(tmp_path / "a.tif")
        assert given.full_scale == (255 if bits < 8 else top)
        np.testing.assert_allclose(given.values[0], codes * scale, rtol=1e-6)
        if bits == 1:
            with Image.open(tmp_path / "a.tif") as image:
                np.testing.assert_array_equal(np.asarray(image), codes == 1)
    (tmp_path / "white.tif").write_bytes(packed_tiff(codes, bits, photometric=0))
    np.testing.assert_allclose(Dump(tmp_path / "white.tif").values[0], (top - codes) * scale, rtol=1e-6)
    data = bytes(int(f"{byte:08b}"[::-1], 2) for byte in bit_rows(codes, bits))
    (tmp_path / "reversed.tif").write_bytes(tiff_of(data, SIZE, bits, fill_order=2))
    np.testing.assert_allclose(Dump(tmp_path / "reversed.tif").values[0], codes * scale, rtol=1e-6)


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "packbits", "tiff_adobe_deflate", "group4"])
def test_pillow(tmp_path: Path, compression: str | None) -> None:
    bits = noise(SIZE) > 127
    images = {"1": Image.fromarray(bits)}
    if compression != "group4":
        palette = Image.fromarray(noise(SIZE)).convert("P")
        palette.putpalette(np.random.default_rng(2).integers(0, 256, 768, dtype=np.uint8).tobytes())
        images |= {"P": palette, "L": Image.fromarray(noise(SIZE)), "RGB": Image.fromarray(noise(SIZE, 3)),
                   "RGBA": Image.fromarray(noise(SIZE, 4)), "I;16": Image.fromarray(noise(SIZE, 1, 65535)),
                   "F": Image.fromarray(noise(SIZE).astype(np.float32))}  # fmt: skip
    for mode, image in images.items():
        path = tmp_path / f"{mode.replace(';', '')}.tif"
        image.save(path, compression=compression)
        given = Dump(path)
        assert not given.error, (mode, given.error)
        with Image.open(path) as read:
            expected = np.asarray(read.convert("RGB") if mode in ("P", "RGBA") else read).astype(np.float64)
        shown = given.values[0][..., :3] if mode == "RGBA" else given.values[0]
        scale = 255 if mode == "1" else 257 if mode == "P" else 1
        np.testing.assert_array_equal(shown, (expected * scale).astype(np.float32))


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_palettes(tmp_path: Path, bits: int) -> None:
    codes = np.random.default_rng(bits).integers(0, 2**bits, SIZE[::-1], dtype=np.uint8)
    random = np.random.default_rng(3)
    for name, colors in (
        ("colors", random.integers(0, 65536, (3, 2**bits))),
        ("gray", np.stack([random.integers(256, 65536, 2**bits)] * 3)),
        ("of_8_bits", random.integers(0, 256, (3, 2**bits))),
    ):
        data = packed_tiff(codes, bits, photometric=3, colors=tuple(int(c) for c in colors.ravel()))
        (tmp_path / f"{name}.tif").write_bytes(data)
        given = Dump(tmp_path / f"{name}.tif")
        assert given.full_scale == 65535 and given.channels == (1 if name == "gray" else 3)
        expected = np.moveaxis(colors[:, codes], 0, -1) * (257 if name == "of_8_bits" else 1)
        np.testing.assert_array_equal(given.values[0], expected[..., 0] if name == "gray" else expected)


def minisblack(path: Path) -> None:
    image = tifffile.imread(path)
    white = image.max()
    tifffile.imwrite(path, white - image, photometric="minisblack")


def as_rgb(path: Path) -> None:
    with Image.open(path) as image:
        image.convert("RGB").save(path)


REFUSED: dict[str, tuple[Callable[[Path], object], str, Callable[[Path], object]]] = {
    "white_float": (
        lambda p: tifffile.imwrite(p, values(np.float32), photometric="miniswhite"),
        'photometric="minisblack")',
        minisblack,
    ),
    "white_signed": (
        lambda p: tifffile.imwrite(p, values(np.int16), photometric="miniswhite"),
        'photometric="minisblack")',
        minisblack,
    ),
    "complex": (
        lambda p: tifffile.imwrite(p, values(np.float32).astype(np.complex64)),
        "Save numpy.abs(image).astype(numpy.float32)",
        lambda p: tifffile.imwrite(p, np.abs(tifffile.imread(p)).astype(np.float32)),
    ),
    "cmyk": (lambda p: Image.fromarray(noise(SIZE, 4), "CMYK").save(p), "convert it to RGB", as_rgb),
    "lab": (
        lambda p: tifffile.imwrite(p, noise(SIZE, 3), photometric="cielab"),
        "convert it to RGB",
        lambda p: tifffile.imwrite(p, tifffile.imread(p), photometric="rgb"),
    ),
    "palette_without_colors": (
        lambda p: p.write_bytes(tiff_of(noise(SIZE).tobytes(), SIZE, 8, photometric=3)),
        'photometric="minisblack")',
        minisblack,
    ),
    "palette_of_16_bits": (
        lambda p: p.write_bytes(tiff_of(noise(SIZE, 1, 65535).tobytes(), SIZE, 16, ">", photometric=3)),
        'photometric="minisblack")',
        minisblack,
    ),
    "palette_cut_short": (
        lambda p: p.write_bytes(tiff_of(noise(SIZE).tobytes(), SIZE, 8, photometric=3, colors=(1, 2, 3))),
        'photometric="minisblack")',
        minisblack,
    ),
    "volume": (
        lambda p: tifffile.imwrite(
            p, np.stack([noise(SIZE)] * 3), volumetric=True, tile=(3, 16, 16), photometric="minisblack"
        ),
        "holds a volume of 3 images in one page (tag ImageDepth). Save tifffile.imwrite(",
        lambda p: tifffile.imwrite(p, tifffile.imread(p), photometric="minisblack"),
    ),
    "jpeg_2000": (
        lambda p: p.write_bytes(tiff_of(noise(SIZE).tobytes(), SIZE, 8, compression=34712)),
        "its compression (number 34712) is not read; save it without, or with deflate or LZW",
        lambda p: tifffile.imwrite(p, noise(SIZE), compression="zlib"),
    ),
    "three_of_gray": (
        lambda p: tifffile.imwrite(p, noise(SIZE, 3), photometric="minisblack", planarconfig="contig"),
        "Save each channel as an image of its own",
        lambda p: tifffile.imwrite(p, np.ascontiguousarray(tifffile.imread(p)[..., 0])),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_have_a_way_out(tmp_path: Path, name: str) -> None:
    write, advice, follow = REFUSED[name]
    write(tmp_path / "a.tif")
    error = Dump(tmp_path / "a.tif").error
    assert advice in error
    follow(tmp_path / "a.tif")
    given = Dump(tmp_path / "a.tif")
    assert not given.error
    expected = tifffile.imread(tmp_path / "a.tif").astype(np.float32)
    np.testing.assert_array_equal(np.squeeze(given.values), expected)
