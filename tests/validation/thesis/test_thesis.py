"""The repetition of the thesis's figures: small settings, verdicts that hold and that can fail, the command line, the
page."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "validation"))
from thesis import __main__ as program
from thesis import experiment, intensity_law, theory
from thesis.page import write_page

# Seconds instead of minutes; seeds and everything else stay.
SMALL = {
    "intensity_law": {"shape": [32, 32], "images": 400, "pixel": [16, 16]},
    "dark_frame": {"shape": [64, 64], "frames": 100},
    "stationary": {"shape": [64, 64]},
    "decorrelation": {
        "shape": [96, 96],
        "lateral": {"length_m": 0.5e-3, "step_m": 5e-5, "steps": 24},
        "axial": {"length_m": 3e-3, "step_m": 3e-4, "steps": 24},
        "rotation": {"length_degrees": 0.25, "step_degrees": 0.025, "steps": 24},
    },
    "living_surfaces": {"shape": [96, 192], "frames": 40, "lags": 10},
    "beam_profile": {
        "measurement": {"dots": 400, "frames": 10, "f_number": 5.6, "degree_of_polarization": 1.0, "oversampling": 1},
        "single_frame": {"dots": 400, "frames": 1, "f_number": 2.8, "degree_of_polarization": 0.0, "oversampling": 2},
    },
    "aperture_series": {"dots": 36, "frames": 8, "shown_dot": 20},
    "wavelength_shift": {"shape": [160, 240]},
    "depth_consistency": {"shape": [240, 320], "dots": 375, "frames": 12},
    "depth_f_number": {"shape": [240, 320], "dots": 375, "frames": 2},
    "doe_defects": {"cell": [256, 256], "dots": 800, "twin_dots": 400, "image_px": 180, "frames": 50},
    "scenes": {"scenes": ["depth_map"]},
    "before_after": {"crop": [0, 0, 320, 240]},
    "run_time": {"sides": [16, 64, 128], "pixels_each": 1e5, "fit_from_side": 64},
}


def settings(folder: Path) -> Path:
    """The project's settings, made small."""
    config = json.loads((ROOT / "validation" / "thesis" / "config.json").read_text())
    assert config.keys() == SMALL.keys()
    for name, changes in SMALL.items():
        assert changes.keys() <= config[name].keys()
        config[name].update(changes)
    path = folder / "config.json"
    path.write_text(json.dumps(config))
    return path


def thesis(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(filter(None, (str(ROOT / "validation"), os.environ.get("PYTHONPATH"))))
    command = [sys.executable, "-m", "thesis", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path}, check=False)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All experiments, but for those whose verdicts are about time."""
    folder = tmp_path_factory.mktemp("thesis")
    names = [e.name for e in program.EXPERIMENTS if not e.timed]
    done = thesis("run", *names, "--out", folder / "out", "--config", settings(folder))
    assert done.returncode == 0, done.stdout + done.stderr
    # Times are what they are: its verdicts may fail here, its files are there.
    assert thesis("run", "run_time", "--out", folder / "out", "--config", folder / "config.json").returncode in (0, 1)
    return folder / "out"


@pytest.mark.parametrize("name", [e.name for e in program.EXPERIMENTS])
def test_leaves_data_figure_and_verdicts(results: Path, name: str) -> None:
    folder = results / name
    assert {p.name for p in folder.iterdir()} == {"data.npz", "figure.png", "verdicts.json"}
    assert (folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    with np.load(folder / "data.npz") as data:
        assert data.files
        # A dot that was not placed has no depth: NaN.
        assert all(np.isfinite(data[key]).mean() > 0.8 for key in data.files)
    record = json.loads((folder / "verdicts.json").read_text())
    assert record["experiment"] == name
    assert record["verdicts"]
    assert all(v["tolerance"] > 0 and v["theory"] for v in record["verdicts"])


def test_same_settings_same_numbers(results: Path, tmp_path: Path) -> None:
    done = thesis("run", "decorrelation", "--out", tmp_path, "--config", results.parent / "config.json")
    assert done.returncode == 0, done.stderr
    verdicts = [
        json.loads((folder / "decorrelation" / "verdicts.json").read_text())["verdicts"]
        for folder in (results, tmp_path)
    ]
    assert verdicts[0] == verdicts[1]


def test_page_shows_every_figure_and_verdict(results: Path, tmp_path: Path) -> None:
    page = tmp_path / "thesis.md"
    write_page(program.EXPERIMENTS, results, page)
    text = page.read_text()
    for e in program.EXPERIMENTS:
        assert f"## Fig. {e.figures}: {e.title}" in text
        assert (tmp_path / "images" / "thesis" / f"{e.name}.png").is_file()
        record = experiment.read_record(e, results / e.name)
        assert record is not None
        assert all(f"| {v.what} |" in text for v in record.verdicts)
    assert all(len(line) <= 120 for line in text.splitlines() if not line.startswith("|"))
    with pytest.raises(SystemExit, match="no result of any experiment"):
        write_page(program.EXPERIMENTS, tmp_path, page)


def test_page_shows_what_there_is(results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = program.EXPERIMENTS[:2]
    (tmp_path / first.name).symlink_to(results / first.name)
    write_page([first, second], tmp_path, tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text()
    assert first.title in text
    assert second.title not in text
    assert f"Not run: {second.name}." in text
    assert f"no result of {second.name}" in capsys.readouterr().err


def test_a_wrong_theory_fails(results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half the light twice as often: an exponential law is not a Gamma law, and 400 samples tell."""
    config = json.loads((results.parent / "config.json").read_text())["intensity_law"]
    monkeypatch.setattr(intensity_law, "CASES", {"unpolarized": ("circular_gaussian", 1.0, "relative_diameter")})
    monkeypatch.setattr(intensity_law, "law", lambda _: intensity_law.stats.gamma(2, scale=0.5))
    verdicts = intensity_law.run(config, lambda _: None).verdicts
    assert not all(v.passed for v in verdicts)


