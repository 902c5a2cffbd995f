"""`clspeckle capture make` and `capture check`."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

import clspeckle

Cli = Callable[..., subprocess.CompletedProcess[str]]
SMALL = ("--width", 48, "--height", 40, "--frames", 6)


def test_a_made_set_is_what_the_options_say(cli: Cli, tmp_path: Path) -> None:
    """48 x 40 pixels, 6 frames: means of speckle are good to about 5 % (some 500 grains in motion), noise to 1 %."""
    cli("capture", "make", "set", *SMALL, "--seed", 7, "--flat-level", 300, "--board-level", 100, "--read-noise-dn", 3)
    capture = clspeckle.Capture.open(tmp_path / "set")
    seen = {name: np.asarray(s.codes, np.float64) for name, s in capture.sequences.items()}
    assert list(seen) == ["dark", "flat", "board_static", "board_moving", "dots_static", "dots_moving"]
    assert all(array.shape == (6, 40, 48) for array in seen.values())
    assert abs(seen["dark"].mean() - 64) < 0.2
    assert abs(seen["flat"].mean() - 364) < 1
    assert abs(seen["board_moving"].mean() - 164) < 10
    noise = {name: np.sqrt(array.var(axis=0, ddof=1).mean()) for name, array in seen.items()}
    for name in ("dark", "flat", "board_static", "dots_static"):
        assert abs(noise[name] - 3) < 0.15, "nothing but read noise changes where nothing moves"
    assert noise["board_moving"] > 50, "each frame has speckle of its own"
    assert len(capture.dots_px) == 3 * 2
    assert not (tmp_path / "set" / "key.json").exists()


def test_fixed_patterns_are_the_same_in_all_sequences(cli: Cli, tmp_path: Path) -> None:
    """DSNU of 5 DN against 3 / sqrt(6) DN of averaged noise: two maps correlate to 25 / (25 + 1.5) = 0.94."""
    cli("capture", "make", "set", *SMALL, "--sequences", "dark,flat", "--read-noise-dn", 3, "--effect",
        "dsnu:sigma_dn=5", "--key")  # fmt: skip
    maps = [np.load(tmp_path / "set" / f"{name}.npy").mean(axis=0).ravel() for name in ("dark", "flat")]
    assert np.corrcoef(*maps)[0, 1] > 0.9
    key = json.loads((tmp_path / "set" / "key.json").read_text())
    assert key["effects"] == {"dsnu": {"sigma_dn": 5.0}} and key["in_catalogue"]


def test_a_made_set_shares_no_noise_with_what_a_diagnosis_simulates(cli: Cli, tmp_path: Path) -> None:
    """The camera's noise is that of another seed than the one given: captures of a diagnosis have numbers as small.

    Noise of the same numbers would correlate to 0.99; two others to 0 +- 0.009, of 11,520 pixels."""
    cli("capture", "make", "set", *SMALL, "--sequences", "dark", "--seed", 3)
    dark = np.load(tmp_path / "set" / "dark.npy").astype(np.float64).ravel()
    camera = clspeckle.Pipeline.from_parameters((40, 48), seed=3, black_level_dn=64, read_noise_dn=4)
    other = np.concatenate([camera.render(illumination="dark", frame_index=i).ravel() for i in range(6)])
    assert abs(np.corrcoef(dark, other.astype(np.float64))[0, 1]) < 0.05


def test_a_wall_goes_on_beyond_a_lens_that_distorts_it(cli: Cli, tmp_path: Path) -> None:
    """Outermost pixels of a flat: a mean of 176 pixels in 6 frames is good to 0.12 DN."""
    cli("capture", "make", "set", *SMALL, "--sequences", "flat,board_static,dots_static", "--effect",
        "lens_distortion:k1=-0.1")  # fmt: skip
    flat = np.load(tmp_path / "set" / "flat.npy").astype(np.float64)
    border = np.concatenate([flat[:, 0].ravel(), flat[:, -1].ravel(), flat[:, :, 0].ravel(), flat[:, :, -1].ravel()])
    assert abs(border.mean() - flat[:, 4:-4, 4:-4].mean()) < 0.6
    board = np.load(tmp_path / "set" / "board_static.npy").astype(np.float64)
    assert board[:, 0].mean() > 100, "speckle there, too"


def test_a_lens_whose_speckle_is_finer_than_the_pixels(cli: Cli, tmp_path: Path) -> None:
    """D = 1.54 at f/2: pixels see points, an exponential law. 11,520 nearly independent ones: the share is good to
    0.002."""
    cli("capture", "make", "set", *SMALL, "--sequences", "board_moving", "--board-level", 150, "--read-noise-dn", 0,
        "--f-number", 2)  # fmt: skip
    light = np.load(tmp_path / "set" / "board_moving.npy").astype(np.float64) - 64
    assert abs((light < 8).mean() - (1 - np.exp(-7.5 / 150))) < 0.01
    refused = cli("capture", "make", "finer", *SMALL, "--f-number", 0.6, code=1)
    assert "at most 3.5 can be drawn" in refused.stderr


def test_the_seed_decides(cli: Cli, tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        cli("capture", "make", name, *SMALL, "--frames", 2, "--sequences", "board_static,dots_static", "--seed", seed)
    a, b, c = ((tmp_path / name / "dots_static.npy").read_bytes() for name in "abc")
    assert a == b and a != c
    board, dots = (np.load(tmp_path / "a" / f"{name}.npy")[0] for name in ("board_static", "dots_static"))
    assert not np.array_equal(board, dots)


def test_levels_give_several_sequences(cli: Cli, tmp_path: Path) -> None:
    cli("capture", "make", "set", *SMALL, "--sequences", "flat", "--flat-level", "100,400")
    sequences = clspeckle.Capture.open(tmp_path / "set").sequences
    assert [(name, s.exposure_ms) for name, s in sequences.items()] == [("flat_1", 10.0), ("flat_2", 40.0)]
    assert abs(np.mean(sequences["flat_2"].codes) - 464) < 1


def test_dots_come_from_a_file(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "dots.json").write_text('{"sigma_px": 3.0, "positions_px": [[20.0, 20.0], [30.5, 10.0]]}')
    cli("capture", "make", "set", *SMALL, "--sequences", "dots_moving", "--dots", "dots.json")
    capture = clspeckle.Capture.open(tmp_path / "set")
    assert capture.dots_px.tolist() == [[20.0, 20.0], [30.5, 10.0]] and capture.dots_sigma_px == 3.0
    mean = np.asarray(capture.sequences["dots_moving"].codes).mean(axis=0)
    assert mean[17:24, 17:24].mean() > mean[30:, 40:].mean() + 50


def test_check_explains(cli: Cli, tmp_path: Path) -> None:
    cli("capture", "make", "set", *SMALL, "--sequences", "board_static")
    text = cli("capture", "check", "set").stdout
    assert "It cannot tell:" in text and "cover the lens" in text and "motion_decorrelation" in text
    cli("capture", "check", "set", "--json", "summary.json")
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written == json.loads(cli("capture", "check", "set", "--json", "-").stdout)
    assert written == clspeckle.Capture.open(tmp_path / "set").summary()


def test_help_tells_the_exit_codes(cli: Cli) -> None:
    for command in ("check", "make"):
        assert "Exit codes:" in cli("capture", command, "--help").stdout


def test_bad_input(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    assert "exists" in cli("capture", "make", "there", code=1).stderr
    assert "no effect" in cli("capture", "make", "new", "--effect", "nonsense", code=1).stderr
    assert "must be" in cli("capture", "make", "new", "--effect", "dsnu:sigma_dn=-1", code=1).stderr
    twice = ("--effect", "gamma:gamma=0.8", "--effect", "gamma:gamma=0.9")
    assert "gamma is given twice" in cli("capture", "make", "new", *twice, code=1).stderr
    hidden = ("--sequences", "flat", "--effect", "lens_distortion")
    assert "shows with dots alone" in cli("capture", "make", "new", *hidden, code=1).stderr
    assert 'there is no "moon"' in cli("capture", "make", "new", "--sequences", "moon", code=1).stderr
    assert (
        "--flat-level: the level of flat is -3 DN" in cli("capture", "make", "new", "--flat-level", -3, code=1).stderr
    )
    for option, value, expected in (
        ("--bits", 20, "an integer from 8 to 16"),
        ("--frames", 0, "an integer from 1 to 65535"),
        ("--frames", 2**32 + 1, "an integer from 1 to 65535"),
        ("--width", -64, "an integer from 8 to 16384"),
        ("--height", "many", "an integer from 8 to 16384"),
        ("--seed", -1, "an integer from 0 to 18446744073709551615"),
        ("--f-number", "nan", "a number from 0.1 to 1000"),
        ("--wavelength-nm", 0, "a number from 100 to 20000"),
        ("--degree-of-polarization", 1.5, "a number from 0 to 1"),
        ("--read-noise-dn", -4, "a number from 0 to 65535"),
        ("--black-level-dn", "inf", "a number from 0 to 65535"),
        ("--dots-pitch", 0, "a number from 2 to 16384"),
        ("--dots-sigma", -1, "a number from 0.01 to 16384"),
        ("--dots-count", -5, "an integer from 0 to 1000000"),
    ):
        shown = cli("capture", "make", "new", option, value, code=1).stderr
        assert f'{option}: is "{value}"; expected {expected}' in shown
    assert "unit_phasor" in cli("capture", "make", "new", "--field", "gaussian", code=1).stderr
    shown = cli("capture", "make", "new", "--black-level-dn", 2000, code=1).stderr
    assert "/camera/black_level_dn is 2000" in shown and "CLSP_" not in shown and "clspCapture" not in shown
    assert (
        "nearest one is --frames (see clspeckle capture make --help)"
        in cli("capture", "make", "x", "--frame", 3, code=1).stderr
    )
    assert 'nearest one is "check"' in cli("capture", "chek", code=1).stderr
    assert "does not exist" in cli("capture", "check", "nowhere", code=1).stderr
    assert "name a file" in cli("capture", "check", "there", "--json", "", code=1).stderr
    assert "no capture.json" in cli("capture", "check", "there", code=1).stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["there"], "something was left behind"


def test_a_bad_set_says_what_to_do(cli: Cli, tmp_path: Path) -> None:
    """What was wrong, what was expected and what to do, with file and field, in one line."""
    cli("capture", "make", "set", *SMALL, "--sequences", "dark,board_static")
    text = (tmp_path / "set" / "capture.json").read_text()
    description = json.loads(text)
    number = [sequence["name"] for sequence in description["sequences"]].index("dark")
    dark = np.load(tmp_path / "set" / "dark.npy")
    objects = np.empty(2, dtype=object)
    objects[:] = [dark[0], dark[1, :-1]]

    def said(*words: str) -> None:
        shown = cli("capture", "check", "set", code=1).stderr
        for word in words:
            assert word in shown, f"{word} is not in: {shown}"
        assert shown.count("\n") == 1, shown

    field = (
        f"capture.json: /sequences/{number}/file names it; expected there is an .npy stack of (frames, height, width)"
    )
    for array, words in ((objects, "Python objects"), (dark[:0], "empty array")):
        np.save(tmp_path / "set" / "dark.npy", array, allow_pickle=True)
        said("dark.npy: ", words, field, "or take the sequence out")
    np.save(tmp_path / "set" / "dark.npy", dark)
    np.save(tmp_path / "set" / "mask.npy", np.ones(dark.shape[:0:-1], np.uint8))
    description["sequences"][number]["mask"] = "mask.npy"
    (tmp_path / "set" / "capture.json").write_text(json.dumps(description))
    said("mask.npy: the mask has", "exchanged", f"/sequences/{number}/mask names it", "replace it, or take")
    del description["laser"]
    (tmp_path / "set" / "capture.json").write_text(json.dumps(description))
    said("/laser is missing", '{"wavelength_nm": 940.0', '"board_static" shows its light')
    (tmp_path / "set" / "capture.json").write_text(text.replace('"bits": 10,', '"bits": 10'))
    said("is not valid JSON: parse error at line", '"bits": 10', "a comma is between two entries")
