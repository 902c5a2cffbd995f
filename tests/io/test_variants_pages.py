"""Several images in one file, and words that change what numbers mean: as an independent reader sees them, or
refused."""

from __future__ import annotations

import struct
import subprocess
import zlib
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms, PngImagePlugin
from test_variants import DUMP, Dump, noise
from test_variants_hdr import images

Array = np.ndarray
SIZE = (40, 28)
STACK = np.stack([np.roll(noise(SIZE, 1, 1023), i, axis=1) for i in range(4)])
REAL = (STACK / 1023).astype(np.float32)


def named(path: Path, name: str) -> Path:
    return path.with_name(f"{path.name}:{name}")


# --- TIFF: stacks ---

TIMES = {"metadata": {"axes": "TYX"}}
STACKS = {
    "pages": (STACK, {"photometric": "minisblack"}),
    "pages_deflate": (STACK, {"photometric": "minisblack", "compression": "zlib"}),
    "pages_tiles": (STACK, {"photometric": "minisblack", "tile": (16, 16)}),
    "pages_big_endian": (STACK, {"photometric": "minisblack", "byteorder": ">"}),
    "pages_bigtiff": (REAL, {"photometric": "minisblack", "bigtiff": True}),
    "pages_strips": (REAL, {"photometric": "minisblack", "rowsperstrip": 5}),
    "pages_bytes": ((STACK >> 2).astype(np.uint8), {"photometric": "minisblack"}),
    "pages_double": (REAL.astype(np.float64), {"photometric": "minisblack"}),
    "pages_half": (REAL.astype(np.float16), {"photometric": "minisblack"}),
    "imagej_pages": (STACK, {"imagej": True, **TIMES}),
    "imagej_one_directory": (STACK, {"imagej": True, "truncate": True, **TIMES}),
    "imagej_one_directory_bytes": ((STACK >> 2).astype(np.uint8), {"imagej": True, "truncate": True, **TIMES}),
    "imagej_one_directory_float": (REAL, {"imagej": True, "truncate": True, **TIMES}),
    "imagej_one_directory_little": (STACK, {"imagej": True, "truncate": True, "byteorder": "<", **TIMES}),
    "tifffile_one_directory": (STACK, {"photometric": "minisblack", "truncate": True}),
    "tifffile_one_directory_big": (STACK, {"photometric": "minisblack", "truncate": True, "byteorder": ">"}),
    "tifffile_one_directory_float": (REAL, {"photometric": "minisblack", "truncate": True}),
    "tifffile_one_directory_strips": (REAL, {"photometric": "minisblack", "truncate": True, "rowsperstrip": 5}),
}


@pytest.mark.parametrize("name", STACKS)
def test_tiff_stacks_are_frames(tmp_path: Path, name: str) -> None:
    stack, options = STACKS[name]
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, stack, **options)
    assert len(tifffile.TiffFile(path).pages) == (1 if "one_directory" in name else len(stack))
    given = Dump(path)
    assert not given.error and given.frames == len(stack) and given.warnings == []
    np.testing.assert_array_equal(given.values, tifffile.imread(path).astype(np.float32))
    np.testing.assert_array_equal(given.values, stack.astype(np.float32))
    third = Dump(named(path, "page=2"))
    assert third.frames == 1
    np.testing.assert_array_equal(third.values[0], stack[2].astype(np.float32))
    assert "has no page 4" in Dump(named(path, "page=4")).error


def test_pillow_pages_are_frames(tmp_path: Path) -> None:
    pages = [Image.fromarray(frame) for frame in STACK]
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif").values, STACK)


def test_colors_in_one_directory(tmp_path: Path) -> None:
    stack = np.stack([np.roll(noise(SIZE, 3), i, axis=1) for i in range(3)])
    tifffile.imwrite(tmp_path / "a.tif", stack, photometric="rgb", truncate=True)
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif").values, stack)
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif:page=1,G").values[0], stack[1, ..., 1])


