"""The add-on of Blender, and the writer for BlenderProc: conventions with arrays, and the add-on in Blender itself."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from PIL import Image

import clspeckle

ROOT = Path(__file__).resolve().parents[2]
BLENDER = ROOT / "examples" / "blender"
sys.path[:0] = [str(BLENDER), str(BLENDER / "clspeckle_camera")]
import blenderproc_writer as writer
import passes
from camera_view import SceneError, View, record

SHAPE = (40, 60)
K = np.array([[50.0, 0, 29.5], [0, 50.0, 19.5], [0, 0, 1]])


def leaning_wall() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth along the axis, the normal in our axes, and the rays."""
    y, x = np.indices(SHAPE)
    way = np.stack([(x - 29.5) / 50, (y - 19.5) / 50, np.ones(SHAPE)], axis=-1)
    normal = np.array([0.3, -0.2, -np.sqrt(1 - 0.13)])
    return 1.2 * normal[2] / (way @ normal), normal, way


def blenderproc(**changes: Any) -> dict[str, list[Any]]:
    """What its renderer returns of that wall: normals of Blender's camera as colors, 1e10 where nothing is."""
    depth, normal, _ = leaning_wall()
    depth = depth.astype(np.float32)
    depth[:3] = 1e10
    coded = np.broadcast_to((normal * (1, -1, -1) + 1) / 2, (*SHAPE, 3)).astype(np.float32)
    data = {
        "depth": [depth, 2 * depth],
        "normals": [coded, coded],
        "colors": [np.full((*SHAPE, 3), 188, np.uint8)] * 2,
        **changes,
    }
    return {key: value for key, value in data.items() if value is not None}


def test_blenderproc_becomes_our_view() -> None:
    depth, normal, way = leaning_wall()
    first, second = writer.views_of(blenderproc(), K)
    assert (first.depth[:3] == 0).all()
    np.testing.assert_allclose(first.depth[3:], depth[3:], rtol=1e-6)
    np.testing.assert_allclose(second.depth[3:], 2 * depth[3:], rtol=1e-6)
    np.testing.assert_allclose(first.normal[3:], np.broadcast_to(normal, (*SHAPE, 3))[3:], atol=1e-6)
    assert not first.normal[:3].any()
    np.testing.assert_allclose(first.ideal, 0.5029, atol=1e-4)  # sRGB's 188
    assert first.intrinsics == (50, 50, 29.5, 19.5)
    # Distances are along the rays; floats are linear.
    far = blenderproc()["depth"][0] * np.linalg.norm(way, axis=-1)
    data = blenderproc(depth=None, distance=[far], normals=blenderproc()["normals"][:1])
    (same,) = writer.views_of({**data, "colors": [np.full((*SHAPE, 3), 0.25)]}, (50, 50, 29.5, 19.5))
    np.testing.assert_allclose(same.depth, first.depth, rtol=1e-6)
    assert (same.ideal == 0.25).all()


