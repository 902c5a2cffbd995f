"""Bytes behind the last image, and what the formats' own words say of numbers."""

from __future__ import annotations

import io
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import test_variants_hdr
import test_variants_tiff
import tifffile
from PIL import Image, ImageCms
from test_variants import GRAY, Dump, blocks, bmp, bmp_rows, noise, tga
from test_variants_hdr import images
from test_variants_pages import broken_sum, chunk, png


def tga_footer(extension: int = 0) -> bytes:
    return struct.pack("<II", extension, 0) + b"TRUEVISION-XFILE.\0"


def saved(image: Image.Image, kind: str, **options: object) -> bytes:
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def whole_files() -> dict[str, bytes]:
    gray = Image.fromarray(blocks((13, 6)))
    rgbe = np.full((6, 13, 4), 130, np.uint8)
    return {
        "a.bmp": saved(gray, "BMP"),
        "a.tga": tga(blocks((13, 6)).tobytes(), (13, 6), 3, 8),
        "runs.tga": saved(gray, "TGA", compression="tga_rle")[:-26],
        "flat.hdr": test_variants_hdr.HEADERS["rgbe"].format(w=13, h=6).encode() + test_variants_hdr.flat(rgbe),
        "old.hdr": test_variants_hdr.HEADERS["rgbe"].format(w=13, h=6).encode() + test_variants_hdr.old_runs(rgbe),
        "new.hdr": test_variants_hdr.HEADERS["rgbe"].format(w=13, h=6).encode() + test_variants_hdr.new_runs(rgbe),
        "a.jpg": saved(gray, "JPEG"),
        "progressive.jpg": saved(Image.fromarray(noise((64, 64), 3)), "JPEG", progressive=True, quality=95),
        "restarts.jpg": saved(Image.fromarray(noise((64, 64), 3)), "JPEG", restart_marker_blocks=2),
        "a.png": saved(gray, "PNG"),
        "a.pgm": saved(gray, "PPM"),
    }


@pytest.mark.parametrize("extra", [1, 7, 4096])
def test_bytes_behind_the_last_image_are_told(tmp_path: Path, extra: int) -> None:
    for name, data in whole_files().items():
        (tmp_path / name).write_bytes(data)
        before = Dump(tmp_path / name)
        assert not before.error and not [w for w in before.warnings if "follow" in w], name
        (tmp_path / name).write_bytes(data + bytes(range(1, 256)) * 17 if extra > 4000 else data + b"x" * extra)
        after = Dump(tmp_path / name)
        count = 255 * 17 if extra > 4000 else extra
        told = f"{count} bytes follow the last image and are" if count > 1 else "1 byte follows the last image and is"
        assert [w for w in after.warnings if w.startswith(f"{told} not read")], name
        np.testing.assert_array_equal(after.values, before.values)


def test_what_a_format_keeps_behind_its_pixels_is_no_surplus(tmp_path: Path) -> None:
    values = blocks((13, 6))
    # The size in the header of a BMP file counts what some programs add.
    data = bytearray(bmp(bmp_rows(values), (13, 6), 8, GRAY) + bytes(2))
    data[2:6] = struct.pack("<I", len(data))
    (tmp_path / "a.bmp").write_bytes(data)
    assert Dump(tmp_path / "a.bmp").warnings == []
    # A TGA file with a footer may have a developer's area and an extension area.
    (tmp_path / "a.tga").write_bytes(tga(values.tobytes(), (13, 6), 3, 8) + b"developer's" + tga_footer())
    given = Dump(tmp_path / "a.tga")
    given.check(values, 255)
    assert given.warnings == []


def bmp_with(
    values: np.ndarray, space: int, gammas: tuple[int, ...] = (0, 0, 0), behind: bytes = b"", size: int | None = None
) -> bytes:
    """Of version 5, with what its header says of light."""
    gray = values.ndim == 2
    data = bytearray(bmp(bmp_rows(values), values.shape[1::-1], 8 if gray else 24, GRAY if gray else b"", header=124))
    data[70:74] = struct.pack("<I", space)
    data[110:122] = struct.pack("<3I", *gammas)
    data[126:134] = struct.pack("<II", len(data) - 14, len(behind) if size is None else size)
    return bytes(data) + behind


