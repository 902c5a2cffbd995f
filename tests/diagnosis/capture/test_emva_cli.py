"""`clspeckle capture emva` and `diagnose --emva`: a known camera; the real sets of CONTRIBUTING.md; the package's
XML."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import clspeckle
import numpy as np
import pytest

Cli = Callable[..., subprocess.CompletedProcess[str]]
DATA = Path(os.environ.get("CLSPECKLE_TEST_DATA", "none"))
GAIN, NOISE, PRNU = 0.25, 3.0, 0.01


def camera(folder: Path) -> Path:
    """A linear camera in electrons: a dark and four flats of four frames of 64 x 96 pixels."""
    draw = np.random.default_rng(1)
    gains = 1 + PRNU * draw.normal(size=(64, 96))

    def frames(electrons: float) -> np.ndarray[Any, np.dtype[np.uint16]]:
        light = draw.poisson(electrons * gains, (4, 64, 96))
        return np.rint(np.clip(64 + GAIN * light + draw.normal(0, NOISE, light.shape), 0, 1023)).astype(np.uint16)

    levels = {"dark": 0, "flat_1": 500, "flat_2": 1000, "flat_3": 1800, "flat_4": 2500}
    recorded = {
        name: clspeckle.CaptureSequence(frames(level), scene=name.split("_")[0], exposure_ms=1 + level / 100)
        for name, level in levels.items()
    }
    clspeckle.Capture.from_arrays(recorded, camera={"bits": 10}).write(folder)
    return folder


def package_results(text: str) -> dict[str, dict[str, float | None]]:
    """As the package's xml_to_dict() reads them: sections, names in small letters, a value in each."""
    return {
        section.tag: {
            method.tag.lower(): None if (value := method.findtext("value")) == "None" else float(str(value))
            for method in section
        }
        for section in ElementTree.fromstring(text)
    }


def test_numbers_of_a_known_camera(cli: Cli, tmp_path: Path) -> None:
    """Each quantity within 4 standard errors by its own interval; PRNU of 6144 pixels is good to 1 %."""
    camera(tmp_path / "set")
    printed = cli("capture", "emva", "set", "--json", "emva.json", "--xml", "emva.xml").stdout
    emva = json.loads((tmp_path / "emva.json").read_text())
    values = emva["values"]
    truth = {
        "system_gain": GAIN,
        "dark_level": 64,
        "dark_noise_e": NOISE / GAIN,
        "prnu_pixel": 100 * PRNU,
    }
    for name, true in truth.items():
        low, high = values[name]["interval"]
        assert abs(values[name]["value"] - true) < high - low < 0.2 * true, (
            name,
            values[name],
        )
    assert emva["gain_method"] == "flats" and len(emva["photon_transfer"]) == 5
    assert all(("unknown" in entry) == (entry["value"] is None) for entry in values.values())
    assert "system_gain" in printed and "Not known: " in printed and "flat_4" in printed
    assert clspeckle.Capture.open(tmp_path / "set").emva1288() == emva
    assert json.loads(cli("capture", "emva", "set", "--json", "-").stdout) == emva

    results = package_results((tmp_path / "emva.xml").read_text())
    assert set(results) == {
        "info",
        "sensitivity",
        "linearity",
        "dark_current",
        "spatial",
    }
    assert results["sensitivity"]["k"] == pytest.approx(values["system_gain"]["value"], abs=1e-5)
    assert results["sensitivity"]["qe"] is None and results["sensitivity"]["u_e_sat"] is None
    assert results["spatial"]["prnu1288_pixel"] == pytest.approx(100 * PRNU, rel=0.05)


@pytest.mark.parametrize("ramp", [0, 1])
def test_codes_without_noise_tell_no_pattern(cli: Cli, tmp_path: Path, ramp: int) -> None:
    """Neither dust of the arithmetic nor a gain: what does not change in time, and over the image only smoothly."""
    field = ramp * np.arange(96)
    recorded = {
        scene: clspeckle.CaptureSequence(
            np.broadcast_to(levels, (4, 64, 96)).astype(np.uint16), scene=scene, motion="static"
        )
        for scene, levels in (("dark", 64), ("flat", 301 + field), ("board", 617 + field))
    }
    clspeckle.Capture.from_arrays(recorded, camera={"bits": 10}).write(tmp_path / "set")
    printed = cli("capture", "emva", "set", "--json", "emva.json", "--xml", "emva.xml")
    assert printed.returncode == 0 and "inf" not in printed.stdout + printed.stderr
    emva = json.loads((tmp_path / "emva.json").read_text())
    for name, entry in emva["values"].items():
        assert "unknown" in entry or name in ("dark_level", "dark_noise"), (name, entry)
    assert "no camera records without noise" in emva["values"]["dsnu"]["unknown"]
    assert "flat: its codes do not change" in emva["values"]["system_gain"]["unknown"]
    for light in emva["illumination"]:
        numbers = [value for value in light.values() if not isinstance(value, str)]
        assert all(value == 0 or abs(value) > 1e-6 for value in numbers), light
    values = package_results((tmp_path / "emva.xml").read_text())
    for section in values.values():
        for name, value in section.items():
            assert not value or abs(value) > 1e-9, (name, value)


