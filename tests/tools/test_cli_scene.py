"""Scenes: G-buffers as EXR, as planes, as sequence.json; all of them give the same frames."""

from __future__ import annotations

import json
import shutil
import tarfile
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import pytest
from cli_support import ROOT, frames

WIDTH, HEIGHT = 48, 36
FX, FY, CX, CY = 50.0, 52.0, 23.5, 17.5
CAMERA = ["--fx", FX, "--fy", FY, "--cx", CX, "--cy", CY]
PATTERN = ["--pattern", "dots.png", "--pattern-half-extent-x", 0.6, "--pattern-half-extent-y", 0.4]
POSE = [1, 0, 0, -0.075, 0, 1, 0, 0.01, 0, 0, 1, 0]
LASER = ["--pattern-laser-from-geometry", ",".join(map(str, POSE))]
OUTPUT = ["--format", "npy", "--no-preview", "--exposure-gain", 30000]


def depth() -> np.ndarray:
    """A tilted wall with a box in front and a hole."""
    y, x = np.indices((HEIGHT, WIDTH)).astype(np.float32)
    plane = np.float32(1.0) + x * np.float32(0.004) + y * np.float32(0.002)
    plane[10:20, 12:24] = 0.8
    plane[0:4, 0:4] = 0.0
    return plane.astype(np.float32)


def position() -> np.ndarray:
    y, x = np.indices((HEIGHT, WIDTH)).astype(np.float64)
    z = depth().astype(np.float64)
    points = np.stack([(x - CX) / FX * z, (y - CY) / FY * z, z], axis=-1)
    points[depth() <= 0] = np.nan
    return points.astype(np.float32)


def normal() -> np.ndarray:
    tilt = np.array([0.2, 0.1, -1.0])
    plane = np.broadcast_to(tilt / np.linalg.norm(tilt), (HEIGHT, WIDTH, 3)).astype(np.float32).copy()
    plane[10:20, 12:24] = (0, 0, -1)
    plane[depth() <= 0] = 0
    return plane


def albedo() -> np.ndarray:
    return np.random.default_rng(1).random((HEIGHT, WIDTH), dtype=np.float32)


def visibility() -> np.ndarray:
    plane = np.ones((HEIGHT, WIDTH), np.float32)
    plane[10:20, 24:28] = 0
    return plane


def channels(shift: int = 0) -> dict[str, np.ndarray]:
    n = normal()
    return {
        "Z": np.roll(depth(), shift, axis=1),
        **{f"N.{axis}": np.ascontiguousarray(n[..., i]) for i, axis in enumerate("XYZ")},
        "albedo": albedo(),
        "visibility": visibility(),
    }


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    images.exr(tmp_path / "scene.exr", channels())
    dots = np.zeros((64, 96), np.uint16)
    dots[4::8, 4::8] = 65535
    dots[5::8, 4::8] = 40000
    iio.imwrite(tmp_path / "dots.png", dots)
    for name, plane in (("z", depth()), ("p", position()), ("n", normal()), ("a", albedo()), ("v", visibility())):
        np.save(tmp_path / f"{name}.npy", plane)
    return tmp_path


def rendered(ok, folder: Path, *arguments: object) -> np.ndarray:
    ok("render", *arguments, "-o", "out", *PATTERN, *LASER, *OUTPUT)
    frame = frames(folder / "out")[0]
    shutil.rmtree(folder / "out")
    return frame


def test_all_ways_to_give_a_scene_agree(ok, scene: Path) -> None:
    expected = rendered(ok, scene, "scene.exr", *CAMERA)
    assert np.percentile(expected, 99) > 200, "the dots are seen"
    planes = ["--normal", "n.npy", "--albedo", "a.npy", "--visibility", "v.npy"]
    np.testing.assert_array_equal(rendered(ok, scene, "--depth", "z.npy", *planes, *CAMERA), expected)
    images.exr_tiled(scene / "tiles.exr", channels())
    np.testing.assert_array_equal(rendered(ok, scene, "tiles.exr", *CAMERA), expected)
    images.exr(scene / "bare.exr", {"Z": depth()})
    np.testing.assert_array_equal(rendered(ok, scene, "bare.exr", *planes, *CAMERA), expected)
    half = {
        name: plane if name == "Z" else plane.astype(np.float16).astype(np.float32)
        for name, plane in channels().items()
    }
    images.exr(scene / "float.exr", half)
    images.exr(scene / "half.exr", {name: p if name == "Z" else p.astype(np.float16) for name, p in half.items()})
    np.testing.assert_array_equal(rendered(ok, scene, "half.exr", *CAMERA), rendered(ok, scene, "float.exr", *CAMERA))


