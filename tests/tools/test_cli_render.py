"""What render does with frames: determinism, repetition, refresh, exposure, summaries."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import time
from pathlib import Path

import cli_images as images
import imageio.v3 as iio
import numpy as np
import pytest
from cli_support import frames

QUICK = ["--format", "npy", "--no-preview"]


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "config.json"}


def test_same_seed_same_bytes(ok, ideal: Path, tmp_path: Path) -> None:
    settings = [ideal, "--frames", 2, "--save-ideal", "--degree-of-polarization", 0.5]
    ok("render", *settings, "-o", "a", "--seed", 5)
    ok("render", *settings, "-o", "b", "--seed", 5)
    ok("render", *settings, "-o", "c", "--seed", 6)
    assert len(files(tmp_path / "a")) == 6
    assert files(tmp_path / "a") == files(tmp_path / "b")
    for name in ("frame_000000.png", "frame_000001.png"):
        assert files(tmp_path / "a")[name] != files(tmp_path / "c")[name]


def test_seeds_of_speckle_and_noise_are_apart(ok, ideal: Path, tmp_path: Path) -> None:
    """Without noise the sensor's seed changes nothing; without light the speckle's seed changes nothing."""
    quiet, dark = ["--read-noise", 0], ["--exposure-gain", 0]
    for name, settings in {
        "quiet": quiet,
        "quiet_sensor": [*quiet, "--sensor-seed", 9],
        "quiet_phase": [*quiet, "--phase-seed", 9],
        "dark": dark,
        "dark_sensor": [*dark, "--sensor-seed", 9],
        "dark_phase": [*dark, "--phase-seed", 9],
    }.items():
        ok("render", ideal, "-o", name, *QUICK, *settings)
    frame = {path.parent.name: path.read_bytes() for path in tmp_path.glob("*/frame_000000.npy")}
    assert frame["quiet"] == frame["quiet_sensor"] != frame["quiet_phase"]
    assert frame["dark"] == frame["dark_phase"] != frame["dark_sensor"]


def test_still_scene_keeps_its_speckle_and_renews_its_noise(ok, tmp_path: Path) -> None:
    """64 x 64 pixels with noise of 4 dn: the difference of two frames has a standard deviation of 4 sqrt(2), known to
    1.1 % (one standard error), and nothing of the speckle, whose standard deviation is about 60 dn."""
    np.save(tmp_path / "flat.npy", np.full((64, 64), 0.5, np.float32))
    common = ["--read-noise", 4, "--no-preview", "--format", "npy", "--bits", 12]
    ok("render", "flat.npy", "-o", "still", "--frames", 3, *common)
    still = [frame.astype(float) for frame in frames(tmp_path / "still")]
    assert still[0].std() > 30
    for a, b in ((0, 1), (1, 2)):
        assert (still[b] - still[a]).std() == pytest.approx(4 * np.sqrt(2), rel=0.06)
    ok("render", "flat.npy", "-o", "all", "--frames", 2, "--refresh", "all", *common)
    changing = [frame.astype(float) for frame in frames(tmp_path / "all")]
    assert (changing[1] - changing[0]).std() > 30
    np.testing.assert_array_equal(changing[0], still[0])


def test_refresh_mask(ok, refused, tmp_path: Path) -> None:
    """Only the light of masked pixels changes. A wide pupil with a soft rim spreads a point over few pixels, so that
    far from the mask nothing does; `none` ignores the mask."""
    np.save(tmp_path / "flat.npy", np.full((64, 64), 0.5, np.float32))
    mask = np.zeros((64, 64), np.uint8)
    mask[:, 32:] = 255
    np.save(tmp_path / "mask.npy", mask)
    settings = [
        "--frames",
        2,
        "--no-preview",
        "--read-noise",
        0,
        "--format",
        "npy",
        "--relative-diameter",
        1,
        "--soft-rim",
        1,
    ]
    ok("render", "flat.npy", "-o", "mask", "--refresh-mask", "mask.npy", *settings)
    first, second = (frame.astype(float) for frame in frames(tmp_path / "mask"))
    change = np.abs(second - first)
    assert change[:, 40:56].mean() > 20
    assert change[:, 12:20].mean() < 1
    ok("render", "flat.npy", "-o", "none", "--refresh-mask", "mask.npy", "--refresh", "none", *settings)
    np.testing.assert_array_equal(*frames(tmp_path / "none"))
    np.save(tmp_path / "small.npy", mask[:32])
    message = refused("render", "flat.npy", "-o", "out", "--refresh-mask", "small.npy")
    assert "small.npy" in message and "64 x 32" in message and "64 x 64" in message


def test_a_mask_that_is_asked_for_and_missing_is_told(ok, ideal: Path) -> None:
    assert "no refresh mask" in ok("render", ideal, "-o", "out", *QUICK, "--refresh", "mask").err


def test_first_frame(ok, ideal: Path, tmp_path: Path) -> None:
    run = ok("render", ideal, "-o", "out", "--first-frame", 41, "--frames", 2, *QUICK, "--json").json()
    assert run["output"]["files"] == ["config.json", "frame_000041.npy", "frame_000042.npy"]
    ok("render", ideal, "-o", "zero", *QUICK)
    assert not np.array_equal(frames(tmp_path / "out")[0], frames(tmp_path / "zero")[0])


def test_frames_of_a_sequence(ok, refused, tmp_path: Path) -> None:
    np.save(tmp_path / "stack.npy", np.random.default_rng(0).random((4, 48, 64), dtype=np.float32))
    ok("render", "stack.npy", "-o", "out", "--frames", 2, *QUICK)
    assert len(frames(tmp_path / "out")) == 2
    message = refused("render", "stack.npy", "-o", "none", "--frames", 5)
    assert "--frames 5" in message and "4 frames" in message


@pytest.mark.parametrize("bits", [8, 10, 16])
def test_automatic_exposure(ok, tmp_path: Path, bits: int) -> None:
    """A flat image speckles to a mean of half of full scale. Its mean is that of some 2000 independent speckles, so
    that its relative standard error is about 2 %."""
    np.save(tmp_path / "flat.npy", np.full((96, 96), 3.7e-3, np.float32))
    settings = ["--exposure-gain", "auto", "--bits", bits, "--relative-diameter", 0.5, "--black-level", 16, *QUICK]
    summary = ok("render", "flat.npy", "-o", "out", *settings, "--json").json()
    gain = summary["exposure_gain_dn"]
    half = (2**bits - 1) / 2
    assert gain == pytest.approx((half - 16) / (3.7e-3 * summary["aperture"]["mean_transmission"]), rel=1e-5)
    assert summary["config"]["sensor"]["exposure_gain_dn"] == gain
    text = ok("render", "flat.npy", "-o", "eyes", *settings).out
    assert f"--exposure-gain {gain!r}" in text
    frame = frames(tmp_path / "out")[0].astype(float)
    # Exponential intensities of mean h - 16 above 16, clipped at 2 h.
    scale = half - 16
    expected = 16 + scale * (1 - np.exp(-(2 * half - 16) / scale))
    assert frame.mean() == pytest.approx(expected, rel=0.08)


def test_automatic_exposure_needs_light(refused, tmp_path: Path) -> None:
    np.save(tmp_path / "black.npy", np.zeros((48, 64), np.float32))
    assert "--exposure-gain" in refused("render", "black.npy", "-o", "out", "--exposure-gain", "auto")
    np.save(tmp_path / "dim.npy", np.full((48, 64), 0.1, np.float32))
    message = refused(
        "render", "dim.npy", "-o", "out", "--exposure-gain", "auto", "--effect", "ambient_light:level_dn=2000"
    )
    assert (
        "the code without light, 64, and ambient light of 2000 dn leave nothing of the range, which ends at 1023; "
        "lower them" in message
    )


def test_dark_frame(ok, refused, tmp_path: Path) -> None:
    dark = np.random.default_rng(1).integers(0, 200, (48, 64)).astype(np.float32)
    np.save(tmp_path / "dark.npy", dark)
    np.save(tmp_path / "black.npy", np.zeros((48, 64), np.float32))
    settings = [*QUICK, "--read-noise", 0, "--black-level", 10]
    ok("render", "black.npy", "-o", "out", "--dark-frame", "dark.npy", *settings)
    np.testing.assert_array_equal(frames(tmp_path / "out")[0], dark + 10)
    np.save(tmp_path / "other.npy", dark[:40])
    message = refused("render", "black.npy", "-o", "none", "--dark-frame", "other.npy")
    assert "other.npy" in message and "64 x 40" in message
    dark[3, 7] = np.nan
    np.save(tmp_path / "nan.npy", dark)
    assert "pixel (7, 3)" in refused("render", "black.npy", "-o", "none", "--dark-frame", "nan.npy")


def test_gain_map(ok, refused, tmp_path: Path) -> None:
    gains = np.where(np.arange(64) % 2, 0.875, 1.125).astype(np.float32) * np.ones((48, 64), np.float32)
    np.save(tmp_path / "gain.npy", gains)
    np.save(tmp_path / "one.npy", np.ones((48, 64), np.float32))
    settings = [
        *QUICK,
        "--read-noise",
        0,
        "--black-level",
        10,
        "--exposure-gain",
        200,
        "--illumination",
        "incoherent",
        "--normalization",
        "unit_mean",
    ]
    ok("render", "one.npy", "-o", "out", "--gain-map", "gain.npy", *settings)
    np.testing.assert_array_equal(frames(tmp_path / "out")[0], 200 * gains + 10)
    for name, changed, words in (
        ("other", gains[:40], "64 x 40"),
        ("negative", gains - 1, "pixel (1, 0) of the gain map is -0.125; it must be finite and at least 0"),
        ("dn", gains * 200, "a mean of 200, it must be 0.9 to 1.1"),
    ):
        np.save(tmp_path / f"{name}.npy", changed)
        message = refused("render", "one.npy", "-o", "none", "--gain-map", f"{name}.npy", *settings)
        assert f"{name}.npy: " in message and words in message, message
        assert not (tmp_path / "none").exists()
    np.save(tmp_path / "divided.npy", gains * 200 / 200)  # what the message says to do
    ok("render", "one.npy", "-o", "again", "--gain-map", "divided.npy", *settings)


def test_pupil_image(ok, refused, tmp_path: Path) -> None:
    """A pupil of 0.5 everywhere in its square passes a quarter of the light that one of 1 does."""
    np.save(tmp_path / "flat.npy", np.ones((64, 64), np.float32))
    for name, value in (("one", 1.0), ("half", 0.5)):
        np.save(tmp_path / f"{name}.npy", np.full((16, 16), value, np.float32))
        ok("render", "flat.npy", "-o", name, "--pupil-image", f"{name}.npy", "--no-sensor", "--format", "float-npy")
    one, half = (np.load(tmp_path / name / "frame_000000.npy") for name in ("one", "half"))
    np.testing.assert_allclose(half, one / 4, rtol=1e-5)
    np.save(tmp_path / "two.npy", np.full((16, 16), 2.0, np.float32))
    message = refused("render", "flat.npy", "-o", "none", "--pupil-image", "two.npy")
    assert "two.npy: pixel (0, 0) is 2" in message


def test_padding_is_told(ok, tmp_path: Path) -> None:
    """Sides of 34 = 2 x 17 and 38 = 2 x 19 have prime factors that the FFT does not take."""
    np.save(tmp_path / "odd.npy", np.ones((38, 34), np.float32))
    summary = ok("render", "odd.npy", "-o", "out", *QUICK, "--json").json()
    assert summary["grid"] == {"width": 35, "height": 39, "padded": True}
    assert "padded from 34 x 38" in ok("render", "odd.npy", "-o", "eyes", *QUICK).out
    assert np.load(tmp_path / "out" / "frame_000000.npy").shape == (38, 34)


def test_too_large_an_aperture(refused, ok, ideal: Path) -> None:
    message = refused("render", ideal, "-o", "out", "--relative-diameter", 1.2)
    assert "oversampling" in message
    ok("render", ideal, "-o", "out", "--relative-diameter", 1.2, "--oversampling", 2, *QUICK)


def test_json_summary(ok, ideal: Path, tmp_path: Path) -> None:
    """Standard output is one JSON document that agrees with the frames."""
    run = ok("render", ideal, "-o", "out", "--frames", 3, "--stage-times", "--exposure-gain", 4000, "--json")
    summary = run.json()
    assert summary["frames"] == 3
    assert summary["image"] == {"width": 64, "height": 48}
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert summary["output"]["files"] == written
    assert len(written) == 7
    stages = summary["milliseconds"]["stages"]
    assert {"phase", "fft", "inverse_fft"} <= set(stages)
    assert stages["inverse_fft"]["frames"] == 3 and stages["inverse_fft"]["mean"] > 0
    assert summary["frames_per_second"]["device"] > 0
    import imageio.v3 as iio

    codes = [iio.imread(tmp_path / "out" / f"frame_{i:06}.png").astype(float) for i in range(3)]
    first = summary["first_frame"]
    assert first["mean"] == pytest.approx(codes[0].mean(), rel=1e-6)
    assert first["standard_deviation"] == pytest.approx(codes[0].std(ddof=1), rel=1e-5)
    assert first["contrast"] == pytest.approx(codes[0].std(ddof=1) / (codes[0].mean() - 64), rel=1e-5)
    assert first["saturated_share"] == np.mean(codes[0] == 1023) > 0
    assert summary["saturated_share"] == pytest.approx(np.mean(np.array(codes) == 1023), rel=1e-12)
    assert summary["config"]["sensor"]["exposure_gain_dn"] == 4000


def test_saturated_share_of_float_frames(ok, ideal: Path) -> None:
    settings = ["--exposure-gain", 4000, "--no-preview", "--json"]
    codes = ok("render", ideal, "-o", "codes", "--format", "npy", *settings).json()
    values = ok("render", ideal, "-o", "values", "--format", "float-npy", "--float-full-scale", 7.3, *settings).json()
    assert values["saturated_share"] == codes["saturated_share"] > 0
    assert values["first_frame"]["contrast"] == pytest.approx(codes["first_frame"]["contrast"], rel=1e-4)


def test_a_frame_without_light_has_no_contrast(ok, tmp_path: Path) -> None:
    np.save(tmp_path / "black.npy", np.zeros((48, 64), np.float32))
    settings = ["render", "black.npy", "-o", "out", "--illumination", "dark", "--read-noise", 0, "--black-level", 10]
    assert "standard deviation 0, contrast above the black level -\n" in ok(*settings).out
    assert ok(*settings, "--json").json()["first_frame"]["contrast"] is None


def test_summary_for_eyes_and_quiet(ok, ideal: Path) -> None:
    text = ok("render", ideal, "-o", "out", "--stage-times").out
    for word in (
        "device",
        "field grid",
        "no padding",
        "contrast",
        "saturated",
        "time, ms",
        "frames per second",
        "median",
    ):
        assert word in text
    assert ok("render", ideal, "-o", "out", "--quiet").out == ""


def test_progress_bar_on_a_terminal_only(ok, program: Path, ideal: Path, tmp_path: Path) -> None:
    arguments = ["render", ideal.name, "-o", "out", "--frames", "4", *QUICK]
    assert "/4 frames" not in ok(*arguments).err
    master, slave = pty.openpty()
    process = subprocess.Popen([program, *arguments], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=slave)
    os.close(slave)
    shown = b""
    while True:
        try:
            part = os.read(master, 4096)
        except OSError:
            break
        if not part:
            break
        shown += part
    os.close(master)
    assert process.wait() == 0
    assert b"/4 frames" in shown


def test_interrupt_leaves_whole_files_only(program: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "image.npy", np.ones((256, 256), np.float32))
    command = [program, "render", "image.npy", "-o", "out", "--frames", "100000", "--format", "npy", "--no-preview"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 120
    while len(list((tmp_path / "out").glob("frame_*.npy"))) < 3:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 130, error
    assert b"interrupted" in error
    for path in (tmp_path / "out").iterdir():
        assert np.load(path).shape == (256, 256)


def test_several_images(ok, refused, tmp_path: Path) -> None:
    for i in range(2):
        np.save(tmp_path / f"image_{i}.npy", images.real())
    np.save(tmp_path / "image_2.npy", images.real()[:20])
    ok("render", "image_0.npy", "image_1.npy", "-o", "out", *QUICK)
    result = frames(tmp_path / "out")
    assert len(result) == 2 and result[0].shape == images.real().shape


def test_an_image_of_another_size_is_refused_before_the_first_frame(refused, tmp_path: Path) -> None:
    np.save(tmp_path / "image_0.npy", images.real())
    np.save(tmp_path / "image_1.npy", images.real()[:20])
    error = refused("render", "image_0.npy", "image_1.npy", "-o", "out", *QUICK)
    assert "image_1.npy" in error and "40 x 20" in error and "40 x 28" in error


def test_a_stack_of_another_size_is_refused_before_the_first_frame(refused, tmp_path: Path) -> None:
    np.save(tmp_path / "stack_0.npy", np.ones((3, *images.real().shape), np.float32))
    np.save(tmp_path / "stack_1.npy", np.ones((3, 20, 40), np.float32))
    error = refused("render", "stack_*.npy", "-o", "out", *QUICK)
    assert "stack_1.npy" in error and "40 x 20" in error and "40 x 28" in error


# --- The output never replaces the input ---

OWN_INPUT = {
    "frame": ("frame_000000.npy", ["--format", "npy"]),
    "later frame": ("frame_000007.npy", ["--format", "npy", "--first-frame", 5, "--frames", 3]),
    "stack": ("frames.npy", ["--format", "npy-stack"]),
    "ideal image": ("ideal_000000.npy", ["--save-ideal"]),
    "preview": ("preview_000000.png", ["--preview"]),
    "preview of the ideal image": ("ideal_preview_000000.png", ["--preview", "--save-ideal"]),
}


@pytest.mark.parametrize("what", OWN_INPUT)
def test_output_over_the_input_is_refused(cli, refused, tmp_path: Path, what: str) -> None:
    """By its name, through another path, and through a link; nothing is written, and another folder is fine."""
    name, arguments = OWN_INPUT[what]
    folder = tmp_path / "in"
    folder.mkdir()
    if name.endswith(".png"):
        iio.imwrite(folder / name, (images.real() * 60000).clip(0, 65535).astype(np.uint16))
    else:
        np.save(folder / name, images.real())
    before = (folder / name).read_bytes()
    (tmp_path / f"link{Path(name).suffix}").symlink_to(folder / name)
    for given in (f"in/{name}", f"in/../in/{name}", f"link{Path(name).suffix}"):
        message = refused("render", given, "-o", "in", *arguments)
        assert f"would overwrite the input {given}" in message and "--output" in message
    assert (folder / name).read_bytes() == before
    assert [path.name for path in folder.iterdir()] == [name]
    assert cli("render", f"in/{name}", "-o", "out", *arguments).code == 0


def test_output_over_other_inputs_is_refused(refused, ideal: Path, tmp_path: Path) -> None:
    """A refresh mask, a dark frame and a pupil image are inputs as well."""
    (tmp_path / "in").mkdir()
    shape = np.load(ideal).shape
    iio.imwrite(tmp_path / "in" / "preview_000000.png", np.zeros(shape, np.uint8))
    np.save(tmp_path / "in" / "frame_000000.npy", np.zeros(shape, np.float32))
    for option, name, arguments in (
        ("--refresh-mask", "preview_000000.png", []),
        ("--dark-frame", "frame_000000.npy", ["--format", "npy"]),
        ("--pupil-image", "preview_000000.png", []),
    ):
        message = refused("render", ideal, "-o", "in", option, f"in/{name}", *arguments)
        assert "would overwrite the input" in message and name in message


# --- A folder as input ---


def test_a_folder_with_the_results_of_a_run(ok, refused, tmp_path: Path) -> None:
    """Previews and frames of a run are no ideal images; ideal_*.npy are, and so is what a renderer called frame_*."""
    folder = tmp_path / "both"
    folder.mkdir()
    for i in range(2):
        np.save(folder / f"view_{i}.npy", images.real() * (i + 1))
    ok("render", "both", "-o", "expected", *QUICK)
    expected = frames(tmp_path / "expected")
    assert len(expected) == 2

    ok("render", "both", "-o", "both", "--format", "npy", "--save-ideal", "--preview")
    assert len(list(folder.glob("preview_*.png"))) == len(list(folder.glob("ideal_preview_*.png"))) == 2
    for i in range(2):
        (folder / f"view_{i}.npy").unlink()
    ok("render", "both", "-o", "again", *QUICK)
    for got, wanted in zip(frames(tmp_path / "again"), expected):
        np.testing.assert_array_equal(got, wanted)
    assert len(frames(tmp_path / "again")) == 2

    for path in folder.glob("ideal_*.npy"):
        path.unlink()
    message = refused("render", "both", "-o", "out")
    assert "both: the folder holds only what an earlier run wrote" in message
    (folder / "config.json").unlink()  # now nobody knows whose frames they are
    ok("render", "both", "-o", "from_frames", *QUICK)
    assert len(frames(tmp_path / "from_frames")) == 2


def test_frames_of_another_kind_than_the_run_wrote_stay(ok, tmp_path: Path) -> None:
    """A renderer's frame_*.npy beside a run of 16-bit PNG files."""
    folder = tmp_path / "mine"
    folder.mkdir()
    np.save(folder / "frame_000000.npy", images.real())
    ok("render", "mine", "-o", "mine", "--no-preview")
    assert (folder / "frame_000000.png").is_file()
    ok("render", "mine", "-o", "out", *QUICK)
    assert len(frames(tmp_path / "out")) == 1
    (folder / "config.json").write_text('{"another": "program"}')
    (folder / "frame_000000.npy").unlink()
    ok("render", "mine", "-o", "other", *QUICK)
    assert len(frames(tmp_path / "other")) == 1


def test_statistics_of_the_folder_of_a_run(ok, ideal: Path) -> None:
    """The frames, not their previews."""
    ok("render", ideal, "-o", "run", "--frames", 2)
    found = ok("statistics", "run", "--json").json()["frames"]
    assert [Path(frame["file"]).name for frame in found] == ["frame_000000.png", "frame_000001.png"]


# --- Exit codes ---


def test_too_large_a_grid_is_wrong_usage(refused, tmp_path: Path) -> None:
    """Told before a device is looked for: exit code 1 even where there is none."""
    np.save(tmp_path / "wide.npy", np.ones((2, 16384), np.float32))
    (tmp_path / "vendors").mkdir()
    no_device = {
        **os.environ,
        "OCL_ICD_VENDORS": str(tmp_path / "vendors"),
        "OPENCL_VENDOR_PATH": str(tmp_path / "vendors"),
    }
    for arguments in (["--oversampling", 8], ["--guard-px", 16384]):
        for settings in ({}, {"env": no_device}):
            message = refused("render", "wide.npy", "-o", "out", *arguments, **settings)
            assert "grid" in message, message
    refused("render", "wide.npy", "-o", "out", code=2, env=no_device)
