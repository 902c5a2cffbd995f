"""Scenes from elsewhere: the G-buffers that the examples hold, and the scripts that made them, with known answers."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
DEPTH_MAP = EXAMPLES / "depth_map" / "depth_map_to_gbuffers.py"
BLENDER = EXAMPLES / "blender" / "passes_to_gbuffers.py"


def read(path: Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as stored:
        return {name: channel.pixels for name, channel in stored.channels().items()}


def sequence(folder: Path) -> tuple[dict, dict[str, np.ndarray], np.ndarray]:
    """sequence.json, the first frame in float64, and the rays of its pixels."""
    about = json.loads((folder / "sequence.json").read_text())
    frame = {name: plane.astype(float) for name, plane in read(folder / about["frames"][0]).items()}
    view = about["camera"]
    y, x = np.indices((about["height"], about["width"]))
    rays = np.stack([(x - view["cx_px"]) / view["fx_px"], (y - view["cy_px"]) / view["fy_px"], np.ones(x.shape)], -1)
    return about, frame, rays


def normals(frame: dict[str, np.ndarray]) -> np.ndarray:
    return np.stack([frame[f"N.{axis}"] for axis in "XYZ"], axis=-1)


def run(script: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, script, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=300
    )


def plane_of(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Unit normal of the plane that fits best, and the largest distance from it."""
    offset = points - points.mean(axis=0)
    normal = np.linalg.svd(offset, full_matrices=False)[2][2]
    return normal, float(np.abs(offset @ normal).max())


@pytest.mark.parametrize("name", ["depth_map", "blender"])
def test_stored_sequences_are_sound(name: str) -> None:
    folder = EXAMPLES / name / "gbuffers"
    about, frame, rays = sequence(folder)
    assert frame["Z"].shape == (about["height"], about["width"])
    assert all(np.isfinite(plane).all() for plane in frame.values())
    hit = frame["Z"] > 0
    assert (frame["Z"] >= 0).all()
    assert hit.mean() > 0.9
    length = np.linalg.norm(normals(frame), axis=-1)[hit]
    # Rounded for storage, never longer than 1 by more than a half's own rounding.
    assert length.min() > 0.95
    assert length.max() < 1.001
    # Towards the camera, but for steep surfaces whose normals are rounded to 1/32.
    assert (normals(frame) * rays).sum(axis=-1)[hit].max() < 0.06
    assert ((frame["albedo"] >= 0) & (frame["albedo"] <= 1)).all()
    assert np.isin(frame["visibility"], (0, 1)).all()
    assert not frame["visibility"][~hit].any()
    laser = -np.array(about["laser"]["laser_from_geometry"]).reshape(3, 4)[:, 3]
    way = laser - rays * frame["Z"][..., None]
    facing = (normals(frame) * way).sum(axis=-1) / np.linalg.norm(way, axis=-1)
    assert facing[frame["visibility"] > 0].min() > -0.05
    assert 0.9 < frame["visibility"][hit].mean() < 0.99
    # The list of dots is what the picture shows: its brightest texels.
    pattern = about["laser"]["pattern"]
    with Image.open(folder / pattern["file"]) as image:
        texels = np.array(image)
    row, column = np.nonzero(texels == texels.max())
    x = pattern["half_extent_x"] * (2 * (column + 0.5) / texels.shape[1] - 1)
    y = pattern["half_extent_y"] * (2 * (row + 0.5) / texels.shape[0] - 1)
    listed = np.loadtxt(folder / "dots.txt")
    assert len(listed) == len(row)
    order, listed_order = np.lexsort((x, y)), np.lexsort((listed[:, 0], listed[:, 1].round(5)))
    np.testing.assert_allclose(listed[listed_order], np.stack([x, y], axis=1)[order], atol=1e-6)