def test_position_agrees_with_depth(ok, scene: Path) -> None:
    """Positions are rounded to single precision before the lookup, so that a code may differ by one here and there."""
    expected = rendered(ok, scene, "scene.exr", *CAMERA).astype(int)
    planes = ["--normal", "n.npy", "--albedo", "a.npy", "--visibility", "v.npy"]
    frame = rendered(ok, scene, "--position", "p.npy", *planes).astype(int)
    assert np.abs(frame - expected).max() <= 1
    given = channels()
    del given["Z"]
    p = position()
    images.exr(scene / "position.exr", given | {f"P.{a}": np.ascontiguousarray(p[..., i]) for i, a in enumerate("XYZ")})
    np.testing.assert_array_equal(rendered(ok, scene, "position.exr"), frame)


def test_ideal_image_of_a_scene(ok, scene: Path) -> None:
    """The saved ideal image is the lookup in float64 on the host: bilinear, 1/d^2, cosine, albedo / pi, visibility.

    Texel weights in single precision on dots that fall from 1 to 0 within a texel leave errors of about 1e-4 of the
    brightest pixel."""
    ok("render", "scene.exr", *CAMERA, *PATTERN, *LASER, *OUTPUT, "-o", "out", "--save-ideal")
    given = np.load(scene / "out" / "ideal_000000.npy")
    dots = iio.imread(scene / "dots.png").astype(float) / 65535
    y, x = np.indices((HEIGHT, WIDTH)).astype(float)
    z = depth().astype(float)
    point = np.stack([(x - CX) / FX * z, (y - CY) / FY * z, z], axis=-1) + [POSE[3], POSE[7], POSE[11]]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (point[..., 0] / point[..., 2] / 0.6 + 1) / 2 * dots.shape[1] - 0.5
        v = (point[..., 1] / point[..., 2] / 0.4 + 1) / 2 * dots.shape[0] - 0.5
        d = np.linalg.norm(point, axis=-1)
        cosine = np.maximum(0, -(point * normal()).sum(-1) / d)
    inside = (z > 0) & (u > 0) & (v > 0) & (u < dots.shape[1] - 1) & (v < dots.shape[0] - 1)
    u0, v0 = (np.where(inside, np.floor(t), 0).astype(int) for t in (u, v))
    fu, fv = np.where(inside, u - u0, 0), np.where(inside, v - v0, 0)
    texel = (1 - fv) * ((1 - fu) * dots[v0, u0] + fu * dots[v0, u0 + 1])
    texel += fv * ((1 - fu) * dots[v0 + 1, u0] + fu * dots[v0 + 1, u0 + 1])
    expected = texel * cosine / d**2 * visibility() * albedo() / np.pi
    assert np.mean(inside) > 0.8
    assert np.abs(given - expected)[inside].max() < 3e-4 * expected[inside].max()
    assert not given[z <= 0].any()


def test_folder_and_glob(ok, scene: Path) -> None:
    (scene / "buffers").mkdir()
    for i in range(3):
        images.exr(scene / "buffers" / f"frame_{i}.exr", channels(i))
    arguments = [*CAMERA, *PATTERN, *LASER, *OUTPUT]
    ok("render", "buffers", "-o", "folder", *arguments)
    ok("render", "buffers/*.exr", "-o", "glob", *arguments)
    folder, glob = frames(scene / "folder"), frames(scene / "glob")
    assert len(folder) == 3
    np.testing.assert_array_equal(folder, glob)
    assert not np.array_equal(folder[0], folder[1])


def test_refresh_channel(ok, scene: Path) -> None:
    """The speckle changes where the channel says so, from the second frame on. A soft rim keeps the light together."""
    refresh = np.zeros((HEIGHT, WIDTH), np.float16)
    refresh[:, 30:] = 1
    (scene / "buffers").mkdir()
    for i in range(2):
        images.exr(scene / "buffers" / f"frame_{i}.exr", channels() | {"refresh": refresh})
    arguments = [*CAMERA, *PATTERN, *LASER, *OUTPUT, "--read-noise", 0, "--relative-diameter", 1, "--soft-rim", 1]
    ok("render", "buffers", "-o", "out", *arguments)
    first, second = (frame.astype(int) for frame in frames(scene / "out"))
    change = np.abs(second - first)
    assert change[:, 32:].max() > 100
    assert change[:, :24].max() < 30
    ok("render", "buffers", "-o", "none", *arguments, "--refresh", "none")
    np.testing.assert_array_equal(*frames(scene / "none"))


def sequence(**changes: object) -> dict:
    return {
        "format": "clspeckle-gbuffer-sequence",
        "version": 1,
        "width": WIDTH,
        "height": HEIGHT,
        "frames": ["scene.exr"],
        "camera": {"fx_px": FX, "fy_px": FY, "cx_px": CX, "cy_px": CY, "f_number": 4.0, "pixel_pitch_m": 3e-6},
        "laser": {
            "wavelength_m": 8.5e-7,
            "laser_from_geometry": POSE,
            "pattern": {"file": "dots.png", "half_extent_x": 0.6, "half_extent_y": 0.4},
        },
        "materials": [],
    } | changes


