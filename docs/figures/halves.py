"""Draws docs/images/halves.png, the README's figure.

Above: ideal and simulated. Below: a camera, the simulator, the simulator with the effects that were found. The camera
is a stand-in: the program draws it with defocus and glare, which the diagnosis is not told. With `--capture` a real
one takes its place.

    .venv/bin/python docs/figures/halves.py            # about a minute
    .venv/bin/python docs/figures/halves.py --capture my-camera --sequence dots_static --out my-halves.png
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).parents[2]
HIDDEN = ("defocus:waves=0.9", "glare:fraction=0.12")
SEED = 5

Codes = npt.NDArray[np.float64]


def clspeckle(program: Path, *words: object) -> None:
    subprocess.run([str(program), *map(str, words), "--quiet"], check=True)


def scene(program: Path, folder: Path) -> tuple[Codes, Codes]:
    """The first frame of the office: what a renderer made of it, and what the camera records, above the black level."""
    buffers = ROOT / "examples" / "office" / "gbuffers"
    subprocess.run(["tar", "-xf", str(buffers / "frames.tar.xz"), "-C", str(folder)], check=True)
    for name in ("sequence.json", "pattern.png"):
        (folder / name).write_bytes((buffers / name).read_bytes())
    clspeckle(
        program, "render", folder / "sequence.json", "-o", folder / "office", "--frames", 1, "--save-ideal",
        "--no-preview", "--degree-of-polarization", 0, "--exposure-gain", "auto", "--format", "npy", "--seed", SEED,
    )  # fmt: skip
    ideal = np.load(next((folder / "office").glob("ideal_*.npy"))).astype(float)
    codes = np.load(next((folder / "office").glob("frame_*.npy"))).astype(float)
    return ideal, codes - 64


def numbers(codes: Codes, black: float) -> dict[str, float]:
    mean = codes.mean(axis=0) - black
    return {
        "mean": mean.mean(),
        "contrast": mean.std() / mean.mean(),
        "noise": np.sqrt(codes.var(axis=0, ddof=1).mean()),
    }


def effects(profile: dict[str, Any]) -> list[str]:
    """What the verdict names, as options of the program."""
    return [
        f"{found['effect']}:{','.join(f'{name}={value:.6g}' for name, value in found['parameters'].items())}"
        for found in profile["effects"]
        if found["named"]
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "bin" / "clspeckle")
    parser.add_argument("--capture", type=Path, help="a capture set of your own instead of the stand-in")
    parser.add_argument("--sequence", default="dots_static", help="which of its sequences is shown")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images" / "halves.png")
    arguments = parser.parse_args()
    program = arguments.program

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        top = scene(program, folder)
        capture = arguments.capture
        if capture is None:
            capture = folder / "camera"
            clspeckle(
                program, "capture", "make", capture, "--seed", SEED, *(w for e in HIDDEN for w in ("--effect", e))
            )
        clspeckle(program, "diagnose", capture, "--json", folder / "report.json", "--profile", folder / "found.json")
        report = json.loads((folder / "report.json").read_text())
        named = effects(json.loads((folder / "found.json").read_text()))
        camera = json.loads((capture / "capture.json").read_text())["camera"]
        black = report["calibration"]["black_level_dn"]
        (folder / "dots.json").write_text((capture / "capture.json").read_text())
        same = (
            "--width", camera["width"], "--height", camera["height"], "--bits", camera["bits"],
            "--pixel-pitch-um", camera["pixel_pitch_um"], "--f-number", camera["f_number"],
            "--dots", folder / "dots.json", "--seed", SEED + 1,
        )  # fmt: skip
        clspeckle(program, "capture", "make", folder / "plain", *same)
        clspeckle(program, "capture", "make", folder / "found", *same, *(w for e in named for w in ("--effect", e)))
        file = f"{arguments.sequence}.npy"
        bottom = [np.load(path / file).astype(float) for path in (capture, folder / "plain", folder / "found")]

    draw(top, bottom, report, black, named, arguments)


def draw(
    top: tuple[Codes, Codes],
    bottom: list[Codes],
    report: dict[str, Any],
    black: float,
    named: list[str],
    arguments: argparse.Namespace,
) -> None:
    figure = plt.figure(figsize=(10, 8.2), layout="constrained")
    rows = figure.subfigures(2, 1, height_ratios=[1.12, 1])
    rows[0].suptitle("Forward: what a renderer makes, and what the camera records", fontsize=12)
    for axis, image, title in zip(rows[0].subplots(1, 2), top, ("ideal", "simulated, 10 bits"), strict=True):
        axis.imshow(np.sqrt(np.maximum(image, 0)), cmap="gray", vmin=0, vmax=np.sqrt(np.percentile(image, 99.8)))
        axis.set_title(title, fontsize=10)
        axis.set(xticks=[], yticks=[])
    who = "stand-in camera" if arguments.capture is None else "camera"
    rows[1].suptitle(f"Backward: what the simulator lacks, as `clspeckle diagnose` finds it of a {who}", fontsize=12)
    fraction = report["shrink"]["fraction"]
    gone = ("", "0 %", f"{100 * fraction:.0f} %")
    shown = f"{who}\n(drawn with defocus and glare)" if arguments.capture is None else who
    titles = (shown, "simulator", "simulator with\n" + ", ".join(e.partition(":")[0] for e in named))
    top_code = np.percentile(bottom[0][0] - black, 99.7)
    for axis, codes, title, part in zip(rows[1].subplots(1, 3), bottom, titles, gone, strict=True):
        axis.imshow(codes[0] - black, cmap="gray", vmin=0, vmax=top_code, interpolation="nearest")
        axis.set_title(title, fontsize=10)
        axis.set(xticks=[], yticks=[])
        n = numbers(codes, black)
        text = f"mean {n['mean']:.1f} DN   contrast {n['contrast']:.2f}\nnoise {n['noise']:.1f} DN"
        axis.set_xlabel(text + (f"   part of the gap gone {part}" if part else ""), fontsize=9)
        print(f"{title!r}: {n} {part}")
    print("hidden:", ", ".join(HIDDEN) if arguments.capture is None else "unknown")
    print("named: ", ", ".join(named))
    temporary = arguments.out.with_name(arguments.out.name + ".tmp.png")
    figure.savefig(temporary, dpi=100)
    temporary.replace(arguments.out)


if __name__ == "__main__":
    main()
