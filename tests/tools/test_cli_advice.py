"""What messages advise, done: each case provokes a message, follows it, and sees the program take it.

tests/house/advice.txt says which test follows which advice."""

from __future__ import annotations

import gzip
import json
import lzma
import os
import re
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image
from test_cli_scene import CAMERA, LASER, PATTERN, depth, scene

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))
import test_variants_pages  # noqa: E402
import test_variants_tiff  # noqa: E402

__all__ = ["scene"]

Write = Callable[[Path], object]
FOLDER = Path("FOLDER")


def unzip(folder: Path) -> None:
    with zipfile.ZipFile(folder / "a.zip") as archive:
        archive.extractall(folder)


def zipped(folder: Path) -> None:
    iio.imwrite(folder / "in.png", images.gray8())
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        archive.write(folder / "in.png", "b.png")


def reopened(folder: Path, old: str, new: str, **options: object) -> None:
    with Image.open(folder / old) as image:
        image.load()
        image.copy().save(folder / new, **options)


def turned_tiff(folder: Path, orientation: int) -> None:
    tifffile.imwrite(folder / "a.tif", images.gray8(), extratags=[(274, 3, 1, orientation, True)])


def apng(folder: Path) -> None:
    frames = [Image.fromarray(np.roll(images.gray8(), i)) for i in range(3)]
    frames[0].save(folder / "a.png", save_all=True, append_images=frames[1:])


def split_apng(folder: Path) -> None:
    with Image.open(folder / "a.png") as image:
        for i in range(3):
            image.seek(i)
            image.convert("L").save(folder / f"b{i}.png")


# Name: what makes the file, how it is rendered, the advice, what follows it, and how the file is rendered then.
def apart(folder: Path) -> None:
    window = (np.array([1000, 1000], np.int32), np.array([1039, 1027], np.int32))
    images.exr(folder / "a.exr", {"Y": images.real()}, displayWindow=window)


def one_window(folder: Path) -> None:
    """The line that the message has."""
    path, new_path = str(folder / "a.exr"), str(folder / "b.exr")
    file = OpenEXR.File(path, separate_channels=True)
    file.header()["displayWindow"] = file.header()["dataWindow"]
    file.write(new_path)