def test_sequence_json(ok, scene: Path) -> None:
    """It says everything that a scene needs; its folder may be given in its place, from anywhere."""
    arguments = [*CAMERA, "--f-number", 4, "--pixel-pitch", 3e-6, "--wavelength", 8.5e-7]
    expected = rendered(ok, scene, "scene.exr", *arguments)
    (scene / "sequence.json").write_text(json.dumps(sequence()))
    for given in ("sequence.json", scene / "sequence.json", scene):
        ok("render", given, "-o", "sub/out", *OUTPUT)
        np.testing.assert_array_equal(frames(scene / "sub" / "out")[0], expected)
        shutil.rmtree(scene / "sub")


BAD_SEQUENCES = [
    ({"format": "something"}, ["format", "clspeckle-gbuffer-sequence", "--config"]),
    ({"version": 2}, ["version 2"]),
    ({"frames": []}, ['"frames" is empty']),
    ({"frames": "scene.exr"}, ['"frames" must be a list']),
    ({"frames": ["missing.exr"]}, ["missing.exr", "No such file"]),
    ({"frames": ["dots.png"]}, ["dots.png", "Z"]),
    ({"camera": {"fx": 5}}, ['unknown key "fx"', '"fx_px"']),
    ({"camera": {"fx_px": "wide"}}, ["fx_px", "a number"]),
    ({"camera": 5}, ['"camera" must be an object']),
    ({"laser": {"pattern": {"file": "dots.png", "half_extent": 5}}}, ['unknown key "half_extent"', "half_extent_"]),
    ({"laser": {"laser_from_geometry": [1, 2]}}, ["laser_from_geometry", "12 numbers"]),
    ({"laser": {"pattern": {"file": "missing.png"}}}, ["missing.png", "No such file"]),
]


@pytest.mark.parametrize(("changes", "words"), BAD_SEQUENCES, ids=[json.dumps(c)[:60] for c, _ in BAD_SEQUENCES])
def test_bad_sequences(refused, scene: Path, changes: dict, words: list[str]) -> None:
    (scene / "sequence.json").write_text(json.dumps(sequence(**changes)))
    message = refused("render", "sequence.json", "-o", "out")
    for word in words:
        assert word in message


def test_a_key_given_twice_in_a_sequence(refused, scene: Path) -> None:
    text = json.dumps(sequence()).replace('"version": 1', '"version": 1, "version": 1')
    assert text.count('"version"') == 2
    (scene / "sequence.json").write_text(text)
    assert 'sequence.json: the key "version" is given twice' in refused("render", "sequence.json", "-o", "out")


def test_sizes_of_a_series_are_checked_before_its_first_frame(refused, scene: Path) -> None:
    """A scene of another size at the end of the series, and a plane with a wrong number of frames."""
    small = {name: np.ascontiguousarray(plane[:20]) for name, plane in channels().items()}
    images.exr(scene / "scene_later.exr", small)
    message = refused("render", "scene.exr", "scene_later.exr", "-o", "out", *CAMERA, *PATTERN, *LASER)
    assert "scene_later.exr" in message and "48 x 20" in message and "48 x 36" in message
    np.save(scene / "three.npy", np.stack([albedo()] * 3))
    message = refused(
        "render", "scene.exr", "scene.exr", "--albedo", "three.npy", "-o", "out", *CAMERA, *PATTERN, *LASER
    )
    assert "three.npy" in message and "3 frames" in message and "1 or 2" in message


def test_packed_frames_are_pointed_out(refused, scene: Path) -> None:
    (scene / "sequence.json").write_text(json.dumps(sequence(frames=["other.exr"])))
    with tarfile.open(scene / "frames.tar.xz", "w:xz") as archive:
        archive.add(scene / "scene.exr", "other.exr")
    assert "tar -xf ./frames.tar.xz -C ." in refused("render", "sequence.json", "-o", "out")