def test_blenderproc_writer_writes_what_the_camera_records(tmp_path: Path) -> None:
    files = writer.write_codes(tmp_path / "codes", blenderproc(), K, seed=4, f_number=4.0)
    assert len(files) == 2 * 5 + 1
    about = json.loads((tmp_path / "codes" / "camera.json").read_text())
    assert [frame["name"] for frame in about["frames"]] == ["frame_0000", "frame_0001"]
    codes = []
    with clspeckle.Pipeline.from_parameters(SHAPE, **about["camera"]) as camera:
        for number in (0, 1):
            light = np.load(tmp_path / "codes" / f"frame_{number:04d}.ideal.npy")
            codes.append(camera.render(light, refresh="all"))
            with Image.open(tmp_path / "codes" / f"frame_{number:04d}.codes.png") as image:
                assert np.array_equal(np.array(image), codes[-1])
        # The last frame alone, by its index.
        alone = camera.render(light, frame_index=about["frames"][1]["frame_index"], refresh="all")
        assert np.array_equal(alone, codes[1])
    assert not np.array_equal(*codes), "speckle of its own"
    # A shorter run leaves no frame of the longer one, and what is not of a run.
    (tmp_path / "codes" / "frame_notes.txt").touch()
    shorter = {key: images[:1] for key, images in blenderproc().items()}
    files = writer.write_codes(tmp_path / "codes", shorter, K, seed=4, f_number=4.0)
    assert {*(tmp_path / "codes").iterdir()} == {*files, tmp_path / "codes" / "frame_notes.txt"}
    # With a pattern the colors are left aside: light is that of the geometry.
    texels = np.random.default_rng(1).random((64, 64)).astype(np.float32)
    with clspeckle.Pattern(texels) as pattern:
        diffuse = [np.full((*SHAPE, 3), 0.7, np.float32)] * 2
        data = blenderproc(diffuse=diffuse, colors=None)
        writer.write_codes(tmp_path / "lit", data, K, pattern=pattern)
        depth, normal, _ = leaning_wall()
        depth[:3] = 0
        geometry = clspeckle.Geometry(
            depth=depth.astype(np.float32),
            intrinsics=K,
            normal=np.broadcast_to(normal, (*SHAPE, 3)).astype(np.float32),
            albedo=np.full(SHAPE, 0.7, np.float32),
        )
        expected = pattern.lookup(geometry)
    np.testing.assert_allclose(np.load(tmp_path / "lit" / "frame_0000.ideal.npy"), expected, rtol=1e-3, atol=1e-6)
    assert expected.max() > 0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"depth": None}, "has no depth; call bproc.renderer.enable_depth_output"),
        ({"normals": None}, r"has no normals; call bproc.renderer.enable_normals_output\(\)"),
        ({"colors": None}, "has no colors, which are the light; give a pattern"),
        ({"colors": []}, "expected lists of one length"),
        ({"depth": [np.ones((2, *SHAPE), np.float32)] * 2}, "Of a stereo pair give one side"),
        ({"colors": [np.ones((3, 4, 3), np.uint8)] * 2}, "one size for all"),
        ({"colors": [np.ones((*SHAPE, 3), np.uint16)] * 2}, "have dtype uint16; expected uint8"),
        ({"normals": [np.full((*SHAPE, 3), -0.5, np.float32)] * 2}, "expected 0 to 1"),
        ({"colors": [np.full((*SHAPE, 3), np.nan, np.float32)] * 2}, "view 0: ideal is nan to nan; expected finite"),
        ({"colors": [np.full((*SHAPE, 3), -1, np.float32)] * 2}, "view 0: ideal is -1 to -1; expected finite"),
    ],
    ids=str,
)
def test_what_blenderproc_does_not_return_is_refused(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=words):
        writer.write_codes(tmp_path / "codes", blenderproc(**changes), K)
    assert not (tmp_path / "codes").exists()


def test_no_camera_matrix_is_refused() -> None:
    for wrong in (np.eye(4), [[50, 1, 3], [0, 50, 2], [0, 0, 1]], [0, 1, 2, 3]):
        with pytest.raises(SceneError, match=r"give bproc\.camera.get_intrinsics_as_K_matrix"):
            writer.views_of(blenderproc(), wrong)
    with pytest.raises(SceneError, match=r"has no diffuse; call bproc.renderer.enable_diffuse_color_output\(\)"):
        writer.views_of(blenderproc(), K, with_light=False)
    for scale in (0, -1, float("nan"), float("inf")):
        with pytest.raises(SceneError, match=r"metres_per_unit is .*; expected a finite number above 0"):
            writer.views_of(blenderproc(), K, metres_per_unit=scale)


def test_exr_files_are_read_as_openexr_reads_them(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    given = {
        "Layer.Depth.Z": random.random((5, 7)).astype(np.float32),
        "Layer.Normal.X": random.random((5, 7)).astype(np.float16),
        "Layer.IndexMA.X": random.integers(0, 9, (5, 7)).astype(np.uint32),
    }

    def save(compression: Any) -> Path:
        path = tmp_path / "file.exr"
        OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, dict(given)).write(str(path))
        return path

    read = passes.read_exr(save(OpenEXR.NO_COMPRESSION))
    assert set(read) == set(given)
    assert all(np.array_equal(read[name], given[name]) for name in given)
    whole = (tmp_path / "file.exr").read_bytes()
    empty = whole.replace(struct.pack("<4i", 0, 0, 6, 4), struct.pack("<4i", 0, 0, 6, -3))
    assert empty != whole
    for wrong in (empty, whole.replace(b"dataWindow", b"dataWindoX"), *(whole[:end] for end in range(len(whole)))):
        (tmp_path / "file.exr").write_bytes(wrong)
        with pytest.raises(SceneError, match=r"is cut off or no uncompressed EXR; save it again|no EXR file of one"):
            passes.read_exr(tmp_path / "file.exr")
    with pytest.raises(SceneError, match="is compressed"):
        passes.read_exr(save(OpenEXR.ZIP_COMPRESSION))
    (tmp_path / "file.exr").write_bytes(struct.pack("<II", 20000630, 0x1002))
    with pytest.raises(SceneError, match="no EXR file of one part"):
        passes.read_exr(tmp_path / "file.exr")


