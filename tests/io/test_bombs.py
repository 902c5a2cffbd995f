"""Small files that promise much: no file of a megabyte takes more work than its pixels do, or 200 MB beyond them.

What is refused is refused with words; what is read is read within the bounds. Work is counted: what zlib makes, what is
read and how often, and what is allocated. The program of dump_image.cpp, which counts, lies beside the command line
program. At night each of them takes less than a second of the processor, too."""

from __future__ import annotations

import functools
import io
import os
import re
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

TESTS = Path(__file__).resolve().parents[1]
sys.path += [str(TESTS / "tools"), str(TESTS / "fuzz")]
import cli_images as images  # noqa: E402
import make_seeds  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
DUMP = Path(os.environ.get("CLSPECKLE_BIN", ROOT / "build" / "bin")) / "clspeckle-image-dump"
SIDE = 16384
MOST_SECONDS = 1.0  # of CPU time
MOST_BYTES = 200 << 20
MOST_READ = 8 << 20  # so often is each byte looked at


def read(path: Path, pixels: int, *more: str, seconds: float = 60.0) -> str:
    """Reads a file within the bounds. @return what was said."""
    assert path.stat().st_size <= 1 << 20
    # A process of its own, so that its children are this one's.
    script = (
        "import resource, subprocess, sys\n"
        "done = subprocess.run(sys.argv[1:], capture_output=True, text=True, timeout=60)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(done.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss)\n"
        "print(done.stdout + done.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, DUMP, path, "-", *more],
        capture_output=True,
        check=True,
        text=True,
        timeout=90,
        env={**os.environ, "CLSP_COUNT_WORK": "1"},
    )
    first, said = done.stdout.split("\n", 1)
    code, took, kilobytes = first.split()
    assert code in ("0", "1"), said
    assert int(kilobytes) << 10 < MOST_BYTES + 4 * pixels, f"{kilobytes} kB: {said}"
    counted = re.search(r"^work (\d+) (\d+) (\d+) (\d+) (\d+)$", said, re.MULTILINE)
    assert counted, said
    inflated, read_bytes, reads, allocated, blocks = map(int, counted.groups())
    # 16 bits for each sample, and a byte for each row before.
    assert inflated <= MOST_BYTES + 4 * pixels, f"zlib made {inflated} bytes: {said}"
    assert read_bytes <= MOST_READ, f"{read_bytes} bytes were read: {said}"
    size = path.stat().st_size
    assert reads <= size + 1000, f"{reads} reads: {said}"
    assert allocated <= MOST_BYTES + 16 * pixels, f"{allocated} bytes were allocated: {said}"
    assert blocks <= 2 * size + 10_000, f"{blocks} blocks were allocated: {said}"
    assert float(took) < seconds, f"{took} s: {said}"
    return said


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


@functools.cache
def zeros(size: int) -> bytes:
    """So many of them, deflated, without taking them."""
    packer = zlib.compressobj(9)
    parts = [packer.compress(bytes(1 << 20)) for _ in range(size >> 20)]
    return b"".join([*parts, packer.compress(bytes(size & ((1 << 20) - 1))), packer.flush()])