FILES: dict[str, tuple[Write, str, str, Write, str]] = {
    "apart": (
        apart,
        "a.exr",
        "If they are the image, save it with one window: file = OpenEXR.File(path, separate_channels=True); "
        'file.header()["displayWindow"] = file.header()["dataWindow"]; file.write(new_path)',
        one_window,
        "b.exr",
    ),
    "gif": (
        lambda f: Image.fromarray(images.gray8()).save(f / "a.gif"),
        "a.gif",
        "convert it to PNG, TIFF or NPY",
        lambda f: reopened(f, "a.gif", "b.png"),
        "b.png",
    ),
    "webp": (
        lambda f: Image.fromarray(images.gray8()).save(f / "a.webp"),
        "a.webp",
        "convert it to PNG, TIFF or NPY",
        lambda f: reopened(f, "a.webp", "b.png"),
        "b.png",
    ),
    "hdf5": (
        lambda f: (f / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100)),
        "a.h5",
        'numpy.save("image.npy", array)',
        lambda f: np.save(f / "image.npy", images.gray8()),
        "image.npy",
    ),
    "gzip": (
        lambda f: (f / "a.pgm.gz").write_bytes(gzip.compress(b"P5 8 8 255\n" + bytes(range(64)))),
        "a.pgm.gz",
        "unpack it",
        lambda f: (f / "a.pgm").write_bytes(gzip.decompress((f / "a.pgm.gz").read_bytes())),
        "a.pgm",
    ),
    "video": (
        lambda f: (f / "a.mp4").write_bytes(b"\0\0\0\x18ftypmp42" + bytes(100)),
        "a.mp4",
        "is a file of the format MP4, which is not read; save its frames as PNG, TIFF or NPY",
        lambda f: iio.imwrite(f / "b0.png", images.gray8()),
        "b?.png",
    ),
    "xz": (
        lambda f: (f / "a.pgm.xz").write_bytes(lzma.compress(b"P5 8 8 255\n" + bytes(range(64)))),
        "a.pgm.xz",
        "is a file of the format xz, which is not read; unpack it",
        lambda f: (f / "a.pgm").write_bytes(lzma.decompress((f / "a.pgm.xz").read_bytes())),
        "a.pgm",
    ),
    "zip": (zipped, "a.zip", "is a ZIP archive; unpack it", unzip, "b.png"),
    "no_frames": (
        lambda f: np.save(f / "a.npy", np.ones((0, 9, 9))),
        "a.npy",
        "save it with at least one frame",
        lambda f: np.save(f / "a.npy", np.ones((1, 9, 9))),
        "a.npy",
    ),
    "apng": (apng, "a.png", "Write the images into files of their own to read all", split_apng, "b?.png"),
    "png_behind": (
        lambda f: (f / "a.png").write_bytes(2 * test_variants_pages.png(images.gray8())),
        "a.png",
        "Write the images into files of their own to read all",
        lambda f: [(f / f"b{i}.png").write_bytes(test_variants_pages.png(images.gray8())) for i in range(2)],
        "b?.png",
    ),
    "bitmap": (
        lambda f: Image.fromarray(images.gray8() > 99).save(f / "a.pbm"),
        "a.pbm",
        "pbmtopgm 1 1 a.pbm > gray.pgm",
        lambda f: Image.fromarray(images.gray8()).save(f / "gray.pgm"),
        "gray.pgm",
    ),
    "no_series": (
        lambda f: (f / "a.pgm").write_bytes(b"P5 8 8 255\n" + bytes(range(64)) + b"P5 4 4 255\n" + bytes(range(16))),
        "a.pgm",
        "pamsplit a.pgm image%d.pgm",
        lambda f: (f / "image0.pgm").write_bytes(b"P5 8 8 255\n" + bytes(range(64))),
        "image0.pgm",
    ),
    "lossy_tiff": (
        lambda f: Image.fromarray(images.gray8()).save(f / "a.tif", compression="jpeg"),
        "a.tif",
        "save it without, or with deflate or LZW",
        lambda f: reopened(f, "a.tif", "a.tif", compression="tiff_deflate"),
        "a.tif",
    ),
    "reduced_only": (
        lambda f: tifffile.imwrite(f / "a.tif", np.stack([images.gray8()] * 2), subfiletype=1),
        "a.tif",
        "Name one behind the file's name, for example a.tif:page=0",
        lambda f: None,
        "a.tif:page=0",
    ),
    "wide_palette": (
        lambda f: (f / "a.tif").write_bytes(
            test_variants_tiff.tiff_of(
                images.gray16().tobytes(), (images.WIDTH, images.HEIGHT), 16, photometric=3, colors=(0,) * 196608
            )
        ),
        "a.tif",
        "has a palette of a kind that is not read; convert it to RGB",
        lambda f: tifffile.imwrite(f / "a.tif", images.rgb(images.gray16()), photometric="rgb"),
        "a.tif",
    ),
    "palette_with_opacity": (
        lambda f: (f / "a.tif").write_bytes(
            test_variants_tiff.tiff_of(
                bytes(2 * images.gray8().size),
                (images.WIDTH, images.HEIGHT),
                8,
                photometric=3,
                channels=2,
                colors=tuple(range(256)) * 3,
            )
        ),
        "a.tif",
        "has a palette and an opacity",
        lambda f: tifffile.imwrite(f / "a.tif", images.rgb(images.gray8()), photometric="rgb"),
        "a.tif",
    ),
    "orientation": (
        lambda f: turned_tiff(f, 6),
        "a.tif",
        "Turn them and save them without that word",
        lambda f: tifffile.imwrite(f / "a.tif", np.rot90(images.gray8(), -1)),
        "a.tif",
    ),
    **{
        f"hdr_{words[0]}": (
            lambda f, words=words: (f / "a.hdr").write_bytes(
                f"#?RADIANCE\nFORMAT=32-bit_rle_{words[0]}\n\n{words[1]}\n".encode() + bytes([128, 128, 128, 128]) * 48
            ),
            "a.hdr",
            "supported; convert it to EXR" if words[0] == "rgbe" else "only 32-bit_rle_rgbe; convert it to EXR",
            lambda f: images.exr(f / "a.exr", {"Y": images.real()}),
            "a.exr",
        )
        for words in (("rgbe", "+Y 6 +X 8"), ("xyze", "-Y 6 +X 8"))
    },
    "channels_of_exr": (
        lambda f: images.exr(f / "a.exr", {f"l{i}.R": images.real()[:2, :2] for i in range(1025)}),
        "a.exr",
        "save those that are needed as a file of their own",
        lambda f: images.exr(f / "b.exr", {f"l{i}.R": images.real()[:2, :2] for i in range(1024)}),
        "b.exr:l9.R",
    ),
    "runs_of_bmp": (
        lambda f: (f / "a.bmp").write_bytes(
            b"BM" + bytes(8) + b"\x36\0\0\0\x28\0\0\0\x08\0\0\0\x08\0\0\0\x01\0\x10\0" + bytes(500)
        ),
        "a.bmp",
        "Convert it to PNG",
        lambda f: iio.imwrite(f / "a.png", images.gray8()),
        "a.png",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_files(cli, ok, tmp_path: Path, name: str) -> None:
    make, given, advice, follow, then = FILES[name]
    make(tmp_path)
    told = cli("render", given, "-o", "out", "--no-preview", "--exposure-gain", 500).err
    assert advice in told, told
    follow(tmp_path)
    told = ok("render", then, "-o", "then", "--no-preview", "--exposure-gain", 500).err
    assert advice not in told


def ideal_and(folder: Path) -> None:
    images.exr(folder / "whole.exr", {c: images.real() for c in "RGB"})
    np.save(folder / "ideal.npy", images.real())
    np.save(folder / "stack.npy", np.stack([images.real()] * 3))
    np.save(folder / "ids.npy", np.zeros(depth().shape, np.uint8))
    np.save(folder / "plane_ids.npy", np.zeros((images.HEIGHT, images.WIDTH), np.uint8))
    np.save(folder / "tiny.npy", images.real() * np.float32(1e-38))
    np.save(folder / "mask.npy", np.ones((images.HEIGHT, images.WIDTH), np.uint8))
    (folder / "codes.raw").write_bytes(images.gray8().tobytes())
    (folder / "config.json").write_text('{"aperture": {"f_number": 8}}')
    (folder / "materials.json").write_text(
        '{"materials": [{"id": 0, "roughness_rms_m": 1e-5, "degree_of_polarization": 0.5}]}'
    )
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "whiteLuminance": 100.0},
                 {"Y": images.real()}).write(str(folder / "white.exr"))  # fmt: skip
    (folder / "mixed").mkdir()
    for i in range(2):
        iio.imwrite(folder / "mixed" / f"f{i}.png", images.gray8())
        tifffile.imwrite(folder / "mixed" / f"f{i}.tif", images.gray8())


