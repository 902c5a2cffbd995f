"""Each format against a reader that shares no code with the program's: at least 40 variants of each, counted.

The other suites of this folder have what this one has not: refusals, warnings, and files by hand."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import png
import pytest
import test_variants as small
import test_variants_hdr as light
import test_variants_npy as arrays
import test_variants_tiff as tiff
import tifffile
from PIL import Image
from test_variants import SIZES, Dump, blocks, noise

Array = np.ndarray
LEAST = 40
WIDTHS = (1, 2, 3, 4, 5, 31, 32, 33)


class Variant(NamedTuple):
    """A file, what the independent reader sees of it, and the number that means 1 to the program (0: none)."""

    path: Path
    expected: Array
    full_scale: float
    raw: str = ""


# --- Readers of this file's own, by the formats' descriptions ---


def radiance(data: bytes) -> Array:
    """Scanlines that are flat, or of new or old runs."""
    head, _, rest = data.partition(b"\n\n") if b"\n\n" in data else data.partition(b"\r\n\r\n")
    assert b"32-bit_rle_rgbe" in head
    line, _, body = rest.partition(b"\n")
    height, width = (int(word) for word in line.split()[1::2])
    result = np.zeros((height, width, 4), np.uint8)
    at = 0
    for row in result:
        if width >= 8 and body[at : at + 2] == b"\2\2" and body[at + 2] < 128:
            at += 4
            for component in range(4):
                x = 0
                while x < width:
                    count = body[at]
                    if count > 128:
                        row[x : x + count - 128, component] = body[at + 1]
                        x, at = x + count - 128, at + 2
                    else:
                        row[x : x + count, component] = list(body[at + 1 : at + 1 + count])
                        x, at = x + count, at + 1 + count
            continue
        x, shift = 0, 0
        while x < width:
            pixel = body[at : at + 4]
            at += 4
            if pixel[:3] == b"\1\1\1":
                count = pixel[3] << shift
                row[x : x + count] = row[x - 1]
                x, shift = x + count, shift + 8
            else:
                row[x] = list(pixel)
                x, shift = x + 1, 0
    assert at == len(body)
    scale = np.where(result[..., 3] > 0, np.exp2(result[..., 3].astype(float) - 136), 0)
    return (result[..., :3] * scale[..., None]).astype(np.float32)


def bits_of(data: bytes, bits: int, count: int) -> list[int]:
    """Numbers bit by bit, the lowest first."""
    whole = int.from_bytes(data, "little")
    return [whole >> bits * i & (1 << bits) - 1 for i in range(count)]


def unpacked(data: bytes, layout: str, count: int) -> Array:
    """Raw frames pixel by pixel."""
    word, *more = layout.split(",")
    bits = int(word)
    if bits == 8:
        return np.array(list(data))
    if "genicam" in more:
        return np.array(bits_of(data, bits, count))
    if "gige" in more:
        triples = zip(data[::3], data[1::3], data[2::3], strict=True)
        low = 2 ** (bits - 8) - 1
        return np.array([v for a, b, c in triples for v in (a << bits - 8 | b & low, c << bits - 8 | b >> 4 & low)])
    if "mipi" in more:
        group = {10: 4, 12: 2, 14: 4}[bits]
        size = group * bits // 8
        codes = []
        for at in range(0, len(data), size):
            low = bits_of(data[at + group : at + size], bits - 8, group)
            codes += [upper << bits - 8 | lower for upper, lower in zip(data[at : at + group], low, strict=True)]
        return np.array(codes)
    order = "big" if "big" in more else "little"
    words = [int.from_bytes(data[i : i + 2], order) for i in range(0, len(data), 2)]  # type: ignore[arg-type]
    return np.array(words) >> (16 - bits if "msb" in more else 0)


def numbers(data: bytes) -> Array:
    """PNM as text, without its comments."""
    words = b" ".join(line.partition(b"#")[0] for line in data.splitlines()).split()
    width, height = int(words[1]), int(words[2])
    return np.array([int(word) for word in words[4:]]).reshape(height, width, 3 if words[0] == b"P3" else 1)


def opened(path: Path, mode: str = "") -> Array:
    """What Pillow sees."""
    with Image.open(path) as image:
        return np.asarray(image.convert(mode) if mode else image)


# --- Files ---


def of_png(folder: Path) -> Iterator[Variant]:
    kinds = [*((1, bits) for bits in (1, 2, 4, 8, 16)), *((c, bits) for c in (2, 3, 4) for bits in (8, 16))]
    for index, (size, (channels, bits), interlace) in enumerate(itertools.product(SIZES, kinds, (False, True))):
        path = folder / f"{index}.png"
        with path.open("wb") as stream:
            png.Writer(
                *size, greyscale=channels < 3, alpha=channels % 2 == 0, bitdepth=bits, interlace=interlace,
                compression=index % 10,
            ).write(stream, noise(size, channels, 2**bits - 1).reshape(size[1], -1).tolist())  # fmt: skip
        _, _, rows, _ = png.Reader(filename=str(path)).read()
        read = np.array([list(row) for row in rows]).reshape(size[1], size[0], channels)
        colors = read if channels % 2 else read[..., :-1]
        yield Variant(path, colors * 255 // (2**bits - 1) if bits < 8 else colors, 65535 if bits == 16 else 255)


def of_tiff(folder: Path) -> Iterator[Variant]:
    more: dict[str, dict] = {"big": {"bigtiff": True, "tile": (16, 16), "byteorder": ">"}}
    for (name, layout), dtype in itertools.product({**tiff.LAYOUTS, **more}.items(), tiff.TYPES):
        path = folder / f"{name}_{np.dtype(dtype)}.tif"
        tifffile.imwrite(path, tiff.values(dtype), photometric="minisblack", **layout)
        yield Variant(path, tifffile.imread(path), {"uint8": 255, "uint16": 65535}.get(str(np.dtype(dtype)), 0))


def of_exr(folder: Path) -> Iterator[Variant]:
    """Lossless compressions that this file's reader knows; each kind of sample; windows that begin elsewhere."""
    import OpenEXR

    known = ("none", "rle", "zips", "zip")
    for index, (size, compression, kind) in enumerate(itertools.product(SIZES, known, ("half", "float", "uint"))):
        path = folder / f"{index}.exr"
        x, y = (0, 0) if index % 2 else (-7, 13)
        window = (np.array([x, y], np.int32), np.array([x + size[0] - 1, y + size[1] - 1], np.int32))
        header = {"compression": light.COMPRESSIONS[compression], "type": OpenEXR.scanlineimage}
        header |= {"dataWindow": window, "displayWindow": window}
        OpenEXR.File(header, {"Y": light.plane(size, kind, index)}).write(str(path))
        yield Variant(path, light.decoded(path)["Y"], 0)