def test_what_a_scene_needs(refused, scene: Path) -> None:
    camera_and_laser = [*CAMERA, *LASER]
    assert "--pattern" in refused("render", "scene.exr", "-o", "out", *camera_and_laser)
    assert "--fx" in refused("render", "scene.exr", "-o", "out", *PATTERN)
    assert "ideal image" in refused("render", "dots.png", "-o", "out", *PATTERN)
    assert "ideal image" in refused("render", "dots.png", "-o", "out", "--albedo", "a.npy")
    assert "--depth" in refused("render", "-o", "out", *PATTERN)
    both = refused("render", "--depth", "z.npy", "--position", "p.npy", "-o", "out", *PATTERN)
    assert "--depth" in both and "--position" in both
    assert "--depth" in refused("render", "scene.exr", "--depth", "z.npy", "-o", "out", *PATTERN)
    assert "three values per pixel" in refused("render", "--position", "z.npy", "-o", "out", *PATTERN)
    iio.imwrite(scene / "z.png", (depth() * 1000).astype(np.uint16))
    assert "floating-point" in refused("render", "--depth", "z.png", "-o", "out", *PATTERN, *CAMERA)


def test_bad_planes_are_named_with_the_pixel(refused, scene: Path) -> None:
    arguments = ["-o", "out", *PATTERN, *LASER, *CAMERA]
    for name, value, word in (("albedo", np.nan, "nan"), ("albedo", -0.5, "-0.5"), ("visibility", 1.5, "1.5")):
        given = channels()
        given[name][7, 11] = value
        images.exr(scene / "bad.exr", given)
        message = refused("render", "bad.exr", *arguments)
        assert "bad.exr: pixel (11, 7)" in message and word in message and name in message
    np.save(scene / "bad.npy", albedo()[:30])
    message = refused("render", "scene.exr", "--albedo", "bad.npy", *arguments)
    assert "bad.npy" in message and "48 x 30" in message and "48 x 36" in message
    given = channels()
    del given["N.Y"]
    images.exr(scene / "bad.exr", given)
    assert "only some of the channels N.X, N.Y and N.Z" in refused("render", "bad.exr", *arguments)


def test_doubtful_planes_are_warned_of(ok, scene: Path) -> None:
    given = channels()
    given["N.Z"] = given["N.Z"] * 2
    given["albedo"] = given["albedo"] * 2
    given["Z"] = given["Z"].astype(np.float16)
    images.exr(scene / "odd.exr", given)
    result = ok("render", "odd.exr", "-o", "out", *PATTERN, *LASER, *CAMERA, *OUTPUT)
    assert "not of unit length" in result.err
    assert "albedo above 1" in result.err
    assert "half precision" in result.err


def test_bad_pattern(refused, scene: Path) -> None:
    arguments = ["render", "scene.exr", "-o", "out", *CAMERA]
    dots = np.ones((8, 8), np.float32)
    dots[2, 3] = -1
    np.save(scene / "negative.npy", dots)
    assert "negative.npy: pixel (3, 2) is -1" in refused(*arguments, "--pattern", "negative.npy")
    assert "missing.png" in refused(*arguments, "--pattern", "missing.png")
    np.save(scene / "tiny.npy", np.ones((1, 1), np.float32))
    assert "2 to 16384" in refused(*arguments, "--pattern", "tiny.npy")
    shear = "1,0.5,0,0,0,1,0,0,0,0,1,0"
    assert "rotation" in refused(*arguments, *PATTERN, "--pattern-laser-from-geometry", shear)


def test_office_example(ok, tmp_path: Path) -> None:
    """The example's first two frames: dots on surfaces that the laser sees, nothing above the noise elsewhere."""
    source = ROOT / "examples" / "office" / "gbuffers"
    for name in ("sequence.json", "pattern.png"):
        shutil.copy(source / name, tmp_path)
    with tarfile.open(source / "frames.tar.xz") as archive:
        for name in archive.getnames():
            member = archive.extractfile(name)
            assert member is not None
            (tmp_path / name).write_bytes(member.read())
    arguments = ["--frames", 2, "--format", "npy", "--exposure-gain", "auto", "--save-ideal", "--no-preview", "--json"]
    summary = ok("render", tmp_path, "-o", "out", *arguments).json()
    frame = np.load(tmp_path / "out" / "frame_000000.npy").astype(float)
    ideal = np.load(tmp_path / "out" / "ideal_000000.npy")
    transmission, gain = summary["aperture"]["mean_transmission"], summary["exposure_gain_dn"]
    assert summary["first_frame"]["saturated_share"] < 0.01
    # Speckle moves light by a few pixels and clipping loses a little; the sum over thousands of dots stays.
    expected = gain * transmission * ideal
    assert (frame - 64).mean() == pytest.approx(expected.mean(), rel=0.05)

    def blocks(image: np.ndarray) -> np.ndarray:
        return image.reshape(15, 32, -1, 32).mean(axis=(1, 3)).ravel()

    # A block of 32 x 32 pixels holds some 300 speckles: its light is right to about 10 %.
    assert np.corrcoef(blocks(frame), blocks(expected))[0, 1] > 0.95
    # Between the dots it is dark: half of the pixels lie within the noise of the black level.
    assert 60 < np.median(frame) < 75
    assert np.percentile(frame, 99.9) > 300