SURFACE = ["--depth", "z.npy", *CAMERA]
SCENE = [*SURFACE, *PATTERN, *LASER]
RAW = f"{images.WIDTH}x{images.HEIGHT},8"

# Name: what is refused or warned of, the advice, and what follows it.
RENDER: dict[str, tuple[list, str, list]] = {
    "raw": (["codes.raw"], "raw frames must be described: ", ["codes.raw", "--raw", RAW]),
    "two_channels": (
        ["whole.exr:R", "--channel", "G"],
        'two channels are named, "R" and "G"; name one',
        ["whole.exr:R"],
    ),
    "channel_or_raw": (
        ["codes.raw", "--raw", RAW, "--channel", "R"],
        "give either --channel or --raw",
        ["codes.raw", "--raw", RAW],
    ),
    "raw_of_nothing": (["--raw", RAW], "name them, or leave it out", ["codes.raw", "--raw", RAW]),
    "nothing": ([], "give an ideal image, a scene, or --depth or --position", SCENE),
    "two_surfaces": (["--depth", "z.npy", "--position", "p.npy"], "give either --depth or --position, not both", SCENE),
    "input_and_depth": (["ideal.npy", *SURFACE], "give either an input file or --depth or --position", ["ideal.npy"]),
    "plane_of_an_image": (
        ["ideal.npy", "--albedo", "a.npy"],
        "--normal, --albedo and --visibility belong to a scene",
        [*SCENE, "--albedo", "a.npy"],
    ),
    "configuration": (
        ["config.json"],
        "a configuration is given with --config",
        ["ideal.npy", "--config", "config.json"],
    ),
    "no_sensor": (
        ["ideal.npy", "--no-sensor"],
        "choose a --format that begins with float-",
        ["ideal.npy", "--no-sensor", "--format", "float-npy"],
    ),
    "no_pattern": (SURFACE, "name the projected pattern with --pattern IMAGE", SCENE),
    "pattern_of_an_image": (["ideal.npy", *PATTERN], "which takes no --pattern; a scene has", ["ideal.npy"]),
    "lamp_on_a_scene": (
        [*SCENE, "--illumination", "incoherent"],
        "--illumination incoherent needs an ideal image",
        ["ideal.npy", "--illumination", "incoherent"],
    ),
    "motion": (["ideal.npy", "--motion", "replace"], "does not tell how it moves", ["ideal.npy"]),
    "no_camera": (["--depth", "z.npy", *PATTERN, *LASER], "give --fx, --fy, --cx and --cy in pixels", SCENE),
    "refresh": (
        ["ideal.npy", "--refresh", "mask"],
        "--refresh mask: the input has no refresh mask",
        ["ideal.npy", "--refresh", "mask", "--refresh-mask", "mask.npy"],
    ),
    "frames": (["stack.npy", "--frames", 4], "--frames 4: the input has 3 frames", ["stack.npy", "--frames", 3]),
    "no_materials": (
        ["ideal.npy", "--material", "plane_ids.npy"],
        "add --materials FILE",
        ["ideal.npy", "--material", "plane_ids.npy", "--materials", "materials.json"],
    ),
    "no_ids": (
        [*SCENE, "--materials", "materials.json"],
        "or --material IMAGE",
        [*SCENE, "--materials", "materials.json", "--material", "ids.npy"],
    ),
    "no_room": (
        ["ideal.npy", "--exposure-gain", "auto", "--effect", "ambient_light:level_dn=2000"],
        "--exposure-gain auto finds no room: the code without light, 64, and ambient light of 2000 dn leave nothing",
        ["ideal.npy", "--exposure-gain", "auto", "--effect", "ambient_light:level_dn=900"],
    ),
    "too_dark": (
        ["tiny.npy", "--exposure-gain", "auto"],
        "scale it with --irradiance-scale",
        ["tiny.npy", "--exposure-gain", "auto", "--irradiance-scale", 1e38],
    ),
    "white_luminance": (
        ["white.exr"],
        "its whiteLuminance (100 cd/m^2) is ignored: 1 is full scale (--irradiance-scale)",
        ["whole.exr", "--irradiance-scale", 0.01, "--exposure-gain", "auto"],
    ),
    "several_kinds": (["mixed"], "say which, for example 'mixed/*.png'", ["mixed/*.png"]),
    "full_scale_of_nothing": (
        ["ideal.npy:full_scale=0"],
        "full_scale=0 is no number above 0",
        ["ideal.npy:full_scale=2"],
    ),
    "output_is_an_input": (
        ["ideal.npy", "-o", ".", "--format", "npy", "--no-preview", "--frames", 1],
        "",
        ["ideal.npy"],
    ),
}