def test_blender_depth_reprojects_to_its_planes_and_sphere() -> None:
    """sample_scene.py: a table, a wall 1.60 m in front of the camera, 0.42 m above the table; a ball of 7 cm."""
    about, frame, rays = sequence(EXAMPLES / "blender" / "gbuffers")
    ids = {entry["name"]: entry["id"] for entry in about["materials"]}
    points = rays * frame["Z"][..., None]
    found = {}
    for name, distance in (("table", 0.42), ("wall", 1.60)):
        own = points[frame["material"] == ids[name]]
        normal, off = plane_of(own)
        # A depth is rounded to 16 bits: 15 um at 1 m, and rays pass within 0.005 px of the centres.
        assert off < 1e-4
        assert abs(own.mean(axis=0) @ normal) == pytest.approx(distance, abs=5e-5)
        stored = normals(frame)[frame["material"] == ids[name]]
        assert np.abs(np.abs(stored @ normal) - 1).max() < 0.01
        found[name] = normal
    assert abs(found["table"] @ found["wall"]) < 1e-4
    ball = points[frame["material"] == ids["ball"]]
    solved = np.linalg.lstsq(np.column_stack([2 * ball, np.ones(len(ball))]), (ball**2).sum(axis=1), rcond=None)[0]
    assert np.sqrt(solved[3] + solved[:3] @ solved[:3]) == pytest.approx(0.07, abs=2e-4)


# A map with a known answer: a wall that leans back, and a square sheet before it.
SHAPE, FOCAL, BASELINE = (150, 200), 400.0, 0.1
SHEET = np.s_[40:110, 90:130]
SHEET_M, LASER_M = 0.9, 0.075


def true_inverse() -> np.ndarray:
    v = (np.arange(SHAPE[0]) - (SHAPE[0] - 1) / 2) / FOCAL
    inverse = np.repeat((1 / 1.2 - 0.5 * v)[:, None], SHAPE[1], axis=1)
    inverse[SHEET] = 1 / SHEET_M
    return inverse


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photo.png"
    Image.fromarray(np.full((*SHAPE, 3), 128, np.uint8)).save(path)
    return path


def save_disparity(folder: Path) -> Path:
    """In whole quarters of a pixel, with a hole."""
    disparity = np.rint(4 * true_inverse() * FOCAL * BASELINE).astype(np.uint16)
    disparity[5:9, 5:9] = 0
    path = folder / "disparity.png"
    Image.fromarray(disparity).save(path)
    return path


def test_depth_map_gives_depth_normals_and_shadow(tmp_path: Path, photo: Path) -> None:
    out = tmp_path / "out"
    done = run(
        DEPTH_MAP,
        *("--disparity", save_disparity(tmp_path), "--photo", photo, "--focal-px", FOCAL, "--baseline-m", BASELINE),
        *("--disparity-scale", 4, "-o", out),
    )
    assert done.returncode == 0, done.stderr
    _, frame, _ = sequence(out)
    inverse = true_inverse()
    hole = np.zeros(SHAPE, bool)
    hole[5:9, 5:9] = True
    assert np.array_equal(frame["Z"] == 0, hole)
    # Never farther off than a step of the map, a quarter of a pixel, and smoother than that inside.
    step = 0.25 / (FOCAL * BASELINE)
    error = np.where(hole, 0, 1 / np.where(hole, 1, frame["Z"]) - inverse)
    assert np.abs(error).max() < step
    inside = np.s_[20:130, 150:190]
    assert error[inside].std() < 0.15 * step
    normal = np.array([0, 0.5, -1 / 1.2])
    assert np.abs(normals(frame)[inside] - normal / np.linalg.norm(normal)).max() < 0.05
    # The laser stands to the right: the sheet's shadow falls to its left, by the parallax of the two depths.
    dark = frame["visibility"][75] == 0
    parallax = FOCAL * LASER_M * (1 / SHEET_M - inverse[75, 0])
    assert dark[SHEET[1]].sum() == 0
    assert dark[:90].sum() == pytest.approx(parallax, abs=2.0)
    assert dark[int(90 - parallax / 2)]
    assert not dark[132:].any()
    assert np.abs(frame["albedo"] - 0.8).max() < 1e-3