def of_hdr(folder: Path) -> Iterator[Variant]:
    sizes = (*SIZES, (8, 2), (300, 4))
    writers = (light.flat, light.old_runs, light.new_runs)
    for index, (size, head, runs, write) in enumerate(itertools.product(sizes, light.HEADERS, (False, True), writers)):
        if write is light.new_runs and size[0] < 8:
            continue  # the format has none
        rgbe = light.pixels_of(size, runs)
        rgbe[..., 0] |= 4  # flat rows have no mark of runs
        path = folder / f"{index}.hdr"
        path.write_bytes(light.HEADERS[head].format(w=size[0], h=size[1]).encode() + write(rgbe))
        yield Variant(path, radiance(path.read_bytes()), 0)


def of_npy(folder: Path) -> Iterator[Variant]:
    for index, (shape, dtype) in enumerate(itertools.product(arrays.SHAPES.values(), arrays.TYPES)):
        path = folder / f"{index}.npy"
        array = arrays.values(dtype, shape)
        with path.open("wb") as stream:
            version = ((1, 0), (2, 0), (3, 0))[index % 3]
            np.lib.format.write_array(stream, np.asfortranarray(array) if index % 2 else array, version=version)
        yield Variant(path, np.load(path), {"u1": 255, "u2": 65535}.get(np.dtype(dtype).str[1:], 0))


def of_pnm(folder: Path) -> Iterator[Variant]:
    """Pillow fails at some comments, takes the second end of a line for a pixel, reads no words of three channels, and
    scales other maxima."""
    for index, (size, kind, header) in enumerate(itertools.product(SIZES, (2, 3, 5, 6), small.PNM_HEADERS.values())):
        if kind > 3 and ("#" in header or "\r" in header):
            continue
        path = folder / f"{index}.pnm"
        gray = kind in (2, 5)
        maximum = 65535 if gray and index % 2 else 255
        path.write_bytes(small.pnm(kind, noise(size, 1 if gray else 3, maximum), maximum, header))
        yield Variant(path, numbers(path.read_bytes()) if kind < 4 else opened(path), maximum)


