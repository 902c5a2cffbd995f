"""Maps of a camera's own pixels: measured by diagnose --profile, used by render --profile. The camera is made here, by
NumPy."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from cli_support import frames

HEIGHT, WIDTH, FRAMES = 80, 96, 16
BLACK, READ_NOISE, LIGHT, DN_PER_ELECTRON = 64.0, 3.0, 400.0, 0.2
HELD = {
    "dark": ["dsnu", "column_fpn", "row_fpn", "periodic_offset", "hot_pixels"],
    "gain": ["prnu", "column_gain", "row_gain", "pixel_dull"],
}


def camera() -> tuple[np.ndarray, np.ndarray]:
    """Offsets in DN and relative gains: DSNU of 2 DN, 0.5 % hot pixels; PRNU of 2 %."""
    rng = np.random.default_rng(11)
    offsets = rng.normal(0, 2, (HEIGHT, WIDTH))
    hot = rng.random((HEIGHT, WIDTH)) < 0.005
    offsets[hot] += rng.exponential(150, hot.sum())
    return offsets, rng.normal(1, 0.02, (HEIGHT, WIDTH))


def record(light: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Frames of the camera in a light in DN."""
    rng = np.random.default_rng(seed)
    offsets, gains = camera()
    signal = DN_PER_ELECTRON * rng.poisson(np.broadcast_to(light * gains / DN_PER_ELECTRON, (count, HEIGHT, WIDTH)))
    return np.clip(np.rint(BLACK + offsets + signal + rng.normal(0, READ_NOISE, signal.shape)), 0, 1023).astype(
        np.uint16
    )


def slope() -> np.ndarray:
    """Of the lamp, 10 % across the image."""
    return np.broadcast_to(1 + 0.05 * np.linspace(-1, 1, WIDTH), (HEIGHT, WIDTH))


def lamp() -> np.ndarray:
    """Behind the lens, with a fall-off of 20 % to the corners."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    r2 = ((x - (WIDTH - 1) / 2) ** 2 + (y - (HEIGHT - 1) / 2) ** 2) / (((WIDTH - 1) / 2) ** 2 + ((HEIGHT - 1) / 2) ** 2)
    return LIGHT * slope() * (1 - 0.2 * r2)


def write_set(folder: Path, sequences: dict[str, tuple[str, np.ndarray]]) -> None:
    folder.mkdir()
    listed = []
    for name, (scene, codes) in sequences.items():
        np.save(folder / f"{name}.npy", codes)
        listed.append({"name": name, "scene": scene, "motion": "static", "file": f"{name}.npy"})
    about = {
        "width": WIDTH,
        "height": HEIGHT,
        "bits": 10,
        "pixel_pitch_um": 2.9,
        "f_number": 5.6,
        "black_level_dn": BLACK,
        "read_noise_dn": READ_NOISE,
    }
    capture = {
        "format": "clspeckle-capture",
        "version": 1,
        "camera": about,
        "laser": {"wavelength_nm": 940.0, "degree_of_polarization": 1.0},
    }
    (folder / "capture.json").write_text(
        json.dumps(capture | {"baseline": {"field": "circular_gaussian"}, "sequences": listed})
    )


@pytest.fixture(scope="module")
def diagnosed(program: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dark and a flat of 16 frames of 96 x 80 pixels, and their profile."""
    folder = tmp_path_factory.mktemp("maps")
    write_set(
        folder / "real",
        {"dark": ("dark", record(np.zeros((HEIGHT, WIDTH)), FRAMES, 1)), "flat": ("flat", record(lamp(), FRAMES, 2))},
    )
    run = subprocess.run(
        [str(program), "diagnose", "real", "--profile", "camera.json", "--seed", "1"],
        cwd=folder,
        check=True,
        capture_output=True,
        text=True,
        timeout=600,
    )
    (folder / "diagnose.txt").write_text(run.stdout)
    np.save(folder / "flat.npy", slope().astype(np.float32))  # the lens is the profile's: vignetting
    return folder


@pytest.fixture
def here(diagnosed: Path, tmp_path: Path) -> Path:
    for path in diagnosed.glob("*.*"):
        shutil.copy(path, tmp_path)
    return tmp_path


