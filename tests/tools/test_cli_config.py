"""One table of options: configuration file, command line, --dump-config, help, precedence and errors agree."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

Config = dict[str, dict[str, object]]


def dump(ok, *arguments: object) -> Config:
    return json.loads(ok("render", *arguments, "--dump-config").out)


# A value other than the default for every key, as JSON.
CHANGED: Config = {
    "aperture": {
        "f_number": 8.0,
        "pixel_pitch_m": 3.5e-6,
        "wavelength_m": 8.5e-7,
        "relative_diameter": 0.75,
        "degree_of_polarization": 0.25,
        "fill_factor": 0.5,
        "soft_rim": 0.125,
        "pupil_image": "/somewhere/pupil.png",
        "normalization": "unit_mean",
        "oversampling": 2,
        "guard_px": 16,
    },
    "lens": {"principal_point_px": [31.5, -4.0]},
    "phase": {"field": "unit_phasor", "seed": 18446744073709551615},
    "sensor": {
        "profile": "OS04A10",
        "enabled": False,
        "bits": 12,
        "exposure_gain_dn": "auto",
        "saturation_dn": 900.5,
        "black_level_dn": -3.0,
        "read_noise_dn": 0.0,
        "exposure_time_s": 0.02,
        "hot_pixel_fraction": 0.001,
        "hot_pixel_mean_dn": 77.0,
        "cold_pixel_fraction": 0.002,
        "dark_frame": "/somewhere/dark.npy",
        "gain_map": "/somewhere/gain.npy",
        "quantize": False,
        "float_full_scale": 1023.0,
        "seed": 5,
    },
    "pattern": {
        "image": "/somewhere/dots.png",
        "half_extent_x": 0.7,
        "half_extent_y": 0.4,
        "projection": "direction_cosines",
        "quantity": "plane_irradiance",
        "filter": "area",
        "power_scale": 2.5,
        "laser_from_geometry": [1.0, 0.0, 0.0, -0.075, 0.0, 1.0, 0.0, 1e-3, 0.0, 0.0, 1.0, 0.0],
    },
    "camera": {
        "fx_px": 560.5,
        "fy_px": 561.5,
        "cx_px": 319.5,
        "cy_px": -0.5,
        "depth_kind": "along_ray",
        "depth_scale": 0.001,
    },
    "motion": {"rule": "correlate", "translate": True, "frame_time_s": 0.04, "replace_threshold": 0.5},
    "surface": {"subsurface_length_px": 2.5},
    "render": {
        "device": "cpu",
        "seed": 7,
        "frames": 3,
        "first_frame": 12,
        "refresh": "all",
        "illumination": "incoherent",
        "irradiance_scale": 0.5,
        "full_scale": 1023.0,
        "clip_negative": True,
        "zero_nonfinite": True,
        "transfer": "srgb",
        "channel": "Y",
        "format": "tiff16",
        "preview": False,
        "save_ideal": True,
        "stage_times": True,
    },
    "effects": {},  # see test_cli_effects.py
}

# Keys whose option is not just their name with dashes.
NAMES = {
    "phase.seed": "phase-seed",
    "sensor.enabled": "sensor",
    "sensor.seed": "sensor-seed",
    "pattern.image": "pattern",
    **{f"pattern.{key}": f"pattern-{key.replace('_', '-')}" for key in CHANGED["pattern"] if key != "image"},
    "sensor.profile": "sensor-profile",
    "motion.rule": "motion",
    **{f"motion.{key}": f"motion-{key.replace('_', '-')}" for key in CHANGED["motion"] if key != "rule"},
}


def option_name(section: str, key: str) -> str:
    return "--" + NAMES.get(f"{section}.{key}", key.replace("_", "-"))


def as_arguments(section: str, key: str, value: object) -> list[str]:
    name = option_name(section, key)
    if isinstance(value, bool):
        return [name if value else name.replace("--", "--no-", 1)]
    if isinstance(value, list):
        return [name, ",".join(map(str, value))]
    return [name, str(value)]


ALL = [(section, key) for section, keys in CHANGED.items() for key in keys]


def test_the_table_here_is_complete_and_differs_from_the_defaults(ok) -> None:
    defaults = dump(ok)
    assert {s: list(keys) for s, keys in defaults.items()} == {s: list(keys) for s, keys in CHANGED.items()}
    for section, key in ALL:
        assert defaults[section][key] != CHANGED[section][key], f"{section}.{key}"


def test_dump_round_trip(ok, tmp_path: Path) -> None:
    """What --dump-config prints gives the same when read back: for the defaults, and with every value changed."""
    text = ok("render", "--dump-config").out
    (tmp_path / "default.json").write_text(text)
    assert ok("render", "--config", "default.json", "--dump-config").out == text
    (tmp_path / "changed.json").write_text(json.dumps(CHANGED))
    text = ok("render", "--config", "changed.json", "--dump-config").out
    assert json.loads(text) == CHANGED
    (tmp_path / "again.json").write_text(text)
    assert ok("render", "--config", "again.json", "--dump-config").out == text


@pytest.mark.parametrize(("section", "key"), ALL)
def test_every_key_is_an_option(ok, section: str, key: str) -> None:
    value = CHANGED[section][key]
    assert dump(ok, *as_arguments(section, key, value))[section][key] == value


def test_help_lists_every_option(ok) -> None:
    text = ok("render", "--help").out
    for section, key in ALL:
        names = [word.strip(",") for word in text.split()]
        assert option_name(section, key) in names, f"{section}.{key}"
    for section in CHANGED:
        assert f"Configuration: {section}" in text


@pytest.mark.parametrize(
    "alias", ["--exposure-gain 100", "--black-level 10", "--pixel-pitch 3e-6", "--fx 300", "--guard 4"]
)
def test_units_may_be_left_out(ok, alias: str) -> None:
    assert dump(ok, *alias.split()) != dump(ok)


def test_precedence(ok, tmp_path: Path) -> None:
    """Command line over file over sequence.json over defaults."""
    (tmp_path / "scene.exr").write_bytes(b"never read by --dump-config")
    sequence = {
        "format": "clspeckle-gbuffer-sequence",
        "version": 1,
        "frames": ["scene.exr"],
        "camera": {"f_number": 2.0, "pixel_pitch_m": 1e-6, "fx_px": 100.0},
    }
    import cli_images

    cli_images.exr(tmp_path / "scene.exr", {"Z": cli_images.real()})
    (tmp_path / "sequence.json").write_text(json.dumps(sequence))
    (tmp_path / "config.json").write_text(json.dumps({"aperture": {"f_number": 4.0}, "camera": {"fx_px": 200.0}}))
    given = dump(ok, "sequence.json", "--config", "config.json", "--fx", 300)
    assert given["aperture"]["pixel_pitch_m"] == 1e-6, "sequence.json over the default"
    assert given["aperture"]["f_number"] == 4.0, "file over sequence.json"
    assert given["camera"]["fx_px"] == 300.0, "command line over file"
    assert given["camera"]["fy_px"] == dump(ok)["camera"]["fy_px"]


def test_a_later_f_number_replaces_an_earlier_diameter(ok, refused, tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text(json.dumps({"aperture": {"relative_diameter": 0.5, "f_number": 5.6}}))
    assert dump(ok, "--config", "config.json")["aperture"]["relative_diameter"] == 0.5
    given = dump(ok, "--config", "config.json", "--f-number", 8)["aperture"]
    assert (given["relative_diameter"], given["f_number"]) == (0, 8)
    message = refused("render", "--f-number", 8, "--relative-diameter", 0.5, "--dump-config")
    assert "--relative-diameter" in message and "--f-number" in message


def test_paths_are_relative_to_the_file_that_names_them(ok, tmp_path: Path) -> None:
    (tmp_path / "settings").mkdir()
    (tmp_path / "settings" / "config.json").write_text(json.dumps({"pattern": {"image": "dots.png"}}))
    assert dump(ok, "--config", "settings/config.json")["pattern"]["image"] == str(tmp_path / "settings" / "dots.png")
    assert dump(ok, "--pattern", "dots.png")["pattern"]["image"] == str(tmp_path / "dots.png")


BAD_CONFIGS = [
    ('{"aperture": {"f_numbr": 8}}', ['unknown key "aperture.f_numbr"', '"aperture.f_number"']),
    ('{"sensor": {"readnoise": 8}}', ['unknown key "sensor.readnoise"', '"sensor.read_noise_dn"']),
    ('{"sensor": {"f_number": 8}}', ['unknown key "sensor.f_number"', '"aperture.f_number"']),
    ('{"apperture": {"f_number": 8}}', ['unknown section "apperture"', '"aperture"']),
    ('{"f_number": 8}', ['unknown section "f_number"', 'key is "aperture.f_number"']),
    ('{"aperture": {"f_number": "wide"}}', ["aperture.f_number must be a number, 0.1 to 1000", '"wide"']),
    ('{"aperture": {"f_number": 0}}', ["aperture.f_number must be a number, 0.1 to 1000", "got 0"]),
    ('{"aperture": {"f_number": -2}}', ["aperture.f_number", "got -2"]),
    ('{"aperture": {"f_number": null}}', ["aperture.f_number", "got null"]),
    ('{"aperture": {"f_number": true}}', ["aperture.f_number", "got true"]),
    ('{"aperture": {"f_number": 1e999}}', ["config.json"]),
    ('{"aperture": {"degree_of_polarization": 1.5}}', ["degree_of_polarization", "0 to 1", "got 1.5"]),
    ('{"aperture": {"oversampling": 9}}', ["aperture.oversampling", "1 to 8", "got 9"]),
    ('{"aperture": {"oversampling": 1.5}}', ["aperture.oversampling", "an integer", "got 1.5"]),
    ('{"sensor": {"bits": 7}}', ["sensor.bits", "8 to 16", "got 7"]),
    ('{"sensor": {"exposure_gain_dn": "automatic"}}', ["exposure_gain_dn", "auto", '"automatic"']),
    ('{"sensor": {"quantize": 1}}', ["sensor.quantize", "true or false", "got 1"]),
    ('{"render": {"seed": -1}}', ["render.seed", "got -1"]),
    ('{"render": {"seed": 18446744073709551616}}', ["render.seed"]),
    ('{"render": {"format": "png"}}', ["render.format", "png16", '"png"']),
    ('{"render": {"frames": 0}}', ["render.frames", "got 0"]),
    ('{"pattern": {"laser_from_geometry": [1, 2, 3]}}', ["laser_from_geometry", "12 numbers"]),
    ('{"pattern": {"laser_from_geometry": 5}}', ["laser_from_geometry", "12 numbers"]),
    ('{"pattern": {"image": 5}}', ["pattern.image", "a text"]),
    ('{"aperture": 5}', ['section "aperture" must be an object']),
    ("[1, 2]", ["a JSON object"]),
    ('{"aperture": {"f_number": 8}', ["not valid JSON", "line 1"]),
    ('{"aperture": {"f_number": 8, "f_number": 8}}', ['"aperture.f_number" is given twice']),
    ('{"render": {"seed": 1}, "render": {"frames": 2}}', ['"render" is given twice']),
    ("", ["is empty"]),
    ("\x00\x01", ["not valid JSON"]),
    ("[" * 100000, ["nested more than 100 levels deep"]),
]


@pytest.mark.parametrize(("text", "words"), BAD_CONFIGS, ids=[text[:50] for text, _ in BAD_CONFIGS])
def test_bad_configuration_files(refused, ideal: Path, tmp_path: Path, text: str, words: list[str]) -> None:
    (tmp_path / "config.json").write_text(text)
    message = refused("render", ideal, "-o", "out", "--config", "config.json")
    for word in ["config.json", *words]:
        assert word in message


def test_configuration_that_cannot_be_read(refused, ideal: Path, tmp_path: Path) -> None:
    assert "No such file" in refused("render", ideal, "-o", "out", "--config", "missing.json")
    (tmp_path / "folder.json").mkdir()
    assert "folder" in refused("render", ideal, "-o", "out", "--config", "folder.json")


BAD_ARGUMENTS = [
    (["--f-numbr", "8"], ["no option --f-numbr", "nearest one is --f-number"]),
    (["--f-number", "eight"], ["--f-number must be a number, 0.1 to 1000", '"eight"']),
    (["--f-number", "0"], ["--f-number", "got 0"]),
    (["--f-number", "nan"], ["--f-number"]),
    (["--f-number", "inf"], ["--f-number"]),
    (["--f-number", "8mm"], ["--f-number", '"8mm"']),
    (["--f-number", ""], ["--f-number"]),
    (["--f-number"], ["--f-number"]),
    (["--relative-diameter", "-1"], ["--relative-diameter", "0 to 8"]),
    (["--seed", "-1"], ["--seed"]),
    (["--seed", "1e3"], ["--seed"]),
    (["--bits", "17"], ["--bits", "8 to 16"]),
    (["--refresh", "some"], ["--refresh", "none", "all", "mask"]),
    (["--format", "jpeg"], ["--format", "png16"]),
    (["--pattern-laser-from-geometry", "1,2,x"], ["--pattern-laser-from-geometry", "12 numbers"]),
    (["--saturation-dn", "0"], ["--saturation-dn", "0.01 to 1000000, or inf"]),
    (["--exposure-gain", "-1"], ["--exposure-gain-dn"]),
]


@pytest.mark.parametrize(("arguments", "words"), BAD_ARGUMENTS, ids=[" ".join(a) for a, _ in BAD_ARGUMENTS])
def test_bad_options(refused, ideal: Path, arguments: list[str], words: list[str]) -> None:
    message = refused("render", ideal, "-o", "out", *arguments)
    for word in words:
        assert word in message


def test_infinite_saturation(ok) -> None:
    assert dump(ok)["sensor"]["saturation_dn"] == "inf"
    assert dump(ok, "--saturation-dn", 500)["sensor"]["saturation_dn"] == 500
    assert dump(ok, "--saturation-dn", "inf")["sensor"]["saturation_dn"] == "inf"


def test_written_configuration_repeats_the_run(ok, ideal: Path, tmp_path: Path) -> None:
    """config.json of a run with an automatic exposure gives the same bytes without one."""
    ok("render", ideal, "-o", "first", "--exposure-gain", "auto", "--seed", 3, "--f-number", 4, "--format", "npy")
    written = json.loads((tmp_path / "first" / "config.json").read_text())
    assert isinstance(written["sensor"]["exposure_gain_dn"], float)
    ok("render", ideal, "-o", "second", "--config", "first/config.json")
    for name in ("frame_000000.npy", "preview_000000.png", "config.json"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()
    assert np.load(tmp_path / "second" / "frame_000000.npy").max() > 100
