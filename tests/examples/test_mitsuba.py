"""A scene of Mitsuba 3: what is read of it against closed forms, its light against clSpeckle's own, and codes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image

import clspeckle

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples" / "mitsuba"))
mi.set_variant("scalar_rgb")
import mitsuba_to_codes as example  # noqa: E402
from camera_view import SceneError, View, record  # noqa: E402

WIDTH, HEIGHT, FOV, SHIFT = 120, 90, 50.0, (0.1, -0.05)
FOCAL = WIDTH / 2 / np.tan(np.radians(FOV) / 2)
POSE = mi.ScalarTransform4f().translate([3, -2, 5]).rotate([2 / 3, 2 / 3, -1 / 3], 77)  # of our frame in the world


def diffuse(albedo: float) -> dict[str, Any]:
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}


def look(x: float) -> Any:
    """The pose of what stands at x and looks along our z, with our y down."""
    return POSE @ mi.ScalarTransform4f().look_at(origin=[x, 0, 0], target=[x, 0, 1], up=[0, -1, 0])


def scene(unit: float = 1.0, **changes: Any) -> dict[str, Any]:
    """A wall that leans and a ball, in our frame; `unit`: how many of the scene's lengths are a metre."""
    sensor = {
        "type": "perspective",
        "fov": FOV,
        "near_clip": 0.2 * unit,
        "far_clip": 100 * unit,
        "principal_point_offset_x": SHIFT[0],
        "principal_point_offset_y": SHIFT[1],
        "to_world": look(0),
        "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT},
    }
    wall = POSE @ mi.ScalarTransform4f().translate([0, 0, 1.5 * unit]).rotate([0, 1, 0], 30).scale(5 * unit)
    ball = POSE @ mi.ScalarPoint3f([0.1 * unit, 0.05 * unit, 0.9 * unit])
    return {
        "type": "scene",
        "sensor": {**sensor, **changes.pop("sensor", {})},
        "wall": {"type": "rectangle", "to_world": wall, "bsdf": {"type": "twosided", "bsdf": diffuse(0.6)}},
        "ball": {"type": "sphere", "center": ball, "radius": 0.15 * unit, "bsdf": diffuse(0.8)},
        **changes,
    }