def test_a_profile_in_the_folder_of_the_set_is_replaced(ok, refused, here: Path, diagnosed: Path) -> None:
    """What an earlier run wrote may be replaced; what capture.json names, and other frames, may not."""
    shutil.copytree(diagnosed / "real", here / "set")
    for path in here.glob("camera.*"):
        path.rename(here / "set" / path.name)
    written = {path.name: path.stat().st_mtime_ns for path in (here / "set").glob("camera.*")}
    assert sorted(written) == ["camera.dark.npy", "camera.gain.npy", "camera.json"]
    ok("diagnose", "set", "--profile", "set/camera.json", "--replicates", 19, "--max-effects", 1, "--seed", 2)
    assert all((here / "set" / name).stat().st_mtime_ns > before for name, before in written.items())
    # A map that a description takes for frames is one of them.
    about = json.loads((here / "set" / "capture.json").read_text())
    about["sequences"][0]["file"] = "*dark.npy"
    (here / "set" / "capture.json").write_text(json.dumps(about))
    assert "set/camera.dark.npy: belongs to the capture set" in refused(
        "diagnose", "set", "--profile", "set/camera.json"
    )
    (here / "set" / "camera.json").write_text("{}")
    assert "camera.dark.npy: belongs to the capture set" in refused("diagnose", "set", "--profile", "set/camera.json")
    # Frames whose names have no ending of an image.
    (here / "set" / "flat.npy").rename(here / "set" / "flat.codes")
    about["sequences"][1]["file"] = "flat.codes"
    (here / "set" / "capture.json").write_text(json.dumps(about))
    assert "set/flat.codes: belongs to the capture set" in refused("diagnose", "set", "--json", "set/flat.codes")


def render(ok, folder: Path, sequence: str, *options: object) -> np.ndarray:
    """The same sequence as was recorded, by the profile's camera; another stretch of the noise for each."""
    first = {"dark": 0, "flat": 1 << 20}[sequence]
    ok(
        "render",
        "flat.npy",
        "-o",
        f"out_{sequence}",
        "--profile",
        "camera.json",
        "--profile-sequence",
        sequence,
        "--frames",
        FRAMES,
        "--first-frame",
        first,
        "--format",
        "npy",
        "--no-preview",
        "--seed",
        12,
        "--quiet",
        *options,
    )
    return np.stack(frames(folder / f"out_{sequence}"))


