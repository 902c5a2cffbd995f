"""clspeckle.Capture, and the reader against files that other programs wrote."""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle
from clspeckle import errors

PRACTICE = Path(os.environ.get("CLSPECKLE_TEST_DATA", "none")) / "practice"
Draw = Callable[..., npt.NDArray[np.uint16]]
DOTS = [[4.0, 5.0], [15.5, 9.25]]


def png(image: npt.NDArray[Any]) -> bytes:
    """A gray PNG by the specification alone."""
    depth = 8 * image.dtype.itemsize
    rows = b"".join(b"\0" + row.astype(f">u{image.dtype.itemsize}").tobytes() for row in image)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", image.shape[1], image.shape[0], depth, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def tiff(image: npt.NDArray[np.uint16]) -> bytes:
    """A gray 16-bit TIFF of one strip by the specification alone."""
    data = image.astype("<u2").tobytes()
    entries = [
        (256, 3, image.shape[1]), (257, 3, image.shape[0]), (258, 3, 16), (259, 3, 1), (262, 3, 1), (273, 4, 8),
        (277, 3, 1), (278, 3, image.shape[0]), (279, 4, len(data)),
    ]  # fmt: skip
    directory = struct.pack("<H", len(entries))
    directory += b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in entries)
    return b"II" + struct.pack("<HI", 42, 8 + len(data)) + data + directory + struct.pack("<I", 0)


def describe(folder: Path, sequences: list[dict[str, Any]], **changes: Any) -> None:
    camera = {"width": 24, "height": 16, "bits": 10, "pixel_pitch_um": 2.9, "f_number": 5.6, "black_level_dn": 64.0,
              "read_noise_dn": 4.0}  # fmt: skip
    root = {"format": "clspeckle-capture", "version": 1, "camera": {**camera, **changes.pop("camera", {})},
            "laser": {"wavelength_nm": 940.0}, "sequences": sequences, **changes}  # fmt: skip
    folder.mkdir(exist_ok=True)
    (folder / "capture.json").write_text(json.dumps(root))


def test_arrays_come_back_and_survive_a_folder(codes: Draw, tmp_path: Path) -> None:
    mask = np.ones((16, 24), bool)
    mask[3, 4] = False
    arrays = {
        "dark": codes(4, 64),
        "flat_2": clspeckle.CaptureSequence(codes(3, 500, 1), "flat", exposure_ms=7.5, mask=mask),
        "board_static": codes(2, 200, 2),
        "slow": clspeckle.CaptureSequence(codes(2, 200, 3), "dots", "moving", f_number=8.0),
    }
    camera = {"bits": 10, "f_number": 4.0, "read_noise_dn": 3.5, "principal_point_px": (10.0, 7.0)}
    made = clspeckle.Capture.from_arrays(arrays, camera=camera, dots_px=DOTS, dots_sigma_px=2.2)
    made.write(tmp_path / "set")
    read = clspeckle.Capture.open(tmp_path / "set")
    for capture in (made, read):
        assert capture.shape == (16, 24)
        assert capture.camera["principal_point_px"] == (10.0, 7.0)
        assert capture.camera["f_number"] == 4.0
        np.testing.assert_allclose(capture.camera["pixel_pitch_m"], 2.9e-6, rtol=1e-12)
        assert capture.dots_px.tolist() == DOTS and capture.dots_sigma_px == 2.2
        back = capture.sequences
        assert list(back) == list(arrays)
        for name, given in arrays.items():
            expected = given.codes if isinstance(given, clspeckle.CaptureSequence) else given
            assert np.array_equal(back[name].codes, expected)
        assert (back["slow"].scene, back["slow"].motion, back["slow"].f_number) == ("dots", "moving", 8.0)
        assert (back["flat_2"].scene, back["flat_2"].exposure_ms) == ("flat", 7.5)
        assert np.array_equal(np.asarray(back["flat_2"].mask) != 0, mask)
        assert back["dark"].mask is None
    assert np.array_equal(np.load(tmp_path / "set" / "dark.npy"), arrays["dark"])


