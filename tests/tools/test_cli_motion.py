"""Scenes that move: poses of objects, motion channels, materials."""

from __future__ import annotations

import json
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import pytest
from cli_support import frames

WIDTH, HEIGHT = 64, 48
FOCAL = 64.0
LIGHT = ["--format", "float-npy", "--no-sensor", "--no-preview", "--degree-of-polarization", 0, "--seed", 5]
LASTING = {"lateral_correlation_length_m": "inf", "axial_correlation_length_m": "inf"}
CARD = np.s_[16:32, 24:40]
"""Pixels where a card stands in front of the wall; material 2, the wall 1."""


def planes() -> dict[str, np.ndarray]:
    depth = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    depth[CARD] = 1.0
    ids = np.ones((HEIGHT, WIDTH), np.float32)
    ids[CARD] = 2
    return {
        "Z": depth,
        "material": ids,
        "albedo": np.ones((HEIGHT, WIDTH), np.float32),
        "visibility": np.ones((HEIGHT, WIDTH), np.float32),
    }


def pose(x: float) -> list[float]:
    return [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0]


def sequence(**changes: object) -> dict:
    return {
        "format": "clspeckle-gbuffer-sequence",
        "version": 1,
        "frame_rate_hz": 50,
        "frames": ["f0.exr", "f1.exr", "f2.exr"],
        "camera": {"fx_px": FOCAL, "fy_px": FOCAL, "cx_px": (WIDTH - 1) / 2, "cy_px": (HEIGHT - 1) / 2},
        "laser": {"pattern": {"file": "flat.png", "half_extent_x": 2.0, "half_extent_y": 2.0}},
        "materials": [{"id": 1, "name": "wall"}, {"id": 2, "name": "card"}],
        # 0.1 mm to the right, a fifth of the correlation length; then nothing.
        "moving_objects": [
            {"name": "card", "material_ids": [2], "geometry_from_object": [pose(0), pose(1e-4), pose(1e-4)]}
        ],
        **changes,
    }


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    for index in range(3):
        images.exr(tmp_path / f"f{index}.exr", planes())
    iio.imwrite(tmp_path / "flat.png", np.full((16, 16), 65535, np.uint16))
    (tmp_path / "sequence.json").write_text(json.dumps(sequence()))
    return tmp_path


def correlation(a: np.ndarray, b: np.ndarray, where: object) -> float:
    return float(np.corrcoef(a[where].ravel(), b[where].ravel())[0, 1])


INSIDE = np.s_[18:30, 26:38]
WALL = np.s_[36:, :]


def test_speckle_changes_with_the_way(ok, scene: Path) -> None:
    ok("render", "sequence.json", "-o", "off", *LIGHT)
    still = frames(scene / "off")
    assert np.array_equal(still[0], still[1]), "without --motion only a refresh mask makes new speckle"
    ok("render", "sequence.json", "-o", "moved", *LIGHT, "--motion", "correlate")
    moved = frames(scene / "moved")
    # The field's correlation is R(0.94 * 0.2) = 0.96 (phase.h), the intensity's its square; 144 pixels.
    assert 0.7 < correlation(moved[1], moved[0], INSIDE) < 0.995
    assert correlation(moved[1], moved[0], WALL) > 0.99, "but for the light that the aperture spreads"
    assert correlation(moved[2], moved[1], INSIDE) > 0.9999, "the card rests in the last step"
    ok("render", "sequence.json", "-o", "drawn", *LIGHT, "--motion", "replace")
    drawn = frames(scene / "drawn")
    assert correlation(drawn[1], drawn[0], INSIDE) < 0.5
    assert correlation(drawn[1], drawn[0], WALL) > 0.95
    ok("render", "sequence.json", "-o", "kept", *LIGHT, "--motion", "replace", "--motion-replace-threshold", 0.5)
    kept = frames(scene / "kept")
    assert correlation(kept[1], kept[0], INSIDE) > 0.9999