def closed_form() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth and normals of the wall and the ball in front of it, and where the ball is."""
    y, x = np.indices((HEIGHT, WIDTH))
    # The offsets move the picture by parts of its sides.
    u = (x - ((WIDTH - 1) / 2 - SHIFT[0] * WIDTH)) / FOCAL
    v = (y - ((HEIGHT - 1) / 2 - SHIFT[1] * HEIGHT)) / FOCAL
    way = np.stack([u, v, np.ones(u.shape)], axis=-1)
    facing = np.array([-np.sin(np.radians(30)), 0, -np.cos(np.radians(30))])
    depth = 1.5 * facing[2] / (way @ facing)
    normal = np.broadcast_to(facing, way.shape).copy()
    centre, radius = np.array([0.1, 0.05, 0.9]), 0.15
    along = way @ centre / (way**2).sum(axis=-1)
    inside = along**2 - (centre @ centre - radius**2) / (way**2).sum(axis=-1)
    ball = inside > 0
    near = along - np.sqrt(np.where(ball, inside, 0))
    depth[ball] = near[ball]
    normal[ball] = ((way * near[..., None] - centre) / radius)[ball]
    return depth, normal, ball


@pytest.mark.parametrize("unit", [1.0, 1000.0], ids=["metres", "millimetres"])
def test_depth_normals_and_albedo_are_those_of_a_plane_and_a_sphere(unit: float) -> None:
    view = example.view_of(scene(unit), metres_per_unit=1 / unit, samples=1)
    depth, normal, ball = closed_form()
    assert ball.sum() > 1000
    # Mitsuba counts in float32, the ball's rim is steep.
    inside = np.abs((normal * view.rays()).sum(axis=-1)) > 0.1
    assert np.abs(view.depth / depth - 1)[inside].max() < 2e-5
    assert np.abs(view.normal - normal)[inside].max() < 1e-3
    assert np.abs(view.depth / depth - 1).max() < 1e-2
    np.testing.assert_allclose(view.albedo, np.where(ball, 0.8, 0.6), atol=1e-6)
    assert view.intrinsics[:2] == pytest.approx((FOCAL, FOCAL), rel=1e-6)


def test_light_is_that_of_our_pattern() -> None:
    """A projector of Mitsuba and a Pattern of clSpeckle light a wall alike, where no dot has its edge.

    Mitsuba's irradiance is pi times what it says, so that it is the radiance of a white wall.
    """
    texels = np.full((48, 64), 0.1, np.float32)
    texels[15:19, 20:24], texels[28:34, 36:42] = 1.0, 0.5
    image = mi.Bitmap(np.repeat(texels[..., None], 3, axis=-1))
    projector = {"type": "projector", "fov": 90, "irradiance": {"type": "bitmap", "bitmap": image, "raw": True}}
    given = scene(projector={**projector, "to_world": look(0.05)})
    del given["ball"]
    view = example.view_of(given, samples=16)
    pattern = clspeckle.Pattern(
        texels,
        quantity="plane_irradiance",
        half_extent_x=1.0,
        half_extent_y=0.75,
        laser_from_geometry=np.array([[1, 0, 0, -0.05], [0, 1, 0, 0], [0, 0, 1, 0.0]]),
    )
    ours = np.pi * pattern.lookup(view.geometry())
    ratio = view.ideal / ours
    assert np.median(ratio) == pytest.approx(1, abs=1e-4)
    assert np.mean(np.abs(ratio - 1) < 0.05) > 0.97, "all but pixels at edges"
    assert np.corrcoef(view.ideal.ravel(), ours.ravel())[0, 1] > 0.999
    # Nothing blocks the projector here: the same light without Mitsuba's gives the same codes but for the edges.
    dark = View(view.intrinsics, view.depth, view.normal, view.albedo)
    (mitsubas,), (ours_too,) = record([view], seed=3), record([dark], pattern=pattern, seed=3)
    assert ours_too.camera["exposure_gain_dn"] == pytest.approx(np.pi * mitsubas.camera["exposure_gain_dn"], rel=0.01)
    assert np.mean(np.abs(mitsubas.codes - ours_too.codes.astype(float)) <= 2 + 0.02 * ours_too.codes) > 0.9


def test_from_scene_to_codes_in_one_call() -> None:
    given = scene(lamp={"type": "constant", "radiance": {"type": "rgb", "value": 2.0}})
    result = example.codes_of(given, samples=4, seed=5, f_number=4.0, degree_of_polarization=0.0)
    assert result.codes.shape == (HEIGHT, WIDTH)
    assert result.codes.dtype == np.uint16
    with clspeckle.Pipeline.from_parameters((HEIGHT, WIDTH), **result.camera) as camera:
        assert np.array_equal(camera.render(result.view.ideal, refresh="all"), result.codes)
    assert not np.array_equal(example.codes_of(given, samples=4, seed=6, f_number=4.0).codes, result.codes)
    # A uniform lamp is all around: the wall reflects its albedo of it, and some of the ball's.
    wall = ~closed_form()[2]
    assert np.median(result.view.ideal[wall]) == pytest.approx(2 * 0.6, rel=0.1)
    # Speckle's mean is the light, of which the brightest thousandth is half of full scale above the black level.
    signal = result.codes - clspeckle.Sensor.defaults()["black_level_dn"]
    light = result.view.ideal
    assert signal.mean() == pytest.approx(0.5 * 1023 * light.mean() / np.percentile(light, 99.9), rel=0.05)
    contrast = signal[wall].std() / signal[wall].mean()
    assert 0.4 < contrast < 0.75, "0.707 of light without polarization, less by the pixels' area"


def test_command_writes_all_or_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    script, out = ROOT / "examples" / "mitsuba" / "mitsuba_to_codes.py", tmp_path / "codes"
    words = ["-o", out, "--size", 160, 120, "--samples", 4, "--figure", tmp_path / "figure.png"]
    done = subprocess.run(
        [sys.executable, script, *map(str, words)], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "depth 0.750 to 1.500 m" in done.stdout
    assert (tmp_path / "figure.png").stat().st_size > 10000
    about = json.loads((out / "camera.json").read_text())
    assert about["source"] == f"Mitsuba {mi.__version__}, scalar_rgb"
    with Image.open(out / "frame_0000.codes.png") as image:
        codes = np.array(image)
    with clspeckle.Pipeline.from_parameters((120, 160), **about["camera"]) as camera:
        assert np.array_equal(camera.render(np.load(out / "frame_0000.ideal.npy"), refresh="all"), codes)
    depth = np.load(out / "frame_0000.depth.npy")
    assert depth.max() == pytest.approx(1.5, rel=1e-6)
    kinds = ("codes.png", "ideal.npy", "depth.npy", "normal.npy", "albedo.npy")
    assert {file.name for file in out.iterdir()} == {"camera.json", *(f"frame_0000.{kind}" for kind in kinds)}
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    (tmp_path / "bad.xml").write_text("<scene version='3.0.0'><shape type='none'/></scene>")
    for words, told in (
        ([tmp_path / "nowhere.xml"], "is not a file"),
        ([tmp_path / "bad.xml"], "Mitsuba does not load it"),
        (["--variant", "none"], "Mitsuba has no variant 'none'"),
        (["--sensor", 3], "the scene has 1, counted from 0"),
        (["--samples", 0], "expected at least 1"),
        (["--seed", -1], "seed is -1; expected 0 to 4294967295"),
        (["--seed", 2**32], "seed is 4294967296; expected 0 to 4294967295"),
        (["--f-number", -1], "f_number"),
    ):
        monkeypatch.setattr(sys, "argv", [str(script), "-o", str(out), "--size", "32", "24", *map(str, words)])
        assert example.main() == 1
        assert told in capsys.readouterr().err
        assert {file.name: file.read_bytes() for file in out.iterdir()} == before
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setattr(sys, "argv", [str(script), "-o", str(out), "--figure", str(tmp_path / "other.png")])
    assert example.main() == 1
    assert "install it: pip install matplotlib" in capsys.readouterr().err
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"type": "thinlens", "aperture_radius": 0.01}, "ThinLensCamera.*which defocus_waves does here"),
        ({"type": "orthographic"}, "is a Orthographic.*expected a perspective one"),
        ({"film": {"type": "hdrfilm", "crop_width": 20, "crop_height": 20}}, "cropped to 20 x 20 of 768 x 576"),
        ({"far_clip": 0.3}, "sees no surface"),
        ({"type": "no_such_sensor"}, "does not load the scene"),
    ],
    ids=str,
)
def test_other_sensors_are_refused(changes: dict[str, Any], words: str) -> None:
    given = scene(sensor=changes)
    if changes.get("type") == "orthographic":
        for name in ("fov", "principal_point_offset_x", "principal_point_offset_y"):
            del given["sensor"][name]
    elif changes.get("type") == "thinlens":
        for name in ("principal_point_offset_x", "principal_point_offset_y"):
            del given["sensor"][name]
    with pytest.raises(SceneError, match=words):
        example.view_of(given, samples=1)


def test_other_scenes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SceneError, match="no light comes to the camera"):
        example.codes_of(scene(), samples=1)
    with pytest.raises(SceneError, match="scene is a str; expected a dict, or a scene"):
        example.view_of("room.xml")
    with pytest.raises(SceneError, match="metres_per_unit 0"):
        example.view_of(scene(), metres_per_unit=0)
    monkeypatch.setattr(mi, "variant", lambda: "scalar_spectral")
    with pytest.raises(SceneError, match="the variant scalar_spectral has spectra"):
        example.view_of(scene())
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(SceneError, match="install it: pip install mitsuba"):
        example.view_of({"type": "scene"})


def test_views_that_do_not_go_together_are_refused() -> None:
    flat = np.ones((4, 5), np.float32)
    view = View((9, 9, 2, 2), flat, np.zeros((4, 5, 3), np.float32), flat)
    with pytest.raises(SceneError, match="there is no view"):
        record([])
    with pytest.raises(SceneError, match="view 0 brings no light and there is no pattern"):
        record([view])
    small = View((9, 9, 2, 2), flat[:3], np.zeros((3, 5, 3), np.float32), flat[:3])
    with pytest.raises(SceneError, match=r"view 1 is of \(3, 5\), the first of \(4, 5\)"):
        record([view, small], pattern=clspeckle.Pattern(flat))


def test_a_view_keeps_its_own_light_beside_a_pattern() -> None:
    flat = np.ones((4, 5), np.float32)
    normal = np.broadcast_to(np.float32([0, 0, -1]), (4, 5, 3))
    dark, lit = View((9, 9, 2, 2), flat, normal, flat), View((9, 9, 2, 2), flat, normal, flat, 3 * flat)
    with clspeckle.Pattern(np.full((8, 8), 0.5, np.float32)) as pattern:
        first, second = record([dark, lit], pattern=pattern, exposure_gain_dn=50)
        assert np.array_equal(first.view.ideal, pattern.lookup(dark.geometry()))
    assert np.array_equal(second.view.ideal, lit.ideal)


@pytest.mark.parametrize(("name", "value"), [("ideal", np.nan), ("ideal", -1), ("depth", -1), ("albedo", np.inf)])
def test_values_that_cannot_be_are_refused(name: str, value: float) -> None:
    images = {key: np.ones((4, 5), np.float32) for key in ("depth", "albedo", "ideal")}
    images[name][1, 2] = value
    with pytest.raises(SceneError, match=f"view 0: {name} is .* to .*; expected finite numbers, at least 0"):
        record([View((9, 9, 2, 2), normal=np.zeros((4, 5, 3), np.float32), **images)])
