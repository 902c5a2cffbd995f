"""clspeckle capture init: a first capture.json from frames. Sets of `capture make` and of NumPy tell what is true."""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import png
import pytest
import tifffile
from cli_images import pgm
from PIL import Image

LENS = ("--pixel-pitch-um", 2.9, "--f-number", 5.6, "--wavelength-nm", 940)
EMVA_CCD = Path(os.environ.get("CLSPECKLE_TEST_DATA", "none")) / "emva_ccd"


def described(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "capture.json").read_text())


def distances(a: list[list[float]], b: list[list[float]]) -> np.ndarray:
    """From each place of a to the nearest one of b."""
    return np.linalg.norm(np.array(a)[:, None] - np.array(b)[None], axis=-1).min(axis=1)


def dark(seed: int, bits: int = 10, frames: int = 4, shape: tuple[int, int] = (40, 48)) -> np.ndarray:
    """Level 64 and noise 4 of ten bits, of which a converter of so many bits has."""
    scale = 2.0 ** (bits - 10)
    return np.rint(np.random.default_rng(seed).normal(64 * scale, 4 * scale, (frames, *shape))).astype(np.uint16)


def test_a_set_comes_back(ok, tmp_path: Path) -> None:
    """128 frames in motion of dots with some seven grains each: places scatter by 0.035 px along each axis."""
    ok("capture", "make", "set", "--frames", 128, "--seed", 5, "--flat-level", "200,400")
    truth = described(tmp_path / "set")
    (tmp_path / "set" / "capture.json").unlink()
    said = ok("capture", "init", "set", *LENS).out
    made = described(tmp_path / "set")
    assert made["camera"]["bits"] == truth["camera"]["bits"]
    assert (made["camera"]["width"], made["camera"]["height"]) == (192, 160)
    assert made["camera"]["black_level_dn"] == pytest.approx(64, abs=0.5)
    assert made["camera"]["read_noise_dn"] == pytest.approx(4, rel=0.02)
    by_name = [{s["name"]: (s["scene"], s["motion"], s["file"]) for s in d["sequences"]} for d in (made, truth)]
    assert by_name[0] == by_name[1]
    assert made["laser"] == truth["laser"]
    places = made["dots"]["positions_px"], truth["dots"]["positions_px"]
    assert len(places[0]) == len(places[1]) == 120
    assert distances(*places).max() < 0.2
    assert made["dots"]["sigma_px"] == pytest.approx(2.2, rel=0.05), "what the lens adds to it is taken off"
    assert "/dots: 120 dots" in said and "--f-number" not in said
    summary = json.loads(ok("capture", "check", "set", "--json", "-").out)
    assert not [w for w in summary["warnings"] if "dots" in w["text"] or "bits" in w["text"]]


def test_the_diagnosis_runs_on_it(ok, tmp_path: Path) -> None:
    ok("capture", "make", "set", "--width", 96, "--height", 80, "--frames", 16, "--seed", 3)
    truth = (tmp_path / "set" / "capture.json").read_text()
    (tmp_path / "dots.json").write_text(truth)
    ok("capture", "init", "set", *LENS, "--force", "--dots", "dots.json", "--quiet")
    assert described(tmp_path / "set")["dots"] == json.loads(truth)["dots"]
    report = json.loads(ok("diagnose", "set", "--json", "-", "--replicates", 12, "--max-effects", 1).out)
    assert report["cause"]["verdict"] == "none"