@pytest.mark.parametrize("name", RENDER)
def test_render(cli, ok, scene: Path, name: str) -> None:
    ideal_and(scene)
    bad, advice, good = RENDER[name]
    told = cli("render", *bad, *([] if "-o" in bad else ["-o", "out"])).err
    assert advice in told, told
    told = ok("render", *good, "-o", "then").err
    assert not advice or advice not in told, told


def test_a_gain_that_was_chosen_can_be_repeated(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "ideal.npy", images.real())
    told = ok("render", "ideal.npy", "-o", "a", "--exposure-gain", "auto", "--format", "npy")
    repeat = re.search(r"repeat it with --exposure-gain (\S+)", told.out + told.err)
    assert repeat
    ok("render", "ideal.npy", "-o", "b", "--exposure-gain", repeat[1], "--format", "npy")
    frames = [np.load(tmp_path / folder / "frame_000000.npy") for folder in "ab"]
    np.testing.assert_array_equal(*frames)
    told = ok("render", "ideal.npy", "-o", "c", "--relative-diameter", 0.8).out
    assert "--oversampling integrates over the pixel" in told
    told = ok("render", "ideal.npy", "-o", "d", "--relative-diameter", 0.8, "--oversampling", 2).out
    assert "--oversampling integrates" not in told


def test_what_an_earlier_run_wrote(ok, refused, tmp_path: Path) -> None:
    np.save(tmp_path / "ideal.npy", images.real())
    ok("render", "ideal.npy", "-o", "out")
    advice = re.search(r"for example '(out/frame_\*\.png)'", refused("render", "out", "-o", "again"))
    assert advice
    ok("render", advice[1], "-o", "again")