def test_channels_of_ome_take_turns(tmp_path: Path) -> None:
    height, width = STACK.shape[1:]
    for axes, channels in (("TCYX", 2), ("CZYX", 2), ("TZYX", 1)):
        stack = STACK[:4].reshape(2, 2, height, width)
        tifffile.imwrite(tmp_path / "a.ome.tif", stack, ome=True, photometric="minisblack", metadata={"axes": axes})
        given = Dump(tmp_path / "a.ome.tif")
        if channels > 1:
            assert "its 4 images are those of 2 channels in turn, says OME" in given.error
            np.testing.assert_array_equal(Dump(tmp_path / "a.ome.tif:page=3").values[0], STACK[3])
        else:
            assert given.warnings == []
            np.testing.assert_array_equal(given.values, STACK[:4].astype(np.float32))
    # Colors are samples of one page; a file of a set has fewer pages than the set.
    tifffile.imwrite(tmp_path / "a.ome.tif", noise(SIZE, 3), ome=True, photometric="rgb", metadata={"axes": "YXS"})
    assert Dump(tmp_path / "a.ome.tif").channels == 3
    tifffile.imwrite(tmp_path / "b.ome.tif", STACK[:2], ome=True, photometric="minisblack", metadata={"axes": "TYX"})
    text = tifffile.TiffFile(tmp_path / "b.ome.tif").pages[0].description.replace('SizeC="1"', 'SizeC="3"')
    tifffile.imwrite(tmp_path / "c.tif", STACK[0], description=text, metadata=None)
    assert Dump(tmp_path / "c.tif").frames == 1


