"""Variants of every format that other programs write: the values of an independent reader, or a refusal with words.

The program of dump_image.cpp lies beside the command line program."""

from __future__ import annotations

import io
import os
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
DUMP = Path(os.environ.get("CLSPECKLE_BIN", ROOT / "build" / "bin")) / "clspeckle-image-dump"
SIZES = [(1, 1), (7, 5), (40, 28), (129, 3)]
Array = np.ndarray


class Dump:
    """What the readers see of a file."""

    def __init__(self, path: Path, raw: str = "") -> None:
        out = path.with_name(path.name + ".values")
        done = subprocess.run(
            [DUMP, path, out, *([raw] if raw else [])], capture_output=True, check=False, text=True, timeout=60
        )
        assert done.returncode in (0, 1), f"exit code {done.returncode}: {done.stderr}"
        self.error = done.stderr if done.returncode else ""
        if self.error:
            return
        first, *self.warnings = done.stdout.splitlines()
        self.width, self.height, self.channels, self.alpha, self.frames = map(int, first.split()[:5])
        self.full_scale = float(first.split()[5])
        self.transfer = first.split(maxsplit=6)[6]
        values = np.fromfile(out, np.float32).reshape(self.frames, self.height, self.width, self.channels)
        self.values = values[..., 0] if self.channels == 1 else values

    def check(self, expected: Array, full_scale: float) -> None:
        assert not self.error
        assert self.full_scale == full_scale
        colors = self.values[..., :-1] if self.alpha else self.values
        np.testing.assert_array_equal(np.squeeze(colors), np.squeeze(expected).astype(np.float32))


def noise(size: tuple[int, int], channels: int = 1, top: int = 255) -> Array:
    shape = (size[1], size[0]) if channels == 1 else (size[1], size[0], channels)
    return np.random.default_rng(channels).integers(0, top + 1, shape, dtype=np.uint16 if top > 255 else np.uint8)