def test_bmp_tells_how_numbers_stand_for_light(tmp_path: Path) -> None:
    values = noise((8, 4), 3)

    def transfer(*words: int | tuple[int, ...], **options: bytes | int) -> str:
        (tmp_path / "a.bmp").write_bytes(bmp_with(values, *words, **options))
        given = Dump(tmp_path / "a.bmp")
        assert given.warnings == []
        given.check(values, 255)
        return given.transfer

    assert transfer(0) == "linear"
    assert transfer(0, (65536,) * 3) == "linear"
    assert transfer(0, (144179,) * 3) == "the power 2.2"
    assert transfer(0, (144179, 65536, 65536)).startswith("other gammas")
    assert transfer(0x57696E20) == "sRGB"
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    assert transfer(0x4D424544, behind=profile) == "sRGB"
    assert transfer(0x4D424544, size=1 << 20).startswith("content that cannot be read")
    assert transfer(0x4C494E4B).startswith("its content in another file")


def tga_with_gamma(values: np.ndarray, gamma: tuple[int, int], aspect: tuple[int, int] = (0, 0)) -> bytes:
    pixels = tga(values.tobytes(), values.shape[::-1], 3, 8)
    extension = bytearray(struct.pack("<H", 495) + bytes(493))
    extension[474:482] = struct.pack("<HHHH", *aspect, *gamma)
    return pixels + bytes(extension) + tga_footer(len(pixels))


@pytest.mark.parametrize(
    ("gamma", "says"), [((22, 10), "the power 2.2"), ((1, 1), "linear"), ((0, 0), "linear"), ((0, 5), "the power 0")]
)
def test_tga_tells_its_gamma(tmp_path: Path, gamma: tuple[int, int], says: str) -> None:
    (tmp_path / "a.tga").write_bytes(tga_with_gamma(noise((8, 4)), gamma))
    assert Dump(tmp_path / "a.tga").transfer == says


def test_hdr_gamma_is_told(tmp_path: Path) -> None:
    rgbe = np.full((6, 13, 4), 130, np.uint8)
    head = test_variants_hdr.HEADERS["comments"].format(w=13, h=6).replace("GAMMA=1", "GAMMA=2.2").encode()
    (tmp_path / "a.hdr").write_bytes(head + test_variants_hdr.flat(rgbe))
    assert Dump(tmp_path / "a.hdr").warnings == ["the gamma in its header (2.2) is ignored"]


# --- TIFF: calibrations of ImageJ, and tables of light ---


def imagej(path: Path, values: np.ndarray, *lines: str, **options: object) -> None:
    text = "\n".join(["ImageJ=1.54f", *lines, ""])
    tifffile.imwrite(path, values, description=text, metadata=None, photometric="minisblack", **options)


LINE = ("cf=0", "c0=-0.5", "c1=0.25", "vunit=mm")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("options", [{}, {"compression": "zlib"}, {"tile": (16, 16)}])
def test_numbers_that_imagej_calibrates_by_a_line_are_taken_so(tmp_path: Path, dtype: type, options: dict) -> None:
    values = noise((41, 23), 1, np.iinfo(dtype).max).astype(dtype)
    imagej(tmp_path / "a.tif", values, *LINE, **options)
    given = Dump(tmp_path / "a.tif")
    given.check(values * 0.25 - 0.5, 0)
    assert given.warnings == [
        "its numbers are calibrated by ImageJ and were taken so: -0.5 + 0.25 times the number that is stored, in mm"
    ]


def test_a_stack_of_imagej_is_calibrated(tmp_path: Path) -> None:
    values = np.stack([noise((41, 23), 1, 1023), noise((41, 23), 1, 511)])
    imagej(tmp_path / "a.tif", values[0], "images=2", "frames=2", *LINE)
    with open(tmp_path / "a.tif", "rb") as file, tifffile.TiffFile(file) as tiff:
        at = tiff.pages[0].dataoffsets[0]
    data = (tmp_path / "a.tif").read_bytes()
    assert at + values[0].nbytes == len(data), "the second image goes behind the first"
    (tmp_path / "a.tif").write_bytes(data + values[1].tobytes())
    given = Dump(tmp_path / "a.tif")
    assert given.frames == 2
    given.check(values * 0.25 - 0.5, 0)


def test_signed_numbers_of_imagej(tmp_path: Path) -> None:
    values = noise((41, 23), 1, 65535)
    lines = ("cf=0", "c0=-32768.0", "c1=1.0", "vunit=Gray Value")
    imagej(tmp_path / "a.tif", values, *lines)
    Dump(tmp_path / "a.tif").check(values.astype(int) - 32768, 0)
    imagej(tmp_path / "a.tif", (values.astype(int) - 32768).astype(np.int16), *lines)
    given = Dump(tmp_path / "a.tif")
    given.check(values.astype(int) - 32768, 0)
    assert given.warnings == []


