"""`clspeckle doe design` and `clspeckle doe layout`: what they write, what they say, what they refuse."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

SMALL = ("--size", "96", "--pitch-um", "1", "--field-of-view", "24,18", "--dots", "60", "--min-difference", "0")
CELL = SMALL


def test_help_is_enough(ok) -> None:
    for command in ("design", "layout"):
        text = ok("doe", command, "--help").out
        assert "Examples:" in text
        assert "OUTPUT" in text
    assert "design" in ok("doe", "--help").out


def test_layout_then_design(ok, tmp_path: Path) -> None:
    found = ok("doe", "layout", "-o", tmp_path / "layout", *SMALL, "--json").json()
    layout = json.loads((tmp_path / "layout.json").read_text())
    assert found["files"] == [str(tmp_path / "layout.json")]
    assert len(layout["orders"]) == len(layout["directions"]) == 60
    step = layout["wavelength_m"] / (layout["pixel_pitch_m"] * layout["width"])
    np.testing.assert_allclose(np.array(layout["orders"]) * step, layout["directions"], rtol=1e-12, atol=1e-15)
    assert np.abs(layout["directions"]).max(axis=0)[0] <= math.sin(math.radians(12))

    report = ok(
        "doe", "design", tmp_path / "layout.json", "-o", tmp_path / "design", "--levels", "8", "--search", "2", "--json"
    ).json()
    assert report["efficiency"] > 0.7
    assert report["uniformity_rms"] < 0.1
    design = json.loads((tmp_path / "design.json").read_text())
    phase = np.load(tmp_path / "design.npy")
    assert phase.dtype == np.float32
    assert phase.shape == (96, 96)
    assert design["periodic"] is True
    assert design["levels"] == 8
    assert design["seed"] == 0
    assert (design["pixel_pitch_m"], design["wavelength_m"]) == (1e-6, 940e-9)
    assert design["tool"].startswith("clspeckle doe design")
    assert [order[:2] for order in design["orders"]] == layout["orders"]
    field = np.fft.fft2(np.exp(1j * phase.astype(float))) / phase.size
    m, n = np.array(layout["orders"]).T
    powers = np.abs(field[n % 96, m % 96]) ** 2 * np.sinc(m / 96) ** 2 * np.sinc(n / 96) ** 2
    assert powers.sum() == pytest.approx(report["efficiency"], rel=1e-5)
    assert powers.std() / powers.mean() == pytest.approx(report["uniformity_rms"], rel=1e-4)
    assert not list(tmp_path.glob("*.tmp*"))
    assert len(list(tmp_path.iterdir())) == 3


def test_design_makes_its_own_layout_and_repeats(ok, tmp_path: Path) -> None:
    for name in ("a", "b"):
        text = ok(
            "doe", "design", "-o", tmp_path / f"{name}.npy", *CELL, "--levels", "2", "--symmetric", "--seed", "3"
        ).out
        assert "efficiency" in text
        assert "uniformity" in text
        assert "zero order" in text
        assert "ghost" in text
    assert (tmp_path / "a.npy").read_bytes() == (tmp_path / "b.npy").read_bytes()
    assert (tmp_path / "a.json").exists()


def test_directions_are_snapped(ok, tmp_path: Path) -> None:
    (tmp_path / "list.json").write_text(json.dumps({"directions": [[0.1, 0.05], [-0.08, 0.02, 2], [0.0, -0.1]]}))
    report = ok(
        "doe", "design", tmp_path / "list.json", "-o", tmp_path / "d", *CELL[:4], "--levels", "0", "--json"
    ).json()
    assert 0 < report["snap_error"]["rms"] <= report["snap_error"]["largest"] <= 0.94 / 96 / math.sqrt(2)
    orders = json.loads((tmp_path / "d.json").read_text())["orders"]
    assert orders == [[10, 5, 1.0], [-8, 2, 2.0], [0, -10, 1.0]]


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("{}", (), "neither"),
        ("[1, 2]", (), "neither"),
        ("{", (), "not valid JSON"),
        ('{"orders": []}', (), "empty"),
        ('{"orders": 5}', (), "no list"),
        ('{"orders": [[1]]}', (), "orders[0]"),
        ('{"orders": [[1, 0.5]]}', (), "integer"),
        ('{"orders": [[1, 2], [1, 2]]}', (), "twice"),
        ('{"orders": [[1, 2, -1]]}', (), "weight"),
        ('{"orders": [[1, 2, null]]}', (), "number is needed"),
        ('{"orders": [[500, 2]]}', (), "outside"),
        ('{"orders": [[1, 2]], "width": 64}', (), "--size"),
        ('{"orders": [[1, 2]], "wavelength_m": 9e-7}', ("--wavelength-nm", "940"), "--wavelength-nm"),
        ('{"directions": [[0.8, 0.8]]}', (), "90 degrees"),
        ('{"directions": [[0.1, 0.1], [0.1001, 0.1]]}', (), "both"),
        ('{"orders": [[1, 2]]}', ("--levels", "1"), "levels"),
        ('{"orders": [[1, 2]]}', ("--levels", "2"), "give --mirror"),
        ('{"orders": [[1, 2]]}', ("--levels", "0", "--search", "3"), "--search"),
        ('{"orders": [[1, 2]]}', ("--levels", "-3"), "--levels"),
        ('{"orders": [[1, 2]]}', ("--dots", "-1"), "--dots"),
        ('{"orders": [[1, 2]]}', ("--dots", "70"), "no effect beside a list"),
        ('{"orders": [[1, 2]]}', ("--symmetric",), "no effect beside a list"),
        ('{"orders": [[1, 2]]}', ("--seed", str(2**64)), "--seed"),
        ('{"orders": [[1, 2]]}', ("--rule", "newton"), "newton"),
        ('{"orders": [[1, 2]]}', ("--period-um", "50"), "--period-um"),
        ('{"orders": [[1, 2]]}', ("--pitch-um", "nan"), "--pitch-um"),
        ('{"orders": [[1, 2]]}', ("--beam-um", "10"), "longer than the beam"),
        ('{"orders": [[1, 2], [2, 2]]}', ("--beam-um", "100"), "diffraction limit"),
    ],
)
def test_bad_input_is_refused_and_nothing_written(
    cli, tmp_path: Path, text: str, options: tuple[str, ...], words: str
) -> None:
    (tmp_path / "list.json").write_text(text)
    done = cli("doe", "design", tmp_path / "list.json", "-o", tmp_path / "out", *CELL[:4], *options)
    assert done.code == 1, done
    assert words in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["list.json"]


def test_files_are_not_overwritten_unasked(cli, ok, tmp_path: Path) -> None:
    ok("doe", "layout", "-o", tmp_path / "l", *SMALL)
    before = (tmp_path / "l.json").read_bytes()
    done = cli("doe", "layout", "-o", tmp_path / "l", *SMALL, "--seed", "1")
    assert done.code == 3
    assert "--overwrite" in done.err
    assert (tmp_path / "l.json").read_bytes() == before
    ok("doe", "layout", "-o", tmp_path / "l", *SMALL, "--seed", "1", "--overwrite")
    assert (tmp_path / "l.json").read_bytes() != before
    done = cli("doe", "layout", "-o", tmp_path / "nowhere" / "l", *SMALL)
    assert done.code == 3
    assert "does not exist" in done.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--dots", "0"), "expected an integer from 1 to 100000"),
        (("--free",), "no effect with --free"),
        (("--dots", "100000"), "orders within"),
        (("--field-of-view", "0,20"), "expected a number from 0.001 to 179.9"),
        (("--field-of-view", "100,100"), "90 degrees"),
        (("--min-distance", "0.2"), "find a place"),
        (("--min-distance", "nan"), "--min-distance"),
        (("--beam-um", "20"), "diffraction limit"),
        (("--min-difference", "2"), "--min-difference"),
    ],
)
def test_bad_layouts_are_refused(cli, tmp_path: Path, options: tuple[str, ...], words: str) -> None:
    fixed = [*SMALL[:4], *SMALL[6:]] if options[0] == "--field-of-view" else SMALL
    done = cli("doe", "layout", "-o", tmp_path / "l", *fixed, *options)
    assert done.code == 1, done
    assert words in done.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "arguments",
    [
        ("design", *SMALL, "--iterations", "100000"),
        ("layout", *SMALL[:-2], "--min-difference", "1", "--repair-rounds", "1000000"),
    ],
)
def test_ctrl_c_leaves_nothing(program: Path, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    command = [program, "doe", arguments[0], "-o", tmp_path / "d", *arguments[1:]]
    process = subprocess.Popen([str(word) for word in command], stderr=subprocess.PIPE, text=True)
    time.sleep(2)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    assert process.stderr is not None
    assert "interrupted" in process.stderr.read()
    assert not list(tmp_path.iterdir())


def test_output_is_both_files_or_none(ok, refused, tmp_path: Path) -> None:
    (tmp_path / "d.npy").write_text("mine")
    (tmp_path / "d.json").mkdir()
    assert "d.json" in refused("doe", "design", "-o", "d", *SMALL, "--overwrite", code=3)
    assert (tmp_path / "d.npy").read_text() == "mine"
    (tmp_path / "list.json").write_text('{"orders": [[1, 2]]}')
    message = refused("doe", "design", "list.json", "-o", "list", *CELL[:4], "--overwrite")
    assert "overwrite the input list.json" in message
    assert (tmp_path / "list.json").read_text() == '{"orders": [[1, 2]]}'
    assert not (tmp_path / "list.npy").exists()
    for name in ("", "sub/", "./"):
        assert "a name is needed" in refused("doe", "layout", "-o", name, *SMALL)
    ok("doe", "design", "-o", "a.npy", *SMALL)
    assert {path.name for path in tmp_path.glob("a.*")} == {"a.npy", "a.json"}