def blocks(size: tuple[int, int], channels: int = 1) -> Array:
    """Runs of equal pixels, for run-length encoding."""
    image = noise(size, channels)
    image[:, : size[0] // 2] = image[:, :1]
    image[::3] = 200
    return image


# --- PNM ---


def pnm(kind: int, values: Array, maximum: int, header: str = "P{kind}\n{w} {h}\n{max}\n") -> bytes:
    head = header.format(kind=kind, w=values.shape[1], h=values.shape[0], max=maximum).encode()
    if kind < 4:
        return head + b"\n".join(b" ".join(str(v).encode() for v in row.ravel().tolist()) for row in values) + b"\n"
    return head + values.astype(">u2" if maximum > 255 else "u1").tobytes()


PNM_HEADERS = {
    "lines": "P{kind}\n{w} {h}\n{max}\n",
    "blanks": "P{kind} {w} {h} {max} ",
    "comments": "P{kind}\n# by v4l2\n{w} {h}\n# exposure 5 ms\n{max}\n",
    "comment_between": "P{kind} {w}# width\n{h} {max}\n",
    "tabs": "P{kind}\t{w}\t\t{h}\n\n{max}\t",
    "crlf": "P{kind}\r\n{w} {h}\r\n{max}\r\n",
    "comment_behind": "P{kind} {w} {h} {max} # max\n",
}


@pytest.mark.parametrize("maximum", [1, 63, 255, 256, 1000, 1023, 4095, 65535])
@pytest.mark.parametrize("kind", [2, 3, 5, 6])
def test_pnm_keeps_codes_and_maximum(tmp_path: Path, kind: int, maximum: int) -> None:
    for index, size in enumerate(SIZES):
        values = noise(size, 3 if kind in (3, 6) else 1, maximum)
        (tmp_path / f"{index}.pnm").write_bytes(pnm(kind, values, maximum))
        Dump(tmp_path / f"{index}.pnm").check(values, maximum)
    if maximum in (255, 65535):
        # Pillow rescales other maxima, and reads no words of three channels.
        with Image.open(tmp_path / "2.pnm") as image:
            if image.mode in ("L", "I", "I;16", "RGB") and not (kind in (3, 6) and maximum > 255):
                np.testing.assert_array_equal(np.asarray(image), noise(SIZES[2], 3 if kind in (3, 6) else 1, maximum))


@pytest.mark.parametrize("header", sorted(PNM_HEADERS))
@pytest.mark.parametrize("kind", [2, 5, 6])
def test_pnm_headers(tmp_path: Path, kind: int, header: str) -> None:
    values = noise((40, 28), 3 if kind == 6 else 1, 1023)
    # A first byte that looks like the header's own white space.
    values.flat[0] = 0x0A
    (tmp_path / "a.pgm").write_bytes(pnm(kind, values, 1023, PNM_HEADERS[header]))
    given = Dump(tmp_path / "a.pgm")
    given.check(values, 1023)
    assert given.warnings == []


@pytest.mark.parametrize("behind", [b" # the last row", b"\n# one\n# two\n", b"\n#"])
def test_a_comment_behind_the_numbers_of_a_text_is_none(tmp_path: Path, behind: bytes) -> None:
    values = noise((40, 28), 1, 1023)
    (tmp_path / "a.pgm").write_bytes(pnm(2, values, 1023) + behind)
    given = Dump(tmp_path / "a.pgm")
    given.check(values, 1023)
    assert given.warnings == []
    (tmp_path / "a.pgm").write_bytes(pnm(2, values, 1023) + behind + b"\n" + pnm(2, values, 1023))
    assert Dump(tmp_path / "a.pgm").frames == 2
    (tmp_path / "a.pgm").write_bytes(pnm(2, values, 1023) + behind + b"\n17")
    assert "follow the last image" in Dump(tmp_path / "a.pgm").warnings[0]


@pytest.mark.parametrize("kind", [2, 5, 6])
@pytest.mark.parametrize("between", [b"", b"\n"])
def test_pnm_streams_are_frames(tmp_path: Path, kind: int, between: bytes) -> None:
    frames = [np.roll(noise((40, 28), 3 if kind == 6 else 1, 1023), i) for i in range(3)]
    (tmp_path / "a.pnm").write_bytes(between.join(pnm(kind, frame, 1023) for frame in frames))
    given = Dump(tmp_path / "a.pnm")
    given.check(np.stack(frames), 1023)
    assert given.frames == 3 and given.warnings == []


def test_pnm_streams_of_several_sizes_are_refused_with_both(tmp_path: Path) -> None:
    (tmp_path / "a.pgm").write_bytes(pnm(5, noise((40, 28)), 255) + pnm(5, noise((20, 14)), 255))
    error = Dump(tmp_path / "a.pgm").error
    assert "image 1 is P5, 40 x 28 pixels" in error and "image 2 is P5, 20 x 14 pixels" in error
    assert "pamsplit" in error


def test_pnm_surplus_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.pgm").write_bytes(pnm(5, noise((40, 28)), 255) + bytes(100))
    given = Dump(tmp_path / "a.pgm")
    given.check(noise((40, 28)), 255)
    assert "100 bytes follow the last image and are not read" in given.warnings[0]


@pytest.mark.parametrize(("kind", "data"), [(1, b"1 0\n0 1\n"), (4, b"\x80\x40")])
def test_pnm_bitmaps_are_refused_with_a_way_out(tmp_path: Path, kind: int, data: bytes) -> None:
    (tmp_path / "a.pbm").write_bytes(b"P%d\n2 2\n" % kind + data)
    error = Dump(tmp_path / "a.pbm").error
    assert f"the kind P{kind}; P2, P3, P5 and P6 are read" in error and "pbmtopgm" in error


@pytest.mark.parametrize("maximum", [1023, 65535])
def test_little_endian_words_are_told_and_the_advice_reads_them(tmp_path: Path, maximum: int) -> None:
    codes = noise((40, 28), 1, 1023)
    head = f"P5\n40 28\n{maximum}\n".encode()
    (tmp_path / "a.pgm").write_bytes(head + codes.astype("<u2").tobytes())
    given = Dump(tmp_path / "a.pgm")
    told = given.error if maximum == 1023 else given.warnings[0]
    assert "little-endian" in told
    raw = told.split("--raw ")[1].split()[0]
    Dump(tmp_path / "a.pgm", raw).check(codes, 1023)
    # Words as the format wants them raise no such doubt, whatever their low bytes are.
    (tmp_path / "b.pgm").write_bytes(b"P5\n40 28\n65535\n" + (codes.astype(np.uint16) << 6).astype(">u2").tobytes())
    assert Dump(tmp_path / "b.pgm").warnings == []


# --- JPEG ---


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("mode", ["L", "RGB"])
@pytest.mark.parametrize(
    "options", [{}, {"progressive": True}, {"quality": 100}, {"subsampling": 0}, {"optimize": True}]
)
def test_jpeg(tmp_path: Path, size: tuple[int, int], mode: str, options: dict) -> None:
    if mode == "L" and "subsampling" in options:
        options = {"restart_marker_blocks": 1}
    Image.fromarray(noise(size, 1 if mode == "L" else 3)).save(tmp_path / "a.jpg", **options)
    given = Dump(tmp_path / "a.jpg")
    with Image.open(tmp_path / "a.jpg") as image:
        given.check(np.asarray(image), 255)
    assert given.channels == (1 if mode == "L" else 3)
    assert given.transfer == "sRGB" and len(given.warnings) == 1 and "lossy" in given.warnings[0]


@pytest.mark.parametrize("orientation", [1, 3, 6])
def test_jpeg_orientation_is_told(tmp_path: Path, orientation: int) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(noise((40, 28))).save(tmp_path / "a.jpg", exif=exif)
    given = Dump(tmp_path / "a.jpg")
    assert (given.width, given.height) == (40, 28)
    told = [warning for warning in given.warnings if f"(orientation {orientation})" in warning]
    assert len(told) == (0 if orientation == 1 else 1)


def test_jpeg_for_print_is_refused(tmp_path: Path) -> None:
    Image.fromarray(noise((40, 28), 4), "CMYK").save(tmp_path / "a.jpg")
    assert "4 components" in Dump(tmp_path / "a.jpg").error


@pytest.mark.parametrize("keep", [0.3, 0.9, -1])
def test_jpeg_cut_short_is_refused(tmp_path: Path, keep: float) -> None:
    Image.fromarray(noise((40, 28))).save(tmp_path / "a.jpg")
    data = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "a.jpg").write_bytes(data[: int(keep * len(data)) if keep > 0 else -2])
    assert "is truncated" in Dump(tmp_path / "a.jpg").error


