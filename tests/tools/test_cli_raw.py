"""Raw frames through the program: --raw, and "raw" in capture.json."""

from __future__ import annotations

import json
from pathlib import Path

import cli_images as images
import numpy as np
import pytest
from PIL import Image

SETTINGS = ["--format", "npy-stack", "--no-preview", "--irradiance-scale", "0.5", "--read-noise", "1"]
SIZE = f"{images.WIDTH}x{images.HEIGHT}"


def mono12p(codes: np.ndarray) -> bytes:
    """GenICam's packing, written apart from the reader: two pixels in three bytes."""
    a, b = codes.reshape(-1, 2).astype(int).T
    return np.stack([a & 255, a >> 8 | (b & 15) << 4, b >> 4], axis=1).astype(np.uint8).tobytes()


def codes12(frames: int, seed: int = 7) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 4096, (frames, images.HEIGHT, images.WIDTH), dtype=np.uint16)


def test_render_sees_the_codes(ok, tmp_path: Path) -> None:
    (tmp_path / "frames.raw").write_bytes(b"head" + mono12p(codes12(3)))
    np.save(tmp_path / "reference.npy", (codes12(3) / 4095).astype(np.float32))
    ok("render", "frames.raw", "-o", "given", "--raw", f"{SIZE},12,genicam,4", *SETTINGS)
    ok("render", "reference.npy", "-o", "reference", *SETTINGS)
    given, reference = (np.load(tmp_path / folder / "frames.npy") for folder in ("given", "reference"))
    assert given.shape == (3, images.HEIGHT, images.WIDTH)
    np.testing.assert_array_equal(given, reference)


def test_statistics_and_a_folder(ok, tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    for i in range(2):
        (tmp_path / "frames" / f"{i}.raw").write_bytes(codes12(2)[i].astype("<u2").tobytes())
    frames = ok("statistics", "frames", "--json", "--raw", f"{SIZE},12").json()["frames"]
    assert [frame["mean"] for frame in frames] == pytest.approx(codes12(2).mean(axis=(1, 2)), rel=1e-6)
    assert frames[0]["top_code"] == 4095


def test_descriptions_that_do_not_fit_are_refused(refused, ok, tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(mono12p(codes12(1)))
    assert "raw frames must be described" in refused("render", "a.raw", "-o", "out")
    assert '--raw "40,12": "40" is no size' in refused("render", "a.raw", "-o", "out", "--raw", "40,12")
    message = refused("render", "a.raw", "-o", "out", "--raw", f"{SIZE},12")
    assert "has 1680 bytes" in message and "12,genicam (1 frame)" in message
    ok("statistics", "a.raw", "--raw", f"{SIZE},12,genicam")
    assert "either --channel or --raw" in refused("statistics", "a.raw", "--raw", f"{SIZE},8", "--channel", "Y")
    assert "name them" in refused("render", "-o", "out", "--raw", f"{SIZE},8")


def capture(tmp_path: Path, **of_sequence: object) -> None:
    (tmp_path / "set" / "capture.json").write_text(
        json.dumps(
            {
                "format": "clspeckle-capture",
                "version": 1,
                "camera": {
                    "width": images.WIDTH,
                    "height": images.HEIGHT,
                    "bits": 12,
                    "pixel_pitch_um": 2.9,
                    "f_number": 5.6,
                    "black_level_dn": 64.0,
                    "read_noise_dn": 4.0,
                },
                "sequences": [{"name": "dark", "scene": "dark", **of_sequence}],
            }
        )
    )


def test_a_capture_of_raw_frames_is_that_of_their_codes(ok, refused, tmp_path: Path) -> None:
    dark = np.clip(np.random.default_rng(1).normal(64, 4, codes12(6).shape).round(), 0, 4095).astype(np.uint16)
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "dark.raw").write_bytes(mono12p(dark))
    np.save(tmp_path / "set" / "dark.npy", dark)
    shown = []
    for of_sequence in ({"file": "dark.raw", "raw": f"{SIZE},12,genicam"}, {"file": "dark.npy"}):
        capture(tmp_path, **of_sequence)
        shown.append(ok("capture", "check", "set", "--json", "-").json()["sequences"])
    assert shown[0] == shown[1]
    capture(tmp_path, file="dark.raw")
    assert "raw frames must be described" in refused("capture", "check", "set")
    capture(tmp_path, file="dark.raw", raw=f"{SIZE},13")
    message = refused("capture", "check", "set")
    assert "/sequences/0/raw" in message and '"13" bits are not read' in message
    capture(tmp_path, file="dark.raw", raw=f"{SIZE},10,genicam")
    assert "12,genicam (6 frames)" in refused("capture", "check", "set")
    # A folder's frames, and a pattern's, whatever their ending.
    (tmp_path / "set" / "frames").mkdir()
    for i, frame in enumerate(dark):
        (tmp_path / "set" / "frames" / f"dark_{i}.raw").write_bytes(mono12p(frame))
        (tmp_path / "set" / "frames" / f"dark_{i}.bin").write_bytes(mono12p(frame))
    for file in ("frames", "frames/*.bin"):
        capture(tmp_path, file=file, raw=f"{SIZE},12,genicam")
        assert ok("capture", "check", "set", "--json", "-").json()["sequences"][0]["mean_dn"] == shown[1][0]["mean_dn"]


def test_capture_init_describes_raw_frames(ok, refused, tmp_path: Path) -> None:
    dark = np.clip(np.random.default_rng(1).normal(64, 4, codes12(6).shape).round(), 0, 4095).astype(np.uint16)
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "dark.raw").write_bytes(mono12p(dark))
    assert "raw frames must be described" in refused("capture", "init", "set")
    ok("capture", "init", "set", "--raw", f"{SIZE},12,genicam")
    written = json.loads((tmp_path / "set" / "capture.json").read_text())
    assert written["camera"]["bits"] == 12
    assert written["sequences"][0]["raw"] == f"{SIZE},12,genicam"
    ok("capture", "check", "set")