def png(side: int, bits: int = 8, color: int = 0, interlaced: int = 0, extra: bytes = b"", channels: int = 1) -> bytes:
    header = struct.pack(">IIBBBBB", side, side, bits, color, 0, 0, interlaced)
    rows = side * ((side * bits * channels + 7) // 8 + 1) + (side * 8 if interlaced else 0)
    data = zeros(rows)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + extra + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def tiff(path: Path, **tags: int) -> None:
    """One deflated strip or tile, whose directory is then made to promise more."""
    entries = {256: 16, 257: 16, 258: 8, 259: 8, 262: 1, 277: 1, 278: 16, 273: 8, 279: 0}
    names = {
        "width": 256,
        "height": 257,
        "bits": 258,
        "compression": 259,
        "rows": 278,
        "tile_width": 322,
        "tile_height": 323,
    }
    size = tags.pop("bytes")
    data = zeros(size) if tags.get("compression", 8) == 8 else bytes([129, 0]) * (size // 128)
    for name, value in tags.items():
        entries[names[name]] = value
    if 322 in entries:
        for tag in (273, 278, 279):
            entries.pop(tag)
        entries[324], entries[325] = 8, len(data)
    else:
        entries[279] = len(data)
    at = 8 + len(data)
    directory = struct.pack("<H", len(entries)) + b"".join(
        struct.pack("<HHII", tag, 4, 1, value) for tag, value in sorted(entries.items())
    )
    path.write_bytes(b"II*\0" + struct.pack("<I", at) + data + directory + bytes(4))


def many_pages(path: Path) -> None:
    """As many directories as fit, all of them with the same strip."""
    tags = {256: 16, 257: 16, 258: 8, 259: 1, 262: 1, 273: 8, 277: 1, 278: 16, 279: 256}
    out = bytearray(b"II*\0" + struct.pack("<I", 264) + bytes(256))
    while len(out) < 1_000_000:
        out += struct.pack("<H", len(tags))
        for tag, value in tags.items():
            out += struct.pack("<HHII", tag, 4, 1, value)
        out += struct.pack("<I", len(out) + 4)
    out[-4:] = bytes(4)
    path.write_bytes(bytes(out))


def jpeg(path: Path, side: int, mode: str, progressive: bool) -> None:
    Image.new(mode, (side, side)).save(path, "JPEG", progressive=progressive, quality=50)


def jpeg_scans(path: Path) -> None:
    """A progressive file with its last scan again and again."""
    stream = io.BytesIO()
    Image.new("L", (4096, 4096)).save(stream, "JPEG", progressive=True)
    data = stream.getvalue()
    last = data.rindex(b"\xff\xda")
    path.write_bytes(data[:last] + data[last:-2] * ((900_000 - last) // (len(data) - 2 - last)) + data[-2:])


def tga(path: Path, side: int) -> None:
    header = struct.pack("<BBBHHBHHHHBB", 0, 0, 11, 0, 0, 0, 0, 0, side, side, 8, 0x20)
    path.write_bytes(header + bytes([255, 7]) * min(side * side // 128, 500_000))


def hdr(path: Path, side: int) -> None:
    """Old runs: a pixel, then counts for the rest of the row."""
    row = bytes([128, 128, 128, 128, 1, 1, 1, (side - 1) & 255, 1, 1, 1, (side - 1) >> 8])
    path.write_bytes(images.hdr_header(side, side) + row * side)


def exr(path: Path, side: int) -> None:
    images.exr(path, {"Y": np.zeros((side, side), np.float16)})


def exr_channels(path: Path, count: int, tail: str) -> None:
    """Layers of one channel each, without a pixel that counts."""

    def attribute(name: bytes, kind: bytes, data: bytes) -> bytes:
        return name + b"\0" + kind + b"\0" + struct.pack("<i", len(data)) + data

    names = sorted(f"l{i}.{tail}" for i in range(count))
    channels = b"".join(name.encode() + b"\0" + struct.pack("<iIii", 1, 0, 1, 1) for name in names) + b"\0"
    header = (
        b"v/1\x01\x02\0\0\0"
        + attribute(b"channels", b"chlist", channels)
        + attribute(b"compression", b"compression", b"\0")
        + attribute(b"dataWindow", b"box2i", bytes(16))
        + attribute(b"displayWindow", b"box2i", bytes(16))
        + attribute(b"lineOrder", b"lineOrder", b"\0")
        + attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1))
        + attribute(b"screenWindowCenter", b"v2f", bytes(8))
        + attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1))
        + b"\0"
    )
    row = struct.pack("<ii", 0, 2 * count) + bytes(2 * count)
    path.write_bytes(header + struct.pack("<Q", len(header) + 8) + row)


def long_attribute() -> bytes:
    """A header whose text claims two gigabytes."""
    return b"v/1\x01\x02\0\0\0" + b"type\0string\0" + struct.pack("<i", 2_000_000_000) + bytes(1000)


def npy(path: Path, array: np.ndarray, promised: tuple[int, ...] | None = None) -> None:
    with path.open("wb") as stream:
        header = {"descr": array.dtype.str, "fortran_order": array.flags.fnc, "shape": promised or array.shape}
        np.lib.format.write_array_header_1_0(stream, header)
        stream.write(array.tobytes("A"))


def bmp(width: int, height: int, bits: int, colors: int, data: bytes) -> bytes:
    offset = 54 + 4 * colors
    palette = b"".join(bytes([i, i, i, 0]) for i in range(colors))
    info = struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, 0, 0, 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", offset + len(data), 0, 0, offset) + info + palette + data


def packed(path: Path, side: int, compression: int) -> None:
    """One bit for each pixel, deflated."""
    tiff(path, bytes=side * side // 8, width=side, height=side, rows=side, bits=1, compression=compression)


def table_profile() -> bytes:
    """A tone curve of as many entries as an ICC profile takes."""
    curve = b"curv\0\0\0\0" + struct.pack(">I", 450_000) + bytes(900_000)
    data = bytes(128) + struct.pack(">I4sII", 1, b"kTRC", 144, len(curve)) + curve
    return png(8, extra=chunk(b"iCCP", b"a\0\0" + zlib.compress(data)))


BOMBS: dict[str, tuple[Callable[[Path], object], int]] = {
    "largest_one_bit.png": (lambda p: p.write_bytes(png(SIDE, 1)), SIDE * SIDE),
    "largest.png": (lambda p: p.write_bytes(png(SIDE)), SIDE * SIDE),
    "large.png": (lambda p: p.write_bytes(png(8192)), 8192 * 8192),
    "interlaced.png": (lambda p: p.write_bytes(png(8192, interlaced=1)), 8192 * 8192),
    "rgb16.png": (lambda p: p.write_bytes(png(4700, 16, 2, channels=3)), 3 * 4700 * 4700),
    "larger_rgb16.png": (lambda p: p.write_bytes(png(8000, 16, 2, channels=3)), 3 * 8000 * 8000),
    "text.png": (lambda p: p.write_bytes(png(8, extra=chunk(b"zTXt", b"a\0\0" + zeros(300 << 20)))), 64),
    "profile.png": (lambda p: p.write_bytes(png(8, extra=chunk(b"iCCP", b"a\0\0" + zeros(300 << 20)))), 64),
    "large_strip.tiff": (lambda p: tiff(p, bytes=SIDE * SIDE, width=SIDE, height=SIDE, rows=SIDE), SIDE * SIDE),
    "large_tile.tiff": (lambda p: tiff(p, bytes=300 << 20, tile_width=32768, tile_height=32768), 256),
    "long_strip.tiff": (lambda p: tiff(p, bytes=300 << 20, width=64, height=64, rows=64), 4096),
    "runs.tiff": (
        lambda p: tiff(p, bytes=60 << 20, width=8192, height=7680, rows=7680, compression=32773),
        8192 * 7680,
    ),
    "pages.tiff": (many_pages, 256),
    "largest.jpg": (lambda p: jpeg(p, 9000, "L", False), 9000 * 9000),
    "gray.jpg": (lambda p: jpeg(p, 7000, "L", False), 7000 * 7000),
    "color.jpg": (lambda p: jpeg(p, 4000, "RGB", False), 3 * 4000 * 4000),
    "progressive.jpg": (lambda p: jpeg(p, 4000, "RGB", True), 3 * 4000 * 4000),
    "scans.jpg": (jpeg_scans, 4096 * 4096),
    "runs.tga": (lambda p: tga(p, SIDE), SIDE * SIDE),
    "fewer_runs.tga": (lambda p: tga(p, 7680), 7680 * 7680),
    "runs.hdr": (lambda p: hdr(p, SIDE), 3 * SIDE * SIDE),
    "fewer_runs.hdr": (lambda p: hdr(p, 4096), 3 * 4096 * 4096),
    "largest.exr": (lambda p: exr(p, SIDE), SIDE * SIDE),
    "large.exr": (lambda p: exr(p, 8192), 8192 * 8192),
    "channels.exr": (lambda p: exr_channels(p, 30_000, "R"), 1),
    "fewer_channels.exr": (lambda p: exr_channels(p, 1024, "X"), 1),
    "attribute.exr": (lambda p: p.write_bytes(long_attribute()), 1),
    "digits.pgm": (lambda p: p.write_bytes(b"P2 700 700 255\n" + b"0 " * 490_000), 490_000),
    "tiny_images.pgm": (lambda p: p.write_bytes(b"P5 1 1 255\n\0" * 80_000), 1),
    "tiny_frames.npy": (lambda p: npy(p, np.zeros((999_000, 1, 1), np.uint8)), 1),
    "fortran.npy": (lambda p: npy(p, np.zeros((999_000, 1, 1), np.uint8, "F")), 1),
    "promise.npy": (lambda p: npy(p, np.zeros(1000, np.uint8), (1_000_000, 16384, 16384)), 1),
    "pixels.bmp": (lambda p: p.write_bytes(bmp(2048, 3900, 1, 2, bytes(256 * 3900))), 2048 * 3900),
    "promise.bmp": (lambda p: p.write_bytes(bmp(SIDE, SIDE, 24, 0, bytes(1000))), 1),
    "palette.bmp": (lambda p: p.write_bytes(bmp(990, 1000, 8, 256, bytes(992 * 1000))), 990 * 1000),
    "packed.tiff": (lambda p: packed(p, 8192, 8), 8192 * 8192),
    "table.png": (lambda p: p.write_bytes(table_profile()), 64),
    "comment.pgm": (lambda p: p.write_bytes(b"P5\n" + b"#" * 900_000 + b"\n1 1 255\n\0"), 1),
}


@pytest.mark.parametrize("name", sorted(BOMBS))
def test_a_small_file_takes_little(tmp_path: Path, name: str) -> None:
    write, pixels = BOMBS[name]
    write(tmp_path / name)
    read(tmp_path / name, pixels)


@pytest.mark.nightly
@pytest.mark.parametrize("name", sorted(BOMBS))
def test_a_small_file_takes_no_second(tmp_path: Path, name: str) -> None:
    write, pixels = BOMBS[name]
    write(tmp_path / name)
    read(tmp_path / name, pixels, seconds=MOST_SECONDS)


def test_every_format_is_tried() -> None:
    """But raw frames, which have a test of their own."""
    assert {*make_seeds.FORMATS.values()} == {make_seeds.FORMATS[Path(name).suffix] for name in BOMBS}


def test_a_large_image_in_a_small_file_says_how_it_can_be_read(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(SIDE))
    said = read(tmp_path / "a.png", 0)
    assert "16384 x 16384" in said and "NPY" in said


@pytest.mark.parametrize("layout", ["1x1,8", "8x8,8", "2x1,12,genicam", "990x1,8", "16384x16384,8"])
def test_a_small_raw_file_takes_little(tmp_path: Path, layout: str) -> None:
    (tmp_path / "a.raw").write_bytes(bytes(990_000))
    read(tmp_path / "a.raw", 990 * 1000, layout)