# --- BMP ---


def bmp_from_pillow(image: Image.Image) -> bytes:
    stream = io.BytesIO()
    image.save(stream, "BMP")
    return stream.getvalue()


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("mode", ["1", "L", "RGB", "RGBA"])
def test_bmp(tmp_path: Path, size: tuple[int, int], mode: str) -> None:
    values = noise(size, {"1": 1, "L": 1, "RGB": 3, "RGBA": 4}[mode])
    image = Image.fromarray((values > 127)) if mode == "1" else Image.fromarray(values)
    (tmp_path / "a.bmp").write_bytes(bmp_from_pillow(image))
    given = Dump(tmp_path / "a.bmp")
    expected = (values > 127) * 255 if mode == "1" else values[..., :3] if mode == "RGBA" else values
    given.check(expected, 255)
    assert given.channels == (1 if mode in "1L" else 3 + given.alpha)
    with Image.open(tmp_path / "a.bmp") as read:
        np.testing.assert_array_equal(
            np.asarray(read.convert("RGB") if mode == "RGBA" else read).astype(int).squeeze()
            * (255 if mode == "1" else 1),
            np.squeeze(expected),
        )


def bmp(
    rows: bytes,
    size: tuple[int, int],
    bits: int,
    palette: bytes = b"",
    header: int = 40,
    compression: int = 0,
    masks: tuple[int, ...] = (),
    space: int = 0,
) -> bytes:
    """By hand: headers that Pillow does not write. rows from the bottom, each padded to 4 bytes."""
    info = struct.pack("<IiiHHIIiiII", header, *size, 1, bits, compression, len(rows), 2835, 2835, 0, 0)
    if header > 40:
        info += struct.pack("<4I", *(masks or (0xFF0000, 0xFF00, 0xFF, 0xFF000000))) + struct.pack("<I", space)
        info += bytes(header - len(info))
    else:
        info += struct.pack(f"<{len(masks)}I", *masks)
    offset = 14 + len(info) + len(palette)
    return b"BM" + struct.pack("<IHHI", offset + len(rows), 0, 0, offset) + info + palette + rows