def test_eight_bit_formats_hold_codes_and_jpeg_does_not(ok, refused, tmp_path: Path) -> None:
    dark = np.clip(np.random.default_rng(1).normal(64, 4, codes12(6).shape).round(), 0, 255).astype(np.uint8)
    for ending in ("bmp", "tga", "pgm", "jpg"):
        (tmp_path / "set" / ending).mkdir(parents=True)
        for i, frame in enumerate(dark):
            Image.fromarray(frame).save(tmp_path / "set" / ending / f"{i}.{ending}")
        capture(tmp_path, file=f"{ending}/*.{ending}")
        described = (tmp_path / "set" / "capture.json").read_text()
        (tmp_path / "set" / "capture.json").write_text(described.replace('"bits": 12', '"bits": 8'))
        if ending != "jpg":
            assert ok("capture", "check", "set", "--json", "-").json()["sequences"][0]["frames"] == 6
            continue
        message = refused("capture", "check", "set")
        assert "is of the format JPEG" in message and "its compression changes codes" in message and "PNG" in message


def test_little_endian_pgm_files_of_a_capture(ok, refused, tmp_path: Path) -> None:
    """The cause is named where codes do not fit, and once for all files where they do; the advice reads them."""
    dark = np.clip(np.random.default_rng(1).normal(1000, 4, codes12(3).shape).round(), 0, 4095).astype(np.uint16)
    (tmp_path / "set").mkdir()
    head = f"P5\n{images.WIDTH} {images.HEIGHT}\n65535\n".encode()
    for i, frame in enumerate(dark):
        (tmp_path / "set" / f"dark_{i}.pgm").write_bytes(head + frame.astype("<u2").tobytes())
    capture(tmp_path, file="dark_*.pgm")
    message = refused("capture", "check", "set")
    assert "/camera/bits is 12" in message and "its words look little-endian" in message
    raw = message.split("--raw ")[1].split()[0]
    capture(tmp_path, file="dark_*.pgm", raw=raw)
    summary = ok("capture", "check", "set", "--json", "-").json()
    assert summary["sequences"][0]["frames"] == 3
    assert not any("little-endian" in warning["text"] for warning in summary["warnings"])
    described = (tmp_path / "set" / "capture.json").read_text().replace(f', "raw": "{raw}"', "")
    (tmp_path / "set" / "capture.json").write_text(described.replace('"bits": 12', '"bits": 16'))
    summary = ok("capture", "check", "set", "--json", "-").json()
    told = [warning["text"] for warning in summary["warnings"] if "little-endian" in warning["text"]]
    assert len(told) == 1 and "dark_0.pgm and 2 more of the sequence" in told[0]
    assert {warning["kind"] for warning in summary["warnings"]} == {"no_laser", "swapped_bytes"}
    assert raw in told[0] and f'"raw": "{raw}"' in told[0]
    # init tells the same, and its option does what the message says.
    told_by_init = ok("capture", "init", "set", "--force").err
    assert (
        told_by_init.count("little-endian") == 1 and f"--raw {raw}" in told_by_init and "byteswap" not in told_by_init
    )
    assert "little-endian" not in ok("capture", "init", "set", "--force", "--raw", raw).err
    written = json.loads((tmp_path / "set" / "capture.json").read_text())
    assert written["camera"]["bits"] == 10 and written["sequences"][0]["raw"] == raw
    again = ok("capture", "check", "set", "--json", "-").json()["warnings"]
    assert {warning["kind"] for warning in again} <= {"no_laser"}