def test_the_sequence_may_ask_for_motion(ok, scene: Path) -> None:
    ok("render", "sequence.json", "-o", "asked", *LIGHT, "--motion", "correlate")
    (scene / "moving.json").write_text(json.dumps(sequence(motion={"rule": "correlate"})))
    ok("render", "moving.json", "-o", "own", *LIGHT)
    for a, b in zip(frames(scene / "asked"), frames(scene / "own")):
        assert np.array_equal(a, b)
    written = json.loads((scene / "own" / "config.json").read_text())
    assert written["motion"]["rule"] == "correlate"
    assert written["motion"]["frame_time_s"] == pytest.approx(0.02)
    assert written["render"]["refresh"] == "none", "the motion takes the place of the mask"
    ok("render", "moving.json", "-o", "off", *LIGHT, "--motion", "off")
    off = frames(scene / "off")
    assert np.array_equal(off[0], off[1])


def test_speckle_moves_along(ok, scene: Path) -> None:
    """With a surface that forgets nothing and a card that moves by one pixel its speckle is the same one pixel on."""
    step = 1.0 / FOCAL
    for index in range(3):
        shifted = {name: np.roll(plane, min(index, 1), axis=1) for name, plane in planes().items()}
        images.exr(scene / f"f{index}.exr", shifted)
    card = {"id": 2, "name": "card", **LASTING}
    objects = [{"name": "card", "material_ids": [2], "geometry_from_object": [pose(0), pose(step), pose(step)]}]
    (scene / "sequence.json").write_text(json.dumps(sequence(materials=[{"id": 1}, card], moving_objects=objects)))
    ok("render", "sequence.json", "-o", "out", *LIGHT, "--motion", "correlate", "--motion-translate")
    first, second, _ = frames(scene / "out")
    assert correlation(np.roll(second, -1, axis=1), first, INSIDE) > 0.97
    assert correlation(second, first, INSIDE) < 0.9


def test_motion_channels(ok, refused, scene: Path) -> None:
    """The same way as motion vectors: 0.5 pixels at 1 m are 7.8 mm, which leaves nothing of the card's speckle."""
    for index in range(3):
        motion = np.zeros((HEIGHT, WIDTH), np.float32)
        if index == 1:
            motion[CARD] = -0.5
        images.exr(scene / f"m{index}.exr", {**planes(), "motion.X": motion, "motion.Y": np.zeros_like(motion)})
    camera = ["--fx", FOCAL, "--fy", FOCAL, "--cx", (WIDTH - 1) / 2, "--cy", (HEIGHT - 1) / 2]
    pattern = ["--pattern", "flat.png", "--pattern-half-extent-x", 2, "--pattern-half-extent-y", 2]
    ok("render", "m*.exr", "-o", "out", *LIGHT, *camera, *pattern, "--motion", "correlate")
    first, second, third = frames(scene / "out")
    assert correlation(second, first, INSIDE) < 0.5
    assert correlation(second, first, WALL) > 0.95
    assert correlation(third, second, INSIDE) > 0.9999
    arguments = [*LIGHT, *camera, *pattern, "--motion", "correlate"]
    images.exr(scene / "m2.exr", planes())
    assert "has not the channels motion.X and motion.Y" in refused("render", "m*.exr", "-o", "bad", *arguments)
    message = refused("render", "f*.exr", "-o", "bad", *arguments)
    assert "does not tell how it moves" in message and "sequence.json" in message


def test_materials_live_and_depolarize(ok, scene: Path) -> None:
    materials = [{"id": 1, "degree_of_polarization": 1}, {"id": 2, "living": True}]
    (scene / "sequence.json").write_text(json.dumps(sequence(materials=materials, moving_objects=[])))
    ok("render", "sequence.json", "-o", "out", *LIGHT, "--motion", "correlate", "--normalization", "unit_mean")
    first, second, _ = frames(scene / "out")
    assert correlation(second, first, INSIDE) < 0.5, "new in each frame"
    assert correlation(second, first, WALL) > 0.95
    # The wall's light is polarized, contrast 1; without the materials 1 / sqrt(2). 12 x 64 pixels hold some 230
    # independent speckles: the contrast is known to sqrt(2 / 230) = 0.09 at most (one sigma); the seed is fixed.
    assert first[WALL].std() / first[WALL].mean() > 0.85
    (scene / "plain.json").write_text(json.dumps(sequence()))
    ok("render", "plain.json", "-o", "plain", *LIGHT, "--normalization", "unit_mean", "--frames", 1)
    (plain,) = frames(scene / "plain")
    assert plain[WALL].std() / plain[WALL].mean() < 0.82