def bmp_rows(values: Array) -> bytes:
    rows = values[::-1, :, ::-1] if values.ndim == 3 and values.shape[2] == 3 else values[::-1]
    if values.ndim == 3 and values.shape[2] == 4:
        rows = rows[..., [2, 1, 0, 3]]
    return b"".join(row.tobytes() + bytes(-row.nbytes % 4) for row in np.ascontiguousarray(rows))


GRAY = b"".join(bytes([i, i, i, 0]) for i in range(256))


def bmp_case(name: str) -> tuple[bytes, Array | None]:
    """A file, and the colors that must be read; none where it must be refused."""
    size = (13, 6)
    gray, color, four = noise(size), noise(size, 3), noise(size, 4)
    if name == "top_down":
        return bmp(bmp_rows(gray[::-1]), (13, -6), 8, GRAY), gray
    if name == "v4":
        return bmp(bmp_rows(color), size, 24, header=108), color
    if name == "v5":
        return bmp(bmp_rows(gray), size, 8, GRAY, header=124), gray
    if name == "color_palette":
        palette = np.random.default_rng(3).integers(0, 256, (256, 4), dtype=np.uint8)
        palette[:, 3] = 0
        return bmp(bmp_rows(gray), size, 8, palette.tobytes()), palette[gray][..., 2::-1]
    if name == "four_bits":
        nibbles = gray >> 4
        padded = np.pad(nibbles, ((0, 0), (0, 1)))
        packed = padded[:, ::2] << 4 | padded[:, 1::2]
        palette = b"".join(bytes([i, i, i, 0]) for i in range(0, 256, 17))
        return bmp(bmp_rows(packed), size, 4, palette), nibbles * 17
    if name == "masks":
        return bmp(bmp_rows(four), size, 32, compression=3, masks=(0xFF0000, 0xFF00, 0xFF)), four[..., :3]
    if name == "v4_masks":
        return bmp(bmp_rows(four), size, 32, header=108, compression=3), four[..., :3]
    if name == "other_masks":
        return bmp(bmp_rows(four), size, 32, compression=3, masks=(0xFF, 0xFF00, 0xFF0000)), None
    if name == "sixteen_bits":
        return bmp(bmp_rows(noise(size, 1, 65535)), size, 16), None
    if name == "short_palette":
        return bmp(bmp_rows(gray), size, 8, GRAY[:400]), None
    if name == "runs":
        return bmp(bytes([13, 7, 0, 0] * 6 + [0, 1]), size, 8, GRAY, compression=1), None
    if name == "os2":
        return b"BM" + struct.pack("<IHHIIHHHH", 26 + 240, 0, 0, 26, 12, *size, 1, 24) + bmp_rows(color), None
    if name == "cut_short":
        return bmp(bmp_rows(color), size, 24)[:-1], None
    raise AssertionError(name)


@pytest.mark.parametrize(
    "name",
    [
        "top_down",
        "v4",
        "v5",
        "color_palette",
        "four_bits",
        "masks",
        "v4_masks",
        "other_masks",
        "sixteen_bits",
        "short_palette",
        "runs",
        "os2",
        "cut_short",
    ],
)
def test_bmp_by_hand(tmp_path: Path, name: str) -> None:
    data, expected = bmp_case(name)
    (tmp_path / "a.bmp").write_bytes(data)
    given = Dump(tmp_path / "a.bmp")
    if expected is None:
        assert "Convert it to PNG" in given.error or "is truncated" in given.error
        return
    given.check(expected, 255)
    with Image.open(tmp_path / "a.bmp") as image:
        other = np.asarray(image.convert("RGB"))
    np.testing.assert_array_equal(other, expected if expected.ndim == 3 else np.repeat(expected[..., None], 3, axis=2))


def test_bmp_that_says_srgb(tmp_path: Path) -> None:
    (tmp_path / "a.bmp").write_bytes(bmp(bmp_rows(noise((8, 4), 3)), (8, 4), 24, header=108, space=0x73524742))
    assert Dump(tmp_path / "a.bmp").transfer == "sRGB"