def test_numbers_of_the_summary(codes: Draw) -> None:
    """Against NumPy in float64."""
    mask = np.ones((16, 24), np.uint8)
    mask[:, :5] = 0
    dark, board = codes(6, 64), codes(5, 300, 1)
    board[:, 0, 10:13] = 1023
    sequence = clspeckle.CaptureSequence(board, "board", "static", mask=mask)
    capture = clspeckle.Capture.from_arrays({"dark": dark, "board": sequence})
    summary = capture.summary()
    first, second = summary["sequences"]
    seen = board[:, mask != 0].astype(np.float64)
    np.testing.assert_allclose(first["mean_dn"], dark.mean(), rtol=1e-12)
    np.testing.assert_allclose(second["mean_dn"], seen.mean(), rtol=1e-12)
    np.testing.assert_allclose(second["level_above_dark_dn"], seen.mean() - dark.mean(), rtol=1e-12)
    np.testing.assert_allclose(second["temporal_noise_dn"], np.sqrt(seen.var(axis=0, ddof=1).mean()), rtol=1e-9)
    np.testing.assert_allclose(second["saturated_fraction"], (seen == 1023).mean(), rtol=1e-12)
    contrast = np.sqrt(seen.var(axis=1).mean()) / (seen.mean() - dark.mean())
    np.testing.assert_allclose(second["contrast"], contrast, rtol=1e-9)
    np.testing.assert_allclose(second["masked_fraction"], 5 / 24, rtol=1e-12)
    assert summary["dark_level"] == {"level_dn": pytest.approx(dark.mean()), "measured": True}


def test_folders_globs_and_single_files(codes: Draw, tmp_path: Path) -> None:
    """Natural order: frame2 before frame10."""
    folder = tmp_path / "with [brackets]"
    folder.mkdir()
    stack = codes(11, 200)
    for kind, write in (("png", png), ("tif", tiff)):
        (folder / kind).mkdir()
        for index, frame in enumerate(stack):
            (folder / kind / f"frame{index}.{kind}").write_bytes(write(frame))
    (folder / "one.png").write_bytes(png(stack[3]))
    np.save(folder / "big_endian.npy", stack.astype(">u2"))
    np.save(folder / "fortran.npy", np.asfortranarray(stack))
    (folder / "mask.png").write_bytes(png(np.full((16, 24), 255, np.uint8)))
    names = {
        "png": "png",
        "glob": "png/*.png",
        "tif": "tif",
        "one": "one.png",
        "be": "big_endian.npy",
        "f": "fortran.npy",
    }
    entries = [{"name": n, "file": f, "scene": "flat", "mask": "mask.png"} for n, f in names.items()]
    describe(folder, entries)
    read = clspeckle.Capture.open(folder).sequences
    for name in names:
        expected = stack[3:4] if name == "one" else stack
        assert np.array_equal(read[name].codes, expected), name