def test_what_frames_do_not_tell_is_listed(ok, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    np.save(folder / "dark.npy", dark(1))
    rng = np.random.default_rng(2)
    np.save(folder / "Board.npy", np.rint(64 + rng.exponential(90, (4, 40, 48))).astype(np.uint16))
    np.save(folder / "board_rest.npy", np.rint(64 + rng.exponential(90, (1, 40, 48)).repeat(4, 0)).astype(np.uint16))
    np.save(folder / "led.npy", dark(3))
    (folder / "notes.txt").write_text("f/5.6")
    done = ok("capture", "init", "set")
    for field in ("/camera/bits: 10", "/camera/pixel_pitch_um", "--f-number", "--wavelength-nm",
                  "/laser/degree_of_polarization", "/sequences/1/motion: moving"):  # fmt: skip
        assert field in done.out, field
    assert "led.npy: is left out" in done.err and "notes.txt" not in done.err
    assert [(s["name"], s["motion"]) for s in described(folder)["sequences"]] == [
        ("dark", "static"), ("Board", "moving"), ("board_rest", "static")]  # fmt: skip
    assert "dots" not in described(folder)


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_bits_of_codes_in_16_bit_words(ok, tmp_path: Path, bits: int) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    codes = dark(1, bits)
    np.save(folder / "dark.npy", codes)
    bright = codes + (2**bits - 1 - codes.max())
    np.save(folder / "flat.npy", bright.astype(np.uint16))
    said = ok("capture", "init", "set").out
    assert described(folder)["camera"]["bits"] == bits
    assert "/camera/bits" not in said, "a code at the top leaves no doubt"
    scale = 2.0 ** (bits - 10)
    assert described(folder)["camera"]["black_level_dn"] == pytest.approx(64 * scale, abs=0.5 * scale)
    ok("capture", "check", "set")


def test_codes_in_the_upper_bits(ok, refused, tmp_path: Path) -> None:
    """12 bits in the upper ones of 16, the lower ones filled where it clips: levels are those of 12 bits."""
    folder = tmp_path / "set"
    folder.mkdir()
    np.save(folder / "dark.npy", dark(1, 12) << 4)
    flat = np.full((2, 40, 48), 2000 << 4, np.uint16)
    flat[0, 0, :2] = 4095 << 4, 65535
    np.save(folder / "flat.npy", flat)
    said = ok("capture", "init", "set").out
    assert "/camera/msb_aligned: true" in said and "multiples of 16: codes of 12 bits" in said
    camera = described(folder)["camera"]
    assert (camera["bits"], camera["msb_aligned"]) == (12, True)
    assert camera["black_level_dn"] == pytest.approx(256, abs=0.5)
    assert camera["read_noise_dn"] == pytest.approx(16, rel=0.05)
    summary = json.loads(ok("capture", "check", "set", "--json", "-").out)
    assert [s["maximum"] for s in summary["sequences"]] == [dark(1, 12).max(), 4095]
    ok("capture", "init", "set", "--force", "--bits", 14)
    assert described(folder)["camera"]["bits"] == 14
    np.save(folder / "dark.npy", (dark(1, 12) << 4) + 2)
    shown = refused("capture", "check", "set")
    assert "no multiple of 4, though /camera/msb_aligned says that codes of 14 bits" in shown
    text = (folder / "capture.json").read_text()
    (folder / "capture.json").write_text(text.replace('"msb_aligned": true', '"msb_aligned": 1'))
    assert "/camera/msb_aligned is 1; expected true" in refused("capture", "check", "set")


def test_frames_in_files_of_their_own(ok, tmp_path: Path) -> None:
    """Folders, numbered files and stacks; times and masks by their names; a format's own bits."""
    folder = tmp_path / "set"
    (folder / "flat_5ms").mkdir(parents=True)
    for i, frame in enumerate(dark(1, 12)):
        pgm(folder / f"dark_{i:03}.pgm", frame, 4095)
        pgm(folder / "flat_5ms" / f"{i}.pgm", frame + 1000, 4095)
        tifffile.imwrite(folder / f"flat_long{i + 8}.tif", frame + 2000)
    tifffile.imwrite(folder / "flat_long_0.5ms_7.tif", dark(2, 12) + 500, photometric="minisblack")
    with (folder / "flat_5ms_mask.png").open("wb") as stream:
        png.Writer(48, 40, greyscale=True, bitdepth=8).write(stream, np.full((40, 48), 255, np.uint8))
    ok("capture", "init", "set")
    entries = {s["name"]: s for s in described(folder)["sequences"]}
    assert {name: s["file"] for name, s in entries.items()} == {
        "dark": "dark_[0-9][0-9][0-9].pgm", "flat_5ms": "flat_5ms", "flat_long": "flat_long[0-9]*.tif",
        "flat_long_0.5ms_7": "flat_long_0.5ms_7.tif"}  # fmt: skip
    assert {name: s.get("exposure_ms") for name, s in entries.items()} == {
        "dark": None, "flat_5ms": 5, "flat_long": None, "flat_long_0.5ms_7": 0.5}  # fmt: skip
    assert entries["flat_5ms"]["mask"] == "flat_5ms_mask.png"
    summary = json.loads(ok("capture", "check", "set", "--json", "-").out)
    assert [s["frames"] for s in summary["sequences"]] == [4, 4, 4, 4]


def test_a_format_says_its_bits(ok, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    for i, frame in enumerate(dark(1)):
        pgm(folder / f"dark{i}.pgm", frame, 4095)
    assert "/camera/bits" not in ok("capture", "init", "set").out
    assert described(folder)["camera"]["bits"] == 12
    for i, frame in enumerate(dark(1)):
        pgm(folder / f"dark{i}.pgm", frame.astype(np.uint8), 255)
    ok("capture", "init", "set", "--force")
    assert described(folder)["camera"]["bits"] == 8


def test_without_dark_frames(ok, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    np.save(folder / "flat.npy", dark(1) + 400)
    said = ok("capture", "init", "set").out
    assert "/camera/black_level_dn: 0" in said and "/camera/read_noise_dn" in said and "flat" in said
    assert described(folder)["camera"]["read_noise_dn"] == pytest.approx(4, rel=0.05)
    np.save(folder / "dark.npy", np.maximum(dark(1).astype(int) - 64, 0).astype(np.uint16))
    assert "% of dark are clipped at 0" in ok("capture", "init", "set", "--force").out


def test_noise_that_frames_do_not_tell(ok, tmp_path: Path) -> None:
    """Lost by rounding, or cut off at 0: said to be not known, and the data sheet's is taken."""
    folder = tmp_path / "set"
    folder.mkdir()
    constant = np.full((4, 40, 48), 64, np.uint16)
    clipped = np.maximum(dark(1).astype(int) - 64, 0).astype(np.uint16)
    for codes, why in ((constant, "lost in the converter's rounding"), (clipped, "clipped at 0")):
        np.save(folder / "dark.npy", codes)
        said = " ".join(ok("capture", "init", "set", "--force").out.split())
        assert "/camera/read_noise_dn" in said and "not known" in said and why in said
        assert "(--read-noise-dn)" in said
        said = ok("capture", "init", "set", "--force", "--read-noise-dn", 0.25).out
        assert "not known" not in said and described(folder)["camera"]["read_noise_dn"] == 0.25


def test_one_frame_tells_no_noise(ok, refused, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    np.save(folder / "dark.npy", dark(1, frames=1))
    shown = refused("capture", "init", "set")
    assert "frames tell no read noise; record two dark frames" in shown and "--read-noise-dn" in shown
    assert [path.name for path in folder.iterdir()] == ["dark.npy"]
    ok("capture", "init", "set", "--read-noise-dn", 3.5)
    assert described(folder)["camera"]["read_noise_dn"] == 3.5
    ok("capture", "check", "set")


@pytest.mark.parametrize(
    ("name", "shape", "words"),
    [
        ("flat_1ms", (1, 1), "/camera/width is 1; expected 8 to 16384 pixels"),
        ("flat_1ms", (40, 7), "/camera/width is 7; expected 8 to 16384 pixels"),
        ("flat_0ms", (40, 48), "/sequences/1/exposure_ms is 0; expected a time above 0 ms"),
        ("flat_mask", (40, 48), "dark_mask.png"),
    ],
)
def test_what_the_check_refuses_is_not_written(
    refused, tmp_path: Path, name: str, shape: tuple[int, int], words: str
) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    np.save(folder / "dark.npy", dark(1, shape=shape))
    if name == "flat_mask":  # of another size
        with (folder / "dark_mask.png").open("wb") as stream:
            png.Writer(9, 9, greyscale=True, bitdepth=8).write(stream, np.full((9, 9), 255, np.uint8))
    else:
        np.save(folder / f"{name}.npy", dark(2, shape=shape))
    before = sorted(path.name for path in folder.iterdir())
    shown = refused("capture", "init", "set")
    assert words in shown
    assert "set/capture.json" in shown and ".part" not in shown
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_real_camera(ok, tmp_path: Path) -> None:
    if not EMVA_CCD.is_dir():
        pytest.skip(f"{EMVA_CCD} is not there")
    folder = tmp_path / "ccd"
    folder.mkdir()
    for path in EMVA_CCD.glob("*.npy"):
        (folder / path.name).symlink_to(path)
    ok("capture", "init", "ccd")
    made, truth = described(folder), described(EMVA_CCD)
    assert made["camera"]["bits"] == truth["camera"]["bits"] == 12
    assert made["camera"]["black_level_dn"] == pytest.approx(15.0, abs=0.5)
    assert made["camera"]["read_noise_dn"] == pytest.approx(3.07, rel=0.01)  # by the package emva1288
    assert {s["name"] for s in made["sequences"]} == {s["name"] for s in truth["sequences"]}


def test_bad_input(refused, ok, tmp_path: Path) -> None:
    assert "does not exist; name the folder that holds the frames" in refused("capture", "init", "nowhere")
    folder = tmp_path / "set"
    folder.mkdir()
    shown = refused("capture", "init", "set")
    assert "holds no frames whose scene is named" in shown and "begin with dark, flat, board or dots" in shown
    np.save(folder / "led.npy", dark(1))
    assert "There are: led.npy" in refused("capture", "init", "set")
    assert "is no folder" in refused("capture", "init", "set/led.npy")
    np.save(folder / "dark.npy", dark(1))
    np.save(folder / "flat.npy", dark(1, shape=(48, 40)))
    shown = refused("capture", "init", "set")
    assert "flat.npy: has 40 x 48 pixels, but set/dark.npy has 48 x 40" in shown and "cut the frames alike" in shown
    np.save(folder / "flat.npy", dark(1).astype(np.float32))
    assert "flat.npy: has samples of type float32; expected uint16" in refused("capture", "init", "set")
    np.save(folder / "flat.npy", dark(1).astype(np.uint8))
    np.save(folder / "dark.npy", dark(1) + 300)
    assert "flat.npy: has 8-bit samples, but codes reach" in refused("capture", "init", "set")
    (folder / "flat.npy").write_bytes((folder / "flat.npy").read_bytes()[:500])
    assert "flat.npy: " in refused("capture", "init", "set")
    (folder / "flat.npy").unlink()
    assert "--bits 8: codes reach" in refused("capture", "init", "set", "--bits", 8)
    (folder / "dark").mkdir()
    assert "dark: holds no PNG, TIFF, PNM, BMP, TGA or raw frames" in refused("capture", "init", "set")
    shutil.copy(folder / "dark.npy", folder / "dark" / "x.npy")
    assert 'would both be the sequence "dark"; rename or move one' in refused("capture", "init", "set")
    pgm(folder / "dark" / "1.pgm", dark(1)[0], 1023)
    assert "files of several kinds (.npy, .pgm)" in refused("capture", "init", "set")
    shutil.rmtree(folder / "dark")
    np.save(folder / "dots.npy", dark(1) + 300)
    shown = refused("capture", "init", "set")
    assert "dots: no dots stand out of the noise of 4 frames" in shown and "--dots" in shown
    (folder / "dots.npy").unlink()
    for option, value, expected in (
        ("--f-number", 0, "0.1 to 1000"),
        ("--bits", 17, "8 to 16"),
        ("--wavelength-nm", "red", "100 to 20000"),
    ):
        assert expected in refused("capture", "init", "set", option, value)
    ok("capture", "init", "set")
    before = (folder / "capture.json").read_bytes()
    assert "exists, and may have been edited; replace it with --force" in refused("capture", "init", "set")
    assert (folder / "capture.json").read_bytes() == before
    ok("capture", "init", "set", "--force", "--f-number", 8)
    assert described(folder)["camera"]["f_number"] == 8


def flat(seed: int, frames: int = 4) -> np.ndarray:
    return np.rint(np.random.default_rng(seed).normal(600, 20, (frames, 40, 48))).astype(np.uint16)


def test_swapped_bytes_are_told_and_the_advice_leads_to_a_clean_set(ok, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    arrays = {"dark": dark(1), "flat": flat(2)}
    for name, codes in arrays.items():
        np.save(folder / f"{name}.npy", codes.byteswap())
    told = ok("capture", "init", "set", *LENS).err
    assert told.count("look as if their bytes were swapped") == 1
    assert "dark, flat: the codes look as if" in told
    assert "save codes.byteswap(), and write capture.json again with --force" in told
    assert described(folder)["camera"]["black_level_dn"] > 1023
    told = ok("capture", "check", "set").err
    assert told.count("look as if their bytes were swapped") == 1
    assert "what `clspeckle capture init` found in them it finds again with --force" in told
    for name in arrays:
        np.save(folder / f"{name}.npy", np.load(folder / f"{name}.npy").byteswap())
    assert ok("capture", "init", "set", "--force", *LENS).err == ""
    assert described(folder)["camera"]["bits"] == 10
    assert described(folder)["camera"]["black_level_dn"] == pytest.approx(64, abs=0.5)
    assert ok("capture", "check", "set", "--json", "-").json()["warnings"] == []


def test_white_that_is_zero_is_told_as_the_check_tells_it(ok, refused, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    np.save(folder / "dark.npy", dark(1))
    tifffile.imwrite(folder / "flat.tif", 65535 - flat(2), photometric="miniswhite")
    words = "its photometric interpretation says that 0 is white: a code is 65535 minus the number that is stored"
    assert words in ok("capture", "init", "set", *LENS).err
    assert words in ok("capture", "check", "set").err
    tifffile.imwrite(folder / "flat.tif", flat(2), photometric="miniswhite")
    assert words in refused("capture", "init", "set", "--force", "--bits", 10)
    told = ok("capture", "init", "set", "--force", *LENS).err
    assert "If it is only marked so, save the frames as min-is-black" in told
    tifffile.imwrite(folder / "flat.tif", tifffile.imread(folder / "flat.tif"), photometric="minisblack")
    assert ok("capture", "init", "set", "--force", *LENS).err == ""
    assert described(folder)["camera"]["bits"] == 10


@pytest.mark.parametrize(
    ("name", "cause", "way_out"),
    [
        ("flat.jpg", "is of the format JPEG", "raw frames, PNG, TIFF or PGM, which keep them"),
        ("flat.gif", "is a file of the format GIF, which is not read", "convert it to PNG, TIFF or NPY"),
        ("flat.webp", "is a file of the format WebP, which is not read", "convert it to PNG, TIFF or NPY"),
        ("flat.npz", "is an NPZ archive of arrays", 'numpy.save("codes.npy", numpy.load("set/flat.npz")["codes"])'),
        ("flat.dat", "is of the format PNG", "give it the ending .png"),
    ],
)
@pytest.mark.parametrize("place", ["beside", "alone", "folder"])
def test_files_that_are_no_frames_say_why(
    ok, refused, tmp_path: Path, name: str, cause: str, way_out: str, place: str
) -> None:
    folder = tmp_path / "set"
    inner = folder / "flat" if place == "folder" else folder
    inner.mkdir(parents=True)
    image = Image.fromarray((flat(2)[0] >> 2).astype(np.uint8))
    if name.endswith(".npz"):
        np.savez(inner / name, codes=flat(2))
    else:
        image.save(inner / name, "PNG" if name.endswith(".dat") else None)
    for ending, text in ((".txt", "no image, and no word of it"), (".csv", "1,2,3\n"), (".html", "<!DOCTYPE html>")):
        (inner / f"flat notes{ending}").write_text(text)
    if place != "alone":
        np.save(folder / "dark.npy", dark(1))
    told = ok("capture", "init", "set").err if place == "beside" else refused("capture", "init", "set")
    assert (
        cause in told
        and way_out.replace("set/", f"{inner.relative_to(tmp_path)}/") in told
        and f"{inner.name}/{name}" in told
    )
    assert not re.search(r"notes\.(txt|csv|html)(: | is )", told)
    if place == "folder":
        (folder / "dark.npy").rename(folder / "dark_other.npy")
        Image.fromarray((dark(1)[0]).astype(np.uint8)).save(folder / "dark.png")
        capture = {"format": "clspeckle-capture", "version": 1, "laser": {"wavelength_nm": 940}}
        capture["camera"] = {
            "width": 48,
            "height": 40,
            "bits": 8,
            "pixel_pitch_um": 3,
            "f_number": 4,
            "black_level_dn": 9,
            "read_noise_dn": 1,
        }
        capture["sequences"] = [{"name": "flat", "scene": "flat", "file": "flat"}]
        (folder / "capture.json").write_text(json.dumps(capture))
        assert cause in refused("capture", "check", "set"), "the check says the same"


def test_channels_and_types_have_the_way_out_that_the_check_has(ok, refused, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    np.save(folder / "dark.npy", dark(1))
    for array, advice in (
        (np.stack([flat(2)] * 4, -1), r"save (array\[\.\.\., 0\])"),
        (np.moveaxis(flat(2), 0, -1), r"If the 4 are frames, save (numpy\.moveaxis\(array, -1, 0\))"),
        (flat(2).astype(np.float64), r"save (codes\.astype\(numpy\.uint16\))"),
        (flat(2).astype(np.int32), r"save (codes\.astype\(numpy\.uint16\))"),
    ):
        np.save(folder / "flat.npy", array)
        found = re.search(advice, refused("capture", "init", "set"))
        assert found
        np.save(folder / "flat.npy", eval(found[1], {"array": array, "codes": array, "numpy": np}))
        ok("capture", "init", "set", "--force")
        assert described(folder)["sequences"][1]["scene"] == "flat"
        (folder / "capture.json").unlink()
    Image.fromarray((flat(2)[0] >> 2).astype(np.uint8)).save(folder / "flat.tif", compression="jpeg")
    (folder / "flat.npy").unlink()
    assert "raw, PNG, or TIFF with deflate or LZW" in refused("capture", "init", "set")


@pytest.mark.parametrize("lower", [64, 128, 255])
def test_codes_of_8_bits_in_the_middle_of_256_are_no_aligned_ones(ok, tmp_path: Path, lower: int) -> None:
    """The formula of the check is of the words in the files, whatever `capture init` wrote."""
    folder = tmp_path / "set"
    folder.mkdir()
    codes = {"dark": dark(1, bits=8, frames=16), "flat": np.minimum(4 * dark(2, bits=8, frames=16), 254)}
    for name, values in codes.items():
        np.save(folder / f"{name}.npy", (values * 256 + lower).astype(np.uint16))
    ok("capture", "init", "set")
    assert "msb_aligned" not in described(folder)["camera"]
    told = ok("capture", "check", "set").err
    advice = re.search(r"take it back: (numpy\.rint\(.*\)\.astype\(numpy\.uint16\)), bits 8,", told)
    assert advice
    for name, values in codes.items():
        given = np.load(folder / f"{name}.npy")
        np.testing.assert_array_equal(eval(advice[1], {"codes": given, "numpy": np}), values)


LAST_AXIS = {
    "pages": {"photometric": "minisblack"},
    "one directory": {"photometric": "minisblack", "planarconfig": "contig"},
    "planes": {"photometric": "minisblack", "planarconfig": "separate"},
    "ImageJ": {"imagej": True},
}


@pytest.mark.parametrize("name", LAST_AXIS)
def test_tiff_files_of_height_width_and_frames(ok, refused, tmp_path: Path, monkeypatch, name: str) -> None:
    """Writers take the last side for the width, or for channels."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "set"
    folder.mkdir()
    frames = np.concatenate([dark(seed) for seed in range(3)])
    height, width = frames.shape[1:]
    assert len(frames) > 4 and width > 2 * len(frames) and height > len(frames)
    array = frames if name == "planes" else np.ascontiguousarray(np.moveaxis(frames, 0, -1))
    tifffile.imwrite(folder / "dark.tif", array, **LAST_AXIS[name])
    arguments = ("capture", "init", "set", "--force")
    told = ok(*arguments).err if name in ("pages", "ImageJ") else refused(*arguments)
    assert (f"taken as {height} frames, {width} pixels high" in told) == (name in ("pages", "ImageJ"))
    advice = re.search(r"save (tifffile\.imwrite\(.*, photometric=\"minisblack\"\))", told)
    assert advice
    before = (folder / "dark.tif").read_bytes()
    exec(advice[1], {"numpy": np, "tifffile": tifffile})
    assert (folder / "dark.tif").read_bytes() == before, "the original stays"
    (folder / "dark.tif").rename(tmp_path / "original.tif")
    assert "warning" not in ok(*arguments).err.replace("notes", "")
    made = described(folder)
    assert (made["camera"]["width"], made["camera"]["height"]) == (width, height)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 7])
def test_few_frames_behind_height_and_width(ok, refused, tmp_path: Path, monkeypatch, count: int) -> None:
    """Too narrow for a set."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "set").mkdir()
    frames = np.resize(dark(1), (count, *dark(1).shape[1:]))
    tifffile.imwrite("set/dark.tif", np.ascontiguousarray(np.moveaxis(frames, 0, -1)), photometric="minisblack")
    told = refused("capture", "init", "set")
    assert f"/camera/width is {count}" in told
    advice = re.search(r"save (tifffile\.imwrite\(.*, photometric=\"minisblack\"\))", told)
    assert advice
    exec(advice[1], {"numpy": np, "tifffile": tifffile})
    (tmp_path / "set" / "dark.tif").rename(tmp_path / "original.tif")
    assert "warning" not in ok("capture", "init", "set").err
    np.testing.assert_array_equal(tifffile.imread("set/dark_frames.tif"), frames)


def test_a_folder_that_cannot_be_written(refused, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    (folder / "capture.json").mkdir(parents=True)
    np.save(folder / "dark.npy", dark(1))
    assert "capture.json: is a folder; name a file" in refused("capture", "init", "set", "--force", code=3)
    (folder / "capture.json").rmdir()
    if os.geteuid() == 0:
        return  # who may write everywhere
    folder.chmod(0o500)
    assert "cannot be written" in refused("capture", "init", "set", code=3)