# --- TGA ---


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA"])
@pytest.mark.parametrize("compression", [None, "tga_rle"])
@pytest.mark.parametrize("orientation", [1, -1])
def test_tga(tmp_path: Path, size: tuple[int, int], mode: str, compression: str | None, orientation: int) -> None:
    channels = {"L": 1, "LA": 2, "RGB": 3, "RGBA": 4}[mode]
    image = Image.fromarray(blocks(size, channels), mode)
    image.save(tmp_path / "a.tga", compression=compression, orientation=orientation)
    given = Dump(tmp_path / "a.tga")
    with Image.open(tmp_path / "a.tga") as read:
        expected = np.asarray(read)
    given.check(expected[..., :-1] if mode in ("LA", "RGBA") else expected, 255)
    assert given.alpha == (mode in ("LA", "RGBA"))


def tga(
    pixels: bytes,
    size: tuple[int, int],
    kind: int,
    bits: int,
    flags: int = 0x20,
    palette: bytes = b"",
    colors: int = 0,
    first: int = 0,
    name: bytes = b"",
) -> bytes:
    header = struct.pack(
        "<BBBHHBHHHHBB",
        len(name),
        1 if palette else 0,
        kind,
        first,
        colors,
        24 if palette else 0,
        0,
        0,
        *size,
        bits,
        flags,
    )
    return header + name + palette + pixels


def test_tga_by_hand(tmp_path: Path) -> None:
    values = noise((13, 6))
    path = tmp_path / "a.tga"

    def read(data: bytes) -> Dump:
        path.write_bytes(data)
        return Dump(path)

    read(tga(values.tobytes(), (13, 6), 3, 8)).check(values, 255)
    read(tga(values.tobytes(), (13, 6), 3, 8, name=b"frame 7")).check(values, 255)
    # From right to left, and from the bottom.
    read(tga(values.tobytes(), (13, 6), 3, 8, flags=0x30)).check(values[:, ::-1], 255)
    read(tga(values.tobytes(), (13, 6), 3, 8, flags=0x00)).check(values[::-1], 255)
    palette = np.random.default_rng(3).integers(0, 256, (256, 3), dtype=np.uint8)
    read(tga(values.tobytes(), (13, 6), 1, 8, palette=palette.tobytes(), colors=256)).check(
        palette[values][..., ::-1], 255
    )
    for refused in (
        tga(values.tobytes(), (13, 6), 1, 8, palette=palette[:100].tobytes(), colors=100),
        tga(values.tobytes(), (13, 6), 1, 8, palette=palette.tobytes(), colors=256, first=4),
        tga(bytes(2 * 78), (13, 6), 2, 16),
        tga(values.tobytes(), (13, 6), 3, 8, flags=0xE0),
    ):
        error = read(refused).error
        assert "Convert it to PNG" in error or "is not a" in error
    assert "is truncated" in read(tga(values.tobytes()[:-1], (13, 6), 3, 8)).error
    assert "is truncated" in read(tga(bytes([0x8C, 7] * 5), (13, 6), 11, 8)).error


def test_tga_is_known_by_its_footer_or_by_its_name(tmp_path: Path) -> None:
    data = tga(noise((13, 6)).tobytes(), (13, 6), 3, 8)
    (tmp_path / "a.dat").write_bytes(data)
    assert "is not a" in Dump(tmp_path / "a.dat").error
    (tmp_path / "b.dat").write_bytes(data + bytes(8) + b"TRUEVISION-XFILE.\0")
    Dump(tmp_path / "b.dat").check(noise((13, 6)), 255)
    (tmp_path / "c.tga").write_bytes(b"no image at all, but a text of more than 18 bytes")
    assert "is not a" in Dump(tmp_path / "c.tga").error


# --- Raw frames ---


def lowest_first(codes: Array, bits: int) -> bytes:
    """Bit by bit, the lowest first."""
    planes = codes.ravel()[:, None] >> np.arange(bits) & 1
    return np.packbits(planes.ravel().astype(np.uint8), bitorder="little").tobytes()


def mipi(codes: Array, bits: int) -> bytes:
    group = {10: 4, 12: 2, 14: 4}[bits]
    groups = codes.reshape(-1, group)
    low = np.frombuffer(lowest_first(groups & (2 ** (bits - 8) - 1), bits - 8), np.uint8).reshape(len(groups), -1)
    return np.hstack([(groups >> (bits - 8)).astype(np.uint8), low]).tobytes()