def test_a_stack_that_was_cut_says_how_much_is_there(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", STACK, imagej=True, truncate=True, **TIMES)
    data = (tmp_path / "a.tif").read_bytes()
    (tmp_path / "a.tif").write_bytes(data[: len(data) - STACK[0].nbytes])
    error = Dump(tmp_path / "a.tif").error
    assert "holds 4 images says ImageJ, but lists one" in error and f"{3 * STACK[0].nbytes} bytes are there" in error
    assert f"{tmp_path}/a.tif:page=0" in error
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif:page=0").values[0], STACK[0])


def test_more_channels_than_colors_are_frames(tmp_path: Path) -> None:
    """As tifffile writes a stack whose axes nobody named."""
    frames = np.concatenate([STACK, STACK[:2] + 1])
    assert len(frames) > 4
    tifffile.imwrite(tmp_path / "a.tif", frames, imagej=True)
    Dump(tmp_path / "a.tif").check(frames, 65535)


def test_channels_of_imagej_take_turns(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", STACK.reshape(2, 2, *STACK.shape[1:]), imagej=True, metadata={"axes": "TCYX"})
    error = Dump(tmp_path / "a.tif").error
    assert "its 4 images are those of 2 channels in turn, says ImageJ" in error and "a.tif:page=0" in error
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif:page=3").values[0], STACK[3])


def test_channels_of_tifffile_take_turns(tmp_path: Path) -> None:
    stack = STACK.reshape(2, 2, *STACK.shape[1:])
    for axes, channels in (("TCYX", 2), ("TZYX", 1)):
        tifffile.imwrite(tmp_path / "a.tif", stack, photometric="minisblack", metadata={"axes": axes})
        given = Dump(tmp_path / "a.tif")
        if channels > 1:
            assert "its 4 images are those of 2 channels in turn, says tifffile" in given.error
            np.testing.assert_array_equal(Dump(tmp_path / "a.tif:page=3").values[0], STACK[3])
        else:
            np.testing.assert_array_equal(given.values, STACK.astype(np.float32))


@pytest.mark.parametrize(("old", "new"), [(' SizeC="', "\n  SizeC='"), (' SizeC="', '\tSizeC="')])
def test_ome_as_other_writers_lay_it_out(tmp_path: Path, old: str, new: str) -> None:
    stack = STACK[:2].reshape(1, 2, *STACK.shape[1:])
    tifffile.imwrite(tmp_path / "a.tif", stack, ome=True, photometric="minisblack", metadata={"axes": "TCYX"})
    text = tifffile.TiffFile(tmp_path / "a.tif").pages[0].description
    changed = text.replace(old, new)
    if "'" in new:
        changed = changed.replace("SizeC='2\"", "SizeC='2'")
    assert changed != text
    tifffile.imwrite(tmp_path / "b.tif", STACK[:2], photometric="minisblack", description=changed, metadata=None)
    assert "those of 2 channels in turn, says OME" in Dump(tmp_path / "b.tif").error


def test_a_second_picture_of_a_jpeg_file_is_told(tmp_path: Path) -> None:
    pictures = [Image.fromarray(noise(SIZE)) for _ in range(2)]
    pictures[0].save(tmp_path / "a.mpo", save_all=True, append_images=pictures[1:])
    (tmp_path / "a.mpo").rename(tmp_path / "a.jpg")
    assert any("holds several pictures (MPO)" in text for text in Dump(tmp_path / "a.jpg").warnings)
    with Image.open(tmp_path / "a.jpg") as image:
        image.seek(1)
        image.save(tmp_path / "b.jpg")
    assert not any("MPO" in text for text in Dump(tmp_path / "b.jpg").warnings)


# --- TIFF: pages that are no frames ---


def small() -> Array:
    return np.ascontiguousarray(STACK[0][::2, ::2])


@pytest.mark.parametrize("order", ["image first", "preview first"])
def test_previews_are_no_frames(tmp_path: Path, order: str) -> None:
    pages = [(STACK[0], 0), (small(), 1)]
    with tifffile.TiffWriter(tmp_path / "a.tif") as tif:
        for page, kind in pages if order == "image first" else pages[::-1]:
            tif.write(page, subfiletype=kind, photometric="minisblack")
    given = Dump(tmp_path / "a.tif")
    assert given.frames == 1
    np.testing.assert_array_equal(given.values[0], STACK[0])
    preview = Dump(tmp_path / f"a.tif:page={1 if order == 'image first' else 0}")
    np.testing.assert_array_equal(preview.values[0], small())


def test_frames_with_a_preview_each(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as tif:
        for frame in STACK:
            tif.write(frame, photometric="minisblack")
            tif.write(np.ascontiguousarray(frame[::2, ::2]), subfiletype=1, photometric="minisblack")
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif").values, STACK)
    assert "page 1 (reduced) 20 x 14" in Dump(tmp_path / "a.tif:page=99").error


def test_pyramids_below_a_page(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as tif:
        tif.write(STACK[0], subifds=1, photometric="minisblack")
        tif.write(small(), subfiletype=1, photometric="minisblack")
    given = Dump(tmp_path / "a.tif")
    assert given.frames == 1
    np.testing.assert_array_equal(given.values[0], STACK[0])


def test_a_preview_that_lists_its_image(tmp_path: Path) -> None:
    """As raw files of cameras do."""
    with tifffile.TiffWriter(tmp_path / "a.tif") as tif:
        tif.write(small(), subfiletype=1, subifds=1, photometric="minisblack")
        tif.write(STACK[0], photometric="minisblack")
    given = Dump(tmp_path / "a.tif")
    assert given.frames == 1
    np.testing.assert_array_equal(given.values[0], STACK[0])
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif:page=0").values[0], small())


@pytest.mark.parametrize("other", [small(), REAL[0], (STACK[0] >> 2).astype(np.uint8), noise(SIZE, 3)])
def test_pages_that_are_no_series_are_listed(tmp_path: Path, other: Array) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as tif:
        tif.write(STACK[0], photometric="minisblack")
        tif.write(other, photometric="rgb" if other.ndim == 3 else "minisblack")
    error = Dump(tmp_path / "a.tif").error
    assert "no series: page 0 40 x 28, 1 x 16 bits; page 1" in error and "a.tif:page=0" in error
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif:page=0").values[0], STACK[0])
    np.testing.assert_array_equal(Dump(tmp_path / "a.tif:page=1").values[0], other.astype(np.float32))


WORDS: dict[str, tuple[dict, str]] = {
    "white": ({"photometric": "miniswhite"}, "0 is white"),
    "turned": ({"extratags": [(274, 3, 1, 6, True)]}, "orientation 6"),
    "lossy": ({"lossy": True}, "lossy"),
    "profile": (
        {"iccprofile": ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()},
        "an ICC profile of",
    ),
    "table": ({"extratags": [(301, 3, 256, tuple(range(256)), True)]}, "a table of light"),
}


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("name", WORDS)
def test_pages_with_other_words_are_no_series(tmp_path: Path, name: str, first: bool) -> None:
    """What one page says of its numbers holds for no other; where all say it, they are a series."""
    options, word = WORDS[name]
    pages = [{"photometric": "minisblack"}, {"photometric": "minisblack", **options}]
    values = (STACK[0] >> 2).astype(np.uint8)

    def written(kinds: list[dict]) -> Dump:
        if name == "lossy":
            images = [Image.fromarray(values) for _ in kinds]
            for image, kind in zip(images, kinds, strict=True):
                image.encoderinfo = {"compression": "jpeg" if "lossy" in kind else "raw"}
            images[0].save(tmp_path / "a.tif", save_all=True, append_images=images[1:], **images[0].encoderinfo)
            return Dump(tmp_path / "a.tif")
        with tifffile.TiffWriter(tmp_path / "a.tif") as tif:
            for kind in kinds:
                tif.write(values, **kind)
        return Dump(tmp_path / "a.tif")

    error = written(pages[::-1] if first else pages).error
    assert "no series" in error and f"page {0 if first else 1} 40 x 28, 1 x 8 bits, {word}" in error
    assert Dump(tmp_path / f"a.tif:page={0 if first else 1}").frames == 1
    assert written([pages[1]] * 2).frames == 2


# --- TIFF: words that change numbers ---


@pytest.mark.parametrize("values", [STACK[0], (STACK[0] >> 2).astype(np.uint8), STACK])
def test_white_is_zero(tmp_path: Path, values: Array) -> None:
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="miniswhite")
    top = np.iinfo(values.dtype).max
    Dump(tmp_path / "a.tif").check(top - values, top)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_told(tmp_path: Path, orientation: int) -> None:
    tifffile.imwrite(tmp_path / "a.tif", STACK[0], extratags=[(274, 3, 1, orientation, True)])
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(STACK[0]).save(tmp_path / "a.png", exif=exif)
    for name in ("a.tif", "a.png"):
        given = Dump(tmp_path / name)
        np.testing.assert_array_equal(given.values[0], STACK[0])
        told = [warning for warning in given.warnings if f"(orientation {orientation})" in warning]
        assert len(told) == (0 if orientation == 1 else 1)


@pytest.mark.parametrize("orientation", [1, 6])
def test_orientation_that_an_exr_file_keeps_is_told(tmp_path: Path, orientation: int) -> None:
    """OpenImageIO writes it so when it converts a photograph."""
    images.exr(tmp_path / "a.exr", {"Y": STACK[0].astype(np.float32)}, Orientation=orientation)
    given = Dump(tmp_path / "a.exr")
    np.testing.assert_array_equal(given.values[0], STACK[0])
    assert [w for w in given.warnings if "(orientation 6)" in w] == given.warnings
    assert len(given.warnings) == (orientation == 6)


@pytest.mark.parametrize(
    "form", [' tiff:Orientation="{}"/>', "><tiff:Orientation>{}</tiff:Orientation></rdf:Description>"]
)
def test_orientation_in_xmp_is_told(tmp_path: Path, form: str) -> None:
    """As photo editors write it, alone or beside EXIF data that say the same."""
    for orientation, exif_too in ((1, False), (6, False), (8, True)):
        exif = Image.Exif()
        if exif_too:
            exif[0x0112] = orientation
        packet = (
            '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description xmlns:tiff="http://ns.adobe.com/tiff/1.0/"'
            + form.format(orientation)
            + "</x:xmpmeta>"
        )
        text = PngImagePlugin.PngInfo()
        text.add_itxt("XML:com.adobe.xmp", packet)
        Image.fromarray(STACK[0]).save(tmp_path / "a.png", pnginfo=text, exif=exif)
        Image.fromarray(noise((40, 28))).save(tmp_path / "a.jpg", xmp=packet.encode(), exif=exif)
        for name in ("a.png", "a.jpg"):
            told = [warning for warning in Dump(tmp_path / name).warnings if f"(orientation {orientation})" in warning]
            assert len(told) == (0 if orientation == 1 else 1), name


# --- PNG ---


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(values: Array, *chunks: bytes) -> bytes:
    bits = 8 * values.itemsize
    rows = values.astype(">u2" if bits == 16 else "u1")
    data = b"".join(b"\0" + row.tobytes() for row in rows)
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", values.shape[1], values.shape[0], bits, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + b"".join(chunks) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")


def gamma(value: float) -> bytes:
    return chunk(b"gAMA", struct.pack(">I", round(value * 100000)))


def icc(name: str) -> bytes:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile(name)).tobytes()
    return chunk(b"iCCP", b"a profile\0\0" + zlib.compress(profile))


def gray_profile(curve: bytes) -> bytes:
    """A profile with nothing but a gray tone curve."""
    data = bytes(128) + struct.pack(">I4sII", 1, b"kTRC", 144, len(curve)) + curve
    return struct.pack(">I", len(data)) + data[4:]


def curve(*gammas: float) -> bytes:
    return (
        b"curv\0\0\0\0" + struct.pack(">I", len(gammas)) + b"".join(struct.pack(">H", round(g * 256)) for g in gammas)
    )


CURVES = {
    "none": ((), "linear"),
    "gAMA 1": ((gamma(1),), "linear"),
    "gAMA 1/2.2": ((gamma(1 / 2.2),), "the power 2.2"),
    "gAMA 0.45455": ((gamma(0.45455),), "the power 2.2"),
    "sRGB": ((chunk(b"sRGB", b"\0"),), "sRGB"),
    "sRGB over gAMA": ((chunk(b"sRGB", b"\0"), gamma(1 / 2.2)), "sRGB"),
    "iCCP of sRGB": ((icc("sRGB"),), "sRGB"),
    "iCCP over gAMA": ((icc("sRGB"), gamma(1)), "sRGB"),
    "iCCP linear": ((chunk(b"iCCP", b"p\0\0" + zlib.compress(gray_profile(curve()))),), "linear"),
    "iCCP gamma 1.8": ((chunk(b"iCCP", b"p\0\0" + zlib.compress(gray_profile(curve(1.8)))),), "the power 1.801"),
    "iCCP table": ((chunk(b"iCCP", b"p\0\0" + zlib.compress(gray_profile(curve(0, 9, 99)))),), "a table of 3 numbers"),
    **{
        f"cICP {code}": ((chunk(b"cICP", bytes([1, code, 0, 1])),), name)
        for code, name in {
            1: "BT.709",
            4: "the power 2.2",
            5: "the power 2.8",
            6: "BT.709",
            8: "linear",
            13: "sRGB",
            14: "BT.709",
            15: "BT.709",
            16: "PQ",
            17: "the transfer characteristics 17",
            18: "HLG",
        }.items()
    },
    "cICP narrow": ((chunk(b"cICP", bytes([1, 13, 0, 0])),), "a narrow range"),
    "cICP over the others": ((gamma(1), icc("sRGB"), chunk(b"cICP", bytes([9, 16, 0, 1]))), "PQ"),
    "sBIT": ((chunk(b"sBIT", b"\x08"),), "linear"),
}


@pytest.mark.parametrize("name", CURVES)
def test_png_tells_how_numbers_stand_for_light(tmp_path: Path, name: str) -> None:
    chunks, expected = CURVES[name]
    for values in (noise(SIZE), STACK[0]):
        (tmp_path / "a.png").write_bytes(png(values, *chunks))
        given = Dump(tmp_path / "a.png")
        np.testing.assert_array_equal(given.values[0], iio.imread(tmp_path / "a.png"))
        assert given.transfer.startswith(expected) and given.warnings == []


def broken_sum(one: bytes) -> bytes:
    return one[:-1] + bytes([one[-1] ^ 1])


def behind(data: bytes, extra: bytes) -> bytes:
    """With a chunk between image and end."""
    return data[:-12] + extra + data[-12:]


CUT = zlib.compress(gray_profile(curve(0, 9, 99)))[:-9]
# Chunks that say how numbers stand for light, and cannot be read.
UNREADABLE = {
    "cICP of 3 bytes": chunk(b"cICP", bytes([1, 13, 0])),
    "cICP of 5 bytes": chunk(b"cICP", bytes([1, 13, 0, 1, 0])),
    "cICP, checksum": broken_sum(chunk(b"cICP", bytes([1, 13, 0, 1]))),
    "iCCP, cut": chunk(b"iCCP", b"p\0\0" + CUT),
    "iCCP, no name": chunk(b"iCCP", b"x" * 90),
    "iCCP, checksum": broken_sum(icc("sRGB")),
    "sRGB of 2 bytes": chunk(b"sRGB", b"\0\0"),
    "sRGB, unknown intent": chunk(b"sRGB", b"\x09"),
    "gAMA of 3 bytes": chunk(b"gAMA", b"\0\0\1"),
    "gAMA of 0": gamma(0),
    "gAMA, checksum": broken_sum(gamma(1 / 2.2)),
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_png_chunks_that_cannot_be_read_are_no_silence(tmp_path: Path, name: str) -> None:
    one = UNREADABLE[name]
    (tmp_path / "a.png").write_bytes(png(STACK[0], one))
    assert Dump(tmp_path / "a.png").transfer.startswith("content that cannot be read")
    # The next word of the file is no better one.
    if one[4:8] != b"gAMA":
        (tmp_path / "a.png").write_bytes(png(STACK[0], one, gamma(1)))
        assert Dump(tmp_path / "a.png").transfer.startswith("content that cannot be read")
    cli = DUMP.with_name("clspeckle")
    command = [cli, "render", "a.png", "-o", "out"]
    said = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert said.returncode != 0 and f"its chunk {one[4:8].decode()} has content that cannot be read" in said.stderr
    assert "--transfer linear takes them as they are" in said.stderr
    subprocess.run([*command, "--transfer", "linear"], cwd=tmp_path, check=True)


def test_png_chunks_at_the_wrong_place(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(behind(png(STACK[0]), gamma(1 / 2.2)))
    assert Dump(tmp_path / "a.png").transfer.startswith("content that cannot be read")
    # EXIF data may stand behind the image.
    exif = Image.Exif()
    exif[0x0112] = 6
    (tmp_path / "a.png").write_bytes(behind(png(STACK[0]), chunk(b"eXIf", exif.tobytes()[6:])))
    assert "(orientation 6)" in Dump(tmp_path / "a.png").warnings[0]


def test_other_png_chunks_that_are_ignored_are_told(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(STACK[0], chunk(b"sBIT", b"\x0a\x0a")))
    assert "its chunk sBIT has content that cannot be read" in Dump(tmp_path / "a.png").warnings[0]
    Image.fromarray(noise(SIZE)).save(tmp_path / "a.png", transparency=3)
    assert "chunk tRNS" in Dump(tmp_path / "a.png").warnings[0]


# Numbers of the standards: ITU-R BT.709, BT.2100 (PQ: 0.5081 is 100 of 10000 cd/m^2; HLG: half the range is 1/12).
LIGHT = {
    1: lambda v: np.where(v < 0.081, v / 4.5, ((v + 0.099) / 1.099) ** (1 / 0.45)),
    16: lambda v: np.interp(v, *np.array([[0, 0.1501, 0.5081, 0.7518, 1], [0, 0.0001, 0.01, 0.1, 1]])),
    18: lambda v: np.where(v <= 0.5, v**2 / 3, (np.exp((v - 0.55991073) / 0.17883277) + 0.28466892) / 12),
}


@pytest.mark.parametrize("code", LIGHT)
def test_light_of_cicp(tmp_path: Path, code: int) -> None:
    cli = DUMP.with_name("clspeckle")
    if code == 16:
        at = np.array([[0, 0.1501, 0.5081, 0.7518, 1]])
        values = np.rint(at * 65535).astype(np.uint16)
    else:
        values = np.linspace(0, 65535, 40).astype(np.uint16)[None]
    (tmp_path / "a.png").write_bytes(png(np.repeat(values, 8, axis=0), chunk(b"cICP", bytes([1, code, 0, 1]))))
    done = subprocess.run([cli, "render", "a.png", "-o", "out", "--save-ideal", "--no-preview"], cwd=tmp_path,
                          check=True, capture_output=True, text=True)  # fmt: skip
    assert "says its chunk cICP) and were decoded" in done.stderr
    given = np.load(tmp_path / "out" / "ideal_000000.npy")[0]
    np.testing.assert_allclose(given, LIGHT[code](values[0] / 65535.0), rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize(("profile", "expected"), [("sRGB", "sRGB"), (None, "linear")])
def test_tiff_and_jpeg_profiles(tmp_path: Path, profile: str | None, expected: str) -> None:
    data = ImageCms.ImageCmsProfile(ImageCms.createProfile(profile)).tobytes() if profile else gray_profile(curve())
    for name in ("a.tif", "a.jpg"):
        Image.fromarray(noise(SIZE, 3)).save(tmp_path / name, icc_profile=data)
        assert Dump(tmp_path / name).transfer == expected


def test_profiles_that_are_cut(tmp_path: Path) -> None:
    """Of a JPEG file one part of two is missing; of a TIFF file the end, so that libtiff leaves out the tag."""
    data = gray_profile(curve(*range(40000)[:256], *[1] * 39744))
    Image.fromarray(noise(SIZE)).save(tmp_path / "a.jpg", icc_profile=data)
    whole = (tmp_path / "a.jpg").read_bytes()
    assert Dump(tmp_path / "a.jpg").transfer == "a table of 40000 numbers"
    second = whole.index(b"ICC_PROFILE\0\2\2") - 4
    length = struct.unpack(">H", whole[second + 2 : second + 4])[0]
    (tmp_path / "a.jpg").write_bytes(whole[:second] + whole[second + 2 + length :])
    assert Dump(tmp_path / "a.jpg").transfer.startswith("content of which parts are missing")
    for order in "<>":
        for big in (False, True):
            tifffile.imwrite(tmp_path / "a.tif", STACK[0], iccprofile=data, byteorder=order, bigtiff=big)
            assert Dump(tmp_path / "a.tif").transfer == "a table of 40000 numbers"
            with tifffile.TiffFile(tmp_path / "a.tif") as read:
                tag = read.pages[0].tags[34675]
                place, words = tag.offset + (12 if big else 8), "Q" if big else "I"
            cut = bytearray((tmp_path / "a.tif").read_bytes())
            struct.pack_into(order + words, cut, place, len(cut) + 1000)
            (tmp_path / "a.tif").write_bytes(cut)
            assert Dump(tmp_path / "a.tif").transfer.startswith("content that cannot be read")


def test_animations_are_refused_but_for_their_first_image(tmp_path: Path) -> None:
    frames = [Image.fromarray((frame >> 2).astype(np.uint8)) for frame in STACK]
    frames[0].save(tmp_path / "a.png", save_all=True, append_images=frames[1:])
    error = Dump(tmp_path / "a.png").error
    assert "is an animation of 4 images (APNG)" in error and "a.png:page=0" in error
    np.testing.assert_array_equal(Dump(tmp_path / "a.png:page=0").values[0], STACK[0] >> 2)
    assert "has no page 1" in Dump(tmp_path / "a.png:page=1").error


def test_png_files_behind_each_other(tmp_path: Path) -> None:
    """As a pipe of pictures leaves them."""
    (tmp_path / "a.png").write_bytes(png(STACK[0]) + png(STACK[1]))
    error = Dump(tmp_path / "a.png").error
    assert "holds another PNG image behind the first one" in error and "a.png:page=0" in error
    np.testing.assert_array_equal(Dump(tmp_path / "a.png:page=0").values[0], STACK[0])
    (tmp_path / "a.png").write_bytes(png(STACK[0]) + b"something else")
    assert "14 bytes follow" in Dump(tmp_path / "a.png").warnings[0]


# --- NPY and PNM: one of several ---


def test_a_page_of_other_stacks(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", REAL)
    np.testing.assert_array_equal(Dump(tmp_path / "a.npy:page=3").values[0], REAL[3])
    assert "has no page 4; its 4 images are numbered from 0" in Dump(tmp_path / "a.npy:page=4").error
    (tmp_path / "a.pgm").write_bytes(b"".join(b"P5 40 28 1023\n" + frame.astype(">u2").tobytes() for frame in STACK))
    np.testing.assert_array_equal(Dump(tmp_path / "a.pgm:page=1").values[0], STACK[1])
    assert "names no page" in Dump(tmp_path / "a.pgm:page=one").error