@pytest.mark.parametrize("lines", [("cf=20",), ("cf=0", "c0=0.0", "c1=1.0"), ()])
def test_imagej_without_a_calibration(tmp_path: Path, lines: tuple[str, ...]) -> None:
    imagej(tmp_path / "a.tif", noise((41, 23)), *lines)
    given = Dump(tmp_path / "a.tif")
    given.check(noise((41, 23)), 255)
    assert given.warnings == []


@pytest.mark.parametrize(
    "lines",
    [("cf=1", "c0=0", "c1=1", "c2=1"), ("cf=21",), ("cf=0",), ("cf=0", "c0=1", "c1=0"), ("cf=0", "c0=nan", "c1=1")],
)
def test_curves_of_imagej_are_refused_with_a_way_out(tmp_path: Path, lines: tuple[str, ...]) -> None:
    path = tmp_path / "a.tif"
    imagej(path, noise((41, 23)), *lines)
    advice = re.search(r"(tifffile\.imwrite\(new_path, tifffile\.imread\(path\)\))", Dump(path).error)
    assert advice and "calibrated by ImageJ" in Dump(path).error
    eval(advice[1], {"tifffile": tifffile, "path": path, "new_path": tmp_path / "b.tif"})
    Dump(tmp_path / "b.tif").check(noise((41, 23)), 255)


def gdal(path: Path, values: np.ndarray, **items: float) -> None:
    text = "".join(
        f'<Item name="{role.upper()}" sample="0" role="{role}">{number}</Item>' for role, number in items.items()
    )
    tifffile.imwrite(
        path,
        values,
        metadata=None,
        photometric="rgb" if values.ndim == 3 else "minisblack",
        extratags=[(42112, "s", 0, f"<GDALMetadata>{text}</GDALMetadata>", True)],
    )


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int16, np.float32])
def test_scale_and_offset_of_gdal_are_applied(tmp_path: Path, dtype: type) -> None:
    values = noise((41, 23)).astype(dtype)
    gdal(tmp_path / "a.tif", values, scale=0.25, offset=-3)
    given = Dump(tmp_path / "a.tif")
    given.check(values * 0.25 - 3.0, 0)
    assert given.warnings == [
        "its numbers are calibrated by GDAL and were taken so: -3 + 0.25 times the number that is stored"
    ]
    for items in ({}, {"scale": 1, "offset": 0}, {"description": 3}):
        gdal(tmp_path / "a.tif", values, **items)
        given = Dump(tmp_path / "a.tif")
        given.check(values, {np.uint8: 255, np.uint16: 65535}.get(dtype, 0))
        assert given.warnings == []
    gdal(tmp_path / "a.tif", np.stack([values] * 3, -1), scale=0.25)
    assert "calibrated by GDAL in a way that is not applied here" in Dump(tmp_path / "a.tif").error


def test_pixels_that_are_no_squares_are_told(tmp_path: Path) -> None:
    values = noise((41, 23))
    told = ["it says that its pixels are 0.5 times as wide as high; they are taken as square"]
    tifffile.imwrite(tmp_path / "a.tif", values, resolution=(144, 72))
    Image.fromarray(values).save(tmp_path / "a.png", dpi=(144, 72))
    images.exr(tmp_path / "a.exr", {"Y": values / np.float32(255)}, pixelAspectRatio=0.5)
    for dpi, aspect in (((144, 72), (1, 2)), ((72, 72), (1, 1)), ((72, 72), (0, 0))):
        tifffile.imwrite(tmp_path / "a.tif", values, resolution=dpi)
        for name in ("a.png", "a.bmp", "a.jpg"):
            Image.fromarray(values).save(tmp_path / name, dpi=dpi)
        (tmp_path / "a.tga").write_bytes(tga_with_gamma(values, (0, 0), aspect))
        line = f"PIXASPECT={dpi[0] // dpi[1]}\nFORMAT"
        head = test_variants_hdr.HEADERS["radiance"].format(w=13, h=6).replace("FORMAT", line)
        (tmp_path / "a.hdr").write_bytes(head.encode() + test_variants_hdr.flat(np.full((6, 13, 4), 130, np.uint8)))
        for name in ("a.tif", "a.png", "a.bmp", "a.tga", "a.hdr"):
            assert Dump(tmp_path / name).warnings == (told if dpi == (144, 72) else []), name
        assert (told[0] in Dump(tmp_path / "a.jpg").warnings) == (dpi == (144, 72))
    assert Dump(tmp_path / "a.exr").warnings == told