def test_depth_in_millimetres_gives_the_same_surfaces(tmp_path: Path, photo: Path) -> None:
    depth = np.rint(1000 / true_inverse()).astype(np.uint16)
    Image.fromarray(depth).save(tmp_path / "depth.png")
    out = tmp_path / "out"
    done = run(DEPTH_MAP, "--depth", tmp_path / "depth.png", "--photo", photo, "--focal-px", FOCAL, "-o", out)
    assert done.returncode == 0, done.stderr
    _, frame, _ = sequence(out)
    assert np.abs(frame["Z"] - 1 / true_inverse()).max() < 1e-3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--disparity", "none.png"], "none.png is not a file"),
        (["--disparity", "photo.png", "--baseline-m", 0.1], "a map has one real number per pixel"),
        (["--disparity", "zero.png", "--baseline-m", 0.1], "every pixel is unknown"),
        (["--disparity", "map.png"], "a disparity needs --baseline-m"),
        (["--disparity", "map.png", "--baseline-m", 0.1, "--disparity-offset-px", -1000], "no depth"),
        (["--depth", "small.png"], "they must be of the same view"),
        (["--depth", "map.png", "--laser-x-m", 9], "put the laser nearer to the camera"),
        (["--depth", "map.png", "--jump", 2], "--jump must lie in"),
        (["--depth", "map.png", "--laser-x-m", 0], "the laser must stand beside the camera"),
        (["--depth", "map.png", "--width", 1], "--width must lie in 32 to 8192"),
        ([], "one of the arguments --disparity --depth is required"),
    ],
)
def test_depth_map_refuses(tmp_path: Path, photo: Path, arguments: list, words: str) -> None:
    Image.fromarray(np.full(SHAPE, 900, np.uint16)).save(tmp_path / "map.png")
    Image.fromarray(np.zeros(SHAPE, np.uint8)).save(tmp_path / "zero.png")
    Image.fromarray(np.full((50, 60), 900, np.uint16)).save(tmp_path / "small.png")
    given = [tmp_path / a if isinstance(a, str) and a.endswith(".png") else a for a in arguments]
    baseline = ["--baseline-m", 0.1] if arguments[1:2] == ["none.png"] else []
    out = tmp_path / "out"
    done = run(DEPTH_MAP, *given, *baseline, "--photo", photo, "--focal-px", FOCAL, "-o", out)
    assert done.returncode != 0
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (out / "sequence.json").exists()


# Passes as Blender writes them, of a wall across the view: its camera looks along -z with y up.
WIDTH, HEIGHT, LENS = 64, 48, 50.0


def save_passes(
    folder: Path, radial: bool = False, wall_m: float = 1.5, light: float = 0.25, **changes: object
) -> Path:
    """A camera at (1, 2, 3) that looks along the world's +y, its x along the world's x; a wall at y = 2 + wall_m."""
    folder.mkdir(exist_ok=True)

    def pose(place: tuple[float, float, float]) -> list[list[float]]:
        turn = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))  # columns: the camera's axes in the world
        return [[*row, x] for row, x in zip(turn, place)] + [[0.0, 0.0, 0.0, 1.0]]

    view = {
        "layer": "ViewLayer",
        "width": WIDTH,
        "height": HEIGHT,
        "pixel_aspect": [1, 1],
        "lens_mm": LENS,
        "sensor_mm": [36.0, 24.0],
        "sensor_fit": "AUTO",
        "shift": [0.1, -0.2],
        "metres_per_unit": 1.0,
        "world_from_camera": pose((1.0, 2.0, 3.0)),
        "world_from_laser": pose((1.08, 2.0, 3.0)),
        "materials": [{"id": 1, "name": "wall"}],
        **changes,
    }
    focal = LENS / 36.0 * WIDTH
    y, x = np.indices((HEIGHT, WIDTH))
    # Shift moves the frame over the image plane, in parts of the longer side: right and up.
    u = (x - (WIDTH - 1) / 2) / focal + 0.1 * WIDTH / focal
    v = -((y - (HEIGHT - 1) / 2) / focal) - 0.2 * WIDTH / focal
    points = np.stack([1 + wall_m * u, np.full(u.shape, 2 + wall_m), 3 + wall_m * v], axis=-1)
    way = np.array([1.08, 2, 3]) - points
    distance = np.linalg.norm(way, axis=-1)
    shining = light * -way[..., 1] / distance**3
    shining[10:20, 10:20] = 0  # something that is not in the picture stands before the laser
    depth = wall_m * (np.sqrt(1 + u**2 + v**2) if radial else np.ones(u.shape))
    depth[0, 0] = 1e10
    planes = {
        "Depth.Z": depth,
        **{f"Normal.{axis}": np.full(u.shape, value) for axis, value in zip("XYZ", (0.0, -1.0, 0.0))},
        **{f"Position.{axis}": points[..., i] for i, axis in enumerate("XYZ")},
        **{f"DiffCol.{part}": np.full(u.shape, 0.6) for part in "RGB"},
        **{f"DiffDir.{part}": shining for part in "RGB"},
        "IndexMA.X": np.ones(u.shape),
    }
    channels = {f"ViewLayer.{name}": np.ascontiguousarray(plane, np.float32) for name, plane in planes.items()}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(
        str(folder / "passes.exr")
    )
    (folder / "view.json").write_text(json.dumps(view))
    return folder