CELL = ["--size", 96, "--pitch-um", 1]
DOTS = ["--dots", 60, "--min-difference", 0]
DESIGN = ["doe", "design", "list.json", "-o", "d", "--levels", 8]
LAYOUT = ["doe", "layout", *DOTS]
FIELD = ["-o", "l", "--field-of-view", "24,18"]
INSPECT = ["doe", "inspect", "cell.npy", "--texels", "96,64", "--beam-sigma-um", 60]
IMAGE = ["doe", "inspect", "cell.npy", "--texels", "96,64", "--beam-width-um", 2000, "--beam-image", "beam.npy"]
FIGURE = [*INSPECT, "-o", "figure.png"]
# As RENDER, of elements.
DOE: dict[str, tuple[list, str, list]] = {
    "mirror": ([*DESIGN, *CELL, "--levels", 2], "give --mirror", [*DESIGN, *CELL, "--levels", 2, "--mirror"]),
    "mirror_of_nothing": ([*DESIGN, *CELL, "--mirror"], "--mirror is given, but levels is 8", [*DESIGN, *CELL]),
    "size": (
        [*DESIGN, "--size", "0,96"],
        "a cell has at least one pixel along each axis",
        [*DESIGN, "--size", "96,96"],
    ),
    "period": ([*DESIGN, *CELL, "--period-um", 50], "or leave one out", [*DESIGN, *CELL]),
    "period_is_changed": (
        [*DESIGN, *CELL, "--period-um", 50],
        "change one of --period-um",
        [*DESIGN, *CELL, "--period-um", 96],
    ),
    "free": (
        [*LAYOUT, *FIELD, *CELL, "--free"],
        "no effect with --free, which knows no cell",
        [*LAYOUT, *FIELD, "--free"],
    ),
    "name": (
        [*LAYOUT, *CELL, *FIELD[2:], "-o", "./"],
        "a name is needed, for example ./dots",
        [*LAYOUT, *CELL, *FIELD[2:], "-o", "./dots"],
    ),
    "narrow_beam": (
        [*INSPECT, "--beam", "flat_circle", "--beam-width-um", 20],
        "or --evaluation aperture",
        [*INSPECT, "--beam", "flat_circle", "--beam-width-um", 20, "--evaluation", "aperture"],
    ),
    "beam_image": ([*INSPECT, "--beam", "image"], "--beam image needs --beam-image FILE", IMAGE),
    "beam_and_image": ([*IMAGE, "--beam", "flat_circle"], "no effect beside --beam-image; leave it out", IMAGE),
    "transfer": (
        [*INSPECT, "--transfer", "srgb"],
        "of the numbers of --beam-image; name that",
        [*IMAGE, "--transfer", "srgb"],
    ),
    "lines": (
        [*INSPECT, "--wavelength-nm", 940, "--line-power", "1,2"],
        "--line-power has 2 numbers, but --wavelength-nm has 1",
        [*INSPECT, "--wavelength-nm", "940,930", "--line-power", "1,2"],
    ),
    "beam_quality": (
        [*INSPECT, "--m-squared", 1.5, "--evaluation", "aperture"],
        "use --evaluation orders",
        [*INSPECT, "--m-squared", 1.5, "--evaluation", "orders"],
    ),
    "no_part": (
        [*FIGURE, "--zoom", "0,0,0"],
        "the half width must be above 0 and at most 1",
        [*FIGURE, "--zoom", "0,0,1"],
    ),
    "part_outside": ([*FIGURE, "--zoom", "5,5,0.1"], "lies outside of the pattern", [*FIGURE, "--zoom", "0.1,0,0.1"]),
    "part_of_nothing": ([*INSPECT, "--zoom", "0,0,0.1"], "drawn with -o FILE.png", [*FIGURE, "--zoom", "0,0,0.1"]),
    "ending": ([*INSPECT, "-o", "e.jpg"], "written as .png; choose a name that ends in it", [*INSPECT, "-o", "e.png"]),
}


def grating(folder: Path) -> None:
    np.save(folder / "cell.npy", np.tile(np.repeat(np.float32([0, np.pi]), 8), (16, 1)))
    (folder / "cell.json").write_text('{"pixel_pitch_m": 1.5e-6, "wavelength_m": 940e-9, "levels": 2}')
    (folder / "list.json").write_text('{"orders": [[1, 2], [5, -3]]}')
    np.save(folder / "beam.npy", images.real())


@pytest.mark.parametrize("name", DOE)
def test_doe(ok, refused, tmp_path: Path, name: str) -> None:
    grating(tmp_path)
    bad, advice, good = DOE[name]
    assert advice in refused(*bad)
    ok(*good)


def test_a_pattern_is_looked_up_as_it_says(ok, scene: Path) -> None:
    grating(scene)
    said = ok("doe", "pattern", *INSPECT[2:], "-o", "made.npy").out
    told = re.search(r"Look it up with: clspeckle (render SCENE -o FOLDER --pattern made.npy .*)", said)
    assert told
    words = told[1].replace("SCENE", " ".join(map(str, SURFACE))).replace("FOLDER", "looked").split()
    assert "no light" not in ok(*words, *LASER, "--exposure-gain", "auto").err


