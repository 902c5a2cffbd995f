"""clspeckle.Profile: what a file says is what Python has, and what its cameras render."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clspeckle
from clspeckle import errors

SHAPE = (40, 48)
EFFECTS = {
    "row_noise": {"sigma_dn": 3.5},
    "vignetting": {"corner_loss": 0.25},
    "zero_order": {"relative_intensity": 8.0},
}
PROFILE: dict[str, Any] = {
    "format": "clspeckle-camera-profile",
    "version": 1,
    "camera": {
        "width": 48,
        "height": 40,
        "bits": 10,
        "pixel_pitch_m": 2.9e-6,
        "f_number": 5.6,
        "wavelength_m": 940e-9,
        "degree_of_polarization": 1.0,
        "field": "circular_gaussian",
        "principal_point_px": [20.5, 19.0],
        "black_level_dn": 60.5,
        "read_noise_dn": 3.25,
        "oversampling": 1,
        "fill_factor": 0.0,
    },
    "effects": [
        {"effect": name, "parameters": values, "intervals": {}, "named": True, "conditional": False}
        for name, values in EFFECTS.items()
    ],
    "hypotheses": [],
    "lab": {
        "sequences": [
            {
                "name": "dark",
                "scene": "dark",
                "moving": False,
                "f_number": 5.6,
                "mean_dn": 60.5,
                "light_dn": 0.0,
                "gain_dn": 0.0,
            },
            {
                "name": "board",
                "scene": "board",
                "moving": True,
                "f_number": 8.0,
                "exposure_ms": 20.0,
                "mean_dn": 260.5,
                "light_dn": 200.0,
                "gain_dn": 210.0,
            },
        ],
        "lights": [],
        "lamp_drifts": [],
        "lens_or_light": False,
    },
    "provenance": {
        "capture": "bench",
        "clspeckle": "0.1.0",
        "verdict": "named",
        "equivalent": [],
        "residual_detected": False,
        "level": 0.02,
        "seed": 7,
    },
}
PROFILE["effects"][0]["intervals"] = {"sigma_dn": [3.0, 4.0]}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(PROFILE))
    return path


def test_attributes(path: Path) -> None:
    with clspeckle.Profile.open(path) as profile:
        assert profile.data == PROFILE
        assert profile.maps == {}
        assert (profile.shape, profile.bits, profile.capture, profile.verdict) == (SHAPE, 10, "bench", "named")
        assert (profile.black_level_dn, profile.read_noise_dn) == (60.5, 3.25)
        assert {effect.effect: effect.parameters for effect in profile.effects} == EFFECTS
        assert profile.effects[0].intervals == {"sigma_dn": (3.0, 4.0)}
        assert profile.sequences[0].exposure_ms is None
        assert profile.sequences[1] == clspeckle.ProfileSequence("board", "board", True, 8.0, 20.0, 260.5, 200.0, 210.0)
        assert "of 'bench'" in repr(profile)
        profile.write(path.with_name("other.json"))
    assert json.loads(path.with_name("other.json").read_text()) == PROFILE
    with pytest.raises(errors.InvalidHandleError):
        profile.write(path)
    with pytest.raises(TypeError, match=r"Diagnosis\.profile\(\) or Profile\.open"):
        clspeckle.Profile()


def test_parameters(path: Path) -> None:
    profile = clspeckle.Profile.open(path)
    camera = {
        name: PROFILE["camera"][name]
        for name in ("bits", "pixel_pitch_m", "wavelength_m", "degree_of_polarization", "field")
    }
    settings = profile.parameters()
    assert (
        settings.items()
        >= {**camera, "f_number": 5.6, "principal_point_px": (20.5, 19.0), "normalization": "unit_mean"}.items()
    )
    assert not {"exposure_gain_dn", "fill_factor"} & set(settings)
    lit = profile.parameters("board")
    assert lit == {**settings, "f_number": 8.0, "exposure_gain_dn": 210.0, "exposure_time_s": 0.02}
    with pytest.raises(errors.InvalidArgumentError, match='no sequence "bord"; name one of dark, board'):
        profile.parameters("bord")
    with pytest.raises(TypeError, match="sequence must be the name"):
        profile.parameters(3)  # type: ignore[arg-type]


def test_cameras(path: Path, context: clspeckle.Context) -> None:
    profile = clspeckle.Profile.open(path)
    ideal = np.ones(SHAPE, np.float32)
    with clspeckle.Pipeline.from_profile(profile, sequence="board", seed=4, context=context) as camera:
        frame = camera.render(ideal)
    without_dots = {name: values for name, values in EFFECTS.items() if name != "zero_order"}
    settings = profile.parameters("board")
    with clspeckle.Pipeline.from_parameters(
        SHAPE, seed=4, effects=without_dots, context=context, **settings
    ) as by_hand:
        np.testing.assert_array_equal(frame, by_hand.render(ideal))
    changed = {"black_level_dn": 80.0, "effects": {"row_noise": {"sigma_dn": 0.0}}}
    with clspeckle.Pipeline.from_profile(profile, seed=4, context=context, **changed) as other:  # type: ignore[arg-type]
        assert other.effects["row_noise"] == {"sigma_dn": 0.0}
        assert other.effects["vignetting"] == EFFECTS["vignetting"]
        assert other.render(illumination="dark").mean() == pytest.approx(80, abs=0.5)
    dots = clspeckle.Dots(SHAPE, [(20.0, 20.0)], sigma_px=2.0, context=context)
    with clspeckle.Pipeline.from_profile(profile, dots=dots, context=context) as projector:
        assert set(projector.effects) == set(EFFECTS)


def test_other_cameras_are_refused(path: Path, context: clspeckle.Context) -> None:
    profile = clspeckle.Profile.open(path)
    with pytest.raises(
        errors.InvalidArgumentError, match="another camera: bits is 12 of the pipeline, 10 of the profile"
    ):
        clspeckle.Pipeline.from_profile(profile, bits=12, context=context)
    with clspeckle.Pipeline.from_parameters((32, 32), context=context) as small:
        with pytest.raises(errors.InvalidArgumentError, match="width is 32 of the pipeline, 48"):
            small.set_profile(profile)
        assert small.effects == {}
        with pytest.raises(TypeError, match=r"profile must be a clspeckle\.Profile, got str"):
            small.set_profile("camera.json")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="bitts"):
        clspeckle.Pipeline.from_profile(profile, bitts=12, context=context)  # type: ignore[call-arg]


def test_files(path: Path) -> None:
    with pytest.raises(TypeError, match="write it to a file and open that"):
        pickle.dumps(clspeckle.Profile.open(path))
    clspeckle.Profile.open(path).write(path.with_name("copy.json"))
    assert clspeckle.Profile.open(path.with_name("copy.json")).shape == SHAPE
    path.write_text(path.read_text().replace("row_noise", "row_nose"))
    with pytest.raises(errors.InvalidArgumentError, match='/effects/0/effect is "row_nose"'):
        clspeckle.Profile.open(path)
    with pytest.raises(errors.InputOutputError, match=r"none\.json"):
        clspeckle.Profile.open(path.with_name("none.json"))


def test_a_parameter_that_came_later_may_be_missing(path: Path) -> None:
    """The catalogue does not vary it, so that a profile of before means its value."""
    text = (
        path.read_text()
        .replace('"row_noise"', '"nonlinearity"')
        .replace('"sigma_dn"', '"cubic"')
        .replace(": 3.5", ": 0.02")
    )
    path.write_text(text)
    (bent,) = (one for one in clspeckle.Profile.open(path).effects if one.effect == "nonlinearity")
    assert bent.parameters == {"cubic": 0.02, "power": 3.0}
    path.write_text(text.replace('"cubic"', '"power"'))
    with pytest.raises(errors.InvalidArgumentError, match="/effects/0/parameters/cubic is missing"):
        clspeckle.Profile.open(path)


def check_maps(profile: clspeckle.Profile, path: Path, context: clspeckle.Context) -> None:
    profile.write(path)
    read = clspeckle.Profile.open(path)
    assert read.maps == profile.maps
    assert set(read.maps) == {"dark", "gain"}
    dark = read.maps["dark"]
    assert (dark.file, dark.sequences, dark.frames) == ("camera.dark.npy", ("dark",), 8)
    assert dark.holds == ("dsnu", "column_fpn", "row_fpn", "periodic_offset", "hot_pixels")
    assert dark.standard_error == pytest.approx(np.sqrt((16 + 1 / 12) / 8), rel=0.05)
    for name in read.maps:
        np.testing.assert_array_equal(read.map_values(name), np.load(path.with_name(f"camera.{name}.npy")))
    ideal = np.ones(read.shape, np.float32)
    given: dict[str, Any] = {"sequence": "flat", "seed": 4, "context": context}
    maps: dict[str, Any] = {"dark_frame_dn": read.map_values("dark"), "gain_map": read.map_values("gain")}
    with (
        clspeckle.Pipeline.from_profile(read, **given) as camera,
        clspeckle.Pipeline.from_profile(read, maps=False, **maps, **given) as by_hand,
        clspeckle.Pipeline.from_profile(read, maps=False, **given) as anew,
    ):
        for pipeline in (camera, by_hand):
            pipeline.clear_effect()  # maps stay
        np.testing.assert_array_equal(camera.render(ideal), by_hand.render(ideal))
        anew.set_effect("dsnu", sigma_dn=30)
        anew.set_profile(read)
        assert "dsnu" not in anew.effects
        mapped, again = (pipeline.render(ideal, frame_index=5, refresh="all") for pipeline in (camera, anew))
        np.testing.assert_array_equal(mapped, again)
        with clspeckle.Pipeline.from_profile(read, maps=False, **given) as drawn:
            anew.set_profile(read, maps=False)  # the maps go that the last call brought
            fresh, changed = (pipeline.render(ideal, frame_index=6, refresh="all") for pipeline in (drawn, anew))
            np.testing.assert_array_equal(fresh, changed)
            by_hand.set_profile(read, maps=False)  # the sensor's own maps stay
            assert not np.array_equal(drawn.render(ideal, frame_index=7), by_hand.render(ideal, frame_index=7))
        with pytest.raises(TypeError, match="maps"):
            anew.set_profile(read, maps=2)  # type: ignore[arg-type]
    with pytest.raises(errors.InvalidArgumentError, match="the sensor has a gain_map already"):
        clspeckle.Pipeline.from_profile(read, gain_map=np.ones(read.shape), **given)
    with pytest.raises(errors.InvalidArgumentError, match="the profile has 'dark', 'gain'"):
        read.map_values("flat")
    np.save(path.with_name("camera.gain.npy"), np.ones(read.shape, np.float32))
    with pytest.raises(errors.InvalidDataError, match="is not as it was written"):
        read.map_values("gain")
    path.with_name("camera.gain.npy").unlink()
    with pytest.raises(errors.InputOutputError, match="the gain map of"):
        clspeckle.Pipeline.from_profile(read, **given)
    clspeckle.Pipeline.from_profile(read, maps=False, **given).close()


def test_of_a_diagnosis(context: clspeckle.Context, tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    offsets, gains = random.normal(64, 3, (48, 64)), random.normal(1, 0.02, (48, 64))
    codes = {
        name: np.rint(offsets + level * gains + random.normal(0, 4, (8, 48, 64))).astype(np.uint16)
        for name, level in (("dark", 0), ("flat", 300))
    }
    with clspeckle.diagnose(codes, null_replicates=12, max_effects=1, evidence=False, context=context) as found:
        profile = found.profile()
    assert profile.verdict == found.verdict
    assert profile.data["provenance"]["capture"] == ""
    assert profile.sequences[1].gain_dn == pytest.approx(300, abs=1)
    check_maps(profile, tmp_path / "camera.json", context)
    with (
        clspeckle.compare(codes, codes, null_replicates=12, evidence=False, context=context) as comparison,
        pytest.raises(errors.InvalidStateError, match="comparison"),
    ):
        comparison.profile()
    with clspeckle.compare(codes, codes, profile=profile, null_replicates=12, evidence=False, context=context) as same:
        assert same.verdict == "none"
    with pytest.raises(TypeError, match=r"profile must be a clspeckle\.Profile, got str"):
        clspeckle.compare(codes, codes, profile="camera.json", context=context)  # type: ignore[arg-type]