def gige(codes: Array, bits: int) -> bytes:
    a, b = codes.reshape(-1, 2).T
    mask = 2 ** (bits - 8) - 1
    return np.stack([a >> (bits - 8), (a & mask) | (b & mask) << 4, b >> (bits - 8)], axis=1).astype(np.uint8).tobytes()


RAW: dict[str, Callable[[Array], bytes]] = {
    "8": lambda c: c.astype("u1").tobytes(),
    **{f"{bits}": lambda c: c.astype("<u2").tobytes() for bits in (10, 12, 14, 16)},
    **{f"{bits},unpacked,big": lambda c: c.astype(">u2").tobytes() for bits in (10, 16)},
    **{f"{bits},msb": lambda c, s=16 - bits: (c << s).astype("<u2").tobytes() for bits in (10, 12, 14)},
    "12,msb,big": lambda c: (c << 4).astype(">u2").tobytes(),
    **{f"{bits},mipi": lambda c, b=bits: mipi(c, b) for bits in (10, 12, 14)},
    **{f"{bits},genicam": lambda c, b=bits: lowest_first(c, b) for bits in (10, 12, 14)},
    **{f"{bits},gige": lambda c, b=bits: gige(c, b) for bits in (10, 12)},
}


@pytest.mark.parametrize("layout", sorted(RAW))
@pytest.mark.parametrize("frames", [1, 3])
@pytest.mark.parametrize("offset", [0, 37])
def test_raw(tmp_path: Path, layout: str, frames: int, offset: int) -> None:
    bits = int(layout.split(",")[0])
    codes = np.random.default_rng(bits).integers(0, 2**bits, (frames, 28, 40), dtype=np.uint16)
    (tmp_path / "a.raw").write_bytes(b"\xff" * offset + RAW[layout](codes))
    given = Dump(tmp_path / "a.raw", f"40x28,{layout}" + (f",{offset}" if offset else ""))
    given.check(codes, 2**bits - 1)
    assert given.frames == frames


def test_packers_have_the_bytes_of_the_standards() -> None:
    """MIPI CSI-2's and V4L2's tables, PFNC's Mono10p and Mono12p, GigE Vision's Mono10Packed and Mono12Packed."""
    codes = np.array([0x3A5, 0x0F1, 0x2C6, 0x19B], np.uint16)
    assert mipi(codes, 10) == bytes([0xE9, 0x3C, 0xB1, 0x66, 0b11_10_01_01])
    assert mipi(np.array([0xABC, 0x123], np.uint16), 12) == bytes([0xAB, 0x12, 0x3C])
    one = np.array([0x3FFF, 0, 0, 0], np.uint16)
    assert mipi(one, 14) == bytes([0xFF, 0, 0, 0, 0x3F, 0, 0])
    assert mipi(one[[1, 0, 2, 3]], 14) == bytes([0, 0xFF, 0, 0, 0xC0, 0x0F, 0])
    assert mipi(one[[1, 2, 3, 0]], 14) == bytes([0, 0, 0, 0xFF, 0, 0, 0xFC])
    assert lowest_first(codes[:2], 10)[:2] == bytes([0xA5, 0xC7])
    assert lowest_first(np.array([0xABC, 0x123], np.uint16), 12) == bytes([0xBC, 0x3A, 0x12])
    assert gige(np.array([0xABC, 0x123], np.uint16), 12) == bytes([0xAB, 0x3C, 0x12])
    assert gige(codes[:2], 10) == bytes([0xE9, 0x11, 0x3C])


def test_raw_rows_with_padding(tmp_path: Path) -> None:
    codes = np.random.default_rng(0).integers(0, 1024, (28, 40), dtype=np.uint16)
    rows = np.frombuffer(mipi(codes, 10), np.uint8).reshape(28, 50)
    (tmp_path / "a.raw").write_bytes(np.pad(rows, ((0, 0), (0, 14)), constant_values=0xEE).tobytes())
    Dump(tmp_path / "a.raw", "40x28,10,mipi,stride=64").check(codes, 1023)