def rotation(axis: int, angle: float) -> np.ndarray:
    i, j = [k for k in range(3) if k != axis]
    turn = np.eye(3)
    turn[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return turn


def test_a_directed_laser_looks_along_its_own_axis() -> None:
    """What lies on Blender's -z of the laser lies on our z of it; a point light looks where the camera does."""
    pose, laser = np.eye(4), np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(0, 1.1) @ rotation(2, 0.4), (1, 2, 3)
    laser[:3, :3] = pose[:3, :3] @ rotation(1, 0.2) @ rotation(2, 0.7)
    laser[:3, 3] = pose[:3, 3] + pose[:3, 0] * 0.1
    way = np.stack([*np.meshgrid((np.arange(8) - 3.5) / 9, (np.arange(6) - 2.5) / 9), np.ones((6, 8))], axis=-1)
    world = (2 * way * (1, -1, -1)) @ pose[:3, :3].T + pose[:3, 3]
    to_laser = laser[:3, 3] - world
    light = (to_laser @ pose[:3, 2]) / np.linalg.norm(to_laser, axis=-1) ** 3
    planes = {
        "L.Depth.V": np.full((6, 8), 2.0),
        **{f"L.Normal.{axis}": np.full((6, 8), pose[i, 2]) for i, axis in enumerate("XYZ")},
        **{f"L.Position.{axis}": world[..., i] for i, axis in enumerate("XYZ")},
        **{f"L.Diffuse Color.{part}": np.full((6, 8), 0.5) for part in "RGB"},
        **{f"L.Diffuse Direct.{part}": light for part in "RGB"},
        "L.Material Index.X": np.ones((6, 8)),
    }
    about = {
        "layer": "L", "width": 8, "height": 6, "lens_mm": 9.0, "sensor_mm": [8.0, 6.0], "sensor_fit": "HORIZONTAL",
        "shift": [0, 0], "world_from_camera": pose.tolist(), "world_from_laser": laser.tolist(),
    }  # fmt: skip
    ours_from_blender = np.diag([1, -1, -1])
    for directed in (True, False):
        seen = passes.scene_of(planes, {**about, "laser_is_directed": directed})
        assert seen.visibility.all()
        ahead = laser[:3, 3] - 1.5 * laser[:3, 2] + 0.2 * laser[:3, 0]
        in_camera = ours_from_blender @ pose[:3, :3].T @ (ahead - pose[:3, 3])
        in_laser = seen.laser_from_camera @ [*in_camera, 1]
        if directed:
            np.testing.assert_allclose(in_laser, [0.2, 0, 1.5], atol=1e-9)
        else:
            np.testing.assert_allclose(in_laser, in_camera - [0.1, 0, 0], atol=1e-9)


IN_BLENDER = """
import json, math, sys
sys.path.insert(0, {examples!r})
import bpy
import sample_scene  # the table is 0.42 m below the camera, the wall 1.60 m before it
sys.path.remove({examples!r})
bpy.ops.preferences.addon_install(filepath={archive!r}, overwrite=True)
bpy.ops.preferences.addon_enable(module="clspeckle_camera")
scene = bpy.context.scene
given = scene.clspeckle
scene.render.resolution_percentage = 50
lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
scene.collection.objects.link(lamp)
told = []

def state():
    owners = (scene.render, scene.render.image_settings, scene.cycles, bpy.context.view_layer, scene.camera.data.dof)
    values = [[o.name, o.hide_render] for o in scene.objects] + [len(bpy.data.lights), scene.frame_current]
    for owner in owners:
        for p in owner.bl_rna.properties:
            if p.type in ("BOOLEAN", "INT", "FLOAT", "STRING", "ENUM") and not getattr(p, "is_array", False):
                values.append([p.identifier, str(getattr(owner, p.identifier))])
    return values

def record():
    before = state()
    try:
        result = list(bpy.ops.clspeckle.record())
    except RuntimeError as error:  # what self.report says, called from Python
        result = str(error)
    assert state() == before, [pair for pair in zip(state(), before) if pair[0] != pair[1]]
    told.append(result)

record()
given.laser = bpy.data.objects["Laser"]
record()
given.folder = {out!r}
given.seed = 12
given.f_number, given.bits = 4.0, 12
record()
given.folder = {out!r} + "/animation"
given.animation = True
scene.frame_start, scene.frame_end = 1, 2
laser = bpy.data.objects["Laser"]
laser.keyframe_insert("location", frame=1)
laser.location.x += 0.1
laser.keyframe_insert("location", frame=2)
record()
given.animation = False
given.laser = bpy.data.objects["Camera"]  # no light, so it looks along its -z, which is the camera's own
given.folder = {out!r} + "/own"
record()
scene.camera.data.type = "ORTHO"
record()
scene.camera.data.type = "PERSP"
given.folder = {out!r} + "/camera.json"  # a file
record()
sys.modules["clspeckle"] = None
record()
given.f_number = 1000
told.append(given.f_number)
bpy.ops.preferences.addon_disable(module="clspeckle_camera")
told.append(hasattr(bpy.types.Scene, "clspeckle"))
print("TOLD", json.dumps(told))
"""


@pytest.fixture(scope="module")
def blender(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python with Blender as a module, of PyPI."""
    folder = tmp_path_factory.mktemp("blender")
    version = os.environ.get("CLSP_BPY", "bpy==4.2.*")
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = folder / "bin" / "python"
    done = subprocess.run(
        [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", version],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode == 0:
        done = subprocess.run([python, "-c", "import bpy"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"{version} cannot be had: {done.stderr.strip().splitlines()[-1]}")
    return python


@pytest.mark.nightly
def test_addon_records_in_blender(blender: Path, tmp_path: Path) -> None:
    archive, out = tmp_path / "clspeckle_camera.zip", tmp_path / "out"
    subprocess.run([sys.executable, BLENDER / "make_addon.py", archive], check=True)
    script = tmp_path / "script.py"
    script.write_text(IN_BLENDER.format(examples=str(BLENDER), archive=str(archive), out=str(out)))
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user")}
    environment["PYTHONPATH"] = os.path.dirname(os.path.dirname(clspeckle.__file__))
    done = subprocess.run(
        [blender, script], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    told = json.loads(done.stdout.rpartition("TOLD ")[2].splitlines()[0])
    assert "no object is named as the laser" in told[0]
    assert "beside a file that is not saved; save it, or name another one" in told[1]
    assert told[2:5] == [["FINISHED"]] * 3
    assert "no perspective camera" in told[5]
    assert "File exists" in told[6] or "Not a directory" in told[6]
    assert "clspeckle cannot be imported" in told[7]
    assert told[8:] == [64.0, False], "the range of the f-number, and nothing is left"

    about = json.loads((out / "camera.json").read_text())
    assert about["camera"]["bits"] == 12
    assert about["source"].startswith("Blender ")
    view = View(
        tuple(about["frames"][0]["intrinsics"]),
        *(np.load(out / f"frame_0000.{kind}.npy") for kind in ("depth", "normal", "albedo", "ideal")),
    )
    (again,) = record([view], **about["camera"])
    with Image.open(out / "frame_0000.codes.png") as image:
        assert np.array_equal(np.array(image), again.codes)
    # The planes of the scene are where they stand; their normals point to the camera.
    points = view.rays() * view.depth[..., None]
    for normal, distance, albedos in (([0, 0, 0], 1.60, (0.75,)), ([0, 0, 0], 0.42, (0.55, 0.33))):
        own = np.isclose(view.albedo[..., None], albedos, atol=2e-3).any(axis=-1)
        normal = np.median(view.normal[own], axis=0)
        apart = -(points[own] @ normal)
        assert own.sum() > 1000
        assert np.median(apart) == pytest.approx(distance, abs=5e-4)
        assert np.mean(np.abs(apart - distance) < 1e-3) > 0.98
    assert np.mean(view.ideal > 0.2 * view.ideal.max()) < 0.2, "dots"

    moved = json.loads((out / "animation" / "camera.json").read_text())
    assert moved["blender_frames"] == [1, 2]
    one, two = (np.load(out / "animation" / f"frame_{n:04d}.ideal.npy") for n in (0, 1))
    assert np.array_equal(one, view.ideal)
    assert not np.array_equal(one, two)
    # From the camera's own place every dot is where the pattern has it, whatever the depth.
    own = np.load(out / "own" / "frame_0000.ideal.npy")
    ones = np.ones(own.shape, np.float32)
    facing = np.broadcast_to(np.float32([0, 0, -1]), (*own.shape, 3))
    half = np.tan(np.radians(75) / 2)
    side = int(np.ceil(2 * half / (2e-3 / 2.5)))
    texels = passes.camera_view.random_dots(4000, 12, side, side, 2e-3 * side / (2 * half))
    with clspeckle.Pattern(texels, half_extent_x=half, half_extent_y=half, filter="area") as pattern:
        expected = pattern.lookup(View(view.intrinsics, ones, facing, ones).geometry())
    # Brightness falls with depth and albedo: compared is where dots are.
    dots = [(light > 0.2 * np.percentile(light, 99)).ravel() for light in (own, expected)]
    assert np.corrcoef(*dots)[0, 1] > 0.6