def test_outputs_of_a_diagnosis(ok, refused, tmp_path: Path) -> None:
    ok(*DARK)
    quick = ["diagnose", "drawn", "--replicates", 12, "--max-effects", 1]
    for bad, advice in (
        (["--json", "r.json", "--html", "r.json"], "--json and --html name the same file; give each its own"),
        (["--html", "-"], "for example --html report.html"),
        (["--profile", "-"], "for example --profile camera.json"),
        (["--profile", "r.json", "--emva", "r.json"], "another option names the same file; give each its own"),
        (["--profile", "r.json", "--json", "r.dark.npy"], "give each file a name of its own"),
        (["--without", "gamma,"], "one of the names is empty; the effects are "),
        (["--without", "defokus"], 'the nearest one is "defocus"'),
        (["--window", "9"], "for example --window 480,300,320,200"),
    ):
        assert advice in refused(*quick, *bad)
    outputs = ["--json", "r.json", "--html", "report.html", "--profile", "camera.json", "--emva", "e.xml"]
    said = ok(*quick, *outputs, "--without", "gamma,defocus", "--window", "0,0,32,24").out
    profile = re.search(r"Camera profile, for render --profile: (\S+)", said)
    assert profile
    np.save(tmp_path / "ideal.npy", images.real()[:24, :32])
    ok("render", "ideal.npy", "-o", "rendered", "--profile", profile[1])


MAKE = ["capture", "make", "drawn", "--width", 32, "--height", 24, "--frames", 2, "--sequences"]
DARK = [*MAKE, "dark"]
CAPTURE: dict[str, tuple[list, str, list]] = {
    "pitch": (
        [*MAKE, "dots_static", "--dots-count", 10000],
        "(--dots-pitch, --dots-count)",
        [*MAKE, "dots_static", "--dots-count", 12],
    ),
    "names": ([*MAKE, "nothing"], "the sequences are dark, flat,", DARK),
    "none": (
        [*MAKE, ""],
        "for example --sequences dark,board_static,board_moving",
        [*MAKE, "dark,board_static,board_moving"],
    ),
    "pupil": (
        [*MAKE, "board_static", "--f-number", 0.5],
        "can be drawn, use a larger one",
        [*MAKE, "board_static", "--f-number", 4],
    ),
    "twice": (
        [*DARK, "--effect", "defocus", "--effect", "defocus"],
        "a set has one strength of each",
        [*DARK, "--effect", "defocus"],
    ),
    "dots_alone": (
        [*MAKE, "board_static", "--effect", "ghost_dots"],
        "add dots_static or dots_moving",
        [*MAKE, "dots_static", "--effect", "ghost_dots"],
    ),
}


@pytest.mark.parametrize("name", CAPTURE)
def test_capture_make(refused, ok, name: str) -> None:
    bad, advice, good = CAPTURE[name]
    assert advice in refused(*bad)
    ok(*good)


def test_capture_files_that_exist(ok, refused, tmp_path: Path) -> None:
    ok(*DARK)
    assert "or replace a capture set with --overwrite" in refused(*DARK)
    ok(*DARK, "--overwrite")
    assert "replace it with --force" in refused("capture", "init", "drawn")
    ok("capture", "init", "drawn", "--force")
    codes = np.load(tmp_path / "drawn" / "dark.npy")
    (tmp_path / "bright").mkdir()
    np.save(tmp_path / "bright" / "dark.npy", codes + np.uint16(500))
    assert "leave the option out, or give more" in refused("capture", "init", "bright", "--bits", 8)
    ok("capture", "init", "bright", "--bits", 12)
    one = tmp_path / "one"
    one.mkdir()
    np.save(one / "board.npy", codes[:1])
    message = refused("capture", "init", "one")
    assert "(--read-noise-dn)" in message
    ok("capture", "init", "one", "--read-noise-dn", 4)


def test_a_stack_among_frames(ok, refused, tmp_path: Path) -> None:
    ok(*DARK)
    folder = tmp_path / "drawn"
    (folder / "f.npy").write_bytes((folder / "dark.npy").read_bytes())
    capture = json.loads((folder / "capture.json").read_text())

    def named(file: str) -> None:
        capture["sequences"][0]["file"] = file
        (folder / "capture.json").write_text(json.dumps(capture))

    named("f*.npy")
    assert "or name the .npy stack itself" in refused("capture", "check", "drawn")
    named("f.npy")
    ok("capture", "check", "drawn")
    named("missing.npy")
    assert "correct the name, or take the sequence out" in refused("capture", "check", "drawn")
    (folder / "missing.npy").write_text("no array")
    assert "numpy.save(file, codes.astype(numpy.uint16)) writes a stack" in refused("capture", "check", "drawn")
    np.save(folder / "missing.npy", np.load(folder / "dark.npy").astype(np.uint16))
    ok("capture", "check", "drawn")