def test_raw_rows_with_padding_are_offered(tmp_path: Path) -> None:
    codes = np.random.default_rng(0).integers(0, 1024, (28, 40), dtype=np.uint16)
    rows = np.frombuffer(mipi(codes, 10), np.uint8).reshape(28, 50)
    (tmp_path / "a.raw").write_bytes(np.pad(rows, ((0, 0), (0, 14)), constant_values=0xEE).tobytes())
    assert "These would fit: stride=64 (1 frame)" in Dump(tmp_path / "a.raw", "40x28,10,mipi").error
    Dump(tmp_path / "a.raw", "40x28,10,mipi,stride=64").check(codes, 1023)


def test_a_raw_file_that_was_cut_has_no_header(tmp_path: Path) -> None:
    codes = np.random.default_rng(0).integers(0, 1024, (3, 28, 40), dtype=np.uint16)
    (tmp_path / "a.raw").write_bytes(mipi(codes, 10)[:-1])
    error = Dump(tmp_path / "a.raw", "40x28,10,mipi").error
    assert "The last frame may be cut: 1 bytes of it are missing" in error and "offset" not in error


def test_a_raw_file_of_another_size_is_refused_with_what_would_fit(tmp_path: Path) -> None:
    codes = np.random.default_rng(0).integers(0, 1024, (3, 28, 40), dtype=np.uint16)
    (tmp_path / "a.raw").write_bytes(bytes(64) + mipi(codes, 10))
    error = Dump(tmp_path / "a.raw", "40x28,10,mipi").error
    assert "has 4264 bytes" in error and "1400 for each frame" in error
    assert "leave 64 bytes behind 3 frames" in error and "an offset of 64 (3 frames)" in error
    Dump(tmp_path / "a.raw", "40x28,10,mipi,64").check(codes, 1023)
    (tmp_path / "b.raw").write_bytes(mipi(codes, 10)[:2800])
    error = Dump(tmp_path / "b.raw", "40x28,10").error
    assert "10,mipi (2 frames)" in error and "12" not in error.split("These would fit")[1]
    Dump(tmp_path / "b.raw", "40x28,10,mipi").check(codes[:2], 1023)
    (tmp_path / "c.raw").write_bytes(bytes(17))
    assert "No other packing of 40 x 28 pixels fits" in Dump(tmp_path / "c.raw", "40x28,10").error


@pytest.mark.parametrize(
    ("written", "given", "right"), [(">u2", "10", "10,big"), ("<u2", "10,big", "10"), ("msb", "10", "10,msb")]
)
def test_words_that_hold_no_codes_are_refused_with_the_cause(
    tmp_path: Path, written: str, given: str, right: str
) -> None:
    codes = np.random.default_rng(0).integers(512, 1024, (28, 40), dtype=np.uint16)
    data = (codes << 6).astype("<u2") if written == "msb" else codes.astype(written)
    (tmp_path / "a.raw").write_bytes(data.tobytes())
    error = Dump(tmp_path / "a.raw", f"40x28,{given}").error
    assert f'("{right.split(",")[-1] if "," in right else "little"}")' in error
    Dump(tmp_path / "a.raw", f"40x28,{right}").check(codes, 1023)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("40x28", "the number of bits is missing"),
        ("40,10", "is no size"),
        ("0x28,8", "is no size"),
        ("40x28,11", '"11" bits are not read'),
        ("40x28,16,mipi", 'no packing "mipi" of 16 bits'),
        ("40x28,14,gige", 'no packing "gige" of 14 bits'),
        ("41x28,10,mipi", "(44)"),
        ("40x28,10,mipi,big", "for words of two bytes"),
        ("40x28,10,nv12", '"nv12" is neither a packing'),
        ("40x28,10,1,2", "one too many"),
        ("40x28,10,stride=79", "a row has 80"),
        ("99999x28,10", "at most 16384"),
    ],
)
def test_descriptions_that_cannot_be(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "a.raw").write_bytes(bytes(2240))
    error = Dump(tmp_path / "a.raw", text).error
    assert says in error and "640x480,10,mipi" in error


def test_a_raw_file_without_a_description_says_how_to_give_one(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(bytes(2240))
    error = Dump(tmp_path / "a.raw").error
    assert "raw frames must be described" in error and "--raw" in error
