"""The catalogue of effects, the sensor's profiles and the illumination, from the command line and the configuration."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cli_support import PROGRAM, ROOT, Run, frames

OUTPUT = ["--format", "npy", "--no-preview", "--seed", 4, "--exposure-gain", 300]


def catalogue(ok: Callable[..., Run]) -> list[dict]:
    return ok("effects", "--json").json()["effects"]


def test_list_of_effects(ok) -> None:
    listed = catalogue(ok)
    assert len(listed) >= 30
    text = ok("effects").out
    for effect in listed:
        assert effect["id"] in text
        assert effect["summary"] in text
        assert effect["stage"] in ("laser", "doe", "surface", "motion", "optics", "sensor")
        for parameter in effect["parameters"]:
            assert parameter["name"] in text
            assert parameter["minimum"] <= parameter["middle"] <= parameter["maximum"]
            assert 2 * parameter["middle"] == pytest.approx(parameter["weak"] + parameter["strong"])
    assert "--effect" in text


def test_the_tables_of_the_docs_are_the_records(ok) -> None:
    script = [sys.executable, ROOT / "scripts" / "effect_table.py", "--check", PROGRAM]
    check = subprocess.run(script, capture_output=True, text=True, check=False)
    assert check.returncode == 0, check.stderr
    described = (ROOT / "docs" / "reference" / "effects.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` ", described, re.MULTILINE) == [effect["id"] for effect in catalogue(ok)]


def test_effects_change_the_frames(ok, ideal: Path, tmp_path: Path) -> None:
    """One of each stage and each way to the kernels; the tests of the Python binding have all of them."""

    # Of frames at rest or drawn anew: effects of motion show in one or the other.
    def run(name: str, *arguments: object) -> list[np.ndarray]:
        ok("render", ideal, "-o", name, *OUTPUT, "--frames", 2, *arguments)
        return frames(tmp_path / name)

    plain = {refresh: run(refresh, "--refresh", refresh) for refresh in ("none", "all")}
    assert plain["all"][0].std() > 3, "an image without structure would agree with anything"
    chosen = ["linewidth", "depolarization", "motion_decorrelation", "airflow", "defocus", "glare", "prnu", "image_lag"]
    for effect in chosen:
        refresh = "all" if effect in ("motion_decorrelation", "image_lag") else "none"
        got = run(effect, "--refresh", refresh, "--effect", effect)
        assert any(not np.array_equal(a, b) for a, b in zip(got, plain[refresh])), effect


def test_parameters_and_configuration_agree(ok, ideal: Path, tmp_path: Path) -> None:
    effects = ["--effect", "defocus:waves=0.4", "--effect=glare:scale_px=4,fraction=0.1", "--effect", "prnu"]
    ok("render", ideal, "-o", "first", *OUTPUT, *effects)
    expected = {"defocus": {"waves": 0.4}, "glare": {"fraction": 0.1, "scale_px": 4.0}, "prnu": {"sigma": 0.018}}
    written = json.loads((tmp_path / "first" / "config.json").read_text())
    assert written["effects"] == expected
    ok("render", ideal, "-o", "second", "--config", "first/config.json")
    assert np.array_equal(*frames(tmp_path / "first"), *frames(tmp_path / "second"))
    (tmp_path / "config.json").write_text(json.dumps({"effects": {**expected, "prnu": {}}}))
    ok("render", ideal, "-o", "third", *OUTPUT, "--config", "config.json")
    assert np.array_equal(*frames(tmp_path / "first"), *frames(tmp_path / "third"))

    def dumped(*arguments: object) -> dict:
        return ok("render", "--config", "config.json", *arguments, "--dump-config").json()["effects"]

    assert dumped("--effect", "defocus:waves=1")["defocus"] == {"waves": 1.0}, "the command line beats the file"
    assert dumped("--effect", "none") == {}
    assert dumped("--effect", "none", "--effect", "gamma:gamma=0.9") == {"gamma": {"gamma": 0.9}}
    assert list(dumped("--effect", "airflow"))[0] == "airflow", "in the order in which light meets them"
    (tmp_path / "again.json").write_text(ok("render", "--config", "config.json", "--dump-config").out)
    assert ok("render", "--config", "again.json", "--dump-config").json()["effects"] == expected


def test_effects_are_reported(ok, ideal: Path) -> None:
    text = ok("render", ideal, "-o", "out", *OUTPUT, "--effect", "defocus:waves=0.4").out
    assert "effect      defocus:waves=0.4" in text
    summary = ok("render", ideal, "-o", "json", *OUTPUT, "--effect", "gamma", "--json").json()
    assert summary["config"]["effects"] == {"gamma": {"gamma": pytest.approx(0.84)}}


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ("defocsu", ['no effect "defocsu"', 'nearest one is "defocus"']),
        ("", ['no effect ""']),
        ("defocus:wave=1", ['no parameter "wave"', '"waves"']),
        ("defocus:waves=101", ["waves must be -100 to 100", "got 101"]),
        ("defocus:waves=nan", ["waves must be", "nan"]),
        ("defocus:waves=", ['"waves=" is not NAME=NUMBER', "defocus:waves="]),
        ("defocus:waves", ['"waves" is not NAME=NUMBER']),
        ("defocus:", ["is not NAME=NUMBER"]),
        ("defocus:waves=1x", ["is not NAME=NUMBER"]),
        ("defocus:waves=0.1,waves=0.2", ["given twice"]),
        ("defocus:waves=90", ["--effect defocus:waves=90", "use fewer waves"]),
        ("zero_order", ["--effect zero_order", "dots"]),
    ],
)
def test_bad_effects(refused, ideal: Path, effect: str, words: list[str]) -> None:
    message = refused("render", ideal, "-o", "out", "--effect", effect)
    for word in words:
        assert word in message, message


def test_effects_without_a_sensor(refused, ideal: Path) -> None:
    arguments = ["--no-sensor", "--format", "float-npy", "--effect", "prnu"]
    assert "needs a pipeline with a sensor" in refused("render", ideal, "-o", "out", *arguments)


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"defokus": {}}, ["effects.defokus", '"defocus"']),
        ({"defocus": 0.5}, ["effects.defocus must be an object of numbers", '{"waves":']),
        ({"defocus": {"waves": "0.5"}}, ["waves must be a number"]),
        ({"defocus": {"waves": 1e6}}, ["waves must be -100 to 100"]),
        ({"defocus": {"wawes": 1}}, ['no parameter "wawes"', '"waves"']),
        ([], ['section "effects" must be an object']),
    ],
    ids=str,
)
def test_bad_effects_in_a_file(refused, ideal: Path, tmp_path: Path, section: object, words: list[str]) -> None:
    (tmp_path / "config.json").write_text(json.dumps({"effects": section}))
    message = refused("render", ideal, "-o", "out", "--config", "config.json")
    for word in ("config.json", *words):
        assert word in message, message


def test_sensor_profiles(ok, refused, ideal: Path, tmp_path: Path) -> None:
    def sensor(*arguments: object) -> dict:
        return ok("render", *arguments, "--dump-config").json()["sensor"]

    plain, profile = sensor(), sensor("--sensor-profile", "OS04A10")
    assert profile["profile"] == "OS04A10"
    changed = {key for key in plain if plain[key] != profile[key]} - {"profile"}
    assert changed, "the profile says nothing"
    # What is said later, or on the command line, stays.
    assert sensor("--sensor-profile", "os04a10", "--read-noise-dn", 7)["read_noise_dn"] == 7
    (tmp_path / "config.json").write_text(json.dumps({"sensor": {"read_noise_dn": 9.0, "black_level_dn": 3.0}}))
    given = sensor("--config", "config.json", "--sensor-profile", "OS04A10", "--black-level-dn", 5)
    assert given["read_noise_dn"] == profile["read_noise_dn"]
    assert given["black_level_dn"] == 5
    (tmp_path / "config.json").write_text(json.dumps({"sensor": {"profile": "OS04A10", "read_noise_dn": 9.0}}))
    assert sensor("--config", "config.json")["read_noise_dn"] == 9
    ok("render", ideal, "-o", "profile", *OUTPUT, "--sensor-profile", "OS04A10")
    ok("render", ideal, "-o", "again", "--config", "profile/config.json")
    ok("render", ideal, "-o", "plain", *OUTPUT)
    assert np.array_equal(*frames(tmp_path / "profile"), *frames(tmp_path / "again"))
    assert not np.array_equal(*frames(tmp_path / "profile"), *frames(tmp_path / "plain"))
    assert '"OS04A10"' in refused("render", ideal, "-o", "out", "--sensor-profile", "OS04A11")


def test_illumination(ok, refused, ideal: Path, tmp_path: Path) -> None:
    light = ["--format", "float-npy", "--no-sensor", "--no-preview"]
    summary = ok("render", ideal, "-o", "lamp", *light, "--illumination", "incoherent", "--json").json()
    (lamp,) = frames(tmp_path / "lamp")
    np.testing.assert_allclose(lamp, summary["aperture"]["mean_transmission"] * np.load(ideal), rtol=1e-5)
    ok("render", ideal, "-o", "dark", *light, "--illumination", "dark")
    (dark,) = frames(tmp_path / "dark")
    assert not dark.any()
    ok("render", ideal, "-o", "laser", *light, "--illumination", "laser")
    ok("render", ideal, "-o", "default", *light)
    assert np.array_equal(*frames(tmp_path / "laser"), *frames(tmp_path / "default"))
    assert "laser, incoherent or dark" in refused("render", ideal, "-o", "out", "--illumination", "lamp")
