"""Image files of every format and layout that the program reads, written without it."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import OpenEXR
import png
import tifffile
from PIL import Image

Array = np.ndarray
WIDTH, HEIGHT = 40, 28


def gray8() -> Array:
    return np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH), dtype=np.uint8)


def gray16() -> Array:
    return np.random.default_rng(2).integers(0, 65536, (HEIGHT, WIDTH), dtype=np.uint16)


def gray10() -> Array:
    return np.random.default_rng(3).integers(0, 1024, (HEIGHT, WIDTH), dtype=np.uint16)


def real() -> Array:
    return np.random.default_rng(4).random((HEIGHT, WIDTH), dtype=np.float32) + np.float32(0.01)


def half() -> Array:
    return real().astype(np.float16)


def rgbe() -> Array:
    """Gray pixels with a mantissa of 128 to 255 and their exponents, [height, width, 4] bytes, with runs to encode."""
    rng = np.random.default_rng(5)
    mantissa = np.repeat(rng.integers(128, 256, (HEIGHT, WIDTH // 4), dtype=np.uint8), 4, axis=1)
    exponent = np.repeat(rng.integers(120, 132, (HEIGHT, WIDTH // 8), dtype=np.uint8), 8, axis=1)
    mantissa[:, ::7] = rng.integers(128, 256, mantissa[:, ::7].shape)
    return np.stack([mantissa, mantissa, mantissa, exponent], axis=-1)


def rgbe_values() -> Array:
    pixels = rgbe().astype(float)
    return (pixels[..., 0] * 2.0 ** (pixels[..., 3] - 136)).astype(np.float32)


def scaled(codes: Array, full_scale: float) -> Array:
    return (codes / full_scale).astype(np.float32)


def png_interlaced(path: Path, codes: Array) -> None:
    with path.open("wb") as stream:
        writer = png.Writer(codes.shape[1], codes.shape[0], greyscale=True, bitdepth=8 * codes.itemsize, interlace=True)
        writer.write(stream, codes.tolist())


def png_palette(path: Path, codes: Array) -> None:
    with path.open("wb") as stream:
        palette = [(i, i, i) for i in range(256)]
        png.Writer(codes.shape[1], codes.shape[0], palette=palette, bitdepth=8).write(stream, codes.tolist())


def png_bits(path: Path, bits: int) -> None:
    codes = gray8() >> (8 - bits)
    with path.open("wb") as stream:
        png.Writer(codes.shape[1], codes.shape[0], greyscale=True, bitdepth=bits).write(stream, codes.tolist())


def png_alpha(path: Path, codes: Array, bits: int) -> None:
    opaque = np.full_like(codes, 2**bits - 1)
    pixels = np.stack([codes, opaque], axis=-1).reshape(codes.shape[0], -1)
    with path.open("wb") as stream:
        writer = png.Writer(codes.shape[1], codes.shape[0], greyscale=True, alpha=True, bitdepth=bits)
        writer.write(stream, pixels.tolist())


def rgb(codes: Array) -> Array:
    return np.repeat(codes[..., None], 3, axis=-1)


def pgm(path: Path, codes: Array, maximum: int, comment: str = "") -> None:
    data = codes.astype(">u2" if maximum > 255 else "u1").tobytes()
    path.write_bytes(f"P5\n{comment}{codes.shape[1]} {codes.shape[0]}\n{maximum}\n".encode() + data)


def pgm_text(path: Path, codes: Array, maximum: int) -> None:
    rows = "\n".join(" ".join(map(str, row)) for row in codes.tolist())
    path.write_text(f"P2\n# a comment\n{codes.shape[1]} {codes.shape[0]} {maximum}\n{rows}\n")


def jpeg() -> bytes:
    stream = io.BytesIO()
    Image.fromarray(gray8()).save(stream, "JPEG", quality=95)
    return stream.getvalue()


def jpeg_values() -> Array:
    return scaled(np.asarray(Image.open(io.BytesIO(jpeg()))), 255)


def tga(path: Path, runs: bool) -> None:
    """Without the footer: a file that is cut there is whole."""
    Image.fromarray(gray8() & 0xF0).save(path, compression="tga_rle" if runs else None)
    path.write_bytes(path.read_bytes().removesuffix(b"TRUEVISION-XFILE.\0")[:-8])


def _runs(values: list[int]) -> bytes:
    """New run-length encoding of one component of one scanline."""
    out = bytearray()
    at = 0
    while at < len(values):
        run = 1
        while at + run < len(values) and run < 127 and values[at + run] == values[at]:
            run += 1
        if run >= 3:
            out += bytes([128 + run, values[at]])
            at += run
            continue
        end = at
        while end < len(values) and end - at < 128 and values[end : end + 3].count(values[end]) != 3:
            end += 1
        out += bytes([end - at]) + bytes(values[at:end])
        at = end
    return bytes(out)


def hdr_header(width: int, height: int) -> bytes:
    return f"#?RADIANCE\n# written by hand\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()


def hdr_flat(path: Path) -> None:
    path.write_bytes(hdr_header(WIDTH, HEIGHT) + rgbe().tobytes())


def hdr_runs(path: Path) -> None:
    data = bytearray(hdr_header(WIDTH, HEIGHT))
    for row in rgbe():
        data += bytes([2, 2, WIDTH >> 8, WIDTH & 255])
        for component in range(4):
            data += _runs(row[:, component].tolist())
    path.write_bytes(bytes(data))


def hdr_old_runs(path: Path) -> None:
    data = bytearray(hdr_header(WIDTH, HEIGHT))
    for row in rgbe():
        at = 0
        while at < WIDTH:
            run = 1
            while at + run < WIDTH and (row[at + run] == row[at]).all():
                run += 1
            data += row[at].tobytes()
            if run > 1:
                data += bytes([1, 1, 1, run - 1])
            at += run
    path.write_bytes(bytes(data))


def exr(path: Path, channels: dict[str, Array], **header: object) -> None:
    settings = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    # A copy: the library puts its own objects into the dictionary.
    OpenEXR.File(settings, dict(channels)).write(str(path))


def exr_parts(path: Path, **parts: dict[str, Array]) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File([OpenEXR.Part(dict(header), dict(planes), name) for name, planes in parts.items()]).write(str(path))


def exr_tiled(path: Path, channels: dict[str, Array]) -> None:
    tiles = OpenEXR.TileDescription()
    tiles.xSize = 16
    tiles.ySize = 16
    tiles.mode = OpenEXR.ONE_LEVEL
    exr(path, channels, type=OpenEXR.tiledimage, tiles=tiles)


def exr_offset(path: Path) -> None:
    """The data window is the image, somewhere else than at the origin."""
    window = (np.array([-7, 13], np.int32), np.array([-7 + WIDTH - 1, 13 + HEIGHT - 1], np.int32))
    exr(path, {"Y": real()}, dataWindow=window, displayWindow=window)


CROP = (5, 3, 31, 20)  # first and last column and row


def exr_crop(path: Path) -> None:
    """Only a part of the image is stored."""
    x0, y0, x1, y1 = CROP
    stored = np.ascontiguousarray(real()[y0 : y1 + 1, x0 : x1 + 1])
    exr(
        path,
        {"Y": stored},
        dataWindow=(np.array([x0, y0], np.int32), np.array([x1, y1], np.int32)),
        displayWindow=(np.array([0, 0], np.int32), np.array([WIDTH - 1, HEIGHT - 1], np.int32)),
    )


def cropped() -> Array:
    x0, y0, x1, y1 = CROP
    image = np.zeros_like(real())
    image[y0 : y1 + 1, x0 : x1 + 1] = real()[y0 : y1 + 1, x0 : x1 + 1]
    return image


def npy(path: Path, array: Array) -> None:
    with path.open("wb") as stream:
        np.save(stream, array)


def npy_version(path: Path, array: Array, version: tuple[int, int]) -> None:
    with path.open("wb") as stream:
        np.lib.format.write_array(stream, array, version=version)


Writer = Callable[[Path], None]

# What is said of every file of a kind.
# Integers that are taken as they are: their type tells no full scale, and 1 is full scale.
NO_FULL_SCALE = {"i4.npy", "y_uint.exr"}
WARNINGS = {".jpg": "the compression of JPEG is lossy"}

# Name with extension -> how it is written, and the float32 values that the program must see.
FORMATS: dict[str, tuple[Writer, Callable[[], Array]]] = {
    "gray8.png": (lambda p: iio.imwrite(p, gray8()), lambda: scaled(gray8(), 255)),
    "gray16.png": (lambda p: iio.imwrite(p, gray16()), lambda: scaled(gray16(), 65535)),
    "rgb8.png": (lambda p: iio.imwrite(p, rgb(gray8())), lambda: scaled(gray8(), 255)),
    "interlaced8.png": (lambda p: png_interlaced(p, gray8()), lambda: scaled(gray8(), 255)),
    "interlaced16.png": (lambda p: png_interlaced(p, gray16()), lambda: scaled(gray16(), 65535)),
    "palette.png": (lambda p: png_palette(p, gray8()), lambda: scaled(gray8(), 255)),
    "one_bit.png": (lambda p: png_bits(p, 1), lambda: scaled(gray8() >> 7, 1)),
    "four_bits.png": (lambda p: png_bits(p, 4), lambda: scaled(gray8() >> 4, 15)),
    "alpha8.png": (lambda p: png_alpha(p, gray8(), 8), lambda: scaled(gray8(), 255)),
    "alpha16.png": (lambda p: png_alpha(p, gray16(), 16), lambda: scaled(gray16(), 65535)),
    "gray8.tiff": (lambda p: tifffile.imwrite(p, gray8()), lambda: scaled(gray8(), 255)),
    "gray16.tiff": (lambda p: tifffile.imwrite(p, gray16()), lambda: scaled(gray16(), 65535)),
    "big_endian.tiff": (lambda p: tifffile.imwrite(p, gray16(), byteorder=">"), lambda: scaled(gray16(), 65535)),
    "big.tiff": (lambda p: tifffile.imwrite(p, real(), bigtiff=True), real),
    "strips.tiff": (lambda p: tifffile.imwrite(p, gray16(), rowsperstrip=5), lambda: scaled(gray16(), 65535)),
    "tiles.tiff": (lambda p: tifffile.imwrite(p, gray16(), tile=(16, 16)), lambda: scaled(gray16(), 65535)),
    "lzw.tiff": (
        lambda p: iio.imwrite(p, gray8(), plugin="pillow", compression="tiff_lzw"),
        lambda: scaled(gray8(), 255),
    ),
    "deflate.tiff": (lambda p: tifffile.imwrite(p, real(), compression="zlib"), real),
    "white_is_zero.tiff": (
        lambda p: tifffile.imwrite(p, gray8(), photometric="miniswhite"),
        lambda: scaled(255 - gray8(), 255),
    ),
    "rgb_planes.tiff": (
        lambda p: tifffile.imwrite(p, np.moveaxis(rgb(gray16()), -1, 0), photometric="rgb", planarconfig="separate"),
        lambda: scaled(gray16(), 65535),
    ),
    "rgb_tiles.tiff": (
        lambda p: tifffile.imwrite(p, rgb(gray8()), photometric="rgb", tile=(16, 16)),
        lambda: scaled(gray8(), 255),
    ),
    "half.tiff": (lambda p: tifffile.imwrite(p, half()), lambda: half().astype(np.float32)),
    "float32.tiff": (lambda p: tifffile.imwrite(p, real()), real),
    "float64.tiff": (lambda p: tifffile.imwrite(p, real().astype(float)), real),
    "y_float.exr": (lambda p: exr(p, {"Y": real()}), real),
    "y_half.exr": (lambda p: exr(p, {"Y": half()}), lambda: half().astype(np.float32)),
    "y_uint.exr": (lambda p: exr(p, {"Y": gray10().astype(np.uint32)}), lambda: gray10().astype(np.float32)),
    "one_channel.exr": (lambda p: exr(p, {"infrared": real()}), real),
    "rgb.exr": (lambda p: exr(p, {"R": real(), "G": real(), "B": real()}), real),
    "tiles.exr": (lambda p: exr_tiled(p, {"Y": real()}), real),
    "parts.exr": (
        lambda p: exr_parts(p, rgba={"R": half(), "G": half(), "B": half()}, noise={"V": real()}),
        lambda: half().astype(np.float32),
    ),
    "piz.exr": (lambda p: exr(p, {"Y": real()}, compression=OpenEXR.PIZ_COMPRESSION), real),
    "offset.exr": (exr_offset, real),
    "crop.exr": (exr_crop, cropped),
    "flat.hdr": (hdr_flat, rgbe_values),
    "runs.hdr": (hdr_runs, rgbe_values),
    "old_runs.hdr": (hdr_old_runs, rgbe_values),
    "u1.npy": (lambda p: npy(p, gray8()), lambda: scaled(gray8(), 255)),
    "u2.npy": (lambda p: npy(p, gray16()), lambda: scaled(gray16(), 65535)),
    "u2_big_endian.npy": (lambda p: npy(p, gray16().astype(">u2")), lambda: scaled(gray16(), 65535)),
    "i4.npy": (lambda p: npy(p, gray10().astype(np.int32)), lambda: gray10().astype(np.float32)),
    "bool.npy": (lambda p: npy(p, gray8() > 128), lambda: (gray8() > 128).astype(np.float32)),
    "f2.npy": (lambda p: npy(p, half()), lambda: half().astype(np.float32)),
    "f8.npy": (lambda p: npy(p, real().astype(float)), real),
    "f8_big_endian.npy": (lambda p: npy(p, real().astype(">f8")), real),
    "fortran.npy": (lambda p: npy(p, np.asfortranarray(real())), real),
    "version2.npy": (lambda p: npy_version(p, real(), (2, 0)), real),
    "one_frame.npy": (lambda p: npy(p, real()[None]), real),
    "channels.npy": (lambda p: npy(p, rgb(real())), real),
    "binary8.pgm": (lambda p: pgm(p, gray8(), 255, "# a comment\n"), lambda: scaled(gray8(), 255)),
    "binary10.pgm": (lambda p: pgm(p, gray10(), 1023), lambda: scaled(gray10(), 1023)),
    "binary16.pgm": (lambda p: pgm(p, gray16(), 65535), lambda: scaled(gray16(), 65535)),
    "text.pgm": (lambda p: pgm_text(p, gray10(), 1023), lambda: scaled(gray10(), 1023)),
    "rgb.ppm": (lambda p: iio.imwrite(p, rgb(gray8())), lambda: scaled(gray8(), 255)),
    "any.pnm": (lambda p: pgm(p, gray10(), 1023), lambda: scaled(gray10(), 1023)),
    "gray.jpg": (lambda p: p.write_bytes(jpeg()), jpeg_values),
    "gray8.bmp": (lambda p: Image.fromarray(gray8()).save(p), lambda: scaled(gray8(), 255)),
    "rgb8.bmp": (lambda p: Image.fromarray(rgb(gray8())).save(p), lambda: scaled(gray8(), 255)),
    "plain.tga": (lambda p: tga(p, False), lambda: scaled(gray8() & 0xF0, 255)),
    "runs.tga": (lambda p: tga(p, True), lambda: scaled(gray8() & 0xF0, 255)),
}