def test_verdicts_are_never_passed_by_nan() -> None:
    verdict = experiment.Verdict("x", 1.0, 1.0, 0.1, "y")
    assert verdict.passed
    assert not dataclasses.replace(verdict, value=1.2).passed
    assert not dataclasses.replace(verdict, value=float("nan")).passed


def test_closed_forms() -> None:
    # A pupil that is open everywhere leaves one phasor per point: no contrast at all.
    assert theory.unit_phasor_deficit((16, 16), 4.0) == pytest.approx(1.0)
    assert theory.point_spread((32, 32), 0.5).sum() == pytest.approx(1.0)
    # 1/e at one correlation length, and exactly nothing from two knots on.
    assert theory.field_correlation(np.array([0.0, 1.0, 2.2])) == pytest.approx([1.0, np.exp(-1), 0.0], abs=1e-6)
    # A field of many phasors, and sums of two: by simulation, 10^5 samples, 4 standard errors.
    rng = np.random.default_rng(1)
    both = rng.exponential(size=(2, 100000))
    for p, x in ((1.0, both[0]), (0.0, both.sum(axis=0))):
        contrast = theory.contrast(p)
        assert x.std() / x.mean() == pytest.approx(contrast, abs=4 * theory.contrast_deviation(contrast, x.size))


def test_bad_input(tmp_path: Path) -> None:
    done = thesis("run", "figure31", "--out", tmp_path)
    assert done.returncode == 2
    assert "no experiment 'figure31'; there are: wavelength_shift, " in done.stderr
    done = thesis("run", "--out", tmp_path, "--config", tmp_path / "none.json")
    assert done.returncode == 2
    assert "cannot be read" in done.stderr
    (tmp_path / "empty.json").write_text("{}")
    done = thesis("run", "decorrelation", "--out", tmp_path, "--config", tmp_path / "empty.json")
    assert done.returncode == 2
    assert "no settings of decorrelation" in done.stderr
    for text, word in (("[]", "an object"), ('{"decorrelation": 3}', "an object is needed")):
        (tmp_path / "empty.json").write_text(text)
        done = thesis("run", "decorrelation", "--out", tmp_path, "--config", tmp_path / "empty.json")
        assert done.returncode == 2
        assert word in done.stderr
        assert "Traceback" not in done.stderr
    done = thesis("run", "decorrelation", "--out", tmp_path / "empty.json" / "out")
    assert done.returncode == 2
    assert "nothing can be written" in done.stderr
    assert "Traceback" not in done.stderr
    done = thesis("page", "--out", tmp_path, "--page", tmp_path / "page.md")
    assert done.returncode == 1
    assert "no result of any experiment" in done.stderr
    assert "Fig. 22, 23, 24" in thesis("list").stdout


def test_a_missing_package_is_named(tmp_path: Path) -> None:
    (tmp_path / "OpenEXR.py").write_text('raise ModuleNotFoundError("No module named OpenEXR", name="OpenEXR")\n')
    path = os.pathsep.join([str(tmp_path), str(ROOT / "validation"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "thesis", "list"],
        capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert done.returncode == 1
    assert "OpenEXR is not installed" in done.stderr
    assert "Traceback" not in done.stderr
    (needs,) = re.findall(r"pip install -r (\S+)", done.stderr)
    assert "OpenEXR" in Path(needs).read_text()
