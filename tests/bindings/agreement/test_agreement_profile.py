"""What a report says to paste runs, and renders the camera of the profile's file: command line, Python, C."""

from __future__ import annotations

import html
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import clspeckle

ROOT = Path(__file__).parents[3]
BIN = Path(os.environ.get("CLSPECKLE_BIN", ROOT / "build" / "bin"))
LIBRARY = Path(os.environ.get("CLSPECKLE_LIBRARY", ROOT / "build" / "lib" / "libclspeckle.so.0"))
SHAPE, FRAMES, SEED, GAIN = (80, 96), 3, 9, 250.0
EFFECTS = ["row_noise:sigma_dn=3", "vignetting:corner_loss=0.3", "zero_order:relative_intensity=12"]

MAIN = r"""
#include "camera.h"
#include <stdio.h>
#include <stdlib.h>
#define CHECK(call) do { if ((call) != CLSP_SUCCESS) { fprintf(stderr, "%s\n", #call); exit(1); } } while (0)
int main(void) {
    enum { WIDTH = 96, HEIGHT = 80, PIXELS = WIDTH * HEIGHT };
    ClspContext context; ClspPhase phase; ClspAperture aperture; ClspLens lens; ClspSensor sensor;
    ClspPipeline pipeline; ClspPhaseDesc phase_desc; ClspApertureDesc aperture_desc; ClspLensDesc lens_desc;
    ClspSensorDesc sensor_desc; ClspPipelineDesc pipeline_desc; ClspFrame frame;
    cl_command_queue queue; cl_mem irradiance, output;
    static float ideal[PIXELS]; static uint16_t codes[PIXELS];
    int i;
    for (i = 0; i < PIXELS; ++i)
        ideal[i] = 1.0f;
    CHECK(clspContextCreate(NULL, &context));
    CHECK(clspQueueCreate(context, 0, &queue));
    CHECK(clspBufferCreate(context, sizeof ideal, &irradiance));
    CHECK(clspBufferCreate(context, sizeof codes, &output));
    CHECK(clspBufferWrite(queue, ideal, sizeof ideal, irradiance, 0));
    CHECK(clspPhaseDescInit(&phase_desc, sizeof phase_desc));
    CHECK(clspApertureDescInit(&aperture_desc, sizeof aperture_desc));
    CHECK(clspLensDescInit(&lens_desc, sizeof lens_desc));
    CHECK(clspSensorDescInit(&sensor_desc, sizeof sensor_desc));
    CHECK(clspPipelineDescInit(&pipeline_desc, sizeof pipeline_desc));
    CHECK(clspFrameInit(&frame, sizeof frame));
    describe_camera(&phase_desc, &aperture_desc, &lens_desc, &sensor_desc);
    phase_desc.seed = sensor_desc.seed = pipeline_desc.seed = 9;
    sensor_desc.exposure_gain_dn = 250;
    CHECK(clspPhaseCreate(context, &phase_desc, &phase));
    CHECK(clspApertureCreate(context, &aperture_desc, &aperture));
    CHECK(clspLensCreate(context, &lens_desc, &lens));
    CHECK(clspSensorCreate(context, &sensor_desc, &sensor));
    pipeline_desc.phase = phase;
    pipeline_desc.aperture = aperture;
    pipeline_desc.lens = lens;
    pipeline_desc.sensor = sensor;
    CHECK(clspPipelineCreate(context, &pipeline_desc, &pipeline));
    CHECK(set_camera_effects(pipeline));
    frame.irradiance.mem = irradiance;
    frame.irradiance.width = frame.output.width = WIDTH;
    frame.irradiance.height = frame.output.height = HEIGHT;
    frame.irradiance.format = CLSP_FORMAT_FLOAT32;
    frame.output.mem = output;
    frame.output.format = CLSP_FORMAT_UINT16;
    for (i = 0; i < 3; ++i) {
        frame.frame_index = (uint64_t)i;
        CHECK(clspPipelineEnqueueFrame(pipeline, queue, &frame, 0, NULL, NULL));
        CHECK(clspBufferRead(queue, output, 0, sizeof codes, codes));
        fwrite(codes, sizeof codes, 1, stdout);
    }
    return 0;
}
"""