def test_slopes_of_strips_have_honest_errors() -> None:
    """Speckle with grains of 2 pixels in strips of 8 rows: 80 draws of 5 terms; their scatter by their errors is 1."""
    draw = np.random.default_rng(5)
    pupil = np.hypot(np.fft.fftfreq(8)[:, None], np.fft.fftfreq(96)[None, :]) < 0.25
    deviations = []
    for _ in range(80):
        field = draw.normal(size=(4, 8, 96)) + 1j * draw.normal(size=(4, 8, 96))
        light = np.abs(np.fft.ifft2(np.fft.fft2(field) * pupil)) ** 2
        codes = np.rint(np.clip(64 + 150 * light / light.mean(), 0, 1023)).astype(np.uint16)
        recorded = {"board": clspeckle.CaptureSequence(codes, scene="board", motion="moving")}
        capture = clspeckle.Capture.from_arrays(recorded, camera={"bits": 10, "black_level_dn": 64.0})
        [light_shape] = capture.emva1288()["illumination"]
        deviations += [
            light_shape[term] / light_shape[term + "_error"]
            for term in ("slope_x", "slope_y", "curvature_x", "twist", "curvature_y")
        ]
    assert 0.8 < np.sqrt(np.mean(np.square(deviations))) < 1.15


def test_a_diagnosis_repeats_them(cli: Cli, tmp_path: Path) -> None:
    camera(tmp_path / "set")
    printed = cli("diagnose", "set", "--json", "report.json", "--html", "report.html", "--emva", "emva.xml",
        "--max-effects", 1, "--replicates", 12).stdout  # fmt: skip
    capture = clspeckle.Capture.open(tmp_path / "set")
    assert json.loads((tmp_path / "report.json").read_text())["emva1288"] == capture.emva1288()
    assert (tmp_path / "emva.xml").read_text() == capture.emva1288_xml()
    assert "EMVA 1288, of the frames alone: system_gain 0.25" in printed
    assert 'id="emva1288"' in (tmp_path / "report.html").read_text()


def test_what_cannot_be_written_is_told_before_the_work(cli: Cli, tmp_path: Path) -> None:
    camera(tmp_path / "set")
    assert "does not exist" in cli("diagnose", "set", "--emva", "none/emva.xml", code=3).stderr
    assert "none" in cli("capture", "emva", "set", "--xml", "none/emva.xml", code=3).stderr


def test_real_ccd() -> None:
    """The package emva1288 1.0.2 of the same crop (40 dark and 40 flat frames): K 0.2806 DN/e, dark noise 3.075 DN,
    PRNU 0.2947 % (pixel 0.2499, row 0.1554), DSNU 0.0266 DN; of the full frames K is 0.2801."""
    if not (DATA / "emva_ccd").is_dir():
        pytest.skip("CLSPECKLE_TEST_DATA names no folder of published images")
    emva = clspeckle.Capture.open(DATA / "emva_ccd").emva1288()
    values = emva["values"]
    assert values["system_gain"]["value"] == pytest.approx(0.2801, rel=0.01)
    assert values["system_gain"]["interval"][0] < 0.2801 < values["system_gain"]["interval"][1]
    assert values["dark_noise"]["value"] == pytest.approx(3.07, rel=0.01)
    recorded = emva["section_8"]["as_recorded"]
    assert recorded["prnu_percent"]["total"] == pytest.approx(0.2947494, rel=0.005)
    assert recorded["prnu_percent"]["pixel"] == pytest.approx(0.2498930, rel=0.005)
    assert recorded["prnu_percent"]["row"] == pytest.approx(0.1554298, rel=0.005)
    assert recorded["prnu_percent"]["column"] == pytest.approx(0.0165006, rel=0.005)
    assert recorded["dsnu_dn"]["total"] == pytest.approx(0.0266429, rel=0.005)
    # Without the lamp's slope, nothing of the rows' 0.155 % is left.
    assert values["prnu_row"]["value"] < 0.04 and values["prnu_pixel"]["value"] == pytest.approx(0.25, rel=0.02)


def test_real_laser() -> None:
    """Dark frames of which half are 0; photon noise of speckle that drifts. Beyond the grain's band, at 0.42 to 0.7
    cycles per pixel, differences of frames have 0.946 of 70 + 1.30 DN mean, whatever their distance: 1.23 DN per
    electron."""
    if not (DATA / "laser_board").is_dir():
        pytest.skip("CLSPECKLE_TEST_DATA names no folder of published images")
    emva = clspeckle.Capture.open(DATA / "laser_board").emva1288()
    assert emva["gain_method"] == "laser_at_rest"
    low, high = emva["values"]["system_gain"]["interval"]
    assert low < 1.23 < high and high - low < 0.15
    assert emva["values"]["dark_level"]["value"] == pytest.approx(0.5, abs=0.5)
    assert any("drifts" in note["text"] for note in emva["notes"])


def test_dark_frames_that_never_change_tell_no_noise(cli: Cli, tmp_path: Path) -> None:
    camera(tmp_path / "set")
    np.save(tmp_path / "set" / "dark.npy", np.full((4, 64, 96), 64, np.uint16))
    values = json.loads(cli("capture", "emva", "set", "--json", "-").stdout)["values"]
    for name in ("dark_noise", "dark_noise_e", "sensitivity_threshold"):
        assert "lost in the converter's rounding" in values[name]["unknown"], name
    assert values["dark_noise"]["value"] is None
    assert "unknown" not in values["system_gain"]