def test_messages_name_the_frame_of_the_sequence(codes: Draw, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    (folder / "flat").mkdir(parents=True)
    stack = codes(3, 200)
    stack[2, 5, 7] = 1500
    for index, frame in enumerate(stack):
        (folder / "flat" / f"f{index}.png").write_bytes(png(frame))
    describe(folder, [{"name": "flat", "file": "flat", "scene": "flat"}])
    with pytest.raises(
        errors.InvalidDataError, match=r"f2\.png: frame 2 of the sequence, pixel \(7, 5\): the code is 1500"
    ):
        clspeckle.Capture.open(folder)
    np.save(folder / "real.npy", np.full((2, 16, 24), np.nan, np.float32))
    describe(folder, [{"name": "flat", "file": "real.npy", "scene": "flat"}])
    with pytest.raises(
        errors.InvalidDataError, match=r"real\.npy: .*type float32; expected uint16: codes are whole.*NaN"
    ):
        clspeckle.Capture.open(folder)


def test_eight_bit_frames(codes: Draw, tmp_path: Path) -> None:
    frame = (codes(1, 200)[0] // 4).astype(np.uint8)
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "a.png").write_bytes(png(frame))
    entries = [{"name": "flat", "file": "a.png", "scene": "flat"}]
    describe(folder, entries, camera={"bits": 8, "black_level_dn": 16.0})
    assert np.array_equal(clspeckle.Capture.open(folder).sequences["flat"].codes, frame[np.newaxis])
    describe(folder, entries)
    with pytest.raises(
        errors.InvalidDataError, match=r"a\.png: has samples of type uint8; expected uint16 for codes of 10 bits"
    ):
        clspeckle.Capture.open(folder)
    np.save(folder / "b.npy", np.full((2, 16, 24), 256, np.uint16))
    describe(folder, [{"name": "flat", "file": "b.npy", "scene": "flat"}], camera={"bits": 8, "black_level_dn": 16.0})
    with pytest.raises(errors.InvalidDataError, match=r"b\.npy: frame 0, pixel \(0, 0\): the code is 256.*bits is 8"):
        clspeckle.Capture.open(folder)


def test_unknown_keys_and_a_missing_laser_are_warned_of(codes: Draw, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    describe(folder, [{"name": "dark", "file": "dark.npy", "scene": "dark", "gain_db": 6}], operator="me")
    root = json.loads((folder / "capture.json").read_text())
    del root["laser"]
    (folder / "capture.json").write_text(json.dumps(root))
    np.save(folder / "dark.npy", codes(4, 64))
    texts = [warning["text"] for warning in clspeckle.Capture.open(folder).summary()["warnings"]]
    assert any("/sequences/0/gain_db" in text for text in texts)
    assert any("/operator" in text for text in texts)
    assert any("940 nm is assumed" in text for text in texts)


def topics(capture: clspeckle.Capture) -> dict[str, bool]:
    return {ability["topic"]: ability["can"] for ability in capture.summary()["abilities"]}


def test_what_a_set_can_tell_apart(codes: Draw) -> None:
    """Each missing sequence takes away what it is for, and nothing else."""
    arrays = {
        "dark": codes(4, 64), "flat": codes(4, 500), "board_static": codes(4, 200), "board_moving": codes(4, 200),
        "dots_static": codes(4, 150), "dots_moving": codes(4, 150),
    }  # fmt: skip

    def of(names: list[str]) -> dict[str, bool]:
        dots = {"dots_px": [[11.5, 7.5], [2.0, 2.0], [22.0, 3.0]], "dots_sigma_px": 2.0}
        return topics(clspeckle.Capture.from_arrays({name: arrays[name] for name in names}, **dots))

    whole = of(list(arrays))
    lost = {
        "dark": {
            "offset and read noise",
            "absolute speckle contrast",
            "black level or ambient light",
            "laser lines or depolarization",
        },
        "flat": {"pixel response (PRNU) or speckle that stays"},
    }
    for missing, expected in lost.items():
        rest = of([name for name in arrays if name != missing])
        assert {topic for topic in whole if whole[topic] and not rest[topic]} == expected
    static_only = of(["dark", "flat", "board_static", "dots_static"])
    assert {t for t in whole if whole[t] and not static_only[t]} == {
        "motion during the exposure", "laser lines or motion during the exposure"
    }  # fmt: skip
    moving_only = of(["dark", "flat", "board_moving", "dots_moving"])
    assert not moving_only["boiling, vibration and air flow"] and not moving_only["flicker or boiling"]
    no_dots = of(["dark", "flat", "board_static", "board_moving"])
    assert not no_dots["beam and diffractive element"] and not no_dots["defocus or aperture"]
    assert not whole["shot noise, gamma and full well"], "one level says little"
    levels = clspeckle.Capture.from_arrays({"flat_1": codes(2, 164), "flat_2": codes(2, 464)})
    assert not topics(levels)["shot noise, gamma and full well"], "each flat's light is calibrated by itself"
    reason = {a["topic"]: a["reason"] for a in levels.summary()["abilities"]}["shot noise, gamma and full well"]
    assert "factor of 4.0" in reason and "shows shot noise" in reason and "no bent response" in reason
    for exposures in (True, False):
        flats = {
            f"flat_{ms}": clspeckle.CaptureSequence(
                codes(2, 64 + 50 * ms), "flat", exposure_ms=ms if exposures else None
            )
            for ms in range(1, 8)
        }
        series = clspeckle.Capture.from_arrays({"dark": codes(2, 64), **flats})
        assert topics(series)["shot noise, gamma and full well"] == exposures, "light goes as the time"
    resting = clspeckle.Capture.from_arrays({"board_static_1": codes(2, 164), "board_static_2": codes(2, 464)})
    assert not topics(resting)["shot noise, gamma and full well"], "speckle at rest is one draw"
    moving = clspeckle.Capture.from_arrays({"board_moving_1": codes(2, 164), "board_moving_2": codes(2, 464)})
    assert topics(moving)["shot noise, gamma and full well"]


def test_dark_current_shows_at_two_exposure_times(codes: Draw) -> None:
    def summary(*times: int) -> dict[str, Any]:
        dark = {
            f"dark_{i}": clspeckle.CaptureSequence(codes(2, 64, i), "dark", exposure_ms=ms)
            for i, ms in enumerate(times)
        }
        return clspeckle.Capture.from_arrays(dark).summary()

    for times, can in (((1, 20), True), ((20, 20), False), ((20,), False)):
        (ability,) = (a for a in summary(*times)["abilities"] if a["topic"] == "offset or dark current")
        assert ability["can"] == can
        (effect,) = (e for e in summary(*times)["effects"] if e["id"] == "dark_current")
        assert effect["visible"] == can
        assert can or "2 dark sequences of different exposure_ms" in effect["reason"]


def test_every_effect_has_its_place(codes: Draw) -> None:
    arrays = {"dark": codes(4, 64), "flat": codes(4, 500), "board_static": codes(4, 200)}
    effects = {e["id"]: e for e in clspeckle.Capture.from_arrays(arrays).summary()["effects"]}
    assert list(effects) == [effect.id for effect in clspeckle.effects()]
    assert effects["dsnu"]["sequences"] == ["dark", "flat"], "grain hides it on the board"
    assert effects["depolarization"]["sequences"] == ["board_static"]
    assert effects["vibration"]["sequences"] == ["board_static"]
    assert effects["motion_decorrelation"]["sequences"] == [] and "moving" in effects["motion_decorrelation"]["reason"]
    assert "dots" in effects["zero_order"]["reason"]
    summaries = {effect.id: effect.summary for effect in clspeckle.effects()}
    for name, effect in effects.items():
        assert bool(effect["sequences"]) == (effect["reason"] == ""), name
        # An effect that the table of symptoms does not know shows its summary instead.
        assert effect["symptom"] != summaries[name], f"{name} has no line in the table of symptoms"
    single = clspeckle.Capture.from_arrays({"dark": codes(1, 64)}).summary()["effects"]
    reasons = {e["id"]: e["reason"] for e in single}
    assert "fewer frames" in reasons["dsnu"]


def test_bad_arguments(codes: Draw) -> None:
    make = clspeckle.Capture.from_arrays
    with pytest.raises(TypeError, match="from_arrays"):
        clspeckle.Capture()
    with pytest.raises(errors.InvalidArgumentError, match="does not say what the sequence is"):
        make({"board": codes(2, 200)})
    with pytest.raises(errors.InvalidArgumentError, match="empty"):
        make({})
    with pytest.raises(errors.InvalidFormatError, match="float64"):
        make({"dark": codes(2, 64) / 2.0})
    with pytest.raises(
        errors.InvalidArgumentError, match=r"shape \(0, 16, 24\), expected .* it is empty, give at least"
    ):
        make({"dark": codes(2, 64)[:0]})
    with pytest.raises(errors.InvalidArgumentError, match="shape"):
        make({"dark": codes(2, 64)[0, 0]})
    with pytest.raises(errors.InvalidFormatError, match="expected uint16: codes are whole numbers.*NaN"):
        make({"dark": np.full((2, 16, 24), np.nan, np.float32)})
    for dtype in (np.int64, np.int16, np.uint32, bool):
        with pytest.raises(errors.InvalidFormatError, match=f"dtype {np.dtype(dtype)}, expected uint16"):
            make({"dark": codes(2, 64).astype(dtype)})
    with pytest.raises(errors.InvalidFormatError, match="8-bit codes only"):
        make({"dark": codes(2, 64).astype(np.uint8)})
    assert make({"dark": codes(2, 64).astype(np.uint8)}, camera={"bits": 8}).sequences["dark"].codes.dtype == np.uint16
    assert make({"dark": codes(2, 64).astype(">u2")}).shape == (16, 24)
    with pytest.raises(errors.InvalidArgumentError, match="the first sequence"):
        make({"dark": codes(2, 64), "flat": codes(2, 64)[:, :-1]})
    with pytest.raises(TypeError, match="f_number"):
        make({"dark": codes(2, 64)}, camera={"f_numer": 4})
    with pytest.raises(errors.InvalidArgumentError, match="dots_sigma_px"):
        make({"dark": codes(2, 64)}, dots_px=DOTS)
    with pytest.raises(errors.InvalidArgumentError, match="above 0"):
        make({"flat": clspeckle.CaptureSequence(codes(2, 300), "flat", exposure_ms=0)})
    with pytest.raises(errors.InvalidArgumentError, match="/sequences/0/scene"):
        make({"dots_static": codes(2, 300)})
    with pytest.raises(errors.InputOutputError, match="does not exist"):
        clspeckle.Capture.open("no such folder")
    closed = make({"dark": codes(2, 64)})
    closed.close()
    with pytest.raises(errors.InvalidHandleError):
        closed.summary()


def test_sets_of_another_generator() -> None:
    if not PRACTICE.is_dir():
        pytest.skip("CLSPECKLE_TEST_DATA names no folder with practice sets")
    # The camera of one set compresses its frames in blocks: noise goes, and codes that never occur come.
    compressed = {"p10": {"denoised", "missing_codes", "read_noise"}}
    folders = sorted(PRACTICE.glob("p*"))
    assert len(folders) == 10
    for folder in folders:
        capture = clspeckle.Capture.open(folder)
        for name, sequence in capture.sequences.items():
            assert np.array_equal(sequence.codes, np.load(folder / f"{name}.npy")), (folder, name)
        summary = capture.summary()
        assert {w["kind"] for w in summary["warnings"]} == compressed.get(folder.name, set()), folder
        invisible = {effect["id"] for effect in summary["effects"] if not effect["visible"]}
        assert invisible == {"dark_current"}, folder  # it takes dark frames of two exposures


def test_a_folder_that_is_named(codes: Draw, tmp_path: Path) -> None:
    capture = clspeckle.Capture.from_arrays({"dark": codes(2, 64.0)}, camera={"bits": 10, "f_number": 5.6})
    with pytest.raises(errors.ClspeckleError, match="the path of the capture set is empty; name a folder"):
        capture.write("")
    capture.write(tmp_path / "set")
    assert clspeckle.Capture.open(tmp_path / "set").summary()["sequences"][0]["frames"] == 2
