"""Radiance HDR and EXR in many variants: the values of readers of this file's own, and of OpenEXR's."""

from __future__ import annotations

import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from test_variants import SIZES, Dump

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
import cli_images as images  # noqa: E402

Array = np.ndarray
ENDS = SIZES[::3]  # of one pixel, and of an odd width

# --- Radiance HDR ---


def pixels_of(size: tuple[int, int], runs: bool) -> Array:
    """RGBE with runs, blacks, and mantissas that are not normalized but for 1 1 1, which is a run."""
    random = np.random.default_rng(size[0])
    rgbe = random.integers(2, 256, (size[1], size[0], 4), dtype=np.uint8)
    rgbe[..., 3] = random.integers(100, 150, (size[1], size[0]))
    rgbe[::3, ::2] = (0, 0, 0, 0)
    if runs:
        rgbe[:, size[0] // 3 :] = rgbe[:, :1]
    return rgbe


def flat(rgbe: Array) -> bytes:
    return rgbe.tobytes()


def old_runs(rgbe: Array) -> bytes:
    out = bytearray()
    for row in rgbe:
        at = 0
        while at < len(row):
            run = 1
            while at + run < len(row) and (row[at + run] == row[at]).all():
                run += 1
            out += row[at].tobytes()
            count = run - 1
            while count > 0:  # bytes of the count, the lowest first
                out += bytes([1, 1, 1, count & 255])
                count >>= 8
            at += run
    return bytes(out)


def new_runs(rgbe: Array) -> bytes:
    out = bytearray()
    for row in rgbe:
        out += bytes([2, 2, len(row) >> 8, len(row) & 255])
        for component in range(4):
            out += images._runs(row[:, component].tolist())
    return bytes(out)


HEADERS = {
    "radiance": "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {h} +X {w}\n",
    "rgbe": "#?RGBE\nFORMAT=32-bit_rle_rgbe\n\n-Y {h} +X {w}\n",
    "comments": "#?RADIANCE\n# a comment\nSOFTWARE=x\nGAMMA=1\nFORMAT=32-bit_rle_rgbe\n\n-Y {h} +X {w}\n",
    "crlf": "#?RADIANCE\r\nFORMAT=32-bit_rle_rgbe\r\n\r\n-Y {h} +X {w}\n",
}


@pytest.mark.parametrize("header", HEADERS)
def test_hdr(tmp_path: Path, header: str) -> None:
    for size in (*ENDS, (8, 2), (300, 4)):
        for runs in (False, True):
            rgbe = pixels_of(size, runs)
            exponent = np.where(rgbe[..., 3] > 0, np.exp2(rgbe[..., 3].astype(float) - 136), 0)
            expected = rgbe[..., :3] * exponent[..., None]
            for write in (flat, old_runs, new_runs):
                if write is new_runs and size[0] < 8:
                    continue  # the format has none
                if write is flat and (rgbe[..., 0] == 2).any() and (rgbe[..., 1] == 2).any():
                    rgbe[..., 0] |= 4  # no mark of new runs
                    expected = rgbe[..., :3] * exponent[..., None]
                head = HEADERS[header].format(w=size[0], h=size[1]).encode()
                (tmp_path / "a.hdr").write_bytes(head + write(rgbe))
                given = Dump(tmp_path / "a.hdr")
                assert not given.error and given.warnings == []
                np.testing.assert_array_equal(given.values[0], expected.astype(np.float32))


# --- EXR ---

COMPRESSIONS = {
    "none": OpenEXR.NO_COMPRESSION,
    "rle": OpenEXR.RLE_COMPRESSION,
    "zips": OpenEXR.ZIPS_COMPRESSION,
    "zip": OpenEXR.ZIP_COMPRESSION,
    "piz": OpenEXR.PIZ_COMPRESSION,
    "pxr24": OpenEXR.PXR24_COMPRESSION,
    "b44": OpenEXR.B44_COMPRESSION,
    "b44a": OpenEXR.B44A_COMPRESSION,
    "dwaa": OpenEXR.DWAA_COMPRESSION,
    "dwab": OpenEXR.DWAB_COMPRESSION,
}
ROWS = {0: 1, 1: 1, 2: 1, 3: 16}  # of a block, by the number of the compression


def unpacked(data: bytes, size: int, compression: int) -> bytes:
    """A block of the first four compressions."""
    if compression == 0 or len(data) == size:
        return data
    if compression == 1:
        out, at = bytearray(), 0
        while at < len(data):
            count = struct.unpack_from("b", data, at)[0]
            if count < 0:
                out += data[at + 1 : at + 1 - count]
                at += 1 - count
            else:
                out += data[at + 1 : at + 2] * (count + 1)
                at += 2
    else:
        out = bytearray(zlib.decompress(data))
    deltas = np.frombuffer(bytes(out), np.uint8).astype(np.int64)
    deltas[1:] -= 128
    parts = np.cumsum(deltas).astype(np.uint8)
    half = (size + 1) // 2
    result = np.empty(size, np.uint8)
    result[::2], result[1::2] = parts[:half], parts[half:]
    return result.tobytes()


def decoded(path: Path) -> dict[str, Array]:
    """Scanlines of one part, by the format's description."""
    data = path.read_bytes()
    assert data[:4] == b"v/1\x01"
    at, attributes = 8, {}
    while data[at]:
        name, kind = data[at:].split(b"\0", 2)[:2]
        at += len(name) + len(kind) + 2
        length = struct.unpack_from("<i", data, at)[0]
        attributes[name.decode()] = data[at + 4 : at + 4 + length]
        at += 4 + length
    at += 1
    channels, text = [], attributes["channels"]
    while text[0]:
        name, rest = text.split(b"\0", 1)
        channels.append((name.decode(), ("<u4", "<f2", "<f4")[struct.unpack_from("<i", rest)[0]]))
        text = rest[16:]
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height, compression = x1 - x0 + 1, y1 - y0 + 1, attributes["compression"][0]
    result = {name: np.zeros((height, width), np.dtype(kind)) for name, kind in channels}
    rows = ROWS[compression]
    for block in range(-(-height // rows)):
        offset = struct.unpack_from("<Q", data, at + 8 * block)[0]
        y, length = struct.unpack_from("<ii", data, offset)
        count = min(rows, y1 - y + 1)
        size = count * width * sum(np.dtype(kind).itemsize for _, kind in channels)
        raw, place = unpacked(data[offset + 8 : offset + 8 + length], size, compression), 0
        for row in range(y - y0, y - y0 + count):
            for name, kind in channels:
                result[name][row] = np.frombuffer(raw, kind, width, place)
                place += width * np.dtype(kind).itemsize
    return result


def plane(size: tuple[int, int], kind: str, seed: int = 0) -> Array:
    random = np.random.default_rng(seed)
    if kind == "uint":
        return random.integers(0, 5000, size[::-1], dtype=np.uint32)
    return random.normal(1, 0.3, size[::-1]).astype(np.float16 if kind == "half" else np.float32)


@pytest.mark.parametrize("kind", ["half", "float", "uint"])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_exr(tmp_path: Path, compression: str, kind: str) -> None:
    for size in ENDS:
        for names in (["Y"], ["R", "G", "B"]):
            planes = {name: plane(size, kind, i) for i, name in enumerate(names)}
            images.exr(tmp_path / "a.exr", planes, compression=COMPRESSIONS[compression])
            given = Dump(tmp_path / "a.exr")
            assert not given.error, given.error
            if compression in ("none", "rle", "zips", "zip"):
                read = decoded(tmp_path / "a.exr")
                for name in names:
                    np.testing.assert_array_equal(read[name], planes[name])
            else:
                channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
                read = {name: channels[name].pixels for name in names}
            expected = np.stack([read[name].astype(np.float32) for name in names], axis=-1)
            np.testing.assert_array_equal(given.values[0].reshape(expected.shape), expected)


@pytest.mark.parametrize("window", [(0, 0), (-7, 13), (100, -5)])
def test_exr_windows_and_tiles(tmp_path: Path, window: tuple[int, int]) -> None:
    for size in SIZES:
        for kind in ("half", "float"):
            values = plane(size, kind)
            corners = (
                np.array(window, np.int32),
                np.array([window[0] + size[0] - 1, window[1] + size[1] - 1], np.int32),
            )
            images.exr(tmp_path / "a.exr", {"Y": values}, dataWindow=corners, displayWindow=corners)
            np.testing.assert_array_equal(decoded(tmp_path / "a.exr")["Y"], values)
            Dump(tmp_path / "a.exr").check(values, 0)
            images.exr_tiled(tmp_path / "b.exr", {"Y": values})
            Dump(tmp_path / "b.exr").check(values, 0)


LOSSY = {
    "pxr24": ("float", "Y"),
    "b44": ("half", "Y"),
    "b44a": ("half", "Y"),
    "dwaa": ("float", "Y"),
    "dwab": ("half", "Y"),
}
KEEPS = {"pxr24": ("half", "Y"), "b44": ("float", "Y"), "b44a": ("float", "Y"), "dwaa": ("float", "IR"),
         "dwab": ("uint", "Y"), "zip": ("float", "Y"), "piz": ("half", "Y"), "none": ("float", "Y")}  # fmt: skip


def test_lossy_compressions_are_told(tmp_path: Path) -> None:
    """Where they change numbers: each keeps those of other kinds. The advice is followed."""
    for compression, (kind, name) in LOSSY.items():
        images.exr(tmp_path / "a.exr", {name: plane((64, 48), kind)}, compression=COMPRESSIONS[compression])
        given = Dump(tmp_path / "a.exr")
        assert [w for w in given.warnings if "is lossy. Where intensities matter save it with ZIP or PIZ" in w], (
            compression
        )
        assert (given.values[0] != plane((64, 48), kind)).any(), compression
        images.exr(tmp_path / "b.exr", {name: plane((64, 48), kind)}, compression=OpenEXR.PIZ_COMPRESSION)
        assert Dump(tmp_path / "b.exr").warnings == []
    for compression, (kind, name) in KEEPS.items():
        images.exr(tmp_path / "a.exr", {name: plane((64, 48), kind)}, compression=COMPRESSIONS[compression])
        given = Dump(tmp_path / "a.exr")
        assert given.warnings == [], compression
        np.testing.assert_array_equal(given.values[0], plane((64, 48), kind).astype(np.float32))


@pytest.mark.parametrize("attribute", ["oiio:ColorSpace", "colorInteropID"])
def test_color_spaces_by_name(tmp_path: Path, attribute: str) -> None:
    for space, transfer in {
        "sRGB": "sRGB", "srgb_rec709_scene": "sRGB", "g22_rec709": "the power 2.2", "lin_rec709": "linear",
        "Linear": "linear", "lin_srgb": "linear", "scene_linear": "linear", "ACEScg": "linear", "raw": "linear",
        "data": "linear", "ACEScct": 'the color space "ACEScct", which is not known here',
    }.items():  # fmt: skip
        images.exr(tmp_path / "a.exr", {"Y": plane((8, 4), "float")}, **{attribute: space})
        given = Dump(tmp_path / "a.exr")
        assert given.transfer == transfer, space
        np.testing.assert_array_equal(given.values[0], plane((8, 4), "float"))


def test_views_of_one_file_are_told(tmp_path: Path) -> None:
    """The advice names the other view."""
    planes = {
        f"{view}{name}": plane((8, 4), "half", i)
        for i, (view, name) in enumerate((v, n) for v in ("", "right.") for n in "RGB")
    }
    images.exr(tmp_path / "a.exr", planes, multiView=["left", "right"])
    given = Dump(tmp_path / "a.exr")
    [warning] = given.warnings
    assert warning.startswith(
        "it holds the views left, right, of which left is taken; name one behind the file's name, for example "
    )
    np.testing.assert_array_equal(given.values[0][..., 0], planes["R"].astype(np.float32))
    assert warning.endswith(f"{tmp_path / 'a.exr'}:right")