def test_statistics(ok, refused, tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", images.gray8())
    np.save(tmp_path / "two.npy", np.stack([images.gray8()] * 2))
    assert "--temporal needs two frames or more: a stack, or several files" in refused(
        "statistics", "one.npy", "--temporal"
    )
    ok("statistics", "two.npy", "--temporal")
    np.save(tmp_path / "other.npy", images.gray8()[1:])
    assert "--temporal needs frames of one size" in refused("statistics", "one.npy", "other.npy", "--temporal")
    ok("statistics", "one.npy", "one.npy", "--temporal")
    assert "the width and the height must be above 0" in refused("statistics", "one.npy", "--region", "0,0,0,4")
    ok("statistics", "one.npy", "--region", "0,0,4,4")


def test_outputs(ok, refused, tmp_path: Path) -> None:
    ok(*DARK)
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name, advice in (("folder", "is a folder; name a file"), ("pipe", "name a regular file")):
        assert advice in refused("capture", "check", "drawn", "--json", name, code=3)
    ok("capture", "check", "drawn", "--json", "file.json")
    np.save(tmp_path / "frame_000000.npy", images.real())
    given = ["render", "frame_000000.npy", "--format", "npy", "--no-preview"]
    assert "choose another --output" in refused(*given, "-o", ".")
    ok(*given, "-o", "out")


def written(folder: Path, capture: dict) -> None:
    (folder / "capture.json").write_text(json.dumps(capture))


def test_descriptions(ok, refused, tmp_path: Path) -> None:
    ok(*DARK)
    folder = tmp_path / "drawn"
    text = (folder / "capture.json").read_text()
    assert "the path of the capture set is empty; name its folder" in refused("capture", "check", "")
    ok("capture", "check", "drawn")
    (folder / "capture.json").write_bytes(text.replace('"dark"', '"d\xe4rk"', 1).encode("latin-1"))
    assert "the file is no text in UTF-8: save it in that encoding" in refused("capture", "check", "drawn")
    (folder / "capture.json").write_text(text, encoding="utf-8")
    ok("capture", "check", "drawn")
    assert "name the folder that holds the frames: " in refused("capture", "init", "nowhere")
    ok("capture", "init", "drawn", "--force")
    # Floating point, in a folder that is described anew.
    codes = np.load(folder / "dark.npy")
    np.save(folder / "flat.npy", codes.astype(np.float32))
    assert "save codes.astype(numpy.uint16)" in refused("capture", "init", "drawn", "--force")
    np.save(folder / "flat.npy", codes)
    ok("capture", "init", "drawn", "--force")
    np.save(folder / "flat.npy", (codes // 4).astype(np.uint8))
    assert "has 8-bit samples, which hold codes of 8 bits only" in refused(
        "capture", "init", "drawn", "--force", "--bits", 12
    )
    np.save(folder / "flat.npy", codes)
    ok("capture", "init", "drawn", "--force", "--bits", 12)
    np.save(folder / "dots.npy", codes)
    assert "or name a file with the projector's dots (--dots)" in refused("capture", "init", "drawn", "--force")
    (tmp_path / "dots.json").write_text('{"sigma_px": 2, "positions_px": [[10, 8]]}')
    ok("capture", "init", "drawn", "--force", "--dots", "dots.json")


def test_white_that_was_only_marked(ok, tmp_path: Path) -> None:
    ok(*DARK)
    folder = tmp_path / "drawn"
    codes = np.load(folder / "dark.npy")
    capture = json.loads((folder / "capture.json").read_text())
    capture["sequences"][0]["file"] = "dark.tif"
    written(folder, capture)
    advice = "Save the frames as min-is-black"
    for photometric in ("miniswhite", "minisblack"):
        tifffile.imwrite(folder / "dark.tif", codes, photometric=photometric)
        told = ok("capture", "check", "drawn").err
        assert (advice in told) == (photometric == "miniswhite")


def test_a_gap_of_two_sets(ok, refused, tmp_path: Path) -> None:
    """Sets that cannot be compared, and what the messages want of them."""

    def make(name: str, *more: object) -> None:
        ok("capture", "make", name, "--width", 48, "--height", 32, "--frames", 4, "--sequences", *more)

    make("real", "dark,board_moving")
    make("small", "dark,board_moving", "--width", 32)
    make("bits", "dark,board_moving", "--bits", 12)
    make("other", "flat")
    compare = ["gap", "compare", "real"]
    assert "render or crop to the same size" in refused(*compare, "small")
    assert "let the simulator write the camera's codes, or correct camera.bits" in refused(*compare, "bits")
    assert "render the same scenes (dark, flat, board, dots; static or moving)" in refused(*compare, "other")
    make("same", "dark,board_moving", "--seed", 9)
    ok(*compare, "same")


def test_names_that_no_json_can_hold(ok, refused, tmp_path: Path) -> None:
    """Before a frame is made: config.json and capture.json name files."""
    codes = np.random.default_rng(1).integers(60, 80, (4, 24, 32), np.uint16)
    (tmp_path / "set").mkdir()
    odd = os.fsdecode(b"gain\xff.npy")
    np.save(tmp_path / odd, np.ones((images.HEIGHT, images.WIDTH), np.float32))
    np.save(tmp_path / "ideal.npy", images.real())
    np.save(tmp_path / "set" / os.fsdecode(b"dark\xff.npy"), codes)
    render = ["render", "ideal.npy", "-o", "out", "--no-preview", "--exposure-gain", 100, "--gain-map"]
    said = refused(*render, odd)
    assert "/sensor/gain_map would be" in said and "no text in UTF-8, as JSON must be: rename that file" in said
    assert not (tmp_path / "out").exists()
    assert "rename that file" in refused(*render, odd, "--dump-config")
    assert "/sequences/0/" in refused("capture", "init", "set")
    assert not (tmp_path / "set" / "capture.json").exists()
    (tmp_path / odd).rename(tmp_path / "gain.npy")
    (tmp_path / "set" / os.fsdecode(b"dark\xff.npy")).rename(tmp_path / "set" / "dark.npy")
    ok(*render, "gain.npy")
    ok("capture", "init", "set")


def test_effects_that_render_has_not(refused, ok, tmp_path: Path) -> None:
    np.save(tmp_path / "ideal.npy", images.real())
    message = refused("render", "ideal.npy", "-o", "out", "--effect", "ghost_dots")
    assert "changes the dots that the library draws" in message
    ok(*MAKE, "dots_static", "--effect", "ghost_dots")


def test_files_of_a_configuration(ok, refused, scene: Path) -> None:
    """Relative to its folder, with a channel; config.json of a run renders the same from elsewhere."""
    dots = iio.imread(scene / "dots.png").astype(np.float32) / 65535
    (scene / "deep").mkdir()
    images.exr(scene / "deep" / "dots.exr", {"IR": dots, "other": dots * 0})
    (scene / "deep" / "mine.json").write_text(json.dumps({"pattern": {"image": "dots.exr:IR"}}))
    surface = [*SURFACE, *PATTERN[2:], *LASER, "--exposure-gain", 30000, "--format", "npy"]
    ok("render", *surface, "--pattern", "dots.png", "-o", "expected")
    ok("render", *surface, "--config", "deep/mine.json", "-o", "first")
    (scene / "elsewhere").mkdir()
    (scene / "first" / "config.json").rename(scene / "elsewhere" / "config.json")
    ok("render", "--depth", "z.npy", "--config", "elsewhere/config.json", "-o", "again")
    frames = [np.load(scene / name / "frame_000000.npy") for name in ("expected", "first", "again")]
    np.testing.assert_array_equal(frames[0], frames[1])
    np.testing.assert_array_equal(frames[0], frames[2])
    (scene / "deep" / "dots.exr").rename(scene / "deep" / "frame_000000.npy")  # the content decides
    message = refused("render", *surface, "--pattern", "deep/frame_000000.npy:IR", "-o", "deep", "--no-preview")
    assert "would overwrite the input" in message


def test_usage(ok, refused, tmp_path: Path) -> None:
    """What is said of a command line, and of one that does as it is told."""
    np.save(tmp_path / "ideal.npy", images.real())
    render = ["render", "ideal.npy", "--exposure-gain", 500]
    out = ["-o", "out", "--no-preview"]
    assert "name the folder for the frames with -o FOLDER" in refused(*render)
    ok(*DARK)
    assert "--json: is empty; name a file" in refused("capture", "check", "drawn", "--json", "")
    ok("capture", "check", "drawn", "--json", "set.json")
    both = ["--relative-diameter", 1, "--f-number", 8]
    assert "give either --relative-diameter, or --f-number, --pixel-pitch-m and" in refused(*render, *out, *both)
    ok(*render, *out, *both[:2])
    ok(*render, *out, *both[2:])
    for wrong, path in ((["rendr"], []), ([*render, "--nois"], ["render"]), ([*render, "-o"], ["render"])):
        assert f"(see {' '.join(['clspeckle', *path])} --help)" in refused(*wrong)
        assert "Usage:" in ok(*path, "--help").out
    said = refused(*render, *out, "--effect", "gama")
    assert 'there is no effect "gama"; the nearest one is "gamma" (see clspeckle effects)' in said
    listed = re.search(r"^ *(gamma)\b", ok("effects").out, re.MULTILINE)
    assert listed
    ok(*render, *out, "--effect", listed[1])