def alike(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def test_maps_are_the_camera(diagnosed: Path) -> None:
    profile = json.loads((diagnosed / "camera.json").read_text())
    assert (
        profile["version"] == 2 and set(profile["maps"]) == {"dark", "gain", "notes"} and not profile["maps"]["notes"]
    )
    offsets, gains = camera()
    truths = {"dark": offsets, "gain": gains / gains.mean()}
    # Noise of the mean of 16 frames: of the read noise and the rounding, and of both and the photons over the light.
    dark_error = np.sqrt((READ_NOISE**2 + 1 / 12) / FRAMES)
    light = lamp().mean()
    flat_error = np.hypot(np.sqrt((READ_NOISE**2 + 1 / 12 + DN_PER_ELECTRON * light) / FRAMES), dark_error) / light
    for name, error in (("dark", dark_error), ("gain", flat_error)):
        entry = profile["maps"][name]
        assert (entry["file"], entry["shape"], entry["holds"]) == (f"camera.{name}.npy", [HEIGHT, WIDTH], HELD[name])
        assert entry["sequences"] == [{"dark": "dark", "gain": "flat"}[name]] and entry["frames"] == FRAMES
        stated = entry["standard_error_dn" if name == "dark" else "standard_error"]
        assert stated == pytest.approx(error, rel=0.05)
        found = np.load(diagnosed / entry["file"])
        assert found.dtype == np.float32 and found.shape == (HEIGHT, WIDTH)
        assert alike(found, truths[name]) > 0.9
        # Without hot pixels: the pattern has the variance of the camera's own, and is off by no more than the noise.
        usual = offsets < 20
        assert found[usual].std() == pytest.approx(truths[name][usual].std(), rel=0.05)
        assert (found - truths[name])[usual].std() < 1.1 * stated
    # A hot pixel stays as hot as it is.
    hot = offsets > 50
    np.testing.assert_allclose(np.load(diagnosed / "camera.dark.npy")[hot], offsets[hot], atol=5 * dark_error)
    # FNV-1a of the bytes: what a file is known by.
    value = 0xCBF29CE484222325
    for byte in np.load(diagnosed / "camera.dark.npy").tobytes():
        value = (value ^ byte) * 0x100000001B3 % 2**64
    assert profile["maps"]["dark"]["fnv1a"] == f"{value:016x}"
    assert (
        "camera.dark.npy: offsets of the pixels of 16 frames, noise left 0.7"
        in (diagnosed / "diagnose.txt").read_text()
    )


def test_round_trip(ok, here: Path, diagnosed: Path) -> None:
    """Rendered with its maps the camera has the pixels of the real one: the mean dark frame correlates with the truth,
    and gap compare finds nothing. Size: of 24 such cameras with other seeds the dark had 0.994 at least, the light,
    whose 16 frames have noise of their own, 0.898, and 23 had no gap at the level of 2 %. Power: with patterns drawn
    anew it was 0.04 at most."""
    offsets, gains = camera()
    dark, flat = render(ok, here, "dark"), render(ok, here, "flat")
    assert alike(dark.mean(axis=0), offsets) > 0.9
    assert dark.mean() == pytest.approx(BLACK + offsets.mean(), abs=0.3)
    lit = (flat.mean(axis=0) - dark.mean(axis=0)) / lamp()
    assert alike(lit, gains) > 0.85
    write_set(here / "again", {"dark": ("dark", dark), "flat": ("flat", flat)})
    report = ok(
        "gap", "compare", diagnosed / "real", "again", "--profile", "camera.json", "--json", "-", "--quiet"
    ).json()
    assert report["cause"]["verdict"] == "none", report["where"][:5]
    anew = render(ok, here, "dark", "--profile-maps", "off")
    assert abs(alike(anew.mean(axis=0), offsets)) < 0.1
    assert anew.mean(axis=0).std() > 2, "there are patterns"


def test_options_replace_maps_and_say_so(ok, refused, here: Path) -> None:
    common = [
        "render",
        "flat.npy",
        "-o",
        "out",
        "--profile",
        "camera.json",
        "--no-preview",
        "--format",
        "npy",
        "--exposure-gain",
        100,
        "--json",
    ]
    summary = ok(*common).json()
    assert Path(summary["config"]["sensor"]["dark_frame"]).name == "camera.dark.npy"
    assert Path(summary["config"]["sensor"]["gain_map"]).name == "camera.gain.npy"
    assert not set(summary["config"]["effects"]) & {*HELD["dark"], *HELD["gain"]}
    off = ok(*common, "--profile-maps", "off").json()
    assert (off["config"]["sensor"]["dark_frame"], off["config"]["sensor"]["gain_map"]) == ("", "")
    assert {"dsnu", "prnu"} <= set(off["config"]["effects"])
    np.save(here / "own.npy", np.zeros((HEIGHT, WIDTH), np.float32))
    own = ok(*common, "--dark-frame", "own.npy").json()
    assert any("--dark-frame" in text and "camera.dark.npy" in text for text in own["profile"]["replaced"])
    both = ok(*common, "--effect", "dsnu:sigma_dn=3").json()
    assert any("the effect dsnu:sigma_dn=3 is drawn on top of" in text for text in both["warnings"])
    assert "--profile-maps off: name the profile, too" in refused(
        "render", "flat.npy", "-o", "none", "--profile-maps", "off"
    )
    # What was rendered can be rendered again without the profile.
    ok("render", "flat.npy", "-o", "again", "--config", "out/config.json")
    assert np.array_equal(*frames(here / "out"), *frames(here / "again"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("missing", ["camera.dark.npy", "No such file"]),
        ("smaller", ["has 96 x 40 pixels, expected the camera's 96 x 80"]),
        ("changed", ["is not as it was written", "expected"]),
        ("double", ["of float64, expected one number of float32 for each pixel"]),
        ("cut", ["camera.dark.npy"]),
    ],
)
def test_maps_that_are_not_those_are_refused(ok, refused, here: Path, change: str, words: list[str]) -> None:
    path = here / "camera.dark.npy"
    values, data = np.load(path), path.read_bytes()
    if change == "missing":
        path.unlink()
    elif change == "cut":
        path.write_bytes(data[:-100])
    else:
        np.save(
            path, {"smaller": values[:40], "changed": values + np.float32(1), "double": values.astype(float)}[change]
        )
    common = ["render", "flat.npy", "--profile", "camera.json", "--no-preview", "--exposure-gain", 100]
    message = refused(*common, "-o", "none")
    for word in ("the dark map of camera.json: ", *words, "diagnose the capture again", "--profile-maps off"):
        assert word in message, message
    assert not (here / "none").exists()
    ok(*common, "-o", "out", "--profile-maps", "off")  # what the message says


def test_patterns_on_top_of_a_configuration_are_told(ok, here: Path) -> None:
    """Without the profile's maps its patterns are drawn: a configuration that has the maps would have them twice."""
    common = ["render", "flat.npy", "--profile", "camera.json", "--no-preview", "--exposure-gain", 100]
    printed = ok(*common, "-o", "with").out
    assert "dark frame  " in printed and "camera.gain.npy" in printed
    ok(*common, "-o", "anew", "--profile-maps", "off")
    config = {"sensor": {"dark_frame": str(here / "camera.dark.npy")}}
    (here / "mine.json").write_text(json.dumps(config))
    twice = ok(*common, "-o", "twice", "--profile-maps", "off", "--config", "mine.json", "--json").json()
    told = [text for text in twice["warnings"] if "is drawn on top of" in text]
    assert any("dsnu" in text and "leave one of them out" in text for text in told) and not any(
        "prnu" in text for text in told
    )


def test_a_link_to_a_profile_finds_its_maps(ok, here: Path) -> None:
    (here / "elsewhere").mkdir()
    (here / "elsewhere" / "mine.json").symlink_to(here / "camera.json")
    ok("render", "flat.npy", "-o", "out", "--profile", "elsewhere/mine.json", "--no-preview", "--exposure-gain", 100)


def notes_of(
    ok, folder: Path, sequences: dict[str, tuple[str, np.ndarray]], masks: dict[str, np.ndarray]
) -> tuple[set[str], str]:
    """The maps of a diagnosis, and its notes on them."""
    write_set(folder / "real", sequences)
    capture = json.loads((folder / "real" / "capture.json").read_text())
    for sequence in capture["sequences"]:
        if sequence["name"] in masks:
            sequence["mask"] = f"mask_{sequence['name']}.npy"
            np.save(folder / "real" / sequence["mask"], masks[sequence["name"]].astype(np.uint8))
    (folder / "real" / "capture.json").write_text(json.dumps(capture))
    ok("diagnose", "real", "--profile", "camera.json", "--seed", 1)
    maps = json.loads((folder / "camera.json").read_text())["maps"]
    return set(maps) - {"notes"}, " ".join(maps["notes"])


def test_a_dead_pixel_takes_no_map_and_uneven_light_is_told(ok, tmp_path: Path) -> None:
    """A lamp with a spot of 6 % and 12 pixels across is no polynomial of low degree; its blocks differ by about 1.3 %,
    chance makes 0.14 %."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    spot = 1 + 0.06 * np.exp(-((x - 60) ** 2 + (y - 30) ** 2) / (2 * 12**2))
    dark, flat = record(np.zeros((HEIGHT, WIDTH)), FRAMES, 1), record(lamp() * spot, FRAMES, 2)
    dark[:, 20, 30] = flat[:, 20, 30] = 0
    maps, notes = notes_of(ok, tmp_path, {"dark": ("dark", dark), "flat": ("flat", flat)}, {})
    assert maps == {"dark", "gain"}
    assert "the gain map holds light: parts of the image differ by" in notes and "at 0" not in notes
    assert np.load(tmp_path / "camera.dark.npy")[20, 30] == pytest.approx(-BLACK, abs=1)


def test_a_map_below_its_noise_and_masks_without_a_common_pixel(ok, tmp_path: Path) -> None:
    """DSNU of 0.3 DN is beyond chance in 7680 pixels, but a pixel of 16 frames with a read noise of 3 DN is off by 0.75
    DN."""
    rng = np.random.default_rng(5)
    offsets = rng.normal(0, 0.3, (HEIGHT, WIDTH))
    codes = [
        BLACK + offsets + light + rng.normal(0, noise, (FRAMES, HEIGHT, WIDTH)) for light, noise in ((0, 3), (400, 9))
    ]
    left = np.broadcast_to(np.arange(WIDTH) < WIDTH // 2, (HEIGHT, WIDTH))
    dark, flat = (np.clip(np.rint(c), 0, 1023).astype(np.uint16) for c in codes)
    maps, notes = notes_of(
        ok, tmp_path, {"dark": ("dark", dark), "flat": ("flat", flat)}, {"dark": left, "flat": ~left}
    )
    assert not maps
    assert "no dark map: its noise, 0.75" in notes and "is larger than its pattern, 0.3" in notes
    assert "no gain map: no pixel counts in both a dark sequence and a flat" in notes


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (
            "dark/file",
            "../camera.dark.npy",
            '/maps/dark/file is "../camera.dark.npy"; expected the name of a file beside the profile',
        ),
        ("dark/shape", [HEIGHT, 8], "/maps/dark/shape is [80,8]; expected [80,96]"),
        ("gain/fnv1a", "xyz", '/maps/gain/fnv1a is "xyz"; expected 16 hexadecimal digits'),
        ("gain/holds", ["prnoo"], '/maps/gain/holds/0 is "prnoo"; clSpeckle'),
        ("gain/standard_error", -1, "/maps/gain/standard_error is -1"),
        ("flat", {}, "/maps/flat is {}; no such key is known here, expected dark, gain, notes"),
    ],
)
def test_damaged_entries_are_refused(refused, here: Path, path: str, value: object, words: str) -> None:
    profile = json.loads((here / "camera.json").read_text())
    *parents, key = path.split("/")
    (profile["maps"][parents[0]] if parents else profile["maps"])[key] = value
    (here / "bad.json").write_text(json.dumps(profile))
    assert words in refused("render", "flat.npy", "-o", "out", "--profile", "bad.json")


def test_first_version_has_no_maps(ok, refused, here: Path) -> None:
    profile = json.loads((here / "camera.json").read_text())
    (here / "bad.json").write_text(json.dumps(profile | {"version": 1}))
    assert "/maps is {" in refused("render", "flat.npy", "-o", "none", "--profile", "bad.json")
    del profile["maps"]
    (here / "old.json").write_text(json.dumps(profile | {"version": 1}))
    old = ok(
        "render", "flat.npy", "-o", "out", "--profile", "old.json", "--exposure-gain", 100, "--no-preview", "--json"
    ).json()
    assert {"dsnu", "prnu"} <= set(old["config"]["effects"])


def test_single_frames_have_no_maps_and_render(ok, refused, tmp_path: Path) -> None:
    """One frame does not tell its noise from its pattern. The rest of the profile is there, and can be rendered."""
    write_set(
        tmp_path / "real",
        {"dark": ("dark", record(np.zeros((HEIGHT, WIDTH)), 1, 1)), "flat": ("flat", record(lamp(), 1, 2))},
    )
    text = ok("diagnose", "real", "--profile", "camera.json", "--seed", 1).out
    assert "no dark map: dark: one frame does not tell its noise from its pattern; record two or more" in text
    assert not list(tmp_path.glob("camera.*.npy"))
    np.save(tmp_path / "flat.npy", np.ones((HEIGHT, WIDTH), np.float32))
    ok("render", "flat.npy", "-o", "out", "--profile", "camera.json", "--profile-sequence", "flat", "--no-preview")


def test_files_are_not_overwritten(refused, here: Path, diagnosed: Path) -> None:
    assert "its map x.dark.npy is what another option names" in refused(
        "diagnose", diagnosed / "real", "--profile", "x.json", "--json", "x.dark.npy"
    )
    (here / "x.gain.npy").mkdir()
    assert "x.gain.npy: is a folder" in refused("diagnose", diagnosed / "real", "--profile", "x.json", code=3)
    assert "/dev/null: is no regular file" in refused("diagnose", diagnosed / "real", "--profile", "/dev/null", code=3)
    (here / "mine.json").write_text("{}")
    for option in ("--hypothesis", "--tolerance"):
        message = refused("diagnose", diagnosed / "real", option, "mine.json", "--profile", "mine.json")
        assert "mine.json: is read, too; choose another file for the output" in message