@pytest.mark.parametrize("radial", [False, True])
def test_passes_become_our_frame(tmp_path: Path, radial: bool) -> None:
    out = tmp_path / "out"
    done = run(BLENDER, save_passes(tmp_path / "passes", radial), "-o", out)
    assert done.returncode == 0, done.stderr
    assert f"depth along the {'rays' if radial else 'axis'}" in done.stdout
    about, frame, _ = sequence(out)
    assert frame["Z"][0, 0] == 0
    frame["Z"][0, 0] = 1.5
    np.testing.assert_allclose(frame["Z"], 1.5, atol=1e-6)
    np.testing.assert_allclose(normals(frame)[1:], np.broadcast_to([0, 0, -1], (HEIGHT - 1, WIDTH, 3)), atol=1e-6)
    np.testing.assert_allclose(frame["albedo"], 0.6, atol=1e-3)
    view = about["camera"]
    assert view["fx_px"] == pytest.approx(LENS / 36 * WIDTH)
    assert view["cx_px"] == pytest.approx((WIDTH - 1) / 2 - 0.1 * WIDTH)
    assert view["cy_px"] == pytest.approx((HEIGHT - 1) / 2 - 0.2 * WIDTH)
    pose = np.array(about["laser"]["laser_from_geometry"]).reshape(3, 4)
    np.testing.assert_allclose(pose, [[1, 0, 0, -0.08], [0, 1, 0, 0], [0, 0, 1, 0]], atol=1e-7)
    assert not frame["visibility"][10:20, 10:20].any()
    assert frame["visibility"].sum() == WIDTH * HEIGHT - 100 - 1


def test_passes_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "out"

    def said(folder: Path) -> str:
        done = run(BLENDER, folder, "-o", out)
        assert done.returncode == 1
        assert "Traceback" not in done.stderr
        assert not (out / "sequence.json").exists()
        return done.stderr

    assert "view.json cannot be read" in said(tmp_path / "nothing")
    assert "contradict each other" in said(save_passes(tmp_path / "lens", lens_mm=40.0))
    assert "64 x 48 pixels, view.json says 64 x 40" in said(save_passes(tmp_path / "size", height=40))
    assert "pixels must be square" in said(save_passes(tmp_path / "aspect", pixel_aspect=[1, 2]))
    behind = [[1.0, 0, 0, 1.0], [0, 0, -1, 6.0], [0, 1, 0, 3.0], [0, 0, 0, 1]]
    assert "the laser lights nothing" in said(save_passes(tmp_path / "dark", light=0.0))
    assert "put it beside the camera" in said(save_passes(tmp_path / "behind", world_from_laser=behind))
    assert "no channel 'Other.Depth.Z'" in said(save_passes(tmp_path / "layer", layer="Other"))
    bare = save_passes(tmp_path / "bare")
    (bare / "view.json").write_text('{"layer": "ViewLayer"}')
    assert "lacks width, height" in said(bare)
    (bare / "view.json").write_text("no JSON")
    assert "is not JSON" in said(bare)
    broken = save_passes(tmp_path / "broken")
    (broken / "passes.exr").write_bytes(b"no EXR")
    assert "not a readable EXR file" in said(broken)