def run(folder: Path, *words: object, **settings: object) -> subprocess.CompletedProcess[bytes]:
    done = subprocess.run([str(word) for word in words], cwd=folder, check=False, capture_output=True, **settings)  # type: ignore[call-overload]
    assert done.returncode == 0, done.stderr.decode()
    return done


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A diagnosed capture: report.json, camera.json, and what the camera renders."""
    folder = tmp_path_factory.mktemp("pasted")
    effects = [word for effect in EFFECTS for word in ("--effect", effect)]
    run(folder, BIN / "clspeckle", "capture", "make", "set", "--width", 96, "--height", 80, "--frames", 8, *effects)
    reports = ["--json", "report.json", "--html", "report.html", "--profile", "camera.json"]
    summary = run(folder, BIN / "clspeckle", "diagnose", "set", *reports)
    (folder / "summary.txt").write_bytes(summary.stdout)
    np.save(folder / "ideal.npy", np.ones(SHAPE, np.float32))
    render = [
        BIN / "clspeckle",
        "render",
        "ideal.npy",
        "-o",
        "expected",
        "--profile",
        "camera.json",
        "--profile-maps",
        "off",
    ]
    run(folder, *render, *COMMON.split())
    return folder


COMMON = f"--exposure-gain {GAIN} --seed {SEED} --refresh none --frames {FRAMES} --format npy-stack --no-preview"


def pasted(folder: Path, key: str) -> str:
    text: str = json.loads((folder / "report.json").read_text())["paste"][key]
    return text


def expected(folder: Path) -> npt.NDArray[np.uint16]:
    frames: npt.NDArray[np.uint16] = np.load(folder / "expected" / "frames.npy")
    assert frames.shape == (FRAMES, *SHAPE)
    return frames


def test_the_camera_has_effects_of_all_kinds(folder: Path) -> None:
    profile = json.loads((folder / "camera.json").read_text())
    assert {effect["effect"] for effect in profile["effects"]} == {effect.split(":")[0] for effect in EFFECTS}


def test_command_line(folder: Path) -> None:
    text = pasted(folder, "command_line")
    assert "# left out, as the image has the pattern: zero_order:relative_intensity=" in text
    assert "# board_moving: --illumination laser --refresh all --exposure-gain-dn 1" in text
    path = f"{BIN}:{os.environ['PATH']}"
    run(folder, "bash", "-ec", f"{text.rstrip()} {COMMON}", env={**os.environ, "PATH": path})
    np.testing.assert_array_equal(np.load(folder / "frames" / "frames.npy"), expected(folder))


def test_python(folder: Path) -> None:
    names: dict[str, object] = {}
    text = pasted(folder, "python")
    exec(text.replace("    effects={", f"    seed={SEED}, exposure_gain_dn={GAIN},\n    effects={{"), names)
    camera = names["camera"]
    assert isinstance(camera, clspeckle.Pipeline)
    np.testing.assert_array_equal(camera.render_batch([np.ones(SHAPE, np.float32)] * FRAMES), expected(folder))
    assert '# with dots=clspeckle.Dots(...): "zero_order"' in text


@pytest.mark.parametrize("standard", ["c99", "c17"])
def test_c(folder: Path, standard: str) -> None:
    (folder / "camera.h").write_text(pasted(folder, "c"))
    (folder / "main.c").write_text(MAIN)
    options = ["-Wall", "-Wextra", "-Werror", f"-std={standard}", f"-I{ROOT / 'capi' / 'include'}"]
    compiler = os.environ.get("CLSPECKLE_C_COMPILER", "cc")
    run(folder, compiler, *options, "main.c", "-o", "main", LIBRARY, f"-Wl,-rpath,{LIBRARY.parent}", "-lOpenCL")
    codes = np.frombuffer(run(folder, folder / "main").stdout, np.uint16).reshape(FRAMES, *SHAPE)
    np.testing.assert_array_equal(codes, expected(folder))


def test_page_and_terminal_have_the_same(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    summary = (folder / "summary.txt").read_text()
    for key in ("command_line", "python", "c"):
        text = pasted(folder, key)
        assert text in summary
        assert text in html.unescape(page)


def test_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """docs/reference/profile.md, its commands and its Python."""
    page = (ROOT / "docs" / "reference" / "profile.md").read_text()
    (commands,) = re.findall(r"```sh\n(.*?)```", page, re.DOTALL)
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    scripts = f"{BIN}:{Path(sys.executable).parent}"
    run(tmp_path, "bash", "-ec", commands, env={**os.environ, "PATH": f"{scripts}:{os.environ['PATH']}"})
    assert np.load(tmp_path / "frames" / "frames.npy").shape == (12, 80, 96)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(code, "docs/reference/profile.md", "exec"), names)
    assert {line.split()[0] for line in capsys.readouterr().out.splitlines()} == {
        "shot_noise",
        "row_noise",
        "vignetting",
    }
    assert np.shape(names["codes"]) == (80, 96)