@pytest.mark.parametrize("photometric", [32803, 34892])
def test_raw_data_of_cameras_have_a_way_out(tmp_path: Path, photometric: int) -> None:
    values = noise((41, 23), 1, 1023)
    path = tmp_path / "a.tif"
    path.write_bytes(test_variants_tiff.tiff_of(values.tobytes(), (41, 23), 16, photometric=photometric))
    advice = re.search(
        r"(tifffile\.imwrite\(new_path, image, photometric=\"minisblack\"\)); .* (image\[0::2, 0::2\])",
        Dump(path).error,
    )
    assert advice
    for image in (values, eval(advice[2], {"image": values})):
        eval(advice[1], {"tifffile": tifffile, "new_path": tmp_path / "b.tif", "image": image})
        Dump(tmp_path / "b.tif").check(image, 65535)


def test_complex_numbers_have_a_way_out(tmp_path: Path) -> None:
    values = noise((41, 23))
    tifffile.imwrite(tmp_path / "a.tif", values.astype(np.complex64))
    advice = re.search(r"Save (numpy\.abs\(image\)\.astype\(numpy\.float32\))", Dump(tmp_path / "a.tif").error)
    assert advice
    tifffile.imwrite(tmp_path / "a.tif", eval(advice[1], {"numpy": np, "image": tifffile.imread(tmp_path / "a.tif")}))
    Dump(tmp_path / "a.tif").check(values, 0)


def table(exponent: float, count: int) -> list[int]:
    return [round(65535 * (i / (count - 1)) ** exponent) for i in range(count)]


@pytest.mark.parametrize(
    ("tables", "says"),
    [
        ([table(1, 256)], "linear"),
        ([table(2.2, 256)], "a table of 256 numbers"),
        ([table(1, 200)], "content that cannot be read"),
        ([table(2.2, 65536)], "a table of 65536 numbers"),
        ([table(2.2, 256)] * 3, "a table of 256 numbers"),
        ([table(2.2, 256), table(2.2, 256), table(1, 256)], "other tables for red, green and blue"),
    ],
)
def test_tiff_tables_of_light(tmp_path: Path, tables: list[list[int]], says: str) -> None:
    values = noise((41, 23), len(tables), 65535 if len(tables[0]) > 256 else 255)
    numbers = [number for one in tables for number in one]
    tifffile.imwrite(tmp_path / "a.tif", values, extratags=[(301, "H", len(numbers), numbers, True)])
    given = Dump(tmp_path / "a.tif")
    np.testing.assert_array_equal(np.squeeze(given.values), values)
    assert given.transfer.startswith(says)


# --- EXIF data ---


def exif_tiff(space: int, order: str, place: int | None = None) -> bytes:
    """One image, then the directory of EXIF data with a color space."""
    values = noise((41, 23))
    start = 8 + values.size + values.size % 2
    data = values.tobytes() + bytes(values.size % 2)
    directory = struct.pack(order + "HHHIHHI", 1, 0xA001, 3, 1, space, 0, 0)
    return test_variants_tiff.tiff_of(data + directory, (41, 23), 8, order, exif=start if place is None else place)


@pytest.mark.parametrize("order", ["<", ">"])
def test_the_color_space_of_exif_data_in_a_tiff_file(tmp_path: Path, order: str) -> None:
    for space, told in ((1, "sRGB"), (65535, "linear")):
        (tmp_path / "a.tif").write_bytes(exif_tiff(space, order))
        given = Dump(tmp_path / "a.tif")
        given.check(noise((41, 23)), 255)
        assert given.transfer == told
    with Image.open(tmp_path / "a.tif") as image:
        assert image.getexif().get_ifd(0x8769)[0xA001] == 65535
    # What cannot be read says nothing.
    for place in (10**6, 2**32 - 2, 0):
        (tmp_path / "a.tif").write_bytes(exif_tiff(1, order, place))
        given = Dump(tmp_path / "a.tif")
        given.check(noise((41, 23)), 255)
        assert given.transfer == "linear"


def test_exif_data_that_cannot_be_read_are_told(tmp_path: Path) -> None:
    good = Image.Exif()
    good[0x0112] = 1
    values = noise((41, 23))
    whole = chunk(b"eXIf", good.tobytes()[6:])
    for one, told in (
        (whole, 0),
        (broken_sum(whole), 1),
        (chunk(b"eXIf", b"garbage" * 9), 1),
        (chunk(b"eXIf", b"II*\0\xff\xff\0\0"), 1),
    ):
        (tmp_path / "a.png").write_bytes(png(values, one))
        given = Dump(tmp_path / "a.png")
        given.check(values, 255)
        assert len([w for w in given.warnings if w.startswith("its chunk eXIf cannot be read")]) == told
    for data, told in ((good.tobytes(), 0), (b"Exif\0\0" + b"garbage" * 9, 1)):
        Image.fromarray(values).save(tmp_path / "a.jpg", exif=data)
        assert (
            len([w for w in Dump(tmp_path / "a.jpg").warnings if w.startswith("its EXIF data cannot be read")]) == told
        )