def of_jpeg(folder: Path) -> Iterator[Variant]:
    options: list[dict] = [{}, {"progressive": True}, {"quality": 100}, {"quality": 5}, {"optimize": True}]
    options += [{"restart_marker_blocks": 1}]
    for index, (size, channels, more) in enumerate(itertools.product(SIZES, (1, 3), options)):
        path = folder / f"{index}.jpg"
        Image.fromarray(noise(size, channels)).save(path, **more)
        yield Variant(path, opened(path), 255)


def of_bmp(folder: Path) -> Iterator[Variant]:
    for width, mode in itertools.product(WIDTHS, ("1", "L", "P", "RGB", "RGBA")):
        path = folder / f"{mode}{width}.bmp"
        values = noise((width, 6), max(len(mode), 1) if mode.startswith("RGB") else 1)
        image = Image.fromarray(values > 127) if mode == "1" else Image.fromarray(values)
        if mode == "P":
            image = Image.frombytes("P", (width, 6), values.tobytes())
            image.putpalette(np.random.default_rng(width).integers(0, 256, 768, dtype=np.uint8).tobytes())
        image.save(path)
        read = opened(path, "RGB" if mode in ("P", "RGBA") else "")
        yield Variant(path, read * 255 if mode == "1" else read, 255)


def of_tga(folder: Path) -> Iterator[Variant]:
    modes = {"L": 1, "LA": 2, "RGB": 3, "RGBA": 4}
    for size, mode, compression, orientation in itertools.product(SIZES, modes, (None, "tga_rle"), (1, -1)):
        path = folder / f"{size[0]}{mode}{compression}{orientation}.tga"
        Image.fromarray(blocks(size, modes[mode])).save(path, compression=compression, orientation=orientation)
        read = opened(path)
        yield Variant(path, read[..., :-1] if mode.endswith("A") else read, 255)


def of_raw(folder: Path) -> Iterator[Variant]:
    for layout, frames, offset in itertools.product(sorted(small.RAW), (1, 3), (0, 37)):
        bits = int(layout.split(",")[0])
        codes = np.random.default_rng(bits).integers(0, 2**bits, (frames, 12, 40), dtype=np.uint16)
        path = folder / f"{layout}_{frames}_{offset}.raw"
        path.write_bytes(b"\xff" * offset + small.RAW[layout](codes))
        read = unpacked(path.read_bytes()[offset:], layout, codes.size).reshape(codes.shape)
        yield Variant(path, read, 2**bits - 1, f"40x12,{layout}" + (f",{offset}" if offset else ""))


READERS: dict[str, tuple[str, Callable[[Path], Iterator[Variant]]]] = {
    "PNG": ("pypng", of_png),
    "TIFF": ("tifffile", of_tiff),
    "EXR": ("this test's own", of_exr),
    "Radiance HDR": ("this test's own", of_hdr),
    "NPY": ("NumPy", of_npy),
    "PNM": ("Pillow and, of text, this test's own", of_pnm),
    "JPEG": ("Pillow", of_jpeg),
    "BMP": ("Pillow", of_bmp),
    "TGA": ("Pillow", of_tga),
    "raw": ("this test's own", of_raw),
}


@pytest.mark.parametrize("name", READERS)
def test_each_format_against_an_independent_reader(tmp_path: Path, name: str) -> None:
    reader, variants = READERS[name]
    contents = set()
    for variant in variants(tmp_path):
        contents.add(variant.path.read_bytes() + variant.raw.encode())
        given = Dump(variant.path, variant.raw)
        assert not given.error, f"{variant.path.name}: {given.error}"
        assert given.full_scale == variant.full_scale, variant.path.name
        colors = given.values[..., :-1] if given.alpha else given.values
        expected = np.squeeze(variant.expected).astype(np.float32)
        np.testing.assert_array_equal(np.squeeze(colors), expected, err_msg=variant.path.name)
    print(f"\n{name}: {len(contents)} variants. Reader: {reader}")
    assert len(contents) >= LEAST


def test_the_table_names_every_format() -> None:
    """Of docs/guide/files.md, where PNM has its kinds behind it."""
    guide = (small.ROOT / "docs" / "guide" / "files.md").read_text()
    rows = guide[guide.index("| format |") :].split("\n\n")[0].splitlines()[2:]
    assert sorted(row.split("|")[1].split(":")[0].strip() for row in rows) == sorted(READERS)