def test_materials_of_an_ideal_image(ok, refused, ideal: Path, tmp_path: Path) -> None:
    image = np.load(ideal)
    ids = np.zeros(image.shape, np.uint8)
    ids[:, 32:] = 3
    np.save(tmp_path / "ids.npy", ids)
    (tmp_path / "materials.json").write_text(json.dumps({"materials": [{"id": 3, "roughness_rms_m": 0.0}]}))
    np.save(ideal, np.ones_like(image))
    given = ["--material", "ids.npy", "--materials", "materials.json"]
    ok("render", ideal, "-o", "out", *LIGHT, *given)
    (frame,) = frames(tmp_path / "out")
    assert frame[:, 40:56].std() < 0.1 * frame[:, 40:56].mean(), "a mirror makes no speckle"
    assert frame[:, 8:24].std() > 0.4 * frame[:, 8:24].mean()
    assert "--material IMAGE" in refused("render", ideal, "-o", "bad", *LIGHT, "--materials", "materials.json")
    assert "--materials FILE" in refused("render", ideal, "-o", "bad", *LIGHT, "--material", "ids.npy")
    ids[5, 7] = 9
    np.save(tmp_path / "ids.npy", ids)
    assert "pixel (7, 5) has the material 9" in refused("render", ideal, "-o", "bad", *LIGHT, *given)
    np.save(tmp_path / "ids.npy", ids + 0.5)
    assert "must be an integer from 0 to 255" in refused("render", ideal, "-o", "bad", *LIGHT, *given)
    np.save(tmp_path / "ids.npy", ids[:4])
    assert "--material image has 64 x 4 pixels" in refused("render", ideal, "-o", "bad", *LIGHT, *given)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"materials": {}}, ['"materials" must be a list']),
        ({"materials": [{"name": "wall"}]}, ['"id" of a material must be an integer from 0 to 255', "got none"]),
        ({"materials": [{"id": 256}]}, ["got 256"]),
        ({"materials": [{"id": 1}, {"id": 1}]}, ["id 1 is given twice"]),
        ({"materials": [{"id": 1, "roughness": 1}]}, ['unknown key "roughness"', '"roughness_rms_m"']),
        ({"materials": [{"id": 1, "roughness_rms_m": "1"}]}, ['"roughness_rms_m" of the material 1 must be a number']),
        ({"materials": [{"id": 1, "living": 1}]}, ['"living" must be true or false']),
        ({"materials": [{"id": 2, "degree_of_polarization": 2}]}, ["degree_of_polarization"]),
        ({"moving_objects": {}}, ['"moving_objects" must be a list']),
        ({"moving_objects": [{}]}, ['"material_ids" must be a list of ids']),
        ({"moving_objects": [{"material_ids": [7], "geometry_from_object": [pose(0)] * 3}]}, ["names 7, which is not"]),
        ({"moving_objects": [{"material_ids": [2], "geometry_from_object": [pose(0)]}]}, ["has 1 poses", "3 frames"]),
        ({"moving_objects": [{"material_ids": [2], "geometry_from_object": [[1], [1], [1]]}]}, ["has 1 numbers"]),
        ({"frame_rate_hz": 0}, ['"frame_rate_hz" must be above 0']),
        ({"motion": {"rule": "gradual"}}, ['"rule" must be', "off, correlate or replace"]),
        ({"motion": {"speed": 1}}, ['unknown key "speed" in "motion"']),
    ],
    ids=str,
)
def test_bad_sequences(refused, scene: Path, changes: dict, words: list[str]) -> None:
    (scene / "bad.json").write_text(json.dumps(sequence(**changes)))
    message = refused("render", "bad.json", "-o", "out", *LIGHT)
    for word in ("bad.json" if "degree" not in words[0] else "degree", *words):
        assert word in message, message


def test_poses_that_are_none(refused, scene: Path) -> None:
    objects = [{"material_ids": [2], "geometry_from_object": [pose(0), [2.0, *pose(0)[1:]], pose(0)]}]
    (scene / "bad.json").write_text(json.dumps(sequence(moving_objects=objects)))
    message = refused("render", "bad.json", "-o", "out", *LIGHT, "--motion", "correlate")
    assert "rotation" in message