def tagged(path: Path, values: np.ndarray, *tags: tuple) -> Dump:
    tifffile.imwrite(path, values, metadata=None, photometric="minisblack", extratags=[(*tag, True) for tag in tags])
    return Dump(path)


def test_densities_of_gray_are_no_light(tmp_path: Path) -> None:
    """GrayResponseCurve, a tag of TIFF 6.0, has an optical density for each number."""
    values = noise((13, 6))
    given = tagged(tmp_path / "a.tif", values, (290, "H", 1, 3), (291, "H", 256, tuple(range(255, -1, -1))))
    given.check(values, 255)
    assert given.transfer == "a table of optical densities"


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_numbers_that_stand_for_none_are_told(tmp_path: Path, dtype: type) -> None:
    values = noise((13, 6)).astype(dtype)
    values[2, 3:6] = 9999
    given = tagged(tmp_path / "a.tif", values, (42113, "s", 0, "9999"))
    [warning] = given.warnings
    assert "pixels of 9999 have no value (tag GDAL_NODATA)" in warning
    advice = re.search(r"save (numpy\.where\(image == 9999, 0, image\))", warning)
    assert advice
    image = eval(advice[1], {"numpy": np, "image": values})
    assert (image[2, 3:6] == 0).all() and (image[0] == values[0]).all()
    for harmless in ("0", "nan"):
        assert tagged(tmp_path / "a.tif", values, (42113, "s", 0, harmless)).warnings == []


def test_xmp_in_a_tiff_file_is_read(tmp_path: Path) -> None:
    packet = b'<x:xmpmeta><rdf:Description tiff:Orientation="6"/></x:xmpmeta>'
    given = tagged(tmp_path / "a.tif", noise((13, 6)), (700, "B", len(packet), packet))
    assert [w for w in given.warnings if "turned clockwise to be seen (orientation 6)" in w]
    assert tagged(tmp_path / "a.tif", noise((13, 6)), (700, "B", 3, b"<x>")).warnings == []


def test_physical_values_of_png_are_told(tmp_path: Path) -> None:
    calibration = chunk(b"pCAL", b"metres\0" + struct.pack(">iiBB", 0, 255, 0, 2) + b"m\x000\x001")
    (tmp_path / "a.png").write_bytes(saved(Image.fromarray(noise((13, 6))), "PNG"))
    data = (tmp_path / "a.png").read_bytes()
    at = data.index(b"IDAT") - 4
    (tmp_path / "a.png").write_bytes(data[:at] + calibration + data[at:])
    given = Dump(tmp_path / "a.png")
    given.check(noise((13, 6)), 255)
    assert given.warnings == [
        "the physical values that its chunk pCAL gives its numbers are ignored; they are taken as stored"
    ]


def named_pages(path: Path, tag: int, names: list[str]) -> Dump:
    with tifffile.TiffWriter(path) as file:
        for i, name in enumerate(names):
            file.write(noise((13, 6)) // (i + 1), metadata=None, description=None, photometric="minisblack",
                       extratags=[(tag, "s", 0, name, True)])  # fmt: skip
    return Dump(path)


@pytest.mark.parametrize("tag", [285, 270])
def test_pages_of_several_names_are_no_series(tmp_path: Path, tag: int) -> None:
    for names in (["beauty", "depth", "albedo"], ["left 1", "right 1", "left 2", "right 2"]):
        error = named_pages(tmp_path / "a.tif", tag, names).error
        assert "holds images that are no series: page 0 13 x 6, 1 x 8 bits, called" in error, names
        assert f'"{names[1].split()[0]}"' in error and f"{tmp_path / 'a.tif'}:page=0" in error
    for names in (
        ["frame 1", "frame 2"], ["Frame0001.tif", "Frame0002.tif"], ["1a2f", "b33c9"], ["12.5 ms", "25 ms"], ["",
                                                                                                              "other"],
        ['{"camera": "left"}', '{"camera": "right"}'], ["gain=1\nfocus=near", "gain=1\nfocus=far"],
    ):  # fmt: skip
        given = named_pages(tmp_path / "a.tif", tag, names)
        assert not given.error and given.frames == len(names), names
